"""Which parameter explains the difference between a bench and its simulation best.

Every quantity of every window is divided by the scatter that the simulation itself has when it is
repeated with other noise and other ripple. A change of one parameter is then found by least squares
from the change of the simulation with it (Gauss-Newton). The parameters that explain most are
simulated again with the change found.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..drive.interface import DriveFault
from ..drive.simulated import SimulatedDrive
from ..errors import HexatorqueError
from ..parallel import each
from ..plant.machines import parameters_of
from ..recording.recording import Recording
from ..setups import Setup, SetupError
from . import joint
from .bench import Bench, as_the_board
from .candidates import Candidate, suitable
from .further import Changes, Follow, proposed
from .quantities import QUANTITIES, RIPPLES, about, compute, windows
from .replay import LATER, Replay, replay
from .shaft import NO_LOAD, Load, parts, per_window

SPEED = "speed by this torque"
SHAFT, SHAFT_NOISE = "shaft torque", "noise of the shaft torque"
#: Repetitions of the simulation as the set-up has it. They give the noise to expect.
REPEATS = 3
#: A repetition's rotor with magnets starts turned by this angle from the one before: no two alike.
TURNED_DEG = 137.5
#: Of what the best parameter explains alone, another explains this share or more: it is simulated.
SECOND = 0.25
#: A quantity is never expected to agree better than this share of its size.
FLOOR = 2e-3
#: The same with an oscilloscope's probes, and a part of its range that it does not resolve.
PROBE_FLOOR, RESOLUTION = 2e-2, 2e-3
#: The same of the speed of a signal in volts, which counts for the slip.
SPEED_FLOOR = 5e-3
#: Beyond this factor between the currents a probe's scale is the first thing to check.
SCALE = 1.3
#: A quantity differs if its difference is so many times the expected noise.
DIFFERS = 3.0
#: A parameter that explains less of the squared difference than this number of noise variances
#: is not named.
NAMED = 40.0
#: What remains is unexplained if its mean square is so many noise variances.
UNEXPLAINED = DIFFERS**2
#: Two parameters whose effects have at least this correlation cannot be told apart.
ALIKE = joint.ALIKE
#: A change moves a quantity if its mean square is so many deviations above that of the scatter.
VISIBLE = 3.0

Progress = Callable[[float], None]


def simulated_s(setup: Setup, benches: Sequence[Bench]) -> float:
    """Roughly the simulated time of a comparison, for progress bars."""
    runs = 2 * REPEATS + sum(not c.shaft_only for c in _suitable(setup, benches))
    return runs * sum(bench.duration_s for bench in benches)


def _suitable(setup: Setup, benches: Sequence[Bench]) -> tuple[Candidate, ...]:
    outside, torque_known = any(b.outside for b in benches), all(b.torque_known for b in benches)
    return suitable(setup, outside, torque_known)


class NotSimulated(HexatorqueError, RuntimeError):
    """The simulation of the set-up as it is cannot follow the recording."""


@dataclass
class Difference:
    """One quantity. rms: of bench - simulation; noise: rms to expect; size: rms of the bench's
    values; values: how many are compared."""

    name: str
    rms: float
    noise: float
    size: float
    values: int

    @property
    def ratio(self) -> float:
        return self.rms / self.noise

    @property
    def differs(self) -> bool:
        return self.ratio > DIFFERS

    def as_json(self) -> dict:
        unit = QUANTITIES[self.name].unit
        return {
            "quantity": self.name, "unit": unit, "rms_difference": self.rms,
            "expected_noise": self.noise, "ratio": self.ratio, "rms": self.size,
            "values": self.values, "verdict": "differs" if self.differs else "agrees",
        }  # fmt: skip


@dataclass
class Explanation:
    """One parameter. change: that explains the difference best, with its standard deviation; left:
    share of the squared difference that remains; seen_from: smallest change that would be seen
    here; like: the parameters from which it cannot be told apart, with the correlation; tried:
    whether `left` is of a simulation with the change."""

    candidate: Candidate
    change: float = 0.0
    deviation: float = float("inf")
    left: float = 1.0
    seen_from: float = float("inf")
    tried: bool = False
    like: dict[str, float] = field(default_factory=dict)

    def as_json(self) -> dict:
        def finite(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        c = self.candidate
        return {
            "parameter": c.name, "keys": list(c.keys), "unit": c.si_unit,
            "change": finite(self.change), "deviation": finite(self.deviation),
            "remains": finite(self.left), "simulated": self.tried,
            "visible_from": finite(self.seen_from), "like": self.like,
        }  # fmt: skip


@dataclass
class Overlay:
    """Means over the windows of one recording, on one time base."""

    label: str
    bench: Recording
    simulation: Recording


@dataclass
class Comparison:
    """explanations: of one parameter each, best first; named: whether one is found that counts;
    together: the parameters that explain more together than any of them alone; rivals: other sets
    of parameters that explain it as well; further: the recording that would tell them apart, and
    by how many standard deviations; residual: the difference in expected noises."""

    setup: Setup
    benches: list[Bench]
    notes: list[str]
    differences: list[Difference]
    explanations: list[Explanation]
    named: bool
    together: joint.Set | None
    rivals: list[joint.Set]
    further: tuple[str, float] | None
    residual: np.ndarray
    overlays: list[Overlay]

    @property
    def differs(self) -> bool:
        return self.named or any(d.differs for d in self.differences)

    @property
    def cause(self) -> Explanation | None:
        """The parameter that is named alone."""
        return self.explanations[0] if self.named and not self.together else None

    @property
    def sure(self) -> set[str]:
        """The parameters that every explanation has, and in whose place none could stand."""
        if not self.named:
            return set()
        first = self.explanations[0]
        best = self.together.names if self.together else {first.candidate.name}
        like = self.together.like if self.together else {first.candidate.name: first.like}
        alone = {name for name in best if not like.get(name)}
        return alone.intersection(*(one.names for one in self.rivals))

    @property
    def unexplained(self) -> bool:
        """Whether the remaining difference exceeds the noise."""
        rest = self.residual
        if self.together:
            return self.together.squared > UNEXPLAINED * len(rest)
        left = self.explanations[0].left if self.named else 1.0
        return left * float(rest @ rest) > UNEXPLAINED * len(rest)

    @property
    def hidden(self) -> list[str]:
        """The parameters of which no plausible change would be seen."""
        return [
            one.candidate.name
            for one in self.explanations
            if one.seen_from > max(-one.candidate.low, one.candidate.high)
        ]


class _Series:
    """The quantities of all benches as one long vector."""

    def __init__(self, setup: Setup, benches: Sequence[Bench], loads: Load) -> None:
        self.setup, self.benches = setup, benches
        self.which = [windows(b.periods, b.slow_s, b.outside) for b in benches]
        self.loads = loads
        self.shafts = [self._parts(n, bench.omega_rad_s) for n, bench in enumerate(benches)]
        self.pairs = int(setup["machine.pole_pairs"])
        self.displacement_deg = float(setup["machine.displacement_deg"])
        self.bench = [self._of(b, b.samples, None, n) for n, b in enumerate(benches)]

    def _parts(self, n: int, omega_rad_s: np.ndarray) -> dict[str, np.ndarray]:
        bench = self.benches[n]
        time_s = bench.begin_s + bench.slow_s * np.arange(bench.periods)
        which = self.which[n]
        return parts(self.setup, self.loads, omega_rad_s, time_s, bench.slow_s, which)

    def _of(
        self, bench: Bench, samples: dict[str, np.ndarray], torque_Nm: np.ndarray | None, n: int
    ) -> dict[str, np.ndarray]:
        per_slow = self.which[n]
        outside_step_s = bench.step_s if bench.outside else None
        if not bench.speed_known:
            samples = {name: data for name, data in samples.items() if name != "speed_rpm"}
        found = compute(
            samples, per_slow[bench.which], self.pairs, self.displacement_deg, outside_step_s
        )
        model = self.setup["machine.model"]
        found = {name: values for name, values in found.items() if about(name, model)}
        if not bench.torque_known:
            return found
        shaft = self.shafts[n]["needed"] if torque_Nm is None else per_window(torque_Nm, per_slow)
        return {**found, SHAFT: shaft.reshape(-1, 1)}

    def simulated(self, n: int, run: Replay, place: int) -> dict[str, np.ndarray]:
        samples = run.samples(place)
        found = self._of(self.benches[n], samples, run.torque_Nm, n)
        return {**found, SHAFT_NOISE: self.shaft_noise_Nm(n, samples)}

    def shaft_noise_Nm(self, n: int, samples: dict[str, np.ndarray]) -> np.ndarray:
        """The error of a measured speed: the simulation measures the bench's measured speed once
        more. It is late by up to half a period of the slow loop, as the firmware measures it, and
        between two samples nobody knows when it changed."""
        bench = self.benches[n]
        seen = self._parts(n, bench.edges_of(samples["speed_rpm"]))
        at = np.arange(bench.periods + 1) * bench.slow_s
        later = np.interp(at + bench.slow_s / 2 + bench.step_s, at, bench.omega_rad_s)
        late = self._parts(n, later)
        needed = self.shafts[n]["needed"]
        return np.hypot(seen["needed"] - needed, late["needed"] - needed)[:, None]

    def stacked(self, of_benches: Sequence[dict[str, np.ndarray]], name: str) -> np.ndarray:
        return np.concatenate([one[name] for one in of_benches])

    def overlay(self, n: int, repeats: list[dict[str, np.ndarray]]) -> Overlay:
        bench, which = self.benches[n], self.which[n]
        window_s = bench.slow_s * np.count_nonzero(which == 0)
        means = {name: np.mean([one[name] for one in repeats], axis=0) for name in self.names}
        units = {name: QUANTITIES[name].unit for name in self.names}
        units[SPEED] = "r/min"

        def recording(values: dict[str, np.ndarray], speed_rpm: np.ndarray) -> Recording:
            channels = {name: np.sqrt(np.sum(v**2, axis=1)) if v.shape[1] > 1 else v[:, 0]
                        for name, v in values.items() if name in units}  # fmt: skip
            channels[SPEED] = speed_rpm
            return Recording(1 / window_s, channels, units, {}, bench.begin_s + window_s / 2)

        # The speed that the simulated torque would give, from the first one on.
        needed = self.shafts[n]["needed"]
        lacking_Nm = means[SHAFT][:, 0] - needed if SHAFT in means else 0 * needed
        off = np.cumsum(lacking_Nm) * window_s / self.setup["machine.inertia_kgm2"]
        speed = per_window((bench.omega_rad_s[1:] + bench.omega_rad_s[:-1]) / 2, which) * 30 / np.pi
        seen = recording(self.bench[n], speed)
        return Overlay(bench.label, seen, recording(means, speed + off * 30 / np.pi))

    @property
    def outside(self) -> bool:
        return any(bench.outside for bench in self.benches)

    def probe_floor(self, name: str, simulated: np.ndarray) -> float:
        """The errors that an oscilloscope and its probes may have. Unequal probes look like
        currents in the x-y plane."""
        whole_A = [one["current amplitude"] for one in self.bench if "current amplitude" in one]
        whole = float(np.sqrt(np.nanmean(np.concatenate(whole_A) ** 2))) if whole_A else 0.0
        size = PROBE_FLOOR * float(np.sqrt(np.mean(simulated**2)))
        speed = max(float(np.abs(bench.omega_rad_s).max()) for bench in self.benches)
        more = {
            "unbalance": PROBE_FLOOR * whole,
            "x-y harmonics 5, 7": RESOLUTION * whole,
            "slip": SPEED_FLOOR * self.pairs * speed,
        }
        return float(np.hypot(size, more.get(name, 0.0)))

    def shaft(self, name: str) -> np.ndarray:
        return np.concatenate([one[name] for one in self.shafts])[:, None]

    @property
    def names(self) -> list[str]:
        return [name for name in QUANTITIES if all(name in one for one in self.bench)]


class _Simulations:
    """Simulations that follow the recordings. places: of the samples in the period of the slow
    loop, in fast periods after the earliest."""

    def __init__(
        self, setup: Setup, benches: list[Bench], loads: Load, progress: Progress | None
    ) -> None:
        self.setup, self.benches, self.loads, self.progress = setup, benches, loads, progress
        self.series = _Series(setup, benches, loads)
        self.places = [0 for _ in benches]

    def simulate(self, changes: Changes, late: int = 0) -> list[dict[str, np.ndarray]] | str:
        """The quantities of each recording with these changes, or why there are none. late: chooses
        another noise."""
        runs = self._follow(changes, late)
        return runs if isinstance(runs, str) else self._quantities(runs)

    def repeats(self, name: str) -> list[list[dict[str, np.ndarray]]]:
        """The set-up as it is, with other noise each time. First the samples are placed. `name`
        tells the user which set-up cannot follow."""
        if any(bench.places > 1 for bench in self.benches):
            scouts = self._repeated(name, 1)
            self.places = [
                _place(self.setup, bench, self.loads, runs)
                for bench, runs in zip(self.benches, zip(*scouts))
            ]
            for bench, place in zip(self.benches, self.places):
                bench.first = max(0, bench.first - place)  # now it is known
        return [self._quantities(runs) for runs in self._repeated(name, LATER)]

    def _quantities(self, runs: list[Replay]) -> list[dict[str, np.ndarray]]:
        return [self.series.simulated(n, run, self.places[n]) for n, run in enumerate(runs)]

    def _repeated(self, name: str, apart: int) -> list[list[Replay]]:
        found = each(lambda n: self._follow((), apart * n), range(REPEATS))
        if failed := [one for one in found if isinstance(one, str)]:
            raise NotSimulated(
                f"the simulation of {name} does not follow the recording: {failed[0]}"
            )
        return [one for one in found if not isinstance(one, str)]

    def _follow(self, changes: Changes, late: int) -> list[Replay] | str:
        try:
            other = self.setup
            for candidate, change in changes:
                other = candidate.apply(other, change)
            return [self._follow_one(bench, other, changes, late) for bench in self.benches]
        except (DriveFault, SetupError, ArithmeticError) as error:
            return str(error).splitlines()[0]

    def _follow_one(self, bench: Bench, setup: Setup, changes: Changes, late: int) -> Replay:
        prepares = [c.prepare(change) for c, change in changes if c.prepare]

        def prepare(sim: SimulatedDrive) -> None:
            for one in prepares:
                one(sim)

        # Another noise for every repetition, and another angle, never the set-up's own: the windows
        # begin elsewhere in a turn than the bench's, whose angle nobody knows.
        machine = parameters_of(setup["machine.model"])(**setup.machine_values())
        seeded = setup.changed(
            {"sensors.noise_seed": setup["sensors.noise_seed"] + late,
             **machine.start_turned(setup.parameter("rotor_zero_deg"), TURNED_DEG * (late + 1))}
        )  # fmt: skip
        # An oscilloscope has the true voltage, the board what its sensor makes of it.
        vdc = 1.0 if bench.outside else math.prod((c.vdc(x) for c, x in changes), start=1.0)
        more_Nm = 0.0 if bench.torque_known else sum((x for c, x in changes if c.adds_torque), 0.0)
        run = replay(bench, seeded, prepare, vdc, late, more_Nm)
        for candidate, change in changes if bench.outside else ():
            for phase in candidate.probes:
                if (name := f"i_{phase}_A") in run.channels:
                    run.channels[name] = run.channels[name] * (1 + change)
        if self.progress:
            self.progress(bench.duration_s)
        return run


class _Search:
    """The parameters that explain the difference. effects: of each on its own, for one unit of it;
    scatter: what of their squares is the scatter of the simulations; residual: the difference in
    expected noises."""

    def __init__(
        self, simulations: _Simulations, nominal: _Nominal, candidates: Sequence[Candidate]
    ) -> None:
        self.simulations, self.nominal, self.candidates = simulations, nominal, candidates
        self.residual = nominal.whitened(simulations.series.bench)
        self.effects: dict[str, np.ndarray] = {}
        self.notes: list[str] = []
        electrical = [c for c in candidates if not c.shaft_only]
        changed = each(lambda one: simulations.simulate([(one, one.step)]), electrical)
        for candidate, found in zip(electrical, changed):
            if isinstance(found, str):
                self._refused(candidate, candidate.step, found)
            else:
                self.effects[candidate.name] = nominal.effect(found) / candidate.step
        for candidate in candidates:
            if candidate.shaft_only:
                self.effects[candidate.name] = nominal.shaft_effect(candidate.name)
        self.scatter = {
            one.name: 0.0
            if one.shaft_only
            else np.count_nonzero(self.effects[one.name]) / one.step**2
            for one in candidates
            if one.name in self.effects
        }

    def _refused(self, candidate: Candidate, change: float, why: str) -> None:
        self.notes.append(f"{candidate.name} {candidate.shown(change)}: {why}")

    def alone(self) -> list[Explanation]:
        """The share that each would explain if the simulation were linear in it, best first."""
        shown = [c for c in self.candidates if c.name in self.effects]
        explained = [
            _alone(c, self.effects[c.name], self.scatter[c.name], self.residual) for c in shown
        ]
        return sorted(explained, key=lambda e: e.left)

    def together(
        self, explained: Sequence[Explanation]
    ) -> tuple[joint.Set | None, list[joint.Set]]:
        """The parameters that explain most together, and the others that would do as well. From
        then on the explanations tell what would be seen beside them."""
        of = {c: self.effects[c.name] for c in self.candidates if c.name in self.effects}
        search = joint.Search(of, self.scatter, self.residual, self.nominal.blocks, self._moved)
        counting = [one for one in explained if _counts(one, self.residual)]
        while counting:
            # Far from the set-up effects are not linear: the true one may explain less there.
            share = SECOND * (1.0 - counting[0].left)
            singles = [one for one in counting if 1.0 - one.left >= share]
            if found := search.best([one.candidate for one in singles]):
                for other in explained:
                    other.tried = other.candidate in found.candidates
                    if not other.tried:
                        other.seen_from = search.seen_from(other.candidate, found)
                return found, search.rivals
            # The drive does not run with them, and on the bench it ran.
            for one in singles:
                one.left = 1.0
            counting = counting[len(singles) :]
        return None, []

    def _moved(self, changes: Changes, late: int) -> tuple[np.ndarray, np.ndarray] | str:
        inside = [(c, x) for c, x in changes if not c.shaft_only]
        shaft = sum(
            (self.effects[c.name] * x for c, x in changes if c.shaft_only), 0 * self.residual
        )
        # Without such a change, too: what remains of any set has the noise of one simulation.
        found = self.simulations.simulate(inside, late)
        if isinstance(found, str):
            if len(inside) == 1:
                self._refused(*inside[0], found)
            return found
        moved, visible = self._seen(found)
        return moved + shaft, visible + shaft

    def _seen(self, found: list[dict[str, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
        return self.nominal.whitened(found), self.nominal.effect(found)


def compare(
    setup: Setup,
    benches: list[Bench],
    loads: Load = NO_LOAD,
    candidates: Sequence[Candidate] | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """NotSimulated if the simulation of the set-up as it is cannot follow the recording."""
    notes: list[str] = []
    fixed = as_the_board(setup, benches, notes)
    candidates = _suitable(setup, benches) if candidates is None else candidates
    benches = [replace(bench) for bench in benches]
    simulations = _Simulations(fixed, benches, loads, progress)
    nominal = _Nominal(simulations.series, simulations.repeats(setup.name))
    search = _Search(simulations, nominal, candidates)
    explained, residual = search.alone(), search.residual
    best, rivals = search.together(explained)
    if best:
        _refined(explained, best, residual)
    several = best if best and len(best.candidates) > 1 else None
    named = several is not None or (best is not None and _counts(explained[0], residual))
    further = None
    if best and named and rivals and not simulations.series.outside:
        sets = [list(zip(one.candidates, map(float, one.changes))) for one in (best, *rivals)]
        further = proposed(fixed, sets, _following(fixed, nominal.noise))
    notes += search.notes
    if explained:
        notes += _scales(benches, nominal)
        _alike(explained, search.effects, search.scatter)
    overlays = [
        simulations.series.overlay(n, [one[n] for one in nominal.repeats])
        for n in range(len(benches))
    ]
    return Comparison(
        setup, benches, notes, nominal.differences(), explained, named, several,
        rivals if named else [], further, residual, overlays,
    )  # fmt: skip


def _following(setup: Setup, noise: dict[str, float]) -> Follow:
    """Simulations with other changes that follow another recording, in the noises of this one."""

    def follow(one: Bench, loads: Load, explanations: Sequence[Changes]) -> list[np.ndarray]:
        simulations = _Simulations(setup, [one], loads, None)

        def seen(changes: Changes, late: int) -> np.ndarray:
            found = simulations.simulate([(c, x) for c, x in changes if not c.shaft_only], late)
            if isinstance(found, str):
                raise NotSimulated(found)
            shaft = sum(
                (simulations.series.shaft(c.name) * x for c, x in changes if c.shaft_only), 0.0
            )
            values = {name: found[0][name] for name in noise}
            values[SHAFT] = values[SHAFT] - shaft
            return np.nan_to_num(
                np.concatenate([np.ravel(values[name] / noise[name]) for name in noise])
            )

        return [seen(changes, late) for late, changes in enumerate(explanations)]

    return follow


def _place(setup: Setup, bench: Bench, loads: Load, runs: Sequence[Replay]) -> int:
    """The place of the samples in the period of the slow loop, in fast periods after the earliest:
    the most likely one. Where the torque follows its reference at once, a wrong place looks like
    another machine. The ripple tells the place: it is what changes from sample to sample, and the
    parameters that are looked for hardly move it."""
    series = _Series(setup, [bench], loads)

    def unlikely(place: int) -> float:
        nominal = _Nominal(series, [[series.simulated(0, run, place)] for run in runs])
        ripples = [d for d in nominal.differences() if d.name in RIPPLES]
        return sum(d.values * (d.ratio**2 + 2 * np.log(d.noise)) for d in ripples)

    return min(range(bench.places), key=unlikely) if bench.places > 1 else 0


def _scales(benches: Sequence[Bench], nominal: _Nominal) -> list[str]:
    """Causes of a factor between the currents of bench and simulation."""
    name = "current amplitude"
    if name not in nominal.used:
        return []
    used = nominal.used[name]
    bench = nominal.series.stacked(nominal.series.bench, name)[used]
    factor = float(np.sqrt(np.mean(bench**2) / np.mean(nominal.mean[name][used] ** 2)))
    if 1 / SCALE < factor < SCALE:
        return []
    return [
        f"the currents are {factor:.3g} times the simulation's: check the probes' scale (--map), "
        "then the load (--load)"
    ]


def _alone(
    candidate: Candidate,
    effect: np.ndarray,
    noise: float,
    residual: np.ndarray,
) -> Explanation:
    """The share that one parameter explains, if the simulation is linear in it."""
    size = float(effect @ effect)
    found = Explanation(candidate)
    if size <= 0:
        return found
    change = float(effect @ residual) / size
    found.change = min(max(change, candidate.low), candidate.high)
    rest = residual - effect * found.change
    found.left = float(rest @ rest) / float(residual @ residual)
    # Part of the effect is the scatter of the simulations that it was found from.
    if size > 2 * noise:
        found.deviation = 1 / np.sqrt(size - noise)
        found.deviation *= max(1.0, np.sqrt(float(rest @ rest) / len(rest)))
        found.seen_from = np.sqrt(NAMED) * found.deviation
    return found


def _refined(explained: list[Explanation], found: joint.Set, residual: np.ndarray) -> None:
    """The parameter that explains it alone, from its corrected simulations; the first from now
    on."""
    if len(found.candidates) > 1:
        return
    first = next(one for one in explained if [one.candidate] == found.candidates)
    explained.remove(first)
    explained.insert(0, first)
    if not first.candidate.shaft_only:
        first.change, first.deviation = float(found.changes[0]), float(found.deviations[0])
        first.left = found.squared / float(residual @ residual)


def _counts(found: Explanation, residual: np.ndarray) -> bool:
    """Whether it explains more than chance would."""
    total = float(residual @ residual)
    rest = max(1.0, found.left * total / len(residual))
    return (1 - found.left) * total > NAMED * rest


def _alike(
    explained: list[Explanation], effects: dict[str, np.ndarray], scatter: dict[str, float]
) -> None:
    def size(name: str) -> float:
        return float(np.sqrt(max(0.0, effects[name] @ effects[name] - scatter[name])))

    best = explained[0].candidate.name
    one = effects[best]
    for other in explained[1:]:
        name = other.candidate.name
        if not np.isfinite(other.seen_from):
            continue
        sizes = size(best) * size(name)
        correlation = float(one @ effects[name]) / sizes if sizes > 0 else 0.0
        if abs(correlation) >= ALIKE:
            explained[0].like[name] = max(-1.0, min(1.0, correlation))


class _Nominal:
    """The simulation as the set-up has it: its mean and its scatter."""

    def __init__(self, series: _Series, repeats: list[list[dict[str, np.ndarray]]]) -> None:
        self.series, self.repeats = series, repeats
        self.mean: dict[str, np.ndarray] = {}
        self.noise: dict[str, float] = {}
        self.used: dict[str, np.ndarray] = {}
        #: The bench is a single one, the mean is of some.
        self.more = np.sqrt(1 + 1 / len(repeats))
        for name in series.names:
            bench = series.stacked(series.bench, name)
            all_of = np.array([series.stacked(one, name) for one in repeats])
            self.mean[name] = all_of.mean(axis=0)
            used = np.isfinite(bench) & np.isfinite(self.mean[name])
            if not used.any():
                continue
            variance = float(np.mean(all_of.var(axis=0, ddof=1)[used]))
            size = float(np.sqrt(np.mean(bench[used] ** 2)))
            floor = FLOOR * size
            if series.outside:
                floor = series.probe_floor(name, self.mean[name][used])
            noise = float(self.more * np.sqrt(variance + floor**2))
            if noise > 0:  # 0 on the bench and in the simulation says nothing
                self.used[name], self.noise[name] = used, noise
        speed = np.concatenate([series.stacked(one, SHAFT_NOISE) for one in repeats])
        if SHAFT in self.noise:
            self.noise[SHAFT] = float(np.hypot(self.noise[SHAFT], np.sqrt(np.mean(speed**2))))

    def differences(self) -> list[Difference]:
        found = []
        for name, used in self.used.items():
            bench = self.series.stacked(self.series.bench, name)
            off = (bench - self.mean[name])[used]
            rms, size = (float(np.sqrt(np.mean(v**2))) for v in (off, bench[used]))
            found.append(Difference(name, rms, self.noise[name], size, int(used.sum())))
        return found

    def whitened(self, of_benches: list[dict[str, np.ndarray]]) -> np.ndarray:
        """Difference from the mean, in expected noises. A value that a changed simulation lacks
        says nothing."""
        parts = [
            ((self.series.stacked(of_benches, name) - self.mean[name]) / self.noise[name])[used]
            for name, used in self.used.items()
        ]
        return np.nan_to_num(np.concatenate(parts))

    @property
    def groups(self) -> list[slice]:
        """The places of each quantity's values."""
        ends = list(itertools.accumulate(int(used.sum()) for used in self.used.values()))
        return [slice(begin, end) for begin, end in zip([0, *ends], ends)]

    @property
    def blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """The number of each value's quantity and of its window. The windows of a quantity have
        its systematic error in common; quantities of a window have its ripple in common."""
        quantities = [np.full(int(used.sum()), n) for n, used in enumerate(self.used.values())]
        windows_of = [np.nonzero(used)[0] for used in self.used.values()]
        return np.concatenate(quantities), np.concatenate(windows_of)

    def effect(self, of_benches: list[dict[str, np.ndarray]]) -> np.ndarray:
        """The same of a changed simulation, 0 for the quantities that only scatter."""
        moved = self.whitened(of_benches)
        for own in self.groups:
            part = moved[own]
            if np.mean(part**2) < 1 + VISIBLE * np.sqrt(2 / len(part)):
                part[:] = 0.0
        return moved

    def shaft_effect(self, name: str) -> np.ndarray:
        """The effect of more inertia, friction or load. The recorded speed then needs more torque:
        the bench's value rises, and the residual falls."""
        found = []
        for quantity, used in self.used.items():
            values = np.zeros_like(self.mean[quantity])
            if quantity == SHAFT:
                values = -self.series.shaft(name)
            found.append((values / self.noise[quantity])[used])
        return np.concatenate(found)
