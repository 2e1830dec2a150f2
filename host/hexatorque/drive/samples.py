"""The samples of a simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import firmware, system
from ..errors import InputError
from ..plant.loop import MORE_CHANNELS, PLANT_CHANNELS
from ..plant.vsd import PHASES, inverse
from ..recording.channels import Channels, Held, Later, Product, RowOf

NOTHING = np.empty((0, 0), np.float32)


class Rows:
    """A table that grows and reuses its memory. New memory pages would take more time than the
    simulation that fills them.

    used: number of filled rows.
    """

    def __init__(self, width: int) -> None:
        self._data = np.empty((0, width), np.float32)
        self.used = 0

    def room(self, rows: int) -> np.ndarray:
        """The next `rows` rows, which the caller fills."""
        end = self.used + rows
        if end > len(self._data):
            grown = np.empty((max(end, 2 * len(self._data)), self._data.shape[1]), np.float32)
            grown[: self.used] = self._data[: self.used]
            self._data = grown
        begin, self.used = self.used, end
        return self._data[begin:end]

    def filled(self) -> np.ndarray:
        return self._data[: self.used]

    def clear(self) -> None:
        self.used = 0

    def hand_over(self) -> np.ndarray:
        """The filled rows, which now belong to the caller."""
        filled = self.filled()
        if 2 * len(filled) < len(self._data):
            filled = filled.copy()  # a small part of the memory must not hold all of it
        else:
            self._data = np.empty_like(self._data)
        self.clear()
        return filled


class Samples:
    """The plant's true values, so many samples a control period, and the firmware's channels once a
    period."""

    def __init__(self, per_period: int, displacement_deg: float, more: Sequence[str] = ()) -> None:
        """more: which of `loop.MORE_CHANNELS` there are."""
        self.per_period = per_period
        self._width = len(PLANT_CHANNELS) + len(MORE_CHANNELS) * bool(more)
        self._columns = [
            (column, name, unit)
            for column, (name, unit) in enumerate((*PLANT_CHANNELS, *MORE_CHANNELS))
            if column < len(PLANT_CHANNELS) or name in more
        ]
        self._phases = inverse(displacement_deg).astype(np.float32)
        self.plant = Rows(self._width)
        self.channels = Rows(len(firmware.channels()))

    def room(self, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """The next rows of both, which the caller fills."""
        return self.plant.room(periods * self.per_period), self.channels.room(periods)

    def check_room(self, periods: int, period_s: float) -> None:
        """InputError if a recording with so many periods more takes over half of this computer's
        memory. Who saves it has an array for each channel beside the tables."""
        names = len(PHASES) + len(self._columns) + len(firmware.channels())
        values = self.per_period * (self._width + names) + len(firmware.channels())
        room = system.memory_bytes() // 2 // (values * np.float32().itemsize) - self.channels.used
        if periods > room:
            raise InputError(
                f"duration_s = {periods * period_s:g}: this computer has memory for a recording "
                f"of {max(0, room) * period_s:.1f} s more"
            )

    def clear(self) -> None:
        self.plant.clear()
        self.channels.clear()

    def hand_over(self) -> tuple[Channels, dict[str, str]]:
        """The channels of a recording and their units. The channels get the memory that the
        simulation has filled, and are made when they are asked for."""
        plant, telemetry = self.plant.hand_over(), self.channels.hand_over()
        samples = len(plant)
        units: dict[str, str] = {}
        data: dict[str, Later] = {}
        phases = Product(self._phases, plant[:, :4])
        for row, phase in enumerate(PHASES):
            data[f"plant.i_{phase}_A"] = RowOf(0, samples, phases, row)
            units[f"plant.i_{phase}_A"] = "A"
        for column, name, unit in self._columns:
            data[f"plant.{name}"] = Held(0, samples, plant[:, column])
            units[f"plant.{name}"] = unit
        for column, (name, unit) in enumerate(firmware.channels()):
            data[name] = Held(0, samples, telemetry[:, column], self.per_period)
            units[name] = unit
        return Channels(data), units
