"""Conduction drops. The tests check the voltage behind each device by its definition, direct
current by Ohm's law, the trajectory of the coils (conftest) under such voltages, the energy from
the dc link against machine and devices, and the state at zero current.
"""

from dataclasses import replace

import numpy as np
import pytest
from plant_calls import NO_LOAD, advance, set_leg
from scipy.integrate import solve_ivp, trapezoid

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.machines.induction import make

VDC = 250.0
V_SWITCH, V_DIODE, R_SWITCH, R_DIODE = 1.2, 0.9, 0.05, 0.02
DROPS = {
    "v_switch_V": V_SWITCH, "v_diode_V": V_DIODE, "r_switch_ohm": R_SWITCH, "r_diode_ohm": R_DIODE,
}  # fmt: skip
ANGLES = np.radians([0, 30, 120, 150, 240, 270])


class Drive:
    def __init__(self, p, y, legs, **drops):
        self.m, self.y = make(p), np.array(y, float)
        self.inv = inverter_record(**(drops or DROPS))
        self.switch([LOW] * 6)  # driven legs first, because an off leg's diode follows its current
        self.switch(legs)

    def switch(self, legs):
        for leg, state in enumerate(legs):
            set_leg(self.inv, self.m, self.y, leg, int(state))

    def advance(self, dt, steps=1, vdc=VDC):
        """The states after each step."""
        return advance(self.inv, self.m, NO_LOAD, self.y, dt, vdc, steps)[0]

    @property
    def i(self):
        return self.m.i_phase @ self.y[:6]


def running(model, phase=0.0, omega=60.0):
    along, across = np.cos(ANGLES - phase), np.sin(ANGLES - phase)
    i_s = 2 * along + 5 * across + 0.5 * np.cos(5 * ANGLES - 1)
    return i_s, -5 * across, model.state(i_s, -5 * across, omega, 0.0)


def behind(legs, i, vdc=VDC):
    """Leg voltages, device by device."""
    volts = []
    for state, amps in zip(legs, i):
        size = abs(amps)
        switch, diode = V_SWITCH + R_SWITCH * size, V_DIODE + R_DIODE * size
        if state == HIGH:
            volts.append(vdc - switch if amps > 0 else vdc + diode)
        elif state == LOW:
            volts.append(-diode if amps > 0 else switch)
        else:
            volts.append(-diode if amps > 0 else vdc + diode)
    return np.array(volts)


@pytest.mark.parametrize("state", [HIGH, LOW, OFF])
def test_voltage_behind_the_conducting_device(model, state):
    for phase in np.linspace(0.1, 6.2, 7):
        i_s, _, y = running(model, phase)
        drive = Drive(model.p, y, [state] * 6)
        drive.advance(1e-9)
        clear = np.abs(i_s) > 0.1
        assert clear.sum() > 3
        np.testing.assert_allclose(
            drive.inv.v_leg[clear], behind([state] * 6, i_s)[clear], atol=1e-3
        )


def test_direct_current_follows_ohms_law(symmetric):
    """The current flows from u1 to w1 and v1, through two switches and one and a half windings in
    series. The other set is shorted by its own legs, and its current ends at zero."""
    drive = Drive(symmetric.p, np.zeros(8), [HIGH, LOW, LOW, LOW, LOW, LOW])
    drive.advance(1e-3, 3000, vdc=20.0)
    amps = (20.0 - 2 * V_SWITCH) / (1.5 * (symmetric.p.rs_ohm + R_SWITCH))
    np.testing.assert_allclose(drive.i[::2], np.array([1, -0.5, -0.5]) * amps, rtol=1e-6)
    np.testing.assert_allclose(drive.i[1::2], 0, atol=1e-6)


def test_trajectory_is_that_of_the_coils(model):
    """Currents of either sign flow through switches and diodes, and none crosses zero."""
    legs = [HIGH, HIGH, LOW, OFF, LOW, OFF]
    i_s, i_r, y = running(model, 0.7)
    drive = Drive(model.p, y, legs)
    drive.advance(5e-6, 20)

    def slopes(_, z):
        i_s, i_r = model.solve(z[:-2], model.p.pole_pairs * z[-1])
        torque = model.torque(i_s, i_r, model.p.pole_pairs * z[-1])
        turning = (torque - model.p.viscous_Nms * z[-2]) / model.p.inertia_kgm2
        return np.concatenate([model.flux_slopes(i_s, i_r, behind(legs, i_s)), [turning, z[-2]]])

    z = np.concatenate([model.fluxes(i_s, i_r, 0.0), [60.0, 0.0]])
    done = solve_ivp(slopes, (0, 100e-6), z, "DOP853", rtol=1e-11, atol=1e-12)
    expected = model.plant_state(done.y[:, -1])
    i_end = model.solve(done.y[:-2, -1], model.p.pole_pairs * done.y[-1, -1])[0]
    assert np.all(i_s * i_end > 0) and np.min(np.abs([i_s, i_end])) > 0.05
    np.testing.assert_allclose(drive.y, expected, rtol=1e-8, atol=1e-9)


def test_energy_and_diodes_under_any_switching(model):
    """The energy of the dc link is that of machine and devices. A leg that is off conducts only in
    its diode's direction, and its voltage is within its diode's drop of the rails."""
    rng = np.random.default_rng(3)
    _, _, y = running(model, 0.4)
    drive, dt, n = Drive(model.p, y, [LOW] * 6), 1e-6, 40
    link = devices = machine = 0.0

    def stored(y):
        i = np.concatenate(model.currents(y))
        return i @ model.inductance(0) @ i / 2 + model.p.inertia_kgm2 * y[6] ** 2 / 2

    begin = stored(drive.y)
    for _ in range(120):
        legs = rng.choice([LOW, HIGH, OFF], 6, p=[0.45, 0.45, 0.1])
        drive.switch(legs)
        states = np.vstack([drive.y.copy(), drive.advance(dt, n)])
        i = states[:, :6] @ drive.m.i_phase.T
        upper = (legs == HIGH) | ((legs == OFF) & (i < 0))
        switch = ((legs == HIGH) & (i > 0)) | ((legs == LOW) & (i < 0))
        size = np.abs(i)
        lost = np.where(switch, (V_SWITCH + R_SWITCH * size) * size,
                        (V_DIODE + R_DIODE * size) * size).sum(axis=1)  # fmt: skip
        i_r = np.array([model.currents(y)[1] for y in states])
        copper = (i**2) @ model.r_stator + model.p.rr_ohm * (i_r**2).sum(axis=1)
        friction = model.p.viscous_Nms * states[:, 6] ** 2
        link += VDC * trapezoid((i * upper).sum(axis=1), dx=dt)
        devices += trapezoid(lost, dx=dt)
        machine += trapezoid(copper + friction, dx=dt)
        for leg in np.flatnonzero(legs == OFF):
            diode, v = drive.inv.diode[leg], drive.inv.v_leg[leg]
            assert drive.i[leg] * diode > -2e-3
            assert -V_DIODE - 1 <= v <= VDC + V_DIODE + 1
            if abs(drive.i[leg]) > 0.05:
                assert v == pytest.approx(behind([OFF], drive.i[[leg]])[0], abs=1e-2)
    machine += stored(drive.y) - begin
    assert devices > 0.02
    assert link - machine == pytest.approx(devices, rel=2e-3)


def test_floating_diode_opens_beyond_its_threshold(symmetric):
    """The rotor flux is free and turns at speed. Two diodes are in series, at sqrt 3 times the
    amplitude."""
    i_r = 10 * np.cos(ANGLES)
    p = replace(symmetric.p, inertia_kgm2=1e9, viscous_Nms=0.0, rr_ohm=1e-3)
    induced = np.hypot(*symmetric.state(np.zeros(6), i_r, 0, 0)[:2])
    for line_to_line, conducts in ((VDC + 16, False), (VDC + 24, True)):
        omega = line_to_line / np.sqrt(3) / induced / p.pole_pairs
        y = symmetric.state(np.zeros(6), i_r, omega, 0.0)
        drive = Drive(p, y, [OFF] * 6, v_diode_V=10.0)
        states = drive.advance(5e-6, int(np.pi / (omega * p.pole_pairs) / 5e-6))
        most = np.max(np.abs(states[:, :6] @ drive.m.i_phase.T))
        assert most > 0.01 if conducts else most < 1e-4


@pytest.mark.parametrize("lxy_H", [10e-3, 0.1e-3])
def test_free_wheeling_currents_reach_zero(symmetric, lxy_H):
    """The thresholds bring free-wheeling x-y currents to zero in a finite time. They stay there
    without chatter, however small the inductance is."""
    p = replace(symmetric.p, lxy_H=lxy_H)
    y = np.zeros(8)
    y[2] = lxy_H * 0.8
    drive = Drive(p, y, [LOW] * 6, v_switch_V=5.0, v_diode_V=5.0)
    states = drive.advance(50e-6, 200)
    size = np.hypot(states[:, 2], states[:, 3]) / lxy_H
    assert np.all(np.diff(size) <= 1e-12)
    # Along x, thresholds of 5 V make 5 V (2 cos 0 + 4 cos 30 deg)/3, at least 4 V. The currents are
    # then exponentials.
    settled = int((lxy_H * 0.8 / 4 + 10 * lxy_H / 500) / 50e-6) + 1
    assert np.all(size[settled + 1 :] < 10e-3)
    assert size[-1] < 1e-9


def test_set_up_reaches_the_inverter():
    setup = setups.load("paper-b")
    assert SimulatedDrive(setup).inverter.devices.drops == 0
    inv = SimulatedDrive(setup.changed(**{f"inverter__{k}": v for k, v in DROPS.items()})).inverter
    assert inv.devices.drops == 1
    assert np.all(inv.devices.v_V == 2 * [V_SWITCH, V_DIODE])
    assert np.all(inv.devices.r_ohm == 2 * [R_SWITCH, R_DIODE])


def test_the_threshold_is_whole_from_twenty_times_the_knee_on():
    """The plant does not compute the tangent there: it is 1 to the last bit, as exp(-40) is less
    than half of the spacing of numbers below 1."""
    assert 2 * np.exp(-40.0) < 0.5 * np.spacing(0.5)
    assert np.tanh(20.0) == 1.0 and np.tanh(-20.0) == -1.0


def test_the_knee_grows_with_the_range_of_the_sensors():
    """Up to 25 A it is 10 mA. It stays below a step of a 12-bit sensor, 2 x range / 4096."""
    for range_A in (0.0, 20.0, 25.0):
        assert inverter_record(range_A=range_A, **DROPS).devices.knee_A == 10e-3
    for range_A in (26.0, 500.0):
        knee_A = inverter_record(range_A=range_A, **DROPS).devices.knee_A
        assert 10e-3 < knee_A < 2 * range_A / 4096


def test_threshold_fades_over_the_knee(symmetric):
    """A driven leg with a current of one knee misses tanh(1) of the switch's threshold."""
    for range_A in (25.0, 500.0):
        inv, m = inverter_record(range_A=range_A, v_switch_V=1.0), make(symmetric.p)
        y = np.zeros(8)
        y[:2] = np.linalg.solve(m.i_phase[:2, :2], [inv.devices.knee_A, 0.0])
        for leg in range(6):
            set_leg(inv, m, y, leg, HIGH)
        advance(inv, m, NO_LOAD, y, 1e-9, VDC, 1)
        assert VDC - inv.v_leg[0] == pytest.approx(np.tanh(1.0), rel=1e-2)
