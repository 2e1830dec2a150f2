"""A2: the pulses in the recording agree with S1 S2 S3 and the action points."""

import numpy as np
import pytest

from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.paper_a import sequences

PHASES = ("u1", "u2", "w1", "w2", "v1", "v2")
SAMPLES = 200


@pytest.fixture(scope="module")
def figure(job):
    return sequences.a2(job)


def test_every_leg_follows_its_sequence(figure):
    rec = figure.recordings[""]
    patterns = len(rec) // SAMPLES
    assert patterns == 24
    instants = np.arange(SAMPLES) / SAMPLES
    for n in range(patterns):
        row = slice(n * SAMPLES, (n + 1) * SAMPLES)
        sequence, t1, t2 = (rec[name][row][0] for name in ("sequence", "t1", "t2"))
        interval = (instants >= t1).astype(int) + (instants >= t2)
        wanted = np.array([sequence >> 2, sequence >> 1 & 1, sequence & 1])[interval]
        # A sample on an edge shows the level before it.
        clear = np.minimum(abs(instants - t1), abs(instants - t2)) > 1e-3
        clear[0] = False
        for phase in PHASES:
            assert (rec[f"plant.leg_{phase}"][row] == wanted)[clear].all(), (n, phase)


def test_action_points_are_fixed_then_moved(figure):
    rec = figure.recordings[""]
    points = list(dict.fromkeys(zip(rec["t1"].tolist(), rec["t2"].tolist(), strict=True)))
    assert points[0] == pytest.approx((2 - np.sqrt(3), np.sqrt(3) - 1))
    assert points[1][0] < points[0][0] < points[2][0]
    assert points[1][1] < points[0][1] < points[2][1]


def verdict(figure, start):
    (found,) = [v for v in figure.verdicts if v.what.startswith(start)]
    return found


def test_hazards_invert_a_leg_and_the_firmware_keeps_them_out(figure):
    assert not any(v.broken for v in figure.verdicts)
    after = figure.metrics["level_after_hazard"]
    # At count 0 the compare event has priority, so the leg toggles from its old level.
    assert after["as printed"] == {"CA = 0": 1, "CA = CB": 1, "CA = 0, high before": 0}
    assert set(after["guarded"].values()) == {0}
    for start in ("eqs. (17), (18) at T1 = 0", "eqs. (17), (18) at T1 = T2"):
        assert verdict(figure, start).verdict == "differs"


def test_jumps_at_period_boundaries_count(figure):
    """In VV_L1 = 771004 the legs w1 and v2 jump inside the period, so they jump back at its end.
    These are 4 jumps in 100 us, over six legs, and a cycle of a switch has 2 jumps."""
    assert verdict(figure, "at most one jump").verdict == "differs"
    f_sw = verdict(figure, "switching frequency").ours
    assert f_sw == pytest.approx(4 / (2 * 6) / 100e-6 / 1e3)


def test_wrong_registers_break_the_verdict(tmp_path, monkeypatch):
    right = sequences.pattern

    def late(words, t1, t2):
        """One register is two counts late."""
        compare = right(words, t1, t2)
        compare.ca[3] += 2 * (compare.ca[3] < 15000)
        return compare

    monkeypatch.setattr(sequences, "pattern", late)
    assert any(v.broken for v in sequences.a2(Job(True, tmp_path)).verdicts)


def test_picture(figure, tmp_path):
    assert figure.draw(tmp_path / "figure.png").stat().st_size > 30_000
