"""Published machines, and what a plate alone says of a machine like them."""

import math
from dataclasses import replace
from functools import cache

import pytest

from hexatorque.setups import SetupError, estimate, new
from hexatorque.setups.nameplate import FRICTION, IRON
from hexatorque.setups.published import Line, machines, through

PRINTED = [m for m in machines() if m.current_A and m.power_kW]


def test_every_machine_has_a_source_and_no_one_is_twice():
    assert all(m.source and m.name for m in machines())
    assert len({(m.rs_ohm, m.rr_ohm, m.lm_H) for m in machines()}) == len(machines()) >= 64


@pytest.mark.parametrize("machine", PRINTED, ids=lambda machine: machine.name)
def test_a_circuit_draws_the_current_that_its_plate_prints(machine):
    """A digit typed wrong, or the unit of another column, would show."""
    slip = machine.slip_at(1e3 * machine.power_kW, IRON.value, FRICTION.value)
    shaft_W, current_A, factor = machine.load(slip, IRON.value, FRICTION.value)
    assert shaft_W == pytest.approx(1e3 * machine.power_kW, rel=1e-3)
    assert current_A == pytest.approx(machine.current_A, rel=0.12)
    if machine.power_factor:
        assert factor == pytest.approx(machine.power_factor, abs=0.04)


def test_equal_leakages_are_the_same_machine_from_outside():
    for machine in machines():
        rr_ohm, leakage_H, lm_H = machine.equal_leakages
        like = replace(machine, rr_ohm=rr_ohm, lls_H=leakage_H, llr_H=leakage_H, lm_H=lm_H)
        for slip in (0.01, 0.1):
            assert like.load(slip, 0.2, 0.1) == pytest.approx(machine.load(slip, 0.2, 0.1))


def test_odd_machines_do_not_draw_a_line_away():
    law = Line(0.05, -0.3)
    points = [(power, law.at(power)) for power in (1, 3, 7, 20, 50, 110)]
    line = through([*points, (5.0, 10.0), (80.0, 3.0)])
    assert line.at(1.0) == pytest.approx(0.05, rel=0.2) and line.exponent < -0.2
    assert through(points).exponent == pytest.approx(-0.3)


@cache
def held() -> dict[tuple[str, bool], list[bool]]:
    """Whether the range that is stated for a machine holds its true value, where range and
    estimate come from the other machines alone."""
    within: dict[tuple[str, bool], list[bool]] = {}
    for machine in machines():
        others = [other for other in machines() if other is not machine]
        typical, spread = estimate.typical_of(others), estimate.spread_of(others)
        for one in estimate.examples(machine):
            for told, ratios in estimate.ratios(one, typical):
                for name, ratio in ratios.items():
                    factor = spread.factors[name][told]
                    within.setdefault((name, told), []).append(1 / factor <= ratio <= factor)
    return within


@pytest.mark.parametrize("told", (True, False), ids=("with cos phi", "without"))
@pytest.mark.parametrize("name", estimate.RANGED)
def test_the_stated_range_holds_machines_that_were_left_out(name, told):
    cases = held()[name, told]
    assert len(cases) > 1.8 * len(machines())  # few plates are refused
    assert sum(cases) >= 0.9 * len(cases)


@pytest.mark.parametrize("errors_of", (estimate.inertia_errors, estimate.speed_errors))
def test_the_ranges_of_inertia_and_speed_hold_machines_that_were_left_out(errors_of):
    errors = errors_of(machines())
    within = []
    for k, error in enumerate(errors):
        factor = estimate.next_within(errors[:k] + errors[k + 1 :])
        within.append(1 / factor <= error <= factor)
    assert sum(within) >= 0.9 * len(within) >= 0.9 * 39


def test_a_circuit_tells_for_which_speed_it_was_wound():
    """The published circuits on the dc link that their voltage needs. The inertia goes with the
    square of the speed. Of the same machines for eight times the frequency, with an eighth of the
    inductances, it is a 64th."""
    within = []
    for machine in machines():
        one = estimate.examples(machine)[0]
        plate, circuit = one.plate, one.circuit
        known = {
            "pole_pairs": plate.pole_pairs, "rr_ohm": circuit.rr_ohm, "lls_H": circuit.lls_H,
            "llr_H": circuit.llr_H, "lm_H": circuit.lm_H, "current_A": plate.current_A,
            "vdc_V": new.suggestion("vdc_V", {"voltage_V": plate.voltage_V}),
        }  # fmt: skip
        by_circuit = new.suggestion("inertia_kgm2", known)
        told = new.suggestion("inertia_kgm2", {**known, "speed_rpm": plate.speed_rpm})
        ratio, factor = math.sqrt(told / by_circuit), estimate.spread().speed
        within.append(1 / factor < ratio < factor)
        quick = {n: known[n] / 8 for n in ("lls_H", "llr_H", "lm_H")}
        of_400_Hz = new.suggestion("inertia_kgm2", {**known, **quick})
        assert of_400_Hz == pytest.approx(by_circuit / 64, rel=0.06)
    assert sum(within) >= 0.9 * len(within)


def test_rated_torque_and_flux_tell_the_speed_too():
    """4.24 kW at 1450 r/min: the usual product of efficiency and power factor, 27.9 N m, and with
    the voltage left of 600 V at most 1.03 Wb."""
    known = {
        "pole_pairs": 2, "rr_ohm": 0.9, "lls_H": 1e-3, "llr_H": 1e-3, "lm_H": 0.03,
        "current_A": 4.27, "vdc_V": 600.0,
    }  # fmt: skip
    by_speed = new.suggestion("inertia_kgm2", {**known, "speed_rpm": 1450.0})
    for more in ({"torque_Nm": 27.9}, {"flux_Wb": 1.03}):
        found = new.suggestion("inertia_kgm2", {**known, **more})
        assert found == pytest.approx(by_speed, rel=0.06), more
    assert new.suggestion("inertia_kgm2", known) < 0.1 * by_speed


def test_the_power_factor_narrows_the_resistance():
    factors = estimate.spread().factors["rs_ohm"]
    assert factors[True] < 0.9 * factors[False]


def test_the_inertia_follows_from_the_energy():
    """At four times the speed the same energy is in a sixteenth of the inertia."""
    slow, fast = (estimate.rotor_kgm2(10.0, speed) for speed in (1500.0, 6000.0))
    assert slow / fast == pytest.approx(16)
    text = "power_kW=200,voltage_V=690,current_A=106,frequency_Hz=200,speed_rpm=5960,poles=4"
    written = new.from_nameplate(text, "x")
    inertia = float(written.split("inertia_kgm2 = { value = ")[1].split(",")[0])
    energy_J = 0.5 * inertia * (6000 * math.pi / 30) ** 2
    assert energy_J / 200e3 < 1.5  # seconds of rated power


def test_a_plate_without_power_factor_says_so():
    plate = "power_kW=5.5,voltage_V=400,current_A=5.9,frequency_Hz=50,speed_rpm=1450,poles=4"
    assert "cos phi on the plate" in new.from_nameplate(plate, "x")
    assert "cos phi on the plate" not in new.from_nameplate(f"{plate},power_factor=0.79", "x")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"voltage_V": "5.9", "current_A": "400"}, ("voltage_V = 5.9", "exchanged?")),
        ({"current_A": "11.8", "phases": "6"}, ("current_A = 11.8", "current_A = 5.3")),
        ({"speed_rpm": "1498"}, ("speed_rpm = 1498", "slip of 0.13 %", "speed_rpm = 1445")),
        ({"speed_rpm": "1200"}, ("speed_rpm = 1200", "slip of 20 %", "4 poles")),
        ({"poles": "2"}, ("speed_rpm = 1450", "2 poles", "3000")),
        ({"frequency_Hz": "60"}, ("speed_rpm = 1450", "60 Hz", "slip of 19 %")),
        ({"power_kW": "55"}, ("55 kW", "below 0.98")),
    ],
)
def test_a_number_that_cannot_be_is_named_in_one_line(change, words):
    given = {
        "power_kW": "5.5",
        "voltage_V": "400",
        "current_A": "5.9",
        "frequency_Hz": "50",
        "speed_rpm": "1450",
        "poles": "4",
    } | change
    with pytest.raises(SetupError) as error:
        new.from_nameplate(",".join(f"{n}={v}" for n, v in given.items()), "x")
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("change", "typed", "fits"),
    [
        # A number ten, a hundred or a thousand times as large or small.
        ({"voltage_V": "40"}, "40 V", ("voltage_V = 400?",)),
        ({"voltage_V": "4000"}, "4000 V", ("voltage_V = 400?",)),
        ({"current_A": "0.59"}, "0.59 A", ("current_A = 5.9 or power_kW = 0.55?",)),
        ({"power_kW": "5500"}, "5500 kW", ("power_kW = 5.5?",)),
        ({"frequency_Hz": "500"}, "500 Hz", ("frequency_Hz = 50?",)),
        ({"speed_rpm": "145"}, "speed_rpm = 145", ("speed_rpm = 1450 or poles = 40?",)),
        ({"poles": "6"}, "6 poles", ("poles = 4?",)),
        ({"power_factor": "80"}, "power_factor = 80", ("0 .. 1", "0.8?")),
        ({"efficiency": "87"}, "efficiency = 87", ("0 .. 1", "0.87?")),
        ({"vdc_V": "6000"}, "vdc_V = 6000", ("up to 1890 V", "600?")),
        # No power of ten helps.
        ({"voltage_V": "230"}, "230 V", ("below 0.98", "current_A = 9.24 would fit")),
        (
            {"power_factor": "0.08"},
            "efficiency of 8.41",
            ("power_factor", "0.699 .. 0.97 would fit"),
        ),
        ({"vdc_V": "60"}, "0.5", ("inverter.vdc_V (581 V",)),
    ],
)
def test_a_mistyped_number_is_named_with_the_one_that_fits(change, typed, fits):
    """581 V: the flux of the plate turns at its speed, within 0.9/sqrt 3 of the link."""
    given = {
        "power_kW": "5.5",
        "voltage_V": "400",
        "current_A": "5.9",
        "power_factor": "0.8",
        "frequency_Hz": "50",
        "speed_rpm": "1450",
        "poles": "4",
    } | change
    with pytest.raises(SetupError) as error:
        text = new.from_nameplate(",".join(f"{n}={v}" for n, v in given.items()), "x")
        new.with_best_scheme(text, "x")
    assert "\n" not in str(error.value)
    for word in (typed, *fits):
        assert word in str(error.value)


@pytest.mark.parametrize("machine", machines(), ids=lambda machine: machine.name)
def test_no_published_plate_is_taken_for_a_mistyped_one(machine):
    """And each is asked about by its own number if one is ten times as large."""
    plate = estimate.examples(machine)[0].plate
    estimate.estimate(plate)
    for name in ("voltage_V", "current_A"):
        number = float(f"{getattr(plate, name):.4g}")
        wrong = replace(plate, **{name: 10 * number})
        large = plate.power_kW >= 100 and wrong.voltage_V == 4000
        if large or wrong.voltage_V in (240, 2200):  # many machines have this, or a tenth
            continue
        with pytest.raises(SetupError, match=rf"did you mean .*{name} = {number:g}\b"):
            estimate.estimate(wrong)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            new.from_circuit,
            "pole_pairs=2,rs_ohm=1.1,rr_ohm=0.9,lls_H=7e-3,llr_H=7e-3,lm_H=0.21,"
            "current_A=600,vdc_V=5.9",
        ),
        (
            new.from_magnets,
            "poles=10,ke_V=47,rs_ohm=1.1,ld_H=2.1e-3,inertia_kgm2=0.03,current_A=60,vdc_V=3.5",
        ),
    ],
)
def test_voltage_and_current_that_are_exchanged_are_named(make, text):
    with pytest.raises(SetupError) as error:
        new.with_best_scheme(make(text, "x"), "x")
    given = dict(part.split("=") for part in text.split(","))
    current, volts = given["current_A"], given["vdc_V"]
    words = f"are rated.current_A = {current} and inverter.vdc_V = {volts} exchanged?"
    assert all(words in line for line in str(error.value).split("\n"))
