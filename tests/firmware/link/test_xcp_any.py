"""XCP with any octets: nothing that a master sends leaves a parameter out of its range, or switches
the gates on without a START."""

import struct

from device import CHANNELS, PARAMETERS, Device
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from xcp_master import CHANNELS_AT, ERR, PARAMETERS_AT, RES, START, Master, framed, in_range

from hexatorque.firmware import lib

ANY = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
OPCODES = st.one_of(st.integers(0xD3, 0xFF), st.integers(0, 0xFF))
ADDRESSES = st.one_of(
    st.integers(CHANNELS_AT - 8, CHANNELS_AT + 4 * len(CHANNELS) + 8),
    st.integers(PARAMETERS_AT - 8, PARAMETERS_AT + 4 * len(PARAMETERS) + 8),
    st.integers(0, 0xFFFFFFFF),
)
FLOATS = st.floats(width=32)
#: Packets that are mostly right, so that they get further than the check of their length.
PACKETS = st.one_of(
    st.builds(lambda op, rest: bytes([op]) + rest, OPCODES, st.binary(max_size=63)),
    st.builds(lambda a: struct.pack("<BHBI", 0xF6, 0, 0, a), ADDRESSES),
    st.builds(lambda n, a: struct.pack("<BBBBI", 0xF4, n, 0, 0, a), st.integers(0, 64), ADDRESSES),
    st.builds(
        lambda v: struct.pack(f"<BB{len(v)}f", 0xF0, 4 * len(v), *v), st.lists(FLOATS, max_size=15)
    ),
    st.builds(lambda n: struct.pack("<BBH", 0xD5, 0, n), st.integers(0, 9)),
    st.builds(lambda k, n: struct.pack("<BBHB", 0xD4, 0, k, n), *[st.integers(0, 9)] * 2),
    st.builds(lambda k, j, n: struct.pack("<BBHBB", 0xD3, 0, k, j, n), *[st.integers(0, 33)] * 3),
    st.builds(lambda k, j, n: struct.pack("<BBHBB", 0xE2, 0, k, j, n), *[st.integers(0, 9)] * 3),
    st.builds(lambda a: struct.pack("<BBBBI", 0xE1, 0xFF, 4, 0, a), ADDRESSES),
    st.builds(lambda m, k: struct.pack("<BBH", 0xDE, m, k), *[st.integers(0, 3)] * 2),
    st.builds(lambda m: struct.pack("<BB", 0xDD, m), st.integers(0, 3)),
)


def checked(master, starts):
    device = master.device
    assert in_range(device)
    if not starts:
        assert (device.state, device.gates_off) == ("idle", True)
    daq = master.xcp.daq
    assert daq.lists <= 8 and daq.odts <= 32 and daq.entries <= 128
    assert daq.head < 1024 and daq.tail < 1024


@ANY
@given(st.lists(PACKETS, max_size=40), st.booleans())
def test_any_packets_leave_the_drive_as_its_rules_want_it(packets, serial):
    master = Master(Device(session=False), serial=serial)
    starts = False
    for packet in packets:
        starts = starts or packet[:2] == bytes([0xF1, START])
        answer = master.answer(packet, patience=40)
        assert answer is None or answer[0] in (RES, ERR)
        assert answer is None or len(answer) <= 64
        checked(master, starts)


@ANY
@given(st.binary(max_size=600), st.booleans())
def test_any_octets_change_nothing_that_a_connect_does_not_mend(octets, serial):
    master = Master(Device(session=False), serial=serial, connect=False)
    before = [lib.ht_drive_get(master.device.drive, k) for k in range(len(PARAMETERS))]
    master.put(octets)
    master.device.tick(60 + 600)  # the line, and a silence
    checked(master, starts=False)
    assert before == [lib.ht_drive_get(master.device.drive, k) for k in range(len(PARAMETERS))]
    master.take()
    master.put(framed(b"\xff\0", 0, serial))
    master.device.tick(20)
    assert bytes([RES, 5, 0x80]) in master.take()
