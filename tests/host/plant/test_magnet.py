"""The machine with magnets against six coupled coils around a turning magnet, in phase coordinates:
no space vector enters their equations. Then energy, steady state, coasting, and the inverter with
legs that float.
"""

from dataclasses import replace

import numpy as np
import pytest
from coils import FREE, Coils
from plant_calls import NO_LOAD, advance, instant, integrate, switch

from hexatorque.plant import machine as contract
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.load import load_record
from hexatorque.plant.machines import DISPLACEMENTS_DEG
from hexatorque.plant.machines.magnet import initial, make
from hexatorque.plant.machines.magnet_parameters import ORDERS, Parameters

#: Interior magnets: Eldeeb et al., PEDS 2017, Table I; harmonics, cogging and asymmetry are ours.
#: Surface magnets: the bench of Hu, Zhu, Liu, IEEE JESTPE 2(2), 2014.
INTERIOR = Parameters(
    3, 0.8, 6.4e-3, 17.4e-3, 0.9e-3, 0.1746, 0.01, 0.002,
    drs_ohm=(0.1, -0.05, 0.0, 0.2, 0.03, -0.1),
    emf_share=(0.04, -0.02, 0.01, 0.005), emf_deg=(0.0, 30.0, -50.0, 80.0),
    cogging_Nm=0.3, cogging_per_rev=36, start_deg=37.0,
)  # fmt: skip
SURFACE = Parameters(5, 1.096, 2.142e-3, 2.142e-3, 0.875e-3, 0.0734, 0.03)

MACHINES = {
    f"{name}, {gamma} degrees": replace(p, displacement_deg=float(gamma))
    for name, p in (("interior", INTERIOR), ("surface", SURFACE))
    for gamma in DISPLACEMENTS_DEG
}


@pytest.fixture(params=MACHINES)
def coils(request):
    return Coils(MACHINES[request.param])


def drawn(rng):
    i = FREE @ rng.normal(0, 8, 4)
    return i, rng.normal(0, 200), rng.uniform(-9, 9)


def test_currents_and_torque_are_those_of_the_coils(coils):
    rng = np.random.default_rng(1)
    m = make(coils.p)
    for _ in range(20):
        i, omega, theta = drawn(rng)
        k, i_leg, i_planes = np.empty(8), np.empty(6), np.empty(4)
        torque = instant(m, NO_LOAD, coils.state(i, omega, theta), np.zeros(4), k, i_leg, i_planes)
        np.testing.assert_allclose(i_leg, i, atol=1e-10)
        np.testing.assert_allclose(i_planes, coils.plane(i), atol=1e-10)
        assert torque == pytest.approx(coils.torque(i, theta), rel=1e-10, abs=1e-10)


def test_trajectory_is_that_of_the_coils(coils):
    """Ten steps of 100 us at up to 1900 r/min, each with the legs' voltages drawn anew: within 1e-6
    of the currents."""
    rng = np.random.default_rng(2)
    m = make(coils.p)
    i, omega, theta = drawn(rng)
    y = coils.state(i, omega, theta)
    for _ in range(10):
        v_leg = 300.0 * rng.integers(0, 2, 6)
        i, omega, theta = coils.follow(i, omega, theta, v_leg, 100e-6)
        y = integrate(m, NO_LOAD, y, [coils.plane(v_leg)], 10e-6, 10)[-1]
    expected = coils.state(i, omega, theta)
    k, i_leg, i_planes = np.empty(8), np.empty(6), np.empty(4)
    instant(m, NO_LOAD, y, np.zeros(4), k, i_leg, i_planes)
    np.testing.assert_allclose(i_leg, i, atol=1e-6 * np.abs(i).max())
    np.testing.assert_allclose(y[6:], expected[6:], rtol=1e-8)


def test_response_to_leg_voltages_and_slopes_of_rotation(coils):
    """By differences: what a volt on one leg and the rotation alone do to the currents."""
    rng = np.random.default_rng(3)
    m = make(coils.p)
    h = 1e-7
    for _ in range(5):
        i, omega, theta = drawn(rng)
        y = coils.state(i, omega, theta)
        gain = contract.incremental(m, y)
        k, i_leg, i_planes = np.empty(8), np.empty(6), np.empty(4)
        instant(m, NO_LOAD, y, np.zeros(4), k, i_leg, i_planes)
        after = [coils.follow(i, omega, theta, v, h)[0] for v in (np.zeros(6), *np.eye(6))]
        before = [coils.follow(i, omega, theta, v, -h)[0] for v in (np.zeros(6), *np.eye(6))]
        slopes = (np.array(after) - before) / (2 * h)
        for leg in range(6):
            assert contract.phase_current_slope(m, gain, k, leg) == pytest.approx(
                slopes[0, leg], rel=1e-4, abs=1e-2
            )
            for other in range(6):
                response = contract.leg_response(m, gain, leg, other)
                assert response == pytest.approx(
                    slopes[1 + other, leg] - slopes[0, leg], rel=1e-3, abs=1e-2
                )


def test_energy(coils):
    """What the terminals give is copper loss, friction, and what coils and shaft keep."""
    p = coils.p
    m = make(p)
    dt, rng = 5e-6, np.random.default_rng(4)
    y = coils.state(np.zeros(6), 80.0, 0.1)

    def kept(y):
        k, i, planes = np.empty(8), np.empty(6), np.empty(4)
        instant(m, NO_LOAD, y, np.zeros(4), k, i, planes)
        t = coils.t(y[7])
        cogging = -p.cogging_Nm / p.cogging_per_rev * np.cos(p.cogging_per_rev * y[7])
        return (
            0.5 * i @ coils.inductance(t) @ i + 0.5 * p.inertia_kgm2 * y[6] ** 2 + cogging,
            i,
        )

    before, _ = kept(y)
    given = lost = 0.0
    for _ in range(200):
        v_leg = 300.0 * rng.integers(0, 2, 6)
        states = [y, *integrate(m, NO_LOAD, y, [coils.plane(v_leg)], dt, 2)]
        currents = [kept(state)[1] for state in states]
        weights = np.array([1, 4, 1]) * 2 * dt / 6
        given += sum(w * v_leg @ i for w, i in zip(weights, currents))
        lost += sum(
            w * (coils.ohm @ i**2 + p.viscous_Nms * s[6] ** 2)
            for w, i, s in zip(weights, currents, states)
        )
        y = states[-1]
    after, _ = kept(y)
    assert abs(given - lost - (after - before)) < 2e-6 * (abs(given) + lost)


@pytest.mark.parametrize("displacement_deg, in_xy", [(30, (5, 7)), (0, ()), (60, ())])
def test_harmonics_appear_in_the_plane_that_the_winding_gives_them(displacement_deg, in_xy):
    """cos(6 k gamma) = 1: alpha-beta; -1: x-y."""
    for k, order in enumerate(ORDERS):
        share = [0.0] * 4
        share[k] = 0.1
        p = replace(SURFACE, emf_share=tuple(share), displacement_deg=float(displacement_deg))
        y = initial(make(p))
        ab, xy = np.hypot(y[0] - p.psi_f_Wb, y[1]), np.hypot(*y[2:4])
        size = p.psi_f_Wb * 0.1 / order
        here, there = (xy, ab) if order in in_xy else (ab, xy)
        assert here == pytest.approx(size, rel=1e-9) and there < 1e-12


def test_without_current_the_flux_stays_the_magnets_while_it_coasts():
    p = replace(INTERIOR, cogging_Nm=0.0)
    coils, m = Coils(p), make(p)
    y = coils.state(np.zeros(6), 100.0, 0.0)
    inv = inverter_record(displacement_deg=p.displacement_deg)
    load = load_record("generator", 0.5, 1000.0)
    states, _ = advance(inv, m, load, y, 1e-3, 400.0, 200)
    rate = (p.viscous_Nms + load.linear_Nms) / p.inertia_kgm2
    assert states[-1][6] == pytest.approx(100.0 * np.exp(-rate * 0.2), rel=1e-6)
    for state in states:
        expected = coils.state(np.zeros(6), state[6], state[7])
        np.testing.assert_allclose(state, expected, atol=1e-12)


@pytest.mark.parametrize("pu, conducts", [(0.95, False), (1.1, True)])
def test_above_the_dc_links_voltage_the_magnets_drive_current_through_the_diodes(pu, conducts):
    """Gates off: no current while the voltage between two terminals stays below the link's."""
    p = replace(INTERIOR, cogging_Nm=0.0, emf_share=(0.0,) * 4, inertia_kgm2=10.0)
    vdc = 500.0
    omega = pu * vdc / (np.sqrt(3) * p.psi_f_Wb * p.most_emf) / p.pole_pairs
    coils, m = Coils(p), make(p)
    y = coils.state(np.zeros(6), omega, 0.0)
    inv = inverter_record(displacement_deg=p.displacement_deg)
    k, i, planes = np.empty(8), np.empty(6), np.empty(4)
    most, braking = 0.0, 0.0
    for _ in range(200):
        advance(inv, m, NO_LOAD, y, 50e-6, vdc)
        torque = instant(m, NO_LOAD, y, np.zeros(4), k, i, planes)
        most, braking = max(most, np.abs(i).max()), min(braking, torque)
    assert (most > 0.5) == conducts
    assert (braking < -0.05) == conducts


def test_floating_legs_carry_no_current():
    """Dead times and diodes in all their combinations: a floating leg stays at zero, and no diode
    carries current against its direction."""
    rng = np.random.default_rng(5)
    m = make(INTERIOR)
    y = Coils(INTERIOR).state(np.zeros(6), 60.0, 0.0)
    inv = inverter_record(displacement_deg=INTERIOR.displacement_deg)
    legs = rng.choice([LOW, HIGH, OFF], (400, 6))
    assert switch(inv, m, NO_LOAD, y, 300.0, legs, rng.uniform(1e-6, 60e-6, 400)) < 1e-4


@pytest.mark.parametrize("rail", [1, -1])
def test_currents_of_rounding_against_their_diodes_do_not_stop_the_time(rail):
    """A zero is located to 1e-9 of the current's change, so that 2e-10 A may be left against a
    diode that conducts, and after a thousand radians the angle's rounding is as much. Where two
    other diodes end at the same instant, this must not keep the simulation there."""
    p = replace(SURFACE, cogging_Nm=0.0)
    coils, m = Coils(p), make(p)
    k, i, planes = np.empty(8), np.empty(6), np.empty(4)
    for seed in range(400):
        rng = np.random.default_rng(seed)
        inv = inverter_record(displacement_deg=p.displacement_deg)
        at, left = FREE @ rng.normal(0, 4, 4), rng.normal(0, 2e-10, 3)
        at[::2] = left - left.mean()
        y = coils.state(at, rng.normal(0, 8), rng.uniform(1e3, 1e4))
        switch(inv, m, NO_LOAD, y, 20.0, np.array([[OFF, LOW, OFF, HIGH, OFF, LOW]]), np.zeros(1))
        inv.diode[::2] = rail
        advance(inv, m, NO_LOAD, y, 5e-6, 20.0, 4)
        instant(m, NO_LOAD, y, np.zeros(4), k, i, planes)
        assert np.all(i[::2] * inv.diode[::2] > -1e-9)


def test_least_current_is_the_least():
    """Against a search over all i_d."""
    for p in (INTERIOR, SURFACE):
        for torque_Nm in (-8.0, 0.5, 10.6):
            id_A, iq_A = p.least_current(torque_Nm)
            assert p.torque_Nm(id_A, iq_A) == pytest.approx(torque_Nm, rel=1e-6)
            tried = np.linspace(-30, 5, 20001)
            per_A = 3 * p.pole_pairs * (p.psi_f_Wb + (p.ld_H - p.lq_H) * tried)
            assert np.hypot(id_A, iq_A) <= np.hypot(tried, torque_Nm / per_A).min() * (1 + 1e-6)


def test_the_pull_out_torque_is_the_most_of_all_currents_with_this_flux():
    reversed_saliency = replace(INTERIOR, ld_H=17.4e-3, lq_H=6.4e-3)
    for p in (INTERIOR, SURFACE, reversed_saliency):
        angle = np.linspace(0, np.pi, 100001)
        for flux_Wb in (0.3 * p.psi_f_Wb, p.psi_f_Wb, 3 * p.psi_f_Wb):
            id_A = (flux_Wb * np.cos(angle) - p.psi_f_Wb) / p.ld_H
            iq_A = flux_Wb * np.sin(angle) / p.lq_H
            torque_Nm = 3 * p.pole_pairs * (p.psi_f_Wb + (p.ld_H - p.lq_H) * id_A) * iq_A
            assert p.pull_out_Nm(flux_Wb) == pytest.approx(torque_Nm.max(), rel=1e-8)
