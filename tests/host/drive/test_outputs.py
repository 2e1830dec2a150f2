"""Brake, precharge and fan of a running drive, with a load that hangs."""

import numpy as np
import pytest
from same_bits import same_bits

from hexatorque import SimulatedDrive, firmware, load
from hexatorque.errors import InputError
from hexatorque.plant.link import CHOPPER_J

NAME = "paper-a-feasible"
OPEN_S, CLOSE_S = 0.1, 0.15
BRAKE = firmware.lib.HT_OUT_BRAKE
SHARE = 0.6  # of rated torque hangs on the shaft
WORK_MS = 1e-3


class Hoist:
    """A drive whose shaft a brake holds. It opens in OPEN_S and closes in CLOSE_S."""

    def __init__(self, **changes):
        setup = load(NAME)
        self.load_Nm = SHARE * setup["rated.torque_Nm"]
        brake = {
            "brake_open_s": OPEN_S, "brake_close_s": CLOSE_S, "brake_Nm": self.load_Nm,
        } | changes  # fmt: skip
        paths = {f"controller.{key}": value for key, value in brake.items()}
        self.sim = SimulatedDrive(
            setup.changed({"controller.scheme": "ddr", "load.kind": "constant", **paths}), 1
        )
        self.sim.load_Nm = self.load_Nm
        self.moved_for = 0.0  # how far the brake has opened, s
        self.held, self.lowest_rpm, self.highest_rpm = True, 0.0, 0.0

    @property
    def told_open(self):
        return bool(int(self.sim.controller.channel("outputs")) & BRAKE)

    def run(self, seconds):
        for _ in range(round(seconds / WORK_MS)):
            if self.held:
                self.sim.plant_state[6] = 0.0
            self.sim.run(WORK_MS, record=False)
            rate = 1 / OPEN_S if self.told_open else -1 / CLOSE_S
            self.moved_for = min(max(self.moved_for + rate * WORK_MS, 0.0), 1.0)
            # Friction gives way when the brake is half open.
            self.held = self.moved_for < 0.5
            rpm = 0.0 if self.held else self.sim.plant_state[6] * 30 / np.pi
            self.lowest_rpm = min(self.lowest_rpm, rpm)
            self.highest_rpm = max(self.highest_rpm, rpm)


def started(**changes):
    hoist = Hoist(**changes)
    hoist.sim.set("speed_ref_rpm", 100)
    hoist.sim.start()
    hoist.run(0.36)
    while hoist.sim.state == "build":
        hoist.run(0.01)
    return hoist


def test_a_hanging_load_neither_falls_nor_jumps():
    hoist = started()
    assert not hoist.told_open, "there is flux, and no torque yet"
    hoist.run(0.02)
    assert int(hoist.sim.controller.channel("limits")) & firmware.lib.HT_LIMIT_BRAKE
    hoist.run(0.6)
    assert hoist.sim.state == "run" and hoist.told_open and not hoist.held
    assert hoist.lowest_rpm > -6, hoist.lowest_rpm
    assert abs(hoist.sim.controller.channel("speed_rpm") - 100) < 8
    assert not int(hoist.sim.controller.channel("limits")) & firmware.lib.HT_LIMIT_BRAKE
    # Stop: the shaft stands, the brake closes, and only then does the torque go.
    hoist.sim.set("motion", "quick-stop")
    while hoist.told_open:
        hoist.run(0.002)
    hoist.lowest_rpm = hoist.highest_rpm = 0.0
    hoist.run(0.8 * CLOSE_S)
    assert hoist.sim.state == "run" and hoist.held, "held by both"
    hoist.run(0.4 * CLOSE_S)
    assert hoist.sim.state == "idle"
    hoist.run(0.2)
    # It did not fall, and what it still turned as the brake began to close is a shaft that stands.
    assert hoist.lowest_rpm > -12
    assert hoist.highest_rpm < hoist.sim.get("start_max_rpm")


def test_what_the_torque_before_the_release_is_for():
    """Without it the load falls until the regulator has found its torque."""
    assert started(brake_Nm=0.0).sim.state == "run"
    fell = started(brake_Nm=0.0)
    fell.run(0.4)
    assert fell.lowest_rpm < -15, fell.lowest_rpm


@pytest.mark.parametrize("before", ("the torque is there", "the brake is open"))
def test_a_stop_that_comes_before_the_load_is_held_ends_with_the_gates_off(before):
    """While torque is built, or the brake opens, `motion` = stop is obeyed as well: the drive had
    held its torque against the closed brake without an end."""
    hoist = started()
    if before == "the brake is open":
        while not hoist.told_open:
            hoist.run(0.002)
    hoist.sim.set("motion", "stop")
    hoist.run(0.05)
    assert not hoist.told_open
    hoist.run(CLOSE_S)
    assert hoist.sim.state == "idle" and hoist.held
    assert hoist.lowest_rpm > -12


@pytest.mark.parametrize("end", ("trip", "stop"))
def test_what_takes_the_gates_off_closes_the_brake_at_once(end):
    hoist = started()
    hoist.run(0.5)
    assert hoist.told_open
    sim = hoist.sim
    hoist.run(0.004)  # the slow interrupt has just been
    drive = sim.controller.drive
    assert 10 < drive.tick - drive.tick_last < 90
    gpio = sim.controller.port.board.output[1].gpio
    words = sim.controller.register_words()

    def level():
        address = 0x6FC0 if sim.setup["timing.device"] == "f28335" else 0x7F00
        address += gpio // 32 * 8
        return (int(words[address]) | int(words[address + 1]) << 16) >> gpio % 32 & 1

    assert level() == 1
    if end == "trip":
        sim.controller.set_trip_pin(0)
        sim.run(2 * sim.period_s, record=False)  # no slow interrupt in between
        assert sim.state == "fault"
    else:
        sim.stop()
    assert level() == 0 and not hoist.told_open
    sim.run(0.1, record=False)
    assert level() == 0


def test_in_torque_mode_the_brake_opens_as_well_and_a_reference_waits_for_it():
    hoist = started(control_mode="torque", torque_ref_Nm=0.0)
    hoist.run(0.02)
    assert abs(hoist.sim.controller.channel("torque_ref_Nm") - hoist.load_Nm) < 1e-3
    hoist.run(0.08)
    assert hoist.told_open
    hoist.sim.set("torque_ref_Nm", hoist.load_Nm)
    hoist.run(0.3)
    assert hoist.sim.controller.channel("torque_ref_Nm") == pytest.approx(hoist.load_Nm)
    assert abs(hoist.sim.controller.channel("speed_rpm")) < 12


def test_a_link_that_is_not_charged_refuses_the_start_and_one_that_is_does_not():
    setup = load(NAME)
    volts = setup["inverter.vdc_V"]
    sim = SimulatedDrive(setup.changed({"controller.precharge_V": 0.8 * volts}))
    sim.set("vdc_V", 0.5 * volts)
    sim.run(0.5, record=False)
    with pytest.raises(InputError, match="not charged"):
        sim.start()
    sim.set("vdc_V", volts)
    sim.run(0.25, record=False)
    assert sim.controller.channel("outputs") == firmware.lib.HT_OUT_PRECHARGE
    sim.start()
    sim.run(0.5, record=False)
    assert sim.state == "run"


def test_the_fan_runs_while_the_drive_works_and_for_a_while_after():
    sim = SimulatedDrive(load(NAME).changed({"controller.fan_s": 0.2}))
    fan = firmware.lib.HT_OUT_FAN
    sim.run(0.05, record=False)
    assert sim.controller.channel("outputs") == 0
    sim.start()
    sim.run(0.5, record=False)
    assert sim.controller.channel("outputs") == fan
    sim.stop()
    sim.run(0.15, record=False)
    assert sim.controller.channel("outputs") == fan
    sim.run(0.1, record=False)
    assert sim.controller.channel("outputs") == 0


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
def test_a_drive_without_outputs_has_the_bits_of_one_whose_fan_runs(scheme):
    base = load(NAME).changed({"controller.scheme": scheme, "timing.latency": "predicted"})
    assert same_bits(base, {"controller.fan_s": 1.0})


#: A bench's capacitor, and a resistor that takes more than the machine brakes with.
LINK = {"inverter.link_F": 1e-3, "inverter.source_ohm": 0.3, "inverter.chopper_ohm": 40.0}
ON_V, OFF_V = 310.0, 295.0
CHOPPER = {"controller.chopper_on_V": ON_V, "controller.chopper_off_V": OFF_V}


def braked(**changes):
    """The drive, and each millisecond from 90 % speed to a standstill: voltage, chopper."""
    sim = SimulatedDrive(load(NAME).changed({**LINK, "controller.scheme": "ddr", **changes}), 1)
    sim.start()
    sim.set("speed_ref_rpm", 1215)
    sim.run(1.5, record=False)
    sim.set("speed_ref_rpm", 0)
    volts, chopped = [], []
    for _ in range(1500):
        sim.run(1e-3, record=False)
        volts.append(sim.link_V)
        chopped.append(int(sim.controller.channel("outputs")) & firmware.lib.HT_OUT_CHOPPER != 0)
    return sim, np.array(volts), np.array(chopped)


@pytest.mark.parametrize("device", ("f28335", "f28377s"))
def test_the_chopper_takes_what_the_drive_brakes_with(device):
    """Between its levels, but for what a period charges: 3 kW into 1 mF are 1 V."""
    sim, volts, chopped = braked(**CHOPPER, **{"timing.device": device})
    assert (sim.state, sim.faults) == ("run", []) and abs(sim.speed_rpm) < 15
    assert ON_V - 1 < volts.max() < ON_V + 1.5
    assert np.sum(np.diff(chopped.astype(int)) > 0) > 2 and not chopped[-1]
    assert volts[chopped].min() > OFF_V - 1.5
    shaft_J = 0.5 * sim.setup["machine.inertia_kgm2"] * (1215 * np.pi / 30) ** 2
    assert 0.3 * shaft_J < sim.inverter.link.x[CHOPPER_J] < shaft_J
    assert sim.controller.registers.violations == 0


def test_without_the_output_the_same_braking_trips():
    sim, volts, _ = braked(**{"inverter.chopper_ohm": 0.0})
    assert sim.faults == ["dc-link voltage too high"] and volts.max() > 345


def test_an_over_voltage_is_discharged_with_the_gates_off_but_not_while_the_trip_pin_is_low():
    base = load(NAME).changed({**LINK, **CHOPPER})
    for pin, lowest_V, highest_V in ((1, OFF_V - 1.5, OFF_V), (0, 359.0, 361.0)):
        sim = SimulatedDrive(base, 1)
        sim.run(0.01, record=False)
        sim.controller.set_trip_pin(pin)
        sim.inverter.link.x[0] = 360.0
        sim.run(0.1, record=False)
        assert sim.controller.channel("outputs") == 0
        assert lowest_V <= sim.link_V <= highest_V, sim.link_V


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({**LINK, "controller.chopper_on_V": 300.0, "controller.chopper_off_V": 249.0},
         "controller.chopper_off_V = 249: allowed is more than 250 V, the source's voltage"),
        ({"controller.chopper_on_V": 345.0, "controller.chopper_off_V": 330.0},
         "chopper_on_V = 345 V: allowed is up to 0.97 vdc_max_V"),
        (LINK, "inverter.chopper_on_V = 0: the drive's output switches the chopper, so"),
        ({**LINK, **CHOPPER, "inverter.link_F": 0.0}, "inverter.chopper_ohm needs inverter.link_F"),
    ],
)  # fmt: skip
def test_a_chopper_that_cannot_work_is_refused_with_one_line(changes, line):
    with pytest.raises(InputError) as error:
        load(NAME).changed(changes)
    assert line in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
def test_a_chopper_that_has_nothing_to_do_leaves_the_drives_bits(scheme):
    base = load(NAME).changed({"controller.scheme": scheme, "timing.latency": "predicted"})
    assert same_bits(base, CHOPPER)
