"""A bench beside its simulation with machines of other kinds and windings: magnets, and sets 0 and
60 degrees apart. The benches are simulations whose machine is not the set-up's. The controller
believes the set-up. What is said for sure has to be true; what is off has to be named, or to be one
of the explanations that the recording does not tell apart."""

import drawn_benches
import numpy as np
import pytest
from campaigns import part
from drawn_benches import MAGNETS, WINDINGS, explanations
from scipy.stats import binom

from hexatorque import setups
from hexatorque.plant import vsd
from hexatorque.plant.machines import MODELS, parameters_of
from hexatorque.plant.vsd import PHASES
from hexatorque.recording.recording import RecordingError
from hexatorque.twin import bench, candidates, fit, further, joint, quantities, report, wiring

#: Kind of machine, how many errors it has, number of the draw.
DRAWN = [
    *((name, count, seed) for seed in range(11) for count in (1, 2, 3) for name in MAGNETS),
    *((name, count, seed) for seed in range(2) for count in (1, 2, 3) for name in WINDINGS),
]
HEALTHY = [(name, seed) for seed in range(10) for name in (*MAGNETS, *WINDINGS)]
#: An error is large if it is so many times what the comparison says it would see.
LARGE = 1.25


def compared(drawn):
    return fit.compare(drawn.setup, [drawn.bench()], drawn.loads)


def judged(name, count, seed):
    """Whether something untrue is said for sure; whether the large errors, and no others, are one
    of the explanations."""
    drawn = drawn_benches.draw(name, count, seed)
    found = compared(drawn)
    seen_from = {one.candidate.name: one.seen_from for one in found.explanations}
    sets = explanations(found)
    large = {n for n, x in drawn.changes.items() if abs(x) > LARGE * seen_from[n]}
    right = any(large <= set(one) <= set(drawn.changes) for one in sets)
    assert not found.rivals or "does not tell apart" in report.verdict(found)[0]
    return not found.sure <= set(drawn.changes), right or not (large or sets)


def most(share, cases):
    """So many of the cases; of a part of them what chance makes of it in 19 of 20 parts."""
    whole = len(cases) == len(DRAWN)
    return share * len(cases) if whole else binom.ppf(0.95, len(cases), share)


def test_nothing_untrue_is_sure_and_what_is_off_is_among_the_explanations():
    cases = part(DRAWN, 2)
    verdicts = {case: judged(*case) for case in cases}
    untrue = [case for case, (wrong, _) in verdicts.items() if wrong]
    missed = [case for case, (_, right) in verdicts.items() if not right]
    assert len(untrue) <= most(0.05, cases), untrue
    assert len(missed) <= most(0.10, cases), missed


@pytest.mark.parametrize("name, seed", part(HEALTHY, 1))
def test_nothing_is_accused_where_nothing_is_wrong(name, seed):
    found = compared(drawn_benches.draw(name, 0, seed))
    assert not found.named and not found.differs, report.verdict(found)


def test_a_rotor_aligned_by_the_drive_needs_no_time_in_the_simulation():
    """However long the bench's rotor swung: the simulation's stands, its angle known."""
    plain = setups.load("magnet-surface")
    assert plain.parameter("rotor_start") == "align"
    recording, loads = drawn_benches.recorded(plain, {})
    one = bench.make(recording, "bench", plain)
    assert one.begins
    fixed = bench.as_the_board(plain, [one], [])
    assert fixed.parameter("rotor_start") == "known"
    found = fit.compare(plain, [one], loads, [])
    assert not found.differs, [d.name for d in found.differences if d.differs]


# -- by formulas: the effects are given ----------------------------------------------------------

#: 20 quantities of 20 values.
VALUES, QUANTITY = 400, np.arange(400) // 20


def searched(effects, truth, curved=0.0, noise=1.0):
    """A search whose simulation has these effects and their squares, and a bench of this truth."""
    rng = np.random.default_rng(7)
    bends = {
        c: curved * np.linalg.norm(e) * rng.normal(size=VALUES) / 20 for c, e in effects.items()
    }

    def simulate(changes, late):
        moved = sum((effects[c] * x + bends[c] * x * abs(x) for c, x in changes), np.zeros(VALUES))
        return moved + 0.5 * np.random.default_rng(late).normal(size=VALUES), moved

    residual = simulate(truth, 99)[0] + noise * rng.normal(size=VALUES)
    search = joint.Search(effects, dict.fromkeys((c.name for c in effects), 0.0), residual,
                          [QUANTITY], simulate)  # fmt: skip
    first = max(effects, key=lambda c: abs(effects[c] @ residual) / np.linalg.norm(effects[c]))
    return search.best([first]), search.rivals


def of_magnets(*names):
    every = candidates.suitable(setups.load("magnet-surface"), False, True)
    return [next(c for c in every if c.name == name) for name in names]


@pytest.mark.parametrize("apart, told", [(1.0, False), (20.0, True)])
def test_what_explains_as_well_is_a_rival(apart, told):
    """Two effects that differ by so many noises at the true change."""
    rng = np.random.default_rng(3)
    true, other, third = of_magnets("psi_f", "V_dc sensor's gain", "L_q")
    common, own, more = (v / np.linalg.norm(v) for v in rng.normal(size=(3, VALUES)))
    effects = {true: 1000 * common, other: 1000 * common + apart / 0.1 * own, third: 1000 * more}
    best, rivals = searched(effects, [(true, 0.1)])
    sets = [best.names, *(one.names for one in rivals)]
    assert {true.name} in sets
    assert ({other.name} in sets) is not told
    assert len(sets) == 1 if told else len(sets) == 2


def test_the_search_finds_what_the_effects_from_afar_do_not_show():
    """With half of each effect bent, the pair that explains most by the effects at the set-up is
    another one than the true one."""
    rng = np.random.default_rng(11)
    some = of_magnets("R_s", "psi_f", "L_d", "L_q", "L_xy", "dead time", "device drops")
    base = rng.normal(size=VALUES)
    effects = {c: 40 * (base + rng.normal(size=VALUES)) for c in some}
    truth = [(some[1], 0.4), (some[3], -0.5)]
    best, rivals = searched(effects, truth, curved=0.5)
    assert best.names == {"psi_f", "L_q"} and not rivals
    for c, x, s in zip(best.candidates, best.changes, best.deviations):
        assert abs(x - dict(truth)[c]) < 4 * s


def test_the_recording_that_tells_most_is_proposed():
    """The nearest of the others counts. Two simulations are as far apart as their noises anyway."""
    setup = drawn_benches.set_up("magnet-surface", np.random.default_rng(1))
    rng, asked = np.random.default_rng(5), []
    apart = dict(zip(further.COURSES, ((3, 90), (20, 60), (4, 4), (0, 200))))

    def follow(one, loads, explanations):
        asked.append(loads)
        size = 200
        own, again = rng.normal(size=(2, size))
        return [
            own,
            again,
            *(rng.normal(size=size) + far / np.sqrt(size) for far in apart[one.label]),
        ]

    course, deviations = further.proposed(setup, [[], [], []], follow)
    assert course == list(further.COURSES)[1] and deviations == pytest.approx(20, rel=0.15)
    assert len(asked) == len(further.COURSES)
    assert all(loads[0] == (float("-inf"), 0.0) and len(loads) == 3 for loads in asked)


# -- kinds and windings are data ----------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_a_kind_has_constants_and_quantities_that_exist(model):
    kind = parameters_of(model)
    known = {field.name for field in kind.__dataclass_fields__.values()}
    assert all(set(one.keys) <= known for one in kind.MAY_DIFFER)
    of_kind = {n for n, one in quantities.QUANTITIES.items() if one.about == quantities.OF_MACHINE}
    assert set(kind.TELLS) <= of_kind


@pytest.mark.parametrize("displacement_deg", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("order", [5, 7])
def test_the_harmonic_of_the_phases_is_seen_in_one_plane(displacement_deg, order):
    """Currents by their definition, phase by phase: fundamental of 5 A, harmonic of 0.3 A."""
    at = 2 * np.pi * 50 * np.arange(0, 0.4, 1e-4)
    phases = {
        f"i_{phase}_A": 5 * np.cos(at - axis) + 0.3 * np.cos(order * (at - axis))
        for phase, axis in wiring.axes_rad(displacement_deg).items()
    }
    flux = 0.5 * np.exp(1j * at)
    samples = {**phases, "psi_alpha_Wb": flux.real, "psi_beta_Wb": flux.imag}
    which = np.arange(len(at)) // 1000
    found = quantities.compute(samples, which, 2, displacement_deg)
    plane = "x-y" if displacement_deg == 30 else "alpha-beta"
    own = {n: v for n, v in found.items() if n.endswith("harmonics 5, 7")}
    assert list(own) == [f"{plane} harmonics 5, 7"]
    (values,) = own.values()
    fifth, seventh = np.hypot(values[:, 0], values[:, 1]), np.hypot(values[:, 2], values[:, 3])
    assert (fifth if order == 5 else seventh) == pytest.approx(0.3, rel=1e-3)
    assert (seventh if order == 5 else fifth) == pytest.approx(0, abs=1e-3)
    assert np.abs(found["unbalance"]).max() < 1e-3


@pytest.mark.parametrize("displacement_deg", [0.0, 60.0])
def test_phases_are_checked_for_every_winding(displacement_deg):
    at = 2 * np.pi * 20 * np.arange(0, 0.5, 1e-4)
    axes = wiring.axes_rad(displacement_deg)
    phases = {phase: 5 * np.cos(at - axes[phase]) for phase in PHASES}
    assert wiring.check(phases, 1e4, None, displacement_deg) == []
    phases["u1"], phases["w1"] = phases["w1"], phases["u1"]
    with pytest.raises(RecordingError, match="i_u1_A is not phase u1"):
        wiring.check(phases, 1e4, None, displacement_deg)


@pytest.mark.parametrize("displacement_deg", [0.0, 30.0, 60.0])
def test_a_pure_fundamental_has_no_other_harmonics(displacement_deg):
    """Whatever part of a turn a window has more than whole ones."""
    step_s, n = 1e-3, 800
    angle = 2 * np.pi * 23.7 * step_s * np.arange(n) + 0.4
    ab = 5.0 * np.exp(1j * (angle + 0.3))
    phases = 3 * np.array([ab.real, ab.imag]).T @ vsd.transform(displacement_deg)[:2]
    samples = {f"i_{p}_A": phases[:, k] for k, p in enumerate(PHASES)}
    samples |= {"psi_alpha_Wb": np.cos(angle), "psi_beta_Wb": np.sin(angle)}
    found = quantities.compute(samples, np.arange(n) // 100, 1, displacement_deg)
    order = "x-y" if displacement_deg == 30 else "alpha-beta"
    assert found["current along the flux"] == pytest.approx(5.0 * np.cos(0.3), abs=1e-9)
    for name in ("unbalance", f"{order} harmonics 5, 7"):
        assert np.abs(found[name]).max() < 1e-9
