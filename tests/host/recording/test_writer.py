"""Recording a live board: appended samples are in the file, whatever happens to the process, the
disk or the folder. Lost samples are missing in the right places."""

import errno
import json
import os
import resource
import shutil
import signal
import struct
import subprocess
import sys
import time
import tracemalloc
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexatorque.recording import formats, journal
from hexatorque.recording.journal import Stream
from hexatorque.recording.recording import Recording, RecordingError
from hexatorque.recording.writer import Writer

CHANNELS = (("i_u1_A", "A"), ("torque_Nm", "N m"))
STREAM = Stream(CHANNELS, tick_Hz=10e3, decimation=5, meta={"device": "virtual"})
GROWING = pytest.mark.parametrize("name", ["rec.csv", "rec.npz"])


def rows(ticks) -> tuple[np.ndarray, np.ndarray]:
    """Ticks modulo 2**32, and values that encode their tick."""
    ticks = np.asarray(ticks, np.int64)
    values = np.column_stack([np.sin(ticks), ticks % 1000]).astype(np.float32)
    return (ticks % 2**32).astype(np.uint32), values


def growing(path: Path) -> Path:
    return path if path.suffix == ".csv" else path.with_name(path.name + ".part")


def test_what_was_appended_is_in_the_file(suffix, tmp_path):
    ticks = np.arange(1000, 6000, 5)
    path = tmp_path / "new" / f"rec{suffix}"
    with Writer.open(path, STREAM) as writer:
        for part in np.array_split(ticks, 7):
            writer.append(*rows(part))
        writer.append(*rows([]))
        writer.count(drops=3, crc_errors=1)
    rec = Recording.load(path)
    assert rec.rate_Hz == 2000 and rec.start_s == 0 and len(rec) == 1000
    assert rec.units == dict(CHANNELS)
    for column, (name, _) in enumerate(CHANNELS):
        assert rec[name].dtype == np.float32
        assert np.array_equal(rec[name], rows(ticks)[1][:, column])
    started = datetime.fromisoformat(rec.meta.pop("started"))
    assert abs((datetime.now(UTC) - started).total_seconds()) < 60
    assert rec.meta == {
        "device": "virtual", "first_tick": 1000, "decimation": 5, "tick_Hz": 10e3, "gaps": 0,
        "lost_samples": 0, "unusable_rows": 0, "drops": 3, "crc_errors": 1, "damaged_samples": 0,
        "closed": True, "ended": "user",
    }  # fmt: skip
    left = {file.name for file in path.parent.iterdir()}
    assert left == {file.name for file in formats.beside(path)}


def test_gaps_are_where_samples_were_lost(suffix, tmp_path):
    """The ticks wrap at 2**32 in the second gap."""
    ticks = np.arange(2**32 - 500, 2**32 + 500, 5)
    keep = np.ones(200, bool)
    keep[[10, 11, 98, 99, 100, 101, 102, 150]] = False
    with Writer.open(tmp_path / f"rec{suffix}", STREAM) as writer:
        for part in np.array_split(ticks[keep], 9):
            writer.append(*rows(part))
    rec = Recording.load(tmp_path / f"rec{suffix}")
    assert (rec.meta["gaps"], rec.meta["lost_samples"]) == (3, 8)
    assert len(rec) == 200
    assert np.array_equal(np.isfinite(rec["torque_Nm"]), keep)
    assert np.array_equal(rec["torque_Nm"][keep], (ticks[keep] % 1000).astype(np.float32))


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    first=st.integers(0, 2**32 - 1),
    steps=st.lists(st.integers(1, 50), max_size=40),
    cuts=st.lists(st.integers(0, 40), max_size=5),
    decimation=st.integers(1, 1000),
)
@GROWING
def test_any_ascending_ticks_are_recorded(name, first, steps, cuts, decimation, tmp_path):
    ticks = first + decimation * np.concatenate([[0], np.cumsum(steps, dtype=np.int64)])
    path = tmp_path / name
    stream = Stream(CHANNELS, 10e3, decimation, start_s=-2.5)
    with Writer.open(path, stream) as writer:
        for part in np.split(ticks, sorted(cuts)):
            writer.append(*rows(part))
        open_rec = Recording.load(growing(path))
    rec = Recording.load(path)
    assert len(rec) == len(open_rec) == 1 + sum(steps)
    assert rec.meta["lost_samples"] == sum(steps) - len(steps)
    assert rec.meta["gaps"] == sum(step > 1 for step in steps)
    at = (ticks - first) // decimation
    assert np.array_equal(rec["i_u1_A"][at], np.sin(ticks).astype(np.float32))
    for data in rec.channels:
        assert np.array_equal(rec[data], open_rec[data], equal_nan=True)
    assert rec.start_s == -2.5 and rec.rate_Hz == 10e3 / decimation
    if name.endswith(".csv"):  # a line for every sample; lost samples have empty cells
        lines = [line.split(",") for line in path.read_text().splitlines()[1:]]
        every = first + decimation * np.arange(len(rec))
        assert [float(line[0]) for line in lines] == pytest.approx(-2.5 + (every - first) / 10e3)
        assert [int(line[1]) for line in lines] == (every % 2**32).tolist()
        assert [line[2:] == ["", ""] for line in lines] == np.isnan(rec["i_u1_A"]).tolist()


CHILD = """
import sys, time
import numpy as np
from hexatorque.recording.journal import Stream
from hexatorque.recording.writer import Writer
writer = Writer.open(sys.argv[1], Stream((("a", "A"), ("b", "")), 1e3))
for k in range(10**6):
    ticks = 100 * k + np.arange(100)
    writer.append(ticks, np.column_stack([ticks, -ticks]))
    writer.count(drops=k + 1)
    print(k, flush=True)
    time.sleep(0.002)
"""


@GROWING
def test_all_appended_samples_survive_a_killed_process(name, tmp_path):
    path = tmp_path / name
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(path)], stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    try:
        for _ in range(30):
            last = int(child.stdout.readline())
    finally:
        os.kill(child.pid, signal.SIGKILL)
        child.wait()
        rest = child.stdout.read().split()
        child.stdout.close()
    last = int(rest[-1]) if rest and rest[-1].isdigit() else last
    rec = Recording.load(growing(path))
    assert len(rec) >= 100 * (last + 1) > 0
    assert np.array_equal(rec["a"], np.arange(len(rec)).astype(np.float32))
    assert np.array_equal(rec["b"], -rec["a"])
    assert rec.meta["closed"] is False and rec.meta["drops"] >= last
    # The next recording does not overwrite it, and it can be converted to any format.
    with pytest.raises(RecordingError, match="not closed"):
        Writer.open(path, STREAM)
    again = Recording.load(rec.save(tmp_path / "saved.npz"))
    assert np.array_equal(again["a"], rec["a"]) and again.meta == rec.meta


@GROWING
def test_a_file_cut_anywhere_gives_its_complete_rows(name, tmp_path):
    """The file is cut at every byte of the last rows. Exactly the whole rows before the cut must be
    read."""
    path = tmp_path / name
    writer = Writer.open(path, STREAM)
    writer.append(*rows(np.arange(0, 50, 5)))
    grown = growing(path)
    raw = grown.read_bytes()
    per_row = STREAM.row.itemsize
    for end in range(len(raw) - 30, len(raw)):
        grown.write_bytes(raw[:end])
        if name == "rec.csv":
            whole = raw[:end].count(b"\n") - 1
        else:
            whole = 10 - -(-(len(raw) - end) // per_row)
        rec = Recording.load(grown)
        assert len(rec) == whole
        assert np.array_equal(rec["i_u1_A"], np.sin(5 * np.arange(whole)).astype(np.float32))
    grown.write_bytes(raw)
    writer.close()


@GROWING
def test_appended_samples_can_be_read_at_once(name, tmp_path):
    """The process does not buffer samples."""
    writer = Writer.open(tmp_path / name, STREAM)
    for n in range(1, 5):
        writer.append(*rows([5 * n]))
        writer.count(crc_errors=n)
        rec = Recording.load(writer.growing)
        assert len(rec) == n
        assert (rec.meta["crc_errors"], rec.meta["closed"]) == (n, False)
    writer.close()


# -- refused


@pytest.mark.parametrize("bad", [[100], [95], [0], [100 - 2**31], [105, 105], [105, 95]])
@GROWING
def test_ticks_that_do_not_ascend_are_refused(name, bad, tmp_path):
    with Writer.open(tmp_path / name, STREAM) as writer:
        writer.append(*rows([90, 95, 100]))
        with pytest.raises(RecordingError, match=r"tick .* after tick"):
            writer.append(*rows(bad))
        writer.append(*rows([105]))
    assert len(Recording.load(tmp_path / name)) == 4


def test_shapes_and_calls_that_do_not_fit_are_refused(tmp_path):
    writer = Writer.open(tmp_path / "rec.npz", STREAM)
    with pytest.raises(RecordingError, match="values for 2 ticks"):
        writer.append([5, 10], np.zeros((2, 3)))
    with pytest.raises(RecordingError, match="counters"):
        writer.count(**{f"counter_{n}": n for n in range(40)})
    assert writer.close(note="by hand") == writer.close()
    with pytest.raises(RecordingError, match="closed"):
        writer.append(*rows([5]))
    rec = Recording.load(tmp_path / "rec.npz")
    assert len(rec) == 0 and rec.meta["note"] == "by hand"


@pytest.mark.parametrize(
    "bad",
    [
        {"channels": ()}, {"channels": (("a", ""), ("a", ""))}, {"channels": (("a\nb", ""),)},
        {"tick_Hz": 0}, {"tick_Hz": float("nan")}, {"decimation": 0}, {"decimation": 1.5},
        {"start_s": float("inf")},
    ],
)  # fmt: skip
def test_impossible_stream_descriptions_are_refused(bad):
    with pytest.raises(RecordingError):
        Stream(**{"channels": CHANNELS, "tick_Hz": 1e4, **bad})


def test_a_too_long_gap_is_refused_and_no_sample_is_lost(tmp_path):
    writer = Writer.open(tmp_path / "rec.npz", Stream(CHANNELS, 10e3))
    writer.append(*rows([0, 1, 2, 2 + 10**8, 3 + 10**8]))
    with pytest.raises(RecordingError, match=r"99999999 samples are missing.*row 3 and row 4"):
        writer.close()
    assert writer.growing.exists()
    with pytest.raises(RecordingError, match="99999999 samples"):
        Recording.load(writer.growing)
    writer._file.close()


# -- disks and folders


LIMITED = """
import resource, sys
import numpy as np
from hexatorque.recording.journal import Stream
from hexatorque.recording.writer import Writer
from hexatorque.recording.recording import Recording, RecordingError
writer = Writer.open(sys.argv[1], Stream((("a", "A"),), 1e3))
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
done = 0
try:
    while True:
        ticks = done + np.arange(77)
        writer.append(ticks, ticks[:, None])
        done += 77
except RecordingError as error:
    print(error.exit_code, error)
print(done, len(Recording.load(writer.growing)))
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)  # room again
writer.append([done], [[done]])
writer.close()
print(len(Recording.load(sys.argv[1])))
"""


@GROWING
def test_after_a_full_disk_recording_continues(name, tmp_path):
    """The write that does not fit is an error. The data before it stay, and recording can
    continue."""
    if resource.getrlimit(resource.RLIMIT_FSIZE)[1] != resource.RLIM_INFINITY:
        pytest.skip("file sizes are limited here")
    out = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / name)], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}, check=True,
    ).stdout.splitlines()  # fmt: skip
    said, counts, last = out
    assert "File too large" in said and str(tmp_path) in said
    assert said.startswith("1 ")  # 2 would say that the command line was wrong
    done, there = map(int, counts.split())
    assert done == there > 500
    assert int(last) == done + 1


def test_a_disk_that_is_full_at_the_end_is_no_mistake_of_the_user(tmp_path, monkeypatch):
    """The recording is told to be incomplete, with exit code 1, and can be closed later."""

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "rec.npz"
    writer = Writer.open(path, STREAM)
    writer.append(*rows([5, 10]))
    with monkeypatch.context() as patch:
        patch.setattr("hexatorque.recording.npz.save", full)
        with pytest.raises(RecordingError, match="; the samples are in ") as caught:
            writer.close()
    assert caught.value.exit_code == 1 and not path.exists()
    assert len(Recording.load(writer.close())) == 2


@GROWING
def test_a_deleted_folder_is_made_again(name, tmp_path):
    path = tmp_path / "gone" / name
    writer = Writer.open(path, STREAM)
    writer.append(*rows([5, 10]))
    shutil.rmtree(path.parent)
    with pytest.raises(RecordingError, match="deleted while"):
        writer.append(*rows([15]))
    writer.close()
    assert len(Recording.load(path)) == 3
    assert sorted(path.parent.iterdir()) == sorted(formats.beside(path))


def test_a_file_that_cannot_be_finished_keeps_its_journal(tmp_path):
    path = tmp_path / "rec.npz"
    writer = Writer.open(path, STREAM)
    writer.append(*rows([5, 10]))
    path.mkdir()
    with pytest.raises(RecordingError, match=r"the samples are in .*rec\.npz\.part"):
        writer.close()
    assert len(Recording.load(writer.growing)) == 2
    path.rmdir()
    writer.close()
    assert len(Recording.load(path)) == 2 and not writer.growing.exists()


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "rec.npz", Path("/proc/rec.npz"), tmp_path / "rec.xls"):
        with pytest.raises(RecordingError):
            Writer.open(path, STREAM)


# -- damaged journals


def test_a_damaged_journal_is_one_line_or_counted(tmp_path):
    path = tmp_path / "rec.npz"
    writer = Writer.open(path, STREAM)
    writer.append(*rows(5 * np.arange(200)))
    whole = Recording.load(writer.growing)
    raw = writer.growing.read_bytes()
    random = np.random.default_rng(1)
    for _ in range(80):
        damaged = bytearray(raw)
        for at in random.integers(0, len(raw), 3):
            damaged[at] = random.integers(256)
        writer.growing.write_bytes(damaged)
        try:
            rec = Recording.load(writer.growing)
        except RecordingError as error:
            assert "\n" not in str(error)
        else:
            assert rec.meta["unusable_rows"] + len(rec) - rec.meta["lost_samples"] == len(whole)
    writer.growing.write_bytes(raw)
    writer.close()


def test_rows_with_earlier_or_odd_ticks_are_dropped_and_counted():
    ticks = np.array([10, 15, 15, 20, 10, 23, 25, 40], np.uint32)
    rec = journal.assemble(STREAM, ticks, rows(ticks)[1], {}, closed=False)
    assert rec.meta["unusable_rows"] == 3
    assert (rec.meta["gaps"], rec.meta["lost_samples"]) == (1, 2)
    assert rec["torque_Nm"][[0, 1, 2, 3, 6]].tolist() == [10, 15, 20, 25, 40]


@GROWING
def test_after_an_interruption_rows_keep_their_own_ticks(name, tmp_path):
    """A stream that was set again may go on at any tick. A text file has each row's own time. In
    files with equally spaced rows each row is at the nearest place."""
    ticks = [90, 95, 100, 1203, 1208, 1213, 1218]
    with Writer.open(tmp_path / name, STREAM) as writer:
        writer.append(*rows(ticks))
    rec = Recording.load(tmp_path / name)
    assert rec.meta["unusable_rows"] == 0
    kept = np.flatnonzero(~np.isnan(rec["torque_Nm"]))
    assert rec["torque_Nm"][kept].tolist() == [tick % 1000 for tick in ticks]
    assert np.abs(90 + 5 * kept - ticks).max() <= 2
    if name.endswith(".csv"):
        table = np.genfromtxt(tmp_path / name, delimiter=",", skip_header=1)
        table = table[~np.isnan(table[:, 2])]  # a lost sample has a line without values
        assert table[:, 1].tolist() == ticks
        np.testing.assert_allclose(np.diff(table[:, 0]), np.diff(ticks) / STREAM.tick_Hz)


def test_an_incomplete_line_of_counters_costs_no_samples(tmp_path):
    writer = Writer.open(tmp_path / "rec.npz", STREAM)
    writer.append(*rows([5, 10]))
    raw = writer.growing.read_bytes()
    at = raw.index(b"\n") + 1
    writer.growing.write_bytes(raw[:at] + b'{"drops": 1, "cr' + raw[at + 16 :])
    assert len(Recording.load(writer.growing)) == 2
    writer.close()


def test_writing_is_cheap(tmp_path):
    """Ten seconds of eight channels at 2.5 kHz, in blocks of 20 ms, must take far less than real
    time."""
    stream = Stream(tuple((f"c{n}", "") for n in range(8)), 10e3, 4)
    for name in ("rec.csv", "rec.npz"):
        with Writer.open(tmp_path / name, stream) as writer:
            began = time.process_time()
            for k in range(500):
                writer.append(4 * (50 * k + np.arange(50)), np.ones((50, 8)))
            assert time.process_time() - began < 1.0


def test_the_header_beside_a_growing_csv_is_readable(tmp_path):
    with Writer.open(tmp_path / "rec.csv", STREAM) as writer:
        writer.append(*rows([5, 10]))
        header = json.loads((tmp_path / "rec.json").read_text())
        assert header["meta"]["closed"] is False and header["units"] == dict(CHANNELS)
        assert header["samples"] is None
    header = json.loads((tmp_path / "rec.json").read_text())
    assert header["meta"]["closed"] is True and header["samples"] == 2
    head = "time_s,tick,i_u1_A [A],torque_Nm [N m]\n0,5,"
    assert (tmp_path / "rec.csv").read_text().startswith(head)


def test_the_journal_is_as_documented(tmp_path):
    """The test writes and reads a journal as docs/recordings.md describes it."""
    with Writer.open(tmp_path / "rec.npz", STREAM) as writer:
        writer.append([7, 12, 22], [[1.5, -2], [2.5, -3], [3.5, -4]])
        raw = writer.growing.read_bytes()
    header, rest = raw.split(b"\n", 1)
    head = json.loads(header)
    assert head["format"] == "hexatorque-journal-1"
    assert head["channels"] == [["i_u1_A", "A"], ["torque_Nm", "N m"]]
    assert (head["tick_Hz"], head["decimation"], head["start_s"]) == (10e3, 5, 0)
    counters = {"drops": 0, "crc_errors": 0, "damaged_samples": 0}
    assert json.loads(rest[:256]) == counters and rest[255:256] == b"\n"
    there = list(struct.iter_unpack("<Iff", rest[256:]))
    assert there == [(7, 1.5, -2), (12, 2.5, -3), (22, 3.5, -4)]
    own = tmp_path / "own.mat.part"
    own.write_bytes(
        json.dumps({**head, "start_s": 2}).encode() + b"\n" + b"{}".ljust(255) + b"\n"
        + struct.pack("<Iff", 2**32 - 1, 1, 2) + struct.pack("<Iff", 9, 3, 4) + b"\1\2\3"
    )  # fmt: skip
    rec = Recording.load(own)
    assert rec.time_s.tolist() == [2, 2.0005, 2.001]
    assert rec["i_u1_A"][[0, 2]].tolist() == [1, 3] and np.isnan(rec["i_u1_A"][1])


def test_a_csv_deleted_after_a_crash_can_be_recorded_again(tmp_path):
    crashed = Writer.open(tmp_path / "rec.csv", STREAM)
    crashed._file.close()
    with pytest.raises(RecordingError, match="not closed"):
        Writer.open(tmp_path / "rec.csv", STREAM)
    (tmp_path / "rec.csv").unlink()  # its .json stays
    Writer.open(tmp_path / "rec.csv", STREAM).close()
    Writer.open(tmp_path / "rec.csv", STREAM).close()  # a closed one is written again


def test_the_end_of_a_long_recording_needs_less_memory_than_it_has_samples(suffix, tmp_path):
    """One of an hour is larger than the memory of a small computer."""
    if suffix in (".mf4", ".parquet"):
        pytest.skip("the library has it all in memory")
    stream = Stream(tuple((f"c{n}_A", "A") for n in range(40)), 1e4)
    block = np.ones((10_000, 40), np.float32)
    writer = Writer.open(tmp_path / f"long{suffix}", stream)
    for n in range(20):
        writer.append(np.arange(len(block)) + n * len(block), block)
    tracemalloc.start()
    try:
        writer.close()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(Recording.load(writer.path)) == 200_000
    assert peak < 0.5 * 20 * block.nbytes
