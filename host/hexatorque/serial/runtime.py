"""The directory in which the processes of one user find each other. Running virtual boards
announce their pseudo-terminals in it, and each port server has its socket and its lock there."""

from __future__ import annotations

import fcntl
import json
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from . import LinkError


def directory() -> Path:
    """`$XDG_RUNTIME_DIR/hexatorque`, or a directory in the temporary directory. LinkError if it
    does not belong to this user alone."""
    if base := os.environ.get("XDG_RUNTIME_DIR"):
        path = Path(base) / "hexatorque"
    else:
        import tempfile  # slow to import

        path = Path(tempfile.gettempdir()) / f"hexatorque-{os.getuid()}"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise LinkError(f"{path}: {error.strerror}") from None
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise LinkError(f"{path}: must be a directory that belongs to you alone (mode 700)")
    return path


def port_path(url: str, suffix: str) -> Path:
    """A file of this port's server: `sock` is its socket, `lock` identifies it, `log` has its
    error messages. The name is short even if the port's name is long."""
    name = url if "://" in url else os.path.realpath(url)
    return directory() / f"port-{zlib.crc32(name.encode()):08x}.{suffix}"


@contextmanager
def short(path: Path) -> Iterator[str]:
    """A name for this socket that fits a socket's address, 107 bytes."""
    if len(os.fsencode(path)) < 100:
        yield str(path)
        return
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


class Locked(NamedTuple):
    pid: int
    command: str
    started: str
    port: str


def locked(path: Path) -> Locked | None:
    """The contents of a server's lock file; None if it cannot be read."""
    try:
        row = json.loads(path.read_text())
        return Locked(int(row["pid"]), *(str(row[key]) for key in Locked._fields[1:]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def announce(port: str, title: str, baud: int = 0) -> Path:
    """Announce that this process serves a board on `port`. `baud` is its baud rate, 0 if that is
    not known. Returns the file, which the caller removes at the end."""
    path = directory() / f"board-{os.getpid()}-{Path(port).name}.json"
    text = json.dumps({"port": port, "title": title, "baud": baud})
    partial = path.with_suffix(".part")
    # It stays open, and so locked, until this process has ended in whatever way. A process number
    # would say less: a killed process keeps its own until its parent has asked, and then another
    # process gets it.
    file = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
    fcntl.flock(file, fcntl.LOCK_EX)
    os.write(file, text.encode())
    partial.replace(path)
    return path


def _locked(path: Path) -> bool:
    """Whether the process that announced a board still runs."""
    file = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(file)
    return False


class Announced(NamedTuple):
    port: str
    title: str
    baud: int


def announced() -> list[Announced]:
    """The virtual boards that run. Files of boards that no longer run are removed."""
    boards = []
    for path in sorted(directory().glob("board-*.json")):
        try:
            row = json.loads(path.read_text())
            board = Announced(str(row["port"]), str(row["title"]), int(row.get("baud", 0)))
            lives = _locked(path)
        except (ValueError, KeyError, TypeError, OSError):
            lives = False
        if not lives:
            path.unlink(missing_ok=True)
        elif os.path.exists(board.port):
            boards.append(board)
    return boards


def bauds_for(url: str, bauds: tuple[int, ...]) -> tuple[int, ...]:
    """The baud rates to try at a port. A rate that a virtual board has announced comes first,
    because each wrong rate takes a second."""
    port = os.path.realpath(url)
    own = tuple(board.baud for board in announced() if board.port == port and board.baud)
    return own + tuple(baud for baud in bauds if baud not in own)
