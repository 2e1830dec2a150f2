"""A drive that was started from a page is off within 2 s of a page that no longer runs.

Each test stops a real browser, or the monitor, in another way. The times are the board's own:
what it counts between the moment at which the page stops and the moment at which its drive is
off. A loaded computer delays the browser and the monitor, but it does not make the board's 2 s
longer; the monitor gives STOP 0.5 s before they are over.
"""

import signal
import time

import pytest
from chromium import Chromium, program

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

#: The board's time from the last sign of a page to the drive that is off.
LIMIT_S = 2.0
STATE = "document.body.dataset.state"


@pytest.fixture
def browser(tmp_path):
    """Of this test alone: what it has stopped is ended after it."""
    with Chromium(tmp_path / "profile") as browser:
        yield browser


@pytest.fixture
def page(browser, monitor):
    page = browser.open(monitor.url)
    page.until(f"{STATE} === 'idle'")
    page.until("!document.querySelector('#start').disabled")
    page.click("#start")
    page.until(f"{STATE} === 'run'")
    return page


def off_after(board, begun_s: float) -> float:
    """The board's time from `begun_s` until its drive was off."""
    end = time.monotonic() + 60
    while (off_s := board.off_s(begun_s)) is None:
        assert time.monotonic() < end, "the drive runs on"
        time.sleep(0.02)
    return off_s - begun_s


def notice(monitor, words: str) -> None:
    """What pages say; it comes right after the stop."""
    with monitor.page() as frame:
        end = time.monotonic() + 10
        while words not in frame().get("status", {}).get("notice", ""):
            assert time.monotonic() < end


def test_a_page_that_runs_keeps_the_drive_running(page, board):
    """Also one that is busy for a short while, again and again."""
    begun_s = board.time_s
    page.js("void setInterval(() => { const end = performance.now() + 100;"
            "while (performance.now() < end); }, 500)")  # fmt: skip
    while board.time_s < begun_s + 2 * LIMIT_S:
        time.sleep(0.05)
    shown = page.js("document.querySelector('#alarm').textContent")
    assert board.working and board.off_s(begun_s) is None, shown


@pytest.mark.parametrize("kinds", [("renderer",), ("browser", "renderer", "GPU", "utility")])
def test_a_stopped_browser(page, browser, monitor, board, kinds):
    """Its renderers: the page's script stands still, while the browser still takes all that the
    monitor sends. All of it: connections stay open, too."""
    with browser.stopped(kinds):
        begun_s = board.time_s
        assert off_after(board, begun_s) < LIMIT_S
        notice(monitor, "no page answered")
    # What was under way in the browser does not start anything.
    page.until(f"{STATE} === 'idle'")
    time.sleep(1.0)
    assert not board.working


def test_a_busy_script(page, monitor, board):
    page.js("void setTimeout(() => { while (true); }, 0)")
    begun_s = board.time_s
    assert off_after(board, begun_s) < LIMIT_S
    notice(monitor, "no page answered")


def test_a_dialog_that_waits_for_an_answer(page, board):
    """No script runs behind it."""
    page.js("void setTimeout(() => alert('?'), 0)")
    begun_s = board.time_s
    assert off_after(board, begun_s) < LIMIT_S
    page.call("Page.handleJavaScriptDialog", accept=True)


def test_a_computer_that_sleeps(page, monitor, board):
    """Its monitor stands still, so that nobody can send STOP: the board's watchdog does it."""
    monitor.process.send_signal(signal.SIGSTOP)
    try:
        begun_s = board.time_s
        assert off_after(board, begun_s) < LIMIT_S
    finally:
        monitor.process.send_signal(signal.SIGCONT)
    page.until(f"['idle', 'fault'].includes({STATE})")
    time.sleep(1.0)
    assert not board.working


def test_a_second_page_that_runs_is_enough(page, browser, monitor, board):
    """Of another browser: one renderer of this one may serve both."""
    with monitor.page():
        with browser.stopped(("renderer",)):
            begun_s = board.time_s
            while board.time_s < begun_s + 2 * LIMIT_S:
                time.sleep(0.05)
            assert board.working and board.off_s(begun_s) is None
        begun_s = board.time_s
        page.close()
    assert off_after(board, begun_s) < LIMIT_S
