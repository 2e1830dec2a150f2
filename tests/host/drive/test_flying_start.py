"""A start on a turning shaft: the drive takes over what flux is left, builds up the rest without
torque, and goes on with its scheme. It believes another machine than it has."""

import itertools
import math
import random
from typing import NamedTuple

import numpy as np
import pytest
from campaigns import part

from hexatorque import HexatorqueError, SimulatedDrive, firmware, load, setups
from hexatorque.plant.vsd import inverse
from hexatorque.setups import estimate, new
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.setups.published import machines

#: Full speed, r/min. The last three are published machines whose plate is all that the drive knows.
SETUPS = {
    "paper-a-feasible": 1350.0, "paper-b-fitted": 2700.0, "small-2kw": 2850.0,
    "large-110kw": 1487.0, "symmetrical": 1400.0,
    "37 kW 400 V": 1480.0, "Krause 3 hp": 1710.0, "150 hp 460 V": 1785.0,
}  # fmt: skip
SHARES = (0.1, 0.5, 1.0, 1.5)
#: Times with the gates off, in time constants of the rotor; None: the machine has never had a flux.
PAUSES = (None, 0.0, 0.3, 1.0, 2.0, 5.0)
#: No current of a catch may come nearer to the trip.
MOST = 0.8
#: Seconds in which a drive that was not caught may come as near to the trip.
ALONE_S = 200
#: The shaft feels no more than this, in torque limits, before torque control begins; the flux is
#: known within this, in references.
TORQUE, FLUX = 0.35, 0.25
AXES = ("alpha", "beta")
#: The shaft is held at its speed while the gates are off: looked at this often.
HELD_S = 0.01


class Case(NamedTuple):
    setup: str
    scheme: str
    speed: float  #: of full speed
    rr: float  #: the machine's R_r over what the drive believes


def believed(name):
    """The set-up that the drive is designed for, with every parameter written out."""
    published = {machine.name: machine for machine in machines()}
    if name in published:
        plate = estimate.examples(published[name])[0].plate
        base = setups.parse(new.from_nameplate(plate.told(), "x"), "x")
    else:
        base = load(name)
    values = setups.parameters(base)
    return base.changed({f"controller.{n}": v for n, v in values.items() if n not in TIMING_OWNS})


def true(case):
    """The same with another machine, and with noise."""
    base = believed(case.setup).changed(
        {"controller.scheme": case.scheme, "controller.speed_trip_rpm": 3 * SETUPS[case.setup]}
    )
    draw = random.Random(str(case))
    return base.changed(
        {
            "machine.rr_ohm": case.rr * base["machine.rr_ohm"],
            "machine.rs_ohm": draw.uniform(0.85, 1.15) * base["machine.rs_ohm"],
            "machine.lm_H": draw.uniform(0.9, 1.1) * base["machine.lm_H"],
            "sensors.i_noise_A": 0.002 * base["sensors.i_full_A"],
            "sensors.noise_seed": draw.randint(1, 1000),
        }
    )


def _schemes(name):
    """Those that the set-up's machine and timing allow."""
    for scheme in firmware.schemes():
        try:
            setups.parameters(believed(name).changed({"controller.scheme": scheme}))
        except HexatorqueError:
            continue
        yield scheme


CASES = [
    Case(name, scheme, sign * share, rr)
    for name in SETUPS
    for scheme in _schemes(name)
    for share, sign, rr in itertools.product(SHARES, (1, -1), (0.7, 1.3))
]


class Shaft:
    """A drive whose shaft is turned from outside while its gates are off."""

    def __init__(self, case):
        self.setup = true(case)
        self.sim = SimulatedDrive(self.setup, 4)
        self.rpm = case.speed * SETUPS[case.setup]
        self.tau_s = self.number("lr_H") / self.number("rr_ohm")
        self.trip_A = self.number("i_trip_A")
        self.sim.set("speed_ref_rpm", self.rpm)

    def number(self, name):
        return self.sim.controller.number(name)

    def turn(self, duration_s, rpm=None):
        rpm = self.rpm if rpm is None else rpm
        while duration_s > 0:
            self.sim.plant_state[6] = rpm * np.pi / 30
            step_s = min(duration_s, HELD_S)
            self.sim.run(step_s, record=False)
            duration_s -= step_s
        self.sim.plant_state[6] = rpm * np.pi / 30

    def peak(self, duration_s):
        """The largest phase current of this time, in trips; `torque` is the largest torque in
        torque limits, `flux` how far the flux is off at the end, in references."""
        self.sim.discard()
        self.sim.run(duration_s)
        rec = self.sim.take()
        torque_Nm = np.abs(rec["plant.torque_Nm"]).max()
        self.torque = float(torque_Nm) / self.number("torque_limit_Nm")
        off = [rec[f"plant.psi_{axis}_Wb"][-1] - rec[f"psi_{axis}_Wb"][-1] for axis in AXES]
        self.flux = float(np.hypot(*off)) / self.number("flux_ref_Wb")
        planes = [rec[f"plant.i_{axis}_A"] for axis in (*AXES, "x", "y")]
        legs = inverse(self.setup.machine_values()["displacement_deg"]) @ np.array(planes)
        return float(np.abs(legs).max()) / self.trip_A

    def unknown_s(self):
        """Until a flux that the drive does not know of has decayed."""
        return 4.0 * self.tau_s

    def caught(self):
        """Start, and 0.3 s of torque control: the largest current of each; torque and flux of the
        first, and as `failed` its faults."""
        self.sim.start()
        build = self.peak(self.number("calibration_s") + self.number("build_s"))
        torque, flux, self.failed = self.torque, self.flux, self.sim.faults
        return build, self.peak(0.3), torque, flux


def never_caught(case):
    """The same drive, when it has come there from standstill; None if the scheme cannot drive this
    machine there."""
    shaft = Shaft(case)
    shaft.sim.set("speed_ref_rpm", 0.0)
    shaft.sim.start()
    shaft.sim.run(shaft.number("calibration_s") + shaft.number("build_s") + 0.05, record=False)
    shaft.sim.set("control_mode", "torque")
    for share in np.linspace(0.0, 1.0, 50):
        shaft.turn(0.02, share * shaft.rpm)
    shaft.sim.set_many({"control_mode": "speed", "speed_ref_rpm": shaft.rpm})
    shaft.sim.run(1.0, record=False)
    return shaft if shaft.sim.state == firmware.RUN else None


def comes_as_near(alone, trips):
    """Whether the drive that was not caught comes near the trip, too. trips: it must trip."""
    for _ in range(ALONE_S):
        near = alone.peak(1.0) >= MOST
        if alone.sim.faults or (near and not trips):
            return True
    return False


def tried(case):
    """A row for each pause: pause, faults in the catch, faults until 0.3 s later, and what `caught`
    returns."""
    shaft = Shaft(case)
    for pause in PAUSES:
        if pause is None:
            shaft.turn(shaft.unknown_s())
        else:
            shaft.sim.stop()
            shaft.turn(pause * shaft.tau_s)
        found = shaft.caught()
        yield pause, shaft.failed, shaft.sim.faults, *found
        if shaft.sim.state != firmware.RUN:
            return


@pytest.mark.parametrize("case", part(CASES, 12), ids=str)
def test_a_turning_shaft_is_caught(case):
    """In both directions, up to half as much again as full speed, after every pause, and
    whatever the rotor's resistance is. A scheme that cannot drive the machine there at all has
    nothing to show.

    The catch itself never comes near the trip, nor does the scheme that takes over, unless it does
    so without a catch, too."""
    alone = never_caught(case)
    if alone is None:
        pytest.skip("the scheme cannot drive this machine at this speed")
    after = []
    for pause, failed, faults, build, run, torque, flux in tried(case):
        assert not failed and build < MOST, pause
        assert torque < TORQUE and flux < FLUX, pause
        after.append(math.inf if faults else run)
    if max(after) >= MOST:
        assert comes_as_near(alone, math.isinf(max(after)))


@pytest.mark.parametrize("setup", ("large-110kw", "37 kW 400 V"))
def test_without_the_flux_that_is_left_the_drive_trips(setup):
    """What the seed of the observer is for: taken for none, the whole flux of a machine of little
    leakage drives the current to the trip."""
    shaft = Shaft(Case(setup, "ddr", 1.0, 1.3))
    shaft.turn(shaft.unknown_s())
    assert max(shaft.caught()) < MOST
    shaft.sim.stop()
    shaft.turn(HELD_S)
    flux = shaft.sim.controller.drive.control.observer
    flux.psi_Wb.alpha = flux.psi_Wb.beta = 0.0
    shaft.caught()
    assert shaft.sim.faults == ["over-current"]


@pytest.mark.parametrize("setup", ("large-110kw", "paper-b-fitted"))
def test_a_standing_machine_keeps_its_flux(setup):
    """A quick restart at standstill: the flux that is left is taken over there, too. Taken for
    none, it makes the estimate of the large machine 45 % wrong."""
    sim = SimulatedDrive(load(setup), 1)
    ready_s = sim.controller.number("calibration_s") + sim.controller.number("build_s")
    sim.start()
    sim.run(ready_s + 0.3, record=False)
    sim.stop()
    sim.run(0.001, record=False)
    sim.start()
    sim.run(ready_s + 0.02, record=False)
    sim.run(0.5)
    rec = sim.take()
    off = np.hypot(*(rec[f"plant.psi_{axis}_Wb"] - rec[f"psi_{axis}_Wb"] for axis in AXES))
    assert sim.state == firmware.RUN
    assert off.max() < 0.02 * sim.controller.number("flux_ref_Wb")


def test_a_profile_stops_and_starts_the_drive():
    """`examples/flying.toml`: without a current it coasts, and then it goes on at its speed."""
    sim = SimulatedDrive("examples/flying.toml", 1)
    sim.run_profile(sim.setup.profile)
    rec = sim.take()
    t_s = np.arange(len(rec["state"])) * sim.period_s
    off = (t_s > 2.02) & (t_s < 2.19)
    assert np.hypot(*(rec[f"plant.i_{axis}_A"] for axis in AXES))[off].max() < 1e-3
    assert sim.state == firmware.RUN
    assert sim.speed_rpm == pytest.approx(1350, rel=0.02)
