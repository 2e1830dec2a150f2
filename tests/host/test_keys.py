"""One way to write a key and its value, whichever door they come in by: the command line, a file,
a drive, a study or Python. The same mistake is told in the same words, as one class of error."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import hexatorque
from hexatorque import firmware, given, setups
from hexatorque.analysis.metrics import metrics
from hexatorque.cli import parameter_sets
from hexatorque.cli.main import main
from hexatorque.cli.options import schemes_given
from hexatorque.errors import InputError
from hexatorque.setups import paths
from hexatorque.sweeps import cycle as cycles
from hexatorque.sweeps import files as studies

PAPER_B = hexatorque.load("paper-b")
NUMBERS = json.loads(Path(__file__).with_name("numbers.json").read_text(encoding="utf-8"))


def in_python(path, value):
    return PAPER_B.changed({path: value})


def by_keyword(path, value):
    return PAPER_B.changed(**{path.replace(".", "__"): value})


def in_a_file(path, value):
    section, key = path.split(".")
    return setups.parse(f'setup = "paper-b"\n[{section}]\n{key} = "{value}"\n', "test")


def on_a_command_line(path, value):
    from hexatorque.cli.options import settings_given

    return PAPER_B.changed(settings_given([f"{path}={value}"]))


def in_a_study(path, value):
    from hexatorque.sweeps import space

    study = hexatorque.Study("paper-b", {path: [value]})
    return space.changed(study.setup, study.space.case(0).values)


DOORS = [in_python, by_keyword, in_a_file, on_a_command_line, in_a_study]


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("path", "text", "value"),
    [
        ("machine.rs_ohm", "5,5", 5.5),
        ("machine.rs_ohm", " 5.5 ", 5.5),
        ("machine.rs_ohm", "55e-1", 5.5),
        ("point.speed_rpm", "−400", -400.0),
        ("sensors.encoder_ppr", "2048", 2048),
        ("controller.torque_band_Nm", "0,6", 0.6),
        ("controller.scheme", "DTC3", "dtc3"),
        ("controller.scheme", "Ddr-ML", "ddr-ml"),
        ("controller.zero_hold", "OFF", "off"),
        ("controller.torque_levels", "3", "3"),
        ("timing.device", "F28335", "f28335"),
        ("load.kind", "Fan", "fan"),
    ],
)
def test_a_value_is_read_alike_everywhere(door, path, text, value):
    assert door(path, text)[path] == value


def test_numbers_are_read_as_the_page_reads_them():
    """The page is tried with the same texts (monitor/test_page.py). It has no use for numbers that
    are not finite."""
    for text, number in NUMBERS["numbers"].items():
        assert given.real(text) == number, text
    for text in NUMBERS["no numbers"]:
        with pytest.raises(ValueError):
            print(text, given.real(text))
    assert not any(math.isfinite(given.real(text)) for text in NUMBERS["not finite"])


@pytest.mark.parametrize("door", [in_python, in_a_file, on_a_command_line])
def test_six_numbers_are_read_alike_everywhere(door):
    for text in ("1.5 1 1 1 1 1", "1,5; 1; 1; 1; 1; 1", "[1.5, 1, 1, 1, 1, 1]", "1.5,1,1,1,1,1"):
        assert door("sensors.i_gain", text)["sensors.i_gain"] == (1.5, 1, 1, 1, 1, 1)


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("path", "text", "line"),
    [
        ("machine.rs_ohms", "1", "unknown key machine.rs_ohms; did you mean 'rs_ohm'?"),
        ("machine.lls_h", "1", "unknown key machine.lls_h; did you mean 'lls_H'?"),
        ("machina.rs_ohm", "1", "unknown section 'machina'; did you mean 'machine'?"),
        ("controller.predict", "on", "controller.predict: set timing.latency (none, "),
        ("machine.rs_ohm", "-1", "machine.rs_ohm = -1: allowed range is 0.0001 .. 1000 ohm"),
        ("machine.rs_ohm", "nan", "machine.rs_ohm = nan: allowed range is 0.0001 .. 1000 ohm"),
        ("machine.rs_ohm", "1.000,5", "machine.rs_ohm = '1.000,5': a number is needed"),
        ("machine.rs_ohm", "1_0", "machine.rs_ohm = '1_0': a number is needed"),
        ("sensors.adc_bits", "7,5", "sensors.adc_bits = 7.5: allowed range is 6 .. 12, whole"),
        ("controller.scheme", "dtc9", "controller.scheme = 'dtc9': choose one of dtc1, dtc2"),
        ("timing.latency", "soon", "timing.latency = 'soon': choose one of none, immediate"),
    ],
)
def test_a_mistake_is_told_in_the_same_words_everywhere(door, path, text, line):
    with pytest.raises(InputError) as caught:
        door(path, text)
    assert str(caught.value).startswith(line) and "\n" not in str(caught.value)


@pytest.mark.parametrize("path", ["rs_ohm", "RS_OHM", "rs_ohms", "rs_ohm.machine", 3, None, ("a",)])
def test_a_path_without_a_section_says_where_it_may_belong(path):
    for ask in (PAPER_B.__getitem__, lambda p: PAPER_B.changed({p: 2})):
        with pytest.raises(InputError, match="unknown") as caught:
            ask(path)
        if isinstance(path, str) and "." not in path:
            assert "machine.rs_ohm or controller.rs_ohm" in str(caught.value)


def test_every_key_of_a_setup_has_a_value():
    values = {path: PAPER_B[path] for path in PAPER_B}
    assert values["machine.rs_ohm"] == 6.0 and values["profile.duration_s"] == 1.0
    assert None not in values.values()
    told = {name: values[f"controller.{name}"] for name in paths.controller()}
    used = setups.parameters(PAPER_B)
    assert told == {name: used[name] for name in told}
    assert used.keys() - told.keys() == set(paths.TIMING_OWNS)
    assert all(PAPER_B[f"controller.{name}"] == used[name] for name in paths.TIMING_OWNS)
    assert "machine.rs_ohm" in PAPER_B and "rs_ohm" not in PAPER_B and 3 not in PAPER_B


def test_a_setup_has_the_keys_of_its_own_model_of_machine():
    magnet = setups.load("magnet-interior")
    own = {"machine.psi_f_Wb", "machine.ld_H", "machine.lq_H"}
    others = {"machine.rr_ohm", "machine.lm_H", "machine.psi_knee_Wb"}
    assert own <= set(magnet) and not others & set(magnet)
    assert others <= set(PAPER_B) and not own & set(PAPER_B)
    assert all(magnet[path] is not None for path in magnet)
    assert "machine.ld_H" in magnet and "machine.ld_H" not in PAPER_B
    for setup, path in ((PAPER_B, "machine.ld_H"), (magnet, "machine.lm_H")):
        with pytest.raises(InputError, match=f"^{path}: the model .* has no such value$"):
            setup[path]


def test_a_setup_is_shown_in_a_line():
    assert repr(PAPER_B).startswith("<Setup paper-b: Paper B") and len(repr(PAPER_B)) < 150


def test_the_profile_changes_by_its_keys():
    other = PAPER_B.changed({"profile.duration_s": "2,5", "profile.speed_rpm": "[[0.1, 400]]"})
    assert other.profile == setups.Profile(2.5, ((0.1, 400.0),))
    assert other.changed({"profile.load_Nm": 0.5}).profile.speed_rpm == ((0.1, 400.0),)
    flight = PAPER_B.changed({"profile.set": [[0.5, "controller.scheme", "DTC2"]]})
    assert flight.profile.set == ((0.5, "scheme", "dtc2"),)


def test_numbers_of_numpy_are_numbers():
    for number in (np.float32(5.5), np.float64(5.5), np.array(5.5)):
        assert PAPER_B.changed({"machine.rs_ohm": number})["machine.rs_ohm"] == 5.5
    gains = PAPER_B.changed({"sensors.i_gain": np.full(6, 1.1)})["sensors.i_gain"]
    assert gains == (1.1,) * 6


def test_a_scheme_is_found_whatever_its_letters():
    assert PAPER_B.with_scheme("DB-DTFC")["timing.latency"] == "predicted"
    assert schemes_given("DTC1,Dtc-SVM,dtc1", laws=True) == ["dtc1", "dtc-svm"]
    assert hexatorque.Study("paper-b", schemes=["DDR"]).space.schemes == ("ddr",)
    with pytest.raises(InputError, match="choose one of dtc1, dtc2"):
        PAPER_B.with_scheme("dtc9")
    with pytest.raises(InputError, match="no scheme 'dtc9': choose from dtc1"):
        schemes_given("dtc9")


def test_no_two_choices_differ_by_case_only():
    tables = [paths.keys(section).values() for section in paths.WITH_PATHS]
    for key in (key for table in tables for key in table):
        assert len({choice.lower() for choice in key.choices}) == len(key.choices)
        assert all(given.choice(one.upper(), key.choices) == one for one in key.choices)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["run", "FILE", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean 'rs_ohm'?"),
        (["run", "FILE", "--set", "machine.rs_ohm=-1"], "machine.rs_ohm = -1: allowed range is"),
        (["run", "FILE", "--set", "machine.rs_ohm"], "--set machine.rs_ohm: SECTION.KEY=VALUE is"),
        (["run", "FILE", "--set", "rs_ohm=1"], "did you mean machine.rs_ohm or controller.rs_ohm?"),
        (["compare", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean 'rs_ohm'?"),
        (["compare", "--set", "controller.scheme=ddr"], "here --schemes says which schemes run"),
        (["reach", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean 'rs_ohm'?"),
        (["sweep", "pareto", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean"),
        (["check", "paper-b", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean"),
        (["check", "paper-b", "--set", "machine.rs_ohm=-1"], "machine.rs_ohm = -1: allowed range"),
        (["tune", "paper-b", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean"),
        (
            ["tune", "paper-b", "--scheme", "ddr", "--set", "controller.scheme=fdr"],
            "here --scheme says which scheme is tuned",
        ),
        (["tune", "paper-b", "--set", "profile.duration_s=2"], "without its profile"),
        (["board", "serve", "--set", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean"),
        (["sweep", "--grid", "machine.rs_ohms=1"], "machine.rs_ohms; did you mean 'rs_ohm'?"),
    ],
)
def test_the_command_line_says_it_in_one_line(words, line, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.toml").write_text('setup = "paper-b"\n[profile]\nduration_s = 0.01\n')
    assert main([word.replace("FILE", "one.toml") for word in words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and line in said


def test_run_uses_what_is_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.toml").write_text('setup = "paper-b"\n[profile]\nduration_s = 1.0\n')
    words = ["--set", "controller.scheme=DTC3", "--set", "machine.rs_ohm=5,5"]
    short = ["--set", "profile.duration_s=0,01", "-o", "one.npz"]
    assert main(["run", "one.toml", *words, *short]) == 0
    recording = hexatorque.Recording.load("one.npz")
    assert recording.meta["scheme"] == "dtc3" and recording.duration_s == pytest.approx(0.01)
    assert recording.meta["parameters"]["machine"]["rs_ohm"] == 5.5


def test_a_review_is_of_what_is_set(capsys):
    """Half the link's voltage does not turn the machine at rated speed with its full flux."""

    def reach(*words):
        main(["check", "paper-b", "--schemes", "dtc1", "--json", *words])
        found = json.loads(capsys.readouterr().out)["findings"]
        return next(f["value"] for f in found if f["subject"] == "reach with the full flux")

    half = ("--set", "inverter.vdc_V=150", "--set", "controller.vdc_min_V=100")
    assert 0.4 * reach() < reach(*half) < 0.5 * reach()
    main(["check", "paper-b", *half])
    assert f"paper-b {' '.join(half)}" in " ".join(capsys.readouterr().out.split())


def test_a_tuned_file_has_what_was_set():
    from types import SimpleNamespace

    from hexatorque.tuning import report
    from hexatorque.tuning.course import usual_points
    from hexatorque.tuning.tuning import Request

    changed = PAPER_B.with_scheme("ddr").changed({"machine.rs_ohm": "5,5", "rated.current_A": 2})
    request = Request(changed, tuple(usual_points(changed)), {}, 1, 1)
    best = SimpleNamespace(chosen={"kp_xy_pu_A": 0.02})
    text = report.setup_text(SimpleNamespace(request=request, best=best), "paper-b")
    written = setups.parse(text, "tuned")
    assert written["machine.rs_ohm"] == 5.5 and written["rated.current_A"] == 2
    assert (written["controller.scheme"], written["controller.kp_xy_pu_A"]) == ("ddr", 0.02)
    kept = [key for key in PAPER_B if key not in ("machine.rs_ohm", "rated.current_A")]
    assert all(written[k] == changed[k] for k in kept if not k.startswith("controller."))


def test_a_sweep_starts_from_what_is_set():
    from hexatorque.sweeps import files, space

    data = {"setup": "paper-b", "vary": {"point.load_Nm": [1.0]}, "set": {"machine.rs_ohm": "5,5"}}
    assert files.make(data).setup["machine.rs_ohm"] == 5.5
    assert space.read_text("machine.rs_ohm=5,6", "--grid")[1] == [5, 6]
    assert space.read_text("machine.rs_ohm=5,5;6", "--grid")[1] == [5.5, 6]
    assert space.read_text("machine.rs_ohm=5,5:6:3", "--grid")[1] == {
        "from": 5.5,
        "to": 6,
        "count": 3,
    }


def test_a_drive_takes_keys_and_text_as_a_setup_does():
    drive = hexatorque.SimulatedDrive(PAPER_B)
    drive.set_many({"controller.scheme": "DTC3", "speed_ref_rpm": "400,5"})
    assert (drive.get("scheme"), drive.get("controller.speed_ref_rpm")) == ("dtc3", 400.5)
    drive.set("load_Nm", "1,5")
    assert drive.load_Nm == 1.5


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("sped_ref_rpm", 1, "no parameter 'sped_ref_rpm'; did you mean 'speed_ref_rpm'?"),
        ("machine.rs_ohm", 1, "section machine belongs to a set-up; did you mean 'controller.rs_o"),
        ("rs_ohm", -1, "rs_ohm = -1: allowed range is 0 .. 1000 ohm"),
        ("rs_ohm", "much", "rs_ohm = 'much': a number is needed"),
        ("scheme", "dtc9", "scheme = 'dtc9': choose one of dtc1"),
        ("load_Nm", "much", "load_Nm = much: a finite number is needed"),
    ],
)
def test_a_drive_says_what_is_wrong_with_a_key_or_a_value(name, value, line):
    with pytest.raises(InputError) as caught:
        hexatorque.SimulatedDrive(PAPER_B).set(name, value)
    assert line in str(caught.value)


def test_a_drive_has_no_key_that_it_does_not_know():
    drive = hexatorque.SimulatedDrive(PAPER_B)
    with pytest.raises(InputError, match="no parameter 'x'; known: scheme"):
        drive.get("x")


@pytest.mark.parametrize("duration_s", [-1, float("nan"), "long", None, np.zeros(2), 10**400])
def test_time_does_not_run_backwards(duration_s):
    drive = hexatorque.SimulatedDrive(PAPER_B)
    with pytest.raises(InputError) as told:
        drive.run(duration_s)
    assert f"duration_s = {duration_s}: a time of 0 s or more" in str(told.value)


@pytest.mark.parametrize("after_s", [-1, 3601, 1e99, float("inf"), "soon", np.zeros(2)])
def test_a_leg_breaks_within_the_longest_simulated_time(after_s):
    drive = hexatorque.SimulatedDrive(PAPER_B)
    with pytest.raises(InputError) as told:
        drive.break_leg("u1", "open", after_s)
    assert f"after_s = {after_s}: a time of 0 to 3600 s" in str(told.value)


@pytest.mark.parametrize("other", ["examples/reversal.toml", None, PAPER_B])
def test_a_drive_follows_nothing_but_a_profile(other):
    with pytest.raises(InputError, match=r"a profile is needed, such as .*\.profile$"):
        hexatorque.SimulatedDrive(PAPER_B).run_profile(other)


RECORDED = hexatorque.Recording(10.0, {"a_A": np.arange(20.0), "b_V": np.ones(20)}, {"a_A": "A"})


@pytest.mark.parametrize(
    ("used", "line"),
    [
        (lambda: hexatorque.load(" "), "setup = ' ': the name or the file of a set-up is needed"),
        (lambda: RECORDED.save(None), "file = None: the name of a file is needed"),
        (lambda: hexatorque.Recording.load(3), "file = 3: the name of a file is needed"),
        (lambda: RECORDED.plot("a", file=3), "file = 3: the name of a file is needed"),
        (lambda: hexatorque.SimulatedDrive(PAPER_B, controller=3), "controller = 3: a Law is"),
        (lambda: hexatorque.BoardDrive("/dev/ttyUSB0"), "BoardDrive.open(PORT) connects to a"),
        (lambda: metrics(3), "rec = 3: a Recording is needed"),
    ],
)
def test_a_wrong_kind_of_value_is_one_line(used, line):
    with pytest.raises(InputError) as told:
        used()
    assert line in str(told.value)


@pytest.mark.parametrize("name", [["a_A", "b_V"], {"a_A": 1}, None, 3])
@pytest.mark.parametrize("use", ["__getitem__", "plot", "to_pandas"])
def test_a_channel_s_name_is_text(name, use):
    assert name not in RECORDED
    with pytest.raises(InputError, match="no channel"):
        getattr(RECORDED, use)(name)


@pytest.mark.parametrize("time_s", [None, "soon", [1], float("nan")])
def test_a_window_is_between_two_times(time_s):
    for window in ((time_s, 1.0), (0.0, time_s)):
        with pytest.raises(InputError, match="a time in s is needed"):
            RECORDED.window(*window)


def test_a_window_without_an_end_has_all_that_follows():
    whole = RECORDED.window(float("-inf"), float("inf"))
    assert np.array_equal(whole["a_A"], RECORDED["a_A"]) and whole.start_s == 0.0
    assert np.array_equal(RECORDED.window(1.5, float("inf"))["a_A"], np.arange(15.0, 20.0))
    assert len(RECORDED.window(5.0, 7.0)) == 0


def test_a_recording_has_names_with_arrays():
    with pytest.raises(InputError, match="names with arrays"):
        hexatorque.Recording(10.0, [1.0, 2.0])
    with pytest.raises(InputError, match="unknown suffix"):
        hexatorque.Recording.load("")


def test_a_parameter_s_text_is_read_by_the_same_rule():
    table = firmware.parameters()
    assert table["rs_ohm"].parse("1,5") == table["rs_ohm"].parse(np.float64(1.5)) == 1.5
    assert table["scheme"].parse("DDR") == table["scheme"].parse("ddr")


DRIVEN = '# Ω, µs\nsetup = "paper-b"\n[machine]\nrs_ohm = 2.5\n'
STUDIED = '# Ω\nsetup = "paper-b"\nmetrics = ["torque_Nm"]\n[vary.point]\nspeed_rpm = [100, 200]\n'
CYCLED = "# µ\ntime_s,speed_rpm,torque_Nm\n0,0,0\n1,100,0.5\n"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_every_editor_s_file_is_read(tmp_path, code, end):
    def written(name, text):
        (tmp_path / name).write_bytes(text.replace("\n", end).encode(code))
        return tmp_path / name

    assert setups.load(written("own.toml", DRIVEN))["machine.rs_ohm"] == 2.5
    assert "point.speed_rpm" in str(studies.read(written("study.toml", STUDIED)).as_json())
    assert cycles.read(written("cycle.csv", CYCLED)).speed == (0, 100)


@pytest.mark.parametrize("content", [b"\x7fELF\x02\x01\x01\0\0\0", bytes(range(256)), b"\0"])
def test_a_program_is_no_text(tmp_path, content):
    for name, read in (
        ("own.toml", setups.load),
        ("study.toml", studies.read),
        ("cycle.csv", cycles.read),
        ("board.toml", lambda path: parameter_sets.parameter_set(str(path), None)),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match="not a text file") as told:
            read(tmp_path / name)
        assert name in str(told.value)
