"""Drives of machines with magnets, against the true plant: start by alignment, operating points,
weakening, reversal, and the faults that only they have.
"""

import itertools

import at_point
import numpy as np
import pytest
from at_point import SAMPLES, at
from campaigns import part
from waiting import started

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import BUILD, CALIBRATE
from hexatorque.plant.vsd import PHASES
from hexatorque.setups import SetupError, new
from hexatorque.setups.design import Design

BUILT_IN = ("magnet-interior", "magnet-surface", "magnet-24v")
#: A scheme of each law that is ready on the machine.
DRIVES = [
    ("magnet-interior", "db-dtfc"),
    ("magnet-interior", "foc"),
    ("magnet-surface", "ddr"),
    ("magnet-surface", "dtc3"),
    ("magnet-24v", "db-dtfc"),
    ("magnet-24v", "foc-24"),
]


#: L_q is four times L_d, and the torque limit needs more flux than the magnets have.
SALIENT = (
    "current_A=9.7,torque_Nm=15.6,rs_ohm=0.365,ld_H=1.5e-3,lq_H=6.14e-3,ke_V=55.7,poles=16,"
    "inertia_kgm2=0.0267,speed_rpm=3323,vdc_V=392"
)


def begun(name, scheme, start_deg=100.0, **more):
    """The drive as it runs after its alignment, and its design."""
    setup = setups.load(name).with_scheme(scheme, machine__start_deg=start_deg, **more)
    return at_point.begun(setup)


def angle_error_deg(drive):
    """Of the firmware's angle of the d axis, electrical."""
    true = drive.setup["machine.start_deg"] + np.degrees(
        drive.plant_state[7] * drive.machine.pole_pairs
    )
    believed = 360 * drive.controller.drive.rotor.electrical / drive.get("encoder_counts_rev")
    return (true - believed + 180) % 360 - 180


@pytest.mark.parametrize("start_deg", [0.0, 100.0, -170.0])
def test_alignment_finds_the_rotor(start_deg):
    drive, _ = begun("magnet-surface", "ddr", start_deg)
    assert drive.state == "run"
    assert abs(angle_error_deg(drive)) < 2


@pytest.mark.parametrize("rpm", [3000.0, -3000.0])
@pytest.mark.parametrize("scheme", ["foc", "foc-24", "db-dtfc"])
def test_a_step_of_torque_does_not_exceed_its_current(scheme, rpm):
    """The least current of the torque limit; a quarter more for the ripple and a transient."""
    setup = setups.parse(new.from_magnets(SALIENT, "x"), "x").with_scheme(scheme)
    drive, design = at_point.begun(setup)
    drive.set("speed_ref_rpm", 0.5 * rpm)
    drive.run(0.6, record=False)
    drive.take()
    drive.set("speed_ref_rpm", rpm)
    drive.run(0.1)
    assert drive.state == "run"
    rec = drive.take()
    limit_Nm = drive.get("torque_limit_Nm")
    current_A = np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"])
    assert np.abs(rec["plant.torque_Nm"]).max() > 0.95 * limit_Nm
    assert current_A.max() < 1.25 * design.machine.current_A(limit_Nm, 0.0)


@pytest.mark.parametrize("name", BUILT_IN)
@pytest.mark.parametrize("share", (0.3, 0.7))
def test_alignment_makes_no_xy_current(name, share):
    """A voltage that the legs cannot make is clipped, and a clipped one has a part in x-y."""
    scheme = "foc-24" if name == "magnet-24v" else "db-dtfc"
    trip_A = setups.load(name).parameter("i_trip_A")
    setup = setups.load(name).with_scheme(scheme, controller__build_current_A=share * trip_A)
    drive = SimulatedDrive(setup, SAMPLES)
    drive.start()
    drive.run(1.5)
    assert drive.state in ("build", "run")
    recording = drive.take()
    xy_Wb = np.hypot(recording["psi_x_Wb"], recording["psi_y_Wb"])
    assert np.nanmax(xy_Wb) < 0.12 * share * trip_A * drive.get("lxy_H")


def test_a_known_angle_needs_no_search():
    """The encoder counts from the start of the simulation, where the d axis is at 100 degrees."""
    drive, _ = begun(
        "magnet-surface", "ddr", 100.0,
        controller__rotor_start="known", controller__rotor_zero_deg=100.0,
    )  # fmt: skip
    assert drive.state == "run"
    assert abs(angle_error_deg(drive)) < 0.5


@pytest.mark.parametrize("zero_deg", [160.0, -80.0, 280.0])
def test_a_known_angle_that_is_wrong_gives_no_torque(zero_deg):
    """The shaft turns towards where the direct current pulls it, and coasts when that has ended."""
    drive, _ = begun(
        "magnet-surface", "ddr", 100.0,
        controller__rotor_start="known", controller__rotor_zero_deg=zero_deg,
    )  # fmt: skip
    assert drive.state == "fault" and drive.faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7]) < 2 * np.pi / drive.machine.pole_pairs
    assert "did not show that the rotor was aligned" in str(drive.trip)


@pytest.mark.parametrize("name, scheme", [DRIVES[0], DRIVES[2], DRIVES[4]])
@pytest.mark.parametrize("wrong_deg", [180.0, 120.0, -90.0])
def test_a_wrong_known_angle_is_found_within_a_quarter_of_an_electrical_turn(
    name, scheme, wrong_deg
):
    setup = setups.load(name).with_scheme(
        scheme, machine__start_deg=100.0, controller__rotor_start="known",
        controller__rotor_zero_deg=100.0 + wrong_deg - (360 if wrong_deg > 0 else 0),
    )  # fmt: skip
    drive = SimulatedDrive(setup, SAMPLES)
    drive.start()
    while drive.state in (CALIBRATE, BUILD):
        drive.run(drive.period_s * 10, record=False)
    assert drive.faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7]) * drive.machine.pole_pairs < np.pi / 2


def test_an_encoder_that_counts_backwards_gives_no_torque():
    drive, _ = begun("magnet-surface", "ddr", sensors__encoder_wires="swapped")
    assert drive.state == "fault" and drive.faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7]) < 2 * np.pi / drive.machine.pole_pairs


def test_a_table_holds_the_flux_while_r_i_takes_the_place_of_the_emf():
    """Where the machine brakes and R_s i is about the magnets' voltage, nearly no voltage turns the
    flux, and the table's vectors, 75 degrees away from it, cannot raise it either. L i is a part of
    it, and that part decays under zero vectors."""
    sheet_ohm = setups.load("magnet-24v")["machine.rs_ohm"]
    drive, design = begun(
        "magnet-24v", "ddr", machine__rs_ohm=1.32 * sheet_ohm, controller__rs_ohm=sheet_ohm
    )
    rec = at(drive, design, -0.34, 0.95)
    flux_Wb = np.hypot(rec["psi_alpha_Wb"], rec["psi_beta_Wb"])
    assert flux_Wb.mean() > 0.95 * rec["flux_ref_Wb"].mean()
    assert abs(rec["plant.speed_rpm"].mean() / design.rated_rpm + 0.34) < 0.01


@pytest.mark.parametrize("name, scheme, within", [
    ("magnet-interior", "db-dtfc", 0.01),
    ("magnet-surface", "dtc3", 0.04),  # near its rated torque R_s i is half of what they induce
    ("magnet-24v", "foc-24", 0.01),
])  # fmt: skip
@pytest.mark.parametrize("share", [0.85, 1.15])
def test_a_flux_that_the_drive_believes_wrong_is_learnt(name, scheme, within, share):
    """With light load, then with much of the rated one, in both directions: flux and torque."""
    psi_f_Wb = setups.load(name)["machine.psi_f_Wb"]
    drive, design = begun(
        name, scheme, controller__psi_f_Wb=share * psi_f_Wb, controller__adapt_psi_f_s=0.5
    )
    at(drive, design, 0.6, 0.2, 2.0)
    for speed_pu, load_pu in ((0.9, 0.8), (-0.6, 0.8)):
        rec = at(drive, design, speed_pu, load_pu, 1.0)
        assert drive.state == "run", drive.trip
        assert rec["psi_f_Wb"].mean() == pytest.approx(psi_f_Wb, rel=within)
        off = rec["torque_Nm"].mean() - rec["plant.torque_Nm"].mean()
        assert abs(off) < within * design.rated_Nm


@pytest.mark.parametrize("name, scheme", DRIVES)
def test_operating_points(name, scheme):
    """3, 30 and 100 % of rated speed with rated torque of both signs: the estimated torque is
    within 1.5 % of rated torque, the mean speed within 0.5 % of its reference, nothing trips."""
    drive, design = begun(name, scheme)
    for speed_pu, load_pu in ((0.03, 1), (0.3, -1), (1.0, 0.95), (-1.0, 0.4)):
        rec = at(drive, design, speed_pu, load_pu, 1.0)
        assert drive.state == "run", drive.trip
        true, seen = rec["plant.torque_Nm"].mean(), rec["torque_Nm"].mean()
        assert abs(seen - true) < 0.015 * design.rated_Nm, (speed_pu, load_pu, true, seen)
        off = rec["plant.speed_rpm"].mean() - speed_pu * design.rated_rpm
        assert abs(off) < 0.005 * design.rated_rpm
    assert drive.gate_mistake == ""


@pytest.mark.parametrize("name, scheme", [DRIVES[0], DRIVES[2], DRIVES[5]])
def test_reversal(name, scheme):
    drive, design = begun(name, scheme)
    at(drive, design, 0.8, 0.0)
    drive.set("speed_ref_rpm", -0.8 * design.rated_rpm)
    drive.run(1.5)
    assert drive.state == "run", drive.trip
    assert drive.take()["plant.speed_rpm"].min() < -0.78 * design.rated_rpm
    assert drive.gate_mistake == ""


@pytest.mark.parametrize("scheme", ["foc", "ddr"])
def test_above_rated_speed_the_current_weakens_the_magnets(scheme):
    """Surface magnets at 120 % of rated speed and 70 % of rated torque, below the speed at which
    they induce V_dc: i_d is negative, and the flux is what the voltage turns."""
    drive, design = begun("magnet-surface", scheme)
    rec = at(drive, design, 1.2, 0.7, 1.0)
    assert drive.state == "run", drive.trip
    psi = rec["plant.psi_alpha_Wb"] + 1j * rec["plant.psi_beta_Wb"]
    i = rec["plant.i_alpha_A"] + 1j * rec["plant.i_beta_A"]
    axis = np.exp(1j * (drive.machine.pole_pairs * rec["plant.theta_rad"] + np.deg2rad(100)))
    assert (i * axis.conj()).real.mean() < -0.5
    assert np.abs(psi).mean() < drive.machine.psi_f_Wb
    assert abs(rec["plant.speed_rpm"].mean() / design.rated_rpm - 1.2) < 0.01


def test_the_torque_limit_stands_still_near_the_end_of_the_voltage():
    """With three times the resistance more torque leaves much less flux. A limit at the flux of the
    torque before swung from tick to tick, and the shaft did not get beyond 510 r/min."""
    drive, _ = begun("magnet-surface", "foc", machine__rs_ohm=3.3, rated__torque_Nm=3.0)
    drive.set("speed_ref_rpm", 600.0)
    drive.run(1.0, record=False)
    for load_Nm in np.linspace(0.25, 2.5, 10):
        drive.set("load_Nm", load_Nm)
        drive.run(0.1, record=False)
    drive.run(1.0, record=False)
    limits = []
    for _ in range(50):
        drive.run(0.01, record=False)
        limits.append(drive.controller.drive.torque_limit_Nm)
    assert drive.state == "run", drive.trip
    assert abs(drive.speed_rpm - 600) < 3
    assert 2.5 < min(limits) and max(limits) - min(limits) < 0.02
    assert max(limits) < drive.get("torque_limit_Nm")


@pytest.mark.parametrize("name, scheme", [DRIVES[0], DRIVES[2], DRIVES[5]])
@pytest.mark.parametrize("speed_pu", [0.3, 1.0])
def test_an_encoder_that_stops_is_found_within_two_milliseconds(name, scheme, speed_pu):
    drive, design = begun(name, scheme)
    at(drive, design, speed_pu, 1.0 if speed_pu < 1 else 0.9)
    drive.sensors.hold[7] = 1
    drive.run(0.01)
    rec = drive.take()
    assert drive.faults == ["encoder against flux speed"]
    running = rec["state"] == rec["state"][0]
    assert running.sum() < 2e-3 * rec.rate_Hz
    # The ripple of the scheme is in it, too.
    before = rec["plant.torque_Nm"][: SAMPLES * 2]
    torque = rec["plant.torque_Nm"][running]
    margin = 0.2 * design.rated_Nm
    assert before.min() - margin < torque.min() and torque.max() < before.max() + margin


#: Counts that an encoder shows instead of `true`, from `first` on; `turn`: an electrical turn.
ENCODERS = {
    "counts backwards": lambda true, first, turn: 2 * first - true,
    "jumps by 30 degrees": lambda true, first, turn: true + turn / 12,
    "jumps by half a turn": lambda true, first, turn: true + turn / 2,
    "has one line": lambda true, first, turn: first + np.floor(0.5 * (true - first)) % 2,
}


@pytest.mark.parametrize("name, scheme, speed_pu", [(*DRIVES[0], 0.3), (*DRIVES[2], 1.0)])
@pytest.mark.parametrize("how", ENCODERS)
def test_an_encoder_that_lies_is_found_within_two_milliseconds(how, name, scheme, speed_pu):
    """While the machine makes its torque, which stays below 1.2 of the rated one, or below its
    ripple before."""
    drive, design = begun(name, scheme)
    rec = at(drive, design, speed_pu, 1.0 if speed_pu < 1 else 0.9)
    before_Nm = abs(rec["plant.torque_Nm"]).max()
    counts_rev, period_s = drive.get("encoder_counts_rev"), 1 / drive.get("f_isr_Hz")
    first = drive.plant_state[7] / 2 / np.pi * counts_rev
    drive.sensors.hold[7] = 1
    for _ in range(round(2e-3 / period_s)):
        true = drive.plant_state[7] / 2 / np.pi * counts_rev
        shown = ENCODERS[how](true, first, counts_rev / drive.machine.pole_pairs)
        drive.sensors.position_counts, drive.sensors.counter = shown, int(np.floor(shown))
        drive.run(period_s)
    assert drive.faults == ["encoder against flux speed"]
    largest_Nm = abs(drive.take()["plant.torque_Nm"]).max()
    assert largest_Nm < max(1.2 * design.rated_Nm, 1.01 * before_Nm)


def test_after_gates_off_no_current_flows_below_the_ceiling():
    drive, design = begun("magnet-interior", "foc")
    at(drive, design, 1.0, 0.5)
    ceiling_rpm = drive.machine.ceiling_rpm(drive.vdc_V)
    assert drive.speed_rpm < drive.get("speed_trip_rpm") < ceiling_rpm
    drive.stop()
    drive.run(0.002, record=False)
    drive.discard()
    drive.run(0.05)
    rec = drive.take()
    assert max(np.abs(rec[f"plant.i_{axis}_A"]).max() for axis in ("alpha", "beta")) < 0.01


@pytest.mark.parametrize("name, scheme", [DRIVES[0], DRIVES[2], DRIVES[4]])
def test_an_open_phase_is_named(name, scheme):
    drive, design = begun(name, scheme)
    at(drive, design, 0.5, 0.8)
    drive.break_leg("w2", "open")
    drive.run(0.1, record=False)
    assert drive.faults == ["phase lost"]
    assert "phase w2 lost" in drive.snapshot["warnings"]


def riding_setup(name, mode="least-loss"):
    setup = setups.load(name)
    rated_A = Design(setup, setups.parameters(setup).__getitem__).rated_A / np.sqrt(2)
    return setup.changed(controller__ride_through=mode, controller__i_rated_A=rated_A)


def riding(name, scheme, mode="least-loss", **more):
    """A drive that is to go on without a leg, and its design."""
    setup = riding_setup(name, mode).with_scheme(scheme, machine__start_deg=100.0, **more)
    return at_point.begun(setup)


@pytest.mark.parametrize("name, scheme, kind, mode, speed_pu, load_pu", [
    ("magnet-interior", "db-dtfc", "open", "least-loss", 0.9, 0.42),
    ("magnet-interior", "foc", "blocked", "most-torque", 0.4, -0.42),
    ("magnet-surface", "ddr", "upper", "least-loss", -0.5, 0.4),
    ("magnet-24v", "db-ipwm", "lower", "most-torque", 0.8, 0.42),
])  # fmt: skip
def test_it_goes_on_without_a_leg(name, scheme, kind, mode, speed_pu, load_pu):
    """The rotor's angle is known, so the flux stays right; no phase carries more than its rated
    current. With 0.555 or 0.577 of the current there is as much of the torque, at least where the
    magnets alone make it."""
    drive, design = riding(name, scheme, mode)
    before = at(drive, design, speed_pu, load_pu, 1.0)
    drive.break_leg("w1", kind, 0.43 * drive.period_s)
    drive.run(1.0, record=False)
    drive.discard()
    drive.run(0.2)
    assert drive.state == "run", drive.trip
    assert int(drive.controller.channel("warnings")) & 63 == 8  # w1
    rec = drive.take()
    off_rpm = rec["plant.speed_rpm"].mean() - before["plant.speed_rpm"].mean()
    assert abs(off_rpm) < 0.02 * design.rated_rpm
    flux_Wb = np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"])
    assert flux_Wb.mean() == pytest.approx(rec["flux_ref_Wb"].mean(), rel=0.03)
    off_Nm = rec["torque_Nm"].mean() - rec["plant.torque_Nm"].mean()
    assert abs(off_Nm) < 0.02 * design.rated_Nm
    rms_A = {p: np.sqrt(np.mean(rec[f"plant.i_{p}_A"] ** 2)) for p in PHASES}
    # While the set's other legs are at one rail, the diodes of a leg that is not open conduct.
    assert rms_A.pop("w1") < (1e-3 if kind == "open" else 0.07) * design.rated_A
    assert max(rms_A.values()) < 1.02 * drive.get("i_rated_A")
    part = 0.555 if mode == "least-loss" else 0.577
    limit_Nm = drive.controller.channel("torque_limit_Nm")
    most_Nm = drive.machine.torque_of_current_Nm(part * design.rated_A, 0.0)
    assert 0.9 * abs(load_pu) * design.rated_Nm < limit_Nm < 1.01 * most_Nm


def test_without_a_leg_the_torque_limit_leaves_voltage():
    """Along the lost leg's axis R_s and L_xy take their voltage once more. At rated speed that of a
    table, 0.48 V_dc, is short of it: the limit falls, and the drive slows down, but it goes on."""
    drive, design = riding("magnet-surface", "ddr")
    at(drive, design, 1.0, 0.4)
    drive.break_leg("u2", "open")
    drive.run(1.5, record=False)
    assert drive.state == "run", drive.trip
    assert drive.controller.channel("torque_limit_Nm") < 0.52 * design.rated_Nm
    assert 0.8 * design.rated_rpm < drive.speed_rpm < design.rated_rpm


@pytest.mark.parametrize("scheme", ["db-dtfc", "ddr"])
def test_told_harmonics_disturb_no_drive_without_a_leg(scheme):
    """15 % of fifth harmonic are no other loss, and the flux is as exact as with all legs."""
    drive, design = riding("magnet-surface", scheme, machine__emf_share=(0.15, 0, 0, 0))

    def off(rec):
        axes = (rec[f"psi_{n}_Wb"] - rec[f"plant.psi_{n}_Wb"] for n in ("alpha", "beta"))
        return np.sqrt(np.nanmean(np.hypot(*axes) ** 2))

    before = off(at(drive, design, 0.6, 0.35))
    drive.break_leg("u1", "open")
    drive.run(0.8, record=False)
    drive.discard()
    drive.run(0.2)
    assert drive.state == "run", drive.trip
    assert off(drive.take()) < 1.2 * before


@pytest.mark.parametrize("second", ["u2", "v2", "w1"])
def test_a_second_lost_phase_stops(second):
    drive, design = riding("magnet-interior", "foc")
    at(drive, design, 0.5, 0.4)
    drive.break_leg("u1", "open")
    drive.run(0.3, record=False)
    assert drive.state == "run", drive.trip
    drive.break_leg(second, "open")
    drive.run(0.3, record=False)
    assert drive.faults == ["phase lost"]
    assert {"phase u1 lost", "another phase lost"} <= set(drive.snapshot["warnings"])


#: Fifth and seventh harmonic whose torques add up where many a rotor is aligned.
HARMONICS = {"machine__emf_share": (0.05, 0.03, 0, 0), "machine__emf_deg": (-90, 90, 0, 0)}


def without(name, scheme, lost, kind="open", mode="least-loss", start_deg=100.0, **more):
    """A drive at standstill that knows that it lacks legs, and its design."""
    phases = lost.split("+")
    setup = riding_setup(name, mode).with_scheme(
        scheme, machine__start_deg=start_deg,
        controller__lost_legs=sum(32 >> PHASES.index(one) for one in phases), **more,
    )  # fmt: skip
    drive = SimulatedDrive(setup, SAMPLES)
    for one in phases:
        drive.break_leg(one, kind)
    return drive, Design(setup, setups.parameters(setup).__getitem__)


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("name, scheme, lost, start_deg", [
    ("magnet-interior", "db-dtfc", "u1", 100.0), ("magnet-surface", "ddr", "u2", 100.0),
    ("magnet-24v", "foc-24", "w1", 100.0), ("magnet-interior", "foc", "w2", -60.0),
    ("magnet-surface", "dtc3", "v1", -170.0), ("magnet-interior", "db-dtfc", "v2", 0.0),
    ("magnet-surface", "foc", "u1+v2", -170.0), ("magnet-interior", "db-dtfc", "u2+w1", 100.0),
    ("magnet-24v", "foc-24", "w2+v1", 0.0), ("magnet-interior", "foc", "u1+w1+v1", -170.0),
    ("magnet-surface", "db-dtfc", "u2+w2+v2", 100.0),
])  # fmt: skip
def test_alignment_without_legs_finds_the_rotor(name, scheme, lost, start_deg, told):
    """Within 1.5 electrical degrees if the harmonics are told. Untold ones of these sizes turn the
    rotor by 0.26 * 0.08 rad at most if one leg is lost, by 0.08 rad if several are. The saliency
    makes it more: psi_f/(psi_f - (L_q - L_d) i). While the rotor rests no leg carries more than
    `build_current_A`, and while it moves i_trip_A is far."""
    hidden = {} if told else {"controller__emf5_share": 0.0, "controller__emf7_share": 0.0}
    drive, _ = without(name, scheme, lost, start_deg=start_deg, **HARMONICS, **hidden)
    drive.start()
    while drive.state in (CALIBRATE, BUILD):
        drive.run(0.02)
    assert drive.state == "run", drive.trip
    several = "+" in lost
    build_A = drive.get("build_current_A")
    pull_A = build_A / (1.9 if several else 1.0)
    m = drive.machine
    stiff = 1 - (m.lq_H - m.ld_H) * pull_A / m.psi_f_Wb
    untold_deg = np.degrees(0.08 * (1.0 if several else 0.26)) / stiff + 0.5
    assert abs(angle_error_deg(drive)) < (1.5 if told else untold_deg)
    rec = drive.take()
    leg_A = np.max([np.abs(rec[f"plant.i_{one}_A"]) for one in PHASES], axis=0)
    at_rest = leg_A[int(0.9 * len(leg_A)) : int(0.95 * len(leg_A))]
    assert 0.9 * build_A < at_rest.max() < 1.1 * build_A
    assert leg_A.max() < 1.6 * build_A


@pytest.mark.parametrize("name, scheme, lost, kind, mode, points", [
    ("magnet-interior", "db-dtfc", "w1", "open", "least-loss", ((0.5, 0.4), (-0.3, 0.4))),
    ("magnet-surface", "ddr", "u2", "blocked", "least-loss", ((0.3, -0.4), (0.03, 0.4))),
    ("magnet-24v", "db-ipwm", "u1", "upper", "most-torque", ((0.7, 0.4), (-0.7, -0.4))),
    ("magnet-interior", "foc", "u2+w1", "open", "least-loss", ((-0.5, 0.4), (0.03, -0.4))),
    ("magnet-surface", "db-dtfc", "u1+v1", "blocked", "least-loss", ((0.5, 0.35), (-0.5, 0.35))),
])  # fmt: skip
def test_start_without_legs(name, scheme, lost, kind, mode, points):
    """Speed within 0.5 % and estimated torque within 1.5 % of the rated ones, as with all legs."""
    drive, design = without(name, scheme, lost, kind, mode, **HARMONICS)
    started(drive)
    for speed_pu, load_pu in points:
        rec = at(drive, design, speed_pu, load_pu)
        assert drive.state == "run", drive.trip
        off_rpm = rec["plant.speed_rpm"].mean() - speed_pu * design.rated_rpm
        assert abs(off_rpm) < 0.005 * design.rated_rpm
        off_Nm = rec["torque_Nm"].mean() - rec["plant.torque_Nm"].mean()
        assert abs(off_Nm) < 0.015 * design.rated_Nm
        rms_A = [np.sqrt(np.mean(rec[f"plant.i_{one}_A"] ** 2)) for one in PHASES]
        assert max(rms_A) < 1.02 * drive.get("i_rated_A")


@pytest.mark.parametrize("name, scheme, lost", [
    ("magnet-interior", "db-dtfc", "u1"), ("magnet-surface", "ddr", "w2"),
    ("magnet-24v", "foc-24", "v1"), ("magnet-surface", "foc", "u2+w1"),
    ("magnet-interior", "foc", "u2+w2+v2"),
])  # fmt: skip
@pytest.mark.parametrize("wrong_deg", [0.0, 180.0, 120.0, -90.0])
def test_a_known_angle_is_checked_without_legs(name, scheme, lost, wrong_deg):
    """A wrong one is found within a quarter of an electrical turn."""
    drive, _ = without(
        name, scheme, lost, controller__rotor_start="known",
        controller__rotor_zero_deg=(100.0 + wrong_deg + 180) % 360 - 180, **HARMONICS,
    )  # fmt: skip
    started(drive)
    if wrong_deg == 0:
        assert drive.state == "run" and abs(angle_error_deg(drive)) < 0.5
        return
    assert drive.faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7]) * drive.machine.pole_pairs < np.pi / 2


def test_an_encoder_that_counts_backwards_gives_no_torque_without_a_leg():
    """Then the current that is to damp the swing drives it, for two electrical turns."""
    drive, _ = without("magnet-surface", "ddr", "v1", sensors__encoder_wires="swapped")
    assert started(drive).faults == ["encoder against flux speed"]
    assert abs(drive.plant_state[7]) < 2.1 * 2 * np.pi / drive.machine.pole_pairs


@pytest.mark.parametrize("phases", [("u1", "u2"), ("u1", "w1"), ("u1", "v2")])
def test_two_phases_lost_at_once_stop(phases):
    """The residual may have the direction of a third. Whichever leg is switched off, another loss
    shows then."""
    drive, design = riding("magnet-surface", "db-dtfc")
    at(drive, design, 0.5, 0.4)
    for phase in phases:
        drive.break_leg(phase, "open")
    drive.run(0.5, record=False)
    assert drive.faults == ["phase lost"]
    assert "another phase lost" in drive.snapshot["warnings"]


@pytest.mark.parametrize("scheme", ["fdr", "foc"])
def test_untold_harmonics_are_no_lost_leg(scheme):
    """5 and 3 % in the induced voltage, and the least limit that an untold set-up has."""
    untold = setups.load("magnet-surface").changed(machine__emf_share=(0, 0, 0, 0))
    drive, design = begun(
        "magnet-surface", scheme, machine__emf_share=(0.05, 0.03, 0.01, 0.005),
        controller__emf5_share=0.0, controller__emf7_share=0.0,
        controller__loss_check=untold.parameter("loss_check"),
    )  # fmt: skip
    for speed_pu in (0.15, 0.4, 0.95, -0.95):
        at(drive, design, speed_pu, 0.6, 0.0)
    assert drive.state == "run", drive.trip


def xy_harmonics(name, scheme):
    """Fifth and seventh x-y harmonic at rated speed and torque, over the rated current, for each
    sign of both; the drive."""
    drive, design = begun(name, scheme)
    found = []
    for speed_pu, load_pu in itertools.product((1.0, -1.0), (1.0, -1.0)):
        rec = at(drive, design, speed_pu, load_pu, 1.0)
        assert drive.state == "run", drive.trip
        xy = rec["plant.i_x_A"] + 1j * rec["plant.i_y_A"]
        angle = drive.machine.pole_pairs * rec["plant.theta_rad"] + np.deg2rad(100)
        found.append([abs((xy * np.exp(-1j * n * angle)).mean()) for n in (5, -7)])
    return np.array(found) / design.rated_A, drive


@pytest.mark.parametrize("name, scheme, most", [
    ("magnet-surface", "ddr", 0.04),
    ("magnet-surface", "foc", 0.07),
    ("magnet-surface", "db-dtfc", 0.07),
    ("magnet-interior", "ddr", 0.095),
    ("magnet-interior", "ddr-ml", 0.26),
    ("magnet-interior", "foc", 0.07),
    ("magnet-interior", "db-dtfc", 0.07),
])  # fmt: skip
def test_harmonics_in_xy_are_small_with_feed_forward(name, scheme, most):
    """With 4 and 2 % of the fifth and the seventh in the induced voltage. The small L_xy of the
    interior magnets is the hard case."""
    found, _ = xy_harmonics(name, scheme)
    assert np.hypot(*found.T).max() < most


def test_fixed_duties_leave_the_harmonics_to_the_impedance():
    """`fdr` has no mean x-y voltage, so the induced one alone drives the current. The order of its
    vectors and the dead time move it by up to a fifth."""
    found, drive = xy_harmonics("magnet-interior", "fdr")
    m, setup = drive.machine, drive.setup
    w = m.pole_pairs * 2 * np.pi / 60 * setup["rated.speed_rpm"]
    z_ohm = np.abs(m.rs_ohm + 1j * np.array([5, 7]) * w * m.lxy_H)
    rated_A = Design(setup, setups.parameters(setup).__getitem__).rated_A
    of_emf = w * m.psi_f_Wb * np.array([0.04, 0.02]) / z_ohm / rated_A
    assert np.hypot(*of_emf) == pytest.approx(0.26, abs=0.005)
    np.testing.assert_allclose(np.hypot(*found.T), np.hypot(*of_emf), rtol=0.2)


#: What the drive believes: factors of parameters, or degrees that a known angle is off.
WRONG = {
    "psi_f -10 %": {"psi_f_Wb": 0.9}, "psi_f +10 %": {"psi_f_Wb": 1.1},
    "R_s -30 %": {"rs_ohm": 0.7}, "R_s +30 %": {"rs_ohm": 1.3},
    "L -30 %": {"sigma_ls_H": 0.7, "ld_H": 0.7}, "L +30 %": {"sigma_ls_H": 1.3, "ld_H": 1.3},
    "L_q -30 %": {"sigma_ls_H": 0.7}, "angle -5": {"deg": -5.0}, "angle +5": {"deg": 5.0},
}  # fmt: skip
#: A law of each kind on each machine.
LAWS = [(name, scheme) for name in BUILT_IN for scheme in ("db-dtfc", "ddr", "foc")]
#: L_q below L_d is refused, so L_q alone is wrong where it is larger.
BELIEFS = [
    (name, scheme, wrong)
    for name, scheme in LAWS
    for wrong in WRONG
    if wrong != "L_q -30 %" or name == "magnet-interior"
]


@pytest.mark.parametrize("name, scheme, wrong", part(BELIEFS, 7))
def test_with_wrong_parameters_it_holds(name, scheme, wrong):
    setup, factors = setups.load(name), WRONG[wrong]
    believed = {
        f"controller__{n}": f * setup.parameter(n) for n, f in factors.items() if n != "deg"
    }
    if "deg" in factors:
        start_deg = 100.0 + factors["deg"]
        believed = {"controller__rotor_start": "known", "controller__rotor_zero_deg": start_deg}
    drive, design = begun(name, scheme, **believed)
    points = ((0.03, 0.9), (0.3, 0.9), (0.95, 0.8), (0.95, -0.8), (0.3, -0.9), (0.03, -0.9))
    for speed_pu, load_pu in points:
        rec = at(drive, design, speed_pu, load_pu)
        assert drive.state == "run", drive.trip
        error = rec["torque_Nm"].mean() - rec["plant.torque_Nm"].mean()
        assert abs(error) < 0.11 * design.rated_Nm


def test_an_inductance_across_that_is_below_the_one_along_is_refused():
    surface = setups.load("magnet-surface")
    with pytest.raises(SetupError, match="with magnets L_d may not be above L_q"):
        surface.changed(controller__sigma_ls_H=0.7 * surface.parameter("sigma_ls_H"))


@pytest.mark.parametrize(
    "name, model, key",
    [("magnet-interior", "induction", "psi_f_Wb"), ("paper-a", "magnet", "lm_H")],
)
def test_another_model_says_which_values_it_does_not_have(name, model, key):
    with pytest.raises(SetupError, match=f"machine.{key}: the model {model} has no such value"):
        setups.load(name).changed(machine__model=model)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"machine.rr_ohm": 2.0}, "machine.rr_ohm: the model magnet has no such value"),
        ({"machine.ld_H": 20e-3}, "with magnets L_d may not be above L_q"),
        ({"machine.psi_f_Wb": 0.0}, "machine.psi_f_Wb = 0: allowed range is 1e-05 .. 100 Wb"),
        ({"controller.speed_trip_rpm": 9000.0}, "the magnets may induce vdc_max_V at most"),
        # Gates off at 6000 r/min left 6.1 A there, 6.3 A is rated.
        ({"controller.speed_trip_rpm": 6900.0}, "allowed is up to 4964 r/min, where the magnets"),
        ({"controller.ride_through": "least-loss", "controller.i_rated_A": 4.5,
          "controller.trip_state": "short-circuit", "controller.magnets_bear_A": 75.0,
          "sensors.i_full_A": 90.0}, "a short circuit brakes with all legs"),
        ({"controller.scheme": "dtc3"}, "drives more x-y current than i_trip_A"),
        ({"machine.emf_share": [0.1, 0.2]}, "four numbers are needed"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_a_line(changes, words):
    setup = setups.load("magnet-interior")
    with pytest.raises(SetupError) as error:
        setup.changed(changes)
    assert words in str(error.value) and "\n" not in str(error.value)
