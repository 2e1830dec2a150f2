"""A law of one's own: deadbeat control of torque and flux.

    hexatorque compare --setup paper-b --schemes ddr,db-dtfc,examples/own_law.py

docs/references.md says what `seen` has and what a step may return.
"""

from hexatorque.laws import Law, centred


class OwnLaw(Law):
    name = "own-law"

    @staticmethod
    def step(seen, memory):
        r = seen.rotor_Wb  # T = 3 P r x psi / (sigma L_s): b makes the torque, a the length of psi
        b = seen.torque_ref_Nm * seen.sigma_ls_H / (3 * seen.pole_pairs * abs(r) ** 2)
        a = max((seen.flux_ref_Wb / abs(r)) ** 2 - b * b, 0.01) ** 0.5
        wanted_Wb = (a + 1j * b) * r * (1 + 1j * seen.omega_rad_s * seen.ts_s)
        v = (wanted_Wb - seen.psi_Wb) / seen.ts_s + seen.rs_ohm * seen.i_A
        v_xy = -0.4 * seen.lxy_H / seen.ts_s * seen.i_xy_A
        return centred(v / seen.vdc_V, v_xy / seen.vdc_V)
