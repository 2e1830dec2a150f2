"""`hexatorque board params`: the parameters of a board, by its own list."""

from __future__ import annotations

import json
from pathlib import Path

import click

from .. import completion, options
from ..group import Group, examples
from ..options import Mistake
from ..output import console_of, say
from .connection import SHORT_NAMES, open_drive


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
)


@params.command("list", epilog=examples("board params list"))
@options.board
@options.as_json
def list_parameters(device, baud, as_json) -> int:
    """All parameters with value, unit, range."""
    from rich.table import Table

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
    for name, row in rows.items():
        value = values[name]
        shown = f"{value:.6g}" if isinstance(value, float) else value
        allowed = ", ".join(row.choices) or f"{row.min:g} .. {row.max:g}"
        table.add_row(name, shown, row.unit, allowed, "yes" if row.live else "no", row.help)
    console_of(as_json, highlight=False).print(table)
    return 0


@params.command(epilog=examples("board params get rs_ohm scheme"))
@click.argument(
    "names", metavar="NAME...", nargs=-1, required=True, shell_complete=completion.parameter
)
@options.board
@options.as_json
def get(names, device, baud, as_json) -> int:
    """Values of parameters; `hexatorque board set` changes them."""
    with open_drive(device, baud) as drive:
        say(as_json, drive.get_many([SHORT_NAMES.get(name, name) for name in names]))
    return 0


@params.command(epilog=examples("board params save b.toml"))
@file_given
@options.board
@options.as_json
def save(file, device, baud, as_json) -> int:
    """Write all parameters to a file."""
    with open_drive(device, baud) as drive:
        values = drive.get_all()
        head = f"# {drive.hello.device}, {drive.hello.build}, {drive.dictionary.crc:08x}\n"
        rows = drive.params
    lines = [
        f"{name} = {json.dumps(value)}" + (f"  # {rows[name].unit}" if rows[name].unit else "")
        for name, value in values.items()
    ]
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(head + "[parameters]\n" + "\n".join(lines) + "\n")
    except OSError as error:
        raise Mistake(f"{file}: {error.strerror}") from None
    say(as_json, {"file": str(file), "parameters": len(values)})
    return 0


@params.command(epilog=examples("board params load b.toml"))
@file_given
@options.board
@options.as_json
def load(file, device, baud, as_json) -> int:
    """Set what a file names, all or none.

    Only what differs is set: other parameters may be such that cannot change now.
    """
    values = _parameters_of(file)
    with open_drive(device, baud) as drive:
        before = drive.get_many(list(values))
        changed = {
            name: value
            for name, value in values.items()
            if drive.params[name].parse(value) != drive.params[name].parse(before[name])
        }
        drive.set_many(changed)
    say(as_json, {"file": str(file), "changed": {n: values[n] for n in changed}})
    return 0


def _parameters_of(path: Path) -> dict[str, object]:
    import tomllib

    try:
        data = tomllib.loads(path.read_text())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise Mistake(f"{path}: {reason}") from None
    values = data.get("parameters")
    if set(data) != {"parameters"} or not isinstance(values, dict):
        raise Mistake(f"{path}: one table [parameters] is needed")
    return values


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
    """The board forgets what it kept; it starts with built-in parameters."""
    with open_drive(device, baud) as drive:
        drive.forget_parameters()
        said = (
            f"{drive.client.url}: forgotten; the board starts with its built-in parameters from "
            "now on, those in force stay until then"
        )
    say(as_json, {"kept": False}, said)
    return 0
