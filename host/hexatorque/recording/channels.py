"""The channels of a recording by name.

The firmware has one value per control period, the plant several. Both stand on one time axis, so a
firmware's channel repeats each value. There are about eighty channels and most are never looked at:
the samples of one are made when somebody asks for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np


@dataclass(frozen=True)
class Later:
    """Samples begin <= k < end of a channel, which `samples` makes. It copies with numpy's
    assignment, which leaves Python's lock to other threads."""

    begin: int
    end: int

    def __len__(self) -> int:
        return self.end - self.begin

    def part(self, first: int, last: int) -> Self:
        """Samples first <= k < last, counted from `begin`, as far as there are any."""
        begin = min(self.begin + first, self.end)
        return replace(self, begin=begin, end=max(begin, min(self.begin + last, self.end)))

    def samples(self) -> np.ndarray:
        raise NotImplementedError


@dataclass(frozen=True)
class Held(Later):
    """A channel whose sample k is values[k // per]."""

    values: np.ndarray
    per: int = 1

    def samples(self) -> np.ndarray:
        skipped = self.begin // self.per
        rows = self.values[skipped : -(-self.end // self.per)]
        repeated = np.empty((len(rows), self.per), rows.dtype)
        repeated[:] = rows[:, np.newaxis]
        return repeated.reshape(-1)[self.begin - skipped * self.per :][: len(self)]


class Product:
    """weights @ values.T, (rows, n), computed when somebody asks for it."""

    def __init__(self, weights: np.ndarray, values: np.ndarray) -> None:
        self._weights, self._values = weights, values

    @cached_property
    def rows(self) -> np.ndarray:
        return self._weights @ self._values.T


@dataclass(frozen=True)
class RowOf(Later):
    """A channel that is a row of a product."""

    product: Product
    row: int

    def samples(self) -> np.ndarray:
        return self.product.rows[self.row, self.begin : self.end]


class Channels(MutableMapping[str, np.ndarray]):
    """name -> (n,) array. Order is that of the names as they were given."""

    def __init__(self, channels: Mapping[str, np.ndarray | Later]) -> None:
        self._channels: dict[str, np.ndarray | Later] = {}
        self |= channels

    def __getitem__(self, name: str) -> np.ndarray:
        channel = self._channels[name]
        if isinstance(channel, Later):
            channel = self._channels[name] = channel.samples()
        return channel

    def __setitem__(self, name: str, channel: np.ndarray | Later) -> None:
        self._channels[name] = channel

    def __delitem__(self, name: str) -> None:
        del self._channels[name]

    def __contains__(self, name: object) -> bool:
        return name in self._channels

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)

    def __or__(self, other: Mapping[str, np.ndarray]) -> Channels:
        both = Channels(self)
        both |= other
        return both

    def __ror__(self, other: Mapping[str, np.ndarray]) -> Channels:
        return Channels(other) | self

    def __ior__(self, other: Mapping[str, np.ndarray | Later]) -> Channels:
        self._channels |= other._channels if isinstance(other, Channels) else other
        return self

    def lengths(self) -> set[int]:
        """The numbers of samples that occur; one number if the recording is whole."""
        return {len(channel) for channel in self._channels.values()}

    def part(self, first: int, last: int) -> Channels:
        """Samples first <= k < last of all channels. Arrays are views."""
        return Channels(
            {
                name: c.part(first, last) if isinstance(c, Later) else c[first:last]
                for name, c in self._channels.items()
            }
        )
