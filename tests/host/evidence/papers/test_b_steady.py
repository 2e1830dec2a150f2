"""Loci, currents and torque at paper B's operating point."""

import numpy as np
import pytest

from hexatorque.analysis.run import Run
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.paper_b import loci, steady
from hexatorque.recording.recording import Recording


class Once(Job):
    """Every point is simulated once for all tests here."""

    def __init__(self, folder):
        super().__init__(True, folder)
        self.found = {}

    def runs(self, points):
        keys = [(p.setup["controller.scheme"], p.speed_rpm, p.load_Nm) for p in points]
        new = {key: point for key, point in zip(keys, points) if key not in self.found}
        self.found |= zip(new, super().runs(new.values()))
        return [self.found[key] for key in keys]


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return Once(tmp_path_factory.mktemp("points"))


def run_of(channels, rate_Hz=1e4, per=1):
    rec = Recording(rate_Hz, channels, {}, {"samples_per_period": per})
    return Run("paper-b", "dtc1", "none", 2500, 2, rec, {}, 1.0)


def test_locus_of_known_circles():
    """The flux is 0.4 Wb with 1 % ripple. In x-y it has 0.02 Wb at 200 Hz and 0.01 Wb at 3 kHz."""
    t = np.arange(5000) / 1e4
    dq = (0.4 + 0.004 * np.sqrt(2) * np.sin(2 * np.pi * 500 * t)) * np.exp(2j * np.pi * 50 * t)
    xy = 0.02 * np.exp(2j * np.pi * 200 * t) + 0.01 * np.exp(2j * np.pi * 3000 * t)
    found = loci._locus(run_of({
        "psi_alpha_Wb": dq.real, "psi_beta_Wb": dq.imag, "psi_x_Wb": xy.real, "psi_y_Wb": xy.imag,
    }).recording)  # fmt: skip
    assert found["dq_mean_Wb"] == pytest.approx(0.4)
    assert found["dq_std_Wb"] == pytest.approx(0.004, rel=1e-3)
    assert found["xy_rms_Wb"] == pytest.approx(np.hypot(0.02, 0.01))
    assert found["xy_max_Wb"] == pytest.approx(0.03, rel=1e-3)
    # A second-order low-pass at 1 kHz leaves 1/9 of 3 kHz.
    assert found["xy_slow_rms_Wb"] == pytest.approx(np.hypot(0.02, 0.01 / 9), rel=0.01)


def test_loci_agree_with_their_recordings(job, tmp_path):
    """DTC2 moves the x-y flux towards the centre. The estimate is inductance times current, so the
    locus bounds the harmonics of the current."""
    figure = loci.b11(job)
    own, first = figure.metrics["dtc2"], figure.metrics["dtc1"]
    for key in ("xy_rms_Wb", "xy_max_Wb", "xy_slow_rms_Wb"):
        assert own[key] < 0.75 * first[key]
    for name, row in (("", own), ("dtc1", first)):
        rec = figure.recordings[name]
        assert len(rec) == pytest.approx(480, abs=1)
        radius = np.hypot(rec["psi_x_Wb"], rec["psi_y_Wb"])
        assert np.sqrt(np.mean(radius**2)) == pytest.approx(row["xy_rms_Wb"], rel=0.15)
        assert radius.max() < 1.3 * row["xy_max_Wb"]
        # Two turns at 2500 r/min, slip included.
        angle = np.unwrap(np.arctan2(rec["psi_beta_Wb"], rec["psi_alpha_Wb"]))
        assert 2.0 < np.ptp(angle) / (2 * np.pi) < 2.2
    figure.draw(tmp_path / "b11.png")
    assert (tmp_path / "b11.png").stat().st_size > 20_000


def test_third_scheme_is_compared_with_both_others(job):
    figure = loci.b12(job)
    m = figure.metrics
    ours = {v.what: v.ours for v in figure.verdicts}
    assert ours["x–y flux over DTC2's, rms"] == m["dtc3"]["xy_rms_Wb"] / m["dtc2"]["xy_rms_Wb"]
    assert ours["x–y flux over DTC1's, rms"] == m["dtc3"]["xy_rms_Wb"] / m["dtc1"]["xy_rms_Wb"]
    assert set(figure.recordings) == {"", "dtc1"}
    # One period of a small vector, which has the length (2/3) cos 15 deg of Vdc in x-y, minus R_s
    # i.
    step_Wb = 2 / 3 * np.cos(np.radians(15)) * 300 * 100e-6
    assert m["dtc3"]["xy_max_Wb"] > step_Wb > 2.5 * 2 / 3 * np.cos(np.radians(75)) * 300 * 100e-6


def test_orders_of_a_known_current():
    t = np.arange(20000) / 4e4
    phi = 2 * np.pi * 42 * t
    i = 2 * np.cos(phi) + 0.6 * np.cos(5 * phi) + 0.2 * np.cos(7 * phi) + 0.1 * np.cos(11 * phi)
    psi = 0.4 * np.exp(1j * phi)
    channels = {"plant.i_u1_A": i + 0.08 * np.cos(3 * phi)}
    channels |= {"plant.psi_alpha_Wb": psi.real, "plant.psi_beta_Wb": psi.imag}
    found = steady._orders(run_of(channels, 4e4, 4))
    expected = {
        "xy_pct": 50 * np.hypot(0.6, 0.2), "dq_pct": 5.0, "h5_pct": 30.0, "h7_pct": 10.0,
        "next_pct": 5.0,
    }  # fmt: skip
    assert found == pytest.approx(expected, rel=0.01)


def test_harmonics_agree_with_a_fit_to_the_recorded_currents(job, tmp_path):
    figure = steady.b13(job)
    for scheme, m in figure.metrics.items():
        rec = figure.recordings[scheme]
        # The harmonics are computed again by a least-squares fit over the flux's angle.
        psi = rec["plant.psi_alpha_Wb"] + 1j * rec["plant.psi_beta_Wb"].astype(float)
        slope, start = np.polyfit(rec.time_s, np.unwrap(np.angle(psi)), 1)
        phi = slope * rec.time_s + start
        columns = [f(k * phi) for k in range(1, 20) for f in (np.cos, np.sin)]
        fit = np.linalg.lstsq(np.stack(columns, 1), rec["plant.i_u1_A"], rcond=None)[0]
        peaks = np.hypot(fit[::2], fit[1::2])
        for order in (5, 7):
            own_pct = 100 * peaks[order - 1] / peaks[0]
            assert own_pct == pytest.approx(m[f"h{order}_pct"], rel=0.25, abs=1.5), (scheme, order)
    assert figure.metrics["dtc1"]["xy_pct"] > 2 * figure.metrics["dtc3"]["xy_pct"]
    assert figure.metrics["dtc1"]["h5_pct"] > 20
    figure.draw(tmp_path / "b13.png")
    assert (tmp_path / "b13.png").stat().st_size > 20_000


def test_torque_agrees_with_its_recording(job, tmp_path):
    figure = steady.b15(job)
    ripple = figure.metrics["torque_ripple_Nm"]
    for scheme, rec in figure.recordings.items():
        assert rec.rate_Hz == 1e4
        assert np.std(rec["plant.torque_Nm"]) == pytest.approx(ripple[scheme], rel=0.05)
        # The comparator works on the estimate, so the estimate must equal the torque.
        assert np.abs(rec["torque_Nm"] - rec["plant.torque_Nm"]).max() < 0.05
        below = np.mean(rec["torque_ref_Nm"] - rec["plant.torque_Nm"])
        assert below == pytest.approx(figure.metrics["below_reference_Nm"][scheme], abs=0.01)
        assert np.mean(rec["plant.torque_Nm"]) == pytest.approx(2.0, abs=0.02)
    assert set(np.unique(figure.recordings["dtc3"]["torque_level"])) <= {-2, -1, 0, 1, 2}
    assert set(np.unique(figure.recordings["dtc1"]["torque_level"])) <= {-1, 0, 1}
    assert ripple["dtc3"] < 0.75 * min(ripple["dtc1"], ripple["dtc2"])
    figure.draw(tmp_path / "b15.png")
    assert (tmp_path / "b15.png").stat().st_size > 20_000
