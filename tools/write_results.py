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
from hexatorque.evidence.papers.engine.page import counts, with_unit

#: Those that are in neither paper.
OWN = ("FSW", "REFERENCES")
#: Shown in the documentation.
PICTURES = ("A10", "B16", "FSW", "FSW-ratios", "FSW-A", "FSW-B")
#: The set-ups' own points, at which every scheme is shown.
OWN_POINTS = ("A 100 r/min 10 N m", "B 2500 r/min 2 N m")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def table(figures: dict[str, dict]) -> str:
    many = ", ".join(f"{count} {word}" for word, count in counts(figures).items())
    lines = [f"{len(figures)} figures and tables: {many}.\n"] if len(figures) > 1 else []
    for name, data in figures.items():
        lines += [f"\n**{name}** · {_cell(data['title'])}\n", ""]
        rows = []
        for v in data["verdicts"]:
            word = v["verdict"]
            shown = f"**{word}**" if word in ("worse", "differs") else word
            cells = (v["what"], with_unit(v["ours"], v["unit"]), with_unit(v["paper"], v["unit"]))
            rows.append([*map(_cell, cells), shown, _cell(v["why"])])
        lines += doc_page.table(["what", "ours", "paper", "verdict", "why"], rows)
    return "\n".join(lines) + "\n"


#: Figure of merit -> its words.
JUDGED = {
    "td_Nm": "Td [N m]",
    "thd_inf_pct": "THD∞ [%]",
    "ixy_rms_A": "x–y [A]",
    "loss_W": "loss [W]",
}
LIMIT_HZ = "3000"


def _ours(row: dict | None, key: str, ratio: str) -> str:
    if row is None:
        return "–"
    text = f"{row[key]:.3g} ({row[ratio]:.2f})"
    return f"**{text}**" if row[ratio] > 1 else text


def at_equal_f_sw(metrics: dict) -> str:
    """Ours beside the best table setting at each point; then every scheme at the set-ups' own
    points."""
    points = metrics["points"]
    variants = list(points[0]["ours"])
    lines = []
    for figure, ratio in (("td_Nm", "td_ratio"), ("thd_inf_pct", "thd_ratio")):
        heads = ["point", "V_dc", "best table setting", *variants, "carrier, computed"]
        lines += ["", f"{JUDGED[figure]} within 3 kHz:", ""]
        rows = []
        for at in points:
            table, line = at["best_table"][figure], at["line"][LIMIT_HZ]
            cells = [
                at["point"],
                f"{line['m_pu']:.2f}" if line else "> 0.57",
                f"{table[figure]:.3g} {table['scheme']}" if table else "–",
                *(_ours(at["ours"][variant], figure, ratio) for variant in variants),
                f"{line[figure]:.3g}" if line else "–",
            ]
            rows.append(cells)
        lines += doc_page.table(heads, rows)
    heads = ["point", *(f"{JUDGED[f]}: table, ours" for f in ("ixy_rms_A", "loss_W"))]
    lines += ["", "x–y current and losses within 3 kHz, the best setting of each side:", ""]
    rows = []
    for at in points:
        cells = [at["point"]]
        for figure in ("ixy_rms_A", "loss_W"):
            table, ratio = at["best_table"][figure], at["ratio"][figure]
            if table is None or ratio is None:
                cells.append("–")
                continue
            ours = f"{ratio * table[figure]:.3g} ({ratio:.2f})"
            ours = f"**{ours}**" if ratio > 1 else ours
            cells.append(f"{table[figure]:.3g} {table['scheme']}, {ours}")
        rows.append(cells)
    lines += doc_page.table(heads, rows)
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
    parts = {"verdicts": table(papers)} if papers else {}
    if own:
        parts["equal f_sw"] = at_equal_f_sw(own["FSW"]["metrics"])
        parts["verdicts FSW"] = table(own)
    doc_page.renew_page(page, parts, PICTURES, folder)


if __name__ == "__main__":
    main()
