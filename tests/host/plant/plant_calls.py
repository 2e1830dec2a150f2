"""The plant's functions for calls from Python, compiled once for all tests: numba keeps them on
disk, and compiles them again when a file of the plant changes."""

from types import SimpleNamespace

import numpy as np
from numba import njit

from hexatorque.plant import brake, gates, inverter, load, machine, pwm, sensors
from hexatorque.plant.compiled import source_hash
from hexatorque.plant.legs import OFF
from hexatorque.plant.machines import magnet
from hexatorque.plant.record import record

KEEP = -1
NO_LOAD = record(load.LOAD, **{n: float(n == "eddy_rad_s") for n in load.LOAD.names})


def machine_J(p, y):
    """Field of a machine's currents, magnets' pull on the teeth and motion of the shaft, from the
    definition of the inductances. p: the parameters of a linear machine."""
    moving = 0.5 * p.inertia_kgm2 * y[6] ** 2
    if hasattr(p, "psi_f_Wb"):
        i = np.empty(4)
        instant(magnet.make(p), NO_LOAD, y, np.zeros(4), np.empty(8), np.empty(6), i)
        along = complex(i[0], i[1]) * np.exp(-1j * (np.deg2rad(p.start_deg) + p.pole_pairs * y[7]))
        field = p.ld_H * along.real**2 + p.lq_H * along.imag**2 + p.lxy_H * (i[2] ** 2 + i[3] ** 2)
        pull = -p.cogging_Nm / p.cogging_per_rev * np.cos(p.cogging_per_rev * y[7])
        return 1.5 * field + pull + moving
    inverse = np.linalg.inv([[p.lls_H + p.lm_H, p.lm_H], [p.lm_H, p.llr_H + p.lm_H]])
    field = 1.5 * (y[2] ** 2 + y[3] ** 2) / p.lxy_H
    for axis in (0, 1):
        flux = np.array([y[axis], y[4 + axis]])
        field += 1.5 * flux @ inverse @ flux
    return field + moving


def _compile(source):
    """Numba's key of a kept function contains the variables of its closure, so `source`."""

    @njit(cache=True)
    def advance(inv, m, load, y, vdc, legs, times, states, v_legs):
        """For each row: apply the leg states (KEEP: as it is), advance by the time if it is not
        zero, keep state and leg voltages. Returns the largest current, A, that was found in a
        floating leg or against its diode."""
        worst = 0.0
        for n in range(len(times) if source else 0):
            for leg in range(6):
                if legs[n, leg] != KEEP:
                    inverter.set_leg(inv, m, y, leg, legs[n, leg])
            if times[n] > 0.0:
                inverter.advance(inv, m, load, y, times[n], vdc)
                if load.brake.torque_Nm > 0.0:
                    brake.settle_brake(inv, m, load, y)
            states[n] = y
            v_legs[n] = inv.v_leg
            for leg in range(6):
                if inv.leg[leg] == OFF:
                    current, diode = machine.phase_current(m, y, leg), inv.diode[leg]
                    worst = max(worst, abs(current) if diode == 0 else -current * diode)
        return worst

    @njit(cache=True)
    def integrate(m, load, y, volts, dt, steps, out):
        """Make `steps` steps for each row of volts. `out` has the states after each."""
        k, z = np.empty(8), np.empty((2, 8))
        for r in range(len(out) if source else 0):
            machine.rk4_step(m, load, y, volts[r // steps], dt, y, k, z)
            out[r] = y

    @njit(cache=True)
    def instant(m, load, y, v, k, i_leg, i):
        """Slopes and currents of a state; returns the torque."""
        if source:
            machine.derivative(m, load, y, v, k)
            for leg in range(6):
                i_leg[leg] = machine.phase_current(m, y, leg)
            machine.stator_currents(m, y, i)
        return machine.torque_Nm(m, y, i)

    @njit(cache=True)
    def torque_Nm(m, y, i):
        return machine.torque_Nm(m, y, i) if source else 0.0

    @njit(cache=True)
    def load_torque(on_shaft, omega):
        return load.load_torque(on_shaft, omega) if source else 0.0

    @njit(cache=True)
    def pwm_segment(pm, regs, ps, c0, c1, n):
        return pwm.pwm_segment(pm, regs, ps, c0, c1, n) if source else 0

    @njit(cache=True)
    def suppress_short_pulses(gd, pm, regs, ps, c0, c1, first, n):
        return gates.suppress_short_pulses(gd, pm, regs, ps, c0, c1, first, n) if source else 0

    @njit(cache=True)
    def sample(se, m, y, vdc, regs):
        if source:
            sensors.sample(se, m, y, vdc, regs)

    @njit(cache=True)
    def filter_currents(se, m, y, dt):
        if source:
            sensors.filter_currents(se, m, y, dt)

    return SimpleNamespace(**{name: f for name, f in locals().items() if name != "source"})


_calls = _compile(source_hash())
instant = _calls.instant
torque_Nm = _calls.torque_Nm
load_torque = _calls.load_torque
pwm_segment = _calls.pwm_segment
suppress_short_pulses = _calls.suppress_short_pulses
sample = _calls.sample
filter_currents = _calls.filter_currents


def _advance(inv, m, load, y, vdc, legs, times):
    states, v_legs = np.empty((len(times), 8)), np.empty((len(times), 6))
    return states, v_legs, _calls.advance(inv, m, load, y, vdc, legs, times, states, v_legs)


def set_leg(inv, m, y, leg, state):
    legs = np.full((1, 6), KEEP)
    legs[0, leg] = state
    _advance(inv, m, NO_LOAD, y, 0.0, legs, np.zeros(1))


def advance(inv, m, load, y, dt, vdc, steps=1):
    """The states and the leg voltages after each step."""
    return _advance(inv, m, load, y, vdc, np.full((steps, 6), KEEP), np.full(steps, dt))[:2]


def switch(inv, m, load, y, vdc, legs, times):
    """Apply rows of leg states for these times. Returns the largest current, A, that is found in a
    floating leg or against its diode."""
    return _advance(inv, m, load, y, vdc, legs, times)[2]


def integrate(m, load, y, volts, dt, steps=1):
    """The states after each of `steps` steps for each row of volts; `y` is not changed."""
    out = np.empty((len(volts) * steps, 8))
    _calls.integrate(m, load, y.copy(), np.asarray(volts, float), dt, steps, out)
    return out
