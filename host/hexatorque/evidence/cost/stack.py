"""The stack along the deepest call path, and the call graph, from an image and the compiler's
stack usage files (-fstack-usage)."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from ...boards.processor import TargetError

#: Bytes that a Cortex-M with FPU itself pushes for an interrupt: r0-r3, r12, lr, pc, xPSR,
#: s0-s15, FPSCR and a word for alignment.
EXCEPTION_BYTES = 104


@dataclass
class Function:
    """A function. own_bytes: bytes that it pushes itself, from the compiler's files; for a library
    function, from its instructions."""

    name: str
    own_bytes: int
    library: bool
    calls: set[int] = field(default_factory=set)  #: addresses of the functions that it calls
    #: of those that it jumps to as its last act, when it has given its own bytes back
    jumps: set[int] = field(default_factory=set)
    indirect: bool = False  #: calls through a pointer


#: Functions by address, because several files may have a static function of the same name.
Graph = dict[int, Function]


def _pushed(what: str, operands: str) -> int:
    """Bytes that an instruction takes from the stack."""
    listed = re.search(r"\{(.+)\}", operands)
    if what in ("push", "vpush", "stmdb") and listed and (what != "stmdb" or "sp!" in operands):
        return sum(_registers(part) for part in listed[1].split(", ")) * 4
    taken = re.fullmatch(r"sp, (?:sp, )?#(\d+).*", operands)
    return int(taken[1]) if what.startswith("sub") and taken else 0


def _registers(part: str) -> int:
    """Number of registers in a text like `r4` or `s16-s19`. A double register counts twice."""
    ends = [int(n) for n in re.findall(r"[rsd](\d+)", part)]
    count = ends[-1] - ends[0] + 1 if ends else 1
    return 2 * count if part.startswith("d") else count


def usage_files(image: Path, objects: Iterable[Path]) -> list[Path]:
    """The compiler's stack usage files. If an image is optimised when it is linked they are beside
    the image, otherwise beside its object files."""
    linked = sorted(image.parent.glob(f"{image.name}.ltrans*.su"))
    return linked or [file.with_suffix(".su") for file in objects]


def _own_bytes(files: Iterable[Path]) -> dict[str, int]:
    """Function -> bytes of stack, from the stack usage files."""
    sizes: dict[str, int] = {}
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines():
            place, size, kind = line.split("\t")
            name = place.rsplit(":", 1)[1]
            if kind not in ("static", "dynamic,bounded"):
                raise TargetError(f"{name}: stack usage is {kind}")
            sizes[name] = max(sizes.get(name, 0), int(size))
    return sizes


def call_graph(image: Path, objects: Iterable[Path]) -> Graph:
    """The functions of an Arm image, each with the functions that it calls or jumps to."""
    text = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", image],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    own = _own_bytes(usage_files(image, objects))
    graph: Graph = {}
    current = Function("", 0, True)
    for line in text.splitlines():
        head = re.fullmatch(r"([0-9a-f]+) <(.+)>:", line)
        if head:
            # A clone of a function (name.constprop.0) is listed without its number. In an image
            # that is optimised when linked, a static one (name.lto_priv.0) has its full name.
            name = re.sub(r"\.lto_priv\.\d+$", "", head[2])
            size = own.get(name, own.get(re.sub(r"\.\d+$", "", name)))
            current = Function(name, size or 0, size is None)
            graph[int(head[1], 16)] = current
            continue
        instruction = re.match(r"\s+[0-9a-f]+:\s+(\S+)\s*(.*)", line)
        if not instruction:
            continue
        what, operands = instruction.groups()
        if current.library:
            current.own_bytes += _pushed(what, operands)
        target = re.search(r"\b([0-9a-f]+) <[^>]+>", operands)
        if what.startswith("blx") and not target:
            current.indirect = True
        elif what.startswith("b") and target:
            # "bl" is also the beginning of conditions: ble, bls, blt.
            (current.calls if what in ("bl", "blx") else current.jumps).add(int(target[1], 16))
    for address, function in graph.items():
        function.calls = {callee for callee in function.calls if callee in graph} - {address}
        function.jumps = {place for place in function.jumps if place in graph} - {address}
        # Part of a function that the compiler has put elsewhere: its bytes are still taken.
        parts = {place for place in function.jumps if graph[place].name.endswith(".cold")}
        function.calls |= parts
        function.jumps -= function.calls
    return graph


def address(graph: Graph, name: str) -> int:
    """The address of the function of this name."""
    (found,) = (place for place, function in graph.items() if function.name == name)
    return found


def deepest(graph: Graph, entry: str) -> tuple[int, list[str]]:
    """Bytes and functions of the deepest path from `entry`."""
    known: dict[int, tuple[int, list[str]]] = {}

    def walk(place: int, above: tuple[int, ...]) -> tuple[int, list[str]]:
        function = graph[place]
        if place in above:
            raise TargetError(f"{function.name} calls itself: no bound for {entry}")
        if function.indirect:
            raise TargetError(f"{function.name} calls through a pointer: no bound for {entry}")
        if place not in known:
            own = function.own_bytes
            paths = [(own, list[str]())]
            for callee in sorted(function.calls | function.jumps):
                size, path = walk(callee, (*above, place))
                paths.append((size + (own if callee in function.calls else 0), path))
            size, path = max(paths, key=lambda row: row[0])
            known[place] = size, [function.name, *path]
        return known[place]

    return walk(address(graph, entry), ())


def library_calls(graph: Graph, entry: str) -> set[str]:
    """The library functions that `entry` calls directly or indirectly. "?" stands for a call
    through a pointer."""
    seen: set[int] = set()
    todo = [address(graph, entry)]
    while todo:
        place = todo.pop()
        if place not in seen:
            seen.add(place)
            todo += graph[place].calls | graph[place].jumps
    found = {graph[place].name for place in seen if graph[place].library}
    return found | ({"?"} if any(graph[place].indirect for place in seen) else set())
