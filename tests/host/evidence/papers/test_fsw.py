"""Comparison at equal switching frequency: the search, its memory, and the verdicts."""

import numpy as np
import pytest

from hexatorque import firmware
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.fsw import bench, comparison, judging, pictures, search, sweep
from hexatorque.evidence.papers.fsw.points import PLACES, QUICK, Place, setup_of

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


def test_twenty_points_on_two_machines_in_all_quadrants():
    assert len(PLACES) == len(set(PLACES)) == 20
    assert {place.setup for place in PLACES} == {"paper-a-feasible", "paper-b"}
    assert any(place.speed_rpm < 0 for place in PLACES)
    assert any(place.torque_Nm < 0 for place in PLACES)


def test_every_scheme_has_sixty_settings():
    for scheme in (*TABLES, "db-dtfc"):
        own = [variant.extent for variant in search.variants() if variant.scheme == scheme]
        assert sum(extent.cover + sum(extent.rounds) for extent in own) >= 60


def test_a_latin_hypercube_has_one_setting_in_each_interval():
    at = search.latin_hypercube(np.random.default_rng(1), 16, 4)
    for axis in at.T:
        assert sorted((16 * axis).astype(int)) == list(range(16))


@pytest.mark.parametrize("variant", search.variants(), ids=lambda variant: variant.name)
def test_the_firmware_takes_every_corner(variant):
    place = PLACES[1]
    base = setup_of(place)
    for corner in (np.zeros(len(variant.axes)), np.ones(len(variant.axes))):
        values = search.controller_values(variant, base, corner)
        setup = bench.bench_setup(base, variant.scheme, values)
        sim = bench.SimulatedDrive(setup, search.SAMPLES)
        assert 1 / sim.period_s == pytest.approx(values["f_isr_Hz"])


def simulated(base, scheme, values, place, progress=None, window_s=0.0):
    """Replaces the simulation: Td times f_sw is constant, ours has half of it; wide bands switch
    little. Above 40 kHz the drive does not hold the point."""
    f_isr = values["f_isr_Hz"]
    if f_isr > 40e3:
        return None
    ours = scheme == "db-dtfc"
    band = values.get("torque_band_Nm", 0.5) / base.parameter("torque_band_Nm")
    f_sw = f_isr / 2 if ours else 0.2 * f_isr / band
    td = (150 if ours else 300) / f_sw
    return {
        "f_sw_Hz": f_sw, "td_Nm": td, "thd_inf_pct": 1e4 / f_sw * (0.9 if ours else 1.0),
        "ixy_rms_A": 0.1, "loss_W": 50.0, "idc_ripple_A": 1.0, "flux_Wb": 0.35,
    }  # fmt: skip


@pytest.fixture
def counted(monkeypatch):
    calls = []

    def one(*arguments, **named):
        calls.append(arguments[2])
        return simulated(*arguments, **named)

    monkeypatch.setattr(bench, "measure", one)
    return calls


def test_a_search_continues_where_it_was_interrupted(counted, tmp_path, monkeypatch):
    variant, place = search.variants()[0], PLACES[0]
    whole = sweep.settings(Job(False, tmp_path / "whole"), place, variant)
    settings = len(counted)
    assert settings == len(whole) == variant.extent.settings
    job = Job(False, tmp_path / "parts")

    def interrupted(*arguments, **named):
        if len(counted) > settings + variant.extent.cover:
            raise KeyboardInterrupt
        counted.append(None)
        return simulated(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(bench, "measure", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep.settings(job, place, variant)
    counted.clear()
    assert sweep.settings(job, place, variant) == whole
    assert len(counted) == sum(variant.extent.rounds)  # the first round was kept
    assert sweep.settings(job, place, variant) == whole
    assert len(counted) == sum(variant.extent.rounds)


def test_the_refinement_comes_closer_to_the_limit(counted, tmp_path):
    """Td times f_sw is constant, so the best setting is the one nearest to the limit."""
    variant = search.variants()[0]
    rows = sweep.settings(Job(False, tmp_path), PLACES[0], variant)
    first = search.best(sweep.held(rows[: variant.extent.cover]), "td_Nm", 3e3)
    last = search.best(sweep.held(rows), "td_Nm", 3e3)
    assert first["td_Nm"] > last["td_Nm"] >= 0.1
    slow = search.best(sweep.held(rows), "td_Nm", 3e3, search.SLOW_HZ)
    assert slow["f_isr_Hz"] <= search.SLOW_HZ and slow["td_Nm"] >= last["td_Nm"]


@pytest.fixture
def figure(counted, tmp_path):
    return comparison.fsw(Job(True, tmp_path))


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
    td0, thd0, td1, thd1, *_ = comparison._verdicts([at])
    assert td0.verdict == "differs" and "B 1000 r/min 1 N m: 1.80 × dtc1" in td0.why
    assert thd0.verdict == "match" and "geometric mean 0.40" in thd0.ours
    # κ = 1 is compared with what is sampled at 20 kHz at most.
    assert td1.verdict == "differs" and "0.90 × dtc1" in td1.why
    assert thd1.verdict == "match"


def test_recording_and_pictures(figure, tmp_path):
    rec = figure.recordings[""]
    tried = sum(sum(v.quick.rounds) + v.quick.cover for v in search.variants())
    assert 0 < len(rec) <= tried * len(QUICK)
    assert set(np.unique(rec["point"])) == {0, 1, 2}
    points = comparison.measured(Job(True, tmp_path))  # kept by the figure
    for draw, path in ((pictures.fronts, "fronts.png"), (pictures.ratios, "ratios.png")):
        draw(points[:1], tmp_path / path)
        assert (tmp_path / path).stat().st_size > 15_000


def test_a_drive_that_does_not_hold_the_point_is_left_out():
    place = Place("paper-b", 4100, 6.0)
    values = search.controller_values(search.variants()[0], setup_of(place), np.full(3, 0.4))
    assert bench.measure(setup_of(place), "dtc1", values, place, window_s=0.05) is None
