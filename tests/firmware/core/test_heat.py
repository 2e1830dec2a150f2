"""The thermal model: against scipy's solution of its equations, and what a float makes of it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hexatorque.firmware import Controller, ffi, lib

COPPER = 0.00393
MACHINE = {
    "rs_ohm": 1.8, "rs_degC": 25.0, "ambient_degC": 30.0,
    "winding_K_W": 0.4, "winding_s": 45.0, "frame_K_W": 0.25, "frame_s": 900.0,
}  # fmt: skip


@pytest.fixture
def make():
    """Configuration and state of the firmware with these parameters."""
    kept = []

    def made(**values):
        kept.append(Controller("f28377s", MACHINE | values))
        state = ffi.new("ht_heat_state *")
        lib.ht_heat_reset(state)
        return ffi.addressof(kept[-1].drive.config.heat), state

    return made


def reference(values, squares, frame_W, seconds):
    """(n, 7) degC at the seconds, with these squared currents on the legs. The equations are those
    of the module's header, written with its thermal capacities."""
    v = MACHINE | values
    part_K_W = 6 * v["winding_K_W"]
    part_J_K = v["winding_s"] / part_K_W
    frame_J_K = v["frame_s"] / v["frame_K_W"]
    at_20 = v["rs_ohm"] / (1 + COPPER * (v["rs_degC"] - 20))

    def slopes(_, degC):
        loss = at_20 * (1 + COPPER * (degC[:6] - 20)) * squares
        flow = (degC[:6] - degC[6]) / part_K_W
        out = (degC[6] - v["ambient_degC"]) / v["frame_K_W"]
        return np.append((loss - flow) / part_J_K, (flow.sum() + frame_W - out) / frame_J_K)

    begin = np.full(7, v["ambient_degC"])
    span = (0, seconds[-1])
    return solve_ivp(slopes, span, begin, "Radau", t_eval=seconds, rtol=1e-8).y.T


def temperatures(cfg, state):
    return np.append(np.array(list(state.rise_K)), state.frame_rise_K) + cfg.ambient_degC


def follow(cfg, state, squares, frame_W, steps, powered=True):
    """Whole steps. In each the means of all its slow interrupts count."""
    for leg in range(6):
        state.square_A2[leg] = squares[leg]
    for _ in range(steps * round(cfg.steps)):
        lib.ht_heat_step(cfg, state, powered, frame_W)


@pytest.mark.parametrize("seed", range(4))
def test_temperatures_are_those_of_the_equations(make, seed):
    rng = np.random.default_rng(seed)
    values = {
        "winding_s": float(rng.uniform(5, 60)), "frame_s": float(rng.uniform(300, 900)),
        "winding_K_W": float(rng.uniform(0.1, 0.5)), "frame_K_W": float(rng.uniform(0.05, 0.3)),
    }  # fmt: skip
    cfg, state = make(**values)
    squares, frame_W = rng.uniform(0, 40, 6), 40.0
    step_s = cfg.steps / 100.0
    seconds, found = [], []
    for k in range(1, 41):
        follow(cfg, state, squares, frame_W, 10)
        seconds.append(10 * k * step_s)
        found.append(temperatures(cfg, state))
    expected = reference(values, squares, frame_W, seconds)
    rises = expected[-1] - MACHINE["ambient_degC"]
    assert rises[:6].max() > 15
    assert np.abs(np.array(found) - expected).max() < 0.02 * rises.max()
    hottest = lib.ht_heat_winding_degC(cfg, state)
    assert hottest == pytest.approx(found[-1][:6].max(), rel=1e-6)


def test_a_machine_of_hours_loses_nothing_to_rounding(make):
    """At 1 kHz a step of each slow interrupt would stand still far below the end: its change is
    less than half a unit of the float."""
    values = {"winding_s": 400.0, "frame_s": 20000.0, "f_slow_Hz": 1000.0}
    cfg, state = make(**values)
    assert cfg.steps > 5000
    squares, step_s = np.full(6, 9.0), cfg.steps / 1000.0
    cfg.steps = 1.0  # the means are the same
    follow(cfg, state, squares, 0.0, round(200_000 / step_s))
    expected = reference(values, squares, 0.0, [200_000.0])[-1]
    assert temperatures(cfg, state) == pytest.approx(expected, abs=0.1)


def test_without_currents_the_machine_cools_and_off_it_is_cold(make):
    cfg, state = make()
    follow(cfg, state, np.full(6, 30.0), 0.0, 200)
    hot = lib.ht_heat_winding_degC(cfg, state)
    follow(cfg, state, np.full(6, 30.0), 50.0, 100, powered=False)
    warm = lib.ht_heat_winding_degC(cfg, state)
    assert MACHINE["ambient_degC"] + 1 < warm < hot - 10
    cfg.steps = 0.0
    follow(cfg, state, np.full(6, 30.0), 50.0, 1)
    lib.ht_heat_step(cfg, state, True, 50.0)
    assert list(state.rise_K) == [0.0] * 6 and state.frame_rise_K == 0.0


def test_a_standing_current_heats_its_phase_and_not_the_mean(make):
    cfg, state = make()
    squares = np.array([36.0, 0, 9.0, 0, 9.0, 0])
    follow(cfg, state, squares, 0.0, 400)
    found = temperatures(cfg, state)[:6]
    assert np.argmax(found) == 0 and found[0] > found.mean() + 15
    assert lib.ht_heat_winding_degC(cfg, state) == pytest.approx(found[0], rel=1e-6)


def test_the_torque_falls_from_the_limit_to_the_trip(make):
    cfg, _ = make(winding_limit_degC=120.0, winding_trip_degC=150.0)
    shares = [lib.ht_heat_share(cfg, degC) for degC in (20, 120, 127.5, 135, 149.7, 150, 300)]
    assert shares == pytest.approx([1, 1, 0.75, 0.5, 0.01, 0, 0], abs=1e-5)
    cfg.limit_degC = 150.0
    assert [lib.ht_heat_share(cfg, degC) for degC in (149.9, 150.1)] == [1, 0]
    cfg.steps = 0.0
    assert lib.ht_heat_share(cfg, 300.0) == 1
