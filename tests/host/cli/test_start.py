"""A start whose speed reference the drive could never reach without a trip is refused before it."""

import pytest

from hexatorque import firmware, setups
from hexatorque.cli.board.connection import start_drive
from hexatorque.cli.options import Mistake


class Drive(firmware.Controller):
    """A board's drive without a line to it."""

    def __init__(self):
        setup = setups.load("small-2kw")
        super().__init__(setup["timing.device"], setups.parameters(setup))
        self.params = self.parameters

    def get_many(self, names):
        return {name: self.get(name) for name in names}


@pytest.fixture
def drive():
    return Drive()


@pytest.mark.parametrize("speed", (1.0, -1.0))
def test_a_speed_at_the_trip_is_refused(drive, speed):
    trip_rpm = drive.get("speed_trip_rpm")
    with pytest.raises(Mistake, match=r"^speed_ref_rpm = .* would trip at speed_trip_rpm = "):
        start_drive(drive, {"speed_ref_rpm": speed * trip_rpm})
    assert drive.state == "idle"
    start_drive(drive, {"speed_ref_rpm": speed * 0.9 * trip_rpm})
    assert drive.state != "idle"


@pytest.mark.parametrize("mode", ({"control_mode": "torque"}, {"start_mode": "test"}))
def test_without_a_speed_loop_its_reference_says_nothing(drive, mode):
    start_drive(drive, {**mode, "speed_ref_rpm": drive.get("speed_trip_rpm")})
    assert drive.state != "idle"
