"""The first power-up of docs/flash.md, where the simulation can follow it: a board
whose gates switch before there is a dc link, one with a tenth of its voltage.
"""

import numpy as np
import pytest

from hexatorque import scenario
from hexatorque.frames import PHASES
from hexatorque.plant.inverter import HIGH, LOW
from hexatorque.sil import Simulation


@pytest.fixture(params=("paper-a-feasible", "paper-b"))
def sim(request):
    return Simulation(scenario.load(request.param))


def low_voltage(sim, share):
    """A bench supply at this share of the rating, and a firmware that accepts it."""
    vdc = sim.setup["inverter.vdc_V"]
    sim.set("vdc_V", share * vdc)
    sim.set("build_s", 10.0)
    sim.set("vdc_min_V", 0.5 * share * vdc)


def test_gates_switch_without_a_dc_link(sim):
    """Step 2: w1 and v2 do, for as long as the build-up lasts, u1 and u2 are high, w2 and
    v1 low; no fault."""
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


def test_low_voltage_is_refused_until_it_is_allowed(sim):
    """Step 3."""
    sim.set("vdc_V", 0.1 * sim.setup["inverter.vdc_V"])
    sim.start()
    sim.run(0.1, record=False)
    assert sim.controller.faults == ["dc-link voltage too low"]
    sim.clear()
    low_voltage(sim, 0.1)
    sim.start()
    sim.run(0.1, record=False)
    assert (sim.controller.state, sim.controller.faults) == ("build", [])


def test_open_loop_vector(sim):
    """Step 6: direct current along 15 degrees, the shaft stands."""
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
