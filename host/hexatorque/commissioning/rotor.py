"""Step d at standstill: R_r and L_m, by a step of the direct voltage along one axis.

A voltage along one axis of alpha-beta makes no torque. After a step by V the current first jumps
by V/(R_s + R_r), then goes on, while the rotor's flux follows, to a change of V/R_s. The jump tells
R_r, the time L_m. A model of the machine at rest is fitted to the whole curve:

    v = R_s i + sigma L_s di/dt + d psi/dt,   d psi/dt = R (i - psi/M)

The lost voltages (step b) would disturb this where a leg's current changes its sign. So a larger
direct current flows along x. Alpha and x have the same sizes on every leg, and so no leg's current
changes its sign: the lost voltages stay what they are and drop out.

From its terminals a machine shows M = L_m^2/L_r and R = R_r (L_m/L_r)^2 only. Stator and rotor
leakage are taken as equal to get L_m and R_r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from .excitation import Excitation, Samples
from .inductance import Inductance
from .regression import AXIS_GAIN, Value, nonlinear
from .resistance import Resistance

#: The step is captured for this many of the machine's slow time constants, for this time at most.
TIME_CONSTANTS = 4.0
LONGEST_S = 8.0
#: Before it the steady state is waited for, so many times as long. What is missing is below 0.1 %.
SETTLE = 1.75
#: The steady current is the mean over this time. Its noise adds to every sample of the step.
MEAN_S = 0.2
#: Two standard deviations of the model's own error, share: asymmetry, lost voltages that are not
#: quite the same before and after the step.
MODEL_ERROR = 0.006
#: Current along x over the current along alpha.
BIAS = 1.2
#: Largest current along alpha, share of the stated limit: both add up on leg u1.
MOST = 0.33
#: Most samples of the step.
SAMPLES = 1200


@dataclass(frozen=True)
class Rotor:
    rr_ohm: Value
    lm_H: Value
    leakage_H: float  #: of stator and of rotor, taken as equal
    current_A: float  #: from one sign to the other of which L_m was measured
    #: (n, 3): time, the current along alpha since the step, and the model's.
    step: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def lr_H(self) -> float:
        return self.lm_H.value + self.leakage_H


def measure(
    test: Excitation,
    resistance: Resistance,
    inductance: Inductance,
    current_A: float,
    guess: tuple[float, float],
) -> Rotor:
    """`current_A`: the direct current at which the iron is magnetised; `guess`: R_r and L_m, from
    which the times follow. They are corrected if they were wrong."""
    current_A = min(current_A, MOST * test.limits.current_A)
    ohm = resistance.mean_ohm.value
    plane, inverse, _ = test.frame
    x_A = inverse[:, 2] * BIAS * current_A
    x_V = plane @ (ohm * x_A + resistance.of_legs(x_A))
    alpha_V = np.array([ohm * current_A, 0, 0, 0])
    rr, lm = guess
    while True:
        slow_s = lm / ohm + lm / rr
        time_s = min(LONGEST_S, TIME_CONSTANTS * slow_s)
        before_A, _, samples = test.steady(x_V + alpha_V, SETTLE * time_s, MEAN_S)
        step = test.pulse(x_V - alpha_V, "square", 0.0, time_s, SAMPLES, then_V=None)
        first = float(plane[0] @ before_A), samples
        found = solve(step, first, 2 * alpha_V[0], ohm, inductance.sigma_ls_H.value, (rr, lm))
        rr, lm = found.rr_ohm.value, found.lm_H.value
        if lm / ohm + lm / rr < 1.5 * slow_s or time_s == LONGEST_S:
            break
    test.rest(min(1.0, time_s))
    return found


def solve(
    step: Samples,
    first: tuple[float, int],
    down_V: float,
    ohm: float,
    sigma_H: float,
    guess: tuple[float, float],
) -> Rotor:
    """Fit the currents after a step down by `down_V` of a machine in its steady state. `first`:
    the current along alpha in it, and the mean of how many samples this is."""
    i = step.i_vsd_A[:, 0]
    v = np.where(step.v_V[:, 0] == 0, 0.0, -down_V)  # no command yet: the voltage from before
    first_A, samples = first
    change = i - first_A
    size_A = abs(float(change[-1]))

    def model(x: np.ndarray) -> np.ndarray:
        # The steady current's own error is an unknown too. It is as likely to be this large as
        # the mean of so many samples lets it be.
        error_A = (x[3] - 1) * size_A
        current = _current(v, step.dt_s, x[0], sigma_H, x[1], x[2])
        return np.append(current + error_A, np.sqrt(samples) * error_A)

    values, rest = nonlinear(model, np.array([ohm, *guess, 1.0]), np.append(change, 0.0))
    time_s = np.arange(len(change)) * step.dt_s
    curve = np.column_stack([time_s, change, change - rest[:-1]])
    return replace(_circuit(values[1], values[2], sigma_H, size_A / 2), step=curve)


def _current(v: np.ndarray, dt: float, rs: float, sigma_H: float, r: float, m: float) -> np.ndarray:
    """The current at every sample, from the voltages between them, from rest on. The voltage is
    constant from sample to sample, so the solution is exact: two exponentials. Their rates solve
    (s + (rs + r) / sigma_H) (s + r/m) = r² / (m sigma_H), and are real for positive values."""
    stator, rotor = (rs + r) / sigma_H, r / m
    quick = -0.5 * (stator + rotor + math.hypot(stator - rotor, 2 * r / math.sqrt(m * sigma_H)))
    slow = rs * r / (m * sigma_H) / quick  # the product of both is known
    out = np.zeros(len(v) + 1)
    for rate, other in ((quick, slow), (slow, quick)):
        decay = math.exp(rate * dt)
        push = (rate + rotor) / (sigma_H * (rate - other)) * (decay - 1) / rate
        x = 0.0
        for n in range(len(v)):
            x = decay * x + push * v[n]
            out[n + 1] += x
    return out


def _circuit(r: Value, m: Value, sigma_H: float, current_A: float) -> Rotor:
    """L_m and R_r of the circuit with equal leakages that looks the same from its terminals."""
    ls = sigma_H + m.value
    lm = float(np.sqrt(m.value * ls))
    rr = r.value * ls / m.value
    error = math.hypot(AXIS_GAIN, MODEL_ERROR)
    return Rotor(
        Value(rr, rr * r.uncertainty / r.value).plus_share(error),
        Value(lm, lm * m.uncertainty / m.value).plus_share(error),
        ls - lm,
        current_A,
    )
