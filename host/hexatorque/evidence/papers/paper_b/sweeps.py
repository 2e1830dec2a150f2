"""Paper B's sweeps over load: THD and switching frequency (Figs. 14 and 19)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..engine.figure import Figure, Verdict, beside, claim
from ..engine.job import Job
from .common import FITTED, LOAD_NM
from .grid import Grid, draw_grid, grid_figure, measured, record_grid

#: There is a panel for each speed, over load. Full load is that of Table VI. The paper does not
#: print its base (0.75 kW at 3000 r/min would be 2.4 N m).
SPEEDS_RPM = (500.0, 1500.0, 2500.0)
NAMES = [f"{speed:g} r/min" for speed in SPEEDS_RPM]
SHARES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
QUICK_SHARES = (0.2, 0.6, 1.0)

WHY_LOCK = (
    "Around 1500 r/min one large vector often ends just below the reference, and a second one "
    "ends beyond the far edge of DTC1's band. DTC1 then brakes with active vectors as well (9 to "
    "20 % of the periods)."
)
WHY_ZERO = (
    "The paper's tables have V0 only. We take the zero vector with the fewest transitions, and "
    "DTC1 gains most from this. With V0 only, the ratio is 1.17, 0.91, 1.27 at 500, 1500, 2500 "
    "r/min. With V0 only and 0.25 Wb it is 1.11, 1.07, 1.24."
)
WHY_DOUBLE = (
    "It depends on the zero vectors, as for DTC2, and on the flux. With V0 only and 0.25 Wb the "
    "ratio is 1.8, 2.0, 2.0 at 500, 1500, 2500 r/min."
)
WHY_RELEASE = (
    "The release of DTC1 and DTC2 beyond the reference is assumed for their ripple. It makes them "
    "switch more at low speed and load. If they are released at the reference, DTC3 has 1.8, 2.0, "
    "2.0 times DTC1's frequency at 500, 1500, 2500 r/min, and the order holds at each speed."
)
WHY_LIGHT = (
    "At light load and 0.25 Wb the fundamental is small. Most of the THD is then switching "
    "ripple, which all schemes have."
)
WHY_SAME = (
    "At low speed DTC3 applies small vectors most of the time. These are the longest in the x–y "
    "plane. With V0 as the only zero vector, as printed, the ratio is 1.33, 1.02, 1.06 at 500, "
    "1500, 2500 r/min. With V0 only and 0.25 Wb it is 1.22, 1.11, 1.02."
)


def _over_load(job: Job, value: Callable) -> tuple[np.ndarray, dict[str, Grid]]:
    """The loads in N m, and `value` over the loads at the three speeds. Figs. 14 and 19 have the
    same points."""
    loads = LOAD_NM * np.array(QUICK_SHARES if job.quick else SHARES)
    return loads, measured(job, SPEEDS_RPM, loads, lambda speed, load: (speed, load), value)


def _thd_verdicts(name: str, thd: Grid) -> list[Verdict]:
    verdicts: list[Verdict] = []
    for row, speed in enumerate(NAMES):
        first, second, third = (values[row] for values in thd.values())
        worst = float(np.max(np.maximum(second, third) / first))
        same = float(third.mean() / second.mean())
        verdicts += [
            claim(f"{name}, {speed}: DTC2 and DTC3 over DTC1, at most", worst < 0.75, worst,
                  "much less", why=WHY_LIGHT),
            claim(f"{name}, {speed}: DTC3 over DTC2, mean over load, within 15 %",
                  abs(same - 1) < 0.15, same, "the same", why=WHY_SAME),
        ]  # fmt: skip
    return verdicts


def b14(job: Job) -> Figure:
    """THD of phase a over load at three speeds."""
    loads, thd = _over_load(job, lambda m: m["thd_pct"]["1kHz"])
    return grid_figure(
        thd,
        verdicts=[v for name, grid in thd.items() for v in _thd_verdicts(name, grid)],
        draw=draw_grid(loads, NAMES, thd, "load [N m]", "THD of $i_a$, up to 1 kHz [%]"),
        recordings={
            name: record_grid("load_Nm", "N m", loads, grid, NAMES) for name, grid in thd.items()
        },
        caption="THD up to 1 kHz. The paper does not state its band. Full load is taken as 2 N m.",
    )


def _order(name: str, where: str, mean_kHz: list[float], required: bool = False) -> list[Verdict]:
    """The verdicts on order and ratios of the schemes' means over load. The paper prints round
    numbers."""
    first, second, third = mean_kHz
    fitted = name == FITTED
    label = f"{name}, {where}"
    why_order = WHY_RELEASE if fitted else WHY_LOCK
    why_second = WHY_RELEASE if fitted else WHY_LOCK if second < first else WHY_ZERO
    return [
        claim(f"{label}: DTC1 ≤ DTC2 < DTC3", first <= second < third,
              f"{first:.2f}, {second:.2f}, {third:.2f}", "this order", "kHz", why=why_order,
              required=required),
        beside(f"{label}: DTC2 over DTC1", second / first, 1.1, within=0.1, why=why_second),
        beside(f"{label}: DTC3 over DTC1", third / first, 2.0, within=0.1,
               why=WHY_RELEASE if fitted else WHY_DOUBLE),
    ]  # fmt: skip


def _f_sw_verdicts(name: str, f_sw: Grid) -> list[Verdict]:
    means = [float(values.mean()) for values in f_sw.values()]
    verdicts = _order(name, "all points", means, required=True)
    for row, speed in enumerate(NAMES):
        verdicts += _order(name, speed, [float(values[row].mean()) for values in f_sw.values()])
    return verdicts


def b19(job: Job) -> Figure:
    """Mean switching frequency of a leg over load at three speeds."""
    loads, f_sw = _over_load(job, lambda m: m["f_sw_Hz"] / 1e3)
    return grid_figure(
        f_sw,
        verdicts=[v for name, grid in f_sw.items() for v in _f_sw_verdicts(name, grid)],
        draw=draw_grid(loads, NAMES, f_sw, "load [N m]", "switching frequency [kHz]"),
        recordings={
            name: record_grid("load_Nm", "N m", loads, grid, NAMES) for name, grid in f_sw.items()
        },
        caption="The switching frequency is the number of transitions of all legs / (12 × time). "
        "The points are those of Fig. 14.",
    )
