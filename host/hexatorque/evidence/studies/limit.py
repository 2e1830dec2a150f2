"""The limit of all pulse patterns (`evidence.methods.limit`) at operating points, beside carrier
modulation, and what every method reaches there."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...experiments.operating_points import Progress
from ...setups import Setup
from ..methods import carrier, limit
from ..methods.judging import At
from ..methods.methods import OURS, methods
from ..methods.places import PLACES, Place, label
from ..methods.references import JUDGED, LOOK, SEARCH
from ..methods.search import each_at_each
from ..papers.engine.job import Job
from .grids import Grid

TITLE = "The least torque ripple and distortion that any pulse pattern can have"
#: Carrier modulation: name, and what `carrier.ripple` takes besides.
CARRIERS: dict[str, dict] = {
    "carrier, centred": {},
    "carrier, turned": {"turned": True},
    "carrier, clamped": {"turned": True, "clamped": 1.0},
    "carrier, alternating": {"turned": True, "clamped": 1.0, "alternating": True},
}
#: How far a pattern of a known kind may be below the least one that was found: the mean over the
#: angles of the voltage has fewer of them here.
CLOSE = 0.005
#: Name, how it is called.
FIGURES = (("td_Nm", "Td [N m]"), ("thd_inf_pct", "THD∞ [%]"), ("ixy_rms_A", "x–y rms [A]"))

#: Of the methods' fronts.
FRONTS = "fronts"


@dataclass(frozen=True)
class Given(Place):
    """A point of a set-up that is no built-in one, or has other values; `setup` tells them."""

    given: Setup | None = field(default=None, repr=False, compare=False)

    @property
    def base(self) -> Setup:
        assert self.given is not None
        return self.given


#: Title, set-up, point.
Where = tuple[str, Setup, Place]


def of_the_comparison() -> list[Where]:
    """The points at which all methods are compared."""
    return [(label(place), place.base, place) for place in PLACES]


def at_point(setup: Setup) -> Where:
    """The point of a set-up. Its load has the sign of the speed, unless it drives."""
    speed_rpm, load_Nm = setup["point.speed_rpm"], setup["point.load_Nm"]
    torque_Nm = math.copysign(1.0, speed_rpm) * load_Nm
    values = json.dumps(setup.summary(), sort_keys=True)
    place = Given(values, speed_rpm, torque_Nm, given=setup)
    return f"{setup.name}, {speed_rpm:g} r/min, {load_Nm:g} N m", setup, place


def pieces(points: Iterable[Where], quick: bool) -> int:
    """How often `study` tells."""
    return sum(limit.pieces(quick) for _ in points)


def study(
    points: Iterable[Where], f_sw_Hz: float, quick: bool = False, tell: limit.Tell = lambda: None
) -> dict:
    rows = []
    for title, setup, place in points:
        flux_Wb = setup.parameter("flux_ref_Wb")
        found = limit.front(setup, place, f_sw_Hz, flux_Wb, quick, tell)
        known = {}
        if setup["machine.displacement_deg"] == "30":
            known = {
                name: carrier.ripple(setup, place, f_sw_Hz, flux_Wb, **more)
                for name, more in CARRIERS.items()
            }
        rows.append(
            {
                "point": title, "setup": setup.name, "speed_rpm": place.speed_rpm,
                "torque_Nm": place.torque_Nm, "f_sw_Hz": f_sw_Hz,
                "limit": [{"weight": one.weight, **vars(one.ripple)} for one in found],
                "carrier": {name: vars(ripple) for name, ripple in known.items()},
            }
        )  # fmt: skip
    return {"quick": quick, "points": rows}


def can_have_methods(points: Iterable[Where]) -> None:
    """InputError for a winding of which carrier modulation is not computed."""
    for title, setup, _ in points:
        if (degrees := setup["machine.displacement_deg"]) != "30":
            raise InputError(
                f"{title}: --methods needs machine.displacement_deg = 30, not {degrees}"
            )


def reached(
    points: Iterable[Where], result: dict, folder: Path, progress: Progress | None = None
) -> dict[str, At]:
    """Title -> what every method reaches there, by the search of the comparison; its settings are
    kept in the folder. InputError for a point that no method holds."""
    points = list(points)
    places = [place for _, _, place in points]
    job = Job(result["quick"], folder, progress)
    found = each_at_each(job, SEARCH, places, methods())
    there = {}
    for (title, _, place), at in zip(points, result["points"]):
        if not any(found[place].values()):
            raise InputError(f"{title}: no method holds the point")
        # Both fall as 1/f_sw.
        ends = (("thd_inf_pct", at["limit"][0]), ("td_Nm", at["limit"][-1]))
        least = {key: one[key] * at["f_sw_Hz"] / 1e3 for key, one in ends}
        there[title] = At(place, found[place], least_at_1kHz=least)
    return there


def best(there: Mapping[str, At], f_sw_Hz: float) -> dict[str, dict[str, dict]]:
    """Title -> method -> figure -> its best setting within the switching frequency."""
    return {
        title: {
            name: {key: row for key in JUDGED if (row := at.within(name, key, f_sw_Hz))}
            for name in at.rows
        }
        for title, at in there.items()
    }


def marks(found: Mapping[str, Mapping[str, dict]]) -> dict[str, dict[str, tuple[float, float]]]:
    """The points of `best`, for `plot`."""
    return {
        title: {
            name: (of["thd_inf_pct"]["thd_inf_pct"], of["td_Nm"]["td_Nm"])
            for name, of in own.items()
            if of
        }
        for title, own in found.items()
    }


def draw_fronts(there: Mapping[str, At], path: Path) -> Path:
    """Every method over the switching frequency, and the limit."""
    from ..methods.pictures import fronts

    return fronts({f"{title}: {at.m_pu:.2f} V_dc": at for title, at in there.items()}, LOOK, path)


def failures(result: dict) -> list[str]:
    """Carrier modulation with less distortion than the least, or with less of both than a point of
    the limit."""
    return [
        f"{at['point']}: {name} is below the limit"
        for at in result["points"]
        for name, known in at["carrier"].items()
        if known["thd_inf_pct"] < (1 - CLOSE) * at["limit"][0]["thd_inf_pct"]
        or any(all(known[key] < (1 - CLOSE) * one[key] for key, _ in FIGURES[:2])
               for one in at["limit"])
    ]  # fmt: skip


def grid(result: dict) -> Grid:
    lines = [
        [at["point"], f"{at['limit'][0]['m_pu']:.2f}", name,
         *(f"{figures[key]:.3g}" for key, _ in FIGURES)]
        for at in result["points"]
        for name, figures in (
            *((f"limit, w = {one['weight']:g}", one) for one in at["limit"]),
            *at["carrier"].items(),
        )
    ]  # fmt: skip
    for title, own in result.get("methods", {}).items():
        m_pu = next(at["limit"][0]["m_pu"] for at in result["points"] if at["point"] == title)
        lines += [
            [title, f"{m_pu:.2f}", f"{name}, at its best",
             *(f"{of[key][key]:.3g}" if key in of else "–" for key, _ in FIGURES)]
            for name, of in own.items()
        ]  # fmt: skip
    heads = ["point", "V_dc", "pattern", *(title for _, title in FIGURES)]
    f_sw_kHz = result["points"][0]["f_sw_Hz"] / 1e3
    return [(f"At {f_sw_kHz:g} kHz, in inverse proportion to it", heads, lines)]


def plot(
    result: dict, path: Path, methods: Mapping[str, Mapping[str, tuple[float, float]]] | None = None
) -> Path:
    """The limit's front in the plane of both figures, at each point. methods: point -> method ->
    the least THD and the least Td that it reaches, for marks at the top and at the right."""
    from ...analysis import plots
    from ..methods.pictures import LAW_COLOURS, logarithmic, one_legend, style

    points = result["points"]
    methods = methods or marks(result.get("methods", {}))
    columns = min(len(points), 4)
    rows = -(-len(points) // columns)
    drawn, axes = plots.new_figure(rows, columns, 2.9 * rows + 0.9, 3.1 * columns)
    for axis in axes.flat[len(points) :]:
        axis.set_visible(False)
    for axis, at in zip(axes.flat, points):
        thd, td = (np.array([one[key] for one in at["limit"]]) for key in ("thd_inf_pct", "td_Nm"))
        # No pattern has less distortion than the first point, or less of both than another. A
        # mixture of patterns may be better than two points' mixture, so no line joins them.
        forbidden = {"step": "pre", "color": plots.FAINT}
        axis.fill_between([0, *thd], [1e6, 1e6, *td[1:]], 1e-9, **forbidden)
        axis.plot(thd, td, "o", color=plots.INK, markersize=4, label="limit of all patterns")
        shown = [*zip(thd, td)]
        for marker, (name, known) in zip("v^<>", at["carrier"].items()):
            one = known["thd_inf_pct"], known["td_Nm"]
            axis.plot(*one, marker, color=plots.INK, fillstyle="none", markersize=5, label=name)
            shown.append(one)
        for name, one in methods.get(at["point"], {}).items():
            marker = "P" if name.startswith(OURS) else "X" if name in LAW_COLOURS else "D"
            own = {"marker": marker, "color": style(name)["color"], "clip_on": False, "zorder": 3}
            axis.plot(one[0], 1.0, transform=axis.get_xaxis_transform(), label=name, ls="", **own)
            axis.plot(1.0, one[1], transform=axis.get_yaxis_transform(), **own)
            shown.append(one)
        logarithmic(axis, "x", "y")
        for set_ends, values in zip((axis.set_xlim, axis.set_ylim), zip(*shown)):
            set_ends(0.85 * min(values), 1.15 * max(values))
        axis.set_title(at["point"].replace(", ", "\n", 1), **plots.TITLE)
    for axis in axes[:, 0]:
        axis.set_ylabel("Td [N m]", **plots.LABEL)
    for axis in axes[-1]:
        axis.set_xlabel("THD∞ [%]", **plots.LABEL)
    one_legend(drawn, axes, 6)
    return plots.save(drawn, path)
