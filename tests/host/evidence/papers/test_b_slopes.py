"""Fig. 7 of paper B: eq. (8) is the derivative of the torque, and slopes are measured while one
vector is on the legs."""

import numpy as np
import pytest

from hexatorque.evidence.papers.paper_b import slopes
from hexatorque.evidence.papers.paper_b.common import setup
from hexatorque.evidence.papers.paper_b.slopes import PER_PERIOD, gate_states, torque_slope
from hexatorque.recording.recording import Recording

SETUP = setup("dtc1")
#: The recorded gates have two bits per leg. The first leg is in the highest bits.
L48, ZERO = 0b01_01_00_00_00_00, 0
OFF_FIRST, OFF_LAST = 0b10_01_00_00_00_00, 0b01_01_00_00_00_10
LS_H = LR_H = 0.256 + 0.0144
LM_H, RS_OHM, RR_OHM = 0.256, 6.0, 2.2


def currents(psi_s, psi_r):
    """The currents from the flux linkages, by the inverse of the inductance matrix (paper B, eq.
    4)."""
    determinant = LS_H * LR_H - LM_H**2
    i_s = (LR_H * psi_s - LM_H * psi_r) / determinant
    return i_s, (LS_H * psi_r - LM_H * psi_s) / determinant


def torque(psi_s, psi_r):
    """Paper B, eq. (5), one pole pair."""
    return 3 * np.imag(np.conj(psi_s) * currents(psi_s, psi_r)[0])


def test_equation_8_is_the_derivative_of_the_torque():
    """Eq. (8) is compared with the difference of eq. (5) over a small step along eqs. (2) and
    (3)."""
    random = np.random.default_rng(8)
    n = 200
    psi_s, psi_r = 0.4 * (random.normal(size=(2, n)) + 1j * random.normal(size=(2, n)))
    v = 300 * (random.normal(size=n) + 1j * random.normal(size=n))
    rpm = random.uniform(-3000, 3000, n)
    i_s, i_r = currents(psi_s, psi_r)
    rec = Recording(1.0, {
        "plant.psi_alpha_Wb": psi_s.real, "plant.psi_beta_Wb": psi_s.imag,
        "plant.i_alpha_A": i_s.real, "plant.i_beta_A": i_s.imag,
        "plant.torque_Nm": torque(psi_s, psi_r), "plant.speed_rpm": rpm,
    })  # fmt: skip
    by_equation, by_voltage = torque_slope(rec, SETUP, v)

    def slope(v):
        d_s = v - RS_OHM * i_s
        d_r = -RR_OHM * i_r + 1j * rpm * np.pi / 30 * psi_r
        h = 1e-7
        return (torque(psi_s + h * d_s, psi_r + h * d_r)
                - torque(psi_s - h * d_s, psi_r - h * d_r)) / (2 * h)  # fmt: skip

    scale = np.abs(by_equation).max()
    assert np.allclose(by_equation, slope(v), atol=1e-6 * scale)
    assert np.allclose(by_voltage, slope(v) - slope(0 * v), atol=1e-6 * scale)


def test_gate_states():
    assert gate_states(np.array([L48, OFF_FIRST, 0b01_10_00_00_00_01])).tolist() == [
        [1, 1, 0, 0, 0, 0], [2, 1, 0, 0, 0, 0], [1, 2, 0, 0, 0, 1],
    ]  # fmt: skip


def test_slopes_leave_out_edges_and_dead_time():
    """There are two periods: a rise of 4 kN m/s after 20 us of dead time, and a fall of 1 kN m/s.
    The torque has arbitrary values while a leg is off. A large vector against the torque is not a
    rise."""
    rate_Hz = PER_PERIOD * 1e4
    gates = np.array(
        [ZERO] + [OFF_FIRST] * 2 + [OFF_LAST] * 2 + [L48] * 15 + [L48] + [ZERO] * 19 + [ZERO]
    )
    step = np.select([gates[:-1] == L48, gates[:-1] == ZERO], [4000.0, -1000.0], 1e6) / rate_Hz
    torque_Nm = 2 + np.concatenate(([0.0], np.cumsum(step)))
    n = gates.size

    def record(angle):
        """A recording with the rotor flux at `angle`. Vector 48 points at 15 degrees."""
        psi_r = 0.37 * np.exp(1j * np.radians(angle))
        psi_s = LM_H / LR_H * psi_r + (LS_H - LM_H**2 / LR_H) * 1.5j * np.exp(1j * np.angle(psi_r))
        i_s = currents(psi_s, psi_r)[0]
        full = {"psi_alpha_Wb": psi_s.real, "psi_beta_Wb": psi_s.imag, "i_alpha_A": i_s.real,
                "i_beta_A": i_s.imag, "speed_rpm": 500.0}  # fmt: skip
        channels = {f"plant.{name}": np.full(n, value) for name, value in full.items()}
        channels |= {"plant.gates": gates, "plant.torque_Nm": torque_Nm}
        return Recording(rate_Hz, channels)

    found = slopes.slopes(record(-60), SETUP)
    assert found.rise == pytest.approx([4000.0])
    assert found.fall == pytest.approx([-1000.0])
    assert found.rise_eq8.size == found.fall_eq8.size == 1
    assert slopes.slopes(record(100), SETUP).rise.size == 0


@pytest.fixture(scope="module")
def figure(job):
    return slopes.b7(job)


def test_rises_and_falls_balance(figure):
    """In steady state the torque returns to its value. So the slopes, weighted with their
    durations, add up to zero, except for the last incomplete cycle."""
    for name, m in figure.metrics.items():
        rec = figure.recordings[name]
        zero = (gate_states(rec["plant.gates"]) == 0).all(axis=1).mean()
        zero += (gate_states(rec["plant.gates"]) == 1).all(axis=1).mean()
        words = gate_states(rec["plant.gates"]) @ (32, 16, 8, 4, 2, 1)
        zero = np.isin(words, (0, 21, 42, 63)).mean()
        drift = (1 - zero) * m["rise_Nm_s"] + zero * m["fall_Nm_s"]
        assert abs(drift) < 0.1 * zero * abs(m["fall_Nm_s"])


def test_what_the_figure_must_show(figure):
    slow, fast = figure.metrics["500rpm"], figure.metrics["2500rpm"]
    assert slow["rise_Nm_s"] > -2 * slow["fall_Nm_s"]
    assert fast["rise_Nm_s"] < -0.8 * fast["fall_Nm_s"]
    words = {v.what: v.verdict for v in figure.verdicts}
    assert words.pop("σ in eq. (8)") == "differs"
    assert set(words.values()) == {"match"}
    for row in figure.metrics.values():
        assert row["rise_std_Nm_s"] > 1e3 * row["rise_distance_Nm_s"]


def test_recordings_and_picture(figure, tmp_path):
    for rec in figure.recordings.values():
        assert rec.duration_s == pytest.approx(slopes.SHOWN_S)
        assert rec.rate_Hz == 2e5
    figure.draw(tmp_path / "b7.png")
    assert (tmp_path / "b7.png").stat().st_size > 20_000
