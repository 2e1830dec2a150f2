"""The runs of a study are computed in processes, in the items' order, and each is kept."""

import json
import os

import pytest

from hexatorque.evidence import kept
from hexatorque.evidence.studies.runs import each
from hexatorque.sweeps.errors import StudyError


def root(item, progress):
    """Of a pair: a file's name and a number. The file gets a line for each call."""
    name, number = item
    with open(name, "a", encoding="utf-8") as told:
        told.write(f"{os.getpid()} {number}\n")
    progress(0.25)
    if number < 0:
        raise ValueError(number)
    if number == 13:
        os._exit(1)
    return {"root": number**0.5}


@pytest.fixture
def called(tmp_path):
    return tmp_path / "called"


def items(called, *numbers):
    return [(str(called), number) for number in numbers]


def calls(called):
    return [line.split() for line in called.read_text().splitlines()]


def test_the_order_is_that_of_the_items_and_other_processes_compute(called):
    seconds = []
    found = each(root, items(called, 9, 4, 1, 0, 16), progress=seconds.append)
    assert found == [{"root": n} for n in (3, 2, 1, 0, 4)]
    assert seconds == 5 * [0.25]
    assert str(os.getpid()) not in {process for process, _ in calls(called)}


def test_a_study_that_was_broken_off_goes_on_where_it_was(called, tmp_path):
    folder = tmp_path / "runs"
    numbers = [n * n for n in range(20, 40)]
    with pytest.raises(ValueError):
        each(root, items(called, *numbers, -1), folder)
    there = [json.loads(path.read_text())[0]["root"] ** 2 for path in folder.glob("*.json")]
    assert len(there) >= 10 and not list(folder.glob("*.part"))
    called.unlink()
    assert each(root, items(called, *numbers), folder) == [{"root": n} for n in range(20, 40)]
    assert not called.exists() or not {float(n) for _, n in calls(called)} & set(there)


def test_a_damaged_file_and_another_package_are_computed_again(called, tmp_path, monkeypatch):
    folder = tmp_path / "runs"
    task = items(called, 4)
    each(root, task, folder)
    (path,) = folder.iterdir()
    assert json.loads(path.read_text()) == [{"root": 2}]
    for damaged in ("[{", "7", '{"root": 3}', "[]"):
        path.write_text(damaged)
        assert each(root, task, folder) == [{"root": 2}]
    digest = kept.digest  # a module that only studies use has changed
    monkeypatch.setattr(kept, "digest", lambda *names: digest(*names) + len(names) * "!")
    assert each(root, task, folder) == [{"root": 2}]
    assert len(calls(called)) == 6 and len(list(folder.iterdir())) == 2


def test_a_process_that_dies_ends_the_study_with_its_item(called):
    with pytest.raises(StudyError, match="13"):
        each(root, items(called, 13))
