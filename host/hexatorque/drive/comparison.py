"""`hexatorque compare`: schemes side by side at one operating point."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import firmware
from ..analysis.reference import Reference
from ..analysis.run import LATENCY_STUDY, Run
from ..analysis.saying import sentences
from ..setups import Setup, SetupError, load
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
            under(setup.changed({"timing.latency": other}), LATENCY_SCHEME)
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


def make_folder(folder: Path) -> None:
    """Make the folder for the results. SetupError if that fails, before anything has run."""
    try:
        (folder / "recordings").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SetupError(f"{folder}: {error.strerror}") from None


def count_of_files(comparison: Comparison) -> int:
    """How many files `write` writes."""
    setups = {run.setup for run in comparison.runs}
    return len(comparison.runs) + 2 * len(setups) + bool(setups) + 2


def write(
    comparison: Comparison, folder: Path, command: str, written: Progress = lambda files: None
) -> list[Path]:
    """Write metrics.json, recordings, pictures and report.html into an existing `folder` (see
    `make_folder`). Returns the paths of the files except the recordings, the report last. `written`
    is called with the number of files that have been written since the last call."""
    from ..analysis.report import html_report

    metrics_file = folder / "metrics.json"
    metrics_file.write_text(json.dumps(comparison.as_json(), indent=1) + "\n")
    written(1)
    # A thread: the compression leaves this one free to draw.
    with ThreadPoolExecutor(1) as pool:
        saved = pool.submit(_save_recordings, comparison.runs, folder / "recordings", written)
        figures = _draw(comparison, folder, written)
    saved.result()
    report = folder / "report.html"
    notes = [f"{label}: {reason}" for label, reason in comparison.failed]
    html_report(report, comparison.runs, comparison.reference, figures, notes, command)
    written(1)
    return [metrics_file, *(path for _, path in figures), report]


def _save_recordings(runs: Iterable[Run], folder: Path, written: Progress) -> None:
    for run in runs:
        run.recording.save(folder / f"{run.setup}-{run.scheme}-{run.latency}.npz")
        written(1)


def _draw(comparison: Comparison, folder: Path, written: Progress) -> list[tuple[str, Path]]:
    """The report's pictures, each with its title."""
    from ..analysis import plots

    by_setup: dict[str, list[Run]] = {}
    for run in comparison.runs:
        by_setup.setdefault(run.setup, []).append(run)
    figures: list[tuple[str, Path]] = []
    if comparison.runs:
        overview = plots.bars(comparison.runs, folder / "overview.png", comparison.reference)
        figures.append(("Overview", overview))
        written(1)
    for setup, runs in by_setup.items():
        for name, draw in (("waveforms", plots.waveforms), ("spectra", plots.spectra)):
            figures.append((f"{setup}: {name}", draw(runs, folder / f"{setup}-{name}.png")))
            written(1)
    return figures
