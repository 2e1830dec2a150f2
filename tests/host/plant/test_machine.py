"""The compiled machine is compared with independent physics: its matrices, derivative and
trajectory with twelve coupled coils (conftest), its steady state with the per-phase equivalent
circuit, its energy with an energy balance. Loads are compared with their specified torque.
"""

from dataclasses import replace

import numpy as np
import pytest
from plant_calls import NO_LOAD, instant, integrate, load_torque, torque_Nm
from scipy.integrate import solve_ivp

from hexatorque.plant.load import LOAD, load_record
from hexatorque.plant.machines.induction import make
from hexatorque.plant.record import record

VDC = 300.0


@pytest.fixture
def model(any_winding):
    return any_winding


def vsd(legs, displacement_deg=30.0):
    """alpha, beta, x, y of phase quantities, written out: the papers' rows for 30 degrees, else
    the sum of both sets' space vectors and the conjugate of their difference, halved."""
    turned = np.array([0, 1] * 3)
    angles = np.radians([0, 0, 120, 120, 240, 240] + displacement_deg * turned)
    other = 5 * angles if displacement_deg == 30 else np.pi * turned - angles
    rows = [f(a) for a in (angles, other) for f in (np.cos, np.sin)]
    return np.asarray(legs) @ np.array(rows).T / 3


def random_currents(rng, displacement_deg):
    i_s = rng.normal(0, 5, 6)
    i_s[::2] -= i_s[::2].mean()
    i_s[1::2] -= i_s[1::2].mean()
    # Any rotor current with an alpha-beta part only, because the stator induces no other.
    angles = np.radians([0, 0, 120, 120, 240, 240] + displacement_deg * np.array([0, 1] * 3))
    i_r = np.cos(angles) * rng.normal(0, 5) + np.sin(angles) * rng.normal(0, 5)
    return i_s, i_r


def test_currents_torque_and_slopes_agree_with_the_coils(model):
    rng = np.random.default_rng(1)
    m, deg = make(model.p), model.p.displacement_deg
    for _ in range(20):
        i_s, i_r = random_currents(rng, deg)
        omega, theta = rng.normal(0, 100), rng.uniform(-9, 9)
        v_leg = VDC * rng.integers(0, 2, 6)
        y = model.state(i_s, i_r, omega, theta)
        k, i_leg, i = np.empty(8), np.empty(6), np.empty(4)
        torque = instant(m, NO_LOAD, y, vsd(v_leg, deg), k, i_leg, i)
        theta_e = model.p.pole_pairs * theta
        np.testing.assert_allclose(i_leg, i_s, atol=1e-11)
        np.testing.assert_allclose(i, vsd(i_s, deg), atol=1e-11)
        assert torque == pytest.approx(model.torque(i_s, i_r, theta_e), rel=1e-10, abs=1e-10)
        # For the slopes, take the coils' fluxes a little earlier and later as plant states.
        slopes = model.flux_slopes(i_s, i_r, v_leg)
        flux = model.fluxes(i_s, i_r, theta_e)
        h = 1e-6
        early, late = (
            model.state(
                *model.solve(flux + t * slopes, theta_e + model.p.pole_pairs * omega * t),
                omega,
                theta + omega * t,
            )
            for t in (-h, h)
        )
        np.testing.assert_allclose(k[:6], (late - early)[:6] / (2 * h), atol=2e-5, rtol=1e-6)
        accelerating = torque - model.p.viscous_Nms * omega
        assert k[6] == pytest.approx(accelerating / model.p.inertia_kgm2, rel=1e-10)
        assert k[7] == omega


def test_response_of_phase_currents_to_leg_voltages(model):
    inverse = np.linalg.inv(model.free_inductance(0.3))[:4, :4]
    expected = model.free @ inverse @ model.free.T
    np.testing.assert_allclose(make(model.p).g_leg, expected, atol=1e-9)


def switched(direction, displacement_deg=30.0):
    """20 ms of a rotating active state, 50 Hz, 200 us each, every third one a zero state."""
    steps = np.arange(100)
    angles = np.radians([0, 0, 120, 120, 240, 240] + displacement_deg * np.array([0, 1] * 3))
    turning = direction * 2 * np.pi * 50 * 200e-6 * steps[:, None]
    return VDC * (np.cos(turning - angles) > 0) * (steps % 3 > 0)[:, None]


@pytest.mark.parametrize("direction", [1, -1])
def test_trajectory_is_that_of_the_coils_to_fourth_order(model, direction):
    deg = model.p.displacement_deg
    legs = switched(direction, deg)
    load = record(LOAD, **{n: 0.0 for n in LOAD.names} | {
        "linear_Nms": 0.02, "quadratic_Nms2": 1e-3, "eddy_rad_s": 1.0,
    })  # fmt: skip
    z = np.zeros(12)
    for v_leg in legs:
        z = model.follow(z, v_leg, 200e-6, lambda w: 0.02 * w + 1e-3 * w * abs(w)).y[:, -1]
    expected = model.plant_state(z)
    m = make(model.p)
    final = [
        integrate(m, load, np.zeros(8), vsd(legs, deg), 200e-6 / n, n)[-1] for n in (1, 2, 4, 20)
    ]
    errors = [np.max(np.abs(y - expected) / (np.abs(expected) + 0.1)) for y in final]
    assert direction * expected[6] > 1  # it did turn
    assert errors[-1] < 1e-8
    assert 12 < errors[0] / errors[1] < 20
    assert 12 < errors[1] / errors[2] < 20


@pytest.mark.parametrize("slip", [0.04, -0.04, 1.0, 0.002, 1.9])
@pytest.mark.parametrize("direction", [1, -1])
def test_steady_state_is_that_of_the_equivalent_circuit(symmetric, slip, direction):
    p = replace(symmetric.p, inertia_kgm2=1e9)
    w, amplitude = 2 * np.pi * 50, 120.0
    rotor = p.rr_ohm / slip + 1j * w * p.llr_H
    magnetising = 1j * w * p.lm_H
    parallel = rotor * magnetising / (rotor + magnetising)
    i_s = amplitude / (p.rs_ohm + 1j * w * p.lls_H + parallel)
    i_r = i_s * parallel / rotor
    torque = direction * 3 * abs(i_r) ** 2 * p.rr_ohm / slip * p.pole_pairs / w

    dt = 40e-6  # 500 steps a cycle; each holds the voltage of its middle
    t = dt * np.arange(150 * 500)
    v = np.zeros((len(t), 4))
    v[:, 0] = amplitude * np.cos(w * (t + dt / 2))
    v[:, 1] = direction * amplitude * np.sin(w * (t + dt / 2))
    y = np.zeros(8)
    y[6] = direction * (1 - slip) * w / p.pole_pairs
    m = make(p)
    states = integrate(m, NO_LOAD, y, v, dt)[-500:]
    i = states[:, :6] @ m.i_stator.T
    phasor = 2 * np.mean(i[:, 0] * np.exp(-1j * w * (t[-500:] + dt)))
    assert phasor == pytest.approx(i_s, rel=1e-3)
    measured = [torque_Nm(m, s, row) for s, row in zip(states, i)]
    assert np.mean(measured) == pytest.approx(torque, rel=1e-3)
    assert np.sign(torque) == np.sign(direction * slip)
    assert np.ptp(measured) < 5e-3 * abs(torque)
    np.testing.assert_allclose(i[:, 2:], 0, atol=1e-9)


def test_energy_is_conserved(model):
    """Field and kinetic energy from the coils, powers from the plant's own torque."""
    p, deg = model.p, model.p.displacement_deg
    legs, m = switched(1, deg), make(p)
    load = record(LOAD, **{n: 0.0 for n in LOAD.names} | {"linear_Nms": 0.05, "eddy_rad_s": 1.0})
    steps, dt = 20, 10e-6  # the steps of each switching state; Simpson's rule over pairs
    y0 = integrate(m, load, np.zeros(8), vsd(legs, deg), dt, steps)[-1]
    states = np.vstack([y0, integrate(m, load, y0, vsd(legs, deg), dt, steps)])

    def powers(y, v_leg):
        i_s, i_r = model.currents(y)
        torque = torque_Nm(m, y, vsd(i_s, deg))
        copper = model.r_stator @ i_s**2 + p.rr_ohm * i_r @ i_r
        taken = (p.viscous_Nms + 0.05) * y[6] ** 2
        return np.array([v_leg @ i_s, copper, torque * y[6], taken])

    def energies(y):
        i = np.concatenate(model.currents(y))
        return i @ model.inductance(0) @ i / 2, p.inertia_kgm2 * y[6] ** 2 / 2

    books = [np.zeros(4)]  # at the beginning and after every switching state
    for c, v_leg in enumerate(legs):
        rows = np.array([powers(y, v_leg) for y in states[c * steps : (c + 1) * steps + 1]])
        spent = dt / 3 * (rows[0] + 4 * rows[1::2].sum(0) + 2 * rows[2:-1:2].sum(0) + rows[-1])
        books.append(books[-1] + spent)
    stored = [energies(states[c * steps]) for c in range(len(legs) + 1)]
    electrical, copper, mechanical, _ = books[-1]
    assert min(abs(electrical), copper, abs(mechanical)) > 0.1  # nothing trivially zero
    # In any interval the error is below 1e-6 of the energy at the terminals and the losses.
    spent = np.abs(np.diff(books, axis=0)[:, :2]).sum(axis=1)
    rng = np.random.default_rng(3)
    ends = [
        (0, len(legs)),
        *(sorted(rng.choice(len(legs) + 1, 2, replace=False)) for _ in range(50)),
    ]
    for first, last in ends:
        electrical, copper, mechanical, taken = books[last] - books[first]
        field, kinetic = np.subtract(stored[last], stored[first])
        scale = spent[first:last].sum()
        assert electrical == pytest.approx(copper + mechanical + field, abs=1e-6 * scale)
        assert mechanical == pytest.approx(kinetic + taken, abs=1e-6 * scale)


@pytest.mark.parametrize("kind", ["constant", "fan", "brake", "generator", "friction"])
@pytest.mark.parametrize("rpm", [100.0, 1350.0, 2500.0])
def test_load_takes_the_stated_torque(kind, rpm):
    w = rpm * np.pi / 30
    load = load_record(kind, 7.5, rpm)
    assert load_torque(load, w) == pytest.approx(7.5, rel=1e-9)
    assert load_torque(load_record(kind, 0.0, rpm), w) == 0
    if kind == "constant":
        assert load_torque(load, -w) == load_torque(load, 0.0) == 7.5
    else:
        for share in (0.01, 0.3, 1, 4):
            assert load_torque(load, -share * w) == -load_torque(load, share * w)
        assert load_torque(load, 0.0) == 0


def test_loads_depend_on_the_speed_as_specified():
    w = np.pi / 30 * 1000
    assert load_torque(load_record("generator", 8.0, 1000), w / 2) == pytest.approx(4)
    assert load_torque(load_record("fan", 8.0, 1000), w / 2) == pytest.approx(2)
    assert load_torque(load_record("friction", 8.0, 1000), w / 20) == pytest.approx(8)
    brake = [load_torque(load_record("brake", 8.0, 1000), share * w) for share in (1.49, 1.5, 1.51)]
    assert brake[1] == max(brake) > 8
    for kind in ("generator", "fan", "friction", "brake"):
        assert load_torque(load_record(kind, 8.0, 1000), 0.01 * w) < 8


def winding_equations(p, amplitude, w, t_end, times):
    """The two winding equations in complex form under a sinusoidal supply from standstill: stator
    and rotor current, speed and rates of the energies (6 real states), by DOP853."""
    inductance = np.array([[p.lls_H + p.lm_H, p.lm_H], [p.lm_H, p.llr_H + p.lm_H]])
    current = np.linalg.inv(inductance)

    def slopes(t, z):
        psi = z[:2] + 1j * z[2:4]
        i = current @ psi
        v = amplitude * np.exp(1j * w * t)
        d = np.array([v - p.rs_ohm * i[0], -p.rr_ohm * i[1] + 1j * p.pole_pairs * z[4] * psi[1]])
        torque = 3 * p.pole_pairs * (np.conj(psi[0]) * i[0]).imag
        turning = (torque - p.viscous_Nms * z[4]) / p.inertia_kgm2
        lost = 3 * p.rr_ohm * abs(i[1]) ** 2
        return np.concatenate([d.real, d.imag, [turning, lost]])

    solved = solve_ivp(slopes, (0, t_end), np.zeros(6), "DOP853", times, rtol=1e-8, atol=1e-9)
    psi = solved.y[:2] + 1j * solved.y[2:4]
    return current @ psi, solved.y[4], solved.y[5]


def supplied(p, amplitude, w, seconds, dt=20e-6):
    """The plant's states under the same supply. Each step holds the voltage of its middle."""
    t = dt * np.arange(round(seconds / dt))
    v = np.zeros((len(t), 4))
    v[:, 0] = amplitude * np.cos(w * (t + dt / 2))
    v[:, 1] = amplitude * np.sin(w * (t + dt / 2))
    m = make(p)
    return t + dt, m, integrate(m, NO_LOAD, np.zeros(8), v, dt)


def test_free_acceleration_agrees_with_the_winding_equations(symmetric):
    """The machine starts from standstill without load. The test checks the trajectory, the
    synchronous speed at the end, and that the rotor loses as much energy as the shaft keeps. (The
    start is so slow that the transient of switching on is a small part of it.)"""
    p = replace(symmetric.p, viscous_Nms=0.0, inertia_kgm2=0.3)
    w, amplitude = 2 * np.pi * 50, 180.0
    t, m, states = supplied(p, amplitude, w, 6.0)
    every = slice(0, None, 1000)
    i, speed, lost_J = winding_equations(p, amplitude, w, 6.0, t[every])
    plant = states[every, :6] @ m.i_stator.T
    peak = np.abs(i[0]).max()
    np.testing.assert_allclose(plant[:, 0] + 1j * plant[:, 1], i[0], atol=1e-4 * peak)
    np.testing.assert_allclose(states[every, 6], speed, atol=1e-4 * w / p.pole_pairs)
    synchronous = w / p.pole_pairs
    assert states[-1, 6] == pytest.approx(synchronous, rel=1e-3)
    assert states[:, 6].max() > 0.99 * synchronous
    kinetic_J = p.inertia_kgm2 * synchronous**2 / 2
    assert lost_J[-1] == pytest.approx(kinetic_J, rel=0.03)


def test_at_synchronous_speed_only_the_magnetising_current_flows(symmetric):
    """There is no slip, no rotor current and no torque, so only the magnetising circuit remains."""
    p = replace(symmetric.p, viscous_Nms=0.0)
    w, amplitude = 2 * np.pi * 50, 180.0
    _, m, states = supplied(p, amplitude, w, 4.0)
    i = states[-1000:, :6] @ m.i_stator.T
    expected = amplitude / abs(p.rs_ohm + 1j * w * (p.lls_H + p.lm_H))
    np.testing.assert_allclose(np.hypot(i[:, 0], i[:, 1]), expected, rtol=1e-3)
    torque = [torque_Nm(m, y, row) for y, row in zip(states[-1000:], i)]
    assert np.max(np.abs(torque)) < 1e-3 * 10
    assert np.mean(states[-1000:, 6]) == pytest.approx(w / p.pole_pairs, rel=1e-6)


def test_a_locked_rotor_has_current_and_torque_of_the_circuit(symmetric):
    """With the shaft held, the slip is 1. Current and torque are those of the equivalent
    circuit."""
    p = replace(symmetric.p, inertia_kgm2=1e9)
    w, amplitude = 2 * np.pi * 50, 60.0
    _, m, states = supplied(p, amplitude, w, 2.0)
    i = states[-1000:, :6] @ m.i_stator.T
    rotor = p.rr_ohm + 1j * w * p.llr_H
    parallel = rotor * 1j * w * p.lm_H / (rotor + 1j * w * p.lm_H)
    stator_A = amplitude / abs(p.rs_ohm + 1j * w * p.lls_H + parallel)
    rotor_A = stator_A * abs(parallel / rotor)
    np.testing.assert_allclose(np.hypot(i[:, 0], i[:, 1]), stator_A, rtol=1e-3)
    torque = np.mean([torque_Nm(m, y, row) for y, row in zip(states[-1000:], i)])
    assert torque == pytest.approx(3 * p.pole_pairs * rotor_A**2 * p.rr_ohm / w, rel=1e-3)
    assert abs(states[-1, 6]) < 1e-6
