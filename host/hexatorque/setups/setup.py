"""A set-up that has been checked, and its functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from ..given import pairs
from ..plant.legs import DROPS
from ..plant.machines import constants_of
from . import derived, paths, to_parameters
from .design import below_source
from .keys import KEYS, LEAST_K_W, MODEL, MOST_K_W, ZERO_OR_AT_LEAST, foreign
from .values import Profile, SetupError, Value


@dataclass(frozen=True, repr=False)
class Setup:
    """A checked set-up: every value that a simulation needs, by its key `section.key`.

    setup = hexatorque.load("paper-b")
    setup["machine.rs_ohm"]                          # 6.0, in the unit that the key ends with
    other = setup.changed({"machine.rs_ohm": 5.5})   # a copy; a set-up itself never changes

    name: of the set-up or its file; title, paper: what the file says about it; profile:
    references and loads over time (`Profile`); values[section][key]: what the files gave, with
    where it is from (`Value`): keys that are not there have their default, controller parameters
    that are not there follow from the rest or are the firmware's default, as `defaults` says
    ("derived" or "firmware").
    """

    name: str
    title: str
    values: dict[str, dict[str, Value]]
    paper: str = ""
    profile: Profile = field(default_factory=Profile)
    defaults: str = derived.DEFAULTS[0]

    def __repr__(self) -> str:
        return f"<Setup {self.name}: {self.title}, scheme {self['controller.scheme']}>"

    def __getitem__(self, path: str) -> Any:
        """The value of a key `section.key`: a number in the unit that the key's name ends with,
        the name of a choice, or six numbers for u1 u2 w1 w2 v1 v2. `controller.NAME` is the
        parameter as the simulation uses it, `profile.NAME` a field of `profile`. SetupError names
        the nearest key if there is none of this name."""
        section, _, key = str(path).partition(".")
        if section in KEYS and key in KEYS[section]:
            if key in self.values[section]:
                return self.values[section][key].value
            spec = KEYS[section][key]
            if section == "machine" and key != MODEL and key not in self._machine_keys():
                raise SetupError(foreign((key,), self["machine.model"])[0])
            if not spec.follows:
                return spec.default
            share = spec.share if self.defaults == "derived" else 1.0
            return share * self[f"{section}.{spec.follows}"]
        if section == paths.CONTROLLER and key in paths.TIMING_OWNS:
            return self.parameter(key)
        section, key = paths.split(path)
        return self.parameter(key) if section == paths.CONTROLLER else getattr(self.profile, key)

    def __iter__(self) -> Iterator[str]:
        """All keys, `section.key`, that a set-up with this model of machine has."""
        own = {f"machine.{key}" for key in self._machine_keys()}
        return (p for p in paths.every() if p in own or not p.startswith("machine."))

    def __contains__(self, path: object) -> bool:
        section, _, key = str(path).partition(".")
        if section == "machine":
            return key in self._machine_keys()
        return (section in KEYS and key in KEYS[section]) or str(path) in paths.every()

    def changed(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> Setup:
        """A copy with other values: `changed({"controller.scheme": "ddr", "machine.rs_ohm": 2})`,
        or, with two underlines for the point, `changed(controller__scheme="ddr")`. A value may be
        text, as on the command line: "2,5" is 2.5, and a scheme's name may have capital letters.
        SetupError has a line for each unknown key, each value out of range, and for values that do
        not fit together."""
        from . import schema

        given = {**pairs(values), **{path.replace("__", ".", 1): v for path, v in more.items()}}
        if not given:
            return self
        sections = paths.sections(given)
        checked = schema.check(sections)
        profile = checked.pop(paths.PROFILE_SECTION, self.profile)
        asked = {key: getattr(profile, key) for key in sections.get(paths.PROFILE_SECTION, ())}
        return replace(self, profile=replace(self.profile, **asked)).with_values(checked)

    def with_scheme(self, scheme: str, **paths: Any) -> Setup:
        """A copy under another scheme, with `timing.latency` as the scheme needs it. SetupError
        names the schemes if there is none of this name."""
        from .. import firmware

        given = {"controller.scheme": scheme}
        if firmware.needs_prediction(scheme):
            given["timing.latency"] = "predicted"
        return self.changed(given, **paths)

    def with_values(self, changes: dict[str, dict[str, Value]]) -> Setup:
        """A copy with some checked values changed, [section][key]. SetupError for what does not
        fit together. For values that are not checked there is `changed`."""
        result = self.with_part(changes)
        if lines := (
            inconsistent(result)
            or to_parameters.refused(result)
            or to_parameters.beside_the_plant(result)
        ):
            raise SetupError("\n".join(lines))
        return result

    def with_part(self, changes: dict[str, dict[str, Value]]) -> Setup:
        """The same without asking what fits together: more is to come."""
        values = {s: {**entries, **changes.get(s, {})} for s, entries in self.values.items()}
        return replace(self, values=values)

    def parameter(self, name: str) -> Any:
        """A controller parameter as the simulation uses it: a number in the unit that its name
        ends with, or the name of a choice. SetupError if there is none of this name."""
        values = to_parameters.parameters(self)
        if name not in values:
            raise SetupError(paths.unknown_key(paths.CONTROLLER, name))
        return values[name]

    def controller_values(self) -> dict[str, Any]:
        """The controller parameters that the set-up decides, name -> value; the others are the
        firmware's defaults."""
        return to_parameters.decided(self)

    @property
    def write_delay_us(self) -> float:
        """Counter zero to register write, in us."""
        return derived.write_delay_us(self)

    def machine_values(self) -> dict[str, Any]:
        """The parameters of the machine's model, by their keys: numbers, and six numbers each of
        those per phase."""
        values = {key: self[f"machine.{key}"] for key in self._machine_keys() if key != MODEL}
        return {
            **values,
            "leads": tuple(map(int, values["leads"])),
            "displacement_deg": float(values["displacement_deg"]),
        }

    def plant_values(self) -> dict[str, Any]:
        """The same for a plant: what a file has instead of the file's name."""
        values = self.machine_values()
        if file := values.get("flux_map"):
            from . import flux_table

            values["flux_map"] = flux_table.of(file)
        return values

    def _machine_keys(self) -> list[str]:
        """The keys of [machine] that the machine's model has."""
        known = constants_of(self["machine.model"]) | {MODEL}
        return [key for key in KEYS["machine"] if key in known]

    def summary(self) -> dict[str, dict[str, Any]]:
        """Plain values, [section][key], for a recording's metadata. The dictionaries are the
        caller's."""
        return {section: dict(entries) for section, entries in self._summary.items()}

    @cached_property
    def _summary(self) -> dict[str, dict[str, Any]]:
        plain: dict[str, dict[str, Any]] = {section: {} for section in KEYS}
        for path in self:
            section, key = path.split(".")
            if section in KEYS:
                plain[section][key] = self[path]
        plain["machine"] |= self.machine_values()
        plain["controller"] = self.controller_values()
        return plain


def inconsistent(setup: Setup) -> list[str]:
    """Conflicts between values that are each in range; one line each."""
    model = setup["machine.model"]
    lines = foreign(setup.values["machine"], model)
    if lines:
        return lines  # another model's values are in the place of this one's
    for added, to in (("drs_ohm", "rs_ohm"), ("dlls_H", "lls_H"), ("dlls_H", "lxy_H")):
        if not {added, to} <= constants_of(model):
            continue
        if min(setup[f"machine.{added}"]) + setup[f"machine.{to}"] <= 0:
            lines.append(f"machine.{added}: {to} plus its change must stay above 0")
    for path, (zero, least) in ZERO_OR_AT_LEAST.items():
        if path in setup and 0 < setup[path] < least:
            section, key = path.split(".")
            lines.append(
                f"{path} = {setup[path]:g}: allowed is 0 ({zero}) "
                f"or {least:g} {KEYS[section][key].unit} and more"
            )
    if sorted(setup["machine.leads"]) != list(range(1, 7)):
        lines.append("machine.leads: each phase 1 .. 6 once is needed")
    if any(channel % 1 for channel in setup["sensors.i_wires"]):
        lines.append("sensors.i_wires: whole numbers are needed")
    energies = [f"inverter.{key}" for key in ("e_on_mJ", "e_off_mJ") if setup[f"inverter.{key}"]]
    missing = [f"inverter.{key}" for key in ("e_ref_V", "e_ref_A") if not setup[f"inverter.{key}"]]
    if energies and missing:
        lines.append(f"{energies[0]} needs {' and '.join(missing)} above 0: where it is stated")
    if setup["inverter.vdc_V"] > setup["sensors.vdc_full_V"]:
        lines.append("inverter.vdc_V is above sensors.vdc_full_V")
    lines += _link_lines(setup)
    lines += _heat_lines(setup)
    lines += setup.profile.too_late()
    return lines


#: Steps of the temperatures are 5 ms long: how many of them the shortest time constant needs.
_HEAT_S = 0.05


CHAINS = ("switch_K_W", "diode_K_W")


def _heat_lines(setup: Setup) -> list[str]:
    """The same about temperatures: so quick a time lapse would leave them behind the currents."""
    lines = [
        f"heat.{key} = [0, 0, 0, 0]: allowed is {LEAST_K_W:g} to {MOST_K_W:g} K/W for one of "
        "them at least; without this key the devices are as warm as the heat sink"
        for key in CHAINS
        if key in setup.values["heat"] and sum(setup[f"heat.{key}"]) < LEAST_K_W
    ]
    chains = [key for key in CHAINS if any(setup[f"heat.{key}"])]
    heats = (*(f"inverter.{key}" for key in DROPS), "inverter.e_on_mJ", "inverter.e_off_mJ")
    if chains and not any(setup[path] for path in heats):
        lines.append(
            f"heat.{chains[0]} needs one of {', '.join(heats)} above 0: else nothing heats a device"
        )
    shortest_s = min(setup["heat.winding_s"], setup["heat.frame_s"])
    most = shortest_s / _HEAT_S
    if setup["heat.winding_K_W"] == 0 or setup["heat.time_lapse"] <= most:
        return lines
    return [
        *lines,
        f"heat.time_lapse = {setup['heat.time_lapse']:g}: allowed is up to {most:g} with a "
        f"thermal time constant of {shortest_s:g} s",
    ]


def _link_lines(setup: Setup) -> list[str]:
    """The same about the dc link: a chopper below its source would heat with the source's energy,
    and without a capacitor there is nothing that it could change."""
    lines = []
    for key, why in (
        ("line_Hz", "a rectifier feeds a capacitor"),
        ("precharge_ohm", "else there is nothing to charge"),
        ("chopper_ohm", "else nothing rises"),
    ):
        if setup[f"inverter.{key}"] > 0 and setup["inverter.link_F"] == 0:
            lines.append(f"inverter.{key} needs inverter.link_F above 0: {why}")
    if setup["inverter.line_Hz"] > 0 and setup["inverter.source_H"] == 0:
        lines.append(
            "inverter.line_Hz needs inverter.source_H above 0: a line without inductance has no "
            "commutation"
        )
    off_V, on_V = setup["inverter.chopper_off_V"], setup["inverter.chopper_on_V"]
    # At 0 the drive's output switches it: to_parameters.beside_the_plant.
    if setup["inverter.chopper_ohm"] > 0 and on_V > 0:
        if too_low := below_source(setup, "inverter.chopper_off_V", off_V):
            lines.append(too_low)
        if on_V <= off_V:
            lines.append(
                f"inverter.chopper_on_V = {on_V:g}: allowed is more than {off_V:g} V, "
                "inverter.chopper_off_V"
            )
    return lines


def describe(setup: Setup) -> dict[str, dict[str, dict[str, Any]]]:
    """Every value with unit, tag and note, defaults and derived values included."""
    from .. import firmware

    described: dict[str, dict[str, dict[str, Any]]] = {}
    for section, keys in KEYS.items():
        described[section] = {}
        for key, spec in keys.items():
            if f"{section}.{key}" not in setup:
                continue
            left_open = Value(setup[f"{section}.{key}"], "derived" if spec.follows else "default")
            given = setup.values[section].get(key, left_open)
            described[section][key] = _row(given, spec.unit, spec.help)
    described["controller"] = {}
    effective = setup.controller_values()
    rules = derived.rules_of(setup)
    for key, parameter in firmware.parameters().items():
        if key in setup.values["controller"]:
            given = setup.values["controller"][key]
        elif key in effective:
            given = Value(effective[key], "derived", rules[key].text)
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
