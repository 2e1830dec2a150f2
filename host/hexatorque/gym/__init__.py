"""The six-phase drive as an environment of Gymnasium: `pip install 'hexatorque[gym]'`.

import gymnasium, hexatorque.gym
env = gymnasium.make("hexatorque/Voltage-v0", setup="paper-b")

docs/gym.md describes the three levels of action, what is observed, and the reward.
"""

from __future__ import annotations

import gymnasium

from .environment import IDS, SixPhaseDrive
from .many import Many
from .reward import Passed, tracking

__all__ = ["IDS", "Many", "Passed", "SixPhaseDrive", "tracking"]

for _level, _id in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point="hexatorque.gym.environment:SixPhaseDrive",
            vector_entry_point="hexatorque.gym.many:Many",
            kwargs={"level": _level},
        )
