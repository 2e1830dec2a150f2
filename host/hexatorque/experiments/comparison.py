"""`hexatorque compare`: schemes side by side at one operating point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .. import firmware
from ..analysis.reference import Reference
from ..analysis.run import LATENCY_STUDY, Run
from ..analysis.saying import sentences
from ..setups import Setup, load
from .operating_points import Point, Progress, measure_all
from .steady import at_point, under

#: The set-ups that are compared by default: those of both papers.
DEFAULT_SETUPS = ("paper-a-feasible", "paper-b")
#: The scheme for which the effect of latency is shown.
LATENCY_SCHEME = "fdr"


@dataclass
class Comparison:
    """runs: in the order of the request; reference: published values to compare with;
    failed: (label, reason) of each point that could not be measured."""

    reference: Reference
    runs: list[Run] = field(default_factory=list)
    failed: list[tuple[str, str]] = field(default_factory=list)

    def as_json(self) -> dict:
        return {
            "says": sentences(self.runs, self.reference),
            "runs": [run.as_json() for run in self.runs],
            "paper": self.reference,
        }


def points(
    setups: Iterable[str | Setup],
    schemes: Iterable[str] | None = None,
    speed_rpm: float | None = None,
    load_Nm: float | None = None,
    set: Mapping[str, Any] | None = None,
) -> list[Point]:
    """The points to measure: every scheme with every set-up. A scheme is one of the firmware, a
    reference, or a file with a law (`laws.find`). set: other values of the set-ups' keys. If FDR
    is one of the schemes, FDR follows with each of the other latencies."""
    names = tuple(dict.fromkeys(schemes)) if schemes else firmware.schemes()
    result: list[Point] = []
    for entry in setups:
        setup = entry if isinstance(entry, Setup) else load(entry)
        setup = at_point(setup.changed(set), speed_rpm, load_Nm)
        result += [under(setup, name) for name in names]
        result += [
            under(setup.with_scheme(LATENCY_SCHEME, timing__latency=other), LATENCY_SCHEME)
            for other in LATENCY_STUDY
            if LATENCY_SCHEME in names and other != setup["timing.latency"]
        ]
    return result


def compare(
    todo: list[Point], reference: Reference, progress: Progress | None = None
) -> Comparison:
    """Measure all points, in parallel on all cores."""
    comparison = Comparison(reference)
    for point, outcome in zip(todo, measure_all(todo, progress, fine=True)):
        if isinstance(outcome, Run):
            comparison.runs.append(outcome)
        else:
            label = f"{point.setup.name} {point.scheme}"
            comparison.failed.append((label, str(outcome)))
    return comparison
