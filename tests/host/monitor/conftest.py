"""A virtual board in a process of its own, the monitor's server in this process, and an HTTP
client that behaves like a browser."""

import contextlib
import http.client
import json
import os
import queue
import re
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from chromium import Chromium
from forked import Forked
from waiting import WAIT_S, until

#: The virtual board's watchdog waits this long, because many tests may load the computer.
WATCHDOG_MS = 800
#: The board's program. Its arguments are the name of its port; a file that holds its time and
#: whether its drive is at work, as two float64; a file with a line for each change of that. SIGUSR1
#: resets the board.
BOARD = f"""
import os, signal, sys, time
from pathlib import Path
import numpy as np
from hexatorque import setups
from hexatorque.boards import virtual as virtual_board
class Controller(virtual_board.BoardController):
    def __init__(self, device, values, **options):
        super().__init__(device, values, **options | {{"watchdog_ms": {WATCHDOG_MS}}})
virtual_board.BoardController = Controller
class Store(virtual_board.FileStore):
    def put(self, begin, raw):
        slow = Path(port + ".slow")
        if slow.exists():
            seconds = float(slow.read_text())
            slow.unlink()
            time.sleep(seconds)
        return super().put(begin, raw)
virtual_board.FileStore = Store
port, now, changes = sys.argv[1:]
now = np.memmap(now, np.float64, "w+", shape=2)
changes = open(changes, "w")
class Board(virtual_board.VirtualBoard):
    at_work, time_s = False, 0.0
    def run(self, duration_s, record=False):
        super().run(duration_s, record)
        Board.time_s += duration_s
        at_work = self.sim.condition.at_work
        now[:] = Board.time_s, at_work
        if at_work != Board.at_work:
            Board.at_work = at_work
            print(Board.time_s, int(at_work), file=changes, flush=True)
resets = []
signal.signal(signal.SIGUSR1, lambda *_: resets.append(1))
with virtual_board.Terminal() as line:
    os.symlink(line.port, port)
    print(port, flush=True)
    while True:
        with Board(setups.load("paper-b"), store=Path(port + ".store")) as board:
            board.sim.set("load_Nm", 1.0)
            resets.clear()
            virtual_board.serve(board, line, until=lambda: resets)
"""


def python(*arguments: object) -> Forked:
    displays = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in displays}
    return Forked(arguments, pipes=("stdout", "stderr"), env=environment)


@pytest.fixture(scope="session", autouse=True)
def own_directories(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME"):
            folder = tmp_path_factory.mktemp(name)
            folder.chmod(0o700)
            patch.setenv(name, str(folder))
        yield


class Board:
    """The time and state in the virtual board's process, read from its files, not its line."""

    def __init__(self, folder: Path) -> None:
        self.port = str(folder / "ttyHT0")
        self.slow = folder / "ttyHT0.slow"
        self._now, self._changes = folder / "now", folder / "changes"
        self.process = python("-c", BOARD, self.port, self._now, self._changes)
        assert self.port in self.process.stdout.readline(), self.process.stderr.read()
        self._users = 0

    @contextmanager
    def used(self):
        """It stands still while nobody uses it: it would need a tenth of a processor."""
        self._users += 1
        self.process.send_signal(signal.SIGCONT)
        try:
            yield
        finally:
            self._users -= 1
            if not self._users:
                self.process.send_signal(signal.SIGSTOP)

    @property
    def time_s(self) -> float:
        """The board's simulated time. It stops while its process does not run."""
        return float(np.memmap(self._now, np.float64, "r", shape=2)[0])

    @property
    def working(self) -> bool:
        return bool(np.memmap(self._now, np.float64, "r", shape=2)[1])

    def off_s(self, after_s: float) -> float | None:
        """When the drive first stopped after `after_s`, in the board's time; None: it runs."""
        for line in self._changes.read_text().splitlines():
            time_s, at_work = line.split()
            if float(time_s) > after_s and at_work == "0":
                return float(time_s)
        return None

    def write_slowly(self, seconds: float) -> None:
        self.slow.write_text(str(seconds))

    def reset(self) -> None:
        self.process.send_signal(signal.SIGUSR1)


@pytest.fixture(scope="session")
def session_board(own_directories, tmp_path_factory) -> Board:
    board = Board(tmp_path_factory.mktemp("dev"))
    try:
        yield board
    finally:
        board.process.kill()
        board.process.communicate()


@pytest.fixture
def board(session_board) -> Board:
    with session_board.used():
        yield session_board


@pytest.fixture
def port(board) -> str:
    return board.port


def patiently(call, *arguments):
    """Repeat the call until it succeeds: on a busy computer the board may not answer at once."""
    from hexatorque.serial import LinkError

    end = time.monotonic() + WAIT_S
    while True:
        try:
            return call(*arguments)
        except LinkError:
            if time.monotonic() > end:
                raise


def to_rest(drive, values: dict) -> None:
    """Make the drive idle, without faults, with these parameters, and let the machine stop."""
    drive.stop()
    if drive.state == "fault":
        drive.clear()
    drive.set_many(values)
    end = time.monotonic() + WAIT_S
    with drive.stream(["speed_rpm"], rate_Hz=100) as stream:
        for _, values in stream:
            if abs(values[-1, 0]) < 15:
                break
            assert time.monotonic() < end


@pytest.fixture
def drive(port):
    """An idle drive with the parameters it had in the beginning."""
    from hexatorque.drive.board import BoardDrive

    with patiently(BoardDrive.open, port) as drive:
        before = patiently(drive.get_all)
        yield drive
        patiently(to_rest, drive, before)


class Visitor:
    """The requests that a browser makes for a page, on one port of this computer."""

    def __init__(self, port: int, token: str) -> None:
        self.port, self.token = port, token
        self.host = f"127.0.0.1:{port}"
        self.cookie = ""

    def ask(self, method: str, path: str, body: bytes | None = None, **headers: str):
        """Status, headers and body of the reply. `headers`: with underscores for dashes; "" leaves
        one out."""
        given = {"Host": self.host, "Cookie": self.cookie}
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            if body is not None:
                given.setdefault("Content-Length", str(len(body)))
            for name, value in given.items():
                if value:
                    connection.putheader(name, value)
            connection.endheaders(body)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def enter(self) -> None:
        status, headers, _ = self.ask("GET", f"/?token={self.token}")
        assert status == 303
        self.cookie = headers["Set-Cookie"].partition(";")[0]

    def get(self, path: str):
        status, _, body = self.ask("GET", path)
        return status, json.loads(body)

    def post(self, path: str, data: object, **headers: str):
        """A command, sent as the page sends it."""
        mine = {"Origin": f"http://{self.host}", "Content_Type": "application/json"}
        status, _, body = self.ask("POST", path, json.dumps(data).encode(), **(mine | headers))
        return status, json.loads(body)

    @contextmanager
    def page(
        self,
        window_s: float = 2,
        bins: int = 500,
        cookie: str | None = None,
        answer: Callable[[float], dict | None] = lambda sent_s: {"sent_s": sent_s},
    ):
        """Open a page. Gives a function that returns the next frame. As the page's script does, a
        thread answers each frame; `answer` makes the answer from the frame's time, or None."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        headers = {"Host": self.host, "Cookie": self.cookie if cookie is None else cookie}
        connection.connect()
        stream = connection.sock  # the connection forgets it: an answer without an end
        connection.request("GET", f"/events?window_s={window_s}&bins={bins}", headers=headers)
        events = connection.getresponse()
        assert events.status == 200, events.read()
        frames: queue.SimpleQueue[dict | None] = queue.SimpleQueue()

        def script() -> None:
            # The server may have ended; this thread is not the one that tests it.
            with contextlib.suppress(OSError, http.client.HTTPException, ValueError):
                while line := events.readline():
                    if not line.startswith(b"data: "):
                        continue
                    one = json.loads(line[6:])
                    if "sent_s" in one and (given := answer(one["sent_s"])):
                        self.post("/beat", {"page": one["page"], "visible": True} | given)
                    frames.put(one)
            frames.put(None)

        def frame() -> dict:
            one = frames.get(timeout=WAIT_S)
            assert one, "the stream has ended"
            return one

        thread = threading.Thread(target=script, daemon=True)
        thread.start()
        try:
            yield frame
        finally:
            with contextlib.suppress(OSError):
                stream.shutdown(socket.SHUT_RDWR)
            thread.join(WAIT_S)
            events.close()
            connection.close()


class Site(Visitor):
    """A monitored drive, its server, and a browser that has the cookie."""

    def __init__(self, monitored, server) -> None:
        super().__init__(server.port, server.token)
        self.monitored, self.server = monitored, server
        self.enter()

    def until(self, state: str) -> None:
        """Wait until the drive is in this state."""
        until(lambda: self.monitored.status()["state"] == state)


@pytest.fixture
def site(drive, tmp_path):
    from hexatorque.monitor.monitored_drive import MonitoredDrive
    from hexatorque.monitor.server import Server

    with (
        MonitoredDrive(drive, tmp_path / "recordings", silent_s=1.0, hidden_s=2.0) as monitored,
        Server(monitored) as server,
    ):
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield Site(monitored, server)
        server.shutdown()
        thread.join()


class Monitor(Visitor):
    """`hexatorque board monitor` in a process of its own."""

    def __init__(self, *arguments: object) -> None:
        for _ in range(5):
            self.process = python(
                "-m", "hexatorque", "board", "monitor", "--no-browser", *arguments
            )
            title = self.process.stdout.readline()
            self.url = self.process.stdout.readline().strip()
            if self.url:
                break
            title += self.process.communicate()[1]
            assert "no reply" in title, title  # the board's process may not have run yet
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\?token=([\w-]{32})", self.url)
        assert found, (title, self.url)
        super().__init__(int(found[1]), found[2])
        self.enter()

    def end(self, number: signal.Signals) -> tuple[int, str]:
        """Send a signal. Returns the exit code and the output."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, out + err


@pytest.fixture(scope="session")
def left_at_rest():
    """left_at_rest(port): afterwards the board is idle, without faults, and has the parameters
    that it has now."""
    from hexatorque.drive.board import BoardDrive

    @contextmanager
    def use(port: str):
        with patiently(BoardDrive.open, port) as drive:
            before = patiently(drive.get_all)
        yield before
        with patiently(BoardDrive.open, port) as drive:
            patiently(to_rest, drive, before)

    return use


@pytest.fixture(scope="session")
def start_monitor(tmp_path_factory):
    """start_monitor(port): a monitor of the board."""

    @contextmanager
    def start(port: str):
        folder = tmp_path_factory.mktemp("recordings")
        monitor = Monitor("--device", port, "-o", folder)
        yield monitor
        if monitor.process.poll() is None:
            monitor.end(signal.SIGINT)

    return start


@pytest.fixture
def own_monitor(port, left_at_rest, start_monitor):
    """A monitor that the test may end."""
    with left_at_rest(port), start_monitor(port) as monitor:
        yield monitor


@pytest.fixture
def monitor(own_monitor):
    return own_monitor


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    with Chromium(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture(scope="module")
def lasting_monitor(start_monitor, session_board):
    with session_board.used(), start_monitor(session_board.port) as monitor:
        yield monitor


@pytest.fixture
def shared_monitor(lasting_monitor, left_at_rest, session_board):
    """A monitor that no test may end: starting one takes seconds."""
    with session_board.used(), left_at_rest(session_board.port) as values:
        # The monitor reads the parameters from time to time only.
        until(lambda: lasting_monitor.get("/values")[1] == values)
        with lasting_monitor.page() as frame:
            while "status" not in (one := frame()):
                pass
        traces = {name: one["status"][name] for name in ("channels", "rate_Hz")}
        yield lasting_monitor
        lasting_monitor.enter()
        lasting_monitor.post("/channels", traces)


@pytest.fixture
def page(browser, shared_monitor):
    """The page of that monitor, with an idle drive."""
    browser.events.clear()
    page = browser.open(shared_monitor.url)
    page.until("document.body.dataset.state === 'idle'")
    yield page
    page.close()
