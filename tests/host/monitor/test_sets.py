"""Sets of parameters on the monitor's server: files, comparisons, the board's memory."""

import tomllib

import pytest
from waiting import until

from hexatorque import firmware
from hexatorque.cli.main import main
from hexatorque.serial import sharing, wire
from hexatorque.serial.wire import Op


def test_the_file_is_the_one_that_the_commands_read(site, port, tmp_path, capsys):
    status, headers, body = site.ask("GET", "/parameters.toml")
    assert status == 200 and "virtual-f28377s-parameters.toml" in headers["Content-Disposition"]
    there = site.monitored.drive.get_all()
    assert tomllib.loads(body.decode())["parameters"] == there
    file = tmp_path / "of the page.toml"
    file.write_bytes(body)
    assert main(["board", "params", "diff", str(file), "--device", port]) == 0
    other = tmp_path / "of the command.toml"
    assert main(["board", "params", "save", str(other), "--device", port]) == 0
    assert other.read_bytes() == body
    status, answer = site.post("/parameters/read", {"file": other.name, "text": other.read_text()})
    assert (status, answer["values"]) == (200, there)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rs_ohm = 1.5\nrs_ohn = 2", ["'rs_ohn'", "did you mean 'rs_ohm'"]),
        ("rs_ohm = -1", ["rs_ohm = -1", "0 .. 1000 ohm"]),
        ("pole_pairs = 2.5", ["pole_pairs = 2.5", "1 .. 64", "whole"]),
        ("rs_ohm = 'two'", ["rs_ohm = 'two'", "number"]),
        ("rs_ohm = true", ["rs_ohm = True", "number"]),
        ("rs_ohm = nan", ["rs_ohm = nan", "0 .. 1000"]),
        ("rs_ohm = 1" + 400 * "0", ["rs_ohm = inf", "0 .. 1000"]),
        ("rs_ohm = 1979-05-27", ["rs_ohm", "number"]),
        ("scheme = 'ddt'", ["scheme = 'ddt'", "dtc1, "]),
        ("rs_ohm = ", ["not valid TOML", "line 2"]),
        ("rs_ohm = " + 5000 * "[", ["mine.toml"]),
        ("[machine]\nrs_ohm = 1", ["set-up", "--setup"]),
        ("[others]", ["[parameters]"]),
    ],
)
def test_a_file_that_the_board_cannot_take_is_one_line_that_says_why(site, text, words):
    before = site.monitored.drive.get_all()
    body = {"file": "mine.toml", "text": f"[parameters]\n{text}\n"}
    for path in ("/parameters/read", "/parameters/difference"):
        status, answer = site.post(path, body)
        assert status == 400 and "\n" not in answer["error"], answer
        for word in ("mine.toml", *words):
            assert word in answer["error"]
    assert site.monitored.drive.get_all() == before


def test_each_wrong_value_has_its_line(site):
    text = "[parameters]\nrs_ohm = -1\nscheme = 'fdr'\nlm_H = 1e9\n"
    status, answer = site.post("/parameters/read", {"file": "a.toml", "text": text})
    assert status == 400
    names = [line.split(" = ")[0] for line in answer["error"].splitlines()]
    assert names == ["a.toml: rs_ohm", "a.toml: lm_H"]


@pytest.mark.parametrize("body", [{}, {"file": 1, "text": ""}, {"file": "a.toml"}])
def test_a_request_without_a_file_is_refused(site, body):
    status, answer = site.post("/parameters/read", body)
    assert status == 400 and "needed" in answer["error"]


#: 0.1 is no float32 number: the board keeps another one, and this is no difference.
ON_THE_BOARD = {"rs_ohm": 0.1, "scheme": "fdr", "predict": "on"}
A_FILE = {
    "file": "a.toml",
    "text": "[parameters]\nrs_ohm = 0.1\nscheme = 'ddr'\npredict = true\nlm_H = 0.5\n",
}


def test_what_differs_from_a_file(site):
    drive = site.monitored.drive
    drive.set_many(ON_THE_BOARD)
    status, answer = site.post("/parameters/difference", A_FILE)
    assert (status, answer["compared"]) == (200, 4)
    lm_H = drive.get("lm_H")
    assert answer["differing"] == [
        {"name": "scheme", "board": "fdr", "other": "ddr", "unit": ""},
        {"name": "lm_H", "board": lm_H, "other": 0.5, "unit": "H"},
    ]
    # Writing what differs makes both the same.
    site.post("/write", {"values": {"scheme": "ddr", "lm_H": 0.5}})
    status, answer = site.post("/parameters/difference", A_FILE)
    assert answer["differing"] == []


def test_what_differs_from_the_defaults(site):
    drive = site.monitored.drive
    drive.set_many(ON_THE_BOARD)
    status, answer = site.post("/parameters/difference", {})
    assert status == 200
    rows, now = firmware.parameters(), drive.get_all()
    differing = {name for name, row in rows.items() if row.show(row.initial) != now[name]}
    assert answer["compared"] == len(rows)
    assert {row["name"] for row in answer["differing"]} == differing


def test_the_board_keeps_and_forgets_its_parameters_beside_the_traces(site, board):
    """The board writes its memory only while it streams nothing, and the page always streams."""
    drive = site.monitored.drive
    channels = site.monitored.status()["channels"]
    assert channels
    drive.set("rs_ohm", 3.25)
    assert site.post("/parameters/keep", {}) == (200, {})
    try:
        board.reset()
        until(lambda: "saved" in site.monitored.reset)
        until(lambda: site.monitored.values["rs_ohm"] == 3.25)
    finally:
        assert site.post("/parameters/forget", {}) == (200, {})
    board.reset()
    until(lambda: "built-in" in site.monitored.reset)
    assert site.monitored.status()["channels"] == channels


def test_a_board_that_writes_for_long_is_waited_for(site, board):
    """A flash takes seconds, in which the board answers nothing. Other requests are given up
    earlier."""
    client = site.monitored.drive.client
    others_s = sharing.PROCESS_TRIES * sharing.reply_s(1_250_000, wire.reply_bytes(Op.STATUS, 0))
    for path in ("/parameters/keep", "/parameters/forget"):
        board.write_slowly(1.5 * others_s)
        assert site.post(path, {}) == (200, {}) and not board.slow.exists()
    assert site.monitored.status()["channels"] and not client.broken


def test_a_drive_at_work_keeps_nothing(site):
    with site.page() as frame:
        frame()
        site.post("/start", {})
        site.until("run")
        status, answer = site.post("/parameters/keep", {})
        assert status == 409 and "stop the drive first" in answer["error"]
        assert site.monitored.status()["channels"] and site.monitored.working()
