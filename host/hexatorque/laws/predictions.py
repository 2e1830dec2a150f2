"""The common part of the predictive references: the machine one period ahead, and its references.

With the rotor flux seen from the stator, r = psi - sigma L_s i, which turns on with the flux's
speed, no parameter of the rotor is needed. Steps that are compiled may call these.
"""

from __future__ import annotations

import math

from numba import njit

#: Of the x-y current: share that a period takes away; gain of the integrators, of the voltage that
#: would take it away at once; their limit, in units of V_dc. Those of the firmware's schemes.
XY_SHARE, XY_INTEGRAL, XY_LIMIT_PU = 0.4, 0.008, 0.1


@njit
def turn(seen):
    """The turn of the fluxes in a period, as a complex number of length 1."""
    angle = seen.omega_rad_s * seen.ts_s
    return complex(math.cos(angle), math.sin(angle))


@njit
def turned_on(seen):
    """The rotor flux at the end of the period."""
    return seen.rotor_Wb * turn(seen)


@njit
def flux_reference(seen):
    """The stator flux wanted at the end of the period: psi* = (a + j b) r has the torque's b by
    T = 3 P r x psi / (sigma L_s), and the length wanted by a."""
    rotor = turned_on(seen)
    inverse = 1.0 / max(abs(rotor) ** 2, 1e-8)
    b = seen.torque_ref_Nm * seen.sigma_ls_H / (3.0 * seen.pole_pairs) * inverse
    a = math.sqrt(max(seen.flux_ref_Wb**2 * inverse - b * b, 0.01))
    return complex(a, b) * rotor


@njit
def current_reference(seen):
    """The stator current that belongs to it."""
    return (flux_reference(seen) - turned_on(seen)) / seen.sigma_ls_H


@njit
def flux_ahead(seen, v_pu):
    """The stator flux at the end of a period with the mean voltage v_pu, in units of V_dc."""
    return seen.psi_Wb + seen.ts_s * (seen.vdc_V * v_pu - seen.rs_ohm * seen.i_A)


@njit
def current_ahead(seen, v_pu):
    """The stator current there."""
    return (flux_ahead(seen, v_pu) - turned_on(seen)) / seen.sigma_ls_H


@njit
def xy_ahead(seen, v_xy_pu):
    """The x-y current there."""
    change = seen.vdc_V * v_xy_pu - seen.rs_ohm * seen.i_xy_A
    return seen.i_xy_A + seen.ts_s / seen.lxy_H * change


@njit
def _within(z):
    size = abs(z)
    return z * XY_LIMIT_PU / size if size > XY_LIMIT_PU else z


@njit
def xy_regulated(seen, memory, along):
    """x-y voltage, in units of V_dc: proportional on the prediction, and two integrators on the
    sample, in the frames that turn with and against the unit vector `along`. They are
    memory.xy_with and memory.xy_against."""
    per_A = seen.lxy_H / (seen.ts_s * seen.vdc_V)
    with_, against = memory.xy_with, memory.xy_against
    v_xy = with_ * along + against * along.conjugate() - XY_SHARE * per_A * seen.i_xy_A
    error = -XY_INTEGRAL * per_A * seen.sampled_i_xy_A
    memory.xy_with = _within(with_ + error * along.conjugate())
    memory.xy_against = _within(against + error * along)
    return v_xy
