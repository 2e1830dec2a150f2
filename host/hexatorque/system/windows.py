"""Windows."""

from __future__ import annotations

import ctypes
import getpass
import msvcrt
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from multiprocessing.context import BaseContext

    import serial

assert sys.platform == "win32"

# -- this computer -------------------------------------------------------------------------------


def usable_cores() -> int:
    """The cores that this process may use."""
    return os.cpu_count() or 1


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = [("length", ctypes.c_uint32), ("load_percent", ctypes.c_uint32)] + [
        (name, ctypes.c_uint64)
        for name in ("physical", "free", "pages", "free_pages", "virtual", "free_virtual", "rest")
    ]


def memory_bytes() -> int:
    """The memory of this computer."""
    status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
    ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return int(status.physical)


def has_screen() -> bool:
    """Whether a browser would have a window."""
    return True


def prepare_output() -> None:
    """Make output into files and pipes UTF-8, too."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.reconfigure(encoding="utf-8")


def user_name() -> str:
    """A name of this user that fits a file's name."""
    return getpass.getuser()


def is_private(found: os.stat_result) -> bool:
    """Whether a directory belongs to this user alone: each user has a temporary directory."""
    return True


# -- locks ---------------------------------------------------------------------------------------

#: The byte that is locked. A locked byte cannot be read, and no file here is as long.
LOCKED_BYTE = 0x7FFF_FFFE
#: Time between two tries to get a lock.
AGAIN_S = 0.05


def lock(file: int, wait: bool = False) -> bool:
    """Lock an open file, until it is closed or this process ends. Without `wait`, False if another
    process has it."""
    at = os.lseek(file, 0, os.SEEK_CUR)
    try:
        while True:
            os.lseek(file, LOCKED_BYTE, os.SEEK_SET)
            try:
                msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
                return True
            except OSError:
                if not wait:
                    return False
                time.sleep(AGAIN_S)
    finally:
        os.lseek(file, at, os.SEEK_SET)


def is_locked(path: Path) -> bool:
    """Whether a process has locked this file."""
    file = os.open(path, os.O_RDWR)
    try:
        return not lock(file)
    finally:
        os.close(file)


def remove_locked(path: Path, file: int) -> None:
    """End the lock, and remove the file unless another process has it meanwhile: an open file
    cannot be removed."""
    os.close(file)
    with suppress(FileNotFoundError, PermissionError):
        path.unlink()


# -- processes -----------------------------------------------------------------------------------

#: Signals that ask a program to end.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGBREAK)


def end_command(pid: int) -> str:
    """The command that ends a process: none without a window can be asked."""
    return kill_command(pid)


def kill_command(pid: int) -> str:
    """The command that ends a process that does not answer."""
    return f"taskkill /F /PID {pid}"


def kill(pid: int) -> None:
    """End a process at once, if it still runs."""
    with suppress(OSError):
        os.kill(pid, signal.SIGTERM)


#: Programs that go on. Python would complain about each that it forgets.
_STARTED: list[subprocess.Popen] = []


def first_line_of(
    command: list[str], environment: dict[str, str], complaints: IO[bytes], wait_s: float
) -> bytes:
    """Start a program that goes on when this one has ended, and that a Ctrl-C in this console does
    not reach. Returns the first line that it prints, b"" if none comes."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=complaints,
        env=environment,
        creationflags=subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP,
    )  # fmt: skip
    _STARTED.append(process)
    pipe = process.stdout
    assert pipe
    lines: list[bytes] = []
    reader = threading.Thread(target=lambda: lines.append(pipe.readline()), daemon=True)
    reader.start()
    reader.join(wait_s)
    if not lines:
        return b""
    pipe.close()
    return lines[0]


def detach() -> None:
    """In such a program: nothing, its parent does not wait for it."""


def worker_context(loaded: str) -> BaseContext:
    """How worker processes start: each loads everything itself."""
    import multiprocessing

    return multiprocessing.get_context("spawn")


def prepare_workers() -> None:
    """Nothing can be loaded ahead."""


def workers_MB() -> list[float]:
    """The memory of the workers, which is not known on Windows."""
    return []


# -- processes that talk -------------------------------------------------------------------------


def listen(path: Path) -> tuple[socket.socket, bytes]:
    """A socket of this computer that the file at this path names, and the secret with which each
    client begins: it is in the file too, which only this user can read."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    secret = secrets.token_hex(16)
    partial = path.with_suffix(".part")
    partial.write_text(f"{listener.getsockname()[1]} {secret}", encoding="ascii")
    partial.replace(path)
    return listener, secret.encode()


def dial(path: Path, wait_s: float) -> socket.socket:
    """A connection to it. FileNotFoundError or ConnectionRefusedError if nobody listens."""
    number, secret = path.read_text(encoding="ascii").split()
    if not is_locked(path.with_suffix(".lock")):  # it was killed; a refusal would take 2 s
        raise ConnectionRefusedError
    connection = socket.create_connection(("127.0.0.1", int(number)), wait_s)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.sendall(secret.encode())
    return connection


def pid_of(connection: socket.socket) -> int | None:
    """The process at the other end; None, because the system does not say."""
    return None


# -- serial ports --------------------------------------------------------------------------------

#: Reading a port looks this often whether it is closed.
LOOK_S = 0.1


class Bytes:
    """The bytes of an open serial port. Reading and writing never wait: BlockingIOError instead.
    `select` takes only sockets here. Two threads carry the bytes between one and the port."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        port.timeout, port.write_timeout = LOOK_S, None
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        for carry in (self._carry_in, self._carry_out):
            threading.Thread(target=carry, daemon=True).start()

    def _carry_in(self) -> None:
        with suppress(Exception):  # of a closed port: pyserial has many kinds
            while True:
                if data := self._port.read(max(1, self._port.in_waiting)):
                    self._far.sendall(data)
        self._far.close()

    def _carry_out(self) -> None:
        with suppress(Exception):
            while data := self._far.recv(4096):
                self._port.write(data)
        self._far.close()

    def fileno(self) -> int:
        return self._near.fileno()

    def recv(self, most: int) -> bytes:
        return self._near.recv(most)

    def send(self, data: bytes) -> int:
        return self._near.send(data)

    def change_baud(self, baud: int) -> None:
        """Change the baud rate. Bytes that have come are dropped."""
        self._port.baudrate = baud
        self._port.reset_input_buffer()
        with suppress(BlockingIOError):
            while self._near.recv(65536):
                pass

    def close(self) -> None:
        self._near.close()
        self._port.close()


def is_pseudo_terminal(port: str) -> bool:
    """Whether a process is at the other end of this port: there are no such ports here."""
    return False


def is_other_device(port: str) -> bool:
    """Whether something of this name exists that cannot be a serial port."""
    return os.path.isfile(port) or os.path.isdir(port)


def keep_others_out(port: serial.Serial) -> None:
    """Nothing: a port is open only once."""


#: Who has a port open that is busy. Windows says "access denied" whatever the reason.
UNKNOWN_HOLDER = "another program, or this user may not open it"
#: Whether a server takes its TCP port again at once: the option takes one in use as well.
PORTS_ARE_REUSED = False


class Holder(NamedTuple):
    pid: int
    command: str


def command_of(pid: int) -> str:
    """The command line of this process; "?" of others."""
    return " ".join(sys.orig_argv) if pid == os.getpid() else "?"


def runs_module(pid: int, module: str) -> bool:
    """Whether the process is Python that runs this module: not known here."""
    return False


def holder_of(port: str) -> Holder | None:
    """Another process that has this port open: not known here."""
    return None


# -- virtual boards and emulators ----------------------------------------------------------------

PSEUDO_TERMINALS_EXIST = EMULATORS_RUN = False


def pseudo_terminal() -> tuple[int, int, str]:
    """There are none here."""
    raise NotImplementedError


def fifo(path: Path) -> None:
    """There are none here that a file's name stands for."""
    raise NotImplementedError


def emulator(
    command: list[str], place: Path, said: IO[str], inherited: tuple[int, ...]
) -> subprocess.Popen:
    """None runs here: it needs FIFOs."""
    raise NotImplementedError


def inherited_pipe(place: Path, name: str, theirs: int) -> tuple[int, int]:
    """There are none here that a file's name stands for."""
    raise NotImplementedError
