"""The XCP slave against a master of the tests: connection, reading and writing, pages, who may
command, and the dead man."""

import math
import struct
import zlib

import numpy as np
import pytest
from device import (
    ARM,
    BUSY,
    CHANNELS,
    CLOSE,
    MARK,
    NONCE,
    OPEN,
    PARAMETERS,
    STATUS,
    STREAM,
    Device,
    frame,
    opened,
)
from xcp_master import (
    CHANNELS_AT,
    CLEAR,
    DENIED,
    ERR,
    EV,
    GENERIC,
    MODE,
    PAGE,
    PARAMETERS_AT,
    PROTECTED,
    RANGE,
    RES,
    SEGMENT,
    START,
    STOP,
    SYNCH,
    SYNTAX,
    UNKNOWN,
    Master,
    Refused,
    channel,
    everything,
    framed,
    parameter,
)

from hexatorque import firmware
from hexatorque.firmware import ffi, lib

WATCHDOG_TICKS = 2500


@pytest.fixture
def device():
    return Device(session=False)


@pytest.fixture(params=[False, True], ids=["net", "serial"])
def master(device, request):
    return Master(device, serial=request.param)


def run(master):
    """Start the drive and keep it alive until it runs."""
    master.user(START)
    for _ in range(20):
        master.ask("B", 0xFD)
        master.device.tick(10)
    assert master.device.state == "run"


# --- connection -----------------------------------------------------------------------------


def test_connect_says_what_the_slave_can(device):
    resource, mode, cto, dto, layer, transport = struct.unpack(
        "<BBBHBB", Master(device, connect=False).connect()
    )
    assert resource == 0x05  # calibration and measuring
    assert mode & 0x47 == 0  # Intel's order, octets, no blocks
    assert (cto, dto, layer, transport) == (64, 133, 1, 1)


def test_nothing_is_answered_before_a_connect_and_after_a_disconnect(device):
    master = Master(device, connect=False)
    assert master.answer(b"\xfd") is None
    master.connect()
    assert master.answer(b"\xfd") is not None
    master.disconnect()
    assert master.answer(b"\xfd") is None


def test_synch_is_answered_by_the_error_of_this_name(master):
    assert master.code("B", 0xFC) == SYNCH


@pytest.mark.parametrize("opcode", [*range(0xC0), 0xC7, 0xD2, 0xD8, 0xE4, 0xED, 0xF7, 0xF8])
def test_an_unknown_command_is_told_so(device, opcode):
    assert Master(device).code("BQ", opcode, 0) == UNKNOWN


#: Of commands that take a list, an event or a page: an octet less than ASAM's table has behind the
#: first one.
TOO_FEW = {
    0xE8: 3, 0xE7: 2, 0xE3: 2, 0xE2: 4, 0xE1: 6, 0xE0: 6, 0xDF: 2, 0xDE: 2, 0xDD: 0, 0xD7: 2,
    0xD5: 2, 0xD4: 3, 0xD3: 4,
}  # fmt: skip


@pytest.mark.parametrize(
    "packet",
    [b"\xf6\0\0\0\0\x10\0", b"\xf4\4\0\0\0\x10\0", b"\xf0\4\0\0\0", b"\xe1\xff\4\0\0\x10\0"]
    + [bytes([opcode]) + bytes(n) for opcode, n in TOO_FEW.items()],
)
def test_a_packet_that_is_too_short_has_a_wrong_syntax(device, packet):
    assert Master(device).answer(packet) == bytes([ERR, SYNTAX])


def test_the_board_tells_its_name(device):
    master = Master(device)
    mode, _, n = struct.unpack("<BHI", master.ask("BB", 0xFA, 0))
    assert mode == 0
    assert master.ask("BB", 0xF5, n) == b"virtual f28377s"
    assert master.code("BB", 0xF5, 1) == DENIED
    assert struct.unpack("<BHI", master.ask("BB", 0xFA, 4))[2] == 0


# --- reading --------------------------------------------------------------------------------


def test_every_parameter_and_channel_has_its_address(master):
    device = master.device
    for name, k in PARAMETERS.items():
        assert master.value(PARAMETERS_AT + 4 * k) == lib.ht_drive_get(device.drive, k), name
    for name, k in CHANNELS.items():
        got, shown = master.value(CHANNELS_AT + 4 * k), device.channel(name)
        assert got == shown or (math.isnan(got) and math.isnan(shown)), name


@pytest.mark.parametrize("address", [
    0, 0xFFC, CHANNELS_AT + 4 * len(CHANNELS), PARAMETERS_AT - 4,
    PARAMETERS_AT + 4 * len(PARAMETERS), 0x3000, 0x80000000, 0xFFFFFFFC,
])  # fmt: skip
def test_an_address_that_does_not_exist_is_refused(device, address):
    master = Master(device)
    assert master.code("BBBBI", 0xF4, 4, 0, 0, address) == DENIED
    master.ask("BHBI", 0xF6, 0, 0, address)
    assert master.code("BB", 0xF5, 4) == DENIED
    assert master.code("BBf", 0xF0, 4, 1.0) == DENIED


def test_an_upload_may_begin_and_end_within_a_value(device):
    master = Master(device)
    whole = master.read(PARAMETERS_AT, 60)
    for at, n in ((1, 1), (2, 5), (3, 57)):
        assert master.read(PARAMETERS_AT + at, n) == whole[at : at + n]


def test_uploads_go_on_where_the_last_one_ended(device):
    master = Master(device)
    whole = master.read(PARAMETERS_AT, 40)
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT)
    assert b"".join(master.ask("BB", 0xF5, n) for n in (3, 30, 7)) == whole


def test_an_upload_across_the_end_of_a_table_is_refused(device):
    end = PARAMETERS_AT + 4 * len(PARAMETERS)
    master = Master(device)
    assert len(master.read(end - 4)) == 4
    assert master.code("BBBBI", 0xF4, 5, 0, 0, end - 4) == DENIED


@pytest.mark.parametrize("n", [0, 64, 255])
def test_an_upload_is_as_long_as_an_answer_at_most(device, n):
    master = Master(device)
    assert master.code("BBBBI", 0xF4, n, 0, 0, PARAMETERS_AT) == RANGE
    assert master.code("BB", 0xF5, n) == RANGE


def test_the_checksum_is_the_crc_of_what_is_read(device):
    master = Master(device)
    n = 4 * len(PARAMETERS)
    values = struct.pack(f"<{len(PARAMETERS)}f", *everything(device))
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT)
    kind, _, crc = struct.unpack("<BHI", master.ask("BBHI", 0xF3, 0, 0, n))
    assert (kind, crc) == (9, zlib.crc32(values))
    assert master.code("BBHI", 0xF3, 0, 0, 4) == DENIED  # behind the table
    assert master.code("BBHI", 0xF3, 0, 0, 0) == RANGE


# --- writing --------------------------------------------------------------------------------


def test_a_written_value_is_in_force_when_the_answer_comes(master):
    master.write(parameter("speed_ref_rpm"), 250.0)
    assert lib.ht_drive_get(master.device.drive, PARAMETERS["speed_ref_rpm"]) == 250.0
    assert master.device.drive.staged == firmware.ffi.NULL


def test_values_beside_each_other_change_together_or_not_at_all(device):
    master = Master(device)
    before = everything(device)
    with pytest.raises(Refused) as refused:
        master.write(parameter("speed_ref_rpm"), 250.0, math.nan)
    assert refused.value.code == RANGE
    assert everything(device) == before
    master.write(parameter("speed_ref_rpm"), 250.0, 1.5)
    assert (master.value(parameter("speed_ref_rpm")), master.value(parameter("torque_ref_Nm"))) == (
        250.0, 1.5,
    )  # fmt: skip


@pytest.mark.parametrize(("name", "value"), [
    ("pole_pairs", 2.5), ("pole_pairs", 0.0), ("scheme", -1.0), ("speed_ref_rpm", math.inf),
    ("speed_ref_rpm", math.nan), ("flux_ref_Wb", 0.0), ("flux_min_Wb", 90.0),
])  # fmt: skip
def test_a_value_out_of_its_range_or_that_does_not_fit_is_refused(device, name, value):
    master = Master(device)
    before = everything(device)
    master.ask("BHBI", 0xF6, 0, 0, parameter(name))
    assert master.code("BBf", 0xF0, 4, value) == RANGE
    assert everything(device) == before


@pytest.mark.parametrize("n", [0, 1, 2, 3, 5, 61])
def test_only_whole_values_are_written(device, n):
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT)
    assert master.code("BB62s", 0xF0, n, bytes(62)) == RANGE


@pytest.mark.parametrize("n", [63, 64, 252])
def test_more_values_than_a_packet_holds_are_no_command(device, n):
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT)
    before = everything(device)
    assert master.code("BB62s", 0xF0, n, bytes(62)) == SYNTAX
    assert everything(device) == before


def test_a_value_is_written_from_its_first_octet_on(device):
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT + 2)
    assert master.code("BBf", 0xF0, 4, 1.0) == RANGE


def test_a_write_across_the_end_of_the_table_is_refused(device):
    master = Master(device)
    before = everything(device)
    master.ask("BHBI", 0xF6, 0, 0, PARAMETERS_AT + 4 * (len(PARAMETERS) - 1))
    assert master.code("BBff", 0xF0, 8, before[-1], 0.0) == DENIED
    assert everything(device) == before


def test_channels_cannot_be_written(device):
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, channel("vdc_V"))
    assert master.code("BBf", 0xF0, 4, 1.0) == PROTECTED


def test_a_parameter_that_may_change_only_when_idle_is_refused_while_the_drive_runs(device):
    master = Master(device)
    run(master)
    before = everything(device)
    master.ask("BHBI", 0xF6, 0, 0, parameter("pole_pairs"))
    with pytest.raises(Refused) as refused:
        master.ask("BBf", 0xF0, 4, 3.0)
    assert (refused.value.code, refused.value.detail) == (DENIED, bytes([lib.HT_ERROR_STATE]))
    assert everything(device) == before


def test_the_rate_stays_while_it_is_measured(device):
    master = Master(device)
    master.lists((0, 10, [[channel("vdc_V")]]))
    master.ask("BHBI", 0xF6, 0, 0, parameter("f_isr_Hz"))
    assert master.code("BBf", 0xF0, 4, 5000.0) == DENIED
    rate_Hz = device.controller.get("f_isr_Hz")
    assert master.code("BBf", 0xF0, 4, rate_Hz) == RES  # the one that it has
    master.ask("BB", 0xDD, 0)
    master.ask("BHBI", 0xF6, 0, 0, parameter("f_isr_Hz"))
    master.ask("BBf", 0xF0, 4, 5000.0)


def test_the_rate_stays_while_the_links_capture_waits():
    """A capture goes on when the host that armed it has closed its session."""
    device = Device()
    device.done(ARM, "BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0)
    device.done(CLOSE)
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, parameter("f_isr_Hz"))
    rate_Hz = device.controller.get("f_isr_Hz")
    assert master.code("BBf", 0xF0, 4, 5000.0) == DENIED
    assert device.controller.get("f_isr_Hz") == rate_Hz


# --- pages, store ---------------------------------------------------------------------------


def test_the_kept_page_has_what_is_kept_and_cannot_be_written():
    device = Device(session=False, store=firmware.MemoryStore())
    master = Master(device)
    name = "kp_speed_Nms_rad"
    master.write(parameter(name), 0.125)
    master.ask("BBH", 0xF9, 1, 0)
    master.device.tick(5)
    master.packets += master.receive()
    assert master.packets == [bytes([EV, 0x03])]
    master.write(parameter(name), 0.5)
    master.ask("BBBB", 0xEB, 0x02, 0, 1)
    assert master.value(parameter(name)) == 0.125
    assert master.ask("BBB", 0xEA, 0x02, 0) == bytes([0, 0, 1])
    assert master.ask("BBB", 0xEA, 0x01, 0) == bytes([0, 0, 0])
    master.ask("BHBI", 0xF6, 0, 0, parameter(name))
    assert master.code("BBf", 0xF0, 4, 1.0) == PROTECTED
    master.ask("BBBB", 0xEB, 0x83, 0, 0)
    assert master.value(parameter(name)) == 0.5


def test_an_empty_store_has_the_built_in_values_on_its_page():
    device = Device(session=False, store=firmware.MemoryStore())
    master = Master(device)
    master.write(parameter("kp_speed_Nms_rad"), 0.125)
    master.ask("BBBB", 0xEB, 0x02, 0, 1)
    row = firmware.parameters()["kp_speed_Nms_rad"]
    assert master.value(parameter("kp_speed_Nms_rad")) == np.float32(row.initial)


@pytest.mark.parametrize("without", ["a memory", "a store"])
def test_without_a_store_the_kept_page_has_the_built_in_values(device, without):
    if without == "a store":
        device.service.setup.store = ffi.NULL
    master = Master(device)
    master.write(parameter("kp_speed_Nms_rad"), 0.125)
    with pytest.raises(Refused) as refused:
        master.ask("BBH", 0xF9, 1, 0)
    assert refused.value.code == GENERIC
    device.tick(5)
    assert master.packets + master.receive() == [], "no event tells that something is kept"
    master.ask("BBBB", 0xEB, 0x02, 0, 1)
    row = firmware.parameters()["kp_speed_Nms_rad"]
    assert (
        master.value(parameter("kp_speed_Nms_rad"))
        == struct.unpack("f", struct.pack("f", row.initial))[0]
    )


def test_nothing_is_kept_while_the_drive_runs_or_values_are_measured():
    device = Device(session=False, store=firmware.MemoryStore())
    master = Master(device)
    master.lists((0, 10, [[channel("vdc_V")]]))
    assert master.code("BBH", 0xF9, 1, 0) == DENIED
    master.ask("BB", 0xDD, 0)
    run(master)
    assert master.code("BBH", 0xF9, 1, 0) == DENIED
    assert device.controller.store.areas == bytearray(b"\xff" * firmware.MemoryStore.SIZE)


@pytest.mark.parametrize(("request_", "code"), [
    ((0x02, 1, 0), SEGMENT), ((0x02, 0, 2), PAGE), ((0x01, 0, 1), MODE), ((0x03, 0, 1), MODE),
    ((0x00, 0, 0), MODE), ((0x04, 0, 0), MODE), ((0x82, 7, 1), RES),
])  # fmt: skip
def test_pages_that_do_not_exist_are_refused(device, request_, code):
    assert Master(device).code("BBBB", 0xEB, *request_) == code


def test_the_segment_is_the_table_of_parameters(device):
    master = Master(device)
    assert master.ask("B", 0xE9) == bytes([1, 0])
    where, length = (
        struct.unpack("<BHI", master.ask("BBBBB", 0xE8, 0, 0, k, 0))[2] for k in (0, 1)
    )
    assert (where, length) == (PARAMETERS_AT, 4 * len(PARAMETERS))
    assert master.ask("BBBBB", 0xE8, 1, 0, 0, 0) == bytes([2, 0, 0, 0, 0])
    assert master.ask("BBBB", 0xE7, 0, 0, 1)[0] & 0x33 == 0  # no write, nothing of the drive's
    assert master.code("BBBB", 0xE7, 0, 0, 2) == PAGE
    assert master.code("BBBB", 0xE7, 0, 1, 0) == SEGMENT
    assert master.code("BBBBB", 0xE8, 2, 0, 0, 0) == RANGE


# --- who may command, the dead man ------------------------------------------------------------


def test_start_stop_and_clear_by_user_commands(master):
    device = master.device
    run(master)
    master.user(STOP)
    assert (device.state, device.gates_off) == ("idle", True)
    lib.ht_drive_trip(device.drive, lib.HT_FAULT_LINK)
    master.user(CLEAR)
    assert device.state == "idle"
    assert master.code("BB", 0xF1, 0x12) == RANGE


def test_a_refused_start_tells_why(device):
    lib.ht_drive_trip(device.drive, lib.HT_FAULT_LINK)
    with pytest.raises(Refused) as refused:
        Master(device).user(START)
    assert (refused.value.code, refused.value.detail) == (DENIED, bytes([lib.HT_ERROR_STATE]))


def test_a_silent_master_stops_the_drive_within_the_watchdogs_time(master):
    run(master)
    device = master.device
    device.tick(WATCHDOG_TICKS - 300)
    assert device.state == "run"
    device.tick(301)
    assert (device.state, device.gates_off) == ("fault", True)
    assert device.drive.faults == lib.HT_FAULT_LINK


def test_every_command_of_the_owner_feeds_the_watchdog(device):
    master = Master(device)
    run(master)
    for layout, *values in (
        ("B", 0xFD), ("B", 0xC0), ("BBBBI", 0xF4, 4, 0, 0, 0), ("B", 0xDC), ("BB", 0xFA, 0),
    ):  # fmt: skip
        device.tick(WATCHDOG_TICKS - 200)
        master.code(layout, *values)
    assert device.state == "run"


def test_a_disconnect_stops_the_drive_as_a_close_does(master):
    run(master)
    master.disconnect()
    assert (master.device.state, master.device.service.session) == ("idle", 0)


def test_a_master_that_only_reads_takes_no_session(device):
    master = Master(device)
    master.value(channel("vdc_V"))
    master.lists((0, 10, [[channel("vdc_V")]]))
    assert device.service.session == 0


def test_a_masters_number_is_nobody_elses():
    """Not even where a host of the link has the number that the master would have."""
    speed = parameter("speed_ref_rpm")
    first = Master(Device(session=False))
    first.write(speed, 50.0)
    taken = first.device.service.session
    device = Device(session=False)
    device.service.session = taken
    master = Master(device)
    master.ask("BHBI", 0xF6, 0, 0, speed)
    assert master.code("BBf", 0xF0, 4, 50.0) == DENIED
    assert (device.service.session, master.value(speed)) == (taken, 0.0)


def test_the_links_host_keeps_the_session_and_xcp_may_only_look_and_stop():
    device = Device()
    master = Master(device)
    before = everything(device)
    master.ask("BHBI", 0xF6, 0, 0, parameter("speed_ref_rpm"))
    assert master.code("BBf", 0xF0, 4, 100.0) == DENIED
    assert [master.code("BB", 0xF1, op) for op in (START, CLEAR)] == [DENIED, DENIED]
    assert master.code("BBH", 0xF9, 1, 0) == DENIED
    assert everything(device) == before
    assert master.value(parameter("speed_ref_rpm")) == before[PARAMETERS["speed_ref_rpm"]]
    device.run()
    master.user(STOP)
    assert device.state == "idle"
    assert device.service.session == NONCE
    master.disconnect()
    assert device.service.session == NONCE


def test_a_silent_xcp_master_does_not_feed_another_hosts_watchdog():
    device = Device()
    master = Master(device)
    device.run()
    for _ in range(30):
        master.value(channel("vdc_V"))
        device.tick(100)
    assert device.drive.faults == lib.HT_FAULT_LINK


def test_while_xcp_owns_the_session_the_link_refuses_another_host(device):
    master = Master(device)
    master.write(parameter("speed_ref_rpm"), 10.0)
    assert device.ask(OPEN, struct.pack("<HI", NONCE, MARK)).status == BUSY
    device.tick(4 * WATCHDOG_TICKS + 1)  # a session ends with its host's silence
    assert device.ask(OPEN, struct.pack("<HI", NONCE, MARK)).status == 0
    master.ask("BHBI", 0xF6, 0, 0, parameter("speed_ref_rpm"))
    assert master.code("BBf", 0xF0, 4, 100.0) == DENIED


# --- the line that link and XCP share --------------------------------------------------------


def test_on_the_shared_line_a_connect_is_heard_between_frames_of_the_link():
    device = Device()
    assert device.stream(0, 50, "vdc_V").status == 0
    device.tick(500)
    assert device.samples(0)
    device.put(framed(b"\xff\0", 0, True))
    device.tick(20)
    came = device.controller.take()
    assert framed(struct.pack("<BBBBHBB", RES, 5, 0x80, 64, 133, 1, 1), 0, True) in came
    device.tick(500)
    assert device.controller.take() == b""  # no samples of the link's


def test_a_frame_of_the_link_that_has_begun_ends_before_xcp_has_the_line():
    """The slow line carries about an octet in each fast interrupt."""
    device = Device(session=False, baud=115200)
    device.put(frame(device.request(STATUS)))
    while not (raw := device.controller.take()):
        device.tick()
    device.put(framed(b"\xff\0", 0, True))
    device.tick(100)
    raw += device.controller.take()
    connected = framed(struct.pack("<BBBBHBB", RES, 5, 0x80, 64, 133, 1, 1), 0, True)
    assert raw.endswith(b"\0" + connected)
    (reply,) = [part for part in raw[: -len(connected)].split(b"\0") if part]
    assert opened(reply)[:3] == bytes([STATUS | 0x80, device.id, 0])
    assert Master(device, serial=True, connect=False).put(b"") == 0


def test_no_more_is_read_from_the_shared_line_than_is_asked_for(device):
    xcp = ffi.addressof(device.controller.board, "xcp_serial")
    waiting, given = list(b"a" * 40), ffi.new("uint16_t[100]")

    @ffi.callback("uint16_t(void *, uint16_t *, uint16_t, bool *)")
    def read(at, octets, n, lost):
        for k in range(n):
            octets[k] = waiting.pop()
        return n

    xcp.line.read = read
    line = lib.ht_xcp_shared(xcp)
    for most, came in ((3, 3), (100, 16)):  # as much as a FIFO holds
        assert line.read(line.at, given, most, ffi.new("bool *")) == came
    assert len(waiting) == 40 - 3 - 16


def test_a_frame_of_the_link_gives_the_line_back():
    device = Device(session=False)
    master = Master(device, serial=True)
    master.lists((0, 50, [[channel("vdc_V")]]))
    device.tick(100)
    assert master.receive()
    device.put(b"\0" + frame(device.request(STATUS)))
    device.tick(50)
    *_, reply, rest = device.controller.take().split(b"\0")  # behind the last packets of XCP
    assert (opened(reply)[:3], rest) == (bytes([STATUS | 0x80, device.id, 0]), b"")
    device.tick(500)
    assert device.controller.take() == b""  # no packets of XCP's
    assert master.answer(b"\xfd") is None
    device.controller.take()
    master.came = master.xcp.counter
    assert master.answer(b"\xff\0") is not None


def test_a_stop_of_the_link_stops_the_drive_while_the_line_is_xcps(device):
    master = Master(device, serial=True)
    run(master)
    device.put(b"\0")
    device.put(frame(device.request(STOP)))
    device.tick(10)
    assert (device.state, device.gates_off) == ("idle", True)


def test_octets_of_xcp_do_not_count_as_damaged_frames_of_the_link(device):
    master = Master(device, serial=True)
    before = device.service.damaged
    for _ in range(20):
        master.read(PARAMETERS_AT, 60)
    assert device.service.damaged == before


@pytest.mark.parametrize("noise", [b"\x02", b"\x02\0", b"\x02\0\0\0\xff", bytes(7), b"\x40\0ab"])
def test_a_frame_behind_octets_of_a_disturbance_is_found(device, noise):
    master = Master(device, serial=True, connect=False)
    device.put(noise)
    master.connect()
    device.put(noise)
    device.tick(600)  # a silence ends what is not whole
    assert master.value(PARAMETERS_AT) == everything(device)[0]


@pytest.mark.parametrize("at", range(14))
def test_a_damaged_frame_writes_nothing(device, at):
    master = Master(device, serial=True)
    master.ask("BHBI", 0xF6, 0, 0, parameter("speed_ref_rpm"))
    before = everything(device)
    raw = bytearray(framed(struct.pack("<BBf", 0xF0, 4, 250.0), master.sent, True))
    assert len(raw) == 12
    raw[at % 12] ^= 1 << (at % 8)
    device.put(bytes(raw))
    device.tick(600)
    assert everything(device) == before
    assert master.value(PARAMETERS_AT) == before[0]


def test_streams_of_the_link_and_xcp_on_its_own_line_go_on_together():
    device = Device()
    master = Master(device)
    assert device.ask(STREAM, struct.pack("<BBHH", 0, 1, 10, CHANNELS["vdc_V"])).status == 0
    master.lists((0, 10, [[channel("vdc_V")]]))
    device.tick(200)
    assert len(device.samples(0)) >= 19
    assert len([p for p in master.receive() if p[0] == 0]) >= 19


@pytest.mark.parametrize(("add", "size"), [("8", 1), ("16", 2), ("32", 4)])
def test_a_packet_that_is_full_takes_no_part_of_a_value(add, size):
    packet = ffi.new("ht_xcp_packet *")
    for n in range(200):
        getattr(lib, f"ht_xcp_add{add}")(packet, n)
    assert packet.n == len(packet.octet) // size * size
    value = int.from_bytes(bytes(packet.octet[0 : packet.n])[-size:], "little")
    assert value == packet.n // size - 1


def test_of_incoming_octets_a_frame_is_dropped_or_the_first_one():
    came = ffi.new("ht_xcp_incoming *")
    lib.ht_xcp_incoming_reset(came)
    for octet in b"\x07" + framed(b"\xfd\x01", 0, False) + b"\x08\x09":
        lib.ht_xcp_incoming_add(came, octet)
    lib.ht_xcp_incoming_drop(came, 0, False)
    assert lib.ht_xcp_incoming_next(came, 64, False) == 2
    lib.ht_xcp_incoming_drop(came, 2, False)
    assert bytes(came.octet[0 : came.n]) == b"\x08\x09"
