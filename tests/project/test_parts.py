"""The sets of parts of docs/first-spin.md: each answers every demand on the power stage, and the
set for 48 V fits its set-up."""

import json
import re
from pathlib import Path

import doc_page
import pytest

from hexatorque import setups
from hexatorque.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
SETUP = ROOT / "examples" / "forty-eight-volts.toml"
PAGE = (ROOT / "docs" / "first-spin.md").read_text(encoding="utf-8")
V_REF = 3.0


def rows(text: str) -> dict[str, str]:
    """The first cell of each row of the tables, and the others."""
    cells = (re.match(r"\|\s*(.*?)\s*\|(.*)\|", line) for line in text.splitlines())
    return {found[1]: found[2] for found in cells if found}


def data(name: str) -> dict[str, str]:
    """The same of a table beside the page."""
    _, *lines = doc_page.read_data(ROOT / "docs" / "first-spin.md", name)
    return {line[0]: " | ".join(line[1:]) for line in lines}


def demands() -> set[str]:
    section = re.split(r"\n#+ ", PAGE.split("## The power stage\n", 1)[1])[0]
    return {name.strip("*") for name in rows(section) if name.startswith("**")}


@pytest.mark.parametrize("parts", ["48-V", "mains"])
def test_each_set_answers_every_demand(parts):
    """And nothing else: a demand that is deleted leaves its answers alone."""
    assert demands() == set(data(f"demands-{parts}"))


def test_the_over_voltage_comparator_shares_nothing_with_the_reading():
    """The firmware does not find a dc-link sensor that stands still, so nothing else trips then."""
    demanded = rows(PAGE)["**Over-voltage of the dc link**"]
    assert "A comparator on the dc link of its own, into the trip chain." in demanded
    assert "must not share the divider" in demanded and "does not replace this one" in demanded
    for parts in ("48-V", "mains"):
        assert "its own divider" in data(f"demands-{parts}")["Over-voltage of the dc link"]
    safety = " ".join((ROOT / "docs" / "safety.md").read_text(encoding="utf-8").split())
    assert "(first-spin.md#the-power-stage)" in safety.split("does not notice a dc-link sensor")[1]


@pytest.fixture(scope="module")
def setup():
    return setups.load(SETUP)


def test_the_review_finds_nothing_but_the_comparators_mean(capsys):
    assert main(["check", str(SETUP), "--schemes", "ddr", "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    (told,) = [f for f in findings if f["verdict"] != "ok"]
    assert told["verdict"] == "note" and told["subject"].startswith("mean torque")


def numbers(part: str) -> list[float]:
    return [float(n) for n in re.findall(r"\d+(?:\.\d+)?", data("parts-48-V")[part])]


def test_the_values_of_the_parts_are_those_of_the_setup(setup):
    # 5 mohm and 20 V/V about half of 3.3 V, divided by 10 k over 100 k to half of V_REF.
    per_A = 5e-3 * 20 * 100 / 110
    assert setup["sensors.i_full_A"] == pytest.approx(V_REF / 2 / per_A)
    assert setup["sensors.vdc_full_V"] == pytest.approx(V_REF * (240 + 10) / 10)
    assert setup["sensors.encoder_ppr"] == 1024 == numbers("encoder")[-1]
    assert numbers("divider and buffer per current")[-1] == setup["sensors.i_full_A"]
    assert numbers("divider of the dc link")[-2] == setup["sensors.vdc_full_V"]
    assert numbers("divider of the dc link")[-1] == setup.parameter("vdc_max_V")


def test_trips_stand_in_their_order(setup):
    """Chopper, firmware, comparator, what the stage stands; the same for the current."""
    on_V, off_V = numbers("brake chopper")[1:3]
    over_V, at_V = numbers("over-voltage")[-2:]
    assert setup["inverter.vdc_V"] < off_V < on_V < setup.parameter("vdc_max_V") < over_V <= 60
    assert at_V == pytest.approx(over_V * 10 / 250)
    most_A, high_V, low_V = numbers("over-current")[-4:-1]
    per_A = 5e-3 * 20 * 100 / 110
    assert (high_V - low_V) / 2 == pytest.approx(most_A * per_A, abs=0.01)
    assert setup.parameter("i_trip_A") < most_A < setup["sensors.i_full_A"]
