"""A feature that only watches changes no bit of the drive that it watches."""

import numpy as np

from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.setups import Setup


def same_bits(setup: Setup, watched: dict[str, object]) -> bool:
    """Whether a drive that starts and speeds up ends in the same state with these keys."""
    states = []
    for keys in ({}, watched):
        sim = SimulatedDrive(setup.changed(keys))
        sim.start()
        sim.set("speed_ref_rpm", 300)
        sim.run(0.6, record=False)
        states.append(sim.plant_state.copy())
    return np.array_equal(*states)
