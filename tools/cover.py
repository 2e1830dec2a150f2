"""Coverage of the firmware by its tests: `make coverage`, or

    python tools/cover.py [--report]

Builds the C tests and the firmware's Python module with clang's counters, runs the C tests and
those of TESTS, and writes lines, branches and MC/DC of core, app and link into docs/coverage.md.
--report writes the page of the last run again. Needs clang 18 or newer, the first one that
measures MC/DC; `make coverage` installs it on Debian and Ubuntu.

tests/coverage.toml says why something is not covered. Exit status 0 only if the tests pass, every
line that is not covered has a reason there, and every reason a line.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import doc_page

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "coverage"
PAGE = ROOT / "docs" / "coverage.md"
REASONS = ROOT / "tests" / "coverage.toml"
ROOMS = ("core", "app", "link")
#: C tests of a minute each that run the same code of these rooms as `store`, on other chips.
SAME_AGAIN = "^store_f"
#: The tests in Python that run in one process with the firmware; of campaigns this share of the
#: cases.
TESTS = ("tests/firmware", "tests/host/drive", "tests/host/commissioning", "tests/host/serial")
SHARE = "0.05"
COUNTERS = "-fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc"
KINDS = ("lines", "branches", "mcdc")


@dataclass(frozen=True)
class Tools:
    clang: str
    profdata: str
    cov: str


def tools() -> Tools:
    for version in range(25, 17, -1):
        names = [f"{name}-{version}" for name in ("clang", "llvm-profdata", "llvm-cov")]
        if all(shutil.which(name) for name in names):
            return Tools(*names)
    raise SystemExit(
        "cover: clang 18 or newer is missing (MC/DC): "
        "apt-get install clang-19 llvm-19 libclang-rt-19-dev"
    )


# --- The run ----------------------------------------------------------------------


def do(*words: str | Path, **more: Any) -> None:
    subprocess.run([str(word) for word in words], check=True, cwd=ROOT, **more)


def build(compiler: str, folder: Path, *options: str) -> None:
    beside = Path(sys.executable).parent
    do(
        beside / "cmake", "-S", ROOT, "-B", folder, "-G", "Ninja",
        f"-DCMAKE_MAKE_PROGRAM={beside / 'ninja'}", f"-DCMAKE_C_COMPILER={compiler}",
        f"-DCMAKE_C_FLAGS={COUNTERS}",
        "-DCMAKE_BUILD_TYPE=Release", *options,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    do(beside / "cmake", "--build", folder, stdout=subprocess.DEVNULL)


#: The module, and the library that it opens.
MODULE = WORK / "module" / "_firmware.py"
LIBRARY = MODULE.with_name("libhexatorque.so")


def run_tests(found: Tools) -> bool:
    """Are all passed?"""
    raw = WORK / "raw"
    shutil.rmtree(raw, ignore_errors=True)
    raw.mkdir(parents=True)
    build(found.clang, WORK / "c")
    build(found.clang, WORK / "module", "-DHT_PYTHON_MODULE=ON",
          f"-DPython_EXECUTABLE={sys.executable}")  # fmt: skip
    counted = {**os.environ, "LLVM_PROFILE_FILE": str(raw / "%m-%p.profraw")}
    beside = Path(sys.executable).parent
    c = subprocess.run(
        [beside / "ctest", "--output-on-failure", "-E", SAME_AGAIN], cwd=WORK / "c", env=counted
    )
    other = {
        "HT_FIRMWARE": str(MODULE), "PYTHONPATH": str(ROOT / "tools"), "HT_WHOLE": SHARE,
    }  # fmt: skip
    python = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "2", "-p", "other_firmware", *TESTS],
        cwd=ROOT, env={**counted, **other},
    )  # fmt: skip
    files = sorted(raw.glob("*.profraw"))
    do(found.profdata, "merge", "-sparse", *files, "-o", WORK / "profile")
    return c.returncode == python.returncode == 0


def told(found: Tools, *options: str) -> str:
    """What clang tells of the C files."""
    c = WORK / "c"
    programs = [p for p in (c / "tests" / "c").rglob("*") if p.is_file() and os.access(p, os.X_OK)]
    objects = [word for p in sorted(programs) for word in ("-object", str(p))]
    return subprocess.run(
        [found.cov, "export", *options, str(LIBRARY), *objects,
         f"-instr-profile={WORK / 'profile'}", *(str(ROOT / "firmware" / room) for room in ROOMS)],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip


def exported(found: Tools) -> list[dict[str, Any]]:
    """Each C file: branches, decisions and sums."""
    files: list[dict[str, Any]] = json.loads(told(found))["data"][0]["files"]
    return [f for f in files if f["filename"].endswith(".c")]


def line_counts(found: Tools) -> dict[str, dict[int, int]]:
    """How often each line of each file was run. A directive has no code: after `switch (...) {`
    clang counts it as the gap before the first case, which nothing enters. Of an included list it
    counts a line behind the last one, too."""
    counts: dict[str, dict[int, int]] = {}
    name = ""
    text: list[str] = []
    for row in told(found, "-format=lcov").splitlines():
        kind, _, value = row.partition(":")
        if kind == "SF":
            name = value
            text = Path(name).read_text().splitlines()
        elif kind == "DA":
            line, count = (int(word) for word in value.split(",")[:2])
            if line <= len(text) and not text[line - 1].lstrip().startswith("#"):
                counts.setdefault(name, {})[line] = count
    return counts


# --- What is not covered ----------------------------------------------------------


@dataclass(frozen=True)
class Miss:
    file: str
    line: int
    what: str


@dataclass(frozen=True)
class Reason:
    file: str
    code: str
    why: str


def name_of(file: dict[str, Any]) -> str:
    return str(Path(file["filename"]).relative_to(ROOT / "firmware"))


def misses(file: dict[str, Any], lines: list[int]) -> list[Miss]:
    """One of each line. Of lines that follow each other the first one."""
    name = name_of(file)
    found: dict[int, list[str]] = {n: ["not run"] for n in lines if n - 1 not in lines}
    for line, _, _, _, taken, not_taken, *_ in file["branches"]:
        if (taken == 0) != (not_taken == 0) and line not in lines:
            found.setdefault(line, []).append("never true" if taken == 0 else "never false")
    for record in file["mcdc_records"]:
        if not all(record[-1]) and record[0] not in lines:
            found.setdefault(record[0], []).append("MC/DC")
    return [Miss(name, n, ", ".join(sorted(set(found[n])))) for n in sorted(found)]


def code_of(miss: Miss) -> str:
    return (ROOT / "firmware" / miss.file).read_text().splitlines()[miss.line - 1].strip()


def reasons() -> list[Reason]:
    with REASONS.open("rb") as file:
        rows: list[dict[str, str]] = tomllib.load(file).get("miss", [])
    return [Reason(row["file"], row["code"], row["why"]) for row in rows]


def explained(found: list[Miss], known: list[Reason]) -> tuple[list[tuple[Miss, str]], list[str]]:
    """Each miss with its reason; what is wrong with the list of reasons."""
    used: set[Reason] = set()
    rows = []
    wrong = []
    for miss in found:
        fits = [r for r in known if r.file == miss.file and r.code == code_of(miss)]
        used.update(fits)
        rows.append((miss, fits[0].why if fits else ""))
        if not fits:
            wrong.append(f"{miss.file}:{miss.line}: {miss.what}, no reason: {code_of(miss)}")
    wrong += [f"{r.file}: covered, but has a reason: {r.code}" for r in known if r not in used]
    return rows, wrong


# --- The page ---------------------------------------------------------------------


def percent(covered: int, count: int) -> str:
    """Rounded down: 100 means all."""
    return f"{1000 * covered // count / 10:g} % of {count}" if count else "–"


HEADS = ["file", "lines", "branches", "MC/DC"]
LEFT = ["file", "code", "not covered", "why"]


def tables(
    files: list[dict[str, Any]], rows: list[tuple[Miss, str]]
) -> tuple[list[list[str]], list[list[str]]]:
    """A row for each room and file, and one for each place that is not covered."""
    covered = []
    for room in ROOMS:
        of_room = [f for f in files if name_of(f).startswith(f"{room}/")]
        sums = {kind: (sum(f["summary"][kind]["covered"] for f in of_room),
                       sum(f["summary"][kind]["count"] for f in of_room))
                for kind in KINDS}  # fmt: skip
        covered.append([f"**{room}**", *(percent(*sums[k]) for k in KINDS)])
        for file in of_room:
            cells = (percent(file["summary"][k]["covered"], file["summary"][k]["count"])
                     for k in KINDS)  # fmt: skip
            covered.append([f"`{name_of(file)}`", *cells])
    left = [
        [f"`{miss.file}`", f"`{code_of(miss)}`".replace("|", "\\|"), miss.what, why or "–"]
        for miss, why in rows
    ]
    return covered, left


def write(covered: list[list[str]], left: list[list[str]], page: Path = PAGE) -> None:
    """The rooms on the page, each file and each place that is not covered as data beside it."""
    files = doc_page.keep_data(page, "coverage", HEADS, covered)
    places = doc_page.keep_data(page, "not-covered", LEFT, left)
    rooms = [row for row in covered if row[0].startswith("**")]
    text = "\n".join([
        *doc_page.table(HEADS, rooms), "",
        f"Each file: {files}. The {len(left)} places that are not covered, each with its reason: "
        f"{places}.",
    ])  # fmt: skip
    doc_page.renew_page(page, {"coverage": f"\n{text}\n"})


def main() -> int:
    parser = argparse.ArgumentParser(description="Coverage of the firmware by its tests.")
    parser.add_argument("--report", action="store_true", help="the page of the last run again")
    asked = parser.parse_args()
    found = tools()
    passed = asked.report or run_tests(found)
    files = exported(found)
    counts = line_counts(found)
    missed = []
    for file in files:
        count = counts.get(file["filename"], {})
        file["summary"]["lines"] = {
            "count": len(count), "covered": sum(n > 0 for n in count.values()),
        }  # fmt: skip
        missed += misses(file, [line for line, n in count.items() if n == 0])
    rows, wrong = explained(missed, reasons())
    write(*tables(files, rows))
    for line in wrong:
        print(f"cover: {line}")
    if not passed:
        print("cover: a test has failed")
    return 0 if passed and not wrong else 1


if __name__ == "__main__":
    sys.exit(main())
