"""A start whose speed reference the drive could never reach without a trip is refused before it. A
refused start changes nothing."""

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.cli.board.connection import start_drive
from hexatorque.cli.options import Mistake
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import HexatorqueError
from hexatorque.firmware import State


class Drive(SimulatedDrive):
    """A board's drive without a line to it. It keeps what was written."""

    def __init__(self):
        super().__init__(setups.load("small-2kw"), 1)
        self.written = []

    def get_many(self, names):
        return {name: self.get(name) for name in names}

    def set_many(self, values):
        self.written.append(dict(values))
        super().set_many(values)


@pytest.fixture
def drive():
    return Drive()


def values_of(drive):
    return {name: drive.get(name) for name in drive.params}


@pytest.mark.parametrize("speed", (1.0, -1.0))
@pytest.mark.parametrize("text", (False, True))
def test_a_speed_at_the_trip_is_refused(drive, speed, text):
    trip_rpm, before = drive.get("speed_trip_rpm"), values_of(drive)
    asked = {"speed_ref_rpm": f"{speed * trip_rpm:.9g}" if text else speed * trip_rpm}
    with pytest.raises(Mistake, match=r"^speed_ref_rpm = .* would trip at speed_trip_rpm = "):
        start_drive(drive, {**asked, "kp_speed_Nms_rad": 0.3})
    assert drive.state == "idle" and values_of(drive) == before
    assert not drive.written
    start_drive(drive, {"speed_ref_rpm": speed * 0.9 * trip_rpm})
    assert drive.state != "idle"


def test_the_trip_that_is_set_with_it_counts(drive):
    asked = {"speed_ref_rpm": 1000.0, "speed_trip_rpm": 900.0}
    with pytest.raises(Mistake, match=r"^speed_ref_rpm = 1000 .* speed_trip_rpm = 900 r/min$"):
        start_drive(drive, asked)


@pytest.mark.parametrize("mode", ({"control_mode": "torque"}, {"start_mode": "test"}))
def test_without_a_speed_loop_its_reference_says_nothing(drive, mode):
    start_drive(drive, {**mode, "speed_ref_rpm": drive.get("speed_trip_rpm")})
    assert drive.state != "idle"


def test_what_the_drive_refuses_changes_nothing(drive):
    """The shaft turns, so the drive refuses to start; and it refuses a value that it does not
    allow."""
    before = values_of(drive)
    with pytest.raises(HexatorqueError, match="speed_ref_rpm"):
        start_drive(drive, {"kp_speed_Nms_rad": 0.3, "speed_ref_rpm": 1e9})
    assert values_of(drive) == before
    drive.plant_state[6] = 2 * np.pi * 20
    drive.run(0.05)
    with pytest.raises(HexatorqueError, match="turn"):
        start_drive(drive, {"speed_ref_rpm": 300.0, "scheme": "ddr"})
    assert drive.state == "idle" and values_of(drive) == before


class OldBoard(Drive):
    """A board that lists its states by their names alone, so each of them counts as at work. Under
    the key "state" is the name in which a start arrived."""

    @property
    def condition(self):
        return State(super().condition.name)

    def start(self):
        self.written.append({"state": self.state})
        super().start()


def test_a_board_without_a_table_of_states_starts_with_the_values_that_were_asked_for():
    drive, asked = OldBoard(), {"speed_ref_rpm": 300.0}
    start_drive(drive, asked)
    assert drive.written == [asked, {"state": "idle"}]
    drive.run(0.01)
    with pytest.raises(HexatorqueError):
        start_drive(drive, {"speed_ref_rpm": 400.0})
    assert drive.get("speed_ref_rpm") == 300


def test_a_drive_at_work_keeps_its_reference_all_the_time(drive):
    start_drive(drive, {"speed_ref_rpm": 300.0})
    drive.run(0.01)
    drive.written.clear()
    with pytest.raises(HexatorqueError):
        start_drive(drive, {"speed_ref_rpm": 400.0})
    assert drive.get("speed_ref_rpm") == 300 and not drive.written
