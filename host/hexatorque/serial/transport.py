"""The client's connection to a port: a socket to the port's server (server.py), which is started
if there is none. One thread reads the socket."""

from __future__ import annotations

import json
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from .. import __version__, system
from . import LinkError, runtime
from .exchange import PULSE_S, Busy, NoReply, Notice, Unpacker, is_process, packed

#: If this many pulses in a row are missing, the server does not run. Pulses are counted instead of
#: time, because this process may not have run itself.
MISSED_PULSES = 5
#: A server that is just starting or ending has done so within this time.
CHANGE_S = 2.0
#: Python starts within this time, even on a busy computer.
START_S = 20.0


def hung(url: str, pid: int) -> LinkError:
    return LinkError(
        f"{url}: the port server, process {pid}, does not answer; the board stops a running "
        f"drive by itself after 250 ms; end it with: {system.kill_command(pid)}"
    )


class Transport:
    """A connection to a port. The reading thread calls `bodies(list)` and `lost()`."""

    def __init__(
        self,
        url: str,
        bauds: tuple[int, ...],
        bodies: Callable[[list[bytes]], None],
        lost: Callable[[], None],
        quick: bool = False,
    ) -> None:
        """bauds: the baud rates to try; if the server already has the port open, its rate must be
        one of them. quick: try a port of the computer itself only once at each rate."""
        self.url = url
        self._bauds, self._quick = bauds, quick
        self._bodies, self._lost = bodies, lost
        self._write_lock = threading.Lock()
        self._closing = False
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        #: Why the port is lost.
        self.reason = ""
        #: When the server last sent anything.
        self.heard = 0
        self.pid = 0  #: process id of the server
        self.baud = bauds[0]
        self.shared = False  #: the server had other clients before
        self._connect()

    def start(self) -> None:
        """Start the reading thread."""
        self._thread = threading.Thread(target=self._run, name=f"reader of {self.url}", daemon=True)
        self._thread.start()

    @property
    def plugged(self) -> bool:
        return self._socket is not None

    def write(self, body: bytes) -> None:
        with self._write_lock:
            connection = self._socket
            if connection is None:
                raise LinkError(f"{self.url}: {self.reason}")
            try:
                connection.sendall(packed(body))
            except TimeoutError:
                raise hung(self.url, self.pid) from None
            except OSError as error:
                raise LinkError(f"{self.url}: cannot send ({error.strerror})") from None

    def hung(self) -> LinkError:
        return hung(self.url, self.pid)

    def again(self) -> bool:
        """Try once to open a lost port again. A pseudo-terminal is not opened again, because its
        name may now belong to another process."""
        if (
            is_process(self.url)
            and not os.path.islink(self.url)
            and self.reason.startswith("unplugged")
        ):
            return False
        if "://" not in self.url and not os.path.exists(self.url):
            return False
        if self._thread:
            self._thread.join()
        try:
            self._connect()
        except LinkError:
            return False
        self.start()
        return True

    def close(self) -> None:
        self._closing = True
        self._drop("closed")
        if self._thread and threading.current_thread() is not self._thread:
            self._thread.join()

    def _drop(self, reason: str) -> None:
        connection, self._socket = self._socket, None
        if connection is None:
            return
        self.reason = self.reason or reason
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)  # the reader wakes up
        if threading.current_thread() is self._thread or self._thread is None:
            connection.close()

    def _run(self) -> None:
        connection = self._socket
        unpacker = self._unpacker
        self._bodies(self._first)
        while connection:
            try:
                data = connection.recv(1 << 18)
            except TimeoutError:
                continue
            except OSError:
                data = b""
            if not data:
                break
            self.heard += 1
            bodies = unpacker.push(data)
            for body in bodies:
                if body[0] == Notice.LOST:
                    self.reason = "unplugged"
            self._bodies(bodies)
        self._drop("the port server has ended")
        if connection:
            connection.close()
        if not self._closing:
            self._lost()

    # -- finding the server ------------------------------------------------------------------

    def _connect(self) -> None:
        end_s = time.monotonic() + CHANGE_S
        while True:
            connection = self._dial()
            if connection:
                greeting = self._greeted(connection)
                if greeting:
                    break
                connection.close()
            else:
                said = self._serve()
                if said.get("ready"):
                    end_s = time.monotonic() + CHANGE_S
                    continue
                if "error" in said:
                    kind = Busy if said["busy"] else NoReply if said["silent"] else LinkError
                    raise kind(said["error"], mistake=said["mistake"])
            if time.monotonic() > end_s:
                raise self._nobody()
            time.sleep(0.02)
        if greeting["version"] != __version__:
            connection.close()
            raise LinkError(
                f"{self.url}: the port server, process {greeting['pid']}, is of hexatorque "
                f"{greeting['version']}, this is {__version__}; end it with: "
                f"{system.end_command(greeting['pid'])}"
            )
        if greeting["baud"] not in self._bauds and not is_process(self.url):
            connection.close()
            raise LinkError(
                f"{self.url}: open at {greeting['baud']} baud in the port server, process "
                f"{greeting['pid']}"
            )
        self.pid, self.baud = greeting["pid"], greeting["baud"]
        self.shared = greeting["clients"] > 0
        self.reason = ""
        connection.settimeout(MISSED_PULSES * PULSE_S)
        self._socket = connection

    def _dial(self) -> socket.socket | None:
        path = runtime.port_path(self.url, "sock")
        try:
            return system.dial(path, MISSED_PULSES * PULSE_S)
        except (FileNotFoundError, ConnectionRefusedError):
            return None
        except (TimeoutError, BlockingIOError):  # the server does not accept connections
            raise self._nobody() from None
        except OSError as error:
            raise LinkError(f"{self.url}: {error.strerror or error}") from None

    def _greeted(self, connection: socket.socket) -> dict | None:
        """The server's greeting; None if it has just ended."""
        self._unpacker = Unpacker()
        missed = 0
        while True:
            if not select.select([connection], [], [], PULSE_S)[0]:
                missed += 1
                if missed == MISSED_PULSES:
                    pid = system.pid_of(connection)
                    connection.close()
                    raise hung(self.url, pid) if pid else self._nobody()
                continue
            try:
                data = connection.recv(4096)
            except OSError:
                return None
            if not data:
                return None
            bodies = self._unpacker.push(data)
            if bodies:
                self._first = bodies[1:]
                return json.loads(bodies[0][1:]) if bodies[0][0] == Notice.GREETING else None

    def _nobody(self) -> LinkError:
        """The error if a server has the port's lock but accepts no clients."""
        server = runtime.locked(runtime.port_path(self.url, "lock"))
        if server:
            return hung(self.url, server.pid)
        return LinkError(f"{self.url}: the port server does not start")

    def _serve(self) -> dict:
        """Start a server. Returns its report: `ready`, `held` by another server, or an error."""
        url = self.url if "://" in self.url else os.path.abspath(self.url)
        package = str(Path(__file__).parents[2])
        path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
        log = runtime.port_path(self.url, "log")
        with log.open("ab") as complaints:
            line = system.first_line_of(
                # -P: import nothing from the user's current directory.
                [sys.executable, "-P", "-m", f"{__package__}.server", url,
                 ",".join(str(baud) for baud in self._bauds), *(["quick"] if self._quick else [])],
                {**os.environ, "PYTHONPATH": path}, complaints, START_S,
            )  # fmt: skip
        if not line:
            return {
                "error": f"{self.url}: the port server does not start, see {log}",
                "mistake": False, "busy": False, "silent": False,
            }  # fmt: skip
        return json.loads(line)
