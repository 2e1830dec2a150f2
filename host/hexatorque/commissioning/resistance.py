"""Step b: the stator's resistance of each phase, and a leg's voltage loss to dead time and devices,
by direct current.

The current flows in the x-y plane, which has no rotor: no torque, no flux to wait for. A leg gives
its commanded voltage less `D s(i) + R i`: dead time and the devices' thresholds take D against the
current's direction, around zero current a share s of it. In a star of three legs only differences
of their voltages count, and those are linear in the six R and six D.

The x-y plane alone does not tell six R: a direct current along alpha beside it does. Phases that
differ drive small currents in alpha-beta as well, and until the rotor's flux has followed them it
takes some of the voltage there. So of the points without a direct current along alpha only the
voltages in x-y count, which no flux changes; one fit of all points finds all R and D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .excitation import FRAME, CommissioningError, Excitation, Frame
from .regression import MEAN_GAIN, PHASE_GAIN, Value, linear

#: Currents of the measurement, share of the stated limit.
LEVELS = (0.15, 0.35, 0.6)
#: Directions in the x-y plane, degrees, between those in which a leg has no current. Each current
#: also flows the other way.
DIRECTIONS_DEG = (15.0, 45.0, 75.0, 105.0, 135.0, 165.0)
#: Share of the largest current for the tests that follow.
MOST = 0.5
MEAN_S = 0.025
#: The same of a rotor with magnets, which may tremble: over a long time its voltage has no mean.
TREMBLES_S = 0.1
#: And two standard deviations of its phases' resistances, share, found on simulated drives: twelve
#: values from the same points, among them each leg's lost voltage.
STILL_ERROR = 0.025
#: The voltage of the first look grows by this share, but never by more than what drives this share
#: of the current aimed at through the resistance: below what dead time takes there is no current,
#: and beyond it a low resistance lets much through.
GROWTH, STEP = 0.3, 0.15
#: Directions in which the phases are told from each other: with the braking current no leg's
#: current is near zero, where the sets are 30 degrees apart and where they are 0 or 60. There the
#: voltages in alpha-beta count, and so the rotor's flux must have followed.
PHASE_DIRECTIONS_DEG = (30.0, 90.0, 150.0, 210.0, 270.0, 330.0)
OTHER_DIRECTIONS_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
PHASE_TIME_CONSTANTS = 3.0
#: Meanwhile a direct current along alpha, share of the stated limit, keeps the shaft from moving.
BRAKE = 0.2


class Points(NamedTuple):
    """Direct voltages (n, 4) and the currents that they drive (n, 6)."""

    v_V: np.ndarray
    i_A: np.ndarray

    @classmethod
    def of(cls, points: list[tuple[np.ndarray, np.ndarray]]) -> Points:
        return cls(*(np.array(part) for part in zip(*points)))


@dataclass(frozen=True)
class Resistance:
    rs_ohm: tuple[Value, ...]  #: of each phase, devices' on-resistance included
    lost_V: tuple[Value, ...]  #: of each leg, at full current
    mean_ohm: Value
    mean_lost_V: Value
    knee_A: float  #: the current from which on a leg loses all of it
    curve: np.ndarray  #: (n, 2): current and lost voltage, all legs
    vdc_V: float

    def of_legs(self, i_A: np.ndarray) -> np.ndarray:
        """The legs' lost voltage at these currents, (..., 6)."""
        lost = np.array([v.value for v in self.lost_V])
        return lost * np.clip(i_A / self.knee_A, -1, 1)


def measure(test: Excitation, xy_per_H: float, slow_s: float) -> Resistance:
    """`xy_per_H`: 1/L_xy, roughly, from the wiring check; `slow_s`: the machine's slow time
    constant, roughly: L_m/R_s + L_m/R_r."""
    found, points, settle_s = _in_xy(test, xy_per_H)
    braked = _braked(test, found, PHASE_TIME_CONSTANTS * slow_s)
    test.rest(settle_s)
    return with_devices(test, together(points, braked, found, test.frame))


def measure_still(test: Excitation, xy_per_H: float, least_per_H: float) -> Resistance:
    """The same without a current that would hold the shaft: it turns a rotor with magnets. There
    nothing is slow, so the currents of asymmetry in alpha-beta, whose least conductance is
    `least_per_H`, settle as well, and the same points tell the phases from each other."""
    drive = test.drive
    dead_s = 1e-6 * float(drive.get("dead_time_us")) * test.f_isr_Hz
    least_per_H = min(xy_per_H, least_per_H)
    found, _, settle_s = _in_xy(test, least_per_H, TREMBLES_S, dead_s * test.vdc_V)
    test.rest(settle_s)
    wide, share = found.mean_ohm.uncertainty, float(np.hypot(PHASE_GAIN, STILL_ERROR))
    phases = tuple(v.plus(wide).plus_share(share) for v in found.rs_ohm)
    return with_devices(test, replace(found, rs_ohm=phases))


def with_devices(test: Excitation, found: Resistance) -> Resistance:
    """The same with the uncertainty of how switch and diode share a leg's voltage drop. With u and
    d of them a voltage v makes it (u + d)/2 + (u - d) v/Vdc against the current: the second part
    looks like a resistance, (u - d)/Vdc of the true one. Neither is negative, so u - d lies within
    twice their mean, either way."""
    dead_s = 1e-6 * float(test.drive.get("dead_time_us")) * test.f_isr_Hz
    drop_V = max(0.0, found.mean_lost_V.value - dead_s * found.vdc_V)
    share = 2 / math.sqrt(3) * 2 * drop_V / found.vdc_V
    return replace(
        found,
        rs_ohm=tuple(value.plus_share(share) for value in found.rs_ohm),
        mean_ohm=found.mean_ohm.plus_share(share),
        lost_V=tuple(value.plus(share * drop_V) for value in found.lost_V),
        mean_lost_V=found.mean_lost_V.plus(share * drop_V),
    )


def _in_xy(
    test: Excitation, xy_per_H: float, mean_s: float = MEAN_S, dead_V: float = 0.0
) -> tuple[Resistance, Points, float]:
    """From direct currents in the x-y plane; their points; and their time to settle. `dead_V`: the
    voltage that dead time takes, by the parameters. It is not the same share of each leg's voltage:
    without it some current would flow in alpha-beta and turn a rotor with magnets."""
    frame, limit_A = test.frame, test.limits.current_A
    vdc_V = test.vdc_V
    ohm, lost_V = _rough(test, vdc_V, LEVELS[-1] * limit_A, xy_per_H, dead_V)
    settle_s = min(2.0, 8 / (ohm * xy_per_H))
    points = []
    for level in LEVELS:
        for degrees in DIRECTIONS_DEG:
            for turn in (0.0, 180.0):
                i_A = frame.inverse[:, 2:] @ (level * limit_A * _unit(degrees + turn))
                legs_V = ohm * i_A + lost_V * np.sign(np.where(np.abs(i_A) < 1e-6, 0, i_A))
                vector = frame.transform @ legs_V
                currents, _, _ = test.steady(vector, settle_s, mean_s)
                points.append((vector, currents))
    found = Points.of(points)
    return solve(*found, vdc_V, frame), found, settle_s


def _braked(test: Excitation, found: Resistance, settle_s: float) -> Points:
    """Points with a direct current along alpha, whose flux comes first."""
    size_A = MOST * test.limits.current_A
    transform, inverse, apart_deg = test.frame
    brake_A = inverse[:, 0] * BRAKE * test.limits.current_A

    def vector_V(wanted_A: np.ndarray) -> np.ndarray:
        return transform @ (found.mean_ohm.value * wanted_A + found.of_legs(wanted_A))

    test.set(vector_V(brake_A))
    test.wait(settle_s)
    points = []
    for degrees in PHASE_DIRECTIONS_DEG if apart_deg == 30 else OTHER_DIRECTIONS_DEG:
        vector = vector_V(inverse[:, 2:] @ (size_A * _unit(degrees)) + brake_A)
        currents, _, _ = test.steady(vector, settle_s, MEAN_S)
        points.append((vector, currents))
    return Points.of(points)


def together(xy: Points, braked: Points, rough: Resistance, frame: Frame = FRAME) -> Resistance:
    """All R and D from points in x-y and from points with a direct current along alpha. `rough` has
    the knee. Unknown are also what grows with the current's square, where a switch and a diode have
    other resistances, and a voltage in alpha-beta that a flux which still follows the direct
    current takes."""
    parts = [_rows(xy, slice(2, 4), rough.knee_A, frame)]
    parts.append(_rows(braked, slice(0, 4), rough.knee_A, frame))
    flux = [np.zeros((parts[0].shape[0], 2)), np.tile(np.eye(4, 2), (len(braked.i_A), 1))]
    rows = np.column_stack([np.vstack(parts), np.vstack(flux)])
    target = np.concatenate([xy.v_V[:, 2:].ravel(), braked.v_V.ravel()])
    values, _ = linear(list(rows.T), target)
    # The same with each six as their mean and five differences from it.
    for of in (slice(0, 6), slice(6, 12)):
        six = rows[:, of]
        rows[:, of] = np.column_stack([six.sum(1), six[:, :5] - six[:, 5:]])
    means, _ = linear(list(rows.T), target)
    return replace(
        rough,
        rs_ohm=tuple(value.plus_share(PHASE_GAIN) for value in values[:6]),
        lost_V=tuple(values[6:12]),
        mean_ohm=means[0].plus_share(MEAN_GAIN),
        mean_lost_V=means[6],
    )


def _rows(points: Points, axes: slice, knee_A: float, frame: Frame) -> np.ndarray:
    """The voltages along these axes that six R, six D and the current's square make, (n, 13)."""
    plane, i_A = frame.transform[axes], points.i_A
    shape = np.clip(i_A / knee_A, -1, 1)
    of_legs = np.concatenate([i_A, shape], axis=1)[:, None, :] * np.tile(plane, 2)
    square = (i_A * np.abs(i_A)) @ plane.T
    return np.concatenate([of_legs, square[..., None]], axis=2).reshape(-1, 13)


def _unit(degrees: float) -> np.ndarray:
    return np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])


def _rough(
    test: Excitation, vdc_V: float, aim_A: float, xy_per_H: float, dead_V: float
) -> tuple[float, float]:
    """Resistance and lost voltage, roughly: the voltage along x, beside `dead_V` of each leg that
    has a current, grows until the current flows. The parameter rs_ohm decides on the steps until
    two currents tell the resistance."""
    volts, points, along_x = 0.005 * vdc_V, [], test.frame.transform[2]
    legs = test.frame.inverse[:, 2]
    beside_V = dead_V * (test.frame.transform @ np.where(np.abs(legs) < 1e-6, 0.0, np.sign(legs)))
    ohm, settle_s = float(test.drive.get("rs_ohm")), 0.02
    while True:
        currents, _, _ = test.steady(beside_V + np.array([0, 0, volts, 0]), settle_s, 0.005)
        current_A = float(along_x @ currents)
        points.append((volts, current_A))
        if current_A > aim_A:
            break
        if len(points) > 1 and points[-2][1] > 0.05 * aim_A:
            (v0, i0), (v1, i1) = points[-2:]
            ohm = (v1 - v0) / max(i1 - i0, 0.01 * aim_A)
            settle_s = min(1.0, max(0.01, 6 / (ohm * xy_per_H)))
        volts += min(GROWTH * volts, STEP * aim_A * ohm)
        if volts > 0.4 * vdc_V:
            raise CommissioningError(
                f"{volts:.0f} V of direct current drive {current_A:.2f} A only: "
                f"no resistance can be measured with --current {test.limits.current_A:g}"
            )
    sure = [(v, i) for v, i in points if i > 0.3 * aim_A]
    if len(sure) < 2:
        return volts / current_A, dead_V
    (slope, lost), _ = linear(
        [np.array([i for _, i in sure]), np.ones(len(sure))], np.array([v for v, _ in sure])
    )
    # Along x every leg loses D against its current: together this much of the voltage.
    share = float(np.abs(along_x).sum())
    return max(slope.value, 1e-4), max(lost.value / share + dead_V, 0.0)


def solve(vectors_V: np.ndarray, i_A: np.ndarray, vdc_V: float, frame: Frame = FRAME) -> Resistance:
    """Resistances and lost voltages from direct voltages (n, 4) and currents (n, 6)."""
    legs_V = vectors_V @ frame.inverse.T
    largest_A = float(np.abs(i_A).max())
    best = None
    for share in (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.17, 0.25):
        knee_A = share * largest_A
        values, rest = linear(*_equations(legs_V, i_A, knee_A))
        size = float(rest @ rest)
        if best is None or size < 0.9 * best[0]:
            best = (size, knee_A, values)
    assert best is not None
    _, knee_A, values = best
    ohm, lost_V = _means(vectors_V, i_A, knee_A, frame)
    ohm = ohm.plus_share(MEAN_GAIN)
    found = Resistance(
        _about(ohm, values[:6]), _about(lost_V, values[6:]), ohm, lost_V, knee_A,
        np.empty((0, 2)), vdc_V,
    )  # fmt: skip
    return replace(found, curve=_curve(found, legs_V, i_A))


def _means(
    vectors_V: np.ndarray, i_A: np.ndarray, knee_A: float, frame: Frame
) -> tuple[Value, Value]:
    """One R and one D for all legs, from the points at which every leg loses all of its D. Only the
    x-y plane tells them: asymmetry drives small currents in the alpha-beta plane, which has not
    settled, and there the rotor adds its resistance."""
    beyond = np.abs(i_A).min(1) > knee_A
    if beyond.sum() < len(i_A) // 4:
        beyond[:] = True
    plane = frame.transform[2:].T
    shape = np.clip(i_A[beyond] / knee_A, -1, 1)
    columns = [(i_A[beyond] @ plane).ravel(), (shape @ plane).ravel()]
    (ohm, lost_V), _ = linear(columns, vectors_V[beyond, 2:].ravel())
    return ohm, lost_V


def _about(mean: Value, values: list[Value]) -> tuple[Value, ...]:
    """The values, all shifted by the same amount so that `mean` is their mean."""
    shift = mean.value - float(np.mean([v.value for v in values]))
    return tuple(Value(v.value + shift, v.uncertainty) for v in values)


def _equations(
    legs_V: np.ndarray, i_A: np.ndarray, knee_A: float
) -> tuple[list[np.ndarray], np.ndarray]:
    """In each star a leg's voltage less the star's mean is R i + D s, less their mean."""
    shape = np.clip(i_A / knee_A, -1, 1)
    columns = [_in_star(i_A, leg).ravel() for leg in range(6)]
    columns += [_in_star(shape, leg).ravel() for leg in range(6)]
    return columns, _less_mean(legs_V).ravel()


def _less_mean(values: np.ndarray) -> np.ndarray:
    out = values.copy()
    for star in range(2):
        out[:, star::2] -= out[:, star::2].mean(1, keepdims=True)
    return out


def _in_star(values: np.ndarray, leg: int) -> np.ndarray:
    """The voltages of all legs in its star that a quantity of one leg makes."""
    out = np.zeros_like(values)
    out[:, leg] = values[:, leg]
    return _less_mean(out)


def _curve(found: Resistance, legs_V: np.ndarray, i_A: np.ndarray) -> np.ndarray:
    """Points (current, lost voltage): what is left of the legs' voltages without the resistances,
    with the star's voltage from the fitted curve."""
    ohm = np.array([v.value for v in found.rs_ohm])
    lost = _less_mean(legs_V) - _less_mean(ohm * i_A)
    lost += found.of_legs(i_A) - _less_mean(found.of_legs(i_A))
    order = np.argsort(i_A.ravel())
    return np.column_stack([i_A.ravel()[order], lost.ravel()[order]])
