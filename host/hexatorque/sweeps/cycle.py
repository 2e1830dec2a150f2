"""A drive cycle: speed and torque at the shaft over time, from a table.

The table is CSV with the columns time_s, speed_rpm and torque_Nm. In place of the last two,
speed_pu and torque_pu are shares of the set-up's operating point; without a speed in it, of half
of rated speed and torque. Between two rows both are straight lines; two rows of the same time are a
step. Lines that begin with # are skipped.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..setups import Setup, SetupError
from ..setups.keys import MOST_NM, MOST_RPM
from .errors import StudyError

#: Speed reference and load change in steps of this length.
STEP_S = 0.05
LONGEST_S = 36_000.0
#: Figures of a cycle and their units; `energy` says what they are.
UNITS = {
    "drawn_Wh": "Wh",
    "returned_Wh": "Wh",
    "shaft_Wh": "Wh",
    "loss_Wh": "Wh",
    "copper_loss_Wh": "Wh",
    "conduction_loss_Wh": "Wh",
    "switching_loss_Wh": "Wh",
    "efficiency_pct": "%",
    "f_sw_Hz": "Hz",
    "speed_error_rpm": "r/min",
}
COLUMNS = (("time_s",), ("speed_rpm", "speed_pu"), ("torque_Nm", "torque_pu"))


@dataclass(frozen=True)
class Cycle:
    """The table. own_speed, own_torque: the values are shares of the set-up's operating point."""

    name: str
    time_s: tuple[float, ...]
    speed: tuple[float, ...]
    torque: tuple[float, ...]
    own_speed: bool
    own_torque: bool

    @property
    def duration_s(self) -> float:
        return self.time_s[-1]

    def over(self, setup: Setup) -> tuple[np.ndarray, np.ndarray]:
        """Speed (r/min) and torque (N m) of each row on this drive. SetupError if that is more than
        it may have."""
        from ..experiments.steady import at_point  # takes long to import

        if self.own_speed or self.own_torque:
            setup = at_point(setup)
        limit_Nm = min(MOST_NM, float(setup.parameter("torque_limit_Nm")))
        speed_rpm = self._scaled(self.speed, self.own_speed, setup, "point.speed_rpm")
        torque_Nm = self._scaled(self.torque, self.own_torque, setup, "point.load_Nm")
        self._check(speed_rpm, MOST_RPM, "r/min", "")
        self._check(torque_Nm, limit_Nm, "N m", " (torque limit)")
        return speed_rpm, torque_Nm

    def _scaled(self, values: tuple[float, ...], own: bool, setup: Setup, path: str) -> np.ndarray:
        scale = setup[path] if own else 1.0
        if not scale:
            raise SetupError(f"{path} = 0: the cycle {self.name} has shares of it")
        return scale * np.array(values)

    def _check(self, values: np.ndarray, limit: float, unit: str, why: str) -> None:
        worst = values[np.abs(values).argmax()]
        if abs(worst) > limit:
            raise SetupError(
                f"cycle {self.name}: {worst:.4g} {unit}: allowed range is "
                f"-{limit:g} .. {limit:g} {unit}{why}"
            )


def ready() -> list[str]:
    """Names of the cycles that come with the package."""
    names = [path.name for path in (resources.files(__package__) / "cycles").iterdir()]
    return sorted(name.removesuffix(".csv") for name in names if name.endswith(".csv"))


def read(name: str | Path) -> Cycle:
    """The cycle in a file, or the one of this name that comes with the package."""
    from ..given import suggest, text_of

    path = Path(name)
    if str(name) in ready():
        text = (resources.files(__package__) / "cycles" / f"{name}.csv").read_text(encoding="utf-8")
    elif not path.suffix and not path.exists():
        raise StudyError(f"cycle {name}: there is none{suggest(name, ready())}")
    else:
        try:
            text = text_of(path)
        except InputError as error:
            raise StudyError(f"cycle {name}: {error}") from None
    return _parsed(path.stem, text)


def _parsed(name: str, text: str) -> Cycle:
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    rows = list(csv.reader(line for _, line in lines))
    heads = [head.strip() for head in rows[0]] if rows else []
    found = []
    for choices in COLUMNS:
        there = [head for head in heads if head in choices]
        if len(there) != 1:
            raise StudyError(f"cycle {name}: a column {' or '.join(choices)} is needed")
        found.append(there[0])
    table: list[tuple[float, ...]] = []
    for (number, _), row in zip(lines[1:], rows[1:]):
        values = []
        for head in found:
            text = row[heads.index(head)].strip() if len(row) == len(heads) else ""
            values.append(_number(f"cycle {name}, line {number}: {head}", text))
        if table and values[0] < table[-1][0]:
            raise StudyError(f"cycle {name}, line {number}: time_s = {values[0]:g}: must not fall")
        table.append(tuple(values))
    if not table or table[0][0] != 0 or not STEP_S <= table[-1][0] <= LONGEST_S:
        raise StudyError(f"cycle {name}: time_s must go from 0 to {STEP_S:g} .. {LONGEST_S:g} s")
    time_s, speed, torque = zip(*table)
    return Cycle(name, time_s, speed, torque, found[1] == "speed_pu", found[2] == "torque_pu")


def _number(what: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise StudyError(f"{what} = {text!r}: a finite number is needed")
    return value
