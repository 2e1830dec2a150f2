"""The findings of a commissioning: controller parameters, and a set-up with tag `measured`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import firmware
from ..chips import DEVICES
from ..drive.board import BoardDrive
from ..drive.interface import DriveVerbs
from ..errors import InputError
from ..setups import derived
from ..setups.keys import TIMING_OWNS
from ..setups.loading import parse
from ..setups.to_parameters import parameters
from .alignment import Alignment
from .emf import Emf
from .encoder import Encoder
from .excitation import BORROWED, frame_of
from .inductance import Inductance, Salient
from .kinds import kind_of
from .regression import Value
from .resistance import Resistance
from .rotor import Rotor
from .running import Magnetisation, Mechanics
from .wiring import Wiring


@dataclass
class Findings:
    """The findings of the steps; None where they did not run."""

    mistakes: list[str] = field(default_factory=list)
    wiring: Wiring | None = None
    encoder: Encoder | None = None
    resistance: Resistance | None = None
    inductance: Inductance | None = None
    rotor: Rotor | None = None
    magnetisation: Magnetisation | None = None
    alignment: Alignment | None = None
    salient: Salient | None = None
    emf: Emf | None = None
    mechanics: Mechanics | None = None
    noise_A: float = 0.0

    def parameters(self, drive: DriveVerbs) -> dict[str, Value]:
        """The controller parameters that follow."""
        found: dict[str, Value] = {}
        vdc_V = self.resistance.vdc_V if self.resistance else 0.0
        if self.resistance:
            found["rs_ohm"] = self.resistance.mean_ohm
            dead_V = vdc_V * 1e-6 * _number(drive, "dead_time_us") * _number(drive, "f_isr_Hz")
            lost = self.resistance.mean_lost_V
            found["drop_V"] = Value(max(0.0, lost.value - dead_V), lost.uncertainty)
        if self.inductance:
            found["sigma_ls_H"] = self.inductance.sigma_ls_H
            found["lxy_H"] = self.inductance.lxy_H
        if self.rotor:
            lm, lr = self._lm(drive)
            found["rr_ohm"], found["lm_H"], found["lr_H"] = self.rotor.rr_ohm, lm, lr
        return {**found, **self._magnets(drive), **self._gains(drive, vdc_V)}

    def _magnets(self, drive: DriveVerbs) -> dict[str, Value]:
        found: dict[str, Value] = {}
        if self.alignment and self.alignment.zero_known and drive.get("rotor_start") != "align":
            found["rotor_zero_deg"] = self.alignment.zero_deg
        if self.salient:
            ld, lq = self.salient.usable()
            found |= {"ld_H": ld, "sigma_ls_H": lq, "lxy_H": self.salient.lxy_H}
        if self.emf:
            found["psi_f_Wb"] = self.emf.psi_f_Wb
            for k, order in enumerate((5, 7)[: len(self.emf.harmonics)]):
                found[f"emf{order}_share"] = self.emf.share(k)
                found[f"emf{order}_deg"] = self.emf.degrees(k)
        return found

    def whole(self) -> bool:
        """Whether a set-up can be written."""
        coils = (self.rotor and self.inductance) or (self.emf and self.salient)
        return bool(self.resistance and coils)

    def _lm(self, drive: DriveVerbs) -> tuple[Value, Value]:
        """L_m and L_r at the flux reference: from no load if that was measured, else as found at
        standstill."""
        assert self.rotor
        leakage = self.rotor.leakage_H
        lm = self.rotor.lm_H
        if self.magnetisation:
            ls = self.magnetisation.ls_at(_number(drive, "flux_ref_Wb"))
            lm = Value(ls.value - leakage, ls.uncertainty)
        return lm, Value(lm.value + leakage, lm.uncertainty)

    def _gains(self, drive: DriveVerbs, vdc_V: float) -> dict[str, Value]:
        """Step f, by the rules of a set-up. A gain is as uncertain as what it is made from."""
        gains: dict[str, Value] = {}
        if (coils := self.inductance or self.salient) and vdc_V > 0:
            per_H = derived.kp_xy(1.0, vdc_V, 1 / _number(drive, "f_isr_Hz"))
            gains["kp_xy_pu_A"] = _times(coils.lxy_H, per_H)
            gains["ki_xy_pu_As"] = _times(coils.lxy_H, derived.ki_xy(per_H))
        if self.mechanics:
            corner = derived.corner_rad_s(_number(drive, "f_slow_Hz"))
            kp, ki = (_number(drive, name) for name in ("kp_speed_Nms_rad", "ki_speed_Nm_rad"))
            if kp > 0 and ki > 0:  # a loop that was designed for less stays as slow
                corner = min(corner, ki / derived.ki_speed(kp, 1.0))
            inertia = self.mechanics.inertia_kgm2
            gains["kp_speed_Nms_rad"] = _times(inertia, corner)
            gains["ki_speed_Nm_rad"] = _times(inertia, derived.ki_speed(corner, corner))
        return gains

    def load(self, drive: DriveVerbs) -> dict[str, Value]:
        """Write the parameters, all or none."""
        values = self.parameters(drive)
        within = {
            name: min(max(value.value, drive.params[name].min), drive.params[name].max)
            for name, value in values.items()
        }
        drive.set_many(within)
        return values


def _times(value: Value, factor: float) -> Value:
    return Value(value.value * factor, value.uncertainty * factor)


def _number(drive: DriveVerbs, name: str) -> float:
    return float(drive.get(name))


# -- the set-up ------------------------------------------------------------------------------


def set_up(found: Findings, drive: DriveVerbs, device: str, title: str) -> str:
    """The text of a set-up's file. Everything measured has the tag `measured` and its uncertainty;
    the rest is what the board was set to."""
    if not found.resistance or not found.whole():
        raise InputError(f"a set-up needs the step {kind_of(drive).whole} at least")
    values = found.parameters(drive)
    rs = values["rs_ohm"]
    machine = {
        "pole_pairs": int(_number(drive, "pole_pairs")),
        "rs_ohm": _measured(rs, note="devices' on-resistance included"),
        **(_with_magnets(values) if found.emf else _with_winding(found, values)),
        **_displacement(drive),
        "lxy_H": _measured(values["lxy_H"]),
        "drs_ohm": _six([v.value - rs.value for v in found.resistance.rs_ohm]),
    }
    if found.mechanics:
        machine["inertia_kgm2"] = _measured(found.mechanics.inertia_kgm2)
        viscous = found.mechanics.viscous_Nms
        machine["viscous_Nms"] = _measured(Value(max(0.0, viscous.value), viscous.uncertainty))
    else:
        machine["inertia_kgm2"] = _assumed(0.01, "not measured: step mechanics did not run")
    sections = {
        "machine": machine,
        "inverter": {
            "vdc_V": _measured(Value(found.resistance.vdc_V, 0.0)),
            "dead_time_us": _number(drive, "dead_time_us"),
            "v_switch_V": _measured(values["drop_V"], note="mean of switch and diode"),
            "v_diode_V": _measured(values["drop_V"], note="mean of switch and diode"),
        },
        "sensors": {
            "i_full_A": _number(drive, "i_full_A"),
            "vdc_full_V": _number(drive, "vdc_full_V"),
            "encoder_ppr": max(1, round(_number(drive, "encoder_counts_rev") / 4)),
            "i_noise_A": _measured(Value(found.noise_A, 0.0)),
        },
        "timing": {"device": device if device in DEVICES else DEVICES[0], **_latency(drive)},
        "rated": {
            "torque_Nm": _assumed(
                _short(_number(drive, "torque_limit_Nm") / derived.LIMIT_PER_RATED),
                f"torque_limit_Nm over {derived.LIMIT_PER_RATED:g}; the plate knows better",
            ),
            **({} if found.emf else {"flux_Wb": _short(_number(drive, "flux_ref_Wb"))}),
        },
    }
    if found.mechanics and found.mechanics.fan_Nms2.value > 0:
        speed_rpm = round(found.mechanics.speed_rpm)
        fan = _times(found.mechanics.fan_Nms2, (speed_rpm * np.pi / 30) ** 2)
        sections["load"] = {"kind": "fan", "at_rpm": speed_rpm}
        sections["point"] = {"speed_rpm": speed_rpm, "load_Nm": _measured(fan)}
    head = [f"title = {json.dumps(title)}", 'defaults = "firmware"', *_curves(found)]
    alone = parameters(parse(_text(head, sections), title, whole=False))
    controller = _controller(drive, values, alone)
    if found.emf:
        controller |= _below_the_ceiling({**alone, **controller}, found.resistance.vdc_V)
    return _text(head, {**sections, "controller": controller})


def _with_winding(found: Findings, values: Mapping[str, Value]) -> dict[str, object]:
    """The entries of [machine] for an induction machine's rotor."""
    assert found.rotor and found.inductance
    note = "stator and rotor leakage taken as equal"
    leakage = Value(found.rotor.leakage_H, found.inductance.sigma_ls_H.uncertainty)
    return {
        "rr_ohm": _measured(values["rr_ohm"], note=note),
        "lls_H": _measured(leakage, note=note),
        "llr_H": _measured(leakage, note=note),
        "lm_H": _measured(values["lm_H"], note=note),
    }


def _displacement(drive: DriveVerbs) -> dict[str, object]:
    """The angle between the sets, where it is not the usual one."""
    apart = frame_of(drive).displacement_deg
    return {} if apart == 30 else {"displacement_deg": round(apart)}


def _with_magnets(values: Mapping[str, Value]) -> dict[str, object]:
    """And for one with magnets."""
    entries: dict[str, object] = {
        "model": "magnet",
        "psi_f_Wb": _measured(values["psi_f_Wb"]),
        "ld_H": _measured(values["ld_H"]),
        "lq_H": _measured(values["sigma_ls_H"]),
    }
    if "emf5_share" in values:
        for key, unit in (("emf_share", "share"), ("emf_deg", "deg")):
            parts = [values[f"emf{order}_{unit}"] for order in (5, 7)]
            doubt = max(part.uncertainty for part in parts)
            entries[key] = {
                "value": [*(_short(part.value, 3) for part in parts), 0.0, 0.0],
                "tag": "measured",
                "note": f"harmonics 5 and 7, ±{doubt:.2g}; 11 and 13 not measured",
            }
    return entries


def set_up_of_board(found: Findings, drive: BoardDrive) -> str:
    """The same of a drive on a board, which says what chip it has."""
    device = drive.hello.device
    return set_up(found, drive, device.removeprefix("virtual "), f"Commissioned: {device}")


def _text(head: list[str], sections: Mapping[str, Mapping[str, object]]) -> str:
    lines = list(head)
    for name, entries in sections.items():
        lines += ["", f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in entries.items())]
    return "\n".join(lines) + "\n"


#: Controller parameters that a set-up derives from its other sections.
DERIVED = (
    "pole_pairs", "rs_ohm", "drop_V", "sigma_ls_H", "lxy_H", "rr_ohm", "lr_H", "lm_H",
    "dead_time_us", "i_full_A", "vdc_full_V", "encoder_counts_rev", "machine", "psi_f_Wb", "ld_H",
    "displacement_deg", "emf5_share", "emf5_deg", "emf7_share", "emf7_deg",
)  # fmt: skip


def _controller(
    drive: DriveVerbs, values: Mapping[str, Value], alone: Mapping[str, Any]
) -> dict[str, object]:
    """The gains, and the board's own settings that differ from those which the set-up's other
    sections make `alone`."""
    entries: dict[str, object] = {}
    leave = (*DERIVED, *TIMING_OWNS, *BORROWED, "speed_ref_rpm", "torque_ref_Nm")
    for name, row in drive.params.items():
        if name in leave:
            continue
        value = drive.get(name)
        if name in values:
            entries[name] = _measured(values[name], note="from what was measured")
        elif value != alone[name] if row.choices else np.float32(value) != np.float32(alone[name]):
            entries[name] = value
    return entries


def _below_the_ceiling(now: Mapping[str, Any], vdc_V: float) -> dict[str, object]:
    """A lower speed trip, where gates off would not end the current of the magnets that were
    measured."""
    most_rpm = firmware.induced_rpm(now, vdc_V)
    if now["trip_state"] != "gates-off" or float(now["speed_trip_rpm"]) <= most_rpm:
        return {}
    note = f"the magnets induce the dc link's voltage at {most_rpm:.0f} r/min"
    return {"speed_trip_rpm": _assumed(math.floor(derived.BELOW_CEILING * most_rpm), note)}


def _latency(drive: DriveVerbs) -> dict[str, object]:
    if drive.get("load_mode") == "shadow":
        return {"latency": "predicted" if drive.get("predict") == "on" else "shadow"}
    return {"latency": "immediate", "isr_us": _number(drive, "write_delay_us")}


def _curves(found: Findings) -> list[str]:
    lines = []
    if found.magnetisation:
        points = ", ".join(
            f"{psi:.3g} Wb {ls * 1e3:.4g} mH"
            for psi, ls in zip(found.magnetisation.flux_Wb, found.magnetisation.ls_H)
        )
        lines.append(f"# L_s at no load: {points}")
    if found.mechanics:
        lines.append(f"# friction and load: {found.mechanics.curve()}")
    return lines


def _measured(value: Value, note: str = "") -> dict[str, object]:
    spread = f"±{value.uncertainty:.2g}" if value.uncertainty else ""
    words = "; ".join(part for part in (spread, note) if part)
    return {"value": _short(value.value), "tag": "measured", **({"note": words} if words else {})}


def _assumed(value: float, note: str) -> dict[str, object]:
    return {"value": value, "tag": "assumed", "note": note}


def _six(values: list[float]) -> dict[str, object]:
    return {"value": [_short(v, 3) for v in values], "tag": "measured"}


def _short(value: float, digits: int = 5) -> float:
    return float(np.format_float_positional(value, digits, fractional=False))


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
