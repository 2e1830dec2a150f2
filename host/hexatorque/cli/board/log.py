"""`hexatorque board log`: what a board remembers over power cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from .. import options
from ..group import examples
from ..options import Mistake
from ..output import console_of, print_json, say
from .connection import open_drive

if TYPE_CHECKING:
    from rich.console import Console

    from ...drive.log import Log

NONE = "this board has no log: its firmware is older than protocol 2.4"


@click.command(epilog=examples("board log", "board log --csv"))
@click.option("--csv", "as_csv", is_flag=True, help="events as CSV")
@click.option("--forget", is_flag=True, help="empty it, after a question; the counters stay")
@click.option("--yes", is_flag=True, help="do not ask; with --forget")
@options.board
@options.as_json
def log(as_csv, forget, yes, device, baud, as_json) -> int:
    """Events and counters that the board keeps over a power-off.

    Each start, trip and warning, with the drive as it was then. Events in the flash are read while
    the gates are off only.
    """
    if as_csv and as_json:
        raise Mistake("--csv or --json, not both")
    if yes and not forget:
        raise Mistake("--yes is for --forget")
    with open_drive(device, baud) as drive:
        if forget:
            if not yes:
                click.confirm(f"Empty the log of {drive.client.url}?", abort=True, err=True)
            drive.forget_log()
        found = drive.log
    if found is None:
        raise Mistake(NONE)
    if as_json:
        print_json(found.as_json())
    elif as_csv:
        click.echo(found.as_csv(), nl=False)
    else:
        _show(console_of(as_json, highlight=False), found)
    return 0


def duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


def _show(console: Console, found: Log) -> None:
    from rich.table import Table

    one = found.counters
    table = Table()
    for heading in ("number", "powered", "event", "cause", "state", "scheme", "V_dc", "current",
                    "speed", "winding", "devices", "heat sink", "limits"):  # fmt: skip
        table.add_column(heading)
    for event in found.events:
        largest = max(abs(value) for value in event.currents_A.values())
        table.add_row(
            str(event.sequence), duration(event.powered_s), event.event, ", ".join(event.causes),
            event.state, event.scheme, f"{event.vdc_V:.1f} V", f"{largest:.3g} A",
            f"{event.speed_rpm:.1f} r/min",
            *("–" if degC is None else f"{degC:.0f} degC" for degC in event.temperatures_degC),
            ", ".join(event.limits),
        )  # fmt: skip
    console.print(table)
    said = {
        "powered": duration(one.powered_s),
        "gates on": duration(one.gates_s),
        "starts": one.starts,
        "largest": f"{one.vdc_V:.1f} V, {one.current_A:.3g} A, {one.speed_rpm:.1f} r/min, "
        + (f"{one.winding_degC:.0f} degC" if one.winding_degC > 0 else "– degC"),
        "trips": ", ".join(f"{name} {n}" for name, n in found.trips.items()) or "none",
        "missed events": one.missed,
        "damaged slots": one.damaged,
        "kept over power-off": "yes" if one.kept else "no",
    }
    say(False, said)
