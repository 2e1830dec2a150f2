"""The drive with the flux of least loss: less loss than with any other flux, no more than with the
constant one, and a torque that is asked for suddenly comes without a trip."""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from campaigns import part

from hexatorque import SetupError, SimulatedDrive, firmware, load
from hexatorque.analysis.losses import balance, bridge
from hexatorque.experiments.operating_points import CYCLES, MOST_EDGES
from hexatorque.setups import derived, parameters
from hexatorque.setups.design import Design

SETUPS = (
    "paper-a", "paper-a-feasible", "paper-b", "paper-b-fitted", "small-2kw", "large-110kw",
    "symmetrical",
)  # fmt: skip
MAGNETS = ("magnet-interior", "magnet-surface", "magnet-24v")
#: Without dtc1: `check` refuses it on two of the machines, whose trip its x-y current reaches.
SCHEMES = tuple(scheme for scheme in firmware.schemes() if scheme != "dtc1")
#: Their mean torque is its reference. That of db-ipwm is estimated 23 % off where R_r is 30 % off.
MEAN = ("db-dtfc", "foc", "foc-24")
WAIT_S = 0.3


def rated(setup):
    """(torque, speed)"""
    design = Design(setup, setup.parameter)
    return design.rated_Nm, setup["rated.speed_rpm"] or design.rated_rpm


def with_iron(setup, share=0.02):
    """The iron loses this share of rated power at rated speed and flux, half of it by eddies."""
    torque_Nm, speed_rpm = rated(setup)
    flux_Wb = float(setup.parameter("flux_ref_Wb"))
    omega = setup["machine.pole_pairs"] * speed_rpm * math.pi / 30
    half_W = 0.5 * share * torque_Nm * speed_rpm * math.pi / 30
    return setup.changed(
        machine__iron_hysteresis_A_Wb=half_W / (flux_Wb**2 * omega),
        machine__iron_eddy_S=half_W / (flux_Wb * omega) ** 2,
    )


@functools.cache
def ruled(name, scheme, iron=0.02, **changes):
    """The set-up with the option on. changes: further ones."""
    setup = with_iron(load(name), iron) if iron else load(name)
    setup = setup.changed(
        controller__scheme=scheme,
        controller__flux_least_loss="on",
        controller__flux_wait_s=WAIT_S,
        load__kind="constant",
    )
    if name in MAGNETS:
        return setup.changed(**changes) if changes else setup
    # As derived. The papers' set-ups have the firmware's defaults. Half of the rated slip of
    # paper-b-fitted is its 150 r/min between encoder and flux: an R_r that is 30 % off trips it
    # under load with any flux.
    slip_rpm = derived.OPEN["encoder_trip_rpm"].value(derived.Known(setup, parameters(setup)))
    setup = setup.changed(
        controller__flux_reserve_Nm=0.5 * rated(setup)[0], controller__encoder_trip_rpm=slip_rpm
    )
    return setup.changed(**changes) if changes else setup


# -- sudden torque ---------------------------------------------------------------------------


class Step(NamedTuple):
    setup: str
    scheme: str
    reference: str  #: what jumps: the load, which the speed regulator meets, or the torque's
    way: float
    ohm: float  #: the machine's R_r, with magnets R_s, over the believed one


def _allowed(setups):
    for name, scheme in itertools.product(setups, SCHEMES):
        try:
            yield ruled(name, scheme).name and (name, scheme)
        except SetupError:
            continue


STEPS, MAGNET_STEPS = (
    [
        Step(*pair, *rest)
        for pair in _allowed(setups)
        for rest in itertools.product(("load", "torque"), (-1.0, 1.0), (0.7, 1.0, 1.3))
    ]
    for setups in (SETUPS, MAGNETS)
)


def started(setup, samples_per_period):
    sim = SimulatedDrive(setup, samples_per_period=samples_per_period)
    sim.start()
    while sim.state in (firmware.CALIBRATE, firmware.BUILD):
        sim.run(0.1, record=False)
    return sim


def stepped(case, iron=0.02):
    """(the drive 1 s after its torque went from 10 to 100 %, the flux before, the final torque)."""
    setup = ruled(case.setup, case.scheme, iron)
    torque_Nm, speed_rpm = rated(setup)
    speed_rpm = case.way * (setup["point.speed_rpm"] or 0.5 * speed_rpm)
    name = "rs_ohm" if case.setup in MAGNETS else "rr_ohm"
    believed = setup[f"machine.{name}"]
    setup = setup.changed({f"controller.{name}": believed, f"machine.{name}": case.ohm * believed})
    if case.reference == "torque":
        setup = setup.changed(load__kind="generator", load__at_rpm=abs(speed_rpm))
    sim = started(setup, 1)
    if case.reference == "torque":
        sim.run(1.0, record=False)
        sim.set_many({"control_mode": "torque", "torque_ref_Nm": 0.1 * case.way * torque_Nm})
        sim.load_Nm = torque_Nm
    else:
        sim.set("speed_ref_rpm", speed_rpm)
        sim.run(2.5, record=False)
        sim.load_Nm = case.way * 0.1 * torque_Nm
    sim.run(4.0, record=False)
    if sim.faults:
        return sim, math.nan, math.nan
    flux_Wb = sim.controller.channel("flux_ref_Wb")
    if case.reference == "torque":
        sim.set("torque_ref_Nm", case.way * torque_Nm)
    else:
        sim.load_Nm = case.way * torque_Nm
    sim.run(1.0, record=False)
    torque = case.way * sim.controller.channel("torque_Nm")
    return sim, flux_Wb, torque / torque_Nm


@pytest.mark.parametrize(
    "case",
    part(STEPS, 24),
    ids=lambda case: "-".join(map(str, case)),
)
def test_a_step_from_10_to_100_per_cent_of_torque_never_trips(case):
    sim, flux_Wb, torque = stepped(case)
    assert not sim.faults
    if case.setup != "paper-b-fitted":  # its flux is little from the beginning
        assert flux_Wb < 0.8 * sim.setup.parameter("flux_ref_Wb")
    if case.setup != "paper-a" and case.scheme in MEAN:  # A asks for too much
        assert torque == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("case", part(MAGNET_STEPS, 20), ids=lambda case: "-".join(map(str, case)))
def test_with_magnets_neither(case):
    """With iron that takes much flux away."""
    sim, flux_Wb, torque = stepped(case, 0.1)
    assert not sim.faults
    # At 10 % of torque the generator is slow; little of the surface magnets' flux is taken away.
    if case.reference == "load" and case.setup != "magnet-surface":
        assert flux_Wb < 0.998 * sim.machine.psi_f_Wb  # without the rule it is more
    if case.scheme in MEAN:
        assert torque == pytest.approx(1.0, abs=0.15)


# -- losses ----------------------------------------------------------------------------------


class Settled(NamedTuple):
    loss_W: float
    modelled_W: float  #: that of the fundamental waves and of the iron, which the rule minimises
    flux_Wb: float  #: reference


NOWHERE = Settled(math.nan, math.nan, math.nan)
#: Under a table the drive learns the torque's error from samples with much ripple, and the loss of
#: the pattern scatters: it takes this long to settle, and so many stretches for a mean.
TABLE_S, STRETCHES = 8.0, 5


def modelled_W(recording, p):
    """From the currents' means in axes that turn with the rotor's flux, with magnets the active
    one."""
    i, psi = (
        recording[f"plant.{of}_alpha_{unit}"] + 1j * recording[f"plant.{of}_beta_{unit}"]
        for of, unit in (("i", "A"), ("psi", "Wb"))
    )
    if hasattr(p, "psi_f_Wb"):
        rr_ohm, rotor_A, rotor_Wb = 0.0, 0 * i, psi - p.lq_H * i
    else:
        rr_ohm, rotor_A = p.rr_ohm, (psi - (p.lls_H + p.lm_H) * i) / p.lm_H
        rotor_Wb = (p.llr_H + p.lm_H) * rotor_A + p.lm_H * i
    axis = np.exp(-1j * np.angle(rotor_Wb))
    stator, rotor, flux = (abs(np.mean(wave * axis)) for wave in (i, rotor_A, psi))
    omega = p.pole_pairs * abs(np.mean(recording["plant.speed_rpm"])) * math.pi / 30
    iron = omega * (p.iron_hysteresis_A_Wb + p.iron_eddy_S * omega) * flux**2
    return 3 * (p.rs_ohm * stator**2 + rr_ohm * rotor**2) + iron


def settled(setup, speed_rpm, load_Nm, flux_Wb=None):
    """The steady state: with a constant flux if one is given. NOWHERE if it does not drive the
    load."""
    table = setup["controller.scheme"] in firmware.table_schemes()
    sim = started(setup, 4)
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(1.5, record=False)
    if flux_Wb is not None:
        sim.set_many({"flux_least_loss": "off", "flux_ref_Wb": flux_Wb})
    sim.set("load_Nm", load_Nm)
    sim.run(TABLE_S if table else 4.0, record=False)
    seconds = max(0.5, CYCLES * 60 / (setup["machine.pole_pairs"] * speed_rpm))
    found = []
    for _ in range(STRETCHES if table else 1):
        period, legs = sim.periods, sim.inverter.leg.copy()
        sim.log_edges(math.ceil(seconds / sim.period_s + 1) * MOST_EDGES)
        sim.run(seconds)
        if sim.faults or abs(sim.speed_rpm - speed_rpm) > 0.01 * speed_rpm:
            return NOWHERE
        recording = sim.take()
        figures = balance(recording, bridge(recording, sim.edges_since(period, legs)))
        found.append((figures["loss_W"], modelled_W(recording, sim.machine)))
    return Settled(*np.mean(found, axis=0), sim.controller.channel("flux_ref_Wb"))


def loss_W(*where):
    return settled(*where).loss_W


def floor_Wb(setup):
    """With the machine's own constants: the reserve is 0.8 of the pull-out torque, or has the slip
    of the encoder's check, with the rotor flux taken as the stator's."""
    machine = Design(setup, setup.parameter).machine
    slip_rad_s = float(setup.parameter("encoder_trip_rpm")) * machine.pole_pairs * math.pi / 30
    seen_ohm = machine.rr_ohm * (machine.lm_H / machine.lr_H) ** 2
    reach = 0.8 * machine.pull_out_Nm(1.0), 3 * machine.pole_pairs * slip_rad_s / seen_ohm
    reserve_Nm = float(setup.parameter("flux_reserve_Nm"))
    return max(math.sqrt(reserve_Nm / min(reach)), float(setup.parameter("flux_min_Wb")))


#: The loss over the least one, at most. The loss of a table's ripple grows with the flux, and the
#: rule does not know of it.
RIPPLE = {"ddr": 1.025, "dtc2": 1.12}
MAP = list(itertools.product(
    ("small-2kw", "large-110kw", "paper-a-feasible"), ("db-dtfc", "ddr", "foc"), (0.1, 0.5, 0.95),
    (0.05, 0.1, 0.25, 0.5, 0.9),
))  # fmt: skip


#: The furthest from it, of three machines under `dtc2`, `dtc3` and `ddr-ml` at half speed.
FURTHEST = ("large-110kw", "dtc2", 0.5, 0.05)


@pytest.mark.parametrize(
    "point", [*part(MAP, 8), FURTHEST], ids=lambda point: "-".join(map(str, point))
)
def test_no_flux_above_the_floor_has_clearly_less_loss(point):
    name, scheme, *shares = point
    setup = ruled(name, scheme)
    torque_Nm, speed_rpm = (share * r for share, r in zip(shares[::-1], rated(setup)))
    most_Wb = float(setup.parameter("flux_ref_Wb"))
    found = settled(setup, speed_rpm, torque_Nm)
    fluxes = np.geomspace(min(floor_Wb(setup), most_Wb), most_Wb, 8)
    search = np.array([settled(setup, speed_rpm, torque_Nm, flux) for flux in fluxes])
    least_W, least_modelled_W, _ = np.nanmin(search, axis=0)
    assert found.modelled_W <= 1.01 * least_modelled_W
    assert found.loss_W <= RIPPLE.get(scheme, 1.01) * least_W
    assert found.loss_W <= 1.01 * search[-1, 0]  # the constant flux


MAGNET_MAP = list(itertools.product(
    (("magnet-interior", "db-dtfc"), ("magnet-interior", "foc"), ("magnet-24v", "foc-24"),
     ("magnet-24v", "db-dtfc"), ("magnet-surface", "ddr"), ("magnet-surface", "dtc3")),
    (0.1, 0.5, 0.95), (0.05, 0.1, 0.25, 0.5, 0.9),
))  # fmt: skip
#: Ripple is up to half of the loss of the interior machine, whose L_xy is small.
MAGNET_RIPPLE = 1.035
#: Iron takes much here, and the torque is that of a modulated law.
IRON_COUNTS = (("magnet-interior", "db-dtfc"), 0.95, 0.1)


@pytest.mark.parametrize(
    "point", [*part(MAGNET_MAP, 6), IRON_COUNTS], ids=lambda point: "-".join(map(str, point))
)
def test_with_magnets_no_less_flux_has_clearly_less_loss(point):
    """More flux than that of the least current has more of both losses."""
    (name, scheme), *shares = point
    setup = ruled(name, scheme, 0.03)
    torque_Nm, speed_rpm = (share * r for share, r in zip(shares[::-1], rated(setup)))
    found = settled(setup, speed_rpm, torque_Nm)
    machine = Design(setup, setup.parameter).machine
    most_Wb = machine.flux_Wb(*machine.least_current(torque_Nm))
    fluxes = np.array([0.8, 0.88, 0.92, 0.96, 1.0, 1.1]) * most_Wb
    search = np.array([settled(setup, speed_rpm, torque_Nm, flux) for flux in fluxes])
    least_W, least_modelled_W, _ = np.nanmin(search, axis=0)
    assert found.modelled_W <= 1.01 * least_modelled_W
    assert found.loss_W <= MAGNET_RIPPLE * least_W
    if point == IRON_COUNTS:
        assert found.loss_W < 0.97 * search[-1, 0]  # the least current


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
@pytest.mark.parametrize(
    "wrong",
    ({"iron_hysteresis_A_Wb": 0.0, "iron_eddy_S": 0.0}, {"rr_ohm": 0.7}, {"rr_ohm": 1.3}),
    ids=("iron", "rr-30", "rr+30"),
)
@pytest.mark.parametrize("share", (0.1, 0.9))
def test_what_is_wrongly_believed_costs_no_more_than_the_constant_flux(wrong, scheme, share):
    setup = ruled("small-2kw", scheme)
    torque_Nm, speed_rpm = rated(setup)
    believed = {f"controller__{k}": v and v * setup["machine.rr_ohm"] for k, v in wrong.items()}
    setup = setup.changed(**believed)
    most_Wb = float(setup.parameter("flux_ref_Wb"))
    for load_Nm in (0.1 * torque_Nm, 0.5 * torque_Nm, 0.9 * torque_Nm):
        found = loss_W(setup, share * speed_rpm, load_Nm)
        assert found <= 1.01 * loss_W(setup, share * speed_rpm, load_Nm, most_Wb)


def test_an_iron_that_is_known_saves_what_one_that_is_not_does_not():
    known = ruled("large-110kw", "db-dtfc", 0.03)
    unknown = known.changed(controller__iron_hysteresis_A_Wb=0.0, controller__iron_eddy_S=0.0)
    torque_Nm, speed_rpm = rated(known)
    point = 0.9 * speed_rpm, 0.25 * torque_Nm
    assert loss_W(known, *point) < 0.95 * loss_W(unknown, *point)


def test_with_magnets_a_standstill_teaches_no_resistance_that_costs_loss():
    """Without load R_s is adapted to a quarter there, and stays so at speed."""
    setup = ruled("magnet-interior", "db-dtfc", 0.03)
    fluxes = []
    for pause_s in (0.0, 3.0):
        sim = started(setup, 1)
        sim.run(pause_s, record=False)
        sim.set("speed_ref_rpm", 0.9 * rated(setup)[1])
        sim.run(3.0, record=False)
        assert not sim.faults
        fluxes.append(flux_Wb(sim))
    assert fluxes[1] == pytest.approx(fluxes[0], rel=0.003)


# -- when it acts ----------------------------------------------------------------------------


def flux_Wb(sim):
    return sim.controller.channel("flux_ref_Wb")


def running(setup, load_Nm=0.0, speed_rpm=700.0, seconds=3.0):
    sim = SimulatedDrive(setup, samples_per_period=1)
    sim.start()
    sim.run(0.8, record=False)
    assert sim.state == firmware.RUN
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(1.0, record=False)
    sim.load_Nm = load_Nm
    sim.run(seconds, record=False)
    assert not sim.faults
    return sim


def test_the_flux_is_built_whole_and_falls_after_the_wait_only():
    setup = ruled("small-2kw", "db-dtfc", controller__flux_wait_s=0.5)
    most_Wb = float(setup.parameter("flux_ref_Wb"))
    sim = SimulatedDrive(setup)
    sim.start()
    while sim.state != firmware.RUN:
        sim.run(0.01, record=False)
    assert flux_Wb(sim) == pytest.approx(most_Wb, rel=0.01)
    sim.run(0.45, record=False)
    assert flux_Wb(sim) == pytest.approx(most_Wb, rel=0.01)
    sim.run(1.0, record=False)
    assert flux_Wb(sim) == pytest.approx(floor_Wb(setup), rel=0.01)


def test_a_load_that_comes_again_within_the_wait_finds_its_flux():
    setup = ruled("small-2kw", "db-dtfc", controller__flux_wait_s=1.0)
    sim = running(setup, load_Nm=2.0)
    loaded_Wb = flux_Wb(sim)
    for _ in range(4):
        sim.load_Nm = 0.2
        sim.run(0.5, record=False)
        sim.load_Nm = 2.0
        sim.run(0.4, record=False)
        assert flux_Wb(sim) > 0.97 * loaded_Wb


def test_off_is_the_drive_without_the_option_to_the_bit():
    """The parameters that shape it change nothing then."""
    plain = load("small-2kw")
    shaped = plain.changed(
        controller__flux_reserve_Nm=1.0, controller__flux_wait_s=0.01,
        controller__iron_eddy_S=1e-3, controller__iron_hysteresis_A_Wb=0.1,
    )  # fmt: skip
    one, two = (running(setup, 1.0, seconds=1.0) for setup in (plain, shaped))
    assert np.array_equal(one.plant_state, two.plant_state)


def residual_of_falls(setup):
    """The largest x-y residual of 25 falls of the flux at standstill, in limits."""
    limit_V = setup.parameter("loss_check") * setup.parameter("vdc_max_V")
    sim = SimulatedDrive(setup, samples_per_period=1)
    sim.start()
    sim.run(0.9, record=False)
    residual = sim.controller.drive.control.leg_loss.low_V
    largest_V = 0.0
    for fall in range(25):
        sim.set_many({"flux_least_loss": "off", "speed_ref_rpm": 40 + 7 * (fall % 9)})
        sim.run(0.25, record=False)
        sim.set("speed_ref_rpm", 0)
        sim.run(0.25, record=False)
        sim.set("flux_least_loss", "on")
        for _ in range(60):
            sim.run(0.005, record=False)
            largest_V = max(largest_V, math.hypot(residual.x, residual.y))
    assert sim.state == firmware.RUN
    return largest_V / limit_V


def test_a_flux_that_falls_at_standstill_is_no_lost_phase():
    """While it falls, all six currents may be next to zero at once. Then no leg's dead time is
    known. With the limit of a drive of constant flux an urban cycle ended in a lost phase."""
    setup = load("small-2kw").changed(
        controller__scheme="db-dtfc", controller__flux_least_loss="on",
        controller__flux_wait_s=0.05, load__kind="constant",
    )  # fmt: skip
    assert residual_of_falls(setup) < 0.7
    constant = load("small-2kw").parameter("loss_check")
    assert residual_of_falls(setup.changed(controller__loss_check=constant)) > 1.0


def test_a_lost_phase_is_found_at_the_least_flux():
    setup = ruled("small-2kw", "db-dtfc")
    for leg in ("u1", "v2"):
        sim = running(setup, 0.3)
        sim.break_leg(leg, "open")
        sim.run(0.1, record=False)
        assert sim.faults == ["phase lost"]
        assert sim.snapshot["warnings"][0] == f"phase {leg} lost"


def test_it_comes_and_goes_while_the_drive_runs():
    sim = running(ruled("small-2kw", "db-dtfc"), load_Nm=0.3)
    most_Wb = float(sim.setup.parameter("flux_ref_Wb"))
    assert flux_Wb(sim) < 0.6 * most_Wb
    sim.set("flux_least_loss", "off")
    sim.run(0.5, record=False)
    assert flux_Wb(sim) == pytest.approx(most_Wb)
    sim.set("flux_least_loss", "on")
    sim.run(2.0, record=False)
    assert flux_Wb(sim) < 0.6 * most_Wb and not sim.faults


def test_without_a_leg_the_flux_is_that_of_the_derating():
    changes = {"controller__ride_through": "least-loss", "controller__i_rated_A": 2.0}
    fluxes = []
    for option in ("on", "off"):
        setup = ruled("small-2kw", "db-dtfc", **changes).changed(controller__flux_least_loss=option)
        sim = running(setup, load_Nm=0.3)
        sim.break_leg("u1", "open")
        sim.run(2.0, record=False)
        assert not sim.faults
        fluxes.append(flux_Wb(sim))
    assert fluxes[0] == pytest.approx(fluxes[1], rel=1e-3)


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc", "foc"))
def test_beyond_rated_speed_the_voltage_still_limits_the_flux(scheme):
    setup = ruled("small-2kw", scheme)
    torque_Nm, speed_rpm = rated(setup)
    sim = running(setup, 0.4 * torque_Nm, 1.4 * speed_rpm, 4.0)
    weak_Wb = flux_Wb(sim)
    assert sim.speed_rpm == pytest.approx(1.4 * speed_rpm, rel=0.01)
    sim.set("flux_least_loss", "off")
    sim.run(1.0, record=False)
    assert weak_Wb <= 1.02 * flux_Wb(sim) < 0.85 * float(setup.parameter("flux_ref_Wb"))


def test_magnets_without_iron_refuse_it_in_one_line():
    with pytest.raises(SetupError) as refused:
        load("magnet-interior").changed(controller__flux_least_loss="on")
    (line,) = str(refused.value).splitlines()
    assert "flux_least_loss = on" in line and "the iron's loss must be told" in line
