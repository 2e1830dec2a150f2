"""All schemes at equal average switching frequency. Neither paper makes this comparison. At equal
sampling frequency, a scheme that switches twice as often looks better than it is.

Every scheme is measured over a grid of sampling frequencies and comparator bands. It is then judged
by its best setting within the same limit of switching frequency.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from .... import firmware, setups
from ....analysis import plots
from ....analysis.run import SCHEMES
from ....analysis.schemes import STYLE
from ....drive.operating_points import Point
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, not_printed
from ..engine.job import Job

SETUPS = ("paper-a-feasible", "paper-b")
SAMPLING_HZ = (5e3, 10e3, 20e3)
#: Torque and flux bands relative to the set-up's.
SCALES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0)
QUICK = (SAMPLING_HZ[1:], (0.5, 1.0, 2.0))
BANDS = ("torque_band_Nm", "torque_inner_Nm", "flux_band_Wb")
#: Limits of switching frequency in the table.
BUDGETS_HZ = (2000.0, 3000.0, 4000.0)
COLUMNS = (
    ("f_isr_Hz", "Hz"),
    ("scale", ""),
    ("f_sw_Hz", "Hz"),
    ("torque_ripple_Nm", "N m"),
    ("thd_pct", "%"),
    ("ixy_rms_A", "A"),
)
#: What is compared: column -> axis label.
JUDGED = {"torque_ripple_Nm": "torque ripple, std [N m]", "thd_pct": "THD of $i_{u1}$, 5 kHz [%]"}
#: Of the picture.
LAST_KHZ = 8.0
TICKS = {
    "torque_ripple_Nm": (0.05, 0.1, 0.2, 0.5, 1, 2),
    "thd_pct": (5, 10, 20, 50, 100),
}


def _cloud(job: Job, name: str) -> dict[str, np.ndarray]:
    """Scheme -> (n, len(COLUMNS)), a row for every setting with which the drive holds its operating
    point."""
    setup = setups.load(name)
    sampling, scales = QUICK if job.quick else (SAMPLING_HZ, SCALES)
    grid = list(itertools.product(firmware.schemes(), sampling, scales))
    points = []
    for scheme, f_isr_Hz, scale in grid:
        bands = {f"controller__{band}": scale * setup.parameter(band) for band in BANDS}
        one = setup.with_scheme(scheme, controller__f_isr_Hz=f_isr_Hz, **bands)
        points.append(Point(one, setup["point.speed_rpm"], setup["point.load_Nm"]))
    rows: dict[str, list] = {scheme: [] for scheme in firmware.schemes()}
    for (scheme, f_isr_Hz, scale), values in zip(grid, job.metrics(points)):
        if values is not None:
            flat = {**values, "f_isr_Hz": f_isr_Hz, "scale": scale}
            flat["thd_pct"] = values["thd_pct"]["5kHz"]
            rows[scheme].append([flat[column] for column, _ in COLUMNS])
    return {scheme: np.array(data).reshape(-1, len(COLUMNS)) for scheme, data in rows.items()}


def _column(data: np.ndarray, name: str) -> np.ndarray:
    return data[:, [column for column, _ in COLUMNS].index(name)]


def _best(data: np.ndarray, judged: str, budget_Hz: float) -> dict | None:
    """The setting with the lowest `judged` whose switching frequency is within the budget."""
    within = data[_column(data, "f_sw_Hz") <= budget_Hz]
    if len(within) == 0:
        return None
    row = within[np.argmin(_column(within, judged))]
    return {column: float(value) for (column, _), value in zip(COLUMNS, row)}


def envelope(f_sw_Hz: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest value within each switching frequency: the corners of a falling staircase."""
    order = np.lexsort((values, f_sw_Hz))
    f, v = f_sw_Hz[order], np.minimum.accumulate(values[order])
    corner = np.concatenate(([True], v[1:] < v[:-1])) if len(v) else np.zeros(0, bool)
    return f[corner], v[corner]


def _verdicts(name: str, table: dict) -> list[Verdict]:
    found = []
    for judged, unit in (("torque_ripple_Nm", "N m"), ("thd_pct", "%")):
        for budget_Hz in BUDGETS_HZ:
            row = {s: best for s in table if (best := table[s][judged][f"{budget_Hz:g}"])}
            ranking = sorted(row, key=lambda scheme: row[scheme][judged])
            text = ", ".join(f"{scheme} {row[scheme][judged]:.3g}" for scheme in ranking)
            word = "ripple" if judged == "torque_ripple_Nm" else "THD 5 kHz"
            what = f"{name}: {word} [{unit}] within {budget_Hz / 1e3:g} kHz"
            found.append(not_printed(what, text))
    return found


def _as_recording(cloud: dict[str, np.ndarray]) -> Recording:
    rows = np.concatenate(list(cloud.values()))
    channels = {column: rows[:, i] for i, (column, _) in enumerate(COLUMNS)}
    index = firmware.schemes().index
    channels["scheme"] = np.array([index(s) for s, data in cloud.items() for _ in data])
    meta = {"rows": "one per setting", "schemes": list(firmware.schemes())}
    return Recording(1.0, channels, dict(COLUMNS), meta)


def _draw(clouds: dict[str, dict[str, np.ndarray]], path: Path) -> Path:
    figure, axes = plots.new_figure(len(clouds), 2, 3.4 * len(clouds))
    for row, (name, cloud) in zip(axes, clouds.items()):
        for axis, (judged, label) in zip(row, JUDGED.items()):
            for scheme, data in cloud.items():
                f_kHz, values = _column(data, "f_sw_Hz") / 1e3, _column(data, judged)
                colour = STYLE[scheme]["color"]
                axis.plot(f_kHz, values, ".", color=colour, alpha=0.35, markersize=4)
                f, v = envelope(f_kHz, values)
                if len(f):
                    axis.step(
                        np.append(f, LAST_KHZ),
                        np.append(v, v[-1]),
                        where="post",
                        color=colour,
                        # FDR's line is wider, because DDR's often covers it.
                        linewidth=3 if scheme == "fdr" else 1.4,
                        label=SCHEMES.get(scheme, scheme.upper()),
                    )
            axis.set_xlim(0, LAST_KHZ)
            axis.set_yscale("log")
            axis.set_yticks(TICKS[judged], [f"{tick:g}" for tick in TICKS[judged]])
            axis.minorticks_off()
            axis.set_ylabel(label, **plots.LABEL)
            axis.set_xlabel("switching frequency [kHz]", **plots.LABEL)
            axis.set_title(name, **plots.TITLE)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6, **plots.LEGEND)
    return plots.save(figure, path)


def fsw(job: Job) -> Figure:
    """Lowest torque ripple and lowest THD of each scheme within a switching frequency."""
    clouds = {name: _cloud(job, name) for name in SETUPS}
    metrics: dict = {}
    recordings, verdicts = {}, []
    for name, cloud in clouds.items():
        table = {
            scheme: {
                judged: {f"{hz:g}": _best(data, judged, hz) for hz in BUDGETS_HZ}
                for judged in JUDGED
            }
            for scheme, data in cloud.items()
        }
        metrics[name] = table
        verdicts += _verdicts(name, table)
        recordings[name] = _as_recording(cloud)
    return Figure(
        metrics=metrics,
        verdicts=verdicts,
        draw=lambda path: _draw(clouds, path),
        recordings=recordings,
        setups=[setups.load(name) for name in SETUPS],
        caption="Each point is a setting of sampling frequency (5 to 20 kHz) and comparator bands "
        "(0.25 to 4 times the set-up's) at the set-up's operating point. The staircase "
        "shows the best setting within a switching frequency.",
    )
