"""ht_speed_measure is compared with an encoder that turns at a known speed. The tests compute the
resolution of each method: one count in a slow period, one tick of the capture clock in a unit
period.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

COUNTS_REV, SLOW_HZ, CLOCK_HZ, SWITCH = 8192, 100, 150e6 / 128, 150.0
COUNT = 60 * SLOW_HZ / COUNTS_REV  # r/min of one count in a slow period
TICKS = 60 * 4 * CLOCK_HZ / COUNTS_REV  # r/min times ticks of four counts

#: Sequences of readings have small and large numbers, and sometimes an overflow or a reversal.
words = st.integers(0, 60) | st.integers(0, 65535)
counts = st.integers(-6, 6) | st.integers(-300, 300) | st.integers(-(2**31), 2**31 - 1)
seldom = st.sampled_from([False] * 7 + [True])
often = st.sampled_from([True] * 7 + [False])
looks = st.tuples(counts, words, words, often, seldom, seldom, st.booleans())


class Measure:
    def __init__(self, switch=SWITCH):
        self.config = ffi.new("ht_speed_measure_config *", [COUNT, TICKS, switch])
        self.state = ffi.new("ht_speed_measure_state *")
        lib.ht_speed_measure_reset(self.state)

    def step(self, moved, period=0, age=0, event=False, overflow=False, reversed=False,
             forward=True):  # fmt: skip
        look = ffi.new("ht_capture *", [period, age, event, overflow, reversed, forward])
        return lib.ht_speed_measure_step(self.config, self.state, moved, look)

    def steady(self, rpm, looks=4):
        """Readings at constant speed. Each of them sees an event."""
        moved = round(rpm / COUNT)
        period = min(65535, int(TICKS / abs(rpm)))
        return [self.step(moved, period, 0, True, forward=rpm > 0) for _ in range(looks)]


@given(st.lists(looks, min_size=1, max_size=20), st.sampled_from([0.0, 1e-3, SWITCH, 30000.0]))
@settings(max_examples=examples(300), deadline=None)
def test_any_registers_give_a_speed_that_the_counts_allow(sequence, switch):
    """The speed is finite, never opposite to the counts, and never more than one count away from
    them."""
    measure = Measure(switch)
    for moved, *registers in sequence:
        got = measure.step(moved, *registers)
        assert np.isfinite(got)
        assert abs(got - moved * COUNT) <= COUNT + 1e-6 * abs(moved) * COUNT
        assert got * moved >= 0


@given(st.lists(looks, min_size=1, max_size=20))
@settings(max_examples=100, deadline=None)
def test_an_edge_that_never_comes_gives_zero_speed(sequence):
    measure = Measure(0.0)
    for moved, *registers in sequence:
        assert measure.step(moved, *registers) == pytest.approx(moved * COUNT, rel=1e-6)


@pytest.mark.parametrize("moved", (-(2**31), 2**31 - 1))
def test_the_largest_count_differences_give_the_right_speed(moved):
    assert Measure().step(moved) == pytest.approx(moved * COUNT, rel=1e-6)


@pytest.mark.parametrize("sign", (1, -1))
@pytest.mark.parametrize("rpm", (0.6, 3.0, 30.0, 100.0, 149.0))
def test_time_per_edge_is_used_below_the_switch_over(rpm, sign):
    readings = Measure().steady(sign * rpm)
    assert readings[-1] == pytest.approx(sign * rpm, rel=1.5 * rpm / TICKS)


@pytest.mark.parametrize("sign", (1, -1))
@pytest.mark.parametrize("rpm", (190.0, 1000.0, 6000.0))
def test_edges_per_time_is_used_above_the_switch_over(rpm, sign):
    """The captured period is deliberately wrong by a third. This must have no effect."""
    measure = Measure()
    moved = sign * round(rpm / COUNT)
    for _ in range(4):
        got = measure.step(moved, int(1.5 * TICKS / rpm), 0, True, forward=sign > 0)
    assert got == pytest.approx(moved * COUNT, rel=1e-6)


def test_the_transition_between_both_methods_is_smooth():
    """The captured period is 10 % too long. Up to 150 r/min the reading is one count low (a larger
    difference is not accepted). From 187.5 r/min on it is exact. In between it changes without a
    step."""
    readings = []
    for moved in range(190, 265):
        measure = Measure()
        for _ in range(4):
            got = measure.step(moved, int(1.1 * TICKS / (moved * COUNT)), 0, True)
        readings.append(got / COUNT - moved)
    assert readings[0] == pytest.approx(-1, abs=0.01)
    assert readings[-1] == pytest.approx(0, abs=1e-4)
    assert np.diff(readings).min() > -1e-4
    assert np.diff(readings).max() < 0.03  # a count over 51 steps
    middle = np.interp(168.75, np.arange(190, 265) * COUNT, readings)
    assert middle == pytest.approx(-0.5, abs=0.01)


def test_the_speed_decays_with_the_time_since_the_last_event():
    measure = Measure()
    measure.steady(30.0)
    last = 30.0
    for age in range(3000, 65536, 6000):
        got = measure.step(0, 1144, age)
        assert 0 < got <= min(last, TICKS / age) * (1 + 1e-6)
        last = got
    assert measure.step(0, 1144, 100, overflow=True) == 0
    # The timer has wrapped, so the earlier period is not used any more.
    for age in range(6000, 65536, 12000):
        assert measure.step(0, 1144, age) == 0


@pytest.mark.parametrize("disturbance", ("reversed", "overflow"))
def test_the_interval_of_a_reversal_or_an_overflow_is_not_used(disturbance):
    """The interval in which a reversal or an overflow occurs ends with the next event. Its time (a
    wrong value here) is not that of four edges."""
    measure = Measure()
    measure.steady(3.0)
    assert measure.step(4, 9, 0, True, **{disturbance: True}) == pytest.approx(4 * COUNT)
    assert measure.step(4, 9, 0, False) == pytest.approx(4 * COUNT)  # no event yet
    assert measure.step(4, 9, 0, True) == pytest.approx(4 * COUNT)  # ends the bad one
    assert measure.step(4, int(TICKS / 3), 0, True) == pytest.approx(3.0, rel=1e-3)


def test_a_fast_sample_contains_two_events():
    measure = Measure()
    measure.step(40, 9, 0, True, reversed=True)
    assert measure.step(41, int(TICKS / 30), 0, True) == pytest.approx(30.0, rel=2e-3)


@pytest.mark.parametrize("sign", (1, -1))
def test_twelve_counts_contain_two_unit_events_of_four_and_eleven_may_not(sign):
    """After a reversal the first event ends an interval that is not to be used."""
    for counts, used in ((13, True), (12, True), (11, False)):
        rpm = (counts - 0.3) * COUNT
        measure = Measure()
        measure.step(sign * counts, 9, 0, True, reversed=True, forward=sign > 0)
        got = measure.step(sign * counts, int(TICKS / rpm), 0, True, forward=sign > 0)
        assert got == pytest.approx(sign * (rpm if used else counts * COUNT), rel=1e-3)


def test_direction_that_contradicts_the_counts_is_a_reversal():
    measure = Measure()
    measure.steady(3.0)
    assert measure.step(-4, int(TICKS / 3), 0, True, forward=True) == pytest.approx(-4 * COUNT)
    assert measure.step(-4, 9, 0, True, forward=False) == pytest.approx(-4 * COUNT)


def test_no_period_before_two_events_have_been_seen():
    measure = Measure()
    assert measure.step(4, 9, 0, True) == pytest.approx(4 * COUNT)
    assert measure.step(4, int(TICKS / 3), 0, True) == pytest.approx(3.0, rel=1e-3)


def test_a_period_too_short_for_the_counts_is_not_used():
    measure = Measure()
    measure.steady(3.0)
    assert measure.step(4, 9, 0, True) == pytest.approx(5 * COUNT)


def test_a_time_of_zero_is_no_speed():
    """Registers of zero contain no time between edges."""
    measure = Measure()
    measure.steady(3.0)
    assert measure.step(4, 0, 0, True) == pytest.approx(4 * COUNT)
