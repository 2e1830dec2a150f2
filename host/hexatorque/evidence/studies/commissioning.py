"""Commissioning of machines of all sizes: how near to the truth it comes, and whether it names what
is wired wrongly.

The machines, and what is known of each beforehand, are those of the module `plates`: the
controller was designed from the plate alone. Added are noise, offsets and gains of the current
sensors, devices that drop voltage, stators whose phases differ, and dry friction. Then the built-in
set-ups, with a controller that knows their machines by -30 to +50 %. Limits are those of the
command's defaults.

Last, every wrong wiring on every built-in set-up.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ... import setups
from ...commissioning.excitation import Limits
from ...commissioning.kinds import INDUCTION
from ...commissioning.sequence import commission, default_current_A
from ...drive.simulated import SimulatedDrive
from ...errors import HexatorqueError
from ...experiments.operating_points import Progress
from ...parallel import in_order
from ...plant.vsd import PHASES, inverse
from ...setups import Setup
from ...setups.design import Design
from . import plates
from .grids import Grid

TITLE = "Commissioning: errors of what it finds"
QUICK = 1
BUILT_IN = ("paper-a-feasible", "paper-b", "small-2kw", "large-110kw")
WORST = "R_s of the worst phase"
#: Allowed errors, % of the true value: a share of the machines must keep each.
ALLOWED = {
    "R_s": 2.0,
    WORST: 2.0,
    "dead-time voltage": 10.0,
    "σL_s": 5.0,
    "L_xy": 5.0,
    "R_r": 10.0,
    "L_m": 5.0,
    "J": 5.0,
}
SHARE = 0.95
#: Share of the true values that must lie within the stated uncertainty.
HOLDS = 0.90
#: What the controller of a built-in set-up believes, over the truth.
BELIEVED = {
    "rs_ohm": 1.3, "rr_ohm": 0.7, "sigma_ls_H": 0.7, "lxy_H": 1.5, "lm_H": 0.8, "lr_H": 0.8,
}  # fmt: skip
TRAVEL_REV = 0.1


def disturbed(setup: Setup, number: int) -> Setup:
    """The same with all that disturbs a measurement, drawn from the number."""
    draw = random.Random(number)
    full_A = setup["sensors.i_full_A"]

    def six(size: float) -> list[float]:
        values = [draw.uniform(-size, size) for _ in range(6)]
        return [value - sum(values) / 6 for value in values]

    changes = {
        "sensors.i_noise_A": 1e-3 * full_A,
        "sensors.noise_seed": number + 1,
        "sensors.i_offset_A": [0.01 * full_A * draw.uniform(-1, 1) for _ in range(6)],
        "sensors.i_gain": [1 + draw.uniform(-0.005, 0.005) for _ in range(6)],
        "inverter.v_switch_V": draw.uniform(0.8, 1.6),
        "inverter.v_diode_V": draw.uniform(0.7, 1.4),
        "inverter.r_switch_ohm": draw.uniform(0.5, 1.5) / full_A,
        "inverter.r_diode_ohm": draw.uniform(0.5, 1.5) / full_A,
        "load.kind": "friction",
        "controller.drop_V": 0.0,
    }
    for added, to in (("machine.drs_ohm", "machine.rs_ohm"), ("machine.dlls_H", "machine.lls_H")):
        if added in setup:
            changes[added] = six(0.03 * setup[to])
    return setup.changed(changes)


def doubted(name: str) -> Setup:
    """A built-in set-up whose controller knows the machine badly."""
    setup = setups.load(name)
    known = setups.parameters(setup)
    return setup.changed(**{f"controller__{k}": f * float(known[k]) for k, f in BELIEVED.items()})


class Watched(SimulatedDrive):
    """Remembers the largest current that any phase ever had."""

    largest_A = 0.0

    def _run_chunk(self, n: int, record: bool) -> None:
        self.discard()
        super()._run_chunk(n, True)
        phases = self._samples.plant.filled()[:, :4] @ inverse(self.machine.displacement_deg).T
        self.largest_A = max(self.largest_A, float(np.abs(phases).max()))


def truth(setup: Setup, dry_Nm: float) -> dict[str, float]:
    """The true values that commissioning should find, under the names of `ALLOWED`."""
    machine = Design(setup, setup.parameter).machine  # at the flux reference
    volts, ohms = (
        0.5 * (setup[f"inverter.{what}_switch_{unit}"] + setup[f"inverter.{what}_diode_{unit}"])
        for what, unit in (("v", "V"), ("r", "ohm"))
    )
    dead = 1e-6 * setup["inverter.dead_time_us"] * float(setup.parameter("f_isr_Hz"))
    return {
        "R_s": machine.rs_ohm + ohms,
        "dead-time voltage": setup["inverter.vdc_V"] * dead + volts,
        "σL_s": machine.sigma_ls_H,
        "L_xy": machine.lxy_H,
        "R_r": machine.rr_ohm,
        "L_m": machine.lm_H,
        "J": machine.inertia_kgm2,
        "friction": dry_Nm,
    }


def measured(setup: Setup, steps: Sequence[str] = tuple(INDUCTION.steps)) -> dict[str, Any]:
    """Commission a drive: the measured values beside the true ones, or the reason for a failure."""
    sim = Watched(setup, 2)
    design = Design(setup, setup.parameter)
    sim.load_Nm = 0.02 * design.rated_Nm
    limit_A = default_current_A(sim)
    row: dict[str, Any] = {"values": {}, "phases": [], "mistakes": [], "lost": ""}
    try:
        found = commission(sim, Limits(limit_A, TRAVEL_REV), steps)
    except HexatorqueError as error:
        row["lost"] = str(error)
    else:
        row["mistakes"] = list(found.mistakes)
        if not found.mistakes:
            true = truth(setup, sim.load_Nm)
            row["phases"] = _phases(found, sim, true["R_s"])
            row["values"] = _values(found, sim, true, row["phases"])
    row["gates"] = sim.gate_mistake
    return {
        **row,
        "limit_A": limit_A,
        "largest_pu": sim.largest_A / limit_A,
        "duration_s": sim.time_s,
    }


def _phases(found: Any, sim: SimulatedDrive, rs_ohm: float) -> list[list[float]]:
    """Each phase's resistance: true value, found one, its uncertainty."""
    if not found.resistance:
        return []
    pairs = zip(sim.machine.drs_ohm, found.resistance.rs_ohm)
    return [[rs_ohm + added, phase.value, phase.uncertainty] for added, phase in pairs]


def _values(
    found: Any, sim: SimulatedDrive, true: dict[str, float], phases: list[list[float]]
) -> dict[str, list[float]]:
    """Name -> true value, found one, its uncertainty."""
    parameters = found.parameters(sim)
    names = {"R_s": "rs_ohm", "σL_s": "sigma_ls_H", "L_xy": "lxy_H", "R_r": "rr_ohm", "L_m": "lm_H"}
    got = {name: parameters[key] for name, key in names.items() if key in parameters}
    if found.resistance:
        got["dead-time voltage"] = found.resistance.mean_lost_V
    if found.mechanics:
        got["J"], got["friction"] = found.mechanics.inertia_kgm2, found.mechanics.dry_Nm
    rows = {name: [true[name], value.value, value.uncertainty] for name, value in got.items()}
    if phases:
        rows[WORST] = max(phases, key=lambda phase: abs(phase[1] / phase[0] - 1))
    return rows


# -- wrong wiring ----------------------------------------------------------------------------

_STRAIGHT = (1, 2, 3, 4, 5, 6)


def _exchanged(a: int, b: int) -> list[int]:
    return [{a: b, b: a}.get(k, k) for k in _STRAIGHT]


def _sensors(*channels: int) -> dict[str, Any]:
    return {"sensors__i_wires": list(channels)}


def _leads(*phases: int) -> dict[str, Any]:
    return {"machine__leads": list(phases)}


def miswirings(setup: Setup) -> list[tuple[list[str], dict[str, Any]]]:
    """Thirty mistakes: words that the lines about each must have, and the set-up's changes."""
    pairs = setup["machine.pole_pairs"]
    counts = setup["sensors.encoder_ppr"]

    def name(number: int) -> str:
        return PHASES[number - 1]

    return [
        *(
            ([f"{name(k)}: has the wrong sign"], _sensors(*(-x if x == k else x for x in channels)))
            for channels in [_STRAIGHT]
            for k in _STRAIGHT
        ),
        *(
            (
                [f"{name(a)}: measures leg {name(b)}", f"{name(b)}: measures leg {name(a)}"],
                _sensors(*_exchanged(a, b)),
            )
            for a, b in ((1, 3), (1, 2), (4, 6), (5, 6), (2, 5))
        ),
        (["u1: measures leg w1", "w1: measures leg v1"], _sensors(3, 2, 5, 4, 1, 6)),
        (["u1: reads nothing"], _sensors(0, 2, 3, 4, 5, 6)),
        (["w2: reads nothing"], _sensors(1, 2, 3, 0, 5, 6)),
        (["u2: measures leg u1"], _sensors(1, 1, 3, 4, 5, 6)),
        *(
            ([f"leg {name(a)} feeds phase {name(b)}"], _leads(*_exchanged(a, b)))
            for a, b in ((1, 3), (3, 5), (2, 6), (1, 2), (3, 4), (2, 5))
        ),
        (["leg u2 feeds phase w2", "leg v2 feeds phase u2"], _leads(1, 4, 3, 6, 5, 2)),
        (["motor lead"], _leads(2, 1, 4, 3, 6, 5)),
        (["motor lead"], _leads(1, 4, 5, 2, 3, 6)),  # the planes are exchanged
        (["encoder: counts backwards"], _leads(2, 1, 6, 5, 4, 3)),  # turns the other way
        (["encoder: counts backwards"], {"sensors__encoder_wires": "swapped"}),
        (["one channel is open"], {"sensors__encoder_wires": "one open"}),
        (["encoder: counts nothing"], {"sensors__encoder_wires": "open"}),
        (["encoder: counts", "times the number"], {"controller__encoder_counts_rev": counts}),
        (
            ["encoder: counts", f"{pairs} pole pairs"],
            {"controller__pole_pairs": 1 if pairs > 1 else 2},
        ),
    ]


def miswired(setup: Setup, words: list[str], changes: dict[str, Any]) -> dict[str, Any]:
    """Whether a mistake is named, and the largest current until then."""
    row = measured(setup.changed(**changes), ("encoder",))
    named = all(any(word in line for line in row["mistakes"]) for word in words)
    return {"expected": words, "named": named, **row}


# -- the study -------------------------------------------------------------------------------


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    def drawn(number: int) -> dict:
        plate, circuit, inertia_kgm2 = plates.machine(number)
        setup = plates.drive(plate, circuit, inertia_kgm2)
        return {
            "name": f"{number}: {plate.power_kW:.3g} kW",
            "power_kW": plate.power_kW,
            **measured(disturbed(setup, number)),
        }

    def built_in(name: str) -> dict:
        return {"name": name, **measured(disturbed(doubted(name), 0))}

    def wrong(case: tuple[str, list[str], dict[str, Any]]) -> dict:
        name, words, changes = case
        return {"name": name, **miswired(disturbed(doubted(name), 0), words, changes)}

    names = BUILT_IN[:1] if quick else BUILT_IN
    cases = [
        (name, *case)
        for name in names
        for case in miswirings(setups.load(name))[:: 10 if quick else 1]
    ]

    def each(function: Callable[[Any], dict], inputs: Sequence) -> list[dict]:
        rows = []
        for row in in_order(function, inputs):
            rows.append(row)
            if progress:
                progress(row["duration_s"])
        return rows

    return {
        "quick": quick,
        "miswirings": each(wrong, cases),
        "built_in": each(built_in, names),
        "machines": each(drawn, range(QUICK if quick else plates.MACHINES)),
    }


def error_pct(row: dict, name: str) -> float:
    """The error of a measured value in %; infinite if it was not measured."""
    if name not in row["values"]:
        return float("inf")
    true, value, _ = row["values"][name]
    return 100 * (value / true - 1)


def _errors(result: dict, name: str) -> np.ndarray:
    return np.abs([error_pct(row, name) for row in result["machines"]])


def _stated(result: dict, name: str) -> list[bool]:
    """Whether the true value of each machine lies within the stated uncertainty; of the phases,
    whether all six do."""
    rows = [row for row in result["machines"] if name in row["values"]]
    found = [row["phases"] if name == WORST else [row["values"][name]] for row in rows]
    return [all(abs(value - true) <= wide for true, value, wide in of_one) for of_one in found]


def failures(result: dict) -> list[str]:
    lines = []
    for name in (*ALLOWED, "friction"):
        inside = _stated(result, name)
        if sum(inside) < HOLDS * len(inside):
            lines.append(
                f"{name}: stated ± holds {sum(inside)} of {len(inside)}, needed are "
                f"{100 * HOLDS:g} %"
            )
    for name, allowed in ALLOWED.items():
        errors = _errors(result, name)
        within = int((errors <= allowed).sum())
        if within < SHARE * len(errors):
            lines.append(
                f"{name}: within {allowed:g} % on {within} of {len(errors)} machines, needed are "
                f"{100 * SHARE:g} %"
            )
    for row in result["miswirings"]:
        if not row["named"]:
            said = row["mistakes"] or [row["lost"] or "nothing"]
            lines.append(f"{row['name']}: {row['expected'][0]}: not named: {said[0]}")
    for row in (*result["machines"], *result["built_in"], *result["miswirings"]):
        if row["largest_pu"] >= 1:
            lines.append(f"{row['name']}: a current {row['largest_pu']:.2f} times the limit")
        if row["gates"]:
            lines.append(f"{row['name']}: {row['gates']}")
    return lines


def grid(result: dict) -> Grid:
    rows = []
    for name in (*ALLOWED, "friction"):
        errors = _errors(result, name)
        finite = errors[np.isfinite(errors)]
        sizes = [np.median(finite), np.percentile(finite, 95), finite.max()] if len(finite) else []
        inside = _stated(result, name)
        required = ["–", "–"]
        if name in ALLOWED:
            within = int((errors <= ALLOWED[name]).sum())
            required = [f"{ALLOWED[name]:g} %", f"{within} of {len(errors)}"]
        rows.append(
            [
                name,
                *required,
                *([f"{size:.2g} %" for size in sizes] or ["–"] * 3),
                f"{sum(inside)} of {len(inside)}",
            ]
        )
    heads = ["value", "allowed", "within", "median", "95 %", "largest", "stated ± holds"]
    tables = [("Machines drawn at random", heads, rows)]
    found = [
        [
            name,
            *(
                f"{row['values'][name][1]:.4g} ({error_pct(row, name):+.1f} %)"
                if name in row["values"]
                else "–"
                for row in result["built_in"]
            ),
        ]
        for name in (*ALLOWED, "friction")
    ]
    names = [row["name"] for row in result["built_in"]]
    tables.append(
        ("Built-in set-ups: found, in V, Ω, H, kg m², N m (error)", ["value", *names], found)
    )
    wrong = []
    for name in names:
        of = [row for row in result["miswirings"] if row["name"] == name]
        largest = max((row["largest_pu"] for row in of), default=0.0)
        wrong.append(
            [name, f"{sum(r['named'] for r in of)} of {len(of)}", f"{100 * largest:.0f} %"]
        )
    heads = ["set-up", "mistakes named", "largest current, share of --current"]
    return [*tables, ("Wrong wiring", heads, wrong)]


def plot(result: dict, path: Path) -> Path:
    """Draws the errors over the machines' power, one panel a value, with what is allowed."""
    from ...analysis import plots

    figure, axes = plots.new_figure(2, 4, 5.0, sharex=True)
    for axis, (name, allowed) in zip(axes.flat, ALLOWED.items()):
        points = [(r["power_kW"], error_pct(r, name)) for r in result["machines"]]
        most = 2 * allowed
        inside = [(p, e) for p, e in points if abs(e) <= most]
        beyond = [(p, np.copysign(most, e)) for p, e in points if most < abs(e) < np.inf]
        axis.axhspan(-allowed, allowed, color=plots.FAINT, zorder=0)
        axis.plot(*zip(*inside), "o", ms=3, color=plots.COLOUR["i_u1"]) if inside else None
        axis.plot(*zip(*beyond), "x", ms=5, color=plots.COLOUR["torque"]) if beyond else None
        axis.set_xscale("log")
        axis.set_ylim(-1.1 * most, 1.1 * most)
        axis.set_title(name, **plots.TITLE)
    for axis in axes[-1]:
        axis.set_xlabel("rated power [kW]", **plots.LABEL)
    for axis in axes[:, 0]:
        axis.set_ylabel("error [%]", **plots.LABEL)
    return plots.save(figure, path)
