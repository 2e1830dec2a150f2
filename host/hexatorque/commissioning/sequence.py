"""The steps of commissioning, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from .. import firmware
from ..drive.interface import DriveFault, DriveVerbs
from . import (
    alignment,
    emf,
    encoder,
    inductance,
    kinds,
    resistance,
    rotor,
    running,
    wiring,
)
from .excitation import CommissioningError, Excitation, Limits
from .kinds import kind_of
from .regression import Value
from .result import Findings

#: Called with a line for the user.
Report = Callable[[str], None]


def default_current_A(drive: DriveVerbs) -> float:
    """A limit of the currents that suits the drive's parameters, which may be wrong."""
    needed_A = max(float(drive.get("build_current_A")), 1.5 * running.needed_A(drive))
    if running.magnets(drive):
        needed_A = float(drive.get("build_current_A")) + running.needed_A(drive)
    return min(needed_A, 0.9 * float(drive.get("i_trip_A")))


def commission(
    drive: DriveVerbs,
    limits: Limits,
    steps: Sequence[str] | None = None,
    turns_rev: float = 3.0,
    report: Report = lambda line: None,
    keep: bool = True,
    begin: Report = lambda step: None,
    end: Callable[[str, Findings], None] = lambda step, found: None,
    pause: bool = False,
) -> Findings:
    """Measure what the steps say (None: all of the machine's kind), and load the parameters that
    follow (`keep`: leave them in force, else the drive gets its own ones back). Wrong wiring ends
    it: `mistakes` names it. `begin` is called with the name of each step before it, `report` with
    each result, `end` after each step. `pause`: the gates are off while `begin` is called, which
    may take as long as it likes."""
    kind = kind_of(drive)
    steps = kind.with_needs(tuple(kind.steps) if steps is None else steps)
    _check_limits(drive, limits)
    found = Findings()
    course = Course(steps, report, begin, end, pause, turns_rev)
    before = {
        name: drive.get(name)
        for name, row in drive.params.items()
        if row.live or name in kind.loads
    }
    try:
        _COURSES[kind.name](drive, limits, found, course)
    except BaseException:
        _restore(drive, before)
        raise
    if found.mistakes or not keep:
        _restore(drive, before)
    return found


def _restore(drive: DriveVerbs, before: Mapping[str, object]) -> None:
    drive.stop()
    changed = {name: value for name, value in before.items() if drive.get(name) != value}
    if changed:
        drive.set_many(changed)


def _check_limits(drive: DriveVerbs, limits: Limits) -> None:
    trip_A = float(drive.get("i_trip_A"))
    if not 0 < limits.current_A <= trip_A:
        raise CommissioningError(
            f"current = {limits.current_A:g} A: allowed range is above 0 .. {trip_A:g} A (i_trip_A)"
        )
    if drive.state != firmware.IDLE:
        raise CommissioningError(f"the drive is in state {drive.state}: stop it, clear its faults")


@dataclass(frozen=True)
class Course:
    """The steps to do, and whom to tell of them."""

    steps: Sequence[str]
    report: Report
    begin: Report
    end: Callable[[str, Findings], None]
    pause: bool
    turns_rev: float

    def next(self, step: str, test: Excitation | None = None) -> bool:
        """Whether this step is to be done; then it begins. `test`: its gates are on."""
        if step not in self.steps:
            return False
        if test and self.pause:
            test.drive.stop()
        self.begin(step)
        if test and self.pause:
            test.begin_again(0.0)
        return True


def _induction(drive: DriveVerbs, limits: Limits, found: Findings, course: Course) -> None:
    report = course.report
    with _wired(drive, limits, found, course, wiring.check) as test:
        if not test or not found.wiring:
            return
        wires, slow_s = found.wiring, _slow_s(drive)
        if course.next("resistance", test):
            found.resistance = resistance.measure(test, wires.xy_per_H, slow_s)
            _tell_resistance(found.resistance, course, found)
        if course.next("inductance", test):
            assert found.resistance
            found.inductance = inductance.measure(
                test, found.resistance, wires.ab_per_H, wires.xy_per_H, slow_s
            )
            report(f"sigma L_s: {found.inductance.sigma_ls_H:H}, L_xy: {found.inductance.lxy_H:H}")
            course.end("inductance", found)
    if course.next("encoder"):
        _encoder(drive, limits, course.turns_rev, found, report)
        course.end("encoder", found)
    if found.mistakes:
        return
    if course.next("rotor"):
        _rotor(drive, limits, found, report)
        course.end("rotor", found)
    found.load(drive)
    if course.next("magnetisation"):
        assert found.rotor
        found.magnetisation = running.magnetisation(drive, limits)
        points = zip(found.magnetisation.flux_Wb, found.magnetisation.ls_H)
        report("L_s: " + ", ".join(f"{ls:.4g} H at {psi:.3g} Wb" for psi, ls in points))
        course.end("magnetisation", found)
        found.load(drive)
    _mechanics(drive, limits, found, course)


def _magnet(drive: DriveVerbs, limits: Limits, found: Findings, course: Course) -> None:
    report, still = course.report, kinds.at_standstill(drive, limits)
    with _wired(drive, still, found, course, wiring.check_magnets) as test:
        if not test or not found.wiring:
            return
        wires = found.wiring
        least, most = (wires.ab_per_H + way * wires.salient_per_H for way in (-1, 1))
        if course.next("resistance", test):
            found.resistance = resistance.measure_still(test, wires.xy_per_H, least)
            _tell_resistance(found.resistance, course, found)
    if course.next("alignment"):
        assert found.resistance
        with Excitation(drive, still, encoder.SLACK * course.turns_rev) as test:
            found.alignment = answer = alignment.measure(
                test, found.resistance, course.turns_rev, 1 / least - 1 / most
            )
        found.mistakes += answer.mistakes
        if not answer.mistakes:
            report(
                f"encoder: direction and counts are right; it counts 0 at {answer.zero_deg:degrees}"
                f"; friction leaves {abs(answer.friction_deg):.2g} degrees"
            )
        course.end("alignment", found)
    if found.mistakes:
        return
    if course.next("inductance"):
        assert found.resistance
        with Excitation(drive, still) as test:
            found.salient = coils = inductance.measure_magnets(
                test, found.resistance, (least, most), wires.xy_per_H
            )
        report(f"L_d: {coils.ld_H:H}, L_q: {coils.lq_H:H}, L_xy: {coils.lxy_H:H}")
        found.mistakes += _wrong_saliency(coils)
        course.end("inductance", found)
    if found.mistakes:
        return
    found.load(drive)
    if course.next("magnets"):
        assert found.resistance
        found.emf = emf.measure(drive, limits, found.resistance.mean_lost_V.value)
        parts = [f"psi_f: {found.emf.psi_f_Wb:Wb}"]
        for k, order in enumerate(("fifth", "seventh")[: len(found.emf.harmonics)]):
            share, angle = found.emf.share(k), found.emf.degrees(k)
            parts.append(
                f"{order} harmonic: {100 * share.value:.2g} % ±{100 * share.uncertainty:.2g} at "
                f"{angle:degrees}"
            )
        report(", ".join(parts))
        course.end("magnets", found)
        found.load(drive)
    _mechanics(drive, limits, found, course)


_COURSES = {"induction": _induction, "magnet": _magnet}


def _wrong_saliency(coils: inductance.Salient) -> list[str]:
    if not coils.too_much:
        return []
    return [
        f"L_d = {coils.ld_H:H} is above L_q = {coils.lq_H:H}: the firmware drives magnets with L_d "
        "up to L_q"
    ]


@contextmanager
def _wired(
    drive: DriveVerbs,
    limits: Limits,
    found: Findings,
    course: Course,
    check: Callable[[Excitation], wiring.Wiring],
) -> Iterator[Excitation | None]:
    """A test after the step `wiring`, in which the next steps may go on; None if there was a
    mistake."""
    course.next("wiring")
    with Excitation(drive, limits) as test:
        try:
            found.wiring = wires = check(test)
        except DriveFault as fault:
            found.mistakes.append(_tripped(fault, limits))
            drive.clear()
            yield None
            return
        found.noise_A = test.noise_A()
        found.mistakes += wires.mistakes
        if not wires.mistakes:
            course.report("wiring: leads and current sensors are right")
        course.end("wiring", found)
        yield None if wires.mistakes else test


def _tell_resistance(of: resistance.Resistance, course: Course, found: Findings) -> None:
    course.report(f"R_s: {of.mean_ohm:ohm}, phases " + _list(of.rs_ohm))
    course.report(f"dead time and devices: {of.mean_lost_V:V} on each leg")
    course.end("resistance", found)


def _tripped(fault: DriveFault, limits: Limits) -> str:
    causes = ", ".join(fault.causes)
    if set(fault.causes) <= _of_the_computer():
        return f"{causes} during the first pulses: this says nothing about machine and wiring"
    return (
        f"{causes} during the first pulses, below {limits.current_A:g} A: a limit "
        "that the first pulse already passes, a short circuit, or a sensor whose range is not "
        "i_full_A"
    )


def _of_the_computer() -> set[str]:
    """The causes that no current and no voltage explains."""
    lib = firmware.lib
    bits = lib.HT_FAULT_LINK | lib.HT_FAULT_CLOCK | lib.HT_FAULT_OVERRUN | lib.HT_FAULT_INTERRUPT
    return set(firmware.causes(bits))


def _encoder(
    drive: DriveVerbs, limits: Limits, turns_rev: float, found: Findings, report: Report
) -> None:
    assert found.resistance
    with Excitation(drive, limits, encoder.SLACK * turns_rev) as test:
        found.encoder = answer = encoder.check(test, found.resistance, turns_rev)
    found.mistakes += answer.mistakes
    if not answer.mistakes:
        report(f"encoder: direction and counts are right, {100 * answer.ratio:.1f} % of the field")


def _rotor(drive: DriveVerbs, limits: Limits, found: Findings, report: Report) -> None:
    assert found.resistance and found.inductance
    ls = float(drive.get("lm_H")) + found.inductance.sigma_ls_H.value / 2
    current_A = float(drive.get("flux_ref_Wb")) / ls
    guess = (float(drive.get("rr_ohm")), float(drive.get("lm_H")))
    with Excitation(drive, limits) as test:
        found.rotor = rotor.measure(test, found.resistance, found.inductance, current_A, guess)
    report(f"R_r: {found.rotor.rr_ohm:ohm}, L_m: {found.rotor.lm_H:H}")


def _mechanics(drive: DriveVerbs, limits: Limits, found: Findings, course: Course) -> None:
    if course.next("mechanics"):
        found.mechanics = running.mechanics(drive, limits)
        course.report(
            f"inertia: {found.mechanics.inertia_kgm2:kg m2}, friction: {found.mechanics.dry_Nm:N m}"
            f" and {found.mechanics.viscous_Nms:N m s}"
        )
        course.report(f"load: {found.mechanics.curve()}")
        course.end("mechanics", found)
        found.load(drive)


def _slow_s(drive: DriveVerbs) -> float:
    rs, rr, lm = (float(drive.get(name)) for name in ("rs_ohm", "rr_ohm", "lm_H"))
    return float(np.clip(lm / max(rs, 1e-4) + lm / max(rr, 1e-4), 0.05, 5.0))


def _list(values: Sequence[Value]) -> str:
    return " ".join(f"{value.value:.4g}" for value in values)
