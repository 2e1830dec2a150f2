"""A virtual board's network port for XCP: TCP and UDP on one number, for one master at a time."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
from typing import Protocol

from ..firmware import FirmwareError
from ..serial.port import not_listening

#: ASAM's port for XCP.
PORT = 5555
#: A master that leaves so much unread is cut off: half a frame must not reach it.
UNREAD_BYTES = 4_000_000


class XcpLine(Protocol):
    """A board's line that is XCP's alone."""

    def put_net(self, raw: bytes) -> int: ...

    def take_net(self) -> bytes: ...


class XcpPort:
    """Passes bytes between sockets and the board's line for XCP, whose frames TCP and UDP carry
    unchanged. `number` 0: any free one."""

    def __init__(self, number: int = PORT, host: str = "127.0.0.1") -> None:
        if not 0 <= number <= 65535:
            raise FirmwareError(f"XCP port = {number}: allowed range is 0 .. 65535")
        self._datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._master: socket.socket | None = None  # by TCP
        self._peer: tuple | None = None  # by UDP
        self._sent = bytearray()  # by the board, not passed on yet
        try:
            self._listener = socket.create_server((host, number))
        except OSError as error:
            self._datagrams.close()
            raise FirmwareError(f"XCP port {number}: {not_listening(error)}") from None
        self.number = self._listener.getsockname()[1]
        try:
            self._datagrams.bind((host, self.number))
        except OSError as error:
            self.close()
            raise FirmwareError(f"XCP port {number}: {not_listening(error)}") from None
        self._waiting = b""

    def close(self) -> None:
        for each in (self._listener, self._datagrams, self._master):
            if each is not None:
                each.close()

    @property
    def sources(self) -> list[socket.socket]:
        """The events to wait for: the end of a master's connection before the begin of
        another's."""
        return [s for s in (self._master, self._datagrams, self._listener) if s is not None]

    def pass_to(self, board: XcpLine) -> bool:
        """The masters' bytes go to the board, as far as its line takes them. Returns whether
        there was something."""
        if not self._waiting:
            ready, _, _ = select.select(self.sources, [], [], 0)
            self._waiting = b"".join(self._read(source) for source in ready)
        busy = bool(self._waiting)
        if busy:
            self._waiting = self._waiting[board.put_net(self._waiting) :]
        return busy

    def _read(self, source: socket.socket) -> bytes:
        if source is self._listener:
            master, _ = source.accept()
            if self._master is not None:
                master.close()  # the first one stays
            else:
                master.setblocking(False)
                master.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._master, self._peer = master, None
                self._sent.clear()
            return b""
        if source is self._datagrams:
            raw, peer = source.recvfrom(65536)
            if self._master is not None:
                return b""
            self._peer = peer
            return raw
        try:
            raw = source.recv(65536)
        except OSError:
            raw = b""
        if not raw:
            self._cut_off()
        return raw

    def _cut_off(self) -> None:
        if self._master is not None:
            self._master.close()
        self._master = None
        self._sent.clear()

    def pass_from(self, board: XcpLine) -> None:
        """The board's bytes go to its master."""
        self._sent += board.take_net()
        if self._master is not None:
            self._stream()
        elif self._peer is not None:
            self._send_frames(self._peer)
        else:
            self._sent.clear()

    def _stream(self) -> None:
        assert self._master is not None
        try:
            while self._sent:
                del self._sent[: self._master.send(self._sent)]
        except BlockingIOError:
            if len(self._sent) > UNREAD_BYTES:
                self._cut_off()
        except OSError:
            self._cut_off()

    def _send_frames(self, peer: tuple) -> None:
        """A datagram has whole frames."""
        while len(self._sent) >= 4:
            length = 4 + struct.unpack_from("<H", self._sent)[0]
            if len(self._sent) < length:
                return
            with contextlib.suppress(OSError):  # gone, or too slow: a datagram may be lost
                self._datagrams.sendto(self._sent[:length], peer)
            del self._sent[:length]
