"""HT_SETUP: an image whose parameters start with those of a set-up's simulation."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ccs_projects import CC, CMAKE, NINJA
from example_setups import example_setups
from stand_in_compiler import configure, needs_cmake, stand_ins

from hexatorque import firmware, setups
from hexatorque.serial import wire

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "cmake" / "initial_values.py"
MINE = """
setup = "paper-a-feasible"
[machine]
rs_ohm = { value = 0.1234567891234, tag = "measured", note = "cold" }
psi_knee_Wb = "0,9"
drs_ohm = "0,01; 0; 0; 0; 0; 0"
[inverter]
v_switch_V = 1.2
[timing]
device = "f28377s"
latency = "Immediate"
isr_us = 7
[controller]
scheme = "DDR-ML"
torque_levels = 3
zero_hold = false
i_trip_A = { value = "21,3", tag = "assumed" }
speed_ref_rpm = -123.456
"""
#: A program that prints what LIST says about the parameters, and whether a drive starts with them.
PROGRAM = r"""
#include <stdio.h>
#include "ht_dictionary.h"
#include "ht_drive.h"
#include "ht_port_c2000.h"
static ht_regfile registers;
static ht_drive drive;
int main(void)
{
    ht_port port;
    ht_params p;
    ht_packet packet;
    uint16_t id, n;
    ht_regfile_reset(&registers, ht_board_f28377s.map);
    ht_port_bind(&port, &registers, &ht_board_f28377s);
    ht_params_default(&p);
    if (!ht_board_start(&port) || (ht_drive_init(&drive, &port, &p) != HT_OK)) {
        return 1;
    }
    for (id = 0; id < ht_param_count(); id++) {
        ht_packet_begin(&packet);
        (void)ht_dictionary_add(&packet, &port, HT_LIST_PARAMETER, id);
        for (n = 0; n < packet.n; n++) {
            printf("%02x", (unsigned)packet.octet[n]);
        }
        printf(" %.9g\n", (double)ht_drive_get(&drive, id));
    }
    return 0;
}
"""


def made(source, tmp_path, device=""):
    """The header of a set-up, made by a Python without any package."""
    output = tmp_path / "initial.h"
    command = [sys.executable, "-I", "-S", TOOL, source, device, output]
    done = subprocess.run(command, capture_output=True, text=True)
    return done, output


def in_the_header(path):
    lines = [line.split(" ", 2) for line in path.read_text().splitlines()[1:]]
    return {name.removeprefix("HT_INITIAL_"): float(value.strip("()f")) for _, name, value in lines}


def as_kept(setup):
    rows = firmware.parameters()
    return {n: np.float32(rows[n].parse(v)) for n, v in setups.parameters(setup).items()}


@pytest.mark.parametrize("source", [*setups.builtin_names(), *example_setups(), "mine"], ids=str)
def test_values_are_those_of_the_simulation(source, tmp_path):
    if source == "mine":
        source = tmp_path / "mine.toml"
        source.write_text(MINE)
    done, header = made(source, tmp_path)
    assert done.returncode == 0, done.stderr
    expected = as_kept(setups.load(source))
    found = in_the_header(header)
    assert list(found) == list(expected)
    for name, value in expected.items():
        assert np.float32(found[name]) == value, name
    read = done.stdout.splitlines()
    assert Path(read[-1]).exists() and all(line.endswith(".toml") for line in read)


CHOICES = [
    row
    for name, row in firmware.parameters().items()
    if row.choices and name not in ("load_mode", "predict")  # those belong to timing.latency
]


#: Makes the header of each set-up, in one process.
MANY = """
import runpy, sys
tool, *files = sys.argv[1:]
sys.argv[0] = tool
main = runpy.run_path(tool)["main"]
for file in files:
    sys.argv[1:] = file, "", f"{file}.h"
    if main():
        sys.exit(f"not made: {file}")
"""


def test_every_choice_has_its_number(tmp_path):
    """By name, against the compiled table."""
    numbers = {}
    for row in CHOICES:
        for number, choice in enumerate(row.choices):
            file = tmp_path / f"{row.name}-{number}.toml"
            file.write_text(f'setup = "paper-b"\n[controller]\n{row.name} = "{choice}"\n')
            numbers[file] = row.name, number
    command = [sys.executable, "-I", "-S", "-c", MANY, TOOL, *numbers]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for file, (name, number) in numbers.items():
        assert in_the_header(file.with_name(f"{file.name}.h"))[name] == number, file.name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[machine]\nrs_ohms = 1\n", "unknown key machine.rs_ohms; did you mean 'rs_ohm'?"),
        ("[machine]\nrs_ohm = -1\n", "machine.rs_ohm = -1: allowed range is 0.0001 .. 1000"),
        ("[machine]\nrs_ohm = 'x'\n", "machine.rs_ohm = 'x': a number is needed"),
        ("[machine]\npsi_knee_Wb = 1e-200\n", "machine.psi_knee_Wb = 1e-200"),
        ("[timing]\nlatency = 'late'\n", "timing.latency = 'late': choose one of"),
        ("[machine]\nflux_map = 3\n", "machine.flux_map = 3: the name of a file is needed"),
        ("[controller]\nscheme = 'ddt'\n", "controller.scheme = 'ddt': choose one of dtc1"),
        ("[controller]\nrs_ohm = 1e9\n", "controller.rs_ohm = 1e+09: allowed range is 0 .. 1000"),
        ("[controller]\nkappa_x = 1\n", "unknown key controller.kappa_x"),
        ("[machine\n", "not valid TOML"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(text, said, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(f'setup = "paper-b"\n{text}')
    done, header = made(file, tmp_path)
    assert done.returncode == 1 and not header.exists()
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{file}: {said}")


def test_files_that_are_not_there_or_go_in_circles(tmp_path):
    done, _ = made("paper-bb", tmp_path)
    assert done.stderr.startswith("paper-bb: no set-up 'paper-bb'; did you mean 'paper-b")
    done, _ = made(tmp_path / "none.toml", tmp_path)
    assert "No such file" in done.stderr
    circle = tmp_path / "circle.toml"
    circle.write_text(f'setup = "{circle}"\n')
    done, _ = made(circle, tmp_path)
    assert "refer to each other" in done.stderr and done.stderr.count("\n") == 1
    done, _ = made("paper-b", tmp_path, device="f28335")
    assert done.stderr == "paper-b: timing.device = f28377s: the image is for a f28335\n"


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of what is needed to build images."""
    folder = tmp_path_factory.mktemp("tree")
    ignore = shutil.ignore_patterns("fuzz", "__pycache__", "*.nb?")
    for name in ("firmware", "cmake", "tests/c", "host/hexatorque"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignore)
    for name in ("CMakeLists.txt", "CMakePresets.json"):
        shutil.copy(ROOT / name, folder)
    return folder


@pytest.mark.target
@needs_cmake
def test_an_image_lists_them_and_starts_with_them(tree, tmp_path):
    """The host's build of the firmware, and LIST as a client reads it."""
    mine = tmp_path / "mine.toml"
    mine.write_text(MINE)
    build = tmp_path / "build"
    command = [CMAKE, "-S", tree, "-B", build, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={NINJA}"]
    command += ["-DHT_SETUP=mine.toml", "-DCMAKE_BUILD_TYPE=Debug"]  # compiles in half the time
    subprocess.run(command, cwd=tmp_path, check=True)
    subprocess.run([CMAKE, "--build", build, "--target", "ht_app"], check=True)
    source = tmp_path / "list.c"
    source.write_text(PROGRAM)
    folders = ("core", "app", "link", "port", "port/c2000", "port/host")
    include = [f"-I{tree / 'firmware' / folder}" for folder in folders]
    libraries = [build / "libht_app.a", build / "libht_core.a", "-lm"]
    program = tmp_path / "list"
    subprocess.run(
        [CC, "-std=c99", "-Wall", "-Werror", *include, source, "-o", program, *libraries],
        check=True,
    )
    done = subprocess.run([program], capture_output=True, text=True)
    assert done.returncode == 0, "the drive refuses its initial values"
    expected = as_kept(setups.load(mine))
    lines = done.stdout.splitlines()
    assert len(lines) == len(expected)
    for id, (line, (name, value)) in enumerate(zip(lines, expected.items())):
        payload, in_force = line.split()
        row = wire.parse_row(bytes.fromhex(payload), wire.Kind.PARAMETER, id)
        assert row.name == name
        assert np.float32(row.initial) == value == np.float32(in_force), name


@pytest.mark.target
@needs_cmake
def test_only_the_table_of_an_image_knows(tree, tmp_path):
    """TI's compiler would get one definition for one file, and the build says so."""
    log = stand_ins(tmp_path)
    (tree / "mine.toml").write_text(MINE)
    done = configure(tree, "f28377s", tmp_path, "-DHT_SETUP=mine.toml")
    assert done.returncode == 0, done.stdout + done.stderr
    log.unlink()
    build = tree / "build" / "f28377s"
    command = [CMAKE, "--build", "--preset", "f28377s"]
    subprocess.run(command, cwd=tree, check=True, capture_output=True)
    calls = [line for line in log.read_text().splitlines() if "--compile_only" in line]
    knowing = [call for call in calls if "HT_INITIAL_VALUES" in call]
    assert len(knowing) == 4  # two images, from flash and in RAM
    assert all("ht_params.c" in call and str(build) in call for call in knowing)
    assert any("+setup" in call for call in calls if "ht_image.c" in call)
    header = build / "ht_initial_values.h"
    before = header.read_text()
    later = header.stat().st_mtime + 10
    (tree / "mine.toml").write_text(MINE.replace("21,3", "20,1"))
    os.utime(tree / "mine.toml", (later, later))
    subprocess.run(command, cwd=tree, check=True, capture_output=True)
    assert header.read_text() != before and "20.1" in header.read_text()
    shutil.rmtree(build)


@pytest.mark.target
@needs_cmake
def test_a_set_up_for_another_chip_is_refused(tree, tmp_path):
    stand_ins(tmp_path)
    done = configure(tree, "f28335", tmp_path, "-DHT_SETUP=paper-b")
    assert done.returncode != 0
    assert "timing.device = f28377s: the image is for a f28335" in " ".join(done.stderr.split())
    shutil.rmtree(tree / "build" / "f28335")
