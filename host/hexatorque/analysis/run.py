"""One run: a scheme at an operating point, with its recording and its metrics."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..errors import InputError
from ..recording.recording import Recording
from ..setups.keys import LATENCIES

#: The latencies that the report compares.
LATENCY_STUDY = ("none", "shadow", "predicted")
#: Labels of schemes that are not just their names.
LABELS = {"fdr": "FDR-DTC", "ddr": "DDR-DTC"}


@dataclass
class Run:
    """A scheme of a set-up at one operating point, as `hexatorque.measure` returns it.

    setup, scheme: their names; speed_ref_rpm, load_Nm: the operating point; latency: when a vector
    is applied: "none" (at the sampling instant), "immediate" (when the interrupt has written its
    registers), "shadow" (one sample late) or "predicted" (one sample late, with one-step
    prediction); recording: the steady-state window; metrics: its figures of merit, name -> number
    in the unit that the name ends with, None if there is none (`analysis.metrics.metrics` says what
    they are); realtime_factor: simulated seconds per second.
    """

    setup: str
    scheme: str
    latency: str
    speed_ref_rpm: float
    load_Nm: float
    recording: Recording = field(repr=False)
    metrics: dict
    realtime_factor: float

    def __post_init__(self) -> None:
        if self.latency not in LATENCIES:
            raise InputError(f"latency {self.latency!r}: use one of {', '.join(LATENCIES)}")

    @property
    def scheme_label(self) -> str:
        """The scheme's name in pictures and tables."""
        return LABELS.get(self.scheme, self.scheme.upper())

    @property
    def latency_label(self) -> str:
        """In pictures: the word of the set-up and of the tables."""
        return f"latency {self.latency}"

    @property
    def label(self) -> str:
        """Scheme and latency."""
        return f"{self.scheme_label} · {self.latency_label}"

    @property
    def point(self) -> str:
        """Set-up and operating point. Runs are grouped by this text."""
        return f"{self.setup}: {self.speed_ref_rpm:g} r/min, {self.load_Nm:g} N m"

    def as_json(self) -> dict:
        """One flat record: the run's settings, its metrics and the speed of the simulation."""
        return {
            "setup": self.setup,
            "scheme": self.scheme,
            "latency": self.latency,
            "speed_ref_rpm": self.speed_ref_rpm,
            "load_Nm": self.load_Nm,
            **self.metrics,
            "realtime_factor": self.realtime_factor,
        }


def by_point(runs: list[Run]) -> dict[str, list[Run]]:
    """The runs of each set-up and operating point (`Run.point`), in the order they came."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.point, []).append(run)
    return groups
