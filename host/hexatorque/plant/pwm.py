"""Emulated ePWM modules of both devices, up-count, one module per leg.

Works on the register file that the firmware's driver writes. Time is counted in
time-base counts; a period is counts 0..TBPRD. Between two register writes the
registers are constant, so a period is emulated in segments: everything written
by the interrupt at count c takes effect in the segment that starts at c.

Modelled: shadow load of CMPA/CMPB (zero, period, both) and of AQCTLA (type 4),
immediate load, action qualifier of output A for ZERO, CAU, CBU, PERIOD and
one-shot software force with the hardware's priority (force > PRD > CBU > CAU >
ZERO), complementary dead band with the polarity of both outputs, one-shot trip with the
levels that it forces. The gate drivers decide which level switches on (`active_low`). If both
switches of a leg are on, this is counted as a short, and the leg is taken as off. A switch that
is on for less than the board's shortest gate pulse (`min_pulse`) is counted too, unless a trip
ended the pulse.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled
from .legs import HIGH, LOW, MAX_BREAKS, OFF
from .record import names_of, record

NONE = -1
#: Counts of a pulse that no pulse is as long as.
NEVER = np.iinfo(np.int64).max


#: Register layout of a device (word offsets; -1 = not present).
PWM_MAP = np.dtype(
    [
        (name, "i8")
        for name in (
            "epwm", "stride", "tbprd", "cmpctl", "cmpa", "cmpb", "aqctl", "aqctla", "aqsfrc",
            "dbctl", "dbred", "dbfed", "tzctl", "tzflg",
            # Not registers: 1 where a low pin switches on; the shortest gate pulse, counts.
            "active_low", "min_pulse",
        )
    ]
)  # fmt: skip

#: At most 5 output edges per leg and segment, each an off and an on; two segments
#: share the list. Breaks of legs are added to it.
MAX_EDGES = 6 * 20 + MAX_BREAKS

#: The modules' state that is not in the register file, and the edges of a period.
PWM = np.dtype(
    [
        ("cmpa", "i8", (6,)),  # active compare A
        ("cmpb", "i8", (6,)),  # active compare B
        ("aq", "i8", (6,)),  # active action qualifier
        ("out", "i8", (6,)),  # output A before the dead band
        ("band", "i8", (6,)),  # leg state after the dead band
        ("pending", "i8", (6,)),  # count at which the delayed switch turns on
        ("gate", "i8", (6,)),  # leg state after the trip zone
        ("shorts", "i8", (6,)),  # times that both switches were on
        ("on_at", "i8", (6,)),  # count at which the switch that is on was told so
        ("shortest", "i8", (6,)),  # gate pulse that no trip ended, counts
        ("short_pulses", "i8", (6,)),  # gate pulses below the board's shortest
        ("transitions", "i8", (6,)),  # level changes of output A while not tripped
        ("count", "i8", (MAX_EDGES,)),  # edges: ascending counts,
        ("leg", "i8", (MAX_EDGES,)),  # leg,
        ("state", "i8", (MAX_EDGES,)),  # new state
    ]
)


def pwm_record() -> np.record:
    """Outputs low, tripped."""
    zeros = {name: 0 for name in names_of(PWM)}
    start = {
        "cmpa": 65535, "cmpb": 65535, "band": LOW, "pending": NONE, "gate": OFF, "shortest": NEVER,
    }  # fmt: skip
    return record(PWM, **{**zeros, **start})


@compiled(inline="always")
def _loads(mode, zero):
    """Whether a shadow register with LOADxMODE `mode` loads at zero (`zero`) or at period."""
    if zero:
        return mode == 0 or mode == 2
    return mode == 1 or mode == 2


@compiled(forceinline=True)
def _leg_of_pins(ps, leg, a, b, active_low):
    """The leg state that follows from the levels of both pins."""
    upper = a != active_low
    lower = b != active_low
    if upper and lower:
        ps.shorts[leg] += 1
    if upper == lower:
        return np.int64(OFF)
    return np.int64(HIGH) if upper else np.int64(LOW)


@compiled(forceinline=True)
def _leg_of_band(ps, leg, band, dbctl, active_low):
    """The leg state that follows from the dead band's state. A is the delayed rise and B the
    delayed fall. POLSEL can invert either."""
    a = np.int64(band == HIGH) ^ (dbctl >> 2 & 1)
    b = np.int64(band != LOW) ^ (dbctl >> 3 & 1)
    return _leg_of_pins(ps, leg, a, b, active_low)


@compiled(inline="always")
def _forced(action, active_low):
    """Level of a pin in a trip: 1 high, 2 low. With any other action a resistor switches off."""
    if action == 1:
        return np.int64(1)
    return np.int64(0) if action == 2 else np.int64(active_low)


@compiled(forceinline=True)
def _word(regs, at):
    """A register. An unsigned index saves the test for a negative one."""
    return np.int64(regs[np.uint64(at)])


@compiled(forceinline=True)
def push_edge(ps, n, count, leg, state):
    """Insert in order of count; equal counts keep their order."""
    p = n
    while p > 0 and ps.count[p - 1] > count:
        ps.count[p] = ps.count[p - 1]
        ps.leg[p] = ps.leg[p - 1]
        ps.state[p] = ps.state[p - 1]
        p -= 1
    ps.count[p] = count
    ps.leg[p] = leg
    ps.state[p] = state
    return n + 1


@compiled(forceinline=True)
def _switch(pm, ps, n, count, leg, state, tripped):
    """A leg takes on a state. Returns the new number of edges."""
    pulse = count - ps.on_at[leg]
    if ps.gate[leg] != OFF and pulse > 0 and not tripped:
        ps.shortest[leg] = min(ps.shortest[leg], pulse)
        if pulse < pm.min_pulse:
            ps.short_pulses[leg] += 1
    ps.gate[leg] = state
    ps.on_at[leg] = count
    return push_edge(ps, n, count, leg, state)


@compiled
def pwm_segment(pm, regs, ps, c0, c1, n):
    """Emulate counts c0 <= count < c1 of one period.

    Appends to the n edges already there (all at lower counts) and returns the
    new number. `regs` is the low part of the register file (uint16). At c1 = TBPRD + 1 the
    pending delays and the instants of the pulses are moved to the next period.
    """
    if c0 == c1:
        return n  # an empty segment takes over no registers
    for leg in range(6):
        base = pm.epwm + leg * pm.stride
        prd = _word(regs, base + pm.tbprd)
        cmpctl = _word(regs, base + pm.cmpctl)
        aqctl = _word(regs, base + pm.aqctl) if pm.aqctl >= 0 else np.int64(0)
        load_a = load_b = load_aq = False
        if cmpctl == 0:  # the usual mode, tested first because it saves time: both load at zero
            if c0 == 0:
                ps.cmpa[leg] = _word(regs, base + pm.cmpa)
                ps.cmpb[leg] = _word(regs, base + pm.cmpb)
        else:
            immediate_a = (cmpctl & 0x10) != 0
            immediate_b = (cmpctl & 0x40) != 0
            if immediate_a or (c0 == 0 and _loads(cmpctl & 3, True)):
                ps.cmpa[leg] = _word(regs, base + pm.cmpa)
            if immediate_b or (c0 == 0 and _loads((cmpctl >> 2) & 3, True)):
                ps.cmpb[leg] = _word(regs, base + pm.cmpb)
            load_a = _loads(cmpctl & 3, False) and not immediate_a
            load_b = _loads((cmpctl >> 2) & 3, False) and not immediate_b
        if (aqctl & 0x10) == 0:
            ps.aq[leg] = _word(regs, base + pm.aqctla)
        else:
            if c0 == 0 and _loads(aqctl & 3, True):
                ps.aq[leg] = _word(regs, base + pm.aqctla)
            load_aq = _loads(aqctl & 3, False)
        loads = load_a or load_b or load_aq
        tripped = (_word(regs, base + pm.tzflg) & 4) != 0
        dbctl = _word(regs, base + pm.dbctl)
        low = pm.active_low
        if tripped:
            tzctl = _word(regs, base + pm.tzctl)
            gate = _leg_of_pins(ps, leg, _forced(tzctl & 3, low), _forced(tzctl >> 2 & 3, low), low)
        else:
            gate = _leg_of_band(ps, leg, ps.band[leg], dbctl, low)
        if gate != ps.gate[leg]:
            n = _switch(pm, ps, n, c0, leg, gate, tripped)

        force = _word(regs, base + pm.aqsfrc)
        forced = np.int64(0)
        if (force & 4) != 0:
            forced = force & 3
            regs[base + pm.aqsfrc] = np.uint16(force & ~4)

        pos = c0
        while pos < c1:
            # Next count at which anything happens. Most legs have none in most segments: compare
            # registers beyond the period, or an event without an action, are no reason to stop.
            aq = ps.aq[leg]
            cmpa = ps.cmpa[leg]
            cmpb = ps.cmpb[leg]
            at = c1
            if pos == c0 and ((pos == 0 and (aq & 3) != 0) or forced != 0):
                at = pos
            if pos <= cmpa and cmpa < at and cmpa <= prd and ((aq >> 4) & 3) != 0:
                at = cmpa
            if pos <= cmpb and cmpb < at and cmpb <= prd and ((aq >> 8) & 3) != 0:
                at = cmpb
            if pos <= prd and prd < at and (loads or ((aq >> 2) & 3) != 0):
                at = prd
            if at >= c1:
                break
            action = np.int64(0)
            if at == 0:
                action = aq & 3
            if at == cmpa and at <= prd and ((aq >> 4) & 3) != 0:
                action = (aq >> 4) & 3
            if at == cmpb and at <= prd and ((aq >> 8) & 3) != 0:
                action = (aq >> 8) & 3
            if at == prd and ((aq >> 2) & 3) != 0:
                action = (aq >> 2) & 3
            if at == c0 and forced != 0:
                action = forced
                forced = np.int64(0)
            level = ps.out[leg]
            if action == 1:
                level = np.int64(0)
            elif action == 2:
                level = np.int64(1)
            elif action == 3:
                level = np.int64(1 - level)
            if level != ps.out[leg]:
                ps.out[leg] = level
                if not tripped:
                    ps.transitions[leg] += 1
                # The delayed switch of the previous edge may have turned on.
                if ps.pending[leg] != NONE and ps.pending[leg] <= at:
                    ps.band[leg] = np.int64(1 - level)
                    if not tripped and ps.pending[leg] < at:
                        gate = _leg_of_band(ps, leg, ps.band[leg], dbctl, low)
                        n = _switch(pm, ps, n, ps.pending[leg], leg, gate, tripped)
                delay = _word(regs, base + (pm.dbred if level == 1 else pm.dbfed))
                if delay == 0:
                    ps.band[leg] = level
                    ps.pending[leg] = NONE
                else:
                    ps.band[leg] = np.int64(OFF)
                    ps.pending[leg] = at + delay
                gate = _leg_of_band(ps, leg, ps.band[leg], dbctl, low)
                if not tripped and gate != ps.gate[leg]:
                    n = _switch(pm, ps, n, at, leg, gate, tripped)
            if at == prd:
                if load_a:
                    ps.cmpa[leg] = _word(regs, base + pm.cmpa)
                if load_b:
                    ps.cmpb[leg] = _word(regs, base + pm.cmpb)
                if load_aq:
                    ps.aq[leg] = _word(regs, base + pm.aqctla)
            pos = at + 1

        if ps.pending[leg] != NONE and ps.pending[leg] < c1:
            ps.band[leg] = np.int64(HIGH) if ps.out[leg] == 1 else np.int64(LOW)
            if not tripped:
                gate = _leg_of_band(ps, leg, ps.band[leg], dbctl, low)
                n = _switch(pm, ps, n, ps.pending[leg], leg, gate, tripped)
            ps.pending[leg] = NONE
        if c1 == prd + 1:
            ps.on_at[leg] -= c1
            if ps.pending[leg] != NONE:
                ps.pending[leg] -= c1
    return n
