"""A drive that was started from a page stops within 2 s after the page has stopped running.

Each test stops a real browser, or the monitor, in another way. The time from the end of the page
to the end of the drive is measured by the board's own clock. A loaded computer delays the browser
and the monitor, but it does not extend the board's 2 s. The monitor sends STOP 0.5 s before the
2 s are over.
"""

import signal
import time

import pytest
from chromium import Chromium, program
from waiting import WAIT_S

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

#: Longest time between the page's last answer and the stop of the drive, in the board's time.
LIMIT_S = 2.0
STATE = "document.body.dataset.state"


@pytest.fixture
def browser(tmp_path):
    """A browser for this test alone. It ends with the test, its stopped processes included."""
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
    """The board's time from `begun_s` until its drive was off. 0: on a busy computer the page had
    not run even before, and the drive was off already."""
    end = time.monotonic() + WAIT_S
    while (off_s := board.off_s(begun_s)) is None:
        if not board.working:
            return 0.0
        assert time.monotonic() < end, "the drive still runs"
        time.sleep(0.02)
    return off_s - begun_s


def notice(monitor, words: str) -> None:
    """Wait for a notice on the pages. It comes right after the stop."""
    with monitor.page() as frame:
        end = time.monotonic() + WAIT_S
        while words not in frame().get("status", {}).get("notice", ""):
            assert time.monotonic() < end


def test_a_page_that_runs_keeps_the_drive_running(page, board):
    """Even if its script is repeatedly busy for a short time."""
    begun_s = board.time_s
    page.js("void setInterval(() => { const end = performance.now() + 100;"
            "while (performance.now() < end); }, 500)")  # fmt: skip
    while board.time_s < begun_s + 2 * LIMIT_S:
        time.sleep(0.05)
    shown = page.js("document.querySelector('#alarm').textContent")
    assert board.working and board.off_s(begun_s) is None, shown


@pytest.mark.parametrize("kinds", [("renderer",), ("browser", "renderer", "GPU", "utility")])
def test_a_stopped_browser(page, browser, monitor, board, kinds):
    """With its renderers stopped, the script does not run, but the browser still receives what
    the monitor sends. With all processes stopped, the connections still stay open."""
    with browser.stopped(kinds):
        begun_s = board.time_s
        assert off_after(board, begun_s) < LIMIT_S
        notice(monitor, "no page answered")
    # When the browser continues, its old requests do not start the drive again.
    page.until(f"{STATE} === 'idle'")
    time.sleep(1.0)
    assert not board.working


def test_a_busy_script(page, monitor, board):
    page.js("void setTimeout(() => { while (true); }, 0)")
    begun_s = board.time_s
    assert off_after(board, begun_s) < LIMIT_S
    notice(monitor, "no page answered")


def test_a_dialog_that_waits_for_an_answer(page, board):
    """No script runs while the dialog is open."""
    page.js("void setTimeout(() => alert('?'), 0)")
    begun_s = board.time_s
    assert off_after(board, begun_s) < LIMIT_S
    page.call("Page.handleJavaScriptDialog", accept=True)


def test_a_computer_that_sleeps(page, monitor, board):
    """The monitor cannot run and send STOP either, so the board's watchdog stops the drive."""
    monitor.process.send_signal(signal.SIGSTOP)
    try:
        begun_s = board.time_s
        assert off_after(board, begun_s) < LIMIT_S
    finally:
        monitor.process.send_signal(signal.SIGCONT)
    page.until(f"['idle', 'fault'].includes({STATE})")
    time.sleep(1.0)
    assert not board.working
    # The port server stopped it for the silent monitor, or the board's watchdog for both.
    said = (
        r"/at tick \d+: the monitor was silent/.test(document.querySelector('#alarm').textContent)"
    )
    page.until(f"{said} || {STATE} === 'fault'")


def test_a_second_page_that_runs_is_enough(page, browser, monitor, board):
    """The second page is in another browser, because one renderer may serve both pages of one."""
    with monitor.page():
        with browser.stopped(("renderer",)):
            begun_s = board.time_s
            while board.time_s < begun_s + 2 * LIMIT_S:
                time.sleep(0.05)
            assert board.working and board.off_s(begun_s) is None
        begun_s = board.time_s
        page.close()
    assert off_after(board, begun_s) < LIMIT_S
