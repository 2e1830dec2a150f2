"""Legs that are lost under a wrong belief of L_xy: what the study draws, and what it counts."""

from dataclasses import asdict

import numpy as np
import pytest

from hexatorque import firmware, setups
from hexatorque.evidence.studies import lost_phase, wrong_lxy
from hexatorque.plant.vsd import PHASES

BASE = setups.load(lost_phase.SETUP)


@pytest.fixture(scope="module")
def result():
    return wrong_lxy.study(quick=True)


def test_every_belief_has_every_loss_under_every_scheme():
    cases = wrong_lxy.cases(quick=False)
    for belief in wrong_lxy.BELIEFS:
        own = [(c.scheme, c.phase, c.kind) for c in cases if c.belief == belief]
        assert len(own) == len(set(own))
        assert set(own) == {
            (scheme, phase, kind)
            for scheme in firmware.schemes()
            for phase in PHASES
            for kind in lost_phase.BROKEN
        }
    assert len({case.seed for case in cases}) == len(cases)
    assert set(wrong_lxy.BELIEFS) == {0.7, 1.0, 1.3}


@pytest.mark.parametrize("belief", wrong_lxy.BELIEFS)
def test_the_truth_is_drawn_apart_from_the_belief(belief):
    truths = []
    for seed in range(50):
        case = wrong_lxy.Case(seed, belief, "ddr", "u1", "open")
        setup = wrong_lxy._setup(case, np.random.default_rng(seed))
        true_H = setup["machine.lxy_H"]
        assert setup.parameter("lxy_H") == pytest.approx(belief * true_H)
        truths.append(true_H / BASE["machine.lxy_H"])
    assert 0.7 <= min(truths) < 0.75 and 1.25 < max(truths) <= 1.3


def test_rows_are_counted_by_what_was_named(result):
    (_, _, lines), rows = wrong_lxy.grid(result)[0], result["rows"]
    assert sum(int(line[1].split(" of ")[1]) for line in lines) == len(rows) > 10
    for belief, right, sound, none, *_ in lines:
        own = [row for row in rows if f"{row['case']['belief']:.1f}" == belief]
        named = sum(row["outcome"] == "right" for row in own)
        assert right == f"{named} of {len(own)}"
        assert named + int(sound) + int(none) == len(own)


def test_a_right_belief_names_every_leg(result):
    own = [row for row in result["rows"] if row["case"]["belief"] == 1.0]
    assert own and {row["outcome"] for row in own} == {"right"}


def case_of(seed):
    (case,) = (c for c in wrong_lxy.cases(quick=False) if c.seed == seed)
    return case


@pytest.mark.parametrize(
    ("seed", "phase", "kind"),
    ((50_000, "u1", "open"), (50_054, "u1", "blocked"), (50_099, "v2", "blocked")),
)
def test_noise_hides_no_wrong_belief(seed, phase, kind):
    """Under dtc1 the residual is the noise's and a wrong L_xy's, before anything is lost."""
    case = wrong_lxy.Case(seed, 0.7, "dtc1", phase, kind)
    assert wrong_lxy.run(case).outcome == "right"


def test_a_belief_that_hardly_shows_names_no_sound_leg():
    """A healthy drive is stopped by no such L_xy. When a leg is lost it names another one, if it
    was not learnt before."""
    case = wrong_lxy.Case(50_171, 0.7, "dtc1", "u2", "lower")
    assert wrong_lxy.run(case).outcome == "right"


def test_a_sound_drive_that_stops_is_no_right_one(monkeypatch):
    to = lost_phase.settle_at

    def lose_before(sim, *args):
        to(sim, *args)
        sim.break_leg("w2", "open")
        sim.run(0.1, record=False)

    monkeypatch.setattr(lost_phase, "settle_at", lose_before)
    row = asdict(wrong_lxy.run(case_of(50_004)))
    assert row["outcome"] == "other" and row["error"] == "fault before the loss: phase lost"


def test_the_picture_is_drawn(result, tmp_path):
    assert wrong_lxy.plot(result, tmp_path / "x.png").stat().st_size > 10_000
