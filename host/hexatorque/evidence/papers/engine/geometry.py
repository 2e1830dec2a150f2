"""The 64 voltage vectors, computed from the six phase angles alone, for comparison with the
firmware's tables. Vectors are complex numbers in units of Vdc. Direction k = 0..11 is at 15 + 30 k
degrees in alpha-beta; both papers count it from 1."""

from __future__ import annotations

from functools import cache

import numpy as np

from ....plant.vsd import ANGLES_RAD

#: (64, 6): leg states of each state word, in the order u1 u2 w1 w2 v1 v2. u1 is the highest bit.
BITS = np.arange(64)[:, None] >> np.arange(5, -1, -1) & 1
AB = BITS @ np.exp(1j * ANGLES_RAD) / 3
XY = BITS @ np.exp(5j * ANGLES_RAD) / 3
ZEROS = (0, 21, 42, 63)

#: Sectors of both planes, as paper B numbers them.
ROMAN = ["i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii"]

#: Lengths of the groups in alpha-beta, by paper A's names. Paper B calls them L1..L4, in this
#: order.
LENGTH = {
    "L": 2 / 3 * np.cos(np.deg2rad(15)),
    "ML": np.sqrt(2) / 3,
    "MS": 1 / 3,
    "S": 2 / 3 * np.cos(np.deg2rad(75)),
}


def degrees(z: complex | np.ndarray) -> np.ndarray:
    """Angle in degrees, from 0 to below 360."""
    return np.rad2deg(np.angle(z)) % 360


def apart(a: float | np.ndarray, b: float | np.ndarray) -> np.ndarray:
    """Angle from b to a in degrees, from -180 to below 180."""
    return (np.asarray(a) - b + 180) % 360 - 180


def sector(z: complex | np.ndarray) -> np.ndarray:
    """Sector s = 0..11, centred on 30 s degrees. Both planes count in the same way."""
    return np.floor((degrees(z) + 15) / 30).astype(int) % 12


def group(word: int) -> str:
    """The group of a word: L, ML, MS, S, or "0" for the zero vectors."""
    near = [name for name, r in LENGTH.items() if abs(abs(AB[word]) - r) < 1e-9]
    return near[0] if near else "0"


@cache
def word_along(name: str, angle_deg: float) -> int:
    """The word of group L, ML or S with that direction in alpha-beta."""
    angle = degrees(AB)
    (word,) = [w for w in range(64) if group(w) == name and abs(apart(angle[w], angle_deg)) < 1e-6]
    return word


#: (12,) words of each group with one vector per direction.
WORDS = {
    name: np.array([word_along(name, 15 + 30 * k) for k in range(12)]) for name in ("L", "ML", "S")
}


def turned(word: int, sectors: int) -> int:
    """The vector of the same group, turned by `sectors` times 30 degrees. A zero vector stays as it
    is."""
    if group(word) == "0":
        return word
    return word_along(group(word), float(degrees(AB[word])) + 30 * sectors)


def nearest_zero(word: int) -> int:
    """Zero state with the fewest transitions from `word`."""
    return min(ZEROS, key=lambda zero: (word ^ zero).bit_count())


def digits(words: tuple[int, int, int]) -> str:
    """Paper A's switching sequences of the six legs. Each leg's digit is 4 S1 + 2 S2 + S3."""
    first, second, third = (BITS[w] for w in words)
    return "".join(map(str, 4 * first + 2 * second + third))
