"""The file in which a virtual board saves its parameters and its log, as a real board does in its
flash.

The end of this process corresponds to power off: the next process that opens the file finds the
saved parameters. The process may end at any time. The firmware keeps each set twice and refuses
a set that was only partly written (firmware/app/ht_store.h). Therefore blocks are written in
place, and only a new file is made in one step.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from pathlib import Path
from typing import BinaryIO

from .. import system
from ..firmware import FirmwareError, MemoryStore, lib

#: The first bytes of such a file.
HEAD = b"hexatorque store"
assert len(HEAD) == lib.HT_STORE_FILE_HEAD
SIZE = len(HEAD) + MemoryStore.SIZE
#: Of a file without a log, which boards made earlier.
WITHOUT_LOG = len(HEAD) + MemoryStore.LOG


def open_file(path: Path) -> BinaryIO:
    """Open the file for this board alone, and make it if it does not exist, without a buffer.
    FirmwareError if it cannot be opened, is in use, or is another kind of file."""
    try:
        if not path.exists():
            _make(path)
        file = path.open("r+b", buffering=0)
    except OSError as error:
        raise FirmwareError(f"{path}: {error.strerror}") from None
    try:
        if not system.lock(file.fileno()):
            file.close()
            raise FirmwareError(f"{path}: another board has it")
        raw = file.read(SIZE + 1)
        if len(raw) == WITHOUT_LOG and raw.startswith(HEAD):
            erased = b"\xff" * (SIZE - WITHOUT_LOG)
            file.write(erased)
            raw += erased
    except OSError as error:
        file.close()
        raise FirmwareError(f"{path}: {error.strerror}") from None
    if len(raw) != SIZE or not raw.startswith(HEAD):
        file.close()
        raise FirmwareError(
            f"{path}: not a store of parameters (such a file has {SIZE} bytes and begins with "
            f"{HEAD.decode()!r}); name another file, a new one is made"
        )
    return file


def _make(path: Path) -> None:
    """Make the file of an erased store, in one step."""
    file, fresh = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with open(file, "wb") as erased:
            erased.write(HEAD + b"\xff" * MemoryStore.SIZE)
            erased.flush()
            os.fsync(file)
        os.chmod(fresh, 0o644)
        with contextlib.suppress(FileExistsError):  # another process has just made the same file
            os.link(fresh, path)
    finally:
        os.unlink(fresh)


class FileStore(MemoryStore):
    """A memory for parameters in a file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = open_file(path)
        self._file.seek(len(HEAD))
        super().__init__(bytearray(self._file.read(MemoryStore.SIZE)))

    def put(self, begin: int, raw: bytes) -> bool:
        try:
            self._file.seek(len(HEAD) + begin)
            done = self._file.write(raw)
            if done != len(raw):
                raise OSError(0, "no space left")
        except OSError as error:
            print(f"hexatorque: {self.path}: {error.strerror}", file=sys.stderr, flush=True)
            return False
        return super().put(begin, raw)

    def close(self) -> None:
        """Release the file for another board. May be called again."""
        self._file.close()
