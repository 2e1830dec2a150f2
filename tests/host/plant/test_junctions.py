"""Temperatures of the inverter's devices, from first principles."""

import numpy as np
import pytest
from plant_calls import NO_LOAD
from scipy.optimize import fsolve

from hexatorque import SetupError, SimulatedDrive, load
from hexatorque.analysis.losses import bridge
from hexatorque.plant.heat import STEP_S
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.junctions import Junctions
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.loop import Plant, follow_log
from hexatorque.plant.meter import DEVICE_J, INTEGRALS

CHAIN = [0.02, 0.1, 0.3, 0.2]
TIMES = [2e-3, 0.02, 0.1, 0.5]
VALUES = {
    "switch_K_W": CHAIN, "switch_s": TIMES, "diode_K_W": [0.05, 0.2, 0.4, 0.1], "diode_s": TIMES,
    "sink_K_W": 0.5, "sink_s": 3.0, "ambient_degC": 40.0, "devices_degC": 25.0, "time_lapse": 1.0,
    "switch_V_per_K": -1e-3, "switch_ohm_per_K": 4e-3, "diode_V_per_K": -2e-3,
    "diode_ohm_per_K": 2e-3,
}  # fmt: skip
NO_ENERGY = dict.fromkeys(("e_on_mJ", "e_off_mJ", "e_ref_V", "e_ref_A"), 0.0)
DROPS = {"v_switch_V": 1.2, "v_diode_V": 1.0, "r_switch_ohm": 0.05, "r_diode_ohm": 0.03}


def made(**values):
    inverter = inverter_record(**DROPS)
    return inverter, Junctions(VALUES | values, inverter, NO_ENERGY)


@pytest.mark.parametrize("lapse", (1.0, 4.0))
def test_a_junction_follows_the_step_response_of_its_chain_and_ends_at_its_resistances(lapse):
    """theta = P (sum R_n (1 - exp(-t/tau_n)) + R_sink (1 - exp(-t/tau_sink)))."""
    inverter, junctions = made(time_lapse=lapse)
    power_W, steps = 30.0, round(4000 / lapse)
    for n in range(1, steps + 1):
        inverter.junctions.switching_J[2, 0] = power_W * STEP_S
        junctions.advance(STEP_S)
        if n in (1, 2, 20, 200, steps):
            t = n * STEP_S * lapse
            rise = sum(r * (1 - np.exp(-t / s)) for r, s in zip(CHAIN, TIMES))
            sink = 0.5 * (1 - np.exp(-t / 3.0))
            found = junctions.junction_degC
            assert found[2, 0] == pytest.approx(40 + power_W * (rise + sink), rel=1e-9)
            others = np.delete(found.ravel(), 2 * 4)
            assert others == pytest.approx(40 + power_W * sink, rel=1e-9)
    assert found[2, 0] == pytest.approx(40 + power_W * (sum(CHAIN) + 0.5), rel=2e-3)
    assert junctions.heat_J == pytest.approx(power_W * 4000 * STEP_S)
    assert junctions.heat_J == pytest.approx(junctions.ambient_J + junctions.sink_J, rel=1e-9)


def test_each_device_has_the_drops_of_its_own_junction():
    inverter, junctions = made(time_lapse=100.0)
    watts = np.arange(24.0).reshape(6, 4)
    for _ in range(200):
        inverter.junctions.switching_J[:] = watts * STEP_S
        junctions.advance(STEP_S)
    degC = junctions.junction_degC
    assert len(np.unique(degC.round(6))) == 24
    for device, kind in enumerate(("switch", "diode", "switch", "diode")):
        rise = degC[:, device] - 25
        v_V = DROPS[f"v_{kind}_V"] * (1 + VALUES[f"{kind}_V_per_K"] * rise)
        r_ohm = DROPS[f"r_{kind}_ohm"] * (1 + VALUES[f"{kind}_ohm_per_K"] * rise)
        assert inverter.devices.v_V[:, device] == pytest.approx(v_V)
        assert inverter.devices.r_ohm[:, device] == pytest.approx(r_ohm)


def test_legs_at_standstill_settle_where_each_devices_own_loss_and_drop_agree():
    """Two upper switches share the current of four lower ones, so they are hotter, and diodes stay
    cold. A device that carries i is at theta = ambient + (R P + R_sink sum of P), P = v(theta) i +
    r(theta) i^2; and the winding's voltage is what the drops leave of V_dc."""
    changes = {f"inverter.{k}": v for k, v in DROPS.items()} | {
        "heat.switch_K_W": [0.3, 0.4, 0.5, 0.2], "heat.switch_s": TIMES, "heat.sink_K_W": 0.1,
        "heat.sink_s": 1.0, "heat.devices_degC": 25.0, "heat.ambient_degC": 40.0,
        "heat.time_lapse": 10.0, "heat.switch_V_per_K": -2e-3, "heat.switch_ohm_per_K": 8e-3,
        "heat.diode_V_per_K": 1e-2, "heat.diode_ohm_per_K": 1e-2,  # would be seen if it were taken
    }  # fmt: skip
    sim = SimulatedDrive(load("paper-a").changed(changes))
    m = sim._machine
    legs = [HIGH, HIGH, LOW, LOW, LOW, LOW]
    for _ in range(800):
        _follow(sim, legs, STEP_S, vdc_V=40.0)
        sim.junctions.advance(STEP_S)
    i = sim.plant_state[:6] @ m.i_phase.T
    assert i[0] > 4 and abs(i[2]) < 0.6 * i[0]
    carrying = np.where(np.array(legs) == HIGH, 0, 2)
    each = np.arange(6)

    def switch(degC):
        rise = degC - 25
        return 1.2 * (1 - 2e-3 * rise), 0.05 * (1 + 8e-3 * rise)

    def watts(degC):
        v_V, r_ohm = switch(degC)
        return v_V * np.abs(i) + r_ohm * i**2

    def open_K(degC):
        return 40 + 1.4 * watts(degC) + 0.1 * watts(degC).sum() - degC

    degC = fsolve(open_K, np.full(6, 60.0))
    found = sim.junctions.junction_degC
    assert degC[:2].min() > degC[2:].max() + 5
    assert found[each, carrying] == pytest.approx(degC, abs=0.02)
    cold = np.delete(found.ravel(), each * 4 + carrying)
    assert cold == pytest.approx(sim.junctions.sink_degC, abs=1e-9)
    # At standstill a winding is a resistance: Kirchhoff's law between legs of one set.
    v_V, r_ohm = switch(degC)
    leg_V = np.where(np.array(legs) == HIGH, 40.0, 0.0) - v_V * np.sign(i) - r_ohm * i
    star_V = leg_V - (sim.machine.rs_ohm + np.array(sim.machine.drs_ohm)) * i
    for first in (0, 1):
        assert star_V[first::2] == pytest.approx(star_V[first::2].mean(), abs=2e-3)


def test_conduction_heats_the_device_that_carries_the_current():
    """A winding at rest between three upper and three lower switches, and then all gates off: the
    current goes on through the diodes of the other rail."""
    sim = SimulatedDrive(load("paper-a").changed(
        {f"inverter.{k}": v for k, v in DROPS.items()} | {"heat.switch_K_W": CHAIN}
    ))  # fmt: skip
    _follow(sim, [HIGH, HIGH, LOW, LOW, LOW, LOW], 20e-3)
    lost_J = sim.inverter.meter.x[DEVICE_J:INTEGRALS].reshape(6, 4)
    carried = lost_J > 0
    assert carried[:2].tolist() == [[True, False, False, False]] * 2
    assert carried[2:].tolist() == [[False, False, True, False]] * 4
    lost_J[:] = 0.0
    _follow(sim, [OFF] * 6, 0.2e-3)
    carried = lost_J > 0
    assert carried[:2].tolist() == [[False, False, False, True]] * 2
    assert carried[2:].tolist() == [[False, True, False, False]] * 4


def _follow(sim, legs, seconds, vdc_V=250.0):
    rows = np.array([[0, leg, state] for leg, state in enumerate(legs)], np.int64)
    periods = round(seconds / sim.period_s)
    states = np.empty((periods, 8))
    plant = Plant(sim._machine, NO_LOAD, sim.inverter, sim.sensors, sim.plant_state)
    follow_log(rows, 0, sim._timing, plant, vdc_V, sim._pwm, states)


ENERGIES = {
    "inverter.e_on_mJ": 1.5, "inverter.e_off_mJ": 1.0, "inverter.e_ref_V": 300.0,
    "inverter.e_ref_A": 10.0,
}  # fmt: skip
WARM = {
    "heat.switch_K_W": CHAIN, "heat.diode_K_W": CHAIN, "heat.switch_s": TIMES,
    "heat.diode_s": TIMES, "heat.sink_K_W": 0.2, "heat.sink_s": 5.0,
}  # fmt: skip


def running(**more):
    setup = load("paper-a-feasible").changed(
        WARM | ENERGIES | {f"inverter.{k}": v for k, v in DROPS.items()} | more
    )
    sim = SimulatedDrive(setup)
    sim.start()
    sim.run(0.5, record=False)
    sim.set("speed_ref_rpm", 500)
    sim.run(0.5, record=False)
    sim.set("load_Nm", 5)
    sim.run(0.5, record=False)
    return sim


def test_the_losses_are_those_of_the_figures_of_merit():
    """Conduction from the edges of a recording, commutations from the data sheet's energies."""
    sim = running(**{"heat.switch_V_per_K": 0.0, "heat.switch_ohm_per_K": 0.0,
                     "heat.diode_V_per_K": 0.0, "heat.diode_ohm_per_K": 0.0})  # fmt: skip
    sim.log_edges(100_000)
    before, began = sim.junctions.heat_J, sim.periods
    start = sim.inverter.leg.copy()
    sim.run(0.5)
    recording = sim.take()
    figures = bridge(recording, sim.edges_since(began, start))
    lost = figures["conduction_loss_W"] + figures["switching_loss_W"]
    assert figures["switching_loss_W"] > 1 and figures["conduction_loss_W"] > 5
    assert (sim.junctions.heat_J - before) / 0.5 == pytest.approx(lost, rel=5e-3)
    hottest = recording["plant.junction_degC"]
    assert hottest[-1] == pytest.approx(sim.junctions.junction_degC.max(), rel=1e-3)
    assert hottest[-1] > recording["plant.sink_degC"][-1] > 40


def test_what_is_recorded_changes_no_temperature():
    sims = []
    for record in (False, True):
        sim = SimulatedDrive(load("paper-a-feasible").changed(
            WARM | ENERGIES | {f"inverter.{k}": v for k, v in DROPS.items()}
        ))  # fmt: skip
        sim.start()
        sim.run(0.5, record=record)
        sims.append(sim)
    one, two = sims
    assert np.array_equal(one.plant_state, two.plant_state)
    assert np.array_equal(one.junctions.junction_degC, two.junctions.junction_degC)
    assert one.junctions.junction_degC.max() > 41


def test_mistakes_about_the_chains_are_told_in_one_line():
    cases = (
        ({"heat.switch_K_W": CHAIN}, "heat.switch_K_W needs one of inverter.v_switch_V"),
        ({"heat.switch_K_W": [0.1, 0.2]}, "four numbers are needed"),
        ({"heat.switch_K_W": [-1, 0, 0, 0]}, "0 .. 1000 K/W"),
        ({"heat.diode_s": [0, 1, 1, 1]}, "1e-05 .. 10000 s"),
        ({"heat.switch_ohm_per_K": 0.1}, "-0.02 .. 0.02 1/K"),
    )
    for changes, told in cases:
        with pytest.raises(SetupError) as refused:
            load("paper-a").changed(changes)
        (line,) = str(refused.value).splitlines()
        assert told in line
