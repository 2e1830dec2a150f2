"""Which further recording would tell apart what one recording does not: the simulation makes it
with one explanation, and follows it with that one and with each of the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..drive.interface import DriveFault
from ..drive.simulated import SimulatedDrive
from ..errors import HexatorqueError
from ..recording.recording import Recording
from ..setups import Setup
from . import bench
from .candidates import Candidate

#: What is proposed: shares of rated speed and torque, one part after the other.
COURSES = {
    "without load at 25 and 80 % of rated speed": ((0.25, 0.0), (0.8, 0.0)),
    "at 25 % of rated speed under half of rated torque of both signs": ((0.25, 0.5), (0.25, -0.5)),
    "at 80 % of rated speed under half of rated torque of both signs": ((0.8, 0.5), (0.8, -0.5)),
    "at 10 and 80 % of rated speed under 90 % of rated torque": ((0.1, 0.9), (0.8, 0.9)),
}
PART_S, RATE_HZ = 0.5, 1000.0

Changes = Sequence[tuple[Candidate, float]]
Load = tuple[tuple[float, float], ...]
#: (recording, load, changes of each explanation) -> the quantities that each has, in noises.
Follow = Callable[[bench.Bench, Load, Sequence[Changes]], list[np.ndarray]]


def proposed(setup: Setup, explanations: Sequence[Changes], follow: Follow) -> tuple[str, float]:
    """The course that tells the first explanation best from the most similar other one, and by how
    many standard deviations. An empty text if no course does."""
    best, most = "", 0.0
    for text, course in COURSES.items():
        try:
            recording, loads = _recorded(setup, explanations[0], course)
            seen = bench.make(recording, text, setup)
            own, again, *others = follow(seen, loads, [explanations[0], *explanations])
        except (HexatorqueError, DriveFault, ArithmeticError):
            continue  # the drive trips there
        noise = float(np.square(again - own).sum())
        apart = min(float(np.square(other - own).sum()) - noise for other in others)
        if apart > most:
            best, most = text, apart
    return best, float(np.sqrt(most))


def _recorded(
    setup: Setup, changes: Changes, course: Sequence[tuple[float, float]]
) -> tuple[Recording, Load]:
    wrong = setup
    for candidate, change in changes:
        wrong = candidate.apply(wrong, change)
    drive = SimulatedDrive(wrong, 1)
    for candidate, change in changes:
        if candidate.prepare:
            candidate.prepare(change)(drive)
    drive.run(0.003)
    drive.start()
    drive.run(float(drive.get("calibration_s")) + float(drive.get("build_s")) + 0.01)
    loads = [(float("-inf"), 0.0)]
    for speed, load in course:
        load_Nm = load * setup["rated.torque_Nm"]
        loads.append((drive.time_s, load_Nm))
        speed_rpm = speed * setup["rated.speed_rpm"]
        drive.set_many({"load_Nm": load_Nm, "speed_ref_rpm": speed_rpm})
        drive.run(PART_S)
    drive.check()
    rec, every = drive.take(), max(1, round(1 / drive.period_s / RATE_HZ))
    own = {n: data[::every] for n, data in rec.channels.items() if not n.startswith("plant.")}
    values: Mapping[str, object] = {name: drive.get(name) for name in drive.params}
    meta = {"scheme": values["scheme"], "parameters": {"controller": dict(values)}}
    return Recording(1 / drive.period_s / every, own, rec.units, meta), tuple(loads)
