"""The limit: the least torque ripple and distortion that any pulse pattern can have at a mean
switching frequency (docs/interleaved.md, "The limit of all pulse patterns").

A pattern repeats itself while the voltage stands still. Its ripple is closed: the mean product of
two legs' ripple volt-seconds is the sum over their edges of +-K(t_i - t_j), K = -B_4/24. Free are
all edges, how many pulses each leg has, whether a leg of a set stays on a rail, and how often
the pattern comes at each angle of the voltage. The result is the best local optimum of many starts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from ...errors import InputError
from ...parallel import each
from ...plant.vsd import SETS, inverse
from ...setups import Setup
from . import carrier
from .carrier import Ripple, SteadyState, ripple_rows, steady_state
from .places import Place

#: Weights of the torque ripple beside the distortion, both relative to what a volt-second of a leg
#: makes in the mean over the angles of the voltage.
WEIGHTS = (0.0, 0.5, 2.0, 8.0, 32.0)
#: Angles of the voltage. All kinds of patterns are tried at every third one, the best of them at
#: all of them.
ANGLES, QUICK_ANGLES, EVERY = 12, 5, 3
#: Pulses of a leg in a pattern, at most.
PULSES = 2
#: Starts of each kind, steps from each; steps from the best fourth of them.
STARTS, TRY, FIRST = 3, 30, 60
#: So many of the best are handed on, and so many are kept of a weight; steps from all of these.
OWN, KEPT, SECOND = 10, 3, 120
#: Patterns that are worked on at once: their numbers fit into the cache.
AT_ONCE = 192
#: Allowed switching frequencies: at least so many patterns in a period of the fundamental.
PATTERNS, MOST_HZ = 10, 1e6
_SET_OF_LEG = np.array([0, 1] * 3)


@dataclass(frozen=True)
class Patterns:
    """n patterns. legs_pu (n, 6): the legs' voltages without zero sequence, in units of V_dc;
    pulses (n, 6): of each leg in a pattern; rails (n, 2): of each set, 1: its largest leg stays up,
    -1: its smallest leg stays down, 0: the zero sequence is free; weights (n, 6, 6): of the mean
    products of the legs' ripple volt-seconds in the cost.

    A pattern's free values x: of each leg the instant of its first edge, then the logarithms of
    its pulses' and of its gaps' shares; last, for each set, where the zero sequence is in its
    range, as a logit. So every x is a pattern with the right mean voltage."""

    legs_pu: np.ndarray
    pulses: np.ndarray
    rails: np.ndarray
    weights: np.ndarray

    @property
    def free(self) -> int:
        return 6 * (2 * PULSES - 1) + 2

    def __getitem__(self, which: np.ndarray | slice) -> Patterns:
        return Patterns(*(getattr(self, field.name)[which] for field in fields(self)))

    def random(self, rng: np.random.Generator) -> np.ndarray:
        x = rng.normal(0.0, 0.5, (len(self.pulses), self.free))
        x[:, : -2 : 2 * PULSES - 1] = rng.random((len(x), 6))
        return x

    def edges(self, x: np.ndarray) -> np.ndarray:
        """(n, 6, pulses, 2): when each pulse of each leg begins and ends, in lengths of the pattern
        and modulo 1; those that a leg does not have are there too."""
        return self._edges(x)[0]

    @property
    def _on(self) -> np.ndarray:
        return np.arange(PULSES) < self.pulses[:, :, None]

    @property
    def _signs(self) -> np.ndarray:
        """(n, edges): 1 rising, -1 falling, 0 not there."""
        on = self._on.astype(float)
        return np.stack([on, -on], axis=-1).reshape(len(on), -1)

    def _edges(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Instants (n, 6, pulses, 2) in pattern lengths, and what their derivatives need: shares of
        pulses and of gaps, duty ratios, and those by the logits."""
        of_leg = x[:, :-2].reshape(len(x), 6, -1)

        def shares(logs: np.ndarray) -> np.ndarray:
            """The first logarithm is 0: only ratios count."""
            e = np.exp(np.clip(np.insert(logs, 0, 0.0, axis=2), -30, 30)) * self._on
            return e / np.maximum(e.sum(axis=2, keepdims=True), 1e-300)

        up, gap = shares(of_leg[:, :, 1:PULSES]), shares(of_leg[:, :, PULSES:])
        z, by_logit = np.empty((len(x), 2)), np.empty((len(x), 2))
        for one, legs in enumerate(SETS):
            own, rail = self.legs_pu[:, legs], self.rails[:, one]
            low, high = -own.min(axis=1), 1 - own.max(axis=1)
            share = 1 / (1 + np.exp(-np.clip(x[:, one - 2], -40, 40)))
            free = low + (high - low) * share
            z[:, one] = np.where(rail < 0, low, np.where(rail > 0, high, free))
            by_logit[:, one] = np.where(rail == 0, (high - low) * share * (1 - share), 0.0)
        duty = self.legs_pu + z[:, _SET_OF_LEG]
        high_for = up * duty[:, :, None]
        both = high_for + gap * (1 - duty[:, :, None])
        begin = of_leg[:, :, :1] + np.cumsum(both, axis=2) - both
        return np.stack([begin, begin + high_for], axis=-1), up, gap, duty, by_logit

    def _between(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and x(1 - x) for the distances between all edges: B_4 = x^2 (1 - x)^2 - 1/30, and the
        constant falls out, as a leg rises as often as it falls."""
        at = times.reshape(len(times), -1)
        apart = at[:, :, None] - at[:, None, :]
        apart -= np.floor(apart)
        return apart, apart * (1 - apart)

    @property
    def _size(self) -> np.ndarray:
        """A pattern with more pulses is longer at the same switching frequency; squared."""
        return (self.pulses.sum(axis=1) / 6.0) ** 2

    def products(self, x: np.ndarray) -> np.ndarray:
        """(n, 6, 6): mean products of the legs' ripple volt-seconds, in units of (V_dc/f_sw)^2."""
        _, y = self._between(self._edges(x)[0])
        signs = self._signs
        each_pair = -y * y / 24 * signs[:, :, None] * signs[:, None, :]
        shape = (len(x), 6, 2 * PULSES, 6, 2 * PULSES)
        return each_pair.reshape(shape).sum(axis=(2, 4)) * self._size[:, None, None]

    def of_edges(self) -> np.ndarray:
        """The weights of all pairs of edges."""
        leg, signs = np.repeat(np.arange(6), 2 * PULSES), self._signs
        size = (self._size / 24)[:, None, None]
        return self.weights[:, leg][:, :, leg] * signs[:, :, None] * signs[:, None, :] * size

    def costs(self, x: np.ndarray, of_edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,) the cost, and (n, free) its slopes."""
        times, up, gap, duty, by_logit = self._edges(x)
        apart, y = self._between(times)
        weighted = of_edges * y
        costs = -np.einsum("nij,nij->n", weighted, y)
        by_time = -4 * np.einsum("nij,nij->ni", weighted, 1 - 2 * apart).reshape(times.shape)
        # A pulse or a gap that gets longer moves all later edges of its leg.
        both = by_time.sum(axis=3)
        by_gap = both.sum(axis=2, keepdims=True) - np.cumsum(both, axis=2)
        by_up = by_gap + by_time[..., 1]
        by_duty = (by_up * up - by_gap * gap).sum(axis=2)
        parts = [both.sum(axis=2, keepdims=True)]
        for slopes, shares, share in ((by_up, up, duty), (by_gap, gap, 1 - duty)):
            level = (slopes * shares).sum(axis=2, keepdims=True)
            parts.append((share[:, :, None] * shares * (slopes - level))[:, :, 1:])
        by_z = np.stack([by_duty[:, legs].sum(axis=1) for legs in SETS], axis=1)
        of_legs = np.concatenate(parts, axis=2).reshape(len(x), -1)
        return costs, np.concatenate([of_legs, by_z * by_logit], axis=1)

    def minimised(self, x: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """x after so many steps of BFGS, each pattern for itself, and its costs."""
        found = [
            self[part]._minimised(x[part], steps)
            for part in (slice(n, n + AT_ONCE) for n in range(0, len(x), AT_ONCE))
        ]
        return np.concatenate([one for one, _ in found]), np.concatenate([c for _, c in found])

    def _minimised(self, x: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        of_edges = self.of_edges()
        costs, slopes = self.costs(x, of_edges)
        curved: np.ndarray | None = None
        for _ in range(steps):
            if curved is None:
                way = -slopes
                way *= (0.05 / np.maximum(np.abs(way).max(axis=1), 1e-300))[:, None]
            else:
                way = -np.einsum("nij,nj->ni", curved, slopes)
                uphill = np.einsum("ni,ni->n", way, slopes) >= 0
                way[uphill] = -slopes[uphill]
                way *= np.minimum(1, 0.5 / np.maximum(np.abs(way).max(axis=1), 1e-300))[:, None]
            falls = np.einsum("ni,ni->n", way, slopes)
            share = np.ones(len(x))
            there = x + way
            now, slopes_now = self.costs(there, of_edges)
            for _ in range(6):
                short = np.flatnonzero(now > costs + 1e-4 * share * falls)
                if not len(short):
                    break
                share[short] *= 0.3
                there[short] = x[short] + share[short, None] * way[short]
                now[short], slopes_now[short] = self[short].costs(there[short], of_edges[short])
            stay = now > costs
            there[stay], now[stay], slopes_now[stay] = x[stay], costs[stay], slopes[stay]
            moved, turned = there - x, slopes_now - slopes
            along = np.einsum("ni,ni->n", moved, turned)
            usable = along > 1e-14
            per = np.where(usable, 1 / np.where(usable, along, 1.0), 0.0)[:, None, None]
            if curved is None:
                size = along / np.maximum(np.einsum("ni,ni->n", turned, turned), 1e-300)
                curved = np.where(usable, size, 1.0)[:, None, None] * np.eye(self.free)
            across = np.einsum("nij,nj->ni", curved, turned)
            own = np.einsum("ni,ni->n", turned, across)[:, None, None]
            mixed = across[:, :, None] * moved[:, None, :]
            square = moved[:, :, None] * moved[:, None, :]
            curved += per * ((1 + per * own) * square - mixed - mixed.transpose(0, 2, 1))
            x, costs, slopes = there, now, slopes_now
        return x, costs


def combinations() -> tuple[np.ndarray, np.ndarray]:
    """All pulse numbers and rails: (n, 2) rails, (n, 2, 3) pulses of each set's legs, the largest
    first. At most one leg of a set stays on a rail."""
    of_set = []
    for rail in (0, 1, -1):
        for pulses in itertools.product(range(1, PULSES + 1), repeat=3 if rail == 0 else 2):
            own = {0: pulses, 1: (0, *pulses), -1: (*pulses, 0)}[rail]
            of_set.append((rail, own))
    pairs = list(itertools.product(of_set, of_set))
    rails = np.array([[rail for rail, _ in pair] for pair in pairs])
    return rails, np.array([[own for _, own in pair] for pair in pairs])


@dataclass(frozen=True)
class _Angle:
    """One angle of the voltage: legs' voltages, and rows of `ripple_rows`."""

    legs_pu: np.ndarray
    rows: np.ndarray

    def weights(self, weight: float) -> np.ndarray:
        current, torque = self.rows[:4], self.rows[4]
        distortion = current.T @ current / (1.5 * (current**2).sum())
        return distortion + weight * np.outer(torque, torque) / (3 * (torque**2).sum())

    def patterns(self, rails: np.ndarray, pulses: np.ndarray, weight: float) -> Patterns:
        """pulses: of the legs themselves."""
        n = len(rails)
        weights = np.broadcast_to(self.weights(weight), (n, 6, 6))
        return Patterns(np.broadcast_to(self.legs_pu, (n, 6)), pulses, rails, weights)

    def kinds(self, weight: float) -> Patterns:
        """One of each combination of pulse numbers and rails."""
        rails, by_size = combinations()
        pulses = np.empty((len(rails), 6), int)
        for one, legs in enumerate(SETS):
            order = np.array(legs)[np.argsort(-self.legs_pu[list(legs)])]
            pulses[:, order] = by_size[:, one]
        return self.patterns(rails, pulses, weight)

    def fits(self, patterns: Patterns) -> np.ndarray:
        """Which of another angle's patterns can be here: the same leg is the one on the rail."""
        fits = np.ones(len(patterns.pulses), bool)
        for one, legs in enumerate(SETS):
            own, rail = self.legs_pu[list(legs)], patterns.rails[:, one]
            still = np.where(rail > 0, own.argmax(), own.argmin())
            at = patterns.pulses[:, legs][np.arange(len(fits)), still]
            fits &= (rail == 0) | (at == 0)
        return fits


@dataclass(frozen=True)
class _Best:
    """The best patterns of an angle, the least cost first."""

    patterns: Patterns
    x: np.ndarray

    @classmethod
    def of(cls, patterns: Patterns, x: np.ndarray, steps: int, kept: int) -> _Best:
        x, costs = patterns.minimised(x, steps)
        order = np.argsort(costs)[:kept]
        return cls(patterns[order], x[order])


@dataclass(frozen=True)
class Point:
    """One point of the limit's front at a mean switching frequency."""

    weight: float
    ripple: Ripple


#: Called for each piece of work that is done.
Tell = Callable[[], None]


def pieces(quick: bool) -> int:
    """How often `front` tells."""
    angles = QUICK_ANGLES if quick else ANGLES
    return (angles + len(range(1, angles, EVERY))) * len(WEIGHTS)


def front(
    setup: Setup,
    place: Place,
    f_sw_Hz: float,
    flux_Wb: float,
    quick: bool = False,
    tell: Tell = lambda: None,
) -> list[Point]:
    """The limit at a point and a mean switching frequency, from least distortion to least torque
    ripple. InputError where no pattern has the mean voltage."""
    at = steady_state(setup, place, flux_Wb)
    m_pu = float(abs(at.v_V) / setup["inverter.vdc_V"])
    carrier.within_reach(m_pu)
    least_Hz = PATTERNS * abs(at.omega_rad_s) / (2 * np.pi)
    if not least_Hz <= f_sw_Hz <= MOST_HZ:
        raise InputError(
            f"switching frequency (--f-sw) = {f_sw_Hz:g} Hz: allowed range is {least_Hz:.0f} .. "
            f"{MOST_HZ:g} Hz, {PATTERNS} patterns and more in a period of the fundamental"
        )
    if at.i_A == 0:
        raise InputError("load = 0 N m: there is no current, so no distortion; another is needed")
    displacement_deg = float(setup["machine.displacement_deg"])
    # The legs repeat each other, some of them mirrored, after the displacement or 60 degrees.
    span = np.deg2rad(displacement_deg or 60.0)
    angles = QUICK_ANGLES if quick else ANGLES
    turn = np.exp(1j * span * (np.arange(angles) + 0.5) / angles)
    v_pu = at.v_V * turn / setup["inverter.vdc_V"]
    legs = (inverse(displacement_deg)[:, :2] @ [v_pu.real, v_pu.imag]).T
    every = [_Angle(*one) for one in zip(legs, ripple_rows(setup, at, turn))]
    found: list[list[_Best]] = []  # of each weight, of each angle
    for seed, weight in enumerate(WEIGHTS):
        first = each(partial(_first, every, weight, seed, tell), range(1, angles, EVERY))
        found.append(each(partial(_second, every, weight, first, found, tell), range(angles)))
    products = [
        np.concatenate([one.patterns.products(one.x) for one in own]) for own in zip(*found)
    ]
    size_Vs = setup["inverter.vdc_V"] / f_sw_Hz
    return [Point(w, _ripple(at, m_pu, every, products, w, size_Vs)) for w in WEIGHTS]


def _first(every: list[_Angle], weight: float, seed: int, tell: Tell, number: int) -> _Best:
    """The best pattern from all starts at this angle."""
    kinds = every[number].kinds(weight)
    patterns = kinds[np.repeat(np.arange(len(kinds.pulses)), STARTS)]
    x = patterns.random(np.random.default_rng([37, seed, number]))
    tried = _Best.of(patterns, x, TRY, len(x) // 4)
    found = _Best.of(tried.patterns, tried.x, FIRST, OWN)
    tell()
    return found


def _second(
    every: list[_Angle],
    weight: float,
    first: list[_Best],
    before: list[list[_Best]],
    tell: Tell,
    number: int,
) -> _Best:
    """The best pattern from those of the other angles, and from this angle's of other weights."""
    angle = every[number]
    pool = [*first, *(one[number] for one in before)]
    rails, pulses, x = [], [], []
    for one in pool:
        fits = angle.fits(one.patterns)
        rails.append(one.patterns.rails[fits])
        pulses.append(one.patterns.pulses[fits])
        x.append(one.x[fits])
    patterns = angle.patterns(np.concatenate(rails), np.concatenate(pulses), weight)
    found = _Best.of(patterns, np.concatenate(x), SECOND, KEPT)
    tell()
    return found


def _ripple(
    at: SteadyState,
    m_pu: float,
    every: list[_Angle],
    products: list[np.ndarray],
    weight: float,
    size_Vs: float,
) -> Ripple:
    """The ripple of the best pattern at each angle. Among all ways to share the switching out over
    the angles, f_sw in proportion to the cube root of the costs has the least mean of
    costs/f_sw^2."""
    costs, squares = [], []
    for angle, own in zip(every, products):
        all_costs = np.einsum("ab,nab->n", angle.weights(weight), own)
        best = all_costs.argmin()
        costs.append(all_costs[best])
        squares.append(np.einsum("ka,kb,ab->k", angle.rows, angle.rows, own[best]))
    share = np.cbrt(costs)
    share /= share.mean()
    mean = np.mean(np.array(squares) / share[:, None] ** 2, axis=0)
    return Ripple.of(at, m_pu, mean * size_Vs**2)
