"""File formats of recordings: one module per suffix, each with `save(rec, path)` and `load(path)`.

The libraries for .mf4, .mat and .parquet are extras of the package. They are imported only when
a file of that format is read or written.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from ..errors import InputError

#: Suffix -> the library that it needs besides the package's own. The module in this folder and
#: the extra in pyproject.toml have the suffix as their name.
SUFFIXES = {
    ".csv": None,
    ".npz": None,
    ".mf4": "asammdf",
    ".mat": "scipy.io",
    ".parquet": "pyarrow.parquet",
}
#: Suffixes of tables that other programs write, such as LTspice and PSIM. They are only read.
TEXTS = (".txt", ".tsv")
#: Suffix that is appended while a file is being recorded (`journal`).
PART = ".part"


class RecordingError(InputError):
    """A recording cannot be read or written, or one of its names or values cannot be used."""


class NotWritten(RecordingError):
    """The disk did not take a recording. The command line was right."""

    exit_code = 1


def one_line(error: BaseException) -> str:
    """The text of an exception on one line, without the name of the file."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError) and error.args:
        return f"{error.args[0]} is missing"
    return " ".join(str(error).split()) or type(error).__name__


def suffixes_text() -> str:
    """All suffixes as text: ".csv, .npz, ... or .parquet"."""
    *first, last = SUFFIXES
    return f"{', '.join(first)} or {last}"


def module(path: Path) -> ModuleType:
    """The module for a file, by its suffix. RecordingError if the suffix is unknown or its library
    is not installed."""
    if path.suffix not in SUFFIXES:
        raise RecordingError(f"{path}: unknown suffix, use {suffixes_text()}")
    extra = path.suffix[1:]
    if library := SUFFIXES[path.suffix]:
        try:
            missing = find_spec(library) is None
        except ImportError:  # the package that it is a part of
            missing = True
        if missing:
            name = library.partition(".")[0]
            raise RecordingError(
                f"{path}: {path.suffix} files need {name}: pip install 'hexatorque[{extra}]'"
            )
    return import_module(f".{extra}", __package__)


def reader(path: Path) -> ModuleType:
    """The module that reads a file: of a closed recording, or of one that was not closed."""
    if path.suffix == PART:
        return import_module(".journal", __package__)
    if path.suffix.lower() in TEXTS:
        return import_module(".csv", __package__)
    return module(path.with_suffix(path.suffix.lower()) if path.suffix else path)


def beside(path: Path) -> list[Path]:
    """All files of the recording `path`; `path` itself is the last."""
    return [*([path.with_suffix(".json")] if path.suffix == ".csv" else []), path]


def check_output(path: str | Path) -> Path:
    """Check that `Recording.save` can write a file, and make its folder. Call this before the work
    that fills the file. RecordingError if the suffix is unknown, its library is not installed, or
    the folder cannot be made or written."""
    path = Path(path)
    module(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        directory = next(filter(Path.is_dir, beside(path)), None)
    except OSError as error:
        raise RecordingError(f"{path}: {one_line(error)}") from None
    if directory:
        raise RecordingError(f"{directory}: is a directory")
    return path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Gives the name of a temporary file to write. At the end it replaces `path` in one step. After
    an error the older file is unchanged."""
    # It has the same suffix as the file, because some libraries check that.
    draft = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield draft
        for new, old in zip(beside(draft), beside(path)):
            new.replace(old)
    finally:
        for left in beside(draft):
            with suppress(OSError):
                left.unlink()
