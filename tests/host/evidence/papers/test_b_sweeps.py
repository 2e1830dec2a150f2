"""Sweeps and Table VI of paper B: each number is in its place, and the verdicts change when they
must."""

import itertools
import json

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.paper_b import ripple, sweeps, table
from hexatorque.evidence.papers.paper_b.common import FITTED, PRINTED, SCHEMES, SETUP, SETUPS
from hexatorque.experiments.operating_points import NotReached

FLUX_WB = {name: setups.load(name)["controller.flux_ref_Wb"] for name in SETUPS}


class Formula(Job):
    """Replaces simulations. The metrics are a formula of scheme (0, 1, 2), speed, load, and flux
    relative to the set-up's."""

    def __init__(self, formula, quick=True):
        super().__init__(quick, None)
        self.formula, self.points = formula, []

    def metrics(self, points):
        self.points = list(points)
        return [
            self.formula(
                SCHEMES.index(p.setup["controller.scheme"]), p.speed_rpm, p.load_Nm,
                p.setup["controller.flux_ref_Wb"] / FLUX_WB[p.setup.name],
            )
            for p in self.points
        ]  # fmt: skip


def metrics(thd=1.0, ripple=1.0, f_sw=1.0):
    bands = {"1kHz": thd, "2kHz": thd + 1, "5kHz": thd + 2, "h50": thd - 1}
    return {"thd_pct": bands, "torque_ripple_Nm": ripple, "f_sw_Hz": f_sw}


def words(figure):
    return {v.what: v.verdict for v in figure.verdicts}


def as_printed(at, speed, load, flux):
    row = PRINTED[SCHEMES[at]]
    return metrics(row["thd_pct"], row["torque_ripple_Nm"], 900 * row["f_sw_rel"])


@pytest.mark.parametrize("quick", [True, False])
def test_rows_and_columns_of_the_grids_are_not_exchanged(quick):
    """Rows are speeds and columns are loads."""
    job = Formula(lambda at, speed, load, flux: metrics(at + speed + load / 100), quick)
    figure = sweeps.b14(job)
    for name, (at, scheme) in itertools.product(SETUPS, enumerate(SCHEMES)):
        recording = figure.recordings[name]
        for row, speed in enumerate((500, 1500, 2500)):
            expected = at + speed + recording["load_Nm"] / 100
            assert figure.metrics[name][scheme][row] == pytest.approx(expected.tolist())
            assert recording[f"{scheme} {speed} r/min"] == pytest.approx(expected)


@pytest.mark.parametrize("quick", [True, False])
def test_rows_and_columns_of_figure_16_are_loads_and_speeds(quick, tmp_path):
    """It is the opposite of the others."""
    job = Formula(lambda at, speed, load, flux: metrics(ripple=at + speed + load / 100), quick)
    figure = ripple.b16(job)
    speeds = figure.recordings[SETUP]["speed_rpm"]
    assert speeds[0] == 500 and speeds[-1] == 2500
    for row, load in enumerate((0.0, 1.0, 2.0)):
        expected = pytest.approx((2 + speeds + load / 100).tolist())
        assert figure.metrics[SETUP]["dtc3"][row] == expected
    figure.draw(tmp_path / "grid.png")
    assert (tmp_path / "grid.png").stat().st_size > 20_000


def test_figures_14_and_19_share_their_points():
    """So the second of them takes no time. Both have both set-ups."""
    one, other = Formula(as_printed), Formula(as_printed)
    sweeps.b14(one)
    sweeps.b19(other)
    assert one.points == other.points
    fluxes = {p.setup.name: p.setup["controller.flux_ref_Wb"] for p in one.points}
    assert fluxes == {SETUP: 0.4, FITTED: 0.25}


def test_thd_over_load_as_the_paper_has_it():
    assert set(words(sweeps.b14(Formula(as_printed))).values()) == {"match"}
    for thd in ((20, 19, 10), (20, 10, 19)):
        one_is_high = Formula(lambda at, *_, thd=thd: metrics(thd[at]))
        assert set(words(sweeps.b14(one_is_high)).values()) == {"differs"}


def test_the_order_of_switching_frequencies_is_required_as_a_whole():
    figure = sweeps.b19(Formula(as_printed))
    assert set(words(figure).values()) == {"match"}
    # At 1500 r/min the second scheme switches less than the first, but not on average.
    locked = Formula(lambda at, speed, *_: metrics(
        f_sw=((1800, 1400, 2000) if speed == 1500 else (600, 900, 2000))[at]))  # fmt: skip
    found = words(sweeps.b19(locked))
    for name in SETUPS:
        assert found[f"{name}, 1500 r/min: DTC1 ≤ DTC2 < DTC3"] == "differs"
        assert found[f"{name}, 500 r/min: DTC1 ≤ DTC2 < DTC3"] == "match"
        assert found[f"{name}, all points: DTC1 ≤ DTC2 < DTC3"] == "match"
    assert not [v for v in sweeps.b19(locked).verdicts if v.broken]
    reverse = Formula(lambda at, *_: metrics(f_sw=(1800, 1500, 1400)[at]))
    broken = [v.what for v in sweeps.b19(reverse).verdicts if v.broken]
    assert broken == [f"{name}, all points: DTC1 ≤ DTC2 < DTC3" for name in SETUPS]


def test_the_ripple_ratio_is_judged_at_each_speed():
    good = Formula(lambda at, *_: metrics(ripple=(0.26, 0.27, 0.105)[at]))
    found = [v for v in ripple.b16(good).verdicts if v.verdict != "not printed"]
    assert [v.verdict for v in found] == ["match"] * 8
    # Too much ripple at one point is reported, but nothing is required there. Too much at all loads
    # of a speed breaks a requirement of the set-up whose open values are fitted.
    for loads, broken in ((1, []), (3, [FITTED])):
        job = Formula(lambda at, n, load, flux, loads=loads: metrics(
            ripple=(0.26, 0.27, 0.2 if n == 2500 and load < loads - 0.5 else 0.105)[at]
        ))  # fmt: skip
        figure = ripple.b16(job)
        assert [v.what.split(":")[0] for v in figure.verdicts if v.broken] == broken
        found = words(figure)
        for name in SETUPS:
            assert found[f"{name}: DTC3 over DTC1 at each speed and load within 0.35 to 0.65"] == (
                "differs"
            )


def test_a_point_that_is_not_reached_is_a_gap():
    """Such a point is a gap in the sweep and never a "match". The JSON stays valid."""

    def gap(at, speed, load, flux):
        return None if (at, speed, load) == (2, 2500, 2.0) else as_printed(at, speed, load, flux)

    for figure in (ripple.b16(Formula(gap)), sweeps.b14(Formula(gap))):
        assert figure.metrics[FITTED]["dtc3"][2][-1] is None
        assert any(v.verdict == "differs" for v in figure.verdicts)
        json.dumps(figure.metrics, allow_nan=False)
    with pytest.raises(NotReached, match="2 N m under dtc3"):
        table.b_t6(Formula(gap))


@pytest.mark.parametrize("quick", [True, False])
def test_a_machine_as_printed_matches_table_6(quick, tmp_path):
    """A machine with the printed values matches, whatever the values at other fluxes are."""

    def at_flux(at, speed, load, flux):
        row = as_printed(at, speed, load, flux)
        row["torque_ripple_Nm"] *= flux * load / 2
        return row

    figure = table.b_t6(Formula(at_flux, quick))
    assert not [v for v in figure.verdicts if v.broken]
    for what, verdict in words(figure).items():
        expected = "not printed" if "5 kHz" in what or what.endswith("f_sw") else "match"
        assert verdict == expected, what
    ours = {v.what: v.ours for v in figure.verdicts}
    for name in SETUPS:
        assert ours[f"{name}, DTC1: THD, 1 kHz"] == pytest.approx(23.5)
        assert ours[f"{name}, DTC1: THD, harmonics ≤ 50"] == pytest.approx(22.5)
        rows = figure.metrics["table"][name]
        assert rows["dtc3"]["f_sw_rel"] == pytest.approx(2.0)
        assert rows["dtc2"]["torque_ripple_Nm"] == pytest.approx(0.271)
        spread = figure.metrics["spread"][name]["dtc1"]
        assert spread["torque_ripple_Nm"] == pytest.approx(0.2617 * (0.02 if quick else 0.04))
        assert spread["f_sw_Hz"] == 0
    rec = figure.recordings["flux"]
    assert rec["dtc3 torque_ripple_Nm"] == pytest.approx(0.1063 * rec["flux_ref_Wb"] / 0.4)
    assert rec["dtc2 f_sw_rel"] == pytest.approx(np.full(len(rec), 1.1))
    figure.draw(tmp_path / "t6.png")
    assert (tmp_path / "t6.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("key", "broken"),
    [("thd", "THD: DTC2 and DTC3 below DTC1"), ("ripple", "ripple: DTC3 below DTC1 and DTC2"),
     ("f_sw", "f_sw: DTC1 ≤ DTC2 < DTC3")],
)  # fmt: skip
def test_the_wrong_order_of_schemes_breaks_table_6(key, broken):
    wrong = Formula(lambda at, *_: {
        "thd": metrics((11, 10.9, 12)[at], (3, 3, 1)[at], (1, 2, 3)[at]),
        "ripple": metrics((24, 12, 12)[at], (3, 1, 2)[at], (1, 2, 3)[at]),
        "f_sw": metrics((24, 12, 12)[at], (3, 3, 1)[at], (1, 3, 2)[at]),
    }[key])  # fmt: skip
    found = [v.what for v in table.b_t6(wrong).verdicts if v.broken]
    assert [what for what in found if what.startswith(f"{SETUP},")] == [f"{SETUP}, {broken}"]
    # The ratios are required as well for the set-up whose open values are fitted.
    fitted = [what for what in found if what.startswith(FITTED)]
    assert fitted[0] == f"{FITTED}, {broken}"
    assert all("over DTC1" in what for what in fitted[1:])
