"""The part of a campaign that `make test` runs: its size, its spread, and that it can be whole."""

from collections import Counter
from itertools import product

import campaigns
import pytest

CASES = list(product("abcdef", (0, 30, 100), (10, -10)))


@pytest.mark.parametrize("number", [1, 6, 7, 13, 35])
def test_a_part_has_the_number_asked_for_and_no_case_twice(number, monkeypatch):
    monkeypatch.setattr(campaigns, "WHOLE", False)
    found = campaigns.part(CASES, number)
    assert len(found) == len(set(found)) == number
    assert set(found) <= set(CASES)
    assert found == campaigns.part(CASES, number)


def test_each_value_of_each_property_occurs_about_equally_often(monkeypatch):
    monkeypatch.setattr(campaigns, "WHOLE", False)
    for number in range(6, len(CASES)):
        part = campaigns.part(CASES, number)
        for values in zip(*part):
            counts = Counter(values)
            assert max(counts.values()) - min(counts.values()) <= 2, number
        assert [len(set(values)) for values in zip(*part)] == [6, 3, 2], number


@pytest.mark.parametrize(("whole", "number"), [(True, 1), (False, 36), (False, 99)])
def test_whole_campaigns_and_small_ones_run_every_case(whole, number, monkeypatch):
    monkeypatch.setattr(campaigns, "WHOLE", whole)
    assert campaigns.part(CASES, number) == CASES
