"""docs/results.md: every figure is in it, and the tool that renews it does so."""

import csv
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


def rows_of(name):
    with (ROOT / "docs/data" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def test_the_documentation_holds_every_figure_and_a_reason_for_every_disagreement():
    text = (ROOT / "docs/results.md").read_text()
    rows = rows_of("verdicts") + rows_of("verdicts-equal-f-sw")
    titles = {row["figure"]: row["title"] for row in rows}
    # REFERENCES is docs/comparison.md.
    assert titles == {name: ENTRIES[name].title for name in ENTRIES if name != "REFERENCES"}
    assert len(rows) > 200
    assert {row["verdict"] for row in rows} <= set(VERDICTS)
    apart = [row for row in rows if row["verdict"] in ("worse", "differs")]
    assert all(len(row["why"]) > 12 and "not explained" not in row["why"] for row in apart)
    assert "](data/verdicts.csv)" in text and "](data/verdicts-equal-f-sw.csv)" in text


VERDICT = {"what": "a|b", "ours": 1.0, "paper": 2.0, "unit": "A", "verdict": "worse", "why": "x"}


def test_renewing_replaces_only_the_generated_part(tmp_path):
    text = f"before\n{pages.BEGIN.format('verdicts')}old\n{pages.END.format('verdicts')}after\n"
    verdicts = [VERDICT | {"why": "x 1"}, VERDICT | {"verdict": "match"}]
    figures = {"A1": {"title": "T", "verdicts": verdicts}}
    new = pages.renew(text, "verdicts", tool.table(figures, tmp_path / "page.md", "every"))
    assert new.startswith("before\n") and new.endswith("after\n") and "old" not in new
    assert "1 worse" in new and "](data/every.csv)" in new
    assert pages.renew(new, "verdicts", "old\n") == text
    kept = (tmp_path / "data/every.csv").read_text().splitlines()
    assert kept[1:] == [
        "A1,T,a|b,1.000 A,2.000 A,worse,x 1", "A1,T,a|b,1.000 A,2.000 A,match,x"
    ]  # fmt: skip


def test_missing_settings_are_empty_and_ratios_are_those_of_the_figure(tmp_path):
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
    text = tool.at_equal_f_sw({"points": points}, tmp_path / "page.md")
    assert "](data/equal-f-sw-schemes.csv)" in text
    schemes = (tmp_path / "data/equal-f-sw-schemes.csv").read_text().splitlines()
    assert schemes[1] == f"{tool.OWN_POINTS[0]},fdr,–,0.5,–,0.5"
    assert schemes[2] == f'{tool.OWN_POINTS[0]},"carrier, computed",–,–,–,–'
    kept = (tmp_path / "data/equal-f-sw.csv").read_text().splitlines()
    assert kept[1].endswith(",0.5,fdr,0.5,1.20,,,,,")
    assert kept[3].endswith(",0.5,fdr,0.5,0.40,,,,,")
    assert kept[5].endswith(",0.5,fdr,,,,,0.55,1.10,")
    assert kept[7].endswith(",0.5,fdr,,,,,,,")


def test_an_interrupted_or_quick_run_is_refused(tmp_path):
    assert pages.read_figures(tmp_path, ["FSW"]) is None
    (tmp_path / "FSW.json").write_text('{"quick": true}')
    with pytest.raises(SystemExit, match="a quick run"):
        pages.read_figures(tmp_path, ["FSW"])
