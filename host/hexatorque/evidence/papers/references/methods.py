"""The methods that are compared, and what the search may choose in each.

Every method chooses its sampling frequency. The table schemes choose their bands, our law its
modulation, the predictive control with a cost its weights. What is not listed is as in the set-up
or as in the reference's documentation: so are the bandwidths of regulators, because the search
judges the steady state, which hardly shows them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .... import firmware
from ....laws.law import Law
from ....setups import Setup
from ..fsw.search import Axis, Extent, Variant

OURS = "db-dtfc"
#: One campaign of the search: every method gets the same. Each round of refinement has one setting
#: for every pair of a judged figure and a limit of the switching frequency.
BUDGET = Extent(24, (21, 21))
QUICK = Extent(3, (2,))

#: Families, as a sentence names the best of each.
TABLE, MODULATED, VIRTUAL, SINGLE = (
    "the best table scheme",
    "the best modulated method",
    "the best virtual-vector prediction",
    "single-vector prediction",
)
FAMILIES = (TABLE, MODULATED, VIRTUAL, SINGLE)
#: The scheme of the set-up when a law of the host is in its place.
PLACEHOLDER = "dtc2"


@dataclass(frozen=True)
class Method(Variant):
    """law_axes: what is free in a law of the host; they follow `axes` in a setting."""

    family: str = TABLE
    law_axes: tuple[Axis, ...] = ()

    @property
    def ours(self) -> bool:
        return self.name == OURS

    @property
    def free(self) -> int:
        return len(self.axes) + len(self.law_axes)

    def law_values(self, at: Any) -> dict[str, Any]:
        own = at[len(self.axes) :]
        return {axis.name: axis.value(float(share)) for axis, share in zip(self.law_axes, own)}

    def law(self, setup: Setup, values: Mapping[str, Any]) -> Law | None:
        """The law with these values; None: the firmware's scheme of this name. The row of a
        measured setting will do as `values`."""
        if self.name in firmware.schemes():
            return None
        # Imported here: numba takes long to load.
        from ....laws.dtc_svm import Reference as DtcSvm
        from ....laws.fcs_mpc import Reference as FcsMpc
        from ....laws.lvv_mpc import Reference as LvvMpc
        from ....laws.vv_mpc import Reference as VvMpc

        if self.name == "dtc-svm":
            return DtcSvm()
        if self.name == "fcs-mpc":
            square_A2 = setup.parameter("i_full_A") ** 2
            return FcsMpc(values["weight_xy"], values["weight_switching_pu"] * square_A2)
        return {"lvv-mpc": LvvMpc, "vv-mpc": VvMpc}[self.name]()


_BANDS = (
    Axis("f_isr_Hz", 3e3, 50e3),
    Axis("torque_band_Nm", 0.15, 4.0, "torque_band_Nm"),
    Axis("flux_band_Wb", 0.25, 6.0, "flux_band_Wb"),
)
#: The inner band of the five-level comparator, relative to its outer band.
_INNER = Axis("torque_inner_Nm", 0.2, 0.9, "torque_band_Nm", log=False)
_VECTORS = Axis("f_isr_Hz", 3e3, 50e3)
#: A modulator's legs toggle once a period: f_sw is half of this.
_PERIODS = Axis("f_isr_Hz", 2e3, 18e3)


def _method(
    name: str, family: str, *axes: Axis, law_axes: tuple[Axis, ...] = (), scheme: str = ""
) -> Method:
    return Method(name, scheme or name, axes, BUDGET, QUICK, (), family, law_axes)


def methods() -> tuple[Method, ...]:
    return (
        *(
            _method(name, TABLE, *_BANDS, *((_INNER,) if name == "dtc3" else ()))
            for name in firmware.table_schemes()
        ),
        _method(
            OURS,
            MODULATED,
            _PERIODS,
            Axis("carrier_turn", choices=("auto", "off", "always")),
            Axis("kappa", 0.0, 1.0, log=False),
            Axis("kappa_from_pu", 0.0, 0.6, log=False),
            Axis("clamp", choices=("largest", "alternating")),
        ),
        _method("foc", MODULATED, _PERIODS),
        _method("foc-24", MODULATED, _PERIODS),
        _method("dtc-svm", MODULATED, _PERIODS, scheme=PLACEHOLDER),
        _method("lvv-mpc", VIRTUAL, _PERIODS, scheme=PLACEHOLDER),
        _method("vv-mpc", VIRTUAL, _VECTORS, scheme=PLACEHOLDER),
        _method(
            "fcs-mpc",
            SINGLE,
            _VECTORS,
            # The weight of a leg that switches is relative to the square of the sensors' range.
            law_axes=(Axis("weight_xy", 0.01, 3.0), Axis("weight_switching_pu", 1e-7, 1e-3)),
            scheme=PLACEHOLDER,
        ),
    )


def controller(method: Method, row: Mapping[str, Any]) -> dict[str, Any]:
    """The controller's parameters in the row of a measured setting."""
    names = firmware.parameters()
    return {name: value for name, value in row.items() if name in names}
