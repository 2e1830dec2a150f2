"""Step a: which wire goes where. Every mistake found is a line that names it.

Each leg in turn gets a short square wave of voltage. The responses of the current channels make a
matrix: channel by leg. A machine has two conductances for such a wave, of the alpha-beta plane and
of the x-y plane. For each of the 720 orders of the six leads they are fitted to the matrix.

If an order explains the matrix, the sensors are right, and it is the order of the leads. If none
does, a sensor is wrong: a channel then measures the leg at which it answers most, and the answer's
sign is the sensor's.

A leg that drives no current, or one way only, changes the response of every channel, so that
nothing else can be concluded: only this leg is named.

Exchanging the two planes is an order of the leads as well, and looks the same with the planes'
conductances exchanged. Two things tell them apart. The alpha-beta plane, with the rotor's leakage
too, mostly conducts less. And in a longer wave the rotor's resistance adds to the stator's there.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ..plant.vsd import INVERSE, PHASES, SETS, TRANSFORM
from .excitation import FRAME, CommissioningError, Excitation, Frame, Samples, frame, half_wave_Hz
from .regression import linear

#: Half-waves of the short wave, fast interrupts. Shorter than the machine's time constants.
SHORT_TICKS = 5
#: The same of the longer wave, seconds.
LONG_S = 0.006
#: Currents aimed at, share of the stated limit: a sensor may show less than the half.
AIM = 0.3
#: The voltage grows by this factor until the current is there.
GROWTH = 1.4
#: A channel or leg below this share of the largest answer is dead.
DEAD = 0.15
#: A current of the wave that has less than this share of its size in one direction flows one way
#: only. One of a whole leg has 0.6 or more, also beside a leg that lacks a switch.
ONE_WAY = 0.25
#: Gains of two channels may differ by this share.
GAIN = 0.2
#: An order may leave so much unexplained, share of the matrix's rms: readings are noisy, a stator
#: may be asymmetrical, and small currents lose less to the dead time than large ones.
UNEXPLAINED = 0.18
#: Angles between the sets that the firmware knows.
DISPLACEMENTS_DEG = (30.0, 0.0, 60.0)
#: Leads are taken as right if no other order has a remainder below this share of theirs.
BETTER = 0.6

ORDERS = np.array(list(itertools.permutations(range(6))))
#: A wave on one leg comes without its star's zero sequence, which is seen if leads of the two stars
#: are exchanged.
_APPLIED = INVERSE @ TRANSFORM
#: Parts of the conductance in a plane: the same along both axes; and, of a salient rotor, the axes'
#: difference and their coupling.
_PARTS = (np.eye(2), np.diag([1.0, -1.0]), np.array([[0.0, 1.0], [1.0, 0.0]]))


def shapes(winding: Frame = FRAME, salient: bool = False) -> list[np.ndarray]:
    """Conductances between the phases of a machine, (6, 6) each: of the alpha-beta and of the x-y
    plane, and of a salient rotor's two further parts in alpha-beta."""
    t, inverse = winding.transform, winding.inverse
    return [
        inverse[:, :2] @ _PARTS[0] @ t[:2], inverse[:, 2:] @ _PARTS[0] @ t[2:],
        *(inverse[:, :2] @ part @ t[:2] for part in _PARTS[1:] if salient),
    ]  # fmt: skip


_SHAPES = shapes()


def machine_per_H(ab_per_H: float, xy_per_H: float) -> np.ndarray:
    """The answer of a machine with these conductances if all is right, (6 channels, 6 legs)."""
    return (ab_per_H * _SHAPES[0] + xy_per_H * _SHAPES[1]) @ _APPLIED


@dataclass(frozen=True)
class Wiring:
    mistakes: tuple[str, ...]
    response_per_H: np.ndarray  #: (6 channels, 6 legs): d i/dt over voltage
    ab_per_H: float = 0.0  #: 1/(sigma L_s), roughly
    xy_per_H: float = 0.0  #: 1/L_xy, roughly
    salient_per_H: float = 0.0  #: by so much 1/L is more and less along a salient rotor's axes


def check(test: Excitation) -> Wiring:
    """Sensors and leads; if they seem right, also whether the planes are exchanged."""
    own = shapes(test.frame)
    found = _other_winding(test, _decided(test, own), own, False)
    if not found.mistakes and exchanged(test, found):
        swapped = _words(_other_planes(found.response_per_H, own))
        return replace(found, mistakes=swapped)
    return found


def check_magnets(test: Excitation) -> Wiring:
    """The same of a machine whose rotor has magnets and may be salient; and the angle between its
    sets. The plane with the rotor conducts less: without its own leakage path, the air gap."""
    own = shapes(test.frame, True)
    found = _other_winding(test, _decided(test, own), own, True)
    if not found.mistakes and found.ab_per_H > found.xy_per_H:
        return replace(found, mistakes=_words(_other_planes(found.response_per_H, own)))
    return found


def _other_winding(test: Excitation, found: Wiring, own: list[np.ndarray], salient: bool) -> Wiring:
    """The angle between the sets as the only mistake, if right leads with another one explain more
    than any order of the leads with the drive's."""
    response = found.response_per_H
    if without_current(response):
        return found
    left = {deg: _straight(response, frame(deg), salient) for deg in DISPLACEMENTS_DEG}
    best = min(left, key=lambda deg: left[deg])
    other_leads = float(fit(response, np.arange(6), own).unexplained.min())
    if left[best] >= min(UNEXPLAINED, BETTER * other_leads):
        return found
    line = (
        f"winding: its sets are {best:g} degrees apart, displacement_deg says "
        f"{test.frame.displacement_deg:g}: set displacement_deg = {best:g}"
    )
    return replace(found, mistakes=(line,))


def _straight(response: np.ndarray, winding: Frame, salient: bool) -> float:
    """The unexplained share of right leads of a winding."""
    return float(fit(response, np.arange(6), shapes(winding, salient), ORDERS[:1]).unexplained[0])


def _decided(test: Excitation, parts: list[np.ndarray]) -> Wiring:
    waves = _waves(test)
    response = _matrix(waves)
    if not without_current(response) and (mistakes := one_way(waves, response)):
        return Wiring(tuple(mistakes), response)
    return decide(response, parts)


def decide(response: np.ndarray, parts: list[np.ndarray] = _SHAPES) -> Wiring:
    """The mistakes that the matrix alone shows."""
    every = np.arange(6)
    fits = fit(response, every, parts)
    if fits.unexplained.min() < UNEXPLAINED:
        return _leads(response, fits, [])
    if mistakes := without_current(response):
        return Wiring(tuple(mistakes), response)
    mistakes, legs, scale = sensors(response)
    read = np.flatnonzero(scale)
    fits = fit(response[read] / scale[read, None], legs[read], parts)
    if fits.unexplained.min() < UNEXPLAINED:
        return _leads(response, fits, mistakes)
    mistakes.append(
        "the currents fit no order of leads and sensors: correct the named mistakes, or check each "
        "lead and sensor, and try again"
    )
    return Wiring(tuple(mistakes), response)


def _leads(response: np.ndarray, fits: Fits, mistakes: list[str]) -> Wiring:
    best = fits.unexplained.min()
    chosen = 0  # permutations() begins with the straight order
    if fits.unexplained[0] * BETTER > best:
        chosen = _simplest(fits)
    mistakes = [*mistakes, *_words(ORDERS[chosen])]
    ab, xy, *more = (float(part) for part in fits.parts[chosen])
    return Wiring(tuple(mistakes), response, ab, xy, float(np.hypot.reduce([0.0, *more])))


def _simplest(fits: Fits) -> int:
    """Among the orders that fit alike, the one with the fewest leads to move; first those whose
    alpha-beta plane conducts less."""
    alike = np.flatnonzero(fits.unexplained <= 1.2 * fits.unexplained.min() + 1e-9)
    moved = (ORDERS[alike] != np.arange(6)).sum(1)
    return int(alike[np.argmin(moved + 10 * (fits.ab[alike] > fits.xy[alike]))])


def _other_planes(response: np.ndarray, parts: list[np.ndarray]) -> np.ndarray:
    """The order that fits with the planes exchanged, as against the straight one."""
    fits = fit(response, np.arange(6), parts)
    alike = np.flatnonzero(fits.unexplained <= 1.2 * fits.unexplained[0] + 1e-9)
    other = alike[(fits.ab[alike] > fits.xy[alike]) != (fits.ab[0] > fits.xy[0])]
    moved = (ORDERS[other] != np.arange(6)).sum(1)
    return ORDERS[other[np.argmin(moved)]]


# -- which plane has the rotor ---------------------------------------------------------------


def exchanged(test: Excitation, found: Wiring) -> bool:
    """Whether the supposed x-y plane shows more resistance than the alpha-beta plane."""
    alpha, x = (
        _resistance(test, axis, per_H) for axis, per_H in ((0, found.ab_per_H), (2, found.xy_per_H))
    )
    return x > alpha


def _resistance(test: Excitation, axis: int, per_H: float) -> float:
    """Effective resistance of an axis in a wave of some milliseconds."""
    hertz = half_wave_Hz(test.f_isr_Hz, round(LONG_S * test.f_isr_Hz))
    vector = np.zeros(4)
    aim_A = AIM * test.limits.current_A
    volts = aim_A / per_H * 4 * hertz * 0.3
    while True:
        vector[axis] = volts
        wave = test.pulse(vector, "square", hertz, 3 / hertz)
        test.rest(1 / hertz)
        if np.abs(_around(wave)).max() >= aim_A or volts >= test.most_pu * float(wave.vdc_V.mean()):
            break
        volts *= 1.3
    i = wave.i_vsd_A[:, axis]
    middle = 0.5 * (i[1:] + i[:-1])
    slope = np.diff(i) / wave.dt_s
    (_, ohm, _), _ = linear([slope, middle, np.sign(middle)], wave.v_V[:, axis])
    return ohm.value


# -- the matrix ------------------------------------------------------------------------------


def measure(test: Excitation) -> np.ndarray:
    """Slope of every channel per volt on every leg, (6, 6)."""
    return _matrix(_waves(test))


def _matrix(waves: list[Samples]) -> np.ndarray:
    return np.column_stack([_slopes(wave, leg) for leg, wave in enumerate(waves)])


def _waves(test: Excitation) -> list[Samples]:
    """A short wave on each leg in turn."""
    vdc_V = test.vdc_V
    hertz = half_wave_Hz(test.f_isr_Hz, SHORT_TICKS)
    volts = 0.01 * vdc_V
    while True:
        waves = [_wave(test, test.on_leg(leg, volts), hertz) for leg in range(6)]
        largest_A = max(np.abs(_around(wave)).max() for wave in waves)
        if largest_A >= AIM * test.limits.current_A or volts >= test.most_pu * vdc_V:
            break
        volts = min(GROWTH * volts, test.most_pu * vdc_V)
    if largest_A < 0.02 * test.limits.current_A:
        raise CommissioningError(
            f"no current at {volts:.0f} V on each leg in turn: are motor, gate drivers and current "
            "sensors connected, and does --current suit the sensors' range?"
        )
    return waves


def _wave(test: Excitation, vector_V: np.ndarray, hertz: float) -> Samples:
    wave = test.pulse(vector_V, "square", hertz, 6 / hertz)
    test.rest(2 / hertz)
    return wave


def _around(wave: Samples) -> np.ndarray:
    """The currents less those before the wave."""
    return wave.i_A - wave.i_A[0]


def _slopes(wave: Samples, leg: int) -> np.ndarray:
    """d i/dt over the voltage on this leg: (6,). The current changes its sign in the middle of
    each half-wave, so dead time and resistance cancel."""
    v = wave.v_V @ INVERSE[leg] / (TRANSFORM[:, leg] @ INVERSE[leg])
    slope = np.diff(wave.i_A, axis=0) / wave.dt_s
    steady = np.ones(len(v), bool)  # not across an edge: sensors have a delay
    steady[1:] = v[1:] == v[:-1]
    whole = steady & (np.abs(v) > 0)
    return v[whole] @ slope[whole] / (v[whole] @ v[whole])


# -- legs without a current ------------------------------------------------------------------


def without_current(response: np.ndarray) -> list[str]:
    """The legs whose voltage drives no current. Two open leads of a star leave its third phase
    without a current, too."""
    size = np.abs(response).max(0)
    dead = size < DEAD * size.max()
    mistakes = []
    for star in SETS:
        names = [PHASES[leg] for leg in star if dead[leg]]
        if len(names) == len(star):
            mistakes.append(
                f"legs {', '.join(names)}: their voltages drive no current: two of their leads or "
                "all three are open, or their gates do not switch"
            )
        else:
            mistakes += [
                f"leg {name}: its voltage drives no current: lead open, or its gates do not switch"
                for name in names
            ]
    return _first(mistakes)


def one_way(waves: list[Samples], response: np.ndarray) -> list[str]:
    """The legs one of whose switches stays off. The wave's current then flows through the other
    one and its diode only."""
    mistakes = []
    for leg, wave in enumerate(waves):
        out_A, into_A = wave.i_A.max(0), -wave.i_A.min(0)
        channel = int(np.argmax(np.maximum(out_A, into_A)))
        small_A, large_A = sorted((out_A[channel], into_A[channel]))
        if small_A < ONE_WAY * large_A:
            out = (out_A[channel] > into_A[channel]) == (response[channel, leg] > 0)
            mistakes.append(
                f"leg {PHASES[leg]}: its current flows one way only: its "
                f"{'lower' if out else 'upper'} switch stays off"
            )
    return _first(mistakes)


def _first(mistakes: list[str]) -> list[str]:
    if mistakes:
        mistakes[-1] += "; further mistakes show only when this one is corrected"
    return mistakes


# -- sensors ---------------------------------------------------------------------------------


def sensors(response: np.ndarray) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Mistakes of the current sensors if the leads are right; the leg that each channel measures;
    and each channel's scale, with sign, 0 if it reads nothing."""
    size = np.abs(response)
    answers = size.max(1)
    legs = size.argmax(1)
    usual = float(np.median(answers))
    scale = response[np.arange(6), legs] / usual
    scale[np.abs(scale) < DEAD] = 0.0
    mistakes: list[str] = []
    for channel, name in enumerate(PHASES):
        if scale[channel] == 0.0:
            mistakes.append(f"current sensor {name}: reads nothing: open, or without supply")
            continue
        if legs[channel] != channel:
            mistakes.append(f"current sensor {name}: measures leg {PHASES[legs[channel]]}")
        if scale[channel] < 0:
            mistakes.append(f"current sensor {name}: has the wrong sign")
        if abs(abs(scale[channel]) - 1) > GAIN:
            mistakes.append(
                f"current sensor {name}: reads {abs(scale[channel]):.2f} times the others' "
                "value: another range, or a phase of another inductance"
            )
    return mistakes, legs, scale


# -- leads -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fits:
    """For each order of the leads."""

    parts: np.ndarray  #: (n, parts): conductances, 1/H
    unexplained: np.ndarray  #: rms of what they do not explain, share of the matrix's

    @property
    def ab(self) -> np.ndarray:
        return self.parts[:, 0]

    @property
    def xy(self) -> np.ndarray:
        return self.parts[:, 1]


def fit(
    rows: np.ndarray,
    legs: np.ndarray,
    parts: list[np.ndarray] = _SHAPES,
    orders: np.ndarray = ORDERS,
) -> Fits:
    """`rows`: answers of sensors on these legs to the wave on each leg, (n, 6)."""
    columns = np.stack(
        [
            (part[orders[:, legs, None], orders[:, None, :]] @ _APPLIED).reshape(len(orders), -1)
            for part in parts
        ],
        -1,
    )
    target = rows.ravel()
    factors = np.linalg.pinv(columns) @ target
    rest = target - np.einsum("ijk,ik->ij", columns, factors)
    return Fits(factors, np.sqrt((rest * rest).mean(1) / (target * target).mean()))


def _words(order: np.ndarray) -> tuple[str, ...]:
    return tuple(
        f"motor lead: leg {PHASES[leg]} feeds phase {PHASES[phase]}"
        for leg, phase in enumerate(order)
        if leg != phase
    )
