"""Faults of drives with magnets, a part of the fault campaign: the trip state below and above the
speed at which the magnets induce the dc link's voltage, and encoders that lie.

The drive knows the data sheet, and the true machine is another one, as in `magnets`. The sensors
have a wider range than the set-up's, so that they see the current of a short circuit, and the speed
trip lies above the ceiling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ... import firmware, setups
from ...drive.simulated import SimulatedDrive
from ...plant.legs import LOW, OFF
from ...plant.machines.magnet_parameters import Parameters
from ...setups import parameters
from ...setups.design import Design
from ...setups.keys import TIMING_OWNS
from . import magnets
from .fault_checks import Result, gates_off, shoot_through, sign

lib = firmware.lib


class Machine(NamedTuple):
    """schemes: that the machine bears; full_A: range of the current sensors; bear_A: what the
    magnets bear."""

    schemes: tuple[str, ...]
    full_A: float
    bear_A: float


MACHINES = {
    "magnet-interior": Machine(("ddr", "fdr", "db-dtfc", "foc"), 90.0, 75.0),
    "magnet-surface": Machine(("ddr", "dtc3", "db-dtfc", "foc"), 60.0, 50.0),
    "magnet-24v": Machine(("ddr", "db-dtfc", "foc", "foc-24"), 300.0, 250.0),
}
#: Set-up and scheme of the runs, in turn.
DRIVES = [
    (name, machine.schemes[k])
    for k in range(len(MACHINES["magnet-surface"].schemes))
    for name, machine in MACHINES.items()
]
CHIPS = ("f28335", "f28377s")
#: Runs of each case.
RUNS = 120
#: The trip state is reached within so many periods: gates off in that of the fault, and two more
#: for a short circuit.
SOON = 4
#: Currents end in this time once the gates are off.
ENDED_S = 0.005
#: Torque that an encoder's fault may cause, over rated torque; time until it is found.
PULSE, FOUND_S = 1.2, 2e-3
#: Speed over `encoder_trip_rpm` from which on a wrong encoder is found at once; one that shows half
#: of its counts.
LEAST_RATIO, LEAST_RATIO_HALF = 1.5, 3.0
#: The ripple before is looked at for so long that its peaks have been there.
RIPPLE_S = 0.3
NO_CURRENT_A = 0.02  # over rated
#: Speed over the true machine's ceiling, and over what the drive takes for it; the latter is up to
#: 9 % lower.
ABOVE_CEILING = (1.0, 1.2)
SPEED_TRIP = 1.45


def _setup(name: str, scheme: str, rng: np.random.Generator) -> setups.Setup:
    """The drive's values are pinned, then the machine is changed."""
    base = setups.load(name)
    start_deg = float(rng.uniform(-180, 180))
    told = {f"controller__{n}": base.parameter(n) for n in ("i_trip_A", "i_ab_trip_A")}
    sheet = Parameters(**base.machine_values())
    believed = base.with_scheme(
        scheme,
        machine__start_deg=start_deg,
        sensors__i_full_A=MACHINES[name].full_A,
        timing__device=str(rng.choice(CHIPS)),
        load__kind="constant",
        controller__rotor_start="known",
        controller__rotor_zero_deg=start_deg,
        controller__trip_state="short-circuit",
        controller__magnets_bear_A=MACHINES[name].bear_A,
        controller__speed_trip_rpm=SPEED_TRIP * sheet.ceiling_rpm(base["inverter.vdc_V"]),
        **told,
    )
    values = parameters(believed)
    known = {f"controller__{n}": v for n, v in values.items() if n not in (*TIMING_OWNS, "scheme")}
    ld_H, lq_H = (value * rng.uniform(*magnets.INDUCTANCE) for value in (sheet.ld_H, sheet.lq_H))
    return believed.with_scheme(
        scheme,
        machine__psi_f_Wb=sheet.psi_f_Wb * rng.uniform(*magnets.FLUX),
        machine__rs_ohm=sheet.rs_ohm * rng.uniform(*magnets.RESISTANCE),
        machine__ld_H=ld_H,
        machine__lq_H=max(lq_H, ld_H),
        **known,
    )


def _running(
    setup: setups.Setup, speed_rpm: float, load: float, rng: np.random.Generator
) -> tuple[SimulatedDrive, Design, str]:
    """The drive at this speed under a share of its rated torque, and what is wrong, or ""."""
    sim = SimulatedDrive(setup, 4)
    design = Design(setup, parameters(setup).__getitem__)
    sim.start()
    while sim.time_s < 5 and sim.state in (firmware.CALIBRATE, firmware.BUILD):
        sim.run(0.05, record=False)
    sim.set("speed_ref_rpm", speed_rpm)

    def settle() -> None:
        end_s = sim.time_s + 3
        while sim.time_s < end_s and abs(sim.speed_rpm - speed_rpm) > 0.005 * abs(speed_rpm):
            sim.run(0.05, record=False)

    settle()
    for share in np.linspace(0.1, 1.0, 10):
        sim.set("load_Nm", share * load * design.rated_Nm)
        sim.run(0.03, record=False)
        settle()
    sim.run(0.3 + float(rng.uniform(0.0, 0.05)), record=False)
    right = sim.state == firmware.RUN and abs(sim.speed_rpm / speed_rpm - 1) < 0.3
    return sim, design, "" if right else f"{sim.state} at {sim.speed_rpm:.0f} r/min before it"


def _about_ceiling(
    result: Result, shares: tuple[float, float], load: float, rng: np.random.Generator
) -> tuple[SimulatedDrive, Design, float]:
    """A drive at a share of the true machine's ceiling, under `load` of its rated torque at most,
    and that ceiling. What is wrong goes into `result`."""
    own = _setup(result.setup, result.scheme, rng)
    ceiling_rpm = Parameters(**own.machine_values()).ceiling_rpm(own["inverter.vdc_V"])
    speed_rpm = sign(rng) * float(rng.uniform(*shares)) * ceiling_rpm
    sim, design, result.error = _running(own, speed_rpm, float(rng.uniform(-load, load)), rng)
    return sim, design, ceiling_rpm


def _overrun(sim: SimulatedDrive) -> None:
    lib.ht_drive_trip(sim.controller.drive, lib.HT_FAULT_OVERRUN)


def _stop(sim: SimulatedDrive) -> None:
    sim.stop()


def _upset(sim: SimulatedDrive) -> None:
    sim.controller.drive.control.observer.psi_Wb.alpha = np.nan


def _encoder_stops(sim: SimulatedDrive) -> None:
    sim.sensors.hold[7] = 1


def _sum(sim: SimulatedDrive) -> None:
    counts = 1.5 * sim.controller.number("i_sum_trip_A") / sim.controller.drive.i_per_count
    sim.sensors.i_offset_counts[2] += counts


#: What takes the drive out of RUN, and in how many periods.
ENDS: dict[str, tuple[Callable[[SimulatedDrive], None], int]] = {
    "overrun": (_overrun, 0),
    "stop": (_stop, 0),
    "not finite": (_upset, 1),
    "encoder stops": (_encoder_stops, 20),
    "current sensor off its zero": (_sum, 1),
}


def _current_A(sim: SimulatedDrive) -> float:
    rec = sim.take()
    return float(np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).max())


def _shorted(sim: SimulatedDrive) -> bool:
    """The zero vector of a pattern looks like it."""
    there = bool(sim.controller.drive.short_circuit.on)
    return there and all(state == LOW for state in sim.inverter.leg)


def _judged(sim: SimulatedDrive, result: Result, legs: np.ndarray) -> Result:
    result.cause = ", ".join(sim.faults)
    result.error = result.error or shoot_through(sim, legs)
    if sim.controller.registers.violations and not result.error:
        result.error = "forbidden register access"
    return result


#: Names of the cases.
BELOW = "magnets below their ceiling: gates off"
ABOVE = "magnets above their ceiling: short circuit"
ALWAYS_OFF = "magnets above their ceiling, over-current or trip pin: gates off"
ENCODER = "magnets, encoder lies"


def _ended(
    sim: SimulatedDrive,
    result: Result,
    rng: np.random.Generator,
    safe: Callable[[SimulatedDrive], bool],
    more: int,
    record: bool,
) -> np.ndarray:
    """Take the drive out of RUN, and let it run until it is safe, at most `more` periods beyond
    those of what ends it. The legs' states before."""
    end, most = ENDS[str(rng.choice(list(ENDS)))]
    sim.log_edges(500_000)
    legs = np.array(sim.inverter.leg)
    end(sim)
    sim.set("load_Nm", 0.0)
    while not safe(sim) and result.periods < most + more:
        sim.run(sim.period_s, record=record)
        result.periods += 1
    return legs


def below(scheme: str, setup: str, seed: int) -> Result:
    """No current flows after 5 ms, and no gate is on."""
    rng = np.random.default_rng(seed)
    result = Result(BELOW, firmware.RUN, scheme, setup)
    sim, design, _ = _about_ceiling(result, (0.2, 0.85), 0.4, rng)
    if result.error:
        return result
    legs = _ended(sim, result, rng, gates_off, 1, record=False)
    sim.run(ENDED_S, record=False)
    sim.discard()
    sim.run(0.05)
    result.periods = max(result.periods, 1)
    if _current_A(sim) > NO_CURRENT_A * design.rated_A:
        result.error = "current after gates off"
    elif any(state != OFF for state in sim.inverter.leg):
        result.error = "a gate is on"
    return _judged(sim, result, legs)


def above(scheme: str, setup: str, seed: int) -> Result:
    """The lower switches are on within SOON periods, the current never exceeds what the magnets
    bear. It ends where the diodes no longer rectify."""
    rng = np.random.default_rng(seed)
    result = Result(ABOVE, firmware.RUN, scheme, setup)
    sim, design, ceiling_rpm = _about_ceiling(result, ABOVE_CEILING, 0.2, rng)
    if result.error:
        return result
    legs = _ended(sim, result, rng, _shorted, SOON, record=True)
    if not _shorted(sim):
        result.error = "no short circuit"
        return _judged(sim, result, legs)
    sim.run(0.02)
    current_A = _current_A(sim)
    if current_A > MACHINES[setup].bear_A:
        result.error = f"{current_A:.1f} A, more than {MACHINES[setup].bear_A:g} A"
    end_s = sim.time_s + 30
    while sim.controller.drive.short_circuit.on and sim.time_s < end_s:
        sim.run(0.01, record=False)
    true_rpm = abs(sim.plant_state[6]) * 30 / np.pi
    # Where R_s is large, the shaft loses half of its speed in the shortest time that it lasts.
    if not 0.3 < true_rpm / ceiling_rpm < 0.97:
        result.error = f"ended at {true_rpm / ceiling_rpm:.2f} of the ceiling"
    sim.run(ENDED_S, record=False)
    sim.discard()
    sim.run(0.02)
    if _current_A(sim) > NO_CURRENT_A * design.rated_A and not result.error:
        result.error = "current after the short circuit"
    return _judged(sim, result, legs)


def always_off(scheme: str, setup: str, seed: int) -> Result:
    """No lower switch may complete a short circuit through a switch that has failed."""
    rng = np.random.default_rng(seed)
    result = Result(ALWAYS_OFF, firmware.RUN, scheme, setup)
    sim, _, _ = _about_ceiling(result, ABOVE_CEILING, 0.2, rng)
    if result.error:
        return result
    shorted = bool(rng.integers(2))  # the pin, or too much current, while the legs are shorted
    if shorted:
        _overrun(sim)
        sim.run(0.01, record=False)
    sim.log_edges(500_000)
    legs = np.array(sim.inverter.leg)
    if rng.integers(2):
        sim.controller.set_trip_pin(0)
    else:  # far beyond what the magnets bear, too
        beyond_Wb = 2.5 * MACHINES[setup].bear_A * sim.machine.lq_H
        sim.plant_state[:2] += beyond_Wb * np.array([1.0, 0.0])
    while any(state != OFF for state in sim.inverter.leg) and result.periods < SOON:
        sim.run(sim.period_s, record=False)
        result.periods += 1
    sim.controller.set_trip_pin(1)
    for _ in range(100):
        if any(state != OFF for state in sim.inverter.leg):
            result.error = "a gate is on"
        sim.run(sim.period_s, record=False)
    return _judged(sim, result, legs)


#: Counts that an encoder shows instead of `true`, from `first` on. share: of an electrical turn.
ENCODERS: dict[str, Callable[[float, float, float, float], float]] = {
    "stands still": lambda true, first, turn, share: first,
    "counts backwards": lambda true, first, turn, share: 2 * first - true,
    "jumps": lambda true, first, turn, share: true + turn * share,
    "has one line": lambda true, first, turn, share: first + np.floor(0.5 * (true - first)) % 2,
    "shows half": lambda true, first, turn, share: first + np.floor(0.5 * (true - first)),
}
#: An encoder jumps by 15 degrees at least: by less, the torque is right within 4 %.
LEAST_JUMP = 1 / 24


def encoder(scheme: str, setup: str, seed: int) -> Result:
    """Found within 2 ms. Until then the torque stays below 1.2 times the rated one, or below its
    ripple before."""
    rng = np.random.default_rng(seed)
    result = Result(ENCODER, firmware.RUN, scheme, setup)
    own = _setup(setup, scheme, rng)
    names = list(ENCODERS)
    kind = names[seed // len(DRIVES) % len(names)]
    ratio = LEAST_RATIO_HALF if kind == "shows half" else LEAST_RATIO
    rated_rpm = Design(own, parameters(own).__getitem__).rated_rpm
    least = ratio * own.parameter("encoder_trip_rpm") / rated_rpm
    share = float(np.exp(rng.uniform(np.log(least), 0.0)))
    load = sign(rng) * float(rng.uniform(0.5, 1.0)) * (0.9 if share > 0.9 else 1.0)
    sim, design, result.error = _running(own, sign(rng) * share * rated_rpm, load, rng)
    if result.error:
        return result
    sim.discard()
    sim.run(RIPPLE_S)
    before_Nm = float(np.abs(sim.take()["plant.torque_Nm"]).max())
    counts_rev = sim.controller.number("encoder_counts_rev")
    legs = np.array(sim.inverter.leg)
    sim.log_edges(500_000)
    first = sim.plant_state[7] / 2 / np.pi * counts_rev
    jump = sign(rng) * float(rng.uniform(LEAST_JUMP, 1 - LEAST_JUMP))
    sim.sensors.hold[7] = 1
    while sim.state == firmware.RUN and result.periods < FOUND_S / sim.period_s:
        true = sim.plant_state[7] / 2 / np.pi * counts_rev
        shown = ENCODERS[kind](true, first, counts_rev / sim.machine.pole_pairs, jump)
        sim.sensors.position_counts, sim.sensors.counter = shown, int(np.floor(shown))
        sim.run(sim.period_s)
        result.periods += 1
    pulse = float(np.abs(sim.take()["plant.torque_Nm"]).max())
    if sim.faults != [firmware.FAULTS[lib.HT_FAULT_ENCODER]]:
        result.error = f"{kind}: {sim.state} {', '.join(sim.faults)}"
    elif pulse > max(PULSE * design.rated_Nm, 1.02 * before_Nm):
        result.error = f"{kind}: {pulse / design.rated_Nm:.2f} of rated torque"
    return _judged(sim, result, legs)


CASES: dict[str, Callable[[str, str, int], Result]] = {
    BELOW: below,
    ABOVE: above,
    ALWAYS_OFF: always_off,
    ENCODER: encoder,
}
