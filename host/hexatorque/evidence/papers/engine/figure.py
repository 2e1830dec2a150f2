"""A reproduced figure: numbers, recordings, a picture, and verdicts that compare our results with
the paper's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from ....recording.recording import Recording
from ....setups import USER, Setup

VERDICTS = ("match", "better", "worse", "differs", "not printed")
UNEXPLAINED = "not explained"


@dataclass(frozen=True)
class Verdict:
    """One quantity or statement of the paper, compared with our result.

    required: must not be "worse" or "differs"; `hexatorque evidence papers` fails otherwise.
    """

    what: str
    ours: float | str | None
    paper: float | str | None
    verdict: str
    why: str = ""
    unit: str = ""
    required: bool = False

    @property
    def broken(self) -> bool:
        return self.required and self.verdict in ("worse", "differs")


def beside(
    what: str,
    ours: float | None,
    paper: float,
    unit: str = "",
    *,
    within: float = 0.05,
    lower_is_better: bool | None = None,
    why: str = "",
    required: bool = False,
) -> Verdict:
    """Compare our number with a printed one: "match" if it differs by less than `within`, else
    "better" or "worse" where `lower_is_better` says which way is which, else "differs".
    `why` explains a difference."""
    if ours is None or not math.isfinite(ours):
        return Verdict(what, None, paper, "differs", why or UNEXPLAINED, unit, required)
    if abs(ours - paper) <= within * abs(paper):
        return Verdict(what, ours, paper, "match", "", unit, required)
    word = "differs"
    if lower_is_better is not None:
        word = "better" if (ours < paper) == lower_is_better else "worse"
    return Verdict(what, ours, paper, word, why or UNEXPLAINED, unit, required)


def claim(
    what: str,
    holds: bool,
    ours: float | str,
    paper: float | str,
    unit: str = "",
    *,
    why: str = "",
    required: bool = False,
) -> Verdict:
    """A statement of the paper, and our observation. `why` explains a difference."""
    if holds:
        return Verdict(what, ours, paper, "match", "", unit, required)
    return Verdict(what, ours, paper, "differs", why or UNEXPLAINED, unit, required)


def not_printed(what: str, ours: float | str, unit: str = "", why: str = "") -> Verdict:
    """One of our numbers for which the paper has no counterpart."""
    return Verdict(what, ours, None, "not printed", why, unit)


@dataclass
class Figure:
    """A reproduced figure or table.

    setups: every set-up that was run (empty if the figure runs no drive); recordings: name ->
    recording; draw: writes the picture to the given path; metrics and paper: anything that JSON can
    hold; caption: what the picture shows, and our choices.
    """

    metrics: dict
    verdicts: list[Verdict]
    draw: Callable[[Path], Path]
    recordings: dict[str, Recording]
    setups: list[Setup] = field(default_factory=list)
    paper: dict = field(default_factory=dict)
    caption: str = ""

    def as_json(self) -> dict:
        """All fields except identifier, recordings and picture."""
        setups: list[dict] = []
        for setup in self.setups:
            row = _setup_json(setup)
            if row not in setups:
                setups.append(row)
        by_name = {row["name"]: row["assumed"] for row in setups}
        notes = [_assumptions(name, values) for name, values in by_name.items() if values]
        return {
            "setup": setups,
            "metrics": self.metrics,
            "paper": self.paper,
            "verdicts": [asdict(v) for v in self.verdicts],
            "caption": " ".join([self.caption, *notes]).strip(),
        }


def _tagged(setup: Setup, tag: str) -> dict[str, object]:
    return {
        f"{section}.{key}": value.value
        for section, entries in setup.values.items()
        for key, value in entries.items()
        if value.tag == tag
    }


def _assumptions(name: str, values: dict) -> str:
    return f"Assumed in {name}, since not printed: {', '.join(values)}."


def _setup_json(setup: Setup) -> dict:
    """A set-up's name, its values that the paper does not print, and the values that the figure
    sets itself."""
    return {
        "name": setup.name,
        "assumed": _tagged(setup, "assumed"),
        "set": _tagged(setup, USER),
    }
