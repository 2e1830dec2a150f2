"""The fault campaign, a part of its runs without HT_WHOLE. Its own checks are tested too."""

import itertools
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from campaigns import WHOLE

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import auxiliaries, faults, magnet_faults
from hexatorque.plant.legs import HIGH, LOW, OFF


@pytest.fixture(scope="module")
def result():
    return faults.study(quick=not WHOLE)


def test_every_fault_is_found_and_named(result):
    assert result["runs"] >= (2000 if WHOLE else 280)
    for row in result["rows"]:
        assert row["errors"] == [], row["fault"]
        # Half of the damages leave one copy of the set whole, and that copy is taken.
        shares = {faults.DAMAGED_SET: 1 / 3, faults.REVERSAL: 0, faults.STUCK_THERMISTOR: 0}
        least = shares.get(row["fault"], 1 / 2)
        assert row["found"] >= least * row["runs"], row["fault"]


#: Without a leg a trip of these may be seen one period later: the latches are looked at one in each
#: period.
BY_A_LATCH = (
    "trip pin",
    "trip pin held low",
    "over-current between two samples",
    "over-voltage between two samples",
    "chopper stays on, until its resistor's thermal switch opens",
    "trip pin, with a holding brake",
)


def test_in_the_next_interrupt(result):
    """Whatever a sample can show takes one period; the rest its stated time."""
    slow = {f.name for f in faults.FAULTS if f.deadline != faults.NOW}
    assert len(slow) == 12
    unseen = faults.REVERSAL, faults.STUCK_THERMISTOR, faults.PAGE_SILENT, *magnet_faults.CASES
    for row in result["rows"]:
        if row["fault"] not in slow.union(unseen):
            longest = 2 if row["fault"] in BY_A_LATCH else 1
            assert row["periods_max"] in range(1, longest + 1), row["fault"]


def test_trip_states_of_magnets(result):
    """An encoder that has stopped is part of these runs. It takes up to 2 ms, 40 periods of 20 kHz;
    the short circuit comes two periods after the gates went off."""
    most = dict(zip(magnet_faults.CASES, (20, 23, 1, 40), strict=True))
    rows = {row["fault"]: row for row in result["rows"] if row["fault"] in most}
    assert len(rows) == len(most)
    for name, row in rows.items():
        assert row["found"] == row["runs"] and row["periods_max"] <= most[name], name


def test_the_chip_switches_off_without_the_slow_interrupt(result):
    """Without fast interrupts the gates are off in three periods, however seldom the slow interrupt
    comes; its frequency is 10 to 1000 Hz in these runs."""
    row = next(r for r in result["rows"] if r["fault"] == "ADC's interrupt lost")
    assert row["periods_max"] == faults.DEAD_MAN


def test_a_silent_page_ends_every_state_with_gates(result):
    row = next(r for r in result["rows"] if r["fault"] == faults.PAGE_SILENT)
    assert row["found"] == row["runs"] and set(row["found_in"]) >= set(faults.GATES_ON)
    assert 1e-4 * row["periods_max"] <= faults.PAGE_SILENT_S
    assert all(cause.startswith("no page answered") for cause in row["causes"])


def test_a_dead_man_that_does_not_know_a_state_fails_the_study(monkeypatch):
    """As if the monitor believed that the gates are off in the state test."""
    reason = faults.DeadMan.reason
    drives = []

    def blind(self, now_s, working, pages):
        working = working and drives[-1].state != "test"
        return reason(self, now_s, working, pages)

    class Watched(faults.PagedDrive):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            drives.append(self)

    monkeypatch.setattr(faults, "PagedDrive", Watched)
    monkeypatch.setattr(faults.DeadMan, "reason", blind)
    assert "gates on for 2 s" in faults.page_silent("test", "ddr", "paper-b", 1).error
    assert faults.page_silent("run", "ddr", "paper-b", 1).error == ""


def test_every_fault_is_found_under_interleaved_carriers():
    """The campaign draws a scheme for each run; this one has every fault that the law can take part
    in: not those of thermistors, chopper and line."""
    others = "thermistor", "chopper", "host silent"
    for n, fault in enumerate(faults.FAULTS):
        if any(word in fault.name for word in others):
            continue
        setup = fault.of_setups[n % len(fault.of_setups)]
        found = faults.run(fault, "run", "db-ipwm", setup, n)
        assert found.error == "", (fault.name, setup)
        assert found.cause or "run" not in fault.found_in, fault.name


@pytest.mark.parametrize("setup", ("magnet-surface", "magnet-24v"))
@pytest.mark.parametrize("case", magnet_faults.CASES)
def test_trip_states_of_magnets_under_interleaved_carriers(case, setup):
    for seed in range(3):
        assert magnet_faults.CASES[case]("db-ipwm", setup, seed).error == ""


@pytest.mark.parametrize("slow_Hz", (10.0, 1000.0))
@pytest.mark.parametrize("setup", faults.SETUPS)
@pytest.mark.parametrize("scheme", ("dtc1", "ddr", "db-dtfc", "db-ipwm"))
def test_current_of_a_lost_interrupt(setup, scheme, slow_Hz):
    """The last pattern stays on for three periods. In this time the current cannot reach the trip
    level, where it would stay if a slow interrupt had to come first."""
    trip_A = setups.load(setup).parameter("i_trip_A")
    assert faults.lost_interrupt_A(setup, scheme, slow_Hz, 3) < 1.2 * trip_A


@pytest.fixture(scope="module")
def safety_page():
    page = Path(__file__).resolve().parents[4] / "docs" / "safety.md"
    return " ".join(
        page.read_text().split("## Current of a lost interrupt")[1].split("##")[0].split()
    )


@pytest.mark.parametrize(
    ("setup", "scheme"),
    [("paper-a-feasible", "ddr"), ("paper-a-feasible", "dtc1"), ("paper-b", "dtc1")],
)
def test_the_page_states_the_currents_of_a_lost_interrupt(setup, scheme, safety_page):
    """The comparators and drivers of a user's trip chain are chosen by this table."""
    heads = re.search(r"\| `f_slow_Hz` \|([\d |]+)\| `i_trip_A`", safety_page)[1].split("|")
    row = re.search(rf"\| `{setup}`, (\w+), `{scheme}` \|([\d.| ]+)", safety_page)
    *stated_A, trip_A = (float(cell) for cell in row[2].replace("|", " ").split())
    loaded = setups.load(setup)
    assert row[1].lower() == loaded["timing.device"] and trip_A == loaded.parameter("i_trip_A")
    measured_A = [faults.lost_interrupt_A(setup, scheme, float(head)) for head in heads]
    assert len(measured_A) == 5 and stated_A == pytest.approx(measured_A, abs=0.06)


@pytest.mark.parametrize("setup", faults.SETUPS)
def test_the_page_states_the_currents_of_a_hung_processor(setup, safety_page):
    """At the reset of the watchdog the gates are still on, so nothing else has acted."""
    number = faults.SETUPS.index(setup)
    ms = re.search(r"([\d.]+) ms \(F28335\) or ([\d.]+) ms \(F28377S\)", safety_page)
    sim = SimulatedDrive(setups.load(setup), 1)
    slow_Hz = sim.controller.number("f_slow_Hz")
    assert float(ms[number + 1]) == pytest.approx(1e3 * faults.watchdog_s(sim, slow_Hz), abs=0.06)
    stated_A = re.search(r"up to (\d+) A and (\d+) A, twice", safety_page)[number + 1]
    peak_A = faults.hung_A(setup)
    assert float(stated_A) == pytest.approx(peak_A, abs=0.6)
    assert peak_A / sim.controller.number("i_trip_A") == pytest.approx(2.0, abs=0.4)


def test_tables_and_picture(result, tmp_path):
    assert len(faults.grid(result)[0][2]) == len(result["rows"]) > len(faults.FAULTS)
    assert faults.failures(result) == []
    path = faults.plot(result, tmp_path / "faults.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000


def test_every_fault_in_every_state_scheme_and_set_up():
    for fault in faults.FAULTS:
        everywhere = set(itertools.product(faults.STATES, firmware.schemes(), fault.of_setups))
        assert set(faults.places(fault, faults.RUNS)) == everywhere, fault.name


# --- the campaign's own eyes ------------------------------------------------------


def find(name):
    return next(f for f in faults.FAULTS if f.name == name)


def test_a_fault_that_is_not_found_fails_the_study():
    harmless = faults.Fault("nothing", lambda sim, rng: None, ("over-current",))
    result = faults.run(harmless, "run", "ddr", "paper-a-feasible", 1)
    assert result.error == "not found within 1 periods"


def test_a_cause_named_wrongly():
    trip = find("trip pin")
    misnamed = faults.Fault("trip pin", trip.inject, ("over-speed",))
    result = faults.run(misnamed, "run", "ddr", "paper-a-feasible", 1)
    assert result.error == "named external trip"


def test_gates_that_come_on_again(monkeypatch):
    """Someone releases the latch behind the firmware's back: it is set again within a
    period, which is a period too late for the campaign."""

    def release(sim, rng):
        m, words = sim.controller.map, sim.controller.register_words()
        for leg in range(6):
            words[m.epwm + leg * m.stride + m.tzflg] = 0

    monkeypatch.setattr(faults, "_disturb", release)
    result = faults.run(find("trip pin"), "run", "ddr", "paper-a-feasible", 1)
    assert result.error in ("a gate came on after the latch", "a leg changed after the latch")


def test_a_brake_or_a_chopper_that_stays_on_fails_the_study(monkeypatch):
    held = find("trip pin, with a holding brake")
    where = "run", "ddr", "paper-b"
    assert not faults.run(held, *where, 1).error
    monkeypatch.setattr(firmware.Controller, "set_trip_pin", lambda *_: None)
    assert "not found" in faults.run(held, *where, 1).error
    monkeypatch.undo()
    monkeypatch.setattr(auxiliaries, "high", lambda *_: 1)
    assert faults.run(held, *where, 1).error == "the brake's pin is high"
    never = find("chopper never comes on")
    assert not faults.run(never, *where, 1).error
    monkeypatch.setattr(faults.SimulatedDrive, "link_V", 500.0)
    assert "500 V with the gates off" in faults.run(never, *where, 1).error


def test_a_thermistor_that_trips_the_drive_by_standing_still_fails_the_study(monkeypatch):
    assert not faults.stuck_thermistor("run", "ddr", "paper-a-feasible", 1).error
    monkeypatch.setattr(auxiliaries, "stuck_cool", auxiliaries.stuck_hot)
    found = {faults.stuck_thermistor("run", "ddr", "paper-a-feasible", n).error for n in range(6)}
    assert "power stage hot" in found


def test_a_host_that_goes_on_talking_trips_nothing():
    talks = faults.Fault(
        "host silent", lambda sim, rng: None, ("link lost",), deadline=faults.WATCHDOG,
        drive=faults.HostedDrive,
    )  # fmt: skip
    result = faults.run(talks, "run", "ddr", "paper-b", 1)
    assert result.error == f"not found within {faults.WATCHDOG} periods"


def test_a_restart_that_leaves_gates_on_fails_the_study(monkeypatch):
    assert not faults.restarted("run", "ddr", "paper-b", 1).error
    monkeypatch.setattr(faults, "_pwm_pins", lambda *_: 12)
    assert "gates off" in faults.restarted("run", "ddr", "paper-b", 1).error
    monkeypatch.undo()
    # A drive that never had a gate on shows nothing.
    monkeypatch.setattr(faults, "_bring_to", lambda *_: None)
    assert "before the restart" in faults.restarted("run", "ddr", "paper-b", 1).error


def test_a_short_pulse_in_a_reversal_fails_the_study(monkeypatch):
    assert not faults.reversal("run", "foc", "paper-b", 1).error
    monkeypatch.setattr(SimulatedDrive, "short_pulses", 1)
    assert "a gate pulse" in faults.reversal("run", "foc", "paper-b", 1).error


def test_a_store_without_checks_fails_the_study(monkeypatch):
    """The campaign compares values: a start that takes what was damaged is seen."""
    assert all(not faults.damaged_set("f28377s", seed).error for seed in range(20))

    class Careless(firmware.Controller):
        def __init__(self, device, values, store):
            super().__init__(device, values, store=store)
            if bytes(store.areas).strip(b"\xff") and self.parameter_set != "saved":
                self.store.handle.set = 1  # says so, and has others

    monkeypatch.setattr(firmware, "Controller", Careless)
    found = {faults.damaged_set("f28377s", seed).error for seed in range(20)}
    assert "a wrong value" in found


@pytest.mark.parametrize("device", firmware.BOARDS)
def test_a_wrong_clock_is_found_by_the_start(device, monkeypatch):
    assert all(not faults.wrong_clock(device, seed).error for seed in range(12))
    # A chip whose clock is right: the row would say so.
    monkeypatch.setattr(faults, "_plant_clock", lambda *_: None)
    assert faults.wrong_clock(device, 1).error == "the clock was taken for right"


def test_a_wrong_clock_that_is_accepted_fails_the_study(monkeypatch):
    """Whoever looks away from the pins is seen."""
    monkeypatch.setattr(faults, "_pwm_pins", lambda *_: 12)
    assert faults.wrong_clock("f28377s", 1).error == "gates could come on"


def test_legs_that_change_without_dead_time_are_found():
    clock = SimpleNamespace(map=SimpleNamespace(pwm_clock_Hz=100e6))
    dead = {"inverter.dead_time_us": 2.0}

    def seen(*edges, **counted):
        none = {"gate_mistake": ""}
        sim = SimpleNamespace(
            setup=dead, controller=clock, edges=np.array(edges), **{**none, **counted}
        )
        return faults.shoot_through(sim, np.array([LOW] * 6))

    assert seen((0, 0, OFF), (200, 0, HIGH), (900, 0, OFF), (1100, 0, LOW)) == ""
    assert "without dead time" in seen((0, 0, HIGH))
    assert "199 counts" in seen((0, 0, OFF), (199, 0, HIGH))
    assert seen((0, 0, OFF), (100, 1, OFF), (300, 1, HIGH), (400, 0, HIGH)) == ""
    assert seen((0, 0, OFF), gate_mistake="a gate pulse of 0.07 us") == "a gate pulse of 0.07 us"


@pytest.mark.parametrize("state", faults.STATES)
def test_trip_pin_held_low(state):
    result = faults.run(find("trip pin held low"), state, "ddr", "paper-b", 3)
    assert result.error == ""


@pytest.mark.parametrize("command", ("start", "clear"))
def test_a_command_that_a_low_trip_pin_does_not_refuse(monkeypatch, command):
    """A firmware that does not look at the pin: the pin is high for the command alone."""
    honest = getattr(firmware.Controller, command)

    def blind(self):
        self.set_trip_pin(1)
        try:
            honest(self)
        finally:
            self.set_trip_pin(0)

    monkeypatch.setattr(faults, "_disturb", lambda sim, rng: None)
    monkeypatch.setattr(firmware.Controller, command, blind)
    held = find("trip pin held low")
    result = faults.run(held, "idle" if command == "start" else "run", "ddr", "paper-b", 3)
    assert command in result.error


@pytest.mark.parametrize("setup", faults.SETUPS)
def test_restart_without_an_encoder(setup):
    """What flux is left is taken for one that stands still, and the current shows that it does
    not."""
    rng = np.random.default_rng(5)
    sim = SimulatedDrive(faults._setup(setup, "ddr", rng, 0), 1)
    faults._bring_to(sim, "run", rng)
    sim.set("load_Nm", 0.0)
    sim.stop()
    assert faults._restart(sim) == ""  # caught
    assert sim.controller.state == "run"
    sim.stop()
    sim.sensors.hold[faults.ENCODER] = 1
    sim.run(0.05, record=False)
    assert abs(sim.speed_rpm) > 200
    assert faults._restart(sim) == ""
    assert sim.controller.faults == ["encoder against flux speed"]
    assert sim.controller.snapshot["state"] in ("build", "run")  # by how much flux is left
