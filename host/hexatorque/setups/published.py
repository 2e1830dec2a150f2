"""Published machines, and the values that are typical of a machine by its power.

`data/published_machines.csv` has plates and circuits of three-phase machines as their sources have
them, star equivalent, with an empty field where the source says nothing. In units of the rated
voltage and current of a phase a machine is the same whether it is wound with one set or with two,
so they stand for six-phase machines as well.

A line through the logarithms over that of the power gives the typical value. It is the line of
Theil and Sen, through the medians, so that a few odd machines do not draw it away.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from statistics import median

FILE = "published_machines.csv"
#: Share of the machines that a stated range is to hold.
HELD = 0.95


def equal_leakages(
    rr_ohm: float, lls_H: float, llr_H: float, lm_H: float
) -> tuple[float, float, float]:
    """R_r, leakage of either side, and L_m of the circuit with equal leakages that cannot be told
    from this one from outside."""
    ls_H = lls_H + lm_H
    ratio = math.sqrt(ls_H / (llr_H + lm_H))
    return ratio**2 * rr_ohm, ls_H - ratio * lm_H, ratio * lm_H


@dataclass(frozen=True)
class Machine:
    """A machine of the file; 0: not printed. Per phase of a three-phase star."""

    name: str
    source: str
    power_kW: float
    voltage_V: float
    frequency_Hz: float
    pole_pairs: int
    speed_rpm: float
    current_A: float
    power_factor: float
    rs_ohm: float
    rr_ohm: float
    lls_H: float
    llr_H: float
    lm_H: float
    inertia_kgm2: float

    @property
    def synchronous_rad_s(self) -> float:
        return 2 * math.pi * self.frequency_Hz / self.pole_pairs

    def load(self, slip: float, iron: float, friction: float) -> tuple[float, float, float]:
        """Power at the shaft in W, line current and power factor at rated voltage. The windings'
        losses are those of the circuit; iron and friction take these shares of all losses."""
        omega, v_V = 2 * math.pi * self.frequency_Hz, self.voltage_V / math.sqrt(3)
        rotor = self.rr_ohm / slip + 1j * omega * self.llr_H
        main = 1j * omega * self.lm_H
        current = v_V / (self.rs_ohm + 1j * omega * self.lls_H + rotor * main / (rotor + main))
        gap_W = 3 * abs(current * main / (rotor + main)) ** 2 * self.rr_ohm / slip
        copper_W = 3 * abs(current) ** 2 * self.rs_ohm + slip * gap_W
        losses_W = copper_W / (1 - iron - friction)
        current += iron * losses_W / (3 * v_V)
        shaft_W = gap_W * (1 - slip) - friction * losses_W
        return shaft_W, abs(current), current.real / abs(current)

    def slip_at(self, power_W: float, iron: float, friction: float) -> float:
        """The slip at which the circuit gives this power, below pull-out."""
        low, high = 1e-6, 0.15
        for _ in range(50):
            middle = 0.5 * (low + high)
            enough = self.load(middle, iron, friction)[0] > power_W
            low, high = (low, middle) if enough else (middle, high)
        return low

    @property
    def equal_leakages(self) -> tuple[float, float, float]:
        return equal_leakages(self.rr_ohm, self.lls_H, self.llr_H, self.lm_H)


@cache
def machines() -> tuple[Machine, ...]:
    text = (resources.files(__package__) / "data" / FILE).read_text(encoding="utf-8")
    rows = []
    for row in csv.DictReader(io.StringIO(text)):
        numbers = {
            name: float(word or 0)
            for name, word in row.items()
            if name not in ("name", "source", "poles")
        }
        pole_pairs = int(row["poles"]) // 2
        rows.append(Machine(row["name"], row["source"], pole_pairs=pole_pairs, **numbers))
    return tuple(rows)


@dataclass(frozen=True)
class Line:
    """value = at_1kW power_kW^exponent."""

    at_1kW: float
    exponent: float

    def at(self, power_kW: float) -> float:
        return self.at_1kW * power_kW**self.exponent


def through(points: Iterable[tuple[float, float]]) -> Line:
    """The line of Theil and Sen through the logarithms of (power, value)."""
    logs = [(math.log(power), math.log(value)) for power, value in points]
    slope = median(
        (y1 - y0) / (x1 - x0) for (x0, y0), (x1, y1) in itertools.combinations(logs, 2) if x1 != x0
    )
    return Line(math.exp(median(y - slope * x for x, y in logs)), slope)


def factor_of(errors: Iterable[float], held: float = HELD) -> float:
    """Factors below and above an estimate for a range that holds this share, from the
    ratios of estimate and truth of other machines."""
    sizes = sorted(abs(math.log(error)) for error in errors)
    return math.exp(sizes[math.ceil(held * len(sizes)) - 1])
