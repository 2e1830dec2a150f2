"""The study of what the shortest pulse costs: what is kept, and that it does cost something."""

import pytest

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import shortest_pulse


@pytest.fixture(scope="module")
def result():
    return shortest_pulse.study(quick=True)


@pytest.mark.parametrize("shortest_us", shortest_pulse.PULSES_US)
def test_the_drive_keeps_the_pulse_that_is_asked_for(shortest_us):
    """Dead time and pulse in counts of 1/150 MHz. Without one the dead time is left."""
    sim = SimulatedDrive(setups.load(shortest_pulse.SETUP), 1)
    shortest_pulse.any_pulse(shortest_us)(sim)
    sim.start()
    sim.run(2 * sim.period_s, record=False)
    counts = sim.controller.drive.config.control.period.shortest
    assert counts == round((sim.controller.number("dead_time_us") + shortest_us) * 150)
    other = SimulatedDrive(setups.load(shortest_pulse.SETUP), 1)
    assert other.controller.parameters["min_pulse_us"].min == 2.0  # its board is its own


def test_a_longer_pulse_has_more_ripple(result):
    """At 1200 r/min the centred legs come near the rails."""
    assert shortest_pulse.failures(result) == []
    ripples = [
        row["figures"]["torque_ripple_Nm"]
        for row in result["rows"]
        if row["variant"] == "db-dtfc, centred"
    ]
    assert len(ripples) == 3 and ripples[0] < ripples[1] < ripples[2]


def test_table_and_picture(result, tmp_path):
    ((_, heads, lines),) = shortest_pulse.grid(result)
    assert heads[-3:] == ["without", "2 µs", "4 µs"]
    assert len(lines) == 4 and all("–" not in line for line in lines)
    assert shortest_pulse.plot(result, tmp_path / "x.png").stat().st_size > 10_000


def test_a_point_that_cannot_be_measured_is_told(monkeypatch):
    def fails(*_):
        raise ArithmeticError("no current")

    monkeypatch.setattr(shortest_pulse, "measure", fails)
    result = shortest_pulse.study(quick=True)
    assert len(shortest_pulse.failures(result)) == len(result["rows"]) == 6
    assert "no current" in shortest_pulse.failures(result)[0]
    ((_, _, lines),) = shortest_pulse.grid(result)
    assert lines[0][-3:] == ["–"] * 3
