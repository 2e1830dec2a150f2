"""The files of `hexatorque compare`: metrics, recordings, pictures and a report in HTML."""

from __future__ import annotations

import json
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..analysis import plots
from ..analysis.report import html_report
from ..analysis.run import Run
from ..setups import SetupError
from .comparison import Comparison
from .operating_points import Progress


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
    metrics_file = folder / "metrics.json"
    metrics_file.write_text(json.dumps(comparison.as_json(), indent=1) + "\n", encoding="utf-8")
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
