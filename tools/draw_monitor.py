"""Draw two pictures of the web page: a virtual board runs, and its speed reference steps; the log
after a trip.

`python tools/draw_monitor.py [FOLDER]` needs a Chromium.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import doc_page

ROOT = Path(__file__).parents[1]
sys.path += [str(ROOT / "tests"), str(ROOT / "tests" / "host" / "monitor")]

from chromium import Chromium, Page, program  # type: ignore[import-not-found]  # noqa: E402

CHANNELS = (
    "speed_rpm", "torque_ref_Nm", "torque_Nm", "i_u1_A", "i_u2_A", "psi_alpha_Wb", "psi_beta_Wb",
    "vdc_V",
)  # fmt: skip
SPEED = "#quick input[aria-label=speed_ref_rpm]"
BEFORE_RPM, AFTER_RPM = 200, 400
TRIP_RPM, TOO_FAST_RPM = 500, 600
SETTLE_S, SHOWN_S, ROWS_S = 4.0, 1.6, 0.5


def hexatorque(*words: object) -> subprocess.Popen:
    command = [sys.executable, "-m", "hexatorque", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def line_of(process: subprocess.Popen, text: str) -> str:
    """The first line that has this text."""
    for line in process.stdout or ():
        if text in line:
            return line.strip()
    raise SystemExit(f"{text}: not printed")


def to_speed(page: Page, rpm: float) -> None:
    page.type(SPEED, f"{rpm:g}")
    page.key("Enter", "Enter", "\r")


def draw(page: Page, picture: Path) -> None:
    page.until("document.body.dataset.state === 'idle'")
    page.click("[role=tab][data-panel=channels]")
    for name in CHANNELS:
        page.js(
            f"(() => {{ const box = document.querySelector('#channels input[value={name}]');"
            "if (!box.checked) box.click(); })()"
        )
    page.js(
        "document.querySelectorAll('#channels input:checked').forEach((box) => {"
        f"if (!{list(CHANNELS)!r}.includes(box.value)) box.click(); }})"
    )
    page.click("[role=tab][data-panel=drive]")
    page.choose("#window", "2")
    to_speed(page, BEFORE_RPM)
    page.click("#start")
    page.until("document.body.dataset.state === 'run'")
    time.sleep(SETTLE_S)
    to_speed(page, AFTER_RPM)
    page.js("document.activeElement.blur()")
    time.sleep(SHOWN_S)
    page.picture(picture)


def draw_log(page: Page, picture: Path) -> None:
    """After a trip by over-speed."""
    to_speed(page, TOO_FAST_RPM)
    page.until("document.body.dataset.state === 'fault'")
    page.click("[role=tab][data-panel=fault]")
    page.click("#log summary")
    page.until("document.querySelectorAll('#log tr').length > 1")
    time.sleep(ROWS_S)  # the fault's rows come above it
    page.js("document.querySelector('#log').scrollIntoView()")
    page.picture(picture)


def main(kept: Path) -> None:
    if program() is None:
        raise SystemExit("a Chromium is needed: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        run.mkdir(mode=0o700)
        os.environ["XDG_RUNTIME_DIR"] = str(run)
        link = Path(folder) / "board"
        board = hexatorque("board", "serve", "--setup", "paper-a-feasible", "--link", link,
                           "--set", f"controller.speed_trip_rpm={TRIP_RPM}")  # fmt: skip
        line_of(board, "virtual")
        monitor = hexatorque("board", "monitor", "--no-browser", "--device", link, "-o", folder)
        try:
            url = line_of(monitor, "http://")
            with Chromium(Path(folder) / "profile") as browser:
                page = browser.open(url)
                for name, drawn in (("monitor", draw), ("log", draw_log)):
                    picture = Path(folder) / f"{name}.png"
                    drawn(page, picture)
                    doc_page.keep(picture, kept)
        finally:
            for process in (monitor, board):
                process.send_signal(signal.SIGINT)
                process.wait(30)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
