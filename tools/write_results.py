"""Renew the generated parts of docs/results.md from what `hexatorque evidence papers` wrote: the
verdicts if all figures of the papers are there, the comparison at equal switching frequency if FSW
is there.

Usage: write_results.py OUT_DIR [docs/results.md]
"""

from __future__ import annotations

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


HEADS = ["what", "ours", "paper", "verdict", "why"]


def table(figures: dict[str, dict], page: Path, data: str) -> str:
    """How many agree. Every row goes to `data`, and the counts of each figure beside it."""
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
        found.append([name, title, *(str(count or "") for count in many)])
        every += [[name, title, *row] for row in rows]
    where = doc_page.keep_data(page, data, ["figure", "title", *HEADS], every)
    many_words = ", ".join(f"{count} {word}" for word, count in counts(figures).items())
    text = f"{many_words.capitalize()}. Every row, with the reason of each deviation: {where}."
    if len(figures) > 1:
        by_figure = doc_page.keep_data(page, "figures", ["figure", "title", *VERDICTS], found)
        text += f" The {len(figures)} figures and tables, counted: {by_figure}."
    return text + "\n"


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
    """Every point, and every scheme at the set-ups' own points."""
    points = metrics["points"]
    where = doc_page.keep_data(page, "equal-f-sw", *_at_points(points))
    own = [at for at in points if at["point"] in OWN_POINTS]
    schemes = doc_page.keep_data(page, "equal-f-sw-schemes", *_every_scheme(own))
    return (
        f"All {len(points)} points within 3 kHz: {where}. Every scheme at "
        f"{' and '.join(OWN_POINTS)}: {schemes}.\n"
    )


def _every_scheme(points: list[dict]) -> tuple[list[str], list[list[str]]]:
    budgets = list(next(iter(points[0]["best"].values()))["td_Nm"])
    kHz = [f"≤ {float(budget) / 1e3:g} kHz" for budget in budgets]
    shown = ("td_Nm", "thd_inf_pct")
    heads = ["point", "scheme", *(f"{JUDGED[figure]}, {f}" for figure in shown for f in kHz)]
    cells = [(figure, budget) for figure in shown for budget in budgets]
    rows = []
    for at in points:
        of = {
            **{name: [best[f][b] for f, b in cells] for name, best in at["best"].items()},
            "carrier, computed": [at["line"][b] for _, b in cells],
        }
        for name, found in of.items():
            values = zip(found, (f for f, _ in cells))
            rows.append(
                [at["point"], name, *(f"{row[f]:.3g}" if row else "–" for row, f in values)]
            )
    return heads, rows


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
