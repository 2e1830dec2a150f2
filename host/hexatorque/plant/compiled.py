"""How the functions of the plant are compiled: `@compiled` instead of numba's `@njit`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from numba import njit

#: Numba normally counts references to every array that is passed on, with an atomic instruction
#: each time. No function of the plant makes an array, so nothing has to be counted. The bits are
#: the same. Numba does not document this option.
NO_COUNTING: dict[str, Any] = {"_nrt": False}
#: For small functions with many arguments, which take longer to pass than to use. They become part
#: of their callers.
INLINE: dict[str, Any] = {**NO_COUNTING, "forceinline": True}

compiled: Callable[..., Any] = partial(njit, **NO_COUNTING)
