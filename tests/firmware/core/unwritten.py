"""Memory for what the firmware is to write. In memory that is all zero it would not show that a
zero is missing."""

from hexatorque.firmware import ffi


def unwritten(kind, **values):
    """A struct in memory as a processor may have it after power-up: numbers are NaN. The values are
    those that the function to be tested only reads."""
    new = ffi.new(kind)
    size = ffi.sizeof(new[0])
    ffi.memmove(new, b"\xff" * size, size)
    for name, value in values.items():
        setattr(new, name, value)
    return new
