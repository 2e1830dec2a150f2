"""Which runs a study has: what varies, over which values, and how these are combined."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..given import listed, numeric, pairs, plain, real, suggest
from ..setups import Setup, SetupError
from ..setups.paths import PROFILE_SECTION, key_of, sections, split
from .errors import StudyError

GRID, LIST, RANDOM, HYPERCUBE, SOBOL = DESIGNS = (
    "grid", "list", "random", "latin-hypercube", "sobol",
)  # fmt: skip
#: More runs than this are a mistake.
MOST_RUNS = 10_000_000
#: Digits of a value that is computed from a range.
DIGITS = 12
SCHEME, LATENCY, SEED = "controller.scheme", "timing.latency", "sensors.noise_seed"
_RANGE = ("from", "to", "count", "log")
_FACTORS = ("values", "times")


@dataclass(frozen=True)
class Axis:
    """One key of a set-up and its values: either those of `values`, or all from `low` to `high`."""

    path: str
    values: tuple[Any, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False

    @property
    def free(self) -> bool:
        """Whether it has more than one value."""
        return len(self.values) != 1

    def at(self, share: float) -> Any:
        """The value at a share 0 .. 1 of the way."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return _number(self.path, self.low * (self.high / self.low) ** share)
        return _number(self.path, self.low + share * (self.high - self.low))

    def as_json(self) -> dict[str, Any]:
        if self.values:
            return {"values": list(self.values)}
        return {"from": self.low, "to": self.high, "log": self.log}


def _number(path: str, value: float) -> float | int:
    return round(value) if _is_whole(path) else float(f"{value:.{DIGITS}g}")


def read_axis(path: str, given: Any, design: str, setup: Setup | None = None) -> Axis:
    """From a value, a list of values, {values}, or a range {from, to, count, log}. With `times`
    all of them are factors of the set-up's own value."""
    own = None
    try:
        split(path)
    except SetupError as error:
        raise StudyError(str(error)) from None
    if isinstance(given, Mapping):
        if unknown := [name for name in given if name not in (*_RANGE, *_FACTORS)]:
            raise StudyError(
                f"{path}: unknown {unknown[0]!r}; known: {', '.join((*_RANGE, *_FACTORS))}"
            )
        if not isinstance(times := given.get("times", False), bool):
            raise StudyError(f"{path}: times = {times!r}: true or false is needed")
        own = _own(path, setup) if times else None
        if "values" in given:
            if beside := [name for name in _RANGE if name in given]:
                raise StudyError(f"{path}: values and {beside[0]}: only one of them is allowed")
            given = given["values"]
    if not isinstance(given, Mapping):
        return _listed(path, given, design, own)
    low, high = (_finite(path, name, given.get(name)) for name in ("from", "to"))
    log, count = given.get("log", False), given.get("count")
    if not isinstance(log, bool):
        raise StudyError(f"{path}: log = {log!r}: true or false is needed")
    if log and not (low > 0 and high > 0):
        raise StudyError(f"{path}: from {low:g} to {high:g}: above 0 is needed with log")
    factor = 1.0 if own is None else own
    axis = Axis(path, (), low * factor, high * factor, log)
    if design in (GRID, LIST):
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_RUNS:
            raise StudyError(
                f"{path}: count = {count}: allowed range is 1 .. {MOST_RUNS}, in a {design}"
            )
        shares = [k / (count - 1) for k in range(count)] if count > 1 else [0.0]
        return _checked(Axis(path, tuple(dict.fromkeys(axis.at(share) for share in shares))))
    if count is not None:
        raise StudyError(f"{path}: count: a {design} design has `samples` instead")
    return _checked(axis)


def _listed(path: str, given: Any, design: str, own: float | None) -> Axis:
    several = plain(given)
    several = several if isinstance(several, (list, tuple, range)) else [several]
    values = tuple(map(plain, several))
    if not values:
        raise StudyError(f"{path}: no values are given, the {design} is empty")
    if own is None:
        values = tuple(_as_read(path, value) for value in values)
    else:
        values = tuple(_number(path, own * _finite(path, "a factor", v)) for v in values)
    return _checked(Axis(path, values))


def _as_read(path: str, value: Any) -> Any:
    """Text as the value that it says."""
    section, key = split(path)
    if not isinstance(value, str) or section == PROFILE_SECTION:
        return value
    return nested({path: value})[section][key].value


def _own(path: str, setup: Setup | None) -> float:
    """The set-up's value of a key whose values are factors. Without a point the one at which its
    runs are measured."""
    from ..experiments.steady import at_point  # takes long to import

    if setup is not None and path.startswith("point.") and setup["point.speed_rpm"] == 0:
        setup = at_point(setup)
    own = None if setup is None else setup[path]
    if isinstance(own, bool) or not isinstance(own, (int, float)) or own == 0:
        raise StudyError(f"{path}: times: the set-up has {own}, a number other than 0 is needed")
    return own


def _finite(path: str, name: str, value: Any) -> float:
    value = numeric(plain(value))
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise StudyError(f"{path}: {name} = {value!r}: a finite number is needed")
    return float(value)


def read_text(text: str, option: str) -> tuple[str, Any]:
    """Path and values of KEY=FROM:TO:COUNT, KEY=FROM:TO or KEY=A,B,... With A;B the comma is a
    decimal comma."""
    path, equals, rest = (part.strip() for part in text.partition("="))
    if not path or not equals or not rest:
        raise StudyError(f"{option} {text}: KEY=FROM:TO:COUNT or KEY=A,B,... is needed")
    parts = rest.split(":")
    if len(parts) not in (2, 3):
        return path, [numeric(part) for part in listed(rest)]
    try:
        given: dict[str, Any] = {"from": real(parts[0]), "to": real(parts[1])}
        if len(parts) == 3:
            given["count"] = int(parts[2])
    except ValueError:
        raise StudyError(
            f"{option} {text}: {rest}: FROM:TO:COUNT is needed, for example 100:1000:10"
        ) from None
    return path, given


def _is_whole(path: str) -> bool:
    return key_of(path).kind == "integer"


def _checked(axis: Axis) -> Axis:
    """Refuse an unknown key, and values that it cannot have."""
    for value in axis.values or (axis.at(0.0), axis.at(1.0)):
        nested({axis.path: value})
    return axis


# -- a set-up with other values --------------------------------------------------------------


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by path, checked: the sections of a set-up's file."""
    from ..setups import schema

    try:
        return schema.check(sections(values))
    except SetupError as error:
        raise StudyError(str(error)) from None


def changed(setup: Setup, values: Mapping[str, Any]) -> Setup:
    """The set-up with other values. `timing.latency` becomes what the scheme needs, unless it is
    given. SetupError if the values do not fit together."""
    from .. import firmware

    scheme = values.get(SCHEME)
    if isinstance(scheme, str) and firmware.needs_prediction(scheme):
        values = {LATENCY: "predicted", **values}
    return setup.changed(values)


def completed(setup: Setup, defaults: Mapping[str, Any]) -> Setup:
    """The set-up with values for what it leaves open."""
    open_keys = {}
    for path, value in defaults.items():
        section, _, key = path.partition(".")
        if key not in setup.values.get(section, {}):
            open_keys[path] = value
    return changed(setup, open_keys) if open_keys else setup


# -- points ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Design:
    """The points of a study. Point `k` has the values `point(k)`.

    A grid has every combination, the last axis the quickest. A list has the first value of every
    axis, then the second, and so on. The others draw: random numbers and Latin hypercubes
    `samples` points, a Sobol design (`sobol`) `samples` for each axis and two more."""

    kind: str
    axes: tuple[Axis, ...]
    samples: int
    seed: int
    shares: np.ndarray | None  #: (samples, axes), of those that are drawn

    @property
    def points(self) -> int:
        if self.kind == GRID:
            return math.prod(len(axis.values) for axis in self.axes)
        return self.samples if self.shares is None else len(self.shares)

    def point(self, number: int) -> dict[str, Any]:
        if self.shares is not None:
            row = self.shares[number]
            return {axis.path: axis.at(float(share)) for axis, share in zip(self.axes, row)}
        if self.kind == LIST:
            return {axis.path: axis.values[number] for axis in self.axes}
        found = {}
        for axis in reversed(self.axes):
            number, k = divmod(number, len(axis.values))
            found[axis.path] = axis.values[k]
        return {axis.path: found[axis.path] for axis in self.axes}


@dataclass(frozen=True)
class Draw:
    """The combination of the values of a study's keys. design: "grid" takes all combinations,
    "list" the first values together, then the second ones; "random" and "latin-hypercube" draw
    `samples` points with `seed`; "sobol" does so, too, and tells how much each key matters."""

    design: str = GRID
    samples: int | None = None
    seed: int = 1


def points(draw: Draw, keys: Mapping[str, Any], setup: Setup | None = None) -> Design:
    """The points over `keys`: path -> a value, a list of values, or a range. setup: has the values
    that factors multiply."""
    kind, samples, seed = draw.design, draw.samples, draw.seed
    if kind not in DESIGNS:
        raise StudyError(f"design = {kind!r}: choose one of {', '.join(DESIGNS)}")
    axes = tuple(read_axis(path, given, kind, setup) for path, given in pairs(keys).items())
    if kind in (GRID, LIST):
        if samples is not None:
            raise StudyError(f"samples = {samples}: a {kind} has as many as its values make")
        lengths = {axis.path: len(axis.values) for axis in axes}
        if kind == LIST and len(set(lengths.values())) > 1:
            shown = ", ".join(f"{path} has {n}" for path, n in lengths.items())
            raise StudyError(f"a list needs as many values of each key: {shown}")
        return Design(kind, axes, next(iter(lengths.values()), 1), seed, None)
    if not axes:
        raise StudyError(f"a {kind} design needs a key that varies")
    if isinstance(samples, bool) or not isinstance(samples, int) or not 1 <= samples <= MOST_RUNS:
        raise StudyError(f"samples = {samples}: allowed range is 1 .. {MOST_RUNS}")
    if kind == SOBOL:
        from .sobol import drawn

        return Design(kind, axes, samples, seed, drawn(samples, [a.free for a in axes], seed))
    return Design(kind, axes, samples, seed, _drawn(kind, samples, len(axes), seed))


def _drawn(kind: str, samples: int, axes: int, seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    if kind == RANDOM:
        return random.random((samples, axes))
    try:
        from scipy.stats import qmc
    except ImportError:
        raise StudyError(
            "a latin-hypercube needs SciPy, which is not installed: pip install 'hexatorque[sweep]'"
        ) from None
    return qmc.LatinHypercube(axes, seed=random).random(samples)


@dataclass(frozen=True)
class Case:
    """One run: its number and the set-up's values that it changes."""

    number: int
    values: dict[str, Any]


@dataclass(frozen=True)
class Space:
    """All runs: every point of the design with every scheme and every seed of the noise. Without
    schemes or seeds, those of the set-up."""

    design: Design
    schemes: tuple[str, ...]
    seeds: tuple[int, ...]

    def __post_init__(self) -> None:
        paths = [axis.path for axis in self.design.axes]
        for path, name, given in ((SCHEME, "schemes", self.schemes), (SEED, "seeds", self.seeds)):
            if given and path in paths:
                raise StudyError(f"{path} varies: leave out `{name}`")
        if not (paths or self.schemes or self.seeds):
            raise StudyError("nothing varies: give a key of the set-up, schemes or seeds")
        if len(self) > MOST_RUNS:
            raise StudyError(f"{len(self)} runs: at most {MOST_RUNS} are allowed")

    def __len__(self) -> int:
        return self.design.points * max(1, len(self.schemes)) * max(1, len(self.seeds))

    @property
    def paths(self) -> list[str]:
        """The keys that a run may change, in the order of the table."""
        return [
            *([SCHEME] if self.schemes else []),
            *(axis.path for axis in self.design.axes),
            *([SEED] if self.seeds else []),
        ]

    def case(self, number: int) -> Case:
        rest, seed = divmod(number, max(1, len(self.seeds)))
        point, scheme = divmod(rest, max(1, len(self.schemes)))
        values = self.design.point(point)
        if self.schemes:
            values = {SCHEME: self.schemes[scheme], **values}
        if self.seeds:
            values[SEED] = self.seeds[seed]
        return Case(number, values)

    def cases(self, numbers: Iterable[int]) -> Iterable[Case]:
        return map(self.case, numbers)


def unit_of(path: str) -> str:
    """The unit of a set-up's key."""
    return key_of(path).unit


def check_words(names: Sequence[str], known: Iterable[str], what: str) -> None:
    """Refuse a name that is not known, or that is there twice."""
    known = list(known)
    for name in names:
        if name not in known:
            raise StudyError(f"unknown {what} {name!r}{suggest(name, known)}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if list(names).count(name) > 1)
        raise StudyError(f"{what} {twice!r} is there twice")
