"""Several parameters at once that explain the difference between a bench and its simulation.

Least squares for every set of two and three parameters, from the effect of each alone, tell which
sets may explain it. The best of these are simulated with all their changes together, and corrected
(Gauss-Newton with Broyden's update of the effects). A set counts if each of its changes is more
than chance makes, and if it explains more than the best smaller one by more than chance.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..parallel import each
from .candidates import Candidate

#: Each parameter of a set has changed by more than so many standard deviations.
SURE = 5.0
#: So many sets of each size are simulated: of those that explain most by their effects alone, and
#: of those that have the best smaller set in them.
TRIED = 3
MOST = 3
#: Corrections of a set, each from a simulation with another noise. Those are averaged after whose
#: simulation this many times the least square remains.
STEPS, NEAR = 5, 1.3
#: A correction shows how the effects change on the way if its square is so many noise variances.
FAR = 10.0
#: Two parameters whose effects have at least this correlation cannot be told apart.
ALIKE = 0.9

Changes = Sequence[tuple[Candidate, float]]
#: The difference between a simulation with these changes and one without, in units of the expected
#: noise: of all quantities, and without those that only scatter; or why there is no simulation. The
#: number chooses the noise.
Simulate = Callable[[Changes, int], tuple[np.ndarray, np.ndarray] | str]


@dataclass
class Set:
    """Parameters with the changes that explain the difference best. deviations: standard ones of
    the changes if all may change; correlations: of their errors; squared: what remains; like: for
    each the parameters that would do in its place, with the correlation."""

    candidates: list[Candidate]
    changes: np.ndarray
    deviations: np.ndarray
    correlations: np.ndarray
    rest: np.ndarray
    effects: np.ndarray
    like: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def squared(self) -> float:
        return float(self.rest @ self.rest)

    @property
    def per_value(self) -> float:
        """The mean square of the remaining difference, in expected noises; at least 1."""
        return max(1.0, self.squared / len(self.rest))

    @property
    def sure(self) -> bool:
        """Whether each change is more than chance makes."""
        return bool(np.all(np.abs(self.changes) > SURE * self.deviations))

    @property
    def may_be(self) -> bool:
        """Whether another correction may make it sure."""
        return bool(np.all(np.abs(self.changes) > 0.5 * SURE * self.deviations))

    @property
    def bound_together(self) -> list[tuple[str, str, float]]:
        """The pairs of which only a combination is known well."""
        names = [one.name for one in self.candidates]
        return [
            (names[i], names[j], float(self.correlations[i, j]))
            for i, j in itertools.combinations(range(len(names)), 2)
            if abs(self.correlations[i, j]) >= ALIKE
        ]

    def as_json(self, residual: np.ndarray) -> dict:
        return {
            "parameters": [
                {
                    "parameter": c.name, "keys": list(c.keys),
                    "unit": "1" if c.unit == "%" else c.unit,
                    "change": float(x), "deviation": float(s), "like": self.like.get(c.name, {}),
                }
                for c, x, s in zip(self.candidates, self.changes, self.deviations)
            ],
            "correlations": self.correlations.tolist(),
            "remains": self.squared / float(residual @ residual),
        }  # fmt: skip


class Search:
    """effects: the change of the quantities with each parameter, per unit of it, in expected
    noises; scatter: what of its square is the scatter of the simulations; groups: where each
    quantity's values are."""

    def __init__(
        self,
        effects: dict[Candidate, np.ndarray],
        scatter: Callable[[np.ndarray, Candidate], float],
        residual: np.ndarray,
        groups: Sequence[slice],
        simulate: Simulate,
    ) -> None:
        self.scatter, self.residual, self.simulate = scatter, residual, simulate
        self.groups = groups
        self.effects = {
            c: effect for c, effect in effects.items() if effect @ effect > 2 * scatter(effect, c)
        }

    def best(self, first: Candidate) -> Set | None:
        """The smallest set that explains as much as the larger ones do, up to chance. None if not
        even the first parameter, which alone explains most, can be simulated."""
        found = self.fitted([first])
        while found and len(found.candidates) < MOST:
            tried = [one for one in each(self.fitted, self._larger(found)) if one and one.sure]
            larger = min(tried, key=lambda one: one.squared, default=found)
            if found.squared - larger.squared < SURE**2 * larger.per_value:
                break
            found = larger
        if found:
            self._alike(found)
        return found

    def _larger(self, smaller: Set) -> list[list[Candidate]]:
        """The sets with one parameter more that are worth a simulation."""
        count = len(smaller.candidates) + 1
        of_all = itertools.combinations(self.effects, count)
        ranked = sorted(
            of_all, key=lambda some: self._linear(self.residual, [self.effects[c] for c in some])
        )
        others = [c for c in self.effects if c not in smaller.candidates]
        # What remains of the smaller set, if all may change once more.
        ranked_on = sorted(
            others,
            key=lambda c: self._linear(smaller.rest, [*smaller.effects, self.effects[c]]),
        )
        sets = [list(some) for some in ranked[:TRIED]]
        sets += [[*smaller.candidates, c] for c in ranked_on[:TRIED]]
        return list({frozenset(c.name for c in some): some for some in sets}.values())

    @staticmethod
    def _linear(residual: np.ndarray, effects: Sequence[np.ndarray]) -> float:
        """The square of the residual without these effects."""
        matrix = np.array(effects)
        size = np.linalg.norm(matrix, axis=1, keepdims=True)
        matrix = matrix / size
        change = np.linalg.lstsq(matrix @ matrix.T, matrix @ residual, rcond=1e-6)[0]
        rest = residual - change @ matrix
        return float(rest @ rest)

    def _normal(self, some: Sequence[Candidate], effects: np.ndarray) -> np.ndarray:
        """The normal matrix without the scatter of the simulations, which has no direction."""
        square = effects @ effects.T
        less = np.array([self.scatter(e, c) for e, c in zip(effects, some)])
        return square - np.diag(np.minimum(less, 0.5 * np.diag(square)))

    def fitted(self, some: list[Candidate]) -> Set | None:
        """None if no simulation runs with such changes."""
        effects = np.array([self.effects[c] for c in some])
        low, high = (np.array([getattr(c, side) for c in some]) for side in ("low", "high"))
        unit = np.array([c.step for c in some])

        def step(rest: np.ndarray) -> np.ndarray:
            return np.linalg.solve(self._normal(some, effects), effects @ rest)

        change = np.clip(step(self.residual), low, high)
        before, stood = np.zeros_like(change), np.zeros_like(self.residual)
        tried: list[tuple[float, np.ndarray, np.ndarray]] = []
        found: Set | None = None
        for n in range(STEPS):
            moved = self.simulate(list(zip(some, change)), n + 1)
            if isinstance(moved, str):
                change = 0.5 * (change + before)
                continue
            rest = self.residual - moved[0]
            # From effects that have not the noise of this simulation: what remains has it, too.
            more = np.clip(change + step(rest), low, high) - change
            tried.append((float(rest @ rest), change + more, rest - more @ effects))
            # The best simulations; the others are still on the way.
            least = min(squared for squared, _, _ in tried)
            good = [one for one in tried if one[0] < NEAR * least]
            found = self._set(some, [g[1] for g in good], [g[2] for g in good], effects)
            if n > 0 and not found.may_be:
                break
            way = change - before
            off = moved[1] - stood - way @ effects
            if float(np.square(moved[1] - stood).sum()) > FAR * len(rest):
                # The effects of this way, as far as they differ from the sum of the single ones.
                size = float((way / unit) @ (way / unit))
                effects = effects + (way / unit**2)[:, None] * off[None, :] / size
            before, stood = change, moved[1]
            change = change + more
        return found

    def _set(
        self,
        some: list[Candidate],
        ends: Sequence[np.ndarray],
        rests: Sequence[np.ndarray],
        effects: np.ndarray,
    ) -> Set:
        """From corrections that have each their own noise of the simulation."""
        changes, rest = np.mean(ends, axis=0), np.mean(rests, axis=0)
        scatter = np.std(ends, axis=0) / np.sqrt(max(1, len(ends) - 1))
        inverse = np.linalg.pinv(self._normal(some, effects), rcond=1e-12, hermitian=True)
        size = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
        spread = np.sqrt(max(1.0, float(rest @ rest) / len(rest)))
        # The pull of each quantity as a whole: the windows of one are not independent, and
        # the noise of a quantity may be larger than expected.
        pulls = np.array([effects[:, own] @ rest[own] for own in self.groups])
        count = len(self.groups)
        pulled = inverse @ (pulls.T @ pulls) @ inverse * count / max(1, count - len(some))
        deviations = np.maximum(size * spread, np.sqrt(np.diag(pulled)))
        deviations = np.hypot(deviations, scatter)
        return Set(some, changes, deviations, inverse / np.outer(size, size), rest, effects)

    def _alike(self, found: Set) -> None:
        """Alternatives to one of the parameters, while the others change as well."""
        for n, one in enumerate(found.candidates):
            rest_of = np.delete(found.effects, n, axis=0)
            own = _without(found.effects[n], rest_of)
            for other, effect in self.effects.items():
                if other in found.candidates:
                    continue
                away = _without(effect, rest_of)
                sizes = np.sqrt(max(0.0, own @ own - self.scatter(own, one)))
                sizes *= np.sqrt(max(0.0, away @ away - self.scatter(effect, other)))
                correlation = float(own @ away) / sizes if sizes > 0 else 0.0
                if abs(correlation) >= ALIKE:
                    likes = found.like.setdefault(one.name, {})
                    likes[other.name] = max(-1.0, min(1.0, correlation))


def _without(effect: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The part of an effect that changes of the others do not make."""
    if not len(others):
        return effect
    return effect - np.linalg.lstsq(others.T, effect, rcond=None)[0] @ others
