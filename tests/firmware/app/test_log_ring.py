"""The log's ring on a memory that cannot be read in places, that is too small, or that a later
firmware has written. (Power that fails within a write, damage and wear: tests/c/test_log.c.)"""

import struct
import zlib

import pytest

from hexatorque.firmware import MemoryStore, ffi, lib

BLOCK = MemoryStore.BLOCK
BLOCKS = lib.HT_STORE_FILE_LOG_BLOCKS
SLOT = 4  #: blocks
PAYLOAD = BLOCK // 2 * SLOT - 2  #: words, before their CRC
LEAST_SLOTS = 128
MARK, EVENT, LATER = 0xFFFE, 1, 0xFD


class Memory:
    """Two areas; `broken` blocks (area, block) cannot be read."""

    def __init__(self, blocks=BLOCKS):
        self.areas = [bytearray(b"\xff" * BLOCK * blocks) for _ in range(2)]
        self.broken, self.erased = set(), []
        self.calls = (
            ffi.callback("bool(void *, uint16_t, uint16_t, uint16_t *)", self.read),
            ffi.callback("bool(void *, uint16_t, uint16_t, const uint16_t *)", self.write),
        )
        self.blocks = blocks
        self.power_on()

    def read(self, at, area, block, words):
        ffi.memmove(words, bytes(self.areas[area][block * BLOCK : (block + 1) * BLOCK]), BLOCK)
        return (area, block) not in self.broken

    def write(self, at, area, block, words):
        if words == ffi.NULL:
            self.erased.append(area)
            self.areas[area][:] = b"\xff" * len(self.areas[area])
        else:
            self.areas[area][block * BLOCK : (block + 1) * BLOCK] = bytes(ffi.buffer(words, BLOCK))
        return True

    def power_on(self):
        self.ring = ffi.new("ht_log_ring *")
        lib.ht_log_ring_none(self.ring)
        port = self.ring.port
        port.read, port.write, port.blocks = *self.calls, self.blocks
        lib.ht_log_ring_start(self.ring)
        return self

    def turn(self, may_erase=True):
        """Until a record may be put (True), or there is no memory (False)."""
        for _ in range(5000):
            turned = lib.ht_log_ring_turn(self.ring, True, may_erase)
            if turned in (lib.HT_LOG_FREE, lib.HT_LOG_NO_MEMORY):
                return turned == lib.HT_LOG_FREE
        raise AssertionError("it does not end")

    def put(self, kind, n):
        assert self.turn()
        lib.ht_log_ring_put(self.ring, [kind, n] + [0] * (PAYLOAD - 2))
        assert self.turn(may_erase=False)
        assert self.ring.kept

    def events(self):
        """The second word of each event that can be read, the oldest first."""
        words = ffi.new("uint16_t[]", PAYLOAD + 2)
        rows = range(self.ring.events)
        return [words[1] for row in rows if lib.ht_log_ring_read(self.ring, row, words)]

    def place(self, area, slot, payload):
        """A whole record in the memory itself."""
        raw = struct.pack(f"<{PAYLOAD}H", *payload, *[0] * (PAYLOAD - len(payload)))
        raw += struct.pack("<I", zlib.crc32(raw))
        self.areas[area][slot * SLOT * BLOCK : (slot + 1) * SLOT * BLOCK] = raw


def filled(events):
    memory = Memory()
    for n in range(1, events + 1):
        memory.put(EVENT, n)
    return memory


def test_without_a_memory_or_with_one_too_small_there_is_no_log():
    none = ffi.new("ht_log_ring *")
    lib.ht_log_ring_none(none)
    assert not lib.ht_log_ring_works(none)
    assert Memory(BLOCKS).turn()
    assert Memory(SLOT * LEAST_SLOTS).turn()
    small = Memory(SLOT * (LEAST_SLOTS - 1))
    assert not lib.ht_log_ring_works(small.ring) and not small.turn()


def test_a_slot_that_cannot_be_read_is_damaged_and_the_others_are_there():
    memory = filled(9)
    area = memory.ring.area
    memory.broken = {(area, 4 * SLOT + 1)}  # the fourth event
    assert memory.power_on().turn()
    assert memory.events() == [1, 2, 3, 5, 6, 7, 8, 9]
    assert memory.ring.damaged == 1
    memory.put(EVENT, 10)  # behind the others
    assert memory.events()[-1] == 10


def test_an_event_that_has_been_damaged_since_it_was_read_is_not_told():
    memory = filled(5)
    area = memory.ring.area
    memory.areas[area][2 * SLOT * BLOCK + 8] ^= 1
    assert memory.events() == [1, 3, 4, 5]
    memory.broken = {(area, 5 * SLOT)}
    assert memory.events() == [1, 3, 4]
    assert not lib.ht_log_ring_read(memory.ring, 5, ffi.new("uint16_t[]", PAYLOAD + 2))


def test_a_new_memory_that_cannot_be_read_is_none_and_nothing_is_erased():
    memory = Memory()
    memory.broken = {(0, BLOCKS - 1)}
    assert not memory.power_on().turn()
    assert memory.erased == []


def test_an_event_that_cannot_be_read_when_the_area_changes_is_left_behind():
    memory = filled(100)
    area = memory.ring.area
    memory.broken = {(area, 90 * SLOT)}  # the 90th event
    n = 100
    while memory.ring.area == area:
        n += 1
        memory.put(EVENT, n)
        assert memory.turn()
    assert memory.ring.damaged == 1
    kept = memory.events()
    assert kept[0] < 90 and 90 not in kept
    assert kept == [k for k in range(kept[0], n + 1) if k != 90]


def test_a_record_of_a_later_firmware_is_left_alone():
    """Its kind is none of this one's. It is no damage and no event."""
    memory = filled(3)
    area, slot = memory.ring.area, memory.ring.next
    memory.place(area, slot, [LATER, 77])
    assert memory.power_on().turn()
    assert memory.events() == [1, 2, 3] and memory.ring.damaged == 0
    memory.put(EVENT, 4)
    assert memory.events() == [1, 2, 3, 4]


@pytest.mark.parametrize("first", [[MARK, 2], [MARK - 1, 1], [EVENT, 1]])
def test_an_area_whose_first_record_is_no_mark_of_this_layout_is_no_log(first):
    memory = filled(3)
    memory.place(memory.ring.area, 0, [*first, 1])
    memory.power_on()
    assert memory.turn() and memory.events() == []
    assert memory.erased, "it is not blank"


def test_damaged_slots_are_counted_up_to_65535():
    memory = filled(2)
    memory.areas[memory.ring.area][2 * SLOT * BLOCK] ^= 1
    memory.power_on()
    memory.ring.damaged = 0xFFFE
    assert memory.turn() and memory.ring.damaged == 0xFFFF
    memory.power_on()
    memory.ring.damaged = 0xFFFF
    assert memory.turn() and memory.ring.damaged == 0xFFFF
