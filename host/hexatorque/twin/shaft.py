"""The torque that the recorded speed needs: inertia, friction and load."""

from __future__ import annotations

import numpy as np

from ..plant.load import load_record, load_torque
from ..setups import Setup

#: The load over time: (time in s of the recording, torque).
Load = tuple[tuple[float, float], ...]
NO_LOAD: Load = ((float("-inf"), 0.0),)


def per_window(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Means over the windows of a value for each period of the slow loop; -1 is no window."""
    n = int(which.max()) + 1
    good = which >= 0
    return np.bincount(which[good], values[good], n) / np.bincount(which[good], minlength=n)


def parts(
    setup: Setup,
    load: Load,
    omega_rad_s: np.ndarray,
    time_s: np.ndarray,
    slow_s: float,
    which: np.ndarray,
) -> dict[str, np.ndarray]:
    """Means over the windows, (windows,): torque `needed`, and how it changes with a share of J,
    with friction in N m s and with a load in N m. omega_rad_s: at the ends of the periods that
    begin at time_s."""
    middle = (omega_rad_s[:-1] + omega_rad_s[1:]) / 2
    inertial = setup["machine.inertia_kgm2"] * np.diff(omega_rad_s) / slow_s
    one = load_record(setup["load.kind"], 1.0, setup["load.at_rpm"])
    shape = np.array([load_torque(one, omega) for omega in middle])
    torque = np.zeros(len(middle))
    for begin_s, value_Nm in load:
        torque[time_s >= begin_s - 1e-9] = value_Nm
    needed = inertial + setup["machine.viscous_Nms"] * middle + torque * shape
    values = {"needed": needed, "J": inertial, "friction": middle, "load": shape}
    return {name: per_window(value, which) for name, value in values.items()}
