"""The dc link: a capacitor between the source and the inverter's legs, and a braking chopper.

The source has a resistance, an inductance, and a diode, so that it takes no energy back:

    C dv/dt = i_source - i_drive - (v/R_chopper while the chopper is on)
    L di_source/dt = v_source - v - R i_source      while the diode conducts

Without an inductance i_source is (v_source - v)/R while that is positive. The diode, and the
chopper between its two levels, change at instants that the integration locates (`inverter.py`).
The energies that flow are integrated beside the voltage, with the same steps.

With a line's frequency the source is a six-pulse rectifier with ideal diodes behind three lines
that have this resistance and inductance each. v_source is the rectifier's mean voltage
without a current, 3/pi of the line-to-line voltage's peak. While the lines of a set S conduct, at
the rail u_k = v (upper diode) or 0 (lower):

    L di_k/dt = e_k - R i_k - u_k - n,    n = mean over S of (e_k - u_k)

Three lines conduct while one takes over from another, else two or none. A line begins to conduct
where its voltage is beyond a rail, u_k + n, and ends where its current is zero.

A precharge resistor between source and capacitor adds to the source's until a relay bridges it.
Then the capacitor is empty at the beginning.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled
from .elementary import cos
from .pins import PIN
from .rectifier import LINE_PEAK

#: State: voltage, source current, and the energies that the source has given, that its resistance
#: and the chopper have turned into heat, and that the legs have taken. The source's resistance
#: includes the precharge resistor.
V, I_SOURCE, SOURCE_J, RESISTANCE_J, CHOPPER_J, DRIVE_J = range(6)
#: The state of a link with a rectifier goes on: angle of the lines, and their currents.
LINE_RAD, LINE_A, STATES = 6, 7, 10

LINK = np.dtype(
    [
        ("on", "i8"),  # 0: a stiff link, which has the source's voltage
        ("link_F", "f8"),
        ("source_ohm", "f8"),
        ("source_H", "f8"),
        ("line_Hz", "f8"),  # 0: a direct source
        ("precharge_ohm", "f8"),  # 0: there is none
        ("chopper_ohm", "f8"),  # 0: there is none
        ("chopper_on_V", "f8"),
        ("chopper_off_V", "f8"),
        ("source_V", "f8"),
        ("feeds", "i8"),  # whether the source's diode conducts
        ("conducts", "i8", (3,)),  # lines: +1 the upper diode conducts, -1 the lower, 0 neither
        ("bridged", "i8"),  # whether the relay bridges the precharge resistor
        ("relay", PIN),
        ("chops", "i8"),  # whether the chopper is on
        ("chopper", PIN),  # what switches it, if it has no levels of its own
        ("x", "f8", (STATES,)),  # the state
        ("trial", "f8", (STATES,)),
        ("stage", "f8", (STATES,)),
        ("total", "f8", (STATES,)),
        ("k", "f8", (STATES,)),
        ("kept", "f8", (STATES,)),
        ("kept_feeds", "i8"),
        ("kept_conducts", "i8", (3,)),
        ("kept_chops", "i8"),
    ]
)
#: What a set-up says about the link; `inverter.vdc_V` is the source's voltage.
LINK_KEYS = (
    "link_F", "source_ohm", "source_H", "line_Hz", "precharge_ohm", "chopper_ohm", "chopper_on_V",
    "chopper_off_V",
)  # fmt: skip

#: Longest step, relative to the shortest time constant of the link's circuits. The error of a step
#: is below 1e-7.
STEP_SHARE = 0.1
#: An instant at which diode or chopper change is located to this many volts or amperes.
LOCATED = 1e-7

TWO_PI = 2.0 * np.pi
#: Angle from line to line.
_THIRD = TWO_PI / 3.0


def charge(link: np.record, v_V: float) -> None:
    """The source has this voltage, and so has the capacitor unless it is to be precharged."""
    link.source_V = v_V
    link.bridged = link.precharge_ohm == 0
    link.x[V] = v_V if link.bridged else 0.0


@compiled
def longest_link_step_s(link, m):
    """Longest step that is accurate for the capacitor with the source, the chopper and the
    machine's leakage."""
    per_F = 1.0 / link.link_F
    fastest = np.sqrt(3.0 * m.inv_l_max * per_F)
    ohm = link.source_ohm
    if link.bridged == 0:
        ohm += link.precharge_ohm
    if link.source_H > 0.0:
        fastest = max(fastest, np.sqrt(per_F / link.source_H), ohm / link.source_H)
    else:
        fastest = max(fastest, per_F / ohm)
    fastest = max(fastest, TWO_PI * link.line_Hz)
    if link.chopper_ohm > 0.0:
        fastest = max(fastest, per_F / link.chopper_ohm)
    return STEP_SHARE / fastest


@compiled
def begin_link(link):
    """Begin a Runge-Kutta step from the state."""
    for r in range(6):
        link.total[r] = 0.0
        link.stage[r] = link.x[r]
    if link.line_Hz > 0.0:
        for r in range(6, STATES):
            link.total[r] = 0.0
            link.stage[r] = link.x[r]


@compiled(inline="always")
def _line_V(link, x, line):
    return LINE_PEAK * link.source_V * cos(x[LINE_RAD] - line * _THIRD)


@compiled
def _rail_and_shift(link, x):
    """Voltage of the rectifier's upper rail against the lower one, and that of the lower one
    against the lines' star point while any of them conduct."""
    rail = x[V]
    if link.bridged == 0:
        rail += link.precharge_ohm * x[I_SOURCE]
    shift = 0.0
    conducting = 0
    for line in range(3):
        if link.conducts[line] != 0:
            shift += _line_V(link, x, line)
            conducting += 1
            if link.conducts[line] > 0:
                shift -= rail
    if conducting > 0:
        shift /= conducting
    return rail, shift


@compiled
def _add_lines(link, x, k):
    """Slopes of what the rectifier and its lines add to the state. Returns its current."""
    rail, shift = _rail_and_shift(link, x)
    i_source = 0.0
    slope_A = 0.0
    given_W = 0.0
    lost_W = (rail - x[V]) * x[I_SOURCE]
    for line in range(3):
        i = x[LINE_A + line]
        slope = 0.0
        if link.conducts[line] != 0:
            e = _line_V(link, x, line)
            slope = e - link.source_ohm * i - shift
            if link.conducts[line] > 0:
                slope -= rail
            slope /= link.source_H
            given_W += e * i
            lost_W += link.source_ohm * i * i
            if link.conducts[line] > 0:
                i_source += i
                slope_A += slope
        k[LINE_A + line] = slope
    k[LINE_RAD] = TWO_PI * link.line_Hz
    k[I_SOURCE] = slope_A
    k[SOURCE_J] = given_W
    k[RESISTANCE_J] = lost_W
    return i_source


@compiled
def add_link_stage(link, i_drive_A, weight, reach):
    """One stage, in which the legs take this current; the next one is `reach` from the start."""
    x, k = link.stage, link.k
    v = x[V]
    i_source = x[I_SOURCE]
    if link.line_Hz > 0.0:
        i_source = _add_lines(link, x, k)
    else:
        ohm = link.source_ohm
        if link.bridged == 0:
            ohm += link.precharge_ohm
        slope = 0.0
        if link.feeds != 0:
            if link.source_H > 0.0:
                slope = (link.source_V - v - ohm * i_source) / link.source_H
            else:
                i_source = (link.source_V - v) / ohm
        k[I_SOURCE] = slope
        k[SOURCE_J] = link.source_V * i_source
        k[RESISTANCE_J] = ohm * i_source * i_source
    i_chopper = 0.0
    if link.chops != 0:
        i_chopper = v / link.chopper_ohm
    k[V] = (i_source - i_drive_A - i_chopper) / link.link_F
    k[CHOPPER_J] = v * i_chopper
    k[DRIVE_J] = v * i_drive_A
    for r in range(6):
        link.total[r] += weight * k[r]
        x[r] = link.x[r] + reach * k[r]
    if link.line_Hz > 0.0:
        for r in range(6, STATES):
            link.total[r] += weight * k[r]
            x[r] = link.x[r] + reach * k[r]


@compiled
def end_link(link, dt):
    """End the step: `trial` is the state after it."""
    for r in range(6):
        link.trial[r] = link.x[r] + dt / 6.0 * link.total[r]
    if link.line_Hz > 0.0:
        for r in range(6, STATES):
            link.trial[r] = link.x[r] + dt / 6.0 * link.total[r]


@compiled
def accept_link(link):
    for r in range(6):
        link.x[r] = link.trial[r]
    if link.line_Hz > 0.0:
        for r in range(6, STATES):
            link.x[r] = link.trial[r]
        if link.x[LINE_RAD] > TWO_PI:
            link.x[LINE_RAD] -= TWO_PI


@compiled
def _beyond_lines(link, x):
    """The same for the diodes of a rectifier."""
    rail, shift = _rail_and_shift(link, x)
    most = -np.inf
    highest = -np.inf
    lowest = np.inf
    conducting = 0
    for line in range(3):
        e = _line_V(link, x, line)
        highest = max(highest, e)
        lowest = min(lowest, e)
        if link.conducts[line] != 0:
            conducting += 1
            most = max(most, -link.conducts[line] * x[LINE_A + line])
        else:
            most = max(most, e - shift - rail, shift - e)
    return most if conducting > 0 else highest - lowest - rail


@compiled
def _beyond_diode(link, x):
    """How far the state is beyond the point where the source's diode changes, V or A."""
    if link.line_Hz > 0.0:
        return _beyond_lines(link, x)
    if link.feeds == 0:
        return link.source_V - x[V]
    if link.source_H > 0.0:
        return -x[I_SOURCE]
    return x[V] - link.source_V


@compiled
def _beyond_chopper(link, x):
    """The same for the chopper, V."""
    if link.chopper_ohm == 0.0 or link.chopper.level > 0:
        return -np.inf
    if link.chops != 0:
        return link.chopper_off_V - x[V]
    return x[V] - link.chopper_on_V


@compiled
def beyond_link(link, x):
    """How far the state is beyond a point where diode or chopper change; negative if they stay."""
    return max(_beyond_diode(link, x), _beyond_chopper(link, x))


@compiled
def _end_lines(link):
    """Let the diodes block whose current has passed zero. Two lines that remain have the same
    current, and one alone has none."""
    x = link.x
    conducting = 0
    for line in range(3):
        if link.conducts[line] * x[LINE_A + line] < 0.0:
            link.conducts[line] = 0
        conducting += abs(link.conducts[line])
    upper = 0.0
    for line in range(3):
        if conducting < 2:
            link.conducts[line] = 0
        if link.conducts[line] == 0:
            x[LINE_A + line] = 0.0
        elif link.conducts[line] > 0:
            upper += x[LINE_A + line]
    if conducting == 2:
        for line in range(3):
            if link.conducts[line] < 0:
                x[LINE_A + line] = -upper
    x[I_SOURCE] = upper


@compiled
def _switch_lines(link):
    """Let the rectifier's diodes follow the state."""
    _end_lines(link)
    x = link.x
    rail, shift = _rail_and_shift(link, x)
    high = 0
    low = 0
    none = True
    for line in range(3):
        e = _line_V(link, x, line)
        if e > _line_V(link, x, high):
            high = line
        if e < _line_V(link, x, low):
            low = line
        none = none and link.conducts[line] == 0
    if none:
        if _line_V(link, x, high) - _line_V(link, x, low) > rail:
            link.conducts[high] = 1
            link.conducts[low] = -1
        return
    for line in range(3):
        if link.conducts[line] == 0:
            e = _line_V(link, x, line)
            if e - shift > rail:
                link.conducts[line] = 1
            elif e < shift:
                link.conducts[line] = -1


@compiled
def switch_link(link):
    """Let diode and chopper follow the state."""
    if link.line_Hz > 0.0:
        if _beyond_lines(link, link.x) > 0.0:
            _switch_lines(link)
    elif _beyond_diode(link, link.x) > 0.0:
        link.feeds = 1 - link.feeds
        if link.source_H > 0.0:
            link.x[I_SOURCE] = 0.0
    if _beyond_chopper(link, link.x) > 0.0:
        link.chops = 1 - link.chops


@compiled
def keep_link(link):
    """Save the state for `put_back_link`."""
    for r in range(STATES):
        link.kept[r] = link.x[r]
    for line in range(3):
        link.kept_conducts[line] = link.conducts[line]
    link.kept_feeds = link.feeds
    link.kept_chops = link.chops


@compiled
def put_back_link(link):
    for r in range(STATES):
        link.x[r] = link.kept[r]
    for line in range(3):
        link.conducts[line] = link.kept_conducts[line]
    link.feeds = link.kept_feeds
    link.chops = link.kept_chops


@compiled
def source_A(link):
    """Current of the source, where the link is a capacitor."""
    if link.line_Hz > 0.0 or link.source_H > 0.0:
        return link.x[I_SOURCE]
    if link.feeds == 0:
        return 0.0
    ohm = link.source_ohm
    if link.bridged == 0:
        ohm += link.precharge_ohm
    return (link.source_V - link.x[V]) / ohm


@compiled(inline="always")
def link_V(link, vdc):
    """Voltage of the link, where `vdc` is the source's."""
    return link.x[V] if link.on != 0 else vdc
