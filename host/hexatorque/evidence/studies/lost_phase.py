"""Lost phases: is every loss found and named, does a healthy drive stay quiet, and does the drive
go on as it should.

Three campaigns on paper A's machine, with a 12-bit converter, 25 mA of noise, dead time, and a
controller whose resistance and x-y inductance are each wrong by up to 30 %:

found: a leg breaks, under every scheme, at a random instant, speed and load. The fault must name
that phase in time.
healthy: nothing breaks, but speed and load change in steps, and in most of the runs a sensor fails.
No phase may be called lost.
goes on: the drive goes on without the leg. Its steady state is judged; in some runs a second leg
breaks. Then the drive must stop, or hold its speed.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ... import firmware, setups
from ...analysis.metrics import torque_ripple_td_Nm
from ...analysis.spectrum import channel
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...experiments.prepare import magnetise
from ...plant.legs import KINDS
from ...plant.vsd import PHASES
from ..methods.carrier import steady_state
from ..methods.places import Place
from .grids import Grid
from .runs import each

TITLE = "Lost phases"
SETUP = "paper-a-feasible"
NOISE_A = 0.025
RATED_NM, RATED_RPM = 10.0, 900.0
#: Speeds and loads. A negative load drives the shaft.
SLOWEST_RPM, FASTEST_RPM = 30.0, 900.0
LEAST_NM, MOST_NM = -4.0, 10.0
#: Parameters that the controller has wrong, and by how much at most.
WRONG, WRONG_SHARE = ("rs_ohm", "lxy_H"), 0.3
BROKEN = KINDS[1:]
#: A run is watched in steps of this length.
STEP_S = 0.0005
#: Electrical periods within which a loss must be found: whole phase, one switch.
IN_TIME = {"open": 1.0, "blocked": 1.0, "upper": 1.5, "lower": 1.5}
#: Runs for every combination of scheme, phase and kind; healthy runs.
FOUND_RUNS, GOES_ON_RUNS, HEALTHY_RUNS = 5, 6, 1200
QUICK_STEP = 47
#: Every so many runs that go on lose a second leg.
SECOND_EVERY = 8
#: Torque that the remaining legs give, and the share of it with which the drive is loaded at most.
#: Under a switching table the mean torque is below its reference, and the reference is limited.
LEFT_NM, LOADED, LOADED_TABLE = 3.3, 0.9, 0.75
MODES = ("least-loss", "most-torque")
#: Time in which the drive settles after the loss, and of the measurement.
SETTLE_S, WINDOW_S, CYCLES = 1.5, 0.2, 2
#: Limits of the steady state without the leg: of the flux and the speed relative to their
#: references, of the torque's standard deviation, of the largest phase current relative to the
#: rated one, of the lost leg's current; and of the dip of the speed, from DIP_RPM on, up to DIP_NM.
#: The standard deviation may always be TD_NM, and TD_SHARE of what it was before the loss; but
#: under TD_SCHEME no more than TD_SCHEME_NM.
FLUX_PCT, SPEED_PCT, TD_NM, PHASE_SHARE, LEG_A, DIP_PCT = 3.0, 2.0, 0.15, 1.02, 0.05, 10.0
TD_SHARE, BEFORE_S = 1.2, 0.1
TD_SCHEME, TD_SCHEME_NM = "db-dtfc", 0.1
DIP_RPM, DIP_NM = 300.0, 3.0
DIP_LEAST_RPM = 2.0

LOST = firmware.FAULTS[firmware.PHASE_LOST]


@dataclass(frozen=True)
class Case:
    """One run. mode: the setting of ride_through. second: this leg breaks too."""

    seed: int
    scheme: str
    phase: str = ""
    kind: str = ""
    mode: str = "off"
    second: str = ""
    sensor: str = ""


@dataclass
class Result:
    """error: what was wrong, empty if nothing was."""

    case: Case
    speed_rpm: float
    load_Nm: float
    error: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def rated_A(setup: setups.Setup) -> float:
    """Phase current, r.m.s., at rated torque, speed and flux."""
    place = Place(SETUP, RATED_RPM, RATED_NM)
    return abs(steady_state(setup, place, setup.parameter("flux_ref_Wb")).i_A) / math.sqrt(2)


def drawn_setup(case: Case, rng: np.random.Generator) -> setups.Setup:
    base = setups.load(SETUP)
    wrong = {
        f"controller__{name}": base.parameter(name) * rng.uniform(1 - WRONG_SHARE, 1 + WRONG_SHARE)
        for name in WRONG
    }
    return base.changed(
        controller__scheme=case.scheme,
        controller__ride_through=case.mode,
        controller__i_rated_A=rated_A(base),
        sensors__i_noise_A=NOISE_A,
        load__kind="constant",
        **wrong,
    )


def drawn_rpm(rng: np.random.Generator) -> float:
    size = SLOWEST_RPM * (FASTEST_RPM / SLOWEST_RPM) ** rng.random()
    return float(rng.choice([-1, 1]) * size)


def period_s(sim: SimulatedDrive) -> float:
    """The period of the flux."""
    return 2 * math.pi / max(abs(sim.controller.channel("omega_sync_rad_s")), 1.0)


def _watch(sim: SimulatedDrive, seconds: float, progress: Progress | None) -> float:
    """Runs until the drive stops, or for this time. Returns the time that it ran."""
    begin_s = sim.time_s
    while sim.state == firmware.RUN and sim.time_s - begin_s < seconds:
        sim.run(STEP_S, record=False, progress=progress)
    return sim.time_s - begin_s


def started(setup: setups.Setup, progress: Progress | None) -> SimulatedDrive:
    """A drive at no load and full flux."""
    sim = SimulatedDrive(setup, 10)
    magnetise(sim, progress=progress)
    return sim


def settle_at(
    sim: SimulatedDrive, speed_rpm: float, load_Nm: float, progress: Progress | None
) -> None:
    """To a speed, then to a load, whose sign is relative to the speed's."""
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(0.15 + 0.5 * abs(speed_rpm) / FASTEST_RPM, record=False, progress=progress)
    sim.set("load_Nm", math.copysign(1.0, speed_rpm) * load_Nm)
    sim.run(0.4, record=False, progress=progress)


def _named(sim: SimulatedDrive, phase: str) -> str:
    """The mistakes in the fault and its warnings."""
    snapshot = sim.snapshot
    if sim.state != firmware.FAULT or snapshot is None:
        return "not found"
    if LOST not in snapshot["faults"]:
        return f"stopped by {', '.join(snapshot['faults'])}"
    if f"phase {phase} lost" not in snapshot["warnings"]:
        return f"named {', '.join(snapshot['warnings'])}"
    return ""


def _found(
    result: Result, sim: SimulatedDrive, rng: np.random.Generator, progress: Progress | None
) -> None:
    """A leg breaks; the drive must stop and name the phase."""
    case = result.case
    one_s = period_s(sim)
    after_s = float(rng.uniform(0, min(one_s, 0.1)))
    sim.break_leg(case.phase, case.kind, after_s)
    taken_s = _watch(sim, after_s + 3 * one_s + 0.1, progress) - after_s
    result.error = _named(sim, case.phase)
    result.figures = {"found_ms": 1e3 * taken_s, "periods": taken_s / one_s}
    if not result.error and taken_s / one_s > IN_TIME[case.kind]:
        result.error = f"found after {taken_s / one_s:.2f} electrical periods"


SENSORS = ("none", "stands still", "zero jumps", "gain", "at its limit", "encoder lost")


def _fail(sim: SimulatedDrive, sensor: str, rng: np.random.Generator) -> None:
    leg, sensors = int(rng.integers(6)), sim.sensors
    if sensor == "stands still":
        sensors.hold[leg] = 1
    elif sensor == "encoder lost":
        sensors.hold[7] = 1
    elif sensor == "gain":
        sensors.i_counts_per_A[leg] *= rng.uniform(0.9, 1.1)
    elif sensor in ("zero jumps", "at its limit"):
        share = rng.uniform(0.1, 1.5) * sim.controller.number("i_sum_trip_A")
        counts = share / sim.controller.drive.i_per_count if sensor == "zero jumps" else 1e4
        sensors.i_offset_counts[leg] += rng.choice([-1, 1]) * counts


def _healthy(
    result: Result, sim: SimulatedDrive, rng: np.random.Generator, progress: Progress | None
) -> None:
    """Reversals and load steps, then a sensor fails; no phase may be called lost."""
    sim.set("speed_ref_rpm", drawn_rpm(rng))
    sim.run(float(rng.uniform(0.1, 0.5)), record=False, progress=progress)
    sim.set("load_Nm", float(rng.uniform(-MOST_NM, MOST_NM)))
    sim.run(0.3, record=False, progress=progress)
    _fail(sim, result.case.sensor, rng)
    _watch(sim, 0.4, progress)
    if LOST in sim.faults:
        result.error = f"called lost: {', '.join(sim.snapshot['warnings'] if sim.snapshot else ())}"


def steady(sim: SimulatedDrive, speed_rpm: float, phase: str) -> dict[str, float]:
    rec = sim.take()
    rms_A = {name: float(np.sqrt(np.mean(channel(rec, f"i_{name}_A") ** 2))) for name in PHASES}
    flux_Wb = np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"])
    reference_Wb = sim.controller.channel("flux_ref_Wb")
    lost_A = rms_A.pop(phase)
    return {
        "flux_pct": 100 * abs(float(np.mean(flux_Wb)) / reference_Wb - 1),
        "speed_pct": 100 * abs(float(np.mean(rec["plant.speed_rpm"])) / speed_rpm - 1),
        "td_Nm": torque_ripple_td_Nm(rec),
        "phase_share": max(rms_A.values()) / sim.controller.number("i_rated_A"),
        "lost_A": lost_A,
        "flux_Wb": reference_Wb,
        "limit_Nm": sim.controller.channel("torque_limit_Nm"),
    }


LIMITS = {
    "flux_pct": FLUX_PCT, "speed_pct": SPEED_PCT, "td_Nm": TD_NM, "phase_share": PHASE_SHARE,
    "lost_A": LEG_A,
}  # fmt: skip


def _second_named(sim: SimulatedDrive, case: Case) -> float:
    """1: the warnings name both phases; 0: the first one alone; -1: a wrong one."""
    snapshot = sim.snapshot
    if sim.state != firmware.FAULT or snapshot is None or LOST not in sim.faults:
        return 0.0
    named = {phase for phase in PHASES if f"phase {phase} lost" in snapshot["warnings"]}
    if named == {case.phase}:
        return 0.0
    return 1.0 if named == {case.phase, case.second} else -1.0


def most_load_Nm(scheme: str) -> float:
    """Largest load with which a drive is to go on. What is left is known only afterwards; beyond it
    the drive would slow down, as it should."""
    return (LOADED_TABLE if scheme in firmware.table_schemes() else LOADED) * LEFT_NM


def _goes_on(
    result: Result, sim: SimulatedDrive, rng: np.random.Generator, progress: Progress | None
) -> None:
    """A leg breaks; the drive must go on."""
    case, speed_rpm, load_Nm = result.case, result.speed_rpm, result.load_Nm
    sim.run(BEFORE_S, progress=progress)
    before_Nm = torque_ripple_td_Nm(sim.take())
    sim.break_leg(case.phase, case.kind, float(rng.uniform(0, min(period_s(sim), 0.1))))
    least = 1.0
    begin_s = sim.time_s
    while sim.state == firmware.RUN and sim.time_s - begin_s < SETTLE_S:
        sim.run(0.005, record=False, progress=progress)
        least = min(least, sim.speed_rpm / speed_rpm)
    if sim.state != firmware.RUN:
        result.error = f"stopped: {', '.join(sim.faults)}"
        return
    if case.second:
        sim.break_leg(case.second, case.kind)
        _watch(sim, 3 * period_s(sim) + 0.1, progress)
        result.figures = {
            "stopped": float(sim.state == firmware.FAULT),
            "named": float(LOST in sim.faults),
            "right": _second_named(sim, case),
        }
        if result.figures["right"] < 0:
            result.error = f"named {', '.join(sim.snapshot['warnings'] if sim.snapshot else ())}"
        off_rpm = abs(sim.speed_rpm - speed_rpm)
        most_rpm = max(SPEED_PCT / 100 * abs(speed_rpm), DIP_LEAST_RPM)
        if sim.state != firmware.FAULT and off_rpm > most_rpm:
            result.error = f"{sim.speed_rpm:.0f} r/min after a second loss ({case.second})"
        return
    sim.run(max(WINDOW_S, CYCLES * period_s(sim)), progress=progress)
    result.figures = steady(sim, speed_rpm, case.phase) | {
        "dip_pct": float(100 * (1 - least)),
        "before_Nm": before_Nm,
    }
    td_Nm = TD_SCHEME_NM if case.scheme == TD_SCHEME else max(TD_NM, TD_SHARE * before_Nm)
    limits = LIMITS | {"td_Nm": td_Nm}
    wrong = [
        f"{name} {result.figures[name]:.3g}"
        for name, limit in limits.items()
        if not result.figures[name] <= limit
    ]
    judged = abs(speed_rpm) >= DIP_RPM and abs(load_Nm) <= DIP_NM
    if judged and not result.figures["dip_pct"] <= DIP_PCT:
        wrong.append(f"dip_pct {result.figures['dip_pct']:.3g}")
    result.error = ", ".join(wrong)


def _second(phase: str, mode: str, n: int) -> str:
    """The phase that is lost next: any, but not the one that most torque has switched off."""
    beyond = (2, 4) if mode == "most-torque" else (1, 2, 3, 4, 5)
    return PHASES[(PHASES.index(phase) + beyond[n % len(beyond)]) % 6]


def cases(quick: bool) -> dict[str, list[Case]]:
    step = QUICK_STEP if quick else 1
    losses = [(phase, kind) for phase in PHASES for kind in BROKEN]
    first = [
        (scheme, *loss)
        for _ in range(FOUND_RUNS)
        for scheme in firmware.schemes()
        for loss in losses
    ]
    on = [
        (scheme, *loss)
        for _ in range(GOES_ON_RUNS)
        for scheme in firmware.schemes()
        for loss in losses
    ]
    each_loss = len(losses) * len(firmware.schemes())
    # From round to round the modes change over, and so do the runs with a second loss.
    modes = [MODES[(n + n // each_loss) % 2] for n in range(len(on))]
    seconds = [
        _second(loss[1], mode, n // SECOND_EVERY)
        if (n + n // each_loss) % SECOND_EVERY == 0
        else ""
        for n, (loss, mode) in enumerate(zip(on, modes))
    ]
    return {
        "found": [Case(n, *loss) for n, loss in enumerate(first)][::step],
        "healthy": [
            Case(
                10_000 + n,
                firmware.schemes()[n % len(firmware.schemes())],
                sensor=SENSORS[n // len(firmware.schemes()) % len(SENSORS)],
            )
            for n in range(HEALTHY_RUNS)
        ][::step],
        "goes on": [
            Case(20_000 + n, *loss, mode, second)
            for n, (loss, mode, second) in enumerate(zip(on, modes, seconds))
        ][::step],
    }


RUN = {"found": _found, "healthy": _healthy, "goes on": _goes_on}


def run(campaign: str, case: Case, progress: Progress | None = None) -> Result:
    """One run of a campaign, with an error too if the gates got a forbidden command."""
    rng = np.random.default_rng(case.seed)
    speed_rpm = drawn_rpm(rng)
    if case.mode == "off":
        load_Nm = float(rng.uniform(LEAST_NM, MOST_NM))
    else:
        load_Nm = float(rng.uniform(-1.0, 1.0)) * most_load_Nm(case.scheme)
    result = Result(case, speed_rpm, load_Nm)
    sim = started(drawn_setup(case, rng), progress)
    settle_at(sim, speed_rpm, load_Nm, progress)
    if sim.state != firmware.RUN:
        result.error = f"{sim.state} before the loss: {', '.join(sim.faults)}"
    else:
        RUN[campaign](result, sim, rng, progress)
    result.error = result.error or sim.gate_mistake
    return result


def row(task: tuple[str, Case], progress: Progress | None = None) -> dict:
    """One run of a campaign."""
    return {"campaign": task[0], **asdict(run(*task, progress))}


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    tasks = [(name, case) for name, own in cases(quick).items() for case in own]
    rows = each(row, tasks, folder, progress)
    return {"quick": quick, "rated_A": rated_A(setups.load(SETUP)), "rows": rows}


def failures(result: dict) -> list[str]:
    return [
        f"{row['campaign']}, {_words(row['case'])}, {row['speed_rpm']:.0f} r/min, "
        f"{row['load_Nm']:.1f} N m: {row['error']}"
        for row in result["rows"]
        if row["error"]
    ]


def _words(case: dict) -> str:
    return " ".join(filter(None, (case["scheme"], case["phase"], case["kind"] or case["sensor"])))


def _of(result: dict, campaign: str) -> list[dict]:
    return [row for row in result["rows"] if row["campaign"] == campaign]


def _found_table(result: dict) -> tuple[str, list[str], list[list[str]]]:
    lines = []
    for kind in BROKEN:
        rows = [row for row in _of(result, "found") if row["case"]["kind"] == kind]
        times = [row["figures"]["found_ms"] for row in rows if not row["error"]]
        periods = [row["figures"]["periods"] for row in rows if not row["error"]]
        named = sum(not row["error"] for row in rows)
        cells = [f"{np.median(times):.1f} ms", f"{max(periods):.2f}"] if times else ["–", "–"]
        lines.append([kind, f"{named} of {len(rows)}", *cells])
    heads = ["leg", "phase named in time", "median time", "longest, electrical periods"]
    return "A leg breaks; the drive stops", heads, lines


def _healthy_table(result: dict) -> tuple[str, list[str], list[list[str]]]:
    lines = []
    for sensor in SENSORS:
        rows = [row for row in _of(result, "healthy") if row["case"]["sensor"] == sensor]
        lines.append([sensor, str(len(rows)), str(sum(bool(row["error"]) for row in rows))])
    heads = ["current sensor or encoder", "runs", "phase called lost"]
    return "Nothing is broken: reversals, load steps, failing sensors", heads, lines


def _goes_on_table(result: dict) -> tuple[str, list[str], list[list[str]]]:
    lines = []
    for scheme in firmware.schemes():
        for kind in BROKEN:
            rows = [
                row
                for row in _of(result, "goes on")
                if row["case"]["scheme"] == scheme and row["case"]["kind"] == kind
            ]
            one = [row for row in rows if "td_Nm" in row["figures"]]
            second = [row["figures"] for row in rows if "stopped" in row["figures"]]
            worst = [
                f"{max(r['figures'][name] for r in one):.3g}" if one else "–"
                for name in (*LIMITS, "before_Nm")
            ]
            dips = [r["figures"]["dip_pct"] for r in one if abs(r["speed_rpm"]) >= DIP_RPM]
            stopped, named, right = (
                int(sum(f[key] > 0 for f in second)) for key in ("stopped", "named", "right")
            )
            lines.append(
                [
                    scheme, kind, f"{sum(not row['error'] for row in rows)} of {len(rows)}", *worst,
                    f"{max(dips):.1f}" if dips else "–",
                    f"{stopped} ({named}, {right}) of {len(second)}",
                ]
            )  # fmt: skip
    heads = [
        "scheme", "leg", "as it should be", "flux off [%]", "speed off [%]",
        "torque deviation [N m]", "largest phase, of rated", "lost leg [A]",
        "torque deviation before [N m]", f"dip from {DIP_RPM:g} r/min on [%]",
        "second loss: stopped (by phase lost, phase named)",
    ]  # fmt: skip
    return "A leg breaks; the drive goes on: the worst of all runs", heads, lines


def grid(result: dict) -> Grid:
    return [_found_table(result), _healthy_table(result), _goes_on_table(result)]


def plot(result: dict, path: Path) -> Path:
    """Draws the time to the fault over the speed, and the dip of the speed when the drive goes
    on."""
    from ...analysis import plots

    figure, axes = plots.new_figure(1, 2, 4.2)
    left, right = axes[0]
    marks = dict(zip(BROKEN, ("o", "s", "^", "v")))
    colours = dict(zip(BROKEN, ("#0072b2", "#56b4e9", "#d55e00", "#e69f00")))
    for kind in BROKEN:
        rows = [r for r in _of(result, "found") if r["case"]["kind"] == kind and not r["error"]]
        left.plot([abs(r["speed_rpm"]) for r in rows], [r["figures"]["found_ms"] for r in rows],
                  marks[kind], ms=3, color=colours[kind], label=kind)  # fmt: skip
        rows = [
            r
            for r in _of(result, "goes on")
            if r["case"]["kind"] == kind and "dip_pct" in r["figures"]
        ]
        right.plot([abs(r["speed_rpm"]) for r in rows], [r["figures"]["dip_pct"] for r in rows],
                   marks[kind], ms=3, color=colours[kind])  # fmt: skip
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_xlabel("speed [r/min]", **plots.LABEL)
    left.set_yscale("log")
    left.set_ylabel("from the loss to the fault [ms]", **plots.LABEL)
    right.set_ylabel("dip of the speed [%]", **plots.LABEL)
    left.legend(**plots.LEGEND)
    figure.suptitle(
        "A leg is lost: how soon it is found, and how far the speed dips", **plots.TITLE
    )
    return plots.save(figure, path)
