"""What a user meets who has a machine of his own: other rates, inertias and loads than the papers'
machines have, and a drive that cannot run or trips."""

import json
import math

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import DriveFault, SimulatedDrive
from hexatorque.experiments.operating_points import Point, approach, reach, waits
from hexatorque.plant.load import DRY_RAD_S
from hexatorque.plant.vsd import PHASES
from hexatorque.setups import Profile, SetupError

# --- reach: cannot be configured, tripped and 0 are three different answers -----------------


@pytest.fixture
def own(tmp_path):
    """A file with these lines on top of paper B's set-up."""

    def write(*lines):
        file = tmp_path / "own.toml"
        file.write_text("\n".join(('setup = "paper-b"', *lines)))
        return str(file)

    return write


def test_reach_of_a_set_up_that_is_refused(own, capsys):
    """The first one by the firmware, when it is read; the second one by the simulation."""
    file = own("[controller]", "torque_inner_Nm = 0.5")
    assert main(["reach", "--setup", file, "--schemes", "dtc1,ddr"]) == 2
    said = capsys.readouterr().err
    assert f"{file}: controller.torque_inner_Nm = 0.5 N m: allowed is up to" in said
    file = own("[machine]", "lls_H = 1e-6", "[inverter]", "v_switch_V = 1")
    assert main(["reach", "--setup", file, "--schemes", "dtc1,ddr", "--json"]) == 2
    said = json.loads(capsys.readouterr().out)
    assert said["reachable_rpm"] == {"dtc1": None, "ddr": None}
    for scheme in said["schemes"].values():
        assert scheme["outcome"] == "not configured" and scheme["reason"]


def test_reach_of_a_drive_that_trips(own, capsys):
    """The build-up alone takes more current than the trip allows."""
    file = own("[controller]", "i_trip_A = 1.5")
    assert main(["reach", "--setup", file, "--schemes", "dtc1"]) == 1
    said = capsys.readouterr().out
    assert "tripped" in said and "over-current" in said and "i_trip_A = 1.5 A" in said


def test_reach_of_a_load_above_the_torque_limit_is_none():
    found = reach(setups.load("paper-b"), 50.0)
    assert (found.outcome, found.rpm) == ("none", 0.0)
    assert "50 N m" in found.reason and "torque_limit_Nm = 4 N m" in found.reason


def test_reach_of_magnets_is_where_the_voltage_turns_the_flux_of_least_current():
    """Each torque has its own flux with magnets. The vectors of the table turn it with 1/sqrt(3) of
    the link's voltage at most, of which resistance and ripple take a few per cent."""
    setup, load_Nm = setups.load("magnet-interior").with_scheme("fdr"), 8.0
    m, pairs = setup.machine_values(), setup["machine.pole_pairs"]
    i_q = np.linspace(0.0, 100.0, 10_000)
    h = m["psi_f_Wb"] / (2 * (m["lq_H"] - m["ld_H"]))
    i_d = h - np.hypot(h, i_q)
    psi_d, psi_q = m["psi_f_Wb"] + m["ld_H"] * i_d, m["lq_H"] * i_q
    flux_Wb = np.hypot(psi_d, psi_q)[np.searchsorted(3 * pairs * (psi_d * i_q - psi_q * i_d), 8.0)]
    ideal_rpm = setup["inverter.vdc_V"] / np.sqrt(3) / flux_Wb / pairs * 30 / np.pi
    found = reach(setup, load_Nm)
    assert found.outcome == "held" and 0.88 < found.rpm / ideal_rpm < 1


# --- rates -----------------------------------------------------------------------------------


@pytest.mark.parametrize("f_isr_Hz", (8000, 16000, 7001))
def test_samples_need_not_divide_the_period(f_isr_Hz):
    """150 MHz / 8 kHz = 18750 counts. Recording must not change the run, whatever its samples."""
    setup = setups.load("paper-a").changed(
        controller__f_isr_Hz=float(f_isr_Hz), controller__f_slow_Hz=f_isr_Hz / 100
    )
    few, many = SimulatedDrive(setup, 1), SimulatedDrive(setup, 4)
    for sim in (few, many):
        sim.start()
        sim.run(0.1)
    few, many = few.take(), many.take()
    assert len(many) == 4 * len(few)
    assert many.rate_Hz == pytest.approx(4 * f_isr_Hz, rel=1e-4)
    psi, fine = few["plant.psi_alpha_Wb"], many["plant.psi_alpha_Wb"]
    np.testing.assert_array_equal(fine[::4], psi)
    # The flux runs along straight lines between edges, so what lies between is between.
    assert np.all(np.abs(fine[1::4] - psi) <= 250 / f_isr_Hz)


@pytest.mark.parametrize("name", ("paper-a", "paper-b"))
@pytest.mark.parametrize("ratio", (3, 7, 41, 80, 499))
def test_any_whole_ratio_of_the_interrupts(name, ratio):
    f_isr_Hz = 3000.0 if ratio < 16 else 16000.0
    setup = setups.load(name).changed(
        controller__f_isr_Hz=f_isr_Hz, controller__f_slow_Hz=f_isr_Hz / ratio
    )
    sim = SimulatedDrive(setup)
    assert sim.controller.fast_per_slow == ratio
    sim.run(0.01)


# --- inertia ---------------------------------------------------------------------------------


def test_waits_grow_with_the_inertia():
    light, heavy = (
        waits(Point(setups.load("paper-a").changed(machine__inertia_kgm2=J), 600.0, 0.0))
        for J in (0.03, 1.5)
    )
    assert (light.reach_s, light.settle_s, light.recover_s) == (4.0, 2.0, 10.0)
    run_up_s = 1.5 * 600 * math.pi / 30 / 15  # at the torque limit
    assert run_up_s > 4.0 and heavy.reach_s > 1.5 * run_up_s
    assert heavy.settle_s > light.settle_s and heavy.recover_s > light.recover_s


def test_a_heavy_machine_is_waited_for():
    setup = setups.load("paper-a").changed(
        machine__inertia_kgm2=1.5,
        controller__kp_speed_Nms_rad=15.0,
        controller__ki_speed_Nm_rad=15.0,
    )
    sim = approach(Point(setup, 600.0, 5.0), samples_per_period=1)
    assert sim.speed_rpm == pytest.approx(600.0, rel=0.02)


def test_friction_on_a_light_shaft():
    """J dw/dt = -T tanh(w/w0) has the solution sinh(w/w0) = sinh(w_begin/w0) exp(-T t/(J w0)). The
    time constant here, 75 us, is below a period."""
    inertia_kgm2, torque_Nm, begin_rad_s = 3e-5, 0.2, 1.0
    setup = setups.load("paper-b").changed(
        machine__inertia_kgm2=inertia_kgm2, load__kind="friction"
    )
    sim = SimulatedDrive(setup, 1)
    sim.plant_state[6] = begin_rad_s
    sim.set("load_Nm", torque_Nm)
    sim.run(sim.period_s)
    decay = math.exp(-torque_Nm * sim.period_s / (inertia_kgm2 * DRY_RAD_S))
    want = DRY_RAD_S * math.asinh(math.sinh(begin_rad_s / DRY_RAD_S) * decay)
    assert sim.plant_state[6] == pytest.approx(want, rel=0.02)
    sim.set("load_Nm", 2.0)
    sim.run(0.01)
    assert abs(sim.speed_rpm) < 1e-3


def test_a_shaft_too_light_for_its_load_is_refused():
    setup = setups.load("paper-b").changed(machine__inertia_kgm2=1e-6, load__kind="friction")
    sim = SimulatedDrive(setup, 1)
    sim.set("load_Nm", 10.0)
    with pytest.raises(SetupError, match=r"inertia_kgm2 = 1e-06.*10 N m.*friction.*0\.1 us"):
        sim.run(0.01)


# --- trips -----------------------------------------------------------------------------------


def tripped(sim):
    with pytest.raises(DriveFault) as error:
        sim.check()
    return error.value


def running(name="paper-b", **changes):
    sim = SimulatedDrive(setups.load(name).changed(**changes), 1)
    sim.start()
    sim.run(0.4)
    assert sim.state == "run"
    return sim


def test_a_trip_names_instant_quantity_value_and_limit():
    sim = running()
    sim.set("vdc_V", 100.0)
    begin_s = sim.time_s
    sim.run(0.05)
    fault = tripped(sim)
    assert begin_s <= fault.time_s <= begin_s + 2 * sim.period_s
    assert fault.causes == ["dc-link voltage too low"]
    assert f"at {fault.time_s:.4f} s in state run" in str(fault)
    value_V = float(str(fault).split("dc link: ")[1].split()[0])
    assert value_V == pytest.approx(100.0, abs=500 / 4095) and "vdc_min_V = 150 V" in str(fault)


@pytest.mark.parametrize("load_Nm", (3.0, -3.0))
def test_an_over_current_trip_names_the_phase(load_Nm):
    """The phase that carries most at the instant of the trip, from the plant's own record."""
    sim = running()
    sim.set("speed_ref_rpm", 300.0)
    sim.run(0.3)
    sim.set("load_Nm", load_Nm)
    sim.run(0.2)
    sim.discard()
    sim.set("i_trip_A", 2.0)
    sim.run(0.05)
    fault, rec = tripped(sim), sim.take()
    at = round((fault.time_s - rec.start_s) * rec.rate_Hz)
    currents = {name: abs(rec[f"plant.i_{name}_A"][at]) for name in PHASES}
    phase = max(currents, key=currents.get)
    assert f"phase {phase}: " in str(fault) and "i_trip_A = 2 A" in str(fault)
    assert currents[phase] >= 1.95
    assert float(str(fault).split(f"phase {phase}: ")[1].split()[0]) == pytest.approx(
        float(rec[f"plant.i_{phase}_A"][at]), abs=0.05
    )


def test_run_prints_the_trip(tmp_path, own, capsys):
    file = own("[profile]", "duration_s = 0.5", "vdc_V = [[0.45, 60]]")
    assert main(["run", file, "-o", str(tmp_path / "r.npz"), "--json"]) == 1
    out, err = capsys.readouterr()
    trip = json.loads(out)["trip"]
    assert trip["time_s"] == pytest.approx(0.45, abs=2e-4) and trip["state"] == "run"
    assert "vdc_min_V = 150 V" in trip["details"][0] and trip["details"][0] in err


# --- profiles ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed_rpm = [[0.4, 100], [2, 200]]", ("profile.speed_rpm", "2 s", "duration_s = 1 s")),
        ("load_Nm = [[1, 1]]", ("profile.load_Nm", "1 s")),
        ("vdc_V = [[3, 200]]", ("profile.vdc_V", "3 s")),
        ('set = [[1.5, "scheme", "fdr"]]', ("profile.set", "1.5 s")),
    ],
)
def test_a_step_after_the_end_is_refused(text, words, own, capsys):
    file = own("[profile]", "duration_s = 1", text)
    assert main(["run", file]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and all(word in said for word in words)


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ("speed_rpm = [[0.4, 100], [0.6, -2500]]", ("-2500 r/min at 0.6 s",)),
        ('speed_rpm = [[0.4, 900]]\nset = [[0.7, "speed_trip_rpm", 800]]', ("900", "at 0.7 s")),
        ('set = [[0.5, "speed_ref_rpm", 2000]]', ("2000 r/min at 0.5 s",)),
    ],
)
def test_a_speed_at_which_the_drive_trips_is_refused_before_it_starts(steps, words, own, capsys):
    file = own("[controller]\nspeed_trip_rpm = 2000\n[profile]", "duration_s = 1", steps)
    assert main(["run", file]) == 2
    said = capsys.readouterr().err
    trip_rpm = 800 if "800" in steps else 2000
    assert said.count("\n") == 1 and "Traceback" not in said
    assert all(word in said for word in (*words, f"-{trip_rpm} .. {trip_rpm} r/min", "excluded"))


@pytest.mark.parametrize(
    "steps",
    [
        "speed_rpm = [[0.5, 1999]]",
        'set = [[0.4, "speed_trip_rpm", 3000]]\nspeed_rpm = [[0.5, 2100]]',
        'set = [[0.0, "control_mode", "torque"]]\nspeed_rpm = [[0.5, 2100]]',
    ],
)
def test_a_speed_that_no_trip_forbids_is_followed(steps, own):
    """Below the trip, with a trip that was raised before, and where the speed is not controlled."""
    file = own("[controller]\nspeed_trip_rpm = 2000\n[profile]", "duration_s = 0.6", steps)
    setup = setups.load(file)
    sim = SimulatedDrive(setup, 1)
    sim.run_profile(setup.profile)
    sim.check()


def test_a_step_after_the_end_is_refused_without_a_file():
    sim = SimulatedDrive(setups.load("paper-b"), 1)
    with pytest.raises(SetupError, match=r"ends at duration_s = 0\.1 s"):
        sim.run_profile(Profile(duration_s=0.1, speed_rpm=((0.2, 100.0),)))
    assert sim.state == "idle"


def constant_load(load):
    text = f'setup = "paper-a"\n[profile]\nduration_s = 2.0\nspeed_rpm = [[0.4, 100]]\n{load}\n'
    return setups.parse(text, "test")


def test_a_constant_load_before_the_flux_is_refused():
    with pytest.raises(SetupError, match=r"profile\.load_Nm: 10 N m from 0 s.*0\.35 s"):
        constant_load("load_Nm = 10")
    with pytest.raises(SetupError, match=r"profile\.load_Nm: -10 N m from 0\.2 s"):
        constant_load("load_Nm = [[0.2, -10], [0.5, 10]]")


@pytest.mark.parametrize("load", ("load_Nm = [[0.4, 10]]", "load_Nm = 0.1", "load_Nm = 0"))
def test_a_constant_load_that_the_drive_can_take(load):
    """A load of 0.1 N m turns the shaft by 11 r/min within the 0.35 s."""
    setup = constant_load(load)
    sim = SimulatedDrive(setup, 1)
    sim.run_profile(setup.profile)
    assert sim.state == "run"


def test_loads_that_only_resist_may_be_there_from_the_beginning():
    text = 'setup = "paper-a"\n[load]\nkind = "friction"\n[profile]\nload_Nm = 10\n'
    assert setups.parse(text, "test").profile.load_Nm == ((0.0, 10.0),)


# --- field weakening -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "speed_rpm"), [("45/135", 900.0), ("75/105", 900.0), ("75/105", 1100.0)]
)
def test_field_weakening_knows_the_switching_table(table, speed_rpm):
    """With full flux the table 45/135 ends below 900 r/min at rated torque."""
    setup = setups.load("paper-a-feasible").changed(controller__table=table)
    sim = approach(Point(setup, speed_rpm, 10.0), samples_per_period=1)
    assert sim.speed_rpm == pytest.approx(speed_rpm, rel=0.02)
