"""The serial port itself, or a `socket://host:port`: opened by the port server alone."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import stat
import termios
from contextlib import suppress
from typing import NamedTuple

import serial

from . import LinkError
from .exchange import Busy

#: Bytes per read: as many as the driver of a port buffers.
READ_BYTES = 65536
#: Major number of /dev/null, /dev/zero and their like, which many processes have open.
MEMORY_DEVICES = 1
#: How long a `socket://` may take to connect.
CONNECT_S = 3.0
NO_PORT = "not a serial port"

_MISSING = (errno.ENOENT, errno.ENXIO, errno.ENODEV)


class Line:
    """An open port. Reading and writing never wait."""

    def __init__(self, url: str, baud: int) -> None:
        self.url = url
        self._serial: serial.Serial | None = None
        if "://" in url:
            self._socket = _connected(url)
            self._file = self._socket.fileno()
        else:
            self._serial = _serial(url, baud)
            self._file = self._serial.fileno()
        os.set_blocking(self._file, False)

    def fileno(self) -> int:
        return self._file

    def change_baud(self, baud: int) -> None:
        """Change the baud rate. Bytes that came at the former rate are dropped."""
        if self._serial is not None:
            try:
                self._serial.baudrate = baud
                self._serial.reset_input_buffer()
            except (serial.SerialException, OSError, ValueError) as error:
                raise _failed(self.url, baud, error) from None

    def read(self) -> bytes:
        """The bytes that have come, b"" if there are none. OSError if the port is gone."""
        try:
            data = os.read(self._file, READ_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the port was closed")
        return data

    def write(self, data: bytes) -> int:
        """Write what fits the buffer. Returns the number of bytes. OSError if the port is gone."""
        try:
            return os.write(self._file, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        with suppress(OSError, serial.SerialException):
            (self._serial or self._socket).close()


def _connected(url: str) -> socket.socket:
    scheme, _, rest = url.partition("://")
    host, _, number = rest.rpartition(":")
    if scheme != "socket" or not number.isdigit() or not 0 < int(number) < 65536:
        raise LinkError(f"{url}: write socket://HOST:PORT", mistake=True)
    try:
        line = socket.create_connection((host, int(number)), CONNECT_S)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    except OSError as error:
        raise LinkError(f"{url}: {_reason(error.errno, 0) or error.strerror or error}") from None
    return line


def _serial(url: str, baud: int) -> serial.Serial:
    """Open the port for this process alone. LinkError with one line if that fails."""
    with suppress(OSError):  # one that is missing is named below
        found = os.stat(url)
        if not stat.S_ISCHR(found.st_mode) or os.major(found.st_rdev) == MEMORY_DEVICES:
            raise LinkError(f"{url}: {NO_PORT}", mistake=True)
    if holder := holder_of(url):
        raise Busy(f"{url}: in use by {holder}")
    try:
        # Two locks make the port exclusive: pyserial's lock on the file, and TIOCEXCL.
        port = serial.Serial(None, baud, timeout=0, write_timeout=0, exclusive=True)
        port.port = url
        port.open()
    except (serial.SerialException, OSError, ValueError) as error:
        raise _failed(url, baud, error) from None
    if not os.path.realpath(url).startswith("/dev/pts/"):
        # TIOCEXCL ends with the last close. On a pseudo-terminal there is none, because the
        # process that made it keeps it open.
        with suppress(OSError):
            fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
    return port


def _failed(url: str, baud: int, error: BaseException) -> LinkError:
    number = error_number(error)
    if number in (errno.EBUSY, errno.EAGAIN):
        return Busy(f"{url}: in use by {holder_of(url) or 'a process of another user'}")
    missing = number in _MISSING
    reason = "no such device" if missing else _reason(number, baud) or error
    mistake = missing or reason == NO_PORT or isinstance(error, ValueError)
    return LinkError(f"{url}: {reason}", mistake=mistake)


def error_number(error: BaseException | None) -> int | None:
    """The errno of an error. pyserial keeps some only in the error's cause, and errors of termios
    have no attribute for it."""
    while error is not None:
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


class Holder(NamedTuple):
    pid: int
    command: str

    def __str__(self) -> str:
        return f"process {self.pid} ({self.command})"


def _words_of(pid: int) -> list[str]:
    """The command line of a process; empty if this user may not read it."""
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            words = file.read(5000).rstrip(b"\0").split(b"\0")
    except OSError:
        return []
    return [word.decode(errors="replace") for word in words]


def command_of(pid: int) -> str:
    """The command line of a process, shortened; "?" if this user may not read it."""
    program, *arguments = _words_of(pid) or [""]
    # Without the program's folder. An argument may be a script of several lines.
    text = " ".join(" ".join([os.path.basename(program), *arguments]).split())
    return (text if len(text) <= 100 else text[:97] + "...") or "?"


def is_server(pid: int) -> bool:
    """Whether the process is a port server."""
    return f"{__package__}.server" in _words_of(pid)


def holder_of(url: str) -> Holder | None:
    """Another process that has this port open, as far as this user can see. The process that made
    a pseudo-terminal does not count: it has both of its ends open."""
    name = os.path.realpath(url)
    for pid in os.listdir("/proc"):
        if not pid.isdigit() or int(pid) == os.getpid():
            continue
        try:
            handles = os.listdir(f"/proc/{pid}/fd")
        except OSError:
            continue  # the process belongs to another user, or has ended
        masters: list[str] = []
        found = False
        for handle in handles:
            with suppress(OSError):
                target = os.readlink(f"/proc/{pid}/fd/{handle}")
                found = found or target == name
                if target.endswith("/ptmx"):
                    masters.append(handle)
        if found and not _serves(pid, masters, name):
            return Holder(int(pid), command_of(int(pid)))
    return None


def _serves(pid: str, masters: list[str], name: str) -> bool:
    """Whether the process made the pseudo-terminal of this name."""
    for handle in masters:
        with suppress(OSError), open(f"/proc/{pid}/fdinfo/{handle}") as file:
            for line in file:
                key, _, value = line.partition(":")
                if key == "tty-index" and name == f"/dev/pts/{value.strip()}":
                    return True
    return False
