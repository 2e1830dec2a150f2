"""A client that does not read: its terminal's buffer is full, and bytes are lost as on a wire."""

import os
import struct

import numpy as np

from hexatorque import firmware, setups
from hexatorque.boards.virtual import Terminal, VirtualBoard
from hexatorque.serial import wire

CHANNELS = (2, 3, 4, 5, 6, 7, 11, 21)
SESSION = 4711


def test_what_it_reads_in_the_end_is_right_and_what_is_missing_is_told():
    board = VirtualBoard(setups.load("paper-b"))
    crc = board.controller.board.service.dictionary & 0xFFFF
    ids = iter(range(1, 200))
    heard = b""

    def ask(op: int, payload: bytes = b"") -> None:
        body = wire.request(op, next(ids), SESSION, crc, payload)
        board.controller.put(wire.frame(body))

    def go_on(seconds: float) -> None:
        """With a sign of life every 50 ms; the simulation's own recording goes on."""
        for _ in range(round(seconds / 0.05)):
            ask(wire.Op.STATUS)
            board.run(0.05, record=True)
            line.write(board.controller.take())

    with Terminal() as line:
        reader = os.open(line.port, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            ask(wire.Op.OPEN, wire.open_session(SESSION, 1))
            board.run(0.05, record=True)
            ask(wire.Op.STREAM, wire.stream(0, CHANNELS, 4))
            for _ in range(12):  # nobody reads
                go_on(0.1)
                if line.lost:
                    break
            assert line.lost
            assert board.controller.drive.state == 0  # and nothing runs that should not
            for _ in range(40):  # now somebody does
                go_on(0.05)
                while raw := _read(reader):
                    heard += raw
        finally:
            os.close(reader)
    recording = board.take()
    splitter = wire.Splitter()
    samples = [b for b in splitter.push(heard) if b[0] == wire.SAMPLE]
    ticks = np.array([struct.unpack_from("<I", body, 2)[0] for body in samples])
    values = np.array([struct.unpack("<8f", body[6:]) for body in samples], np.float32)
    steps = np.diff(ticks)
    assert (steps > 0).all() and (steps % 4 == 0).all()
    assert (steps > 4).any()  # the gap
    # Bytes that were lost are at most a cut frame and whole ones: nothing wrong is in there.
    assert splitter.damaged <= (steps > 4).sum() + 1
    names = [name for name, _ in firmware.channels()]
    own = np.column_stack([recording[names[k]] for k in CHANNELS])[:: board.sim.samples_per_period]
    np.testing.assert_array_equal(values, own[ticks - 1])


def _read(reader: int) -> bytes:
    try:
        return os.read(reader, 65536)
    except BlockingIOError:
        return b""
