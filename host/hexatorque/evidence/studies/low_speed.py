"""Rated torque at and near standstill: how well each flux observer copes with dead time, current
sensor offsets and resistances that differ from the machine's."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ... import firmware, setups
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...parallel import each
from .grids import Grid

TITLE = "Low speed: observers at rated torque"
SETUP = "paper-a-feasible"
SPEEDS_RPM = (0.0, 30.0, 100.0)
TORQUES_NM = (10.0, -10.0)  #: rated load; a negative load drives the shaft
#: Gains of the speed regulator. Paper A's 0.4 N m s/rad (2 N m/rad) are so low that the torque
#: comparator's ripple alone, 0.2 N m at a few Hz, moves the shaft by 3 r/min.
KP_NMS_RAD, KI_NM_RAD = 1.2, 6.0
#: (R_s, R_r) of the observer relative to the machine's.
RESISTANCES = ((1.0, 1.0), (0.8, 1.0), (1.2, 1.0), (1.0, 0.7), (1.0, 1.3))
#: Offset as a share of the converter's range, and its sign in each phase. The offsets do not add up
#: to zero in either set.
OFFSET = 0.005
SIGNS = (1, -1, 1, -1, 1, 1)
LOAD_AT_S = 1.0
#: A rated load step at standstill disturbs any drive, so errors are measured from this time on.
SETTLED_S = 9.0
#: Means of flux and speed are taken over windows of this length.
WINDOW_S = 0.5
DURATION_S = 60.0

#: Largest errors that a drive may have: speed in r/min, flux as a share.
SPEED_RPM = 2.0
FLUX_RIGHT = 0.05
FLUX_WRONG = 0.15


@dataclass(frozen=True)
class Case:
    observer: str
    scheme: str
    speed_rpm: float
    load_Nm: float
    rs: float = 1.0
    rr: float = 1.0
    #: offset that appears after calibration, as a share of the range
    late_offset: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """The extremes over the settled time. If the drive tripped, they are over all its windows, and
    `fault` and `fault_s` say why and when. Speed: deviation of the instantaneous shaft speed. Flux:
    deviation of a window's mean true flux from the reference. gates: forbidden commands that
    the gates got."""

    speed_error_rpm: tuple[float, float]
    flux_error: tuple[float, float]
    fault: str = ""
    fault_s: float = 0.0
    gates: str = ""

    def holds(self, flux_limit: float) -> bool:
        return (
            not self.fault
            and max(map(abs, self.speed_error_rpm)) <= SPEED_RPM
            and max(map(abs, self.flux_error)) <= flux_limit
        )


def run(case: Case, duration_s: float = DURATION_S, progress: Progress | None = None) -> Outcome:
    """Runs one drive for `duration_s`: start, speed reference, rated load."""
    setup = setups.load(SETUP)
    span_A = 2 * setup["sensors.i_full_A"]
    offset_A = [OFFSET * span_A * sign for sign in SIGNS]
    setup = setup.changed(
        controller__scheme=case.scheme,
        controller__observer=case.observer,
        controller__kp_speed_Nms_rad=KP_NMS_RAD,
        controller__ki_speed_Nm_rad=KI_NM_RAD,
        controller__rs_ohm=setup["machine.rs_ohm"] * case.rs,
        controller__rr_ohm=setup["machine.rr_ohm"] * case.rr,
        sensors__i_offset_A=offset_A,
    )
    reference_Wb = setup.parameter("flux_ref_Wb")
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(0.4, record=False, progress=progress)
    counts = case.late_offset * 4096
    sim.sensors.i_offset_counts[:] += counts * np.array(SIGNS)
    sim.set("speed_ref_rpm", case.speed_rpm)
    sim.run(LOAD_AT_S - 0.4, record=False, progress=progress)
    sim.set("load_Nm", case.load_Nm)
    speeds: list[float] = []
    fluxes: list[float] = []
    settled = 0
    while sim.time_s < duration_s:
        sim.run(WINDOW_S, progress=progress)
        rec = sim.take()
        if sim.controller.state != firmware.RUN:
            break
        flux_Wb = np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"])
        fluxes.append(float(flux_Wb.mean()) / reference_Wb - 1)
        error_rpm = rec["plant.speed_rpm"] - case.speed_rpm
        speeds += [float(error_rpm.min()), float(error_rpm.max())]
        if sim.time_s <= SETTLED_S:
            settled = len(fluxes)
    fault, at = "", 0.0
    if sim.controller.state != firmware.RUN:
        fault = ", ".join(sim.controller.faults)
        snapshot = sim.controller.snapshot
        assert snapshot  # a fault leaves one
        at = snapshot["tick"] * sim.period_s
        settled = 0
    speeds, fluxes = speeds[2 * settled :] or [0.0], fluxes[settled:] or [0.0]
    errors = (min(speeds), max(speeds)), (min(fluxes), max(fluxes))
    return Outcome(*errors, fault, at, sim.gate_mistake)


def run_all(
    cases: list[Case], duration_s: float = DURATION_S, progress: Progress | None = None
) -> list[Outcome]:
    """Runs all cases on all cores."""
    return each(lambda case: run(case, duration_s, progress), cases)


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    """Runs every observer at every point with right and wrong resistances. The hybrid observer runs
    with every scheme, the others with ddr."""
    schemes = ("ddr",) if quick else firmware.schemes()
    others = ("voltage", "compensated")
    plan = [(o, "ddr", 0.0) for o in others]
    plan += [("hybrid", s, 0.0) for s in schemes]
    plan += [(o, "ddr", OFFSET) for o in (*others, "hybrid")]
    cases = [
        Case(observer, scheme, speed, load, rs, rr, late)
        for observer, scheme, late in plan
        for (rs, rr), speed, load in itertools.product(RESISTANCES, SPEEDS_RPM, TORQUES_NM)
    ]
    outcomes = run_all(cases, 15.0 if quick else DURATION_S, progress)
    return {
        "setup": SETUP,
        "duration_s": 15.0 if quick else DURATION_S,
        "rows": [asdict(c) | asdict(o) for c, o in zip(cases, outcomes)],
    }


def _label(row: dict) -> str:
    name = f"{row['observer']}, {row['scheme']}"
    return name + (", offset after calibration" if row["late_offset"] else "")


def _heading(rs: float, rr: float) -> str:
    return "right" if rs == rr else f"R_s × {rs:g}" if rs != 1 else f"R_r × {rr:g}"


def _groups(result: dict) -> dict[str, dict[tuple[float, float], list[dict]]]:
    groups: dict[str, dict[tuple[float, float], list[dict]]] = {}
    for row in result["rows"]:
        groups.setdefault(_label(row), {}).setdefault((row["rs"], row["rr"]), []).append(row)
    return groups


def _cell(rows: list[dict]) -> str:
    """The worst errors of flux and speed over the points, and the number of points at which the
    drive tripped."""
    held = [r for r in rows if not r["fault"]]
    text = ""
    if held:
        flux = max((e for r in held for e in r["flux_error"]), key=abs)
        speed = max(abs(e) for r in held for e in r["speed_error_rpm"])
        text = f"{100 * flux:+.1f} %, {speed:.1f}"
    if len(held) < len(rows):
        text += f"{'; ' if text else ''}{len(rows) - len(held)} of {len(rows)} tripped"
    return text


def failures(result: dict) -> list[str]:
    """The cases in which the hybrid observer with calibrated sensors exceeds its limits, and those
    in which the gates made a mistake."""
    lost = []
    for row in result["rows"]:
        case = Case(**{name: row[name] for name in Case.__dataclass_fields__})
        outcome = Outcome(**{name: row[name] for name in Outcome.__dataclass_fields__})
        limit = FLUX_RIGHT if (case.rs, case.rr) == (1.0, 1.0) else FLUX_WRONG
        judged = case.observer == "hybrid" and not case.late_offset
        if outcome.gates or (judged and not outcome.holds(limit)):
            lost.append(f"{case}: {outcome}")
    return lost


def grid(result: dict) -> Grid:
    title = (
        f"{SETUP}: 0, 30, 100 r/min, ±10 N m, {result['duration_s']:g} s each: "
        "worst flux error, worst speed error [r/min]"
    )
    heads = ["observer,\nscheme", *(_heading(*resistances) for resistances in RESISTANCES)]
    rows = [
        [label.replace(", ", "\n"), *(_cell(by_resistance[key]) for key in RESISTANCES)]
        for label, by_resistance in _groups(result).items()
    ]
    return [(title, heads, rows)]


def plot(result: dict, path: Path) -> Path:
    """Draws the flux error of every point by observer. A cross at the edge marks a point at which
    the drive tripped."""
    from ...analysis import plots

    groups = _groups(result)
    height_in = 1.2 + 0.42 * len(groups)
    figure, axes = plots.new_figure(1, len(RESISTANCES), height_in, sharey=True)
    points = list(itertools.product(SPEEDS_RPM, TORQUES_NM))
    errors = [abs(e) for row in result["rows"] if not row["fault"] for e in row["flux_error"]]
    end = 100 * max([1.1 * FLUX_WRONG, *(1.1 * e for e in errors)])
    for column, (axis, key) in enumerate(zip(axes[0], RESISTANCES)):
        for line, by_resistance in enumerate(groups.values()):
            for row in by_resistance[key]:
                place = points.index((row["speed_rpm"], row["load_Nm"])) / len(points)
                y = line + 0.7 * place - 0.3
                if row["fault"]:
                    axis.plot(
                        -end, y, "x", clip_on=False, color=plots.COLOUR["torque"], markersize=4
                    )
                else:
                    axis.plot(
                        [100 * e for e in row["flux_error"]], [y, y], "|-", color=plots.INK, ms=4
                    )
        limit = 100 * (FLUX_RIGHT if key == (1.0, 1.0) else FLUX_WRONG)
        axis.axvspan(-limit, limit, color=plots.FAINT, alpha=0.5, lw=0)
        axis.set_title(_heading(*key), **plots.TITLE)
        axis.set_xlabel("true flux error [%]", **plots.LABEL)
        axis.set_xlim(-end, end)
        if column == 0:
            axis.set_yticks(range(len(groups)), list(groups), fontsize=7.5)
            axis.invert_yaxis()
    note = (
        "in each group from top to bottom: 0, 30, 100 r/min, each with +10 and -10 N m; grey: "
        "within the limit; ×: tripped"
    )
    figure.suptitle(f"{TITLE}\n{note}", **plots.TITLE)
    return plots.save(figure, path)
