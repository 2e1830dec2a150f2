"""How fast db-dtfc answers, beside DTC1, DTC3 and DDR: torque steps, speed reversal, load step and
a sag of the dc link.

Torque steps: the drive follows a torque reference that goes back and forth around the load, so that
the speed stays. The rise is from 10 to 90 % of the step, in the true torque. The other tests
are made in speed mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.response import moving_mean, step_response
from ...drive.operating_points import NOT_MEASURED, Point, Progress, approach, follow
from ...parallel import each
from ...plant.vsd import PHASES
from ...recording.recording import Recording
from .grids import Grid, for_terminal
from .robustness import VARIANTS, Variant

TITLE = "Dynamics: torque steps, reversal, load step, sag of the dc link"
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
#: Steps each way, and the time between them. It is no multiple of the speed loop's period, and the
#: flux stands elsewhere at each step.
STEPS, APART_S = 10, 0.023
#: A response is looked for from this time before the change of the recorded reference, and until
#: this time after it.
BEFORE_S, AFTER_S = 0.0003, 0.005
STEP_AT_S = 0.1
SAG_SHARE, SAG_S = 0.75, 0.2
#: Means of the speed are taken over this time; it has settled within this share of the reference.
MEAN_S, SETTLED = 0.01, 0.01
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


def rise(
    time_s: np.ndarray, torque_Nm: np.ndarray, before: float, after: float
) -> tuple[float, float]:
    """Time from 10 to 90 % of a step, and the overshoot as a share of it. NaN if the torque does
    not come to 90 %."""
    y = (torque_Nm - before) / (after - before)
    arrived = np.nonzero(y >= 0.9)[0]
    if arrived.size == 0 or arrived[0] == 0:
        return float("nan"), float("nan")

    def crossing(n: int, level: float) -> float:
        share = (level - y[n - 1]) / (y[n] - y[n - 1])
        return float(time_s[n - 1] + share * (time_s[n] - time_s[n - 1]))

    end = int(arrived[0])
    low = np.nonzero(y[:end] < 0.1)[0]
    if low.size == 0:
        return float("nan"), float("nan")
    return crossing(end, 0.9) - crossing(int(low[-1]) + 1, 0.1), float(max(0.0, y.max() - 1))


def rises(rec: Recording) -> dict[str, float]:
    """Means over the steps of the torque reference, up and down. A step is from the measured mean
    before it to the measured mean after it: the torque of a table scheme does not keep exactly to
    its reference."""
    reference = np.asarray(rec["torque_ref_Nm"], dtype=float)
    torque_Nm = np.asarray(rec["plant.torque_Nm"], dtype=float)
    found: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for n in np.nonzero(np.diff(reference))[0]:
        since = rec.time_s - rec.time_s[n]
        part = (since > -BEFORE_S) & (since < AFTER_S)
        before = torque_Nm[(since > -AFTER_S) & (since < -BEFORE_S)].mean()
        after = torque_Nm[(since > AFTER_S) & (since < 3 * AFTER_S)].mean()
        made = rise(rec.time_s[part], torque_Nm[part], before, after)
        found[bool(reference[n + 1] > reference[n])].append(made)
    up, down = (np.array(found[way]).mean(axis=0) for way in (True, False))
    return {
        "rise_up_ms": 1e3 * float(up[0]),
        "rise_down_ms": 1e3 * float(down[0]),
        "overshoot_pct": 100 * float(max(up[1], down[1])),
    }


def torque_steps(
    variant: Variant, name: str, speed: float, low: float, high: float, progress: Progress | None
) -> dict[str, float]:
    """The load is the mean of both torques."""
    setup = variant.setup(name, load__kind="constant")
    sim = approach(Point(setup, speed, (low + high) / 2), progress)
    sim.set_many({"control_mode": "torque", "torque_ref_Nm": low})
    sim.run(APART_S / 2, record=False)
    levels = (high, low) * STEPS
    events = [(n * APART_S, "torque_ref_Nm", level) for n, level in enumerate(levels)]
    return rises(follow(sim, events, len(levels) * APART_S, progress))


def speed_response(rec: Recording, target: float) -> dict[str, float]:
    speed = moving_mean(rec["plant.speed_rpm"], rec.rate_Hz, MEAN_S)
    found = step_response(rec.time_s, speed, STEP_AT_S, target, SETTLED * abs(target))
    return {
        "settling_ms": 1e3 * found.settling_s,
        "overshoot_rpm": found.overshoot,
        "deviation_rpm": found.deviation,
        "peak_A": max(float(np.abs(rec[f"plant.i_{phase}_A"]).max()) for phase in PHASES),
    }


def reversal(
    variant: Variant, name: str, speed: float, load: float, progress: Progress | None
) -> dict[str, float]:
    setup = variant.setup(name, load__kind="constant")
    sim = approach(Point(setup, speed, 0.0), progress)
    return speed_response(
        follow(sim, [(STEP_AT_S, "speed_ref_rpm", -speed)], 2.5, progress), -speed
    )


def load_step(
    variant: Variant, name: str, speed: float, load: float, progress: Progress | None
) -> dict[str, float]:
    setup = variant.setup(name, load__kind="constant")
    sim = approach(Point(setup, speed, 0.0), progress)
    return speed_response(follow(sim, [(STEP_AT_S, "load_Nm", load)], 2.0, progress), speed)


def sag(
    variant: Variant, name: str, speed: float, load: float, progress: Progress | None
) -> dict[str, float]:
    setup = variant.setup(name, load__kind="constant")
    sim = approach(Point(setup, speed, load), progress)
    events = [(STEP_AT_S, "vdc_V", SAG_SHARE * sim.vdc_V), (STEP_AT_S + SAG_S, "vdc_V", sim.vdc_V)]
    return speed_response(follow(sim, events, 1.5, progress), speed)


TESTS = {"reversal": reversal, "load step": load_step, "sag": sag}


def _run(
    test: str, function: Callable[..., dict[str, float]], variant: Variant, *arguments: Any
) -> Row:
    figures: dict[str, float] = {}
    lost = ""
    try:
        figures = function(variant, *arguments)
    except NOT_MEASURED as reason:
        lost = str(reason)
    return Row(test, arguments[0], arguments[1], variant.label, figures, lost)


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    """Every test under every variant. quick: one torque step, one load step."""
    cases: list[tuple] = [
        (f"{low:g} ↔ {high:g} N m", torque_steps, v, name, speed, low, high, progress)
        for name, speed, low, high in (TORQUE_STEPS[-2:-1] if quick else TORQUE_STEPS)
        for v in VARIANTS
    ]
    cases += [
        (test, function, v, *rated, progress)
        for rated in (RATED[-1:] if quick else RATED)
        for test, function in TESTS.items()
        if not quick or test == "load step"
        for v in VARIANTS
    ]
    rows = each(lambda case: _run(*case), cases)
    return {"quick": quick, "rows": [asdict(row) for row in rows]}


def _by_test(result: dict) -> dict[tuple[str, str, float], dict[str, dict]]:
    tests: dict[tuple[str, str, float], dict[str, dict]] = {}
    for row in result["rows"]:
        tests.setdefault((row["test"], row["setup"], row["speed_rpm"]), {})[row["variant"]] = row
    return tests


def failures(result: dict) -> list[str]:
    """Where db-dtfc loses the drive, or its torque takes longer than allowed."""
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


def tables(result: dict) -> list:
    ((_, heads, lines),) = grid(result)
    note = (
        "torque steps: rise up · down · overshoot; reversal: settling · overshoot; "
        "load step and sag: deviation of the speed · largest phase current"
    )
    return for_terminal([(f"{TITLE}\n{note}", heads, lines)])


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
