"""What a tuning chooses, and what it writes."""

import json
import math
import sys
import tomllib
from dataclasses import replace

import pytest

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.cli.tuning import _lines_of_errors
from hexatorque.setups import Value
from hexatorque.tuning import aim, course, edit, report, search, space, tuning
from hexatorque.tuning.aim import Figures
from hexatorque.tuning.course import Lost, Where

pytest.importorskip("optuna")

SAME = Figures(1000.0, 0.5, 1.0, 10.0, 5000.0, 100.0, 20.0)
POINT = Where(2500, 2.0)


# --- aim ------------------------------------------------------------------------------------


def test_the_aim_is_the_mean_ratio():
    weights = {"ripple": 1.0, "thd": 1.0, "fsw": 2.0}
    half = replace(SAME, torque_ripple_td_Nm=0.5)
    assert aim.aim(weights, [SAME, SAME], [SAME, SAME]) == 0
    assert math.exp(aim.aim(weights, [half, half], [SAME, SAME])) == pytest.approx(0.5**0.25)
    assert math.exp(aim.aim(weights, [half, SAME], [SAME, SAME])) == pytest.approx(0.5**0.125)
    # What one figure gains another may lose.
    traded = replace(half, thd_inf_pct=20.0)
    assert aim.aim(weights, [traded], [SAME]) == pytest.approx(0)
    # A speed error that nobody sees does not count.
    quiet = [replace(SAME, speed_error_rpm=rpm) for rpm in (0.01, 0.1)]
    assert aim.aim({"speed": 1.0}, quiet[:1], quiet[1:]) == 0


# --- what moves -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scheme, own",
    {
        "dtc1": {"torque_band_Nm", "flux_band_Wb"},
        "dtc3": {"torque_band_Nm", "flux_band_Wb", "torque_inner_Nm"},
        "ddr": {"torque_band_Nm", "flux_band_Wb", "kp_xy_pu_A", "ki_xy_pu_As"},
        "db-dtfc": {"kappa", "kappa_from_pu"},
    }.items(),
)
def test_what_the_scheme_uses_moves(scheme, own):
    setup = setups.load("small-2kw").with_scheme(scheme)
    found = {knob.name: knob for knob in space.knobs(setup)}
    assert set(found) == own | {"crossover_Hz", "kp_speed_Nms_rad", "ki_speed_Nm_rad"}
    for knob in found.values():
        assert knob.low <= knob.start <= knob.high
    off = setup.changed(controller__ki_speed_Nm_rad=0.0, controller__observer="voltage")
    assert {knob.name for knob in space.knobs(off)} == own | {"kp_speed_Nms_rad"}


def test_the_inner_band_stays_within_the_outer():
    setup = setups.load("paper-b")
    inner = setup.parameter("torque_inner_Nm")
    chosen = space.settings(setup, {"torque_band_Nm": inner / 2})
    assert chosen["torque_inner_Nm"] == chosen["torque_band_Nm"]


# --- what is chosen -------------------------------------------------------------------------


@pytest.fixture
def limits(monkeypatch):
    """A drive that is the better the wider its torque band. It trips beyond twice the band, and
    with a wrong sigma L_s from 1.5 times on."""
    setup = setups.load("paper-b")
    band, sigma = setup.parameter("torque_band_Nm"), setup.parameter("sigma_ls_H")

    def drive(setup, points, plan, progress=None):
        share = setup.parameter("torque_band_Nm") / band
        wrong = setup.parameter("sigma_ls_H") != pytest.approx(sigma, rel=1e-3)
        if share > (1.5 if wrong else 2.0):
            raise Lost("tripped")
        return [replace(SAME, torque_ripple_td_Nm=1 / share) for _ in points]

    monkeypatch.setattr(course, "drive", drive)
    return tuning.Request(setup, (POINT,), aim.usual_weights(), trials=32)


def test_a_candidate_that_trips_is_never_chosen(limits):
    request = limits
    band = request.setup.parameter("torque_band_Nm")
    tuned = tuning.tune(request, jobs=1)
    lost = [o.chosen["torque_band_Nm"] / band for o in tuned.tried if o.lost]
    held = [o.chosen["torque_band_Nm"] / band for o in tuned.tried[1:] if not o.lost]
    assert lost and min(lost) > 2 >= max(held) and max(held) > 1.5  # the temptation was there
    chosen = tuned.best.chosen["torque_band_Nm"] / band
    assert tuned.better and tuned.refused > 0
    assert 1 < chosen <= 1.5 and chosen == max(share for share in held if share <= 1.5)
    assert tuned.errors == {name: ("", "") for name, _, _ in tuning.errors_of(request.setup)}
    assert tuned.setup.values["controller"]["torque_band_Nm"].tag == "tuned"


def test_an_error_that_nothing_holds_excludes_nothing(limits, monkeypatch):
    """The start itself does not hold it: it is told, and no candidate is blamed."""
    request = limits
    inner = course.drive

    def drive(setup, *rest):
        if setup.parameter("rs_ohm") < 0.9 * request.setup.parameter("rs_ohm"):
            raise Lost("tripped")
        return inner(setup, *rest)

    monkeypatch.setattr(course, "drive", drive)
    tuned = tuning.tune(replace(request, trials=16), jobs=1)
    assert tuned.better and tuned.errors["R_s -30 %"] == ("tripped", "tripped")


def test_what_is_held_since_tuning_does_not_read_like_a_trip_of_the_tuned_drive():
    errors = {"R_s -30 %": ("", ""), "L_m -30 %": ("tripped", ""), "J -30 %": ("lost", "lost too")}
    assert _lines_of_errors(errors) == [
        "L_m -30 %: held after tuning; before tuning: tripped",
        "J -30 %: held neither before nor after tuning: lost too",
    ]


def test_without_a_better_one_the_set_up_stays(limits, monkeypatch):
    request = limits
    monkeypatch.setattr(course, "drive", lambda setup, points, *rest: [SAME for _ in points])
    tuned = tuning.tune(replace(request, trials=4), jobs=1)
    assert not tuned.better and tuned.setup.values == request.setup.values


def test_an_error_of_the_main_inductance_is_one_of_the_rotor_s():
    setup = setups.load("small-2kw")
    wrong = tuning.wrong(setup, "lm_H", 0.7)
    assert wrong.parameter("lm_H") == pytest.approx(0.7 * 0.614)
    assert wrong.parameter("lr_H") == pytest.approx(0.0128 + 0.7 * 0.614)
    assert wrong.machine_values() == setup.machine_values()


def test_an_error_of_the_inertia_leaves_the_controller_as_it_is():
    """Even though its speed loop and its slow interrupt are derived from the inertia."""
    setup = setups.load("small-2kw")
    wrong = tuning.wrong(setup, tuning.INERTIA, 0.7)
    assert wrong["machine.inertia_kgm2"] == pytest.approx(0.7 * setup["machine.inertia_kgm2"])
    assert setups.parameters(wrong) == setups.parameters(setup)


def test_a_speed_loop_that_does_not_count_stays():
    request = tuning.Request(setups.load("paper-b"), (POINT,), aim.read_weights("speed=0"))
    assert {knob.name for knob in request.knobs()} == {
        "torque_band_Nm", "flux_band_Wb", "crossover_Hz"
    }  # fmt: skip


# --- what is written ------------------------------------------------------------------------


def test_the_written_set_up_gives_the_figures_reported(tmp_path, monkeypatch, capsys):
    errors_of = tuning.errors_of
    monkeypatch.setattr(tuning, "errors_of", lambda setup: errors_of(setup)[-1:])
    mine = tmp_path / "mine.toml"
    mine.write_text(
        '# my drive\nsetup = "paper-b"\n[controller]\nscheme = "dtc1"  # as in the paper\n'
        "flux_band_Wb = 0.003  # first guess\n\n[load]\nkind = 'fan'\n"
    )
    folder = tmp_path / "out"
    command = ["tune", str(mine), "--points", "2500:2", "--trials", "3", "--weights", "speed=4"]
    assert main([*command, "-o", str(folder), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((folder / "tune.json").read_text())
    text = (folder / "mine-tuned.toml").read_text()
    assert said["better"] and text.startswith("# my drive\n")
    for comment in ("# as in the paper", "# first guess"):
        assert comment in text
    written = setups.load(folder / "mine-tuned.toml")
    assert written["load.kind"] == "fan"
    for name, row in said["parameters"].items():
        assert written.parameter(name) == pytest.approx(row["after"], rel=1e-6)
    plan = course.times(setups.load(mine), [POINT])
    (again,) = course.drive(written, [POINT], plan)
    assert again.as_json() == pytest.approx(said["after"][0], rel=1e-7)
    page = (folder / "report.html").read_text()
    assert "data:image/png" in page and "holds" in page
    # Once more: nothing is left to simulate but the start and the errors.
    judged = []
    monkeypatch.setattr(tuning.Judge, "__call__", lambda *_: judged.append(1))
    monkeypatch.setattr(report, "draw", lambda tuned, path: path)
    assert main([*command, "-o", str(folder), "--json", "--resume"]) == 0
    assert not judged and json.loads(capsys.readouterr().out) == said
    # Fewer than are there: it is said that none comes.
    fewer = ["2" if word == "3" else word for word in command]
    assert main([*fewer, "-o", str(folder), "--resume"]) == 0
    said_last = " ".join(capsys.readouterr().out.split())
    assert said_last.endswith("the study had 3 candidates already: --trials 2 adds none")


@pytest.mark.parametrize(
    "before, after",
    (
        ('a = 1\n[b] # here\nx = "#"  # why\ny = 2\n', "[b] # here\nx = 3.5  # why\ny = 2\n"),
        ("[b]\n\n[c]\nx = 1\n", "[b]\nx = 3.5\n\n[c]\nx = 1\n"),
        ("[c]\n", "[c]\n\n[b]\nx = 3.5\n"),
    ),
)
def test_the_rest_of_a_text_stays(before, after):
    assert edit.edited(before, {"b": {"x": Value(3.5, "user")}}).endswith(after)


@pytest.mark.parametrize("text", ("b.x = 1\n", "b = { x = 1 }\n", "[b.x]\nvalue = 1\n"))
def test_a_section_may_be_written_in_any_form(text):
    tuned = edit.edited(f"a = 1  # one\n{text}", {"b": {"x": Value(3.5, "tuned", 'a "note"')}})
    assert tuned.startswith("a = 1  # one\n")
    row = {"value": 3.5, "tag": "tuned", "note": 'a "note"'}
    assert tomllib.loads(tuned) == {"a": 1, "b": {"x": row}}


# --- mistakes -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options, code, says",
    (
        (["--scheme", "ddx"], 2, "no scheme 'ddx': choose from dtc1"),
        (["--scheme", "ddr,fdr"], 2, "--scheme: ddr,fdr: one scheme is needed"),
        (["--points", "1000"], 2, "point '1000': RPM:NM is needed"),
        (["--points", ""], 2, "no point is given"),
        (["--points", "1000:9"], 2, "allowed range of the load is -4 .. 4 N m"),
        (["--points", "9000:1"], 2, "(speed_trip_rpm)"),
        (["--weights", "ripple=0,thd=0,fsw=0,loss=0,speed=0"], 2, "all weights are 0"),
        (["--weights", "riple=1"], 2, "did you mean 'ripple'?"),
        (["--weights", "thd=-1"], 2, "weight thd = -1: allowed range is 0 .. 1000"),
        (["--trials", "0"], 2, "--trials: 0: allowed range is 1 .. 100000"),
        (["--resume"], 2, "no study is there"),
        (["--points", "5900:4", "--trials", "1"], 1, "before tuning: 5900 r/min, 4 N m: "),
    ),
)
def test_mistakes_are_said_in_one_line(options, code, says, tmp_path, capsys):
    assert main(["tune", "paper-b", "-o", str(tmp_path), *options]) == code
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and says in said


def test_without_optuna_it_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert main(["tune", "paper-b", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        "hexatorque: tune needs Optuna, which is not installed: pip install 'hexatorque[tune]'\n"
    )
    with pytest.raises(search.NotInstalled):
        search.library()
