"""The command `setups`, which lists set-ups and schemes."""

from __future__ import annotations

import click

from . import completion, options
from .group import examples
from .output import console_of, print_json


@click.command(
    "setups", epilog=examples("setups", "setups paper-b examples/reversal.toml", "setups --schemes")
)
@click.argument(
    "names",
    metavar="[NAME|FILE]...",
    nargs=-1,
    shell_complete=completion.setup,
    help="set-ups to show in full; default: a list of the built-in ones",
)
@options.as_json
@click.option("--schema", is_flag=True, help="JSON Schema of their files, for editors")
@click.option(
    "--schemes", is_flag=True, help="show the control schemes instead: their source and options"
)
def setups(names, as_json, schema, schemes) -> int:
    """Built-in set-ups or those named: each value with its source."""
    from rich.markup import escape
    from rich.table import Table

    from .. import setups

    if schema:
        print_json(setups.json_schema())
        return 0
    if schemes:
        return _schemes(as_json)
    loaded = [setups.load(name) for name in names or setups.builtin_names()]
    if as_json:
        print_json({s.name: setups.describe(s) for s in loaded})
        return 0
    console = console_of(False)
    for setup in loaded:
        table = Table(title=f"{setup.name}\n{setup.title}\n{setup.paper}", title_justify="left")
        for heading in ("section", "key", "value", "unit", "tag", "note"):
            table.add_column(heading, justify="right" if heading == "value" else "left")
        for section, rows in setups.describe(setup).items():
            for key, row in rows.items():
                table.add_row(
                    section,
                    key,
                    setups.show(row["value"]),
                    row["unit"],
                    row["tag"],
                    escape(row["note"]),
                )
            table.add_section()
        console.print(table)
    return 0


def _schemes(as_json) -> int:
    from rich.table import Table

    from ..analysis.schemes import OPTIONS, SCHEMES
    from ..laws import REFERENCES

    references = {name: text for name, (_, text) in REFERENCES.items()}
    if as_json:
        print_json({"schemes": SCHEMES, "options": OPTIONS, "references": references})
        return 0
    console = console_of(False)
    table = Table(title="schemes (controller.scheme)", title_justify="left", show_lines=True)
    for heading in ("name", "source", "vectors in a period", "torque levels", "x-y currents"):
        table.add_column(heading)
    for name, row in SCHEMES.items():
        table.add_row(name, row["source"], row["vectors"], row["torque_levels"], row["xy"])
    console.print(table)
    table = Table(title="references outside the firmware, for compare", title_justify="left")
    for heading in ("name", "method"):
        table.add_column(heading)
    for name, text in references.items():
        table.add_row(name, text)
    console.print(table)
    table = Table(title="options of every scheme", title_justify="left")
    for heading in ("key", "choices", "effect"):
        table.add_column(heading)
    for key, row in OPTIONS.items():
        table.add_row(key, row["choices"], row["help"])
    console.print(table)
    return 0
