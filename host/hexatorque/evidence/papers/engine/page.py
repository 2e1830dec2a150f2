"""One HTML page with all reproduced figures. It can be opened from disk."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ....analysis import pages
from ....setups import show
from .figure import VERDICTS

if TYPE_CHECKING:
    from rich.table import Table

PAPERS = (
    ("A", "Paper A: Holakooie, Iwanski, Miazga 2022"),
    ("B", "Paper B: Pandit, Aware, Nemade, Levi 2017"),
    ("", "Both papers"),
)


def number(value: float | str | None) -> str:
    """A number of a verdict table, with four significant digits."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(0, 4 - math.floor(math.log10(abs(value))) - 1)
    return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.3g}"


def with_unit(value: float | str | None, unit: str) -> str:
    text = number(value)
    return f"{text} {unit}" if unit and value is not None else text


def counts(figures: dict[str, dict]) -> dict[str, int]:
    """The number of each kind of verdict, in the order of VERDICTS."""
    words = [row["verdict"] for data in figures.values() for row in data["verdicts"]]
    return {word: words.count(word) for word in VERDICTS}


def console_table(figures: dict[str, dict]) -> Table:
    """The verdicts as tables for the terminal."""
    from rich.table import Table
    from rich.text import Text

    colour = dict(zip(VERDICTS, ("green", "green", "red", "red", "dim")))
    many = ", ".join(f"{count} {word}" for word, count in counts(figures).items() if count)
    table = Table(title=f"verdicts: {many}", title_justify="left")
    for heading in ("figure", "what", "ours", "paper", "verdict"):
        table.add_column(heading)
    for name, data in figures.items():
        for v in data["verdicts"]:
            ours, paper = (Text(with_unit(v[key], v["unit"])) for key in ("ours", "paper"))
            word = Text(v["verdict"], colour[v["verdict"]])
            table.add_row(name, Text(v["what"]), ours, paper, word)
        table.add_section()
    return table


def _rows(name: str, data: dict) -> list[tuple[str, dict]]:
    return [(name, verdict) for verdict in data["verdicts"]]


def _assumptions(data: dict) -> dict[str, dict]:
    """Set-up -> its values that the paper does not print, each set-up once."""
    found: dict[str, dict] = {}
    for setup in data["setup"]:
        found.setdefault(setup["name"], setup["assumed"])
    return found


def _papers(figures: dict[str, dict]) -> list[tuple[str, dict[str, dict]]]:
    """The figures under their papers' headings. A paper without figures is left out."""
    groups = []
    for letter, heading in PAPERS:
        own = {n: d for n, d in figures.items() if (n[0] if n[0] in "AB" else "") == letter}
        if own:
            groups.append((heading, own))
    return groups


def write_page(path: Path, figures: dict[str, dict], failed: dict[str, str]) -> Path:
    """The page. figures: identifier -> contents of its JSON file, in the order of the page."""
    return pages.write_page(
        path,
        "papers.html",
        title="Two papers, reproduced",
        figures=figures,
        failed=failed,
        quick=any(data["quick"] for data in figures.values()),
        counts=counts(figures),
        all_rows=[row for name, data in figures.items() for row in _rows(name, data)],
        papers=_papers(figures),
        rows_of=_rows,
        assumptions=_assumptions,
        show=show,
        with_unit=with_unit,
    )
