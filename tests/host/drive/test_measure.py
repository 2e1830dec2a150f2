"""`hexatorque.measure`: one operating point, measured as `compare` measures it."""

import pytest

import hexatorque
from hexatorque import laws
from hexatorque.errors import InputError
from hexatorque.experiments import comparison, operating_points, steady


@pytest.fixture(scope="module")
def run():
    return hexatorque.measure("paper-b", scheme="DTC1", speed_rpm="1000", load_Nm=2)


def test_it_measures_what_compare_measures(run):
    (point,) = comparison.points(["paper-b"], ["dtc1"], 1000, 2)
    (same,) = operating_points.measure_all([point], fine=True)
    assert run.metrics == same.metrics
    assert (run.setup, run.scheme, run.speed_ref_rpm, run.load_Nm) == ("paper-b", "dtc1", 1000, 2)
    assert run.recording["plant.torque_Nm"].mean() == pytest.approx(2, rel=0.01)
    assert run.recording["firmware.torque_Nm"].mean() == pytest.approx(2, rel=0.02)


def test_another_value_of_a_key_changes_the_drive(run):
    values = {"controller.torque_band_Nm": "0,6"}
    wide = hexatorque.measure("paper-b", "dtc1", 1000, 2, values, samples_per_period=4)
    assert wide.recording.meta["parameters"]["controller"]["torque_band_Nm"] == 0.6
    assert wide.recording.meta["samples_per_period"] == 4
    assert wide.metrics["f_sw_Hz"] < run.metrics["f_sw_Hz"]
    assert wide.metrics["torque_ripple_Nm"] > run.metrics["torque_ripple_Nm"]


def test_what_is_not_given_is_the_set_up_s():
    setup = hexatorque.load("paper-b")
    point = steady.under(steady.at_point(setup), None)
    assert point.setup["controller.scheme"] == "dtc1" and point.law is None
    assert point.speed_rpm == setup["point.speed_rpm"] and point.load_Nm == setup["point.load_Nm"]


class Nothing(laws.Law):
    """All legs low: no torque."""

    @staticmethod
    def step(seen, memory):
        return 0, 0, 0, 0.0, 0.0

    returns = "vectors"
    compiled = False


def test_a_law_is_a_scheme_by_itself():
    setup = steady.at_point(hexatorque.load("paper-b"))
    law = Nothing()
    point = steady.under(setup, law)
    assert point.law is law and point.setup["timing.latency"] == "predicted"
    assert point.scheme == "nothing"
    assert steady.under(setup, "DTC-SVM").scheme == "dtc-svm"
    drive = hexatorque.SimulatedDrive(point.setup, controller=law)
    assert drive.get("scheme") == "nothing"


def test_a_drive_is_made_from_a_name_or_a_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('setup = "paper-b"\n[machine]\nrs_ohm = 5.5\n')
    assert hexatorque.SimulatedDrive("paper-b").setup.name == "paper-b"
    for one in (file, str(file)):
        assert hexatorque.SimulatedDrive(one).setup["machine.rs_ohm"] == 5.5


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"setup": "paper-bb"}, "no set-up 'paper-bb'; did you mean 'paper-b"),
        ({"setup": 3}, "setup = 3: the name or the file of a set-up is needed"),
        ({"scheme": "dtc9"}, "no scheme 'dtc9': choose from dtc1, dtc2"),
        ({"scheme": 3}, "scheme = 3: a name, a file of a law, or a Law is needed"),
        ({"speed_rpm": "fast"}, "point.speed_rpm = 'fast': a number is needed"),
        ({"speed_rpm": 0}, "paper-b: speed_rpm (--speed) = 0: another speed is needed"),
        ({"load_Nm": 99}, "load 99 N m: allowed range is -4 .. 4 N m"),
        ({"set": {"machine.rs_ohms": 1}}, "unknown key machine.rs_ohms; did you mean 'rs_ohm'?"),
        ({"set": 3}, "3: names with values are needed"),
        ({"samples_per_period": 2.5}, "samples_per_period = 2.5: allowed range is 1 .. 10000"),
        ({"samples_per_period": "4"}, "samples_per_period = 4: allowed range is 1 .. 10000"),
    ],
)
def test_a_mistake_is_one_line(arguments, said):
    with pytest.raises(InputError) as caught:
        hexatorque.measure(**{"setup": "paper-b", **arguments})
    assert str(caught.value).startswith(said) and "\n" not in str(caught.value)
