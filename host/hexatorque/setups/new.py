"""Write a set-up for a machine of one's own: `hexatorque new`."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

from ..given import choice, real, suggest
from .design import REACH_PU, USABLE, rad_s, rpm
from .estimate import PRODUCT, estimate, ranges, rotor_kgm2, speed_of, spread
from .keys import (
    DEVICES,
    ESTIMATED,
    KEYS,
    LXY_LEAST,
    LXY_SHARE,
    MODEL,
    MOST_NM,
    MOST_RPM,
    MOST_V,
    Key,
)
from .mistyped import shifted
from .nameplate import FRICTION, IRON, THREE_PHASE, Nameplate, ThreePhase
from .published import equal_leakages, machines
from .values import SetupError

#: Of a plate with neither power factor nor efficiency.
NO_FACTOR = "With power_factor (cos phi on the plate) the ranges of R_s and L_m are narrower."
#: The scheme of a set-up for which none is ready; of one whose sets are 0 or 60 degrees apart.
FALLBACK, FALLBACK_ALIKE = "ddr", "db-dtfc"
SCHEME_LINE = 'scheme = "{}"'

_M = KEYS["machine"]


#: The winding of both papers, which a set-up has without a word about it.
PAPERS_DEG = "30"


def _n(help: str, unit: str, low: float, high: float, default: Any = None) -> Key:
    return Key("number", help, unit, low, high, default=default)


#: What may be given in either case. 0 as default: worked out. phases: without it the values decide
#: whether a plate can be that of a three-phase machine.
COMMON = {
    "phases": Key("choice", "of the machine, both sets together", choices=("6", "3"), default=""),
    "vdc_V": _n("dc-link voltage", "V", 1, MOST_V, 0.0),
    "inertia_kgm2": _n("inertia, load included", "kg m2", 1e-6, 1e5, 0.0),
    "lxy_H": _n("inductance of the x-y plane", "H", 1e-6, 10, 0.0),
    "i_full_A": _n("range of the current sensors", "A", 0.1, 1e4, 0.0),
    "vdc_full_V": _n("range of the dc-link sensor", "V", 1, MOST_V, 0.0),
    "dead_time_us": _n("dead time", "us", 1, 20, 2.0),
    "encoder_ppr": Key("integer", "encoder pulses per revolution", "", 1, 1_000_000, default=2048),
    "device": Key("choice", "DSP", choices=DEVICES, default="f28377s"),
    "displacement_deg": replace(_M["displacement_deg"], default=PAPERS_DEG),
}
NAMEPLATE = {
    "power_kW": _n("rated power at the shaft", "kW", 1e-3, 1e5),
    "voltage_V": _n("rated voltage of a set, line to line, rms", "V", 1, 2e4),
    "current_A": _n("rated current of one line of one set, rms", "A", 1e-2, 1e4),
    "power_factor": _n("rated power factor, cos phi on the plate, 0: not known", "", 0, 1, 0.0),
    "frequency_Hz": _n("rated frequency", "Hz", 1, 1000),
    "speed_rpm": _n("rated speed", "r/min", 1, MOST_RPM),
    "poles": Key("integer", "number of poles", "", 2, 128),
    "connection": Key("choice", "of a set", choices=("star", "delta"), default="star"),
    "efficiency": _n("rated efficiency, 0: not known", "", 0, 1, 0.0),
    "pull_out": _n("pull-out torque in rated torques, 0: not known", "", 1.5, 6, 0.0),
    **COMMON,
}
CIRCUIT = {
    **{name: _M[name] for name in ("pole_pairs", "rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")},
    "current_A": _n("rated current of one line of one set, rms", "A", 1e-2, 1e4),
    "torque_Nm": _n("rated torque, 0: not known", "N m", 0, MOST_NM, 0.0),
    "speed_rpm": _n("rated speed, 0: not known", "r/min", 0, MOST_RPM, 0.0),
    "flux_Wb": _n("rated stator flux linkage, amplitude, 0: not known", "Wb", 0, 40, 0.0),
    **COMMON,
    "vdc_V": _n("dc-link voltage", "V", 1, MOST_V),
}
#: Of a machine with magnets, as its data sheet has them.
MAGNETS = {
    "poles": Key("integer", "number of poles", "", 2, 128),
    "ke_V": _n("voltage between two lines of a set without load at 1000 r/min, rms", "V", 0.1, 1e4),
    "rs_ohm": replace(_M["rs_ohm"], help="resistance of a phase, half of that between two lines"),
    "ld_H": replace(_M["ld_H"], help="inductance of a phase along the magnets, half of two lines'"),
    "lq_H": _n("across them, 0: as along them, surface magnets", "H", 0, 10, 0.0),
    "current_A": _n("rated current of one line of one set, rms", "A", 1e-2, 1e4),
    "torque_Nm": _n("rated torque, 0: not known", "N m", 0, MOST_NM, 0.0),
    "speed_rpm": _n("rated speed, 0: not known", "r/min", 0, MOST_RPM, 0.0),
    **COMMON,
    "vdc_V": _n("dc-link voltage", "V", 1, MOST_V),
    "inertia_kgm2": _n("inertia, load included", "kg m2", 1e-6, 1e5),
}
TWO_VOLTAGES = (
    "two voltages or currents, as 230/400 and 6/3.5, are a three-phase machine's plate: give "
    "voltage_V and current_A of one connection, as 400 and 3.5, and phases=3"
)
#: Of db-dtfc where the leakage is an estimate. One period moves the torque by s k times its
#: error, s being this share and k the sigma L_s in use over the machine's, and the law sees it a
#: period later. It is stable for s (k - 1) < 1, and two periods of a step make k s (2 - s) of it,
#: before the law sees any: with this share 1.2 times the step for k = 2.3, in the end 1.25 times.
#: The regulators of foc have the same bandwidth.
STEP_SHARE = 0.3
STEP_WHY = "{}; with measured ones 1 is quicker"
#: L_xy over L_d of the machines with magnets that are built in. The least is taken where it is not
#: told: one that is believed too large lets the x-y current of a large step grow into a trip.
LXY_OF_LD_RANGE = (0.14, 0.41)
#: Range of the sensors over the amplitude of the rated current, and over the dc-link voltage.
I_RANGE, V_RANGE = 3.5, 1.6
#: Threshold of IGBTs and diodes. A lower dc link has MOSFETs, whose channels have none.
THRESHOLD_V, LEAST_IGBT_V = 1.0, 100.0


def read(text: str, keys: dict[str, Key]) -> dict[str, Any]:
    """Values from `name=value,name=value`. SetupError with a line for each mistake."""
    values = {name: key.default for name, key in keys.items()}
    lines = []
    given: set[str] = set()
    # No name begins with a digit: a comma between digits is a decimal sign.
    for part in filter(None, re.split(r"\s+|,(?!(?<=\d,)\d)", text)):
        name, equals, word = part.partition("=")
        if not equals:
            lines.append(f"{part!r}: name=value is needed, for example current_A=1")
        elif name not in keys:
            lines.append(f"unknown name {name}{suggest(name, keys)}")
        elif name in given:
            lines.append(f"{name} is given twice")
        else:
            given.add(name)
            try:
                values[name] = value(name, word, keys[name])
            except SetupError as error:
                lines += [str(error)] * (str(error) not in lines)
    for name, key in keys.items():
        if key.default is None and name not in given:
            lines.append(f"{name} is missing ({key.help}, {key.unit or '-'})")
    if lines:
        raise SetupError("\n".join(lines))
    return values


def value(name: str, word: str, key: Key) -> Any:
    """The value of a word. SetupError if that cannot be."""
    if key.kind == "choice":
        chosen = choice(word, key.choices)
        if chosen not in key.choices:
            raise SetupError(f"{name} = {word!r}: choose one of {', '.join(key.choices)}")
        return chosen
    try:
        number = real(word)
    except ValueError:
        if "/" in word and name in ("voltage_V", "current_A"):
            raise SetupError(TWO_VOLTAGES) from None
        raise SetupError(f"{name} = {word!r}: a number is needed") from None
    whole = key.kind == "integer"
    if not key.min <= number <= key.max or (whole and number % 1):
        allowed = f"{key.min:.9g} .. {key.max:.9g} {key.unit}".rstrip()
        near = shifted(number, key.min, key.max) if key.max == 1 else None
        raise SetupError(
            f"{name} = {number:.9g}: allowed range is {allowed}"
            + (", whole numbers only" if whole else "")
            + (f": did you mean {near:g}?" if near else "")
        )
    if name == "poles" and number % 2:
        raise SetupError(f"poles = {number:.9g}: an even number is needed")
    return int(number) if whole else number


def from_nameplate(text: str, title: str) -> str:
    """The text of a set-up from a nameplate. ThreePhase if the plate is a three-phase
    machine's."""
    given = read(text, NAMEPLATE)
    _link_fits(given)
    plate = Nameplate(
        **{n: given[n] for n in ("power_kW", "voltage_V", "current_A", "frequency_Hz")},
        speed_rpm=given["speed_rpm"],
        pole_pairs=given["poles"] // 2,
        power_factor=given["power_factor"],
        efficiency=given["efficiency"],
        pull_out=given["pull_out"],
    )
    if given["phases"] == "3" or (given["phases"] != "6" and plate.may_be_three_phase):
        half_A, half_V = (f"{0.5 * given[name]:.4g}" for name in ("current_A", "voltage_V"))
        why = THREE_PHASE if given["phases"] == "3" else plate.doubt
        raise ThreePhase(
            f"{why}. Rewound to six phases, for the "
            f"same power, each of the two sets takes voltage_V={given['voltage_V']:g},"
            f"current_A={half_A}, or with the same coils in two groups voltage_V={half_V},"
            f"current_A={given['current_A']:g}"
            + ("" if given["phases"] else "; if it has six phases, add phases=6"),
            {"current_A": half_A},
        )
    circuit = estimate(plate)
    words = {
        name: f"from the nameplate; {low:.3g} .. {high:.3g}"
        for name, (low, high) in ranges(plate, circuit).items()
    }
    told = bool(plate.power_factor or plate.efficiency)
    filled = ["R_s in part" if told else "R_s, and so the power factor"]
    if not plate.pull_out:
        filled.append("the leakage")
    head = [
        f"Nameplate: {text}",
        "Per phase of the equivalent star of each set. What the plate does not say is what "
        f"{len(machines())} published machines have at this power: {', '.join(filled)}.",
        f"Iron has {100 * IRON.value:g} % and friction {100 * FRICTION.value:g} % of the losses. "
        "Each note has the range in which nearly all of these machines lie when they are",
        "estimated in this way.",
    ]
    if not told:
        head.append(NO_FACTOR)
    machine = {
        "pole_pairs": (plate.pole_pairs, "", "nameplate"),
        **{
            name: (getattr(circuit, name), ESTIMATED, words[name])
            for name in ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")
        },
        **_beside_circuit(given, circuit.lls_H),
    }
    rated = {
        "torque_Nm": (circuit.torque_Nm, "", "power over speed"),
        "speed_rpm": (plate.speed_rpm, "", "nameplate"),
        "current_A": (plate.current_A, "", "nameplate"),
        "flux_Wb": (circuit.flux_Wb, ESTIMATED, words["flux_Wb"]),
    }
    controller = {} if plate.pull_out else _careful_steps("leakages are estimates")
    return _text(title, head, machine, rated, given, controller)


#: So many times the dc link that a plate's voltage needs is believed.
MOST_LINK = 3.0


def _link_fits(given: dict[str, Any]) -> None:
    """SetupError if no inverter for this plate has such a dc link. A lower one may be wanted."""
    vdc_V, needed_V = given["vdc_V"], suggestion("vdc_V", given)
    if vdc_V > MOST_LINK * needed_V:
        near = shifted(vdc_V, 0.7 * needed_V, 1.5 * needed_V)
        raise SetupError(
            f"vdc_V = {vdc_V:g}: {given['voltage_V']:g} V need {needed_V:g} V, allowed is up to "
            f"{MOST_LINK * needed_V:g} V" + (f": did you mean {near:g}?" if near else "")
        )


def from_circuit(text: str, title: str) -> str:
    """The text of a set-up from an equivalent circuit."""
    given = read(text, CIRCUIT)
    if given["phases"] == "3":
        doubled = {n: f"{2 * given[n]:.4g}" for n in ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")}
        doubled["current_A"] = f"{0.5 * given['current_A']:.4g}"
        raise ThreePhase(
            f"{THREE_PHASE}. Rewound to six phases, for the same voltage and power, each phase has "
            + ",".join(f"{name}={word}" for name, word in doubled.items()),
            doubled,
        )
    names = ("pole_pairs", "rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")
    machine = {name: (given[name], "", "") for name in names}
    machine |= _beside_circuit(given, given["lls_H"])
    head = [f"Equivalent circuit: {text}"]
    return _text(title, head, machine, _rated(given), given)


def from_magnets(text: str, title: str) -> str:
    """The text of a set-up from the data sheet of a machine with magnets."""
    given = read(text, MAGNETS)
    if given["phases"] == "3":
        raise SetupError(
            "phases = 3: a three-phase machine has one set; rewound to six phases, for the same "
            "power and voltage, rs_ohm, ld_H and lq_H are twice as large, current_A is half"
        )
    ld_H, pole_pairs = given["ld_H"], given["poles"] // 2
    if 0 < given["lq_H"] < ld_H:
        raise SetupError(
            f"ld_H = {ld_H:g}, lq_H = {given['lq_H']:g}: L_d may not be above L_q; the d axis is "
            "the magnets' north pole: are they exchanged?"
        )
    omega = pole_pairs * 1000 * math.pi / 30
    machine = {
        MODEL: ("magnet", "", ""),
        "pole_pairs": (pole_pairs, "", ""),
        "rs_ohm": (given["rs_ohm"], "", ""),
        "ld_H": (ld_H, "", ""),
        "lq_H": (given["lq_H"] or ld_H, "", ""),
        "psi_f_Wb": (math.sqrt(2 / 3) * given["ke_V"] / omega, "", ""),
    }
    low, high = (share * ld_H for share in LXY_OF_LD_RANGE)
    machine |= {
        "lxy_H": _chosen("lxy_H", given, f"of this L_d; {low:.3g} .. {high:.3g}"),
        "inertia_kgm2": (given["inertia_kgm2"], "", ""),
    }
    head = [f"Data sheet: {text}", "The harmonics of the magnets' voltage are left out: emf_share."]
    controller = _careful_steps("inductances change with the current")
    return _text(title, head, machine, _rated(given), given, controller)


def _careful_steps(why: str) -> dict[str, tuple]:
    """The row of [controller] for inductances that may be far off."""
    return {"step_share": (STEP_SHARE, "assumed", STEP_WHY.format(why))}


def _rated(given: dict[str, Any]) -> dict[str, tuple]:
    names = ("torque_Nm", "speed_rpm", "current_A", "flux_Wb")
    return {name: (given[name], "", "") for name in names if given.get(name)}


def inertia_of(power_kW: float, speed_rpm: float) -> float:
    """Rotor and an equal load, at this synchronous speed."""
    allowed = _M["inertia_kgm2"]
    return min(max(2 * rotor_kgm2(power_kW, max(speed_rpm, 1.0)), allowed.min), allowed.max)


def _peak_V(given: dict[str, Any]) -> float:
    """Amplitude of the phase voltage for which a machine on this dc link is wound."""
    return REACH_PU * USABLE * given["vdc_V"]


def _apparent_kVA(given: dict[str, Any]) -> float:
    return 6e-3 * _peak_V(given) / math.sqrt(2) * given["current_A"]


def _rated_rad_s(given: dict[str, Any], power_kW: float) -> float:
    """Rated speed of a circuit: as told; else power over the rated torque; else the speed at which
    the voltage turns the rated flux; else that of machines with such inductances."""
    if given.get("speed_rpm"):
        return rad_s(given["speed_rpm"])
    if given.get("torque_Nm"):
        return 1e3 * power_kW / given["torque_Nm"]
    if given.get("flux_Wb"):
        return _peak_V(given) / given["flux_Wb"] / given["pole_pairs"]
    base_ohm = _peak_V(given) / (math.sqrt(2) * given["current_A"])
    _, leakage_H, lm_H = equal_leakages(
        given["rr_ohm"], given["lls_H"], given["llr_H"], given["lm_H"]
    )
    return speed_of(base_ohm, power_kW, leakage_H, lm_H) / given["pole_pairs"]


def _rounded(value: float, digits: int = 2) -> float:
    return float(f"{value:.{digits}g}")


def suggestion(name: str, given: dict[str, Any]) -> Any:
    """A value that follows from those given so far; None if it does not follow."""
    if name == "phases":
        return "6"
    if name == "frequency_Hz":
        return 50
    if name == "poles" and "frequency_Hz" in given:
        # The slip is small: the synchronous speed is the next one above the rated speed.
        return min(128, max(2, 2 * int(60 * given["frequency_Hz"] / given["speed_rpm"])))
    if name == "llr_H":
        return given["lls_H"]
    if name == "lxy_H":
        return LXY_OF_LD_RANGE[0] * given["ld_H"] if "ld_H" in given else LXY_SHARE * given["lls_H"]
    if name == "vdc_V" and "voltage_V" in given:
        peak_V = math.sqrt(2 / 3) * given["voltage_V"]
        return math.ceil(peak_V / (REACH_PU * USABLE) / 10) * 10
    if name == "vdc_full_V":
        return _rounded(V_RANGE * (given.get("vdc_V") or suggestion("vdc_V", given)))
    if name == "i_full_A":
        return _rounded(I_RANGE * math.sqrt(2) * given["current_A"])
    if name == "inertia_kgm2" and "ke_V" not in given:
        if "poles" in given:
            speed_rpm = 120 * given["frequency_Hz"] / given["poles"]
            return _rounded(inertia_of(given["power_kW"], speed_rpm))
        power_kW = _apparent_kVA(given) * PRODUCT
        speed_rpm = rpm(_rated_rad_s(given, power_kW))
        return _rounded(inertia_of(power_kW, speed_rpm))
    return None


def _chosen(
    name: str, given: dict[str, Any], note: str, tag: str = "assumed", **known: float
) -> tuple:
    """The row of a value that was given, or of the suggestion for it."""
    if given[name]:
        return (given[name], "", "")
    return (suggestion(name, {**given, **known}), tag, note)


def _beside_circuit(given: dict[str, Any], lls_H: float) -> dict[str, tuple]:
    """The rest of [machine] of an induction machine."""
    inertia = suggestion("inertia_kgm2", given)
    # Power over torque and voltage over flux are as good as the speed.
    told = any(map(given.get, ("speed_rpm", "torque_Nm", "flux_Wb")))
    of = "speed" if told else "these inductances"
    factor = spread().inertia if told else spread().untold_inertia
    low, high = _rounded(inertia / factor), _rounded(inertia * factor)
    return {
        "lxy_H": _chosen(
            "lxy_H",
            given,
            f"{LXY_SHARE:g} of the stator leakage; {LXY_LEAST * lls_H:.3g} .. {lls_H:.3g}",
            ESTIMATED,
            lls_H=lls_H,
        ),
        "inertia_kgm2": _chosen(
            "inertia_kgm2",
            given,
            f"usual for this power and {of}, with an equal load; {low} .. {high}",
            ESTIMATED,
        ),
    }


def _text(
    title: str,
    head: list[str],
    machine: dict[str, tuple],
    rated: dict[str, tuple],
    given: dict[str, Any],
    controller: dict[str, tuple] | None = None,
) -> str:
    from .. import firmware

    def chosen(name: str, note: str) -> tuple:
        return _chosen(name, given, note)

    fallback = FALLBACK
    if given["displacement_deg"] != PAPERS_DEG:
        fallback = FALLBACK_ALIKE
        machine = {**machine, "displacement_deg": (int(given["displacement_deg"]), "", "")}
    sections = {
        "machine": machine,
        "inverter": {
            "vdc_V": chosen("vdc_V", "reaches rated voltage with 10 % left for control"),
            "dead_time_us": (given["dead_time_us"], "assumed", "1 .. 3: see the gate drivers"),
            **_thresholds(chosen("vdc_V", "")[0]),
        },
        "sensors": {
            "i_full_A": chosen("i_full_A", f"{I_RANGE:g} times the rated amplitude"),
            "vdc_full_V": chosen("vdc_full_V", f"{V_RANGE:g} times the dc link"),
            "encoder_ppr": (given["encoder_ppr"], "assumed", "pulses of the encoder in use"),
        },
        "timing": {
            "device": (given["device"], "assumed", "the DSP in use"),
            "latency": ("predicted", "assumed", "what a DSP does: shadow load, one step ahead"),
        },
        "rated": rated,
    }
    lines = [f"# {line}" for line in head]
    lines += [f'title = "{title}"', "# What [controller] leaves open is derived from the rest:"]
    lines += ["# hexatorque setups FILE shows each value with its rule.", 'defaults = "derived"']
    for section, rows in sections.items():
        lines += ["", f"[{section}]"]
        lines += [_line(name, row, KEYS[section][name]) for name, row in rows.items()]
    lines += ["", "[controller]"]
    known = firmware.parameters()
    for name, row in (controller or {}).items():
        lines.append(_line(name, row, Key("number", known[name].help)))
    lines += [SCHEME_LINE.format(fallback), ""]
    return "\n".join(lines)


def _thresholds(vdc_V: float) -> dict[str, tuple]:
    """Where the drive knows of none it takes them for stator resistance, at little current for one
    that is several times the machine's."""
    if vdc_V < LEAST_IGBT_V:
        return {}
    about = "about that of an IGBT and its diode; 0: a MOSFET"
    return {name: (THRESHOLD_V, "assumed", about) for name in ("v_switch_V", "v_diode_V")}


def with_best_scheme(text: str, name: str) -> tuple[str, str, str, list[str]]:
    """The text of a new set-up with the scheme that the review finds best for its machine; that
    scheme, and why; a line for each number that is unusual. If none is ready the scheme is empty,
    and the reason names a remedy. SetupError if no machine has such numbers."""
    from .. import firmware
    from .loading import parse
    from .review import best, none_ready, refuse_impossible, review, unusual

    setup = parse(text, name)
    refuse_impossible(setup)
    schemes = firmware.schemes()
    findings = review(setup, schemes)
    scheme, why = best(findings, schemes)
    why = why or none_ready(findings, schemes)
    fallback = setup["controller.scheme"]
    line = f"# {why}\n{SCHEME_LINE.format(scheme or fallback)}"
    return text.replace(SCHEME_LINE.format(fallback), line), scheme, why, unusual(findings)


def scheme_of(text: str) -> str:
    """The scheme that the text of a new set-up names."""
    return re.findall(r'^scheme = "(.*)"', text, re.MULTILINE)[-1]


def _line(name: str, row: tuple, key: Key) -> str:
    value, tag, note = row
    word = f'"{value}"' if isinstance(value, str) else f"{value:.5g}"
    if isinstance(value, int):
        word = str(value)
    if tag:
        word = f'{{ value = {word}, tag = "{tag}", note = "{note}" }}'
    about = ", ".join(key.choices) if key.kind == "choice" else key.help.split(", 0:")[0]
    unit = f" [{key.unit}]" if key.unit else ""
    return f"{name} = {word}  # {about}{unit}"
