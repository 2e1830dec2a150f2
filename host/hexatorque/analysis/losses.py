"""Losses and dc-link current of a recording, from its phase currents and the inverter's edges.

Between two samples a phase current is taken as linear. The edges are at their exact instants: the
dc-link current jumps there, and samples alone would miss it.
"""

from __future__ import annotations

import math

import numpy as np

from ..plant.edges import Edges
from ..plant.legs import HIGH, LOW
from ..plant.vsd import PHASES
from ..recording.recording import Recording
from .spectrum import channel


def copper_loss_W(rec: Recording) -> float:
    """Mean of sum(R i^2) over the six stator phases, all frequencies included. NaN if the recording
    does not say the phases' resistances."""
    machine = rec.meta.get("parameters", {}).get("machine", {})
    if "rs_ohm" not in machine:
        return math.nan
    each_ohm = machine["rs_ohm"] + np.broadcast_to(machine.get("drs_ohm", 0.0), 6)
    return float(sum(r * np.mean(i * i) for r, i in zip(each_ohm, _phases_A(rec))))


def iron_loss_W(rec: Recording) -> float:
    """Mean loss of the iron (plant/iron.py). NaN if it takes something and the
    recording lacks the machine's flux."""
    machine = rec.meta.get("parameters", {}).get("machine", {})
    hysteresis, eddy = (machine.get(k, 0.0) for k in ("iron_hysteresis_A_Wb", "iron_eddy_S"))
    if not (hysteresis or eddy):
        return 0.0
    if not {"psi_alpha_Wb", "psi_beta_Wb", "speed_rpm"}.issubset(
        name.removeprefix("plant.") for name in rec.channels
    ):
        return math.nan
    omega = np.abs(channel(rec, "speed_rpm")) * (machine["pole_pairs"] * math.pi / 30)
    flux2 = channel(rec, "psi_alpha_Wb") ** 2 + channel(rec, "psi_beta_Wb") ** 2
    return float(np.mean(omega * (hysteresis + eddy * omega) * flux2))


def bridge(rec: Recording, edges: Edges | None) -> dict[str, float]:
    """Figures of merit of the inverter, NaN if they cannot be told.

    idc_A: mean of the dc-link current, the sum of the phase currents in the upper devices;
    idc_ripple_A: its rms value without the mean, which is the capacitors' current if the supply
    gives direct current; conduction_loss_W: mean of sum(V |i| + R i^2) over the devices that carry
    the phase currents; switching_loss_W: e_on for each turn-on of a switch that takes over a
    current, e_off for each turn-off of one that carries it, both in proportion to current and
    voltage.
    """
    figures = dict.fromkeys(
        ("idc_A", "idc_ripple_A", "conduction_loss_W", "switching_loss_W"), math.nan
    )
    if edges is None:
        return figures
    inverter = rec.meta.get("parameters", {}).get("inverter", {})
    drop = {
        name: (inverter.get(f"v_{name}_V", 0.0), inverter.get(f"r_{name}_ohm", 0.0))
        for name in ("switch", "diode")
    }
    phases_A = _phases_A(rec)
    span_s, idc, idc2, lost_J = _integrals(rec.rate_Hz, phases_A, edges, drop)
    figures["idc_A"] = idc / span_s
    figures["idc_ripple_A"] = math.sqrt(max(0.0, idc2 / span_s - (idc / span_s) ** 2))
    if any(any(values) for values in drop.values()):
        figures["conduction_loss_W"] = lost_J / span_s
    if inverter.get("e_on_mJ") or inverter.get("e_off_mJ"):
        figures["switching_loss_W"] = _switching_J(rec, phases_A, edges, inverter) / span_s
    return figures


def balance(rec: Recording, inverter: dict[str, float]) -> dict[str, float]:
    """Figures of merit of the whole drive in steady state, from those of `bridge`; NaN if they
    cannot be told.

    input_W: from the dc link, V_dc I_dc and the switching losses; shaft_W: the torque's power less
    the friction's and the iron's; loss_W: the difference; efficiency_pct: the smaller over the
    larger power, if both flow in the same direction. Losses of the inverter take part if the set-up
    states them.
    """
    values = rec.meta.get("parameters", {})
    vdc_V = (
        float(np.mean(channel(rec, "vdc_V")))
        if "vdc_V" in rec
        else values.get("inverter", {}).get("vdc_V", math.nan)
    )
    switching_W = inverter["switching_loss_W"]
    input_W = vdc_V * inverter["idc_A"] + (0.0 if math.isnan(switching_W) else switching_W)
    speed_rad_s = channel(rec, "speed_rpm") * (math.pi / 30)
    friction_Nm = values.get("machine", {}).get("viscous_Nms", 0.0) * speed_rad_s
    torque_Nm = channel(rec, "torque_Nm") - friction_Nm
    shaft_W = float(np.mean(torque_Nm * speed_rad_s)) - iron_loss_W(rec)
    less, more = sorted((input_W, shaft_W), key=abs)
    return {
        "input_W": input_W,
        "shaft_W": shaft_W,
        "loss_W": input_W - shaft_W,
        "efficiency_pct": 100 * less / more if less * more > 0 else math.nan,
    }


def _phases_A(rec: Recording) -> np.ndarray:
    return np.stack([channel(rec, f"i_{phase}_A") for phase in PHASES])


def _integrals(
    rate_Hz: float, phases_A: np.ndarray, edges: Edges, drop: dict[str, tuple[float, float]]
) -> tuple[float, float, float, float]:
    """Time from the first sample to the last one, and over it the integrals of the dc-link
    current, of its square, and of the devices' losses."""
    from .walk import walk

    state = np.array(edges.start, dtype=np.int64)
    at = edges.time_s * rate_Hz, edges.leg.astype(np.int64), edges.state.astype(np.int64)
    found = walk(phases_A.astype(float), state, *at, *drop["switch"], *drop["diode"])
    return ((phases_A.shape[1] - 1) / rate_Hz, *(value / rate_Hz for value in found))


def _switching_J(rec: Recording, phases_A: np.ndarray, edges: Edges, inverter: dict) -> float:
    """Energy of all edges. The current commutates if a switch that carries it turns off, or if one
    turns on that will carry it. Other edges, between a switch and its own diode, cost nothing."""
    at_s = np.arange(phases_A.shape[1]) / rec.rate_Hz
    vdc_V = float(np.mean(channel(rec, "vdc_V"))) if "vdc_V" in rec else inverter["vdc_V"]
    on_A = off_A = 0.0
    for leg in range(6):
        own = (edges.leg == leg) & (edges.time_s < at_s[-1])
        new = edges.state[own]
        old = np.concatenate([edges.start[leg : leg + 1], new[:-1]])[: new.size]
        i_A = np.interp(edges.time_s[own], at_s, phases_A[leg])
        for switch, current_A in ((HIGH, i_A), (LOW, -i_A)):
            carried_A = np.maximum(current_A, 0.0)
            on_A += carried_A[(new == switch) & (old != switch)].sum()
            off_A += carried_A[(old == switch) & (new != switch)].sum()
    per_A = 1e-3 * vdc_V / (inverter["e_ref_V"] * inverter["e_ref_A"])
    return float(per_A * (inverter["e_on_mJ"] * on_A + inverter["e_off_mJ"] * off_A))
