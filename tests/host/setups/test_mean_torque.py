"""The mean torque that `check` foresees under a switching table, and the scheme that it finds
best."""

import math
import re

import pytest

from hexatorque import firmware, setups
from hexatorque.cli.main import main
from hexatorque.experiments.operating_points import Point, measure_all
from hexatorque.setups import SetupError, new
from hexatorque.setups.design import Design
from hexatorque.setups.mean_torque import held
from hexatorque.setups.review import MEAN_NM, MEAN_PCT, SWITCHES, best, review

PLATE = "power_kW=5.5,voltage_V=400,current_A=5.9,power_factor=0.8,frequency_Hz=50,speed_rpm=1450"
PLATE += ",poles=4"
#: A machine of so little x-y inductance that 10 kHz is too slow for the laws that predict.
RESISTIVE = "pole_pairs=2,rs_ohm=2.5,rr_ohm=2,lls_H=0.01,llr_H=0.015,lm_H=0.284,lxy_H=1e-3"
RESISTIVE += ",current_A=5,vdc_V=300"
SCHEMES = firmware.schemes()


def error_of(setup, speed_rpm, load_Nm):
    values = setups.parameters(setup)
    controller = firmware.Controller(setup["timing.device"], values)
    return held(Design(setup, values.__getitem__), controller, speed_rpm, load_Nm)


#: A band of some steps of one period.
WIDE = {"controller__f_isr_Hz": 40e3, "controller__torque_band_Nm": 4.0}


@pytest.mark.parametrize("load_Nm", (6.0, -6.0))
def test_between_wide_bands_the_mean_is_in_their_middle(load_Nm):
    """Three levels: a motor's torque rises to the reference, then falls under zero vectors until it
    is a band below. A saw between these has its mean in the middle, half a band below. A brake's
    torque too moves between the reference and one side of it: zero vectors turn the rotor away from
    the flux, which brakes more. With the release half a band beyond the reference the middle is a
    quarter of a band below. Two levels have a band around the reference."""
    setup = setups.load("small-2kw").changed(
        controller__scheme="fdr", load__kind="constant", **WIDE
    )
    found = error_of(setup, 1400.0, load_Nm)
    step_Nm = Design(setup, setups.parameters(setup).__getitem__).torque_step_Nm(1 / 40e3)
    sign = math.copysign(1.0, load_Nm)
    assert found.error_Nm == pytest.approx(-sign * 2.0, abs=0.3 * step_Nm)
    assert found.asked_Nm + sign * found.error_Nm == pytest.approx(load_Nm, abs=0.1)
    beyond = error_of(setup.changed(controller__torque_release_Nm=-2.0), 1400.0, load_Nm)
    assert beyond.error_Nm == pytest.approx(-sign * 1.0, abs=0.3 * step_Nm)
    two = setup.changed(controller__torque_levels="2")
    assert abs(error_of(two, 1400.0, load_Nm).error_Nm) < abs(found.error_Nm) / 2


def test_without_a_load_there_is_no_percentage():
    assert math.isnan(mean_pct(0.0)) and mean_pct(-8.0) == 50


def mean_pct(asked_Nm):
    from hexatorque.setups.mean_torque import Held

    return Held(4.0, asked_Nm).error_pct


def test_it_is_what_the_simulated_drive_holds():
    """The drive has an observer, dead time, x-y currents and a speed loop; the model has not."""
    base = setups.load("small-2kw")
    points = [Point(base.with_scheme(name), 1425.0, 3.35) for name in ("dtc3", "ddr-ml")]
    for point, run in zip(points, measure_all(points)):
        foreseen = error_of(point.setup, point.speed_rpm, point.load_Nm)
        assert foreseen.error_Nm == pytest.approx(run.metrics["torque_error_Nm"], rel=0.15)
        assert run.metrics["torque_error_pct"] < -10


def test_check_states_it_for_every_scheme():
    found = review(setups.load("small-2kw"), SCHEMES)
    errors = {f.scheme: f for f in found if f.subject.startswith(f"{MEAN_NM}, at ")}
    assert set(errors) == set(SCHEMES)
    modulated = {name for name in SCHEMES if firmware.needs_prediction(name)}
    assert {name for name, f in errors.items() if f.value == 0} == modulated
    notes = [f for f in found if f.subject.startswith(MEAN_PCT) and f.verdict == "note"]
    assert {f.scheme for f in notes} == set(SCHEMES) - modulated
    assert all("or take db-dtfc or foc or foc-24" in f.advice for f in notes)


def test_a_leg_of_a_modulated_scheme_toggles_once_a_period():
    """Six transitions a period, over twelve: half of the sampling frequency."""
    found = review(setups.load("small-2kw"), ["foc"], steady=False)
    (f_sw,) = [f.value for f in found if f.subject == SWITCHES]
    assert f_sw == 0.5 * setups.load("small-2kw").parameter("f_isr_Hz")


# -- the best scheme ----------------------------------------------------------------------------


def test_the_best_scheme_is_ready_and_no_other_has_fewer_notes():
    for name in ("small-2kw", "large-110kw", "paper-a-feasible"):
        found = review(setups.load(name), SCHEMES)
        first, why = best(found, SCHEMES)
        notes = {s: sum(f.scheme == s and f.verdict == "note" for f in found) for s in SCHEMES}
        bad = {f.scheme for f in found if f.verdict == "bad"}
        assert first not in bad
        assert notes[first] == min(n for s, n in notes.items() if s not in bad)
        assert re.match(r"best of \d that are ready: ", why)


def test_a_set_up_that_is_bad_for_all_has_no_best_scheme():
    wrong = setups.load("small-2kw").changed(
        point__speed_rpm=4000.0, controller__speed_trip_rpm=4100.0
    )
    assert best(review(wrong, SCHEMES), SCHEMES) == ("", "")


def test_new_writes_the_best_scheme_and_says_why(tmp_path, capsys):
    file = tmp_path / "mine.toml"
    assert main(["new", str(file), "--nameplate", PLATE]) == 0
    said = capsys.readouterr().out
    setup = setups.load(file)
    first, why = best(review(setup, SCHEMES), SCHEMES)
    assert setup.parameter("scheme") == first
    assert f"scheme {first}: {why}\n" in said and f"# {why}\n" in file.read_text()
    assert main(["check", str(file)]) == 0
    assert f"--schemes {first}," in " ".join(capsys.readouterr().out.split())


# -- sampling -----------------------------------------------------------------------------------


@pytest.mark.parametrize("resistance", (1.0, 2.5, 4.0, 40.0))
def test_no_scheme_is_refused_that_20_kHz_would_allow(resistance):
    """Five periods in the shortest time constant of a current, by the firmware's own formula."""
    text = RESISTIVE.replace("rs_ohm=2.5", f"rs_ohm={resistance}")
    setup = setups.parse(new.from_circuit(text, "x"), "x")
    names = ("rs_ohm", "sigma_ls_H", "lxy_H")
    least_Hz = firmware.lib.ht_voltage_law_least_Hz(*map(setup.parameter, names))
    f_isr_Hz = setup.parameter("f_isr_Hz")
    if least_Hz <= 20e3:
        assert f_isr_Hz >= least_Hz
        setup.with_scheme("db-dtfc")
    else:
        with pytest.raises(SetupError, match="db-dtfc allows"):
            setup.with_scheme("db-dtfc")


def test_a_chip_that_writes_too_late_keeps_10_kHz():
    setup = setups.parse(new.from_circuit(RESISTIVE, "x"), "x")
    assert setup.parameter("f_isr_Hz") == 20e3
    assert setup.changed(timing__isr_us=42.0).parameter("f_isr_Hz") == 10e3


def test_advice_says_where_faster_sampling_makes_a_scheme_ready():
    setup = setups.load("small-2kw").changed(controller__f_isr_Hz=10e3)
    found = [f for f in review(setup, SCHEMES) if f.verdict == "bad"]
    faster = review(setup.changed(controller__f_isr_Hz=20e3), SCHEMES, steady=False)
    still = {f.scheme for f in faster if f.verdict == "bad"}
    assert found
    for f in found:
        told = f"set controller.f_isr_Hz = 20000: {f.scheme} is ready then" in f.advice
        assert told == (f.scheme not in still)
