"""The study of the step size: it repeats the run that it claims to, and its curve is that
of a fourth-order method."""

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.studies.integration import (
    errors,
    failures,
    grid,
    plot,
    replay,
    run_segment,
)
from hexatorque.experiments.operating_points import Point, approach
from hexatorque.plant.loop import MAX_STEP_S


@pytest.mark.parametrize("sample_delay_us", [0.0, 3.0])
def test_replay_is_the_run_itself(sample_delay_us):
    setup = setups.load("paper-a-feasible").changed(sensors__sample_delay_us=sample_delay_us)
    segment = run_segment(approach(Point(setup, -300, 5)), 0.05)
    assert len(segment.currents_A) == 500 and np.ptp(segment.currents_A) > 4
    assert np.array_equal(replay(segment), segment.currents_A)
    assert not np.array_equal(replay(segment, 50), segment.currents_A)


def test_study_and_its_figure(tmp_path):
    setup = setups.load("paper-b")
    points = [Point(setup.changed(controller__scheme=s), 2500, 2) for s in ("dtc1", "dtc3")]
    result = errors(points, 0.2)
    step = np.array(result["step_us"])
    for row in result["points"]:
        error = np.array(row["error"])
        order = np.diff(np.log(error[:4])) / np.diff(np.log(step[:4]))
        np.testing.assert_allclose(order, 4, atol=0.3)
        assert error[4] < 1e-10
        chosen = error[result["step_us"].index(MAX_STEP_S * 1e6)]
        assert chosen < result["limit"] / 5
    assert len(grid(result)[0][2]) == 2
    assert failures(result) == []
    assert len(failures(result | {"limit": 1e-20})) == 2
    path = plot(result, tmp_path / "error.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000
