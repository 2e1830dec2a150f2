"""Parameters measured on the running drive agree with the print. If the drive is changed, they
change too."""

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.papers.both import parameters
from hexatorque.evidence.papers.engine import measured


@pytest.fixture(scope="module")
def a_t3(job):
    return parameters.a_t3(job)


#: Everything that is measured has another value than paper A's drive.
OTHER = {
    "controller.scheme": "dtc1",
    "machine.pole_pairs": 3,
    "machine.drs_ohm": [0, 0.3, 0, 0.3, 0, 0.3],
    "machine.rr_ohm": 1.5,
    "machine.lls_H": 0.012,
    "machine.lm_H": 0.2,
    "machine.lxy_H": 0.006,
    "inverter.dead_time_us": 3.0,
    "inverter.vdc_V": 300.0,
    "sensors.encoder_ppr": 1000,
    "controller.torque_band_Nm": 0.8,
    "controller.flux_band_Wb": 0.02,
    "controller.kp_speed_Nms_rad": 0.3,
    "controller.ki_speed_Nm_rad": 1.0,
    "controller.f_slow_Hz": 200.0,
}


@pytest.fixture(scope="module")
def other():
    setup = setups.load("paper-a").changed(OTHER)
    return measured.watch(setup, 300.0, 1.0)


def test_tables_match(a_t3, job):
    for figure in (a_t3, parameters.b_t5(job)):
        words = {v.what: v.verdict for v in figure.verdicts}
        assert set(words.values()) == {"match", "not printed"}, words
        assert sum(word == "match" for word in words.values()) >= 15


def test_a_different_drive_measures_differently(other):
    rec = other.recording
    assert measured.dead_time_us(other) == pytest.approx(3.0)
    assert measured.slow_Hz(rec) == pytest.approx(200.0)
    assert measured.isr_Hz(other) == pytest.approx(1e4)
    low, high = measured.band(measured.torque_error_Nm(rec), rec["torque_level"], 0, 1)
    assert low < 0.8 <= high and high - low < 0.05
    low, high = measured.flux_band(rec)
    assert low < 0.02 <= high + 1e-6 and high - low < 1e-3
    kp, ki = measured.speed_gains(other, 15.0)
    assert (kp, ki) == (pytest.approx(0.3, rel=1e-3), pytest.approx(1.0, rel=1e-3))
    assert measured.pole_pairs(rec.window(rec.start_s + 0.6, 1e9)) == pytest.approx(3, rel=0.01)
    assert other.counts / other.turns / 4 == pytest.approx(1000, rel=1e-3)


def test_machine_from_the_plants_equations(other):
    phases = measured.phase_ohm(other.machine)
    assert phases == pytest.approx([1.8, 2.1] * 3)
    rr_ohm, found = measured.inductances_H(other.machine)
    assert rr_ohm == pytest.approx(1.5)
    want = {"lm_H": 0.2, "lls_H": 0.012, "llr_H": 0.015, "lxy_H": 0.006}
    assert found == pytest.approx(want)


def test_xy_gains_of_another_regulator():
    setup = setups.load("paper-a").changed(
        controller__scheme="ddr",
        controller__zero_hold="off",
        controller__kp_xy_pu_A=0.05,
        controller__ki_xy_pu_As=4.0,
    )
    rec = measured.watch(setup, 200.0, 1.0).recording
    kp, ki = measured.xy_gains(rec.window(rec.start_s + 0.5, 1e9))
    assert (kp, ki) == (pytest.approx(0.05, rel=0.01), pytest.approx(4.0, rel=0.02))


def test_encoder_count_wraps(monkeypatch):
    """If the shaft turns backwards from 0, the 32-bit counter wraps."""
    w = measured.watch(setups.load("paper-b").changed(controller__scheme="dtc1"), -300.0, 0.3)
    assert w.turns < -0.5 and w.counts / w.turns / 4 == pytest.approx(1500, rel=1e-3)


def test_band_needs_the_right_transitions():
    error = np.array([0.0, 0.4, -0.45, 0.6, 0.2, -0.1, -0.7])
    level = np.array([0, 0, 0, 1, 1, 0, -1])
    assert measured.band(error, level, 0, 1) == (0.45, 0.6)
    assert measured.band(-error, -level, 0, 1) == (0.45, 0.6)


def test_a_wrong_table_would_be_noticed():
    row = parameters.Row("B_T", "torque band", 5.1, 5.0, "%", "measured")
    assert row.verdict().verdict == "differs"


def test_picture(a_t3, tmp_path):
    path = a_t3.draw(tmp_path / "a-t3.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 50_000
