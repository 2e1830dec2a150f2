"""The simulation follows a recording: its drive gets the torque reference that the bench's drive
had, its shaft turns as the bench's shaft did, its dc link has the voltage that the bench measured.
The flux reference follows from the parameters, in the simulation as on the bench.

The speed loop stays open. Closed, it would hide the error: a wrong inertia or load would
only be another torque reference. With the bench's reference and speed, an error of the set-up
shows in currents, flux, slip, the adapted resistances and the torque at the shaft.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from ..drive.simulated import SimulatedDrive
from ..experiments.prepare import Prepare
from ..setups import Setup
from .bench import Bench

#: Before a recording that begins in the middle: to the first speed and torque in this time, and
#: then so long for the adaptation, which meanwhile is faster by a factor.
APPROACH_S, SETTLE_S, FASTER = 0.2, 0.5, 5.0
#: The last part of it with the adaptation as it is.
REST_S = 0.1
#: Share of a wrong torque, and of a wrong angle, that is corrected in each period of the slow loop.
CORRECTED = 0.1
#: Instants in a fast period of which the mean stands beside that of an oscilloscope.
PER_PERIOD = 8
#: Repetitions begin up to so many fast periods later, so that their ripple is another one.
LATEST = 5
#: A held shaft is put back after so many fast periods, if it has moved.
HELD_PERIODS, HELD_RAD = 2, 1e-5
#: The numbers of repetitions are so far apart. Each has the shaft at another angle, within what the
#: measured speed leaves open.
LATER = 3


class Replay:
    """channels: the firmware's in each fast period; row: those of the bench's samples, if they were
    taken as early in the period of the slow loop as they can have been; torque_Nm: true torque,
    mean of each period of the slow loop."""

    def __init__(
        self, channels: dict[str, np.ndarray], row: np.ndarray, torque_Nm: np.ndarray
    ) -> None:
        self.channels, self.row = channels, row
        self.torque_Nm = torque_Nm

    def samples(self, place: int) -> dict[str, np.ndarray]:
        """The channels at the bench's samples. place: fast periods by which these are later."""
        row = self.row + place
        return {name: data[np.clip(row, 0, len(data) - 1)] for name, data in self.channels.items()}


def replay(
    bench: Bench,
    setup: Setup,
    prepare: Prepare | None = None,
    vdc_share: float = 1.0,
    late: int = 0,
    more_Nm: float = 0.0,
) -> Replay:
    """late: a number, other for each repetition, so that the ripple is another one.
    more_Nm: torque to add to the reference. vdc_share: true dc-link voltage over the measured one.
    DriveFault if the simulated drive trips.
    """
    if more_Nm:
        bench = replace(bench, torque_ref_Nm=bench.torque_ref_Nm + more_Nm)
    most_Nm = 1.05 * float(np.max(np.abs(bench.torque_ref_Nm)))
    at_work = setup.changed(
        load__kind="constant",
        controller__control_mode="torque",
        controller__speed_ref_rpm=0.0,
        controller__torque_ref_Nm=0.0,
        controller__torque_limit_Nm=max(most_Nm, float(setup.parameter("torque_limit_Nm"))),
    )
    per = PER_PERIOD if bench.outside else 1
    sim = SimulatedDrive(at_work, per)
    follower = _Follower(sim, bench.slow_s, vdc_share, closed=not bench.torque_known)
    if prepare:
        prepare(sim)
    _approach(follower, bench, late)
    sim.discard()
    # Where the shaft should be at the end of each period. Of the bench only the speeds are known.
    angle_rad = sim.plant_state[7] + (0, 1, -1)[late // LATER % 3] * _unknown_rad(bench)
    for k in range(bench.periods):
        begin, end = bench.omega_rad_s[k : k + 2]
        if not bench.outside:  # the slow interrupt measures the angle that has passed
            more = CORRECTED * (angle_rad - sim.plant_state[7]) / bench.slow_s
            begin, end = begin + more, end + more
            angle_rad += bench.mean_rad_s[k] * bench.slow_s
        follower.step(bench.torque_ref_Nm[k], bench.vdc_V[k], begin, end)
    sim.check()
    rec = sim.take()
    if bench.outside:  # the machine's own values, not the sensors'
        plant = {n: rec[f"plant.{n}"] for n in bench.samples if f"plant.{n}" in rec}
        channels = {n: np.reshape(d, (-1, per)).mean(axis=1) for n, d in plant.items()}
    else:
        channels = {n: rec[n] for n in bench.samples if n in rec}
    torque = np.asarray(rec["plant.torque_Nm"], float).reshape(bench.periods, -1).mean(axis=1)
    return Replay(channels, bench.row, torque)


class _Follower:
    """A simulated drive in torque mode whose shaft follows a given speed. closed: the given
    torque is that of the shaft, and the reference makes the machine produce it."""

    def __init__(self, sim: SimulatedDrive, slow_s: float, vdc_share: float, closed: bool) -> None:
        self.sim, self.slow_s, self.vdc_share = sim, slow_s, vdc_share
        self.inertia_kgm2 = sim.setup["machine.inertia_kgm2"]
        self.viscous_Nms = sim.setup["machine.viscous_Nms"]
        self.closed, self.more_Nm = closed, 0.0

    def step(self, torque_Nm: float, vdc_V: float, begin_rad_s: float, end_rad_s: float) -> None:
        """One period of the slow loop. Its load lets the shaft reach `end_rad_s`. The next period
        corrects the error of its torque."""
        if self.closed:
            off_rad_s = self.sim.plant_state[6] - begin_rad_s
            self.more_Nm -= CORRECTED * self.inertia_kgm2 * off_rad_s / self.slow_s
        most_Nm = float(self.sim.get("torque_limit_Nm"))
        reference_Nm = min(max(float(torque_Nm) + self.more_Nm, -most_Nm), most_Nm)
        self.sim.set("torque_ref_Nm", reference_Nm)
        self.sim.vdc_V = self.vdc_share * float(vdc_V)
        needed = self.inertia_kgm2 * (end_rad_s - begin_rad_s) / self.slow_s
        self.sim.load_Nm = float(torque_Nm - needed - self.viscous_Nms * begin_rad_s)
        self.sim.plant_state[6] = begin_rad_s
        self.sim.run(self.slow_s)


def _unknown_rad(bench: Bench) -> float:
    """How far the shaft's angle is not known: within a period the speed is a mean, and where it
    begins to change a straight line is off by an eighth of the change."""
    return float(np.max(np.abs(np.diff(bench.mean_rad_s)), initial=0.0)) * bench.slow_s / 8


def _first(first: int, slow: int) -> int:
    """So that no repetition has another slow period between the drive's first and this one."""
    return min(first, slow - LATEST - 1)


def _held(sim: SimulatedDrive, periods: int) -> None:
    """Run so many fast periods with a shaft that does not move: the torque of an alignment would
    swing it, and the drive would wait for its rest for a time that nobody knows before."""
    for begin in range(0, periods, HELD_PERIODS):
        sim.run(min(HELD_PERIODS, periods - begin) * sim.period_s, record=False)
        if abs(sim.plant_state[7]) > HELD_RAD:
            sim.plant_state[6:8] = 0.0


def _approach(follower: _Follower, bench: Bench, late: int) -> None:
    """From standstill to the state in which the recording begins."""
    sim, slow_s = follower.sim, follower.slow_s
    sim.vdc_V = follower.vdc_share * float(bench.vdc_V[0])
    # The drive runs from this period on, and the first slow one is as late after it as the bench's.
    slow = round(slow_s / sim.period_s)
    begun = sum(round(float(sim.get(key)) / sim.period_s) for key in ("calibration_s", "build_s"))
    first = begun + (_first(bench.first, slow) if bench.begins else slow)
    first += late % LATEST
    sim.run(-first % slow * sim.period_s, record=False)
    sim.start()
    _held(sim, first)
    sim.check()
    if bench.begins:
        return
    torque, vdc = bench.torque_ref_Nm[0], bench.vdc_V[0]
    speed = bench.omega_rad_s[0]
    ramp = np.linspace(0.0, 1.0, max(2, round(APPROACH_S / slow_s)) + 1)
    for share, after in itertools.pairwise(ramp):
        follower.step(share * torque, vdc, share * speed, after * speed)
    adapt_s = float(sim.get("adapt_s"))
    sim.set("adapt_s", adapt_s / FASTER)
    for _ in range(round(SETTLE_S / slow_s) + late):
        follower.step(torque, vdc, speed, speed)
    sim.set("adapt_s", adapt_s)
    for _ in range(round(REST_S / slow_s)):
        follower.step(torque, vdc, speed, speed)
    sim.check()
