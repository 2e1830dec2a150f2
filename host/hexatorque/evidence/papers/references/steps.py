"""Torque step, reversal of the speed, and a sag of the dc link, each method at its own setting.

The torque steps are made on the bench, at the speed of the machine's last point, between a fifth of
its torque and all of it. Reversal and sag are made in speed mode with the machine's own inertia.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ....drive.operating_points import NOT_MEASURED, Point, approach, follow
from ....firmware import FirmwareError
from ....setups import Setup, SetupError
from ...studies.dynamics import SAG_S, SAG_SHARE, STEP_AT_S, rises, speed_response
from ..engine.job import Job
from ..fsw import bench
from .methods import Method, controller
from .places import Machine

#: Steps each way, and the time between them. It is no multiple of the speed loop's period, and the
#: flux stands elsewhere at each step.
STEPS, QUICK_STEPS, APART_S = 10, 3, 0.023
LOW_SHARE = 0.2
#: Recorded of a reversal and of a sag.
REVERSAL_S, SAG_RECORDED_S = 2.5, 0.6


def _torque_steps(
    method: Method, machine: Machine, row: Mapping[str, Any], job: Job
) -> dict[str, float]:
    base, place = machine.base, machine.place
    setup = bench.bench_setup(
        base, method.scheme, controller(method, row), base.parameter("build_s")
    )
    low_Nm, high_Nm = LOW_SHARE * place.torque_Nm, place.torque_Nm
    middle = replace(place, torque_Nm=(low_Nm + high_Nm) / 2)
    sim = bench.approach(setup, middle, job.progress, method.law(base, row))
    sim.set("torque_ref_Nm", low_Nm)
    sim.run(APART_S, record=False)
    sim.plant_state[6] = place.speed_rpm * math.pi / 30
    levels = (high_Nm, low_Nm) * (QUICK_STEPS if job.quick else STEPS)
    events = [(n * APART_S, "torque_ref_Nm", level) for n, level in enumerate(levels)]
    # The first step begins within the recording.
    events = [(time_s + APART_S, name, value) for time_s, name, value in events]
    return rises(follow(sim, events, (len(levels) + 1) * APART_S, job.progress))


def _in_speed_mode(method: Method, machine: Machine, row: Mapping[str, Any]) -> Setup:
    values = {f"controller__{name}": value for name, value in controller(method, row).items()}
    return machine.base.changed(
        controller__scheme=method.scheme,
        timing__latency="predicted",
        load__kind="constant",
        **values,
    )


def _reversal(
    method: Method, machine: Machine, row: Mapping[str, Any], job: Job
) -> dict[str, float]:
    setup, speed = _in_speed_mode(method, machine, row), machine.place.speed_rpm
    sim = approach(Point(setup, speed, 0.0, method.law(machine.base, row)), job.progress)
    events = [(STEP_AT_S, "speed_ref_rpm", -speed)]
    return speed_response(follow(sim, events, REVERSAL_S, job.progress), -speed)


def _sag(method: Method, machine: Machine, row: Mapping[str, Any], job: Job) -> dict[str, float]:
    setup, place = _in_speed_mode(method, machine, row), machine.place
    law = method.law(machine.base, row)
    sim = approach(Point(setup, place.speed_rpm, place.torque_Nm, law), job.progress)
    events = [(STEP_AT_S, "vdc_V", SAG_SHARE * sim.vdc_V), (STEP_AT_S + SAG_S, "vdc_V", sim.vdc_V)]
    return speed_response(follow(sim, events, SAG_RECORDED_S, job.progress), place.speed_rpm)


TESTS = {"torque step": _torque_steps, "reversal": _reversal, "sag": _sag}


def run(
    test: str, method: Method, machine: Machine, row: Mapping[str, Any], job: Job
) -> dict[str, Any]:
    """The figures of a test; `lost`: why there are none."""
    try:
        found = TESTS[test](method, machine, row, job)
    except (*NOT_MEASURED, SetupError, FirmwareError) as reason:
        return {"lost": str(reason)}
    if not all(math.isfinite(value) for value in found.values()):
        return {"lost": "it does not come to the end of the step"}
    return found
