"""ht_xy_regulator is compared with two textbook PI controllers in complex numbers: one in the frame
e^{+j theta}, one in e^{-j theta}. Their outputs are added, and each axis is clipped.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

KP, KI_TS, LIMIT = 0.1, 2.5e-4, 0.0327
FRAMES = {"with": 1, "against": -1}


def fresh(values=(0j, 0j)):
    state = ffi.new("ht_xy_state *")
    lib.ht_xy_reset(state)
    for frame, value in zip(FRAMES, values, strict=True):
        pair = getattr(state, frame)
        pair.x, pair.y = value.real, value.imag
    return state


def integrators(state):
    pairs = (getattr(state, frame) for frame in FRAMES)
    return np.array([complex(p.x, p.y) for p in pairs])


def step(state, i, theta, *, hold=False, kp=KP, ki=KI_TS, limit=LIMIT):
    turn = {"alpha": np.cos(theta), "beta": np.sin(theta)}
    gains = [{"kp_pu_A": kp, "ki_ts_pu_A": ki}]
    out = lib.ht_xy_step(gains, state, {"x": i.real, "y": i.imag}, turn, limit, hold)
    return complex(out.x, out.y)


def clip(z, limit):
    return complex(np.clip(z.real, -limit, limit), np.clip(z.imag, -limit, limit))


def two_controllers(integral, i, theta, *, hold=False, kp=KP, ki=KI_TS, limit=LIMIT):
    """(output, new integrators, output before the clip)."""
    to_frame = np.exp(-1j * theta * np.array(list(FRAMES.values())))
    error = -i
    full = np.sum((kp * error * to_frame + integral) / to_frame)
    out = clip(full, limit)
    if hold:
        return out, integral, full
    for axis in (1, 1j):  # an axis at its limit integrates only errors that lead away from it
        part = (full * axis.conjugate()).real, (error * axis.conjugate()).real
        if abs(part[0]) > limit and part[0] * part[1] > 0:
            error -= part[1] * axis
    return out, np.array([clip(z, limit) for z in integral + ki * error * to_frame]), full


currents = st.tuples(*[st.floats(-2, 2, width=32)] * 2).map(lambda p: complex(*p))
units = st.tuples(*[st.floats(-1, 1)] * 2).map(lambda p: LIMIT * complex(*p))
angles = st.floats(-7, 7)


@given(units, units, currents, angles, st.booleans(), st.floats(0, 0.2), st.floats(0, 1e-2))
@settings(max_examples=examples(400), deadline=None)
def test_one_step_agrees_with_two_complex_pi_controllers(with_, against, i, theta, hold, kp, ki):
    state = fresh((with_, against))
    before = integrators(state)
    options = {"hold": hold, "kp": kp, "ki": ki}
    out, after, full = two_controllers(before, i, theta, **options)
    assert step(state, i, theta, **options) == pytest.approx(out, abs=1e-6)
    on_the_edge = min(abs(abs(full.real) - LIMIT), abs(abs(full.imag) - LIMIT)) < 1e-6
    if not on_the_edge:
        np.testing.assert_allclose(integrators(state), after, atol=1e-7)


@given(st.lists(st.tuples(currents, angles), min_size=5, max_size=60))
@settings(max_examples=60, deadline=None)
def test_output_and_integrators_stay_within_the_limit(samples):
    state = fresh()
    for i, theta in samples:
        out = step(state, i, theta, ki=0.05)
        every = np.array([out, *integrators(state)])
        assert np.abs([every.real, every.imag]).max() <= np.float32(LIMIT)


def test_hold_freezes_the_integrators():
    state = fresh((0.01 + 0.02j, -0.003j))
    before = integrators(state)
    for n in range(20):
        step(state, 0.3 - 0.1j, 0.1 * n, hold=True)
    assert (integrators(state) == before).all()
    step(state, 0.03 - 0.01j, 0.0)
    assert (integrators(state) != before).all()


def test_reset_clears_the_integrators():
    state = fresh((1 + 1j, 2 + 2j))
    lib.ht_xy_reset(state)
    assert not integrators(state).any()


def disturbed(sequence, ki):
    """The state and the current that remains. The plane has R and L, and a disturbance of 2 V at
    250 V that turns with the flux or against it."""
    r, length, ts, omega = 1.8, 0.01, 1e-4, 60.0
    state, i, seen = fresh(), 0j, []
    for n in range(6000):
        theta = omega * ts * n
        v = 250.0 * step(state, i, theta, kp=0.02, ki=ki) + 2 * np.exp(1j * sequence * theta)
        i += ts / length * (v - r * i)
        seen.append(abs(i))
    return state, np.mean(seen[-500:])


@pytest.mark.parametrize("sequence", (1, -1))
def test_each_frame_removes_its_own_sequence(sequence):
    """Without integrators a current remains. With integrators it decays."""
    _, without_A = disturbed(sequence, 0.0)
    state, remaining_A = disturbed(sequence, 2.5e-3)
    assert without_A > 0.1
    assert remaining_A < 0.01 * without_A
    strong, weak = integrators(state)[::sequence]
    assert abs(strong) == pytest.approx(2 / 250.0, rel=0.05)
    assert abs(weak) < 0.1 * abs(strong)


def test_the_integrators_do_not_wind_up():
    """After a long error that saturates the output, nothing delays its return."""
    state = fresh()
    for _ in range(5000):
        out = step(state, 1.0 + 1.0j, 0.0)
    assert out == pytest.approx(-LIMIT * (1 + 1j), rel=1e-6)
    assert np.abs(integrators(state).sum()) < 0.1 * LIMIT  # the P part alone saturates
    assert step(state, -0.05 - 0.05j, 0.0).real > 0


@given(st.sampled_from(["i", "turn", "both"]), st.sampled_from([np.nan, np.inf, -np.inf, 3e38]))
@settings(max_examples=20, deadline=None)
def test_bad_input_gives_an_output_within_the_limits(where, bad):
    state = fresh()
    i = [bad, 0.1] if where != "turn" else [0.1, 0.1]
    turn = [bad, 0.0] if where != "i" else [1.0, 0.0]
    for _ in range(3):
        out = lib.ht_xy_step([[KP, KI_TS]], state, i, turn, LIMIT, False)
        for value in (out.x, out.y, *integrators(state).real, *integrators(state).imag):
            assert -np.float32(LIMIT) <= value <= np.float32(LIMIT)
    for _ in range(2000):  # the state must recover
        out = step(state, 0.2 + 0.2j, 0.0, ki=1e-2)
    assert out == pytest.approx(-LIMIT * (1 + 1j), rel=1e-6)
