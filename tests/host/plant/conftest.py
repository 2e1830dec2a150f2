"""The machine in phase coordinates, as a reference for the tests: twelve coils, six on the stator
(two isolated neutrals) and six short-circuited ones on the turning rotor. No space-vector transform
enters its equations of motion; `state` translates its fluxes to the plant's state.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hexatorque.plant.machines.induction import Parameters

#: Phase currents from those of u1, u2, w1, w2: each set's sum is zero.
FREE = np.vstack([np.eye(4), [[-1, 0, -1, 0], [0, -1, 0, -1]]])


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def angles(displacement_deg=30.0):
    """Where the coils of u1 u2 w1 w2 v1 v2 lie: set 1 at 0, 120, 240 degrees, set 2 ahead of it."""
    return np.deg2rad([0, 0, 120, 120, 240, 240] + displacement_deg * np.array([0, 1] * 3))


def decomposed(displacement_deg=30.0):
    """(4, 6): alpha, beta, x, y of the phases by the space vectors s1, s2 of the two sets, with
    alpha + j beta = (s1 + s2)/2 and x - j y = (s1 - s2)/2."""
    axes = 2 / 3 * np.exp(1j * angles(displacement_deg))
    of_sets = [axes * (np.arange(6) % 2 == k) for k in (0, 1)]
    ab, xy = 0.5 * (of_sets[0] + of_sets[1]), 0.5 * np.conj(of_sets[0] - of_sets[1])
    return np.array([ab.real, ab.imag, xy.real, xy.imag])


class PhaseModel:
    def __init__(self, p, free=FREE):
        self.p = p
        self.free = free
        angle = angles(p.displacement_deg)
        self.delta = angle[:, None] - angle
        self.vsd = decomposed(p.displacement_deg)
        #: Coil currents of the rotor from its alpha and beta current, at angle 0.
        self.rotor = 3 * self.vsd[:2].T
        cosine = np.cos(self.delta)
        # Diagonal if the x-y plane has the leakage of the alpha-beta plane.
        leakage = p.lxy_H * np.eye(6) + (p.lls_H - p.lxy_H) / 3 * cosine
        self.l_stator = p.lm_H / 3 * cosine + leakage + np.diag(p.dlls_H)
        self.l_rotor = p.lm_H / 3 * cosine + p.llr_H * np.eye(6)
        self.r_stator = p.rs_ohm + np.array(p.drs_ohm)

    def mutual(self, theta_e):
        """(stator coil, rotor coil)"""
        return self.p.lm_H / 3 * np.cos(self.delta - theta_e)

    def inductance(self, theta_e):
        m = self.mutual(theta_e)
        return np.block([[self.l_stator, m], [m.T, self.l_rotor]])

    def free_inductance(self, theta_e):
        """Inductance matrix of the free stator currents (four, or fewer if legs float) and the six
        rotor currents."""
        n = self.free.shape[1]
        basis = np.block([[self.free, np.zeros((6, 6))], [np.zeros((6, n)), np.eye(6)]])
        return basis.T @ self.inductance(theta_e) @ basis

    def torque(self, i_s, i_r, theta_e):
        return self.p.pole_pairs * i_s @ (self.p.lm_H / 3 * np.sin(self.delta - theta_e)) @ i_r

    def state(self, i_s, i_r, omega, theta):
        """The plant's state for these coil currents."""
        theta_e = self.p.pole_pairs * theta
        flux = self.inductance(theta_e) @ np.concatenate([i_s, i_r])
        rotor = turn(theta_e) @ self.vsd[:2] @ flux[6:]
        return np.concatenate([self.vsd @ flux[:6], rotor, [omega, theta]])

    @cached_property
    def fluxes_of_currents(self):
        """Matrix from four stator currents and two of the rotor to the fluxes of a state."""
        columns = [self.state(FREE @ e, np.zeros(6), 0, 0)[:6] for e in np.eye(4)]
        columns += [self.state(np.zeros(6), self.rotor @ e, 0, 0)[:6] for e in np.eye(2)]
        return np.array(columns).T

    def currents(self, y):
        """The stator currents, and the rotor currents in coils that stand at angle 0, of a state or
        of each row of states."""
        i = np.linalg.solve(self.fluxes_of_currents, y[..., :6].T)
        return (FREE @ i[:4]).T, (self.rotor @ i[4:]).T

    def flux_slopes(self, i_s, i_r, v_leg):
        """The derivatives of the free currents' fluxes and the six rotor fluxes."""
        slopes = self.free.T @ (v_leg - self.r_stator * i_s)
        return np.concatenate([slopes, -self.p.rr_ohm * i_r])

    def fluxes(self, i_s, i_r, theta_e):
        flux = self.inductance(theta_e) @ np.concatenate([i_s, i_r])
        return np.concatenate([self.free.T @ flux[:6], flux[6:]])

    def solve(self, flux, theta_e):
        """Coil currents of these fluxes."""
        i = np.linalg.solve(self.free_inductance(theta_e), flux)
        n = self.free.shape[1]
        return self.free @ i[:n], i[n:]

    def follow(self, z, v_leg, dt, load, events=None):
        """Advance z = (fluxes, speed, angle) under constant leg voltages."""

        def slopes(_, z):
            theta_e = self.p.pole_pairs * z[-1]
            i_s, i_r = self.solve(z[:-2], theta_e)
            braking = self.p.viscous_Nms * z[-2] + load(z[-2])
            turning = (self.torque(i_s, i_r, theta_e) - braking) / self.p.inertia_kgm2
            return np.concatenate([self.flux_slopes(i_s, i_r, v_leg), [turning, z[-2]]])

        return solve_ivp(slopes, (0, dt), z, "DOP853", rtol=1e-11, atol=1e-12, events=events)

    def plant_state(self, z):
        return self.state(*self.solve(z[:-2], self.p.pole_pairs * z[-1]), z[-2], z[-1])


SYMMETRIC = Parameters(2, 1.8, 2.0, 10e-3, 15e-3, 284e-3, 10e-3, 0.03, 0.0033)
MACHINES = {
    "symmetric": SYMMETRIC,
    "other x-y": Parameters(1, 6.0, 2.2, 14.4e-3, 14.4e-3, 256e-3, 5e-3, 0.003),
    "asymmetric": Parameters(
        3, 2.0, 1.5, 12e-3, 9e-3, 200e-3, 7e-3, 0.02, 0.01,
        drs_ohm=(0.5, -0.3, 0.0, 1.1, 0.2, -0.7),
        dlls_H=(3e-3, 0.0, -2e-3, 1e-3, 5e-3, -4e-3),
    ),
}  # fmt: skip
#: The same windings with other displacements of set 2.
WINDINGS = MACHINES | {
    f"{name}, {displacement_deg} degrees": replace(
        MACHINES[name], displacement_deg=float(displacement_deg)
    )
    for name in ("other x-y", "asymmetric")
    for displacement_deg in (0, 60)
}


@pytest.fixture(params=MACHINES)
def model(request):
    return PhaseModel(MACHINES[request.param])


@pytest.fixture(params=WINDINGS)
def any_winding(request):
    return PhaseModel(WINDINGS[request.param])


@pytest.fixture
def phase_model():
    """The model as a class, to be made from any Parameters."""
    return PhaseModel


@pytest.fixture
def symmetric():
    return PhaseModel(SYMMETRIC)
