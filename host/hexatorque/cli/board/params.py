"""`hexatorque board params`: the parameters of a board, by its own list."""

from __future__ import annotations

from pathlib import Path

import click

from .. import completion, options
from ..group import Group, examples
from ..options import Mistake
from ..output import console_of, say
from .connection import full_name, open_drive


@click.group(cls=Group, epilog=examples("board params list", "board params save b.toml"))
def params() -> None:
    """The parameters of a board, by its own list.

    `save` and `load` are a file on this computer; `keep` and `forget` are the board's own memory,
    which survives power-off. `hexatorque board set` changes parameters.
    """


file_given = click.argument(
    "file",
    metavar="FILE.toml",
    type=click.Path(path_type=Path),
    shell_complete=completion.files,
    help="file for the parameters",
)


@params.command("list", epilog=examples("board params list"))
@options.board
@options.as_json
def list_parameters(device, baud, as_json) -> int:
    """All parameters with value, unit, range."""
    from rich.table import Table

    from ... import firmware

    with open_drive(device, baud) as drive:
        values = drive.get_all()
        rows = drive.params
        started_with = drive.parameter_set
    if as_json:
        data = {
            name: {
                "value": values[name], "unit": row.unit, "min": row.min, "max": row.max,
                "choices": row.choices, "live": row.live, "help": row.help,
            }
            for name, row in rows.items()
        }  # fmt: skip
        say(as_json, data)
        return 0
    table = Table(caption=f"the board started with its parameters {started_with}")
    for heading in ("name", "value", "unit", "allowed", "while running", "what it is"):
        table.add_column(heading)
    for names in firmware.grouped(rows).values():
        table.add_section()
        for name in names:
            row, value = rows[name], values[name]
            shown = f"{value:.6g}" if isinstance(value, float) else value
            allowed = ", ".join(row.choices) or f"{row.min:g} .. {row.max:g}"
            table.add_row(name, shown, row.unit, allowed, "yes" if row.live else "no", row.help)
    console_of(as_json, highlight=False).print(table)
    return 0


@params.command(epilog=examples("board params get rs_ohm scheme"))
@click.argument(
    "names",
    metavar="NAME...",
    nargs=-1,
    required=True,
    shell_complete=completion.parameter,
    help="parameters; `params list` shows all",
)
@options.board
@options.as_json
def get(names, device, baud, as_json) -> int:
    """Values of parameters; `hexatorque board set` changes them."""
    with open_drive(device, baud) as drive:
        say(as_json, drive.get_many([full_name(name) for name in names]))
    return 0


@params.command(epilog=examples("board params save b.toml"))
@file_given
@options.board
@options.as_json
def save(file, device, baud, as_json) -> int:
    """Write all parameters to a file."""
    from ...drive.parameter_sets import text_of

    with open_drive(device, baud) as drive:
        text, count = text_of(drive), len(drive.params)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Mistake(f"{file}: {error.strerror}") from None
    say(as_json, {"file": str(file), "parameters": count})
    return 0


@params.command(epilog=examples("board params load b.toml", "board params load --setup paper-b"))
@click.argument(
    "file",
    metavar="[FILE.toml]",
    required=False,
    type=click.Path(),
    shell_complete=completion.files,
    help="a file of `params save`",
)
@click.option("--setup", metavar="NAME|FILE", shell_complete=completion.setup,
              help="the parameters that the simulation of this set-up uses")  # fmt: skip
@options.board
@options.as_json
def load(file, setup, device, baud, as_json) -> int:
    """Set the parameters of a file or a set-up, all or none, and read them back.

    Only those that differ are set, because some of the others may not be allowed to change now.
    """
    from .. import parameter_sets

    if (file is None) == (setup is None):
        raise Mistake("name a file of `params save`, or --setup NAME|FILE")
    with open_drive(device, baud) as drive:
        return parameter_sets.load(
            console_of(as_json, highlight=False), drive, file or setup, as_json
        )


@params.command(epilog=examples("board params diff paper-b", "board params diff defaults b.toml"))
@click.argument("first", metavar="SET", help="one set of parameters")
@click.argument(
    "second",
    metavar="[SET]",
    default="board",
    shell_complete=completion.setup,
    help="the other one; default: the board",
)
@options.board
@options.as_json
def diff(first, second, device, baud, as_json) -> int:
    """Differences between two sets of parameters; exit code 1 if there are any.

    A set is `board`, `defaults`, a set-up's name or file, or a file of `params save`.
    """
    from .. import parameter_sets

    console = console_of(as_json, highlight=False)
    if parameter_sets.BOARD not in (first, second):
        return parameter_sets.diff(console, None, first, second, as_json)
    with open_drive(device, baud) as drive:
        return parameter_sets.diff(console, drive, first, second, as_json)


@params.command(epilog=examples("board params keep"))
@options.board
@options.as_json
def keep(device, baud, as_json) -> int:
    """The board keeps its parameters over a power-off; gates off only."""
    with open_drive(device, baud) as drive:
        drive.store_parameters()
        said = (
            f"{drive.client.url}: kept; the board starts with these parameters from now on "
            "(references start at their built-in values)"
        )
    say(as_json, {"kept": True}, said)
    return 0


@params.command(epilog=examples("board params forget"))
@options.board
@options.as_json
def forget(device, baud, as_json) -> int:
    """The board deletes its kept parameters; it starts with built-in ones."""
    with open_drive(device, baud) as drive:
        drive.forget_parameters()
        said = (
            f"{drive.client.url}: forgotten; the board starts with its built-in parameters from "
            "now on, those in force stay until then"
        )
    say(as_json, {"kept": False}, said)
    return 0
