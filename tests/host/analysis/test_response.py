"""Step responses whose settling and overshoot are known in closed form."""

import numpy as np
import pytest

from hexatorque.analysis.response import moving_mean, step_response

RATE_HZ = 10_000.0
TIME_S = np.arange(20_000) / RATE_HZ
STEP_S = 0.5


@pytest.mark.parametrize(("before", "target"), [(0.0, 8.0), (5.0, -3.0)])
@pytest.mark.parametrize("band", (0.8, 0.08))
def test_a_lag_settles_when_its_exponential_is_within_the_band(before, target, band):
    tau_s, since = 0.05, np.maximum(TIME_S - STEP_S, 0.0)
    signal = target + (before - target) * np.exp(-since / tau_s)
    found = step_response(TIME_S, signal, STEP_S, target, band)
    assert found.settling_s == pytest.approx(tau_s * np.log(8.0 / band), abs=2 / RATE_HZ)
    assert found.overshoot == 0.0
    assert found.deviation == pytest.approx(8.0)


@pytest.mark.parametrize("sign", (1, -1))
@pytest.mark.parametrize("damping", (0.2, 0.6))
def test_an_oscillation_overshoots_by_its_damping(damping, sign):
    """1 - exp(-z w t) (cos(v t) + z/sqrt(1 - z^2) sin(v t)), v = w sqrt(1 - z^2)."""
    root, omega, since = np.sqrt(1 - damping**2), 60.0, np.maximum(TIME_S - STEP_S, 0.0)
    swing = np.cos(omega * root * since) + damping / root * np.sin(omega * root * since)
    found = step_response(
        TIME_S, sign * 4.0 * (1 - np.exp(-damping * omega * since) * swing), STEP_S, sign * 4.0, 0.2
    )
    assert found.overshoot == pytest.approx(4.0 * np.exp(-np.pi * damping / root), rel=1e-4)
    # The first sample after which it stays within the band, found by looking at each.
    late = [n for n, e in enumerate(np.exp(-damping * omega * since) * swing) if abs(e) > 0.05]
    assert found.settling_s == pytest.approx(TIME_S[late[-1] + 1] - STEP_S)


def test_what_was_before_the_step_does_not_count():
    signal = np.where(TIME_S < STEP_S, 100.0, 1.0)
    found = step_response(TIME_S, signal, STEP_S, 1.0, 0.1)
    assert (found.settling_s, found.overshoot, found.deviation) == (0.0, 0.0, 0.0)


def test_the_edge_of_the_band_is_within():
    signal = np.full(TIME_S.size, 1.5)
    assert step_response(TIME_S, signal, STEP_S, 1.0, 0.5).settling_s == 0.0


def test_what_leaves_the_band_at_the_end_has_not_settled():
    signal = np.ones(TIME_S.size)
    signal[-1] = 2.0
    assert np.isnan(step_response(TIME_S, signal, STEP_S, 1.0, 0.1).settling_s)
    signal[-2:] = 2.0, 1.0
    last_s = TIME_S[-1] - STEP_S
    assert step_response(TIME_S, signal, STEP_S, 1.0, 0.1).settling_s == pytest.approx(last_s)


def test_a_step_after_the_end_is_refused():
    with pytest.raises(ValueError, match="after the end of the recording"):
        step_response(TIME_S, TIME_S, TIME_S[-1] + 1.0, 0.0, 0.1)
    assert step_response(TIME_S, TIME_S, TIME_S[-1], TIME_S[-1], 0.1).settling_s == 0.0


def test_the_mean_around_each_sample():
    """An alternating ripple goes, a straight line stays but at the ends, where less is left."""
    n = np.arange(1000)
    line = 3.0 + 0.01 * n
    smooth = moving_mean(line + 0.5 * (-1.0) ** n, 1000.0, 0.02)
    assert smooth[10:-10] == pytest.approx(line[10:-10], abs=0.5 / 21 + 1e-9)
    for k in (0, 4, 10, 500, 995, 999):
        low, high = max(k - 10, 0), min(k + 11, 1000)
        assert moving_mean(line, 1000.0, 0.02)[k] == pytest.approx(line[low:high].mean())
    assert moving_mean(line, 1000.0, 0.0) == pytest.approx(line)
