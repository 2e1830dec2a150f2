"""Parameters that survive power-off, as a client sees them: SAVE and FORGET, what STATUS says of
the set, when they are refused, and the file of a virtual board. What a power failure leaves is in
tests/c/test_store.c."""

import json
import os
import signal
import struct
import threading
import time
import zlib
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from device import (
    ARM,
    CANCEL,
    DONE,
    FORGET,
    SAVE,
    START,
    STATE,
    STATUS,
    STOP,
    STORE,
    Device,
)
from forked import Forked

from hexatorque import firmware, setups
from hexatorque.boards.store_file import HEAD, SIZE, FileStore
from hexatorque.boards.virtual import VirtualBoard
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.firmware import FirmwareError, MemoryStore
from hexatorque.serial import LinkError
from hexatorque.serial.wire import parse_status

KEPT = {"rs_ohm": 1.75, "dead_time_us": 3.0, "kp_speed_Nms_rad": 0.31}


def of(device):
    return parse_status(device.done(STATUS).payload).set


def again(device):
    """The same memory after a power-off."""
    return Device(store=MemoryStore(device.controller.store.areas))


@pytest.fixture
def device():
    return Device(store=MemoryStore())


def test_saved_parameters_survive_power_off(device):
    assert of(device) == 0
    assert device.write(**KEPT, speed_ref_rpm=250.0).status == DONE
    reply = device.done(SAVE)
    assert reply.payload == b"" and reply.state == "idle" and of(device) == 0
    later = again(device)
    assert of(later) == 1 and later.gates_off and later.state == "idle"
    for name, value in KEPT.items():
        assert later.value(name) == np.float32(value)
    assert later.value("speed_ref_rpm") == 0  # no drive sets off with yesterday's reference
    # What is set afterwards does not change what the start took, nor what is kept.
    later.write(rs_ohm=1.9)
    assert of(later) == 1
    assert again(later).value("rs_ohm") == 1.75
    later.done(FORGET)
    assert later.value("rs_ohm") == np.float32(1.9) and of(later) == 1
    forgotten = again(later)
    assert of(forgotten) == 0
    assert forgotten.value("rs_ohm") == np.float32(firmware.parameters()["rs_ohm"].initial)


def test_the_reason_for_refusing_a_saved_set_is_given(device):
    device.write(**KEPT)
    device.done(SAVE)
    areas = device.controller.store.areas
    good = bytes(areas)
    areas[20] ^= 4
    assert of(again(device)) == 1  # the other copy
    areas[MemoryStore.AREA + 50] ^= 1
    damaged = again(device)
    assert of(damaged) == 2 and damaged.controller.parameter_set.startswith("built-in")
    assert damaged.value("rs_ohm") == np.float32(firmware.parameters()["rs_ohm"].initial)
    # Another table: the same blocks under a version of their own, the CRC as it must be.
    blocks = 2 + -(-len(firmware.parameters()) // 4)
    for area in (0, MemoryStore.AREA):
        copy = bytearray(good[area : area + 16 * blocks])
        copy[8] ^= 1
        crc = zlib.crc32(copy[:-16])
        copy[-16:-8] = struct.pack("<II", crc, crc ^ 0xFFFFFFFF)
        areas[area : area + len(copy)] = copy
    foreign = again(device)
    assert of(foreign) == 3
    assert foreign.value("rs_ohm") == np.float32(firmware.parameters()["rs_ohm"].initial)


def test_saving_only_with_the_gates_off(device):
    device.done(START)
    seen = set()
    before = bytes(device.controller.store.areas)
    for _ in range(150):
        state = device.done(STATUS).state
        for op in (SAVE, FORGET):
            reply = device.ask(op)
            if reply.state != "idle":
                seen.add(reply.state)
                assert (reply.status, reply.payload) == (STATE, b"\xff\xff")
        if state == "run":
            break
    assert {"build", "run"} <= seen
    assert bytes(device.controller.store.areas) == before
    device.done(STOP)
    device.done(SAVE)


def test_no_saving_during_a_stream_or_capture(device):
    """On a chip the tick does not count while the flash is written, so nothing may depend on it."""
    device.stream(1, 10, "speed_rpm")
    assert device.ask(SAVE).status == STATE
    device.stream(1, 1)  # ends it
    device.done(ARM, "BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0)
    assert device.ask(FORGET).status == STATE
    device.done(CANCEL)
    device.done(SAVE)


def test_a_repetition_is_not_written_again(device):
    class Counting(MemoryStore):
        writes = 0

        def put(self, begin, raw):
            self.writes += 1
            return super().put(begin, raw)

    counting = Device(store=Counting())
    body = counting.request(SAVE)
    assert counting.answer(body).status == DONE
    writes = counting.controller.store.writes
    assert writes > 0
    assert counting.answer(body).status == DONE
    assert counting.controller.store.writes == writes


def test_no_memory_and_a_memory_that_fails():
    none = Device()
    for op in (SAVE, FORGET):
        reply = none.ask(op)
        assert (reply.status, reply.payload) == (STORE, b"\xff\xff")

    class Failing(MemoryStore):
        def put(self, begin, raw):
            return False

    failing = Device(store=Failing())
    for op in (SAVE, FORGET):
        reply = failing.ask(op)
        assert (reply.status, reply.payload) == (STORE, b"\x00\x00")


# --- the file of a virtual board ---------------------------------------------------------------


def virtual(file, **changes):
    setup = setups.load("paper-a-feasible").changed(timing__device="f28377s", **changes)
    return VirtualBoard(setup, store=file)


@pytest.fixture
def saved_file(tmp_path):
    """The file of a virtual board that has saved a resistance of 1.75 ohm."""
    file = tmp_path / "bench.store"
    with virtual(file) as first:
        assert first.controller.parameter_set == "built-in"
        assert file.stat().st_size == SIZE and file.read_bytes().startswith(HEAD)
        first.controller.set("rs_ohm", 1.75)
        store, drive = first.controller.store, first.controller.drive
        assert firmware.lib.ht_store_save(store.handle, drive) == firmware.lib.HT_OK
    return file


def test_a_virtual_board_takes_what_its_file_has(saved_file):
    with virtual(saved_file, controller__rs_ohm=1.5) as second:
        assert second.controller.parameter_set == "saved"
        assert second.controller.get("rs_ohm") == 1.75
        second.run(0.01)  # the plant runs beside it


def test_a_damaged_file_of_a_virtual_board_leaves_what_the_set_up_says(saved_file):
    raw = bytearray(saved_file.read_bytes())
    for at in range(40, SIZE, 97):
        raw[at] ^= 0x10
    saved_file.write_bytes(raw)
    with virtual(saved_file, controller__rs_ohm=1.5) as third:
        assert third.controller.parameter_set == "built-in: the saved set is damaged"
        assert third.controller.get("rs_ohm") == 1.5


def test_a_file_that_is_no_store(tmp_path):
    wrong = tmp_path / "notes.txt"
    wrong.write_text("something of value")
    with pytest.raises(FirmwareError, match=r"notes.txt: not a store of parameters"):
        FileStore(wrong)
    assert wrong.read_text() == "something of value"
    with pytest.raises(FirmwareError, match=r"missing/a.store: No such file"):
        FileStore(tmp_path / "missing" / "a.store")
    with pytest.raises(FirmwareError, match="Is a directory"):
        FileStore(tmp_path)
    one = FileStore(tmp_path / "a.store")
    with pytest.raises(FirmwareError, match=r"a.store: another board has it"):
        FileStore(tmp_path / "a.store")
    one.close()
    FileStore(tmp_path / "a.store").close()
    left = {p.name for p in tmp_path.iterdir() if not p.name.startswith("XDG_")}
    assert left == {"a.store", "notes.txt"}  # nothing of the making is left


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_file_that_cannot_be_written(tmp_path):
    file = tmp_path / "a.store"
    FileStore(file).close()
    file.chmod(0o400)
    with pytest.raises(FirmwareError, match=r"a.store: Permission denied"):
        FileStore(file)


def test_disk_that_is_full(tmp_path, capsys, monkeypatch):
    """The board says that it failed, and the file's name is on its standard error."""
    store = FileStore(tmp_path / "a.store")
    device = Device(store=store)
    full = SimpleNamespace(
        seek=lambda *_: 0, write=mock.Mock(side_effect=OSError(28, "No space left on device"))
    )
    with monkeypatch.context() as with_a_full_disk:
        with_a_full_disk.setattr(store, "_file", full)
        reply = device.ask(SAVE)
    store.close()
    assert (reply.status, reply.payload) == (STORE, b"\x00\x00")
    assert capsys.readouterr().err.strip() == f"hexatorque: {store.path}: No space left on device"


# --- the commands ----------------------------------------------------------------------------


def test_commands_on_a_board_without_a_store(board, capsys):
    """`board` is a fixture here: a process without --store."""
    for word in ("keep", "forget"):
        code = main(["board", "params", word, "--device", board])
        said = capsys.readouterr().err
        assert code == 1 and "built without a store" in said and len(said.splitlines()) == 1
    assert main(["board", "status", "--json", "--device", board]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"] == "built-in"


class Process:
    """`hexatorque board serve --store FILE`."""

    def __init__(self, file):
        self._process = Forked(["-m", "hexatorque", "board", "serve", "--json", "--store", file])
        self.said = json.loads(self._process.stdout.readline())
        self.port = self.said["port"]

    def kill(self):
        """The power fails."""
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        self._process.stdout.close()


@pytest.fixture
def power(tmp_path):
    boards = []

    def on():
        boards.append(Process(tmp_path / "bench.store"))
        return boards[-1]

    yield on
    for one in boards:
        one.kill()


def test_commands(power, capsys):
    first = power()
    assert first.said["parameters"] == "built-in"

    def call(one, *words):
        code = main(["board", *words, "--device", one.port])
        said = capsys.readouterr()
        assert code == 0, said.err
        return said.out

    call(first, "set", "rs_ohm=1.75")
    assert "kept" in call(first, "params", "keep")
    assert json.loads(call(first, "params", "keep", "--json")) == {"kept": True}
    first.kill()
    second = power()
    assert second.said["parameters"] == "saved"
    assert json.loads(call(second, "params", "get", "rs_ohm", "--json")) == {"rs_ohm": 1.75}
    assert "parameters  saved" in call(second, "status")
    assert "started with its parameters saved" in call(second, "params", "list")
    with BoardDrive.open(second.port) as drive:
        assert drive.parameter_set == "saved"
        with drive.stream(["speed_rpm"], rate_Hz=100):  # noqa: SIM117
            with pytest.raises(LinkError, match="not while the board streams or captures"):
                drive.store_parameters()
        drive.start()
        with pytest.raises(LinkError, match=r"stop the drive first \(state (calibrate|build|run)"):
            drive.store_parameters()
        drive.stop()
        drive.store_parameters()
    assert "forgotten" in call(second, "params", "forget")
    second.kill()
    third = power()
    assert third.said["parameters"] == "built-in"


def test_saving_while_another_client_is_connected(power):
    """The port server passes the request on, and waits as long as the write takes."""
    one = power()
    with BoardDrive.open(one.port), BoardDrive.open(one.port) as second:
        assert second.client.transport.shared
        second.set("rs_ohm", 1.8)
        second.store_parameters()
    one.kill()
    two = power()
    with BoardDrive.open(two.port) as drive:
        assert (drive.parameter_set, drive.get("rs_ohm")) == ("saved", 1.8)


def test_a_board_killed_while_it_writes(power):
    """Killed at any instant: the next start takes one of the saved sets, and all of it."""
    one = power()
    told = [1.0]
    with BoardDrive.open(one.port) as drive:
        drive.set_many({"rs_ohm": 1.0, "rr_ohm": 1.0})
        drive.store_parameters()
    for round in range(4):

        def write(port=one.port):
            try:
                with BoardDrive.open(port) as drive:
                    while True:
                        value = told[-1] + 0.125
                        drive.set_many({"rs_ohm": value, "rr_ohm": value})
                        told.append(value)
                        drive.store_parameters()
            except LinkError:
                pass  # the power has failed

        writer = threading.Thread(target=write)
        writer.start()
        time.sleep(0.3 + 0.05 * round)
        one.kill()
        writer.join()
        one = power()
        assert one.said["parameters"] == "saved"
        with BoardDrive.open(one.port) as drive:
            values = drive.get_many(["rs_ohm", "rr_ohm"])
        assert values["rs_ohm"] == values["rr_ohm"]
        assert values["rs_ohm"] in told[-2:]
        told.append(values["rs_ohm"])
