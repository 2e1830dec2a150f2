"""Places that share six or more lines of code, to the letter, and why each stays.

Blank lines, comments, lone punctuation and what is imported do not count.
"""

import ast
import re
from collections import defaultdict
from itertools import combinations
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("cmake", "firmware", "host", "tools", "web")
LINES = 6
#: Written by a script, or by others.
NOT_OURS = ("ht_tables.c", "vendor")
#: Why both stay -> the two files, or one that has both places.
REASONS = {
    "a switch that is made from the rows of the laws, for each of their functions": {
        ("firmware/core/ht_control.c", "firmware/core/ht_control_configure.c"),
        ("firmware/core/ht_control_configure.c", "firmware/core/ht_control_configure.c"),
    },
    "each board says all of its wiring, so that its row can be read alone": {
        ("firmware/port/c2000/ht_board.c", "firmware/port/c2000/ht_board.c"),
    },
    "each chip's registers are those of its own manual": {
        ("firmware/port/host/ht_chip_f28335.c", "firmware/port/host/ht_chip_f28377s.c"),
    },
    "two versions of the FMI standard: the functions have other types and arguments": {
        ("firmware/port/fmu/ht_fmi2.c", "firmware/port/fmu/ht_fmi3.c"),
    },
    "each holds the plant's records among its own": {
        ("firmware/port/fmu/ht_fmu_plant.h", "web/ht_web.c"),
    },
    "Python finds a module's `__getattr__` in the module itself": {
        ("host/hexatorque/__init__.py", "host/hexatorque/laws/__init__.py"),
    },
    "a method that overrides another one repeats its arguments": {
        ("host/hexatorque/drive/board.py", "host/hexatorque/drive/interface.py"),
        ("host/hexatorque/drive/board.py", "host/hexatorque/drive/simulated.py"),
        ("host/hexatorque/drive/interface.py", "host/hexatorque/drive/simulated.py"),
    },
    "`capture` has the arguments of `arm`, `run` those of `rows`: types need both": {
        ("host/hexatorque/drive/interface.py", "host/hexatorque/drive/interface.py"),
        ("host/hexatorque/sweeps/study.py", "host/hexatorque/sweeps/study.py"),
    },
}


def imported(source: str) -> set[int]:
    """The lines of a Python file that import."""
    nodes = (n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Import | ast.ImportFrom))
    return {line for n in nodes for line in range(n.lineno, n.end_lineno + 1)}


def lines_of(path: Path) -> list[str]:
    """The lines that count, without their indentation."""
    source = path.read_text(encoding="utf-8")
    left_out = imported(source) if path.suffix == ".py" else set()
    if path.suffix in (".c", ".h", ".js"):
        source = re.sub(r"/\*.*?\*/", lambda found: "\n" * found[0].count("\n"), source, flags=re.S)
    lines = (" ".join(line.split()) for line in source.splitlines())
    return [
        line
        for number, line in enumerate(lines, 1)
        if number not in left_out
        and re.search(r"\w", line)
        and not line.startswith(("#", "//") if path.suffix == ".py" else ("//", "#include"))
    ]


def pairs_of(files: dict[str, list[str]]) -> set[tuple[str, str]]:
    """Files, or one file twice, that share a run of LINES."""
    places = defaultdict(list)
    for name, lines in files.items():
        for k in range(len(lines) - LINES + 1):
            places[tuple(lines[k : k + LINES])].append((name, k))
    return {
        tuple(sorted((one, other)))
        for several in places.values()
        for (one, k), (other, m) in combinations(several, 2)
        if one != other or abs(k - m) >= LINES
    }


def test_the_check_sees_a_copy():
    run = [f"line {k}" for k in range(LINES)]
    files = {"a": ["x", *run], "b": [*run, "y"], "c": run[1:], "d": [*run, *run]}
    assert pairs_of(files) == {("a", "b"), ("a", "d"), ("b", "d"), ("d", "d")}
    assert pairs_of({"e": ["z"] * 8}) == set()


def test_every_copy_has_its_reason():
    files = {
        str(path.relative_to(ROOT)): lines_of(path)
        for room in ROOMS
        for path in sorted((ROOT / room).rglob("*"))
        if path.suffix in (".py", ".c", ".h", ".js")
        and not any(part in NOT_OURS for part in path.parts)
    }
    found, known = pairs_of(files), set().union(*REASONS.values())
    assert found - known == set(), "one place for a rule, or a reason here why both stay"
    assert known - found == set(), "these share nothing any more: their reasons go"
