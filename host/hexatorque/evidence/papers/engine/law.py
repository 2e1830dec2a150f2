"""The firmware's control step with a given state: the decision of the compiled switching tables
for any sector, comparator levels and x-y flux."""

from __future__ import annotations

import numpy as np

from ....firmware import CData, Controller, ffi, lib
from ....setups import Setup, parameters

PSI_WB = 0.4
#: Relative flux error that changes the flux comparator's level, but is too small for `flux_hold` to
#: replace a zero vector.
FLUX_STEP = 0.02


class Law:
    """Control steps of one scheme without latency. Each step starts from a given state."""

    def __init__(self, setup: Setup) -> None:
        setup = setup.changed(timing__latency="none", controller__observer="voltage")
        self._controller = Controller(setup["timing.device"], parameters(setup))
        self._config = ffi.new("ht_control_config *", self._controller.drive.config.control)
        self._config.table_law.flux_hold = 2 * FLUX_STEP

    @property
    def full_level(self) -> int:
        """Torque level of the longest vectors."""
        return 2 if self._config.table_law.torque_levels == 5 else 1

    def words(
        self, sector: int, torque_level: int, flux_up: bool, psi_xy: complex = 0j
    ) -> tuple[int, int, int]:
        """State words of the period's three intervals.

        sector: the flux is in the middle of this sector; torque_level: -2..2, the level that the
        comparator must have; psi_xy: x-y flux, Wb.
        """
        config, state = self._config, ffi.new("ht_control_state *")
        # Columns of T, times 3, give the phase currents of an x-y current.
        i_xy = psi_xy / config.observer.lxy_H
        columns = [c.xy for c in lib.ht_transform[lib.HT_WINDING_30]]
        i_A = {"p": [3 * (c.x * i_xy.real + c.y * i_xy.imag) for c in columns]}
        lib.ht_control_reset(config, state, [i_A])
        psi = PSI_WB * np.exp(1j * np.deg2rad(30 * sector))
        state.observer.psi_Wb = [psi.real, psi.imag]
        inputs = ffi.new("ht_control_input *")
        inputs.i_A = i_A
        # Without voltage and torque current the state does not change before the decision.
        inputs.torque_ref_Nm = self._torque_error(torque_level)
        inputs.flux_ref_Wb = PSI_WB * (1 + FLUX_STEP * (1 if flux_up else -1))
        compare = ffi.new("ht_compare *")
        lib.ht_control_step(config, state, inputs, False, compare)
        law = state.table_law
        if (state.sector, law.torque_level, law.flux_level) != (sector, torque_level, flux_up):
            raise ValueError(f"no such demand: sector {sector}, levels {torque_level}, {flux_up}")
        return decode(compare, config.period.counts)

    def _torque_error(self, level: int) -> float:
        config = self._config.table_law
        size = 2 * config.torque_band_Nm
        if config.torque_levels == 5 and abs(level) == 1:
            size = 0.5 * (config.torque_inner_Nm + config.torque_band_Nm)
        return float(np.sign(level)) * size


def decode(compare: CData, period: int) -> tuple[int, int, int]:
    """State words of `ht_compare`: the start level, then the legs that use CA toggled, then those
    that use CB."""
    words = [compare.start]
    for registers in (compare.ca, compare.cb):
        used = sum(1 << (5 - leg) for leg in range(6) if registers[leg] < period)
        words.append(words[-1] ^ used)
    return tuple(words)
