"""All effects of the plant at the same time: energy closes from the line to the shaft."""

import itertools

import numpy as np
from plant_calls import KEEP, _advance, machine_J

from hexatorque import SimulatedDrive, load
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.link import CHOPPER_J, DRIVE_J, LINE_A, RESISTANCE_J, SOURCE_J, V

EVERYTHING = {
    "inverter.link_F": 470e-6, "inverter.source_ohm": 0.1, "inverter.source_H": 1e-3,
    "inverter.line_Hz": 50.0, "inverter.precharge_ohm": 47.0, "inverter.chopper_ohm": 60.0,
    "inverter.chopper_on_V": 290.0, "inverter.chopper_off_V": 280.0, "inverter.v_switch_V": 1.2,
    "inverter.v_diode_V": 1.0, "inverter.r_switch_ohm": 0.05, "inverter.r_diode_ohm": 0.03,
    "inverter.e_on_mJ": 0.5, "inverter.e_off_mJ": 0.3, "inverter.e_ref_V": 300.0,
    "inverter.e_ref_A": 10.0, "heat.switch_K_W": [0.1, 0.2, 0.3, 0.2],
    "heat.diode_K_W": [0.1, 0.2, 0.3, 0.2], "heat.sink_K_W": 0.5, "heat.winding_K_W": 0.4,
    "heat.time_lapse": 20.0, "machine.iron_hysteresis_A_Wb": 0.5, "machine.iron_eddy_S": 1e-3,
    "load.holding_Nm": 3.0, "load.kind": "constant",
}  # fmt: skip


def in_link_J(link):
    x = link.x
    return 0.5 * (link.link_F * x[V] ** 2 + link.source_H * np.sum(x[LINE_A:] ** 2))


class Losses:
    """Power of all losses in a state, with the resistances and drops of now."""

    def __init__(self, sim):
        p = self.p = sim.machine
        self.inverse = np.linalg.inv([[p.lls_H + p.lm_H, p.lm_H], [p.lm_H, p.llr_H + p.lm_H]])
        self.rs_ohm, self.rr_ohm = sim.bodies._ohm(), float(sim._machine.heat.rr_ohm)
        self.i_phase = sim._machine.i_phase.copy()
        self.devices = sim.inverter.devices.copy()
        self.load_Nm = sim.load_Nm

    def devices_W(self, states, legs):
        d, i = self.devices, states[:, :6] @ self.i_phase.T
        out = i > 0
        # Out of the upper rail, or into the lower one, a current flows through the switch.
        through_switch = (legs != OFF) & (out ^ (legs == LOW))
        upper = (legs == HIGH) | ((legs == OFF) & (i < 0))
        device = 2 * ~upper + ~through_switch  # in the order of legs.DEVICE_KINDS
        volts = d.v_V[range(6), device]
        volts = np.where(legs != OFF, volts * np.tanh(np.abs(i) / d.knee_A), volts)
        ohms = d.r_ohm[range(6), device]
        return np.sum(volts * np.abs(i) + ohms * i**2, axis=1)

    def machine_W(self, states):
        p, omega = self.p, states[:, 6]
        i = states[:, :6] @ self.i_phase.T
        total = p.viscous_Nms * omega**2 + self.load_Nm * omega + i**2 @ self.rs_ohm
        for axis in (0, 1):
            i_r = self.inverse[1] @ np.array([states[:, axis], states[:, 4 + axis]])
            total = total + 3 * self.rr_ohm * i_r**2
        w = p.pole_pairs * omega
        per_Wb2 = p.iron_hysteresis_A_Wb * np.abs(w) + p.iron_eddy_S * w**2
        return total + per_Wb2 * (states[:, 0] ** 2 + states[:, 1] ** 2)


def test_energy_closes_with_all_effects_at_the_same_time():
    setup = load("paper-a-feasible").changed(EVERYTHING).changed(machine__drs_ohm=[0.0] * 6)
    sim = SimulatedDrive(setup)
    sim.run(0.8, record=False)  # charges
    sim.start()
    sim.run(0.8, record=False)
    sim.set("speed_ref_rpm", 900)
    sim.run(0.9, record=False)
    assert sim.state == "run" and sim.speed_rpm > 800
    assert sim.bodies.winding_degC.min() > 45 and sim.junctions.junction_degC.min() > 40.5
    # It drives a load against its brake, which closes too early, and then it decelerates.
    sim.set("load_Nm", 0.5)
    sim.run(0.01, record=False)
    brake, shaft = sim.brake, sim._load
    brake.closed_Nm, brake.angle_rad = 3.0, sim.plant_state[7]
    shaft.braking_Nm = 3.0
    shaft.constant_Nm = shaft.hanging_Nm + 3.0
    brake.told_s = -10.0  # and stays so
    sim.log_edges(60_000)
    periods = 400
    while sim._unheated:  # so that the temperatures stand still in the replay's first stretch
        sim.run(sim.period_s, record=False)
    start = sim.periods
    sim._unheated = -periods
    inv, m, y = sim.inverter.copy(), sim._machine.copy(), sim.plant_state.copy()
    shaft, losses = shaft.copy(), Losses(sim)
    sim.run(0.5 * periods * sim.period_s, record=False)
    sim.set("speed_ref_rpm", 300)
    sim.run(0.5 * periods * sim.period_s, record=False)
    edges = sim.edges[np.argsort(sim.edges[:, 0], kind="stable")]
    counts, clock_Hz = int(sim._timing.period), float(sim._timing.clock_Hz)
    first, last = start * counts, sim.periods * counts
    # The same from edge to edge, in pieces of at most 5 us, whose middles Simpson's rule needs.
    edges = edges[(edges[:, 0] >= first) & (edges[:, 0] < last)]
    marks = np.unique([first, *edges[:, 0], last])
    rows, times, states_of_legs = [], [], []
    legs = inv.leg.copy()
    for now, then in itertools.pairwise(marks):
        dt = (then - now) / clock_Hz
        pieces = 2 * int(np.ceil(dt / 10e-6))
        changes = np.full((pieces, 6), KEEP)
        for _, leg, state in edges[edges[:, 0] == now]:
            changes[0, leg] = legs[leg] = state
        rows.append(changes)
        times.append(np.full(pieces, dt / pieces))
        states_of_legs.append(np.tile(legs, (pieces, 1)))
    rows, times = np.concatenate(rows), np.concatenate(times)
    states_of_legs = np.concatenate(states_of_legs)
    x0, field0, link0 = inv.link.x.copy(), machine_J(sim.machine, y), in_link_J(inv.link)
    heat0, switching0 = float(shaft.brake.heat_J), inv.junctions.switching_J.sum()
    before = y.copy()
    states, _, _ = _advance(inv, m, shaft, y, 250.0, rows, times)
    assert np.abs(y - sim.plant_state).max() < 1e-4 * np.abs(y).max()  # it is the same run
    flows = inv.link.x - x0
    throughput = np.abs(flows[SOURCE_J : DRIVE_J + 1]).sum()
    assert min(flows[CHOPPER_J], flows[RESISTANCE_J]) > 1e-3 and flows[DRIVE_J] < -1
    spent = flows[RESISTANCE_J] + flows[CHOPPER_J] + flows[DRIVE_J]
    assert abs(flows[SOURCE_J] - spent - (in_link_J(inv.link) - link0)) < 1e-6 * throughput
    from_states, to_states = np.vstack([before, states[:-1]]), states

    def integral(power):
        """power(states, legs of the pieces); three points to two pieces."""
        a = power(from_states[::2], states_of_legs[::2])
        b = power(to_states[::2], states_of_legs[::2])
        c = power(to_states[1::2], states_of_legs[1::2])
        return np.sum((a + 4 * b + c) * times[::2]) / 3

    lost = integral(lambda z, _: losses.machine_W(z))
    devices = integral(losses.devices_W)
    switching = inv.junctions.switching_J.sum() - switching0
    braked = float(shaft.brake.heat_J) - heat0
    gained = machine_J(sim.machine, y) - field0
    assert min(lost, devices, switching, braked) > 0.1
    open_J = flows[DRIVE_J] - lost - devices - switching - braked - gained
    assert abs(open_J) < 1e-6 * (lost + devices + switching + braked + abs(gained))
