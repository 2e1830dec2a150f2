"""The comparison with the references: equal search for all, and sentences that follow from numbers
alone."""

import csv
import importlib.util
import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from hexatorque import firmware, laws
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.fsw import bench
from hexatorque.evidence.papers.references import comparison, errors, judging, search, steps
from hexatorque.evidence.papers.references.methods import (
    FAMILIES,
    MODULATED,
    OURS,
    controller,
    methods,
)
from hexatorque.evidence.papers.references.places import MACHINES, PLACES

ROOT = Path(__file__).parents[4]
BY_NAME = {method.name: method for method in methods()}
PLACE = PLACES[3]


def test_all_schemes_and_references_are_compared_on_four_machines():
    assert set(BY_NAME) == {*firmware.schemes(), *laws.names()}
    assert len({place.setup for place in PLACES}) == len(MACHINES) == 4
    assert len(search.LIMITS_HZ) >= 6
    assert {method.family for method in methods()} == set(FAMILIES)


def test_every_method_has_the_same_budget():
    assert len({(method.extent, method.quick) for method in methods()}) == 1
    # Every pair of a figure and a limit is refined in each round.
    assert set(methods()[0].extent.rounds) == {len(search.TARGETS)}
    assert len(set(search.TARGETS)) == len(search.LIMITS_HZ) * len(search.JUDGED)


@pytest.mark.parametrize("method", methods(), ids=lambda method: method.name)
def test_the_drive_takes_every_corner(method):
    machine = next(machine for machine in MACHINES if PLACE in machine.places)
    for share in (0.0, 0.5, 1.0):
        row = search.values_of(method, PLACE, np.full(method.free, share))
        values = controller(method, row)
        if method.family == MODULATED and share == 0.0 and not method.law_axes:
            continue  # the firmware refuses so few samples in a time constant of this machine
        law = method.law(machine.base, row)
        setup = bench.bench_setup(machine.base, method.scheme, values)
        sim = SimulatedDrive(setup, 12, laws.controller_of(law) if law else firmware.Controller)
        assert 1 / sim.period_s == pytest.approx(row["f_isr_Hz"])
        assert sim.controller.get("scheme") == method.name


def simulated(base, scheme, values, place, *rest, **named):
    """Replaces the simulation: f_sw is a fifth of f_isr, and Td times f_sw is constant."""
    f_isr = values["f_isr_Hz"]
    if f_isr > 40e3:
        return None
    f_sw = f_isr / 5
    return {"f_sw_Hz": f_sw, "td_Nm": 300 / f_sw, "thd_inf_pct": 1e4 / f_sw, "ixy_rms_A": 0.1,
            "loss_W": 50.0, "idc_ripple_A": 1.0, "flux_Wb": 0.39}  # fmt: skip


@pytest.fixture
def counted(monkeypatch):
    calls = []

    def one(*arguments, **named):
        calls.append(arguments[1:3])
        return simulated(*arguments, **named)

    monkeypatch.setattr(bench, "measure", one)
    return calls


def test_a_larger_budget_continues_the_same_search(counted, tmp_path):
    """What was found with the smaller budget is still there, so a method cannot lose by it."""
    method, job = BY_NAME["dtc3"], Job(False, tmp_path)
    once = search.settings(job, PLACE, method, 1)
    assert len(once) == len(counted) == method.extent.settings
    twice = search.settings(job, PLACE, method, 2)
    assert twice[: len(once)] == once and len(twice) == 2 * len(once) == len(counted)
    assert search.settings(job, PLACE, method, 1) == once  # the smaller budget sees its own part
    assert len(counted) == len(twice)
    assert search.settings(Job(False, tmp_path / "anew"), PLACE, method, 2) == twice


def test_an_interrupted_search_continues(counted, tmp_path, monkeypatch):
    method, job = BY_NAME["dtc1"], Job(False, tmp_path)
    whole = search.settings(Job(False, tmp_path / "whole"), PLACE, method, 1)
    counted.clear()

    def interrupted(*arguments, **named):
        if len(counted) == method.extent.cover + 3:
            raise KeyboardInterrupt
        counted.append(None)
        return simulated(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(bench, "measure", interrupted)
        with pytest.raises(KeyboardInterrupt):
            search.settings(job, PLACE, method, 1)
    counted.clear()
    assert search.settings(job, PLACE, method, 1) == whole
    assert len(counted) == sum(method.extent.rounds)


def test_the_search_comes_to_just_below_each_limit(counted, tmp_path):
    """Td times f_sw is constant: the best setting is the one nearest to the limit. A random search
    with as many settings leaves gaps of several per cent."""
    for name in ("foc", "dtc1", "fcs-mpc"):
        rows = search.held(search.settings(Job(False, tmp_path), PLACE, BY_NAME[name], 1))
        least_Hz = min(row["f_sw_Hz"] for row in rows)
        for limit_Hz in search.LIMITS_HZ:
            row = judging.best(rows, "td_Nm", limit_Hz)
            if limit_Hz > 1.1 * least_Hz and limit_Hz < 3.6e3:
                assert row["f_sw_Hz"] > 0.97 * limit_Hz, (name, limit_Hz)


def test_only_the_rivals_get_the_larger_budget(counted, tmp_path):
    points = comparison.searched(Job(True, tmp_path), 3)
    extent = methods()[0].quick
    tried = {}
    for scheme, _ in counted:
        tried[scheme] = tried.get(scheme, 0) + 1
    assert tried[OURS] == len(MACHINES) * extent.settings
    assert tried["foc"] == 3 * tried[OURS]
    assert len(points) == len(MACHINES)


def test_a_refused_setting_is_one_that_does_not_hold_the_point(tmp_path):
    place = MACHINES[2].place  # high inductance: the firmware wants more samples
    values = search.values_of(BY_NAME["foc"], place, np.zeros(1))
    assert search.measure(BY_NAME["foc"], place, values, Job(True, tmp_path)) is None


VALUES = {
    "one": {"dtc1": 2.0, "db-dtfc": 1.0, "foc": 1.05, "fcs-mpc": 4.0},
    "two": {"dtc1": 8.0, "db-dtfc": 4.2, "foc": 4.0, "fcs-mpc": 4.0},
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
    assert found.take == ("db-dtfc", "foc")
    table, single = (BY_NAME[name].family for name in ("dtc1", "fcs-mpc"))
    assert found.against == pytest.approx(
        {table: 0.5 * math.sqrt(1.05), single: 0.5 * math.sqrt(1.05)}, rel=0.03
    )
    assert "`db-dtfc` or `foc`" in found.text and "0.51 times" in found.text


def test_our_scheme_is_not_favoured():
    """If two methods exchange their numbers, the sentence exchanges their names."""
    swap = {"db-dtfc": "dtc1", "dtc1": "db-dtfc"}
    exchanged = {
        point: {swap.get(name, name): value for name, value in row.items()}
        for point, row in VALUES.items()
    }
    found = chosen({p: {n: exchanged[p][n] for n in VALUES["one"]} for p in exchanged})
    assert set(found.take) == {"dtc1", "foc"}


def test_a_method_without_a_point_is_not_ranked():
    missing = {**VALUES, "two": {**VALUES["two"], "foc": None}}
    found = chosen(missing)
    assert found.take == ("db-dtfc",) and found.missing == ("foc",)
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
    assert comparison._verdicts(same, same, 2)[-1].verdict == "match"
    changed = comparison._verdicts(same, other, 2)[-1]
    assert changed.verdict == "differs" and "`dtc1`" in changed.why and "`foc`" in changed.why


def test_the_balanced_setting_keeps_the_limit():
    rows = [{"f_sw_Hz": f, "td_Nm": 1e3 / f, "thd_inf_pct": 2.0} for f in (1e3, 3.9e3, 4.1e3)]
    assert judging.balanced(rows)["f_sw_Hz"] == 3.9e3
    assert judging.balanced(rows[2:]) is None


@pytest.fixture
def figure(counted, tmp_path, monkeypatch):
    made = {"rise_up_ms": 0.5, "rise_down_ms": 0.4, "overshoot_pct": 3.0}
    monkeypatch.setattr(steps, "run", lambda *_: made)
    return comparison.references(Job(True, tmp_path, rivals=2))


def test_the_figure_has_five_sentences_and_says_whether_they_change(figure, tmp_path):
    metrics = json.loads(json.dumps(figure.metrics, allow_nan=False))
    assert len(metrics["equal"]["sentences"]) == len(metrics["rivals"]["sentences"]) == 5
    assert [v.verdict for v in figure.verdicts].count("not printed") == 5
    assert "2 times the budget" in figure.verdicts[-1].what
    rec = figure.recordings[""]
    assert set(rec["method"]) == set(range(len(methods())))
    figure.draw(tmp_path / "REFERENCES.png")
    assert (tmp_path / "REFERENCES.png").stat().st_size > 20_000
    memory = comparison.memory_bytes()
    assert memory["dtc-svm"] > memory["vv-mpc"] == 0


def test_a_torque_step_of_field_orientation_is_answered_as_its_tuning_says(tmp_path):
    """Without a limit of the voltage the answer is 1 - (1 - a)^k, a = 0.3: from 10 to 90 % in
    about six periods, here of a tenth of a millisecond."""
    machine = MACHINES[0]
    place = machine.places[0]  # low speed: the voltage does not limit
    low = type(machine)(machine.name, machine.setup, (place,))
    row = search.values_of(BY_NAME["foc"], place, np.array([math.log(5) / math.log(9)]))
    assert row["f_isr_Hz"] == pytest.approx(10e3, rel=0.01)
    found = steps.run("torque step", BY_NAME["foc"], low, row, Job(True, tmp_path))
    for key in ("rise_up_ms", "rise_down_ms"):
        assert 0.4 < found[key] < 0.9
    assert found["overshoot_pct"] < 15


def test_a_wrong_parameter_is_that_of_the_controller(monkeypatch, tmp_path):
    machine = MACHINES[1]
    seen = []

    def one(base, scheme, values, *rest, **named):
        seen.append((values, named["flux_share"]))

    monkeypatch.setattr(bench, "measure", one)
    row = search.values_of(BY_NAME["fcs-mpc"], machine.place, np.full(3, 0.5))
    for case in errors.CASES:
        lost = errors.run(case, BY_NAME["fcs-mpc"], machine, row, Job(True, tmp_path))
        assert "lost" in lost
    assert [values["rs_ohm"] / machine.base.parameter("rs_ohm") for values, _ in seen[-2:]] == (
        pytest.approx([0.7, 1.3])
    )
    assert {share for _, share in seen} == {errors.FLUX_SHARE}
    assert all("weight_xy" not in values for values, _ in seen)


def test_a_wrong_parameter_that_the_firmware_refuses_is_called_so(tmp_path):
    """At 7.8 kHz the small machine has six samples in L_xy / R_s. With R_s 30 % too large the
    firmware sees less than five."""
    machine = MACHINES[2]
    row = search.values_of(BY_NAME["foc"], machine.place, np.full(1, 0.62))
    assert (
        5 < row["f_isr_Hz"] * machine.base["machine.lxy_H"] / machine.base["machine.rs_ohm"] < 6.5
    )
    found = errors.run(("rs_ohm", 1.3), BY_NAME["foc"], machine, row, Job(True, tmp_path))
    assert found["lost"] == "refused" and "f_isr_Hz" in found["refused"]


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
    monkeypatch.setattr(tool, "ON_PAGE", ("paper A, 900 r/min", "paper B, 2500 r/min", "m"))
    metrics = json.loads(json.dumps(figure.metrics))
    budget = json.loads((ROOT / "docs/budget.json").read_text())
    text = tool.sentences(metrics)
    assert (
        len(re.findall(r"^\d\. ", text, re.MULTILINE)) == 5 and "of the 5 sentences change" in text
    )
    for part in (tool.sampling(metrics), tool.costs(budget)):
        assert all(f"| `{name}` |" in part for name in BY_NAME)
    points = [at["point"] for at in (metrics.get("rivals") or metrics["equal"])["points"]]
    for name, of in (("fronts", points), ("steps", metrics["equal"]["steps"])):
        assert f"[{name}.csv](data/{name}.csv)" in getattr(tool, name)(metrics)
        with (tmp_path / "data" / f"{name}.csv").open() as file:
            rows = [tuple(row[:2]) for row in csv.reader(file)][1:]
        assert len(rows) == len(set(rows)) == len(of) * len(BY_NAME)
        assert {method for _, method in rows} == set(BY_NAME)
    # The stand-in for a measurement gives every method the same figures at the same sampling.
    assert "`fcs-mpc` over `vv-mpc`: Td " in tool.published(metrics)
    assert f"{budget['mps2-an386']['ddr']['mean']:.0f}" in tool.costs(budget)
    row = {"td_Nm": 0.5, "thd_inf_pct": 4.0}
    metrics["equal"] = {
        "chosen": {"m": {name: row for name in BY_NAME}},
        "errors": {"m": {name: {"c": {"lost": "x"} if name == "foc" else row} for name in BY_NAME}},
    }
    del metrics["rivals"]
    refused = {"lost": "refused", "refused": "a reason"}
    metrics["equal"]["errors"]["m"]["foc-24"] = {"c": refused}
    text = tool.errors(metrics)
    assert "| `foc` | 0.5 · 4 | lost |" in text and "| `ddr` | 0.5 · 4 | 0.5 · 4 |" in text
    assert "| `foc-24` | 0.5 · 4 | refused |" in text


def test_the_documentation_shows_the_sentences_and_every_method(tool):
    text = (ROOT / "docs/comparison.md").read_text()
    if "Not made yet" in text:
        pytest.skip("tools/write_comparison.py has not run yet")
    for part in ("sentences", "fronts", "sampling", "steps", "errors", "costs", "published"):
        own = text.split(f"<!-- generated: {part} -->")[1].split(f"<!-- end of {part} -->")[0]
        if part == "sentences":
            assert len(re.findall(r"^\d\. ", own, re.MULTILINE)) == len(judging.QUESTIONS)
        elif part != "published":
            assert all(f"| `{name}` |" in own for name in BY_NAME), part
