"""A turning rotor whose windings the low side shorts: the current of its magnets is compared with
the one that the machine's equations make of the believed angle."""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib

TS, MOST_A, PERIODS = 1e-4, 20.0, 100
R, LD, LQ, PSI_F = 0.8, 6.4e-3, 17.4e-3, 0.1746


def machine():
    c = ffi.new("ht_observer_config *")
    c.ts_s, c.rs_ohm, c.rotor = TS, R, lib.HT_ROTOR_MAGNET
    m = c.magnet
    m.psi_f_Wb, m.inv_psi_f, m.ld_H, m.lq_H, m.inv_ld = PSI_F, 1 / PSI_F, LD, LQ, 1 / LD
    return c


def currents(omega):
    """i_d + j i_q of the shorted machine in its own frame, from no current on."""
    i, parts = np.zeros(2), 20
    while True:
        for _ in range(parts):
            slope = [
                (omega * LQ * i[1] - R * i[0]) / LD,
                (-omega * (LD * i[0] + PSI_F) - R * i[1]) / LQ,
            ]
            i = i + TS / parts * np.array(slope)
        yield complex(*i)


def judged(omega, seen=lambda i: i):
    """The verdict, and after how many periods."""
    cfg, state = machine(), ffi.new("ht_rotor_catch_state *")
    lib.ht_rotor_catch_begin(state)
    axis = np.exp(0.7j)
    for n, i in enumerate(currents(omega), 1):
        shown = seen(i) * axis
        found = lib.ht_rotor_catch_step(
            cfg, state, omega, [axis.real, axis.imag], [shown.real, shown.imag], MOST_A
        )
        if found != lib.HT_CATCHING:
            return found, n
        assert n <= PERIODS


def size_pu(omega, periods):
    """Of the current after so many periods, in MOST_A."""
    return abs([i for _, i in zip(range(periods), currents(omega))][-1]) / MOST_A


@pytest.mark.parametrize("back", [1, -1])
def test_a_fast_rotor_is_judged_as_soon_as_its_current_is_large(back):
    found, n = judged(back * 300.0)
    assert found == lib.HT_CAUGHT and n < 10 and size_pu(300.0, n) >= 0.049


def test_a_slow_rotor_is_judged_at_the_end_of_the_time():
    omega = 7.0
    assert 0.02 < size_pu(omega, PERIODS) < 0.05
    assert judged(omega) == (lib.HT_CAUGHT, PERIODS)


def test_a_current_that_tells_nothing_catches_nothing():
    omega = 3.0
    assert size_pu(omega, PERIODS) < 0.02
    assert judged(omega) == (lib.HT_NOT_CAUGHT, PERIODS)


@pytest.mark.parametrize(
    ("wrong", "caught"),
    [(1.0, True), (0.35, True), (0.25, False), (np.exp(0.5j), True), (np.exp(-0.55j), False),
     (-1.0, False)],
)  # fmt: skip
def test_the_current_may_be_30_degrees_off_and_must_have_three_tenths_of_its_size(wrong, caught):
    found, _ = judged(300.0, lambda i: wrong * i)
    assert found == (lib.HT_CAUGHT if caught else lib.HT_NOT_CAUGHT)
