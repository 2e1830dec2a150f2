"""Linux and macOS."""

from __future__ import annotations

import fcntl
import os
import re
import select
import signal
import socket
import stat
import struct
import subprocess
import sys
import termios
import tty
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from multiprocessing.context import BaseContext

    import serial

# -- this computer -------------------------------------------------------------------------------


def usable_cores() -> int:
    """The cores that this process may use: in a container often fewer than the computer has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS


def memory_bytes() -> int:
    """The memory of this computer."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def has_screen() -> bool:
    """Whether a browser would have a window."""
    if sys.platform == "darwin":
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def prepare_output() -> None:
    """The output is UTF-8 here."""


def user_name() -> str:
    """A name of this user that fits a file's name."""
    return str(os.getuid())


def is_private(found: os.stat_result) -> bool:
    """Whether a directory belongs to this user alone."""
    return found.st_uid == os.getuid() and not found.st_mode & 0o077


# -- locks ---------------------------------------------------------------------------------------


def lock(file: int, wait: bool = False) -> bool:
    """Lock an open file, until it is closed or this process ends. Without `wait`, False if another
    process has it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    return True


def is_locked(path: Path) -> bool:
    """Whether a process has locked this file."""
    file = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(file)
    return False


def remove_locked(path: Path, file: int) -> None:
    """Remove a file that this process has locked, and end the lock: in this order, so that nobody
    locks a file that is about to go."""
    path.unlink(missing_ok=True)
    os.close(file)


# -- processes -----------------------------------------------------------------------------------

#: Signals that ask a program to end.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def end_command(pid: int) -> str:
    """The command that asks a process to end."""
    return f"kill {pid}"


def kill_command(pid: int) -> str:
    """The command that ends a process that does not answer."""
    return f"kill -9 {pid}"


def kill(pid: int) -> None:
    """End a process at once, if it still runs."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def first_line_of(
    command: list[str], environment: dict[str, str], complaints: IO[bytes], wait_s: float
) -> bytes:
    """Start a program that goes on when this one has ended (see `detach`), and that a Ctrl-C in
    this terminal does not reach. Returns the first line that it prints, b"" if none comes."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=complaints,
        env=environment, start_new_session=True,
    )  # fmt: skip
    assert process.stdout
    with process.stdout:
        ready = select.select([process.stdout], [], [], wait_s)[0]
        line = process.stdout.readline() if ready else b""
    process.wait()  # the program continues as its child
    return line


def detach() -> None:
    """In such a program: go on as a child, so that its parent need not wait for it."""
    if os.fork():
        os._exit(0)


def worker_context(loaded: str) -> BaseContext:
    """How worker processes start: forked from one that has loaded this module."""
    import multiprocessing

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([loaded])
    return context


def prepare_workers() -> None:
    """Start that one, if it does not run yet."""
    from multiprocessing import forkserver

    forkserver.ensure_running()


def workers_MB() -> list[float]:
    """Memory that each worker shares with no other process; Linux only."""
    from multiprocessing import forkserver

    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    sizes = []
    with suppress(OSError):
        for pid in (
            Path(f"/proc/{server}/task/{server}/children").read_text(encoding="utf-8").split()
        ):
            text = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="utf-8")
            sizes.append(sum(map(int, re.findall(r"^Private\w+:\s+(\d+)", text, re.M))) / 1e3)
    return sizes


# -- processes that talk -------------------------------------------------------------------------


class _Short:
    """A name for this socket that fits a socket's address, 107 bytes."""

    def __init__(self, path: Path) -> None:
        self._path, self._folder = path, -1

    def __enter__(self) -> str:
        if len(os.fsencode(self._path)) < 100:
            return str(self._path)
        self._folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY)
        return f"/proc/self/fd/{self._folder}/{self._path.name}"

    def __exit__(self, *_: object) -> None:
        if self._folder >= 0:
            os.close(self._folder)


def listen(path: Path) -> tuple[socket.socket, bytes]:
    """A socket at this path, and the bytes with which each client begins: none, because only this
    user can open the path."""
    path.unlink(missing_ok=True)  # of a process that was killed
    listener = socket.socket(socket.AF_UNIX)
    with _Short(path) as address:
        listener.bind(address)
    return listener, b""


def dial(path: Path, wait_s: float) -> socket.socket:
    """A connection to it. FileNotFoundError or ConnectionRefusedError if nobody listens."""
    connection = socket.socket(socket.AF_UNIX)
    connection.settimeout(wait_s)
    try:
        with _Short(path) as address:
            connection.connect(address)
    except BaseException:
        connection.close()
        raise
    return connection


def pid_of(connection: socket.socket) -> int | None:
    """The process at the other end, even if it does not run; None if the system does not say."""
    if not hasattr(socket, "SO_PEERCRED"):
        return None  # macOS
    peer = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
    pid: int = struct.unpack("3i", peer)[0]
    return pid


# -- serial ports --------------------------------------------------------------------------------

#: Major number of /dev/null, /dev/zero and their like, which many processes have open.
MEMORY_DEVICES = 1
#: Names of pseudo-terminals, on Linux and on macOS.
PSEUDO_TERMINALS = ("/dev/pts/", "/dev/ttys")


class Bytes:
    """The bytes of an open serial port. Reading and writing never wait: BlockingIOError instead."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        os.set_blocking(port.fileno(), False)

    def fileno(self) -> int:
        return self._port.fileno()

    def recv(self, most: int) -> bytes:
        return os.read(self._port.fileno(), most)

    def send(self, data: bytes) -> int:
        return os.write(self._port.fileno(), data)

    def change_baud(self, baud: int) -> None:
        """Change the baud rate. Bytes that have come are dropped."""
        self._port.baudrate = baud
        self._port.reset_input_buffer()

    def close(self) -> None:
        self._port.close()


def is_pseudo_terminal(port: str) -> bool:
    """Whether a process is at the other end of this port."""
    return os.path.realpath(port).startswith(PSEUDO_TERMINALS)


def is_other_device(port: str) -> bool:
    """Whether something of this name exists that cannot be a serial port."""
    with suppress(OSError):
        found = os.stat(port)
        return not stat.S_ISCHR(found.st_mode) or os.major(found.st_rdev) == MEMORY_DEVICES
    return False


def keep_others_out(port: serial.Serial) -> None:
    """Nobody else can open this port from now on. pyserial has locked the file, but other programs
    may not ask for its lock."""
    if not is_pseudo_terminal(str(port.port)):
        # TIOCEXCL ends with the last close. On a pseudo-terminal there is none, because the
        # process that made it keeps it open.
        with suppress(OSError):
            fcntl.ioctl(port.fileno(), termios.TIOCEXCL)


#: Who has a port open that is busy, if that cannot be seen.
UNKNOWN_HOLDER = "a process of another user"
#: Whether a server takes its TCP port again at once after it has ended. On Windows the option for
#: it takes a port that another program has.
PORTS_ARE_REUSED = True


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


def runs_module(pid: int, module: str) -> bool:
    """Whether the process is Python that runs this module."""
    return module in _words_of(pid)


def holder_of(port: str) -> Holder | None:
    """Another process that has this port open, as far as this user can see; Linux only. The process
    that made a pseudo-terminal does not count: it has both of its ends open."""
    name = os.path.realpath(port)
    for pid in os.listdir("/proc") if os.path.isdir("/proc") else ():
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
        with suppress(OSError), open(f"/proc/{pid}/fdinfo/{handle}", encoding="utf-8") as file:
            for line in file:
                key, _, value = line.partition(":")
                if key == "tty-index" and name == f"/dev/pts/{value.strip()}":
                    return True
    return False


# -- virtual boards and emulators ----------------------------------------------------------------

PSEUDO_TERMINALS_EXIST = EMULATORS_RUN = True


def pseudo_terminal() -> tuple[int, int, str]:
    """One in raw mode: our end, the clients' end, which the caller keeps open too, and its name."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return master, slave, os.ttyname(slave)


def fifo(path: Path) -> None:
    """Make a FIFO."""
    os.mkfifo(path)


def emulator(
    command: list[str], place: Path, said: IO[str], inherited: tuple[int, ...]
) -> subprocess.Popen:
    """Start an emulator, in a session of its own: Ctrl-C reaches only this program, which then
    ends it."""
    return subprocess.Popen(
        command, cwd=place, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said,
        start_new_session=True, pass_fds=inherited,
    )  # fmt: skip


def inherited_pipe(place: Path, name: str, theirs: int) -> tuple[int, int]:
    """Make a pipe whose end `theirs` (0: to read, 1: to write) another process inherits and opens
    under this name. Returns our end and theirs. To open a FIFO takes a partner at its other end,
    so a process that opened one after this program's death would wait for ever; a pipe opens, and
    shows that nobody is there any more."""
    ends = os.pipe()
    (place / name).symlink_to(f"/dev/fd/{ends[theirs]}")
    ours = ends[1 - theirs]
    os.set_blocking(ours, False)
    return ours, ends[theirs]
