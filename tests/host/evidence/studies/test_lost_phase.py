"""The campaign of lost phases: its quick form holds, and it can fail."""

from types import SimpleNamespace

import numpy as np
import pytest

from hexatorque import firmware
from hexatorque.evidence.studies import lost_phase
from hexatorque.plant.legs import KINDS
from hexatorque.plant.vsd import PHASES


@pytest.fixture(scope="module")
def result():
    return lost_phase.study(quick=True)


def test_every_loss_is_named_and_the_drive_goes_on(result):
    assert lost_phase.failures(result) == []


def test_tables_count_every_run(result):
    counted = 0
    for (_, _, rows), column in zip(lost_phase.grid(result), (1, 1, 2)):
        counted += sum(int(row[column].split(" of ")[-1]) for row in rows)
    assert counted == len(result["rows"]) > 40


def test_the_picture_is_drawn(result, tmp_path):
    assert lost_phase.plot(result, tmp_path / "lost-phase.png").stat().st_size > 10_000


@pytest.fixture(scope="module")
def cases():
    return lost_phase.cases(quick=False)


def test_the_whole_campaign_has_every_combination(cases):
    losses = {(phase, kind) for phase in PHASES for kind in KINDS[1:]}
    for scheme in firmware.schemes():
        own = [case for case in cases["found"] if case.scheme == scheme]
        assert {(case.phase, case.kind) for case in own} == losses
    for mode in lost_phase.MODES:
        for scheme in firmware.schemes():
            own = [c for c in cases["goes on"] if (c.scheme, c.mode) == (scheme, mode)]
            assert {(case.phase, case.kind) for case in own} == losses


def test_the_whole_campaign_has_healthy_drives_of_all_schemes_and_sensors(cases):
    healthy = cases["healthy"]
    assert len(healthy) >= 1000
    assert {(c.scheme, c.sensor) for c in healthy} == {
        (scheme, sensor) for scheme in firmware.schemes() for sensor in lost_phase.SENSORS
    }


def test_the_whole_campaign_has_second_losses_that_can_be_borne(cases):
    seconds = [case for case in cases["goes on"] if case.second]
    assert len(seconds) > 50
    for case in seconds:
        apart = (PHASES.index(case.second) - PHASES.index(case.phase)) % 6
        assert apart and (case.mode == "least-loss" or apart in (2, 4))


def test_a_wrong_name_and_a_false_alarm_are_failures(monkeypatch):
    case = lost_phase.Case(0, "ddr", "u1", "open")

    def named(state, faults, warnings):
        snapshot = {"faults": faults, "warnings": warnings}
        return lost_phase._named(SimpleNamespace(state=state, snapshot=snapshot), "u1")

    assert named("fault", ["phase lost"], ["phase u1 lost"]) == ""
    assert named("fault", ["phase lost"], ["phase w2 lost"]) == "named phase w2 lost"
    assert named("fault", ["over-speed"], []) == "stopped by over-speed"
    assert named("run", [], []) == "not found"
    monkeypatch.setattr(lost_phase, "IN_TIME", dict.fromkeys(KINDS, 0.0))
    assert "electrical periods" in lost_phase.run("found", case).error


def test_a_leg_that_is_called_lost_is_a_failure(monkeypatch):
    """In the campaign of healthy drives. A leg that really breaks is in the sensor's place."""
    monkeypatch.setattr(lost_phase, "_fail", lambda sim, *_: sim.break_leg("v2", "open"))
    error = lost_phase.run("healthy", lost_phase.Case(1, "db-dtfc", sensor="none")).error
    assert "called lost: phase v2 lost" in error


def test_the_rated_current_is_that_of_the_rated_point():
    from hexatorque import setups
    from hexatorque.experiments.operating_points import Point, measure

    base = setups.load(lost_phase.SETUP)
    setup = base.changed(controller__scheme="db-dtfc", load__kind="constant")
    run = measure(Point(setup, lost_phase.RATED_RPM, lost_phase.RATED_NM), names=("i1_A",))
    rated_A = lost_phase.rated_A(base)
    assert run.metrics["i1_A"] / np.sqrt(2) == pytest.approx(rated_A, rel=0.03)
