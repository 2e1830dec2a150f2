"""A study on a real Dask cluster: a scheduler and workers in processes of their own, one of which
is killed on the way."""

import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace

import pytest
import tricks

from hexatorque import Study, setups
from hexatorque.cli.main import main
from hexatorque.sweeps import cluster, engine, work
from hexatorque.sweeps.errors import StudyError

pytest.importorskip("distributed")
RUNS = 60


def dask(folder, *words):
    """A process of Dask; where it finds the tricks, and nothing on the network but this machine."""
    path = os.path.dirname(tricks.__file__)
    with (folder / f"{words[0]}.log").open("a") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *map(str, words)], cwd=folder, stdout=log, stderr=log,
            env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """The scheduler's address, and the workers' processes."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    begin = ["scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--no-jupyter"]
    processes = [dask(folder, *begin, "--scheduler-file", file)]
    # Should pytest be killed, the workers end without their scheduler.
    worker = ["worker", "--scheduler-file", file, "--nthreads", 1, "--no-nanny", "--no-dashboard"]
    worker += ["--death-timeout", 60]
    try:
        processes += [dask(folder, *worker, "--host", "127.0.0.1") for _ in range(2)]
        end_s = time.monotonic() + 60
        while not file.exists():
            assert time.monotonic() < end_s, (folder / "scheduler.log").read_text()
            time.sleep(0.1)
        from json import loads

        yield loads(file.read_text())["address"], processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.fixture
def make(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "Cluster", tricks.tricked(cluster.Cluster))
    monkeypatch.setattr(cluster, "ANSWER_S", 20.0)  # the workers may still be on their way

    def made():
        setup = replace(setups.load("paper-b"), title=str(tmp_path))
        keys = {
            "point.speed_rpm": [100 + k for k in range(RUNS)],
            "point.load_Nm": [tricks.TAKES_TIME] * RUNS,
        }
        return Study(setup, keys, ["speed_rpm"], "list")

    return made


def test_a_worker_that_is_killed_costs_no_row(make, started, tmp_path):
    address, processes = started
    made, count = make(), 0
    for _ in made.rows(tmp_path, scheduler=address):
        count += 1
        if count == 10:
            processes[0].send_signal(signal.SIGKILL)
    assert processes[0].wait(10) == -signal.SIGKILL and processes[1].poll() is None
    assert made.results.figures[:, 0].tolist() == [(100 + k) / 3 for k in range(RUNS)]
    assert made.failures == {} and count == RUNS
    assert len((tmp_path / "study.journal").read_text().splitlines()) == RUNS + 1


def test_a_worker_of_another_version_is_named(make, started):
    made = make()
    there = {**work.identity(), "hexatorque": "9.9"}
    shared = work.Work(made.setup, made.metrics, "point", 0.0, 9.0, there)
    workers = cluster.Cluster(started[0], 1)
    with pytest.raises(StudyError, match=r"worker on .*: hexatorque .*, this study needs 9\.9"):
        list(engine.rows(shared, made.space.cases([0]), workers))


@pytest.mark.parametrize("silent", [True, False])
def test_a_scheduler_that_does_not_answer_is_one_line(silent, tmp_path, capsys, monkeypatch):
    """Neither where nobody listens nor where somebody listens and says nothing."""
    monkeypatch.setattr(cluster, "ANSWER_S", 1.5)
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        if silent:
            listening.listen()
        address = f"tcp://127.0.0.1:{listening.getsockname()[1]}"
        line = ["sweep", "--grid", "point.speed_rpm=500,900", "--metric", "i1_A"]
        assert main([*line, "--scheduler", address, "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said == f"hexatorque: scheduler {address}: does not answer\n"


def test_an_address_that_is_none(tmp_path, capsys):
    line = ["sweep", "--grid", "point.speed_rpm=500,900", "--scheduler", "nowhere:x:y"]
    assert main([*line, "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("hexatorque: scheduler nowhere:x:y: ") and said.count("\n") == 1
