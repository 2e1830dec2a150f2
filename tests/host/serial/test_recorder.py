"""Recordings of a board in files: one layout, their time, their counters and their end."""

import json
import time
from datetime import datetime

import numpy as np
import pytest

from hexatorque.drive.board import BoardDrive
from hexatorque.drive.recorder import Recorder
from hexatorque.recording.recording import Recording
from hexatorque.serial import LinkError


def seconds(rec: Recording) -> float:
    return datetime.fromisoformat(rec.meta["started"]).timestamp()


def test_a_stream_and_a_capture_are_of_one_layout(board, tmp_path):
    """First lines, keys of the header, time, and ticks of the same samples."""
    names = ["i_u1_A", "torque_Nm"]
    with BoardDrive.open(board) as drive:
        began_s = time.time()
        with drive.stream(names, 1000) as stream, Recorder(drive, tmp_path / "s.csv", stream) as to:
            while to.samples < 300:
                to.put(*stream.read(60.0))
        drive.arm(names, 400, 100, "manual", 10)
        captured = drive.captured(20.0, now=True)
        ended_s = time.time()
    captured.save(tmp_path / "c.csv")
    heads = [(tmp_path / f"{n}.csv").read_text().splitlines()[0] for n in "sc"]
    assert heads == 2 * ["time_s,tick,i_u1_A [A],torque_Nm [N m]"]
    headers = [json.loads((tmp_path / f"{n}.json").read_text()) for n in "sc"]
    assert list(headers[0]) == list(headers[1])
    for key in (
        "started",
        "started_uncertainty_s",
        "first_tick",
        "decimation",
        "tick_Hz",
        "gaps",
        "lost_samples",
        "damaged_samples",
        "crc_errors",
        "parameters",
        "state",
    ):
        assert key in headers[0]["meta"] and key in headers[1]["meta"], key
    for name in "sc":
        rec = Recording.load(tmp_path / f"{name}.csv")
        steps = np.diff(rec.ticks.astype(np.int64))
        assert (steps == 10).all() and rec.meta["tick_Hz"] == 10e3
        assert rec.meta["lost_samples"] == np.isnan(rec["i_u1_A"]).sum()
        # The board keeps time only as far as this computer is not busy: the bound says so.
        slack_s = rec.meta["started_uncertainty_s"] + 0.5
        assert began_s - slack_s <= seconds(rec) <= ended_s + slack_s
    assert captured.ticks[100] == captured.meta["trigger_tick"]
    assert seconds(captured) > seconds(Recording.load(tmp_path / "s.csv"))


def test_what_is_taken_has_its_start(board):
    with BoardDrive.open(board) as drive:
        opened_s = time.time()
        drive.run(0.2)
        rec = drive.take()
    assert abs(seconds(rec) - opened_s) < 60 and rec.meta["tick_Hz"] == 10e3


def test_a_stream_that_fails_says_so_in_its_file(board, tmp_path):
    error = LinkError("the board was reset")
    error.ended = "board reset"
    with (
        BoardDrive.open(board) as drive,
        drive.stream(["vdc_V"], 500) as stream,
        pytest.raises(LinkError),
        Recorder(drive, tmp_path / "s.npz", stream) as to,
    ):
        to.put(*stream.read(60.0))
        raise error
    meta = Recording.load(tmp_path / "s.npz").meta
    assert meta["ended"] == "board reset" and meta["closed"]


def test_counters_are_of_this_recording(board, tmp_path):
    """What the board had dropped before does not count."""
    with BoardDrive.open(board) as drive, drive.stream(["vdc_V"], 500) as stream:
        drive.client.counters.damaged += 3
        with Recorder(drive, tmp_path / "s.csv", stream) as to:
            to.put(*stream.read(60.0))
            drive.client.counters.damaged += 2
        drive.client.counters.damaged -= 5
    assert Recording.load(tmp_path / "s.csv").meta["crc_errors"] == 2
