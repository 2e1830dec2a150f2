"""What the sets' resistances differ by is learnt from the residual of a machine in steady state,
which is derived here from the voltage equations of its six phases."""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib
from hexatorque.plant.vsd import ANGLES_RAD, TRANSFORM

SLOW_S, FILTER_S = 1e-3, 0.002
MOST_OHM, LEAST_A = 0.5, 0.2
#: Current of each phase from those of the planes.
PHASE = np.column_stack(
    [np.cos(ANGLES_RAD), np.sin(ANGLES_RAD), np.cos(5 * ANGLES_RAD), np.sin(5 * ANGLES_RAD)]
)


def residual_V(i_A, set2_ohm):
    """R i + L di/dt less the voltage that was commanded. With R the mean of both sets this is what
    the set's own drops leave, with its sign turned."""
    drops = set2_ohm * np.array([-1, 1] * 3) * (PHASE @ i_A)
    return -(TRANSFORM @ drops)[2:]


def learnt(set2_ohm, omega, amplitude_A=5.0, seconds=2.0, more_V=None, before=None):
    """Turning current and its residual, behind a low pass that is solved exactly. `more_V`: of the
    angle."""
    cfg = ffi.new("ht_set_difference_config *")
    cfg.gain, cfg.slow_gain, cfg.least_A2 = SLOW_S / 0.05, SLOW_S / 0.2, LEAST_A**2
    st = before or ffi.new("ht_set_difference *")
    times = np.arange(round(seconds / SLOW_S)) * SLOW_S
    for t in times:
        angle = omega * t
        i = amplitude_A * np.array([np.cos(angle), np.sin(angle), 0, 0])
        # A vector that turns with -omega, behind 1/(1 + s T).
        raw = complex(*residual_V(i, set2_ohm))
        low = raw / (1 - 1j * omega * FILTER_S)
        if more_V:
            low += more_V(angle)
        lib.ht_set_difference_learn(
            cfg, st, {"alpha": i[0], "beta": i[1]}, {"x": low.real, "y": low.imag}, omega, MOST_OHM
        )
    return st


@pytest.mark.parametrize("omega", (0.0, 10.0, -60.0, 280.0, -900.0))
@pytest.mark.parametrize("set2_ohm", (0.06, -0.3, 0.0))
def test_the_difference_at_every_speed(set2_ohm, omega):
    assert learnt(set2_ohm, omega).ohm == pytest.approx(set2_ohm, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("omega", (60.0, -280.0))
def test_what_is_across_the_current_or_has_no_mean_along_it_does_not_count(omega):
    """A wrong reactance acts across. Fifth and seventh harmonics turn against the current."""

    def across(angle):
        return 2.0j * np.exp(-1j * angle)

    def harmonics(angle):
        return 0.5 * np.exp(5j * angle) + 0.5 * np.exp(-7j * angle)

    for more_V in (across, harmonics):
        got = learnt(0.06, omega, more_V=more_V, seconds=3.0).ohm
        assert got == pytest.approx(0.06, abs=0.004)


def test_it_takes_a_second_and_a_lost_leg_does_not_spoil_it():
    """A residual at the limit, 3.6 V, in two calls before the slow interrupt sees the loss."""
    assert 0.03 < learnt(0.06, 100.0, seconds=0.3).ohm < 0.05
    st = learnt(0.06, 100.0, seconds=2.0)
    learnt(0.06, 100.0, seconds=0.002, before=st, more_V=lambda angle: 3.6 * np.exp(-1j * angle))
    assert st.ohm == pytest.approx(0.06, abs=0.001)


def test_nothing_is_learnt_without_current_nor_beyond_the_limit():
    assert learnt(0.06, 100.0, amplitude_A=0.9 * LEAST_A).ohm == 0.0
    assert learnt(0.06, 100.0, amplitude_A=1.1 * LEAST_A).ohm > 0.05
    for wrong in (1.1 * MOST_OHM, -1.1 * MOST_OHM):
        assert learnt(0.9 * wrong, 100.0).ohm == pytest.approx(0.9 * wrong, rel=1e-3)
        reached = learnt(1.3 * wrong, 100.0).ohm / wrong * 1.1
        assert 0.95 < reached < 1.0


@pytest.mark.parametrize("wrong", (float("nan"), float("inf"), -float("inf")))
def test_what_is_no_number_changes_nothing_and_is_gone_with_the_next_start(wrong):
    st = learnt(0.06, 100.0)
    had = st.ohm
    learnt(0.06, 100.0, seconds=SLOW_S, before=st, more_V=lambda angle: complex(wrong, 0))
    assert st.ohm == had
    lib.ht_set_difference_begin(st)
    assert (st.power_W, st.i2_A2, st.ohm) == (0.0, 0.0, had)
    assert learnt(0.06, 100.0, before=st).ohm == pytest.approx(0.06, rel=1e-3)
