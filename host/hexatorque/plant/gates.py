"""Gate drivers that suppress short pulses.

Each switch has its own driver, which comes after the dead band. A driver cannot know in advance
that a pulse will be short, so it waits: its output follows the input when that has kept its new
level for the minimum pulse. Shorter pulses, on or off, disappear. All other edges are delayed by
the minimum pulse, so the time between them is unchanged. A trip acts on the drivers' enable
input and takes effect at once.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled
from .legs import HIGH, LOW, OFF
from .pwm import MAX_EDGES, NONE, push_edge
from .record import names_of, record

#: Switches of a leg: the lower and the upper one, by the leg state that turns them on.
GATES = np.dtype(
    [
        ("min_counts", "i8"),  # 0: no suppression, nobody calls
        ("command", "i8", (6,)),  # leg state that the PWM commands
        ("on", "i8", (6, 2)),  # outputs of the drivers: LOW, HIGH
        ("due", "i8", (6, 2)),  # count at which the output follows the input, or NONE
        ("count", "i8", (MAX_EDGES,)),  # counts of a segment's edges at the inputs
        ("leg", "i8", (MAX_EDGES,)),
        ("state", "i8", (MAX_EDGES,)),
    ]
)


def gates_record(min_counts: int) -> np.record:
    """All switches off."""
    zeros = {name: 0 for name in names_of(GATES)}
    start = {"min_counts": min_counts, "command": OFF, "due": NONE}
    return record(GATES, **{**zeros, **start})


@compiled
def _command(gd, leg, state, count):
    """A new leg state at the drivers' inputs."""
    gd.command[leg] = state
    for switch in (LOW, HIGH):
        if (state == switch) == (gd.on[leg, switch] == 1):
            gd.due[leg, switch] = NONE
        elif gd.due[leg, switch] == NONE:
            gd.due[leg, switch] = count + gd.min_counts


@compiled
def suppress_short_pulses(gd, pm, regs, ps, c0, c1, first, n):
    """Pass the edges ps[first:n] of counts c0 <= count < c1 through the drivers.

    Returns the new n. Edges that are due later stay in the drivers; at the period's end
    they move to the next period.
    """
    if c0 == c1:
        return n
    edges = n - first
    for e in range(edges):
        gd.count[e] = ps.count[first + e]
        gd.leg[e] = ps.leg[first + e]
        gd.state[e] = ps.state[first + e]
    n = first
    for leg in range(6):
        base = pm.epwm + leg * pm.stride
        if (regs[base + pm.tzflg] & 4) != 0:
            if gd.on[leg, LOW] + gd.on[leg, HIGH] > 0:
                n = push_edge(ps, n, c0, leg, OFF)
            gd.on[leg] = 0
            gd.due[leg] = NONE
            gd.command[leg] = OFF
            continue
        e = 0
        while True:
            while e < edges and gd.leg[e] != leg:
                e += 1
            # Which comes first: the next edge at an input, or a change of an output that is due?
            due = c1
            for switch in (LOW, HIGH):
                if gd.due[leg, switch] != NONE and gd.due[leg, switch] < due:
                    due = gd.due[leg, switch]
            if due < c1 and (e == edges or due <= gd.count[e]):
                for switch in (LOW, HIGH):
                    if gd.due[leg, switch] == due:
                        gd.on[leg, switch] = 1 - gd.on[leg, switch]
                        gd.due[leg, switch] = NONE
                state = HIGH if gd.on[leg, HIGH] == 1 else (LOW if gd.on[leg, LOW] == 1 else OFF)
                n = push_edge(ps, n, due, leg, state)
            elif e < edges:
                _command(gd, leg, gd.state[e], gd.count[e])
                e += 1
            else:
                break
        if c1 == np.int64(regs[base + pm.tbprd]) + 1:
            for switch in (LOW, HIGH):
                if gd.due[leg, switch] != NONE:
                    gd.due[leg, switch] -= c1
    return n
