"""The dc link with a capacitor: an independent integration finds the same, and energy closes."""

import itertools

import numpy as np
import pytest
from plant_calls import KEEP, NO_LOAD, _advance, machine_J, set_leg
from scipy.integrate import solve_ivp

from hexatorque import SetupError, SimulatedDrive, load
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.link import CHOPPER_J, DRIVE_J, I_SOURCE, RESISTANCE_J, SOURCE_J, V, charge
from hexatorque.plant.machines.induction import make

SOURCE_V = 250.0
CHOPPER = {"chopper_ohm": 40.0, "chopper_on_V": 254.0, "chopper_off_V": 252.0}
LINKS = {
    "resistance": {"link_F": 200e-6, "source_ohm": 0.5},
    "inductance": {"link_F": 200e-6, "source_ohm": 0.2, "source_H": 1e-3},
    "chopper": {"link_F": 200e-6, "source_ohm": 0.5, "source_H": 1e-3, **CHOPPER},
    "chopper without inductance": {"link_F": 200e-6, "source_ohm": 0.5, **CHOPPER},
}


class Reference:
    """The phase model (conftest.py) behind a capacitor. The diode and the chopper change at events
    of scipy's integration."""

    def __init__(self, model, link_F, source_ohm, source_H=0.0, **chopper):
        self.model, self.farad, self.ohm, self.henry = model, link_F, source_ohm, source_H
        self.chopper_ohm = chopper.get("chopper_ohm", np.inf)
        self.on_V, self.off_V = chopper.get("chopper_on_V"), chopper.get("chopper_off_V")
        self.source_V = SOURCE_V
        self.feeds = self.chops = False
        self.changes = 0

    def slopes(self, _, z):
        flux, omega, theta, v, i_source = z[:-4], z[-4], z[-3], z[-2], z[-1]
        p = self.model.p
        i_s, i_r = self.model.solve(flux, p.pole_pairs * theta)
        torque = self.model.torque(i_s, i_r, p.pole_pairs * theta)
        rise = 0.0
        if self.henry:
            rise = (self.source_V - v - self.ohm * i_source) / self.henry if self.feeds else 0.0
        else:
            i_source = (self.source_V - v) / self.ohm if self.feeds else 0.0
        i_link = i_source - i_s @ self.legs - (v / self.chopper_ohm if self.chops else 0.0)
        turning = (torque - p.viscous_Nms * omega) / p.inertia_kgm2
        slopes = self.model.flux_slopes(i_s, i_r, v * self.legs)
        return np.concatenate([slopes, [turning, omega, i_link / self.farad, rise]])

    def diode(self, _, z):
        if self.feeds:
            return z[-1] if self.henry else self.source_V - z[-2]
        return z[-2] - self.source_V

    def level(self, _, z):
        if self.on_V is None:
            return 1.0
        return z[-2] - self.off_V if self.chops else self.on_V - z[-2]

    def follow(self, z, legs, dt):
        self.legs = np.asarray(legs, float)
        diode, level = (lambda t, z: self.diode(t, z)), (lambda t, z: self.level(t, z))
        for event in (diode, level):
            event.terminal, event.direction = True, -1
        now = 0.0
        while now < dt:
            if self.diode(now, z) < -1e-12 or (self.changes and self._just == "diode"):
                self.feeds, z = not self.feeds, z.copy()
                z[-1] = 0.0
            self._just = ""
            done = solve_ivp(
                self.slopes, (now, dt), z, "DOP853", rtol=1e-11, atol=1e-12, events=[diode, level]
            )
            now, z = done.t[-1], done.y[:, -1]
            if done.status == 1:
                self.changes += 1
                if len(done.t_events[1]):
                    self.chops = not self.chops
                else:
                    self._just = "diode"
        return z


@pytest.mark.parametrize("kind", LINKS)
def test_an_independent_integration_finds_the_same_voltages_and_currents(symmetric, kind):
    rng = np.random.default_rng(7)
    i_s, i_r = symmetric.free @ rng.normal(0, 6, 4), symmetric.rotor @ rng.normal(0, 6, 2)
    reference = Reference(symmetric, **LINKS[kind])
    reference._just = ""
    inv, m = inverter_record(**LINKS[kind]), make(symmetric.p)
    charge(inv.link, SOURCE_V)
    y = symmetric.state(i_s, i_r, 120.0, 0.0)
    z = np.concatenate([symmetric.fluxes(i_s, i_r, 0.0), [120.0, 0.0, SOURCE_V, 0.0]])
    found, expected = [], []
    for n in range(80):
        source_V = reference.source_V = 235.0 if 30 <= n < 50 else SOURCE_V
        legs = rng.integers(0, 2, 6)
        for leg in range(6):
            set_leg(inv, m, y, leg, legs[leg])
        _advance(inv, m, NO_LOAD, y, source_V, np.full((1, 6), KEEP), np.array([60e-6]))
        z = reference.follow(z, legs, 60e-6)
        i, _ = symmetric.currents(y)
        found.append([*i, inv.link.x[V]])
        i, _ = symmetric.solve(z[:-4], symmetric.p.pole_pairs * z[-3])
        expected.append([*i, z[-2]])
    found, expected = np.array(found), np.array(expected)
    assert reference.changes > 5
    assert np.ptp(expected[:, 6]) > 5  # the voltage moves
    assert np.abs(found[:, :6] - expected[:, :6]).max() < 1e-6 * np.abs(expected[:, :6]).max()
    assert np.abs(found[:, 6] - expected[:, 6]).max() < 1e-6 * SOURCE_V


def brake(**changes):
    """A drive that brakes into its capacitor and its chopper, and then loses its source."""
    link = {
        "link_F": 300e-6, "source_ohm": 0.3, "source_H": 0.5e-3,
        "chopper_ohm": 60.0, "chopper_on_V": 300.0, "chopper_off_V": 295.0,
    }  # fmt: skip
    setup = load("paper-a-feasible").changed(
        machine__drs_ohm=[0.0] * 6,
        **{f"inverter__{name}": value for name, value in (link | changes).items()},
    )
    sim = SimulatedDrive(setup)
    sim.start()
    sim.set("speed_ref_rpm", 800)
    sim.run(1.2, record=False)
    return sim


def lost_W(sim, states):
    """Copper and friction at each of the states."""
    p = sim.machine
    ab = np.linalg.inv(np.array([[p.lls_H + p.lm_H, p.lm_H], [p.lm_H, p.llr_H + p.lm_H]]))
    total = p.viscous_Nms * states[:, 6] ** 2
    for axis in (0, 1):
        i_s, i_r = ab @ np.array([states[:, axis], states[:, 4 + axis]])
        total = total + 3 * (p.rs_ohm * i_s**2 + p.rr_ohm * i_r**2)
    return total + 3 * p.rs_ohm * (states[:, 2] ** 2 + states[:, 3] ** 2) / p.lxy_H**2


def test_energy_closes_from_source_to_shaft_over_a_run_that_brakes_and_loses_its_source():
    sim = brake(dead_time_us=2.3)
    sim.log_edges(60_000)
    link, clock_Hz = sim.inverter.link, float(sim._timing.clock_Hz)
    begin, inv, y = sim.periods, sim.inverter.copy(), sim.plant_state.copy()
    sim.set("speed_ref_rpm", 0)
    sim.run(0.06, record=False)
    middle = sim.periods
    sim.vdc_V = 0.0
    sim.run(0.02, record=False)
    edges = sim.edges.copy()
    # The same again, edge by edge in pieces of at most 5 us, whose middles Simpson's rule needs.
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    period = int(sim._timing.period)
    lost = 0.0
    before = inv.link.x.copy(), y.copy()
    for source_V, first, last in ((250.0, begin, middle), (0.0, middle, sim.periods)):
        inside = edges[(edges[:, 0] >= first * period) & (edges[:, 0] < last * period)]
        marks = np.unique([first * period, *inside[:, 0], last * period])
        rows, times = [], []
        for now, then in itertools.pairwise(marks):
            here = inside[inside[:, 0] == now]
            dt = (then - now) / clock_Hz
            pieces = 2 * int(np.ceil(dt / 10e-6))
            legs = np.full((pieces, 6), KEEP)
            for _, leg, state in here:
                legs[0, leg] = state
            rows.append(legs)
            times.append(np.full(pieces, dt / pieces))
        rows, times = np.concatenate(rows), np.concatenate(times)
        start = y.copy()
        states, _, _ = _advance(inv, sim._machine, NO_LOAD, y, source_V, rows, times)
        power = lost_W(sim, np.vstack([start, states]))
        lost += np.sum((power[:-2:2] + 4 * power[1:-1:2] + power[2::2]) * times[::2]) / 3
    x0, x1 = before[0], inv.link.x
    flows = x1 - x0
    throughput = np.abs(flows[SOURCE_J:]).sum()
    assert flows[CHOPPER_J] > 5 and flows[RESISTANCE_J] > 0
    link_J = sum(
        sign * (0.5 * link.link_F * x[V] ** 2 + 0.5 * link.source_H * x[I_SOURCE] ** 2)
        for sign, x in ((1, x1), (-1, x0))
    )
    spent = flows[RESISTANCE_J] + flows[CHOPPER_J] + flows[DRIVE_J]
    assert abs(flows[SOURCE_J] - spent - link_J) < 1e-6 * throughput
    gained_J = machine_J(sim.machine, y) - machine_J(sim.machine, before[1])
    assert abs(flows[DRIVE_J] - lost - gained_J) < 1e-6 * (lost + abs(gained_J))


def test_a_source_takes_no_energy_back():
    sim = brake(chopper_ohm=0.0)
    given = sim.inverter.link.x[SOURCE_J]
    sim.set("torque_limit_Nm", 3)
    sim.set("speed_ref_rpm", 0)
    sim.run(0.05, record=False)
    assert sim.link_V > 270  # it brakes into the capacitor
    assert sim.inverter.link.x[SOURCE_J] - given < 0.5
    assert sim.inverter.link.x[I_SOURCE] == 0


def test_what_is_recorded_does_not_change_a_link():
    one, two = brake(), brake()
    for sim, record in ((one, True), (two, False)):
        sim.set("speed_ref_rpm", 0)
        sim.run(0.05, record=record)
    assert np.array_equal(one.plant_state, two.plant_state)
    assert np.array_equal(one.inverter.link.x, two.inverter.link.x)


def test_gates_off_leave_the_link_to_its_source_and_chopper():
    sim = SimulatedDrive(
        load("paper-a-feasible").changed(
            inverter__link_F=1e-3, inverter__source_ohm=2.0, inverter__chopper_ohm=50.0,
            inverter__chopper_on_V=320.0, inverter__chopper_off_V=300.0,
        )
    )  # fmt: skip
    sim.inverter.link.x[V] = 330.0
    sim.run(1e-3, record=False)
    # The chopper discharges from 330 V: v = 330 exp(-t/RC), then the link stays.
    assert sim.link_V == pytest.approx(330 * np.exp(-1e-3 / 0.05), rel=1e-9)
    sim.run(10e-3, record=False)
    assert sim.link_V == pytest.approx(300.0, abs=1e-6)
    sim.inverter.link.x[V] = 200.0
    sim.run(1e-3, record=False)
    assert sim.link_V == pytest.approx(250 - 50 * np.exp(-1e-3 / 2e-3), rel=1e-7)


BAD = {
    "chopper_off_V": (dict(CHOPPER, link_F=1e-3, chopper_off_V=249.0), "more than 250 V"),
    "chopper_on_V": (dict(CHOPPER, link_F=1e-3, chopper_on_V=251.0), "more than 252 V"),
    "chopper_on_V = 900": (dict(CHOPPER, link_F=1e-3, chopper_on_V=900.0), "less than "),
    "chopper_ohm needs inverter.link_F": (CHOPPER, "above 0"),
    "link_F = 1e-07": ({"link_F": 1e-7}, "0 (a stiff link) or 1e-06 F and more"),
    "link_F = 11": ({"link_F": 11.0}, "0 .. 10 F"),
    "source_ohm = 0": ({"source_ohm": 0.0}, "0.0001 .. 1000 ohm"),
}


@pytest.mark.parametrize("what", BAD)
def test_a_mistake_about_the_link_is_told_in_one_line(what):
    changes, range_text = BAD[what]
    with pytest.raises(SetupError) as refused:
        load("paper-a").changed(**{f"inverter__{name}": value for name, value in changes.items()})
    (line,) = str(refused.value).splitlines()
    assert f"inverter.{what}" in line and range_text in line


def test_a_link_that_needs_too_short_steps_is_refused():
    setup = load("paper-a").changed(inverter__link_F=1e-6, inverter__source_ohm=1e-3)
    with pytest.raises(SetupError, match=r"link_F = 1e-06 .* steps below 0\.1 us"):
        SimulatedDrive(setup)
