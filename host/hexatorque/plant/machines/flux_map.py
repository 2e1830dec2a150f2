"""Saturation of a machine with magnets, both axes coupled: a table of psi_d and psi_q against i_d
and i_q, as finite elements or a bench give it.

The plant's state is the flux, so it needs the currents of a flux. With r = (psi_d - psi_f, psi_q)
they are the slopes of the field's energy,

    i_d = r_d/L_d + dU/dr_d,    i_q = r_q/L_q + dU/dr_q,

L_d and L_q being those at no current and U what saturation adds. Currents that are slopes of one
function give back every energy that they took, on any path. U is a spline of the fourth degree in
both directions on CELLS x CELLS equal cells, so that the incremental inductances have no jumps. Its
coefficients are those that come nearest to the table, with a third derivative as small as the table
lets it: where the table has no row, in the corners, the currents go on in straight lines.

Beyond the rectangle of the table's fluxes the currents go on in straight lines from its edge, with
the least incremental inductances of the table. They stay slopes of one function there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import overload

from ..compiled import INLINE, compiled

CELLS, DEGREE = 20, 4
COUNT = CELLS + DEGREE
#: What holds the third derivative small, beside the table's rows.
STIFFNESS = 1e-4
#: Largest flux that is a flux: a state that diverges ends here and not in a table's index.
MOST_WB = 1e6

#: Of the record of a machine.
FIELDS = [
    ("excess", "f8", (COUNT, COUNT)),  # coefficients of U
    ("first_Wb", "f8", (2,)),  # the rectangle of r that the cells share
    ("last_Wb", "f8", (2,)),
    ("cells_per_Wb", "f8", (2,)),
    ("beyond_per_H", "f8", (2,)),  # slope of the excess current beyond it
]

# -- what the plant computes -----------------------------------------------------------------


@compiled
def _lower(t):
    """The five splines of a cell, differentiated twice, at 0 <= t <= 1 of it; and the four of
    the third degree."""
    a = 0.5 * (1.0 - t) * (1.0 - t)
    b = 0.5 + t * (1.0 - t)
    c = 0.5 * t * t
    third = 1.0 / 3.0
    return (a, b - 2.0 * a, a - 2.0 * b + c, b - 2.0 * c, c), (
        third * (1.0 - t) * a,
        third * ((t + 2.0) * a + (2.0 - t) * b),
        third * ((t + 1.0) * b + (3.0 - t) * c),
        third * t * c,
    )


@compiled
def _splines(t):
    """(values, slopes, curvatures) of the five splines of a cell."""
    curves, (a, b, c, d) = _lower(t)
    values = (
        0.25 * (1.0 - t) * a,
        0.25 * ((t + 3.0) * a + (2.0 - t) * b),
        0.25 * ((t + 2.0) * b + (3.0 - t) * c),
        0.25 * ((t + 1.0) * c + (4.0 - t) * d),
        0.25 * t * d,
    )
    return values, (-a, a - b, b - c, c - d, d), curves


@compiled
def _row(m, r, c, w):
    return (
        m.excess[r, c] * w[0]
        + m.excess[r, c + 1] * w[1]
        + m.excess[r, c + 2] * w[2]
        + m.excess[r, c + 3] * w[3]
        + m.excess[r, c + 4] * w[4]
    )


@compiled
def _sum(m, r, c, along, across):
    return (
        along[0] * _row(m, r, c, across)
        + along[1] * _row(m, r + 1, c, across)
        + along[2] * _row(m, r + 2, c, across)
        + along[3] * _row(m, r + 3, c, across)
        + along[4] * _row(m, r + 4, c, across)
    )


@compiled
def _within(m, axis, flux):
    """The nearest flux within the rectangle."""
    if not abs(flux) < MOST_WB:
        raise ArithmeticError("machine: the fluxes are not finite")
    return min(max(flux, m.first_Wb[axis]), m.last_Wb[axis])


@compiled
def _place(m, axis, flux):
    """(cell, place in it)."""
    place = (flux - m.first_Wb[axis]) * m.cells_per_Wb[axis]
    cell = min(np.int64(place), CELLS - 1)
    return cell, place - cell


@compiled
def _excess_current(m, r):
    d = _within(m, 0, r.real)
    q = _within(m, 1, r.imag)
    row, s = _place(m, 0, d)
    column, t = _place(m, 1, q)
    at_d, slope_d, _ = _splines(s)
    at_q, slope_q, _ = _splines(t)
    i_d = m.cells_per_Wb[0] * _sum(m, row, column, slope_d, at_q)
    i_q = m.cells_per_Wb[1] * _sum(m, row, column, at_d, slope_q)
    if d != r.real or q != r.imag:
        cross = m.cells_per_Wb[0] * m.cells_per_Wb[1] * _sum(m, row, column, slope_d, slope_q)
        i_d += m.beyond_per_H[0] * (r.real - d) + cross * (r.imag - q)
        i_q += m.beyond_per_H[1] * (r.imag - q) + cross * (r.real - d)
    return complex(i_d, i_q)


@compiled
def _excess_per_H(m, r):
    d = _within(m, 0, r.real)
    q = _within(m, 1, r.imag)
    row, s = _place(m, 0, d)
    column, t = _place(m, 1, q)
    at_d, slope_d, curve_d = _splines(s)
    at_q, slope_q, curve_q = _splines(t)
    n_d = m.cells_per_Wb[0]
    n_q = m.cells_per_Wb[1]
    cross = n_d * n_q * _sum(m, row, column, slope_d, slope_q)
    dd = m.beyond_per_H[0]
    if d == r.real:
        dd = n_d * n_d * _sum(m, row, column, curve_d, at_q)
        if q != r.imag:
            dd += n_d * n_d * n_q * _sum(m, row, column, curve_d, slope_q) * (r.imag - q)
    qq = m.beyond_per_H[1]
    if q == r.imag:
        qq = n_q * n_q * _sum(m, row, column, at_d, curve_q)
        if d != r.real:
            qq += n_q * n_q * n_d * _sum(m, row, column, slope_d, curve_q) * (r.real - d)
    return dd, cross, qq


def excess_current(m, r):
    """What saturation adds to i_d + j i_q at r = psi_d - psi_f + j psi_q."""
    return _excess_current(m, r)


def excess_per_H(m, r):
    """(dd, dq, qq): the second derivatives of U there."""
    return _excess_per_H(m, r)


# Numba finds the types of a branch that is never taken, too. A linear machine's record has no U.


@overload(excess_current, jit_options=INLINE)  # type: ignore[arg-type] # private
def _current_of_kind(m, r):
    if "saturable" in m.fields:
        return lambda m, r: _excess_current(m, r)
    return lambda m, r: 0j


@overload(excess_per_H, jit_options=INLINE)  # type: ignore[arg-type] # private
def _per_H_of_kind(m, r):
    if "saturable" in m.fields:
        return lambda m, r: _excess_per_H(m, r)
    return lambda m, r: (0.0, 0.0, 0.0)


# -- from the table --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FluxMap:
    """What the plant has of a table. fields: of the machine's record; off_Wb: how far the plant's
    fluxes are from the table's; most_per_H, least_per_H: slopes of the currents. Two fluxes have
    the same current if the least is not above 0; least_at_Wb: psi_d - psi_f and psi_q there."""

    psi_f_Wb: float
    ld_H: float
    lq_H: float
    fields: dict[str, Any]
    off_Wb: float
    most_per_H: float
    least_per_H: float
    least_at_Wb: tuple[float, float]


def at_no_current(
    i_d: np.ndarray, i_q: np.ndarray, psi_d: np.ndarray, psi_q: np.ndarray
) -> tuple[float, float, float]:
    """(psi_f, L_d, L_q) of a table that has the row of no current."""
    d, q = int(np.argmin(abs(i_d))), int(np.argmin(abs(i_q)))
    ld, lq = np.gradient(psi_d[:, q], i_d)[d], np.gradient(psi_q[d], i_q)[q]
    return float(psi_d[d, q]), float(ld), float(lq)


def fit(i_d: np.ndarray, i_q: np.ndarray, psi_d: np.ndarray, psi_q: np.ndarray) -> FluxMap:
    """The energy that comes nearest to a table: its two axes, and both fluxes over them."""
    psi_f, ld, lq = at_no_current(i_d, i_q, psi_d, psi_q)
    straight = np.array([[1 / ld], [1 / lq]])
    r = np.array([psi_d.ravel() - psi_f, psi_q.ravel()])
    i = np.array([axis.ravel() for axis in np.meshgrid(i_d, i_q, indexing="ij")])
    u = _Spline.nearest(r, i - straight * r)
    slopes = straight + u.per_H(r)[::2]
    u.beyond_per_H[:] = slopes.max(axis=1) - straight[:, 0]
    fields = {
        "excess": u.excess, "first_Wb": u.first_Wb, "last_Wb": u.last_Wb,
        "cells_per_Wb": u.cells_per_Wb, "beyond_per_H": u.beyond_per_H,
    }  # fmt: skip
    off_Wb = _off_Wb(straight + 0 * r, u, r, i)
    return FluxMap(psi_f, ld, lq, fields, off_Wb, *_extremes(straight, u))


@dataclass(frozen=True)
class _Spline:
    """U at many points at once, r (2, n): what the compiled functions compute at one."""

    excess: np.ndarray
    first_Wb: np.ndarray
    last_Wb: np.ndarray
    beyond_per_H: np.ndarray

    @property
    def cells_per_Wb(self) -> np.ndarray:
        return CELLS / (self.last_Wb - self.first_Wb)

    @classmethod
    def nearest(cls, r: np.ndarray, added_A: np.ndarray) -> _Spline:
        """Least squares over slopes, in cells. At no current there is no flux but the magnets'."""
        u = cls(np.zeros((COUNT, COUNT)), r.min(axis=1), r.max(axis=1), np.zeros(2))
        at, splines = u._at(r)
        flat = (at[0][:, :, None] * COUNT + at[1][:, None, :]).reshape(len(r.T), -1)
        normal, right = _stiffness(), np.zeros(COUNT * COUNT)
        wanted = added_A / u.cells_per_Wb[:, None]
        for axis in range(2):
            row = np.einsum("na,nb->nab", splines[0][axis == 0], splines[1][axis == 1])
            row = row.reshape(flat.shape)
            np.add.at(normal, (flat[:, :, None], flat[:, None, :]), row[:, :, None] * row[:, None])
            np.add.at(right, flat, row * wanted[axis][:, None])
        u.excess[:] = np.linalg.solve(normal, right).reshape(COUNT, COUNT)
        tilt = u.current_A(np.zeros((2, 1))) / u.cells_per_Wb[:, None]
        u.excess[:] -= np.add.outer(*(np.arange(COUNT) * tilt))
        return u

    def _at(self, r: np.ndarray) -> tuple[list[np.ndarray], list[list[np.ndarray]]]:
        """Of both axes: which splines each point has, and their values, slopes, curvatures."""
        place = (r - self.first_Wb[:, None]) * self.cells_per_Wb[:, None]
        cell = np.minimum(place.astype(int), CELLS - 1)
        return [axis[:, None] + np.arange(DEGREE + 1) for axis in cell], [
            [
                (-1) ** n * np.diff(np.pad(_basis(t, DEGREE - n), ((0, 0), (n, n))), n)
                for n in range(3)
            ]
            for t in place - cell
        ]

    def _derivatives(self, r: np.ndarray) -> Any:
        """Function of two orders: U at these points, differentiated along d and q."""
        at, splines = self._at(r)
        part = self.excess[at[0][:, :, None], at[1][:, None, :]]
        per_Wb = self.cells_per_Wb
        return lambda d, q: (
            per_Wb[0] ** d
            * per_Wb[1] ** q
            * np.einsum("na,nab,nb->n", splines[0][d], part, splines[1][q])
        )

    def current_A(self, r: np.ndarray) -> np.ndarray:
        """(2, n): within the rectangle."""
        u = self._derivatives(r)
        return np.array([u(1, 0), u(0, 1)])

    def per_H(self, r: np.ndarray) -> np.ndarray:
        """(3, n): dd, dq, qq, beyond the rectangle as well."""
        near = np.clip(r, self.first_Wb[:, None], self.last_Wb[:, None])
        u, (d, q) = self._derivatives(near), r - near
        return np.array([
            np.where(d == 0, u(2, 0) + u(2, 1) * q, self.beyond_per_H[0]),
            u(1, 1),
            np.where(q == 0, u(0, 2) + u(1, 2) * d, self.beyond_per_H[1]),
        ])  # fmt: skip


def _basis(t: np.ndarray, degree: int) -> np.ndarray:
    """(n, degree + 1): the splines of a cell, by the rule of Cox and de Boor."""
    found = np.ones((len(t), 1))
    for n in range(1, degree + 1):
        wide = np.pad(found, ((0, 0), (1, 1)))
        j, x = np.arange(n + 1), t[:, None]
        found = ((x + n - j) * wide[:, :-1] + (1 - x + j) * wide[:, 1:]) / n
    return found


def _stiffness() -> np.ndarray:
    """Normal matrix of the third derivatives, and of U's mean, which no current tells."""
    one = np.eye(COUNT)
    n1, n2, n3 = (np.diff(one, n, axis=0).T @ np.diff(one, n, axis=0) for n in (1, 2, 3))
    pairs = ((n3, one), (one, n3), (n2, n1), (n1, n2))
    return STIFFNESS**2 * np.sum([np.kron(a, b) for a, b in pairs], axis=0) + 1 / COUNT**2


def _off_Wb(straight: np.ndarray, u: _Spline, r: np.ndarray, i: np.ndarray) -> float:
    """How far the fluxes of the rows' currents are from the rows' fluxes, to first order."""
    d, q = i - straight * r - u.current_A(r)
    dd, dq, qq = u.per_H(r) + np.array([straight[0], 0 * d, straight[1]])
    det = dd * qq - dq * dq
    return float(np.hypot((qq * d - dq * q) / det, (dd * q - dq * d) / det).max())


def _extremes(straight: np.ndarray, u: _Spline) -> tuple[float, float, tuple[float, float]]:
    """The slopes of a map: within the rectangle of the fluxes and as far again beyond its edges."""
    centre, half = (u.first_Wb + u.last_Wb) / 2, (u.last_Wb - u.first_Wb) / 2
    s = np.linspace(-2, 2, 8 * CELLS + 1)
    d, q = (axis.ravel() for axis in np.meshgrid(centre[0] + half[0] * s, centre[1] + half[1] * s))
    dd, dq, qq = u.per_H(np.array([d, q]))
    dd, qq = dd + straight[0], qq + straight[1]
    mean, root = (dd + qq) / 2, np.hypot((dd - qq) / 2, dq)
    least = int(np.argmin(mean - root))
    at = float(d[least]), float(q[least])
    return float((mean + root).max()), float((mean - root)[least]), at
