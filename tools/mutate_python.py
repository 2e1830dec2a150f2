"""Tests the tests of what is in Python: `make mutate-python`, or

    python tools/mutate_python.py [--count N] [--seed N] [--room plant] [--jobs N] [--write]

As tools/mutate.py does it for the firmware: a line of the plant or of the analysis is changed, and
a test must fail. The mutants that Python refuses are `unbuilt`. Those that differ in comments or
texts for the reader only are the `same`.

Each mutant has a process that imports its module changed and everything else as it is. Compiled
functions of a changed module of the analysis are not compiled: compiling takes longer than the
tests. The plant is compiled, into a folder of the mutant's own, because without that its tests take
minutes. First run the files of tests whose name has a word of the module's, then the others of the
room.
"""

from __future__ import annotations

import ast
import multiprocessing
import os
import resource
import shutil
import signal
import sys
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
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
    run,
)

PYTHON = Subject(
    "Python",
    base=ROOT / "host" / "hexatorque",
    rooms=("plant", "analysis"),
    suffix=".py",
    rules=("universal.rules", "python.rules"),
    count=600,
    refused="Python refuses",
    alike="and the code is the same in",
    left_out=("plots.py", "report.py", "pages.py"),  # where things stand in pictures and tables
)
TESTS = ROOT / "tests" / "host"
#: What a process begins with. Nothing of hexatorque.
LOADED = ["cffi", "hypothesis.strategies", "jinja2", "matplotlib.pyplot", "numba", "numpy",
          "pydantic", "pytest", "scipy.integrate", "scipy.linalg", "scipy.signal"]  # fmt: skip
#: Of pictures.
LEFT_OUT = ("test_plots.py",)
#: Bytes that the tests may take: a change may make them take ever more.
MEMORY = 4 << 30
#: Of the processor, for the tests of a file's own and for the others.
LIMIT_S = {"plant": 600, "analysis": 120}
#: Of the clock, on a computer that does other things.
CLOCK_LIMIT_S = 3600


def meaning(text: str) -> str | None:
    """What Python makes of a module, without texts for the reader; None if it refuses it."""
    try:
        tree = ast.parse(text)
        compile(text, "", "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return None
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [  # type: ignore[attr-defined]
                part
                for part in body
                if not (isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant))
            ]
    return ast.dump(tree)


def numba_config() -> Any:
    import numba

    return numba.config


def changed_import(file: str, text: str) -> None:
    """From now on the module has this text."""
    ending = f"{os.sep}hexatorque{os.sep}{file}"
    get_code, execute = SourceFileLoader.get_code, SourceFileLoader.exec_module

    def code(self: Any, name: str) -> Any:
        if self.path.endswith(ending):
            return compile(text, self.path, "exec", dont_inherit=True)
        return get_code(self, name)

    def uncompiled(self: Any, module: Any) -> None:
        config = numba_config()
        config.DISABLE_JIT = self.path.endswith(ending) and not file.startswith("plant/")
        execute(self, module)
        config.DISABLE_JIT = False

    SourceFileLoader.get_code = code  # type: ignore[assignment, method-assign]
    SourceFileLoader.exec_module = uncompiled  # type: ignore[method-assign]


def tests_of(file: str) -> list[list[str]]:
    """Two lists: the files with a word of the module's, and the others of its room."""
    words = set(Path(file).stem.split("_"))
    paths = sorted((TESTS / file.split("/")[0]).glob("test_*.py"))
    paths = [path for path in paths if path.name not in LEFT_OUT]
    own = [p for p in paths if words & set(p.stem.removeprefix("test_").split("_"))]
    parts = own, [path for path in paths if path not in own]
    return [[str(path.relative_to(ROOT)) for path in part] for part in parts if part]


def test(folder: Path, file: str, text: str, first: bool) -> None:
    """The process: its code is that of the first run of pytest in which a test failed."""
    limit_s = LIMIT_S[file.split("/")[0]]
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 5))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    log = os.open(folder / "log.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.chdir(ROOT)
    os.environ["PYTEST_DEBUG_TEMPROOT"] = str(folder)
    import hypothesis
    import pytest

    os.environ["HT_INPUTS"] = "new"  # so tests/conftest.py leaves this profile
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        "mutants", derandomize=True, database=None, phases=phases, deadline=None
    )
    hypothesis.settings.load_profile("mutants")
    # Numba knows a kept function by its file, which has not changed: nothing must be kept.
    numba_config().CACHE_DIR = str(folder / "compiled")
    changed_import(file, text)
    # Faulthandler would end a test that never ends as if it had failed.
    words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "faulthandler_timeout=0",
             "-W", "ignore::pytest.PytestAssertRewriteWarning"]  # fmt: skip
    code = 0
    for files in tests_of(file)[: 1 if first else 2]:
        code = int(pytest.main([*words, *files]))
        if code != 0:
            break
    sys.stdout.flush()  # what the end of the process would do
    sys.stderr.flush()
    os._exit(code)


class Bench:
    """The tests, one mutant after the other."""

    def __init__(self, number: int) -> None:
        self.folder = WORK / f"python{number}"

    def judged(self, mutant: Mutant, first: bool) -> Result:
        right = (PYTHON.base / mutant.file).read_text()
        lines = right.splitlines()
        lines[mutant.line - 1] = mutant.wrong
        wrong = "\n".join(lines) + "\n"
        if meaning(wrong) in (None, meaning(right)):
            return Result(mutant, UNBUILT if meaning(wrong) is None else SAME, "")
        return Result(mutant, *self.tested(mutant.file, wrong, first))

    def tested(self, file: str, text: str, first: bool) -> tuple[str, str]:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        process = multiprocessing.get_context("forkserver").Process(
            target=test, args=(self.folder, file, text, first)
        )
        process.start()
        process.join(CLOCK_LIMIT_S)
        process.kill()  # if it waits for ever
        process.join()
        if process.exitcode == 0:
            return ALIVE, FIRST if first else ""
        if process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL):
            return TIME, ""
        rows = (self.folder / "log.txt").read_text().splitlines()
        failed = [row.split()[1] for row in rows if row.startswith(("FAILED ", "ERROR "))]
        return KILLED, failed[0] if failed else ""


def prepare(book: Book, rooms: tuple[str, ...]) -> Callable[[int], Bench]:
    multiprocessing.set_forkserver_preload(LOADED)
    first = Bench(0)
    state = book.states.all + " ".join(rooms)
    if book.passed != state:
        for room in rooms:
            file = f"{room}/__init__.py"
            verdict, by = first.tested(file, (PYTHON.base / file).read_text(), False)
            if verdict != ALIVE:
                raise SystemExit(f"mutate: without any change: {verdict} {by}")
        book.passed = state
        book.save()
    return Bench


if __name__ == "__main__":
    sys.exit(run(PYTHON, States("host/hexatorque", "tests/host"), prepare))
