"""The magnets' flux and the harmonics of the voltage that they induce, with the drive running.

No input of the board has the motor's terminals, so the drive runs without load, and its voltages
tell. At speed the flux estimate comes from them, hardly from the flux that is to be measured:

    psi = L_q i + r,    |r| = psi_f + (L_d - L_q) i_d

The voltage lost to dead time and devices is known only where a leg's current keeps its sign over
the ripple. So a current against the magnets flows, along -d, by a flux reference below theirs: the
lost voltage is then across the voltage that the magnets induce. A rotor that is believed t aside
lets the observer's corner g add g t/w of the flux. Two corners tell how much, and the flux without
it.

With sets 30 degrees apart the fifth and the seventh harmonic are in x-y, where

    v = R i + L_xy di/dt + j w psi_f (e5 u^5 - conj(e7 u^7))

with u along the d axis; v is the command, and its sample tells the period in which it acts. Where a
leg's current changes its sign, within the ripple, dead time and devices take another share of their
voltage than the drive has added: this is the harmonics' doubt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..drive.interface import DriveVerbs
from . import running
from .excitation import CURRENTS, MEMORY, Frame, Limits, frame
from .regression import Value, linear

#: A first look at the flux, share of the speed.
LOOK = 0.45
#: The observer's corner during each capture, share of the flux's frequency.
CORNERS = (0.1, 0.05) * 4
#: Current along -d, share of the running drive's usable one; and the largest share of the magnets'
#: flux that it may take.
AGAINST, LOWERED = 0.7, 0.5
#: Two standard deviations that no scatter shows: of psi_f, share; of each harmonic, share of the
#: voltage lost to dead time and devices. Found on simulated drives.
FLUX_ERROR, HARMONIC_ERROR = 0.007, 0.1

CHANNELS = (*CURRENTS, "psi_alpha_Wb", "psi_beta_Wb", "v_x_pu", "v_y_pu", "vdc_V")


@dataclass(frozen=True)
class Emf:
    psi_f_Wb: Value
    #: Fifth and seventh: real and imaginary part of their share with its phase; empty where the
    #: sets are not 30 degrees apart, or the law does not regulate x-y.
    harmonics: tuple[tuple[Value, Value], ...] = ()
    #: (n, 2): the observer's corner in rad/s, and the flux.
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))

    def share(self, k: int) -> Value:
        real, imaginary = self.harmonics[k]
        size = math.hypot(real.value, imaginary.value)
        return Value(size, max(real.uncertainty, imaginary.uncertainty))

    def degrees(self, k: int) -> Value:
        real, imaginary = self.harmonics[k]
        share = self.share(k)
        off = min(1.0, share.uncertainty / max(share.value, 1e-9))
        return Value(math.degrees(math.atan2(imaginary.value, real.value)), math.degrees(off))


@dataclass(frozen=True)
class Machine:
    """The machine by the drive's parameters."""

    rs_ohm: float
    ld_H: float
    lq_H: float
    lxy_H: float
    winding: Frame
    delay: int  #: periods from a command's sample to the one from which on it acts

    @classmethod
    def of(cls, drive: DriveVerbs) -> Machine:
        rs, ld, lq, lxy = (float(drive.get(n)) for n in ("rs_ohm", "ld_H", "sigma_ls_H", "lxy_H"))
        winding = frame(float(drive.get("displacement_deg")))
        return cls(rs, ld, lq, lxy, winding, 1 if drive.get("load_mode") == "shadow" else 0)


@dataclass(frozen=True)
class Reading:
    """The result of one capture."""

    omega_rad_s: float
    corner_rad_s: float
    psi_f_Wb: float
    harmonics_V: tuple[complex, complex]  #: of u^5 and conj(u^7)


def measure(drive: DriveVerbs, limits: Limits, lost_V: float) -> Emf:
    """The drive starts, and runs at up to the tests' speed. `lost_V`: each leg's, to dead time and
    devices."""
    speed_rpm = running.test_speed_rpm(drive, limits)
    scheme = running.scheme_of(drive)
    values = {
        "scheme": scheme, "start_mode": "drive", "control_mode": "speed", "speed_ref_rpm": 0.0,
        "crossover_Hz": drive.get("crossover_Hz"), "adapt_psi_f_s": 0.0,
        **{name: drive.get(name) for name in ("flux_ref_Wb", "flux_min_Wb")},
        **running.limited(drive, limits),
    }  # fmt: skip
    pairs, hertz = float(drive.get("pole_pairs")), float(drive.get("f_isr_Hz"))
    with running.borrowed(drive, values):
        running.start(drive)
        _read(drive, LOOK * speed_rpm, pairs, hertz, keep=False)
        drive.set_many(_against(drive, running.usable_A(drive, limits)))
        readings = _read(drive, speed_rpm, pairs, hertz)
        drive.set("crossover_Hz", values["crossover_Hz"])
        drive.set("speed_ref_rpm", 0.0)
        running.wait_for(drive, 0.0)
    return solve(readings, lost_V if _tells_harmonics(drive, scheme) else None)


def _against(drive: DriveVerbs, usable_A: float) -> dict[str, float]:
    """The flux references for a current against the magnets."""
    psi_f_Wb, ld_H = (float(drive.get(name)) for name in ("psi_f_Wb", "ld_H"))
    less_Wb = min(ld_H * AGAINST * usable_A, LOWERED * psi_f_Wb)
    flux_Wb = psi_f_Wb - less_Wb
    return {"flux_ref_Wb": flux_Wb, "flux_min_Wb": min(float(drive.get("flux_min_Wb")), flux_Wb)}


def _tells_harmonics(drive: DriveVerbs, scheme: str) -> bool:
    return scheme == running.SCHEME and drive.get("displacement_deg") == "30"


def _read(
    drive: DriveVerbs, speed_rpm: float, pairs: float, hertz: float, keep: bool = True
) -> list[Reading]:
    """Captures at this speed. If they are not kept, the drive takes their flux."""
    drive.set("speed_ref_rpm", speed_rpm)
    running.wait_for(drive, speed_rpm)
    hello = getattr(drive, "hello", None)
    samples = (hello.memory if hello else MEMORY) // (len(CHANNELS) + 1)
    machine = Machine.of(drive)
    found = []
    for share in CORNERS if keep else CORNERS[:1]:
        corner_Hz = share * pairs * speed_rpm / 60
        drive.set("crossover_Hz", corner_Hz)
        drive.run(0.8 / corner_Hz, record=False)
        taken = drive.capture(CHANNELS, samples, timeout_s=10)
        drive.check()
        table = np.column_stack([np.asarray(taken[name], float) for name in CHANNELS])
        corner = 2 * math.pi * corner_Hz
        found.append(reading(table, 1 / hertz, machine, corner, float(drive.get("psi_f_Wb"))))
    if not keep:
        drive.set("psi_f_Wb", found[0].psi_f_Wb)
    return found


def reading(
    table: np.ndarray, dt_s: float, machine: Machine, corner_rad_s: float, believed_Wb: float
) -> Reading:
    """Evaluate samples of every period, columns as CHANNELS."""
    i = table[:, :6] @ machine.winding.transform.T
    i_ab, i_xy = i[:, 0] + 1j * i[:, 1], i[:, 2] + 1j * i[:, 3]
    r = table[:, 6] + 1j * table[:, 7] - machine.lq_H * i_ab
    omega, size, angle = _turning(r, dt_s)
    # The observer takes g/(g + jw) of the error of the believed flux. Its real part is subtracted
    # here, and that of the angle's error by the second corner.
    pull = (corner_rad_s / math.hypot(corner_rad_s, omega)) ** 2
    active_Wb = (size - pull * believed_Wb) / (1 - pull)
    u = np.exp(1j * angle)
    id_A = float((i_ab * u.conj()).real.mean())
    psi_f_Wb = active_Wb - (machine.ld_H - machine.lq_H) * id_A
    v_V = (table[:, 8] + 1j * table[:, 9]) * table[:, 10]
    return Reading(
        omega, corner_rad_s, psi_f_Wb, _harmonics_V(v_V, i_xy, angle, omega, dt_s, machine)
    )


def _turning(r: np.ndarray, dt_s: float) -> tuple[float, float, np.ndarray]:
    """Speed, length and angles of a vector that turns steadily, beside one that stands still."""
    time_s = np.arange(len(r)) * dt_s
    middle = r.mean()
    for _ in range(3):
        omega, _ = np.polyfit(time_s, np.unwrap(np.angle(r - middle)), 1)
        columns = np.column_stack([np.exp(1j * omega * time_s), np.ones(len(r))])
        (turning, middle), *_ = np.linalg.lstsq(columns, r, rcond=None)
    return float(omega), float(abs(turning)), omega * time_s + float(np.angle(turning))


def _harmonics_V(
    v_V: np.ndarray,
    i_xy: np.ndarray,
    angle: np.ndarray,
    omega: float,
    dt_s: float,
    machine: Machine,
) -> tuple[complex, complex]:
    """Voltage of u^5 and of conj(u^7) that is left of the commands beside the winding's own."""
    n = len(v_V) - machine.delay - 1
    before, after = i_xy[machine.delay :][:n], i_xy[machine.delay + 1 :][:n]
    own = 0.5 * machine.rs_ohm * (before + after) + machine.lxy_H * (after - before) / dt_s
    middle = angle[machine.delay :][:n] + 0.5 * omega * dt_s
    # A vector that turns by x in a period has a mean of sin(x/2)/(x/2) of its length.
    mean = [np.sinc(k * omega * dt_s / (2 * math.pi)) for k in (5, 7)]
    columns = np.column_stack(
        [mean[0] * np.exp(5j * middle), mean[1] * np.exp(-7j * middle), np.ones(n)]
    )
    (fifth, seventh, _), *_ = np.linalg.lstsq(columns, v_V[:n] - own, rcond=None)
    return complex(fifth), complex(seventh)


def solve(readings: list[Reading], lost_V: float | None) -> Emf:
    """The flux at a corner of 0, and the harmonics (`lost_V` None: none)."""
    corner, flux_Wb = (
        np.array([getattr(one, name) for one in readings]) for name in ("corner_rad_s", "psi_f_Wb")
    )
    omega = float(np.mean([one.omega_rad_s for one in readings]))
    (psi_f, _), _ = linear([np.ones(len(corner)), corner], flux_Wb)
    parts: list[tuple[Value, Value]] = []
    if lost_V is None:
        return Emf(psi_f.plus_share(FLUX_ERROR), (), np.column_stack([corner, flux_Wb]))
    for k in range(2):
        found = np.array([one.harmonics_V[k] / (1j * one.omega_rad_s) for one in readings])
        found = (-found.conj() if k else found) / psi_f.value
        error = HARMONIC_ERROR * lost_V / (omega * psi_f.value)
        parts.append((_mean(found.real).plus(error), _mean(found.imag).plus(error)))
    return Emf(psi_f.plus_share(FLUX_ERROR), tuple(parts), np.column_stack([corner, flux_Wb]))


def _mean(values: np.ndarray) -> Value:
    return Value(float(values.mean()), 2 * float(values.std()) / math.sqrt(len(values)))
