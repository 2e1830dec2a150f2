"""Tests the tests: `make mutate`, or

    python tools/mutate.py [--count N] [--seed N] [--room core] [--file app/ht_log.c] [--jobs N]
                           [--write] [--judged]

Changes the firmware in one place (universalmutator's rules for C: an operator, a constant, a
statement that is left out), builds it and runs the tests. A test must fail. The mutants are drawn
at random, the same ones for the same seed. A mutant counts as

    unbuilt   the compiler refuses it, with its warnings as errors: not counted
    same      the compiler makes the same code of it: not counted
    killed    a test has failed
    time-out  the tests took too much time of the processor, as in a loop without end: not a kill
    alive     no test has failed

The tests that are likely to fail run first: the C tests, then the files in Python whose name has a
word of the mutated file's, then the others, the quick ones first. Only the mutated file is
compiled, and the tests in Python run in a process that has everything loaded
(tools/mutant_tests.py). Their random inputs are the same for every mutant. The last pass takes the
files first that have killed most for what they cost.

tests/mutation.toml has a verdict for those that stayed alive. --write renews docs/mutation.md.
What was interrupted goes on where it was. A mutant is judged again if the firmware has changed, or
the file of the test that killed it, or, if it stayed alive, any test.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from mutants import (
    ALIVE,
    FIRST,
    KILLED,
    ROOT,
    SAME,
    TIME,
    UNBUILT,
    WORK,
    Book,
    Mutant,
    Result,
    States,
    Subject,
    digest,
    do,
    run,
)

FIRMWARE = Subject(
    "firmware",
    base=ROOT / "firmware",
    rooms=("core", "app", "link"),
    suffix=".c",
    rules=("universal.rules", "c.rules", "c_like.rules"),
    count=1000,  # a third of them builds
    refused="The compiler refuses",
    alike="and it makes the same code of",
)
TESTS = ROOT / "tests" / "firmware"
C_TESTS = ("test_core", "test_vectors", "test_store", "test_log")
#: Those that need nothing of the core but numbers: the first takes longer than the others.
NOT_FOR_CORE = ("test_store", "test_log")
#: Files of tests that take less are the first where no name has a word of the mutated file's.
QUICK_S = 0.3
#: What the rules make of literals and types without knowing C: (2+1)u, 0.(3-1)f, 0.-1f, uint-1_t.
NEVER_C = re.compile(r"\(\d+[+-]1\)[\w.]|\.\(|\d\.-\d|int-\d_t|int[01]_t")
#: Bytes that the tests may take: a change may make them take ever more.
MEMORY = 4 << 30
#: Several times what the tests need of the processor: in C, in Python, there at least, and where no
#: run has told it yet.
C_LIMIT_S, TIMES, LEAST_S, UNKNOWN_S = 10, 5, 30, 3600


# --- The build --------------------------------------------------------------------


def built() -> None:
    """The firmware as it is, for Python and with the C tests."""
    beside = Path(sys.executable).parent
    python = ["-DHT_PYTHON_MODULE=ON", f"-DPython_EXECUTABLE={sys.executable}"]
    for folder, options, targets in (("c", [], C_TESTS), ("module", python, ("_firmware",))):
        set_up = [beside / "cmake", "-S", ROOT, "-B", WORK / folder, "-G", "Ninja",
                  f"-DCMAKE_MAKE_PROGRAM={beside / 'ninja'}", *options]  # fmt: skip
        for words in (set_up, [beside / "cmake", "--build", WORK / folder, "--target", *targets]):
            done = do(words)
            if done.returncode != 0:
                raise SystemExit(f"mutate: the firmware does not build: {done.stdout}{done.stderr}")


@cache
def compilation(file: str) -> tuple[str, ...]:
    """The compiler's words for a file of the firmware, without input and output."""
    rows = json.loads((WORK / "module" / "compile_commands.json").read_text())
    source = str(ROOT / "firmware" / file)
    words = next(shlex.split(row["command"]) for row in rows if row["file"] == source)
    at = words.index("-o")
    return tuple(words[:at] + [w for w in words[at + 2 :] if w not in ("-c", source)])


def linked(objects: Path, program: Path) -> bool:
    """A C test, with one object file instead of the library's, which the linker then does not take;
    or a library of this file alone."""
    build, of_test = WORK / "module", WORK / "c/tests/c/CMakeFiles" / f"{program.name}.dir"
    others = sorted(of_test.glob("*.o"))
    words: list[str | Path] = [*others, build / "libht_app.a", build / "libht_core.a", "-lm"]
    if program.suffix == ".so":
        words = ["-shared", "-Wl,-Bsymbolic"]
    return do([compilation("core/ht_duty.c")[0], objects, *words, "-o", program]).returncode == 0


def symbols(library: Path) -> list[tuple[str, str, int]]:
    """Name, kind and size of what it defines."""
    rows = do(["nm", "-S", "-D", "--defined-only", library]).stdout.splitlines()
    return [(name, kind, int(size, 16)) for _, size, kind, name in map(str.split, rows)]


# --- The tests --------------------------------------------------------------------


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (C_LIMIT_S, C_LIMIT_S + 5))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))


class Bench:
    """The tests, one mutant after the other."""

    def __init__(self, number: int, book: Book) -> None:
        self.folder, self.book, self.seconds = WORK / f"job{number}", book, book.seconds
        self.right: dict[str, bytes] = {}  # object files of the firmware as it is
        module = WORK / "module" / "_firmware.py"
        folders = [f"tests/firmware/{room}" for room in FIRMWARE.rooms]
        words = [sys.executable, "tools/mutant_tests.py", module, *folders]
        log = self.folder.with_suffix(".txt").open("w")
        own = {"PYTEST_DEBUG_TEMPROOT": str(self.folder), "OPENBLAS_NUM_THREADS": "1"}
        self.tests = subprocess.Popen(
            [str(word) for word in words], cwd=ROOT, env={**os.environ, **own}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log,
        )  # fmt: skip

    def check(self) -> None:
        """The tests must pass as long as nothing is changed."""
        self.empty()
        file = "core/ht_duty.c"
        self.code(file, (ROOT / "firmware" / file).read_text().splitlines())
        for first in (True, False):
            verdict, by = self.tested(file, first)
            if verdict != ALIVE:
                raise SystemExit(f"mutate: without any change: {verdict} {by}")

    def empty(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)

    def code(self, file: str, lines: list[str]) -> bytes:
        """The object file; nothing if it does not build. The lines have no numbers in it."""
        source = self.folder / Path(file).name
        source.write_text("\n".join(lines) + "\n")
        objects = source.with_suffix(".o")
        words = [*compilation(file), "-c", source.name, "-o", objects.name]
        return objects.read_bytes() if do(words, cwd=self.folder).returncode == 0 else b""

    def judged(self, mutant: Mutant, first: bool) -> Result:
        self.empty()
        lines = (ROOT / "firmware" / mutant.file).read_text().splitlines()
        if mutant.file not in self.right:
            self.right[mutant.file] = self.code(mutant.file, lines)
        lines[mutant.line - 1] = mutant.wrong
        code = b"" if NEVER_C.search(mutant.wrong) else self.code(mutant.file, lines)
        if code == self.right[mutant.file]:
            return Result(mutant, SAME, "")
        if not code:
            return Result(mutant, UNBUILT, "")
        return Result(mutant, *self.tested(mutant.file, first))

    def tested(self, file: str, first: bool) -> tuple[str, str]:
        objects = (self.folder / Path(file).name).with_suffix(".o")
        endless = (-signal.SIGXCPU, -signal.SIGKILL)
        for name in C_TESTS:
            if name in NOT_FOR_CORE and file.startswith("core/"):
                continue
            program = self.folder / name
            if not linked(objects, program):
                return UNBUILT, ""
            code = do([program], preexec_fn=limited, cwd=self.folder).returncode
            if code != 0:
                return (TIME if code in endless else KILLED), name
        library = objects.with_suffix(".so")
        if not linked(objects, library):
            return UNBUILT, ""
        answer = self.ask(file, library, first)
        if answer["code"] == 0:
            self.seconds.update(answer["seconds"])
            return ALIVE, FIRST if first else ""
        return (TIME if answer["code"] in endless else KILLED), answer["by"]

    def ask(self, file: str, library: Path, first: bool) -> dict[str, Any]:
        words = set(Path(file).stem.removeprefix("ht_").split("_"))

        def late(name: str) -> tuple[bool, float]:
            own = words & set(Path(name).stem.removeprefix("test_").split("_"))
            return not own, self.seconds[name]

        files = sorted(self.seconds, key=late)
        own = [name for name in files if not late(name)[0]]
        quick = own or [name for name in files if self.seconds[name] < QUICK_S]
        kills = Counter(result.by.split("::")[0] for result in list(self.book.done.values()))
        others = sorted(set(files) - set(quick), key=lambda f: self.seconds[f] / (1 + kills[f]))
        chosen = quick if first else others
        need_s = [self.seconds[name] for name in chosen]
        request = {
            "files": chosen,
            "limit_s": max(LEAST_S, round(TIMES * sum(need_s))) if all(need_s) else UNKNOWN_S,
            "changed": str(library),
            "symbols": symbols(library),
        }
        assert self.tests.stdin and self.tests.stdout
        self.tests.stdin.write(json.dumps(request) + "\n")
        self.tests.stdin.flush()
        line = self.tests.stdout.readline()
        if not line:
            raise SystemExit(f"mutate: the tests have ended; see {self.folder}.txt")
        return json.loads(line)


def states() -> States:
    in_c = digest("tests/c", "tests/vectors")
    return States("firmware", "tests/firmware", {name: in_c for name in C_TESTS})


def prepare(book: Book, rooms: tuple[str, ...]) -> Callable[[int], Bench]:
    built()
    every = [path for room in FIRMWARE.rooms for path in (TESTS / room).glob("test_*.py")]
    names = [str(path.relative_to(ROOT)) for path in every]
    book.seconds = {name: book.seconds.get(name, 0.0) for name in names}
    first = Bench(0, book)
    if book.passed != book.states.all:
        first.check()
        book.passed = book.states.all
        book.save()
    return lambda number: first if number == 0 else Bench(number, book)


if __name__ == "__main__":
    sys.exit(run(FIRMWARE, states(), prepare))
