"""The settings that are tried for one method at one operating point: the same search for every
method of a comparison.

A campaign is a Latin hypercube over the free parameters of the method, in which along every axis
each of n equal intervals holds one of the n settings. Then rounds of refinement try neighbours of
the settings that are best so far: one for each target, which is a judged figure within a limit of
the switching frequency. A larger budget means further campaigns. The random numbers come from the
comparison's seed, the point, the method and the campaign's number, so that a search can be repeated
and continued.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from ...experiments.operating_points import NOT_MEASURED
from ...firmware import FirmwareError
from ...setups import SetupError
from ..kept import Kept
from ..papers.engine.job import Job
from . import bench
from .methods import Method, controller
from .places import Place

#: Spread of a neighbour, of the width of an axis.
NEAR = 0.07
#: How near to the limit a neighbour is brought.
AIM = 0.985
#: Recorded by a quick run, for each setting.
QUICK_WINDOW_S = 0.1
#: No limit of the sampling frequency.
ANY_HZ = 1e9
#: The errors of a setting that the drive refuses.
REFUSED = (SetupError, FirmwareError)


def outcome(
    measure: Callable[[], dict[str, float]], more: tuple[type[Exception], ...] = ()
) -> tuple[dict[str, float], str]:
    """The figures and "", or none and why the drive does not hold the point. more: of REFUSED."""
    try:
        return measure(), ""
    except NOT_MEASURED + more as reason:
        return {}, str(reason)


@dataclass(frozen=True)
class Search:
    """One comparison's choices in the search. targets: figure, limit of the switching frequency,
    limit of the sampling frequency, in the order in which they are refined; aims: every second
    neighbour is also sampled so much faster or slower that it should come to just below the limit;
    build_s: time for the flux, None: the set-up's."""

    name: str
    seed: int
    targets: tuple[tuple[str, float, float], ...]
    aims: bool = False
    build_s: float | None = None

    def targets_of(self, method: Method) -> list[tuple[str, float, float]]:
        """Without those whose sampling frequency the method never exceeds."""
        highest_Hz = method.axes[0].high
        return [t for t in self.targets if t[2] == ANY_HZ or t[2] < highest_Hz]


def latin_hypercube(rng: np.random.Generator, count: int, axes: int) -> np.ndarray:
    """(count, axes) points of the unit cube."""
    order = np.stack([rng.permutation(count) for _ in range(axes)], axis=1)
    return (order + rng.random((count, axes))) / count


def best(rows: list[dict], figure: str, limit_Hz: float, sampled_Hz: float = ANY_HZ) -> dict | None:
    """The row with the lowest `figure` whose switching frequency is within the limit, and its
    sampling frequency within `sampled_Hz`."""
    within = [r for r in rows if r["f_sw_Hz"] <= limit_Hz and r["f_isr_Hz"] <= sampled_Hz]
    return min(within, key=lambda row: row[figure], default=None)


def held(rows: list[dict]) -> list[dict]:
    """The settings with which the drive holds the point."""
    return [row for row in rows if "f_sw_Hz" in row]


def attempt(
    method: Method,
    place: Place,
    values: dict[str, Any],
    job: Job,
    build_s: float | None = None,
    **more: Any,
) -> dict[str, float] | None:
    """The figures of a setting; None if the drive trips or does not hold the point. Raises one of
    REFUSED."""
    return bench.measure(
        method.scheme,
        controller(values),
        place,
        job.progress,
        QUICK_WINDOW_S if job.quick else bench.WINDOW_S,
        method.law(place.base, values),
        build_s=build_s or place.base.parameter("build_s"),
        **more,
    )


def measure(search: Search, method: Method, place: Place, at: np.ndarray, job: Job) -> dict:
    """The row of a setting, without figures if the drive refuses it, trips, or does not hold the
    point."""
    values = method.values(place.base, at)
    try:
        figures = attempt(method, place, values, job, search.build_s)
    except REFUSED:
        figures = None
    return {"at": at.tolist(), **values, **(figures or {})}


def neighbours(
    rng: np.random.Generator, rows: list[dict], search: Search, method: Method, count: int
) -> np.ndarray:
    """(count, axes) settings near the best ones. rows: what was measured. Where no setting is
    within a limit, a neighbour of the one that switches least."""
    axes, sampling = len(method.axes), method.axes[0]
    if not rows:
        return latin_hypercube(rng, count, axes)
    least = min(rows, key=lambda row: row["f_sw_Hz"])
    found = []
    for n, (figure, limit_Hz, sampled_Hz) in enumerate(search.targets_of(method)[:count]):
        row = best(rows, figure, limit_Hz, sampled_Hz) or least
        at = np.array(row["at"]) + NEAR * rng.standard_normal(axes)
        if search.aims and n % 2 == 0:
            ratio = AIM * limit_Hz / row["f_sw_Hz"]
            at[0] = row["at"][0] + math.log(ratio) / math.log(sampling.high / sampling.low)
        found.append(at)
    return np.clip(found, 0.0, 1.0)


def random_numbers(
    search: Search, place: Place, method: Method, campaign: int
) -> np.random.Generator:
    text = f"{place.setup} {place.speed_rpm:g} {place.torque_Nm:g} {method.name}"
    return np.random.default_rng([search.seed, zlib.crc32(text.encode()), campaign])


def settings(
    job: Job, search: Search, place: Place, method: Method, campaigns: int = 1
) -> list[dict]:
    """A row for every setting that was tried. `at` is the setting on its axes; a row without
    `f_sw_Hz` is one with which the drive does not hold the point."""
    extent = method.quick if job.quick else method.extent
    kept = Kept(job.folder, search.name, place, method, extent)
    rounds: list[list[dict]] = kept.load() or []
    number = 0
    for campaign in range(campaigns):
        rng = random_numbers(search, place, method, campaign)
        for part, count in enumerate((extent.cover, *extent.rounds)):
            if part == 0:
                tried = latin_hypercube(rng, count, len(method.axes))
            else:
                rows = held(list(chain(*rounds[:number])))
                tried = neighbours(rng, rows, search, method, count)
            if number == len(rounds):
                rounds.append([measure(search, method, place, at, job) for at in tried])
                kept.save(rounds)
            number += 1
    return list(chain(*rounds[:number]))


def each_at_each(
    job: Job, search: Search, places: list[Place], methods: tuple[Method, ...], rivals: int = 1
) -> dict[Place, dict[str, list[dict]]]:
    """Place -> method -> its settings with which the drive holds the point. rivals: how many times
    the budget the rivals of our laws get."""
    tasks = [(place, method) for place in places for method in methods]

    def one(task: tuple[Place, Method]) -> list[dict]:
        place, method = task
        return held(settings(job, search, place, method, 1 if method.ours else rivals))

    found: dict[Place, dict[str, list[dict]]] = {place: {} for place in places}
    for (place, method), rows in zip(tasks, job.each(one, tasks)):
        found[place][method.name] = rows
    return found
