"""Output pins of the chip, which switch relays and brakes."""

from __future__ import annotations

import numpy as np

from .compiled import compiled

PIN = np.dtype(
    [
        ("level", "i8"),  # word address of its level
        ("drives", "i8"),  # word address of the register that makes it an output
        ("bit", "i8"),  # its place in both
    ]
)


@compiled
def high(pin, regs):
    """1 if the pin is high. A pin that is no output is low, because the board pulls it down."""
    return (np.int64(regs[pin.level]) & np.int64(regs[pin.drives])) >> pin.bit & 1
