"""Error of the integration against its step size.

A drive runs at an operating point in closed loop, and the changes of its legs are recorded. The
same changes then drive the same plant again with shorter steps. The reference is a run whose steps
are a sixteenth of the shortest compared step. (tests/host/plant/test_accuracy.py compares the plant
with independent equations and another integrator.)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ... import firmware
from ...analysis.plots import INK, LABEL, LEGEND, new_figure, save
from ...analysis.plots import TITLE as HEADING
from ...analysis.schemes import STYLE
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import Point, Progress, approach
from ...plant.load import load_record
from ...plant.loop import MAX_STEP_S, Plant, follow_log
from ...plant.pwm import pwm_record
from ...setups import load
from .grids import Grid

TITLE = "Integration: error against step size"
SETUPS = ("paper-a-feasible", "paper-b")
#: The compared longest steps in us: a period of 10 kHz, and its halves.
STEPS_US = (100.0, 50.0, 25.0, 12.5, 6.25)
FINEST_US = STEPS_US[-1] / 16
#: Largest allowed error of the phase currents, relative to their amplitude.
LIMIT = 1e-6
#: Most edges in a period: six legs with five changes of level each, all through OFF.
EDGES_PER_PERIOD = 60


@dataclass(frozen=True)
class Segment:
    """A part of a run, from which the plant can be simulated again.

    edges: (n, 3), see `SimulatedDrive.edges`; currents_A: (periods, 6), phase currents at
    the periods' ends; state, inverter: the plant at the beginning.
    """

    sim: SimulatedDrive
    first: int  #: period at the beginning
    state: np.ndarray
    inverter: np.record
    edges: np.ndarray
    currents_A: np.ndarray
    speed_rad_s: np.ndarray

    @property
    def amplitude_A(self) -> float:
        """The peak of a sine that has the rms value of all phases."""
        return float(np.sqrt(2 * np.mean(self.currents_A**2)))


def run_segment(sim: SimulatedDrive, duration_s: float) -> Segment:
    """Continue `sim` without recording, and keep the data to simulate the plant again."""
    periods = round(duration_s / sim.period_s)
    first, state, inverter = sim.periods, sim.plant_state.copy(), sim.inverter.copy()
    currents, speed = np.empty((periods, 6)), np.empty(periods)
    sim.log_edges(periods * EDGES_PER_PERIOD)
    for period in range(periods):
        sim.run(sim.period_s, record=False)
        currents[period] = sim._machine.i_phase @ sim.plant_state[:6]
        speed[period] = sim.plant_state[6]
    sim.check()
    edges = sim.edges.copy()
    sim.log_edges(0)
    return Segment(sim, first, state, inverter, edges, currents, speed)


def replay(segment: Segment, step_us: float = MAX_STEP_S * 1e6) -> np.ndarray:
    """(periods, 6) phase currents of the plant under the segment's edges, integrated
    with steps of at most `step_us`."""
    sim = segment.sim
    timing = sim._timing.copy()
    timing.max_step = max(1, round(step_us * 1e-6 * timing.clock_Hz))
    torque = load_record(sim.setup["load.kind"], sim.load_Nm, sim.setup["load.at_rpm"])
    states = np.empty((len(segment.currents_A), 8))
    plant = Plant(
        sim._machine, torque, segment.inverter.copy(), sim.sensors.copy(), segment.state.copy()
    )
    follow_log(segment.edges, segment.first, timing, plant, sim.vdc_V, pwm_record(), states)
    return np.array([sim._machine.i_phase @ y for y in states[:, :6]])


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    """Runs every scheme at the operating points of both papers. quick: one scheme."""
    schemes = ("dtc3",) if quick else firmware.schemes()
    points = [
        Point(s.with_scheme(scheme), s["point.speed_rpm"], s["point.load_Nm"])
        for s in (load(name) for name in SETUPS)
        for scheme in schemes
    ]
    return errors(points, 0.2 if quick else 0.5, progress)


def errors(
    points: Iterable[Point], duration_s: float = 0.5, progress: Progress | None = None
) -> dict:
    """Largest error of any phase current at the control instants, relative to their
    amplitude, at each of STEPS_US.

    {"duration_s", "step_us": [...], "finest_us", "chosen_us", "limit",
    "points": [{"setup", "scheme", "speed_rpm", "load_Nm", "error": [...]}]}
    """
    rows = []
    for point in points:
        segment = run_segment(approach(point, progress), duration_s)
        exact = replay(segment, FINEST_US)
        error = [
            float(np.max(np.abs(replay(segment, step) - exact))) / segment.amplitude_A
            for step in STEPS_US
        ]
        rows.append(
            {
                "setup": point.setup.name,
                "scheme": point.setup["controller.scheme"],
                "speed_rpm": point.speed_rpm,
                "load_Nm": point.load_Nm,
                "error": error,
            }
        )
    return {
        "duration_s": duration_s,
        "step_us": list(STEPS_US),
        "finest_us": FINEST_US,
        "chosen_us": MAX_STEP_S * 1e6,
        "limit": LIMIT,
        "points": rows,
    }


def failures(result: dict) -> list[str]:
    """The points where the default step's error is above the limit."""
    chosen = result["step_us"].index(result["chosen_us"])
    return [
        f"{row['setup']}, {row['scheme']}: error {row['error'][chosen]:.1e}"
        for row in result["points"]
        if not row["error"][chosen] <= result["limit"]
    ]


def grid(result: dict) -> Grid:
    title = (
        f"largest error of a phase current / amplitude over {result['duration_s']:g} s; required "
        f"{result['limit']:g}, default step {result['chosen_us']:g} us"
    )
    heads = ["set-up, scheme", *(f"{step:g} us" for step in result["step_us"])]
    rows = [
        [f"{row['setup']}, {row['scheme']}", *(f"{error:.1e}" for error in row["error"])]
        for row in result["points"]
    ]
    return [(title, heads, rows)]


def plot(result: dict, path: str | Path) -> Path:
    """Draws the error over the step size as PNG, with a panel for each operating point."""
    panels: dict[tuple, list[dict]] = {}
    for row in result["points"]:
        panels.setdefault((row["setup"], row["speed_rpm"], row["load_Nm"]), []).append(row)
    figure, axes = new_figure(1, len(panels), 4.4, sharey=True)
    step = np.array(result["step_us"])
    for ax, ((setup, speed_rpm, load_Nm), rows) in zip(axes[0], panels.items()):
        worst = max(row["error"][0] for row in rows)
        lowest = min(min(row["error"]) for row in rows)
        slope = 3 * worst * (step / step[0]) ** 4
        shown = slope > 3 * lowest
        ax.plot(step[shown], slope[shown], color="#666d78", lw=1, ls="--", label="fourth power")
        for row in rows:
            style = STYLE[row["scheme"]]
            ax.plot(step, row["error"], lw=1.3, ms=4.5, label=row["scheme"], **style)
        ax.axhline(result["limit"], color=INK, lw=1)
        ax.axvline(result["chosen_us"], color="#9aa1ab", lw=6, alpha=0.35, zorder=0)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xticks(step, [f"{h:g}" for h in step])
        ax.minorticks_off()
        ax.set_xlim(0.85 * step.min(), 1.25 * step.max())
        ax.set_title(f"{setup}: {speed_rpm:g} r/min, {load_Nm:g} N m", **HEADING)
        ax.set_xlabel("longest step [µs]", **LABEL)
        ax.text(step.min(), 0.7 * result["limit"], "required", fontsize=8, va="top",
                color=INK)  # fmt: skip
        ax.text(0.93 * result["chosen_us"], 1.5 * lowest, "default step", fontsize=8,
                rotation=90, ha="right", va="bottom", color="#666d78")  # fmt: skip
    axes[0, 0].set_ylabel("largest error of a phase current / amplitude", **LABEL)
    axes[0, -1].legend(loc="center left", bbox_to_anchor=(1, 0.5), **LEGEND)
    return save(figure, path)
