"""Descriptions of the schemes for the user: source, text, and line style in pictures. Numbers come
from firmware/core/ht_schemes.def."""

from __future__ import annotations

from .. import firmware

_A = "Holakooie, Iwanski, Miazga 2022"
_B = "Pandit, Aware, Nemade, Levi 2017"

#: Colour-blind readers can distinguish the colours.
_TEXTS: dict[str, dict[str, str]] = {
    "dtc1": {
        "source": f"{_B}: DTC1",
        "vectors": "one large",
        "xy": "ignored",
        "color": "#20242b",
        "marker": "o",
    },
    "dtc2": {
        "source": f"{_B}: DTC2",
        "vectors": "one large or medium-large",
        "xy": "the vector that lowers the x-y flux",
        "color": "#e69f00",
        "marker": "s",
    },
    "dtc3": {
        "source": f"{_B}: DTC3",
        "vectors": "one large, medium-large or small",
        "xy": "the vector that lowers the x-y flux",
        "color": "#d55e00",
        "marker": "^",
    },
    "fdr": {
        "source": f"{_A}: FDR-DTC",
        "vectors": "three large, fixed duty ratios",
        "xy": "zero mean voltage",
        "color": "#56b4e9",
        "marker": "D",
    },
    "ddr": {
        "source": f"{_A}: DDR-DTC",
        "vectors": "three large, duty ratios by eq. (13)",
        "xy": "dual PI",
        "color": "#0072b2",
        "marker": "v",
    },
    "ddr-ml": {
        "source": f"{_A}: section II-F4",
        "vectors": "three medium-large, duty ratios by eq. (13)",
        "xy": "dual PI",
        "color": "#009e73",
        "marker": "P",
    },
    "db-dtfc": {
        "source": "this project: deadbeat torque and flux control",
        "vectors": "carrier modulation, set 2 turned against set 1",
        "xy": "proportional on the prediction, dual integrators",
        "color": "#cc79a7",
        "marker": "X",
    },
    "foc": {
        "source": "reference: rotor-field-oriented control",
        "vectors": "carrier modulation, double zero-sequence injection",
        "xy": "proportional on the prediction, dual integrators",
        "color": "#7f7f7f",
        "marker": "h",
    },
    "foc-24": {
        "source": "reference: the same with 24-sector space-vector modulation",
        "vectors": "carrier modulation, set 2 turned against set 1",
        "xy": "proportional on the prediction, dual integrators",
        "color": "#8c564b",
        "marker": "d",
    },
    "db-ipwm": {
        "source": "this project: the deadbeat law for each set",
        "vectors": "interleaved carriers, pulses placed for the least ripple",
        "xy": "deadbeat for each set, dual integrators",
        "color": "#882255",
        "marker": "*",
    },
}


def _described(number: int, name: str) -> dict[str, str]:
    row = firmware.lib.ht_scheme_describe(number)
    text = _TEXTS[name]
    limit = f", limit {firmware.lib.ht_scheme_xy_limit_pu(row):.4f} Vdc per axis"
    return {
        "source": text["source"],
        "vectors": text["vectors"],
        "torque_levels": str(row.torque_levels or "-"),
        "xy": text["xy"] + (limit if row.regulated else ""),
        "reach": f"{row.reach_pu:.4f} Vdc",
    }


if set(_TEXTS) != set(firmware.schemes()):
    raise RuntimeError("schemes.py and the firmware's scheme list differ")

#: Colour and marker of each scheme in every picture, as matplotlib takes them.
STYLE = {name: {key: text[key] for key in ("color", "marker")} for name, text in _TEXTS.items()}

SCHEMES = {name: _described(number, name) for number, name in enumerate(firmware.schemes())}

_CONTROLLER_OPTIONS = (
    "table", "torque_levels", "torque_release_Nm", "zero_vector", "zero_hold", "flux_hold",
    "field_weakening", "observer", "control_mode",
)  # fmt: skip

OPTIONS: dict[str, dict[str, str]] = {
    "timing.latency": {
        "choices": "none | immediate | shadow | predicted",
        "help": "when a decision takes effect; predicted = shadow with one-step prediction",
    },
    **{
        f"controller.{name}": {
            "choices": " | ".join(firmware.parameters()[name].choices) or "number",
            "help": firmware.parameters()[name].help,
        }
        for name in _CONTROLLER_OPTIONS
    },
}
