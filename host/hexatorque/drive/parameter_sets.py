"""Whole sets of parameters: files of them, writing one onto a board, and comparing two."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..errors import HexatorqueError, InputError
from ..firmware import FirmwareError, Parameter
from ..given import choice, numeric, suggest

if TYPE_CHECKING:
    from .board import BoardDrive

Values = Mapping[str, object]
Rows = Mapping[str, Parameter]


class ParameterSetError(InputError):
    """The board cannot take this set. The text has one line for each value out of range."""


class NotTaken(HexatorqueError, RuntimeError):
    """The board confirmed a set, but reading it back gives other values."""


def text_of(drive: BoardDrive) -> str:
    """The parameters in force on a board, as the text of a file."""
    values, rows = drive.get_all(), drive.params
    units = {name: f"  # {row.unit}" if row.unit else "" for name, row in rows.items()}
    lines = [f"{name} = {json.dumps(value)}{units[name]}" for name, value in values.items()]
    head = f"# {drive.hello.device}, {drive.hello.build}, {drive.dictionary.crc:08x}\n"
    return head + "[parameters]\n" + "\n".join(lines) + "\n"


def read(text: str, file: str) -> dict[str, object] | None:
    """The values in the text of such a file; None if it is a set-up's."""
    from ..setups.keys import SECTIONS

    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ParameterSetError(f"{file}: tables within tables") from None
    except ValueError as error:
        raise ParameterSetError(f"{file}: not valid TOML: {error}") from None
    if not {*SECTIONS, "setup", "profile"}.isdisjoint(data):
        return None
    if set(data) != {"parameters"} or not isinstance(data["parameters"], dict):
        raise ParameterSetError(f"{file}: one table [parameters] is needed, and nothing else")
    return data["parameters"]


def write_all(drive: BoardDrive, values: Values) -> dict[str, object]:
    """Write a set of parameters onto a board, all of it or none, and read it back. Returns the
    parameters that were changed.

    Only values that differ are written, because some parameters cannot change at present. All of
    them are in one request. The board takes it over in one fast interrupt or refuses it, so a
    mixture of the two sets is never in force.
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
            f"read back, {', '.join(wrong)} differ from the written values: the former values are "
            "in force again"
        )
    return changed


def numbers_of(values: Values, rows: Rows) -> dict[str, np.float32]:
    """The values as the float32 numbers of a board. ParameterSetError names every parameter that
    the board does not have and every value that is out of range."""
    numbers, lines = {}, []
    for name, value in values.items():
        try:
            if name not in rows:
                raise FirmwareError(f"no parameter {name!r} on this board{suggest(name, rows)}")
            numbers[name] = np.float32(rows[name].parse(value))
        except FirmwareError as error:
            lines.append(str(error))
    if lines:
        raise ParameterSetError("\n".join(lines))
    return numbers


def _other(numbers: Mapping[str, np.float32], there: Values, rows: Rows) -> list[str]:
    return [n for n, number in numbers.items() if number != np.float32(rows[n].parse(there[n]))]


def defaults(rows: Rows) -> dict[str, float | str]:
    """The values with which a drive starts if it has no saved set."""
    return {name: row.show(row.initial) for name, row in rows.items()}


def difference(first: Values, second: Values, rows: Rows) -> dict[str, tuple[object, object]]:
    """The parameters whose values differ, in the order of `rows`, with both values. None stands
    for a parameter that a set does not have. Values are compared as float32, as a board keeps
    them. They need not be in the board's range."""
    differing = {}
    for name in [*rows, *sorted((set(first) | set(second)) - set(rows))]:
        a, b = first.get(name), second.get(name)
        if _kept(a, rows.get(name)) != _kept(b, rows.get(name)):
            differing[name] = (a, b)
    return differing


def _kept(value: object, row: Parameter | None) -> object:
    """The form in which values are compared: numbers as float32, choices by name."""
    if row is not None and row.choices:
        if isinstance(value, bool):
            return "on" if value else "off"
        return None if value is None else choice(str(value), row.choices)
    value = numeric(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return np.float32(value)
    return value
