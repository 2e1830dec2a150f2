"""Estimates of a machine, and what they leave open about a scheme.

The rules of `review` are asked with the values of the set-up. Where one is an estimate, the true
one lies anywhere in its range. So the same rules are asked again with either end of the range, for
each estimate alone. The controller keeps its parameters then, which follow from the estimate: it
stands in front of another machine than the one that it was designed for.

A rule may also leave something open by itself: what trips only if all of it comes together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

from ..plant.heat import PER_K
from .design import Design
from .estimate import spread
from .finding import NOT_READY, Finding
from .keys import ESTIMATED, LXY_LEAST, LXY_SHARE, MEASURED
from .setup import Setup
from .values import Value

#: The findings of a scheme, always the same ones in the same order.
Rows = Callable[[Design], list[Finding]]
MEASURED_BY = "hexatorque board commission measures it"
#: A winding at 120 degC, over the 20 degC of a data sheet; magnets at the end of its tolerance.
WARM, WEAK = 1 + 100 * PER_K, 0.95
#: How near a threshold is told, as a factor.
THRESHOLD = 1.01


@dataclass(frozen=True)
class Estimate:
    """The first of these keys of [machine] is an estimate, and the others follow from it. low,
    high: the ends of its range over the estimate."""

    keys: tuple[str, ...]
    low: float
    high: float

    def design(self, d: Design, factor: float) -> Design:
        """The same controller and a machine with so many times the estimate."""
        setup = cast(Setup, d.setup)
        values = {key: Value(factor * setup[f"machine.{key}"], ESTIMATED) for key in self.keys}
        return Design(setup.with_part({"machine": values}), d.parameter)

    def says(self, d: Design, factor: float) -> str:
        """The value at this factor, as the file has it."""
        key = self.keys[0]
        return f"machine.{key} = {factor * d.setup[f'machine.{key}']:.3g}"

    def runs(self, d: Design, end: float, wrong_at: Callable[[Design], bool]) -> str:
        """From where on a scheme runs, of which this end and the estimate say different things."""
        good, wrong = (end, 1.0) if wrong_at(d) else (1.0, end)
        while max(good / wrong, wrong / good) > THRESHOLD:
            middle = math.sqrt(good * wrong)
            middle_wrong = wrong_at(self.design(d, middle))
            good, wrong = (good, middle) if middle_wrong else (middle, wrong)
        side = "and more" if good > wrong else "and less"
        return f"runs with {self.says(d, good)} {side}: {MEASURED_BY}"


def estimates(d: Design) -> Iterator[Estimate]:
    """The inductances that a voltage step meets, where they are estimates, the one that few others
    follow from first. The leakage has the range of the published machines. L_xy is a share of it,
    from LXY_LEAST to all of it, and as wrong as it: both errors are chance, so their logarithms add
    in squares. With magnets the inductances are told; but unless they were measured, the winding is
    as warm as a sheet's is cold, and the magnets are as weak as it allows."""
    if d.magnets:
        for key, low, high in (("rs_ohm", 1.0, WARM), ("psi_f_Wb", WEAK, 1.0)):
            if d.tag(key) != MEASURED:
                yield Estimate((key,), low, high)
        return
    leakages = tuple(key for key in ("lls_H", "llr_H") if d.tag(key) == ESTIMATED)
    of_share = d.tag("lxy_H") == ESTIMATED or _follows(d)
    factor = max(spread().factors["lls_H"].values()) if "lls_H" in leakages else 1.0
    share = ("lxy_H",) if of_share else ()
    if share:
        low, high = (_both(factor, of) for of in (LXY_SHARE / LXY_LEAST, 1 / LXY_SHARE))
        yield Estimate(share, 1 / low, high)
    if leakages:
        yield Estimate((*leakages, *share), 1 / factor, factor)


def _both(factor: float, other: float) -> float:
    return math.exp(math.hypot(math.log(factor), math.log(other)))


def _follows(d: Design) -> bool:
    """Whether L_xy is the usual share of the leakage because nobody has told it."""
    return not d.tag("lxy_H") and d.setup.defaults == "derived"


def judged(d: Design, rows: Rows) -> list[Finding]:
    """The findings. One that is wrong with the estimate, or at an end of its range, but not with
    both, is doubtful; that of the end then stands beside the other one. The first estimate that
    decides a finding is named. One that is bad, and at an end only doubtful, is doubtful too."""
    told = rows(d)
    found, doubts, decided = list(told), [], set()
    for of in estimates(d):
        for end in (of.low, of.high):
            for n, f in enumerate(rows(of.design(d, end))):
                if n in decided:
                    continue
                if _wrong(f) == _wrong(told[n]):
                    if f.verdict == "doubtful":
                        found[n] = replace(found[n], verdict="doubtful")
                    continue
                decided.add(n)
                runs = of.runs(d, end, partial(_wrong_at, n, rows))
                if _wrong(f):
                    doubts.append(_doubt(f, runs, of.says(d, end)))
                else:
                    found[n] = _doubt(told[n], runs)
    return [*found, *doubts]


def _wrong(f: Finding) -> bool:
    return f.verdict in NOT_READY


def _wrong_at(n: int, rows: Rows, d: Design) -> bool:
    return _wrong(rows(d)[n])


def _doubt(f: Finding, runs: str, where: str = "") -> Finding:
    advice = f"{runs}; else {f.advice}"
    return replace(f, verdict="doubtful", advice=advice, where=where, runs=runs)
