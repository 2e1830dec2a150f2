"""Renew the generated part of docs/results.md from what `hexatorque reproduce all` wrote.

Usage: write_results.py OUT_DIR [docs/results.md]
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from hexatorque.papers import ENTRIES
from hexatorque.papers.page import counts, with_unit

BEGIN, END = "<!-- generated: verdicts -->\n", "<!-- end of verdicts -->\n"
#: Shown in the documentation.
PICTURES = ("A10", "B16", "FSW")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def table(figures: dict[str, dict]) -> str:
    many = ", ".join(f"{count} {word}" for word, count in counts(figures).items())
    lines = [f"{len(figures)} figures and tables: {many}.\n"]
    for name, data in figures.items():
        lines += [f"\n**{name}** · {_cell(data['title'])}\n", ""]
        lines += ["| what | ours | paper | verdict | why |", "|---|---|---|---|---|"]
        for v in data["verdicts"]:
            word = v["verdict"]
            shown = f"**{word}**" if word in ("worse", "differs") else word
            cells = (v["what"], with_unit(v["ours"], v["unit"]), with_unit(v["paper"], v["unit"]))
            lines.append(f"| {' | '.join(map(_cell, cells))} | {shown} | {_cell(v['why'])} |")
    return "\n".join(lines) + "\n"


def renew(text: str, figures: dict[str, dict]) -> str:
    head, rest = text.split(BEGIN)
    return head + BEGIN + table(figures) + END + rest.split(END)[1]


def main() -> None:
    folder = Path(sys.argv[1])
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs/results.md")
    figures = {name: json.loads((folder / f"{name}.json").read_text()) for name in ENTRIES}
    if any(data["quick"] for data in figures.values()):
        raise SystemExit(f"{folder}: a quick run; the documentation shows full ones")
    page.write_text(renew(page.read_text(), figures))
    for name in PICTURES:
        shutil.copy(folder / f"{name}.png", page.parent / "images" / f"{name}.png")


if __name__ == "__main__":
    main()
