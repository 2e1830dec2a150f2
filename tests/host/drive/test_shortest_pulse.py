"""No gate is on for less than `min_pulse_us`, whatever the drive does. The pulses are those of the
emulated PWM, behind the dead band; that it measures them right is tested in plant/test_pwm.py.
"""

import math

import numpy as np
import pytest
from campaigns import part

from hexatorque import firmware, laws, setups
from hexatorque.drive.simulated import SimulatedDrive

#: Scheme and zero sequence. A clamped one has legs near their rails at any voltage.
VARIANTS = [
    *((scheme, "default") for scheme in firmware.schemes()),
    ("db-dtfc", "clamped"),
    ("db-dtfc", "alternating"),
    ("db-dtfc", "centred"),
    ("db-ipwm", "alternating"),
]
ZERO_SEQUENCE = {
    "default": {},
    "clamped": {"kappa_from_pu": 0.0},
    "alternating": {"kappa_from_pu": 0.0, "clamp": "alternating", "thd_share": 1.0},
    "centred": {"kappa": 0.0},
}


def drive(scheme, load_mode="shadow", **values):
    changes = {f"controller__{name}": value for name, value in values.items()}
    setup = setups.load("paper-a-feasible").with_scheme(scheme).changed(**changes)
    if load_mode == "immediate":
        setup = setup.changed(timing__latency="immediate")
    return SimulatedDrive(setup, 1)


def reverse(sim, rpm=1400.0, shortest=None):
    """`shortest`: counts of a pulse that the firmware keeps in place of its own."""
    sim.start()
    sim.run(0.4, record=False)
    for reference in (rpm, -rpm):
        sim.set("speed_ref_rpm", reference)
        sim.run(sim.period_s, record=False)
        if shortest:
            sim.controller.drive.config.control.period.shortest = shortest
        sim.run(1.5, record=False)
    assert sim.controller.faults == [] and sim.speed_rpm < -0.9 * rpm


def check(sim, least_us=2.0):
    """A count is 7 ns."""
    assert sim.short_pulses == 0
    assert least_us - 0.01 <= sim.shortest_pulse_us < math.inf


@pytest.mark.parametrize(("scheme", "zero_sequence"), part(VARIANTS, 4))
def test_a_reversal_makes_no_short_pulse(scheme, zero_sequence):
    sim = drive(scheme, **ZERO_SEQUENCE[zero_sequence])
    reverse(sim)
    check(sim)


#: What a scheme makes, of which the shortest pulse is a limit: sampling frequency, share of the
#: distortion, zero sequence, shortest pulse. The longest ones leave a period no more than two.
INTERLEAVED = [
    (10e3, 0.0, "largest", 2.0), (10e3, 1.0, "alternating", 20.0), (20e3, 0.5, "largest", 6.0),
    (20e3, 1.0, "largest", 20.0), (40e3, 0.0, "largest", 10.4), (40e3, 1.0, "alternating", 2.0),
]  # fmt: skip


@pytest.mark.parametrize(("f_isr_Hz", "share", "clamp", "least_us"), INTERLEAVED)
def test_interleaved_carriers_keep_it_from_standstill_to_twelve_steps(
    f_isr_Hz, share, clamp, least_us
):
    """With noisy sensors, either sign of the load, and beyond the reach with the full flux, where
    no leg is left to regulate x-y. The limit is met, and a leg toggles once in two periods, but for
    the carrier of set 2: where it takes another sense, twice in each twelfth of a turn, three legs
    toggle once more, and where it joins set 1 or leaves it, in 64 carriers, twice more."""
    setup = setups.load("paper-b").with_scheme(
        "db-ipwm", controller__f_isr_Hz=f_isr_Hz, controller__thd_share=share,
        controller__clamp=clamp, controller__kappa_from_pu=0.3,
        controller__min_pulse_us=least_us, controller__field_weakening="off",
        timing__latency="predicted", sensors__i_noise_A=0.05,
    )  # fmt: skip
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(0.5, record=False)
    for rpm, load_Nm in ((0, 0), (0, 2), (80, -2), (2000, 2), (4600, 1), (-2500, 2), (-20, 0)):
        sim.set_many({"speed_ref_rpm": float(rpm), "load_Nm": 0.0})
        sim.run(0.8, record=False)
        sim.set("load_Nm", float(load_Nm))
        begin, turned = sim.periods, sim.plant_state[7]
        sim.run(0.3)
        toggles = sim.take().meta["f_sw_Hz"] * 12 * 0.3
        electrical = abs(sim.plant_state[7] - turned) * setup["machine.pole_pairs"] + 0.3 * 20
        senses = 12 * electrical / (2 * np.pi) + 1
        periods = sim.periods - begin
        joins = 2 * (periods / 256 + 1) if 0 < share < 1 else 0
        assert toggles <= 6 * (periods / 2 + 1) + 3 * senses + 6 * joins
    assert sim.faults == [] and sim.gate_mistake == ""
    check(sim, least_us)
    assert sim.shortest_pulse_us < least_us + 0.1


@pytest.mark.parametrize("scheme", ("db-dtfc", "foc"))
def test_a_longer_pulse_is_kept_too(scheme):
    sim = drive(scheme, min_pulse_us=6.0)
    reverse(sim)
    check(sim, 6.0)


@pytest.mark.parametrize("scheme", ("db-dtfc", "foc"))
def test_short_pulses_are_seen(scheme):
    """The same reversal with a firmware that keeps the dead time alone."""
    sim = drive(scheme)
    reverse(sim, shortest=345)  # 2.3 us of dead time
    assert sim.short_pulses > 50 and sim.shortest_pulse_us < 0.2


def test_a_table_whose_duties_come_to_nothing_makes_no_short_pulse():
    """At 40 kHz the shortest pulse is a sixth of the period. The x-y regulator reaches it."""
    sim = drive("ddr", f_isr_Hz=40000.0, kp_xy_pu_A=3.0)
    sim.start()
    sim.run(0.4, record=False)
    sim.set("speed_ref_rpm", 900.0)
    sim.run(0.5, record=False)
    check(sim)
    assert sim.shortest_pulse_us < 2.5  # the limit has been reached


@pytest.mark.parametrize("scheme", ("ddr", "ddr-ml", "dtc3"))
def test_immediate_load_makes_no_short_pulse(scheme):
    sim = drive(scheme, "immediate")
    sim.start()
    sim.run(0.4, record=False)
    sim.set("speed_ref_rpm", 600.0)
    sim.run(0.4, record=False)
    check(sim)


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
def test_a_drive_without_a_leg_makes_no_short_pulse(scheme):
    sim = drive(scheme, lost_legs=32, ride_through="least-loss", i_rated_A=6.0)
    sim.start()
    sim.run(0.4, record=False)
    for rpm in (300.0, -300.0):
        sim.set("speed_ref_rpm", rpm)
        sim.run(0.5, record=False)
    assert sim.controller.faults == []
    check(sim)


def test_voltages_beyond_the_link_make_no_short_pulse():
    """In the state test; the rotor is not held, so only for a moment."""
    sim = drive("ddr", f_isr_Hz=20000.0, start_mode="test", test_current_A=25.0)
    sim.start()
    sim.run(0.055, record=False)
    assert sim.controller.state == "test"
    sim.set_many({"test_wave": "rotate", "test_Hz": 5000.0, "test_alpha_V": 2000.0})
    sim.run(0.01, record=False)
    check(sim)


@pytest.mark.parametrize("name", ("dtc-svm", "lvv-mpc"))
def test_laws_in_python_make_no_short_pulse(name):
    law = laws.find(name)
    setup = setups.load("paper-a-feasible")
    sim = SimulatedDrive(setup, 1, laws.controller_of(law))
    reverse(sim)
    check(sim)


def test_before_the_first_pulse_there_is_no_shortest():
    assert drive("ddr").shortest_pulse_us == math.inf
    assert np.all(drive("ddr")._pwm.short_pulses == 0)
