"""The guided commissioning on the page in a headless Chromium."""

import re
import tomllib

import pytest
from chromium import PALE, program
from waiting import until

from hexatorque import setups
from hexatorque.commissioning.kinds import INDUCTION
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.monitor import monitored_drive
from hexatorque.monitor.guided import Guided

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

GUIDE_STATE = "document.querySelector('#guide-state').textContent"
ENDED = "document.querySelector('#guide-result').checkVisibility()"
#: Words of the guide that lie on others, or not whole inside it.
CROWDED = """(() => {
  const guide = document.querySelector('.guide').getBoundingClientRect();
  const range = document.createRange();
  const boxes = [];
  const words = document.createTreeWalker(document.querySelector('.guide'), NodeFilter.SHOW_TEXT);
  for (let node; (node = words.nextNode());) {
    if (!node.textContent.trim() || !node.parentElement.checkVisibility()) continue;
    if (node.parentElement.closest('#guide-bar, option')) continue;  // it lies on what is scrolled
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) boxes.push([node.textContent, r]);
  }
  const wrong = [];
  boxes.forEach(([a, p], i) => {
    if (p.left < guide.left || p.right > guide.right) wrong.push(`outside: ${a}`);
    for (const [b, q] of boxes.slice(i + 1)) {
      const wide = Math.min(p.right, q.right) - Math.max(p.left, q.left);
      const high = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
      if (wide > 1 && high > 3) wrong.push(`${a} on ${b}`);
    }
  });
  return wrong;
})()"""

#: Pixels of each picture of a step in the colour of the samples, and in that of the fit.
INKED = """[...document.querySelectorAll('#step-%s canvas')].flatMap((canvas) => {
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const style = getComputedStyle(document.documentElement);
  return [0, 1].map((n) => {
    const colour = parseInt(style.getPropertyValue(`--trace-${n}`).trim().slice(1), 16);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) {
      count += data[i] * 65536 + data[i + 1] * 256 + data[i + 2] === colour && data[i + 3] === 255;
    }
    return count;
  });
})"""


@pytest.fixture
def page(browser, site):
    browser.events.clear()
    page = browser.open(site.server.url, wide=1024, high=768)
    page.until("document.body.dataset.state === 'idle'")
    page.click("#see-guide")
    yield page
    page.close()


def readable(page) -> None:
    assert page.js(CROWDED) == []
    for scheme in ("dark", "light"):
        page.scheme(scheme)
        assert page.js(PALE) == []


def press(page, selector: str) -> None:
    """With the keyboard."""
    page.js(f"document.querySelector({selector!r}).focus()")
    page.key("Enter", "Enter", "\r")


def test_the_guide_leads_through_all_steps(page, site, monkeypatch):
    """On a simulated drive, which does not take its time as a board does. Its controller knows the
    stator's resistance badly."""
    setup = setups.load("paper-b").changed(load__kind="friction", controller__rs_ohm=7.5)
    sim = SimulatedDrive(setup, 2)
    sim.load_Nm = 0.1
    sim.hello = site.monitored.drive.hello
    monkeypatch.setattr(monitored_drive, "Guided", lambda _, *rest: Guided(sim, *rest))
    dead_man = site.monitored.dead_man
    dead_man.silent_s = dead_man.hidden_s = 600.0  # the simulation delays the page
    readable(page)
    press(page, "#guide-begin")
    for step in list(INDUCTION.steps)[:3]:
        page.until(f"({GUIDE_STATE}).includes('{step}: waits for you')")
        assert sim.state == "idle"
        plan = page.js(f"document.querySelector('#step-{step} dl').innerText")
        assert re.search(r"up to \d+ V on a leg\n.*\n.* A.*; the gates go off", plan), plan
        assert "stands still" in plan
        press(page, "#guide-go")
    page.until(f"({GUIDE_STATE}).includes('encoder: waits for you')")
    readable(page)
    assert "TURNS" in page.js("document.querySelector('#step-encoder dl').innerText")
    assert page.js("document.activeElement.id") == "step-encoder"
    press(page, "#step-encoder .row button:last-child")  # run on
    page.until(ENDED)
    assert page.js(GUIDE_STATE) == "All steps are done"
    for step in INDUCTION.steps:
        inked = page.js(INKED % step)
        assert inked and min(inked) > 5, step
    rows = page.js(
        "Object.fromEntries([...document.querySelectorAll('#guide-result tbody tr')].map((row) =>"
        "[row.cells[0].textContent.split(' ')[0],"
        "[1, 2, 3].map((k) => Number(row.cells[k].textContent))]))"
    )
    measured, doubt, before = rows["rs_ohm"]
    assert measured == pytest.approx(sim.machine.rs_ohm, abs=2 * doubt) and before == 7.5
    assert sim.get("rs_ohm") == 7.5
    readable(page)
    text = page.js("fetch(document.querySelector('#guide-save').href).then((r) => r.text())")
    written = tomllib.loads(text)["machine"]
    assert written["rs_ohm"]["tag"] == "measured"
    assert written["inertia_kgm2"]["value"] == pytest.approx(sim.machine.inertia_kgm2, rel=0.05)
    press(page, "#guide-write")
    page.until("document.querySelector('#guide-write').textContent === 'Written'")
    assert sim.get("rs_ohm") == pytest.approx(measured, rel=1e-3)
    assert page.complaints() == []


def test_stop_in_a_step_takes_the_gates_off_and_says_so(page, site, board):
    page.type("#guide-form [name=travel]", "100")  # the brake of this board does not hold it
    press(page, "#guide-begin")
    page.until("document.querySelector('#guide-go')")
    press(page, "#guide-go")
    until(lambda: board.working)
    page.until("document.body.dataset.working === 'true'")
    page.key(" ", "Space", " ")  # between two tests the gates are off, and it stops then, too
    page.until(ENDED)
    assert not board.working
    assert page.js(GUIDE_STATE) == "Stopped"
    said = page.js("document.querySelector('#guide-result').innerText")
    assert "stopped by the user" in said and "Write" not in said
    assert site.monitored.drive.get("start_mode") == "drive"
    press(page, "#guide-again")
    assert page.js("document.querySelector('#guide-form').checkVisibility()")
    assert page.complaints() == []
