"""All effects of the plant at the same time: energy closes from the line to the shaft over whole
runs, and each loss is what the states say."""

import itertools

import numpy as np
import pytest
from plant_calls import KEEP, _advance, machine_J

from hexatorque import SimulatedDrive, load
from hexatorque.plant import meter
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.link import CHOPPER_J, LINE_A, RESISTANCE_J, SOURCE_J, V

LAPSE = 20.0
EVERYTHING = {
    "inverter.link_F": 470e-6, "inverter.source_ohm": 0.1, "inverter.source_H": 1e-3,
    "inverter.line_Hz": 50.0, "inverter.precharge_ohm": 47.0, "inverter.chopper_ohm": 60.0,
    "inverter.chopper_on_V": 290.0, "inverter.chopper_off_V": 280.0, "inverter.v_switch_V": 1.2,
    "inverter.v_diode_V": 1.0, "inverter.r_switch_ohm": 0.05, "inverter.r_diode_ohm": 0.03,
    "inverter.e_on_mJ": 0.5, "inverter.e_off_mJ": 0.3, "inverter.e_ref_V": 300.0,
    "inverter.e_ref_A": 10.0, "heat.switch_K_W": [0.1, 0.2, 0.3, 0.2],
    "heat.diode_K_W": [0.1, 0.2, 0.3, 0.2], "heat.sink_K_W": 0.5, "heat.winding_K_W": 0.4,
    "heat.time_lapse": LAPSE, "load.holding_Nm": 6.0, "load.kind": "constant",
}  # fmt: skip
IRON = {"machine.iron_hysteresis_A_Wb": 0.5, "machine.iron_eddy_S": 1e-3}
#: Of a machine with magnets, whose iron has no losses.
MAGNET = EVERYTHING | {
    "inverter.chopper_on_V": 570.0, "inverter.chopper_off_V": 550.0, "load.holding_Nm": 12.0,
    "controller.rotor_start": "known", "machine.cogging_Nm": 0.2,
}  # fmt: skip


def in_link_J(link):
    x = link.x
    return 0.5 * (link.link_F * x[V] ** 2 + link.source_H * np.sum(x[LINE_A:] ** 2))


def stored_J(sim):
    return in_link_J(sim.inverter.link) + machine_J(sim.machine, sim.plant_state)


def spent_J(sim):
    """What has become of the line's energy since the drive was made."""
    assert not sim._unheated  # all losses have reached the temperatures
    x, integrals = sim.inverter.link.x, sim.inverter.meter.x
    return {
        "source": x[RESISTANCE_J],
        "chopper": x[CHOPPER_J],
        "machine": sim.bodies.heat_J / LAPSE,
        "devices": sim.junctions.heat_J / LAPSE,
        "brake": float(sim.brake.heat_J),
        "friction": integrals[meter.FRICTION_J],
        "load": integrals[meter.LOAD_J],
    }


@pytest.mark.parametrize(
    ("name", "changes", "speed_rpm", "load_Nm"),
    (
        ("paper-a-feasible", EVERYTHING | IRON | {"machine.drs_ohm": [0.0] * 6}, 900, 1.0),
        ("magnet-interior", MAGNET, 2000, 5.0),
    ),
)
def test_energy_closes_over_a_whole_run_with_all_effects(name, changes, speed_rpm, load_Nm):
    """The drive charges its link, starts, accelerates under a load, reverses against its chopper,
    and is told to stop while it turns: then it coasts, and its holding brake closes."""
    sim = SimulatedDrive(load(name).changed(changes))
    begin_J = stored_J(sim)
    course = (
        (0.8, lambda: None),
        (1.0, sim.start),
        (0.5, lambda: sim.set("speed_ref_rpm", speed_rpm)),
        (0.5, lambda: sim.set("load_Nm", load_Nm)),
        (0.6, lambda: sim.set("speed_ref_rpm", -speed_rpm)),
        (0.8, sim.stop),
    )
    fastest = 0.0
    for seconds, order in course:
        order()
        sim.run(seconds, record=False)
        fastest = max(fastest, abs(sim.speed_rpm)) if sim.state == "run" else fastest
        given_J, spent = float(sim.inverter.link.x[SOURCE_J]), spent_J(sim)
        open_J = given_J - sum(spent.values()) - (stored_J(sim) - begin_J)
        # 4e-8 has been seen. A straight line between the currents at two edges leaves 2e-5.
        assert abs(open_J) < 2e-7 * given_J, spent
    assert sim.state == "idle" and fastest > 0.97 * speed_rpm and sim.plant_state[6] == 0
    assert sim.bodies.winding_degC.min() > 45 and sim.junctions.junction_degC.min() > 40.5
    load_J = spent.pop("load")  # it may have driven more than it has taken
    assert min(spent.values()) > 5e-3 * given_J or spent["friction"] > 1e-3 * given_J
    assert abs(load_J) > 1e-3 * given_J


class Powers:
    """What the meter integrates, in the order of its integrals, from states (n, 8) alone, with the
    resistances and drops of now."""

    def __init__(self, sim):
        p = self.p = sim.machine
        self.inverse = np.linalg.inv([[p.lls_H + p.lm_H, p.lm_H], [p.lm_H, p.llr_H + p.lm_H]])
        self.rr_ohm = sim.bodies._rr_ohm
        self.i_phase = sim._machine.i_phase.copy()
        self.devices = sim.inverter.devices.copy()
        self.load_Nm = sim.load_Nm

    def __call__(self, states, legs):
        """legs: (n, 6) states of the legs. Returns (n, INTEGRALS)."""
        p, omega = self.p, states[:, 6]
        i = states[:, :6] @ self.i_phase.T
        i_r = [self.inverse[1] @ np.array([states[:, a], states[:, 4 + a]]) for a in (0, 1)]
        w = p.pole_pairs * omega
        per_Wb2 = p.iron_hysteresis_A_Wb * np.abs(w) + p.iron_eddy_S * w**2
        found = np.zeros((len(states), meter.INTEGRALS))
        found[:, meter.LEG_A2S : meter.LEG_A2S + 6] = i**2
        found[:, meter.ROTOR_V2S] = self.rr_ohm**2 * (i_r[0] ** 2 + i_r[1] ** 2)
        found[:, meter.IRON_J] = per_Wb2 * (states[:, 0] ** 2 + states[:, 1] ** 2)
        found[:, meter.FRICTION_J] = p.viscous_Nms * omega**2
        found[:, meter.LOAD_J] = self.load_Nm * omega
        self._add_devices(found[:, meter.DEVICE_J :].reshape(-1, 6, 4), i, legs)
        return found

    def _add_devices(self, found, i, legs):
        d, out = self.devices, i > 0
        # Out of the upper rail, or into the lower one, a current flows through the switch.
        through_switch = (legs != OFF) & (out ^ (legs == LOW))
        upper = (legs == HIGH) | ((legs == OFF) & (i < 0))
        device = 2 * ~upper + ~through_switch  # in the order of legs.DEVICE_KINDS
        volts = d.v_V[range(6), device]
        volts = np.where(legs != OFF, volts * np.tanh(np.abs(i) / d.knee_A), volts)
        watts = volts * np.abs(i) + d.r_ohm[range(6), device] * i**2
        np.put_along_axis(found, device[:, :, None], watts[:, :, None], axis=2)


def test_each_loss_is_what_the_states_say():
    """A stretch of a run again, in pieces of at most 5 us, whose middles Simpson's rule needs."""
    setup = load("paper-a-feasible").changed(EVERYTHING | IRON).changed(machine__drs_ohm=[0.0] * 6)
    sim = SimulatedDrive(setup)
    sim.run(0.8, record=False)  # charges
    sim.start()
    sim.run(0.8, record=False)
    sim.set_many({"speed_ref_rpm": 900, "load_Nm": 0.5})
    sim.run(0.9, record=False)
    assert sim.state == "run" and sim.speed_rpm > 800
    sim.set("speed_ref_rpm", 300)
    sim.log_edges(60_000)
    periods = 400
    while sim._unheated:  # so that the temperatures stand still in the stretch
        sim.run(sim.period_s, record=False)
    start = sim.periods
    sim._unheated = -periods
    inv, m, y = sim.inverter.copy(), sim._machine.copy(), sim.plant_state.copy()
    shaft, powers = sim._load.copy(), Powers(sim)
    sim.run(periods * sim.period_s, record=False)
    edges = sim.edges[np.argsort(sim.edges[:, 0], kind="stable")]
    counts, clock_Hz = int(sim._timing.period), float(sim._timing.clock_Hz)
    first, last = start * counts, sim.periods * counts
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
    before = y.copy()
    integrals = inv.meter.x.copy()
    states, _, _ = _advance(inv, m, shaft, y, 250.0, rows, times)
    assert np.abs(y - sim.plant_state).max() < 1e-4 * np.abs(y).max()  # it is the same run
    integrals = inv.meter.x - integrals
    legs, dt = states_of_legs[::2], times[::2, None] / 3
    a, b, c = np.vstack([before, states[1:-1:2]]), states[1::2], states[::2]
    expected = np.sum(dt * (powers(a, legs) + 4 * powers(c, legs) + powers(b, legs)), axis=0)
    assert integrals[: meter.DEVICE_J] == pytest.approx(expected[: meter.DEVICE_J], rel=1e-6)
    devices, most = expected[meter.DEVICE_J :], expected[meter.DEVICE_J :].max()
    assert devices.min() > 1e-3 * most  # each of them has carried a current
    assert integrals[meter.DEVICE_J :] == pytest.approx(devices, abs=1e-5 * most)
    # The same stretch with the steps of the run itself.
    taken = sim.inverter.meter.x - (inv.meter.x - integrals)
    assert taken == pytest.approx(integrals, rel=1e-3, abs=1e-3 * most)
