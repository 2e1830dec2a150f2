"""The serial port itself, or a `socket://host:port`: opened by the port server alone."""

from __future__ import annotations

import errno
import re
import socket
from contextlib import suppress

import serial

from .. import system
from . import LinkError
from .exchange import Busy

#: Bytes per read: as many as the driver of a port buffers.
READ_BYTES = 65536
#: How long a `socket://` may take to connect.
CONNECT_S = 3.0
NO_PORT = "not a serial port"

_MISSING = (errno.ENOENT, errno.ENXIO, errno.ENODEV)
#: pyserial tells an error of Windows only in its text: the text of an exception whose last number
#: is of Windows. A port that is in use is "access denied" (5).
_OF_WINDOWS = re.compile(r"\w+\(.*, None, (\d+)\)\)?$", re.DOTALL)
_WINDOWS_NUMBERS = {
    2: errno.ENOENT, 3: errno.ENOENT, 5: errno.EBUSY, 31: errno.ENXIO, 32: errno.EBUSY,
    87: errno.EINVAL, 433: errno.ENODEV, 1167: errno.ENODEV,
}  # fmt: skip


class Line:
    """An open port. Reading and writing never wait."""

    def __init__(self, url: str, baud: int) -> None:
        self.url = url
        self._bytes: socket.socket | system.Bytes
        if "://" in url:
            self._bytes = _connected(url)
        else:
            self._bytes = system.Bytes(_serial(url, baud))

    def fileno(self) -> int:
        return self._bytes.fileno()

    def change_baud(self, baud: int) -> None:
        """Change the baud rate. Bytes that came at the former rate are dropped."""
        if isinstance(self._bytes, system.Bytes):
            try:
                self._bytes.change_baud(baud)
            except (serial.SerialException, OSError, ValueError) as error:
                raise _failed(self.url, baud, error) from None

    def read(self) -> bytes:
        """The bytes that have come, b"" if there are none. OSError if the port is gone."""
        try:
            data = self._bytes.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the port was closed")
        return data

    def write(self, data: bytes) -> int:
        """Write what fits the buffer. Returns the number of bytes. OSError if the port is gone."""
        try:
            return self._bytes.send(data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        with suppress(OSError, serial.SerialException):
            self._bytes.close()


def _connected(url: str) -> socket.socket:
    scheme, _, rest = url.partition("://")
    host, _, number = rest.rpartition(":")
    if scheme != "socket" or not number.isdigit() or not 0 < int(number) < 65536:
        raise LinkError(f"{url}: write socket://HOST:PORT", mistake=True)
    try:
        line = socket.create_connection((host, int(number)), CONNECT_S)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.setblocking(False)
    except OSError as error:
        raise LinkError(f"{url}: {_reason(error.errno, 0) or error.strerror or error}") from None
    return line


def _serial(url: str, baud: int) -> serial.Serial:
    """Open the port for this process alone. LinkError with one line if that fails."""
    if system.is_other_device(url):
        raise LinkError(f"{url}: {NO_PORT}", mistake=True)
    if holder := system.holder_of(url):
        raise Busy(f"{url}: in use by {holder}")
    try:
        port = serial.Serial(None, baud, timeout=0, write_timeout=0, exclusive=True)
        port.port = url
        port.open()
    except (serial.SerialException, OSError, ValueError) as error:
        raise _failed(url, baud, error) from None
    system.keep_others_out(port)
    return port


def _failed(url: str, baud: int, error: BaseException) -> LinkError:
    number = error_number(error)
    if number in (errno.EBUSY, errno.EAGAIN):
        return Busy(f"{url}: in use by {system.holder_of(url) or system.UNKNOWN_HOLDER}")
    missing = number in _MISSING
    reason = "no such device" if missing else _reason(number, baud) or error
    mistake = missing or reason == NO_PORT or isinstance(error, ValueError)
    return LinkError(f"{url}: {reason}", mistake=mistake)


def error_number(error: BaseException | None) -> int | None:
    """The errno of an error. pyserial keeps some only in the error's cause or its text, and errors
    of termios have no attribute for it."""
    while error is not None:
        if found := _OF_WINDOWS.search(str(error)):
            return _WINDOWS_NUMBERS.get(int(found[1]))
        number = getattr(error, "errno", None) or next(iter(error.args), None)
        if isinstance(number, int):
            return number
        error = error.__context__
    return None


def _reason(number: int | None, baud: int) -> str | None:
    if number in (errno.EACCES, errno.EPERM):
        return "permission denied; on most systems group dialout may use serial ports"
    if number == errno.ENOTTY:
        return NO_PORT
    if number == errno.ECONNREFUSED:
        return "connection refused"
    if number == errno.EINVAL:
        return f"the port refuses {baud} baud"
    return None


def not_listening(error: OSError) -> str:
    """Why a program cannot listen at a TCP or UDP port of this computer."""
    if error.errno == errno.EADDRINUSE:
        return "in use by another program"
    if error.errno == errno.EACCES:
        return "not allowed: taken by the system or by a service"
    return error.strerror or str(error)
