"""Schemes at a fixed sampling frequency, with the set-up's bands, for dynamics and robustness."""

from __future__ import annotations

from dataclasses import dataclass

from ... import setups
from .methods import OURS


@dataclass(frozen=True)
class Variant:
    """A scheme at a sampling frequency. thd_share: of `db-ipwm`."""

    scheme: str
    f_isr_Hz: float = 10e3
    thd_share: float = 0.0

    @property
    def label(self) -> str:
        at = "" if self.f_isr_Hz == 10e3 else f", {self.f_isr_Hz / 1e3:g} kHz"
        return f"{self.scheme}{at}{f', thd_share {self.thd_share:g}' if self.thd_share else ''}"

    @property
    def ours(self) -> bool:
        return self.scheme == OURS

    def setup(self, name: str, **changes: object) -> setups.Setup:
        return setups.load(name).with_scheme(
            self.scheme,
            controller__f_isr_Hz=self.f_isr_Hz,
            controller__thd_share=self.thd_share,
            timing__latency="predicted",
            **changes,
        )


VARIANTS = (
    Variant("dtc1"),
    Variant("dtc3"),
    Variant("ddr"),
    Variant("db-dtfc"),
    Variant("db-dtfc", 5e3),
)
