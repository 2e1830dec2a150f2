"""Preparation of a measurement: changes of the simulated drive that no set-up describes, and its
start."""

from __future__ import annotations

from collections.abc import Callable

from ..drive.interface import Progress
from ..drive.simulated import SimulatedDrive

#: Changes a drive before it starts.
Prepare = Callable[[SimulatedDrive], None]


def other_dead_time(change_us: float) -> Prepare:
    """The inverter's dead time differs by change_us from the one that the firmware knows. The
    registers hold the inverter's, at least one count."""

    def prepare(sim: SimulatedDrive) -> None:
        m, words = sim.controller.map, sim.controller.register_words()
        counts = round(change_us * 1e-6 * float(m.pwm_clock_Hz))
        for leg in range(6):
            for register in (m.dbred, m.dbfed):
                at = m.epwm + leg * m.stride + register
                words[at] = max(1, int(words[at]) + counts)

    return prepare


def magnetise(
    sim: SimulatedDrive, longer_s: float = 0.05, progress: Progress | None = None
) -> None:
    """Start the drive and run until its flux is built up, and so much longer."""
    sim.start()
    built_s = sim.controller.number("calibration_s") + sim.controller.number("build_s")
    sim.run(built_s + longer_s, record=False, progress=progress)
