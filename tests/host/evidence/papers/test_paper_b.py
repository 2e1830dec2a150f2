"""The common parts of paper B's figures."""

import numpy as np

from hexatorque.evidence.papers.paper_b import common
from hexatorque.plant.vsd import ANGLES_RAD, TRANSFORM
from hexatorque.recording.recording import Recording


def recording(samples=40, per=4, start_s=0.0):
    channels = {"a": np.arange(samples), "b": -np.arange(samples)}
    return Recording(4e4, channels, {"a": "A", "b": "V"}, {"samples_per_period": per}, start_s)


def test_control_instants_are_the_first_sample_of_each_period():
    # With a period of 100 us these are samples 0, 4, 8, ... if the recording begins with a control
    # instant, and samples 1, 5, ... if it begins 25 us before one.
    rec = common.control_instants(recording())
    assert rec["a"].tolist() == list(range(0, 40, 4))
    assert (rec.rate_Hz, rec.start_s) == (1e4, 0.0)
    late = common.control_instants(recording(start_s=75e-6))
    assert late["a"].tolist() == list(range(1, 40, 4))
    assert np.isclose(late.start_s, 100e-6)


def test_ending_and_excerpt_keep_the_last_samples():
    rec = recording(start_s=1.0)
    assert common.ending(rec, 250e-6)["a"].tolist() == list(range(30, 40))
    part = common.excerpt(rec, ("b",), 250e-6)
    assert list(part.channels) == ["b"] and part.units == {"b": "V"}
    assert np.isclose(part.start_s, 1.0 + 30 / 4e4)
    assert not np.shares_memory(part["b"], rec["b"])
    assert len(common.excerpt(rec, ("a", "b"))) == 40


def test_harmonic_orders_are_sorted_by_their_plane():
    """An odd harmonic of six balanced phases is in one plane or in neither. Even harmonics do not
    occur if the half waves are symmetrical."""
    angle = np.linspace(0, 2 * np.pi, 7)[:-1]
    for order in range(3, 50, 2):
        phases = np.cos(order * (angle[:, None] - ANGLES_RAD))
        alpha, beta, x, y = TRANSFORM @ phases.T
        assert (order in common.torque_orders(50)) == (np.hypot(alpha, beta).max() > 0.5)
        assert (order in common.xy_orders(50)) == (np.hypot(x, y).max() > 0.5)
    assert not any(k % 2 == 0 for k in common.xy_orders(50) + common.torque_orders(50))


def test_points_around_a_load_are_within_2_percent():
    for quick in (True, False):
        loads = common.around(2.0, quick)
        assert loads[0] == 2.0
        assert np.isclose(np.mean(loads), 2.0)
        assert len(set(loads)) == len(loads) == (3 if quick else 5)
        assert max(loads) / min(loads) < 1.05
    assert common.mean([{"a": 1.0, "b": 4.0}, {"a": 3.0, "b": 0.0}]) == {"a": 2.0, "b": 2.0}
