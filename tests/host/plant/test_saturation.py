"""Saturation of the main flux. It is compared with the magnetising curve solved by scipy, with
coils (conftest) that have the curve's secant inductance, and with an energy balance whose field
energy is an integral along the curve.
"""

from dataclasses import replace

import numpy as np
import pytest
from plant_calls import NO_LOAD, advance, instant, integrate, set_leg
from scipy.integrate import solve_ivp, trapezoid
from scipy.optimize import brentq

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.machines.induction import make

VDC = 300.0
ANGLES = np.radians([0, 30, 120, 150, 240, 270])


def vsd(phases):
    rows = [f(n * ANGLES) for n in (1, 5) for f in (np.cos, np.sin)]
    return np.asarray(phases) @ np.array(rows).T / 3


def magnetising_A(p, psi_Wb):
    """The magnetising curve by its definition."""
    return psi_Wb / p.lm_H * (1 + (psi_Wb / p.psi_knee_Wb) ** p.saturation_exponent)


class Saturated:
    """Coils with the main inductance that belongs to their magnetising current."""

    def __init__(self, model, free=None, psi_knee_Wb=0.4, saturation_exponent=6.0):
        self.p = replace(model.p, psi_knee_Wb=psi_knee_Wb, saturation_exponent=saturation_exponent)
        self.kind, self.free = type(model), model.free if free is None else free

    def coils(self, lm_H):
        return self.kind(replace(self.p, lm_H=lm_H), self.free)

    def main(self, i_s, i_r, theta_e):
        """Magnetising current, in the stator's frame."""
        c, s = np.cos(theta_e), np.sin(theta_e)
        return vsd(i_s)[:2] + np.array([[c, -s], [s, c]]) @ vsd(i_r)[:2]

    def secant(self, size_A):
        def miss(psi):
            return magnetising_A(self.p, psi) - size_A

        psi = brentq(miss, 0, self.p.lm_H * size_A + 1e-9, xtol=1e-15, rtol=1e-14)
        return psi / size_A if size_A > 1e-9 else self.p.lm_H

    def of_currents(self, i_s, i_r, theta_e=0.0):
        return self.coils(self.secant(np.hypot(*self.main(i_s, i_r, theta_e))))

    def of_fluxes(self, flux, theta_e):
        def miss(lm_H):
            i = np.hypot(*self.main(*self.coils(lm_H).solve(flux, theta_e), theta_e))
            return magnetising_A(self.p, lm_H * i) - i

        if miss(self.p.lm_H) <= 1e-13:
            return self.coils(self.p.lm_H)
        return self.coils(brentq(miss, 1e-4 * self.p.lm_H, self.p.lm_H, xtol=1e-15, rtol=1e-14))

    def follow(self, z, v_leg, dt):
        """Advance (fluxes, speed, angle) under constant leg voltages."""

        def slopes(_, z):
            theta_e = self.p.pole_pairs * z[-1]
            coils = self.of_fluxes(z[:-2], theta_e)
            i_s, i_r = coils.solve(z[:-2], theta_e)
            torque = coils.torque(i_s, i_r, theta_e) - self.p.viscous_Nms * z[-2]
            turning = [torque / self.p.inertia_kgm2, z[-2]]
            return np.concatenate([coils.flux_slopes(i_s, i_r, v_leg), turning])

        return solve_ivp(slopes, (0, dt), z, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]

    def plant_state(self, z):
        theta_e = self.p.pole_pairs * z[-1]
        coils = self.of_fluxes(z[:-2], theta_e)
        return coils.state(*coils.solve(z[:-2], theta_e), z[-2], z[-1])


def run(p, y, volts, dt, steps=1):
    return integrate(make(p), NO_LOAD, y, volts, dt, steps)


def currents(p, y):
    m, k, i_leg, i = make(p), np.empty(8), np.empty(6), np.empty(4)
    torque = instant(m, NO_LOAD, y, np.zeros(4), k, i_leg, i)
    np.testing.assert_allclose(i, vsd(i_leg), atol=1e-10)
    return i_leg, i, torque, k


def any_currents(rng, size=4.0):
    i_s = rng.normal(0, size, 6)
    i_s[::2] -= i_s[::2].mean()
    i_s[1::2] -= i_s[1::2].mean()
    return i_s, np.cos(ANGLES) * rng.normal(0, size) + np.sin(ANGLES) * rng.normal(0, size)


@pytest.mark.parametrize(("knee", "exponent"), [(0.4, 6.0), (1.0, 6.0), (0.3, 1.0), (0.2, 20.0)])
def test_currents_and_torque_agree_with_the_coils(model, knee, exponent):
    saturated = Saturated(model, None, knee, exponent)
    rng = np.random.default_rng(1)
    deepest = 0.0
    for size in (0.2, 2.0, 10.0, 50.0):
        for _ in range(5):
            i_s, i_r = any_currents(rng, size)
            theta = rng.uniform(-9, 9)
            theta_e = theta * model.p.pole_pairs
            coils = saturated.of_currents(i_s, i_r, theta_e)
            y = coils.state(i_s, i_r, 30.0, theta)
            i_leg, _, torque, k = currents(saturated.p, y)
            np.testing.assert_allclose(i_leg, i_s, rtol=1e-9, atol=1e-9 * size)
            expected = coils.torque(i_s, i_r, theta_e)
            assert torque == pytest.approx(expected, rel=1e-8, abs=1e-9 * size**2)
            turning = (expected - model.p.viscous_Nms * 30.0) / model.p.inertia_kgm2
            assert k[6] == pytest.approx(turning, rel=1e-8, abs=1e-6 * size**2)
            deepest = max(deepest, coils.p.lm_H / model.p.lm_H)
            deepest = max(deepest, model.p.lm_H / coils.p.lm_H)
    assert deepest > 3


@pytest.mark.parametrize("amps", [0.5, 1.5, 4.0, 12.0])
def test_direct_current_follows_the_magnetising_curve(model, amps):
    """The rotor is locked, and constant voltages have any direction. In the end there is no rotor
    current. The stator flux is leakage times current plus the curve's flux, along the current."""
    p = replace(Saturated(model).p, inertia_kgm2=1e9)
    i_s = amps * np.cos(ANGLES - 0.7)
    rotor_s = (p.llr_H + p.lm_H) / p.rr_ohm + (p.lls_H + p.lm_H) / np.min(model.r_stator)
    volts = vsd(model.r_stator * i_s)
    y = run(p, np.zeros(8), volts[None, :], 1e-3, int(30 * rotor_s / 1e-3))[-1]
    i_leg, _, torque, _ = currents(p, y)
    np.testing.assert_allclose(i_leg, i_s, atol=1e-6 * amps)
    psi = brentq(lambda psi: magnetising_A(p, psi) - amps, 0, p.lm_H * amps)
    main = psi * np.array([np.cos(0.7), np.sin(0.7)])
    np.testing.assert_allclose(y[4:6], main, rtol=1e-6, atol=1e-6)
    leakage = model.l_stator - p.lm_H / 3 * np.cos(ANGLES[:, None] - ANGLES)
    np.testing.assert_allclose(y[:4], vsd(leakage @ i_s) + [*main, 0, 0], rtol=1e-6, atol=1e-6)
    assert abs(torque) < 1e-5


def test_at_synchronous_speed_the_current_is_that_of_the_curve(symmetric):
    """V^2 = (R i)^2 + (w (L_ls i + psi_m(i)))^2, where psi_m is given by the curve."""
    p = replace(Saturated(symmetric).p, inertia_kgm2=1e9)
    w, dt = 2 * np.pi * 50, 50e-6
    for amplitude in (60.0, 130.0, 180.0):

        def miss(psi, amplitude=amplitude):
            i = magnetising_A(p, psi)
            return (p.rs_ohm * i) ** 2 + (w * (p.lls_H * i + psi)) ** 2 - amplitude**2

        psi = brentq(miss, 0, amplitude / w)
        t = dt * np.arange(60_000)
        v = np.zeros((len(t), 4))
        v[:, 0] = amplitude * np.cos(w * (t + dt / 2))
        v[:, 1] = amplitude * np.sin(w * (t + dt / 2))
        y = np.zeros(8)
        y[6] = w / p.pole_pairs
        y = run(p, y, v, dt)[-1]
        _, i, torque, _ = currents(p, y)
        assert np.hypot(*i[:2]) == pytest.approx(magnetising_A(p, psi), rel=1e-3)
        assert np.hypot(*y[4:6]) == pytest.approx(psi, rel=1e-3)
        assert abs(torque) < 1e-2
    assert psi > 1.1 * p.psi_knee_Wb


def switched(n, every):
    """A rotating active state, 50 Hz, every third one a zero state."""
    steps = np.arange(n)
    turning = 2 * np.pi * 50 * every * steps[:, None]
    return VDC * (np.cos(turning - ANGLES) > 0) * (steps % 3 > 0)[:, None]


def test_trajectory_is_that_of_the_coils(model):
    """From a saturated state at speed, 4 ms of switching."""
    saturated = Saturated(model)
    i_s, i_r = 5 * np.cos(ANGLES - 0.3), 2 * np.sin(ANGLES)
    coils = saturated.of_currents(i_s, i_r)
    assert coils.p.lm_H < 0.7 * model.p.lm_H
    legs = switched(20, 200e-6)
    z = np.concatenate([coils.fluxes(i_s, i_r, 0.0), [80.0, 0.0]])
    for v_leg in legs:
        z = saturated.follow(z, v_leg, 200e-6)
    y = run(saturated.p, coils.state(i_s, i_r, 80.0, 0.0), vsd(legs), 10e-6, 20)[-1]
    np.testing.assert_allclose(y, saturated.plant_state(z), rtol=1e-7, atol=1e-7)


def test_energy_is_conserved(model):
    p = Saturated(model).p
    legs, steps, dt = switched(100, 200e-6), 20, 10e-6
    y0 = run(p, np.zeros(8), vsd(legs), dt, steps)[-1]
    states = np.vstack([y0, run(p, y0, vsd(legs), dt, steps)])
    leakage = model.l_stator - p.lm_H / 3 * np.cos(ANGLES[:, None] - ANGLES)

    def rotor_current(y, i):
        """The rotor current from psi_r = L_lr i_r + psi_m."""
        main = y[:2] - vsd(leakage @ i)[:2]
        return (y[4:6] - main) / p.llr_H, np.hypot(*main)

    def powers(y, v_leg):
        i_leg, _, torque, _ = currents(p, y)
        i_r, _ = rotor_current(y, i_leg)
        copper = model.r_stator @ i_leg**2 + 3 * p.rr_ohm * i_r @ i_r
        return np.array([v_leg @ i_leg, copper, torque * y[6], p.viscous_Nms * y[6] ** 2])

    def energies(y):
        """The energies of the leakages, and of the main field: 3 times the area between curve and
        flux axis."""
        i_leg = currents(p, y)[0]
        i_r, psi = rotor_current(y, i_leg)
        grid = np.linspace(0, psi, 2001)
        main = 3 * trapezoid(magnetising_A(p, grid), grid)
        field = i_leg @ leakage @ i_leg / 2 + 3 * p.llr_H * i_r @ i_r / 2 + main
        return np.array([field, p.inertia_kgm2 * y[6] ** 2 / 2])

    total = np.zeros(4)
    for c, v_leg in enumerate(legs):
        rows = np.array([powers(y, v_leg) for y in states[c * steps : (c + 1) * steps + 1]])
        total += dt / 3 * (rows[0] + 4 * rows[1::2].sum(0) + 2 * rows[2:-1:2].sum(0) + rows[-1])
    electrical, copper, mechanical, taken = total
    field, kinetic = energies(states[-1]) - energies(y0)
    linear = 3 * np.hypot(*y0[:2]) ** 2 / (2 * p.lm_H)
    assert energies(y0)[0] > 1.05 * linear  # saturated
    assert electrical == pytest.approx(copper + mechanical + field, abs=1e-5 * electrical)
    assert mechanical == pytest.approx(kinetic + taken, abs=1e-5 * electrical)


def test_far_below_the_knee_the_machine_is_linear(model):
    legs = switched(20, 200e-6)
    linear = run(model.p, np.zeros(8), vsd(legs), 20e-6, 10)
    far = run(Saturated(model, None, 1e3).p, np.zeros(8), vsd(legs), 20e-6, 10)
    np.testing.assert_allclose(far, linear, rtol=1e-12, atol=1e-14)


class Drive:
    def __init__(self, p, y, legs):
        self.p, self.m, self.y = p, make(p), np.array(y, float)
        self.inv = inverter_record()
        for state in ([LOW] * 6, legs):
            for leg in range(6):
                set_leg(self.inv, self.m, self.y, leg, int(state[leg]))

    def advance(self, dt, steps=1):
        advance(self.inv, self.m, NO_LOAD, self.y, dt, VDC, steps)


def test_with_all_legs_off_only_the_rotor_has_current(model):
    """All legs are off, so there is no stator current: d psi_r/dt = -R_r i_r + p w J psi_r, where
    psi_r = L_lr i_r + psi_m(i_r). The stator flux is psi_m."""
    saturated = Saturated(model)
    p = replace(saturated.p, inertia_kgm2=1e9, viscous_Nms=0.0)
    i_r = 8 * np.cos(ANGLES)
    coils = saturated.of_currents(np.zeros(6), i_r)
    drive = Drive(p, coils.state(np.zeros(6), i_r, 20.0, 0.0), [OFF] * 6)

    def main(psi_r):
        return brentq(lambda psi: p.llr_H * magnetising_A(p, psi) + psi - psi_r, 0, psi_r)

    def decay(_, psi_r):
        return [-p.rr_ohm * magnetising_A(p, main(psi_r[0]))]

    psi_r = solve_ivp(decay, (0, 0.1), drive.y[4:5].copy(), rtol=1e-10, atol=1e-12).y[0, -1]
    saturated_rate = p.rr_ohm * magnetising_A(p, main(drive.y[4])) / drive.y[4]
    assert saturated_rate > 1.5 * p.rr_ohm / (p.llr_H + p.lm_H)
    drive.advance(100e-6, 1000)
    assert drive.inv.off == 6 and np.all(drive.inv.diode == 0)
    turned = p.pole_pairs * 20.0 * 0.1
    direction = np.array([np.cos(turned), np.sin(turned)])
    np.testing.assert_allclose(drive.y[4:6], psi_r * direction, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(drive.y[:2], main(psi_r) * direction, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(currents(p, drive.y)[0], 0, atol=1e-4)


def test_a_floating_leg_agrees_with_the_coils(model):
    """u1 floats without current while the others carry current. The reference is the coils without
    that phase."""
    free = model.free[:, 1:]
    saturated = Saturated(model, free)
    i_s = np.array([0.0, 2.0, 4.0, 3.0, -4.0, -5.0])
    i_r = 4 * np.sin(ANGLES) - 5 * np.cos(ANGLES)
    coils = saturated.of_currents(i_s, i_r)
    assert coils.p.lm_H < 0.8 * model.p.lm_H
    legs = [OFF, LOW, HIGH, LOW, LOW, LOW]
    drive = Drive(saturated.p, coils.state(i_s, i_r, 60.0, 0.0), legs)
    drive.inv.diode[0] = 0
    drive.advance(5e-6, 80)
    assert 0 < drive.inv.v_leg[0] < VDC and drive.inv.diode[0] == 0
    i_leg = currents(saturated.p, drive.y)[0]
    assert abs(i_leg[0]) < 2e-4
    z = np.concatenate([coils.fluxes(i_s, i_r, 0.0), [60.0, 0.0]])
    z = saturated.follow(z, VDC * np.array([0, 0, 1, 0, 0, 0]), 400e-6)
    theta_e = saturated.p.pole_pairs * z[-1]
    expected = saturated.of_fluxes(z[:-2], theta_e).solve(z[:-2], theta_e)[0]
    np.testing.assert_allclose(i_leg, expected, atol=1e-3)


def test_drive_with_a_saturated_machine():
    """The flux is held where the curve needs twice the current. The firmware has the inductances of
    a no-load test at this flux. The drive works, and the current is that of the curve."""
    setup = setups.load("paper-b")
    assert SimulatedDrive(setup)._machine.psi_knee_Wb == 0
    sim = SimulatedDrive(setup.changed(machine__psi_knee_Wb=0.38))
    lm_H, lls_H = sim.controller.get("lm_H"), setup["machine.lls_H"]
    main_Wb = 0.4 * lm_H / (lm_H + lls_H)
    bend = 1 + (main_Wb / 0.38) ** setup["machine.saturation_exponent"]
    assert lm_H == pytest.approx(setup["machine.lm_H"] / bend, rel=1e-5)
    assert sim.controller.get("lr_H") == pytest.approx(lm_H + setup["machine.llr_H"], rel=1e-5)
    sim.start()
    sim.run(0.4, record=False)
    sim.set("speed_ref_rpm", 1500)
    sim.run(1.6, record=False)
    sim.run(0.1)
    sim.check()
    rec = sim.take()
    assert sim.speed_rpm == pytest.approx(1500, abs=15)
    psi = np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"]).mean()
    i = np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).mean()
    assert psi == pytest.approx(0.4, rel=0.02)
    assert i == pytest.approx(psi / (lm_H + lls_H), rel=0.1)
