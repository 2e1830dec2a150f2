"""Current, voltage and position sensors up to the DSP's result registers."""

from __future__ import annotations

import numpy as np
from numba import njit

from .machine import phase_current

TWO_PI = 2.0 * np.pi


#: Transfer of each channel to 12-bit counts, and where the counts go.
SENSORS = np.dtype(
    [
        ("i_counts_per_A", "f8"),  # gain error included
        ("i_offset_counts", "f8", (6,)),  # mid scale plus offset
        ("v_counts_per_V", "f8"),
        ("adc_step", "f8"),  # counts per converter step: 1 at 12 bits, 4 at 10 bits
        ("encoder_counts_rev", "f8"),
        ("adc_result", "i8"),  # word address of the first result
        ("adc_shift", "i8"),  # left shift of the result register
        ("qposcnt", "i8"),  # word address, 32 bits
    ]
)


@njit(inline="always")
def _counts(value, step):
    """Round to converter steps and saturate at 12 bits."""
    counts = np.floor(value / step + 0.5) * step
    return np.int64(min(max(counts, 0.0), 4096.0 - step))


@njit
def sample(se, m, y, vdc, regs):
    """Convert the present state into the result registers."""
    for leg in range(6):
        counts = _counts(
            phase_current(m, y, leg) * se.i_counts_per_A + se.i_offset_counts[leg], se.adc_step
        )
        regs[se.adc_result + leg] = np.uint16(counts << se.adc_shift)
    counts = _counts(vdc * se.v_counts_per_V, se.adc_step)
    regs[se.adc_result + 6] = np.uint16(counts << se.adc_shift)
    position = np.int64(np.floor(y[7] / TWO_PI * se.encoder_counts_rev)) & 0xFFFFFFFF
    regs[se.qposcnt] = np.uint16(position & 0xFFFF)
    regs[se.qposcnt + 1] = np.uint16(position >> 16)
