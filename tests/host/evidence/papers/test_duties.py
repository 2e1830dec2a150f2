"""A3 and A5 are compared with volt-seconds: on-times of the legs, and duties solved with numpy."""

import itertools

import numpy as np
import pytest

from hexatorque.evidence.papers.paper_a import duties

PHASES = ("u1", "u2", "w1", "w2", "v1", "v2")
ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
LARGE = (48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49)
TMVCL = np.sqrt(2) * (1 - np.sqrt(3) / 2) * 2 / 3 * np.cos(5 * np.pi / 12)  # eqs. (20), (21)


def complex_planes(legs):
    """alpha-beta and x-y of leg values (..., 6), in units of Vdc."""
    return legs @ np.exp(1j * ANGLE) / 3, legs @ np.exp(5j * ANGLE) / 3


def exact_mean(k, v_xy):
    """Mean alpha-beta voltage of virtual vector k for an x-y command."""
    words = [LARGE[(k + d) % 12] for d in (-1, 0, 1)]
    ab, xy = complex_planes(np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in words]))
    t = np.linalg.solve([xy.real, xy.imag, np.ones(3)], [v_xy.real, v_xy.imag, 1])
    return t @ ab, t


@pytest.fixture(scope="module")
def nine(job):
    return duties.a3(job)


def test_a3_on_times_give_the_commands(nine):
    rec = nine.recordings[""]
    legs = np.array([rec[f"plant.leg_{p}"].reshape(9, -1).mean(axis=1) for p in PHASES]).T
    _, xy = complex_planes(legs)
    command = rec["v_x_pu"][::200] + 1j * rec["v_y_pu"][::200]
    np.testing.assert_allclose(xy, command, atol=3 / 200 / 3)
    assert sorted({round(abs(v), 6) for v in rec["v_x_pu"]}) == [0, round(TMVCL, 6)]
    # ... and to a count, from the change of the machine's flux.
    gained = rec["plant.v_x_pu"][::200] + 1j * rec["plant.v_y_pu"][::200]
    np.testing.assert_allclose(gained, command, atol=1 / 15000)


def from_the_middle_deg(k, x, y):
    """Of the mean vector in alpha-beta, from the middle of sector k."""
    angle = np.rad2deg(np.angle(exact_mean(k, TMVCL * (x + 1j * y))[0])) - 15 - 30 * k
    return (angle + 180) % 360 - 180


def test_a3_spread_in_alpha_beta(nine):
    angle = [from_the_middle_deg(0, x, y) for y in (1, 0, -1) for x in (-1, 0, 1)]
    np.testing.assert_allclose(nine.metrics["angle_deg"], angle, atol=0.01)
    assert min(angle) == pytest.approx(-14.177, abs=1e-3)
    corners = itertools.product(range(12), (-1, 1), (-1, 1))
    widest = max(abs(from_the_middle_deg(k, x, y)) for k, x, y in corners)
    assert widest == pytest.approx(16.102, abs=1e-3)
    assert nine.metrics["angle_any_k_deg"] == pytest.approx(widest, abs=1e-3)
    assert not any(v.broken for v in nine.verdicts)
    (same,) = [v for v in nine.verdicts if v.what.startswith("close together")]
    assert same.verdict == "differs"


def test_a3_wrong_duties_break_the_verdicts(job, monkeypatch):
    right = duties.action_points
    monkeypatch.setattr(duties, "action_points", lambda k, x, y: right(k, y, x))
    assert any(v.broken for v in duties.a3(job).verdicts)


def test_a5_against_solved_duties(job):
    figure = duties.a5(job)
    rec = figure.recordings[""]
    large = 2 / 3 * np.cos(np.deg2rad(15))
    for k in range(12):
        for sign in (-1, 0, 1):
            wanted = [
                100 * abs(exact_mean(k, v_x + 1j * sign * TMVCL)[0]) / large
                for v_x in rec["v_x_pu"]
            ]
            np.testing.assert_allclose(rec[f"eta_k{k + 1}_vy{sign:+d}_pct"], wanted, rtol=1e-5)
    assert not any(v.broken for v in figure.verdicts)


def test_the_limit_is_a_box_and_not_a_circle():
    """TMVCL limits each axis. The corners of the box have sqrt 2 times the printed magnitude. There
    no duty of any vector is negative, and each vector has a duty of zero at one of them."""
    for k in range(12):
        corners = [exact_mean(k, TMVCL * (x + 1j * y))[1].min() for x in (-1, 1) for y in (-1, 1)]
        assert min(corners) == pytest.approx(0, abs=1e-12)
    # As a limit of the magnitude it would be smaller than what all twelve vectors can produce:
    reach = min(
        min((duty0 / -slope) for duty0, slope in zip(*duty_slopes(k, angle)) if slope < 0)
        for k in range(12) for angle in np.deg2rad(np.arange(0, 360, 1.0))
    )  # fmt: skip
    assert reach == pytest.approx(0.0447, abs=1e-4)
    assert reach > 1.36 * TMVCL


def duty_slopes(k, angle):
    """Duties at zero command, and their change per Vdc along an x-y direction."""
    t0 = exact_mean(k, 0j)[1]
    return t0, exact_mean(k, 1e-3 * np.exp(1j * angle))[1] / 1e-3 - t0 / 1e-3


@pytest.mark.parametrize("name", ["a3", "a5"])
def test_picture(job, name, tmp_path):
    assert getattr(duties, name)(job).draw(tmp_path / "figure.png").stat().st_size > 30_000
