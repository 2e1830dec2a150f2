"""Speed as the drive measures it, from encoder edges to telemetry: emulated counter and
capture unit, driver, slow interrupt. The shaft turns as the test says.

Both methods give a mean of the speed over some recent time: edges per time over the slow
period, known to a count; time per edge over one unit interval (four counts), known to a
tick. So a reading lies within the speeds of the recent past, a count wider on either
side; "recent" is the slow period and the time of the last eight counts.
"""

import numpy as np
import pytest
from numba import njit

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import lib
from hexatorque.plant.sensors import sample

COUNTS_REV, SLOW_HZ, PERIOD_S, EVERY = 8192, 100, 1e-4, 100
COUNT = 60 * SLOW_HZ / COUNTS_REV  # r/min of one count in a slow period
CLOCK_HZ = {"f28335": 150e6 / 128, "f28377s": 200e6 / 128}
SWITCH = 150.0


@njit
def turn(sensors, machine, y, regs, thetas):
    for theta in thetas:
        y[7] = theta
        sample(sensors, machine, y, 250.0, regs)


class Shaft:
    """A drive at standstill whose encoder the test turns."""

    def __init__(self, device="f28335", switch=SWITCH, **sensors):
        setup = setups.load("paper-a").changed(
            timing__device=device, controller__speed_period_rpm=switch,
            **{f"sensors__{k}": v for k, v in sensors.items()},
        )  # fmt: skip
        assert setup["sensors.encoder_ppr"] * 4 == COUNTS_REV
        self.sim = SimulatedDrive(setup)

    def follow(self, counts):
        """`counts`: position at every sampling instant from 0.1 ms on. Returns the reading
        at every slow interrupt."""
        sim, readings = self.sim, []
        thetas = np.asarray(counts) / COUNTS_REV * 2 * np.pi
        for chunk in thetas.reshape(-1, EVERY):
            turn(sim.sensors, sim._machine, sim.plant_state, sim._registers, chunk)
            lib.ht_drive_fast_isr(sim.controller.drive)
            lib.ht_drive_slow_isr(sim.controller.drive)
            readings.append(sim.controller.drive.speed_rpm)
        assert sim.controller.registers.violations == 0
        return np.array(readings)


def instants(duration_s):
    return np.arange(1, round(duration_s / PERIOD_S) + 1) * PERIOD_S


def per_second(rpm):
    return rpm / 60 * COUNTS_REV


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("rpm", [0.1, 0.3, 0.6, 1, 3.3, 10, 30, 99, 149, 160, 180, 200, 1111, 6000])
@pytest.mark.parametrize("device", CLOCK_HZ)
def test_constant_speed(device, rpm, sign):
    """Resolution of each method; in between, of the worse one. Below the timer's range
    single readings are multiples of a count, and their mean is right."""
    duration_s = 2.0 if rpm < 1 else 0.4
    readings = Shaft(device).follow(sign * per_second(rpm) * instants(duration_s) + 0.3)
    unit_ticks = 4 / per_second(rpm) * CLOCK_HZ[device]
    settled = readings[1 + int(3 * SLOW_HZ * 4 / per_second(rpm)) :]  # two whole intervals
    counted, timed = COUNT, rpm / (unit_ticks - 1)
    if unit_ticks > 65535:
        tolerance = counted
        steps = readings / COUNT
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-5)
        assert readings.mean() == pytest.approx(sign * rpm, abs=COUNT / len(readings) * 1.01)
    elif rpm < SWITCH - counted:
        tolerance = timed
    elif rpm < 1.25 * SWITCH + counted:
        tolerance = max(timed, counted)
    else:
        tolerance = counted
    assert len(settled) > 15 or unit_ticks > 65535
    assert np.abs(settled - sign * rpm).max() <= tolerance * 1.001 + 1e-5 * rpm


def recent_speeds(t, counts, rpm):
    """Lowest and highest speed within the recent past of every slow interrupt."""
    way = np.concatenate([[0], np.cumsum(np.abs(np.diff(counts)))])
    bounds = []
    for end in range(EVERY - 1, len(t), EVERY):
        begin = np.searchsorted(way, way[end] - 8)
        begin = max(0, min(begin, end - EVERY) - 1)
        bounds.append((rpm[begin : end + 1].min(), rpm[begin : end + 1].max()))
    return np.array(bounds).T


def reversal(t):
    return 40 * np.cos(2 * np.pi * t / 1.3)


def crawl(t):
    return 2.5 * np.cos(2 * np.pi * t / 1.7)


def launch(t):
    return np.minimum(600.0, np.maximum(0.0, t - 0.2) * 1500)


def stop(t):
    return np.where(t < 0.5, 20.0, 0.0)


def hard_stop(t):
    return np.where(t < 0.5, -300.0, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("profile", [reversal, crawl, launch, stop, hard_stop])
@pytest.mark.parametrize("device", CLOCK_HZ)
def test_changing_speed(device, profile, sign):
    t = instants(2.0)
    rpm = sign * profile(t)
    counts = np.cumsum(per_second(rpm)) * PERIOD_S + 0.4
    readings = Shaft(device).follow(counts)
    low, high = recent_speeds(t, counts, rpm)
    assert np.all(readings >= low - COUNT * 1.001)
    assert np.all(readings <= high + COUNT * 1.001)
    # Where a slow period has one direction and several counts, so has the reading.
    moved = np.diff(np.floor(counts[EVERY - 1 :: EVERY]), prepend=0)
    clear = (np.abs(moved) >= 2) & (low * high > 0)
    assert clear.sum() > 15
    assert np.all(np.sign(readings[clear]) == np.sign(moved[clear]))


@pytest.mark.parametrize("profile", [stop, hard_stop])
def test_reading_is_exactly_zero_after_a_stop(profile):
    """A timer's range (56 ms) and two looks after the last edge at the latest."""
    t = instants(1.0)
    readings = Shaft().follow(np.cumsum(per_second(profile(t))) * PERIOD_S + 0.4)
    assert np.all(readings[50 + 8 :] == 0)


@pytest.mark.parametrize("amplitude", [0.3, 0.9, 3.7])
def test_vibration_at_an_edge(amplitude):
    """A shaft that stands on an edge and trembles: no reading beyond what moved."""
    rng = np.random.default_rng(3)
    counts = 100 + amplitude * rng.uniform(-1, 1, 20000)
    shaft = Shaft()
    shaft.follow(np.linspace(0, 100, 1000))
    readings = shaft.follow(counts)
    shown = np.floor(np.concatenate([[100.0], counts[EVERY - 1 :: EVERY]]))
    np.testing.assert_allclose(readings[1:], np.diff(shown)[1:] * COUNT, atol=1e-4)
    assert np.ptp(readings) > 0


def test_unequal_edges_cancel():
    """Channel B 0.05 cycles off: an edge interval is up to 20 % of a cycle off, a whole
    cycle is exact. At 30 r/min that would be 6 r/min and more; one tick is 0.03 r/min."""
    counts = per_second(30) * instants(0.5) + 0.3
    readings = Shaft(encoder_error_cycles=0.05).follow(counts)
    assert np.abs(readings[5:] - 30).max() < 0.03


def test_without_the_switch_over_speed_is_the_position_difference():
    counts = per_second(30) * instants(0.3) + 0.3
    readings = Shaft(switch=0.0).follow(counts)
    moved = np.diff(np.floor(counts[EVERY - 1 :: EVERY]), prepend=0)
    np.testing.assert_allclose(readings, moved * COUNT, rtol=1e-6)
