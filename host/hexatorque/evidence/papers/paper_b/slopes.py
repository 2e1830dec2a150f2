"""Paper B's torque slopes, eq. (8), against the simulated torque (Fig. 7)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....analysis import plots
from ....experiments.operating_points import approach
from ....plant.vsd import TRANSFORM
from ....recording.recording import Recording
from ....setups import Setup
from ..engine.figure import Figure, Verdict, beside, claim
from ..engine.job import Job
from .common import COLOUR, LOAD_NM, excerpt, point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPEEDS_RPM = (500.0, 2500.0)
#: Samples in a control period. Slopes are taken between neighbouring samples under one vector.
PER_PERIOD = 20
SHOWN_S = 6e-3
KINDS = ("rise", "fall")
CHANNELS = ("plant.torque_Nm", "plant.gates", "torque_ref_Nm")


class Slopes(NamedTuple):
    """For each period, in N m/s: dT/dt as measured and by eq. (8), under vectors that raise the
    torque and under zero vectors. Periods with other vectors are left out."""

    rise: np.ndarray  # (n,)
    rise_eq8: np.ndarray
    fall: np.ndarray
    fall_eq8: np.ndarray


def gate_states(gates: np.ndarray) -> np.ndarray:
    """(n, 6): leg states of the recorded channel. 0 is low, 1 is high, 2 is off."""
    return np.asarray(gates, dtype=int)[:, None] >> np.arange(10, -1, -2) & 3


def inductances(setup: Setup) -> tuple[float, float, float]:
    """L_s, L_r, L_m in H."""
    lm_H = setup["machine.lm_H"]
    return setup["machine.lls_H"] + lm_H, setup["machine.llr_H"] + lm_H, lm_H


def torque_slope(rec: Recording, setup: Setup, v_V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eq. (8) computed from the plant's state in N m/s, and its voltage term, which is the slope
    that a vector adds. v_V: complex alpha-beta voltage. sigma = 1 - L_m^2/(L_s L_r)."""
    ls_H, lr_H, lm_H = inductances(setup)
    sigma = 1 - lm_H**2 / (ls_H * lr_H)
    psi_s = rec["plant.psi_alpha_Wb"] + 1j * rec["plant.psi_beta_Wb"].astype(float)
    i_s = rec["plant.i_alpha_A"] + 1j * rec["plant.i_beta_A"].astype(float)
    psi_r = lr_H / lm_H * (psi_s - sigma * ls_H * i_s)
    omega_rad_s = rec["plant.speed_rpm"] * np.pi / 30 * setup["machine.pole_pairs"]
    decay_per_s = (setup["machine.rs_ohm"] / ls_H + setup["machine.rr_ohm"] / lr_H) / sigma
    gain = 3 * setup["machine.pole_pairs"] * lm_H / (sigma * ls_H * lr_H)
    by_voltage = gain * np.imag(np.conj(psi_r) * v_V)
    by_speed = gain * omega_rad_s * np.real(np.conj(psi_r) * psi_s)
    return by_voltage - by_speed - decay_per_s * rec["plant.torque_Nm"], by_voltage


def slopes(rec: Recording, setup: Setup) -> Slopes:
    """The slopes between neighbouring samples under the same vector, with no leg off."""
    states = gate_states(rec["plant.gates"])
    v_V = setup["inverter.vdc_V"] * (TRANSFORM[0] + 1j * TRANSFORM[1]) @ states.T
    equation, by_voltage = torque_slope(rec, setup, v_V)
    torque_Nm = rec["plant.torque_Nm"].astype(float)
    measured = np.diff(torque_Nm) * rec.rate_Hz
    equation = (equation[:-1] + equation[1:]) / 2
    whole = (rec["plant.gates"][:-1] == rec["plant.gates"][1:]) & (states[:-1] < 2).all(axis=1)
    zero = np.abs(v_V[:-1]) < 1e-6 * setup["inverter.vdc_V"]
    raising = ~zero & (by_voltage[:-1] > 0)
    period = np.arange(measured.size) // PER_PERIOD

    def per_period(chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        used = chosen & whole
        count = np.bincount(period[used], minlength=period[-1] + 1)
        total = np.bincount(period[used], values[used], minlength=period[-1] + 1)
        return total[count > 0] / count[count > 0]

    return Slopes(
        per_period(raising, measured),
        per_period(raising, equation),
        per_period(zero, measured),
        per_period(zero, equation),
    )


def _record(job: Job, speed_rpm: float) -> Recording:
    sim = approach(point("dtc1", speed_rpm), job.progress, samples_per_period=PER_PERIOD)
    sim.run(0.1 if job.quick else 0.5, progress=job.progress)
    sim.check()
    return sim.take()


def _figures(s: Slopes) -> dict[str, float]:
    """The means, the scatter over the periods, and the rms distance from eq. (8)."""
    found = {}
    for name in KINDS:
        measured, equation = getattr(s, name), getattr(s, f"{name}_eq8")
        found[f"{name}_Nm_s"] = float(measured.mean())
        found[f"{name}_std_Nm_s"] = float(measured.std())
        found[f"{name}_eq8_Nm_s"] = float(equation.mean())
        found[f"{name}_distance_Nm_s"] = float(np.sqrt(np.mean((measured - equation) ** 2)))
    return found


def _verdicts(metrics: dict[float, dict], setup: Setup) -> list[Verdict]:
    rows = []
    for speed_rpm, m in metrics.items():
        for name, label in (("rise", "active vectors"), ("fall", "zero vectors")):
            rows.append(
                beside(
                    f"{label}, {speed_rpm:g} r/min, beside eq. (8)",
                    m[f"{name}_Nm_s"],
                    m[f"{name}_eq8_Nm_s"],
                    "N m/s",
                    within=0.001,
                )
            )
        share = max(m[f"{name}_distance_Nm_s"] / abs(m[f"{name}_Nm_s"]) for name in KINDS)
        rows.append(
            claim(
                f"{speed_rpm:g} r/min: rms distance of a period's slope from eq. (8), %",
                share < 0.001,
                100 * share,
                "0",
            )
        )
    slow, fast = (m["rise_Nm_s"] / -m["fall_Nm_s"] for m in metrics.values())
    ls_H, lr_H, lm_H = inductances(setup)
    return [
        *rows,
        claim("rise over fall, 500 r/min", slow > 1, slow, "fast rise, slow fall"),
        claim("rise over fall, 2500 r/min", fast < 1, fast, "slow rise, fast fall"),
        beside("σ in eq. (8)", 1 - lm_H**2 / (ls_H * lr_H), (1 - lm_H**2) / (ls_H * lr_H),
               why="Misprint: (1 − L_m²)/(L_s L_r) mixes units. 1 − L_m²/(L_s L_r) is meant."),
    ]  # fmt: skip


def b7(job: Job) -> Figure:
    """Torque under DTC1 at two speeds, and its slopes compared with eq. (8)."""
    recordings = dict(zip(SPEEDS_RPM, job.each(lambda rpm: _record(job, rpm), SPEEDS_RPM)))
    setup = point("dtc1").setup
    found = {rpm: slopes(rec, setup) for rpm, rec in recordings.items()}
    metrics = {rpm: _figures(s) for rpm, s in found.items()}
    shown = {rpm: excerpt(rec, CHANNELS, SHOWN_S) for rpm, rec in recordings.items()}

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, 3, 4.0)
        for axis, (rpm, rec) in zip(axes[0], shown.items()):
            t_ms = 1e3 * (rec.time_s - rec.start_s)
            torque = rec["plant.torque_Nm"]
            zero = np.isin(gate_states(rec["plant.gates"]) @ (32, 16, 8, 4, 2, 1), (0, 21, 42, 63))
            axis.plot(t_ms, torque, color=COLOUR["dtc1"], linewidth=1, label="active vector")
            axis.plot(t_ms, np.where(zero, torque, np.nan), color=COLOUR["dtc2"], linewidth=1,
                      label="zero vector")  # fmt: skip
            axis.plot(t_ms, rec["torque_ref_Nm"], "--", color=plots.INK, linewidth=0.9,
                      label="reference")  # fmt: skip
            axis.set_xlim(0, 1e3 * SHOWN_S)
            axis.set_ylim(LOAD_NM - 0.7, LOAD_NM + 0.7)
            axis.set_title(f"{rpm:g} r/min", **plots.TITLE)
            axis.set_xlabel("time [ms]", **plots.LABEL)
        axes[0, 0].set_ylabel("torque [N m]", **plots.LABEL)
        axes[0, 0].legend(loc="upper left", ncols=3, handlelength=1.2, columnspacing=1,
                          **plots.LEGEND)  # fmt: skip
        _slope_panel(axes[0, 2], found)
        return plots.save(figure, path)

    return Figure(
        metrics={f"{rpm:g}rpm": row for rpm, row in metrics.items()},
        verdicts=_verdicts(metrics, setup),
        draw=draw,
        recordings={f"{rpm:g}rpm": rec for rpm, rec in shown.items()},
        setups=[setup],
        caption="True torque under DTC1 at 2 N m. The colour shows the vector on the legs. Right: "
        "the measured slope in each period, without the dead times, over the slope by eq. "
        "(8). Eq. (8) is computed from the plant's true fluxes, torque, speed and "
        "voltage, with σ = 1 − L_m²/(L_s L_r).",
    )


def _slope_panel(axis: Axes, found: dict[float, Slopes]) -> None:
    for (rpm, s), marker in zip(found.items(), "o^"):
        for x, y, name, colour in (
            (s.rise_eq8, s.rise, "active", COLOUR["dtc1"]),
            (s.fall_eq8, s.fall, "zero", COLOUR["dtc2"]),
        ):
            axis.plot(x[:400] / 1e3, y[:400] / 1e3, marker, color=colour, markersize=3, alpha=0.5,
                      markeredgewidth=0, label=f"{name}, {rpm:g} r/min")  # fmt: skip
    ends = axis.get_xlim()
    axis.plot(ends, ends, color=plots.INK, linewidth=0.8, zorder=1)
    axis.set_title("slopes", **plots.TITLE)
    axis.set_xlabel("by eq. (8) [kN m/s]", **plots.LABEL)
    axis.set_ylabel("measured [kN m/s]", **plots.LABEL)
    axis.legend(loc="upper left", handletextpad=0.2, **plots.LEGEND)
