"""Two-level six-leg inverter: gate states and diodes to machine voltages.

A leg is HIGH or LOW while one switch is on. With both off (dead time, trip) the
current's sign decides: it flows through the lower diode when it leaves the leg,
through the upper one when it enters. A current that reaches zero while both
switches are off stays at zero: the leg floats until its voltage would drive a
diode into conduction. Switches and diodes are ideal, or drop a threshold voltage
and a resistance's voltage while they conduct.

A leg can break (`legs.KINDS`). While a switch stays off, its command leaves both switches
off. An open winding is off whatever the switches do: an arc carries its current on, against
the voltage `arc_V`, until the current reaches zero. After that its terminal takes any
voltage, because no diode is connected to it. A contact that parts slowly may let the arc strike
again: it withstands `arc_V` at first, and `restrike_V_per_s` more as time goes on.

The dc link is stiff, or a capacitor (`link.py`). Then `vdc` is the voltage of its source where
`advance` is called, and the link's own inside, anew in every Runge-Kutta stage.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .breaks import COMING
from .compiled import compiled, source_hash
from .elementary import tanh
from .junctions import JUNCTIONS, commutate, set_drops
from .legs import (
    BLOCKED,
    BREAK,
    DEVICE_KINDS,
    DROPS,
    HIGH,
    LOW,
    LOWER,
    LOWER_DIODE,
    LOWER_SWITCH,
    OFF,
    OPEN,
    UPPER,
    UPPER_DIODE,
    UPPER_SWITCH,
    WHOLE,
)
from .link import (
    LINK,
    LOCATED,
    accept_link,
    add_link_stage,
    begin_link,
    beyond_link,
    end_link,
    keep_link,
    longest_link_step_s,
    put_back_link,
    switch_link,
)
from .machine import (
    coast,
    common_part,
    constant_response,
    current_with,
    derivative,
    incremental,
    leg_response,
    phase_current,
    phase_current_slope,
    rk4_step,
)
from .meter import METER, accept_meter, add_powers, begin_meter
from .vsd import transform
from .wires import STRAIGHT

NO_LEG = -1

#: A floating leg's residual current decays with this time constant. It removes only the error
#: of the zero crossing's location.
FLOAT_S = 20e-6
#: Longest step while a leg is off. A diode that opens or closes within a step is noticed only at
#: the end of the step.
OFF_STEP_S = 5e-6
#: The same while only open windings are off, whose current has ended. There is nothing to notice,
#: but the step must be shorter than 2.78 times FLOAT_S to be stable.
OPEN_STEP_S = 20e-6
#: A zero crossing is located to this share of the current's change over the step.
ZERO = 1e-9
#: Most iterations of the secant rule for that. Two or three usually suffice.
MAX_SECANTS = 8
#: A current below this is zero except for rounding.
RESIDUAL_A = 1e-10

#: More steps than this in one call mean that time does not advance.
MAX_STEPS = 10_000

#: A floating leg's diode conducts this share of Vdc beyond the rail: above the rounding
#: of the floating legs' equations, so that the current then starts the right way.
FORWARD = 1e-8
#: Pull of floating legs to mid-bus, relative to their own admittance.
BALANCE = 1e-10

#: Across zero current a driven leg's drop goes from one device's threshold to the
#: other's over about this much. A junction's current is exponential in its voltage, so
#: the voltage fades with the current. A jump would let an explicit step chatter around
#: zero instead of coming to rest there.
KNEE_A = 10e-3
#: Drives of more than 25 A: the current sensors' range has so many knees. A larger device has a
#: larger junction; and a step of a 12-bit sensor is larger than a knee, so the controller does not
#: see it. With 10 mA a machine of 100 kW would need steps of 1 us.
KNEES = 2500
#: In units of the knee: beyond this current the threshold no longer depends on the current (4e-9 of
#: it is missing).
FAR = 10.0

#: Legs that are not whole, and what happens at an open contact.
CONTACT = np.dtype(
    [
        ("broken", "i8", (6,)),  # WHOLE, or what is broken; the `diode` of an open leg is its arc
        ("breaks", "i8"),  # number of legs that are not whole
        ("arc_V", "f8"),
        ("restrike_V_per_s", "f8"),  # 0: an arc that has ended does not strike again
        ("open_s", "f8", (6,)),  # for how long each leg has been broken
    ]
)
#: Switches and diodes while they conduct.
DEVICES = np.dtype(
    [
        ("drops", "i8"),  # 0: ideal devices
        ("v_V", "f8", (6, 4)),  # thresholds on each leg, in the order of DEVICE_KINDS
        ("r_ohm", "f8", (6, 4)),  # on-resistances
        ("knee_A", "f8"),
        ("steepest_ohm", "f8"),  # the largest slope of a drop, with its threshold's at the knee
        ("least_diode_V", "f8"),  # the lowest threshold of a diode
    ]
)
#: The equations of the legs that float.
FLOATING = np.dtype(
    [
        ("n", "i8"),  # how many,
        ("leg", "i8", (6,)),  # which,
        ("a", "f8", (6, 6)),  # their equations, factored,
        ("pivot", "i8", (6,)),  # the order of the rows,
        ("b", "f8", (6,)),  # the right side, then their voltages
    ]
)
#: What `keep` has saved.
KEPT = np.dtype(
    [("y", "f8", (8,)), ("diode", "i8", (6,)), ("open_s", "f8", (6,)), ("metered", "i8")]
)
#: `leg` and `diode` are the state. The other fields are constants and work space.
INVERTER = np.dtype(
    [
        ("leg", "i8", (6,)),  # LOW, HIGH or OFF
        ("diode", "i8", (6,)),  # off legs: +1 lower, -1 upper conducts, 0 floats
        ("off", "i8"),  # number of legs that are off
        ("command", "i8", (6,)),  # the state that the gate drivers command
        ("contact", CONTACT),
        ("coming", COMING),
        ("devices", DEVICES),
        ("link", LINK),
        ("junctions", JUNCTIONS),
        ("meter", METER),
        # For a record: what the shaft's brake holds, temperatures of the winding's hottest part
        # and of the frame.
        ("brake_Nm", "f8"),
        ("winding_degC", "f8"),
        ("frame_degC", "f8"),
        ("more", "i8"),  # whether a record has `loop.MORE_CHANNELS`
        ("transform", "f8", (4, 6)),  # leg voltages to alpha, beta, x, y: how the leads are
        ("star", "i8", (6,)),  # the star point behind each leg, 0 or 1
        ("v_leg", "f8", (6,)),  # leg voltages against the negative rail
        ("v", "f8", (4,)),  # alpha, beta, x, y voltages
        ("k", "f8", (8,)),
        ("no_v", "f8", (4,)),  # zeros
        ("k_no_v", "f8", (4,)),  # d flux/dt without a voltage
        ("z", "f8", (5, 8)),
        ("trial", "f8", (8,)),
        ("kept", KEPT),
        ("floating", FLOATING),
        ("i", "f8", (4,)),
    ]
)


def inverter_record(
    leads: Sequence[int] = STRAIGHT,
    /,
    arc_V: float = 0.0,
    restrike_V_per_ms: float = 0.0,
    range_A: float = 0.0,
    displacement_deg: float = 30.0,
    **others: float,
) -> np.record:
    """All legs off and whole, no current. `leads`: the machine's phase on each leg; `range_A`: the
    current sensors' range, which decides the knee; `displacement_deg`: of the winding's sets;
    `others`: any of DROPS and LINK_KEYS, otherwise zero."""
    inverter = np.zeros(1, INVERTER).view(np.recarray)[0]
    inverter.leg = inverter.command = OFF
    inverter.off = 6
    inverter.transform = transform(displacement_deg)[:, list(leads)]
    inverter.star = [phase % 2 for phase in leads]
    inverter.contact.arc_V = arc_V
    inverter.contact.restrike_V_per_s = 1e3 * restrike_V_per_ms
    inverter.devices.knee_A = max(KNEE_A, range_A / KNEES)
    drops = {name: others.pop(name, 0.0) for name in DROPS}
    for name, value in others.items():
        inverter.link[name] = value
    inverter.devices.drops = any(drops.values())
    v_V, r_ohm = ([drops[of.format(k)] for k in DEVICE_KINDS] for of in ("v_{}_V", "r_{}_ohm"))
    set_drops(inverter.devices, np.array(v_V), np.array(r_ohm))
    inverter.link.on = inverter.link.link_F > 0
    return inverter


@compiled
def in_effect(kind, command):
    """The state of a broken leg under a command."""
    if kind in (OPEN, BLOCKED):
        return OFF
    if (kind == UPPER and command == HIGH) or (kind == LOWER and command == LOW):
        return OFF
    return command


@compiled
def set_leg(inv, m, y, leg, state):
    """Change the state of one leg, or break it. When it turns off, the present current decides the
    diode. An arc burns in the direction of that current, too."""
    if state >= BREAK:
        kind = state - BREAK
        inv.contact.breaks += int(kind != WHOLE) - int(inv.contact.broken[leg] != WHOLE)
        inv.contact.broken[leg] = kind
        inv.contact.open_s[leg] = 0.0
        state = inv.command[leg]
    inv.command[leg] = state
    if inv.contact.breaks > 0:
        state = in_effect(inv.contact.broken[leg], state)
    if state == OFF and inv.leg[leg] != OFF:
        i = phase_current(m, y, leg)
        inv.diode[leg] = 1 if i > 0.0 else (-1 if i < 0.0 else 0)
    if inv.junctions.on != 0:
        commutate(inv, leg, inv.leg[leg], state, phase_current(m, y, leg))
    inv.off += int(state == OFF) - int(inv.leg[leg] == OFF)
    inv.leg[leg] = state


@compiled(inline="always")
def _transform(inv):
    for r in range(4):
        total = 0.0
        for leg in range(6):
            total += inv.transform[r, leg] * inv.v_leg[leg]
        inv.v[r] = total


@compiled
def _find_floating(inv, m, y):
    """List the floating legs, and factor the matrix of their equations if it is the same at any
    state. Returns whether there are any."""
    n = 0
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] == 0:
            inv.floating.leg[n] = leg
            n += 1
    inv.floating.n = n
    if n > 0 and constant_response(m):
        _factor(inv, m, y)
    return n > 0


@compiled
def _factor(inv, m, y):
    """LU factors of d i/dt of the floating legs per volt on them, with partial pivoting: U and the
    multipliers in `a`, and in `pivot` the row that came to each place."""
    a = inv.floating.a
    gain = incremental(m, y)
    n = inv.floating.n
    for r in range(n):
        leg = inv.floating.leg[r]
        for c in range(n):
            a[r, c] = leg_response(m, gain, leg, inv.floating.leg[c])
        a[r, r] += BALANCE * m.g_leg[leg, leg]
    for p in range(n):
        best = p
        for r in range(p + 1, n):
            if abs(a[r, p]) > abs(a[best, p]):
                best = r
        inv.floating.pivot[p] = best
        if best != p:
            for c in range(p, n):
                a[p, c], a[best, c] = a[best, c], a[p, c]
        for r in range(p + 1, n):
            f = a[r, p] / a[p, p]
            a[r, p] = f
            for c in range(p + 1, n):
                a[r, c] -= f * a[p, c]


@compiled
def _solve_floating(inv, m, load, y, vdc):
    """Leg voltages that keep the currents of the floating legs (`_find_floating`) at zero; with
    them, the machine's voltages `v` and d y/dt in `k`.

    d i/dt = G v_float + (rest) = -i/FLOAT_S for each floating leg. G is singular
    when a whole set floats (only differences matter), so a small diagonal term
    pulls such legs to mid-bus, as a balancing resistor would.
    """
    n = inv.floating.n
    for r in range(n):
        inv.v_leg[inv.floating.leg[r]] = 0.0
    _transform(inv)
    # A voltage adds to the slope of its flux and to nothing else.
    derivative(m, load, y, inv.no_v, inv.k)
    for r in range(4):
        inv.k_no_v[r] = inv.k[r]
        inv.k[r] += inv.v[r]
    a = inv.floating.a
    b = inv.floating.b
    gain = incremental(m, y)
    common = common_part(m, y)
    if not constant_response(m):
        _factor(inv, m, y)
    for r in range(n):
        leg = inv.floating.leg[r]
        slope = phase_current_slope(m, gain, inv.k, leg)
        epsilon = BALANCE * m.g_leg[leg, leg]
        b[r] = -slope - current_with(m, y, common, leg) / FLOAT_S + epsilon * 0.5 * vdc
    for p in range(n):
        best = inv.floating.pivot[p]
        b[p], b[best] = b[best], b[p]
        for r in range(p + 1, n):
            b[r] -= a[r, p] * b[p]
    for p in range(n - 1, -1, -1):
        total = b[p]
        for c in range(p + 1, n):
            total -= a[p, c] * b[c]
        b[p] = total / a[p, p]
    for r in range(n):
        inv.v_leg[inv.floating.leg[r]] = b[r]
    _centre(inv, vdc)
    _transform(inv)
    for r in range(4):
        inv.k[r] = inv.k_no_v[r] + inv.v[r]


@compiled
def _centre(inv, vdc):
    """Only voltage differences matter in a set that floats as a whole. Shift it so that its
    highest and its lowest leg reach the rails together, because two diodes conduct together. An
    open winding has no diodes."""
    for first in range(2):
        low = np.inf
        high = -np.inf
        for leg in range(6):
            if inv.star[leg] == first:
                if inv.leg[leg] != OFF or inv.diode[leg] != 0:
                    low = -np.inf
                if inv.contact.broken[leg] != OPEN:
                    low = min(low, inv.v_leg[leg])
                    high = max(high, inv.v_leg[leg])
        if low > -np.inf and low < np.inf:
            shift = 0.5 * (vdc - low - high)
            for leg in range(6):
                if inv.star[leg] == first:
                    inv.v_leg[leg] += shift


@compiled
def _subtract_drops(inv, m, y, vdc):
    """Voltages of all legs but the floating ones, which keep theirs, behind the devices
    that carry the currents of y: the upper switch drives current out of a HIGH leg and
    the upper diode takes current back, the lower two likewise."""
    common = common_part(m, y)
    for leg in range(6):
        state = inv.leg[leg]
        i = current_with(m, y, common, leg)
        arcs = inv.contact.broken[leg] == OPEN and inv.diode[leg] != 0
        if arcs:
            state = inv.command[leg]
        device = UPPER_DIODE
        inv.meter.drop_V[leg] = 0.0
        if state == OFF:
            if inv.diode[leg] > 0:
                device = LOWER_DIODE
                drop_V = inv.devices.v_V[leg, LOWER_DIODE]
                inv.v_leg[leg] = -drop_V - inv.devices.r_ohm[leg, LOWER_DIODE] * i
                inv.meter.drop_V[leg] = -inv.v_leg[leg]
            elif inv.diode[leg] < 0:
                drop_V = inv.devices.v_V[leg, UPPER_DIODE]
                inv.v_leg[leg] = vdc + drop_V - inv.devices.r_ohm[leg, UPPER_DIODE] * i
                inv.meter.drop_V[leg] = vdc - inv.v_leg[leg]
        else:
            rail = vdc if state == HIGH else 0.0
            # Beyond 20 times the knee the nearest number to the hyperbolic tangent is 1.
            share = (
                tanh(i / inv.devices.knee_A)
                if abs(i) < 20.0 * inv.devices.knee_A
                else np.copysign(1.0, i)
            )
            if state == HIGH:
                device = UPPER_SWITCH if i > 0.0 else UPPER_DIODE
            else:
                device = LOWER_DIODE if i > 0.0 else LOWER_SWITCH
            drop_V = inv.devices.v_V[leg, device] * share
            inv.v_leg[leg] = rail - drop_V - inv.devices.r_ohm[leg, device] * i
            inv.meter.drop_V[leg] = rail - inv.v_leg[leg]
        inv.meter.device[leg] = device
        if arcs:
            inv.v_leg[leg] -= inv.diode[leg] * inv.contact.arc_V


@compiled
def _at_rails(inv, vdc):
    """Voltages of all legs with ideal devices: their rails, and 0 where they float."""
    for leg in range(6):
        state = inv.leg[leg]
        if state == OFF:
            inv.v_leg[leg] = vdc if inv.diode[leg] < 0 else 0.0
            if inv.contact.broken[leg] == OPEN and inv.diode[leg] != 0:
                if inv.command[leg] != OFF:
                    inv.v_leg[leg] = vdc if inv.command[leg] == HIGH else 0.0
                inv.v_leg[leg] -= inv.diode[leg] * inv.contact.arc_V
        else:
            inv.v_leg[leg] = vdc if state == HIGH else 0.0


@compiled
def _taken_A(inv, m, y):
    """Current that the legs take from the positive rail."""
    common = common_part(m, y)
    total = 0.0
    for leg in range(6):
        state = inv.leg[leg]
        if state == OFF and inv.diode[leg] != 0:
            state = HIGH if inv.diode[leg] < 0 else LOW
            if inv.contact.broken[leg] == OPEN and inv.command[leg] != OFF:
                state = inv.command[leg]
        if state == HIGH:
            total += current_with(m, y, common, leg)
    return total


@compiled
def _step(inv, m, load, y, dt, vdc, floats, out):
    """One Runge-Kutta step from y to out with the present diodes. A drop follows the
    current, a floating leg's voltage the induced voltage and a capacitor's its charge, so every
    stage finds them anew. The capacitor's new state is the link's `trial`, and the meter's `total`
    has the powers of the step."""
    metered = inv.meter.on != 0
    if inv.devices.drops == 0 and inv.link.on == 0 and not floats and not metered:
        rk4_step(m, load, y, inv.v, dt, out, inv.k, inv.z)
        return
    total = inv.z[0]
    stage = inv.z[1]
    for r in range(8):
        total[r] = 0.0
        stage[r] = y[r]
    if inv.link.on != 0:
        begin_link(inv.link)
    if metered:
        begin_meter(inv.meter)
        inv.meter.share_s = dt / 6.0
    for n in range(4):
        if inv.link.on != 0:
            vdc = inv.link.stage[0]
            _at_rails(inv, vdc)
        if inv.devices.drops != 0:
            _subtract_drops(inv, m, stage, vdc)
        if floats:
            _solve_floating(inv, m, load, stage, vdc)
        else:
            _transform(inv)
            derivative(m, load, stage, inv.v, inv.k)
        weight = 2.0 if n == 1 or n == 2 else 1.0
        reach = dt if n == 2 else 0.5 * dt
        if inv.link.on != 0:
            add_link_stage(inv.link, _taken_A(inv, m, stage), weight, reach)
        if metered:
            add_powers(inv.meter, m, load, stage, weight)
        for r in range(8):
            total[r] += weight * inv.k[r]
            stage[r] = y[r] + reach * inv.k[r]
    if inv.link.on != 0:
        end_link(inv.link, dt)
    for r in range(8):
        out[r] = y[r] + dt / 6.0 * total[r]


@compiled
def longest_step_s(inv, m):
    """Longest stable and accurate step with conduction drops, s. Around zero current a threshold
    acts as a resistance of V / knee_A. The step is one time constant of this resistance with the
    smallest inductance that it can meet (the limit of stability is 2.78 time constants). Paper
    B's machine with 1.2 V: 120 us."""
    return 1.0 / (inv.devices.steepest_ohm * m.inv_l_max)


@compiled
def _far_from_zero(inv, m, before, after):
    """Whether every leg's current keeps its sign from one state to the other, far from zero."""
    far_A = FAR * inv.devices.knee_A
    common0 = common_part(m, before)
    common1 = common_part(m, after)
    for leg in range(6):
        i0 = current_with(m, before, common0, leg)
        i1 = current_with(m, after, common1, leg)
        if not ((i0 > far_A and i1 > far_A) or (i0 < -far_A and i1 < -far_A)):
            return False
    return True


@compiled(inline="always")
def _may_conduct(inv, leg):
    """Whether a floating leg's diode can open."""
    return inv.leg[leg] == OFF and inv.diode[leg] == 0 and inv.contact.broken[leg] != OPEN


@compiled
def _strike_again(inv, vdc):
    """Light the arc of each open leg whose terminal, which has no current, is further from its leg
    than the contact withstands. Returns whether there is one. The leg itself is at a rail, or
    anywhere between them while both switches are off."""
    struck = False
    for leg in range(6):
        if inv.contact.broken[leg] == OPEN and inv.leg[leg] == OFF and inv.diode[leg] == 0:
            state = inv.command[leg]
            highest = 0.0 if state == LOW else vdc
            lowest = vdc if state == HIGH else 0.0
            withstands_V = (
                inv.contact.arc_V
                + inv.contact.restrike_V_per_s * inv.contact.open_s[leg]
                + FORWARD * vdc
            )
            if inv.v_leg[leg] > highest + withstands_V:
                inv.diode[leg] = -1
                inv.v_leg[leg] = highest + inv.contact.arc_V
                struck = True
            elif inv.v_leg[leg] < lowest - withstands_V:
                inv.diode[leg] = 1
                inv.v_leg[leg] = lowest - inv.contact.arc_V
                struck = True
    return struck


@compiled
def _leg_voltages(inv, m, load, y, vdc):
    """Set the leg voltages. Returns True if any leg floats."""
    _at_rails(inv, vdc)
    if inv.devices.drops != 0:
        _subtract_drops(inv, m, y, vdc)
    floats = _find_floating(inv, m, y)
    if floats:
        _solve_floating(inv, m, load, y, vdc)
        turned_on = False
        for leg in range(6):
            if _may_conduct(inv, leg):
                upper_V = inv.devices.v_V[leg, UPPER_DIODE]
                lower_V = inv.devices.v_V[leg, LOWER_DIODE]
                if inv.v_leg[leg] > vdc + (upper_V + FORWARD * vdc):
                    inv.diode[leg] = -1
                    inv.v_leg[leg] = vdc + upper_V
                    turned_on = True
                elif inv.v_leg[leg] < -(lower_V + FORWARD * vdc):
                    inv.diode[leg] = 1
                    inv.v_leg[leg] = -lower_V
                    turned_on = True
        if inv.contact.restrike_V_per_s > 0.0 and _strike_again(inv, vdc):
            turned_on = True
        if turned_on:
            floats = _find_floating(inv, m, y)
            if floats:
                _solve_floating(inv, m, load, y, vdc)
    if not floats:
        _transform(inv)
    return floats


@compiled
def _end_lone_currents(inv, m, y):
    """A diode that conducts alone in its set has no current but rounding: the current would have
    no way back. Let its leg float, too, so that the machine can coast."""
    for star in range(2):
        last = NO_LEG
        ways = 0
        for leg in range(6):
            if inv.star[leg] == star and (inv.leg[leg] != OFF or inv.diode[leg] != 0):
                last = leg
                ways += 1
        if ways == 1 and inv.leg[last] == OFF and abs(phase_current(m, y, last)) < RESIDUAL_A:
            inv.diode[last] = 0


@compiled
def _currents_absent(inv):
    for leg in range(6):
        if inv.leg[leg] != OFF or inv.diode[leg] != 0:
            return False
    return True


@compiled
def _step_to_zero(inv, m, load, y, h, vdc, floats, leg):
    """Step from y to the instant within h at which the leg's current passes zero;
    `inv.trial`, on entry the state at h, becomes the state there. Returns the time taken."""
    trial = inv.trial[:]
    i0 = phase_current(m, y, leg)
    i1 = phase_current(m, trial, leg)
    if i0 * inv.diode[leg] <= 0.0:
        _step(inv, m, load, y, 0.0, vdc, floats, trial)
        return 0.0
    enough = ZERO * abs(i0 - i1)
    t0, t = 0.0, h
    for _ in range(MAX_SECANTS):
        t0, t = t, min(max(t - i1 * (t - t0) / (i1 - i0), 0.0), h)
        _step(inv, m, load, y, t, vdc, floats, trial)
        i0, i1 = i1, phase_current(m, trial, leg)
        if abs(i1) <= enough or i1 == i0:
            break
    return t


@compiled
def _first_crossing(inv, m, y, but):
    """The open leg, other than `but`, whose diode current passes zero first on a straight
    line from y to `inv.trial`, or NO_LEG."""
    found = NO_LEG
    first = 1.0
    common0 = common_part(m, y)
    common1 = common_part(m, inv.trial)
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] != 0 and leg != but:
            i0 = current_with(m, y, common0, leg) * inv.diode[leg]
            i1 = current_with(m, inv.trial, common1, leg) * inv.diode[leg]
            # A small residual of the wrong sign that does not grow is no crossing, nor is rounding.
            if i1 < min(0.0, i0) - RESIDUAL_A:
                share = max(i0 / (i0 - i1), 0.0)
                if found == NO_LEG or share < first:
                    found = leg
                    first = share
    return found


@compiled
def _beyond_V(inv, m, load, y, vdc):
    """How far the voltage of a floating leg is beyond the rail and its diode's threshold, for the
    leg where this is most. Negative if all are within."""
    if inv.devices.drops != 0:
        _subtract_drops(inv, m, y, vdc)
    _solve_floating(inv, m, load, y, vdc)
    most = -np.inf
    for leg in range(6):
        if _may_conduct(inv, leg):
            upper_V = inv.v_leg[leg] - vdc - inv.devices.v_V[leg, UPPER_DIODE]
            lower_V = -inv.v_leg[leg] - inv.devices.v_V[leg, LOWER_DIODE]
            most = max(most, lower_V, upper_V)
    return most


@compiled
def _locate(inv, m, load, y, h, vdc, floats, of_link, early, late, aim, near):
    """Step from y to where a voltage is `aim` beyond its threshold, give or take `near`: the link's
    (`of_link`), or a floating leg's. `early` is how far it is beyond `aim` at y, where it is not
    yet, `late` after a step of h. Returns the time taken, with `inv.trial` the state there.

    The secant rule between an instant before and one after. If the same end stays twice, the
    other one's weight is halved (the Illinois rule).
    """
    trial = inv.trial[:]
    t0, t1, t = 0.0, h, h
    side = 0
    for _ in range(MAX_SECANTS):
        t = t0 + (t1 - t0) * early / (early - late)
        _step(inv, m, load, y, t, vdc, floats, trial)
        if of_link:
            beyond = beyond_link(inv.link, inv.link.trial) - aim
        else:
            beyond = _beyond_V(inv, m, load, trial, vdc) - aim
        if abs(beyond) < near:
            break
        if beyond > 0.0:
            t1, late = t, beyond
            if side > 0:
                early *= 0.5
            side = 1
        else:
            t0, early = t, beyond
            if side < 0:
                late *= 0.5
            side = -1
    return t


@compiled
def _step_to_rail(inv, m, load, y, h, vdc):
    """If the voltage of a floating leg leaves the rails in a step of h from y to `inv.trial`: step
    to that instant instead, with `inv.trial` the state there. Returns the time taken.

    In dead times a leg's voltage leaves the rails at an edge. Near a broken leg it may do so at any
    time, and a diode that starts late would be an error that adds up. The instant is located beyond
    the margin at which `_leg_voltages` opens the diode, so that it does this at once.
    """
    margin = FORWARD * vdc
    late = _beyond_V(inv, m, load, inv.trial[:], vdc)
    if late <= 2.0 * margin:
        return h
    early = _beyond_V(inv, m, load, y, vdc)
    if early > 0.0:
        return h
    aim = 1.5 * margin
    floats = np.bool_(True)
    leg = np.bool_(False)
    return _locate(inv, m, load, y, h, vdc, floats, leg, early - aim, late - aim, aim, 0.5 * margin)


@compiled
def _only_open(inv):
    """Whether all legs that are off are open windings without a current."""
    for leg in range(6):
        if inv.leg[leg] == OFF and (inv.contact.broken[leg] != OPEN or inv.diode[leg] != 0):
            return False
    return True


@compiled
def _step_to_switching(inv, m, load, y, h, vdc, floats):
    """If the link's diode or chopper change in a step of h from y to `inv.trial`: step to just
    beyond that instant instead. Returns the time taken."""
    late = beyond_link(inv.link, inv.link.trial)
    if late <= 2.0 * LOCATED:
        return h
    early = beyond_link(inv.link, inv.link.x) - LOCATED
    if early > 0.0:  # before the link's first step, or its source has jumped
        return h
    link = np.bool_(True)
    return _locate(
        inv, m, load, y, h, vdc, floats, link, early, late - LOCATED, LOCATED, 0.5 * LOCATED
    )


@compiled
def _advance_link_alone(inv, dt, longest):
    """Advance the link while no leg has a current. Steps are halved until they end where diode or
    chopper change."""
    left = dt
    taken = longest
    guard = 0
    while left > 1e-15:
        guard += 1
        if guard > MAX_STEPS:
            raise ArithmeticError("inverter: diodes chatter, time does not advance")
        switch_link(inv.link)
        taken = min(left, longest, 2.0 * taken)
        for _ in range(40):
            begin_link(inv.link)
            for n in range(4):
                weight = 2.0 if n == 1 or n == 2 else 1.0
                add_link_stage(inv.link, 0.0, weight, taken if n == 2 else 0.5 * taken)
            end_link(inv.link, taken)
            if beyond_link(inv.link, inv.link.trial) <= 2.0 * LOCATED:
                break
            taken *= 0.5
        accept_link(inv.link)
        left -= taken


@compiled
def _advance_in_parts(inv, m, load, y, dt, source_V):
    """Advance with at least one leg off, or with a capacitor as the link."""
    vdc = source_V
    linked = inv.link.on != 0
    if linked:
        vdc = inv.link.x[0]
    if inv.off >= 3:
        _end_lone_currents(inv, m, y)
    metered = inv.meter.on != 0
    absent = inv.off == 6 and _currents_absent(inv)
    if absent and metered:
        begin_meter(inv.meter)
        inv.meter.share_s = 0.5 * dt
        add_powers(inv.meter, m, load, y, 1.0)
    if absent and coast(m, load, y, dt, vdc + 2.0 * inv.devices.least_diode_V):
        if metered:
            add_powers(inv.meter, m, load, y, 1.0)
            accept_meter(inv.meter)
        if linked:
            _advance_link_alone(inv, dt, longest_link_step_s(inv.link, m))
        return
    trial = inv.trial[:]
    none = np.int64(NO_LEG)
    left = dt
    usual = OFF_STEP_S if inv.off > 0 else dt
    if inv.contact.breaks > 0 and inv.contact.restrike_V_per_s == 0.0 and _only_open(inv):
        usual = OPEN_STEP_S
    if inv.devices.drops != 0:
        usual = min(usual, longest_step_s(inv, m))
    if linked:
        usual = min(usual, longest_link_step_s(inv.link, m))
    longest = usual
    guard = 0
    while left > 1e-15:
        guard += 1
        if guard > MAX_STEPS:
            raise ArithmeticError("inverter: diodes chatter, time does not advance")
        if linked:
            switch_link(inv.link)
            vdc = inv.link.x[0]
        floats = _leg_voltages(inv, m, load, y, vdc)
        taken = left if left < longest else longest
        _step(inv, m, load, y, taken, vdc, floats, trial)
        crossing = none
        # Currents are not exactly straight lines: when the current that seemed to be the first
        # passes zero, another may already have done so.
        for _ in range(6):
            earlier = _first_crossing(inv, m, y, crossing)
            if earlier == NO_LEG:
                break
            crossing = earlier
            taken = _step_to_zero(inv, m, load, y, taken, vdc, floats, crossing)
        if inv.contact.breaks > 0 and floats:
            earliest = _step_to_rail(inv, m, load, y, taken, vdc)
            if earliest < taken:
                taken = earliest
                crossing = none
        if linked:
            earliest = _step_to_switching(inv, m, load, y, taken, vdc, floats)
            if earliest < taken:
                taken = earliest
                crossing = none
            accept_link(inv.link)
        if metered:
            accept_meter(inv.meter)
        for r in range(8):
            y[r] = trial[r]
        for leg in range(6):
            inv.contact.open_s[leg] += taken
        left -= taken
        if crossing == NO_LEG:
            longest = usual
        else:
            inv.diode[crossing] = 0
            # The voltage may be beyond the rail now and within it at the end of the step. Take
            # shorter steps until the diode's current starts.
            longest = 0.5 * longest if taken < 1e-12 else usual


@compiled
def keep(inv, y):
    """Save the state and the diodes for `put_back`. Until then the meter rests."""
    for r in range(8):
        inv.kept.y[r] = y[r]
    if inv.off > 0:
        for leg in range(6):
            inv.kept.diode[leg] = inv.diode[leg]
            inv.kept.open_s[leg] = inv.contact.open_s[leg]
    if inv.link.on != 0:
        keep_link(inv.link)
    inv.kept.metered = inv.meter.on
    inv.meter.on = 0


@compiled
def put_back(inv, y):
    for r in range(8):
        y[r] = inv.kept.y[r]
    if inv.off > 0:
        for leg in range(6):
            inv.diode[leg] = inv.kept.diode[leg]
            inv.contact.open_s[leg] = inv.kept.open_s[leg]
    if inv.link.on != 0:
        put_back_link(inv.link)
    inv.meter.on = inv.kept.metered


@compiled
def to_rails(inv, vdc):
    """Set the machine's voltages `v` while every leg is driven by ideal devices."""
    for leg in range(6):
        inv.v_leg[leg] = vdc if inv.leg[leg] == HIGH else 0.0
    _transform(inv)


def _compile_advance(source: int):
    """Make `advance`, which numba keeps on disk (`source_hash`). The loop is not the only function
    that calls it, and it takes most of the time that they take to compile."""

    @compiled(cache=True)
    def advance(inv, m, load, y, dt, vdc):
        """Advance the drive by dt with constant leg states; `vdc`: of the link, or of the source
        if the link is a capacitor.

        One Runge-Kutta step suffices while every leg is driven, because the callers step from edge
        to edge, far below the machine's time constants. With drops, their slope at zero current
        decides the number of steps, unless all currents stay far from zero.
        """
        if not source:
            return
        if inv.link.on != 0:
            inv.link.source_V = vdc
        if inv.off > 0 or inv.link.on != 0:
            _advance_in_parts(inv, m, load, y, dt, vdc)
            return
        metered = inv.meter.on != 0
        trial = inv.trial[:]
        floats = np.bool_(False)
        if inv.devices.drops != 0:
            steps = int(np.ceil(dt / longest_step_s(inv, m)))
            if steps > 1 and _far_from_zero(inv, m, y, y):
                _step(inv, m, load, y, dt, vdc, floats, trial)
                if _far_from_zero(inv, m, y, trial):
                    for r in range(8):
                        y[r] = trial[r]
                    if metered:
                        accept_meter(inv.meter)
                    return
            for _ in range(steps):
                _step(inv, m, load, y, dt / steps, vdc, floats, y)
                if metered:
                    accept_meter(inv.meter)
            return
        to_rails(inv, vdc)
        if metered:
            _step(inv, m, load, y, dt, vdc, floats, y)
            accept_meter(inv.meter)
            return
        rk4_step(m, load, y, inv.v, dt, y, inv.k, inv.z)

    return advance


advance = _compile_advance(source_hash())
