"""Whole sets of parameters: brought onto a drive, and compared with each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..errors import HexatorqueError
from ..firmware import FirmwareError, Parameter

if TYPE_CHECKING:
    from .board import BoardDrive

Values = Mapping[str, object]
Rows = Mapping[str, Parameter]


class ParameterSetError(HexatorqueError, ValueError):
    """A set that a board does not take; one line for each value that it does not allow."""

    exit_code = 2


class NotTaken(HexatorqueError, RuntimeError):
    """A board said that it took a set, and reads back another."""


def write_all(drive: BoardDrive, values: Values) -> dict[str, object]:
    """Bring a set of parameters onto a board, all of it or none, and read it back. Returns those
    that were changed.

    Only what differs is written: others may be such that cannot change now. It is one request,
    which the board takes over with one fast interrupt or refuses, so no set in between is ever in
    force.
    """
    numbers = numbers_of(values, drive.params)
    before = drive.get_many(list(values))
    changed = {name: values[name] for name in _other(numbers, before, drive.params)}
    if not changed:
        return {}
    drive.set_many(changed)
    wrong = _other(numbers, drive.get_many(list(values)), drive.params)
    if wrong:
        drive.set_many({name: before[name] for name in changed})
        raise NotTaken(
            f"read back, {', '.join(wrong)} differ from what was written: the former values are "
            "in force again"
        )
    return changed


def numbers_of(values: Values, rows: Rows) -> dict[str, np.float32]:
    """The numbers that a board would keep. What it does not know or allow is refused, all of it
    by name."""
    numbers, lines = {}, []
    for name, value in values.items():
        try:
            if name not in rows:
                raise FirmwareError(f"no parameter {name!r} on this board")
            numbers[name] = np.float32(rows[name].parse(value))
        except FirmwareError as error:
            lines.append(str(error))
    if lines:
        raise ParameterSetError("\n".join(lines))
    return numbers


def _other(numbers: Mapping[str, np.float32], there: Values, rows: Rows) -> list[str]:
    return [n for n, number in numbers.items() if number != np.float32(rows[n].parse(there[n]))]


def defaults(rows: Rows) -> dict[str, float | str]:
    """What a drive starts with, unless it has kept another set."""
    return {name: row.show(row.initial) for name, row in rows.items()}


def difference(first: Values, second: Values, rows: Rows) -> dict[str, tuple[object, object]]:
    """The parameters whose values differ, in the order of `rows`; None where a set has none.
    Values are compared as a board keeps them, and need not be in its range."""
    differing = {}
    for name in [*rows, *sorted((set(first) | set(second)) - set(rows))]:
        a, b = first.get(name), second.get(name)
        if _kept(a, rows.get(name)) != _kept(b, rows.get(name)):
            differing[name] = (a, b)
    return differing


def _kept(value: object, row: Parameter | None) -> object:
    """A value as it is compared: numbers as float32, choices by name."""
    if row is not None and row.choices:
        if isinstance(value, bool):
            return "on" if value else "off"
        return None if value is None else str(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return np.float32(value)
    return value
