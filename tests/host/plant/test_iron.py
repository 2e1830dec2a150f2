"""The iron's loss: what flux and frequency make of it, and where its energy comes from."""

from dataclasses import replace

import numpy as np
import pytest
from plant_calls import NO_LOAD, advance, instant, integrate
from scipy.integrate import solve_ivp

from hexatorque import SimulatedDrive, load
from hexatorque.analysis.losses import balance, bridge, iron_loss_W
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import OFF
from hexatorque.plant.machines import magnet
from hexatorque.plant.machines.induction import Parameters, make
from hexatorque.plant.machines.magnet_parameters import Parameters as Magnets

#: W/Wb^2 per rad/s, and per (rad/s)^2.
HYSTERESIS, EDDY = 0.3, 2e-3
PLAIN = Parameters(2, 1.8, 2.0, 10e-3, 15e-3, 284e-3, 10e-3, 0.03, 0.0033)
IRON = replace(PLAIN, iron_hysteresis_A_Wb=HYSTERESIS, iron_eddy_S=EDDY)
MAGNETS = Magnets(
    3, 0.8, 6.4e-3, 17.4e-3, 0.9e-3, 0.1746, 0.01, 0.002,
    iron_hysteresis_A_Wb=HYSTERESIS, iron_eddy_S=EDDY,
)  # fmt: skip


def slopes(p, y):
    k = np.empty(8)
    m = magnet.make(p) if isinstance(p, Magnets) else make(p)
    instant(m, NO_LOAD, y, np.zeros(4), k, np.empty(6), np.empty(4))
    return k


@pytest.mark.parametrize("knee_Wb", (0.0, 0.4))
@pytest.mark.parametrize("omega", (-150.0, 40.0, 300.0))
def test_the_loss_grows_with_flux_squared_and_with_both_powers_of_the_frequency(omega, knee_Wb):
    y = np.array([0.4, -0.3, 0.01, 0.0, 0.35, -0.3, omega, 0.7])
    with_iron = slopes(replace(IRON, psi_knee_Wb=knee_Wb), y)
    without = slopes(replace(PLAIN, psi_knee_Wb=knee_Wb), y)
    taken_W = (without[6] - with_iron[6]) * IRON.inertia_kgm2 * omega
    electrical = IRON.pole_pairs * abs(omega)
    expected_W = 0.25 * (HYSTERESIS * electrical + EDDY * electrical**2)
    assert taken_W == pytest.approx(expected_W, rel=1e-9)
    assert np.array_equal(np.delete(with_iron, 6), np.delete(without, 6))


def test_nothing_is_taken_at_standstill_and_each_part_works_alone():
    y = np.array([0.4, -0.3, 0.0, 0.0, 0.35, -0.3, 0.0, 0.0])
    assert slopes(IRON, y)[6] == slopes(PLAIN, y)[6]
    y[6] = 100.0
    both = slopes(PLAIN, y)[6] - slopes(IRON, y)[6]
    parts = sum(
        slopes(PLAIN, y)[6] - slopes(replace(IRON, **{name: 0.0}), y)[6]
        for name in ("iron_hysteresis_A_Wb", "iron_eddy_S")
    )
    assert both == pytest.approx(parts, rel=1e-9)


def simpson(values, dt):
    return dt / 3 * (values[:-2:2] + 4 * values[1:-1:2] + values[2::2]).sum()


def test_energy_closes_from_the_terminals_to_the_shaft():
    """A voltage that turns, in steps of 100 us, runs the machine up from standstill."""
    rows, dt = 20_000, 25e-6
    angle = 2 * np.pi * 50 * 100e-6 * np.arange(rows)
    volts = 190 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle])
    begin = np.zeros(8)
    y = np.vstack([begin, integrate(make(IRON), NO_LOAD, begin, volts, dt, steps=4)])
    p = IRON
    inverse = np.linalg.inv(np.array([[p.ls_H, p.lm_H], [p.lm_H, p.lr_H]]))
    axes = [np.stack([y[:, a], y[:, 4 + a]]) for a in (0, 1)]
    currents = [inverse @ flux for flux in axes]
    copper_W = sum(3 * (p.rs_ohm * i[0] ** 2 + p.rr_ohm * i[1] ** 2) for i in currents)
    electrical = p.pole_pairs * y[:, 6]
    hysteresis = HYSTERESIS * electrical * np.tanh(y[:, 6] / 0.5)
    iron_W = (y[:, 0] ** 2 + y[:, 1] ** 2) * (hysteresis + EDDY * electrical**2)
    friction_W = p.viscous_Nms * y[:, 6] ** 2
    taken_J = sum(
        3 * volts[r, a] * simpson(currents[a][0][4 * r : 4 * r + 5], dt)
        for r in range(rows) for a in (0, 1)
    )  # fmt: skip
    lost_J = simpson(copper_W + iron_W + friction_W, dt)
    stored_J = sum(1.5 * (flux[:, -1] @ i[:, -1]) for flux, i in zip(axes, currents))
    stored_J += 0.5 * p.inertia_kgm2 * y[-1, 6] ** 2
    assert y[-1, 6] > 140 and simpson(iron_W, dt) > 20
    assert abs(taken_J - lost_J - stored_J) < 1e-6 * taken_J


@pytest.mark.parametrize("omega", (-150.0, 40.0, 300.0))
def test_with_magnets_too_the_shaft_pays_for_the_loss_and_for_nothing_else(omega):
    y = np.array([0.15, -0.05, 0.01, 0.0, 0.0, 0.0, omega, 0.7])
    with_iron = slopes(MAGNETS, y)
    without = slopes(replace(MAGNETS, iron_hysteresis_A_Wb=0.0, iron_eddy_S=0.0), y)
    electrical = MAGNETS.pole_pairs * abs(omega)
    expected_W = (0.15**2 + 0.05**2) * (HYSTERESIS * electrical + EDDY * electrical**2)
    taken_W = (without[6] - with_iron[6]) * MAGNETS.inertia_kgm2 * omega
    assert taken_W == pytest.approx(expected_W, rel=1e-9)
    assert np.array_equal(np.delete(with_iron, 6), np.delete(without, 6))


def test_without_currents_magnets_brake_the_shaft_by_their_own_flux():
    p = MAGNETS
    inv = inverter_record()
    inv.leg[:] = inv.command[:] = OFF
    inv.off = 6
    y = magnet.initial(magnet.make(p))
    y[6] = 60.0
    states, _ = advance(inv, magnet.make(p), NO_LOAD, y, 50e-6, 250.0, steps=4000)

    def coasting(t, w):
        per_Wb2 = p.pole_pairs * (HYSTERESIS * np.tanh(w / 0.5) + EDDY * p.pole_pairs * w)
        return -(p.psi_f_Wb**2 * per_Wb2 + p.viscous_Nms * w) / p.inertia_kgm2

    end = solve_ivp(coasting, (0, 0.2), [60.0], "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]
    assert 60 * np.exp(-0.2 * p.viscous_Nms / p.inertia_kgm2) - end > 0.5  # the iron's part
    assert states[-1, 6] == pytest.approx(end, rel=1e-7)


def test_without_currents_the_decaying_flux_still_brakes_the_shaft():
    m, inv = make(IRON), inverter_record()
    inv.leg[:] = inv.command[:] = OFF
    inv.off = 6
    y = np.zeros(8)
    y[4:7] = 0.3, 0.0, 60.0
    y[:2] = IRON.lm_H / IRON.lr_H * y[4:6]
    states, _ = advance(inv, m, NO_LOAD, y, 50e-6, 250.0, steps=4000)
    p = IRON

    def coasting(t, z):
        stator = p.lm_H / p.lr_H * 0.3 * np.exp(-t * p.rr_ohm / p.lr_H)
        drag = p.pole_pairs * stator**2 * (
            HYSTERESIS * np.tanh(z / 0.5) + EDDY * p.pole_pairs * z
        )  # fmt: skip
        return -(drag + p.viscous_Nms * z) / p.inertia_kgm2

    end = solve_ivp(coasting, (0, 0.2), [60.0], "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]
    assert 60 * np.exp(-0.2 * p.viscous_Nms / p.inertia_kgm2) - end > 0.1  # the iron's part
    assert states[-1, 6] == pytest.approx(end, rel=1e-9)


def test_the_balance_of_a_run_has_the_iron_among_its_losses():
    setup = load("small-2kw").changed(
        controller__scheme="db-dtfc", machine__iron_hysteresis_A_Wb=0.1, machine__iron_eddy_S=3e-4
    )
    sim = SimulatedDrive(setup)
    sim.start()
    sim.set("speed_ref_rpm", 1400)
    sim.run(3.0, record=False)
    sim.set("load_Nm", 3.0)
    sim.run(2.0, record=False)
    period, legs = sim.periods, sim.inverter.leg.copy()
    sim.log_edges(500_000)
    sim.run(0.5)
    recording = sim.take()
    power = balance(recording, bridge(recording, sim.edges_since(period, legs)))
    omega = 1400 * np.pi / 30
    assert power["shaft_W"] == pytest.approx(3.0 * omega, rel=0.003)
    # 0.95 Wb at 146.6 rad/s
    assert iron_loss_W(recording) == pytest.approx(0.95**2 * (0.1 + 3e-4 * omega) * omega, rel=0.01)


def test_a_recording_without_the_flux_cannot_tell_the_iron_s_loss():
    sim = SimulatedDrive(load("small-2kw").changed(machine__iron_eddy_S=3e-4))
    sim.run(0.01)
    recording = sim.take()
    for name in [name for name in recording.channels if "psi_alpha" in name]:
        del recording.channels[name]
    assert np.isnan(iron_loss_W(recording))


@pytest.mark.parametrize(
    ("changes", "text"),
    (
        ({"machine__iron_eddy_S": -1.0}, "machine.iron_eddy_S = -1"),
        ({"machine__iron_hysteresis_A_Wb": 1e6}, "machine.iron_hysteresis_A_Wb = 1000000"),
    ),
)
def test_a_mistake_is_told_in_one_line(changes, text):
    with pytest.raises(Exception, match="allowed") as refused:
        load("small-2kw").changed(**changes)
    (line,) = str(refused.value).splitlines()
    assert text in line
