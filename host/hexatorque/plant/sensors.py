"""Current, voltage and position sensors up to the DSP's result registers, the eQEP's
quadrature counter and capture unit among them."""

from __future__ import annotations

import numpy as np
from numba import njit

from .machine import phase_current

TWO_PI = 2.0 * np.pi


#: Transfer of each channel to 12-bit counts, and where the counts go.
SENSORS = np.dtype(
    [
        ("i_counts_per_A", "f8", (6,)),  # gain errors included
        ("i_noise_counts", "f8"),  # rms
        ("random", "u8"),  # state of the noise generator, not 0
        ("i_offset_counts", "f8", (6,)),  # mid scale plus offset
        ("v_counts_per_V", "f8"),
        ("adc_step", "f8"),  # counts per converter step: 1 at 12 bits, 4 at 10 bits
        ("encoder_counts_rev", "f8"),
        ("adc_result", "i8"),  # word address of the first result
        ("adc_shift", "i8"),  # left shift of the result register
        ("encoder_error_cycles", "f8"),  # amplitude, as a share of a quadrature cycle
        ("eqep", "i8"),  # word address of eQEP1
        ("system_clocks", "f8"),  # SYSCLKOUT cycles from sample to sample
        # State of the encoder interface
        ("position_counts", "f8"),  # at the sample before
        ("ticks", "f8"),  # capture clock since the beginning
        ("event_tick", "i8"),  # of the last unit event or overflow
        ("edges", "i8"),  # since the last unit event
    ]
)

#: eQEP: offsets in words, and bits.
QCAPCTL, QEPSTS, QCTMR, QCPRD = 0x16, 0x1C, 0x1D, 0x1E
CEN, UPEVNT, QDF, COEF, CDEF = 0x8000, 0x80, 0x20, 0x08, 0x04
TIMER = 1 << 16


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
def _capture(se, counts, regs):
    """Capture unit: edges since the last sample, timed as if the speed between two
    samples were constant. Every 2^UPPS-th edge, in whichever direction, is a unit
    event: the timer goes to QCPRD and starts again from 0. The capture clock runs
    freely. The latches QCTMRLAT and QCPRDLAT are not emulated.

    counts: position in counts, with its fraction.
    """
    before, began = se.position_counts, se.ticks
    control = np.int64(regs[se.eqep + QCAPCTL])
    se.position_counts = counts
    se.ticks += se.system_clocks / (1 << (control >> 4 & 7))
    now = np.int64(np.floor(se.ticks))
    if not control & CEN:
        se.event_tick = now
        return
    status = np.int64(regs[se.eqep + QEPSTS])
    start, end = np.int64(np.floor(before)), np.int64(np.floor(counts))
    crossed = abs(end - start)
    if crossed:
        forward = end > start
        if forward != (status & QDF > 0):
            status = (status ^ QDF) | CDEF
        slope = (se.ticks - began) / (counts - before)
        # Edge k = 1, 2, ... is at position start + k, backward at start + 1 - k.
        direction, place = (1, start - before) if forward else (-1, start + 1 - before)
        unit = 1 << (control & 15)
        events = (se.edges + crossed) // unit
        if events:
            k = unit - se.edges
            tick = np.int64(np.floor(began + slope * (place + direction * k)))
            if tick - se.event_tick >= TIMER:
                status |= COEF
            if events > 1:
                k += (events - 1) * unit
                se.event_tick = np.int64(np.floor(began + slope * (place + direction * (k - unit))))
                tick = np.int64(np.floor(began + slope * (place + direction * k)))
            regs[se.eqep + QCPRD] = np.uint16((tick - se.event_tick) & 0xFFFF)
            se.event_tick = tick
            status |= UPEVNT
        se.edges += crossed - events * unit
    if now - se.event_tick >= TIMER:
        se.event_tick += (now - se.event_tick) // TIMER * TIMER
        status |= COEF
    regs[se.eqep + QEPSTS] = np.uint16(status)
    regs[se.eqep + QCTMR] = np.uint16(now - se.event_tick)


@njit
def sample(se, m, y, vdc, regs):
    """Convert the present state into the result registers."""
    for leg in range(6):
        reading = phase_current(m, y, leg) * se.i_counts_per_A[leg] + se.i_offset_counts[leg]
        if se.i_noise_counts > 0.0:
            reading += se.i_noise_counts * _normal(se)
        counts = _counts(reading, se.adc_step)
        regs[se.adc_result + leg] = np.uint16(counts << se.adc_shift)
    counts = _counts(vdc * se.v_counts_per_V, se.adc_step)
    regs[se.adc_result + 6] = np.uint16(counts << se.adc_shift)
    turned = y[7] / TWO_PI * se.encoder_counts_rev
    if se.encoder_error_cycles > 0.0:  # four counts a cycle
        turned += 4.0 * se.encoder_error_cycles * np.sin(0.25 * TWO_PI * turned)
    position = np.int64(np.floor(turned)) & 0xFFFFFFFF
    regs[se.eqep] = np.uint16(position & 0xFFFF)
    regs[se.eqep + 1] = np.uint16(position >> 16)
    _capture(se, turned, regs)
