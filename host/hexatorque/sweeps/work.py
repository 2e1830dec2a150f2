"""One run of a study. Workers call `do`, wherever they are."""

from __future__ import annotations

import ctypes
import math
import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .. import __version__
from ..analysis.metrics import BRIDGE, UNITS, flat, metrics
from ..build import build
from ..errors import HexatorqueError
from ..setups import Setup, SetupError
from ..setups.values import Profile
from .cycle import UNITS as CYCLE_UNITS
from .cycle import Cycle, read
from .errors import StudyError
from .space import Case, changed

#: How a run gets its figures: in steady state at the set-up's operating point, from the profile, or
#: over a drive cycle.
POINT, PROFILE, CYCLE = KINDS = ("point", "profile", "cycle")
#: Digits of the figures. The last bits of a Fourier transform depend on where its array lies in
#: memory.
DIGITS = 9
#: Options of the GNU C library's mallopt: M_MMAP_THRESHOLD, M_TRIM_THRESHOLD, M_ARENA_MAX.
MALLOC = ((-3, 32 << 20), (-1, 256 << 20), (-8, 1))
#: Figures that need more samples a period than others.
FINE = "torque_ripple_td_Nm"


class OtherVersion(StudyError):
    """A worker would compute other figures."""


@dataclass(frozen=True)
class Runs:
    """The task of each run of a study. kind: "point" measures the steady state at the set-up's
    operating point, "profile" its profile from `from_s` on, "cycle" follows the drive cycle
    `cycle`, with the figures of `cycle.UNITS`."""

    kind: str = POINT
    from_s: float = 0.0
    cycle: str | Path = ""

    def checked(self) -> Cycle | None:
        """The cycle, if there is one. StudyError names what does not fit together."""
        if self.kind not in KINDS:
            raise StudyError(f"run = {self.kind!r}: choose one of {', '.join(KINDS)}")
        if bool(self.cycle) != (self.kind == CYCLE):
            raise StudyError(f"cycle = {self.cycle!r}: run = {CYCLE!r} needs one, nothing else may")
        if self.kind != PROFILE and self.from_s:
            raise StudyError(f"from_s = {self.from_s!r}: only with run = {PROFILE!r}")
        from_s: Any = self.from_s
        if not isinstance(from_s, (int, float)) or not from_s >= 0:
            raise StudyError(f"from_s = {self.from_s!r}: a time of 0 s or more is needed")
        return read(self.cycle) if self.cycle else None


@dataclass(frozen=True)
class Work:
    """The common part of all runs of a study. from_s: a profile is measured from here to its end;
    limit_s: longest wall-clock time of a run; identity: of the package that asks."""

    setup: Setup
    metrics: tuple[str, ...]
    kind: str
    from_s: float
    limit_s: float
    identity: dict[str, str]
    cycle: Cycle | None = None


@dataclass(frozen=True)
class Row:
    """The result of a run. figures: NaN where there is none; failure: why there are none, empty if
    the run is good; lost: it failed by the computer, not by the drive, so it is worth a new try."""

    number: int
    figures: tuple[float, ...]
    failure: str = ""
    lost: bool = False


class TimeUp(HexatorqueError):
    """A run takes too long."""


@lru_cache(maxsize=1)  # looking it up takes longer than handing over a run
def identity() -> dict[str, str]:
    """All that decides the bits of a result."""
    libraries = {name: version(name) for name in ("numpy", "numba")}
    return {"hexatorque": __version__, "build": build(), **libraries}


@lru_cache(maxsize=1)
def _keep_memory() -> None:
    """Keep freed memory for the next run. Dask tells the C library to give it back at once, and
    then a run spends a third of its time on new pages. Does nothing elsewhere."""
    if "MALLOC_TRIM_THRESHOLD_" not in os.environ:
        return
    with suppress(OSError, AttributeError):  # another C library
        library = ctypes.CDLL(None)
        for option, value in MALLOC:
            library.mallopt(option, value)


def do(work: Work, cases: Sequence[Case]) -> list[Row]:
    """Several runs, one after another. Raises OtherVersion if this computer is not what the study
    expects."""
    _keep_memory()
    here = identity()
    for name, wanted in work.identity.items():
        if here.get(name) != wanted:
            raise OtherVersion(
                f"worker on {socket.gethostname()}: {name} {here.get(name)}, this study needs "
                f"{wanted}"
            )
    return [one(work, case) for case in cases]


def lost(work: Work, case: Case, why: str) -> Row:
    return Row(case.number, (math.nan,) * len(work.metrics), why, True)


def one(work: Work, case: Case) -> Row:
    end_s = time.monotonic() + work.limit_s

    def look(_: float) -> None:
        if time.monotonic() > end_s:
            raise TimeUp

    try:
        figures = _measure(work, changed(work.setup, case.values), look)
    except TimeUp:
        return lost(work, case, time_up(work))
    except MemoryError:
        return lost(work, case, "out of memory")
    except Exception as error:  # the other runs go on
        expected = isinstance(error, (HexatorqueError, ArithmeticError, ValueError))
        name = "" if expected else f"{type(error).__name__}: "
        text = " ".join(f"{name}{error}".split())
        return Row(case.number, (math.nan,) * len(work.metrics), text or type(error).__name__)
    return Row(case.number, figures)


def time_up(work: Work) -> str:
    return f"not done within the time limit of {work.limit_s:g} s"


def units(kind: str) -> dict[str, str]:
    """The figures that a run of this kind may have, with their units."""
    return CYCLE_UNITS if kind == CYCLE else UNITS


def unit(name: str) -> str:
    """The unit of a figure of any kind of run."""
    return {**units(POINT), **units(CYCLE)}[name]


def _measure(work: Work, setup: Setup, look: Callable[[float], None]) -> tuple[float, ...]:
    values: Mapping[str, float | None]
    if work.cycle:
        from .energy import figures

        values = figures(setup, work.cycle, look)
    else:
        measure = _at_point if work.kind == POINT else _along_profile
        values = flat(measure(work, setup, look))
    return tuple(_rounded(values[name]) for name in work.metrics)


def _rounded(value: float | None) -> float:
    return math.nan if value is None else float(f"{value:.{DIGITS}g}")


def _at_point(work: Work, setup: Setup, look: Callable[[float], None]) -> dict:
    from ..experiments.operating_points import Point, fine_samples, measure
    from ..experiments.steady import at_point

    setup = at_point(setup)
    point = Point(setup, setup["point.speed_rpm"], setup["point.load_Nm"])
    samples = fine_samples(setup) if FINE in work.metrics else 4
    return measure(point, look, samples, names=work.metrics).metrics


def _along_profile(work: Work, setup: Setup, look: Callable[[float], None]) -> dict:
    from ..drive.simulated import SimulatedDrive
    from ..experiments.operating_points import MOST_EDGES

    before, after = _split(setup.profile, work.from_s)
    sim = SimulatedDrive(setup, setup.profile.samples_per_period)
    sim.start()
    if before.duration_s > 0:
        sim.run_profile(before, look, record=False)
    if any(name in BRIDGE for name in work.metrics):
        sim.log_edges(math.ceil(after.duration_s / sim.period_s) * MOST_EDGES)
    start, begin = sim.inverter.leg.copy(), sim.periods
    sim.run_profile(after, look)
    sim.check()
    return metrics(sim.take(), edges=sim.edges_since(begin, start), names=work.metrics)


def _split(profile: Profile, at_s: float) -> tuple[Profile, Profile]:
    """A profile in two, the second with times of its own."""
    if lines := profile.too_late():
        raise SetupError("\n".join(lines))
    if at_s >= profile.duration_s:
        raise SetupError(
            f"from_s = {at_s:g}: the profile ends at duration_s = {profile.duration_s:g} s"
        )
    steps = ("speed_rpm", "load_Nm", "vdc_V", "set", "command")
    first: dict[str, Any] = {n: tuple(s for s in getattr(profile, n) if s[0] < at_s) for n in steps}
    second: dict[str, Any] = {
        n: tuple((s[0] - at_s, *s[1:]) for s in getattr(profile, n) if s[0] >= at_s) for n in steps
    }
    return (
        replace(profile, duration_s=at_s, **first),
        replace(profile, duration_s=profile.duration_s - at_s, **second),
    )
