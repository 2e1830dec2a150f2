"""A1 and B2: the recordings are compared with paper A's eq. (15) and the transform, the verdicts
with the printed values."""

import numpy as np
import pytest

from hexatorque.evidence.papers.both import vectors

PHASES = ("u1", "u2", "w1", "w2", "v1", "v2")
ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
BITS = np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in range(64)])
VDC = 250.0


@pytest.fixture(scope="module", params=["a1", "b2"])
def figure(request, job):
    return getattr(vectors, request.param)(job)


def planes(phase_V):
    """alpha, beta, x, y in units of Vdc of phase voltages (n, 6)."""
    pu = phase_V / VDC / 3
    return np.array([f(m * ANGLE) @ pu.T for m in (1, 5) for f in (np.cos, np.sin)]).T


def test_recorded_states_are_all_64(figure):
    rec = figure.recordings[""]
    assert rec["word"].tolist() == list(range(64))
    legs = np.array([rec[f"plant.leg_{p}"] for p in PHASES]).T
    assert (legs == BITS).all()


def test_recorded_phase_voltages_and_table_agree_with_equation_15(figure):
    rec = figure.recordings[""]
    phase_V = np.array([rec[f"plant.v_{p}_V"] for p in PHASES]).T
    wanted = np.empty((64, 6))
    for own in ([0, 2, 4], [1, 3, 5]):
        wanted[:, own] = VDC * (BITS[:, own] - BITS[:, own].mean(axis=1, keepdims=True))
    np.testing.assert_allclose(phase_V, wanted, atol=1e-4)
    table = np.array([rec[f"v_{axis}_pu"] for axis in ("alpha", "beta", "x", "y")]).T
    np.testing.assert_allclose(table, planes(wanted), atol=1e-7)


def test_equation_15_without_reordering_is_wrong_for_44_states():
    """Eq. (15) has the order u1 w1 v1 u2 w2 v2, the state words have u1 u2 w1 w2 v1 v2. Without
    reordering, rows and columns of the matrix are both read in the order of the words."""
    block = (3 * np.eye(3) - np.ones((3, 3))) / 3
    matrix = np.kron(np.eye(2), block)  # as printed
    naive = BITS @ matrix.T
    order = [0, 2, 4, 1, 3, 5]  # u1 w1 v1 u2 w2 v2 in the words' order
    right = np.empty((64, 6))
    right[:, order] = BITS[:, order] @ matrix.T
    np.testing.assert_allclose(
        planes(VDC * right)[48], [0.622008, 0.166667, 0.044658, 0.166667], atol=1e-6
    )
    off = np.abs(planes(VDC * naive) - planes(VDC * right)).max(axis=1) > 1e-9
    assert off.sum() == 44


def test_verdicts_hold_and_carry_the_printed_numbers(figure):
    assert not any(v.broken for v in figure.verdicts)
    printed = {v.paper for v in figure.verdicts if v.required}
    if "L" in figure.metrics:
        assert {0.6440, 0.4714, 0.3333, 0.1725, 100.0, 73.21, 51.76, 26.79} <= printed
    else:
        assert {0.644, 0.471, 0.173, 48} <= printed


def test_printed_values_hold_to_their_last_digit():
    assert vectors.rounded("", 0.64404, 0.6440, 4, "").verdict == "match"
    assert vectors.rounded("", 0.64406, 0.6440, 4, "").broken


def test_a_wrong_table_breaks_the_verdicts(job, monkeypatch):
    ab, xy = vectors.firmware_vectors()
    swapped = np.array(ab), np.array(xy)
    for z in swapped:
        z[[48, 57]] = z[[57, 48]]
    monkeypatch.setattr(vectors, "firmware_vectors", lambda: swapped)
    for name in ("a1", "b2"):
        assert any(v.broken for v in getattr(vectors, name)(job).verdicts)


def test_picture(figure, tmp_path):
    path = figure.draw(tmp_path / "figure.png")
    assert path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 50_000
