"""What a port server and its clients say to each other: the bodies of docs/protocol.md, each
behind its length instead of in a frame, and some of the server's own."""

from __future__ import annotations

import os
from enum import IntEnum

from . import LinkError

#: Whoever waits for a reply hears this often that the server lives.
PULSE_S = 0.25


class Busy(LinkError):
    """The port is there, but a process that is none of ours has it."""


class NoReply(LinkError):
    """The line is there, but no board that answers."""


class Notice(IntEnum):
    """First byte of a body that is the server's own word, not the board's."""

    GREETING = 0xF0  #: JSON, the first of all
    COUNTERS = 0xF1  #: u32 damaged frames, u32 retries since the server began
    PULSE = 0xF2  #: the board has not answered yet
    FAILED = 0xF3  #: u8 opcode, u8 id, text: there is no reply to this request, and why
    LOST = 0xF4  #: the port is gone


def is_process(url: str) -> bool:
    """A pseudo-terminal: no line, but another process."""
    return os.path.realpath(url).startswith("/dev/pts/")


def packed(body: bytes) -> bytes:
    """A body as it goes over the socket."""
    return len(body).to_bytes(2, "little") + body


class Unpacker:
    """Bodies from a socket's bytes."""

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
