"""The parameter store on a memory that cannot be read, that refuses a write or that keeps something
else. Whatever fails: a start takes the saved set, the new one or the built-in one, and says which.
(Power that fails, and damage: tests/c/test_store.c.)

A copy is also made here, from its definition in ht_store.h."""

import struct
import zlib

import pytest

from hexatorque.firmware import Controller, MemoryStore, ffi, lib

BUILT_IN = {"rs_ohm": 1.5}
SAVED, NEW = 1.75, 2.25


class Memory(MemoryStore):
    """Counts what is done. The operations whose numbers are in `bad`, from 1 on, fail."""

    def __init__(self, areas=None, bad_reads=(), bad_writes=(), lost_writes=()):
        super().__init__(areas)
        self.bad_reads, self.bad_writes, self.lost_writes = bad_reads, bad_writes, lost_writes
        self.reads = self.writes = 0

    def _do_read(self, at, area, block, words):
        self.reads += 1
        super()._do_read(at, area, block, words)
        return self.reads not in self.bad_reads

    def put(self, begin, raw):
        self.writes += 1
        if self.writes in self.lost_writes:
            return True  # so it says
        return super().put(begin, raw) and self.writes not in self.bad_writes


def started(memory, **values):
    return Controller("f28377s", BUILT_IN | values, store=memory)


def saved(value=SAVED):
    memory = Memory()
    assert lib.ht_store_save(memory.handle, started(memory, rs_ohm=value).drive) == lib.HT_OK
    return memory


def save_new(memory, **fails):
    """The result of a save of another value. The memory fails like this after the start."""
    controller = started(memory)
    controller.set("rs_ohm", NEW)
    memory.reads = memory.writes = 0
    for name, value in fails.items():
        setattr(memory, name, value)
    return lib.ht_store_save(memory.handle, controller.drive)


def what_counts(areas):
    """The value that a start takes, and from where."""
    controller = started(Memory(bytearray(areas)))
    return controller.get("rs_ohm"), controller.parameter_set


def test_a_start_survives_any_block_that_cannot_be_read():
    areas = saved().areas
    whole = Memory(bytearray(areas))
    assert started(whole).get("rs_ohm") == SAVED
    seen = set()
    for bad in range(1, whole.reads + 1):
        controller = started(Memory(bytearray(areas), bad_reads=(bad,)))
        seen.add((controller.get("rs_ohm"), controller.parameter_set))
    # A copy that cannot be read gives way to the other one; in the end the values are read once
    # more, and what fails then has no other one.
    assert seen == {(SAVED, "saved"), (BUILT_IN["rs_ohm"], "built-in: the saved set is damaged")}


def test_nothing_can_be_read():
    for areas in (saved().areas, Memory().areas):
        controller = started(Memory(bytearray(areas), bad_reads=range(10000)))
        assert controller.get("rs_ohm") == BUILT_IN["rs_ohm"]
        assert controller.parameter_set == "built-in: the saved set is damaged"


@pytest.mark.parametrize("kind", ["bad_reads", "bad_writes", "lost_writes"])
def test_a_save_that_fails_says_so_and_leaves_a_whole_set(kind):
    before = saved().areas
    good = Memory(bytearray(before))
    assert save_new(good) == lib.HT_OK
    count = good.reads if kind == "bad_reads" else good.writes
    results = []
    for bad in range(1, count + 1):
        memory = Memory(bytearray(before))
        result = save_new(memory, **{kind: (bad,)})
        value, origin = what_counts(memory.areas)
        assert origin == "saved" and value in (SAVED, NEW)
        assert value == NEW or result == lib.HT_ERROR_STORE
        results.append(result)
    assert results[-1] == lib.HT_ERROR_STORE  # the last one is that of a mark


def test_a_memory_that_cannot_be_read_at_all_is_none():
    memory = Memory()
    memory.handle.port.read = ffi.NULL
    controller = started(memory)
    assert controller.parameter_set == "built-in"
    assert lib.ht_store_save(memory.handle, controller.drive) == lib.HT_ERROR_STORE
    assert memory.writes == 0


class Stuck(Memory):
    """One bit of it keeps its value."""

    at, bit, value = 0, 1, 0

    def put(self, begin, raw):
        done = super().put(begin, raw)
        self.areas[self.at] &= 0xFF ^ self.bit
        self.areas[self.at] |= self.bit * self.value
        return done


@pytest.mark.parametrize("value", (0, 1))
def test_a_save_into_memory_with_a_dead_cell_says_so(value):
    """Unless the cell has the value that it is to have."""
    before = saved().areas
    good = Memory(bytearray(before))
    assert save_new(good) == lib.HT_OK
    whole = bytes(good.areas)
    used = Memory.BLOCK * block_count(lib.ht_param_count())
    for n, at in enumerate(range(0, Memory.LOG, 3)):
        if at % Memory.AREA >= used:
            continue
        bit = 1 << n % 8
        result = save_new(Stuck(bytearray(before)), at=at, bit=bit, value=value)
        fits = bool(whole[at] & bit) == value
        assert result == (lib.HT_OK if fits else lib.HT_ERROR_STORE), at


def test_a_forget_that_fails_says_so():
    areas = saved().areas
    for failure in ({"bad_writes": (1,)}, {"bad_writes": (2,)}, {"lost_writes": (1,)},
                    {"lost_writes": (2,)}):  # fmt: skip
        memory = Memory(bytearray(areas))
        controller = started(memory)
        memory.reads = memory.writes = 0
        for name, bad in failure.items():
            setattr(memory, name, bad)
        assert lib.ht_store_forget(memory.handle, controller.drive) == lib.HT_ERROR_STORE
    memory = Memory(bytearray(areas))
    assert lib.ht_store_forget(memory.handle, started(memory).drive) == lib.HT_OK
    assert what_counts(memory.areas) == (BUILT_IN["rs_ohm"], "built-in")


# --- copies made by hand ------------------------------------------------------------------------


def block_count(count):
    return 2 + -(-count // 4)


def copy(values, table, sequence=7, magic=b"HT", layout=1, count=None):
    """The bytes of a copy; by the definition, a block has 16 of them."""
    head = magic + b"PS" + struct.pack("<HHII", layout, count or len(values), table, sequence)
    body = head + struct.pack(f"<{len(values)}f", *values)
    body += bytes(-len(body) % 16)
    crc = zlib.crc32(body)
    mark = struct.pack("<IIHHHH", crc, crc ^ 0xFFFFFFFF, 0x5AA5, 0xC33C, 0x0FF0, 0x9669)
    return body + mark


def areas_with(first, second=b""):
    return bytearray(first.ljust(Memory.AREA, b"\xff") + second.ljust(Memory.AREA, b"\xff"))


@pytest.fixture(scope="module")
def present():
    """Values, version of the table, and areas as the firmware has written them."""
    areas = saved().areas
    count, table = struct.unpack_from("<HI", areas, 6)
    return list(struct.unpack_from(f"<{count}f", areas, 16)), table, areas


def test_a_copy_is_what_its_definition_says(present):
    values, table, areas = present
    made = copy(values, table, sequence=struct.unpack_from("<I", areas, 12)[0])
    assert len(made) == 16 * block_count(len(values))
    assert bytes(areas[: len(made)]) == made


def test_the_tables_version_is_a_sum_of_what_gives_values_their_meaning(present):
    told = b""
    for id in range(lib.ht_param_count()):
        row = lib.ht_param_describe(id)
        told += b"".join(ffi.string(text) + b"\0" for text in (row.name, row.unit, row.choices))
    assert present[1] == zlib.crc32(told)


def test_a_set_of_another_firmware_is_not_taken(present):
    values, table, _ = present
    for other in (
        copy(values[:-1], table),
        copy(values + [0.0], table),
        copy(values[:-4], table),
        copy(values, table ^ 1),
    ):
        assert what_counts(areas_with(other)) == (
            BUILT_IN["rs_ohm"], "built-in: the saved set is of another firmware or board",
        )  # fmt: skip
    assert what_counts(areas_with(copy(values, table))) == (SAVED, "saved")


def test_what_is_no_copy_is_damage(present):
    values, table, _ = present
    damaged = (BUILT_IN["rs_ohm"], "built-in: the saved set is damaged")
    many = 4 * lib.HT_STORE_FILE_BLOCKS
    for other in (
        copy(values, table, magic=b"HS"),
        copy(values, table, layout=2),
        copy(values, table, count=many),  # as many as an area has room for, without head and mark
        copy(values, table, count=many + 1),
        copy(values, table, count=65535),
        b"HT" + b"PT" + copy(values, table)[4:],
    ):
        assert what_counts(areas_with(other)) == damaged
        assert what_counts(areas_with(b"", other)) == damaged


def test_an_area_is_blank_only_if_every_block_is(present):
    """A power failure may leave an erase undone at any place. What is left must be told: there was
    a saved set."""
    values, table, _ = present
    whole = copy(values, table)
    for begin in range(0, len(whole), Memory.BLOCK):
        end = begin + Memory.BLOCK
        left = b"\xff" * begin + whole[begin:end]
        for areas in (areas_with(left), areas_with(b"", left)):
            assert what_counts(areas) == (
                BUILT_IN["rs_ohm"], "built-in: the saved set is damaged",
            ), begin  # fmt: skip
    assert what_counts(areas_with(b"")) == (BUILT_IN["rs_ohm"], "built-in")


def test_of_two_copies_the_later_one_counts(present):
    values, table, _ = present
    rs = values.index(SAVED)
    newer = [*values]
    newer[rs] = NEW
    for first, second, taken in ((7, 8, NEW), (8, 7, SAVED), (7, 7, SAVED), (2**32 - 1, 0, NEW),
                                 (0, 2**32 - 1, SAVED), (0, 2**31, SAVED)):  # fmt: skip
        areas = areas_with(copy(values, table, first), copy(newer, table, second))
        assert what_counts(areas) == (taken, "saved")


@pytest.mark.parametrize(
    ("sequences", "latest"),
    [((7, 3), 7), ((3, 7), 7), ((8, 7), 8), ((7, 8), 8), ((2**32 - 1, 5), 5), ((None, 7), 7)],
)
def test_a_save_is_later_than_both_copies(present, sequences, latest):
    """Else the one that it replaces would count after a power failure between its two writes."""
    values, table, _ = present
    made = [b"" if n is None else copy(values, table, n) for n in sequences]
    memory = Memory(areas_with(*made))
    controller = started(memory)
    controller.set("rs_ohm", NEW)
    assert lib.ht_store_save(memory.handle, controller.drive) == lib.HT_OK
    places = (12, Memory.AREA + 12)
    found = {struct.unpack_from("<I", memory.areas, place)[0] for place in places}
    assert found == {latest + 1}


def test_a_memory_that_is_too_small_is_none():
    memory = Memory()
    controller = started(memory)
    memory.handle.port.blocks = block_count(lib.ht_param_count()) - 1
    assert lib.ht_store_save(memory.handle, controller.drive) == lib.HT_ERROR_STORE
    params = ffi.new("ht_params *")
    assert lib.ht_store_load(memory.handle, params) == lib.HT_SET_DEFAULTS
    assert memory.reads > 0 and memory.writes == 0
