"""The table of limits against the firmware: a channel that passes a level of the table trips the
drive at once, or cannot pass it."""

import numpy as np
import pytest

from hexatorque import firmware, setups
from hexatorque.drive.limits import LIMITS, of_board
from hexatorque.drive.simulated import SimulatedDrive

UNITS = dict(firmware.channels())
#: For each limit: its level as a share of what the channels reach, and what makes them move.
TRIPS = {
    "i_trip_A": (0.7, {}),
    "vdc_max_V": (1.02, {"vdc_V": 1.1}),
    "vdc_min_V": (0.98, {"vdc_V": 0.9}),
    "speed_trip_rpm": (1.1, {"speed_ref_rpm": 2.0}),
    "flux_trip_Wb": (1.01, {"flux_band_Wb": 10.0}),
}


@pytest.fixture
def sim() -> SimulatedDrive:
    sim = SimulatedDrive(setups.load("paper-b"), 1)
    sim.start()
    sim.set("speed_ref_rpm", 300.0)
    sim.set("load_Nm", 1.0)
    sim.run(1.2)
    sim.discard()
    return sim


def taken(sim: SimulatedDrive, duration_s: float):
    sim.run(duration_s)
    return sim.take()


def reached(recording, limit, sign: float) -> np.ndarray:
    return np.max([sign * recording[name] for name in limit.channels], axis=0)


def limit_of(parameter: str):
    return next(limit for limit in LIMITS if limit.parameter == parameter)


def test_each_limit_has_the_unit_of_its_channels():
    rows = firmware.parameters()
    for limit in LIMITS:
        assert {UNITS[name] for name in limit.channels} == {rows[limit.parameter].unit}
        assert limit.state in ("", *firmware.STATES)
    assert of_board(rows, UNITS) == list(LIMITS)


def test_of_another_firmware_only_what_it_has_is_told():
    assert of_board(["i_trip_A", "vdc_max_V"], ["i_u1_A", "speed_rpm"]) == [
        limit_of("i_trip_A")._replace(channels=("i_u1_A",))
    ]


@pytest.mark.parametrize("parameter", TRIPS)
def test_the_drive_trips_where_a_channel_passes_the_level(sim, parameter):
    limit = limit_of(parameter)
    share, provoked = TRIPS[parameter]
    before = taken(sim, 0.1)
    least = parameter == "vdc_min_V"  # the channel must stay above it
    level = share * float(np.max(reached(before, limit, 1)))
    sim.set(parameter, level)
    for name, factor in provoked.items():
        sim.set(name, factor * (sim.vdc_V if name == "vdc_V" else sim.get(name)))
    after = taken(sim, 1.0)
    faulty = np.flatnonzero(after["faults"])
    assert len(faulty)
    over = np.max([np.abs(after[name]) for name in limit.channels], axis=0)
    passed = np.flatnonzero(over < level if least else over > level)
    if len(passed):
        assert 0 <= faulty[0] - passed[0] <= 1
    else:  # an estimate is no number where the control has stopped: the snapshot has its last value
        assert np.isnan(over[faulty[0] :]).all() and np.nanmax(over) > 0.9 * level
        assert np.max(np.abs(sim.snapshot["psi_Wb"])) > level


@pytest.mark.parametrize(
    ("parameter", "level", "values"),
    [
        ("torque_limit_Nm", 2.0, {"torque_limit_Nm": 2.0, "speed_ref_rpm": -300.0}),
        ("flux_min_Wb", 0.3, {"flux_min_Wb": 0.3, "vdc_min_V": 10.0, "vdc_V": 35.0}),
    ],
)
def test_a_reference_reaches_its_level_and_does_not_pass_it(sim, parameter, level, values):
    limit = limit_of(parameter)
    sim.set_many(values)
    sim.run(0.02)  # the slow interrupt has taken them
    sim.discard()
    after = taken(sim, 0.5)
    assert not after["faults"].any()
    size = np.abs(np.concatenate([after[name] for name in limit.channels]))
    extreme = size.min() if parameter == "flux_min_Wb" else size.max()
    assert extreme == pytest.approx(level, rel=1e-6)


def test_in_the_state_test_another_current_trips():
    limit = limit_of("test_current_A")
    sim = SimulatedDrive(setups.load("paper-b"), 1)
    level = 0.5
    sim.set_many({"start_mode": "test", "test_current_A": level})
    sim.start()
    sim.run(0.3)
    assert sim.condition.name == limit.state
    sim.discard()
    sim.set("test_alpha_V", 20.0)
    after = taken(sim, 0.2)
    passed = np.flatnonzero(
        np.max([np.abs(after[name]) for name in limit.channels], axis=0) > level
    )
    faulty = np.flatnonzero(after["faults"])
    assert len(passed) and 0 <= faulty[0] - passed[0] <= 1
    assert limit_of("i_trip_A").state == ""  # in force there, too, and far away here
