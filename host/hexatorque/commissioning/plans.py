"""A step's effect on the machine, in words, before the step begins."""

from __future__ import annotations

from typing import NamedTuple

from ..drive.interface import DriveVerbs
from . import alignment, encoder, inductance, resistance, rotor, running, wiring
from .excitation import MOST_PU, TRIP_SHARE, Limits
from .kinds import MAGNET, at_standstill, kind_of


class Plan(NamedTuple):
    what: str
    voltage: str
    current: str
    shaft: str


def plan(drive: DriveVerbs, limits: Limits, step: str, turns_rev: float) -> Plan:
    """The plan of a step with these limits, by the parameters that are in force."""
    vdc_V, limit_A = running.vdc_V(drive), at_standstill(drive, limits).current_A
    flux_Wb, pole_pairs = (float(drive.get(name)) for name in ("flux_ref_Wb", "pole_pairs"))
    most_V = f"up to {MOST_PU * vdc_V:.3g} V on a leg"
    trip = f"; the gates go off at {TRIP_SHARE * limit_A:.3g} A"
    peak_A = (inductance.BIAS + inductance.SWING) * limit_A
    below = f"below {limits.current_A:.3g} A: i_trip_A, torque and flux build-up are limited to it"
    speed_rpm = running.test_speed_rpm(drive, limits)
    still = (
        f"stands still, and may tremble; the gates go off if it moves by {limits.travel_rev:g} "
        "revolutions"
    )
    magnets = kind_of(drive) is MAGNET
    waves = "Square waves of voltage along each axis, on top of a direct current"
    return {
        "wiring": Plan(
            "Short square waves of voltage on one leg after the other show which lead and which "
            "sensor belong to it.",
            f"grows from {0.01 * vdc_V:.3g} V in small steps until the current flows, {most_V}",
            f"up to about {wiring.AIM * limit_A:.3g} A" + trip,
            still,
        ),
        "resistance": Plan(
            "Direct currents in the x-y plane, which make no torque, or little with magnets, in "
            "three sizes and twelve directions"
            + ("." if magnets else "; then larger ones for each phase."),
            f"the voltage that these currents need, {most_V}",
            f"up to {(resistance.MOST + resistance.BRAKE) * limit_A:.3g} A on a leg" + trip,
            still,
        ),
        "inductance": Plan(
            waves + ("." if magnets else ", and on each leg."),
            most_V,
            f"{inductance.BIAS * limit_A:.3g} A, and a triangle up to {peak_A:.3g} A" + trip,
            "is PULLED to alpha before each wave, by some degrees; then " + still
            if magnets
            else still,
        ),
        "alignment": Plan(
            "A direct current pulls the magnets to a quarter of an electrical turn beside alpha, "
            "then to alpha; from there it turns forwards and back.",
            "the voltage that the current needs at standstill",
            f"{alignment.AIM * limit_A:.3g} A" + trip + "; each reading of the encoder's count is "
            "such a trip, and the board's log has it",
            "TURNS at once by up to half an electrical turn, swings, then turns slowly by "
            f"{max(1, round(turns_rev)) / pole_pairs:.3g} revolutions and back; nothing may be "
            "coupled that takes torque",
        ),
        "magnets": Plan(
            "The drive aligns the rotor as its parameters say, and RUNS without load, with a "
            "current against the magnets.",
            "the voltage that the drive needs",
            below,
            f"TURNS at up to {speed_rpm:.0f} r/min; nothing may be coupled that takes torque",
        ),
        "encoder": Plan(
            f"A field turns {turns_rev:g} times, and as often again if the shaft follows slowly.",
            "the voltage that the current needs at standstill",
            f"{encoder.AIM * limit_A:.3g} A" + trip,
            f"TURNS with the field, {60 * encoder.FIELD_HZ / pole_pairs:.3g} r/min by pole_pairs, "
            "and is braked at the end",
        ),
        "rotor": Plan(
            "A step of direct voltage along one axis; the current follows as the rotor's flux "
            "does.",
            "the voltage that the currents need at standstill",
            f"up to {rotor.MOST * (1 + rotor.BIAS) * limit_A:.3g} A on a leg" + trip,
            still,
        ),
        "magnetisation": Plan(
            f"The drive RUNS without load, at five fluxes from {running.FLUXES[0] * flux_Wb:.3g} "
            f"to {max(running.FLUXES) * flux_Wb:.3g} Wb.",
            "the voltage that the drive needs",
            below,
            f"TURNS at {speed_rpm:.0f} r/min; nothing may be coupled that takes torque",
        ),
        "mechanics": Plan(
            "The drive ACCELERATES, brakes, accelerates again, and coasts with the gates off.",
            "the voltage that the drive needs",
            below,
            f"TURNS at up to {speed_rpm:.0f} r/min, several times; coasts for {running.COAST_S:g} "
            f"s, and {running.LONG_COAST_S:g} s more if friction is small",
        ),
    }[step]
