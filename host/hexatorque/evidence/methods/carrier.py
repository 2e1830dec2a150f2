"""The analytic line: ripple of carrier modulation with double zero-sequence injection, in steady
state with ideal switches (docs/model.md, "Ripple of carrier modulation").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...plant.vsd import INVERSE, transform
from ...setups import Setup
from ...setups.design import Design
from .places import Place

#: Angles of the voltage over which the mean is taken.
ANGLES = 720
#: Largest amplitude of linear modulation, in units of V_dc.
MOST_PU = 1 / math.sqrt(3)
SET2 = np.array([False, True] * 3)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean over a period, of length 1, of the product of two legs' ripple volt-seconds.

    The legs are high for a and b, in the middle of the period. A leg's ripple volt-seconds are the
    integral of (state - duty ratio) from the middle."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return low * (1 - high) * (high * (2 - high) - low * low) / 24


@dataclass(frozen=True)
class SteadyState:
    """psi_Wb: stator flux, real; rotor_Wb: the rotor flux that the stator sees; v_V: stator
    voltage; i_A: stator current; all in alpha-beta. omega_rad_s: of the flux. A ripple d of the
    flux makes the current per_H d + salient_per_H conj(d)."""

    omega_rad_s: float
    psi_Wb: complex
    rotor_Wb: complex
    v_V: complex
    i_A: complex
    per_H: float
    salient_per_H: complex = 0j


def steady_state(setup: Setup, place: Place, flux_Wb: float) -> SteadyState:
    """From the equivalent circuit of a symmetrical machine, in the frame of its rotor flux. The
    flux of a machine with magnets is that of the least current, whatever flux_Wb is."""
    of = Design(setup, setup.parameter)
    direction = math.copysign(1.0, place.speed_rpm)
    torque_Nm = direction * place.torque_Nm
    omega_rad_s = setup["machine.pole_pairs"] * place.speed_rpm * math.pi / 30
    salient_per_H = 0.0
    if of.magnets:
        m = of.unsaturated
        i_A = complex(*m.least_current(torque_Nm))
        psi_Wb = complex(m.psi_f_Wb + m.ld_H * i_A.real, m.lq_H * i_A.imag)
        rotor_Wb = psi_Wb - m.lq_H * i_A
        per_H, salient_per_H = (1 / m.ld_H + 1 / m.lq_H) / 2, (1 / m.ld_H - 1 / m.lq_H) / 2
    else:
        # T = 3 p |r| i_q, |psi|^2 = (L_s i_d)^2 + (sigma L_s i_q)^2, |r| = (1 - sigma) L_s i_d
        m = of.unsaturated.linear_at(flux_Wb)
        k = torque_Nm / (3 * m.pole_pairs * (m.ls_H - m.sigma_ls_H))  # i_d i_q
        # (L_s i_d)^2 solves x^2 - psi^2 x + (sigma L_s L_s k)^2 = 0; the larger root has little
        # slip.
        rest = flux_Wb**4 - 4 * (m.sigma_ls_H * m.ls_H * k) ** 2
        if rest < 0:
            raise InputError(f"{flux_Wb:g} Wb cannot give {place.torque_Nm:g} N m")
        i_d = math.sqrt((flux_Wb**2 + math.sqrt(rest)) / 2) / m.ls_H
        i_A = complex(i_d, k / i_d)
        omega_rad_s += m.rr_ohm / m.lr_H * i_A.imag / i_d
        psi_Wb = complex(m.ls_H * i_d, m.sigma_ls_H * i_A.imag)
        rotor_Wb = (m.ls_H - m.sigma_ls_H) * i_d
        per_H = 1 / m.sigma_ls_H
    v_V = m.rs_ohm * i_A + 1j * omega_rad_s * psi_Wb
    turn = abs(psi_Wb) / psi_Wb
    at = (psi_Wb * turn, rotor_Wb * turn, v_V * turn, i_A * turn)
    return SteadyState(omega_rad_s, *at, per_H, salient_per_H * turn**2)


def ripple_rows(setup: Setup, at: SteadyState, turn: np.ndarray) -> np.ndarray:
    """(n, 5, 6): the currents in alpha, beta, x, y and the torque that a volt-second of a leg
    makes, with the steady state turned by `turn` (n,), complex of length 1."""
    alpha, beta, x, y = transform(float(setup["machine.displacement_deg"]))
    leg = (alpha + 1j * beta) + 0 * turn[:, None]
    i_A = at.per_H * leg + at.salient_per_H * (turn**2)[:, None] * leg.conj()
    i, psi = (value * turn[:, None] for value in (at.i_A, at.psi_Wb))
    torque = 3 * setup["machine.pole_pairs"] * (leg.conj() * i + psi.conj() * i_A).imag
    xy = [one / setup["machine.lxy_H"] + 0 * torque for one in (x, y)]
    return np.stack([i_A.real, i_A.imag, *xy, torque], axis=1)


def duty_ratios(v_pu: np.ndarray, clamped: float = 0.0, alternating: bool = False) -> np.ndarray:
    """(6, n) duty ratios of the legs for voltages in units of V_dc: each set's zero sequence in the
    middle between the rails, moved by the share `clamped` to where its largest leg stays on a
    rail, or alternating: set 1 takes the other rail within 15 degrees of 0, 60, 120 ... degrees,
    set 2 elsewhere."""
    near = np.cos(6 * np.angle(v_pu)) > 0
    legs = INVERSE[:, :2] @ np.stack([v_pu.real, v_pu.imag])
    duty = np.empty_like(legs)
    for own in (SET2, ~SET2):
        most, least = legs[own].max(axis=0), legs[own].min(axis=0)
        free = 0.5 * (1 - (most - least))
        # The middle one of the three legs has the sign of -(most + least).
        up = most + least > 0
        if alternating:
            up ^= ~near if own is SET2 else near
        away = np.where(up, free, -free)
        duty[own] = 0.5 + legs[own] - 0.5 * (most + least) + clamped * away
    return duty


def within_reach(m_pu: float) -> None:
    """InputError if a voltage of this amplitude, in units of V_dc, is beyond linear modulation."""
    if m_pu > MOST_PU:
        raise InputError(
            f"|v| = {m_pu:.3f} V_dc is beyond linear modulation: allowed range is 0 .. "
            f"{MOST_PU:.3f} V_dc; take a lower speed, load or controller.flux_ref_Wb"
        )


@dataclass(frozen=True)
class Ripple:
    """m_pu: the voltage's amplitude in units of V_dc."""

    m_pu: float
    td_Nm: float
    thd_inf_pct: float
    ixy_rms_A: float

    @classmethod
    def of(cls, at: SteadyState, m_pu: float, squares: np.ndarray) -> Ripple:
        """From the mean squares of what `ripple_rows` has; rounding may leave some below 0."""
        squares = np.maximum(squares, 0.0)
        i_ab, i_xy = squares[:2].sum(), squares[2:4].sum()
        thd = 100 * math.sqrt(i_ab + i_xy) / abs(at.i_A)
        return cls(m_pu, math.sqrt(squares[4]), thd, math.sqrt(i_xy))


def ripple(
    setup: Setup,
    place: Place,
    f_sw_Hz: float,
    flux_Wb: float,
    turned: bool = False,
    clamped: float = 0.0,
    alternating: bool = False,
) -> Ripple:
    """The ripple at a switching frequency. turned: the carrier of set 2 runs opposite to set 1's in
    every second 30 degrees of the voltage, else both run together. clamped, alternating: see
    `duty_ratios`."""
    at = steady_state(setup, place, flux_Wb)
    vdc_V = setup["inverter.vdc_V"]
    # The twelve sectors repeat each other, but mirrored: half a turn has whole pairs of them.
    turn = np.exp(1j * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES)
    v_pu = at.v_V * turn / vdc_V
    duty = duty_ratios(v_pu, clamped, alternating)
    within_reach(abs(at.v_V) / vdc_V)
    opposite = turned & (np.floor(np.angle(v_pu) / (np.pi / 6)) % 2 == 0)
    means = np.empty((6, 6, ANGLES))
    for a in range(6):
        for b in range(6):
            means[a, b] = product(duty[a], duty[b])
            if SET2[a] != SET2[b]:
                other = -product(duty[a], 1 - duty[b])
                means[a, b] = np.where(opposite, other, means[a, b])
    # A leg that stays on a rail does not switch: the period is shorter at the same f_sw.
    moving = np.mean((duty > 1e-9) & (duty < 1 - 1e-9))
    rows = ripple_rows(setup, at, turn) * (vdc_V * moving / f_sw_Hz)
    return Ripple.of(
        at, abs(at.v_V) / vdc_V, np.einsum("nka,nkb,abn->k", rows, rows, means) / ANGLES
    )
