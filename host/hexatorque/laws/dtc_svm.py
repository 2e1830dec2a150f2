"""Direct torque control with space-vector modulation: PI regulators of the flux's length and of the
torque, in the frame of the stator flux.

Bojoi, Farina, Griva, Profumo, Tenconi, "Direct torque control for dual three-phase induction motor
drives", IEEE Trans. Ind. Appl. 41(6), 2005. The structure is the field's; the tuning is ours, the
rule of scheme `foc`: with the prediction y1, a period adds the commanded change to torque and flux,

    y2 = y1 + a (y* - 2 y1) + J,  J += a^2 (y*' - y),  a = alpha T_s

with the reference y*' of the step before and the sampled y. A voltage v along the flux adds v T_s
to its length; across it adds 3 P |r| cos(delta) v T_s/(sigma L_s) to the torque.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .law import Law, record
from .patterns import centred
from .predictions import turn, xy_regulated

REACH_PU = 1 / math.sqrt(3)


class Reference(Law):
    """alpha_ts: bandwidth times the period."""

    name = "dtc-svm"
    returns = "duties"
    reach_pu = REACH_PU

    def __init__(self, alpha_ts: float = 0.3) -> None:
        self.alpha_ts = alpha_ts

    def memory(self, parameters: Any) -> np.record:
        return record(
            a=self.alpha_ts, begun=0, flux_Wb=0.0, torque_Nm=0.0,
            flux_before_Wb=0.0, torque_before_Nm=0.0, xy_with=0j, xy_against=0j,
        )  # fmt: skip

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        a, psi, rotor = memory.a, seen.psi_Wb, seen.rotor_Wb
        size = max(abs(psi), 1e-4)
        along = psi / size
        per_Wb = 3.0 * seen.pole_pairs / seen.sigma_ls_H
        torque_Nm = per_Wb * (rotor.conjugate() * psi).imag
        sampled = seen.sampled_psi_Wb.conjugate() * seen.sampled_i_A
        sampled_Nm = 3.0 * seen.pole_pairs * sampled.imag
        if memory.begun == 0:
            memory.begun = 1
            memory.flux_Wb, memory.torque_Nm = a * size, a * torque_Nm
            memory.flux_before_Wb, memory.torque_before_Nm = size, torque_Nm
        memory.flux_Wb += a * a * (memory.flux_before_Wb - abs(seen.sampled_psi_Wb))
        memory.torque_Nm += a * a * (memory.torque_before_Nm - sampled_Nm)

        # gain: the torque of a weber across
        on = turn(seen)
        gain = max(per_Wb * (rotor.conjugate() * along).real, 1e-3)
        radial_Wb = a * (seen.flux_ref_Wb - 2 * size) + memory.flux_Wb
        across_Wb = (a * (seen.torque_ref_Nm - 2 * torque_Nm) + memory.torque_Nm) / gain
        wanted_Wb = (size + radial_Wb + 1j * across_Wb) * along * on
        v = ((wanted_Wb - psi) / seen.ts_s + seen.rs_ohm * seen.i_A) / seen.vdc_V
        memory.flux_before_Wb, memory.torque_before_Nm = seen.flux_ref_Wb, seen.torque_ref_Nm
        if abs(v) > REACH_PU:  # the integrals get the part that the voltage realises
            cut_Wb = v * (REACH_PU / abs(v) - 1.0) * seen.vdc_V * seen.ts_s
            cut_Wb = cut_Wb * (along * on).conjugate()
            memory.flux_before_Wb += cut_Wb.real / a
            memory.torque_before_Nm += cut_Wb.imag * gain / a
            v = v * REACH_PU / abs(v)
        return centred(v, xy_regulated(seen, memory, along))
