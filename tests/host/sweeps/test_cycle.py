"""A drive cycle costs what its operating points cost, and a table that is no cycle is refused."""

import itertools

import pytest

from hexatorque import Study, setups
from hexatorque.experiments.operating_points import Point, measure
from hexatorque.setups import SetupError
from hexatorque.sweeps import cycle, energy, files, maps
from hexatorque.sweeps.errors import StudyError
from hexatorque.sweeps.work import Row, Runs

DROPS = {
    "inverter.v_switch_V": 1.0, "inverter.v_diode_V": 1.0, "inverter.r_switch_ohm": 0.02,
    "inverter.r_diode_ohm": 0.02, "inverter.e_on_mJ": 0.6, "inverter.e_off_mJ": 0.6,
    "inverter.e_ref_V": 300.0, "inverter.e_ref_A": 20.0,
}  # fmt: skip


def with_losses():
    values = {path.replace(".", "__"): value for path, value in DROPS.items()}
    return setups.load("paper-b").with_scheme("ddr").changed(**values)


def table(tmp_path, text, name="mine.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def quiet(_):
    pass


def test_a_cycle_of_one_point_takes_its_power_times_its_time(tmp_path):
    """Steady state has no other energies, so that loss_W of one is loss_Wh of the other."""
    setup = with_losses()
    path = table(tmp_path, "time_s,speed_rpm,torque_Nm\n0,800,1.5\n1.5,800,1.5\n")
    found = energy.figures(setup, cycle.read(path), quiet)
    point = measure(Point(setup, 800.0, 1.5)).metrics
    hours = 1.5 / 3600
    for name in ("loss", "copper_loss", "conduction_loss", "switching_loss"):
        assert found[f"{name}_Wh"] == pytest.approx(point[f"{name}_W"] * hours, rel=0.01)
    assert found["drawn_Wh"] == pytest.approx(point["input_W"] * hours, rel=0.01)
    assert found["returned_Wh"] == 0
    assert found["efficiency_pct"] == pytest.approx(point["efficiency_pct"], rel=0.01)
    assert found["f_sw_Hz"] == pytest.approx(point["f_sw_Hz"], rel=0.02)
    assert found["speed_error_rpm"] < 3


def test_a_cycle_there_and_back_again_balances(tmp_path):
    """What the shaft gives is what the table says: the torque times the angle, as the rotor has
    its energy of motion back in the end. It turns both ways and brakes."""
    text = "time_s,speed_rpm,torque_Nm\n0,0,0\n4,600,1\n4,600,-1\n8,0,-1\n12,-600,-1\n16,0,0\n"
    found = energy.figures(with_losses(), cycle.read(table(tmp_path, text)), quiet)
    w = 600 * 3.14159265 / 30
    # Torque times speed: rise of both, braking, rise backwards, and fall of both.
    expected_J = 4 * (w / 3 - w / 2 + w / 2 + w / 3)
    assert found["shaft_Wh"] * 3600 == pytest.approx(expected_J, rel=0.05)
    assert found["loss_Wh"] == pytest.approx(
        found["drawn_Wh"] - found["returned_Wh"] - found["shaft_Wh"]
    )
    parts = sum(found[f"{n}_Wh"] for n in ("copper_loss", "conduction_loss", "switching_loss"))
    assert 0 < parts < found["loss_Wh"]


def test_the_urban_cycle_is_that_of_the_regulation():
    """195 s, 1.013 km, 30.8 + 4.6 % of it with the vehicle at rest or rolling out."""
    found = cycle.read("ece15")
    assert found.duration_s == 195 and found.own_speed and found.own_torque
    rows = list(zip(found.time_s, found.speed))
    metres = sum((b - a) * (p + q) / 2 * 50 / 3.6 for (a, p), (b, q) in itertools.pairwise(rows))
    assert metres == pytest.approx(1013, rel=0.003)
    idle_s = sum(b - a for (a, p), (b, q) in itertools.pairwise(rows) if p == q == 0)
    assert idle_s == 60
    assert max(found.speed) == 1 and max(map(abs, found.torque)) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "a column time_s is needed"),
        ("time_s,speed_rpm\n0,1\n", "a column torque_Nm or torque_pu is needed"),
        ("time_s,speed_rpm,speed_pu,torque_pu\n", "a column speed_rpm or speed_pu is needed"),
        ("# mine\ntime_s,speed_rpm,torque_Nm\n0,x,1\n", "line 3: speed_rpm = 'x': a finite"),
        ("time_s,speed_rpm,torque_Nm\n0,1\n", "line 2: time_s = '': a finite number is needed"),
        ("time_s,speed_rpm,torque_Nm\n0,1,1\n2,1,1\n1,1,1\n", "line 4: time_s = 1: must not fall"),
        ("time_s,speed_rpm,torque_Nm\n1,1,1\n2,1,1\n", "time_s must go from 0 to 0.05 .. 36000"),
    ],
)
def test_a_table_that_is_no_cycle(tmp_path, text, said):
    with pytest.raises(StudyError, match=said):
        cycle.read(table(tmp_path, text))


def test_a_cycle_that_is_not_there(tmp_path):
    with pytest.raises(StudyError, match="cycle ece51: there is none; did you mean 'ece15'"):
        cycle.read("ece51")
    with pytest.raises(StudyError, match=r"nothing\.csv: No such file"):
        cycle.read(tmp_path / "nothing.csv")


def test_what_the_drive_cannot_do_is_said_before_it_runs(tmp_path):
    path = table(tmp_path, "time_s,speed_rpm,torque_Nm\n0,0,0\n1,100,-900\n")
    with pytest.raises(SetupError, match=r"cycle mine: -900 N m: allowed range is .*torque limit"):
        Study("paper-b", run=Runs("cycle", cycle=path), schemes=["ddr"])
    with pytest.raises(StudyError, match="cycle = '': run = 'cycle' needs one"):
        Study("paper-b", run="cycle", schemes=["ddr"])
    with pytest.raises(StudyError, match="unknown metric 'loss_W'; did you mean 'loss_Wh'"):
        Study("paper-b", run=Runs("cycle", cycle="ece15"), metrics=["loss_W"], schemes=["ddr"])
    setup = setups.load("paper-b").changed(point__load_Nm=0.0)
    with pytest.raises(SetupError, match=r"point.load_Nm = 0: the cycle ece15 has shares of it"):
        Study(setup, run=Runs("cycle", cycle="ece15"), schemes=["ddr"])


def test_without_a_point_a_cycle_has_shares_of_half_of_rated_speed_and_torque():
    """As `compare` and the other sweeps have it."""
    rated = {"rated__speed_rpm": 2500.0, "rated__torque_Nm": 2.0}
    setup = setups.load("paper-b").changed(point__speed_rpm=0.0, point__load_Nm=0.0, **rated)
    speed_rpm, torque_Nm = cycle.read("ece15").over(setup)
    assert max(speed_rpm) == 1250 and max(abs(torque_Nm)) == 1
    Study(setup, run=Runs("cycle", cycle="ece15"), schemes=["ddr"])


def test_a_study_names_its_files_as_seen_from_its_own_folder(tmp_path, monkeypatch):
    """Files of the same names where the command runs are others; what is built in stays so."""
    folder, elsewhere = tmp_path / "studies", tmp_path / "elsewhere"
    for where, rs_ohm, torque_Nm in ((folder, 1.25, 2), (elsewhere, 3.5, 1)):
        where.mkdir()
        (where / "mine.toml").write_text(f'setup = "paper-b"\n[machine]\nrs_ohm = {rs_ohm}\n')
        table(where, f"time_s,speed_rpm,torque_Nm\n0,100,{torque_Nm}\n1,100,{torque_Nm}\n")
    text = 'run = "cycle"\nschemes = ["ddr"]\n'
    (folder / "own.toml").write_text(f'setup = "mine.toml"\ncycle = "mine.csv"\n{text}')
    (folder / "ready.toml").write_text(f'setup = "paper-b"\ncycle = "ece15"\n{text}')
    (folder / "ece15").write_text("a file of this name is not meant")
    monkeypatch.chdir(elsewhere)
    own, of_package = files.read("../studies/own.toml"), files.read("../studies/ready.toml")
    assert own.setup["machine.rs_ohm"] == 1.25 and own.cycle.torque == (2, 2)
    assert of_package.setup.name == "paper-b" and of_package.cycle == cycle.read("ece15")
    # An option is typed where the command runs.
    typed = files.read("../studies/own.toml", {"setup": "mine.toml", "cycle": "mine.csv"})
    assert typed.setup["machine.rs_ohm"] == 3.5 and typed.cycle.torque == (1, 1)


def test_the_study_of_a_cycle_and_its_picture(tmp_path):
    study = files.read("cycle", {"schemes": ["dtc1", "ddr"]})
    assert study.cycle.name == "ece15" and study.metrics == tuple(cycle.UNITS)
    assert study.as_json()["run"]["cycle"]["time_s"][-1] == 195
    with pytest.raises(StudyError, match="no picture: no run has figures"):
        study.map(tmp_path / "m.png")
    for number in range(2):
        study.results.add(Row(number, tuple(float(k + 1) for k in range(len(study.metrics)))))
    assert study.map(tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"
    assert study.save(tmp_path)[0].read_text().splitlines()[0].endswith("speed_error_rpm,failure")
    assert set(maps.PARTS) <= set(study.metrics)


def test_each_choice_of_a_word_has_its_own_bar(tmp_path, monkeypatch):
    keys = {"controller.flux_least_loss": ["off", "on"]}
    study = files.read("cycle", {"schemes": ["ddr", "foc"], "vary": keys})
    drawn = []
    monkeypatch.setattr(maps, "_save", lambda figure, path: drawn.append(figure) or path)
    for number in range(4):
        least_loss = study.results.space.case(number).values["controller.flux_least_loss"] == "on"
        study.results.add(Row(number, (1.0 if least_loss else 2.0,) * len(study.metrics)))
    study.map(tmp_path / "m.png")
    bars = drawn[0].axes[2]
    names = [tick.get_text() for tick in bars.get_yticklabels()]
    said = dict(zip(names, (text.get_text() for text in bars.texts)))
    assert set(said) == {
        f"{name}, flux_least_loss {choice}" for name in ("ddr", "foc") for choice in ("off", "on")
    }
    assert said["ddr, flux_least_loss on"].startswith(" 1 Wh")
    assert said["ddr, flux_least_loss off"].startswith(" 2 Wh")


def test_a_study_whose_scheme_does_not_vary_has_a_picture(tmp_path):
    study = Study("paper-b", {"point.speed_rpm": [500, 1000]}, ["loss_W"])
    for number in range(2):
        study.results.add(Row(number, (1.0,)))
    assert study.map(tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"


def map_of_kinds(tmp_path, monkeypatch, **over):
    """The map of a study with both kinds of a scheme: 1 W with the least loss, and 2 W without."""
    keys = {"controller.flux_least_loss": ["off", "on"], "point.speed_rpm": [500, 1000]}
    keys |= {f"point.{name}": values for name, values in over.items()}
    study = Study("paper-b", keys, ["loss_W"], schemes=["ddr"])
    drawn = []
    monkeypatch.setattr(maps, "_save", lambda figure, path: drawn.append(figure) or path)
    for number in range(len(study)):
        least_loss = study.results.space.case(number).values["controller.flux_least_loss"] == "on"
        study.results.add(Row(number, (1.0 if least_loss else 2.0,)))
    study.map(tmp_path / "m.png")
    return drawn[0]


def test_kinds_of_a_scheme_are_not_mixed_over_a_number(tmp_path, monkeypatch):
    """They were averaged."""
    (axes,) = map_of_kinds(tmp_path, monkeypatch).axes
    lines = {line.get_label(): set(line.get_ydata()) for line in axes.lines}
    assert lines == {"ddr, flux_least_loss off": {2.0}, "ddr, flux_least_loss on": {1.0}}


def test_kinds_of_a_scheme_are_not_mixed_over_two_numbers(tmp_path, monkeypatch):
    figure = map_of_kinds(tmp_path, monkeypatch, load_Nm=[1.0, 2.0])
    titles = [ax.get_title() for ax in figure.axes]
    assert "ddr, flux_least_loss on\nloss_W [W]" in titles
    assert "ddr, flux_least_loss off\nloss_W [W]" in titles


def test_titles_of_a_map_are_whole_and_apart(monkeypatch, tmp_path):
    """Kind and figure on one line were cut at the picture's edge."""
    keys = {"controller.flux_least_loss": ["off", "on"], "point.speed_rpm": [500, 1000]}
    keys |= {"point.load_Nm": [1.0, 2.0]}
    study = Study("small-2kw", keys, ["conduction_loss_W"], schemes=["db-dtfc"])
    drawn = []
    monkeypatch.setattr(maps, "_save", lambda figure, path: drawn.append(figure) or path)
    for number in range(len(study)):
        study.results.add(Row(number, (80.0 + number,)))
    study.map(tmp_path / "m.png")
    (figure,) = drawn
    figure.draw_without_rendering()
    first, second = (ax.title.get_window_extent() for ax in figure.axes if ax.get_title())
    assert 0 < first.x0 and first.x1 < second.x0 and second.x1 < figure.bbox.x1
