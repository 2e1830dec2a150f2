"""Operating points: bring a simulated drive to a steady state and measure it.

The sequence is always the same: start the drive (offset calibration, flux build-up), set
the speed reference, apply the load when the speed is reached, let the drive settle, measure.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from .. import firmware
from ..analysis.metrics import TD_SAMPLES, UNITS, metrics
from ..analysis.run import Run
from ..drive.interface import Progress
from ..drive.simulated import DriveFault, SimulatedDrive
from ..errors import HexatorqueError
from ..firmware import FirmwareError
from ..laws.law import Law
from ..parallel import each
from ..recording.recording import Recording
from ..setups import Setup, SetupError, parameters, to_parameters
from .prepare import Prepare, magnetise

#: Shortest values of `Waits`, for a machine of little inertia.
REACH_S = 4.0
SETTLE_S = 2.0
RECOVER_S = 10.0
#: No wait is longer than this: the torque limit is then too small for the inertia.
LONGEST_S = 300.0
#: The measurement lasts at least this long and this many fundamental cycles.
WINDOW_S = 0.5
CYCLES = 10
#: Most edges of the six legs in a period: start level, two toggles and a change of the registers,
#: each with the dead time between off and on.
MOST_EDGES = 6 * 4 * 2


class NotReached(HexatorqueError, RuntimeError):
    """The drive did not reach the commanded speed."""


#: Errors of a point that cannot be measured.
NOT_MEASURED = (DriveFault, NotReached, ArithmeticError, ValueError)


@dataclass(frozen=True)
class Point:
    """One operating point of one set-up. If the load drives the machine (generating), its sign
    is opposite to the sign of the speed. law: in place of the set-up's scheme."""

    setup: Setup
    speed_rpm: float
    load_Nm: float
    law: Law | None = None

    @property
    def scheme(self) -> str:
        """Name of the scheme, or of the law in its place."""
        return self.law.label if self.law else str(self.setup["controller.scheme"])

    @property
    def simulated_s(self) -> float:
        """Roughly the simulated time that the measurement takes, for progress bars."""
        return 0.5 + waits(self).settle_s + WINDOW_S + 0.5


@dataclass(frozen=True)
class Waits:
    """How long a drive may take. reach_s: longest wait for the speed to come near its reference;
    settle_s: between the load step and the measurement; recover_s: longest wait for the speed to
    recover under load if the speed loop is slow."""

    reach_s: float
    settle_s: float
    recover_s: float


def waits(point: Point) -> Waits:
    """The times grow with the inertia. A run-up at the torque limit takes J w / T, and a drive may
    have a third of that torque left after friction and field weakening. The speed loop answers
    with the time constant J / k_p."""
    values = parameters(point.setup)
    inertia_kgm2 = point.setup["machine.inertia_kgm2"]
    limit_Nm, gain = float(values["torque_limit_Nm"]), float(values["kp_speed_Nms_rad"])
    run_up_s = inertia_kgm2 * abs(point.speed_rpm) * math.pi / 30 / limit_Nm
    loop_s = inertia_kgm2 / gain if gain > 0 else 0.0
    return Waits(
        min(LONGEST_S, max(REACH_S, 3 * run_up_s + 10 * loop_s)),
        min(LONGEST_S, max(SETTLE_S, 10 * loop_s)),
        min(LONGEST_S, max(RECOVER_S, 50 * loop_s)),
    )


def _at_load_speed(point: Point) -> Setup:
    """The set-up, changed so that a load that depends on speed takes the stated torque at this
    point's speed."""
    return point.setup.changed(load__at_rpm=max(1.0, abs(point.speed_rpm)))


def approach(
    point: Point,
    progress: Progress | None = None,
    samples_per_period: int = 4,
    prepare: Prepare | None = None,
) -> SimulatedDrive:
    """A drive that runs at the point and has settled. Raises DriveFault or NotReached."""
    controller = point.law or firmware.Controller
    sim = SimulatedDrive(_at_load_speed(point), samples_per_period, controller)
    if prepare:
        prepare(sim)
    magnetise(sim, progress=progress)
    sim.check()
    sim.set("speed_ref_rpm", point.speed_rpm)
    slack_rpm = max(2.0, 0.02 * abs(point.speed_rpm))
    longest = waits(point)
    waited = 0.0
    while abs(sim.speed_rpm - point.speed_rpm) > slack_rpm:
        if waited >= longest.reach_s:
            raise NotReached(
                f"{sim.speed_rpm:.0f} r/min after {waited:.3g} s, asked for {point.speed_rpm:g}"
            )
        sim.run(0.1, record=False, progress=progress)
        sim.check()
        waited += 0.1
    # This is the torque at the shaft, with its sign. A load that depends on speed follows the
    # sign of the speed by itself. A constant load gets the sign here.
    constant = point.setup["load.kind"] == "constant"
    sim.set("load_Nm", point.load_Nm * (-1 if constant and point.speed_rpm < 0 else 1))
    sim.run(longest.settle_s, record=False, progress=progress)
    waited = 0.0
    while abs(sim.speed_rpm - point.speed_rpm) > slack_rpm and waited < longest.recover_s:
        sim.run(0.5, record=False, progress=progress)
        waited += 0.5
    sim.check()
    return sim


def measure(
    point: Point,
    progress: Progress | None = None,
    samples_per_period: int = 4,
    prepare: Prepare | None = None,
    names: Collection[str] = tuple(UNITS),
) -> Run:
    """Steady-state metrics and recording of one point. names: of the metrics that are needed.
    Raises DriveFault or NotReached."""
    sim = approach(point, progress, samples_per_period, prepare)
    omega = abs(sim.controller.channel("omega_sync_rad_s"))
    cycles_s = CYCLES * 6.2832 / omega if omega > 1.0 else WINDOW_S
    window_s = min(max(WINDOW_S, cycles_s), 10.0)
    sim.wall_s = 0.0
    sim.log_edges(round(window_s / sim.period_s) * MOST_EDGES)
    start, begin = sim.inverter.leg.copy(), sim.periods
    sim.run(window_s, progress=progress)
    sim.check()
    speed = window_s / sim.wall_s
    recording = sim.take()
    values = metrics(recording, edges=sim.edges_since(begin, start), names=names)
    if abs(values["speed_rpm"] - point.speed_rpm) > max(2.0, 0.02 * abs(point.speed_rpm)):
        raise NotReached(
            f"{values['speed_rpm']:.1f} r/min under {point.load_Nm:g} N m, "
            f"asked for {point.speed_rpm:g}"
        )
    return Run(
        setup=point.setup.name,
        scheme=point.scheme,
        latency=point.setup["timing.latency"],
        speed_ref_rpm=point.speed_rpm,
        load_Nm=point.load_Nm,
        recording=recording,
        metrics=values,
        realtime_factor=speed,
    )


def transient(
    point: Point,
    events: Iterable[tuple[float, str, object]],
    duration_s: float,
    progress: Progress | None = None,
    samples_per_period: int = 4,
) -> Recording:
    """Record the response of a drive that has settled at `point` to `events`: (time, name,
    value), where the name is a controller parameter, `load_Nm` or `vdc_V`. Time 0 is the
    beginning of the recording. Raises DriveFault or NotReached."""
    sim = approach(point, progress, samples_per_period)
    return follow(sim, events, duration_s, progress)


def follow(
    sim: SimulatedDrive,
    events: Iterable[tuple[float, str, object]],
    duration_s: float,
    progress: Progress | None = None,
) -> Recording:
    """Like `transient`, but from the present state of the drive."""
    begin = sim.time_s
    for time_s, name, value in sorted(events, key=lambda event: event[0]):
        sim.run(max(0.0, begin + time_s - sim.time_s), progress=progress)
        sim.set(name, value)
    sim.run(max(0.0, begin + duration_s - sim.time_s), progress=progress)
    sim.check()
    recording = sim.take()
    recording.start_s = 0.0
    return recording


def fine_samples(setup: Setup) -> int:
    """Samples a period with which the torque between the control instants is seen: the smallest
    divisor of the period's counts from TD_SAMPLES on."""
    values = to_parameters.parameters(setup)
    counts = firmware.Controller(setup["timing.device"], values).period_counts
    return next(n for n in range(TD_SAMPLES, counts + 1) if counts % n == 0)


def measure_all(
    points: Iterable[Point], progress: Progress | None = None, fine: bool = False
) -> list[Run | Exception]:
    """Measure all points, with 4 samples a period or with `fine_samples`, in parallel on all
    cores. If the drive trips at a point or does not reach it, the exception stands in the list
    in place of the run."""

    def one(point: Point) -> Run | Exception:
        try:
            samples = fine_samples(point.setup) if fine else 4
            return measure(point, progress, samples)
        except NOT_MEASURED as error:
            return error

    return each(one, points)


#: Largest relative deviations of speed and true flux at a point that the drive holds.
SPEED_TOLERANCE = 0.02
FLUX_TOLERANCE = 0.03


def hold(
    point: Point, flux_tolerance: float = FLUX_TOLERANCE, progress: Progress | None = None
) -> None:
    """Nothing if the drive holds the point, else an error that says what is off: NotReached, or
    DriveFault if it tripped.

    Field weakening is off. The speed must be within 2 % of its reference, and the true mean
    flux within 3 % of what the drive asks for: with magnets each torque has its own.
    """
    run = measure(point, progress)
    m = run.metrics
    speed_error = abs(m["speed_rpm"] / point.speed_rpm - 1)
    if speed_error > SPEED_TOLERANCE:
        raise NotReached(f"speed {m['speed_rpm']:.1f} r/min")
    flux_ref = float(np.mean(run.recording["flux_ref_Wb"]))
    if abs(m["flux_Wb"] / flux_ref - 1) > flux_tolerance:
        raise NotReached(f"flux {m['flux_Wb']:.4f} Wb, reference {flux_ref:g}")


def holds(
    point: Point, flux_tolerance: float = FLUX_TOLERANCE, progress: Progress | None = None
) -> str | None:
    """None if the drive holds the point, else a text that names what is off (`hold`)."""
    try:
        hold(point, flux_tolerance, progress)
    except NOT_MEASURED as error:
        return str(error)
    return None


#: The outcomes of a search for the highest speed.
HELD = "held"  #: `rpm` is the highest speed that the drive holds
NONE = "none"  #: the drive runs but holds the load at no speed: `rpm` is 0
TRIPPED = "tripped"  #: it tripped at every speed that was tried
NOT_CONFIGURED = "not configured"  #: the set-up is refused, no drive has run


@dataclass(frozen=True)
class Reach:
    """The highest speed of a drive. outcome: one of the words above; rpm: None if the drive
    tripped or could not be configured; reason: why not more, from the lowest speed that it did
    not hold."""

    outcome: str
    rpm: float | None
    reason: str = ""

    def as_json(self) -> dict:
        return {"outcome": self.outcome, "rpm": self.rpm, "reason": self.reason}


def reach(
    setup: Setup, load_Nm: float, resolution: float = 0.01, progress: Progress | None = None
) -> Reach:
    """Highest speed at which the motoring drive holds `load_Nm` at its full flux reference,
    without field weakening. Found by bisection to a relative error of `resolution`."""
    full_flux = setup.changed(controller__field_weakening="off")
    try:
        SimulatedDrive(full_flux, 1)
    except (FirmwareError, SetupError) as error:
        return Reach(NOT_CONFIGURED, None, str(error))
    limit_Nm = full_flux.parameter("torque_limit_Nm")
    if abs(load_Nm) > limit_Nm:
        return Reach(NONE, 0.0, f"load {load_Nm:g} N m: above torque_limit_Nm = {limit_Nm:g} N m")
    # The bisection starts from the speed at which 12-step operation would end.
    least_Wb = min(setup.parameter("flux_ref_Wb"), setup.parameter("psi_f_Wb") or math.inf)
    ceiling = setup["inverter.vdc_V"] * 0.6366 / least_Wb
    high = ceiling * 9.5493 / setup["machine.pole_pairs"]
    low = 0.0
    floor = 0.01 * high
    latest: Exception | None = None
    while high - low > resolution * high and high > floor:
        middle = 0.5 * (low + high)
        try:
            hold(Point(full_flux, middle, load_Nm), progress=progress)
        except NOT_MEASURED as error:
            high, latest = middle, error
        else:
            low = middle
    reason = f"at {high:.0f} r/min: {latest}" if latest else ""
    if low > 0:
        return Reach(HELD, low, reason)
    if isinstance(latest, DriveFault):
        return Reach(TRIPPED, None, reason)
    return Reach(NONE, 0.0, reason)


def reach_all(
    setups: Iterable[Setup], load_Nm: float, progress: Progress | None = None
) -> list[Reach]:
    """`reach` of several set-ups, in parallel on all cores."""
    return each(lambda s: reach(s, load_Nm, progress=progress), setups)
