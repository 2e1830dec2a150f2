"""Types of the translated functions, and how C names them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np


class Untranslatable(Exception):
    """A function uses something outside of the subset. The text names module, line and
    reason; placed: whether it names the place already."""

    placed = False


@dataclass(frozen=True)
class Scalar:
    name: str  # in C
    letter: str  # in names of types that hold it


INT = Scalar("int64_t", "i")
UINT = Scalar("uint64_t", "u")
WORD = Scalar("uint16_t", "w")
REAL = Scalar("double", "d")
SINGLE = Scalar("float", "f")
FLAG = Scalar("bool", "b")
COMPLEX = Scalar("plant_complex", "c")
VOID = Scalar("void", "v")

#: Types of numpy's scalars in records and arrays.
OF_NUMPY = {
    np.dtype(name): scalar
    for name, scalar in {
        "i8": INT, "u8": UINT, "u2": WORD, "f8": REAL, "f4": SINGLE, "c16": COMPLEX,
    }.items()
}  # fmt: skip


@dataclass(frozen=True)
class Record:
    """A numpy record. Functions get its address."""

    dtype: np.dtype = field(hash=False)
    name: str

    def __hash__(self) -> int:
        return hash(self.name)


@dataclass(frozen=True)
class Array:
    """Numbers in memory, row by row. shape: None where the length is not known; it then is no part
    of an index."""

    item: Scalar
    shape: tuple[int | None, ...]


@dataclass(frozen=True)
class Table:
    """An array of two dimensions whose size is known at run time only."""

    item: Scalar


@dataclass(frozen=True)
class Tuple:
    items: tuple[Any, ...]


@dataclass(frozen=True)
class Parts:
    """A named tuple. Functions get its address."""

    name: str
    fields: tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Entry:
    """A C function that takes so many numbers of 64 bits."""

    arguments: int


@dataclass(frozen=True)
class Constant:
    """Known while translating: a number, a function, a module, a tuple of these."""

    value: Any = field(hash=False)

    def __hash__(self) -> int:
        return 0


def name_of(kind: Any) -> str:
    """A type in C, as a variable or an argument has it."""
    if isinstance(kind, Scalar):
        return kind.name
    if isinstance(kind, Record | Parts):
        return f"struct {kind.name} *"
    if isinstance(kind, Array):
        return f"{kind.item.name} *"
    if isinstance(kind, Table):
        return f"struct table_{kind.item.letter}"
    if isinstance(kind, Tuple):
        return f"struct tuple_{letters(kind)}"
    raise Untranslatable(f"no type in C for {kind}")


def letters(kind: Tuple) -> str:
    return "".join(
        f"t{len(one.items)}{letters(one)}" if isinstance(one, Tuple) else one.letter
        for one in kind.items
    )


def declared(kind: Any, name: str) -> str:
    if isinstance(kind, Entry):
        return f"void (*{name})({', '.join(['uint64_t'] * kind.arguments)})"
    text = name_of(kind)
    return f"{text}{name}" if text.endswith("*") else f"{text} {name}"
