"""Edges of the inverter's legs over a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .inverter import in_effect
from .legs import BREAK


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


class EdgeLog:
    """Keeps edges as `loop.run_periods` writes them, `capacity` at most. kept: how many there are
    so far."""

    def __init__(self, inverter: np.record, capacity: int = 0) -> None:
        self.rows = np.empty((capacity, 3), np.int64)
        self.kept = 0
        self._broken, self._command = inverter.contact.broken.copy(), inverter.command.copy()

    @property
    def filled(self) -> np.ndarray:
        return self.rows[: self.kept]

    def since(self, begin: int, clock_Hz: float, start: np.ndarray) -> Edges:
        """The edges of the legs themselves, on the time axis that begins with count `begin`, where
        the legs' states were `start`, (6,)."""
        time_s = (self.filled[:, 0] - begin) / clock_Hz
        order = np.argsort(time_s, kind="stable")
        leg, state = self.filled[order, 1], self.filled[order, 2]
        if np.any(self._broken) or np.any(state >= BREAK):
            state = self._in_effect(leg, state)
        return Edges(start, time_s[order], leg, state)

    def _in_effect(self, legs: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The logged edges that are left in legs of which some are broken."""
        broken, command = self._broken.copy(), self._command.copy()
        found = np.empty_like(states)
        for edge, (leg, state) in enumerate(zip(legs, states)):
            if state >= BREAK:
                broken[leg] = state - BREAK
            else:
                command[leg] = state
            found[edge] = in_effect(broken[leg], command[leg])
        return found
