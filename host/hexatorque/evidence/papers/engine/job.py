"""The job that a figure's function gets: the extent of the work, parallel execution, and points
that were measured earlier."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from ....analysis.run import Run
from ....experiments import operating_points
from ....experiments.operating_points import Point, Progress
from ....parallel import each
from ...kept import Kept

A = TypeVar("A")
B = TypeVar("B")


class Job:
    """quick: fewer points and shorter windows; folder: measured points are kept there, so that an
    interrupted sweep can continue; progress: called with simulated seconds; rivals: how many times
    the budget of a search our laws' rivals get; threads: that work on it, default one a core."""

    def __init__(
        self,
        quick: bool,
        folder: Path,
        progress: Progress | None = None,
        rivals: int = 1,
        threads: int | None = None,
    ) -> None:
        self.quick = quick
        self.folder = folder
        self.progress = progress
        self.rivals = rivals
        self.threads = threads

    def each(self, function: Callable[[A], B], items: Iterable[A]) -> list[B]:
        """`function` of every item, in order, in parallel."""
        return each(function, items, self.threads)

    def runs(self, points: Iterable[Point]) -> list[Run]:
        """Recordings and metrics of points in steady state. If a point cannot be measured, raises
        its error (DriveFault, NotReached)."""
        return self.each(lambda point: operating_points.measure(point, self.progress), points)

    def metrics(self, points: Iterable[Point]) -> list[dict | None]:
        """Only the metrics, for sweeps. They are saved in files and read from there the next time.
        None for a point that the drive does not reach, or at which it trips."""
        return self.each(self.measured, points)

    def measured(self, point: Point) -> dict | None:
        """The metrics of one point, as `metrics` returns them."""

        def measure() -> dict | None:
            try:
                return operating_points.measure(point, self.progress).metrics
            except operating_points.NOT_MEASURED:
                return None

        key = (point.setup.summary(), point.speed_rpm, point.load_Nm)
        return Kept(self.folder, "point", *key).get(measure)
