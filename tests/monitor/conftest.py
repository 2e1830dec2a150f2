"""A virtual board in a process of its own, a desk and a server in this one, and a browser's
end of HTTP without a browser."""

import http.client
import json
import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

import hexatorque

HOST = Path(hexatorque.__file__).parents[1]


def hexatorque_process(*arguments: object) -> subprocess.Popen:
    environment = {**os.environ, "PYTHONPATH": str(HOST)}
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        environment.pop(name, None)
    return subprocess.Popen(
        [sys.executable, "-m", "hexatorque", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip


@pytest.fixture(scope="session", autouse=True)
def own_directories(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME"):
            folder = tmp_path_factory.mktemp(name)
            folder.chmod(0o700)
            patch.setenv(name, str(folder))
        yield


@pytest.fixture(scope="session")
def port(own_directories, tmp_path_factory) -> str:
    link = tmp_path_factory.mktemp("dev") / "ttyHT0"
    process = hexatorque_process("board", "--virtual", "--setup", "paper-b", "--link", link)
    try:
        assert str(link) in process.stdout.readline(), process.stderr.read()
        yield str(link)
    finally:
        process.terminate()
        process.communicate()


@pytest.fixture
def drive(port):
    """An idle drive with the parameters it had in the beginning."""
    from hexatorque.link.drive import Drive

    with Drive.open(port) as drive:
        before = drive.get_all()
        yield drive
        drive.stop()
        if drive.state == "fault":
            drive.clear()
        end = time.monotonic() + 10
        while drive.get_all() != before:
            drive.set_many(before)
            assert time.monotonic() < end


class Site:
    """A desk, its server, and a browser that has entered it."""

    def __init__(self, desk, server) -> None:
        self.desk, self.server = desk, server
        self.host = f"127.0.0.1:{server.port}"
        self.cookie = ""

    def ask(self, method: str, path: str, body: bytes | None = None, **headers: str):
        """Status, headers, body. Headers by name, underscores for dashes; "" leaves one out."""
        given = {"Host": self.host, "Cookie": self.cookie}
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=10)
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
        status, headers, _ = self.ask("GET", f"/?token={self.server.token}")
        assert status == 303
        self.cookie = headers["Set-Cookie"].partition(";")[0]

    def get(self, path: str):
        status, _, body = self.ask("GET", path)
        return status, json.loads(body)

    def post(self, path: str, data: object, **headers: str):
        """As the page does it."""
        mine = {"Origin": f"http://{self.host}", "Content_Type": "application/json"}
        status, _, body = self.ask("POST", path, json.dumps(data).encode(), **(mine | headers))
        return status, json.loads(body)

    @contextmanager
    def page(self, window_s: float = 2, bins: int = 500, cookie: str | None = None):
        """An open page's events: a function that gives the next frame."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=10)
        headers = {"Host": self.host, "Cookie": self.cookie if cookie is None else cookie}
        connection.request("GET", f"/events?window_s={window_s}&bins={bins}", headers=headers)
        answer = connection.getresponse()
        assert answer.status == 200, answer.read()

        def frame() -> dict:
            while True:
                line = answer.readline()
                assert line, "the stream has ended"
                if line.startswith(b"data: "):
                    return json.loads(line[6:])

        frame.connection = connection
        try:
            yield frame
        finally:
            answer.close()
            connection.close()

    def until(self, state: str, seconds: float = 10.0) -> float:
        """Wait for the drive's state; how long that took."""
        begun = time.monotonic()
        while self.desk.status()["state"] != state:
            assert time.monotonic() - begun < seconds, self.desk.status()
            time.sleep(0.01)
        return time.monotonic() - begun


@pytest.fixture
def site(drive, tmp_path):
    from hexatorque.monitor.desk import Desk
    from hexatorque.monitor.server import Server

    with Desk(drive, tmp_path / "recordings", alone_s=0.6) as desk, Server(desk) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        site = Site(desk, server)
        site.enter()
        yield site
        server.shutdown()
        thread.join()
