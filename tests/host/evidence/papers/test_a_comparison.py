"""Paper A's Table IV and Fig. 15: the verdicts are tested on made-up numbers, the mechanisms on
real runs."""

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.papers.paper_a import common, sweeps, table4, what_if
from hexatorque.experiments.operating_points import Point


def test_leakage_sets_the_torque_step_and_with_it_the_switching(job):
    """dT = 3 p psi v T_s / (sigma L_s), minus the effect of the flux's rotation, is inversely
    proportional to the leakage. If it fits into the band, the comparator needs no opposite vector,
    and the legs switch much less."""
    runs = job.runs(
        [Point(common.setup("fdr", **what_if.machine(f, 0.0)), 100.0, 10.0) for f in (1, 1.5)]
    )
    steps = [what_if.torque_step_Nm(run.recording) for run in runs]
    ratio = np.divide(*(
        common.setup("fdr", **what_if.machine(f, 0.0)).parameter("sigma_ls_H") for f in (1.5, 1)
    ))  # fmt: skip
    assert steps[0] / steps[1] == pytest.approx(ratio, rel=0.1)
    most = 3 * 2 * 0.6 * 0.5977 * 250 * 1e-4 / setups.load(common.SETUP).parameter("sigma_ls_H")
    assert 0.6 * most < steps[0] < most
    opposite = []
    for run in runs:
        level = run.recording["torque_level"][::4]
        opposite.append(np.mean((level[:-1] == 1) & (level[1:] == -1)))
    assert opposite[0] > 0.15 and opposite[1] < 0.05
    assert runs[1].metrics["f_sw_Hz"] < 0.6 * runs[0].metrics["f_sw_Hz"]


def test_drops_feed_the_fifth_which_ddr_takes_out(job):
    with_drops = what_if.machine(1.0, 1.2)
    assert with_drops["machine__lls_H"] == setups.load(common.SETUP)["machine.lls_H"]
    fdr, ddr = job.metrics(
        [Point(common.setup(s, **with_drops), 100.0, 10.0) for s in ("fdr", "ddr")]
    )
    assert fdr["h5_pct"] > 5.5 and ddr["h5_pct"] < 1.2
    assert ddr["thd_pct"]["1kHz"] < 0.85 * fdr["thd_pct"]["1kHz"]


def test_pure_voltage_model_needs_rs_only(job, monkeypatch):
    assert table4._only_rs(job) == ["fdr", "ddr"]
    # The check can fail: the one-step prediction needs sigma L_s.
    real = common.setup
    monkeypatch.setattr(
        common,
        "setup",
        lambda scheme, **changes: real(scheme, **{**changes, "timing__latency": "predicted"}),
    )
    assert table4._only_rs(job) == []


class Made:
    """Stands for a run. Only its metrics are used."""

    def __init__(self, **metrics):
        thd = {band: metrics.pop("thd") for band in common.BANDS[:1]}
        thd = dict.fromkeys(common.BANDS, thd["1kHz"])
        self.metrics = {"thd_pct": thd, "torque_ripple_Nm": 0.8, "flux_ripple_Wb": 0.008, **metrics}
        self.recording = None


@pytest.fixture
def verdicts_of(monkeypatch):
    monkeypatch.setattr(table4, "why_fsw", lambda *_: "f_sw reason")
    monkeypatch.setattr(table4, "why_thd", lambda *_: "THD reason")
    eta = {"eta_fdr_pct": 92.8203, "eta_min_pct": 90.8965, "eta_max_pct": 96.6105}
    gain = {what_if.GAIN: {"ddr": {"delta_i_A": 0.03}}}

    def make(fdr, ddr):
        rows = table4._verdicts({"fdr": [Made(**fdr)], "ddr": [Made(**ddr)]}, gain, eta)
        return {v.what: v for v in rows}

    return make


def test_table4_required_claims_can_fail(verdicts_of):
    fdr = {"f_sw_Hz": 2450.0, "delta_i_A": 0.2366, "thd": 12.44}
    good = verdicts_of(fdr, {"f_sw_Hz": 2480.0, "delta_i_A": 0.0309, "thd": 8.13})
    assert not any(v.broken for v in good.values())
    assert good["f_sw, DDR-DTC"].verdict == "match"
    bad = verdicts_of(fdr, {"f_sw_Hz": 2600.0, "delta_i_A": 0.05, "thd": 12.5})
    assert {what for what, v in bad.items() if v.broken} == {
        "ΔI falls by 7 times or more",
        "f_sw equal within 3%",
        *(f"THD falls, {name}" for name in common.BAND_NAMES.values()),
    }
    assert bad["THD of i_u1, 5 kHz, DDR-DTC"].verdict == "worse"
    assert bad["THD of i_u1, 5 kHz, DDR-DTC"].why == "THD reason"
    assert bad["ΔI, DDR-DTC"].verdict == "worse"


def test_reasons_quote_what_was_found(job):
    row = {"f_sw_Hz": 2000.0, "h5_pct": 4.0, "5kHz": 9.0, "delta_i_A": 0.1}
    found = {
        (f, v): {s: {**row, "f_sw_Hz": 3000.0 / f} for s in common.SCHEMES}
        for v in what_if.DROPS_V
        for f in what_if.LEAKAGES
    }
    found["table 45/135"] = {s: {**row, "f_sw_Hz": 2710.0} for s in common.SCHEMES}
    [run] = job.runs([Point(common.setup("fdr"), 100.0, 10.0)])
    text = what_if.why_fsw(found, run.recording)
    assert "2.50 kHz at 1.2 times" in text and "table 45/135 2.71" in text
    assert f"{what_if.torque_step_Nm(run.recording):.2f} N m" in text
    assert "9.0 → 9.0 %" in what_if.why_thd(found)


def sweep(job):
    return sweeps._sweep(job, (100.0,), (0.0, 10.0), sweeps.SCHEMES, 1)


def test_sweep_at_one_speed(job):
    """Three vectors a period switch more than one. At 100 r/min DDR's THD is lower than FDR's."""
    middle, spread = found = sweep(job)
    for load in (0.0, 10.0):
        fsw = {s: middle["f_sw_Hz"][load, s][0] for s in sweeps.SCHEMES}
        assert fsw["ddr"] == pytest.approx(fsw["fdr"], rel=0.03)
        assert 1.05 * fsw["dtc1"] < fsw["fdr"] < 5000
        assert spread["f_sw_Hz"][load, "ddr"][0] == 0
    rows = sweeps._verdicts(found, found, (100.0,), (0.0, 10.0))
    assert {v.verdict for v in rows} == {"match", "not printed"}


def made_up_sweep(**rows):
    speeds = 3
    names = ("f_sw_Hz", "ixy_rms_A", "h5_pct", "delta_i_A", *common.BANDS)
    base = {"dtc1": 1.0, "fdr": 3.0, "ddr": 2.9}
    made = {n: {(0.0, s): np.full(speeds, v) for s, v in base.items()} for n in names}
    for key, values in rows.items():
        name, scheme = key.split("__")
        made[name if name == "f_sw_Hz" else "5kHz"][0.0, scheme] = np.array(values)
    spread = {n: {key: np.array([0.1, 0.2, 0.7]) for key in made[n]} for n in names}
    return made, spread


@pytest.mark.parametrize(
    ("rows", "what"),
    [
        ({"f_sw_Hz__ddr": [3.2, 3.2, 3.2]}, "equals FDR's"),
        ({"f_sw_Hz__dtc1": [1.0, 3.1, 1.0]}, "above classical"),
        ({"f_sw_Hz__dtc1": [1.0, np.nan, 1.0]}, "every scheme runs"),
        ({"thd__ddr": [2.9, 3.4, 2.9]}, "THD lower with DDR, 5 kHz"),
    ],
)
def test_sweep_claims_can_fail(rows, what):
    found = sweeps._verdicts(made_up_sweep(**rows), made_up_sweep(), (1.0, 2.0, 3.0), (0.0,))
    word = {v.what: v for v in found}
    [name] = [n for n in word if what in n and "leakage" not in n]
    assert word[name].verdict == "differs"
    if what.startswith("THD"):
        assert (
            "higher at 2 r/min, by 0.40 points at most, with a scatter of up to ±0.20"
            in word[name].why
        )
        assert word[name].ours.startswith("at 2 of 3 speeds")


def test_points_out_of_reach_do_not_decide():
    made = made_up_sweep(thd__ddr=[2.9, np.nan, 2.9])
    v = sweeps._lower(made, "5kHz", 0.0, (1.0, 2.0, 3.0), "no load", "")
    assert v.verdict == "match" and v.ours.startswith("at 2 of 2 speeds, mean 3.00 → 2.90")
