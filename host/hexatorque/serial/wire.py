"""Frames and bodies as docs/protocol.md defines them: pure functions without input or output."""

from __future__ import annotations

import math
import struct
import zlib
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from cobs import cobs

from .._firmware import ffi, lib
from ..results import waiting

if TYPE_CHECKING:
    import numpy as np

    from ..firmware import SnapshotNumbers

PROTOCOL = lib.HT_NUMBER_PROTOCOL
#: Bits of the faults that every reply has.
LOW_FAULTS = 0xFFFF
#: First minor version with `FAULTS`.
MINOR_OF_FAULTS = 3
#: First one with the log and the limits.
MINOR_OF_LOG = 4
LONGEST_BODY = lib.HT_NUMBER_LONGEST_BODY
#: Longest frame: body, CRC, the bytes that COBS adds, and a zero on either side.
LONGEST_FRAME = LONGEST_BODY + 4 + (LONGEST_BODY + 4) // 254 + 1 + 2
#: The CRC-32 of a body together with its own CRC is always this.
CRC_RESIDUE = 0x2144DF1C
SAMPLE = lib.HT_SERVICE_SAMPLE
STREAMS = lib.HT_NUMBER_STREAMS
DATA = lib.HT_SERVICE_DATA
REPLY = lib.HT_OP_REPLY
#: Largest number of ids in a GET, and of pairs in a WRITE.
GET_MOST, WRITE_MOST = lib.HT_NUMBER_GET, lib.HT_NUMBER_WRITE


class Op(IntEnum):
    """Opcodes: the numbers are those of firmware/link/ht_opcodes.h."""

    HELLO = lib.HT_OP_HELLO
    LIST = lib.HT_OP_LIST
    OPEN = lib.HT_OP_OPEN
    CLOSE = lib.HT_OP_CLOSE
    STATUS = lib.HT_OP_STATUS
    GET = lib.HT_OP_GET
    WRITE = lib.HT_OP_WRITE
    START = lib.HT_OP_START
    STOP = lib.HT_OP_STOP
    CLEAR = lib.HT_OP_CLEAR
    STREAM = lib.HT_OP_STREAM
    ARM = lib.HT_OP_ARM
    CAPTURE = lib.HT_OP_CAPTURE
    READ = lib.HT_OP_READ
    TRIGGER = lib.HT_OP_TRIGGER
    CANCEL = lib.HT_OP_CANCEL
    SNAPSHOT = lib.HT_OP_SNAPSHOT
    SAVE = lib.HT_OP_SAVE
    FORGET = lib.HT_OP_FORGET
    FORGET_LOG = lib.HT_OP_FORGET_LOG


NEEDS_SESSION = frozenset(
    (Op.CLOSE, Op.TRIGGER, Op.CANCEL, Op.READ, Op.WRITE, Op.START, Op.CLEAR, Op.STREAM, Op.ARM,
     Op.SAVE, Op.FORGET, Op.FORGET_LOG)
)  # fmt: skip
#: Requests that write a flash, and the longest time for that; the board does not read meanwhile.
SLOW = frozenset((Op.SAVE, Op.FORGET))
SLOW_S = 12.0


class Status(IntEnum):
    """The statuses that this program knows by name; the texts of all are in results.py."""

    DONE = lib.HT_OK
    ID = lib.HT_ERROR_ID
    VALUE = lib.HT_ERROR_VALUE
    STATE = lib.HT_ERROR_STATE
    CONFIG = lib.HT_ERROR_CONFIG
    PORT = lib.HT_ERROR_PORT
    TURNING = lib.HT_ERROR_TURNING
    TRIP = lib.HT_ERROR_TRIP
    STORE = lib.HT_ERROR_STORE
    PREDICTION = lib.HT_ERROR_PREDICTION
    LAW_SAMPLING = lib.HT_ERROR_SAMPLING
    RESTART = lib.HT_ERROR_RESTART
    OPCODE = lib.HT_SERVICE_OPCODE
    LENGTH = lib.HT_SERVICE_LENGTH
    NO_SESSION = lib.HT_SERVICE_SESSION
    DICTIONARY = lib.HT_SERVICE_DICTIONARY
    OTHER_SESSION = lib.HT_SERVICE_BUSY
    BUDGET = lib.HT_SERVICE_BUDGET
    CAPTURE = lib.HT_SERVICE_CAPTURE
    NO_STREAM = lib.HT_SERVICE_NO_STREAM
    FIELD = lib.HT_SERVICE_FIELD
    MEMORY = lib.HT_SERVICE_MEMORY
    SAMPLING = lib.HT_SERVICE_SAMPLING


#: Text for a refusal with status FIELD, by opcode and offset of the field.
FIELDS: dict[tuple[int, int], str] = {
    (Op.OPEN, 0): "nonce: allowed range is 1 .. 65535",
    (Op.STREAM, 1): "channels of a stream: more than the board has",
    (Op.STREAM, 2): "decimation: allowed range is 1 .. 65535",
    (Op.ARM, 0): "channels of a capture: none, or more than the board has",
    (Op.ARM, 1): "trigger: the board does not know this one",
    (Op.ARM, 2): "prescaler: allowed range is 1 .. 65535",
    (Op.ARM, 4): "samples: 1 or more",
    (Op.ARM, 8): "samples before the trigger: fewer than all samples",
    (Op.ARM, 14): "level of the trigger: a number is needed",
    (Op.READ, 0): "first value: beyond the capture",
    (Op.READ, 4): "values: more than the capture has from there on",
}


class Kind(IntEnum):
    """Rows of LIST that HELLO counts."""

    PARAMETER = lib.HT_LIST_PARAMETER
    CHANNEL = lib.HT_LIST_CHANNEL
    FAULT = lib.HT_LIST_FAULT
    STATE = lib.HT_LIST_STATE


#: The kind of LIST's row of additions since version 2.0.
ADDITIONS = lib.HT_LIST_ADDITIONS
#: The kind of its row about the latest reset, since version 2.2.
RESET = lib.HT_LIST_RESET
#: The kind of its row with all bits of the faults, since version 2.3.
FAULTS = lib.HT_LIST_FAULTS
#: Kinds of the log's counters and events and of the limits, since version 2.4.
COUNTERS, EVENTS, LIMITS = lib.HT_LIST_COUNTERS, lib.HT_LIST_EVENTS, lib.HT_LIST_LIMITS


class CaptureState(IntEnum):
    NONE = lib.HT_BURST_NONE
    FILLING = lib.HT_BURST_FILLING
    WAITING = lib.HT_BURST_WAITING
    TRIGGERED = lib.HT_BURST_TRIGGERED
    SUMMING = lib.HT_BURST_SUMMING
    COMPLETE = lib.HT_BURST_COMPLETE


class WireError(ValueError):
    """The body does not have the form of its type."""


def frame(body: bytes) -> bytes:
    """The frame of a body, with the zeros on both sides."""
    return b"\0" + cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def unframe(raw: bytes) -> bytes | None:
    """The body of the bytes between two zeros, or None if they are damaged."""
    try:
        checked = cobs.decode(raw)
    except cobs.DecodeError:
        return None
    if not 2 <= len(checked) - 4 <= LONGEST_BODY or zlib.crc32(checked) != CRC_RESIDUE:
        return None
    return checked[:-4]


class Splitter:
    """Cuts the bytes of a line into bodies, and counts damaged frames."""

    def __init__(self) -> None:
        self.damaged = 0
        self.restart()

    def restart(self) -> None:
        """Start again. The first bytes may be the end of a frame; they are dropped up to a zero."""
        self._rest = b""
        self._first = True
        self._too_long = False

    def push(self, raw: bytes) -> list[bytes]:
        parts = (self._rest + raw).split(b"\0")
        rest = parts.pop()
        bodies = []
        for part in parts:
            if self._too_long:  # already counted
                self._too_long = False
            elif part:
                body = unframe(part)
                if body is not None:
                    bodies.append(body)
                elif not self._first:
                    self.damaged += 1
            self._first = False
        if len(rest) > LONGEST_FRAME or self._too_long:
            if not self._too_long and not self._first:
                self.damaged += 1
            self._too_long = True
            rest = b""
        self._rest = rest
        return bodies


def request(op: int, id: int, session: int, dictionary: int, payload: bytes = b"") -> bytes:
    return struct.pack("<BBHH", op, id, session, dictionary & 0xFFFF) + payload


class Request(NamedTuple):
    op: int
    id: int
    session: int
    dictionary: int
    payload: bytes


def parse_request(body: bytes) -> Request:
    if len(body) < 6:
        raise WireError("a request has 6 bytes or more")
    op, id, session, dictionary = struct.unpack_from("<BBHH", body)
    return Request(op, id, session, dictionary, body[6:])


class Reply(NamedTuple):
    op: int
    id: int
    status: int
    state: int
    faults: int
    tick: int
    payload: bytes


def parse_reply(body: bytes) -> Reply:
    if len(body) < 10:
        raise WireError("a reply has 10 bytes or more")
    op, id, status, state, faults, tick = struct.unpack_from("<BBBBHI", body)
    return Reply(op - REPLY, id, status, state, faults, tick, body[10:])


#: Replies to these may be as long as a frame can be. Other replies have at most SHORT_REPLY bytes
#: on the line plus twice the request's payload.
_LONG = frozenset((Op.HELLO, Op.LIST))
SHORT_REPLY = 120
#: Before a reply, a board with streams may send samples of up to nine times the reply's length,
#: and the end of a frame that it has begun.
REPLY_SHARE = 11


def reply_bytes(op: int, payload: int) -> int:
    """Largest number of bytes on the line before the end of the reply to a request with `payload`
    bytes of payload."""
    return REPLY_SHARE * (LONGEST_FRAME if op in _LONG else SHORT_REPLY + 2 * payload)


def refusal(reply: Reply) -> str:
    """The text for the payload of a refusal, which says more than its status; "" if empty."""
    if reply.status == Status.FIELD:
        (offset,) = unpack("H", reply.payload)
        return FIELDS.get((reply.op, offset), f"byte {offset} of the payload is out of range")
    if reply.status == Status.MEMORY:
        return f"samples: allowed range is 1 .. {unpack('I', reply.payload)[0]}"
    if reply.status == Status.RESTART:
        (wait_s,) = unpack("H", reply.payload)
        return waiting(wait_s)
    return ""


def reply(
    op: int, id: int, status: int, state: int, faults: int, tick: int, payload: bytes = b""
) -> bytes:
    return struct.pack("<BBBBHI", op + REPLY, id, status, state, faults, tick) + payload


def unpack(layout: str, payload: bytes) -> tuple:
    """The numbers of a payload. WireError unless it has exactly this layout."""
    try:
        return struct.unpack("<" + layout, payload)
    except struct.error:
        raise WireError(
            f"{len(payload)} bytes instead of {struct.calcsize('<' + layout)}"
        ) from None


def _texts(payload: bytes, count: int) -> list[str]:
    parts = payload.split(b"\0")
    if len(parts) != count + 1 or parts[-1]:
        raise WireError(f"{count} texts are needed")
    return [part.decode("ascii", "replace") for part in parts[:-1]]


class Hello(NamedTuple):
    protocol: int
    crc: int
    f_isr_Hz: float
    budget: int  #: bytes per second for streams
    rows: tuple[int, int, int, int]  #: parameters, channels, faults, states
    longest_body: int
    streams: int
    stream_channels: int
    capture_channels: int
    in_session: bool
    memory: int  #: values that captures can hold
    watchdog_ms: int
    device: str
    build: str


_HELLO = struct.Struct("<HIfI4HHBBBBIH")


def parse_hello(payload: bytes) -> Hello:
    if len(payload) < 2:
        raise WireError("a HELLO without a version")
    if (version := struct.unpack_from("<H", payload)[0]) != PROTOCOL:
        raise WireError(f"protocol version {version}, this client speaks {PROTOCOL}")
    if len(payload) < _HELLO.size:
        raise WireError("a HELLO that is too short")
    (
        protocol, crc, f_isr_Hz, budget, parameters, channels, faults, states, longest_body,
        streams, stream_channels, capture_channels, in_session, memory, watchdog_ms,
    ) = _HELLO.unpack_from(payload)  # fmt: skip
    device, build = _texts(payload[_HELLO.size :], 2)
    return Hello(
        protocol, crc, f_isr_Hz, budget, (parameters, channels, faults, states), longest_body,
        streams, stream_channels, capture_channels, bool(in_session), memory, watchdog_ms, device,
        build,
    )  # fmt: skip


class ParameterRow(NamedTuple):
    live: bool
    whole: bool
    min: float
    max: float
    initial: float
    name: str
    unit: str
    choices: str
    help: str


class ChannelRow(NamedTuple):
    name: str
    unit: str
    help: str


class FaultRow(NamedTuple):
    bit: int
    name: str
    help: str


class StateRow(NamedTuple):
    name: str


def parse_row(
    payload: bytes, kind: int, row: int
) -> ParameterRow | ChannelRow | FaultRow | StateRow:
    """One row of the dictionary, from LIST's payload."""
    if len(payload) < 3 or struct.unpack_from("<BH", payload) != (kind, row):
        raise WireError(f"not row {row} of kind {kind}")
    try:
        if kind == Kind.PARAMETER:
            type_, flags, low, high, initial = struct.unpack_from("<BBfff", payload, 3)
            if type_ != 0:
                raise WireError(f"a parameter of unknown type {type_}")
            live, whole = bool(flags & 1), bool(flags & 2)
            return ParameterRow(live, whole, low, high, initial, *_texts(payload[17:], 4))
        if kind == Kind.CHANNEL:
            if payload[3] != 0:
                raise WireError(f"a channel of unknown type {payload[3]}")
            return ChannelRow(*_texts(payload[4:], 3))
        if kind == Kind.FAULT:
            (bit,) = struct.unpack_from("<H", payload, 3)
            return FaultRow(bit or 1 << row, *_texts(payload[5:], 2))
        return StateRow(*_texts(payload[3:], 1))
    except (struct.error, IndexError):
        raise WireError(f"row {row} of kind {kind} is too short") from None


class Additions(NamedTuple):
    """The row of additions, since version 2.1. A board of version 2.0 has none."""

    minor: int = 0
    states: tuple[int, ...] = ()  #: flags of each state


def parse_additions(payload: bytes, hello: Hello) -> Additions:
    """LIST's row of additions. What a later version appends is ignored."""
    states = hello.rows[Kind.STATE]
    if len(payload) < 5 or struct.unpack_from("<BH", payload) != (ADDITIONS, 0):
        raise WireError("not the row of additions")
    (minor,) = struct.unpack_from("<H", payload, 3)
    flags = tuple(payload[5:])
    if len(flags) < states:
        raise WireError("the row of additions is too short")
    return Additions(minor, flags[:states])


class Reset(NamedTuple):
    """Why a board started (firmware/app/ht_resets.def)."""

    number: int
    watchdogs: int  #: resets by a watchdog since power-on
    cause: str
    help: str


def parse_reset(payload: bytes) -> Reset:
    """LIST's row of the reset. What a later version appends is ignored."""
    if len(payload) < 6 or struct.unpack_from("<BH", payload) != (RESET, 0):
        raise WireError("not the row of the reset")
    cause, help, *_ = _texts(b"\0".join(payload[6:].split(b"\0")[:2]) + b"\0", 2)
    number, watchdogs = struct.unpack_from("<BH", payload, 3)
    return Reset(number, watchdogs, cause, help)


class FaultWords(NamedTuple):
    """All bits of the faults. Replies and SNAPSHOT have the first 16."""

    latched: int
    kept: int  #: by the latest fault's snapshot


def parse_fault_words(payload: bytes) -> FaultWords:
    """LIST's row of the faults. What a later version appends is ignored."""
    if len(payload) < 11 or struct.unpack_from("<BH", payload) != (FAULTS, 0):
        raise WireError("not the row of the faults")
    return FaultWords(*struct.unpack_from("<II", payload, 3))


class Counters(NamedTuple):
    """A drive's counters since it was made. Peaks are those that the board's background saw."""

    kept: bool  #: over a power-off
    events: int  #: in the log
    missed: int  #: events for which there was no room
    damaged: int  #: slots of the memory
    powered_s: int
    gates_s: int
    starts: int
    vdc_V: float
    current_A: float
    speed_rpm: float
    winding_degC: float
    trips: tuple[int, ...]  #: by row of the faults


def parse_counters(payload: bytes, faults: int) -> Counters:
    """LIST's row of the counters, for so many faults. What a later version appends is ignored."""
    layout = struct.Struct(f"<BHHHIIIffff{faults}H")
    if len(payload) < 3 + layout.size or struct.unpack_from("<BH", payload) != (COUNTERS, 0):
        raise WireError("not the row of the counters")
    flags, *rest = layout.unpack_from(payload, 3)
    return Counters._make((bool(flags & 1), *rest[:10], tuple(rest[10:])))


class Event(NamedTuple):
    """An event of the log, in numbers (firmware/app/ht_log.h)."""

    event: int
    state: int
    scheme: int
    reset: int
    sequence: int
    powered_s: int
    gates_s: int
    faults: int
    warnings: int
    limits: int
    vdc_V: float
    currents_A: tuple[float, ...]
    speed_rpm: float
    winding_degC: float  #: a temperature that nothing tells is NaN
    device_degC: float
    sink_degC: float


_EVENT = struct.Struct("<BBBBIIIIHHf6fff")
_EVENT_MORE = struct.Struct("<ff")


def parse_event(payload: bytes, row: int) -> Event:
    """A row of the events. What a later version appends is ignored."""
    if len(payload) < 3 + _EVENT.size or struct.unpack_from("<BH", payload) != (EVENTS, row):
        raise WireError(f"not event {row}")
    *first, a, b, c, d, e, f, speed, winding = _EVENT.unpack_from(payload, 3)
    more = (math.nan, math.nan)  # before version 2.5
    if len(payload) >= 3 + _EVENT.size + _EVENT_MORE.size:
        more = _EVENT_MORE.unpack_from(payload, 3 + _EVENT.size)
    return Event._make((*first, (a, b, c, d, e, f), speed, winding, *more))


class LimitRow(NamedTuple):
    bit: int
    acts: bool
    since: int  #: tick
    latest: int  #: tick
    name: str
    help: str


def parse_limit(payload: bytes, row: int) -> LimitRow:
    """A row of the limits. What a later version appends is ignored."""
    layout = struct.Struct("<HBII")
    if len(payload) < 3 + layout.size or struct.unpack_from("<BH", payload) != (LIMITS, row):
        raise WireError(f"not limit {row}")
    bit, acts, since, latest = layout.unpack_from(payload, 3)
    texts = payload[3 + layout.size :].split(b"\0")
    if len(texts) < 3:
        raise WireError("2 texts are needed")
    name, help = (text.decode("ascii", "replace") for text in texts[:2])
    return LimitRow(bit, bool(acts), since, latest, name, help)


class StatusReply(NamedTuple):
    in_session: bool
    ours: bool
    guarded: bool
    capture: int
    watchdog_ms: int
    damaged: int
    overruns: int
    dropped: int
    mark: int  #: set by a client, 0 after a reset (docs/protocol.md)
    set: int  #: the set of parameters with which the board started: `firmware.PARAMETER_SETS`
    more_faults: bool = False  #: some are latched that only LIST's row of the faults has


def parse_status(payload: bytes) -> StatusReply:
    flags, *rest = unpack("BBHIIIIB", payload)
    status = StatusReply(bool(flags & 1), bool(flags & 2), bool(flags & 4), *rest)
    return status._replace(more_faults=bool(flags & 8))


def open_session(nonce: int, mark: int) -> bytes:
    """OPEN's payload."""
    return struct.pack("<HI", nonce, mark)


def parse_open(payload: bytes) -> int:
    """The mark now in force, from the reply to OPEN."""
    return unpack("I", payload)[0]


class CaptureReply(NamedTuple):
    state: int
    number: int
    prescaler: int
    samples: int
    pre: int
    tick: int
    crc: int
    channels: tuple[int, ...]


def parse_capture(payload: bytes) -> CaptureReply:
    fixed = struct.calcsize("<BBHIIII")
    count = max(0, len(payload) - fixed) // 2
    numbers = unpack(f"BBHIIII{count}H", payload)
    state, number, prescaler, samples, pre, tick, crc, *channels = numbers
    return CaptureReply(state, number, prescaler, samples, pre, tick, crc, tuple(channels))


def parse_snapshot(payload: bytes) -> SnapshotNumbers | None:
    """The snapshot of the latest fault, None if there is none. State and faults are numbers."""
    if len(payload) != lib.HT_SNAPSHOT_BYTES:
        raise WireError(f"{len(payload)} bytes instead of {lib.HT_SNAPSHOT_BYTES}")
    from ..firmware import snapshot_numbers  # imports numpy, which the port server must not

    kept = ffi.new("ht_snapshot *")
    lib.ht_snapshot_take(ffi.new("uint16_t[]", list(payload)), kept)
    return snapshot_numbers(kept)


def stream(stream: int, channels: tuple[int, ...], decimation: int) -> bytes:
    """STREAM's payload."""
    return struct.pack(f"<BBH{len(channels)}H", stream, len(channels), decimation, *channels)


def sample_bytes(channels: int) -> int:
    """Bytes of one sample on the line."""
    return 12 + 4 * channels


def sample_type(channels: int) -> np.dtype:
    """The layout of a sample's body."""
    import numpy as np  # here, because the port server must not import it

    return np.dtype(
        [("type", "u1"), ("number", "u1"), ("tick", "<u4"), ("values", "<f4", (channels,))]
    )


def parse_data(body: bytes) -> tuple[int, int, np.ndarray]:
    """Number of the capture, first value, (n,) float32 of a capture's data."""
    if len(body) < 10 or (len(body) - 6) % 4:
        raise WireError("capture data of a wrong length")
    import numpy as np

    _, number, first = struct.unpack_from("<BBI", body)
    return number, first, np.frombuffer(body, "<f4", offset=6)
