"""The machine with magnets and a table of flux linkages. The reference is one function, the energy
of six windings over their fluxes and the rotor's angle: currents and torque are its derivatives.
"""

from dataclasses import replace

import numpy as np
import pytest
from flux_tables import Iron, fitted
from plant_calls import NO_LOAD, instant, integrate
from scipy.integrate import solve_ivp

from hexatorque.plant import machine as contract
from hexatorque.plant.machines import flux_map
from hexatorque.plant.machines.magnet import initial, make
from hexatorque.plant.machines.magnet_parameters import Parameters
from hexatorque.plant.vsd import angles_rad

IRON = Iron()
MOST_A = 50.0
#: psi_f, L_d and L_q are the drive's belief: the plant takes all three from the table.
P = Parameters(3, 0.8, 5e-3, 12e-3, 0.9e-3, 0.16, 0.01, 0.002, start_deg=37.0)


def negative():
    """With a table of no positive i_d, as many are printed."""
    return replace(P, flux_map=fitted([row for row in IRON.rows(MOST_A, 41) if row[0] <= 0]))


@pytest.fixture(scope="module", params=[""])
def p(request):
    if request.param == "i_d <= 0":
        return negative()
    return replace(P, flux_map=fitted(IRON.rows(MOST_A, 41)))


with_negative = pytest.mark.parametrize("p", ["", "i_d <= 0"], indirect=True)


ANGLES = angles_rad(30.0)


def six_J(psi, theta):
    """Energy of the field of six phase fluxes (no zero sequence) with the rotor at theta."""
    at = np.deg2rad(P.start_deg) + P.pole_pairs * theta
    d = sum(psi * np.cos(ANGLES - at)) / 3
    q = sum(psi * np.sin(ANGLES - at)) / 3
    x, y = sum(psi * np.cos(5 * ANGLES)) / 3, sum(psi * np.sin(5 * ANGLES)) / 3
    return 3 * IRON.energy_J(d, q) + 1.5 * (x**2 + y**2) / P.lxy_H


def by_its_derivatives(psi, theta):
    """(six currents, torque): complex steps have no error of differences."""
    h = 1e-30
    steps = 1j * h * np.eye(6)
    currents = np.array([six_J(psi + step, theta).imag for step in steps]) / h
    return currents, -six_J(psi + 0j, theta + 1j * h).imag / h


def planes(six):
    e = np.exp(1j * ANGLES)
    ab, xy = six @ e / 3, six @ np.exp(5j * ANGLES) / 3
    return np.array([ab.real, ab.imag, xy.real, xy.imag])


def phases(four):
    return np.array([four @ planes(one) * 3 for one in np.eye(6)])


def look(m, y):
    k, i_leg, i = np.empty(8), np.empty(6), np.empty(4)
    torque = instant(m, NO_LOAD, y, np.zeros(4), k, i_leg, i)
    return i_leg, torque, k


def drawn(rng, most_A=35.0):
    """A state whose currents the table has."""
    d, q = IRON.flux_Wb(*rng.uniform(-most_A, most_A, 2))
    theta = rng.uniform(-9, 9)
    at = np.exp(1j * (np.deg2rad(P.start_deg) + P.pole_pairs * theta))
    ab = (d + 1j * q) * at
    return np.array([ab.real, ab.imag, *rng.normal(0, 5e-3, 2), 0, 0, rng.normal(0, 200), theta])


def test_currents_and_torque_are_the_energys_derivatives(p):
    rng, m = np.random.default_rng(1), make(p)
    for _ in range(100):
        y = drawn(rng)
        i, torque, _ = look(m, y)
        wanted, wanted_Nm = by_its_derivatives(phases(y[:4]), y[7])
        np.testing.assert_allclose(i, wanted, atol=1e-6 * MOST_A)
        assert torque == pytest.approx(wanted_Nm, rel=1e-6, abs=1e-5)


def test_trajectory_is_that_of_six_windings(p):
    """Twenty intervals of 100 us, with voltages that are drawn: scipy's DOP853 over phase fluxes,
    from the energy. Within 1e-6 of the currents; the linear machine is amperes away."""
    rng, m = np.random.default_rng(2), make(p)
    linear = make(replace(P, psi_f_Wb=IRON.psi_f, ld_H=IRON.ld, lq_H=IRON.lq))
    y = drawn(rng, 5.0)
    straight = y.copy()
    natural = np.array([*phases(y[:4]), *y[6:]])
    peak = 0.0
    for _ in range(20):
        v = 250.0 * rng.integers(0, 2, 6)
        v = v - np.where(np.arange(6) % 2 == 0, v[::2].mean(), v[1::2].mean())

        def slope(_t, z, v=v):
            i, torque = by_its_derivatives(z[:6], z[7])
            return [*(v - P.rs_ohm * i), (torque - P.viscous_Nms * z[6]) / P.inertia_kgm2, z[6]]

        natural = solve_ivp(slope, (0, 100e-6), natural, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        y = integrate(m, NO_LOAD, y, [planes(v)], 5e-6, 20)[-1]
        wanted, _ = by_its_derivatives(natural[:6], natural[7])
        peak = max(peak, abs(wanted).max())
        straight = integrate(linear, NO_LOAD, straight, [planes(v)], 5e-6, 20)[-1]
        np.testing.assert_allclose(look(m, y)[0], wanted, atol=1e-6 * peak)
    np.testing.assert_allclose(y[6:], natural[6:], rtol=1e-7)
    assert abs(look(linear, straight)[0] - wanted).max() > 1.0


def field_J(m, y):
    """What it takes to bring the plant's currents to this state at a rotor that does not move:
    Gauss's rule along a straight line of the fluxes."""
    at_rest = initial(m)
    at = np.exp(1j * P.pole_pairs * y[7])
    start = at_rest.copy()
    for k in (0, 2):
        turned = complex(*at_rest[k : k + 2]) * (at if k == 0 else 1)
        start[k : k + 2] = turned.real, turned.imag
    total, (places, weights) = 0.0, np.polynomial.legendre.leggauss(60)
    for place, weight in zip(places, weights):
        z = y.copy()
        z[:4] = start[:4] + (1 + place) / 2 * (y[:4] - start[:4])
        i = np.empty(4)
        instant(m, NO_LOAD, z, np.zeros(4), np.empty(8), np.empty(6), i)
        total += 1.5 * weight * i @ (y[:4] - start[:4])
    return total


def test_energy_closes(p):
    """What the terminals give is copper loss, friction, and what field and shaft keep."""
    rng, m, dt = np.random.default_rng(4), make(p), 5e-6
    y = drawn(rng, 5.0)

    def kept(y):
        return field_J(m, y) + 0.5 * P.inertia_kgm2 * y[6] ** 2

    before, given, lost = kept(y), 0.0, 0.0
    for _ in range(100):
        v = planes(250.0 * rng.integers(0, 2, 6))
        states = [y, *integrate(m, NO_LOAD, y, [v], dt, 2)]
        for weight, state in zip(np.array([1, 4, 1]) * 2 * dt / 6, states):
            i = look(m, state)[0]
            given += weight * 3 * v @ planes(i)
            lost += weight * (P.rs_ohm * i @ i + P.viscous_Nms * state[6] ** 2)
        y = states[-1]
    assert abs(given - lost - (kept(y) - before)) < 2e-6 * (abs(given) + lost)


@with_negative
@pytest.mark.parametrize("reach", [0.1, 0.6])  # within the table's fluxes, and beyond all edges
def test_no_energy_is_won_on_a_closed_path(p, reach):
    """Around drawn triangles of the fluxes: as the cross inductances are alike everywhere."""
    rng, m = np.random.default_rng(5), make(p)
    places, weights = np.polynomial.legendre.leggauss(8)
    parts = 50
    for _ in range(3):
        corners = rng.uniform(-reach, reach, (3, 2))
        won = turned = 0.0
        for a, b in zip(corners, np.roll(corners, -1, axis=0)):
            for n in range(parts):
                for place, weight in zip(places, weights):
                    at = a + (n + (1 + place) / 2) / parts * (b - a)
                    e = flux_map.excess_current(m, complex(*at))
                    part = np.array([e.real, e.imag]) * (b - a) * weight / 2 / parts
                    won, turned = won + part.sum(), turned + abs(part).sum()
        assert abs(won) < 1e-5 * turned
        assert turned > 1e-3


@with_negative
@pytest.mark.parametrize("reach", [0.1, 0.6])
def test_slopes_of_the_currents_by_the_fluxes_are_their_differences(p, reach):
    rng, m, h = np.random.default_rng(6), make(p), 1e-7
    for _ in range(50):
        r = complex(*rng.uniform(-reach, reach, 2))
        dd, dq, qq = flux_map.excess_per_H(m, r)
        by_d, by_q = (
            (flux_map.excess_current(m, r + s) - flux_map.excess_current(m, r - s)) / (2 * h)
            for s in (h, 1j * h)
        )
        found = [by_d.real, by_d.imag, by_q.real, by_q.imag]
        np.testing.assert_allclose(found, [dd, dq, dq, qq], rtol=1e-4, atol=1e-3)


def test_legs_answer_as_the_incremental_inductances_say(p):
    """What a volt on one leg and the rotation alone do to the currents, by the energy."""
    rng, m, h = np.random.default_rng(3), make(p), 1e-7
    for _ in range(5):
        y = drawn(rng)
        gain = contract.incremental(m, y)
        psi, theta = phases(y[:4]), y[7]

        def rate(slopes, psi=psi, theta=theta, omega=y[6]):
            after, before = (
                by_its_derivatives(psi + s * slopes, theta + s * omega)[0] for s in (h, -h)
            )
            return (after - before) / (2 * h)

        _, _, k = look(m, y)
        still = rate(phases(k[:4]))
        for leg in range(6):
            assert contract.phase_current_slope(m, gain, k, leg) == pytest.approx(
                still[leg], rel=1e-4, abs=0.5
            )
            v = np.eye(6)[leg]
            driven = rate(phases(k[:4]) + phases(planes(v))) - still
            for other in range(6):
                assert contract.leg_response(m, gain, other, leg) == pytest.approx(
                    driven[other], rel=1e-3, abs=2e-2
                )
        assert not contract.constant_response(m)


def test_a_step_of_voltage_raises_the_current_faster_the_more_the_iron_saturates(p):
    """10 V across q for 10 us at a rotor that does not turn, from no current and from 35 A."""
    m = make(replace(p, rs_ohm=1e-4, inertia_kgm2=1e5, start_deg=0.0))
    rises = []
    for i_q in (0.0, 35.0):
        y = np.zeros(8)
        y[:2] = d, q = IRON.flux_Wb(0.0, i_q)
        after = integrate(m, NO_LOAD, y, [np.array([0.0, 10.0, 0, 0])], 1e-6, 10)[-1]
        i = np.empty((2, 4))
        for row, state in zip(i, (y, after)):
            instant(m, NO_LOAD, state, np.zeros(4), np.empty(8), np.empty(6), row)
        rise = i[1] - i[0]
        np.testing.assert_allclose(rise[:2], IRON.per_H(d, q)[:, 1] * 1e-4, rtol=5e-3, atol=1e-4)
        rises.append(rise[1])
    assert rises[1] > 2 * rises[0]


def constant(p, most_A):
    for i_d in np.linspace(-most_A, most_A, 9):
        for i_q in np.linspace(-most_A, most_A, 7):
            yield i_d, i_q, p.psi_f_Wb + p.ld_H * i_d, p.lq_H * i_q


def test_a_table_of_constant_inductances_is_the_linear_machine():
    """With harmonics and unequal resistances, to states far beyond the table."""
    p = replace(P, drs_ohm=(0.1, -0.05, 0.0, 0.2, 0.03, -0.1), emf_share=(0.04, -0.02, 0.01, 0.005))
    linear = make(p)
    found = fitted(constant(p, 10.0))
    m = make(replace(p, flux_map=found))
    rng = np.random.default_rng(7)
    y = [initial(linear), initial(m)]
    np.testing.assert_allclose(y[1], y[0], rtol=1e-12, atol=1e-15)
    for n in range(30):
        v = planes((300.0 if n < 20 else 3000.0) * rng.integers(0, 2, 6))
        y = [integrate(one, NO_LOAD, at, [v], 10e-6, 10)[-1] for one, at in zip((linear, m), y)]
        np.testing.assert_allclose(y[1], y[0], rtol=1e-9, atol=1e-12)
        for a, b in zip(look(m, y[1]), look(linear, y[0])):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-7)
    assert np.hypot(*y[0][:2]) > 2 * found.fields["last_Wb"][1]


@with_negative
def test_what_the_table_says_is_at_its_rows(p):
    """Rows themselves, mirrored ones too."""
    m, found = make(p), p.flux_map
    most_d_A = MOST_A if found.fields["last_Wb"][0] > 1e-3 else 0.0
    assert found.off_Wb < 1e-6 and found.psi_f_Wb == pytest.approx(IRON.psi_f)
    y = np.zeros(8)
    for i_d, i_q, d, q in IRON.rows(MOST_A, 11):
        for sign in (1, -1) if i_d <= most_d_A else ():
            at = (d + 1j * sign * q) * np.exp(1j * np.deg2rad(P.start_deg))
            y[:2] = at.real, at.imag
            i = np.empty(4)
            instant(m, NO_LOAD, y, np.zeros(4), np.empty(8), np.empty(6), i)
            seen = complex(i[0], i[1]) * np.exp(-1j * np.deg2rad(P.start_deg))
            assert seen == pytest.approx(i_d + 1j * sign * i_q, abs=2e-4)


def test_beyond_the_table_along_d_the_current_is_straight_with_the_tables_least_inductance():
    """Iron that has saturated on the way to no current does not get better beyond it."""
    made = negative()
    m, ld_H = make(made), made.flux_map.ld_H
    slopes = [1 / ld_H + flux_map.excess_per_H(m, complex(d))[0] for d in (1e-3, 0.02, 0.1)]
    most = max(IRON.per_H(d, q)[0, 0] for i_d, _, d, q in IRON.rows(MOST_A, 41) if i_d <= 0)
    assert slopes == [slopes[0]] * 3 and slopes[0] == pytest.approx(most, rel=0.01)
    assert slopes[0] > 1 / IRON.ld


@with_negative
def test_at_no_current_coasting_has_none(p):
    m = make(p)
    y = initial(m)
    y[6] = 30.0
    assert contract.coast(m, NO_LOAD, y, 1e-3, 1e3)
    assert abs(look(m, y)[0]).max() < 1e-9
