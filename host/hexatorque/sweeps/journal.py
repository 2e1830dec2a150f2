"""The rows of a study in a file, a line each as they come, so that an interrupted study goes on.

The first line says what is studied. The end of the file may lack a part of a line: the process was
killed while it wrote. That row is computed again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from .. import system
from .errors import StudyError
from .work import Row

FORMAT = "hexatorque study"


class Journal:
    """A study's file, open for writing. No other process writes it meanwhile."""

    def __init__(self, path: Path, what: dict[str, Any], resume: bool) -> None:
        self.path = path
        what = json.loads(json.dumps({FORMAT: 1, **what}))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: IO[str] = path.open("a+", encoding="utf-8", newline="\n")
        except OSError as error:
            raise StudyError(f"{path}: {error.strerror}") from None
        try:
            self._begin(what, resume)
        except BaseException:
            self._file.close()
            raise

    def _begin(self, what: dict[str, Any], resume: bool) -> None:
        try:
            alone = system.lock(self._file.fileno())
        except OSError as error:
            raise StudyError(f"{self.path}: {error.strerror}") from None
        if not alone:
            raise StudyError(f"{self.path}: another process is at work on this study")
        self._file.seek(0)
        first = self._file.readline()
        if not first.endswith("\n"):  # nothing, or not even the first line
            if resume:
                raise StudyError(f"{self.path}: no study is there that could be resumed")
            self._file.truncate(0)
            self._write(what)
        elif not resume:
            raise StudyError(
                f"{self.path}: a study is there already; --resume goes on with it, -o names "
                "another folder"
            )
        else:
            _compare(self.path, _object(first), what)
            self._cut()

    def _cut(self) -> None:
        """Remove the part of a line at the end."""
        with self.path.open("rb+") as file:
            end = 0
            for line in file:
                if line.endswith(b"\n"):
                    end += len(line)
            file.truncate(end)

    def rows(self) -> Iterator[Row]:
        """The rows that are there. A later row replaces an earlier one of the same number."""
        self._file.seek(0)
        self._file.readline()
        for count, line in enumerate(self._file, 2):
            try:
                number, failure, lost, *figures = json.loads(line)
            except ValueError:
                raise StudyError(f"{self.path}: line {count} is damaged") from None
            values = (math.nan if value is None else value for value in figures)
            yield Row(number, tuple(values), failure, lost)

    def add(self, row: Row) -> None:
        figures = [None if math.isnan(value) else value for value in row.figures]
        self._write([row.number, row.failure, row.lost, *figures])

    def _write(self, what: Any) -> None:
        try:
            self._file.write(json.dumps(what, allow_nan=False) + "\n")
            self._file.flush()
        except OSError as error:
            raise StudyError(
                f"{self.path}: {error.strerror}; the computed runs are kept, --resume goes on"
            ) from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._file.close()
        except OSError:  # of a full disk, and it has been said
            if error is None:
                raise


def _object(line: str) -> dict[str, Any]:
    try:
        found = json.loads(line)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _compare(path: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    if FORMAT not in before:
        raise StudyError(f"{path}: not a study of `hexatorque sweep`")
    old, new = before.pop("identity", {}), now.pop("identity", {})
    if differing := [name for name in {**old, **new} if old.get(name) != new.get(name)]:
        shown = ", ".join(f"{n} {old.get(n)}, now {new.get(n)}" for n in differing)
        raise StudyError(f"{path}: made by another version ({shown}); -o names another folder")
    if differing := [key for key in {**before, **now} if before.get(key) != now.get(key)]:
        raise StudyError(
            f"{path}: another study, which differs in {', '.join(differing)}; -o names another "
            "folder"
        )
