"""Steps d and e with the drive running: magnetisation at no load, inertia, friction and load.

The drive runs with what was measured at standstill. Its flux estimate comes from the voltages at
the speed chosen here, hardly from the inductance that is to be measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ..drive.interface import DriveVerbs
from ..errors import HexatorqueError
from ..firmware import RUN
from ..plant.vsd import PHASES
from ..setups.design import VECTOR_PU
from .excitation import CommissioningError, Limits, frame_of
from .regression import MEAN_GAIN, Value, linear

CURRENTS = tuple(f"i_{phase}_A" for phase in PHASES)
#: The scheme of these tests, where the drive can run it. Its pulses lie about the samples evenly,
#: so a sample has the mean current. With a switching table it lies up to 2 % beside it.
SCHEME = "db-dtfc"
#: Two standard deviations of what flux and torque are estimated wrongly by, in proportion, beside
#: the sensors' gains. With another scheme than SCHEME the mean current may lie that far beside the
#: samples; the torque's estimate is as good.
FLUX_ERROR, TORQUE_ERROR, OTHER_SCHEME_ERROR = 0.003, 0.004, 0.02
#: Flux references of the magnetisation curve, share of the parameter flux_ref_Wb.
FLUXES = (0.5, 0.65, 0.8, 0.95, 1.1)
#: Step of the flux reference from one flux to the next, share of flux_ref_Wb. While the rotor's
#: flux changes, the current is off the circle diagram: at a rate of the whole flux in L_r/R_r by
#: one no-load current. It may be EXTRA of that, for the firmware's check of the flux must also
#: stand the ripple.
FLUX_STEP, EXTRA = 0.03, 0.2
#: Share of the dc-link voltage that the flux may induce at the speed of the tests.
VOLTAGE = 0.3
#: Current that the running drive needs: this share of the no-load current, and this many steps of
#: the current from one sample to the next. The trip lies a step below the limit. The mean current
#: stays at USABLE of what is left another step below.
NO_LOADS, CURRENT_STEPS, USABLE = 1.6, 3.0, 0.7
#: Longest wait for a speed, s.
PATIENCE_S = 15.0
#: The acceleration should take about this time, s.
ACCELERATE_S = 0.7
#: Torque of the first try, and the least, share of torque_limit_Nm.
FIRST_TORQUE = 0.25
LEAST_TORQUE = 0.1
#: Share of the speed up to which the torque is at its limit.
UPPER = 0.85
#: Share of the speed that is near enough: ripple costs a table scheme some of a small torque.
REACHED = 0.95
#: The shaft coasts for the first time, s. If it then has more than this share of its speed,
#: friction is hardly to be seen, and it coasts on for the second time.
COAST_S, TOO_FAST, LONG_COAST_S = 5.0, 0.7, 30.0
#: A fan is taken to be there if with it the fit leaves less than this share of the squares.
FAN_LEAVES = 0.8
#: Speeds at which the load is stated, share of the largest one of the tests.
CURVE = (0.25, 0.5, 0.75, 1.0)
#: Most samples of a record.
MOST_SAMPLES = 4000
#: Rotor time constants after a stop until the flux is gone: a start builds it up from nothing.
DECAY = 6.0


@dataclass(frozen=True)
class Magnetisation:
    flux_Wb: np.ndarray
    ls_H: np.ndarray  #: stator inductance at these fluxes
    spread_H: np.ndarray

    def ls_at(self, flux_Wb: float) -> Value:
        value = float(np.interp(flux_Wb, self.flux_Wb, self.ls_H))
        return Value(value, float(np.interp(flux_Wb, self.flux_Wb, self.spread_H)))


@dataclass(frozen=True)
class Mechanics:
    inertia_kgm2: Value
    dry_Nm: Value  #: friction that does not depend on the speed
    viscous_Nms: Value
    fan_Nms2: Value  #: load in proportion to the square of the speed; zero if none was seen
    speed_rpm: float  #: measured up to this speed
    #: Accelerating, braking, coasting, each (n, 3): time, speed in r/min, and the fit's.
    runs: tuple[np.ndarray, ...] = ()

    def load_Nm(self, speed_rpm: float) -> float:
        """The torque of friction and load at this speed, above zero."""
        w = speed_rpm * math.pi / 30
        return self.dry_Nm.value + w * (self.viscous_Nms.value + w * self.fan_Nms2.value)

    def doubt_Nm(self) -> float:
        """Uncertainty of the load at the largest speed."""
        w = self.speed_rpm * math.pi / 30
        parts = (self.dry_Nm, self.viscous_Nms, self.fan_Nms2)
        return math.hypot(*(w**n * part.uncertainty for n, part in enumerate(parts)))

    def curve(self) -> str:
        """The load at some speeds, in words."""
        if abs(self.load_Nm(self.speed_rpm)) < self.doubt_Nm():
            return f"less than can be measured, {self.doubt_Nm():.2g} N m"
        speeds = [share * self.speed_rpm for share in CURVE]
        return ", ".join(f"{self.load_Nm(s):.3g} N m at {s:.0f} r/min" for s in speeds)


def needed_A(drive: DriveVerbs) -> float:
    """The smallest limit with which the drive can run, by its parameters."""
    return NO_LOADS * _no_load_A(drive) + CURRENT_STEPS * _step_A(drive)


def _no_load_A(drive: DriveVerbs) -> float:
    if magnets(drive):
        return 0.0
    return float(drive.get("flux_ref_Wb")) / float(drive.get("lr_H"))


def magnets(drive: DriveVerbs) -> bool:
    """Whether the rotor has them: then the machine has its flux without current."""
    return "machine" in drive.params and drive.get("machine") == "magnet"


def _step_A(drive: DriveVerbs) -> float:
    """The largest step of a current in one period."""
    sigma_ls_H, f_isr_Hz = float(drive.get("sigma_ls_H")), float(drive.get("f_isr_Hz"))
    if magnets(drive):
        sigma_ls_H = min(sigma_ls_H, float(drive.get("ld_H")))
    return VECTOR_PU * vdc_V(drive) / (f_isr_Hz * sigma_ls_H)


def vdc_V(drive: DriveVerbs) -> float:
    return float(drive.capture(("vdc_V",), 64, timeout_s=5)["vdc_V"].mean())


def scheme_of(drive: DriveVerbs) -> str:
    """The scheme of the tests; the drive's own one if its timing or its machine forbid that."""
    own = str(drive.get("scheme"))
    try:
        drive.set("scheme", SCHEME)
    except HexatorqueError:
        return own
    drive.set("scheme", own)
    return SCHEME


def limited(drive: DriveVerbs, limits: Limits) -> dict[str, object]:
    """Parameters that keep the currents within the limit. With less current the flux takes longer
    to build up."""
    no_load_A, step_A, needed = _no_load_A(drive), _step_A(drive), needed_A(drive)
    if limits.current_A < 0.99 * needed:
        raise CommissioningError(
            f"current = {limits.current_A:g} A: the running drive needs {needed:.3g} A and more: "
            f"its flux takes {no_load_A:.3g} A, and one sample to the next {step_A:.3g} A"
        )
    build_A, build_s, torque_Nm, trip_A = (
        float(drive.get(name))
        for name in ("build_current_A", "build_s", "torque_limit_Nm", "i_trip_A")
    )
    usable = usable_A(drive, limits)
    less_A = min(build_A, usable)
    across_A = float(np.sqrt(max(usable**2 - no_load_A**2, (0.3 * no_load_A) ** 2)))
    pole_pairs, flux_Wb = (float(drive.get(name)) for name in ("pole_pairs", "flux_ref_Wb"))
    return {
        "i_trip_A": min(trip_A, limits.current_A - step_A),
        "build_current_A": less_A,
        "build_s": min(build_s * build_A / less_A, drive.params["build_s"].max),
        "torque_limit_Nm": min(torque_Nm, 3 * pole_pairs * flux_Wb * across_A),
    }


def usable_A(drive: DriveVerbs, limits: Limits) -> float:
    """The mean current of the running drive that keeps the limit."""
    return USABLE * (limits.current_A - 2 * _step_A(drive))


@contextmanager
def borrowed(drive: DriveVerbs, values: dict[str, object]) -> Iterator[None]:
    """The drive stopped, with these parameters; afterwards stopped, with its own ones."""
    before = {name: drive.get(name) for name in values}
    drive.set_many(values)
    try:
        yield
    finally:
        drive.stop()
        if drive.faults:  # what may change in idle only
            drive.clear()
        drive.set_many(before)


def test_speed_rpm(drive: DriveVerbs, limits: Limits) -> float:
    """A speed at which voltages tell the flux well, and which the dc link can give."""
    link_V = vdc_V(drive)
    flux_Wb = max(FLUXES) * float(drive.get("flux_ref_Wb"))
    rpm = VOLTAGE * link_V / flux_Wb / float(drive.get("pole_pairs")) * 30 / np.pi
    return min(rpm, limits.speed_rpm or rpm, 0.8 * float(drive.get("speed_trip_rpm")))


def magnetisation(drive: DriveVerbs, limits: Limits) -> Magnetisation:
    """L_s at five fluxes, without load."""
    speed_rpm = test_speed_rpm(drive, limits)
    nominal_Wb = float(drive.get("flux_ref_Wb"))
    rows = []
    values = {
        "scheme": scheme_of(drive), "start_mode": "drive", "control_mode": "speed",
        "speed_ref_rpm": 0.0,
        "flux_ref_Wb": nominal_Wb, "field_weakening": "off", **limited(drive, limits),
    }  # fmt: skip
    with borrowed(drive, values):
        start(drive)
        drive.set("speed_ref_rpm", speed_rpm)
        wait_for(drive, speed_rpm)
        for share in FLUXES:
            _lead_flux(drive, share * nominal_Wb, nominal_Wb)
            drive.run(2.5 * float(drive.get("build_s")) + 0.5, record=False)
            drive.check()
            rows.append(_flux_and_inductance(drive, float(drive.get("sigma_ls_H"))))
        _lead_flux(drive, nominal_Wb, nominal_Wb)
        drive.set("speed_ref_rpm", 0.0)
        wait_for(drive, 0.0)
    flux_Wb, ls_H, spread_H = np.array(rows).T
    method = FLUX_ERROR if values["scheme"] == SCHEME else OTHER_SCHEME_ERROR
    return Magnetisation(flux_Wb, ls_H, np.hypot(spread_H, math.hypot(MEAN_GAIN, method) * ls_H))


def _lead_flux(drive: DriveVerbs, to_Wb: float, nominal_Wb: float) -> None:
    """To another flux, no faster than the rotor's flux follows."""
    rotor_s = float(drive.get("lr_H")) / float(drive.get("rr_ohm"))
    way_Wb = to_Wb - (from_Wb := float(drive.get("flux_ref_Wb")))
    steps = math.ceil(abs(way_Wb) / (FLUX_STEP * nominal_Wb))
    for k in range(1, steps + 1):
        drive.set("flux_ref_Wb", from_Wb + k / steps * way_Wb)
        drive.run(FLUX_STEP * rotor_s / EXTRA, record=False)


def _flux_and_inductance(drive: DriveVerbs, sigma_ls_H: float) -> tuple[float, float, float]:
    """Mean flux; L_s by the current along it; two standard deviations of that."""
    found = drive.capture(
        (*CURRENTS, "psi_alpha_Wb", "psi_beta_Wb"), 2000, prescaler=2, timeout_s=9
    )
    plane = frame_of(drive).transform[:2]
    i = np.column_stack([found[name] for name in CURRENTS]).astype(float) @ plane.T
    psi = np.column_stack([found["psi_alpha_Wb"], found["psi_beta_Wb"]]).astype(float)
    size = np.hypot(*psi.T)
    along_A = (psi * i).sum(1) / size
    across_A = (psi[:, 0] * i[:, 1] - psi[:, 1] * i[:, 0]) / size
    parts = [
        inductance_H(p.mean(), d.mean(), q.mean(), sigma_ls_H)
        for p, d, q in zip(*(np.array_split(x, 8) for x in (size, along_A, across_A)))
    ]
    return float(size.mean()), float(np.mean(parts)), float(2 * np.std(parts) / np.sqrt(8))


def inductance_H(flux_Wb: float, along_A: float, across_A: float, sigma_ls_H: float) -> float:
    """L_s of a machine in steady state, from the currents along and across its stator flux. With a
    load they lie on the circle diagram, from which this follows; without one it is flux/current."""
    square = along_A**2 + across_A**2
    return flux_Wb * (flux_Wb - sigma_ls_H * along_A) / (along_A * flux_Wb - sigma_ls_H * square)


def start(drive: DriveVerbs) -> None:
    """Until the drive controls torque. With magnets it aligns the rotor first, which may take four
    times `build_s`."""
    build_s = float(drive.get("build_s"))
    longest_s = 4.5 * build_s if magnets(drive) else 0.0
    if not magnets(drive):
        drive.run(DECAY * float(drive.get("lr_H")) / float(drive.get("rr_ohm")), record=False)
    drive.start()
    drive.run(float(drive.get("calibration_s")) + build_s + 0.1, record=False)
    waited_s = 0.0
    while drive.state != RUN and waited_s < longest_s:
        drive.check()
        drive.run(0.1, record=False)
        waited_s += 0.1
    drive.check()


def wait_for(drive: DriveVerbs, speed_rpm: float) -> None:
    """Until the mean speed is within 2 % or 3 r/min of this one."""
    waited_s = 0.0
    while abs(_speed(drive) - speed_rpm) > max(3.0, 0.02 * abs(speed_rpm)):
        drive.check()
        waited_s += 0.2
        if waited_s > PATIENCE_S:
            raise CommissioningError(
                f"the drive does not reach {speed_rpm:.0f} r/min within {PATIENCE_S:g} s: are "
                "torque_limit_Nm and the speed loop's gains right? If the load takes too much at "
                "this speed, choose a lower one (--speed)."
            )
        drive.run(0.2, record=False)


def _speed(drive: DriveVerbs) -> float:
    return float(drive.capture(("speed_rpm",), 100, prescaler=5, timeout_s=5)["speed_rpm"].mean())


# -- inertia and friction --------------------------------------------------------------------


def mechanics(drive: DriveVerbs, limits: Limits) -> Mechanics:
    """Accelerate and brake with a limited torque; accelerate again and let the shaft coast."""
    speed_rpm = test_speed_rpm(drive, limits)
    slow_s = 1 / float(drive.get("f_slow_Hz"))
    values = {
        "scheme": scheme_of(drive), "start_mode": "drive", "control_mode": "speed",
        "speed_ref_rpm": 0.0,
        **limited(drive, limits),
    }  # fmt: skip
    own_Nm = float(drive.get("torque_limit_Nm"))
    limit_Nm = float(str(values["torque_limit_Nm"]))
    torque_Nm = min(FIRST_TORQUE * own_Nm, limit_Nm)
    with borrowed(drive, values):
        enough = False  # torque: with less the drive did not come near the speed
        for _ in range(8):
            drive.set("torque_limit_Nm", torque_Nm)
            start(drive)
            up = _record(drive, 2 * ACCELERATE_S, {"speed_ref_rpm": speed_rpm})
            drive.check()
            if up[1].max() < REACHED * speed_rpm:
                if torque_Nm >= limit_Nm:
                    break
                torque_Nm, enough = min(2 * torque_Nm, limit_Nm), True
            else:
                took_s = _time_to(up, UPPER * speed_rpm)
                less_Nm = max(torque_Nm * took_s / ACCELERATE_S, LEAST_TORQUE * limit_Nm)
                if enough or less_Nm > 0.7 * torque_Nm:
                    break
                torque_Nm = less_Nm  # too quick for many speed readings: once more, slower
            drive.set("speed_ref_rpm", 0.0)
            wait_for(drive, 0.0)
            drive.stop()
        wait_for(drive, speed_rpm)
        down = _record(drive, 2 * ACCELERATE_S, {"speed_ref_rpm": 0.0})
        drive.set("speed_ref_rpm", speed_rpm)
        wait_for(drive, speed_rpm)
        drive.stop()
        coast = _record(drive, COAST_S, {"speed_ref_rpm": 0.0})
        if coast[1][-1] > TOO_FAST * coast[1][0]:
            coast = _record(drive, LONG_COAST_S, {"speed_ref_rpm": 0.0})
    return solve(up, down, coast, speed_rpm, slow_s, math.hypot(MEAN_GAIN, TORQUE_ERROR))


def _time_to(run: tuple, speed_rpm: float) -> float:
    """When a run first reached a speed; its end if it did not."""
    there = np.flatnonzero(run[1] >= speed_rpm)
    return float(run[0][there[0]] if len(there) else run[0][-1])


def _record(drive: DriveVerbs, duration_s: float, command: dict[str, object]) -> tuple:
    """Time, speed and torque from a WRITE on."""
    f_isr_Hz = float(drive.get("f_isr_Hz"))
    per_reading = round(f_isr_Hz / float(drive.get("f_slow_Hz")))
    prescaler = in_step(math.ceil(duration_s * f_isr_Hz / MOST_SAMPLES), per_reading)
    samples = int(duration_s * f_isr_Hz / prescaler)
    drive.arm(("speed_rpm", "torque_Nm"), samples, 0, "command", prescaler)
    drive.set_many(command)
    found = drive.captured(duration_s + 10)
    time_s = np.arange(samples) / found.rate_Hz
    return time_s, np.asarray(found["speed_rpm"], float), np.asarray(found["torque_Nm"], float)


def in_step(least: int, per_reading: int) -> int:
    """The smallest prescaler from `least` on with which a reading of the speed lasts a whole number
    of samples, or a sample a whole number of readings. Else the readings' age would drift."""
    if least >= per_reading:
        return per_reading * math.ceil(least / per_reading)
    return next(p for p in range(max(1, least), per_reading + 1) if per_reading % p == 0)


def solve(
    up: tuple, down: tuple, coast: tuple, speed_rpm: float, slow_s: float, torque_error: float
) -> Mechanics:
    """J dw/dt = torque + error - dry - viscous w - fan w^2, as integrals over time:

        w(t) = w_0 + 1/J * work + error/J * t - dry/J * t - viscous/J * angle - fan/J * square

    Each run has its own w_0. The error is that of the torque's estimate: a flux that is a little
    wrong makes one that does not depend on the torque. While the shaft coasts there is no torque:
    this gives the friction over J, the other runs J. `torque_error` is the part in proportion to
    the torque, which no run shows. Nor does what is left of the fit show how well the samples'
    mean is that of the torque, for it grows with the work: the ripple tells.
    """
    low, high = 0.15 * speed_rpm, UPPER * speed_rpm
    time_s, speed, torque = coast
    coasting = _integrals((time_s, speed, np.zeros_like(torque)), slow_s, low, np.inf)
    dry, viscous, fan = friction(coasting)
    runs = [_integrals(run, slow_s, low, high) for run in (up, down)]
    w, work, gone_s, angle, square = np.vstack(runs).T
    own = [np.repeat([k == 0, k == 1], [len(rows) for rows in runs]).astype(float) for k in (0, 1)]
    without = w + dry.value * gone_s + viscous.value * angle + fan.value * square  # friction
    (per_J, *_), rest = linear([work, gone_s, *own], without)
    inertia = 1 / per_J.value
    sampled = _sampled([run[2][_between(run, low, high)] for run in (up, down)])
    torque_error = math.hypot(torque_error, sampled)
    driven = np.column_stack([gone_s, w, w - rest]) * [1, *2 * [30 / np.pi]]
    falls = coasting[:, 2:] @ [dry.value, viscous.value, fan.value]
    left = coasting[:, 0] + falls
    curve = np.column_stack([coasting[:, 2], coasting[:, 0], left.mean() - falls])

    def times_J(value: Value) -> Value:
        return Value(value.value * inertia, value.uncertainty * inertia).plus_share(torque_error)

    return Mechanics(
        Value(inertia, inertia**2 * per_J.uncertainty).plus_share(torque_error),
        times_J(dry),
        times_J(viscous),
        times_J(fan),
        speed_rpm,
        (driven[: len(runs[0])], driven[len(runs[0]) :], curve * [1, *2 * [30 / np.pi]]),
    )


def _sampled(torques_Nm: list[np.ndarray]) -> float:
    """Two standard deviations, as a share, of the inertia's error because every so many periods are
    sampled: by the mean torques' difference. A mean of n samples of a ripple s is off by s/sqrt(n).
    The ripple shows in the differences of samples, which the slow torque hardly adds to."""
    variance = sum(np.mean(np.diff(one) ** 2) / 2 / len(one) for one in torques_Nm)
    up_Nm, down_Nm = (float(one.mean()) for one in torques_Nm)
    return 2 * math.sqrt(variance) / abs(up_Nm - down_Nm)


def friction(coasting: np.ndarray) -> tuple[Value, Value, Value]:
    """Dry friction, viscous friction and a fan's load over J, none of them negative. A fan is there
    only if it explains much of the residual of the other two: over a small range of speeds the
    three look alike."""
    w, _, gone_s, angle, square = coasting.T
    dry, viscous, rest = _dry_and_viscous(w, gone_s, angle)
    columns, ones = (-gone_s, -angle, -square), np.ones(len(w))
    (*all_three, _), _ = linear([*columns, ones], w)
    best: tuple[float, dict[int, Value]] = (FAN_LEAVES * (rest @ rest), {})
    for kept in ((0, 1, 2), (0, 2), (1, 2), (2,)):
        (*values, _), left = linear([*(columns[k] for k in kept), ones], w)
        found = dict(zip(kept, values))
        seen = found[2].value > 2 * found[2].uncertainty
        if seen and min(v.value for v in values) >= 0 and left @ left < best[0]:
            best = (float(left @ left), found)
    if not best[1]:
        return dry, viscous, Value(0.0, 0.0)
    dry, viscous, fan = (best[1].get(k, Value(0.0, all_three[k].uncertainty)) for k in range(3))
    return dry, viscous, fan


def _dry_and_viscous(
    w: np.ndarray, gone_s: np.ndarray, angle: np.ndarray
) -> tuple[Value, Value, np.ndarray]:
    """Both over J, and the residual of their fit. At a speed that hardly changes both look the
    same, and their fit may be a difference of two large numbers. But friction is never negative: if
    one of them were, the one that fits better takes all of it, and the other one has at most what
    it would take alone."""
    columns, ones = (-gone_s, -angle), np.ones(len(w))
    (*both, _), rest = linear([*columns, ones], w)
    if min(value.value for value in both) >= 0:
        return both[0], both[1], rest
    fits = [linear([column, ones], w) for column in columns]
    better = int(np.argmin([rest @ rest for _, rest in fits]))
    found = []
    for k, ((alone, _), _) in enumerate(fits):
        value = max(0.0, alone.value) if k == better else 0.0
        most = abs(alone.value) + alone.uncertainty
        found.append(Value(value, min(most, both[k].uncertainty)))
    return found[0], found[1], fits[better][1]


def _between(run: tuple, low: float, high: float) -> slice:
    """The samples from the first to the last one whose speed is between two bounds."""
    inside = np.flatnonzero((run[1] >= low) & (run[1] <= high))
    return slice(inside[0], inside[-1] + 1) if len(inside) else slice(0, 0)


def _integrals(run: tuple, slow_s: float, low: float, high: float) -> np.ndarray:
    """Rows (speed, integral of torque, time, angle, integral of the speed's square), one for each
    reading of the speed, as long as it is between two bounds."""
    time_s, speed_rpm, torque = run
    dt = time_s[1] - time_s[0]
    part = _between(run, low, high)
    if part.stop - part.start < 2:
        return np.empty((0, 5))
    w = speed_rpm[part] * np.pi / 30
    sums = [np.cumsum(torque[part]) * dt, time_s[part], np.cumsum(w) * dt, np.cumsum(w * w) * dt]
    rows = np.column_stack([w, *sums])
    return rows[:: max(1, round(slow_s / dt))]
