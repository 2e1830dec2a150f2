"""Renew the generated parts of the documentation from what `hexatorque evidence studies` wrote: of
those studies whose results are in the folder.

Usage: write_studies.py OUT_DIR [docs]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from write_results import keep, renew

from hexatorque.evidence.studies import commissioning, dynamics, robustness

#: Name -> the page, and the study.
STUDIES = {
    "dynamics": ("robustness.md", dynamics),
    "robustness": ("robustness.md", robustness),
    "commissioning": ("commissioning.md", commissioning),
}


def markdown(tables: list[tuple[str, list[str], list[list[str]]]]) -> str:
    lines = []
    for name, heads, rows in tables:
        lines += [f"\n{name}:\n" if name else ""]
        lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines) + "\n"


def main() -> None:
    folder = Path(sys.argv[1])
    docs = Path(sys.argv[2] if len(sys.argv) > 2 else "docs")
    there = [name for name in STUDIES if (folder / f"{name}.json").exists()]
    if not there:
        raise SystemExit(f"{folder}: none of {', '.join(f'{name}.json' for name in STUDIES)}")
    for name in there:
        file, study = STUDIES[name]
        page = docs / file
        result = json.loads((folder / f"{name}.json").read_text())
        if result["quick"]:
            raise SystemExit(
                f"{folder}/{name}.json: a quick run; the documentation shows full ones"
            )
        page.write_text(renew(page.read_text(), name, markdown(study.grid(result))))
        keep(folder / f"{name}.png", docs / "images")


if __name__ == "__main__":
    main()
