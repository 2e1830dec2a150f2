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

from .excitation import CommissioningError, Excitation, Frame, Samples, half_wave_Hz
from .regression import AXIS_GAIN, MEAN_GAIN, Value, linear, mean
from .resistance import Resistance

#: Half-waves, fast interrupts: long enough that most samples lie off the edges.
TICKS = 9
#: Shares of the stated limit: the direct current, the triangle's peak, and the one on each leg.
BIAS, SWING, AIM = 0.42, 0.25, 0.4
#: The triangle's peak with magnets. Nothing along its axis balances the voltage that the direct
#: current's legs lose there, and a low resistance makes much current of it.
MAGNETS_SWING = 0.15
#: Of their wave, during which nothing holds the rotor.
HELD_PERIODS = 24
PERIODS = 16
#: Two standard deviations of the method's own error, share: voltage that devices take beside the
#: lost voltages, edges, the sensors' delay. Of sigma L_s, and of L_xy, whose currents are steeper.
MODEL_ERROR, XY_MODEL_ERROR = 0.002, 0.004
#: Before each wave a direct current along alpha, share of the stated limit, brings a rotor with
#: magnets there. No further may it stand off; and it may do so by this angle unseen.
HOLD, HOLD_S, OFF_DEG, UNSEEN_DEG = 0.33, 0.4, 25.0, 2.0
#: Largest L_d over L_q that is taken for none.
ALIKE = 1.05
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


@dataclass(frozen=True)
class Salient:
    """The inductances of a machine whose rotor has magnets."""

    ld_H: Value
    lq_H: Value
    lxy_H: Value
    off_deg: tuple[float, float]  #: the rotor from alpha in both waves, as its saliency shows
    waves: tuple[Samples, ...] = ()  #: along alpha and along x

    @property
    def too_much(self) -> bool:
        """Whether L_d is above L_q by more than a drive may do without."""
        return self.ld_H.value > ALIKE * self.lq_H.value

    def usable(self) -> tuple[Value, Value]:
        """L_d and L_q as the firmware takes them: one value if L_d is a little above L_q."""
        if self.ld_H.value <= self.lq_H.value:
            return self.ld_H, self.lq_H
        one = mean([self.ld_H, self.lq_H]).plus(0.5 * (self.ld_H.value - self.lq_H.value))
        return one, one


def measure_magnets(
    test: Excitation, resistance: Resistance, per_H: tuple[float, float], xy_per_H: float
) -> Salient:
    """Measure with the rotor along alpha, where direct current has pulled it. `per_H`: the least
    and the largest conductance in alpha-beta, `xy_per_H`: 1/L_xy, roughly, from the wiring check.

    A wave along alpha makes a current along beta as well if the rotor stands beside alpha by t:

        d i_alpha/dt = (m + h cos 2t) v,  d i_beta/dt = h sin 2t v,  1/L_d = m + h, 1/L_q = m - h

    and one along beta the same with -h. So both slopes of both waves give L_d and L_q wherever it
    stands, and t tells which is which. During a wave nothing holds it but friction."""
    found: list[tuple[Value, Value]] = []
    waves = []
    for axis in (0, 1):
        _, wave = _along(test, resistance, axis, per_H[1], HOLD)
        direct, across = (_slopes(wave, axis, of)[0][0] for of in (axis, 1 - axis))
        found.append((direct, across))
        waves.append(wave)
    # Beside a wave along y a direct current along beta would flow, which turns the shaft.
    lxy_H, along_x = _along(test, resistance, 2, xy_per_H)
    ld_H, lq_H, off_deg = salient(found)
    if max(map(abs, off_deg)) > OFF_DEG:
        raise CommissioningError(
            f"inductance: the shaft has turned away from where direct current held it, by "
            f"{max(map(abs, off_deg)):.0f} electrical degrees: a brake must hold it"
        )
    gain = math.hypot(AXIS_GAIN, MODEL_ERROR)
    lxy_H = lxy_H.plus_share(math.hypot(AXIS_GAIN, XY_MODEL_ERROR))
    return Salient(
        ld_H.plus_share(gain), lq_H.plus_share(gain), lxy_H, off_deg, (waves[0], along_x)
    )


def salient(found: list[tuple[Value, Value]]) -> tuple[Value, Value, tuple[float, float]]:
    """L_d, L_q, and the rotor's angles from alpha in both waves, degrees, from the slopes (along,
    across) of a wave along alpha and of one along beta, 1/H."""
    (a, across_a), (b, across_b) = found
    half = 0.5 * (a.value - b.value)
    doubt = math.hypot(a.uncertainty, b.uncertainty)
    if abs(half) < 2 * doubt:  # no saliency to be seen, so no angle
        two_t = [0.0, 0.0]
    else:
        for _ in range(20):
            two_t = [math.asin(max(-1.0, min(1.0, s.value / half))) for s in (across_a, across_b)]
            half = (a.value - b.value) / sum(math.cos(t) for t in two_t)
    middle = a.value - half * math.cos(two_t[0])
    ends = middle + half, middle - half
    unseen = [half * (1 - math.cos(abs(t) + 2 * math.radians(UNSEEN_DEG))) for t in two_t]
    values = [
        Value(1 / end, math.hypot(wave.uncertainty, off) / end**2)
        for end, wave, off in zip(ends, (a, b), unseen)
    ]
    return values[0], values[1], (math.degrees(two_t[0]) / 2, math.degrees(two_t[1]) / 2)


def _on_legs(test: Excitation, leg_per_H: float) -> list[Samples]:
    """A wave on each leg in turn, whose conductance is `leg_per_H`."""
    hertz = half_wave_Hz(test.f_isr_Hz, TICKS)
    # The current is a triangle of 1/4 period's volt-seconds, over the leg's inductance.
    per_V = leg_per_H / (4 * hertz)
    volts = min(AIM * test.limits.current_A / per_V, test.most_pu * test.vdc_V)
    waves = []
    for leg in range(6):
        waves.append(test.pulse(test.on_leg(leg, volts), "square", hertz, PERIODS / hertz))
        test.rest(2 / hertz)
    return waves


def _along(
    test: Excitation, resistance: Resistance, axis: int, per_H: float, hold: float = 0.0
) -> tuple[Value, Samples]:
    """Inductance of one of the four axes, with a direct current along the other plane's one; and
    the wave that tells it. `hold`: until the wave begins a direct current along alpha, share of the
    stated limit, holds the shaft."""
    frame, limit_A, other = test.frame, test.limits.current_A, (axis + 2) % 4

    def bias_V(alpha: float) -> np.ndarray:
        bias_A = (frame.inverse[:, other] * BIAS + frame.inverse[:, 0] * alpha) * limit_A
        lost_V = resistance.of_legs(bias_A)
        return frame.transform @ (resistance.mean_ohm.value * bias_A + lost_V)

    hertz, swing = half_wave_Hz(test.f_isr_Hz, TICKS), MAGNETS_SWING if hold else SWING
    vector = bias_V(0.0)
    # No leg has more of the wave's voltage than the axis itself.
    room_V = test.most_pu * test.vdc_V - float(np.abs(frame.inverse @ vector).max())
    kind = "square-ab" if axis < 2 else "square-xy"
    found = Value(1 / per_H, 0.0)
    whole = HELD_PERIODS if hold else 4 * PERIODS
    for share, periods in ((0.25, PERIODS), (1.0, whole)):  # roughly, then right
        if hold:
            test.set(bias_V(hold))
            test.wait(HOLD_S)
            test.set(bias_V(0.3 * hold))  # beside the wave it must not take a leg to zero
            test.wait(0.02)
        elif share < 1:
            test.set(vector)
            test.wait(0.1)
        swing_V = share * swing * limit_A * 4 * hertz * found.value
        vector[axis] = min(swing_V, room_V)
        then_V = bias_V(hold) if hold else None
        wave = test.pulse(vector, kind, hertz, periods / hertz, then_V=then_V)
        found = along(wave, axis)
    test.rest(0.05)
    return found, wave


def along(wave: Samples, axis: int) -> Value:
    """The currents' slope over the voltage that changes its sign."""
    (per_H, *_), _ = _slopes(wave, axis)
    return Value(1 / per_H.value, per_H.uncertainty / per_H.value**2)


def _slopes(
    wave: Samples, axis: int, of: int | None = None
) -> tuple[list[Value], list[np.ndarray]]:
    """The parts of the slope of the current along an axis (`of`: along this one), and the columns
    that these factors belong to. What changes slowly, for the resistances and the rotor's flux, has
    columns of its own."""
    i = wave.i_vsd_A[:, axis if of is None else of]
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
    return _phases(inductance, float(np.diag(error_H).max()), waves[0].frame)


def _effective(wave: Samples, resistance: Resistance) -> tuple[np.ndarray, np.ndarray]:
    """Voltages of the four axes at the windings' inductances, and the currents' slopes, both
    (n, 4), where no edge is near."""
    middle_A = 0.5 * (wave.i_A[1:] + wave.i_A[:-1])
    ohm = np.array([value.value for value in resistance.rs_ohm])
    plane, inverse, _ = wave.frame
    legs_V = wave.v_V @ inverse.T - ohm * middle_A - resistance.of_legs(middle_A)
    slope = np.diff(wave.i_A, axis=0) @ plane.T / wave.dt_s
    steady = np.zeros(len(slope), bool)
    same = (np.abs(np.diff(wave.v_V, axis=0)).max(1) < 1e-9) & (np.abs(wave.v_V[1:]).max(1) > 0)
    steady[1:] = same
    return (legs_V @ plane.T)[steady], slope[steady]


def _phases(inductance: np.ndarray, error_H: float, frame: Frame) -> tuple[Value, ...]:
    """Split the matrix of the four axes into the planes' inductances and the phases' differences,
    whose sum is 0. Returns these."""
    columns = [np.diag([1.0, 1, 0, 0]), np.diag([0.0, 0, 1, 1])]
    columns += [np.outer(frame.transform[:, k], frame.inverse[k]) for k in range(6)]
    a = np.array([c.ravel() for c in columns]).T
    a = np.vstack([a, [0, 0, 1, 1, 1, 1, 1, 1]])
    target = np.append(inductance.ravel(), 0.0)
    x, *_ = np.linalg.lstsq(a, target, rcond=None)
    spread = error_H * np.sqrt(np.diag(np.linalg.pinv(a.T @ a)))
    return tuple(Value(float(f), float(s)) for f, s in zip(x[2:], spread[2:]))
