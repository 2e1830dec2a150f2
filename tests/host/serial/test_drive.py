"""The client with the firmware's own service, in a virtual board that is another process."""

import os
import re
import signal
import time

import numpy as np
import pytest
from board_process import CHANGES, LOAD_NM, Process
from forked import Forked
from waiting import WAIT_S, until

from hexatorque import setups
from hexatorque.drive.board import BoardDrive
from hexatorque.drive.interface import DriveFault, DriveVerbs
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import InputError
from hexatorque.recording.recording import Recording
from hexatorque.serial import LinkError, wire
from hexatorque.serial.exchange import Busy
from hexatorque.serial.wire import Op
from hexatorque.setups import Profile, SetupError


@pytest.fixture
def drive(board):
    with BoardDrive.open(board) as drive:
        yield drive


def test_the_dictionary_is_the_firmwares(drive):
    """The table in the image, read over the line, equals the one compiled into this process."""
    from hexatorque import firmware

    assert drive.params == firmware.parameters("f28377s")
    assert drive.channels == firmware.channels()
    assert drive.dictionary.states == firmware.STATE_TABLE
    assert {row.bit: row.name for row in drive.dictionary.faults} == firmware.FAULTS
    assert drive.hello.watchdog_ms == 250 and drive.hello.device == "virtual f28377s"


def test_a_board_takes_keys_and_text_as_a_simulated_drive_does(drive):
    drive.set_many({"controller.scheme": "FDR", "rs_ohm": "1,75"})
    assert drive.get("controller.rs_ohm") == 1.75 and drive.get("scheme") == "fdr"
    drive.set("scheme", "ddr")


@pytest.mark.parametrize(
    ("name", "value"),
    [("sped_ref_rpm", 1), ("machine.rs_ohm", 1), ("rs_ohm", "much"), ("scheme", "dtc9"),
     ("rs_ohm", -1)],
)  # fmt: skip
def test_a_board_refuses_keys_and_text_as_a_simulated_drive_does(drive, name, value):
    said = []
    for one in (drive, SimulatedDrive(setups.load("paper-b"))):
        with pytest.raises(InputError) as caught:
            one.set(name, value)
        said.append(str(caught.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("duration_s", (-1, float("nan")))
def test_a_board_does_not_run_for_less_than_no_time(drive, duration_s):
    with pytest.raises(InputError, match="a time of 0 s or more"):
        drive.run(duration_s)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 1001.0])
def test_the_board_itself_refuses_values_out_of_range(drive, value):
    """Without the client's own check."""
    row = drive.params["rs_ohm"]
    before = drive.get("rs_ohm")
    payload = np.array([(0, 2.0), (row.id, value)], [("id", "<u2"), ("value", "<f4")]).tobytes()
    reply = drive.client.ask(Op.WRITE, payload)
    assert (reply.status, reply.payload) == (wire.Status.VALUE, row.id.to_bytes(2, "little"))
    assert drive.get("rs_ohm") == before and drive.get("scheme") == "ddr"


def test_many_are_set_together_or_not_at_all(drive):
    drive.set_many({"torque_band_Nm": 0.6, "torque_inner_Nm": 0.3, "scheme": "dtc3"})
    assert drive.get_many(["torque_band_Nm", "scheme"]) == {"torque_band_Nm": 0.6, "scheme": "dtc3"}
    with pytest.raises(LinkError, match="do not fit together"):
        drive.set_many({"scheme": "fdr", "torque_inner_Nm": 0.7})  # beyond the outer band
    assert drive.get_many(["torque_inner_Nm", "scheme"]) == {
        "torque_inner_Nm": 0.3,
        "scheme": "dtc3",
    }
    drive.set_many({"torque_band_Nm": 0.5, "torque_inner_Nm": 0.289, "scheme": "ddr"})


def test_a_stale_dictionary_is_refused(drive):
    good = drive.client.dictionary
    drive.client.dictionary ^= 1
    with pytest.raises(LinkError, match="dictionary has changed"):
        drive.set("rs_ohm", 1.0)
    drive.client.dictionary = good
    drive.set("rs_ohm", 1.8)


def script(drive: DriveVerbs) -> Recording:
    """A test bench's script, for any drive."""
    with drive:
        assert drive.state == "idle" and drive.faults == []
        drive.set_many({"scheme": "ddr", "speed_ref_rpm": 0.0})
        drive.set("rs_ohm", 1.8)
        drive.run(0.05, record=False)
        drive.arm(["state", "speed_rpm"], 100, 20, "above:state:2")
        drive.start()
        drive.run(0.4)
        assert drive.state == "run"
        captured = drive.captured(1.0)
        assert captured["state"][19:21].tolist() == [2, 3] and captured.rate_Hz == 10000
        drive.run_profile(Profile(duration_s=0.8, speed_rpm=((0.1, 200.0),)))
        drive.check()
        recording = drive.take()
        drive.stop()
        drive.run(0.02, record=False)
        assert drive.state == "idle" and drive.get("scheme") == "ddr"
        assert drive.params["rs_ohm"].unit == "ohm" and ("speed_rpm", "r/min") in drive.channels
    return recording


def test_one_script_for_simulation_and_board(board):
    simulation = SimulatedDrive(setups.load("paper-a-feasible").changed(**CHANGES))
    simulation.set("load_Nm", LOAD_NM)
    simulated = script(simulation)
    measured = script(BoardDrive.open(board))
    assert measured.duration_s > 1.1
    for recording in (simulated, measured):
        assert recording.meta["scheme"] == "ddr" and recording.meta["faults"] == []
    # Both still on their way to 200 r/min; the real one by a clock that others share.
    ends = [np.mean(r["speed_rpm"][int(-0.1 * r.rate_Hz) :]) for r in (simulated, measured)]
    assert 150 < ends[0] < 200 and 100 < ends[1] < 210
    meta = measured.meta
    assert (meta["gaps"], meta["lost_samples"], meta["crc_errors"]) == (0, 0, 0)
    assert meta["parameters"]["controller"]["speed_ref_rpm"] == 200
    assert meta["device"] == "virtual f28377s" and len(meta["dictionary"]) == 8


def test_a_profile_asks_the_operator_for_what_a_board_cannot(board):
    asked = []
    profile = Profile(duration_s=0.5, load_Nm=((0.2, 1.5),))
    with BoardDrive.open(board) as drive:
        with pytest.raises(LinkError, match="load_Nm: a board cannot set this"):
            drive.run_profile(profile)
        assert drive.state == "idle"  # refused before the start
    with BoardDrive.open(board, operator=lambda *what: asked.append(what)) as drive:
        drive.run_profile(profile)
        with pytest.raises(LinkError, match=r"^load_Nm = much: a finite number is needed$"):
            drive.set("load_Nm", "much")
    assert asked == [("load_Nm", 1.5)]


def test_a_board_cannot_break_a_leg(board):
    profile = Profile(duration_s=0.5, broken=((0.2, "u1", "open"),))
    with BoardDrive.open(board) as drive:
        with pytest.raises(LinkError, match=r"^profile: broken: only a simulated drive"):
            drive.run_profile(profile)
        assert drive.state == "idle"  # refused before the start
        with pytest.raises(SetupError, match=r"^break_leg: only a simulated drive"):
            drive.break_leg("u1", "open")


def test_leaving_the_block_stops_the_drive(board):
    with pytest.raises(ZeroDivisionError), BoardDrive.open(board) as drive:
        drive.start()
        until(lambda: drive.state in ("build", "run"))
        1 / 0  # noqa: B018
    with BoardDrive.open(board) as drive:
        assert (drive.state, drive.faults) == ("idle", [])


#: Longest time of the board's between a death and the stop: 250 ms, and what a busy computer delays
#: the dead one's last message, the port server and the observer.
STOPPED_S = 2.0
STARTER = """
import sys, time
from hexatorque.drive.board import BoardDrive
from hexatorque.serial.exchange import Busy
drive = BoardDrive.open(sys.argv[1])
drive.start()
print("started", flush=True)
time.sleep(60)
"""


def starter(url):
    process = Forked(["-c", STARTER, url])
    assert process.stdout.readline() == "started\n"
    return process


def end(process):
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_killed_client_stops_the_drive(board):
    """The board's own clock measures the time until the gates are off."""
    with BoardDrive.open(board) as watch:
        process = starter(board)
        try:
            until(lambda: watch.state == "run")
            ticks = watch.client.latest.tick
            process.send_signal(signal.SIGKILL)
            until(lambda: watch.state == "idle")
            assert (watch.client.latest.tick - ticks) / watch.hello.f_isr_Hz < STOPPED_S
            assert watch.faults == []
        finally:
            end(process)


def test_a_killed_port_server_stops_the_drive(board):
    """In this case the board itself stops the drive."""
    with BoardDrive.open(board) as drive:
        drive.start()
        until(lambda: drive.state == "run")
        ticks = drive.client.latest.tick
        os.kill(drive.client.transport.pid, signal.SIGKILL)
        until(lambda: drive.client.counters.reconnects == 1)
        assert (drive.state, drive.faults) == ("fault", ["link lost"])
        with pytest.raises(
            LinkError, match=r"after the trip is cleared: .* board clear \(state fault"
        ):
            drive.set("f_isr_Hz", 5000.0)
        snapshot = drive.snapshot
        assert snapshot["faults"] == ["link lost"]
        assert (snapshot["tick"] - ticks) / drive.hello.f_isr_Hz < STOPPED_S
        with pytest.raises(DriveFault, match="link lost"):
            drive.check()


def test_a_stopped_process_stops_the_drive(board):
    """The process exists, but sends no heartbeat."""
    process = starter(board)
    try:
        process.send_signal(signal.SIGSTOP)
        with BoardDrive.open(board) as watch:
            until(lambda: watch.state == "idle")
            assert watch.faults == []
    finally:
        process.send_signal(signal.SIGCONT)
        end(process)


SILENT = """
import os, signal, sys
from hexatorque.drive.board import BoardDrive
from hexatorque.serial import LinkError
with BoardDrive.open(sys.argv[1]) as drive:
    for _ in range(2):
        drive.start()
        assert drive.stopped is None
        print("started", flush=True)
        os.kill(os.getpid(), signal.SIGSTOP)
        while drive.condition.at_work or drive.stopped is None:
            pass
        try:
            drive.check()
        except LinkError as error:
            print(error, flush=True)
        assert sys.stdin.readline() == "again\\n"
"""


def test_a_script_that_did_not_run_is_told_of_the_stop(board):
    process = Forked(["-c", SILENT, board], pipes=("stdin", "stdout"))
    try:
        with BoardDrive.open(board) as watch:
            for _ in range(2):  # each START begins anew
                assert process.stdout.readline() == "started\n"
                tick = watch._now_tick()
                until(lambda: watch.state == "idle")
                process.send_signal(signal.SIGCONT)
                said = process.stdout.readline()
                found = re.fullmatch(
                    r"stopped at tick (\d+): this program was silent for 250 ms\n", said
                )
                assert found and tick < int(found[1]) < tick + 100_000
                while abs(watch.capture(["speed_rpm"], 1)["speed_rpm"][0]) > 20:
                    pass
                process.stdin.write("again\n")
                process.stdin.flush()
    finally:
        process.stdin.close()
        end(process)


def test_capture_of_the_fault_itself(drive):
    drive.set("speed_ref_rpm", 100.0)
    drive.start()
    until(lambda: drive.state == "run")
    drive.arm(["faults", "i_u1_A", "state"], 300, pre=100, trigger="fault")
    drive.run(0.2, record=False)
    trip_A = drive.get("i_trip_A")
    drive.set("i_trip_A", 0.1)
    recording = drive.captured(WAIT_S)
    assert recording.start_s == -100 / 10000 and recording.rate_Hz == 10000
    assert recording.meta["trigger_s"] == 0.0
    faults = recording["faults"]
    assert np.all(faults[:100] == 0) and faults[100] == 1 and np.all(faults[100:] > 0)
    assert drive.snapshot["tick"] == recording.meta["trigger_tick"]
    drive.set("i_trip_A", trip_A)
    drive.clear()
    assert drive.state == "idle"


def test_capture_triggers(drive):
    drive.set("speed_ref_rpm", 150.0)
    drive.start()
    drive.arm(["speed_rpm", "torque_Nm"], 400, 150, "rising:speed_rpm:100", prescaler=5)
    recording = drive.captured(WAIT_S)
    speed = recording["speed_rpm"]
    assert recording.rate_Hz == 2000 and len(speed) == 400
    assert speed[149] < 100 <= speed[150]
    drive.arm(["speed_rpm"], 100, 50, "falling:speed_rpm:90")
    with pytest.raises(LinkError, match=r"not complete within 0.1 s \(waiting\)"):
        drive.captured(0.1)
    drive.set("speed_ref_rpm", 0.0)
    falling = drive.captured(WAIT_S)["speed_rpm"]
    assert falling[49] > 90 >= falling[50]
    drive.arm(["state"], 10, 5, "command")
    drive.set("rs_ohm", 1.8)
    assert len(drive.captured(WAIT_S)) == 10
    drive.arm(["state"], 10, 5, "manual")
    drive.run(0.05, record=False)
    drive.trigger()
    assert len(drive.captured(WAIT_S)) == 10
    drive.arm(["state"], 10, 5, "fault")
    drive.cancel()
    with pytest.raises(LinkError, match="none is armed"):
        drive.captured(1.0)


#: Seconds of the stream at the line's full rate.
STREAM_S = float(os.environ.get("HT_STREAM_S", 3))


def test_stream_without_a_gap_at_a_small_share_of_a_core(drive):
    """Eight channels at 2500 samples per second, which is all that 1.25 Mbaud carry."""
    names = [name for name, _ in drive.channels if name.startswith("i_")]
    with drive.stream([*names, "torque_Nm", "speed_rpm"], rate_Hz=2500) as stream:
        cpu, begun, ticks = time.process_time(), time.monotonic(), []
        while time.monotonic() - begun < STREAM_S:
            if block := stream.read(0.1):
                ticks.append(block[0])
        cpu = time.process_time() - cpu
    ticks = np.concatenate(ticks)
    assert len(ticks) > 2500 and np.all(np.diff(ticks) == 4)
    assert (stream.gaps, stream.lost, stream.damaged, drive.client.damaged) == (0, 0, 0, 0)
    # Of the board's time: it gets less than the clock's if the computer is busy.
    used = cpu / (len(ticks) / 2500)
    assert used < 0.25, f"{used:.0%} of a core"


def test_rates_follow_the_fast_interrupt(drive):
    drive.set("f_isr_Hz", 5000.0)
    try:
        with drive.stream(["vdc_V"], rate_Hz=500) as stream:
            assert stream.decimation == 10
            with pytest.raises(
                LinkError, match=r"f_isr_Hz = 8000\.0: can change only while nothing is streamed"
            ):
                drive.set("f_isr_Hz", 8000.0)
        assert drive.capture(["vdc_V"], 10, timeout_s=WAIT_S).rate_Hz == 5000
        drive.cancel()
    finally:
        drive.set("f_isr_Hz", 10000.0)
    assert drive.capture(["vdc_V"], 10, timeout_s=WAIT_S).rate_Hz == 10000


def test_over_budget_beside_other_streams(drive):
    eight = drive.stream(["torque_Nm"] * 8, rate_Hz=2500)
    with pytest.raises(LinkError, match=r"smallest decimation that fits is|nothing more fits"):
        drive.stream(["torque_Nm"], rate_Hz=5000)
    eight.close()
    with drive.stream(["torque_Nm"], rate_Hz=5000) as free:
        assert free.read(1.0)


def test_unplugged_and_another_one_plugged_in(own_board):
    """The new board has another mark, so the stream has ended."""
    with BoardDrive.open(own_board.url) as drive:
        told = []
        drive.on_reset.append(lambda: told.append(drive.get("speed_ref_rpm")))
        drive.set("speed_ref_rpm", 12.0)
        drive.start()
        with drive.stream(["state", "speed_rpm"], rate_Hz=500) as stream:
            assert stream.read(1.0)
            own_board.unplug()
            until(lambda: not drive.client.transport.plugged)
            with pytest.raises(LinkError, match="unplugged"):
                drive.set("speed_ref_rpm", 10.0)
            own_board.plug()
            until(lambda: told)
            stream.waiting()
            with pytest.raises(LinkError, match="the board was reset; the recording ends at tick"):
                stream.read(10.0)
            assert (stream.gaps, stream.lost) == (0, 0)
        assert told == [0.0] and drive.resets == 1 and drive.client.counters.reconnects == 1
        drive.set("speed_ref_rpm", 10.0)
        assert drive.get("speed_ref_rpm") == 10 and drive.state == "idle"


def test_a_reset_ends_a_scripts_recording(own_board):
    with BoardDrive.open(own_board.url, record=["speed_rpm"], rate_Hz=500) as drive:
        drive.run(0.3)
        own_board.unplug()
        own_board.plug()
        with pytest.raises(LinkError, match="the board was reset"):
            drive.run(60.0)
        recording = drive.take()
        assert recording.meta["ended"] == "board reset" and len(recording) > 50
        assert recording.meta["gaps"] == 0 and not np.isnan(recording["speed_rpm"]).any()
        drive.run(0.2)
        assert "ended" not in drive.take().meta


@pytest.mark.parametrize(
    ("url", "text", "mistake"),
    [
        ("/dev/no-such-port", "no such device", True),
        ("socket://127.0.0.1:1", "connection refused", False),
        ("nothing://x", "nothing", True),
    ],
)
def test_ports_that_cannot_be_opened(url, text, mistake):
    with pytest.raises(LinkError, match=text) as caught:
        BoardDrive.open(url)
    assert caught.value.mistake == mistake and "\n" not in str(caught.value)


def test_a_file_is_not_a_serial_port(tmp_path):
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(LinkError, match="not a serial port") as caught:
        BoardDrive.open(str(file))
    assert caught.value.mistake and "\n" not in str(caught.value)


@pytest.mark.skipif(os.getuid() == 0, reason="root may open every file")
def test_a_port_that_this_user_may_not_open():
    master, slave = os.openpty()
    os.chmod(os.ttyname(slave), 0o000)
    with pytest.raises(LinkError, match=r"permission denied; .* group dialout") as caught:
        BoardDrive.open(os.ttyname(slave))
    assert "\n" not in str(caught.value)
    os.close(master)
    os.close(slave)


def test_a_port_that_another_program_has(own_board):
    import serial

    in_use = r"in use by process \d+ \(.*python"
    with serial.Serial(own_board.url, exclusive=True), pytest.raises(Busy, match=in_use):
        BoardDrive.open(own_board.url)


def test_a_capture_is_the_simulations_own_recording(tmp_path):
    """Twelve channels at the rate of the fast interrupt, before and after a step. Each value from
    the line equals the simulation's value."""
    link, record = tmp_path / "b", tmp_path / "own.npz"
    process = Forked(["-m", "hexatorque", "board", "serve", "--link", link, "--record", record])
    try:
        process.stdout.readline()
        with BoardDrive.open(str(tmp_path / "b")) as drive:
            names = [name for name, _ in drive.channels[2:14]]
            drive.set("build_s", 0.05)
            drive.start()
            until(lambda: drive.state == "run")
            drive.arm(names, 1000, 400, "command")
            drive.run(0.1, record=False)
            drive.set("speed_ref_rpm", 200.0)
            captured = drive.captured(WAIT_S)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(WAIT_S)
        process.stdout.close()
    own = Recording.load(tmp_path / "own.npz")
    per = own.meta["samples_per_period"]
    first = captured.meta["trigger_tick"] - 400
    assert len(names) == 12 and len(captured) == 1000
    offsets = [
        offset
        for offset in (-2, -1, 0, 1)
        if all(
            np.array_equal(captured[n], own[n][::per][first + offset : first + offset + 1000])
            for n in names
        )
    ]
    assert len(offsets) == 1, "the same samples, at one place only"


def test_processes_leave_nothing_behind(own_board: Process):
    from hexatorque.serial import runtime

    BoardDrive.open(own_board.url).close()
    until(lambda: not list(runtime.directory().glob("port-*")))
