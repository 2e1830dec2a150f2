"""All commands write the same layout, that of the example in docs/recordings.md. All formats carry
the same data, and files of the former layout can be read."""

import json
import re
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from hexatorque.cli.main import main
from hexatorque.recording import csv
from hexatorque.recording.formats import SUFFIXES
from hexatorque.recording.journal import Stream
from hexatorque.recording.recording import Recording, RecordingError
from hexatorque.recording.writer import Writer

DOCS = Path(__file__).parents[3] / "docs" / "recordings.md"
CHANNELS = (("i_u1_A", "A"), ("torque_Nm", "N m"))


class AtTen:
    """A clock whose tick was 2**32 - 10 at ten o'clock."""

    def when(self, tick, time_s=0.0):
        return {"started": f"10:00 + {(tick + 10) % 2**32} - {time_s}"}


def example(kind: str) -> str:
    """The first block of code of that kind in the document."""
    return re.search(rf"```{kind}\n(.*?)```", DOCS.read_text(), re.DOTALL)[1]


def test_the_example_of_the_document_is_what_is_written(tmp_path):
    """The table must agree byte by byte, and so must the header, except the values that the test
    sets."""
    wanted = json.loads(example("json"))
    own = ("started", "started_uncertainty_s", "device", "parameters")
    meta = {key: wanted["meta"][key] for key in own}
    path = tmp_path / "run.csv"
    with Writer.open(path, Stream(CHANNELS, 10e3, 5, meta=meta)) as writer:
        writer.append([81200, 81205], [[1.25, 4.5], [1.5, 4.75]])
        writer.append([81215], [[1.75, 5]])
        writer.count(drops=1)
    assert path.read_text() == example("csv")
    written = json.loads((tmp_path / "run.json").read_text())
    assert written == wanted and list(written) == list(wanted)


def test_the_example_of_the_document_is_read(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(example("csv"))
    (tmp_path / "run.json").write_text(example("json"))
    rec = Recording.load(path)
    assert rec.rate_Hz == 2000 and rec.time_s.tolist() == [0, 0.0005, 0.001, 0.0015]
    assert rec.ticks.tolist() == [81200, 81205, 81210, 81215]
    np.testing.assert_array_equal(rec["i_u1_A"], [1.25, 1.5, np.nan, 1.75])
    assert rec.meta["gaps"] == rec.meta["lost_samples"] == 1 and rec.meta["ended"] == "user"
    assert datetime.fromisoformat(rec.meta["started"]).utcoffset().total_seconds() == 3600


@pytest.mark.parametrize(("place", "names"), [(1, ("1", "2")), (2, ("Kanal A", "Kanal B"))])
def test_the_foreign_tables_of_the_document_are_read(place, names, tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text(re.findall(r"```csv\n(.*?)```", DOCS.read_text(), re.DOTALL)[place])
    rec = Recording.load(path)
    assert (rec.rate_Hz, rec.start_s) == (10e3, -1e-3) and tuple(rec.channels) == names
    assert set(rec.units.values()) == {"V"}
    np.testing.assert_allclose(rec[names[0]], [0.0125, 0.015])
    assert rec[names[1]].tolist() == [0.4, 0.4]


def test_pandas_reads_it_without_options(tmp_path):
    pandas = pytest.importorskip("pandas")
    (tmp_path / "run.csv").write_text(example("csv"))
    frame = pandas.read_csv(tmp_path / "run.csv")
    assert list(frame) == ["time_s", "tick", "i_u1_A [A]", "torque_Nm [N m]"]
    assert frame.dtypes.astype(str).tolist() == ["float64", "int64", "float64", "float64"]
    assert frame["torque_Nm [N m]"].isna().tolist() == [False, False, True, False]


# -- every kind of file


def board_recording() -> Recording:
    """A capture of a board whose ticks wrap, with a lost sample and every type."""
    n = 40
    torque = np.linspace(-3, 3, n).astype(np.float32)
    torque[7] = np.nan
    return Recording(
        10e3 / 4,
        {
            "torque_Nm": torque,
            "plant.i_u1_A": np.sin(np.arange(n)),
            "position": np.arange(n) - 2**62,
            "on": np.arange(n) % 3 == 0,
        },
        {"torque_Nm": "N m", "plant.i_u1_A": "A"},
        {
            "started": "2026-11-22T09:15:02.123+01:00",
            "trigger_s": 0.0,
            "first_tick": 2**32 - 41,
            "decimation": 4,
            "tick_Hz": 10e3,
            "gaps": 1,
            "lost_samples": 1,
            "parameters": {"controller": {"scheme": "ddr", "rs_ohm": 1.7}},
        },
        -0.004,
    )


def same(a: Recording, b: Recording) -> None:
    assert list(a.channels) == list(b.channels)
    for name in a.channels:
        assert a[name].dtype == b[name].dtype, name
        np.testing.assert_array_equal(a[name], b[name])
    assert (a.rate_Hz, a.start_s, a.meta) == (b.rate_Hz, b.start_s, b.meta)
    assert b.units == {name: a.units.get(name, "") for name in a.channels}
    assert a.ticks.tolist() == b.ticks.tolist()
    assert b.notes == []


def test_converted_to_every_kind_and_on_to_every_other(suffix, tmp_path, capsys):
    """For all pairs of formats, the conversion must keep everything."""
    rec = board_recording()
    first = rec.save(tmp_path / f"first{suffix}")
    for other, library in SUFFIXES.items():
        if library and not find_spec(library.partition(".")[0]):
            continue
        there, back = tmp_path / f"there{other}", tmp_path / f"back{suffix}"
        assert main(["convert", str(first), str(there)]) == 0
        assert main(["convert", str(there), str(back)]) == 0
        same(rec, Recording.load(there))
        same(rec, Recording.load(back))
    assert capsys.readouterr().err == ""


def test_the_ticks_stand_beside_the_samples(tmp_path):
    """Every format that is a table has a column of ticks for other programs."""
    rec = board_recording()
    ticks = [(2**32 - 41 + 4 * k) % 2**32 for k in range(40)]
    assert rec.ticks.tolist() == ticks
    table = rec.save(tmp_path / "a.csv").read_text().splitlines()[1:]
    assert [int(line.split(",")[1]) for line in table] == ticks
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(rec.save(tmp_path / "a.parquet")).column("tick").to_pylist() == ticks
    io = pytest.importorskip("scipy.io")
    assert io.loadmat(rec.save(tmp_path / "a.mat"))["tick"].ravel().tolist() == ticks
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(rec.save(tmp_path / "a.mf4")) as mdf:
        assert mdf.get("tick").samples.tolist() == ticks
        assert mdf.header.start_time.isoformat() == "2026-11-22T08:15:02.123000+00:00"


def test_a_window_keeps_its_ticks():
    rec = board_recording()
    part = rec.window(0.0, 0.004)
    assert part.ticks.tolist() == rec.ticks[10:20].tolist()


# -- as it arrives


@pytest.mark.parametrize("name", ["a.csv", "a.npz"])
def test_the_clock_is_asked_for_the_first_sample(name, tmp_path):
    stream = Stream(CHANNELS, 10e3, 5, start_s=-1.0)
    with Writer.open(tmp_path / name, stream, AtTen()) as writer:
        writer.append([5, 10], np.ones((2, 2)))
        writer.append([15], np.ones((1, 2)))
    assert Recording.load(tmp_path / name).meta["started"] == "10:00 + 15 - -1.0"


class Reset(Exception):
    ended = "board reset"


@pytest.mark.parametrize("name", ["a.csv", "a.npz"])
def test_the_reason_of_the_end_is_kept(name, tmp_path):
    def ended(error=None, **said) -> str:
        path = tmp_path / name
        try:
            with Writer.open(path, Stream(CHANNELS, 10e3)) as writer:
                writer.append([5], np.ones((1, 2)))
                if error:
                    raise error
                if said:
                    writer.close(**said)
        except (Exception, KeyboardInterrupt) as raised:
            assert raised is error
        return Recording.load(path).meta["ended"]

    assert ended() == "user"
    assert ended(KeyboardInterrupt()) == "user"
    assert ended(ended="duration", state="run") == "duration"
    assert ended(Reset("the board was reset")) == "board reset"
    assert ended(OSError(5, "Input/output error")) == "Input/output error"


def test_an_unclosed_recording_has_no_reason_of_its_end(tmp_path):
    writer = Writer.open(tmp_path / "a.csv", Stream(CHANNELS, 10e3))
    writer.append([5, 6, 9], np.ones((3, 2)))
    writer._file.close()  # as a killed process leaves it
    rec = Recording.load(tmp_path / "a.csv")
    assert "ended" not in rec.meta and rec.meta["closed"] is False
    assert (len(rec), rec.meta["gaps"], rec.meta["lost_samples"]) == (5, 1, 2)


def test_a_nan_that_arrived_is_not_a_lost_sample(tmp_path):
    with Writer.open(tmp_path / "a.csv", Stream(CHANNELS, 10e3)) as writer:
        writer.append([5, 6, 8], [[1, 2], [np.nan, np.nan], [3, 4]])
    rec = Recording.load(tmp_path / "a.csv")
    assert np.isnan(rec["i_u1_A"]).tolist() == [False, True, True, False]
    assert (rec.meta["gaps"], rec.meta["lost_samples"]) == (1, 1)


def test_a_long_gap_does_not_fill_the_disk(tmp_path):
    """An hour without samples at 10 kHz takes one line."""
    path, hour = tmp_path / "a.csv", 36_000_000
    with Writer.open(path, Stream((("a", ""),), 10e3)) as writer:
        writer.append([0, 1, hour], [[1], [2], [3]])
    assert path.read_text().splitlines()[1:] == [
        "0,0,1",
        "0.0001,1,2",
        "0.0002,2,",
        "3600,36000000,3",
    ]
    rec = Recording.load(path)
    assert len(rec) == hour + 1 and rec["a"][-1] == 3
    assert rec.meta["lost_samples"] == hour - 2 == np.isnan(rec["a"]).sum()
    assert csv.LONGEST_GAP < hour


def test_a_tick_that_was_changed_is_found(tmp_path):
    path = tmp_path / "a.csv"
    with Writer.open(path, Stream(CHANNELS, 10e3, 5)) as writer:
        writer.append([5, 10, 15], np.ones((3, 2)))
    path.write_text(path.read_text().replace(",10,", ",11,"))
    with pytest.raises(RecordingError, match="line 3: tick 11 does not follow on in steps of 5"):
        Recording.load(path)


def test_a_line_that_was_taken_out_is_found(tmp_path):
    path = board_recording().save(tmp_path / "a.csv")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))
    with pytest.raises(RecordingError, match="39 of 40 samples"):
        Recording.load(path)


# -- the former layout


@pytest.mark.parametrize("closed", [True, False])
def test_a_stream_of_the_former_layout(closed, tmp_path):
    """Version 0.1.0 wrote no units in the first line, and lines only for the samples that
    arrived."""
    (tmp_path / "run.csv").write_text(
        "time_s,tick,i_u1_A,torque_Nm\n0,81200,1.25,4.5\n0.0005,81205,1.5,4.75\n"
        "0.0015,81215,1.75,5\n" + ("" if closed else "0.002,81")
    )
    stream = {
        "format": "hexatorque-journal-1", "channels": [list(c) for c in CHANNELS],
        "tick_Hz": 10000.0, "decimation": 5, "start_s": 0.0,
        "meta": {"started": "2026-05-01T10:00:00+00:00", "device": "f28335"},
    }  # fmt: skip
    header = {
        "format": "hexatorque-recording-1", "rate_Hz": 2000.0, "units": dict(CHANNELS),
        "stream": stream, "counters": {"drops": 2, "crc_errors": 1}, "closed": closed,
    }  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(header))
    rec = Recording.load(tmp_path / "run.csv")
    np.testing.assert_array_equal(rec["i_u1_A"], [1.25, 1.5, np.nan, 1.75])
    assert rec.units == dict(CHANNELS) and rec.ticks[0] == 81200
    meta = rec.meta
    assert (meta["gaps"], meta["lost_samples"], meta["drops"], meta["closed"]) == (1, 1, 2, closed)
    same(rec, Recording.load(rec.save(tmp_path / "new.csv")))
