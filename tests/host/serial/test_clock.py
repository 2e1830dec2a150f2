"""When a sample was taken, from the board's tick and this computer's clock, and the uncertainty of
that time. The uncertainty is checked with known clocks."""

from datetime import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque.serial.clock import OSCILLATOR, ROUNDING_S, Clock, Reading

F_ISR_HZ = 10e3
NOW_S = 1_795_000_000.25


def wall_s(when: dict) -> float:
    stamp = datetime.fromisoformat(when["started"])
    assert stamp.utcoffset() is not None  # says its zone
    return stamp.timestamp()


@given(
    tick=st.integers(0, 2**32 - 1),
    age=st.integers(-(10**6), 10**8),
    drift=st.floats(-OSCILLATOR, OSCILLATOR),
    asked_s=st.floats(1e-4, 0.5),
    place=st.floats(0, 1),
)
def test_the_time_of_a_tick_is_within_the_stated_uncertainty(tick, age, drift, asked_s, place):
    """The board took its tick anywhere between request and reply, and its oscillator is off."""
    true_s = NOW_S - asked_s + place * asked_s  # when the board had the tick of its reply
    reading = Reading(tick, NOW_S - asked_s / 2, asked_s / 2)
    sampled_s = true_s - age / (F_ISR_HZ * (1 + drift))
    when = Clock(F_ISR_HZ, reading).when((tick - age) % 2**32)
    bound_s = when["started_uncertainty_s"]
    assert abs(wall_s(when) - sampled_s) <= 1.05 * bound_s  # told with two digits
    assert bound_s <= 1.06 * (asked_s / 2 + 1.001 * OSCILLATOR * abs(age) / F_ISR_HZ + ROUNDING_S)


def test_time_zero_may_differ_from_the_known_tick():
    """A capture whose 200th sample is the trigger, or a recording that begins at -0.5 s."""
    clock = Clock(F_ISR_HZ, Reading(5000, NOW_S, 0.001))
    assert wall_s(clock.when(4000)) == pytest.approx(NOW_S - 0.1, abs=0.001)
    assert wall_s(clock.when(4000, time_s=-0.5)) == pytest.approx(NOW_S + 0.4, abs=0.001)


@pytest.mark.parametrize("factor", [0.5, 0.95, 5.0])
def test_a_board_at_a_wrong_rate_has_a_wider_bound(factor):
    """A virtual board at another speed: the time is wrong, but within the stated uncertainty."""
    armed = Reading(1000, NOW_S - 4, 0.001)
    now = Reading(1000 + round(4 * factor * F_ISR_HZ), NOW_S, 0.001)
    trigger = now.tick - round(2 * factor * F_ISR_HZ)  # truly two seconds ago
    when = Clock(F_ISR_HZ, now, armed).when(trigger)
    assert abs(wall_s(when) - (NOW_S - 2)) <= 1.05 * when["started_uncertainty_s"]


def test_a_board_at_the_right_rate_has_the_narrow_bound():
    hour = Reading(1000, NOW_S - 3600, 0.002)
    now = Reading(1000 + round(3600 * F_ISR_HZ * (1 + 50e-6)), NOW_S, 0.002)
    when = Clock(F_ISR_HZ, now, hour).when(now.tick - 5000)
    assert when["started_uncertainty_s"] <= 0.003
