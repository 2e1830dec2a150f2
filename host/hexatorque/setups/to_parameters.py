"""From a set-up to the parameters of the controller.

The simulation, a board and the initial values of an image take them from here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .derived import Known, rules_of
from .design import below_source
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


def decided(setup: Values, initial: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The controller parameters that the set-up gives or that follow from it. The firmware's
    defaults are not among them. A rule may use one, for example the flux reference, at which a
    saturating machine's inductances hold. Where there is no compiled firmware to ask, the caller
    gives them."""
    known = Known(setup, _initial() if initial is None else initial)
    return {name: known[name] for name in (*known.rules, *setup.values["controller"])}


def _initial() -> dict[str, Any]:
    from .. import firmware

    return {name: row.show(row.initial) for name, row in firmware.parameters().items()}


def refused(setup: Values) -> list[str]:
    """A line for every value that the firmware on the set-up's board refuses: a board's ranges are
    narrower than the firmware's. If each value is in its range, a line for the first parameters
    that do not fit together, or for what the scheme's law cannot work with."""
    from .. import firmware

    lines = []
    rules = rules_of(setup)
    device = setup["timing.device"]
    table = firmware.parameters(device)
    values = {name: row.initial for name, row in table.items()}
    for name, value in decided(setup).items():
        try:
            values[name] = table[name].parse(value)
        except firmware.FirmwareError as error:
            given = name in setup.values["controller"]
            from_inverter = name == "dead_time_us" and not given
            section = "inverter" if from_inverter else "controller"
            rule = "" if given or from_inverter else f"; derived: {rules[name].text}"
            lines.append(f"{section}.{error}{rule}")
    return lines or _misfit(setup, values) or _refused_by_law(setup, values)


def _misfit(setup: Values, values: dict[str, float]) -> list[str]:
    """A line for the first parameters that do not fit together, with where each is from."""
    from .. import firmware

    misfit = firmware.misfit_of(setup["timing.device"], list(values.values()))
    if not misfit:
        return []
    table, rules = firmware.parameters(), rules_of(setup)
    reason = firmware.misfit_reason(misfit, lambda name: table[name].show(values[name]))
    line = f"controller.{reason}"
    for name in firmware.misfit_names(misfit):
        if name not in setup.values["controller"]:
            source = f"derived: {rules[name].text}" if name in rules else "the firmware's default"
            line += f"; {name} is {source}"
    return [line]


def _refused_by_law(setup: Values, values: dict[str, float]) -> list[str]:
    """A line for every value that the scheme's law cannot work with."""
    from .. import firmware

    scheme = firmware.schemes()[int(values["scheme"])]
    if not firmware.needs_prediction(scheme):
        return []
    lines = []
    latency = setup["timing.latency"]
    if latency != "predicted":
        lines.append(f"timing.latency = {latency}: {scheme} allows predicted only")
    inductance_H = min(values["sigma_ls_H"], values["ld_H"] if values["machine"] else math.inf)
    least_Hz = firmware.lib.ht_voltage_law_least_Hz(values["rs_ohm"], inductance_H, values["lxy_H"])
    if not values["f_isr_Hz"] >= least_Hz:
        lines.append(
            f"controller.f_isr_Hz = {values['f_isr_Hz']:g}: {scheme} allows {least_Hz:.0f} Hz and "
            "more with this machine's time constants"
        )
    return lines


def beside_the_plant(setup: Values) -> list[str]:
    """A line for every parameter that leaves something of the plant without its use, and
    `load_before_flux`."""
    values, lines = parameters(setup), []
    by_drive = float(values["chopper_on_V"]) > 0
    if by_drive:
        path = "controller.chopper_off_V"
        if too_low := below_source(setup, path, float(values["chopper_off_V"])):
            lines.append(too_low)
    if setup["inverter.chopper_ohm"] > 0:
        if setup["inverter.chopper_on_V"] == 0 and not by_drive:
            lines.append(
                "inverter.chopper_on_V = 0: the drive's output switches the chopper, so "
                "controller.chopper_on_V must be above 0"
            )
        on_V, trip_V = setup["inverter.chopper_on_V"], float(values["vdc_max_V"])
        if on_V >= trip_V:
            lines.append(
                f"inverter.chopper_on_V = {on_V:g}: allowed is less than {trip_V:g} V, "
                "controller.vdc_max_V, where the drive trips"
            )
    volts, level_V = setup["inverter.vdc_V"], float(values["precharge_V"])
    if setup["inverter.precharge_ohm"] > 0 and level_V == 0:
        lines.append(
            "inverter.precharge_ohm needs controller.precharge_V above 0: else no relay bridges it"
        )
    if level_V >= volts:
        lines.append(
            f"controller.precharge_V = {level_V:g}: allowed is less than {volts:g} V, "
            "inverter.vdc_V, to which the link is charged"
        )
    if setup["load.holding_Nm"] > 0 and float(values["brake_open_s"]) == 0:
        lines.append("load.holding_Nm needs controller.brake_open_s above 0: else nothing opens it")
    lines += _too_fast_without_gates(setup, values, volts)
    if file := setup.machine_values().get("flux_map"):
        from . import flux_table

        lines += flux_table.refused(file, setup["machine.psi_f_Wb"], float(values["i_ab_trip_A"]))
    return lines or load_before_flux(setup)


def _too_fast_without_gates(setup: Values, values: dict[str, Any], volts: float) -> list[str]:
    """A line if the magnets drive current into the dc link before the speed trip takes the gates
    off, which then does not end it: those of the machine, and those that the drive believes in. The
    firmware, which knows no nominal voltage, allows up to `vdc_max_V`."""
    from .. import firmware

    if (setup["machine.model"], values["trip_state"]) != ("magnet", "gates-off"):
        return []
    machine: Any = Known(setup, values).machine
    most_rpm = max(machine.ceiling_rpm(volts), firmware.induced_rpm(values, volts))
    trip_rpm = float(values["speed_trip_rpm"])
    if trip_rpm <= most_rpm:
        return []
    return [
        f"controller.speed_trip_rpm = {trip_rpm:g}: allowed is up to {math.floor(most_rpm)} r/min, "
        f"where the magnets induce {volts:g} V, inverter.vdc_V, and gates off do not end the "
        "current; controller.trip_state = short-circuit permits more"
    ]


def load_before_flux(setup: Values) -> list[str]:
    """A line if a constant load turns the shaft so far before the machine has flux that the drive
    trips. Other loads only resist motion. A holding brake takes its torque until then."""
    if setup["load.kind"] != "constant":
        return []
    values = parameters(setup)
    ready_s = float(values["calibration_s"]) + float(values["build_s"])
    if setup.profile.starts_later:
        ready_s += setup.profile.command[0][0]
    steps = setup.profile.load_Nm
    ends = [*(time_s for time_s, _ in steps[1:]), ready_s]
    speed_rpm = 0.0
    for (begin_s, load_Nm), end_s in zip(steps, ends):
        seconds = max(0.0, min(end_s, ready_s) - begin_s)
        turning_Nm = max(0.0, abs(load_Nm) - setup["load.holding_Nm"])
        speed_rpm += turning_Nm * seconds / setup["machine.inertia_kgm2"] * 30 / math.pi
        if abs(speed_rpm) > float(values["start_max_rpm"]):
            return [
                f"profile.load_Nm: {load_Nm:g} N m from {begin_s:g} s turn the shaft before the "
                f"machine has flux, at {ready_s:g} s (calibration_s + build_s): begin the load "
                "later, or give load.kind fan, brake, generator or friction"
            ]
    return []


#: What no parameter of the controller tells: it belongs to the plant, or to the simulation.
NOT_ON_A_BOARD = {
    "machine": (
        "inertia_kgm2",
        "viscous_Nms",
        "drs_ohm",
        "dlls_H",
        "flux_map",
        "cogging_Nm",
        "cogging_per_rev",
        "start_deg",
        "leads",
    ),
    "inverter": (
        "vdc_V",
        "source_ohm",
        "source_H",
        "line_Hz",
        "precharge_ohm",
        "chopper_ohm",
        "chopper_on_V",
        "chopper_off_V",
        "min_pulse_us",
        "arc_V",
        "restrike_V_per_ms",
        "bounce_ms",
    ),
    "sensors": (
        "adc_bits",
        "i_offset_A",
        "i_gain",
        "i_wires",
        "i_filter_Hz",
        "i_noise_A",
        "noise_seed",
        "encoder_error_cycles",
        "encoder_index_deg",
        "absolute_deg",
        "absolute_fault",
        "encoder_wires",
    ),
    "timing": ("device",),
    "load": ("kind", "at_rpm", "holding_Nm"),
    "heat": ("sink_s", "switch_V_per_K", "diode_V_per_K"),
    "rated": ("torque_Nm", "speed_rpm", "current_A", "flux_Wb"),
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
