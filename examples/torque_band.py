"""A wider torque band: fewer switchings, more ripple. A sweep on paper B's machine.

Run: python examples/torque_band.py
"""

import hexatorque
from hexatorque.analysis.metrics import metrics


def measured(band_Nm: float) -> dict:
    """Figures of merit at 1000 r/min and 2 N m with scheme dtc1."""
    setup = hexatorque.load("paper-b").changed(
        controller__scheme="dtc1",
        controller__torque_band_Nm=band_Nm,
        controller__torque_inner_Nm=0.05,  # must not exceed the band; dtc1 does not use it
    )
    drive = hexatorque.SimulatedDrive(setup)
    drive.start()
    drive.run(0.5, record=False)
    drive.set("speed_ref_rpm", 1000)
    drive.run(0.5, record=False)
    drive.set("load_Nm", 2)
    drive.run(1.0, record=False)
    drive.run(1.0)
    drive.check()
    return metrics(drive.take())


if __name__ == "__main__":
    print("half band [N m]   f_sw [kHz]   torque ripple [N m]")
    for band_Nm in (0.3, 0.6, 1.0, 1.5):
        m = measured(band_Nm)
        print(f"{band_Nm:15.1f}   {m['f_sw_Hz'] / 1e3:10.2f}   {m['torque_ripple_Nm']:19.3f}")
