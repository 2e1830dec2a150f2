"""ht_duty is compared with its definition: the three vectors of a virtual vector, weighted with the
duties, must give the commanded x-y voltage.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import lib

THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
GROUPS = {
    lib.HT_L: (48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49),
    lib.HT_ML: (57, 52, 24, 44, 30, 13, 6, 11, 39, 19, 33, 50),
}
DETERMINANT = {lib.HT_L: 1 / 18, lib.HT_ML: (2 + np.sqrt(3)) / 9}
PAIRS = [(g, k) for g in GROUPS for k in range(12)]


def vectors(group, k):
    """(3, 4): alpha beta x y of the virtual vector's three vectors."""
    words = np.array([GROUPS[group][(k + d) % 12] for d in (-1, 0, 1)])
    return ((words[:, None] >> np.arange(5, -1, -1)) & 1) @ T.T


def duties(group, k, x, y):
    p = lib.ht_duty(group, k, {"x": x, "y": y})
    return np.array([p.t1, p.t2 - p.t1, 1 - p.t2])


unit = st.floats(-1, 1, width=32)


@pytest.mark.parametrize(("group", "k"), PAIRS)
def test_all_vectors_of_a_group_have_the_same_determinant(group, k):
    matrix = np.vstack([vectors(group, k)[:, 2:].T, np.ones(3)])
    assert np.linalg.det(matrix) == pytest.approx(DETERMINANT[group], rel=1e-12)


@given(unit, unit)
@settings(max_examples=60, deadline=None)
def test_duties_give_the_commanded_voltage_over_the_whole_box(ux, uy):
    for group, k in PAIRS:
        limit = lib.ht_tmvcl_pu[group]
        x, y = np.float32(ux * limit), np.float32(uy * limit)
        t = duties(group, k, x, y)
        assert (t >= 0).all()
        assert t.sum() == pytest.approx(1, abs=1e-12)
        np.testing.assert_allclose(t @ vectors(group, k)[:, 2:], [x, y], atol=3e-7)


@pytest.mark.parametrize(("group", "k"), PAIRS)
def test_the_commands_limit_is_reached_at_a_corner(group, k):
    limit = lib.ht_tmvcl_pu[group]
    corners = [duties(group, k, sx * limit, sy * limit) for sx in (1, -1) for sy in (1, -1)]
    assert np.min(corners) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("group", "k"), PAIRS)
def test_zero_command_gives_the_fixed_action_points(group, k):
    p = lib.ht_duty(group, k, {"x": 0, "y": 0})
    assert p.t1 == pytest.approx(2 - np.sqrt(3), rel=1e-7)
    assert p.t2 == pytest.approx(np.sqrt(3) - 1, rel=1e-7)


@pytest.mark.parametrize(("group", "k"), PAIRS)
def test_duties_are_those_of_paper_a_equation_13(group, k):
    """The printed form with cross products. K is 18 or 9 (2 - sqrt 3)."""
    (x1, y1), (x2, y2), (x3, y3) = vectors(group, k)[:, 2:]
    gain = 18 if group == lib.HT_L else 9 * (2 - np.sqrt(3))
    x, y = 0.011, -0.019
    t1 = gain * ((y2 - y3) * (x - x3) - (x2 - x3) * (y - y3))
    t2 = gain * (-(y1 - y3) * (x - x3) + (x1 - x3) * (y - y3))
    np.testing.assert_allclose(duties(group, k, x, y), [t1, t2, 1 - t1 - t2], atol=3e-7)


anything = st.one_of(
    st.floats(width=32), st.sampled_from([np.nan, np.inf, -np.inf, 3.4e38, -3.4e38, 0.05, -0.05])
)


@given(anything, anything)
@settings(max_examples=150, deadline=None)
def test_any_command_gives_ordered_action_points(x, y):
    for group, k in PAIRS:
        p = lib.ht_duty(group, k, {"x": x, "y": y})
        assert 0 <= p.t1 <= p.t2 <= 1


@given(unit, unit)
@settings(max_examples=60, deadline=None)
def test_outside_the_box_each_point_is_clamped(ux, uy):
    for group, k in PAIRS:
        x, y = np.float32(0.5 * ux), np.float32(0.5 * uy)
        matrix = np.vstack([vectors(group, k)[:, 2:].T, np.ones(3)])
        t = np.linalg.solve(matrix, [x, y, 1])
        first = min(max(t[0], 0), 1)
        second = min(max(t[0] + t[1], first), 1)
        p = lib.ht_duty(group, k, {"x": x, "y": y})
        np.testing.assert_allclose([p.t1, p.t2], [first, second], atol=3e-6)
