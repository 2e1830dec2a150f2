"""The state `test` of a drive: apply voltages, capture currents, and relate both in time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Self

import numpy as np

from ..drive.interface import DriveFault, DriveVerbs
from ..errors import HexatorqueError
from ..firmware import FAULT, FAULTS, TEST, lib
from ..plant.vsd import INVERSE, PHASES, TRANSFORM, transform
from ..recording.recording import FIRST_TICK, Recording

OFF = np.zeros(4)
CURRENTS = tuple(f"i_{phase}_A" for phase in PHASES)
#: Values of a capture's memory where the drive does not tell it: the F28377S's image.
MEMORY = 20480
#: Share of the stated limit at which the firmware trips. The rest is for the current's rise until
#: the next sample, for ripple, and for a sensor that reads a little low.
TRIP_SHARE = 0.8
#: Largest voltage on one leg, share of the dc link's. Less if the pulse must lie behind a late
#: write.
MOST_PU = 0.4
#: Longest time that a test may last without the host's stopping it.
LONGEST_S = 600.0
#: A test waits this long for a shaft that coasts.
STAND_STILL_S = 30.0
#: And this much longer than it takes for the calibration of the current sensors.
CALIBRATED_S = 10.0
#: Faults that mean something else in a test.
OVERCURRENT, OVERSPEED = FAULTS[lib.HT_FAULT_OVERCURRENT], FAULTS[lib.HT_FAULT_OVERSPEED]
#: Parameters that a test changes, and that get their values back.
BORROWED = (
    "start_mode", "test_wave", "test_Hz", "test_alpha_V", "test_beta_V", "test_x_V", "test_y_V",
    "test_current_A", "test_travel_rev", "test_s",
)  # fmt: skip


class CommissioningError(HexatorqueError):
    """Commissioning cannot go on; the text says why."""


@dataclass(frozen=True)
class Limits:
    current_A: float  #: no phase current goes beyond it
    travel_rev: float  #: the shaft's movement in each test of the state `test`, either way
    speed_rpm: float = 0.0  #: highest speed of the running drive


class Frame(NamedTuple):
    """The planes of a winding, as the drive's parameters have it."""

    transform: np.ndarray  #: (4, 6): rows alpha, beta, x, y
    inverse: np.ndarray  #: (6, 4)
    displacement_deg: float = 30.0


def frame(displacement_deg: float) -> Frame:
    rows = transform(displacement_deg)
    return Frame(rows, 3 * rows.T, displacement_deg)


#: Of the asymmetrical winding.
FRAME = Frame(TRANSFORM, INVERSE)


def frame_of(drive: DriveVerbs) -> Frame:
    """Of the drive's winding, by its parameters. An old firmware has one winding only."""
    if "displacement_deg" not in drive.params:
        return FRAME
    return frame(float(drive.get("displacement_deg")))


@dataclass(frozen=True)
class Samples:
    """Currents at n samples, and the voltages between them."""

    dt_s: float
    i_A: np.ndarray  #: (n, 6), in the order of the channels
    vdc_V: np.ndarray  #: (n,)
    v_V: np.ndarray  #: (n - 1, 4): alpha, beta, x, y as commanded, mean from sample to sample
    frame: Frame = FRAME

    @property
    def i_vsd_A(self) -> np.ndarray:
        return self.i_A @ self.frame.transform.T


class Excitation:
    """A drive in the state `test`, from the beginning of the `with` block to its end."""

    def __init__(self, drive: DriveVerbs, limits: Limits, travel_rev: float | None = None) -> None:
        self.drive, self.limits = drive, limits
        self.travel_rev = limits.travel_rev if travel_rev is None else travel_rev
        self.frame = FRAME
        self._before: Mapping[str, object] = {}

    def __enter__(self) -> Self:
        drive = self.drive
        self._before = {name: drive.get(name) for name in BORROWED}
        self.f_isr_Hz = float(drive.get("f_isr_Hz"))
        self.frame = frame_of(drive)
        shadow = drive.get("load_mode") == "shadow"
        self._delay = 1 if shadow else 0
        late_pu = 0.0 if shadow else 1e-6 * float(drive.get("write_delay_us")) * self.f_isr_Hz
        self.most_pu = min(MOST_PU, 0.98 * (0.5 - late_pu))
        self.dead_V = 0.0
        try:
            drive.set_many(
                {
                    "start_mode": "test",
                    "test_current_A": TRIP_SHARE * self.limits.current_A,
                    "test_travel_rev": self.travel_rev,
                    "test_s": LONGEST_S,
                    **self._values(np.zeros(4), "square", 0.0),
                }
            )
            self._begin()
        except BaseException:
            self.drive.stop()
            self._restore()
            raise
        return self

    def _begin(self) -> None:
        self._stand_still()
        self.drive.start()
        self.drive.run(float(self.drive.get("calibration_s")) + 0.01, record=False)
        # A virtual board on a busy computer is slower than real time.
        for _ in range(round(CALIBRATED_S / 0.05)):
            if not self._calibrates():
                break
            self.drive.run(0.05, record=False)
        self._check()

    def begin_again(self, seconds: float) -> None:
        """Gates off for some time: the flux decays. Then the shaft's movement counts anew."""
        self.drive.stop()
        self.drive.run(seconds, record=False)
        self._begin()

    def _stand_still(self) -> None:
        """Wait for a shaft that still coasts: the firmware starts at standstill only."""
        most_rpm = float(self.drive.get("start_max_rpm"))
        for _ in range(round(STAND_STILL_S / 0.25)):
            found = self.drive.capture(("speed_rpm",), 10, prescaler=10, timeout_s=5)
            if abs(float(found["speed_rpm"].mean())) < 0.9 * most_rpm:
                return
            self.drive.run(0.25, record=False)
        raise CommissioningError(
            f"the shaft does not come to rest within {STAND_STILL_S:g} s; a test starts below "
            f"{most_rpm:g} r/min"
        )

    def __exit__(self, *_: object) -> None:
        self.drive.stop()
        self._restore()

    def _restore(self) -> None:
        self.drive.set_many(self._before)

    def _calibrates(self) -> bool:
        """The drive has been started and its gates are still off."""
        now = self.drive.condition
        return now.at_work and not now.gates_on

    def _check(self) -> None:
        if self.drive.state != TEST:
            causes = self.drive.faults
            if not causes:
                if self._calibrates():
                    raise CommissioningError(
                        "the board has not calibrated its current sensors within "
                        f"{CALIBRATED_S:g} s"
                    )
                self.drive.check()
                raise CommissioningError("somebody has stopped the drive")
            if OVERSPEED in causes:
                raise CommissioningError(
                    f"{OVERSPEED}: by its encoder the shaft has turned by more than "
                    f"{self.travel_rev:g} revolutions in a test. Nothing may drive it, friction or "
                    "a brake must hold it, and the encoder must not count too much; --travel "
                    "allows more"
                )
            raise DriveFault(causes, self.drive.time_s)

    @staticmethod
    def _values(vector_V: np.ndarray, wave: str, hertz: float) -> dict[str, object]:
        names = ("test_alpha_V", "test_beta_V", "test_x_V", "test_y_V")
        return {
            "test_wave": wave,
            "test_Hz": hertz,
            **dict(zip(names, map(float, vector_V))),
        }

    @property
    def vdc_V(self) -> float:
        return float(self.drive.capture(("vdc_V",), 64, timeout_s=5)["vdc_V"].mean())

    def zero_counts(self) -> float:
        """Where the encoder's zero is; below 0: not known."""
        return float(self.drive.capture(("zero_counts",), 2, timeout_s=5)["zero_counts"][-1])

    def noise_A(self) -> float:
        """Noise of the current sensors, rms, without voltage."""
        found = self.drive.capture(CURRENTS, 500, timeout_s=5)
        return float(np.median([np.std(found[name]) for name in CURRENTS]))

    def set(self, vector_V: np.ndarray, wave: str = "square", hertz: float = 0.0) -> None:
        """Apply a voltage, alpha, beta, x and y. Its wave begins now."""
        self.drive.set_many(self._values(vector_V, wave, hertz))

    def wait(self, seconds: float) -> None:
        self.drive.run(seconds, record=False)
        self._check()

    def rest(self, seconds: float) -> None:
        """No voltage for some time: the currents decay."""
        self.set(OFF)
        self.wait(seconds)

    def on_leg(self, leg: int, volts: float) -> np.ndarray:
        """Alpha, beta, x, y of a voltage on one leg. Its zero sequence is missing, which two
        isolated star points do not see."""
        return self.frame.transform[:, leg] * volts

    def position(self) -> tuple[int, np.ndarray]:
        """The encoder's count, and the currents (6,) at that moment; at least 0.1 A must flow. No
        channel has the count, but the firmware saves it when it trips. So the limit of this test's
        current goes below the flowing one; then the test begins anew."""
        drive = self.drive
        drive.set("test_current_A", drive.params["test_current_A"].min)
        for _ in range(100):
            drive.run(0.005, record=False)
            if drive.state == FAULT:
                break
        causes, saved = drive.faults, drive.snapshot
        if causes != [OVERCURRENT] or saved is None:
            self._check()
            raise CommissioningError(
                "no current flows where a direct current should hold the shaft"
            )
        drive.clear()
        drive.set("test_current_A", TRIP_SHARE * self.limits.current_A)
        self._begin()
        return int(saved["position_counts"]), np.asarray(saved["i_A"], float)

    def most_samples(self) -> int:
        hello = getattr(self.drive, "hello", None)
        return (hello.memory if hello else MEMORY) // (len(CURRENTS) + 1)

    def pulse(
        self,
        vector_V: np.ndarray,
        wave: str,
        hertz: float,
        duration_s: float,
        most: int | None = None,
        then_V: np.ndarray | None = OFF,
    ) -> Samples:
        """Begin a wave and capture from its begin on, `most` samples at most. `then_V`: the
        voltage from when they are taken, while they come from a board: a rotor with magnets that
        nothing holds would swing in a wave for so long. None: the wave stays on."""
        ticks = round(duration_s * self.f_isr_Hz)
        room = self.most_samples()
        prescaler = max(1, math.ceil((ticks + 2) / min(room, most or room)))
        samples = ticks // prescaler + 1
        self.drive.arm((*CURRENTS, "vdc_V"), samples, 0, "command", prescaler)
        self.set(vector_V, wave, hertz)
        taken = self.drive.taken_tick
        full = None if then_V is None else partial(self.set, then_V)
        found = self.drive.captured(duration_s + 10, full=full)
        self._check()
        first = int(found.meta[FIRST_TICK]) - taken  # ticks after the wave's begin
        return self._samples(found, vector_V, wave, hertz, first, prescaler)

    def steady(
        self, vector_V: np.ndarray, settle_s: float, mean_s: float
    ) -> tuple[np.ndarray, float, int]:
        """Apply a constant voltage, wait, and return the means of currents (6,) and dc-link
        voltage, and of how many samples."""
        self.set(vector_V)
        self.wait(settle_s)
        samples = min(max(20, round(mean_s * self.f_isr_Hz)), self.most_samples())
        found = self.drive.capture((*CURRENTS, "vdc_V"), samples, timeout_s=10 + mean_s)
        self._check()
        i_A = np.column_stack([found[name] for name in CURRENTS]).astype(float)
        return i_A.mean(0), float(found["vdc_V"].mean()), samples

    def _samples(
        self,
        found: Recording,
        vector_V: np.ndarray,
        wave: str,
        hertz: float,
        first: int,
        prescaler: int,
    ) -> Samples:
        i_A = np.column_stack([found[name] for name in CURRENTS]).astype(float)
        n = len(i_A)
        # The step at tick k after the begin acts from sample k + delay to the next one.
        k = first + np.arange((n - 1) * prescaler) - self._delay
        v = voltage(vector_V, wave, 2 * np.pi * hertz / self.f_isr_Hz * k) * (k >= 0)[:, None]
        mean = v.reshape(n - 1, prescaler, 4).mean(1)
        return Samples(1 / found.rate_Hz, i_A, np.asarray(found["vdc_V"], float), mean, self.frame)


def voltage(vector_V: np.ndarray, wave: str, angle_rad: np.ndarray) -> np.ndarray:
    """The firmware's voltage for a vector at angles of the wave, (n, 4)."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    table = np.tile(np.asarray(vector_V, float), (len(cosine), 1))
    if wave == "rotate":
        a, b = vector_V[:2]
        table[:, 0], table[:, 1] = cosine * a - sine * b, sine * a + cosine * b
    else:
        axes = {"square": slice(0, 4), "square-ab": slice(0, 2), "square-xy": slice(2, 4)}[wave]
        table[cosine < -1e-9, axes] *= -1
    return table


def half_wave_Hz(f_isr_Hz: float, ticks: int) -> float:
    """Frequency of a square wave with half-waves of about `ticks` fast interrupts, whose edges lie
    between two of them."""
    return f_isr_Hz / (2 * (2 * (max(ticks, 3) // 2) + 1))
