"""A recording of an oscilloscope beside the simulation (`hexatorque board compare`): phase currents
and a speed, nothing that only the board knows. The benches are simulations; what is recorded is
their machine, with the noise of probes, at other instants than the board's."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.vsd import PHASES
from hexatorque.recording.mapping import mapped
from hexatorque.recording.recording import Recording, RecordingError
from hexatorque.setups import SetupError
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.twin import bench, candidates, fit, report, wiring

EVERY = {
    one.name: one
    for one in candidates.suitable(setups.load("paper-a"), outside=True, torque_known=False)
}
ALL_PROBES, PROBE_W1 = "scale of all current probes", "scale of current probe w1"
TRIED = [EVERY[name] for name in (ALL_PROBES, PROBE_W1, "L_m", "load")]
LOAD_NM, SPEED_RPM = 4.0, 500.0


@pytest.fixture(scope="module")
def setup():
    plain = setups.load("paper-a-feasible").changed(controller__build_s=0.2)
    values = {f"controller__{k}": v for k, v in setups.parameters(plain).items()
              if k not in TIMING_OWNS}  # fmt: skip
    return plain.changed(**values)


def seen(setup, load_Nm=LOAD_NM, speed_rpm=SPEED_RPM):
    """Steady state, 0.4 s at 50 kHz."""
    drive = SimulatedDrive(setup.changed(sensors__noise_seed=99), 5)
    drive.start()
    drive.run(0.27, record=False)
    drive.set_many({"load_Nm": load_Nm, "speed_ref_rpm": speed_rpm})
    drive.run(0.8, record=False)
    drive.run(0.4)
    drive.check()
    rec, random = drive.take(), np.random.default_rng(1)
    currents = {
        f"i_{p}_A": rec[f"plant.i_{p}_A"] + random.normal(0, 0.03, len(rec)) for p in PHASES
    }
    speed = rec["plant.speed_rpm"] + random.normal(0, 1, len(rec))
    return Recording(rec.rate_Hz, {**currents, "speed_rpm": speed}, {}, {}, 0.3)


@pytest.fixture(scope="module")
def faithful(setup):
    return seen(setup)


def scaled(rec, **factors):
    channels = {name: data * factors.get(name, 1.0) for name, data in rec.channels.items()}
    return replace(rec, channels=channels)


def compared(setup, rec, tried=TRIED, **more):
    loads = ((float("-inf"), LOAD_NM),)
    return fit.compare(setup, [bench.make(rec, "scope", setup, None, loads, **more)], loads, tried)


def test_nothing_changed_nothing_accused(setup, faithful):
    found = compared(setup, faithful)
    assert not found.differs and found.cause is None
    by_name = {one.name: one for one in found.differences}
    assert {"current amplitude", "slip", "unbalance"} <= set(by_name)
    # Ripple depends on the instants, the resistances in use are the board's.
    assert not {"current ripple", "R_s in use", "shaft torque", "estimated flux"} & set(by_name)
    amplitude = by_name["current amplitude"]
    assert amplitude.rms < 0.01 * amplitude.size


def test_what_cannot_be_seen_is_said(setup, faithful):
    tried = [EVERY[name] for name in ("J", "friction")]
    found = compared(setup, faithful, tried)
    assert set(found.hidden) == {"J", "friction"}
    assert any("not to be seen in this recording: J, friction" in s for s in report.verdict(found))
    assert any("J and friction cannot be seen" in note for note in found.benches[0].notes)


def test_a_load_that_is_not_told_is_found(setup):
    found = compared(setup, seen(setup, LOAD_NM + 2))
    assert found.cause.candidate.name == "load"
    assert found.cause.change == pytest.approx(2, abs=0.4)


@pytest.mark.parametrize("factor", [0.1, 10])
def test_a_wrong_scale_of_all_probes_is_no_other_machine(setup, faithful, factor):
    found = compared(setup, scaled(faithful, **{f"i_{p}_A": factor for p in PHASES}))
    assert found.cause.candidate.name == ALL_PROBES
    assert 1 + found.cause.change == pytest.approx(factor, rel=0.03)
    (hint,) = (note for note in found.notes if "check the probes' scale" in note)
    assert float(hint.split()[3]) == pytest.approx(factor, rel=0.03)


def test_the_wrong_scale_of_one_probe_is_named(setup, faithful):
    found = compared(setup, scaled(faithful, i_w1_A=1.5))
    assert found.cause.candidate.name == PROBE_W1
    assert found.cause.change == pytest.approx(0.5, abs=0.05)
    assert any(
        note.startswith("i_w1_A is 1.") and "check its probe's scale" in note
        for note in found.benches[0].notes
    )


def test_a_parameter_with_which_the_simulation_trips_explains_nothing(setup, faithful):
    """0.85 of the current would be L_m + 30 %."""
    lm = EVERY["L_m"]

    def apply(of, change):
        if change > 2 * lm.step:
            raise SetupError("drive tripped")
        return lm.apply(of, change)

    rec = scaled(faithful, **{f"i_{p}_A": 0.85 for p in PHASES})
    assert compared(setup, rec, [lm]).cause.candidate is lm
    found = compared(setup, rec, [replace(lm, apply=apply)])
    assert found.cause is None and any("drive tripped" in note for note in found.notes)


def test_two_currents_of_a_set_and_no_speed_are_enough(setup, faithful):
    names = ("i_u1_A", "i_w1_A", "i_u2_A", "i_v2_A")
    rec = replace(faithful, channels={name: faithful[name] for name in names})
    found = compared(setup, rec, speed_rpm=SPEED_RPM)
    assert not found.differs
    assert "slip" not in {one.name for one in found.differences}
    notes = " ".join(found.benches[0].notes)
    assert "no speed_rpm: 500 r/min are taken" in notes and "no torque_ref_Nm" in notes
    del rec.channels["i_v2_A"]
    with pytest.raises(RecordingError, match=r"no two of i_u2_A, i_w2_A, i_v2_A.*--map") as said:
        compared(setup, rec)
    assert "there are i_u1_A, i_w1_A, i_u2_A (--map" in str(said.value)


# -- the phases -----------------------------------------------------------------------------

T_S = np.arange(0, 0.5, 1e-4)


def turning(*, f_Hz=20.0, swap=(), turned=(), sizes=None):
    """Six currents with ripple. f_Hz < 0: backwards."""
    random = np.random.default_rng(2)
    phases = {}
    for name in PHASES:
        size = (sizes or {}).get(name, 5.0) * (-1 if name in turned else 1)
        ideal = size * np.cos(2 * np.pi * f_Hz * T_S - wiring.axes_rad(30.0)[name])
        phases[name] = ideal + random.normal(0, 0.2, len(T_S))
    if swap:
        a, b = swap
        phases[a], phases[b] = phases[b], phases[a]
    return phases


def speed(f_Hz=20.0):
    return np.full(len(T_S), 30 * f_Hz)


@pytest.mark.parametrize("f_Hz", [20.0, -20.0, 3.0, 133.0])
def test_right_phases_pass_in_either_direction(f_Hz):
    for known in (None, speed(f_Hz)):
        assert wiring.check(turning(f_Hz=f_Hz), 1e4, known) == []


@pytest.mark.parametrize("f_Hz", [20.0, -20.0])
@pytest.mark.parametrize("a", range(6))
@pytest.mark.parametrize("b", range(6))
def test_exchanged_phases_are_named(a, b, f_Hz):
    if a >= b:
        return
    with pytest.raises(RecordingError) as said:
        wiring.check(turning(f_Hz=f_Hz, swap=(PHASES[a], PHASES[b])), 1e4, speed(f_Hz))
    for name, other in ((PHASES[a], PHASES[b]), (PHASES[b], PHASES[a])):
        assert f"i_{name}_A is not phase {name}" in str(said.value)
        assert f"it is like {other}" in str(said.value)
    assert str(said.value).count("is not phase") == 2 and "\n" not in str(said.value)


@pytest.mark.parametrize("name", PHASES)
def test_a_probe_turned_round_is_named(name):
    for known in (None, speed()):
        with pytest.raises(RecordingError, match="it is like a probe turned round") as said:
            wiring.check(turning(turned=(name,)), 1e4, known)
        assert str(said.value).startswith(f"i_{name}_A is not phase {name}")
        assert str(said.value).count("is not phase") == 1


def test_a_reversal_of_the_speed_in_the_recording():
    forwards, back = turning(f_Hz=20.0), turning(f_Hz=-20.0)
    both = {name: np.concatenate([forwards[name], back[name]]) for name in PHASES}
    for known in (None, np.concatenate([speed(20.0), speed(-20.0)])):
        assert wiring.check(both, 1e4, known) == []


def test_a_small_or_large_current_is_told_and_standing_currents_are_not_judged():
    notes = wiring.check(turning(sizes={"v2": 0.1}), 1e4, None)
    assert len(notes) == 1 and notes[0].startswith("i_v2_A is 0.0")
    for standing in (turning(f_Hz=0.0), {name: np.zeros(len(T_S)) for name in PHASES}):
        assert "do not turn" in wiring.check(standing, 1e4, None)[0]


# -- the command ----------------------------------------------------------------------------


@pytest.fixture
def scope_csv(faithful, tmp_path):
    """Four channels of an oscilloscope, probes of 10 mV/A."""
    names = ("i_u1_A", "i_w1_A", "i_u2_A", "i_w2_A")
    rows = np.column_stack([faithful.time_s, *(faithful[name] * 0.01 for name in names)])
    text = "\n".join(",".join(f"{value:.7e}" for value in row) for row in rows)
    path = tmp_path / "scope.csv"
    path.write_text(f"x-axis,1,2,3,4\nsecond,Volt,Volt,Volt,Volt\n{text}\n")
    return path


def arguments(path, *phases, **more):
    maps = [f"{n}=i_{phase}_A*100" for n, phase in enumerate(phases, 1)]
    options = {"load": LOAD_NM, "speed": SPEED_RPM, **more}
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    return ["board", "compare", "paper-a-feasible", str(path), *words,
            *(word for text in maps for word in ("--map", text))]  # fmt: skip


def test_the_command(scope_csv, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(fit.compare, "__defaults__", (fit.NO_LOAD, TRIED, None))
    folder = tmp_path / "out"
    words = arguments(scope_csv, "u1", "w1", "u2", "w2")
    assert main([*words, "-o", str(folder), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not said["differs"] and {q["quantity"] for q in said["quantities"]} >= {"unbalance"}
    assert (folder / "report.html").exists()
    for wrong, text in (
        (arguments(scope_csv, "u1", "v1", "u2", "w2"), "i_v1_A is not phase v1"),
        (arguments(scope_csv, "u1", "w1"), "no two of i_u2_A, i_w2_A, i_v2_A"),
        (arguments(scope_csv, "u1", "w1", "u2", "w2", "v2"), "no channel '5'"),
        (arguments(scope_csv, "u1", "w1", "u2", "w2", speed="1e9"), "--speed 1e+09"),
    ):
        assert main(wrong) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1 and text in lines[0], lines


def test_a_file_of_matlab_is_the_bench_that_the_table_is(setup, scope_csv):
    """The same samples as Simulink's To File writes them: a matrix, the time in its first row."""
    io = pytest.importorskip("scipy.io", reason=".mat needs scipy")
    rows = np.genfromtxt(scope_csv, delimiter=",", skip_header=2).T
    scope_mat = scope_csv.with_suffix(".mat")
    io.savemat(scope_mat, {"ans": rows})
    loads, found = ((float("-inf"), LOAD_NM),), []
    for file, first, name in ((scope_csv, 1, "{}"), (scope_mat, 2, "ans.{}")):
        maps = [
            f"{name.format(n)}=i_{p}_A*100" for n, p in enumerate(("u1", "w1", "u2", "w2"), first)
        ]
        (rec,) = mapped([str(file)], [Recording.load(file)], maps, None)
        found.append(bench.read(rec, file, setup, None, loads, SPEED_RPM))
    table, matlab = found
    assert set(table.samples) == set(matlab.samples)
    for name, values in table.samples.items():
        assert np.array_equal(values, matlab.samples[name], equal_nan=True), name
    assert np.array_equal(table.omega_rad_s, matlab.omega_rad_s)
