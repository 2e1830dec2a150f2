"""`board params load` and `board params diff`: sets of parameters, of a board, a file, a set-up."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..drive.parameter_sets import (
    ParameterSetError,
    defaults,
    difference,
    read,
    write_all,
)
from ..errors import InputError
from ..given import text_of

if TYPE_CHECKING:
    from rich.console import Console

    from ..drive.board import BoardDrive
    from ..setups import Setup

#: Two words for sets that are in no file.
BOARD, DEFAULTS = "board", "defaults"


class ParameterSet(NamedTuple):
    name: str
    values: Mapping[str, object]
    setup: Setup | None = None  #: where the values come from one


def load(console: Console, drive: BoardDrive, source: str, as_json: bool = False) -> int:
    """Bring the parameters of a file or a set-up onto a board, all or none, and read them back.
    Of a set-up these are the ones that its simulation uses. What belongs to the plant is named."""
    given = parameter_set(source, drive)
    changed = write_all(drive, given.values)
    remarks = _remarks(given.setup, drive.hello.device) if given.setup else []
    if as_json:
        data = {"source": source, "parameters": len(given.values), "changed": changed}
        print(json.dumps({**data, "remarks": remarks}, indent=1))
        return 0
    for name, value in changed.items():
        console.print(f"{name:>20}  {_shown(value)} {drive.params[name].unit}".rstrip())
    console.print(
        f"{given.name}: {len(given.values)} parameters, {len(changed)} changed, read back"
    )
    for line in remarks:
        console.print(line)
    return 0


def diff(
    console: Console,
    drive: BoardDrive | None,
    first: str,
    second: str = BOARD,
    as_json: bool = False,
) -> int:
    """The differences between two sets: each a file of parameters, a set-up, `board` or `defaults`.
    Without a board the names are the firmware's of this package. 1 if anything differs."""
    from .. import firmware

    a, b = parameter_set(first, drive), parameter_set(second, drive)
    rows = drive.params if drive else firmware.parameters()
    differing = difference(a.values, b.values, rows)
    if as_json:
        print(json.dumps({name: list(pair) for name, pair in differing.items()}, indent=1))
        return int(bool(differing))
    if not differing:
        console.print(f"{a.name} and {b.name}: no parameter differs")
        return 0
    from rich.table import Table

    table = Table()
    for heading in ("parameter", a.name, b.name, "unit"):
        table.add_column(heading)
    for name, pair in differing.items():
        table.add_row(name, *map(_shown, pair), rows[name].unit if name in rows else "")
    console.print(table)
    return 1


def parameter_set(source: str, drive: BoardDrive | None) -> ParameterSet:
    """`board`, `defaults`, a set-up's name, a set-up's file, or a file of `params save`."""
    from .. import firmware, setups

    if source == BOARD:
        if drive is None:
            raise ParameterSetError("board: there is none to compare with")
        return ParameterSet(drive.hello.device, drive.get_all())
    if source == DEFAULTS:
        return ParameterSet(source, defaults(drive.params if drive else firmware.parameters()))
    path = Path(source)
    if path.suffix and (values := _saved(path)) is not None:
        return ParameterSet(path.name, values)
    setup = setups.load(source)
    return ParameterSet(setup.name, setups.parameters(setup), setup)


def _saved(path: Path) -> dict[str, object] | None:
    """The values of a file of `params save`; None if it is a set-up's."""
    try:
        text = text_of(path)
    except InputError as error:
        raise ParameterSetError(f"{path}: {error}") from None
    return read(text, str(path))


def _remarks(setup: Setup, device: str) -> list[str]:
    """The parts of a set-up that a board does not get, or cannot be."""
    from ..setups.to_parameters import not_on_a_board

    lines = []
    if plant := not_on_a_board(setup):
        lines.append(f"not for a board, they describe the plant: {', '.join(plant)}")
    if (made_for := setup["timing.device"]) not in device:
        lines.append(f"timing.device = {made_for}: this board is a {device}")
    if setup["timing.latency"] == "none":
        lines.append("timing.latency = none: no board writes a pattern at the sampling instant")
    return lines


def _shown(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, (int, float)) else str(value)
