"""The settings that are tried for one method at one operating point: the same search with the same
budget for every method.

A campaign is a Latin hypercube over what is free in the method, then rounds of refinement: for each
judged figure within each limit of the switching frequency one neighbour of the best setting so
far. Every second neighbour is also sampled so much faster or slower that it should come to just
below the limit. A larger budget means further campaigns. The random numbers come from SEED, the
point, the method and the campaign's number, so that a search can be repeated and continued.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import zlib
from collections.abc import Callable
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np

from ....firmware import FirmwareError
from ....setups import SetupError
from ..engine.job import Job
from ..fsw import bench, sweep
from ..fsw.points import Place
from ..fsw.search import NEAR, best, controller_values, latin_hypercube
from .methods import Method
from .places import machine_of

SEED = 17
#: Limits of switching frequency, and what is judged within them.
LIMITS_HZ = (1e3, 1.5e3, 2e3, 3e3, 4e3, 6e3, 8e3)
JUDGED = ("td_Nm", "thd_inf_pct", "loss_W")
#: In this order the targets are refined: the sentences' limit first.
TARGETS = tuple(product((4e3, 2e3, 6e3, 3e3, 1e3, 8e3, 1.5e3), JUDGED))
#: How near to the limit a neighbour is brought.
AIM = 0.985
WINDOW_S, QUICK_WINDOW_S = 0.2, 0.1
#: Of this package, what can change a measured value.
MEASURING = (
    *(name for name in sweep.MEASURING if not name.startswith("evidence")), "laws",
    "evidence/papers/fsw/bench.py", "evidence/papers/fsw/search.py", "evidence/studies/dynamics.py",
    "evidence/papers/references/search.py", "evidence/papers/references/methods.py",
    "evidence/papers/references/steps.py", "evidence/papers/references/errors.py",
    "evidence/papers/references/places.py",
)  # fmt: skip


class Kept:
    """What was measured under a key, in a file."""

    def __init__(self, folder: Path, kind: str, *key: object) -> None:
        text = json.dumps([sweep.digest(MEASURING), kind, *key], default=str, sort_keys=True)
        self.path = folder / f"ref-{kind}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.json"

    def load(self) -> Any:
        """None: not measured yet, or a damaged file."""
        try:
            return json.loads(self.path.read_text())
        except (OSError, ValueError):
            return None

    def save(self, values: Any) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        part = self.path.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(values) + "\n")
        part.replace(self.path)

    def get(self, measure: Callable[[], Any]) -> Any:
        found = self.load()
        if found is None:
            found = measure()
            self.save(found)
        return found


def random_numbers(place: Place, method: Method, campaign: int) -> np.random.Generator:
    text = f"{place.setup} {place.speed_rpm:g} {place.torque_Nm:g} {method.name}"
    return np.random.default_rng([SEED, zlib.crc32(text.encode()), campaign])


def values_of(method: Method, place: Place, at: np.ndarray) -> dict[str, Any]:
    """What the setting `at` stands for: parameters of the controller and of the law."""
    base = machine_of(place).base
    return controller_values(method, base, at) | method.law_values(at)


#: What a setting raises that the drive refuses.
REFUSED = (SetupError, FirmwareError)


def attempt(
    method: Method, place: Place, values: dict[str, Any], job: Job, **more: Any
) -> dict[str, float] | None:
    """The figures of a setting; None if the drive trips or does not hold the point. Raises one of
    REFUSED."""
    base = machine_of(place).base
    own = {axis.name for axis in method.law_axes}
    return bench.measure(
        base,
        method.scheme,
        {name: value for name, value in values.items() if name not in own},
        place,
        job.progress,
        QUICK_WINDOW_S if job.quick else WINDOW_S,
        method.law(base, values),
        build_s=base.parameter("build_s"),
        modules=machine_of(place).modules,
        **more,
    )


def measure(
    method: Method, place: Place, values: dict[str, Any], job: Job
) -> dict[str, float] | None:
    """The figures of a setting; None if the drive refuses it, trips, or does not hold the point."""
    try:
        return attempt(method, place, values, job)
    except REFUSED:
        return None


def held(rows: list[dict]) -> list[dict]:
    """The settings with which the drive holds the point."""
    return [row for row in rows if "f_sw_Hz" in row]


def neighbours(
    rng: np.random.Generator, rows: list[dict], method: Method, count: int
) -> np.ndarray:
    """(count, free) settings near the best ones. Where no setting is within a limit, a neighbour of
    the one that switches least."""
    rows = held(rows)
    if not rows:
        return latin_hypercube(rng, count, method.free)
    least = min(rows, key=lambda row: row["f_sw_Hz"])
    sampling = method.axes[0]
    found = np.empty((count, method.free))
    for n, (limit_Hz, figure) in enumerate(TARGETS[:count]):
        row = best(rows, figure, limit_Hz) or least
        at = np.array(row["at"]) + NEAR * rng.standard_normal(method.free)
        if n % 2 == 0:
            ratio = AIM * limit_Hz / row["f_sw_Hz"]
            at[0] = row["at"][0] + math.log(ratio) / math.log(sampling.high / sampling.low)
        found[n] = at
    return np.clip(found, 0.0, 1.0)


def settings(job: Job, place: Place, method: Method, campaigns: int) -> list[dict]:
    """A row for every setting that was tried. `at` is the setting on its axes; a row without
    `f_sw_Hz` is one with which the drive does not hold the point."""
    extent = method.quick if job.quick else method.extent
    kept = Kept(job.folder, "search", place, method.name, method.axes, method.law_axes, extent)
    rounds: list[list[dict]] = kept.load() or []
    number = 0
    for campaign in range(campaigns):
        rng = random_numbers(place, method, campaign)
        for part, count in enumerate((extent.cover, *extent.rounds)):
            if part == 0:
                tried = latin_hypercube(rng, count, method.free)
            else:
                tried = neighbours(rng, list(chain(*rounds[:number])), method, count)
            if number == len(rounds):
                rows = []
                for at in tried:
                    values = values_of(method, place, at)
                    figures = measure(method, place, values, job) or {}
                    rows.append({"at": at.tolist(), **values, **figures})
                rounds.append(rows)
                kept.save(rounds)
            number += 1
    return list(chain(*rounds[:number]))
