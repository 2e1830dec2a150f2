"""Tables of a saturating machine with magnets that follow from one function, the energy of its
field over the fluxes:

    W = a d^2/2 + b d^4/4 + e q^2/2 + f q^4/4 + c d^2 q^2/4 - I d
    i_d = dW/dd = (a + b d^2 + c q^2/2) d - I,    i_q = dW/dq = (e + f q^2 + c d^2/2) q

(Hinkkanen et al., IEEE Trans. Ind. Appl. 53(3), 2017, with even exponents). What is asked of the
plant is held to this function, and not to its table.
"""

from dataclasses import dataclass

import numpy as np

from hexatorque.plant.machines.flux_map import fit
from hexatorque.setups.flux_table import table


@dataclass(frozen=True)
class Iron:
    """psi_f: flux of the magnets at no current; ld, lq: incremental inductances there; the currents
    of psi_f alone, d and q, are so much larger by saturation; cross: share of psi_f's in q."""

    psi_f: float = 0.1746
    ld: float = 6.4e-3
    lq: float = 17.4e-3
    bend_d: float = 0.3
    bend_q: float = 0.45
    cross: float = 0.05

    @property
    def constants(self):
        f2 = self.psi_f**2
        c = 2 * self.cross / self.lq / f2
        b = self.bend_d / self.ld / (3 * f2)
        a = (1 - self.bend_d) / self.ld
        e = (1 - self.cross) / self.lq
        return a, b, e, self.bend_q / self.lq / f2, c, (a + b * f2) * self.psi_f

    def energy_J(self, d, q):
        a, b, e, f, c, i_f = self.constants
        return (
            a * d**2 / 2
            + b * d**4 / 4
            + e * q**2 / 2
            + f * q**4 / 4
            + c * d**2 * q**2 / 4
            - i_f * d
        )

    def current_A(self, d, q):
        a, b, e, f, c, i_f = self.constants
        return (a + b * d**2 + c * q**2 / 2) * d - i_f, (e + f * q**2 + c * d**2 / 2) * q

    def per_H(self, d, q):
        """Slopes of the currents by the fluxes."""
        a, b, e, f, c, _ = self.constants
        return np.array([
            [a + 3 * b * d**2 + c * q**2 / 2, c * d * q],
            [c * d * q, e + 3 * f * q**2 + c * d**2 / 2],
        ])  # fmt: skip

    def flux_Wb(self, i_d, i_q):
        psi = np.array([self.psi_f, 0.0])
        for _ in range(100):
            step = np.linalg.solve(self.per_H(*psi), np.array(self.current_A(*psi)) - (i_d, i_q))
            psi -= step
            if abs(step).max() < 1e-15:
                break
        return psi

    def rows(self, most_A, count=33):
        """(i_d, i_q, psi_d, psi_q); i_q from 0 on."""
        for i_d in np.linspace(-most_A, most_A, count):
            for i_q in np.linspace(0, most_A, (count + 1) // 2):
                yield i_d, i_q, *self.flux_Wb(i_d, i_q)


HEADER = "id_A,iq_A,psi_d_Wb,psi_q_Wb"


def text(rows):
    return "\n".join([HEADER, *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n"


def written(path, rows):
    path.write_text(text(rows))
    return str(path)


def fitted(rows):
    return fit(*table(text(rows)))
