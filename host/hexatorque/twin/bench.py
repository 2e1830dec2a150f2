"""A recording of a bench as the simulation can follow it: references, speed and dc link in every
period of the slow loop, from the part of the recording in which the drive ran."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .. import firmware
from ..plant import vsd
from ..plant.machines import parameters_of
from ..plant.vsd import PHASES
from ..recording.journal import TICK_HZ
from ..recording.recording import FIRST_TICK, Recording, RecordingError
from ..setups import Setup
from ..setups.keys import TIMING_OWNS
from . import wiring
from .shaft import NO_LOAD, Load, parts

#: Channels without which nothing can be compared, besides two phase currents of each set.
NEEDED = ("torque_ref_Nm", "speed_rpm", "psi_alpha_Wb", "psi_beta_Wb")
#: The phases of each winding set.
SETS = tuple(tuple(PHASES[leg] for leg in one) for one in vsd.SETS)
RUN = float(firmware.lib.HT_STATE_RUN)
#: A shorter part of a recording says too little.
SHORTEST_S = 0.2
#: Of a longer recording the first part is compared, unless a window is given.
LONGEST_S = 10.0
#: The speed of an oscilloscope is smoothed over this time.
SMOOTH_S = 0.1
#: What only the board knows. Without it, these parameters do not show.
UNKNOWN_OUTSIDE = "R_s and R_r in use, J and friction"
#: Speed below which the shaft stood still when the drive began to run.
STANDSTILL_RPM = 5.0


@dataclass
class Bench:
    """A recording in periods of the slow loop. `samples` are the firmware's channels;
    `row` is the fast period of each sample since the first slow one, as early as it can have been;
    `places`: each sample is of this period or of one of those after it, so many in all.

    begins: the recording has the first period of the drive's running, at standstill; first: fast
    periods from there to the first one of the slow loop;
    outside: another instrument than the board has recorded; its currents are those of the machine
    and not those of the sensors; torque_known, speed_known: whether they are recorded;
    notes: the values that the recording does not carry, and their substitutes."""

    label: str
    samples: dict[str, np.ndarray]
    row: np.ndarray
    step_s: float  #: from sample to sample
    slow_s: float
    begin_s: float
    torque_ref_Nm: np.ndarray
    vdc_V: np.ndarray
    omega_rad_s: np.ndarray  #: (periods + 1,), at the ends of the periods
    mean_rad_s: np.ndarray  #: within each period
    which: np.ndarray  #: period of each sample
    begins: bool
    first: int
    notes: list[str] = field(default_factory=list)
    values: dict[str, object] = field(default_factory=dict)  #: the board's parameters, if known
    outside: bool = False
    torque_known: bool = True
    speed_known: bool = True
    places: int = 1

    @property
    def periods(self) -> int:
        return len(self.torque_ref_Nm)

    def edges_of(self, speed_rpm: np.ndarray) -> np.ndarray:
        """`omega_rad_s` from a speed channel with these samples."""
        of_periods = _means if self.outside else _held
        return _edges(_filled(of_periods(np.asarray(speed_rpm, float), self.which, self.periods)))

    @property
    def duration_s(self) -> float:
        return self.periods * self.slow_s


def read(
    rec: Recording,
    path: str | Path,
    setup: Setup,
    window_s: tuple[float, float] | None = None,
    loads: Load = NO_LOAD,
    speed_rpm: float | None = None,
) -> Bench:
    """RecordingError in one line if the recording cannot be compared with the set-up. loads and
    speed_rpm are for a recording without torque reference and speed."""
    try:
        return make(rec, str(path), setup, window_s, loads, speed_rpm)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None


def make(
    rec: Recording,
    label: str,
    setup: Setup,
    window_s: tuple[float, float] | None = None,
    loads: Load = NO_LOAD,
    speed_rpm: float | None = None,
) -> Bench:
    outside = _is_outside(rec)
    torque_known, speed_known = (name in rec for name in ("torque_ref_Nm", "speed_rpm"))
    f_isr_Hz, f_slow_Hz = (float(setup.parameter(key)) for key in ("f_isr_Hz", "f_slow_Hz"))
    values = _values(rec)
    _check(rec, setup, values, f_isr_Hz, f_slow_Hz, outside)
    if outside:
        rec = _completed(rec, setup, speed_rpm)
    notes: list[str] = list(rec.notes)
    rec = _averaged(rec, f_isr_Hz) if outside else _at_most(rec, f_isr_Hz)
    rec, begins = _running(rec, notes)
    if window_s is not None:
        whole_s = rec.start_s, rec.start_s + rec.duration_s
        rec = rec.window(*window_s)
        begins = begins and window_s[0] <= whole_s[0]
        if not len(rec):
            raise RecordingError(
                "no samples in the window; the drive ran from "
                f"{whole_s[0]:.6g} to {whole_s[1]:.6g} s"
            )
    elif rec.duration_s > LONGEST_S:
        notes.append(f"{rec.duration_s:.4g} s: the first {LONGEST_S:g} s are compared")
        rec = rec.window(rec.start_s, rec.start_s + LONGEST_S)
    if rec.duration_s < SHORTEST_S:
        raise RecordingError(
            f"{rec.duration_s:.3g} s in which the drive runs: {SHORTEST_S:g} s or more are needed"
        )
    if outside:
        phases = {p: np.asarray(rec[f"i_{p}_A"]) for p in PHASES if f"i_{p}_A" in rec}
        speed = np.asarray(rec["speed_rpm"]) if speed_known or speed_rpm is not None else None
        displacement_deg = float(setup["machine.displacement_deg"])
        notes += wiring.check(phases, rec.rate_Hz, speed, displacement_deg)
    of_periods = _means if outside else _held
    found = _in_slow_periods(
        rec, label, setup, f_isr_Hz / f_slow_Hz, begins, notes, values, of_periods
    )
    if outside:
        found = _from_outside(found, setup, loads, torque_known, speed_known)
    return found


def _is_outside(rec: Recording) -> bool:
    """Whether something else than a board or a simulation has recorded it."""
    return not (FIRST_TICK in rec.meta or "parameters" in rec.meta or "psi_alpha_Wb" in rec)


def _completed(rec: Recording, setup: Setup, speed_rpm: float | None) -> Recording:
    """With the constants that take the place of channels that are not recorded."""
    rest = {"speed_rpm": setup["point.speed_rpm"] if speed_rpm is None else speed_rpm}
    rest["torque_ref_Nm"] = 0.0  # it follows from the shaft later on
    more = {name: np.full(len(rec), value) for name, value in rest.items() if name not in rec}
    return replace(rec, channels={**rec.channels, **more})


def _averaged(rec: Recording, f_isr_Hz: float) -> Recording:
    """Means over the fast periods: the instants of an oscilloscope's samples are not the board's,
    but the mean knows no instants."""
    per = round(rec.rate_Hz / f_isr_Hz)
    if per <= 1:
        return rec
    whole = len(rec) // per * per
    channels = {
        name: np.asarray(data, float)[:whole].reshape(-1, per).mean(axis=1)
        for name, data in rec.channels.items()
    }
    start_s = rec.start_s + (per - 1) / 2 / rec.rate_Hz
    return replace(rec, rate_Hz=rec.rate_Hz / per, channels=channels, start_s=start_s)


def _from_outside(
    bench: Bench, setup: Setup, loads: Load, torque_known: bool, speed_known: bool
) -> Bench:
    """The speed without its noise, and where no torque reference is recorded the torque that this
    speed and the load need."""
    periods = bench.periods
    speed = bench.omega_rad_s[1:]
    width = max(1, min(round(SMOOTH_S / bench.slow_s), periods))
    padded = np.pad(speed, (width // 2, width - 1 - width // 2), mode="edge")
    omega = np.convolve(padded, np.full(width, 1 / width), "valid")
    omega = np.concatenate([omega[:1], omega])
    time_s = bench.begin_s + bench.slow_s * np.arange(periods)
    torque_Nm = bench.torque_ref_Nm
    if not torque_known:
        shaft = parts(setup, loads, omega, time_s, bench.slow_s, np.arange(periods))
        torque_Nm = shaft["needed"]
        bench.notes.append(
            "no torque_ref_Nm: the torque follows from the speed and the set-up's inertia, "
            "friction and load"
        )
    if not speed_known:
        bench.notes.append(f"no speed_rpm: {speed[0] * 30 / np.pi:.6g} r/min are taken (--speed)")
    bench.notes.append(
        f"not recorded by the board: {UNKNOWN_OUTSIDE} cannot be seen"
        + ("" if speed_known else ", nor the slip")
        + "; ripple is not compared"
    )
    return replace(
        bench, omega_rad_s=omega, torque_ref_Nm=torque_Nm, outside=True,
        torque_known=torque_known, speed_known=speed_known,
    )  # fmt: skip


def _values(rec: Recording) -> dict[str, object]:
    """The parameters of the controller that ran, as far as the recording has them."""
    parameters = rec.meta.get("parameters")
    values = parameters.get("controller") if isinstance(parameters, dict) else None
    return dict(values) if isinstance(values, dict) else {}


def _check(
    rec: Recording, setup: Setup, values: dict, f_isr_Hz: float, f_slow_Hz: float, outside: bool
) -> None:
    if not len(rec):
        raise RecordingError("no samples")
    missing = [name for name in NEEDED if name not in rec and not outside]
    for phases in SETS:
        names = [f"i_{phase}_A" for phase in phases]
        if sum(name in rec for name in names) < 2:
            missing.append(f"two of {', '.join(names)}")
    if missing:
        raise RecordingError(
            f"no {'; no '.join(missing)}: these channels are needed, there are "
            f"{', '.join(rec.channels)}"
            + (" (--map OLD=NEW*K renames, convert joins files)" if outside else "")
        )
    scheme = rec.meta.get("scheme") or values.get("scheme")
    if scheme is not None and scheme != setup.parameter("scheme"):
        raise RecordingError(
            f"recorded with scheme {scheme}, but {setup.name} has {setup.parameter('scheme')}: set "
            "controller.scheme"
        )
    for key, theirs, ours in (
        ("f_isr_Hz", rec.meta.get(TICK_HZ) or values.get("f_isr_Hz"), f_isr_Hz),
        ("f_slow_Hz", values.get("f_slow_Hz"), f_slow_Hz),
    ):
        if isinstance(theirs, int | float) and abs(theirs / ours - 1) > 1e-3:
            raise RecordingError(
                f"recorded with {key} = {theirs:.6g}, but {setup.name} has {ours:.6g}: set "
                f"controller.{key}"
            )
    if rec.rate_Hz < f_slow_Hz * (1 - 1e-6):
        raise RecordingError(
            f"{rec.rate_Hz:.6g} samples per second: {f_slow_Hz:g} or more are needed, one for each "
            "period of the speed loop"
        )


def _at_most(rec: Recording, f_isr_Hz: float) -> Recording:
    """A simulation's recording has each value of the firmware several times."""
    per = round(rec.rate_Hz / f_isr_Hz)
    if per <= 1:
        return rec
    channels = {name: data[::per] for name, data in rec.channels.items()}
    return Recording(rec.rate_Hz / per, channels, rec.units, rec.meta, rec.start_s)


def _running(rec: Recording, notes: list[str]) -> tuple[Recording, bool]:
    """The longest part in which the drive ran, and whether its start is in it."""
    if "state" not in rec:
        notes.append("no channel state: the drive is taken to run all the time")
        return rec, False
    state = np.asarray(rec["state"], float)
    runs = np.where(np.isfinite(state), state == RUN, False)
    # A lost sample does not end a run.
    lost = ~np.isfinite(state)
    runs = runs | (lost & np.roll(runs, 1))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], runs.astype(np.int8), [0]])))
    spans = edges.reshape(-1, 2)
    if not len(spans):
        raise RecordingError("the drive does not run in it (channel state)")
    first, last = max(spans, key=lambda span: span[1] - span[0])
    part = {name: data[first:last] for name, data in rec.channels.items()}
    speed_rpm = np.asarray(part["speed_rpm"], float)
    begins = first > 0 and bool(np.nan_to_num(abs(speed_rpm[0]), nan=1e9) < STANDSTILL_RPM)
    begin_s = rec.start_s + first / rec.rate_Hz
    return Recording(rec.rate_Hz, part, rec.units, rec.meta, begin_s), begins


def _in_slow_periods(
    rec: Recording,
    label: str,
    setup: Setup,
    slow: float,
    begins: bool,
    notes: list[str],
    values: dict[str, object],
    of_periods: Callable[[np.ndarray, np.ndarray, int], np.ndarray],
) -> Bench:
    """slow: fast periods in a slow one; of_periods: the value in each slow period of a channel that
    the slow interrupt sets."""
    slow = round(slow)
    f_isr_Hz = float(setup.parameter("f_isr_Hz"))
    at = np.arange(len(rec)) * (f_isr_Hz / rec.rate_Hz)
    reference = np.asarray(rec["torque_ref_Nm"], float)
    phase = _phase(at, reference, slow)
    places = max(1, round(f_isr_Hz / rec.rate_Hz))
    # A period of the slow loop that began before the drive ran has no reference yet.
    if begins and phase < places and not np.any(reference[at < phase + slow]):
        phase += slow
    keep = at >= phase
    periods = int((at[-1] - phase) // slow)
    keep &= at < phase + periods * slow
    samples = {name: np.asarray(data)[keep] for name, data in rec.channels.items()}
    since = at[keep] - phase
    which = (since // slow).astype(int)

    def mean(name: str) -> np.ndarray:
        return _filled(_means(np.asarray(samples[name], float), which, periods))

    if "vdc_V" in samples:
        vdc = mean("vdc_V")
    else:
        notes.append(f"no channel vdc_V: the set-up's {setup['inverter.vdc_V']:g} V are taken")
        vdc = np.full(periods, float(setup["inverter.vdc_V"]))
    if not values:
        notes.append("no parameters in its metadata: those of the set-up are taken")
    begin_s = rec.start_s + phase / f_isr_Hz
    speed_rpm = _filled(of_periods(np.asarray(samples["speed_rpm"], float), which, periods))
    return Bench(
        label, samples, np.rint(since).astype(int) + 1, 1 / rec.rate_Hz,
        slow / f_isr_Hz, begin_s,
        mean("torque_ref_Nm"), vdc, _edges(speed_rpm), _within(speed_rpm), which, begins,
        round(phase), notes, values, places=places,
    )  # fmt: skip


def _within(speed_rpm: np.ndarray) -> np.ndarray:
    """Mean speed in rad/s of the periods. A slow interrupt measures that of the period before
    it."""
    return np.append(speed_rpm[1:], speed_rpm[-1]) * np.pi / 30


def _edges(speed_rpm: np.ndarray) -> np.ndarray:
    """Speed in rad/s at the ends of the periods, from that within them."""
    speed = speed_rpm * np.pi / 30
    between = (speed[:-1] + speed[1:]) / 2
    return np.concatenate([between, speed[-1:], speed[-1:]])


def _phase(at: np.ndarray, reference: np.ndarray, slow: int) -> float:
    """The fast period, of the first slow one, in which the references change."""
    changes = at[1:][np.diff(reference) != 0] % slow
    if not len(changes):
        return 0.0
    places, counts = np.unique(np.rint(changes).astype(int), return_counts=True)
    return float(places[np.argmax(counts)])


def _means(values: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    good = np.isfinite(values)
    sums = np.bincount(which[good], values[good], n)
    counts = np.bincount(which[good], minlength=n)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _held(values: np.ndarray, which: np.ndarray, n: int) -> np.ndarray:
    """A channel that changes once in a period, from the middle of it: at the interrupt itself one
    channel has its next value already, another one not yet. The mean where this sample is lost."""
    begins, ends = (np.searchsorted(which, np.arange(n), side) for side in ("left", "right"))
    middle = values[np.minimum((begins + ends - 1) // 2, len(values) - 1)]
    return np.where((ends > begins) & np.isfinite(middle), middle, _means(values, which, n))


def _filled(values: np.ndarray) -> np.ndarray:
    """Where all samples of a period are lost, a straight line between its neighbours."""
    good = np.isfinite(values)
    if not good.any():
        raise RecordingError("a channel has no value at all")
    return np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])


def as_the_board(setup: Setup, benches: Sequence[Bench], notes: list[str]) -> Setup:
    """The set-up with its controller's parameters written down, so that a change of the machine
    changes no parameter of the controller: those of the board where the recording has them."""
    own = {name: value for name, value in firmware_values(setup).items() if name not in TIMING_OWNS}
    theirs = benches[0].values
    for bench in benches[1:]:
        other = [n for n in own if n not in FOLLOWED and bench.values.get(n) != theirs.get(n)]
        if other and bench.values and theirs:
            notes.append(f"{bench.label}: other parameters than the first one: {', '.join(other)}")
    differ = []
    for name, value in own.items():
        if name in theirs and name not in FOLLOWED and not _same(theirs[name], value):
            differ.append(f"{name} = {_short(theirs[name])} (set-up: {_short(value)})")
            own[name] = theirs[name]
    if differ:
        notes.append(f"the board's parameters are taken: {', '.join(differ)}")
    machine = parameters_of(setup["machine.model"])(**setup.machine_values())
    own |= machine.known_start(own)
    return setup.changed(**{f"controller__{name}": value for name, value in own.items()})


#: Parameters that the replay sets from the recording.
FOLLOWED = ("control_mode", "speed_ref_rpm", "torque_ref_Nm")


def firmware_values(setup: Setup) -> dict[str, object]:
    from ..setups import parameters

    return dict(parameters(setup))


def _same(a: object, b: object) -> bool:
    if isinstance(a, int | float) and isinstance(b, int | float):
        return abs(a - b) <= 1e-5 * max(abs(a), abs(b))
    return a == b


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
