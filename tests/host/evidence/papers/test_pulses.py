"""The bench for patterns does what the registers demand: edges are at their counts, and the mean
voltage follows from the legs' on-times."""

import numpy as np
import pytest

from hexatorque.evidence.papers.engine.pulses import pattern, period_counts, play
from hexatorque.firmware import ffi

THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
#: Rows alpha, beta, x, y.
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
P = period_counts()


def registers(start, ca, cb):
    return ffi.new("ht_compare *", {"start": start, "ca": ca, "cb": cb})


def test_period_is_100_us_of_the_chip():
    assert P == 15000


def test_edges_come_at_the_register_counts():
    never = P
    ca = [3000, never, 1, never, 14998, 7000]
    cb = [9000, 5000, 2, never, 14999, never]
    played = play([registers(0, [never] * 6, [never] * 6), registers(0b010110, ca, cb)])
    want = {
        0: [(0, 0), (3000, 1), (9000, 0)],
        1: [(0, 1), (5000, 0)],
        2: [(0, 0), (1, 1), (2, 0)],
        3: [(0, 1)],
        4: [(0, 1), (14998, 0), (14999, 1)],
        5: [(0, 0), (7000, 1)],
    }
    for leg, levels in want.items():
        assert played.levels(0, leg) == [(0, 0)]
        assert played.levels(1, leg) == levels
    assert played.levels_at(1, 6000) == [1, 0, 0, 1, 1, 0]


def test_mean_voltage_is_the_on_times():
    rng = np.random.default_rng(3)
    words = [tuple(map(int, rng.integers(0, 64, 3))) for _ in range(20)]
    points = [sorted(rng.uniform(0.01, 0.99, 2)) for _ in words]
    played = play([pattern(w, *t) for w, t in zip(words, points, strict=True)], 200)
    for n, (w, (t1, t2)) in enumerate(zip(words, points, strict=True)):
        bits = np.array([[word >> b & 1 for b in range(5, -1, -1)] for word in w])
        on = np.array([t1, t2 - t1, 1 - t2]) @ bits
        # Action points are rounded to counts.
        np.testing.assert_allclose(played.mean_pu[n], T @ on, atol=1.5 / P)
        recorded = [
            played.recording[f"plant.leg_{p}"][200 * n : 200 * (n + 1)].mean()
            for p in ("u1", "u2", "w1", "w2", "v1", "v2")
        ]
        np.testing.assert_allclose(recorded, on, atol=2 / 200)


def test_phase_voltages_are_paper_a_equation_15():
    """Each set's neutral is isolated, so a phase voltage is its leg's voltage minus the mean of its
    set."""
    words = (49, 22, 37, 63)
    played = play([pattern((w,) * 3, 1, 1) for w in words], 4)
    legs = np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in words], float)
    wanted = np.empty_like(legs)
    for own in ([0, 2, 4], [1, 3, 5]):  # u1 w1 v1, u2 w2 v2
        wanted[:, own] = 250 * (legs[:, own] - legs[:, own].mean(axis=1, keepdims=True))
    got = [played.recording[f"plant.v_{p}_V"][3::4] for p in ("u1", "u2", "w1", "w2", "v1", "v2")]
    np.testing.assert_allclose(np.transpose(got), wanted, atol=1e-4)


def test_a_pattern_that_cannot_be_written_is_an_error():
    with pytest.raises(TypeError):
        play([{"start": 0}])
