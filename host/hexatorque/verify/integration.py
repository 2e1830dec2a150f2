"""Error of the integration against its step size.

A drive runs at an operating point in closed loop; the changes of its legs are kept.
The same changes then drive the same plant again with shorter steps. The finest run,
a sixteenth of the shortest step compared, is the reference. (Against independent
equations and another integrator: tests/plant/test_accuracy.py.)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from .. import firmware
from ..plant.loop import MAX_STEP_S, follow
from ..plant.machine import phase_current
from ..plant.pwm import pwm_record
from ..scenario import Setup, load
from ..sil import Simulation, load_record
from ..study import Point, approach

#: Longest steps compared: a period of 10 kHz and its halves, us.
STEPS_US = (100.0, 50.0, 25.0, 12.5, 6.25)
FINEST_US = STEPS_US[-1] / 16
#: What the phase currents may be off, relative to their amplitude.
LIMIT = 1e-6
#: Edges of a period, at most: six legs, five changes of level each, through OFF.
EDGES_PER_PERIOD = 60


@dataclass(frozen=True)
class Segment:
    """A stretch of a running drive, to be driven again.

    edges: (n, 3), see `Simulation.edges`; currents_A: (periods, 6), phase currents at
    the periods' ends; state, inverter: the plant at the beginning.
    """

    sim: Simulation
    first: int  #: period at the beginning
    state: np.ndarray
    inverter: np.record
    edges: np.ndarray
    currents_A: np.ndarray
    speed_rad_s: np.ndarray

    @property
    def amplitude_A(self) -> float:
        """Peak of the sine with the rms value of all phases."""
        return float(np.sqrt(2 * np.mean(self.currents_A**2)))


def run_segment(sim: Simulation, duration_s: float) -> Segment:
    """Go on running `sim`, unrecorded, keeping what it takes to do it again."""
    periods = round(duration_s / sim.period_s)
    first, state, inverter = sim.periods, sim.state.copy(), sim._inverter.copy()
    currents, speed = np.empty((periods, 6)), np.empty(periods)
    sim.log_edges(periods * EDGES_PER_PERIOD)
    for period in range(periods):
        sim.run(sim.period_s, record=False)
        currents[period] = sim._machine.i_phase @ sim.state[:6]
        speed[period] = sim.state[6]
    sim.check()
    edges = sim.edges.copy()
    sim.log_edges(0)
    return Segment(sim, first, state, inverter, edges, currents, speed)


@njit
def _follow_periods(edges, first, tm, m, load, inv, y, vdc, ps, nothing, states):
    e = 0
    for period in range(states.shape[0]):
        start = (first + period) * tm.period
        for c0, c1 in ((0, tm.sample_count), (tm.sample_count, tm.period)):
            n = 0
            while e < edges.shape[0] and edges[e, 0] < start + c1:
                ps.count[n] = edges[e, 0] - start
                ps.leg[n] = edges[e, 1]
                ps.state[n] = edges[e, 2]
                n += 1
                e += 1
            follow(m, load, inv, y, vdc, ps, n, c0, c1, tm, 0, nothing, 0)
        states[period] = y


def replay(segment: Segment, step_us: float = MAX_STEP_S * 1e6) -> np.ndarray:
    """(periods, 6) phase currents of the plant under the segment's edges, integrated
    with steps of at most `step_us`."""
    sim = segment.sim
    timing = sim._timing.copy()
    timing.max_step = max(1, round(step_us * 1e-6 * timing.clock_Hz))
    torque = load_record(sim.setup["load.kind"], sim.load_Nm, sim.setup["load.at_rpm"])
    states = np.empty((len(segment.currents_A), 8))
    _follow_periods(
        segment.edges, segment.first, timing, sim._machine, torque, segment.inverter.copy(),
        segment.state.copy(), sim.vdc_V, pwm_record(), np.empty((0, 0), np.float32), states,
    )  # fmt: skip
    return np.array([sim._machine.i_phase @ y for y in states[:, :6]])


def study(
    setup: Setup | None = None,
    schemes: Iterable[str] | None = None,
    duration_s: float = 0.5,
    speed_rpm: float | None = None,
    load_Nm: float | None = None,
) -> dict:
    """Largest error of any phase current at the control instants, relative to the
    amplitude, of each scheme at each of STEPS_US.

    {"setup", "speed_rpm", "load_Nm", "duration_s", "step_us": [...],
    "chosen_us", "limit", "error": {scheme: [...]}}
    """
    setup = setup or load("paper-a-feasible")
    speed_rpm = setup["point.speed_rpm"] if speed_rpm is None else speed_rpm
    load_Nm = setup["point.load_Nm"] if load_Nm is None else load_Nm
    error = {}
    for scheme in schemes or firmware.schemes():
        sim = approach(Point(setup.changed(controller__scheme=scheme), speed_rpm, load_Nm))
        segment = run_segment(sim, duration_s)
        exact = replay(segment, FINEST_US)
        error[scheme] = [
            float(np.max(np.abs(replay(segment, step) - exact))) / segment.amplitude_A
            for step in STEPS_US
        ]
    return {
        "setup": setup.name,
        "speed_rpm": speed_rpm,
        "load_Nm": load_Nm,
        "duration_s": duration_s,
        "step_us": list(STEPS_US),
        "chosen_us": MAX_STEP_S * 1e6,
        "limit": LIMIT,
        "error": error,
    }
