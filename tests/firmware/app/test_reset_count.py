"""How often a watchdog has started the board: a count in memory that no start clears. It
holds anything after power-on."""

import pytest

from hexatorque.firmware import ffi, lib

DOGS = (lib.HT_RESET_WATCHDOG, lib.HT_RESET_NMI)


def memory(count=None):
    """As a start leaves it with this count, or as power-on may leave it."""
    m = ffi.new("ht_reset_memory *", {"word": 0x12345678, "inverse": 0x9ABCDEF0})
    lib.ht_reset_count(m, lib.HT_RESET_POWER)
    if count is not None:
        m.word = (m.word & 0xFFFF0000) | count
        m.inverse = m.word ^ 0xFFFFFFFF
    return m


@pytest.mark.parametrize("cause", range(lib.HT_RESETS))
def test_each_start_by_a_watchdog_counts_one(cause):
    m = memory()
    told = [lib.ht_reset_count(m, cause) for _ in range(5)]
    assert [one.cause for one in told] == [cause] * 5
    assert [one.watchdogs for one in told] == ([1, 2, 3, 4, 5] if cause in DOGS else [0] * 5)


def test_other_causes_keep_the_count_and_power_on_clears_it():
    m = memory(7)
    assert lib.ht_reset_count(m, lib.HT_RESET_PIN).watchdogs == 7
    assert lib.ht_reset_count(m, lib.HT_RESET_WATCHDOG).watchdogs == 8
    assert lib.ht_reset_count(m, lib.HT_RESET_POWER).watchdogs == 0
    assert lib.ht_reset_count(m, lib.HT_RESET_NMI).watchdogs == 1


def test_the_count_ends_at_65535():
    m = memory(0xFFFE)
    told = [lib.ht_reset_count(m, lib.HT_RESET_WATCHDOG).watchdogs for _ in range(3)]
    assert told == [0xFFFF] * 3


@pytest.mark.parametrize("word", ["word", "inverse"])
@pytest.mark.parametrize("bit", range(32))
def test_a_memory_with_a_wrong_bit_has_no_count(word, bit):
    m = memory(7)
    setattr(m, word, getattr(m, word) ^ (1 << bit))
    assert lib.ht_reset_count(m, lib.HT_RESET_PIN).watchdogs == 0


@pytest.mark.parametrize("mark", [0x0000, 0x5A16, 0x5A18, 0xFFFF])
def test_a_memory_without_the_mark_has_no_count_even_if_its_inverse_fits(mark):
    word = mark << 16 | 7
    m = ffi.new("ht_reset_memory *", {"word": word, "inverse": word ^ 0xFFFFFFFF})
    assert lib.ht_reset_count(m, lib.HT_RESET_PIN).watchdogs == 0


def test_a_cause_that_is_none_is_not_described():
    assert lib.ht_reset_describe(lib.HT_RESETS) == ffi.NULL
    assert lib.ht_reset_describe(lib.HT_RESETS - 1) != ffi.NULL
