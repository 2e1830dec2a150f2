"""The recording that a virtual board makes of itself needs memory that does not grow."""

import signal

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.boards import virtual
from hexatorque.boards.own_recording import PART_S, OwnRecording
from hexatorque.boards.virtual import VirtualBoard
from hexatorque.cli.board import serve as serving
from hexatorque.cli.main import main
from hexatorque.recording.formats import NotWritten, RecordingError
from hexatorque.recording.recording import Recording
from hexatorque.recording.writer import Writer

STEP_S = 0.01


def board() -> VirtualBoard:
    made = VirtualBoard(setups.load("paper-b"))
    made.sim.start()
    return made


def turns(made: VirtualBoard, own: OwnRecording | None, seconds: float) -> int:
    """Let the time pass as `serve` does. Returns the largest number of rows held in memory."""
    rows = 0
    for _ in range(round(seconds / STEP_S)):
        if own:
            own.keep()
        made.run(STEP_S, True)
        rows = max(rows, len(made.sim._samples.plant._data))
    return rows


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return np.array_equal(a, np.float32(b), equal_nan=True)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_it_is_what_one_recording_of_all_would_be(tmp_path, suffix):
    whole = board()
    turns(whole, None, 1.05)
    expected = whole.take()

    parts = board()
    own = OwnRecording(parts.sim, tmp_path / f"own{suffix}")
    most = turns(parts, own, 1.05)
    assert own.seconds == pytest.approx(1.0, abs=PART_S)
    own.close()
    found = Recording.load(own.path)
    assert len(found) == len(expected) and found.rate_Hz == expected.rate_Hz
    assert found.start_s == expected.start_s and found.units == dict(expected.units)
    for name in ("state", "torque_Nm", "plant.i_u1_A", "plant.torque_Nm", "plant.speed_rpm"):
        assert same(found[name], expected[name]), name
    for key in ("setup", "scheme", "samples_per_period", "state", "faults", "processor"):
        assert found.meta[key] == expected.meta[key]
    assert found.meta["f_sw_Hz"] == pytest.approx(expected.meta["f_sw_Hz"], rel=1e-3)
    assert found.meta["closed"] and found.meta["lost_samples"] == 0
    # However long it lasts, the simulation holds little more than what is written at once.
    assert most <= 2 * (PART_S + 2 * STEP_S) * found.rate_Hz


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_another_rate_of_the_interrupts_goes_on_in_another_file(tmp_path, suffix):
    """The first one was overwritten."""
    made = VirtualBoard(setups.load("paper-b"))
    said = []
    own = OwnRecording(made.sim, tmp_path / f"own{suffix}", said.append)
    rate_Hz = made.sim.samples_per_period / made.sim.period_s
    for factor in (1.0, 0.5, 2.0):
        made.controller.set("f_isr_Hz", factor * float(made.controller.get("f_isr_Hz")))
        turns(made, own, 0.5)
    own.close()
    assert own.paths == [tmp_path / f"own{name}{suffix}" for name in ("", "-2", "-3")]
    assert said == [f"f_isr_Hz has changed: the recording goes on in {p}" for p in own.paths[1:]]
    begins_s = 0.0
    for path, share in zip(own.paths, (1.0, 0.5, 1.0)):
        found = Recording.load(path)
        assert found.rate_Hz == pytest.approx(share * rate_Hz, rel=1e-6)
        assert found.start_s == pytest.approx(begins_s, abs=1e-3)
        begins_s = found.start_s + len(found) / found.rate_Hz
        assert found.meta["ended"] == ("user" if path == own.paths[-1] else "f_isr_Hz has changed")
    assert begins_s == pytest.approx(1.5, abs=1e-3)


def test_a_recording_that_was_not_closed_is_refused_before_the_board_begins(tmp_path):
    (tmp_path / "own.npz.part").write_bytes(b"left by a killed board")
    with pytest.raises(RecordingError, match=r"own\.npz\.part: a recording that was not closed"):
        OwnRecording(board().sim, tmp_path / "own.npz")


def test_a_full_disk_ends_the_recording_and_not_the_board(tmp_path, monkeypatch):
    made = board()
    said = []
    own = OwnRecording(made.sim, tmp_path / "own.csv", said.append)
    turns(made, own, 0.3)

    def full(*_):
        raise RecordingError("own.csv: No space left on device")

    monkeypatch.setattr(Writer, "append", full)
    turns(made, own, 0.5)
    assert made.sim.time_s == pytest.approx(0.8)
    assert said == ["the recording ends: own.csv: No space left on device"]  # at once
    with pytest.raises(RecordingError, match="No space left"):
        own.close()
    kept = Recording.load(own.path)
    assert len(kept) and "No space left" in kept.meta["ended"]


def test_serve_goes_on_with_a_full_disk_and_ends_with_1(tmp_path, monkeypatch, capsys):
    served = []

    def serve(made, _line, until, record, xcp):
        for n in range(8):
            if n == 4:
                monkeypatch.setattr(Writer, "append", full)
            record.keep()
            made.run(0.1, record=True)
        served.append(made.sim.time_s)

    def full(*_):
        raise NotWritten("own.csv: No space left on device")

    monkeypatch.setattr(virtual, "serve", serve)
    assert main(["board", "serve", "--record", str(tmp_path / "own.csv")]) == 1
    assert served == [pytest.approx(0.8)]
    assert capsys.readouterr().err.count("No space left on device") == 2  # at once, and at the end


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_board_that_is_told_to_end_says_so_before_it_writes_and_has_little_left(
    tmp_path, monkeypatch, capsys, suffix
):
    """It once wrote for a minute without a word: all was still in memory."""
    path, said, left = tmp_path / f"own{suffix}", [], []
    append, close = Writer.append, OwnRecording.close

    def serve(made, _line, until, record, xcp):
        while not until():
            record.keep()
            made.run(STEP_S, record=True)
            if made.sim.time_s > 1.05:
                signal.raise_signal(signal.SIGTERM)

    def noted(self, ticks, values):
        left.append(len(ticks))
        append(self, ticks, values)

    def closed(self):
        said.append(capsys.readouterr().err)
        left.clear()
        close(self)

    monkeypatch.setattr(virtual, "serve", serve)
    monkeypatch.setattr(serving, "LONG_S", 0.5)
    monkeypatch.setattr(Writer, "append", noted)
    monkeypatch.setattr(OwnRecording, "close", closed)
    assert main(["board", "serve", "--record", str(path)]) == 0
    assert said == [f"writing 1 s to {path}\n"]
    assert capsys.readouterr().err == f"recording: {path}\n"
    assert 0 < sum(left) <= (PART_S + 2 * STEP_S) * Recording.load(path).rate_Hz
