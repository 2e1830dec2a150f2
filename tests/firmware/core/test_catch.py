"""ht_catch: the flux step that catches a turning shaft, against the stator's equation
d psi/dt = v - R_s i, with the rotor's flux and the current as the machine has them."""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

TS, RS, SIGMA_LS, LS, TAU = 100e-6, 1.8, 25e-3, 0.299, 0.15


def ab(z):
    return {"alpha": z.real, "beta": z.imag}


def cplx(pair):
    return complex(pair.alpha, pair.beta)


class Loop:
    """A machine whose shaft turns at a constant speed, and the law."""

    def __init__(self, omega, psi, shadow, sigma_ls=SIGMA_LS, vdc=300.0):
        self.cfg = ffi.new("ht_observer_config *", {"ts_s": TS})
        self.flux = ffi.new("ht_observer_state *", {"omega_sync_rad_s": omega, "rs_ohm": RS})
        self.state = ffi.new("ht_catch_state *")
        self.omega, self.shadow, self.vdc, self.sigma_ls = omega, shadow, vdc, sigma_ls
        self.psi = self.rotor = psi
        self.coming = 0j
        self.largest_A = 0.0
        lib.ht_catch_begin(self.state, ab(psi))

    @property
    def i(self):
        return (self.psi - self.rotor) / self.sigma_ls

    def step(self, ref, seen=None):
        """One period, which begins with a sample."""
        given_now = ffi.new(
            "ht_catch_input *",
            {
                "psi_Wb": ab(self.psi if seen is None else seen), "i_A": ab(self.i),
                "turn_rad": TS * self.omega, "flux_ref_Wb": ref, "vdc_V": self.vdc,
                "shadow": self.shadow,
            },
        )  # fmt: skip
        new = cplx(lib.ht_catch_step(self.cfg, self.flux, self.state, given_now))
        now, self.coming = (self.coming, new) if self.shadow else (new, 0j)
        assert abs(new) <= 0.5501 * self.vdc * TS
        i = self.i
        self.psi += now - TS * RS * i
        grows = ((LS - self.sigma_ls) * i - self.rotor) / TAU
        self.rotor = (self.rotor + TS * grows) * np.exp(1j * self.omega * TS)
        self.largest_A = max(self.largest_A, abs(self.i))
        return new


@settings(max_examples=examples(60), deadline=None)
@pytest.mark.parametrize("shadow", (True, False))
@given(st.floats(-900, 900), st.floats(0, 0.15), st.floats(-np.pi, np.pi), st.floats(0.8, 1.25))
def test_the_flux_comes_to_its_reference_without_torque(shadow, omega, size, angle, sigma):
    """From any flux, at any speed that the voltage holds. The current is never more than what
    the rise takes, (psi + tau d psi/dt)/L_s, and what half a period of the voltage makes."""
    loop = Loop(omega, size * np.exp(1j * angle), shadow, sigma * SIGMA_LS)
    torque = []
    ref = size
    for _ in range(4000):
        ref = min(ref + 5e-5, 0.15)
        loop.step(ref)
        torque.append((np.conj(loop.psi) * loop.i).imag)
    assert abs(loop.psi) == pytest.approx(0.15, abs=2e-3)
    ripple_A = 0.5 * abs(omega) * TS * 0.15 / loop.sigma_ls
    assert loop.largest_A < 1.1 * (0.15 + TAU * 5e-5 / TS) / LS + ripple_A + 0.1
    assert np.max(np.abs(torque[-100:])) < 0.02 * 0.15 * loop.largest_A


@pytest.mark.parametrize(("shadow", "times"), [(True, 1.5), (False, 1.0)])
@pytest.mark.parametrize("i_A", (5 + 3j, -4j, 2.0))
def test_a_step_has_the_drop_of_the_current(shadow, times, i_A):
    """The voltage makes up for it, in each direction. A pattern that waits for the next period
    has half of the drop that this period takes without it, too."""
    steps = []
    for i in (0j, i_A):
        loop = Loop(100.0, 0.1 + 0j, shadow)
        loop.rotor = loop.psi - loop.sigma_ls * i
        steps.append(loop.step(0.1))
    assert steps[1] - steps[0] == pytest.approx(times * TS * RS * i_A, rel=1e-3, abs=1e-9)


def test_the_direction_stays_a_direction():
    loop = Loop(2000.0, 0.1 + 0j, True)
    for _ in range(20_000):
        loop.step(0.1, seen=0.1 * cplx(loop.state.along))
    assert abs(cplx(loop.state.along)) == pytest.approx(1.0, abs=1e-4)


def test_without_a_flux_there_is_a_direction():
    state = ffi.new("ht_catch_state *")
    lib.ht_catch_begin(state, ab(0j))
    assert cplx(state.along) == 1


def test_the_pull_goes_from_all_to_nothing():
    state = ffi.new("ht_catch_state *")
    lib.ht_catch_begin(state, ab(0.5j))
    shares = [lib.ht_catch_pull(state) for _ in range(1000)]
    assert shares[:4] == [1.0] * 4
    assert np.allclose(shares[4:], 4.0 / np.arange(5, 1001))
