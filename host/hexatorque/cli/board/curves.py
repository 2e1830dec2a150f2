"""Moving curves of channels in a terminal, in dots of braille characters."""

from __future__ import annotations

import numpy as np
from rich.console import Group
from rich.text import Text

#: Bits of the dots of a braille character, [row][column].
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_COLOURS = ("cyan", "yellow", "green", "magenta", "blue", "red")


def braille(x: np.ndarray, y: np.ndarray, columns: int, rows: int) -> list[str]:
    """Points in the unit square, (0, 0) at the bottom left, as lines of characters."""
    across = np.clip((x * 2 * columns).astype(int), 0, 2 * columns - 1)
    down = np.clip(((1 - y) * 4 * rows).astype(int), 0, 4 * rows - 1)
    cells = np.zeros((rows, columns), int)
    np.bitwise_or.at(cells, (down // 4, across // 2), _DOTS[down % 4, across % 2])
    return ["".join(chr(0x2800 + cell) for cell in row) for row in cells]


class Curves:
    """The latest `window_s` of some channels, one below the other, each on its own scale."""

    def __init__(
        self, names: tuple[str, ...], units: list[str], window_s: float, rows: int = 5
    ) -> None:
        self._names, self._units, self._window_s, self._rows = names, units, window_s, rows
        self._time_s = np.empty(0)
        self._values = np.empty((0, len(names)), np.float32)

    def add(self, time_s: np.ndarray, values: np.ndarray) -> None:
        """Rows with ascending time (n,), (n, channels)."""
        self._time_s = np.concatenate([self._time_s, time_s])
        self._values = np.concatenate([self._values, values])
        first = np.searchsorted(self._time_s, self._time_s[-1] - self._window_s)
        self._time_s, self._values = self._time_s[first:], self._values[first:]

    def latest(self) -> np.ndarray:
        return self._values[-1] if len(self._values) else np.full(len(self._names), np.nan)

    def drawn(self, width: int) -> Group:
        if not len(self._values):
            return Group(Text("no sample yet"))
        columns = max(10, width - 2)
        x = 1 - (self._time_s[-1] - self._time_s) / self._window_s
        parts = []
        for place, (name, unit) in enumerate(zip(self._names, self._units)):
            y = self._values[:, place]
            finite = np.isfinite(y)
            low, high = (float(y[finite].min()), float(y[finite].max())) if finite.any() else (0, 0)
            span = (high - low) or 1.0
            now = float(y[-1])
            title = f"{name} {now:.5g} {unit}".rstrip() + f"   {low:.5g} .. {high:.5g}"
            middle = 0.0 if high > low else 0.5
            lines = braille(x[finite], (y[finite] - low) / span + middle, columns, self._rows)
            colour = _COLOURS[place % len(_COLOURS)]
            parts += [Text(title, style="bold"), Text("\n".join(lines), style=colour)]
        return Group(*parts)
