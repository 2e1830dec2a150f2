"""The steps of commissioning, in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .. import firmware
from ..drive.interface import DriveFault, DriveVerbs
from . import encoder, inductance, resistance, rotor, running, wiring
from .excitation import CommissioningError, Excitation, Limits
from .regression import Value
from .result import Findings

#: Name -> what the step does.
STEPS = {
    "wiring": "sensors and motor leads",
    "resistance": "R_s of each phase, dead time and device drops",
    "inductance": "sigma L_s, L_xy",
    "encoder": "its direction and counts: the shaft turns slowly",
    "rotor": "R_r and L_m at standstill",
    "magnetisation": "L_m at five fluxes: the drive runs without load",
    "mechanics": "inertia, friction and load: the drive accelerates, brakes, then coasts",
}
#: Steps that a step needs; they run as well.
NEEDS = {
    "wiring": (),
    "resistance": ("wiring",),
    "inductance": ("wiring", "resistance"),
    "encoder": ("wiring", "resistance"),
    "rotor": ("wiring", "resistance", "inductance"),
    "magnetisation": ("wiring", "resistance", "inductance", "encoder", "rotor"),
    "mechanics": ("wiring", "resistance", "inductance", "encoder", "rotor"),
}
#: Called with a line for the user.
Report = Callable[[str], None]


def with_needs(steps: Sequence[str]) -> list[str]:
    """The steps and those that they need, in their order."""
    wanted = {need for step in steps for need in (step, *NEEDS[step])}
    return [step for step in STEPS if step in wanted]


def default_current_A(drive: DriveVerbs) -> float:
    """A limit of the currents that suits the drive's parameters, which may be wrong."""
    needed_A = max(float(drive.get("build_current_A")), 1.5 * running.needed_A(drive))
    return min(needed_A, 0.9 * float(drive.get("i_trip_A")))


def commission(
    drive: DriveVerbs,
    limits: Limits,
    steps: Sequence[str] = tuple(STEPS),
    turns_rev: float = 3.0,
    report: Report = lambda line: None,
    keep: bool = True,
    begin: Report = lambda step: None,
    end: Callable[[str, Findings], None] = lambda step, found: None,
    pause: bool = False,
) -> Findings:
    """Measure what the steps say, and load the parameters that follow (`keep`: leave them in
    force, else the drive gets its own ones back). Wrong wiring ends it: `mistakes` names it.
    `begin` is called with the name of each step before it, `report` with each result, `end` after
    each step. `pause`: the gates are off while `begin` is called, which may take as long as it
    likes."""
    steps = with_needs(steps)
    _check_machine(drive)
    _check_limits(drive, limits)
    found = Findings()
    course = Course(steps, report, begin, end, pause)
    before = {name: drive.get(name) for name in drive.params if drive.params[name].live}
    try:
        _standstill(drive, limits, found, course)
        if not found.mistakes and course.next("encoder"):
            _encoder(drive, limits, turns_rev, found, report)
            end("encoder", found)
        if not found.mistakes and course.next("rotor"):
            _rotor(drive, limits, found, report)
            end("rotor", found)
        if not found.mistakes:
            found.load(drive)
            _running(drive, limits, found, course)
            found.load(drive)
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


def _check_machine(drive: DriveVerbs) -> None:
    if "machine" in drive.params and drive.get("machine") == "magnet":
        raise CommissioningError(
            "machine = magnet: these steps measure a rotor with a winding, and their direct "
            "current would turn one with magnets; give its values in [machine]"
        )

    if "displacement_deg" in drive.params and drive.get("displacement_deg") != "30":
        raise CommissioningError(
            f"displacement_deg = {drive.get('displacement_deg')}: these steps measure a winding "
            "whose sets are 30 degrees apart"
        )


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


def _standstill(drive: DriveVerbs, limits: Limits, found: Findings, course: Course) -> None:
    report = course.report
    course.next("wiring")
    with Excitation(drive, limits) as test:
        try:
            found.wiring = wires = wiring.check(test)
        except DriveFault as fault:
            found.mistakes.append(_tripped(fault, limits))
            drive.clear()
            return
        found.noise_A = test.noise_A()
        found.mistakes += wires.mistakes
        if not wires.mistakes:
            report("wiring: leads and current sensors are right")
        course.end("wiring", found)
        if wires.mistakes:
            return
        slow_s = _slow_s(drive)
        if course.next("resistance", test):
            found.resistance = resistance.measure(test, wires.xy_per_H, slow_s)
            report(
                f"R_s: {found.resistance.mean_ohm:ohm}, phases " + _list(found.resistance.rs_ohm)
            )
            report(f"dead time and devices: {found.resistance.mean_lost_V:V} on each leg")
            course.end("resistance", found)
        if course.next("inductance", test):
            assert found.resistance
            found.inductance = inductance.measure(
                test, found.resistance, wires.ab_per_H, wires.xy_per_H, slow_s
            )
            report(f"sigma L_s: {found.inductance.sigma_ls_H:H}, L_xy: {found.inductance.lxy_H:H}")
            course.end("inductance", found)


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


def _running(drive: DriveVerbs, limits: Limits, found: Findings, course: Course) -> None:
    report = course.report
    if course.next("magnetisation"):
        assert found.rotor
        found.magnetisation = running.magnetisation(drive, limits)
        points = zip(found.magnetisation.flux_Wb, found.magnetisation.ls_H)
        report("L_s: " + ", ".join(f"{ls:.4g} H at {psi:.3g} Wb" for psi, ls in points))
        course.end("magnetisation", found)
        found.load(drive)
    if course.next("mechanics"):
        found.mechanics = running.mechanics(drive, limits)
        report(
            f"inertia: {found.mechanics.inertia_kgm2:kg m2}, friction: {found.mechanics.dry_Nm:N m}"
            f" and {found.mechanics.viscous_Nms:N m s}"
        )
        report(f"load: {found.mechanics.curve()}")
        course.end("mechanics", found)


def _slow_s(drive: DriveVerbs) -> float:
    rs, rr, lm = (float(drive.get(name)) for name in ("rs_ohm", "rr_ohm", "lm_H"))
    return float(np.clip(lm / max(rs, 1e-4) + lm / max(rr, 1e-4), 0.05, 5.0))


def _list(values: Sequence[Value]) -> str:
    return " ".join(f"{value.value:.4g}" for value in values)
