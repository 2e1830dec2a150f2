"""When the short circuit of all legs begins and ends: the decision alone, fed with the currents of
an ideal shorted machine.
"""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib, parameters

TS, POLES, PSI_F, VDC = 1e-4, 5, 0.0734, 60.0
#: Electrical speed at which the magnets induce V_dc between two terminals.
CEILING = VDC / (np.sqrt(3) * PSI_F)
#: Fast interrupts in 50 ms, for which it lasts at least.
HOLD = 500


class Case:
    def __init__(self, **more):
        values = {row.name: row.initial for row in parameters().values()}
        told = {
            "machine": 1, "trip_state": 1, "psi_f_Wb": PSI_F, "vdc_min_V": 36.0,
            "vdc_max_V": 84.0, "magnets_bear_A": 50.0, "f_isr_Hz": 1 / TS, "f_slow_Hz": 100.0,
        }  # fmt: skip
        values = list({**values, **told, **more}.values())
        self.cfg = ffi.new("ht_short_circuit_config *")
        self.st = ffi.new("ht_short_circuit_state *")
        lib.ht_short_circuit_configure(ffi.new("ht_params *", [values]), self.cfg)
        lib.ht_short_circuit_reset(self.st)
        self.angle = 0.0

    def step(self, omega, real=None, i_A=20.0, vdc_V=VDC, doubtful=False, forbidden=False, dc=0j):
        """`omega`: by the encoder; `real`: with which the current of i_A turns beside a direct
        one."""
        self.angle += TS * (omega if real is None else real)
        i = i_A * np.exp(1j * self.angle) + dc
        told = [[i.real, i.imag], vdc_V, omega, doubtful, forbidden]
        return lib.ht_short_circuit_step(
            self.cfg, self.st, ffi.new("ht_short_circuit_input *", told)
        )

    def begun(self, omega, **more):
        assert not self.step(omega, **more)
        assert self.step(omega, **more)
        return self


def test_the_gates_are_off_for_a_period_first():
    case = Case()
    assert [case.step(CEILING) for _ in range(3)] == [False, True, True]
    lib.ht_short_circuit_ends(case.st)
    assert [case.step(CEILING) for _ in range(2)] == [False, True]


@pytest.mark.parametrize("sign", (-1, 1))
def test_it_begins_below_the_ceiling_by_what_a_speed_changes(sign):
    assert not any(Case().step(sign * 0.94 * CEILING) for _ in range(3))
    Case().begun(sign * 0.96 * CEILING)


def test_nothing_happens_without_permission_or_without_magnets():
    for more in ({"trip_state": 0}, {"machine": 0}):
        case = Case(**more)
        assert not any(case.step(3 * CEILING) for _ in range(3))


@pytest.mark.parametrize("sign", (-1, 1))
def test_it_ends_when_encoder_and_current_say_that_the_shaft_is_slow(sign):
    case = Case().begun(sign * CEILING)
    for share, on in ((1.0, True), (0.92, True), (0.88, False)):
        for _ in range(HOLD + 1000):
            found = case.step(sign * share * CEILING)
        assert found == on


@pytest.mark.parametrize("encoder, real", [(0.0, 1.0), (1.0, 0.0), (0.0, 0.95)])
def test_one_of_the_two_alone_does_not_end_it(encoder, real):
    case = Case().begun(CEILING)
    for _ in range(3 * HOLD):
        assert case.step(encoder * CEILING, real * CEILING)


def test_a_doubtful_encoder_is_not_asked():
    case = Case().begun(CEILING, doubtful=True)
    for _ in range(3 * HOLD):
        assert case.step(0.0, 0.95 * CEILING, doubtful=True)
    found = [case.step(CEILING, 0.85 * CEILING, doubtful=True) for _ in range(1000)]
    assert found.index(False) < 500 and not any(found[found.index(False) :])


def test_a_direct_part_of_the_current_does_not_end_it():
    case = Case().begun(CEILING, dc=15 + 20j)
    for n in range(3 * HOLD):
        assert case.step(0.0, CEILING, dc=(15 + 20j) * np.exp(-n * TS / 0.02), doubtful=True)


def test_the_steps_of_its_rise_do_not_count():
    """The current comes from nothing: its first step is no rotation, nor is the next angle."""
    case = Case().begun(CEILING)
    for _ in range(2):
        case.step(CEILING, i_A=30.0)
        assert case.st.square_A2 == 0 and case.st.cross_A2 == 0
    case.step(CEILING, i_A=30.0)
    assert case.st.square_A2 > 0 and case.st.cross_A2 > 0
    lib.ht_short_circuit_ends(case.st)
    case.begun(CEILING)
    assert case.st.square_A2 == 0 and case.st.cross_A2 == 0, "nothing is left of the one before"


def test_an_encoder_that_stops_is_remembered():
    """A slow interrupt or two have seen it standing before the drive trips."""
    case = Case()
    for omega in (CEILING, 0.0):
        lib.ht_short_circuit_follow(case.cfg, case.st, omega)
    lib.ht_short_circuit_follow(case.cfg, case.st, 0.0)
    assert not case.step(0.0, doubtful=True)
    assert not case.step(0.0, doubtful=True)  # 70 % is left of it
    fast = Case()
    for omega in (1.2 * CEILING, 0.0):
        lib.ht_short_circuit_follow(fast.cfg, fast.st, omega)
    fast.begun(0.0, doubtful=True)


@pytest.mark.parametrize("vdc_V, level_V", [(0.0, 36.0), (50.0, 50.0), (1e3, 84.0), (np.nan, 36.0)])
def test_the_link_voltage_counts_between_its_trips(vdc_V, level_V):
    ceiling = level_V / (np.sqrt(3) * PSI_F)
    Case().begun(0.96 * ceiling, vdc_V=vdc_V)
    assert not any(Case().step(0.94 * ceiling, vdc_V=vdc_V) for _ in range(3))


def test_an_over_current_bars_it_until_the_shaft_is_slow():
    case = Case().begun(CEILING)
    assert not case.step(CEILING, forbidden=True)
    assert not any(case.step(CEILING) for _ in range(100))
    assert not case.step(0.85 * CEILING)
    assert case.step(CEILING)


@pytest.mark.parametrize("share, beyond", [(0.99, False), (1.01, True), (np.nan, True)])
def test_what_the_magnets_bear(share, beyond):
    case = Case()
    i = 50.0 * share * np.exp(0.7j)
    assert lib.ht_short_circuit_beyond(case.cfg, [i.real, i.imag]) == beyond
