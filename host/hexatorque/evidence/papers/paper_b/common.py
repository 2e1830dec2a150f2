"""The common parts of paper B's figures: schemes, operating point, printed numbers, colours."""

from __future__ import annotations

from .... import setups
from ....analysis.run import Run
from ....analysis.schemes import STYLE
from ....experiments.operating_points import Point
from ....recording.recording import Recording
from ....setups import Setup
from ..engine.job import Job
from ..printed_values import PAPER

SETUP = "paper-b"
#: In this set-up the values that the paper leaves open are fitted to its Table VI. It agrees better
#: with Table VI and Figs. 14, 16 and 19, and worse with Figs. 7, 11, 12, 15 and 17. Therefore Table
#: VI and Figs. 14, 16 and 19 show both set-ups.
FITTED = "paper-b-fitted"
SETUPS = (SETUP, FITTED)
SCHEMES = ("dtc1", "dtc2", "dtc3")
#: Table VI: operating point, and printed numbers by scheme.
TABLE = PAPER[SETUP]
SPEED_RPM, LOAD_NM = TABLE["speed_rpm"], TABLE["load_Nm"]
PRINTED = TABLE["schemes"]
COLOUR = {name: STYLE[name]["color"] for name in SCHEMES}
MARKER = {name: STYLE[name]["marker"] for name in SCHEMES}


def setup(scheme: str, name: str = SETUP, **changes: object) -> Setup:
    """The paper's drive with one of its schemes."""
    return setups.load(name).changed(controller__scheme=scheme, **changes)


def point(
    scheme: str,
    speed_rpm: float = SPEED_RPM,
    load_Nm: float = LOAD_NM,
    name: str = SETUP,
    **changes: object,
) -> Point:
    """An operating point. The brake takes the stated torque at the stated speed."""
    return Point(setup(scheme, name, **changes), speed_rpm, load_Nm)


def control_instants(rec: Recording) -> Recording:
    """The samples at the beginning of each control period, when the controller samples. The paper's
    traces leave the DSP once a period."""
    per = rec.meta["samples_per_period"]
    first = -round(rec.start_s * rec.rate_Hz) % per
    return Recording(
        rec.rate_Hz / per,
        {name: values[first::per] for name, values in rec.channels.items()},
        rec.units,
        {**rec.meta, "samples_per_period": 1},
        rec.start_s + first / rec.rate_Hz,
    )


def ending(rec: Recording, span_s: float) -> Recording:
    """The last `span_s` (a view)."""
    return rec.window(rec.start_s + rec.duration_s - span_s, rec.start_s + rec.duration_s)


def excerpt(rec: Recording, names: tuple[str, ...], span_s: float | None = None) -> Recording:
    """The named channels over the last `span_s`, or over the whole recording if it is None."""
    span = ending(rec, span_s) if span_s else rec
    # These are copies, because a view would keep the whole recording in memory.
    channels = {name: span[name].copy() for name in names}
    units = {name: rec.units[name] for name in names}
    return Recording(rec.rate_Hz, channels, units, rec.meta, span.start_s)


def xy_orders(highest: int) -> list[int]:
    """Harmonics of the x-y plane, 6n +- 1 with n odd: 5, 7, 17, 19, ..."""
    return [k for k in range(2, highest + 1) if k % 12 in (5, 7)]


def torque_orders(highest: int) -> list[int]:
    """Harmonics of the d-q plane, 12n +- 1: 11, 13, 23, 25, ..."""
    return [k for k in range(2, highest + 1) if k % 12 in (1, 11)]


def around(load_Nm: float, quick: bool) -> list[float]:
    """The load and some loads close to it. Switching tables are chaotic in detail, so figures are
    means over these points. Two values that differ by less than their spread do not differ."""
    shares = (0.0, -0.01, 0.01) if quick else (0.0, -0.02, -0.01, 0.01, 0.02)
    return [load_Nm * (1 + share) for share in shares]


def mean(rows: list[dict[str, float]]) -> dict[str, float]:
    """The mean of each key over the rows."""
    return {key: sum(row[key] for row in rows) / len(rows) for key in rows[0]}


def runs_around(job: Job, schemes: tuple[str, ...]) -> dict[str, list[Run]]:
    """Runs each scheme at the operating point of Table VI and at loads close to it."""
    loads = around(LOAD_NM, job.quick)
    runs = iter(job.runs([point(s, load_Nm=load) for s in schemes for load in loads]))
    return {scheme: [next(runs) for _ in loads] for scheme in schemes}
