"""True machines, and the data of them that a user is told, whatever their kind."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

from ...setups import Setup

#: Standard deviation of a drawn value over its published one, logarithmic.
SCATTER = 0.15


@dataclass(frozen=True)
class Truth:
    """machine: its values by key. draw: for the data that are stated."""

    name: str
    power_kW: float
    machine: dict[str, Any]
    draw: random.Random


@dataclass(frozen=True)
class Told:
    """The set-up of a user; speed and torque that are 100 % for this one, and the highest speed
    over that one."""

    setup: Setup
    speed_rpm: float
    torque_Nm: float
    fast: float = 1.5


def asked(of: Told) -> Told:
    """The same with a profile in the file, as in that of any user."""
    profile = {
        "profile.duration_s": 60.0,
        "profile.speed_rpm": [[0.0, of.speed_rpm], [40.0, of.fast * of.speed_rpm]],
        "profile.load_Nm": [[0.0, 0.0], [20.0, of.torque_Nm], [40.0, 0.0]],
    }
    return replace(of, setup=of.setup.changed(profile))
