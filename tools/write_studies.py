"""Renew the generated parts of the documentation from what `hexatorque evidence studies` wrote: of
those studies whose results are in the folder.

Usage: write_studies.py OUT_DIR [docs]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import doc_page

from hexatorque.evidence.studies import (
    arcs,
    commissioning,
    dynamics,
    faults,
    lost_phase,
    machines,
    robustness,
    transients,
)
from hexatorque.evidence.studies.grids import Grid

#: Name -> the page, and the study.
STUDIES = {
    "dynamics": ("robustness.md", dynamics),
    "robustness": ("robustness.md", robustness),
    "faults": ("protection.md", faults),
    "lost-phase": ("lost-phase.md", lost_phase),
    "arcs": ("lost-phase.md", arcs),
    "machines": ("own-machine.md", machines),
    "transients": ("protection.md", transients),
    "commissioning": ("commissioning.md", commissioning),
}


#: Long tables: which rows the page shows, by the table's title and the row. All of them are in the
#: data beside the page.
ON_PAGE: dict[str, Callable[[str, list[str]], bool]] = {
    "robustness": lambda title, row: title.startswith("paper-b"),
    "lost-phase": lambda title, row: "goes on" not in title or row[1] == "open",
}


def markdown(tables: Grid, page: Path, name: str) -> str:
    shown = ON_PAGE.get(name, lambda title, row: True)
    lines: list[str] = []
    for title, heads, rows in tables:
        on_page = [row for row in rows if shown(title, row)]
        if on_page:
            lines += [f"\n{title}:\n" if title else ""]
            lines += doc_page.table(heads, on_page)
    if name in ON_PAGE:
        lines += ["", f"Every row: {keep(tables, page, name)}."]
    return "\n".join(lines) + "\n"


def keep(tables: Grid, page: Path, name: str) -> str:
    """The study's long tables, which have the same columns, as one file. Returns the link to it."""
    shown = ON_PAGE[name]
    long = [table for table in tables if not all(shown(table[0], row) for row in table[2])]
    (heads,) = {tuple(heads) for _, heads, _ in long}
    same = [(title, rows) for title, own, rows in tables if tuple(own) == heads]
    every = [[title, *row] for title, rows in same for row in rows]
    return doc_page.keep_data(page, name, ["table", *heads], every)


def main() -> None:
    folder = Path(sys.argv[1])
    docs = Path(sys.argv[2] if len(sys.argv) > 2 else "docs")
    there = [name for name in STUDIES if (folder / f"{name}.json").exists()]
    if not there:
        raise SystemExit(f"{folder}: none of {', '.join(f'{name}.json' for name in STUDIES)}")
    for name in there:
        file, study = STUDIES[name]
        page = docs / file
        result = doc_page.read_whole(folder / f"{name}.json")
        part = markdown(study.grid(result), page, name)
        doc_page.renew_page(page, {name: part}, [name], folder)


if __name__ == "__main__":
    main()
