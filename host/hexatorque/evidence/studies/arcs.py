"""Phases that open with an arc: does the firmware name the right one while the arc still burns, is
no sound leg ever switched off, and does the drive go on?

Paper A's machine, sensors and wrong parameters as in the campaign of lost phases. The arc's voltage
is drawn from that of a parting contact to that of a fuse. In half of the runs the arc strikes again
after it has ended, in half of them the contact bounces.

stops: a phase opens, at a random instant, speed and load. The fault must name it.
goes on: with `ride_through`. The lost leg is switched off, and no other but the one that most
torque does without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ... import firmware, setups
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...plant.vsd import PHASES
from . import lost_phase
from .grids import Grid
from .runs import each

TITLE = "Phases that open with an arc"
#: Voltage of the arc: from this to so many times V_dc.
LEAST_V, MOST_VDC = 5.0, 2.0
#: What the contact withstands grows at this rate, from it to so many times it; time for which a
#: contact bounces.
RESTRIKE_V_PER_MS, RESTRIKES = 3.0, 300.0
BOUNCE_MS = (1.0, 20.0)
#: Runs for each scheme.
STOPS, GOES_ON = 234, 156
QUICK_STEP = 79
#: Electrical periods, and seconds after them and the bouncing, for which a run is watched.
WATCH, WATCH_S = 3.0, 0.1
#: Least share of the runs, %: right phase named, and gone on. No sound leg may be named or switched
#: off because it is (`failures`).
NAMED_PCT, GONE_ON_PCT = 99.5, 99.5
#: Time in which the drive settles without the leg, and of the measurement.
SETTLE_S, WINDOW_S = lost_phase.SETTLE_S, lost_phase.WINDOW_S
MARKS, COLOURS = ("o", "s", "^", "v"), ("#0072b2", "#56b4e9", "#d55e00", "#e69f00")
#: Bands of the arc's voltage in the tables.
BANDS = ((5.0, 15.0), (15.0, 60.0), (60.0, 300.0), (300.0, math.inf))


@dataclass(frozen=True)
class Case:
    """One run. mode: the setting of ride_through."""

    seed: int
    scheme: str
    phase: str
    mode: str = "off"


@dataclass
class Result:
    """outcome: `right`, `sound` (a sound phase was named), `late` (none was named), `gates` (they
    got a forbidden command) or `other` (another check stopped the drive).
    error: what was wrong, empty if nothing was."""

    case: Case
    arc_V: float
    restrike_V_per_ms: float
    bounce_ms: float
    speed_rpm: float
    load_Nm: float
    outcome: str = ""
    error: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def drawn(rng: np.random.Generator, least: float, most: float) -> float:
    return least * (most / least) ** float(rng.random())


def _begun(
    case: Case, rng: np.random.Generator, progress: Progress | None
) -> tuple[Result, SimulatedDrive]:
    """The drive at its speed and load."""
    lost = lost_phase.Case(case.seed, case.scheme, case.phase, "open", case.mode)
    setup = lost_phase.drawn_setup(lost, rng)
    speed_rpm = lost_phase.drawn_rpm(rng)
    if case.mode == "off":
        load_Nm = float(rng.uniform(lost_phase.LEAST_NM, lost_phase.MOST_NM))
    else:
        load_Nm = float(rng.uniform(-1.0, 1.0)) * lost_phase.most_load_Nm(case.scheme)
    result = Result(
        case,
        drawn(rng, LEAST_V, MOST_VDC * float(setup["inverter.vdc_V"])),
        drawn(rng, RESTRIKE_V_PER_MS, RESTRIKES * RESTRIKE_V_PER_MS) * int(rng.integers(2)),
        drawn(rng, *BOUNCE_MS) * int(rng.integers(2)),
        speed_rpm,
        load_Nm,
    )
    setup = setup.changed(
        inverter__arc_V=result.arc_V,
        inverter__restrike_V_per_ms=result.restrike_V_per_ms,
        inverter__bounce_ms=result.bounce_ms,
    )
    sim = lost_phase.started(setup, progress)
    lost_phase.settle_at(sim, speed_rpm, load_Nm, progress)
    return result, sim


def _named(sim: SimulatedDrive) -> set[str]:
    """The phases that the warnings name."""
    word = int(sim.controller.channel("warnings"))
    return {phase for leg, phase in enumerate(PHASES) if word & (32 >> leg)}


def _outcome(sim: SimulatedDrive, phase: str) -> str:
    named = _named(sim)
    if named:
        return "right" if named == {phase} else "sound"
    return "other" if sim.state == firmware.FAULT else "late"


def _off(sim: SimulatedDrive) -> int:
    """Legs that are switched off by themselves, a state word."""
    port = sim.controller.port
    return sum(32 >> leg for leg in range(6) if firmware.lib.ht_port_leg_tripped(port, leg))


def run(case: Case, progress: Progress | None = None) -> Result:
    """One run, with an error too if the gates got a forbidden command."""
    rng = np.random.default_rng(case.seed)
    result, sim = _begun(case, rng, progress)
    if sim.state != firmware.RUN:
        result.outcome = "other"
        result.error = f"{sim.state} before the loss: {', '.join(sim.faults)}"
    else:
        lose(result, sim, "open", 1e-3 * result.bounce_ms, rng, progress)
        if result.outcome == "right" and case.mode != "off":
            _go_on(result, sim, progress)
    if sim.gate_mistake:
        result.outcome, result.error = "gates", sim.gate_mistake
    return result


def lose(
    result: Any,
    sim: SimulatedDrive,
    kind: str,
    bounce_s: float,
    rng: np.random.Generator,
    progress: Progress | None,
) -> None:
    """The leg of the case breaks, and the run is watched until a phase is named, or for so long.
    What is named goes into the result."""
    period_s = lost_phase.period_s(sim)
    after_s = float(rng.uniform(0, min(period_s, 0.1)))
    sim.break_leg(result.case.phase, kind, after_s)
    longest_s = after_s + WATCH * period_s + bounce_s + WATCH_S
    begin_s = sim.time_s
    while not _named(sim) and sim.state == firmware.RUN and sim.time_s - begin_s < longest_s:
        sim.run(lost_phase.STEP_S, record=False, progress=progress)
    taken_s = sim.time_s - begin_s - after_s
    result.outcome = _outcome(sim, result.case.phase)
    result.figures = {"found_ms": 1e3 * taken_s, "periods": taken_s / period_s}
    if result.outcome != "right":
        result.error = f"{result.outcome}: {_told(sim)}"


def _told(sim: SimulatedDrive) -> str:
    named = _named(sim)
    return ", ".join([*sim.faults, *(f"{phase} named" for phase in sorted(named))]) or "nothing"


def _go_on(result: Result, sim: SimulatedDrive, progress: Progress | None) -> None:
    case = result.case
    lost = 32 >> PHASES.index(case.phase)
    allowed = (
        firmware.lib.ht_lost_legs_paired(firmware.lib.HT_WINDING_30, lost)
        if case.mode == "most-torque"
        else lost
    )
    begin_s = sim.time_s
    while sim.state == firmware.RUN and sim.time_s - begin_s < SETTLE_S:
        sim.run(0.005, record=False, progress=progress)
    if sim.state == firmware.RUN:
        window_s = max(WINDOW_S, lost_phase.CYCLES * lost_phase.period_s(sim))
        sim.run(window_s, progress=progress)
    if sim.state != firmware.RUN:
        result.error = f"stopped: {_told(sim)}"
        return
    result.figures["sound_off"] = float((_off(sim) & ~allowed).bit_count())
    result.figures |= lost_phase.steady(sim, result.speed_rpm, case.phase)
    wrong = [
        f"{name} {result.figures[name]:.3g}"
        for name in ("flux_pct", "speed_pct", "lost_A")
        if not result.figures[name] <= lost_phase.LIMITS[name]
    ]
    if result.figures["sound_off"]:
        wrong.append("a sound leg is off")
    result.error = ", ".join(wrong)


def cases(quick: bool) -> dict[str, list[Case]]:
    step = QUICK_STEP if quick else 1
    schemes = firmware.schemes()

    def drawn(first: int, runs: int, modes: tuple[str, ...]) -> list[Case]:
        return [
            Case(
                first + n * len(schemes) + m,
                scheme,
                PHASES[(n + m) % len(PHASES)],
                modes[(n // len(PHASES) + m) % len(modes)],
            )
            for n in range(runs)
            for m, scheme in enumerate(schemes)
        ][::step]

    return {
        "stops": drawn(30_000, STOPS, ("off",)),
        "goes on": drawn(40_000, GOES_ON, lost_phase.MODES),
    }


def row(task: tuple[str, Case], progress: Progress | None = None) -> dict:
    """One run of a campaign."""
    return {"campaign": task[0], **asdict(run(task[1], progress))}


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    tasks = [(name, case) for name, own in cases(quick).items() for case in own]
    rows = each(row, tasks, folder, progress)
    vdc_V = setups.load(lost_phase.SETUP)["inverter.vdc_V"]
    return {"quick": quick, "vdc_V": vdc_V, "rows": rows}


def _of(result: dict, campaign: str) -> list[dict]:
    return [row for row in result["rows"] if row["campaign"] == campaign]


def _pct(part: int, of: list) -> float:
    return 100.0 * part / len(of) if of else 100.0


def failures(result: dict) -> list[str]:
    """A sound phase that is named is a failure, and so is a mistake of the gates. Every other error
    is one if there are too many."""
    rows = result["rows"]
    named = sum(row["outcome"] == "right" for row in rows)
    on = _of(result, "goes on")
    gone_on = sum(not row["error"] for row in on)
    enough = _pct(named, rows) >= NAMED_PCT and _pct(gone_on, on) >= GONE_ON_PCT
    return [
        f"{row['campaign']}, {row['case']['scheme']} {row['case']['phase']}, "
        f"arc {row['arc_V']:.0f} V, {row['speed_rpm']:.0f} r/min, {row['load_Nm']:.1f} N m: "
        f"{row['error']}"
        for row in rows
        if row["error"]
        and (row["outcome"] in ("sound", "gates") or row["figures"].get("sound_off") or not enough)
    ]


def _words(band: tuple[float, float]) -> str:
    least, most = band
    return f"{least:g} to {most:g}" if most < math.inf else f"{least:g} and more"


def _lines(rows: list[dict], key: Callable[[dict], str], order: Sequence[str]) -> list[tuple]:
    return [(name, [row for row in rows if key(row) == name]) for name in order]


def _band(row: dict) -> str:
    return next(_words(band) for band in BANDS if row["arc_V"] < band[1])


def _kind(row: dict) -> str:
    bounces, strikes = row["bounce_ms"] > 0, row["restrike_V_per_ms"] > 0
    return KINDS[2 * bounces + strikes]


KINDS = ("ends once", "strikes again", "bounces", "bounces and strikes again")


def named_cells(rows: list[dict]) -> list[str]:
    count = {
        outcome: sum(row["outcome"] == outcome for row in rows)
        for outcome in ("right", "sound", "late", "gates", "other")
    }
    right = [row["figures"] for row in rows if row["outcome"] == "right"]
    times = (
        [
            f"{np.median([f['found_ms'] for f in right]):.1f}",
            f"{max(f['periods'] for f in right):.2f}",
        ]
        if right
        else ["–", "–"]
    )
    return [
        f"{count['right']} of {len(rows)}",
        str(count["sound"]),
        str(count["late"] + count["gates"] + count["other"]),
        *times,
    ]


def grid(result: dict) -> Grid:
    bands = [_words(band) for band in BANDS]
    every = result["rows"]
    by_band, by_kind = _lines(every, _band, bands), _lines(every, _kind, KINDS)
    heads = [
        "arc [V]", "right phase named", "a sound one", "none", "median time [ms]",
        "longest, electrical periods",
    ]  # fmt: skip
    on = _of(result, "goes on")
    schemes = [
        [
            scheme,
            f"{sum(not row['error'] for row in rows)} of {len(rows)}",
            str(sum(row["outcome"] == "sound" for row in rows)),
        ]
        for scheme, rows in _lines(on, lambda row: row["case"]["scheme"], firmware.schemes())
    ]
    return [
        ("A phase opens with an arc", heads, [[n, *named_cells(r)] for n, r in by_band if r]),
        (
            "The same, by what the contact does",
            ["contact", *heads[1:]],
            [[n, *named_cells(r)] for n, r in by_kind if r],
        ),
        (
            "The drive goes on",
            ["scheme", "as it should be", "a sound leg switched off"],
            schemes,
        ),
    ]


def draw(
    groups: dict[str, list[tuple[float, float]]], across: str, up: str, title: str, path: Path
) -> Path:
    """Draws the points of each group, on two logarithmic scales."""
    from ...analysis import plots

    figure, axes = plots.new_figure(1, 1, 4.2)
    axis = axes[0][0]
    for (name, points), mark, colour in zip(groups.items(), MARKS, COLOURS):
        axis.plot(
            [x for x, _ in points], [y for _, y in points], mark, ms=3, color=colour, label=name
        )
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel(across, **plots.LABEL)
    axis.set_ylabel(up, **plots.LABEL)
    axis.legend(**plots.LEGEND)
    figure.suptitle(title, **plots.TITLE)
    return plots.save(figure, path)


def found_ms(row: dict) -> float:
    """The time until the phase was named, as far as a logarithmic scale shows it."""
    return max(row["figures"]["found_ms"], 0.1)


def plot(result: dict, path: Path) -> Path:
    """Draws the time until the phase is named over the arc's voltage."""
    right = [row for row in result["rows"] if row["outcome"] == "right"]
    groups = {
        kind: [(row["arc_V"], found_ms(row)) for row in right if _kind(row) == kind]
        for kind in KINDS
    }
    up = "until the phase is named [ms]"
    return draw(groups, "voltage of the arc [V]", up, "A phase opens with an arc", path)
