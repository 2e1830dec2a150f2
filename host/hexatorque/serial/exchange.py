"""The messages between a port server and its clients: the bodies of docs/protocol.md, each after
its length instead of in a frame, and some messages of the server itself."""

from __future__ import annotations

from enum import IntEnum

from .. import system
from . import LinkError

#: A client that waits for a reply gets this often a sign that the server runs.
PULSE_S = 0.25


class Busy(LinkError):
    """The port exists, but a foreign process has it open."""


class NoReply(LinkError):
    """The line works, but no board answers."""


class Notice(IntEnum):
    """First byte of a message that comes from the server, not from the board."""

    GREETING = 0xF0  #: JSON: the first message
    COUNTERS = 0xF1  #: u32 damaged frames, u32 retries since the server started
    PULSE = 0xF2  #: the server runs, but the board has not answered yet
    FAILED = 0xF3  #: u8 opcode, u8 id, text: this request gets no reply, and the reason
    LOST = 0xF4  #: the port no longer exists
    STOPPED = 0xF5  #: u32 tick, u16 ms: its drive was stopped, as it was silent for so long


def is_process(url: str) -> bool:
    """Whether the port is a pseudo-terminal, with a process at its other end."""
    return "://" not in url and system.is_pseudo_terminal(url)


def packed(body: bytes) -> bytes:
    """A body as it is sent over the socket."""
    return len(body).to_bytes(2, "little") + body


class Unpacker:
    """Cuts the bytes from a socket into bodies."""

    def __init__(self) -> None:
        self._rest = b""

    def push(self, data: bytes) -> list[bytes]:
        data = self._rest + data
        at, bodies = 0, []
        while len(data) >= at + 2:
            end = at + 2 + int.from_bytes(data[at : at + 2], "little")
            if len(data) < end:
                break
            bodies.append(data[at + 2 : end])
            at = end
        self._rest = data[at:]
        return bodies
