"""Today's client with a board of protocol 2.0: a fake one that sends the recorded replies."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from peer import Peer, frame

from hexatorque.drive.board import BoardDrive
from hexatorque.firmware import State
from hexatorque.serial import LinkError
from hexatorque.serial.wire import Op

sys.path.append(str(Path(__file__).parents[2] / "firmware" / "link"))
import session_2_0

SESSION = session_2_0.SESSION


class OldBoard(Peer):
    """Answers each request with the bytes that followed in the recording, but for the id and the
    checksum."""

    def __init__(self) -> None:
        self.at = 0
        super().__init__()

    def _find(self, op: int, payload: bytes) -> int:
        """The place of the next exchange like this; of a heartbeat the latest, if none follows."""
        exact = op not in (Op.OPEN, Op.STATUS)
        like = [
            n for n, one in enumerate(SESSION)
            if one.op == op and (not exact or one.payload == payload)
        ]  # fmt: skip
        assert like, f"the recording has no {Op(op).name} with {payload.hex()}"
        later = [n for n in like if n > self.at]
        return later[0] if later else like[-1] if op == Op.STATUS else like[0]

    def _execute(self, op, id, session, dictionary, payload) -> bytes:
        place = self._find(op, payload)
        self.at = place
        one = SESSION[place]
        self.follows = b"".join(map(frame, one.then))
        return bytes((one.reply[0], id)) + one.reply[2:]

    def write(self, raw: bytes) -> None:
        super().write(raw + self.follows)
        self.follows = b""


@pytest.fixture
def board():
    board = OldBoard()
    yield board
    board.close()


def recorded(op: int) -> session_2_0.Exchange:
    return next(one for one in SESSION if one.op == op and one.then)


def test_todays_client_works_with_a_board_of_version_2_0(board):
    with BoardDrive.open(board.port) as drive:
        assert drive.dictionary.minor == 0
        assert drive.reset is None  # it does not know why it started
        assert list(drive.params) == session_2_0.names(0)
        assert [name for name, _ in drive.channels] == session_2_0.names(1)
        assert len(drive.get_all()) == len(drive.params)
        drive.set_many(
            {"build_s": 0.05, "build_current_A": 20.0, "scheme": "dtc3", "calibration_s": 0.02}
        )
        drive.start()
        # What it does not say is taken for the worst.
        assert drive.condition == State(drive.state) and drive.condition.gates_on
        with drive.stream(["state", "torque_Nm", "i_u1_A"], decimation=200) as stream:
            ticks, values = stream.read(5.0)
        first = recorded(Op.STREAM).then[0]
        assert ticks[0] & 0xFFFFFFFF == struct.unpack_from("<I", first, 2)[0]
        assert values[0].tolist() == list(struct.unpack("<3f", first[6:]))
        drive.arm(["torque_Nm", "i_u1_A"], 100, 20)
        captured = drive.captured(5.0, now=True)
        data = np.frombuffer(b"".join(body[6:] for body in recorded(Op.READ).then), np.float32)
        assert captured["torque_Nm"].tolist() == data[::2].tolist()
        assert captured["i_u1_A"].tolist() == data[1::2].tolist()
        drive.stop()
        assert drive.snapshot is None
        with pytest.raises(LinkError, match="keeps no parameters"):
            drive.store_parameters()
