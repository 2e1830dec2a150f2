"""Paper A's transients: the verdicts are tested on made-up and on real recordings."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hexatorque.evidence.papers.paper_a import dynamics, steps
from hexatorque.recording.recording import Recording

INERTIA = 0.03
FRICTION = 0.0033


@pytest.fixture(scope="module")
def load_pair(job):
    [pair] = steps.pairs(job, [dynamics.load_step()], 2)
    return pair


def made_up(step, speed, torque):
    t = np.arange(round(2.0 * 4e4)) / 4e4
    zero = np.zeros_like(t)
    channels = {"plant.speed_rpm": speed(t - step.at_s), "plant.torque_Nm": torque(t - step.at_s)}
    return Recording(4e4, channels | {"plant.i_x_A": zero, "plant.i_y_A": zero})


def test_response_of_a_known_curve():
    """A first-order curve returns from 100 r/min below. It is within 13.5 r/min after tau
    ln(100/13.5)."""
    step = dynamics.load_step()
    tau = 0.1
    rec = made_up(
        step,
        lambda t: 400 - np.where(t < 0, 0, 100 * np.exp(-t / tau)),
        lambda t: np.where(t < 0, 0, 7.5 + FRICTION * 400 * math.pi / 30 + 3 * np.exp(-t / tau)),
    )
    found = steps.response(step, rec)
    assert found["speed_settling_s"] == pytest.approx(tau * math.log(100 / 13.5), abs=0.01)
    assert found["torque_settling_s"] == pytest.approx(tau * math.log(3 / 1.0), abs=0.01)
    # Extremes are those of the mean over 20 ms.
    first = (1 - math.exp(-0.02 / tau)) / (0.02 / tau)
    assert found["speed_beyond_rpm"] == pytest.approx(100 * first, rel=1e-3)
    assert found["torque_peak_Nm"] == pytest.approx(7.638 + 3 * first, rel=1e-3)


def test_load_step_obeys_newton(load_pair):
    """Before the slow loop responds, only the load brakes. At the end the drive's torque is load
    and friction."""
    rec = load_pair.recordings["ddr"]
    at = load_pair.step.at_s
    t, rpm = rec.time_s, rec["plant.speed_rpm"]
    early = (t > at) & (t < at + 0.009)
    slope = np.polyfit(t[early], rpm[early] * math.pi / 30, 1)[0]
    assert slope == pytest.approx(-7.5 / INERTIA, rel=0.15)
    end = rec.window(1.6, 2.0)
    want = 7.5 + FRICTION * 400 * math.pi / 30
    assert end["plant.torque_Nm"].mean() == pytest.approx(want, rel=0.02)
    assert rpm[t < at].mean() == pytest.approx(400, abs=2)


def test_load_signs_of_the_reversal(job):
    """If the load has one sign, the drive brakes before the reversal and drives after it. If the
    load always brakes, the drive's torque changes sign."""
    load = 7.5
    one_sign = steps.Step(-400, -load, "speed_ref_rpm", 400, 0.3, 2.0, 400, load)
    brake = replace(one_sign, load_Nm=load, load="friction")
    for step, before in ((one_sign, load), (brake, -load)):
        rec = steps._record(job, step, "ddr", 0)
        drag = FRICTION * 400 * math.pi / 30
        start, end = rec.window(0.0, 0.3), rec.window(1.7, 2.0)
        assert start["plant.speed_rpm"].mean() == pytest.approx(-400, rel=0.01)
        assert start["plant.torque_Nm"].mean() == pytest.approx(before - drag, abs=0.3)
        assert end["plant.speed_rpm"].mean() == pytest.approx(400, rel=0.01)
        assert end["plant.torque_Nm"].mean() == pytest.approx(load + drag, abs=0.3)


def test_fdr_and_ddr_respond_alike(load_pair):
    found = steps.verdicts(load_pair)
    assert len(found) == 7
    assert all(v.verdict == "match" and v.required for v in found), found


def test_different_responses_are_noticed(load_pair):
    """The same curves 60 ms late, or with a loop that is 10 % slower."""
    late = {
        name: np.roll(curve, round(0.06 * 4e4)) for name, curve in load_pair.curves["ddr"].items()
    }
    moved = replace(load_pair, curves={**load_pair.curves, "ddr": late})
    assert all(v.verdict == "differs" for v in steps.overlap(moved, ""))
    slower = {k: 1.1 * v for k, v in load_pair.figures["ddr"].items()}
    moved = replace(load_pair, figures={**load_pair.figures, "ddr": slower})
    words = {v.what: v.verdict for v in steps.verdicts(moved)}
    assert [w for what, w in words.items() if "settling" in what] == ["differs", "differs"]
    unsettled = {**load_pair.figures["ddr"], "speed_settling_s": math.nan}
    moved = replace(load_pair, figures={**load_pair.figures, "ddr": unsettled})
    assert any(v.broken for v in steps.verdicts(moved))


def test_figure_and_picture(job, tmp_path):
    figure = dynamics.a14(job)
    assert set(figure.recordings) == {
        f"{s}-{w}" for s in ("fdr", "ddr") for w in ("field-weakening", "as-printed")
    }
    held = figure.recordings["ddr-as-printed"]
    assert held["plant.speed_rpm"].max() < 1350 * 0.9
    assert figure.metrics["as printed"]["ddr"]["speed_settling_s"] is None
    words = {v.what: v.verdict for v in figure.verdicts}
    assert words["as printed: speed under rated load, DDR-DTC"] == "differs"
    assert all(w == "match" for what, w in words.items() if what.startswith("field weakening"))
    path = figure.draw(tmp_path / "a14.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 50_000
