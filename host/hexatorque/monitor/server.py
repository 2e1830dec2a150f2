"""The monitor's web server: the files of `page/`, JSON requests, one stream of events per page.

Anybody who can use the page can turn the machine. Therefore:
- the server listens on 127.0.0.1 only;
- the address that is printed contains a token; the first page load sets it as a cookie, and
  every later request needs this cookie;
- a request must name this server as its host, so that no other name can be pointed here by
  DNS, and must not come from another site;
- commands are POSTs of JSON with this server's Origin.

The standard library's server is enough. A framework would replace the reading of requests only, a
few dozen lines, not these checks, and would be one more dependency.
"""

from __future__ import annotations

import base64
import json
import math
import re
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from .. import system
from ..commissioning.choices import CHOICES, refusal
from ..commissioning.excitation import CommissioningError
from ..commissioning.kinds import kind_of
from ..drive import parameter_sets
from ..drive.limits import LIMITS
from ..drive.parameter_sets import ParameterSetError
from ..firmware import FirmwareError
from ..recording.formats import RecordingError
from ..recording.recording import STARTED
from ..serial import LinkError
from .captures import Capture
from .monitored_drive import MonitoredDrive
from .traces import View

FRAME_S = 0.04
#: Interval at which a page gets the status.
STATUS_S = 0.1
#: A page that takes nothing for this long is disconnected. Its browser connects again.
STALLED_S = 4.0
#: Bytes buffered between server and page. A slow page gets at most this many outdated bytes.
SEND_BUFFER = 1 << 16
#: A browser opens at most six connections to a server. One must stay free for STOP.
PAGES_OF_A_BROWSER = 4
BODY_BYTES = 1 << 16
CAPTURE_FILES = ("/capture.csv", "/capture.json", "/capture.npz")
WINDOW_S = (0.01, 60.0)
#: Largest number of values of a span that a page analyses.
SPAN_VALUES = 1 << 21
BINS = (16, 8192)

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}


class Refused(Exception):
    """A refused request: an HTTP status and one line for the page."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class Server(ThreadingHTTPServer):
    daemon_threads = True
    #: Connections that wait to be accepted. With the usual 5 a STOP would wait for a second beside
    #: many that say nothing.
    request_queue_size = 512
    allow_reuse_address = system.PORTS_ARE_REUSED

    def __init__(self, monitored: MonitoredDrive, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), Handler)
        self.monitored = monitored
        self.token = secrets.token_urlsafe(24)
        self.closing = threading.Event()
        #: Cookie of each browser -> the number of pages that it has open.
        self.browsers: dict[str, int] = {}
        self.browsers_lock = threading.Lock()
        self.page = dict(_files(resources.files(__package__) / "page"))

    @property
    def port(self) -> int:
        return self.server_address[1]

    @property
    def url(self) -> str:
        """The address for the browser. Anybody who knows it can command the drive."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def hosts(self) -> tuple[str, str]:
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stay silent when a browser has disconnected: that is no error."""
        import sys

        if not isinstance(sys.exception(), (OSError, ValueError)):
            super().handle_error(request, client_address)

    def shutdown(self) -> None:
        self.closing.set()
        super().shutdown()


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server
    server_version, sys_version = "hexatorque", ""
    timeout = 60.0

    def log_message(self, *_: object) -> None:
        pass

    # -- who may ask ---------------------------------------------------------------------

    def _browser(self) -> str:
        """The cookie of the request. Refused if the request comes from elsewhere or has none."""
        if self.headers.get("Host") not in self.server.hosts:
            raise Refused(403, "this address is not the monitor's")
        if self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise Refused(403, "from another site")
        try:
            cookies = SimpleCookie(self.headers.get("Cookie", ""))
        except CookieError:
            cookies = SimpleCookie()
        cookie = cookies.get(self._cookie_name)
        given = cookie.value if cookie else ""
        with self.server.browsers_lock:
            if given not in self.server.browsers:
                raise Refused(403, "open the address that `hexatorque board monitor` printed")
        return given

    @property
    def _cookie_name(self) -> str:
        # The port is in the name, because browsers send a cookie to every port of a host, and
        # another monitor may run on this computer.
        return f"hexatorque-{self.server.port}"

    def _enter(self, token: str) -> None:
        """Answer the first page load: check the token and set the cookie."""
        if self.headers.get("Host") not in self.server.hosts:
            raise Refused(403, "this address is not the monitor's")
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            raise Refused(403, "not the token of this monitor: it was printed when it started")
        cookie = secrets.token_urlsafe(24)
        with self.server.browsers_lock:
            self.server.browsers[cookie] = 0
        self.send_response(303)
        self.send_header("Location", "/")
        self.send_header(
            "Set-Cookie", f"{self._cookie_name}={cookie}; Path=/; HttpOnly; SameSite=Strict"
        )
        self.send_header("Content-Length", "0")
        self._end()

    # -- answers -------------------------------------------------------------------------

    def _end(self) -> None:
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.end_headers()

    def _send(self, body: bytes, kind: str, status: int = 200, name: str = "") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        if name:
            self.send_header("Content-Disposition", f'attachment; filename="{name}"')
        if status >= 400:  # the rest of the request is not read
            self.send_header("Connection", "close")
            self.close_connection = True
        self._end()
        self.wfile.write(body)

    def _json(self, data: object, status: int = 200) -> None:
        self._send(json.dumps(_finite(data)).encode(), "application/json", status)

    def _answer(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Refused as error:
            self._json({"error": str(error)}, error.status)
        except LinkError as error:
            self._json({"error": str(error)}, 400 if error.mistake else 409)
        except (FirmwareError, ParameterSetError, RecordingError) as error:
            self._json({"error": str(error)}, 400)
        except OverflowError:
            self._json({"error": "a number is too large"}, 400)

    def do_GET(self) -> None:
        self._answer(self._get)

    def do_POST(self) -> None:
        self._answer(self._post)

    def _get(self) -> None:
        url = urlsplit(self.path)
        query = {name: values[-1] for name, values in parse_qs(url.query).items()}
        if url.path == "/" and "token" in query:
            return self._enter(query["token"])
        browser = self._browser()
        monitored = self.server.monitored
        if found := self.server.page.get("/index.html" if url.path == "/" else url.path):
            kind, body = found
            self._send(body, kind)
        elif url.path == "/device":
            self._json(monitored.device())
        elif url.path == "/values":
            self._json(monitored.values)
        elif url.path == "/snapshot":
            self._json(monitored.snapshot)
        elif url.path == "/log":
            self._json(monitored.log())
        elif url.path == "/history":
            self._history(query)
        elif url.path == "/capture":
            self._json(_capture(_chosen(monitored, query)) if monitored.captures.kept else None)
        elif url.path == "/captures":
            self._json([_described(one) for one in list(monitored.captures.kept.values())])
        elif url.path == "/commissioning":
            self._json(monitored.guided.described() if monitored.guided else None)
        elif url.path == "/commissioned.toml":
            text = monitored.commissioned().setup_text()
            self._send(text.encode(), "application/octet-stream", name="commissioned.toml")
        elif url.path == "/parameters.toml":
            text = parameter_sets.text_of(monitored.drive)
            name = f"{monitored.drive.hello.device.replace(' ', '-')}-parameters.toml"
            self._send(text.encode(), "application/octet-stream", name=name)
        elif url.path in CAPTURE_FILES:
            suffix = url.path.removeprefix("/capture")
            capture = _chosen(monitored, query)
            name = f"capture-{capture.number}{suffix}"
            self._send(capture.file(suffix), "application/octet-stream", name=name)
        elif url.path == "/span":
            self._span(query)
        elif url.path == "/events":
            self._events(browser, query)
        else:
            raise Refused(404, f"no {url.path}")

    def _post(self) -> None:
        self._browser()
        origin = self.headers.get("Origin")
        if origin != f"http://{self.headers['Host']}":
            raise Refused(403, "from another site")
        if self.headers.get_content_type() != "application/json":
            raise Refused(415, "JSON is needed")
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch(r"[0-9]{1,9}", length) or int(length) > BODY_BYTES:
            raise Refused(413, f"up to {BODY_BYTES} bytes")
        try:
            body = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise Refused(400, "not JSON") from None
        command = COMMANDS.get(urlsplit(self.path).path)
        if command is None:
            raise Refused(404, f"no {self.path}")
        if not isinstance(body, dict):
            raise Refused(400, "a JSON object is needed")
        self._json(command(self.server.monitored, body) or {})

    # -- traces --------------------------------------------------------------------------

    def _history(self, query: dict[str, str]) -> None:
        """Send the envelope of a part of the history, in the requested number of bins."""
        begin = _number(query, "begin_s", 0.0, 1e12)
        end = _number(query, "end_s", begin, begin + WINDOW_S[1] + 1)
        bins = round(_number(query, "bins", *BINS))
        found = self.server.monitored.traces.present()
        if found is None:
            raise Refused(409, "nothing is traced")
        epoch, ring, stream = found
        samples = (end - begin) * stream.rate_Hz
        width = max(1, round(samples / bins))
        first = int(begin * stream.rate_Hz) // width
        last = min(int(end * stream.rate_Hz), ring.end) // width + 1
        count = max(0, last - first)
        lo, hi = ring.envelope(width, first, first + count)
        self._json(_bins(epoch, stream.rate_Hz, width, first, lo, hi))

    def _span(self, query: dict[str, str]) -> None:
        """Send all samples of a part of the history, those from `begin_s` to before `end_s`."""
        begin = _number(query, "begin_s", 0.0, 1e12)
        end = _number(query, "end_s", begin, begin + WINDOW_S[1] + 1)
        found = self.server.monitored.traces.present()
        if found is None:
            raise Refused(409, "nothing is traced")
        epoch, ring, stream = found
        first = math.ceil(begin * stream.rate_Hz - 1e-6)
        last = min(math.ceil(end * stream.rate_Hz - 1e-6), ring.end)
        values = max(0, last - first) * len(stream.channels)
        if values > SPAN_VALUES:
            raise Refused(
                400, f"the span has {values} values: up to {SPAN_VALUES} are analysed at once"
            )
        part = ring.part(first, max(first, last))
        self._json(_bins(epoch, stream.rate_Hz, 1, first, part, part))

    def _events(self, browser: str, query: dict[str, str]) -> None:
        window_s = _number(query, "window_s", *WINDOW_S)
        bins = round(_number(query, "bins", *BINS))
        with self.server.browsers_lock:
            if self.server.browsers[browser] >= PAGES_OF_A_BROWSER:
                raise Refused(409, f"this browser has {PAGES_OF_A_BROWSER} pages open already")
            self.server.browsers[browser] += 1
        page = self.server.monitored.add_page()
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            self.connection.settimeout(STALLED_S)
            self.close_connection = True
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("Connection", "close")
            self._end()
            self._frames(page, window_s, bins)
        finally:
            self.server.monitored.remove_page(page)
            with self.server.browsers_lock:
                self.server.browsers[browser] -= 1

    def _frames(self, page: int, window_s: float, bins: int) -> None:
        """Send frames until the page disconnects. A slow page misses the samples in between."""
        monitored = self.server.monitored
        epoch: int | None = None
        view: View | None = None
        sent_s = 0.0
        self.wfile.write(b"retry: 500\n\n")
        while not self.server.closing.is_set():
            begun_s = time.monotonic()
            frame: dict[str, Any] = {}
            found = monitored.traces.present()
            if found and found[0] != epoch:
                epoch, ring, stream = found
                rate_Hz = stream.rate_Hz
                view = View(ring, rate_Hz, window_s, bins)
            if found and view and not monitored.page_is_behind(page) and (news := view.news()):
                frame["bins"] = _bins(found[0], rate_Hz, view.width, *news)
            if begun_s - sent_s >= STATUS_S:
                sent_s = begun_s
                frame["status"] = monitored.status()
                frame["page"], frame["sent_s"] = page, begun_s
                newest = monitored.traces.newest()
                if newest is not None and len(newest) == len(frame["status"]["channels"]):
                    frame["newest"] = [float(f"{value:.6g}") for value in newest]
                    frame["mean"] = [float(f"{value:.6g}") for value in monitored.traces.mean()]
            if frame:
                text = json.dumps(_finite(frame), separators=(",", ":"))
                self.wfile.write(b"data: " + text.encode() + b"\n\n")
            self.server.closing.wait(max(0.0, begun_s + FRAME_S - time.monotonic()))


def _files(folder: Traversable, path: str = "/") -> Iterator[tuple[str, tuple[str, bytes]]]:
    """The files that a browser may load, by their paths: types and contents."""
    for entry in folder.iterdir():
        suffix = entry.name[entry.name.rfind(".") :]
        if entry.is_dir():
            yield from _files(entry, f"{path}{entry.name}/")
        elif suffix in TYPES:
            yield path + entry.name, (TYPES[suffix], entry.read_bytes())


def _bins(
    epoch: int, rate_Hz: float, width: int, first: int, lo: np.ndarray, hi: np.ndarray
) -> dict:
    """An envelope as JSON: bins of `width` samples; `first` is the number of the first bin; `lo`
    and `hi` are float32 in base64, channel by channel."""
    return {
        "epoch": epoch, "dt_s": width / rate_Hz, "width": width, "first": first,
        "count": lo.shape[1], "lo": _floats(lo), "hi": "" if hi is lo else _floats(hi),
    }  # fmt: skip


def _floats(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode()


def _chosen(monitored: MonitoredDrive, query: dict[str, str]) -> Capture:
    """The capture whose number the query tells, or the latest."""
    if "number" not in query:
        return monitored.captures.get()
    return monitored.captures.get(round(_number(query, "number", 1, 1e9)))


def _described(capture: Capture) -> dict:
    """A capture without its samples. The trigger is at time 0. `values`: of the parameters that are
    limits, when it was taken."""
    recording = capture.recording
    meta = recording.meta
    values = meta["parameters"]["controller"]
    return {
        "number": capture.number, "trigger": capture.trigger, "taken": meta[STARTED],
        "channels": list(recording.channels), "start_s": recording.start_s,
        "count": len(recording), "dt_s": 1 / recording.rate_Hz,
        "values": {one.parameter: values.get(one.parameter) for one in LIMITS},
        "meta": {key: meta[key] for key in ("trigger_tick", "scheme", "state", "faults")},
    }  # fmt: skip


def _capture(capture: Capture) -> dict:
    """A capture with all its samples, as JSON."""
    recording = capture.recording
    table = np.array([recording[name] for name in recording.channels], np.float32)
    return {**_described(capture), **_bins(0, recording.rate_Hz, 1, 0, table, table)}


def _finite(data: object) -> object:
    """The data with None for NaN and infinity, which JSON does not have."""
    if isinstance(data, float):
        return data if abs(data) < float("inf") else None
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return data


# -- requests of the page: each is checked before it is carried out ----------------------


def _number(query: dict[str, str], name: str, low: float, high: float) -> float:
    try:
        value = float(query[name])
    except (KeyError, ValueError):
        raise Refused(400, f"{name}: a number is needed") from None
    if not low <= value <= high:
        raise Refused(400, f"{name} = {value:g}: allowed range is {low:g} .. {high:g}")
    return value


def _field(body: dict, name: str, kind: type | tuple[type, ...], words: str) -> Any:
    value = body.get(name)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise Refused(400, f"{name}: {words} is needed")
    return value


def _names(body: dict) -> list[str]:
    names = _field(body, "channels", list, "a list of channels")
    if not all(isinstance(name, str) for name in names):
        raise Refused(400, "channels: a list of names is needed")
    return names


def _write(monitored: MonitoredDrive, body: dict) -> dict:
    values = _field(body, "values", dict, "an object of values")
    if not values:
        raise Refused(400, "values: nothing to write")
    return {"values": monitored.write(values)}


def _file(monitored: MonitoredDrive, body: dict) -> dict[str, str | float]:
    """The values of a file that the page has read."""
    text = _field(body, "text", str, "a text")
    return monitored.read_set(text, _field(body, "file", str, "a name"))


def _difference(monitored: MonitoredDrive, body: dict) -> dict:
    """The differences from a file; without one, from the defaults."""
    rows = monitored.drive.params
    others = _file(monitored, body) if "file" in body else parameter_sets.defaults(rows)
    differing = [
        {"name": name, "board": board, "other": other, "unit": rows[name].unit}
        for name, (board, other) in monitored.difference(others).items()
    ]
    return {"compared": len(others), "differing": differing}


def _commission(monitored: MonitoredDrive, body: dict) -> None:
    """Begin a commissioning. Fields that the body lacks follow from the drive's parameters."""
    steps = _field(body, "steps", list, "a list of steps")
    try:
        steps = kind_of(monitored.drive).with_needs(steps)
    except CommissioningError as error:
        raise Refused(400, f"steps: {error}") from None
    if not steps:
        raise Refused(400, "steps: choose one at least")
    choices = {name: choice.initial for name, choice in CHOICES.items()}
    given = {
        name: float(_field(body, name, (int, float), "a number"))
        for name in ("current", *CHOICES)
        if body.get(name) is not None
    }
    current_A = given.pop("current", None)
    for name, value in given.items():
        if line := refusal(name, value):
            raise Refused(400, line)
    monitored.commission(steps, current_A, choices | given)


def _go_on(monitored: MonitoredDrive, body: dict) -> None:
    monitored.go_on(_field(body, "step", str, "a step"), body.get("run_on") is True)


def _select(monitored: MonitoredDrive, body: dict) -> dict:
    rate_Hz = body.get("rate_Hz")
    if rate_Hz is not None:
        rate_Hz = float(_field(body, "rate_Hz", (int, float), "a number"))
    names = _names(body)
    monitored.traces.select(names, rate_Hz)
    return {"channels": names}


def _arm(monitored: MonitoredDrive, body: dict) -> None:
    numbers = [
        _field(body, name, int, "a whole number") for name in ("samples", "pre", "prescaler")
    ]
    samples, pre, prescaler = numbers
    monitored.arm(_names(body), samples, pre, _field(body, "trigger", str, "a text"), prescaler)


def _beat(monitored: MonitoredDrive, body: dict) -> None:
    """A page's script answers a frame (`MonitoredDrive.page_answered`)."""
    page = _field(body, "page", int, "a whole number")
    sent_s = float(_field(body, "sent_s", (int, float), "a number"))
    if not math.isfinite(sent_s):
        raise Refused(400, "sent_s: a finite number is needed")
    visible = body.get("visible")
    if not isinstance(visible, bool):
        raise Refused(400, "visible: true or false is needed")
    monitored.page_answered(page, sent_s, visible)


def _record(monitored: MonitoredDrive, body: dict) -> dict:
    return {"file": str(monitored.traces.record_start(_field(body, "suffix", str, "a text")))}


COMMANDS: dict[str, Callable[[MonitoredDrive, dict], dict | None]] = {
    "/start": lambda monitored, _: monitored.start(),
    "/stop": lambda monitored, _: monitored.stop(),
    "/clear": lambda monitored, _: monitored.clear(),
    "/beat": _beat,
    "/reset/seen": lambda monitored, _: monitored.reset_seen(),
    "/write": _write,
    "/parameters/read": lambda monitored, body: {"values": _file(monitored, body)},
    "/parameters/difference": _difference,
    "/parameters/keep": lambda monitored, _: monitored.keep(),
    "/parameters/forget": lambda monitored, _: monitored.forget(),
    "/commission/begin": _commission,
    "/commission/go": _go_on,
    "/commission/write": lambda monitored, _: monitored.commissioned().write(),
    "/channels": _select,
    "/capture/arm": _arm,
    "/capture/trigger": lambda monitored, _: monitored.captures.trigger(),
    "/capture/cancel": lambda monitored, _: monitored.captures.cancel(),
    "/record/start": _record,
    "/record/stop": lambda monitored, _: {"file": str(monitored.traces.record_stop())},
}
