"""Processes of Python that begin with the simulation loaded, for tests that need many of them.

A new process takes one to two seconds of computing time to import the simulation and to load its
compiled code. The server here has done so. Each process is a copy (fork) of it, and like any other
process otherwise: its own number, signals, environment, folder, standard streams and end.

The server runs no thread of Python, so a copy of it is whole. It forks a keeper, which forks the
process, waits for its end and tells it: only a parent can know how a process ended.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO

#: One for each process of tests.
_servers: dict[int, tuple[socket.socket, subprocess.Popen]] = {}
MOST_BYTES = 1 << 17
#: What the server imports, besides the simulation.
LOADED = (
    "hexatorque.boards.virtual",
    "hexatorque.cli.board.serve",
    "hexatorque.drive.board",
    "hexatorque.monitor.server",
    "hexatorque.serial.client",
    "rich.console",
)


def _server() -> socket.socket:
    if os.getpid() not in _servers:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            process = subprocess.Popen(
                [sys.executable, __file__, str(theirs.fileno())], pass_fds=[theirs.fileno()]
            )
        _servers[os.getpid()] = ours, process
    return _servers[os.getpid()][0]


def end_server() -> None:
    """When no further process will be started."""
    line, process = _servers.pop(os.getpid(), (None, None))
    if line and process:
        line.close()
        process.wait()


class Forked:
    """Like `subprocess.Popen([sys.executable, *arguments], text=True, ...)`. The arguments begin
    with "-c" and a program, or with "-m" and a module. What is no pipe is the null device."""

    def __init__(
        self,
        arguments: Sequence[object],
        *,
        pipes: Sequence[str] = ("stdout",),
        env: dict[str, str] | None = None,
        cwd: Path | None = None,
    ) -> None:
        self.args = [sys.executable, *map(str, arguments)]
        self.returncode: int | None = None
        self._said: dict[str, str] = {}
        self._status, status = os.pipe()
        theirs = [status]
        for number, name in enumerate(("stdin", "stdout", "stderr")):
            stream: IO | None = None
            if name not in pipes:
                theirs.append(os.open(os.devnull, os.O_RDWR))
            elif number == 0:
                end, ours = os.pipe()
                theirs.append(end)
                stream = os.fdopen(ours, "w")
            else:
                ours, end = os.pipe()
                theirs.append(end)
                stream = os.fdopen(ours)
            setattr(self, name, stream)
        request = {
            "arguments": self.args[1:],
            "environment": dict(os.environ if env is None else env),
            "folder": str(cwd or os.getcwd()),
        }
        socket.send_fds(_server(), [json.dumps(request).encode()], theirs)
        for end in theirs:
            os.close(end)
        self.pid = int(self._line())

    def _line(self) -> bytes:
        text = b""
        while not text.endswith(b"\n"):
            more = os.read(self._status, 1)
            assert more, "the server of processes has ended"
            text += more
        return text

    def poll(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0)
            self.returncode = int(self._line())
            os.close(self._status)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str | None, str | None]:
        """Read both streams to their ends, close all, wait for the end of the process. Called
        again it returns the same."""
        end = time.monotonic() + (3600.0 if timeout is None else timeout)
        if self.stdin:
            self.stdin.close()

        def read(name: str) -> None:
            self._said[name] = getattr(self, name).read()

        readers = [
            threading.Thread(target=read, args=[name], daemon=True)
            for name in ("stdout", "stderr")
            if getattr(self, name) and not getattr(self, name).closed
        ]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join(max(0.0, end - time.monotonic()))
            if reader.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout or 0)
        self.wait(max(0.0, end - time.monotonic()))
        self._close()
        return self._said.get("stdout"), self._said.get("stderr")

    def _close(self) -> None:
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream:
                with contextlib.suppress(BrokenPipeError):
                    stream.close()

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
        self.wait()


# --- the server, a process of its own --------------------------------------------------------


def _requests(line: socket.socket) -> Iterator[tuple[dict, list[int]]]:
    while True:
        data, streams, _, _ = socket.recv_fds(line, MOST_BYTES, 4)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if not data:
            return
        yield json.loads(data), streams


def _forked(request: dict, streams: list[int]) -> bool:
    """Whether this is the new process."""
    status, *standard = streams
    if os.fork():
        for end in streams:
            os.close(end)
        return False
    pid = os.fork()
    if pid:
        for end in standard:
            os.close(end)
        # It has the standard streams of the server, and nothing of the process that it keeps.
        os.write(status, b"%d\n" % pid)
        ended = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with contextlib.suppress(BrokenPipeError):
            os.write(status, b"%d\n" % ended)
        os._exit(0)
    os.close(status)
    for number, end in enumerate(standard):
        os.dup2(end, number)
        os.close(end)
    return True


def _become(request: dict) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    kind, what, *arguments = request["arguments"]
    for path in reversed(os.environ.get("PYTHONPATH", "").split(os.pathsep)):
        if path and path not in sys.path:
            sys.path.insert(0, path)
    if kind == "-c":
        sys.argv = ["-c", *arguments]
        exec(what, {"__name__": "__main__", "__builtins__": __builtins__})
    else:
        import runpy

        sys.argv = [what, *arguments]
        runpy.run_module(what, run_name="__main__", alter_sys=True)


def _serve(line: socket.socket) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: whoever started us ends us
    for module in LOADED:
        import_module(module)
    import_module("hexatorque.drive.simulated").compile_now()
    for request, streams in _requests(line):
        if _forked(request, streams):
            line.close()
            _become(request)
            return


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
