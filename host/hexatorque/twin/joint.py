"""Which parameters explain the difference between a bench and its simulation, and which others
would explain it as well.

Least squares for every set of one to three parameters, from the effect of each alone, tell which
sets may explain it. The best of these are simulated with all their changes together, and corrected
(Gauss-Newton with Broyden's update of the effects). From the best one found the search goes on: the
effects are nearly linear close to it, while from the set-up they are not. A set with one parameter
more counts if it explains more by more than chance. All sets that explain it as well up to chance
are rivals: the recording does not tell them apart.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..parallel import each
from .candidates import Candidate

#: Each parameter of a set has changed by more than so many standard deviations, and its square is
#: what a set may explain less than another, and by chance.
SURE = 5.0
#: So many sets are simulated in one round, and in so many rounds.
TRIED, ROUNDS = 3, 4
MOST = 3
#: Corrections of a set, each from a simulation with another noise. Those are averaged in whose
#: simulation this many times the least square remains, and its square of times after it.
STEPS, NEAR = 4, 1.3
#: A correction of less than so many standard deviations is the last one.
STILL = 2.0
#: Where no parameter changes the quantities, what remains of two sets differs by chance by up to so
#: many roots of the number of values.
OUTSIDE = 3.0
#: A set of which so many times the least square of all remains after two simulations is left.
HOPELESS = 4.0
#: A correction shows how the effects change on the way if its square is so many noise variances.
FAR = 10.0
#: Two parameters whose effects have at least this correlation cannot be told apart.
ALIKE = 0.9
#: The effects of a distant set are known up to this share of the distance.
CURVED = 0.15

Changes = Sequence[tuple[Candidate, float]]
#: The difference between a simulation with these changes and one without, in units of the expected
#: noise: of all quantities, and without those that only scatter; or why there is no simulation. The
#: number chooses the noise.
Simulate = Callable[[Changes, int], tuple[np.ndarray, np.ndarray] | str]


@dataclass
class Set:
    """Parameters with the changes that explain the difference best. deviations: standard ones of
    the changes if all may change; correlations: of their errors; squared: what remains, without the
    noise of the simulations; inside: the part of it that changes of parameters can make; like:
    for each the parameters that would do in its place, with the
    correlation."""

    candidates: list[Candidate]
    changes: np.ndarray
    deviations: np.ndarray
    correlations: np.ndarray
    rest: np.ndarray
    effects: np.ndarray
    squared: float
    inside: float
    like: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def names(self) -> frozenset[str]:
        return frozenset(one.name for one in self.candidates)

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
                    "unit": c.si_unit,
                    "change": float(x), "deviation": float(s), "like": self.like.get(c.name, {}),
                }
                for c, x, s in zip(self.candidates, self.changes, self.deviations)
            ],
            "correlations": self.correlations.tolist(),
            "remains": self.squared / float(residual @ residual),
        }  # fmt: skip


class Search:
    """effects: the change of the quantities with each parameter, per unit of it, in expected
    noises; scatter: what of their squares is the scatter of the simulations, by name; blocks:
    numbers of the values, each for another way of putting together those whose errors are not
    independent; the search uses the first, the quantities. rivals: after `best`, the other sets
    that explain the difference as well."""

    def __init__(
        self,
        effects: dict[Candidate, np.ndarray],
        scatter: Mapping[str, float],
        residual: np.ndarray,
        blocks: Sequence[np.ndarray],
        simulate: Simulate,
    ) -> None:
        self.scatter, self.residual, self.simulate = scatter, residual, simulate
        self.blocks = blocks
        self.effects = {
            c: effect for c, effect in effects.items() if effect @ effect > 2 * scatter[c.name]
        }
        self.tried: dict[frozenset[str], Set | None] = {}
        self.least = self.least_outside = np.inf
        #: Directions in which parameters change the quantities.
        own = np.array([c.step * effect for c, effect in self.effects.items()])
        self.directions = np.linalg.qr(own.reshape(-1, len(residual)).T)[0]
        self.rivals: list[Set] = []

    def best(self, singles: Sequence[Candidate]) -> Set | None:
        """The smallest set that explains as much as the larger ones do, up to chance. singles: the
        parameters that alone explain most, best first. None if not one can be simulated."""
        found = self._try([([one], None) for one in singles])
        if not found:
            return None
        for _ in range(ROUNDS):
            new = self._promising(found)[:TRIED]
            if not new:
                break
            found = self._try([(some, changes) for _, some, changes in new]) or found
        self._alike(found)
        self._widen(found)
        limit = self.score(found) + SURE**2 * found.per_value
        others = [one for one in self.tried.values() if one and self.score(one) <= limit]
        # A set is told if no smaller one that is in it does as well.
        small = [
            one
            for one in others
            if not any(o.names < one.names and self.score(o) <= self.score(one) for o in others)
        ]
        self.rivals = sorted((one for one in small if one is not found), key=self.score)
        return found

    def score(self, one: Set) -> float:
        """The least one is the best set: one parameter more has to explain more than chance. Where
        no parameter changes the quantities, only a clear difference counts."""
        more = one.squared - one.inside - self.least_outside - OUTSIDE * np.sqrt(len(one.rest))
        return one.inside + max(0.0, more) + SURE**2 * one.per_value * len(one.candidates)

    def _try(self, sets: Sequence[tuple[list[Candidate], np.ndarray | None]]) -> Set | None:
        """The best of all sets that have been simulated, these among them."""
        for (some, _), found in zip(sets, each(lambda one: self.fitted(*one), sets)):
            self.tried[frozenset(c.name for c in some)] = found
        known = [one for one in self.tried.values() if one]
        self.least_outside = min((one.squared - one.inside for one in known), default=0.0)
        sure = [one for one in known if one.sure] or known[:1]
        return min(sure, key=self.score, default=None)

    def _promising(self, found: Set) -> list[tuple[float, list[Candidate], np.ndarray]]:
        """The sets not yet simulated that may explain it as well, with their changes, best first.
        From `found`, the effects are linear up to a share of the distance, quantity by quantity."""
        effects = dict(self.effects)
        effects |= dict(zip(found.candidates, found.effects))
        local = _Local(found, effects, self.scatter, self.blocks[0])
        most = min(MOST, len(found.candidates) + 1)
        sets = []
        for count in range(1, most + 1):
            for some in itertools.combinations(range(len(local.names)), count):
                names = frozenset(local.names[n] for n in some)
                if names in self.tried:
                    continue
                # With all of `found` in it, a set is no rival, but a better one or none.
                limit = 0.0 if found.names < names else SURE**2 * found.per_value
                changes, more = local.fitted(some)
                remains = max(1.0, (found.squared + min(0.0, more)) / len(found.rest))
                more += SURE**2 * remains * (count - len(found.candidates))
                if changes is not None and more <= limit:
                    sets.append((more, [local.candidates[n] for n in some], changes))
        return sorted(sets, key=lambda one: one[0])

    def _normal(self, some: Sequence[Candidate], effects: np.ndarray) -> np.ndarray:
        """The normal matrix without the scatter of the simulations, which has no direction."""
        square = effects @ effects.T
        less = np.array([self.scatter[c.name] for c in some])
        return square - np.diag(np.minimum(less, 0.5 * np.diag(square)))

    def fitted(self, some: list[Candidate], begin: np.ndarray | None = None) -> Set | None:
        """begin: the changes to begin with. None if the simulation does not run with the changes
        that explain most, nor half-way."""
        effects = np.array([self.effects[c] for c in some])
        low, high = (np.array([getattr(c, side) for c in some]) for side in ("low", "high"))
        unit = np.array([c.step for c in some])

        def step(rest: np.ndarray) -> np.ndarray:
            return np.linalg.solve(self._normal(some, effects), effects @ rest)

        change = np.clip(step(self.residual) if begin is None else begin, low, high)
        before, stood = np.zeros_like(change), np.zeros_like(self.residual)
        tried: list[tuple[float, np.ndarray, np.ndarray]] = []
        found: Set | None = None
        refused = False
        for n in range(STEPS):
            moved = self.simulate(list(zip(some, change)), n + 1)
            if isinstance(moved, str):
                if refused:
                    return None
                refused, change = True, 0.5 * (change + before)
                continue
            rest = self.residual - moved[0]
            # From effects that have not the noise of this simulation: what remains has it, too.
            more = np.clip(change + step(rest), low, high) - change
            left = rest - more @ effects
            tried.append((float(rest @ rest), change + more, left))
            # The best simulations; the others are still on the way.
            least = min(squared for squared, _, _ in tried)
            self.least = min(self.least, least)
            good = [one for one in tried if one[0] < NEAR * least]
            end = min(float(left @ left) for _, _, left in good)
            good = [one for one in good if float(one[2] @ one[2]) < NEAR**2 * end]
            nearest = sorted((one[2] for one in tried), key=lambda left: float(left @ left))
            nearest = nearest[: max(2, len(good))]
            squared, inside = _common(nearest), _common([one @ self.directions for one in nearest])
            found = self._set(some, [g[1] for g in good], [g[2] for g in good], effects)
            found.squared, found.inside = squared, inside
            if n > 0 and (least > HOPELESS * self.least or (n > 1 and not found.may_be)):
                break
            chance = np.linalg.pinv(self._normal(some, effects), rcond=1e-12, hermitian=True)
            if len(good) > 1 and np.all(np.square(more) < STILL**2 * np.diag(chance)):
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
        pulled = self._pulled(self.blocks[0], rest, effects, inverse)
        deviations = np.hypot(np.maximum(size * spread, pulled), scatter)
        correlations = inverse / np.outer(size, size)
        return Set(some, changes, deviations, correlations, rest, effects, 0.0, 0.0)

    @staticmethod
    def _pulled(
        block: np.ndarray, rest: np.ndarray, effects: np.ndarray, inverse: np.ndarray
    ) -> np.ndarray:
        """Standard deviations of the changes if the values of a block have errors in common."""
        pulls = np.array([np.bincount(block, effect * rest) for effect in effects])
        count = pulls.shape[1]
        covariance = inverse @ (pulls @ pulls.T) @ inverse
        return np.sqrt(np.diag(covariance) * count / max(1, count - len(effects)))

    def _widen(self, found: Set) -> None:
        """The deviations by all blocks. The rest is that of the whole set only now: of a smaller
        one it has what the others explain."""
        normal = self._normal(found.candidates, found.effects)
        inverse = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)
        for block in self.blocks[1:]:
            pulled = self._pulled(block, found.rest, found.effects, inverse)
            found.deviations = np.maximum(found.deviations, pulled)

    def seen_from(self, other: Candidate, found: Set) -> float:
        """The smallest change of another parameter that would be seen beside the set."""
        own = _without(self.effects[other], found.effects) if other in self.effects else np.zeros(1)
        size = float(own @ own) - self.scatter.get(other.name, 0.0)
        return SURE * float(np.sqrt(found.per_value / size)) if size > 0 else float("inf")

    def _alike(self, found: Set) -> None:
        """Alternatives to one of the parameters, while the others change as well."""
        for n, one in enumerate(found.candidates):
            rest_of = np.delete(found.effects, n, axis=0)
            own = _without(found.effects[n], rest_of)
            for other, effect in self.effects.items():
                if other in found.candidates:
                    continue
                away = _without(effect, rest_of)
                sizes = np.sqrt(max(0.0, own @ own - self.scatter[one.name]))
                sizes *= np.sqrt(max(0.0, away @ away - self.scatter[other.name]))
                correlation = float(own @ away) / sizes if sizes > 0 else 0.0
                if abs(correlation) >= ALIKE:
                    likes = found.like.setdefault(one.name, {})
                    likes[other.name] = max(-1.0, min(1.0, correlation))


def _common(rests: Sequence[np.ndarray]) -> float:
    """The square of what these have in common; the noise of each simulation is its own."""
    if len(rests) == 1:
        return float(rests[0] @ rests[0])
    total = np.sum(rests, axis=0)
    own = sum(float(one @ one) for one in rests)
    return (float(total @ total) - own) / (len(rests) * (len(rests) - 1))


class _Local:
    """Least squares from a set that has been simulated. A quantity that a change moves far counts
    less: its effect is known up to a share."""

    def __init__(
        self,
        found: Set,
        effects: Mapping[Candidate, np.ndarray],
        scatter: Mapping[str, float],
        quantity: np.ndarray,
    ) -> None:
        self.candidates = list(effects)
        self.names = [c.name for c in self.candidates]
        own = [self.names.index(c.name) for c in found.candidates]
        self.begin = np.zeros(len(self.names))
        self.begin[own] = found.changes
        matrix, count = np.array(list(effects.values())), int(quantity.max()) + 1
        parts = [quantity == n for n in range(count)]
        self.sizes = np.array([max(1, int(np.count_nonzero(part))) for part in parts])
        # For each quantity: products of the effects with each other and with the rest.
        self.square = np.array([matrix[:, part] @ matrix[:, part].T for part in parts])
        self.pull = np.array([matrix[:, part] @ found.rest[part] for part in parts])
        share = self.sizes / self.sizes.sum()
        less = np.array([scatter[name] for name in self.names])
        for n in range(count):
            diagonal = np.diag(self.square[n])
            self.square[n] -= np.diag(np.minimum(less * share[n], 0.5 * diagonal))
        self.low = np.array([c.low for c in self.candidates])
        self.high = np.array([c.high for c in self.candidates])

    def fitted(self, some: Sequence[int]) -> tuple[np.ndarray | None, float]:
        """The changes, or None if they cannot be meant, and how much more remains."""
        own = list(some)
        weights = np.ones(len(self.square))
        found = []
        for _ in range(2):
            square = np.tensordot(weights, self.square, 1)
            pull = weights @ self.pull + square @ self.begin
            try:
                changes = np.linalg.solve(square[np.ix_(own, own)], pull[own])
            except np.linalg.LinAlgError:
                return None, 0.0
            way = -self.begin
            way[own] += changes
            moved = np.maximum(0.0, np.einsum("qij,i,j->q", self.square, way, way))
            more = moved - 2 * self.pull @ way
            found.append(float(weights @ more))
            weights = 1 / (1 + CURVED**2 * moved / self.sizes)
            found.append(float(weights @ more))
        if np.any(changes < self.low[own]) or np.any(changes > self.high[own]):
            return None, 0.0
        return changes, min(found)


def _without(effect: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The part of an effect that changes of the others do not make."""
    if not len(others):
        return effect
    return effect - np.linalg.lstsq(others.T, effect, rcond=None)[0] @ others
