"""A step's measurement for a picture: the samples, and the fit that the result comes from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from . import alignment, inductance, wiring
from .result import Findings

#: Most points of a picture, and of the picture of a wave: enough to see that it repeats.
MOST, OF_WAVE = 400, 60


class Picture(NamedTuple):
    """x rises. fit: None if there is none."""

    title: str
    x_label: str
    y_label: str
    x: list[float]
    measured: list[float]
    fit: list[float] | None


def pictures(step: str, found: Findings) -> list[Picture]:
    """The pictures of a step that has ended."""
    return _PICTURES[step](found)


def _picture(
    title: str,
    x_label: str,
    y_label: str,
    x: np.ndarray,
    measured: np.ndarray,
    fit: np.ndarray | None,
) -> Picture:
    every = max(1, -(-len(x) // MOST))
    curve = None if fit is None else fit[::every].tolist()
    return Picture(title, x_label, y_label, x[::every].tolist(), measured[::every].tolist(), curve)


def _wiring(found: Findings) -> list[Picture]:
    assert found.wiring
    wires = found.wiring
    right = wiring.machine_per_H(wires.ab_per_H, wires.xy_per_H).ravel() if wires.ab_per_H else None
    return [
        _picture(
            "Slope of each current for a voltage on each leg; fit: a machine that is wired right",
            "sensor u1 with each leg, then u2, …", "A/s per V",
            1.0 + np.arange(36), wires.response_per_H.ravel(), right,
        )
    ]  # fmt: skip


def _resistance(found: Findings) -> list[Picture]:
    assert found.resistance
    i, lost = found.resistance.curve[np.argsort(found.resistance.curve[:, 0])].T
    fit = found.resistance.mean_lost_V.value * np.clip(i / found.resistance.knee_A, -1, 1)
    title = "Voltage that the legs lose to dead time and devices"
    return [_picture(title, "current, A", "V", i, lost, fit)]


def _inductance(found: Findings) -> list[Picture]:
    coils = found.inductance or found.salient
    assert coils
    drawn = []
    for wave, axis, name in zip(coils.waves, (0, 2), ("alpha", "x")):
        i, fit = inductance.fitted(wave, axis)
        time_ms = 1e3 * wave.dt_s * np.arange(len(i))
        title = f"Current along {name} under a square wave of voltage"
        drawn.append(
            _picture(title, "time, ms", "A", time_ms[:OF_WAVE], i[:OF_WAVE], fit[:OF_WAVE])
        )
    return drawn


def _encoder(found: Findings) -> list[Picture]:
    assert found.encoder
    speed_rpm, field_rpm = found.encoder.speed_rpm, found.encoder.field_rpm
    share, field = np.linspace(0, 100, len(speed_rpm)), np.full(len(speed_rpm), field_rpm)
    title = "Speed of the shaft while the field turns; fit: the field's"
    return [_picture(title, "share of the last half second, %", "r/min", share, speed_rpm, field)]


def _alignment(found: Findings) -> list[Picture]:
    assert found.alignment
    asked, shown = found.alignment.readings[: len(alignment.STOPS)].T
    title = "The encoder's electrical angle; fit: the current's direction"
    return [_picture(title, "direction of the current, degrees", "degrees", asked, shown, asked)]


def _magnets(found: Findings) -> list[Picture]:
    assert found.emf
    corner, flux_Wb = found.emf.points[np.argsort(found.emf.points[:, 0])].T
    fit = np.polyval(np.polyfit(corner, flux_Wb, 1), corner)
    title = "Flux of the magnets; at a corner of 0 the voltages alone tell it"
    return [_picture(title, "corner of the observer, rad/s", "Wb", corner, flux_Wb, fit)]


def _rotor(found: Findings) -> list[Picture]:
    assert found.rotor
    title = "Current along alpha after a step of its voltage"
    return [_picture(title, "time, s", "A", *found.rotor.step.T)]


def _magnetisation(found: Findings) -> list[Picture]:
    assert found.magnetisation
    flux_Wb, ls_H = found.magnetisation.flux_Wb, found.magnetisation.ls_H
    return [_picture("Stator inductance at no load", "stator flux, Wb", "H", flux_Wb, ls_H, ls_H)]


def _mechanics(found: Findings) -> list[Picture]:
    assert found.mechanics
    return [
        _picture(f"Speed while {name}", "time, s", "r/min", *run.T)
        for name, run in zip(("accelerating", "braking", "coasting"), found.mechanics.runs)
    ]


_PICTURES = {
    "wiring": _wiring, "resistance": _resistance, "inductance": _inductance, "encoder": _encoder,
    "rotor": _rotor, "magnetisation": _magnetisation, "mechanics": _mechanics,
    "alignment": _alignment, "magnets": _magnets,
}  # fmt: skip
