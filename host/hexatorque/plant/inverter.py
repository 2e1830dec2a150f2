"""Two-level six-leg inverter: gate states and diodes to machine voltages.

A leg is HIGH or LOW while one switch is on. With both off (dead time, trip) the
current's sign decides: it flows through the lower diode when it leaves the leg,
through the upper one when it enters. A current that reaches zero while both
switches are off stays at zero: the leg floats until its voltage would drive a
diode into conduction. Switches and diodes are ideal, or drop a threshold voltage
and a resistance's voltage while they conduct.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .compiled import compiled
from .legs import HIGH, OFF
from .machine import (
    coast,
    derivative,
    incremental,
    leg_response,
    phase_current,
    phase_current_slope,
    rk4_step,
)
from .record import names_of, record
from .vsd import TRANSFORM
from .wires import STRAIGHT

NO_LEG = -1

#: A floating leg's residual current decays with this time constant. It removes only the error
#: of the zero crossing's location.
FLOAT_S = 20e-6
#: Longest step while a leg is off. A diode that opens or closes within a step is noticed only at
#: the end of the step.
OFF_STEP_S = 5e-6
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

#: `leg` and `diode` are the state. The other fields are constants and work space.
INVERTER = np.dtype(
    [
        ("leg", "i8", (6,)),  # LOW, HIGH or OFF
        ("diode", "i8", (6,)),  # off legs: +1 lower, -1 upper conducts, 0 floats
        ("off", "i8"),  # number of legs that are off
        ("drops", "i8"),  # 0: ideal devices
        ("v_switch_V", "f8"),  # thresholds
        ("v_diode_V", "f8"),
        ("r_switch_ohm", "f8"),  # on-resistances
        ("r_diode_ohm", "f8"),
        ("transform", "f8", (4, 6)),  # leg voltages to alpha, beta, x, y: how the leads are
        ("star", "i8", (6,)),  # the star point behind each leg, 0 or 1
        ("v_leg", "f8", (6,)),  # leg voltages against the negative rail
        ("v", "f8", (4,)),  # alpha, beta, x, y voltages
        ("k", "f8", (8,)),
        ("z", "f8", (2, 8)),
        ("trial", "f8", (8,)),
        ("kept", "f8", (8,)),  # the state that `keep` has saved
        ("kept_diode", "i8", (6,)),  # the diodes that `keep` has saved
        ("a", "f8", (6, 7)),  # floating-leg equations
        ("i", "f8", (4,)),
    ]
)


#: Conduction drops, as `inverter_record` and the set-up's section name them.
DROPS = ("v_switch_V", "v_diode_V", "r_switch_ohm", "r_diode_ohm")


def inverter_record(leads: Sequence[int] = STRAIGHT, /, **drops: float) -> np.record:
    """All legs off, no current. `leads`: the machine's phase on each leg; `drops`: any of DROPS,
    otherwise zero."""
    zeros = {name: 0 for name in names_of(INVERTER)}
    start = {
        "leg": OFF,
        "off": 6,
        "drops": any(drops.values()),
        "transform": TRANSFORM[:, list(leads)],
        "star": [phase % 2 for phase in leads],
    }
    return record(INVERTER, **{**zeros, **start, **drops})


@compiled
def set_leg(inv, m, y, leg, state):
    """Change the state of one leg. When it turns off, the present current decides the diode."""
    if state == OFF and inv.leg[leg] != OFF:
        i = phase_current(m, y, leg)
        inv.diode[leg] = 1 if i > 0.0 else (-1 if i < 0.0 else 0)
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
def _solve_floating(inv, m, load, y, vdc):
    """Leg voltages that keep the floating legs' currents at zero.

    d i/dt = G v_float + (rest) = -i/FLOAT_S for each floating leg. G is singular
    when a whole set floats (only differences matter), so a small diagonal term
    pulls such legs to mid-bus, as a balancing resistor would.
    """
    a = inv.a
    n = 0
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] == 0:
            inv.v_leg[leg] = 0.0
            n += 1
    _transform(inv)
    derivative(m, load, y, inv.v, inv.k)
    gain = incremental(m, y)
    row = 0
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] == 0:
            slope = phase_current_slope(m, gain, inv.k, leg)
            col = 0
            for other in range(6):
                if inv.leg[other] == OFF and inv.diode[other] == 0:
                    a[row, col] = leg_response(m, gain, leg, other)
                    col += 1
            epsilon = BALANCE * m.g_leg[leg, leg]
            a[row, row] += epsilon
            a[row, n] = -slope - phase_current(m, y, leg) / FLOAT_S + epsilon * 0.5 * vdc
            row += 1
    # Gauss with partial pivoting, n <= 6.
    for p in range(n):
        best = p
        for r in range(p + 1, n):
            if abs(a[r, p]) > abs(a[best, p]):
                best = r
        if best != p:
            for c in range(p, n + 1):
                a[p, c], a[best, c] = a[best, c], a[p, c]
        for r in range(p + 1, n):
            f = a[r, p] / a[p, p]
            for c in range(p, n + 1):
                a[r, c] -= f * a[p, c]
    for p in range(n - 1, -1, -1):
        total = a[p, n]
        for c in range(p + 1, n):
            total -= a[p, c] * a[c, n]
        a[p, n] = total / a[p, p]
    row = 0
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] == 0:
            inv.v_leg[leg] = a[row, n]
            row += 1
    _centre(inv, vdc)


@compiled
def _centre(inv, vdc):
    """Only voltage differences matter in a set that floats as a whole. Shift it so that its
    highest and its lowest leg reach the rails together, because two diodes conduct together."""
    for first in range(2):
        low = np.inf
        high = -np.inf
        for leg in range(6):
            if inv.star[leg] == first:
                if inv.leg[leg] != OFF or inv.diode[leg] != 0:
                    low = -np.inf
                low = min(low, inv.v_leg[leg])
                high = max(high, inv.v_leg[leg])
        if low > -np.inf:
            shift = 0.5 * (vdc - low - high)
            for leg in range(6):
                if inv.star[leg] == first:
                    inv.v_leg[leg] += shift


@compiled
def _subtract_drops(inv, m, y, vdc):
    """Voltages of all legs but the floating ones, which keep theirs, behind the devices
    that carry the currents of y: the upper switch drives current out of a HIGH leg and
    the upper diode takes current back, the lower two likewise."""
    for leg in range(6):
        state = inv.leg[leg]
        i = phase_current(m, y, leg)
        if state == OFF:
            if inv.diode[leg] > 0:
                inv.v_leg[leg] = -inv.v_diode_V - inv.r_diode_ohm * i
            elif inv.diode[leg] < 0:
                inv.v_leg[leg] = vdc + inv.v_diode_V - inv.r_diode_ohm * i
        else:
            rail = vdc if state == HIGH else 0.0
            share = np.tanh(i / KNEE_A)
            if (i > 0.0) == (state == HIGH):
                inv.v_leg[leg] = rail - inv.v_switch_V * share - inv.r_switch_ohm * i
            else:
                inv.v_leg[leg] = rail - inv.v_diode_V * share - inv.r_diode_ohm * i


@compiled
def _step(inv, m, load, y, dt, vdc, floats, out):
    """One Runge-Kutta step from y to out with the present diodes. A drop follows the
    current and a floating leg's voltage the induced voltage, so every stage finds
    them anew."""
    if inv.drops == 0 and not floats:
        rk4_step(m, load, y, inv.v, dt, out, inv.k, inv.z)
        return
    total = inv.z[0]
    stage = inv.z[1]
    for r in range(8):
        total[r] = 0.0
        stage[r] = y[r]
    for n in range(4):
        if inv.drops != 0:
            _subtract_drops(inv, m, stage, vdc)
        if floats:
            _solve_floating(inv, m, load, stage, vdc)
        _transform(inv)
        derivative(m, load, stage, inv.v, inv.k)
        weight = 2.0 if n == 1 or n == 2 else 1.0
        reach = dt if n == 2 else 0.5 * dt
        for r in range(8):
            total[r] += weight * inv.k[r]
            stage[r] = y[r] + reach * inv.k[r]
    for r in range(8):
        out[r] = y[r] + dt / 6.0 * total[r]


@compiled
def longest_step_s(inv, m):
    """Longest stable and accurate step with conduction drops, s. Around zero current a threshold
    acts as a resistance of V / KNEE_A. The step is one time constant of this resistance with the
    smallest inductance that it can meet (the limit of stability is 2.78 time constants). Paper
    B's machine with 1.2 V: 120 us."""
    r_switch = inv.v_switch_V / KNEE_A + inv.r_switch_ohm
    r_diode = inv.v_diode_V / KNEE_A + inv.r_diode_ohm
    return 1.0 / (max(r_switch, r_diode) * m.inv_l_max)


@compiled
def _leg_voltages(inv, m, load, y, vdc):
    """Set the leg voltages. Returns True if any leg floats."""
    floats = False
    for leg in range(6):
        state = inv.leg[leg]
        if state == OFF:
            if inv.diode[leg] == 0:
                floats = True
            inv.v_leg[leg] = vdc if inv.diode[leg] < 0 else 0.0
        else:
            inv.v_leg[leg] = vdc if state == HIGH else 0.0
    if inv.drops != 0:
        _subtract_drops(inv, m, y, vdc)
    if floats:
        _solve_floating(inv, m, load, y, vdc)
        margin = inv.v_diode_V + FORWARD * vdc
        turned_on = False
        for leg in range(6):
            if inv.leg[leg] == OFF and inv.diode[leg] == 0:
                if inv.v_leg[leg] > vdc + margin:
                    inv.diode[leg] = -1
                    inv.v_leg[leg] = vdc + inv.v_diode_V
                    turned_on = True
                elif inv.v_leg[leg] < -margin:
                    inv.diode[leg] = 1
                    inv.v_leg[leg] = -inv.v_diode_V
                    turned_on = True
        if turned_on:
            _solve_floating(inv, m, load, y, vdc)
    _transform(inv)
    return floats


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
    i0 = phase_current(m, y, leg)
    i1 = phase_current(m, inv.trial, leg)
    if i0 * inv.diode[leg] <= 0.0:
        for r in range(8):
            inv.trial[r] = y[r]
        return 0.0
    enough = ZERO * abs(i0 - i1)
    t0, t = 0.0, h
    for _ in range(MAX_SECANTS):
        t0, t = t, min(max(t - i1 * (t - t0) / (i1 - i0), 0.0), h)
        _step(inv, m, load, y, t, vdc, floats, inv.trial)
        i0, i1 = i1, phase_current(m, inv.trial, leg)
        if abs(i1) <= enough or i1 == i0:
            break
    return t


@compiled
def _first_crossing(inv, m, y, but):
    """The open leg, other than `but`, whose diode current passes zero first on a straight
    line from y to `inv.trial`, or NO_LEG."""
    found = NO_LEG
    first = 1.0
    for leg in range(6):
        if inv.leg[leg] == OFF and inv.diode[leg] != 0 and leg != but:
            i0 = phase_current(m, y, leg) * inv.diode[leg]
            i1 = phase_current(m, inv.trial, leg) * inv.diode[leg]
            # A small residual of the wrong sign that shrinks is no crossing, nor is rounding.
            if i1 < min(-RESIDUAL_A, i0):
                share = max(i0 / (i0 - i1), 0.0)
                if found == NO_LEG or share < first:
                    found = leg
                    first = share
    return found


@compiled
def _advance_off(inv, m, load, y, dt, vdc):
    """Advance with at least one leg off."""
    if _currents_absent(inv) and coast(m, load, y, dt, vdc + 2.0 * inv.v_diode_V):
        return
    left = dt
    usual = OFF_STEP_S if inv.drops == 0 else min(OFF_STEP_S, longest_step_s(inv, m))
    longest = usual
    guard = 0
    while left > 1e-15:
        guard += 1
        if guard > MAX_STEPS:
            raise ArithmeticError("inverter: diodes chatter, time does not advance")
        floats = _leg_voltages(inv, m, load, y, vdc)
        taken = left if left < longest else longest
        _step(inv, m, load, y, taken, vdc, floats, inv.trial)
        crossing = NO_LEG
        # Currents are not exactly straight lines: when the current that seemed to be the first
        # passes zero, another may already have done so.
        for _ in range(6):
            earlier = _first_crossing(inv, m, y, crossing)
            if earlier == NO_LEG:
                break
            crossing = earlier
            taken = _step_to_zero(inv, m, load, y, taken, vdc, floats, crossing)
        for r in range(8):
            y[r] = inv.trial[r]
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
    """Save the state and the diodes for `put_back`."""
    for r in range(8):
        inv.kept[r] = y[r]
    if inv.off > 0:
        for leg in range(6):
            inv.kept_diode[leg] = inv.diode[leg]


@compiled
def put_back(inv, y):
    for r in range(8):
        y[r] = inv.kept[r]
    if inv.off > 0:
        for leg in range(6):
            inv.diode[leg] = inv.kept_diode[leg]


@compiled
def advance(inv, m, load, y, dt, vdc):
    """Advance the drive by dt with constant leg states.

    One Runge-Kutta step suffices while every leg is driven, because the callers step from edge to
    edge, far below the machine's time constants. With drops, their slope at zero current decides
    the number of steps.
    """
    if inv.off > 0:
        _advance_off(inv, m, load, y, dt, vdc)
        return
    if inv.drops != 0:
        steps = int(np.ceil(dt / longest_step_s(inv, m)))
        for _ in range(steps):
            _step(inv, m, load, y, dt / steps, vdc, False, y)
        return
    for leg in range(6):
        inv.v_leg[leg] = vdc if inv.leg[leg] == HIGH else 0.0
    _transform(inv)
    rk4_step(m, load, y, inv.v, dt, y, inv.k, inv.z)
