"""A start into a turning shaft with magnets: control begins with voltages that match what they
induce. The current of a few periods with all legs low tells whether the believed angle is right.
"""

import itertools
import random
from typing import NamedTuple

import numpy as np
import pytest
from campaigns import part

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import BUILD, CALIBRATE, FAULT, IDLE, RUN, FirmwareError, ffi, lib
from hexatorque.plant.vsd import inverse
from hexatorque.setups import parameters
from hexatorque.setups.design import Design
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.setups.review import ready_of, review

START_DEG = 37.0
DRIVES = [
    ("magnet-interior", "db-dtfc"),
    ("magnet-interior", "fdr"),
    ("magnet-surface", "ddr"),
    ("magnet-surface", "dtc3"),
    ("magnet-24v", "foc-24"),
]
#: Largest current while a shaft is caught, over the rated one. The scheme's ripple is in it.
MOST = 1.0


class Shaft:
    """A drive whose shaft is turned from outside."""

    def __init__(self, name, scheme, wrong_deg=None, **more):
        if wrong_deg is not None:
            more |= {
                "controller__rotor_start": "known",
                "controller__rotor_zero_deg": START_DEG + wrong_deg,
            }
        setup = setups.load(name).with_scheme(
            scheme, machine__start_deg=START_DEG, load__kind="constant", **more
        )
        self.trip_A = setup.parameter("i_trip_A")
        self.displacement_deg = setup.machine_values()["displacement_deg"]
        self.drive = SimulatedDrive(setup, 4)
        self.design = Design(setup, parameters(setup).__getitem__)
        self.ceiling_rpm = self.drive.machine.ceiling_rpm(self.drive.vdc_V)

    def aligned(self):
        self.drive.start()
        while self.drive.time_s < 5 and self.drive.state in (CALIBRATE, BUILD):
            self.drive.run(0.05, record=False)
        assert self.drive.state == RUN
        self.drive.stop()
        return self

    def turned(self, share, seconds=0.05):
        self.rpm = share * self.ceiling_rpm
        for _ in range(round(seconds / 1e-3)):
            self.drive.plant_state[6] = self.rpm * np.pi / 30
            self.drive.run(1e-3, record=False)
        return self

    def started(self):
        """Peaks of current and torque over the rated ones, from START on."""
        drive = self.drive
        drive.set("speed_ref_rpm", self.rpm)
        drive.start()
        while drive.state == CALIBRATE:
            self.turned(self.rpm / self.ceiling_rpm, 1e-3)
        drive.discard()
        drive.run(0.1)
        rec = drive.take()
        current = np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]).max()
        torque = np.abs(rec["plant.torque_Nm"]).max()
        planes = [rec[f"plant.i_{axis}_A"] for axis in ("alpha", "beta", "x", "y")]
        self.peak_A = np.abs(inverse(self.displacement_deg) @ planes).max()
        return current / self.design.rated_A, torque / self.design.rated_Nm


@pytest.mark.parametrize("name, scheme", DRIVES)
@pytest.mark.parametrize("share", [-0.85, -0.2, 0.06, 0.5, 0.85])
def test_a_turning_shaft_is_caught(name, scheme, share):
    """After a stop; its angle is known from the alignment before."""
    shaft = Shaft(name, scheme).aligned().turned(share)
    current, torque = shaft.started()
    assert shaft.drive.state == RUN, shaft.drive.trip
    assert current < MOST and torque < 0.75
    assert abs(shaft.drive.speed_rpm / shaft.rpm - 1) < 0.05
    assert shaft.drive.gate_mistake == "" and shaft.drive.controller.registers.violations == 0


class Case(NamedTuple):
    name: str
    scheme: str
    share: float  #: of the ceiling
    pause_s: float  #: with the gates off
    off: float  #: share by which the machine differs from what the drive believes


def allowed(name):
    """The schemes that `check` passes."""
    schemes = firmware.schemes()
    return ready_of(review(setups.load(name), schemes), schemes)


CASES = [
    Case(name, scheme, sign * share, pause_s, off)
    for name in dict.fromkeys(name for name, _ in DRIVES)
    for scheme in allowed(name)
    for share, sign, pause_s, off in itertools.product(
        (0.1, 0.5, 0.85), (1, -1), (0.01, 0.3, 3.0), (-1.0, 1.0)
    )
]


@pytest.mark.parametrize("case", part(CASES, 12), ids=str)
def test_every_scheme_catches_a_machine_that_it_does_not_know(case):
    """Nothing decays with magnets: the pause changes how far the angle has turned. The current
    stays below 0.8 of the trip."""
    draw = random.Random(str(case))
    base = setups.load(case.name)
    known = {
        f"controller__{n}": v for n, v in setups.parameters(base.with_scheme(case.scheme)).items()
        if n not in TIMING_OWNS
    }  # fmt: skip
    off = {"rs_ohm": 0.2, "psi_f_Wb": 0.05, "ld_H": 0.1, "lq_H": 0.1, "lxy_H": 0.1}
    machine = {
        f"machine__{n}": base[f"machine.{n}"] * (1 + case.off * draw.choice((-1, 1)) * by)
        for n, by in off.items()
    }
    noise = {"sensors__i_noise_A": 0.002 * base["sensors.i_full_A"], "sensors__noise_seed": 7}
    shaft = Shaft(case.name, case.scheme, **known, **machine, **noise).aligned()
    shaft.turned(case.share, case.pause_s)
    shaft.started()
    assert shaft.drive.state == RUN, shaft.drive.trip
    assert shaft.peak_A < 0.8 * shaft.trip_A


@pytest.mark.parametrize("latency", ["none", "immediate", "shadow"])
def test_with_every_latency(latency):
    shaft = Shaft("magnet-interior", "ddr", wrong_deg=0.0, timing__latency=latency).turned(0.5)
    assert shaft.started()[0] < 1.3  # without a prediction the scheme ripples more
    assert shaft.drive.state == RUN, shaft.drive.trip


@pytest.mark.parametrize("share", [-0.6, 0.06, 0.6])
@pytest.mark.parametrize("wrong_deg", [-170.0, -90.0, -45.0, -15.0, 0.0, 15.0, 45.0, 90.0, 180.0])
def test_a_wrong_angle_gives_no_torque(share, wrong_deg):
    """30 degrees are allowed. Beyond, the drive trips after some periods, in which the machine
    brakes a little by itself."""
    shaft = Shaft("magnet-surface", "foc", wrong_deg).turned(share)
    _, torque = shaft.started()
    if abs(wrong_deg) < 30:
        assert shaft.drive.state == RUN, shaft.drive.trip
    else:
        assert shaft.drive.state == FAULT
        assert shaft.drive.faults == ["encoder against flux speed"]
        assert torque < 0.4


def refused(shaft):
    with pytest.raises(FirmwareError) as error:
        shaft.drive.start()
    assert "cannot be caught now (only with all legs; magnets: where their angle is known" in str(
        error.value
    )
    assert "\n" not in str(error.value)
    assert shaft.drive.state == IDLE


def test_without_a_known_angle_it_is_refused_in_a_line():
    refused(Shaft("magnet-surface", "ddr").turned(0.3))


def test_after_an_encoder_fault_the_angle_is_not_known():
    shaft = Shaft("magnet-surface", "ddr").aligned().turned(0.3)
    lib.ht_drive_trip(shaft.drive.controller.drive, lib.HT_FAULT_ENCODER)
    shaft.drive.clear()
    refused(shaft.turned(0.3))


def test_after_a_parameter_that_sets_the_drive_up_again_it_is_not_known():
    shaft = Shaft("magnet-surface", "ddr").aligned().turned(0.3)
    shaft.drive.set("calibration_s", 0.03)
    refused(shaft)


def test_without_a_leg_it_is_refused():
    """The current with all legs low is another one then."""
    shaft = Shaft(
        "magnet-surface", "ddr", wrong_deg=0.0, controller__lost_legs=32,
        controller__ride_through="least-loss", controller__i_rated_A=3.5,
    )  # fmt: skip
    refused(shaft.turned(0.3))


def test_near_the_ceiling_it_is_refused():
    shaft = Shaft("magnet-surface", "ddr").aligned()
    refused(shaft.turned(0.92))


def test_a_shaft_that_stands_is_aligned():
    shaft = Shaft("magnet-surface", "ddr").aligned()
    shaft.drive.run(0.5, record=False)
    shaft.aligned()


MACHINE = {"r": 0.8, "ld": 6.4e-3, "lq": 17.4e-3, "psi_f": 0.1746}


def observer():
    c = ffi.new("ht_observer_config *")
    c.ts_s, c.rs_ohm, c.sigma_ls_H = 1e-4, MACHINE["r"], MACHINE["lq"]
    c.rotor = lib.HT_ROTOR_MAGNET
    m = c.magnet
    m.psi_f_Wb, m.inv_psi_f = MACHINE["psi_f"], 1 / MACHINE["psi_f"]
    m.ld_H, m.lq_H, m.inv_ld = MACHINE["ld"], MACHINE["lq"], 1 / MACHINE["ld"]
    m.saliency_H = m.ld_H - m.lq_H
    return c


@pytest.mark.parametrize("omega", [-900.0, 40.0, 900.0])
@pytest.mark.parametrize("off_deg, size, caught", [
    (0, 1.0, True), (28, 1.0, True), (-28, 1.0, True), (32, 1.0, False), (180, 1.0, False),
    (0, 0.35, True), (0, 0.25, False), (0, 0.0, False), (0, np.nan, False),
])  # fmt: skip
def test_what_the_current_must_show(omega, off_deg, size, caught):
    """Against the current of the shorted machine: L_d i_d' = w L_q i_q - R i_d, and L_q i_q' =
    -w (L_d i_d + psi_f) - R i_q, here by small Euler steps."""
    cfg, st = observer(), ffi.new("ht_rotor_catch_state *")
    lib.ht_rotor_catch_begin(st)
    d = q = angle = 0.0
    steps, dt = 200, 1e-4 / 200
    found, periods = lib.HT_CATCHING, 0
    while found == lib.HT_CATCHING and periods < 200:
        for _ in range(steps):
            d, q = (
                d + dt * (omega * MACHINE["lq"] * q - MACHINE["r"] * d) / MACHINE["ld"],
                q + dt * (-omega * (MACHINE["ld"] * d + MACHINE["psi_f"]) - MACHINE["r"] * q)
                / MACHINE["lq"],
            )  # fmt: skip
            angle += dt * omega
        axis = np.exp(1j * angle)
        i = size * (d + 1j * q) * axis * np.exp(1j * np.deg2rad(off_deg))
        found = lib.ht_rotor_catch_step(
            cfg, st, omega, [axis.real, axis.imag], [i.real, i.imag], 30.0
        )
        periods += 1
    assert found == (lib.HT_CAUGHT if caught else lib.HT_NOT_CAUGHT)
    assert np.hypot(d, q) > 0.05 * 30.0 * 0.99 and np.hypot(d, q) < 0.2 * 30.0
