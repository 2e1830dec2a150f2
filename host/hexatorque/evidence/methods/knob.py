"""The knob of `db-ipwm`: torque ripple and distortion over `thd_share` and the voltage, on each
machine, with carriers of one frequency.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from ...experiments.operating_points import Progress
from ...parallel import each
from ..studies.grids import Grid
from . import bench, carrier
from .methods import controller, methods
from .pictures import one_legend
from .places import MACHINES, Place

TITLE = "What thd_share does at each voltage"
NAME, SHARE = "db-ipwm", "thd_share"
NOTE = f"Td [N m] · THD∞ [%] under {NAME}."
F_SW_HZ = 4e3
SHARES = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0)
#: Closer together where the pulses' positions begin to count.
VOLTAGES_PU = (0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5)
QUICK_SHARES, QUICK_VOLTAGES_PU = (0.0, 0.5, 1.0), (0.1, 0.5)
FIGURES = (("td_Nm", "Td [N m]"), ("thd_inf_pct", "THD∞ [%]"))


def at_voltage(place: Place, m_pu: float) -> Place:
    """The place at the speed at which its voltage has this amplitude, in units of V_dc, to
    1 r/min."""
    base = place.base
    flux_Wb, vdc_V = base.parameter("flux_ref_Wb"), base["inverter.vdc_V"]

    def beyond(speed_rpm: float) -> float:
        at = carrier.steady_state(base, replace(place, speed_rpm=speed_rpm), flux_Wb)
        return float(abs(at.v_V)) / vdc_V - m_pu

    return replace(place, speed_rpm=float(round(brentq(beyond, 1.0, 2e4))))


def _measured(place: Place, share: float, progress: Progress | None) -> dict | None:
    (method,) = (one for one in methods() if one.name == NAME)
    sampling = method.axes[0]
    at = math.log(4 * F_SW_HZ / sampling.low) / math.log(sampling.high / sampling.low)
    values = controller(method.values(place.base, np.array([at, share])))
    build_s = place.base.parameter("build_s")
    return bench.measure(method.scheme, values, place, progress, build_s=build_s)


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    machines = MACHINES[1:2] if quick else MACHINES
    shares = QUICK_SHARES if quick else SHARES
    voltages_pu = QUICK_VOLTAGES_PU if quick else VOLTAGES_PU
    tasks = list(itertools.product(machines, voltages_pu, shares))

    def one(task: tuple) -> dict:
        machine, m_pu, share = task
        place = at_voltage(machine.place, m_pu)
        found = _measured(place, share, progress) or {}
        kept = {key: found[key] for key in ("f_sw_Hz", "td_Nm", "thd_inf_pct") if found}
        return {
            "machine": machine.name, "m_pu": m_pu, "speed_rpm": place.speed_rpm,
            "torque_Nm": place.torque_Nm, SHARE: share, **kept,
        }  # fmt: skip

    return {"quick": quick, "rows": each(one, tasks)}


def failures(result: dict) -> list[str]:
    """Points that the drive does not hold; what is measured has no limit."""
    return [
        f"{row['machine']}, {row['m_pu']:g} V_dc, {SHARE} {row[SHARE]:g}: does not hold the point"
        for row in result["rows"]
        if "td_Nm" not in row
    ]


def grid(result: dict) -> Grid:
    shares = list(dict.fromkeys(row[SHARE] for row in result["rows"]))
    by = {(row["machine"], row["m_pu"], row[SHARE]): row for row in result["rows"]}
    lines = [
        [
            machine, f"{m_pu:g}", f"{by[machine, m_pu, shares[0]]['speed_rpm']:.0f}",
            *(
                " · ".join(f"{row[key]:.3g}" for key, _ in FIGURES) if "td_Nm" in row else "–"
                for row in (by[machine, m_pu, share] for share in shares)
            ),
        ]
        for machine, m_pu in dict.fromkeys((row["machine"], row["m_pu"]) for row in result["rows"])
    ]  # fmt: skip
    heads = ["machine", "V_dc", "r/min", *(f"{SHARE} {share:g}" for share in shares)]
    return [(f"At {F_SW_HZ / 1e3:g} kHz", heads, lines)]


def plot(result: dict, path: Path) -> Path:
    """Both figures over the share, a line for each voltage."""
    from matplotlib import colormaps

    from ...analysis import plots

    machines = list(dict.fromkeys(row["machine"] for row in result["rows"]))
    voltages_pu = list(dict.fromkeys(row["m_pu"] for row in result["rows"]))
    drawn, axes = plots.new_figure(len(FIGURES), len(machines), 5.6, 2.9 * len(machines))
    for column, machine in enumerate(machines):
        for axis, (figure, text) in zip(axes[:, column], FIGURES):
            for n, m_pu in enumerate(voltages_pu):
                rows = [
                    row
                    for row in result["rows"]
                    if (row["machine"], row["m_pu"]) == (machine, m_pu) and figure in row
                ]
                axis.plot(
                    [row[SHARE] for row in rows], [row[figure] for row in rows], ".-",
                    color=colormaps["viridis"](0.92 * n / max(len(voltages_pu) - 1, 1)),
                    label=f"{m_pu:g} V_dc",
                )  # fmt: skip
            axis.set_ylabel(text, **plots.LABEL)
        axes[0, column].set_title(machine, **plots.TITLE)
        axes[-1, column].set_xlabel(SHARE, **plots.LABEL)
    one_legend(drawn, axes, len(voltages_pu))
    return plots.save(drawn, path)
