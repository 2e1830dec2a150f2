"""The constants of a six-phase machine with permanent magnets, and values that follow from them.

This module imports nothing but Python's own modules, as `induction_parameters` does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from .differing import L_XY, R_S, Differing

#: Orders of the harmonics that the magnets' flux may have besides the fundamental.
ORDERS = (5, 7, 11, 13)
#: A shaft that is held needs no longer to be aligned.
HELD_S = 0.1


def _within_a_turn(deg: float) -> float:
    return (deg + 180.0) % 360.0 - 180.0


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
    iron_hysteresis_A_Wb: float = 0.0  #: iron loss over |psi_s|^2 p|w|; 0: none
    iron_eddy_S: float = 0.0  #: iron loss over (|psi_s| p w)^2; 0: none
    drs_ohm: tuple[float, ...] = field(default=(0.0,) * 6)  #: added per phase
    #: Of the voltage that the magnets induce: amplitude over the fundamental's, and phase, for each
    #: of ORDERS.
    emf_share: tuple[float, ...] = field(default=(0.0,) * 4)
    emf_deg: tuple[float, ...] = field(default=(0.0,) * 4)
    cogging_Nm: float = 0.0  #: amplitude of the cogging torque
    cogging_per_rev: int = 36  #: its periods in a revolution
    start_deg: float = 0.0  #: electrical angle of the d axis at the beginning
    #: Flux linkages against currents, of the plant alone: its FluxMap, or where nothing simulates
    #: the name of their file. "": L_d, L_q and psi_f are constant.
    flux_map: Any = ""
    leads: tuple[int, ...] = (1, 2, 3, 4, 5, 6)  #: phase on each leg, 1 is u1
    displacement_deg: float = 30.0  #: of set 2 from set 1, electrical

    #: The firmware's kind of rotor, the parameter `machine`.
    ROTOR: ClassVar[str] = "magnet"
    #: For a comparison with a bench: what may be wrong, and what the kind's own quantities tell.
    MAY_DIFFER: ClassVar[tuple[Differing, ...]] = (
        R_S,
        Differing("psi_f", ("psi_f_Wb",), 0.1),
        Differing("L_d", ("ld_H",), 0.2),
        Differing("L_q", ("lq_H",), 0.2),
        L_XY,
        Differing("encoder's angle", ("start_deg",), 5.0, -60.0, 60.0, "deg"),
        *(
            Differing(f"EMF harmonic {order}", ("emf_share",), 0.02, -0.3, 0.3, "", place)
            for place, order in enumerate(ORDERS[:2])
        ),
    )
    #: For tuning. The magnets' flux is known better.
    TOLD_WRONG: ClassVar[tuple[tuple[str, str, int], ...]] = (
        ("R_s", "rs_ohm", 30), ("ψ_f", "psi_f_Wb", 10), ("L", "sigma_ls_H", 30),
    )  # fmt: skip
    TELLS: ClassVar[dict[str, str]] = {
        "current amplitude": "load, psi_f, probes",
        "current along the flux": "psi_f, L_q, encoder's angle",
        "psi_f in use": "psi_f",
        "current ripple": "L_d, L_q",
        "torque ripple": "L_q",
    }

    def known_start(self, controller: Mapping[str, Any]) -> dict[str, Any]:
        """The controller's parameters with which a simulated start needs no shaft that moves: the
        drive knows the angle that it would find by alignment or an index."""
        if controller.get("rotor_start") == "known":
            return {}
        return {"rotor_start": "known", "rotor_zero_deg": self.start_deg, "build_s": HELD_S}

    def start_turned(self, zero_deg: float, by_deg: float) -> dict[str, float]:
        """Keys of a set-up with which the same drive starts at another angle of the shaft. The
        drive believes in zero_deg."""
        return {
            "machine.start_deg": _within_a_turn(self.start_deg + by_deg),
            "controller.rotor_zero_deg": _within_a_turn(zero_deg + by_deg),
        }

    @property
    def phase_of_leg(self) -> list[int]:
        """Index of the phase on each leg."""
        return [phase - 1 for phase in self.leads]

    @property
    def most_emf(self) -> float:
        """Largest voltage between two terminals of a set over that of the fundamental alone: no
        harmonic of ORDERS vanishes there, and their peaks may coincide."""
        return 1 + sum(abs(share) for share in self.emf_share)

    @property
    def sigma_ls_H(self) -> float:
        """The control's value of the stator transient inductance."""
        return self.lq_H

    @property
    def least_H(self) -> float:
        """Smallest inductance that a voltage step meets in alpha-beta."""
        return min(self.ld_H, self.lq_H)

    def ceiling_rpm(self, vdc_V: float) -> float:
        """Speed up to which no current flows once the gates are off."""
        omega = vdc_V / (math.sqrt(3) * self.psi_f_Wb * self.most_emf * self.pole_pairs)
        return omega * 30 / math.pi

    def swing_rad_s(self, current_A: float) -> float:
        """Natural frequency of a shaft that direct current holds; 0 if it does not hold it."""
        active_Wb = self.psi_f_Wb + (self.ld_H - self.lq_H) * current_A
        stiffness = 3 * self.pole_pairs**2 * active_Wb * current_A
        return math.sqrt(max(0.0, stiffness) / self.inertia_kgm2)

    @property
    def turning_A(self) -> float:
        """Direct current from which on the rotor turns its q axis there: L_q is larger."""
        saliency_H = self.lq_H - self.ld_H
        return self.psi_f_Wb / saliency_H if saliency_H > 0 else math.inf

    # -- steady state, as it is asked of every kind of machine ---------------------------------

    def no_load_A(self, _flux_Wb: float) -> float:
        return 0.0

    def pull_out_Nm(self, flux_Wb: float) -> float:
        """The most torque that this flux can have. With d of it along the d axis it is in
        proportion to (a + b d) sqrt(psi^2 - d^2), which is largest where its slope is 0."""
        b = (self.ld_H - self.lq_H) / self.ld_H
        a = self.psi_f_Wb * (1 - b)
        d_Wb = 2 * b * flux_Wb**2 / (a + math.sqrt(a**2 + 8 * (b * flux_Wb) ** 2))
        q_Wb = math.sqrt(max(0.0, flux_Wb**2 - d_Wb**2))
        return 3 * self.pole_pairs / self.lq_H * (a + b * d_Wb) * q_Wb

    def current_A(self, torque_Nm: float, _flux_Wb: float) -> float:
        """Amplitude of the least current that makes this torque."""
        return math.hypot(*self.least_current(torque_Nm))

    def torque_of_current_Nm(self, current_A: float, _flux_Wb: float) -> float:
        """The most torque of this current."""
        saliency_H = self.lq_H - self.ld_H
        id_A = 0.0
        if saliency_H > 1e-6 * self.lq_H:
            h = self.psi_f_Wb / (4 * saliency_H)
            id_A = h - math.hypot(h, current_A / math.sqrt(2))
        return self.torque_Nm(id_A, math.sqrt(current_A**2 - id_A**2))

    def slip_rad_s(self, _torque_Nm: float, _flux_Wb: float) -> float:
        return 0.0

    def torque_step_Nm(self, _flux_Wb: float, step_Wb: float) -> float:
        """How far a step of the stator flux moves the torque."""
        return 3 * self.pole_pairs * self.psi_f_Wb * step_Wb / self.lq_H

    def turned_rad_s(self, torque_Nm: float, flux_Wb: float, voltage_V: float) -> float:
        """Electrical speed of the shaft at which this torque with its least current needs so much
        voltage. Its flux may be less than `flux_Wb`."""
        need_Wb = min(flux_Wb, self.flux_Wb(*self.least_current(torque_Nm)))
        drop_V = self.rs_ohm * abs(torque_Nm) / (3 * self.pole_pairs * need_Wb)
        return (voltage_V - drop_V) / need_Wb

    def most_torque_Nm(
        self, omega_rad_s: float, flux_Wb: float, voltage_V: float, most_A: float, share: float
    ) -> float:
        """The most torque of at most this current, flux and voltage, by search over the part of the
        current along the d axis. `share`: of pull-out, a little more with magnets
        (`ht_magnet_most_Nm`)."""
        best = 0.0
        for n in range(0, 201):
            id_A = -most_A * n / 200
            d_Wb = self.psi_f_Wb + self.ld_H * id_A
            iq_A = min(
                math.sqrt(max(0.0, most_A**2 - id_A**2)),
                math.sqrt(max(0.0, flux_Wb**2 - d_Wb**2)) / self.lq_H,
                self._driven_A(omega_rad_s, id_A, voltage_V),
            )
            torque = self.torque_Nm(id_A, iq_A)
            if torque > best:
                reach_Wb = math.hypot(d_Wb, self.lq_H * iq_A)
                best = max(best, min(torque, share * self.pull_out_Nm(reach_Wb)))
        return best

    def _driven_A(self, omega_rad_s: float, id_A: float, voltage_V: float) -> float:
        """The largest i_q that this voltage drives beside this i_d, 0 if there is none:
        |R i + j omega psi|^2 = V^2."""
        d_Wb = self.psi_f_Wb + self.ld_H * id_A
        a = self.rs_ohm**2 + (omega_rad_s * self.lq_H) ** 2
        half_b = self.rs_ohm * omega_rad_s * (d_Wb - self.lq_H * id_A)
        c = (self.rs_ohm * id_A) ** 2 + (omega_rad_s * d_Wb) ** 2 - voltage_V**2
        root = half_b**2 - a * c
        return max(0.0, math.sqrt(root) - half_b) / a if root > 0 and a > 0 else 0.0

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
