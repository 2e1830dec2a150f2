"""Sobol indices are those of functions whose indices are known; pictures show their study."""

import csv
import math

import numpy as np
import pytest

from hexatorque import Study
from hexatorque.sweeps import maps, sensitivity
from hexatorque.sweeps.errors import StudyError
from hexatorque.sweeps.space import Draw
from hexatorque.sweeps.work import Row

pytest.importorskip("SALib")
RS, RR, NM = "machine.rs_ohm", "machine.rr_ohm", "point.load_Nm"
KEYS = {RS: {"from": 1.0, "to": 2.0}, RR: {"from": 1.0, "to": 2.0}, NM: 1.0}


def made(function, keys=KEYS, samples=512, **more):
    """A study whose figure is a function of its keys."""
    study = Study("paper-b", keys, ["torque_Nm"], Draw("sobol", samples), **more)
    for number in range(len(study)):
        figure = function(study.space.case(number).values)
        study.results.add(Row(number, (figure,), "" if math.isfinite(figure) else "tripped"))
    return study


def indices(study):
    return {line[2]: (line[3], line[5]) for line in sensitivity.indices(study.results)}


def test_a_sum_has_shares_in_proportion_to_the_squares():
    """Var(a x + b y) = (a^2 + b^2) / 12 for x, y uniform over 1: no share is joint."""
    found = indices(made(lambda v: 3 * v[RS] + v[RR]))
    assert set(found) == {RS, RR}  # the load has one value
    assert found[RS] == pytest.approx((0.9, 0.9), abs=0.03)
    assert found[RR] == pytest.approx((0.1, 0.1), abs=0.03)


def test_a_product_without_means_has_joint_shares_only():
    """Of (x - m)(y - m) neither alone causes anything, both together all."""
    found = indices(made(lambda v: (v[RS] - 1.5) * (v[RR] - 1.5)))
    for s1, st in found.values():
        assert s1 == pytest.approx(0.0, abs=0.08) and st == pytest.approx(1.0, abs=0.08)


def test_a_failed_run_costs_its_sample_only():
    def function(values):
        return math.nan if values[RS] > 1.99 and values[RR] > 1.9 else 3 * values[RS] + values[RR]

    study = made(function)
    assert study.failures
    assert indices(study)[RS][0] == pytest.approx(0.9, abs=0.05)


def test_seeds_of_the_noise_are_averaged():
    study = made(lambda v: 3 * v[RS] + v[RR] + (-1) ** v["sensors.noise_seed"], seeds=[1, 2])
    assert indices(study)[RS][0] == pytest.approx(0.9, abs=0.03)


def test_a_figure_that_does_not_vary_has_no_indices():
    assert all(math.isnan(s1) for s1, _ in indices(made(lambda _: 1.0, samples=8)).values())


@pytest.mark.parametrize(
    ("keys", "samples", "said"),
    [
        (KEYS, 12, "samples = 12: a sobol design needs a power of 2"),
        ({RS: KEYS[RS], NM: 1.0}, 8, "a sobol design needs two keys that vary"),
    ],
)
def test_mistakes(keys, samples, said):
    with pytest.raises(StudyError, match=said):
        Study("paper-b", keys, ["torque_Nm"], Draw("sobol", samples))


def test_files_and_picture(tmp_path):
    pytest.importorskip("pandas")
    study = made(lambda v: 3 * v[RS] + v[RR], samples=8, schemes=["dtc1", "ddr"])
    assert len(study) == 8 * (2 + 2) * 2
    files = study.save(tmp_path)
    lines = list(csv.reader(files[-1].read_text().splitlines()))
    assert tuple(lines[0]) == sensitivity.COLUMNS and len(lines) == 1 + 2 * 2
    assert study.indices()["ST"].tolist() == [float(line[5]) for line in lines[1:]]
    assert study.map(tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"


def test_the_front_has_the_runs_that_no_other_beats():
    x = np.array([1.0, 2.0, 3.0, 4.0, 2.0])
    y = np.array([5.0, 3.0, 4.0, 1.0, 2.5])
    assert [x[k] for k in maps._best(x, y, more=False)] == [1.0, 2.0, 4.0]
    assert [y[k] for k in maps._best(x, y, more=False)] == [5.0, 2.5, 1.0]
    assert [y[k] for k in maps._best(x, y, more=True)] == [5.0]


def test_the_picture_over_a_figure(tmp_path):
    names = ["f_sw_Hz", "torque_ripple_Nm"]
    study = Study("paper-b", {NM: [0.5, 1.0, 1.5]}, names, over="f_sw_Hz", schemes=["ddr"])
    for number in range(3):
        study.results.add(Row(number, (1000.0 * (number + 1), 1.0 / (number + 1))))
    assert study.map(tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(StudyError, match="over = 'i1_A': choose one of f_sw_Hz, torque_ripple_Nm"):
        Study("paper-b", {NM: [1.0]}, names, over="i1_A")
