"""Every quantity of a set-up, once: its meaning, its unit, its range, its default.

The controller's parameters are not here: the firmware's own table defines them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..chips import DEVICES
from ..plant.load_kinds import LOADS
from ..plant.machines import DISPLACEMENTS_DEG, MODELS, constants_of
from ..plant.wires import ABSOLUTE_FAULTS, ENCODER_WIRES

#: Where a value comes from.
TAGS = ("paper", "assumed", "estimated", "measured", "tuned")
#: Of a usual value that `hexatorque new` takes: the true one may be far from it.
ESTIMATED = TAGS[2]
#: At the machine that is there.
MEASURED = TAGS[3]
#: The same, for values that the user's own file or command line gives.
USER = "user"
#: A thermal resistance that is there.
LEAST_K_W, MOST_K_W = 1e-5, 1e3
LATENCIES = ("none", "immediate", "shadow", "predicted")


@dataclass(frozen=True)
class Key:
    """One quantity of a set-up."""

    #: "number", "integer", "phases" (six numbers), "harmonics", "pairs" (four each), "choice",
    #: "file"; a profile's too
    kind: str
    help: str
    unit: str = ""
    min: float = -math.inf
    max: float = math.inf
    choices: tuple[str, ...] = ()
    default: Any = None  #: None = must be given, or follows another key
    follows: str = ""  #: key of the same section whose value this one has unless it is given
    share: float = 1.0  #: of that value, where the set-up's open values are designed


def _n(help: str, unit: str, low: float, high: float, default: float | None = None) -> Key:
    return Key("number", help, unit, low, high, default=default)


def _six(help: str, unit: str, low: float, high: float, default: float = 0.0) -> Key:
    return Key("phases", help, unit, low, high, default=(default,) * 6)


def _four(help: str, unit: str, low: float, high: float, default: tuple[float, ...]) -> Key:
    return Key("pairs", help, unit, low, high, default=default)


#: Largest dc-link voltage: 13.8 kV machines, with the sensors' range above it. Largest speed:
#: beyond it a two-pole flux has fewer than ten periods of 10 kHz for a turn. Largest torque.
MOST_V, MOST_RPM, MOST_NM = 5e4, 6e4, 1e5

#: L_xy over the stator leakage, as pitch and slots make it: the least, and the one that is taken
#: where nobody has measured it. The largest is 1, and this is the geometric mean.
LXY_LEAST, LXY_SHARE = 0.3, 0.55

#: Everything a set-up holds besides the controller's parameters, which the
#: firmware's own table defines.
KEYS: dict[str, dict[str, Key]] = {
    "machine": {
        "model": Key("choice", "machine model", choices=tuple(MODELS), default="induction"),
        "pole_pairs": Key("integer", "pole pairs", "", 1, 64),
        "rs_ohm": _n("stator resistance", "ohm", 1e-4, 1e3),
        "rr_ohm": _n("rotor resistance, referred", "ohm", 1e-4, 1e3),
        "lls_H": _n("stator leakage inductance", "H", 1e-6, 10),
        "llr_H": _n("rotor leakage inductance, referred", "H", 1e-6, 10),
        "lm_H": _n("magnetising inductance", "H", 1e-5, 100),
        "psi_f_Wb": _n("flux linkage of the magnets, amplitude", "Wb", 1e-5, 100),
        "ld_H": _n("inductance along the d axis, the magnets' north pole", "H", 1e-6, 10),
        "lq_H": _n("inductance across the d axis", "H", 1e-6, 10),
        "lxy_H": replace(
            _n(f"inductance of the x-y plane, unless given {LXY_SHARE:g} lls_H", "H", 1e-6, 10),
            follows="lls_H",
            share=LXY_SHARE,
        ),
        "inertia_kgm2": _n("inertia, load included", "kg m2", 1e-6, 1e5),
        "viscous_Nms": _n("viscous friction", "N m s", 0, 1e3, 0.0),
        "drs_ohm": _six("stator resistance added per phase u1 u2 w1 w2 v1 v2", "ohm", -1e3, 1e3),
        "dlls_H": _six("leakage added per phase u1 u2 w1 w2 v1 v2", "H", -10, 10),
        "psi_knee_Wb": _n(
            "main flux that takes twice the unsaturated current, 0: linear", "Wb", 0, 100, 0.0
        ),
        "saturation_exponent": _n("how sharply the main flux saturates", "", 1, 20, 6.0),
        "iron_hysteresis_A_Wb": _n(
            "iron loss over flux squared and electrical speed (W, Wb, rad/s): hysteresis",
            "A/Wb",
            0,
            1e5,
            0.0,
        ),
        "iron_eddy_S": _n(
            "iron loss over the square of flux times that speed: eddy currents", "S", 0, 1e3, 0.0
        ),
        "emf_share": Key(
            "harmonics",
            "harmonics 5, 7, 11, 13 of the voltage that the magnets induce, over the fundamental",
            min=-0.5,
            max=0.5,
            default=(0.0,) * 4,
        ),
        "emf_deg": Key("harmonics", "their phases", "deg", min=-180, max=180, default=(0.0,) * 4),
        "flux_map": Key(
            "file",
            "table id_A,iq_A,psi_d_Wb,psi_q_Wb of the true flux linkages; ld_H, lq_H, psi_f_Wb are "
            "then what the drive takes them for",
            default="",
        ),
        "cogging_Nm": _n("cogging torque, amplitude", "N m", 0, MOST_NM, 0.0),
        "cogging_per_rev": Key("integer", "its periods in a revolution", "", 1, 10_000, default=36),
        "start_deg": _n("electrical angle of the d axis at the beginning", "deg", -360, 360, 0.0),
        "displacement_deg": Key(
            "choice",
            "angle of set 2 of the winding ahead of set 1, electrical",
            "deg",
            choices=tuple(map(str, DISPLACEMENTS_DEG)),
            default=str(DISPLACEMENTS_DEG[0]),
        ),
        "leads": Key(
            "phases",
            "phase on each leg u1 u2 w1 w2 v1 v2; 1 is u1 ... 6 is v2",
            min=1,
            max=6,
            default=(1, 2, 3, 4, 5, 6),
        ),
    },
    "inverter": {
        "vdc_V": _n("dc-link voltage", "V", 1, MOST_V),
        "link_F": _n("capacitor of the dc link, fed from vdc_V; 0: a stiff link", "F", 0, 10, 0.0),
        "source_ohm": _n("resistance of the link's source", "ohm", 1e-4, 1e3, 0.1),
        "source_H": _n("inductance of the link's source", "H", 0, 1, 0.0),
        "line_Hz": _n(
            "the source is a six-pulse rectifier on a line of this frequency with source_ohm and "
            "source_H each; vdc_V is its mean, 1.35 times the line-to-line voltage; 0: direct",
            "Hz",
            0,
            1e3,
            0.0,
        ),
        "precharge_ohm": _n(
            "resistor that charges the link until the drive's relay bridges it, 0: none",
            "ohm",
            0,
            1e5,
            0.0,
        ),
        "chopper_ohm": _n("resistance of the braking chopper, 0: none", "ohm", 0, 1e5, 0.0),
        "chopper_on_V": _n(
            "the chopper comes on at this voltage, 0: with the drive's output", "V", 0, MOST_V, 0.0
        ),
        "chopper_off_V": _n("and goes off at this one", "V", 0, MOST_V, 0.0),
        "dead_time_us": _n("dead time", "us", 0, 20),
        "min_pulse_us": _n("gate pulses shorter than this are suppressed", "us", 0, 10, 0.0),
        "v_switch_V": _n("threshold voltage of a conducting switch", "V", 0, 10, 0.0),
        "v_diode_V": _n("threshold voltage of a conducting diode", "V", 0, 10, 0.0),
        "r_switch_ohm": _n("on-resistance of a switch", "ohm", 0, 10, 0.0),
        "r_diode_ohm": _n("on-resistance of a diode", "ohm", 0, 10, 0.0),
        "arc_V": replace(
            _n("voltage of the arc in a phase that opens, unless given vdc_V", "V", 1, MOST_V),
            follows="vdc_V",
        ),
        "restrike_V_per_ms": _n(
            "growth of the voltage beyond arc_V that an opening contact withstands; above it the "
            "arc strikes again; 0: never again",
            "V/ms",
            0,
            1e5,
            0.0,
        ),
        "bounce_ms": _n("a contact that opens bounces for this time", "ms", 0, 100, 0.0),
        "e_on_mJ": _n("energy of a switch's turn-on, diode recovery included", "mJ", 0, 1e3, 0.0),
        "e_off_mJ": _n("energy of a switch's turn-off", "mJ", 0, 1e3, 0.0),
        "e_ref_V": _n("voltage at which e_on_mJ and e_off_mJ are stated", "V", 0, MOST_V, 0.0),
        "e_ref_A": _n("current at which e_on_mJ and e_off_mJ are stated", "A", 0, 1e4, 0.0),
    },
    "sensors": {
        "adc_bits": Key("integer", "resolution of the converter", "", 6, 12, default=12),
        "i_full_A": _n("phase current at full scale, either sign", "A", 0.1, 1e4),
        "vdc_full_V": _n("dc-link voltage at full scale", "V", 1, MOST_V),
        "i_offset_A": _six("current sensor offset", "A", -1e3, 1e3),
        "i_gain": _six("current sensor gain, 1 = exact", "", 0.5, 2, 1.0),
        "i_wires": Key(
            "phases",
            "leg that each current channel measures, 1 is u1 ... 6 is v2; negative: the wrong way "
            "round; 0: open",
            min=-6,
            max=6,
            default=(1, 2, 3, 4, 5, 6),
        ),
        "i_filter_Hz": _n("corner of the current sensors' filter, 0: none", "Hz", 0, 1e7, 0.0),
        "i_noise_A": _n("current sensor noise, rms, white at the converter", "A", 0, 100, 0.0),
        "noise_seed": Key("integer", "the same seed gives the same noise", "", 1, 1e9, default=1),
        "winding_ntc_ohm": _n(
            "thermistor in the winding of u1, its resistance at 25 degC, 0: none",
            "ohm",
            0,
            1e6,
            0.0,
        ),
        "winding_ntc_K": _n("its beta", "K", 1e3, 1e4, 3950.0),
        "sink_ntc_ohm": _n(
            "thermistor on the heat sink, its resistance at 25 degC, 0: none", "ohm", 0, 1e6, 0.0
        ),
        "sink_ntc_K": _n("its beta", "K", 1e3, 1e4, 3950.0),
        "ntc_pull_up_ohm": _n(
            "resistor from the converter's reference to each thermistor", "ohm", 1, 1e6, 4700.0
        ),
        "encoder_ppr": Key("integer", "encoder pulses per revolution", "", 1, 1_000_000),
        "encoder_error_cycles": _n(
            "rise of the encoder's channel B late, fall early by this", "cycles", 0, 0.1, 0.0
        ),
        "encoder_index_deg": _n(
            "where the encoder has its index pulse: how far the shaft turns to it; 0 = it has none",
            "deg",
            0,
            360,
            0.0,
        ),
        "absolute_counts_rev": Key(
            "integer",
            "readings of an absolute encoder in a revolution, 0: there is none",
            "",
            0,
            1 << 24,
            default=0,
        ),
        "absolute_deg": _n(
            "where it reads 0: how far the shaft turns to it", "deg", -360, 360, 0.0
        ),
        "absolute_direction": Key(
            "choice",
            "way of its readings while the shaft turns forwards",
            choices=("same", "reversed"),
            default="same",
        ),
        "absolute_fault": Key(
            "choice", "what it does wrong", choices=ABSOLUTE_FAULTS, default="none"
        ),
        "encoder_wires": Key(
            "choice", "how the encoder is connected", choices=ENCODER_WIRES, default="straight"
        ),
        "sample_delay_us": _n("counter zero to sample and hold", "us", 0, 40, 0.0),
    },
    "timing": {
        "device": Key("choice", "DSP", choices=DEVICES),
        "latency": Key(
            "choice",
            "none: applied at the sample; immediate: at the register write; "
            "shadow: next period; predicted: shadow with one-step prediction",
            choices=LATENCIES,
        ),
        "isr_us": _n("sample to register write", "us", 0, 45, 10.0),
    },
    "load": {
        "kind": Key("choice", "torque against speed", choices=LOADS, default="constant"),
        "at_rpm": _n("speed at which the load takes the stated torque", "r/min", 1, 1e5, 1000.0),
        "holding_Nm": _n(
            "torque of a holding brake that the drive opens, 0: none",
            "N m",
            0,
            MOST_NM,
            0.0,
        ),
        "holding_open_s": _n("delay with which it opens", "s", 0, 10, 0.1),
        "holding_close_s": _n("delay with which it closes", "s", 0, 10, 0.1),
    },
    "heat": {
        "winding_K_W": _n(
            "thermal resistance from the winding to the frame; without it no temperatures",
            "K/W",
            LEAST_K_W,
            MOST_K_W,
            0.0,
        ),
        "winding_s": _n("thermal time constant of the winding", "s", 0.01, 1e5, 60.0),
        "frame_K_W": _n(
            "thermal resistance from the frame to the ambient", "K/W", LEAST_K_W, MOST_K_W, 0.5
        ),
        "frame_s": _n("thermal time constant of the frame", "s", 0.01, 1e6, 1800.0),
        "ambient_degC": _n("ambient temperature, and the machine's", "degC", -50, 150, 40.0),
        "ohm_degC": _n("temperature at which rs_ohm and rr_ohm are stated", "degC", -50, 250, 20.0),
        "switch_K_W": _four(
            "thermal resistances of a switch from junction to heat sink, as a Foster chain; "
            "without these and diode_K_W no temperatures of devices",
            "K/W",
            0,
            MOST_K_W,
            (0.0,) * 4,
        ),
        "switch_s": _four("their time constants", "s", 1e-5, 1e4, (1e-3, 1e-2, 0.1, 1.0)),
        "diode_K_W": _four("the same of a diode", "K/W", 0, MOST_K_W, (0.0,) * 4),
        "diode_s": _four("their time constants", "s", 1e-5, 1e4, (1e-3, 1e-2, 0.1, 1.0)),
        "sink_K_W": _n(
            "thermal resistance from the heat sink to the ambient; without it both are as warm",
            "K/W",
            LEAST_K_W,
            MOST_K_W,
            0.0,
        ),
        "sink_s": _n("thermal time constant of the heat sink", "s", 0.01, 1e6, 300.0),
        "devices_degC": _n("temperature at which the drops are stated", "degC", -50, 250, 25.0),
        "switch_V_per_K": _n("relative change of v_switch_V", "1/K", -0.02, 0.02, -1e-3),
        "switch_ohm_per_K": _n("relative change of r_switch_ohm", "1/K", -0.02, 0.02, 4e-3),
        "diode_V_per_K": _n("relative change of v_diode_V", "1/K", -0.02, 0.02, -2e-3),
        "diode_ohm_per_K": _n("relative change of r_diode_ohm", "1/K", -0.02, 0.02, 2e-3),
        "time_lapse": _n("temperatures change so many times as quickly", "", 1, 1e5, 1.0),
    },
    "rated": {
        "torque_Nm": _n("rated torque, 0: not known", "N m", 0, MOST_NM, 0.0),
        "speed_rpm": _n("rated speed, 0: not known", "r/min", 0, MOST_RPM, 0.0),
        "current_A": _n("rated current of a line, rms, 0: not known", "A", 0, 1e4, 0.0),
        "flux_Wb": _n("rated stator flux linkage, amplitude, 0: not known", "Wb", 0, 40, 0.0),
    },
    "point": {
        "speed_rpm": _n(
            "operating point of `compare`: speed, 0: half of rated speed and torque",
            "r/min",
            -MOST_RPM,
            MOST_RPM,
            0.0,
        ),
        "load_Nm": _n("operating point of `compare`: load torque", "N m", -MOST_NM, MOST_NM, 0.0),
    },
}

#: The key that names the kind of machine.
MODEL = "model"


def missing(values: Mapping[str, Mapping[str, Any]], model: str) -> list[str]:
    """A line for every key of a set-up with this model that has no default and no value."""
    lines = []
    for section, keys in KEYS.items():
        for name, key in keys.items():
            if needed(section, name, model) and name not in values.get(section, {}):
                lines.append(f"{section}.{name} is missing ({key.help}, {key.unit or '-'})")
    return lines


def needed(section: str, name: str, model: str) -> bool:
    """Whether a set-up with this model must give a key."""
    key = KEYS[section][name]
    if key.default is not None:
        return False
    if section != "machine":
        return not key.follows
    return name in constants_of(model) and key.follows not in constants_of(model)


def foreign(values: Iterable[str], model: str) -> list[str]:
    """A line for every key of [machine] that this model does not have."""
    known = constants_of(model) | {MODEL}
    return [
        f"machine.{name}: the model {model} has no such value"
        for name in values
        if name not in known
    ]


#: Values that name a file.
FILES = {
    f"{s}.{name}" for s, keys in KEYS.items() for name, key in keys.items() if key.kind == "file"
}

#: What 0 means, and the smallest other value: far below any machine's, and computable.
ZERO_OR_AT_LEAST = {
    "machine.psi_knee_Wb": ("linear", 1e-3),  # smaller ones overflow the power law
    "inverter.link_F": ("a stiff link", 1e-6),
    "inverter.source_H": ("none", 1e-7),
    "inverter.line_Hz": ("a direct source", 1.0),
    "inverter.precharge_ohm": ("none", 1e-3),
    "inverter.chopper_ohm": ("none", 1e-3),
    "load.holding_Nm": ("none", 1e-3),
    "rated.torque_Nm": ("not known", 1e-4),
    "rated.speed_rpm": ("not known", 1e-2),
    "rated.current_A": ("not known", 1e-3),
    "rated.flux_Wb": ("not known", 1e-4),
}

#: Controller parameters that follow from the rest unless a file sets them.
TIMING_OWNS = ("load_mode", "predict", "write_delay_us")

SECTIONS = (*KEYS, "controller")

#: The profile of a scenario: references, loads and events over time.
PROFILE: dict[str, Key] = {
    "duration_s": _n("simulated time", "s", 0.001, 3600),
    "speed_rpm": Key("steps", "speed reference", "r/min", -MOST_RPM, MOST_RPM),
    "load_Nm": Key("steps", "load torque", "N m", -MOST_NM, MOST_NM),
    "vdc_V": Key("steps", "dc-link voltage; with link_F that of its source", "V", 0, MOST_V),
    "set": Key("entries", "parameters in flight: [[time_s, name, value], ...]"),
    "command": Key(
        "entries",
        "[[time_s, stop or start], ...]; the drive is started at time 0 unless the first one is a "
        "start",
    ),
    "broken": Key("entries", "legs that break: [[time_s, phase, kind], ...]"),
    "samples_per_period": Key("samples", "samples of the plant per control period"),
}
