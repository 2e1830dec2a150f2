"""Torque step, reversal of the speed, load step, sag of the dc link: how fast a drive answers.

Torque steps go back and forth between two torques. Their rise is from 10 to 90 % of the step, in
the true torque. The other tests are made in speed mode with the machine's own inertia.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...analysis.response import moving_mean, step_response
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import Point, Progress, approach, follow
from ...plant.vsd import PHASES
from ...recording.recording import Recording
from ..papers.engine.job import Job
from . import bench
from .methods import Method, controller
from .places import Place
from .search import REFUSED, outcome

#: Steps each way, and the time between them. It is no multiple of the speed loop's period, and the
#: flux stands elsewhere at each step.
STEPS, QUICK_STEPS, APART_S = 10, 3, 0.023
#: A response is looked for from this time before the change of the recorded reference, and until
#: this time after it.
BEFORE_S, AFTER_S = 0.0003, 0.005
STEP_AT_S = 0.1
SAG_SHARE, SAG_S = 0.75, 0.2
#: Means of the speed are taken over this time; it has settled within this share of the reference.
MEAN_S, SETTLED = 0.01, 0.01
#: Recorded of a reversal, a load step and a sag.
REVERSAL_S, LOAD_STEP_S, SAG_RECORDED_S = 2.5, 2.0, 1.5
#: On the bench a torque step begins at this share of the point's torque, and a shorter time is
#: recorded of a sag.
LOW_SHARE, SHORT_SAG_S = 0.2, 0.6


def rise(
    time_s: np.ndarray, torque_Nm: np.ndarray, before: float, after: float
) -> tuple[float, float]:
    """Time from 10 to 90 % of a step, and the overshoot as a share of it. NaN if the torque does
    not come to 90 %."""
    y = (torque_Nm - before) / (after - before)
    arrived = np.nonzero(y >= 0.9)[0]
    if arrived.size == 0 or arrived[0] == 0:
        return float("nan"), float("nan")

    def crossing(n: int, level: float) -> float:
        share = (level - y[n - 1]) / (y[n] - y[n - 1])
        return float(time_s[n - 1] + share * (time_s[n] - time_s[n - 1]))

    end = int(arrived[0])
    low = np.nonzero(y[:end] < 0.1)[0]
    if low.size == 0:
        return float("nan"), float("nan")
    return crossing(end, 0.9) - crossing(int(low[-1]) + 1, 0.1), float(max(0.0, y.max() - 1))


def rises(rec: Recording) -> dict[str, float]:
    """Means over the steps of the torque reference, up and down. A step is from the measured mean
    before it to the measured mean after it: the torque of a table scheme does not keep exactly to
    its reference."""
    reference = np.asarray(rec["torque_ref_Nm"], dtype=float)
    torque_Nm = np.asarray(rec["plant.torque_Nm"], dtype=float)
    found: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for n in np.nonzero(np.diff(reference))[0]:
        since = rec.time_s - rec.time_s[n]
        part = (since > -BEFORE_S) & (since < AFTER_S)
        before = torque_Nm[(since > -AFTER_S) & (since < -BEFORE_S)].mean()
        after = torque_Nm[(since > AFTER_S) & (since < 3 * AFTER_S)].mean()
        made = rise(rec.time_s[part], torque_Nm[part], before, after)
        found[bool(reference[n + 1] > reference[n])].append(made)
    up, down = (np.array(found[way]).mean(axis=0) for way in (True, False))
    return {
        "rise_up_ms": 1e3 * float(up[0]),
        "rise_down_ms": 1e3 * float(down[0]),
        "overshoot_pct": 100 * float(max(up[1], down[1])),
    }


def back_and_forth(
    sim: SimulatedDrive,
    high_Nm: float,
    low_Nm: float,
    progress: Progress | None,
    steps: int = STEPS,
    later: int = 0,
) -> dict[str, float]:
    """The rises of a drive in torque mode. later: the first step begins so many intervals within
    the recording."""
    levels = (high_Nm, low_Nm) * steps
    events = [
        (n * APART_S + later * APART_S, "torque_ref_Nm", level) for n, level in enumerate(levels)
    ]
    return rises(follow(sim, events, (len(levels) + later) * APART_S, progress))


def speed_response(
    at: Point,
    events: list[tuple[float, str, float]],
    recorded_s: float,
    target: float,
    progress: Progress | None = None,
) -> dict[str, float]:
    """How the speed comes to its target, from the point, after the events."""
    rec = follow(approach(at, progress), events, recorded_s, progress)
    speed = moving_mean(rec["plant.speed_rpm"], rec.rate_Hz, MEAN_S)
    found = step_response(rec.time_s, speed, STEP_AT_S, target, SETTLED * abs(target))
    return {
        "settling_ms": 1e3 * found.settling_s,
        "overshoot_rpm": found.overshoot,
        "deviation_rpm": found.deviation,
        "peak_A": max(float(np.abs(rec[f"plant.i_{phase}_A"]).max()) for phase in PHASES),
    }


def reversal(at: Point, progress: Progress | None) -> dict[str, float]:
    """The response to a speed reversal without load."""
    events = [(STEP_AT_S, "speed_ref_rpm", -at.speed_rpm)]
    return speed_response(replace(at, load_Nm=0.0), events, REVERSAL_S, -at.speed_rpm, progress)


def load_step(at: Point, progress: Progress | None) -> dict[str, float]:
    """To the point's load."""
    events = [(STEP_AT_S, "load_Nm", at.load_Nm)]
    return speed_response(replace(at, load_Nm=0.0), events, LOAD_STEP_S, at.speed_rpm, progress)


def sag(
    at: Point, progress: Progress | None, recorded_s: float = SAG_RECORDED_S
) -> dict[str, float]:
    vdc_V = at.setup["inverter.vdc_V"]
    events = [(STEP_AT_S, "vdc_V", SAG_SHARE * vdc_V), (STEP_AT_S + SAG_S, "vdc_V", vdc_V)]
    return speed_response(at, events, recorded_s, at.speed_rpm, progress)


def _on_the_bench(
    method: Method, place: Place, row: Mapping[str, Any], job: Job
) -> dict[str, float]:
    """Torque steps at the point's speed, between a fifth of its torque and all of it."""
    base = place.base
    setup = bench.bench_setup(base, method.scheme, controller(row), base.parameter("build_s"))
    low_Nm, high_Nm = LOW_SHARE * place.torque_Nm, place.torque_Nm
    middle = replace(place, torque_Nm=(low_Nm + high_Nm) / 2)
    sim = bench.approach(setup, middle, job.progress, method.law(base, row))
    sim.set("torque_ref_Nm", low_Nm)
    sim.run(APART_S, record=False)
    sim.plant_state[6] = place.speed_rpm * math.pi / 30
    steps = QUICK_STEPS if job.quick else STEPS
    return back_and_forth(sim, high_Nm, low_Nm, job.progress, steps, later=1)


def _in_speed_mode(method: Method, place: Place, row: Mapping[str, Any]) -> Point:
    base = place.base
    values = {f"controller__{name}": value for name, value in controller(row).items()}
    setup = base.changed(
        controller__scheme=method.scheme,
        timing__latency="predicted",
        load__kind="constant",
        **values,
    )
    return Point(setup, place.speed_rpm, place.torque_Nm, method.law(base, row))


#: Test -> its figures, of a method with the row of a setting.
TESTS = {
    "torque step": _on_the_bench,
    "reversal": lambda *case: reversal(_in_speed_mode(*case[:3]), case[3].progress),
    "sag": lambda *case: sag(_in_speed_mode(*case[:3]), case[3].progress, SHORT_SAG_S),
}


def run(
    test: str, method: Method, place: Place, row: Mapping[str, Any], job: Job
) -> dict[str, Any]:
    """The figures of a test; `lost`: why there are none."""
    found, lost = outcome(lambda: TESTS[test](method, place, row, job), REFUSED)
    if lost:
        return {"lost": lost}
    if not all(math.isfinite(value) for value in found.values()):
        return {"lost": "it does not come to the end of the step"}
    return found
