"""Step a, second part: direction and counts of the encoder, with a field that turns slowly.

A voltage vector turns in the alpha-beta plane, and an unloaded rotor follows it with little slip.
The shaft cannot outrun the field, so it turns no further than the field does, even if number of
pole pairs and counts are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .excitation import CommissioningError, Excitation
from .resistance import Resistance

FIELD_HZ = 1.5
#: Current of the field at standstill, share of the stated limit.
AIM = 0.5
#: The speed is averaged over this time, the last of the test.
WINDOW_S = 0.5
#: The field stands still for this time at the end.
BRAKE_S = 0.8
#: The firmware's limit on the shaft's movement, in terms of the stated one: counts may be wrong by
#: a factor of four, which is no reason to trip before it is known.
SLACK = 5.0
#: Speed over the field's: less is slip, more is a shaft that swings about its mean speed.
RIGHT = (0.75, 1.25)
#: A speed that grows by more than this share from quarter to quarter of the window still rises.
RISE = 0.01
NOTHING = 0.1


@dataclass(frozen=True)
class Encoder:
    mistakes: tuple[str, ...]
    ratio: float  #: measured speed over the field's, 1 less the slip if all is right
    speed_rpm: np.ndarray = field(default_factory=lambda: np.empty(0))  #: in the last WINDOW_S
    field_rpm: float = 0.0


def check(test: Excitation, resistance: Resistance, turns_rev: float) -> Encoder:
    """`turns_rev`: the field turns this often, and a shaft with one pole pair no further. If the
    shaft is then still getting faster, the field turns this often once more."""
    drive = test.drive
    size_A = AIM * test.limits.current_A
    # Rectangles of D on the legs have this amplitude in the plane.
    lost_V = 4 / np.pi * resistance.mean_lost_V.value
    volts = resistance.mean_ohm.value * size_A + lost_V
    test.set(np.array([volts, 0, 0, 0]), "rotate", FIELD_HZ)
    pole_pairs, counts = (float(drive.get(n)) for n in ("pole_pairs", "encoder_counts_rev"))
    field_rpm = 60 * FIELD_HZ / pole_pairs
    speed_rpm = _speed_after(test, turns_rev)
    if _on_the_way(speed_rpm, field_rpm):
        speed_rpm = _speed_after(test, turns_rev)
    test.set(np.array([volts, 0, 0, 0]))  # a field that stands still brakes the shaft
    test.wait(BRAKE_S)
    test.rest(0.05)
    moved = bool(np.ptp(speed_rpm) > 0 or speed_rpm[0] != 0)
    ratio = float(speed_rpm.mean()) / field_rpm
    if _on_the_way(speed_rpm, field_rpm):
        raise CommissioningError(
            f"encoder: after {2 * turns_rev:g} turns of the field the shaft is still getting "
            "faster: its inertia is large, choose more turns (--turns)"
        )
    mistakes = tuple(decide(ratio, moved, pole_pairs, counts))
    return Encoder(mistakes, ratio, speed_rpm, field_rpm)


def _speed_after(test: Excitation, turns_rev: float) -> np.ndarray:
    """The speed in the last part of this many turns of the field, r/min."""
    test.wait(max(0.0, turns_rev / FIELD_HZ - WINDOW_S))
    samples = 400
    prescaler = max(1, round(WINDOW_S * test.f_isr_Hz / samples))
    found = test.drive.capture(("speed_rpm",), samples, prescaler=prescaler, timeout_s=10)
    return np.asarray(found["speed_rpm"], float)


def _on_the_way(speed_rpm: np.ndarray, field_rpm: float) -> bool:
    """Whether the shaft is slower than the field and gets faster through all quarters of the
    window. One that swings about its mean speed does not."""
    means = np.abs([quarter.mean() for quarter in np.array_split(speed_rpm, 4)])
    rises = bool((np.diff(means) > RISE * means[:-1]).all())
    return rises and NOTHING < means.mean() / abs(field_rpm) < RIGHT[0]


def decide(
    ratio: float,
    moved: bool,
    pole_pairs: float,
    counts: float,
    right: tuple[float, float] = RIGHT,
) -> list[str]:
    size = abs(ratio)
    if size < NOTHING:
        return [
            "encoder: counts to and fro while the field turns: one channel is open"
            if moved
            else "encoder: counts nothing while the field turns: it is not connected or has no "
            "supply, or the shaft is blocked"
        ]
    mistakes = []
    if ratio < 0:
        mistakes.append(
            "encoder: counts backwards: exchange its channels A and B (or, to turn the machine the "
            "other way, leads u1 with u2, w1 with v2, v1 with w2)"
        )
    if not right[0] < size < right[1]:
        fits = [f"{_nearest(counts * size):g} counts"]
        if pairs := _nearest(pole_pairs / size):
            fits.append(f"or {pairs:g} pole pairs,")
        mistakes.append(
            f"encoder: counts {size:.2f} times the number by encoder_counts_rev = {counts:g} and "
            f"pole_pairs = {pole_pairs:g}: {', '.join(fits)} would fit"
        )
    return mistakes


def _nearest(value: float) -> float:
    """The value without digits that slip makes doubtful: whole if it is small, else two digits."""
    return float(round(value)) if value < 100 else float(f"{value:.2g}")
