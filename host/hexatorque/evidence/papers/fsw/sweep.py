"""All settings of all schemes at all points, measured once and kept in files."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import astuple
from functools import lru_cache
from itertools import chain
from pathlib import Path

from ..engine.job import Job
from . import bench
from .points import Place, setup_of
from .search import (
    Extent,
    Variant,
    controller_values,
    latin_hypercube,
    neighbours,
    random_numbers,
)

#: Of this package, what can change a measured point. Pictures and tables may change without a new
#: sweep.
MEASURING = (
    "plant", "drive", "setups", "recording", "firmware.py", "analysis/metrics.py",
    "analysis/spectrum.py", "analysis/losses.py", "analysis/walk.py",
    "evidence/papers/fsw/bench.py", "evidence/papers/fsw/search.py",
)  # fmt: skip
#: Recorded by a quick run, per setting.
QUICK_WINDOW_S = 0.1


@lru_cache
def digest(names: tuple[str, ...] = MEASURING) -> str:
    """Of these files and folders, and of the compiled firmware."""
    package = Path(__file__).parents[3]
    found = hashlib.sha256()
    for name in names:
        path = package / name
        files = sorted(path.rglob("*")) if path.is_dir() else [path]
        for file in files:
            if file.suffix in (".py", ".toml"):
                found.update(file.relative_to(package).as_posix().encode())
                found.update(file.read_bytes())
    for library in sorted(package.glob("*.so")):
        found.update(library.read_bytes())
    return found.hexdigest()


class _Kept:
    """The measured settings of one variant at one point, in a file that grows round by round."""

    def __init__(self, folder: Path, place: Place, variant: Variant, extent: Extent) -> None:
        key = json.dumps([digest(), astuple(place), astuple(variant), astuple(extent)])
        self.path = folder / f"fsw-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"

    def load(self) -> list[list[dict]]:
        """The rounds that an earlier run completed."""
        try:
            return list(json.loads(self.path.read_text()))
        except (OSError, ValueError):
            return []  # nothing measured yet, or a damaged file

    def save(self, rounds: list[list[dict]]) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        part = self.path.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(rounds) + "\n")
        part.replace(self.path)


def settings(job: Job, place: Place, variant: Variant) -> list[dict]:
    """A row for every setting that was tried. `at` is the setting on its axes; a row without
    `f_sw_Hz` is one with which the drive does not hold the point."""
    extent = variant.quick if job.quick else variant.extent
    kept = _Kept(job.folder, place, variant, extent)
    rounds = kept.load()
    rng, base = random_numbers(place, variant), setup_of(place)
    window_s = QUICK_WINDOW_S if job.quick else bench.WINDOW_S
    for number, count in enumerate((extent.cover, *extent.rounds)):
        if number == 0:
            tried = latin_hypercube(rng, count, len(variant.axes))
        else:
            tried = neighbours(rng, held(list(chain(*rounds[:number]))), variant, count)
        if number < len(rounds):
            continue
        rows = []
        for at in tried:
            values = controller_values(variant, base, at)
            figures = bench.measure(base, variant.scheme, values, place, job.progress, window_s)
            rows.append({"at": at.tolist(), **values, **(figures or {})})
        rounds.append(rows)
        kept.save(rounds)
    return list(chain(*rounds))


def held(rows: list[dict]) -> list[dict]:
    """The settings with which the drive holds the point."""
    return [row for row in rows if "f_sw_Hz" in row]
