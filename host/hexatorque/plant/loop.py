"""The closed loop, period by period, in compiled code.

Order within one PWM period, as on the chip:

    count 0            ADC sampling starts (ePWM1's counter at zero)
    `sample_count`     currents, Vdc and position are held; the end of their conversion
                       raises the fast interrupt
    `write_count`      the fast interrupt has written its registers
    ...                edges of the active compare registers
    TBPRD              next period

The controller is any function `void f(uint64 handle)`: the firmware on this computer, or a
function that communicates with another target. The slow interrupt runs after the fast one in
every `slow_every`-th period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import uint64

from .brake import command_brake, settle_brake
from .breaks import push_breaks
from .compiled import compiled, source_hash
from .gates import suppress_short_pulses
from .inverter import advance, keep, put_back, set_leg, to_rails
from .link import LINE_A, V, link_V, source_A
from .machine import rk4_step, rk4_two_steps, stator_currents, torque_Nm
from .pins import high
from .pwm import pwm_segment
from .sensors import filter_currents, sample

#: Columns of the plant record.
PLANT_CHANNELS = (
    ("i_alpha_A", "A"),
    ("i_beta_A", "A"),
    ("i_x_A", "A"),
    ("i_y_A", "A"),
    ("psi_alpha_Wb", "Wb"),
    ("psi_beta_Wb", "Wb"),
    ("torque_Nm", "N m"),
    ("speed_rpm", "r/min"),
    ("theta_rad", "rad"),
    ("gates", ""),
)

#: More columns, which a record has only if the set-up has what they tell of: of the link, ...
LINK_CHANNELS = (("link_V", "V"), ("source_A", "A"), ("line_A", "A"))
#: of the machine's temperatures, of the devices', ...
HEAT_CHANNELS = (("winding_degC", "degC"), ("frame_degC", "degC"))
DEVICE_CHANNELS = (("junction_degC", "degC"), ("sink_degC", "degC"))
#: and what the holding brake holds.
BRAKE_CHANNELS = (("brake_Nm", "N m"),)
MORE_CHANNELS = (*LINK_CHANNELS, *HEAT_CHANNELS, *DEVICE_CHANNELS, *BRAKE_CHANNELS)

#: Longest integration step. The error of the phase currents falls with its fourth power
#: and is 9e-8 of their amplitude at most here (docs/model.md, "Measured errors"): the
#: longest of 100 us and its halves and doubles that keeps 1e-6 with a margin.
MAX_STEP_S = 100e-6

#: Counts and clock of the loop.
TIMING = np.dtype(
    [
        ("clock_Hz", "f8"),
        ("period", "i8"),  # counts per period
        ("sample_count", "i8"),
        ("write_count", "i8"),  # >= sample_count, < period; >= 1 under shadow load
        ("slow_every", "i8"),  # periods per slow interrupt
        ("max_step", "i8"),  # longest integration step, counts
    ]
)


class Plant(NamedTuple):
    """The parts behind the gates. machine, load: constants; inverter, sensors: constants and state;
    y: (8,) the machine's state."""

    machine: Any
    load: Any
    inverter: Any
    sensors: Any
    y: np.ndarray


class Chip(NamedTuple):
    """The controller's registers and the modules that make edges of them. map: of the PWM's
    registers; pwm: its state; gates: the shortest pulse; registers: (n,) uint16; handle: of the
    drive in the firmware."""

    map: Any
    pwm: Any
    gates: Any
    registers: np.ndarray
    handle: int


class Samples(NamedTuple):
    """The results of a run.

    instants: of the plant's samples in a period (`sample_instants`);
    plant: (periods * samples in each, len(PLANT_CHANNELS)) or empty;
    address: of channels, (periods, channels) float32, or empty;
    edges: (capacity, 3) int64 or empty; every change of a leg is added as row
    (counts since period 0, leg, LOW | HIGH | OFF | BREAK + kind)."""

    instants: np.ndarray
    plant: np.ndarray
    address: int
    channels: np.ndarray
    edges: np.ndarray


@compiled
def _record(row, m, inv, y, i):
    stator_currents(m, y, i)
    for c in range(4):
        row[c] = i[c]
    row[4] = y[0]
    row[5] = y[1]
    row[6] = torque_Nm(m, y, i)
    row[7] = y[6] * (30.0 / np.pi)
    row[8] = y[7]
    gates = 0
    for leg in range(6):
        # Two bits a leg: 0 low, 1 high, 2 off.
        gates = gates * 4 + inv.leg[leg]
    row[9] = gates
    if inv.more != 0:
        row[10] = inv.link.x[V]
        row[11] = source_A(inv.link)
        row[12] = inv.link.x[LINE_A]
        row[13] = inv.winding_degC
        row[14] = inv.frame_degC
        row[15] = inv.junctions.hottest_degC
        row[16] = inv.junctions.sink_degC
        row[17] = inv.brake_Nm


#: After the last sample of a period. No count is as late.
NEVER = np.iinfo(np.int64).max


def sample_instants(per_period: int, period: int) -> np.ndarray:
    """Counts of the plant's samples in a period of `period` counts: as far apart as whole counts
    allow, from count 0 on. Ends with NEVER."""
    at = [k * period // per_period for k in range(per_period)]
    return np.array([*at, NEVER], np.int64)


#: No samples.
NO_INSTANTS = sample_instants(0, 1)


def _compile_follow(source: int):
    """Make `follow`, which numba keeps on disk (`source_hash`): the loop is not the only function
    that calls it."""

    @compiled(cache=True)
    def follow(plant, vdc, ps, n, c0, c1, tm, instants, k, out, row):
        """Advance the machine over counts c0..c1 along the n edges of the PWM's state; earlier
        edges have been taken already. `vdc`: as in `advance`. Record it at the `instants`
        (`sample_instants`) from number k on: sample k goes to row + k of `out`. Returns the next
        k."""
        if not source:
            return k
        m, load, inv, se, y = plant
        trial0 = inv.trial[:]
        trial1 = inv.kept.y[:]  # `keep` uses it where `advance` is called
        known = False  # whether inv.v belongs to the legs
        ideal = inv.devices.drops == 0 and inv.link.on == 0 and inv.meter.on == 0
        inv.junctions.vdc_V = vdc
        now = c0
        tick = instants[k]
        e = 0
        while e < n and ps.count[e] < c0:
            e += 1
        while now < c1:
            if now == tick:
                _record(out[row + k], m, inv, y, inv.i)
                k += 1
                tick = instants[k]
            while e < n and ps.count[e] == now:
                set_leg(inv, m, y, ps.leg[e], ps.state[e])
                known = False
                e += 1
            stop = min(c1, now + tm.max_step)
            if e < n:
                stop = min(stop, ps.count[e])
            there = tick < stop
            if ideal and inv.off == 0:
                # What `advance` does then. The voltages are kept from edge to edge.
                if not known:
                    to_rails(inv, vdc)
                    known = True
                dt = (stop - now) / tm.clock_Hz
                if not there:
                    rk4_step(m, load, y, inv.v, dt, y, inv.k, inv.z)
                else:
                    # Recording must not change the steps. The one to the sample is made beside
                    # the step to the edge, or beside that to the next sample.
                    dt0 = (tick - now) / tm.clock_Hz
                    tick = instants[k + 1]
                    both = tick < stop
                    if both:
                        dt = (tick - now) / tm.clock_Hz
                    rk4_two_steps(
                        m, load, y, inv.v, dt0, dt, trial0, trial1 if both else y, inv.k, inv.z
                    )
                    _record(out[row + k], m, inv, trial0, inv.i)
                    k += 1
                    if both:
                        _record(out[row + k], m, inv, trial1, inv.i)
                        k += 1
                        tick = instants[k]
                        continue
            else:
                if there:
                    # Recording must not change the steps: the state is put back after the sample.
                    keep(inv, y)
                    advance(inv, m, load, y, (tick - now) / tm.clock_Hz, vdc)
                    _record(out[row + k], m, inv, y, inv.i)
                    put_back(inv, y)
                    k += 1
                    tick = instants[k]
                    continue
                dt = (stop - now) / tm.clock_Hz
                advance(inv, m, load, y, dt, vdc)
            if load.brake.torque_Nm > 0.0:
                settle_brake(inv, m, load, y)
            if se.i_filter_rad_s > 0.0:
                filter_currents(se, m, y, dt)
            now = stop
        return k

    return follow


follow = _compile_follow(source_hash())


@compiled
def _log(edges, logged, ps, n, start):
    """Append a period's edges. Returns the new number of edges."""
    if logged + n > edges.shape[0]:
        raise IndexError("the log of gate edges is full")
    for e in range(n):
        edges[logged + e, 0] = start + ps.count[e]
        edges[logged + e, 1] = ps.leg[e]
        edges[logged + e, 2] = ps.state[e]
    return logged + n


def _compile_run_periods(source: int):
    """Make the loop, which numba keeps on disk (`source_hash`)."""

    @compiled(cache=True, nogil=True)
    def run_periods(
        n, first, tm, plant, vdc, chip, fast_isr, slow_isr, read_channels, samples, logged
    ):
        """Run n periods; `first` is the index of the first one (for the slow loop). The interrupts
        are called with the handle, `read_channels` with it and an address. `samples` has `logged`
        edges already. Returns the new number of edges.

        Between sampling and register write the controller does not see the machine. So it is
        called right after the sampling, and then the machine advances over the whole time.
        """
        if not source:
            return logged
        inv, load = plant.inverter, plant.load
        pm, ps, gd, regs = chip.map, chip.pwm, chip.gates, chip.registers
        instants, plant_out, edges = samples.instants, samples.plant, samples.edges
        width = samples.channels.shape[1] * 4
        # As a variable: for a literal 0 numba would compile the functions a second time.
        none = np.int64(0)
        row = none
        handle = uint64(chip.handle)
        target = uint64(samples.address)
        for period in range(n):
            # The registers are the same until the fast interrupt writes them.
            count = pwm_segment(pm, regs, ps, none, tm.write_count, none)
            if gd.min_counts > 0:
                count = suppress_short_pulses(gd, pm, regs, ps, none, tm.write_count, none, count)
            if inv.coming.n > 0:
                count = push_breaks(inv.coming, ps, first + period, none, tm.write_count, count)
            k = follow(plant, vdc, ps, count, none, tm.sample_count,
                       tm, instants, none, plant_out, row)  # fmt: skip
            sample(plant.sensors, plant.machine, plant.y, link_V(inv.link, vdc), regs)
            fast_isr(handle)
            if (first + period) % tm.slow_every == 0:
                slow_isr(handle)
            if inv.link.precharge_ohm > 0.0:
                inv.link.bridged = high(inv.link.relay, regs)
            if inv.link.chopper.level > 0:
                inv.link.chops = high(inv.link.chopper, regs)
            if load.brake.torque_Nm > 0.0:
                told = high(load.brake.pin, regs)
                command_brake(inv, plant.machine, load, plant.y, told, tm.period / tm.clock_Hz)
            if width > 0:
                read_channels(handle, target)
                target += uint64(width)
            done = count
            count = pwm_segment(pm, regs, ps, tm.write_count, tm.period, done)
            if gd.min_counts > 0:
                count = suppress_short_pulses(
                    gd, pm, regs, ps, tm.write_count, tm.period, done, count
                )
            if inv.coming.n > 0:
                count = push_breaks(
                    inv.coming, ps, first + period, tm.write_count, tm.period, count
                )
            if edges.shape[0] > 0:
                logged = _log(edges, logged, ps, count, (first + period) * tm.period)
            row += follow(plant, vdc, ps, count, tm.sample_count, tm.period,
                          tm, instants, k, plant_out, row)  # fmt: skip
        return logged

    return run_periods


run_periods = _compile_run_periods(source_hash())

_NO_SAMPLES = np.empty((0, 0), np.float32)


def _compile_follow_log(source: int):
    """Make `follow_log`, which numba keeps on disk (`source_hash`)."""

    @compiled(cache=True, nogil=True)
    def follow_periods(edges, first, tm, plant, vdc, ps, instants, nothing, states):
        if not source:
            return
        none = np.int64(0)
        e = 0
        for period in range(states.shape[0]):
            start = (first + period) * tm.period
            c0 = none
            for c1 in (tm.sample_count, tm.period):
                n = 0
                while e < edges.shape[0] and edges[e, 0] < start + c1:
                    ps.count[n] = edges[e, 0] - start
                    ps.leg[n] = edges[e, 1]
                    ps.state[n] = edges[e, 2]
                    n += 1
                    e += 1
                follow(plant, vdc, ps, n, c0, c1, tm, instants, none, nothing, none)
                c0 = c1
            for r in range(8):
                states[period, r] = plant.y[r]

    return follow_periods


_follow_periods = _compile_follow_log(source_hash())


def follow_log(
    edges: np.ndarray, first: int, tm: Any, plant: Plant, vdc_V: float, pwm: Any, states: np.ndarray
) -> None:
    """The plant alone, along the edges that a run has logged from period `first` on: `run_periods`
    without a controller. The state at the end of each period goes into the rows of `states`."""
    _follow_periods(edges, first, tm, plant, vdc_V, pwm, NO_INSTANTS, _NO_SAMPLES, states)
