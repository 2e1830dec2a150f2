"""Parameter tables: paper A's Table III and paper B's Table V, checked in the running drive.
Parameters are measured where that is possible (`measured.py`); the others are read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .... import setups
from ....analysis import plots
from ....experiments.operating_points import Point
from ....recording.recording import Recording
from ....setups import Setup
from ..engine import measured as m
from ..engine.figure import Figure, Verdict, beside, not_printed
from ..engine.job import Job
from ..paper_a.common import extract

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPEED_RPM = 300.0
#: Bands (means of two bounds) and gains (least squares) are this accurate.
WITHIN = 0.005


@dataclass(frozen=True)
class Row:
    """A line of a table. how: "measured" on the running drive, computed from the plant's
    "equations", or "read back" from set-up and firmware."""

    symbol: str
    what: str
    ours: float
    paper: float | None
    unit: str
    how: str
    within: float = WITHIN

    def verdict(self) -> Verdict:
        what = f"{self.symbol}: {self.what}, {self.how}"
        if self.paper is None:
            return not_printed(what, self.ours, self.unit)
        return beside(what, self.ours, self.paper, self.unit, within=self.within)


def _channels() -> tuple[str, ...]:
    return ("torque_ref_Nm", "torque_decided_Nm", "torque_level", "flux_ref_Wb", "psi_alpha_Wb",
            "psi_beta_Wb", "flux_level", "speed_rpm", "plant.theta_rad")  # fmt: skip


def _figure(
    setups: list[Setup], rows: list[Row], shown: m.Watched, levels: str, caption: str
) -> Figure:
    return Figure(
        metrics={
            f"{row.symbol} {row.what}": {
                "ours": row.ours,
                "unit": row.unit,
                "how": row.how,
            }
            for row in rows
        },
        paper={f"{row.symbol} {row.what}": row.paper for row in rows if row.paper is not None},
        verdicts=[row.verdict() for row in rows],
        draw=lambda path: _draw(path, rows, shown, levels),
        recordings={"": extract(shown.recording, _channels())},
        setups=[*setups, setups[0].changed(timing__latency="none")],
        caption=caption + " The parameters are measured without latency, so that the telemetry of "
        "a period shows the values on which its decision is based. A band is "
        "the mean of the largest error at which a comparator kept its level and "
        "the smallest error at which it changed. Gains are least-squares fits "
        'over the telemetry. "Equations" are those that the plant integrates.',
    )


def a_t3(job: Job) -> Figure:
    """Table III and section III of paper A."""
    printed = setups.load("paper-a")
    single = printed.changed(controller__scheme="dtc1")
    dual = printed.changed(controller__scheme="ddr", controller__zero_hold="off")
    seconds = 1.0 if job.quick else 4.0
    w, xy = job.each(lambda s: m.watch(s, SPEED_RPM, seconds, job.progress), [single, dual])
    rec = w.recording
    settled = rec.window(rec.start_s + 0.6 * seconds, 1e9)
    kp, ki = m.speed_gains(w, printed.parameter("torque_limit_Nm"))
    kp_xy, ki_xy = m.xy_gains(xy.recording.window(xy.recording.start_s + 0.5, 1e9))
    torque_Nm = float(np.mean(m.band(m.torque_error_Nm(rec), rec["torque_level"], 0, 1)))
    flux_Wb = float(np.mean(m.flux_band(rec)))
    flux_ref_Wb = float(np.mean(settled["flux_ref_Wb"]))
    rated_Nm = printed["point.load_Nm"]
    phases = m.phase_ohm(w.machine)
    mean_Wb = np.mean(np.hypot(settled["plant.psi_alpha_Wb"], settled["plant.psi_beta_Wb"]))
    rows = [
        Row("T_n", "rated torque", rated_Nm, 10.0, "N m", "read back"),
        Row("ω_n", "rated speed", printed["load.at_rpm"], 1350.0, "r/min", "read back"),
        Row("ψ_sn", "stator flux reference", flux_ref_Wb, 0.6, "Wb", "read back"),
        Row("ψ_s", "mean stator flux", float(mean_Wb), 0.6, "Wb", "measured", 0.02),
        Row("P", "pole pairs", float(round(m.pole_pairs(settled))), 2.0, "", "measured", 0.0),
        Row("B_T", "torque band", 100 * torque_Nm / rated_Nm, 5.0, "%", "measured"),
        Row("B_ψ", "flux band", 100 * flux_Wb / flux_ref_Wb, 2.0, "%", "measured"),
        Row("R_s", "stator resistance, set 1", float(phases[::2].mean()), 1.8, "Ω", "equations"),
        Row("R_s2", "stator resistance, set 2", float(phases[1::2].mean()), None, "Ω", "equations"),
        Row("K_pxy", "x–y regulator", kp_xy, 0.1, "V_dc/A", "measured"),
        Row("K_ixy", "x–y regulator", ki_xy, 2.5, "V_dc/(A s)", "measured"),
        Row("K_pω", "speed loop", kp, 0.4, "N m s/rad", "measured"),
        Row("K_iω", "speed loop", ki, 0.2, "N m/rad", "measured"),
        Row("f_s", "PWM interrupt", m.isr_Hz(w), 1e4, "Hz", "measured"),
        Row("f_m", "speed loop", m.slow_Hz(rec), 100.0, "Hz", "measured"),
        Row("V_dc", "dc link", float(np.mean(rec["vdc_V"])), 250.0, "V", "measured"),
        Row("t_d", "dead time", m.dead_time_us(w), 2.3, "µs", "measured"),
        Row("PPR", "encoder", w.counts / w.turns / 4, 2048.0, "", "measured", 2e-4),
    ]
    return _figure([single, dual], rows, w, "three", "Set-up paper-a.")


def b_t5(job: Job) -> Figure:
    """Table V and section VI of paper B."""
    base = setups.load("paper-b")
    three, five = (base.changed(controller__scheme=s) for s in ("dtc1", "dtc3"))
    seconds = 1.0 if job.quick else 4.0
    w, v = job.each(lambda s: m.watch(s, SPEED_RPM, seconds, job.progress), [three, five])
    rec, rec5 = w.recording, v.recording
    settled = rec.window(rec.start_s + 0.6 * seconds, 1e9)
    flux_ref_Wb = float(np.mean(settled["flux_ref_Wb"]))
    rs_ohm = float(m.phase_ohm(w.machine).mean())
    rr_ohm, inductance = m.inductances_H(w.machine)
    error3, level3 = m.torque_error_Nm(rec), rec["torque_level"]
    error5, level5 = m.torque_error_Nm(rec5), rec5["torque_level"]
    poles = 2.0 * round(m.pole_pairs(settled))
    bands = (
        ("B_T", "torque band, DTC1", m.band(error3, level3, 0, 1), 0.3),
        ("H_A", "inner torque band, DTC3", m.band(error5, level5, 0, 1), 0.173),
        ("H_B", "outer torque band, DTC3", m.band(error5, level5, 1, 2), 0.3),
    )
    rows = [
        Row("2P", "poles", poles, 2.0, "", "measured", 0.0),
        Row("R_s", "stator resistance", rs_ohm, 6.0, "Ω", "equations"),
        Row("R_r", "rotor resistance", rr_ohm, 2.2, "Ω", "equations"),
        Row("L_ls", "stator leakage", 1e3 * inductance["lls_H"], 14.4, "mH", "equations"),
        Row("L_lr", "rotor leakage", 1e3 * inductance["llr_H"], 14.4, "mH", "equations"),
        Row("L_m", "mutual inductance", 1e3 * inductance["lm_H"], 256.0, "mH", "equations"),
        Row("L_xy", "x–y inductance, eq. (4)", 1e3 * inductance["lxy_H"], 14.4, "mH", "equations"),
        Row("V_dc", "dc link", float(np.mean(rec["vdc_V"])), 300.0, "V", "measured"),
        Row("f_s", "sampling", m.isr_Hz(w), 1e4, "Hz", "measured"),
        Row("PPR", "encoder", w.counts / w.turns / 4, 1500.0, "", "measured", 2e-4),
        *(Row(s, what, float(np.mean(b)), p, "N m", "measured") for s, what, b, p in bands),
        Row("B_ψ", "flux band", 1e3 * float(np.mean(m.flux_band(rec))), 3.0, "mWb", "measured"),
        Row("ψ_s", "flux reference", flux_ref_Wb, None, "Wb", "read back"),
        Row("t_d", "dead time", m.dead_time_us(w), None, "µs", "measured"),
        # The rated power is not a parameter of the model. The question is whether the drive holds
        # it.
        Row("P_n", "rated power, held", _held_W(job, base, 750.0), 750.0, "W", "measured", 0.01),
    ]
    return _figure([three, five], rows, v, "five", "Set-up paper-b; pictures: DTC3.")


def _held_W(job: Job, base: Setup, power_W: float) -> float:
    """Air-gap power at the speed of Table VI, under the load that needs `power_W`."""
    rad_s = base["point.speed_rpm"] * np.pi / 30
    [run] = job.runs([Point(base, base["point.speed_rpm"], power_W / rad_s)])
    return run.metrics["torque_Nm"] * run.metrics["speed_rpm"] * np.pi / 30


def _draw(path: Path, rows: list[Row], shown: m.Watched, levels: str) -> Path:
    figure, axes = plots.new_figure(
        2, 3, 3.6 + 0.235 * len(rows), height_ratios=(2.7, 0.6 + 0.235 * len(rows))
    )
    rec = shown.recording
    _comparator(axes[0, 0], m.torque_error_Nm(rec), rec["torque_level"])
    axes[0, 0].set_xlabel("torque error [N m]", **plots.LABEL)
    axes[0, 0].set_title(f"torque comparator, {levels} levels", **plots.TITLE)
    _comparator(axes[0, 1], 1e3 * m.flux_error_Wb(rec), rec["flux_level"])
    axes[0, 1].set_xlabel("flux error [mWb]", **plots.LABEL)
    axes[0, 1].set_title("flux comparator", **plots.TITLE)
    _speed_loop(axes[0, 2], rec)
    grid = axes[1, 0].get_gridspec()
    for ax in axes[1]:
        ax.remove()
    _table(figure.add_subplot(grid[1, :]), rows)
    return plots.save(figure, path)


def _comparator(ax: Axes, error: np.ndarray, level: np.ndarray) -> None:
    """Draw the new level over the error, with a colour for each previous level."""
    before, now, at = level[:-1], level[1:], error[1:]
    colours = ("#009e73", "#0072b2", "#8a8f98", "#d55e00", "#cc79a7")
    span = np.percentile(np.abs(error), 99.5)
    for old in np.unique(before):
        rows = (before == old) & (np.abs(at) < span)
        ax.plot(at[rows], now[rows] + 0.07 * old, ".", markersize=2.5,
                color=colours[int(old) + 2], label=f"{old:g}")  # fmt: skip
    ax.set_yticks(np.unique(level))
    ax.set_ylabel("output", **plots.LABEL)
    ax.legend(title="before", title_fontsize=8, loc="lower right", markerscale=3, **plots.LEGEND)


def _speed_loop(ax: Axes, rec: Recording) -> None:
    """Draw the steps of the torque reference while the speed approaches its reference."""
    torque = rec["torque_ref_Nm"]
    first = int(np.argmax(np.abs(np.diff(torque)) > 0))
    free = np.nonzero(np.abs(torque[first + 1 :]) < 0.98 * np.abs(torque).max())[0]
    begin = first + 1 + int(free[0])
    part = slice(begin, begin + round(0.12 * rec.rate_Hz))
    t_ms = 1e3 * np.arange(part.stop - part.start) / rec.rate_Hz
    ax.plot(t_ms, torque[part], color=plots.COLOUR["torque"], linewidth=1.2)
    ax.set_xlabel("time [ms]", **plots.LABEL)
    ax.set_ylabel("torque reference [N m]", **plots.LABEL)
    ax.set_title("speed loop", **plots.TITLE)


def _table(ax: Axes, rows: list[Row]) -> None:
    ax.set_axis_off()
    ax.set_xlim(0, 1)
    ax.set_ylim(len(rows) + 0.5, -1)
    places = (0.0, 0.09, 0.42, 0.58, 0.7, 0.86)
    heading = ("symbol", "parameter", "running drive", "printed", "unit", "how")

    def write(y: float, cells: tuple[str, ...], **style: Any) -> None:
        for x, cell in zip(places, cells):
            right = x in places[2:4]
            ax.text(x + (0.1 if right else 0), y, cell, ha="right" if right else "left",
                    va="center", fontsize=8.5, color=plots.INK, **style)  # fmt: skip

    write(-0.3, heading, fontweight="bold")
    for n, row in enumerate(rows):
        printed = "–" if row.paper is None else f"{row.paper:g}"
        write(n + 0.7, (row.symbol, row.what, f"{row.ours:.5g}", printed, row.unit, row.how))
        ax.axhline(n + 0.2, color=plots.FAINT, linewidth=0.6)
