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
    assert lib.ht_lost_legs_of(lib.HT_WINDING_30, word, axes)
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


def test_a_current_beyond_the_top_of_the_circle_gives_what_the_top_gives(derating):
    """The largest torque of any steady state at this flux."""
    states = [steady_state(slip) for slip in np.geomspace(0.2, 600, 4000)]
    top = max(abs(torque) / flux**2 for flux, torque in states)
    for i_A in (40.0, 100.0):
        assert lib.ht_derated_Nm(derating, i_A, 0.3) == pytest.approx(0.09 * top, rel=2e-3)


# --- while the rotor flux has not followed ------------------------------------------------

SIGMA_LS, POLE_PAIRS = MACHINE["sigma_ls_H"], MACHINE["pole_pairs"]
MAIN = LS - SIGMA_LS


def test_torque_of_any_two_fluxes(derating):
    """The current is what the fluxes differ by over sigma L_s, the torque what it makes across."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        psi, r = rng.uniform(0.05, 1.5, 2) * np.exp(1j * rng.uniform(0, np.pi / 2, 2))
        i = (psi - r) / SIGMA_LS
        torque = 3 * POLE_PAIRS * abs((psi.conjugate() * i).imag)
        got = lib.ht_derated_now_Nm(derating, abs(i), abs(psi), abs(r))
        assert got == pytest.approx(torque, rel=1e-3, abs=2e-3 * 3 * POLE_PAIRS / SIGMA_LS)


def test_no_torque_with_a_current_that_cannot_change_the_flux_so_far(derating):
    assert lib.ht_derated_now_Nm(derating, 3.9, 0.6, 0.5) == 0.0
    assert lib.ht_derated_now_Nm(derating, 3.9, 0.5, 0.6) == 0.0
    assert lib.ht_derated_now_Nm(derating, 4.1, 0.6, 0.5) > 0.0


@pytest.mark.parametrize("most_A", (3.5, 6.0, 9.0))
@pytest.mark.parametrize("share", (0.6, 0.8, 0.95, 1.1, 1.25))
def test_the_current_stays_below_its_limit_while_the_rotor_flux_follows(derating, most_A, share):
    """The drive keeps stator flux and torque for a slow period. The rotor flux goes from where it
    is to where it stands still, by its equation d r/dt = (R_r/L_r)((1 - sigma) L_s i - r)."""
    psi, r = 0.6, share * 0.6 * MAIN / LS
    torque = min(
        lib.ht_derated_now_Nm(derating, most_A, psi, r), lib.ht_derated_Nm(derating, most_A, psi)
    )
    for _ in range(4000):
        across = torque * SIGMA_LS / (3 * POLE_PAIRS * r)
        along = np.sqrt(psi**2 - across**2)
        i_d, i_q = (along - r) / SIGMA_LS, across / SIGMA_LS
        if np.hypot(i_d, i_q) > 0.999 * most_A and torque == 0:
            break  # the flux alone takes more
        assert np.hypot(i_d, i_q) < 1.001 * most_A
        r += 1e-4 * MACHINE["rr_ohm"] / MACHINE["lr_H"] * (MAIN * i_d - r)


@pytest.mark.parametrize("rotor_Wb", (0.2, 0.5))
def test_the_flux_goes_no_further_than_the_current_can(derating, rotor_Wb):
    """On the way up 44 % of the current are left for torque, sqrt(1 - 0.9^2)."""
    up = lib.ht_derated_flux_Wb(derating, 5.0, 2.0, rotor_Wb)
    down = lib.ht_derated_flux_Wb(derating, 5.0, 0.01, rotor_Wb)
    assert (up - rotor_Wb) / SIGMA_LS == pytest.approx(0.9 * 5.0, rel=1e-4)
    assert (down - rotor_Wb) / SIGMA_LS == pytest.approx(-5.0, rel=1e-4)
    assert lib.ht_derated_flux_Wb(derating, 5.0, rotor_Wb + 0.05, rotor_Wb) == pytest.approx(
        rotor_Wb + 0.05
    )
    assert lib.ht_derated_flux_Wb(derating, 5.0, 0.6, np.nan) == pytest.approx(0.6)


def test_torque_beside_the_current_along_the_flux(derating):
    got = lib.ht_derated_beside_Nm(derating, 5.0, 0.4, 3.0)
    assert got == pytest.approx(3 * POLE_PAIRS * 0.4 * 4.0, rel=1e-5)
    assert lib.ht_derated_beside_Nm(derating, 5.0, 0.4, -3.0) == got
    assert lib.ht_derated_beside_Nm(derating, 5.0, 0.4, 5.1) == 0.0


#: x-y part of what stays on for a whole period, or a third of it, over Vdc.
XY_PU = {
    "dtc1": 0.1725, "dtc2": 0.4714, "dtc3": 0.6440, "fdr": 0.0575, "ddr": 0.0575, "ddr-ml": 0.1571,
    "db-dtfc": 0.4714, "foc": 0.0575, "foc-24": 0.0575, "db-ipwm": 0.4714,
}  # fmt: skip


@pytest.mark.parametrize("scheme", XY_PU)
@pytest.mark.parametrize(("trip_A", "limit_Nm"), ((22.0, 3.0), (5.0, 3.0), (5.0, 20.0)))
def test_current_that_is_asked_for_at_most(scheme, trip_A, limit_Nm):
    """80 % of the trip, less where the ripple takes more, but what the torque limit takes with the
    full flux."""
    values = {
        **MACHINE, "scheme": scheme, "i_rated_A": 2.6, "i_trip_A": trip_A, "flux_ref_Wb": 0.6,
        "torque_limit_Nm": limit_Nm, "lxy_H": 0.01, "torque_band_Nm": 0.5, "flux_band_Wb": 0.012,
        "torque_inner_Nm": 0.2,
    }  # fmt: skip
    config = ffi.new("ht_derating_config *")
    config[0] = Controller("f28335", values).drive.config.derating
    step_A = 250.0 * 1e-4 * (0.644 / SIGMA_LS + XY_PU[scheme] / 0.01)
    if scheme in ("dtc1", "dtc2", "dtc3", "fdr", "ddr", "ddr-ml"):
        step_A += 0.012 / SIGMA_LS + 0.5 / (3 * POLE_PAIRS * 0.4)
    states = [steady_state(slip) for slip in np.geomspace(1e-4, 60, 40000)]
    needed_A = next(0.6 / f for f, t in states if abs(t) * (0.6 / f) ** 2 >= limit_Nm)
    expected = max(min(0.8 * trip_A, trip_A - step_A), needed_A)
    got = lib.ht_derated_most_A(config, ffi.NULL, 250.0, 0.4)
    assert got == pytest.approx(expected, rel=2e-3)
    without_leg = lib.ht_derated_most_A(config, lost(32), 250.0, 0.4)
    rated_A = np.sqrt(2) * 2.6
    leg_A = max(min(0.8 * trip_A, trip_A - step_A), rated_A)
    assert without_leg == pytest.approx(0.5547 * leg_A, rel=2e-3)


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
    off = lib.ht_lost_legs_paired(lib.HT_WINDING_30, word) if share else word
    assert [peak < 1e-9 for peak in peaks] == [bool(off & 32 >> n) for n in range(6)]
    assert 1 / peaks.max() == pytest.approx(expected, rel=1e-3)
    got = lib.ht_derated_A(lost(off), derating.rated_A)
    assert got == pytest.approx(np.sqrt(2) * RATED_A / peaks.max(), rel=1e-4)


@pytest.mark.parametrize("word", (0x2A, 0x15))
def test_current_without_a_set(derating, word):
    """The other set makes the whole current in alpha-beta: twice its share."""
    assert lib.ht_derated_A(lost(word), derating.rated_A) == pytest.approx(np.sqrt(2) * RATED_A / 2)


@pytest.mark.parametrize("scheme, size_pu", [
    # A set that has its legs makes this circle; the tables have vectors of Vdc/2, of ddr-ml shorter
    # ones, whose mean lies on the chord between two that are 30 degrees apart.
    ("db-dtfc", 1 / np.sqrt(3)), ("foc", 1 / np.sqrt(3)),
    ("dtc1", 0.5 * np.cos(np.pi / 12)), ("ddr", 0.5 * np.cos(np.pi / 12)),
    ("ddr-ml", 0.4375 * np.cos(np.pi / 12)),
])  # fmt: skip
def test_the_voltage_that_is_left_to_turn_the_flux(scheme, size_pu):
    """R_s and L_xy take theirs of the current along the lost leg's axis once more."""
    values = MACHINE | {"scheme": scheme, "fw_margin": 0.9, "lxy_H": 0.01, "table": "75/105"}
    config = ffi.new("ht_derating_config *")
    config[0] = Controller("f28335", values).drive.config.derating
    whole_V = 0.9 * size_pu * 250.0
    assert lib.ht_derated_V(config, 250.0, 1.8, 300.0, 0.0) == pytest.approx(whole_V, rel=2e-3)
    left_V = lib.ht_derated_V(config, 250.0, 1.8, -300.0, 4.0)
    assert left_V == pytest.approx(whole_V - 4.0 * abs(1.8 + 3.0j), rel=2e-3)
    assert lib.ht_derated_V(config, 250.0, 1.8, 300.0, 1e3) == 0.0
