"""B6: shares and lengths of DTC3's pairs follow from the lengths of their vectors."""

import numpy as np
import pytest

from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.paper_b import pairs

LARGE, MEDIUM, SMALL = (
    2 / 3 * np.cos(np.deg2rad(15)), np.sqrt(2) / 3, 2 / 3 * np.cos(np.deg2rad(75)),
)  # fmt: skip
ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
AB = np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in range(64)]) @ np.exp(1j * ANGLE) / 3


@pytest.fixture(scope="module")
def figure(job):
    return pairs.b6(job)


def test_there_are_24_pairs_at_their_angles(figure):
    found = figure.metrics["pairs"]
    assert len(found) == 24
    for name, (first, second) in found.items():
        k = int(name[3:]) - 1
        assert abs(AB[first]) == pytest.approx(LARGE if name.startswith("V_L") else SMALL)
        assert abs(AB[second]) == pytest.approx(MEDIUM)
        turn = np.exp(-1j * np.deg2rad(15 + 30 * k))
        assert np.angle(AB[[first, second]] * turn) == pytest.approx([0, 0], abs=1e-9)


def test_shares_without_xy_voltage(figure):
    """In x-y, large and small vectors exchange their lengths, and the medium-large vector opposes
    both: s LARGE' = (1 - s) MEDIUM."""
    mean = figure.metrics["mean"]
    share_l, share_s = MEDIUM / (MEDIUM + SMALL), MEDIUM / (MEDIUM + LARGE)
    assert (share_l, share_s) == pytest.approx((0.7321, 0.4226), abs=1e-4)
    assert mean["L"]["share"] == pytest.approx(share_l, abs=1 / 400)
    assert mean["S"]["share"] == pytest.approx(share_s, abs=1 / 400)
    assert mean["L"]["real"] == pytest.approx(
        share_l * LARGE + (1 - share_l) * MEDIUM, abs=1 / 400 * (LARGE - MEDIUM)
    )
    assert mean["S"]["real"] == pytest.approx(
        share_s * SMALL + (1 - share_s) * MEDIUM, abs=1 / 400 * (MEDIUM - SMALL)
    )


def test_half_of_each_vector_and_both_kinds_of_mean_have_one_ratio(figure):
    mean = figure.metrics["mean"]
    assert mean["L"]["half"] == pytest.approx(0.55768, abs=1e-5)
    assert mean["S"]["half"] == pytest.approx(0.32197, abs=1e-5)
    # With both kinds of mean the ratio H_A : H_B is the same.
    assert mean["S"]["half"] / mean["L"]["half"] == pytest.approx(1 / np.sqrt(3), rel=1e-9)
    assert mean["S"]["real"] / mean["L"]["real"] == pytest.approx(1 / np.sqrt(3), rel=5e-3)


@pytest.mark.parametrize("rpm", [500, 1500, 2500])
def test_shares_of_the_runs_from_their_recordings(figure, rpm):
    rec = figure.recordings[str(rpm)]
    length = abs(AB[rec["word"]])
    for name, level, long in (("L", 2, LARGE), ("S", 1, SMALL)):
        asked = length[abs(rec["torque_level"]) == level]
        share = np.mean(abs(asked - long) < 1e-6)
        assert np.isin(np.round(asked, 6), np.round([long, MEDIUM], 6)).mean() > 0.999
        assert figure.metrics["running"][f"{rpm} r/min"][name] == pytest.approx(share)


def test_verdicts_agree_with_the_paper_but_for_the_shares(figure):
    assert not any(v.broken for v in figure.verdicts)
    shares = [v for v in figure.verdicts if "one pair repeated" in v.what and v.paper == 50]
    assert [v.verdict for v in shares] == ["differs", "differs"]


def test_a_choice_that_feeds_the_xy_flux_breaks_the_verdicts(tmp_path, monkeypatch):
    right = pairs.Law.words
    monkeypatch.setattr(
        pairs.Law, "words", lambda law, s, level, up, psi=0j: right(law, s, level, up, -psi)
    )
    assert any(v.broken for v in pairs.b6(Job(True, tmp_path)).verdicts)


def test_picture(figure, tmp_path):
    assert figure.draw(tmp_path / "figure.png").stat().st_size > 30_000
