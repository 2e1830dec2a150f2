"""Files of MATLAB that this project did not write: made here by scipy in the shapes that Simulink,
PLECS, an oscilloscope or a script leave, and written by MATLAB itself."""

import json
from pathlib import Path

import numpy as np
import pytest

from hexatorque.cli.main import main
from hexatorque.recording.recording import Recording, RecordingError

io = pytest.importorskip("scipy.io", reason=".mat needs scipy")

N, RATE_HZ, START_S = 400, 20e3, 0.25
TIME_S = START_S + np.arange(N) / RATE_HZ
U, V = 3 * np.sin(300 * TIME_S), 5 * np.cos(300 * TIME_S)
COLUMN = TIME_S.reshape(-1, 1)


def structs(*rows):
    """A struct array of MATLAB."""
    made = np.zeros(len(rows), dtype=[(name, object) for name in rows[0]])
    for n, row in enumerate(rows):
        made[n] = tuple(row.values())
    return made


def timeseries(values, unit="A", **more):
    """What struct(ts) gives of a timeseries."""
    return {"Time": COLUMN, "Data": values.reshape(-1, 1), "DataInfo": {"Units": unit},
            "TimeInfo": {"Units": "seconds", "Start": START_S}, **more}  # fmt: skip


#: What a file holds, and the names of U and V in it.
SHAPES = {
    "columns": ({"time_s": COLUMN, "a": U.reshape(-1, 1), "b": V.reshape(-1, 1)}, "a b"),
    "rows": ({"t": TIME_S, "a": U, "b": V}, "a b"),
    "in ms": ({"time_ms": 1e3 * TIME_S, "a": U, "b": V}, "a b"),
    "a struct": ({"log": {"Time": COLUMN, "a": U, "b": V}, "R_s": 1.2}, "a b"),
    "simulation": ({"tout": COLUMN, "yout": np.column_stack([U, V])}, "yout.1 yout.2"),
    "signals in rows": ({"t": TIME_S, "y": np.array([U, V])}, "y.1 y.2"),
    "to file": ({"ans": np.array([TIME_S, U, V])}, "ans.2 ans.3"),
    "a matrix in columns": ({"data": np.column_stack([TIME_S, U, V])}, "data.2 data.3"),
    "structure with time": (
        {"scope": {"time": COLUMN, "blockName": "m/Scope", "signals": structs(
            {"values": U.reshape(-1, 1), "dimensions": 1, "label": "i u", "title": ""},
            {"values": V.reshape(-1, 1), "dimensions": 1, "label": "", "title": ""},
        )}},
        "i u|scope.2",
    ),
    "one signal of two": (
        {"scope": {"time": COLUMN, "signals": {
            "values": np.column_stack([U, V]), "dimensions": 2, "label": "i"}}},
        "i.1 i.2",
    ),
    "a matrix at each time": (
        {"s": {"time": COLUMN, "signals": {"values": np.array([[U, V]]), "label": "i"}}}, "i.1 i.2"
    ),
    "dataset as struct": ({"logsout": {"a": timeseries(U), "b": timeseries(V)}}, "a b"),
    "named timeseries": ({"x": timeseries(U, Name="i_a"), "y": timeseries(V)}, "i_a y"),
    "PicoScope": (
        {"Tstart": START_S, "Tinterval": 1 / RATE_HZ, "Length": N, "A": U.reshape(-1, 1), "B": V},
        "A B",
    ),
    "a rate": ({"fs": RATE_HZ, "t0": START_S, "a": U.astype("f4"), "b": V.astype("f4")}, "a b"),
}  # fmt: skip


@pytest.fixture(params=SHAPES)
def shape(request, tmp_path):
    contents, names = SHAPES[request.param]
    path = tmp_path / "other.mat"
    io.savemat(path, contents)
    return path, names.split("|" if "|" in names else " ")


def test_every_shape_gives_its_signals_at_their_times(shape):
    path, names = shape
    rec = Recording.load(path)
    assert list(rec.channels) == names
    assert rec.rate_Hz == RATE_HZ and np.allclose(rec.time_s, TIME_S, rtol=0, atol=1e-9)
    for name, true in zip(names, (U, V), strict=True):
        assert np.allclose(rec[name], true, rtol=0, atol=1e-6)
    assert rec.notes[0] == "names, units and time are those of the variables"


def test_old_and_compressed_files_are_read(tmp_path):
    for format_, compressed in (("4", False), ("5", False), ("5", True)):
        io.savemat(tmp_path / "a.mat", {"t": TIME_S, "a": U}, format=format_,
                   do_compression=compressed)  # fmt: skip
        assert np.array_equal(Recording.load(tmp_path / "a.mat")["a"], U)


def test_units_come_from_beside_the_samples(tmp_path):
    for contents in (
        {"t": TIME_S, "a": U, "units": {"a": "mA"}},
        {"a": timeseries(U, "mA")},
        {"s": {"time": TIME_S, "signals": {"values": U, "label": "a", "unit": "mA"}}},
    ):
        io.savemat(tmp_path / "a.mat", contents)
        rec = Recording.load(tmp_path / "a.mat")
        assert rec.units == {"a": "A"} and np.allclose(rec["a"], 1e-3 * U)
        assert "a: mA are made A" in rec.notes


def test_the_same_time_in_two_units_is_one_time(tmp_path):
    io.savemat(tmp_path / "a.mat", {"t": TIME_S, "time_ms": 1e3 * TIME_S, "a": U})
    rec = Recording.load(tmp_path / "a.mat")
    np.testing.assert_allclose(rec.time_s, TIME_S)
    np.testing.assert_array_equal(rec["a"], U)


def test_an_own_recording_without_a_column_names_it(tmp_path):
    Recording(RATE_HZ, {"a": U, "b": V}, {"a": "A", "b": "A"}).save(tmp_path / "a.mat")
    kept = io.loadmat(tmp_path / "a.mat", simplify_cells=True)
    kept.pop("b")
    io.savemat(tmp_path / "a.mat", {n: v for n, v in kept.items() if not n.startswith("__")})
    with pytest.raises(RecordingError, match=r"not a recording \(b is missing\)$"):
        Recording.load(tmp_path / "a.mat")


def test_what_is_left_out_is_named(tmp_path):
    contents = {
        "t": TIME_S, "a": U, "gains": np.arange(7.0), "z": U + 1j * V, "note": "bench 2",
        "inner": {"b": V, "t_dead": np.arange(3.0)}, "control": {"Ts": 1e-4, "k": np.ones(2)},
    }  # fmt: skip
    io.savemat(tmp_path / "a.mat", contents)
    rec = Recording.load(tmp_path / "a.mat")
    assert list(rec.channels) == ["a", "inner.b"]
    (left,) = [note for note in rec.notes if note.startswith("left out")]
    assert left.removeprefix("left out: ").split(", ", 1) == [
        "gains (7)", "z (complex, 400), inner.t_dead (3), control.k (2), note (no numbers)",
    ]  # fmt: skip


def test_a_lost_sample_is_a_gap(tmp_path):
    kept = np.delete(np.arange(N), [7, 8])
    io.savemat(tmp_path / "a.mat", {"t": TIME_S[kept], "a": U[kept]})
    rec = Recording.load(tmp_path / "a.mat")
    assert len(rec) == N and np.isnan(rec["a"][7:9]).all() and rec.meta["lost_samples"] == 2


WRONG = {
    "no time": ({"a": U, "b": V[:9]}, r"no time: .* there: a \(400\), b \(9\)$"),
    "nothing": ({"x": "text"}, r"no time: .* there: x \(no numbers\)$"),
    "two times": ({"t": TIME_S, "time": TIME_S[:9], "a": U}, r"which .* t \(400\) or time \(9\)\?"),
    "twice as fast": ({"t": TIME_S, "time": 2 * TIME_S, "a": U}, "which is the time"),
    "complex time": ({"t": TIME_S + 0j, "a": U}, r"no time: .* t \(complex, 400\), a"),
    "too small a step": ({"Ts": 5e-324, "a": U}, "no time"),
    "different times": (
        {"x": timeseries(U), "y": {"Time": TIME_S[:9], "Data": V[:9]}},
        r"x\.Time \(400\) and y\.Time \(9\) are different times",
    ),
    "shifted times": (
        {"x": timeseries(U), "y": {"Time": TIME_S + 1 / RATE_HZ, "Data": V}}, "different times"
    ),
    "other lengths": ({"t": TIME_S, "a": U[:-1]}, r"as long as the time; .* a \(399\)"),
    "complex": ({"t": TIME_S, "z": U + 1j * V}, r"real numbers .* z \(complex, 400\)"),
    "a square": ({"t": TIME_S[:9], "y": np.eye(9)}, r"y \(9 by 9\): its rows may be the samples"),
    "backwards": ({"t": TIME_S[::-1], "a": U}, "sample 2: time goes from 0.26995 s to 0.2699 s"),
    "uneven": ({"t": np.array([0, 1, 2, 3.4, 4]), "a": U[:5]}, "sample 4: .* equally spaced"),
    "infinite": ({"t": TIME_S, "a": np.where(U == U[5], np.inf, U)}, "sample 6, a: not a finite"),
    "minutes": ({"x": {**timeseries(U), "TimeInfo": {"Units": "weeks"}}}, "time in 'weeks', known"),
    "an unusable step": ({"Ts": 0.0, "a": U}, "no time"),
    "one sample": ({"t": 1.0, "a": 2.0}, r"no time: .* there: no vectors"),
    "one name twice": (
        {"x": timeseries(U, Name="i"), "y": timeseries(V, Name="i")}, "two columns are named i"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_read_is_one_line(case, tmp_path):
    contents, says = WRONG[case]
    io.savemat(tmp_path / "a.mat", contents)
    with pytest.raises(RecordingError, match=says) as refused:
        Recording.load(tmp_path / "a.mat")
    text = str(refused.value)
    assert text.startswith(str(tmp_path / "a.mat: ")) and "\n" not in text


def test_an_object_of_matlab_is_named():
    from scipy.io.matlab import MatlabOpaque

    from hexatorque.recording import workspace

    kinds = [(key, object) for key in ("s0", "s1", "s2", "arr")]
    value = MatlabOpaque(np.array([(b"ts", b"MCOS", b"timeseries", None)], dtype=kinds))
    with pytest.raises(RecordingError, match=r"no time: .* there: ts \(timeseries object\)"):
        workspace.recording({"None": value, "__function_workspace__": np.zeros((1, 8), np.uint8)})


def test_files_that_matlab_wrote():
    """scipy's own, of MATLAB 7.4: a file of each kind gives a recording or one line."""
    data = Path(io.__file__).parent / "matlab/tests/data"
    files = sorted(data.glob("*_7.4_GLNX86.mat"))
    if not files:
        pytest.skip("this scipy came without the files of its tests")
    said = {}
    for file in files:
        try:
            said[file.name.partition("_")[0]] = str(Recording.load(file))
        except RecordingError as error:
            said[file.name.partition("_")[0]] = str(error)
            assert str(error).startswith(f"{file}: ") and "not a recording" not in str(error)
    assert "MATLAB 7.3 (HDF5) is not read: save it in MATLAB with -v7" in said["testhdf5"]
    assert "testmulti" in said and "a (3 by 5), theta (9)" in said["testmulti"]
    assert "testmatrix.2, testmatrix.3" in said["testmatrix"]  # its first column ascends


@pytest.mark.parametrize("shape", ["structure with time"], indirect=True)
def test_commands_take_it_with_the_mapping_of_a_table(shape, tmp_path, monkeypatch, capsys):
    path, (a, b) = shape
    monkeypatch.chdir(tmp_path)
    maps = ["--map", f"{a}=i_u1_A*2", "--map", f"{b}=i_w1_A/2"]
    assert main(["convert", str(path), "new.csv", *maps]) == 0
    assert "names, units and time are those of the variables" in capsys.readouterr().err
    rec = Recording.load(tmp_path / "new.csv")
    assert np.allclose(rec["i_u1_A"], 2 * U, atol=1e-5) and rec.units["i_w1_A"] == "A"
    assert main(["plot", "new.csv", str(path), *maps, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["channels"]["i_u1_A"]["rms_difference"][1] < 1e-5
    # What else is missing, `board compare` says as of any other table.
    assert main(["board", "compare", "paper-a", str(path), *maps]) == 2
    err = capsys.readouterr().err
    assert "there are i_u1_A, i_w1_A (--map OLD=NEW*K renames" in err and err.count("\n") == 1
    assert main(["board", "compare", "paper-a", str(path), "--map", "no=i_u1_A"]) == 2
    assert "no channel 'no'" in capsys.readouterr().err
