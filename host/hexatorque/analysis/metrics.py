"""Figures of merit of a steady-state recording, one definition each."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..plant.edges import Edges
from ..plant.vsd import PHASES, transform
from ..recording.recording import Recording
from .losses import balance, bridge, copper_loss_W
from .spectrum import BANDS_HZ, channel, fundamental_Hz, harmonics, thd_inf_pct, thd_pct

#: Parts of the window whose scatter tells the spread of the current difference.
PARTS = 5
#: The fewest cycles of the fundamental in a part.
PART_CYCLES = 2


def i_xy_A(rec: Recording) -> tuple[np.ndarray, np.ndarray]:
    """The x and y stator currents in A: the plant's if they were recorded, else computed from the
    measured phase currents."""
    if "plant.i_x_A" in rec and "plant.i_y_A" in rec:
        return channel(rec, "i_x_A"), channel(rec, "i_y_A")
    phases_A = np.stack([channel(rec, f"i_{phase}_A") for phase in PHASES])
    controller = rec.meta.get("parameters", {}).get("controller", {})
    x, y = transform(float(controller.get("displacement_deg", 30)))[2:] @ phases_A
    return x, y


#: Fewest samples a period at which the torque between the control instants is seen.
TD_SAMPLES = 10


def torque_ripple_td_Nm(rec: Recording) -> float:
    """Standard deviation of the torque over all samples. NaN below TD_SAMPLES a period."""
    per = rec.meta.get("samples_per_period", 1)
    return float(np.std(channel(rec, "torque_Nm"))) if per >= TD_SAMPLES else math.nan


def torque_error(rec: Recording) -> tuple[float, float]:
    """Mean torque less mean torque reference, in N m and in % of the reference. Negative: the drive
    holds less than it is asked for, in either direction. NaN without a reference."""
    if "torque_ref_Nm" not in rec:
        return math.nan, math.nan
    asked_Nm = float(np.mean(rec["torque_ref_Nm"]))
    error_Nm = float(np.mean(channel(rec, "torque_Nm"))) - asked_Nm
    if asked_Nm < 0:
        error_Nm = -error_Nm
    return error_Nm, 100 * error_Nm / abs(asked_Nm) if asked_Nm else math.nan


#: Unit of each figure of merit, under the names of `flat`.
UNITS = {
    "speed_rpm": "r/min",
    "torque_Nm": "N m",
    "torque_error_Nm": "N m",
    "torque_error_pct": "%",
    "torque_ripple_Nm": "N m",
    "torque_ripple_td_Nm": "N m",
    "flux_Wb": "Wb",
    "flux_ripple_Wb": "Wb",
    "i1_A": "A",
    "f1_Hz": "Hz",
    "thd_1kHz_pct": "%",
    "thd_2kHz_pct": "%",
    "thd_5kHz_pct": "%",
    "thd_h50_pct": "%",
    "thd_inf_pct": "%",
    "h5_pct": "%",
    "h7_pct": "%",
    "ixy_rms_A": "A",
    "delta_i_A": "A",
    "delta_i_spread_A": "A",
    "f_sw_Hz": "Hz",
    "copper_loss_W": "W",
    "idc_A": "A",
    "idc_ripple_A": "A",
    "conduction_loss_W": "W",
    "switching_loss_W": "W",
    "input_W": "W",
    "shaft_W": "W",
    "loss_W": "W",
    "efficiency_pct": "%",
}


def flat(values: Mapping[str, Any]) -> dict[str, float | None]:
    """The figures of `metrics`, one number each: the THD of a band becomes `thd_BAND_pct`."""
    bands = {f"thd_{band}_pct": value for band, value in values["thd_pct"].items()}
    return {name: {**values, **bands}[name] for name in UNITS}


#: Figures that take most of the time, by the function that gives them.
_LINES = ("i1_A", "h5_pct", "h7_pct", "delta_i_A")
_BANDS = ("thd_1kHz_pct", "thd_2kHz_pct", "thd_5kHz_pct", "thd_h50_pct")
BRIDGE = (
    "idc_A", "idc_ripple_A", "conduction_loss_W", "switching_loss_W",
    "input_W", "shaft_W", "loss_W", "efficiency_pct",
)  # fmt: skip


def metrics(
    rec: Recording,
    f_sw_Hz: float | None = None,
    edges: Edges | None = None,
    names: Collection[str] = tuple(UNITS),
) -> dict:
    """Figures of merit of `rec`, all finite numbers or None. names: those that are needed, as in
    UNITS; others may be None.

    True values ("plant.") are used if the recording has them, else the controller's. f_sw_Hz is the
    mean switching frequency of a leg, transitions / (12 T); without the argument it is taken from
    rec.meta["f_sw_Hz"]. InputError if the recording is shorter than two cycles of the
    fundamental.

    speed_rpm, torque_Nm, flux_Wb (|psi_s|): means; torque_error_Nm, torque_error_pct: of the mean
    torque against its reference (`torque_error`), None without one; torque_ripple_Nm,
    flux_ripple_Wb: standard deviations sqrt(mean((T - mean T)^2)) over the control instants
    (paper B, eq. (9); its traces leave the DSP once a period); torque_ripple_td_Nm: the same over
    all samples
    (`torque_ripple_td_Nm`); i1_A: peak of the fundamental of phase u1; f1_Hz: its frequency;
    thd_pct: THD of phase u1, by band; thd_inf_pct: THD of all six phases over the whole recorded
    spectrum (`thd_inf_pct` of `spectrum`); h5_pct, h7_pct: harmonics of phase u1 in % of its
    fundamental; ixy_rms_A: sqrt(mean(i_x^2 + i_y^2)); delta_i_A: |I_u1 - I_u2|, peaks of the
    fundamentals; delta_i_spread_A: its standard deviation from window to window (`_spread`);
    copper_loss_W: of the stator (`copper_loss_W` of `losses`); idc_A, idc_ripple_A,
    conduction_loss_W, switching_loss_W: from the inverter's `edges` and the set-up's data-sheet
    values (`bridge` of `losses`), None without them; input_W, shaft_W, loss_W, efficiency_pct: of
    the whole drive (`balance` of `losses`), None without edges.
    """
    if not isinstance(rec, Recording):
        raise InputError(f"rec = {rec!r}: a Recording is needed; Recording.load reads one")
    f1_Hz = abs(fundamental_Hz(rec))
    u1, u2 = channel(rec, "i_u1_A"), channel(rec, "i_u2_A")

    def needed(*those: str) -> bool:
        return any(name in names for name in those)

    lines, distortion = dict.fromkeys(_LINES), dict.fromkeys((*BANDS_HZ, "h50"))
    if needed(*_LINES):
        lines = _lines(u1, u2, rec.rate_Hz, f1_Hz)
    if needed(*_BANDS):
        distortion = thd_pct(u1, rec.rate_Hz, f1_Hz, needed("thd_h50_pct"))
    inf_pct = spread_A = None
    if needed("thd_inf_pct"):
        phases = np.stack([channel(rec, f"i_{phase}_A") for phase in PHASES])
        inf_pct = thd_inf_pct(phases, rec.rate_Hz, f1_Hz)
    if needed("delta_i_spread_A"):
        spread_A = _spread(u1, u2, rec.rate_Hz, f1_Hz)
    torque_Nm = channel(rec, "torque_Nm")
    flux_Wb = np.hypot(channel(rec, "psi_alpha_Wb"), channel(rec, "psi_beta_Wb"))
    i_x, i_y = i_xy_A(rec)
    inverter = bridge(rec, edges if needed(*BRIDGE) else None)
    # The extremes of torque and flux are at control instants. Over all samples the ripple would be
    # up to a fifth lower.
    error_Nm, error_pct = torque_error(rec)
    per = rec.meta.get("samples_per_period", 1)
    control = slice(-round(rec.start_s * rec.rate_Hz) % per, None, per)
    return _finite(
        {
            "speed_rpm": np.mean(channel(rec, "speed_rpm")),
            "torque_Nm": np.mean(torque_Nm),
            "torque_error_Nm": error_Nm,
            "torque_error_pct": error_pct,
            "torque_ripple_Nm": np.std(torque_Nm[control]),
            "torque_ripple_td_Nm": torque_ripple_td_Nm(rec),
            "flux_Wb": np.mean(flux_Wb),
            "flux_ripple_Wb": np.std(flux_Wb[control]),
            "i1_A": lines["i1_A"],
            "f1_Hz": f1_Hz,
            "thd_pct": distortion,
            "thd_inf_pct": inf_pct,
            "h5_pct": lines["h5_pct"],
            "h7_pct": lines["h7_pct"],
            "ixy_rms_A": np.sqrt(np.mean(i_x**2 + i_y**2)),
            "delta_i_A": lines["delta_i_A"],
            "delta_i_spread_A": spread_A,
            "f_sw_Hz": rec.meta.get("f_sw_Hz") if f_sw_Hz is None else f_sw_Hz,
            "copper_loss_W": copper_loss_W(rec),
            **inverter,
            **balance(rec, inverter),
        }
    )


def _lines(u1: np.ndarray, u2: np.ndarray, rate_Hz: float, f1_Hz: float) -> dict[str, float | None]:
    u1_A = harmonics(u1, rate_Hz, f1_Hz, (1, 5, 7))
    u2_A = harmonics(u2, rate_Hz, f1_Hz, (1,))[1]
    percent = 100 / u1_A[1] if u1_A[1] > 0 else float("nan")
    figures = (u1_A[1], percent * u1_A[5], percent * u1_A[7], abs(u1_A[1] - u2_A))
    return dict(zip(_LINES, figures))


def _spread(u1: np.ndarray, u2: np.ndarray, rate_Hz: float, f1_Hz: float) -> float | None:
    """Standard deviation that I_u1 - I_u2 has from one window of this length to the next. It is
    that of the window's parts divided by the root of their number, because their errors are
    independent: a scheme that applies one vector a period leaves low-frequency noise in the
    currents. None if a part is too short."""
    count = len(u1) // PARTS
    if count * f1_Hz / rate_Hz < PART_CYCLES:
        return None
    parts = [slice(k * count, (k + 1) * count) for k in range(PARTS)]
    differences_A = [
        harmonics(u1[part], rate_Hz, f1_Hz, (1,))[1] - harmonics(u2[part], rate_Hz, f1_Hz, (1,))[1]
        for part in parts
    ]
    return float(np.std(differences_A, ddof=1) / np.sqrt(PARTS))


def _finite(value):
    """Plain numbers for JSON. A value that is not finite becomes None."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    return float(value) if value is not None and math.isfinite(value) else None
