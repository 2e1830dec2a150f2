"""The build for TI's compiler, as far as it can be tested without it: the options that the presets
give to a compiler, and the contents of the linker command files. A stand-in replaces the compiler.
It compiles nothing and records its calls.
"""

import json
import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import c2000_image
import pytest
from campaigns import part
from ccs_projects import CC, CMAKE, STAND_IN
from stand_in_compiler import configure, needs_cmake, stand_ins

ROOT = Path(__file__).resolve().parents[2]
IMAGE = ROOT / "firmware" / "port" / "c2000" / "image"


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tree")
    for name in ("firmware", "cmake", "tests/c"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("fuzz"))
    for name in ("CMakeLists.txt", "CMakePresets.json"):
        shutil.copy(ROOT / name, folder)
    return folder


@needs_cmake
def test_missing_compiler_is_said_plainly(tree, tmp_path):
    for root in ("", tmp_path):
        done = configure(tree, "f28335", root)
        assert done.returncode != 0
        said = " ".join(done.stderr.split())
        assert "TI's C2000 compiler was not found" in said
        assert "TI_CGT_ROOT" in said and "docs/flash.md" in said
        shutil.rmtree(tree / "build" / "f28335", ignore_errors=True)


#: Sources that copy code into RAM, and sources that no interrupt needs.
FROM_FLASH = {"main.c", "codestart.asm", "devicecal.asm", "ht_service.c", "ht_service_requests.c",
              "ht_requests_drive.c", "ht_requests_sampling.c", "ht_requests_session.c",
              "ht_dictionary.c", "ht_log.c", "ht_log_ring.c", "ht_reset.c", "ht_store.c",
              "ht_packet.c", "ht_no_store.c", "ht_snapshot.c"}  # fmt: skip


@needs_cmake
@pytest.mark.parametrize(
    ("preset", "board", "device"),
    part(
        [
            ("f28335", "f28335", "f28335"),
            ("f28377s", "launchxl_f28377s", "f28377s"),
            ("f28377s-176", "f28377s", "f28377s"),
        ],
        1,
    ),
)
def test_what_the_compiler_gets(tree, tmp_path, preset, board, device):
    log = tmp_path / "log"
    compiler = tmp_path / "bin" / "cl2000"
    compiler.parent.mkdir()
    for name in ("cl2000", "ar2000"):
        (compiler.parent / name).write_text(STAND_IN.format(log=log, cc=CC))
        (compiler.parent / name).chmod(0o755)
    done = configure(tree, preset, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    log.unlink()  # CMake's own test compilations
    build = [CMAKE, "--build", "--preset", preset]
    done = subprocess.run(build, cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    calls = [line.split() for line in log.read_text().splitlines()]
    compiled = [c for c in calls if "--compile_only" in c]
    linked = [c for c in calls if "--run_linker" in c]

    def source(call):
        names = [w.partition("=")[2] for w in call if w.startswith(("--c_file=", "--asm_file="))]
        return Path(names[0] if names[0] else call[-1])

    firmware = tree / "firmware"

    def names(*folders):
        found = [f for folder in folders for f in (firmware / folder).glob("*.[ca]*")]
        return {f.name for f in found if f.suffix in (".c", ".asm")}

    drive = names(*c2000_image.FOLDERS) - names("port/host")
    pil = (drive | names(*c2000_image.PIL_FOLDERS)) - set(c2000_image.NOT_IN_PIL)
    assert sorted(source(c).name for c in compiled) == sorted([*drive, *drive, *pil, *pil])
    for call in compiled:
        flash = source(call).name in FROM_FLASH
        assert ("--ramfunc=on" in call) != flash  # the code that copies is not copied itself
        assert {"-v28", "--float_support=fpu32", "--abi=eabi"} <= set(call)
        assert "--silicon_errata_fpu1_workaround=on" in call
        if source(call).suffix == ".c":
            assert {"--c99", "--strict_ansi", "--fp_mode=strict", "--fp_reassoc=off"} <= set(call)
            assert any(re.fullmatch(rf"(-D|--define=)HT_BOARD=ht_board_{board}", w) for w in call)
        if source(call).name in ("ht_pil_chip.c", "ht_pil_side.c"):
            assert any(re.fullmatch(r"(-D|--define=)HT_PIL_BAUD=625000u", w) for w in call)
            assert not any("registers" in word for word in call)
        assert not any("tmu" in word for word in call)
    images = [
        (f"hexatorque_{board}{kind}_{place}.out", place, len(want))
        for kind, want in (("", drive), ("_pil", pil))
        for place in ("flash", "ram")
    ]
    assert len(linked) == len(images)
    for image, place, sources in images:
        (call,) = (c for c in linked if f"--output_file={image}" in c)
        assert [w for w in call if w.endswith(".cmd")] == [
            str(tree / f"firmware/port/c2000/image/{device}_{place}.cmd")
        ]
        assert {"--entry_point=code_start", "--rom_model", "--library=libc.a"} <= set(call)
        assert sum(w.endswith(".obj") for w in call) == sources


#: The files that the build searches in the user's C2000Ware.
C2000WARE = {
    "f28335": (
        "libraries/flash_api/f2833x/include/Flash2833x_API_Library.h",
        "libraries/flash_api/f2833x/lib/Flash28335_API_V210.lib",
    ),
    "f28377s": (
        "libraries/flash_api/f2837xs/include/F021_F2837xS_C28x.h",
        "libraries/flash_api/f2837xs/lib/F021_API_F2837xS_FPU32.lib",
        "libraries/flash_api/f2837xs/lib/F021_API_F2837xS_FPU32_EABI.lib",
        "device_support/f2837xs/examples/cpu1/flash_programming/cpu01/Fapi_UserDefinedFunctions.c",
    ),
}


@needs_cmake
@pytest.mark.parametrize("device", part(list(C2000WARE), 1))
def test_image_that_keeps_parameters(tree, tmp_path, device):
    """With HT_FLASH_API the flash image, and only it, gets TI's headers and library from the user's
    C2000Ware and our shim. All of this runs from RAM."""
    log = stand_ins(tmp_path)
    ware = tmp_path / "C2000Ware"
    for name in C2000WARE[device]:
        (ware / name).parent.mkdir(parents=True, exist_ok=True)
        (ware / name).touch()
    build = tree / "build" / device
    shutil.rmtree(build, ignore_errors=True)
    done = configure(tree, device, tmp_path, f"-DHT_FLASH_API={ware}")
    assert done.returncode == 0, done.stdout + done.stderr
    log.unlink()
    command = [CMAKE, "--build", "--preset", device]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    calls = log.read_text().splitlines()
    shims = [c for c in calls if "--compile_only" in c and "/store/" in c]
    assert {re.search(r"(\w+\.c)", c.split("--c_file=")[1])[1] for c in shims} == {
        "ht_store_flash.c", f"ht_flash_{device}.c"
    } and len(shims) == 2  # fmt: skip
    for call in shims:
        assert "--ramfunc=on" in call
        assert str((ware / C2000WARE[device][0]).parent) in call
    if device == "f28377s":
        assert all("F021_F2837xS_C28x.h" in call for call in shims)
        (own,) = (c for c in calls if "--compile_only" in c and "Fapi_UserDefined" in c)
        assert "--ramfunc=on" in own
    none = [c for c in calls if "--compile_only" in c and "ht_no_store.c" in c]
    assert len(none) == 1 and "_ram" in none[0]
    library = Path(C2000WARE[device][2 if device == "f28377s" else 1]).name
    for call in (c for c in calls if "--run_linker" in c):
        keeps = re.search(r"--output_file=hexatorque_\w*_flash.out", call) and "_pil_" not in call
        assert (f"--define=HT_FLASH_API={library}" in call) == bool(keeps)
        if keeps:
            where = call.index("--run_linker")
            assert call.index("--define=HT_FLASH_API=") > where  # the linker's, not the compiler's
            assert f"--search_path={ware}/libraries/flash_api" in call
    shutil.rmtree(build)


@needs_cmake
@pytest.mark.parametrize("device", C2000WARE)
def test_folder_without_a_flash_api(tree, tmp_path, device):
    stand_ins(tmp_path)
    shutil.rmtree(tree / "build" / device, ignore_errors=True)
    done = configure(tree, device, tmp_path, f"-DHT_FLASH_API={tmp_path}")
    assert done.returncode != 0
    said = " ".join(done.stderr.split())
    assert f"no flash API for the {device}" in said and str(tmp_path) in said
    assert "keeps no parameters" in said
    shutil.rmtree(tree / "build" / device)


@needs_cmake
def test_board_must_fit_the_device(tree, tmp_path):
    (tmp_path / "bin").mkdir()
    for name in ("cl2000", "ar2000"):
        (tmp_path / "bin" / name).write_text(STAND_IN.format(log=tmp_path / "log", cc=CC))
        (tmp_path / "bin" / name).chmod(0o755)
    done = configure(tree, "f28335", tmp_path, "-DHT_BOARD=f28377s")
    assert done.returncode != 0
    said = " ".join(done.stderr.split())
    assert "is no board with a f28335: choose one of f28335" in said
    shutil.rmtree(tree / "build" / "f28335")
    done = configure(tree, "f28335", tmp_path, "-DHT_DEVICE=f28399")
    assert done.returncode != 0
    assert 'HT_DEVICE = "f28399": choose one of f28335, f28377s' in " ".join(done.stderr.split())
    shutil.rmtree(tree / "build" / "f28335")


def test_presets_are_complete():
    presets = json.loads((ROOT / "CMakePresets.json").read_text())
    names = {p["name"] for p in presets["configurePresets"] if not p.get("hidden")}
    assert {"f28335", "f28377s", "f28377s-176"} <= names
    assert names == {p["name"] for p in presets["buildPresets"]}


# --- linker command files ----------------------------------------------------------------

#: Memories of the devices by the data sheets: first word, number of words.
MEMORIES = {
    "f28335": {(0x0, 0x800): "M0, M1", (0x8000, 0x8000): "L0..L7", (0x300000, 0x40000): "flash",
               (0x3FFFC0, 2): "reset vector"},
    "f28377s": {(0x0, 0x800): "M0, M1", (0x8000, 0x14000): "LS, D, GS",
                (0x80000, 0x40000): "flash bank 0", (0x3FFFC0, 2): "reset vector"},
}  # fmt: skip
#: The address to which the boot ROM jumps.
ENTRY = {("f28335", "flash"): 0x33FFF6, ("f28377s", "flash"): 0x80000,
         ("f28335", "ram"): 0x0, ("f28377s", "ram"): 0x0}  # fmt: skip
SECTIONS = {"codestart", ".text", ".cinit", ".init_array", ".switch", ".TI.noinit", ".TI.ramfunc",
            ".const", ".texts", ".stays", ".stack", ".data", ".bss", ".sysmem",
            ".reset"}  # fmt: skip
FILES = [(device, place) for device in MEMORIES for place in ("flash", "ram")]


def command_file(device, place):
    text = (IMAGE / f"{device}_{place}.cmd").read_text()
    return re.sub(r"/\*.*?\*/", "", text, flags=re.S)


def ranges(device, place):
    number = r"(0x[0-9A-Fa-f]+)"
    pattern = rf"(\w+)\s*:\s*origin = {number}, length = {number}"
    found = re.findall(pattern, command_file(device, place))
    return {name: (int(start, 16), int(words, 16)) for name, start, words in found}


@pytest.mark.parametrize(("device", "place"), FILES)
def test_ranges_are_memory_and_do_not_overlap(device, place):
    used = ranges(device, place)
    for start, words in used.values():
        assert any(a <= start and start + words <= a + n for a, n in MEMORIES[device])
    ends = sorted((start, start + words) for start, words in used.values())
    assert all(end <= following for (_, end), (following, _) in pairwise(ends))
    assert used["BEGIN"] == (ENTRY[device, place], 2)


@pytest.mark.parametrize("device", MEMORIES)
def test_image_in_ram_has_all_of_it(device):
    """Code that is larger than one half would not link otherwise, although there is memory."""
    used = ranges(device, "ram")
    (whole,) = (n for a, n in MEMORIES[device] if a == 0x8000)
    assert used["RAM"] == (0x8000, whole - 16)
    assert {"CODE", "DATA"}.isdisjoint(used)


@pytest.mark.parametrize(("device", "place"), FILES)
def test_last_words_of_the_memories_stay_free(device, place):
    """The CPU fetches ahead. So the last 16 words of M1, of the L and GS memories and of the flash
    stay free (the F28335 has its security words there)."""
    used = {name: at for name, at in ranges(device, place).items() if name != "STORE"}
    taken = [start + words for start, words in used.values() if words > 2]
    for first, words in MEMORIES[device]:
        end = first + words
        following = any(end == other for other, _ in MEMORIES[device])
        if words > 2 and not following:
            assert not any(end - 16 < used <= end for used in taken), hex(end)
    if device == "f28335":
        assert not any(0x33FF80 < used <= 0x33FFF6 for used in taken)


#: The two sectors that the parameter store erases: first word, number of words.
STORE = {"f28335": (0x300000, 2 * 0x8000), "f28377s": (0xBC000, 2 * 0x2000)}


@pytest.mark.parametrize("device", STORE)
def test_nothing_of_an_image_is_where_the_parameters_are(device):
    """The parameters and the log have whole sectors, as the shim erases them. No section is placed
    there. The CPU fetches ahead, so code stays away from them as well: words that are half
    programmed have a wrong ECC."""
    used = ranges(device, "flash")
    begin, words = STORE[device]
    assert used.pop("STORE") == (begin, words)
    log = used.pop("LOG")
    assert log[0] + log[1] <= begin or log[0] >= begin + words
    for start, length in used.values():
        for first, size in ((begin, words), log):
            assert start >= first + size or start + length <= first - 16
    sections = command_file(device, "flash").split("SECTIONS")[1]
    assert "STORE" not in sections and not re.search(r"\bLOG\b", sections)
    shim = (IMAGE.parent / "store" / f"ht_flash_{device}.c").read_text()
    numbers = {int(n, 16) for n in re.findall(r"0x([0-9A-F]{8})u", shim)}
    assert {begin, words // 2} <= numbers


def test_what_tis_flash_api_calls_leaves_the_registers_open():
    """The API is not here to be tried, and TI does not say whether it opens them again itself."""
    shim = (IMAGE.parent / "store" / "ht_flash_f28335.c").read_text()
    (body,) = re.findall(r"^static void serve\(void\)\n\{\n(.*?)^\}", shim, re.M | re.S)
    assert re.findall(r"\w+(?=\()", body) == ["HT_EDIS", "ht_flash_serve", "HT_EALLOW"]
    assert "Flash_CallbackPtr = serve;" in shim


@pytest.mark.parametrize(("device", "place"), FILES)
def test_every_section_has_its_place(device, place):
    text = command_file(device, place)
    body = text[text.index("SECTIONS") :]
    names = set(re.findall(r"^ {4}([.\w]+)\s*:", body, re.M))
    assert names == SECTIONS - ({".texts", ".stays"} if place == "ram" else set())
    used = ranges(device, place)
    for target in re.findall(r"(?:>|LOAD =|RUN =) (\w+)", body):
        assert target in used
    where = dict(re.findall(r"^ {4}([.\w]+)\s*:[^>]*?(?:> |RUN = )(\w+)", body, re.M))
    code, data = ("RAM", "RAM") if place == "ram" else ("CODE", "DATA")
    assert where[".TI.ramfunc"] == code and where[".const"] == data
    assert (where[".text"] == "FLASH") == (place == "flash")
    assert where[".stack"] == "STACK"
    assert where[".TI.noinit"] == data


@pytest.mark.parametrize(("device", "place"), FILES)
def test_symbols_of_main(device, place):
    """Each symbol that main.c copies is defined once, by the section that its name says."""
    wanted = re.findall(r"^extern \w+ ?\w* (ht_\w+)\[\];", (IMAGE / "main.c").read_text(), re.M)
    assert len(wanted) == 6
    text = command_file(device, place)
    for symbol in wanted:
        _, part, what = symbol.split("_")
        operator = {"load": "LOAD_START", "run": "RUN_START", "size": "LOAD_SIZE"}[what]
        section = {"code": ".TI.ramfunc", "const": ".const"}[part]
        after = text[text.index(f"    {section} ") :]
        assert f"{operator}({symbol})" in after[: after.index("\n    .", 5)]
        assert text.count(f"({symbol})") == 1


def test_start_sets_the_watchdog_first():
    """Before the runtime clears memory, WDCR is set with its check bits to the longest time, and
    not off."""
    text = (IMAGE / "codestart.asm").read_text()
    code = re.sub(r";.*", "", text)
    assert code.index("0x7029") < code.index("#0x002F") < code.index("LB      _c_int00")
    value = 0x002F
    assert (value & 0x38, value & 0x40, value & 7) == (0x28, 0, 7)


@needs_cmake
@pytest.mark.parametrize("device", part(["f28335", "f28377s"], 1))
def test_image_with_xcp(tree, tmp_path, device):
    """With HT_XCP the drive's images, and only they, have XCP. What the fast interrupt calls of it
    runs from RAM. HT_GATES_ACTIVE_LOW, given beside it, reaches every source."""
    log = stand_ins(tmp_path)
    build = tree / "build" / device
    shutil.rmtree(build, ignore_errors=True)
    done = configure(tree, device, tmp_path, "-DHT_XCP=ON", "-DHT_GATES_ACTIVE_LOW=ON")
    assert done.returncode == 0, done.stdout + done.stderr
    log.unlink()
    command = [CMAKE, "--build", "--preset", device]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    calls = [line for line in log.read_text().splitlines() if "--c_file=" in line]
    assert calls and all(re.search(r"HT_GATES_ACTIVE_LOW=1\b", call) for call in calls)
    ours = [call for call in calls if "/link/xcp/" in call.split("--c_file=")[1]]
    names = sorted(re.search(r"(\w+\.c)", call.split("--c_file=")[1])[1] for call in ours)
    here = [path.name for path in (ROOT / "firmware" / "link" / "xcp").glob("*.c")]
    assert names == sorted(here * 2)
    assert not any("_pil_" in call for call in ours)
    for call in ours:
        fast = re.search(r"ht_xcp_(daq|fast)\.c", call.split("--c_file=")[1])
        assert ("--ramfunc=on" in call) == bool(fast)
    images = [call for call in calls if "ht_image.c" in call.split("--c_file=")[1]]
    assert len(images) == 2
    assert all(re.search(r"(-D|--define=)HT_XCP\b", call) for call in images)
    shutil.rmtree(build)
