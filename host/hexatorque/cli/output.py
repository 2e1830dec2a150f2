"""The output that several commands share: tables, JSON, failures."""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from ..drive.trips import Trip

#: Width of what is no terminal: no line of a table is broken there.
WIDE = 1000


def console_of(as_json: bool, highlight: bool = True) -> Console:
    """Tables go to standard output, or to standard error beside JSON. COLUMNS, or the
    terminal, says how wide they may be."""
    from rich.console import Console

    console = Console(stderr=as_json, highlight=highlight)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = WIDE
    return console


def print_json(data: object) -> None:
    print(json.dumps(data, indent=1))


def print_failure(console: Console, text: str, what: str = "failed") -> None:
    from rich.markup import escape

    console.print(f"[bold red]{what}[/] {escape(text)}", highlight=False)


def complain(text: str) -> None:
    """Print an error on standard error, a line for each mistake."""
    for line in text.splitlines():
        print(f"hexatorque: {line}", file=sys.stderr)


def say(as_json: bool, data: dict, text: str | None = None) -> None:
    """A result: as JSON, as `text`, or a line for each value."""
    if as_json:
        print_json(data)
    elif text is not None:
        print(text)
    else:
        for key, value in data.items():
            print(f"{key:>16}  {value:.6g}" if isinstance(value, float) else f"{key:>16}  {value}")


def tripped(state: str, faults: list[str], trip: Trip | None = None) -> int:
    """The exit code after a drive has run."""
    from ..firmware import FAULT

    if state == FAULT:
        complain(f"the {trip}" if trip else f"the drive tripped: {', '.join(faults)}")
        return 1
    return 0
