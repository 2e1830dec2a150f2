"""The cost of the shortest gate pulse: torque ripple and distortion with and without it.

Without it is a board whose power stage takes any pulse: the firmware then keeps the dead time
alone. The schemes of two stages decide at each period's start, so only one of them is here.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ... import firmware, setups
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import NOT_MEASURED, Point, Progress, measure
from ...experiments.prepare import Prepare
from ...parallel import each
from .grids import Grid

TITLE = "What the shortest gate pulse costs"
SETUP = "paper-a-feasible"
LOAD_NM = 3.0
SPEEDS_RPM = (600.0, 1200.0, 1400.0)
#: Scheme, and what else is set. Clamped legs are near a rail at any voltage, centred ones at a high
#: one alone.
VARIANTS: dict[str, dict[str, float]] = {
    "ddr": {},
    "db-dtfc, clamped": {"kappa": 1.0, "kappa_from_pu": 0.0},
    "db-dtfc, centred": {"kappa": 0.0},
    "foc": {},
    "foc-24": {},
    "db-ipwm": {},
}
#: Shortest pulses, us. The second is the boards' own.
PULSES_US = (0.0, 2.0, 4.0)
#: Figure of merit, how it is called, its digits.
FIGURES = (
    ("torque_ripple_Nm", "torque ripple [N m]", 4),
    ("thd_inf_pct", "THD∞ [%]", 2),
)


def any_pulse(shortest_us: float) -> Prepare:
    """The power stage takes any pulse, and the firmware keeps this one."""

    def prepare(sim: SimulatedDrive) -> None:
        controller = sim.controller
        firmware.ffi.cast("ht_board *", controller.port.board).min_pulse_us = 0.0
        row = controller.parameters["min_pulse_us"]
        controller.parameters = {**controller.parameters, row.name: replace(row, min=0.0)}
        sim.set(row.name, shortest_us)

    return prepare


def _figures(variant: str, speed_rpm: float, shortest_us: float) -> dict[str, float]:
    scheme, *_ = variant.split(",")
    changes = {f"controller__{name}": value for name, value in VARIANTS[variant].items()}
    setup = setups.load(SETUP).with_scheme(scheme).changed(**changes)
    names = [name for name, _, _ in FIGURES]
    run = measure(Point(setup, speed_rpm, LOAD_NM), None, 4, any_pulse(shortest_us), names)
    return {name: run.metrics[name] for name in names}


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    variants = list(VARIANTS)[1:3] if quick else list(VARIANTS)
    speeds_rpm = SPEEDS_RPM[1:2] if quick else SPEEDS_RPM
    tasks = [(variant, rpm, us) for variant in variants for rpm in speeds_rpm for us in PULSES_US]

    def one(task: tuple[str, float, float]) -> dict:
        variant, speed_rpm, shortest_us = task
        row = {"variant": variant, "speed_rpm": speed_rpm, "min_pulse_us": shortest_us}
        try:
            return row | {"figures": _figures(*task), "error": ""}
        except NOT_MEASURED as error:
            return row | {"figures": {}, "error": str(error)}

    rows = each(one, tasks)
    return {"quick": quick, "load_Nm": LOAD_NM, "rows": rows}


def failures(result: dict) -> list[str]:
    """Points that could not be measured; the measured values have no limit."""
    return [
        f"{row['variant']}, {row['speed_rpm']:.0f} r/min, {row['min_pulse_us']:g} us: "
        f"{row['error']}"
        for row in result["rows"]
        if row["error"]
    ]


def grid(result: dict) -> Grid:
    by = {(r["variant"], r["speed_rpm"], r["min_pulse_us"]): r["figures"] for r in result["rows"]}
    places = dict.fromkeys((variant, rpm) for variant, rpm, _ in by)
    lines = [
        [
            variant, f"{rpm:.0f}", title,
            *(
                f"{figures[name]:.{digits}f}" if (figures := by[variant, rpm, us]) else "–"
                for us in PULSES_US
            ),
        ]
        for variant, rpm in places
        for name, title, digits in FIGURES
    ]  # fmt: skip
    heads = [
        "scheme", f"speed [r/min], {SETUP}, {LOAD_NM:g} N m", "figure",
        "without", *(f"{us:g} µs" for us in PULSES_US[1:]),
    ]  # fmt: skip
    return [("What it costs", heads, lines)]


def plot(result: dict, path: Path) -> Path:
    """Draws the torque ripple over the shortest pulse."""
    from ...analysis import plots

    name, title, _ = FIGURES[0]
    rows = [row for row in result["rows"] if row["figures"]]
    speeds = list(dict.fromkeys(row["speed_rpm"] for row in rows))
    figure, axes = plots.new_figure(1, len(speeds), 3.6, 3.6 * len(speeds), sharey=True)
    for axis, rpm in zip(axes[0], speeds):
        for variant in dict.fromkeys(row["variant"] for row in rows):
            own = [r for r in rows if (r["variant"], r["speed_rpm"]) == (variant, rpm)]
            axis.plot([r["min_pulse_us"] for r in own], [r["figures"][name] for r in own],
                      "o-", ms=3, label=variant)  # fmt: skip
        axis.set_yscale("log")
        axis.set_xlabel("min_pulse_us", **plots.LABEL)
        axis.set_title(f"{rpm:.0f} r/min, {LOAD_NM:g} N m", **plots.TITLE)
    axes[0][0].set_ylabel(title, **plots.LABEL)
    axes[0][-1].legend(**plots.LEGEND)
    return plots.save(figure, path)
