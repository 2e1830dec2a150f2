"""Tune a set-up: try candidates, and choose the best one that also holds with wrong parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .. import __version__
from ..experiments.operating_points import Progress
from ..parallel import each as run_each
from ..plant.machines import constants_of, parameters_of
from ..setups import Setup, SetupError, parameters
from ..setups.keys import TIMING_OWNS
from ..setups.review import review
from ..system import usable_cores
from . import course, search, space
from .aim import Figures, Weights, aim
from .course import Lost, Times, Where
from .search import Judged, Tried

TRIALS = 96
#: The flux of a candidate may differ that far from the one before tuning: less flux has less
#: ripple, but the torque limit and the losses rely on it.
FLUX_TOLERANCE = 0.05
#: So many of the best candidates are tried with wrong parameters.
CANDIDATES = 10
#: The inertia, which the controller does not know but its speed loop is tuned to.
INERTIA = "inertia_kgm2"


def _both_ways(*what: tuple[str, str, int]) -> tuple[tuple[str, str, float], ...]:
    return tuple(
        (f"{name} {sign * percent:+d} %", key, 1 + sign * percent / 100)
        for name, key, percent in what
        for sign in (-1, 1)
    )


def errors_of(setup: Setup) -> tuple[tuple[str, str, float], ...]:
    """What may be wrong: name, parameter that the controller knows of the machine or INERTIA,
    factor."""
    return _both_ways(*parameters_of(setup["machine.model"]).TOLD_WRONG, ("J", INERTIA, 30))


@dataclass(frozen=True)
class Request:
    """The subject of a tuning, its operating points and its aim."""

    setup: Setup
    points: tuple[Where, ...]
    weights: Weights
    seed: int = 1
    trials: int = TRIALS

    def knobs(self) -> list[space.Knob]:
        """The parameters that move. A speed loop that does not count stays as it is."""
        found = space.knobs(self.setup)
        return [k for k in found if self.weights["speed"] > 0 or k.name not in space.SPEED_LOOP]

    def as_json(self) -> dict[str, Any]:
        """The identity of a study. The number of trials may grow."""
        return {
            "version": __version__,
            "set-up": {**self.setup.summary(), "controller": parameters(self.setup)},
            "points": [asdict(point) for point in self.points],
            "weights": self.weights,
            "seed": self.seed,
        }


@dataclass(frozen=True)
class Outcome:
    """One set-up at all points. lost: why it does not hold them; then there are no figures."""

    chosen: dict[str, float]
    aim: float
    figures: tuple[Figures, ...]
    lost: str = ""


@dataclass(frozen=True)
class Tuned:
    """start, best: before and after; best is start if nothing better holds. errors: for each error
    of a parameter its effect before and after tuning, "" if the drive holds. refused: better
    candidates that an error of a parameter makes trip or lose a point."""

    request: Request
    start: Outcome
    best: Outcome
    tried: list[Outcome]
    errors: dict[str, tuple[str, str]]
    refused: int

    @property
    def setup(self) -> Setup:
        return space.changed(self.request.setup, self.best.chosen, note(self.request))

    @property
    def better(self) -> bool:
        return self.best is not self.start


def note(request: Request) -> str:
    """The note beside each value in the file."""
    return f"hexatorque tune, seed {request.seed}, {request.trials} trials"


def tune(
    request: Request,
    journal: Path | None = None,
    resume: bool = False,
    jobs: int | None = None,
    progress: Progress | None = None,
    each: Callable[[int, float], None] | None = None,
) -> Tuned:
    """The whole of it. `each` is called with the number of candidates so far and the best aim.
    Raises Lost if the set-up does not hold its points before tuning."""
    search.library()
    setup, points = request.setup, request.points
    course.check_points(setup, points)
    plan = course.times(setup, points)
    knobs = request.knobs()
    if not knobs:
        raise SetupError(f"{setup.name}: no parameter of this drive can be tuned")
    study = search.open_study(journal, request.as_json(), resume)
    workers = jobs or usable_cores()
    stopped = threading.Event()

    def passed(seconds: float) -> None:
        if stopped.is_set():
            raise Lost("interrupted")
        if progress:
            progress(seconds)

    judge = Judge(request, plan, passed)
    best_aim = 0.0

    def seen(one: Tried) -> None:
        nonlocal best_aim
        best_aim = min(best_aim, one.aim)
        if each:
            each(one.number + 1, best_aim)

    try:
        done = search.search(study, knobs, judge, request.trials, request.seed, workers, seen)
        outcomes = [judge.outcome(one) for one in done]
        return _choose(
            request, judge, outcomes, lambda cases: run_each(judge.robust, cases, workers)
        )
    except BaseException:
        stopped.set()
        raise


class Judge:
    """The worth of a candidate against the set-up before tuning."""

    def __init__(self, request: Request, plan: Sequence[Times], progress: Progress) -> None:
        self.request, self.plan, self.progress = request, plan, progress
        setup = request.setup
        self._start_values = {knob.name: knob.start for knob in request.knobs()}
        self._refused_before = self._refused(setup)
        try:
            self.start = Outcome({}, 0.0, tuple(self._drive(setup)))
        except Lost as error:
            raise Lost(f"{setup.name}, before tuning: {error}") from None

    def __call__(self, values: Mapping[str, float]) -> Judged:
        if dict(values) == self._start_values:
            outcome = self.start
        else:
            outcome = self._tried(space.settings(self.request.setup, values))
        figures = [one.as_json() for one in outcome.figures]
        details = {"chosen": outcome.chosen, "figures": figures, "lost": outcome.lost}
        return Judged(outcome.aim, details)

    def outcome(self, one: Tried) -> Outcome:
        if one.number == 0:
            return self.start
        figures = tuple(Figures(**at) for at in one.details["figures"])
        return Outcome(one.details["chosen"], one.aim, figures, one.details["lost"])

    def _tried(self, chosen: dict[str, float]) -> Outcome:
        setup = self.request.setup
        try:
            candidate = space.changed(setup, chosen)
            if new := self._refused(candidate) - self._refused_before:
                raise Lost(f"check: {', '.join(sorted(new))}")
            figures = self._drive(candidate)
            for point, found, before in zip(self.request.points, figures, self.start.figures):
                if abs(found.flux_Wb / before.flux_Wb - 1) > FLUX_TOLERANCE:
                    raise Lost(f"{point}: flux {found.flux_Wb:.4g} Wb, {before.flux_Wb:.4g} before")
        except (SetupError, Lost) as error:
            return Outcome(chosen, search.LOST, (), str(error))
        return Outcome(
            chosen, aim(self.request.weights, figures, self.start.figures), tuple(figures)
        )

    def _drive(self, setup: Setup) -> list[Figures]:
        return course.drive(setup, self.request.points, self.plan, self.progress)

    def _refused(self, setup: Setup) -> set[str]:
        """The findings that `check` calls bad."""
        scheme = str(setup.parameter("scheme"))
        return {f.subject for f in review(setup, [scheme], steady=False) if f.stops}

    def robust(self, case: tuple[dict[str, float], tuple[str, str, float]]) -> str:
        """Why a candidate does not hold with an error; "" if it does."""
        chosen, (_, key, factor) = case
        try:
            self._drive(wrong(space.changed(self.request.setup, chosen), key, factor))
        except (SetupError, Lost) as error:
            return str(error)
        return ""


def wrong(setup: Setup, key: str, factor: float) -> Setup:
    """The controller takes this parameter of the machine for `factor` times its value. The
    machine stays. An error of L_m is one of L_r as well, and with magnets one of L_q is one of L_d.
    With INERTIA the machine has another one, and the controller stays."""
    if key == INERTIA:
        values = {n: v for n, v in parameters(setup).items() if n not in TIMING_OWNS}
        stays = {f"controller__{name}": value for name, value in values.items()}
        return setup.changed(machine__inertia_kgm2=factor * setup[f"machine.{INERTIA}"], **stays)
    value = float(setup.parameter(key))
    changes: dict[str, float] = {f"controller__{key}": factor * value}
    if key == "lm_H":
        changes["controller__lr_H"] = float(setup.parameter("lr_H")) + (factor - 1) * value
    if key == "sigma_ls_H" and "ld_H" in constants_of(setup["machine.model"]):
        changes["controller__ld_H"] = factor * float(setup.parameter("ld_H"))
    return setup.changed(**changes)


#: Judges candidates with errors, in parallel.
Robust = Callable[[list[tuple[dict[str, float], tuple[str, str, float]]]], list[str]]


def _choose(request: Request, judge: Judge, outcomes: list[Outcome], robust: Robust) -> Tuned:
    """The best candidate that holds with every error with which the drive holds before tuning."""

    def with_errors(outcome: Outcome) -> dict[str, str]:
        errors = errors_of(request.setup)
        return dict(zip((e[0] for e in errors), robust([(outcome.chosen, e) for e in errors])))

    start = judge.start
    before = with_errors(start)
    ranked = sorted((o for o in outcomes if not o.lost and o.aim < 0), key=lambda o: o.aim)
    best, after, refused = start, before, 0
    for candidate in ranked[:CANDIDATES]:
        found = with_errors(candidate)
        if not any(found[name] and not before[name] for name in found):
            best, after = candidate, found
            break
        refused += 1
    errors = {name: (before[name], after[name]) for name in before}
    return Tuned(request, start, best, outcomes, errors, refused)
