"""Imported once by the server from which the worker processes are forked: the simulation is loaded
there, and compiled if it is not yet in numba's cache.

Nothing that is loaded becomes garbage. Looking for it would take a fifth of the time, and later the
workers would write into memory that they share.
"""

from __future__ import annotations

import gc

gc.disable()

from ..analysis import walk  # noqa: E402, F401  (what a run needs)
from ..drive.simulated import compile_now  # noqa: E402
from ..experiments import steady  # noqa: E402, F401
from . import work  # noqa: E402, F401

compile_now()
gc.freeze()
gc.enable()
