"""The inverter's S-curve: far from zero it must be flat at the volt-seconds that dead
time and devices cost; around zero smaller, odd and never along the current.
"""

import numpy as np
import pytest

from hexatorque.evidence.studies import inverter

DEAD_TIME_V = 300 * 2.3 / 100
#: Half the period through either device, at half the duty ratio.
THRESHOLD_V = (1.2 + 1.0) / 2


@pytest.fixture(scope="module")
def result():
    return inverter.curves()


@pytest.mark.parametrize(("index", "more_V", "ohm"), [(0, 0, 0), (1, THRESHOLD_V, 0.02), (2, 0, 0)])
def test_plateaus(result, index, more_V, ohm):
    curve = result.curves[index]
    far = (np.abs(curve.i_A) > 0.4) & (np.abs(curve.i_A) < 1)
    assert curve.i_A[far].min() < -0.9 and curve.i_A[far].max() > 0.9
    expected = DEAD_TIME_V + more_V + ohm * np.abs(curve.i_A)
    np.testing.assert_allclose((-np.sign(curve.i_A) * curve.error_V)[far], expected[far], atol=0.03)


@pytest.mark.parametrize("index", [0, 1])
def test_ripple_shares_the_dead_time_around_zero(result, index):
    curve = result.curves[index]
    i, error = inverter._line(curve)
    assert np.all(np.diff(error) < 0.05)
    # No step at zero: less than a fifth within 0.1 A, and values between on either side.
    level = np.abs(error).max()
    assert np.abs(error[np.abs(i) < 0.1]).max() < 0.2 * level
    between = np.abs(np.abs(curve.error_V) / level - 0.5) < 0.3
    for sign in (1, -1):
        side = curve.i_A[between & (curve.i_A * sign > 0)] * sign
        assert len(side) > 20 and 0.1 < side.min() < side.max() < 0.3
    half = [np.interp(y, -error, i) for y in (-level / 2, level / 2)]
    assert half[0] == pytest.approx(-half[1], abs=0.01)


def test_firmware_believes_in_a_step(result):
    """It knows the currents at the period's ends, not the ripple between them."""
    curve = result.curves[2]
    beyond = np.abs(curve.i_A) > 2 * 0.05  # twice its i_zero_A
    assert np.all(np.abs(curve.error_V[beyond]) > 0.99 * DEAD_TIME_V)
    i, error = inverter._line(curve)
    assert abs(np.interp(0, i, error)) < 1


def test_study_and_its_picture(tmp_path):
    result = inverter.study()
    assert result["plateau_V"] == pytest.approx(DEAD_TIME_V)
    assert [len(c["i_A"]) > 100 for c in result["curves"]] == [True] * 3
    assert len(inverter.grid(result)[0][2]) == 9
    path = inverter.plot(result, tmp_path / "inverter.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000
