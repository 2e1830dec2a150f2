"""The power stage's temperatures in a running drive: warning, limit, trip, and what keeps them."""

import numpy as np
import pytest
from campaigns import part
from waiting import until_it_runs

from hexatorque import SimulatedDrive, firmware, load
from hexatorque.errors import InputError
from hexatorque.plant.vsd import PHASES

NAME = "paper-a-feasible"
#: A stage whose hottest leg is this much above its heat sink with the current of a rated load.
RISE_K, SINK_DEGC = 40.0, 50.0
DROP_V, OHM, NJ_VA, TAU_S = 1.0, 0.05, 150.0, 0.3


def loss_W(i_A, vdc_V=250.0, f_Hz=10e3):
    i_A = np.abs(i_A)
    return DROP_V * i_A + OHM * i_A**2 + 1e-9 * NJ_VA * f_Hz * vdc_V * i_A


def rated_A(setup):
    machine = SimulatedDrive(setup).machine
    return machine.current_A(setup["rated.torque_Nm"], setup.parameter("flux_ref_Wb"))


def drive(scheme="db-dtfc", **changes):
    setup = load(NAME)
    stage = {
        "device_K_W": RISE_K / loss_W(rated_A(setup)), "device_s": TAU_S, "device_ohm": OHM,
        "device_nJ_VA": NJ_VA, "drop_V": DROP_V, "ambient_degC": SINK_DEGC,
    }  # fmt: skip
    paths = {f"controller.{key}": value for key, value in stage.items()}
    latency = "predicted" if firmware.needs_prediction(scheme) else setup["timing.latency"]
    sim = SimulatedDrive(
        setup.changed(
            {"controller.scheme": scheme, "timing.latency": latency, "load.kind": "constant",
             "inverter.v_switch_V": DROP_V, "inverter.v_diode_V": DROP_V, **paths, **changes}
        ), 1,
    )  # fmt: skip
    until_it_runs(sim)
    return sim


def warm(sim):
    return bool(int(sim.controller.channel("warnings")) & firmware.lib.HT_WARNING_DEVICE)


def rises(sim, seconds, before):
    """Of all legs by the true currents, in each period."""
    sim.run(seconds)
    recording = sim.take()
    i = np.array([recording[f"plant.i_{phase}_A"] for phase in PHASES])
    gain = np.exp(-sim.period_s / TAU_S)
    r_K_W = sim.get("device_K_W")
    found = []
    for sample in i.T:
        before = before * gain + (1 - gain) * r_K_W * loss_W(sample)
        found.append(before)
    return np.array(found)


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc", "foc"))
@pytest.mark.parametrize("speed_rpm", (0.0, 600.0))
def test_the_hottest_leg_is_known_standing_and_turning(scheme, speed_rpm):
    """Within the 11 % that the root of the mean square is above the mean, 2 K of ripple that the
    samples do not see, and what the low pass of two slow periods is behind."""
    sim = drive(scheme)
    torque_Nm = 0.8 * sim.setup["rated.torque_Nm"]
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(0.5, record=False)
    sim.load_Nm = torque_Nm
    true = rises(sim, 2.5, np.zeros(6))[-1]
    seen = np.array(list(sim.controller.drive.device_heat.rise_K))
    assert sim.state == "run"
    assert true.max() - 2.5 < seen.max() < 1.13 * true.max() + 2.5, (true, seen)
    degC = sim.controller.channel("device_degC")
    assert degC == pytest.approx(SINK_DEGC + seen.max(), abs=0.01)


#: Foster chains of an IGBT and its diode, and their energies. The drive is told none of them.
CHAINS = {
    "heat.switch_K_W": [0.4, 2.0, 6.0, 4.0], "heat.diode_K_W": [1.0, 4.0, 8.0, 2.0],
    "heat.switch_s": [2e-3, 0.02, 0.1, 0.5], "heat.diode_s": [2e-3, 0.02, 0.1, 0.5],
    "inverter.v_switch_V": 1.2, "inverter.v_diode_V": 1.0, "inverter.r_switch_ohm": 0.05,
    "inverter.r_diode_ohm": 0.03, "inverter.e_on_mJ": 0.5, "inverter.e_off_mJ": 0.4,
    "inverter.e_ref_V": 300.0, "inverter.e_ref_A": 10.0,
}  # fmt: skip


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc", "foc"))
@pytest.mark.parametrize("speed_rpm", (0.0, 30.0, 600.0))
def test_what_follows_from_the_plants_chains_is_never_below_its_hottest_junction(scheme, speed_rpm):
    """At most the rise of a leg that stands, which is twice that of one that turns."""
    latency = "predicted" if firmware.needs_prediction(scheme) else "immediate"
    setup = load(NAME).changed(
        {"controller.scheme": scheme, "timing.latency": latency, "load.kind": "constant", **CHAINS}
    )
    sim = SimulatedDrive(setup, 1)
    until_it_runs(sim)
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(0.4, record=False)
    sim.load_Nm = 0.8 * setup["rated.torque_Nm"]
    sim.run(1.5, record=False)
    for _ in range(60):
        sim.run(0.01, record=False)
        true_K = sim.junctions.junction_degC.max() - setup["heat.ambient_degC"]
        seen_K = sim.controller.channel("device_degC") - setup["heat.ambient_degC"]
        assert true_K > 12 and true_K < seen_K < 2.4 * true_K, (true_K, seen_K)


#: With magnets a leg that stands has the amplitude for as long as the load lasts.
STANDING = [("paper-a-feasible", "ddr"), ("paper-a-feasible", "db-dtfc"), ("paper-b", "foc"),
            ("magnet-surface", "ddr"), ("magnet-surface", "foc")]  # fmt: skip


def standing(name, scheme):
    """A drive that stands under its rated torque, its chains those of above for its current."""
    share = rated_A(load(NAME)) / rated_A(load(name))
    chains = {
        key: [share * K_W for K_W in value] if key.endswith("_K_W") else value
        for key, value in CHAINS.items()
    }
    latency = "predicted" if firmware.needs_prediction(scheme) else load(name)["timing.latency"]
    setup = load(name).changed(
        {"controller.scheme": scheme, "timing.latency": latency, "load.kind": "constant", **chains}
    )
    torque_Nm = setup["rated.torque_Nm"]
    sim = SimulatedDrive(setup.changed({"controller.torque_limit_Nm": 1.7 * torque_Nm}), 1)
    until_it_runs(sim)
    sim.load_Nm = torque_Nm
    sim.run(2.5, record=False)
    assert (sim.state, sim.faults) == ("run", [])
    return sim, torque_Nm


@pytest.mark.parametrize(("name", "scheme"), part(STANDING, 3))
def test_an_overload_at_standstill_trips_before_a_junction_passes_the_trips_level(name, scheme):
    """A level 20 % above the rise under rated torque, which does not trip. Half as much torque
    again makes at least 1.4 times that rise: the threshold's loss grows with the current."""
    sim, torque_Nm = standing(name, scheme)
    ambient_degC = sim.setup["heat.ambient_degC"]
    trip_degC = ambient_degC + 1.2 * (sim.controller.channel("device_degC") - ambient_degC)
    sim.set_many({"device_limit_degC": trip_degC, "device_trip_degC": trip_degC})
    sim.run(1.0, record=False)
    assert sim.state == "run"
    hottest_degC = 0.0
    for step in range(100):
        sim.load_Nm = torque_Nm * min(1.5, 1.0 + 0.1 * step)
        sim.run(0.02, record=False)
        hottest_degC = max(hottest_degC, sim.junctions.junction_degC.max())
    assert sim.faults == ["power stage hot"]
    assert hottest_degC < trip_degC, (hottest_degC, trip_degC)


def test_warning_then_a_pulled_limit_then_a_trip():
    """Limits at half of the rise that an overload makes: the torque falls until it is held."""
    sim = drive(**{"controller.device_limit_degC": 80.0, "controller.device_trip_degC": 110.0})
    sim.set("speed_ref_rpm", 300)
    sim.run(0.5, record=False)
    assert sim.controller.drive.heat_warnings == 0
    limit_Nm = sim.controller.channel("torque_limit_Nm")
    sim.set("control_mode", "torque")
    sim.set("torque_ref_Nm", 1000.0)
    sim.load_Nm = 1.2 * sim.setup["rated.torque_Nm"]
    lowest, seen = limit_Nm, 0.0
    for _ in range(30):
        sim.run(0.05, record=False)
        lowest = min(lowest, sim.controller.channel("torque_limit_Nm"))
        seen = max(seen, sim.controller.channel("device_degC"))
        if sim.controller.channel("device_degC") > 80.0:
            assert warm(sim)
    assert sim.state == "run" and 80 < seen < 110 and lowest < 0.9 * limit_Nm
    assert int(sim.controller.channel("limits")) & firmware.lib.HT_LIMIT_HEAT
    sim.set_many({"device_limit_degC": seen - 20.0, "device_trip_degC": seen - 20.0})
    sim.run(0.05, record=False)
    assert sim.faults == ["power stage hot"]


def test_clear_and_start_keep_the_temperature_and_a_hot_stage_does_not_start():
    sim = drive(**{"controller.device_s": 5.0})
    heat = sim.controller.drive.device_heat
    heat.rise_K[3] = 85.0
    sim.run(0.03, record=False)
    assert sim.faults == ["power stage hot"]
    sim.clear()
    sim.start()
    sim.run(0.02, record=False)
    assert sim.faults == ["power stage hot"] and heat.rise_K[3] > 80
    sim.clear()
    sim.run(2.0, record=False)
    assert 50 < heat.rise_K[3] < 60  # cooled by its time constant
    until_it_runs(sim)


def test_the_heat_sinks_thermistor_is_the_base_and_limits_without_a_model():
    sim = drive(**{"sensors.sink_ntc_ohm": 5e3})
    sim.junctions.sink_degC = 70.0
    sim.run(1.5, record=False)
    drive_ = sim.controller.drive
    base = sim.controller.channel("device_degC") - max(drive_.device_heat.rise_K)
    assert base == pytest.approx(70.0, abs=0.3)
    sim.set("device_K_W", 0.0)
    sim.junctions.sink_degC = 120.0
    sim.run(0.5, record=False)
    assert sim.state == "run" and warm(sim)
    sim.junctions.sink_degC = 131.0
    sim.run(0.5, record=False)
    assert sim.faults == ["power stage hot"]


def test_levels_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="device_limit_degC = 140 degC: allowed is up to"):
        load(NAME).changed({"controller.device_limit_degC": 140.0})


@pytest.mark.parametrize("scheme", ("ddr", "db-dtfc"))
def test_a_stage_that_stays_cool_leaves_the_drives_bits(scheme):
    states = []
    for stage in ({}, {"device_K_W": 0.1}):
        base = load(NAME).changed({"controller.scheme": scheme, "timing.latency": "predicted"})
        sim = SimulatedDrive(base.changed({f"controller.{k}": v for k, v in stage.items()}))
        until_it_runs(sim)
        sim.set("speed_ref_rpm", 300)
        sim.run(0.6, record=False)
        states.append(sim.plant_state.copy())
    assert np.array_equal(*states)
