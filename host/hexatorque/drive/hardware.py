"""The hardware around a simulated drive's firmware, in compiled code: machine, inverter, load,
sensors, and their time."""

from __future__ import annotations

import math

import numpy as np

from .. import firmware
from ..plant import breaks, machines
from ..plant.edges import EdgeLog, Edges
from ..plant.gates import gates_record
from ..plant.heat import STEP_S, Bodies
from ..plant.junctions import Junctions
from ..plant.legs import KINDS, MAX_BREAKS
from ..plant.link import V
from ..plant.load import set_load
from ..plant.load_kinds import LOADS
from ..plant.loop import (
    BRAKE_CHANNELS,
    DEVICE_CHANNELS,
    HEAT_CHANNELS,
    LINK_CHANNELS,
    MAX_STEP_S,
    NO_INSTANTS,
    Chip,
    Plant,
    Samples,
    run_periods,
    sample_instants,
)
from ..plant.pwm import NEVER, pwm_record
from ..plant.sensors import THERMISTORS, thermistor_ohm, thermistor_share
from ..plant.vsd import PHASES
from ..setups import KEYS, Setup, SetupError
from ..setups.keys import PROFILE
from . import parts
from .compiling import told
from .entry_point import EntryPoint
from .interface import finite
from .samples import NOTHING

#: Period register (two words) of CPU timer 0, which raises the slow interrupt.
TIMER_PERIOD = firmware.lib.HT_NUMBER_SLOW_PERIOD
RESET_TICKS = 0x10000  # the timer's period after a reset of the chip
#: Longest step, relative to the machine's shortest time constant. The integrator is then far
#: from its limit of stability, and the error of a step is 1e-7. For the papers' machines this
#: allows more than twice 100 us.
STEP_SHARE = 0.1
#: Of the inverter: its commutations.
SWITCHING = ("e_on_mJ", "e_off_mJ", "e_ref_V", "e_ref_A")


class Hardware:
    """The advantage of a simulated drive over a board: access to its machine, inverter, load and
    sensors.

    load_Nm, vdc_V: torque of the load and voltage of the dc link now, or of the link's source if
    there is `inverter.link_F`; link_V: true voltage of the link; period_s: control period;
    periods: how many have passed; plant_state: (8,) the machine's state as its model has it, [6] is
    the speed of the shaft in rad/s; machine: the model's parameters; sensors, inverter: numpy
    records of the plant's, which may be changed between two runs.
    """

    def __init__(
        self, setup: Setup, controller: firmware.Controller, samples_per_period: int
    ) -> None:
        self.setup = setup
        self.controller = controller
        counts, clock_Hz = self.controller.period_counts, float(self.controller.map.pwm_clock_Hz)
        self.period_s = counts / clock_Hz
        if samples_per_period not in range(1, counts + 1):
            raise SetupError(
                f"samples_per_period = {samples_per_period}: allowed range is 1 .. {counts}"
            )
        self.samples_per_period = samples_per_period
        model = machines.model(setup["machine.model"])
        self.machine = model.Parameters(**setup.plant_values())
        self._machine = model.make(self.machine)
        heat = {key: setup[f"heat.{key}"] for key in KEYS["heat"]}
        self.inverter = parts.inverter(
            setup, self.machine.phase_of_leg, self._machine, self.controller.port
        )
        #: Temperatures of the machine, if the set-up has `heat.winding_K_W`.
        self.bodies = Bodies(heat, self.machine, model.make, self._machine, self.inverter)
        self._unheated = 0  # periods whose losses have not reached the bodies yet
        self._swing_per_s = parts.swing_per_s(setup, self._machine, setup.parameter("flux_ref_Wb"))
        self._friction_Nms = parts.friction_Nms(setup)
        self._windings_step_s = min(MAX_STEP_S, STEP_SHARE / model.fastest_per_s(self._machine))
        self._timing = parts.timing(setup, self.controller, self._windings_step_s)
        self._instants = sample_instants(samples_per_period, counts)
        self.plant_state = model.initial(self._machine)
        energies = {key: setup[f"inverter.{key}"] for key in SWITCHING}
        #: Temperatures of the devices, if the set-up has `heat.switch_K_W` or `diode_K_W`.
        self.junctions = Junctions(heat, self.inverter, energies)
        self.inverter.more = bool(self._more_channels())
        self._pwm = pwm_record()
        self._gates = gates_record(round(setup["inverter.min_pulse_us"] * 1e-6 * clock_Hz))
        board = self.controller.port.board
        self._map = parts.pwm_map(self.controller.map, board.gates_active_low, board.min_pulse_us)
        #: The sensors' constants and state. They may be changed between two runs.
        self.sensors = parts.sensors(setup, self.controller, self.period_s)
        self._thermistors = dict.fromkeys(THERMISTORS, "none")
        self._registers = self.controller.register_words()
        tbprd = self.controller.port.leg[0] + self.controller.map.tbprd
        self._timer_words = np.array([tbprd, TIMER_PERIOD, TIMER_PERIOD + 1])
        self._timers_followed = b""
        self.load_Nm = self._load_set_Nm = 0.0
        self._load_kind = LOADS.index(setup["load.kind"])
        self._load = parts.load(setup, self._machine, self.inverter, self.controller.port)
        self.vdc_V = setup["inverter.vdc_V"]
        self.periods = 0
        self._begun, self._begun_s = 0, 0.0  # periods and time when the rate last changed
        self._entries = tuple(
            EntryPoint(firmware.address(name), arguments)
            for name, arguments in zip(self.controller.entries, (1, 1, 2))
        )
        self._edges = EdgeLog(self.inverter)
        # Compile now, or load from the cache, so that this does not count as simulation time.
        with told():
            self._advance(0, NOTHING, NOTHING)

    @property
    def timers_written(self) -> bool:
        """Whether the firmware has written something new to its timers."""
        return bool(self._registers[self._timer_words].tobytes() != self._timers_followed)

    def _adopt_timers(self) -> bool:
        """Adopt the periods that the firmware has written to its timers. Returns whether one has
        changed."""
        m, words, timing = self.controller.map, self._registers, self._timing
        if not self.timers_written:
            return False
        self._timers_followed = words[self._timer_words].tobytes()
        counts = int(words[self.controller.port.leg[0] + m.tbprd]) + 1
        ticks = int(words[TIMER_PERIOD]) + (int(words[TIMER_PERIOD + 1]) << 16) + 1
        if ticks == RESET_TICKS:
            # Firmware on another processor does not report this register: its rate stays.
            slow_every = round(timing.slow_every * timing.period / counts)
        else:
            slow_every = round(ticks / float(m.system_clock_Hz) * float(m.pwm_clock_Hz) / counts)
        if (counts, slow_every) == (timing.period, timing.slow_every):
            return False
        self._begun_s, self._begun = self.time_s, self.periods
        self.period_s = counts / float(m.pwm_clock_Hz)
        breaks.new_period(self.inverter.coming, self.periods, timing, counts)
        timing.slow_every = slow_every
        timing.write_count = min(timing.write_count, counts - 1)
        timing.sample_count = min(timing.sample_count, timing.write_count)
        self.sensors.system_clocks = self.period_s * float(m.system_clock_Hz)
        return True

    @property
    def time_s(self) -> float:
        """Simulated seconds since the drive was made."""
        return self._begun_s + (self.periods - self._begun) * self.period_s

    def _time_of_tick(self, tick: int) -> float:
        # The firmware counts from 1, at the beginning of a period.
        return self._begun_s + (tick - 1 - self._begun) * self.period_s

    @property
    def speed_rpm(self) -> float:
        """True speed of the machine, in r/min."""
        return self.plant_state[6] * 30 / math.pi

    @property
    def brake(self) -> np.record:
        """State of the holding brake, a record of plant.brake."""
        return self._load.brake

    @property
    def link_V(self) -> float:
        """True voltage of the dc link."""
        link = self.inverter.link
        return float(link.x[V]) if link.on else self.vdc_V

    def _more_channels(self) -> list[str]:
        """Which of `loop.MORE_CHANNELS` a recording has."""
        link = self.inverter.link
        groups = (
            (LINK_CHANNELS[: 3 if link.line_Hz else 2], link.on),
            (HEAT_CHANNELS, self.bodies.on),
            (DEVICE_CHANNELS, self.junctions.on),
            (BRAKE_CHANNELS, self.setup["load.holding_Nm"] > 0),
        )
        return [name for group, on in groups if on for name, _ in group]

    def _advance(self, n: int, plant: np.ndarray, channels: np.ndarray) -> None:
        """Compute n periods, into rows for samples of the plant and for the firmware's channels.
        Both may be empty."""
        if not (self.bodies.on or self.junctions.on):
            self._compute(0, n, plant, channels)
            return
        done = 0
        whole = max(1, round(STEP_S / self.period_s))
        while done < n:
            part = min(n - done, whole - self._unheated)
            rows = slice(done * self.samples_per_period, (done + part) * self.samples_per_period)
            self._compute(done, part, plant[rows], channels[done : done + part])
            done += part
            self._unheated += part
            if self._unheated >= whole:
                for followed in (self.bodies, self.junctions):
                    if followed.on:
                        followed.advance(self._unheated * self.period_s)
                self._unheated = 0

    def _compute(self, first: int, n: int, plant: np.ndarray, channels: np.ndarray) -> None:
        """The same from the period `first` of a call on."""
        self._warm_thermistors()
        load = self._load
        if self.load_Nm != self._load_set_Nm:
            set_load(load, self._load_kind, self.load_Nm, self.setup["load.at_rpm"])
            self._load_set_Nm = self.load_Nm
        shaft_step_s = parts.shaft_step_s(
            self.setup, load, self.load_Nm, self._friction_Nms, self._swing_per_s
        )
        longest_s = min(self._windings_step_s, shaft_step_s)
        self._timing.max_step = max(1, int(longest_s * self._timing.clock_Hz))
        instants = self._instants if len(plant) else NO_INSTANTS
        self._edges.kept = run_periods(
            n,
            self.periods + first,
            self._timing,
            Plant(self._machine, load, self.inverter, self.sensors, self.plant_state),
            self.vdc_V,
            Chip(self._map, self._pwm, self._gates, self._registers, self.controller.handle),
            *self._entries,
            Samples(instants, plant, channels.ctypes.data, channels, self._edges.rows),
            self._edges.kept,
        )  # fmt: skip

    def _warm_thermistors(self) -> None:
        """The inputs of the thermistors show their temperatures. The winding's lies on u1."""
        degC = self.bodies.winding_degC[0], self.junctions.sink_degC
        value, broken = self.setup.__getitem__, self._thermistors
        for k, place in enumerate(THERMISTORS if self.sensors.slow else ()):
            ohm = thermistor_ohm(
                value(f"sensors.{place}_ntc_ohm"), value(f"sensors.{place}_ntc_K"), degC[k]
            )
            if broken[place] == "stuck":
                continue
            ohm = {"open": math.inf, "short": 0.0}.get(broken[place], ohm)
            share = thermistor_share(ohm, value("sensors.ntc_pull_up_ohm"))
            self.sensors.slow_counts[k] = share * self.sensors.adc_full

    def break_thermistor(self, place: str, kind: str) -> None:
        """Break the thermistor of `winding` or `sink`: `open`, `short`, `stuck` where it stands, or
        `none`: whole again."""
        if place not in THERMISTORS:
            raise SetupError(f"place = {place!r}: choose one of {', '.join(THERMISTORS)}")
        if kind not in ("none", "open", "short", "stuck"):
            raise SetupError(f"kind = {kind!r}: choose one of none, open, short, stuck")
        self._thermistors[place] = kind

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
        if begin_s is None or not 0 <= begin_s <= PROFILE["duration_s"].max:
            longest_s = PROFILE["duration_s"].max
            raise SetupError(f"after_s = {after_s}: a time of 0 to {longest_s:g} s is needed")
        more = breaks.breaks_of(kind, begin_s, 1e-3 * self.setup["inverter.bounce_ms"])
        waiting = self.inverter.coming.n
        if waiting + len(more) > MAX_BREAKS:
            raise SetupError(
                f"break_leg: {waiting} breaks are to come, with {len(more)} more than "
                f"{MAX_BREAKS}, which is the most"
            )
        breaks.add(self.inverter.coming, PHASES.index(phase), more, self.periods, self._timing)

    @property
    def broken(self) -> dict[str, str]:
        """The break in each phase's leg now: phase -> none, open, blocked, upper or lower."""
        return {phase: KINDS[kind] for phase, kind in zip(PHASES, self.inverter.contact.broken)}

    def lose_interrupts(self, lost: bool) -> None:
        """`lost`: from now on the ADC raises no fast interrupt. False: it raises it again."""
        self.controller.registers.lost = int(lost)

    def log_edges(self, capacity: int) -> None:
        """From now on keep every edge of a leg, `capacity` edges at most (0: none)."""
        self._edges = EdgeLog(self.inverter, capacity)

    @property
    def edges(self) -> np.ndarray:
        """The edges that `log_edges` kept, (n, 3): time in counts since the start of the
        simulation, leg, new state that the gate drivers command (`plant.legs`: LOW, HIGH or OFF),
        or what breaks (BREAK + kind)."""
        return self._edges.filled

    def edges_since(self, period: int, start: np.ndarray) -> Edges:
        """The edges of the legs themselves, on the time axis of a recording that began with
        `period`, where the legs' states were `start`, (6,)."""
        begin = period * int(self._timing.period)
        return self._edges.since(begin, float(self._timing.clock_Hz), start)

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

    @property
    def gate_mistake(self) -> str:
        """Commands to the gates so far that could destroy a power stage; empty if
        nothing was."""
        if self.shorts:
            return "both switches of a leg were commanded on"
        if self.short_pulses:
            return f"a gate pulse of {self.shortest_pulse_us:.2g} us"
        return ""
