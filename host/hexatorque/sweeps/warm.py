"""Imported once by the server from which the worker processes are forked: the simulation is loaded
there, and compiled if it is not yet in numba's cache."""

from __future__ import annotations

from ..drive import comparison  # noqa: F401  (what a run needs)
from ..drive.compiling import compile_now
from . import work  # noqa: F401

compile_now()
