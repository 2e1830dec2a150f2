"""Help for a law's step: what it returns, from a voltage or from state words. Steps that are
compiled may call these."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..plant.vsd import TRANSFORM

_LEVELS = np.array([[word >> (5 - leg) & 1 for leg in range(6)] for word in range(64)], float)
#: (64, 2) voltage of every state word, in units of V_dc: alpha + j beta and x + j y.
VECTORS = np.stack([_LEVELS @ (TRANSFORM[row] + 1j * TRANSFORM[row + 1]) for row in (0, 2)], axis=1)

COS_30 = math.sqrt(3) / 2


@njit
def _set_of(p, q):
    """Commands of a set's legs p, q - p/2, -q - p/2, midway between the rails, and their range."""
    second, third = q - p / 2, -q - p / 2
    most, least = max(p, second, third), min(p, second, third)
    zero = 0.5 - (most + least) / 2
    return p + zero, second + zero, third + zero, most - least


@njit
def _range(v, v_xy):
    one = _set_of(v.real + v_xy.real, COS_30 * (v.imag - v_xy.imag))[3]
    two = _set_of(-(v.imag + v_xy.imag), COS_30 * (v.real - v_xy.real))[3]
    return max(one, two)


@njit
def _limited(duty):
    return min(max(duty, 0.0), 1.0)


@njit
def centred(v, v_xy=0j):
    """Six duty ratios for a voltage v = alpha + j beta, v_xy = x + j y, in units of V_dc: double
    zero-sequence injection, the legs of each set midway between the rails. Where they do not fit,
    x-y gives way first, then the legs are limited."""
    if _range(v, v_xy) > 1.0:
        without = _range(v, 0j)
        share = 0.0
        if without < 1.0:
            share = (1.0 - without) / (_range(v, v_xy) - without)
        v_xy = share * v_xy
    u1, w1, v1, _ = _set_of(v.real + v_xy.real, COS_30 * (v.imag - v_xy.imag))
    v2, u2, w2, _ = _set_of(-(v.imag + v_xy.imag), COS_30 * (v.real - v_xy.real))
    return (
        _limited(u1), _limited(u2), _limited(w1), _limited(w2), _limited(v1), _limited(v2)
    )  # fmt: skip


@njit
def transitions(before, after):
    """Legs that differ between two state words."""
    moves = before ^ after
    count = 0
    for leg in range(6):
        count += moves >> leg & 1
    return count


@njit
def vector(word):
    """One state word over the whole period."""
    return (float(word), float(word), float(word), 1.0, 1.0)


@njit
def vectors(s0, s1, s2, t1, t2):
    """Three state words: s1 from t1 on, s2 from t2 on, per unit of the period."""
    return (float(s0), float(s1), float(s2), float(t1), float(t2))
