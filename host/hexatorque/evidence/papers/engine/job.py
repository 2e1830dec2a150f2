"""What a figure's function is given: how much to do, all cores, and points that were
measured before."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from ....analysis.run import Run
from ....drive import operating_points
from ....drive.operating_points import Point, Progress

A = TypeVar("A")
B = TypeVar("B")


@lru_cache(maxsize=1)
def build() -> str:
    """Digest of everything that can change a result: this package with its firmware."""
    package = Path(__file__).parents[3]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        if path.suffix in (".py", ".so", ".toml"):
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


class Job:
    """quick: fewer points and shorter windows; folder: where measured points are kept, so
    that an interrupted sweep goes on where it was; progress: called with simulated seconds."""

    def __init__(self, quick: bool, folder: Path, progress: Progress | None = None) -> None:
        self.quick = quick
        self.folder = folder
        self.progress = progress

    def each(self, function: Callable[[A], B], items: Iterable[A]) -> list[B]:
        """`function` of every item over all cores, in order. The compiled simulation
        releases the GIL. An exception or an interrupt cancels what has not begun."""
        pool = ThreadPoolExecutor(os.cpu_count())
        try:
            return list(pool.map(function, items))
        finally:
            pool.shutdown(cancel_futures=True)

    def runs(self, points: Iterable[Point]) -> list[Run]:
        """Recordings and metrics of points in steady state. Raises what the first
        point that cannot be measured raises (DriveFault, NotReached)."""
        return self.each(lambda point: operating_points.measure(point, self.progress), points)

    def metrics(self, points: Iterable[Point]) -> list[dict | None]:
        """Metrics only, for sweeps: kept in files, and taken from there the next time.
        None for a point that the drive does not reach or trips at."""
        return self.each(self.measured, points)

    def measured(self, point: Point) -> dict | None:
        """One of `metrics`."""
        key = [build(), point.setup.summary(), point.speed_rpm, point.load_Nm]
        name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
        path = self.folder / f"{name}.json"
        try:
            return json.loads(path.read_text())
        except (OSError, ValueError):
            pass  # not measured yet, or a torn file
        try:
            values = operating_points.measure(point, self.progress).metrics
        except operating_points.NOT_MEASURED:
            values = None
        self.folder.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(values) + "\n")
        part.replace(path)
        return values
