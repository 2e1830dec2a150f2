"""The virtual board's plant keeps the time that the firmware's timers are set to."""

import pytest

from hexatorque import setups
from hexatorque.boards.virtual import VirtualBoard


@pytest.mark.parametrize("name", ["paper-a-feasible", "paper-b"])
def test_another_rate_of_the_interrupts(name):
    board = VirtualBoard(setups.load(name))
    controller, sim = board.controller, board.sim
    board.run(0.1)
    ticks = controller.drive.tick
    f_Hz, slow_Hz = controller.get("f_isr_Hz"), controller.get("f_slow_Hz")
    assert ticks == round(0.1 * f_Hz)
    controller.set("f_isr_Hz", f_Hz / 2)
    board.run(0.1)
    assert controller.drive.tick - ticks == round(0.1 * f_Hz / 2)
    assert sim.time_s == pytest.approx(0.2)
    controller.set("f_slow_Hz", slow_Hz / 2)
    # The firmware holds true speed and torque only if its periods are the plant's.
    controller.set("speed_ref_rpm", 400.0)
    controller.start()
    board.run(2.0, record=True)
    assert (controller.state, controller.faults) == ("run", [])
    assert sim.speed_rpm == pytest.approx(400.0, abs=4.0)
    recording = board.take()
    assert recording.start_s == pytest.approx(0.2)
    assert recording.duration_s == pytest.approx(2.0)
    last = recording.window(2.0, 2.2)
    at = slice(None, None, sim.samples_per_period)  # where the firmware samples
    estimated, true = last["psi_alpha_Wb"][at], last["plant.psi_alpha_Wb"][at]
    assert abs(estimated - true).max() < 0.03 * abs(true).max()
