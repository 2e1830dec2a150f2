"""The part of a campaign that `make test` runs: its size, its spread, and that it can be whole."""

from collections import Counter
from itertools import product

import campaigns
import pytest

CASES = list(product("abcdef", (0, 30, 100), (10, -10)))


@pytest.mark.parametrize("number", [1, 6, 7, 13, 35])
def test_a_part_has_the_number_asked_for_and_no_case_twice(number, monkeypatch):
    monkeypatch.setattr(campaigns, "SHARE", 0)
    found = campaigns.part(CASES, number)
    assert len(found) == len(set(found)) == number
    assert set(found) <= set(CASES)
    assert found == campaigns.part(CASES, number)


def test_each_value_of_each_property_occurs_about_equally_often(monkeypatch):
    monkeypatch.setattr(campaigns, "SHARE", 0)
    for number in range(6, len(CASES)):
        part = campaigns.part(CASES, number)
        for values in zip(*part):
            counts = Counter(values)
            assert max(counts.values()) - min(counts.values()) <= 2, number
        assert [len(set(values)) for values in zip(*part)] == [6, 3, 2], number


@pytest.mark.parametrize(("share", "number"), [(1, 1), (0, 36), (0, 99)])
def test_whole_campaigns_and_small_ones_run_every_case(share, number, monkeypatch):
    monkeypatch.setattr(campaigns, "SHARE", share)
    assert campaigns.part(CASES, number) == CASES


def test_a_share_holds_the_small_part_and_its_share_of_the_cases(monkeypatch):
    small = campaigns.spread(CASES, 5)
    monkeypatch.setattr(campaigns, "SHARE", 0.3)
    assert campaigns.part(CASES, 5)[:5] == small
    assert len(campaigns.part(CASES, 5)) == 11 and len(campaigns.part(CASES, 20)) == 20
    assert (campaigns.examples(100), campaigns.examples(4)) == (30, 2)


@pytest.mark.parametrize("text", ["all", "1.5", "-1", "nan"])
def test_a_share_that_is_none_is_refused_with_the_range(text):
    with pytest.raises(SystemExit, match=f"HT_WHOLE={text}: .* from 0 to 1"):
        campaigns.share(text)


@pytest.mark.parametrize(("text", "share"), [("", 0), ("0", 0), ("0.3", 0.3), ("1", 1)])
def test_the_share_that_is_asked_for(text, share):
    assert campaigns.share(text) == share
