"""Figures of merit are compared with the numbers from which the recording was made."""

import json

import numpy as np
import pytest

from hexatorque.analysis import Run, metrics
from hexatorque.analysis.metrics import UNITS, flat
from hexatorque.analysis.reference import reference_values
from hexatorque.analysis.run import by_point
from hexatorque.evidence.papers.printed_values import PAPER

METRICS = [
    "speed_rpm", "torque_Nm", "torque_error_Nm", "torque_error_pct", "torque_ripple_Nm",
    "torque_ripple_td_Nm", "flux_Wb",
    "flux_ripple_Wb", "i1_A", "f1_Hz", "thd_pct", "thd_inf_pct", "h5_pct",
    "h7_pct", "ixy_rms_A", "delta_i_A", "delta_i_spread_A", "f_sw_Hz", "copper_loss_W",
    "idc_A", "idc_ripple_A",
    "conduction_loss_W", "switching_loss_W", "input_W", "shaft_W", "loss_W", "efficiency_pct",
]  # fmt: skip


@pytest.mark.parametrize("prefix", ["plant.", ""])
@pytest.mark.parametrize("offset_A", [0.0, 0.7])
def test_known_steady_state(make_recording, prefix, offset_A):
    m = metrics(
        make_recording(
            lines={5: 0.12, 7: 0.05}, offset_A=offset_A, prefix=prefix, meta={"f_sw_Hz": 2450}
        )
    )
    assert list(m) == METRICS
    assert m["speed_rpm"] == pytest.approx(2500)
    assert m["torque_Nm"] == pytest.approx(2.0)
    assert m["torque_ripple_Nm"] == pytest.approx(0.2)
    assert m["flux_Wb"] == pytest.approx(0.4)
    assert m["flux_ripple_Wb"] == pytest.approx(0.004)
    assert m["f1_Hz"] == pytest.approx(40)
    assert m["i1_A"] == pytest.approx(2.0)
    assert m["h5_pct"] == pytest.approx(12)
    assert m["h7_pct"] == pytest.approx(5)
    assert set(m["thd_pct"]) == {"1kHz", "2kHz", "5kHz", "h50"}
    for band in m["thd_pct"].values():
        assert band == pytest.approx(13)
    # The 5th and 7th are in x-y only, so |i_xy|^2 has the mean 0.24^2 + 0.1^2. A common offset is
    # zero sequence.
    assert m["ixy_rms_A"] == pytest.approx(np.hypot(0.24, 0.1))
    assert m["delta_i_A"] == pytest.approx(0, abs=1e-9)
    assert m["f_sw_Hz"] == 2450


@pytest.mark.parametrize(
    ("asked_Nm", "error_Nm", "error_pct"),
    [(2.5, -0.5, -20), (1.6, 0.4, 25), (-2.5, -4.5, -180), (0.0, 2.0, None)],
)
def test_the_mean_torque_against_its_reference(make_recording, asked_Nm, error_Nm, error_pct):
    """The mean torque is 2 N m. Less than what is asked for is negative, in either direction."""
    for sign in (1, -1):
        rec = make_recording(torque_Nm=sign * 2.0)
        rec.channels["torque_ref_Nm"] = np.full(len(rec), sign * asked_Nm)
        m = metrics(rec)
        held_Nm = sign * 2.0 if asked_Nm == 0 else error_Nm
        assert m["torque_error_Nm"] == pytest.approx(held_Nm)
        assert m["torque_error_pct"] == (error_pct and pytest.approx(error_pct))
    del rec.channels["torque_ref_Nm"]
    assert metrics(rec)["torque_error_Nm"] is metrics(rec)["torque_error_pct"] is None


@pytest.mark.parametrize("name", sorted(UNITS))
def test_a_figure_alone_is_the_same(make_recording, name):
    rec = make_recording(lines={5: 0.12}, meta={"f_sw_Hz": 2450, "samples_per_period": 12})
    alone, all_figures = (flat(metrics(rec, names=names)) for names in ((name,), UNITS))
    assert alone[name] == all_figures[name]
    assert list(alone) == list(UNITS)


def test_ripple_between_the_control_instants(make_recording):
    """A ripple at the period's own frequency: the same value at every control instant."""
    rec = make_recording(ripple_Nm=0.0, rate_Hz=120_000.0, meta={"samples_per_period": 12})
    t = np.arange(len(rec)) / rec.rate_Hz
    rec.channels["plant.torque_Nm"] = 2.0 + 0.3 * np.sqrt(2) * np.sin(2 * np.pi * 10_000 * t)
    m = metrics(rec)
    assert m["torque_ripple_Nm"] == pytest.approx(0, abs=1e-6)
    assert m["torque_ripple_td_Nm"] == pytest.approx(0.3)
    rec.meta["samples_per_period"] = 9
    assert metrics(rec)["torque_ripple_td_Nm"] is None


def test_distortion_of_all_phases_has_no_band(make_recording):
    """5 % at order 201 (8 kHz) counts, beyond the widest band of `thd_pct`; what only one phase
    has, counts by its share of the six; mean and unequal fundamentals do not count."""
    m = metrics(make_recording(lines={201: 0.05}, offset_A=0.7))
    assert m["thd_inf_pct"] == pytest.approx(5, rel=1e-3)
    assert m["thd_pct"]["5kHz"] == pytest.approx(0, abs=0.01)
    rec = make_recording(amplitude_A=(2.0, 1.0))
    assert metrics(rec)["thd_inf_pct"] == pytest.approx(0, abs=1e-6)
    rec = make_recording()
    t = np.arange(len(rec)) / rec.rate_Hz
    rec.channels["plant.i_w2_A"] += 0.6 * np.cos(2 * np.pi * 7000 * t)
    assert metrics(rec)["thd_inf_pct"] == pytest.approx(100 * 0.3 / np.sqrt(6), rel=1e-3)


def test_unequal_sets(make_recording):
    m = metrics(make_recording(amplitude_A=(2.0, 1.77)))
    assert m["delta_i_A"] == pytest.approx(0.23)
    assert m["delta_i_spread_A"] == pytest.approx(0, abs=1e-9)
    assert m["i1_A"] == pytest.approx(2.0)
    # Half the difference rotates backwards in x-y.
    assert m["ixy_rms_A"] == pytest.approx(0.115)
    assert metrics(make_recording(amplitude_A=(1.77, 2.0)))["delta_i_A"] == pytest.approx(0.23)


def test_the_spread_of_the_difference_is_that_from_window_to_window(make_recording):
    """White noise of standard deviation s on each phase gives an amplitude, from n samples under a
    Hann window, with the standard deviation s sqrt(2 * 1.5 / n). Two phases: sqrt(2) more."""
    rng, noise_A = np.random.default_rng(1), 0.5
    windows = []
    for _ in range(40):
        rec = make_recording()
        for name in ("plant.i_u1_A", "plant.i_u2_A"):
            rec.channels[name] = rec[name] + rng.normal(0.0, noise_A, len(rec))
        windows.append(metrics(rec))
    want_A = noise_A * np.sqrt(2 * 1.5 / len(rec)) * np.sqrt(2)
    spreads_A = [m["delta_i_spread_A"] for m in windows]
    assert np.sqrt(np.mean(np.square(spreads_A))) == pytest.approx(want_A, rel=0.25)


def test_reverse_rotation_has_the_same_metrics(make_recording):
    forward, backward = (
        metrics(make_recording(f1_Hz=f1_Hz, lines={5: 0.1})) for f1_Hz in (40, -40)
    )
    assert backward["f1_Hz"] == pytest.approx(40)
    assert backward["i1_A"] == pytest.approx(forward["i1_A"])
    assert backward["h5_pct"] == pytest.approx(forward["h5_pct"])


def test_true_values_are_preferred(make_recording):
    rec = make_recording(torque_Nm=2.0)
    rec.channels["torque_Nm"] = np.full(len(rec), 9.0)
    rec.channels["i_u1_A"] = np.zeros(len(rec))
    m = metrics(rec)
    assert m["torque_Nm"] == pytest.approx(2.0)
    assert m["i1_A"] == pytest.approx(2.0)


def test_switching_frequency_argument_metadata_or_none(make_recording):
    assert metrics(make_recording())["f_sw_Hz"] is None
    assert metrics(make_recording(meta={"f_sw_Hz": 1000}))["f_sw_Hz"] == 1000
    assert metrics(make_recording(meta={"f_sw_Hz": 1000}), 1100)["f_sw_Hz"] == 1100


def test_nan_and_infinity_become_none(make_recording):
    rec = make_recording(amplitude_A=(0.0, 0.0), meta={"f_sw_Hz": float("inf")})
    rec.channels["plant.speed_rpm"] = np.full(len(rec), np.nan)
    m = metrics(rec)
    assert m["speed_rpm"] is None
    assert m["h5_pct"] is None
    assert m["f_sw_Hz"] is None
    assert set(m["thd_pct"].values()) == {None}
    json.dumps(m, allow_nan=False)


def test_low_rate_leaves_high_bands_out(make_recording):
    thd = metrics(make_recording(rate_Hz=3000.0))["thd_pct"]
    assert thd["1kHz"] is not None
    assert thd["2kHz"] is None and thd["5kHz"] is None and thd["h50"] is None


@pytest.mark.parametrize("f1_Hz", [23.7, -40.0, 61.3])
def test_every_recording_of_two_whole_cycles_has_its_figures(make_recording, f1_Hz):
    """From the first sample at which it holds two cycles, to beyond the third, in steps of 0.03
    cycles. The lines are exact where the recording is cut to whole cycles once; a part of a sample
    that is cut off or left over costs some 1e-3."""
    for cycles in np.arange(2.0, 3.2, 0.03):
        samples = np.ceil(cycles * 50_000 / abs(f1_Hz) - 1e-6)
        rec = make_recording(f1_Hz=f1_Hz, duration_s=samples / 50_000, lines={5: 0.12, 7: 0.05})
        m = metrics(rec)
        assert m["i1_A"] == pytest.approx(2.0, rel=2e-3), cycles
        assert m["h5_pct"] == pytest.approx(12, abs=0.1), cycles
        assert None not in m["thd_pct"].values() and m["thd_inf_pct"] is not None, cycles


def test_too_short_is_refused(make_recording):
    with pytest.raises(ValueError, match="at least 2 are needed"):
        metrics(make_recording(duration_s=0.045))


def test_run_as_json_is_flat_and_complete(make_run):
    record = make_run().as_json()
    assert list(record) == [
        "setup", "scheme", "latency", "speed_ref_rpm", "load_Nm", *METRICS, "realtime_factor",
    ]  # fmt: skip
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["setup"] == "paper-b" and record["realtime_factor"] == 12.5


def test_run_refuses_an_unknown_latency(make_run):
    with pytest.raises(ValueError, match="none, immediate, shadow, predicted"):
        make_run(latency="late")


def test_runs_group_by_operating_point(make_run):
    runs = [make_run(), make_run(load_Nm=1.0), make_run(scheme="ddr")]
    groups = by_point(runs)
    assert list(groups) == ["paper-b: 2500 r/min, 2 N m", "paper-b: 2500 r/min, 1 N m"]
    assert [run.scheme for run in groups["paper-b: 2500 r/min, 2 N m"]] == ["fdr", "ddr"]


def test_paper_values_only_at_the_papers_point(make_run):
    run = make_run(scheme="dtc3")
    assert reference_values(PAPER, run)["torque_ripple_Nm"] == 0.1063
    assert reference_values(PAPER, make_run(scheme="dtc3", load_Nm=1.0)) == {}
    assert reference_values(PAPER, make_run(scheme="dtc3", speed_ref_rpm=500.0)) == {}
    assert reference_values(PAPER, make_run(scheme="fdr")) == {}
    assert reference_values(PAPER, make_run(setup="own")) == {}
    assert reference_values({"own": {"schemes": {"fdr": {"thd_pct": 1.0}}}}, make_run(setup="own"))
    assert isinstance(run, Run)


@pytest.mark.parametrize("skipped", [0, 1, 2, 3])
def test_ripple_is_taken_at_the_control_instants(make_recording, skipped):
    """The signal is +-0.1 N m on every fourth sample and 0 in between. Its ripple is 0.1 at the
    control instants and half of it over all samples, wherever the recording begins."""
    rec = make_recording(meta={"samples_per_period": 4})
    instants = np.arange(len(rec)) % 4 == 0
    rec.channels["plant.torque_Nm"] = 2.0 + 0.1 * instants * np.where(
        np.arange(len(rec)) % 8 == 0, 1.0, -1.0
    )
    part = rec.window(skipped / rec.rate_Hz, rec.duration_s)
    assert metrics(part)["torque_ripple_Nm"] == pytest.approx(0.1, rel=1e-3)
