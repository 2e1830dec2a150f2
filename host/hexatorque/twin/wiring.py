"""Whether the currents of an oscilloscope stand where their names say: the phases of a winding set
120 degrees from each other, the sets as far apart as in the winding."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..plant.vsd import PHASES, angles_rad
from ..recording.recording import RecordingError

TOLERANCE_DEG = 20.0
#: The direction of rotation is found in pieces of this time.
PIECE_S = 0.1
#: A current below this share of the usual one has no angle; one beyond SCALE of it is told.
SMALL, SCALE = 0.2, 1.33
#: Share of the currents that has to turn together, and turns, for an angle to be known.
COHERENT, TURNS = 0.5, 1.0


def check(
    phases: Mapping[str, np.ndarray],
    rate_Hz: float,
    speed_rpm: np.ndarray | None,
    displacement_deg: float = 30.0,
) -> list[str]:
    """Remarks on the currents, phase -> samples. RecordingError if one is not that of
    its phase. Without a speed, the direction is the one that fits better."""
    names = list(phases)
    turning = np.array([_analytic(np.nan_to_num(np.asarray(phases[p], float))) for p in names])
    axis_rad = axes_rad(displacement_deg)
    axes = np.array([axis_rad[p] for p in names])
    products, turns = np.zeros((len(names),) * 2, complex), 0.0
    length = max(2, round(PIECE_S * rate_Hz))
    for begin in range(0, turning.shape[1], length):
        piece = turning[:, begin : begin + length]
        if _backwards(
            piece, axes, None if speed_rpm is None else speed_rpm[begin : begin + length]
        ):
            piece = piece.conj()
        products += piece @ piece.conj().T
        strong = piece[np.argmax(np.sum(np.abs(piece) ** 2, axis=1))]
        turns += abs(np.sum(np.angle(strong[1:] * strong[:-1].conj()))) / (2 * np.pi)
    sizes = np.sqrt(np.diag(products).real)
    usual = float(np.median(sizes))
    if usual <= 0:
        return ["the currents do not turn: the order of the phases is not checked"]
    seen = [n for n in range(len(names)) if sizes[n] >= SMALL * usual]
    together = np.abs(products) / np.maximum(np.outer(sizes, sizes), 1e-300)
    if turns < TURNS or np.median(together[np.ix_(seen, seen)]) < COHERENT:
        return ["the currents do not turn: the order of the phases is not checked"]
    off = np.angle(products * np.exp(1j * (axes[:, None] - axes[None, :])), deg=True)
    fits = np.abs(off) <= TOLERANCE_DEG
    best = max(seen, key=lambda n: int(fits[seen, n].sum()))
    wrong = [n for n in seen if not fits[n, best]]
    if wrong:
        raise RecordingError(
            "; ".join(_place(axis_rad, names[n], names[best], off[n, best]) for n in wrong)
        )
    return [
        f"i_{names[n]}_A is {sizes[n] / usual:.3g} times the other currents: check its probe's "
        "scale"
        for n in range(len(names))
        if not 1 / SCALE < sizes[n] / usual < SCALE
    ]


def axes_rad(displacement_deg: float) -> dict[str, float]:
    """Electrical angle of each winding's axis."""
    return dict(zip(PHASES, angles_rad(displacement_deg)))


def _place(axis_rad: Mapping[str, float], name: str, other: str, off_deg: float) -> str:
    """One phase at the wrong place, and the places that it may be at instead."""
    wanted = float(np.degrees(axis_rad[name] - axis_rad[other]))
    at = wanted - off_deg  # how far it lags
    text = (
        f"i_{name}_A is not phase {name}: it lags i_{other}_A by {_turn(at):.0f} degrees, "
        f"{_turn(wanted):.0f} +- {TOLERANCE_DEG:.0f} is allowed"
    )
    for phase, axis in axis_rad.items():
        for turned in (0.0, 180.0):
            its = float(np.degrees(axis - axis_rad[other])) + turned
            if abs(_turn(at - its)) <= 10 and not (phase != name and turned):
                return f"{text}; it is like {phase if phase != name else 'a probe turned round'}"
    return text


def _turn(degrees: float) -> float:
    """-180 < angle <= 180."""
    return 180.0 - (180.0 - degrees) % 360.0


def _analytic(values: np.ndarray) -> np.ndarray:
    """The values as an analytic signal: without their mean and the negative frequencies."""
    spectrum = np.fft.fft(values - values.mean())
    spectrum[(len(values) + 1) // 2 :] = 0.0
    return 2 * np.fft.ifft(spectrum)


def _backwards(piece: np.ndarray, axes: np.ndarray, speed_rpm: np.ndarray | None) -> bool:
    if speed_rpm is not None:
        return bool(np.nansum(speed_rpm) < 0)
    # The current of the phase at angle a lags that at 0 by a, if they turn forwards.
    forwards, back = (
        float(np.sum(np.abs(np.exp(1j * sign * axes) @ piece))) for sign in (1.0, -1.0)
    )
    return back > 1.2 * forwards
