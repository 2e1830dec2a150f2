"""ht_foc_law against the machine it is for: an ideal winding behind the committed period. The poles
follow from its equations, and what the loop does follows from the poles.
"""

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TS, VDC = 1e-4, 300.0
SIGMA_LS, LS, LXY, RS, GAIN = 0.028, 0.27, 0.0144, 6.0, 3.0
ALPHA = 0.3
REACH = 1 / np.sqrt(3)


def pair(z):
    return [z.real, z.imag]


class Loop:
    """The law and an ideal machine whose rotor flux turns with constant length. One period is
    committed at any time, as on the PWM. off_V: a voltage that nobody knows of."""

    def __init__(self, rotor_Wb, turn=0.0, off_V=0j):
        self.cfg = ffi.new("ht_foc_law_config *", [ALPHA, 2e-3])
        assert lib.ht_foc_law_check(self.cfg)
        self.state = unwritten("ht_foc_law_state *")
        lib.ht_foc_law_reset(self.state)
        self.machine = ffi.new(
            "ht_observer_config *",
            {"ts_s": TS, "inv_ts": 1 / TS, "rs_ohm": RS, "sigma_ls_H": SIGMA_LS,
             "inv_sigma_ls": 1 / SIGMA_LS, "lxy_H": LXY, "torque_gain": GAIN},
        )  # fmt: skip
        self.rotor, self.turn, self.off_V = complex(rotor_Wb), turn, off_V
        self.psi = self.rotor * LS / (LS - SIGMA_LS)  # no load, in steady state
        self.v = None  # committed

    def i(self):
        """Current in the frame."""
        return (self.psi - self.rotor) / SIGMA_LS * abs(self.rotor) / self.rotor

    def next_state(self, v, off_V=0j):
        i = (self.psi - self.rotor) / SIGMA_LS
        return self.psi + TS * (VDC * v + off_V - RS * i), self.rotor * np.exp(1j * self.turn)

    def step(self, torque, flux):
        if self.v is None:  # holds the steady state
            i = (self.psi - self.rotor) / SIGMA_LS
            self.v = (self.psi * (np.exp(1j * self.turn) - 1) / TS + RS * i) / VDC
        i = (self.psi - self.rotor) / SIGMA_LS
        psi, rotor = self.next_state(self.v)  # what the predictor knows
        seen = ffi.new(
            "ht_voltage_law_input *",
            [pair(psi), pair(rotor), [0, 0], [pair(i), [0, 0]], self.turn, RS, torque, flux, VDC],
        )
        v = lib.ht_foc_law_step(self.cfg, self.machine, self.state, seen)
        self.psi, self.rotor = self.next_state(self.v, self.off_V)
        self.v = complex(v.ab.alpha, v.ab.beta)
        return self.i()


ROTOR = 0.4 * (LS - SIGMA_LS) / LS  # at no load the stator flux is 0.4 Wb


@pytest.mark.parametrize("turn", [0.0, 0.02, -0.02])
def test_torque_answers_in_first_order_without_overshoot(turn):
    """A pole at 1 - a; the other one, at the same place, has its zero. A command acts from the
    second period on: the first is committed."""
    loop = Loop(ROTOR, turn)
    for _ in range(5):
        loop.step(0.0, 0.4)
    torque = 1.0
    wanted = torque / (GAIN * ROTOR)
    i_q = np.array([loop.step(torque, 0.4).imag for _ in range(40)])
    expected = wanted * (1 - (1 - ALPHA) ** np.arange(40))
    assert np.abs(i_q - expected).max() < 0.02 * wanted
    assert i_q.max() < 1.005 * wanted


def test_an_unknown_voltage_is_removed_by_the_double_pole():
    """A voltage step that adds d to the current in each period is not in the prediction either:
    e(k) = d (k p^(k-1) + 2 a (k-1) p^(k-2)), p = 1 - a, from the loop's equation."""
    loop = Loop(ROTOR, 0.02)
    for _ in range(60):
        start = loop.step(0.5, 0.4)
    loop.off_V = 10 * loop.rotor / abs(loop.rotor)
    error = []
    for _ in range(80):
        loop.off_V *= np.exp(1j * loop.turn)  # stands still in the frame
        error.append(abs(loop.step(0.5, 0.4) - start))
    k, p = np.arange(1, 81), 1 - ALPHA
    expected = k * p ** (k - 1) + 2 * ALPHA * (k - 1) * p ** (k - 2)
    np.testing.assert_allclose(error, 10 * TS / SIGMA_LS * expected, atol=0.05 * max(error))
    assert error[60] < 1e-3 * max(error)


def test_the_flux_has_its_length_whatever_the_rotor_flux_is():
    """The reference falls by a tenth, as field weakening makes it fall. The stator flux is there
    within some periods and stays, while the rotor's follows with its own time constant, and the
    torque does not notice."""
    tau, length = 0.1, 0.4
    loop = Loop(ROTOR, 0.01)
    sizes, torques = [], []
    for k in range(3000):
        i = loop.step(0.5, length if k < 100 else 0.9 * length)
        change = TS / tau * ((LS - SIGMA_LS) * i.real - abs(loop.rotor))
        change *= loop.rotor / abs(loop.rotor)
        loop.rotor += change
        loop.psi += change  # i stays
        sizes.append(abs(loop.psi))
        torques.append(GAIN * abs(loop.rotor) * loop.i().imag)
    np.testing.assert_allclose(sizes[150:], 0.9 * length, rtol=5e-3)
    np.testing.assert_allclose(torques[50:], 0.5, atol=0.01)
    assert abs(loop.rotor) == pytest.approx(0.9 * ROTOR, rel=0.02)


def test_a_step_beyond_the_voltage_does_not_wind_up():
    loop = Loop(ROTOR, 0.02)
    for _ in range(50):
        loop.step(0.0, 0.4)
    torque = 6.0
    wanted = torque / (GAIN * ROTOR)
    sizes, i_q = [], []
    for _ in range(150):
        i_q.append(loop.step(torque, 0.4).imag)
        sizes.append(abs(loop.v))
    assert max(sizes) == pytest.approx(REACH, rel=1e-4)  # the step was too large for the inverter
    assert sum(np.isclose(sizes, REACH, rtol=1e-4)) > 5
    assert max(i_q) < 1.02 * wanted
    assert i_q[-1] == pytest.approx(wanted, rel=0.01)


def test_torque_is_exact_at_any_flux():
    """T = 3 P r x i: a weak rotor flux takes more current."""
    for share in (0.5, 1.0):
        loop = Loop(share * ROTOR, 0.01)
        for _ in range(100):
            i = loop.step(0.6, 0.4 * share)
        assert GAIN * abs(loop.rotor) * i.imag == pytest.approx(0.6, rel=1e-3)


@pytest.mark.parametrize(("share", "left"), ((1.2, 0.1), (0.98, np.sqrt(1 - 0.98**2))))
def test_torque_that_takes_the_whole_flux_or_more(share, left):
    """Its part of the flux, across the rotor's, is this share of the length that is asked for. Of
    more than 1, no flux along the rotor's makes up for: a tenth of the length stays there."""
    loop = Loop(ROTOR, 0.01)
    wanted = share * 0.4 / SIGMA_LS
    for _ in range(400):
        i = loop.step(GAIN * ROTOR * wanted, 0.4)
    assert i.imag == pytest.approx(wanted, rel=1e-3)
    along = (loop.psi * loop.rotor.conjugate()).real / abs(loop.rotor)
    assert along == pytest.approx(left * 0.4, rel=1e-2)


@pytest.mark.parametrize("flux", (0.8, 0.1))
def test_a_step_of_the_flux_takes_a_tenth_of_the_dc_link(flux):
    """More would take from the torque what it needs."""
    loop = Loop(ROTOR)
    for _ in range(30):
        loop.step(0.0, 0.4)
    held = loop.v.real
    loop.step(0.0, flux)
    assert loop.v.real - held == pytest.approx(np.copysign(0.1, flux - 0.4), rel=0.02)
    assert abs(loop.v.imag) < 1e-3


def test_without_rotor_flux_the_command_stays_finite():
    loop = Loop(ROTOR)
    loop.rotor = 0j
    loop.i = lambda: loop.psi / SIGMA_LS
    for _ in range(20):
        loop.step(0.5, 0.4)
        assert np.isfinite(loop.v) and abs(loop.v) < 1.001 * REACH


@pytest.mark.parametrize(
    ("index", "value"), [(0, 0.0), (0, 0.6), (0, np.nan), (1, -1.0), (1, np.inf), (1, np.nan)]
)
def test_configurations_out_of_range_are_refused(index, value):
    values = [ALPHA, 2e-3]
    values[index] = value
    assert not lib.ht_foc_law_check(ffi.new("ht_foc_law_config *", values))
