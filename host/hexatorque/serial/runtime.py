"""The directory in which the processes of one user find each other. Running virtual boards
announce their ports in it, and each port server has its socket and its lock there."""

from __future__ import annotations

import json
import os
import stat
import zlib
from pathlib import Path
from typing import NamedTuple

from .. import system
from . import LinkError


def directory() -> Path:
    """`$XDG_RUNTIME_DIR/hexatorque`, or a directory in the temporary directory. LinkError if it
    does not belong to this user alone."""
    if base := os.environ.get("XDG_RUNTIME_DIR"):
        path = Path(base) / "hexatorque"
    else:
        import tempfile  # slow to import

        path = Path(tempfile.gettempdir()) / f"hexatorque-{system.user_name()}"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise LinkError(f"{path}: {error.strerror}") from None
    if not stat.S_ISDIR(found.st_mode) or not system.is_private(found):
        raise LinkError(f"{path}: must be a directory that belongs to you alone (mode 700)")
    return path


def port_path(url: str, suffix: str) -> Path:
    """A file of this port's server: `sock` is its socket, `lock` identifies it, `log` has its
    error messages. The name is short even if the port's name is long."""
    name = url if "://" in url else os.path.realpath(url)
    return directory() / f"port-{zlib.crc32(name.encode()):08x}.{suffix}"


class Locked(NamedTuple):
    pid: int
    command: str
    started: str
    port: str


def locked(path: Path) -> Locked | None:
    """The contents of a server's lock file; None if it cannot be read."""
    try:
        row = json.loads(path.read_text(encoding="utf-8"))
        return Locked(int(row["pid"]), *(str(row[key]) for key in Locked._fields[1:]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


class Announcement:
    """That this process serves a board: a file that names it, and a lock beside the file. The lock
    is held until this process has ended in whatever way. A process number would say less: a killed
    process keeps its own until its parent has asked, and then another process gets it."""

    def __init__(self, port: str, title: str, baud: int = 0) -> None:
        """baud: the board's baud rate, 0 if that is not known."""
        name = f"board-{os.getpid()}-{zlib.crc32(port.encode()):08x}"
        self._path = directory() / f"{name}.json"
        self._lock_path = self._path.with_suffix(".lock")
        self._lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT, 0o600)
        system.lock(self._lock, wait=True)
        partial = self._path.with_suffix(".part")
        partial.write_text(
            json.dumps({"port": port, "title": title, "baud": baud}), encoding="utf-8"
        )
        partial.replace(self._path)

    def close(self) -> None:
        self._path.unlink(missing_ok=True)
        system.remove_locked(self._lock_path, self._lock)


class Announced(NamedTuple):
    port: str
    title: str
    baud: int


def announced() -> list[Announced]:
    """The virtual boards that run. Files of boards that no longer run are removed."""
    boards = []
    for path in sorted(directory().glob("board-*.json")):
        try:
            row = json.loads(path.read_text(encoding="utf-8"))
            board = Announced(str(row["port"]), str(row["title"]), int(row.get("baud", 0)))
            lives = system.is_locked(path.with_suffix(".lock"))
        except (ValueError, KeyError, TypeError, OSError):
            lives = False
        if not lives:
            path.unlink(missing_ok=True)
            path.with_suffix(".lock").unlink(missing_ok=True)
        elif "://" in board.port or os.path.exists(board.port):
            boards.append(board)
    return boards


def bauds_for(url: str, bauds: tuple[int, ...]) -> tuple[int, ...]:
    """The baud rates to try at a port. A rate that a virtual board has announced comes first,
    because each wrong rate takes a second."""
    port = url if "://" in url else os.path.realpath(url)
    own = tuple(board.baud for board in announced() if board.port == port and board.baud)
    return own + tuple(baud for baud in bauds if baud not in own)
