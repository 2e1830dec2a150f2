"""Reproduces figures and tables of the papers one after the other and writes their files."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from ....build import build
from ....drive.operating_points import NotReached
from ....drive.simulated import DriveFault
from ....recording.recording import RecordingError
from ....setups import SetupError
from .. import ENTRIES
from .figure import Verdict
from .job import Job
from .page import write_page

#: Sub-folder for measured points.
POINTS = "points"


@dataclass
class Outcome:
    """The contents of each figure's JSON file, by identifier, and the reasons of failed figures."""

    figures: dict[str, dict] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    def verdicts(self) -> list[tuple[str, Verdict]]:
        return [
            (name, Verdict(**row))
            for name, data in self.figures.items()
            for row in data["verdicts"]
        ]

    def broken(self) -> list[tuple[str, Verdict]]:
        """The required verdicts that do not hold."""
        return [(name, verdict) for name, verdict in self.verdicts() if verdict.broken]


def chosen(names: list[str]) -> list[str]:
    """The identifiers in the papers' order. `all` stands for all of them; case does not matter."""
    upper = [name.upper() for name in names]
    if "ALL" in upper:
        return list(ENTRIES)
    for name, given in zip(upper, names):
        if name not in ENTRIES:
            raise SetupError(f"no figure {given!r}: choose from all, {', '.join(ENTRIES)}")
    return [name for name in ENTRIES if name in upper]


def make_folder(folder: Path) -> None:
    """Make the folder for the results. Raises an error before any run if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SetupError(f"{folder}: {error.strerror}") from None


def make(name: str, job: Job, folder: Path) -> dict:
    """Make one figure and write ID.json, ID.png and ID[-part].npz; returns the JSON."""
    entry = ENTRIES[name]
    figure = getattr(import_module(f"hexatorque.evidence.papers.{entry.module}"), entry.function)(
        job
    )
    files = {}
    for part, recording in figure.recordings.items():
        path = folder / (f"{name}-{part}.npz" if part else f"{name}.npz")
        files[path.name] = recording.save(path).stat().st_size
    figure.draw(folder / f"{name}.png")
    data = {
        "id": name,
        "title": entry.title,
        **figure.as_json(),
        "recordings": list(files),
        "picture": f"{name}.png",
        "quick": job.quick,
        "build": build(),
    }
    # The JSON file is written last, so its existence means that the figure is complete.
    (folder / f"{name}.json").write_text(json.dumps(data, indent=1) + "\n")
    return data


def kept(name: str, quick: bool, folder: Path) -> dict | None:
    """A figure that an earlier run of the same build has completed, or None."""
    try:
        data = json.loads((folder / f"{name}.json").read_text())
        same = data["build"] == build() and data["quick"] == quick
        there = all((folder / file).exists() for file in (*data["recordings"], data["picture"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return data if same and there else None


def reproduce(
    names: list[str],
    folder: Path,
    quick: bool = False,
    begin: Callable[[str], Callable[[float], None] | None] = lambda name: None,
) -> Outcome:
    """Make the figures `names` in `folder`, and the page that shows all that are there.

    begin: called with each identifier before work on it begins; returns the callback for simulated
    seconds. If the drive of a figure trips, the figure is reported in `failed`, and the others are
    made all the same.
    """
    outcome = Outcome()
    try:
        for name in names:
            progress = begin(name)
            data = kept(name, quick, folder)
            if data is None:
                try:
                    data = make(name, Job(quick, folder / POINTS, progress), folder)
                except (DriveFault, NotReached) as error:
                    outcome.failed[name] = str(error)
                    continue
            outcome.figures[name] = data
        every = {name: data for name in ENTRIES if (data := kept(name, quick, folder))}
        write_page(folder / "index.html", every, outcome.failed)
    except OSError as error:
        raise RecordingError(f"{error.filename}: {error.strerror}") from None
    return outcome
