"""Which number of a plate was probably typed wrong, and what would fit in its place.

A decimal sign in the wrong place and a unit with another prefix (W for kW) make a number ten, a
hundred or a thousand times as large or small. Each number is tried alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from .nameplate import Nameplate

SHIFTS = (10.0, 0.1, 100.0, 0.01, 1e3, 1e-3)
#: Voltages and frequencies that stand on many plates, so nobody types them by a slip; higher
#: voltages from this power on.
USUAL_V = (
    110, 115, 190, 200, 208, 220, 230, 240, 380, 400, 415, 440, 460, 480, 500, 525, 575, 600, 660,
    690,
)  # fmt: skip
USUAL_HIGH_V, HIGH_FROM_KW = (2300, 3000, 3300, 4000, 4160, 6000, 6600), 100.0
USUAL_HZ = (50, 60)


def _usual(plate: Nameplate, name: str) -> bool:
    """Whether this number of the plate is one of these."""
    if name == "frequency_Hz":
        return plate.frequency_Hz in USUAL_HZ
    high = plate.voltage_V in USUAL_HIGH_V and plate.power_kW >= HIGH_FROM_KW
    return name == "voltage_V" and (plate.voltage_V in USUAL_V or high)


def _with(plate: Nameplate, name: str, number: float) -> Nameplate:
    change: dict[str, Any] = {name: number}
    return replace(plate, **change)


def shifted(value: float, low: float, high: float) -> float | None:
    """The value with its decimal sign elsewhere, between these two; None if there is none."""
    found = (float(f"{value * shift:.9g}") for shift in SHIFTS)
    return next((number for number in found if low <= number <= high), None)


def meant(plate: Nameplate, names: Iterable[str], fits: Callable[[Nameplate], bool]) -> str:
    """The question whether one of these numbers was meant to be another one, with which the plate
    fits; empty if there is none. poles: the number that belongs to speed and frequency."""
    found: dict[str, float] = {}
    for name in names:
        if name == "poles":
            pairs = int(60 * plate.frequency_Hz / plate.speed_rpm)
            if pairs > 0 and fits(replace(plate, pole_pairs=pairs)):
                found[name] = 2 * pairs
            continue
        typed = getattr(plate, name)
        for shift in SHIFTS:
            number = float(f"{typed * shift:.9g}")
            if name not in found and fits(_with(plate, name, number)):
                found[name] = number
    likely = [name for name in found if not _usual(plate, name)]
    sure = [n for n in likely if n != "poles" and _usual(_with(plate, n, found[n]), n)]
    words = [f"{name} = {found[name]:g}" for name in sure or likely or found]
    if not words:
        return ""
    *others, last = words
    return f"did you mean {', '.join(others)}{' or ' * bool(others)}{last}?"
