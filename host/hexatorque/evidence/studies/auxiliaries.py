"""Faults of auxiliary parts: thermistors, braking chopper, holding brake. This module has the
set-ups for them, injects them, and checks the pins."""

from __future__ import annotations

import numpy as np

from ... import firmware, setups
from ...drive.simulated import SimulatedDrive
from ...plant.pins import high

PLACES = ("winding", "sink")
KINDS = ("open", "short")
#: The firmware's texts for what is too hot.
HOT = tuple(text for text in firmware.FAULTS.values() if text.endswith(" hot"))
COOL_DEGC = 40.0
#: No resistor at all.
BROKEN_OHM = 1e9
BRAKES_AT_RPM = 1200.0


def thermistors(setup: setups.Setup) -> dict[str, object]:
    """Both. The winding's model follows its thermistor within tenths of a second."""
    return {
        "sensors.winding_ntc_ohm": 10e3, "sensors.sink_ntc_ohm": 5e3, "controller.winding_s": 1.0,
    }  # fmt: skip


def chopper(setup: setups.Setup) -> dict[str, object]:
    """A small link, so that little energy makes an over-voltage."""
    vdc_V = setup["inverter.vdc_V"]
    return {
        "inverter.link_F": 1e-4, "inverter.source_ohm": 1.0, "inverter.chopper_ohm": 40.0,
        "controller.chopper_on_V": 1.15 * vdc_V, "controller.chopper_off_V": 1.08 * vdc_V,
    }  # fmt: skip


def brake(setup: setups.Setup) -> dict[str, object]:
    """It holds more than the drive can."""
    return {
        "load.holding_Nm": 2.0 * float(setup.parameter("torque_limit_Nm")),
        "load.holding_open_s": 0.01, "load.holding_close_s": 0.01,
    }  # fmt: skip


def broken(place: str, kind: str) -> str:
    """The firmware's text for a thermistor that breaks so."""
    words = (place, "thermistor", kind)
    (found,) = (text for text in firmware.FAULTS.values() if all(word in text for word in words))
    return found


def break_thermistor(place: str, kind: str, sim: SimulatedDrive, rng: np.random.Generator) -> None:
    sim.break_thermistor(place, kind)


def mend_thermistor(place: str, sim: SimulatedDrive) -> str:
    sim.break_thermistor(place, "none")
    return ""


def _heat(sim: SimulatedDrive, place: str, degC: float) -> None:
    if place == "winding":
        sim.bodies.winding_degC[:] = degC
    else:
        sim.junctions.sink_degC = degC


def stuck_hot(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """One of the two reads more than either may have."""
    _heat(sim, str(rng.choice(PLACES)), float(rng.uniform(165.0, 200.0)))


def cool(sim: SimulatedDrive) -> str:
    for place in PLACES:
        _heat(sim, place, COOL_DEGC)
    return ""


def stuck_cool(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """One of the two keeps its reading, while its place becomes hot."""
    place = str(rng.choice(PLACES))
    sim.break_thermistor(place, "stuck")
    _heat(sim, place, float(rng.uniform(165.0, 200.0)))


def brake_without_chopper(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """The resistor is open. The load drives the shaft, and the drive brakes: so fast, and with so
    little torque, that the windings do not take all of its power."""
    sim.inverter.link.chopper_ohm = BROKEN_OHM
    along = np.sign(sim.plant_state[6])
    sim.set("speed_ref_rpm", along * BRAKES_AT_RPM)
    sim.set("load_Nm", -0.35 * along * sim.controller.channel("torque_limit_Nm"))


def mend_chopper(sim: SimulatedDrive) -> str:
    """With the gates off it must take the over-voltage away."""
    sim.inverter.link.chopper_ohm = 40.0
    sim.run(0.05, record=False)
    most_V = sim.controller.number("chopper_on_V")
    return "" if sim.link_V < most_V else f"{sim.link_V:.0f} V with the gates off and a chopper"


def chopper_stays_on(sim: SimulatedDrive) -> None:
    """The transistor does not open, whatever the pin is."""
    link = sim.inverter.link
    link.chopper.level, link.chops = 0, 1
    link.chopper_on_V, link.chopper_off_V = 0.0, -1.0


def chopper_told_off(sim: SimulatedDrive) -> str:
    """From the interrupt after the trip on. It may have been on by right."""
    sim.run(sim.period_s, record=False)
    return "the chopper is told to be on" if sim.controller.drive.chops else ""


def told_open(sim: SimulatedDrive) -> bool:
    """Whether the brake's pin is high."""
    return bool(high(sim.brake.pin, sim.controller.register_words()))


def brake_told_closed(sim: SimulatedDrive) -> str:
    return "the brake's pin is high" if told_open(sim) else ""
