"""Parameters of a running drive, identified from its telemetry, the edges of its gates, and the
equations that the plant integrates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....drive.simulated import SimulatedDrive
from ....experiments.operating_points import Progress
from ....plant.legs import OFF
from ....plant.vsd import INVERSE, PHASES, TRANSFORM
from ....recording.recording import Recording
from ....setups import Setup


@dataclass(frozen=True)
class Watched:
    """A run-up without load. edges: gate edges (`SimulatedDrive.edges`); clock_Hz: rate of their
    counts; turns, counts: turns of the shaft, and the encoder's count for them."""

    recording: Recording
    edges: np.ndarray
    clock_Hz: float
    turns: float
    counts: int
    speed_ref_rpm: float
    machine: np.record


def watch(
    setup: Setup, speed_rpm: float, seconds: float, progress: Progress | None = None
) -> Watched:
    """Start the drive and run it up. Without latency, each period's telemetry is the basis of that
    period's decision."""
    sim = SimulatedDrive(setup.changed(timing__latency="none"), samples_per_period=1)
    layout, words = sim.controller.map, sim.controller.register_words()

    def position() -> int:
        return int(words[layout.eqep]) | int(words[layout.eqep + 1]) << 16

    sim.start()
    sim.run(0.4, record=False, progress=progress)
    sim.check()
    sim.log_edges(24 * round(seconds / sim.period_s))
    counts, angle = position(), sim.plant_state[7]
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(seconds, progress=progress)
    sim.check()
    moved = (position() - counts + 2**31) % 2**32 - 2**31  # the counter wraps
    turns = float((sim.plant_state[7] - angle) / (2 * np.pi))
    clock_Hz = float(layout.pwm_clock_Hz)
    return Watched(sim.take(), sim.edges, clock_Hz, turns, moved, speed_rpm, sim._machine)


def isr_Hz(w: Watched) -> float:
    """Frequency of the fast interrupt. The legs of a single-vector scheme change state only at the
    start of a period."""
    leave = np.unique(w.edges[w.edges[:, 2] == OFF, 0])
    return w.clock_Hz / int(np.gcd.reduce(np.diff(leave)))


def dead_time_us(w: Watched) -> float:
    """The shortest time between the end of a leg's state and its next state."""
    found = []
    for leg in range(6):
        own = w.edges[w.edges[:, 1] == leg]
        pause = (own[:-1, 2] == OFF) & (own[1:, 2] != OFF)
        found.append(np.diff(own[:, 0])[pause].min())
    return 1e6 * float(min(found)) / w.clock_Hz


def slow_Hz(rec: Recording) -> float:
    """Frequency of the slow interrupt, from the torque reference, which changes only there."""
    changes = np.nonzero(np.diff(rec["torque_ref_Nm"]))[0]
    return rec.rate_Hz / int(np.gcd.reduce(np.diff(changes)))


def band(error: np.ndarray, level: np.ndarray, low: float, high: float) -> tuple[float, float]:
    """A comparator at |level| `low` changes to `high` if |error| is large enough. Returns the
    largest |error| without a change and the smallest |error| with one."""
    size, was, now = np.abs(error[1:]), np.abs(level[:-1]), np.abs(level[1:])
    stayed = size[(was == low) & (now == low)]
    went = size[(was == low) & (now == high)]
    return float(stayed.max()), float(went.min())


def torque_error_Nm(rec: Recording) -> np.ndarray:
    return np.asarray(rec["torque_ref_Nm"] - rec["torque_decided_Nm"], dtype=float)


def flux_error_Wb(rec: Recording) -> np.ndarray:
    psi_Wb = np.hypot(rec["psi_alpha_Wb"], rec["psi_beta_Wb"])
    return np.asarray(rec["flux_ref_Wb"] - psi_Wb, dtype=float)


def flux_band(rec: Recording) -> tuple[float, float]:
    """For the two-level comparator: the largest error without a change and the smallest error with
    one. It changes from 1 to 0 if the flux is too large (error below -band), and back if the flux
    is too small."""
    error, level = flux_error_Wb(rec), rec["flux_level"]
    was, now, signed = level[:-1], level[1:], error[1:]
    towards = np.where(was == 1, -signed, signed)
    return float(towards[was == now].max()), float(towards[was != now].min())


def speed_gains(w: Watched, limit_Nm: float) -> tuple[float, float]:
    """Kp [N m s/rad] and Ki [N m/rad] of the speed loop: least squares of
    T[k] - T[k-1] = Kp (e[k] - e[k-1]) + Ki T_slow e[k-1], where the reference is free."""
    rec = w.recording
    every = round(rec.rate_Hz / slow_Hz(rec))
    first = int(np.nonzero(np.diff(rec["torque_ref_Nm"]))[0][0]) + 1
    torque_Nm = np.asarray(rec["torque_ref_Nm"][first::every], dtype=float)
    error = (w.speed_ref_rpm - np.asarray(rec["speed_rpm"][first::every], dtype=float)) * np.pi / 30
    free = np.abs(torque_Nm) < 0.98 * limit_Nm
    rows = free[1:] & free[:-1]
    known = np.column_stack([np.diff(error), error[:-1] * every / rec.rate_Hz])[rows]
    kp, ki = np.linalg.lstsq(known, np.diff(torque_Nm)[rows], rcond=None)[0]
    return float(kp), float(ki)


def xy_gains(rec: Recording) -> tuple[float, float]:
    """Kp [Vdc/A] and Ki [Vdc/(A s)] of the dual PI: least squares of
    v = 2 Kp e + W t + A t*, W' = Ki e t*, A' = Ki e t, with e = -(i_x + j i_y) and t the
    direction of the stator flux. This holds for commands below their limit and without hold."""
    phases = np.stack([np.asarray(rec[f"i_{phase}_A"], dtype=float) for phase in PHASES])
    x, y = TRANSFORM[2:] @ phases
    e = -(x + 1j * y)
    psi = np.asarray(rec["psi_alpha_Wb"] + 1j * rec["psi_beta_Wb"], dtype=complex)
    t = psi / np.abs(psi)
    total_w, total_a = (np.concatenate(([0], np.cumsum(s)[:-1])) for s in (e * t.conj(), e * t))
    columns = [2 * e, (total_w * t + total_a * t.conj()) / rec.rate_Hz]
    columns += [t, 1j * t, t.conj(), 1j * t.conj()]  # the integrators' initial values
    v = np.asarray(rec["v_x_pu"] + 1j * rec["v_y_pu"], dtype=complex)
    known = np.column_stack(columns)
    found = np.linalg.lstsq(np.vstack([known.real, known.imag]), np.hstack([v.real, v.imag]),
                            rcond=None)[0]  # fmt: skip
    return float(found[0]), float(found[1])


def pole_pairs(rec: Recording) -> float:
    """Turns of the stator flux per turn of the shaft. Without load there is hardly any slip."""
    psi = np.unwrap(np.angle(rec["plant.psi_alpha_Wb"] + 1j * rec["plant.psi_beta_Wb"]))
    shaft = np.asarray(rec["plant.theta_rad"], dtype=float)
    return float((psi[-1] - psi[0]) / (shaft[-1] - shaft[0]))


def phase_ohm(machine: np.record) -> np.ndarray:
    """Resistance of each phase, from the plant's equations: d psi_s/dt = -R L^-1 psi, and
    R = T diag(r) T^-1, solved for r."""
    r_vsd = -machine.slope[:, :4].T @ np.linalg.pinv(machine.i_stator)
    known = [np.outer(TRANSFORM[:, n], INVERSE[n]).ravel() for n in range(6)]
    return np.linalg.lstsq(np.column_stack(known), r_vsd.ravel(), rcond=None)[0]


def inductances_H(machine: np.record) -> tuple[float, dict[str, float]]:
    """Rotor resistance [ohm] and inductances, from the plant's equations: L^-1 is symmetric,
    so d psi_r/dt = -R_r L^-1 psi gives R_r, and then the whole of L."""
    rr_ohm = -machine.slope[0, 4] / machine.i_stator[0, 4]
    inverse = np.vstack([machine.i_stator, -machine.slope[:, 4:6].T / rr_ohm])
    full = np.linalg.inv(inverse)
    lm = full[0, 4]
    return float(rr_ohm), {
        "lm_H": float(lm),
        "lls_H": float(full[0, 0] - lm),
        "llr_H": float(full[4, 4] - lm),
        "lxy_H": float(full[2, 2]),
    }
