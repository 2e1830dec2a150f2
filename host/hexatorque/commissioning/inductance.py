"""Step c: sigma L_s and L_xy, and each phase's leakage, by square waves of voltage.

For the planes' inductances the wave is along one axis, with a larger direct current along the axis
of the other plane that has the same sizes on every leg: alpha and x, beta and y. So no leg's
current changes its sign: the lost voltages (step b) stay what they are and drop out of the slopes'
difference. In the mean of a plane's two axes all phases have the same weight, and so their
differences drop out.

For the phases a wave on each leg in turn gives the slopes of all currents for every direction of
voltage, after the drop of resistance and the lost voltages are taken off. Their inverse is the
inductance of the four axes: the planes' own, and the differences of the phases' leakages.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..plant.vsd import INVERSE, TRANSFORM
from .excitation import Excitation, Samples, half_wave_Hz, on_leg
from .regression import MEAN_GAIN, Value, linear, mean
from .resistance import Resistance

#: Half-waves, fast interrupts: long enough that most samples lie off the edges.
TICKS = 9
#: Shares of the stated limit: the direct current, the triangle's peak, and the one on each leg.
BIAS, SWING, AIM = 0.42, 0.25, 0.4
PERIODS = 16
#: Two standard deviations of the method's own error, share: voltage that devices take beside the
#: lost voltages, edges, the sensors' delay. Of sigma L_s, and of L_xy, whose currents are steeper.
MODEL_ERROR, XY_MODEL_ERROR = 0.002, 0.004
#: The flux is gone after so many of the machine's slow time constants. With the gates off it decays
#: faster than these say.
DECAY = 4.0


@dataclass(frozen=True)
class Inductance:
    sigma_ls_H: Value
    lxy_H: Value
    dlls_H: tuple[Value, ...]  #: of each phase, against the mean
    waves: tuple[Samples, ...] = ()  #: along alpha and along x


def measure(
    test: Excitation, resistance: Resistance, ab_per_H: float, xy_per_H: float, slow_s: float
) -> Inductance:
    """`ab_per_H`, `xy_per_H`: 1/(sigma L_s) and 1/L_xy, roughly, from the wiring check; `slow_s`:
    the machine's slow time constant, roughly."""
    # A flux along one axis and a current along the other would turn the shaft.
    test.begin_again(DECAY * slow_s)
    (alpha, first), (beta, _) = (_along(test, resistance, axis, ab_per_H) for axis in (0, 1))
    waves = _on_legs(test, (ab_per_H + xy_per_H) / 3)
    y, _ = _along(test, resistance, 3, xy_per_H)
    test.begin_again(DECAY * slow_s)
    x, second = _along(test, resistance, 2, xy_per_H)
    sigma_ls_H = mean([alpha, beta]).plus_share(math.hypot(MEAN_GAIN, MODEL_ERROR))
    lxy_H = mean([x, y]).plus_share(math.hypot(MEAN_GAIN, XY_MODEL_ERROR))
    return Inductance(sigma_ls_H, lxy_H, phases(waves, resistance), (first, second))


def _on_legs(test: Excitation, leg_per_H: float) -> list[Samples]:
    """A wave on each leg in turn, whose conductance is `leg_per_H`."""
    hertz = half_wave_Hz(test.f_isr_Hz, TICKS)
    # The current is a triangle of 1/4 period's volt-seconds, over the leg's inductance.
    per_V = leg_per_H / (4 * hertz)
    volts = min(AIM * test.limits.current_A / per_V, test.most_pu * test.vdc_V)
    waves = []
    for leg in range(6):
        waves.append(test.pulse(on_leg(leg, volts), "square", hertz, PERIODS / hertz))
        test.rest(2 / hertz)
    return waves


def _along(
    test: Excitation, resistance: Resistance, axis: int, per_H: float
) -> tuple[Value, Samples]:
    """Inductance of one of the four axes, with a direct current along the other plane's one; and
    the wave that tells it."""
    limit_A, other = test.limits.current_A, (axis + 2) % 4
    hertz = half_wave_Hz(test.f_isr_Hz, TICKS)
    bias_A = INVERSE[:, other] * BIAS * limit_A
    vector = TRANSFORM @ (resistance.mean_ohm.value * bias_A + resistance.of_legs(bias_A))
    test.set(vector)
    test.wait(0.1)
    # No leg has more of the wave's voltage than the axis itself.
    room_V = test.most_pu * test.vdc_V - float(np.abs(INVERSE @ vector).max())
    kind = "square-ab" if axis < 2 else "square-xy"
    found = Value(1 / per_H, 0.0)
    for share, periods in ((0.25, PERIODS), (1.0, 4 * PERIODS)):  # roughly, then right
        swing_V = share * SWING * limit_A * 4 * hertz * found.value
        vector[axis] = min(swing_V, room_V)
        wave = test.pulse(vector, kind, hertz, periods / hertz)
        found = along(wave, axis)
    test.rest(0.05)
    return found, wave


def along(wave: Samples, axis: int) -> Value:
    """The currents' slope over the voltage that changes its sign."""
    (per_H, *_), _ = _slopes(wave, axis)
    return Value(1 / per_H.value, per_H.uncertainty / per_H.value**2)


def _slopes(wave: Samples, axis: int) -> tuple[list[Value], list[np.ndarray]]:
    """The parts of the currents' slope, and the columns that these factors belong to. What
    changes slowly, for the resistances and the rotor's flux, has columns of its own."""
    i = wave.i_vsd_A[:, axis]
    slope = np.diff(i) / wave.dt_s
    v = wave.v_V[:, axis]
    same = np.zeros(len(v), bool)
    same[1:] = np.abs(np.diff(v)) < 1e-9  # off the edges: sensors have a delay
    same &= np.arange(len(v)) > 2
    when = np.linspace(-1, 1, len(v))
    columns = [v, 0.5 * (i[1:] + i[:-1]), np.ones(len(v)), when, when**2]
    return linear([column[same] for column in columns], slope[same])[0], columns


def fitted(wave: Samples, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The current along an axis, measured and by the fitted slopes. In each half-wave both have the
    same mean."""
    factors, columns = _slopes(wave, axis)
    slopes = sum(factor.value * column for factor, column in zip(factors, columns))
    i = wave.i_vsd_A[:, axis]
    made = np.concatenate([[0.0], np.cumsum(slopes) * wave.dt_s])
    edges = 1 + np.flatnonzero(np.diff(wave.v_V[:, axis]))
    for part in np.split(np.arange(len(i)), edges):
        made[part] += (i[part] - made[part]).mean()
    return i, made


def phases(waves: list[Samples], resistance: Resistance) -> tuple[Value, ...]:
    """The difference of each phase's leakage, from a wave on each leg."""
    both = [_effective(wave, resistance) for wave in waves]
    v, slope = (np.concatenate([pair[k] for pair in both]) for k in range(2))
    # Each slope of the four axes from the four voltages: the inverse inductance, row by row.
    columns = [v[:, c] for c in range(4)]
    fits = [linear(columns, slope[:, r])[0] for r in range(4)]
    per_H = np.array([[value.value for value in values] for values in fits])
    spread = np.array([[value.uncertainty for value in values] for values in fits])
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


def _phases(inductance: np.ndarray, error_H: float) -> tuple[Value, ...]:
    """Split the matrix of the four axes into the planes' inductances and the phases' differences,
    whose sum is 0. Returns these."""
    columns = [np.diag([1.0, 1, 0, 0]), np.diag([0.0, 0, 1, 1])]
    columns += [np.outer(TRANSFORM[:, k], INVERSE[k]) for k in range(6)]
    a = np.array([c.ravel() for c in columns]).T
    a = np.vstack([a, [0, 0, 1, 1, 1, 1, 1, 1]])
    target = np.append(inductance.ravel(), 0.0)
    x, *_ = np.linalg.lstsq(a, target, rcond=None)
    spread = error_H * np.sqrt(np.diag(np.linalg.pinv(a.T @ a)))
    return tuple(Value(float(f), float(s)) for f, s in zip(x[2:], spread[2:]))
