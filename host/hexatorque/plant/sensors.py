"""Current, voltage and position sensors up to the DSP's result registers. The current
sensors' analogue filter runs along with the machine; the rest acts at the sample.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .machine import phase_current

TWO_PI = 2.0 * np.pi


#: Transfer of each channel to 12-bit counts, and where the counts go.
SENSORS = np.dtype(
    [
        ("i_counts_per_A", "f8", (6,)),  # gain errors included
        ("i_filter_rad_s", "f8"),  # corner of the current filters, 0: none
        ("i_last_A", "f8", (6,)),  # their inputs, phase currents, where they stand
        ("i_filtered_A", "f8", (6,)),  # their outputs
        ("i_noise_counts", "f8"),  # rms
        ("random", "u8"),  # state of the noise generator, not 0
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
def _uniform(se):
    """Uniform in (0, 1): xorshift64*, its own state in every simulation."""
    x = se.random
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    se.random = x
    return (np.float64((x * np.uint64(0x2545F4914F6CDD1D)) >> np.uint64(11)) + 0.5) * 2.0**-53


@njit
def _normal(se):
    """Standard normal, Box and Muller."""
    return np.sqrt(-2.0 * np.log(_uniform(se))) * np.cos(TWO_PI * _uniform(se))


@njit
def filter_currents(se, m, y, dt):
    """Advance the current filters over the dt that ended at state y. A first-order lag
    tau di_f/dt = i - i_f, exact for currents that are straight lines over dt."""
    x = se.i_filter_rad_s * dt
    decay = np.exp(-x)
    mean = -np.expm1(-x) / x  # of the decay over dt
    for leg in range(6):
        i = phase_current(m, y, leg)
        behind = (se.i_filtered_A[leg] - se.i_last_A[leg]) * decay
        se.i_filtered_A[leg] = i + behind - (i - se.i_last_A[leg]) * mean
        se.i_last_A[leg] = i


@njit
def _sensed_A(se, m, y, leg):
    if se.i_filter_rad_s > 0.0:
        return se.i_filtered_A[leg]
    return phase_current(m, y, leg)


@njit
def sample(se, m, y, vdc, regs):
    """Convert the present state into the result registers."""
    for leg in range(6):
        reading = _sensed_A(se, m, y, leg) * se.i_counts_per_A[leg] + se.i_offset_counts[leg]
        if se.i_noise_counts > 0.0:
            reading += se.i_noise_counts * _normal(se)
        counts = _counts(reading, se.adc_step)
        regs[se.adc_result + leg] = np.uint16(counts << se.adc_shift)
    counts = _counts(vdc * se.v_counts_per_V, se.adc_step)
    regs[se.adc_result + 6] = np.uint16(counts << se.adc_shift)
    position = np.int64(np.floor(y[7] / TWO_PI * se.encoder_counts_rev)) & 0xFFFFFFFF
    regs[se.qposcnt] = np.uint16(position & 0xFFFF)
    regs[se.qposcnt + 1] = np.uint16(position >> 16)
