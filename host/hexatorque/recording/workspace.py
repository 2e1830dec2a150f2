"""Variables of MATLAB that another program has saved: Simulink, PLECS, an oscilloscope, a script.

A time and what has as many samples as it are searched for, among the variables and in each struct:

- vectors, and matrices with a row or a column for each signal, beside a vector `t`, `time_ms`,
  `tout` or the like, or beside numbers `Tinterval` and `Tstart` (PicoScope), `Ts`, `dt` or `fs`;
- Simulink's structure with time, and what `struct(timeseries)` gives: `Time`, `Data`;
- one matrix without a time, whose first row or column ascends (Simulink's To File).

A signal is called after its variable, or after its label; the rows or columns of a matrix are
counted from 1: `yout.1`. Structs with a time each are one recording if these times are the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import plain, table
from .formats import RecordingError
from .recording import Recording

#: Numbers that tell the time from sample to sample in s, its inverse in Hz, and the first time.
_STEP = re.compile(r"Tinterval|Ts|dt|sample_?time|step_s", re.IGNORECASE)
_RATE = re.compile(r"fs|sampl(?:e|ing)_?rate|rate_Hz", re.IGNORECASE)
_START = re.compile(r"Tstart|t0|start_s", re.IGNORECASE)
#: In lower case, the fields of a struct that is one signal: its samples, its name, its unit.
_SAMPLES, _LABELS, _UNITS = ("values", "data"), ("label", "name"), ("unit", "units")
#: Variables that a message names.
_NAMED = 12

_Path = tuple[str, ...]


@dataclass
class _Leaf:
    """path: the structs and the name; values: without dimensions of 1; label: a name that stands
    beside it."""

    path: _Path
    values: np.ndarray
    unit: str = ""
    label: str = ""

    def __str__(self) -> str:
        size = "complex, " * (self.values.dtype.kind == "c")
        return f"{'.'.join(self.path)} ({size}{' by '.join(map(str, self.values.shape))})"


@dataclass
class _Group:
    """A time and what is beside it, or in structs there. path: the struct that holds it all."""

    path: _Path
    time: _Leaf | None
    start_s: float = 0.0
    step_s: float = 0.0
    leaves: list[_Leaf] = field(default_factory=list)

    @property
    def samples(self) -> int:
        """As many as the time has; if it is counted, as the longest variable."""
        own = [self.time] if self.time else self.leaves
        return max((size for leaf in own for size in leaf.values.shape), default=0)

    def times(self) -> np.ndarray:
        """(n,), in the time's unit, in s if it is counted."""
        if self.time:
            return self.time.values.astype(float)
        return self.start_s + self.step_s * np.arange(self.samples)


@dataclass
class _Columns:
    """The columns as `plain` asks for them."""

    headings: list[tuple[str, str]]

    def name(self, column: int) -> str:
        return self.headings[column][0]

    def place(self, row: int) -> str:
        return f"sample {row + 1}"


def recording(contents: Mapping[str, Any]) -> Recording:
    """contents: what scipy's loadmat gives with simplify_cells. RecordingError in one line."""
    contents = {name: value for name, value in contents.items() if not name.startswith("__")}
    leaves = list(_leaves(contents))
    vectors = [leaf for leaf in leaves if leaf.values.ndim]
    named = {leaf.path[0] for leaf in leaves}
    without = [_without_numbers(n, v) for n, v in contents.items() if n not in named]
    groups = _groups(leaves)
    if not groups and len(vectors) == 1:
        vectors = _split(vectors[0])
        groups = _groups(vectors)
    there = _listed([*vectors, *without]) or "no vectors"
    if not groups:
        raise RecordingError(
            "no time: a vector named time_s, t, Time or the like is needed, or a number Tinterval, "
            f"Ts or fs; there: {there}"
        )
    parts = {group.path: list(_rows(group)) for group in groups}
    used = [group for group in groups if parts[group.path]]
    if not used:
        raise RecordingError(f"no vector of real numbers is as long as the time; there: {there}")
    first, *others = used
    for other in others:
        _check_same(first, other)
    notes = ["names, units and time are those of the variables"]
    time_s = first.times()
    if first.time:
        time_s, assumed = _seconds(first.time)
        notes += [assumed] * bool(assumed)
    headings, values = [], []
    taken = {id(group.time) for group in groups}
    for group in used:
        for leaf, number, data in parts[group.path]:
            taken.add(id(leaf))
            headings.append((_called(leaf, number, group, bool(others)), leaf.unit))
            values.append(data.astype(float))
    if left := _listed([*(leaf for leaf in vectors if id(leaf) not in taken), *without]):
        notes.append(f"left out: {left}")
    return plain.recording(_Columns(headings), values, None, time_s, notes)


def _leaves(fields: Mapping[str, Any], path: _Path = ()) -> Iterator[_Leaf]:
    """The arrays of numbers in a struct and in those below it."""
    lower = {name.lower(): value for name, value in fields.items()}
    label = next((_text(lower.get(name)) for name in _LABELS if _text(lower.get(name))), "")
    for name, value in fields.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, (*path, name))
        elif isinstance(value, list):
            for number, one in enumerate(value, 1):
                if isinstance(one, Mapping):
                    yield from _leaves(one, (*path, name, str(number)))
        elif (values := np.squeeze(value)).dtype.kind in "biufc" and values.size:
            own = bool(path) and name.lower() in _SAMPLES
            yield _Leaf((*path, name), values, _unit(name, own, lower), label if own else "")


def _text(value: object) -> str:
    return " ".join(value.split()) if isinstance(value, str) else ""


def _unit(name: str, own: bool, lower: Mapping[str, Any]) -> str:
    """The unit of a field: in a struct `units`, in what describes a timeseries, or beside it."""
    beside = next((lower[key] for key in _UNITS if key in lower), None)
    if isinstance(beside, Mapping):
        return _text(beside.get(name))
    info = lower.get("datainfo" if own else "timeinfo" if table.is_time(name) else "")
    if isinstance(info, Mapping):
        return _text(info.get("Units"))
    return _text(beside) if own else ""


def _groups(leaves: list[_Leaf]) -> list[_Group]:
    """The times that there are, each with what is in its struct and in no inner one with a time."""
    groups: dict[_Path, _Group] = {}
    for leaf in leaves:
        path, name = leaf.path[:-1], leaf.path[-1]
        if leaf.values.ndim == 1 and leaf.values.dtype.kind != "c" and table.is_time(name):
            other = groups.setdefault(path, _Group(path, leaf)).time
            if other and not _same(_seconds(other)[0], _seconds(leaf)[0]):
                raise RecordingError(f"which is the time: {other} or {leaf}?")
    numbers = [one for one in leaves if not one.values.ndim and one.values.dtype.kind != "c"]
    timed = bool(groups)  # then a Ts may be a parameter of anything
    for leaf in numbers:
        path, name, value = leaf.path[:-1], leaf.path[-1], float(leaf.values)
        step_s = value if _STEP.fullmatch(name) else 0.0
        if _RATE.fullmatch(name) and value > 0:
            step_s = 1 / value
        if not timed and path not in groups and 0 < step_s < np.inf and 1 / step_s < np.inf:
            groups[path] = _Group(path, None, step_s=step_s)
    for leaf in numbers:
        if _START.fullmatch(leaf.path[-1]) and leaf.path[:-1] in groups:
            groups[leaf.path[:-1]].start_s = float(leaf.values)
    times = [group.time for group in groups.values()]
    for leaf in leaves:
        homes = [path for path in groups if leaf.path[: len(path)] == path]
        if homes and leaf.values.ndim and not any(leaf is time for time in times):
            groups[max(homes, key=len)].leaves.append(leaf)
    return list(groups.values())


def _split(leaf: _Leaf) -> list[_Leaf]:
    """The rows or columns of a matrix that stands alone, whichever are longer. The first is the
    time if it ascends."""
    if leaf.values.ndim != 2:
        return [leaf]
    rows = leaf.values if leaf.values.shape[0] < leaf.values.shape[1] else leaf.values.T
    if rows.dtype.kind == "c" or not (np.diff(rows[0].astype(float)) > 0).all():
        return [leaf]
    signals = [_Leaf((*leaf.path, str(n)), row) for n, row in enumerate(rows[1:], 2)]
    return [_Leaf(("time",), rows[0]), *signals]


def _rows(group: _Group) -> Iterator[tuple[_Leaf, int, np.ndarray]]:
    """What has as many real samples as the time: the variable, the number of the row or column in
    it from 1 on, 0 of a vector, and its samples."""
    samples = group.samples
    for leaf in group.leaves:
        values, shape = leaf.values, leaf.values.shape
        if values.dtype.kind == "c" or samples not in shape:
            continue
        if values.ndim == 1:
            yield leaf, 0, values
            continue
        if values.ndim == 2 and shape[0] == shape[1]:
            raise RecordingError(f"{leaf}: its rows may be the samples, or its columns")
        if shape[-1] == samples:  # Simulink stacks the samples of a matrix behind each other
            rows = values.reshape(-1, samples)
        else:
            rows = values.reshape(samples, -1).T
        yield from ((leaf, number, row) for number, row in enumerate(rows, 1))


def _called(leaf: _Leaf, number: int, group: _Group, several: bool) -> str:
    """A signal's name within its group; with several groups, after their structs as well."""
    inner = [part for part in leaf.path[len(group.path) :] if part.lower() != "signals"]
    if inner[-1].lower() in _SAMPLES and leaf.path[1:]:
        del inner[-1]
    name = leaf.label or ".".join(inner)
    if not name or name.isdigit():
        name = ".".join([*group.path[-1:], *inner])
    elif several and group.path and not (leaf.label or not inner):
        name = ".".join([*group.path, *inner])
    return f"{name}.{number}" if number else name


def _seconds(time: _Leaf) -> tuple[np.ndarray, str]:
    """A time in s, and what was taken for granted about its unit."""
    name = time.path[-1]
    unit_s, assumed = table.as_time(name, time.unit, name) or (1.0, "")
    return time.values.astype(float) * unit_s, assumed


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    """Two times are the same, to the part of a step that a table may be off as well."""
    if len(a) != len(b):
        return False
    step = (a[-1] - a[0]) / max(1, len(a) - 1)
    return bool((abs(a - b) <= table.SLACK * abs(step)).all())


def _check_same(first: _Group, other: _Group) -> None:
    if not _same(first.times(), other.times()):
        names = [str(one.time or ".".join(one.path) or "the variables") for one in (first, other)]
        raise RecordingError(f"{names[0]} and {names[1]} are different times: keep one in the file")


def _without_numbers(name: str, value: Any) -> str:
    """A variable as a message names it. scipy keeps the name of an object within it."""
    kinds = getattr(getattr(value, "dtype", None), "names", None) or ()
    if {"s0", "s2"} <= set(kinds):
        owner, kind = (bytes(value[key].flat[0]).decode() for key in ("s0", "s2"))
        return f"{owner} ({kind} object)"
    return f"{name} (no numbers)"


def _listed(names: list[_Leaf | str]) -> str:
    more = f" and {len(names) - _NAMED} more" if names[_NAMED:] else ""
    return ", ".join(map(str, names[:_NAMED])) + more
