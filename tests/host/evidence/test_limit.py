"""The plant in plain C, with which the simulation's speed is compared, is the same plant."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hexatorque import load
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.cost import limit
from hexatorque.experiments.operating_points import MOST_EDGES
from hexatorque.setups import SetupError

SOURCE = Path(__file__).parents[2] / "c" / "plant.c"


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    compiler = shutil.which("cc")
    assert compiler
    path = tmp_path_factory.mktemp("plant") / "libplant.so"
    command = [compiler, "-O2", "-ffp-contract=off", "-shared", "-fPIC", SOURCE, "-o", path, "-lm"]
    subprocess.run(command, check=True)
    return path


def running(scheme="ddr", **changes):
    setup = load("paper-a-feasible").with_scheme(scheme).changed(**changes)
    sim = SimulatedDrive(setup)
    sim.start()
    sim.run(0.5, record=False)
    sim.set_many({"speed_ref_rpm": 150.0, "load_Nm": 0.5})
    sim.run(0.2, record=False)
    return sim


@pytest.mark.parametrize("scheme", ["ddr", "dtc1"])
def test_both_replays_end_where_the_run_ended(library, scheme):
    """Low load at low speed: many currents pass zero in dead times, and legs float."""
    replay = limit.Replay(running(scheme), 0.3, 3000 * MOST_EDGES)
    assert np.abs(replay.end - replay.state).max() > 0.01
    for y, cpu_s in (replay.numba(), replay.plain_c(library)):
        assert np.abs(y - replay.end).max() <= limit.CLOSE
        assert cpu_s > 0
    # The edges decide: if half of them come a count later, the result is another one.
    replay.edges[len(replay.edges) // 2 :, 0] += 1
    with pytest.raises(SetupError, match="the plant in C ends elsewhere"):
        replay.check(replay.plain_c(library)[0], "C")


def test_what_plain_c_does_not_have_is_said(library):
    with pytest.raises(SetupError, match="the plant in plain C has no conduction drops"):
        limit.factors(running(inverter__v_diode_V=1.0), library, 0.1, 100, 1)
    sim = SimulatedDrive(load("paper-a-feasible"))
    with pytest.raises(SetupError, match="the plant in plain C: all legs are off"):
        limit.Replay(sim, 0.1, 100).plain_c(library)
    with pytest.raises(SetupError, match="not the plant in C; `make bench` builds it"):
        limit.Replay(sim, 0.1, 100).plain_c(SOURCE)
