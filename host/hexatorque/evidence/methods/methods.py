"""The methods that are compared, and what the search may choose in each.

Every method chooses its sampling frequency. The table schemes choose their bands, our law its
modulation, the predictive control with a cost its weights. What is not listed is as in the set-up
or as in the reference's documentation: so are the bandwidths of regulators, because the search
judges the steady state, which hardly shows them.

A setting is a point of the unit cube with an axis for everything that is free.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import firmware, laws
from ...laws.law import Law
from ...setups import Setup

OURS = "db-dtfc"
#: This project's laws: their rivals may get a larger budget.
OWN = (OURS, "db-ipwm")
#: About the frequency of the slow interrupt.
SLOW_LOOP_HZ = 100.0
#: Samples of the plant in a period of the PWM.
SAMPLES = 12
#: The scheme of the set-up when a law of the host is in its place.
PLACEHOLDER = "dtc2"

#: Families, as a sentence names the best of each.
TABLE, MODULATED, VIRTUAL, SINGLE = (
    "the best table scheme",
    "the best modulated method",
    "the best virtual-vector prediction",
    "single-vector prediction",
)
FAMILIES = (TABLE, MODULATED, VIRTUAL, SINGLE)


@dataclass(frozen=True)
class Axis:
    """A parameter between two values, or one of its choices. share_of: relative to this parameter's
    value in the setting if it is an axis before this one, else in the set-up; log: equal ratios,
    not differences; law: a parameter of a law of the host, not of the controller."""

    name: str
    low: float = 0.0
    high: float = 1.0
    share_of: str = ""
    log: bool = True
    choices: tuple[str, ...] = ()
    law: bool = False

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
class Method:
    """A scheme or a law, with parameters that are fixed and axes that are free; the first one is
    the sampling frequency."""

    name: str
    scheme: str
    axes: tuple[Axis, ...]
    extent: Extent
    quick: Extent
    family: str
    fixed: tuple[tuple[str, float | str], ...] = ()

    @property
    def ours(self) -> bool:
        return self.scheme in OWN

    def values(self, setup: Setup, at: np.ndarray) -> dict[str, Any]:
        """The values of a setting: parameters of the controller and of the law."""
        values: dict[str, Any] = dict(self.fixed)
        for axis, share in zip(self.axes, at):
            value: Any = axis.value(float(share))
            if axis.share_of:
                value *= values.get(axis.share_of, setup.parameter(axis.share_of))
            values[axis.name] = value
        if "torque_band_Nm" in values:  # the inner band must be the smaller one, also if unused
            values.setdefault("torque_inner_Nm", 0.5 * values["torque_band_Nm"])
        # A period holds a whole number of samples, and the slow interrupt is every n-th fast one.
        clock_Hz = float(firmware.board_of(setup["timing.device"]).map.pwm_clock_Hz)
        counts = SAMPLES * round(clock_Hz / (SAMPLES * values["f_isr_Hz"]))
        values["f_isr_Hz"] = clock_Hz / counts
        values["f_slow_Hz"] = values["f_isr_Hz"] / round(values["f_isr_Hz"] / SLOW_LOOP_HZ)
        return values

    def law(self, setup: Setup, values: Mapping[str, Any]) -> Law | None:
        """The law with these values; None: the firmware's scheme of this name. The row of a
        measured setting will do as `values`."""
        if self.name == "fcs-mpc":
            from ...laws.fcs_mpc import Reference  # here, because numba takes long to load

            square_A2 = setup.parameter("i_full_A") ** 2
            return Reference(values["weight_xy"], values["weight_switching_pu"] * square_A2)
        return laws.find(self.name)


def controller(row: Mapping[str, Any]) -> dict[str, Any]:
    """The controller's parameters in the row of a measured setting."""
    names = firmware.parameters()
    return {name: value for name, value in row.items() if name in names}


#: The sampling frequency of what chooses vectors.
_VECTORS = Axis("f_isr_Hz", 3e3, 50e3)
#: The inner band of the five-level comparator is relative to its outer band.
_BANDS = (
    _VECTORS,
    Axis("torque_band_Nm", 0.15, 4.0, "torque_band_Nm"),
    Axis("flux_band_Wb", 0.25, 6.0, "flux_band_Wb"),
)
_INNER = Axis("torque_inner_Nm", 0.2, 0.9, "torque_band_Nm", log=False)
_TURN = Axis("carrier_turn", choices=("auto", "off", "always"))
_ZERO = (
    Axis("kappa", 0.0, 1.0, log=False),
    Axis("kappa_from_pu", 0.0, 0.6, log=False),
    Axis("clamp", choices=("largest", "alternating")),
)
#: Zero sequences of our law, each a method of its own: a search that must choose between them has
#: less of its budget left for what is a value. Name, what is fixed, what else is free.
_CLAMPED = (("kappa", 1.0), ("kappa_from_pu", 0.0))
_VARIANTS: tuple[tuple[str, tuple[tuple[str, float | str], ...], tuple[Axis, ...]], ...] = (
    (f"{OURS} κ=0", (("kappa", 0.0),), ()),
    (f"{OURS} κ=1", _CLAMPED, ()),
    (f"{OURS} alternating", (*_CLAMPED, ("clamp", "alternating")), ()),
    (f"{OURS} free", (), _ZERO),
)
#: Both ends of the knob of the interleaved sets. Below this voltage, clamped legs have more
#: distortion.
_ALTERNATING = (("kappa", 1.0), ("kappa_from_pu", 0.36), ("clamp", "alternating"))
_ENDS: tuple[tuple[str, tuple[tuple[str, float | str], ...]], ...] = (
    ("smooth", (("thd_share", 0.0),)),
    ("clean", (("thd_share", 1.0), *_ALTERNATING)),
)


def _tables(extent: Extent, quick: Extent) -> list[Method]:
    return [
        Method(name, name, (*_BANDS, _INNER) if name == "dtc3" else _BANDS, extent, quick, TABLE)
        for name in firmware.table_schemes()
    ]


def _ours(period: Axis, extent: Extent, quick: Extent) -> list[Method]:
    return [
        Method(name, OURS, (period, _TURN, *zero), extent, quick, MODULATED, fixed)
        for name, fixed, zero in _VARIANTS
    ]


def variants() -> tuple[Method, ...]:
    """All table schemes, and the modulated law centred, clamped in two ways, and free. Each scheme
    gets more than 60 settings. The modulated law shares its own among four variants, which suffices
    because its figures are smooth in few parameters."""
    # One toggle per leg and period: f_sw is at most half of f_isr, and at 2.5 kHz paper B's machine
    # still has five samples in its shortest time constant.
    period = Axis("f_isr_Hz", 2.5e3, 12e3)
    return (
        *_tables(Extent(30, (16, 16)), Extent(3, (2,))),
        *_ours(period, Extent(10, (4, 4)), Extent(2, (1,))),
    )


def methods() -> tuple[Method, ...]:
    """Every scheme and every reference. One campaign of the search is alike for all; each round of
    refinement has one setting for every pair of a judged figure and a limit of the switching
    frequency."""
    extent, quick = Extent(24, (21, 21)), Extent(3, (2,))
    # A modulator's legs toggle once a period: f_sw is half of this.
    period = Axis("f_isr_Hz", 2e3, 18e3)
    # And once in two where carriers are interleaved.
    quarter = Axis("f_isr_Hz", 4e3, 36e3)
    # The weight of a leg that switches is relative to the square of the sensors' range.
    weights = (
        Axis("weight_xy", 0.01, 3.0, law=True),
        Axis("weight_switching_pu", 1e-7, 1e-3, law=True),
    )

    def scheme(name: str, *axes: Axis) -> Method:
        return Method(name, name, axes, extent, quick, MODULATED)

    def law(name: str, family: str, *axes: Axis) -> Method:
        return Method(name, PLACEHOLDER, axes, extent, quick, family)

    return (
        *_tables(extent, quick),
        *_ours(period, extent, quick),
        scheme("foc", period),
        scheme("foc-24", period),
        scheme("db-ipwm", quarter, Axis("thd_share", 0.0, 1.0, log=False)),
        *(
            replace(scheme("db-ipwm", quarter), name=f"db-ipwm {end}", fixed=fixed)
            for end, fixed in _ENDS
        ),
        law("dtc-svm", MODULATED, period),
        law("lvv-mpc", VIRTUAL, period),
        law("vv-mpc", VIRTUAL, _VECTORS),
        law("fcs-mpc", SINGLE, _VECTORS, *weights),
    )
