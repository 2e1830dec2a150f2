"""Stack along the deepest call path, and who is called, from an image and the
compiler's stack usage files (-fstack-usage)."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from .link import TargetError

#: What a Cortex-M with FPU puts on the stack by itself for an interrupt: r0-r3, r12, lr,
#: pc, xPSR, s0-s15, FPSCR and a word to align.
EXCEPTION_OCTETS = 104


@dataclass
class Function:
    """`octets` it puts on the stack itself: the compiler's word, or for a library's
    function what its instructions push."""

    octets: int
    library: bool
    calls: set[str] = field(default_factory=set)
    indirect: bool = False  #: calls through a pointer


def _pushed(what: str, operands: str) -> int:
    """Octets that an instruction takes from the stack."""
    listed = re.search(r"\{(.+)\}", operands)
    if what in ("push", "vpush", "stmdb") and listed and (what != "stmdb" or "sp!" in operands):
        return sum(_registers(part) for part in listed[1].split(", ")) * 4
    taken = re.fullmatch(r"sp, (?:sp, )?#(\d+).*", operands)
    return int(taken[1]) if what.startswith("sub") and taken else 0


def _registers(part: str) -> int:
    """Registers in `r4` or `s16-s19`; a double counts twice."""
    ends = [int(n) for n in re.findall(r"[rsd](\d+)", part)]
    count = ends[-1] - ends[0] + 1 if ends else 1
    return 2 * count if part.startswith("d") else count


def _own_octets(folder: Path) -> dict[str, int]:
    """Function -> octets of stack, from all .su files below a build folder."""
    octets: dict[str, int] = {}
    for file in folder.rglob("*.su"):
        for line in file.read_text().splitlines():
            place, size, kind = line.split("\t")
            name = place.rsplit(":", 1)[1]
            if kind not in ("static", "dynamic,bounded"):
                raise TargetError(f"{name}: stack usage is {kind}")
            octets[name] = max(octets.get(name, 0), int(size))
    return octets


def call_graph(image: Path, build_folder: Path) -> dict[str, Function]:
    """Functions of an Arm image by name, each with whom it calls or jumps to."""
    text = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", image],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    own = _own_octets(build_folder)
    graph: dict[str, Function] = {}
    current = Function(0, True)
    for line in text.splitlines():
        head = re.fullmatch(r"[0-9a-f]+ <(.+)>:", line)
        if head:
            # Clones of a function (name.constprop.0) are listed by the part before the number.
            name = head[1]
            listed = re.sub(r"\.\d+$", "", name)
            octets = own.get(name, own.get(listed))
            current = graph.setdefault(name, Function(octets or 0, octets is None))
            continue
        instruction = re.match(r"\s+[0-9a-f]+:\s+(\S+)\s*(.*)", line)
        if not instruction:
            continue
        what, operands = instruction.groups()
        if current.library:
            current.octets += _pushed(what, operands)
        target = re.search(r"<([^+>]+)>", operands)
        if what.startswith("blx") and not target:
            current.indirect = True
        elif what.startswith("b") and target:
            current.calls.add(target[1])
    for name, function in graph.items():
        function.calls = {callee for callee in function.calls if callee in graph} - {name}
    return graph


def deepest(graph: dict[str, Function], entry: str) -> tuple[int, list[str]]:
    """Octets and functions of the deepest path from `entry`."""
    known: dict[str, tuple[int, list[str]]] = {}

    def walk(name: str, above: tuple[str, ...]) -> tuple[int, list[str]]:
        if name in above:
            raise TargetError(f"{name} calls itself: {' -> '.join([*above, name])}")
        if name not in known:
            function = graph[name]
            if function.indirect:
                raise TargetError(f"{name} calls through a pointer: no bound for {entry}")
            below = [walk(callee, (*above, name)) for callee in sorted(function.calls)]
            size, path = max(below, default=(0, []), key=lambda row: row[0])
            known[name] = function.octets + size, [name, *path]
        return known[name]

    return walk(entry, ())


def library_calls(graph: dict[str, Function], entry: str) -> set[str]:
    """Functions that are not ours, anywhere below `entry`; "?" for calls through pointers."""
    seen: set[str] = set()
    todo = [entry]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += graph[name].calls
    found = {name for name in seen if graph[name].library}
    return found | ({"?"} if any(graph[name].indirect for name in seen) else set())
