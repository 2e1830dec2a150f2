"""The quantities of the comparison: means over windows of values that do not depend on where the
rotor stands or on the single pulse, made from the firmware's channels of the bench or of the
simulation.

Currents are seen from the estimated flux: along it they magnetise, across it they make torque. In
the x-y plane, unbalance makes the first harmonic, and the inverter's error voltage the fifth and
the seventh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..plant.machines import parameters_of
from ..plant.vsd import PHASES, harmonics_in_xy, transform
from .bench import SETS

#: A window lasts this long; less if the recording is short, but some periods of the slow loop.
WINDOW_S, MOST_WINDOWS_OF_SHORT, LEAST_PERIODS = 0.1, 8, 3
#: The same of a recording that knows no flux: its currents have to turn within a window.
MOST_WINDOWS_OUTSIDE = 3
#: Harmonics need this many turns of the flux in a window.
TURNS = 1.0


@dataclass(frozen=True)
class Quantity:
    """unit; about: its use; columns: how many numbers a window has of it."""

    unit: str
    about: str
    columns: int = 1


#: What such a quantity tells depends on the kind of machine: its `Parameters.TELLS`. A kind without
#: it there has no such quantity.
OF_MACHINE = ""
QUANTITIES: dict[str, Quantity] = {
    "current amplitude": Quantity("A", OF_MACHINE),
    "current along the flux": Quantity("A", OF_MACHINE),
    "current across the flux": Quantity("A", "torque of a given flux"),
    "estimated flux": Quantity("Wb", "held by the control"),
    "estimated torque": Quantity("N m", "held by the control"),
    "shaft torque": Quantity("N m", "J, friction, load; true torque"),
    "slip": Quantity("rad/s", OF_MACHINE),
    "R_s in use": Quantity("ohm", "R_s, dead time, drops"),
    "R_r in use": Quantity("ohm", OF_MACHINE),
    "psi_f in use": Quantity("Wb", OF_MACHINE),
    "current ripple": Quantity("A", OF_MACHINE),
    "torque ripple": Quantity("N m", OF_MACHINE),
    "x-y ripple": Quantity("A", "L_xy"),
    "unbalance": Quantity("A", "gains of single sensors", 6),
    "sum of currents": Quantity("A", "gains of single sensors", 4),
    "x-y harmonics 5, 7": Quantity("A", "dead time, drops, L_xy", 4),
    "alpha-beta harmonics 5, 7": Quantity("A", "dead time, drops", 4),
    "x-y voltage 5, 7": Quantity("1", "dead time, drops", 4),
}
#: What changes from one sample to the next.
RIPPLES = ("current ripple", "torque ripple", "x-y ripple")

#: Values that the drive has learnt -> their channels.
IN_USE = {"R_s in use": "rs_ohm", "R_r in use": "rr_ohm", "psi_f in use": "psi_f_Wb"}


def about(name: str, model: str) -> str | None:
    """What a quantity tells of a machine of this model. None if the model has no such one."""
    return QUANTITIES[name].about or parameters_of(model).TELLS.get(name)


def windows(periods: int, slow_s: float, outside: bool = False) -> np.ndarray:
    """The window of each period of the slow loop, (periods,), -1 for the rest at the end."""
    most = MOST_WINDOWS_OUTSIDE if outside else MOST_WINDOWS_OF_SHORT
    length = min(round(WINDOW_S / slow_s), periods // most)
    length = max(length, LEAST_PERIODS)
    which = np.arange(periods) // length
    which[periods // length * length :] = -1
    return which


def _mean(values: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    """Mean of each window, NaN if more than half of it is lost."""
    good = np.isfinite(values) & (which >= 0)
    counts = np.bincount(which[good], minlength=n)
    full = np.bincount(which[which >= 0], minlength=n)
    sums = np.bincount(which[good], values[good].real, n).astype(complex)
    if np.iscomplexobj(values):
        sums += 1j * np.bincount(which[good], values[good].imag, n)
    means = np.where(2 * counts > full, sums / np.maximum(counts, 1), np.nan)
    return means if np.iscomplexobj(values) else means.real


def _ripple(values: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    """rms of the change from sample to sample: the quick part, not the drive's own motion."""
    steps = np.diff(values, prepend=values[:1])
    return np.sqrt(_mean(np.abs(steps) ** 2, which, n) / 2)


def _parts(*values: np.ndarray) -> np.ndarray:
    return np.column_stack([part for value in values for part in (value.real, value.imag)])


def compute(
    samples: Mapping[str, np.ndarray],
    which: np.ndarray,
    pole_pairs: int,
    displacement_deg: float,
    outside_step_s: float | None = None,
) -> dict[str, np.ndarray]:
    """samples: channels; which: window of each sample, -1 for none; displacement_deg: of the
    winding's sets; outside_step_s: step of a recording by another instrument than the board, which
    knows no flux. Returns name -> (windows, columns), as far as the channels give them."""
    if outside_step_s is not None:
        return _outside(samples, which, pole_pairs, displacement_deg, outside_step_s)
    n = int(which.max()) + 1
    get = lambda name: np.asarray(samples[name], float)  # noqa: E731
    found: dict[str, np.ndarray] = {}
    flux = get("psi_alpha_Wb") + 1j * get("psi_beta_Wb")
    turn = flux / np.abs(flux)
    phases = _phases(samples)
    ab, xy = _planes(phases, displacement_deg)
    seen = ab * np.conj(turn)
    found["current along the flux"] = _mean(seen.real, which, n)
    found["current across the flux"] = _mean(seen.imag, which, n)
    found["estimated flux"] = _mean(np.abs(flux), which, n)
    found["current ripple"] = _ripple(seen, which, n)
    found["x-y ripple"] = _ripple(xy, which, n)
    if "torque_Nm" in samples:
        found["estimated torque"] = _mean(get("torque_Nm"), which, n)
        found["torque ripple"] = _ripple(get("torque_Nm"), which, n)
    if "omega_sync_rad_s" in samples:
        slip = get("omega_sync_rad_s") - pole_pairs * get("speed_rpm") * np.pi / 30
        found["slip"] = _mean(slip, which, n)
    for name, channel in IN_USE.items():
        if channel in samples:
            found[name] = _mean(get(channel), which, n)
    harmonic = _harmonics(turn, which, n)
    rest = _without_fundamental(ab, harmonic, turn, which)
    found |= _of_turn(harmonic, rest * _hann(which, n), xy, displacement_deg)
    if all(_all(samples, one) for one in SETS):
        sums = [np.sum([get(f"i_{p}_A") for p in one], axis=0) for one in SETS]
        found["sum of currents"] = _parts(*(harmonic(one.astype(complex), 1) for one in sums))
    if harmonics_in_xy(displacement_deg) and "v_x_pu" in samples and "v_y_pu" in samples:
        voltage = get("v_x_pu") + 1j * get("v_y_pu")
        found["x-y voltage 5, 7"] = _parts(harmonic(voltage, 5), harmonic(voltage, -7))
    return {name: values.reshape(n, -1) for name, values in found.items()}


def _of_turn(
    harmonic: Callable,
    rest: np.ndarray,
    xy: np.ndarray,
    displacement_deg: float,
) -> dict[str, np.ndarray]:
    """Negative sequence and first harmonic in x-y, and the fifth and seventh in the plane in which
    the winding has them. rest: the current in alpha-beta without its fundamental, weighted."""
    found = {"unbalance": _parts(harmonic(xy, 1), harmonic(xy, -1), harmonic(rest, -1))}
    if harmonics_in_xy(displacement_deg):
        found["x-y harmonics 5, 7"] = _parts(harmonic(xy, 5), harmonic(xy, -7))
    else:
        found["alpha-beta harmonics 5, 7"] = _parts(harmonic(rest, -5), harmonic(rest, 7))
    return found


def _harmonics(turn: np.ndarray, which: np.ndarray, n: int) -> Callable:
    slow = np.abs(_turned(turn, which, n)) < TURNS

    def harmonic(values: np.ndarray, order: int) -> np.ndarray:
        means = _mean(values * np.conj(turn**order), which, n)
        means[slow] = np.nan
        return means

    return harmonic


def _without_fundamental(
    ab: np.ndarray, harmonic: Callable, turn: np.ndarray, which: np.ndarray
) -> np.ndarray:
    """It is many times larger than the rest, and a window is no whole number of its turns."""
    return ab - harmonic(ab, 1)[which] * turn


def _outside(
    samples: Mapping[str, np.ndarray],
    which: np.ndarray,
    pole_pairs: int,
    displacement_deg: float,
    step_s: float,
) -> dict[str, np.ndarray]:
    """Without the flux, the current itself tells where it stands. A window is no whole number of
    its turns, and begins at another angle than the simulation's: weights keep harmonics apart."""
    n = int(which.max()) + 1
    ab, xy = _planes(_phases(samples), displacement_deg)
    size = np.abs(ab)
    turn = ab / np.where(size > 0, size, 1.0)
    weights, harmonic = _hann(which, n), _harmonics(turn, which, n)
    rest, xy = _without_fundamental(ab, harmonic, turn, which) * weights, xy * weights
    found = {
        "current amplitude": _mean(size, which, n),
        **_of_turn(harmonic, rest, xy, displacement_deg),
    }
    if "speed_rpm" in samples:
        turns = _turned(turn, which, n)
        frequency = _slopes(np.unwrap(np.angle(turn)), which, n) / step_s
        speed = _mean(np.asarray(samples["speed_rpm"], float), which, n) * np.pi / 30
        slip = frequency - pole_pairs * speed
        # Where the current does not turn, its angle is noise.
        found["slip"] = np.where(np.abs(turns) < TURNS, np.nan, slip)
    return {name: values.reshape(n, -1) for name, values in found.items()}


def _all(samples: Mapping[str, np.ndarray], phases: tuple[str, ...]) -> bool:
    return all(f"i_{phase}_A" in samples for phase in phases)


def _phases(samples: Mapping[str, np.ndarray]) -> np.ndarray:
    """(6, n). A phase that is not recorded follows from the isolated neutral."""
    known = {p: np.asarray(samples[f"i_{p}_A"], float) for p in PHASES if f"i_{p}_A" in samples}
    for phases in SETS:
        for phase in phases:
            if phase not in known:
                others = [known[other] for other in phases if other != phase]
                known[phase] = -np.sum(others, axis=0)
    return np.array([known[phase] for phase in PHASES])


def _planes(phases: np.ndarray, displacement_deg: float) -> tuple[np.ndarray, np.ndarray]:
    alpha, beta, x, y = transform(displacement_deg) @ phases
    return alpha + 1j * beta, x + 1j * y


def _hann(which: np.ndarray, n: int) -> np.ndarray:
    """Weights of mean 1 within each window."""
    good = which >= 0
    counts = np.bincount(which[good], minlength=n)
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]])
    at = np.arange(len(which)) - begins[which] + 0.5
    return np.where(good, 1 - np.cos(2 * np.pi * at / np.maximum(counts, 1)[which]), 0.0)


def _slopes(values: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    """Slope of a straight line through each window's samples, per sample."""
    good = (which >= 0) & np.isfinite(values)
    window = which[good]
    counts = np.maximum(np.bincount(window, minlength=n), 1)

    def about_mean(samples: np.ndarray) -> np.ndarray:
        return samples - (np.bincount(window, samples, n) / counts)[window]

    at = about_mean(np.flatnonzero(good).astype(float))
    squares = np.bincount(window, at**2, n)
    return np.bincount(window, at * about_mean(values[good]), n) / np.where(
        squares, squares, np.nan
    )


def _turned(turn: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    """Turns of the flux in each window."""
    steps = np.angle(turn[1:] * np.conj(turn[:-1]), deg=False)
    steps = np.where(np.isfinite(steps), steps, 0.0)
    steps = np.concatenate([steps[:1], steps])
    good = which >= 0
    return np.bincount(which[good], steps[good], n) / (2 * np.pi)
