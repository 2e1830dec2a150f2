"""Renew the generated parts of the documentation from what `hexatorque evidence studies` wrote: of
those studies whose results are in the folder.

Usage: write_studies.py OUT_DIR [docs]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import doc_page

from hexatorque.evidence.methods import dynamics, knob, robustness
from hexatorque.evidence.studies import (
    arcs,
    commissioning,
    faults,
    lost_phase,
    machines,
    shortest_pulse,
    transients,
    wrong_lxy,
)
from hexatorque.evidence.studies.grids import Grid

#: Name -> the page, and the study.
STUDIES = {
    "dynamics": ("robustness.md", dynamics),
    "robustness": ("robustness.md", robustness),
    "knob": ("interleaved.md", knob),
    "faults": ("protection.md", faults),
    "lost-phase": ("lost-phase.md", lost_phase),
    "arcs": ("lost-phase.md", arcs),
    "wrong-lxy": ("lost-phase.md", wrong_lxy),
    "shortest-pulse": ("protection.md", shortest_pulse),
    "machines": ("own-machine.md", machines),
    "transients": ("protection.md", transients),
    "commissioning": ("commissioning.md", commissioning),
}


#: A table of at most so many rows stands on the page. A longer one is data beside it.
ON_PAGE_ROWS = 4


def markdown(tables: Grid, page: Path, name: str) -> str:
    """The short tables of a study, then links to the long ones."""
    lines: list[str] = []
    for title, heads, rows in tables:
        if len(rows) <= ON_PAGE_ROWS:
            lines += [f"\n{title}:\n" if title else "", *doc_page.table(heads, rows)]
    links = keep([one for one in tables if len(one[2]) > ON_PAGE_ROWS], page, name)
    return "\n".join([*lines, "", *links]) + "\n"


def keep(tables: Grid, page: Path, name: str) -> list[str]:
    """Tables with the same columns become one file. Returns a link to each file, as a list."""
    alike: dict[tuple[str, ...], Grid] = {}
    for table in tables:
        alike.setdefault(tuple(table[1]), []).append(table)
    links = []
    for heads, group in alike.items():
        title, _, rows = group[0]
        file = name if len(alike) == 1 else f"{name}-{slug(title)}"
        if len(group) > 1:
            title, columns = "", ["table", *heads]
            rows = [[own, *row] for own, _, of in group for row in of]
        else:
            columns = list(heads)
        links.append(f"- {doc_page.keep_data(page, file, columns, rows, title)}")
    return links


def slug(title: str) -> str:
    """A file's name from a title's first words."""
    words = re.split(r"[:,]", title)[0].lower()
    return re.sub(r"[^a-z0-9]+", "-", words).strip("-")


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
