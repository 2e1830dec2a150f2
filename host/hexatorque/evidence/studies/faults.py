"""Fault campaign: every fault is injected at random instants, in every state of the drive and under
every scheme, and the gates are checked.

After the injection the drive runs on, period by period. It must name the cause, and it must take
the gates off in the interrupt that finds it, within the fault's deadline. From then on every leg
must stay off, whatever is commanded. No leg may ever change from one switch to the other without
the dead time in between.

Three kinds of runs are about the start. A wrong system clock must be found when the board starts.
Stored parameters are damaged at random places: the start must take the saved ones if a whole copy
is left, else the built-in ones, and it must say which. It must never take a wrong value. And where
a debugger starts the image anew while the gates are on, they must go off before anything else.

Two kinds have no fault. The speed reverses, and no gate pulse may be shorter than the power stage
can make; all other runs count such pulses as well. And the page that has started a drive falls
silent: the monitor's dead man must stop the drive, in every state in which its gates may be on. Of
a thermistor that stands still the drive cannot know: it must go on.

Machines with magnets have runs of their own (`magnet_faults`).
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ... import firmware, setups
from ...boards.virtual import BoardController
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...monitor.deadman import DeadMan
from ...plant.legs import OFF
from ...plant.link import V
from ...plant.vsd import PHASES
from ...serial import wire
from ...serial.client import HEARTBEAT_S
from . import auxiliaries, magnet_faults
from .fault_checks import Result, gates_off, shoot_through, sign
from .grids import Grid
from .runs import each

TITLE = "Fault campaign"
SETUPS = ("paper-a-feasible", "paper-b")
#: Runs per fault. They are enough for every state, scheme and set-up.
RUNS = 300
#: The quick campaign makes each QUICK_STEP-th of these runs. The step divides no number of states,
#: schemes or set-ups, so that they all occur.
QUICK_STEP = 13
#: Periods that are checked after the gates are off.
AFTER = 50
#: Rated phase current, r.m.s., of drives that may go on without a leg.
RATED_A = 5.0
#: Deadlines in periods: the next interrupt; faults that show only gradually; two slow periods,
#: whatever their length.
NOW, LATER, TWO_SLOW = 1, 5000, -1
#: Longest time without a fast interrupt until the chip takes the gates off, periods.
DEAD_MAN = 3
#: Longest time without a message of the host until a drive that it started trips, in periods of
#: 0.1 ms.
WATCHDOG = 10 * firmware.lib.HT_SERVICE_WATCHDOG_MS
#: The host's last frames may still be on the line for so many periods: 20 bytes at 921600 baud, and
#: the period in which the background reads them.
ON_THE_LINE = 4
#: All states, the fault last: the run that begins in it is the only one without a new fault.
STATES = (*(name for name in firmware.STATES if name != firmware.FAULT), firmware.FAULT)
POWERED = tuple(state.name for state in firmware.STATE_TABLE if state.controls)
GATES_ON = tuple(state.name for state in firmware.STATE_TABLE if state.gates_on)
CHECKED = tuple(state.name for state in firmware.STATE_TABLE if state.at_work)
#: Index of the encoder among the held sensors.
ENCODER = 7

Inject = Callable[[SimulatedDrive, np.random.Generator], None]


@dataclass(frozen=True)
class Fault:
    """`found_in`: the states in which the fault must be found; in all others the gates are off
    anyway. `causes`: the snapshot must name one of them."""

    name: str
    inject: Inject
    causes: tuple[str, ...]
    found_in: tuple[str, ...] = POWERED
    deadline: int = NOW
    #: Takes the fault away before the clear. Returns what was wrong until then, or "".
    repair: Callable[[SimulatedDrive], str] | None = None
    #: No fast interrupt comes after the injection. The chip must take the gates off by itself in so
    #: many periods; the cause may be told later, by the deadline. 0: the interrupt goes on.
    stands: int = 0
    #: Frequencies of the slow interrupt, drawn at random; empty: the set-up's.
    slow_Hz: tuple[float, ...] = ()
    #: Those whose board can have this fault.
    of_setups: tuple[str, ...] = SETUPS
    drive: type[SimulatedDrive] = SimulatedDrive
    #: What the set-up needs for it.
    changes: Callable[[setups.Setup], dict[str, object]] | None = None
    #: What else must be so once the gates are off. Returns what is wrong, or "".
    also: Callable[[SimulatedDrive], str] | None = None


class HostedDrive(SimulatedDrive):
    """A host at the other end of a serial line opens a session, starts this drive, and then sends
    STATUS again and again, until it is `silent`. The bytes take their time on the line."""

    def __init__(self, setup: setups.Setup, samples_per_period: int) -> None:
        make = partial(BoardController, baud=None, watchdog_ms=WATCHDOG // 10)
        super().__init__(setup, samples_per_period, make)
        self.silent = False
        self._session, self._dictionary, self._requests = 0, 0, 0

    def _send(self, op: wire.Op, payload: bytes = b"") -> None:
        self._requests = (self._requests + 1) % 256
        body = wire.request(op, self._requests, self._session, self._dictionary, payload)
        self._line.put(wire.frame(body))

    def _ask(self, op: wire.Op, payload: bytes = b"") -> bytes:
        """The payload of the reply."""
        splitter = wire.Splitter()
        self._send(op, payload)
        for _ in range(2000):
            super().run(self.period_s, record=False)
            for body in splitter.push(self._line.take()):
                return wire.parse_reply(body).payload
        raise AssertionError(f"no reply to {op.name}")

    @property
    def _line(self) -> BoardController:
        assert isinstance(self.controller, BoardController)
        return self.controller

    def start(self) -> None:
        if not self._session:
            self._dictionary = wire.parse_hello(self._ask(wire.Op.HELLO)).crc
            session = 0x1234
            self._ask(wire.Op.OPEN, wire.open_session(session, session))
            self._session = session
        before = self.state
        self._send(wire.Op.START)
        for _ in range(200):
            super().run(self.period_s, record=False)
            self._line.take()
            if self.state != before:
                return
        raise firmware.FirmwareError("start: the board refuses")

    def run(self, duration_s: float, record: bool = True, progress: Progress | None = None) -> None:
        left, most = round(duration_s / self.period_s), round(HEARTBEAT_S / self.period_s)
        while left:
            if self._session and not self.silent:
                self._beat()
            periods = min(left, most)
            super().run(periods * self.period_s, record, progress)
            self._line.take()
            left -= periods

    def _beat(self) -> None:
        self._send(wire.Op.STATUS)


class PagedDrive(HostedDrive):
    """The host is the monitor. A page has started the drive and answers, until it is
    `page_silent`; the monitor's dead man decides when the drive is stopped."""

    def __init__(self, setup: setups.Setup, samples_per_period: int) -> None:
        super().__init__(setup, samples_per_period)
        self.page_silent = False
        self.dead_man = DeadMan()
        self.reason = ""  #: why the dead man has stopped the drive

    def start(self) -> None:
        super().start()
        self.dead_man.started(self.periods * self.period_s)

    def _beat(self) -> None:
        super()._beat()
        now_s = self.periods * self.period_s
        if not self.page_silent:
            self.dead_man.answered(now_s, visible=True)
        reason = self.dead_man.reason(now_s, self.controller.condition.at_work, pages=True)
        if reason:
            self.reason = reason
            self.dead_man.ended()
            self._send(wire.Op.STOP)


def _over_current(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """A real current in x-y that takes every phase beyond the trip level."""
    amperes = 2.5 * sim.controller.number("i_trip_A")
    sim.plant_state[2] += sign(rng) * amperes * sim.machine.lxy_H


def _alpha_beta_current(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """The stator flux is moved away from the rotor flux. The current exceeds `i_ab_trip_A`, but no
    phase exceeds its own trip level."""
    m, trip_A = sim.machine, sim.controller.number("i_ab_trip_A")
    angle = rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])
    sim.plant_state[:4] = 0.0
    sim.plant_state[:2] = (
        sim.plant_state[4:6] * m.lm_H / m.lr_H + 1.03 * trip_A * m.sigma_ls_H * direction
    )


def _vdc(level: str, factor: float) -> Inject:
    def inject(sim: SimulatedDrive, rng: np.random.Generator) -> None:
        sim.set("vdc_V", factor * sim.controller.number(level))

    return inject


def _over_speed(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """The load drives the shaft, with 1000 rad/s2 more than the drive can hold."""
    torque_Nm = sim.controller.number("torque_limit_Nm") + 1000 * sim.machine.inertia_kgm2
    forward = sim.plant_state[6] > 0 if abs(sim.plant_state[6]) > 1 else sign(rng) > 0
    sim.set("load_Nm", -torque_Nm if forward else torque_Nm)


def _hold(*sensors: int) -> Inject:
    def inject(sim: SimulatedDrive, rng: np.random.Generator) -> None:
        # The sensor of a phase without current stands still anyway.
        off = sim.controller.drive.off_legs
        used = [sensor for sensor in sensors if not off & 32 >> sensor]
        sim.sensors.hold[int(rng.choice(used))] = 1

    return inject


def _railed(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """A current sensor's output goes to one end of the converter's range."""
    sim.sensors.i_offset_counts[rng.integers(6)] += sign(rng) * 1e4


def _offset(share: float) -> Inject:
    """A sensor's zero jumps by a share of `i_sum_trip_A`."""

    def inject(sim: SimulatedDrive, rng: np.random.Generator) -> None:
        counts = share * sim.controller.number("i_sum_trip_A") / sim.controller.drive.i_per_count
        sim.sensors.i_offset_counts[rng.integers(6)] += sign(rng) * counts

    return inject


def _upset(*values: float) -> Inject:
    """One value in the observer's memory changes."""

    def inject(sim: SimulatedDrive, rng: np.random.Generator) -> None:
        value = float(rng.choice(values))
        if np.isfinite(value):
            value *= sim.controller.number("flux_trip_Wb")
        setattr(sim.controller.drive.control.observer.psi_Wb, rng.choice(["alpha", "beta"]), value)

    return inject


def _trip_pin(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """The pin goes low and high again."""
    sim.controller.set_trip_pin(0)
    sim.controller.set_trip_pin(1)


def _trip_pin_held(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    sim.controller.set_trip_pin(0)


def _release_the_trip_pin(sim: SimulatedDrive) -> str:
    """While the pin is low, a start and a clear must be refused in every state, with the reason.
    Then the pin goes high."""
    for command in (sim.start, sim.clear):
        before = sim.state
        try:
            command()
        except firmware.FirmwareError as error:
            if "the trip pin is low" not in str(error):
                return f"{command.__name__} under a low trip pin says: {error}"
        else:
            return f"{command.__name__} was accepted under a low trip pin"
        sim.run(sim.period_s, record=False)
        if sim.state != before or not gates_off(sim):
            return f"{command.__name__} under a low trip pin changed something"
    sim.controller.set_trip_pin(1)
    return ""


def _between_samples(channels: range, ends_V: tuple[float, ...]) -> Inject:
    """The output of a sensor that a comparator watches is at one end of its range for 1 us."""

    def inject(sim: SimulatedDrive, rng: np.random.Generator) -> None:
        board, registers = sim.controller.port.board, sim.controller.registers
        all_of = [firmware.lib.ht_board_cmpss(board, k) for k in channels]
        number = int(rng.choice([number for number in all_of if number]))
        for volts in (float(rng.choice(ends_V)), 1.5):
            firmware.lib.ht_regfile_analog(registers, number, volts, 1000)

    return inject


def _silence(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    assert isinstance(sim, HostedDrive)
    sim.silent = True


def _overrun(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """The next event comes while the interrupt is still running. The interrupt's first register
    access acknowledges the event before."""
    registers = sim.controller.registers
    registers.event_at = registers.accesses + int(rng.integers(2, 10))


def _lost_interrupt(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    sim.lose_interrupts(True)


def _interrupts_again(sim: SimulatedDrive) -> str:
    sim.lose_interrupts(False)
    sim.run(sim.period_s, record=False)  # one fast interrupt, before the next slow interrupt checks
    return ""


def _bad_offset(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """From the beginning of the calibration on, the offset is larger than the calibration
    accepts."""
    with contextlib.suppress(firmware.FirmwareError):
        sim.stop()
        sim.start()
    sim.sensors.i_offset_counts[rng.integers(6)] += sign(rng) * 250


def _chopper_stays_on(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """Until the resistor's thermal switch opens the trip chain."""
    auxiliaries.chopper_stays_on(sim)
    _trip_pin_held(sim, rng)


def _trip_pin_under_load(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """A holding brake is open in RUN."""
    assert auxiliaries.told_open(sim) == (sim.controller.state == firmware.RUN)
    _trip_pin(sim, rng)


class _Names:
    """The firmware's text for a fault, by the name that it has in ht_faults.def."""

    def __getattr__(self, name: str) -> str:
        return firmware.FAULTS[getattr(firmware.lib, f"HT_FAULT_{name}")]


FOUND = _Names()
OVERCURRENT, OVERSPEED = FOUND.OVERCURRENT, FOUND.OVERSPEED
SUM, FLUX = FOUND.CURRENT_SUM, FOUND.FLUX
FAULTS = (
    Fault("over-current in a phase", _over_current, (OVERCURRENT,), CHECKED),
    Fault("over-current in α–β", _alpha_beta_current, (OVERCURRENT,)),
    Fault("dc link too high", _vdc("vdc_max_V", 1.02), (FOUND.VDC_HIGH,), CHECKED),
    Fault("dc link too low", _vdc("vdc_min_V", 0.98), (FOUND.VDC_LOW,), CHECKED),
    Fault(OVERSPEED, _over_speed, (OVERSPEED,), (firmware.RUN,), LATER),
    Fault(
        "encoder lost",
        _hold(ENCODER),
        (FOUND.ENCODER,),
        (firmware.RUN,),
        LATER,
    ),
    Fault(
        FOUND.STUCK,
        _hold(0, 1, 2, 3, 4, 5),
        (FOUND.STUCK, SUM, FLUX),
        (firmware.RUN,),
        LATER,
    ),
    Fault("current sensor at its limit", _railed, (OVERCURRENT,), CHECKED),
    Fault("current sensor off its zero", _offset(1.5), (SUM,)),
    Fault(
        "current sensor off its zero from the start",
        _bad_offset,
        (FOUND.CALIBRATION,),
        (firmware.CALIBRATE,),
        LATER,
    ),
    Fault(FOUND.NONFINITE, _upset(np.nan, np.inf, -np.inf), (FOUND.NONFINITE,)),
    Fault("flux out of bounds", _upset(2.0, -2.0), (FLUX,)),
    Fault("trip pin", _trip_pin, (FOUND.EXTERNAL,), GATES_ON),
    Fault(
        "interrupt outlasts its period",
        _overrun,
        (FOUND.OVERRUN,),
        GATES_ON,
    ),
    Fault(
        "trip pin held low",
        _trip_pin_held,
        (FOUND.EXTERNAL,),
        CHECKED,
        repair=_release_the_trip_pin,
    ),
    Fault(
        "ADC's interrupt lost",
        _lost_interrupt,
        (FOUND.INTERRUPT,),
        STATES[:-1],
        TWO_SLOW,
        repair=_interrupts_again,
        stands=DEAD_MAN,
        slow_Hz=(10.0, 50.0, 100.0, 250.0, 1000.0),
    ),
    Fault(
        "over-current between two samples",
        _between_samples(range(len(PHASES)), (0.0, 3.0)),
        (OVERCURRENT,),
        GATES_ON,
        of_setups=("paper-b",),
    ),
    Fault(
        "host silent", _silence, (FOUND.LINK,), CHECKED, WATCHDOG + ON_THE_LINE, drive=HostedDrive
    ),
    Fault(
        "over-voltage between two samples",
        _between_samples(range(firmware.lib.HT_ADC_VDC, firmware.lib.HT_ADC_CHANNELS), (3.3,)),
        (FOUND.VDC_HIGH,),
        GATES_ON,
        of_setups=("paper-b",),
    ),
    *(
        Fault(
            cause,
            partial(auxiliaries.break_thermistor, place, kind),
            (cause,),
            CHECKED,
            LATER,
            repair=partial(auxiliaries.mend_thermistor, place),
            changes=auxiliaries.thermistors,
        )
        for place in auxiliaries.PLACES
        for kind in auxiliaries.KINDS
        for cause in (auxiliaries.broken(place, kind),)
    ),
    Fault(
        "thermistor stuck at too hot a value",
        auxiliaries.stuck_hot,
        auxiliaries.HOT,
        CHECKED,
        LATER,
        repair=auxiliaries.cool,
        changes=auxiliaries.thermistors,
    ),
    Fault(
        "chopper never comes on",
        auxiliaries.brake_without_chopper,
        (FOUND.VDC_HIGH,),
        (firmware.RUN,),
        2 * LATER,
        repair=auxiliaries.mend_chopper,
        changes=auxiliaries.chopper,
    ),
    Fault(
        "chopper stays on, until its resistor's thermal switch opens",
        _chopper_stays_on,
        (FOUND.EXTERNAL,),
        CHECKED,
        repair=_release_the_trip_pin,
        changes=auxiliaries.chopper,
        also=auxiliaries.chopper_told_off,
    ),
    Fault(
        "trip pin, with a holding brake",
        _trip_pin_under_load,
        (FOUND.EXTERNAL,),
        GATES_ON,
        changes=auxiliaries.brake,
        also=auxiliaries.brake_told_closed,
    ),
)


def _without(seed: int) -> dict[str, object]:
    """Going on without a leg must hide no fault. A third of the drives may do so; another third
    does from the start on."""
    mode = seed // 7 % 3
    if mode == 0:
        return {}
    ride = {"controller__ride_through": "least-loss", "controller__i_rated_A": RATED_A}
    if mode == 1:
        return ride
    return ride | {"controller__lost_legs": 1 << seed % 6, "timing__latency": "predicted"}


def _setup(
    name: str, scheme: str, rng: np.random.Generator, seed: int, fault: Fault | None = None
) -> setups.Setup:
    base = setups.load(name)
    trip_A = base.parameter("i_trip_A")
    latency = str(rng.choice(setups.LATENCIES))
    changes: dict[str, object] = {
        "controller__scheme": scheme,
        "controller__calibration_s": 0.004,
        "controller__speed_trip_rpm": 1500.0,
        # Above any flux current that occurs here, and below the trip level of the phases.
        "controller__i_ab_trip_A": 0.95 * trip_A,
        "timing__latency": "predicted" if firmware.needs_prediction(scheme) else latency,
        "load__kind": "constant",
    }
    if fault and fault.slow_Hz:
        changes["controller__f_slow_Hz"] = float(rng.choice(fault.slow_Hz))
    if fault and fault.changes:
        changes |= fault.changes(base)
    return base.changed(**(changes | _without(seed)))


def _bring_to(sim: SimulatedDrive, state: str, rng: np.random.Generator) -> None:
    """Bring the drive to a random instant within `state`; in `run` to a random speed and load."""
    sim.run(sim.period_s * int(rng.integers(1, 50)), record=False)
    if state == firmware.IDLE:
        return
    if state == firmware.TEST:
        _test(sim, rng)
        return
    sim.start()
    ticks = {firmware.CALIBRATE: (1, 39), firmware.BUILD: (43, 3035)}.get(state)
    if ticks:
        sim.run(sim.period_s * int(rng.integers(*ticks)), record=False)
        return
    sim.run(0.31, record=False)
    # The speed is so high that a lost encoder has an effect.
    direction = sign(rng)
    sim.set("speed_ref_rpm", direction * float(rng.uniform(400, 900)))
    sim.run(float(rng.uniform(0.2, 0.4)), record=False)
    limit_Nm = sim.controller.number("torque_limit_Nm")
    sim.set("load_Nm", direction * float(rng.uniform(-0.5, 0.5)) * limit_Nm)
    sim.run(float(rng.uniform(0.0, 0.2)), record=False)
    if state == firmware.FAULT:
        sim.set("vdc_V", 0.4 * sim.vdc_V)
        sim.inverter.link.x[V] = sim.vdc_V  # of a capacitor
        sim.run(0.01, record=False)
        sim.set("vdc_V", sim.setup["inverter.vdc_V"])


def _test(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """Some voltages in the state test, too small for its limits."""
    sim.set_many({"start_mode": "test", "test_current_A": sim.controller.number("i_trip_A")})
    sim.start()
    sim.run(0.006, record=False)
    volts = 0.01 * sim.vdc_V
    for name in ("test_alpha_V", "test_beta_V", "test_x_V", "test_y_V"):
        sim.set(name, float(rng.uniform(-volts, volts)))
    waves = sim.params["test_wave"].choices
    wave = {"test_wave": str(rng.choice(waves)), "test_Hz": float(rng.uniform(5, 500))}
    sim.set_many(wave)
    sim.run(sim.period_s * int(rng.integers(1, 200)), record=False)


def _disturb(sim: SimulatedDrive, rng: np.random.Generator) -> None:
    """Commands that a user may try while a fault is latched."""
    with contextlib.suppress(firmware.FirmwareError):
        sim.start()
    sim.set("speed_ref_rpm", float(rng.uniform(-500, 500)))


def run(fault: Fault, state: str, scheme: str, setup: str, seed: int) -> Result:
    """Injects one fault into one drive."""
    rng = np.random.default_rng(seed)
    result = Result(fault.name, state, scheme, setup)
    sim = fault.drive(_setup(setup, scheme, rng, seed, fault), 1)
    _bring_to(sim, state, rng)
    if sim.controller.state != state:
        result.error = f"{sim.controller.state} instead of {state} before the injection"
        return result
    sim.log_edges(500_000)
    legs = np.array(sim.inverter.leg)
    injected = sim.periods
    fault.inject(sim, rng)
    must_trip = state in fault.found_in
    # Of a trip one leg is looked at in each period; of a leg that is off already it tells nothing.
    late = 1 if sim.controller.drive.off_legs else 0
    deadline = fault.deadline
    if deadline == TWO_SLOW:
        deadline = 2 * sim.controller.fast_per_slow
    limit = deadline + late if must_trip else AFTER
    off = 0
    while sim.periods - injected < limit:
        sim.run(sim.period_s, record=False)
        if not off and gates_off(sim):
            off = sim.periods - injected
        if sim.controller.state == firmware.FAULT and state != firmware.FAULT:
            break
    if must_trip:
        result.error = _latched(sim, fault, deadline, injected, off, result)
    elif state not in CHECKED and (sim.controller.condition.at_work or not gates_off(sim)):
        result.error = f"gates on in {sim.controller.state}"
    latched = not sim.controller.condition.at_work
    result.error = result.error or shoot_through(sim, legs)
    if latched and not result.error:
        result.error = _stays_off(sim, rng, fault)
    if sim.controller.registers.violations and not result.error:
        result.error = "forbidden register access"
    return result


def _latched(
    sim: SimulatedDrive, fault: Fault, deadline: int, injected: int, off: int, result: Result
) -> str:
    """The fault must be found, named and recorded, and the gates must be off, after `off` periods.
    Returns what is wrong."""
    if sim.controller.state != firmware.FAULT:
        return f"not found within {deadline} periods"
    snapshot = sim.controller.snapshot
    assert snapshot  # the state `fault` always has one
    result.cause = ", ".join(snapshot["faults"])
    # Before a start the gates are off at once. Until the fault is found takes longer.
    result.periods = off if fault.stands else sim.periods - injected
    if not gates_off(sim):
        return "gates on in fault"
    if fault.stands and off > fault.stands:
        return f"gates on for {off} periods without an interrupt"
    if not set(snapshot["faults"]) & set(fault.causes):
        return f"named {result.cause}"
    if snapshot["tick"] != (injected if fault.stands else sim.periods):
        return "the snapshot is of another interrupt"
    if fault.deadline == NOW and snapshot["state"] != result.state:
        return f"the snapshot says {snapshot['state']}"
    return (fault.also(sim) if fault.also else "") or _logged(sim)


#: Turns of the background in which a log is read and all that waits is written; words of a slot;
#: where an event has the faults.
LOG_TURNS, LOG_WORDS, LOG_FAULTS = 300, 32, 8


def _logged(sim: SimulatedDrive) -> str:
    """After a power-off the log must name the fault and the state. Returns what is wrong."""
    lib, drive = firmware.lib, sim.controller.drive
    before = firmware.MemoryStore()
    after = firmware.MemoryStore(before.areas)
    for store in (before, after):
        lib.ht_log_start(store.log, firmware.ffi.NULL)
        for _ in range(LOG_TURNS):
            lib.ht_log_turn(store.log, drive, True)
    words = firmware.ffi.new("uint16_t[]", LOG_WORDS)
    # The latest are the second start and what it found latched.
    if lib.ht_log_row(after.log, drive, 2, words) != lib.HT_OK:
        return "the log has lost the trip"
    event, state = words[0] & 0xFF, words[0] >> 8
    faults = words[LOG_FAULTS] | words[LOG_FAULTS + 1] << 16
    if (event, state, faults) != (
        lib.HT_EVENT_TRIP, drive.snapshot.state, drive.snapshot.faults,
    ):  # fmt: skip
        return f"the log says {', '.join(firmware.causes(faults))} in {firmware.STATES[state]}"
    return ""


def _stays_off(sim: SimulatedDrive, rng: np.random.Generator, fault: Fault) -> str:
    """While the fault is latched, no leg may come on, whatever is commanded. A clear alone may
    not turn a leg on either. The legs follow the trip flags in the next period. Returns what is
    wrong."""
    if sim.controller.state == firmware.IDLE:
        return fault.repair(sim) if fault.repair else ""
    sim.run(sim.period_s, record=False)
    sim.log_edges(10_000)
    for n in range(AFTER):
        if n % 10 == 5:
            _disturb(sim, rng)
        sim.run(sim.period_s, record=False)
        if not gates_off(sim) or any(state != OFF for state in sim.inverter.leg):
            return "a gate came on after the latch"
    if len(sim.edges):
        return "a leg changed after the latch"
    error = fault.repair(sim) if fault.repair else ""
    if error:
        return error
    turning = abs(sim.controller.drive.speed_rpm) > sim.controller.number("start_max_rpm")
    sim.clear()
    sim.run(5 * sim.period_s, record=False)
    if sim.controller.state != firmware.IDLE or not gates_off(sim):
        return "a clear turned gates on"
    return _restart(sim) if turning else ""


def _restart(sim: SimulatedDrive) -> str:
    """A start into the turning machine is refused, or catches it, unless what was injected trips
    the drive again. With a dead encoder and no current, the drive cannot know that the machine
    turns. It must then find this from the flux that it builds. No current may come near the trip
    level. Returns what is wrong."""
    try:
        sim.start()
    except firmware.FirmwareError:
        return ""
    dead = bool(sim.sensors.hold[ENCODER])
    sim.set("load_Nm", 0.0)  # it could drive the shaft beyond its speed meanwhile
    sim.log_edges(0)
    sim.run(2 * LATER * sim.period_s)
    rec = sim.take()
    peak_A = float(np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).max())
    if peak_A > 0.8 * sim.controller.number("i_trip_A"):
        how = "without encoder" if dead else "into a turning machine"
        return f"{peak_A:.1f} A after a start {how}"
    turns = abs(sim.speed_rpm) > sim.controller.number("encoder_trip_rpm")
    if dead and turns and sim.controller.state != firmware.FAULT:
        return f"{sim.speed_rpm:.0f} r/min after a start without encoder, no fault"
    return ""


#: Where the currents of a lost interrupt are measured: 10 N m on the machine of paper A.
LOST_AT_RPM, LOST_AT_LOAD = 900.0, 2 / 3
#: Where the fast interrupt puts eCAP1's counter, clocks: HT_DEAD_MAN_PULSE.
DEAD_MAN_PULSE = 100


def _without_interrupts_A(
    setup: setups.Setup, instants: int, after: Callable[[SimulatedDrive], None]
) -> float:
    """The largest phase current after the fast interrupt has been lost at LOST_AT_RPM, with
    LOST_AT_LOAD of the torque limit, A: the worst of so many instants of an electrical period.
    `after` lets the time pass."""
    peak_A = 0.0
    for n in range(instants):
        sim = SimulatedDrive(setup.changed(load__kind="constant"), 20)
        sim.start()
        sim.run(0.35, record=False)
        sim.set("speed_ref_rpm", LOST_AT_RPM)
        sim.run(0.6, record=False)
        sim.set("load_Nm", LOST_AT_LOAD * sim.controller.number("torque_limit_Nm"))
        electrical_s = 60.0 / (sim.machine.pole_pairs * LOST_AT_RPM)
        sim.run(0.5 + n / instants * electrical_s, record=False)
        sim.check()
        sim.lose_interrupts(True)
        after(sim)
        rec = sim.take()
        peak_A = max(peak_A, *(float(np.abs(rec[f"plant.i_{p}_A"]).max()) for p in PHASES))
    return peak_A


def lost_interrupt_A(setup: str, scheme: str, slow_Hz: float, instants: int = 6) -> float:
    """Until the dead-man timer takes the gates off."""
    base = setups.load(setup).with_scheme(scheme).changed(controller__f_slow_Hz=slow_Hz)
    return _without_interrupts_A(base, instants, lambda sim: sim.run(0.05))


def watchdog_s(sim: SimulatedDrive, slow_Hz: float) -> float:
    """From the last key to the reset, as `ht_watchdog_start` sets it: the shortest time beyond 2.5
    slow periods."""
    time_s = 256.0 / sim.controller.map.watchdog_Hz
    while time_s * slow_Hz < 2.5:
        time_s *= 2.0
    return time_s


def hung_A(setup: str, instants: int = 6) -> float:
    """Until the watchdog makes a reset at the set-up's `f_slow_Hz`: the processor hangs, and the
    dead-man timer does not act either. The slow interrupt is put so far apart that it does not
    come."""
    base = setups.load(setup)
    slow_Hz = base.parameter("f_slow_Hz")

    def hang(sim: SimulatedDrive) -> None:
        ecap, words = sim.controller.map.ecap, sim.controller.register_words()
        for _ in range(round(watchdog_s(sim, slow_Hz) / sim.period_s)):
            sim.run(sim.period_s)
            sim.controller.registers.timer1 = 0
            if ecap:
                words[ecap : ecap + 2] = DEAD_MAN_PULSE, 0

    return _without_interrupts_A(base.changed(controller__f_slow_Hz=10.0), instants, hang)


#: A fault that the start must find. Its runs are not simulations.
DAMAGED_SET = "damaged parameter set"


def _some_set(controller: firmware.Controller, rng: np.random.Generator) -> None:
    """Set parameters that differ from the built-in ones, as far as they fit together."""
    rows = list(firmware.parameters().values())
    for k in rng.permutation(len(rows))[:20]:
        row = rows[int(k)]
        value: str | float
        if row.choices:
            value = row.choices[int(rng.integers(len(row.choices)))]
        else:
            value = min(max(row.initial * float(rng.uniform(0.8, 1.2)), row.min), row.max)
        with contextlib.suppress(firmware.FirmwareError):
            controller.set(row.name, value)
    controller.set_many(
        {
            row.name: row.show(row.initial)
            for number, row in enumerate(rows)
            if firmware.lib.ht_store_is_command(number)
        }
    )


def _damage(areas: bytearray, rng: np.random.Generator) -> None:
    """Damage bits, bytes, blocks or a whole copy, in one of the copies or in both. The damage may
    hit bytes that are used, or miss them."""
    used = 16 * (2 + -(-len(firmware.parameters()) // 4))
    for copy in rng.permutation(2)[: int(rng.integers(1, 3))]:
        begin = int(copy) * firmware.MemoryStore.AREA
        for _ in range(int(rng.integers(1, 4))):
            at = begin + int(rng.integers(used))
            what = int(rng.integers(5))
            if what == 0:
                areas[at] ^= 1 << int(rng.integers(8))
            elif what == 1:
                areas[at] = int(rng.integers(256))
            elif what == 2:  # a torn block
                block = at - at % firmware.MemoryStore.BLOCK
                areas[block : block + 16] = rng.bytes(16)
            elif what == 3:  # from here on the copy was never written, or was erased
                areas[at : begin + used] = b"\xff" * (begin + used - at)
            else:
                areas[begin : begin + used] = rng.bytes(used)


def damaged_set(device: str, seed: int) -> Result:
    """Damages one store, and checks the start after it."""
    rng = np.random.default_rng(seed)
    result = Result(DAMAGED_SET, "start", "", device)
    names = list(firmware.parameters())
    store = firmware.MemoryStore()
    before = firmware.Controller(device, {}, store=store)
    built_in = [before.get(name) for name in names]
    _some_set(before, rng)
    saved = [before.get(name) for name in names]
    firmware.lib.ht_store_save(store.handle, before.drive)
    good = bytes(store.areas)
    _damage(store.areas, rng)
    area = firmware.MemoryStore.AREA
    whole = any(store.areas[a : a + area] == good[a : a + area] for a in (0, area))
    after = firmware.Controller(device, {}, store=firmware.MemoryStore(store.areas))
    values = [after.get(name) for name in names]
    if after.parameter_set == "saved":
        result.error = "" if values == saved else "a wrong value"
    else:
        result.cause, result.periods = after.parameter_set, 1  # before the first interrupt
        result.error = "" if values == built_in else "not the built-in parameters"
    if whole and after.parameter_set != "saved":
        result.error = "a whole copy was left, and not taken"
    if not firmware.lib.ht_port_tripped(after.port, firmware.ALL_LEGS):
        result.error = "gates on after the start"
    if after.registers.violations and not result.error:
        result.error = "forbidden register access"
    return result


#: The board's start must find this fault too. Its runs are not simulations either.
WRONG_CLOCK = "wrong system clock"


def _plant_clock(registers: firmware.CData, pllcr: bool, rng: np.random.Generator) -> None:
    """Choose one of three faults: a PLL that locks at another frequency at every try, a PLL that
    never locks, no crystal."""
    what = int(rng.integers(3))
    if what == 0:
        registers.wrong_locks = 60_000
        # The widest tolerance of a measurement, against an internal oscillator, is 12 %.
        registers.wrong_percent = int(rng.choice([rng.integers(25, 86), rng.integers(116, 151)]))
    elif what == 1:
        registers.never_locks = 1
    else:
        registers.no_crystal = 1
        if pllcr:
            registers.word[0x7011] |= 8  # PLLSTS.MCLKSTS


def _pwm_pins(board: firmware.CData, registers: firmware.CData) -> int:
    """How many of the twelve gate pins are handed to the PWM."""
    found = 0
    for pin in board.pwm:
        mux = board.map.gpio + pin.gpio // 32 * board.map.gpio_stride + 6 + pin.gpio % 32 // 8
        found += (registers.word[mux] >> 2 * (pin.gpio % 8)) & 3 != 0
    return found


def wrong_clock(device: str, seed: int) -> Result:
    """A start with a wrong clock. No pin may go to the PWM. START and CLEAR must be refused, and
    the fault must stay, whatever is commanded."""
    rng = np.random.default_rng(seed)
    ffi, lib = firmware.ffi, firmware.lib
    result = Result(WRONG_CLOCK, "start", "", device)
    board = firmware.board_of(device)[0]
    registers, port = ffi.new("ht_regfile *"), ffi.new("ht_port *")
    drive, params = ffi.new("ht_drive *"), ffi.new("ht_params *")
    lib.ht_regfile_reset(registers, board.map)
    _plant_clock(registers, board.map.clock_pllcr, rng)
    lib.ht_port_bind(port, registers, ffi.addressof(board))
    if lib.ht_board_start(port):
        result.error = "the clock was taken for right"
        return result
    lib.ht_params_default(params)
    lib.ht_drive_init(drive, port, params)
    commands = (
        lambda: lib.ht_drive_start(drive) == lib.HT_OK,
        lambda: lib.ht_drive_clear(drive) == lib.HT_OK,
        lambda: lib.ht_drive_stop(drive) is not None,
        lambda: lib.ht_drive_set(drive, int(rng.integers(100)), float(rng.uniform(-1, 100))) < 0,
    )
    for _ in range(AFTER):
        lib.ht_drive_stand_in(drive, lib.HT_FAULT_CLOCK)  # as the image's background does
        if commands[int(rng.integers(len(commands)))]():
            result.error = "a command was accepted"
        if drive.state != lib.HT_STATE_FAULT or not drive.faults & lib.HT_FAULT_CLOCK:
            result.error = "the fault did not stay"
        if _pwm_pins(board, registers) or not lib.ht_port_tripped(port, firmware.ALL_LEGS):
            result.error = "gates could come on"
    result.cause, result.periods = firmware.FAULTS[lib.HT_FAULT_CLOCK], 1
    if registers.violations and not result.error:
        result.error = "forbidden register access"
    return result


#: A debugger halts the chip while the drive works, and starts the image at its entry.
RESTARTED = "image started anew without a reset"


def restarted(state: str, scheme: str, setup: str, seed: int) -> Result:
    """The register model reports a start that waits, or changes a clock, while a gate is on."""
    rng = np.random.default_rng(seed)
    ffi, lib = firmware.ffi, firmware.lib
    result = Result(RESTARTED, state, scheme, setup)
    sim = SimulatedDrive(_setup(setup, scheme, rng, seed), 1)
    _bring_to(sim, state, rng)
    controller = sim.controller
    if state in GATES_ON and gates_off(sim):
        result.error = "the gates were off before the restart"
        return result
    params = ffi.new("ht_params *", controller.drive.params)
    started = lib.ht_board_start(controller.port)
    if not started or _pwm_pins(controller.port.board, controller.registers):
        result.error = "the board does not start with its gates off"
        return result
    lib.ht_store_start(controller.store.handle, controller.drive, controller.port, params)
    result.periods = 1  # before the first interrupt
    if controller.state != firmware.IDLE or not gates_off(sim):
        result.error = f"{controller.state} after the restart"
    elif controller.registers.violations:
        result.error = "a gate was on while the start waited"
    return result


#: Not a fault. It has most of the patterns that a drive can make.
REVERSAL = "none: the speed reverses"


def reversal(_: str, scheme: str, setup: str, seed: int) -> Result:
    rng = np.random.default_rng(seed)
    result = Result(REVERSAL, firmware.RUN, scheme, setup)
    base = _setup(setup, scheme, rng, seed).changed(controller__speed_trip_rpm=2500.0)
    sim = SimulatedDrive(base, 1)
    sim.start()
    sim.run(0.35, record=False)
    sim.log_edges(500_000)
    legs = np.array(sim.inverter.leg)
    speed_rpm = sign(rng) * float(rng.uniform(200, 1400))
    for reference_rpm in (speed_rpm, -speed_rpm):
        sim.set("speed_ref_rpm", reference_rpm)
        sim.run(0.5, record=False)
    result.error = shoot_through(sim, legs)
    if sim.state != firmware.RUN and not result.error:
        result.error = ", ".join(sim.faults)
    return result


#: The drive cannot know: it must go on.
STUCK_THERMISTOR = "thermistor stands still"


def stuck_thermistor(_: str, scheme: str, setup: str, seed: int) -> Result:
    rng = np.random.default_rng(seed)
    result = Result(STUCK_THERMISTOR, firmware.RUN, scheme, setup)
    base = _setup(setup, scheme, rng, seed)
    sim = SimulatedDrive(base.changed(auxiliaries.thermistors(base)), 1)
    _bring_to(sim, firmware.RUN, rng)
    sim.log_edges(500_000)
    legs = np.array(sim.inverter.leg)
    auxiliaries.stuck_cool(sim, rng)
    sim.run(0.3, record=False)
    result.error = shoot_through(sim, legs) or ", ".join(sim.faults)
    return result


#: No fault of the drive: the page that has started it falls silent. The monitor stops the drive.
PAGE_SILENT = "page silent"
#: Longest time until the gates are off.
PAGE_SILENT_S = 2.0


def page_silent(state: str, scheme: str, setup: str, seed: int) -> Result:
    """In whatever state the page falls silent, the gates must be off in time, without a fault, and
    stay off. While the page answers, the drive must go on. The periods are those until the monitor
    has next looked after the stop, which it does every HEARTBEAT_S."""
    rng = np.random.default_rng(seed)
    result = Result(PAGE_SILENT, state, scheme, setup)
    sim = PagedDrive(_setup(setup, scheme, rng, seed), 1)
    _bring_to(sim, state, rng)
    if state == firmware.RUN:
        sim.run(PAGE_SILENT_S + rng.uniform(0.0, HEARTBEAT_S), record=False)
    if sim.controller.state != state:
        result.error = f"{sim.controller.state} instead of {state} before the page falls silent"
        return result
    sim.page_silent = True
    begin, most = sim.periods, round(PAGE_SILENT_S / sim.period_s)
    while not gates_off(sim) or sim.controller.condition.at_work:
        if sim.periods - begin >= most:
            result.error = f"gates on for {PAGE_SILENT_S:g} s without a page, {sim.state}"
            return result
        sim.run(sim.period_s if sim.reason else HEARTBEAT_S, record=False)
    result.cause, result.periods = sim.reason, sim.periods - begin
    if sim.state != firmware.IDLE:
        result.error = f"ends in {sim.state}"
    elif not sim.reason:
        result.error = "the drive stopped by itself"
    for _ in range(AFTER):
        sim.run(sim.period_s, record=False)
        if not gates_off(sim):
            result.error = "a gate came on after the stop"
    return result


def places(fault: Fault, runs: int) -> list[tuple[str, str, str]]:
    """State, scheme and set-up of each run. Two thirds of the runs are in states where the fault
    must be found, the others in the remaining states. Both go through all combinations in turn."""
    others = [state for state in STATES if state not in fault.found_in]
    found, quiet = (
        itertools.cycle(itertools.product(states, firmware.schemes(), fault.of_setups))
        for states in (fault.found_in, others)
    )
    return [next(quiet if n % 3 == 2 else found) for n in range(runs)]


def one(task: tuple, progress: Progress | None = None) -> dict:
    """A run. task: the number of a fault, or the name of a case without one; its arguments."""
    case, *arguments = task
    made: Callable[..., Result]
    if isinstance(case, int):
        made = partial(run, FAULTS[case])
    elif case in magnet_faults.CASES:
        made = magnet_faults.CASES[case]
    else:
        made = WITHOUT_FAULT[case][0]
    result = made(*arguments)
    if progress:
        progress(0.3)
    return asdict(result)


#: Function, and the states in which it begins.
WITHOUT_FAULT: dict[str, tuple[Callable[..., Result], tuple[str, ...]]] = {
    RESTARTED: (restarted, STATES),
    REVERSAL: (reversal, (firmware.RUN,)),
    STUCK_THERMISTOR: (stuck_thermistor, (firmware.RUN,)),
    PAGE_SILENT: (page_silent, CHECKED),
}


def study(
    quick: bool = False, progress: Progress | None = None, folder: Path | None = None
) -> dict:
    step = QUICK_STEP if quick else 1
    tasks: list[tuple] = [
        (f, *where, 1000 * f + n)
        for f, fault in enumerate(FAULTS)
        for n, where in enumerate(places(fault, RUNS))
    ][::step]
    tasks += [
        (name, *where, n)
        for name, (_, states) in WITHOUT_FAULT.items()
        for n, where in zip(
            range(RUNS), itertools.cycle(itertools.product(states, firmware.schemes(), SETUPS))
        )
    ][::step]
    tasks += [
        (name, scheme, setup, n)
        for name in magnet_faults.CASES
        for n, (setup, scheme) in zip(
            range(magnet_faults.RUNS), itertools.cycle(magnet_faults.DRIVES)
        )
    ][::step]
    results = [Result(**found) for found in each(one, tasks, folder, progress)]
    at_the_start = {DAMAGED_SET: damaged_set, WRONG_CLOCK: wrong_clock}
    for case in at_the_start.values():
        results += [case(firmware.BOARDS[n % 3], n) for n in range(0, RUNS, step)]
    rows = []
    named = [(fault.name, fault.found_in) for fault in FAULTS]
    named += [(name, ("start",)) for name in at_the_start]
    named += [(RESTARTED, STATES), (REVERSAL, ()), (STUCK_THERMISTOR, ()), (PAGE_SILENT, CHECKED)]
    named += [(name, (firmware.RUN,)) for name in magnet_faults.CASES]
    for name, found_in in named:
        own = [r for r in results if r.fault == name]
        found = [r for r in own if r.periods]
        rows.append(
            {
                "fault": name,
                "runs": len(own),
                "found_in": list(found_in),
                "found": len(found),
                "causes": sorted({r.cause for r in found}),
                "periods_max": max((r.periods for r in found), default=0),
                "periods_median": float(np.median([r.periods for r in found])) if found else 0.0,
                "errors": [f"{r.state}, {r.scheme}, {r.setup}: {r.error}" for r in own if r.error],
            }
        )
    return {"quick": quick, "runs": len(results), "rows": rows}


def failures(result: dict) -> list[str]:
    return [f"{row['fault']}: {error}" for row in result["rows"] for error in row["errors"]]


def grid(result: dict) -> Grid:
    heads = ["fault", "must be found in", "named", "periods", "failures / runs"]
    rows = [
        [
            row["fault"],
            ", ".join(row["found_in"]) or "–",
            "; ".join(filter(None, row["causes"])) or "–",
            f"{row['periods_median']:g} / {row['periods_max']}" if row["found"] else "–",
            f"{len(row['errors'])} / {row['runs']}",
        ]
        for row in result["rows"]
    ]
    title = f"{result['runs']} runs; periods from injection to gates off, median / longest"
    return [(title, heads, rows)]


def plot(result: dict, path: Path) -> Path:
    """Draws the time from the injection to gates off, by fault."""
    from ...analysis import plots

    rows = [r for r in result["rows"] if r["found"]]
    figure, axes = plots.new_figure(1, 1, 1.4 + 0.3 * len(rows))
    axis = axes[0][0]
    for n, row in enumerate(rows):
        ends = [row["periods_median"], row["periods_max"]]
        axis.plot(ends, [n, n], "-", color=plots.FAINT, lw=5, solid_capstyle="round")
        axis.plot(ends[0], n, "o", color=plots.COLOUR["i_u1"], label="median" if n == 0 else None)
        axis.plot(ends[1], n, "|", color=plots.COLOUR["torque"], markersize=11, mew=2,
                  label="longest" if n == 0 else None)  # fmt: skip
    axis.set_xscale("log")
    axis.set_yticks(range(len(rows)), [r["fault"] for r in rows], fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel("control periods (0.1 ms) from injection to gates off", **plots.LABEL)
    axis.legend(loc="upper right", **plots.LEGEND)
    figure.suptitle(f"{TITLE}: {result['runs']} runs", **plots.TITLE)
    return plots.save(figure, path)
