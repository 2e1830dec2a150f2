"""The compiled loop does what a drive must do: a trip from outside the interrupt reaches the
inverter, wherever in the period the controller samples and writes.
"""

import itertools

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.legs import OFF


@pytest.mark.parametrize("sample_delay_us", [0.0, 3.0])
@pytest.mark.parametrize("latency", ["none", "immediate", "predicted"])
def test_stop_turns_the_legs_off(sample_delay_us, latency):
    setup = setups.load("paper-b").changed(
        sensors__sample_delay_us=sample_delay_us, timing__latency=latency
    )
    sim = SimulatedDrive(setup)
    sim.start()
    sim.run(0.2)
    assert sim.inverter.off == 0 and np.ptp(sim._machine.i_phase @ sim.plant_state[:6]) > 1
    sim.stop()
    sim.run(0.01)
    assert np.all(sim.inverter.leg == OFF) and sim.inverter.off == 6
    np.testing.assert_allclose(sim._machine.i_phase @ sim.plant_state[:6], 0, atol=1e-3)


@pytest.mark.parametrize("sample_delay_us", [0.0, 3.0])
def test_recording_changes_nothing(sample_delay_us):
    """A run has the same bits from start to trip, whether it is recorded or not, and at any rate.
    The values that are recorded at an instant do not depend on the other instants either."""
    states, edges, samples = [], [], {}
    for per in (0, 1, 4, 5, 20):
        setup = setups.load("paper-a-feasible").changed(sensors__sample_delay_us=sample_delay_us)
        sim = SimulatedDrive(setup, per or 4)
        sim.log_edges(50_000)
        sim.start()
        sim.set("speed_ref_rpm", 400.0)
        sim.run(0.5, record=per > 0)
        at_speed = sim.speed_rpm
        sim.stop()
        sim.run(0.003, record=per > 0)
        states.append(sim.plant_state.copy())
        edges.append(sim.edges)
        if per:
            rec = sim.take()
            samples[per] = {n: rec[n].reshape(-1, per) for n in rec.channels if "plant" in n}
    assert at_speed > 50 and len(edges[0]) > 5000
    for other in range(1, 5):
        assert np.array_equal(states[0], states[other])
        assert np.array_equal(edges[0], edges[other])
    for name, dense in samples[20].items():
        for per in (1, 4, 5):
            assert np.array_equal(dense[:, :: 20 // per], samples[per][name]), name


@pytest.mark.parametrize(
    ("name", "scheme", "sample_delay_us"),
    (("paper-b", "dtc3", 0.0), ("paper-a-feasible", "foc", 5.0)),
)
def test_edges_are_the_gates_that_are_recorded(name, scheme, sample_delay_us):
    """The legs are rebuilt from the log at every recorded instant. With a late sample, the period's
    first edges come before it, and the others after it."""
    setup = setups.load(name).changed(
        controller__scheme=scheme, sensors__sample_delay_us=sample_delay_us
    )
    sim = SimulatedDrive(setup, 20)
    sim.log_edges(50_000)
    sim.start()
    sim.set("speed_ref_rpm", 800.0)
    sim.run(0.6)
    period = int(sim._timing.period)
    legs = np.full(6, OFF)
    edges = sim.edges.tolist()
    assert len(edges) > 1000 and all(a[0] <= b[0] for a, b in itertools.pairwise(edges))
    e = 0
    for sample, gates in enumerate(sim.take()["plant.gates"]):
        # Changes at the instant itself come after the sample.
        while e < len(edges) and edges[e][0] < sample * period // 20:
            legs[edges[e][1]] = edges[e][2]
            e += 1
        assert int(gates) == int("".join(map(str, legs)), 4)


def test_full_log_of_edges_is_an_error():
    sim = SimulatedDrive(setups.load("paper-b"))
    sim.log_edges(100)
    sim.start()
    with pytest.raises(IndexError, match="log of gate edges is full"):
        sim.run(0.5)
