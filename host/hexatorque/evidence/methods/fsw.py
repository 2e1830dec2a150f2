"""All the firmware's schemes at equal switching frequency on the papers' machines: best settings,
and the verdicts on the modulated law."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ... import setups
from ...analysis import plots
from ..papers.engine.figure import Figure, Verdict, claim, not_printed
from ..papers.engine.job import Job
from .judging import At, as_recording, geometric_mean
from .methods import OURS, variants
from .pictures import Look, fronts
from .places import QUICK, TWENTY, A, B
from .search import ANY_HZ, Search, best, each_at_each

#: Limits of switching frequency; the verdicts' limit; what is judged within them.
LIMITS_HZ = (2000.0, 3000.0, 4000.0)
LIMIT_HZ = 3000.0
WORDS = {
    "td_Nm": "Td",
    "thd_inf_pct": "THD∞",
    "ixy_rms_A": "x–y rms",
    "loss_W": "loss",
}
#: A table scheme that is sampled very fast is a comparator: one target leaves that out.
SLOW_HZ = 20e3
#: The verdicts' limit first. The flux is there within 0.15 s on both machines.
SEARCH = Search(
    "fsw",
    14,
    tuple(
        (figure, limit_Hz, sampled_Hz)
        for limit_Hz in (3e3, 2e3, 4e3)
        for figure in WORDS
        for sampled_Hz in ((ANY_HZ, SLOW_HZ) if limit_Hz == LIMIT_HZ else (ANY_HZ,))
    ),
    build_s=0.15,
)
#: Points of the short picture: low, medium and high voltage, and another machine.
SHOWN = ((A, 100, 10), (A, 900, 10), (B, 2500, 2), (B, 3500, 2))
LOOK = Look(0.0, 6.0, True, 2.1, 0.8, 12.0, 5)


@dataclass(frozen=True)
class Target:
    """Ours over the best table setting: Td and THD∞ at most these. The table schemes are sampled at
    sampled_Hz at most."""

    variant: str
    td: float
    thd: float
    sampled_Hz: float

    @property
    def sampled(self) -> str:
        most = f"{self.sampled_Hz / 1e3:g} kHz"
        return most if self.sampled_Hz < ANY_HZ else ""


TARGETS = (
    Target(f"{OURS} κ=0", 0.8, 0.5, ANY_HZ),
    Target(f"{OURS} κ=1", 0.7, 1.0, SLOW_HZ),
)


def best_table(at: At, figure: str, sampled_Hz: float = ANY_HZ) -> tuple[str, dict] | None:
    """The table scheme whose best setting within LIMIT_HZ is the lowest, and that setting."""
    found = [
        (name, row)
        for name in at.rows
        if not name.startswith(OURS) and (row := at.within(name, figure, LIMIT_HZ, sampled_Hz))
    ]
    return min(found, key=lambda pair: pair[1][figure], default=None)


def ratios(at: At, target: Target) -> dict | None:
    """The one setting of ours that comes nearest to both targets, and its ratios to the best
    table settings, which may be another one for each figure. None without such settings."""
    td = best_table(at, "td_Nm", target.sampled_Hz)
    thd = best_table(at, "thd_inf_pct", target.sampled_Hz)
    mine = [row for row in at.rows[target.variant] if row["f_sw_Hz"] <= LIMIT_HZ]
    if not (td and thd and mine):
        return None

    def of(row: dict) -> tuple[float, float]:
        return row["td_Nm"] / td[1]["td_Nm"], row["thd_inf_pct"] / thd[1]["thd_inf_pct"]

    row = min(mine, key=lambda row: max(of(row)[0] / target.td, of(row)[1] / target.thd))
    return {
        **row, "td_ratio": of(row)[0], "thd_ratio": of(row)[1],
        "td_against": td[0], "thd_against": thd[0],
    }  # fmt: skip


def ratio(at: At, figure: str) -> float | None:
    """Our best setting of any variant over the best table setting."""
    table = best_table(at, figure)
    ours = [row for name, rows in at.rows.items() if name.startswith(OURS) for row in rows]
    mine = best(ours, figure, LIMIT_HZ)
    return mine[figure] / table[1][figure] if mine and table else None


def _json(at: At) -> dict:
    tables = {figure: best_table(at, figure) for figure in WORDS}
    return {
        "point": at.place.name,
        "setup": at.place.setup,
        "speed_rpm": at.place.speed_rpm,
        "torque_Nm": at.place.torque_Nm,
        "line": {f"{hz:g}": vars(r) if (r := at.line(hz)) else None for hz in LIMITS_HZ},
        "best": at.limits(WORDS, LIMITS_HZ),
        "best_table": {f: {"scheme": t[0], **t[1]} if t else None for f, t in tables.items()},
        "ours": {target.variant: ratios(at, target) for target in TARGETS},
        "ratio": {figure: ratio(at, figure) for figure in WORDS},
    }


def _summary(values: list[float], most: float) -> str:
    within = sum(value <= most for value in values)
    return (
        f"{within} of {len(values)} points, geometric mean {geometric_mean(values):.2f}, "
        f"worst {max(values):.2f}"
    )


def _verdicts(points: list[At]) -> list[Verdict]:
    found = []
    for target in TARGETS:
        rows = [(at.place.name, row) for at in points if (row := ratios(at, target))]
        sampled = f", table schemes sampled at {target.sampled} at most" if target.sampled else ""
        for key, most in (("td", target.td), ("thd", target.thd)):
            over = [
                f"{name}: {row[f'{key}_ratio']:.2f} × {row[f'{key}_against']}"
                for name, row in rows
                if row[f"{key}_ratio"] > most
            ]
            missing = [at.place.name for at in points if not ratios(at, target)]
            over += [f"{name}: no setting within the limit" for name in missing]
            word = {"td": "Td", "thd": "THD∞"}[key]
            values = [row[f"{key}_ratio"] for _, row in rows]
            found.append(
                claim(
                    f"{target.variant}: {word} over the best table setting, f_sw ≤ 3 kHz{sampled}",
                    not over,
                    _summary(values, most) if values else "no point",
                    f"≤ {most:g} at every point (our target)",
                    why="Missed at " + "; ".join(over) if over else "",
                )
            )
    for figure, word in WORDS.items():
        values = [share for at in points if (share := ratio(at, figure))]
        if values:
            lost = [at.place.name for at in points if (ratio(at, figure) or 0) > 1]
            what = f"{OURS}, best of all its settings: {word} over the best table setting"
            why = "Ours loses at " + "; ".join(lost) if lost else ""
            found.append(not_printed(what, _summary(values, 1.0), why=why))
    return found


def measured(job: Job) -> list[At]:
    places = list(QUICK if job.quick else TWENTY)
    found = each_at_each(job, SEARCH, places, variants())
    return [At(place, rows, TARGETS[0].variant) for place, rows in found.items()]


def draw_ratios(points: list[At], path: Path) -> Path:
    """Ours over the best table setting at every point, and the targets."""
    drawn, axes = plots.new_figure(1, 2, 0.28 * len(points) + 1.4, 10.0, sharey=True)
    for axis, target in zip(axes[0], TARGETS):
        for key, most, marker, colour, word in (
            ("td_ratio", target.td, "o", "#0072b2", "Td"),
            ("thd_ratio", target.thd, "s", "#d55e00", "THD∞"),
        ):
            found = [(n, row[key]) for n, at in enumerate(points) if (row := ratios(at, target))]
            if found:
                y, x = zip(*found)
                axis.plot(x, y, marker, color=colour, markersize=5, label=word)
            axis.axvline(most, color=colour, linewidth=1, linestyle="--", label=f"target {most:g}")
        axis.axvline(1, color=plots.INK, linewidth=0.8)
        axis.set_xscale("log")
        ticks = (0.1, 0.2, 0.5, 1, 2)
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.minorticks_off()
        axis.set_xlabel("over the best table setting", **plots.LABEL)
        title = target.variant
        if target.sampled:
            title += f", table schemes sampled at ≤ {target.sampled}"
        axis.set_title(title, **plots.TITLE)
        axis.legend(**plots.LEGEND)
    axes[0, 0].set_yticks(range(len(points)), [at.place.name for at in points])
    axes[0, 0].invert_yaxis()
    return plots.save(drawn, path)


def draw(points: list[At], path: Path) -> Path:
    """The short picture at `path`; beside it all ratios, and all points of each machine if they are
    more than the short picture shows."""

    def page(own: list[At], to: Path) -> Path:
        return fronts({at.place.name: at for at in own}, LOOK, to)

    draw_ratios(points, path.with_stem(f"{path.stem}-ratios"))
    if len(points) > len(SHOWN):
        for letter, setup in (("A", A), ("B", B)):
            own = [at for at in points if at.place.setup == setup]
            page(own, path.with_stem(f"{path.stem}-{letter}"))
    shown = [
        at for at in points if (at.place.setup, at.place.speed_rpm, at.place.torque_Nm) in SHOWN
    ]
    return page(shown, path)


def fsw(job: Job) -> Figure:
    """Torque ripple, distortion, x-y current and losses of every scheme over switching
    frequency."""
    points = measured(job)
    most = max(variant.extent.settings for variant in variants())
    return Figure(
        metrics={"points": [_json(at) for at in points]},
        verdicts=_verdicts(points),
        draw=partial(draw, points),
        recordings={
            "": as_recording(
                {at.place.name: at.rows for at in points},
                "variant",
                [variant.name for variant in variants()],
            )
        },
        setups=[setups.load(name) for name in sorted({place.setup for place in TWENTY})],
        caption=f"Each dot is a setting of sampling frequency and bands, {most} for each scheme at "
        "each point. The staircase shows the best setting within a switching frequency. The dashed "
        "line is carrier modulation with double zero-sequence injection, computed.",
    )
