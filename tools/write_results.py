"""Renew the generated parts of docs/results.md from what `hexatorque evidence papers` wrote: the
verdicts if all figures of the papers are there, the comparison at equal switching frequency if FSW
is there.

Usage: write_results.py OUT_DIR [docs/results.md]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import doc_page

from hexatorque.evidence.papers import ENTRIES
from hexatorque.evidence.papers.engine.figure import VERDICTS
from hexatorque.evidence.papers.engine.page import counts, with_unit

#: Those that are in neither paper.
OWN = ("FSW", "REFERENCES")
#: Shown in the documentation.
PICTURES = ("A10", "B16", "FSW", "FSW-ratios", "FSW-A", "FSW-B")
#: The set-ups' own points, at which every scheme is shown.
OWN_POINTS = ("A 100 r/min 10 N m", "B 2500 r/min 2 N m")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


#: Verdicts whose reasons the page itself shows. All others are in the data beside it.
SHOWN = ("worse", "differs")
HEADS = ["what", "ours", "paper", "verdict", "why"]


def table(figures: dict[str, dict], page: Path, data: str) -> str:
    """How each figure compares, and each disagreement. Every row goes to `data`."""
    found, every = [], []
    for name, figure in figures.items():
        rows = [
            [
                *map(_cell, (v["what"], with_unit(v["ours"], v["unit"]))),
                _cell(with_unit(v["paper"], v["unit"])),
                v["verdict"],
                _cell(v["why"]),
            ]
            for v in figure["verdicts"]
        ]
        title = _cell(figure["title"])
        many = [sum(row[3] == word for row in rows) for word in VERDICTS]
        found.append([f"**{name}**", title, *(str(count or "") for count in many)])
        every += [[name, title, *row] for row in rows]
    where = doc_page.keep_data(page, data, ["figure", "title", *HEADS], every)
    many_words = ", ".join(f"{count} {word}" for word, count in counts(figures).items())
    lines = [f"{many_words.capitalize()}. Every row: {where}.", ""]
    if len(figures) > 1:
        lines += [f"The {len(figures)} figures and tables:", ""]
        lines += [*doc_page.table(["", "title", *VERDICTS], found), ""]
    return "\n".join([*lines, *disagreements(every)]) + "\n"


def disagreements(rows: list[list[str]]) -> list[str]:
    """Where ours differs, from the rows of the data: each reason of a figure once, with the first
    row that it explains. Reasons that differ in their numbers alone count as one."""
    groups: dict[tuple[str, str], list[list[str]]] = {}
    for name, _, *row in rows:
        if row[3] in SHOWN:
            groups.setdefault((name, re.sub(r"[\d.,±]+", "", row[4])), []).append(row)
    shown = [
        [f"**{name}**", what, ours, paper, str(len(group) - 1 or ""), why]
        for (name, _), group in groups.items()
        for what, ours, paper, _, why in group[:1]
    ]
    heads = ["", "what", "ours", "paper", "more alike", "why"]
    return ["Where ours differs:", "", *doc_page.table(heads, shown)]


#: Figure of merit -> its words.
JUDGED = {
    "td_Nm": "Td [N m]",
    "thd_inf_pct": "THD∞ [%]",
    "ixy_rms_A": "x–y [A]",
    "loss_W": "loss [W]",
}
LIMIT_HZ = "3000"


def _ours(row: dict | None, key: str, ratio: str) -> list[str]:
    return [f"{row[key]:.3g}", f"{row[ratio]:.2f}"] if row else ["", ""]


def _at_points(points: list[dict]) -> tuple[list[str], list[list[str]]]:
    """Ours beside the best table setting, for every point and figure of merit."""
    variants = list(points[0]["ours"])
    heads = ["figure", "point", "V_dc", "best table setting", "its scheme"]
    heads += [text for v in variants for text in (f"db-dtfc {v}", f"ratio {v}")]
    heads += ["best of db-dtfc", "its ratio", "carrier, computed"]
    rows = []
    for figure, ratio in (("td_Nm", "td_ratio"), ("thd_inf_pct", "thd_ratio"),
                          ("ixy_rms_A", None), ("loss_W", None)):  # fmt: skip
        for at in points:
            table, line = at["best_table"][figure], at["line"][LIMIT_HZ]
            row = [JUDGED[figure], at["point"], f"{line['m_pu']:.2f}" if line else "> 0.57"]
            row += [f"{table[figure]:.3g}", table["scheme"]] if table else ["", ""]
            best = at["ratio"][figure] if table and not ratio else None
            for variant in variants:
                row += _ours(at["ours"][variant], figure, ratio) if ratio else ["", ""]
            row += [f"{best * table[figure]:.3g}", f"{best:.2f}"] if best else ["", ""]
            rows.append([*row, f"{line[figure]:.3g}" if line and ratio else ""])
    return heads, rows


def at_equal_f_sw(metrics: dict, page: Path) -> str:
    """Every point as data, and every scheme at the set-ups' own points."""
    points = metrics["points"]
    where = doc_page.keep_data(page, "equal-f-sw", *_at_points(points))
    lines = [f"All {len(points)} points within 3 kHz: {where}.", ""]
    for name in OWN_POINTS:
        lines += _every_scheme(next(at for at in points if at["point"] == name))
    return "\n".join(lines) + "\n"


def _every_scheme(at: dict) -> list[str]:
    budgets = list(next(iter(at["best"].values()))["td_Nm"])
    kHz = [f"≤ {float(budget) / 1e3:g} kHz" for budget in budgets]
    shown = ("td_Nm", "thd_inf_pct")
    heads = ["", *(f"{JUDGED[figure]}, {f}" for figure in shown for f in kHz)]
    rows = []
    for scheme, best in at["best"].items():
        found = [(figure, best[figure][budget]) for figure in shown for budget in budgets]
        rows.append([scheme, *("–" if row is None else f"{row[f]:.3g}" for f, row in found)])
    computed = [at["line"][budget] for _ in shown for budget in budgets]
    figures = [figure for figure in shown for _ in budgets]
    cells = [f"{line[f]:.3g}" if line else "–" for f, line in zip(figures, computed)]
    rows.append(["carrier, computed", *cells])
    return ["", f"{at['point']}, every scheme:", "", *doc_page.table(heads, rows)]


def main() -> None:
    folder = Path(sys.argv[1])
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs/results.md")
    papers = doc_page.read_figures(folder, [name for name in ENTRIES if name not in OWN])
    own = doc_page.read_figures(folder, ["FSW"])
    if not (papers or own):
        raise SystemExit(f"{folder}: neither all figures of the papers nor FSW is there")
    parts = {"verdicts": table(papers, page, "verdicts")} if papers else {}
    if own:
        parts["equal f_sw"] = at_equal_f_sw(own["FSW"]["metrics"], page)
        parts["verdicts FSW"] = table(own, page, "verdicts-equal-f-sw")
    doc_page.renew_page(page, parts, PICTURES, folder)


if __name__ == "__main__":
    main()
