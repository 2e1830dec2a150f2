"""A leg of the plant breaks while the drive runs. The firmware must name the phase, and nothing
else that happens to a drive may look like a lost phase. With `ride_through` it goes on."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from campaigns import part

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import HexatorqueError
from hexatorque.firmware import lib, table_schemes
from hexatorque.plant.legs import KINDS
from hexatorque.plant.vsd import PHASES

#: Speed and load: both directions, motoring, generating, no load.
POINTS = ((300.0, 5.0), (-300.0, 0.0), (900.0, 5.0), (-60.0, -4.0), (300.0, -4.0))
SCHEMES = ("dtc1", "dtc3", "ddr", "db-dtfc", "db-ipwm")
CASES = [
    (scheme, kind, PHASES[(2 * n + m) % 6], *POINTS[(n + m) % len(POINTS)])
    for (n, scheme), (m, kind) in itertools.product(enumerate(SCHEMES), enumerate(KINDS[1:]))
]


def running(scheme, rpm, load_Nm, **changes):
    setup = setups.load("paper-a-feasible").changed(
        controller__scheme=scheme,
        timing__latency="predicted",
        sensors__i_noise_A=0.025,
        **changes,
    )
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(0.36, record=False)
    sim.set("speed_ref_rpm", rpm)
    sim.run(0.15 + abs(rpm) / 2000, record=False)
    sim.set("load_Nm", load_Nm)
    sim.run(0.2, record=False)
    assert sim.state == "run"
    return sim


def until_fault(sim, longest_s):
    """Time to the fault in seconds."""
    began = sim.periods
    while sim.state == "run":
        sim.run(10 * sim.period_s, record=False)
        assert (sim.periods - began) * sim.period_s < longest_s, "not found"
    return (sim.periods - began) * sim.period_s


@pytest.mark.parametrize(("scheme", "kind", "phase", "rpm", "load_Nm"), CASES)
def test_the_lost_phase_is_named(scheme, kind, phase, rpm, load_Nm):
    """An open or blocked phase within an electrical period, one switch within one and a half."""
    sim = running(scheme, rpm, load_Nm)
    sim.run(sim.period_s * (37 * len(scheme) + 11 * len(kind)), record=False)  # any angle
    sim.break_leg(phase, kind, 0.43 * sim.period_s)
    period_s = 60 / (2 * abs(rpm))
    taken_s = until_fault(sim, (1.0 if kind in ("open", "blocked") else 1.5) * period_s)
    snapshot = sim.snapshot
    assert snapshot["faults"] == ["phase lost"]
    assert snapshot["warnings"][0] == f"phase {phase} lost"
    assert phase in str(sim.trip)
    if kind in ("upper", "lower"):
        assert snapshot["warnings"][1] == f"no current through its {kind} switch"
    switch = 64 if "upper" in snapshot["warnings"][1] else 128
    assert sim.controller.channel("warnings") == 32 >> PHASES.index(phase) | switch
    assert taken_s > 0
    sim.clear()
    assert sim.controller.channel("warnings") == 0


@pytest.mark.parametrize("phase", ("u1", "v2"))
@pytest.mark.parametrize("share", (0.25, 0.45, 0.6, 1.7, 2.2, 4.0))
def test_an_inductance_that_is_far_off_is_learnt_and_a_lost_phase_is_named(share, phase):
    """Under dtc1 the x-y currents are large, so a wrong L_xy makes a large residual. It is learnt
    from periods that would have named a leg. R_s and dead time take a few per cent of it."""
    lxy_H = setups.load("paper-a-feasible").parameter("lxy_H")
    sim = running("dtc1", 300.0, 5.0, controller__lxy_H=share * lxy_H)
    drive = sim.controller.drive
    taken_ohm = drive.config.control.leg_loss.l_per_ts_ohm + drive.control.leg_loss.more_ohm
    assert taken_ohm * sim.period_s == pytest.approx(lxy_H, rel=0.06)
    sim.break_leg(phase, "open", 0.43 * sim.period_s)
    until_fault(sim, 0.1)
    assert sim.snapshot["warnings"][0] == f"phase {phase} lost"


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_reversal_with_wrong_parameters_is_no_loss(scheme):
    sim = running(scheme, 600.0, 3.0, controller__lxy_H=0.013, controller__rs_ohm=1.3)
    sim.set("speed_ref_rpm", -600.0)
    sim.run(0.7, record=False)
    assert sim.state == "run"


@pytest.mark.parametrize("sensor", (0, 3, 4))
@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
def test_a_current_sensor_that_stands_still_is_no_loss(scheme, sensor):
    """Set by set, the currents of a lost phase add up to zero, and these do not."""
    sim = running(scheme, 300.0, 5.0)
    sim.sensors.hold[sensor] = 1
    until_fault(sim, 0.5)
    assert "phase lost" not in sim.snapshot["faults"]


def test_zero_switches_the_check_off():
    sim = running("ddr", 300.0, 5.0, controller__loss_check=0.0)
    sim.break_leg("v1", "open")
    until_fault(sim, 1.0)
    assert "phase lost" not in sim.snapshot["faults"]
    assert not np.any(sim.snapshot["warnings"])


# --- going on ---------------------------------------------------------------------

RATED_A = 2.6
RIDE = {"controller__ride_through": "least-loss", "controller__i_rated_A": 5.0}
COMMANDING = ("db-dtfc", "foc", "foc-24", "db-ipwm")
RIDES = [
    (COMMANDING[(n + m) % 4], kind, PHASES[(2 * n + 3 * m) % 6], *POINTS[(n + 2 * m) % len(POINTS)])
    for n, (m, kind) in itertools.product(range(3), enumerate(KINDS[1:]))
]


def word(phases):
    return sum(32 >> PHASES.index(phase) for phase in phases)


def settled(sim, seconds=0.3):
    """Means over `seconds`, and the r.m.s. currents of the phases."""
    sim.discard()
    sim.run(seconds)
    rec = sim.take()
    currents = np.array([rec[f"plant.i_{phase}_A"] for phase in PHASES])
    flux = np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"])
    return {
        "rms_A": np.sqrt((currents**2).mean(axis=1)),
        "ab_A": np.hypot(rec["plant.i_alpha_A"], rec["plant.i_beta_A"]),
        "flux_Wb": float(flux.mean()),
        "flux_ripple_Wb": float(flux.std()),
        "speed_rpm": float(rec["plant.speed_rpm"].mean()),
        "torque_Nm": float(rec["plant.torque_Nm"].mean()),
        "ripple_Nm": float(rec["plant.torque_Nm"].std()),
    }


def check_health(sim, rpm, lost, ripple_Nm=0.15):
    assert sim.state == "run"
    seen = settled(sim)
    assert seen["speed_rpm"] == pytest.approx(rpm, rel=0.02, abs=1.5)
    assert seen["flux_Wb"] == pytest.approx(sim.controller.channel("flux_ref_Wb"), rel=0.03)
    assert seen["ripple_Nm"] <= ripple_Nm
    for phase in lost:
        assert seen["rms_A"][PHASES.index(phase)] <= 0.05
    return seen


@pytest.mark.parametrize(("scheme", "kind", "phase", "rpm", "load_Nm"), RIDES)
def test_the_drive_goes_on_without_a_phase(scheme, kind, phase, rpm, load_Nm):
    sim = running(scheme, rpm, load_Nm, **RIDE)
    sim.run(0.8, record=False)  # the load is still new
    sim.break_leg(phase, kind, 0.43 * sim.period_s)
    sim.run(1.5 * 60 / (2 * abs(rpm)) + 0.01)
    speeds = sim.take()["plant.speed_rpm"]
    if abs(rpm) >= 300:
        assert np.abs(speeds - rpm).max() < 0.1 * abs(rpm)
    assert int(sim.controller.channel("warnings")) & 63 == word([phase])
    sim.run(0.8, record=False)
    check_health(sim, rpm, [phase])
    flags = [lib.ht_port_leg_tripped(sim.controller.port, leg) for leg in range(6)]
    assert flags == [name == phase for name in PHASES]


EXAMPLE = Path(__file__).parents[3] / "examples" / "lost-phase.toml"
#: Of the arc, from a parting contact to a fuse.
ARCS_V = (10.0, 30.0, 60.0, 250.0)
INSTANTS = 24
#: Scheme -> load, N m, and largest ripple, N m. dtc1 once took the ripple of its x-y currents for
#: another loss at this load.
ARC_LOADS = {"db-dtfc": (3.0, 0.15), "foc": (3.0, 0.15), "ddr": (3.0, 0.7), "dtc1": (2.5, 0.7)}
ARC_RIDES = list(
    itertools.product(ARC_LOADS, ARCS_V, range(INSTANTS))
)  # each instant for all the others


@pytest.mark.parametrize(("scheme", "arc_V", "instant"), part(ARC_RIDES, 24))
def test_the_example_goes_on_whatever_the_arc_and_the_instant(scheme, arc_V, instant):
    """At each of 24 instants of a period of the current. While an arc burns, current flows in the
    phase that is lost. No other one may be switched off, not even for a while."""
    example = setups.load(EXAMPLE)
    ((at_s, phase, kind),) = example.profile.broken
    setup = example.changed(controller__scheme=scheme, inverter__arc_V=arc_V)
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(0.4, record=False)
    sim.set("speed_ref_rpm", 300.0)
    sim.run(0.3, record=False)
    load_Nm, ripple_Nm = ARC_LOADS[scheme]
    sim.set("load_Nm", load_Nm)
    period_s = 2 * np.pi / sim.controller.channel("omega_sync_rad_s")
    sim.run(at_s - 0.7 + period_s * instant / INSTANTS, record=False)
    sim.break_leg(phase, kind)
    began_s = sim.time_s
    while sim.time_s < began_s + 1.2 * period_s:
        sim.run(5 * sim.period_s, record=False)
        assert int(sim.controller.channel("warnings")) & 63 in (0, word([phase]))
    sim.run(0.8, record=False)
    assert int(sim.controller.channel("warnings")) & 63 == word([phase])
    check_health(sim, 300.0, [phase], ripple_Nm)


@pytest.mark.parametrize("phase", ("w1", "u2"))
@pytest.mark.parametrize("mode", ("least-loss", "most-torque"))
def test_the_flux_is_right_once_the_loss_is_found(phase, mode):
    """Until then the voltage was wrong for a millisecond, by 5 % of the flux."""
    sim = running("db-dtfc", -600.0, 6.0, **(RIDE | {"controller__ride_through": mode}))
    sim.run(0.8, record=False)
    sim.break_leg(phase, "open")
    sim.run(0.005, record=False)
    seen = settled(sim, 0.1)
    assert seen["flux_Wb"] == pytest.approx(0.6, rel=0.01)
    assert seen["flux_ripple_Wb"] < 0.006


@pytest.mark.parametrize(
    ("scheme", "rpm"), (("foc", 600.0), ("db-dtfc", -600.0), ("foc-24", 100.0))
)
def test_the_drive_goes_on_with_the_most_torque(scheme, rpm):
    sim = running(scheme, rpm, 3.0, **(RIDE | {"controller__ride_through": "most-torque"}))
    sim.break_leg("w1", "blocked")
    sim.run(1.2, record=False)
    check_health(sim, rpm, ["w1", "u2"])


TABLE_RIDES = [
    (scheme, KINDS[1 + n % 4], PHASES[5 * n % 6], mode, 2.0 - n % 3)
    for n, (scheme, mode) in enumerate(
        itertools.product(table_schemes(), ("least-loss", "most-torque"))
    )
]


@pytest.mark.parametrize(("scheme", "kind", "phase", "mode", "load_Nm"), TABLE_RIDES)
def test_a_table_scheme_goes_on(scheme, kind, phase, mode, load_Nm):
    """With no more torque ripple than before: the voltages are shorter, and so is the flux."""
    changes = {"controller__ride_through": mode, "controller__i_rated_A": RATED_A}
    sim = running(scheme, 300.0, load_Nm, **changes)
    sim.run(0.6, record=False)
    before = settled(sim)
    sim.break_leg(phase, kind, 0.43 * sim.period_s)
    sim.run(1.5, record=False)
    seen = check_health(sim, 300.0, [phase], before["ripple_Nm"])
    assert seen["rms_A"].max() <= 1.02 * RATED_A


def test_the_x_y_current_is_regulated_where_the_scheme_does():
    """Across the lost phase's axis; u1: y. What dead time and drops make there is left by the
    others."""
    rms_A = {}
    for scheme in ("fdr", "ddr"):
        changes = {"controller__ride_through": "least-loss", "controller__i_rated_A": RATED_A}
        sim = running(scheme, 900.0, 0.0, **changes)
        sim.break_leg("u1", "open")
        sim.run(1.2, record=False)
        sim.discard()
        sim.run(0.2)
        rms_A[scheme] = sim.take()["plant.i_y_A"].std()
    print(rms_A)
    assert rms_A["ddr"] < 0.05
    assert rms_A["fdr"] > 2 * rms_A["ddr"]


@pytest.mark.parametrize("scheme", ("db-dtfc", "ddr"))
@pytest.mark.parametrize("second", ("u2", "v2", "v1"))
def test_a_second_loss_stops(scheme, second):
    """It is named only if it alone carries no current. If it is of the same set, its third phase
    carries none either."""
    sim = running(scheme, 300.0, 3.0, **RIDE)
    sim.break_leg("u1", "open")
    sim.run(0.5, record=False)
    assert sim.state == "run"
    sim.break_leg(second, "open")
    until_fault(sim, 0.3)
    assert sim.snapshot["faults"] == ["phase lost"]
    assert sim.snapshot["warnings"][0] == "phase u1 lost"
    assert "another phase lost" in sim.snapshot["warnings"]
    named = {phase for phase in PHASES if f"phase {phase} lost" in sim.snapshot["warnings"]}
    assert named in ([{"u1"}] if second == "v1" else [{"u1"}, {"u1", second}])
    assert scheme == "ddr" or len(named) == (1 if second == "v1" else 2)


def stopped_by_a_loss(losses, **changes):
    """The snapshot of a start in which the phases are lost at these times."""
    changes = dict(RIDE, controller__build_s=0.4, **changes)
    setup = setups.load("paper-a-feasible").changed(timing__latency="predicted", **changes)
    sim = SimulatedDrive(setup, 1)
    for phase, begins in losses.items():
        sim.break_leg(phase, "open", begins)
    sim.start()
    for _ in range(100):
        sim.run(0.005, record=False)
    assert sim.state == "fault" and sim.snapshot["faults"] == ["phase lost"]
    assert "phase u1 lost" in sim.snapshot["warnings"]
    return sim.snapshot


@pytest.mark.parametrize("ride_through", ("off", "least-loss"))
@pytest.mark.parametrize("begins", (0.0, 0.1))
def test_a_loss_in_the_build_up_stops(ride_through, begins):
    snapshot = stopped_by_a_loss({"u1": begins}, controller__ride_through=ride_through)
    assert snapshot["state"] == "build"
    assert "another phase lost" not in snapshot["warnings"]


def test_a_second_loss_in_the_build_up_stops_at_its_end():
    """A drive that begins without u1 finds w1's loss when it begins to run."""
    snapshot = stopped_by_a_loss(
        {"u1": 0.0, "w1": 0.1}, controller__ride_through="least-loss", controller__lost_legs=32
    )
    assert snapshot["state"] == "run"
    assert "another phase lost" in snapshot["warnings"]


def test_the_scheme_may_change_without_a_leg():
    sim = running("db-dtfc", 300.0, 2.0, **RIDE)
    sim.break_leg("w1", "blocked")
    sim.run(0.5, record=False)
    for scheme in ("ddr", "dtc3", "foc"):
        sim.set("scheme", scheme)
        sim.run(0.3, record=False)
        check_health(sim, 300.0, ["w1"], 0.7)


def test_without_the_prediction_a_drive_cannot_do_without_a_leg():
    sim = running("ddr", 300.0, 2.0, **RIDE)
    sim.set("predict", "off")
    sim.run(0.1, record=False)
    sim.break_leg("w1", "blocked")
    until_fault(sim, 0.3)
    assert sim.faults == ["phase lost"]
    sim = running("ddr", 300.0, 2.0, **RIDE)
    sim.break_leg("w1", "blocked")
    sim.run(0.3, record=False)
    assert sim.state == "run"
    sim.set("predict", "off")
    sim.run(0.002, record=False)
    assert sim.faults == ["phase lost"]


KNOWN = [
    (("v1",), "open", 300.0, 3.0), (("w2",), "blocked", -300.0, 3.0),
    (("u2",), "upper", 60.0, -3.0),
    (("u1", "v2"), "blocked", 300.0, -3.0), (("u2", "w1"), "open", 60.0, 3.0),
    (("w2", "v1"), "open", -600.0, -3.0), (("u1", "w1", "v1"), "blocked", 300.0, 3.0),
    (("u2", "v2"), "open", -300.0, 0.0),
]  # fmt: skip


@pytest.mark.parametrize("scheme", ("db-dtfc", "ddr"))
@pytest.mark.parametrize(("phases", "kind", "rpm", "load_Nm"), KNOWN)
def test_start_without_legs(scheme, phases, kind, rpm, load_Nm):
    """From standstill, to both directions, motoring and generating."""
    sim = SimulatedDrive(
        setups.load("paper-a-feasible").changed(
            controller__scheme=scheme,
            controller__lost_legs=word(phases),
            timing__latency="predicted",
            sensors__i_noise_A=0.025,
            **RIDE,
        ),
        1,
    )
    for phase in phases:
        sim.break_leg(phase, kind)
    sim.start()
    sim.run(0.36, record=False)
    assert sim.state == "run"
    assert sim.controller.channel("warnings") == word(phases)
    sim.set("speed_ref_rpm", rpm)
    sim.run(0.2 + abs(rpm) / 1500, record=False)
    sim.set("load_Nm", load_Nm)
    sim.run(0.9, record=False)
    check_health(sim, rpm, phases, 0.7 if scheme == "ddr" else 0.15)


@pytest.mark.parametrize(
    ("phases", "mode", "share"),
    (
        (("u1",), "least-loss", 0.5547), (("w2",), "most-torque", 0.5774),
        (("u2", "w1"), "least-loss", 0.5774), (("u1", "w1", "v1"), "most-torque", 0.5),
    ),
)  # fmt: skip
def test_no_phase_carries_more_than_its_rated_current(phases, mode, share):
    """All the torque that is left, at 300 r/min. The most loaded phase carries the rated current,
    and by its share more than the current in alpha-beta."""
    sim = SimulatedDrive(
        setups.load("paper-a-feasible").changed(
            controller__scheme="db-dtfc",
            controller__lost_legs=word(phases),
            controller__ride_through=mode,
            controller__i_rated_A=RATED_A,
            machine__drs_ohm=[0.0] * 6,  # the same in all phases, as the figures have it
            timing__latency="predicted",
        ),
        2,
    )
    for phase in phases:
        sim.break_leg(phase, "open")
    sim.start()
    sim.run(0.36, record=False)
    sim.set("speed_ref_rpm", 300.0)
    sim.run(0.6, record=False)
    sim.set("load_Nm", 0.97 * sim.controller.channel("torque_limit_Nm"))
    sim.run(0.6, record=False)
    sim.set("control_mode", "torque")
    sim.set("torque_ref_Nm", 15.0)
    sim.run(0.1, record=False)
    seen = settled(sim, 0.4)
    assert seen["torque_Nm"] == pytest.approx(sim.controller.channel("torque_limit_Nm"), rel=0.04)
    assert seen["rms_A"].max() <= 1.02 * RATED_A
    assert seen["rms_A"].max() >= 0.95 * RATED_A
    found = np.sqrt((seen["ab_A"] ** 2).mean() / 2) / seen["rms_A"].max()
    assert found == pytest.approx(share, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "words"),
    (
        ({"ride_through": "least-loss"}, ("ride_through", "i_rated_A")),
        ({"lost_legs": 32, "i_rated_A": 5.0}, ("lost_legs = 32", "ride_through")),
        ({"lost_legs": 48, **{k[12:]: v for k, v in RIDE.items()}}, ("lost_legs = 48", "90")),
        (
            {"lost_legs": 32, "scheme": "ddr", **{k[12:]: v for k, v in RIDE.items()}},
            ("lost_legs = 32", "predict = off"),
        ),
        ({"lost_legs": 64}, ("lost_legs", "63")),
    ),
)
def test_what_cannot_be_is_refused_in_one_line(changes, words):
    with pytest.raises(HexatorqueError) as refused:
        SimulatedDrive(
            setups.load("paper-a-feasible").changed(
                **{
                    f"controller__{name}": value
                    for name, value in ({"scheme": "db-dtfc"} | changes).items()
                },
                timing__latency="shadow" if changes.get("scheme") == "ddr" else "predicted",
            )
        )
    text = str(refused.value)
    assert "\n" not in text and all(w in text for w in words), text


# --- sets with different resistances -----------------------------------------------
# Those of paper A's machine: that of set 2 is 0.06 ohm above the mean of both.


@pytest.mark.parametrize("rpm", (50.0, -600.0))
@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc", "foc"))
def test_the_difference_of_the_sets_is_learnt_with_wrong_parameters(scheme, rpm):
    """A stop does not forget it."""
    sim = running(scheme, rpm, 4.0, controller__lxy_H=0.0075, controller__rs_ohm=1.4)
    sim.run(0.7, record=False)
    assert sim.controller.drive.sets.ohm == pytest.approx(0.06, rel=0.2)
    sim.set("load_Nm", 0.0)
    sim.set("speed_ref_rpm", 0.0)
    sim.run(0.8, record=False)
    learnt = sim.controller.drive.sets.ohm
    sim.stop()
    sim.start()
    sim.run(0.1, record=False)
    assert sim.state == "build"
    assert sim.controller.drive.sets.ohm == learnt != 0.0


@pytest.mark.parametrize("quarter", range(4))
def test_an_arc_too_small_to_be_found_is_not_learnt_as_resistance(quarter):
    """At low speed it burns for up to half a period of the current. Its voltage is that of 3 ohm at
    this current; what would be learnt of it would stay after the loss."""
    changes = RIDE | {"inverter__arc_V": 7.0}
    sim = running("foc", -42.0, -0.7, **changes)
    sim.run(0.6, record=False)
    assert sim.controller.drive.sets.ohm == pytest.approx(0.06, rel=0.25)
    period_s = 2 * np.pi / abs(sim.controller.channel("omega_sync_rad_s"))
    sim.run(quarter / 4 * period_s, record=False)
    learnt = sim.controller.drive.sets.ohm
    sim.break_leg("v1", "open")
    sim.run(0.01 + period_s, record=False)
    assert int(sim.controller.channel("warnings")) & 63 == word(["v1"])
    assert sim.controller.drive.sets.ohm == pytest.approx(learnt, abs=0.02)


@pytest.mark.parametrize("scheme", ("dtc1", "dtc3", "fdr"))
def test_where_x_y_currents_are_not_regulated_nothing_is_learnt(scheme):
    sim = running(scheme, 100.0, 4.0)
    assert sim.controller.drive.sets.ohm == 0.0


def ripple_without_a_leg_Nm(phase, known):
    """known: whether the drive keeps what it has learnt of the sets' resistances."""
    sim = running(
        "db-dtfc", 50.0, -2.5, controller__ride_through="most-torque",
        controller__i_rated_A=RATED_A,
    )  # fmt: skip
    sim.run(0.6, record=False)
    if not known:
        sim.controller.drive.sets.ohm = 0.0
    sim.break_leg(phase, "open")
    sim.run(1.5, record=False)
    sim.run(0.8)
    assert sim.state == "run"
    return float(np.std(sim.take()["plant.torque_Nm"]))


@pytest.mark.parametrize("phase", ("v1", "w2"))
def test_without_a_leg_what_was_learnt_takes_the_ripple_off_the_torque(phase):
    """Each set has an axis of its own then. At low speed a resistance that is wrong along one of
    them makes the flux, and with it the torque, ripple at twice the frequency."""
    known_Nm, unknown_Nm = (ripple_without_a_leg_Nm(phase, known) for known in (True, False))
    assert known_Nm < 0.06 < 0.7 * unknown_Nm
