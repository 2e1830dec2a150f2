"""The file of machine.flux_map: a table of psi_d and psi_q against i_d and i_q. It is read here,
and refused in a line; plant/machines/flux_map.py makes a machine of it.
"""

from __future__ import annotations

import csv
import math
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..given import text_of
from ..plant.machines.flux_map import FluxMap, at_no_current, fit
from .values import SetupError

COLUMNS = ("id_A", "iq_A", "psi_d_Wb", "psi_q_Wb")
#: Least values of a current in the table.
LEAST_VALUES = 5
#: How large psi_q at no current may be, over psi_f.
MOST_TURNED = 1e-3
#: How large L_d at no current may be, over L_q: the firmware drives L_d <= L_q, and a table of
#: equal ones is not exact.
MOST_SALIENT = 1.05
#: By how much d psi_d/d i_q and d psi_q/d i_d may differ, over the smaller inductance at no
#: current; and how far the fluxes of the plant may be from the table's, over psi_f.
MOST_CURL, MOST_OFF = 0.05, 0.01
#: By how much the magnets' flux in a table may differ from machine.psi_f_Wb.
PSI_F_SHARE = 0.25

#: i_d, i_q, and psi_d, psi_q over both.
Table = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def refused(file: str, psi_f_Wb: float, trip_A: float) -> list[str]:
    """A line if the table cannot be used, is another machine's, or ends below the current at which
    the drive trips."""
    try:
        found, axes = _of(file)
    except SetupError as error:
        return [str(error)]
    if abs(found.psi_f_Wb - psi_f_Wb) > PSI_F_SHARE * psi_f_Wb:
        low, high = (1 - PSI_F_SHARE) * psi_f_Wb, (1 + PSI_F_SHARE) * psi_f_Wb
        return [
            f"machine.flux_map = {file!r}: psi_d_Wb at no current = {found.psi_f_Wb:g}: allowed "
            f"is {low:.4g} .. {high:.4g} Wb, within {PSI_F_SHARE:.0%} of machine.psi_f_Wb"
        ]
    return [
        f"machine.flux_map = {file!r}: {name} is {axis[0]:g} .. {axis[-1]:g}: allowed is "
        f"{-trip_A:g} .. {most_A:g} A and more; {trip_A:g} A is controller.i_ab_trip_A"
        for name, axis, most_A in zip(COLUMNS, axes, (0.0, trip_A))
        if axis[0] > -trip_A or axis[-1] < most_A
    ][:1]


def of(file: str) -> FluxMap:
    """The map of a file. SetupError says in one line what is wrong with it."""
    return _of(file)[0]


def _of(file: str) -> tuple[FluxMap, tuple[np.ndarray, np.ndarray]]:
    """The map, and the currents of the table."""
    path = Path(file)
    try:
        return _made(path, path.stat().st_mtime_ns if path.is_file() else 0)
    except InputError as error:
        raise SetupError(f"machine.flux_map = {file!r}: {error}") from None


@lru_cache(maxsize=8)
def _made(path: Path, _changed: int) -> tuple[FluxMap, tuple[np.ndarray, np.ndarray]]:
    found = table(text_of(path))
    return _fitted(found), found[:2]


def table(text: str) -> Table:
    """The table of a file's text. Where it has no negative i_q, the other half is added."""
    found = _rows(text)
    i_d, i_q = (_axis(name, {key[k] for key in found}) for k, name in enumerate(COLUMNS[:2]))
    for d, q in product(i_d, i_q):
        if (d, q) not in found:
            raise InputError(f"the row id_A = {d:g}, iq_A = {q:g} is missing")
    if list(found) not in (sorted(found), sorted(found, key=lambda key: key[::-1])):
        raise InputError("id_A and iq_A must ascend from row to row, one of them within the other")
    psi = np.array([[found[d, q] for q in i_q] for d in i_d])
    both = np.array(i_q)
    if i_q[0] == 0:
        mirror = psi[:, :0:-1] * np.array([1.0, -1.0])
        psi, both = np.concatenate([mirror, psi], 1), np.concatenate([-both[:0:-1], both])
    return np.array(i_d), both, psi[:, :, 0], psi[:, :, 1]


def _rows(text: str) -> dict[tuple[float, float], tuple[float, float]]:
    """(i_d, i_q) -> (psi_d, psi_q), in the file's order."""
    lines = [(n, line) for n, line in enumerate(text.split("\n"), 1)]
    lines = [(n, line) for n, line in lines if line.strip()[:1] not in ("", "#")]
    given = list(zip([n for n, _ in lines], csv.reader([line for _, line in lines])))
    first = [name.strip() for name in given[0][1]] if given else []
    if tuple(first) != COLUMNS:
        raise InputError(f"its first row must be {','.join(COLUMNS)}, not {','.join(first)!r}")
    found: dict[tuple[float, float], tuple[float, float]] = {}
    for n, row in given[1:]:
        d, q, *psi = _numbers(n, row)
        if (d, q) in found:
            raise InputError(f"line {n}: id_A = {d:g}, iq_A = {q:g} is there twice")
        found[d, q] = psi[0], psi[1]
    return found


def _numbers(line: int, row: list[str]) -> list[float]:
    try:
        numbers = [float(cell) for cell in row]
    except ValueError:
        numbers = []
    if len(numbers) != len(COLUMNS) or not all(map(math.isfinite, numbers)):
        raise InputError(f"line {line}: four finite numbers are needed, not {','.join(row)!r}")
    return numbers


def _axis(name: str, values: set[float]) -> list[float]:
    """The values of a current."""
    if len(values) < LEAST_VALUES:
        raise InputError(f"{name} has {len(values)} values: allowed are {LEAST_VALUES} and more")
    if 0.0 not in values:
        raise InputError(f"{name} must have the value 0")
    return sorted(values)


def _fitted(found: Table) -> FluxMap:
    _check(*found)
    made = fit(*found)
    most_Wb = MOST_OFF * made.psi_f_Wb
    if made.off_Wb > most_Wb:
        raise InputError(
            f"no field's energy comes nearer to it than {made.off_Wb:.3g} Wb: allowed is "
            f"{most_Wb:.3g} Wb, {MOST_OFF:.0%} of psi_f; is it smooth?"
        )
    if made.least_per_H <= 0:
        d, q = made.least_at_Wb
        raise InputError(
            f"an incremental inductance is not above 0 at psi_d - psi_f = {d:.3g} Wb, "
            f"psi_q = {q:.3g} Wb"
        )
    return made


def _check(i_d: np.ndarray, i_q: np.ndarray, psi_d: np.ndarray, psi_q: np.ndarray) -> None:
    """What can be said of the numbers themselves."""
    psi_f, ld, lq = at_no_current(i_d, i_q, psi_d, psi_q)
    if psi_f <= 0:
        raise InputError(f"psi_d_Wb at no current = {psi_f:g}: allowed is more than 0")
    across = psi_q[i_d == 0][:, i_q == 0].item()
    if abs(across) > MOST_TURNED * psi_f:
        raise InputError(
            f"psi_q_Wb at no current = {across:g}: the d axis is the magnets' north pole, "
            f"allowed is {MOST_TURNED * psi_f:.3g} Wb"
        )
    for name, slopes in (
        ("psi_d_Wb along id_A", np.diff(psi_d, axis=0)),
        ("psi_q_Wb along iq_A", np.diff(psi_q, axis=1)),
    ):
        if slopes.min() <= 0:
            r, c = np.unravel_index(slopes.argmin(), slopes.shape)
            raise InputError(
                f"{name} must grow: it does not after id_A = {i_d[r]:g}, iq_A = {i_q[c]:g}"
            )
    if ld > MOST_SALIENT * lq:
        raise InputError(
            f"L_d at no current = {ld:.4g} H: allowed is up to {MOST_SALIENT:g} L_q, which is "
            f"{MOST_SALIENT * lq:.4g} H; are the axes exchanged?"
        )
    curl, most = _curl_H(i_d, i_q, psi_d, psi_q), MOST_CURL * min(ld, lq)
    if curl > most:
        raise InputError(
            f"d psi_d/d i_q and d psi_q/d i_d differ by {curl:.3g} H: allowed is {most:.3g} H; "
            "a field that gives back its energy has both the same"
        )


def _curl_H(i_d: np.ndarray, i_q: np.ndarray, psi_d: np.ndarray, psi_q: np.ndarray) -> float:
    """The largest difference of the two cross inductances, at the table's inner rows: central
    differences of both."""
    d_by_q = np.gradient(psi_d, i_q, axis=1)
    q_by_d = np.gradient(psi_q, i_d, axis=0)
    return float(abs(d_by_q - q_by_d)[1:-1, 1:-1].max())
