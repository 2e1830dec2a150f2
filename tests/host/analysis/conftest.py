"""Synthetic steady states: recordings like those of the simulator, but with known content."""

from collections.abc import Callable

import numpy as np
import pytest

from hexatorque.analysis import Run, metrics
from hexatorque.plant.vsd import ANGLES_RAD, PHASES, TRANSFORM
from hexatorque.recording.recording import Recording


def synthetic(
    f1_Hz: float = 40.0,
    duration_s: float = 0.5,
    rate_Hz: float = 50_000.0,
    amplitude_A: tuple[float, float] = (2.0, 2.0),
    lines: dict[int, float] | None = None,
    offset_A: float = 0.0,
    torque_Nm: float = 2.0,
    ripple_Nm: float = 0.2,
    flux_Wb: float = 0.4,
    flux_ripple_Wb: float = 0.004,
    speed_rpm: float = 2500.0,
    prefix: str = "plant.",
    meta: dict | None = None,
) -> Recording:
    """amplitude_A: amplitudes of the fundamental in set 1 and set 2; lines: harmonic order ->
    fraction of the fundamental; ripples: standard deviations of a sine at 1.25 f1, which has whole
    cycles in four cycles of f1."""
    t = np.arange(round(duration_s * rate_Hz)) / rate_Hz
    phi = 2 * np.pi * f1_Hz * t
    wave = np.sqrt(2) * np.sin(1.25 * phi)
    i_A = np.empty((6, t.size))
    for k, angle in enumerate(ANGLES_RAD):
        i_A[k] = np.cos(phi - angle)
        for order, fraction in (lines or {}).items():
            i_A[k] += fraction * np.cos(order * (phi - angle))
        i_A[k] = amplitude_A[k % 2] * i_A[k] + offset_A
    alpha, beta, x, y = TRANSFORM @ i_A
    magnitude_Wb = flux_Wb + flux_ripple_Wb * wave
    channels = {f"{prefix}i_{phase}_A": i for phase, i in zip(PHASES, i_A, strict=True)}
    channels |= {
        f"{prefix}psi_alpha_Wb": magnitude_Wb * np.sin(phi),
        f"{prefix}psi_beta_Wb": -magnitude_Wb * np.cos(phi),
        f"{prefix}torque_Nm": torque_Nm + ripple_Nm * wave,
        f"{prefix}speed_rpm": np.full(t.size, speed_rpm),
        "torque_ref_Nm": np.full(t.size, torque_Nm),
        "flux_ref_Wb": np.full(t.size, flux_Wb),
    }
    if prefix:
        channels |= {
            "plant.i_alpha_A": alpha,
            "plant.i_beta_A": beta,
            "plant.i_x_A": x,
            "plant.i_y_A": y,
            "plant.theta_rad": phi,
            "plant.gates": np.zeros(t.size),
        }
    return Recording(rate_Hz, channels, meta=dict(meta or {}))


@pytest.fixture
def make_recording() -> Callable[..., Recording]:
    return synthetic


@pytest.fixture
def make_run() -> Callable[..., Run]:
    def make(
        setup: str = "paper-b",
        scheme: str = "fdr",
        latency: str = "predicted",
        speed_ref_rpm: float = 2500.0,
        load_Nm: float = 2.0,
        **content,
    ) -> Run:
        content = {"lines": {5: 0.1, 7: 0.03}, "meta": {"f_sw_Hz": 2400.0}} | content
        rec = synthetic(**content)
        return Run(setup, scheme, latency, speed_ref_rpm, load_Nm, rec, metrics(rec), 12.5)

    return make
