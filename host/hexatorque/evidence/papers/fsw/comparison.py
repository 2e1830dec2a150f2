"""Best settings within a switching frequency, and the verdicts on the modulated law."""

from __future__ import annotations

import math
from itertools import product as pairs
from pathlib import Path

import numpy as np

from .... import setups
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, claim, not_printed
from ..engine.job import Job
from . import pictures
from .judging import TARGETS, At
from .points import PLACES, QUICK, Place
from .search import JUDGED, LIMITS_HZ, OURS, SLOW_HZ, best, variants
from .sweep import held, settings

COLUMNS = (
    ("f_isr_Hz", "Hz"),
    ("f_sw_Hz", "Hz"),
    ("td_Nm", "N m"),
    ("thd_inf_pct", "%"),
    ("ixy_rms_A", "A"),
    ("loss_W", "W"),
    ("idc_ripple_A", "A"),
)
WORDS = {
    "td_Nm": "Td",
    "thd_inf_pct": "THD∞",
    "ixy_rms_A": "x–y rms",
    "loss_W": "loss",
}


def _json(at: At) -> dict:
    line = {f"{hz:g}": at.line(hz) for hz in LIMITS_HZ}
    tables = {figure: at.best_table(figure) for figure in JUDGED}
    return {
        "point": at.place.name,
        "setup": at.place.setup,
        "speed_rpm": at.place.speed_rpm,
        "torque_Nm": at.place.torque_Nm,
        "line": {hz: vars(r) if r else None for hz, r in line.items()},
        "best": {
            name: {f: {f"{hz:g}": best(rows, f, hz) for hz in LIMITS_HZ} for f in JUDGED}
            for name, rows in at.rows.items()
        },
        "best_table": {f: {"scheme": t[0], **t[1]} if t else None for f, t in tables.items()},
        "ours": {target.variant: at.ratios(target) for target in TARGETS},
        "ratio": {figure: at.ratio(figure) for figure in JUDGED},
    }


def geometric_mean(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))


def _summary(values: list[float], most: float) -> str:
    within = sum(value <= most for value in values)
    return (
        f"{within} of {len(values)} points, geometric mean {geometric_mean(values):.2f}, "
        f"worst {max(values):.2f}"
    )


def _verdicts(points: list[At]) -> list[Verdict]:
    found = []
    for target in TARGETS:
        rows = [(at.place.name, row) for at in points if (row := at.ratios(target))]
        sampled = f", table schemes sampled at {SLOW_HZ / 1e3:g} kHz at most"
        for key, most in (("td", target.td), ("thd", target.thd)):
            over = [
                f"{name}: {row[f'{key}_ratio']:.2f} × {row[f'{key}_against']}"
                for name, row in rows
                if row[f"{key}_ratio"] > most
            ]
            missing = [at.place.name for at in points if not at.ratios(target)]
            over += [f"{name}: no setting within the limit" for name in missing]
            word = {"td": "Td", "thd": "THD∞"}[key]
            values = [row[f"{key}_ratio"] for _, row in rows]
            found.append(
                claim(
                    f"{target.variant}: {word} over the best table setting, f_sw ≤ 3 kHz"
                    + (sampled if target.sampled_Hz < 1e9 else ""),
                    not over,
                    _summary(values, most) if values else "no point",
                    f"≤ {most:g} at every point (our target)",
                    why="Missed at " + "; ".join(over) if over else "",
                )
            )
    for figure in JUDGED:
        values = [ratio for at in points if (ratio := at.ratio(figure))]
        if values:
            lost = [at.place.name for at in points if (at.ratio(figure) or 0) > 1]
            what = f"{OURS}, best of all its settings: {WORDS[figure]} over the best table setting"
            why = "Ours loses at " + "; ".join(lost) if lost else ""
            found.append(not_printed(what, _summary(values, 1.0), why=why))
    return found


def as_recording(
    points: dict[str, dict[str, list[dict]]], kind: str, names: list[str]
) -> Recording:
    """One row per setting: point -> name -> settings. kind: what the names are, in the singular."""
    rows = [
        (number, names.index(name), *(row[column] for column, _ in COLUMNS))
        for number, own in enumerate(points.values())
        for name, settings in own.items()
        for row in settings
    ]
    data = np.array(rows, float).reshape(-1, len(COLUMNS) + 2)
    channels = {"point": data[:, 0], kind: data[:, 1]}
    channels |= {column: data[:, n + 2] for n, (column, _) in enumerate(COLUMNS)}
    meta = {
        "rows": "one per setting with which the drive holds its point",
        "points": list(points),
        f"{kind}s": names,
    }
    return Recording(1.0, channels, {"point": "", kind: "", **dict(COLUMNS)}, meta)


def measured(job: Job) -> list[At]:
    places = QUICK if job.quick else PLACES
    tasks = list(pairs(places, variants()))
    rows = job.each(lambda task: held(settings(job, *task)), tasks)
    by_place: dict[Place, dict[str, list[dict]]] = {place: {} for place in places}
    for (place, variant), found in zip(tasks, rows):
        by_place[place][variant.name] = found
    return [At(place, found) for place, found in by_place.items()]


def fsw(job: Job) -> Figure:
    """Torque ripple, distortion, x-y current and losses of every scheme over switching
    frequency."""
    points = measured(job)

    def draw(path: Path) -> Path:
        return pictures.draw(points, path)

    most = max(variant.extent.settings for variant in variants())
    return Figure(
        metrics={"points": [_json(at) for at in points]},
        verdicts=_verdicts(points),
        draw=draw,
        recordings={
            "": as_recording(
                {at.place.name: at.rows for at in points},
                "variant",
                [variant.name for variant in variants()],
            )
        },
        setups=[setups.load(name) for name in sorted({place.setup for place in PLACES})],
        caption=f"Each dot is a setting of sampling frequency and bands, {most} for each scheme at "
        "each point. The staircase shows the best setting within a switching frequency. The dashed "
        "line is carrier modulation with double zero-sequence injection, computed.",
    )
