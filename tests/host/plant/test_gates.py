"""Suppression of short gate pulses, compared with twelve counters that check the gate signals count
by count. Nothing may delay a trip.
"""

import numpy as np
import pytest
from plant_calls import suppress_short_pulses

from hexatorque import firmware, setups
from hexatorque.drive.parts import pwm_map
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.gates import gates_record
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.pwm import pwm_record

PERIOD = 200
MAP = pwm_map(firmware.lib.ht_f28335)
STATES = np.array([LOW, OFF, HIGH])


def registers(tripped=()):
    regs = np.zeros(0x8000, np.uint16)
    for leg in range(6):
        base = MAP.epwm + leg * MAP.stride
        regs[base + MAP.tbprd] = PERIOD - 1
        regs[base + MAP.tzflg] = 4 if leg in tripped else 0
    return regs


def gate_signals(rng, periods, dead):
    """(count, leg) leg states: pulses of a few to many counts, OFF between the levels."""
    states = np.full((periods * PERIOD, 6), OFF)
    for leg in range(6):
        at, level = 0, LOW
        while at < len(states):
            length = int(rng.choice([rng.integers(1, 12), rng.integers(12, 150)]))
            states[at : at + length, leg] = level
            at += length + dead
            level = HIGH if level == LOW else LOW
    return states


def through_drivers(states, min_counts, cuts):
    """The states of the legs, count by count, with the periods cut into segments."""
    gd, regs = gates_record(min_counts), registers()
    out, now, before = np.empty_like(states), [OFF] * 6, [OFF] * 6
    for start in range(0, len(states), PERIOD):
        ps, n, done = pwm_record(), 0, 0
        for c0, c1 in zip([0, *cuts], [*cuts, PERIOD]):
            done = n
            for c in range(c0, c1):
                for leg in range(6):
                    if states[start + c, leg] != before[leg]:
                        before[leg] = states[start + c, leg]
                        ps.count[n], ps.leg[n], ps.state[n] = c, leg, before[leg]
                        n += 1
            n = suppress_short_pulses(gd, MAP, regs, ps, c0, c1, done, n)
        assert np.all(np.diff(ps.count[:n]) >= 0)
        e = 0
        for c in range(PERIOD):
            while e < n and ps.count[e] == c:
                now[ps.leg[e]] = ps.state[e]
                e += 1
            out[start + c] = now
        assert e == n
    return out


def counted(signal, min_counts):
    """One driver: the output changes after the input has differed for `min_counts`."""
    out, level, differing = np.empty_like(signal), 0, 0
    for c, wanted in enumerate(signal):
        out[c] = level
        differing = differing + 1 if wanted != level else 0
        if differing == min_counts:
            level, differing = wanted, 0
    return out


@pytest.mark.parametrize("cuts", [[], [40], [7, 120], [0, 0]])
@pytest.mark.parametrize(("min_counts", "dead"), [(5, 0), (5, 3), (5, 5), (5, 20), (11, 8)])
def test_each_driver_delays_its_edges(min_counts, dead, cuts):
    states = gate_signals(np.random.default_rng(min_counts + dead), 30, dead)
    out = through_drivers(states, min_counts, cuts)
    expected = {}
    for switch in (LOW, HIGH):
        inputs = (states == switch).astype(int)
        expected[switch] = np.array([counted(column, min_counts) for column in inputs.T]).T
        np.testing.assert_array_equal(out == switch, expected[switch] == 1)
    assert not np.any((expected[LOW] == 1) & (expected[HIGH] == 1))
    edges = [np.count_nonzero(np.diff(x, axis=0)) for x in (states, out)]
    assert 0.2 * edges[0] < edges[1] < 0.95 * edges[0]


def test_pulses_are_not_suppressed_by_default():
    states = gate_signals(np.random.default_rng(1), 5, 2)
    np.testing.assert_array_equal(through_drivers(states, 0, [40]), states)


@pytest.mark.parametrize("pending", [False, True])
def test_trip_is_immediate(pending):
    """Leg 2 is HIGH when its trip comes. Its turn-off may be pending."""
    gd, ps = gates_record(30), pwm_record()
    ps.count[0], ps.leg[0], ps.state[0] = 3, 2, HIGH
    n = suppress_short_pulses(gd, MAP, registers(), ps, 0, PERIOD, 0, 1)
    assert [(ps.count[e], ps.leg[e], ps.state[e]) for e in range(n)] == [(33, 2, HIGH)]
    if pending:
        ps.count[0], ps.leg[0], ps.state[0] = 95, 2, OFF
        assert suppress_short_pulses(gd, MAP, registers(), ps, 0, 100, 0, 1) == 0
    ps.count[0], ps.leg[0], ps.state[0] = 100, 2, OFF
    n = suppress_short_pulses(gd, MAP, registers([2]), ps, 100, PERIOD, 0, int(not pending))
    assert [(ps.count[e], ps.leg[e], ps.state[e]) for e in range(n)] == [(100, 2, OFF)]
    assert suppress_short_pulses(gd, MAP, registers([2]), ps, 0, PERIOD, 0, 0) == 0
    # No pending change takes effect after the trip is cleared.
    assert suppress_short_pulses(gd, MAP, registers(), ps, 0, PERIOD, 0, 0) == 0


@pytest.mark.parametrize("latency", ["none", "predicted"])
def test_drive_trips_at_once(latency):
    setup = setups.load("paper-b").changed(inverter__min_pulse_us=10.0, timing__latency=latency)
    sim = SimulatedDrive(setup)
    assert sim._gates.min_counts == 1000  # 100 MHz
    sim.start()
    sim.run(0.2)
    sim.check()
    assert sim.inverter.off < 6
    sim.stop()
    sim.run(sim.period_s)
    gates = sim.take()["plant.gates"][-sim.samples_per_period :]
    all_off = sum(OFF * 4**leg for leg in range(6))
    # The sample at count 0 precedes the edges of that count.
    assert np.all(gates[1:] == all_off)
