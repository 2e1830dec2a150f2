"""A start whose angle the encoder's index tells: refused before the index has passed, checked
before torque, and a contradiction of index and counts ends the run.
"""

import numpy as np
import pytest
from waiting import started

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import RUN, FirmwareError

START_DEG, INDEX_DEG = 100.0, 30.0


def resting(wrong_deg=0.0, **more):
    setup = setups.load("magnet-surface")
    zero_deg = START_DEG + INDEX_DEG * setup["machine.pole_pairs"] + wrong_deg
    return SimulatedDrive(
        setup.with_scheme(
            "ddr", machine__start_deg=START_DEG, sensors__encoder_index_deg=INDEX_DEG,
            controller__rotor_start="index",
            controller__rotor_zero_deg=(zero_deg + 180) % 360 - 180, **more,
        ),
        4,
    )  # fmt: skip


def by_hand(drive, deg, rpm=50.0):
    """The shaft is turned, and held."""
    rad_s = np.sign(deg) * rpm * np.pi / 30
    for _ in range(round(abs(deg) / (6 * rpm) / 1e-3)):
        drive.plant_state[6] = rad_s
        drive.run(1e-3, record=False)
    for _ in range(100):
        drive.plant_state[6] = 0.0
        drive.run(1e-3, record=False)
    return drive


def angle_error_deg(drive):
    true = START_DEG + np.degrees(drive.plant_state[7] * drive.machine.pole_pairs)
    believed = 360 * drive.controller.drive.rotor.electrical / drive.get("encoder_counts_rev")
    return (true - believed + 180) % 360 - 180


def running(**more):
    drive = started(by_hand(resting(**more), 40))
    drive.set("speed_ref_rpm", 300.0)
    drive.run(1.0, record=False)
    assert drive.state == RUN and abs(drive.speed_rpm - 300) < 15
    return drive


@pytest.mark.parametrize("deg", [0, 25, -25])
def test_no_start_before_the_index_has_passed(deg):
    drive = by_hand(resting(), deg)
    with pytest.raises(FirmwareError, match="the index has not passed"):
        drive.start()


@pytest.mark.parametrize("deg", [40, 200, -340])
def test_the_index_tells_the_angle(deg):
    drive = started(by_hand(resting(), deg))
    assert drive.state == RUN
    assert abs(angle_error_deg(drive)) < 0.5


@pytest.mark.parametrize("wrong_deg", [0.0, 180.0])
def test_the_angle_is_checked_without_a_leg(wrong_deg):
    drive = resting(
        wrong_deg, controller__lost_legs=8, controller__ride_through="least-loss",
        controller__i_rated_A=3.5,
    )  # fmt: skip
    drive.break_leg("w1", "open")
    started(by_hand(drive, 40))
    if wrong_deg:
        assert drive.faults == ["encoder against flux speed"]
    else:
        assert drive.state == RUN and abs(angle_error_deg(drive)) < 0.5


@pytest.mark.parametrize("wrong_deg", [180.0, 120.0, -90.0])
def test_a_wrong_angle_of_the_index_is_found_within_a_quarter_of_an_electrical_turn(wrong_deg):
    drive = by_hand(resting(wrong_deg), 40)
    before = drive.plant_state[7]
    started(drive)
    assert drive.faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7] - before) * drive.machine.pole_pairs < np.pi / 2


def test_a_stop_does_not_forget_the_index():
    drive = running()
    drive.stop()
    by_hand(drive, -10)
    assert started(drive).state == RUN
    assert abs(angle_error_deg(drive)) < 0.5


@pytest.mark.parametrize("rpm", [300.0, -300.0])
@pytest.mark.parametrize("moved_deg", [5.0, -90.0])
def test_an_index_at_a_false_count_ends_the_run(rpm, moved_deg):
    """As after counts that slipped. A revolution takes 0.2 s."""
    drive = running()
    drive.set("speed_ref_rpm", rpm)
    drive.run(1.5, record=False)
    assert drive.state == RUN
    right = int(drive.sensors.index_counts)
    drive.sensors.index_counts += round(moved_deg / 360 * drive.get("encoder_counts_rev"))
    end_s = drive.time_s + 0.25
    while drive.state == RUN and drive.time_s < end_s:
        drive.run(1e-2, record=False)
    assert drive.faults == ["encoder against flux speed"]
    drive.sensors.index_counts = right
    by_hand(drive, 0)
    drive.clear()
    with pytest.raises(FirmwareError, match="the index has not passed"):
        drive.start()
    assert started(by_hand(drive, 730, 200)).state == RUN


def test_a_lost_index_ends_the_run():
    drive = running()
    drive.sensors.index_counts = -1
    drive.run(0.3, record=False)
    assert drive.faults == ["encoder against flux speed"]


def test_an_encoder_without_an_index_is_found_by_check(tmp_path, capsys):
    file = tmp_path / "no.toml"
    file.write_text('setup = "magnet-surface"\n[controller]\nrotor_start = "index"\n')
    assert main(["check", str(file)]) != 0
    assert "sensors.encoder_index_deg" in capsys.readouterr().out
