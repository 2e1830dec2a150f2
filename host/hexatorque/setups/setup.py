"""A set-up that has been checked, and what can be asked of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from . import derived, to_parameters
from .keys import KEYS, SECTIONS, ZERO_OR_AT_LEAST
from .values import Profile, SetupError, Value, suggest


@dataclass(frozen=True)
class Setup:
    """A checked set-up. `values[section][key]` has what the files gave: keys that are not there
    have their default, controller parameters that are not there follow from the rest (`derived`)
    or are the firmware's default. `defaults` says how many follow."""

    name: str
    title: str
    values: dict[str, dict[str, Value]]
    paper: str = ""
    profile: Profile = field(default_factory=Profile)
    defaults: str = derived.DEFAULTS[0]

    def __getitem__(self, path: str) -> Any:
        section, key = path.split(".")
        if section in KEYS and key not in self.values[section]:
            spec = KEYS[section][key]
            return self[f"{section}.{spec.follows}"] if spec.follows else spec.default
        return self.values[section][key].value

    def changed(self, **paths: Any) -> Setup:
        """A copy with some values changed: `changed(controller__scheme="ddr")`."""
        from . import schema

        changes: dict[str, dict[str, Any]] = {}
        for path, value in paths.items():
            section, key = path.split("__", 1)
            if section not in SECTIONS:
                raise SetupError(f"unknown section {section!r}{suggest(section, SECTIONS)}")
            changes.setdefault(section, {})[key] = value
        return self.with_values(schema.check(changes))

    def with_scheme(self, scheme: str, **paths: Any) -> Setup:
        """A copy under another scheme, with `timing.latency` as the scheme needs it."""
        from .. import firmware

        if firmware.needs_prediction(scheme):
            paths.setdefault("timing__latency", "predicted")
        return self.changed(controller__scheme=scheme, **paths)

    def with_values(self, changes: dict[str, dict[str, Value]]) -> Setup:
        """A copy with some checked values changed. Refuses what does not fit together."""
        values = {s: {**entries, **changes.get(s, {})} for s, entries in self.values.items()}
        result = replace(self, values=values)
        if lines := (
            inconsistent(result)
            or to_parameters.out_of_range(result)
            or to_parameters.load_before_flux(result)
        ):
            raise SetupError("\n".join(lines))
        return result

    def parameter(self, name: str) -> Any:
        """A controller parameter's value in the simulation."""
        return to_parameters.parameters(self)[name]

    def controller_values(self) -> dict[str, Any]:
        """The controller parameters that the set-up decides; the others are the firmware's
        defaults."""
        return to_parameters.decided(self)

    @property
    def write_delay_us(self) -> float:
        """Counter zero to register write."""
        return derived.write_delay_us(self)

    def machine_values(self) -> dict[str, Any]:
        """The model's parameters."""
        values = {key: self[f"machine.{key}"] for key in KEYS["machine"] if key != "model"}
        return {**values, "leads": tuple(map(int, values["leads"]))}

    def summary(self) -> dict[str, dict[str, Any]]:
        """Plain values, for a recording's metadata. The dictionaries are the caller's."""
        return {section: dict(entries) for section, entries in self._summary.items()}

    @cached_property
    def _summary(self) -> dict[str, dict[str, Any]]:
        plain = {s: {k: self[f"{s}.{k}"] for k in keys} for s, keys in KEYS.items()}
        plain["controller"] = self.controller_values()
        return plain


def inconsistent(setup: Setup) -> list[str]:
    """What values, each in its range, say wrong together; one line each."""
    lines = []
    for key in ("rs_ohm", "lls_H"):
        if min(setup[f"machine.d{key}"]) + setup[f"machine.{key}"] <= 0:
            lines.append(f"machine.d{key}: {key} plus its change must stay above 0")
    if min(setup["machine.dlls_H"]) + setup["machine.lxy_H"] <= 0:
        lines.append("machine.dlls_H: lxy_H plus its change must stay above 0")
    for path, (zero, least) in ZERO_OR_AT_LEAST.items():
        if 0 < setup[path] < least:
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
    lines += setup.profile.too_late()
    return lines


def describe(setup: Setup) -> dict[str, dict[str, dict[str, Any]]]:
    """Every value with unit, tag and note, defaults and derived values included."""
    from .. import firmware

    described: dict[str, dict[str, dict[str, Any]]] = {}
    for section, keys in KEYS.items():
        described[section] = {}
        for key, spec in keys.items():
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
