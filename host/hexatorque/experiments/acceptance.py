"""The acceptance run of a simulated drive: start, speeds and loads one after the other, stop. A
set-up whose drive passes it can be worked with."""

from __future__ import annotations

from collections.abc import Sequence

from ..drive.simulated import SimulatedDrive
from ..setups import Setup, parameters
from ..setups.design import SPEED_HELD, Design
from .operating_points import NotReached, Point, waits

#: Allowed deviation of the speed at the lowest speeds, share of the reference.
TOLERANCE_SLOW = 1 / 3
#: The speed is looked at this often, and must be near for this many looks.
LOOK_S = 0.05
LOOKS = 4

#: Speeds and loads, shares of the rated ones.
Course = Sequence[tuple[float, float]]
#: Rated speed, rated torque, the same in reverse, standstill.
ROUND: Course = ((1, 0), (1, 1), (1, 0), (-1, 0), (-1, -1), (-1, 0), (0, 0))


def whole(fast_load: float, fast_speed: float = 1.5) -> Course:
    """3, 30 and 100 % of rated speed and this one, in shares of it; the rated torque with both
    signs, at the highest speed this share of it; the load drops; the speed reverses from the
    highest speed and under load."""
    slow = ((0.03, 0), (0.03, 1), (0.03, -1), (0.3, -1), (0.3, 1), (0.3, 0))
    rated = ((1, 0), (1, 1), (1, 0), (1, -1), (1, 0))
    top = fast_speed
    fast = ((top, 0), (top, fast_load), (top, 0), (-top, 0), (-1, 0))
    return (*slow, *rated, *fast, (-1, -1), (-0.3, -1), (0.3, -1), (0.3, 0), (0, 0))


def accept(
    setup: Setup, course: Course = ROUND, rated: tuple[float, float] | None = None
) -> SimulatedDrive:
    """The drive after the run. Raises DriveFault if it trips and NotReached if it misses
    its course: at a speed that is held the machine carries the load; NotReached, too, if its gates
    got a destructive command. rated: speed in r/min and torque in N m; default: those that follow
    from the set-up (`Design`)."""
    values = parameters(setup)
    design = Design(setup, values.__getitem__)
    speed_rpm, load_Nm = rated or (design.rated_rpm, design.rated_Nm)
    longest_s = waits(Point(setup, 2 * speed_rpm, load_Nm)).reach_s
    sim = SimulatedDrive(setup.changed(load__kind="constant"), 1)
    sim.start()
    sim.run(float(values["calibration_s"]) + float(values["build_s"]) + LOOK_S, record=False)
    sim.check()
    for share, load_share in course:
        sim.set("speed_ref_rpm", share * speed_rpm)
        sim.set("load_Nm", load_share * load_Nm)
        within = min(SPEED_HELD, TOLERANCE_SLOW * abs(share)) if share else SPEED_HELD
        _settle(sim, share * speed_rpm, within * speed_rpm, longest_s)
    sim.stop()
    if sim.gate_mistake:
        raise NotReached(sim.gate_mistake)
    return sim


def _settle(sim: SimulatedDrive, wanted_rpm: float, within_rpm: float, longest_s: float) -> None:
    """Run until the speed has been near the wanted one for some looks."""
    looks, waited_s = 0, 0.0
    while looks < LOOKS:
        if waited_s > longest_s:
            raise NotReached(
                f"{sim.speed_rpm:.0f} r/min under {sim.load_Nm:.4g} N m after {waited_s:.3g} s, "
                f"asked for {wanted_rpm:.0f}"
            )
        sim.run(LOOK_S, record=False)
        sim.check()
        waited_s += LOOK_S
        looks = looks + 1 if abs(sim.speed_rpm - wanted_rpm) <= within_rpm else 0
