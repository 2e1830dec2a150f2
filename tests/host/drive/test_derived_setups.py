"""Set-ups whose controller is derived drive their machines, and `check` knows which ones do."""

import math

import numpy as np
import pytest
from campaigns import part

from hexatorque import firmware, setups
from hexatorque.drive.simulated import DriveFault, SimulatedDrive
from hexatorque.experiments.acceptance import accept
from hexatorque.experiments.operating_points import NotReached, Point, measure_all
from hexatorque.setups import new
from hexatorque.setups.design import PULL_OUT_SHARE, Design, rad_s
from hexatorque.setups.review import review

NAMES = ("small-2kw", "large-110kw", "paper-a-feasible", "paper-b")
CASES = [(name, scheme) for name in NAMES for scheme in firmware.schemes()]
#: Each of these is refused by `check`: over-current, and too little voltage.
BAD = [("small-2kw", "dtc1"), ("large-110kw", "dtc1"), ("paper-a-feasible", "ddr-ml")]


def loaded(name, scheme):
    return setups.load(name).with_scheme(scheme)


def verdicts(setup, scheme):
    return {f.verdict for f in review(setup, [scheme])}


@pytest.mark.parametrize(("name", "scheme"), part([c for c in CASES if c not in BAD], 6))
def test_what_check_allows_starts_turns_reverses_and_stops(name, scheme):
    setup = loaded(name, scheme)
    if "bad" in verdicts(setup, scheme):
        pytest.skip("check says that it may not")
    assert accept(setup).state == "idle"


@pytest.mark.parametrize(("name", "scheme"), part(BAD, 2))
def test_what_check_calls_bad_does_not(name, scheme):
    setup = loaded(name, scheme)
    assert "bad" in verdicts(setup, scheme)
    with pytest.raises((DriveFault, NotReached)):
        accept(setup)


def test_few_are_called_bad():
    """Or the tests above would say little."""
    bad = [c for c in CASES if "bad" in verdicts(loaded(*c), c[1])]
    assert set(BAD) <= set(bad) and len(bad) <= len(BAD) + 1


def fast_shaft(scheme):
    """5.5 kW with a fifth of the inertia of a usual motor: it reverses within 26 ms."""
    plate = "power_kW=5.5,voltage_V=400,current_A=5.9,power_factor=0.8,frequency_Hz=50"
    plate += ",speed_rpm=1450,poles=4,inertia_kgm2=0.004"
    return setups.parse(new.from_nameplate(plate, "fast"), "fast").with_scheme(scheme)


@pytest.mark.parametrize("scheme", ("db-dtfc", "ddr", "foc"))
def test_a_shaft_that_reverses_within_the_time_of_the_encoders_check(scheme):
    """Its encoder is in order, out of weakening too."""
    setup = fast_shaft(scheme)
    limit_Nm = setup.parameter("torque_limit_Nm")
    assert rad_s(2 * 1450) / (limit_Nm / setup["machine.inertia_kgm2"]) < 0.05
    assert accept(setup, ((1.3, 0), (-1, 0), (1.3, 0), (-1.3, 0), (1, 0.5), (-1, 0.5))).state


@pytest.mark.parametrize("scheme", ("db-dtfc", "ddr"))
def test_an_encoder_that_stops_on_a_light_shaft_is_found(scheme):
    """The mean of 50 ms is above the limit when it has seen the shaft's speed for -50 ms times
    ln(1 - limit/speed), at the latest: the shaft runs away from its reference meanwhile."""
    setup = fast_shaft(scheme)
    sim = SimulatedDrive(setup.changed(load__kind="constant"), 1)
    sim.start()
    sim.run(0.8, record=False)
    speed_rpm, slow_s = 1000, 1 / setup.parameter("f_slow_Hz")
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(1.0, record=False)
    sim.sensors.hold[7] = 1
    latest_s = -0.05 * math.log(1 - setup.parameter("encoder_trip_rpm") / speed_rpm)
    sim.run(latest_s + 2 * slow_s, record=False)
    assert sim.faults == ["encoder against flux speed"]


#: Set-ups, schemes, and shares of the rated speed and torque.
LOW_SIGMA = [
    (name, scheme, share, load)
    for name in ("small-2kw", "large-110kw")
    for scheme in ("fdr", "ddr", "ddr-ml")
    for share, load in ((0.05, 1), (0.1, -1), (0.5, 1))
]


def test_the_observer_holds_the_flux_of_machines_of_low_sigma():
    """True flux within 2 % of its reference, with dead time, down to a twentieth of rated speed."""
    cases = part(LOW_SIGMA, 4)
    points = []
    for name, scheme, share, load in cases:
        setup = setups.load(name).with_scheme(scheme, load__kind="constant")
        design = Design(setup, setups.parameters(setup).__getitem__)
        points.append(Point(setup, share * design.rated_rpm, load * design.rated_Nm))
    for case, point, run in zip(cases, points, measure_all(points)):
        assert not isinstance(run, Exception), (case, run)
        reference_Wb = point.setup.parameter("flux_ref_Wb")
        assert run.metrics["flux_Wb"] == pytest.approx(reference_Wb, rel=0.02), case


def test_a_build_up_of_a_third_of_the_rotors_time_is_no_wrong_flux():
    """The rotor of the large machine takes 0.86 s. After 0.3 s its flux still rises, and the drive
    runs on."""
    setup = setups.load("large-110kw").changed(controller__build_s=0.3, controller__flux_check=0.7)
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(2.0, record=False)
    sim.check()
    assert sim.state == "run"


@pytest.mark.parametrize("name", ("paper-a-feasible", "large-110kw"))
def test_the_most_torque_of_a_weak_field(name):
    """Stator and rotor solved as coils, at the flux that the result stands for: the torque is the
    firmware's share of the most over all slips, and the voltage is what was allowed."""
    setup = setups.load(name)
    d = Design(setup, setups.parameters(setup).__getitem__)
    m, speed_rpm = d.machine, 2 * d.rated_rpm
    voltage_V = 0.5 * d.vdc_V
    torque_Nm = d.most_torque_Nm(speed_rpm, voltage_V)
    psi = d.flux_Wb * math.sqrt(torque_Nm / (PULL_OUT_SHARE * d.pull_out_Nm))
    assert psi < d.flux_Wb

    def solved(slip):
        coils = [[m.ls_H, m.lm_H], [1j * slip * m.lm_H, m.rr_ohm + 1j * slip * m.lr_H]]
        i = np.linalg.solve(coils, [psi, 0])[0]
        return i, 3 * m.pole_pairs * psi * i.imag

    slips = np.linspace(0.01, 3, 3000) / (d.sigma * d.rotor_s)
    torques = [solved(slip)[1] for slip in slips]
    top = int(np.argmax(torques))
    assert torque_Nm == pytest.approx(PULL_OUT_SHARE * torques[top], rel=1e-4)
    slip = np.interp(torque_Nm, torques[:top], slips[:top])
    i, _ = solved(slip)
    needed_V = (m.pole_pairs * rad_s(speed_rpm) + slip) * psi + m.rs_ohm * abs(i)
    assert needed_V == pytest.approx(voltage_V, rel=1e-3)


def test_a_shaft_a_tenth_as_heavy_as_assumed_is_held():
    """The same loop of a tenth of the frequency swings: with a tenth of the inertia its corner is
    ten times as high, beyond a third of this frequency."""
    text = "pole_pairs=2,rs_ohm=1.1,rr_ohm=0.9,lls_H=7e-3,llr_H=7e-3,lm_H=0.21"
    setup = setups.parse(new.from_circuit(f"{text},current_A=5.9,vdc_V=600", "x"), "x")
    values = setups.parameters(setup)
    kept = {name: values[name] for name in ("kp_speed_Nms_rad", "ki_speed_Nm_rad", "f_slow_Hz")}
    light = setup.changed(
        {"machine.inertia_kgm2": 0.1 * setup["machine.inertia_kgm2"]},
        **{f"controller__{name}": value for name, value in kept.items()},
    )
    course = ((0.3, 0), (1, 0), (1, 0.5), (0.3, 0))
    accept(light, course)
    with pytest.raises(NotReached):
        accept(light.changed(controller__f_slow_Hz=100.0), course)
    measured = setup.changed(machine__inertia_kgm2=setup["machine.inertia_kgm2"])
    assert measured.parameter("f_slow_Hz") < kept["f_slow_Hz"]
    assert measured.parameter("kp_speed_Nms_rad") == pytest.approx(kept["kp_speed_Nms_rad"])
