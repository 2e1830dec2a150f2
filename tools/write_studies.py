"""Renew the generated parts of the documentation from what `hexatorque evidence studies` wrote: of
those studies whose results are in the folder.

Usage: write_studies.py OUT_DIR [docs]
"""

from __future__ import annotations

import sys
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
    "commissioning": ("commissioning.md", commissioning),
}


def markdown(tables: Grid) -> str:
    lines = []
    for name, heads, rows in tables:
        lines += [f"\n{name}:\n" if name else ""]
        lines += doc_page.table(heads, rows)
    return "\n".join(lines) + "\n"


def main() -> None:
    folder = Path(sys.argv[1])
    docs = Path(sys.argv[2] if len(sys.argv) > 2 else "docs")
    there = [name for name in STUDIES if (folder / f"{name}.json").exists()]
    if not there:
        raise SystemExit(f"{folder}: none of {', '.join(f'{name}.json' for name in STUDIES)}")
    for name in there:
        file, study = STUDIES[name]
        result = doc_page.read_whole(folder / f"{name}.json")
        doc_page.renew_page(docs / file, {name: markdown(study.grid(result))}, [name], folder)


if __name__ == "__main__":
    main()
