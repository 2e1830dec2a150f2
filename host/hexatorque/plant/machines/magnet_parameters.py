"""The constants of a six-phase machine with permanent magnets, and values that follow from them.

This module imports nothing but Python's own modules, as `induction_parameters` does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

#: Orders of the harmonics that the magnets' flux may have besides the fundamental.
ORDERS = (5, 7, 11, 13)


@dataclass(frozen=True)
class Parameters:
    """Machine constants. The d axis is the magnets' north pole."""

    pole_pairs: int
    rs_ohm: float
    ld_H: float
    lq_H: float
    lxy_H: float
    psi_f_Wb: float  #: flux linkage of the magnets in alpha-beta, amplitude
    inertia_kgm2: float
    viscous_Nms: float = 0.0
    drs_ohm: tuple[float, ...] = field(default=(0.0,) * 6)  #: added per phase
    #: Of the voltage that the magnets induce: amplitude over the fundamental's, and phase, for each
    #: of ORDERS.
    emf_share: tuple[float, ...] = field(default=(0.0,) * 4)
    emf_deg: tuple[float, ...] = field(default=(0.0,) * 4)
    cogging_Nm: float = 0.0  #: amplitude of the cogging torque
    cogging_per_rev: int = 36  #: its periods in a revolution
    start_deg: float = 0.0  #: electrical angle of the d axis at the beginning
    leads: tuple[int, ...] = (1, 2, 3, 4, 5, 6)  #: phase on each leg, 1 is u1
    displacement_deg: float = 30.0  #: of set 2 from set 1, electrical

    @property
    def phase_of_leg(self) -> list[int]:
        """Index of the phase on each leg."""
        return [phase - 1 for phase in self.leads]

    @property
    def most_emf(self) -> float:
        """Largest voltage between two terminals of a set over that of the fundamental alone: no
        harmonic of ORDERS vanishes there, and their peaks may coincide."""
        return 1 + sum(abs(share) for share in self.emf_share)

    def torque_Nm(self, id_A: float, iq_A: float) -> float:
        return 3 * self.pole_pairs * (self.psi_f_Wb + (self.ld_H - self.lq_H) * id_A) * iq_A

    def least_current(self, torque_Nm: float) -> tuple[float, float]:
        """(i_d, i_q) with this torque and the least current: i_d = h - sqrt(h^2 + i_q^2) with
        h = psi_f / 2(L_q - L_d), and i_q by iteration."""
        saliency_H = self.lq_H - self.ld_H
        iq_A = torque_Nm / (3 * self.pole_pairs * self.psi_f_Wb)
        id_A = 0.0
        if abs(saliency_H) < 1e-6 * self.lq_H:
            return 0.0, iq_A
        h = self.psi_f_Wb / (2 * saliency_H)
        for _ in range(100):
            id_A = h - math.copysign(math.hypot(h, iq_A), h)
            wanted = torque_Nm / (3 * self.pole_pairs * (self.psi_f_Wb - saliency_H * id_A))
            iq_A += 0.7 * (wanted - iq_A)
        return id_A, iq_A

    def flux_Wb(self, id_A: float, iq_A: float) -> float:
        """Length of the stator flux."""
        return math.hypot(self.psi_f_Wb + self.ld_H * id_A, self.lq_H * iq_A)
