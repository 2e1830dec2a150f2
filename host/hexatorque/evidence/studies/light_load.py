"""Paper A's claim at 400 r/min without load: does the x-y regulator help there, and on which option
does this depend?

Switching-table control is chaotic in detail, so every case runs at several neighbouring loads. Two
values that differ by less than the spread do not differ.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from ... import setups
from ...experiments.operating_points import Point, Progress, measure_all
from .grids import Grid

TITLE = "Light load: fdr against ddr at 400 r/min"
SETUP = "paper-a-feasible"
SPEED_RPM = 400.0
LOADS_NM = (0.03, 0.05, 0.07, 0.09)
LATENCIES = ("none", "shadow", "predicted")
BANDS_NM = (0.25, 0.5, 1.0)
#: Scheme and whether the x-y integrators hold during zero vectors.
VARIANTS = (("fdr", "on"), ("ddr", "on"), ("ddr", "off"))
FLUX_HOLDS = (0.0, 0.02)
#: x-y gain and inductance: the loop gain is kp Vdc Ts / L_xy.
GAINS_PU_A = (0.1, 0.3)
LXY_H = (10e-3, 4.5e-3)
FIGURES = ("THD 5 kHz", "THD h≤50", "5th", "i_xy rms", "ΔI")


def _figures(metrics: dict) -> list[float]:
    return [
        metrics["thd_pct"]["5kHz"],
        metrics["thd_pct"]["h50"],
        metrics["h5_pct"],
        metrics["ixy_rms_A"],
        metrics["delta_i_A"],
    ]


def _rows(cases: list[dict], progress: Progress | None) -> list[dict]:
    """The mean and the spread (maximum - minimum over the loads) of each figure in each case."""
    base = setups.load(SETUP)
    points = [
        Point(base.changed(**case["values"]), SPEED_RPM, load)
        for case in cases
        for load in LOADS_NM
    ]
    runs = iter(measure_all(points, progress))
    rows = []
    for case in cases:
        found = [next(runs) for _ in LOADS_NM]
        figures = []
        for run in found:
            if isinstance(run, Exception):
                raise run
            figures.append(_figures(run.metrics))
        values = np.array(figures)
        rows.append(
            {
                **case["name"],
                "mean": dict(zip(FIGURES, values.mean(axis=0).tolist())),
                "spread": dict(zip(FIGURES, np.ptp(values, axis=0).tolist())),
            }
        )
    return rows


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    latencies = ("predicted",) if quick else LATENCIES
    bands = (0.5,) if quick else BANDS_NM
    options = [
        {
            "name": {"scheme": s, "hold": h, "latency": lat, "band_Nm": band, "flux_hold": fh},
            "values": {
                "controller__scheme": s,
                "controller__zero_hold": h,
                "timing__latency": lat,
                "controller__torque_band_Nm": band,
                "controller__torque_inner_Nm": 0.577 * band,
                "controller__flux_hold": fh,
            },
        }
        for lat, band, fh, (s, h) in itertools.product(latencies, bands, FLUX_HOLDS, VARIANTS)
    ]
    regulators = [("fdr", GAINS_PU_A[0]), *(("ddr", gain) for gain in GAINS_PU_A)]
    gains = [
        {
            "name": {"scheme": s, "kp_pu_A": kp, "lxy_H": lxy},
            "values": {
                "controller__scheme": s,
                "controller__kp_xy_pu_A": kp,
                "machine__lxy_H": lxy,
            },
        }
        for lxy, (s, kp) in itertools.product(LXY_H, regulators)
    ]
    return {
        "setup": SETUP,
        "speed_rpm": SPEED_RPM,
        "loads_Nm": list(LOADS_NM),
        "options": _rows(options, progress),
        "gains": _rows(gains, progress),
    }


def _variant(row: dict) -> str:
    return row["scheme"] + (", hold off" if row.get("hold") == "off" else "")


def _cells(row: dict) -> list[str]:
    return [
        f"{row['mean'][f]:.3f} ± {row['spread'][f] / 2:.3f}"
        if f in ("i_xy rms", "ΔI")
        else f"{row['mean'][f]:.1f} ± {row['spread'][f] / 2:.1f}"
        for f in FIGURES
    ]


def failures(result: dict) -> list[str]:
    """This study has no limits, so nothing can fail."""
    return []


NOTE = f"{SETUP}, {SPEED_RPM:g} r/min, mean and half spread over {len(LOADS_NM)} loads near 0"
#: Part of the result -> what differs in it.
VARIED = {"options": ("latency", "band_Nm", "flux_hold"), "gains": ("kp_pu_A", "lxy_H")}


def grid(result: dict) -> Grid:
    figures = [f"{name} [{unit}]" for name, unit in zip(FIGURES, ("%", "%", "%", "A", "A"))]
    return [
        (
            part,
            ["scheme", *(key.replace("_", "\n") for key in keys), *figures],
            [
                [_variant(row), *(str(row[key]) for key in keys), *_cells(row)]
                for row in result[part]
            ],
        )
        for part, keys in VARIED.items()
    ]


def plot(result: dict, path: Path) -> Path:
    """Draws fdr, ddr with hold and ddr without hold, by latency and band."""
    from ...analysis import plots

    figure, axes = plots.new_figure(1, len(FIGURES), 5.4, 13.0, sharey=True)
    rows = [r for r in result["options"] if r["flux_hold"] == FLUX_HOLDS[-1]]
    places = list(dict.fromkeys((r["latency"], r["band_Nm"]) for r in rows))
    colours = {
        ("fdr", "on"): plots.COLOUR["torque"],
        ("ddr", "on"): plots.COLOUR["i_u1"],
        ("ddr", "off"): plots.COLOUR["i_x"],
    }
    for axis, name, unit in zip(axes[0], FIGURES, ("%", "%", "%", "A", "A")):
        for (scheme, hold), colour in colours.items():
            chosen = [r for r in rows if (r["scheme"], r["hold"]) == (scheme, hold)]
            shift = 0.22 * (list(colours).index((scheme, hold)) - 1)
            axis.errorbar(
                [r["mean"][name] for r in chosen],
                [places.index((r["latency"], r["band_Nm"])) + shift for r in chosen],
                xerr=[r["spread"][name] / 2 for r in chosen],
                fmt="o",
                ms=4,
                lw=1.2,
                color=colour,
                label="fdr" if scheme == "fdr" else f"ddr, hold {hold}",
            )
        axis.set_title(name, **plots.TITLE)
        axis.set_xlabel(f"[{unit}]", **plots.LABEL)
        axis.set_xlim(left=0)
    labels = [f"{latency}, {band:g} N m" for latency, band in places]
    axes[0][0].set_yticks(range(len(places)), labels, fontsize=8)
    axes[0][0].set_ylabel("latency, torque half band", **plots.LABEL)
    axes[0][0].invert_yaxis()
    handles, names = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, **plots.LEGEND)
    loads = f"mean and spread over {len(LOADS_NM)} loads near 0"
    figure.suptitle(f"{TITLE}, {loads}", **plots.TITLE)
    return plots.save(figure, path)
