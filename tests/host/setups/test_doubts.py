"""What an estimate decides is doubtful: the rules hold for the machine that the file describes, and
for any other one in the range of its estimates that stands in front of the same controller."""

import json
import math
import re

import pytest

from hexatorque import firmware, setups
from hexatorque.cli.main import main
from hexatorque.setups import doubts, new
from hexatorque.setups.design import Design
from hexatorque.setups.keys import MEASURED, TIMING_OWNS
from hexatorque.setups.review import (
    PEAK,
    _scheme,
    _swing_A,
    best,
    outcome,
    ready_of,
    review,
    verdict_of,
)
from hexatorque.setups.values import Value

PLATE = "power_kW=5.5,voltage_V=400,current_A=5.9,power_factor=0.8,frequency_Hz=50,speed_rpm=1450"
PLATE += ",poles=4"
CIRCUIT = "pole_pairs=2,rs_ohm=1.1,rr_ohm=0.9,lls_H=7e-3,llr_H=7e-3,lm_H=0.21,current_A=5.9"
CIRCUIT += ",vdc_V=600"
#: Magnets whose resistance takes a third of the voltage of a 48 V battery.
SHEET = "current_A=1.25,torque_Nm=1.29,rs_ohm=4.38,ld_H=1.91e-3,ke_V=31.6,poles=18"
SHEET += ",inertia_kgm2=4.5e-3,speed_rpm=1018"
SCHEMES = firmware.schemes()
LEAKAGE = ("lls_H", "llr_H", "lxy_H")


@pytest.fixture(scope="module")
def plate():
    return setups.parse(new.from_nameplate(PLATE, "x"), "x")


@pytest.fixture(scope="module")
def findings(plate):
    return review(plate, SCHEMES, steady=False)


def before(setup, **machine):
    """The controller of the set-up in front of another machine."""
    known = {f"controller__{name}": value for name, value in setups.parameters(setup).items()
             if name not in TIMING_OWNS}  # fmt: skip
    return setup.changed(**{f"machine__{key}": v for key, v in machine.items()}, **known)


def stated(text, key):
    """The range in the note that `new` writes."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"{key} = "))
    return [float(word) for word in re.search(r"([\d.e-]+) \.\. ([\d.e-]+)", line).groups()]


def ends(setup):
    d = Design(setup, setup.parameter)
    return {of.keys: [end * setup[f"machine.{of.keys[0]}"] for end in (of.low, of.high)]
            for of in doubts.estimates(d)}  # fmt: skip


def test_the_ends_are_those_that_new_states():
    """L_xy is a share of a leakage: if that is an estimate too, both may be wrong, by chance."""
    text = new.from_circuit(CIRCUIT, "x")
    assert ends(setups.parse(text, "x")) == {
        ("lxy_H",): pytest.approx(stated(text, "lxy_H"), rel=0.01)
    }
    text = new.from_nameplate(PLATE, "x")
    setup = setups.parse(text, "x")
    found = ends(setup)
    assert found.pop(LEAKAGE) == pytest.approx(stated(text, "lls_H"), rel=0.01)
    (low_H, high_H), lxy_H = found.pop(("lxy_H",)), setup["machine.lxy_H"]
    for end_H, own_H, lls_H in zip((low_H, high_H), *(stated(text, k) for k in ("lxy_H", "lls_H"))):
        logs = (math.log(own_H / lxy_H), math.log(lls_H / setup["machine.lls_H"]))
        assert abs(math.log(end_H / lxy_H)) == pytest.approx(math.hypot(*logs), rel=0.02)
    assert not found


def test_what_is_told_leaves_nothing_open(plate, findings):
    assert any(f.verdict == "doubtful" for f in findings)
    told = plate.changed(**{f"machine__{key}": plate[f"machine.{key}"] for key in LEAKAGE})
    assert not ends(told)
    assert all(f.verdict != "doubtful" for f in review(told, SCHEMES, steady=False))
    assert not ends(setups.load("paper-b"))


def test_magnets_may_be_weaker_and_their_winding_warmer_unless_both_were_measured():
    """IEC 60034-1 lets a winding of class F get 105 K warmer than 40 degC. A sheet has R at 20."""
    setup = setups.load("magnet-surface")
    rs_ohm, psi_f_Wb = setup["machine.rs_ohm"], setup["machine.psi_f_Wb"]
    warm_ohm = rs_ohm * (234.5 + 120) / (234.5 + 20)
    assert ends(setup) == {
        ("rs_ohm",): pytest.approx([rs_ohm, warm_ohm], rel=0.01),
        ("psi_f_Wb",): pytest.approx([0.95 * psi_f_Wb, psi_f_Wb]),
    }
    values = {key: Value(setup[f"machine.{key}"], MEASURED) for key in ("rs_ohm", "psi_f_Wb")}
    assert not ends(setup.with_part({"machine": values}))


@pytest.mark.parametrize("vdc_V, verdict", [(55, "bad"), (70, "doubtful"), (80, "ready")])
def test_a_speed_that_only_a_cold_winding_reaches_is_doubtful(vdc_V, verdict):
    setup = setups.parse(new.from_magnets(f"{SHEET},vdc_V={vdc_V}", "x"), "x")
    found = review(setup, ["fdr"])
    assert verdict_of(found, "fdr") == verdict
    if verdict == "doubtful":
        (doubt,) = (f for f in found if f.verdict == "doubtful")
        assert doubt.subject.startswith("torque left") and "machine.rs_ohm" in doubt.where


def test_a_doubt_is_the_rule_before_the_other_machine(plate, findings):
    """At the end of the range, and on either side of the value from which on it runs."""
    seen = 0
    for f in findings:
        if f.verdict != "doubtful":
            continue
        key, end = re.fullmatch(r"machine\.(\w+) = ([\d.e-]+)", f.where).groups() if f.where else (
            "lxy_H", plate["machine.lxy_H"]
        )  # fmt: skip
        least, side = re.match(rf"runs with machine\.{key} = ([\d.e-]+) and (\w+)", f.runs).groups()
        assert doubts.MEASURED_BY in f.advice

        def says(value_H, f=f, key=key):
            keys = (key,) if key == "lxy_H" else LEAKAGE
            factor = value_H / plate[f"machine.{key}"]
            machine = {name: factor * plate[f"machine.{name}"] for name in keys}
            return next(g for g in review(before(plate, **machine), [f.scheme], steady=False)
                        if (g.subject, g.scheme) == (f.subject, f.scheme))  # fmt: skip

        assert says(float(end)).value == pytest.approx(f.value, rel=0.02)
        out = 0.97 if side == "more" else 1.03
        beyond, within = (says(float(least) * s).verdict for s in (out, 1 / out))
        assert beyond in ("bad", "doubtful") and within in ("ok", "note")
        seen += 1
    assert seen >= 4


def test_a_scheme_is_bad_only_if_no_estimate_helps(findings, plate):
    kinds = {scheme: verdict_of(findings, scheme) for scheme in SCHEMES}
    assert kinds["dtc1"] == kinds["dtc3"] == "doubtful" and kinds["db-dtfc"] == "ready"
    assert best(findings, SCHEMES)[0] in ready_of(findings, SCHEMES)
    told = plate.changed(machine__lxy_H=plate["machine.lxy_H"])
    # The leakage alone is not enough for the x-y current of single vectors.
    assert verdict_of(review(told, ["dtc1"], steady=False), "dtc1") == "bad"


def test_the_verdict_names_value_threshold_and_what_settles_it(findings):
    reached = outcome(findings, SCHEMES, "ddr", "mine.toml")
    assert {*reached.ready, *reached.doubtful, *reached.not_ready} == set(SCHEMES)
    part = next(p for p in reached.text.split("; ") if p.startswith("doubtful: "))
    assert "dtc1, dtc2, dtc3" in part and f"{PEAK} may be above its limit: machine.lxy_H" in part
    assert "hexatorque board commission" in part and " = " not in part
    reasons = reached.as_json()["doubtful"]
    assert set(reasons) == set(reached.doubtful)
    alone = outcome(findings, ["dtc2"], "ddr", "mine.toml")
    part = next(p for p in alone.text.split("; ") if p.startswith("doubtful: dtc2"))
    for text in (part, reasons["dtc2"]):
        assert PEAK in text and ", with machine.lxy_H = " in text
        assert re.search(
            r"\(runs with machine\.lxy_H = [\d.]+ and more: hexatorque board comm", text
        )


def test_a_doubt_stops_the_drive_only_with_the_values_of_the_file(tmp_path, capsys):
    """dtc1 trips in the simulation of this file, dtc3 only with less L_xy."""
    file = tmp_path / "mine.toml"
    file.write_text(new.from_nameplate(PLATE, "x"))
    for scheme, code in (("dtc1", 1), ("dtc3", 0)):
        assert main(["check", str(file), "--schemes", scheme, "--json"]) == code
        told = json.loads(capsys.readouterr().out)
        assert told["ok"] != bool(code) and told["ready"] == [] and scheme in told["doubtful"]
        assert bool([f for f in told["findings"] if f["where"]]) != bool(code)


def test_where_nothing_is_ready_the_best_is_one_in_doubt(plate):
    names = ["dtc1", "dtc3"]
    first, why = best(review(plate, names), names)
    assert first in names and why.startswith("best of 2 that are doubtful: ")


@pytest.mark.parametrize("gain", (1.2, 2.0, 4.0))
def test_an_unstable_loop_swings_within_what_its_limit_lets_it(gain):
    """Period by period: the regulator answers the current of the period before, to its limit."""
    setup = setups.load("paper-a-feasible")
    d = Design(setup, setup.parameter)
    row = firmware.lib.ht_scheme_describe(SCHEMES.index("ddr"))
    per_A = 2 * setup.parameter("kp_xy_pu_A")
    lxy_H = per_A * d.vdc_V * d.period_s / gain
    other = Design(
        setup.changed(machine__lxy_H=lxy_H, controller__kp_xy_pu_A=per_A / 2), d.parameter
    )
    limit_pu = firmware.lib.ht_scheme_xy_limit_pu(row)
    now_A, v_pu, most_A = 1e-3, 0.0, 0.0
    for _ in range(2000):
        answer = max(-limit_pu, min(limit_pu, -per_A * now_A))
        now_A += v_pu * d.vdc_V * d.period_s / lxy_H
        v_pu = answer
        most_A = max(most_A, math.sqrt(2) * abs(now_A))  # either axis alike
    assert 0.45 * _swing_A(other, row) < most_A < 1.01 * _swing_A(other, row)
    assert _swing_A(d, row) == 0.0
    gains = [f.verdict for f in _scheme(other, "ddr") if f.subject.startswith("gain of the x-y")]
    assert gains == ["note"]
