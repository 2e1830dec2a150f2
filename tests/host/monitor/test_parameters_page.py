"""The panel of parameters in a headless Chromium with a virtual board."""

import itertools

import pytest
from chromium import program

from hexatorque import firmware

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

GROUPS = "[...document.querySelectorAll('#parameters details')]"
#: Names of the parameters that one can see.
SEEN = ("[...document.querySelectorAll('.parameter')].filter((e) => e.checkVisibility())"
        ".map((e) => e.querySelector('.name').textContent)")  # fmt: skip


@pytest.fixture
def panel(page):
    page.click("[data-panel=parameters]")
    return page


def test_parameters_are_in_the_groups_of_the_table(panel):
    titles = panel.js(f"{GROUPS}.map((e) => e.querySelector('summary span').textContent)")
    members = panel.js(f"{GROUPS}.map((g) => [...g.querySelectorAll('.name')]"
                       ".map((e) => e.textContent))")  # fmt: skip
    every = firmware.parameters()
    assert dict(zip(titles, members)) == firmware.grouped(every)
    assert sorted(itertools.chain(*members)) == sorted(every)
    assert len(titles) > 5 and max(map(len, members)) < len(every) / 4
    # The first group is open, the others are titles.
    assert panel.js(SEEN) == members[0]


def test_a_group_opens_by_mouse_and_by_key(panel):
    titles = list(firmware.grouped(firmware.parameters()))
    first, second = (names for names in list(firmware.grouped(firmware.parameters()).values())[:2])
    panel.click("#parameters details:nth-of-type(2) summary")
    panel.until(f"{SEEN}.length === {len(first) + len(second)}")
    panel.key("Enter", "Enter", "\r")  # the title has the focus
    panel.until(f"{SEEN}.length === {len(first)}")
    panel.click("#open-groups")
    panel.until(f"{SEEN}.length === {len(firmware.parameters())}")
    assert panel.js("document.querySelector('#open-groups').textContent") == "Close all"
    panel.click("#open-groups")
    panel.until(f"{SEEN}.length === 0")
    assert panel.js(f"{GROUPS}.length") == len(titles)


@pytest.mark.parametrize(
    "words, wanted",
    [
        ("encoder_counts", {"encoder_counts_rev"}),  # a name
        ("leakage", set()),
        ("transient inductance", {"sigma_ls_H"}),  # of the help text, in any order
        ("INDUCTANCE transient", {"sigma_ls_H"}),
        ("n m s/rad", {"kp_speed_Nms_rad"}),  # a unit
        ("least-loss", {"ride_through"}),  # a choice
    ],
)
def test_the_search_opens_what_it_finds(panel, words, wanted):
    before = panel.js(SEEN)
    panel.type("#search", words)
    assert set(panel.js(SEEN)) == wanted
    assert panel.js("document.querySelector('#none-found').checkVisibility()") == (not wanted)
    # Afterwards only what the user had opened is open.
    panel.type("#search", "")
    panel.js("document.querySelector('#search').dispatchEvent(new Event('input'))")
    assert panel.js(SEEN) == before


def test_a_title_counts_what_has_changed(panel, shared_monitor):
    title = "document.querySelector('#parameters details:has([aria-label=rs_ohm]) small')"
    panel.type("#search", "rs_ohm")
    before = shared_monitor.get("/values")[1]["rs_ohm"]
    default = firmware.parameters()["rs_ohm"].initial
    changed = f"{title}.textContent.includes('changed')"
    panel.type(".parameter [aria-label=rs_ohm]", str(default + 0.5))
    assert "1 not applied" in panel.js(f"{title}.textContent")
    panel.key("Enter", "Enter", "\r")
    panel.until(f"{changed} && !{title}.textContent.includes('not applied')")
    panel.click("#only-changed")
    assert "rs_ohm" in panel.js(SEEN)
    shared_monitor.post("/write", {"values": {"rs_ohm": before}})


def test_a_whole_number_is_asked_for(panel):
    panel.type("#search", "pole_pairs")
    panel.type(".parameter [aria-label=pole_pairs]", "2.5")
    assert panel.js("document.querySelector('#apply-all').disabled")
    said = panel.js("document.querySelector('#apply-text').textContent")
    assert said == "pole_pairs: allowed: 1 … 64, whole numbers only"
    panel.click("#revert")
