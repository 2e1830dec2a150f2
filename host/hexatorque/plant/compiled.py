"""How the functions of the plant are compiled: `@compiled` instead of numba's `@njit`.

Numba compiles a function again for each combination of types that it is called with. For numba a
literal has another type than a variable, and an array in a record has another type than a slice of
it. So the plant passes `np.int64(0)` in place of 0, `np.bool_(True)` in place of True and
`inv.trial[:]` in place of `inv.trial`, where a function would otherwise be compiled several times.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from numba import njit
from numba.np import linalg

#: Numba normally counts references to every array that is passed on, with an atomic instruction
#: each time. No function of the plant makes an array, so nothing has to be counted. The bits are
#: the same. Numba does not document this option.
NO_COUNTING: dict[str, Any] = {"_nrt": False}
#: For small functions with many arguments, which take longer to pass than to use. They become part
#: of their callers.
INLINE: dict[str, Any] = {**NO_COUNTING, "forceinline": True}

compiled: Callable[..., Any] = partial(njit, **NO_COUNTING)


def _import_without_blas() -> None:
    """Import numba's array functions without scipy, which takes 0.2 s at each start. They look for
    its BLAS only to make `np.cov` faster. Linear algebra in a law of one's own finds it later."""

    def absent() -> None:
        raise ImportError

    look = linalg.ensure_blas
    linalg.ensure_blas = absent  # numba does not document this name
    try:
        import numba.np.arraymath  # noqa: F401 (for its effect)
    finally:
        linalg.ensure_blas = look


_import_without_blas()


def source_hash() -> int:
    """Changes with any file of the compiled plant.

    Numba keeps a compiled function on disk (`cache=True`) and compiles it again when the function's
    own file changes. A function that is a closure over this number is compiled again, too, when the
    file of a function that it calls changes.
    """
    files = sorted(Path(__file__).parent.rglob("*.py"))
    text = b"".join(file.read_bytes() for file in files)
    return zlib.crc32(text) | 1
