"""Tables of a study as plain text: the same for the terminal and for the documentation."""

from __future__ import annotations

#: Of each table: its title, its headings, its rows.
Grid = list[tuple[str, list[str], list[list[str]]]]


def for_terminal(grid: Grid) -> list:
    from rich.table import Table

    made = []
    for title, heads, rows in grid:
        table = Table(title=title, title_justify="left")
        for head in heads:
            table.add_column(head)
        for row in rows:
            table.add_row(*row)
        made.append(table)
    return made
