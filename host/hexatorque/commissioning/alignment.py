"""The encoder's count at known angles of the magnets, to which direct current pulls them.

Direct current holds the d axis along itself. First it pulls the rotor to a quarter of an electrical
turn beside alpha, so that one which stood exactly against it is pulled all the same, then to alpha.
From there the current's direction goes forwards by some electrical turns and back, in steps small
enough for the shaft to follow. At some directions the encoder's count is read: the counts of an
electrical turn tell the encoder's direction, its counts and the pole pairs. Where the count is 0
the d axis has the angle `rotor_zero_deg`, or where an index or an absolute encoder has its zero.

Friction keeps the rotor behind on its way, on either side of the true angle, and drops out of the
mean of both ways. Cogging, the pull of the teeth on the magnets, repeats itself several times in an
electrical turn. The directions meet it at all its angles, however often this is, and their scatter
shows it. The measured currents tell the current's direction better than the commanded voltage, for
phases differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..setups import derived
from .encoder import decide
from .excitation import CommissioningError, Excitation
from .regression import Value
from .resistance import Resistance

#: Direct current, share of the stated limit.
AIM = 0.5
#: A step of its direction, and the time of a step: the direction turns with this share of the
#: shaft's natural frequency, and no faster than by a step in the least time.
STEP_DEG = 15.0
SHARE, LEAST_S, MOST_S = 0.25, 0.03, 0.5
#: The current grows to its size in so many parts.
PARTS = 10
#: A shaft that swings by no more than this, electrical degrees, rests; and how long it may take.
REST_DEG, REST_S = 1.0, 15.0
#: The count is read in these directions on either way, shares of the way: multiples of the golden
#: section, which no number of periods has in step.
STOPS = tuple(sorted(k * (math.sqrt(5) - 1) / 2 % 1 for k in range(1, 8)))
#: And the way goes on beyond the last one, degrees, so that the way back begins with it.
BEYOND_DEG = 30.0
#: Two standard deviations of the angle that no scatter shows: the sensors' gains.
METHOD_DEG = 0.3
#: Counts over those by the parameters: no slip, but cogging and friction.
RIGHT = (0.97, 1.03)

NOTHING = Value(0.0, 0.0)


@dataclass(frozen=True)
class Alignment:
    mistakes: tuple[str, ...]
    ratio: float  #: counts of an electrical turn over those by the parameters
    zero_deg: Value = NOTHING  #: angle of the d axis where the encoder has its zero
    zero_known: bool = True  #: else that is where it counts 0
    friction_deg: float = 0.0  #: the rotor stays so far behind
    #: (n, 2): electrical angles in degrees: the current's, and the encoder's from the first one on.
    readings: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))


def measure(
    test: Excitation, resistance: Resistance, turns: float, salient_H: float = 0.0
) -> Alignment:
    """`turns`: electrical turns each way, one at least. `salient_H`: L_q less L_d at most, roughly:
    too large a current would turn the q axis towards itself."""
    drive = test.drive
    pairs, counts_rev = (float(drive.get(n)) for n in ("pole_pairs", "encoder_counts_rev"))
    size_A = AIM * test.limits.current_A
    if salient_H > 0:
        size_A = min(size_A, 0.5 * float(drive.get("psi_f_Wb")) / salient_H)
    hold = _Hold(test, resistance, size_A, natural_rad_s(test, size_A))
    hold.grow(90.0)
    hold.rest()
    hold.turn(90.0, 0.0)
    readings, at_deg = [], 0.0
    stops_deg = [360.0 * max(1, round(turns)) * stop for stop in STOPS]
    beyond_deg = stops_deg[-1] + BEYOND_DEG
    for to_deg in (*stops_deg, beyond_deg, *stops_deg[::-1]):
        hold.turn(at_deg, to_deg)
        if to_deg != beyond_deg:
            readings.append(hold.read(to_deg))
        at_deg = to_deg
    hold.turn(at_deg, 0.0)
    test.rest(0.05)
    found = solve(np.array(readings), pairs, counts_rev)
    absolute = drive.get("rotor_start") == "absolute"
    step_deg = 360 * pairs / float(drive.get("absolute_counts_rev")) if absolute else 0.0
    return from_zero(found, 360 * pairs / counts_rev, test.zero_counts(), step_deg)


def from_zero(found: Alignment, count_deg: float, zero: float, step_deg: float) -> Alignment:
    """The same with the angle at the encoder's zero, which is at this count; below 0: not known.
    step_deg: electrical degrees of a reading that told it."""
    at_deg = found.zero_deg.value + count_deg * max(zero, 0.0)
    here = Value((at_deg + 180) % 360 - 180, found.zero_deg.uncertainty).plus(0.5 * step_deg)
    return replace(found, zero_deg=here, zero_known=zero >= 0)


def natural_rad_s(test: Excitation, current_A: float) -> float:
    """Natural frequency of a shaft that this direct current holds, by the drive's parameters: the
    speed loop's gain tells the inertia that it was designed for."""
    drive = test.drive
    pairs, psi_Wb, kp, slow_Hz = (
        float(drive.get(name))
        for name in ("pole_pairs", "psi_f_Wb", "kp_speed_Nms_rad", "f_slow_Hz")
    )
    inertia = kp / derived.corner_rad_s(slow_Hz)
    stiffness = 3 * pairs**2 * psi_Wb * current_A
    return math.sqrt(stiffness / inertia) if inertia > 0 else 10.0


class _Hold:
    """A direct current whose direction turns step by step."""

    def __init__(
        self, test: Excitation, resistance: Resistance, size_A: float, natural_rad_s: float
    ) -> None:
        self.test, self.resistance, self.size_A = test, resistance, size_A
        self.natural_rad_s = natural_rad_s
        step_s = math.radians(STEP_DEG) / (SHARE * natural_rad_s)
        self.step_s = min(max(step_s, LEAST_S), MOST_S)

    def _point(self, degrees: float, share: float = 1.0) -> None:
        transform, inverse, _ = self.test.frame
        unit = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
        legs_A = inverse[:, :2] @ (share * self.size_A * unit)
        legs_V = self.resistance.mean_ohm.value * legs_A + self.resistance.of_legs(legs_A)
        self.test.set(transform @ legs_V)

    def grow(self, degrees: float) -> None:
        for part in range(1, PARTS + 1):
            self._point(degrees, part / PARTS)
            self.test.wait(self.step_s)

    def turn(self, from_deg: float, to_deg: float) -> None:
        """Turn the field in steps, then wait until the shaft rests."""
        steps = math.ceil(abs(to_deg - from_deg) / STEP_DEG)
        for k in range(1, steps + 1):
            self._point(from_deg + k / steps * (to_deg - from_deg))
            self.test.wait(self.step_s)
        self.rest()

    def rest(self) -> None:
        """A swing of so many degrees has this speed in its middle, and shows within its period."""
        drive = self.test.drive
        pairs, counts_rev, slow_Hz = (
            float(drive.get(n)) for n in ("pole_pairs", "encoder_counts_rev", "f_slow_Hz")
        )
        most_rpm = math.radians(REST_DEG) * self.natural_rad_s / pairs * 30 / math.pi
        most_rpm = max(most_rpm, 1.5 * 60 * slow_Hz / counts_rev)
        watch_s = max(0.1, min(1.0, 2 * math.pi / self.natural_rad_s))
        every = max(1, round(watch_s * self.test.f_isr_Hz / 100))
        waited_s = 0.0
        while waited_s < REST_S:
            found = drive.capture(("speed_rpm",), 100, prescaler=every, timeout_s=10)
            self.test.wait(0.0)
            if np.abs(np.asarray(found["speed_rpm"], float)).max() <= most_rpm:
                return
            waited_s += watch_s
        raise CommissioningError(
            f"alignment: the shaft does not come to rest within {REST_S:g} s under direct current: "
            "does a load turn it?"
        )

    def read(self, degrees: float) -> tuple[float, int, float]:
        """The angle asked for, the encoder's count, and by how much the current's direction is off,
        degrees. The reading takes the current away; then it flows again."""
        count, i_A = self.test.position()
        alpha, beta = self.test.frame.transform[:2] @ i_A
        off_deg = (math.degrees(math.atan2(beta, alpha)) - degrees + 180) % 360 - 180
        self._point(degrees)
        self.test.wait(self.step_s)
        return degrees, count, off_deg


def solve(readings: np.ndarray, pole_pairs: float, counts_rev: float) -> Alignment:
    """From rows (angle asked for, count, error of the current's direction; angles in degrees): some
    on the way forwards, the same ones on the way back."""
    asked, counts, off_deg = readings.T
    counts = (counts + 2**31) % 2**32 - 2**31  # of 32 bits, with a sign
    moved = counts - counts[0]
    shown_deg = 360 * pole_pairs / counts_rev * moved
    way = asked - asked[0]
    ratio = float(way @ shown_deg / (way @ way))
    curve = np.column_stack([asked, asked[0] + shown_deg])
    mistakes = tuple(decide(ratio, bool(moved.any()), pole_pairs, counts_rev, RIGHT))
    if mistakes:
        return Alignment(mistakes, ratio, readings=curve)
    behind_deg = way + off_deg - shown_deg
    half_way = len(asked) // 2
    up, down = behind_deg[:half_way], behind_deg[: half_way - 1 : -1]
    both = 0.5 * (up + down)  # at the same place, so with the same cogging
    doubt = 2 * float(both.std(ddof=1)) / math.sqrt(half_way)
    count_deg = 360 * pole_pairs / counts_rev
    friction_deg = 0.5 * float((up - down).mean())
    middle = float(asked[0] + both.mean())
    zero = middle - count_deg * float(counts[0])
    half = (zero + 180) % 360 - 180
    spread = math.hypot(doubt, METHOD_DEG, count_deg, 0.25 * friction_deg)
    return Alignment((), ratio, Value(half, spread), friction_deg=friction_deg, readings=curve)
