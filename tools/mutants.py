"""What the mutation of the firmware (mutate.py) and of Python (mutate_python.py) share: the
mutants, who judges them, and the page."""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import subprocess
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Lock
from typing import Protocol

import doc_page

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "mutate"
#: universalmutator has an environment of its own: it brings an outdated `typing`.
MUTATOR = WORK / "tools" / "bin" / "python"
PAGE = ROOT / "docs" / "mutation.md"
VERDICTS = ROOT / "tests" / "mutation.toml"
#: What keeps a mutant alive for the time being: only the first tests have run.
FIRST = "the first tests"
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


class Judge(Protocol):
    """One of those that work at the same time."""

    def judged(self, mutant: Mutant, first: bool) -> Result:
        """first: only with the tests that are most likely to fail."""
        ...


@dataclass(frozen=True)
class Subject:
    """What is mutated."""

    name: str
    base: Path  #: the rooms are folders of it
    rooms: tuple[str, ...]
    suffix: str
    rules: tuple[str, ...]  #: of universalmutator
    count: int  #: how many are drawn
    refused: str  #: how the page says that a mutant is not counted: it is refused, ...
    alike: str  #: ... or it is the same
    left_out: tuple[str, ...] = ()  #: files that are not mutated

    @property
    def results(self) -> Path:
        return WORK / f"{self.name}.json"

    @property
    def marks(self) -> tuple[str, str]:
        return f"<!-- generated: mutation of {self.name} -->\n", f"<!-- end of {self.name} -->\n"


def do(words: Iterable[object], **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, **more,  # type: ignore[call-overload]
    )  # fmt: skip


# --- The mutants ------------------------------------------------------------------


def mutants(subject: Subject) -> list[Mutant]:
    """All, sorted."""
    program = (
        "import json, sys\n"
        "from universalmutator.mutator import mutants_regexp\n"
        "rules, paths = json.load(sys.stdin)\n"
        "out, sys.stdout = sys.stdout, sys.stderr\n"
        "every = [[(line, new) for line, new, *_ in\n"
        "          mutants_regexp(open(path).readlines(), rules, ignorePatterns=[])]\n"
        "         for path in paths]\n"
        "json.dump(every, out)\n"
    )
    pattern = f"*{subject.suffix}"
    paths = [
        path
        for room in subject.rooms
        for path in (subject.base / room).rglob(pattern)
        if path.name not in subject.left_out
    ]
    told = json.dumps([subject.rules, [str(path) for path in paths]])
    made = do([MUTATOR, "-c", program], input=told)
    if made.returncode != 0:
        raise SystemExit(f"mutate: universalmutator failed: {made.stderr}")
    found = set()
    for path, rows in zip(paths, json.loads(made.stdout)):
        lines = path.read_text().splitlines()
        for number, new in rows:
            right, wrong = lines[number - 1], new.rstrip("\n")
            if wrong != right and "\n" not in wrong:
                found.add(Mutant(str(path.relative_to(subject.base)), number, right, wrong))

    def place(m: Mutant) -> tuple[int, str, int, str]:
        return subject.rooms.index(m.file.split("/")[0]), m.file, m.line, m.wrong

    return sorted(found, key=place)


def drawn(
    subject: Subject, rooms: tuple[str, ...], file: str, count: int, seed: int
) -> list[Mutant]:
    """file: only of this one; "": of all in the rooms."""
    every = [
        mutant
        for mutant in mutants(subject)
        if mutant.file.split("/")[0] in rooms and file in ("", mutant.file)
    ]
    print(f"{len(every)} mutants, {min(count, len(every))} drawn with seed {seed}", flush=True)
    return random.Random(seed).sample(every, min(count, len(every)))


# --- What is known already ----------------------------------------------------------


def digest(*names: str) -> str:
    """Check sum of the files and of all files in the folders."""
    all_of = hashlib.sha256()
    for name in names:
        path = ROOT / name
        for file in sorted(path.rglob("*.[chdpj]*")) if path.is_dir() else [path]:
            if file.is_file() and "__pycache__" not in file.parts:
                all_of.update(file.read_bytes())
    return all_of.hexdigest()


class States:
    """What verdicts depend on, as it was when the tests were loaded."""

    def __init__(self, source: str, tests: str, more: dict[str, str] | None = None) -> None:
        """source, tests: folders; more: of tests that are not in Python."""
        self.source = digest(source)
        self.of_file = {
            str(path.relative_to(ROOT)): self.source + digest(str(path.relative_to(ROOT)))
            for path in (ROOT / tests).rglob("test_*.py")
        }
        more = more or {}
        self.of_file.update((name, self.source + state) for name, state in more.items())
        self.all = self.source + "".join(sorted(set(more.values()))) + digest(tests)

    def of(self, result: Result) -> str:
        if result.verdict in (UNBUILT, SAME):
            return self.source
        if result.verdict in (KILLED, TIME):
            return self.of_file.get(result.by.split("::")[0], self.all)
        return self.all


class Book:
    """What is judged already, on disk."""

    def __init__(self, subject: Subject, states: States) -> None:
        self.path, self.states = subject.results, states
        kept = json.loads(self.path.read_text()) if self.path.exists() else {}
        #: The state in which the tests passed without any change, and the seconds of each file.
        self.passed: str = kept.get("passed", "")
        self.seconds: dict[str, float] = kept.get("seconds", {})
        self.done: dict[Mutant, Result] = {}
        self.alive_so_far: dict[Mutant, Result] = {}
        for row in kept.get("results", []):
            result = Result(Mutant(**row["mutant"]), row["verdict"], row["by"])
            if result.by == FIRST:
                self.alive_so_far[result.mutant] = result
            elif row["state"] == states.of(result):
                self.done[result.mutant] = result

    def save(self) -> None:
        judged = {**self.alive_so_far, **self.done}
        rows = [{**asdict(r), "state": self.states.of(r)} for r in judged.values()]
        text = {"passed": self.passed, "seconds": self.seconds, "results": rows}
        new = self.path.with_suffix(".new")
        new.write_text(json.dumps(text, indent=1))
        new.replace(self.path)


def judge(chosen: list[Mutant], jobs: int, book: Book, judge_of: Callable[[int], Judge]) -> None:
    """In two passes: what is interrupted has found the most that it can. A mutant that is alive
    after the first one counts as such until the second one has judged it."""
    left = [mutant for mutant in chosen if mutant not in book.done]
    print(f"{len(chosen) - len(left)} of them are judged already", flush=True)
    judges: SimpleQueue[Judge] = SimpleQueue()
    for number in range(min(jobs, len(left))):
        judges.put(judge_of(number))
    lock = Lock()

    def one(mutant: Mutant, first: bool) -> None:
        at_work = judges.get()
        try:
            result = at_work.judged(mutant, first)
        finally:
            judges.put(at_work)
        with lock:
            book.done[mutant] = result
            m = result.mutant
            text = f"{result.verdict:9} {m.file}:{m.line}: {m.wrong.strip()}  {result.by}"
            print(text, flush=True)
            book.save()

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(lambda mutant: one(mutant, True), left))
        known = verdicts()  # those that have one are the last
        again = [mutant for mutant in left if book.done[mutant].by == FIRST]
        again.sort(key=lambda mutant: without_number(mutant) in known)
        print(f"{len(again)} of them once more, with all tests", flush=True)
        list(pool.map(lambda mutant: one(mutant, False), again))


# --- The page ---------------------------------------------------------------------


def verdicts() -> dict[Mutant, str]:
    """Why a mutant may stay alive; without the line's number, which changes."""
    with VERDICTS.open("rb") as file:
        rows = tomllib.load(file).get("alive", [])
    return {Mutant(r["file"], 0, r["right"], r["wrong"]): r["verdict"] for r in rows}


def without_number(m: Mutant) -> Mutant:
    """As a verdict names it."""
    return Mutant(m.file, 0, m.right.strip(), m.wrong.strip())


def tables(
    results: list[Result], known: dict[Mutant, str], rooms: tuple[str, ...]
) -> tuple[list[list[str]], list[list[str]]]:
    """A row for each room, and one for each mutant that was not killed."""

    def verdict(m: Mutant) -> str:
        return known.get(without_number(m), "–")

    by_room = []
    for room in (*rooms, ""):
        rows = [r for r in results if r.mutant.file.startswith(room)]
        count = Counter(r.verdict for r in rows)
        alike = sum(r.verdict == ALIVE and verdict(r.mutant).startswith("equivalent") for r in rows)
        built = count[KILLED] + count[TIME] + count[ALIVE]
        share = f"{100 * count[KILLED] / (built - alike):.1f} %" if built > alike else "–"
        numbers = (built, count[KILLED], alike, count[TIME], count[ALIVE] - alike)
        by_room.append([room or "**all**", *map(str, numbers), share])
    left = []
    for r in sorted(results, key=lambda r: (r.mutant.file, r.mutant.line)):
        if r.verdict in (ALIVE, TIME):
            m = r.mutant
            right, wrong = (text.strip().replace("|", "\\|") for text in (m.right, m.wrong))
            told = verdict(m) if r.verdict == ALIVE else TIME
            told = "not yet judged with all tests" if (told, r.by) == ("–", FIRST) else told
            left.append([f"`{m.file}`", f"`{right}`", f"`{wrong}`", told])
    return by_room, left


HEADS = ["file", "code", "mutant", "verdict"]


def page_of(by_room: list[list[str]], where: str) -> str:
    """The rooms; `where` has the mutants."""
    heads = ["room", "built", "killed", "equivalent", "time-out", "alive"]
    heads.append("killed of those that are not equivalent")
    lines = ["", *doc_page.table(heads, by_room), ""]
    return (
        "\n".join([*lines, f"Those that were not killed, each with its verdict: {where}."]) + "\n"
    )


def write(subject: Subject, results: list[Result], drew: int, seed: int) -> None:
    begin, end = subject.marks
    before, _, rest = PAGE.read_text().partition(begin)
    after = rest.partition(end)[2]
    count = Counter(r.verdict for r in results)
    counted = len(results) - count[UNBUILT] - count[SAME]
    judged = f"{len(results)} of {drew}" if len(results) < drew else str(drew)
    text = (
        f"{judged} mutants drawn with seed {seed} are judged. {subject.refused} "
        f"{count[UNBUILT]}, {subject.alike} {count[SAME]}: {counted} are counted.\n"
    )
    by_room, left = tables(results, verdicts(), subject.rooms)
    text += page_of(by_room, doc_page.keep_data(PAGE, f"mutants-{subject.name}", HEADS, left))
    PAGE.write_text(f"{before}{begin}\n{text}\n{end}{after}")


#: What makes the judges, by their number, once the rooms are known.
Prepare = Callable[[Book, tuple[str, ...]], Callable[[int], Judge]]


def run(subject: Subject, states: States, prepare: Prepare) -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=f"Mutants of {subject.name}: do tests notice?")
    parser.add_argument("--count", type=int, default=subject.count, help="how many are drawn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", choices=subject.rooms, help="only this one")
    parser.add_argument("--file", default="", help="only this one, as the page names it")
    parser.add_argument("--jobs", type=int, default=2, help="at once (default 2)")
    parser.add_argument("--write", action="store_true", help="renew docs/mutation.md")
    parser.add_argument("--judged", action="store_true", help="only what is judged already")
    asked = parser.parse_args()
    if not MUTATOR.exists():
        raise SystemExit("mutate: universalmutator is missing; `make mutate` installs it")
    rooms = (asked.room,) if asked.room else subject.rooms
    chosen = drawn(subject, rooms, asked.file, asked.count, asked.seed)
    if not chosen:
        raise SystemExit(f"mutate: --file {asked.file}: no file of these rooms, or nothing in it")
    book = Book(subject, states)
    if not asked.judged and not book.done.keys() >= set(chosen):
        judge(chosen, asked.jobs, book, prepare(book, rooms))
    judged = {**book.alive_so_far, **book.done}
    results = [judged[mutant] for mutant in chosen if mutant in judged]
    print(dict(Counter(r.verdict for r in results)))
    if asked.write:
        write(subject, results, len(chosen), asked.seed)
    return 0
