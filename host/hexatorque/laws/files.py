"""Laws in the user's own files: Python, or C as a shared library."""

from __future__ import annotations

import ctypes
import runpy
from pathlib import Path

import numpy as np

from .law import Law, LawError

#: What a library must define, and what it may define besides (firmware/port/host/ht_host_law.h).
STEP = "ht_law_step"
KIND = "ht_law_returns_vectors"
MEMORY = "ht_law_memory_bytes"


def from_file(path: Path) -> Law:
    """LawError if the file cannot be read, fails, or has no law."""
    if not path.is_file():
        raise LawError(f"{path}: no such file")
    return _from_python(path) if path.suffix == ".py" else LibraryLaw(path)


def _from_python(path: Path) -> Law:
    """The last class derived from Law that the file defines itself."""
    try:
        found = [
            value
            for value in runpy.run_path(str(path)).values()
            if isinstance(value, type) and issubclass(value, Law) and value is not Law
        ]
        own = [value for value in found if not value.__module__.startswith("hexatorque.")]
        if own:
            return own[-1]()
    except Exception as error:
        raise LawError(f"{path}: {type(error).__name__}: {error}") from None
    raise LawError(f"{path}: defines no class that is derived from hexatorque.laws.Law")


class LibraryLaw(Law):
    """A law in C: a shared library with the function `ht_law_step`, an ht_host_law_step. It is
    named by the file. The constant `uint32_t ht_law_returns_vectors` says whether it returns
    vectors (1) or duty ratios (0, or absent), `uint32_t ht_law_memory_bytes` how much memory it
    gets, zeroed at each start."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._library = ctypes.CDLL(str(path.resolve()))
        except OSError as error:
            raise LawError(f"{path}: cannot be loaded: {error}") from None
        try:
            self._step = ctypes.cast(getattr(self._library, STEP), ctypes.c_void_p).value
        except AttributeError:
            raise LawError(f"{path}: has no function {STEP}") from None
        self.returns = "vectors" if self._number(KIND) else "duties"  # type: ignore[misc]

    def _number(self, name: str) -> int:
        try:
            return ctypes.c_uint32.in_dll(self._library, name).value
        except ValueError:
            return 0

    @property
    def label(self) -> str:
        return self.path.stem

    def memory(self, parameters: object) -> np.record:
        words = -(-max(self._number(MEMORY), 8) // 8)
        return np.zeros(1, [("words", "f8", (words,))]).view(np.recarray)[0]

    def entry(self, memory: np.record) -> int | None:
        return self._step
