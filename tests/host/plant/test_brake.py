"""A holding brake on the shaft, from first principles."""

import numpy as np
import pytest

from hexatorque import SetupError, SimulatedDrive, firmware, load
from hexatorque.plant.pins import high

NAME = "paper-a-feasible"
HOLDS_NM = 12.0
OPEN, OUT = 0.1, firmware.lib.HT_OUT_BRAKE


def drive(**more):
    setup = load(NAME).changed({
        "load.kind": "constant", "load.holding_Nm": HOLDS_NM, "load.holding_open_s": OPEN,
        "load.holding_close_s": 0.15, "controller.scheme": "ddr",
    } | more)  # fmt: skip
    return SimulatedDrive(setup, 1)


def told_open(sim):
    return bool(int(sim.controller.channel("outputs")) & OUT)


@pytest.mark.parametrize("device", ("f28335", "f28377s"))
@pytest.mark.parametrize("of", ("brake", "relay", "chopper"))
def test_a_pin_is_high_only_as_an_output(device, of):
    """Until it is one, the board pulls it down, whatever its level register has."""
    link = {"inverter.link_F": 1e-3, "inverter.precharge_ohm": 10.0, "inverter.chopper_ohm": 40.0,
            "controller.chopper_on_V": 310.0, "controller.chopper_off_V": 300.0}  # fmt: skip
    sim = drive(**link, **{"timing.device": device})
    pin = {"brake": sim.brake.pin, "relay": sim.inverter.link.relay,
           "chopper": sim.inverter.link.chopper}[of]  # fmt: skip
    words = np.array(sim.controller.register_words())
    for level, drives in ((0, 0), (0, 1), (1, 0), (1, 1)):
        for address, bit in ((pin.level, level), (pin.drives, drives)):
            words[address] = int(words[address]) & ~(1 << int(pin.bit)) | bit << int(pin.bit)
        assert high(pin, words) == (level and drives)


def test_a_closed_brake_holds_what_it_can_and_slips_under_more():
    sim = drive()
    sim.load_Nm = 0.99 * HOLDS_NM
    sim.run(0.5, record=False)
    assert sim.plant_state[6] == 0 and sim.plant_state[7] == 0 and sim.brake.heat_J == 0
    sim.load_Nm = HOLDS_NM + 3
    sim.run(0.1, record=False)
    p = sim.machine
    # J dw/dt = 3 N m less friction: the load turns the shaft backwards.
    rate = p.viscous_Nms / p.inertia_kgm2
    expected = -(3 / p.viscous_Nms) * (1 - np.exp(-rate * 0.1))
    assert sim.plant_state[6] == pytest.approx(expected, rel=3e-3)
    sim.load_Nm = HOLDS_NM - 3
    sim.run(1.0, record=False)
    assert sim.plant_state[6] == 0 and sim.brake.held


def test_a_turning_shaft_is_stopped_at_the_rate_of_the_torque_and_its_energy_becomes_heat():
    sim = drive(**{"machine.viscous_Nms": 0.0})
    inertia, omega = sim.machine.inertia_kgm2, 40.0
    sim.run(2 * sim.period_s, record=False)
    sim.brake.held, sim.brake.closed_Nm, sim.brake.told_s = 0, 0.0, 0.0
    sim._machine.inertia, sim.plant_state[6] = inertia, omega
    sim.run(0.15 + 2 * sim.period_s, record=False)  # the pin has been low, and the delay passes
    assert sim.brake.closed_Nm == HOLDS_NM
    begin = sim.plant_state[6]
    assert begin == pytest.approx(omega, abs=0.2)
    sim.run(0.01, record=False)
    assert begin - sim.plant_state[6] == pytest.approx(0.01 * HOLDS_NM / inertia, rel=1e-6)
    sim.run(1.0, record=False)
    assert sim.plant_state[6] == 0 and sim.brake.held
    assert sim.brake.heat_J == pytest.approx(0.5 * inertia * omega**2, rel=1e-9)
    angle = sim.plant_state[7]
    sim.run(0.1, record=False)
    assert sim.plant_state[7] == angle


def test_a_load_that_hangs_neither_falls_at_the_start_nor_at_the_end():
    weight_Nm = 0.6 * load(NAME)["rated.torque_Nm"]
    sim = drive(**{"controller.brake_Nm": weight_Nm, "load.holding_Nm": 2 * weight_Nm})
    sim.load_Nm = weight_Nm
    sim.start()
    sim.set("speed_ref_rpm", 100)
    lowest, opened_s = 0.0, None
    for _ in range(1200):
        sim.run(1e-3, record=False)
        if told_open(sim) and opened_s is None:
            opened_s = sim.time_s
        if opened_s is None or sim.time_s < opened_s + OPEN - 2e-3:
            assert sim.plant_state[6] == 0  # the brake's own delay
        lowest = min(lowest, sim.speed_rpm)
    assert sim.state == "run" and lowest > -6
    assert sim.speed_rpm == pytest.approx(100, abs=8)
    sim.set("motion", "quick-stop")
    while sim.state == "run":
        sim.run(1e-3, record=False)
    sim.run(0.3, record=False)
    assert sim.plant_state[6] == 0 and sim.brake.held and not told_open(sim)


def test_without_the_order_of_the_drive_the_load_falls():
    """The drive gives up its torque before the brake has closed."""
    weight_Nm = 0.6 * load(NAME)["rated.torque_Nm"]
    sim = drive(**{
        "controller.brake_Nm": weight_Nm, "load.holding_Nm": 2 * weight_Nm,
        "load.holding_close_s": 0.3, "controller.brake_close_s": 0.01,
    })  # fmt: skip
    sim.load_Nm = weight_Nm
    sim.start()
    sim.run(1.2, record=False)
    sim.set("motion", "quick-stop")
    lowest = 0.0
    for _ in range(600):
        sim.run(1e-3, record=False)
        lowest = min(lowest, sim.speed_rpm)
    assert lowest < -100 and sim.plant_state[6] == 0


def test_what_is_recorded_changes_nothing_and_the_brake_is_on_the_recording():
    sims = []
    for record in (False, True):
        sim = drive()
        sim.load_Nm = 2.0
        sim.start()
        sim.run(0.8, record=record)
        sims.append(sim)
    assert np.array_equal(sims[0].plant_state, sims[1].plant_state)
    brake = sims[1].take()["plant.brake_Nm"]
    assert brake[0] == HOLDS_NM and brake[-1] == 0 and set(np.unique(brake)) == {0, HOLDS_NM}


def test_mistakes_about_the_brake_are_told_in_one_line():
    cases = (
        ({"controller.brake_open_s": 0.0}, "load.holding_Nm needs controller.brake_open_s above 0"),
        ({"load.holding_Nm": 1e-6}, "load.holding_Nm = 1e-06: allowed is 0 (none) or 0.001 N m"),
        ({"load.holding_open_s": -1.0}, "0 .. 10 s"),
    )
    for changes, told in cases:
        with pytest.raises(SetupError) as refused:
            drive(**changes)
        (line,) = str(refused.value).splitlines()
        assert told in line
