"""The speed of db-dtfc's answers, beside DTC1, DTC3 and DDR: torque steps, speed reversal, load
step and a sag of the dc link.

Torque steps: the drive follows a torque reference that goes back and forth around the load, so that
the speed stays. The rise is from 10 to 90 % of the step, in the true torque. The other tests
are made in speed mode.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...experiments.operating_points import Point, Progress, approach
from ..studies.grids import Grid
from ..studies.runs import each
from . import steps
from .search import outcome
from .variants import VARIANTS, Variant

TITLE = "Dynamics: torque steps, reversal, load step, sag of the dc link"
NOTE = (
    "torque steps: rise up · down · overshoot; reversal: settling · overshoot; "
    "load step and sag: deviation of the speed · largest phase current"
)
#: Set-up, speed in r/min, torque before and after in N m. Each step is made both ways.
TORQUE_STEPS = (
    ("paper-a-feasible", 100.0, 2.0, 10.0),
    ("paper-a-feasible", 900.0, -10.0, 10.0),
    ("paper-a-feasible", 1000.0, 2.0, 10.0),
    ("paper-b", 2500.0, -2.0, 2.0),
    ("paper-b", 3500.0, 0.5, 2.0),
)
#: Set-up, speed and rated load of the other tests.
RATED = (("paper-a-feasible", 900.0, 10.0), ("paper-b", 2500.0, 2.0))
#: Longest rise of db-dtfc relative to DTC1's.
RISE_LIMIT = 1.15


@dataclass(frozen=True)
class Row:
    """One test. `lost`: why it could not be measured, else empty."""

    test: str
    setup: str
    speed_rpm: float
    variant: str
    figures: dict[str, float]
    lost: str = ""


def torque_steps(
    variant: Variant, name: str, speed: float, low: float, high: float, progress: Progress | None
) -> dict[str, float]:
    """The load is the mean of both torques."""
    setup = variant.setup(name, load__kind="constant")
    sim = approach(Point(setup, speed, (low + high) / 2), progress)
    sim.set_many({"control_mode": "torque", "torque_ref_Nm": low})
    sim.run(steps.APART_S / 2, record=False)
    return steps.back_and_forth(sim, high, low, progress)


#: Test, variant, set-up, speed, and both torques; without a torque step the load is the second.
Case = tuple[str, Variant, str, float, float, float]
TESTS = {"reversal": steps.reversal, "load step": steps.load_step, "sag": steps.sag}


def _row(case: Case, progress: Progress) -> dict:
    test, variant, name, speed, low, high = case

    def figures() -> dict[str, float]:
        if test not in TESTS:
            return torque_steps(variant, name, speed, low, high, progress)
        at = Point(variant.setup(name, load__kind="constant"), speed, high)
        return TESTS[test](at, progress)

    return asdict(Row(test, name, speed, variant.label, *outcome(figures)))


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    """Every test under every variant. quick: one torque step, one load step. folder: of `runs`."""
    tests = [
        (f"{low:g} ↔ {high:g} N m", name, speed, low, high)
        for name, speed, low, high in (TORQUE_STEPS[-2:-1] if quick else TORQUE_STEPS)
    ]
    tests += [
        (test, name, speed, 0.0, load)
        for name, speed, load in (RATED[-1:] if quick else RATED)
        for test in TESTS
        if not quick or test == "load step"
    ]
    cases: list[Case] = [
        (test, v, name, speed, low, high)
        for test, name, speed, low, high in tests
        for v in VARIANTS
    ]
    return {"quick": quick, "rows": each(_row, cases, folder, progress)}


def _by_test(result: dict) -> dict[tuple[str, str, float], dict[str, dict]]:
    tests: dict[tuple[str, str, float], dict[str, dict]] = {}
    for row in result["rows"]:
        tests.setdefault((row["test"], row["setup"], row["speed_rpm"]), {})[row["variant"]] = row
    return tests


def failures(result: dict) -> list[str]:
    """Tests in which db-dtfc loses the drive, or its torque takes longer than allowed."""
    lines = []
    for (test, setup, speed), rows in _by_test(result).items():
        for variant in (v for v in VARIANTS if v.ours):
            row, where = rows[variant.label], f"{variant.label}, {setup}, {speed:g} r/min, {test}"
            if row["lost"]:
                lines.append(f"{where}: {row['lost']}")
            for key in ("rise_up_ms", "rise_down_ms"):
                base = rows["dtc1"]["figures"].get(key)
                own = row["figures"].get(key)
                if not base or not own or variant.f_isr_Hz != 10e3:
                    continue
                if not own <= RISE_LIMIT * base:
                    lines.append(f"{where}: {key} {own:.2f}, dtc1 {base:.2f}")
    return lines


def _cell(row: dict) -> str:
    f = row["figures"]
    if row["lost"]:
        return "lost"
    if "rise_up_ms" in f:
        return f"{f['rise_up_ms']:.2f} · {f['rise_down_ms']:.2f} ms · {f['overshoot_pct']:.0f} %"
    if row["test"] == "reversal":
        return f"{f['settling_ms']:.0f} ms · {f['overshoot_rpm']:.1f} r/min"
    return f"{f['deviation_rpm']:.1f} r/min · {f['peak_A']:.1f} A"


def grid(result: dict) -> Grid:
    """The only table: its name, its heads, and its rows."""
    labels = [v.label for v in VARIANTS]
    lines = [
        [f"{setup}, {speed:g} r/min: {test}", *(_cell(rows[label]) for label in labels)]
        for (test, setup, speed), rows in _by_test(result).items()
    ]
    return [("", ["test", *labels], lines)]


def plot(result: dict, path: Path) -> Path:
    """Draws the rise times of the torque steps, up and down."""
    from ...analysis import plots
    from ...analysis.schemes import STYLE

    tests = {k: rows for k, rows in _by_test(result).items() if "↔" in k[0]}
    figure, axes = plots.new_figure(1, 2, 4.5, sharey=True)
    names = [f"{setup}\n{speed:g} r/min, {test}" for test, setup, speed in tests]
    for axis, key, title in zip(axes[0], ("rise_up_ms", "rise_down_ms"), ("up", "down")):
        for variant in VARIANTS:
            white = {} if variant.f_isr_Hz == 10e3 else {"markerfacecolor": "white"}
            values = [r[variant.label]["figures"].get(key, np.nan) for r in tests.values()]
            axis.plot(values, range(len(values)), ls="none", ms=6, label=variant.label,
                      **STYLE[variant.scheme], **white)  # fmt: skip
        axis.set_title(f"torque {title}", **plots.TITLE)
        axis.set_xlabel("from 10 to 90 % [ms]", **plots.LABEL)
        axis.set_xlim(left=0)
    axes[0, 0].set_yticks(range(len(names)), names, fontsize=7.5)
    axes[0, 0].invert_yaxis()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), **plots.LEGEND)
    figure.suptitle("Rise of the torque", **plots.TITLE)
    return plots.save(figure, path)
