"""ht_speed is compared with a textbook PI with conditional integration. Its flux reference must be
bounded, monotone, and within reach of Vdc.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

KP, KI_TS, LIMIT = 0.4, 0.02, 15.0


def step(state, error, most=LIMIT, least=None):
    cfg = ffi.new("ht_speed_config *", [KP, KI_TS])
    return lib.ht_speed_step(cfg, state, error, -most if least is None else least, most)


def textbook(integral, error, limit):
    """(torque, new integral). The integral does not change if it would push further beyond a
    limit."""
    wanted = KP * error + integral
    torque = min(max(wanted, -limit), limit)
    at_limit = torque != wanted
    if not at_limit or np.sign(error) == -np.sign(wanted):
        integral = min(max(integral + KI_TS * error, -limit), limit)
    return torque, integral


@given(st.lists(st.floats(-300, 300, width=32), min_size=1, max_size=60))
@settings(max_examples=150, deadline=None)
def test_controller_agrees_with_the_textbook(errors):
    state = ffi.new("ht_speed_state *")
    for error in errors:
        before = state.integral_Nm
        torque, after = textbook(before, error, LIMIT)
        assert step(state, error) == pytest.approx(torque, abs=2e-5)
        if abs(abs(KP * error + before) - LIMIT) > 1e-4:  # otherwise rounding would decide
            assert state.integral_Nm == pytest.approx(after, abs=2e-5)
        assert abs(state.integral_Nm) <= LIMIT


def test_the_integral_does_not_wind_up():
    state = ffi.new("ht_speed_state *")
    for _ in range(10000):
        assert step(state, 100.0) == LIMIT
    assert state.integral_Nm == 0
    assert step(state, -1.0) == pytest.approx(-KP, rel=1e-6)


@pytest.mark.parametrize("error", (-1e-3, -0.01, -1.0))
def test_a_small_error_takes_the_integral_back_from_the_limit(error):
    """Not its product with the torque counts but the sense. An integral beyond the limit: the limit
    was lowered."""
    state = ffi.new("ht_speed_state *")
    state.integral_Nm = LIMIT + 1.0
    assert step(state, -error) == LIMIT
    assert state.integral_Nm == LIMIT + 1.0
    assert step(state, error) == LIMIT
    assert state.integral_Nm == LIMIT


def test_integral_fills_up_to_the_limit_and_comes_back():
    state = ffi.new("ht_speed_state *")
    for _ in range(10000):
        torque = step(state, 1.0)
    assert torque == pytest.approx(LIMIT, rel=0.01)
    assert LIMIT - KP - 2 * KI_TS < state.integral_Nm <= LIMIT
    for _ in range(100):
        torque = step(state, -1.0)
    assert torque < LIMIT - KP - KI_TS * 97


@pytest.mark.parametrize("sign", (1, -1))
def test_integral_comes_back_after_the_limit_was_lowered(sign):
    state = ffi.new("ht_speed_state *", [sign * LIMIT])
    for _ in range(2000):
        torque = step(state, -sign, 5.0)
        assert abs(torque) <= 5.0
    assert sign * torque < 0


@pytest.mark.parametrize(("error", "bound"), ((50.0, 7.0), (-50.0, -3.0)))
def test_each_sign_has_its_limit(error, bound):
    """The integral keeps to it, too: it comes back at the first error of the other sign."""
    state = ffi.new("ht_speed_state *")
    for _ in range(1000):
        assert step(state, error / 50, 7.0, -3.0) * np.sign(bound) <= abs(bound)
    assert step(state, error, 7.0, -3.0) == bound
    assert abs(state.integral_Nm) <= abs(bound)
    assert abs(step(state, -0.01 * error, 7.0, -3.0)) < abs(bound)


@given(st.floats(width=32), st.floats(-LIMIT, LIMIT, width=32))
@settings(max_examples=150, deadline=None)
def test_any_error_gives_a_torque_within_the_limit(error, integral):
    state = ffi.new("ht_speed_state *", [integral])
    assert abs(step(state, error)) <= LIMIT
    assert abs(state.integral_Nm) <= LIMIT


@pytest.mark.parametrize("error", (np.nan, np.inf, -np.inf))
def test_an_error_of_nan_gives_no_torque_and_is_not_stored(error):
    state = ffi.new("ht_speed_state *", [3.0])
    assert step(state, error) == 0
    assert state.integral_Nm == 3.0


# --- flux reference ----------------------------------------------------------

FLUX, FLUX_MIN, REACH, RS = 0.6, 0.1, 0.5196, 1.8


def flux(vdc, omega, i):
    return lib.ht_flux_reference([[FLUX_MIN, REACH, RS]], [[FLUX, vdc, omega, i]])


#: Physical values in steps of 1/8, so that nothing underflows.
speeds = st.integers(-40000, 40000).map(lambda n: n / 8)
voltages = st.integers(0, 4000).map(lambda n: n / 8)
amperes = st.integers(0, 400).map(lambda n: n / 8)


@given(voltages, speeds, amperes)
@settings(max_examples=examples(200), deadline=None)
def test_reference_is_the_largest_flux_within_reach(vdc, omega, i):
    got = flux(vdc, omega, i)
    room = REACH * vdc - RS * i
    want = min(FLUX, max(FLUX_MIN, room / abs(omega))) if omega else FLUX
    if omega or room >= 1e-3:
        assert got == pytest.approx(want, rel=1e-4)
    assert flux(vdc, -omega, i) == got


@given(voltages, speeds, amperes, st.floats(1, 3))
@settings(max_examples=examples(200), deadline=None)
def test_reference_is_monotone(vdc, omega, i, more):
    got = flux(vdc, omega, i)
    slack = 1 + 1e-6
    assert flux(vdc, omega * more, i) <= got * slack
    assert flux(vdc, omega, i * more) <= got * slack
    assert flux(vdc * more, omega, i) * slack >= got


@given(*[st.floats(width=32)] * 3)
@settings(max_examples=examples(200), deadline=None)
def test_reference_is_bounded_for_any_input(vdc, omega, i):
    assert np.float32(FLUX_MIN) <= flux(vdc, omega, i) <= np.float32(FLUX)


def test_full_flux_is_within_reach_up_to_the_base_speed():
    """With paper A's printed values, 250 V with 10 % margin is sufficient for 0.6 Wb up to 216
    rad/s."""
    assert flux(250.0, 216.0, 0.0) == np.float32(FLUX)
    assert flux(250.0, 433.0, 0.0) == pytest.approx(0.3, rel=1e-3)
