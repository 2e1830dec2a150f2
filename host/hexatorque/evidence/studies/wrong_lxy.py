"""Phases that are lost while the firmware believes a wrong L_xy: is the right leg named?

The evidence of a lost leg is the voltage that the measured x-y current does not explain, and L_xy
explains it. The machine's L_xy is drawn around the set-up's, and the firmware is told so many times
that. Everything else is as in the campaign of lost phases; an open phase has an arc, whose voltage
is drawn as in the study of arcs.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ... import firmware, setups
from ...drive.interface import Progress
from ...plant.vsd import PHASES
from . import arcs, lost_phase
from .grids import Grid
from .runs import each

TITLE = "Phases lost while L_xy is believed wrong"
#: What the firmware believes, over the machine's own.
BELIEFS = (1 - lost_phase.WRONG_SHARE, 1.0, 1 + lost_phase.WRONG_SHARE)
#: The machine's L_xy over the set-up's.
TRUTHS = (0.7, 1.3)
FIRST_SEED = 50_000
QUICK_STEP = 47


@dataclass(frozen=True)
class Case:
    seed: int
    belief: float
    scheme: str
    phase: str
    kind: str


@dataclass
class Result:
    """outcome: as in the study of arcs. error: what was wrong, empty if nothing was."""

    case: Case
    lxy_H: float
    arc_V: float
    speed_rpm: float
    load_Nm: float
    outcome: str = "other"
    error: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def _setup(case: Case, rng: np.random.Generator) -> setups.Setup:
    lost = lost_phase.Case(case.seed, case.scheme, case.phase, case.kind)
    setup = lost_phase.drawn_setup(lost, rng)
    lxy_H = setup["machine.lxy_H"] * float(rng.uniform(*TRUTHS))
    return setup.changed(
        machine__lxy_H=lxy_H,
        controller__lxy_H=case.belief * lxy_H,
        inverter__arc_V=arcs.drawn(rng, arcs.LEAST_V, arcs.MOST_VDC * setup["inverter.vdc_V"]),
    )


def run(case: Case, progress: Progress | None = None) -> Result:
    """One run, with an error too if the gates got a forbidden command."""
    rng = np.random.default_rng(case.seed)
    setup = _setup(case, rng)
    speed_rpm = lost_phase.drawn_rpm(rng)
    load_Nm = float(rng.uniform(lost_phase.LEAST_NM, lost_phase.MOST_NM))
    result = Result(case, setup["machine.lxy_H"], setup["inverter.arc_V"], speed_rpm, load_Nm)
    sim = lost_phase.started(setup, progress)
    lost_phase.settle_at(sim, speed_rpm, load_Nm, progress)
    if sim.state != firmware.RUN:
        result.error = f"{sim.state} before the loss: {', '.join(sim.faults)}"
        return result
    arcs.lose(result, sim, case.kind, 0.0, rng, progress)
    if sim.gate_mistake:
        result.outcome, result.error = "gates", sim.gate_mistake
    return result


def cases(quick: bool) -> list[Case]:
    """Every belief with every leg, kind and scheme, each with a seed of its own."""
    every = [
        (belief, scheme, phase, kind)
        for belief in BELIEFS
        for kind in lost_phase.BROKEN
        for phase in PHASES
        for scheme in firmware.schemes()
    ]
    made = [Case(FIRST_SEED + n, *one) for n, one in enumerate(every)]
    return made[:: QUICK_STEP if quick else 1]


def row(case: Case, progress: Progress | None = None) -> dict:
    return asdict(run(case, progress))


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    return {"quick": quick, "rows": each(row, cases(quick), folder, progress)}


def failures(result: dict) -> list[str]:
    """Mistakes of the gates. How often the right leg is named is told, without a limit."""
    return [
        f"L_xy believed {row['case']['belief']:.1f} times, {row['case']['scheme']} "
        f"{row['case']['phase']} {row['case']['kind']}: {row['error']}"
        for row in result["rows"]
        if row["outcome"] == "gates"
    ]


def grid(result: dict) -> Grid:
    lines = [
        [f"{belief:.1f}", *arcs.named_cells(rows)]
        for belief in BELIEFS
        if (rows := [row for row in result["rows"] if row["case"]["belief"] == belief])
    ]
    heads = [
        "L_xy, believed over true", "right phase named", "a sound one", "none",
        "median time [ms]", "longest, electrical periods",
    ]  # fmt: skip
    return [("A leg breaks while L_xy is believed wrong", heads, lines)]


def plot(result: dict, path: Path) -> Path:
    """Draws the time until the phase is named over the speed."""
    right = [row for row in result["rows"] if row["outcome"] == "right"]
    groups = {
        f"{belief:.1f} times": [
            (abs(row["speed_rpm"]), arcs.found_ms(row))
            for row in right
            if row["case"]["belief"] == belief
        ]
        for belief in BELIEFS
    }
    title = "How soon a lost leg is named, by the belief of L_xy"
    return arcs.draw(groups, "speed [r/min]", "from the loss to the fault [ms]", title, path)
