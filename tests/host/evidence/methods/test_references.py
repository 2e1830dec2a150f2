"""The comparison with the references: sentences that follow from numbers alone, and the page."""

import csv
import importlib.util
import json
import math
import re
import sys
from pathlib import Path

import pytest

from hexatorque.evidence.methods import judging, references, steps
from hexatorque.evidence.methods.methods import methods
from hexatorque.evidence.methods.pictures import style
from hexatorque.evidence.methods.places import PLACES
from hexatorque.evidence.papers.engine.job import Job

ROOT = Path(__file__).parents[4]
BY_NAME = {method.name: method for method in methods()}


VALUES = {
    "one": {"dtc1": 2.0, "db-dtfc free": 1.0, "foc": 1.05, "fcs-mpc": 4.0},
    "two": {"dtc1": 8.0, "db-dtfc free": 4.2, "foc": 4.0, "fcs-mpc": 4.0},
}
QUESTION = judging.QUESTIONS[0]


def test_scores_are_geometric_means_of_ratios_to_the_least_at_each_point():
    found = judging.scores(VALUES)
    assert found["dtc1"] == pytest.approx(math.sqrt(2.0 * 2.0))
    assert found["fcs-mpc"] == pytest.approx(math.sqrt(4.0 * 1.0))
    # A point's unit does not count.
    scaled = {"one": VALUES["one"], "two": {k: 1e3 * v for k, v in VALUES["two"].items()}}
    assert judging.scores(scaled) == pytest.approx(found)


def chosen(values):
    return judging.sentence(QUESTION, values, [BY_NAME[n] for n in VALUES["one"]])


def test_a_sentence_names_all_that_are_equally_good_and_measures_the_other_families():
    found = chosen(VALUES)
    assert found.take == ("db-dtfc free", "foc")
    table, single = (BY_NAME[name].family for name in ("dtc1", "fcs-mpc"))
    assert found.against == pytest.approx(
        {table: 0.5 * math.sqrt(1.05), single: 0.5 * math.sqrt(1.05)}, rel=0.03
    )
    assert "`db-dtfc free` or `foc`" in found.text and "0.51 times" in found.text


def test_our_scheme_is_not_favoured():
    """If two methods exchange their numbers, the sentence exchanges their names."""
    swap = {"db-dtfc free": "dtc1", "dtc1": "db-dtfc free"}
    exchanged = {
        point: {swap.get(name, name): value for name, value in row.items()}
        for point, row in VALUES.items()
    }
    found = chosen({p: {n: exchanged[p][n] for n in VALUES["one"]} for p in exchanged})
    assert set(found.take) == {"dtc1", "foc"}


def test_a_method_without_a_point_is_not_ranked():
    missing = {**VALUES, "two": {**VALUES["two"], "foc": None}}
    found = chosen(missing)
    assert found.take == ("db-dtfc free",) and found.missing == ("foc",)
    none = {point: dict.fromkeys(row) for point, row in VALUES.items()}
    assert chosen(none).take == () and "not measured" in chosen(none).text


def test_a_sentence_that_changes_is_named():
    class Fake:
        def __init__(self, take):
            self.take = take
            self.points = []

        def sentences(self):
            return [judging.Sentence(QUESTION, self.take, {}, ())]

    same, other = Fake(("foc",)), Fake(("dtc1",))
    assert references._verdicts(same, same, 2)[-1].verdict == "match"
    changed = references._verdicts(same, other, 2)[-1]
    assert changed.verdict == "differs" and "`dtc1`" in changed.why and "`foc`" in changed.why


def test_the_balanced_setting_keeps_the_limit():
    rows = [{"f_sw_Hz": f, "td_Nm": 1e3 / f, "thd_inf_pct": 2.0} for f in (1e3, 3.9e3, 4.1e3)]
    assert judging.balanced(rows)["f_sw_Hz"] == 3.9e3
    assert judging.balanced(rows[2:]) is None


@pytest.fixture
def figure(counted, tmp_path, monkeypatch):
    made = {"rise_up_ms": 0.5, "rise_down_ms": 0.4, "overshoot_pct": 3.0}
    monkeypatch.setattr(steps, "run", lambda *_: made)
    return references.references(Job(True, tmp_path, rivals=2))


def test_the_figure_has_five_sentences_and_says_whether_they_change(figure, tmp_path):
    metrics = json.loads(json.dumps(figure.metrics, allow_nan=False))
    assert len(metrics["equal"]["sentences"]) == len(metrics["rivals"]["sentences"]) == 5
    assert [v.verdict for v in figure.verdicts].count("not printed") == 5
    assert "2 times the budget" in figure.verdicts[-1].what
    rec = figure.recordings[""]
    assert set(rec["method"]) == set(range(len(methods())))
    figure.draw(tmp_path / "REFERENCES.png")
    assert (tmp_path / "REFERENCES.png").stat().st_size > 20_000
    for at in metrics["equal"]["points"]:  # of the stand-in
        assert at["least_at_1kHz"] == {"td_Nm": 0.01, "thd_inf_pct": 1.0}
    memory = references.memory_bytes()
    assert memory["dtc-svm"] > memory["vv-mpc"] == 0


@pytest.fixture(scope="module")
def tool():
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        spec = importlib.util.spec_from_file_location(
            "write_comparison", ROOT / "tools/write_comparison.py"
        )
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(ROOT / "tools"))
    return module


def test_no_two_methods_are_drawn_alike():
    colours = [style(method.name)["color"] for method in methods()]
    assert len(set(colours)) == len(colours)


def test_torque_ripple_by_sampling_frequency():
    """The modulated methods count at any sampling frequency, the method itself within the limit."""
    rows = {name: [] for name in BY_NAME}
    rows["foc"] = [{"f_sw_Hz": 3e3, "f_isr_Hz": 50e3, "td_Nm": 0.2}]
    rows["fcs-mpc"] = [
        {"f_sw_Hz": 3e3, "f_isr_Hz": 20e3, "td_Nm": 0.3},
        {"f_sw_Hz": 3e3, "f_isr_Hz": 40e3, "td_Nm": 0.1},
        {"f_sw_Hz": 5e3, "f_isr_Hz": 10e3, "td_Nm": 0.01},
    ]
    points = [judging.At(PLACES[0], rows)] * 2
    found = judging.by_sampling(points, methods())
    assert found["fcs-mpc"] == {
        "10000": None, "15000": None, "20000": pytest.approx(1.5), "30000": pytest.approx(1.5),
        "50000": pytest.approx(0.5),
    }  # fmt: skip
    assert set(found["ddr"].values()) == {None}


def test_the_page_shows_every_method_and_every_sentence(figure, tool, tmp_path, monkeypatch):
    monkeypatch.setattr(tool, "PAGE", tmp_path / "page.md")
    metrics = json.loads(json.dumps(figure.metrics))
    budget = json.loads((ROOT / "docs/budget.json").read_text())
    text = tool.sentences(metrics)
    assert (
        len(re.findall(r"^\d\. ", text, re.MULTILINE)) == 5 and "of the 5 sentences change" in text
    )

    def kept(name):
        with (tmp_path / "data" / f"{name}.csv").open() as file:
            return list(csv.reader(file))[1:]

    tool.sampling(metrics), tool.costs(budget)
    for part in ("sampling", "costs"):
        assert [row[0] for row in kept(part)] == list(BY_NAME)
    points = [at["point"] for at in (metrics.get("rivals") or metrics["equal"])["points"]]
    for name, of in (("fronts", points), ("steps", metrics["equal"]["steps"])):
        assert f"[{name}.csv](data/{name}.csv)" in getattr(tool, name)(metrics)
        rows = [tuple(row[:2]) for row in kept(name)]
        assert len(rows) == len(set(rows)) == len(of) * len(BY_NAME)
        assert {method for _, method in rows} == set(BY_NAME)
    # The stand-in for a measurement gives every method the same figures at the same sampling.
    assert "](data/published.csv)" in tool.published(metrics)
    assert "`fcs-mpc` over `vv-mpc`: Td " in kept("published")[0][2]
    assert f"{budget['mps2-an386']['ddr']['mean']:.0f}" in {row[1] for row in kept("costs")}
    row = {"td_Nm": 0.5, "thd_inf_pct": 4.0}
    metrics["equal"] = {
        "chosen": {"m": {name: row for name in BY_NAME}},
        "errors": {"m": {name: {"c": {"lost": "x"} if name == "foc" else row} for name in BY_NAME}},
    }
    del metrics["rivals"]
    refused = {"lost": "refused", "refused": "a reason"}
    metrics["equal"]["errors"]["m"]["foc-24"] = {"c": refused}
    tool.errors(metrics)
    rows = {row[1]: row[2:] for row in kept("errors")}
    assert rows["foc"] == ["0.5 · 4", "lost"] and rows["ddr"] == ["0.5 · 4", "0.5 · 4"]
    assert rows["foc-24"] == ["0.5 · 4", "refused"]


def test_the_limit_is_drawn_with_the_fronts_of_the_page(tool, tmp_path, monkeypatch):
    """Methods but table schemes that have both figures."""
    monkeypatch.setattr(tool, "PAGE", tmp_path / "page.md")
    heads = ["point", "method", "Td ≤ 4 kHz", "THD∞ [%]"]
    rows = [["P, 0.5 V_dc", "foc", "0.4", "9"], ["P, 0.5 V_dc", "fcs-mpc", "0.3", "12"],
            ["P, 0.5 V_dc", "dtc1", "0.1", "3"], ["P, 0.5 V_dc", "foc-24", "–", "1"]]  # fmt: skip
    tool.doc_page.keep_data(tool.PAGE, "fronts", heads, rows)
    ends = [{"weight": w, "m_pu": 0.5, "td_Nm": td, "thd_inf_pct": thd, "ixy_rms_A": 0.1}
            for w, td, thd in ((0.0, 0.5, 6.0), (32.0, 0.2, 8.0))]  # fmt: skip
    point = {"point": "P", "f_sw_Hz": 4e3, "limit": ends, "carrier": {}}
    whole = {"quick": False, "points": [point]}
    (tmp_path / "limit.json").write_text(json.dumps(whole))
    plot, drawn = tool.study.plot, []
    monkeypatch.setattr(tool.study, "plot", lambda *a: drawn.append(a[2]) or plot(*a))
    (text,) = tool.measured(tmp_path).values()
    assert "[limit.csv](data/limit.csv)" in text
    assert list(drawn[0]["P"]) == ["foc", "fcs-mpc"]
    assert (tmp_path / "limit.png").stat().st_size > 10_000
    with pytest.raises(SystemExit):
        tool.measured(tmp_path / "nothing")


def test_the_documentation_shows_the_sentences_and_every_method(tool):
    text = (ROOT / "docs/comparison.md").read_text()
    if "Not made yet" in text:
        pytest.skip("tools/write_comparison.py has not run yet")
    for part in ("sentences", "fronts", "sampling", "steps", "errors", "costs", "published"):
        own = text.split(f"<!-- generated: {part} -->")[1].split(f"<!-- end of {part} -->")[0]
        if part == "sentences":
            assert len(re.findall(r"^\d\. ", own, re.MULTILINE)) == len(judging.QUESTIONS)
        elif part != "published":
            assert f"](data/{part}.csv)" in own
            with (ROOT / "docs/data" / f"{part}.csv").open() as file:
                methods_told = {row.get("method") for row in csv.DictReader(file)}
            assert methods_told == set(BY_NAME), part


def test_the_page_of_db_ipwm_tells_what_it_reaches_of_its_targets(tool, monkeypatch):
    """Each ratio again, from the tables that the pages lead to."""
    monkeypatch.chdir(ROOT)
    own = (ROOT / "docs/interleaved.md").read_text().split("<!-- generated: interleaved -->\n")[1]
    assert own.split("<!-- end of interleaved -->")[0] == tool.interleaved()
    with (ROOT / "docs/data/fronts.csv").open() as file:
        rows = {(row["point"], row["method"]): row for row in csv.DictReader(file)}
    with (ROOT / "docs/data/limit.csv").open() as file:
        limit = {(row["point"], row["pattern"]): row for row in csv.DictReader(file)}
    ends = (("db-ipwm smooth", "Td ≤ 4 kHz", 0.85), ("db-ipwm clean", "THD∞ [%]", 1.0))
    for name, column, target in ends:
        over = []
        for point in {point for point, _ in rows}:
            others = [
                float(row[column])
                for (where, method), row in rows.items()
                if where == point and not method.startswith("db-ipwm") and row[column] != "–"
            ]
            over.append(float(rows[point, name][column]) / min(others))
        met = sum(ratio <= target for ratio in over)
        below = ""
        if name == "db-ipwm smooth":
            few = [f"Td ≤ {kHz} kHz" for kHz in ("1", "1.5", "2", "3")]
            cells = {
                (where, method, column): float(row[column])
                for (where, method), row in rows.items()
                for column in few
                if row[column] != "–"
            }
            below = sum(
                cells.get((where, name, column), math.inf)
                <= target * min(v for (w, m, c), v in cells.items()
                                if (w, c) == (where, column) and not m.startswith("db-ipwm"))
                for where in {point for point, _ in rows}
                for column in few
            )  # fmt: skip
            below = f", {below} of 32 within less"
        assert f"{min(over):.2f} to {max(over):.2f} times the best of the other methods" in own
        assert f"(target {target:.2f}: met at {met} of {len(over)} points{below})" in own
    over = [
        float(row["Td ≤ 4 kHz"])
        / float(limit[point.rpartition(", ")[0], "limit, w = 2"]["Td [N m]"])
        for (point, method), row in rows.items()
        if method == "db-ipwm smooth"
    ]
    mean = math.prod(over) ** (1 / len(over))
    assert f"in the mean {mean:.2f} times the limit, w = 2" in own


def test_each_missed_target_of_db_ipwm_is_told_with_its_reason():
    """The page leads to them; THD∞ by more than 1 %."""

    def rows(name):
        with (ROOT / "docs/data" / f"{name}.csv").open() as file:
            return list(csv.DictReader(file))

    told = {}
    for row in rows("misses"):
        assert row["reason"]
        for kHz in re.findall(r"[\d.]+", row["within"]):
            told[row["point"], kHz] = row["Td or THD∞ over the best of the others"], row["against"]
    found = {}
    for row in rows("targets"):
        point = row["point"].partition(" r/min")[0] + " r/min"
        for column, cell in row.items():
            over = re.fullmatch(r"Td ≤ ([\d.]+) kHz over it", column)
            if over and cell == "–":
                found[point, over[1]] = "no setting", ""
            elif over and float(cell) > 0.85:
                found[point, over[1]] = f"Td {cell}", "fcs-mpc"
        if float(row["THD∞ [%] over it"]) > 1.01:
            found[point, "4"] = f"THD∞ {row['THD∞ [%] over it']}", "foc-24"
    assert told == found
    assert "](data/misses.csv)" in (ROOT / "docs/interleaved.md").read_text()
