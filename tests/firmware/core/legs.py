"""A leg of the inverter, followed edge by edge in double precision."""

import itertools

import numpy as np


def follow_leg(commands, dead, outward, end):
    """The exact intervals in which a leg is high. `commands` = [(time, level), ...] are in order,
    and all legs are low before. While both switches are off, the current decides: a current that
    flows out holds the leg low, a current that flows in holds it high."""
    edges, level, pending = [], 0, None
    for time, command in [*commands, (np.inf, None)]:
        if pending is not None and pending <= time:
            level = 1 - level
            edges.append((pending, level))
            pending = None
        if command is None:
            break
        if pending is not None and command == level:
            pending = None  # switched back before the delay was over
        elif pending is None and command != level:
            late = dead if bool(command) == outward else 0.0
            pending = time + late
            if late == 0.0:
                level, pending = command, None
                edges.append((time, level))
    on = np.zeros(end)
    for n in range(end):
        knots = [(-1.0, 0), *edges, (np.inf, None)]
        for (a, state), (b, _) in itertools.pairwise(knots):
            if state:
                on[n] += max(0.0, min(b, n + 1) - max(a, n))
    return on
