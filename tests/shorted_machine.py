"""A machine with magnets that soon turns faster than its ceiling, and whose drive then
short-circuits it."""

from hexatorque import setups
from hexatorque.plant.machines.magnet_parameters import Parameters

NAME = "magnet-24v"
#: Its parameter that trips the drive when it is set to this, whatever the drive does.
TRIPS = ("vdc_max_V", 20.0)
WARNING = "legs short-circuited"


def _changes() -> tuple[dict[str, object], float]:
    """What makes NAME this machine, and a speed above its ceiling, r/min."""
    base = setups.load(NAME)
    sheet = Parameters(**base.machine_values())
    ceiling_rpm = sheet.ceiling_rpm(base["inverter.vdc_V"])
    told = {f"controller.{n}": base.parameter(n) for n in ("i_trip_A", "i_ab_trip_A")}
    changes = {
        "machine.inertia_kgm2": 0.2 * sheet.inertia_kgm2,
        "sensors.i_full_A": 300.0,
        "controller.trip_state": "short-circuit",
        "controller.magnets_bear_A": 250.0,
        "controller.speed_trip_rpm": 1.4 * ceiling_rpm,
        "controller.rotor_start": "known",
        "controller.calibration_s": 0.01,
        "controller.build_s": 0.02,
    }
    return {**told, **changes}, 1.15 * ceiling_rpm


CHANGES, ABOVE_RPM = _changes()
