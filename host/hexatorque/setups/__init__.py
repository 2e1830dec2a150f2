"""Set-ups and scenarios: TOML files with every value named, checked and tagged.

A *set-up* describes machine, inverter, sensors, timing, load and controller. A
*scenario* starts from a set-up (`setup = "paper-b"`), overrides values and adds a
profile of references and loads over time.

A value is either bare (`rs_ohm = 1.8`) or carries where it comes from:
`rs_ohm = { value = 1.8, tag = "paper", note = "Table III" }` with tag paper,
assumed or measured. Unknown keys and impossible values are refused with the key's
name and the allowed range.
"""

from __future__ import annotations

import difflib
import itertools
import math
import tomllib
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

from .. import firmware
from ..errors import HexatorqueError

TAGS = ("paper", "assumed", "measured")
#: Values that the user's own file or command line gives.
USER = "user"
LATENCIES = ("none", "immediate", "shadow", "predicted")
LOADS = ("constant", "fan", "brake", "generator", "friction")


class SetupError(HexatorqueError, ValueError):
    """A set-up or scenario that cannot be used; says which key and why."""

    exit_code = 2


@dataclass(frozen=True)
class Key:
    """One quantity of a set-up."""

    kind: str  #: "number", "integer", "phases" (six numbers) or "choice"
    help: str
    unit: str = ""
    min: float = -math.inf
    max: float = math.inf
    choices: tuple[str, ...] = ()
    default: Any = None  #: None = must be given


def _n(help: str, unit: str, low: float, high: float, default: float | None = None) -> Key:
    return Key("number", help, unit, low, high, default=default)


def _six(help: str, unit: str, low: float, high: float, default: float = 0.0) -> Key:
    return Key("phases", help, unit, low, high, default=(default,) * 6)


#: Everything a set-up holds besides the controller's parameters, which the
#: firmware's own table defines.
KEYS: dict[str, dict[str, Key]] = {
    "machine": {
        "pole_pairs": Key("integer", "pole pairs", "", 1, 64),
        "rs_ohm": _n("stator resistance", "ohm", 1e-4, 1e3),
        "rr_ohm": _n("rotor resistance, referred", "ohm", 1e-4, 1e3),
        "lls_H": _n("stator leakage inductance", "H", 1e-6, 10),
        "llr_H": _n("rotor leakage inductance, referred", "H", 1e-6, 10),
        "lm_H": _n("magnetising inductance", "H", 1e-5, 100),
        "lxy_H": _n("inductance of the x-y plane", "H", 1e-6, 10),
        "inertia_kgm2": _n("inertia, load included", "kg m2", 1e-6, 1e5),
        "viscous_Nms": _n("viscous friction", "N m s", 0, 1e3, 0.0),
        "drs_ohm": _six("stator resistance added per phase u1 u2 w1 w2 v1 v2", "ohm", -1e3, 1e3),
        "dlls_H": _six("leakage added per phase u1 u2 w1 w2 v1 v2", "H", -10, 10),
        "psi_knee_Wb": _n(
            "main flux that takes twice the unsaturated current, 0: linear", "Wb", 0, 100, 0.0
        ),
        "saturation_exponent": _n("how sharply the main flux saturates", "", 1, 20, 6.0),
    },
    "inverter": {
        "vdc_V": _n("dc-link voltage", "V", 1, 1e4),
        "dead_time_us": _n("dead time", "us", 0, 20),
        "min_pulse_us": _n("gate pulses shorter than this are suppressed", "us", 0, 10, 0.0),
        "v_switch_V": _n("threshold voltage of a conducting switch", "V", 0, 10, 0.0),
        "v_diode_V": _n("threshold voltage of a conducting diode", "V", 0, 10, 0.0),
        "r_switch_ohm": _n("on-resistance of a switch", "ohm", 0, 10, 0.0),
        "r_diode_ohm": _n("on-resistance of a diode", "ohm", 0, 10, 0.0),
    },
    "sensors": {
        "adc_bits": Key("integer", "resolution of the converter", "", 6, 12, default=12),
        "i_full_A": _n("phase current at full scale, either sign", "A", 0.1, 1e4),
        "vdc_full_V": _n("dc-link voltage at full scale", "V", 1, 1e4),
        "i_offset_A": _six("current sensor offset", "A", -1e3, 1e3),
        "i_gain": _six("current sensor gain, 1 = exact", "", 0.5, 2, 1.0),
        "i_filter_Hz": _n("corner of the current sensors' filter, 0: none", "Hz", 0, 1e7, 0.0),
        "i_noise_A": _n("current sensor noise, rms, white at the converter", "A", 0, 100, 0.0),
        "noise_seed": Key("integer", "the same seed gives the same noise", "", 1, 1e9, default=1),
        "encoder_ppr": Key("integer", "encoder pulses per revolution", "", 1, 1_000_000),
        "encoder_error_cycles": _n(
            "rise of the encoder's channel B late, fall early by this", "cycles", 0, 0.1, 0.0
        ),
        "sample_delay_us": _n("counter zero to sample and hold", "us", 0, 40, 0.0),
    },
    "timing": {
        "device": Key("choice", "DSP", choices=firmware.DEVICES),
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
    },
    "point": {
        "speed_rpm": _n("operating point of `compare`: speed", "r/min", -3e4, 3e4, 0.0),
        "load_Nm": _n("operating point of `compare`: load torque", "N m", -1e4, 1e4, 0.0),
    },
}

#: Far below any machine's; smaller ones overflow the power law.
SMALLEST_KNEE_WB = 1e-3

#: Controller parameters that follow from the rest unless a file sets them.
TIMING_OWNS = ("load_mode", "predict", "write_delay_us")


@dataclass(frozen=True)
class Value:
    value: Any
    tag: str
    note: str = ""


@dataclass(frozen=True)
class Profile:
    """References and loads over time. Steps are (time s, value)."""

    duration_s: float = 1.0
    speed_rpm: tuple[tuple[float, float], ...] = ()
    load_Nm: tuple[tuple[float, float], ...] = ()
    vdc_V: tuple[tuple[float, float], ...] = ()
    set: tuple[tuple[float, str, Any], ...] = ()  #: (time, controller parameter, value)
    samples_per_period: int = 4


@dataclass(frozen=True)
class Setup:
    """A checked set-up. `values[section][key]`; controller values are those the
    file gave, the rest follows from the machine or is the firmware's default."""

    name: str
    title: str
    values: dict[str, dict[str, Value]]
    paper: str = ""
    profile: Profile = field(default_factory=Profile)

    def __getitem__(self, path: str) -> Any:
        section, key = path.split(".")
        if section in KEYS and key not in self.values[section]:
            return KEYS[section][key].default
        return self.values[section][key].value

    def changed(self, **paths: Any) -> Setup:
        """A copy with some values changed: `changed(controller__scheme="ddr")`."""
        values = {section: dict(entries) for section, entries in self.values.items()}
        for path, value in paths.items():
            section, key = path.split("__", 1)
            if section not in values:
                raise SetupError(f"unknown section {section!r}{_suggest(section, list(values))}")
            values[section][key] = _value(section, key, value, USER)
        result = replace(self, values=values)
        _consistent(result)
        return result

    def parameter(self, name: str) -> Any:
        """A controller parameter's effective value, the firmware's default included."""
        row = firmware.parameters()[name]
        return self.controller_values().get(name, row.show(row.initial))

    def controller_values(self) -> dict[str, Any]:
        """All controller parameters that are not the firmware's default."""
        from ..plant.machines.induction import Parameters

        given = {key: value.value for key, value in self.values.get("controller", {}).items()}
        flux_ref_Wb = given.get("flux_ref_Wb", firmware.parameters()["flux_ref_Wb"].initial)
        machine = Parameters(**self.machine_values()).linear_at(flux_ref_Wb)
        latency = self["timing.latency"]
        immediate = latency in ("none", "immediate")
        derived: dict[str, Any] = {
            "pole_pairs": machine.pole_pairs,
            "rs_ohm": machine.rs_ohm + self._mean_of_devices("r", "ohm"),
            "drop_V": self._mean_of_devices("v", "V"),
            "sigma_ls_H": machine.sigma_ls_H,
            "lxy_H": machine.lxy_H,
            "rr_ohm": machine.rr_ohm,
            "lr_H": machine.lr_H,
            "lm_H": machine.lm_H,
            "dead_time_us": self["inverter.dead_time_us"],
            "i_full_A": self["sensors.i_full_A"],
            "vdc_full_V": self["sensors.vdc_full_V"],
            "encoder_counts_rev": 4 * self["sensors.encoder_ppr"],
            "load_mode": "immediate" if immediate else "shadow",
            "predict": "on" if latency == "predicted" else "off",
            "write_delay_us": self.write_delay_us if immediate else 0.0,
        }
        derived["i_sum_trip_A"] = max(0.01, 0.1 * self["sensors.i_full_A"])
        if "i_trip_A" in given:
            derived["i_ab_trip_A"] = 1.2 * given["i_trip_A"]
        if "flux_ref_Wb" in given:
            derived["flux_trip_Wb"] = 2.5 * given["flux_ref_Wb"]
        merged = {**derived, **given}
        table = firmware.parameters(self["timing.device"])  # a board has narrower ranges
        for key, value in merged.items():
            try:
                table[key].parse(value)
            except firmware.FirmwareError as error:
                derived_dead_time = key == "dead_time_us" and key not in given
                section = "inverter" if derived_dead_time else "controller"
                raise SetupError(f"{section}.{error}") from None
        return merged

    def _mean_of_devices(self, what: str, unit: str) -> float:
        """Switches and diodes share the time that a leg carries its current."""
        return 0.5 * sum(self[f"inverter.{what}_{device}_{unit}"] for device in ("switch", "diode"))

    @property
    def write_delay_us(self) -> float:
        """Counter zero to register write."""
        if self["timing.latency"] == "none":
            return self["sensors.sample_delay_us"]
        return self["sensors.sample_delay_us"] + self["timing.isr_us"]

    def machine_values(self) -> dict[str, Any]:
        return {key: self[f"machine.{key}"] for key in KEYS["machine"]}

    def summary(self) -> dict[str, dict[str, Any]]:
        """Plain values, for a recording's metadata."""
        plain = {s: {k: self[f"{s}.{k}"] for k in keys} for s, keys in KEYS.items()}
        plain["controller"] = self.controller_values()
        return plain


def _suggest(word: str, known: list[str]) -> str:
    close = difflib.get_close_matches(word, known, 1)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(known)}"


def _number(path: str, value: Any, low: float, high: float, unit: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise SetupError(f"{path} = {value!r}: a number is needed")
    if isinstance(value, int) and abs(value) > 10**18:
        raise SetupError(f"{path}: far out of the allowed range {low:g} .. {high:g} {unit}")
    if not low <= value <= high:
        raise SetupError(
            f"{path} = {value:g}: allowed range is {low:g} .. {high:g} {unit}".rstrip()
        )
    return float(value)


def _check(section: str, key: str, value: Any) -> Any:
    """Check one bare value; returns it in its canonical type."""
    path = f"{section}.{key}"
    if section == "controller":
        if key in TIMING_OWNS:
            raise SetupError(f"{path}: set timing.latency ({', '.join(LATENCIES)}) instead")
        table = firmware.parameters()
        if key not in table:
            raise SetupError(f"unknown key {path}{_suggest(key, list(table))}")
        try:
            table[key].parse(value)
        except firmware.FirmwareError as error:
            raise SetupError(f"controller.{error}") from None
        return value
    if key not in KEYS[section]:
        raise SetupError(f"unknown key {path}{_suggest(key, list(KEYS[section]))}")
    spec = KEYS[section][key]
    if spec.kind == "choice":
        if value not in spec.choices:
            raise SetupError(f"{path} = {value!r}: choose one of {', '.join(spec.choices)}")
        return value
    if spec.kind == "phases":
        if not isinstance(value, (list, tuple)) or len(value) != 6:
            raise SetupError(f"{path} = {value!r}: six numbers are needed (u1 u2 w1 w2 v1 v2)")
        return tuple(_number(path, v, spec.min, spec.max, spec.unit) for v in value)
    number = _number(path, value, spec.min, spec.max, spec.unit)
    if spec.kind == "integer":
        if number != int(number):
            allowed = f"{spec.min:.9g} .. {spec.max:.9g}"
            raise SetupError(f"{path} = {value!r}: allowed range is {allowed}, whole numbers only")
        return int(number)
    return number


def _value(section: str, key: str, raw: Any, default_tag: str) -> Value:
    tag, note = default_tag, ""
    if isinstance(raw, dict):
        unknown = set(raw) - {"value", "tag", "note"}
        if unknown or "value" not in raw:
            raise SetupError(f"{section}.{key}: expected value, tag, note; got {sorted(raw)}")
        tag, note = raw.get("tag", default_tag), raw.get("note", "")
        if not isinstance(note, str):
            raise SetupError(f"{section}.{key}: the note must be text")
        if tag not in (*TAGS, USER):
            raise SetupError(f"{section}.{key}: tag {tag!r}, choose one of {', '.join(TAGS)}")
        raw = raw["value"]
    return Value(_check(section, key, raw), tag, note)


def _steps(path: str, raw: Any, low: float, high: float, unit: str) -> tuple:
    if isinstance(raw, (int, float)) and not isinstance(raw, bool):
        raw = [[0.0, raw]]
    if not isinstance(raw, list) or not all(isinstance(s, list) and len(s) == 2 for s in raw):
        raise SetupError(f"{path}: a number or a list of [time_s, value] pairs is needed")
    steps = tuple(
        (_number(f"{path} time", t, 0, 1e6, "s"), _number(path, v, low, high, unit)) for t, v in raw
    )
    if any(b[0] <= a[0] for a, b in itertools.pairwise(steps)):
        raise SetupError(f"{path}: times must ascend")
    return steps


def _profile(raw: Any) -> Profile:
    if not isinstance(raw, dict):
        raise SetupError("profile: a table is needed")
    known = list(Profile.__dataclass_fields__)
    for key in raw:
        if key not in known:
            raise SetupError(f"unknown key profile.{key}{_suggest(key, known)}")
    sets = []
    if not isinstance(raw.get("set", []), list):
        raise SetupError("profile.set: a list of [time_s, parameter, value] is needed")
    for entry in raw.get("set", []):
        if not isinstance(entry, list) or len(entry) != 3 or not isinstance(entry[1], str):
            raise SetupError("profile.set: a list of [time_s, parameter, value] is needed")
        time_s = _number("profile.set time", entry[0], 0, 1e6, "s")
        value = _check("controller", entry[1], entry[2])
        if not firmware.parameters()[entry[1]].live:
            raise SetupError(f"profile.set: {entry[1]} cannot change while the drive runs")
        sets.append((time_s, entry[1], value))
    samples = raw.get("samples_per_period", Profile.samples_per_period)
    if type(samples) is not int or samples not in (1, 2, 4, 5, 8, 10, 20):
        raise SetupError(
            f"profile.samples_per_period = {samples!r}: choose one of 1, 2, 4, 5, 8, 10, 20"
        )
    duration = raw.get("duration_s", Profile.duration_s)
    return Profile(
        duration_s=_number("profile.duration_s", duration, 0.001, 3600, "s"),
        speed_rpm=_steps("profile.speed_rpm", raw.get("speed_rpm", []), -3e4, 3e4, "r/min"),
        load_Nm=_steps("profile.load_Nm", raw.get("load_Nm", []), -1e4, 1e4, "N m"),
        vdc_V=_steps("profile.vdc_V", raw.get("vdc_V", []), 0, 1e4, "V"),
        set=tuple(sorted(sets, key=lambda s: s[0])),
        samples_per_period=samples,
    )


def builtin_names() -> list[str]:
    folder = resources.files(__package__) / "builtin"
    names = [path.name for path in folder.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load(name_or_path: str | Path) -> Setup:
    """A built-in set-up by name, or a set-up or scenario file."""
    text = str(name_or_path)
    if text in builtin_names():
        source = (resources.files(__package__) / "builtin" / f"{text}.toml").read_text()
        return parse(source, text)
    path = Path(name_or_path)
    if not path.suffix and not path.exists():
        raise SetupError(f"no set-up {text!r}{_suggest(text, builtin_names())}")
    try:
        source = path.read_text()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise SetupError(f"{path}: {reason}") from None
    try:
        return parse(source, path.stem)
    except SetupError as error:
        raise SetupError(f"{path}: {error}") from None


def parse(source: str, name: str) -> Setup:
    """Check the text of a set-up or scenario."""
    try:
        data = tomllib.loads(source)
    except tomllib.TOMLDecodeError as error:
        raise SetupError(f"not valid TOML: {error}") from None
    sections = [*KEYS, "controller"]
    for key in data:
        if key not in (*sections, "setup", "title", "paper", "profile"):
            known = [*sections, "setup", "title", "paper", "profile"]
            raise SetupError(f"unknown section {key!r}{_suggest(key, known)}")
    for key in ("setup", "title", "paper"):
        if not isinstance(data.get(key, ""), str):
            raise SetupError(f"{key} = {data[key]!r}: text is needed")
    try:
        base = load(data["setup"]) if "setup" in data else None
    except RecursionError:
        raise SetupError(f"setup = {data['setup']!r}: the files refer to each other") from None
    values = {s: dict(base.values.get(s, {})) if base else {} for s in sections}
    for section in sections:
        entries = data.get(section, {})
        if not isinstance(entries, dict):
            raise SetupError(f"{section}: a table is needed")
        for key, raw in entries.items():
            values[section][key] = _value(section, key, raw, USER)
    for section, keys in KEYS.items():
        for key, spec in keys.items():
            if spec.default is None and key not in values[section]:
                raise SetupError(f"{section}.{key} is missing ({spec.help}, {spec.unit or '-'})")
    result = Setup(
        name,
        data.get("title", base.title if base else name),
        values,
        data.get("paper", base.paper if base else ""),
        _profile(data["profile"]) if "profile" in data else (base.profile if base else Profile()),
    )
    _consistent(result)
    return result


def _consistent(setup: Setup) -> None:
    """Checks over several values."""
    for key in ("rs_ohm", "lls_H"):
        change = setup[f"machine.d{key}"]
        if min(change) + setup[f"machine.{key}"] <= 0:
            raise SetupError(f"machine.d{key}: {key} plus its change must stay above 0")
    if min(setup["machine.dlls_H"]) + setup["machine.lxy_H"] <= 0:
        raise SetupError("machine.dlls_H: lxy_H plus its change must stay above 0")
    if 0 < setup["machine.psi_knee_Wb"] < SMALLEST_KNEE_WB:
        raise SetupError(
            f"machine.psi_knee_Wb = {setup['machine.psi_knee_Wb']:g}: allowed is 0 (linear) "
            f"or {SMALLEST_KNEE_WB:g} Wb and more"
        )
    if setup["inverter.vdc_V"] > setup["sensors.vdc_full_V"]:
        raise SetupError("inverter.vdc_V is above sensors.vdc_full_V")
    setup.controller_values()


def describe(setup: Setup) -> dict[str, dict[str, dict[str, Any]]]:
    """Every value with unit, tag and note, defaults and derived values included."""
    table = firmware.parameters()
    described: dict[str, dict[str, dict[str, Any]]] = {}
    for section, keys in KEYS.items():
        described[section] = {}
        for key, spec in keys.items():
            given = setup.values[section].get(key, Value(spec.default, "default"))
            described[section][key] = _row(given, spec.unit, spec.help)
    described["controller"] = {}
    effective = setup.controller_values()
    for key, parameter in table.items():
        if key in setup.values["controller"]:
            given = setup.values["controller"][key]
        elif key in effective:
            given = Value(effective[key], "derived")
        else:
            given = Value(parameter.show(parameter.initial), "default")
        described["controller"][key] = _row(given, parameter.unit, parameter.help)
    return described


def _row(given: Value, unit: str, help: str) -> dict[str, Any]:
    return {"value": given.value, "unit": unit, "tag": given.tag, "note": given.note or help}


def show(value: Any) -> str:
    """A value as a person would write it."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(show(v) for v in value) + "]"
    return str(value)
