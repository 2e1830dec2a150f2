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
        for leg in range(6):
            state.square_A2[leg] = 1.0
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


def follow(cfg, state, squares, frame_W, steps, powered=True, rs_ohm=0.0):
    """Whole steps. In each the means of all its slow interrupts count."""
    for leg in range(6):
        state.square_A2[leg] = squares[leg]
    for _ in range(steps * round(cfg.steps)):
        lib.ht_heat_step(cfg, state, powered, frame_W, rs_ohm)


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
    lib.ht_heat_step(cfg, state, True, 50.0, 0.0)
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


def told_ohm(values, degC):
    """R_s of a winding with these parts' temperatures: of copper, as a straight line through 0."""
    v = MACHINE | values
    at_20 = v["rs_ohm"] / (1 + COPPER * (v["rs_degC"] - 20))
    return at_20 * (1 + COPPER * (np.asarray(degC, float) - 20))


TRUSTED_K, BUILT_TRUSTED_K = 5.0, 10.0


def test_an_exact_resistance_tells_the_temperature_at_the_first_start(make):
    cfg, state = make(rs_tells="temperature")
    lib.ht_heat_built(cfg, state, told_ohm({}, 100.0))
    assert temperatures(cfg, state) == pytest.approx(np.full(7, 100.0), abs=0.01)
    assert lib.ht_heat_rs_ohm(cfg, state) == pytest.approx(told_ohm({}, 100.0), rel=1e-5)
    # Later build-ups, whose R_s is less exact than a model that goes on, move it by what is beyond.
    lib.ht_heat_built(cfg, state, told_ohm({}, 100.0 + 0.9 * BUILT_TRUSTED_K))
    assert temperatures(cfg, state) == pytest.approx(np.full(7, 100.0), abs=0.01)
    lib.ht_heat_built(cfg, state, told_ohm({}, 70.0))
    assert temperatures(cfg, state) == pytest.approx(np.full(7, 70.0 + BUILT_TRUSTED_K), abs=0.02)


@pytest.mark.parametrize("wrong", (0.8, 1.25))
def test_a_cold_start_tells_a_resistance_that_was_told_wrong(make, wrong):
    """The loss is that of the true R_s from then on, and so is the rise."""
    cfg, state = make(rs_tells="resistance", rs_ohm=wrong * MACHINE["rs_ohm"])
    lib.ht_heat_built(cfg, state, told_ohm({}, MACHINE["ambient_degC"]))
    squares = np.full(6, 12.0)
    follow(cfg, state, squares, 0.0, 300)
    expected = reference({}, squares, 0.0, [300 * cfg.steps / 100.0])[-1]
    assert expected.max() > 70
    assert temperatures(cfg, state) == pytest.approx(expected, abs=1.0)
    # And the warm winding's R_s agrees with it: nothing changes.
    before = temperatures(cfg, state)
    lib.ht_heat_built(cfg, state, told_ohm({}, expected[:6].mean()))
    assert np.array_equal(temperatures(cfg, state), before)


def test_a_warm_winding_of_unknown_resistance_tells_nothing(make):
    """80 K of heat and 31 % of R_s are the same reading."""
    cfg, state = make(rs_tells="resistance")
    follow(cfg, state, np.full(6, 12.0), 0.0, 100)
    before = temperatures(cfg, state)
    assert before[:6].min() > MACHINE["ambient_degC"] + 20
    lib.ht_heat_built(cfg, state, 1.3 * told_ohm({}, before[0]))
    assert np.array_equal(temperatures(cfg, state), before) and state.ohm_per_K == 0


def test_a_wrong_model_is_corrected_up_to_the_trust_in_the_resistance_and_no_further(make):
    """The machine's true frame is as warm as that of a machine with twice the resistance to the
    ambient."""
    squares, true = np.full(6, 10.0), {"frame_K_W": 2 * MACHINE["frame_K_W"], "frame_s": 1800.0}
    ends = {}
    for told in (True, False):
        cfg, state = make(rs_tells="temperature")
        lib.ht_heat_built(cfg, state, told_ohm({}, MACHINE["ambient_degC"]))
        step_s, off = cfg.steps / 100.0, []
        seconds = step_s * np.arange(1, 3001)
        for degC in reference(true, squares, 0.0, seconds):
            follow(cfg, state, squares, 0.0, 1, rs_ohm=told_ohm({}, degC[0]) if told else 0.0)
            off.append(temperatures(cfg, state)[0] - degC[0])
        ends[told] = off
    assert min(ends[False]) < -20
    # What the wrong model pulls back in the time in which the temperature is followed comes on top.
    assert -TRUSTED_K - 2 < min(ends[True]) < -TRUSTED_K + 0.5


def test_a_resistance_within_its_own_error_leaves_the_model_alone(make):
    states = []
    for off_K in (None, 0.8 * TRUSTED_K, -0.8 * TRUSTED_K):
        cfg, state = make(rs_tells="temperature")
        lib.ht_heat_built(cfg, state, told_ohm({}, MACHINE["ambient_degC"]))
        for _ in range(200):
            degC = temperatures(cfg, state)[0]
            ohm = 0.0 if off_K is None else told_ohm({}, degC + off_K)
            follow(cfg, state, np.full(6, 4.0), 0.0, 1, rs_ohm=ohm)  # 0.3 K warmer
        states.append(temperatures(cfg, state))
    assert np.array_equal(states[0], states[1]) and np.array_equal(states[0], states[2])


def test_a_standing_current_shows_the_parts_that_it_heats(make):
    """R_s is the power over the square of the current: a cold phase without current is no part of
    it. A plain mean would take the hot phase for a wrong model."""
    squares = np.array([36.0, 0, 9.0, 0, 9.0, 0])
    cfg, state = make(rs_tells="temperature")
    lib.ht_heat_built(cfg, state, told_ohm({}, MACHINE["ambient_degC"]))
    follow(cfg, state, squares, 0.0, 300)
    before = temperatures(cfg, state)
    shown = (squares * told_ohm({}, before[:6])).sum() / squares.sum()
    plain = lib.ht_heat_rs_ohm(cfg, state)
    assert shown / plain > 1.05
    lib.ht_heat_built(cfg, state, shown)
    assert np.array_equal(temperatures(cfg, state), before)
    lib.ht_heat_built(cfg, state, plain)
    assert temperatures(cfg, state)[0] < before[0] - 3


def test_the_adaptation_is_heard_only_after_it_has_followed(make):
    cfg, state = make(rs_tells="temperature", adapt_s=0.5)
    lib.ht_heat_built(cfg, state, told_ohm({}, MACHINE["ambient_degC"]))
    slow = round(5.9 * 0.5 * 100)  # e^-6 of 100 K is far below the trust in it
    for _ in range(20):  # each gap begins the wait anew
        for k in range(slow):
            lib.ht_heat_step(cfg, state, False, 0.0, told_ohm({}, 150.0) if k else 0.0)
    assert temperatures(cfg, state).max() < MACHINE["ambient_degC"] + 0.01
    for _ in range(4 * slow):
        lib.ht_heat_step(cfg, state, False, 0.0, told_ohm({}, 150.0))
    assert temperatures(cfg, state).min() > MACHINE["ambient_degC"] + 30


# --- a sensor in the winding of u1 ---------------------------------------------------------


SENSED = {"winding_ntc_ohm": 10e3}


def sense(one, squares, degC, rs_ohm=0.0):
    """Two slow interrupts, and a reading of the sensor."""
    cfg, state = one
    for leg in range(6):
        state.square_A2[leg] = squares[leg]
    for _ in range(2):
        lib.ht_heat_step(cfg, state, True, 20.0, rs_ohm)
    lib.ht_heat_measured(cfg, state, degC)


def test_the_first_reading_moves_all_temperatures_to_where_the_sensor_is(make):
    """The machine may have been hot at the reset."""
    cfg, state = make(**SENSED)
    lib.ht_heat_measured(cfg, state, 95.0)
    assert temperatures(cfg, state) == pytest.approx([95.0] * 7, abs=1e-3)
    lib.ht_heat_measured(cfg, state, 115.0)
    share = 16.0 / (MACHINE["winding_s"] * 50.0)  # a thermistor is read 50 times a second
    assert temperatures(cfg, state) == pytest.approx([95.0 + 20 * share] * 7, abs=1e-3)


@pytest.mark.parametrize("wrong", (0.4, 1.0, 2.5))
def test_a_sensor_beats_a_model_that_is_told_another_thermal_resistance(make, wrong):
    """Over a duty cycle with rises of up to 60 K above the frame. A step of the load lets the wrong
    model go astray by its error over 17; the rest is the frame's to learn."""
    rated = 60.0 / (6 * MACHINE["winding_K_W"] * MACHINE["rs_ohm"] * 1.3)
    truth = make()
    sensed, alone = (make(**s, winding_K_W=wrong * MACHINE["winding_K_W"]) for s in (SENSED, {}))
    off = {"sensed": 0.0, "alone": 0.0}
    for share in (1.0, 0.2, 1.2, 0.0) * 2:
        squares = [share * rated] * 6
        for _ in range(3000):  # a minute
            for _ in range(2):
                for cfg, state in (truth, alone):
                    follow_once(cfg, state, squares)
            sense(sensed, squares, temperatures(*truth)[0])
            for name, one in (("sensed", sensed), ("alone", alone)):
                now = abs(lib.ht_heat_winding_degC(*one) - lib.ht_heat_winding_degC(*truth))
                off[name] = max(off[name], now)
    assert off["sensed"] < 1.0 + 72 * abs(wrong - 1) / 17, off
    assert wrong == 1.0 or off["alone"] > 5 * off["sensed"], off


def follow_once(cfg, state, squares):
    for leg in range(6):
        state.square_A2[leg] = squares[leg]
    lib.ht_heat_step(cfg, state, True, 20.0, 0.0)


def test_a_leg_that_is_hotter_than_the_sensors_stays_so(make):
    """At standstill v1 may carry twice what u1 does."""
    cfg, state = one = make(**SENSED)
    for _ in range(20_000):
        sense(one, [2.0, 2.0, 2.0, 2.0, 8.0, 2.0], 60.0)
    seen = temperatures(cfg, state)
    assert seen[0] == pytest.approx(60.0, abs=1.0)
    expected = 6 * MACHINE["winding_K_W"] * 6.0 * MACHINE["rs_ohm"]  # of 6 A^2 more, R_s cold
    assert 1.05 * expected < seen[4] - seen[0] < 1.4 * expected
    assert lib.ht_heat_winding_degC(cfg, state) == pytest.approx(seen[4], abs=1e-3)


def test_without_a_thermal_resistance_the_sensor_is_the_temperature_and_limits_act(make):
    cfg, state = make(**SENSED, winding_K_W=0.0)
    for degC in (50.0, 130.0, 90.0):
        lib.ht_heat_measured(cfg, state, degC)
        lib.ht_heat_step(cfg, state, True, 50.0, 0.0)
        assert temperatures(cfg, state) == pytest.approx([degC] * 7, abs=1e-3)
    assert lib.ht_heat_share(cfg, 132.5) == pytest.approx(0.5)
    assert lib.ht_heat_share(cfg, 145.0) == 0.0
    without, state = make(winding_K_W=0.0)
    assert lib.ht_heat_share(without, 200.0) == 1.0


def test_what_r_s_tells_counts_no_more_beside_a_sensor(make):
    ends = []
    for rs_ohm in (0.0, 3.0):
        cfg, state = one = make(**SENSED, rs_tells="temperature")
        for _ in range(5000):
            sense(one, [2.0] * 6, 60.0, rs_ohm)
        ends.append(temperatures(cfg, state))
    assert np.array_equal(*ends) and ends[0][0] == pytest.approx(60.0, abs=1.0)


def test_before_any_current_r_s_tells_the_temperature_of_all_parts(make):
    """Copper's temperature coefficient is of 20 degC."""
    cfg, state = make(rs_tells="temperature")
    lib.ht_heat_reset(state)
    v = MACHINE
    degC = v["ambient_degC"] + 25
    at_20 = v["rs_ohm"] / (1 + COPPER * (v["rs_degC"] - 20))
    lib.ht_heat_built(cfg, state, at_20 * (1 + COPPER * (degC - 20)))
    assert temperatures(cfg, state) == pytest.approx([degC] * 7, abs=0.01)


def hand_over(state, sums_A2, turns):
    """What the fast interrupt has gathered, as it does it."""
    assert state.full == 0
    state.gathered.turns = turns
    for leg in range(6):
        state.gathered.sum_A2[leg] = sums_A2[leg]
    lib.ht_heat_hand_over(state)
    assert state.full == 1


def test_the_mean_square_is_the_ratio_of_the_low_passes_of_sums_and_turns(make):
    """In some slow periods a leg has one sample, in others three: each sample counts alike."""
    cfg, state = make()
    lib.ht_heat_reset(state)
    rng = np.random.default_rng(7)
    gain = cfg.sample_gain
    sums, turns = np.zeros(6), 0.0
    assert 0 < gain < 1
    for _ in range(200):
        now = rng.integers(1, 4)
        squares = rng.uniform(0, 50, (now, 6)).sum(axis=0)
        hand_over(state, squares, now)
        lib.ht_heat_take(cfg, state)
        lib.ht_heat_take(cfg, state)  # there is nothing new: nothing happens
        sums += gain * (squares - sums)
        turns += gain * (now - turns)
        np.testing.assert_allclose(list(state.square_A2), sums / turns, rtol=2e-5)
        assert state.gathered.turns == 0 and not any(state.gathered.sum_A2)


def test_a_current_of_half_the_slow_interrupts_frequency_has_its_mean_square(make):
    """At any phase: its square has the slow interrupt's own frequency."""
    cfg, state = make()
    for phase in np.linspace(0, np.pi, 7):
        lib.ht_heat_reset(state)
        for period in range(40):
            times = period + np.arange(10) / 10
            hand_over(state, [np.sum(np.cos(np.pi * times + phase) ** 2)] * 6, 10)
            lib.ht_heat_take(cfg, state)
        assert lib.ht_heat_square_A2(state, 0) == pytest.approx(0.5, rel=1e-4)
