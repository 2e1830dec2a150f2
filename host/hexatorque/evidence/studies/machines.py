"""Machines that no design rule has made, and drives that were designed without knowing them.

The truth. Published machines (`setups/data`), as they are when they are rewound to six phases; and
machines drawn around them: a published circuit in units of its rated voltage and current, so that
its values go together as they do in a real machine, each value then off by SCATTER, for another
power, voltage, frequency and number of poles. Its plate follows from its circuit, rounded as plates
are. The lines of `hexatorque new` are medians over all published machines, so the one at hand moves
them little. The main flux saturates, the devices drop voltage, the dead time is not the stated one,
and the sensors have noise, offsets, wrong gains and steps.

Machines with magnets are drawn and told in `magnets`.

What is told of the others, in four ways (WAYS). The controller is designed from that alone. `check`
judges the set-up with what was told, and the scheme is the one that it finds best, as in
`hexatorque new`. Some of these machines are driven once more, with their sets 0 or 60 degrees
apart.

Then the true machine stands in front of the drive: 3, 30, 100 and 150 % of the speed, the torque
with both signs, load drops and reversals (`acceptance.whole`).

The machine with the number n is always the same one.
"""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from ... import firmware, setups
from ...experiments import acceptance
from ...experiments.operating_points import NOT_MEASURED, Progress
from ...setups import Setup, SetupError, estimate, new, published
from ...setups.keys import LXY_LEAST, TIMING_OWNS
from ...setups.nameplate import FRICTION, IRON, Circuit, Nameplate, pull_out_ratio
from ...setups.review import best, review, verdict_of
from . import magnets
from .commissioning import disturbed
from .grids import Grid
from .runs import each
from .truths import SCATTER, Told, Truth, asked

TITLE = "Machines of all sizes: driven by those who do not know them"
#: Drawn machines. In quick form these numbers; the last one is a published machine.
DRAWN, QUICK = 200, (0, 203)
#: The circuit of a machine with another winding than the others, which have 30 degrees. Drawn and
#: published machines, half of them with 0 degrees, half with 60.
SETS = "circuit, sets 0° or 60° apart"
SETS_DEG, OF_SETS = (0, 60), (*range(30), *range(DRAWN, DRAWN + 10))
#: Ways in, with the share of the machines that the scheme which `new` writes must drive.
WAYS = {
    "plate": 0.90,
    "plate with cos φ": 0.97,
    "circuit ±10 to 30 %": 0.98,
    "least keys": 0.98,
    SETS: 0.98,
    magnets.WAY: 0.98,
}
#: Each with every induction machine.
OTHER_WAYS = [way for way in WAYS if way not in (SETS, magnets.WAY)]
#: Of what `check` passes this share must hold, of what it calls bad this share must fail. What it
#: doubts is neither: an estimate decides.
HOLDS, FAILS = 0.98, 0.90
WRITTEN = "as `new` writes it"

#: Over those of the published machine.
POWER, VOLTAGE = (0.6, 1.6), (0.7, 1.4)
FREQUENCY_HZ = (50.0, 60.0, 87.0, 100.0)
#: IEC 60034-1 demands this pull-out torque of a motor, in rated torques.
LEAST_PULL_OUT = 1.6
#: Inertia of the load over the rotor's.
LOAD_INERTIA = (0.2, 5.0)
#: Flux of the knee over the rated main flux, and how sharp it is: the unsaturated inductance is
#: 1.1 to 1.8 times the rated one.
KNEE, EXPONENT = (1.05, 1.3), (4.0, 8.0)
#: Stated is 2 us.
DEAD_TIME_US = (1.5, 2.5)
#: Of the dc-link sensor, either side.
VDC_GAIN = 0.01
#: How far a circuit that is told is off, either side.
TOLD_OFF = (0.1, 0.3)


@dataclass(frozen=True)
class Induction(Truth):
    plate: Nameplate
    circuit: Circuit


def _logarithmic(draw: random.Random, limits: tuple[float, float]) -> float:
    return math.exp(draw.uniform(*map(math.log, limits)))


def _near(draw: random.Random, one: published.Machine) -> published.Machine:
    """A machine like this one."""
    plate = estimate.examples(one)[0].plate
    power, voltage = _logarithmic(draw, POWER), draw.uniform(*VOLTAGE)
    frequency_Hz = draw.choice(FREQUENCY_HZ)
    ohms = voltage**2 / power
    henries = ohms * one.frequency_Hz / frequency_Hz

    def off(value: float) -> float:
        return value * math.exp(draw.gauss(0, SCATTER))

    leakage = off(henries)
    return replace(
        one,
        power_kW=power * plate.power_kW,
        voltage_V=voltage * one.voltage_V,
        frequency_Hz=frequency_Hz,
        pole_pairs=draw.randint(1, 4),
        speed_rpm=0.0,
        current_A=0.0,
        power_factor=0.0,
        rs_ohm=off(ohms * one.rs_ohm),
        rr_ohm=off(ohms * one.rr_ohm),
        lls_H=leakage * one.lls_H,
        llr_H=leakage * one.llr_H,
        lm_H=off(henries * one.lm_H),
    )


def _sound(of: estimate.Example) -> bool:
    """Whether it may be sold: it has the pull-out torque, also with what it must carry."""
    plate, circuit = of.plate, of.circuit
    omega = 2 * math.pi * plate.frequency_Hz
    slip = 1 - plate.speed_rpm * plate.pole_pairs / (60 * plate.frequency_Hz)
    ratio = pull_out_ratio(
        plate.voltage_V / math.sqrt(3), circuit.rs_ohm, omega * circuit.lls_H,
        omega * circuit.lm_H, circuit.rr_ohm / slip,
    )  # fmt: skip
    return ratio >= LEAST_PULL_OUT


@cache
def _starting_s() -> list[float]:
    """The time in which rated power brings the published machines' rotors to their speed."""
    return [
        one.inertia_kgm2 * one.synchronous_rad_s**2 / (1e3 * one.power_kW)
        for one in published.machines()
        if one.inertia_kgm2 and one.power_kW
    ]


def truth(number: int, way: str = "") -> Induction:
    """Those from DRAWN on are the published ones."""
    draw, known = random.Random(number), published.machines()

    def example_of(one: published.Machine) -> estimate.Example:
        shares = (draw.uniform(of.low, of.high) for of in (IRON, FRICTION))
        return estimate.example(one, *shares)

    if number >= DRAWN:
        one = known[number - DRAWN]
        name, of = one.name, example_of(one)
    else:
        while not _sound(of := example_of(_near(draw, one := draw.choice(known)))):
            pass
        name = f"{number}: like {one.name}"
    plate, circuit = of.plate, of.circuit
    synchronous_rad_s = 2 * math.pi * plate.frequency_Hz / plate.pole_pairs
    rotor_kgm2 = draw.choice(_starting_s()) * 1e3 * plate.power_kW / synchronous_rad_s**2
    if number >= DRAWN and one.inertia_kgm2:
        rotor_kgm2 = one.inertia_kgm2
    omega = 2 * math.pi * plate.frequency_Hz
    current = cmath.rect(plate.current_A, -math.acos(plate.power_factor))
    gap_V = plate.voltage_V / math.sqrt(3) - current * (circuit.rs_ohm + 1j * omega * circuit.lls_H)
    main_Wb, knee, exponent = (
        math.sqrt(2) * abs(gap_V) / omega, draw.uniform(*KNEE), draw.uniform(*EXPONENT),
    )  # fmt: skip
    machine = {
        "pole_pairs": plate.pole_pairs,
        "rs_ohm": circuit.rs_ohm,
        "rr_ohm": circuit.rr_ohm,
        "lls_H": circuit.lls_H,
        "llr_H": circuit.llr_H,
        # At the rated main flux it has the circuit's.
        "lm_H": circuit.lm_H * (1 + knee**-exponent),
        "psi_knee_Wb": knee * main_Wb,
        "saturation_exponent": exponent,
        "lxy_H": draw.uniform(LXY_LEAST, 1.0) * circuit.lls_H,
        "inertia_kgm2": rotor_kgm2 * (1 + _logarithmic(draw, LOAD_INERTIA)),
    }
    if way == SETS:
        machine["displacement_deg"] = SETS_DEG[number % len(SETS_DEG)]
    stamped = replace(
        plate,
        power_kW=float(f"{plate.power_kW:.3g}"),
        voltage_V=round(plate.voltage_V),
        current_A=float(f"{plate.current_A:.3g}"),
        speed_rpm=round(plate.speed_rpm),
        power_factor=round(plate.power_factor, 2),
    )
    return Induction(name, plate.power_kW, machine, draw, stamped, circuit)


# -- what is told ----------------------------------------------------------------------------


def told(true: Induction, way: str) -> Told:
    """SetupError if `hexatorque new` refuses it."""
    plate, draw = true.plate, random.Random(true.draw.random())
    speed_rpm, torque_Nm = plate.speed_rpm, true.circuit.torque_Nm
    vdc_V = new.suggestion("vdc_V", {"voltage_V": plate.voltage_V})

    def off(value: float) -> float:
        return value * (1 + draw.choice((-1, 1)) * draw.uniform(*TOLD_OFF))

    names = ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")
    circuit = {name: off(getattr(true.circuit, name)) for name in names}
    circuit["pole_pairs"] = plate.pole_pairs
    if way.startswith("plate"):
        more = {"power_factor": plate.power_factor} if way != "plate" else {}
        text = plate.told(phases=6, **more)
        setup = setups.parse(new.from_nameplate(text, "machine"), "machine")
    elif way.startswith("circuit"):
        given = {**circuit, "current_A": plate.current_A, "vdc_V": vdc_V}
        if way == SETS:
            given["displacement_deg"] = true.machine["displacement_deg"]
        setup = setups.parse(new.from_circuit(_list(given), "machine"), "machine")
    else:
        speed_rpm *= draw.uniform(0.5, 1.1)
        torque_Nm *= draw.uniform(0.4, 1.0)
        i_full_A = draw.uniform(0.8, 1.4) * new.suggestion(
            "i_full_A", {"current_A": plate.current_A}
        )
        setup = setups.parse(
            "\n".join(
                [
                    "[machine]",
                    *(f"{name} = {value!r}" for name, value in circuit.items()),
                    f"inertia_kgm2 = {off(true.machine['inertia_kgm2'])}",
                    f"[inverter]\nvdc_V = {vdc_V}\ndead_time_us = 2.0",
                    f"[sensors]\ni_full_A = {i_full_A}\nvdc_full_V = {1.6 * vdc_V}",
                    'encoder_ppr = 2048\n[timing]\ndevice = "f28377s"\nlatency = "predicted"',
                    f"[point]\nspeed_rpm = {speed_rpm}\nload_Nm = {torque_Nm}",
                ]
            ),
            "machine",
        )
    return asked(true, Told(setup, speed_rpm, torque_Nm))


def _list(given: dict[str, Any]) -> str:
    return ",".join(f"{name}={value:.6g}" for name, value in given.items())


def drive(true: Truth, believed: Setup, number: int) -> Setup:
    """The true machine with the controller that was designed from the stated data."""
    values = setups.parameters(believed)
    known = {f"controller__{n}": v for n, v in values.items() if n not in TIMING_OWNS}
    draw = random.Random(number)
    machine = {f"machine__{name}": value for name, value in true.machine.items()}
    setup = disturbed(believed.changed(**machine, **known), number)
    if setup["inverter.vdc_V"] < new.LEAST_IGBT_V:
        setup = setup.changed(
            inverter__v_switch_V=0.0,
            inverter__v_diode_V=0.0,
            inverter__r_diode_ohm=setup["inverter.r_switch_ohm"],
        )
    return setup.changed(
        **known,
        inverter__dead_time_us=draw.uniform(*DEAD_TIME_US),
        sensors__vdc_full_V=float(values["vdc_full_V"]) * draw.uniform(1 - VDC_GAIN, 1 + VDC_GAIN),
        load__kind="constant",
    )


# -- the study -------------------------------------------------------------------------------


def _tried(true: Truth, of: Told, scheme: str, number: int) -> str:
    """Why it failed; nothing if it did not."""
    try:
        setup = drive(true, of.setup.with_scheme(scheme), number)
        course = acceptance.whole(of.fast_Nm / of.torque_Nm, of.fast)
        acceptance.accept(setup, course, (of.speed_rpm, of.torque_Nm))
    except NOT_MEASURED as error:
        return str(error)
    return ""


def row(number: int, way: str) -> dict[str, Any]:
    """The scheme that `new` writes on one machine; and one of the others, for one of the ways."""
    schemes = firmware.schemes()
    true: Truth
    if with_magnets := way == magnets.WAY:
        true = one = magnets.truth(number)
        tell = partial(magnets.told, one)
    else:
        true = other = truth(number, way)
        tell = partial(told, other, way)
    found: dict[str, Any] = {
        "number": number,
        "drawn": number < (magnets.DRAWN if with_magnets else DRAWN),
        "name": true.name,
        "way": way,
        "power_kW": true.power_kW,
        "written": "",
        "refused": "",
        "tried": {},
    }
    try:
        of = tell()
        findings = review(of.setup, schemes)
    except SetupError as error:
        return {**found, "refused": str(error)}
    written = best(findings, schemes)[0] or new.FALLBACK
    chosen = [written]
    of_others = OTHER_WAYS[number // len(schemes) % len(OTHER_WAYS)]
    if way in (SETS, magnets.WAY, of_others):
        chosen.append(schemes[number % len(schemes)])
    for scheme in dict.fromkeys(chosen):
        found["tried"][scheme] = {
            "verdict": verdict_of(findings, scheme),
            "wrong": [f.what for f in findings if f.stops and f.scheme in ("", scheme)],
            "reason": _tried(true, of, scheme, number),
        }
    return {**found, "written": written}


def one(case: tuple[int, str], progress: Progress | None = None) -> dict:
    """A machine that is told in one way."""
    found = row(*case)
    if progress:
        progress(1.0)
    return found


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    numbers = QUICK if quick else range(DRAWN + len(published.machines()))
    cases = [(number, way) for number in numbers for way in OTHER_WAYS]
    cases += [(number, SETS) for number in OF_SETS if number in numbers]
    cases += [(number, magnets.WAY) for number in magnets.numbers(quick)]
    rows = each(one, cases, folder, progress)
    return {"quick": quick, "rows": rows}


def _outcomes(rows: Iterable[dict], scheme: str) -> list[dict]:
    """One that `new` refuses is neither ready nor driven."""
    refused = {"verdict": "bad", "wrong": ["refused"], "reason": "refused"}
    if scheme == WRITTEN:
        return [r["tried"].get(r["written"], refused) for r in rows]
    return [r["tried"][scheme] for r in rows if scheme in r["tried"]]


def _by_verdict(found: list[dict]) -> tuple[list[dict], list[dict], list[dict]]:
    """Those that `check` passes, those that it doubts, those that it calls bad."""
    ready, doubtful, bad = (
        [f for f in found if f["verdict"] == verdict] for verdict in ("ready", "doubtful", "bad")
    )
    return ready, doubtful, bad


def _driven(found: list[dict]) -> int:
    return sum(not f["reason"] for f in found)


def failures(result: dict) -> list[str]:
    """A line for each kind of data with too few machines that run, and for a `check` that is wrong
    too often."""
    lines = []

    def needs(what: str, found: int, of: int, share: float) -> None:
        if found < share * of:
            lines.append(f"{what}: {found} of {of}, needed are {100 * share:g} %")

    for way, share in WAYS.items():
        found = _outcomes([r for r in result["rows"] if r["way"] == way], WRITTEN)
        needs(f"{way}, as new writes it", _driven(found), len(found), share)
    every = [f for r in result["rows"] for f in r["tried"].values()]
    allowed, _, others = _by_verdict(every)
    needs("check passes, and it holds", _driven(allowed), len(allowed), HOLDS)
    needs("check says bad, and it fails", len(others) - _driven(others), len(others), FAILS)
    return lines


def grid(result: dict) -> Grid:
    of_published = [r for r in result["rows"] if not r["drawn"]]
    of_drawn = [r for r in result["rows"] if r["drawn"]]
    rows = []
    for scheme in (WRITTEN, *firmware.schemes()):
        for way in WAYS:
            cells = []
            for group in (of_drawn, of_published):
                found = _outcomes([r for r in group if r["way"] == way], scheme)
                cells.append(f"{_driven(found)} of {len(found)}")
            rows.append([scheme, way, *cells])
    tables = [("Driven", ["scheme", "told", "drawn machines", "published machines"], rows)]
    rows = []
    for scheme in (WRITTEN, *firmware.schemes()):
        found = _outcomes(result["rows"], scheme)
        allowed, doubted, others = _by_verdict(found)
        rows.append(
            [
                scheme,
                f"{_driven(allowed)} of {len(allowed)}",
                f"{_driven(doubted)} of {len(doubted)}",
                f"{len(others) - _driven(others)} of {len(others)}",
            ]
        )
    heads = [
        "scheme",
        "`check` passes, and it is driven",
        "`check` doubts, and it is driven",
        "`check` says bad, and it fails",
    ]
    return [*tables, ("What `check` said before", heads, rows)]


def plot(result: dict, path: Path) -> Path:
    """Draws the powers, one panel a way in, one line a scheme: driven, foreseen by `check`,
    doubted by it, not foreseen."""
    from ...analysis import plots

    schemes = (WRITTEN, *firmware.schemes())
    figure, axes = plots.new_figure(2, len(WAYS) // 2, 5.4, sharex=True, sharey=True)
    kinds = {
        "driven": ("o", plots.COLOUR["i_u1"]),
        "check says no": ("_", plots.COLOUR["i_x"]),
        "check doubts": ("|", plots.COLOUR["i_x"]),
        "failed": ("x", plots.COLOUR["torque"]),
    }
    foreseen = {"ready": "failed", "doubtful": "check doubts", "bad": "check says no"}
    for axis, way in zip(axes.flat, WAYS):
        points: dict[str, list] = {kind: [] for kind in kinds}
        of = [r for r in result["rows"] if r["way"] == way]
        for height, scheme in enumerate(reversed(schemes)):
            tried = [r for r in of if scheme == WRITTEN or scheme in r["tried"]]
            for r, f in zip(tried, _outcomes(tried, scheme)):
                kind = "driven" if not f["reason"] else foreseen[f["verdict"]]
                points[kind].append((r["power_kW"], height))
        for kind, (marker, colour) in kinds.items():
            powers, heights = ([point[k] for point in points[kind]] for k in (0, 1))
            axis.plot(powers, heights, marker, ms=3, color=colour, label=kind)
        axis.set_xscale("log")
        axis.set_title(way, **plots.TITLE)
    for axis in axes[-1]:
        axis.set_xlabel("rated power [kW]", **plots.LABEL)
    names = [scheme.replace("`", "") for scheme in reversed(schemes)]
    axes.flat[0].set_yticks(range(len(schemes)), names)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), **plots.LEGEND)
    return plots.save(figure, path)
