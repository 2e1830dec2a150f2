"""A leg of the inverter, followed edge by edge in double precision; which legs stay on a rail."""

import itertools

import numpy as np

THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
SETS = (slice(0, 6, 2), slice(1, 6, 2))
TAU = (np.arange(2000) + 0.5) / 2000 - 0.5


def xy_ripple(v, rails, opposite):
    """Mean square of the x-y ripple volt-seconds over a carrier period. rails: of each set, the one
    that a leg stays on; opposite: set 2's pulses lie at the ends of the period."""
    u = 3 * T.T @ v
    ripple = []
    for leg in range(6):
        one = u[SETS[leg % 2]]
        high = u[leg] + (1 - one.max() if rails[leg % 2] else -one.min())
        at_ends = leg % 2 == 1 and opposite
        state = np.abs(TAU) > 0.5 - high / 2 if at_ends else np.abs(TAU) < high / 2
        volt_seconds = np.cumsum(state - high)
        ripple.append(volt_seconds - volt_seconds.mean())
    return np.mean((T[2:] @ ripple) ** 2)


def least_xy_rails(v, opposite):
    """The rails of `xy_ripple` with the least of it."""
    return min(itertools.product((False, True), repeat=2), key=lambda r: xy_ripple(v, r, opposite))


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
