"""Tables of other programs, and our own tables without their header. They are read with the right
time, units and numbers, or refused with the line and the column."""

import json

import numpy as np
import pytest

from hexatorque.cli.main import main
from hexatorque.recording import table
from hexatorque.recording.journal import Stream
from hexatorque.recording.recording import Recording, RecordingError
from hexatorque.recording.writer import Writer

#: The same three samples of two channels at 2 kHz, as programs write them.
WANTED = {"current": ("A", [1.25, -1.5, 2000.0]), "speed": ("rpm", [400.0, 401.0, 402.5])}
WRITTEN = {
    "comma": "time_s,current [A],speed [rpm]\n0,1.25,400\n0.0005,-1.5,401\n0.001,2e3,402.5\n",
    "semicolon": "Time (s);current (A);speed (rpm)\n0;1.25;400\n0.0005;-1.5;401\n0.001;2000;402.5",
    "decimal comma": "Zeit [ms];current [A];speed [rpm]\n"
    "0,0;1,25;400\n0,5;-1,5;401\n1,0;2,0e3;402,5\n",
    "tabs": "t (us)\tcurrent [A]\tspeed [rpm]\n0\t1.25\t400\n500\t-1.5\t401\n1000\t2000\t402.5\n",
    "tabs and commas": "T\tcurrent [A]\tspeed [rpm]\n"
    "0\t1,25\t400\n0,0005\t-1,5\t401\n0,001\t2000\t402,5\n",
    "quoted": '"time_s","current [A]","speed [rpm]"\n"0","1,25","400"\n"0,0005","-1,5","401"\n'
    '"0,001","2000","402,5"\n',
    "line of units": "Time,current,speed\n(ms),(A),(rpm)\n\n"
    "0,1.25,400\n0.5,-1.5,401\n1,2000,402.5\n",
    "spaces": "time_s , current [A] , speed [rpm]\n 0 , 1.25, 400\n 0.0005, -1.5, 401\n"
    " 0.001, 2000, 402.5\n\n",
    "comments": "# scope 7\n% of today\n\ntime_s,current [A],speed [rpm]\n"
    "0,1.25,400\n0.0005,-1.5,401\n0.001,2000,402.5\n",
    "for Excel": "sep=;\ntime_s;current [A];speed [rpm]\n"
    "0;1,25;400\n0,0005;-1,5;401\n0,001;2000;402,5\n",
    "another order": "current [A],speed [rpm],Time [s]\n"
    "1.25,400,0\n-1.5,401,0.0005\n2000,402.5,0.001\n",
    "delimiter behind": "time_s;current [A];speed [rpm];\n"
    "0;1,25;400;\n0,0005;-1,5;401;\n0,001;2000;402,5;\n",
    "delimiter behind the rows": "time_s,current [A],speed [rpm]\n"
    "0,1.25,400,\n0.0005,-1.5,401,\n0.001,2000,402.5,\n",
}
ENCODED = {
    "UTF-8": lambda text: text.encode(),
    "UTF-8 with mark, Windows lines": lambda text: text.replace("\n", "\r\n").encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "old Mac lines": lambda text: text.replace("\n", "\r").encode(),
}


@pytest.mark.parametrize("encoded", ENCODED)
@pytest.mark.parametrize("written", WRITTEN)
def test_the_same_samples_in_the_formats_of_several_programs(written, encoded, tmp_path):
    path = tmp_path / "scope.csv"
    path.write_bytes(ENCODED[encoded](WRITTEN[written]))
    rec = Recording.load(path)
    assert (rec.rate_Hz, rec.start_s, len(rec)) == (2000, 0, 3)
    assert {name: (rec.units[name], list(rec[name])) for name in rec.channels} == WANTED
    assert rec.notes[0].startswith("scope.json is not there")
    assert rec.ticks is None and rec.meta == {"gaps": 0, "lost_samples": 0}


def test_a_suffix_in_capitals_and_windows_letters(tmp_path):
    path = tmp_path / "SCOPE.CSV"
    path.write_bytes("Zeit [µs];Größe [°C]\n0;1,5\n10;1,6\n".encode("cp1252"))
    rec = Recording.load(path)
    assert rec.rate_Hz == 1e5 and rec.units == {"Größe": "°C"}


def test_missing_rows_and_cells_are_nan_and_counted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,a,b\n5,1,\n5.1,2,3\n5.4,4,5\n5.5,,\n5.6,6,7\n")
    rec = Recording.load(path)
    assert rec.rate_Hz == 10 and rec.start_s == 5
    nan = np.nan
    np.testing.assert_array_equal(rec["a"], [1, 2, nan, nan, 4, nan, 6])
    np.testing.assert_array_equal(rec["b"], [nan, 3, nan, nan, 5, nan, 7])
    assert (rec.meta["gaps"], rec.meta["lost_samples"]) == (2, 3)


def test_times_with_few_digits_are_still_equal_steps(tmp_path):
    """A step of 0.33 ms printed to 0.1 ms: 0.0, 0.3, 0.7, 1.0, ..."""
    path = tmp_path / "a.csv"
    rows = (f"{k / 3000:.4f},{k}" for k in range(1000))
    path.write_text("time_s,a\n" + "\n".join(rows) + "\n")
    rec = Recording.load(path)
    assert rec.rate_Hz == pytest.approx(3000, rel=1e-3) and len(rec) == 1000


def test_a_column_of_text_is_left_out_and_named(tmp_path):
    path = tmp_path / "plc.csv"
    path.write_text("Time;State;v\n0;run;1\n1;idle;2\n2;;3\n")
    rec = Recording.load(path)
    assert list(rec.channels) == ["v"]
    assert "State holds no numbers: left out" in rec.notes
    assert "Time is taken as seconds" in rec.notes


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no table"),
        ("time_s,a\n", "two rows or more"),
        ("time_s,a\n0,1\n", "two rows or more"),
        ("0,1\n1,2\n", "line 1: numbers where the columns' names are needed"),
        ("a,b\n0,1\n1,2\n", "no column of time: .* there are a, b"),
        ("time (parsec),a\n0,1\n1,2\n", "time in 'parsec'"),
        ("time_s,a\n0,1\n1,2\n2,x7\n3,4\n", "line 4, a: 'x7' is not a number"),
        ("time_s,a\n0,1\n\n1,2\n2,x7\n3,4\n", "line 5, a: 'x7' is not a number"),
        ("# by hand\ntime_s,a\n0,1\nlater,2\n", "line 4, time_s: 'later' is not a number"),
        ("t;a\n0;1\n1;1.234,5\n", r"line 3, a: '1\.234,5' is not a number"),
        ("time_s,a\n0,1\n1,2,3\n", "line 3: 3 cells where there are 2 names"),
        ("time_s,a,b\n0,1,2\n1,2\n", "line 3: 2 cells where there are 3 names"),
        ("t,a\n0,1\n1,1\n2,1\n2.4,1\n3,1\n", r"line 5: time goes from 2 s to 2\.4 s"),
        ("t,a\n0,1\n1,1\n1,1\n2,1\n3,1\n", "line 4: time goes from 1 s to 1 s"),
        ("t,a\n0,1\n1,1\n2,1\n1,1\n2,1\n", "line 5: time goes from 2 s to 1 s"),
        ("t,a\n0,1\n,1\n2,1\n", "line 3: no time"),
        ("t,a\n0,1\n1,1\n2,1\n1e9,1\n", "rows are missing: too many"),
        ("t,a,a\n0,1,1\n1,1,1\n", "two columns are named a"),
        ("t,a\n0,x\n1,y\n", "no column beside the time holds numbers"),
        ("t;a,b\n0;1,5\n1;2,5\n", ""),
    ],
)
def test_an_unreadable_table_gives_one_line(text, said, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text)
    if not said:
        assert list(Recording.load(path).channels) == ["a,b"]
        return
    with pytest.raises(RecordingError, match=said) as caught:
        Recording.load(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def streamed(tmp_path) -> Recording:
    """x.csv of a board. Its ticks wrap, and two samples are lost."""
    stream = Stream((("i_u1_A", "A"), ("state", "")), 10e3, 5, meta={"device": "f28335"})
    ticks = np.array([-10, -5, 0, 15, 20, 25], np.int64) % 2**32
    with Writer.open(tmp_path / "x.csv", stream) as writer:
        writer.append(ticks.astype(np.uint32), np.arange(12.0).reshape(6, 2))
    return Recording.load(tmp_path / "x.csv")


def test_our_own_table_without_its_header(tmp_path):
    whole = streamed(tmp_path)
    (tmp_path / "x.json").unlink()
    rec = Recording.load(tmp_path / "x.csv")
    assert (rec.rate_Hz, rec.start_s, rec.units) == (2000, 0, {"i_u1_A": "A", "state": ""})
    assert np.array_equal(rec.ticks, whole.ticks) and rec.ticks[0] == 2**32 - 10
    for name in whole.channels:
        np.testing.assert_array_equal(rec[name], whole[name])
    for key in ("first_tick", "decimation", "tick_Hz", "gaps", "lost_samples"):
        assert rec.meta[key] == whole.meta[key], key
    assert "x.json is not there" in rec.notes[0]


def test_ticks_that_do_not_fit_the_time(tmp_path):
    streamed(tmp_path)
    (tmp_path / "x.json").unlink()
    path = tmp_path / "x.csv"
    path.write_text(path.read_text().replace(",20,", ",21,"))
    with pytest.raises(RecordingError, match="line 8: tick and time_s do not fit together"):
        Recording.load(path)


def test_a_header_of_something_else_is_not_used(tmp_path):
    whole = streamed(tmp_path)
    (tmp_path / "x.json").write_text('{"name": "a package"}')
    rec = Recording.load(tmp_path / "x.csv")
    np.testing.assert_array_equal(rec["i_u1_A"], whole["i_u1_A"])
    assert rec.notes[0].startswith("x.json is not of a recording")


def test_a_table_that_excel_has_saved_again(tmp_path):
    """It has semicolons, decimal commas, Windows line ends and a byte order mark. The header is
    still beside it."""
    whole = streamed(tmp_path)
    path = tmp_path / "x.csv"
    text = path.read_text().replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    path.write_bytes(text.encode("utf-8-sig"))
    rec = Recording.load(path)
    assert rec.meta == whole.meta and rec.notes == []
    for name in whole.channels:
        assert rec[name].dtype == np.float32
        np.testing.assert_array_equal(rec[name], whole[name])


def test_a_header_that_belongs_to_another_table_says_which(tmp_path):
    streamed(tmp_path)
    path = tmp_path / "x.csv"
    path.write_text(path.read_text().replace("i_u1_A [A]", "i_u2_A [A]"))
    with pytest.raises(RecordingError, match=r"other columns than its header x\.json says"):
        Recording.load(path)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("a", ""),
        ("a", "A"),
        ("a [b]", ""),
        ("a (b)", "N m"),
        ("[x]", ""),
        ("a", "1/s²"),
        ("a b", ""),
    ],
)
def test_splitting_a_heading_is_the_inverse_of_making_it(name, unit):
    assert table.split(table.heading(name, unit)) == (name, unit)


def test_plot_and_convert_read_them_and_say_what_is_missing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scope.csv").write_text(WRITTEN["decimal comma"])
    assert main(["convert", "scope.csv", "scope.npz"]) == 0
    said = capsys.readouterr()
    assert "3 samples of 2 channels" in said.out
    assert said.err == (
        "hexatorque: scope.csv: scope.json is not there: names, units and time are those of the "
        "table itself; 3 samples at 2000 Hz\n"
    )
    assert list(Recording.load("scope.npz")["current"]) == WANTED["current"][1]
    assert main(["plot", "scope.csv", "scope.npz", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["channels"]["speed"]["rms_difference"] == [None, 0]
    assert "scope.json is not there" in said.err
    (tmp_path / "scope.csv").write_text("Time;v\n0;1\n1;2\n2;x\n")
    assert main(["plot", "scope.csv"]) == 2
    assert capsys.readouterr().err == "hexatorque: scope.csv: line 4, v: 'x' is not a number\n"
