"""docs/results.md: every figure is in it, and the tool that renews it does so."""

import importlib.util
from pathlib import Path

from hexatorque.evidence.papers import ENTRIES
from hexatorque.evidence.papers.engine.figure import VERDICTS

ROOT = Path(__file__).parents[4]
spec = importlib.util.spec_from_file_location("write_results", ROOT / "tools/write_results.py")
tool = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool)


def test_the_documentation_holds_every_figure_and_a_reason_for_every_disagreement():
    text = (ROOT / "docs/results.md").read_text()
    part = text.split(tool.BEGIN.format("verdicts"))[1].split(tool.END.format("verdicts"))[0]
    for name, entry in ENTRIES.items():
        assert f"**{name}** · {entry.title}" in part
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
    text = f"before\n{tool.BEGIN.format('verdicts')}old\n{tool.END.format('verdicts')}after\n"
    new = tool.renew(text, "verdicts", tool.table({"A1": {"title": "T", "verdicts": [verdict]}}))
    assert new.startswith("before\n") and new.endswith("after\n") and "old" not in new
    assert "| a\\|b | 1.000 A | 2.000 A | **worse** | x |" in new
    assert tool.renew(new, "verdicts", "old\n") == text
    best = {"torque_ripple_Nm": {"2000": {"torque_ripple_Nm": 0.123}, "3000": None}}
    table = tool.equal_f_sw({"paper-b": {"fdr": best}})
    assert "| fdr | 0.123 | – |" in table and "≤ 3 kHz" in table
