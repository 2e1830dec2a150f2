"""True machines, and the data of them that a user is told, whatever their kind."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

from ...setups import Setup, parameters
from ...setups.design import REACH_PU, USABLE, Design

#: Standard deviation of a drawn value over its published one, logarithmic.
SCATTER = 0.15
#: Load at the highest speed, in rated torques; but at most this share of what the true machine
#: carries there.
FAST_LOAD, FAST_SHARE = 0.5, 0.7


@dataclass(frozen=True)
class Truth:
    """machine: its values by key. draw: for the data that are stated."""

    name: str
    power_kW: float
    machine: dict[str, Any]
    draw: random.Random


@dataclass(frozen=True)
class Told:
    """The set-up of a user; speed and torque that are 100 % for this one, the highest speed over
    that one, and the load there."""

    setup: Setup
    speed_rpm: float
    torque_Nm: float
    fast: float = 1.5
    fast_Nm: float = 0.0


def asked(true: Truth, of: Told) -> Told:
    """The same with a profile in the file, as in that of any user, with all that is asked."""
    values = {f"machine__{name}": value for name, value in true.machine.items()}
    design = Design(of.setup.changed(**values), parameters(of.setup).__getitem__)
    voltage_V = USABLE * REACH_PU * design.vdc_V
    most_Nm = design.most_torque_Nm(of.fast * of.speed_rpm, voltage_V)
    fast_Nm = min(FAST_LOAD * of.torque_Nm, FAST_SHARE * most_Nm)
    profile = {
        "profile.duration_s": 60.0,
        "profile.speed_rpm": [[0.0, of.speed_rpm], [40.0, of.fast * of.speed_rpm]],
        "profile.load_Nm": [[0.0, 0.0], [20.0, of.torque_Nm], [40.0, 0.0], [50.0, fast_Nm]],
    }
    return replace(of, setup=of.setup.changed(profile), fast_Nm=fast_Nm)
