"""ht_comparator is compared with state machines that are written as the papers draw them: a list of
levels, each of which is left upwards or downwards at its own threshold.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hexatorque.firmware import lib


def settle(level, error, up, down):
    """Walk through the levels. The next higher level is entered at an error >= up[level], the next
    lower one at an error <= down[level]."""
    while True:
        if level in up and error >= up[level]:
            level += 1
        elif level in down and error <= down[level]:
            level -= 1
        else:
            return level


def textbook_three(level, error, band, release):
    up = {0: band, -1: -release}
    return settle(level, error, up, {-u: -e for u, e in up.items()})


def textbook_five(level, error, inner, outer):
    up = {0: inner, 1: outer, -1: 0.0, -2: -inner}
    return settle(level, error, up, {-u: -e for u, e in up.items()})


def f32(value):
    return float(np.float32(value))


def near(value):
    """A threshold, its neighbours and its mirror."""
    v = np.float32(value)
    around = [v, np.nextafter(v, np.float32(np.inf)), np.nextafter(v, np.float32(-np.inf))]
    return [s * float(a) for a in around for s in (1, -1)]


def errors_around(draw, *thresholds):
    """Any errors. The exact thresholds are drawn often."""
    pool = [e for t in thresholds for e in near(t)] + [0.0, np.inf, -np.inf]
    wide = st.floats(-30, 30, width=32)
    return draw(st.lists(st.one_of(st.sampled_from(pool), wide), min_size=1, max_size=25))


bands = st.floats(2**-10, 10, width=32)
budget = settings(max_examples=120, deadline=None)


@given(st.data(), bands)
@budget
def test_two_level_comparator_follows_its_thresholds(data, band):
    level = data.draw(st.sampled_from([0, 1]))
    for error in errors_around(data.draw, band):
        got = lib.ht_compare_two_level(level, error, band, 0, 1)
        level = 1 if error > band else 0 if error < -band else level
        assert got == level


@given(st.data(), bands, st.floats(-1, 1, width=32))
@budget
def test_three_level_comparator_follows_its_thresholds(data, band, share):
    """The release is below the reference, at it, or beyond it."""
    release = f32(share * band)
    assume(-band < release < band)
    level = data.draw(st.sampled_from([-1, 0, 1]))
    for error in errors_around(data.draw, band, release):
        got = lib.ht_compare_three_level(level, error, band, release)
        level = textbook_three(level, error, band, release)
        assert got == level, (error, band, release)


@given(st.data(), bands, st.floats(2**-10, 1, width=32))
@budget
def test_five_level_comparator_follows_its_thresholds(data, outer, share):
    inner = f32(share * outer)
    assume(0 < inner < outer)
    level = data.draw(st.sampled_from([-2, -1, 0, 1, 2]))
    for error in errors_around(data.draw, inner, outer):
        got = lib.ht_compare_five_level(level, error, inner, outer)
        level = textbook_five(level, error, inner, outer)
        assert got == level, (error, inner, outer)


@given(st.data(), bands, st.floats(2**-10, 1, width=32))
@budget
def test_the_opposite_error_gives_the_opposite_level(data, band, share):
    inner = f32(share * band)
    for error in errors_around(data.draw, band, inner):
        for last in (-2, -1, 0, 1, 2):
            five = lib.ht_compare_five_level(last, error, inner, band)
            assert lib.ht_compare_five_level(-last, -error, inner, band) == -five
            if abs(last) < 2:
                three = lib.ht_compare_three_level(last, error, band, inner / 2)
                assert lib.ht_compare_three_level(-last, -error, band, inner / 2) == -three
                two = lib.ht_compare_two_level(last, error, band, -1, 1)
                assert lib.ht_compare_two_level(-last, -error, band, -1, 1) == -two


def test_an_error_of_nan_keeps_the_level():
    nan = float("nan")
    for last in (-2, -1, 0, 1, 2):
        assert lib.ht_compare_two_level(last, nan, 1, -1, 1) == last
        kept = max(-1, min(1, last))  # of three levels: +-2 counts as +-1 whatever the error is
        assert lib.ht_compare_three_level(last, nan, 1, 0) == kept
        assert lib.ht_compare_five_level(last, nan, 0.5, 1) == last


def switching_points():
    """Where each comparator switches, by its number of levels. The error is a slow triangle in
    hundredths."""
    switched = {2: [], 3: [], 5: []}
    level = {2: -1, 3: 0, 5: 0}
    sweep = [*range(0, 150), *range(150, -150, -1), *range(-150, 150)]
    for n in sweep:
        new = {
            2: lib.ht_compare_two_level(level[2], n, 100, -1, 1),
            3: lib.ht_compare_three_level(level[3], n, 100, 25),
            5: lib.ht_compare_five_level(level[5], n, 50, 100),
        }
        for kind, value in new.items():
            if value != level[kind]:
                switched[kind].append((n, value))
        level = new
    return switched


def test_sweep_up_and_down_shows_the_bands():
    switched = switching_points()
    assert switched[2] == [(101, 1), (-101, -1), (101, 1)]
    assert switched[3] == [(100, 1), (25, 0), (-100, -1), (-25, 0), (100, 1)]
    assert switched[5] == [
        *[(50, 1), (100, 2), (50, 1), (0, 0), (-50, -1), (-100, -2)],
        *[(-50, -1), (0, 0), (50, 1), (100, 2)],
    ]


@pytest.mark.parametrize("sign", [1, -1])
def test_three_levels_take_over_from_five(sign):
    """If the comparator is exchanged while the drive runs, level +-2 counts as +-1."""
    assert lib.ht_compare_three_level(2 * sign, sign * 0.2, 0.3, 0.0) == sign
    assert lib.ht_compare_three_level(2 * sign, -sign * 0.2, 0.3, 0.0) == 0
