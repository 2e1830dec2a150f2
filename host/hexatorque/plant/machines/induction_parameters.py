"""The constants of a six-phase induction machine, and values that follow from them.

This module imports nothing but Python's own modules. cmake/initial_values.py, which puts a
set-up's values into an image, uses it where the package is not installed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class Parameters:
    """Machine constants. Leakages are per phase of the equivalent circuit."""

    pole_pairs: int
    rs_ohm: float
    rr_ohm: float
    lls_H: float
    llr_H: float
    lm_H: float
    lxy_H: float
    inertia_kgm2: float
    viscous_Nms: float = 0.0
    drs_ohm: tuple[float, ...] = field(default=(0.0,) * 6)  #: added per phase
    dlls_H: tuple[float, ...] = field(default=(0.0,) * 6)  #: added per phase
    psi_knee_Wb: float = 0.0  #: main flux that takes twice the linear current; 0 = linear
    saturation_exponent: float = 6.0
    leads: tuple[int, ...] = (1, 2, 3, 4, 5, 6)  #: phase on each leg, 1 is u1
    displacement_deg: float = 30.0  #: of set 2 from set 1, electrical

    @property
    def phase_of_leg(self) -> list[int]:
        """Index of the phase on each leg."""
        return [phase - 1 for phase in self.leads]

    @property
    def ls_H(self) -> float:
        return self.lls_H + self.lm_H

    @property
    def lr_H(self) -> float:
        return self.llr_H + self.lm_H

    @property
    def sigma_ls_H(self) -> float:
        """Stator transient inductance sigma L_s."""
        return self.ls_H - self.lm_H**2 / self.lr_H

    def linear_at(self, psi_s_Wb: float) -> Parameters:
        """The linear machine that a no-load test at this stator flux would measure. Its L_m is the
        secant of the magnetising curve at that flux."""
        if self.psi_knee_Wb == 0:
            return self
        low, high = 0.0, psi_s_Wb  # the main flux, by bisection
        for _ in range(60):
            psi_m = 0.5 * (low + high)
            lm_H = self.lm_H / (1 + (psi_m / self.psi_knee_Wb) ** self.saturation_exponent)
            too_much = psi_m * (1 + self.lls_H / lm_H) > psi_s_Wb
            low, high = (low, psi_m) if too_much else (psi_m, high)
        return replace(self, lm_H=lm_H, psi_knee_Wb=0.0)
