"""The compiled loop against what a drive must do: a trip from outside the interrupt
reaches the inverter, wherever in the period the controller samples and writes.
"""

import numpy as np
import pytest

from hexatorque import scenario
from hexatorque.plant.inverter import OFF
from hexatorque.sil import Simulation


@pytest.mark.parametrize("sample_delay_us", [0.0, 3.0])
@pytest.mark.parametrize("latency", ["none", "immediate", "predicted"])
def test_stop_turns_the_legs_off(sample_delay_us, latency):
    setup = scenario.load("paper-b").changed(
        sensors__sample_delay_us=sample_delay_us, timing__latency=latency
    )
    sim = Simulation(setup)
    sim.start()
    sim.run(0.2)
    assert sim.inverter.off == 0 and np.ptp(sim._machine.i_phase @ sim.state[:6]) > 1
    sim.stop()
    sim.run(0.01)
    assert np.all(sim.inverter.leg == OFF) and sim.inverter.off == 6
    np.testing.assert_allclose(sim._machine.i_phase @ sim.state[:6], 0, atol=1e-3)
