"""Which runs a study has, and what it refuses."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from hexatorque import InputError, Study, setups
from hexatorque.cli.main import main
from hexatorque.setups import SetupError
from hexatorque.sweeps import files, space
from hexatorque.sweeps.errors import StudyError
from hexatorque.sweeps.work import Runs

RPM, NM, RS = "point.speed_rpm", "point.load_Nm", "machine.rs_ohm"


def values(study):
    return [study.space.case(n).values for n in range(len(study))]


def test_a_grid_has_every_combination_once():
    keys = {RPM: {"from": 500, "to": 2500, "count": 5}, NM: [0.5, 1.0]}
    study = Study("paper-b", keys, schemes=["dtc1", "ddr"], seeds=[7, 8, 9])
    assert len(study) == 5 * 2 * 2 * 3
    found = values(study)
    assert {v[RPM] for v in found} == {500, 1000, 1500, 2000, 2500}
    assert len({tuple(v.items()) for v in found}) == len(study)
    assert set(Counter(v["sensors.noise_seed"] for v in found).values()) == {20}
    # The seeds of a point follow each other, then come the other schemes, then the next point.
    assert [v["sensors.noise_seed"] for v in found[:4]] == [7, 8, 9, 7]
    assert [v["controller.scheme"] for v in found[2:4]] == ["dtc1", "ddr"]


def test_a_list_goes_through_its_values_together():
    study = Study("paper-b", {RPM: [500, 900], NM: [1.0, 2.0]}, design="list")
    assert values(study) == [{RPM: 500, NM: 1.0}, {RPM: 900, NM: 2.0}]


def test_one_name_is_a_list_of_one():
    study = Study("paper-b", schemes="DDR", seeds=7, metrics="f_sw_Hz")
    assert values(study) == [{"controller.scheme": "ddr", "sensors.noise_seed": 7}]
    assert study.metrics == ("f_sw_Hz",)


def test_a_logarithmic_range_multiplies():
    axis = space.read_axis(RS, {"from": 0.01, "to": 100, "count": 5, "log": True}, "grid")
    assert axis.values == (0.01, 0.1, 1.0, 10.0, 100.0)


def test_whole_numbers_stay_whole():
    axis = space.read_axis("sensors.encoder_ppr", {"from": 500, "to": 2048, "count": 4}, "grid")
    assert axis.values == (500, 1016, 1532, 2048)
    assert all(isinstance(value, int) for value in axis.values)


def test_a_latin_hypercube_has_one_point_in_every_slice():
    pytest.importorskip("scipy")
    keys = {RS: {"from": 1.0, "to": 5.0}, RPM: {"from": 100, "to": 2500}, NM: [1.0, 2.0]}
    study = Study("paper-b", keys, design=space.Draw("latin-hypercube", 40))
    found = values(study)
    for path, low, high in ((RS, 1.0, 5.0), (RPM, 100, 2500)):
        slices = [math.floor(40 * (v[path] - low) / (high - low)) for v in found]
        assert sorted(slices) == list(range(40))
    assert Counter(v[NM] for v in found) == {1.0: 20, 2.0: 20}


@pytest.mark.parametrize("design", ["random", "latin-hypercube"])
def test_the_seed_decides_the_draw(design):
    def drawn(seed):
        keys = {RS: {"from": 1.0, "to": 5.0}}
        return values(Study("paper-b", keys, design=space.Draw(design, 20, seed)))

    assert drawn(1) == drawn(1) != drawn(2)


def test_factors_multiply_what_the_setup_has():
    setup = setups.load("paper-b")
    factors = {"from": 0.5, "to": 2.0, "count": 3, "times": True}
    study = Study(setup, {RS: factors, "controller.lxy_H": {"values": [0.5, 2], "times": True}})
    found = values(study)
    assert sorted({v[RS] for v in found}) == pytest.approx([3.0, 7.5, 12.0])
    own_H = setup.parameter("lxy_H")  # which the set-up does not state
    assert sorted({v["controller.lxy_H"] for v in found}) == pytest.approx([own_H / 2, own_H * 2])


def test_factors_of_the_point_of_a_setup_without_one_are_of_half_the_rated_values():
    setup = setups.load("paper-b").changed(
        point__speed_rpm=0.0, point__load_Nm=0.0, rated__speed_rpm=2000.0, rated__torque_Nm=4.0
    )
    keys = {RPM: {"values": [1, 2], "times": True}, NM: {"values": [0.5], "times": True}}
    assert values(Study(setup, keys)) == [{RPM: 1000.0, NM: 1.0}, {RPM: 2000.0, NM: 1.0}]
    with pytest.raises(StudyError, match="a number other than 0 is needed"):
        Study(setup, {"machine.viscous_Nms": {"values": [1, 2], "times": True}})


def test_whole_numbers_stay_whole_when_multiplied():
    keys = {"sensors.encoder_ppr": {"values": [0.333], "times": True}}
    assert values(Study("paper-b", keys)) == [{"sensors.encoder_ppr": 500}]  # of 1500


def test_a_default_is_for_what_the_setup_leaves_open():
    given = {"inverter.vdc_V": 100.0, "inverter.v_switch_V": 1.5}
    setup = Study("paper-b", {RPM: [500]}, default=given).setup
    assert setup["inverter.vdc_V"] == 300.0 and setup["inverter.v_switch_V"] == 1.5


@pytest.mark.parametrize("name", files.ready())
def test_ready_made_studies_fit_any_setup(name):
    for setup in ("paper-a-feasible", "paper-b"):
        study = files.read(Path(name), {"setup": setup})
        assert study.setup.name == setup
        assert (1 if name == "cycle" else 50) < len(study) < 2000  # minutes on two cores
        for number in (0, len(study) - 1):  # neither is refused
            space.changed(study.setup, study.space.case(number).values)


def test_more_random_points_begin_with_the_same_ones():
    few, many = (space.points(space.Draw("random", n), {RS: {"from": 1, "to": 5}}) for n in (5, 50))
    assert np.array_equal(few.shares, many.shares[:5])


def test_the_profile_may_vary():
    setup = setups.load("examples/reversal.toml")
    other = space.changed(setup, {"profile.load_Nm": [[0.5, 2.0]], RS: 2.0})
    assert other.profile.load_Nm == ((0.5, 2.0),) and other["machine.rs_ohm"] == 2.0
    assert other.profile.speed_rpm == setup.profile.speed_rpm
    assert other.profile.duration_s == setup.profile.duration_s


def test_a_scheme_gets_the_latency_that_it_needs():
    setup = setups.load("paper-b")
    assert setup["timing.latency"] == "none"
    assert space.changed(setup, {"controller.scheme": "db-dtfc"})["timing.latency"] == "predicted"
    with pytest.raises(SetupError, match=r"timing\.latency = none: db-dtfc allows predicted only"):
        space.changed(setup, {"controller.scheme": "db-dtfc", "timing.latency": "none"})


GRID = {RPM: [500, 900]}


@pytest.mark.parametrize(
    ("keys", "more", "said"),
    [
        ({"machine.rs_oh": [1]}, {}, "unknown key machine.rs_oh; did you mean 'rs_ohm'?"),
        ({"machin.rs_ohm": [1]}, {}, "unknown section 'machin'; did you mean 'machine'?"),
        ({"rs_ohm": [1]}, {}, "unknown key rs_ohm: SECTION.KEY is needed"),
        ({RS: [1, -1]}, {}, "machine.rs_ohm = -1: allowed range is 0.0001 .. 1000 ohm"),
        ({RS: {"from": 1, "to": 2000, "count": 3}}, {}, "machine.rs_ohm = 1000.5: allowed range"),
        ({RS: []}, {}, "machine.rs_ohm: no values are given, the grid is empty"),
        ({RS: {"from": 1, "to": 2, "count": 0}}, {}, "machine.rs_ohm: count = 0: allowed range is"),
        ({RS: {"from": 1, "to": 2}}, {}, "machine.rs_ohm: count = None: allowed range is 1 .."),
        ({RS: {"from": 1, "two": 2}}, {}, "machine.rs_ohm: unknown 'two'; known: from, to"),
        ({RS: {"from": 1, "to": math.inf, "count": 2}}, {}, "to = inf: a finite number is needed"),
        ({RS: {"from": 0, "to": 1, "log": True, "count": 2}}, {}, "above 0 is needed with log"),
        ({RS: {"from": 1, "to": 2, "values": [1]}}, {}, "values and from: only one of them"),
        ({RS: {"values": [1], "times": 2}}, {}, "times = 2: true or false is needed"),
        ({RS: {"values": ["x"], "times": True}}, {}, "a factor = 'x': a finite number is needed"),
        ({RS: {"values": [1e9], "times": True}}, {}, "machine.rs_ohm = 6e+09: allowed range is"),
        ({"machine.rs": {"values": [1], "times": True}}, {}, "machine.rs; did you mean 'rs_ohm'?"),
        ({"timing.latency": {"values": [1], "times": True}}, {}, "times: the set-up has none"),
        ({"machine.dlls_H": {"values": [1], "times": True}}, {}, "a number other than 0 is needed"),
        ({}, {}, "nothing varies"),
        (GRID, {"metrics": ["thd_pc"]}, "unknown metric 'thd_pc'; did you mean"),
        (GRID, {"metrics": []}, "no metric is given; known: speed_rpm"),
        (GRID, {"metrics": ["i1_A", "i1_A"]}, "metric 'i1_A' is there twice"),
        (GRID, {"schemes": ["dtc9"]}, "unknown scheme 'dtc9'"),
        (GRID, {"schemes": 3}, "unknown scheme 3; known: dtc1"),
        (GRID, {"metrics": 3.0}, "metrics = 3.0: a list is needed"),
        (GRID, {"seeds": None}, "seeds = None: a list is needed"),
        (GRID, {"default": 3}, "3: names with values are needed, such as"),
        (GRID, {"seeds": [0]}, "seeds: 0: allowed range is 1 .. 1000000000"),
        (GRID, {"design": "gird"}, "design = 'gird': choose one of grid, list, random, latin-h"),
        (GRID, {"design": space.Draw(samples=3)}, "samples = 3: a grid has as many as its values"),
        (GRID, {"design": "random"}, "samples = None: allowed range is 1 .."),
        ({**GRID, NM: [1.0]}, {"design": "list"}, "point.speed_rpm has 2, point.load_Nm has 1"),
        (GRID, {"run": "profil"}, "run = 'profil': choose one of point, profile"),
        (GRID, {"run": Runs(from_s=1.0)}, "from_s = 1.0: only with run = 'profile'"),
        (GRID, {"run": Runs("profile", "0.1 s")}, "from_s = '0.1 s': a time of 0 s or more is"),
        ({"controller.scheme": ["ddr"]}, {"schemes": ["ddr"]}, "controller.scheme varies: leave"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_it(keys, more, said):
    with pytest.raises(InputError) as caught:
        Study("paper-b", keys, **more)
    assert said in str(caught.value) and "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("setup = 3", "setup = 3: the name or the file of a set-up is needed"),
        ("setup = 'paper-b'\nscheme = ['ddr']", "unknown key 'scheme'; did you mean 'schemes'?"),
        ("setup = 'paper-b'\nvary = {machine = 1}", "vary.machine: a table [vary.machine] is"),
        ("setup = 'paper-z'\nvary = {machine = {rs_ohm = [1]}}", "no set-up 'paper-z'"),
        ("setup = ", "not valid TOML"),
        ("title = 'x'", "setup is missing"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_file_names_the_file(text, said, tmp_path):
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(StudyError) as caught:
        files.read(tmp_path / "s.toml")
    assert str(caught.value).startswith(f"{tmp_path / 's.toml'}: ") and said in str(caught.value)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "give a FILE.toml, a study's name or --grid KEY=A:B:N"),
        ("--grid point.speed_rpm", "--grid point.speed_rpm: KEY=FROM:TO:COUNT or KEY=A,B,..."),
        ("--grid point.speed_rpm=1:2:x", "1:2:x: FROM:TO:COUNT is needed"),
        ("--grid point.speed_rpm=1:2", "point.speed_rpm: count = None"),
        ("--grid point.speed_rpm=500 --metric thd", "unknown metric 'thd'"),
        ("eficiency", "eficiency: no study; did you mean 'efficiency'?"),
        ("none.toml", "none.toml: No such file or directory"),
        ("--grid point.speed_rpm=500 --time-limit 0", "a time above 0 s is needed"),
        ("--grid point.speed_rpm=500 --jobs 0", "jobs = 0: 1 or more is needed"),
    ],
)  # fmt: skip
def test_a_mistake_on_the_command_line(line, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", *line.split()]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
