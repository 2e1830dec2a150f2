"""Comparison at equal switching frequency: the envelope, and the scheme that it ranks first."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque import firmware, setups
from hexatorque.evidence.papers.both import equal_fsw
from hexatorque.evidence.papers.engine.job import Job

pairs = st.lists(st.tuples(st.floats(0.1, 9), st.floats(0.1, 9)), min_size=1, max_size=30)


@given(pairs)
def test_envelope_is_the_best_within_each_budget(points):
    f, v = np.array(points).T
    corners_f, corners_v = equal_fsw.envelope(f, v)
    for budget in [*f, f.min(), 10.0]:
        best = v[f <= budget].min()
        assert corners_v[np.searchsorted(corners_f, budget, "right") - 1] == best
    assert (np.diff(corners_f) > 0).all() and (np.diff(corners_v) < 0).all()


class Plane(Job):
    """Replaces simulations. f_sw grows with the sampling frequency and falls with the bands; the
    ripple does the opposite. The first scheme has half the ripple of the others."""

    def metrics(self, points):
        found = []
        for point in points:
            setup = point.setup
            f_isr = setup["controller.f_isr_Hz"]
            scale = (
                setup["controller.torque_band_Nm"]
                / setups.load(setup.name)["controller.torque_band_Nm"]
            )
            share = 0.5 if setup["controller.scheme"] == firmware.schemes()[0] else 1.0
            found.append(
                {
                    "f_sw_Hz": 0.2 * f_isr / scale,
                    "torque_ripple_Nm": share * scale * 2e3 / f_isr,
                    "thd_pct": {"5kHz": 1e5 / f_isr},
                    "ixy_rms_A": 0.1,
                }
            )
        found[-1] = None  # a point that the drive does not hold
        return found


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return equal_fsw.fsw(Plane(False, tmp_path_factory.mktemp("points")))


def test_the_best_within_a_budget(figure):
    for name in equal_fsw.SETUPS:
        table = figure.metrics[name]
        assert set(table) == set(firmware.schemes())
        # Ripple times f_sw is 400, so the best point of the grid at 2 kHz has 0.2 N m (half of it:
        # 0.1).
        at_2_kHz = {s: table[s]["torque_ripple_Nm"]["2000"]["torque_ripple_Nm"] for s in table}
        assert at_2_kHz.pop("dtc1") == pytest.approx(0.1)
        assert at_2_kHz == pytest.approx(dict.fromkeys(at_2_kHz, 0.2))
        for scheme in table.values():
            for budgets in scheme.values():
                for budget, best in budgets.items():
                    assert best["f_sw_Hz"] <= float(budget)
    first = next(v for v in figure.verdicts if "ripple" in v.what)
    assert first.ours.startswith("dtc1 0.1, ")


def test_recording_and_picture(figure, tmp_path):
    rec = figure.recordings["paper-b"]
    grid = len(equal_fsw.SAMPLING_HZ) * len(equal_fsw.SCALES)
    assert len(rec) == grid * len(firmware.schemes()) - 1
    assert np.bincount(rec["scheme"]).tolist() == [grid] * (len(firmware.schemes()) - 1) + [
        grid - 1
    ]
    figure.draw(tmp_path / "fsw.png")
    assert (tmp_path / "fsw.png").stat().st_size > 20_000
