"""Why a drive tripped: the instant, and the quantity, its value and its limit, from the values that
the firmware saved at the fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from ..chips import BOARDS
from ..firmware import FAULTS, PHASE_LOST, Snapshot, board_of, ffi, lib, parameters
from ..plant.machines import DISPLACEMENTS_DEG
from ..plant.vsd import PHASES, SETS, transform

#: A parameter's value by name.
Get = Callable[[str], float]
#: The parameters that tell whether a drive trips on the way to its speed reference.
WAY_TO_SPEED = ("start_mode", "control_mode", "speed_ref_rpm", "speed_trip_rpm")


@dataclass(frozen=True)
class Trip:
    """Why a drive tripped. time_s: seconds since the drive was opened; state: what the drive did
    then; faults: names; details: for each fault that has a limit, quantity, value and limit."""

    time_s: float
    state: str
    faults: tuple[str, ...]
    details: tuple[str, ...]

    def __str__(self) -> str:
        why = "; ".join((", ".join(self.faults), *self.details))
        return f"drive tripped at {self.time_s:.4f} s in state {self.state}: {why}"

    def as_json(self) -> dict:
        """The same by name, for JSON."""
        return {**asdict(self), "faults": list(self.faults), "details": list(self.details)}


def too_fast(start_mode: str, control_mode: str, asked_rpm: float, trip_rpm: float) -> bool:
    """Whether a drive with these values of WAY_TO_SPEED trips before it has its speed reference."""
    return (start_mode, control_mode) == ("drive", "speed") and abs(asked_rpm) >= trip_rpm


def details(snapshot: Snapshot, get: Get) -> tuple[str, ...]:
    """A text for each fault of the snapshot that has a limit. `get` gives a parameter's value."""
    found = (_DETAILS.get(name) for name in snapshot["faults"])
    return tuple(text for detail in found if detail and (text := detail(snapshot, get)))


def _magnets(get: Get) -> bool:
    """Whether the rotor has magnets."""
    return bool(_told(get, "machine"))


def _told(get: Get, name: str) -> float:
    """A parameter that boards of earlier versions do not have: 0 there."""
    try:
        return get(name)
    except KeyError:
        return 0.0


def _alpha_beta_A(s: Snapshot, get: Get) -> np.ndarray:
    displacement_deg = DISPLACEMENTS_DEG[int(_told(get, "displacement_deg"))]
    return transform(displacement_deg)[:2] @ np.array(s["i_A"])


def _over_current(s: Snapshot, get: Get) -> str:
    largest = max(range(6), key=lambda leg: abs(s["i_A"][leg]))
    value_A, limit_A = s["i_A"][largest], get("i_trip_A")
    if not abs(value_A) < limit_A:
        return f"phase {PHASES[largest]}: {value_A:.4g} A, i_trip_A = {limit_A:g} A"
    size_A = float(np.hypot(*_alpha_beta_A(s, get)))
    return f"current in alpha-beta: {size_A:.4g} A, i_ab_trip_A = {get('i_ab_trip_A'):g} A"


def _current_sum(s: Snapshot, get: Get) -> str:
    sums_A = [sum(s["i_A"][leg] for leg in one) for one in SETS]
    worst = max((0, 1), key=lambda one: abs(sums_A[one]))
    names = " + ".join(PHASES[leg] for leg in SETS[worst])
    return f"phases {names}: {sums_A[worst]:.4g} A, i_sum_trip_A = {get('i_sum_trip_A'):g} A"


def _offset(s: Snapshot, get: Get) -> str:
    off = [count - lib.HT_ADC_MID for count in s["adc_counts"][:6]]
    worst = max(range(6), key=lambda leg: abs(off[leg]))
    return (
        f"phase {PHASES[worst]}: last reading {off[worst]:+d} counts from the middle, "
        f"allowed offset is {lib.HT_NUMBER_OFFSET_MOST_COUNTS} counts"
    )


def _vdc_high(s: Snapshot, get: Get) -> str:
    return f"dc link: {s['vdc_V']:.4g} V, vdc_max_V = {get('vdc_max_V'):g} V"


def _vdc_low(s: Snapshot, get: Get) -> str:
    return f"dc link: {s['vdc_V']:.4g} V, vdc_min_V = {get('vdc_min_V'):g} V"


def _over_speed(s: Snapshot, get: Get) -> str:
    return f"speed: {s['speed_rpm']:.5g} r/min, speed_trip_rpm = {get('speed_trip_rpm'):g} r/min"


def _encoder(s: Snapshot, get: Get) -> str:
    if _magnets(get):
        return (
            f"measured speed: {s['speed_rpm']:.5g} r/min; the encoder stopped or jumped by more "
            f"than encoder_trip_rpm = {get('encoder_trip_rpm'):g} r/min, or did not show that the "
            "rotor was aligned"
        )
    return (
        f"measured speed: {s['speed_rpm']:.5g} r/min, off the flux's by more than "
        f"encoder_trip_rpm = {get('encoder_trip_rpm'):g} r/min"
    )


def _stuck(s: Snapshot, get: Get) -> str:
    return f"limit stuck_trip_A = {get('stuck_trip_A'):g} A"


def _phase(s: Snapshot, get: Get) -> str:
    return ", ".join(s["warnings"])


def _flux(s: Snapshot, get: Get) -> str:
    psi_Wb = max(s["psi_Wb"], key=abs)
    if not abs(psi_Wb) < get("flux_trip_Wb"):
        return f"flux: {psi_Wb:.4g} Wb, flux_trip_Wb = {get('flux_trip_Wb'):g} Wb"
    if _magnets(get):
        return f"flux unlike that of rotor angle and current: flux_check = {get('flux_check'):g}"
    off = off_circle(s, get)
    return (
        f"current off the circle diagram: {off:.3g} no-load currents at that instant, "
        f"flux_check = {get('flux_check'):g} rms"
    )


def off_circle(s: Snapshot, get: Get) -> float:
    """Distance of the current from the circle diagram, in no-load currents, as the firmware finds
    it."""
    if not any(s["psi_Wb"]):
        return math.nan
    params, port = ffi.new("ht_params *"), ffi.new("ht_port *")
    lib.ht_params_default(params)
    for name in ("sigma_ls_H", "lm_H", "lr_H", "flux_ref_Wb"):
        params.v[parameters()[name].id] = get(name)
    lib.ht_port_bind(port, ffi.NULL, board_of(BOARDS[0]))
    return lib.ht_off_circle(port, params, s["psi_Wb"], _alpha_beta_A(s, get).tolist())


_DETAILS: dict[str, Callable[[Snapshot, Get], str]] = {
    FAULTS[bit]: detail
    for bit, detail in (
        (lib.HT_FAULT_OVERCURRENT, _over_current),
        (lib.HT_FAULT_VDC_HIGH, _vdc_high),
        (lib.HT_FAULT_VDC_LOW, _vdc_low),
        (lib.HT_FAULT_CALIBRATION, _offset),
        (lib.HT_FAULT_CURRENT_SUM, _current_sum),
        (lib.HT_FAULT_OVERSPEED, _over_speed),
        (lib.HT_FAULT_FLUX, _flux),
        (lib.HT_FAULT_ENCODER, _encoder),
        (lib.HT_FAULT_STUCK, _stuck),
        (PHASE_LOST, _phase),
    )
}
