"""Six-pulse rectifier and precharge of the dc link, from first principles."""

import numpy as np
import pytest
from plant_calls import KEEP, NO_LOAD, _advance, set_leg
from scipy.integrate import solve_ivp

from hexatorque import SetupError, SimulatedDrive, load
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.link import (
    DRIVE_J,
    I_SOURCE,
    LINE_A,
    LINE_RAD,
    RESISTANCE_J,
    SOURCE_J,
    STATES,
    V,
    charge,
)  # fmt: skip
from hexatorque.plant.machines.induction import Parameters, make
from hexatorque.plant.vsd import PHASES

MEAN_V = 540.0
HZ = 50.0
#: Phase voltages of a line whose rectified mean is MEAN_V = 3 sqrt(2)/pi V_LL.
PEAK_V = np.sqrt(2 / 3) * MEAN_V * np.pi / (3 * np.sqrt(2))
LINES = 2 * np.pi / 3 * np.arange(3)
IDLE = {"link_F": 1e-3, "source_ohm": 0.05, "source_H": 1e-3, "line_Hz": HZ}


def line_V(rad):
    return PEAK_V * np.cos(rad - LINES)


def run(symmetric, seconds, at_V=MEAN_V, step_s=50e-6, **link):
    """The link alone, loaded by its chopper, which is always on: states after each step."""
    link = {"chopper_on_V": -1.0, "chopper_off_V": -2.0} | link
    inv, m = inverter_record(**link), make(symmetric.p)
    charge(inv.link, MEAN_V)
    inv.link.x[V] = at_V
    inv.link.chops = int(inv.link.chopper_ohm > 0)
    y = np.zeros(8)
    rows = []
    for _ in range(round(seconds / step_s)):
        _advance(inv, m, NO_LOAD, y, MEAN_V, np.full((1, 6), KEEP), np.array([step_s]))
        rows.append(inv.link.x.copy())
    return inv.link, np.array(rows)


class Reference:
    """The same circuit. The diodes change at events of scipy's integration."""

    def __init__(
        self, link_F, source_ohm, source_H, line_Hz, chopper_ohm=np.inf, precharge_ohm=0.0
    ):
        self.farad, self.ohm, self.henry, self.hertz = link_F, source_ohm, source_H, line_Hz
        self.load_ohm, self.precharge_ohm = chopper_ohm, precharge_ohm
        self.on = np.zeros(3, int)

    def parts(self, t, z):
        v, i = z[0], z[1:]
        e = line_V(2 * np.pi * self.hertz * t)
        rail = v + self.precharge_ohm * i[self.on > 0].sum()
        u = np.where(self.on > 0, rail, 0.0)
        shift = (e - u)[self.on != 0].mean() if self.on.any() else np.nan
        return v, i, e, rail, u, shift

    def slopes(self, t, z):
        v, i, e, _, u, shift = self.parts(t, z)
        slope = np.where(self.on != 0, (e - u - shift - self.ohm * i) / self.henry, 0.0)
        return np.append((i[self.on > 0].sum() - v / self.load_ohm) / self.farad, slope)

    def follow(self, z, end):
        """From event to event: first all currents that end, then all diodes that open."""
        t = 0.0
        out = [(t, z)]
        while t < end:
            _, _, e, rail, _, shift = self.parts(t, z)
            if not self.on.any():
                if np.ptp(e) > rail:
                    self.on[e.argmax()], self.on[e.argmin()] = 1, -1
            else:
                for k in np.flatnonzero(self.on == 0):
                    self.on[k] = int(e[k] - shift > rail) - int(e[k] < shift)
            events = []
            for k in range(3):

                def ends(t, z, k=k):
                    _, i, e, rail, _, shift = self.parts(t, z)
                    if self.on[k]:
                        return i[k] * self.on[k] + 1e-9
                    if not self.on.any():
                        return rail - np.ptp(e) + 1e-9
                    return min(rail - e[k] + shift, e[k] - shift) + 1e-9

                ends.terminal, ends.direction = True, -1
                events.append(ends)
            done = solve_ivp(
                self.slopes, (t, end), z, "DOP853", rtol=1e-10, atol=1e-10, events=events,
                max_step=2e-4,
            )  # fmt: skip
            t, z = done.t[-1], done.y[:, -1].copy()
            out += list(zip(done.t[1:], done.y.T[1:]))
            if done.status == 1:
                for k in np.flatnonzero([len(found) > 0 for found in done.t_events]):
                    if self.on[k]:
                        self.on[k], z[1 + k] = 0, 0.0
                if np.count_nonzero(self.on) < 2:
                    self.on[:], z[1:] = 0, 0.0
        return np.array([t for t, _ in out]), np.array([z for _, z in out])


@pytest.mark.parametrize(
    "changes",
    (
        {"chopper_ohm": 400.0},  # the current stops between the pulses
        {"chopper_ohm": 20.0},  # it does not, and the lines overlap
        {"chopper_ohm": 4.0, "source_H": 4e-3},  # they overlap for a long time
        {"chopper_ohm": 40.0, "precharge_ohm": 30.0},
    ),
    ids=("gaps", "overlap", "long overlap", "precharge"),
)
def test_conduction_intervals_and_currents_are_those_of_an_independent_integration(
    symmetric, changes
):
    link = IDLE | changes
    reference = Reference(**link)
    _, states = reference.follow(np.array([MEAN_V, 0, 0, 0]), 0.03)
    _, rows = run(symmetric, 0.03, **link)
    last = states[-1]
    assert abs(rows[-1, V] - last[0]) < 1e-6 * MEAN_V
    assert np.abs(rows[-1, LINE_A:] - last[1:]).max() < 2e-6 * np.abs(states[:, 1:]).max()


@pytest.mark.parametrize("henry", (1e-3, 4e-3))
def test_the_mean_voltage_is_that_of_the_line_less_the_drop_of_the_commutation(henry):
    """V = 3 sqrt(2)/pi V_LL - 3 w L/pi I where the current stands still, which a winding at rest
    holds. A line conducts for 120 degrees each way, and for the overlap u besides, with
    cos u = 1 - 2 w L I/(sqrt(2) V_LL)."""
    link = {"link_F": 1e-6, "source_ohm": 1e-4, "source_H": henry, "line_Hz": HZ}
    damped = {"chopper_ohm": 200.0, "chopper_on_V": -1.0, "chopper_off_V": -2.0}
    inv = inverter_record(**link, **damped)
    m = make(Parameters(1, 15.0, 1.0, 0.3, 0.3, 1e-5, 0.3, 10.0, 0.0))
    charge(inv.link, MEAN_V)
    inv.link.chops, y, step_s = 1, np.zeros(8), 20e-6
    for leg in range(6):
        set_leg(inv, m, y, leg, int(leg == 0))
    rows = []
    for _ in range(round(0.2 / step_s)):
        _advance(inv, m, NO_LOAD, y, MEAN_V, np.full((1, 6), KEEP), np.array([step_s]))
        rows.append(inv.link.x.copy())
    period = np.array(rows)[-round(1 / HZ / step_s):]  # fmt: skip
    mean_A, omega = period[:, I_SOURCE].mean(), 2 * np.pi * HZ
    assert period[:, I_SOURCE].std() < 0.02 * mean_A
    drop_V = 3 * omega * henry / np.pi * mean_A
    assert drop_V > 7
    assert MEAN_V - period[:, V].mean() == pytest.approx(drop_V, rel=0.02)
    overlap_rad = np.arccos(1 - 2 * omega * henry * mean_A / (np.sqrt(3) * PEAK_V))
    for line in range(3):
        on = np.mean(np.abs(period[:, LINE_A + line]) > 0)
        assert on == pytest.approx(2 / 3 + overlap_rad / np.pi, abs=0.004)
    # Six pulses in a period of the line.
    spectrum = np.abs(np.fft.rfft(period[:, V]))[1:60]
    assert spectrum.argmax() + 1 == 6
    assert spectrum[np.arange(1, 60) % 6 != 0].max() < 1e-3 * spectrum.max()


def test_without_a_load_the_capacitor_has_the_peak_and_nothing_flows_back(symmetric):
    _, rows = run(symmetric, 0.5, at_V=0.99 * np.pi / 3 * MEAN_V, **IDLE)
    assert np.sqrt(3) * PEAK_V == pytest.approx(np.pi / 3 * MEAN_V)
    assert rows[-1, V] == pytest.approx(np.pi / 3 * MEAN_V, rel=2e-3)
    assert np.all(np.diff(rows[:, V]) >= 0) and rows[:, I_SOURCE].min() >= 0
    _, states = run(symmetric, 0.1, at_V=700.0, **IDLE)
    assert np.array_equal(states[:, V], np.full(len(states), 700.0))
    assert np.all(states[:, SOURCE_J] == 0)


def stored_J(link, x):
    lines = 0.5 * link.source_H * np.sum(x[LINE_A:] ** 2)
    return 0.5 * link.link_F * x[V] ** 2 + lines


def test_an_empty_link_charges_through_the_resistor_which_takes_as_much_as_the_capacitor(symmetric):
    """From a direct source: v = V (1 - exp(-t/RC)), and each takes C V^2/2."""
    direct = {"link_F": 1e-3, "source_ohm": 0.5, "precharge_ohm": 49.5}
    inv = inverter_record(**direct)
    charge(inv.link, MEAN_V)
    assert inv.link.x[V] == 0 and inv.link.bridged == 0
    _, rows = run(symmetric, 1.0, at_V=0.0, **direct)
    assert rows[999, V] == pytest.approx(MEAN_V * (1 - np.exp(-1)), rel=1e-6)
    half_J = 0.5e-3 * MEAN_V**2
    assert rows[-1, RESISTANCE_J] == pytest.approx(half_J, rel=1e-6)
    assert rows[-1, SOURCE_J] == pytest.approx(2 * half_J, rel=1e-6)
    # From a rectifier the peak current is that of the resistor, and the energy closes.
    link, rows = run(symmetric, 0.5, at_V=0.0, precharge_ohm=50.0, **IDLE)
    assert rows[:, I_SOURCE].max() == pytest.approx(np.pi / 3 * MEAN_V / 50.1, rel=0.03)
    end = rows[-1]
    assert end[V] > MEAN_V
    assert abs(end[SOURCE_J] - end[RESISTANCE_J] - stored_J(link, end)) < 1e-6 * end[SOURCE_J]


def drive(**more):
    """A drive on a line of 50 Hz."""
    link = {
        "inverter.link_F": 470e-6, "inverter.source_ohm": 0.1, "inverter.source_H": 1e-3,
        "inverter.line_Hz": 50.0,
    }  # fmt: skip
    return SimulatedDrive(load("paper-a-feasible").changed(link | more), 1)


def test_the_relay_follows_the_firmware_and_the_drive_starts_behind_it():
    sim = drive(**{"inverter.precharge_ohm": 47.0})
    assert sim.link_V == 0
    level_V = sim.get("precharge_V")
    assert level_V == pytest.approx(0.8 * 250)
    bridged_at_V = []
    for _ in range(800):
        sim.run(1e-3, record=False)
        told = int(sim.controller.channel("outputs")) & 1
        assert sim.inverter.link.bridged == told
        if told and not bridged_at_V:
            bridged_at_V.append(sim.link_V)
    assert bridged_at_V[0] > 0.98 * 250
    sim.start()
    sim.set("speed_ref_rpm", 600)
    sim.run(0.8)
    sim.set("load_Nm", 5)
    sim.run(0.5)
    assert sim.state == "run" and sim.speed_rpm > 500
    recording = sim.take()
    volts, amperes = recording["plant.link_V"][-2000:], recording["plant.source_A"][-2000:]
    ripple = np.abs(np.fft.rfft(volts))
    ripple[:20] = 0  # what the voltage moves slowly
    assert ripple.argmax() == round(300 * len(volts) * sim.period_s)
    assert amperes.min() >= 0
    # What the source no longer gives: the relay opens, and the resistor limits the next inrush.
    sim.stop()
    sim.set("vdc_V", 0.0)
    sim.inverter.link.x[V] = 50.0
    sim.run(0.05, record=False)
    assert sim.inverter.link.bridged == 0
    sim.set("vdc_V", 250.0)
    sim.run(0.05)
    most_A = sim.take()["plant.source_A"].max()
    assert most_A < 250 * np.pi / 3 / 47.0


def test_energy_closes_over_a_run_that_charges_starts_brakes_and_loses_its_source():
    sim = drive(**{
        "inverter.precharge_ohm": 47.0, "inverter.chopper_ohm": 60.0,
        "inverter.chopper_on_V": 300.0, "inverter.chopper_off_V": 290.0,
    })  # fmt: skip
    link = sim.inverter.link
    sim.run(0.8, record=False)
    sim.start()
    sim.set("speed_ref_rpm", 800)
    sim.run(1.0, record=False)
    sim.set("speed_ref_rpm", 0)
    sim.run(0.3, record=False)
    sim.set("vdc_V", 0.0)
    sim.run(0.05, record=False)
    x = link.x
    spent = x[RESISTANCE_J:].copy()[:3].sum()
    assert x[DRIVE_J] > 10 and x[RESISTANCE_J + 1] > 5
    assert abs(x[SOURCE_J] - spent - stored_J(link, x)) < 1e-6 * x[SOURCE_J]
    assert abs(x[LINE_A:STATES].sum()) < 1e-9 and 0 <= x[LINE_RAD] <= 2 * np.pi


def test_what_is_recorded_does_not_change_a_rectifier():
    one, two = drive(), drive()
    for sim, record in ((one, True), (two, False)):
        sim.start()
        sim.run(0.4, record=record)
    assert np.array_equal(one.plant_state, two.plant_state)
    assert np.array_equal(one.inverter.link.x, two.inverter.link.x)


BAD = {
    "line_Hz needs inverter.link_F": ({"line_Hz": 50.0, "source_H": 1e-3}, "a rectifier feeds"),
    "line_Hz needs inverter.source_H": ({"line_Hz": 50.0, "link_F": 1e-3}, "no commutation"),
    "line_Hz = 0.5": ({"line_Hz": 0.5}, "0 (a direct source) or 1 Hz and more"),
    "line_Hz = 2000": ({"line_Hz": 2000.0}, "0 .. 1000 Hz"),
    "precharge_ohm needs inverter.link_F": ({"precharge_ohm": 10.0}, "nothing to charge"),
    "precharge_ohm = 1e-06": ({"precharge_ohm": 1e-6}, "0 (none) or 0.001 ohm and more"),
    "chopper_off_V = 255": (
        {
            "link_F": 1e-3, "source_H": 1e-3, "line_Hz": 50.0, "chopper_ohm": 40.0,
            "chopper_on_V": 280.0, "chopper_off_V": 255.0,
        },
        "more than 261.799 V",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_a_mistake_about_the_line_is_told_in_one_line(what):
    changes, told = BAD[what]
    with pytest.raises(SetupError) as refused:
        load("paper-a").changed(**{f"inverter__{name}": value for name, value in changes.items()})
    assert any(f"inverter.{what}" in line and told in line
               for line in str(refused.value).splitlines()[:1])  # fmt: skip


@pytest.mark.parametrize(
    "ohm, level_V, told",
    (
        (47.0, 0.0, "no relay bridges it"),
        (47.0, 250.0, "less than 250 V"),
        (0.0, 250.0, "less than 250 V"),
    ),
)
def test_a_relay_that_would_never_close_is_told(ohm, level_V, told):
    with pytest.raises(SetupError, match=told):
        drive(**{"inverter.precharge_ohm": ohm, "controller.precharge_V": level_V})


def test_a_machine_that_turns_charges_a_link_whose_line_has_not_conducted_yet():
    """At the first step the line's voltage is above the link's, and the machine's diodes conduct,
    too. What the link gains is no more than the largest currents into it could bring."""
    setup = load("magnet-surface").changed(
        {
            "inverter.link_F": 1e-3,
            "inverter.source_H": 2e-3,
            "inverter.source_ohm": 0.5,
            "inverter.line_Hz": 50.0,
            "inverter.precharge_ohm": 10.0,
            "controller.precharge_V": 40.0,
        }
    )
    sim = SimulatedDrive(setup)
    sim.plant_state[6] = -40.0
    sim.run(5e-4)
    found = sim.take()
    phases_A = sum(np.abs(found[f"plant.i_{phase}_A"]) for phase in PHASES)
    most_A = np.abs(found["plant.line_A"]).max() + 0.5 * phases_A.max()
    assert 1.0 < sim.link_V < most_A * 5e-4 / setup["inverter.link_F"]
