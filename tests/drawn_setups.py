"""Set-ups and faults that are drawn: every key of a set-up that has a default, on or off, every
winding and kind of machine. The lists come from the tables, so that a new effect is drawn, too."""

import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from flux_tables import Iron, written

from hexatorque import firmware, setups
from hexatorque.chips import DEVICES
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import HexatorqueError
from hexatorque.plant.legs import KINDS
from hexatorque.plant.link import V
from hexatorque.plant.sensors import THERMISTORS
from hexatorque.plant.vsd import PHASES
from hexatorque.plant.wires import ENCODER_WIRES
from hexatorque.setups import Setup
from hexatorque.setups.keys import KEYS, LATENCIES, Key

#: Key or unit -> size of a value whose default is 0 or another key's, where machines of some
#: kilowatts have it.
SIZES = {
    "A": 0.05, "A/Wb": 0.1, "F": 500e-6, "H": 1e-4, "Hz": 50.0, "K/W": 0.3, "N m": 0.5,
    "N m s": 1e-3, "S": 1e-3, "V": 1.0, "V/ms": 50.0, "cycles": 0.02, "deg": 5.0, "mJ": 0.5,
    "ms": 1.0, "ohm": 0.1, "us": 0.5, "": 0.05,
    "inverter.arc_V": 25.0, "inverter.chopper_ohm": 40.0, "inverter.precharge_ohm": 10.0,
    "inverter.e_ref_A": 10.0, "inverter.e_ref_V": 300.0, "inverter.source_H": 1e-3,
    "machine.psi_knee_Wb": 0.8, "sensors.i_filter_Hz": 5e3, "sensors.sink_ntc_ohm": 1e4,
    "sensors.winding_ntc_ohm": 1e4,
}  # fmt: skip
#: The same over the voltage of the link; and what a change is added to.
CHOPPER = {"chopper_on_V": 1.1, "chopper_off_V": 1.06}
CHANGES = {"machine.drs_ohm": ("rs_ohm",), "machine.dlls_H": ("lls_H", "lxy_H")}
#: With these most drives trip before they run, so they are rarer.
MISWIRED = ("machine.leads", "sensors.encoder_wires", "sensors.i_wires", "sensors.i_offset_A")
#: Not the plant's.
ELSEWHERE = ("rated", "point")
#: Choices of the firmware that change what the plant does.
CONTROLLER = ("scheme", "trip_state")
#: What is always so, to keep a course short.
SHORT = {
    "controller.calibration_s": 0.005,
    "controller.build_s": 0.01,
    "controller.rotor_start": "known",
    "load.holding_open_s": 0.002,
    "load.holding_close_s": 0.002,
}
KNOWN = "controller.rotor_start"
#: Path -> key of each effect.
EFFECTS = {
    f"{section}.{name}": key
    for section, keys in KEYS.items()
    if section not in ELSEWHERE
    for name, key in keys.items()
    if (key.default is not None or key.follows) and f"{section}.{name}" not in SHORT
    and name != "model"
}  # fmt: skip
NAMES = setups.builtin_names()


def _number(rng: np.random.Generator, path: str, key: Key, default: float | None) -> float:
    if default:
        size, sign = abs(default), np.sign(default)
    else:
        size = SIZES[path] if path in SIZES else SIZES[key.unit]
        sign = rng.choice([-1, 1]) if key.min < 0 else 1
    return float(np.clip(sign * size * 2 ** rng.uniform(-1, 1), key.min, key.max))


def _chopper_V(name: str, setup: Setup) -> float:
    return setup["inverter.vdc_V"] * CHOPPER[name]


@cache
def _table(*of: float) -> str:
    rows = Iron(*of[:3]).rows(of[3], 17)
    return written(Path(tempfile.mkdtemp()) / "map.csv", rows)


def _saturating(setup: Setup) -> str:
    """A table of flux linkages for this machine."""
    of = [setup[f"machine.{name}"] for name in ("psi_f_Wb", "ld_H", "lq_H")]
    return _table(*of, 1.05 * setup.parameter("i_ab_trip_A"))


def _value(rng: np.random.Generator, path: str, key: Key, setup: Setup) -> object:
    """A value that is not the default."""
    if path == "machine.leads":
        return [int(k) + 1 for k in rng.permutation(6)]
    if path == "sensors.i_wires":
        return [int(k) for k in rng.permutation(range(1, 7)) * rng.choice([-1, 0, 1, 1], 6)]
    if path.split(".")[1] in CHOPPER:
        return _chopper_V(path.split(".")[1], setup)
    if path in CHANGES:
        size = min(setup[f"machine.{name}"] for name in CHANGES[path])
        return [float(x) for x in rng.uniform(-0.3, 0.3, 6) * size]
    if key.kind == "file":
        return _saturating(setup)
    if key.kind == "choice":
        return str(rng.choice([one for one in key.choices if one != str(key.default)]))
    if key.kind in ("phases", "harmonics", "pairs"):
        return [_number(rng, path, key, one) for one in key.default]
    number = _number(rng, path, key, key.default)
    return max(int(key.min), round(number)) if key.kind == "integer" else number


def drawn(rng: np.random.Generator) -> tuple[Setup, set[str]]:
    """A set-up that can be simulated, and which effects are on."""
    base = setups.load(str(rng.choice(NAMES)))
    table = firmware.parameters(base["timing.device"])
    always = {
        **{p: v for p, v in SHORT.items() if p != KNOWN or base["machine.model"] == "magnet"},
        "timing.device": str(rng.choice(DEVICES)),
    }
    while True:
        on = {
            path: _value(rng, path, key, base)
            for path, key in EFFECTS.items()
            if path in base and rng.random() < (0.2 if path in MISWIRED else 0.5)
        }
        met = rng.random() < 0.5  # else what needs another effect is taken out
        for _ in range(50):
            fixed = {
                "timing.latency": str(rng.choice(LATENCIES)),
                **{f"controller.{n}": str(rng.choice(table[n].choices)) for n in CONTROLLER},
            }
            try:
                setup = base.changed(always | on | fixed)
                SimulatedDrive(setup)
                return setup, set(on)
            except HexatorqueError as error:
                _mend(rng, str(error), on, always, base, met)


def _mend(
    rng: np.random.Generator, refusal: str, on: dict, always: dict, base: Setup, met: bool
) -> None:
    """Turn on what an effect needs, or take out an effect that does not fit."""
    for line in refusal.splitlines():
        if least := re.match(r"(controller\.magnets_bear_A) .* allowed is (\S+) A and more", line):
            always[least[1]] = bears_A = 1.1 * float(least[2])
            always["sensors.i_full_A"] = max(base["sensors.i_full_A"], 1.5 * bears_A)
            always |= {f"controller.{n}": base.parameter(n) for n in ("i_trip_A", "i_ab_trip_A")}
            always["controller.speed_trip_rpm"] = 1.5 * base.parameter("speed_trip_rpm")
        elif re.match(r"(controller\.(scheme|trip_state)|timing\.latency)\b", line):
            pass  # another draw of these may fit
        elif needed := re.search(r"(\S+) needs (\S+)(?: and (\S+))? above 0", line):
            needs, *paths = filter(None, needed.groups())
            if not met:
                on.pop(needs, None)
            else:
                on |= {path: _value(rng, path, EFFECTS[path], base) for path in paths}
        elif "the drive's output switches the chopper" in line:
            always |= {f"controller.{n}": _chopper_V(n, base) for n in CHOPPER}
        elif line.startswith("inverter.chopper_"):
            on |= {f"inverter.{n}": _chopper_V(n, base) for n in CHOPPER}
        else:
            named = [path for path in on if re.search(rf"\b{path.split('.')[1]}\b", line)]
            for path in named[:1]:
                del on[path]


def _break(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    kind = rng.choice(KINDS) if rng.random() < 0.5 else "open"  # which may have an arc
    sim.break_leg(str(rng.choice(PHASES)), str(kind), float(rng.uniform(0, 2e-3)))


def _freeze(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.sensors.hold[rng.integers(len(sim.sensors.hold))] ^= 1


def _thermistor(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.break_thermistor(
        str(rng.choice(THERMISTORS)), str(rng.choice(["open", "short", "stuck", "none"]))
    )


def _sag(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.set("vdc_V", sim.setup["inverter.vdc_V"] * rng.uniform(0, 1.2))


def _interrupts(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.lose_interrupts(bool(rng.integers(2)))


def _trip(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.controller.set_trip_pin(int(rng.integers(2)))


def _overvoltage(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.set_many(
        {"chopper_on_V": 0, "chopper_off_V": 0, "vdc_max_V": 0.9 * sim.setup["inverter.vdc_V"]}
    )


def _load(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.set("load_Nm", rng.uniform(-1, 1) * sim.setup.parameter("torque_limit_Nm"))


def _speed(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.set("speed_ref_rpm", rng.uniform(-1, 1) * 0.5 * sim.setup.parameter("speed_trip_rpm"))


def _wire(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.sensors.encoder_wires = rng.integers(len(ENCODER_WIRES))


def _stop(rng: np.random.Generator, sim: SimulatedDrive) -> None:
    sim.stop()


#: What happens to a drive: faults, and what its user does.
EVENTS: tuple[Callable[[np.random.Generator, SimulatedDrive], None], ...] = (
    _break, _freeze, _thermistor, _sag, _interrupts, _trip, _overvoltage, _load, _speed, _wire,
    _stop,
)  # fmt: skip


def course(sim: SimulatedDrive, seed: int, periods: int) -> list[str]:
    """Start, let a drawn event happen now and then, and stop. Returns what happened. A refusal
    stands there, too: in two simulations with the same bits it is the same."""
    rng = np.random.default_rng(seed)
    if sim.inverter.link.on and not sim.inverter.link.line_Hz:  # whose diodes fit its voltage
        sim.inverter.link.x[V] = rng.choice([0.5, 1.0, 1.2]) * sim.vdc_V
    if not sim.brake.held:
        share = rng.choice([0, 0.05, -0.3, 0.8])
        sim.plant_state[6] = share * sim.setup.parameter("speed_trip_rpm") * np.pi / 30
    said = []
    events = [None, None, None, EVENTS.index(_break), *rng.choice(len(EVENTS), 3)]
    for event in events:
        try:
            if event is not None:
                EVENTS[event](rng, sim)
                said.append(EVENTS[event].__name__)
            elif sim.state == "idle":
                sim.start()
            sim.run(periods / len(events) * sim.period_s)
        except HexatorqueError as error:
            said.append(str(error))
        said.append(sim.state)
        if sim.controller.drive.short_circuit.on:
            said.append("short circuit")
    return said
