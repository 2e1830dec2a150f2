"""The compiled part of `losses`. A module of its own, because numba takes a third of a second to
load, and who only asks which figures there are does not need it."""

from __future__ import annotations

from numba import njit

from ..plant.legs import HIGH, LOW, OFF


@njit(cache=True)
def _mean_square(a, b):
    """The mean square along a straight line from a to b."""
    return (a * a + a * b + b * b) / 3


@njit(cache=True, nogil=True)
def walk(phases_A, state, edge_at, edge_leg, edge_to, switch_V, switch_ohm, diode_V, diode_ohm):
    """The three integrals, with time in samples. Between two knots, which are samples and edges,
    all currents are straight lines and the legs keep their states."""
    idc = 0.0
    idc2 = 0.0
    lost = 0.0
    e = 0
    for k in range(phases_A.shape[1] - 1):
        begin = 0.0
        while begin < 1.0:
            while e < edge_at.size and edge_at[e] <= k + begin:
                state[edge_leg[e]] = edge_to[e]
                e += 1
            end = 1.0
            if e < edge_at.size and edge_at[e] < k + 1:
                end = edge_at[e] - k
            length = end - begin
            a = 0.0
            b = 0.0
            for leg in range(6):
                i = phases_A[leg, k]
                rise = phases_A[leg, k + 1] - i
                i0 = i + begin * rise
                i1 = i + end * rise
                out = i0 + i1 > 0.0
                if state[leg] == HIGH or (state[leg] == OFF and not out):
                    a += i0
                    b += i1
                size = 0.5 * (abs(i0) + abs(i1))
                square = _mean_square(i0, i1)
                if (state[leg] == HIGH and out) or (state[leg] == LOW and not out):
                    lost += length * (switch_V * size + switch_ohm * square)
                else:
                    lost += length * (diode_V * size + diode_ohm * square)
            idc += length * 0.5 * (a + b)
            idc2 += length * _mean_square(a, b)
            begin = end
    return idc, idc2, lost
