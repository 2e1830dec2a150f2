"""Simulated drives at operating points, relative to their design."""

import numpy as np

from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import BUILD, CALIBRATE
from hexatorque.setups import parameters
from hexatorque.setups.design import Design

ALIGNED_S = 5.0
SAMPLES = 4


def begun(setup):
    """The drive as it runs after its start or alignment, and its design."""
    drive = SimulatedDrive(setup, SAMPLES)
    drive.start()
    while drive.time_s < ALIGNED_S and drive.state in (CALIBRATE, BUILD):
        drive.run(0.1, record=False)
    return drive, Design(setup, parameters(setup).__getitem__)


def at(drive, design, speed_pu, load_pu, seconds=0.5):
    """Bring the drive to a point, and record it."""
    drive.set("speed_ref_rpm", speed_pu * design.rated_rpm)
    drive.run(0.6, record=False)
    for share in np.linspace(0.1, 1, 10):
        drive.set("load_Nm", share * load_pu * design.rated_Nm)
        drive.run(0.1, record=False)
    drive.run(seconds, record=False)
    drive.discard()
    drive.run(0.2)
    return drive.take()
