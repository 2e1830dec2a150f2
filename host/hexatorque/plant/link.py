"""The dc link: a capacitor between the source and the inverter's legs, and a braking chopper.

The source has a resistance, an inductance, and a diode, so that it takes no energy back:

    C dv/dt = i_source - i_drive - (v/R_chopper while the chopper is on)
    L di_source/dt = v_source - v - R i_source      while the diode conducts

Without an inductance i_source is (v_source - v)/R while that is positive. The diode, and the
chopper between its two levels, change at instants that the integration locates (`inverter.py`).
The energies that flow are integrated beside the voltage, with the same steps.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled

#: State: voltage, source current, and the energies that the source has given, that its resistance
#: and the chopper have turned into heat, and that the legs have taken.
V, I_SOURCE, SOURCE_J, RESISTANCE_J, CHOPPER_J, DRIVE_J = range(6)

LINK = np.dtype(
    [
        ("on", "i8"),  # 0: a stiff link, which has the source's voltage
        ("link_F", "f8"),
        ("source_ohm", "f8"),
        ("source_H", "f8"),
        ("chopper_ohm", "f8"),  # 0: there is none
        ("chopper_on_V", "f8"),
        ("chopper_off_V", "f8"),
        ("source_V", "f8"),
        ("feeds", "i8"),  # whether the source's diode conducts
        ("chops", "i8"),  # whether the chopper is on
        # What switches it instead of its levels: word and bit of a pin's level; 0: nothing does
        ("chopper_word", "i8"),
        ("chopper_bit", "i8"),
        ("x", "f8", (6,)),  # the state
        ("trial", "f8", (6,)),
        ("stage", "f8", (6,)),
        ("total", "f8", (6,)),
        ("k", "f8", (6,)),
        ("kept", "f8", (6,)),
        ("kept_feeds", "i8"),
        ("kept_chops", "i8"),
    ]
)
#: What a set-up says about the link; `inverter.vdc_V` is the source's voltage.
LINK_KEYS = (
    "link_F", "source_ohm", "source_H", "chopper_ohm", "chopper_on_V", "chopper_off_V",
)  # fmt: skip

#: Longest step, relative to the shortest time constant of the link's circuits. The error of a step
#: is below 1e-7.
STEP_SHARE = 0.1
#: An instant at which diode or chopper change is located to this many volts or amperes.
LOCATED = 1e-7


def charge(link: np.record, v_V: float) -> None:
    """Charge the capacitor to a voltage that is the source's, too."""
    link.source_V = link.x[V] = v_V


@compiled
def longest_link_step_s(link, m):
    """Longest step that is accurate for the capacitor with the source, the chopper and the
    machine's leakage."""
    per_F = 1.0 / link.link_F
    fastest = np.sqrt(3.0 * m.inv_l_max * per_F)
    if link.source_H > 0.0:
        fastest = max(fastest, np.sqrt(per_F / link.source_H), link.source_ohm / link.source_H)
    else:
        fastest = max(fastest, per_F / link.source_ohm)
    if link.chopper_ohm > 0.0:
        fastest = max(fastest, per_F / link.chopper_ohm)
    return STEP_SHARE / fastest


@compiled
def begin_link(link):
    """Begin a Runge-Kutta step from the state."""
    for r in range(6):
        link.total[r] = 0.0
        link.stage[r] = link.x[r]


@compiled
def add_link_stage(link, i_drive_A, weight, reach):
    """One stage, in which the legs take this current; the next one is `reach` from the start."""
    x, k = link.stage, link.k
    v = x[V]
    i_source = x[I_SOURCE]
    slope = 0.0
    if link.feeds != 0:
        if link.source_H > 0.0:
            slope = (link.source_V - v - link.source_ohm * i_source) / link.source_H
        else:
            i_source = (link.source_V - v) / link.source_ohm
    i_chopper = 0.0
    if link.chops != 0:
        i_chopper = v / link.chopper_ohm
    k[V] = (i_source - i_drive_A - i_chopper) / link.link_F
    k[I_SOURCE] = slope
    k[SOURCE_J] = link.source_V * i_source
    k[RESISTANCE_J] = link.source_ohm * i_source * i_source
    k[CHOPPER_J] = v * i_chopper
    k[DRIVE_J] = v * i_drive_A
    for r in range(6):
        link.total[r] += weight * k[r]
        x[r] = link.x[r] + reach * k[r]


@compiled
def end_link(link, dt):
    """End the step: `trial` is the state after it."""
    for r in range(6):
        link.trial[r] = link.x[r] + dt / 6.0 * link.total[r]


@compiled
def accept_link(link):
    for r in range(6):
        link.x[r] = link.trial[r]


@compiled
def _beyond_diode(link, x):
    """How far the state is beyond the point where the source's diode changes, V or A."""
    if link.feeds == 0:
        return link.source_V - x[V]
    if link.source_H > 0.0:
        return -x[I_SOURCE]
    return x[V] - link.source_V


@compiled
def _beyond_chopper(link, x):
    """The same for the chopper, V."""
    if link.chopper_ohm == 0.0 or link.chopper_word > 0:
        return -np.inf
    if link.chops != 0:
        return link.chopper_off_V - x[V]
    return x[V] - link.chopper_on_V


@compiled
def beyond_link(link, x):
    """How far the state is beyond a point where diode or chopper change; negative if they stay."""
    return max(_beyond_diode(link, x), _beyond_chopper(link, x))


@compiled
def switch_link(link):
    """Let diode and chopper follow the state."""
    if _beyond_diode(link, link.x) > 0.0:
        link.feeds = 1 - link.feeds
        if link.source_H > 0.0:
            link.x[I_SOURCE] = 0.0
    if _beyond_chopper(link, link.x) > 0.0:
        link.chops = 1 - link.chops


@compiled
def keep_link(link):
    """Save the state for `put_back_link`."""
    for r in range(6):
        link.kept[r] = link.x[r]
    link.kept_feeds = link.feeds
    link.kept_chops = link.chops


@compiled
def put_back_link(link):
    for r in range(6):
        link.x[r] = link.kept[r]
    link.feeds = link.kept_feeds
    link.chops = link.kept_chops


@compiled(inline="always")
def link_V(link, vdc):
    """Voltage of the link, where `vdc` is the source's."""
    return link.x[V] if link.on != 0 else vdc
