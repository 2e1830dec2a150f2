"""The state `test`: the voltages that are asked for, and every limit that ends it."""

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import ffi, lib
from hexatorque.plant.vsd import INVERSE, PHASES, TRANSFORM

PERIOD = 10000
VDC_V = 250.0


def configuration(vector_V, wave="square", hertz=0.0):
    params = ffi.new("ht_params *")
    lib.ht_params_default(params)
    names = ("test_alpha_V", "test_beta_V", "test_x_V", "test_y_V")
    values = {**dict(zip(names, vector_V)), "test_wave": wave, "test_Hz": hertz}
    for name, value in {**values, "f_isr_Hz": 10000.0}.items():
        row = firmware.parameters()[name]
        params.v[row.id] = row.parse(float(value) if not row.choices else value)
    config = unwritten("ht_excitation_config *")
    lib.ht_excitation_configure(params, config)
    return config


def counts(first=0, shortest=430):
    return ffi.new("ht_period *", [PERIOD, first, shortest])


def patterns(config, ticks, first=0, begun=True, shortest=430):
    """Mean leg voltages of some periods, against the middle of the dc link: (ticks, 6)."""
    state, out = unwritten("ht_excitation_state *"), unwritten("ht_compare *")
    lib.ht_excitation_reset(state, 0)
    if begun:
        lib.ht_excitation_begin(state)
    rows = []
    for _ in range(ticks):
        lib.ht_excitation_step(config, state, VDC_V, counts(first, shortest), out)
        rise, fall = np.array(list(out.ca)), np.array(list(out.cb))
        assert out.start == 0 and (rise > first).all() and (fall < PERIOD).all()
        pulses = fall - rise  # one in a period, so the gaps are what is left of it
        assert min(pulses) >= shortest and PERIOD - max(pulses) >= shortest
        rows.append(((fall - rise) / PERIOD - 0.5) * VDC_V)
    return np.array(rows)


def test_legs_give_the_vector_that_is_asked_for():
    rng = np.random.default_rng(1)
    for vector in rng.uniform(-30, 30, (20, 4)):
        legs = patterns(configuration(vector), 1)[0]
        assert TRANSFORM @ legs == pytest.approx(vector, abs=2 * VDC_V / PERIOD)
        assert abs(legs[::2].sum()) < 0.2 and abs(legs[1::2].sum()) < 0.2


def test_pulses_are_centred_so_that_samples_lie_between_them():
    config, state = configuration((20, 5, -3, 8)), ffi.new("ht_excitation_state *")
    out = ffi.new("ht_compare *")
    lib.ht_excitation_begin(state)
    lib.ht_excitation_step(config, state, VDC_V, counts(), out)
    assert [a + b for a, b in zip(out.ca, out.cb)] == pytest.approx([PERIOD] * 6, abs=1)


def test_direct_voltages_are_right_in_the_mean_far_below_a_count():
    vector = (3.3333, -1.2345, 0.777, 5.4321)
    mean = TRANSFORM @ patterns(configuration(vector), 1000).mean(0)
    assert mean == pytest.approx(vector, abs=0.01 * VDC_V / PERIOD)


def test_no_voltage_before_a_write():
    assert np.abs(patterns(configuration((50, 0, 20, 0)), 5, begun=False)).max() < 0.02


def test_voltages_beyond_the_link_are_cut_to_what_leaves_room_for_both_edges():
    """In either sense."""
    legs = patterns(configuration((1000, 0, 0, 0)), 1)[0]
    assert np.abs(legs).max() == pytest.approx(0.45 * VDC_V, abs=0.1)
    for volts in (1000, -1000):
        legs = patterns(configuration((volts, 0, 0, 0)), 1)[0]
        signs = np.sign(volts * np.cos(np.deg2rad([0, 30, 120, 150, 240, 270])).round(9))
        np.testing.assert_allclose(legs, 0.45 * VDC_V * signs, atol=0.1)
    # A longer shortest pulse leaves less.
    long = patterns(configuration((1000, 0, 0, 0)), 20, shortest=900)
    assert np.abs(long).max() == pytest.approx(0.41 * VDC_V, abs=0.1)
    # With a write in the middle of the period the pulse begins after it.
    late = patterns(configuration((1000, 0, 0, 0)), 1, first=3000)[0]
    assert np.abs(late).max() == pytest.approx(0.2 * VDC_V, abs=0.2)


def fifty_cycles(vector, wave):
    """The vectors seen and the angle, of 250 Hz at 10 kHz: 40 periods a cycle. Over 50 cycles the
    angle must not drift."""
    ticks = 2000
    seen = patterns(configuration(vector, wave, 250.0), ticks) @ TRANSFORM.T
    return seen, 2 * np.pi * 250 / 10000 * np.arange(ticks)


def test_a_wave_that_rotates_turns_alpha_beta_and_leaves_xy():
    seen, angle = fifty_cycles(np.array([20.0, 0, 6, -4]), "rotate")
    rest = np.ones_like(angle)
    expected = np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), 6 * rest, -4 * rest])
    assert seen == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(
    ("wave", "constant"),
    [("square", slice(0)), ("square-ab", slice(2, 4)), ("square-xy", slice(0, 2))],
)
def test_a_square_wave_changes_the_sign_of_its_planes(wave, constant):
    vector = np.array([20.0, 0, 6, -4])
    seen, angle = fifty_cycles(vector, wave)
    sure = np.abs(np.cos(angle)) > 1e-3  # the very edge may fall on either side
    expected = np.sign(np.cos(angle))[:, None] * vector
    expected[:, constant] = vector[constant]
    assert seen[sure] == pytest.approx(expected[sure], abs=0.06)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_frequency_ends_where_a_cycle_has_four_periods(sign):
    """Above half of the sampling frequency the wave would turn the other way."""
    assert abs(configuration((20, 0, 0, 0), "rotate", 0).turn_sin) < 1e-6
    config = configuration((20, 0, 0, 0), "rotate", sign * 4000.0)
    assert (config.turn_cos, config.turn_sin) == pytest.approx((0.0, sign), abs=1e-5)


@pytest.mark.parametrize("vdc_V", [0.0, -1.0])
def test_without_a_link_voltage_the_legs_are_in_the_middle(vdc_V):
    config, state = configuration((20, 5, -3, 8)), ffi.new("ht_excitation_state *")
    out = ffi.new("ht_compare *")
    lib.ht_excitation_begin(state)
    lib.ht_excitation_step(config, state, vdc_V, counts(), out)
    assert [b - a for a, b in zip(out.ca, out.cb)] == [PERIOD // 2] * 6


# -- the state, on a machine -----------------------------------------------------------------

LIMIT_A = 4.0


def drive(**values):
    sim = SimulatedDrive(setups.load("paper-a-feasible"))
    limits = {"test_current_A": LIMIT_A, "test_travel_rev": 0.1, "test_s": 5.0}
    sim.set_many({"start_mode": "test", **limits, **values})
    sim.start()
    sim.run(0.06)
    return sim


def largest_A(sim):
    recording = sim.take()
    return max(np.abs(recording[f"plant.i_{phase}_A"]).max() for phase in ("u1", "u2", "w1", "v2"))


def test_a_start_leads_to_the_state_test_without_any_current():
    """Even with voltages left over from another test."""
    sim = drive(test_alpha_V=40.0)
    assert (sim.state, sim.faults) == ("test", [])
    sim.run(0.02)
    assert largest_A(sim) < 0.01


def test_a_direct_voltage_drives_its_current():
    sim = drive()
    sim.set("test_x_V", 10.0)
    sim.run(0.1, record=False)
    x_A = TRANSFORM[2] @ [sim.controller.channel(f"i_{p}_A") for p in PHASES]
    # Dead time takes 5.75 V of each leg, four of six legs' cosines of it along x.
    rest_V = 10 - 5.75 * np.abs(TRANSFORM[2]).sum()
    assert x_A == pytest.approx(rest_V / 1.83, rel=0.05)


def test_a_current_beyond_the_limit_trips():
    sim = drive()
    sim.take()
    sim.set("test_x_V", 60.0)
    sim.run(0.02)
    assert (sim.state, sim.faults) == ("fault", ["over-current"])
    # No further than two periods' rise beyond the limit: the sample, and the pattern under way.
    rise_A = INVERSE[0, 2] * 60 / 0.01 * 2e-4
    assert LIMIT_A <= largest_A(sim) < LIMIT_A + rise_A


def test_a_shaft_that_moves_too_far_trips():
    sim = drive(test_travel_rev=0.05)
    sim.set_many({"test_wave": "rotate", "test_Hz": 2.0, "test_alpha_V": 12.0})
    for _ in range(100):
        sim.run(0.02, record=False)
        if sim.state != "test":
            break
    assert (sim.state, sim.faults) == ("fault", ["over-speed"])
    assert abs(sim.plant_state[7]) / (2 * np.pi) < 0.07  # it coasts a little


def test_a_test_ends_by_itself():
    sim = drive(test_s=0.1)
    sim.run(0.1, record=False)
    assert sim.state == "idle" and sim.faults == []


def test_what_a_test_asks_for_is_not_kept_over_a_power_off():
    store = firmware.MemoryStore()
    controller = firmware.Controller("f28335", {}, store=store)
    controller.set_many({"start_mode": "test", "flux_ref_Wb": 0.5})
    assert lib.ht_store_save(controller.store.handle, controller.drive) == lib.HT_OK
    again = firmware.Controller("f28335", {}, store=firmware.MemoryStore(store.areas))
    assert (again.get("start_mode"), again.get("flux_ref_Wb")) == ("drive", 0.5)
