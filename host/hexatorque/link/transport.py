"""The line: a serial port, a pseudo-terminal or a `socket://host:port`, directly or through the
process that holds it (relay.py). One thread reads it, and opens it again when it comes back
after it was unplugged."""

from __future__ import annotations

import errno
import os
import select
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import serial

from . import LinkError, runtime

#: Octets per read, and how long it waits for them: few wake-ups at full speed, and a reply
#: is seen in time.
READ_OCTETS = 4096
READ_S = 0.01
#: Time for a reply besides its time on the line; USB adapters keep octets for 16 ms.
REPLY_S = 0.05
#: The same for a virtual board, which is a process that others may hold up; its watchdog is
#: held up with it.
PROCESS_REPLY_S = 0.25
#: On a line that spoils a fifth of its frames three tries lose one GET in eight, eight tries one
#: in a hundred (`hexatorque verify line`). What a process serves loses nothing, but may be late.
TRIES = 8
PROCESS_TRIES = 3
#: How often an unplugged port is looked for.
RETURN_S = 0.2
#: A port that another process holds may be let go, or gain a relay, within this.
BUSY_S = 1.5


_MISSING = (errno.ENOENT, errno.ENXIO, errno.ENODEV)


class Busy(LinkError):
    """The port is there, but another process has it."""


class _RelayPort:
    """A relay's socket, with the few verbs of a serial port that are used here."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(1.0)
        try:
            self._socket.connect(str(path))
        except OSError:
            self._socket.close()
            raise

    def read(self, size: int) -> bytes:
        if not select.select([self._socket], [], [], READ_S)[0]:
            return b""
        octets = self._socket.recv(size)
        if not octets:
            raise OSError(errno.EPIPE, "the process that held the port is gone")
        return octets

    def write(self, octets: bytes) -> None:
        self._socket.sendall(octets)

    def close(self) -> None:
        self._socket.close()


def _serial(url: str, baud: int):
    """Open exclusively; one clear line if that fails."""
    if url.startswith("socket://") and not url.rpartition(":")[2].isdigit():
        raise LinkError(f"{url}: write socket://HOST:PORT", mistake=True)
    try:
        port = serial.serial_for_url(url, do_not_open=True)
        port.baudrate = baud
        port.timeout = READ_S
        port.write_timeout = 1.0
        if "://" not in url:
            port.exclusive = True
        port.open()
    except ValueError as error:
        raise LinkError(f"{url}: {error}", mistake=True) from None
    except (serial.SerialException, OSError) as error:
        number = error_number(error)
        if number in (errno.EBUSY, errno.EAGAIN):
            raise Busy(f"{url}: busy, another program has it open") from None
        missing = number in _MISSING
        reason = "no such device" if missing else _reason(number, baud) or error
        raise LinkError(f"{url}: {reason}", mistake=missing) from None
    return port


def error_number(error: BaseException | None) -> int | None:
    """pyserial keeps the number of some errors only in what they came from; those of
    termios have no attribute for it."""
    while error is not None:
        number = getattr(error, "errno", None) or next(iter(error.args), None)
        if isinstance(number, int):
            return number
        error = error.__context__
    return None


def _reason(number: int | None, baud: int) -> str | None:
    if number in (errno.EACCES, errno.EPERM):
        return "permission denied; on most systems group dialout may use serial ports"
    if number in (errno.ENOTTY, errno.EISDIR):
        return "not a serial port"
    if number == errno.ECONNREFUSED:
        return "connection refused"
    if number == errno.EINVAL:
        return f"the port refuses {baud} baud"
    return None


class Transport:
    """An open line. `octets(data)`, `lost(reason)` and `back()` are called by its thread."""

    def __init__(
        self,
        url: str,
        baud: int,
        octets: Callable[[bytes], None],
        lost: Callable[[str], None],
        back: Callable[[], None],
        patience_s: float = BUSY_S,
    ) -> None:
        self.url = url
        self.baud = baud
        self._octets, self._lost, self._back = octets, lost, back
        self._write_lock = threading.Lock()
        self._closing = threading.Event()
        self.relayed = False
        #: This process is the relay of the port: never its own client.
        self.serves = False
        self._port = self._open(patience_s)
        self._thread = threading.Thread(target=self._run, name=f"reader of {url}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def _open(self, patience_s: float):
        """The relay of whoever holds the port, else the port."""
        end = time.monotonic() + patience_s
        while True:
            try:
                if not self.serves:
                    port = _RelayPort(runtime.relay_path(self.url))
                    self.relayed = True
                    return port
            except OSError:
                self.relayed = False
            try:
                return _serial(self.url, self.baud)
            except Busy:
                if time.monotonic() > end:
                    raise
            time.sleep(0.05)

    @property
    def _process(self) -> bool:
        """A pseudo-terminal: no line, but another process."""
        return os.path.realpath(self.url).startswith("/dev/pts/")

    @property
    def _port_tries(self) -> int:
        return PROCESS_TRIES if self._process else TRIES

    @property
    def tries(self) -> int:
        """A relay loses nothing, and repeats what it asks the board itself."""
        return 1 if self.relayed else self._port_tries

    def reply_s(self, octets: int) -> float:
        """How long to wait for a reply, which so many octets on the line may precede."""
        wait_s = PROCESS_REPLY_S if self._process else REPLY_S
        once = octets * 10 / self.baud + wait_s
        return 2 * self._port_tries * once if self.relayed else once

    @property
    def plugged(self) -> bool:
        return self._port is not None

    def write(self, octets: bytes) -> None:
        with self._write_lock:
            port = self._port
            if port is None:
                raise LinkError(f"{self.url}: unplugged")
            try:
                port.write(octets)
            except (serial.SerialException, OSError) as error:
                raise LinkError(f"{self.url}: cannot send ({error})") from None

    def close(self) -> None:
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()
        self._drop()

    def _drop(self) -> None:
        with self._write_lock:
            port, self._port = self._port, None
            if port is not None:
                port.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                octets = self._port.read(READ_OCTETS)
            except (serial.SerialException, OSError) as error:
                self._drop()
                self._lost(str(error))
                if not self._returned():
                    return
                self._back()
                continue
            if octets:
                self._octets(octets)

    def _returned(self) -> bool:
        """Wait until the port is there again. A pseudo-terminal that is gone does not come
        back: its name may be given to anybody."""
        if self.url.startswith("/dev/pts/") and not self.relayed:
            return False
        while not self._closing.wait(RETURN_S):
            try:
                self._port = self._open(0.0)
            except LinkError:
                continue
            return True
        return False
