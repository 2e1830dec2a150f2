"""ht_derating against the steady states of the machine's equivalent circuit."""

import itertools

import numpy as np
import pytest

from hexatorque.firmware import Controller, ffi, lib
from hexatorque.plant.vsd import ANGLES_RAD

MACHINE = {"rr_ohm": 2.0, "lr_H": 0.299, "lm_H": 0.284, "sigma_ls_H": 0.025, "pole_pairs": 2}
LS = 0.025 + 0.284**2 / 0.299
RATED_A = 2.6


@pytest.fixture(scope="module")
def derating():
    changes = {**MACHINE, "i_rated_A": RATED_A}
    config = ffi.new("ht_derating_config *")
    config[0] = Controller("f28335", changes).drive.config.derating
    return config


def lost(word):
    axes = ffi.new("ht_lost_legs *")
    assert lib.ht_lost_legs_of(word, axes)
    return axes


def steady_state(slip):
    """Flux and torque per ampere of stator current, by the rotor's voltage equation."""
    lr, lm = MACHINE["lr_H"], MACHINE["lm_H"]
    rotor_A = -1j * slip * lm / (MACHINE["rr_ohm"] + 1j * slip * lr)
    psi = LS + lm * rotor_A
    return abs(psi), 3 * MACHINE["pole_pairs"] * psi.conjugate().imag


def test_torque_of_every_steady_state(derating):
    for slip, i_A in itertools.product(np.geomspace(0.2, 60, 30), (1.0, 4.0)):
        flux, torque = steady_state(slip)
        got = lib.ht_derated_Nm(derating, i_A, flux * i_A)
        assert got == pytest.approx(abs(torque) * i_A**2, rel=2e-3)


def test_flux_that_makes_the_most_torque(derating):
    states = [steady_state(slip) for slip in np.geomspace(0.2, 60, 4000)]
    best = max(states, key=lambda s: abs(s[1]))[0]
    assert lib.ht_derated_Wb(derating, 3.0) == pytest.approx(3 * best, rel=2e-3)


def test_no_torque_where_the_current_does_not_even_make_the_flux(derating):
    assert lib.ht_derated_Nm(derating, 1.0, 1.01 * LS) == 0.0


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize(("share", "expected"), ((0.0, 0.5547), (1.0, 0.5774)))
def test_current_without_one_leg(derating, leg, share, expected):
    """i_xy = -(e1.i) e5 - share (n1.i) n5 over a turn: no current in the leg, and the largest
    amplitude of the others. With all of the share the leg 90 degrees away has no current either,
    and is off."""
    theta = ANGLES_RAD[leg]
    turn = np.linspace(0, 2 * np.pi, 721)
    i = np.exp(1j * turn)
    along, across = (i * np.exp(-1j * theta)).real, (i * np.exp(-1j * theta)).imag
    xy = -(along + 1j * share * across) * np.exp(5j * theta)
    phases = [(np.exp(-1j * a) * i + np.exp(-5j * a) * xy).real for a in ANGLES_RAD]
    peaks = np.abs(phases).max(axis=1)
    word = 32 >> leg
    off = lib.ht_lost_legs_paired(word) if share else word
    assert [peak < 1e-9 for peak in peaks] == [bool(off & 32 >> n) for n in range(6)]
    assert 1 / peaks.max() == pytest.approx(expected, rel=1e-3)
    got = lib.ht_derated_A(derating, lost(off))
    assert got == pytest.approx(np.sqrt(2) * RATED_A / peaks.max(), rel=1e-4)


@pytest.mark.parametrize("word", (0x2A, 0x15))
def test_current_without_a_set(derating, word):
    """The other set makes the whole current in alpha-beta: twice its share."""
    assert lib.ht_derated_A(derating, lost(word)) == pytest.approx(np.sqrt(2) * RATED_A / 2)
