"""The machine's temperatures: the bodies against scipy, the losses against the flow of energy."""

import numpy as np
import pytest
from plant_calls import machine_J
from scipy.integrate import solve_ivp

from hexatorque import SetupError, SimulatedDrive, load
from hexatorque.plant import machines
from hexatorque.plant.heat import PER_K, STEP_S, Bodies
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.link import DRIVE_J
from hexatorque.plant.meter import LEG_A2S, ROTOR_V2S

VALUES = {
    "winding_K_W": 0.4, "winding_s": 45.0, "frame_K_W": 0.25, "frame_s": 900.0,
    "ambient_degC": 30.0, "ohm_degC": 25.0, "time_lapse": 200.0,
}  # fmt: skip


def test_the_bodies_are_those_of_the_equations_and_energy_closes():
    model = machines.model("induction")
    p = model.Parameters(**load("paper-a").changed({"machine.drs_ohm": [0.3, 0, 0, 0, 0, 0]})
                         .machine_values())  # fmt: skip
    m = model.make(p)
    inverter = inverter_record()
    bodies = Bodies(VALUES, p, model.make, m, inverter)
    assert inverter.meter.on
    squares, rotor2 = np.array([9.0, 2, 0, 4, 6, 1]), 6.0
    cold = 1 / (1 + PER_K * (VALUES["ohm_degC"] - 20))
    ohm = (p.rs_ohm + np.array(p.drs_ohm)) * cold
    part_K_W = 6 * VALUES["winding_K_W"]

    def slopes(_, degC):
        loss = ohm * (1 + PER_K * (degC[:6] - 20)) * squares
        rotor = 3 * p.rr_ohm * cold * (1 + PER_K * (degC[6] - 20)) * rotor2
        flow = (degC[:6] - degC[6]) / part_K_W
        out = (degC[6] - VALUES["ambient_degC"]) / VALUES["frame_K_W"]
        return np.append(
            (loss - flow) * part_K_W / VALUES["winding_s"],
            (flow.sum() + rotor - out) * VALUES["frame_K_W"] / VALUES["frame_s"],
        )

    steps = 400
    for _ in range(steps):
        inverter.meter.x[LEG_A2S : LEG_A2S + 6] = squares * STEP_S
        rr_ohm = p.rr_ohm * cold * (1 + PER_K * (bodies.frame_degC - 20))
        inverter.meter.x[ROTOR_V2S] = rr_ohm**2 * rotor2 * STEP_S
        bodies.advance(STEP_S)
    end_s = steps * STEP_S * VALUES["time_lapse"]
    expected = solve_ivp(slopes, (0, end_s), np.full(7, 30.0), "Radau", rtol=1e-9).y[:, -1]
    found = np.append(bodies.winding_degC, bodies.frame_degC)
    assert found.max() > 75
    # The resistances lag by a step, 1 s of 45.
    assert np.abs(found - expected).max() < 0.2
    assert bodies.heat_J == pytest.approx(bodies.ambient_J + bodies.stored_J, rel=1e-9)


@pytest.mark.parametrize(
    "iron", ({}, {"machine.iron_hysteresis_A_Wb": 3.0, "machine.iron_eddy_S": 0.01})
)
def test_the_losses_are_what_the_legs_give_and_the_shaft_does_not_take(iron):
    setup = load("paper-a-feasible").changed({
        "inverter.link_F": 2e-3, "inverter.source_ohm": 0.2, "machine.viscous_Nms": 0.0,
        "machine.drs_ohm": [0.0] * 6, "heat.winding_K_W": 0.4, "heat.time_lapse": 50.0, **iron,
    })  # fmt: skip
    sim = SimulatedDrive(setup, samples_per_period=1)
    sim.start()
    sim.run(0.5, record=False)
    sim.set("speed_ref_rpm", 500)
    begin = sim.inverter.link.x[DRIVE_J], sim.bodies.heat_J, machine_J(sim.machine, sim.plant_state)
    sim.run(1.0, record=False)
    assert sim.state == "run" and sim.bodies.winding_degC.min() > 42
    given = sim.inverter.link.x[DRIVE_J] - begin[0]
    heat = (sim.bodies.heat_J - begin[1]) / 50.0
    kept = machine_J(sim.machine, sim.plant_state) - begin[2]
    assert heat > 0.2 * given
    assert abs(given - heat - kept) < 1e-7 * given


def test_the_resistances_follow_and_what_is_recorded_changes_nothing():
    runs = []
    for record in (False, True):
        setup = load("paper-a").changed({"heat.winding_K_W": 0.4, "heat.time_lapse": 200.0})
        sim = SimulatedDrive(setup)
        sim.start()
        sim.run(0.4, record=record)
        sim.run(0.3, record=record)
        runs.append(sim)
    assert np.array_equal(runs[0].plant_state, runs[1].plant_state)
    assert np.array_equal(runs[0].bodies.winding_degC, runs[1].bodies.winding_degC)
    sim = runs[0]
    assert sim.bodies.winding_degC.max() > 55
    cold = load("paper-a").machine_values()
    model = machines.model("induction")
    hot = model.Parameters(**cold | {
        "rs_ohm": cold["rs_ohm"] * (1 + PER_K * (sim.bodies.winding_degC[0] - 20)),
        "rr_ohm": cold["rr_ohm"] * (1 + PER_K * (sim.bodies.frame_degC - 20)),
    })  # fmt: skip
    slope = model.make(hot).slope
    assert np.abs(sim._machine.slope - slope).max() < 0.06 * np.abs(slope).max()
    assert sim._machine.rr_over_lr == pytest.approx(model.make(hot).rr_over_lr, rel=1e-9)


def test_a_time_lapse_that_leaves_the_bodies_behind_is_refused():
    with pytest.raises(SetupError) as refused:
        load("paper-a").changed({"heat.winding_K_W": 0.4, "heat.time_lapse": 5000.0})
    assert str(refused.value) == (
        "heat.time_lapse = 5000: allowed is up to 1200 with a thermal time constant of 60 s"
    )


@pytest.mark.parametrize("key", ["winding_K_W", "frame_K_W", "sink_K_W"])
@pytest.mark.parametrize("told", [0, 1e-7])
def test_a_thermal_resistance_of_0_is_refused(key, told):
    """It stands for no "off": the key is left out for that."""
    with pytest.raises(SetupError) as refused:
        load("paper-a").changed({f"heat.{key}": told})
    assert str(refused.value) == f"heat.{key} = {told}: allowed range is 1e-05 .. 1000 K/W"


@pytest.mark.parametrize("key", ["switch_K_W", "diode_K_W"])
def test_a_chain_of_zeros_is_refused(key):
    other = {"switch_K_W": "diode_K_W", "diode_K_W": "switch_K_W"}[key]
    base = load("paper-a").changed({"inverter.v_switch_V": 1.0, f"heat.{other}": [0.1, 0, 0, 0]})
    for setup in (base, load("paper-a")):
        with pytest.raises(SetupError) as refused:
            setup.changed({f"heat.{key}": [0, 0, 0, 0]})
        (line,) = str(refused.value).splitlines()
        assert line.startswith(f"heat.{key} = [0, 0, 0, 0]: allowed is 1e-05 to 1000 K/W for one")
