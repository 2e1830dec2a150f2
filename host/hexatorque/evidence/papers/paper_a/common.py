"""The common parts of paper A's figures: operating points, lines of the x-y currents, panels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .... import setups
from ....analysis import plots, run
from ....analysis.run import Run
from ....analysis.spectrum import channel, fundamental_Hz, harmonics, spectrum, whole_cycles
from ....drive.simulated import SimulatedDrive
from ....experiments.operating_points import Point, Progress
from ....recording.recording import Recording
from ....setups import Setup
from ..engine.job import Job

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The set-up of every figure, and the one that keeps all printed values.
SETUP, PRINTED = "paper-a-feasible", "paper-a"
SCHEMES = ("fdr", "ddr")
NAMES = run.LABELS
#: Lines of the x-y plane that the paper treats: asymmetry causes 1, dead time causes 5 and 7.
ORDERS = (1, 5, 7)
#: Switching tables are chaotic in detail, so means are taken over neighbouring speeds. These are
#: the factors.
NEAR = (1.0, 0.99, 1.01, 0.98, 1.02, 0.97, 1.03)
#: Corner frequency of the filter in the paper's enlarged pictures.
LOW_PASS_HZ = 1e3
BANDS = ("1kHz", "2kHz", "5kHz", "h50")
BAND_NAMES = {"1kHz": "1 kHz", "2kHz": "2 kHz", "5kHz": "5 kHz", "h50": "harmonics ≤ 50"}


def setup(scheme: str, name: str = SETUP, /, **changes: object) -> Setup:
    return setups.load(name).changed(controller__scheme=scheme, **changes)


def rated(name: str = SETUP) -> tuple[float, float]:
    """Rated speed [r/min] and torque [N m]."""
    base = setups.load(name)
    return base["load.at_rpm"], base["point.load_Nm"]


def infeasible() -> str:
    """Why the printed rated point cannot be held."""
    base, (speed_rpm, _) = setups.load(PRINTED), rated(PRINTED)
    vdc_V = base["inverter.vdc_V"]
    emf_V = base.parameter("flux_ref_Wb") * base["machine.pole_pairs"] * speed_rpm * math.pi / 30
    return (
        "The printed flux, speed and V_dc do not fit together: the back-EMF would be "
        f"ωψ = {emf_V:.1f} V. Vectors without mean x–y voltage give at most "
        f"V_dc/√3 = {vdc_V / math.sqrt(3):.1f} V around the circle, twelve-step operation "
        f"2V_dc/π = {2 * vdc_V / math.pi:.1f} V. The drive does not trip; it stays below the speed."
    )


def around(job: Job, speed_rpm: float, load_Nm: float, count: int) -> dict[str, list[Run]]:
    """Scheme -> runs at `count` neighbouring speeds. The first one is `speed_rpm` itself."""
    points = [
        Point(setup(scheme), near * speed_rpm, load_Nm)
        for scheme in SCHEMES
        for near in NEAR[:count]
    ]
    runs = job.runs(points)
    return {scheme: runs[n * count : (n + 1) * count] for n, scheme in enumerate(SCHEMES)}


def mean(runs: list[Run], *keys: str) -> float:
    """Mean of a figure of merit over the runs, for example `mean(runs, "thd_pct", "5kHz")`."""
    values: list[Any] = [run.metrics for run in runs]
    for key in keys:
        values = [value[key] for value in values]
    return float(np.mean(values))


def asked_for(point: Point, progress: Progress | None = None) -> SimulatedDrive:
    """A drive with the references of the point. It may not have reached them."""
    sim = SimulatedDrive(point.setup)
    sim.start()
    for name, value, wait_s in (
        ("speed_ref_rpm", 0.0, 0.4),
        ("speed_ref_rpm", point.speed_rpm, 1.6),
        ("load_Nm", point.load_Nm, 2.0),
    ):
        sim.set(name, value)
        sim.run(wait_s, record=False, progress=progress)
    return sim


def extract(
    rec: Recording, names: tuple[str, ...], begin_s: float = 0.0, end_s: float = 1e9, every: int = 1
) -> Recording:
    """The named channels between two instants. Only each `every`-th sample is kept."""
    part = rec.window(begin_s, end_s)
    per = rec.meta.get("samples_per_period", 1)
    return Recording(
        rec.rate_Hz / every,
        {name: np.asarray(part[name][::every], np.float32) for name in names},
        {name: rec.units.get(name, "") for name in names},
        rec.meta | {"samples_per_period": max(1, per // every)},
        part.start_s,
    )


def xy_lines_A(rec: Recording) -> dict[int, float]:
    """Order -> amplitude of that line of the x-y current, sqrt((A_x^2 + A_y^2) / 2). If the current
    runs on a circle, this is its radius."""
    f1_Hz = abs(fundamental_Hz(rec))
    x, y = (
        harmonics(channel(rec, name), rec.rate_Hz, f1_Hz, ORDERS) for name in ("i_x_A", "i_y_A")
    )
    return {order: float(np.hypot(x[order], y[order]) / np.sqrt(2)) for order in ORDERS}


def rms(*signals: np.ndarray) -> float:
    """sqrt(mean(a^2 + b^2 + ...))."""
    return float(np.sqrt(np.mean(sum(np.asarray(s, dtype=float) ** 2 for s in signals))))


def arrow(fdr: float, ddr: float, unit: str, digits: int = 3) -> str:
    """The text "FDR's value → DDR's value" of a verdict."""
    return f"{fdr:.{digits}f} → {ddr:.{digits}f} {unit}".rstrip()


def milli(fdr_A: float, ddr_A: float) -> str:
    return arrow(1e3 * fdr_A, 1e3 * ddr_A, "mA", 1)


#: Colour of a channel's line.
INKS = {
    "plant.i_u1_A": plots.COLOUR["i_u1"],
    "plant.i_u2_A": plots.COLOUR["i_u2"],
    "plant.i_x_A": plots.COLOUR["i_x"],
    "plant.i_y_A": plots.COLOUR["i_y"],
    "plant.i_alpha_A": "#56b4e9",
    "plant.i_beta_A": "#5b4fa2",
    "v_x_pu": plots.COLOUR["i_x"],
    "v_y_pu": plots.COLOUR["i_y"],
    "plant.torque_Nm": plots.COLOUR["torque"],
    "plant.speed_rpm": "#56b4e9",
}
SYMBOLS = {
    "plant.i_u1_A": "$i_{u1}$",
    "plant.i_u2_A": "$i_{u2}$",
    "plant.i_x_A": "$i_x$",
    "plant.i_y_A": "$i_y$",
    "plant.i_alpha_A": r"$i_\alpha$",
    "plant.i_beta_A": r"$i_\beta$",
    "v_x_pu": "$v_x^*$",
    "v_y_pu": "$v_y^*$",
    "plant.torque_Nm": "$T_e$",
    "plant.speed_rpm": r"$\omega_m$",
}


def _line(name: str) -> dict[str, Any]:
    return {"color": INKS[name], "linewidth": 0.8, "label": SYMBOLS[name]}


def trace(ax: Axes, t: np.ndarray, y: np.ndarray, name: str, **style: Any) -> None:
    """Draw one channel over time."""
    style = _line(name) | style
    ax.plot(*plots.thin(t, np.asarray(y)), **style)


def lines(ax: Axes, rec: Recording, names: tuple[str, ...], top_A: float, **style: Any) -> None:
    """Draw amplitude spectra in ampere up to order 25. The scale covers four decades below
    `top_A`."""
    floor_A = 1e-4 * top_A
    f1_Hz = abs(fundamental_Hz(rec))
    for name in names:
        signal, _ = whole_cycles(rec[name], rec.rate_Hz, f1_Hz)
        f_Hz, amplitude = spectrum(signal - signal.mean(), rec.rate_Hz)
        shown = f_Hz < 26 * f1_Hz
        order, amplitude = f_Hz[shown] / f1_Hz, np.maximum(amplitude[shown], floor_A)
        ink = _line(name) | style
        ax.fill_between(order, amplitude, floor_A, color=ink["color"], alpha=0.15, linewidth=0)
        ax.plot(order, amplitude, **ink)
    ax.set_yscale("log")
    ax.set_ylim(floor_A, top_A)
    ax.set_xlim(0, 26)
    ax.set_xticks([1, 5, 7, 11, 13, 17, 19, 23, 25])
    ax.minorticks_off()
    ax.set_xlabel("harmonic order", **plots.LABEL)


def legends(axes: np.ndarray, labels: list[str]) -> None:
    """Put a legend beside the last panel of each row, and the row's label before the first."""
    for row, label in zip(axes, labels, strict=True):
        row[0].set_ylabel(label, **plots.LABEL)
        row[-1].legend(loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1.2, **plots.LEGEND)
