"""`hexatorque new FILE` without a list: what it asks, and what becomes of the answers."""

import pytest
from click.testing import CliRunner

from hexatorque import setups
from hexatorque.cli import own_machine
from hexatorque.cli.main import app, main
from hexatorque.setups import new

PLATE = "power_kW=7.5,voltage_V=400,current_A=7.8,frequency_Hz=50,speed_rpm=1455,poles=4"
CIRCUIT = "pole_pairs=2,rs_ohm=1.8,rr_ohm=2,lls_H=0.01,llr_H=0.01,lm_H=0.284"
CIRCUIT += ",vdc_V=300,current_A=5"
ENTER = ""


def written(text):
    """What the command writes of a new set-up's text."""
    return new.with_best_scheme(text, "mine")[0]


@pytest.fixture
def answered(tmp_path, monkeypatch):
    """Answers the questions; gives what was asked, and the set-up."""
    monkeypatch.setattr(own_machine, "at_terminal", lambda: True)

    def answer(*lines):
        file = tmp_path / "mine.toml"
        ended = CliRunner().invoke(app, ["new", str(file)], input="\n".join(lines) + "\n" * 20)
        assert ended.exit_code == 0, ended.output
        return ended.output, file.read_text()

    return answer


def test_a_plate_alone_gives_what_the_list_gives(answered):
    """Enter for the frequency, for the poles, which follow from the speed, and for all the rest:
    also the tags of what was not told are the same."""
    asked, text = answered("nameplate", ENTER, "7.5", "400", "7.8", ENTER, ENTER, "1455")
    assert text == written(new.from_nameplate(PLATE, "mine"))
    for part in ("power_kW: rated power at the shaft, 0.001 .. 100000 kW", "for example 7.5"):
        assert part in asked


def test_a_circuit_alone_gives_what_the_list_gives(answered):
    answers = (ENTER, "2", "1.8", "2", "0.01", ENTER, "0.284", ENTER, "300", "5")
    assert answered("circuit", *answers)[1] == written(new.from_circuit(CIRCUIT, "mine"))


def test_a_wrong_answer_is_asked_again_with_the_reason(answered):
    asked, text = answered(
        *("plate", "nameplate", ENTER, "0", "a lot", "7.5", "400", "7.8", ENTER, "50", "1455"),
        *("3", "4"),
    )
    assert text == written(new.from_nameplate(PLATE, "mine"))
    assert "power_kW = 0: allowed range is 0.001 .. 100000 kW" in asked
    assert "power_kW = 'a lot': a number is needed" in asked
    assert "poles = 3: an even number is needed" in asked


def test_answers_that_contradict_each_other_are_asked_again(answered):
    """5 A is too little for 7.5 kW. That is said as soon as it can be known, before what the plate
    does not have is asked. All else is kept by Enter."""
    first = ("nameplate", ENTER, "7.5", "400", "5", ENTER, "50", "1455", ENTER)
    asked, text = answered(*first, ENTER, ENTER, ENTER, "7.8")
    assert "is the current that of one line of one set?" in asked
    assert "inertia_kgm2" not in asked.split("is the current that of one")[0]
    assert text == written(new.from_nameplate(PLATE, "mine"))


def test_what_is_answered_is_not_an_estimate(answered):
    """In front of the suggestion, not the other way around."""
    answers = (ENTER, "7.5", "400", "7.8", "0.8", "50", "1455", "4", ENTER, "600", "0.3")
    setup = setups.parse(answered("nameplate", *answers)[1], "mine")
    rows = setups.describe(setup)
    assert (rows["inverter"]["vdc_V"]["value"], rows["machine"]["inertia_kgm2"]["value"]) == (
        600,
        0.3,
    )
    assert rows["inverter"]["vdc_V"]["tag"] != "assumed"
    assert rows["sensors"]["i_full_A"]["tag"] == "assumed"


def test_a_three_phase_machine_is_asked_for_again_rewound(answered):
    """Half the current on each of two sets is the same power; Enter takes it."""
    first = ("nameplate", "3", "7,5", "400", "15,6", ENTER, "50", "1455", ENTER)
    asked, text = answered(*first)
    assert "current_A=7.8" in asked
    assert setups.parse(text, "x") == setups.parse(written(new.from_nameplate(PLATE, "mine")), "x")


def test_nobody_is_asked_in_a_script(tmp_path, capsys, monkeypatch):
    file = tmp_path / "mine.toml"
    monkeypatch.setattr(own_machine, "at_terminal", lambda: False)
    assert main(["new", str(file)]) == 2
    assert "--nameplate" in capsys.readouterr().err
    assert not file.exists()


def test_a_machine_with_magnets_is_asked_for_its_data_sheet(answered):
    sheet = "poles=10,ke_V=47,rs_ohm=1.1,ld_H=0.0021,vdc_V=60,current_A=3.5,inertia_kgm2=0.03"
    answers = (ENTER, "10", "47", "1.1", "0.0021", ENTER, ENTER, "60", "3.5", ENTER, ENTER, "0.03")
    asked, text = answered("magnets", *answers)
    assert text == written(new.from_magnets(sheet, "mine"))
    assert "ke_V: voltage between two lines of a set without load at 1000 r/min" in asked
