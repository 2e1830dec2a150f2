"""The iron's loss of a machine of any kind, and the torque that it costs.

The loss, if it is given, is (k_h p|w| + k_e (p w)^2)|psi_s|^2: hysteresis grows with the frequency
and eddy currents with its square (Bertotti, IEEE Trans. Magn. 24(1), 1988). The frequency is that
of the rotor's turning: with magnets the flux's, in an induction machine less than it by the slip.
The shaft pays for the loss with a torque. So currents remain functions of the fluxes alone, and the
drive sees the loss as the torque that it costs.
"""

from __future__ import annotations

from typing import Any

from .compiled import compiled
from .elementary import tanh

FIELDS = [
    ("iron", "i8"),  # 0: no iron losses
    ("hysteresis", "f8"),  # p k_h, N m/Wb^2
    ("eddy", "f8"),  # p^2 k_e, N m s/Wb^2
]

#: Speed over which the torque of the hysteresis changes sign, rad/s.
IRON_RAD_S = 0.5


def values(p: Any) -> dict[str, float]:
    """The fields of a machine with these constants."""
    return {
        "iron": int(p.iron_hysteresis_A_Wb > 0 or p.iron_eddy_S > 0),
        "hysteresis": p.pole_pairs * p.iron_hysteresis_A_Wb,
        "eddy": p.pole_pairs**2 * p.iron_eddy_S,
    }


@compiled
def iron_torque(m, y, omega):
    """The torque lost to the iron's loss, N m, at the state's flux and this speed of the shaft,
    rad/s."""
    per_Wb2 = m.hysteresis * tanh(omega / IRON_RAD_S) + m.eddy * omega
    return per_Wb2 * (y[0] * y[0] + y[1] * y[1])
