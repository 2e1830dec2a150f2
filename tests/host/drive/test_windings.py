"""Drives of windings whose sets are 0 or 60 degrees apart, against the true plant: no current in
x-y, operating points, lost phases, alignment, and what is refused.
"""

import at_point
import numpy as np
import pytest
from at_point import at
from waiting import started

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import InputError
from hexatorque.plant.vsd import PHASES
from hexatorque.setups.design import Design

#: A machine of each kind, both windings, each law.
DRIVES = [
    ("symmetrical", 60, "db-dtfc"),
    ("symmetrical", 0, "foc"),
    ("symmetrical", 60, "dtc1"),
    ("magnet-surface", 60, "foc"),
    ("magnet-interior", 0, "db-dtfc"),
    ("magnet-surface", 0, "dtc1"),
]
SETTLE_S = 0.7
#: Phase current at rated torque, r.m.s.
RATED_A = 2.3


def begun(name, displacement_deg, scheme, **more):
    """The drive as it runs after its start, and its design."""
    setup = setups.load(name).with_scheme(
        scheme, machine__displacement_deg=displacement_deg, **more
    )
    return at_point.begun(setup)


@pytest.mark.parametrize("name, displacement_deg, scheme", DRIVES)
def test_no_current_in_xy_and_the_torque_is_known(name, displacement_deg, scheme):
    """3, 30 and 90 % of rated speed, both signs of torque. The x-y current stays below 0.02 of the
    rated amplitude. Estimated torque within 1.5 % of rated torque, speed within 0.5 %."""
    drive, design = begun(name, displacement_deg, scheme)
    for speed_pu, load_pu in ((0.03, 1), (0.3, -1), (0.9, 0.9), (-0.9, 0.4)):
        rec = at(drive, design, speed_pu, load_pu, SETTLE_S)
        assert drive.state == "run", (drive.trip, speed_pu)
        xy_A = np.hypot(rec["plant.i_x_A"], rec["plant.i_y_A"])
        assert np.sqrt(np.mean(xy_A**2)) < 0.02 * design.rated_A, (speed_pu, load_pu)
        true, seen = rec["plant.torque_Nm"].mean(), rec["torque_Nm"].mean()
        assert abs(seen - true) < 0.015 * design.rated_Nm, (speed_pu, load_pu, true, seen)
        off = rec["plant.speed_rpm"].mean() - speed_pu * design.rated_rpm
        assert abs(off) < 0.005 * design.rated_rpm
    assert drive.gate_mistake == ""


@pytest.mark.parametrize(
    "name, displacement_deg, scheme",
    [("symmetrical", 0, "db-dtfc"), ("symmetrical", 60, "dtc1"), ("magnet-surface", 60, "foc")],
)
@pytest.mark.parametrize("phase", PHASES)
def test_a_phase_that_opens_is_named(name, displacement_deg, scheme, phase):
    """Two phases each share an axis in x-y. Their currents tell them apart."""
    drive, design = begun(name, displacement_deg, scheme)
    at(drive, design, 0.3, 0.5, SETTLE_S)
    drive.break_leg(phase, "open")
    drive.run(0.03, record=False)
    assert drive.faults == ["phase lost"] and f"phase {phase} lost" in str(drive.trip)


@pytest.mark.parametrize(
    "displacement_deg, scheme, mode",
    [(0, "db-dtfc", "least-loss"), (60, "foc", "most-torque"), (60, "dtc1", "least-loss")],
)
@pytest.mark.parametrize("phase", ["u1", "w2"])
def test_the_drive_goes_on_without_a_leg(displacement_deg, scheme, mode, phase):
    """Speed and torque estimate hold. The leg along the same axis carries the rated current: the
    flux is lowered to what makes the most torque of it."""
    drive, design = begun(
        "symmetrical", displacement_deg, scheme,
        controller__ride_through=mode, controller__i_rated_A=RATED_A,
    )  # fmt: skip
    at(drive, design, 0.3, 0.25, SETTLE_S)
    drive.break_leg(phase, "open")
    drive.run(1.5, record=False)
    assert drive.state == "run", drive.trip
    drive.discard()
    drive.run(0.3)
    rec = drive.take()
    assert int(drive.controller.channel("warnings")) & 63 == 32 >> PHASES.index(phase)
    assert abs(rec[f"plant.i_{phase}_A"]).max() < 0.01
    assert rec["plant.speed_rpm"].mean() == pytest.approx(0.3 * design.rated_rpm, rel=0.01)
    true, seen = rec["plant.torque_Nm"].mean(), rec["torque_Nm"].mean()
    assert abs(seen - true) < 0.03 * design.rated_Nm
    largest_A = max(np.sqrt(np.mean(rec[f"plant.i_{one}_A"] ** 2)) for one in PHASES)
    assert 0.9 * RATED_A < largest_A < 1.1 * RATED_A


def angle_error_deg(drive, start_deg):
    true = start_deg + np.degrees(drive.plant_state[7] * drive.machine.pole_pairs)
    believed = 360 * drive.controller.drive.rotor.electrical / drive.get("encoder_counts_rev")
    return (true - believed + 180) % 360 - 180


@pytest.mark.parametrize("start", ["align", "known"])
@pytest.mark.parametrize("start_deg", [-170.0, 100.0])
def test_magnets_are_aligned_along_30_degrees_and_their_multiples(start, start_deg):
    drive, _ = begun(
        "magnet-surface", 60, "foc", machine__start_deg=start_deg,
        controller__rotor_start=start, controller__rotor_zero_deg=start_deg,
    )  # fmt: skip
    assert drive.state == "run", drive.trip
    assert abs(angle_error_deg(drive, start_deg)) < 2


@pytest.mark.parametrize("displacement_deg", [0, 60])
@pytest.mark.parametrize("name, scheme, lost", [
    ("magnet-surface", "foc", "u2"), ("magnet-interior", "db-dtfc", "w1"),
    ("magnet-surface", "foc", "u2+w2+v2"),
])  # fmt: skip
def test_magnets_start_without_legs(displacement_deg, name, scheme, lost):
    """Angle within 1.5 degrees; the torque is known as with all legs."""
    phases = lost.split("+")
    setup = setups.load(name).with_scheme(
        scheme, machine__displacement_deg=displacement_deg, machine__start_deg=-130.0,
        controller__lost_legs=sum(32 >> PHASES.index(one) for one in phases),
        controller__ride_through="least-loss", controller__i_rated_A=3.5,
    )  # fmt: skip
    drive = SimulatedDrive(setup, at_point.SAMPLES)
    for one in phases:
        drive.break_leg(one, "open")
    started(drive)
    assert drive.state == "run", drive.trip
    assert abs(angle_error_deg(drive, -130.0)) < 1.5
    design = Design(setup, setups.parameters(setup).__getitem__)
    rec = at(drive, design, 0.4, 0.3)
    off_Nm = rec["torque_Nm"].mean() - rec["plant.torque_Nm"].mean()
    assert abs(off_Nm) < 0.02 * design.rated_Nm
    assert rec["plant.speed_rpm"].mean() == pytest.approx(0.4 * design.rated_rpm, rel=0.01)


@pytest.mark.parametrize(
    "change, told",
    [
        ({"machine.displacement_deg": 45}, "displacement_deg = 45: choose one of 30, 0, 60"),
        ({"controller.scheme": "ddr"}, "scheme = ddr, displacement_deg = 60: where the sets are"),
        ({"controller.clamp": "alternating"}, "both must switch alike"),
        (
            {
                "controller.lost_legs": 33, "controller.ride_through": "least-loss",
                "controller.i_rated_A": RATED_A,
            },
            "lost_legs = 33",
        ),
    ],
)  # fmt: skip
def test_what_the_winding_forbids_is_refused_in_a_line(change, told):
    with pytest.raises(InputError) as error:
        setups.load("symmetrical").changed(change)
    assert told in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "scheme, reason",
    [("foc-24", "switch alike"), ("db-ipwm", "switch alike"), ("ddr", "x-y voltage")],
)
@pytest.mark.parametrize("displacement_deg", [0, 60])
def test_check_gives_the_reason_of_each_scheme_that_does_not_drive_it(
    displacement_deg, scheme, reason
):
    from hexatorque.setups.review import review

    setup = setups.load("symmetrical").changed(machine__displacement_deg=displacement_deg)
    (found,) = (f for f in review(setup, [scheme]) if f.scheme == scheme)
    assert found.verdict == "bad" and reason in found.advice


def test_only_schemes_that_drive_the_winding_are_ready():
    from hexatorque import firmware
    from hexatorque.setups.review import ready_of, review

    findings = review(setups.load("symmetrical"), firmware.schemes())
    assert ready_of(findings, firmware.schemes()) == ["dtc1", "db-dtfc", "foc"]
