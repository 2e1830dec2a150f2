"""The review of a set-up before anything runs: `hexatorque check`.

Every finding compares a value with a limit and says what to change. The values follow from the
set-up by formulas, without simulation; the mean torque under a switching table from the firmware's
law (`mean_torque`). A limit beyond which the drive cannot do its work, or may
trip, is "bad"; one beyond which it works, but not well, is a "note". Where an estimate decides
whether something of a scheme is bad, or the worst moment alone would trip, it is "doubtful".
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

from .. import chips
from .._firmware import lib
from .derived import (
    CLEAN_FROM,
    DEVICES,
    F_ISR_FAST_HZ,
    I_TRIP_SHARE,
    LEAST_INERTIA,
    OPEN,
    UNTOLD_EMF,
    WRITTEN_WITHIN,
    Known,
    device_rise_K,
    has_chains,
    standing_leg_W,
    write_delay_us,
)
from .design import (
    PULL_OUT_SHARE,
    REACH_PU,
    SPEED_HELD,
    USABLE,
    VECTOR_PU,
    Demand,
    Design,
    rad_s,
    rpm,
)
from .doubts import MEASURED_BY, judged
from .estimate import MAIN_OVER_LEAKAGE, PRODUCT, published_kW, rotor_kgm2, speed_of, typical, usual
from .finding import NOT_READY, Finding
from .keys import ESTIMATED, KEYS
from .mean_torque import held
from .published import equal_leakages
from .setup import Setup
from .short_pulses import Changed, of_modulator, of_table
from .to_parameters import parameters
from .values import SetupError

if TYPE_CHECKING:
    from ..firmware import Controller

COS_15 = math.cos(math.pi / 12)
#: Of copper, as the firmware has it.
PER_K = lib.HT_NUMBER_COPPER_PPM_K * 1e-6
#: x-y flux of a drive that applies large vectors alone, in units of its flux: each vector turns
#: the x-y plane's by 150 degrees, and lasts for a twelfth of a turn. Peak of the star that this
#: draws: 0.5176 0.1725/0.622 pi/6.
XY_FLUX_OF_LARGE = 0.075
#: Peak of the errors that add up in x-y, in standard deviations: sqrt(2 ln n) is to be expected of
#: n independent values, and the errors are new ones some hundred times in a few seconds.
XY_PEAK = 3.5
#: Transitions of all legs in a period, at most and in the mean, divided by the twelve of f_sw.
SWITCHING = {"single": 1 / 6, "pair": 1 / 5, "virtual L": 1 / 3, "virtual ML": 2 / 3}
#: Time constant that is proposed to bring the mean torque to its reference.
MEAN_S = 2.0
#: A mean torque that is further from its reference, in % of it, is a note.
HELD_PCT = 5.0
#: Share of the voltage, rms, that the shortest pulse may change.
CHANGED = 0.05
#: Beginnings of subjects that others look for.
SHORT_PULSES = "voltage that min_pulse_us changes, rms, in % of the reference"
MEAN_PCT = "mean torque less its reference, in % of it"
MEAN_NM = "mean torque less its reference"
REACH = "reach with the full flux"
PEAK = "current at the torque limit, ripple and x-y current"
#: Of the trip: a machine whose values are so far off may reach it.
NEAR = 0.85
#: Gain of the x-y loop in one period that leaves a margin to where it is unstable.
XY_GAIN_MOST = 0.9
SWITCHES = "switching frequency at full voltage, about"
#: The level that is proposed for braking lies at this share of the way from the source's voltage to
#: the highest one, with a band of the second share at least.
LEVEL_SHARE, BAND_SHARE = 0.8, 0.2
#: A lower level must be above this share of vdc_min_V (VDC_LOW), and a margin.
LOW_SHARE = 1.05


def at_most(
    subject: str, value: float, limit: float, unit: str, advice: str, beyond: str = "bad"
) -> Finding:
    held = value <= limit
    return Finding(
        subject, value, "<=", limit, unit, "ok" if held else beyond, "" if held else advice
    )


def at_least(
    subject: str, value: float, limit: float, unit: str, advice: str, beyond: str = "bad"
) -> Finding:
    held = value >= limit
    return Finding(
        subject, value, ">=", limit, unit, "ok" if held else beyond, "" if held else advice
    )


def graded(
    subject: str, value: float, limit: float, worst: float, unit: str, advice: str
) -> Finding:
    """A note beyond the limit, bad beyond the worst."""
    if value > worst:
        return at_most(subject, value, worst, unit, advice)
    return at_most(subject, value, limit, unit, advice, "note")


def review(setup: Setup, schemes: Iterable[str], steady: bool = True) -> list[Finding]:
    """All findings: those of the set-up, then those of each scheme. steady: with the mean torque in
    steady state, which takes longest, and is never bad."""
    values = parameters(setup)
    design = Design(setup, values.__getitem__)
    findings = [
        *(_of_magnets(design) if design.magnets else _believable(design)),
        *_fits(design),
        *_link(design),
        *(_currents_of_magnets(design) if design.magnets else _currents(design)),
        *_loops(design),
        *_speed(design),
        *_power_stage(design),
        *_proposed_heat(design),
    ]
    for name in schemes:
        found = [*_judged(design, name), *(_steady(setup, design, name) if steady else ())]
        findings += [replace(f, scheme=name) for f in _mended(setup, design, name, found)]
    findings = _with_others(findings)
    return [*findings, *_refused(setup, findings)]


def verdict_of(findings: Iterable[Finding], scheme: str) -> str:
    """ "bad" if something of the scheme or of the set-up is, else "doubtful" if something of the
    scheme is, else "ready"."""
    found = {f.verdict for f in findings if f.scheme in ("", scheme)}
    return next((verdict for verdict in NOT_READY if verdict in found), "ready")


def ready_of(findings: Iterable[Finding], schemes: Iterable[str], kind: str = "ready") -> list[str]:
    """The schemes that are ready, or of another kind."""
    findings = list(findings)
    return [scheme for scheme in schemes if verdict_of(findings, scheme) == kind]


def best(findings: Iterable[Finding], schemes: Iterable[str]) -> tuple[str, str]:
    """The best scheme that is ready, with the reason; if none is, of those that are doubtful; empty
    if there are none. That is the one with the fewest notes (a current near the trip counts as
    one), of these the one that holds its mean torque best, to a tenth of a percent, then the one
    with the largest reach."""
    findings, schemes = list(findings), list(schemes)
    kind = "ready" if ready_of(findings, schemes) else "doubtful"
    ready = ready_of(findings, schemes, kind)

    def value(scheme: str, subject: str) -> float:
        found = [f.value for f in findings if f.scheme == scheme and f.subject.startswith(subject)]
        return found[0] if found else math.nan

    def notes(scheme: str) -> int:
        return sum(f.scheme == scheme and f.verdict == "note" for f in findings)

    def near_trip(scheme: str) -> bool:
        return any(
            f.scheme == scheme and f.subject == PEAK and f.value > NEAR * f.limit for f in findings
        )

    def rank(scheme: str) -> tuple[float, float, float]:
        percent = value(scheme, MEAN_PCT)
        held = round(abs(percent), 1) if math.isfinite(percent) else 0.0
        return notes(scheme) + near_trip(scheme), held, -value(scheme, REACH)

    if not ready:
        return "", ""
    first = min(ready, key=rank)
    count = notes(first)
    parts = [
        "no note" if count == 0 else f"{count} note{'s' if count > 1 else ''}",
        f"mean torque within {max(0.1, rank(first)[1]):.1f} % of its reference",
        f"full flux up to {value(first, REACH):.0f} r/min",
        f"switches at about {1e-3 * value(first, SWITCHES):.3g} kHz",
    ]
    return first, f"best of {len(ready)} that are {kind}: {', '.join(parts)}"


def none_ready(findings: Iterable[Finding], schemes: Iterable[str]) -> str:
    """Why none of these is ready, and the remedy: of the set-up; else of the scheme of which
    the fewest findings are bad."""
    bad = [f for f in findings if f.verdict == "bad"]
    near = min(schemes, key=lambda scheme: sum(f.scheme == scheme for f in bad))
    of = [f for f in bad if not f.scheme] or [f for f in bad if f.scheme == near]
    nearest = f", {near} is nearest" if of[0].scheme else ""
    helps = "; ".join(dict.fromkeys(f.advice for f in of))
    return f"none is ready{nearest}: {', '.join(map(_why, of))}; remedy: {helps}"


def _with_others(findings: list[Finding]) -> list[Finding]:
    """Advice about a scheme that is not in order names those that are."""
    names = list(dict.fromkeys(f.scheme for f in findings if f.scheme))
    ready = ready_of(findings, names)
    off = {f.scheme for f in findings if f.subject.startswith(MEAN_PCT) and f.verdict == "note"}
    hold = [name for name in ready if name not in off]
    first, _ = best(findings, names)

    def advised(f: Finding) -> Finding:
        if f.scheme and first and (f.verdict == "bad" or (ready and f.verdict == "doubtful")):
            return replace(f, advice=f"{f.advice}; {'or ' if f.sign else ''}take {first}")
        if f.subject.startswith(MEAN_PCT) and f.verdict == "note" and hold:
            return replace(f, advice=f"{f.advice}; or take {' or '.join(hold[:3])}")
        return f

    return [advised(f) for f in findings]


def _mended(setup: Setup, d: Design, name: str, found: list[Finding]) -> list[Finding]:
    """Where the faster sampling alone makes a scheme ready, the advice says so."""
    wrong = [f for f in found if f.verdict in NOT_READY]
    if not wrong or d.parameter("f_isr_Hz") >= F_ISR_FAST_HZ:
        return found
    try:
        faster = setup.changed(controller__f_isr_Hz=F_ISR_FAST_HZ)
    except SetupError:
        return found
    other = Design(faster, parameters(faster).__getitem__)
    if any(f.verdict in NOT_READY for f in (*_fits(other), *_judged(other, name))):
        return found
    told = f"set controller.f_isr_Hz = {F_ISR_FAST_HZ:g}: {name} is ready then"

    def helped(f: Finding) -> Finding:
        return replace(f, advice=told if f.verdict == "bad" else f"{f.advice}, or {told}")

    return [helped(f) if f in wrong else f for f in found]


def _judged(d: Design, name: str) -> list[Finding]:
    """The findings of a scheme, and what estimates leave open about them."""
    return judged(d, lambda other: list(_scheme(other, name)))


def refuse_impossible(setup: Setup) -> None:
    """SetupError with a line for each mistake: numbers that no machine has."""
    design = Design(setup, parameters(setup).__getitem__)
    checked = _of_magnets(design) if design.magnets else _believable(design)
    lines: list[str] = []
    named: set[str] = set()
    for f in checked:
        keys = re.findall(r"(?:machine|rated|inverter|controller)\.\w+", f.advice)
        if f.verdict == "bad" and not named & set(keys[:1]):
            lines.append(f"{_why(f)}: {f.advice}")
            named |= set(keys)
    if lines:
        raise SetupError("\n".join(lines))


#: The least ratio of main to leakage inductance that any machine has: of the published
#: machines the least is 7.6.
LEAST_MAIN = 3.0
#: Largest share of the voltage that the rated current takes in a winding's resistance: of published
#: machines 0.12.
MOST_RESISTANCE = 0.5
#: Flux that the rated current makes in L_d, in units of the magnets'. The built-in machines have
#: 0.15 to 0.75; one whose L_d was typed in mH has a thousand times as much.
MOST_ARMATURE = 10.0


def _believable(d: Design) -> Iterator[Finding]:
    """Numbers that no machine has. What one mistake makes wrong is one finding that is bad."""
    m = d.unsaturated
    ratios = {side: m.lm_H / getattr(m, side) for side in ("lls_H", "llr_H")}
    least = min(ratios, key=ratios.__getitem__)
    for side, ratio in ratios.items():
        if side == least or ratio >= LEAST_MAIN:
            yield at_least(
                f"lm_H over {side}", ratio, LEAST_MAIN, "",
                f"no machine has such a ratio: are machine.lm_H and machine.{side} exchanged?",
            )  # fmt: skip
    shares = {side: getattr(m, side) * _over_voltage_A(d) for side in ("rs_ohm", "rr_ohm")}
    resistive = [side for side, share in shares.items() if share > MOST_RESISTANCE]
    if len(resistive) == 2:
        yield _too_much_current(d)
    else:
        for side, share in shares.items():
            yield at_most(
                f"{side} times rated current over the voltage", share, MOST_RESISTANCE, "",
                _too_resistive(d, side, getattr(m, side)),
            )  # fmt: skip
    if not resistive:
        yield from _stated_torque(d)
    if len(resistive) < 2 and ratios[least] >= LEAST_MAIN:
        yield from _usual(d)
    yield from _as_built(d)


def _over_voltage_A(d: Design) -> float:
    """Rated current over the voltage of a phase, amplitudes, 1/ohm."""
    return d.rated_A / (REACH_PU * d.vdc_V)


def _exchanged(d: Design, ohm: float) -> str:
    """The question whether voltage and current are exchanged, where this helps; else nothing."""
    current_A, vdc_V = d.setup["rated.current_A"], d.setup["inverter.vdc_V"]
    if math.sqrt(2) * vdc_V * ohm < 0.5 * MOST_RESISTANCE * REACH_PU * current_A:
        return f"are rated.current_A = {current_A:g} and inverter.vdc_V = {vdc_V:g} exchanged?"
    return ""


def _too_resistive(d: Design, side: str, ohm: float) -> str:
    if exchanged := _exchanged(d, ohm):
        return f"check machine.{side}; or {exchanged}"
    needed_V = d.machine.pole_pairs * rad_s(d.rated_rpm) * d.flux_Wb / (USABLE * REACH_PU)
    fits = f" ({needed_V:.3g} V turn the flux at rated speed)" if needed_V > d.vdc_V else ""
    return f"no machine has so much: check machine.{side}, rated.current_A and inverter.vdc_V{fits}"


def _too_much_current(d: Design) -> Finding:
    """Both resistances take too much voltage, so voltage or current is wrong. Each alone can be so
    that R_s is the usual one. The right one of the two has a power that machines have."""
    m, current_A, vdc_V = d.unsaturated, d.rated_A / math.sqrt(2), d.vdc_V
    worst_ohm = max(m.rs_ohm, m.rr_ohm)
    line = typical().rs  # R_s = at_1kW (n V I)^exponent k V/I, with the amplitudes k V and I
    k = USABLE * REACH_PU
    n = PRODUCT * 3e-3 * k
    unit = line.at_1kW * k * n**line.exponent
    fits_V = (m.rs_ohm / unit * d.rated_A ** (1 - line.exponent)) ** (1 / (1 + line.exponent))
    fits_A = (unit / m.rs_ohm * vdc_V ** (1 + line.exponent)) ** (1 / (1 - line.exponent))

    def far(vdc_V: float, rated_A: float) -> float:
        """From the powers that published machines have, as a logarithm."""
        low_kW, high_kW = published_kW()
        power_kW = n * vdc_V * rated_A
        return max(0.0, math.log(low_kW / power_kW), math.log(power_kW / high_kW))

    least_V = worst_ohm * d.rated_A / (MOST_RESISTANCE * REACH_PU)
    most_A = MOST_RESISTANCE * REACH_PU * vdc_V / worst_ohm / math.sqrt(2)
    advice, against = _exchanged(d, min(m.rs_ohm, m.rr_ohm)), "the voltage across the resistances"
    if far(fits_V, d.rated_A) <= far(vdc_V, fits_A):
        advice = advice or (
            f"about {fits_V:.3g} V would fit; else check rated.current_A = {current_A:.3g}, "
            "machine.rs_ohm and machine.rr_ohm"
        )
        return at_least(f"inverter.vdc_V against {against}", vdc_V, least_V, "V", advice)
    advice = advice or (
        f"about {fits_A / math.sqrt(2):.3g} A would fit; else check inverter.vdc_V = {vdc_V:g}, "
        "machine.rs_ohm and machine.rr_ohm"
    )
    return at_most(f"rated.current_A against {against}", current_A, most_A, "A", advice)


#: Stated rated torque over what the stated rated current makes if all of it lies across the flux.
#: Machines have 0.6 to 0.9. The flux may be less exact than the two.
MOST_TORQUE, LEAST_TORQUE, USUAL_TORQUE = 2.0, 0.2, 0.8
TORQUE = "rated.torque_Nm over what rated.current_A makes at most"


def _stated_torque(d: Design) -> Iterator[Finding]:
    """The stated torque against the stated current."""
    torque_Nm, current_A = d.setup["rated.torque_Nm"], d.setup["rated.current_A"]
    if torque_Nm <= 0 or current_A <= 0:
        return
    most_Nm = 3 * d.machine.pole_pairs * d.steady_Wb * math.sqrt(2) * current_A
    fits_Nm = d.torque_of_current_Nm(math.sqrt(2) * current_A) or USUAL_TORQUE * most_Nm
    ratio = torque_Nm / most_Nm
    advice = (
        f"about {fits_Nm:.2g} N m fit: check rated.torque_Nm = {torque_Nm:g}, and "
        f"rated.current_A = {current_A:g} (an rms value)"
    )
    if ratio < LEAST_TORQUE:
        yield at_least(TORQUE, ratio, LEAST_TORQUE, "", advice, "note")
    else:
        yield at_most(TORQUE, ratio, MOST_TORQUE, "", advice)


def _no_torque(d: Design) -> bool:
    """Whether the stated rated torque cannot be."""
    return any(f.verdict == "bad" for f in _stated_torque(d))


def _as_built(d: Design) -> Iterator[Finding]:
    """A finding that no tuning changes: the drive must know the machine's value."""
    for name in ("pole_pairs", "displacement_deg"):
        believed, true = float(d.parameter(name)), getattr(d.unsaturated, name)
        yield at_most(
            f"controller.{name} unlike the machine's", abs(believed - true), 0, "",
            f"remove controller.{name}",
        )  # fmt: skip


#: How much further from the published machines' line than the furthest of them an element is a
#: note, and how much further than that it is bad.
FURTHER, FAR = 1.25, 2.0
#: Largest ratio of the two leakages: 1.25 times that of any published machine.
MOST_UNEQUAL = 3.1
#: Of subjects: what `unusual` looks for.
UNUSUAL, UNEQUAL = "over its usual value", "lls_H over llr_H"


def _usual(d: Design) -> Iterator[Finding]:
    """Each element in units of rated voltage, current and frequency against published machines of
    this power. Without stated rated values the machine's are not known: those of the design follow
    from point and profile. Without rated flux and speed the dc link says which voltage it has;
    where the speed is not told, L_m and leakage are compared with each other. Bad only with rated
    current, speed and flux stated, and at a power that published machines have: else the units
    themselves may be off."""
    stated = {name for name in KEYS["rated"] if d.setup[f"rated.{name}"] > 0}
    if not stated & {"current_A", "torque_Nm"}:
        return
    m, omega = d.machine, d.machine.pole_pairs * rad_s(d.rated_rpm)
    voltage_V, power_kW = omega * d.flux_Wb, 1e-3 * d.rated_Nm * rad_s(d.rated_rpm)
    others = "the values of [rated]"
    if "current_A" in stated and not {"speed_rpm", "flux_Wb"} <= stated:
        others += " and inverter.vdc_V"
        voltage_V = USABLE * REACH_PU * d.vdc_V
        power_kW = PRODUCT * 3e-3 * voltage_V * d.rated_A
    if power_kW <= 0:
        return
    rr_ohm, leakage_H, lm_H = equal_leakages(m.rr_ohm, m.lls_H, m.llr_H, m.lm_H)
    low_kW, high_kW = published_kW()
    sure = {"current_A", "speed_rpm", "flux_Wb"} <= stated and low_kW <= power_kW <= high_kW
    base_ohm = voltage_V / d.rated_A
    elements = [
        ("R_s", "machine.rs_ohm", m.rs_ohm, base_ohm, " ohm"),
        ("R_r", "machine.rr_ohm", rr_ohm, base_ohm, " ohm"),
    ]
    if omega > 0 and ({"speed_rpm", "flux_Wb"} & stated or "current_A" not in stated):
        base_H = base_ohm / omega
        elements += [
            ("leakage", "machine.lls_H and machine.llr_H", leakage_H, base_H, " H"),
            ("L_m", "machine.lm_H", lm_H, base_H, " H"),
        ]
        speed_rad_s = omega
    else:
        speed_rad_s = speed_of(base_ohm, power_kW, leakage_H, lm_H)
        keys = "machine.lm_H, machine.lls_H and machine.llr_H"
        elements.append((MAIN_OVER_LEAKAGE, keys, lm_H / leakage_H, 1.0, ""))
    for name, keys, value, base, unit in elements:
        of = usual()[name]
        usual_value = of.line.at(power_kW) * base
        ratio, limit = value / usual_value, FURTHER * of.furthest
        bad = sure and max(ratio, 1 / ratio) > FAR * limit
        finding = at_most if ratio >= 1 else at_least
        yield finding(
            f"{name} {UNUSUAL} at {power_kW:.2g} kW",
            ratio, limit if ratio >= 1 else 1 / limit, "",
            f"usual is {usual_value:.3g}{unit}: check {keys}, and {others}",
            "bad" if bad else "note",
        )  # fmt: skip
    if d.tag("inertia_kgm2") != ESTIMATED:
        yield _inertia(d, power_kW, rpm(speed_rad_s / d.machine.pole_pairs))
    ratio = m.lls_H / m.llr_H
    finding, limit = (at_most, MOST_UNEQUAL) if ratio >= 1 else (at_least, 1 / MOST_UNEQUAL)
    yield finding(
        UNEQUAL, ratio, limit, "",
        f"usually one is like the other: check machine.lls_H = {m.lls_H:.3g} H and machine.llr_H = "
        f"{m.llr_H:.3g} H", "note",
    )  # fmt: skip


#: How far from that of the rotor with an equal load an inertia is a note, and above it bad.
FAR_INERTIA, MOST_INERTIA = 30.0, 1000.0
INERTIA = "inertia over the usual one"


def _inertia(d: Design, power_kW: float, speed_rpm: float) -> Finding:
    usual_kgm2 = 2 * rotor_kgm2(power_kW, max(speed_rpm, 1.0))
    ratio = d.machine.inertia_kgm2 / usual_kgm2
    low, high = usual_kgm2 / FAR_INERTIA, usual_kgm2 * FAR_INERTIA
    advice = (
        f"usual is {usual_kgm2:.2g} kg m2 ({low:.2g} .. {high:.2g}) with the load: check "
        f"machine.inertia_kgm2 = {d.machine.inertia_kgm2:g}"
    )
    if ratio < 1:
        return at_least(INERTIA, ratio, 1 / FAR_INERTIA, "", advice, "note")
    return graded(INERTIA, ratio, FAR_INERTIA, MOST_INERTIA, "", advice)


def unusual(findings: Iterable[Finding]) -> list[str]:
    """A line for each number of the machine that is further from the published ones than any of
    these, or that does not go with the others."""
    others = (UNEQUAL, INERTIA, TORQUE)
    found = [f for f in findings if f.advice and (UNUSUAL in f.subject or f.subject in others)]
    return [f"{_why(f)}: {f.advice}" for f in found]


@dataclass(frozen=True)
class Outcome:
    """ready: schemes that can work; not_ready: those that cannot, and doubtful: those that may,
    each with its first finding of this kind. text: all of it in one line."""

    ready: tuple[str, ...]
    doubtful: dict[str, Finding]
    not_ready: dict[str, Finding]
    text: str

    def as_json(self) -> dict[str, Any]:
        doubts, reasons = (
            {scheme: _why(f) for scheme, f in of.items()} for of in (self.doubtful, self.not_ready)
        )
        return {
            "ready": self.ready, "doubtful": doubts, "not_ready": reasons, "verdict": self.text
        }  # fmt: skip


def mean_torque_says(findings: Iterable[Finding]) -> str:
    """One line with the mean torque of each scheme against its reference; empty without schemes."""
    parts: dict[str, list[str]] = {}
    where = ""
    percent = {f.scheme: f.value for f in findings if f.subject.startswith(MEAN_PCT)}
    for f in findings:
        if f.subject.startswith(MEAN_NM + ", at"):
            where = f.subject.removeprefix(MEAN_NM)
            of = f" ({percent[f.scheme]:+.0f} %)" if f.scheme in percent and f.value else ""
            parts.setdefault(f"{f.value:+.2g} N m{of}" if f.value else "0", []).append(f.scheme)
    listed = "; ".join(f"{', '.join(names)} {value}" for value, names in parts.items())
    return f"{MEAN_NM}{where}: {listed}" if listed else ""


def outcome(
    findings: Iterable[Finding], schemes: Iterable[str], own: str, name: str, first: str = ""
) -> Outcome:
    """The findings' consequence for these schemes. own: the set-up's scheme; name: the set-up, as a
    command line has it; first: the best scheme of all, if one is ready."""
    findings, schemes = list(findings), list(schemes)
    bad = [f for f in findings if f.verdict == "bad"]
    again = f"then hexatorque check {name}"
    if general := [f for f in bad if not f.scheme]:
        more = f" ({len(general) - 1} more like this)" if len(general) > 1 else ""
        text = f"not ready: {_why(general[0])}; next: {general[0].advice}{more}, {again}"
        return Outcome((), {}, dict.fromkeys(schemes, general[0]), text)
    wrong = _first_of(bad, schemes)
    open_yet = _first_of([f for f in findings if f.verdict == "doubtful"], schemes)
    doubtful = {scheme: f for scheme, f in open_yet.items() if scheme not in wrong}
    ready = tuple(ready_of(findings, schemes))
    best_one = first or best(findings, schemes)[0]
    parts = [f"ready: {', '.join(ready)}" if ready else "no scheme is ready"]
    for kind, of in (("doubtful", doubtful), ("not", wrong)):
        reasons: dict[str, list[str]] = {}
        for scheme, f in of.items():
            reasons.setdefault(f.subject if f.sign else _why(f), []).append(scheme)
        for names in reasons.values():
            why = _one_reason([of[scheme] for scheme in names])
            parts.append(f"{kind}: {', '.join(names)}, because {why}")
    possible = (*ready, *doubtful)
    if own in wrong and best_one:
        step = f'set controller.scheme = "{best_one}", {again}'
    elif not possible:
        step = f"{wrong[schemes[0]].advice}, {again}"
    else:
        most = [scheme for scheme in (own, best_one, *possible) if scheme in possible][:4]
        step = f"hexatorque compare --setup {name} --schemes {','.join(dict.fromkeys(most))}"
    return Outcome(ready, doubtful, wrong, "; ".join([*parts, f"next: {step}"]))


def _one_reason(same: list[Finding]) -> str:
    """Of findings of one subject: each has its own numbers, which the table has."""
    whys = list(dict.fromkeys(map(_why, same)))
    if len(whys) == 1:
        return whys[0]
    decides = dict.fromkeys(key for f in same for key in re.findall(r"machine\.\w+", f.runs))
    beyond = "above" if same[0].sign == "<=" else "below"
    if any(f.verdict == "bad" for f in same):
        return f"{same[0].subject} is {beyond} its limit (--all has the numbers)"
    may = f"{same[0].subject} may be {beyond} its limit"
    if not decides:
        return f"{may} (--all has the numbers)"
    verb, measured = "decides", MEASURED_BY
    if len(decides) > 1:
        verb, measured = "decide", MEASURED_BY.replace(" it", " them")
    return f"{may}: {' and '.join(decides)} {verb} (--all has the numbers, {measured})"


def _first_of(findings: list[Finding], schemes: list[str]) -> dict[str, Finding]:
    """The first of these findings of each scheme that has one."""
    return {scheme: f for scheme in schemes for f in reversed(findings) if f.scheme == scheme}


def _why(f: Finding) -> str:
    if not f.sign:
        return f"{f.what}: {f.advice}"
    beyond = "above" if f.sign == "<=" else "below"
    why = f"{f.what} is {f.value:.4g} {f.unit}".rstrip() + f", {beyond} {f.limit:.4g}"
    return f"{why} ({f.runs})" if f.runs else why


def _or_profile(d: Design, link_V: float) -> str:
    return "" if link_V == d.vdc_V else f", or change profile.vdc_V = {link_V:g} V"


#: Direct current of the amplitude heats a phase so many times as much as alternating current.
STANDING = 2.0


def _rated_degC(d: Design, share: float = 1.0) -> float:
    """Temperature of the phase with this `share` of the mean loss at which the losses at rated
    current settle, as the controller is told them; the rotor's are about as much as the slip takes
    of the torque."""
    p = d.parameter
    ambient_W, W_per_K = _rated_copper(d)
    both_K_W = share * p("winding_K_W") + p("frame_K_W")
    grows = W_per_K * both_K_W
    if grows >= 1:
        return math.inf
    rotor_K = _rated_rotor_W(d) * p("frame_K_W")
    return p("ambient_degC") + (ambient_W * both_K_W + rotor_K) / (1 - grows)


def _rated_copper(d: Design) -> tuple[float, float]:
    """Loss of the stator's winding at rated current and ambient temperature, W, and its change per
    kelvin, as the controller is told them."""
    p = d.parameter
    ohm_per_K = PER_K * p("rs_ohm") / (1 + PER_K * (p("rs_degC") - 20))
    i2_A2 = 3 * d.rated_A**2  # six phases, amplitude
    ambient_ohm = p("rs_ohm") + ohm_per_K * (p("ambient_degC") - p("rs_degC"))
    return i2_A2 * ambient_ohm, i2_A2 * ohm_per_K


def _rated_rotor_W(d: Design) -> float:
    if d.magnets:
        return 0.0
    return d.rated_Nm * d.machine.slip_rad_s(d.rated_Nm, d.flux_Wb) / d.machine.pole_pairs


def _fits(d: Design) -> Iterator[Finding]:
    """Demands beyond the firmware's own, which every set-up meets (`Setup`)."""
    p, setup = d.parameter, d.setup
    yield at_least(
        "vdc_max_V above the link", p("vdc_max_V"), 1.05 * max(d.links_V), "V",
        "give the sensor more range (sensors.vdc_full_V) or raise controller.vdc_max_V"
        + _or_profile(d, max(d.links_V)),
    )  # fmt: skip
    # With a capacitor the link outlasts a source that is lost.
    least_V = d.vdc_V if setup["inverter.link_F"] > 0 else min(d.links_V)
    yield at_most(
        "vdc_min_V below the link", p("vdc_min_V"), 0.95 * least_V, "V",
        "lower controller.vdc_min_V" + _or_profile(d, least_V),
    )  # fmt: skip
    if p("vdc_high_V") > 0:
        yield at_least(
            "vdc_high_V - vdc_band_V above the link", p("vdc_high_V") - p("vdc_band_V"),
            max(d.links_V),
            "V", "raise controller.vdc_high_V: below the source's voltage the drive would push",
        )  # fmt: skip
    if p("vdc_low_V") > 0:
        yield at_most(
            "vdc_low_V + vdc_band_V below the link", p("vdc_low_V") + p("vdc_band_V"), d.vdc_V, "V",
            "lower controller.vdc_low_V: above the source's voltage the drive could not drive",
        )  # fmt: skip
    if p("flux_least_loss") == "on":
        yield at_most(
            "flux_reserve_Nm, which leaves a flux to save", p("flux_reserve_Nm"),
            min(PULL_OUT_SHARE * d.pull_out_Nm, d.slip_Nm), "N m",
            "lower controller.flux_reserve_Nm: the whole flux makes no more, or only with more "
            "slip than encoder_trip_rpm", "note",
        )  # fmt: skip
    if p("winding_K_W") > 0:
        yield at_most(
            "winding at rated current, in the end", _rated_degC(d), p("winding_limit_degC"), "degC",
            "the drive will not keep its rated current: lower controller.winding_K_W or frame_K_W, "
            "or raise winding_limit_degC", "note",
        )  # fmt: skip
        if d.magnets:
            yield at_most(
                "phase that stands at the amplitude of rated current, in the end",
                _rated_degC(d, STANDING), p("winding_limit_degC"), "degC",
                "the drive will not hold rated torque at a standstill: lower "
                "controller.winding_K_W, or raise winding_limit_degC", "note",
            )  # fmt: skip
    yield at_least(
        "flux_trip_Wb", p("flux_trip_Wb"), 1.2 * d.flux_Wb, "Wb",
        "raise controller.flux_trip_Wb above flux_ref_Wb",
    )  # fmt: skip
    yield at_most(
        "sample to register write", write_delay_us(setup), WRITTEN_WITHIN * 1e6 * d.period_s, "us",
        "lower controller.f_isr_Hz",
    )  # fmt: skip


#: Of the direct current that turns the q axis to it, with the inductances 10 % off.
MOST_TURNING = 0.8
#: Electrical degrees by which a rotor that friction holds may rest off the current: the torque is
#: then 2 % off; beyond the second the encoder may not show the movement (ht_alignment.c).
WELL_ALIGNED_DEG, ALIGNED_DEG = 10.0, 30.0
MORE_RANGE = "give the sensors more range (sensors.i_full_A)"


def _more_current(d: Design, needed_A: Callable[[Design], float]) -> str:
    """The change that makes room for a trip of so much: the trip itself as far as the sensors'
    range allows. Other values follow the trip, so what is needed may grow with it."""
    trip_A, full_A = d.parameter("i_trip_A"), d.parameter("i_full_A")
    most_A = min(I_TRIP_SHARE, 1 - d.parameter("comparator_above_pu")) * full_A
    if needed_A(d) <= trip_A:
        return ""
    if math.isclose(trip_A, I_TRIP_SHARE * full_A, rel_tol=1e-3):
        return MORE_RANGE  # which the derived trip follows

    def enough(trip_A: float) -> bool:
        try:
            setup = cast(Setup, d.setup).changed(controller__i_trip_A=trip_A)
        except SetupError:
            return False
        return needed_A(Design(setup, parameters(setup).__getitem__)) <= trip_A

    if trip_A >= most_A or not enough(most_A):
        return f"{MORE_RANGE}, and raise controller.i_trip_A"
    low_A, high_A = trip_A, most_A
    while high_A > 1.01 * low_A:
        middle_A = 0.5 * (low_A + high_A)
        low_A, high_A = (low_A, middle_A) if enough(middle_A) else (middle_A, high_A)
    step_A = 10.0 ** (math.floor(math.log10(high_A)) - 2)
    least_A = min(math.ceil(high_A / step_A) * step_A, most_A)
    return f"raise controller.i_trip_A to {least_A:.4g} A (these sensors allow {most_A:.4g} A)"


def _rated_current_A(d: Design) -> float:
    return d.current_A(d.rated_Nm)


def _flux_step_A(d: Design) -> float:
    """The step of the current in a period."""
    return d.flux_step_Wb(d.period_s) / d.machine.least_H


def _build_A(d: Design) -> float:
    return d.parameter("build_current_A") + _flux_step_A(d)


def _align_A(d: Design) -> float:
    return d.parameter("build_current_A") + d.align_step_A


def _limit_A(d: Design) -> float:
    return d.current_A(d.parameter("torque_limit_Nm")) + _flux_step_A(d)


def _currents_of_torque(d: Design) -> Iterator[Finding]:
    """The findings about rated torque and torque limit; none if that torque cannot be."""
    if _no_torque(d):
        return
    trip_A, rated_A = d.parameter("i_trip_A"), d.current_A(d.rated_Nm)
    yield at_most(
        "current at rated torque", rated_A, 0.8 * trip_A, "A",
        _more_current(d, lambda d: _rated_current_A(d) / 0.8),
    )  # fmt: skip
    yield at_most(
        "current at rated torque against rated current", rated_A, 1.2 * d.rated_A, "A",
        "lower rated.torque_Nm, or correct rated.current_A (an rms value)", "note",
    )  # fmt: skip
    yield at_most(
        "current at the torque limit, with ripple", _limit_A(d), trip_A, "A",
        "lower controller.torque_limit_Nm, raise controller.f_isr_Hz, or "
        f"{_more_current(d, _limit_A)}", "note",
    )  # fmt: skip


def _step_of_converter(d: Design, limit_A: float) -> Finding:
    """The converter's step against a limit; the finding is bad beyond five times the limit."""
    quantum_A = 2 * d.setup["sensors.i_full_A"] / 2 ** d.setup["sensors.adc_bits"]
    return graded(
        "step of the current's converter", quantum_A, limit_A, 5 * limit_A, "A",
        "take sensors of less range, or a converter of more bits",
    )  # fmt: skip


def _currents(d: Design) -> Iterator[Finding]:
    p = d.parameter
    trip_A, no_load_A = p("i_trip_A"), d.no_load_A
    yield at_most(
        "no-load current", no_load_A, 0.6 * trip_A, "A",
        f"lower controller.flux_ref_Wb, or {_more_current(d, lambda d: d.no_load_A / 0.6)}",
    )  # fmt: skip
    yield at_least(
        "build-up current", p("build_current_A"), 1.1 * no_load_A, "A",
        "this one does not magnetise the machine: lower controller.flux_ref_Wb, or "
        f"{_more_current(d, lambda d: 1.1 * d.no_load_A / 0.6)}"
        if p("build_current_A") >= 0.5 * trip_A
        else "raise controller.build_current_A: this one does not magnetise the machine",
    )  # fmt: skip
    yield _told("losses of the windings at rated torque, about", d.copper_W(d.rated_Nm), "W")
    yield at_most(
        "build-up current and its ripple", _build_A(d), trip_A, "A",
        "lower controller.build_current_A, or "
        f"{_more_current(d, _build_A)}",
    )  # fmt: skip
    needed_s = d.magnetised_s(p("build_current_A"))
    yield at_least(
        "flux build-up", p("build_s"), needed_s, "s",
        f"raise controller.build_s: L_r/R_r is {d.rotor_s:.3g} s",
        "note" if p("build_s") > needed_s / 3 else "bad",
    )  # fmt: skip
    yield from _currents_of_torque(d)
    yield at_most(
        "torque limit against pull-out", p("torque_limit_Nm"), PULL_OUT_SHARE * d.pull_out_Nm,
        "N m", "the firmware stays below 80 % of pull-out: lower controller.torque_limit_Nm",
        "note",
    )  # fmt: skip
    if not _no_torque(d):
        yield at_least(
            "torque limit against rated torque", p("torque_limit_Nm"), d.rated_Nm, "N m",
            "this flux gives no more: raise inverter.vdc_V, state rated.flux_Wb, or lower "
            "rated.torque_Nm"
            if d.rated_Nm > PULL_OUT_SHARE * d.pull_out_Nm
            else _more_current(d, lambda d: _rated_current_A(d) / 0.8)
            if d.current_A(d.rated_Nm) > 0.8 * trip_A
            else "raise controller.torque_limit_Nm",
        )  # fmt: skip
    yield _step_of_converter(d, 0.03 * no_load_A)
    yield at_least(
        "flux_check against the current's ripple, in no-load currents",
        p("flux_check") if p("flux_check") > 0 else math.inf, d.ripple, "",
        f"raise controller.flux_check: sigma is {d.sigma:.3g}, or raise controller.f_isr_Hz",
    )  # fmt: skip
    derived_rpm = OPEN["encoder_trip_rpm"].value(Known(d.setup, parameters(d.setup)))
    yield at_least(
        "encoder_trip_rpm against the rated slip",
        p("encoder_trip_rpm") if p("encoder_trip_rpm") > 0 else math.inf, derived_rpm, "r/min",
        f"set controller.encoder_trip_rpm = {math.ceil(derived_rpm)}: the slip is as wrong as R_r, "
        "and without load the flux's speed wanders", "note",
    )  # fmt: skip


def _of_magnets(d: Design) -> Iterator[Finding]:
    """Numbers that no machine with magnets has, and the speed up to which they are harmless."""
    p, m = d.parameter, d.machine
    share, armature = m.rs_ohm * _over_voltage_A(d), m.ld_H * d.rated_A / m.psi_f_Wb
    resistive, strong = share > MOST_RESISTANCE, armature > MOST_ARMATURE
    exchanged = _exchanged(d, m.rs_ohm)
    yield at_most(
        "rs_ohm times rated current over the voltage", share, MOST_RESISTANCE, "",
        exchanged or f"check rated.current_A = {d.rated_A / math.sqrt(2):.3g} first: machine.ld_H "
        "has too much flux with it, too"
        if strong else _too_resistive(d, "rs_ohm", m.rs_ohm),
    )  # fmt: skip
    if not resistive:  # one mistake is told once
        yield at_most(
            "flux of the rated current in L_d over the magnets'", armature, MOST_ARMATURE, "",
            f"no machine has that with machine.ld_H = {m.ld_H:g} H, which is {1e3 * m.ld_H:g} mH: "
            "check it, machine.psi_f_Wb and rated.current_A",
        )  # fmt: skip
        yield from _stated_torque(d) if not strong else ()
    yield from _as_built(d)
    if resistive or not strong:
        yield at_most(
            "L_d over L_q", m.ld_H / m.lq_H, 1.0, "",
            "the d axis is the magnets' north pole: are machine.ld_H and machine.lq_H exchanged?",
        )  # fmt: skip
    if p("rotor_start") == "absolute" and d.setup["sensors.absolute_counts_rev"] == 0:
        yield Finding(
            "no absolute encoder", 0.0, "", 0.0, "", "bad",
            "controller.rotor_start = absolute needs one: sensors.absolute_counts_rev must be "
            f"{lib.ht_absolute_least(d.setup['machine.pole_pairs']):g} at least",
        )  # fmt: skip
    if p("rotor_start") == "index" and d.setup["sensors.encoder_index_deg"] == 0:
        yield Finding(
            "encoder without an index", 0.0, "", 0.0, "", "bad",
            "controller.rotor_start = index needs one: sensors.encoder_index_deg must be above 0, "
            "360 at most",
        )  # fmt: skip
    if _short_circuits(d):
        yield _told(
            "speed from which on the trip state is a short circuit", m.ceiling_rpm(d.vdc_V), "r/min"
        )
        return
    yield at_most(
        "speed trip against the speed at which the magnets drive current without gates",
        p("speed_trip_rpm"), m.ceiling_rpm(d.vdc_V), "r/min",
        "lower controller.speed_trip_rpm, raise inverter.vdc_V, or permit the short circuit "
        "(controller.trip_state): the gates could not end the current",
    )  # fmt: skip


def _short_circuits(d: Design) -> bool:
    return bool(d.magnets and d.parameter("trip_state") == "short-circuit")


def _currents_of_magnets(d: Design) -> Iterator[Finding]:
    p, trip_A = d.parameter, d.parameter("i_trip_A")
    yield at_most(
        "current that aligns the rotor, and its ripple", _align_A(d),
        trip_A, "A", "lower controller.build_current_A, or "
        f"{_more_current(d, _align_A)}",
    )  # fmt: skip
    yield at_most(
        "current that aligns the rotor, and its ripple, which must not turn the q axis there",
        _align_A(d), MOST_TURNING * d.machine.turning_A, "A",
        "lower controller.build_current_A, or raise controller.f_isr_Hz",
    )  # fmt: skip
    if (resists_Nm := _resists_Nm(d)) and p("rotor_start") == "align":
        well_Nm, worst_Nm = (_aligning_Nm(d, deg) for deg in (WELL_ALIGNED_DEG, ALIGNED_DEG))
        yield graded(
            "torque that holds the rotor while it is aligned",
            resists_Nm, well_Nm, worst_Nm, "N m", _aligns(d, resists_Nm),
        )  # fmt: skip
    if swing_rad_s := d.machine.swing_rad_s(p("build_current_A")):
        swing_s = 2 * math.pi / swing_rad_s
        yield at_least(
            "time to align the rotor", p("build_s"), swing_s, "s",
            f"raise controller.build_s: the shaft swings with a period of {swing_s:.2g} s",
        )  # fmt: skip
    yield _told("losses of the windings at rated torque, about", d.copper_W(d.rated_Nm), "W")
    rated_A = d.current_A(d.rated_Nm)
    yield from _currents_of_torque(d)
    yield at_least(
        "torque limit against rated torque", p("torque_limit_Nm"), d.rated_Nm, "N m",
        _more_current(d, lambda d: _rated_current_A(d) / 0.8) if rated_A > 0.8 * trip_A
        else "raise controller.torque_limit_Nm",
    )  # fmt: skip
    yield _step_of_converter(d, 0.01 * rated_A)
    pull_rad_s = 2 * math.pi * p("crossover_Hz")
    yield at_most(
        "flux that a resistance 30 % wrong moves, in psi_f",
        0.3 * p("rs_ohm") * rated_A / (pull_rad_s * d.machine.psi_f_Wb), 0.2, "",
        "raise controller.crossover_Hz",
    )  # fmt: skip


def _resists_Nm(d: Design) -> float:
    """What holds or turns the shaft of a drive that aligns its rotor. Its output opens a holding
    brake later. Friction is there from the start; of other loads only a constant one of the profile
    acts on a shaft at rest."""
    setup, steps = d.setup, d.setup.profile.load_Nm
    begins_s = d.parameter("calibration_s")
    if setup.profile.starts_later:
        begins_s += setup.profile.command[0][0]
    ends_s = begins_s + d.parameter("build_s")
    loads = [value for n, (at_s, value) in enumerate(steps)
             if at_s < ends_s and (n + 1 == len(steps) or steps[n + 1][0] > begins_s)]  # fmt: skip
    if setup["load.kind"] == "friction" and not steps:
        loads = [setup["point.load_Nm"]]
    still = setup["load.kind"] in ("friction", "constant")
    return setup["load.holding_Nm"] + still * max(map(abs, loads), default=0.0)


def _aligning_Nm(d: Design, deg: float) -> float:
    """The pull of the aligning current on a rotor that is so far off it."""
    current_A, off = d.parameter("build_current_A"), math.radians(deg)
    return d.machine.torque_Nm(current_A * math.cos(off), current_A * math.sin(off))


def _aligns(d: Design, resists_Nm: float) -> str:
    """The least current that aligns the rotor well enough against this torque, if one may be set:
    3 P (psi_f - (L_q - L_d) i cos a) i sin a = T."""
    m, off = d.machine, math.radians(WELL_ALIGNED_DEG)
    psi_Wb, saliency_H = m.psi_f_Wb, (m.lq_H - m.ld_H) * math.cos(off)
    needed_Wb = resists_Nm / (3 * m.pole_pairs * math.sin(off))
    root_Wb = math.sqrt(max(0.0, psi_Wb**2 - 4 * saliency_H * needed_Wb))
    least_A = 2 * needed_Wb / (psi_Wb + root_Wb)
    other = "free the shaft, or tell the angle (controller.rotor_start)"
    most_A = min(d.parameter("i_trip_A"), MOST_TURNING * m.turning_A) - d.align_step_A
    if 4 * saliency_H * needed_Wb > psi_Wb**2 or least_A > most_A:
        return f"no current within the limits aligns this rotor well: {other}"
    return f"set controller.build_current_A = {_up(least_A)} at least, or {other}"


def _up(value: float) -> str:
    """Three digits, not below the value."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.ceil(value / digit) * digit:.3g}"


def _loops(d: Design) -> Iterator[Finding]:
    p, m = d.parameter, d.machine
    quantum = rad_s(60 * p("f_slow_Hz") / p("encoder_counts_rev"))
    yield graded(
        "torque of one step of the measured speed", p("kp_speed_Nms_rad") * quantum,
        0.1 * d.rated_Nm, d.rated_Nm, "N m",
        "lower controller.kp_speed_Nms_rad, or take an encoder of more pulses",
    )  # fmt: skip
    yield at_most(
        "corner of the speed loop, kp/J", p("kp_speed_Nms_rad") / m.inertia_kgm2,
        2 * math.pi * p("f_slow_Hz") / 10, "rad/s", "lower controller.kp_speed_Nms_rad",
    )  # fmt: skip
    yield at_most(
        "dead-time voltage against the voltage at a tenth of rated speed", d.dead_V,
        0.1 * m.pole_pairs * rad_s(d.rated_rpm) * d.flux_Wb, "V",
        "shorten the dead time, lower controller.f_isr_Hz, or do not run below this speed", "note",
    )  # fmt: skip


def _speed(d: Design) -> Iterator[Finding]:
    p = d.parameter
    most_rpm = 0.95 * p("speed_trip_rpm")

    def raised(speed_rpm: float) -> str:
        above = d.magnets and speed_rpm > 0.95 * d.machine.ceiling_rpm(d.vdc_V)
        if above and not _short_circuits(d):
            return (
                "raise inverter.vdc_V, or permit the short circuit (controller.trip_state): "
                "without gates the magnets would drive current"
            )
        return "raise controller.speed_trip_rpm"

    yield at_most(
        "rated speed against the trip", d.rated_rpm, most_rpm, "r/min", raised(d.rated_rpm)
    )  # fmt: skip
    yield at_most(
        "fastest speed that is asked for against the trip", d.asked_rpm, most_rpm, "r/min",
        f"ask for less, or {raised(d.asked_rpm)}",
    )  # fmt: skip
    corner_rad_s = p("kp_speed_Nms_rad") / d.machine.inertia_kgm2
    if corner_rad_s > 0:
        rise_rpm = d.runaway_rpm(corner_rad_s)
        if d.magnets and not _short_circuits(d):  # nothing may flow beyond the trip
            rise_rpm /= LEAST_INERTIA
        yield at_most(
            "speed when the rated load drops", d.rated_rpm + rise_rpm,
            p("speed_trip_rpm"), "r/min",
            "raise controller.f_slow_Hz and kp_speed_Nms_rad, or add inertia",
        )  # fmt: skip
    yield at_most(
        "largest load of point and profile", d.asked_Nm, p("torque_limit_Nm"), "N m",
        "raise controller.torque_limit_Nm, or ask for less",
    )  # fmt: skip
    if p("field_weakening") == "on":
        yield _end_of_weakening(d)


def _end_of_weakening(d: Design) -> Finding:
    """The speed at which the least flux takes the usable voltage, with as much of it for the load
    as rated torque takes. A light load leaves all of the voltage for the flux."""
    weaker = d.flux_Wb / d.parameter("flux_min_Wb")
    loaded_rpm = weaker * d.base_rpm(d.reach_pu(REACH_PU, by_table=True))
    unloaded_rpm = rpm(weaker * VECTOR_PU * d.vdc_V / d.flux_Wb / d.machine.pole_pairs)
    fastest_rpm = max(d.fastest_rpm, d.rated_rpm)
    reached = d.rated_rpm <= loaded_rpm and fastest_rpm <= unloaded_rpm
    more = "lower controller.flux_min_Wb, raise inverter.vdc_V, or ask for less speed"
    return at_least(
        "end of field weakening", loaded_rpm, fastest_rpm, "r/min",
        f"only little load lets the drive go faster: {more}" if reached else more,
        "note" if reached else "bad",
    )  # fmt: skip


def _link(d: Design) -> Iterator[Finding]:
    """The dc-link voltage that braking causes, and the voltage that the power stage must bear."""
    p, setup = d.parameter, d.setup
    link_F, ohm = setup["inverter.link_F"], setup["inverter.chopper_ohm"]
    chopper_V = setup["inverter.chopper_on_V"] or p("chopper_on_V")
    speed_rad_s = rad_s(d.fastest_rpm)
    if speed_rad_s == 0:
        return
    if chopper_V > 0:
        braking_Nm = p("torque_limit_Nm")
        if 0 < p("torque_negative_Nm") < braking_Nm:
            braking_Nm = p("torque_negative_Nm")
        braking_W = braking_Nm * speed_rad_s
        most_ohm = chopper_V**2 / braking_W
        yield _told("braking power at the fastest speed, at most", braking_W, "W")
        if ohm > 0:
            yield at_most(
                "chopper's resistor, which takes this power", ohm, most_ohm, "ohm",
                "take one of less resistance, or limit the braking: torque_negative_Nm or "
                "vdc_high_V", "note",
            )  # fmt: skip
        else:
            yield _told("resistor that takes this power, at most", most_ohm, "ohm")
    if link_F > 0 and p("vdc_low_V") == 0:
        yield from _buffered(d)
    if chopper_V == 0 and link_F > 0:
        energy_J = 0.5 * d.machine.inertia_kgm2 * speed_rad_s**2
        reached_V = math.hypot(max(d.links_V), math.sqrt(2 * energy_J / link_F))
        if p("vdc_high_V") == 0:
            yield at_most(
                "dc link after braking from the fastest speed, without losses", reached_V,
                p("vdc_max_V"), "V", _limited_link(d, energy_J), "note",
            )  # fmt: skip


def _buffered(d: Design) -> Iterator[Finding]:
    """The level at which the shaft may feed the link through a dip of the source: as far from the
    source's voltage, on the way to the least one, as the upper level. Nothing if the capacitor
    holds no band there. Without field weakening the level must turn the flux reference."""
    from .. import firmware

    p, source_V = d.parameter, d.vdc_V
    least_V = LOW_SHARE * p("vdc_min_V")
    if p("field_weakening") == "off" and (base_rpm := d.base_rpm(usable=1.0)) > 0:
        least_V = max(least_V, source_V * d.fastest_rpm / base_rpm)
    room_V = source_V - least_V
    if room_V <= 0:
        return
    low_V = source_V - LEVEL_SHARE * room_V

    def with_level(name: str) -> Any:
        return low_V if name == "vdc_low_V" else p(name)

    band_V = max(firmware.least_band_V(with_level), BAND_SHARE * room_V, p("vdc_band_V"))
    high_V = p("vdc_high_V")
    if band_V <= source_V - low_V and (high_V == 0 or high_V - 2 * band_V > low_V):
        yield _told("vdc_low_V that rides through a dip of the source", low_V, "V")
        yield _told("vdc_band_V with it", band_V, "V")


def _limited_link(d: Design, energy_J: float) -> str:
    """Values with which the drive brakes no harder than the link bears."""
    from .. import firmware

    highest_V, trip_V = max(d.links_V), d.parameter("vdc_max_V")
    share = next(order.share for order in firmware.orders() if order.less == "vdc_high_V")
    room_V = share * trip_V - highest_V
    if room_V <= 0:
        return "raise controller.vdc_max_V"
    high_V = highest_V + LEVEL_SHARE * room_V
    needed_F = 2 * energy_J / (trip_V**2 - highest_V**2)
    others = f"a chopper, or a capacitor of {needed_F:.2g} F for the shaft's {energy_J:.3g} J"

    def with_level(name: str) -> Any:
        return high_V if name == "vdc_high_V" else d.parameter(name)

    band_V = max(firmware.least_band_V(with_level), BAND_SHARE * room_V)
    if band_V > high_V - highest_V:
        return f"this capacitor is too small for a level of the drive: it takes {others}"
    return (
        f"set controller.vdc_high_V = {high_V:.4g} and vdc_band_V = {band_V:.3g}, or take {others}"
    )


def _proposed_heat(d: Design) -> Iterator[Finding]:
    """Where the drive has no model of a temperature: the largest thermal resistances with which
    rated current keeps it below its limit. Balance in steady state: (limit - ambient)/loss. The
    rotor's loss, which passes the frame only, counts as if it passed both."""
    p = d.parameter
    if p("winding_K_W") == 0 and (rise_K := p("winding_limit_degC") - p("ambient_degC")) > 0:
        ambient_W, W_per_K = _rated_copper(d)
        loss_W = ambient_W + W_per_K * rise_K + _rated_rotor_W(d)
        yield _told("winding_K_W + frame_K_W that keep rated current, at most", rise_K / loss_W,
                    "K/W")  # fmt: skip
    if p("device_K_W") == 0 and (rise_K := p("device_limit_degC") - p("ambient_degC")) > 0:
        leg_W = standing_leg_W(d.setup, parameters(cast(Setup, d.setup)))
        if leg_W > 0:
            yield _told("loss of a leg with rated current at a standstill", leg_W, "W")
            yield _told("device_K_W, with its part of the heat sink, that bears it, at most",
                        rise_K / leg_W, "K/W")  # fmt: skip


def _power_stage(d: Design) -> Iterator[Finding]:
    """The drive's parameters of its devices, against those of the simulated power stage."""
    setup = d.setup
    if not has_chains(setup):
        return
    known = Known(setup, parameters(setup), left_open=DEVICES)
    rise_K, advice = device_rise_K(known), "leave controller.device_… out: they follow from [heat]"
    told = "rise of the devices as the drive computes it, with rated current at a standstill"
    yield at_least(told, device_rise_K(d), 0.9 * rise_K, "K", advice, "note")
    yield at_most(told, device_rise_K(d), 1.5 * rise_K, "K", advice, "note")
    yield at_most(
        "time constant of the devices in the drive", d.parameter("device_s"),
        1.5 * known["device_s"], "s", advice, "note",
    )  # fmt: skip


#: What an interrupt takes in which both sets of `db-ipwm` decide, over the mean of those in which
#: one does (docs/budget.json).
BOTH_SETS = 1.42


def _interrupt(d: Design, name: str) -> Iterator[Finding]:
    """The chip's time for a scheme, estimated. An estimate of more than the period leaves it open
    whether the chip can run the scheme; where even the smallest one is more, it cannot."""
    from .. import firmware

    names = firmware.schemes()
    row = firmware.lib.ht_scheme_describe(names.index(name))
    cycles = max(  # of a scheme with the same law
        found
        for other, found in chips.budget()["c28x_cycles"].items()
        if firmware.lib.ht_scheme_describe(names.index(other)).law == row.law
    )
    interleaved = row.vectors == firmware.lib.HT_VECTORS_INTERLEAVED
    if interleaved and d.parameter("thd_share") > 0.0:
        cycles *= BOTH_SETS
    chip = d.setup["timing.device"]
    clock_Hz = firmware.board_of(chip).map.system_clock_Hz
    most_Hz, takes_s = WRITTEN_WITHIN * clock_Hz / cycles, cycles / clock_Hz
    yield at_most(
        f"fast interrupt on {chip}, estimated", 1e6 * takes_s, WRITTEN_WITHIN * 1e6 * d.period_s,
        "us",
        f"measure it on the board, or lower controller.f_isr_Hz to {math.floor(most_Hz / 1e3)}000",
        "bad" if takes_s * chips.LEAST_ESTIMATE > d.period_s
        else "doubtful" if takes_s > d.period_s
        else "note",
    )  # fmt: skip


def _scheme(d: Design, name: str) -> Iterator[Finding]:
    from .. import firmware

    p, lib = d.parameter, firmware.lib
    row = lib.ht_scheme_describe(firmware.schemes().index(name))
    if not lib.ht_scheme_drives(row, d.winding):
        advice = (
            "both sets must switch alike, and under this scheme they do not"
            if lib.ht_law_commands_voltage(row.law)
            else "this winding's large vectors have no x-y voltage to choose or to regulate by"
        )
        yield Finding(f"displacement_deg {p('displacement_deg')}", 0.0, "", 0.0, "", "bad", advice)
        return
    yield from _interrupt(d, name)
    if lib.ht_law_commands_voltage(row.law):
        least_Hz = lib.ht_voltage_law_least_Hz(p("rs_ohm"), d.machine.least_H, p("lxy_H"))
        yield at_least(
            "f_isr_Hz for the machine's time constants", p("f_isr_Hz"), least_Hz, "Hz",
            f"set controller.f_isr_Hz = {math.ceil(least_Hz / 1e4) * 10_000}",
        )  # fmt: skip
        if lib.ht_scheme_xy_ripple_pu(row):
            least_Hz = firmware.least_ripple_Hz(lambda key: name if key == "scheme" else p(key))
            yield at_least(
                "f_isr_Hz for the x-y ripple of its carriers", p("f_isr_Hz"), least_Hz, "Hz",
                f"set controller.f_isr_Hz = {math.ceil(least_Hz / 1e3) * 1000}, or take db-dtfc",
            )  # fmt: skip
            yield from _interleaved(d)
        yield from _reach(d, row, by_table=False)
        # A leg toggles once in a period, or in two where carriers are interleaved.
        interleaved = row.vectors == lib.HT_VECTORS_INTERLEAVED
        yield from _expected(d, (0.25 if interleaved else 0.5) * p("f_isr_Hz"))
        return
    single, virtual = row.vectors == lib.HT_VECTORS_SINGLE, row.vectors == lib.HT_VECTORS_VIRTUAL
    vector_pu = _vector_pu(d, row)
    faster = "raise controller.f_isr_Hz, lower inverter.vdc_V, or add inductance"
    torque_Nm = d.torque_step_Nm(d.period_s, vector_pu)
    yield at_most("torque step of one period", torque_Nm, d.rated_Nm, "N m", faster)
    yield at_most(
        "torque step against the band", torque_Nm, 8 * p("torque_band_Nm"), "N m",
        "widen controller.torque_band_Nm: the torque cannot be kept in it", "note",
    )  # fmt: skip
    flux_Wb = d.flux_step_Wb(d.period_s, vector_pu)
    # What it does to the current is in PEAK. The flux itself trips when it is too large.
    yield graded(
        "flux step of one period", flux_Wb, 0.1 * d.flux_Wb, p("flux_trip_Wb") - d.flux_Wb, "Wb",
        faster,
    )  # fmt: skip
    yield at_most(
        "flux step against the band", flux_Wb, 8 * p("flux_band_Wb"), "Wb",
        "widen controller.flux_band_Wb", "note",
    )  # fmt: skip
    yield at_most(
        PEAK, _peak_A(d, row), p("i_trip_A"), "A",
        "may trip: take a scheme that controls the x-y currents; else "
        f"{_more_current(d, lambda d: _peak_A(d, row))}, {faster}",
        "bad" if _peak_A(d, row, brakes=False) > p("i_trip_A") else "doubtful",
    )  # fmt: skip
    if row.regulated:
        yield at_most(
            "gain of the x-y loop in one period", _xy_gain(d), XY_GAIN_MOST, "",
            "lower controller.kp_xy_pu_A: the loop becomes unstable at 1, and the x-y current "
            "swings", "note",
        )  # fmt: skip
    yield from _reach(d, row, by_table=True)
    kind = "single" if single else "virtual L" if virtual else "pair"
    if virtual and row.group != lib.HT_L:
        kind = "virtual ML"
    yield from _expected(d, SWITCHING[kind] * p("f_isr_Hz"))


#: By what a torque step under interleaved carriers moves the x-y flux, in Vdc T_s: the first set
#: makes its voltage, of up to 2/3 Vdc, a period before the other one, and half of it is in x-y.
FIRST_SET = 1 / 3


def _interleaved(d: Design) -> Iterator[Finding]:
    p = d.parameter
    alone_A = FIRST_SET * d.vdc_V * d.period_s / d.machine.lxy_H
    yield at_most(
        PEAK, d.current_A(p("torque_limit_Nm")) + alone_A, p("i_trip_A"), "A",
        "a torque step may trip: lower controller.torque_limit_Nm, raise controller.f_isr_Hz, or "
        "take db-dtfc",
    )  # fmt: skip
    subject = f"sigma_ls_H over lxy_H, where thd_share is {p('thd_share'):g}"
    ratio = p("sigma_ls_H") / p("lxy_H")
    if p("thd_share") >= 0.5:
        yield _told(subject, ratio, "")
    else:
        yield at_most(
            subject, ratio, CLEAN_FROM, "",
            "ripple in x-y distorts the currents much: set controller.thd_share = 1", "note",
        )  # fmt: skip


def _expected(d: Design, f_sw_Hz: float) -> Iterator[Finding]:
    """Switching frequency and losses of the inverter at rated torque, without a limit."""
    yield _told(SWITCHES, f_sw_Hz, "Hz")
    if conduction_W := d.conduction_W(d.rated_Nm):
        yield _told("inverter's conduction losses at rated torque, about", conduction_W, "W")
    if switching_W := d.switching_W(d.rated_Nm, f_sw_Hz):
        yield _told("inverter's switching losses at rated torque, about", switching_W, "W")


def _without_leg(d: Design, controller: Controller) -> Iterator[Finding]:
    """The torque with which magnets go on: there is less current, and at speed less voltage."""
    from .. import firmware

    if not d.magnets or d.parameter("ride_through") == "off":
        return
    lib, config = firmware.lib, controller.drive.config
    lost = firmware.ffi.new("ht_lost_legs *")
    known = int(d.parameter("lost_legs"))
    lib.ht_lost_legs_of(config.control.observer.winding, known or 1, lost)
    omega = d.machine.pole_pairs * rad_s(d.rated_rpm)
    most_A = lib.ht_derated_A(lost, config.derating.rated_A)
    left_V = lib.ht_derated_V(
        firmware.ffi.addressof(config.derating), d.vdc_V, d.machine.rs_ohm, omega, most_A
    )
    yield at_least(
        f"torque left at rated speed without {'lost_legs' if known else 'a phase'}",
        d.machine.most_torque_Nm(omega, d.flux_Wb, left_V, most_A, PULL_OUT_SHARE), d.rated_Nm,
        "N m", "a drive that goes on without one takes no more load", "note",
    )  # fmt: skip


def _steady(setup: Setup, d: Design, name: str) -> Iterator[Finding]:
    """The mean torque where schemes are compared. A law without comparators predicts the flux that
    has the torque asked for: its mean is the reference."""
    from .. import firmware

    lib = firmware.lib
    speed_rpm, load_Nm = d.steady_point
    asked_Nm = load_Nm + d.machine.viscous_Nms * rad_s(speed_rpm)
    where = f", at {speed_rpm:g} r/min and {load_Nm:g} N m"
    row = lib.ht_scheme_describe(firmware.schemes().index(name))
    modulated = lib.ht_law_commands_voltage(row.law)
    try:
        own = setup.with_scheme(name)
        controller = firmware.Controller(own["timing.device"], parameters(own))
    except (SetupError, firmware.FirmwareError):
        return  # what is wrong is said elsewhere
    yield from _without_leg(d, controller)
    if modulated:
        changed = of_modulator(d, controller, speed_rpm, asked_Nm, CHANGED)
        yield from _of_pulses(d, controller, changed, where)
    if d.magnets:
        return  # the mean is worked out for a rotor with a winding
    error_Nm, error_pct = 0.0, 0.0
    if not modulated:
        found = held(d, controller, speed_rpm, asked_Nm)
        error_Nm, error_pct = found.error_Nm, found.error_pct
        changed = of_table(d, controller, found.words, found.vectors, CHANGED)
        yield from _of_pulses(d, controller, changed, where)
    yield _told(MEAN_NM + where, error_Nm, "N m")
    advice = "lower controller.torque_band_Nm, or raise controller.f_isr_Hz"
    if d.parameter("control_mode") == "torque":
        if d.parameter("torque_mean_s") > 0:
            return  # the drive brings it to the reference
        advice += f", or set controller.torque_mean_s = {MEAN_S:g}"
    if error_pct <= 0:
        yield at_least(MEAN_PCT + where, error_pct, -HELD_PCT, "%", advice, "note")
    elif error_pct > 0:
        yield at_most(MEAN_PCT + where, error_pct, HELD_PCT, "%", advice, "note")


def _of_pulses(d: Design, c: Controller, changed: Changed, where: str) -> Iterator[Finding]:
    """Voltage that the shortest gate pulse takes, and torque that it moves."""
    fits = f"lower controller.min_pulse_us: up to {changed.most_us:.3g} us fit"
    if changed.most_us < c.parameters["min_pulse_us"].min:
        fits = "the board's pulses are too long for this"
    yield at_most(
        SHORT_PULSES + where, 100 * changed.share, 100 * CHANGED, "%",
        f"{fits}, or lower controller.f_isr_Hz", "note",
    )  # fmt: skip
    step_Wb = changed.volts * d.period_s
    yield _told(
        "torque that this moves in a period, rms" + where,
        d.machine.torque_step_Nm(d.steady_Wb, step_Wb), "N m",
    )  # fmt: skip


def _told(subject: str, value: float, unit: str) -> Finding:
    return Finding(subject, value, "", 0.0, unit, "ok", "")


def _vector_pu(d: Design, row: Any) -> float:
    """The longest vector of a table, units of Vdc."""
    from ..firmware import lib

    virtual = row.vectors == lib.HT_VECTORS_VIRTUAL
    return row.reach_pu / COS_15 if virtual else lib.ht_longest_pu(d.winding)


def _peak_A(d: Design, row: Any, brakes: bool = True) -> float:
    """Current under a table at the torque limit. A vector that brakes adds to the voltage that the
    turning flux induces, so it moves the current furthest at the fastest speed."""
    volts = _vector_pu(d, row) * d.vdc_V + brakes * _induced_V(d)
    ripple_A = volts * d.period_s / d.machine.least_H
    if not d.magnets:
        ripple_A *= 1 + _unseen(d.machine.sigma_ls_H, d.parameter("sigma_ls_H"))
    return _xy_A(d, row) + d.current_A(d.parameter("torque_limit_Nm")) + ripple_A


def _unseen(true_H: float, believed_H: float) -> float:
    """The law decides while a step is under way, which it sees as large as the inductance that it
    believes makes it: the share that it does not see comes on top of the next one. One that it sees
    too large only makes it turn back sooner."""
    return max(0.0, 1 - true_H / believed_H)


def _induced_V(d: Design) -> float:
    """At the fastest speed, where the flux is weakened to what the voltage turns."""
    omega = d.machine.pole_pairs * rad_s(max(d.asked_rpm, d.rated_rpm))
    return min(omega * d.steady_Wb, USABLE * REACH_PU * d.vdc_V)


def _xy_A(d: Design, row: Any) -> float:
    """Amplitude of the x-y current that the scheme causes by itself."""
    from ..firmware import lib

    step_A = lib.ht_scheme_xy_step_pu(row, d.winding) * d.vdc_V * d.period_s / d.machine.lxy_H
    single = row.vectors == lib.HT_VECTORS_SINGLE
    if single and step_A:
        return _single_xy_A(d, step_A)
    if row.vectors in (lib.HT_VECTORS_PAIR, lib.HT_VECTORS_PAIR_SMALL):
        step_A *= 1 + _unseen(d.machine.lxy_H, d.parameter("lxy_H"))
    if row.vectors == lib.HT_VECTORS_VIRTUAL:
        # Gone at the next sample. In between only comparators look, whose levels are higher.
        above_A = d.parameter("comparator_above_pu") * d.parameter("i_full_A")
        step_A = max(0.0, step_A - above_A)
    return step_A + _swing_A(d, row)


def _xy_gain(d: Design) -> float:
    """Of the regulator of a table, in one period."""
    return 2 * float(d.parameter("kp_xy_pu_A")) * d.vdc_V * d.period_s / d.machine.lxy_H


def _swing_A(d: Design, row: Any) -> float:
    """The x-y current that the regulator of a table makes if it is unstable. It answers the current
    of the period before: i(n+1) = i(n) - gain i(n-1) grows from a gain of 1 on. Then its voltage is
    at its limit on either axis, to one side or the other. It turns a period after the current has
    passed zero, so the current goes two steps far."""
    if not row.regulated or _xy_gain(d) <= 1:
        return 0.0
    step_Wb = lib.ht_scheme_xy_limit_pu(row) * d.vdc_V * d.period_s
    return 2 * math.sqrt(2) * step_Wb / d.machine.lxy_H


def _single_xy_A(d: Design, step_A: float) -> float:
    """Peak of the x-y current in one phase if single large vectors make it and nobody controls it.

    Two parts that do not depend on each other. The vectors in their turn draw the star, mostly the
    fifth harmonic. But a vector lasts for whole periods: both of its ends are rounded by up to half
    a period, so its x-y part is wrong by a sixth of a period's step, squared mean, in no order.
    Only the resistance brings such errors down, with L_xy/R_s. If they add up for half of this
    time, sum their squares, and divide by two for one phase, the root is the standard deviation.
    """
    lxy_H, rs_ohm = d.machine.lxy_H, d.machine.rs_ohm
    reactance_ohm = 5 * d.machine.pole_pairs * rad_s(d.rated_rpm) * lxy_H
    share = reactance_ohm / math.hypot(reactance_ohm, rs_ohm)
    star_A = share * XY_FLUX_OF_LARGE * d.flux_Wb / lxy_H
    periods = lxy_H / rs_ohm / d.period_s
    made_A = math.hypot(star_A, XY_PEAK * step_A * math.sqrt(periods / 24))
    return made_A + _induced_xy_A(d, math.hypot(reactance_ohm, rs_ohm))


def _induced_xy_A(d: Design, impedance_ohm: float) -> float:
    """The current that the magnets' fifth harmonic drives through x-y at rated speed. It may be
    there where it is not told."""
    if not d.magnets:
        return 0.0
    share = max(d.machine.emf_share[:2]) or UNTOLD_EMF
    omega = d.machine.pole_pairs * rad_s(d.rated_rpm)
    return share * omega * d.machine.psi_f_Wb / impedance_ohm


def _reach(d: Design, row: Any, by_table: bool) -> Iterator[Finding]:
    """Rated speed against what the scheme's vectors and the table give."""
    p = d.parameter
    more = "raise inverter.vdc_V"
    reach_pu = d.reach_pu(row.reach_pu, by_table)
    if reach_pu < d.reach_pu(row.reach_pu):
        more += ', or take controller.table = "75/105"'
    reach_rpm = d.base_rpm(reach_pu, 1.0)
    if p("field_weakening") != "on":
        yield at_least(REACH, reach_rpm, d.rated_rpm, "r/min", more)
        return
    yield at_least(
        REACH, reach_rpm, d.rated_rpm, "r/min",
        f"the field is weakened from there on; to avoid it {more}", "note",
    )  # fmt: skip

    def most_Nm(asked: Demand) -> float:
        usable_V = p("fw_margin") * reach_pu * asked.vdc_V
        return min(p("torque_limit_Nm"), d.most_torque_Nm(asked.speed_rpm, usable_V))

    # A source that is lost is asked for nothing.
    met = [asked for asked in d.demands if asked.vdc_V > p("vdc_min_V")] or d.demands
    worst = max(met, key=lambda asked: asked.load_Nm - most_Nm(asked))
    load_Nm = worst.load_Nm
    if by_table and d.magnets:
        load_Nm += p("torque_band_Nm")  # the mean may be so far below the limit
    where = "rated speed" if worst.speed_rpm == d.rated_rpm else f"{worst.speed_rpm:.0f} r/min"
    if worst.vdc_V != d.vdc_V:
        where += f" and {worst.vdc_V:g} V"
    # A speed that gives way a little leaves the flux, and with it the torque, that the load needs.
    slower = worst._replace(speed_rpm=worst.speed_rpm - SPEED_HELD * d.rated_rpm)
    held = most_Nm(slower) >= load_Nm
    advice = f"the speed gives way by up to {100 * SPEED_HELD:g} %; to avoid it {more}"
    yield at_least(
        f"torque left at {where}", most_Nm(worst), load_Nm, "N m",
        advice if held else more, "note" if held else "bad",
    )  # fmt: skip


def _refused(setup: Setup, findings: list[Finding]) -> Iterator[Finding]:
    """The firmware's own objections to the parameters, if no finding has them already."""
    from .. import firmware

    try:
        firmware.Controller(setup["timing.device"], parameters(setup))
    except firmware.FirmwareError as error:
        if all(f.verdict != "bad" for f in findings):
            yield Finding("configuration", 0.0, "", 0.0, "", "bad", str(error))
