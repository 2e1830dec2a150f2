"""Flux and voltage that change: does the current stay below its limit, is no healthy machine taken
for a wrong flux, and is a wrong flux still found?

The machines are those of the module `plates`: the controller was designed from the plate alone.
Each has the default scheme and one of the others but `dtc1`, whose x-y currents nobody controls.

healthy: at full torque into field weakening, a load that comes and drops there, a reversal in field
weakening, and back to a standstill.
wrong: under half of the rated load the estimate becomes wrong. The checks that know the sensors are
off, or all checks are on.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ... import firmware
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...errors import HexatorqueError
from ...experiments.prepare import magnetise
from ...parallel import each
from ...setups import Setup
from ...setups.design import Design, rad_s
from . import plates
from .commissioning import Watched
from .grids import Grid

TITLE = "Flux and voltage that change: currents and the check of the flux"
QUICK = 4
#: What must be reached: share of the healthy runs without a trip, and of the wrong estimates with
#: which the flux is wrong by WRONG or more.
HEALTHY, FOUND = 0.97, 0.95
WRONG = 0.3
#: Top speed over the one that the scheme's voltage reaches with the full field.
TOP = 1.4
#: Of the speed trip; the shaft is faster for a moment when its load drops.
BELOW_TRIP = 0.9
#: Share of the torque limit in force by which the machine is loaded in field weakening.
LOAD = 0.6
SETTLED, LOOK_S = 0.03, 0.01
#: Time for which a wrong estimate is watched, s.
WATCH_S = 1.5
#: Checks that would find a wrong sensor first.
OTHERS_OFF = {
    "controller__encoder_trip_rpm": 0.0, "controller__stuck_trip_A": 0.0,
    "controller__loss_check": 0.0, "controller__i_sum_trip_A": 1e4, "controller__vdc_min_V": 0.0,
}  # fmt: skip


def prepared(setup: Setup, scheme: str) -> tuple[Setup, float]:
    """The set-up with which a machine is driven into field weakening, and how fast, r/min."""
    row = firmware.lib.ht_scheme_describe(firmware.schemes().index(scheme))
    design = Design(setup, setup.parameter)
    top_rpm = TOP * design.base_rpm(design.reach_pu(row.reach_pu))
    trip_rpm = 2 * top_rpm
    if design.magnets:  # they must not drive current without gates
        trip_rpm = setup.parameter("speed_trip_rpm")
        top_rpm = min(top_rpm, BELOW_TRIP * trip_rpm)
    return setup.with_scheme(
        scheme,
        timing__latency="predicted",
        load__kind="constant",
        controller__field_weakening="on",
        controller__speed_trip_rpm=trip_rpm,
    ), top_rpm


def _accelerate_s(design: Design, step_rpm: float) -> float:
    """The changes for a step of the speed with half of the torque limit."""
    torque_Nm = 0.5 * design.parameter("torque_limit_Nm")
    return design.machine.inertia_kgm2 * rad_s(step_rpm) / torque_Nm


def course(setup: Setup, scheme: str) -> dict[str, Any]:
    """A healthy run: why it tripped, the largest phase current, the rms distance from the circle
    diagram over what trips."""
    setup, top_rpm = prepared(setup, scheme)
    design = Design(setup, setup.parameter)
    sim = Watched(setup, 2)
    magnetise(sim, 0.1)
    check, drive = float(setup.parameter("flux_check")), sim.controller.drive
    row: dict[str, Any] = {"lost": "", "off_circle": 0.0, "trip_A": setup.parameter("i_trip_A")}

    def run(longest_s: float, wanted_rpm: float = math.inf) -> None:
        """Until the speed is there."""
        end_s = sim.time_s + longest_s
        while sim.time_s < end_s and abs(sim.speed_rpm - wanted_rpm) > SETTLED * top_rpm:
            sim.run(LOOK_S, record=False)
            row["off_circle"] = max(row["off_circle"], math.sqrt(drive.protect.circle2) / check)
            sim.check()

    try:
        for wanted_rpm in (top_rpm, -top_rpm, 0.0):
            sim.set("speed_ref_rpm", wanted_rpm)
            run(0.3 + 2 * _accelerate_s(design, abs(wanted_rpm - sim.speed_rpm)), wanted_rpm)
            if wanted_rpm > 0:
                run(0.1)
                sim.load_Nm = LOAD * sim.controller.channel("torque_limit_Nm")
                run(0.2)
                sim.load_Nm = 0.0
                run(0.1)
    except HexatorqueError as error:
        row["lost"] = str(error)
    return {**row, "gates": sim.gate_mistake, "largest_A": sim.largest_A}


def _voltage_reads(factor: float) -> Callable[[SimulatedDrive], None]:
    def change(sim: SimulatedDrive) -> None:
        sim.sensors.v_counts_per_V *= factor

    return change


def _dead_set(sim: SimulatedDrive) -> None:
    sim.sensors.i_counts_per_A[[1, 3, 5]] = 0.0


def _false_resistance(sim: SimulatedDrive) -> None:
    sim.set("rs_ohm", 3 * float(sim.get("rs_ohm")))


def _turned(sim: SimulatedDrive) -> None:
    psi = sim.controller.drive.control.observer.psi_Wb
    wrong = complex(psi.alpha, psi.beta) * cmath.exp(2j * math.pi / 3)
    psi.alpha, psi.beta = wrong.real, wrong.imag


def _encoder_stands(sim: SimulatedDrive) -> None:
    sim.sensors.hold[-1] = 1


NOT_ADAPTED = {"controller__adapt_s": 0.0}
#: Name, speed over the full field's, the set-up's changes, and what becomes wrong.
WRONGS: tuple[tuple[str, float, dict[str, Any], Callable[[SimulatedDrive], None]], ...] = (
    ("dc-link voltage read × 0.6", 0.5, OTHERS_OFF, _voltage_reads(0.6)),
    ("sensors of set 2 read nothing", 0.5, OTHERS_OFF, _dead_set),
    ("R_s told as × 3", 0.1, OTHERS_OFF, _false_resistance),
    ("R_s told as × 3, not adapted", 0.1, {**OTHERS_OFF, **NOT_ADAPTED}, _false_resistance),
    ("estimate turned by 120°", 0.5, OTHERS_OFF, _turned),
    ("dc-link voltage read × 0.6, all checks", 0.5, {}, _voltage_reads(0.6)),
    ("sensors of set 2 read nothing, all checks", 0.5, {}, _dead_set),
    ("encoder stands still, all checks", 0.5, {}, _encoder_stands),
)


def wrong(setup: Setup, case: tuple) -> dict[str, Any]:
    """Whether a wrong estimate was found, after which time, and by how much the flux was wrong in
    the end."""
    name, share, changes, change = case
    setup = setup.changed(**changes, load__kind="constant")
    design = Design(setup, setup.parameter)
    sim = SimulatedDrive(setup, 2)
    magnetise(sim, 0.1)
    sim.set("speed_ref_rpm", share * design.base_rpm())
    sim.run(0.3 + 2 * _accelerate_s(design, share * design.base_rpm()), record=False)
    sim.set("load_Nm", 0.5 * design.rated_Nm)
    sim.run(0.3, record=False)
    row = {"wrong": name, "before": list(sim.faults), "off": 0.0, "found": "", "time_s": 0.0}
    change(sim)
    begin_s = sim.time_s
    while not sim.faults and sim.time_s - begin_s < WATCH_S:
        sim.discard()
        sim.run(LOOK_S)
        taken = sim.take()
        true, seen = (
            math.hypot(*(taken[f"{where}psi_{axis}_Wb"][-1] for axis in ("alpha", "beta")))
            for where in ("plant.", "")
        )
        if not sim.faults:
            row["off"] = abs(true / seen - 1)
    return {**row, "found": ", ".join(sim.faults), "time_s": sim.time_s - begin_s}


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    schemes = [name for name in firmware.schemes() if name != "dtc1"]

    def one(number: int) -> dict:
        plate, circuit, inertia_kgm2 = plates.machine(number)
        setup = plates.drive(plate, circuit, inertia_kgm2)
        chosen = dict.fromkeys(("ddr", schemes[number % len(schemes)]))
        return {
            "number": number,
            "power_kW": plate.power_kW,
            "schemes": {name: course(setup, name) for name in chosen},
            "wrong": [wrong(setup, case) for case in WRONGS],
        }

    return {"quick": quick, "machines": each(one, range(QUICK if quick else plates.MACHINES))}


def failures(result: dict) -> list[str]:
    lines = []
    healthy = [row for m in result["machines"] for row in m["schemes"].values()]
    held = sum(not row["lost"] for row in healthy)
    if held < HEALTHY * len(healthy):
        lines.append(
            f"healthy: {held} of {len(healthy)} runs without a trip, needed are {100 * HEALTHY:g} %"
        )
    lines += [
        f"{scheme}: {row['gates']}"
        for m in result["machines"]
        for scheme, row in m["schemes"].items()
        if row["gates"]
    ]
    for name in dict.fromkeys(row["wrong"] for m in result["machines"] for row in m["wrong"]):
        far = [row for row in _tried(result, name) if row["off"] >= WRONG]
        found = sum(bool(row["found"]) for row in far)
        if found < FOUND * len(far):
            lines.append(f"{name}: {found} of {len(far)} found, needed are {100 * FOUND:g} %")
    return lines


def _tried(result: dict, name: str) -> list[dict]:
    """The runs with this wrong estimate, without those that had tripped before."""
    rows = [row for m in result["machines"] for row in m["wrong"]]
    return [row for row in rows if row["wrong"] == name and not row["before"]]


def grid(result: dict) -> Grid:
    rows = []
    for scheme in firmware.schemes():
        of = [m["schemes"][scheme] for m in result["machines"] if scheme in m["schemes"]]
        if of:
            peaks = sorted(100 * row["largest_A"] / row["trip_A"] for row in of)
            off = sorted(100 * row["off_circle"] for row in of)
            lost = [row["lost"] for row in of if row["lost"]]
            flux = sum("flux estimate" in line for line in lost)
            middle = len(of) // 2
            rows.append(
                [scheme, str(len(of)), str(len(lost)), str(flux)]
                + [f"{v:.0f} %" for v in (peaks[middle], peaks[-1], off[middle], off[-1])]
            )
    heads = [
        "scheme", "runs", "trips", "of these by the check of the flux", "largest current, median",
        "largest", "distance from the circle, median", "largest",
    ]  # fmt: skip
    tables = [("Healthy machines, shares of what trips", heads, rows)]
    rows = []
    for name, *_ in WRONGS:
        of = _tried(result, name)
        far = [row for row in of if row["off"] >= WRONG]
        stopped = [row for row in of if row["found"]]
        rows.append(
            [name, str(len(of)), str(len(stopped))]
            + [str(sum("flux estimate" in row["found"] for row in of))]
            + [f"{sum(bool(row['found']) for row in far)} of {len(far)}"]
            + [f"{100 * max((r['off'] for r in of if not r['found']), default=0.0):.0f} %"]
        )
    heads = [
        "estimate", "runs", "stopped", "by the check of the flux",
        f"stopped, of those wrong by {100 * WRONG:g} % and more", "most that was not stopped",
    ]  # fmt: skip
    return [*tables, ("Wrong estimates", heads, rows)]


def plot(result: dict, path: Path) -> Path:
    """Draws the largest current and the distance from the circle diagram over the power."""
    from ...analysis import plots

    figure, axes = plots.new_figure(2, 1, 5.0, sharex=True)
    for axis, name in zip(axes.flat, ("largest_A", "off_circle")):
        for label, lost, marker, colour in (
            ("held", False, "o", plots.COLOUR["i_u1"]),
            ("tripped", True, "x", plots.COLOUR["torque"]),
        ):
            points = [
                (m["power_kW"], row[name] / (row["trip_A"] if name == "largest_A" else 1.0))
                for m in result["machines"]
                for row in m["schemes"].values()
                if bool(row["lost"]) == lost
            ]
            if points:
                axis.plot(*zip(*points), marker, ms=4, color=colour, label=label)
        axis.axhline(1.0, color=plots.FAINT, zorder=0)
        axis.set_xscale("log")
    axes.flat[0].legend(loc="lower right", ncols=2)
    axes.flat[0].set_title("largest phase current over i_trip_A", **plots.TITLE)
    axes.flat[1].set_title("distance from the circle diagram over flux_check", **plots.TITLE)
    axes.flat[1].set_xlabel("rated power [kW]", **plots.LABEL)
    return plots.save(figure, path)
