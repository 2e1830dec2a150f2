"""What a command says while it works."""

import io
import queue
import threading

import pytest
from rich.console import Console

from hexatorque.cli import working


@pytest.fixture
def at_once(monkeypatch):
    """Lines come without waiting, one for each `begin`."""
    monkeypatch.setattr(working, "FIRST_S", 0.0)
    monkeypatch.setattr(working, "AGAIN_S", 3600.0)


def pipe():
    return Console(file=io.StringIO(), force_terminal=False)


class Said(io.TextIOBase):
    """Standard error that hands over each line, so that none is lost between two threads."""

    def __init__(self):
        self._lines = queue.Queue()

    def write(self, text):
        if text.strip():
            self._lines.put(text)
        return len(text)

    def next_line(self):
        return self._lines.get(timeout=120.0)


def test_a_line_says_what_and_how_far():
    work = working.Work(None)
    work.begin("comparing", 20.0)
    assert str(work) == "comparing ..."
    work.advance(2.5)
    assert str(work) == "comparing ... 2.5 of about 20 s simulated"
    work.advance(18.0)  # more than was expected
    assert str(work) == "comparing ... 20.5 s simulated"
    work.begin("searching")
    work.advance(1.0)
    assert str(work) == "searching ... 1.0 s simulated"
    work.begin("writing the report", 3, "files")
    work.advance()
    work.call("writing")
    assert str(work) == "writing ... 1 of 3 files"


def test_what_is_no_terminal_gets_lines(at_once, monkeypatch):
    said = Said()
    monkeypatch.setattr(working.sys, "stderr", said)
    with working.working(pipe(), "first") as work:
        assert said.next_line() == "first ..."
        work.begin("second")
        assert said.next_line() == "second ..."


def test_work_that_ends_while_its_teller_looks_away_ends():
    """The teller forgets the last change at the very moment at which the work ends."""
    waits = []

    class Late(threading.Event):
        def clear(self):
            super().wait(120.0)
            super().clear()

        def wait(self, timeout=None):
            waits.append(timeout)
            return True

    work = working.Work(None)
    work.changed = Late()
    with working._lines(work):
        pass
    assert not waits


def test_short_work_says_nothing(capsys, monkeypatch):
    monkeypatch.setattr(working, "FIRST_S", 3600.0)
    with working.working(pipe(), "first") as work:
        work.begin("second")
    assert capsys.readouterr().err == ""


def test_beside_json_nothing_is_said(at_once, capsys):
    """With --json the console is standard error."""
    with working.working(Console(stderr=True, force_terminal=False), "first") as work:
        work.begin("second")
        assert not any(thread.name == working.TELLER for thread in working.threading.enumerate())
    assert capsys.readouterr().err == ""


def test_a_terminal_shows_the_work_under_way_and_leaves_nothing_behind():
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=100, legacy_windows=False)
    with working.working(console, "first [red]", 2.0) as work:
        work.advance(1.0)
        work.call("first, half")
        work.begin("second", 2, "files")
        work.advance()
    text = file.getvalue()
    assert "second" in text and "1 of 2 files" in text
    assert "first" not in text.rsplit("second", 1)[1]


def test_the_work_ends_with_an_error(at_once, capsys):
    with pytest.raises(ZeroDivisionError), working.working(pipe(), "first"):
        raise ZeroDivisionError
    assert not any(thread.name == working.TELLER for thread in working.threading.enumerate())
