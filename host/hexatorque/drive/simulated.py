"""Software in the loop: the firmware controls a simulated plant, both in compiled code.

sim = SimulatedDrive(hexatorque.load("paper-b"))
sim.start()
sim.set("speed_ref_rpm", 2500)
sim.run(1.0)
recording = sim.take()
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from .. import __version__, firmware
from ..given import pairs, parameter_name
from ..laws.controller import controller_of
from ..laws.law import Law
from ..plant.loop import MAX_STEP_S
from ..recording.recording import SPEED_REFERENCE, STARTED, Recording, clock_text
from ..setups import Setup, SetupError, load, parameters
from .captures import Burst
from .hardware import Hardware
from .interface import DriveFault, DriveVerbs, Progress, finite, seconds
from .samples import NOTHING, Samples

__all__ = ["DriveFault", "SimulatedDrive"]

#: Periods per compiled call: so few that progress is shown and Ctrl-C works, and so many that the
#: call's own time, about 0.3 ms, does not count.
CHUNK = 10_000
#: Simulated time between two checks whether a capture is complete.
CAPTURE_TURN_S = 0.01
#: Controller parameters that also set the timing of the simulated hardware.
TIMED_WITH_THE_PLANT = ("f_isr_Hz", "f_slow_Hz", "load_mode", "write_delay_us")


class SimulatedDrive(Hardware, DriveVerbs):
    """One drive: machine, inverter, sensors and firmware. Time passes in `run` only.

    setup: the set-up that describes all of it, its name or its file; samples_per_period: plant
    samples that are recorded per control period; controller: a `Law` of your own in place of the
    scheme, or controller(device, values), which makes the controller; by default the firmware in
    this process. SetupError or FirmwareError if the set-up's values do not fit together.

    load_Nm, vdc_V: torque of the load and voltage of the dc link now (`set` changes them);
    period_s: control period; periods: how many have passed; wall_s: seconds that the simulation
    has taken; plant_state: (8,) the machine's state as its model has it, [6] is the speed of the
    shaft in rad/s; machine: the model's parameters; sensors, inverter: numpy records of the
    plant's, which may be changed between two runs; bodies: temperatures of the machine, and
    junctions: of the devices, if the set-up has [heat].
    """

    def __init__(
        self,
        setup: str | Path | Setup,
        samples_per_period: int = 4,
        controller: Law | Callable[..., firmware.Controller] = firmware.Controller,
    ) -> None:
        setup = setup if isinstance(setup, Setup) else load(setup)
        make = controller_of(controller) if isinstance(controller, Law) else controller
        if not callable(make):
            raise SetupError(f"controller = {controller!r}: a Law is needed")
        super().__init__(setup, make(setup["timing.device"], parameters(setup)), samples_per_period)
        self.wall_s = 0.0
        self._started_s = time.time()  # wall-clock time at the beginning of the simulation
        #: Time and value of each speed reference, from the one in force when recording began.
        self._speed_refs = [(0.0, float(self.controller.get("speed_ref_rpm")))]
        self._burst: Burst | None = None
        displacement_deg = setup.machine_values()["displacement_deg"]
        self._samples = Samples(samples_per_period, displacement_deg, self._more_channels())
        self._record_start = 0
        self._transitions = 0  # at `_record_start`
        self._all_transitions: np.ndarray = self._pwm.transitions  # a view

    def follow_timers(self) -> None:
        """Adopt the periods that the firmware has written to its timers. This is needed when
        f_isr_Hz was changed by a client of a virtual board instead of through this object. If a
        period has changed, the samples recorded so far are deleted."""
        if self._adopt_timers():
            self.discard()

    def start(self) -> None:
        """Start the drive: it measures its sensors' offsets and builds up the flux while `run` lets
        time pass, by default 0.35 s, and then follows `speed_ref_rpm`."""
        self.controller.start()
        self._commanded()

    def stop(self) -> None:
        self.controller.stop()
        self._commanded()

    def clear(self) -> None:
        self.controller.clear()
        self._commanded()

    @property
    def params(self) -> Mapping[str, firmware.Parameter]:
        return MappingProxyType(self.controller.parameters)

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        return firmware.channels()

    @property
    def condition(self) -> firmware.State:
        return self.controller.condition

    @property
    def faults(self) -> list[str]:
        return self.controller.faults

    @property
    def snapshot(self) -> firmware.Snapshot | None:
        return self.controller.snapshot

    def get(self, name: str) -> str | float:
        return self.controller.get(name)

    def set_many(self, values: Mapping[str, object]) -> None:
        """Set controller parameters, and `load_Nm` and `vdc_V` of the plant, name -> value. If one
        is refused, none changes, and InputError names it and the allowed range. Parameters that
        also set the timing of the simulated hardware belong to the set-up."""
        values = {parameter_name(name): value for name, value in pairs(values).items()}
        plant: dict[str, float] = {}
        for name in ("load_Nm", "vdc_V"):
            if name in values:
                number = finite(values[name])
                if number is None:
                    raise SetupError(f"{name} = {values[name]}: a finite number is needed")
                plant[name] = number
        controller = {name: value for name, value in values.items() if name not in plant}
        for name in controller:
            if name in TIMED_WITH_THE_PLANT:
                raise SetupError(f"{name}: belongs to the set-up, make a new simulation")
        if controller:
            self.controller.set_many(controller)
            self.taken_tick = self.periods + 1  # the firmware counts from 1
            self._commanded()
        if "speed_ref_rpm" in controller:
            self._speed_refs.append((self.time_s, float(self.controller.get("speed_ref_rpm"))))
        for name, value in plant.items():
            setattr(self, name, value)

    def close(self) -> None:
        """Nothing to do: simulated time passes only in `run`."""

    def run(
        self,
        duration_s: float,
        record: bool = True,
        progress: Progress | None = None,
    ) -> None:
        """Simulate `duration_s`, and record unless `record` is False. `progress` is called with
        the simulated seconds that have just passed. InputError if `duration_s` is below 0, no
        number, or too long for the memory, ArithmeticError if the simulation diverges."""
        left = round(seconds(duration_s, 0.5 * self.period_s) / self.period_s)
        if record:
            self._samples.check_room(left, self.period_s)
        while left > 0:
            n = min(left, CHUNK)
            self._run_chunk(n, record)
            left -= n
            if progress:
                progress(n * self.period_s)

    def _run_chunk(self, n: int, record: bool) -> None:
        plant, channels = NOTHING, NOTHING
        if record:
            plant, channels = self._samples.room(n)
        elif self._burst:
            channels = np.empty((n, len(firmware.channels())), np.float32)
        if self.periods == 0:
            self._started_s = time.time()
        began = time.perf_counter()
        self._advance(n, plant, channels)
        self.wall_s += time.perf_counter() - began
        self.controller.confirm()
        if not np.isfinite(self.plant_state).all():
            raise ArithmeticError(
                f"the simulation diverged before {self.time_s + n * self.period_s:.4g} s: "
                "are the machine's time constants below the integration step, "
                f"{MAX_STEP_S * 1e6:g} us?"
            )
        if self._burst:
            self._burst.feed(channels, self.periods + 1)  # the firmware counts from 1
        self.periods += n
        if not record:
            self.discard()

    def rows(self, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Simulate so many control periods, and return what they had as two tables of float32: the
        true values, (periods * samples_per_period, n) with the columns `plant.loop.PLANT_CHANNELS`,
        and the firmware's `channels`, (periods, n). Nothing is recorded. For loops that look at
        each period this is quicker than `run` and `take`. The next call uses the same memory."""
        self.discard()
        self._run_chunk(periods, True)
        tables = self._samples.plant.filled(), self._samples.channels.filled()
        self.discard()
        return tables

    @property
    def transitions(self) -> int:
        """How often a leg has changed its state so far."""
        return int(self._all_transitions.sum())

    def discard(self) -> None:
        """Delete the samples recorded so far."""
        self._samples.clear()
        self._record_start = self.periods
        self._speed_refs = self._speed_refs[-1:]
        self._transitions = self.transitions

    def arm(
        self,
        channels: Sequence[str],
        samples: int,
        pre: int = 0,
        trigger: str = "manual",
        prescaler: int = 1,
    ) -> None:
        self._burst = Burst.named(channels, samples, pre, trigger, prescaler)

    def trigger(self) -> None:
        if self._burst:
            self._burst.trigger()

    def cancel(self) -> None:
        self._burst = None

    def _commanded(self) -> None:
        if self._burst:
            self._burst.commanded()

    def captured(
        self,
        timeout_s: float | None = None,
        now: bool = False,
        full: Callable[[], None] | None = None,
    ) -> Recording:
        burst, begun_s = self._burst, self.time_s
        if burst is None:
            raise SetupError("capture: none is armed")
        if now:
            burst.trigger()
        while not burst.complete:
            if timeout_s is not None and self.time_s - begun_s > timeout_s:
                raise SetupError(f"capture: not complete within {timeout_s:g} s")
            self.run(CAPTURE_TURN_S)
        if full:
            full()
        return burst.recording(self._meta(), self.period_s)

    def take(self) -> Recording:
        """Return the samples recorded since the last `take`, `discard` or unrecorded run:
        `samples_per_period` a control period. Channels `plant.…` are true values, the others are
        the firmware's, and keep their value until the next control period. The recording gets the
        memory that the simulation has filled; its channels are made when they are asked for."""
        channels, units = self._samples.hand_over()
        periods = self.periods - self._record_start
        jumps = self.transitions - self._transitions
        meta = {
            **self._meta(),
            "samples_per_period": self.samples_per_period,
            # Mean switching frequency of a switch: two transitions per cycle, six legs.
            "f_sw_Hz": jumps / (12 * periods * self.period_s) if periods else None,
        }
        if self.controller.get("control_mode") == "speed":
            meta[SPEED_REFERENCE] = [list(one) for one in self._speed_refs]
        start = self._begun_s + (self._record_start - self._begun) * self.period_s
        self.discard()
        return Recording(self.samples_per_period / self.period_s, channels, units, meta, start)

    def _meta(self) -> dict:
        return {
            "hexatorque": __version__,
            STARTED: clock_text(self._started_s),
            "setup": self.setup.name,
            "title": self.setup.title,
            "scheme": self.controller.get("scheme"),
            "latency": self.setup["timing.latency"],
            "processor": self.controller.processor,
            "parameters": self.setup.summary(),
            "state": self.controller.state,
            "faults": self.controller.faults,
            "register_violations": int(self.controller.registers.violations),
            "short_pulses": self.short_pulses,
        }


def compile_now() -> None:
    """Compile the simulation, or load it from the cache. A process does this only once."""
    SimulatedDrive(load("paper-a-feasible"))
