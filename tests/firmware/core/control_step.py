"""One step of the control."""

from hexatorque.firmware import ffi, lib


def control_step(cfg, state, out, i, torque, flux, vdc, build):
    """Writes the compare values of currents `i` and these references into `out`."""
    inputs = ffi.new("ht_control_input *")
    inputs.i_A.p = list(i)
    inputs.vdc_V, inputs.torque_ref_Nm, inputs.flux_ref_Wb = vdc, torque, flux
    inputs.inv_flux_ref2 = 1 / flux**2 if flux else 0.0
    lib.ht_control_step(cfg, state, inputs, build, out)
