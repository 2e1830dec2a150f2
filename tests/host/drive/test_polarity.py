"""Gate drivers that invert: the drive behaves the same, with inverted pins."""

from functools import partial

import numpy as np

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive


def run(active_low):
    controller = partial(firmware.Controller, active_low=active_low)
    sim = SimulatedDrive(setups.load("paper-b"), 1, controller)
    sim.log_edges(100_000)
    sim.start()
    sim.set("speed_ref_rpm", 300)
    sim.run(0.4)
    sim.stop()
    sim.run(0.01)
    return sim


def test_both_polarities_switch_alike_and_never_both_switches():
    usual, inverted = run(False), run(True)
    assert len(usual.edges) > 1000
    np.testing.assert_array_equal(usual.edges, inverted.edges)
    for sim, dead_band, trip in ((usual, 0x000B, 0x022A), (inverted, 0x0007, 0x0115)):
        m, words = sim.controller.map, sim.controller.register_words()
        assert (words[m.epwm + m.dbctl], words[m.epwm + m.tzctl]) == (dead_band, trip)
        assert sim.shorts == 0
        assert sim.controller.registers.violations == 0


def test_registers_for_the_other_drivers_are_both_switches_on():
    """The simulation of a board whose table has the wrong polarity."""
    controller = partial(firmware.Controller, active_low=False)
    sim = SimulatedDrive(setups.load("paper-b"), 1, controller)
    sim._map.active_low = 1
    sim.run(0.001)  # tripped: both outputs low, which these drivers take as on
    assert sim.shorts > 0
