"""Magnets above the speed at which they induce V_dc: the trip state is a short circuit by the lower
switches. The whole drive against the differential equations of a shorted machine.
"""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import BUILD, CALIBRATE, FAULT, IDLE, RUN, FirmwareError, ffi, lib
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.machines import magnet_parameters as machine
from hexatorque.setups import SetupError
from hexatorque.setups.values import Profile

#: Set-up -> scheme, range of its current sensors, current that its magnets bear.
MACHINES = {
    "magnet-interior": ("db-dtfc", 90.0, 75.0),
    "magnet-surface": ("ddr", 60.0, 50.0),
    "magnet-24v": ("foc-24", 300.0, 250.0),
}
SAMPLES = 20


def drive_of(name, device="f28377s", controller=firmware.Controller, **more):
    scheme, full_A, bear_A = MACHINES[name]
    base = setups.load(name)
    told = {f"controller__{n}": base.parameter(n) for n in ("i_trip_A", "i_ab_trip_A")}
    told |= {
        "machine__start_deg": 100.0, "sensors__i_full_A": full_A, "timing__device": device,
        "controller__trip_state": "short-circuit", "controller__magnets_bear_A": bear_A,
        "controller__rotor_start": "known", "controller__rotor_zero_deg": 100.0,
    }  # fmt: skip
    setup = base.with_scheme(scheme, **(told | more))
    if "controller__speed_trip_rpm" not in more:
        ceiling_rpm = machine.Parameters(**setup.machine_values()).ceiling_rpm(
            base["inverter.vdc_V"]
        )
        setup = setup.changed(controller__speed_trip_rpm=1.3 * ceiling_rpm)
    return SimulatedDrive(setup, SAMPLES, controller)


def running(name, share, **more):
    """The drive in RUN at this share of its ceiling; the shaft is put there."""
    drive = drive_of(name, **more)
    drive.start()
    while drive.time_s < 5 and drive.state in (CALIBRATE, BUILD):
        drive.run(0.1, record=False)
    assert drive.state == RUN, drive.trip
    drive.set("speed_ref_rpm", share * drive.machine.ceiling_rpm(drive.vdc_V))
    most_s = drive.time_s + 60
    while drive.time_s < most_s and abs(drive.speed_rpm / drive.get("speed_ref_rpm") - 1) > 2e-3:
        drive.run(0.1, record=False)
    drive.run(0.3, record=False)
    assert drive.state == RUN, drive.trip
    drive.discard()
    return drive


def tripped(drive):
    """Trip it: the page's own fault, for which nothing in the machine changes."""
    lib.ht_drive_trip(drive.controller.drive, lib.HT_FAULT_OVERRUN)
    return drive


def shorted(drive):
    return "legs short-circuited" in firmware.warnings(int(drive.controller.channel("warnings")))


def dq(drive, rec):
    angle = drive.machine.pole_pairs * rec["plant.theta_rad"]
    angle = angle + np.deg2rad(drive.setup["machine.start_deg"])
    return (rec["plant.i_alpha_A"] + 1j * rec["plant.i_beta_A"]) * np.exp(-1j * angle)


@pytest.mark.parametrize("name", MACHINES)
def test_current_after_a_trip_is_that_of_the_shorted_machine(name):
    """From the instant at which the lower switches are on, against scipy: both axes in each sample,
    and the peak, which stays below what the firmware has predicted for its permission."""
    drive = running(name, 1.1, machine__emf_share=[0.0] * 4)
    tripped(drive)
    drive.run(0.0004)  # off for two periods
    assert shorted(drive)
    drive.discard()
    drive.run(0.03)
    rec = drive.take()
    m = drive.machine
    found = dq(drive, rec)
    t = np.arange(len(found)) / rec.rate_Hz
    speed = m.pole_pairs * np.pi / 30 * rec["plant.speed_rpm"]

    def slope(at, i):
        omega = np.interp(at, t, speed)
        d, q = i
        return [
            (omega * m.lq_H * q - m.rs_ohm * d) / m.ld_H,
            (-omega * (m.ld_H * d + m.psi_f_Wb) - m.rs_ohm * q) / m.lq_H,
        ]

    start = [found[0].real, found[0].imag]
    exact = solve_ivp(slope, (0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-9, max_step=1e-4).y
    size = np.abs(exact[0] + 1j * exact[1])
    assert np.abs(found - (exact[0] + 1j * exact[1])).max() < 2e-3 * size.max()
    values = [row.parse(drive.get(n)) for n, row in firmware.parameters().items()]
    predicted_A = lib.ht_magnet_trip_short_A(ffi.new("ht_params *", [values]))
    assert abs(found).max() < predicted_A < 2.6 * abs(found).max()
    assert predicted_A < MACHINES[name][2]


@pytest.mark.parametrize("name", MACHINES)
def test_what_it_settles_at(name):
    """i_d = -w^2 L_q psi_f/(R^2 + w^2 L_d L_q), i_q = -w R psi_f/(R^2 + w^2 L_d L_q); the braking
    torque is 3 P (psi_f + (L_d - L_q) i_d) i_q: for L_d = L_q, -3 P R w psi_f^2/(R^2 + w^2 L^2)."""
    drive = running(name, 1.1, machine__emf_share=[0.0] * 4)
    m = drive.machine
    tripped(drive)
    drive.run(0.0004, record=False)
    omega = m.pole_pairs * drive.plant_state[6]
    for _ in range(2000):  # the shaft is held at its speed
        drive.run(drive.period_s, record=False)
        drive.plant_state[6] = omega / m.pole_pairs
    drive.run(10 * drive.period_s)
    rec = drive.take()
    found = dq(drive, rec).mean()
    share = m.rs_ohm**2 + omega**2 * m.ld_H * m.lq_H
    i_d, i_q = -(omega**2) * m.lq_H * m.psi_f_Wb / share, -omega * m.rs_ohm * m.psi_f_Wb / share
    assert abs(found - (i_d + 1j * i_q)) < 0.01 * abs(i_d + 1j * i_q)
    torque = 3 * m.pole_pairs * (m.psi_f_Wb + (m.ld_H - m.lq_H) * i_d) * i_q
    assert abs(rec["plant.torque_Nm"].mean() / torque - 1) < 0.02
    if m.ld_H == m.lq_H:
        braking = 3 * m.pole_pairs * m.rs_ohm * omega * m.psi_f_Wb**2
        braking /= m.rs_ohm**2 + (omega * m.ld_H) ** 2
        assert abs(-torque / braking - 1) < 1e-6


def test_the_energy_of_the_shaft_becomes_heat_of_the_windings():
    """And none goes into the dc link, which would take it while the gates are off."""
    drive = running("magnet-interior", 1.1, machine__emf_share=[0.0] * 4, load__kind="constant")
    tripped(drive)
    drive.run(0.0004, record=False)
    drive.discard()
    drive.run(0.2)
    assert shorted(drive)
    rec, m = drive.take(), drive.machine
    w = np.pi / 30 * rec["plant.speed_rpm"]
    i = dq(drive, rec)

    def stored(k):
        magnetic = 1.5 * (m.ld_H * i[k].real ** 2 + m.lq_H * i[k].imag ** 2)
        return 0.5 * m.inertia_kgm2 * w[k] ** 2 + magnetic

    xy2 = rec["plant.i_x_A"] ** 2 + rec["plant.i_y_A"] ** 2
    lost_W = 3 * m.rs_ohm * (np.abs(i) ** 2 + xy2) + m.viscous_Nms * w**2
    lost_J = np.trapezoid(lost_W) / rec.rate_Hz
    gone_J = stored(0) - stored(-1)
    assert gone_J > 100
    assert abs(lost_J / gone_J - 1) < 2e-3


@pytest.mark.parametrize("device", ["f28335", "f28377s"])
@pytest.mark.parametrize("active_low", [False, True])
def test_the_dead_time_is_kept_and_no_upper_switch_comes_on(device, active_low):
    controller = partial(firmware.Controller, active_low=active_low)
    drive = running("magnet-surface", 1.1, device=device, controller=controller)
    legs = np.array(drive.inverter.leg)
    drive.log_edges(100_000)
    tripped(drive)
    drive.run(0.4, record=False)
    dead = round(drive.setup["inverter.dead_time_us"] * 1e-6 * drive.controller.map.pwm_clock_Hz)
    assert shorted(drive) or len(drive.edges)
    since, after = np.full(6, -1), [[] for _ in range(6)]
    for count, leg, state in drive.edges:
        assert {legs[leg], state} != {LOW, HIGH}
        if state == LOW:
            assert count - since[leg] >= dead
        since[leg], legs[leg] = count, state
        after[leg].append(state)
    for states in after:
        assert HIGH not in states and states[:2] in ([OFF, LOW], [LOW])
    assert drive.gate_mistake == "" and drive.shorts == 0
    assert drive.controller.registers.violations == 0


def test_it_ends_below_the_ceiling_and_no_current_flows_then():
    drive = running("magnet-interior", 1.1)
    ceiling_rpm = drive.machine.ceiling_rpm(drive.vdc_V)
    tripped(drive)
    drive.run(0.01, record=False)
    while shorted(drive) and drive.time_s < 100:
        drive.run(0.01, record=False)
    assert 0.85 < drive.speed_rpm / ceiling_rpm < 0.95
    drive.run(0.02, record=False)
    drive.discard()
    drive.run(0.5)
    rec = drive.take()
    assert max(np.abs(rec[f"plant.i_{axis}_A"]).max() for axis in ("alpha", "beta")) < 0.01
    assert drive.state == FAULT
    drive.clear()
    assert drive.state == IDLE


@pytest.mark.parametrize("name", MACHINES)
def test_below_the_ceiling_the_trip_state_is_gates_off(name):
    drive = running(name, 0.85)
    tripped(drive)
    for _ in range(100):
        drive.run(drive.period_s, record=False)
        assert not shorted(drive)


def test_without_permission_the_diodes_rectify():
    """What the short circuit is for: more than rated current goes into the dc link."""
    drive = running("magnet-interior", 1.25)
    omega = drive.plant_state[6]
    lib.ht_drive_trip(drive.controller.drive, lib.HT_FAULT_OVERCURRENT)
    for _ in range(300):
        drive.run(drive.period_s)
        drive.plant_state[6] = omega
    rec = drive.take()
    assert not shorted(drive)
    assert rec["plant.torque_Nm"][-1000:].mean() * omega < -4000  # W, into the dc link


@pytest.mark.parametrize("how", ["over-current", "trip pin"])
def test_after_an_over_current_or_by_the_pin_the_gates_stay_off(how):
    drive = running("magnet-interior", 1.1)
    if how == "over-current":
        lib.ht_drive_trip(drive.controller.drive, lib.HT_FAULT_OVERCURRENT)
    else:
        drive.controller.set_trip_pin(0)
        drive.controller.set_trip_pin(1)
    for _ in range(300):
        drive.run(drive.period_s, record=False)
        assert not shorted(drive)
        assert all(state == OFF for state in drive.inverter.leg) or drive.periods < 3


@pytest.mark.parametrize("how", ["current", "pin"])
def test_what_ends_a_short_circuit_within_a_period(how):
    """A current beyond what the magnets bear is a fault of its own; the pin needs no fault."""
    drive = tripped(running("magnet-interior", 1.1))
    drive.run(0.05, record=False)
    assert shorted(drive)
    if how == "current":
        beyond_Wb = 1.05 * MACHINES["magnet-interior"][2] * drive.machine.lq_H
        drive.plant_state[:2] += beyond_Wb * np.array([1.0, 0.0]) * 3
    else:
        drive.controller.set_trip_pin(0)
    drive.run(2 * drive.period_s, record=False)
    assert not shorted(drive)
    assert ("over-current" in drive.faults) == (how == "current")
    drive.controller.set_trip_pin(1)
    drive.run(0.02, record=False)
    assert not shorted(drive)


@pytest.mark.parametrize("how", ["stands still", "counts backwards"])
def test_the_encoder_need_not_work(how):
    """Its fault trips the drive; the short circuit comes with the speed of before, and ends by the
    frequency of the current."""
    drive = running("magnet-interior", 1.15)
    ceiling_rpm = drive.machine.ceiling_rpm(drive.vdc_V)
    true_rpm = lambda: drive.plant_state[6] * 30 / np.pi  # noqa: E731
    if how == "stands still":
        drive.sensors.hold[7] = 1
        drive.run(0.003, record=False)
    else:
        counts_rev = drive.get("encoder_counts_rev")
        first = drive.plant_state[7] / 2 / np.pi * counts_rev
        drive.sensors.hold[7] = 1
        for _ in range(30):
            shown = 2 * first - drive.plant_state[7] / 2 / np.pi * counts_rev
            drive.sensors.position_counts, drive.sensors.counter = shown, int(np.floor(shown))
            drive.run(drive.period_s, record=False)
    assert drive.faults == ["encoder against flux speed"]
    assert shorted(drive)
    while shorted(drive) and drive.time_s < 100:
        drive.run(0.01, record=False)
    assert 0.85 < true_rpm() / ceiling_rpm < 0.95
    drive.run(0.3, record=False)
    assert not shorted(drive)


def test_commands_while_it_lasts():
    """STOP above the ceiling ends in it, without a fault. It is not left by STOP or CLEAR. A start,
    a parameter that sets the PWM up again, and writing to the flash wait."""
    controller = partial(firmware.Controller, store=firmware.MemoryStore())
    drive = running("magnet-interior", 1.15, controller=controller)
    drive.stop()
    drive.run(0.02, record=False)
    assert drive.state == IDLE and shorted(drive) and drive.faults == []
    for command in (drive.start, lambda: drive.set("calibration_s", 0.01)):
        with pytest.raises(FirmwareError) as error:
            command()
        assert "the legs are short-circuited because the shaft turns too fast" in str(error.value)
        assert "\n" not in str(error.value)
    controller = drive.controller
    saved = lib.ht_store_save(controller.store.handle, controller.drive)
    assert saved == lib.HT_ERROR_SHORT_CIRCUIT
    drive.stop()
    drive.run(0.02, record=False)
    tripped(drive)
    drive.run(0.02, record=False)
    drive.clear()
    drive.run(0.02, record=False)
    assert shorted(drive) and drive.state == IDLE
    assert all(state == LOW for state in drive.inverter.leg)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_load_that_drives_an_idle_machine_beyond_its_ceiling(sign):
    """No start has been there, so the sensors' offsets are not known either."""
    drive = drive_of("magnet-surface")
    ceiling_rpm = drive.machine.ceiling_rpm(drive.vdc_V)
    peak_A = {}
    for share in (0.9, 0.94, 1.0, 1.2):
        for _ in range(300):
            drive.plant_state[6] = sign * share * ceiling_rpm * np.pi / 30
            drive.run(drive.period_s * 10)
        rec = drive.take()
        peak_A[share] = np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).max()
        assert shorted(drive) == (share >= 1.0)
    assert peak_A[0.94] < 0.01
    assert peak_A[1.2] < 2 * drive.machine.psi_f_Wb / drive.machine.ld_H
    assert drive.state == IDLE and drive.gate_mistake == ""


@pytest.mark.parametrize("device", ["f28335", "f28377s"])
def test_a_lost_interrupt_of_a_drive_that_runs_takes_the_gates_off(device):
    """Nothing without code could keep the dead time."""
    drive = running("magnet-surface", 1.1, device=device)
    drive.lose_interrupts(True)
    drive.run(0.0005, record=False)
    assert all(state == OFF for state in drive.inverter.leg)
    assert drive.gate_mistake == "" and drive.controller.registers.violations == 0


@pytest.mark.parametrize("device", ["f28335", "f28377s"])
def test_a_short_circuit_stays_when_an_interrupt_is_lost(device):
    """The latches hold it."""
    drive = tripped(running("magnet-surface", 1.1, device=device))
    drive.run(0.002, record=False)
    assert shorted(drive)
    drive.lose_interrupts(True)
    drive.log_edges(100)
    drive.run(0.05, record=False)
    assert len(drive.edges) == 0 and all(state == LOW for state in drive.inverter.leg)
    drive.lose_interrupts(False)
    drive.run(2.0, record=False)
    assert all(state == OFF for state in drive.inverter.leg)
    assert drive.gate_mistake == "" and drive.controller.registers.violations == 0


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"controller__magnets_bear_A": 30.0}, "allowed is 61.9 A and more: the current of a"),
        ({"controller__magnets_bear_A": 0.0}, "would demagnetise the machine"),
        ({"sensors__i_full_A": 60.0}, "the first may be 0.885 times the second at most"),
        ({"controller__trip_state": "gates-off", "controller__speed_trip_rpm": 9000.0},
         "the magnets may induce vdc_max_V at most between two terminals, unless trip_state"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_a_line(changes, words):
    with pytest.raises(SetupError) as error:
        drive_of("magnet-interior", **changes)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_profile_above_the_ceiling_is_refused_in_a_line():
    drive = SimulatedDrive(setups.load("magnet-interior"), 1)
    with pytest.raises(SetupError) as error:
        drive.run_profile(Profile(0.1, ((0.0, 5500.0),)))
    assert "allowed range is -4797.7 .. 4797.7 r/min" in str(error.value)
    assert "above it the magnets would rectify without gates, unless trip_state" in str(error.value)


@pytest.mark.parametrize("name, share", [("magnet-interior", 0.1), ("magnet-surface", 0.1),
                                         ("magnet-24v", 0.25)])  # fmt: skip
def test_the_step_of_the_first_spin(name, share):
    """At a small part of the dc link the ceiling is that part, too, and R_s damps: the current
    stays below psi_f/L_d. 24 V give a quarter: a tenth would be the devices' drops."""
    base = setups.load(name)
    vdc_V = share * base["inverter.vdc_V"]
    drive = drive_of(
        name, inverter__vdc_V=vdc_V, controller__vdc_min_V=vdc_V / 2,
        controller__vdc_max_V=base.parameter("vdc_max_V"),
        controller__f_isr_Hz=base.parameter("f_isr_Hz"),
        controller__torque_limit_Nm=0.1 * base.parameter("torque_limit_Nm"),
        controller__speed_trip_rpm=1.2 * base["rated.speed_rpm"],
    )  # fmt: skip
    drive.start()
    while drive.time_s < 8 and drive.state in (CALIBRATE, BUILD):
        drive.run(0.1, record=False)
    ceiling_rpm = drive.machine.ceiling_rpm(vdc_V)
    drive.set("speed_ref_rpm", 1.1 * ceiling_rpm)
    most_s = drive.time_s + 6
    while drive.time_s < most_s and drive.speed_rpm < 1.06 * ceiling_rpm:
        drive.run(0.1, record=False)
    assert drive.state == RUN and drive.speed_rpm > 1.06 * ceiling_rpm
    drive.stop()
    drive.run(4 * drive.period_s, record=False)
    assert shorted(drive) and all(leg == LOW for leg in drive.inverter.leg)
    drive.discard()
    drive.run(0.05)
    rec = drive.take()
    largest_A = np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).max()
    assert largest_A < drive.machine.psi_f_Wb / drive.machine.ld_H
    most_s = drive.time_s + 6
    while drive.time_s < most_s and shorted(drive):
        drive.run(0.05, record=False)
    assert not shorted(drive) and all(leg == OFF for leg in drive.inverter.leg)
    assert abs(drive.speed_rpm) < 0.9 * ceiling_rpm
