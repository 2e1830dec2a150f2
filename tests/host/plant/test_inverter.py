"""Legs, dead time, diodes. Driven legs are compared with the voltage of their rail. Legs that are
off are compared with the driven state that the sign of their current selects, with coils whose
current is held at zero (conftest), and with conservation of energy.
"""

from dataclasses import replace

import numpy as np
import pytest
from campaigns import part
from plant_calls import NO_LOAD, advance, set_leg, switch
from scipy.integrate import trapezoid

from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.machines.induction import make

VDC = 250.0
ANGLES = np.radians([0, 30, 120, 150, 240, 270])


def vsd(legs):
    rows = [f(n * ANGLES) for n in (1, 5) for f in (np.cos, np.sin)]
    return np.asarray(legs) @ np.array(rows).T / 3


class Drive:
    def __init__(self, p, y=None, legs=(LOW,) * 6):
        self.m = make(p)
        self.inv = inverter_record()
        self.y = np.zeros(8) if y is None else np.array(y, float)
        self.switch(*legs)

    def switch(self, *legs):
        for leg, state in enumerate(legs):
            set_leg(self.inv, self.m, self.y, leg, state)

    def advance(self, dt, steps=1, vdc=VDC):
        return advance(self.inv, self.m, NO_LOAD, self.y, dt, vdc, steps)

    @property
    def i(self):
        """Phase currents."""
        return self.m.i_phase @ self.y[:6]


def running(model, phase=0.0, magnetising=2.0, working=5.0, omega=60.0):
    """State of a loaded machine, with some x-y current."""
    along, across = np.cos(ANGLES - phase), np.sin(ANGLES - phase)
    i_s = magnetising * along + working * across + 0.5 * np.cos(5 * ANGLES - 1)
    return model.state(i_s, -working * across, omega, 0.0)


def test_driven_legs_have_the_voltage_of_their_rail(symmetric):
    """v = Vdc T S for all 64 states, and the machine integrates exactly this voltage."""
    groups = []
    for s in range(64):
        legs = [s >> (5 - leg) & 1 for leg in range(6)]
        drive = Drive(symmetric.p, legs=legs)
        drive.advance(1e-7)
        assert drive.inv.off == 0
        np.testing.assert_allclose(drive.inv.v, VDC * vsd(legs), atol=1e-12 * VDC)
        np.testing.assert_allclose(drive.y[:4], 1e-7 * VDC * vsd(legs), rtol=1e-4, atol=1e-14)
        groups.append(round(float(np.hypot(*drive.inv.v[:2])) / VDC, 5))
    lengths, counts = np.unique(groups, return_counts=True)
    assert dict(zip(lengths, counts)) == {
        0.0: 4, 0.17255: 12, 0.33333: 24, 0.4714: 12, 0.64395: 12,
    }  # fmt: skip


@pytest.mark.parametrize("off", [[0], [3], [0, 5], [1, 2, 4], [0, 1, 2, 3, 4, 5]])
def test_dead_time_follows_the_current(model, off):
    """With positive current the leg is at the negative rail, with negative current at the positive
    rail."""
    rng = np.random.default_rng(len(off))
    for phase in np.linspace(0.1, 6.2, 12):
        y = running(model, phase)
        legs = rng.integers(0, 2, 6)
        dead, tied = Drive(model.p, y, legs), Drive(model.p, y, legs)
        i = tied.i
        for leg in off:
            if abs(i[leg]) < 0.3:
                continue  # may reach zero
            set_leg(dead.inv, dead.m, dead.y, leg, OFF)
            set_leg(tied.inv, tied.m, tied.y, leg, LOW if i[leg] > 0 else HIGH)
        dead.advance(2e-6)
        tied.advance(2e-6)
        np.testing.assert_allclose(dead.inv.v, tied.inv.v, atol=1e-10)
        np.testing.assert_allclose(dead.y, tied.y, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_current_that_reaches_zero_stays_there(model, sign):
    """u1 is off, w1 and v1 hold its neutral near half the dc link, and the other set is shorted.
    The reference is the coils, first with the diode's rail on u1, then without its current."""
    legs = [OFF, LOW, HIGH, LOW, LOW, LOW]
    i_s = sign * np.array([0.8, 0.0, -1.8, 1.0, 1.0, -1.0])
    i_r = 2 * np.sin(ANGLES)
    y = model.state(i_s, i_r, 20.0, 0.0)
    drive = Drive(model.p, y)
    drive.switch(*legs)
    states, _ = drive.advance(10e-6, 60)

    v_leg = VDC * np.array([sign < 0, 0, 1, 0, 0, 0])

    def u1(_, z):
        return model.solve(z[:-2], model.p.pole_pairs * z[-1])[0][0]

    u1.terminal = True
    z = np.concatenate([model.fluxes(i_s, i_r, 0.0), [20.0, 0.0]])
    first = model.follow(z, v_leg, 600e-6, lambda w: 0.0, u1)
    zero_at, z = first.t[-1], first.y[:, -1]
    assert 10e-6 < zero_at < 400e-6
    held = type(model)(model.p, model.free[:, 1:])
    theta_e = model.p.pole_pairs * z[-1]
    i_s, i_r = model.solve(first.y[:-2, -1], theta_e)
    z = np.concatenate([held.fluxes(i_s, i_r, theta_e), z[-2:]])
    z = held.follow(z, v_leg, 600e-6 - zero_at, lambda w: 0.0).y[:, -1]
    i_end = held.solve(z[:-2], model.p.pole_pairs * z[-1])[0]

    currents = states[:, :6] @ drive.m.i_phase.T
    floating = np.arange(1, 61) * 10e-6 > zero_at
    assert np.all(np.abs(currents[floating, 0]) < 1e-9)
    assert np.all(sign * currents[~floating, 0] > 0)
    assert drive.inv.diode[0] == 0
    assert 0 < drive.inv.v_leg[0] < VDC
    np.testing.assert_allclose(drive.i, i_end, atol=1e-7)


def test_legs_that_are_off_obey_their_diodes_under_any_switching(model):
    """Under any switching, the current of an off leg has its diode's sign or is zero, its voltage
    is within the rails (to 0.2 %, because it changes within a step), and time advances. Long and
    short calls agree."""
    p = replace(model.p, inertia_kgm2=1e9)
    rng = np.random.default_rng(5)
    y = running(model, 0.4, omega=50.0)
    coarse, fine = Drive(p, y), Drive(p, y)
    floats = 0
    for _ in range(400):
        legs = rng.choice([LOW, HIGH, OFF], 6, p=[0.3, 0.3, 0.4])
        for drive in (coarse, fine):
            drive.switch(*map(int, legs))
        before = coarse.y[7]
        coarse.advance(60e-6)
        fine.advance(4e-6, 15)
        assert coarse.y[7] - before == pytest.approx(50.0 * 60e-6, rel=1e-6)
        assert fine.y[7] == pytest.approx(coarse.y[7], rel=1e-6)
        np.testing.assert_allclose(coarse.i, fine.i, atol=1e-4)
        for leg in np.flatnonzero(legs == OFF):
            current, diode = coarse.i[leg], coarse.inv.diode[leg]
            assert current * diode > -1e-9
            assert -0.002 * VDC <= coarse.inv.v_leg[leg] <= 1.002 * VDC
            if diode == 0:
                floats += 1
                assert abs(current) < 1e-7
        fine.y[:] = coarse.y  # differences must not add up
        fine.inv.diode[:] = coarse.inv.diode
    assert floats > 50


@pytest.mark.parametrize("knee_Wb", [0.0, 0.5])
def test_diodes_do_not_chatter(model, knee_Wb):
    """A voltage may leave its rail and return within a step, and two currents may reach zero almost
    together. Time must advance, and no leg may keep a current that it cannot carry."""
    for seed in part(range(60), 6):
        rng = np.random.default_rng(seed)
        i_s, i_r = model.free @ rng.normal(0, 4, 4), model.rotor @ rng.normal(0, 6, 2)
        y = model.state(i_s, i_r, rng.normal(0, 80), 0.0)
        drive = Drive(replace(model.p, psi_knee_Wb=knee_Wb), y)
        legs = rng.choice([LOW, HIGH, OFF], (1500, 6), p=[0.25, 0.25, 0.5])
        legs[rng.random(1500) < 0.1] = OFF
        times = 10 ** rng.uniform(-7, -3.3, 1500)
        worst = switch(drive.inv, drive.m, NO_LOAD, drive.y, VDC, legs, times)
        assert worst < 1e-6


def energy(model, y):
    i = np.concatenate(model.currents(y))
    return i @ model.inductance(0) @ i / 2 + model.p.inertia_kgm2 * y[6] ** 2 / 2


def losses(model, y):
    i_s, i_r = model.currents(y)
    copper = model.r_stator @ i_s**2 + model.p.rr_ohm * i_r @ i_r
    return copper + model.p.viscous_Nms * y[6] ** 2


def balance(model, y0, states, legs, dt):
    """Energies in J: (taken from the machine, lost, delivered to the dc link)."""
    every = np.vstack([y0, states])
    i = np.array([model.currents(y)[0] for y in every])
    link = -np.sum(legs * (i[1:] + i[:-1]) / 2) * dt
    lost = np.array([losses(model, y) for y in every])
    return energy(model, y0) - energy(model, every[-1]), trapezoid(lost, dx=dt), link


def test_with_all_legs_off_the_currents_fall_to_zero(model):
    y = running(model, 0.7)
    drive = Drive(model.p, y)
    drive.switch(*[OFF] * 6)
    before = drive.i
    states, legs = drive.advance(2e-6, 5000)
    currents = states[:, :6] @ drive.m.i_phase.T
    present = np.abs(currents) > 1e-3
    last = np.flatnonzero(present.any(axis=1))[-1]
    assert np.min(np.abs(before)) > 0.1 and 20 < last < 2500
    assert np.all(np.abs(currents[last + 1 :]) < 1e-3)
    # Currents only fall. Each keeps its sign until it is zero.
    assert np.all((currents * np.sign(before))[present] > 0)
    taken, lost, link = balance(model, y, states[: last + 1], legs[: last + 1], 2e-6)
    assert link > 0.1 * taken > 0
    assert taken == pytest.approx(lost + link, rel=2e-3)
    assert not drive.inv.diode.any()
    # From there on only the rotor has current.
    p = model.p
    first, end = states[2500], states[-1]
    t = 2e-6 * 2499
    decay = np.exp(-p.rr_ohm / (p.llr_H + p.lm_H) * t)
    assert np.hypot(*end[4:6]) == pytest.approx(decay * np.hypot(*first[4:6]), rel=1e-6)
    turned = np.angle(complex(*end[4:6]) / complex(*first[4:6]))
    assert turned == pytest.approx(p.pole_pairs * (end[7] - first[7]), abs=1e-5)
    coasting = np.exp(-p.viscous_Nms / p.inertia_kgm2 * t)
    assert end[6] == pytest.approx(first[6] * coasting, rel=1e-6)
    assert end[7] - first[7] == pytest.approx(t * (first[6] + end[6]) / 2, rel=1e-5)


def test_coasting_follows_the_slowing_shaft(model):
    """Steps as long as the loop takes them, and friction that stops the shaft in 60 ms: the rotor's
    flux turns with the mean speed of each step. Exact: speed and flux decay exponentially."""
    p = replace(model.p, viscous_Nms=model.p.inertia_kgm2 / 20e-3)
    y = model.state(np.zeros(6), 3 * np.cos(ANGLES), 60.0, 0.0)
    drive = Drive(p, y, legs=[OFF] * 6)
    states, _ = drive.advance(1e-4, 600)
    t = 1e-4 * np.arange(1, 601)
    angle = 60.0 * 20e-3 * (1 - np.exp(-t / 20e-3))
    decay = np.exp(-p.rr_ohm / (p.llr_H + p.lm_H) * t)
    flux = complex(*y[4:6]) * decay * np.exp(1j * p.pole_pairs * angle)
    np.testing.assert_allclose(states[:, 6], 60.0 * np.exp(-t / 20e-3), rtol=2e-5)
    np.testing.assert_allclose(states[:, 7], angle, rtol=2e-5)
    error = states[:, 4] + 1j * states[:, 5] - flux
    assert np.max(np.abs(error)) < 1e-4 * abs(flux[0])
    assert not drive.inv.diode.any()


@pytest.mark.parametrize("emf", [0.5, 0.57, 0.6, 0.8, 1.2])
def test_back_emf_above_the_dc_link_conducts(model, emf):
    """The rotor flux is free and turns at speed, and the legs are off. Two legs of a set conduct
    when their difference would exceed Vdc. The difference is sqrt 3 times the amplitude, so this
    begins at 0.577."""
    i_r = 10 * np.cos(ANGLES)
    p = replace(model.p, inertia_kgm2=1e9, viscous_Nms=0.0)
    induced = np.hypot(*model.state(np.zeros(6), i_r, 0, 0)[:2])
    omega = emf * VDC / induced / p.pole_pairs
    y = model.state(np.zeros(6), i_r, omega, 0.0)
    drive = Drive(p, y, legs=[OFF] * 6)
    drive.advance(5e-6)
    assert drive.y[7] == pytest.approx(omega * 5e-6, rel=1e-6)  # time passes
    quarter = 0.5 * np.pi / (omega * p.pole_pairs)
    dt = quarter / 1000
    y0 = drive.y.copy()
    states, legs = drive.advance(dt, 1000)
    assert drive.y[7] - y0[7] == pytest.approx(omega * 1000 * dt, rel=1e-6)
    currents = states[:, :6] @ drive.m.i_phase.T
    if np.sqrt(3) * emf < 1:
        np.testing.assert_allclose(currents, 0, atol=1e-6)
        return
    assert np.max(np.abs(currents)) > 0.01
    assert np.all(legs >= -1e-3 * VDC) and np.all(legs <= 1.001 * VDC)
    np.testing.assert_allclose(currents[:, ::2].sum(axis=1), 0, atol=1e-9)
    link = -np.sum(legs * currents) * dt
    assert link > 0  # into the dc link, whatever the instant
    assert np.all(np.sum(legs * currents, axis=1) < 1e-3 * VDC)
    torque = 3 * p.pole_pairs * drive.m.lm_over_lr * (
        states[:, 4] * (currents @ np.sin(ANGLES)) - states[:, 5] * (currents @ np.cos(ANGLES))
    ) / 3  # fmt: skip
    assert np.sum(torque) < 0  # braking
    slow = replace(model.p, inertia_kgm2=0.0, viscous_Nms=0.0)  # energy balance without the shaft
    taken, lost, _ = balance(type(model)(slow), y0, states, legs, dt)
    shaft = -np.sum(torque * states[:, 6]) * dt
    assert taken + shaft == pytest.approx(lost + link, rel=5e-3, abs=1e-3)


def test_the_number_of_legs_off_is_counted(symmetric):
    rng = np.random.default_rng(2)
    drive = Drive(symmetric.p, running(symmetric), legs=[OFF] * 6)
    assert drive.inv.off == 6
    for _ in range(500):
        set_leg(drive.inv, drive.m, drive.y, int(rng.integers(6)), int(rng.integers(3)))
        assert drive.inv.off == np.sum(drive.inv.leg == OFF)


def test_turning_off_twice_keeps_the_diode(symmetric):
    """A repeated trip must not decide the diodes again: floating legs stay floating."""
    drive = Drive(symmetric.p, running(symmetric))
    i = drive.i
    drive.switch(*[OFF] * 6)
    assert list(drive.inv.diode) == list(np.sign(i).astype(int))
    drive.inv.diode[2] = 0
    drive.switch(*[OFF] * 6)
    assert drive.inv.diode[2] == 0
