"""Renew the generated parts of docs/robustness.md from what `hexatorque evidence studies dynamics
robustness` wrote.

Usage: write_studies.py OUT_DIR [docs/robustness.md]
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from write_results import renew

from hexatorque.evidence.studies import dynamics, robustness

STUDIES = {"dynamics": dynamics, "robustness": robustness}


def markdown(tables: list[tuple[str, list[str], list[list[str]]]]) -> str:
    lines = []
    for name, heads, rows in tables:
        lines += [f"\n{name}:\n" if name else ""]
        lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines) + "\n"


def main() -> None:
    folder = Path(sys.argv[1])
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs/robustness.md")
    text = page.read_text()
    for name, study in STUDIES.items():
        result = json.loads((folder / f"{name}.json").read_text())
        if result["quick"]:
            raise SystemExit(
                f"{folder}/{name}.json: a quick run; the documentation shows full ones"
            )
        text = renew(text, name, markdown(study.grid(result)))
        shutil.copy(folder / f"{name}.png", page.parent / "images" / f"{name}.png")
    page.write_text(text)


if __name__ == "__main__":
    main()
