"""What each scheme is: for people. The law itself is in firmware/core/ht_control.c."""

from __future__ import annotations

from .. import firmware

_A = "Holakooie, Iwanski, Miazga 2022"
_B = "Pandit, Aware, Nemade, Levi 2017"

SCHEMES: dict[str, dict[str, str]] = {
    "dtc1": {
        "source": f"{_B}: DTC1",
        "vectors": "one large",
        "torque_levels": "3",
        "xy": "ignored",
    },
    "dtc2": {
        "source": f"{_B}: DTC2",
        "vectors": "one large or medium-large",
        "torque_levels": "3",
        "xy": "the vector that lowers the x-y flux",
    },
    "dtc3": {
        "source": f"{_B}: DTC3",
        "vectors": "one large, medium-large or small",
        "torque_levels": "5",
        "xy": "the vector that lowers the x-y flux",
    },
    "fdr": {
        "source": f"{_A}: FDR-DTC",
        "vectors": "three large, fixed duty ratios",
        "torque_levels": "3",
        "xy": "zero mean voltage",
    },
    "ddr": {
        "source": f"{_A}: DDR-DTC",
        "vectors": "three large, duty ratios by eq. (13)",
        "torque_levels": "3",
        "xy": "dual PI, limit 0.0327 Vdc per axis",
    },
    "ddr-ml": {
        "source": f"{_A}: section II-F4",
        "vectors": "three medium-large, duty ratios by eq. (13)",
        "torque_levels": "3",
        "xy": "dual PI, limit 0.0893 Vdc per axis",
    },
}

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

if tuple(SCHEMES) != firmware.schemes():
    raise RuntimeError("schemes.py and the firmware's scheme list differ")
