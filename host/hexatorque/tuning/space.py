"""Which parameters of a drive are tuned, and how far each may move."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from .. import firmware
from ..setups import Setup, parameters
from ..setups.review import XY_GAIN_MOST
from ..setups.values import Value

#: A parameter may move between its value divided by this and times this.
FACTOR = 4.0
#: Digits of the values that are tried, so that a file that states them states them exactly.
DIGITS = 4
#: The corner of the speed loop, k_p/J, is at most this share of its sampling frequency
#: (`review`: "corner of the speed loop").
CORNER_SHARE = 2 * math.pi / 10
SPEED_LOOP = ("kp_speed_Nms_rad", "ki_speed_Nm_rad")
#: Above this share of Vdc no scheme reaches: a larger kappa_from_pu changes nothing.
KAPPA_FROM_MOST = 0.62


@dataclass(frozen=True)
class Knob:
    """A parameter that is tuned. log: moves by factors, else by differences."""

    name: str
    start: float
    low: float
    high: float
    log: bool


def knobs(setup: Setup) -> list[Knob]:
    """Those that the set-up's scheme uses. A value of 0 switches something off, and stays."""
    values = parameters(setup)
    row = firmware.lib.ht_scheme_describe(firmware.schemes().index(str(values["scheme"])))
    names = []
    table_law = values["scheme"] in firmware.table_schemes()
    if table_law:
        names += ["torque_band_Nm", "flux_band_Wb"]
        levels = str(values["torque_levels"])
        if levels == "5" or (levels == "auto" and row.torque_levels == 5):
            names.append("torque_inner_Nm")
        if row.regulated:
            names += ["kp_xy_pu_A", "ki_xy_pu_As"]
    if values["observer"] == "hybrid":
        names.append("crossover_Hz")
    if values["control_mode"] == "speed":
        names += SPEED_LOOP
    table = firmware.parameters(setup["timing.device"])
    xy_pu_A = setup["machine.lxy_H"] * float(values["f_isr_Hz"]) / (2 * setup["inverter.vdc_V"])
    most = {
        "kp_speed_Nms_rad": setup["machine.inertia_kgm2"]
        * CORNER_SHARE
        * float(values["f_slow_Hz"]),
        "kp_xy_pu_A": XY_GAIN_MOST * xy_pu_A,
    }
    found = []
    for name in names:
        start, allowed = float(values[name]), table[name]
        low = max(start / FACTOR, allowed.min)
        high = min(start * FACTOR, allowed.max, max(start, most.get(name, math.inf)))
        if start > 0 and low < high:
            found.append(Knob(name, start, low, high, log=True))
    if not table_law:
        for name, high in (("kappa", 1.0), ("kappa_from_pu", KAPPA_FROM_MOST)):
            start = float(values[name])
            found.append(Knob(name, start, 0.0, max(start, high), log=False))
    return found


def short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def settings(setup: Setup, values: Mapping[str, float]) -> dict[str, float]:
    """The controller parameters of a candidate, in the order that the firmware demands: where the
    larger one of two is tuned, it takes a smaller one that the set-up decides down with it."""
    chosen = {name: short(value) for name, value in values.items()}
    for less, share, more in firmware.orders():
        if more not in chosen:
            continue
        given = less in setup.values["controller"] or setup.defaults == "firmware"
        value = chosen.get(less)
        if value is None and given:
            value = float(setup.parameter(less))
        if value is not None and value > share * chosen[more]:
            chosen[less] = share * chosen[more]
    return chosen


def changed(setup: Setup, chosen: Mapping[str, float], note: str = "") -> Setup:
    """The set-up with these parameters."""
    return setup.with_values({"controller": tagged(chosen, note)})


def tagged(chosen: Mapping[str, float], note: str) -> dict[str, Value]:
    return {name: Value(value, "tuned", note) for name, value in chosen.items()}
