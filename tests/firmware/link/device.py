"""A board without a plant: drive and link on the register model, sensors with constant values, and
a host that follows docs/protocol.md and uses none of the client's code."""

import struct
import zlib
from typing import NamedTuple

from cobs import cobs

from hexatorque import firmware
from hexatorque.boards.virtual import BoardController
from hexatorque.firmware import ALL_LEGS, lib

HELLO, LIST, OPEN, CLOSE, STATUS, GET, WRITE, START, STOP, CLEAR = range(1, 11)
STREAM, ARM, CAPTURE, READ, TRIGGER, CANCEL, SNAPSHOT, SAVE, FORGET, FORGET_LOG = range(11, 21)
DONE, ID, VALUE, STATE, CONFIG, PORT, TURNING = range(7)
STORE = 8
OPCODE, LENGTH, SESSION, DICTIONARY, BUSY, BUDGET, NO_CAPTURE, NO_STREAM = range(16, 24)
FIELD, MEMORY, SAMPLING = range(24, 27)
NONE, FILLING, WAITING, TRIGGERED, SUMMING, COMPLETE = range(6)
NONCE = 0x1234
MARK = 0x89ABCDEF
MID = 2048
PARAMETERS = {name: row.id for name, row in firmware.parameters().items()}
CHANNELS = {name: k for k, (name, _) in enumerate(firmware.channels())}
#: The first number that no channel has.
NO_CHANNEL = len(CHANNELS)
#: No machine is connected, so the checks that need one are off, and the start is short.
ALONE = {
    "encoder_trip_rpm": 0.0,
    "flux_check": 0.0,
    "stuck_trip_A": 0.0,
    "loss_check": 0.0,
    "flux_trip_Wb": 100.0,
    "calibration_s": 0.001,
    "build_s": 0.01,
}
#: Fast interrupts from a start to the state run, with a margin.
TO_RUN = 150


class Reply(NamedTuple):
    status: int
    state: str
    faults: int
    tick: int
    payload: bytes


def frame(body: bytes) -> bytes:
    return b"\0" + cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def opened(raw: bytes) -> bytes:
    """The body of the bytes between two zeros."""
    checked = cobs.decode(raw)
    assert zlib.crc32(checked[:-4]) == struct.unpack("<I", checked[-4:])[0]
    return checked[:-4]


class Device:
    def __init__(
        self, session: bool = True, watchdog_ms: int = 250, baud=None, store=None, **values
    ) -> None:
        self.controller = BoardController("f28377s", {**ALONE, **values}, baud, watchdog_ms, store)
        self.drive = self.controller.drive
        self.service = self.controller.board.service
        self.id = 0
        self.session = 0
        self.dictionary = self.service.dictionary & 0xFFFF
        self._bytes = b""
        self.bodies: list[bytes] = []  # all bodies that came, except the expected replies
        for which in range(7):
            self.sense(which, MID)
        if session:
            assert self.ask(OPEN, struct.pack("<HI", NONCE, MARK)).status == DONE
            self.session = NONCE

    # -- sensors and time ---------------------------------------------------------------------

    def sense(self, which: int, counts: int) -> None:
        """Sensor 0 .. 5: a current, 6: the dc link."""
        m = self.controller.map
        self.controller.register_words()[m.adc_result[which]] = counts << m.adc_shift

    def tick(self, n: int = 1) -> None:
        """Run fast interrupts, each with the background after it."""
        for _ in range(n):
            lib.ht_virtual_fast(self.controller.board)

    @property
    def now(self) -> int:
        return self.drive.tick

    @property
    def state(self) -> str:
        return self.controller.state

    @property
    def gates_off(self) -> bool:
        return lib.ht_port_tripped(self.controller.port, ALL_LEGS)

    def channel(self, name: str) -> float:
        return self.controller.channel(name)

    # -- the host's end ----------------------------------------------------------------

    def put(self, raw: bytes) -> None:
        assert self.controller.put(raw) == len(raw)

    def receive(self) -> list[bytes]:
        """The bodies that have come since the last call."""
        *frames, self._bytes = (self._bytes + self.controller.take()).split(b"\0")
        return [opened(raw) for raw in frames if raw]

    def request(self, op: int, payload: bytes = b"", session=None, dictionary=None) -> bytes:
        self.id = (self.id + 1) & 0xFF
        session = self.session if session is None else session
        dictionary = self.dictionary if dictionary is None else dictionary
        return struct.pack("<BBHH", op, self.id, session, dictionary) + payload

    def answer(self, body: bytes, patience: int = 400) -> Reply | None:
        """Send the body of a request. Returns its reply, or None."""
        self.put(frame(body))
        return self.wait(body, patience)

    def wait(self, body: bytes, patience: int = 400) -> Reply | None:
        for _ in range(patience):
            self.tick()
            found = None
            for came in self.receive():
                if came[0] == body[0] | 0x80 and came[1] == body[1]:
                    status, state, faults, tick = struct.unpack_from("<BBHI", came, 2)
                    found = Reply(status, firmware.STATES[state], faults, tick, came[10:])
                else:
                    self.bodies.append(came)
            if found:
                return found
        return None

    def ask(self, op: int, payload: bytes = b"", session=None, dictionary=None) -> Reply:
        reply = self.answer(self.request(op, payload, session, dictionary))
        assert reply is not None, "no reply"
        return reply

    def done(self, op: int, layout: str = "", *values: object) -> Reply:
        """A request that must succeed, its payload packed."""
        reply = self.ask(op, struct.pack("<" + layout, *values))
        assert reply.status == DONE, reply
        return reply

    def write(self, **values: float) -> Reply:
        pairs = b"".join(struct.pack("<Hf", PARAMETERS[n], v) for n, v in values.items())
        return self.ask(WRITE, pairs)

    def value(self, name: str) -> float:
        (value,) = struct.unpack("<f", self.done(GET, "H", PARAMETERS[name]).payload)
        return value

    def watchdog(self) -> tuple[bool, int]:
        """(armed, ms left), by a STATUS without the session."""
        flags, _, left_ms, *_ = struct.unpack("<BBHIIIIB", self.ask(STATUS, session=0).payload)
        return bool(flags & 4), left_ms

    def stream(self, slot: int, decimation: int, *channels: str) -> Reply:
        ids = [CHANNELS[c] for c in channels]
        n = len(ids)
        return self.ask(STREAM, struct.pack(f"<BBH{n}H", slot, n, decimation, *ids))

    def samples(self, slot: int) -> list[tuple[int, int, tuple[float, ...]]]:
        """Take the samples that have come, in order: (number, tick, values)."""
        self.bodies += self.receive()
        mine = [b for b in self.bodies if b[0] == 0x40 + slot]
        self.bodies = [b for b in self.bodies if b[0] != 0x40 + slot]
        return [(b[1], *_unpacked(b)) for b in mine]

    def run(self) -> None:
        """Start the drive by a request and wait until it runs. The host keeps the session."""
        self.done(START)
        for _ in range(TO_RUN // 10):
            self.done(STATUS)
            self.tick(10)
        assert self.state == "run"


def _unpacked(body: bytes) -> tuple[int, tuple[float, ...]]:
    tick, *values = struct.unpack(f"<I{(len(body) - 6) // 4}f", body[2:])
    return tick, tuple(values)
