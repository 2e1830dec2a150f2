"""The ramp of the speed reference against the kinematics that it promises: rate and jerk within
their limits, arrival without overshoot, and the least time that these limits allow."""

import math

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

speeds = st.integers(-48000, 48000).map(lambda n: n / 8)
rates = st.integers(8, 800).map(lambda n: n / 8)  # of a period
#: Ten steps of a float32 at 6000.
SLACK = 10 * float(np.spacing(np.float32(6000)))
jerks = st.integers(1, 400).map(lambda n: n / 8)


def ramped(config, start, target, slope=0.0, most=200000):
    """The reference from `start` on, period by period, until it has arrived."""
    cfg = ffi.new("ht_ramp_config *", config)
    state = ffi.new("ht_ramp_state *", [start, slope])
    way = [start]
    while way[-1] != target:
        way.append(lib.ht_ramp_step(cfg, state, target, way[-1], False))
        assert len(way) < most, "it does not arrive"
    return np.array(way)


@given(speeds, speeds)
@settings(max_examples=examples(100), deadline=None)
def test_without_rates_the_target_is_there_at_once(start, target):
    assert len(ramped([0, 0, 0], start, target)) == (1 if start == target else 2)
    assert len(ramped([0, 0, 1.0], start, target)) == (1 if start == target else 2)


@given(speeds, speeds, rates, rates)
@settings(max_examples=examples(100), deadline=None)
def test_the_size_grows_and_falls_at_its_own_rate(start, target, up, down):
    way = ramped([up, down, 0], start, target)
    size = np.diff(np.abs(way))
    assert size.max(initial=0) <= up + SLACK and size.min(initial=0) >= -down - SLACK
    if start * target < 0:  # through 0
        least = math.ceil(abs(start) / down) + math.ceil(abs(target) / up)
    else:
        grows = abs(target) > abs(start)
        least = math.ceil(abs(target - start) / (up if grows else down))
    assert len(way) - 1 <= least + 1


@given(speeds, speeds, rates, jerks)
@settings(max_examples=examples(100), deadline=None)
def test_rate_and_jerk_hold_and_nothing_overshoots(start, target, rate, jerk):
    way = ramped([rate, rate, jerk], start, target)
    step = np.diff(way)
    assert np.abs(step).max(initial=0) <= rate + SLACK
    assert np.abs(np.diff(step, prepend=0.0, append=0.0)).max(initial=0) <= jerk + SLACK
    assert way.min() >= min(start, target) - SLACK and way.max() <= max(start, target) + SLACK


@given(speeds, speeds, rates, jerks)
@settings(max_examples=examples(100), deadline=None)
def test_the_way_takes_the_least_time_of_its_limits(start, target, rate, jerk):
    """The trapezium of speed over time: way/rate + rate/jerk; the triangle if the way is short."""
    way = abs(target - start)
    long = way * jerk >= rate * rate
    least = way / rate + rate / jerk if long else 2 * math.sqrt(way / jerk)
    taken = len(ramped([rate, rate, jerk], start, target)) - 1
    # A period at each corner of the slope, and the last steps, each up to a jerk long.
    assert least - 2 <= taken <= 1.02 * least + 6


@pytest.mark.parametrize(
    ("start", "rate", "jerk"), ((-3874.875, 22.0, 4.75), (1813.75, 73.0, 31.0))
)
def test_a_stop_reaches_0_exactly(start, rate, jerk):
    """With a rounded last change these two came ever nearer to 0 and never there, so that a stop
    ended at its deadline only."""
    assert len(ramped([rate, rate, jerk], start, 0.0)) < 1000


@pytest.mark.parametrize("jerk", (0.125, 0.25))
def test_many_small_changes_end_at_the_target(jerk):
    """Rounding took the last change beyond the jerk, and the speed 13 steps of a float32 beyond
    5350.875."""
    way = ramped([21.25, 21.25, jerk], 0.0, 5350.875)
    assert way.max() <= 5350.875 + SLACK


@given(speeds, speeds, speeds, rates, jerks, st.integers(1, 60))
@settings(max_examples=examples(100), deadline=None)
def test_a_new_target_on_the_way_breaks_no_limit(start, first, then, rate, jerk, after):
    cfg = ffi.new("ht_ramp_config *", [rate, rate, jerk])
    state = ffi.new("ht_ramp_state *", [start, 0.0])
    way = [start]
    for n in range(4000):
        way.append(lib.ht_ramp_step(cfg, state, first if n < after else then, way[-1], False))
    step = np.diff(way)
    assert np.abs(step).max() <= rate + SLACK
    assert np.abs(np.diff(step, prepend=0.0)).max() <= jerk + SLACK


@pytest.mark.parametrize("jerk", (0.0, 0.5))
@pytest.mark.parametrize("sign", (1, -1))
def test_a_drive_that_cannot_follow_holds_the_reference(sign, jerk):
    cfg = ffi.new("ht_ramp_config *", [10.0, 10.0, jerk])
    state = ffi.new("ht_ramp_state *", [sign * 500.0, 0.0])
    held = [lib.ht_ramp_step(cfg, state, sign * 1000.0, sign * 400.0, True) for _ in range(50)]
    assert set(held) == {sign * 500.0}
    # It comes back towards the measured speed all the same.
    back = lib.ht_ramp_step(cfg, state, sign * 100.0, sign * 400.0, True)
    assert abs(back) < 500.0
    # And goes on when the drive can follow.
    assert abs(lib.ht_ramp_step(cfg, state, sign * 1000.0, sign * 400.0, False)) > abs(back) - 1.0


@pytest.mark.parametrize("target", (math.nan, math.inf, -math.inf))
@pytest.mark.parametrize("config", ([0, 0, 0], [10, 10, 0], [10, 10, 1]))
def test_a_target_that_is_no_number_leaves_the_reference(config, target):
    state = ffi.new("ht_ramp_state *", [100.0, 0.0])
    cfg = ffi.new("ht_ramp_config *", config)
    assert lib.ht_ramp_step(cfg, state, target, 100.0, False) == 100.0
    assert state.speed_rpm == 100.0


def test_without_a_rate_downwards_the_speed_is_0_at_once_and_rises_at_its_rate():
    way = ramped([10.0, 0.0, 0.0], 100.0, -100.0)
    assert way[1] == 0.0
    assert np.diff(way[1:]) == pytest.approx([-10.0] * 10)
    assert ramped([0.0, 0.0, 0.0], 100.0, -100.0)[1] == -100.0


@pytest.mark.parametrize("jerk", [1e-6, 1e-38])
def test_where_the_jerk_counts_as_none_the_rate_holds(jerk):
    """So many changes do not fit into a way of any speed. The slope stays, within a jerk of it."""
    cfg = ffi.new("ht_ramp_config *", [2.0, 2.0, jerk])
    state = ffi.new("ht_ramp_state *", [0.0, 2.0])
    assert lib.ht_ramp_step(cfg, state, 6000.0, 0.0, False) == 2.0
    assert state.slope_rpm == 2.0
