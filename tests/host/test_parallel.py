"""Work in threads: the results' order, and its end after an error."""

import threading
import time

import pytest

from hexatorque import parallel


def test_results_are_in_the_order_of_the_items():
    def late(n):
        time.sleep(0.02 * (n % 3 == 0))
        return n

    assert parallel.each(late, range(12), jobs=4) == list(range(12))


def test_items_run_at_once():
    meeting = threading.Barrier(3, timeout=10)
    assert sorted(parallel.each(lambda _: meeting.wait(), range(3), jobs=3)) == [0, 1, 2]


def test_results_come_before_the_last_item_is_done():
    last = threading.Event()

    def wait_for_the_first(n):
        return n if n == 0 else last.wait(10)

    results = parallel.in_order(wait_for_the_first, [0, 1], jobs=2)
    assert next(results) == 0
    last.set()
    assert list(results) == [True]


def test_after_an_error_nothing_more_is_started():
    begun = []

    def fail(n):
        begun.append(n)
        raise ArithmeticError("no")

    with pytest.raises(ArithmeticError):
        parallel.each(fail, range(1000), jobs=1)
    assert len(begun) < 1000
    at_the_end = len(begun)
    time.sleep(0.05)
    assert len(begun) == at_the_end


def test_what_is_under_way_is_left_alone_if_asked():
    ends = threading.Event()

    def fail_or_hang(n):
        if n == 0:
            raise ArithmeticError("no")
        ends.wait(10)

    with pytest.raises(ArithmeticError):
        list(parallel.in_order(fail_or_hang, range(2), jobs=2, wait=False))
    assert not ends.is_set()
    ends.set()
