"""The constants of a six-phase induction machine, and values that follow from them.

This module imports nothing but Python's own modules. cmake/initial_values.py, which puts a
set-up's values into an image, uses it where the package is not installed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from .differing import L_XY, R_S, Differing


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
    iron_hysteresis_A_Wb: float = 0.0  #: iron loss over |psi_s|^2 p|w|; 0: none
    iron_eddy_S: float = 0.0  #: iron loss over (|psi_s| p w)^2; 0: none
    leads: tuple[int, ...] = (1, 2, 3, 4, 5, 6)  #: phase on each leg, 1 is u1
    displacement_deg: float = 30.0  #: of set 2 from set 1, electrical

    #: The firmware's kind of rotor, the parameter `machine`.
    ROTOR: ClassVar[str] = "induction"
    #: For a comparison with a bench: what may be wrong, and what the kind's own quantities tell.
    MAY_DIFFER: ClassVar[tuple[Differing, ...]] = (
        R_S,
        Differing("R_r", ("rr_ohm",), 0.2),
        Differing("L_m", ("lm_H",), 0.1),
        Differing("leakage", ("lls_H", "llr_H"), 0.2),
        L_XY,
    )
    #: For tuning: what the controller may be told wrong, its parameter, and by how many percent.
    TOLD_WRONG: ClassVar[tuple[tuple[str, str, int], ...]] = (
        ("R_s", "rs_ohm", 30), ("L_m", "lm_H", 30), ("σL_s", "sigma_ls_H", 30),
    )  # fmt: skip
    TELLS: ClassVar[dict[str, str]] = {
        "current amplitude": "load, L_m, flux, probes",
        "current along the flux": "L_m, flux error",
        "slip": "R_r",
        "R_r in use": "R_r",
        "current ripple": "leakage",
        "torque ripple": "leakage",
    }

    def known_start(self, _controller: Mapping[str, Any]) -> dict[str, Any]:
        """The controller's parameters with which a simulated start needs no shaft that moves: its
        flux is built at standstill anyway."""
        return {}

    def start_turned(self, _zero_deg: float, _by_deg: float) -> dict[str, float]:
        """Keys of a set-up with which the same drive starts at another angle of the shaft: it knows
        none."""
        return {}

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

    # -- steady state at a stator flux, by the circle diagram ---------------------------------

    def no_load_A(self, flux_Wb: float) -> float:
        """Amplitude of the magnetising current."""
        return flux_Wb / self.ls_H

    def pull_out_Nm(self, flux_Wb: float) -> float:
        """The top of the circle diagram."""
        return 1.5 * self.pole_pairs * flux_Wb**2 * (1 / self.sigma_ls_H - 1 / self.ls_H)

    def _radius_A(self, flux_Wb: float) -> float:
        return 0.5 * self.no_load_A(flux_Wb) * (1 / (self.sigma_ls_H / self.ls_H) - 1)

    def current_A(self, torque_Nm: float, flux_Wb: float) -> float:
        """Amplitude of the current at this torque. At pull-out and beyond it is the current at
        pull-out."""
        across = abs(torque_Nm) / (3 * self.pole_pairs * flux_Wb)
        radius = self._radius_A(flux_Wb)
        across = min(across, radius)
        along = self.no_load_A(flux_Wb) + radius - math.sqrt(radius**2 - across**2)
        return math.hypot(along, across)

    def torque_of_current_Nm(self, current_A: float, flux_Wb: float) -> float:
        """The torque at which the current has this amplitude; 0 if the current does not magnetise
        the machine. Never more than pull-out."""
        radius, no_load_A = self._radius_A(flux_Wb), self.no_load_A(flux_Wb)
        if current_A <= no_load_A:
            return 0.0
        # |i|^2 = along^2 + across^2 and the circle: along follows from |i|.
        centre = no_load_A + radius
        along = (current_A**2 + centre**2 - radius**2) / (2 * centre)
        if along >= centre:
            return self.pull_out_Nm(flux_Wb)
        return 3 * self.pole_pairs * flux_Wb * math.sqrt(current_A**2 - along**2)

    def slip_rad_s(self, torque_Nm: float, flux_Wb: float) -> float:
        """Electrical slip at a torque. The rotor flux is taken as 90 % of the stator's."""
        rotor_Wb = 0.9 * flux_Wb
        return abs(torque_Nm) * self.rr_ohm / (3 * self.pole_pairs * rotor_Wb**2)

    def torque_step_Nm(self, flux_Wb: float, step_Wb: float) -> float:
        """How far a step of the stator flux moves the torque at standstill: the rotor flux does not
        follow, so all of it drives current through sigma L_s."""
        step_A = step_Wb / self.sigma_ls_H
        sigma = self.sigma_ls_H / self.ls_H
        return 3 * self.pole_pairs * (1 - sigma) * flux_Wb * step_A

    def turned_rad_s(self, torque_Nm: float, flux_Wb: float, voltage_V: float) -> float:
        """Electrical speed of the shaft at which this torque at this flux needs so much voltage."""
        room_V = voltage_V - self.rs_ohm * self.current_A(torque_Nm, flux_Wb)
        return room_V / flux_Wb - self.slip_rad_s(torque_Nm, flux_Wb)

    def most_torque_Nm(
        self, omega_rad_s: float, flux_Wb: float, voltage_V: float, _most_A: float, share: float
    ) -> float:
        """The torque at which the firmware limits its reference at this electrical speed if the
        flux is weakened to what this voltage turns. At this share p of the pull-out torque the slip
        is s of that at pull-out, with p = 2 s/(1 + s^2), and the point on the circle diagram has
        the height p and the abscissa 1 - sqrt(1 - p^2), in radii."""
        sigma, p = self.sigma_ls_H / self.ls_H, share
        s = (1 - math.sqrt(1 - p * p)) / p
        radius = 0.5 / self.ls_H * (1 / sigma - 1)
        current = math.hypot(p * radius, 1 / self.ls_H + (1 - math.sqrt(1 - p * p)) * radius)
        turning = omega_rad_s + s / (sigma * self.lr_H / self.rr_ohm)
        weak_Wb = min(flux_Wb, voltage_V / (turning + self.rs_ohm * current))
        return p * self.pull_out_Nm(flux_Wb) * (weak_Wb / flux_Wb) ** 2

    @property
    def least_H(self) -> float:
        """Smallest inductance that a voltage step meets in alpha-beta."""
        return self.sigma_ls_H

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
