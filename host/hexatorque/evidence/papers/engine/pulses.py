"""Plays switching patterns on the simulated chip without a control law: emulated PWM modules,
inverter, and a machine that integrates the voltage.

The firmware's own driver writes the registers in the fast interrupt, as on the chip. There is no
dead time, which the firmware itself would refuse. The machine has 1 H and almost no resistance, so
the change of its stator flux in a period is the volt-seconds of that period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .... import setups
from ....drive.entry_point import EntryPoint
from ....drive.simulated import SimulatedDrive
from ....firmware import ALL_LEGS, CData, ffi, lib
from ....plant.vsd import INVERSE, PHASES
from ....recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Samples of a period in recordings that show pulses.
SAMPLES = 200

SETUP = setups.load("paper-a").changed(
    machine__rs_ohm=1e-4, machine__drs_ohm=(0.0,) * 6, machine__lls_H=1.0, machine__lxy_H=1.0,
)  # fmt: skip


@dataclass(frozen=True)
class Played:
    """The result. period: counts; edges: (n, 3) count since the first pattern, leg, level; mean_pu:
    (patterns, 4) mean alpha, beta, x, y voltage of each period [Vdc]; recording: the legs, and the
    mean voltages, which are constant over each period."""

    period: int
    edges: np.ndarray
    mean_pu: np.ndarray
    recording: Recording

    def levels(self, pattern: int, leg: int) -> list[tuple[int, int]]:
        """(count, level) at the start of a pattern's period and at each edge in it."""
        mine = self.edges[self.edges[:, 1] == leg]
        counts = mine[:, 0] - pattern * self.period
        before = mine[counts <= 0]
        inside = (counts > 0) & (counts < self.period)
        start = int(before[-1, 2]) if len(before) else 0
        return [(0, start), *zip(counts[inside].tolist(), mine[inside, 2].tolist(), strict=True)]

    def levels_at(self, pattern: int, count: float) -> list[int]:
        """Level of each leg directly after that count of a pattern's period."""
        return [
            [level for at, level in self.levels(pattern, leg) if at <= count][-1]
            for leg in range(6)
        ]


class _Bench(SimulatedDrive):
    """A simulation whose fast interrupt writes given patterns instead of its own decisions."""

    def __init__(self, patterns: Sequence, samples_per_period: int) -> None:
        super().__init__(SETUP, samples_per_period)
        port, left = self.controller.port, iter(patterns)

        self.failures: list[BaseException] = []
        failures = self.failures

        @ffi.callback("void(uint64_t)", onerror=lambda kind, error, trace: failures.append(error))
        def fast(handle):
            lib.ht_port_write(port, next(left, patterns[-1]))

        @ffi.callback("void(uint64_t)")
        def slow(handle):
            pass

        self._isr = fast, slow  # kept alive
        addresses = (int(ffi.cast("uintptr_t", isr)) for isr in self._isr)
        entries = (EntryPoint(address, 1) for address in addresses)
        self._entries = (*entries, self._entries[-1])
        lib.ht_port_gates_on(port, ALL_LEGS)
        m, words = self.controller.map, self.controller.register_words()
        # An ideal inverter without dead time. This bypasses the driver's checks.
        for leg in range(6):
            words[m.epwm + leg * m.stride + m.dbred] = 0
            words[m.epwm + leg * m.stride + m.dbfed] = 0


def period_counts() -> int:
    return round(1e-4 * lib.ht_f28335.pwm_clock_Hz)


def pattern(words: tuple[int, int, int], t1: float, t2: float) -> CData:
    """The firmware's registers for three state words and two action points."""
    compare, applied = ffi.new("ht_compare *"), ffi.new("ht_applied *")
    points = {"t1": t1, "t2": t2}
    period = ffi.new("ht_period *", {"counts": period_counts(), "shortest": 1})
    lib.ht_pattern_counts(words, points, period, compare, applied)
    return compare


def play(patterns: Sequence, samples_per_period: int = 4) -> Played:
    """Plays one pattern per period. The first one begins at time 0 of the result."""
    bench = _Bench(patterns, samples_per_period)
    bench.log_edges(100 * (len(patterns) + 1))
    # Shadow load: the first pattern acts in the next period.
    bench.run(bench.period_s, record=False)
    flux = [bench.plant_state[:4].copy()]
    for _ in patterns:
        bench.run(bench.period_s)
        flux.append(bench.plant_state[:4].copy())
    if bench.failures:
        raise bench.failures[0]
    if bench.controller.registers.violations:
        raise RuntimeError("the driver made an access that the chip refuses")
    mean_pu = np.diff(flux, axis=0) / (bench.period_s * bench.vdc_V)
    edges = bench.edges.copy()
    period = int(bench.controller.drive.config.control.period.counts)
    edges[:, 0] -= period
    return Played(period, edges, mean_pu, _recording(bench, mean_pu))


def _recording(bench: _Bench, mean_pu: np.ndarray) -> Recording:
    played = bench.take()
    gates = played["plant.gates"].astype(int)
    per = bench.samples_per_period
    channels = {
        f"plant.leg_{phase}": (gates >> 2 * (5 - leg) & 3).astype(np.int8)
        for leg, phase in enumerate(PHASES)
    }
    for column, axis in enumerate(("alpha", "beta", "x", "y")):
        channels[f"plant.v_{axis}_pu"] = np.repeat(mean_pu[:, column], per)
    phase_V = bench.vdc_V * mean_pu @ INVERSE.T
    for column, phase in enumerate(PHASES):
        channels[f"plant.v_{phase}_V"] = np.repeat(phase_V[:, column], per)
    units = {name: "Vdc" if name.endswith("_pu") else "" for name in channels}
    units |= {name: "V" for name in channels if name.endswith("_V")}
    meta = {key: played.meta[key] for key in ("hexatorque", "setup", "parameters")}
    return Recording(played.rate_Hz, channels, units, meta)


def with_cases(rec: Recording, **values: list) -> Recording:
    """A recording of patterns, with further channels that have one value per pattern."""
    held = {name: np.repeat(v, len(rec) // len(v)) for name, v in values.items()}
    return Recording(rec.rate_Hz, held | rec.channels, rec.units, rec.meta)


def lane(
    ax: Axes, played: Played, n: int, leg: int, base: float, colour: str, x0: float = 0.0
) -> None:
    """Draw one leg over the period of pattern n, from its edges. The period begins at x0."""
    counts, levels = zip(*played.levels(n, leg), strict=True)
    x = x0 + np.append(counts, played.period) / played.period
    y = base + 0.6 * np.append(levels, levels[-1])
    ax.step(x, y, where="post", color=colour, linewidth=1.3)
    ax.fill_between(x, base, y, step="post", color=colour, alpha=0.15, linewidth=0)
