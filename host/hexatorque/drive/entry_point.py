"""C functions that compiled Python code can call."""

from __future__ import annotations

import ctypes

import numba.experimental.function_type  # noqa: F401  (functions as arguments)
from numba import types
from numba.extending import typeof_impl


class EntryPoint(types.WrapperAddressProtocol):
    """One, at its address, with unsigned arguments of 64 bits."""

    def __init__(self, address: int, arguments: int) -> None:
        self._address = address
        self._signature = types.void(*[types.uint64] * arguments)
        self.type = types.FunctionType(self._signature)

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self):
        return self._signature

    def __call__(self, *arguments: int) -> None:
        """The call from a plant that is not compiled (NUMBA_DISABLE_JIT=1)."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_uint64] * len(arguments))(self._address)(
            *map(int, arguments)
        )


@typeof_impl.register(EntryPoint)
def _type_of(entry: EntryPoint, _: object) -> types.Type:
    """Numba's own rule makes the type again at every call, which takes a tenth of a millisecond."""
    return entry.type
