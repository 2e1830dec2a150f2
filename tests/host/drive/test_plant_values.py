"""What the test bench sets, load torque and dc-link voltage: any finite number and nothing else. A
number may be text, as everywhere else where a user gives one."""

from fractions import Fraction

import numpy as np
import pytest

from hexatorque import SimulatedDrive, setups
from hexatorque.drive.interface import finite
from hexatorque.errors import HexatorqueError


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), np.int64(2), np.array(2.0), Fraction(2)])
def test_a_number_of_any_library_is_a_number(value):
    assert finite(value) == 2.0 and type(finite(value)) is float


@pytest.mark.parametrize("text", ["2", " 2.0 ", "2,0", "20e-1"])
def test_a_number_as_text_is_a_number(text):
    assert finite(text) == 2.0 and type(finite(text)) is float


@pytest.mark.parametrize(
    "value",
    [
        "",
        "2.000,5",
        "1_0",
        "nan",
        "inf",
        "2 A",
        "much",
        None,
        [2.0],
        float("nan"),
        float("inf"),
        2j,
    ],
)
def test_all_else_is_none(value):
    assert finite(value) is None


@pytest.fixture(scope="module")
def sim():
    return SimulatedDrive(setups.load("paper-b"))


@pytest.mark.parametrize("name", ["load_Nm", "vdc_V"])
@pytest.mark.parametrize("value", ["much", None, float("nan")])
def test_a_simulation_refuses_in_one_line_and_keeps_what_it_had(sim, name, value):
    before = sim.load_Nm, sim.vdc_V
    with pytest.raises(HexatorqueError) as refused:
        sim.set_many({"load_Nm": 1.25, "vdc_V": 200.0, name: value})
    assert str(refused.value) == f"{name} = {value}: a finite number is needed"
    assert (sim.load_Nm, sim.vdc_V) == before


def test_time_passes_without_the_set_up_being_evaluated_again(monkeypatch):
    """All parameters of a set-up take as long as thirty periods. An environment of Gymnasium, a
    virtual board and many tests let a few pass at a time."""
    sim = SimulatedDrive(setups.load("small-2kw"))

    def never(_):
        raise AssertionError("evaluated again")

    monkeypatch.setattr(setups.setup.to_parameters, "parameters", never)
    sim.run(0.01)
    sim.load_Nm = 0.5
    sim.run(0.01)
