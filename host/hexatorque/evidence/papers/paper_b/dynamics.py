"""Paper B's dynamic tests: speed and load steps under the three schemes (Figs. 17 and 18)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ....analysis import plots
from ....analysis.response import moving_mean, step_response
from ....experiments.operating_points import transient
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, claim, not_printed
from ..engine.job import Job
from .common import COLOUR, LOAD_NM, SCHEMES, excerpt, mean, point

RATED_RPM, RATED_NM = 2500.0, LOAD_NM
LIGHT_NM = 0.3
DURATION_S = 1.0
#: The step comes at several instants of the ripple, and of the speed loop's period of 10 ms.
STEPS_S = (0.1, 0.1031, 0.1067, 0.1012, 0.1053)
QUICK_STEPS = 3
FILTER_S = 10e-3
BAND_RPM = 20.0
CHANNELS = ("plant.speed_rpm", "plant.torque_Nm", "torque_ref_Nm")
DEFINITION = (
    "All numbers use the moving mean of the true speed over 10 ms. It has settled when it stays "
    "within 20 r/min of its reference. Overshoot and deviation are relative to 2500 r/min. The "
    "numbers are means over five (quick: three) instants of the step within the speed loop's "
    "period. The picture shows one of them."
)


class Step(NamedTuple):
    """One test: the steady state before it, the change, and the speed at which the drive should
    end."""

    speed_rpm: float
    load_Nm: float
    name: str  # controller parameter or load_Nm
    value: float
    target_rpm: float


SPEED_STEP = Step(1000.0, LIGHT_NM, "speed_ref_rpm", 2000.0, 2000.0)
LOAD_STEP = Step(2000.0, LIGHT_NM, "load_Nm", LOAD_NM, 2000.0)


def response(rec: Recording, step: Step, step_s: float) -> dict[str, float]:
    """The figures of one recording by the definition above. torque_max_Nm is the maximum of the
    torque's moving mean."""
    speed = moving_mean(rec["plant.speed_rpm"], rec.rate_Hz, FILTER_S)
    torque = moving_mean(rec["plant.torque_Nm"], rec.rate_Hz, FILTER_S)
    found = step_response(rec.time_s, speed, step_s, step.target_rpm, BAND_RPM)
    return {
        "settling_ms": 1e3 * found.settling_s,
        "overshoot_pct": 100 * found.overshoot / RATED_RPM,
        "deviation_pct": 100 * found.deviation / RATED_RPM,
        "torque_max_Nm": float(torque.max()),
    }


def _record(job: Job, scheme: str, step: Step, step_s: float) -> Recording:
    return transient(
        point(scheme, step.speed_rpm, step.load_Nm),
        [(step_s, step.name, step.value)],
        DURATION_S,
        job.progress,
        samples_per_period=1,
    )


def _equal(rows: dict[str, dict], key: str) -> float:
    """The largest distance of a scheme's figure from the mean of all schemes."""
    values = [row[key] for row in rows.values()]
    return max(abs(value - np.mean(values)) for value in values)


def _verdicts(rows: dict[str, dict], extreme: str) -> list[Verdict]:
    spread = 100 * _equal(rows, "settling_ms") / np.mean([r["settling_ms"] for r in rows.values()])
    distance = _equal(rows, f"{extreme}_pct")
    return [
        claim("settling time, furthest from the schemes' mean, %", spread < 5, spread,
              "the same dynamics", required=True),
        claim(f"{extreme}, furthest from the schemes' mean, % of 2500 r/min", distance < 5,
              distance, "the same dynamics", required=True),
    ] + [
        not_printed(f"{scheme.upper()}: {label}", row[key], unit)
        for scheme, row in rows.items()
        for label, key, unit in (
            ("settling time", "settling_ms", "ms"), (extreme, f"{extreme}_pct", "%"),
        )
    ]  # fmt: skip


def _draw(shown: dict[str, Recording], step: Step) -> Callable[[Path], Path]:
    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(2, 3, 5.6, sharex=True, sharey="row")
        for (upper, lower), (scheme, rec) in zip(axes.T, shown.items()):
            t_s = rec.time_s
            upper.plot(*plots.thin(t_s, rec["plant.torque_Nm"]), color=COLOUR[scheme],
                       linewidth=0.7, label="torque")  # fmt: skip
            upper.plot(t_s, rec["torque_ref_Nm"], color=plots.INK, linewidth=0.9,
                       label="reference")  # fmt: skip
            lower.plot(t_s, rec["plant.speed_rpm"], color=COLOUR[scheme], linewidth=1.2)
            lower.axhline(step.target_rpm, color=plots.INK, linewidth=0.9, linestyle="--")
            upper.set_title(scheme.upper(), **plots.TITLE)
            lower.set_xlabel("time [s]", **plots.LABEL)
        axes[0, 0].set_ylabel("torque [N m]", **plots.LABEL)
        axes[1, 0].set_ylabel("speed [r/min]", **plots.LABEL)
        axes[0, 0].set_xlim(0, DURATION_S)
        place = "upper right" if step.name == "speed_ref_rpm" else "lower right"
        axes[0, -1].legend(loc=place, **plots.LEGEND)
        figure.align_ylabels(axes[:, 0])
        return plots.save(figure, path)

    return draw


def _figure(job: Job, step: Step, extreme: str, caption: str) -> Figure:
    steps = STEPS_S[:QUICK_STEPS] if job.quick else STEPS_S
    cases = [(scheme, step_s) for scheme in SCHEMES for step_s in steps]
    found = job.each(lambda case: _record(job, case[0], step, case[1]), cases)
    rows: dict[str, dict] = {}
    for scheme in SCHEMES:
        rows[scheme] = mean(
            [response(rec, step, at) for (own, at), rec in zip(cases, found) if own == scheme]
        )
    shown = {s: excerpt(found[cases.index((s, steps[0]))], CHANNELS) for s in SCHEMES}
    return Figure(
        metrics=rows,
        verdicts=_verdicts(rows, extreme),
        draw=_draw(shown, step),
        recordings=shown,
        setups=[point(scheme).setup for scheme in SCHEMES],
        caption=f"{caption} {DEFINITION}",
    )


def b17(job: Job) -> Figure:
    """Speed reference stepped from 1000 to 2000 r/min."""
    return _figure(
        job, SPEED_STEP, "overshoot",
        "The load is not printed. Here it is 0.3 N m at 1000 r/min, as in Fig. 18.",
    )  # fmt: skip


def b18(job: Job) -> Figure:
    """Load stepped from 0.3 to 2 N m at 2000 r/min."""
    return _figure(
        job, LOAD_STEP, "deviation",
        "The torque of the simulated brake changes at once. That of a real brake changes with the "
        "time constant of its coil.",
    )  # fmt: skip
