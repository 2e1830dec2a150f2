"""Six-phase machine with permanent magnets in VSD form, salient or not.

The stator's fluxes follow from its currents and from the rotor's electrical angle t = p theta:

    psi_ab = L(t) i_ab + psi_m,ab(t),    psi_xy = L_xy i_xy + psi_m,xy(t)
    L(t) = (L_d + L_q)/2 + (L_d - L_q)/2 (cos 2t, sin 2t; sin 2t, -cos 2t)
    d psi/dt = v - R i
    T_e = 3 p (i_ab . d psi_m,ab/dt + i_xy . d psi_m,xy/dt + (L_d - L_q) i_d i_q) + cogging
    J dw/dt = T_e - B w - T_load(w)

The factor 3 belongs to the amplitude-invariant transform. The magnets' flux in a phase at the angle
a is psi_f (cos(t - a) + sum e_n/n cos(n(t - a) + phi_n)), e_n being the share of the n-th harmonic
in the induced voltage. Its parts in both planes follow from where the phases lie: with a
displacement of 30 degrees the fifth and the seventh harmonic are in x-y, the eleventh and the
thirteenth in alpha-beta; with 0 and 60 degrees all are in alpha-beta. The iron's loss takes a part
of T_e (plant/iron.py).

With a table of flux linkages (flux_map.py) saturation adds currents to those of the linear machine
at the same fluxes, and r_d i_q - r_q i_d with r = L i takes the place of (L_d - L_q) i_d i_q.
psi_f, L_d and L_q then are the table's, at no current; x-y and the harmonics stay linear.

(Levi, Bojoi, Profumo, Toliyat, Williamson, IET Electr. Power Appl. 1(4), 2007: multiphase machines
by vector space decomposition. Boldea, Paicu, Andreescu, IEEE Trans. Power Electron. 24(1), 2009:
the active flux, on which the firmware's control rests.)

Two isolated neutrals: zero-sequence currents do not exist.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import machine
from ..compiled import compiled
from ..elementary import sin, turned
from ..iron import FIELDS as IRON_FIELDS
from ..iron import iron_torque
from ..iron import values as iron_values
from ..load import load_torque
from ..machine import implements
from ..record import record
from ..vsd import angles_rad, exp_j, transform
from . import flux_map
from .flux_map import excess_current, excess_per_H
from .magnet_parameters import ORDERS, Parameters
from .saturation import saturates

_FIELDS = [
    ("magnet", "i8"),
    ("mean_per_H", "f8"),  # (1/L_d + 1/L_q)/2
    ("half_per_H", "f8"),  # (1/L_d - 1/L_q)/2
    ("xy_per_H", "f8"),  # 1/L_xy
    ("saliency_H", "f8"),  # L_d - L_q
    ("psi_f_Wb", "f8"),
    ("harmonics", "i8"),  # 0: the fundamental alone
    # Of each harmonic: what turns forwards and backwards, alpha-beta and x-y
    ("forwards", "c16", (2, 4)),
    ("backwards", "c16", (2, 4)),
    ("resistance", "f8", (4, 4)),
    ("i_phase", "f8", (6, 4)),  # phase current on each leg from alpha, beta, x, y
    ("legs", "f8", (4, 6)),  # alpha, beta, x, y of a voltage on each leg
    ("g_leg", "f8", (6, 6)),
    ("inv_l_max", "f8"),
    ("pole_pairs", "f8"),
    ("most_emf_Wb", "f8"),  # peak between two terminals over the electrical speed
    ("cogging_Nm", "f8"),
    ("cogging_per_rev", "f8"),
    ("start_rad", "f8"),  # electrical angle of the d axis at theta = 0
    ("inertia", "f8"),
    ("viscous", "f8"),
    *IRON_FIELDS,
]
#: A type for each kind of magnetics, as in `induction`.
LINEAR = np.dtype([*_FIELDS, ("linear", "i8")])
SATURABLE = np.dtype([*_FIELDS, *flux_map.FIELDS, ("saturable", "i8")])


def _harmonics(p: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """(2, 4) each: of the flux of each harmonic in alpha-beta and x-y the part that turns with
    exp(j n t) and the one that turns with exp(-j n t)."""
    rows = transform(p.displacement_deg)
    planes = np.array([rows[0] + 1j * rows[1], rows[2] + 1j * rows[3]])
    angles = angles_rad(p.displacement_deg)
    forwards, backwards = np.zeros((2, 4), complex), np.zeros((2, 4), complex)
    for k, (order, share, deg) in enumerate(zip(ORDERS, p.emf_share, p.emf_deg)):
        size = p.psi_f_Wb * share / order * exp_j(np.deg2rad(deg))
        of_phases = 0.5 * size * np.array([exp_j(-order * angle) for angle in angles])
        forwards[:, k] = planes @ of_phases
        backwards[:, k] = planes @ of_phases.conj()
    return forwards, backwards


def make(p: Parameters) -> np.record:
    kind, more, steepest = LINEAR, {"linear": 1}, 0.0
    if found := p.flux_map:
        p = replace(p, psi_f_Wb=found.psi_f_Wb, ld_H=found.ld_H, lq_H=found.lq_H)
        kind, more, steepest = SATURABLE, {**found.fields, "saturable": 1}, found.most_per_H
    rows = transform(p.displacement_deg)
    inverse = 3 * rows.T
    per_H = np.array([1 / p.ld_H, 1 / p.lq_H])
    legs = rows[:, p.phase_of_leg]
    i_phase = inverse[p.phase_of_leg]
    mean = np.diag([per_H.mean(), per_H.mean(), 1 / p.lxy_H, 1 / p.lxy_H])
    forwards, backwards = _harmonics(p)
    return record(
        kind,
        magnet=1,
        **more,
        mean_per_H=per_H.mean(),
        half_per_H=0.5 * (per_H[0] - per_H[1]),
        xy_per_H=1 / p.lxy_H,
        saliency_H=p.ld_H - p.lq_H,
        psi_f_Wb=p.psi_f_Wb,
        harmonics=int(any(p.emf_share)),
        forwards=forwards,
        backwards=backwards,
        resistance=rows @ np.diag(p.rs_ohm + np.array(p.drs_ohm)) @ inverse,
        i_phase=i_phase,
        legs=legs,
        g_leg=i_phase @ mean @ legs,
        inv_l_max=max(*per_H, 1 / p.lxy_H, steepest),
        pole_pairs=p.pole_pairs,
        most_emf_Wb=np.sqrt(3) * p.psi_f_Wb * p.most_emf,
        cogging_Nm=p.cogging_Nm,
        cogging_per_rev=p.cogging_per_rev,
        start_rad=np.deg2rad(p.start_deg),
        inertia=p.inertia_kgm2,
        viscous=p.viscous_Nms,
        **iron_values(p),
    )


def initial(m: np.record) -> np.ndarray:
    """The magnets' flux, no current, at rest."""
    y = np.zeros(8)
    flux = np.array([m.psi_f_Wb * exp_j(m.start_rad), 0])
    turns = np.array([exp_j(order * m.start_rad) for order in ORDERS])
    flux += m.forwards @ turns + m.backwards @ turns.conj()
    y[:4] = flux[0].real, flux[0].imag, flux[1].real, flux[1].imag
    return y


def fastest_per_s(m: np.record) -> float:
    """Largest decay rate of the windings at standstill."""
    return float(np.abs(np.linalg.eigvals(m.resistance)).max() * m.inv_l_max)


@compiled(inline="always")
def _turn(m, y):
    """exp(j t) of the d axis."""
    return turned(m.start_rad + m.pole_pairs * y[7])


@compiled
def _magnet_flux(m, turn):
    """(alpha-beta, x-y, and both differentiated by t) of the magnets' flux."""
    ab = m.psi_f_Wb * turn
    ab_t = 1j * ab
    xy = 0j
    xy_t = 0j
    if m.harmonics != 0:
        turn2 = turn * turn
        turn4 = turn2 * turn2
        turn_n = turn4 * turn  # the fifth
        for k in range(4):
            back = turn_n.conjugate()
            order = 5.0 if k == 0 else (7.0 if k == 1 else (11.0 if k == 2 else 13.0))
            plus = m.forwards[0, k] * turn_n
            minus = m.backwards[0, k] * back
            ab += plus + minus
            ab_t += order * 1j * (plus - minus)
            plus = m.forwards[1, k] * turn_n
            minus = m.backwards[1, k] * back
            xy += plus + minus
            xy_t += order * 1j * (plus - minus)
            turn_n = turn_n * (turn4 if k == 1 else turn2)
    return ab, xy, ab_t, xy_t


@compiled
def _currents(m, turn, ab, xy, y):
    """Currents of a state, alpha-beta and x-y, if the magnets' flux is `ab` and `xy`. Along 2 t the
    inverse of L reflects."""
    rest = complex(y[0], y[1]) - ab
    i_ab = m.mean_per_H * rest + m.half_per_H * turn * turn * rest.conjugate()
    if saturates(m):
        i_ab += turn * excess_current(m, rest * turn.conjugate())
    return i_ab, m.xy_per_H * (complex(y[2], y[3]) - xy)


@compiled(inline="always")
def _cogging(m, theta):
    """Torque with which the magnets hold the shaft against the teeth."""
    return m.cogging_Nm * sin(m.cogging_per_rev * theta)


@compiled
def _torque(m, turn, rest, ab_t, xy_t, i_ab, i_xy, theta):
    """`rest`: the stator's flux without the magnets', alpha-beta."""
    frame = i_ab * turn.conjugate()
    torque = (
        i_ab.real * ab_t.real
        + i_ab.imag * ab_t.imag
        + i_xy.real * xy_t.real
        + i_xy.imag * xy_t.imag
    )
    if saturates(m):
        torque += rest.real * i_ab.imag - rest.imag * i_ab.real
    else:
        torque += m.saliency_H * frame.real * frame.imag
    return 3.0 * m.pole_pairs * torque - _cogging(m, theta)


@implements(machine.derivative, "magnet")
def derivative(m, load, y, v, k):
    """Write d y/dt into k[0:8] for stator voltages v[0:4]."""
    turn = _turn(m, y)
    ab, xy, ab_t, xy_t = _magnet_flux(m, turn)
    i_ab, i_xy = _currents(m, turn, ab, xy, y)
    for r in range(4):
        k[r] = v[r] - (
            m.resistance[r, 0] * i_ab.real
            + m.resistance[r, 1] * i_ab.imag
            + m.resistance[r, 2] * i_xy.real
            + m.resistance[r, 3] * i_xy.imag
        )
    k[4] = 0.0
    k[5] = 0.0
    rest = complex(y[0], y[1]) - ab
    torque = _torque(m, turn, rest, ab_t, xy_t, i_ab, i_xy, y[7])
    if m.iron != 0:
        torque -= iron_torque(m, y, y[6])
    k[6] = (torque - m.viscous * y[6] - load_torque(load, y[6])) / m.inertia
    k[7] = y[6]


@implements(machine.common_part, "magnet")
def common_part(m, y):
    """Currents, alpha-beta and x-y."""
    turn = _turn(m, y)
    ab, xy, _, _ = _magnet_flux(m, turn)
    return _currents(m, turn, ab, xy, y)


@implements(machine.current_with, "magnet")
def current_with(m, y, common, leg):
    return (
        m.i_phase[leg, 0] * common[0].real
        + m.i_phase[leg, 1] * common[0].imag
        + m.i_phase[leg, 2] * common[1].real
        + m.i_phase[leg, 3] * common[1].imag
    )


@implements(machine.constant_response, "magnet")
def constant_response(m):
    return m.half_per_H == 0.0 and not saturates(m)


@implements(machine.incremental, "magnet")
def incremental(m, y):
    """(exp(2 j t), the slopes that the rotation alone gives the currents, alpha-beta and x-y, and
    what saturation adds to the inverse of L: to its mean, and to what reflects along 2 t)."""
    turn = _turn(m, y)
    turn2 = turn * turn
    ab, _, ab_t, xy_t = _magnet_flux(m, turn)
    omega = m.pole_pairs * y[6]
    rest = complex(y[0], y[1]) - ab
    slope = (
        2j * m.half_per_H * turn2 * rest.conjugate()
        - m.mean_per_H * ab_t
        - m.half_per_H * turn2 * ab_t.conjugate()
    )
    mean, half = 0.0, 0j
    if saturates(m):
        at = rest * turn.conjugate()
        dd, dq, qq = excess_per_H(m, at)
        mean = 0.5 * (dd + qq)
        half = complex(0.5 * (dd - qq), dq)
        # The frame turns: what saturation adds turns with it, at the flux as the frame sees it.
        seen = -1j * at - ab_t * turn.conjugate()
        slope += turn * (1j * excess_current(m, at) + mean * seen + half * seen.conjugate())
    return turn2, omega * slope, -m.xy_per_H * omega * xy_t, mean, half * turn2


@implements(machine.phase_current_slope, "magnet")
def phase_current_slope(m, gain, k, leg):
    """d/dt of a phase current, A/s, for flux slopes k[0:6]; `gain` = incremental(m, y)."""
    rises = complex(k[0], k[1])
    ab = gain[1] + m.mean_per_H * rises + m.half_per_H * gain[0] * rises.conjugate()
    if saturates(m):
        ab += gain[3] * rises + gain[4] * rises.conjugate()
    xy = gain[2] + m.xy_per_H * complex(k[2], k[3])
    return (
        m.i_phase[leg, 0] * ab.real
        + m.i_phase[leg, 1] * ab.imag
        + m.i_phase[leg, 2] * xy.real
        + m.i_phase[leg, 3] * xy.imag
    )


@implements(machine.leg_response, "magnet")
def leg_response(m, gain, leg, other):
    """d/dt of a phase current per volt on leg `other`, 1/H; `gain` = incremental(m, y)."""
    volt = complex(m.legs[0, other], m.legs[1, other])
    ab = m.mean_per_H * volt + m.half_per_H * gain[0] * volt.conjugate()
    if saturates(m):
        ab += gain[3] * volt + gain[4] * volt.conjugate()
    return (
        m.i_phase[leg, 0] * ab.real
        + m.i_phase[leg, 1] * ab.imag
        + m.xy_per_H * (m.i_phase[leg, 2] * m.legs[2, other] + m.i_phase[leg, 3] * m.legs[3, other])
    )


@implements(machine.stator_currents, "magnet")
def stator_currents(m, y, i):
    """alpha, beta, x, y currents into i[0:4]."""
    i_ab, i_xy = common_part(m, y)
    i[0] = i_ab.real
    i[1] = i_ab.imag
    i[2] = i_xy.real
    i[3] = i_xy.imag


@implements(machine.torque_Nm, "magnet")
def torque_Nm(m, y, i):
    """Torque of the air gap, cogging included, from the state and the stator currents i[0:4]."""
    turn = _turn(m, y)
    ab, _, ab_t, xy_t = _magnet_flux(m, turn)
    rest = complex(y[0], y[1]) - ab
    return _torque(m, turn, rest, ab_t, xy_t, complex(i[0], i[1]), complex(i[2], i[3]), y[7])


@implements(machine.losses, "magnet")
def losses(m, y, drop):
    drop[0] = 0.0
    drop[1] = 0.0
    if m.iron != 0:
        return iron_torque(m, y, y[6]) * y[6]
    return 0.0


@implements(machine.coast, "magnet")
def coast(m, load, y, dt, most_V):
    """The magnets' flux turns with the shaft."""
    k0 = -(m.viscous * y[6] + load_torque(load, y[6]) + _cogging(m, y[7])) / m.inertia
    if m.iron != 0:
        k0 -= iron_torque(m, y, y[6]) / m.inertia
    end = y[6] + dt * k0
    # Heun's rule: the speed hardly changes within a step.
    theta = y[7] + dt * 0.5 * (y[6] + end)
    k1 = -(m.viscous * end + load_torque(load, end) + _cogging(m, theta)) / m.inertia
    if m.iron != 0:
        k1 -= iron_torque(m, y, end) / m.inertia
    end = y[6] + 0.5 * dt * (k0 + k1)
    if m.most_emf_Wb * m.pole_pairs * max(abs(y[6]), abs(end)) > most_V:
        return False
    y[7] += dt * 0.5 * (y[6] + end)
    y[6] = end
    ab, xy, _, _ = _magnet_flux(m, _turn(m, y))
    y[0] = ab.real
    y[1] = ab.imag
    y[2] = xy.real
    y[3] = xy.imag
    return True
