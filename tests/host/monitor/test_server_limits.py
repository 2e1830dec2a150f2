"""Requests that are too long or too many, and how far an upload is."""

import json
import socket
import threading

import pytest
from waiting import WAIT_S

from hexatorque.monitor.server import Server
from hexatorque.serial import LinkError


@pytest.mark.parametrize("length", ["9" * 5000, "²", "1_0", "+2"])
def test_a_length_that_is_none_is_answered(site, length):
    mine = {"Origin": f"http://{site.host}", "Content_Type": "application/json"}
    status, _, answer = site.ask("POST", "/stop", b"{}", **mine, Content_Length=length)
    assert status == 413 and "bytes" in json.loads(answer)["error"]


def test_many_connections_may_wait_to_be_accepted():
    """A refused one tries again after a second, and STOP may be among them."""
    with Server(None) as server:  # it accepts none
        waiting = []
        try:
            for _ in range(100):
                waiting.append(socket.create_connection(("127.0.0.1", server.port), 10))
        finally:
            for one in waiting:
                one.close()


def test_the_page_tells_how_far_an_upload_is(site, monkeypatch):
    """Until the capture is cancelled: then it tells nothing more of it."""
    drive, told, over = site.monitored.drive, [], threading.Event()

    def captured(timeout_s, uploaded):
        for share in (0.0, 0.4, 0.6):
            if share == 0.6:
                site.monitored.captures.cancel()
            uploaded(share)
            told.append(site.monitored.status()["capture_state"])
        over.set()
        raise LinkError("cancelled")

    monkeypatch.setattr(drive, "captured", captured)
    order = {"channels": ["vdc_V"], "samples": 10, "pre": 0, "prescaler": 1, "trigger": "command"}
    assert site.post("/capture/arm", order)[0] == 200
    assert site.post("/capture/trigger", {})[0] == 200
    assert over.wait(WAIT_S)
    assert told == ["uploading, 0%", "uploading, 40%", ""]


def test_an_upload_tells_its_share(drive):
    shares = []
    drive.arm(["vdc_V", "speed_rpm"], 8000, 0, "manual")
    drive.captured(WAIT_S, now=True, uploaded=shares.append)
    # A request brings 6000 values at most.
    assert len(shares) >= 3 and shares[0] == 0.0 and shares == sorted(shares) and shares[-1] < 1.0
