"""The settings that are tried for one scheme at one operating point.

A setting is a point of the unit cube. A Latin hypercube covers the cube: along every axis, each of
n equal intervals holds one of the n settings. Then rounds of refinement try neighbours of the
settings that are best so far, for every pair of a judged figure and a limit of switching frequency.
The random numbers come from SEED, the point and the variant, so the search can be repeated.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from .... import firmware
from ....setups import Setup
from .points import Place

SEED = 14
#: Limits of switching frequency, and what is judged within them.
LIMITS_HZ = (2000.0, 3000.0, 4000.0)
JUDGED = ("td_Nm", "thd_inf_pct", "ixy_rms_A", "loss_W")
#: A table scheme that is sampled very fast is a comparator: one target leaves that out.
SLOW_HZ = 20e3
#: Spread of a neighbour, of the width of an axis.
NEAR = 0.07
OURS = "db-dtfc"
#: About the frequency of the slow interrupt.
SLOW_LOOP_HZ = 100.0
#: Samples of the plant in a period of the PWM.
SAMPLES = 12


@dataclass(frozen=True)
class Axis:
    """A controller parameter between two values, or one of its choices. share_of: relative to this
    parameter's value in the setting if it is an axis before this one, else in the set-up; log:
    equal ratios, not differences."""

    name: str
    low: float = 0.0
    high: float = 1.0
    share_of: str = ""
    log: bool = True
    choices: tuple[str, ...] = ()

    def value(self, at: float) -> float | str:
        if self.choices:
            return self.choices[min(int(at * len(self.choices)), len(self.choices) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** at)
        return float(self.low + (self.high - self.low) * at)


@dataclass(frozen=True)
class Extent:
    """Settings of the Latin hypercube; neighbours in each round of refinement."""

    cover: int
    rounds: tuple[int, ...]

    @property
    def settings(self) -> int:
        return self.cover + sum(self.rounds)


@dataclass(frozen=True)
class Variant:
    """A scheme, with parameters that are fixed and axes that are free."""

    name: str
    scheme: str
    axes: tuple[Axis, ...]
    extent: Extent
    quick: Extent
    fixed: tuple[tuple[str, float | str], ...] = ()


_TABLE = (
    Axis("f_isr_Hz", 3e3, 50e3),
    Axis("torque_band_Nm", 0.15, 4.0, "torque_band_Nm"),
    Axis("flux_band_Wb", 0.25, 6.0, "flux_band_Wb"),
)
#: The inner band of the five-level comparator, relative to its outer band.
_INNER = Axis("torque_inner_Nm", 0.2, 0.9, "torque_band_Nm", log=False)
#: One toggle per leg and period: f_sw is at most half of f_isr, and at 2.5 kHz paper B's machine
#: still has five samples in its shortest time constant.
_OURS = (
    Axis("f_isr_Hz", 2.5e3, 12e3),
    Axis("carrier_turn", choices=("auto", "off", "always")),
)
_ZERO = (
    Axis("kappa", 0.0, 1.0, log=False),
    Axis("kappa_from_pu", 0.0, 0.6, log=False),
    Axis("clamp", choices=("largest", "alternating")),
)


def variants() -> tuple[Variant, ...]:
    """All table schemes, and the modulated law centred, clamped in two ways, and free. Each scheme
    gets more than 60 settings. The modulated law shares its own among four variants, which suffices
    because its figures are smooth in few parameters."""
    full, quick = Extent(30, (16, 16)), Extent(3, (2,))
    own, own_quick = Extent(10, (4, 4)), Extent(2, (1,))
    clamped = (("kappa", 1.0), ("kappa_from_pu", 0.0))
    alternating = (*clamped, ("clamp", "alternating"))
    return (
        *(
            Variant(name, name, (*_TABLE, _INNER) if name == "dtc3" else _TABLE, full, quick)
            for name in firmware.table_schemes()
        ),
        Variant(f"{OURS} κ=0", OURS, _OURS, own, own_quick, (("kappa", 0.0),)),
        Variant(f"{OURS} κ=1", OURS, _OURS, own, own_quick, clamped),
        Variant(f"{OURS} alternating", OURS, _OURS, own, own_quick, alternating),
        Variant(f"{OURS} free", OURS, (*_OURS, *_ZERO), own, own_quick),
    )


def latin_hypercube(rng: np.random.Generator, count: int, axes: int) -> np.ndarray:
    """(count, axes) points of the unit cube."""
    order = np.stack([rng.permutation(count) for _ in range(axes)], axis=1)
    return (order + rng.random((count, axes))) / count


def random_numbers(place: Place, variant: Variant) -> np.random.Generator:
    text = f"{place.setup} {place.speed_rpm:g} {place.torque_Nm:g} {variant.name}"
    return np.random.default_rng([SEED, zlib.crc32(text.encode())])


def controller_values(variant: Variant, setup: Setup, at: np.ndarray) -> dict[str, Any]:
    """The controller's parameters of a setting."""
    values: dict[str, Any] = dict(variant.fixed)
    for axis, share in zip(variant.axes, at):
        value = axis.value(float(share))
        if axis.share_of:
            value *= values.get(axis.share_of, setup.parameter(axis.share_of))
        values[axis.name] = value
    if "torque_band_Nm" in values:  # the inner band must be the smaller one, also if it is unused
        values.setdefault("torque_inner_Nm", 0.5 * values["torque_band_Nm"])
    # A period holds a whole number of samples, and the slow interrupt is every n-th fast one.
    clock_Hz = float(firmware.board_of(setup["timing.device"]).map.pwm_clock_Hz)
    counts = SAMPLES * round(clock_Hz / (SAMPLES * values["f_isr_Hz"]))
    values["f_isr_Hz"] = clock_Hz / counts
    values["f_slow_Hz"] = values["f_isr_Hz"] / round(values["f_isr_Hz"] / SLOW_LOOP_HZ)
    return values


def best(rows: list[dict], figure: str, limit_Hz: float, sampled_Hz: float = 1e9) -> dict | None:
    """The row with the lowest `figure` whose switching frequency is within the limit, and its
    sampling frequency within `sampled_Hz`."""
    within = [r for r in rows if r["f_sw_Hz"] <= limit_Hz and r["f_isr_Hz"] <= sampled_Hz]
    return min(within, key=lambda row: row[figure], default=None)


def neighbours(
    rng: np.random.Generator, rows: list[dict], variant: Variant, count: int
) -> np.ndarray:
    """(count, axes) settings near the best ones. rows: what was measured; `at` is the setting.
    Where no setting is within a limit, a neighbour of the one that switches least."""
    axes = len(variant.axes)
    if not rows:
        return latin_hypercube(rng, count, axes)
    sampled_Hz = (1e9, SLOW_HZ) if variant.axes[0].high > SLOW_HZ else (1e9,)
    targets = [
        (figure, limit_Hz, most_Hz)
        for limit_Hz in (3e3, 2e3, 4e3)  # the verdicts' limit first
        for figure in JUDGED
        for most_Hz in (sampled_Hz if limit_Hz == 3e3 else (1e9,))
    ]
    least = min(rows, key=lambda row: row["f_sw_Hz"])
    near = [(best(rows, *target) or least)["at"] for target in targets[:count]]
    return np.clip(near + NEAR * rng.standard_normal((len(near), axes)), 0.0, 1.0)
