"""Captures of a simulation: the rules of docs/protocol.md, sample by sample."""

from datetime import datetime

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque import setups
from hexatorque.drive.captures import TRIGGERS, Burst, Trigger
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.recording.recording import RecordingError
from hexatorque.setups import SetupError


def one_by_one(values, commands, manual_at, samples, pre, prescaler, kind, level):
    """Index of the trigger's row and the rows kept, by walking through all rows."""
    memory, last, trigger, command, manual = [], None, None, False, False
    for n, value in enumerate(values):
        command |= n in commands
        manual |= n == manual_at
        if n % prescaler:
            continue
        memory.append(value)
        hit = {
            "manual": False,
            "rising": last is not None and last <= level < value,
            "falling": last is not None and last >= level > value,
            "above": value > level,
            "below": value < level,
            "fault": last == 0 and value != 0,
            "command": command,
        }[kind]
        command, last = False, value
        if trigger is None and len(memory) > pre and (hit or manual):
            trigger, begin = n, len(memory) - 1 - pre
        if trigger is not None and len(memory) == begin + samples:
            return trigger, memory[begin:]
    return trigger, None


@settings(max_examples=examples(300), deadline=None)
@given(st.data())
def test_a_burst_by_the_rules(data):
    values = data.draw(st.lists(st.sampled_from([-1.0, 0.0, 1.0, 2.0]), min_size=1, max_size=60))
    samples = data.draw(st.integers(1, 12))
    pre = data.draw(st.integers(0, samples - 1))
    prescaler = data.draw(st.integers(1, 4))
    kind = data.draw(st.sampled_from(TRIGGERS))
    level = data.draw(st.sampled_from([-0.5, 0.0, 1.0]))
    cuts = sorted(data.draw(st.sets(st.integers(1, 59), max_size=6)) & set(range(1, len(values))))
    begins = [0, *cuts]
    commands = set(data.draw(st.lists(st.sampled_from(begins), max_size=2)))
    manual_at = data.draw(st.sampled_from([None, *begins]))
    burst = Burst([0], samples, pre, prescaler, Trigger(kind, "x", level), 0)
    rows = np.array(values, np.float32)[:, None]
    for begin, end in zip(begins, [*cuts, len(values)]):
        if begin in commands:
            burst.commanded()
        if begin == manual_at:
            burst.trigger()
        burst.feed(rows[begin:end], 100 + begin)
    trigger, kept = one_by_one(values, commands, manual_at, samples, pre, prescaler, kind, level)
    assert burst.tick == (None if trigger is None else 100 + trigger)
    assert burst.complete == (kept is not None)
    if kept is not None:
        assert burst.values[:, 0].tolist() == kept


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sometimes", "choose one of manual, rising"),
        ("rising:torque_Nm", "write rising:CHANNEL:LEVEL"),
        ("above:torque_Nm:inf", "write above:CHANNEL:LEVEL"),
        ("command:1", "command takes nothing more"),
    ],
)
def test_texts_that_are_no_triggers(text, said):
    with pytest.raises(RecordingError, match=said):
        Trigger.parse(text)


def test_a_simulations_capture_equals_its_recording():
    began = datetime.now().astimezone().replace(microsecond=0)
    sim = SimulatedDrive(
        setups.load("paper-a-feasible").changed(
            controller__build_s=0.05, controller__build_current_A=20.0
        ),
        4,
    )
    with pytest.raises(SetupError, match="none is armed"):
        sim.captured()
    with pytest.raises(SetupError, match="no channel 'x'"):
        sim.arm(["x"], 10)
    sim.start()
    sim.run(0.3)
    sim.arm(["speed_rpm", "i_u1_A"], 600, 200, "rising:speed_rpm:50", prescaler=2)
    sim.run(0.05)
    sim.set("speed_ref_rpm", 200.0)
    captured = sim.captured(2.0)
    own = sim.take()
    assert captured.rate_Hz == pytest.approx(5000) and captured.start_s == pytest.approx(-0.04)
    speed = captured["speed_rpm"]
    assert speed[199] <= 50 < speed[200] and captured.meta["trigger_s"] == 0
    first = captured.meta["trigger_tick"] - 1 - 2 * 200
    assert captured.ticks[0] == first + 1 and captured.ticks[200] == captured.meta["trigger_tick"]
    assert captured.meta["tick_Hz"] == pytest.approx(10e3)
    for rec in (captured, own):  # when it ran, by this computer's clock
        started = datetime.fromisoformat(rec.meta["started"])
        assert began <= started <= datetime.now().astimezone()
    for name in ("speed_rpm", "i_u1_A"):
        np.testing.assert_array_equal(captured[name], own[name][::4][first : first + 1200 : 2])
    sim.arm(["faults", "state"], 50, 10, "fault")
    sim.run(0.01, record=False)
    sim.set("i_trip_A", 0.1)
    faults = sim.captured(0.1)["faults"]
    assert np.all(faults[:10] == 0) and np.all(faults[10:] == 1)
    with pytest.raises(SetupError, match=r"not complete within 0.05 s"):
        sim.capture(["state"], 10, trigger="below:state:0", timeout_s=0.05)
    assert len(sim.capture(["state"], 10, 5)) == 10


def test_arming_changes_nothing():
    states = []
    for armed in (False, True):
        sim = SimulatedDrive(setups.load("paper-a-feasible"), 4)
        if armed:
            sim.arm(["state"], 100, trigger="fault")
        sim.start()
        sim.run(0.2, record=False)
        states.append(sim.plant_state.copy())
    assert np.array_equal(*states)


@pytest.mark.parametrize("level", ["1e300", "-1e39", "inf", "nan", "x", ""])
def test_a_level_beyond_float32_is_refused(level):
    with pytest.raises(RecordingError, match=r"levels up to 3\.4e38"):
        Trigger.parse(f"rising:torque_Nm:{level}")
