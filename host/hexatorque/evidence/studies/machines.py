"""Machines of all sizes, from the nameplate to the acceptance run.

Each machine is drawn at random, with its circuit. Only its plate is told to `hexatorque new`; the
pull-out torque and the shares of the losses, which no plate states, are assumed there and differ
from the machine's. The drive with the derived controller then has the true machine in front of it:
start, rated speed, rated torque, the same in reverse, standstill, stop. `check` says beforehand
which schemes can.

The machine with the number n is always the same one.
"""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path

from ... import firmware, setups
from ...experiments.acceptance import accept
from ...experiments.operating_points import NOT_MEASURED, Progress
from ...parallel import each
from ...setups import Setup, SetupError, new
from ...setups.keys import TIMING_OWNS
from ...setups.nameplate import FRICTION, IRON, Assumed, Circuit, Nameplate, circuit_of
from ...setups.review import review
from .grids import Grid, for_terminal

TITLE = "Machines of all sizes: from the nameplate to rated torque and back"
MACHINES, QUICK = 200, 6
#: The row of the scheme that `hexatorque new` writes for each machine.
WRITTEN = "as `new` writes it"
#: What must be reached: shares of all machines, for these schemes; of those that `check` allows,
#: for all others.
PASS_OF_ALL, OF_ALL, PASS_OF_ALLOWED = 0.98, (WRITTEN, "ddr"), 0.90
POWER_KW = (0.37, 250.0)
#: Pull-out torque in rated torques.
PULL_OUT = Assumed(2.8, 2.2, 3.5)
#: Line-to-line voltages: a small machine is not wound for the higher ones, a large one not for
#: the lowest.
VOLTAGES_V = (150.0, 230.0, 400.0, 480.0)
#: A set of a large machine takes this current at most; its voltage is raised until it does.
MOST_A = 400.0


def machine(number: int) -> tuple[Nameplate, Circuit, float]:
    """The plate of a machine, its true circuit, and its inertia."""
    draw = random.Random(number)

    def between(of: Assumed) -> float:
        return draw.uniform(of.low, of.high)

    while True:
        low, high = map(math.log, POWER_KW)
        power_kW = math.exp(draw.uniform(low, high))
        size = (math.log(power_kW) - low) / (high - low)
        pole_pairs, frequency_Hz = draw.randint(1, 4), draw.choice((50.0, 60.0))
        efficiency = 1 - draw.uniform(0.9, 1.1) * 0.28 * math.exp(-2 * size)
        factor = draw.uniform(-0.04, 0.04) + 0.74 + 0.14 * size
        slip = draw.uniform(0.25, 0.4) * (1 - efficiency)
        voltages = [v for v in VOLTAGES_V if _current_A(power_kW, v, efficiency * factor) < MOST_A]
        voltage_V = draw.choice(voltages)
        plate = Nameplate(
            power_kW,
            voltage_V,
            _current_A(power_kW, voltage_V, efficiency * factor),
            frequency_Hz,
            60 * frequency_Hz / pole_pairs * (1 - slip),
            pole_pairs,
            factor,
            efficiency,
            pull_out=between(PULL_OUT),
            iron=between(IRON),
            friction=between(FRICTION),
        )
        # Rotor and load: standard motors have 0.003 kg m2 at 1 kW and 4 poles.
        usual_kgm2 = 0.006 * power_kW**1.3 * (pole_pairs / 2) ** 1.5
        inertia_kgm2 = usual_kgm2 * 10 ** draw.uniform(-1, 1)
        try:
            circuit = circuit_of(plate)
            circuit_of(replace(plate, pull_out=PULL_OUT.value))
        except SetupError:  # no machine has such a plate
            continue
        return plate, circuit, inertia_kgm2


def _current_A(power_kW: float, voltage_V: float, product: float) -> float:
    return 1e3 * power_kW / (2 * math.sqrt(3) * voltage_V * product)


def drive(plate: Nameplate, circuit: Circuit, inertia_kgm2: float, best: bool = False) -> Setup:
    """The drive that was designed from the plate, in front of the true machine. The inertia is
    known: nothing but the load decides it. best: with the scheme that `hexatorque new` writes."""
    told = {
        "power_kW": plate.power_kW,
        "voltage_V": plate.voltage_V,
        "current_A": plate.current_A,
        "frequency_Hz": plate.frequency_Hz,
        "speed_rpm": plate.speed_rpm,
        "poles": 2 * plate.pole_pairs,
        "power_factor": plate.power_factor,
        "inertia_kgm2": inertia_kgm2,
    }
    text = ",".join(f"{name}={value:.6g}" for name, value in told.items())
    written = new.from_nameplate(text, "machine")
    if best:
        written = new.with_best_scheme(written, "machine")[0]
    designed = setups.parse(written, "machine")
    values = setups.parameters(designed)
    believed = {f"controller__{n}": v for n, v in values.items() if n not in TIMING_OWNS}
    names = ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")
    true = {f"machine__{name}": getattr(circuit, name) for name in names}
    return designed.changed(**believed, **true, machine__lxy_H=circuit.lls_H)


def _tried(setup: Setup, scheme: str) -> dict:
    one = setup.with_scheme(scheme)
    bad = [f.subject for f in review(one, [scheme], steady=False) if f.verdict == "bad"]
    try:
        accept(one)
        reason = ""
    except NOT_MEASURED as error:
        reason = str(error)
    found = {"allowed": not bad, "passed": not reason, "reason": reason, "bad": bad}
    return {"scheme": scheme, **found}


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    schemes = firmware.schemes()

    def one(number: int) -> dict:
        plate, circuit, inertia_kgm2 = machine(number)
        setup = drive(plate, circuit, inertia_kgm2)
        best = drive(plate, circuit, inertia_kgm2, best=True)
        # In quick form each machine has ddr and one of the others, beside the written one.
        chosen = ("ddr", schemes[number % len(schemes)]) if quick else schemes
        return {
            "number": number,
            "power_kW": plate.power_kW,
            "voltage_V": plate.voltage_V,
            "pole_pairs": plate.pole_pairs,
            "inertia_kgm2": inertia_kgm2,
            "sigma": setup.parameter("sigma_ls_H") / (circuit.lls_H + circuit.lm_H),
            "written": _tried(best, str(best.parameter("scheme"))),
            "schemes": {name: _tried(setup, name) for name in dict.fromkeys(chosen)},
        }

    return {"quick": quick, "machines": each(one, range(QUICK if quick else MACHINES))}


def _outcomes(result: dict, scheme: str) -> list[dict]:
    if scheme == WRITTEN:
        return [m["written"] for m in result["machines"]]
    return [m["schemes"][scheme] for m in result["machines"] if scheme in m["schemes"]]


def failures(result: dict) -> list[str]:
    """A line for each scheme that drives too few of the machines."""
    lines = []
    for scheme in (WRITTEN, *firmware.schemes()):
        found = _outcomes(result, scheme)
        if scheme not in OF_ALL:
            found = [f for f in found if f["allowed"]]
        least = PASS_OF_ALL if scheme in OF_ALL else PASS_OF_ALLOWED
        passed = sum(f["passed"] for f in found)
        if found and passed < least * len(found):
            lines.append(
                f"{scheme.replace('`', '')}: {passed} of {len(found)}, needed are {100 * least:g} %"
            )
    return lines


def grid(result: dict) -> Grid:
    rows = []
    for scheme in (WRITTEN, *firmware.schemes()):
        found = _outcomes(result, scheme)
        allowed = [f for f in found if f["allowed"]]
        others = [f for f in found if not f["allowed"]]
        numbers = [sum(f["passed"] for f in group) for group in (allowed, others)]
        rows.append([scheme, *map(str, (len(found), len(allowed), *numbers))])
    heads = ["scheme", "machines", "`check` allows", "of these pass", "of the others pass"]
    return [("", heads, rows)]


def tables(result: dict) -> list:
    ((_, heads, rows),) = grid(result)
    plain = [[cell.replace("`", "") for cell in row] for row in (heads, *rows)]
    return for_terminal([(TITLE, plain[0], plain[1:])])


def plot(result: dict, path: Path) -> Path:
    """Draws power against leakage factor, one picture a scheme: passed, foreseen by `check`, not
    foreseen."""
    from ...analysis import plots

    schemes = firmware.schemes()
    columns = -(-len(schemes) // 2)
    figure, axes = plots.new_figure(2, columns, 6.4, sharex=True, sharey=True)
    kinds = {
        "passed": ("o", plots.COLOUR["i_u1"]),
        "check says no": ("_", plots.COLOUR["i_x"]),
        "failed": ("x", plots.COLOUR["torque"]),
    }
    for axis, scheme in zip(axes.flat, schemes):
        points: dict[str, list] = {kind: [] for kind in kinds}
        for m in result["machines"]:
            if f := m["schemes"].get(scheme):
                kind = "passed" if f["passed"] else "failed" if f["allowed"] else "check says no"
                points[kind].append((m["power_kW"], m["sigma"]))
        for kind, (marker, colour) in kinds.items():
            powers, sigmas = ([point[k] for point in points[kind]] for k in (0, 1))
            axis.plot(powers, sigmas, marker, ms=4, color=colour, label=kind)
        axis.set_xscale("log")
        axis.set_title(scheme, **plots.TITLE)
    for axis in axes.flat[len(schemes) - columns : len(schemes)]:
        axis.set_xlabel("rated power [kW]", **plots.LABEL)
        axis.tick_params(labelbottom=True)
    for axis in axes[:, 0]:
        axis.set_ylabel("leakage factor σ", **plots.LABEL)
    axes[0, -1].legend(**plots.LEGEND)
    for axis in axes.flat[len(schemes) :]:
        axis.set_visible(False)
    return plots.save(figure, path)
