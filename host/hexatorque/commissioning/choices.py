"""A user's choices for a commissioning, beside the limit of the current."""

from typing import NamedTuple


class Choice(NamedTuple):
    """0 itself is not allowed. initial: 0 if it follows from the drive's parameters."""

    low: float
    high: float
    unit: str
    initial: float


CHOICES = {
    "travel": Choice(0.0, 100.0, "", 0.1),
    "turns": Choice(0.0, 100.0, "", 3.0),
    "speed": Choice(1.0, 60000.0, " r/min", 0.0),
}


def refusal(name: str, value: float) -> str:
    """The mistake in a value; empty if it is allowed."""
    low, high, unit, _ = CHOICES[name]
    if 0 < value <= high and low <= value:
        return ""
    above = "" if low else "above "
    return f"{name} = {value:g}: allowed range is {above}{low:g} .. {high:g}{unit}"
