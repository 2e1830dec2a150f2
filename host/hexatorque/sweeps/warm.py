"""Imported once by the server from which the worker processes are forked: the simulation is loaded
there, and compiled if it is not yet in numba's cache."""

from __future__ import annotations

import sys

from ..analysis import walk  # noqa: F401  (what a run needs)
from ..drive import comparison  # noqa: F401
from ..drive.compiling import COMPILING, compile_now, watched
from . import work  # noqa: F401

with watched(lambda: print(COMPILING, file=sys.stderr, flush=True), lambda: None):
    compile_now()
