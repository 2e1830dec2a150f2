"""A wider torque band: fewer switchings, more ripple. A sweep on paper B's machine.

Run: python examples/torque_band.py
"""

import hexatorque


def measured(band_Nm: float) -> dict:
    """Figures of merit at 1000 r/min and 2 N m with scheme dtc1."""
    band = {"controller.torque_band_Nm": band_Nm}
    run = hexatorque.measure("paper-b", scheme="dtc1", speed_rpm=1000, load_Nm=2, set=band)
    return run.metrics


if __name__ == "__main__":
    print("half band [N m]   f_sw [kHz]   torque ripple [N m]")
    for band_Nm in (0.3, 0.6, 1.0, 1.5):
        m = measured(band_Nm)
        print(f"{band_Nm:15.1f}   {m['f_sw_Hz'] / 1e3:10.2f}   {m['torque_ripple_Nm']:19.3f}")
