"""Software in the loop: the firmware controls a simulated plant, both in compiled code.

sim = SimulatedDrive(hexatorque.load("paper-b"))
sim.start()
sim.set("speed_ref_rpm", 2500)
sim.run(1.0)
recording = sim.take()
"""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numba.experimental.function_type  # noqa: F401  (functions as arguments)
import numpy as np
from numba import types
from numba.extending import typeof_impl

from .. import __version__, firmware
from ..given import pairs, parameter_name
from ..laws.controller import controller_of
from ..laws.law import Law
from ..plant import machines
from ..plant.edges import Edges
from ..plant.gates import gates_record
from ..plant.inverter import DROPS, in_effect, inverter_record, longest_step_s
from ..plant.legs import BOUNCE, BREAK, KINDS, MAX_BREAKS
from ..plant.load import load_record, steepest_Nms
from ..plant.loop import (
    MAX_STEP_S,
    NO_INSTANTS,
    PLANT_CHANNELS,
    TIMING,
    run_periods,
    sample_instants,
)
from ..plant.pwm import NEVER, PWM_MAP, pwm_record
from ..plant.record import names_of, record
from ..plant.sensors import SENSORS
from ..plant.vsd import INVERSE, PHASES
from ..plant.wires import ENCODER_WIRES
from ..recording.channels import Channels, Held, Later, Product, RowOf
from ..recording.recording import SPEED_REFERENCE, STARTED, Recording, clock_text
from ..setups import Setup, SetupError, load, parameters
from .captures import Burst, Trigger, metadata
from .interface import DriveFault, DriveVerbs, Progress, finite, seconds

__all__ = ["DriveFault", "SimulatedDrive"]

#: Period register (two words) of CPU timer 0, which raises the slow interrupt.
TIMER_PERIOD = firmware.lib.HT_NUMBER_SLOW_PERIOD
RESET_TICKS = 0x10000  # the timer's period after a reset of the chip
#: Periods per compiled call: so few that progress is shown and Ctrl-C works, and so many that the
#: call's own time, about 0.3 ms, does not count.
CHUNK = 10_000
#: Simulated time between two checks whether a capture is complete.
CAPTURE_TURN_S = 0.01
#: Longest step, relative to the machine's shortest time constant. The integrator is then far
#: from its limit of stability, and the error of a step is 1e-7. For the papers' machines this
#: allows more than twice 100 us.
STEP_SHARE = 0.1
#: The same, relative to the shaft's shortest time constant. The error of a step is 1e-5 of what
#: decays with it.
SHAFT_SHARE = 0.25
#: Controller parameters that also set the timing of the simulated hardware.
TIMED_WITH_THE_PLANT = ("f_isr_Hz", "f_slow_Hz", "load_mode", "write_delay_us")
#: Stands for "do not record".
_NOTHING = np.empty((0, 0), np.float32)
#: Conduction drops that need shorter steps than this are refused: they would take too long.
SHORTEST_STEP_S = 0.1e-6


class _Rows:
    """A table that grows and reuses its memory. New memory pages would take more time than the
    simulation that fills them."""

    def __init__(self, width: int) -> None:
        self._data = np.empty((0, width), np.float32)
        self._used = 0

    def room(self, rows: int) -> np.ndarray:
        """The next `rows` rows, which the caller fills."""
        end = self._used + rows
        if end > len(self._data):
            grown = np.empty((max(end, 2 * len(self._data)), self._data.shape[1]), np.float32)
            grown[: self._used] = self._data[: self._used]
            self._data = grown
        begin, self._used = self._used, end
        return self._data[begin:end]

    def filled(self) -> np.ndarray:
        return self._data[: self._used]

    def clear(self) -> None:
        self._used = 0

    def hand_over(self) -> np.ndarray:
        """The filled rows, which now belong to the caller."""
        filled = self.filled()
        if 2 * len(filled) < len(self._data):
            filled = filled.copy()  # a small part of the memory must not hold all of it
        else:
            self._data = np.empty_like(self._data)
        self.clear()
        return filled


class EntryPoint(types.WrapperAddressProtocol):
    """A C function that compiled Python code can call."""

    def __init__(self, address: int, *arguments: types.Type) -> None:
        self._address = address
        self._signature = types.void(*arguments)
        self.type = types.FunctionType(self._signature)

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self):
        return self._signature

    def __call__(self, *arguments: int) -> None:
        """For a plant that is not compiled (NUMBA_DISABLE_JIT=1)."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_uint64] * len(arguments))(self._address)(
            *map(int, arguments)
        )


@typeof_impl.register(EntryPoint)
def _type_of(entry: EntryPoint, _: object) -> types.Type:
    """Numba's own rule makes the type again at every call, which takes a tenth of a millisecond."""
    return entry.type


def _pwm_map(m: firmware.CData, active_low: bool = False, min_pulse_us: float = 0.0) -> np.record:
    """The layout of the PWM registers, from the firmware's own map, and what the power stage
    wants: the gate drivers' polarity and the shortest gate pulse."""
    offsets = {n: int(getattr(m, n)) for n in names_of(PWM_MAP) if hasattr(m, n)}
    offsets = {n: -1 if v == 0xFFFF else v for n, v in offsets.items()}
    min_pulse = round(min_pulse_us * 1e-6 * float(m.pwm_clock_Hz))
    return record(PWM_MAP, **offsets, active_low=int(active_low), min_pulse=min_pulse)


class SimulatedDrive(DriveVerbs):
    """One drive: machine, inverter, sensors and firmware. Time passes in `run` only.

    setup: the set-up that describes all of it, its name or its file; samples_per_period: plant
    samples that are recorded per control period; controller: a `Law` of your own in place of the
    scheme, or controller(device, values), which makes the controller; by default the firmware in
    this process. SetupError or FirmwareError if the set-up's values do not fit together.

    load_Nm, vdc_V: torque of the load and voltage of the dc link now (`set` changes them);
    period_s: control period; periods: how many have passed; wall_s: seconds that the simulation
    has taken; plant_state: (8,) the machine's state as its model has it, [6] is the speed of the
    shaft in rad/s; machine: the model's parameters; sensors, inverter: numpy records of the
    plant's, which may be changed between two runs.
    """

    def __init__(
        self,
        setup: str | Path | Setup,
        samples_per_period: int = 4,
        controller: Law | Callable[..., firmware.Controller] = firmware.Controller,
    ) -> None:
        self.setup = setup = setup if isinstance(setup, Setup) else load(setup)
        make = controller_of(controller) if isinstance(controller, Law) else controller
        self.controller = make(setup["timing.device"], parameters(setup))
        period_counts = self.controller.period_counts
        clock = float(self.controller.map.pwm_clock_Hz)
        self.period_s = period_counts / clock
        if samples_per_period not in range(1, period_counts + 1):
            raise SetupError(
                f"samples_per_period = {samples_per_period}: allowed range is 1 .. {period_counts}"
            )
        sample_count = round(setup["sensors.sample_delay_us"] * 1e-6 * clock)
        write_count = round(setup.write_delay_us * 1e-6 * clock)
        if self.controller.shadow:
            write_count = max(1, write_count)
        if not sample_count <= write_count < period_counts:
            raise SetupError(
                f"sensors.sample_delay_us + timing.isr_us = {write_count / clock * 1e6:.3g} us: "
                f"must end within the period of {self.period_s * 1e6:.4g} us"
            )
        self.samples_per_period = samples_per_period
        model = machines.model(setup["machine.model"])
        self.machine = model.Parameters(**setup.machine_values())
        self._machine = model.make(self.machine)
        self._flux_Wb = setup.parameter("flux_ref_Wb")
        self._windings_step_s = min(MAX_STEP_S, STEP_SHARE / model.fastest_per_s(self._machine))
        self._timing = record(
            TIMING,
            clock_Hz=clock,
            period=period_counts,
            sample_count=sample_count,
            write_count=write_count,
            slow_every=self.controller.fast_per_slow,
            max_step=max(1, int(self._windings_step_s * clock)),
        )
        self._instants = sample_instants(samples_per_period, period_counts)
        self.plant_state = np.zeros(8)
        self.inverter = inverter_record(
            self.machine.phase_of_leg,
            range_A=setup["sensors.i_full_A"],
            **{name: setup[f"inverter.{name}"] for name in (*DROPS, "arc_V", "restrike_V_per_ms")},
        )
        if self.inverter.drops and longest_step_s(self.inverter, self._machine) < SHORTEST_STEP_S:
            raise SetupError(
                "inverter.v_switch_V, v_diode_V, r_switch_ohm, r_diode_ohm: too large for the "
                "machine's smallest leakage inductance, the simulation would need steps below "
                f"{SHORTEST_STEP_S * 1e6:g} us"
            )
        self._pwm = pwm_record()
        self._gates = gates_record(round(setup["inverter.min_pulse_us"] * 1e-6 * clock))
        board = self.controller.port.board
        self._map = _pwm_map(self.controller.map, board.gates_active_low, board.min_pulse_us)
        #: The sensors' constants and state. They may be changed between two runs.
        self.sensors = self._make_sensors()
        self._registers = self.controller.register_words()
        tbprd = self.controller.port.leg[0] + self.controller.map.tbprd
        self._timer_words = np.array([tbprd, TIMER_PERIOD, TIMER_PERIOD + 1])
        self._timers_followed = b""
        self.load_Nm = 0.0
        self.vdc_V = setup["inverter.vdc_V"]
        self.periods = 0
        self._begun, self._begun_s = 0, 0.0  # periods and time when the rate last changed
        self.wall_s = 0.0
        self._started_s = time.time()  # wall-clock time at the beginning of the simulation
        u64 = types.uint64
        self._entries = tuple(
            EntryPoint(firmware.address(name), *[u64] * arguments)
            for name, arguments in zip(self.controller.entries, (1, 1, 2))
        )
        #: Time and value of each speed reference, from the one in force when recording began.
        self._speed_refs = [(0.0, float(self.controller.get("speed_ref_rpm")))]
        self._burst: Burst | None = None
        self._burst_names: tuple[str, ...] = ()
        self._plant = _Rows(len(PLANT_CHANNELS))
        self._channels = _Rows(len(firmware.channels()))
        self._record_start = 0
        self._transitions = 0  # at `_record_start`
        self._all_transitions: np.ndarray = self._pwm.transitions  # a view
        self._edges = np.empty((0, 3), np.int64)
        self._edges_logged = 0
        self._logged_from = (self.inverter.broken.copy(), self.inverter.command.copy())
        # Compile now, or load from the cache, so that this does not count as simulation time.
        self._call(0, _NOTHING, _NOTHING)

    def _make_sensors(self) -> np.record:
        setup, m = self.setup, self.controller.map
        per_A = firmware.lib.HT_ADC_FULL / (2 * setup["sensors.i_full_A"])
        wires = np.array(setup["sensors.i_wires"], int)
        return record(
            SENSORS,
            i_counts_per_A=per_A * np.array(setup["sensors.i_gain"]) * np.sign(wires),
            i_leg=np.maximum(np.abs(wires) - 1, 0),
            i_filter_rad_s=2 * math.pi * setup["sensors.i_filter_Hz"],
            i_last_A=0.0,
            i_filtered_A=0.0,
            i_noise_counts=per_A * setup["sensors.i_noise_A"],
            random=setup["sensors.noise_seed"],
            i_offset_counts=firmware.lib.HT_ADC_MID + per_A * np.array(setup["sensors.i_offset_A"]),
            hold=0,
            v_counts_per_V=firmware.lib.HT_ADC_FULL / setup["sensors.vdc_full_V"],
            adc_full=float(firmware.lib.HT_ADC_FULL),
            adc_step=float(1 << (12 - setup["sensors.adc_bits"])),
            encoder_counts_rev=4.0 * setup["sensors.encoder_ppr"],
            encoder_wires=ENCODER_WIRES.index(setup["sensors.encoder_wires"]),
            adc_result=list(m.adc_result),
            adc_shift=int(m.adc_shift),
            adc_flag=int(m.adc_flag),
            adc_flag_bit=int(m.adc_flag_bit),
            encoder_error_cycles=setup["sensors.encoder_error_cycles"],
            eqep=int(self.controller.port.eqep),
            system_clocks=self.period_s * float(m.system_clock_Hz),
            position_counts=0.0,
            counter=0,
            ticks=0.0,
            event_tick=0,
            edges=0,
        )

    def follow_timers(self) -> None:
        """Adopt the periods that the firmware has written to its timers. This is needed when
        f_isr_Hz was changed by a client of a virtual board instead of through this object. If a
        period has changed, the samples recorded so far are deleted."""
        m, words, timing = self.controller.map, self._registers, self._timing
        raw = words[self._timer_words].tobytes()
        if raw == self._timers_followed:
            return
        self._timers_followed = raw
        counts = int(words[self.controller.port.leg[0] + m.tbprd]) + 1
        ticks = int(words[TIMER_PERIOD]) + (int(words[TIMER_PERIOD + 1]) << 16) + 1
        if ticks == RESET_TICKS:
            # Firmware on another processor does not report this register: its rate stays.
            slow_every = round(timing.slow_every * timing.period / counts)
        else:
            slow_every = round(ticks / float(m.system_clock_Hz) * float(m.pwm_clock_Hz) / counts)
        if (counts, slow_every) == (timing.period, timing.slow_every):
            return
        self._begun_s, self._begun = self.time_s, self.periods
        self.period_s = counts / float(m.pwm_clock_Hz)
        inv = self.inverter
        to_come = (inv.due_period - self.periods) * timing.period + inv.due_count
        timing.period, timing.slow_every = counts, slow_every
        for row in range(inv.due):
            self._schedule(row, int(to_come[row]))
        timing.write_count = min(timing.write_count, counts - 1)
        timing.sample_count = min(timing.sample_count, timing.write_count)
        self.sensors.system_clocks = self.period_s * float(m.system_clock_Hz)
        self.discard()

    @property
    def time_s(self) -> float:
        return self._begun_s + (self.periods - self._begun) * self.period_s

    def _time_of_tick(self, tick: int) -> float:
        # The firmware counts from 1, at the beginning of a period.
        return self._begun_s + (tick - 1 - self._begun) * self.period_s

    @property
    def speed_rpm(self) -> float:
        """True speed of the machine, in r/min."""
        return self.plant_state[6] * 30 / math.pi

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
        the simulated seconds that have just passed. InputError if `duration_s` is below 0 or no
        number, ArithmeticError if the simulation diverges."""
        left = round(seconds(duration_s, 0.5 * self.period_s) / self.period_s)
        while left > 0:
            n = min(left, CHUNK)
            self._run_chunk(n, record)
            left -= n
            if progress:
                progress(n * self.period_s)

    def _run_chunk(self, n: int, record: bool) -> None:
        plant, channels = _NOTHING, _NOTHING
        if record:
            plant = self._plant.room(n * self.samples_per_period)
            channels = self._channels.room(n)
        elif self._burst:
            channels = np.empty((n, len(firmware.channels())), np.float32)
        if self.periods == 0:
            self._started_s = time.time()
        began = time.perf_counter()
        self._call(n, plant, channels)
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

    def _call(self, n: int, plant: np.ndarray, channels: np.ndarray) -> None:
        load = load_record(self.setup["load.kind"], self.load_Nm, self.setup["load.at_rpm"])
        longest_s = min(self._windings_step_s, self._shaft_step_s(load))
        self._timing.max_step = max(1, int(longest_s * self._timing.clock_Hz))
        self._edges_logged = run_periods(
            n, self.periods, self._timing, self._machine, load, self.inverter,
            self._map, self._pwm, self._gates, self.sensors, self._registers,
            self.plant_state, self.vdc_V,
            *self._entries, self.controller.handle, channels.ctypes.data,
            self._instants if len(plant) else NO_INSTANTS, plant, channels,
            self._edges, self._edges_logged,
        )  # fmt: skip

    def _shaft_step_s(self, load: np.record) -> float:
        """Longest step for the shaft: a share of its shortest time constant, J over the slope of
        the load torque, and of its fastest swing against the field. SetupError if it is so short
        that the simulation would take too long."""
        inertia_kgm2 = self.setup["machine.inertia_kgm2"]
        viscous_Nms = self.setup["machine.viscous_Nms"]
        slope_Nms = steepest_Nms(load, self.setup["load.at_rpm"], viscous_Nms)
        flux_Wb = self.setup["machine.pole_pairs"] * self._flux_Wb
        swing_per_s = flux_Wb * math.sqrt(3 * float(self._machine.inv_l_max) / inertia_kgm2)
        step_s = SHAFT_SHARE / (slope_Nms / inertia_kgm2 + swing_per_s)
        if step_s < SHORTEST_STEP_S:
            raise SetupError(
                f"machine.inertia_kgm2 = {inertia_kgm2:g}: too small for a load of "
                f"{self.load_Nm:g} N m of the kind {self.setup['load.kind']}, the simulation would "
                f"need steps below {SHORTEST_STEP_S * 1e6:g} us"
            )
        return step_s

    def break_leg(self, phase: str, kind: str, after_s: float = 0.0) -> None:
        """Break the leg of a phase in `after_s` seconds of simulated time, at any instant of a
        period. `kind`: `open` (winding, cable or fuse), `blocked` (both switches stay off, their
        diodes remain), `upper` or `lower` (this switch stays off), or `none`: whole again. With
        `inverter.bounce_ms` a contact that opens closes and opens twice more (`legs.BOUNCE`)."""
        if phase not in PHASES:
            raise SetupError(f"phase = {phase!r}: choose one of {', '.join(PHASES)}")
        if kind not in KINDS:
            raise SetupError(f"kind = {kind!r}: choose one of {', '.join(KINDS)}")
        begin_s = finite(after_s)
        if begin_s is None or begin_s < 0:
            raise SetupError(f"after_s = {after_s}: a time of 0 s or more is needed")
        bounce_s = 1e-3 * self.setup["inverter.bounce_ms"] if kind == "open" else 0.0
        breaks = [(begin_s, kind)]
        if bounce_s > 0:
            breaks += [(begin_s + share * bounce_s, then) for share, then in BOUNCE]
        inv = self.inverter
        if inv.due + len(breaks) > MAX_BREAKS:
            raise SetupError(
                f"break_leg: {inv.due} breaks are to come, with {len(breaks)} more than "
                f"{MAX_BREAKS}, which is the most"
            )
        for due_s, becomes in breaks:
            self._schedule(inv.due, round(due_s * self._timing.clock_Hz))
            inv.due_leg[inv.due] = PHASES.index(phase)
            inv.due_kind[inv.due] = KINDS.index(becomes)
            inv.due += 1

    def _schedule(self, row: int, counts: int) -> None:
        """Let the break in this row of the list come in so many counts."""
        periods, count = divmod(counts, int(self._timing.period))
        self.inverter.due_period[row] = self.periods + periods
        self.inverter.due_count[row] = count

    @property
    def broken(self) -> dict[str, str]:
        """What is broken in each phase's leg now: phase -> none, open, blocked, upper or lower."""
        return {phase: KINDS[kind] for phase, kind in zip(PHASES, self.inverter.broken)}

    def lose_interrupts(self, lost: bool) -> None:
        """`lost`: from now on the ADC raises no fast interrupt. False: it raises it again."""
        self.controller.registers.lost = int(lost)

    def log_edges(self, capacity: int) -> None:
        """From now on keep every edge of a leg, `capacity` edges at most (0: none)."""
        self._edges = np.empty((capacity, 3), np.int64)
        self._edges_logged = 0
        self._logged_from = (self.inverter.broken.copy(), self.inverter.command.copy())

    @property
    def edges(self) -> np.ndarray:
        """The edges that `log_edges` kept, (n, 3): time in counts since the start of the
        simulation, leg, new state that the gate drivers command (`plant.legs`: LOW, HIGH or OFF),
        or what breaks (BREAK + kind)."""
        return self._edges[: self._edges_logged]

    def edges_since(self, period: int, start: np.ndarray) -> Edges:
        """The edges of the legs themselves, on the time axis of a recording that began with
        `period`, where the legs' states were `start`, (6,)."""
        time_s = (self.edges[:, 0] - period * self._timing.period) / self._timing.clock_Hz
        order = np.argsort(time_s, kind="stable")
        leg, state = self.edges[order, 1], self.edges[order, 2]
        if np.any(self._logged_from[0]) or np.any(state >= BREAK):
            state = self._in_effect(leg, state)
        return Edges(start, time_s[order], leg, state)

    def _in_effect(self, legs: np.ndarray, states: np.ndarray) -> np.ndarray:
        """What becomes of logged edges in legs of which some are broken."""
        broken, command = (values.copy() for values in self._logged_from)
        found = np.empty_like(states)
        for edge, (leg, state) in enumerate(zip(legs, states)):
            if state >= BREAK:
                broken[leg] = state - BREAK
            else:
                command[leg] = state
            found[edge] = in_effect(broken[leg], command[leg])
        return found

    @property
    def shorts(self) -> int:
        """How often the PWM commanded both switches of a leg to be on at the same time."""
        return int(np.sum(self._pwm.shorts))

    @property
    def short_pulses(self) -> int:
        """How many gate pulses were shorter than the board's power stage allows. A trip may end a
        pulse at any time."""
        return int(np.sum(self._pwm.short_pulses))

    @property
    def shortest_pulse_us(self) -> float:
        """The shortest gate pulse so far, in us; infinite if there was none."""
        counts = int(np.min(self._pwm.shortest))
        return math.inf if counts == NEVER else counts / self._timing.clock_Hz * 1e6

    def discard(self) -> None:
        """Delete the samples recorded so far."""
        self._plant.clear()
        self._channels.clear()
        self._record_start = self.periods
        self._speed_refs = self._speed_refs[-1:]
        self._transitions = int(self._all_transitions.sum())

    def arm(
        self,
        channels: Sequence[str],
        samples: int,
        pre: int = 0,
        trigger: str = "manual",
        prescaler: int = 1,
    ) -> None:
        what = Trigger.parse(trigger)
        on = {"fault": "faults"}.get(what.kind, what.channel or "state")
        names = [name for name, _ in firmware.channels()]
        for name in (*channels, on):
            if name not in names:
                raise SetupError(f"no channel {name!r}; there are {', '.join(names)}")
        columns = [names.index(name) for name in channels]
        self._burst = Burst(columns, samples, pre, prescaler, what, names.index(on))
        self._burst_names = tuple(channels)

    def trigger(self) -> None:
        if self._burst:
            self._burst.trigger()

    def cancel(self) -> None:
        self._burst = None

    def _commanded(self) -> None:
        if self._burst:
            self._burst.commanded()

    def captured(self, timeout_s: float | None = None, now: bool = False) -> Recording:
        burst, begun_s = self._burst, self.time_s
        if burst is None:
            raise SetupError("capture: none is armed")
        if now:
            burst.trigger()
        while not burst.complete:
            if timeout_s is not None and self.time_s - begun_s > timeout_s:
                raise SetupError(f"capture: not complete within {timeout_s:g} s")
            self.run(CAPTURE_TURN_S)
        assert burst.tick is not None
        values = burst.values
        units = dict(firmware.channels())
        data = {
            name: np.ascontiguousarray(values[:, column])
            for column, name in enumerate(self._burst_names)
        }
        meta = {
            **self._meta(),
            **metadata(burst.tick, burst.pre, burst.prescaler, 1 / self.period_s),
        }
        rate_Hz = 1 / (self.period_s * burst.prescaler)
        units = {name: units[name] for name in self._burst_names}
        return Recording(rate_Hz, data, units, meta, -burst.pre / rate_Hz)

    def take(self) -> Recording:
        """Return the samples recorded since the last `take`, `discard` or unrecorded run:
        `samples_per_period` a control period. Channels `plant.…` are true values, the others are
        the firmware's, and keep their value until the next control period. The recording gets the
        memory that the simulation has filled; its channels are made when they are asked for."""
        per = self.samples_per_period
        plant, telemetry = self._plant.hand_over(), self._channels.hand_over()
        samples = len(plant)
        units: dict[str, str] = {}
        data: dict[str, Later] = {}
        phases = Product(INVERSE.astype(np.float32), plant[:, :4])
        for row, phase in enumerate(PHASES):
            data[f"plant.i_{phase}_A"] = RowOf(0, samples, phases, row)
            units[f"plant.i_{phase}_A"] = "A"
        for column, (name, unit) in enumerate(PLANT_CHANNELS):
            data[f"plant.{name}"] = Held(0, samples, plant[:, column])
            units[f"plant.{name}"] = unit
        for column, (name, unit) in enumerate(firmware.channels()):
            data[name] = Held(0, samples, telemetry[:, column], per)
            units[name] = unit
        periods = self.periods - self._record_start
        jumps = int(self._all_transitions.sum()) - self._transitions
        meta = {
            **self._meta(),
            "samples_per_period": per,
            # Mean switching frequency of a switch: two transitions per cycle, six legs.
            "f_sw_Hz": jumps / (12 * periods * self.period_s) if periods else None,
        }
        if self.controller.get("control_mode") == "speed":
            meta[SPEED_REFERENCE] = [list(one) for one in self._speed_refs]
        start = self._begun_s + (self._record_start - self._begun) * self.period_s
        self.discard()
        return Recording(per / self.period_s, Channels(data), units, meta, start)

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
