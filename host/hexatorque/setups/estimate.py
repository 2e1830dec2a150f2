"""The circuit of a machine from its plate, and from the values that are typical of its power.

A plate does not decide the whole circuit. With the power factor it gives the losses. Those of the
stator remain when rotor, iron and friction are taken off: a small difference of large numbers. The
estimate of R_s is therefore half-way (in the logarithm) between that and the resistance of
published machines of this power. Without the power factor it is theirs alone, and the losses follow
from it. The leakage is theirs unless the plate has the pull-out torque. R_r and L_m then
follow: the circuit takes the rated current and gives the rated torque at the rated speed.

The range of each value is as wide as these estimates err for published machines, each estimated
from the others (tests/host/setups/test_published.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache

from .mistyped import meant
from .nameplate import (
    FRICTION,
    IRON,
    MOST_PRODUCT,
    Circuit,
    Nameplate,
    circuit_with,
    powers_of,
    slip_of,
    split,
)
from .published import Line, Machine, factor_of, machines, through
from .values import SetupError

#: A power factor at rated load is not above this.
MOST_FACTOR = 0.94
#: One that is told is not above this, nor one that follows from the efficiency. It leaves two
#: thirds of the reactive current that any published machine takes.
MOST_TOLD = 0.97
#: Efficiency times power factor is not below the typical value by more than this factor, and the
#: slip neither below nor above its own by more than these. Of the published machines the furthest
#: is about half as far away.
PRODUCT_FACTOR = 1.75
SLIP_BELOW, SLIP_ABOVE = 8.0, 5.1
#: Numbers so near to the typical one may have been meant.
PRODUCT_NEAR, SLIP_NEAR = 1.35, 4.0
#: Efficiency times power factor of a machine of which they are not told.
PRODUCT = 0.75
#: Ohms below which no voltage over its current is: the plate's two are then exchanged.
LEAST_OHM = 0.1
#: Share of the machines that the ranges of inertia and speed are to hold: some sources include a
#: load.
INERTIA_HELD = 0.9
RANGED = ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H", "flux_Wb")


@dataclass(frozen=True)
class Example:
    """A published machine as it were with two sets: its plate and its circuit. Equal leakages."""

    machine: Machine
    plate: Nameplate
    circuit: Circuit


def example(machine: Machine, iron: float, friction: float) -> Example:
    """Missing values follow from the circuit, with these shares of the losses."""
    power_W, speed_rpm = 1e3 * machine.power_kW, machine.speed_rpm
    synchronous_rpm = 60 * machine.frequency_Hz / machine.pole_pairs
    slip = 1 - speed_rpm / synchronous_rpm
    if power_W:
        slip = machine.slip_at(power_W, iron, friction)
        speed_rpm = speed_rpm or synchronous_rpm * (1 - slip)
    shaft_W, current_A, factor = machine.load(slip, iron, friction)
    power_W = power_W or shaft_W
    plate = Nameplate(
        power_W / 1e3,
        machine.voltage_V,
        0.5 * (machine.current_A or current_A),
        machine.frequency_Hz,
        speed_rpm,
        machine.pole_pairs,
        machine.power_factor or factor,
    )
    rr_ohm, leakage_H, lm_H = (2 * value for value in machine.equal_leakages)
    omega, rs_ohm = 2 * math.pi * machine.frequency_Hz, 2 * machine.rs_ohm
    sine = math.sqrt(1 - plate.power_factor**2)
    across = plate.current_A * complex(plate.power_factor, -sine)
    flux_Wb = math.sqrt(2) * abs(machine.voltage_V / math.sqrt(3) - rs_ohm * across) / omega
    torque_Nm = power_W / (2 * math.pi * speed_rpm / 60)
    circuit = Circuit(rs_ohm, rr_ohm, leakage_H, leakage_H, lm_H, torque_Nm, flux_Wb)
    return Example(machine, plate, circuit)


@cache
def examples(machine: Machine) -> tuple[Example, Example]:
    """With losses of iron and friction, as a real plate has them, and without, as a printed circuit
    is."""
    return example(machine, IRON.value, FRICTION.value), example(machine, 0.0, 0.0)


@dataclass(frozen=True)
class Typical:
    """Lines over the power. Resistances, leakage, main inductance: in units of voltage over current
    of a phase. starting: that of the rotor alone, in seconds in which rated power reaches rated
    speed, twice its kinetic energy over the power. rs_factor: how far single machines are from the
    line."""

    rs: Line
    rr: Line
    leakage: Line
    main: Line
    product: Line
    starting_s: Line
    rs_factor: float


def typical_of(known: Sequence[Machine]) -> Typical:
    of = [examples(machine)[0] for machine in known]
    power = [one.plate.power_kW for one in of]
    elements = [per_unit(one) for one in of]
    names = ("R_s", "R_r", "leakage", "L_m")
    rs, rr, leakage, main = ([each[name] for each in elements] for name in names)
    started = [
        (kW, one.machine.inertia_kgm2 * one.machine.synchronous_rad_s**2 / (1e3 * kW))
        for one, kW in zip(of, power)
        if one.machine.inertia_kgm2
    ]
    line = through(zip(power, rs))
    return Typical(
        line,
        through(zip(power, rr)),
        through(zip(power, leakage)),
        through(zip(power, main)),
        through((one.plate.power_kW, one.plate.product) for one in of),
        through(started),
        factor_of(value / line.at(kW) for value, kW in zip(rs, power)),
    )


@cache
def typical() -> Typical:
    return typical_of(machines())


def per_unit(one: Example) -> dict[str, float]:
    """The elements of the circuit in units of rated voltage over rated current of a phase."""
    c, base_ohm = one.circuit, one.plate.base_ohm
    base_H = base_ohm / (2 * math.pi * one.plate.frequency_Hz)
    return {
        "R_s": c.rs_ohm / base_ohm,
        "R_r": c.rr_ohm / base_ohm,
        "leakage": c.lls_H / base_H,
        "L_m": c.lm_H / base_H,
    }


#: The same whatever voltage, current and speed the machine is for.
MAIN_OVER_LEAKAGE = "L_m over the leakage"


@dataclass(frozen=True)
class Usual:
    """An element in these units over the power, and by which factor the published machine that is
    furthest away is above or below it."""

    line: Line
    furthest: float


@cache
def usual() -> dict[str, Usual]:
    of = [examples(machine)[0] for machine in machines()]
    found = {}
    rows = [per_unit(one) for one in of]
    rows = [{**row, MAIN_OVER_LEAKAGE: row["L_m"] / row["leakage"]} for row in rows]
    for name in rows[0]:
        points = [(one.plate.power_kW, row[name]) for one, row in zip(of, rows)]
        line = through(points)
        found[name] = Usual(line, factor_of((v / line.at(kW) for kW, v in points), 1.0))
    return found


def published_kW() -> tuple[float, float]:
    """The least and the largest power of the published machines."""
    powers = [examples(machine)[0].plate.power_kW for machine in machines()]
    return min(powers), max(powers)


def estimate(plate: Nameplate, of: Typical | None = None) -> Circuit:
    """The circuit per phase of the equivalent star. SetupError if the plate contradicts itself."""
    of = of or typical()
    _believable(plate, of)
    usual_ohm = of.rs.at(plate.power_kW) * plate.base_ohm
    leakage_ohm = 0.0 if plate.pull_out else of.leakage.at(plate.power_kW) * plate.base_ohm
    told = bool(plate.power_factor or plate.efficiency)
    efficiency, factor = split(plate, _efficiency(plate, usual_ohm))
    powers = powers_of(plate, efficiency)
    rs_ohm = powers.stator_W / (6 * plate.current_A**2)
    if told:
        rs_ohm = min(max(rs_ohm, usual_ohm / of.rs_factor), usual_ohm * of.rs_factor)
        rs_ohm = math.sqrt(rs_ohm * usual_ohm)
    return circuit_with(plate, factor, powers.gap_W, rs_ohm, leakage_ohm)


def _believable(plate: Nameplate, of: Typical) -> None:
    """One line that names the number that looks wrong, and what would fit."""
    _believable_product(plate, of)
    product = plate.product
    factor = plate.power_factor or (plate.efficiency and product / plate.efficiency)
    if factor > MOST_TOLD:
        name = "power_factor" if plate.power_factor else "efficiency"
        raise SetupError(
            f"{name} = {getattr(plate, name):g}: that is a power factor of {factor:.3g}, which "
            f"leaves too little to magnetise a machine: allowed is up to {MOST_TOLD:g}"
        )
    usual = of.rr.at(plate.power_kW)

    def fits(other: Nameplate) -> bool:
        synchronous_rpm = 60 * other.frequency_Hz / other.pole_pairs
        slip = 1 - other.speed_rpm / synchronous_rpm
        return usual / SLIP_NEAR <= slip <= usual * SLIP_NEAR

    try:
        slip = slip_of(plate)
    except SetupError as error:
        hint = meant(plate, ("speed_rpm", "frequency_Hz", "poles"), fits)
        raise SetupError("; ".join(filter(None, (str(error), hint)))) from None
    if not usual / SLIP_BELOW <= slip <= usual * SLIP_ABOVE:
        synchronous_rpm = 60 * plate.frequency_Hz / plate.pole_pairs
        raise SetupError(
            f"speed_rpm = {plate.speed_rpm:g} with {plate.frequency_Hz:g} Hz and "
            f"{2 * plate.pole_pairs} poles is a slip of {100 * slip:.2g} %, usual for this power "
            f"is {100 * usual:.2g} %: speed_rpm = {synchronous_rpm * (1 - usual):.0f} would fit"
        )
    _believable_losses(plate)


def _believable_losses(plate: Nameplate) -> None:
    """The rotor's loss, which the slip tells, against all of them, which efficiency or power factor
    tell."""
    slip, power_W = slip_of(plate), 1e3 * plate.power_kW
    share = 1 - plate.friction - slip * plate.friction / (1 - slip)
    least_W = slip * power_W / (1 - slip) / share
    most = power_W / (power_W + least_W)  # the efficiency
    factor = plate.power_factor or (plate.efficiency and plate.product / plate.efficiency)
    both = plate.efficiency * plate.power_factor  # where they contradict, `split` says so
    if (
        not factor
        or plate.product / factor < most
        or (both and abs(both / plate.product - 1) > 0.05)
    ):
        return
    low = math.ceil(1000 * plate.product / most) / 1000
    if plate.power_factor:
        name, fits = "power_factor", f"{low:g} .. {MOST_TOLD:g}"
    else:
        high = math.floor(1000 * most) / 1000
        name, fits = "efficiency", f"{plate.product / MOST_TOLD:.3f} .. {high:g}"
    raise SetupError(
        f"{name} = {getattr(plate, name):g}: with {plate.sizes} that is an efficiency of "
        f"{plate.product / factor:.3g}, but the slip of {100 * slip:.3g} % alone allows less than "
        f"{most:.3g}: {name} = {fits} would fit"
    )


def _believable_product(plate: Nameplate, of: Typical) -> None:
    """Power, voltage and current against each other."""
    usual = of.product.at(plate.power_kW)
    if usual / PRODUCT_FACTOR <= plate.product < MOST_PRODUCT:
        if plate.voltage_V < LEAST_OHM * plate.current_A:
            raise SetupError(
                f"voltage_V = {plate.voltage_V:g} and current_A = {plate.current_A:g} are less "
                f"than {LEAST_OHM:g} ohm: are they exchanged?"
            )
        return

    def fits(other: Nameplate) -> bool:
        usual = of.product.at(other.power_kW)
        return usual / PRODUCT_NEAR <= other.product <= min(usual * PRODUCT_NEAR, MOST_FACTOR)

    if hint := meant(plate, ("voltage_V", "current_A", "power_kW"), fits):
        raise SetupError(
            f"{plate.sizes} are an efficiency times power factor of {plate.product:.3g}, allowed "
            f"is above {usual / PRODUCT_FACTOR:.2g} and below {MOST_PRODUCT:g}: {hint}"
        )
    fitting = f"current_A = {plate.current_A * plate.product / usual:.3g} would fit"
    if plate.product < MOST_PRODUCT:
        raise SetupError(
            f"current_A = {plate.current_A:g}: {plate.sizes} are an efficiency times power factor "
            f"of {plate.product:.3g}, usual for this power is {min(usual, 0.95):.2g}: {fitting}"
        )
    try:
        split(plate)
    except SetupError as error:
        raise SetupError(f"{error} {fitting}") from None


def _efficiency(plate: Nameplate, rs_ohm: float) -> float:
    """With this stator resistance; but the power factor is MOST_FACTOR at most."""
    slip, power_W = slip_of(plate), 1e3 * plate.power_kW
    stator_W = 6 * rs_ohm * plate.current_A**2
    copper_W = stator_W + slip * power_W / (1 - slip)
    share = 1 - plate.iron - plate.friction - slip * plate.friction / (1 - slip)
    return max(power_W / (power_W + copper_W / share), plate.product / MOST_FACTOR)


def errors(known: Sequence[Machine]) -> dict[str, dict[bool, list[float]]]:
    """Estimate over truth of each value, with the power factor told or not, for each machine
    estimated from the others."""
    found: dict[str, dict[bool, list[float]]] = {name: {True: [], False: []} for name in RANGED}
    for machine in known:
        of = typical_of([other for other in known if other is not machine])
        for one in examples(machine):
            for told, by_name in ratios(one, of):
                for name, ratio in by_name.items():
                    found[name][told].append(ratio)
    return found


def ratios(one: Example, of: Typical) -> Iterable[tuple[bool, dict[str, float]]]:
    """Estimate over truth by name, with the power factor told and not."""
    for told in (True, False):
        plate = one.plate if told else replace(one.plate, power_factor=0.0)
        try:
            circuit = asdict(estimate(plate, of))
        except SetupError:  # the plate is refused: nothing is stated of it
            continue
        truth = asdict(one.circuit)
        yield told, {name: circuit[name] / truth[name] for name in RANGED}


@dataclass(frozen=True)
class Spread:
    """Factors below and above an estimate for its range, by name and by whether the power
    factor was told; and the same of the inertia, with the rated speed told, and of a rated speed
    that follows from the circuit."""

    factors: dict[str, dict[bool, float]]
    inertia: float
    speed: float

    @property
    def untold_inertia(self) -> float:
        """The range of the inertia, which goes with the square of the speed. Both errors are
        chance."""
        return math.exp(math.hypot(math.log(self.inertia), 2 * math.log(self.speed)))


def spread_of(known: Sequence[Machine]) -> Spread:
    found = errors(known)
    factors = {
        name: {told: factor_of(ratios) for told, ratios in by_told.items()}
        for name, by_told in found.items()
    }
    return Spread(factors, next_within(inertia_errors(known)), next_within(speed_errors(known)))


def next_within(errors: Sequence[float]) -> float:
    """The factor of a range that holds one machine more: with the probability k/(n + 1) it is
    within the k-th of n errors in the order of their size."""
    return factor_of(errors, min(1.0, INERTIA_HELD * (1 + 1 / len(errors))))


def inertia_errors(known: Sequence[Machine]) -> list[float]:
    """Estimate over truth of the rotor's inertia, each estimated from the other machines."""
    found = []
    for machine in known:
        if machine.inertia_kgm2:
            of = typical_of([other for other in known if other is not machine])
            plate = examples(machine)[0].plate
            synchronous_rpm = 60 * plate.frequency_Hz / plate.pole_pairs
            found.append(rotor_kgm2(plate.power_kW, synchronous_rpm, of) / machine.inertia_kgm2)
    return found


def speed_errors(known: Sequence[Machine]) -> list[float]:
    """Estimate over truth of the rated speed from the circuit, each from the other machines."""
    found = []
    for machine in known:
        of = typical_of([other for other in known if other is not machine])
        plate, circuit = (one := examples(machine)[0]).plate, one.circuit
        turned_rad_s = speed_of(plate.base_ohm, plate.power_kW, circuit.lls_H, circuit.lm_H, of)
        found.append(turned_rad_s / (2 * math.pi * plate.frequency_Hz))
    return found


def speed_of(
    base_ohm: float, power_kW: float, leakage_H: float, lm_H: float, of: Typical | None = None
) -> float:
    """Electrical speed at which a machine of this power has the usual leakage and L_m, in units of
    its rated voltage over its rated current. Each of the two says so by itself: their mean, in the
    logarithm."""
    of = of or typical()
    usual_H2 = of.leakage.at(power_kW) * of.main.at(power_kW)
    return base_ohm * math.sqrt(usual_H2 / (leakage_H * lm_H))


def rotor_kgm2(power_kW: float, speed_rpm: float, of: Typical | None = None) -> float:
    """Inertia of the rotor alone."""
    speed_rad_s = speed_rpm * math.pi / 30
    return (of or typical()).starting_s.at(power_kW) * 1e3 * power_kW / speed_rad_s**2


@cache
def spread() -> Spread:
    return spread_of(machines())


def ranges(plate: Nameplate, circuit: Circuit) -> dict[str, tuple[float, float]]:
    """Between which values each constant probably lies."""
    told = bool(plate.power_factor or plate.efficiency)
    return {
        name: (getattr(circuit, name) / factor, getattr(circuit, name) * factor)
        for name, factor in ((name, spread().factors[name][told]) for name in RANGED)
    }
