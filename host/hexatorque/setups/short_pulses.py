"""The voltage that is left of a scheme's when gate pulses have a shortest length.

No leg stays high or low for less than the dead time and `min_pulse_us` together. A modulated leg
that would takes its rail or this pulse; a word of a switching table that would lasts so long or is
left out. The firmware's own functions do it here with the voltage of a steady state. The controller
knows the voltage that was applied and corrects it later: the change becomes ripple, and a part of
it an error of the mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plant.vsd import transform
from .design import rad_s

if TYPE_CHECKING:
    from ..firmware import Controller
    from .design import Design

#: Directions of the voltage, and the step from each to the next: a period of fast turning, so that
#: neighbours differ as they do in the drive.
DIRECTIONS, TURN = 360, 37
#: Words and their shares of a period.
Words = tuple[Sequence[int], tuple[float, float, float]]


@dataclass(frozen=True)
class Changed:
    """share: rms of the voltage's change over the rms of the demanded one; volts: the same.
    most_us: the longest `min_pulse_us` that changes no more than was asked about; below 0 if even
    the dead time alone changes more."""

    share: float
    volts: float
    most_us: float


class Made:
    """A table's words and shares as the legs make them."""

    def __init__(self, period: Any) -> None:
        from ..firmware import ffi, lib

        self._period = period
        self._counts, self._applied = ffi.new("ht_compare *"), ffi.new("ht_applied *")
        self._at = ffi.new("ht_action_points *")
        self._make = lib.ht_pattern_counts

    def __call__(self, words: Sequence[int], shares: tuple[float, float, float]) -> Words:
        self._at.t1, self._at.t2 = shares[0], shares[0] + shares[1]
        self._make(words, self._at[0], self._period, self._counts, self._applied)
        t0, t1, t2 = self._applied.t
        # The last word lasts until the next pattern takes effect.
        return tuple(self._applied.s), (t1 - t0, t2 - t1, 1 - t2 + t0)


def of_table(
    d: Design, controller: Controller, asked: Sequence[Words], vectors: Sequence[complex],
    most_share: float,
) -> Changed:  # fmt: skip
    """The error for the words that the law asked for; `vectors`: the voltage of each state word."""

    def volts(of: Words) -> complex:
        return sum((share * vectors[word] for word, share in zip(*of)), 0j)

    wanted = np.array([volts(one) for one in asked])

    def changed(period: Any) -> tuple[np.ndarray, np.ndarray]:
        made = Made(period)
        return wanted, np.array([volts(made(*one)) for one in asked])

    return _changed(d, controller, changed, most_share)


def of_modulator(
    d: Design, controller: Controller, speed_rpm: float, torque_Nm: float, most_share: float
) -> Changed:
    """The error for a voltage that turns, as large as this point needs."""
    pu = _needed_pu(d, speed_rpm, torque_Nm)
    turning = np.exp(2j * np.pi * TURN / DIRECTIONS * np.arange(DIRECTIONS))

    def changed(period: Any) -> tuple[np.ndarray, np.ndarray]:
        return d.vdc_V * pu * turning, d.vdc_V * _modulated(d, controller, period, pu * turning)

    return _changed(d, controller, changed, most_share)


def _needed_pu(d: Design, speed_rpm: float, torque_Nm: float) -> float:
    """Units of Vdc. The firmware weakens the field where this is more than the legs reach."""
    m = d.machine
    omega = m.pole_pairs * rad_s(abs(speed_rpm)) + d.slip_rad_s(torque_Nm)
    across_V = m.rs_ohm * abs(torque_Nm) / (3 * m.pole_pairs * d.steady_Wb)
    most = d.parameter("fw_margin") if d.parameter("field_weakening") == "on" else 1.0
    return min((omega * d.steady_Wb + across_V) / d.vdc_V, most * d.reach_pu(math.inf))


def _modulated(d: Design, controller: Controller, period: Any, asked_pu: np.ndarray) -> np.ndarray:
    """Mean voltage of each period, units of Vdc, without dead time."""
    from ..firmware import ffi, lib

    config = controller.drive.config.control
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.0, "i_zero_A": 1.0})
    current, v, state = ffi.new("ht_six *"), ffi.new("ht_vsd *"), ffi.new("ht_modulator_state *")
    given = ffi.new(
        "ht_modulator_input *", {"dead": dead, "i_A": current, "period": period, "before": 0}
    )
    out, applied = ffi.new("ht_compare *"), ffi.new("ht_applied *")
    toggles, high = ffi.new("ht_toggles *"), ffi.new("ht_six *")
    lib.ht_modulator_reset(state)
    shares = np.empty((len(asked_pu), 6))
    for one, asked in zip(shares, asked_pu):
        v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y = asked.real, asked.imag, 0.0, 0.0
        if d.winding:
            v[0] = lib.ht_modulator_legs(d.winding, v)
        lib.ht_modulator_step(
            ffi.addressof(config, "modulator"), state, v, given, out, applied, toggles
        )
        applied.own = 1
        lib.ht_applied_high(applied, toggles, high)
        one[:] = list(high.p)
        given.before = applied.s[2]
    alpha, beta = transform(d.unsaturated.displacement_deg)[:2] @ shares.T
    return alpha + 1j * beta


def _changed(
    d: Design,
    controller: Controller,
    of: Callable[[Any], tuple[np.ndarray, np.ndarray]],
    most_share: float,
) -> Changed:
    from ..firmware import ffi

    period = ffi.new("ht_period *", controller.drive.config.control.period)
    counts_us = 1e6 * d.period_s / period.counts

    def share(shortest: int) -> tuple[float, float]:
        period.shortest = shortest
        asked, made = of(period)
        rms = float(np.sqrt(np.mean(np.abs(made - asked) ** 2)))
        size = float(np.sqrt(np.mean(np.abs(asked) ** 2)))
        return (rms / size if size else 0.0), rms

    now = period.shortest
    found, rms = share(now)
    dead = now - round(d.parameter("min_pulse_us") / counts_us)
    if found <= most_share:
        return Changed(found, rms, d.parameter("min_pulse_us"))
    low, high = max(0, dead), now
    while high - low > max(1, now // 100):
        middle = (low + high) // 2
        low, high = (middle, high) if share(middle)[0] <= most_share else (low, middle)
    least = share(max(1, dead))[0] <= most_share
    return Changed(found, rms, (low - dead) * counts_us if least else -1.0)
