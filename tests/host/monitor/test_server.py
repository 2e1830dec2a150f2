"""Which clients may use the server, and which requests it carries out."""

import base64
import json
import socket
import time

import numpy as np
import pytest
from waiting import WAIT_S, until

from hexatorque import firmware
from hexatorque.drive.limits import LIMITS
from hexatorque.monitor import server as module
from hexatorque.monitor.deadman import START_S
from hexatorque.monitor.traces import Ring
from hexatorque.recording.recording import Recording

COMMANDS = sorted(module.COMMANDS)
PATHS = [
    "/",
    "/monitor.js",
    "/device",
    "/values",
    "/snapshot",
    "/capture",
    "/captures",
    "/capture.csv",
    "/events?window_s=1&bins=100",
    "/history?begin_s=0&end_s=1&bins=100",
    "/span?begin_s=0&end_s=1",
]


# -- access -----------------------------------------------------------------------------


@pytest.mark.parametrize("cookie", ["", "{name}=", "{name}=guess", "{name}={token}"])
def test_without_a_cookie_every_request_is_refused(site, cookie):
    name = f"hexatorque-{site.server.port}"
    site.cookie = cookie.format(name=name, token=site.server.token)
    for path in PATHS:
        status, _, body = site.ask("GET", path)
        assert status == 403, path
        assert b"hexatorque board monitor" in body
    for path in COMMANDS:
        assert site.post(path, {})[0] == 403, path


def test_the_token_sets_a_cookie_that_scripts_and_other_sites_cannot_read(site):
    _, headers, _ = site.ask("GET", f"/?token={site.server.token}", Cookie="")
    assert headers["Location"] == "/"
    name, *flags = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} == set(flags)
    assert site.server.token not in name
    status, headers, body = site.ask("GET", "/", Cookie=name)
    assert status == 200 and b"<title>" in body
    policy = headers["Content-Security-Policy"]
    assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy and "http" not in policy


def test_a_wrong_token_is_refused(site):
    for token in ("", "x", site.server.token[:-1], site.server.token + "x", "%C3%A9"):
        status, headers, _ = site.ask("GET", f"/?token={token}", Cookie="")
        assert status == 403
        assert "Set-Cookie" not in headers


@pytest.mark.parametrize("host", ["", "evil.example", "evil.example:{port}", "127.0.0.1",
                                  "127.0.0.1:1", "192.168.0.1:{port}"])  # fmt: skip
def test_another_host_name_is_refused(site, host):
    host = host.format(port=site.server.port)
    assert site.ask("GET", f"/?token={site.server.token}", Host=host)[0] == 403
    assert site.ask("GET", "/values", Host=host)[0] == 403
    assert site.post("/stop", {}, Host=host, Origin=f"http://{host}")[0] == 403


@pytest.mark.parametrize(
    "origin", ["", "null", "http://evil.example", "https://127.0.0.1:{port}", "http://127.0.0.1:1"]
)
def test_a_command_from_another_site_is_not_carried_out(site, origin):
    origin = origin.format(port=site.server.port)
    before = site.monitored.drive.get("speed_ref_rpm")
    status, answer = site.post("/write", {"values": {"speed_ref_rpm": 77}}, Origin=origin)
    assert status == 403 and "site" in answer["error"]
    assert site.post("/start", {}, Origin=origin)[0] == 403
    assert site.monitored.drive.get("speed_ref_rpm") == before
    assert site.monitored.drive.state == "idle"


@pytest.mark.parametrize("where", ["cross-site", "same-site"])
def test_a_request_from_another_page_is_refused(site, where):
    for path in PATHS:
        assert site.ask("GET", path, Sec_Fetch_Site=where)[0] == 403, path
    assert site.ask("GET", "/", Sec_Fetch_Site="same-origin")[0] == 200


def test_only_this_computer_reaches_the_server(site):
    assert site.server.socket.getsockname()[0] == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", site.server.port), 2)


# -- commands ---------------------------------------------------------------------------


def test_a_command_is_a_post_of_json(site):
    mine = {"Origin": f"http://{site.host}", "Content_Type": "application/json"}
    for path in COMMANDS:
        assert site.get(path)[0] == 404, path
        for body in (b"", b"{", b"[]", b'"x"', b"null", b"\xff", b"[" * 50000):
            status, _, answer = site.ask("POST", path, body, **mine)
            assert status == 400 and json.loads(answer)["error"], (path, body[:9])
    for kind in ("", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        assert site.ask("POST", "/stop", b"{}", **mine | {"Content_Type": kind})[0] == 415
    for length in ("", "-1", "x", "99999999"):
        given = mine | {"Content_Length": length}
        assert site.ask("POST", "/stop", b"{}", **given)[0] == 413, length
    assert site.post("/nothing", {})[0] == 404
    assert site.get("/../monitored_drive.py")[0] == 404


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"nonsense": 1}, ["nonsense"]),
        ({"speed_ref_rpm": 61000}, ["speed_ref_rpm", "-60000 .. 60000"]),
        ({"speed_ref_rpm": "fast"}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": True}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": None}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": [1]}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": float("nan")}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": float("inf")}, ["speed_ref_rpm", "number"]),
        ({"speed_ref_rpm": 10**400}, ["speed_ref_rpm", "number"]),
        ({"scheme": "pwm"}, ["scheme", "dtc1", "ddr-ml"]),
        ({"scheme": 2}, ["scheme", "dtc1"]),
        ({}, ["values"]),
        ([], ["values"]),
    ],
)
def test_a_value_out_of_range_changes_nothing(site, values, words):
    before = site.monitored.drive.get_all()
    tried = {"rs_ohm": before["rs_ohm"] * 2, **values} if values else values
    status, answer = site.post("/write", {"values": tried})
    assert status == 400
    for word in words:
        assert word in answer["error"]
    assert "\n" not in answer["error"]
    assert site.monitored.drive.get_all() == before


def test_writing_several_values_returns_those_in_force(site):
    status, answer = site.post("/write", {"values": {"speed_ref_rpm": 100.1, "scheme": "fdr"}})
    assert status == 200
    assert answer["values"] == {"speed_ref_rpm": pytest.approx(100.1, rel=1e-6), "scheme": "fdr"}
    assert site.monitored.drive.get("scheme") == "fdr"
    end = time.monotonic() + WAIT_S
    while site.get("/values")[1]["scheme"] != "fdr":
        assert time.monotonic() < end


def test_the_interrupts_rate_changes_between_streams(site):
    """The board refuses a new rate while it streams. The traces continue at the new rate."""
    traced = site.monitored.traces.stream.channels
    assert site.post("/record/start", {"suffix": ".csv"})[0] == 200
    assert site.post("/write", {"values": {"f_isr_Hz": 8000.0}})[0] == 400
    assert site.post("/record/stop", {})[0] == 200
    status, answer = site.post("/write", {"values": {"f_isr_Hz": 8000.0, "rs_ohm": 1.5}})
    assert status == 200 and answer["values"] == {"f_isr_Hz": 8000.0, "rs_ohm": 1.5}
    assert site.monitored.traces.stream.channels == traced
    assert site.monitored.status()["f_isr_Hz"] == 8000
    assert site.monitored.traces.stream.rate_Hz == 2000
    with site.page() as frame:
        begun = frame()["status"]["time_s"]
        end = time.monotonic() + WAIT_S
        while frame().get("status", {}).get("time_s", begun) < begun + 0.2:
            assert time.monotonic() < end
    status, answer = site.post("/write", {"values": {"f_isr_Hz": 1e6}})
    assert status == 400 and "f_isr_Hz" in answer["error"]
    assert site.monitored.traces.stream.channels == traced


def test_a_change_by_another_client_shows(site):
    site.monitored.drive.set("torque_limit_Nm", 3.5)
    end = time.monotonic() + WAIT_S
    while site.get("/values")[1]["torque_limit_Nm"] != 3.5:
        assert time.monotonic() < end


def test_a_parameter_that_needs_the_gates_off_is_refused_while_the_drive_runs(site):
    with site.page():
        assert site.post("/start", {})[0] == 200
        site.until("run")
        status, answer = site.post("/write", {"values": {"dead_time_us": 1.0}})
        assert status == 409 and "dead_time_us" in answer["error"]
        status, answer = site.post("/start", {})
        assert status == 409 and "run" in answer["error"]
        assert site.post("/stop", {})[0] == 200
        site.until("idle")


def test_dictionary_is_the_boards(site):
    _, device = site.get("/device")
    assert [row["name"] for row in device["parameters"]] == list(site.monitored.drive.params)
    assert [(row["name"], row["unit"]) for row in device["channels"]] == [
        *site.monitored.drive.channels
    ]
    assert device["states"] == list(firmware.STATES)


def test_a_fault_is_shown_with_its_snapshot_and_cleared(site):
    with site.page() as frame:
        assert site.post("/start", {})[0] == 200
        site.until("run")
        number = site.monitored.snapshot_version
        assert site.post("/write", {"values": {"vdc_max_V": 200}})[0] == 200
        site.until("fault")
        end = time.monotonic() + WAIT_S
        while (status := frame().get("status", {})).get("snapshot", number) == number:
            assert time.monotonic() < end
        assert status["state"] == "fault" and status["faults"] == ["dc-link voltage too high"]
        _, snapshot = site.get("/snapshot")
        assert snapshot["faults"] == status["faults"]
        assert snapshot["vdc_V"] == pytest.approx(300, rel=0.02)
        assert site.post("/write", {"values": {"vdc_max_V": 400}})[0] == 200
        assert site.post("/clear", {})[0] == 200
        site.until("idle")


# -- traces -----------------------------------------------------------------------------


def floats(text: str, channels: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(channels, -1)


def names_of(site, count: int) -> list[str]:
    return [name for name, _ in site.monitored.drive.channels][:count]


def test_a_page_gets_the_envelope_of_the_ring(site):
    """The page gets all bins of the ring, unchanged."""
    assert site.post("/channels", {"channels": ["i_u1_A", "vdc_V"], "rate_Hz": 2500})[0] == 200
    got, frames = {}, 0
    with site.page(window_s=1, bins=125) as frame:
        while frames <= 30:
            bins = frame().get("bins")
            if not bins:
                continue
            frames += 1
            assert bins["width"] == 20 and bins["epoch"] == site.monitored.traces.epoch
            assert bins["dt_s"] == pytest.approx(20 / 2500)
            lo, hi = floats(bins["lo"], 2), floats(bins["hi"], 2)
            got |= {bins["first"] + i: (lo[:, i], hi[:, i]) for i in range(bins["count"])}
    numbers = sorted(got)[:-1]  # the last bin was not full
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    lo, hi = site.monitored.traces.ring.envelope(20, numbers[0], numbers[-1] + 1)
    np.testing.assert_array_equal(np.array([got[n][0] for n in numbers]).T, lo)
    np.testing.assert_array_equal(np.array([got[n][1] for n in numbers]).T, hi)
    assert lo[1, -1] == pytest.approx(300, rel=0.02)
    status, history = site.get(
        f"/history?begin_s={numbers[9] * 0.008}&end_s={numbers[-1] * 0.008}&bins=8000"
    )
    assert status == 200 and history["width"] == 1
    part = site.monitored.traces.ring.part(history["first"], history["first"] + history["count"])
    np.testing.assert_array_equal(floats(history["lo"], 2), part)


@pytest.mark.parametrize(
    "path",
    [
        "/events",
        "/events?window_s=1&bins=x",
        "/events?window_s=nan&bins=99",
        "/events?window_s=1e9&bins=99",
        "/events?window_s=1&bins=1e9",
        "/history?begin_s=0&end_s=1e9&bins=99",
        "/history?begin_s=5&end_s=1&bins=99",
        "/history?begin_s=-1&end_s=1&bins=99",
    ],
)
def test_a_window_out_of_range_is_refused(site, path):
    status, answer = site.get(path)
    assert status == 400 and answer["error"]


def test_a_slow_page_delays_nothing_else(site):
    """Another page and the line continue as before. At last the slow page is disconnected."""
    assert site.post("/channels", {"channels": names_of(site, 8), "rate_Hz": 2500})[0] == 200
    slow = socket.socket()
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    slow.connect(("127.0.0.1", site.server.port))
    request = f"GET /events?window_s=1&bins=8000 HTTP/1.1\r\nHost: {site.host}\r\n"
    slow.sendall(f"{request}Cookie: {site.cookie}\r\n\r\n".encode())
    with site.page(window_s=1, bins=100) as frame:
        frame()
        times_s, pages = [], [1]
        while max(pages) < 2 or pages[-1] == 2:
            one = frame()
            if "status" in one:
                times_s.append(one["status"]["time_s"])
                pages.append(one["status"]["pages"])
    slow.close()
    assert site.monitored.traces.stream.gaps == site.monitored.traces.stream.lost == 0
    # If one waited for the other, it would be as long as that is allowed to stall.
    assert max(np.diff(times_s)) < module.STALLED_S / 2


def test_channels_are_the_boards_and_their_rate_fits_the_line(site):
    for names, word in ([["nonsense"], "nonsense"], [["vdc_V", "vdc_V"], "twice"], ["x", "list"],
                        [[1], "names"]):  # fmt: skip
        status, answer = site.post("/channels", {"channels": names, "rate_Hz": 1000})
        assert status == 400 and word in answer["error"]
    for rate in (0, -1, 1e9, "x"):
        assert site.post("/channels", {"channels": ["vdc_V"], "rate_Hz": rate})[0] == 400
    assert len(site.monitored.traces.stream.channels) > 4  # the first choice is unchanged
    names = names_of(site, 12)
    assert site.post("/channels", {"channels": names, "rate_Hz": 10000})[0] == 200
    fits = site.monitored.traces.stream.decimation
    hello = site.monitored.drive.hello
    bytes_per_s = (12 + 4 * 12) * hello.f_isr_Hz
    assert fits == int(np.ceil(bytes_per_s / hello.budget))
    assert site.post("/channels", {"channels": [], "rate_Hz": None})[0] == 200
    with site.page() as frame:
        assert frame()["status"]["channels"] == []
    assert site.post("/channels", {"channels": ["vdc_V"], "rate_Hz": None})[0] == 200
    assert (
        site.monitored.traces.stream.decimation == 1
        or site.monitored.traces.stream.decimation
        == int(np.ceil(16 * hello.f_isr_Hz / hello.budget))
    )


def test_a_browser_keeps_a_connection_for_stop(site):
    """A browser opens at most six connections to a server, and each page keeps one open."""
    from contextlib import ExitStack

    with ExitStack() as pages:
        for _ in range(module.PAGES_OF_A_BROWSER):
            pages.enter_context(site.page())()
        with pytest.raises(AssertionError, match="pages open already"), site.page() as frame:
            frame()
        assert site.post("/stop", {})[0] == 200
        first = site.cookie
        site.enter()  # another browser
        assert site.cookie != first
        with site.page() as frame:
            frame()
    end = time.monotonic() + WAIT_S
    while any(site.server.browsers.values()):
        assert time.monotonic() < end
        time.sleep(0.02)


# -- nobody watches -----------------------------------------------------------------------


def test_the_drive_stops_when_the_last_page_has_gone(site, board):
    with site.page() as first:
        with site.page() as second:
            assert site.post("/start", {})[0] == 200
            site.until("run")
            second()
        for _ in range(50):  # two seconds with one open page
            first()
        assert site.monitored.status()["state"] == "run"
        begun_s = board.time_s
    site.until("idle")
    assert board.off_s(begun_s) - begun_s < 2.0
    assert site.monitored.status()["faults"] == []
    end = time.monotonic() + WAIT_S
    while "no page" not in site.monitored.status()["notice"]:
        assert time.monotonic() < end


#: Parameters that keep a drive for a while in each state in which its gates may be on.
HELD = {
    "calibrate": {"calibration_s": 1.0},
    "build": {"build_s": 10.0},
    "run": {},
    "test": {"start_mode": "test", "test_s": 60.0, "test_current_A": 10.0},
}


def test_every_state_with_gates_is_tried_below():
    assert set(HELD) == {state.name for state in firmware.STATE_TABLE if state.at_work}


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("state", HELD)
def test_a_silent_page_ends_every_state_with_gates(site, board, state, listed):
    """Also a state that the monitor does not know: of such a one it must expect the worst."""
    silent_s = 0.7
    assert START_S < silent_s < HELD["calibrate"]["calibration_s"]  # else little is tested
    site.monitored.dead_man.silent_s = silent_s
    drive = site.monitored.drive
    drive.set_many(HELD[state])
    if not listed:
        drive.client.states = ()
    assert site.post("/start", {})[0] == 200
    begun_s = board.time_s
    if state == "test":
        drive.set_many({"test_alpha_V": 5.0})
    assert site.monitored.status()["working"]
    end = time.monotonic() + WAIT_S
    while (off_s := board.off_s(begun_s)) is None:
        assert time.monotonic() < end, f"still in {site.monitored.status()['state']}"
        time.sleep(0.02)
    assert off_s - begun_s < 2.0
    assert drive.faults == []
    while "no page" not in site.monitored.status()["notice"]:
        assert time.monotonic() < end


def test_a_reload_of_the_page_does_not_stop_the_drive(site):
    with site.page():
        site.post("/start", {})
        site.until("run")
    time.sleep(0.3)
    with site.page():
        time.sleep(2 * site.monitored.dead_man.silent_s)
        assert site.monitored.status()["state"] == "run"
        assert site.post("/stop", {})[0] == 200


def test_a_drive_that_another_client_started_is_not_stopped(site):
    with site.page():
        site.post("/start", {})
        site.until("run")
        site.monitored.drive.stop()
        site.until("idle")
    time.sleep(1.0)  # until the monitor has forgotten its own start
    site.monitored.drive.start()
    site.until("run")
    time.sleep(2 * site.monitored.dead_man.silent_s)
    assert site.monitored.status()["state"] == "run"
    site.monitored.drive.stop()


def test_closing_stops_a_drive_that_was_started_here(site):
    site.monitored.dead_man.silent_s = site.monitored.dead_man.hidden_s = 100.0
    site.post("/start", {})
    site.until("run")
    site.monitored.close()
    assert site.monitored.drive.state == "idle"


def started(site) -> float:
    """Start the drive and wait until it runs. Returns the time before that."""
    begun = time.monotonic()
    assert site.post("/start", {})[0] == 200
    site.until("run")
    return begun


def notice(site, words: str) -> None:
    """Wait for a notice. It comes right after the stop."""
    end = time.monotonic() + WAIT_S
    while words not in site.monitored.status()["notice"]:
        assert time.monotonic() < end, site.monitored.status()["notice"]


def test_a_page_that_does_not_answer_does_not_keep_the_drive_running(site):
    """It receives everything, as the browser does for a page whose script hangs."""
    with site.page(answer=lambda sent_s: None):
        started(site)
        site.until("idle")
        notice(site, "no page answered")


def test_an_answer_counts_from_when_its_frame_was_sent(site):
    """An answer that a stopped browser sends late says nothing about the present."""
    first = []

    def late(sent_s):
        first.append(sent_s)
        return {"sent_s": first[0]}

    with site.page(answer=late):
        begun = started(site)
        site.until("idle")
        assert time.monotonic() - begun > site.monitored.dead_man.silent_s
        notice(site, "no page answered")


def test_an_answer_with_a_future_time_counts_from_now(site):
    with site.page(answer=lambda sent_s: None):
        started(site)
        beat = {"page": 1, "sent_s": time.monotonic() + 1e6, "visible": True}
        assert site.post("/beat", beat)[0] == 200
        site.until("idle")


@pytest.mark.parametrize(
    "body",
    [
        {"sent_s": "1"}, {"sent_s": None}, {"sent_s": float("nan")}, {"sent_s": 10**400},
        {"visible": 1}, {"visible": None}, {"page": "1"}, {"page": 1.5}, {"page": None},
    ],
)  # fmt: skip
def test_an_answer_with_wrong_fields_is_refused(site, body):
    status, answer = site.post("/beat", {"page": 1, "sent_s": 1.0, "visible": True} | body)
    assert status == 400 and answer["error"] and "\n" not in answer["error"]


def test_a_page_that_is_behind_gets_no_samples_until_it_has_caught_up(site):
    """Otherwise a slow browser would fall further and further behind, and so would its answers."""
    answers = [False]
    with site.page(answer=lambda sent_s: {"sent_s": sent_s} if answers[0] else None) as frame:
        end = time.monotonic() + WAIT_S
        while "bins" not in frame():  # at first it gets samples
            assert time.monotonic() < end
        behind = time.monotonic() + 1.0
        while time.monotonic() < behind:
            frame()
        news = [frame() for _ in range(8)]
        assert not any("bins" in one for one in news) and all("status" in one for one in news)
        answers[0] = True
        while "bins" not in (one := frame()):
            assert time.monotonic() < end
        assert one["bins"]["count"] * one["bins"]["dt_s"] > 0.5  # nothing is missing


def test_one_page_that_answers_is_enough(site):
    with site.page(answer=lambda sent_s: None), site.page() as frame:
        started(site)
        end = time.monotonic() + 2.5 * site.monitored.dead_man.silent_s
        while time.monotonic() < end:
            frame()
        assert site.monitored.status()["state"] == "run"


def test_hidden_pages_keep_the_drive_running_for_a_limited_time(site):
    def hidden(sent_s):
        return {"sent_s": sent_s, "visible": False}

    with site.page(answer=hidden) as frame:
        with site.page():
            started(site)
            end = time.monotonic() + 1.5 * site.monitored.dead_man.hidden_s
            while time.monotonic() < end:  # another page is visible
                shown = frame().get("status")
                assert shown is None or shown["stops_in_s"] is None
            assert shown is None or shown["state"] == "run"
        left = []
        end = time.monotonic() + WAIT_S
        while (shown := frame().get("status", {})).get("state") != "idle":
            assert time.monotonic() < end
            left.append(shown.get("stops_in_s"))
    left = [one for one in left if one is not None]
    assert left and left == sorted(left, reverse=True)
    assert 0 <= left[-1] < left[0] <= site.monitored.dead_man.hidden_s
    notice(site, "hidden")


# -- a reset of the board -----------------------------------------------------------------


def test_a_reset_of_the_board_is_shown(site, board):
    """The page shows it as text, as a gap in the traces, and by the parameters now in force."""
    initial = site.monitored.values["torque_limit_Nm"]
    assert site.post("/write", {"values": {"torque_limit_Nm": initial / 2}})[0] == 200
    status, recording = site.post("/record/start", {"suffix": ".csv"})
    assert status == 200
    with site.page() as frame:
        started(site)
        time.sleep(0.5)
        ring, before = site.monitored.traces.ring, site.monitored.status()
        assert before["reset"] == "" and before["resets"] == 0 and before["marks_s"] == []
        board.reset()
        end = time.monotonic() + WAIT_S
        while not (status := frame().get("status", {})).get("reset"):
            assert time.monotonic() < end
        assert "board was reset" in status["reset"] and "parameters: built-in." in status["reset"]
        assert status["reset"].endswith(" Cause: power-on.")
        while frame().get("status", {}).get("values", before["values"]) == before["values"]:
            assert time.monotonic() < end
        assert site.get("/values")[1]["torque_limit_Nm"] == initial
        # The traces continue after a gap with a mark. The board's time starts again from 0.
        while not (status := frame().get("status", {})).get("marks_s"):
            assert time.monotonic() < end
        assert site.monitored.traces.ring is ring
        mark = ring.marks[0]
        assert np.isnan(ring.part(mark - 20, mark + 20)).all()
        for first in (ring.begin, ring.end - 20):  # older samples are still there
            part = ring.part(first, first + 20)  # the idle drive has no value of the control's
            assert not np.isnan(part).all(axis=0).any()
        assert status["marks_s"] == [pytest.approx(mark / status["rate_Hz"])]
        assert status["time_s"] < before["time_s"]
        assert status["resets"] == 1 and status["state"] == "idle"
        # The reset ended the recording.
        assert status["record"] is None and "board reset" in status["notice"]
        assert Recording.load(recording["file"]).meta["ended"] == "board reset"
        assert site.post("/reset/seen", {})[0] == 200
        while frame().get("status", {"reset": "x"})["reset"]:
            assert time.monotonic() < end


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (0, "built-in"),
        (1, "saved"),
        (2, "built-in: the saved set is damaged"),
        (3, "built-in: the saved set is of another firmware or board"),
    ],
)
def test_after_a_reset_the_set_in_force_is_named(site, monkeypatch, number, words):
    """STATUS gives its number."""
    status = site.monitored.drive.client.get_status()

    monkeypatch.setattr(
        site.monitored.drive.client, "get_status", lambda: status._replace(set=number)
    )
    for call in site.monitored.drive.on_reset:
        call()
    end = time.monotonic() + WAIT_S
    while not (text := site.monitored.status()["reset"]):
        assert time.monotonic() < end
        time.sleep(0.01)
    assert text.startswith(f"The board was reset. Its parameters: {words}.")


# -- captures and recordings ----------------------------------------------------------------


def test_a_capture_has_the_samples_before_the_trigger(site, tmp_path):
    names = ["speed_rpm", "i_u1_A", "state"]
    order = {
        "channels": names,
        "samples": 600,
        "pre": 200,
        "prescaler": 2,
        "trigger": "rising:state:1.5",
    }
    assert site.get("/capture") == (200, None)
    assert site.get("/capture.csv")[0] == 400
    with site.page() as frame:
        assert site.post("/capture/arm", order)[0] == 200
        end = time.monotonic() + WAIT_S
        while "waiting" not in frame().get("status", {}).get("capture_state", ""):
            assert time.monotonic() < end
        assert site.post("/start", {})[0] == 200
        while site.monitored.status()["capture"] == 0:
            assert time.monotonic() < end, site.monitored.status()
            frame()
        assert site.post("/stop", {})[0] == 200
    _, capture = site.get("/capture")
    assert capture["channels"] == names and capture["count"] == 600
    assert capture["start_s"] == pytest.approx(-200 * capture["dt_s"])
    values = floats(capture["lo"], 3)
    state = values[2]
    assert (state[:200] < 1.5).all() and (state[200:] > 1.5).all()
    for suffix in (".csv", ".json", ".npz"):
        status, headers, body = site.ask("GET", f"/capture{suffix}")
        assert status == 200 and f"capture-1{suffix}" in headers["Content-Disposition"]
        (tmp_path / f"x{suffix}").write_bytes(body)
    loaded = Recording.load(tmp_path / "x.npz")
    np.testing.assert_array_equal(loaded["i_u1_A"], values[1])
    loaded = Recording.load(tmp_path / "x.csv")  # with its .json, as any other recording
    np.testing.assert_array_equal(loaded["i_u1_A"], values[1])
    assert loaded.units["i_u1_A"] == "A" and loaded.meta["trigger_s"] == 0.0
    (tmp_path / "x.json").unlink()  # alone: units and ticks are in the table itself
    table = Recording.load(tmp_path / "x.csv")
    np.testing.assert_allclose(table["i_u1_A"], values[1], rtol=1e-6)
    assert table.units == loaded.units and np.array_equal(table.ticks, loaded.ticks)


def test_the_triggers_channel_is_captured(site):
    """Otherwise nobody could see the level at the trigger."""
    names = ["vdc_V", "i_u1_A"]
    order = {"channels": names, "samples": 50, "pre": 10, "prescaler": 1}
    most = site.monitored.drive.hello.capture_channels
    for number, (channels, trigger, wanted) in enumerate((
        (names, "below:speed_rpm:1e5", [*names, "speed_rpm"]),
        (names, "below:vdc_V:1e5", names),
        (names_of(site, most), "below:state:9", names_of(site, most)),
    ), 1):  # fmt: skip
        assert (
            site.post("/capture/arm", order | {"channels": channels, "trigger": trigger})[0] == 200
        )
        end = time.monotonic() + WAIT_S
        while site.monitored.status()["capture"] < number:
            assert time.monotonic() < end, site.monitored.status()["capture_state"]
            time.sleep(0.02)
        assert site.get("/capture")[1]["channels"] == wanted
    full = order | {"channels": names_of(site, most), "trigger": "below:scheme:99"}
    assert "scheme" not in full["channels"]
    status, answer = site.post("/capture/arm", full)
    assert status == 400 and f"1 to {most}" in answer["error"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"samples": 0}, "samples"), ({"samples": 10**9}, "samples"), ({"samples": "x"}, "samples"),
        ({"samples": 1.5}, "samples"), ({"pre": 100}, "pre"), ({"pre": -1}, "pre"),
        ({"prescaler": 0}, "prescaler"), ({"prescaler": 10**30}, "prescaler"),
        ({"trigger": "nothing"}, "trigger"), ({"trigger": "rising:x:1"}, "x"),
        ({"trigger": "rising:vdc_V:1e300"}, "levels up to"), ({"trigger": 1}, "trigger"),
        ({"channels": []}, "channels"), ({"channels": ["nonsense"]}, "nonsense"),
    ],
)  # fmt: skip
def test_a_capture_out_of_range_is_refused(site, change, word):
    order = {"channels": ["vdc_V"], "samples": 100, "pre": 10, "prescaler": 1, "trigger": "manual"}
    status, answer = site.post("/capture/arm", order | change)
    assert status == 400 and word in answer["error"]


def test_captures_are_kept_up_to_a_number(site, monkeypatch):
    monkeypatch.setattr("hexatorque.monitor.captures.CAPTURES", 2)
    assert site.get("/captures") == (200, [])
    order = {"channels": ["vdc_V"], "pre": 0, "prescaler": 1, "trigger": "below:vdc_V:1e5"}
    for number, samples in ((1, 20), (2, 30), (3, 40)):
        assert site.post("/capture/arm", order | {"samples": samples})[0] == 200
        until(lambda number=number: site.monitored.status()["capture"] == number)
    kept = site.get("/captures")[1]
    assert [(one["number"], one["count"]) for one in kept] == [(2, 30), (3, 40)]
    assert {one["trigger"] for one in kept} == {"below:vdc_V:1e5"}
    trip_A = site.monitored.drive.get("i_trip_A")
    for number, count in ((2, 30), (3, 40)):
        one = site.get(f"/capture?number={number}")[1]
        assert (one["number"], one["count"]) == (number, count)
        assert one["values"]["i_trip_A"] == trip_A
        status, headers, body = site.ask("GET", f"/capture.csv?number={number}")
        assert status == 200 and f"capture-{number}.csv" in headers["Content-Disposition"]
        assert body.count(b"\n") == count + 1
    assert site.get("/capture")[1]["number"] == 3
    for path in ("/capture?number=1", "/capture.csv?number=1", "/capture?number=4"):
        status, answer = site.get(path)
        assert status == 400 and "2, 3" in answer["error"]
    assert site.get("/capture?number=x")[0] == 400
    # One that is larger than all that may be kept is kept alone.
    monkeypatch.setattr("hexatorque.monitor.captures.CAPTURES_VALUES", 45)
    assert site.post("/capture/arm", order | {"samples": 50})[0] == 200
    until(lambda: site.monitored.status()["capture"] == 4)
    assert [one["number"] for one in site.get("/captures")[1]] == [4]


def test_a_span_has_every_sample(site, monkeypatch):
    """Put there by hand: some are missing."""
    site.monitored.traces.select(["vdc_V", "speed_rpm"], 1000.0)
    stream = site.monitored.traces.stream
    rate_Hz = stream.rate_Hz
    ring = Ring(2, 5000)
    numbers = np.delete(np.arange(100, 4100), [50, 51])
    values = np.stack([numbers, -numbers], axis=1).astype(np.float32)
    ring.push(numbers, values)
    monkeypatch.setattr(site.monitored.traces, "present", lambda: (7, ring, stream))
    begin_s, end_s = 120 / rate_Hz, 2120 / rate_Hz
    status, span = site.get(f"/span?begin_s={begin_s!r}&end_s={end_s!r}")
    assert status == 200 and (span["epoch"], span["first"], span["count"]) == (7, 120, 2000)
    assert span["dt_s"] == 1 / rate_Hz
    found = floats(span["lo"], 2)
    wanted = np.arange(120, 2120, dtype=np.float32)
    wanted[[30, 31]] = np.nan
    np.testing.assert_array_equal(found, [wanted, -wanted])
    assert site.get(f"/span?begin_s={5000 / rate_Hz}&end_s={6000 / rate_Hz}")[1]["count"] == 0
    monkeypatch.setattr(module, "SPAN_VALUES", 3999)
    status, answer = site.get(f"/span?begin_s={begin_s!r}&end_s={end_s!r}")
    assert status == 400 and "4000 values" in answer["error"] and "3999" in answer["error"]
    assert site.get("/span?begin_s=0&end_s=1000")[0] == 400


def test_limits_are_those_of_the_table(site):
    device = site.get("/device")[1]
    rows = {one["parameter"]: one for one in device["limits"]}
    assert rows["i_trip_A"]["signs"] == [1, -1] and len(rows["i_trip_A"]["channels"]) == 6
    assert list(rows) == [limit.parameter for limit in LIMITS]


def test_a_capture_is_not_confused_with_the_one_before(site):
    order = {"channels": ["vdc_V"], "samples": 20, "pre": 0, "prescaler": 1}
    with site.page() as frame:
        for number in (1, 2, 3):
            assert site.post("/capture/arm", order | {"trigger": "fault"})[0] == 200
            end = time.monotonic() + 0.4
            while time.monotonic() < end:
                status = frame().get("status", {"capture": number - 1})
                assert status["capture"] == number - 1
            assert site.post("/capture/trigger", {})[0] == 200
            end = time.monotonic() + WAIT_S
            while frame().get("status", {}).get("capture") != number:
                assert time.monotonic() < end


def test_a_capture_can_be_cancelled(site):
    order = {"channels": ["vdc_V"], "samples": 100, "pre": 0, "prescaler": 1, "trigger": "fault"}
    site.post("/capture/arm", order)
    assert site.post("/capture/cancel", {})[0] == 200
    assert site.monitored.status()["capture_state"] == ""
    assert site.post("/capture/trigger", {})[0] == 409


def test_recording_of_the_traces(site):
    assert site.post("/record/stop", {})[0] == 400
    assert site.post("/record/start", {"suffix": ".exe"})[0] == 400
    assert site.post("/record/start", {"suffix": "/../x.csv"})[0] == 400
    status, answer = site.post("/record/start", {"suffix": ".npz"})
    assert status == 200
    assert site.post("/record/start", {"suffix": ".npz"})[0] == 400
    status, refused = site.post("/channels", {"channels": ["vdc_V"], "rate_Hz": None})
    assert status == 400 and "recording" in refused["error"]
    until(lambda: site.monitored.status()["record"]["rows"] > 1000)
    shown = site.monitored.status()["record"]
    assert shown["file"] == answer["file"]
    assert site.post("/record/stop", {})[1]["file"] == answer["file"]
    loaded = Recording.load(answer["file"])
    assert list(loaded.channels) == list(site.monitored.traces.stream.channels)
    assert loaded.rate_Hz == pytest.approx(site.monitored.traces.stream.rate_Hz)
    assert len(loaded) >= shown["rows"]
    assert np.isnan(loaded["vdc_V"]).sum() == loaded.meta["lost_samples"]  # none unless it is told
    assert loaded.meta["drops"] == 0
    assert site.post("/channels", {"channels": ["vdc_V"], "rate_Hz": None})[0] == 200
