"""The simulated hardware that a set-up describes, with the registers of its chip: the records that
the plant computes with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .. import firmware
from ..plant import load as loads
from ..plant.inverter import inverter_record, longest_step_s
from ..plant.iron import IRON_RAD_S
from ..plant.legs import DROPS
from ..plant.link import LINK_KEYS, charge, longest_link_step_s
from ..plant.loop import TIMING
from ..plant.machines import constants_of
from ..plant.pwm import PWM_MAP
from ..plant.record import names_of, record
from ..plant.sensors import sensors_record
from ..setups import Setup, SetupError

#: Steps shorter than this are refused: the simulation would take too long.
SHORTEST_STEP_S = 0.1e-6


def timing(setup: Setup, controller: firmware.Controller, longest_s: float) -> np.record:
    """Counts and clock of the loop, with this longest step."""
    clock_Hz, counts = float(controller.map.pwm_clock_Hz), controller.period_counts
    sample_count = round(setup["sensors.sample_delay_us"] * 1e-6 * clock_Hz)
    write_count = round(setup.write_delay_us * 1e-6 * clock_Hz)
    if controller.shadow:
        write_count = max(1, write_count)
    if not sample_count <= write_count < counts:
        raise SetupError(
            f"sensors.sample_delay_us + timing.isr_us = {write_count / clock_Hz * 1e6:.3g} us: "
            f"must end within the period of {counts / clock_Hz * 1e6:.4g} us"
        )
    return record(
        TIMING,
        clock_Hz=clock_Hz,
        period=counts,
        sample_count=sample_count,
        write_count=write_count,
        slow_every=controller.fast_per_slow,
        max_step=max(1, int(longest_s * clock_Hz)),
    )


def inverter(
    setup: Setup, leads: Sequence[int], machine: np.record, port: firmware.CData
) -> np.record:
    """leads: the machine's phase on each leg; port: the firmware's."""
    made = inverter_record(
        leads,
        range_A=setup["sensors.i_full_A"],
        displacement_deg=setup.machine_values()["displacement_deg"],
        **{
            name: setup[f"inverter.{name}"]
            for name in (*DROPS, *LINK_KEYS, "arc_V", "restrike_V_per_ms")
        },
    )
    charge(made.link, setup["inverter.vdc_V"])
    set_pin(made.link.relay, port, firmware.lib.HT_OUT_PRECHARGE)
    if setup["inverter.chopper_ohm"] > 0 and setup["inverter.chopper_on_V"] == 0:
        set_pin(made.link.chopper, port, firmware.lib.HT_OUT_CHOPPER)
    if made.devices.drops and longest_step_s(made, machine) < SHORTEST_STEP_S:
        raise SetupError(
            "inverter.v_switch_V, v_diode_V, r_switch_ohm, r_diode_ohm: too large for the "
            "machine's smallest leakage inductance, the simulation would need steps below "
            f"{SHORTEST_STEP_S * 1e6:g} us"
        )
    if made.link.on and _shortest_link_step_s(made.link, machine) < SHORTEST_STEP_S:
        raise SetupError(
            "inverter.link_F, source_ohm, source_H, precharge_ohm, chopper_ohm: with link_F = "
            f"{made.link.link_F:g} the simulation would need steps below "
            f"{SHORTEST_STEP_S * 1e6:g} us: give more capacitance or resistance"
        )
    return made


def load(setup: Setup, machine: np.record, inverter: np.record, port: firmware.CData) -> np.record:
    """The load on the shaft, none yet; a holding brake is closed. port: the firmware's."""
    made = loads.load_record(setup["load.kind"], 0.0, setup["load.at_rpm"]).copy()
    brake = made.brake
    brake.torque_Nm = brake.closed_Nm = inverter.brake_Nm = setup["load.holding_Nm"]
    brake.open_s, brake.close_s = setup["load.holding_open_s"], setup["load.holding_close_s"]
    brake.inertia_kgm2 = machine.inertia
    set_pin(brake.pin, port, firmware.lib.HT_OUT_BRAKE)
    if brake.torque_Nm:
        brake.held, machine.inertia = 1, np.inf
    return made


def _shortest_link_step_s(link: np.record, machine: np.record) -> float:
    """With the precharge resistor and without it."""
    found = []
    for bridged in {1, int(link.bridged)}:
        other = link.copy()
        other.bridged = bridged
        found.append(longest_link_step_s(other, machine))
    return min(found)


#: Words from the levels of a GPIO port to those of the next, and where a port's directions are
#: among its control registers.
_PORT_WORDS, _DIRECTIONS = 8, 0x0A


def set_pin(pin: np.record, port: firmware.CData, output: int) -> None:
    """Set the pin at which the firmware switches an output, HT_OUT_..."""
    m, gpio = port.board.map, int(port.board.output[output.bit_length() - 1].gpio)
    group, within = divmod(gpio, 32)
    pin.level = m.gpio_data + group * _PORT_WORDS + within // 16
    pin.drives = m.gpio + group * m.gpio_stride + _DIRECTIONS + within // 16
    pin.bit = within % 16


def pwm_map(m: firmware.CData, active_low: bool = False, min_pulse_us: float = 0.0) -> np.record:
    """The layout of the PWM registers, from the firmware's own map, and what the power stage
    wants: the gate drivers' polarity and the shortest gate pulse."""
    offsets = {n: int(getattr(m, n)) for n in names_of(PWM_MAP) if hasattr(m, n)}
    offsets = {n: -1 if v == 0xFFFF else v for n, v in offsets.items()}
    min_pulse = round(min_pulse_us * 1e-6 * float(m.pwm_clock_Hz))
    return record(PWM_MAP, **offsets, active_low=int(active_low), min_pulse=min_pulse)


def sensors(setup: Setup, controller: firmware.Controller, period_s: float) -> np.record:
    return sensors_record(
        lambda name: setup[f"sensors.{name}"],
        controller.map,
        list(controller.port.board.slow_channel),
        int(controller.port.eqep),
        int(firmware.lib.HT_REGFILE_ABSOLUTE),
        firmware.lib.HT_ADC_FULL,
        firmware.lib.HT_ADC_MID,
        period_s,
    )


def swing_per_s(setup: Setup, machine: np.record, flux_ref_Wb: float) -> float:
    """The shaft's fastest swing against the field."""
    flux_Wb = setup["machine.pole_pairs"] * flux_ref_Wb
    return flux_Wb * math.sqrt(3 * float(machine.inv_l_max) / setup["machine.inertia_kgm2"])


def friction_Nms(setup: Setup) -> float:
    """Largest slope of the machine's own friction over speed, the torque of its iron included."""
    viscous_Nms = setup["machine.viscous_Nms"]
    if "iron_eddy_S" not in constants_of(setup["machine.model"]):
        return viscous_Nms
    pole_pairs, flux_Wb = setup["machine.pole_pairs"], float(setup.parameter("flux_ref_Wb"))
    slope = setup["machine.iron_hysteresis_A_Wb"] / IRON_RAD_S
    slope += setup["machine.iron_eddy_S"] * pole_pairs
    return viscous_Nms + pole_pairs * slope * flux_Wb**2


def shaft_step_s(
    setup: Setup, load: np.record, load_Nm: float, slope_Nms: float, swing_per_s: float
) -> float:
    """Longest step for the shaft. slope_Nms: of its own friction (`friction_Nms`). SetupError if
    the step is so short that the simulation would take too long."""
    inertia_kgm2 = setup["machine.inertia_kgm2"]
    at_rpm = setup["load.at_rpm"]
    step_s = float(loads.shaft_step_s(load, at_rpm, slope_Nms, inertia_kgm2, swing_per_s))
    if step_s < SHORTEST_STEP_S:
        raise SetupError(
            f"machine.inertia_kgm2 = {inertia_kgm2:g}: too small for a load of {load_Nm:g} N m of "
            f"the kind {setup['load.kind']}, the simulation would need steps below "
            f"{SHORTEST_STEP_S * 1e6:g} us"
        )
    return step_s
