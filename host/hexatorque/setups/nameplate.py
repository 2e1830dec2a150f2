"""The equivalent circuit of a machine from its nameplate.

`circuit_of` takes a plate on which everything stands that the circuit needs, also the shares of
the losses. The circuit then reproduces the plate exactly: at rated voltage, frequency and speed it
takes the rated current and gives the rated torque. What a real plate leaves open, `estimate` fills
in.

The machine has two three-phase sets. V is the line-to-line voltage and I the line current of each
set. A set in delta is described by the star that takes the same line current: the inverter cannot
tell them apart. With the phase voltage V_ph = V/sqrt 3 and the slip s:

1. Input 6 V_ph I cos(phi), output P, so the losses are known. The rotor's copper takes
   s P_gap with P_gap = (P + friction)/(1 - s). Iron and friction take their shares of the losses.
   The stator's copper takes the rest: R_s = rest/(6 I^2).
2. The circuit has no iron losses: its active current is that of gap power and copper.
3. With the stator leakage X the voltage at the gap is E = V_ph - (R_s + jX) I. The rotor's branch
   R_r/s + jX, with the same leakage, takes P_gap from E: a quadratic equation for R_r/s. The
   magnetising branch takes the rest of the reactive current.
4. X is found by bisection, so that the circuit has the assumed ratio of pull-out torque to rated
   torque.

This is the usual procedure for a single-cage machine with equal leakages (for example M. H. Haque,
"Determination of NEMA design induction motor parameters from manufacturer data", IEEE Trans. Energy
Conversion 23(4), 2008, with the pull-out torque as one of the data), in closed form but for step 4.
The separation of the losses follows IEEE Std 112.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .values import SetupError

SQRT_3 = math.sqrt(3)


class ThreePhase(SetupError):
    """The values are those of a three-phase machine. rewound: what changes when it is rewound to
    six phases, as words of the list."""

    def __init__(self, text: str, rewound: dict[str, str]) -> None:
        super().__init__(text)
        self.rewound = {**rewound, "phases": "6"}


@dataclass(frozen=True)
class Assumed:
    """A value that is missing on a plate, and its usual range."""

    value: float
    low: float
    high: float


IRON = Assumed(0.2, 0.1, 0.3)  #: iron and stray losses, share of all losses
FRICTION = Assumed(0.1, 0.05, 0.15)  #: friction and windage, share of all losses
#: Efficiency times power factor of a motor is above this. If a plate is below when it is taken for
#: that of two sets, it may be that of one: a three-phase machine has twice the product.
LEAST_PRODUCT = 0.45
#: And below this.
MOST_PRODUCT = 0.98
THREE_PHASE = "hexatorque drives six-phase machines only"
#: A leakage reactance is never below this share of voltage over current.
LEAST_LEAKAGE = 0.02


@dataclass(frozen=True)
class Nameplate:
    """Efficiency and power factor at rated load, pull-out torque in rated torques; 0: not on the
    plate. iron, friction: shares of all losses."""

    power_kW: float
    voltage_V: float
    current_A: float
    frequency_Hz: float
    speed_rpm: float
    pole_pairs: int
    power_factor: float = 0.0
    efficiency: float = 0.0
    pull_out: float = 0.0
    iron: float = IRON.value
    friction: float = FRICTION.value

    @property
    def product(self) -> float:
        """Efficiency times power factor, if voltage and current are those of each of two sets."""
        return 1e3 * self.power_kW / (2 * SQRT_3 * self.voltage_V * self.current_A)

    def told(self, **more: float) -> str:
        """The values of every plate, and `more`, as `hexatorque new --nameplate` takes it."""
        values = {
            "power_kW": self.power_kW,
            "voltage_V": self.voltage_V,
            "current_A": self.current_A,
            "frequency_Hz": self.frequency_Hz,
            "speed_rpm": self.speed_rpm,
            "poles": 2 * self.pole_pairs,
            **more,
        }
        return ",".join(f"{name}={value:.6g}" for name, value in values.items())

    @property
    def base_ohm(self) -> float:
        """Rated voltage over rated current of a phase."""
        return self.voltage_V / SQRT_3 / self.current_A

    @property
    def sizes(self) -> str:
        return f"{self.power_kW:g} kW from 2 sets of {self.voltage_V:g} V, {self.current_A:g} A"

    @property
    def may_be_three_phase(self) -> bool:
        """Whether one set gives a better sense than two."""
        if self.efficiency and self.power_factor:
            # As near as `split` asks, to one set's product.
            return abs(self.efficiency * self.power_factor / (2 * self.product) - 1) <= 0.05
        return 0.15 <= self.product < LEAST_PRODUCT

    @property
    def doubt(self) -> str:
        """Why it may be the plate of a three-phase machine."""
        return (
            f"this may be a three-phase machine's plate: {self.power_kW:g} kW from two sets of "
            f"{self.voltage_V:g} V, {self.current_A:g} A are an efficiency times power factor of "
            f"{self.product:.3g}, from one set {2 * self.product:.3g}. {THREE_PHASE}"
        )


@dataclass(frozen=True)
class Circuit:
    """rated: torque, stator flux linkage (amplitude)."""

    rs_ohm: float
    rr_ohm: float
    lls_H: float
    llr_H: float
    lm_H: float
    torque_Nm: float
    flux_Wb: float


#: The slip of a machine at rated load is below this.
MOST_SLIP = 0.3


def slip_of(plate: Nameplate) -> float:
    synchronous_rpm = 60 * plate.frequency_Hz / plate.pole_pairs
    slip = 1 - plate.speed_rpm / synchronous_rpm
    if not 0 < slip < MOST_SLIP:
        raise SetupError(
            f"speed_rpm = {plate.speed_rpm:g}: with {plate.frequency_Hz:g} Hz and "
            f"{2 * plate.pole_pairs} poles the synchronous speed is {synchronous_rpm:g} r/min, "
            f"so allowed is {(1 - MOST_SLIP) * synchronous_rpm:g} .. {synchronous_rpm:g} r/min, "
            "both excluded"
        )
    return slip


def split(plate: Nameplate, efficiency: float = 0.0) -> tuple[float, float]:
    """Efficiency and power factor. The plate's power, voltage and current give their product.
    efficiency: if the plate has neither."""
    product, sizes = plate.product, plate.sizes
    told, factor = plate.efficiency, plate.power_factor
    if product >= MOST_PRODUCT:
        apparent_kVA = plate.power_kW / product
        raise SetupError(
            f"{sizes} ({apparent_kVA:.4g} kVA): efficiency times power factor would be "
            f"{product:.3g}, allowed is below {MOST_PRODUCT:g}; is the current that of one line of "
            "one set?"
        )
    if told and factor:
        if abs(told * factor / product - 1) > 0.05:
            raise SetupError(
                f"efficiency {told:g} times power factor {factor:g} is "
                f"{told * factor:.3g}, but {sizes} give {product:.3g}: they must agree "
                "within 5 %"
            )
        return product / factor, factor
    efficiency = product / factor if factor else told or efficiency
    factor = product / efficiency
    other = "power_factor" if plate.power_factor else "efficiency"
    for name, value in (("efficiency", efficiency), ("power factor", factor)):
        if not 0 < value < 1:
            raise SetupError(
                f"{sizes}: the {name} would be {value:.3g}, allowed is below 1: {other} must be "
                f"above {product:.3g}"
            )
    return efficiency, factor


@dataclass(frozen=True)
class Powers:
    """gap: the power across the air gap; stator: the losses less those of rotor, iron and friction.
    It is negative if the assumed losses of iron and friction are too large."""

    gap_W: float
    stator_W: float


def powers_of(plate: Nameplate, efficiency: float) -> Powers:
    """SetupError if the rotor takes all the losses."""
    slip, power_W = slip_of(plate), 1e3 * plate.power_kW
    losses_W = power_W / efficiency - power_W
    gap_W = (power_W + plate.friction * losses_W) / (1 - slip)
    if slip * gap_W >= (1 - plate.friction) * losses_W:
        raise SetupError(
            f"slip {100 * slip:.3g} % means {slip * gap_W:.4g} W in the rotor, but efficiency "
            f"{efficiency:.3g} leaves {losses_W:.4g} W for all losses: too little for the stator; "
            "check speed_rpm, power and efficiency"
        )
    stator_W = losses_W * (1 - plate.friction - plate.iron) - slip * gap_W
    return Powers(gap_W, stator_W)


def circuit_of(plate: Nameplate) -> Circuit:
    """The circuit per phase of the equivalent star, from a plate that has the pull-out torque and
    efficiency or power factor. SetupError if the plate contradicts itself."""
    efficiency, factor = split(plate)
    powers = powers_of(plate, efficiency)
    if powers.stator_W <= 0:
        raise SetupError("rotor, iron and friction leave nothing of the losses for the stator")
    rs_ohm = powers.stator_W / (6 * plate.current_A**2)
    return circuit_with(plate, factor, powers.gap_W, rs_ohm)


def circuit_with(
    plate: Nameplate, factor: float, gap_W: float, rs_ohm: float, leakage_ohm: float = 0.0
) -> Circuit:
    """The circuit that takes the plate's current at this power factor, with this stator
    resistance. leakage_ohm: without it the pull-out torque gives it; less is taken if the plate
    does not allow so much."""
    slip, omega = slip_of(plate), 2 * math.pi * plate.frequency_Hz
    v_V, i_A = plate.voltage_V / SQRT_3, plate.current_A
    active_A = gap_W / (6 * v_V) + rs_ohm * i_A**2 / v_V
    current = complex(active_A, -i_A * math.sqrt(1 - factor**2))
    # The copper losses go with the size of the current, which lacks the iron's share now.
    rs_ohm *= i_A**2 / abs(current) ** 2
    if leakage_ohm:
        leakage_ohm = _at_most(leakage_ohm, v_V, current, rs_ohm, gap_W)
    else:
        leakage_ohm = _leakage(v_V, current, rs_ohm, gap_W, slip, plate.pull_out)
    xm_ohm, over_slip_ohm = _branches(v_V, current, rs_ohm, gap_W, leakage_ohm)
    torque_Nm = 1e3 * plate.power_kW / (2 * math.pi * plate.speed_rpm / 60)
    flux_Wb = math.sqrt(2) * abs(v_V - rs_ohm * current) / omega
    leakage_H = leakage_ohm / omega
    return Circuit(
        rs_ohm, slip * over_slip_ohm, leakage_H, leakage_H, xm_ohm / omega, torque_Nm, flux_Wb
    )


class _TooMuch(Exception):
    """The leakage does not let the rated power through."""


def _branches(
    v_V: float, current: complex, rs_ohm: float, gap_W: float, x_ohm: float
) -> tuple[float, float]:
    """X_m and R_r/s with this leakage on either side."""
    gap = v_V - (rs_ohm + 1j * x_ohm) * current
    e_V = abs(gap)
    here = current * gap.conjugate() / e_V  # against the voltage at the gap
    active_A, reactive_A = gap_W / (6 * e_V), -here.imag
    root = 1 - (2 * x_ohm * active_A / e_V) ** 2
    if root < 0:
        raise _TooMuch
    over_slip_ohm = e_V / (2 * active_A) * (1 + math.sqrt(root))
    rotor_A = e_V * x_ohm / (over_slip_ohm**2 + x_ohm**2)
    if reactive_A - rotor_A <= 0.02 * abs(current):
        raise _TooMuch
    return e_V / (reactive_A - rotor_A), over_slip_ohm


def pull_out_ratio(
    v_V: float, rs_ohm: float, x_ohm: float, xm_ohm: float, over_slip_ohm: float
) -> float:
    """Largest torque over the torque at this R_r/s, at constant voltage and frequency."""
    turns = 1j * xm_ohm / (rs_ohm + 1j * (x_ohm + xm_ohm))
    source_V = abs(v_V * turns)
    inner = 1j * xm_ohm * (rs_ohm + 1j * x_ohm) / (rs_ohm + 1j * (x_ohm + xm_ohm))
    resistance, reactance = inner.real, inner.imag + x_ohm
    largest = source_V**2 / (2 * (resistance + math.hypot(resistance, reactance)))
    at_load = source_V**2 * over_slip_ohm / ((resistance + over_slip_ohm) ** 2 + reactance**2)
    return largest / at_load


def _nothing_left(current: complex) -> SetupError:
    return SetupError(
        f"a current of {abs(current):.4g} A at power factor "
        f"{current.real / abs(current):.3g} leaves nothing to magnetise the machine: check "
        "current, power factor and efficiency"
    )


def _at_most(
    leakage_ohm: float, v_V: float, current: complex, rs_ohm: float, gap_W: float
) -> float:
    """This leakage, or as much of it as lets the rated power through."""
    least_ohm = LEAST_LEAKAGE * v_V / abs(current)
    while leakage_ohm > least_ohm:
        try:
            _branches(v_V, current, rs_ohm, gap_W, leakage_ohm)
            return leakage_ohm
        except _TooMuch:
            leakage_ohm *= 0.9
    try:
        _branches(v_V, current, rs_ohm, gap_W, least_ohm)
    except _TooMuch:
        raise _nothing_left(current) from None
    return least_ohm


def _leakage(
    v_V: float, current: complex, rs_ohm: float, gap_W: float, slip: float, pull_out: float
) -> float:
    """The more leakage, the less pull-out torque."""

    def ratio(x_ohm: float) -> float:
        xm_ohm, over_slip_ohm = _branches(v_V, current, rs_ohm, gap_W, x_ohm)
        return pull_out_ratio(v_V, rs_ohm, x_ohm, xm_ohm, over_slip_ohm)

    low_ohm, high_ohm = LEAST_LEAKAGE * v_V / abs(current), v_V / abs(current)
    try:
        most = ratio(low_ohm)
    except _TooMuch:
        raise _nothing_left(current) from None
    if most < pull_out:
        raise SetupError(
            f"pull_out = {pull_out:g}: with slip {100 * slip:.3g} % this machine can have "
            f"{most:.3g} times the rated torque at most; check speed_rpm or give pull_out"
        )
    for _ in range(60):
        middle = 0.5 * (low_ohm + high_ohm)
        try:
            enough = ratio(middle) > pull_out
        except _TooMuch:
            enough = False
        low_ohm, high_ohm = (middle, high_ohm) if enough else (low_ohm, middle)
    return low_ohm
