"""Reference frames of the asymmetrical six-phase winding.

Phase order u1 u2 w1 w2 v1 v2 at 0, 30, 120, 150, 240, 270 electrical degrees;
amplitude-invariant vector space decomposition (paper B, eq. 1), so that
T T^t = I/3 and the inverse is 3 T^t.
"""

import numpy as np

PHASES = ("u1", "u2", "w1", "w2", "v1", "v2")
ANGLES_RAD = np.deg2rad([0.0, 30.0, 120.0, 150.0, 240.0, 270.0])

#: (4, 6): rows alpha, beta, x, y.
TRANSFORM = (
    np.array(
        [
            np.cos(ANGLES_RAD),
            np.sin(ANGLES_RAD),
            np.cos(5 * ANGLES_RAD),
            np.sin(5 * ANGLES_RAD),
        ]
    )
    / 3
)

#: (6, 4): phase quantities without zero sequence from alpha, beta, x, y.
INVERSE = 3 * TRANSFORM.T
