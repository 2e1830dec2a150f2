"""The analytic line: ripple of carrier modulation with double zero-sequence injection, in steady
state with ideal switches (docs/model.md, "Ripple of carrier modulation").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...plant.vsd import INVERSE, TRANSFORM
from ...setups import Setup
from .places import Place

#: Angles of the voltage over which the mean is taken.
ANGLES = 720
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
    voltage; i_A: stator current; all in alpha-beta. omega_rad_s: of the flux."""

    omega_rad_s: float
    psi_Wb: complex
    rotor_Wb: complex
    v_V: complex
    i_A: complex


def sigma_ls_H(setup: Setup) -> float:
    m = setup.machine_values()
    return float(m["lls_H"] + m["lm_H"] * m["llr_H"] / (m["lm_H"] + m["llr_H"]))


def steady_state(setup: Setup, place: Place, flux_Wb: float) -> SteadyState:
    """From the equivalent circuit of a symmetrical linear machine, in the frame of its rotor flux:
    T = 3 p |r| i_q, |psi|^2 = (L_s i_d)^2 + (sigma L_s i_q)^2, |r| = (1 - sigma) L_s i_d."""
    m = setup.machine_values()
    pairs, small_H = m["pole_pairs"], sigma_ls_H(setup)
    ls_H, lr_H = m["lls_H"] + m["lm_H"], m["llr_H"] + m["lm_H"]
    direction = math.copysign(1.0, place.speed_rpm)
    k = direction * place.torque_Nm / (3 * pairs * (ls_H - small_H))  # i_d i_q
    # (L_s i_d)^2 solves x^2 - psi^2 x + (sigma L_s L_s k)^2 = 0; the larger root has little slip.
    rest = flux_Wb**4 - 4 * (small_H * ls_H * k) ** 2
    if rest < 0:
        raise ValueError(f"{flux_Wb:g} Wb cannot give {place.torque_Nm:g} N m")
    i_d = math.sqrt((flux_Wb**2 + math.sqrt(rest)) / 2) / ls_H
    i_q = k / i_d
    slip_rad_s = m["rr_ohm"] / lr_H * i_q / i_d
    omega_rad_s = pairs * place.speed_rpm * math.pi / 30 + slip_rad_s
    psi_Wb = complex(ls_H * i_d, small_H * i_q)
    i_A = complex(i_d, i_q)
    v_V = m["rs_ohm"] * i_A + 1j * omega_rad_s * psi_Wb
    turn = abs(psi_Wb) / psi_Wb
    rotor_Wb = (ls_H - small_H) * i_d * turn
    return SteadyState(omega_rad_s, psi_Wb * turn, rotor_Wb, v_V * turn, i_A * turn)


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


@dataclass(frozen=True)
class Ripple:
    """m_pu: the voltage's amplitude in units of V_dc."""

    m_pu: float
    td_Nm: float
    thd_inf_pct: float
    ixy_rms_A: float


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
    if duty.min() < -1e-9 or duty.max() > 1 + 1e-9:
        raise ValueError(f"|v| = {abs(at.v_V) / vdc_V:.3f} V_dc: beyond linear modulation")
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
    size_Vs = vdc_V * moving / f_sw_Hz

    def mean_square(rows: np.ndarray) -> float:
        return float(np.mean(np.einsum("kan,kbn,abn->n", rows, rows, means)))

    ab, xy = (
        np.repeat(TRANSFORM[rows, :, None], ANGLES, axis=2) for rows in (slice(2), slice(2, 4))
    )
    i_ab_A = size_Vs / sigma_ls_H(setup) * math.sqrt(mean_square(ab))
    i_xy_A = size_Vs / setup["machine.lxy_H"] * math.sqrt(mean_square(xy))
    rotor = at.rotor_Wb * turn
    across = (rotor.real * ab[1] - rotor.imag * ab[0])[None]  # r x (a leg's volt-seconds)
    per_Wb = 3 * setup["machine.pole_pairs"] / sigma_ls_H(setup)
    return Ripple(
        m_pu=abs(at.v_V) / vdc_V,
        td_Nm=per_Wb * size_Vs * math.sqrt(mean_square(across)),
        thd_inf_pct=100 * math.hypot(i_ab_A, i_xy_A) / abs(at.i_A),
        ixy_rms_A=i_xy_A,
    )
