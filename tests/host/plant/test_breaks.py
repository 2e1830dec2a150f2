"""Legs that break: in a running drive against the independent drive of drive_reference, and what
each kind does to a current, from first principles.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from campaigns import part
from drive_reference import DriveReference
from plant_calls import NO_LOAD, advance, set_leg

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies.integration import LIMIT, run_segment
from hexatorque.experiments.operating_points import Point, approach
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import BREAK, HIGH, KINDS, LOW, MAX_BREAKS, OFF, OPEN
from hexatorque.plant.machines.induction import make
from hexatorque.plant.vsd import PHASES
from hexatorque.setups import SetupError

VDC_V = 250.0
ARC_V = 600.0  #: above V_dc, so that it ends any current
LEAKAGE_H = (1e-3, 0.0, -0.5e-3, 0.8e-3, 0.0, -1.2e-3)
BREAKS = list(product(KINDS[1:], PHASES, ("ddr", "dtc1", "db-dtfc")))


def broken_drive(scheme, *breaks, speed_rpm=400, load_Nm=10):
    """The firmware does not look for the loss or for a wrong flux: it would stop."""
    setup = setups.load("paper-a-feasible").changed(
        controller__scheme=scheme,
        controller__loss_check=0.0,
        controller__flux_check=0.0,
        machine__dlls_H=LEAKAGE_H,
    )
    sim = approach(Point(setup, speed_rpm, load_Nm))
    for phase, kind, after_s in breaks:
        sim.break_leg(phase, kind, after_s)
    return sim


def compare(phase_model, sim, duration_s):
    """(error of the phase currents relative to their amplitude, the reference, the segment)"""
    segment = run_segment(sim, duration_s)
    model = phase_model(sim.machine)
    arc_V = sim.setup["inverter.arc_V"]
    reference = DriveReference(model, sim.vdc_V, sim.load_Nm, arc_V=arc_V)
    i_s, i_r = model.currents(segment.state)
    reference.start(i_s, i_r, segment.state[6], segment.inverter.leg.tolist())
    reference.commands = segment.inverter.command.tolist()
    period = int(sim._timing.period)
    ends = [period * (segment.first + k + 1) for k in range(len(segment.currents_A))]
    currents_A, _ = reference.follow(
        segment.edges.tolist(), segment.first * period, ends, sim._timing.clock_Hz
    )
    error = np.max(np.abs(currents_A - segment.currents_A)) / segment.amplitude_A
    return error, reference, segment


@pytest.mark.parametrize("kind, phase, scheme", part(BREAKS, 4))
def test_each_kind_in_a_running_drive(phase_model, kind, phase, scheme):
    sim = broken_drive(scheme, (phase, kind, 3.37e-3))
    error, reference, segment = compare(phase_model, sim, 0.02)
    assert error < LIMIT / 10
    assert sim.broken[phase] == kind and reference.kinds[PHASES.index(phase)] == kind
    if kind == "open":
        assert reference.arc_s > 0
        assert np.max(np.abs(segment.currents_A[100:, PHASES.index(phase)])) < 1e-9
    else:
        assert reference.blocked > 0


def test_two_phases_lost_and_one_mended(phase_model):
    breaks = ("u1", "open", 2e-3), ("v2", "open", 4.1e-3), ("u1", "none", 8e-3)
    sim = broken_drive("dtc3", *breaks, speed_rpm=-100, load_Nm=3)
    error, _, segment = compare(phase_model, sim, 0.014)
    assert error < LIMIT / 10
    assert sim.broken == dict.fromkeys(PHASES, "none") | {"v2": "open"}
    assert np.max(np.abs(segment.currents_A[50:80, 0])) < 1e-9  # u1: lost
    assert np.max(np.abs(segment.currents_A[80:, 0])) > 0.05  # and back


def test_two_phases_of_a_set_lost(phase_model):
    """The currents of the other two end together. With u1 open and w1 blocked, what is left for v1
    are pulses through w1's diodes, which end at once."""
    sim = broken_drive("ddr", ("u1", "open", 1e-3), ("w1", "blocked", 2.3e-3))
    error, reference, segment = compare(phase_model, sim, 8e-3)
    assert error < LIMIT / 10
    assert reference.arc_s > 0 and reference.blocked > 0
    u1, v1, w1 = np.abs(segment.currents_A[30:, ::2]).T
    assert np.max(u1) < 1e-9
    assert np.max(np.abs(v1 - w1)) < 1e-9
    assert np.max(v1) < 0.2
    assert np.median(v1) < 1e-9


class Drive:
    """One set of legs under constant commands."""

    def __init__(self, model, commands, i_s, arc_V=ARC_V, omega=30.0):
        self.model = model
        self.p = replace(model.p, viscous_Nms=0.0)
        self.m = make(self.p)
        self.inv = inverter_record(arc_V=arc_V)
        i_r = model.rotor @ [1.0, -0.5]
        self.y = model.state(np.array(i_s), i_r, omega, 0.0)
        for leg, state in enumerate(commands):
            self.edge(leg, LOW)  # so that a leg that is then turned off finds its diode
            self.edge(leg, state)

    def edge(self, leg, state):
        set_leg(self.inv, self.m, self.y, leg, state)

    def advance(self, dt, steps=1):
        return advance(self.inv, self.m, NO_LOAD, self.y, dt, VDC_V, steps)

    @property
    def i(self):
        return self.m.i_phase @ self.y[:6]


@pytest.mark.parametrize("command, sign", [(LOW, 1), (HIGH, 1), (HIGH, -1), (OFF, -1)])
def test_arc_bounds_the_voltage_and_gives_the_energy_back(model, command, sign):
    """The phase's terminal has the rail's voltage less the arc's. So the current falls within the
    time that voltage and inductance allow, and not faster. The energy that the machine loses is
    what copper and arc take and what the dc link gets."""
    commands = [command, LOW, LOW, HIGH, LOW, LOW]
    drive = Drive(model, commands, [4.0 * sign, 1.0, -2.0 * sign, 1.0, -2.0 * sign, -2.0])
    drive.edge(0, BREAK + OPEN)
    dt, y0 = 0.5e-6, drive.y.copy()
    states, legs_V = drive.advance(dt, 1200)
    every = np.vstack([y0, states])
    i_A, i_r = model.currents(every)
    burns = i_A[1:, 0] * sign > 1e-6
    assert 10 < burns.sum() < 1100 and not burns[burns.sum() :].any()
    end = int(burns.sum()) + 1
    rail_V = VDC_V * (command == HIGH or (command == OFF and sign < 0))
    np.testing.assert_allclose(legs_V[: end - 1, 0], rail_V - sign * ARC_V)
    np.testing.assert_allclose(i_A[end + 1 :, 0], 0, atol=1e-7)

    def energy_J(y):
        i = np.concatenate(model.currents(y))
        return i @ model.inductance(0) @ i / 2 + drive.p.inertia_kgm2 * y[6] ** 2 / 2

    def mean(values):
        return (values[1:] + values[:-1]) / 2

    copper_W = (i_A**2) @ model.r_stator + model.p.rr_ohm * np.sum(i_r**2, axis=1)
    arc_W = ARC_V * np.abs(i_A[:, 0])
    rails_V = VDC_V * np.array([state == HIGH for state in commands], float)
    rails_V[0] = rail_V
    drawn_W = i_A @ rails_V
    spent_J = np.sum(mean(copper_W + arc_W - drawn_W)) * dt
    assert energy_J(every[0]) - energy_J(every[-1]) == pytest.approx(spent_J, rel=2e-3, abs=1e-5)


@pytest.mark.parametrize("others", (LOW, HIGH))
@pytest.mark.parametrize("rate_V_per_ms", (0.0, 20.0, 1e5))
def test_an_arc_strikes_again_beyond_what_the_contact_withstands(symmetric, rate_V_per_ms, others):
    """The machine stands still, so an open terminal is where the other legs are, and the contact
    sees V_dc while its own leg is at the other rail. What it withstands reaches that after (V_dc -
    arc)/rate. While the arc burns it takes its voltage from the current, whose sign is that of the
    voltage that has lit it."""
    arc_V, step_s = 100.0, 1e-6
    drive = Drive(symmetric, [others] * 6, np.zeros(6), arc_V, omega=0.0)
    drive.y[:6] = 0.0
    drive.inv.contact.restrike_V_per_s = 1e3 * rate_V_per_ms
    drive.edge(0, BREAK + OPEN)
    sign = 1 if others == LOW else -1
    now_s, lit_s = 0.0, []
    for _ in range(40):
        # At the rail of the others for so long that the current ends there.
        for state, steps in ((others, 300), (HIGH + LOW - others, 100)):
            drive.edge(0, state)
            states, legs_V = drive.advance(step_s, steps)
            i_A = sign * states[:, :6] @ drive.m.i_phase[0]
            assert np.all(i_A > -1e-6)
            burns = np.flatnonzero(i_A[:-1] > 1e-3)
            np.testing.assert_allclose(legs_V[burns, 0], VDC_V * (state == HIGH) - sign * arc_V)
            if state == others:
                assert len(burns) < steps / 2
            elif len(burns):
                lit_s.append(now_s)
            now_s += steps * step_s
    if rate_V_per_ms == 20.0:
        last_s = 1e-3 * (VDC_V - arc_V) / rate_V_per_ms
        assert lit_s[-1] == pytest.approx(last_s, abs=4e-4)
        assert len(lit_s) == pytest.approx(last_s / 4e-4, abs=1)
    else:
        assert not lit_s


def test_a_contact_bounces():
    """Open for half of the time, closed for a quarter, then open and closed for an eighth each."""
    setup = setups.load("paper-a-feasible").changed(inverter__bounce_ms=8.0)
    sim = SimulatedDrive(setup)
    sim.log_edges(10_000)
    sim.break_leg("w1", "open", 0.002)
    sim.break_leg("v2", "blocked", 0.003)  # a leg that is blocked does not bounce
    sim.run(0.012, record=False)
    found = sim.edges[sim.edges[:, 2] >= BREAK]
    w1 = found[found[:, 1] == PHASES.index("w1")]
    np.testing.assert_allclose(
        w1[:, 0] / sim._timing.clock_Hz, [0.002, 0.006, 0.008, 0.009, 0.010], atol=1e-7
    )
    assert w1[:, 2].tolist() == [BREAK + KINDS.index(k) for k in ("open", "none") * 2 + ("open",)]
    assert len(found) == 6 and sim.broken["w1"] == "open"


def test_open_phase_takes_any_voltage(symmetric):
    """The other legs of the set are shorted, and the rotor's flux turns so fast that the free
    terminal is far beyond the rails. A blocked leg's diode conducts there, an open phase does
    not."""
    largest_A = {}
    for kind in ("open", "blocked"):
        drive = Drive(symmetric, [LOW] * 6, np.zeros(6), omega=400.0)
        drive.edge(0, BREAK + KINDS.index(kind))
        states, legs_V = drive.advance(5e-6, 600)
        largest_A[kind] = np.max(np.abs(states[:, :6] @ drive.m.i_phase[0]))
        beyond = (legs_V[:, 0] < -1) | (legs_V[:, 0] > VDC_V + 1)
        assert beyond.any() == (kind == "open")
    assert largest_A["open"] < 1e-9 and largest_A["blocked"] > 0.05


@pytest.mark.parametrize("kind, dead", [("upper", HIGH), ("lower", LOW)])
def test_dead_switch_leaves_its_diode(symmetric, kind, dead):
    """The command that needs the dead switch leaves the leg to its diodes; the other one works."""
    i_s = [2.0, 1.0, -1.0, 0.0, -1.0, -1.0]
    for state in (LOW, HIGH):
        drive = Drive(symmetric, [state, LOW, LOW, HIGH, HIGH, LOW], i_s)
        drive.edge(0, BREAK + KINDS.index(kind))
        assert drive.inv.leg[0] == (OFF if state == dead else state)
        drive.edge(0, LOW if dead == HIGH else HIGH)
        assert drive.inv.leg[0] != OFF
        drive.edge(0, dead)
        assert drive.inv.leg[0] == OFF and drive.inv.diode[0] == 1  # the lower one: i > 0
        drive.edge(0, BREAK)
        assert drive.inv.leg[0] == dead and drive.inv.contact.breaks == 0


def test_instant_lies_within_a_period_and_recording_changes_nothing():
    """Broken at 2.34 periods: an edge at that count. Runs that record at other rates, or not at
    all, have the same bits."""
    ends = []
    for samples, recorded in ((1, True), (8, True), (4, False)):
        sim = SimulatedDrive(setups.load("paper-a-feasible"), samples)
        sim.start()
        sim.run(0.36, record=False)
        sim.log_edges(1000)
        sim.break_leg("w2", "blocked", 2.34 * sim.period_s)
        begin = sim.periods * int(sim._timing.period)
        sim.run(3 * sim.period_s, record=recorded)
        (edge,) = sim.edges[sim.edges[:, 2] >= BREAK].tolist()
        period = int(sim._timing.period)
        assert edge == [begin + round(2.34 * period), 3, BREAK + KINDS.index("blocked")]
        legs = sim.edges_since(sim.periods - 3, np.full(6, LOW))
        after = legs.time_s > 2.34 * sim.period_s
        assert set(legs.state[after & (legs.leg == 3)]) <= {OFF}
        ends.append(sim.plant_state.tobytes())
    assert len(set(ends)) == 1


@pytest.mark.parametrize(
    "values, named",
    [
        (("u3", "open"), ["phase = 'u3'", "u1, u2"]),
        (("u1", "melted"), ["kind = 'melted'", "blocked"]),
        (("u1", "open", -1), ["after_s = -1", "0 to 3600 s"]),
    ],
)
def test_mistakes_are_named_in_one_line(values, named):
    sim = SimulatedDrive(setups.load("paper-a-feasible"))
    with pytest.raises(SetupError) as caught:
        sim.break_leg(*values)
    assert all(text in str(caught.value) for text in named) and "\n" not in str(caught.value)


def test_only_so_many_breaks_may_be_to_come():
    sim = SimulatedDrive(setups.load("paper-a-feasible"))
    for n in range(MAX_BREAKS):
        sim.break_leg("u1", "open", n)
    with pytest.raises(SetupError, match=str(MAX_BREAKS)):
        sim.break_leg("u1", "none")
    sim = SimulatedDrive(setups.load("paper-a-feasible").changed(inverter__bounce_ms=1.0))
    sim.break_leg("u2", "blocked")
    for n in range((MAX_BREAKS - 1) // 5):
        sim.break_leg("u1", "open", n)  # and four more
    with pytest.raises(SetupError, match=f"with 5 more than {MAX_BREAKS}"):
        sim.break_leg("u2", "open")
    assert sim.inverter.coming.n == (MAX_BREAKS - 1) // 5 * 5 + 1
    sim.break_leg("u2", "blocked")


def test_profile_breaks_and_mends():
    text = 'setup = "paper-a-feasible"\n[profile]\nduration_s = 0.01\n'
    text += 'broken = [[0.004, "u1", "none"], [0.002, "u1", "open"], [0.003, "v2", "lower"]]\n'
    setup = setups.parse(text, "lost")
    sim = SimulatedDrive(setup)
    sim.log_edges(1000)
    sim.run_profile(setup.profile)
    found = sim.edges[sim.edges[:, 2] >= BREAK]
    np.testing.assert_allclose(found[:, 0] / sim._timing.clock_Hz, [0.002, 0.003, 0.004])
    assert found[:, 1:].tolist() == [[0, BREAK + 1], [5, BREAK + 4], [0, BREAK]]
