"""Reproduces figures and tables of the papers one after the other and writes their files."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from ....build import build
from ....drive.simulated import DriveFault
from ....experiments.operating_points import NotReached, Progress
from ....recording.recording import RecordingError
from ....setups import SetupError
from ....sweeps.workers import Died, Processes
from ....system import usable_cores
from .. import ENTRIES
from .figure import Verdict
from .job import Job
from .page import write_page

#: Called with a figure's identifier; returns the callback for simulated seconds.
Begin = Callable[[str], Progress | None]
#: The most figures that are made at once, because of their memory.
MOST_JOBS = 8
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
    module = import_module(f".{entry.module}", "hexatorque.evidence.papers")
    figure = getattr(module, entry.function)(job)
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
        "rivals": job.rivals if entry.rivals else 1,
        "build": build(),
    }
    # The JSON file is written last, so its existence means that the figure is complete.
    (folder / f"{name}.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return data


def kept(name: str, quick: bool, folder: Path, rivals: int = 1) -> dict | None:
    """A figure that an earlier run of the same build has completed, or None."""
    rivals = rivals if ENTRIES[name].rivals else 1
    try:
        data = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        same = (data["build"], data["quick"], data["rivals"]) == (build(), quick, rivals)
        there = all((folder / file).exists() for file in (*data["recordings"], data["picture"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return data if same and there else None


def _attempt(
    name: str,
    quick: bool,
    folder: Path,
    rivals: int,
    progress: Progress | None = None,
    threads: int | None = None,
) -> dict | str:
    """The JSON of a figure, or why its drive did not do it."""
    try:
        return make(name, Job(quick, folder / POINTS, progress, rivals, threads), folder)
    except (DriveFault, NotReached) as error:
        return str(error)


def _in_processes(
    names: list[str], quick: bool, folder: Path, begin: Begin, jobs: int, rivals: int
) -> Iterator[tuple[str, dict | str]]:
    """All figures, in the workers of a study: pictures, spectra and recordings hold Python's lock,
    so threads would wait for each other. Those that have many runs come first. The cores are shared
    among the processes: more threads than cores would only wait for them."""
    threads = max(1, usable_cores() // jobs)
    left = deque(sorted(names, key=lambda name: not _is_long(name)))
    workers = Processes(jobs)
    busy: dict[Future, str] = {}
    try:
        while left or busy:
            while left and len(busy) < workers.slots:
                name = left.popleft()
                begin(name)
                task = (name, quick, folder, rivals, None, threads)
                busy[workers.submit(_attempt, *task)] = name
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                name = busy.pop(future)
                try:
                    yield name, workers.result(future)
                except Died:
                    yield name, "its process died"
    finally:
        workers.close()


def _is_long(name: str) -> bool:
    return any(word in ENTRIES[name].module for word in ("sweep", "methods"))


def reproduce(
    names: list[str],
    folder: Path,
    quick: bool = False,
    begin: Begin = lambda name: None,
    jobs: int = 1,
    rivals: int = 1,
) -> Outcome:
    """Make the figures `names` in `folder`, and the page that shows all that are there.

    begin: called with each identifier before work on it begins; returns the callback for simulated
    seconds, which only a figure that is made in this process calls. jobs: above 1, that many
    figures are made at once, each in a process. If the drive of a figure trips, the figure is
    reported in `failed`, and the others are made all the same.
    """
    found: dict[str, dict | str] = {}
    try:
        for name in names:
            if (data := kept(name, quick, folder, rivals)) is not None:
                begin(name)
                found[name] = data
        missing = [name for name in names if name not in found]
        if jobs > 1 and len(missing) > 1:
            jobs = min(jobs, len(missing))
            found.update(_in_processes(missing, quick, folder, begin, jobs, rivals))
        else:
            for name in missing:
                found[name] = _attempt(name, quick, folder, rivals, begin(name))
        outcome = Outcome(
            {name: made for name in names if not isinstance(made := found[name], str)},
            {name: why for name in names if isinstance(why := found[name], str)},
        )
        every = {name: there for name in ENTRIES if (there := kept(name, quick, folder, rivals))}
        write_page(folder / "index.html", every, outcome.failed)
    except OSError as error:
        raise RecordingError(f"{error.filename}: {error.strerror}") from None
    return outcome
