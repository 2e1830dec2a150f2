"""The JSON Schema of set-up files: an editor finds the same mistakes as the package."""

import json
import tomllib
from pathlib import Path

import pytest
from example_setups import example_setups
from jsonschema import Draft7Validator

from hexatorque import firmware, setups
from hexatorque.setups import SetupError

ROOT = Path(__file__).resolve().parents[3]
BUILTIN = ROOT / "host" / "hexatorque" / "setups" / "builtin"


@pytest.fixture(scope="module")
def validator():
    Draft7Validator.check_schema(setups.json_schema())
    return Draft7Validator(setups.json_schema())


def mistakes(validator, text):
    """The places where the schema finds a mistake: (section, key)."""
    errors = validator.iter_errors(tomllib.loads(text))
    return {tuple(error.absolute_path)[:2] for error in errors}


def test_the_page_has_the_schema_of_this_version():
    """Written by: hexatorque setups --schema > docs/setup.schema.json"""
    text = (ROOT / "docs" / "setup.schema.json").read_text()
    assert json.loads(text) == setups.json_schema()
    assert text == json.dumps(json.loads(text), indent=1) + "\n"


@pytest.mark.parametrize("file", [*BUILTIN.glob("*.toml"), *example_setups()])
def test_files_of_the_project_are_valid(validator, file):
    assert mistakes(validator, file.read_text()) == set()


WRONG = [
    "[machine]\nrs_ohm = -1",
    "[machine]\nrs_ohm = { value = -1, tag = 'paper' }",
    "[machine]\nrs_ohm = { value = 1, tag = 'guess' }",
    "[machine]\nrs_ohm = 'one'",
    "[machine]\nrs_ohm = true",
    "[machine]\npole_pairs = 1.5",
    "[machine]\ndrs_ohm = [1, 2]",
    "[timing]\nlatency = 'late'",
    "[controller]\nscheme = 'ddt'",
    "[controller]\nflux_ref_Wb = 1e9",
    "[controller]\ntorque_levels = 4",
    "[profile]\nspeed_rpm = 'fast'",
    "[profile]\nspeed_rpm = [[1]]",
    "[profile]\nload_Nm = [[0, 2e5]]",
    "[profile]\nset = [[1, 'f_isr_Hz', 5000]]",
    "[profile]\nbroken = [[0.1, 'u3', 'open']]",
    "[profile]\nsamples_per_period = 3",
    "title = 3",
]
RIGHT = [
    "[machine]\nrs_ohm = { value = 1, note = 'cold' }\npole_pairs = 2.0",
    "[controller]\ntorque_levels = 3\nfield_weakening = true",
    "[profile]\nduration_s = 3\nspeed_rpm = 100\n"
    "load_Nm = [[1, 2], [2, 3]]\nset = [[1, 'scheme', 'fdr']]\nbroken = [[2, 'u1', 'open']]",
]


@pytest.mark.parametrize("text", WRONG)
def test_what_the_package_refuses_an_editor_marks_at_the_same_key(validator, text):
    text = 'setup = "paper-b"\n' + text
    with pytest.raises(SetupError) as error:
        setups.parse(text, "test")
    (place,) = mistakes(validator, text)
    assert str(error.value).startswith(".".join(place))


@pytest.mark.parametrize("text", RIGHT)
def test_what_the_package_takes_an_editor_takes(validator, text):
    text = 'setup = "paper-b"\n' + text
    setups.parse(text, "test")
    assert mistakes(validator, text) == set()


def test_unknown_keys_and_those_of_the_timing_are_marked(validator):
    for text in ("[machine]\nrs = 1", "[controller]\npredict = 'on'", "[profile]\nspeeds = 3"):
        text = 'setup = "paper-b"\n' + text
        with pytest.raises(SetupError):
            setups.parse(text, "test")
        assert len(mistakes(validator, text)) == 1
    assert mistakes(validator, "setup = 'paper-b'\n[machina]\nrs_ohm = 1") == {()}


def test_without_a_set_up_to_start_from_everything_is_needed(validator):
    complete = (BUILTIN / "paper-b.toml").read_text()
    assert mistakes(validator, complete) == set()
    without = "\n".join(line for line in complete.splitlines() if not line.startswith("lm_H"))
    assert len(without.splitlines()) == len(complete.splitlines()) - 1
    with pytest.raises(SetupError, match=r"^machine\.lm_H is missing"):
        setups.parse(without, "test")
    assert mistakes(validator, without) == {("machine",)}
    assert mistakes(validator, "setup = 'paper-b'\n" + without) == set()


def test_every_quantity_has_its_text_and_its_range():
    sections = setups.json_schema()["$defs"]
    parameters = firmware.parameters()
    for section, keys in {**setups.KEYS, "controller": parameters}.items():
        for name, key in keys.items():
            if section == "controller" and name in ("load_mode", "predict", "write_delay_us"):
                assert name not in sections[section]["properties"]
                continue
            entry = sections[section]["properties"][name]
            assert entry["description"].startswith(key.help) and key.unit in entry["description"]
            bare, table = entry["anyOf"]
            assert table["properties"]["value"] == bare
            if section != "controller" and key.kind == "file":
                assert bare == {"type": "string"}
            elif not key.choices:
                bare = bare.get("items", bare)
                allowed = [key]
                if section == "controller":  # some board allows it
                    allowed = [firmware.parameters(device)[name] for device in firmware.DEVICES]
                assert bare["minimum"] == min(own.min for own in allowed)
                assert bare["maximum"] == max(own.max for own in allowed)
