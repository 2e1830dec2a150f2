"""A bench beside its simulation (`hexatorque board compare`). The benches here are simulations with
one parameter changed: it has to be named, and its change found."""

import json

import numpy as np
import pytest
from campaigns import part
from drawn_benches import explanations

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.recording.recording import Recording
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.twin import bench, candidates, fit, joint, replay, report

CANDIDATES = {one.name: one for one in candidates.suitable(setups.load("paper-a"), False, True)}
#: Of the parameters that are tried, enough to be mistaken for each other.
TRIED = [CANDIDATES[name] for name in ("R_s", "R_r", "gain of current sensor w1", "J", "load")]
LOAD_NM = 4.0


@pytest.fixture(scope="module")
def setup():
    """Its controller's parameters are written down: a change of the machine is not one of them."""
    plain = setups.load("paper-a-feasible").changed(
        sensors__i_noise_A=0.02, controller__build_s=0.2
    )
    values = {f"controller__{k}": v for k, v in setups.parameters(plain).items()
              if k not in TIMING_OWNS}  # fmt: skip
    return plain.changed(**values)


def recorded(setup, prepare=None, every=10, place=0, load_Nm=LOAD_NM):
    """What a board would stream at 1 kHz: start, up, down. every, place: of so many fast periods
    one is a sample, and which one."""
    drive = SimulatedDrive(setup.changed(sensors__noise_seed=99), 1)
    if prepare:
        prepare(drive)
    drive.run(0.003)
    drive.start()
    drive.run(0.26)
    drive.set_many({"load_Nm": load_Nm, "speed_ref_rpm": 500})
    drive.run(0.4)
    drive.set("speed_ref_rpm", 150)
    drive.run(0.25)
    return streamed(drive, every, place)


def streamed(drive, every, place):
    drive.check()
    rec = drive.take()
    own = {n: data[place::every] for n, data in rec.channels.items() if not n.startswith("plant.")}
    values = {name: drive.get(name) for name in drive.params}
    meta = {"scheme": values["scheme"], "parameters": {"controller": values}, "tick_Hz": 1e4}
    return Recording(1e4 / every, own, rec.units, meta)


def compared(setup, rec, load_Nm=LOAD_NM, tried=TRIED):
    one = bench.make(rec, "bench", setup)
    return fit.compare(setup, [one], ((float("-inf"), load_Nm),), tried)


@pytest.fixture(scope="module")
def faithful(setup):
    return recorded(setup)


def test_nothing_changed_nothing_accused(setup, faithful):
    found = compared(setup, faithful, tried=[CANDIDATES["R_s"], CANDIDATES["J"]])
    assert not found.differs and found.cause is None
    assert all(one.noise > 0 for one in found.differences)
    by_name = {one.candidate.name: one for one in found.explanations}
    assert abs(by_name["R_s"].change) < 0.01
    assert abs(by_name["J"].change) < 0.05


#: Parameter, its change, tolerance of what is found, and a quantity that differs.
CHANGED = [
    ("J", 0.3, 0.05, "shaft torque"),
    ("R_s", 0.2, 0.02, "R_s in use"),
    ("gain of current sensor w1", 0.05, 0.01, "sum of currents"),
]


@pytest.mark.parametrize("name, true, tolerance, where", part(CHANGED, 2))
def test_the_changed_parameter_is_named(setup, name, true, tolerance, where):
    candidate = CANDIDATES[name]
    wrong = candidate.apply(setup, true)
    if name == "J":
        wrong = setup.changed(machine__inertia_kgm2=setup["machine.inertia_kgm2"] * (1 + true))
    tried = [CANDIDATES[other] for other in sorted({name, "J", "load"})]
    found = compared(setup, recorded(wrong), tried=tried)
    assert found.differs and found.cause.candidate is candidate
    assert found.cause.change == pytest.approx(true, abs=tolerance)
    assert {d.name: d for d in found.differences}[where].differs


def test_what_cannot_be_told_apart_is_said(setup):
    """To the firmware, a threshold voltage of the devices looks like resistance at one amplitude of
    current, and this machine's is nearly constant."""
    candidate = CANDIDATES["device drops"]
    rec = recorded(candidate.apply(setup, 1.0))
    found = compared(setup, rec, tried=[candidate, CANDIDATES["R_s"]])
    assert found.differs
    assert {found.cause.candidate.name, *found.cause.like} == {"device drops", "R_s"}
    by_name = {one.candidate.name: one for one in found.explanations}
    assert by_name["device drops"].change == pytest.approx(1.0, abs=0.1)


def test_a_dead_time_of_the_inverter_is_found(setup):
    candidate = CANDIDATES["dead time"]
    found = compared(setup, recorded(setup, candidate.prepare(0.5)), tried=[candidate])
    assert found.differs
    assert found.cause.change == pytest.approx(0.5, abs=0.2)


#: Of how many fast periods one is a sample, and which one; the speed loop has one period in 100.
PLACES = [(20, 13), (10, 7), (20, 5)]


def worst(found):
    return max(one.ratio for one in found.differences)


def with_and_without_places(setup, scheme, every, place):
    """The comparison, and the same as if each sample were as early as it can have been."""
    modulated = setup.with_scheme(scheme)
    rec = recorded(modulated, every=every, place=place)
    tried = [CANDIDATES["R_r"], CANDIDATES["R_s"]]
    early = bench.make(rec, "bench", modulated)
    early.places = 1
    loads = ((float("-inf"), LOAD_NM),)
    return compared(modulated, rec, tried=tried), fit.compare(modulated, [early], loads, tried)


@pytest.mark.parametrize("every, place", part(PLACES, 2))
def test_where_a_sample_was_taken_is_found(setup, every, place):
    """A modulated scheme has its torque at the new reference after two periods. Samples of the next
    periods then say something else than those taken later."""
    found, early = with_and_without_places(setup, "foc", every, place)
    assert not found.differs, [d.name for d in found.differences if d.differs]
    assert early.differs


def test_under_deadbeat_control_the_false_difference_becomes_smaller(setup):
    """A part of it stays. How much depends on the recording, so that only the direction is a
    property."""
    found, early = with_and_without_places(setup, "db-dtfc", 20, 13)
    assert early.differs and worst(found) < worst(early)


def test_under_a_modulated_scheme_a_wrong_resistance_is_named(setup):
    """The place is found although the slip, which depends on it too, is wrong."""
    modulated = setup.with_scheme("db-dtfc")
    wrong = CANDIDATES["R_r"].apply(modulated, 0.2)
    rec = recorded(wrong, every=20, place=13)
    found = compared(modulated, rec, tried=[CANDIDATES[n] for n in ("R_r", "R_s", "load")])
    assert found.differs and found.cause.candidate.name == "R_r"
    assert found.cause.change == pytest.approx(0.2, abs=0.05)


def test_a_reference_before_the_drive_ran_is_no_period_of_it(setup):
    """The speed loop came by just before the drive began to run. Its next period is the first one
    with a reference, in the bench and in the simulation."""
    drive = SimulatedDrive(setup.changed(sensors__noise_seed=99), 1)
    slow = 100
    begun = round(sum(setup.parameter(key) for key in ("calibration_s", "build_s")) * 1e4)
    drive.set("speed_ref_rpm", 300)
    drive.run(((5 - begun) % slow) * 1e-4)
    drive.start()
    drive.run(0.9)
    one = bench.make(streamed(drive, 20, 11), "bench", setup)
    assert one.begins and one.first >= slow
    assert one.torque_ref_Nm[0] != 0


@pytest.mark.parametrize("late", (0, replay.LATER, 2 * replay.LATER))
def test_the_shaft_turns_as_far_as_that_of_the_bench(setup, faithful, monkeypatch, late):
    """A table scheme holds less torque than it is asked for, so that each period ends a little too
    slow. Without a correction the angles add up over all periods; with one that takes a share c of
    them back in each period, the shaft stays 1/c periods' worth behind."""
    one = bench.make(faithful, "bench", setup)
    begins_rad = (0, 1, -1)[late // replay.LATER] * replay._unknown_rad(one)

    def behind_rad():
        seen = replay.replay(one, setup, late=late).channels["speed_rpm"]
        rpm = seen.reshape(one.periods, -1)
        middle = rpm[:, rpm.shape[1] // 2]
        own = bench._held(np.asarray(one.samples["speed_rpm"], float), one.which, one.periods)
        return float(np.sum(middle - own)) * np.pi / 30 * one.slow_s

    corrected_rad = behind_rad() - begins_rad
    share = replay.CORRECTED
    monkeypatch.setattr(replay, "CORRECTED", 0.0)
    assert abs(corrected_rad) < 2 * abs(behind_rad()) / (share * one.periods)


def test_a_window_of_about_one_turn_gives_numbers(setup):
    """A window with less than one turn of the flux has no harmonics. A changed parameter turns a
    little more or less, so that the changed simulation lacks values that the bench has."""
    drive = SimulatedDrive(setup.changed(sensors__noise_seed=99), 1)
    drive.run(0.003)
    drive.set("speed_ref_rpm", 321)
    drive.start()
    drive.run(0.27)
    drive.set("load_Nm", -LOAD_NM)
    drive.run(1.06)
    found = compared(setup, streamed(drive, 10, 0), -LOAD_NM, [CANDIDATES["R_r"]])
    assert all(np.isfinite([one.change, one.left]).all() for one in found.explanations)
    assert np.isfinite([d.ratio for d in found.differences]).all()


# --- bad input: a line each ----------------------------------------------------------------


def refused(capsys, *arguments):
    assert main(["board", "compare", *map(str, arguments)]) in (1, 2)
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    return said[0]


@pytest.fixture
def saved(faithful, tmp_path):
    def save(change=lambda rec: None, **meta):
        rec = Recording(
            faithful.rate_Hz, dict(faithful.channels), faithful.units, {**faithful.meta, **meta}
        )
        change(rec)
        return rec.save(tmp_path / "run.npz")

    return save


def test_refusals(saved, capsys):
    def without(*names):
        return lambda rec: [rec.channels.pop(name) for name in names]

    def empty(rec):
        rec.channels = {name: data[:0] for name, data in rec.channels.items()}

    def idle(rec):
        rec.channels["state"] = np.zeros(len(rec))

    def shorter(rec):
        rec.channels = {name: data[:300] for name, data in rec.channels.items()}

    def rare(rec):
        rec.channels = {name: data[::20] for name, data in rec.channels.items()}
        rec.rate_Hz /= 20

    for file, words in (
        (lambda: saved(without("torque_ref_Nm")), "no torque_ref_Nm"),
        (lambda: saved(without("i_u1_A", "i_v1_A")), "two of i_u1_A, i_w1_A, i_v1_A"),
        (lambda: saved(empty), "no samples"),
        (lambda: saved(idle), "the drive does not run in it"),
        (lambda: saved(shorter), "0.2 s or more are needed"),
        (lambda: saved(rare), "50 samples per second: 100 or more"),
        (lambda: saved(scheme="dtc1"), "recorded with scheme dtc1"),
        (lambda: saved(tick_Hz=20e3), "recorded with f_isr_Hz = 20000"),
    ):
        path = file()
        said = refused(capsys, "paper-a-feasible", path)
        assert words in said and str(path) in said, said
    said = refused(capsys, "paper-a-feasible", saved(), "--load", "0:1,0:2")
    assert "--load 0:1,0:2" in said
    assert "no samples in the window" in refused(
        capsys, "paper-a-feasible", saved(), "--window", "7,8"
    )


def test_the_command(saved, tmp_path, capsys, monkeypatch):
    """Table, JSON, picture and page, and the exit code. The load is not told, so it is found."""
    monkeypatch.setattr(fit.compare, "__defaults__", (fit.NO_LOAD, TRIED[-1:], None))
    folder = tmp_path / "out"
    assert (
        main(["board", "compare", "paper-a-feasible", str(saved()), "-o", str(folder), "--json"])
        == 1
    )
    said = json.loads(capsys.readouterr().out)
    assert said["differs"] and said["cause"] == "load"
    assert said["parameters"][0]["change"] == pytest.approx(LOAD_NM, abs=0.2)
    assert any("does not carry the load" in note for note in said["recordings"][0]["notes"])
    page = (folder / "report.html").read_text()
    assert "best explanation: load" in page and "overlay-1.png" in page
    assert (folder / "overlay-1.png").stat().st_size > 10_000


# -- more than one parameter ---------------------------------------------------------------------

#: Between which sizes an error is drawn: well above what the recording shows.
DRAWN = {
    "R_s": (0.15, 0.3),
    "R_r": (0.15, 0.3),
    "L_m": (0.1, 0.2),
    "J": (0.35, 0.5),
    "load": (1.1, 1.6),
    "gain of current sensor w1": (0.03, 0.05),
}
SEVERAL = [*range(2, 8)]


def bench_with(setup, changes):
    wrong, load_Nm = setup, LOAD_NM
    for name, change in changes.items():
        if name == "J":
            path = "machine__inertia_kgm2"
            wrong = wrong.changed(**{path: wrong["machine.inertia_kgm2"] * (1 + change)})
        elif name == "load":
            load_Nm += change
        else:
            wrong = CANDIDATES[name].apply(wrong, change)
    return recorded(wrong, load_Nm=load_Nm)


@pytest.mark.parametrize("seed", part(SEVERAL, 2))
def test_drawn_pairs_and_triples_of_errors_are_found_together(setup, seed):
    """Each within four of its standard deviations, as the best explanation or as one that the
    recording does not tell from it."""
    rng = np.random.default_rng(seed)
    names = rng.choice(list(DRAWN), 2 + seed % 2, replace=False)
    changes = {str(n): rng.uniform(*DRAWN[n]) * rng.choice([-1, 1]) for n in names}
    rec = bench_with(setup, changes)
    found = compared(setup, rec, tried=[CANDIDATES[n] for n in DRAWN])
    (right,) = [one for one in explanations(found) if set(one) == set(changes)]
    for name, (change, deviation) in right.items():
        assert abs(change - changes[name]) < 4 * deviation, name
        assert deviation < abs(changes[name]) / 5
    assert found.sure <= set(changes) and not found.unexplained
    said = " ".join(report.verdict(found))
    if found.rivals:
        assert said.startswith("this recording does not tell apart: ")
        return
    assert said.startswith("more than one parameter is off; best explanation: ")
    remains = json.loads(json.dumps(report.as_json(found)))["together"]["remains"]
    assert remains < 0.5 * found.explanations[0].left


def test_one_error_is_not_explained_by_two(setup):
    rec = recorded(CANDIDATES["R_s"].apply(setup, 0.2))
    found = compared(setup, rec, tried=[CANDIDATES[n] for n in DRAWN])
    assert found.together is None and found.cause.candidate.name == "R_s"
    assert found.cause.change == pytest.approx(0.2, abs=4 * found.cause.deviation)


def test_what_no_parameter_explains_is_said(setup):
    """Two errors, and only one of them is among the parameters."""
    rec = bench_with(setup, {"R_s": 0.3, "gain of current sensor w1": 0.06})
    found = compared(setup, rec, tried=[CANDIDATES["R_s"], CANDIDATES["J"]])
    assert found.together is None and found.unexplained
    assert any(line == report.UNEXPLAINED for line in report.verdict(found))


def test_parameters_that_only_a_combination_shows_are_told():
    """By formulas: the effects of two parameters are nearly the same, their sum is known well."""
    rng = np.random.default_rng(1)
    size = 400
    common, own = rng.normal(size=size), 0.1 * rng.normal(size=size)
    one, two = CANDIDATES["R_s"], CANDIDATES["R_r"]
    effects = {one: 3000 * common, two: 3000 * (common + own)}

    def simulate(changes, late):
        moved = sum(effects[c] * x for c, x in changes)
        return moved + 0.3 * np.random.default_rng(late).normal(size=size), moved

    truth = [(one, 0.3), (two, -0.2)]
    residual = simulate(truth, 99)[0] + rng.normal(size=size)
    blocks = [np.arange(size) // 40]
    search = joint.Search(effects, {c.name: 0.0 for c in effects}, residual, blocks, simulate)
    found = search.best([one])
    ((first, second, correlation),) = found.bound_together
    assert {first, second} == {"R_s", "R_r"} and correlation < -0.9
    got = {c.name: (x, s) for c, x, s in zip(found.candidates, found.changes, found.deviations)}
    for c, x in truth:
        assert abs(got[c.name][0] - x) < 4 * got[c.name][1]
    alone = 1 / np.linalg.norm(effects[one])
    assert got["R_s"][1] > 5 * alone  # of the two, not of one
