"""Asymmetrical six-phase induction machine in VSD form.

State, SI units: stator flux (alpha, beta, x, y), rotor flux (alpha, beta) in the
stationary frame, mechanical speed and angle. Per-phase stator resistance and leakage
may differ, which couples alpha-beta with x-y:

    d psi_s/dt = v - R_s i_s
    d psi_r/dt =   - R_r i_r + p w J psi_r        (J: +90 degrees)
    (i_s, i_r) = L^-1 (psi_s, psi_r)
    T_e = 3 p L_m/L_r (psi_r x i_s)               (paper B, eqs. 2 to 5)
    J dw/dt = T_e - B w - T_load(w)

Two isolated neutrals: zero-sequence currents do not exist. The torque is written
with the rotor flux because that form also holds for an asymmetrical stator.
Magnetics are linear unless `psi_knee_Wb` is set (saturation.py): then currents come
from psi_s + s, psi_r + s and T_e = 3 p psi_m x i_s.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numba.extending import overload

from .machine_parameters import MachineParameters
from .record import record
from .saturation import excess_flux
from .vsd import INVERSE, TRANSFORM

#: Matrices for the compiled code. Records rather than tuples of arrays: passed by
#: address, without reference counting, which costs more than the arithmetic.
_FIELDS = [
    ("slope", "f8", (6, 8)),  # column c = effect of flux c on (d psi/dt, i_alpha, i_beta)
    ("i_phase", "f8", (6, 6)),  # phase currents from the six fluxes
    ("g_leg", "f8", (6, 6)),  # d i_phase/dt per volt on each leg
    ("i_stator", "f8", (4, 6)),  # alpha, beta, x, y currents from the fluxes
    ("inv_l_max", "f8"),  # the fastest di/dt per volt that a stator voltage finds, 1/H
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
]

#: A type for each kind of magnetics. Compiled code asks for the type, not for a value:
#: a linear machine pays nothing for the option. Neither type's fields contain the
#: other's, or a function compiled for the one would accept the other.
LINEAR = np.dtype([*_FIELDS, ("linear", "i8")])
SATURABLE = np.dtype([*_FIELDS, ("saturable", "i8")])


def saturates(m) -> bool:
    """Does this machine's record saturate? Known when the code is compiled."""
    return "saturable" in m.dtype.names


@overload(saturates, inline="always")
def _saturates(m):
    known = "saturable" in m.fields
    return lambda m: known


def machine_record(p: MachineParameters) -> np.record:
    """Inductance and resistance matrices, inverted once."""
    rs = TRANSFORM @ np.diag(p.rs_ohm + np.array(p.drs_ohm)) @ INVERSE
    leakage = np.diag([p.lls_H, p.lls_H, p.lxy_H, p.lxy_H])
    leakage += TRANSFORM @ np.diag(p.dlls_H) @ INVERSE
    inductance = np.zeros((6, 6))
    inductance[:4, :4] = leakage + np.diag([p.lm_H, p.lm_H, 0, 0])
    inductance[4:, 4:] = np.diag([p.lr_H, p.lr_H])
    inductance[:2, 4:] = inductance[4:, :2] = np.diag([p.lm_H, p.lm_H])
    current = np.linalg.inv(inductance)
    resistance = np.zeros((6, 6))
    resistance[:4, :4] = rs
    resistance[4:, 4:] = np.diag([p.rr_ohm, p.rr_ohm])
    rows = np.vstack([-resistance @ current, current[:2]])
    i_phase = INVERSE @ current[:4]
    main = p.lm_H * (current[:2] + current[4:])
    kind = {"saturable" if p.psi_knee_Wb > 0 else "linear": 1}
    return record(
        SATURABLE if p.psi_knee_Wb > 0 else LINEAR,
        **kind,
        slope=rows.T,
        i_phase=i_phase,
        g_leg=i_phase[:, :4] @ TRANSFORM,
        i_stator=current[:4],
        inv_l_max=1 / np.linalg.eigvalsh(leakage)[0],
        lm_over_lr=p.lm_H / p.lr_H,
        rr_over_lr=p.rr_ohm / p.lr_H,
        pole_pairs=p.pole_pairs,
        torque_gain=3 * p.pole_pairs * p.lm_H / p.lr_H,
        psi_knee_Wb=p.psi_knee_Wb,
        saturation_exponent=p.saturation_exponent,
        main=main,
        main_leg=main[:, :4] @ TRANSFORM,
        excess_share=np.eye(2) - main[:, :2] - main[:, 4:],
        i_excess=i_phase[:, :2] + i_phase[:, 4:],
        inertia=p.inertia_kgm2,
        viscous=p.viscous_Nms,
    )


#: Load torque as a function of speed: the sum of all terms.
LOAD = np.dtype(
    [
        ("constant_Nm", "f8"),
        ("linear_Nms", "f8"),
        ("quadratic_Nms2", "f8"),
        ("dry_Nm", "f8"),  # opposes motion
        ("eddy_Nm", "f8"),  # peak of an eddy-current brake
        ("eddy_rad_s", "f8"),  # speed of that peak, > 0
    ]
)

#: Speed over which dry friction changes sign.
DRY_RAD_S = 0.5


@njit(inline="always")
def load_torque(load, omega):
    """Torque that the load takes at `omega` (mechanical rad/s)."""
    torque = load.constant_Nm + omega * (load.linear_Nms + load.quadratic_Nms2 * abs(omega))
    if load.dry_Nm != 0.0:
        torque += load.dry_Nm * np.tanh(omega / DRY_RAD_S)
    if load.eddy_Nm != 0.0:
        s = omega / load.eddy_rad_s
        torque += load.eddy_Nm * 2.0 * s / (1.0 + s * s)
    return torque


@njit(inline="always")
def derivative(m, load, y, v, k):
    """Write d y/dt into k[0:8] for stator voltages v[0:4]."""
    y0, y1, y2, y3, y4, y5 = y[0], y[1], y[2], y[3], y[4], y[5]
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        y0 += s0
        y1 += s1
        y4 += s0
        y5 += s1
    for r in range(8):
        k[r] = (
            (m.slope[0, r] * y0 + m.slope[1, r] * y1)
            + (m.slope[2, r] * y2 + m.slope[3, r] * y3)
            + (m.slope[4, r] * y4 + m.slope[5, r] * y5)
        )
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
    k[6] = (torque - m.viscous * omega - load_torque(load, omega)) / m.inertia
    k[7] = omega


@njit
def rk4_step(m, load, y, v, dt, out, k, z):
    """One classical Runge-Kutta step from y to out (may be the same array).

    `k` (8,) and `z` (2, 8) are work space.
    """
    total = z[0]
    stage = z[1]
    derivative(m, load, y, v, k)
    for r in range(8):
        total[r] = k[r]
        stage[r] = y[r] + 0.5 * dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        total[r] += 2.0 * k[r]
        stage[r] = y[r] + 0.5 * dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        total[r] += 2.0 * k[r]
        stage[r] = y[r] + dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        out[r] = y[r] + dt / 6.0 * (total[r] + k[r])


@njit(inline="always")
def phase_current(m, y, leg):
    total = 0.0
    for c in range(6):
        total += m.i_phase[leg, c] * y[c]
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        total += m.i_excess[leg, 0] * s0 + m.i_excess[leg, 1] * s1
    return total


@njit(inline="always")
def phase_current_slope(m, gain, k, leg):
    """d/dt of a phase current, A/s, for flux slopes k[0:6]; `gain` = excess_gain(m, y)."""
    total = 0.0
    main0 = 0.0
    main1 = 0.0
    for c in range(6):
        total += m.i_phase[leg, c] * k[c]
        main0 += m.main[0, c] * k[c]
        main1 += m.main[1, c] * k[c]
    return (
        total
        + m.i_excess[leg, 0] * (gain[0] * main0 + gain[1] * main1)
        + m.i_excess[leg, 1] * (gain[2] * main0 + gain[3] * main1)
    )


@njit(inline="always")
def leg_response(m, gain, leg, other):
    """d/dt of a phase current per volt on leg `other`, 1/H; `gain` = excess_gain(m, y)."""
    main0 = m.main_leg[0, other]
    main1 = m.main_leg[1, other]
    return (
        m.g_leg[leg, other]
        + m.i_excess[leg, 0] * (gain[0] * main0 + gain[1] * main1)
        + m.i_excess[leg, 1] * (gain[2] * main0 + gain[3] * main1)
    )


@njit(inline="always")
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


@njit(inline="always")
def torque_Nm(m, y, i):
    """Electromagnetic torque from the state and the stator currents i[0:4]."""
    torque = m.torque_gain * (y[4] * i[1] - y[5] * i[0])
    if saturates(m):
        s0, s1 = excess_flux(m, y)
        torque += (m.torque_gain - 3.0 * m.pole_pairs) * (s0 * i[1] - s1 * i[0])
    return torque
