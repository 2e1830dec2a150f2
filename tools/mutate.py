"""Tests the tests: `make mutate`, or

    python tools/mutate.py [--count N] [--seed N] [--room core] [--jobs N] [--write]

Changes the firmware in one place (universalmutator's rules for C: an operator, a constant, a
statement that is left out), builds it and runs the tests. A test must fail. The mutants are drawn
at random, the same ones for the same seed. A mutant counts as

    unbuilt   the compiler refuses it, with its warnings as errors: not counted
    same      the compiler makes the same code of it: not counted
    killed    a test has failed
    time-out  the tests took too much time of the processor, as in a loop without end: not a kill
    alive     no test has failed

tests/mutation.toml has a verdict for those that stayed alive. --write renews docs/mutation.md.
What was interrupted goes on where it was: a mutant that the same firmware and tests have judged
is not judged again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Lock

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "mutate"
#: universalmutator has an environment of its own: it brings an outdated `typing`.
MUTATOR = WORK / "tools" / "bin" / "mutate"
PAGE = ROOT / "docs" / "mutation.md"
VERDICTS = ROOT / "tests" / "mutation.toml"
RESULTS = WORK / "results.json"
BEGIN, END = "<!-- generated: mutation -->\n", "<!-- end of mutation -->\n"
ROOMS = ("core", "app", "link")
C_TESTS = ("test_core", "test_vectors", "test_store")
#: By room, the quick ones first.
TESTS = {
    "core": ("tests/firmware/core", "tests/firmware/app/test_drive.py"),
    "app": ("tests/firmware/app", "tests/firmware/link", "tests/firmware/core/test_protect.py"),
    "link": ("tests/firmware/link",),
}
#: Several times what the tests need.
LIMIT_S = 600
UNBUILT, SAME, KILLED, TIME, ALIVE = "unbuilt", "same", "killed", "time-out", "alive"


@dataclass(frozen=True)
class Mutant:
    """A line of a file, and what it becomes."""

    file: str
    line: int
    right: str
    wrong: str


@dataclass(frozen=True)
class Result:
    mutant: Mutant
    verdict: str
    by: str


def do(words: list[str | Path], **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, **more,  # type: ignore[call-overload]
    )  # fmt: skip


# --- The mutants ------------------------------------------------------------------


def mutants_of(source: Path) -> list[Mutant]:
    """All of a file's, in the order in which universalmutator makes them."""
    folder = WORK / "all" / source.parent.name / source.stem
    if not folder.exists():
        folder.mkdir(parents=True)
        done = do([MUTATOR, source, "--noCheck", "--mutantDir", folder], cwd=folder)
        if done.returncode != 0:
            raise SystemExit(f"mutate: universalmutator failed: {done.stdout}{done.stderr}")
    lines = source.read_text().splitlines()
    found = set()
    for path in folder.glob("*.c"):
        changed = path.read_text().splitlines()
        places = [n for n, (a, b) in enumerate(zip(lines, changed, strict=False)) if a != b]
        if places and len(lines) == len(changed):
            n = places[0]
            found.add(Mutant(f"{source.parent.name}/{source.name}", n + 1, lines[n], changed[n]))
    return sorted(found, key=lambda m: (m.line, m.wrong))


def drawn(rooms: list[str], count: int, seed: int) -> list[Mutant]:
    every = [
        mutant
        for room in rooms
        for source in sorted((ROOT / "firmware" / room).glob("*.c"))
        for mutant in mutants_of(source)
    ]
    print(f"{len(every)} mutants, {min(count, len(every))} drawn with seed {seed}", flush=True)
    return random.Random(seed).sample(every, min(count, len(every)))


# --- A build of its own -----------------------------------------------------------


def prepared(number: int) -> Path:
    """A tree that is changed, built once as it is."""
    tree = WORK / f"tree{number}"
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in ("firmware", "cmake", "tests/c", "tests/vectors"):
        shutil.copytree(ROOT / name, tree / name)
    shutil.copy(ROOT / "CMakeLists.txt", tree)
    beside = Path(sys.executable).parent
    for folder, options in (
        ("c", []),
        ("module", ["-DHT_PYTHON_MODULE=ON", f"-DPython_EXECUTABLE={sys.executable}"]),
    ):
        done = do([beside / "cmake", "-S", tree, "-B", tree / folder, "-G", "Ninja",
                   f"-DCMAKE_MAKE_PROGRAM={beside / 'ninja'}", *options])  # fmt: skip
        if done.returncode != 0 or not build(tree):
            raise SystemExit(f"mutate: the firmware does not build: {done.stdout}{done.stderr}")
    return tree


def build(tree: Path) -> bool:
    cmake = Path(sys.executable).parent / "cmake"
    both = ((tree / "module", ["_firmware"]), (tree / "c", list(C_TESTS)))
    return all(
        do([cmake, "--build", folder, "--target", *targets]).returncode == 0
        for folder, targets in both
        if folder.exists()
    )


def code_of(tree: Path, mutant: Mutant) -> bytes:
    """The object file without the lines' numbers, which it does not have without -g."""
    room = "ht_core" if mutant.file.startswith("core/") else "ht_app"
    path = tree / "module" / "CMakeFiles" / f"{room}.dir" / "firmware" / f"{mutant.file}.o"
    return path.read_bytes()


def runs(tree: Path, mutant: Mutant) -> list[tuple[str, list[str]]]:
    room = mutant.file.split("/")[0]
    c = [(name, [str(next((tree / "c").rglob(name)))]) for name in C_TESTS]
    python = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider",
              "-p", "other_firmware", *TESTS[room]]  # fmt: skip
    return [*c, ("Python", python)]


def tested(tree: Path, mutant: Mutant) -> tuple[str, str]:
    other = {
        "HT_FIRMWARE": str(next((tree / "module").glob("_firmware*.so"))),
        "PYTHONPATH": str(ROOT / "tools"),
        "HYPOTHESIS_STORAGE_DIRECTORY": str(tree / "hypothesis"),
    }
    for name, words in runs(tree, mutant):
        limited = ["sh", "-c", f'ulimit -t {LIMIT_S}; exec "$@"', "sh", *words]
        done = do(list(limited), cwd=ROOT, env={**os.environ, **other})
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            return TIME, name
        if done.returncode != 0:
            failed = [row for row in done.stdout.splitlines() if row.startswith("FAILED ")]
            return KILLED, failed[0].split()[1] if failed else name
    return ALIVE, ""


def judged(tree: Path, mutant: Mutant) -> Result:
    path = tree / "firmware" / mutant.file
    right = path.read_text()
    before = code_of(tree, mutant)
    lines = right.splitlines()
    lines[mutant.line - 1] = mutant.wrong
    try:
        path.write_text("\n".join(lines) + "\n")
        if not build(tree):
            return Result(mutant, UNBUILT, "")
        if code_of(tree, mutant) == before:
            return Result(mutant, SAME, "")
        return Result(mutant, *tested(tree, mutant))
    finally:
        path.write_text(right)
        build(tree)


# --- The page ---------------------------------------------------------------------


def verdicts() -> dict[Mutant, str]:
    """Why a mutant may stay alive; without the line's number, which changes."""
    with VERDICTS.open("rb") as file:
        rows = tomllib.load(file).get("alive", [])
    return {Mutant(r["file"], 0, r["right"], r["wrong"]): r["verdict"] for r in rows}


def table(results: list[Result], known: dict[Mutant, str]) -> str:
    def verdict(m: Mutant) -> str:
        return known.get(Mutant(m.file, 0, m.right.strip(), m.wrong.strip()), "–")

    head = "| room | built | killed | equivalent | time-out | alive | killed of those that are not"
    lines = [f"{head} equivalent |", "|---|---|---|---|---|---|---|"]
    for room in (*ROOMS, ""):
        rows = [r for r in results if r.mutant.file.startswith(room)]
        count = Counter(r.verdict for r in rows)
        alike = sum(r.verdict == ALIVE and verdict(r.mutant).startswith("equivalent") for r in rows)
        built = count[KILLED] + count[TIME] + count[ALIVE]
        share = f"{100 * count[KILLED] / (built - alike):.0f} %" if built > alike else "–"
        lines.append(
            f"| {room or '**all**'} | {built} | {count[KILLED]} | {alike} | {count[TIME]} "
            f"| {count[ALIVE] - alike} | {share} |"
        )
    lines += ["", "| file | code | mutant | verdict |", "|---|---|---|---|"]
    for r in sorted(results, key=lambda r: (r.mutant.file, r.mutant.line)):
        if r.verdict in (ALIVE, TIME):
            m = r.mutant
            right, wrong = (text.strip().replace("|", "\\|") for text in (m.right, m.wrong))
            told = verdict(m) if r.verdict == ALIVE else TIME
            lines.append(f"| `{m.file}` | `{right}` | `{wrong}` | {told} |")
    return "\n".join(lines) + "\n"


def write(results: list[Result], page: Path = PAGE) -> None:
    before, _, rest = page.read_text().partition(BEGIN)
    after = rest.partition(END)[2]
    page.write_text(f"{before}{BEGIN}\n{table(results, verdicts())}\n{END}{after}")


def subject() -> str:
    """Changes with the firmware and with its tests."""
    digest = hashlib.sha256()
    for name in ("firmware", "tests/c", "tests/firmware"):
        for path in sorted((ROOT / name).rglob("*.[chdp]*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.read_bytes())
    return digest.hexdigest()


def judge(chosen: list[Mutant], jobs: int) -> list[Result]:
    of = subject()
    kept = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    rows = kept["results"] if kept.get("of") == of else []
    done = {
        Mutant(**row["mutant"]): Result(**{**row, "mutant": Mutant(**row["mutant"])})
        for row in rows
    }
    left = [mutant for mutant in chosen if mutant not in done]
    if len(left) < len(chosen):
        print(f"{len(chosen) - len(left)} of them are judged already", flush=True)
    trees: SimpleQueue[Path] = SimpleQueue()
    for number in range(min(jobs, len(left))):
        trees.put(prepared(number))
    lock = Lock()

    def one(mutant: Mutant) -> None:
        tree = trees.get()
        try:
            result = judged(tree, mutant)
        finally:
            trees.put(tree)
        with lock:
            done[mutant] = result
            m = result.mutant
            print(
                f"{result.verdict:9} {m.file}:{m.line}: {m.wrong.strip()}  {result.by}", flush=True
            )
            text = json.dumps({"of": of, "results": [asdict(r) for r in done.values()]}, indent=1)
            RESULTS.write_text(text)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, left))
    return [done[mutant] for mutant in chosen]


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutants of the firmware: do its tests notice?")
    parser.add_argument("--count", type=int, default=300, help="how many are drawn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", choices=ROOMS, help="only this one")
    parser.add_argument("--jobs", type=int, default=2, help="at once (default 2)")
    parser.add_argument("--write", action="store_true", help="renew docs/mutation.md")
    asked = parser.parse_args()
    if not MUTATOR.exists():
        raise SystemExit("mutate: universalmutator is missing; `make mutate` installs it")
    chosen = drawn([asked.room] if asked.room else list(ROOMS), asked.count, asked.seed)
    results = judge(chosen, asked.jobs)
    print(dict(Counter(r.verdict for r in results)))
    if asked.write:
        write(results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
