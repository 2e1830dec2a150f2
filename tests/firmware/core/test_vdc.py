"""The limits of the dc link: power into the link ends at the upper level, power out of it at the
lower one."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

HIGH, LOW, BAND, LIMIT, KP = 320.0, 200.0, 15.0, 12.0, 0.4
#: Share of the limit that drives the shaft to lower the voltage.
PUSH = 0.3


def config(high_V=HIGH, low_V=LOW):
    above = high_V - BAND if high_V else 1e9
    below = low_V + BAND if low_V else -1e9
    return ffi.new("ht_vdc_config *", [high_V, low_V, above, below, 1 / BAND, KP])


def torque(wanted, omega, vdc_V, began=None, **levels):
    began = abs(omega) if began is None else began
    return lib.ht_vdc_torque_Nm(config(**levels), wanted, LIMIT, omega, began, vdc_V)


@pytest.mark.parametrize("omega", (-100.0, 100.0))
def test_power_into_the_link_ends_at_the_upper_level(omega):
    braking = -LIMIT * np.sign(omega)
    assert torque(braking, omega, HIGH - BAND) == braking
    assert torque(braking, omega, HIGH - 0.5 * BAND) == pytest.approx(0.5 * braking)
    assert torque(braking, omega, HIGH) == pytest.approx(0, abs=1e-5)
    # Beyond it takes energy out, but not more than the share that a table's error needs.
    for beyond in (BAND, 10 * BAND):
        assert torque(braking, omega, HIGH + beyond) == pytest.approx(-PUSH * braking)


def test_the_page_states_the_share():
    page = Path(__file__).parents[3] / "docs/protection.md"
    assert f"with {PUSH:g} of the limit" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("omega", (-100.0, -0.1, 0.0, 0.1, 100.0))
@pytest.mark.parametrize("beyond_V", (0.1, BAND, 500.0))
def test_a_shaft_is_pushed_to_no_more_than_a_tenth_above_its_speed(omega, beyond_V):
    for wanted in (-LIMIT * np.sign(omega), 0.0):
        for began in (0.9 * abs(omega), 0.0, float("nan")):
            assert torque(wanted, omega, HIGH + beyond_V, began=began) == 0
        # Near it the push falls with the speed regulator's gain.
        near = torque(wanted, omega, HIGH + beyond_V, began=abs(omega) / 1.099)
        assert abs(near) <= KP * abs(omega) * (1.1 / 1.099 - 1) * (1 + 1e-3)
    driving = LIMIT * (np.sign(omega) or 1)
    assert torque(driving, omega, HIGH + beyond_V, began=0.0) == driving


@pytest.mark.parametrize("omega", (-100.0, 100.0))
def test_power_out_of_the_link_ends_at_the_lower_level_and_the_shaft_feeds_it_below(omega):
    driving = LIMIT * np.sign(omega)
    assert torque(driving, omega, LOW + BAND) == driving
    assert torque(driving, omega, LOW + 0.5 * BAND) == pytest.approx(0.5 * driving)
    assert torque(driving, omega, LOW) == pytest.approx(0, abs=1e-5)
    assert torque(driving, omega, LOW - 0.5 * BAND) == pytest.approx(-0.5 * driving)
    assert torque(driving, omega, LOW - 2 * BAND) == pytest.approx(-driving)


@pytest.mark.parametrize("omega", (-5.0, -0.01, 0.0, 0.01, 5.0))
def test_a_slow_shaft_is_braked_no_harder_than_to_standstill(omega):
    for wanted in (-LIMIT, 0.0, LIMIT):
        found = torque(wanted, omega, LOW - BAND)
        # What drives the shaft would take power; what brakes it may stay as the reference has it.
        assert found * np.sign(omega) <= 1e-6 or omega == 0
        if wanted * (omega or 1.0) >= 0:
            assert abs(found) <= KP * abs(omega) + 1e-6


@given(
    st.floats(-LIMIT, LIMIT, width=32),
    st.floats(-400, 400, width=32),
    st.floats(LOW + BAND + 0.5, HIGH - BAND - 0.5, width=32),
)
@settings(max_examples=200, deadline=None)
def test_nothing_is_limited_between_the_levels(wanted, omega, vdc_V):
    assert torque(wanted, omega, vdc_V) == wanted


@given(
    st.floats(-LIMIT, LIMIT, width=32),
    st.floats(-400, 400, width=32),
    st.floats(0, 600, width=32),
)
@settings(max_examples=300, deadline=None)
def test_the_torque_stays_within_its_limit_and_never_goes_the_wrong_way(wanted, omega, vdc_V):
    found = torque(wanted, omega, vdc_V)
    assert abs(found) <= LIMIT * (1 + 1e-6)
    power = (found - wanted) * (-1 if omega < 0 else 1)  # of the change, over the speed's size
    assert power >= 0 if vdc_V > HIGH - BAND else power <= 0 or vdc_V >= LOW + BAND


@pytest.mark.parametrize("vdc_V", (0.0, 150.0, 250.0, 400.0, float("nan")))
def test_levels_of_0_limit_nothing(vdc_V):
    for wanted in (-LIMIT, 3.0):
        assert torque(wanted, 100.0, vdc_V, high_V=0.0, low_V=0.0) == wanted
