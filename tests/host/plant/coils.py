"""The machine with magnets in phase coordinates, as a reference for the tests: six coupled coils
around a turning magnet. No space vector enters their equations; `plane` and `state` translate to
the plant's.
"""

import numpy as np
from scipy.integrate import solve_ivp

from hexatorque.plant.machines.magnet_parameters import ORDERS

#: Phase currents from those of u1, u2, w1, w2: each set's sum is zero.
FREE = np.vstack([np.eye(4), [[-1, 0, -1, 0], [0, -1, 0, -1]]])


class Coils:
    """Six coils with two isolated neutrals. Inductances between the coils at a and b: what salient
    poles at t give is (L_d + L_q) cos(a - b)/6 + (L_d - L_q) cos(2 t - a - b)/6; that of x-y is
    added to both planes and taken from this one again."""

    def __init__(self, p):
        self.p = p
        self.angle = np.deg2rad(
            [0, 0, 120, 120, 240, 240] + p.displacement_deg * np.array([0, 1] * 3)
        )
        self.sum = np.add.outer(self.angle, self.angle)
        self.difference = np.subtract.outer(self.angle, self.angle)
        self.ohm = p.rs_ohm + np.array(p.drs_ohm)

    def inductance(self, t):
        p = self.p
        mean, half = 0.5 * (p.ld_H + p.lq_H), 0.5 * (p.ld_H - p.lq_H)
        cosine = np.cos(self.difference)
        return (
            p.lxy_H * (np.eye(6) - cosine / 3)
            + mean / 3 * cosine
            + half / 3 * np.cos(2 * t - self.sum)
        )

    def inductance_slope(self, t):
        return -(self.p.ld_H - self.p.lq_H) / 3 * np.sin(2 * t - self.sum)

    def magnets(self, t):
        """Flux of the magnets in each coil, and its derivative by t."""
        flux = self.p.psi_f_Wb * np.cos(t - self.angle)
        slope = -self.p.psi_f_Wb * np.sin(t - self.angle)
        for n, share, deg in zip(ORDERS, self.p.emf_share, self.p.emf_deg):
            at = n * (t - self.angle) + np.deg2rad(deg)
            flux = flux + self.p.psi_f_Wb * share / n * np.cos(at)
            slope = slope - self.p.psi_f_Wb * share * np.sin(at)
        return flux, slope

    def t(self, theta):
        return np.deg2rad(self.p.start_deg) + self.p.pole_pairs * theta

    def torque(self, i, theta):
        t = self.t(theta)
        work = 0.5 * i @ self.inductance_slope(t) @ i + i @ self.magnets(t)[1]
        return self.p.pole_pairs * work - self.p.cogging_Nm * np.sin(self.p.cogging_per_rev * theta)

    def plane(self, of_coils):
        """alpha, beta, x, y by the space vectors of the two sets."""
        s1, s2 = (2 / 3 * of_coils[k::2] @ np.exp(1j * self.angle[k::2]) for k in (0, 1))
        ab, xy = 0.5 * (s1 + s2), 0.5 * np.conj(s1 - s2)
        return np.array([ab.real, ab.imag, xy.real, xy.imag])

    def state(self, i, omega, theta):
        flux = self.inductance(self.t(theta)) @ i + self.magnets(self.t(theta))[0]
        return np.concatenate([self.plane(flux), [0, 0, omega, theta]])

    def follow(self, i, omega, theta, v_leg, dt):
        """Currents, speed and angle after dt under constant leg voltages."""

        def slopes(_, z):
            t, now = self.t(z[5]), FREE @ z[:4]
            speed = self.p.pole_pairs * z[4]
            induced = speed * (self.inductance_slope(t) @ now + self.magnets(t)[1])
            free = FREE.T @ (v_leg - self.ohm * now - induced)
            changes = np.linalg.solve(FREE.T @ self.inductance(t) @ FREE, free)
            torque = self.torque(now, z[5]) - self.p.viscous_Nms * z[4]
            return [*changes, torque / self.p.inertia_kgm2, z[4]]

        begin = [*i[:4], omega, theta]
        z = solve_ivp(slopes, (0, dt), begin, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        return FREE @ z[:4], z[4], z[5]
