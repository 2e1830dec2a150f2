"""A measure for the simulation's speed: its plant alone, compiled by numba and in plain
C (tests/c/plant.c), both along the edges of the same run."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

import numpy as np

from ...drive.simulated import SimulatedDrive
from ...plant.inverter import inverter_record
from ...plant.legs import OFF
from ...plant.load import load_record
from ...plant.loop import Plant, follow_log
from ...plant.pwm import pwm_record
from ...setups import SetupError

#: The same arithmetic in the same order.
CLOSE = 1e-12
_REASONS = {1: "diodes chatter", 2: "all legs are off"}


def usable(sim: SimulatedDrive) -> str:
    """Why plain C has no such plant; empty if it has."""
    machine, setup = sim._machine, sim.setup
    for there, what in (
        ("linear" not in machine.dtype.names, "saturating iron"),
        (sim.inverter.devices.drops != 0, "conduction drops"),
        (sim.inverter.contact.breaks != 0, "broken legs"),
        (sim.sensors.i_filter_rad_s > 0, "current filters"),
        (setup["load.kind"] in ("friction", "brake"), "this load"),
    ):
        if there:
            return f"the plant in plain C has no {what}"
    return ""


class Replay:
    """A stretch of a run without its controller: the state where it began, and its edges."""

    def __init__(self, sim: SimulatedDrive, seconds: float, capacity: int) -> None:
        self.seconds = seconds
        self.state = sim.plant_state.copy()
        self.leg, self.diode = sim.inverter.leg.copy(), sim.inverter.diode.copy()
        self.first = sim.periods
        sim.log_edges(capacity)
        sim.run(seconds, record=False)
        self.periods = sim.periods - self.first
        self.edges, self.end = sim.edges.copy(), sim.plant_state.copy()
        sim.log_edges(0)
        self.sim = sim
        self.load = load_record(sim.setup["load.kind"], sim.load_Nm, sim.setup["load.at_rpm"])

    def numba(self) -> tuple[np.ndarray, float]:
        """State at the end, and the time that it took, after a first run."""
        sim = self.sim
        inverter = inverter_record(sim.machine.phase_of_leg)
        inverter.leg[:], inverter.diode[:] = self.leg, self.diode
        inverter.command[:], inverter.off = self.leg, int(np.sum(self.leg == OFF))
        y = self.state.copy()
        begin = time.thread_time()
        plant = Plant(sim._machine, self.load, inverter, sim.sensors, y)
        states = np.empty((self.periods, len(y)))
        follow_log(self.edges, self.first, sim._timing, plant, sim.vdc_V, pwm_record(), states)
        return y, time.thread_time() - begin

    def plain_c(self, library: Path) -> tuple[np.ndarray, float]:
        """The same in C."""
        sim, timing = self.sim, self.sim._timing
        try:
            function = ctypes.CDLL(str(library.resolve())).plant_replay
        except (OSError, AttributeError):
            raise SetupError(f"{library}: not the plant in C; `make bench` builds it") from None
        m, load = sim._machine, self.load
        constants = np.concatenate(
            [
                np.ravel(part)
                for part in (
                    m.slope, m.i_phase, m.g_leg, sim.inverter.transform, sim.inverter.star,
                    m.pole_pairs, m.torque_gain, m.inertia, m.viscous,
                    load.constant_Nm, load.linear_Nms, load.quadratic_Nms2,
                    sim.vdc_V, timing.clock_Hz,
                )
            ]
        ).astype(float)  # fmt: skip
        counts = np.array([timing.period, timing.sample_count, timing.max_step], np.int64)
        y, leg, diode = self.state.copy(), self.leg.copy(), self.diode.copy()
        arrays = [
            ctypes.c_void_p(array.ctypes.data) for array in (constants, y, leg, diode, counts)
        ]
        begin = time.thread_time()
        failed = function(
            *arrays,
            ctypes.c_int64(int(self.first * timing.period)),
            ctypes.c_int64(self.periods),
            ctypes.c_void_p(self.edges.ctypes.data),
            ctypes.c_int64(len(self.edges)),
        )
        cpu_s = time.thread_time() - begin
        if failed:
            raise SetupError(f"the plant in plain C: {_REASONS[failed]}")
        return y, cpu_s

    def check(self, y: np.ndarray, who: str) -> None:
        """Refuse to compare the speed of another computation."""
        worst = float(np.max(np.abs(y - self.end) / np.maximum(1.0, np.abs(self.end))))
        if not worst <= CLOSE:
            raise SetupError(
                f"the plant in {who} ends elsewhere than the run: {worst:.2g} relative"
            )


def factors(
    sim: SimulatedDrive, library: Path, seconds: float, capacity: int, repeats: int
) -> dict[str, float]:
    """Simulated seconds per second of processor time, the best of several runs, in turns: of the
    whole `loop`, of its `plant` alone, of the plant in `plain_c`, and of the loop if its plant were
    that one (`limit`). SetupError if they do not end where the run has ended."""
    if why := usable(sim):
        raise SetupError(why)
    replay = Replay(sim, seconds, capacity)
    replay.numba()  # compiles
    best = dict.fromkeys(("loop", "plant", "plain_c"), float("inf"))
    for _ in range(repeats):
        begin = time.thread_time()
        sim.run(seconds, record=False)
        best["loop"] = min(best["loop"], time.thread_time() - begin)
        for name, (y, cpu_s) in (
            ("plant", replay.numba()),
            ("plain_c", replay.plain_c(library)),
        ):
            replay.check(y, name)
            best[name] = min(best[name], cpu_s)
    best["limit"] = best["loop"] - best["plant"] + best["plain_c"]
    return {name: seconds / cpu_s for name, cpu_s in best.items()}
