"""Paper B's operating point in steady state: currents and torque (Figs. 13 and 15)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....analysis import plots
from ....analysis.run import Run
from ....analysis.spectrum import fundamental_Hz, harmonics, spectrum, whole_cycles
from ....recording.recording import Recording
from ..engine.figure import Figure, claim, not_printed
from ..engine.job import Job
from .common import (
    COLOUR,
    SCHEMES,
    control_instants,
    ending,
    excerpt,
    mean,
    point,
    runs_around,
    torque_orders,
    xy_orders,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The shown spans of currents (the paper's screen has ten divisions of 5 ms) and torque.
CURRENT_S, TORQUE_S = 0.05, 0.05
HIGHEST_ORDER, HIGHEST_PCT = 31, 40
PHASES = ("plant.i_u1_A", "plant.i_u2_A")
TRACES = ("plant.torque_Nm", "torque_Nm", "torque_ref_Nm", "torque_level")


def _orders(run: Run) -> dict[str, float]:
    """Harmonics of phase a (u1) in % of the fundamental: the rms of those of each plane up to order
    50, and the low ones of the x-y plane."""
    rec = run.recording
    f1_Hz = abs(fundamental_Hz(rec))
    line = harmonics(rec["plant.i_u1_A"], rec.rate_Hz, f1_Hz, range(1, 51))
    percent = {order: 100 * peak / line[1] for order, peak in line.items()}
    return {
        "xy_pct": float(np.sqrt(sum(percent[k] ** 2 for k in xy_orders(50)))),
        "dq_pct": float(np.sqrt(sum(percent[k] ** 2 for k in torque_orders(50)))),
        "h5_pct": percent[5],
        "h7_pct": percent[7],
        "next_pct": max(percent[k] for k in range(2, 51) if k not in (5, 7)),
    }


def b13(job: Job) -> Figure:
    """Currents of phases a and b (u1, u2 here), and the spectrum of phase a."""
    runs = runs_around(job, SCHEMES)
    lines = {scheme: mean([_orders(run) for run in many]) for scheme, many in runs.items()}
    shown = {
        scheme: excerpt(many[0].recording, (*PHASES, "plant.psi_alpha_Wb", "plant.psi_beta_Wb"))
        for scheme, many in runs.items()
    }
    own = lines["dtc1"]
    second, third = (lines[scheme]["xy_pct"] / own["xy_pct"] for scheme in SCHEMES[1:])

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(3, 2, 7.2, sharex="col", sharey="col")
        for (left, right), (scheme, rec) in zip(axes, shown.items()):
            part = ending(rec, CURRENT_S)
            for name, colour, label in zip(PHASES, ("i_u1", "i_u2"), ("$i_a$", "$i_b$")):
                left.plot(1e3 * (part.time_s - part.start_s), part[name], linewidth=0.9,
                          color=plots.COLOUR[colour], label=label)  # fmt: skip
            left.set_title(f"{scheme.upper()}, currents", **plots.TITLE)
            left.set_ylabel("current [A]", **plots.LABEL)
            right.set_title(f"{scheme.upper()}, spectrum of phase a", **plots.TITLE)
            _spectrum_panel(right, rec)
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.2 * (high - low))  # room for the legend
        axes[0, 0].set_xlim(0, 1e3 * CURRENT_S)
        axes[0, 0].legend(loc="upper right", ncols=2, **plots.LEGEND)
        axes[0, 1].set_xlim(0, HIGHEST_ORDER + 1)
        axes[0, 1].set_ylim(0, HIGHEST_PCT)
        axes[0, 1].set_xticks([1, *xy_orders(HIGHEST_ORDER)])
        axes[-1, 0].set_xlabel("time [ms]", **plots.LABEL)
        axes[-1, 1].set_xlabel("harmonic order (marked: 1 and 6n±1, n odd)", **plots.LABEL)
        return plots.save(figure, path)

    return Figure(
        metrics=lines,
        verdicts=[
            claim("DTC1: 5th and 7th over the next largest harmonic",
                  min(own["h5_pct"], own["h7_pct"]) > own["next_pct"],
                  min(own["h5_pct"], own["h7_pct"]) / own["next_pct"], "the largest"),
            claim("DTC1: orders 6n±1 (n odd) over 12n±1, rms", own["xy_pct"] > 3 * own["dq_pct"],
                  own["xy_pct"] / own["dq_pct"], "dominate"),
            not_printed("DTC1: orders 6n±1, rms", own["xy_pct"], "%"),
            claim("DTC2: orders 6n±1 over DTC1's", second < 0.5, second, "much smaller"),
            claim("DTC3: orders 6n±1 over DTC1's", third < 0.5, third, "much smaller"),
        ],
        draw=draw,
        recordings=shown,
        setups=[point(scheme).setup for scheme in SCHEMES],
        caption="True phase currents at 2500 r/min and 2 N m. The harmonics, up to order 50, are "
                "means over five loads within 2 % (quick: three). The spectra show one of these "
                "loads.",
    )  # fmt: skip


def _spectrum_panel(axis: Axes, rec: Recording) -> None:
    f1_Hz = abs(fundamental_Hz(rec))
    signal, cycles = whole_cycles(rec["plant.i_u1_A"], rec.rate_Hz, f1_Hz)
    f_Hz, peak_A = spectrum(signal - signal.mean(), rec.rate_Hz)
    shown = f_Hz < (HIGHEST_ORDER + 1) * f1_Hz
    axis.plot(f_Hz[shown] / f1_Hz, 100 * peak_A[shown] / peak_A[cycles],
              color=plots.COLOUR["spectrum"], linewidth=0.9)  # fmt: skip
    axis.set_ylabel("[% of fundamental]", **plots.LABEL)
    plots.note(axis, f"fundamental {peak_A[cycles]:.2f} A = 100 %")


def b15(job: Job) -> Figure:
    """Torque in steady state."""
    runs = runs_around(job, SCHEMES)
    ripple, below = {}, {}
    for scheme, many in runs.items():
        ripple[scheme] = float(np.mean([run.metrics["torque_ripple_Nm"] for run in many]))
        errors = [run.recording["torque_ref_Nm"] - run.recording["torque_Nm"] for run in many]
        below[scheme] = float(np.mean(errors))
    shown = {s: excerpt(control_instants(many[0].recording), TRACES) for s, many in runs.items()}
    inner, outer = (point("dtc3").setup.parameter(f"torque_{b}_Nm") for b in ("inner", "band"))

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(3, 1, 6.6, sharex=True, sharey=True)
        for axis, (scheme, rec) in zip(axes[:, 0], shown.items()):
            part = ending(rec, TORQUE_S)
            t_ms = 1e3 * (part.time_s - part.start_s)
            axis.plot(t_ms, part["torque_Nm"], color=COLOUR[scheme], linewidth=0.9)
            axis.plot(t_ms, part["torque_ref_Nm"], "--", color=plots.INK, linewidth=0.9,
                      label="reference")  # fmt: skip
            axis.set_title(scheme.upper(), **plots.TITLE)
            axis.set_ylabel("torque [N m]", **plots.LABEL)
            plots.note(axis, f"std {ripple[scheme]:.3f} N m")
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.15 * (high - low))  # room for the notes
        axes[0, 0].legend(loc="upper left", **plots.LEGEND)
        axes[-1, 0].set_xlabel("time [ms]", **plots.LABEL)
        axes[-1, 0].set_xlim(0, 1e3 * TORQUE_S)
        return plots.save(figure, path)

    second, third = (ripple[scheme] / ripple["dtc1"] for scheme in SCHEMES[1:])
    return Figure(
        metrics={"torque_ripple_Nm": ripple, "below_reference_Nm": below},
        verdicts=[
            claim("ripple of DTC2 over DTC1's", abs(second - 1) < 0.1, second, "the same"),
            claim("ripple of DTC3 over DTC1's", third < 0.65, third, "considerably less"),
            claim("DTC3: mean torque below its reference", inner < below["dtc3"] < outer,
                  below["dtc3"], f"between {inner:g} and {outer:g}", "N m"),
        ],
        draw=draw,
        recordings=shown,
        setups=[point(scheme).setup for scheme in SCHEMES],
        caption="Estimated torque at the control instants, 2500 r/min and 2 N m. The ripple is "
                "the standard deviation of the true torque at these instants. It is a mean over "
                "five loads within 2 % (quick: three). The comparators keep the error on one "
                "side, so the mean is below the reference. The speed loop raises the reference "
                "accordingly.",
    )  # fmt: skip
