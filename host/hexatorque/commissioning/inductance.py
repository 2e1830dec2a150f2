"""Step c: sigma L_s and L_xy, and each phase's leakage, by square waves of voltage.

A wave on each leg in turn gives the slopes of all currents for every direction of voltage, less
what resistance and lost voltages (step b) take. Their inverse is the inductance of the four axes:
sigma L_s twice, L_xy twice, and what the phases' leakages differ by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..plant.vsd import INVERSE, TRANSFORM
from .excitation import Excitation, Samples, half_wave_Hz, on_leg
from .regression import Value, linear
from .resistance import Resistance

#: Half-waves, fast interrupts: long enough that most samples lie off the edges.
TICKS = 9
#: Currents aimed at, share of the stated limit.
AIM = 0.4
MOST_PU = 0.4
PERIODS = 16


@dataclass(frozen=True)
class Inductance:
    sigma_ls_H: Value
    lxy_H: Value
    dlls_H: tuple[Value, ...]  #: of each phase, against the mean


def measure(
    test: Excitation, resistance: Resistance, ab_per_H: float, xy_per_H: float
) -> Inductance:
    """The last two: 1/(sigma L_s) and 1/L_xy, roughly, from the wiring check."""
    vdc_V = test.vdc_V
    hertz = half_wave_Hz(test.f_isr_Hz, TICKS)
    # On one leg the current is a triangle of 1/4 period's volt-seconds, over the leg's inductance.
    per_V = (ab_per_H + xy_per_H) / 3 / (4 * hertz)
    volts = min(AIM * test.limits.current_A / per_V, MOST_PU * vdc_V)
    waves = []
    for leg in range(6):
        waves.append(test.pulse(on_leg(leg, volts), "square", hertz, PERIODS / hertz))
        test.rest(2 / hertz)
    return solve(waves, resistance)


def solve(waves: list[Samples], resistance: Resistance) -> Inductance:
    rows, slopes, again = [], [], []
    for wave in waves:
        v, slope = _effective(wave, resistance)
        rows.append(v)
        slopes.append(slope)
        again.append(len(v))
    v, slope = np.concatenate(rows), np.concatenate(slopes)
    # Each slope of the four axes from the four voltages: the inverse inductance, row by row.
    columns = [v[:, c] for c in range(4)]
    fits = [linear(columns, slope[:, r]) for r in range(4)]
    per_H = np.array([[value.value for value in values] for values, _ in fits])
    spread = np.array([[value.uncertainty for value in values] for values, _ in fits])
    inductance = np.linalg.inv(0.5 * (per_H + per_H.T))
    error_H = np.sqrt((inductance**2) @ (spread**2) @ (inductance**2))
    return _phases(inductance, float(np.diag(error_H).max()))


def _effective(wave: Samples, resistance: Resistance) -> tuple[np.ndarray, np.ndarray]:
    """Voltages of the four axes at the windings' inductances, and the currents' slopes, both
    (n, 4), where no edge is near."""
    middle_A = 0.5 * (wave.i_A[1:] + wave.i_A[:-1])
    ohm = np.array([value.value for value in resistance.rs_ohm])
    legs_V = wave.v_V @ INVERSE.T - ohm * middle_A - resistance.of_legs(middle_A)
    slope = np.diff(wave.i_A, axis=0) @ TRANSFORM.T / wave.dt_s
    steady = np.zeros(len(slope), bool)
    same = (np.abs(np.diff(wave.v_V, axis=0)).max(1) < 1e-9) & (np.abs(wave.v_V[1:]).max(1) > 0)
    steady[1:] = same
    return (legs_V @ TRANSFORM.T)[steady], slope[steady]


def _phases(inductance: np.ndarray, error_H: float) -> Inductance:
    """Split the matrix of the four axes into the planes' inductances and the phases' differences,
    whose sum is 0."""
    columns = [np.diag([1.0, 1, 0, 0]), np.diag([0.0, 0, 1, 1])]
    columns += [np.outer(TRANSFORM[:, k], INVERSE[k]) for k in range(6)]
    a = np.array([c.ravel() for c in columns]).T
    a = np.vstack([a, [0, 0, 1, 1, 1, 1, 1, 1]])
    target = np.append(inductance.ravel(), 0.0)
    x, *_ = np.linalg.lstsq(a, target, rcond=None)
    covariance = np.linalg.pinv(a.T @ a)
    spread = error_H * np.sqrt(np.diag(covariance))
    values = [Value(float(f), float(s)) for f, s in zip(x, spread)]
    return Inductance(values[0], values[1], tuple(values[2:]))
