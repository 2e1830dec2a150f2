"""`hexatorque fmu`: the page's commands, what is in the file, and mistakes in one line."""

import ctypes
import itertools
import os
import re
import shlex
import struct
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import check_c
import pytest
import shared_objects
from campaigns import WHOLE
from fmu_masters import Fmu, made_once

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.fmu import controller

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "fmu.md").read_text()
#: Set where `make dist` has compiled each system's C library already.
ALL_SYSTEMS = "HT_ALL_SYSTEMS" in os.environ
needs_zig = pytest.mark.skipif(not shared_objects.HAS_ZIG, reason="pip install 'hexatorque[fmu]'")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_pages_commands_work(folder, capsys):
    (folder / "mine.toml").write_text('setup = "paper-b"\n')
    (block,) = re.findall(r"```sh\n(.*?)```", PAGE, re.S)
    commands = [shlex.split(line)[1:] for line in block.splitlines()]
    assert len(commands) == 4
    for words in commands:
        assert main(words) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1] == "out/mine.fmu: FMI 2.0 for linux64, with sources"
    versions = []
    for words in commands:
        with zipfile.ZipFile(folder / words[1]) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        versions.append(root.get("fmiVersion"))
    assert versions == ["2.0", "3.0", "2.0", "2.0"]


@pytest.mark.parametrize(
    "words, line",
    [
        (["mine.zip"], r"mine\.zip: the name must end with \.fmu"),
        (["a.fmu", "--setup", "nothing"], r"no set-up 'nothing'.*"),
        (["a.fmu", "--set", "controller.rs_ohm=5000"], r".*rs_ohm = 5000: allowed range is .*"),
        (["a.fmu", "--set", "controller.vdc_min_V=900"], r".*vdc_min_V = 900 V: must be below .*"),
        (["a.fmu", "--fmi", "1"], r"--fmi: '1' is not one of '2', '3'.*"),
        (["/proc/none/a.fmu"], r"/proc/none/a\.fmu: .*"),
    ],
)
def test_a_mistake_is_one_line(words, line, capsys):
    assert main(["fmu", *words]) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said and re.search(line, said), said
    assert not Path("a.fmu").exists()


def test_without_any_compiler_one_line_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(controller, "program", lambda name: None)
    assert main(["fmu", "a.fmu"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1 and "pip install 'hexatorque[fmu]'" in said[0]


@pytest.mark.parametrize("kind, version", [*itertools.product(("controller", "drive"), (2, 3))])
def test_its_sources_alone_make_the_binary(kind, version, folder):
    """A tool compiles what the description lists, in one folder, and nothing else. -O0 saves time;
    that the optimised code has the right bits is for the tests of the FMUs. The firmware's warnings
    are errors; what is translated has unused parameters and, in the drive, sums of float and
    double."""
    controller.write(folder / "a.fmu", setups.load("paper-a"), kind, version, only_here=True)
    with zipfile.ZipFile(folder / "a.fmu") as archive:
        archive.extractall(folder)
        names = set(archive.namelist())
    root = ElementTree.parse(folder / "sources/buildDescription.xml").getroot()
    listed = [file.get("name") for file in root.iter("SourceFile")]
    if version == 2:
        description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        assert listed == [file.get("name") for file in description.iter("File")]
    (options,) = (found.get("compilerOptions") for found in root.iter("SourceFileSet"))
    compiler = controller.program("cc") or controller.program("gcc")
    command = [compiler, *shlex.split(options), *check_c.WARNINGS, "-Wno-unused-parameter"]
    if kind == "drive":
        command.append("-Wno-double-promotion")
    command += ["-O0", "-fPIC", "-shared"]
    command += ["-o", "../a.so", *listed, "-lm"]

    done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    library = ctypes.CDLL(str(folder / "a.so"))
    version_of = getattr(library, f"fmi{version}GetVersion")
    version_of.restype = ctypes.c_char_p
    assert version_of() == f"{version}.0".encode()
    assert (
        "Permission is hereby granted"
        in (folder / "documentation/licenses/license.txt").read_text()
    )
    assert not [name for name in names if re.match(r"sources/fmi\d", name)]  # none of FMI's headers


@pytest.mark.parametrize("zig", (False, pytest.param(True, marks=needs_zig)), ids=("cc", "zig"))
def test_one_command_makes_the_binary_that_the_other_tests_make_of_shared_objects(
    zig, folder, monkeypatch
):
    """As a user's command compiles it, with either compiler. All outputs have the same bits."""
    setup = setups.load("paper-a").changed({"controller.calibration_s": 0.01})
    found = []
    for one_command in (False, True):
        if one_command:
            shared_objects.by_command(monkeypatch, zig)
        _, _, unpacked = made_once({}, folder, None, setup)
        unpacked = unpacked.rename(folder / str(one_command))
        fmu = Fmu(unpacked).begin(vdc_V=250.0, run=True)
        found.append([])
        for k in range(300):
            fmu.set(i_u1_A=0.01 * k, position_rad=0.002 * k)
            fmu.step()
            found[-1].append(fmu.outputs)
    assert found[0] == found[1] and len(set(found[0])) > 100


#: How a binary of each system begins: ELF, PE, and Apple's formats.
BEGINNINGS = {
    2: {
        "linux64": (".so", b"\x7fELF"),
        "win64": (".dll", b"MZ"),
        "darwin64": (".dylib", bytes.fromhex("cafebabe")),
    },
    3: {
        "x86_64-linux": (".so", b"\x7fELF"),
        "x86_64-windows": (".dll", b"MZ"),
        "x86_64-darwin": (".dylib", bytes.fromhex("cffaedfe07000001")),
        "aarch64-darwin": (".dylib", bytes.fromhex("cffaedfe0c000001")),
    },
}


@pytest.mark.skipif(not (WHOLE or ALL_SYSTEMS), reason="takes minutes: HT_ALL_SYSTEMS=1 runs it")
@needs_zig
@pytest.mark.parametrize("version", (2, 3))
def test_with_the_extra_there_are_binaries_for_other_systems(version, folder, monkeypatch):
    shared_objects.by_command(monkeypatch, zig=True)
    controller.write(folder / "a.fmu", setups.load("paper-a"), version=version)
    with zipfile.ZipFile(folder / "a.fmu") as archive:
        found = {name: archive.read(name) for name in archive.namelist() if "binaries/" in name}
    assert len(found) == len(BEGINNINGS[version])
    for system, (suffix, begins) in BEGINNINGS[version].items():
        assert found[f"binaries/{system}/hexatorque_controller{suffix}"].startswith(begins)


def test_a_fat_file_names_its_parts():
    """Apple's format: each part begins at a multiple of its alignment, and its head says for which
    processor it is."""
    parts = [struct.pack("<III", 0xFEEDFACF, cpu, 3) + bytes(range(100)) for cpu in (7, 12)]
    image = controller.fat(*parts)
    magic, count = struct.unpack(">II", image[:8])
    assert (magic, count) == (0xCAFEBABE, 2)
    for k, part in enumerate(parts):
        cpu, kind, at, size, align = struct.unpack(">IIIII", image[8 + 20 * k : 28 + 20 * k])
        assert (cpu, kind) == struct.unpack("<II", part[4:12])
        assert at % (1 << align) == 0 and image[at : at + size] == part
