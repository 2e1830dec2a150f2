"""From a set-up to the parameters of the controller.

The simulation, a board and the initial values of an image take them from here.
"""

from __future__ import annotations

from typing import Any

from ..plant.machines.induction_parameters import Parameters
from .values import Profile, Values


def parameters(setup: Values) -> dict[str, float | str]:
    """Every controller parameter as the simulation of the set-up uses it, choices by name."""
    from .. import firmware

    table = firmware.parameters(setup["timing.device"])
    values = decided(setup)
    return {
        name: row.show(row.parse(values[name]) if name in values else row.initial)
        for name, row in table.items()
    }


def decided(setup: Values, default_flux_Wb: float | None = None) -> dict[str, Any]:
    """The controller parameters that the set-up gives or that follow from it. The firmware's
    defaults are not among them; one has a say, the flux reference, at which a saturating
    machine's inductances hold. Where there is no compiled firmware to ask, the caller names it."""
    given = {key: value.value for key, value in setup.values["controller"].items()}
    flux_Wb = given.get("flux_ref_Wb", default_flux_Wb)
    machine = Parameters(**setup.machine_values())
    machine = machine.linear_at(_default_flux_Wb() if flux_Wb is None else flux_Wb)
    return {**_derived(setup, machine, given), **given}


def _derived(setup: Values, machine: Parameters, given: dict[str, Any]) -> dict[str, Any]:
    latency = setup["timing.latency"]
    immediate = latency in ("none", "immediate")
    derived: dict[str, Any] = {
        "pole_pairs": machine.pole_pairs,
        "rs_ohm": machine.rs_ohm + _mean_of_devices(setup, "r", "ohm"),
        "drop_V": _mean_of_devices(setup, "v", "V"),
        "sigma_ls_H": machine.sigma_ls_H,
        "lxy_H": machine.lxy_H,
        "rr_ohm": machine.rr_ohm,
        "lr_H": machine.lr_H,
        "lm_H": machine.lm_H,
        "dead_time_us": setup["inverter.dead_time_us"],
        "i_full_A": setup["sensors.i_full_A"],
        "vdc_full_V": setup["sensors.vdc_full_V"],
        "encoder_counts_rev": 4 * setup["sensors.encoder_ppr"],
        "load_mode": "immediate" if immediate else "shadow",
        "predict": "on" if latency == "predicted" else "off",
        "write_delay_us": write_delay_us(setup) if immediate else 0.0,
        "i_sum_trip_A": max(0.01, 0.1 * setup["sensors.i_full_A"]),
    }
    if "i_trip_A" in given:
        derived["i_ab_trip_A"] = 1.2 * given["i_trip_A"]
    if "flux_ref_Wb" in given:
        derived["flux_trip_Wb"] = 2.5 * given["flux_ref_Wb"]
    return derived


def _default_flux_Wb() -> float:
    from .. import firmware

    return firmware.parameters()["flux_ref_Wb"].initial


def _mean_of_devices(setup: Values, what: str, unit: str) -> float:
    """Switches and diodes share the time that a leg carries its current."""
    return 0.5 * sum(setup[f"inverter.{what}_{device}_{unit}"] for device in ("switch", "diode"))


def write_delay_us(setup: Values) -> float:
    """Counter zero to register write."""
    if setup["timing.latency"] == "none":
        return setup["sensors.sample_delay_us"]
    return setup["sensors.sample_delay_us"] + setup["timing.isr_us"]


def out_of_range(setup: Values) -> list[str]:
    """A line for every value that the board of the set-up does not allow: a board's ranges are
    narrower than the firmware's."""
    from .. import firmware

    lines = []
    table = firmware.parameters(setup["timing.device"])
    for name, value in decided(setup).items():
        try:
            table[name].parse(value)
        except firmware.FirmwareError as error:
            from_inverter = name == "dead_time_us" and name not in setup.values["controller"]
            lines.append(f"{'inverter' if from_inverter else 'controller'}.{error}")
    return lines


#: What no parameter of the controller tells: it belongs to the plant, or to the simulation.
NOT_ON_A_BOARD = {
    "machine": ("model", "inertia_kgm2", "viscous_Nms", "drs_ohm", "dlls_H", "leads"),
    "inverter": ("vdc_V", "min_pulse_us"),
    "sensors": (
        "adc_bits",
        "i_offset_A",
        "i_gain",
        "i_wires",
        "i_filter_Hz",
        "i_noise_A",
        "noise_seed",
        "encoder_error_cycles",
        "encoder_wires",
    ),
    "timing": ("device",),
    "load": ("kind", "at_rpm"),
    "point": ("speed_rpm", "load_Nm"),
}


def not_on_a_board(setup: Values) -> list[str]:
    """Paths of the values given that no parameter tells a board."""
    given = [
        f"{section}.{key}"
        for section, keys in NOT_ON_A_BOARD.items()
        for key in keys
        if key in setup.values[section]
    ]
    return [*given, *(["profile"] if setup.profile != Profile() else [])]
