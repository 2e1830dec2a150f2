"""A drive's tables for the page: parameters, channels, faults, warnings, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..drive import limits
from ..drive.captures import TRIGGERS
from ..firmware import WARNINGS, Parameter, grouped
from ..serial.wire import ChannelRow, FaultRow


def parameter(row: Parameter) -> dict:
    return {
        "name": row.name, "unit": row.unit, "min": row.min, "max": row.max,
        "initial": row.initial, "live": row.live, "choices": row.choices,
        "whole": row.whole, "help": row.help,
    }  # fmt: skip


def tables(
    parameters: Mapping[str, Parameter],
    channels: Sequence[ChannelRow],
    faults: Sequence[FaultRow],
    states: Sequence[str],
) -> dict:
    """The dictionary of a board as JSON, for the page."""
    names = [row.name for row in channels]
    return {
        "triggers": TRIGGERS,
        "states": states,
        "parameters": [parameter(row) for row in parameters.values()],
        "groups": [
            {"title": title, "names": members} for title, members in grouped(parameters).items()
        ],
        "channels": [row._asdict() for row in channels],
        "limits": [limit._asdict() for limit in limits.of_board(parameters, names)],
        "faults": [row._asdict() for row in faults],
        "warnings": [{"bit": bit, "name": text} for bit, text in WARNINGS.items()],
    }
