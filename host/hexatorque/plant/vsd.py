"""Reference frames of the six-phase winding.

Phase order u1 u2 w1 w2 v1 v2. Set 1 (u1, w1, v1) lies at 0, 120, 240 electrical degrees, set 2 is
displaced from it: by 30 degrees in the asymmetrical machine of both papers, by 0 where both sets
share their axes, by 60 in the symmetrical machine. Amplitude-invariant vector space decomposition:
with the space vectors s1, s2 of the sets in the stator's axes,

    alpha + j beta = (s1 + s2)/2,    x - j y = (s1 - s2)/2,

so that T T^t = I/3 and the inverse is 3 T^t for any displacement. For 30 degrees this is paper B's
eq. 1.
"""

from __future__ import annotations

import math

import numpy as np

from . import elementary

PHASES = ("u1", "u2", "w1", "w2", "v1", "v2")
#: Phases of each winding set, which its own neutral joins.
SETS = ((0, 2, 4), (1, 3, 5))


#: exp(j angle) of one angle, without the compiler: for what is made once. NUMBA_DISABLE_JIT leaves
#: the plain function.
exp_j = getattr(elementary.turned, "py_func", elementary.turned)


def angles_rad(displacement_deg: float = 30.0) -> np.ndarray:
    """(6,): where the phases lie, electrical."""
    return np.deg2rad([0.0, 0.0, 120.0, 120.0, 240.0, 240.0] + displacement_deg * _SET2)


#: 1 for the phases of set 2.
_SET2 = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])


def transform(displacement_deg: float = 30.0) -> np.ndarray:
    """(4, 6): rows alpha, beta, x, y."""
    angles = angles_rad(displacement_deg)
    # conj(s1 - s2). At 30 degrees these are five times the phases' angles, as both papers have it.
    turned = 5 * angles if displacement_deg == 30 else np.pi * _SET2 - angles
    rows = [[exp_j(angle) for angle in each] for each in (angles, turned)]
    return np.array([part for row in rows for part in (np.real(row), np.imag(row))]) / 3


#: The asymmetrical winding's.
ANGLES_RAD = angles_rad()
TRANSFORM = transform()


def harmonics_in_xy(displacement_deg: float) -> bool:
    """Whether the fifth and the seventh harmonic of the phases are in x-y, else in alpha-beta."""
    return math.cos(6 * math.radians(displacement_deg)) < 0


def inverse(displacement_deg: float = 30.0) -> np.ndarray:
    """(6, 4): phase quantities without zero sequence from alpha, beta, x, y."""
    return 3 * transform(displacement_deg).T


INVERSE = inverse()
