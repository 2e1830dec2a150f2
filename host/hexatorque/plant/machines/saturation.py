"""Saturation of the main flux.

The magnetising current grows faster than its flux, along it:

    i_m = i_s + i_r = psi_m / L_m (1 + (|psi_m| / psi_knee)^S)

(Tuovinen, Hinkkanen, Luomi, IEEE Trans. Ind. Appl. 46(3), 2010: the main-flux part of
their power law). Leakages stay constant.

With the excess flux s = psi_m (|psi_m| / psi_knee)^S, i.e. L_m times the magnetising
current that saturation adds, psi_s + s and psi_r + s are the fluxes of the linear
machine with the same currents: all its matrices apply to them. What remains is

    psi_m + K s(psi_m) = psi_m0,

psi_m0 being the linear machine's main flux at psi_s, psi_r, and K (2, 2) the share of
the leakages, a few per cent. Newton's iteration converges from any state (the left side
grows, ever steeper); it starts afresh every time, so that currents depend on the fluxes
alone. `m` is a machine record.
"""

from __future__ import annotations

from numba.extending import overload

from ..compiled import compiled

MAX_ITERATIONS = 200
#: A relative step that leaves an error of its square.
LAST_STEP = 1e-8


def saturates(m) -> bool:
    """Whether this machine's record is of the saturating type. Decided when code is compiled."""
    return "saturable" in m.dtype.names


@overload(saturates, inline="always")
def _saturates(m):
    known = "saturable" in m.fields
    return lambda m: known


@compiled
def _main_flux(m, a, b, k00, k01, k10, k11):
    """Main flux psi_m for psi_m0 = (a, b): (pa, pb, g, j00, j01, j11) with the excess
    flux s = g psi_m and its derivative J to psi_m, symmetric."""
    pa = a
    pb = b
    for _ in range(MAX_ITERATIONS):
        size2 = pa * pa + pb * pb
        if size2 == 0.0:
            return pa, pb, 0.0, 0.0, 0.0, 0.0
        g = (size2 / m.psi_knee_Wb**2) ** (0.5 * m.saturation_exponent)
        c = m.saturation_exponent * g / size2
        j00 = g + c * pa * pa
        j01 = c * pa * pb
        j11 = g + c * pb * pb
        ra = pa + g * (k00 * pa + k01 * pb) - a
        rb = pb + g * (k10 * pa + k11 * pb) - b
        n00 = 1.0 + k00 * j00 + k01 * j01
        n01 = k00 * j01 + k01 * j11
        n10 = k10 * j00 + k11 * j01
        n11 = 1.0 + k10 * j01 + k11 * j11
        det = n00 * n11 - n01 * n10
        da = (n11 * ra - n01 * rb) / det
        db = (n00 * rb - n10 * ra) / det
        pa -= da
        pb -= db
        if da * da + db * db <= LAST_STEP**2 * (pa * pa + pb * pb):
            g = ((pa * pa + pb * pb) / m.psi_knee_Wb**2) ** (0.5 * m.saturation_exponent)
            return pa, pb, g, j00, j01, j11
    raise ArithmeticError("machine: no main flux found, the fluxes are not finite")


@compiled
def _solve(m, y):
    a = 0.0
    b = 0.0
    for c in range(6):
        a += m.main[0, c] * y[c]
        b += m.main[1, c] * y[c]
    k = m.excess_share
    return _main_flux(m, a, b, k[0, 0], k[0, 1], k[1, 0], k[1, 1])


@compiled
def excess_flux(m, y):
    """s, alpha and beta, of a state y."""
    pa, pb, g, _, _, _ = _solve(m, y)
    return g * pa, g * pb


@compiled
def excess_gain(m, y):
    """D = ds / d psi_m0 at a state, row by row; zero for linear magnetics. From
    (I + K J) d psi_m = d psi_m0 and ds = J d psi_m."""
    if m.psi_knee_Wb == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    _, _, _, j00, j01, j11 = _solve(m, y)
    k = m.excess_share
    n00 = 1.0 + k[0, 0] * j00 + k[0, 1] * j01
    n01 = k[0, 0] * j01 + k[0, 1] * j11
    n10 = k[1, 0] * j00 + k[1, 1] * j01
    n11 = 1.0 + k[1, 0] * j01 + k[1, 1] * j11
    det = n00 * n11 - n01 * n10
    return (
        (j00 * n11 - j01 * n10) / det,
        (j01 * n00 - j00 * n01) / det,
        (j01 * n11 - j11 * n10) / det,
        (j11 * n00 - j01 * n01) / det,
    )


@compiled
def open_rotor(m, psi_r):
    """The ratios (|psi_m| / |psi_r|, R_r |i_r| / |psi_r| in 1/s) without stator current."""
    if m.psi_knee_Wb == 0.0 or psi_r == 0.0:
        return m.lm_over_lr, m.rr_over_lr
    share = 1.0 - m.lm_over_lr
    psi_m, _, g, _, _, _ = _main_flux(m, m.lm_over_lr * psi_r, 0.0, share, 0.0, 0.0, share)
    return psi_m / psi_r, m.rr_over_lr * (1.0 + g * psi_m / psi_r)
