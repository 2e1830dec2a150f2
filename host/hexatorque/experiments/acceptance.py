"""The acceptance run of a simulated drive: start, rated speed, rated torque, the same in reverse,
standstill, stop. A set-up whose drive passes it can be worked with."""

from __future__ import annotations

from ..drive.simulated import SimulatedDrive
from ..setups import Setup, parameters
from ..setups.design import Design
from .operating_points import NotReached, Point, waits

#: Allowed deviation of the speed, share of rated speed.
TOLERANCE = 0.02
#: The speed is looked at this often, and must be near for this many looks.
LOOK_S = 0.05
LOOKS = 4


def accept(setup: Setup) -> SimulatedDrive:
    """The drive after the run. Raises DriveFault if it trips and NotReached if it does not get
    where it should. Without rated values in the set-up the run takes those that follow from it
    (`Design`)."""
    values = parameters(setup)
    design = Design(setup, values.__getitem__)
    speed_rpm, load_Nm = design.rated_rpm, design.rated_Nm
    longest_s = waits(Point(setup, 2 * speed_rpm, load_Nm)).reach_s
    sim = SimulatedDrive(setup.changed(load__kind="constant"), 1)
    sim.start()
    sim.run(float(values["calibration_s"]) + float(values["build_s"]) + LOOK_S, record=False)
    sim.check()
    for share, load_share in ((1, 0), (1, 1), (1, 0), (-1, 0), (-1, -1), (-1, 0), (0, 0)):
        sim.set("speed_ref_rpm", share * speed_rpm)
        sim.set("load_Nm", load_share * load_Nm)
        _settle(sim, share * speed_rpm, TOLERANCE * speed_rpm, longest_s)
    sim.stop()
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
