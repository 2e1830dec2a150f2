"""Six-phase induction machine in VSD form, with any displacement of its two sets (plant/vsd.py).

The rotor's own state is its flux, alpha and beta in the stationary frame. Per-phase stator
resistance and leakage may differ, which couples alpha-beta with x-y:

    d psi_s/dt = v - R_s i_s
    d psi_r/dt =   - R_r i_r + p w J psi_r        (J: +90 degrees)
    (i_s, i_r) = L^-1 (psi_s, psi_r)
    T_e = 3 p L_m/L_r (psi_r x i_s)               (paper B, eqs. 2 to 5)
    J dw/dt = T_e - B w - T_load(w)

The iron's loss takes a part of T_e (plant/iron.py).

Two isolated neutrals: zero-sequence currents do not exist. The torque is written
with the rotor flux because that form also holds for an asymmetrical stator.
Magnetics are linear unless `psi_knee_Wb` is set (saturation.py): then currents come
from psi_s + s, psi_r + s and T_e = 3 p psi_m x i_s.
"""

from __future__ import annotations

import numpy as np

from .. import machine
from ..columns import add_columns
from ..elementary import exp, turned
from ..iron import FIELDS as IRON_FIELDS
from ..iron import iron_torque
from ..iron import values as iron_values
from ..load import load_torque
from ..machine import implements
from ..record import record
from ..vsd import transform
from .induction_parameters import Parameters
from .saturation import excess_flux, excess_gain, open_rotor, saturates

#: Matrices for the compiled code. They are records and not tuples of arrays, because a record is
#: passed by address. Counting references to arrays would take longer than the arithmetic.
_FIELDS = [
    ("induction", "i8"),
    ("slope", "f8", (6, 8)),  # column c = effect of flux c on (d psi/dt, i_alpha, i_beta)
    ("i_phase", "f8", (6, 6)),  # phase currents from the six fluxes
    ("g_leg", "f8", (6, 6)),  # d i_phase/dt per volt on each leg
    ("i_stator", "f8", (4, 6)),  # alpha, beta, x, y currents from the fluxes
    ("inv_l_max", "f8"),  # the largest di/dt per volt of stator voltage, 1/H
    ("lm_over_lr", "f8"),
    ("rr_over_lr", "f8"),
    ("pole_pairs", "f8"),
    ("torque_gain", "f8"),
    ("psi_knee_Wb", "f8"),  # 0: linear magnetics
    ("saturation_exponent", "f8"),
    ("main", "f8", (2, 6)),  # the linear machine's main flux from the six fluxes
    ("main_leg", "f8", (2, 6)),  # d main flux / dt per volt on each leg
    ("excess_share", "f8", (2, 2)),  # K of saturation.py
    ("i_excess", "f8", (6, 2)),  # phase currents from the excess flux
    ("inertia", "f8"),
    ("viscous", "f8"),
    *IRON_FIELDS,
]

#: A type for each kind of magnetics. Compiled code checks the type and not a value, so the option
#: costs a linear machine no time. Neither type has all fields of the other. Otherwise a function
#: compiled for one type would accept the other.
LINEAR = np.dtype([*_FIELDS, ("linear", "i8")])
SATURABLE = np.dtype([*_FIELDS, ("saturable", "i8")])


def make(p: Parameters) -> np.record:
    """Inductance and resistance matrices, inverted once."""
    phases = transform(p.displacement_deg)
    inverse = 3 * phases.T
    rs = phases @ np.diag(p.rs_ohm + np.array(p.drs_ohm)) @ inverse
    leakage = np.diag([p.lls_H, p.lls_H, p.lxy_H, p.lxy_H])
    leakage += phases @ np.diag(p.dlls_H) @ inverse
    inductance = np.zeros((6, 6))
    inductance[:4, :4] = leakage + np.diag([p.lm_H, p.lm_H, 0, 0])
    inductance[4:, 4:] = np.diag([p.lr_H, p.lr_H])
    inductance[:2, 4:] = inductance[4:, :2] = np.diag([p.lm_H, p.lm_H])
    current = np.linalg.inv(inductance)
    resistance = np.zeros((6, 6))
    resistance[:4, :4] = rs
    resistance[4:, 4:] = np.diag([p.rr_ohm, p.rr_ohm])
    rows = np.vstack([-resistance @ current, current[:2]])
    i_phase = inverse[p.phase_of_leg] @ current[:4]  # of the phase on each leg
    legs = phases[:, p.phase_of_leg]
    main = p.lm_H * (current[:2] + current[4:])
    kind = {"saturable" if p.psi_knee_Wb > 0 else "linear": 1}
    return record(
        SATURABLE if p.psi_knee_Wb > 0 else LINEAR,
        induction=1,
        **kind,
        slope=rows.T,
        i_phase=i_phase,
        g_leg=i_phase[:, :4] @ legs,
        i_stator=current[:4],
        inv_l_max=1 / np.linalg.eigvalsh(leakage)[0],
        lm_over_lr=p.lm_H / p.lr_H,
        rr_over_lr=p.rr_ohm / p.lr_H,
        pole_pairs=p.pole_pairs,
        torque_gain=3 * p.pole_pairs * p.lm_H / p.lr_H,
        psi_knee_Wb=p.psi_knee_Wb,
        saturation_exponent=p.saturation_exponent,
        main=main,
        main_leg=main[:, :4] @ legs,
        excess_share=np.eye(2) - main[:, :2] - main[:, 4:],
        i_excess=i_phase[:, :2] + i_phase[:, 4:],
        inertia=p.inertia_kgm2,
        viscous=p.viscous_Nms,
        **iron_values(p),
    )


def initial(m: np.record) -> np.ndarray:
    """No flux, no current, at rest."""
    return np.zeros(8)


def fastest_per_s(m: np.record) -> float:
    """Largest decay rate of the windings at standstill."""
    return float(np.abs(np.linalg.eigvals(m.slope[:, :6])).max())


@implements(machine.derivative, "induction")
def derivative(m, load, y, v, k):
    """Write d y/dt into k[0:8] for stator voltages v[0:4]."""
    y0, y1, y2, y3, y4, y5 = y[0], y[1], y[2], y[3], y[4], y[5]
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        y0 += s0
        y1 += s1
        y4 += s0
        y5 += s1
    add_columns(m.slope, y0, y1, y2, y3, y4, y5, k)
    i_alpha = k[6]
    i_beta = k[7]
    for r in range(4):
        k[r] += v[r]
    omega = y[6]
    w = m.pole_pairs * omega
    k[4] -= w * y[5]
    k[5] += w * y[4]
    torque = m.torque_gain * (y4 * i_beta - y5 * i_alpha)
    if saturates(m):
        torque -= 3.0 * m.pole_pairs * (s0 * i_beta - s1 * i_alpha)
    if m.iron != 0:
        torque -= iron_torque(m, y, omega)
    k[6] = (torque - m.viscous * omega - load_torque(load, omega)) / m.inertia
    k[7] = omega


@implements(machine.common_part, "induction")
def common_part(m, y):
    """Excess flux of saturation."""
    if saturates(m):
        return excess_flux(m, y)
    return 0.0, 0.0


@implements(machine.current_with, "induction")
def current_with(m, y, common, leg):
    total = 0.0
    for c in range(6):
        total += m.i_phase[leg, c] * y[c]
    if saturates(m):
        total += m.i_excess[leg, 0] * common[0] + m.i_excess[leg, 1] * common[1]
    return total


@implements(machine.constant_response, "induction")
def constant_response(m):
    return not saturates(m)


@implements(machine.phase_current_slope, "induction")
def phase_current_slope(m, gain, k, leg):
    """d/dt of a phase current, A/s, for flux slopes k[0:6]; `gain` = excess_gain(m, y)."""
    total = 0.0
    for c in range(6):
        total += m.i_phase[leg, c] * k[c]
    if saturates(m):
        main0 = 0.0
        main1 = 0.0
        for c in range(6):
            main0 += m.main[0, c] * k[c]
            main1 += m.main[1, c] * k[c]
        total += m.i_excess[leg, 0] * (gain[0] * main0 + gain[1] * main1)
        total += m.i_excess[leg, 1] * (gain[2] * main0 + gain[3] * main1)
    return total


@implements(machine.leg_response, "induction")
def leg_response(m, gain, leg, other):
    """d/dt of a phase current per volt on leg `other`, 1/H; `gain` = excess_gain(m, y)."""
    total = m.g_leg[leg, other]
    if saturates(m):
        main0 = m.main_leg[0, other]
        main1 = m.main_leg[1, other]
        total += m.i_excess[leg, 0] * (gain[0] * main0 + gain[1] * main1)
        total += m.i_excess[leg, 1] * (gain[2] * main0 + gain[3] * main1)
    return total


@implements(machine.stator_currents, "induction")
def stator_currents(m, y, i):
    """alpha, beta, x, y currents into i[0:4]."""
    for r in range(4):
        total = 0.0
        for c in range(6):
            total += m.i_stator[r, c] * y[c]
        i[r] = total
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        for r in range(4):
            i[r] += (m.i_stator[r, 0] + m.i_stator[r, 4]) * s0
            i[r] += (m.i_stator[r, 1] + m.i_stator[r, 5]) * s1


@implements(machine.torque_Nm, "induction")
def torque_Nm(m, y, i):
    """Electromagnetic torque from the state and the stator currents i[0:4]."""
    torque = m.torque_gain * (y[4] * i[1] - y[5] * i[0])
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        torque += (m.torque_gain - 3.0 * m.pole_pairs) * (s0 * i[1] - s1 * i[0])
    return torque


@implements(machine.losses, "induction")
def losses(m, y, drop):
    for axis in range(2):
        total = 0.0
        for c in range(6):
            total -= m.slope[c, 4 + axis] * y[c]
        drop[axis] = total
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        for axis in range(2):
            drop[axis] -= (m.slope[0, 4 + axis] + m.slope[4, 4 + axis]) * s0
            drop[axis] -= (m.slope[1, 4 + axis] + m.slope[5, 4 + axis]) * s1
    if m.iron != 0:
        return iron_torque(m, y, y[6]) * y[6]
    return 0.0


@implements(machine.incremental, "induction")
def incremental(m, y):
    return excess_gain(m, y)


@implements(machine.coast, "induction")
def coast(m, load, y, dt, most_V):
    """The rotor flux decays on its own."""
    w = m.pole_pairs * y[6]
    psi_r = np.sqrt(y[4] * y[4] + y[5] * y[5])
    ratio, rate = open_rotor(m, psi_r)
    # Induced voltage seen from the stator: d psi_m/dt by rotation and by decay, the
    # latter at most L_m/L_r that of the rotor flux.
    induced = psi_r * np.sqrt((ratio * w) ** 2 + (m.lm_over_lr * rate) ** 2)
    if 1.7321 * induced > most_V:
        return False
    # Exponential with the rate at mid-step: exact while the rate is constant.
    _, rate = open_rotor(m, psi_r * exp(-0.5 * rate * dt))
    decay = exp(-rate * dt)
    begun = ratio
    ratio, rate = open_rotor(m, psi_r * decay)
    # Heun's rule suffices for coasting: the speed hardly changes within a step.
    k0 = -(m.viscous * y[6] + load_torque(load, y[6])) / m.inertia
    if m.iron != 0:
        k0 -= iron_torque(m, y, y[6]) / m.inertia
    end = y[6] + dt * k0
    k1 = -(m.viscous * end + load_torque(load, end)) / m.inertia
    if m.iron != 0:
        shrunk = ratio / begun * decay
        k1 -= shrunk * shrunk * iron_torque(m, y, end) / m.inertia
    end = y[6] + 0.5 * dt * (k0 + k1)
    mean = 0.5 * (y[6] + end)
    y[7] += dt * mean
    y[6] = end
    w = m.pole_pairs * mean
    turn = turned(w * dt)
    c = turn.real * decay
    s = turn.imag * decay
    psi = y[4]
    y[4] = c * psi - s * y[5]
    y[5] = s * psi + c * y[5]
    y[0] = ratio * y[4]
    y[1] = ratio * y[5]
    y[2] = 0.0
    y[3] = 0.0
    return True
