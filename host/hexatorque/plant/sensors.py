"""Current, voltage and position sensors, up to the DSP's result registers.

This includes the eQEP's quadrature counter and capture unit. The current sensors' analogue filter
is integrated together with the machine. Everything else is computed at the sampling instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .compiled import compiled
from .elementary import cos, exp, expm1, log
from .machine import phase_current
from .record import record
from .wires import ABSOLUTE_FAULTS, ENCODER_WIRES

TWO_PI = 2.0 * np.pi

#: Indices in ENCODER_WIRES.
_STRAIGHT, _SWAPPED, _ONE_OPEN, _OPEN = range(4)
#: Indices in ABSOLUTE_FAULTS.
_NO_FAULT, _STUCK, _SILENT, _FLICKERS = range(4)

#: Transfer of each channel to 12-bit counts, and where the counts go.
SENSORS = np.dtype(
    [
        ("i_counts_per_A", "f8", (6,)),  # gain errors included; negative: wired the wrong way
        ("i_leg", "i8", (6,)),  # the leg that each current channel measures
        ("i_filter_rad_s", "f8"),  # corner of the current filters, 0: none
        ("i_last_A", "f8", (6,)),  # the filters' latest inputs: phase currents
        ("i_filtered_A", "f8", (6,)),  # the filters' outputs
        ("i_noise_counts", "f8"),  # rms
        ("random", "u8"),  # state of the noise generator, not 0
        ("i_offset_counts", "f8", (6,)),  # mid scale plus offset
        ("v_counts_per_V", "f8"),
        # Sensors whose value is frozen (1): six currents, dc link, encoder
        ("hold", "i8", (8,)),
        ("adc_full", "f8"),  # counts at full scale
        ("adc_step", "f8"),  # counts per converter step: 1 at 12 bits, 4 at 10 bits
        ("encoder_counts_rev", "f8"),
        ("encoder_wires", "i8"),  # index in ENCODER_WIRES
        ("adc_result", "i8", (7,)),  # word addresses of the results
        # Thermistors of winding and heat sink: are there any; readings; where they go, and which of
        # them takes its turn: register (0: each has its own) and what it holds for them
        ("slow", "i8"),
        ("slow_counts", "f8", (2,)),
        ("slow_result", "i8", (2,)),
        ("slow_select", "i8"),
        ("slow_channel", "i8", (2,)),
        ("adc_shift", "i8"),  # left shift of the result register
        ("adc_flag", "i8"),  # word address of the flag that a sequence has ended
        ("adc_flag_bit", "i8"),
        ("encoder_error_cycles", "f8"),  # displacement of the edges of channel B
        (
            "index_counts",
            "i8",
        ),  # count of the index pulse, the same in each turn; -1: there is none
        # Absolute encoder: readings in a revolution, 0: none; where it reads 0, in revolutions,
        # and which way; index in ABSOLUTE_FAULTS; its latest reading; where it goes (32 bits)
        ("absolute_counts_rev", "f8"),
        ("absolute_rev", "f8"),
        ("absolute_sign", "f8"),
        ("absolute_fault", "i8"),
        ("absolute", "i8"),
        ("absolute_word", "i8"),
        ("eqep", "i8"),  # word address of eQEP1
        ("system_clocks", "f8"),  # SYSCLKOUT cycles from sample to sample
        # State of the encoder interface
        ("position_counts", "f8"),  # position at the previous sample
        ("counter", "i8"),  # the same in whole counts, without the counter's wrap
        ("ticks", "f8"),  # capture clocks since the start
        ("event_tick", "i8"),  # capture clock at the last unit event or overflow
        ("edges", "i8"),  # edges since the last unit event
    ]
)


def sensors_record(
    value: Callable[[str], Any],
    chip: Any,
    slow_channel: Sequence[int],
    eqep: int,
    absolute_word: int,
    full: int,
    middle: int,
    period_s: float,
) -> np.record:
    """value: the value of a key of the set-up's section [sensors]; chip: the map of its registers;
    slow_channel: the converter's inputs of the thermistors; eqep: word address of the encoder's;
    absolute_word: where the absolute encoder's reading goes;
    full, middle: counts of the converter's range and of no current; period_s: from sample to
    sample."""
    per_A = full / (2 * value("i_full_A"))
    wires = np.array(value("i_wires"), int)
    return record(
        SENSORS,
        i_counts_per_A=per_A * np.array(value("i_gain")) * np.sign(wires),
        i_leg=np.maximum(np.abs(wires) - 1, 0),
        i_filter_rad_s=2 * math.pi * value("i_filter_Hz"),
        i_last_A=0.0,
        i_filtered_A=0.0,
        i_noise_counts=per_A * value("i_noise_A"),
        random=value("noise_seed"),
        i_offset_counts=middle + per_A * np.array(value("i_offset_A")),
        hold=0,
        v_counts_per_V=full / value("vdc_full_V"),
        adc_full=float(full),
        adc_step=float(1 << (12 - value("adc_bits"))),
        encoder_counts_rev=4.0 * value("encoder_ppr"),
        encoder_wires=ENCODER_WIRES.index(value("encoder_wires")),
        adc_result=list(chip.adc_result),
        slow=int(max(value(f"{place}_ntc_ohm") for place in THERMISTORS) > 0),
        slow_counts=0.0,
        slow_result=list(chip.adc_slow_result),
        slow_select=0 if chip.adc_slow_select == 0xFFFF else int(chip.adc_slow_select),
        slow_channel=list(slow_channel),
        adc_shift=int(chip.adc_shift),
        adc_flag=int(chip.adc_flag),
        adc_flag_bit=int(chip.adc_flag_bit),
        encoder_error_cycles=value("encoder_error_cycles"),
        index_counts=round(value("encoder_index_deg") / 90 * value("encoder_ppr"))
        if value("encoder_index_deg") > 0
        else -1,
        absolute_counts_rev=float(value("absolute_counts_rev")),
        absolute_rev=value("absolute_deg") / 360,
        absolute_sign=-1.0 if value("absolute_direction") == "reversed" else 1.0,
        absolute_fault=ABSOLUTE_FAULTS.index(value("absolute_fault")),
        absolute=-1,
        absolute_word=absolute_word,
        eqep=eqep,
        system_clocks=period_s * float(chip.system_clock_Hz),
        position_counts=0.0,
        counter=0,
        ticks=0.0,
        event_tick=0,
        edges=0,
    )


#: Where thermistors are, in the order of the firmware's slow channels.
THERMISTORS = ("winding", "sink")
KELVIN_0_DEGC = 273.15


def thermistor_ohm(ohm_25: float, beta_K: float, degC: float) -> float:
    """Resistance of a thermistor (NTC) that has ohm_25 at 25 degC."""
    return ohm_25 * math.exp(beta_K * (1 / (degC + KELVIN_0_DEGC) - 1 / (25 + KELVIN_0_DEGC)))


def thermistor_share(ohm: float, pull_up_ohm: float) -> float:
    """What the input shows of the reference that the pull-up resistor is connected to."""
    return 1.0 if math.isinf(ohm) else ohm / (ohm + pull_up_ohm)


#: eQEP: offsets in words, and bits.
QPOSILAT, QEPCTL, QCAPCTL, QFLG, QEPSTS, QCTMR, QCPRD = 0x08, 0x15, 0x16, 0x19, 0x1C, 0x1D, 0x1E
IEL, IEL_RISE, INDEX_LATCHED = 0x30, 0x10, 0x0400
CEN, UPEVNT, QDF, COEF, CDEF = 0x8000, 0x80, 0x20, 0x08, 0x04
TIMER = 1 << 16


@compiled(inline="always")
def _counts(value, step, full):
    """Round to converter steps and saturate below full scale."""
    counts = np.floor(value / step + 0.5) * step
    return np.int64(min(max(counts, 0.0), full - step))


@compiled
def _uniform(se):
    """A random number, uniform in (0, 1), by xorshift64*. Each simulation has its own state."""
    x = se.random
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    se.random = x
    return (np.float64((x * np.uint64(0x2545F4914F6CDD1D)) >> np.uint64(11)) + 0.5) * 2.0**-53


@compiled
def _normal(se):
    """A random number, standard normal, by Box and Muller's method."""
    return np.sqrt(-2.0 * log(_uniform(se))) * cos(TWO_PI * _uniform(se))


@compiled(inline="always")
def _place(se, edge):
    """Position of an edge, in counts. The edges of channel B are displaced by
    `encoder_error_cycles`: its rise (1 mod 4) is late and its fall (3 mod 4) is early."""
    return edge + 4.0 * se.encoder_error_cycles * ((edge & 1) * (1 - (edge & 2)))


@compiled
def _counter(se, counts):
    """The value of the quadrature counter at position `counts`: the last edge below it."""
    edge = np.int64(np.floor(counts))
    return edge + (_place(se, edge + 1) <= counts) - (_place(se, edge) > counts)


@compiled(inline="always")
def _tick(began, slope, way):
    """Capture clock `way` counts after it showed `began`."""
    return np.int64(np.floor(began + slope * way))


@compiled
def _capture(se, counts, end, regs):
    """Capture unit: edges since the last sample, timed as if the speed between two
    samples were constant. Every 2^UPPS-th edge, in whichever direction, is a unit
    event: the timer goes to QCPRD and starts again from 0. The capture clock runs
    freely. The latches QCTMRLAT and QCPRDLAT are not emulated.

    counts: position in counts, with its fraction; end: as the counter shows it.
    """
    began, before, start = se.ticks, se.position_counts, se.counter
    control = np.int64(regs[se.eqep + QCAPCTL])
    se.position_counts, se.counter = counts, end
    se.ticks += se.system_clocks / (1 << (control >> 4 & 7))
    now = np.int64(np.floor(se.ticks))
    if not control & CEN:
        se.event_tick = now
        return
    status = np.int64(regs[se.eqep + QEPSTS])
    crossed = abs(end - start)
    if crossed:
        forward = end > start
        if forward != (status & QDF > 0):
            status = (status ^ QDF) | CDEF
        slope = (se.ticks - began) / (counts - before)
        # The k-th edge on the way, k = 1, 2, ..., is edge first + k step.
        first, step = (start, 1) if forward else (start + 1, -1)
        unit = 1 << (control & 15)
        events = (se.edges + crossed) // unit
        if events:
            k = unit - se.edges
            tick = _tick(began, slope, _place(se, first + k * step) - before)
            if tick - se.event_tick >= TIMER:
                status |= COEF
            if events > 1:  # the period is between the last two
                k += (events - 1) * unit
                se.event_tick = _tick(began, slope, _place(se, first + (k - unit) * step) - before)
                tick = _tick(began, slope, _place(se, first + k * step) - before)
            regs[se.eqep + QCPRD] = np.uint16((tick - se.event_tick) & 0xFFFF)
            se.event_tick = tick
            status |= UPEVNT
        se.edges += crossed - events * unit
    if now - se.event_tick >= TIMER:
        se.event_tick += (now - se.event_tick) // TIMER * TIMER
        status |= COEF
    regs[se.eqep + QEPSTS] = np.uint16(status)
    regs[se.eqep + QCTMR] = np.uint16(now - se.event_tick)


@compiled
def _index(se, end, regs):
    """The index pulse, high while the counter shows its count: its latest rise since the last
    sample latches the counter. Before `_capture`.

    end: as the counter shows it.
    """
    turn = np.int64(se.encoder_counts_rev)
    rise = end - (end - se.index_counts) % turn
    passed = rise > se.counter
    if end < se.counter:
        if rise < end:
            rise += turn
        passed = rise < se.counter
    if passed and np.int64(regs[se.eqep + QEPCTL]) & IEL == IEL_RISE:
        position = rise & 0xFFFFFFFF
        regs[se.eqep + QPOSILAT] = np.uint16(position & 0xFFFF)
        regs[se.eqep + QPOSILAT + 1] = np.uint16(position >> 16)
        regs[se.eqep + QFLG] |= np.uint16(INDEX_LATCHED)


@compiled
def filter_currents(se, m, y, dt):
    """Advance the current filters over the dt that ended at state y. A first-order lag
    tau di_f/dt = i - i_f, exact for currents that are straight lines over dt."""
    x = se.i_filter_rad_s * dt
    decay = exp(-x)
    mean = -expm1(-x) / x  # mean of the decay over dt
    for leg in range(6):
        i = phase_current(m, y, leg)
        behind = (se.i_filtered_A[leg] - se.i_last_A[leg]) * decay
        se.i_filtered_A[leg] = i + behind - (i - se.i_last_A[leg]) * mean
        se.i_last_A[leg] = i


@compiled
def _sensed_A(se, m, y, leg):
    if se.i_filter_rad_s > 0.0:
        return se.i_filtered_A[leg]
    return phase_current(m, y, leg)


@compiled
def _wrong_wires(se, turned):
    """The counter's value for a shaft that has turned by this many counts."""
    if se.encoder_wires == _SWAPPED:
        return -turned
    if se.encoder_wires == _ONE_OPEN:
        return 0.5 + (np.int64(np.floor(0.5 * turned)) & 1)
    return 0.5


@compiled
def _sample_slow(se, regs):
    for k in range(2):
        if se.slow_select == 0 or np.int64(regs[se.slow_select]) >> 12 == se.slow_channel[k]:
            counts = _counts(se.slow_counts[k], se.adc_step, se.adc_full)
            regs[se.slow_result[k]] = np.uint16(counts << se.adc_shift)


@compiled
def _read_absolute(se, angle_rad, regs):
    """The absolute encoder's reading at this angle of the shaft. If stuck, it keeps the first."""
    if se.absolute_fault != _STUCK or se.absolute < 0:
        turned = se.absolute_sign * (angle_rad / TWO_PI - se.absolute_rev)
        counts = np.int64(np.floor((turned - np.floor(turned)) * se.absolute_counts_rev))
        if se.absolute_fault == _FLICKERS:
            counts += np.int64(_uniform(se) < 0.5)
        se.absolute = counts % np.int64(se.absolute_counts_rev)
    told = np.int64(0) if se.absolute_fault == _SILENT else se.absolute + 1
    regs[se.absolute_word] = np.uint16(told & 0xFFFF)
    regs[se.absolute_word + 1] = np.uint16(told >> 16)


@compiled
def sample_encoder(se, angle_rad, regs):
    """What the encoder's registers show at this angle of the shaft."""
    if se.absolute_counts_rev > 0.0:
        _read_absolute(se, angle_rad, regs)
    turned = angle_rad / TWO_PI * se.encoder_counts_rev
    if se.encoder_wires != _STRAIGHT:
        turned = _wrong_wires(se, turned)
    if se.hold[7] != 0:
        turned = se.position_counts
    counter = _counter(se, turned)
    position = counter & 0xFFFFFFFF
    regs[se.eqep] = np.uint16(position & 0xFFFF)
    regs[se.eqep + 1] = np.uint16(position >> 16)
    if se.index_counts >= 0:
        _index(se, counter, regs)
    _capture(se, turned, counter, regs)


@compiled
def sample(se, m, y, vdc, regs):
    """Convert the present state into the result registers and raise the flag that the
    fast interrupt acknowledges."""
    for leg in range(6):
        sensed_A = _sensed_A(se, m, y, se.i_leg[leg])
        reading = sensed_A * se.i_counts_per_A[leg] + se.i_offset_counts[leg]
        if se.i_noise_counts > 0.0:
            reading += se.i_noise_counts * _normal(se)
        if se.hold[leg] == 0:
            counts = _counts(reading, se.adc_step, se.adc_full)
            regs[se.adc_result[leg]] = np.uint16(counts << se.adc_shift)
    if se.hold[6] == 0:
        counts = _counts(vdc * se.v_counts_per_V, se.adc_step, se.adc_full)
        regs[se.adc_result[6]] = np.uint16(counts << se.adc_shift)
    if se.slow != 0:
        _sample_slow(se, regs)
    regs[se.adc_flag] |= np.uint16(se.adc_flag_bit)
    sample_encoder(se, y[7], regs)
