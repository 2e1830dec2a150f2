"""Set-ups that `hexatorque new` makes of the data sheet of a machine with magnets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from waiting import started

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.experiments.acceptance import accept
from hexatorque.setups import SetupError, keys, new, review
from hexatorque.setups.design import Design

SURFACE = "poles=10,ke_V=47,rs_ohm=1.1,ld_H=2.1e-3,current_A=3.5,vdc_V=60,inertia_kgm2=0.03"
INTERIOR = "poles=6,ke_V=67,rs_ohm=0.8,ld_H=6.4e-3,lq_H=17.4e-3,current_A=4.6,vdc_V=500"
INTERIOR += ",inertia_kgm2=0.01"


@pytest.mark.parametrize("sheet", [SURFACE, INTERIOR])
def test_the_flux_induces_the_voltage_of_the_sheet(sheet):
    """At 1000 r/min the flux turns by P 1000 2 pi/60 rad/s; the voltage between two lines is sqrt 3
    times a phase's, and its rms 1/sqrt 2 of the amplitude."""
    given = new.read(sheet, new.MAGNETS)
    setup = setups.parse(new.from_magnets(sheet, "x"), "x")
    assert setup["machine.model"] == "magnet"
    turns_rad_s = 0.5 * given["poles"] * 1000 / 60 * 2 * math.pi
    rms_V = setup["machine.psi_f_Wb"] * turns_rad_s * math.sqrt(3) / math.sqrt(2)
    assert rms_V == pytest.approx(given["ke_V"], rel=1e-4)


def test_a_sheet_without_lq_is_that_of_surface_magnets():
    setup = setups.parse(new.from_magnets(SURFACE, "x"), "x")
    assert setup["machine.lq_H"] == setup["machine.ld_H"] == 2.1e-3
    assert setup["machine.lxy_H"] == pytest.approx(new.LXY_OF_LD_RANGE[0] * 2.1e-3)


def test_what_is_assumed_of_the_xy_plane_covers_the_machines_that_are_built_in():
    found = [
        setup["machine.lxy_H"] / setup["machine.ld_H"]
        for setup in map(setups.load, setups.builtin_names())
        if setup["machine.model"] == "magnet"
    ]
    low, high = new.LXY_OF_LD_RANGE
    assert len(found) >= 3
    assert (min(found), max(found)) == (pytest.approx(low, abs=5e-3), pytest.approx(high, abs=5e-3))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"ke_V": None}, "ke_V is missing (voltage between two lines of a set without load"),
        ({"ke_V": "0"}, "ke_V = 0: allowed range is 0.1 .. 10000 V"),
        ({"poles": "5"}, "poles = 5: an even number is needed"),
        ({"inertia_kgm2": None}, "inertia_kgm2 is missing (inertia, load included, kg m2)"),
        ({"phases": "3"}, "phases = 3: a three-phase machine has one set; rewound"),
        ({"rr_ohm": "2"}, "unknown name rr_ohm"),
    ],
)
def test_a_mistake_in_the_sheet_is_told_in_a_line(change, line):
    given = dict(part.split("=") for part in SURFACE.split(","))
    given |= change
    text = ",".join(f"{name}={word}" for name, word in given.items() if word)
    with pytest.raises(SetupError) as caught:
        new.from_magnets(text, "x")
    assert str(caught.value).startswith(line) and "\n" not in str(caught.value)


@pytest.mark.parametrize("displacement_deg", ["0", "30", "60"])
@pytest.mark.parametrize(
    "option, data",
    [
        ("--magnets", SURFACE),
        ("--circuit", "pole_pairs=2,rs_ohm=1.8,rr_ohm=2,lls_H=10e-3,llr_H=15e-3,lm_H=284e-3,"
         "current_A=6,vdc_V=300"),
        ("--nameplate", "power_kW=7.5,voltage_V=400,current_A=7.8,frequency_Hz=50,speed_rpm=1455,"
         "poles=4"),
    ],
)  # fmt: skip
def test_the_sets_may_be_0_or_60_degrees_apart(tmp_path, option, data, displacement_deg):
    """The scheme is one that drives them, and check finds it ready."""
    file = str(tmp_path / "mine.toml")
    assert main(["new", file, option, f"{data},displacement_deg={displacement_deg}"]) == 0
    setup = setups.load(file)
    assert setup["machine.displacement_deg"] == displacement_deg
    assert setup.parameter("displacement_deg") == displacement_deg
    scheme = setup["controller.scheme"]
    findings = review.review(setup, [scheme])
    assert review.ready_of(findings, [scheme]) == [scheme]


def test_sets_45_degrees_apart_are_refused_in_a_line():
    with pytest.raises(SetupError, match="displacement_deg = '45': choose one of 30, 0, 60"):
        new.from_magnets(SURFACE + ",displacement_deg=45", "x")


def test_inductances_that_are_exchanged_are_named(tmp_path, capsys):
    file = tmp_path / "mine.toml"
    exchanged = INTERIOR.replace("6.4e-3", "20e-3")
    assert main(["new", str(file), "--magnets", exchanged]) == 2
    line = "hexatorque: ld_H = 0.02, lq_H = 0.0174: L_d may not be above L_q"
    assert capsys.readouterr().err.startswith(line)
    assert main(["new", str(file), "--magnets", INTERIOR, "--circuit", INTERIOR]) == 2
    assert "give one list" in capsys.readouterr().err and not file.exists()


def test_an_inductance_in_mH_and_a_speed_above_the_ceiling_are_named(tmp_path, capsys):
    file = str(tmp_path / "mine.toml")
    assert main(["new", file, "--magnets", SURFACE.replace("e-3", "")]) == 2
    assert "ld_H = 2.1 H, which is 2100 mH: check it" in capsys.readouterr().err
    assert main(["new", file, "--magnets", SURFACE + " speed_rpm=3000"]) == 0
    assert "raise inverter.vdc_V" in capsys.readouterr().out.splitlines()[0]
    fast = setups.load(file)
    verdicts = {f.subject: f for f in review.review(fast, [])}
    trip = verdicts["rated speed against the trip"]
    assert trip.verdict == "bad" and trip.advice.startswith("raise inverter.vdc_V")


@pytest.mark.parametrize("lxy_share", new.LXY_OF_LD_RANGE)
@pytest.mark.parametrize("sheet", [SURFACE, INTERIOR])
def test_a_drive_that_knows_the_sheet_alone_drives_another_machine(sheet, lxy_share):
    """The magnets are 5 % weaker than on the sheet, as warm ones are, R_s is 25 % larger, L_d and
    L_q are 10 % off; the voltage has harmonics, and L_xy is at an end of its range."""
    text, scheme, *_ = new.with_best_scheme(new.from_magnets(sheet, "x"), "x")
    assert scheme
    believed = setups.parse(text, "x")
    values = setups.parameters(believed)
    known = {f"controller__{n}": v for n, v in values.items() if n not in keys.TIMING_OWNS}
    ld_H, lq_H = believed["machine.ld_H"], believed["machine.lq_H"]
    true = believed.changed(
        **known,
        machine__psi_f_Wb=0.95 * believed["machine.psi_f_Wb"],
        machine__rs_ohm=1.25 * believed["machine.rs_ohm"],
        machine__ld_H=1.1 * ld_H,
        machine__lq_H=(0.9 if lq_H > ld_H else 1.1) * lq_H,
        machine__lxy_H=lxy_share * ld_H,
        machine__emf_share=(0.03, 0.02, 0.01, 0.005),
        machine__start_deg=200.0,
    )
    assert accept(true).state == "idle"


@pytest.mark.parametrize("sheet", [SURFACE, INTERIOR])
def test_harmonics_that_a_sheet_does_not_tell_are_no_lost_leg(sheet):
    """The residual passes a low pass of 2 ms. 5 % of fifth and 3 % of seventh harmonic, in phase,
    stay below 0.6 of the limit behind it, at every speed."""
    untold = setups.parse(new.from_magnets(sheet, "x"), "x")
    limit_V = untold["controller.loss_check"] * untold["controller.vdc_max_V"]
    omega = np.geomspace(1.0, 5000.0, 200)
    fifth, seventh = (
        share * untold["machine.psi_f_Wb"] * omega / np.hypot(1, order * omega * 2e-3)
        for share, order in ((0.05, 5), (0.03, 7))
    )
    assert (fifth + seventh).max() < 0.6 * limit_V


def test_harmonics_that_are_told_need_no_room():
    untold = setups.parse(new.from_magnets(SURFACE, "x"), "x")
    told = untold.changed(machine__emf_share=(0.05, 0.03, 0, 0))
    assert told["controller.loss_check"] < 0.8 * untold["controller.loss_check"]


@pytest.fixture
def salient():
    """A drive and its best current to align the rotor with. T = 3 P (psi_f + (L_d - L_q) i_d) i_q:
    with i_d above psi_f/(L_q - L_d) the rotor turns away from the current, and the shaft is held
    best with half of it."""
    sheet = INTERIOR.replace("current_A=4.6", "current_A=8")
    setup = setups.parse(new.from_magnets(sheet, "x"), "x")
    saliency_H = setup["machine.lq_H"] - setup["machine.ld_H"]
    return setup, 0.5 * setup["machine.psi_f_Wb"] / saliency_H


def test_the_aligning_current_is_the_best_one(salient):
    setup, best_A = salient
    assert setup["controller.build_current_A"] == pytest.approx(best_A, rel=1e-3)


def test_the_aligning_current_leaves_room_for_the_step_of_a_period(salient):
    """Under immediate load it comes on top of the regulated current."""
    setup, best_A = salient
    steps = setup.changed(timing__latency="none", controller__scheme="ddr")
    step_A = 0.6 * steps["inverter.vdc_V"] / steps["controller.f_isr_Hz"] / steps["machine.ld_H"]
    rated_A = Design(steps, steps.parameter).current_A(steps["rated.torque_Nm"])
    most_A = max(best_A - step_A, 0.1 * rated_A)
    assert steps["controller.build_current_A"] == pytest.approx(most_A, rel=0.03)


def test_check_says_that_an_aligning_current_turns_the_rotor_away(salient):
    setup, best_A = salient
    high = setup.changed(controller__build_current_A=1.7 * best_A)
    subject = "current that aligns the rotor, and its ripple, which must not turn the q axis there"
    found = [f.verdict for f in review.review(high, ["foc"]) if f.subject == subject]
    assert found == ["bad"]


HOLDS = "torque that holds the rotor while it is aligned"
DRY = {"load.kind": "friction", "point.load_Nm": 1.0, "controller.build_current_A": 0.6}


def holds(setup):
    return [f for f in review.review(setup, ["foc"]) if f.subject == HOLDS]


@pytest.mark.parametrize(
    "changes",
    [
        DRY,
        {"load.holding_Nm": 1.0, "controller.build_current_A": 0.6},
        {"profile.load_Nm": [[0, 1.0]], "load.kind": "friction", "controller.build_current_A": 0.6},
    ],
)
def test_check_says_that_an_aligning_current_does_not_beat_friction_or_a_brake(changes):
    """0.6 A pull surface magnets with 3 P psi_f i sin 30 = 0.33 N m. The named current leaves a
    rotor against 1 N m within 10 degrees: 3 P psi_f i sin 10."""
    setup = setups.load("magnet-surface").changed(changes)
    (found,) = holds(setup)
    pull_Nm = 3 * 5 * 0.0734 * 0.6 * 0.5
    assert found.verdict == "bad" and found.value == 1.0
    assert found.limit == pytest.approx(pull_Nm, rel=1e-3)
    least_A = 1 / (3 * 5 * 0.0734 * math.sin(math.radians(10)))
    assert f"build_current_A = {math.ceil(100 * least_A) / 100:g} at least" in found.advice
    (found,) = holds(setup.changed(controller__build_current_A=1.01 * least_A))
    assert found.verdict == "ok"
    (found,) = holds(setup.changed(controller__build_current_A=0.5 * least_A))
    assert found.verdict == "note"
    assert holds(setup.changed(controller__rotor_start="known")) == []


def test_a_rotor_that_friction_holds_too_much_for_every_current_is_told_another_start():
    setup = setups.load("magnet-interior").changed({**DRY, "point.load_Nm": 20.0})
    (found,) = holds(setup)
    assert found.verdict == "bad" and found.advice.startswith("no current within the limits")
    assert "controller.rotor_start" in found.advice


def test_a_current_that_friction_beats_is_refused_by_the_drive():
    """The same case, simulated: the encoder does not show the movement."""
    changes = {**DRY, "machine.start_deg": -170.0, "controller.scheme": "ddr"}
    drive = SimulatedDrive(setups.load("magnet-surface").changed(changes), 1)
    drive.set("load_Nm", 1.0)
    started(drive)
    assert drive.faults == ["encoder against flux speed"]


@pytest.mark.parametrize("name", ["magnet-surface", "magnet-interior", "magnet-24v"])
def test_nothing_holds_the_rotor_of_a_built_in_machine(name):
    assert holds(setups.load(name)) == []


def test_a_load_that_drops_does_not_take_a_light_shaft_to_the_speed_trip():
    """Near the speed at which no current may flow the room is small. With 60 % of the stated
    inertia the speed loop's double pole at w/2 lets the speed rise by (2/e) T/(0.6 J w)."""
    sheet = SURFACE.replace("inertia_kgm2=0.03", "inertia_kgm2=0.003")
    setup = setups.parse(new.from_magnets(sheet, "x"), "x")
    design = Design(setup, setup.parameter)

    def peak_rpm(f_slow_Hz):
        corner = 2 * math.pi * f_slow_Hz / 30
        rise = 2 / math.e * design.rated_Nm / (0.6 * setup["machine.inertia_kgm2"] * corner)
        return design.rated_rpm + rise * 30 / math.pi

    chosen, trip_rpm = setup["controller.f_slow_Hz"], setup["controller.speed_trip_rpm"]
    lower = {200: 100, 500: 200, 1000: 500}[chosen]
    assert peak_rpm(chosen) < trip_rpm < peak_rpm(lower)
    slow = setup.changed(controller__f_slow_Hz=lower)
    subject = "speed when the rated load drops"
    found = [f for of in (setup, slow) for f in review.review(of, []) if f.subject == subject]
    assert [f.verdict for f in found] == ["ok", "bad"]
    assert found[1].value == pytest.approx(peak_rpm(lower), rel=1e-3)


def test_what_a_scheme_that_leaves_xy_alone_lets_flow_there():
    """A fifth harmonic of 5 %, which no sheet tells, drives E over |R + 5 j omega L_xy|."""
    setup = setups.parse(new.from_magnets(SURFACE, "x"), "x")
    design = Design(setup, setup.parameter)
    omega = design.machine.pole_pairs * design.rated_rpm * math.pi / 30
    ohm = math.hypot(5 * omega * design.machine.lxy_H, design.machine.rs_ohm)

    def peak_A(of):
        (found,) = (f.value for f in review.review(of, ["dtc1"]) if f.subject == review.PEAK)
        return found

    without = setup.changed(machine__emf_share=(1e-9, 0, 0, 0))
    expected = 0.05 * omega * design.machine.psi_f_Wb / ohm
    assert peak_A(setup) - peak_A(without) == pytest.approx(expected, rel=1e-3)


def test_a_scheme_near_the_trip_is_not_the_best_one():
    findings = review.review(setups.parse(new.from_magnets(SURFACE, "x"), "x"), ["dtc2", "foc"])
    assert review.best(findings, ["dtc2", "foc"])[0]
    for scheme, other in (("dtc2", "foc"), ("foc", "dtc2")):
        near = [f for f in findings if (f.scheme, f.subject) != (scheme, review.PEAK)]
        near.append(replace(findings[0], scheme=scheme, subject=review.PEAK, value=0.9, limit=1.0))
        near = [f for f in near if not f.subject.startswith(review.MEAN_PCT)]
        near = [f for f in near if f.verdict != "note"]
        assert review.best(near, ["dtc2", "foc"])[0] == other
