"""docs/results.md: every figure is in it, and the tool that renews it does so."""

import importlib.util
import sys
from pathlib import Path

import pytest

from hexatorque.evidence.papers import ENTRIES
from hexatorque.evidence.papers.engine.figure import VERDICTS

ROOT = Path(__file__).parents[4]
spec = importlib.util.spec_from_file_location("write_results", ROOT / "tools/write_results.py")
tool = importlib.util.module_from_spec(spec)
sys.path.insert(0, str(ROOT / "tools"))
spec.loader.exec_module(tool)
sys.path.remove(str(ROOT / "tools"))
pages = tool.doc_page


def test_the_documentation_holds_every_figure_and_a_reason_for_every_disagreement():
    text = (ROOT / "docs/results.md").read_text()
    papers, own = (
        text.split(pages.BEGIN.format(part))[1].split(pages.END.format(part))[0]
        for part in ("verdicts", "verdicts FSW")
    )
    for name, entry in ENTRIES.items():
        if name == "REFERENCES":
            continue  # docs/comparison.md
        assert f"**{name}** · {entry.title}" in (own if name == "FSW" else papers)
    part = papers + own
    rows = [line.split(" | ") for line in part.splitlines() if line.startswith("| ")]
    rows = [row for row in rows if row[0] != "| what"]
    assert len(rows) > 200
    for row in rows:
        assert row[3].strip("*") in VERDICTS
        if row[3] in ("**worse**", "**differs**"):
            assert len(row[4]) > 12 and "not explained" not in row[4], row


def test_renewing_replaces_only_the_generated_part():
    verdict = {
        "what": "a|b", "ours": 1.0, "paper": 2.0, "unit": "A", "verdict": "worse", "why": "x",
    }  # fmt: skip
    text = f"before\n{pages.BEGIN.format('verdicts')}old\n{pages.END.format('verdicts')}after\n"
    new = pages.renew(text, "verdicts", tool.table({"A1": {"title": "T", "verdicts": [verdict]}}))
    assert new.startswith("before\n") and new.endswith("after\n") and "old" not in new
    assert "| a\\|b | 1.000 A | 2.000 A | **worse** | x |" in new
    assert pages.renew(new, "verdicts", "old\n") == text


def test_a_ratio_above_one_is_bold_and_what_is_missing_is_a_dash():
    figures = ("td_Nm", "thd_inf_pct", "ixy_rms_A", "loss_W")
    row = {figure: 0.5 for figure in figures}
    at = {
        "point": tool.OWN_POINTS[0],
        "line": {"2000": None, "3000": None},
        "best": {"fdr": {f: {"2000": None, "3000": row} for f in figures}},
        "best_table": {f: {"scheme": "fdr", **row} for f in figures},
        "ours": {"κ=0": {**row, "td_ratio": 1.2, "thd_ratio": 0.4}, "κ=1": None},
        "ratio": {"ixy_rms_A": 1.1, "loss_W": None},
    }
    points = [at, {**at, "point": tool.OWN_POINTS[1]}]
    text = tool.at_equal_f_sw({"points": points})
    assert "| 0.5 fdr | **0.5 (1.20)** | – | – |" in text
    assert "| 0.5 fdr | 0.5 (0.40) | – | – |" in text
    assert "| 0.5 fdr, **0.55 (1.10)** | – |" in text
    assert "| fdr | – | 0.5 | – | 0.5 |" in text


def test_an_interrupted_or_quick_run_is_refused(tmp_path):
    assert pages.read_figures(tmp_path, ["FSW"]) is None
    (tmp_path / "FSW.json").write_text('{"quick": true}')
    with pytest.raises(SystemExit, match="a quick run"):
        pages.read_figures(tmp_path, ["FSW"])
