"""The Code Composer projects contain what CMake builds: sources, options, linker command files.
`python tools/ccs_projects.py` writes them again.
"""

import re
import xml.etree.ElementTree as ET

import ccs_projects
import pytest
from campaigns import part
from ccs_projects import BOARDS, CCS, CMAKE, FIRMWARE, NINJA, ROOT

needs_cmake = pytest.mark.skipif(
    not (CMAKE and NINJA and ccs_projects.CC), reason="cmake, ninja, gcc"
)
LIBRARY = "--library=libc.a"
#: The boards for which CMake is run.
BUILT = part(list(BOARDS), 1)


@pytest.fixture(scope="module")
def calls():
    kept = {}

    def of(preset):
        if preset not in kept:
            kept[preset] = ccs_projects.calls_of(preset)
        return kept[preset]

    return of


def spec(preset):
    return ET.parse(ccs_projects.file_of(preset)).getroot().find("project")


def command_file(device, place):
    """A chip's own linker command file, else that of its family."""
    chip = device.removeprefix("TMS320").lower()
    table = (FIRMWARE / "port/c2000/ht_chips.def").read_text()
    family = re.search(rf"^HT_CHIP\({chip}, (\w+)\)", table, re.M)[1]
    own, shared = (FIRMWARE / f"port/c2000/image/{name}_{place}.cmd" for name in (chip, family))
    return own if own.exists() else shared


def resolved(file):
    return (CCS / file.get("path")).resolve()


@needs_cmake
@pytest.mark.parametrize("preset", BUILT)
def test_projects_are_what_cmake_builds(preset, calls):
    written = ccs_projects.file_of(preset).read_text()
    assert written == ccs_projects.project(preset, calls(preset)), "python tools/ccs_projects.py"


@pytest.mark.parametrize("preset", BOARDS)
def test_a_project_in_words(preset):
    """The test argues from the source tree, not from the tool. A project has all of the drive's
    folders and nothing of the host's, each file exists and occurs once, each configuration has a
    linker command file and a capture memory, and the project has the board and the options that
    make results equal to the host's."""
    project = spec(preset)
    board, device = BOARDS[preset]
    assert project.get("device") == device and project.get("outputFormat") == "ELF"
    files = project.findall("file")
    sources = [resolved(f) for f in files if f.get("path").endswith((".c", ".asm"))]
    folders = ("core", "app", "link", "port/c2000", "port/c2000/image")
    want = {f for folder in folders for f in (FIRMWARE / folder).glob("*.[ca]*")}
    assert sorted(sources) == sorted(f for f in want if f.suffix in (".c", ".asm"))
    place = {f.get("applicableConfigurations"): resolved(f) for f in files
             if f.get("path").endswith(".cmd")}  # fmt: skip
    assert place == {p: command_file(device, p) for p in ("flash", "ram")}
    configurations = {c.get("name"): c for c in project.findall("configuration")}
    assert set(configurations) == {"flash", "ram"}
    for configuration in configurations.values():
        options = configuration.get("compilerBuildOptions").split()
        assert f"-DHT_BOARD=ht_board_{board}" in options
        assert sum(w.startswith("-DHT_CAPTURE_VALUES=") for w in options) == 1
        assert {"--c99", "-v28", "--float_support=fpu32", "--abi=eabi", "--fp_mode=strict",
                "--fp_reassoc=off", "--ramfunc=on",
                "--silicon_errata_fpu1_workaround=on"} <= set(options)  # fmt: skip
        assert not any("tmu" in w for w in options)
        root = {v.get("name"): v.get("path") for v in project.findall("pathVariable")}
        for word in options:
            if word.startswith("-I"):
                variable, folder = re.fullmatch(r"-I\$\{(\w+)\}/(.*)", word).groups()
                assert (CCS / root[variable] / folder).is_dir(), word
        linker = configuration.get("linkerBuildOptions").split()
        assert {"--rom_model", "--entry_point=code_start", LIBRARY} <= set(linker)


def test_every_board_has_a_project():
    boards = set(re.findall(r"^const ht_board ht_board_(\w+) =",
                            (FIRMWARE / "port/c2000/ht_board.c").read_text(), re.M))  # fmt: skip
    assert {board for board, _ in BOARDS.values()} == boards
    assert {f.name for f in CCS.glob("*.projectspec")} == {
        f"hexatorque_{board}.projectspec" for board in boards
    }


@pytest.mark.parametrize("device", sorted({device for _, device in BOARDS.values()}))
def test_target_configuration(device):
    """It is well formed, with one probe and one device, and has the name by which the projects copy
    it."""
    root = ET.parse(CCS / f"{device}.ccxml").getroot()
    names = [e.get("desc") for e in root.iter("instance") if e.get("desc")]
    assert names == ["Texas Instruments XDS100v2 USB Debug Probe", device]
    for preset, (_, of) in BOARDS.items():
        if of == device:
            copied = [f.get("path") for f in spec(preset).findall("file")
                      if f.get("path").endswith(".ccxml")]  # fmt: skip
            assert copied == [f"{device}.ccxml"]


@needs_cmake
@pytest.mark.parametrize("preset", BUILT)
def test_what_stays_in_flash_is_what_cmake_keeps_there(preset, calls):
    """A project compiles every function for RAM. The linker places some of them in flash by the
    names of their files. If a name were missing or matched nothing, main would be in the RAM that
    it has to fill."""
    board, device = BOARDS[preset]
    text = command_file(device, "flash").read_text()
    stays = re.search(r"\.stays +: \{(.*?)\}", text, re.S)[1]
    names = re.findall(r"\*(\w+)\.\*\(\.TI\.ramfunc\)", stays)
    assert len(names) == stays.count("(")
    made = ccs_projects.image(calls(preset), f"hexatorque_{board}_flash")
    assert set(names) == made.stays, "python tools/ccs_projects.py"
    assert "main" in names
    assert text.index(".stays ") < text.index(".TI.ramfunc : {")


def test_documented():
    """The page on building names every project and both target configurations."""
    page = (ROOT / "docs" / "flash.md").read_text()
    for preset, (_, device) in BOARDS.items():
        assert ccs_projects.file_of(preset).name in page and f"{device}.ccxml" in page
