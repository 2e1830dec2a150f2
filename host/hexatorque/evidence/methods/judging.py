"""Best settings within a limit of the switching frequency, and the five sentences that follow.

A sentence asks which method has the least of something at several points. At each point a method's
value is taken relative to the least one there; what counts is the geometric mean over the points. A
method that lacks a point is not ranked. All methods within TIE of the least are named: the
sentence does not choose between them. Its words depend on these names alone, its figures are
the distances to the best of each family that is not named.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...recording.recording import Recording
from . import carrier
from .errors import CASES
from .methods import FAMILIES, MODULATED, Method
from .places import Place
from .search import ANY_HZ, best

#: The limit within which sentences, steps and errors are judged.
LIMIT_HZ = 4e3
TIE = 1.10
#: Voltage, in units of V_dc, that parts low from medium.
LOW_PU = 0.3


@dataclass(frozen=True)
class At:
    """One point. rows: method -> its settings with which the drive holds the point; flux_of: the
    method under which the drive has the flux of the analytic line, by default any of them;
    least_at_1kHz: figure -> the least of any pulse pattern at that switching frequency."""

    place: Place
    rows: Mapping[str, list[dict]]
    flux_of: str = ""
    least_at_1kHz: Mapping[str, float] = field(default_factory=dict)

    def within(
        self, name: str, figure: str, limit_Hz: float = LIMIT_HZ, sampled_Hz: float = ANY_HZ
    ) -> dict | None:
        return best(self.rows[name], figure, limit_Hz, sampled_Hz)

    def limits(self, figures: Iterable[str], limits_Hz: Iterable[float]) -> dict:
        """The best rows of every method: figure -> limit -> row."""
        return {
            name: {
                figure: {f"{hz:g}": self.within(name, figure, hz) for hz in limits_Hz}
                for figure in figures
            }
            for name in self.rows
        }

    @property
    def flux_Wb(self) -> float:
        every = [self.rows[self.flux_of]] if self.flux_of else self.rows.values()
        return float(np.median([row["flux_Wb"] for rows in every for row in rows]))

    @property
    def m_pu(self) -> float:
        """The voltage's amplitude in units of V_dc."""
        base = self.place.base
        steady = carrier.steady_state(base, self.place, self.flux_Wb)
        return float(abs(steady.v_V) / base["inverter.vdc_V"])

    def line(self, f_sw_Hz: float, turned: bool = False) -> carrier.Ripple | None:
        """The analytic line of carrier modulation. None beyond linear modulation, and where no
        setting tells the flux."""
        if self.flux_of and not self.rows[self.flux_of]:
            return None
        try:
            return carrier.ripple(self.place.base, self.place, f_sw_Hz, self.flux_Wb, turned)
        except ValueError:
            return None


def balanced(rows: list[dict]) -> dict | None:
    """The setting for steps and errors: the least product of torque ripple and distortion within
    the limit."""
    within = [row for row in rows if row["f_sw_Hz"] <= LIMIT_HZ]
    return min(within, key=lambda row: row["td_Nm"] * row["thd_inf_pct"], default=None)


#: Point or machine -> method -> value; None or nothing: not measured.
Values = Mapping[str, Mapping[str, float | None]]


def geometric_mean(values: Iterable[float]) -> float:
    logs = [math.log(value) for value in values]
    return math.exp(sum(logs) / len(logs))


def scores(values: Values) -> dict[str, float]:
    """The geometric mean of every method that has a value at all points, relative to the least
    one at each."""
    names = [
        name
        for name in next(iter(values.values()), {})
        if all(row.get(name) for row in values.values())
    ]
    found: dict[str, list[float]] = {name: [] for name in names}
    for row in values.values():
        here = {name: float(row[name] or 0.0) for name in names}
        least = min(here.values(), default=1.0)
        for name, value in here.items():
            found[name].append(value / least)
    return {name: geometric_mean(ratios) for name, ratios in found.items()}


def listed(names: Iterable[str]) -> str:
    words = [f"`{name}`" for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


@dataclass(frozen=True)
class Question:
    """asks: how the sentence begins; figure: what is compared, as the subject of its figures."""

    key: str
    asks: str
    figure: str


QUESTIONS = (
    Question(
        "smooth, low",
        f"For a smooth torque below {LOW_PU:g} V_dc",
        f"within {LIMIT_HZ / 1e3:g} kHz the torque ripple is",
    ),
    Question(
        "smooth, medium",
        f"For a smooth torque above {LOW_PU:g} V_dc",
        f"within {LIMIT_HZ / 1e3:g} kHz the torque ripple is",
    ),
    Question(
        "currents", "For clean currents at any voltage", f"within {LIMIT_HZ / 1e3:g} kHz THD∞ is"
    ),
    Question("fast", "For the fastest torque", "the time of a torque step, up and down, is"),
    Question(
        "wrong",
        "Where the machine is known to ± 30 % only",
        "with the worst of the wrong parameters the torque ripple is",
    ),
)


@dataclass(frozen=True)
class Sentence:
    """take: the methods that it names; against: family -> the named methods' value over that of
    the family's best; missing: methods that are not ranked."""

    question: Question
    take: tuple[str, ...]
    against: dict[str, float]
    missing: tuple[str, ...]

    @property
    def words(self) -> str:
        """The part that a search with a larger budget must not change."""
        named = f"take {listed(self.take)}" if self.take else "not measured"
        return f"{self.question.asks} {named}"

    @property
    def text(self) -> str:
        if not self.take:
            return f"{self.words}."
        parts = [f"{ratio:.2f} times that of {family}" for family, ratio in self.against.items()]
        text = ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else "".join(parts)
        return f"{self.words}: {self.question.figure} {text or 'alike everywhere'}."

    def as_json(self) -> dict:
        return {
            "key": self.question.key, "text": self.text, "words": self.words,
            "take": list(self.take), "against": self.against, "missing": list(self.missing),
        }  # fmt: skip


def sentence(question: Question, values: Values, methods: Iterable[Method]) -> Sentence:
    family = {method.name: method.family for method in methods}
    ranked = scores(values)
    missing = tuple(name for name in family if name not in ranked)
    if not ranked:
        return Sentence(question, (), {}, missing)
    least = min(ranked.values())
    take = tuple(name for name in family if ranked.get(name, math.inf) <= TIE * least)
    named = {family[name] for name in take}
    against = {}
    for other in FAMILIES:
        own = [ranked[name] for name in ranked if family[name] == other]
        if own and other not in named:
            against[other] = least / min(own)
    return Sentence(question, take, against, missing)


@dataclass(frozen=True)
class Result:
    """steps, errors: machine -> method -> test or case -> figures."""

    points: list[At]
    methods: tuple[Method, ...]
    chosen: dict[str, dict[str, dict | None]]
    steps: dict[str, dict[str, dict[str, dict]]]
    errors: dict[str, dict[str, dict[str, dict]]]

    def figure(self, name: str, points: Iterable[At]) -> Values:
        return {
            repr(at.place): {
                method.name: (at.within(method.name, name) or {}).get(name)
                for method in self.methods
            }
            for at in points
        }

    def rises(self) -> Values:
        def value(figures: dict) -> float | None:
            if "lost" in figures:
                return None
            return math.sqrt(figures["rise_up_ms"] * figures["rise_down_ms"])

        return {
            machine: {name: value(tests["torque step"]) for name, tests in own.items() if tests}
            for machine, own in self.steps.items()
        }

    def worst(self) -> Values:
        """The torque ripple with the worst wrong parameter; None if the drive is lost with one."""

        def value(cases: dict[str, dict]) -> float | None:
            if any("lost" in figures for figures in cases.values()):
                return None
            return max(figures["td_Nm"] for figures in cases.values())

        return {
            machine: {name: value(cases) for name, cases in own.items() if cases}
            for machine, own in self.errors.items()
        }

    def sentences(self) -> list[Sentence]:
        low = [at for at in self.points if at.m_pu < LOW_PU]
        medium = [at for at in self.points if at.m_pu >= LOW_PU]
        asked: list[Values] = [
            self.figure("td_Nm", low),
            self.figure("td_Nm", medium),
            self.figure("thd_inf_pct", self.points),
            self.rises(),
            self.worst(),
        ]
        return [
            sentence(question, values, self.methods)
            for question, values in zip(QUESTIONS, asked, strict=True)
        ]


#: Limits of the sampling frequency under which the torque ripple is compared once more.
SAMPLED_HZ = (10e3, 15e3, 20e3, 30e3, 50e3)


def by_sampling(points: list[At], methods: Iterable[Method]) -> dict[str, dict[str, float | None]]:
    """Method -> limit of its sampling frequency -> its least torque ripple over that of the best
    modulated method, whatever that one is sampled at; the geometric mean over the points. None
    where a point has no setting."""
    own = [method.name for method in methods if method.family == MODULATED]
    found: dict[str, dict[str, float | None]] = {}
    for method in methods:
        found[method.name] = {}
        for limit_Hz in SAMPLED_HZ:
            ratios = []
            for at in points:
                against = [row["td_Nm"] for name in own if (row := at.within(name, "td_Nm"))]
                row = at.within(method.name, "td_Nm", LIMIT_HZ, 1.001 * limit_Hz)
                if row and against:
                    ratios.append(row["td_Nm"] / min(against))
            whole = len(ratios) == len(points)
            found[method.name][f"{limit_Hz:g}"] = geometric_mean(ratios) if whole else None
    return found


CASE_NAMES = tuple(f"{name} × {factor:g}" for name, factor in CASES)
#: What a recording has of every setting.
COLUMNS = (
    ("f_isr_Hz", "Hz"),
    ("f_sw_Hz", "Hz"),
    ("td_Nm", "N m"),
    ("thd_inf_pct", "%"),
    ("ixy_rms_A", "A"),
    ("loss_W", "W"),
    ("idc_ripple_A", "A"),
)


def as_recording(
    points: Mapping[str, Mapping[str, list[dict]]], kind: str, names: list[str]
) -> Recording:
    """One row per setting: point -> name -> settings. kind: what the names are, in the singular."""
    rows = [
        (number, names.index(name), *(row[column] for column, _ in COLUMNS))
        for number, own in enumerate(points.values())
        for name, settings in own.items()
        for row in settings
    ]
    data = np.array(rows, float).reshape(-1, len(COLUMNS) + 2)
    channels = {"point": data[:, 0], kind: data[:, 1]}
    channels |= {column: data[:, n + 2] for n, (column, _) in enumerate(COLUMNS)}
    meta = {
        "rows": "one per setting with which the drive holds its point",
        "points": list(points),
        f"{kind}s": names,
    }
    return Recording(1.0, channels, {"point": "", kind: "", **dict(COLUMNS)}, meta)
