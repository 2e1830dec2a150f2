"""Dead time and trip pin over the serial line: what a board refuses and how it reports this. No
gate may come on meanwhile."""

import struct

import pytest
from device import CLEAR, DONE, LIST, PARAMETERS, START, STATE, STOP, VALUE, Device

from hexatorque.results import RESULTS
from hexatorque.serial import wire

TRIP = 7
DEAD_TIME = PARAMETERS["dead_time_us"]


def test_list_shows_the_boards_range_of_the_dead_time():
    """The virtual board has an F28377S. Its minimum is 1 us, and the maximum of any board is 20
    us."""
    device = Device()
    reply = device.ask(LIST, struct.pack("<BH", 0, DEAD_TIME))
    row = wire.parse_row(reply.payload, wire.Kind.PARAMETER, DEAD_TIME)
    assert (row.name, row.min, row.max) == ("dead_time_us", 1.0, 20.0)


@pytest.mark.parametrize("us", (0.0, 0.5, 0.999, 20.001, -2.0))
def test_dead_time_that_the_board_does_not_allow_is_refused(us):
    device = Device()
    reply = device.write(speed_ref_rpm=10.0, dead_time_us=us)
    assert (reply.status, reply.payload) == (VALUE, struct.pack("<H", DEAD_TIME))
    assert device.value("dead_time_us") == pytest.approx(2.3)
    assert device.value("speed_ref_rpm") == 0.0  # all or none
    assert device.write(dead_time_us=1.0).status == DONE
    m, words = device.controller.map, device.controller.register_words()
    assert words[m.epwm + m.dbred] == words[m.epwm + m.dbfed] == 100  # of 10 ns


def refused(device):
    before = device.state
    for request in (START, CLEAR):
        reply = device.ask(request)
        assert (reply.status, reply.payload) == (TRIP, b"\xff\xff")
        assert device.state == before and device.gates_off


def test_trip_pin_held_low_refuses_start_and_clear():
    device = Device()
    device.controller.set_trip_pin(0)
    refused(device)
    device.controller.set_trip_pin(1)
    assert device.ask(CLEAR).status == STATE  # nothing to clear


def test_a_trip_by_the_pin_stays_until_the_pin_is_released_and_the_fault_cleared():
    device = Device()
    device.run()
    device.controller.set_trip_pin(0)
    device.tick()
    assert (device.state, device.controller.faults) == ("fault", ["external trip"])
    refused(device)
    device.done(STOP)  # a stop is always carried out
    refused(device)
    device.controller.set_trip_pin(1)
    assert device.ask(START).status == STATE  # released, then cleared
    device.done(CLEAR)
    device.run()
    assert device.controller.registers.violations == 0


def test_the_hosts_message_says_what_to_do():
    assert wire.Status(TRIP) == wire.Status.TRIP
    assert RESULTS[wire.Status.TRIP].text == (
        "the trip pin is low (external trip): release it, then clear"
    )


def test_too_many_external_trips_refuse_a_start_and_tell_the_time_to_wait():
    device = Device(restart_count=2, restart_wait_s=30.0)
    for _ in range(2):
        device.done(START)
        device.controller.set_trip_pin(0)
        device.tick()
        device.controller.set_trip_pin(1)
        device.done(CLEAR)
    reply = device.ask(START)
    assert (reply.status, reply.payload) == (wire.Status.RESTART, struct.pack("<H", 30))
    assert device.state == "idle" and device.gates_off
    refusal = wire.Reply(START, 1, reply.status, 0, 0, 0, reply.payload)
    assert wire.refusal(refusal) == (
        "too many trips by hardware in a row (restart_count, restart_wait_s): find their cause; "
        "a start is refused for another 30 s"
    )
