"""Recordings of a simulation own their samples."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from hexatorque import InputError, firmware, setups, system
from hexatorque.drive.samples import Rows
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.loop import PLANT_CHANNELS
from hexatorque.plant.vsd import INVERSE, PHASES


def test_a_recording_keeps_its_samples_while_the_drive_runs_on():
    sim = SimulatedDrive(setups.load("paper-a-feasible"), 4)
    sim.start()
    sim.run(0.25)
    first = sim.take()
    at_once = pickle.loads(pickle.dumps(first))
    sim.set("speed_ref_rpm", 200.0)
    sim.run(0.25)
    second = sim.take()
    sim.run(0.01)
    assert len(first) == len(second) == 10_000
    for name in first.channels:
        assert np.array_equal(first[name], at_once[name], equal_nan=True), name
    assert not np.array_equal(first["plant.i_u1_A"], second["plant.i_u1_A"])


def test_phase_currents_are_those_of_the_four_components():
    sim = SimulatedDrive(setups.load("paper-a-feasible"), 4)
    sim.start()
    sim.run(0.25)
    found = sim.take()
    parts = np.array([found[f"plant.i_{name}_A"] for name in ("alpha", "beta", "x", "y")], float)
    for row, phase in zip(INVERSE, PHASES, strict=True):
        current_A = found[f"plant.i_{phase}_A"]
        assert np.max(np.abs(current_A)) > 0.1  # the flux is being built up
        assert np.max(np.abs(current_A - row @ parts)) < 1e-5 * np.max(np.abs(parts))


def test_a_small_recording_does_not_hold_the_memory_of_a_large_one():
    rows = Rows(2)
    rows.room(1000)
    rows.clear()
    rows.room(10)[:] = 7
    given = rows.hand_over()
    assert given.shape == (10, 2) and given.base is None
    rows.room(900)[:] = 8
    large = rows.hand_over()
    rows.room(900)[:] = 9
    assert large.shape == (900, 2) and np.all(large == 8) and np.all(given == 7)


def test_a_recording_knows_the_speed_references_of_its_time():
    sim = SimulatedDrive(setups.load("paper-a-feasible"), 1)
    sim.set("speed_ref_rpm", 50.0)
    sim.run(0.01)
    first = sim.take()
    sim.set("speed_ref_rpm", 200.0)
    sim.run(0.01)
    sim.set("control_mode", "torque")
    assert "speed_ref_rpm" not in sim.take().meta
    sim.set("control_mode", "speed")
    sim.run(0.01)
    own = float(setups.load("paper-a-feasible").parameter("speed_ref_rpm"))
    assert first.meta["speed_ref_rpm"] == [[0.0, own], [0.0, 50.0]]
    assert sim.take().meta["speed_ref_rpm"] == [[0.01, 200.0]]


def test_a_recording_never_takes_more_than_half_of_the_memory(monkeypatch):
    monkeypatch.setattr(system, "memory_bytes", lambda: 100_000_000)  # 4 s, told to 0.1 s
    sim = SimulatedDrive("paper-a-feasible")
    sim.run(0.02)
    with pytest.raises(
        InputError, match=r"duration_s = 3600: .* recording of \d\.\d s more"
    ) as told:
        sim.run(3600.0)
    most_s = float(re.search(r"of (\S+) s more", str(told.value))[1])
    assert sim.time_s == pytest.approx(0.02)  # refused before it begins
    sim.run(most_s - 0.05)
    with pytest.raises(InputError, match=r" 0\.[01] s more"):
        sim.run(0.2)
    taken = sim.take()
    arrays = sum(taken[name].nbytes for name in taken.channels)  # each channel has its own
    tables = 4 * len(taken) * len(PLANT_CHANNELS) + len(taken) * len(firmware.channels())
    assert 47.5e6 < arrays + tables <= 50e6
    assert len(taken) == 4 * round((0.02 + most_s - 0.05) / sim.period_s)
    sim.run(most_s - 0.1)  # the next recording has as much room again


def test_the_memory_of_this_computer_is_that_of_its_own_account():
    told = Path("/proc/meminfo")
    if not told.exists():
        pytest.skip("Linux tells it there")
    kB = int(re.search(r"MemTotal:\s+(\d+)", told.read_text(encoding="utf-8"))[1])
    assert system.memory_bytes() == pytest.approx(1024 * kB, rel=0.01)
