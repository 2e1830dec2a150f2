"""The panel of parameters in a headless Chromium with a virtual board."""

import itertools

import pytest
from chromium import PALE, program
from waiting import until

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
    panel.until("document.querySelector('#open-groups').textContent === 'Close all'")
    panel.click("#open-groups")
    panel.until(f"{SEEN}.length === 0")
    assert panel.js(f"{GROUPS}.length") == len(titles)


def test_opened_groups_stay_open_when_values_arrive_at_once(panel):
    """Before the browser has told the groups' toggle events. Revert shows the values again."""
    panel.js(
        "document.querySelector('#open-groups').click(), document.querySelector('#revert').click()"
    )
    panel.until("document.querySelector('#open-groups').textContent === 'Close all'")
    assert len(panel.js(SEEN)) == len(firmware.parameters())


@pytest.mark.parametrize(
    "words, wanted",
    [
        ("encoder_counts", {"encoder_counts_rev"}),  # a name
        ("leakage", {"lxy_H"}),
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


# -- sets of parameters --------------------------------------------------------------------


@pytest.fixture
def sets(panel):
    panel.click("#sets summary")
    return panel


def give(page, button: str, file) -> None:
    """Press a button that asks for a file, and choose this one."""
    page.call("Page.setInterceptFileChooserDialog", enabled=True)
    page.click(button)
    root = page.call("DOM.getDocument")["root"]["nodeId"]
    node = page.call("DOM.querySelector", nodeId=root, selector="#set-file")["nodeId"]
    page.call("DOM.setFileInputFiles", files=[str(file)], nodeId=node)


def test_a_file_fills_the_fields_and_nothing_is_sent_before_apply(sets, shared_monitor, tmp_path):
    before = shared_monitor.get("/values")[1]
    file = tmp_path / "mine.toml"
    body = shared_monitor.ask("GET", "/parameters.toml")[2]
    text = body.decode().replace(f"rs_ohm = {before['rs_ohm']}", "rs_ohm = 2.5")
    file.write_text(text.replace(f"lm_H = {before['lm_H']}", "lm_H = 0.75"))
    give(sets, "#set-load", file)
    sets.until("document.querySelector('#apply-text').textContent === '2 changes, all at once'")
    assert sets.js("document.querySelector('.parameter [aria-label=rs_ohm]').value") == "2.5"
    assert {"rs_ohm", "lm_H"} <= set(sets.js(SEEN))  # their group is open
    assert shared_monitor.get("/values")[1] == before
    sets.click("#apply-all")
    sets.until("document.querySelector('#apply').hidden")

    def taken():
        now = shared_monitor.get("/values")[1]
        return (now["rs_ohm"], now["lm_H"]) == (2.5, 0.75)

    until(taken)
    # The same file once more: it is what is in force.
    give(sets, "#set-load", file)
    said = "[...document.querySelectorAll('#toasts p')].map((e) => e.textContent).join()"
    sets.until(f"({said}).includes('none to apply')")
    assert sets.js("document.querySelector('#apply').hidden")


def test_a_wrong_file_is_named_and_nothing_of_it_is_taken(sets, shared_monitor, tmp_path):
    before = shared_monitor.get("/values")[1]
    file = tmp_path / "wrong.toml"
    file.write_text("[parameters]\nlm_H = 0.75\nrs_ohm = 5000\n")
    give(sets, "#set-load", file)
    wrong = "document.querySelector('#set-wrong')"
    sets.until(f"!{wrong}.hidden")
    assert sets.js(f"{wrong}.textContent") == (
        "wrong.toml: rs_ohm = 5000: allowed range is 0 .. 1000 ohm"
    )
    assert sets.js("document.querySelector('#apply').hidden")
    file.write_text("#" * 60000)
    give(sets, "#set-compare", file)
    sets.until(f"{wrong}.textContent.includes('60000 bytes')")
    assert shared_monitor.get("/values")[1] == before
    file.write_text("[parameters]\nlm_H = 0.75\n")
    give(sets, "#set-load", file)
    sets.until("document.querySelector('#apply-text').textContent === '1 change'")
    assert sets.js(f"{wrong}.hidden")
    sets.click("#revert")


ROWS = ("[...document.querySelectorAll('#comparison tbody tr')]"
        ".map((r) => [...r.children].map((c) => c.textContent.trim()))")  # fmt: skip


def test_the_board_is_compared_with_a_file_and_with_the_defaults(sets, shared_monitor, tmp_path):
    file = tmp_path / "other.toml"
    values = shared_monitor.get("/values")[1]
    file.write_text(f"[parameters]\nscheme = 'fdr'\nrs_ohm = {values['rs_ohm']}\nlm_H = 0.75\n")
    give(sets, "#set-compare", file)
    sets.until(f"{ROWS}.length > 0")
    assert sets.js(ROWS) == [["scheme", values["scheme"], "fdr"],
                             ["lm_H H", str(values["lm_H"]), "0.75"]]  # fmt: skip
    heads = sets.js(
        "[...document.querySelectorAll('#comparison thead th')].map(e => e.textContent)"
    )
    assert heads == ["parameter", "board", "other.toml"]
    sets.click("#comparison-close")
    assert firmware.parameters().keys() - sets.js(SEEN)
    assert not sets.js("document.querySelector('#comparison').checkVisibility()")
    sets.click("#set-defaults")
    marked = "[...document.querySelectorAll('.parameter.changed .name')].map((e) => e.textContent)"
    sets.until(f"{ROWS}.length > 2")
    assert {row[0].split()[0] for row in sets.js(ROWS)} == set(sets.js(marked))
    assert sets.js("document.querySelector('#comparison').scrollWidth"
                   " <= document.querySelector('#comparison').clientWidth")  # fmt: skip


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_of_a_comparison_and_of_a_wrong_file_have_contrast(sets, tmp_path, scheme):
    sets.scheme(scheme)
    file = tmp_path / "wrong.toml"
    file.write_text("[parameters]\nrs_ohm = 5000\n")
    give(sets, "#set-load", file)
    sets.until("!document.querySelector('#set-wrong').hidden")
    assert sets.js(PALE) == []
    sets.click("#set-defaults")
    sets.until(f"{ROWS}.length > 2")
    assert sets.js(PALE) == []
