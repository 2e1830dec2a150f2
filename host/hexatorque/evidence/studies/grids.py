"""Tables of a study as plain text: the same for the terminal and for the documentation."""

from __future__ import annotations

import re

#: Of each table: its title, its headings, its rows.
Grid = list[tuple[str, list[str], list[list[str]]]]
#: What a cell of a column of figures begins with.
FIGURE = re.compile(r"[-+–\d]|$")


def for_terminal(grid: Grid) -> list:
    from rich.table import Table

    made = []
    for title, heads, rows in grid:
        table = Table(title=title or None, title_justify="left")
        for n, head in enumerate(heads):
            figures = all(FIGURE.match(row[n]) for row in rows)
            table.add_column(head.replace("`", ""), justify="right" if figures else "left")
        for row in rows:
            table.add_row(*(cell.replace("`", "") for cell in row))
        made.append(table)
    return made
