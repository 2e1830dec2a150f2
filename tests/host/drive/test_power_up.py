"""The power-up list of docs/first-spin.md, where the simulation can follow it: a board
whose gates switch before there is a dc link, one with a tenth of its voltage.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies.faults import FAULTS
from hexatorque.firmware import FirmwareError
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.vsd import PHASES

LIST = (Path(__file__).resolve().parents[3] / "docs" / "first-spin.md").read_text()
LIST = LIST[LIST.index("## Power-up") :]


@pytest.fixture(params=("paper-a-feasible", "paper-b"))
def sim(request):
    return SimulatedDrive(setups.load(request.param))


def step(number):
    """What the list says at a step, in one line."""
    return " ".join(re.split(r"^### \d+\. ", LIST, flags=re.M)[number].split())


def low_voltage(sim, share):
    """A bench supply at this share of the rating, and a firmware that accepts it."""
    vdc = sim.setup["inverter.vdc_V"]
    sim.set("vdc_V", share * vdc)
    sim.set("build_s", 10.0)
    sim.set("vdc_min_V", 0.5 * share * vdc)


def test_step_3_nothing_starts_with_the_trip_pin_low(sim):
    """Clear and start are refused and name the pin; no edge on any gate, not even when the pin
    goes high again. Then both are accepted."""
    assert "Both are refused with the trip named" in step(3)
    sim.controller.set_trip_pin(0)
    sim.run(0.01)
    sim.log_edges(100_000)
    for command in (sim.clear, sim.start):
        with pytest.raises(FirmwareError, match="the trip pin is low"):
            command()
        sim.run(0.1, record=False)
    sim.controller.set_trip_pin(1)
    sim.run(0.1, record=False)
    assert sim.state == "idle" and len(sim.edges) == 0
    sim.start()
    sim.run(0.1, record=False)
    assert sim.state == "build" and len(sim.edges) > 0


def test_step_4_gates_switch_without_a_dc_link(sim):
    """w1 and v2 do, for as long as the build-up lasts, u1 and u2 are high, w2 and v1 low; no
    fault."""
    assert "the upper switches of u1 and u2 on, the lower ones of w2 and v1" in step(4)
    low_voltage(sim, 0.0)
    sim.run(0.01)
    sim.start()
    sim.log_edges(100_000)
    sim.run(1.0, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("build", [])
    late = sim.edges[sim.edges[:, 0] > sim.edges[-1, 0] // 2]
    assert set(late[:, 1]) == {2, 5}
    state = {int(leg): int(new) for _, leg, new in sim.edges}
    assert [state[leg] for leg in (0, 1, 3, 4)] == [HIGH, HIGH, LOW, LOW]


def test_step_5_dead_time_on_all_six_legs(sim):
    """The list's own parameters, read from it: without a dc link four legs switch, and with
    the list's second torque reference the other two as well. Each change of a leg goes by
    way of both gates off, for the dead time."""
    words = step(5)
    settings = [dict(re.findall(r"(\w+)=([\w.-]+)", text))
                for text in re.findall(r"`board set ([^`]*)`", words)]  # fmt: skip
    assert len(settings) == 2
    dead_counts = sim.get("dead_time_us") * 1e-6 * float(sim.controller.map.pwm_clock_Hz)
    sim.set("vdc_V", 0.0)
    sim.set_many({
        name: value if not value.replace(".", "").isdigit() or sim.params[name].choices
        else float(value)
        for name, value in settings[0].items()
    })  # fmt: skip
    sim.run(0.01)
    sim.start()
    seen = []
    for changes in (None, settings[1]):
        if changes:
            sim.set_many({name: float(value) for name, value in changes.items()})
        sim.run(0.1, record=False)
        sim.log_edges(2_000_000)
        sim.run(3.0, record=False)
        assert (sim.controller.state, sim.controller.faults) == ("run", [])
        edges = sim.edges
        seen.append(set(map(int, edges[:, 1])))
        for leg in seen[-1]:
            times, states = edges[edges[:, 1] == leg][:, 0], edges[edges[:, 1] == leg][:, 2]
            assert set(states) == {LOW, HIGH, OFF}
            off = states[:-1] == OFF
            assert (off | (states[1:] == OFF)).all()  # never straight from one to the other
            assert np.diff(times)[off] == pytest.approx(dead_counts, abs=1.0)
    assert seen == [{0, 1, 2, 3}, {1, 2, 4, 5}]
    assert "u1, u2, w1 and w2 switch" in words and "u2, w1, v1 and v2 do" in words


def test_step_6_a_trip_turns_all_off_and_a_clear_nothing_on(sim):
    """While the gates switch without a dc link: off within a period, with the list's fault;
    no edge from then on, nor after the clear."""
    assert "*external trip* (0x10)" in step(6)
    (trip,) = (fault for fault in FAULTS if fault.name == "trip pin")
    low_voltage(sim, 0.0)
    sim.run(0.01)
    sim.start()
    sim.run(0.2, record=False)
    trip.inject(sim, np.random.default_rng(1))
    sim.run(0.001, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("fault", ["external trip"])
    sim.log_edges(1000)
    sim.run(0.05, record=False)
    sim.clear()
    sim.run(0.05, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("idle", [])
    assert len(sim.edges) == 0


def test_step_7_low_voltage_is_refused_until_it_is_allowed(sim):
    assert "*dc-link voltage too low* (0x4)" in step(7)
    sim.set("vdc_V", 0.1 * sim.setup["inverter.vdc_V"])
    sim.start()
    sim.run(0.1, record=False)
    assert sim.controller.faults == ["dc-link voltage too low"]
    sim.clear()
    low_voltage(sim, 0.1)
    sim.start()
    sim.run(0.1, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("build", [])


def test_step_8_offsets_are_measured_at_a_start(sim):
    low_voltage(sim, 0.1)
    sim.start()
    sim.run(0.1, record=False)
    assert list(sim.controller.drive.offset_counts) == pytest.approx([2048] * 6, abs=50)
    assert "2048 ± 50" in step(8)


def test_step_10_open_loop_vector(sim):
    """Direct current along 15 degrees, the shaft stands."""
    assert "along 15°" in step(10)
    low_voltage(sim, 0.1)
    sim.set("build_current_A", 1.0)
    sim.start()
    sim.run(3.0)
    assert (sim.controller.state, sim.controller.faults) == ("build", [])
    rec = sim.take()
    last = [rec[f"plant.i_{phase}_A"][-4000:].mean() for phase in PHASES]
    currents = np.array([float(i) for i in last])
    axes = np.radians([0, 30, 120, 150, 240, 270])
    size = currents @ np.cos(axes - np.radians(15)) / 3
    assert 0.2 < size < 1.1
    assert currents == pytest.approx(size * np.cos(axes - np.radians(15)), abs=0.1 * size)
    assert currents[[0, 2, 4]].sum() == pytest.approx(0, abs=1e-3)
    assert abs(sim.speed_rpm) < 0.01
    sim.stop()
    assert sim.controller.state == "idle"


def test_step_12_closed_loop_at_a_tenth_of_the_dc_link(sim):
    """Fluxed and still at zero torque; a tenth of the usual torque limit turns it forwards;
    in speed mode it comes to 100 r/min, to -100 and to standstill."""
    assert "100 ± 2 r/min" in step(12)
    assert "`torque_limit_Nm` a tenth" in step(12)
    vdc, torque_Nm = sim.setup["inverter.vdc_V"], 0.1 * sim.get("torque_limit_Nm")
    sim.set_many({"vdc_V": 0.1 * vdc, "vdc_min_V": 0.05 * vdc, "control_mode": "torque"})
    sim.set("torque_limit_Nm", torque_Nm)
    sim.start()
    sim.run(1.0, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("run", [])
    assert abs(sim.speed_rpm) < 10
    before = sim.speed_rpm
    sim.set("torque_ref_Nm", torque_Nm)
    sim.run(0.1, record=False)
    assert sim.speed_rpm > before + 10
    sim.set_many({"torque_ref_Nm": 0.0, "control_mode": "speed"})
    for speed_rpm in (100, -100, 0):
        sim.set("speed_ref_rpm", speed_rpm)
        sim.run(4.0, record=False)
        assert (sim.controller.state, sim.controller.faults) == ("run", [])
        assert sim.speed_rpm == pytest.approx(speed_rpm, abs=2)
