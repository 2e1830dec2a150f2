"""A comparison of bench and simulation as text, JSON, pictures and a page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..analysis import overlay
from ..analysis.pages import write_page
from .fit import DIFFERS, SPEED, Comparison, Explanation
from .joint import Set
from .quantities import QUANTITIES, about

#: Rows of a picture: what differs comes first, then these.
USUAL = (SPEED, "shaft torque", "current along the flux", "R_s in use", "slip", "estimated torque")
MOST_ROWS = 6
#: So many explanations are told in words.
MOST_SHOWN = 4


def verdict(comparison: Comparison) -> list[str]:
    """The findings, a sentence each."""
    if not comparison.differs:
        return ["bench and simulation agree within the expected noise", *_hidden(comparison)]
    if comparison.rivals:
        return [*_alternatives(comparison), *_hidden(comparison)]
    if comparison.together:
        return [*_several(comparison, comparison.together), *_hidden(comparison)]
    cause = comparison.cause
    if cause is None:
        return ["bench and simulation differ, and no single parameter explains it"]
    said = [
        f"best explanation: {cause.candidate.name} {change(cause)}; it explains "
        f"{100 * (1 - cause.left):.0f} % of the squared difference"
    ]
    if cause.like:
        said.append(
            "in this recording this cannot be told apart from: "
            + ", ".join(f"{other} ({found:+.2f})" for other, found in cause.like.items())
        )
    if comparison.unexplained:
        said.append(UNEXPLAINED)
    return [*said, *_hidden(comparison)]


UNEXPLAINED = (
    "the remaining difference exceeds the noise: another parameter is wrong, or something that is "
    "no parameter"
)


def _alternatives(comparison: Comparison) -> list[str]:
    """The explanations that this recording does not tell apart, and what would."""
    cause = comparison.cause
    sets = [comparison.together] if comparison.together else []
    texts = [f"{cause.candidate.name} {change(cause)}"] if cause else []
    texts += [
        " and ".join(
            f"{c.name} {c.shown(x)} ± {c.shown(deviation, sign=False)}"
            for c, x, deviation in zip(one.candidates, one.changes, one.deviations)
        )
        for one in (*sets, *comparison.rivals)
    ]
    more = len(texts) - MOST_SHOWN
    said = [
        "this recording does not tell apart: "
        + "; or ".join(texts[:MOST_SHOWN])
        + (f"; or {more} others (--json)" if more > 0 else "")
    ]
    if comparison.sure:
        said.append(f"off in any case: {', '.join(sorted(comparison.sure))}")
    course, apart = comparison.further or ("", 0.0)
    if course:
        said.append(
            f"compare it together with a recording {course}: the most similar two would differ "
            f"there by {apart:.0f} standard deviations"
        )
    else:
        said.append("no recording that was tried tells them apart: measure one of them by itself")
    return said + ([UNEXPLAINED] if comparison.unexplained else [])


def _several(comparison: Comparison, found: Set) -> list[str]:
    """The differences that several parameters explain together, and the doubts about them."""
    residual = comparison.residual
    left = found.squared / float(residual @ residual)
    parts = [
        f"{c.name} {c.shown(change)} ± {c.shown(deviation, sign=False)}"
        for c, change, deviation in zip(found.candidates, found.changes, found.deviations)
    ]
    alone = comparison.explanations[0]
    said = [
        f"more than one parameter is off; best explanation: {' and '.join(parts)}; together they "
        f"explain {100 * (1 - left):.1f} % of the squared difference, {alone.candidate.name} "
        f"alone {100 * (1 - alone.left):.1f} %"
    ]
    for one, other, correlation in found.bound_together:
        said.append(
            f"{one} and {other} are known better together than alone: their errors have a "
            f"correlation of {correlation:+.2f}"
        )
    for name, like in found.like.items():
        others = ", ".join(f"{other} ({value:+.2f})" for other, value in like.items())
        said.append(f"in this recording, in the place of {name} could stand: {others}")
    if comparison.unexplained:
        said.append(UNEXPLAINED)
    return said


def _hidden(comparison: Comparison) -> list[str]:
    hidden = comparison.hidden
    return [f"not to be seen in this recording: {', '.join(hidden)}"] if hidden else []


def change(one: Explanation) -> str:
    unit = one.candidate
    if not np.isfinite(one.deviation):
        return unit.shown(one.change)
    return f"{unit.shown(one.change)} ± {unit.shown(one.deviation, sign=False)}"


def quantity_rows(comparison: Comparison) -> list[list[str]]:
    model = comparison.setup["machine.model"]
    return [
        [
            d.name, QUANTITIES[d.name].unit, f"{d.size:.4g}", f"{d.rms:.3g}", f"{d.noise:.3g}",
            f"{d.ratio:.1f}", "differs" if d.differs else "agrees", about(d.name, model) or "",
        ]
        for d in comparison.differences
    ]  # fmt: skip


QUANTITY_HEADINGS = ("quantity", "unit", "rms", "rms difference", "expected noise", "times noise",
                     "verdict", "tells of")  # fmt: skip
PARAMETER_HEADINGS = ("parameter", "change", "remains", "seen from")


def parameter_rows(comparison: Comparison) -> list[list[str]]:
    rows = []
    for one in comparison.explanations:
        unseen = one.candidate.name in comparison.hidden
        rows.append(
            [
                one.candidate.name,
                "–" if unseen else change(one),
                "–" if unseen else f"{100 * one.left:.0f} %",
                "–" if unseen else one.candidate.shown(one.seen_from, sign=False),
            ]
        )
    return rows


def as_json(comparison: Comparison) -> dict:
    cause = comparison.cause
    return {
        "setup": comparison.setup.name,
        "recordings": [
            {"file": b.label, "begin_s": b.begin_s, "duration_s": b.duration_s,
             "from_start": b.begins, "notes": b.notes}
            for b in comparison.benches
        ],
        "notes": comparison.notes,
        "differs": comparison.differs,
        "limit": DIFFERS,
        "quantities": [one.as_json() for one in comparison.differences],
        "cause": cause.candidate.name if cause and not comparison.rivals else None,
        "sure": sorted(comparison.sure),
        "rivals": [one.as_json(comparison.residual) for one in comparison.rivals],
        "together": comparison.together and comparison.together.as_json(comparison.residual),
        "parameters": [one.as_json() for one in comparison.explanations],
        "said": verdict(comparison),
    }  # fmt: skip


def write(comparison: Comparison, folder: Path, command: str) -> tuple[list[Path], Path]:
    """A picture for each recording, and the page; into an existing folder."""
    pictures = []
    for n, one in enumerate(comparison.overlays, 1):
        traces = [overlay.Trace("bench", one.bench), overlay.Trace("simulation", one.simulation)]
        differ = [d.name for d in comparison.differences if d.differs]
        names = list(dict.fromkeys([*differ, *USUAL]))
        names = [name for name in names if name in one.bench][:MOST_ROWS]
        pictures.append(overlay.plot(traces, names, "none", folder / f"overlay-{n}.png"))
    labels = [bench.label for bench in comparison.benches]
    page = write_page(
        folder / "report.html",
        "twin.html",
        title=f"{comparison.setup.name}: bench beside simulation",
        differs=comparison.differs,
        said=verdict(comparison),
        notes=[f"{b.label}: {note}" for b in comparison.benches for note in b.notes]
        + comparison.notes,
        quantity_headings=QUANTITY_HEADINGS,
        quantities=quantity_rows(comparison),
        parameter_headings=PARAMETER_HEADINGS,
        parameters=parameter_rows(comparison),
        pictures=[(label, path.name) for label, path in zip(labels, pictures)],
        command=command,
    )
    return pictures, page
