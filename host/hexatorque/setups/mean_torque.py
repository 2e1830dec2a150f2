"""The mean torque that a switching table holds, beside its reference.

The comparators keep the torque within bands that lie on one side of the reference, and one period
moves it further up than down, or further down than up. The mean of such a saw is not the reference.
By how much it is off follows from the firmware's own law, which is followed here period by period
on an ideal machine: one voltage a period, nothing between the law and the flux but the shortest
pulse, constant speed.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .design import rad_s
from .short_pulses import Made, Words

if TYPE_CHECKING:
    from ..firmware import Controller
    from .design import Design

#: Periods that are averaged: at least so many, and so many turns of the flux, but not more than
#: the last. The twelve directions repeat themselves in each twelfth of a turn.
LEAST, TURNS, MOST = 1200, 1.0, 4000
#: Periods in which the reference follows the load that the mean torque must hold, as under a speed
#: loop; time constants of that, and sigma L_r/R_r of the rotor, before the mean is taken.
FOLLOW = 100
SETTLE, SETTLE_MOST = 5, 2000


@dataclass(frozen=True)
class Held:
    """Mean torque less reference, negative if less is held than asked, and the reference; N m.
    words: what the law asked for in each period; vectors: the voltage of each state word."""

    error_Nm: float
    asked_Nm: float
    words: Sequence[Words] = ()
    vectors: Sequence[complex] = ()

    @property
    def error_pct(self) -> float:
        """The error in % of the reference; NaN without one."""
        return 100 * self.error_Nm / abs(self.asked_Nm) if self.asked_Nm else math.nan


def held(d: Design, controller: Controller, speed_rpm: float, load_Nm: float) -> Held:
    """The mean torque of the controller's switching table with the reference that holds this load
    at this speed."""
    seen, words, vectors = _followed(d, controller, speed_rpm, load_Nm)
    torque_Nm, asked_Nm = (sum(values) / len(seen) for values in zip(*seen))
    error_Nm = torque_Nm - asked_Nm
    return Held(-error_Nm if asked_Nm < 0 else error_Nm, asked_Nm, words, vectors)


def flux_at_Wb(d: Design, reach_pu: float, speed_rpm: float, torque_Nm: float) -> float:
    """The flux reference at this speed: weakened if the voltage does not reach it."""
    turning = d.machine.pole_pairs * rad_s(abs(speed_rpm)) + d.slip_rad_s(torque_Nm)
    if d.parameter("field_weakening") != "on" or turning == 0:
        return d.flux_Wb
    usable_V = d.parameter("fw_margin") * d.reach_pu(reach_pu, by_table=True) * d.vdc_V
    room_V = max(0.1 * usable_V, usable_V - d.machine.rs_ohm * d.current_A(torque_Nm))
    return min(d.flux_Wb, room_V / turning)


def _followed(
    d: Design, c: Controller, speed_rpm: float, torque_Nm: float
) -> tuple[list[tuple[float, float]], list[Words], list[complex]]:
    """Torque and reference at the control instants, once they have settled, and the law's words;
    each word's voltage. torque_Nm: the load."""
    from ..firmware import ffi, lib

    m, ts, vdc_V = d.machine, d.period_s, d.vdc_V
    law = ffi.addressof(c.drive.config.control, "table_law")
    row = lib.ht_scheme_describe(c.drive.config.control.scheme)
    flux_Wb = flux_at_Wb(d, row.reach_pu, speed_rpm, torque_Nm)
    late = d.setup["timing.latency"] == "shadow"

    state = ffi.new("ht_table_law_state *")
    lib.ht_table_law_reset(state)
    decided, psi_xy = ffi.new("ht_estimate *"), ffi.new("ht_xy *")
    seen, v_xy, words = ffi.new("ht_vector_law_input *"), ffi.new("ht_xy *"), ffi.new("uint16_t[3]")
    seen.decided, seen.psi_xy_Wb = decided, psi_xy
    seen.only_v0 = c.drive.config.control.only_v0
    seen.flux_ref_Wb = flux_Wb
    winding = c.drive.config.control.observer.winding
    turned = [lib.ht_vsd_turned(winding, v) if winding else v for v in lib.ht_vector]
    vectors = [
        (vdc_V * complex(v.ab.alpha, v.ab.beta), vdc_V * complex(v.xy.x, v.xy.y)) for v in turned
    ]
    made = Made(ffi.addressof(c.drive.config.control, "period"))
    sector_of = lib.ht_sector_of_six if winding else lib.ht_sector

    kr = m.lm_H / m.lr_H
    gain = 3 * m.pole_pairs
    # The current of the circle diagram at this torque and flux.
    radius_A = 0.5 * flux_Wb / m.ls_H * (1 / d.sigma - 1)
    across_A = torque_Nm / (gain * flux_Wb)
    across_A = max(-radius_A, min(radius_A, across_A))
    along_A = flux_Wb / m.ls_H + radius_A - math.sqrt(radius_A**2 - across_A**2)
    psi = complex(flux_Wb)
    rotor = (psi - m.sigma_ls_H * complex(along_A, across_A)) / kr
    turn = cmath.exp(1j * m.pole_pairs * rad_s(speed_rpm) * ts)
    xy = 0j
    coming = (0j, 0j)
    before = 0

    omega = abs(m.pole_pairs * rad_s(speed_rpm)) + d.slip_rad_s(torque_Nm)
    turns = math.ceil(TURNS * 2 * math.pi / (omega * ts)) if omega > 0 else MOST
    count = min(MOST, max(LEAST, turns))
    settle = min(SETTLE_MOST, round(SETTLE * max(d.sigma * d.rotor_s / ts, FOLLOW)))
    asked_Nm = torque_Nm
    found: list[tuple[float, float]] = []
    decided_on: list[Words] = []
    for n in range(settle + count):
        current = (psi - kr * rotor) / m.sigma_ls_H
        t_Nm = gain * (psi.real * current.imag - psi.imag * current.real)
        if n >= settle:
            found.append((t_Nm, asked_Nm))
        asked_Nm += (torque_Nm - t_Nm) / FOLLOW
        seen.torque_ref_Nm = asked_Nm
        decided.psi_Wb.alpha, decided.psi_Wb.beta = psi.real, psi.imag
        decided.torque_Nm = t_Nm
        psi_xy.x, psi_xy.y = xy.real, xy.imag
        seen.i_xy_A.x, seen.i_xy_A.y = xy.real / m.lxy_H, xy.imag / m.lxy_H
        seen.sector = sector_of(decided.psi_Wb)
        seen.before = before
        at = lib.ht_table_law_step(law, state, seen, v_xy, words)
        wanted = (tuple(words), (at.t1, at.t2 - at.t1, 1 - at.t2))
        if n >= settle:
            decided_on.append(wanted)
        lasting, parts = made(*wanted)
        before = lasting[2]
        decision = (
            sum(share * vectors[word][0] for share, word in zip(parts, lasting)),
            sum(share * vectors[word][1] for share, word in zip(parts, lasting)),
        )
        (v, v_of_xy), coming = (coming, decision) if late else (decision, decision)
        psi += ts * (v - m.rs_ohm * current)
        rotor = turn * (rotor + ts * m.rr_ohm / m.lr_H * (m.lm_H * current - rotor))
        xy += ts * (v_of_xy - m.rs_ohm / m.lxy_H * xy)
    return found, decided_on, [v for v, _ in vectors]
