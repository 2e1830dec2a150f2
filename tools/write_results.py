"""Renew the generated parts of docs/results.md from what `hexatorque evidence papers` wrote: the
verdicts if all figures of the papers are there, the comparison at equal switching frequency if FSW
is there.

Usage: write_results.py OUT_DIR [docs/results.md]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

from hexatorque.evidence.papers import ENTRIES
from hexatorque.evidence.papers.engine.page import counts, with_unit

BEGIN, END = "<!-- generated: {} -->\n", "<!-- end of {} -->\n"
#: Shown in the documentation.
PICTURES = ("A10", "B16", "FSW", "FSW-ratios", "FSW-A", "FSW-B")
#: The set-ups' own points, at which every scheme is shown.
OWN_POINTS = ("A 100 r/min 10 N m", "B 2500 r/min 2 N m")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def keep(picture: Path, folder: Path) -> None:
    """Copies a picture with 64 colours, which lines and text do not need more of: a repository
    keeps every version of it."""
    colours = Image.open(picture).convert("RGB").quantize(64, dither=Image.Dither.NONE)
    colours.save(folder / picture.name, optimize=True)


def table(figures: dict[str, dict]) -> str:
    many = ", ".join(f"{count} {word}" for word, count in counts(figures).items())
    lines = [f"{len(figures)} figures and tables: {many}.\n"] if len(figures) > 1 else []
    for name, data in figures.items():
        lines += [f"\n**{name}** · {_cell(data['title'])}\n", ""]
        lines += ["| what | ours | paper | verdict | why |", "|---|---|---|---|---|"]
        for v in data["verdicts"]:
            word = v["verdict"]
            shown = f"**{word}**" if word in ("worse", "differs") else word
            cells = (v["what"], with_unit(v["ours"], v["unit"]), with_unit(v["paper"], v["unit"]))
            lines.append(f"| {' | '.join(map(_cell, cells))} | {shown} | {_cell(v['why'])} |")
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
        lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        for at in points:
            table, line = at["best_table"][figure], at["line"][LIMIT_HZ]
            cells = [
                at["point"],
                f"{line['m_pu']:.2f}" if line else "> 0.57",
                f"{table[figure]:.3g} {table['scheme']}" if table else "–",
                *(_ours(at["ours"][variant], figure, ratio) for variant in variants),
                f"{line[figure]:.3g}" if line else "–",
            ]
            lines.append(f"| {' | '.join(cells)} |")
    heads = ["point", *(f"{JUDGED[f]}: table, ours" for f in ("ixy_rms_A", "loss_W"))]
    lines += ["", "x–y current and losses within 3 kHz, the best setting of each side:", ""]
    lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
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
        lines.append(f"| {' | '.join(cells)} |")
    for name in OWN_POINTS:
        lines += _every_scheme(next(at for at in points if at["point"] == name))
    return "\n".join(lines) + "\n"


def _every_scheme(at: dict) -> list[str]:
    budgets = list(next(iter(at["best"].values()))["td_Nm"])
    kHz = [f"≤ {float(budget) / 1e3:g} kHz" for budget in budgets]
    shown = ("td_Nm", "thd_inf_pct")
    heads = ["", *(f"{JUDGED[figure]}, {f}" for figure in shown for f in kHz)]
    lines = ["", f"{at['point']}, every scheme:", ""]
    lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for scheme, best in at["best"].items():
        rows = [(figure, best[figure][budget]) for figure in shown for budget in budgets]
        cells = ["–" if row is None else f"{row[figure]:.3g}" for figure, row in rows]
        lines.append(f"| {scheme} | {' | '.join(cells)} |")
    lines.append(
        "| carrier, computed | "
        + " | ".join(
            f"{at['line'][budget][figure]:.3g}" if at["line"][budget] else "–"
            for figure in shown
            for budget in budgets
        )
        + " |"
    )
    return lines


def renew(text: str, part: str, content: str) -> str:
    begin, end = BEGIN.format(part), END.format(part)
    head, rest = text.split(begin)
    return head + begin + content + end + rest.split(end)[1]


def _read(folder: Path, names: list[str]) -> dict[str, dict] | None:
    """The figures, or None if not all of them are there."""
    paths = [folder / f"{name}.json" for name in names]
    if not all(path.exists() for path in paths):
        return None
    figures = {name: json.loads(path.read_text()) for name, path in zip(names, paths)}
    if any(data["quick"] for data in figures.values()):
        raise SystemExit(f"{folder}: a quick run; the documentation shows full ones")
    return figures


def main() -> None:
    folder = Path(sys.argv[1])
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs/results.md")
    papers = _read(folder, [name for name in ENTRIES if name != "FSW"])
    own = _read(folder, ["FSW"])
    if not (papers or own):
        raise SystemExit(f"{folder}: neither all figures of the papers nor FSW is there")
    text = page.read_text()
    if papers:
        text = renew(text, "verdicts", table(papers))
    if own:
        text = renew(text, "equal f_sw", at_equal_f_sw(own["FSW"]["metrics"]))
        text = renew(text, "verdicts FSW", table(own))
    page.write_text(text)
    for name in PICTURES:
        picture = folder / f"{name}.png"
        if picture.exists():
            keep(picture, page.parent / "images")


if __name__ == "__main__":
    main()
