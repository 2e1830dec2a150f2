"""The values that the two papers measured on their hardware, for comparison with ours.

Neither paper states the band of its THD.
"""

from __future__ import annotations

PAPER: dict[str, dict] = {
    # Paper A: Holakooie, Iwanski, Miazga, IEEE Trans. Ind. Electron. 69(10), 2022, Table IV. Its
    # rated speed cannot be reached at the printed dc-link voltage and flux, so there is a
    # "feasible" set-up. The operating point of Table IV can be reached.
    "paper-a-feasible": {
        "source": "paper A, Table IV",
        "point": "100 r/min, 10 N m",
        "speed_rpm": 100.0,
        "load_Nm": 10.0,
        "schemes": {
            "fdr": {"thd_pct": 12.44, "delta_i_A": 0.2366, "f_sw_Hz": 2450.0},
            "ddr": {"thd_pct": 8.13, "delta_i_A": 0.0309, "f_sw_Hz": 2480.0},
        },
    },
    # Paper B: Pandit, Aware, Nemade, Levi, IEEE Trans. Power Electron. 32(9), 2017, Table VI.
    # Ripple is the standard deviation (eq. 9); f_sw is relative to DTC1.
    "paper-b": {
        "source": "paper B, Table VI",
        "point": "2500 r/min, 2 N m",
        "speed_rpm": 2500.0,
        "load_Nm": 2.0,
        "schemes": {
            "dtc1": {"thd_pct": 23.5, "torque_ripple_Nm": 0.2617, "f_sw_rel": 1.0},
            "dtc2": {"thd_pct": 12.1, "torque_ripple_Nm": 0.271, "f_sw_rel": 1.1},
            "dtc3": {"thd_pct": 12.9, "torque_ripple_Nm": 0.1063, "f_sw_rel": 2.0},
        },
        "why_thd": "it depends on the flux reference, which the paper does not print, on the x–y "
        "inductance, for which the paper takes the stator leakage, and on the band, which it does "
        "not state",
    },
}


#: The same experiment. In this set-up the values that the paper does not print are fitted to it.
PAPER["paper-b-fitted"] = PAPER["paper-b"]
