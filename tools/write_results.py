"""Renew the generated parts of docs/results.md from what `hexatorque evidence papers all` wrote.

Usage: write_results.py OUT_DIR [docs/results.md]
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from hexatorque.evidence.papers import ENTRIES
from hexatorque.evidence.papers.engine.page import counts, with_unit

BEGIN, END = "<!-- generated: {} -->\n", "<!-- end of {} -->\n"
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


def equal_f_sw(metrics: dict) -> str:
    """Lowest ripple and lowest THD of every scheme within each switching frequency."""
    lines = []
    for name, schemes in metrics.items():
        judged = next(iter(schemes.values()))
        budgets = list(next(iter(judged.values())))
        kHz = [f"≤ {float(budget) / 1e3:g} kHz" for budget in budgets]
        heads = [f"{what}, {f}" for what in ("ripple [N m]", "THD [%]") for f in kHz]
        lines += [f"\n{name}:\n", f"| | {' | '.join(heads)} |", "|---" * (1 + len(heads)) + "|"]
        for scheme, best in schemes.items():
            cells = [
                "–" if (row := best[key][budget]) is None else f"{row[key]:.3g}"
                for key in best
                for budget in budgets
            ]
            lines.append(f"| {scheme} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def renew(text: str, part: str, content: str) -> str:
    begin, end = BEGIN.format(part), END.format(part)
    head, rest = text.split(begin)
    return head + begin + content + end + rest.split(end)[1]


def main() -> None:
    folder = Path(sys.argv[1])
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs/results.md")
    figures = {name: json.loads((folder / f"{name}.json").read_text()) for name in ENTRIES}
    if any(data["quick"] for data in figures.values()):
        raise SystemExit(f"{folder}: a quick run; the documentation shows full ones")
    text = renew(page.read_text(), "verdicts", table(figures))
    page.write_text(renew(text, "equal f_sw", equal_f_sw(figures["FSW"]["metrics"])))
    for name in PICTURES:
        shutil.copy(folder / f"{name}.png", page.parent / "images" / f"{name}.png")


if __name__ == "__main__":
    main()
