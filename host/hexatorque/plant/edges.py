"""Edges of the inverter's legs over a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Edges:
    """The edges of the six legs during a recording.

    start: states (LOW, HIGH or OFF) at the first sample; time_s: instants after the first sample,
    ascending; leg; state: the new one.
    """

    start: np.ndarray
    time_s: np.ndarray
    leg: np.ndarray
    state: np.ndarray
