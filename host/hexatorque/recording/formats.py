"""Files of recordings: one module per suffix, each with `save(rec, path)` and `load(path)`.

Nothing heavy is imported here: the libraries of .mf4, .mat and .parquet are extras of the
package and are loaded on first use.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType

from ..errors import HexatorqueError

#: Suffix -> the library it needs beyond the package's own. The module here and the extra
#: in pyproject.toml are named as the suffix.
SUFFIXES = {
    ".csv": None,
    ".npz": None,
    ".mf4": "asammdf",
    ".mat": "scipy.io",
    ".parquet": "pyarrow.parquet",
}
#: Added to the name of a file that is still being recorded (`journal`).
PART = ".part"


class RecordingError(HexatorqueError, ValueError):
    """A recording, or its file, that cannot be read or written."""

    exit_code = 2


def one_line(error: BaseException) -> str:
    """What an exception says, without line breaks and without its own file name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()) or type(error).__name__


def suffixes_text() -> str:
    """ ".csv, .npz, ... or .parquet"."""
    *first, last = SUFFIXES
    return f"{', '.join(first)} or {last}"


def module(path: Path) -> ModuleType:
    """The module for a file, by its suffix, with its library loaded."""
    if path.suffix not in SUFFIXES:
        raise RecordingError(f"{path}: unknown suffix, use {suffixes_text()}")
    extra = path.suffix[1:]
    if library := SUFFIXES[path.suffix]:
        try:
            import_module(library)
        except ImportError:
            name = library.partition(".")[0]
            raise RecordingError(
                f"{path}: {path.suffix} files need {name}: pip install 'hexatorque[{extra}]'"
            ) from None
    return import_module(f".{extra}", __package__)


def reader(path: Path) -> ModuleType:
    """The module that reads a file: of a finished recording, or of one never closed."""
    if path.suffix == PART:
        return import_module(".journal", __package__)
    return module(path.with_suffix(path.suffix.lower()))


def beside(path: Path) -> list[Path]:
    """All files that make up the recording `path`, itself last."""
    return [*([path.with_suffix(".json")] if path.suffix == ".csv" else []), path]


def check_output(path: str | Path) -> Path:
    """Refuse a file that `Recording.save` could not write, before the work that fills it:
    unknown suffix, extra not installed, folder that cannot be made or written. Makes the
    folder."""
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
    """A name to write to; what stands under it then replaces `path` in one step. A
    failure leaves an older file as it was."""
    # Named as the file is: writers look at the suffix.
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
