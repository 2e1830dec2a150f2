"""Rows come whatever happens to the workers, and an interrupted study goes on."""

import os
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
import tricks

from hexatorque import Study, setups
from hexatorque.analysis.metrics import UNITS
from hexatorque.sweeps import engine, study, work, workers
from hexatorque.sweeps.errors import StudyError

RPM, NM = "point.speed_rpm", "point.load_Nm"


@pytest.fixture
def make(tmp_path, monkeypatch):
    """A study whose runs are tricks, one for each load."""

    def made(loads_Nm, kind=workers.Processes):
        if kind:
            monkeypatch.setattr(study, kind.__name__, tricks.tricked(kind))
        setup = replace(setups.load("paper-b"), title=str(tmp_path))
        speeds = [100 + k for k in range(len(loads_Nm))]
        return Study(setup, {RPM: speeds, NM: loads_Nm}, ["speed_rpm"], "list")

    return made


def figures(made):
    return made.results.figures[:, 0].tolist()


def expected(count):
    """Nine digits are not asked of the trick."""
    return [(100 + k) / 3 for k in range(count)]


def test_a_run_that_hangs_or_dies_does_not_take_the_study_with_it(make, monkeypatch):
    monkeypatch.setattr(workers, "GRACE_S", 1.0)
    made = make([0.0, tricks.HANGS, tricks.DIES, tricks.DIES_ONCE, 0.0, 0.0])
    made.run(jobs=2, limit_s=1.0)
    assert made.failures == {
        1: "not done within the time limit of 1 s",
        2: "its process died",
    }
    good = [0, 3, 4, 5]
    assert [figures(made)[k] for k in good] == [expected(6)[k] for k in good]
    assert made.results.done.all()


@pytest.mark.parametrize(("task_s", "batch"), [(1e-9, 1), (1e9, workers.MOST_RUNS)])
def test_short_runs_go_to_a_process_several_at_once(make, monkeypatch, task_s, batch):
    monkeypatch.setattr(workers, "TASK_S", task_s)
    made, sizes = make([0.0] * 60), []
    monkeypatch.setattr(
        study.Processes,
        "submit",
        lambda self, function, shared, cases: (
            sizes.append(len(cases)) or workers.Processes.submit(self, tricks.trick, shared, cases)
        ),
    )
    made.run(jobs=2)
    assert sizes[0] == 1 and max(sizes) == batch and sum(sizes) == 60
    assert figures(made) == expected(60)


def test_no_process_is_left(make):
    made = make([0.0] * 4)
    seen = set()
    for _ in made.rows(jobs=2):
        seen |= children_of_the_server()
    assert seen
    gone(seen)


def children_of_the_server():
    """Process ids of the workers, as the system has them."""
    from multiprocessing import forkserver

    server = forkserver._forkserver._forkserver_pid
    return set(map(int, Path(f"/proc/{server}/task/{server}/children").read_text().split()))


def gone(pids):
    end_s = time.monotonic() + 10
    while any(os.path.exists(f"/proc/{pid}") for pid in pids):
        assert time.monotonic() < end_s
        time.sleep(0.05)


PROGRAM = """
import sys, hexatorque, tricks
from hexatorque.sweeps import study, workers
workers.LOADED_ONCE = "tricks"  # no simulation is needed
study.Processes = tricks.tricked(workers.Processes)
loads = [tricks.TAKES_TIME] * 40
made = study.Study("paper-b", {"point.speed_rpm": [100 + k for k in range(40)],
                   "point.load_Nm": loads}, ["speed_rpm"], "list")
# The program has no `if __name__ == "__main__"`.
for row in made.rows(sys.argv[1], jobs=2, resume=len(sys.argv) > 2):
    print(row.number, flush=True)
made.save(sys.argv[1])
"""


def test_a_study_that_was_killed_goes_on_with_the_same_table(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    environment = {**os.environ, "PYTHONPATH": os.path.dirname(tricks.__file__)}

    def start(*words):
        command = [sys.executable, tmp_path / "program.py", *map(str, words)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)

    killed = start(tmp_path / "a")
    for _ in range(8):
        assert killed.stdout.readline()
    killed.send_signal(signal.SIGKILL)
    before = killed.communicate()[0]
    # As if the process had been killed within a line.
    with (tmp_path / "a" / study.JOURNAL).open("a") as journal:
        journal.write('[39, "", fal')
    again = start(tmp_path / "a", "resume").communicate()[0].split()
    assert len(before.split()) + 8 + len(again) <= 42 and len(again) < 33
    whole = Study(
        "paper-b",
        {RPM: [100 + k for k in range(40)], NM: [tricks.TAKES_TIME] * 40},
        ["speed_rpm"],
        "list",
    )
    for number in range(40):
        whole.results.add(work.Row(number, (expected(40)[number],)))
    whole.save(tmp_path / "b")
    for name in ("table.csv", "table.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_was_lost_by_the_computer_is_tried_again(make, tmp_path):
    made = make([0.0, tricks.DIES])
    made.run(tmp_path / "s", jobs=1)
    assert made.failures == {1: "its process died"}
    again = make([0.0, tricks.DIES])
    assert [row.number for row in again.rows(tmp_path / "s", resume=True, jobs=1)] == [1]


def test_a_finished_study_starts_nothing(make, tmp_path, monkeypatch):
    made = make([0.0, 0.0])
    made.run(tmp_path, jobs=1)
    monkeypatch.setattr(study, "Processes", lambda _: pytest.fail("a worker was started"))
    again, seen = make([0.0, 0.0], None), []
    again.run(tmp_path, resume=True, each=seen.append)
    assert figures(again) == figures(made) == expected(2)
    assert sorted(row.number for row in seen) == [0, 1]


@pytest.fixture
def threads():
    with ThreadPoolExecutor(2) as pool:
        yield pool


def test_a_disk_that_becomes_full_loses_no_row(make, tmp_path, threads):
    """The limit of a file's size stands for the disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    made = make([0.0] * 50, workers.Given)
    head = len(str(made.as_json()))
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (head + 600, before[1]))
        with pytest.raises(StudyError, match="the computed runs are kept, --resume goes on"):
            made.run(tmp_path, executor=threads)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, old)
    again = make([0.0] * 50, workers.Given)
    todo = [row.number for row in again.rows(tmp_path, resume=True, executor=threads)]
    assert 1 < len(todo) < 50
    assert figures(again) == expected(50)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"metrics": ("torque_Nm",)}, "another study, which differs in metrics"),
        ({"resume": False}, "a study is there already; --resume goes on with it"),
    ],
)
def test_another_study_is_refused(change, said, make, tmp_path, threads):
    make([0.0], workers.Given).run(tmp_path, executor=threads)
    other = make([0.0], workers.Given)
    other.metrics = change.get("metrics", other.metrics)
    with pytest.raises(StudyError, match=said):
        other.run(tmp_path, resume=change.get("resume", True), executor=threads)


def test_rows_of_another_version_are_refused(make, tmp_path, threads, monkeypatch):
    make([0.0], workers.Given).run(tmp_path, executor=threads)
    other = {**work.identity(), "build": "another"}
    monkeypatch.setattr(work, "identity", lambda: other)
    with pytest.raises(StudyError, match=r"made by another version .build .*, now another"):
        make([0.0], workers.Given).run(tmp_path, resume=True, executor=threads)


def test_two_processes_do_not_write_one_study(make, tmp_path, threads):
    made, other = (make([0.0] * 3, workers.Given) for _ in range(2))
    rows = made.rows(tmp_path, executor=threads)
    next(rows)
    with pytest.raises(StudyError, match="another process is at work on this study"):
        other.run(tmp_path, resume=True, executor=threads)
    rows.close()
    other.run(tmp_path, resume=True, executor=threads)
    assert figures(other) == expected(3)


def test_a_worker_of_another_version_is_named(make, threads):
    made = make([0.0], workers.Given)
    there = {**work.identity(), "numpy": "0.1"}
    shared = work.Work(made.setup, made.metrics, "point", 0.0, 9.0, there)
    with pytest.raises(StudyError, match=r"worker on .*: numpy .*, this study needs 0\.1"):
        list(engine.rows(shared, made.space.cases([0]), workers.Given(threads)))


def test_a_mistake_on_the_way_to_a_worker_is_named(make):
    class Broken(ThreadPoolExecutor):
        def submit(self, function, *arguments):
            return super().submit(int, "x")

    with Broken(1) as pool, pytest.raises(StudyError, match="a worker cannot take part: ValueErr"):
        make([0.0], None).run(executor=pool)


# -- real runs -------------------------------------------------------------------------------

PROFILE = {
    "profile.duration_s": 0.5,
    "profile.speed_rpm": [[[0.25, 1500.0]], [[0.25, 2500.0]], [[0.6, 2500.0]]],
}


@pytest.fixture(scope="module")
def measured():
    """Three profiles: the last has a step after its end."""
    made = Study(
        "paper-b", PROFILE | {"profile.duration_s": [0.5] * 3}, design="list",
        run=work.Runs("profile", from_s=0.35), schemes=["dtc1"],
    )  # fmt: skip
    made.run(jobs=2)
    return made


def test_a_run_that_is_refused_is_a_row_that_says_why(measured):
    assert measured.failures == {
        2: "profile.speed_rpm: step at 0.6 s: the profile ends at duration_s = 0.5 s"
    }


def test_processes_and_threads_make_the_same_bits(measured, threads):
    made = Study(
        "paper-b", PROFILE | {"profile.duration_s": [0.5] * 3}, design="list",
        run=work.Runs("profile", from_s=0.35), schemes=["dtc1"],
    )  # fmt: skip
    made.run(executor=threads)
    assert made.results.figures.tobytes() == measured.results.figures.tobytes()
    speed, torque = (list(UNITS).index(name) for name in ("speed_rpm", "torque_Nm"))
    assert 800 < made.results.figures[0, speed] < 1510  # it is on its way up
    assert made.results.figures[0, torque] != made.results.figures[1, torque]


def test_the_table_has_units_and_reasons(measured, tmp_path):
    pd, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    frame = measured.table()
    assert list(frame.run) == [0, 1, 2] and list(frame["controller.scheme"]) == ["dtc1"] * 3
    assert frame.attrs["units"]["torque_ripple_Nm"] == "N m"
    assert frame.attrs["units"]["profile.duration_s"] == "s"
    assert frame.f_sw_Hz.notna().tolist() == [True, True, False]
    csv, stored = measured.save(tmp_path)
    again = pd.read_csv(csv, keep_default_na=False, na_values={"f_sw_Hz": [""]})
    assert list(again.columns) == list(frame.columns) and list(again.failure) == list(frame.failure)
    assert again.f_sw_Hz[:2].tolist() == frame.f_sw_Hz[:2].tolist()
    table = parquet.read_table(stored)
    assert table.schema.field("f_sw_Hz").metadata == {b"unit": b"Hz"}
    assert table.column("f_sw_Hz").null_count == 1
    assert b'"design": "list"' in table.schema.metadata[b"hexatorque"]


def test_every_figure_has_a_unit(measured):
    assert set(measured.metrics) == set(UNITS) and measured.results.figures.shape == (3, len(UNITS))
