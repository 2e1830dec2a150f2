"""The weighted aim of a tuning."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from ..given import real, suggest
from ..setups import SetupError


@dataclass(frozen=True)
class Figures:
    """The figures of one operating point.

    Td, THD∞ and losses are as `analysis.metrics` defines them; loss_W: windings of the stator, and
    the inverter as far as the set-up states its devices; speed_error_rpm: mean deviation from the
    load step until the drive has settled.
    """

    speed_rpm: float
    flux_Wb: float
    torque_ripple_td_Nm: float
    thd_inf_pct: float
    f_sw_Hz: float
    loss_W: float
    speed_error_rpm: float

    def as_json(self) -> dict[str, float]:
        return asdict(self)


@dataclass(frozen=True)
class Part:
    """A part of the aim: the figure that it lowers, and its usual weight."""

    figure: str
    title: str
    unit: str
    digits: int
    weight: float


PARTS = {
    "ripple": Part("torque_ripple_td_Nm", "torque ripple Td", "N m", 4, 1.0),
    "thd": Part("thd_inf_pct", "distortion THD∞", "%", 2, 1.0),
    "fsw": Part("f_sw_Hz", "switching frequency", "Hz", 0, 1.0),
    "loss": Part("loss_W", "losses", "W", 1, 1.0),
    "speed": Part("speed_error_rpm", "speed error after the load step", "r/min", 2, 0.5),
}
#: A speed error below this counts as this one: no smaller one matters.
SPEED_FLOOR_RPM = 0.2

Weights = dict[str, float]


def usual_weights() -> Weights:
    return {name: part.weight for name, part in PARTS.items()}


def read_weights(text: str) -> Weights:
    """Weights from `name=number,name=number`; what is not named keeps its usual weight. No name
    begins with a digit: a comma between digits is a decimal comma."""
    weights = usual_weights()
    for part in filter(None, (p.strip() for p in re.split(r";|,(?!(?<=\d,)\d)", text))):
        name, _, word = part.partition("=")
        if name not in PARTS:
            raise SetupError(f"unknown weight {name!r}{suggest(name, PARTS)}")
        try:
            weights[name] = real(word)
        except ValueError:
            raise SetupError(
                f"weight {part!r}: name=number is needed, for example {name}=1"
            ) from None
        if not 0 <= weights[name] <= 1000:
            raise SetupError(f"weight {name} = {word}: allowed range is 0 .. 1000")
    if not any(weights.values()):
        raise SetupError("all weights are 0: at least one must be above 0")
    return weights


def aim(weights: Weights, found: Sequence[Figures], start: Sequence[Figures]) -> float:
    """The weighted mean, over all parts and points, of the logarithm of each figure relative to the
    one before tuning. 0: as good as before; the smaller the better; exp(aim) is the mean ratio."""
    total = 0.0
    for name, weight in weights.items():
        figure = PARTS[name].figure
        floor = SPEED_FLOOR_RPM if name == "speed" else 0.0
        pairs = [(getattr(a, figure), getattr(b, figure)) for a, b in zip(found, start)]
        ratios = [_ratio(max(a, floor), max(b, floor)) for a, b in pairs]
        total += weight * sum(map(math.log, ratios)) / len(ratios)
    return total / sum(weights.values())


def _ratio(value: float, before: float) -> float:
    """A figure that was 0 before cannot become better."""
    return max(value / before, 1e-6) if before > 0 else 1.0
