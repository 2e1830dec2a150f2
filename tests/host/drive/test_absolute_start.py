"""A start whose angle an absolute encoder tells: from every position, checked before torque, and
ended where its readings and the counts part.
"""

import numpy as np
import pytest
from waiting import started

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import CALIBRATE, FAULT, RUN, lib
from hexatorque.plant.vsd import PHASES
from hexatorque.plant.wires import ABSOLUTE_FAULTS

START_DEG, POLE_PAIRS, READINGS = 100.0, 5, 1000
ABSENT, ANGLE = "absolute encoder", "encoder against flux speed"


def resting(at_deg=30.0, wrong_deg=0.0, readings=READINGS, **more):
    """at_deg: how far the shaft turns to reading 0."""
    setup = setups.load("magnet-surface")
    assert setup["machine.pole_pairs"] == POLE_PAIRS
    zero_deg = START_DEG + at_deg * POLE_PAIRS + wrong_deg
    changes = {
        "machine__start_deg": START_DEG,
        "sensors__absolute_counts_rev": readings,
        "sensors__absolute_deg": at_deg,
        "controller__rotor_start": "absolute",
        "controller__rotor_zero_deg": (zero_deg + 180) % 360 - 180,
    }
    return SimulatedDrive(setup.with_scheme("ddr", **(changes | more)), 4)


def held(drive, seconds, rpm=0.0):
    for _ in range(round(seconds / 1e-3)):
        drive.plant_state[6] = rpm * np.pi / 30
        drive.run(1e-3, record=False)
    return drive


def moved_deg(drive):
    return np.degrees(drive.plant_state[7])


def angle_error_deg(drive):
    true = START_DEG + POLE_PAIRS * moved_deg(drive)
    believed = 360 * drive.controller.drive.rotor.electrical / drive.get("encoder_counts_rev")
    return (true - believed + 180) % 360 - 180


def until_fault(drive, rpm=300.0, most_s=1.0):
    """Runs, if it does, towards a speed. Returns how far the shaft has turned since the start."""
    before = moved_deg(drive)
    started(drive)
    if drive.state == RUN:
        drive.set("speed_ref_rpm", rpm)
    end_s = drive.time_s + most_s
    while drive.state == RUN and drive.time_s < end_s:
        drive.run(1e-3, record=False)
    assert drive.state == FAULT
    return abs(moved_deg(drive) - before)


#: 12 positions, a twelfth of an electrical turn apart, and a part of a revolution.
POSITIONS = [30.0 / POLE_PAIRS * k + 72.0 * (k % 5) + 1.7 for k in range(12)]


@pytest.mark.parametrize("direction", ["same", "reversed"])
@pytest.mark.parametrize("at_deg", POSITIONS)
def test_the_reading_tells_the_angle(at_deg, direction):
    drive = started(resting(at_deg - 360 if at_deg > 360 else at_deg,
                            sensors__absolute_direction=direction))  # fmt: skip
    assert drive.state == RUN
    # Half a reading; a count of the zero and one of the angle.
    step_deg = 360 * POLE_PAIRS
    assert abs(angle_error_deg(drive)) <= step_deg / READINGS / 2 + 2 * step_deg / 8192


@pytest.mark.parametrize("rpm", [300.0, -300.0])
@pytest.mark.parametrize(
    ("readings", "fault"), [(360, "none"), (1000, "flickers"), (4095, "flickers"), (2**20, "none")]
)
def test_a_reading_that_is_right_ends_no_run(readings, fault, rpm):
    drive = started(resting(readings=readings, sensors__absolute_fault=fault))
    drive.set("speed_ref_rpm", rpm)
    drive.run(1.0, record=False)
    assert drive.state == RUN and abs(drive.speed_rpm - rpm) < 15
    assert drive.controller.drive.absolute.known
    drive.set("speed_ref_rpm", -rpm)
    drive.run(1.0, record=False)
    assert drive.state == RUN
    # The angle is a period old, and the reading may have been the next one.
    old_deg = 6 * abs(rpm) * POLE_PAIRS * drive.period_s
    step_deg = 360 * POLE_PAIRS
    assert abs(angle_error_deg(drive)) <= 1.5 * step_deg / readings + 2 * step_deg / 8192 + old_deg


@pytest.mark.parametrize("wrong_deg", [180.0, 120.0, -90.0])
def test_a_wrong_angle_is_found_within_a_quarter_of_an_electrical_turn(wrong_deg):
    drive = resting(wrong_deg=wrong_deg)
    assert until_fault(drive) * POLE_PAIRS < 90
    assert drive.faults == [ANGLE]


@pytest.mark.parametrize("wrong_deg", [0.0, 180.0])
@pytest.mark.parametrize("phase", ["u1", "w1", "v2"])
@pytest.mark.parametrize("at_deg", POSITIONS[::4])
def test_the_angle_is_checked_without_a_leg(at_deg, phase, wrong_deg):
    drive = resting(
        at_deg, wrong_deg, controller__lost_legs=32 >> PHASES.index(phase),
        controller__ride_through="least-loss", controller__i_rated_A=3.5,
    )  # fmt: skip
    drive.break_leg(phase, "open")
    before = moved_deg(drive)
    started(drive)
    if wrong_deg:
        assert drive.faults == [ANGLE]
        assert abs(moved_deg(drive) - before) * POLE_PAIRS < 90
        return
    assert drive.state == RUN
    drive.set("speed_ref_rpm", 200.0)
    drive.run(1.0, record=False)
    assert drive.state == RUN and abs(drive.speed_rpm - 200) < 15


@pytest.mark.parametrize("rpm", [300.0, -300.0])
@pytest.mark.parametrize("at_deg", POSITIONS[::3])
@pytest.mark.parametrize("wrong", ["stuck", "reversed"])
def test_a_stuck_or_reversed_reading_is_found_within_a_quarter_turn(wrong, at_deg, rpm):
    """One that is stuck since the reset tells the right angle until then. The reversed one's is
    wrong, but by chance: then within an electrical quarter, without torque."""
    at_deg = at_deg - 360 if at_deg > 360 else at_deg
    if wrong == "stuck":
        drive = resting(at_deg, sensors__absolute_fault="stuck")
        assert until_fault(drive, rpm) < 90
        assert drive.faults == [ABSENT]
    else:
        drive = resting(at_deg, controller__absolute_direction="reversed")
        assert until_fault(drive, rpm) < 90
        if drive.faults != [ABSENT]:
            assert drive.faults == [ANGLE] and abs(moved_deg(drive)) * POLE_PAIRS < 90


def test_a_reading_that_has_been_stuck_since_the_shaft_was_turned_by_hand_gives_no_torque():
    drive = held(held(resting(sensors__absolute_fault="stuck"), 0.1), 0.2, 20.0)
    held(drive, 0.3)
    assert until_fault(drive) * POLE_PAIRS < 90


def test_without_a_reading_no_gate_comes_on():
    drive = resting(sensors__absolute_fault="silent")
    for _ in range(2):
        drive.start()
        begun_s = drive.time_s
        while drive.state == CALIBRATE:
            drive.run(drive.period_s, record=False)
            assert all(lib.ht_port_leg_tripped(drive.controller.port, leg) for leg in range(6))
        assert drive.faults == [ABSENT] and drive.state == FAULT
        assert drive.time_s - begun_s < 0.2
        drive.clear()
    assert moved_deg(drive) == 0.0


def test_a_port_without_an_absolute_encoder_says_so():
    """As on the chips: the drive is told of one that the board has not."""
    drive = resting(readings=0, controller__absolute_counts_rev=READINGS)
    started(drive)
    assert drive.faults == [ABSENT]


def test_a_start_right_after_the_reset_waits_for_two_readings():
    drive = started(resting(controller__calibration_s=0.002))
    assert drive.state == RUN and abs(angle_error_deg(drive)) < 1.2


def test_a_turning_shaft_tells_no_angle_until_it_has_stood():
    drive = held(resting(), 0.3, 100.0)
    assert not drive.controller.drive.absolute.known
    assert started(held(drive, 0.1)).state == RUN
    assert abs(angle_error_deg(drive)) < 1.2


@pytest.mark.parametrize("wrong", ["silent", "counts"])
def test_a_reading_that_parts_from_the_counts_ends_the_run(wrong):
    drive = started(resting())
    drive.set("speed_ref_rpm", 300.0)
    drive.run(1.0, record=False)
    assert drive.state == RUN
    if wrong == "silent":
        drive.sensors.absolute_fault = ABSOLUTE_FAULTS.index("silent")
    else:
        drive.sensors.absolute_rev += 0.25
    drive.run(0.015, record=False)  # one or two readings may be noise
    assert drive.state == RUN
    drive.run(0.03, record=False)
    assert drive.faults == [ABSENT]


def test_check_and_firmware_refuse_an_encoder_that_is_not_there_or_too_coarse(tmp_path, capsys):
    file = tmp_path / "no.toml"
    for sensors, said in (("", "absolute_counts_rev = 0"), ("absolute_counts_rev = 359", "359")):
        file.write_text(
            f'setup = "magnet-surface"\n[sensors]\n{sensors}\n'
            '[controller]\nrotor_start = "absolute"\n'
        )
        assert main(["check", str(file)]) != 0
        told = "".join(capsys.readouterr())
        assert said in told and "72 times" in told and "Traceback" not in told
    file.write_text(
        'setup = "magnet-surface"\n[controller]\nrotor_start = "absolute"\n'
        "absolute_counts_rev = 1000\n"
    )
    assert main(["check", str(file)]) != 0
    assert "sensors.absolute_counts_rev must be 360 at least" in capsys.readouterr().out
