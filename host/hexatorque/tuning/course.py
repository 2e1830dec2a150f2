"""Drive a set-up through operating points, in one run, and measure each.

The drive starts, and then for each point: the load is taken off, the shaft runs to the speed, the
load steps on, the drive settles, it is measured. All set-ups of a tuning have the same times, those
of the set-up with which it begins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import firmware
from ..analysis.losses import bridge, copper_loss_W
from ..analysis.metrics import torque_ripple_td_Nm
from ..analysis.spectrum import channel, fundamental_Hz, thd_inf_pct
from ..drive.simulated import DriveFault, SimulatedDrive
from ..errors import HexatorqueError
from ..experiments.operating_points import (
    MOST_EDGES,
    SPEED_TOLERANCE,
    NotReached,
    Point,
    Progress,
    fine_samples,
    waits,
)
from ..given import listed, real
from ..plant.vsd import PHASES
from ..setups import Setup, SetupError, parameters
from ..setups.design import REACH_PU, TABLE_SHARE, Design
from ..setups.keys import MOST_RPM
from .aim import Figures

#: The measurement lasts this long, and this many cycles of the fundamental.
WINDOW_S, CYCLES, LONGEST_WINDOW_S = 0.1, 6, 3.0
#: The drive settles for this many times the speed loop's J/k_p.
SETTLE_LOOPS, SETTLE_S = 10, (0.2, 2.0)
#: The speed is looked at this often.
LOOK_S = 0.01
#: It must have been near for this many looks.
LOOKS = 5
#: Digits of the figures.
DIGITS = 9
#: Shares of rated speed and rated torque of the points that are taken if the user names none.
USUAL = ((0.2, 1.0), (0.5, 0.5), (0.9, 1.0))


@dataclass(frozen=True)
class Where:
    """An operating point: speed, and torque at the shaft. Opposite signs: generating."""

    speed_rpm: float
    load_Nm: float

    def __str__(self) -> str:
        return f"{self.speed_rpm:g} r/min, {self.load_Nm:g} N m"


@dataclass(frozen=True)
class Times:
    """How long the drive may take to reach a point's speed, how long it settles, how long it is
    measured."""

    reach_s: float
    settle_s: float
    window_s: float


class Lost(HexatorqueError):
    """The drive does not hold an operating point."""


def usual_points(setup: Setup) -> list[Where]:
    """Low speed at full load, half speed at half load, and nearly full speed at full load."""
    values = parameters(setup)
    design = Design(setup, values.__getitem__)
    row = firmware.lib.ht_scheme_describe(firmware.schemes().index(str(values["scheme"])))
    table = values["scheme"] in firmware.table_schemes()
    reach_pu = row.reach_pu * (TABLE_SHARE[str(values["table"])] if table else 1.0)
    full_rpm = min(design.rated_rpm, design.base_rpm(min(reach_pu, REACH_PU)))
    full_Nm = min(design.rated_Nm, float(values["torque_limit_Nm"]))
    return [Where(_short(s * full_rpm), _short(t * full_Nm)) for s, t in USUAL]


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def read_points(text: str) -> list[Where]:
    """Points from `RPM:NM,RPM:NM`; with a semicolon between them a comma is a decimal comma."""
    points = []
    for part in listed(text):
        try:
            speed_rpm, load_Nm = map(real, part.split(":"))
        except ValueError:
            raise SetupError(f"point {part!r}: RPM:NM is needed, for example 1000:5") from None
        if not (abs(speed_rpm) <= MOST_RPM and math.isfinite(load_Nm)):
            raise SetupError(
                f"point {part!r}: allowed range of the speed is -{MOST_RPM:g} .. {MOST_RPM:g} r/min"
            )
        points.append(Where(speed_rpm, load_Nm))
    if not points:
        raise SetupError("no point is given: RPM:NM,RPM:NM is needed, for example 1000:5,300:5")
    return list(dict.fromkeys(points))


def check_points(setup: Setup, points: Sequence[Where]) -> None:
    """Refuse points that no drive of this set-up can hold."""
    limit_Nm = float(setup.parameter("torque_limit_Nm"))
    trip_rpm = float(setup.parameter("speed_trip_rpm"))
    for point in points:
        if abs(point.load_Nm) > limit_Nm:
            raise SetupError(
                f"point {point}: allowed range of the load is -{limit_Nm:g} .. {limit_Nm:g} N m "
                "(torque_limit_Nm)"
            )
        if abs(point.speed_rpm) >= trip_rpm:
            raise SetupError(
                f"point {point}: allowed range of the speed is -{trip_rpm:g} .. {trip_rpm:g} r/min "
                "(speed_trip_rpm)"
            )


def times(setup: Setup, points: Sequence[Where]) -> list[Times]:
    values = parameters(setup)
    design = Design(setup, values.__getitem__)
    gain = float(values["kp_speed_Nms_rad"])
    loop_s = setup["machine.inertia_kgm2"] / gain if gain > 0 else SETTLE_S[1]
    settle_s = min(max(SETTLE_LOOPS * loop_s, SETTLE_S[0]), SETTLE_S[1])
    plan, speed_rpm = [], 0.0
    for point in points:
        step_rpm = abs(point.speed_rpm - speed_rpm)
        reach_s = waits(Point(setup, step_rpm, point.load_Nm)).reach_s
        slip_rad_s = math.copysign(design.slip_rad_s(point.load_Nm), point.load_Nm)
        along_rad_s = abs(point.speed_rpm) * math.pi / 30 * design.machine.pole_pairs
        f1_Hz = abs(along_rad_s + slip_rad_s) / (2 * math.pi)
        cycles_s = CYCLES / f1_Hz if f1_Hz > 0 else math.inf
        window_s = min(max(WINDOW_S, cycles_s), LONGEST_WINDOW_S)
        plan.append(Times(reach_s, settle_s, window_s))
        speed_rpm = point.speed_rpm
    return plan


def simulated_s(setup: Setup, points: Sequence[Where]) -> float:
    """Roughly the simulated time of a run, for progress bars."""
    values = parameters(setup)
    begin_s = float(values["calibration_s"]) + float(values["build_s"])
    return begin_s + sum(t.settle_s + t.window_s + 0.3 for t in times(setup, points))


def drive(
    setup: Setup,
    points: Sequence[Where],
    plan: Sequence[Times],
    progress: Progress | None = None,
) -> list[Figures]:
    """The figures at each point. Raises Lost, which names the point, if the drive does not hold
    one."""
    try:
        sim = SimulatedDrive(setup.changed(load__kind="constant"), fine_samples(setup))
        sim.start()
        begin_s = sim.controller.number("calibration_s") + sim.controller.number("build_s")
        sim.run(begin_s + 0.05, record=False, progress=progress)
        sim.check()
    except (firmware.FirmwareError, SetupError, DriveFault) as error:
        raise Lost(str(error)) from None
    found = []
    for point, allowed in zip(points, plan):
        try:
            found.append(_measure(sim, point, allowed, progress))
        except (DriveFault, NotReached, ArithmeticError, ValueError) as error:
            raise Lost(f"{point}: {error}") from None
    return found


def _measure(
    sim: SimulatedDrive, point: Where, allowed: Times, progress: Progress | None
) -> Figures:
    sim.set_many({"load_Nm": 0.0, "speed_ref_rpm": point.speed_rpm})
    near_rpm = max(2.0, SPEED_TOLERANCE * abs(point.speed_rpm))
    looks, waited_s = 0, 0.0
    while looks < LOOKS:
        if waited_s > allowed.reach_s:
            raise NotReached(f"{sim.speed_rpm:.0f} r/min after {waited_s:.3g} s without load")
        sim.run(LOOK_S, record=False, progress=progress)
        sim.check()
        waited_s += LOOK_S
        looks = looks + 1 if abs(sim.speed_rpm - point.speed_rpm) <= near_rpm else 0
    # At the shaft, along the speed.
    sim.set("load_Nm", math.copysign(1.0, point.speed_rpm) * point.load_Nm)
    errors_rpm = []
    for _ in range(round(allowed.settle_s / LOOK_S)):
        sim.run(LOOK_S, record=False, progress=progress)
        errors_rpm.append(abs(sim.speed_rpm - point.speed_rpm))
    sim.check()
    logged = any(sim.setup[f"inverter.{key}"] for key in _OF_DEVICES)
    if logged:
        sim.log_edges(round(allowed.window_s / sim.period_s) * MOST_EDGES)
    start, begin = sim.inverter.leg.copy(), sim.periods
    sim.run(allowed.window_s, progress=progress)
    sim.check()
    recording = sim.take()
    edges = sim.edges_since(begin, start) if logged else None
    sim.log_edges(0)
    speed_rpm = float(np.mean(channel(recording, "speed_rpm")))
    if abs(speed_rpm - point.speed_rpm) > near_rpm:
        raise NotReached(f"{speed_rpm:.1f} r/min, {allowed.settle_s:.2g} s after the load step")
    flux_Wb = np.hypot(channel(recording, "psi_alpha_Wb"), channel(recording, "psi_beta_Wb"))
    phases_A = np.stack([channel(recording, f"i_{phase}_A") for phase in PHASES])
    f1_Hz = abs(fundamental_Hz(recording))
    inverter = bridge(recording, edges)
    losses_W = (inverter["conduction_loss_W"], inverter["switching_loss_W"])
    figures = (
        speed_rpm,
        float(np.mean(flux_Wb)),
        torque_ripple_td_Nm(recording),
        thd_inf_pct(phases_A, recording.rate_Hz, f1_Hz),
        float(recording.meta["f_sw_Hz"]),
        copper_loss_W(recording) + sum(w for w in losses_W if math.isfinite(w)),
        float(np.mean(errors_rpm)),
    )
    # The last bits of a Fourier transform depend on where its array lies in memory.
    return Figures(*(float(f"{value:.{DIGITS}g}") for value in figures))


#: With any of these, the inverter's losses are known.
_OF_DEVICES = (
    "v_switch_V", "v_diode_V", "r_switch_ohm", "r_diode_ohm", "e_on_mJ", "e_off_mJ",
)  # fmt: skip
