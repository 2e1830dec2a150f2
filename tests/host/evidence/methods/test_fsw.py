"""The firmware's schemes at equal switching frequency: fronts and verdicts."""

import numpy as np
import pytest

from hexatorque import firmware
from hexatorque.evidence.methods import fsw, judging, pictures
from hexatorque.evidence.methods.methods import variants
from hexatorque.evidence.methods.places import QUICK, Place
from hexatorque.evidence.papers.engine.job import Job

TABLES = list(firmware.table_schemes())


@pytest.mark.parametrize("count", [1, 2, 5, 30])
def test_envelope_is_the_best_within_each_budget(count):
    # Few different values, so that some are equal.
    f, v = np.random.default_rng(count).integers(1, 10, (2, count)) / 2
    corners_f, corners_v = pictures.envelope(f, v)
    for budget in [*f, f.min(), 10.0]:
        best = v[f <= budget].min()
        assert corners_v[np.searchsorted(corners_f, budget, "right") - 1] == best
    assert (np.diff(corners_f) > 0).all() and (np.diff(corners_v) < 0).all()


@pytest.fixture
def figure(unequal, tmp_path):
    return fsw.fsw(Job(True, tmp_path))


def test_the_verdicts_compare_one_setting_of_ours_with_the_best_of_each_table(figure):
    assert [at["point"] for at in figure.metrics["points"]] == [place.name for place in QUICK]
    for at in figure.metrics["points"]:
        best = [at["best"][name]["td_Nm"]["3000"] for name in TABLES]
        lowest = min(row["td_Nm"] for row in best if row)
        ours = at["ours"]["db-dtfc κ=0"]
        assert ours["td_ratio"] == pytest.approx(ours["td_Nm"] / lowest)
        assert ours["f_sw_Hz"] <= 3000
    words = {v.what.split(" over")[0]: v.verdict for v in figure.verdicts}
    # Ours has half the Td and nine tenths of the THD at the same f_sw: 0.5 is missed, 1 is met.
    assert words["db-dtfc κ=0: THD∞"] == "differs"
    missed = next(v for v in figure.verdicts if v.verdict == "differs")
    assert all(name in missed.why for name in (place.name for place in QUICK))
    assert figure.verdicts[0].ours.count("points")


def test_the_reason_names_the_point_and_the_scheme_that_wins():
    def row(td, thd, f_isr=1e4):
        return {"f_sw_Hz": 2e3, "f_isr_Hz": f_isr, "td_Nm": td, "thd_inf_pct": thd,
                "ixy_rms_A": 1, "loss_W": 1, "flux_Wb": 0.3}  # fmt: skip

    ours = {f"db-dtfc {kind}": [row(0.9, 0.4)] for kind in ("κ=0", "κ=1", "free")}
    at = judging.At(
        Place("paper-b", 1000, 1),
        {"dtc1": [row(1.0, 30), row(0.5, 20, 5e4)], "ddr": [row(2.0, 1.0)], **ours},
    )
    td0, thd0, td1, thd1, *_ = fsw._verdicts([at])
    assert td0.verdict == "differs" and "B 1000 r/min 1 N m: 1.80 × dtc1" in td0.why
    assert thd0.verdict == "match" and "geometric mean 0.40" in thd0.ours
    # κ = 1 is compared with what is sampled at 20 kHz at most.
    assert td1.verdict == "differs" and "0.90 × dtc1" in td1.why
    assert thd1.verdict == "match"


def test_recording_and_pictures(figure, tmp_path):
    rec = figure.recordings[""]
    tried = sum(sum(v.quick.rounds) + v.quick.cover for v in variants())
    assert 0 < len(rec) <= tried * len(QUICK)
    assert set(np.unique(rec["point"])) == {0, 1, 2}
    points = fsw.measured(Job(True, tmp_path))  # kept by the figure
    fsw.draw(points[1:], tmp_path / "fronts.png")
    for name in ("fronts.png", "fronts-ratios.png"):
        assert (tmp_path / name).stat().st_size > 15_000
