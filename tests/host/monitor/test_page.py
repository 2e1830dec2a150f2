"""The page in a headless Chromium with a virtual board: the tests act as a user would."""

import itertools
import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from chromium import CUT_OFF, PALE, program
from waiting import WAIT_S, until

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

#: A checksum of the pixels that a plot has drawn. It changes when the traces move.
INKED = """(() => {
  const canvas = document.querySelectorAll('#plots canvas')[%d];
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let sum = 0;
  for (let i = 3; i < pixels.length; i += 4) if (pixels[i]) sum = (sum * 31 + i) %% 1000000007;
  return sum;
})()"""
STATE = "document.body.dataset.state"
SPEED = "Number(document.querySelector('[data-figure=speed_rpm]').textContent.replace('−', '-'))"
QUICK_SPEED = "#quick input[aria-label=speed_ref_rpm]"


@pytest.fixture
def monitor(shared_monitor):
    """The same for all tests of this file, so none may end it."""
    return shared_monitor


def tab(page, name: str) -> None:
    page.click(f"[data-panel={name}]")
    if name == "parameters":
        page.click("#open-groups")
        page.until("document.querySelector('#open-groups').textContent === 'Close all'")


def start(page) -> None:
    page.until("!document.querySelector('#start').disabled")
    page.click("#start")
    page.until(f"{STATE} === 'run'")


def tried(act, done) -> bool:
    """Act until it is done, thrice at most. On a busy computer the board's answer may come too
    late. Then the page says so, and its user tries again."""
    for _ in range(3):
        act()
        end = time.monotonic() + 6
        while time.monotonic() < end:
            if done():
                return True
            time.sleep(0.05)
    return False


def inked(page, plot: int) -> int:
    return page.js(INKED % plot)


def test_start_speed_traces_stop(page, monitor):
    assert "token" not in page.js("location.href")
    page.choose("#window", "1")
    start(page)
    page.type(QUICK_SPEED, "500")
    page.key("Enter", "Enter", "\r")
    page.until(f"Math.abs({SPEED} - 500) < 15")
    # The traces of the phase currents move. On a paused page they do not, though samples come in.
    plots = page.js("[...document.querySelectorAll('.plot .unit')].map(e => e.textContent)")
    currents = plots.index("A")
    before = inked(page, currents)
    page.until(f"({INKED % currents}) !== {before}")
    page.click("#pause")
    time.sleep(0.3)
    before = inked(page, currents)
    time.sleep(0.5)
    assert inked(page, currents) == before
    page.click("#pause")
    page.until(f"({INKED % currents}) !== {before}")
    page.choose("#quick select[aria-label=scheme]", "fdr")
    end = time.monotonic() + WAIT_S
    while monitor.get("/values")[1]["scheme"] != "fdr":
        assert time.monotonic() < end
    page.click("#stop")
    page.until(f"{STATE} === 'idle'")
    page.until(f"Math.abs({SPEED}) < 250")
    assert page.complaints() == []
    requests = page.requests()
    assert requests and all(url.startswith(f"http://{monitor.host}/") for url in requests)


#: Keys that stop the drive, and where the focus is.
STOPPED_BY = (
    ("Escape", "Escape", "document.activeElement.blur()"),
    ("Escape", "Escape", f"document.querySelector('{QUICK_SPEED}').focus()"),
    ("Escape", "Escape", "document.querySelector('#window').focus()"),
    (" ", "Space", "document.activeElement.blur()"),
    (" ", "Space", "document.querySelector('#start').focus()"),
    (" ", "Space", "document.querySelector('#record').focus()"),
)


def test_a_key_stops_the_drive_wherever_the_focus_is(page):
    for key, code, where in STOPPED_BY:
        start(page)
        page.js(where)
        page.key(key, code, key if key == " " else "")
        page.until(f"{STATE} === 'idle'")
        time.sleep(0.3)
        # The key did not also press the button that has the focus.
        assert page.js(STATE) == "idle", (key, where)
        recording = page.js("document.querySelector('#record').getAttribute('aria-pressed')")
        assert recording == "false", (key, where)


def test_stop_can_be_hit_at_any_size(page):
    for wide, high in ((1400, 900), (1024, 700), (420, 800), (360, 560)):
        page.size(wide, high, mobile=wide < 500)
        page.js("window.scrollTo(0, 600)")
        time.sleep(0.1)
        assert page.js(
            "(() => { const r = document.querySelector('#stop').getBoundingClientRect();"
            "const hit = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2);"
            "return hit.closest('#stop') !== null && r.width >= 100 && r.height >= 44 })()"
        ), (wide, high)
        assert page.js("document.documentElement.scrollWidth <= innerWidth"), (wide, high)
        assert not page.js("document.querySelector('#stop').disabled")


def test_parameters_are_searched_checked_and_set_together(page, monitor):
    tab(page, "parameters")
    rows = "[...document.querySelectorAll('.parameter')].filter(e => !e.hidden)"
    count = page.js(f"{rows}.length")
    assert count == len(monitor.get("/device")[1]["parameters"])
    page.type("#search", "flux trip")
    assert 0 < page.js(f"{rows}.length") < count
    page.type("#search", "")
    page.type(".parameter [aria-label=torque_limit_Nm]", "1e9")
    page.type(".parameter [aria-label=kp_speed_Nms_rad]", "0.123")
    assert page.js("document.querySelector('#apply-all').disabled")
    assert "10000" in page.js("document.querySelector('#apply-text').textContent")
    before = monitor.get("/values")[1]
    page.type(".parameter [aria-label=torque_limit_Nm]", "4.5")
    assert "2 changes" in page.js("document.querySelector('#apply-text').textContent")
    page.key("Enter", "Enter", "\r")
    page.until("document.querySelector('#apply').hidden")
    end = time.monotonic() + WAIT_S
    while (now := monitor.get("/values")[1]) == before:
        assert time.monotonic() < end
    changed = {name: value for name, value in now.items() if value != before[name]}
    assert changed == {"torque_limit_Nm": 4.5, "kp_speed_Nms_rad": pytest.approx(0.123)}
    # A value that another client sets appears in the field.
    monitor.post("/write", {"values": {name: before[name] for name in changed}})
    limit = "document.querySelector('.parameter [aria-label=torque_limit_Nm]').value"
    page.until(f"Number({limit}) === {before['torque_limit_Nm']}")
    # While the gates are on, parameters that need them off cannot be edited.
    locked = "document.querySelector('.parameter [aria-label=dead_time_us]').disabled"
    assert not page.js(locked)
    start(page)
    page.until(locked)
    page.click("#stop")


def test_numbers_as_people_write_them(page, monitor):
    """A decimal comma and the minus sign of word processors are accepted."""
    before = monitor.get("/values")[1]["speed_ref_rpm"]
    for text, number in (("250,5", 250.5), ("−12,25", -12.25), ("–3.5", -3.5), (" 1e2 ", 100),
                         ("1,000", 1), (",5", 0.5), ("-0", 0)):  # fmt: skip

        def enter(text=text):
            page.type(QUICK_SPEED, text)
            page.key("Enter", "Enter", "\r")

        def taken(number=number):
            return monitor.get("/values")[1]["speed_ref_rpm"] == number

        assert tried(enter, taken), text
        page.until(f"Number(document.querySelector('{QUICK_SPEED}').value) === {number}")
    page.until(f"document.querySelector('{QUICK_SPEED}').value === '0'")  # the board's answer
    tab(page, "parameters")
    field = ".parameter [aria-label=speed_ref_rpm]"
    for text in ("1.000,5", "1,000,000", "1 000", "0x10", "1e", "-", "", "Infinity", "12 r/min"):
        page.type(field, text)
        assert page.js("document.querySelector('#apply-all').disabled"), text
        said = page.js("document.querySelector('#apply-text').textContent")
        assert "speed_ref_rpm: a number is needed" in said and "thousands" in said, text
    page.click("#revert")
    monitor.post("/write", {"values": {"speed_ref_rpm": before}})


def test_numbers_are_read_as_python_reads_them(page):
    """Python is tried with the same texts (test_keys.py)."""
    cases = json.loads((Path(__file__).parents[1] / "numbers.json").read_text(encoding="utf-8"))
    texts = [*cases["numbers"], *cases["no numbers"], *cases["not finite"]]
    read = page.js(
        f"import('/numbers.js').then(({{ parse }}) => {json.dumps(texts)}.map((text) => "
        "Number.isNaN(parse(text)) ? null : parse(text)))"
    )
    others = len(cases["no numbers"]) + len(cases["not finite"])
    assert read == [*cases["numbers"].values(), *(None,) * others]


def test_a_number_that_is_zero_has_no_sign(page):
    shown = (
        "import('/numbers.js').then(({ show }) => [-0, -1e-9, 0, -0.04, -1.5].map((v) => show(v)))"
    )
    assert page.js(shown) == ["0.000", "−1.00e−9".replace("e−", "e-"), "0.000", "−0.040", "−1.500"]


def test_parameters_that_differ_from_their_default_are_marked(page, monitor):
    rows = monitor.get("/device")[1]["parameters"]
    values = monitor.get("/values")[1]

    def differs(row) -> bool:
        standard = row["choices"][int(row["initial"])] if row["choices"] else row["initial"]
        return values[row["name"]] != standard

    tab(page, "parameters")
    marked = ("[...document.querySelectorAll('.parameter.changed')]"
              ".map(e => e.querySelector('.name').textContent).sort()")  # fmt: skip
    wanted = sorted(row["name"] for row in rows if differs(row))
    page.until(f"JSON.stringify({marked}) === JSON.stringify({wanted})")
    row = next(row for row in rows if row["name"] == "torque_limit_Nm")
    values["torque_limit_Nm"] = row["initial"] if differs(row) else row["initial"] / 2
    monitor.post("/write", {"values": {"torque_limit_Nm": values["torque_limit_Nm"]}})
    wanted = sorted(row["name"] for row in rows if differs(row))
    page.until(f"JSON.stringify({marked}) === JSON.stringify({wanted})")
    page.click("#only-changed")
    shown = "[...document.querySelectorAll('.parameter')].filter(e => !e.hidden).length"
    assert page.js(shown) == len(wanted)


def test_the_boards_refusal_is_shown(page):
    """Only the board can tell that these parameters do not fit together."""
    tab(page, "parameters")
    page.type(".parameter [aria-label=vdc_min_V]", "399")
    page.type(".parameter [aria-label=vdc_max_V]", "200")
    page.until("document.querySelector('#apply-text').textContent.startsWith('2 changes')")
    said = "[...document.querySelectorAll('#toasts .bad')].map(e => e.textContent).join()"

    def refused():
        return page.js(f"({said}).includes('fit together')")

    assert tried(lambda: page.key("Enter", "Enter", "\r"), refused), page.js(said)
    assert "2 changes" in page.js("document.querySelector('#apply-text').textContent")
    page.click("#revert")


def test_traces_are_chosen(page):
    tab(page, "channels")
    for name in ("vdc_V", "psi_alpha_Wb", "psi_beta_Wb"):
        page.click(f"#channels input[value={name}]")  # does not wait for the next status
    page.click("#channels input[value=scheme]")
    # A channel whose values have names shows the name.
    page.until("document.querySelector('.chip [data-channel=scheme]')?.textContent === 'dtc1'")
    plots = page.js("[...document.querySelectorAll('.plot .unit')].map(e => e.textContent)")
    assert plots == ["r/min", "N m", "A", "–"]


def test_cursor_zoom_and_fixed_scale(page):
    time.sleep(1.0)
    x, y, wide, high = page.js(
        "(() => { const r = document.querySelector('#plots canvas').getBoundingClientRect();"
        "return [r.x, r.y, r.width, r.height]; })()"
    )
    middle = y + high / 2
    page.mouse(x + wide / 2, middle, "mouseMoved")
    page.until("document.querySelector('#cursor').textContent.startsWith('−2.')")  # of 5 s
    page.mouse(x + wide / 2, middle, "mousePressed")
    page.mouse(x + wide / 2, middle, "mouseReleased")
    page.mouse(x + wide * 0.6, middle, "mouseMoved")
    page.until("/^Δ .* Hz$/.test(document.querySelector('#cursor').textContent)")
    page.mouse(x + wide * 0.6, middle, "mousePressed")
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + wide * 0.7, y=middle,
              button="left", buttons=1)  # fmt: skip
    page.mouse(x + wide * 0.7, middle, "mouseReleased")
    page.until("document.querySelector('#pause').getAttribute('aria-pressed') === 'true'")
    assert not page.js("document.querySelector('#whole').hidden")
    page.until("performance.getEntriesByType('resource').some(e => e.name.includes('/history'))")
    page.click("#whole")
    page.click("#pause")
    page.click(".scale button")
    page.js("(() => { const [low, high] = document.querySelectorAll('.scale input');"
            "low.value = -50; high.value = 950;"
            "high.dispatchEvent(new Event('change')); })()")  # fmt: skip
    assert page.js("document.querySelector('.scale button').textContent") == "fixed"
    assert page.complaints() == []


def test_burst_capture_is_drawn(page):
    tab(page, "capture")
    page.type("#samples", "800")
    page.js("document.querySelector('#capture-form').requestSubmit()")
    page.until("document.querySelector('#capture-state').textContent.startsWith('waiting')")
    page.click("#trigger-now")
    page.until("document.body.dataset.seeing === 'capture'")
    assert page.js("document.querySelector('#see-capture').textContent").startswith("Capture")
    page.until(f"({INKED % 0}) !== 0")
    link = "document.querySelector('.downloads a').href"
    assert page.js(f"fetch({link}).then(r => r.text()).then(t => t.split('\\n').length)") == 802
    assert page.complaints() == []


LABELS = ("[...document.querySelectorAll('#plots canvas')].map((c) => c.getAttribute('aria-label'))"
          ".join(' | ')")  # fmt: skip


def test_limits_follow_their_parameters(page, monitor):
    before = monitor.get("/values")[1]
    page.until(f"({LABELS}).includes('i_trip_A at {before['i_trip_A']:.2f} A')")
    assert f"vdc_min_V at {before['vdc_min_V']:.1f} V" in page.js(LABELS)
    assert "test_current_A" not in page.js(LABELS)  # in the state test only
    monitor.post("/write", {"values": {"i_trip_A": 12.5}})  # by whom does not matter
    page.until(f"({LABELS}).includes('i_trip_A at −12.50 A')")
    page.choose("#limits", "none")
    page.until(f"!({LABELS}).includes('limits')")
    monitor.post("/write", {"values": {"i_trip_A": before["i_trip_A"]}})


def take_capture(page, samples: int) -> str:
    """Capture by hand. Returns the number of the capture that is then shown."""
    tab(page, "capture")
    page.click("#see-live")
    page.type("#samples", str(samples))
    page.js("document.querySelector('#capture-form').requestSubmit()")
    page.until("document.querySelector('#capture-state').textContent.startsWith('waiting')")
    page.click("#trigger-now")
    page.until("document.body.dataset.seeing === 'capture'")
    return page.js("document.querySelector('#capture-shown').value")


def test_captures_stay_and_one_lies_over_another(page):
    first, second = take_capture(page, 300), take_capture(page, 200)
    assert int(second) == int(first) + 1
    listed = "[...document.querySelector('#capture-shown').options].map((o) => o.value)"
    assert page.js(listed)[:2] == [second, first]
    before = inked(page, 0)
    page.choose("#capture-over", first)
    page.until(f"({INKED % 0}) !== {before}")
    # Its values are in the legend, at the pointer, which the keys move.
    page.js("document.querySelector('#plots .stack').focus()")
    page.key("ArrowRight", "ArrowRight")
    page.until("document.querySelector('.chip .over').textContent !== ''")
    # The other one is shown, with nothing over it, and its files are those that are offered.
    page.choose("#capture-over", "")
    page.choose("#capture-shown", first)
    page.until(f"document.querySelector('#see-capture').textContent === 'Capture {first}'")
    link = "document.querySelector('.downloads a').href"
    assert page.js(f"fetch({link}).then(r => r.text()).then(t => t.split('\\n').length)") == 302
    # A page that is opened anew has them, too.
    page.call("Page.navigate", url=page.js("location.href"))
    page.until(f"document.querySelector('#capture-shown')?.value === '{second}'")
    assert page.js(listed)[:2] == [second, first]
    assert page.complaints() == []


def test_the_level_is_checked_and_its_channel_is_captured(page, monitor):
    tab(page, "capture")
    page.choose("#trigger", "below")
    page.js("document.querySelector('#trigger').dispatchEvent(new Event('input'))")
    page.choose("#trigger-channel", "speed_rpm")
    page.js("document.querySelector('#trigger-channel').dispatchEvent(new Event('input'))")
    said = page.js("document.querySelector('#capture-chosen').textContent")
    assert said.startswith("11 of") and "trigger" in said
    page.type("#level", "1.000,5")
    page.js("document.querySelector('#capture-form').requestSubmit()")
    page.until("document.querySelector('#toasts .bad')?.textContent.includes('level')")
    page.type("#level", "99999,5")
    page.js("document.querySelector('#capture-form').requestSubmit()")
    page.until("document.body.dataset.seeing === 'capture'")
    assert "speed_rpm" in monitor.get("/capture")[1]["channels"]


#: With the longest words of the header: pairs of words that lie on each other, words that
#: are not whole inside the window, and whether one can see the button that records.
LAID_OUT = """(async (state, faults) => {
  document.querySelector('#state').textContent = state;
  const bar = document.querySelector('#faults');
  bar.textContent = faults;
  bar.hidden = !faults;
  document.querySelectorAll('#figures b').forEach((b) => { b.textContent = '−1234.5'; });
  const shown = [...document.querySelectorAll(
    'h1, #device, #state, #faults, #figures dt, #figures b, #figures small, .commands button, ' +
    '.tools button, .tools select, .tools label, .tools a, .tabs button, #analysis .head *, ' +
    '#analysis :is(.said, .read, li, th, td)')]
    .filter((e) => e.checkVisibility() && e.textContent.trim());
  const boxes = shown.map((e) => [e, e.getBoundingClientRect()]);
  const wrong = [];
  for (const [a, p] of boxes) {
    const name = a.id || a.textContent.trim();
    if (p.left < 0 || p.right > innerWidth + 0.5 || p.width < 1) wrong.push(`outside: ${name}`);
    for (const [b, q] of boxes) {
      if (a === b || a.contains(b) || b.contains(a)) continue;
      const wide = Math.min(p.right, q.right) - Math.max(p.left, q.left);
      const high = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
      if (wide > 1 && high > 1) wrong.push(`${name} on ${b.id || b.textContent.trim()}`);
    }
  }
  const record = document.querySelector('#record');
  if (!record.checkVisibility()) wrong.push('no button that records');
  return wrong;
})"""


@pytest.mark.parametrize("wide", [1024, 1100, 1241, 1280, 1366, 1440, 1920])
def test_no_words_lie_on_others(page, wide):
    page.size(wide, 720)
    causes = ["", "over-current", "currents of a set do not add up to zero, phase lost, link lost"]
    for view in ("live", "capture", "guide"):
        page.js(f"(() => {{ const b = document.querySelector('#see-{view}'); b.disabled = false;"
                "b.click(); })()")  # fmt: skip
        for state, faults in itertools.product(("calibrate", "unplugged", "fault"), causes):
            found = page.js(f"{LAID_OUT}({state!r}, {faults!r})")
            assert found == [], (view, state, faults)


@pytest.mark.parametrize("wide", [1024, 1440])
def test_choices_are_read_whole(page, wide):
    page.size(wide, 720)
    for panel in ("drive", "channels", "parameters", "capture"):
        tab(page, panel)
        assert page.js(CUT_OFF) == [], panel
    page.click("#see-guide")
    page.until("document.querySelector('#guide-form')")
    assert page.js(CUT_OFF) == []


def test_the_page_says_whether_a_recording_began_or_ended(page):
    """Also if the answer to the click comes after the new status."""
    page.js("(() => { const ask = window.fetch; window.fetch = async (...what) => {"
            "const answer = await ask(...what);"
            "if (String(what[0]).includes('record/')) await new Promise((go) => setTimeout(go, 600)"
            "); return answer; }; })()")  # fmt: skip
    said = "document.querySelector('#toasts').lastChild?.textContent"
    page.click("#record")
    page.until(f"({said})?.startsWith('recording to')")
    page.click("#record")
    page.until(f"({said})?.startsWith('recorded')")


def test_a_recording_can_be_seen_and_ended_in_every_view(page):
    page.click("#record")
    page.until("document.querySelector('#record').getAttribute('aria-pressed') === 'true'")
    tab(page, "capture")
    page.type("#samples", "100")
    page.js("document.querySelector('#capture-form').requestSubmit()")
    page.until("document.querySelector('#capture-state').textContent.startsWith('waiting')")
    page.click("#trigger-now")
    page.until("document.body.dataset.seeing === 'capture'")  # by itself
    assert page.js("document.querySelector('#record').checkVisibility()")
    page.until("/ s$/.test(document.querySelector('#record').textContent)")
    page.click("#record")
    page.until("document.querySelector('#record').getAttribute('aria-pressed') === 'false'")
    assert page.complaints() == []


FIGURES = "[...document.querySelectorAll('#figures b')].map(e => e.textContent)"


def test_numbers_without_a_meaning_are_blank(page, monitor, board):
    """While the control does not run there is no torque."""
    start(page)
    # So fast that the machine coasts for some seconds and the speed changes on a paused page.
    monitor.post("/write", {"values": {"speed_ref_rpm": 300}})
    page.until("parseFloat(document.querySelector('[data-figure=speed_rpm]').textContent) > 100")
    torque = "document.querySelector('[data-figure=torque_Nm]').textContent"
    flux = "document.querySelector('.chip [data-channel=psi_alpha_Wb]').textContent"
    page.until(f"{torque} !== '–' && {flux} !== '–'")
    monitor.post("/write", {"values": {"vdc_max_V": 200}})
    page.until(f"{STATE} === 'fault'")
    page.until(f"{torque} === '–' && {flux} === '–'")
    assert "–" not in page.js(f"{FIGURES}.filter((_, i) => i !== 1)")  # speed, dc link: measured
    monitor.post("/write", {"values": {"vdc_max_V": 400}})
    page.click("#clear")
    page.until(f"{STATE} === 'idle'")
    # A paused page holds its traces, but its numbers continue.
    page.click("#pause")
    speed = "document.querySelector('[data-figure=speed_rpm]').textContent"
    before = page.js(speed)
    page.until(f"{speed} !== '{before}'")
    # Samples that are too old are not shown as numbers.
    board.process.send_signal(signal.SIGSTOP)
    try:
        page.until(f"{FIGURES}.every((text) => text === '–')")
    finally:
        board.process.send_signal(signal.SIGCONT)
    page.until(f"{speed} !== '–'")


def test_numbers_are_blank_when_the_monitor_is_silent(page, monitor):
    page.until(f"{FIGURES}[0] !== '–'")
    monitor.process.send_signal(signal.SIGSTOP)
    try:
        page.until(f"{FIGURES}.every((text) => text === '–')")
    finally:
        monitor.process.send_signal(signal.SIGCONT)
    page.until(f"{FIGURES}[0] !== '–'")


def test_the_page_shows_a_reset_of_the_board(browser, site, board):
    page = browser.open(site.server.url)
    page.until(f"{STATE} === 'idle'")
    assert page.js("document.querySelector('#reset').hidden")
    initial = site.monitored.values["torque_limit_Nm"]
    tab(page, "parameters")
    page.type(".parameter [aria-label=torque_limit_Nm]", "1,5")
    page.key("Enter", "Enter", "\r")
    limit = "document.querySelector('.parameter [aria-label=torque_limit_Nm]').value"
    page.until("document.querySelector('#apply').hidden")
    assert page.js(limit) == "1.5"
    board.reset()
    page.until("!document.querySelector('#reset').hidden")
    said = page.js("document.querySelector('#reset').textContent")
    assert "The board was reset. Its parameters: built-in." in said
    page.until(f"Number({limit}) === {initial}")
    page.until(
        "document.querySelector('#link [data-name=\"board resets\"] dd').textContent === '1'"
    )
    page.click("#reset button")
    page.until("document.querySelector('#reset').hidden")
    page.close()


def test_a_hidden_page_says_in_its_title_when_the_drive_stops(browser, page, board):
    start(page)
    begun_s = board.time_s
    other = browser.call("Target.createTarget", url="about:blank")["targetId"]
    browser.call("Target.activateTarget", targetId=other)
    page.until("document.hidden && document.title.includes('stops in')")
    while (off_s := board.off_s(begun_s)) is None:
        assert board.time_s < begun_s + 13, "the drive still runs"
        time.sleep(0.05)
    assert off_s - begun_s > 5
    browser.call("Target.closeTarget", targetId=other)
    browser.call("Target.activateTarget", targetId=page.target)
    page.until("!document.title.includes('stops in')")
    assert "hidden" in page.js("document.querySelector('#alarm').textContent")


def test_the_page_shows_a_fault(page, monitor):
    start(page)
    monitor.post("/write", {"values": {"vdc_max_V": 200}})
    page.until(f"{STATE} === 'fault'")
    assert page.js("document.querySelector('#faults').textContent") == "dc-link voltage too high"
    tab(page, "fault")
    page.until("document.querySelector('#snapshot h2')?.textContent === 'dc-link voltage too high'")
    rows = page.js("Object.fromEntries([...document.querySelectorAll('#snapshot tr')]"
                   ".map((r) => [...r.children].map((c) => c.textContent)))")  # fmt: skip
    assert {"adc_u1", "adc_v2", "adc_vdc", "i_u1", "position"} <= rows.keys()
    counts = [rows[name] for name in rows if name.startswith("adc_") or name == "position"]
    assert len(counts) == 8 and all(count.isdecimal() for count in counts), counts  # not 1.41e+6
    monitor.post("/write", {"values": {"vdc_max_V": 400}})
    page.click("#clear")
    page.until(f"{STATE} === 'idle'")


def test_limits_that_act_are_shown_while_they_do(page, monitor):
    acting = "document.querySelector('#acting')"
    before = monitor.get("/values")[1]
    start(page)
    assert page.js(f"{acting}.hidden")
    monitor.post("/write", {"values": {"torque_limit_Nm": 0.2, "speed_ref_rpm": 700}})
    page.until(f"!{acting}.hidden")
    assert page.js(f"{acting}.textContent").startswith("Torque is limited: torque for ")
    told = {name: before[name] for name in ("torque_limit_Nm", "speed_ref_rpm")}
    monitor.post("/write", {"values": told})
    page.until(f"{acting}.hidden")
    page.key("Escape", "Escape")
    page.until(f"{STATE} === 'idle'")


def test_the_log_of_the_board_is_read_when_it_is_opened(page, monitor):
    """The trip's row is the first, and the counters have it."""
    over = "dc-link voltage too high"
    start(page)
    monitor.post("/write", {"values": {"vdc_max_V": 200}})
    page.until(f"{STATE} === 'fault'")
    tab(page, "fault")
    assert page.js("document.querySelectorAll('#log tr').length") == 0
    page.click("#log summary")
    page.until("document.querySelectorAll('#log tr').length > 1")
    row = page.js("[...document.querySelector('#log tr').children].map((c) => c.textContent)")
    assert row[1:] == ["trip", over], row
    kept = monitor.get("/log")[1]
    said = page.js("document.querySelector('#log p').textContent")
    assert f"starts {kept['starts']}." in said and f"{over} {kept['trips'][over]}" in said
    assert kept["events"][0]["causes"] == [over]
    monitor.post("/write", {"values": {"vdc_max_V": 400}})
    page.click("#clear")
    page.until(f"{STATE} === 'idle'")


def test_a_closed_tab_stops_the_drive(browser, page, monitor, board):
    start(page)
    page.close()
    time.sleep(0.5)
    with monitor.page() as frame:
        time.sleep(0.2)
        # A page that comes back soon keeps the drive running ...
        while "status" not in (one := frame()):
            pass
        assert one["status"]["state"] == "run"
    until(lambda: not board.working)
    with monitor.page() as frame:  # the monitor learns of the end by the board's next answer
        until(lambda: frame().get("status", {}).get("state") == "idle")
        until(lambda: "no page" in frame().get("status", {}).get("notice", ""))


def test_the_page_shows_that_the_monitor_has_ended(browser, own_monitor):
    page = browser.open(own_monitor.url)
    start(page)
    own_monitor.end(signal.SIGTERM)
    page.until(f"{STATE} === 'unknown'")
    assert not page.js("document.querySelector('#alarm').hidden")
    page.click("#stop")
    page.until("document.querySelector('#toasts .bad')")
    page.close()


def test_without_the_cookie_the_page_says_which_address_to_open(browser, monitor):
    """This happens in another browser profile, or if the address is copied without its token."""
    monitor.cookie = ""
    page = browser.open(f"http://localhost:{monitor.port}/")
    assert "hexatorque board monitor" in page.js("document.body.textContent")
    page.close()


def test_arrow_keys_move_between_tabs(page):
    page.js("document.querySelector('[data-panel=drive]').focus()")
    chosen = "document.querySelector('.tabs [aria-selected=true]').dataset.panel"
    focus = "document.activeElement.dataset.panel"
    for key, name in (
        ("ArrowRight", "channels"), ("ArrowRight", "parameters"), ("ArrowLeft", "channels"),
        ("End", "fault"), ("ArrowRight", "drive"), ("ArrowLeft", "fault"), ("Home", "drive"),
    ):  # fmt: skip
        page.key(key, key)
        assert page.js(f"[{chosen}, {focus}]") == [name, name]
        assert page.js(f"document.querySelector('#panel-{name}').checkVisibility()")


def test_the_tab_key_stops_at_one_tab_of_the_list_only(page):
    stops = page.js("[...document.querySelectorAll('.tabs [role=tab]')].map((t) => t.tabIndex)")
    assert sorted(stops) == [-1] * (len(stops) - 1) + [0]


def test_each_tab_names_its_panel(page):
    linked = page.js(
        "[...document.querySelectorAll('.tabs [role=tab]')].every((t) =>"
        "document.getElementById(t.getAttribute('aria-controls')).role === 'tabpanel')"
    )
    assert linked


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_have_contrast(page, monitor, scheme):
    page.scheme(scheme)
    page.until("document.querySelectorAll('#parameters .parameter').length > 9")
    for panel in ("drive", "channels", "parameters", "capture", "fault"):
        tab(page, panel)
        if panel == "parameters":
            page.type(".parameter [aria-label=torque_limit_Nm]", "1e9")  # a mistake is shown
        assert page.js(PALE) == [], panel
    page.click("#record")
    page.until("document.querySelector('#record').getAttribute('aria-pressed') === 'true'")
    start(page)
    assert page.js(PALE) == []
    page.click("#record")
    monitor.post("/write", {"values": {"vdc_max_V": 200}})
    page.until(f"{STATE} === 'fault'")
    assert page.js(PALE) == []


#: How the three kinds of colour-blind people see linear red, green and blue (Machado, Oliveira and
#: Fernandes, 2009, severity 1).
SEEN = {
    "by all": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
               [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
               [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(colour: str, seen: list) -> np.ndarray:
    """CIE L*a*b* of #rrggbb (white point D65) as it is seen."""
    coded = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = to_xyz @ np.clip(np.array(seen) @ linear, 0, 1) / [0.9505, 1.0, 1.089]
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_traces_of_one_style_differ_for_colour_blind_people_too(page, scheme):
    """A difference of 10 in L*a*b* is several times what one can just see."""
    page.scheme(scheme)
    colours = page.js("[0, 1, 2, 3, 4, 5].map((n) => getComputedStyle(document.documentElement)"
                      ".getPropertyValue(`--trace-${n}`).trim())")  # fmt: skip
    assert colours[5] == ""  # there are five, each solid and dashed
    for (one, other), (who, seen) in itertools.product(
        itertools.combinations(colours[:5], 2), SEEN.items()
    ):
        assert np.linalg.norm(lab(one, seen) - lab(other, seen)) > 10, (one, other, who)


def test_the_sixth_trace_is_dashed(page, monitor):
    names = ["i_u1_A", "i_u2_A", "i_v1_A", "i_v2_A", "i_w1_A", "i_w2_A", "vdc_V"]
    monitor.post("/channels", {"channels": names, "rate_Hz": 1000})
    page.until("document.querySelectorAll('.chip').length === 7")
    dashed = page.js(
        "[...document.querySelectorAll('.chip')].filter((c) => c.querySelector('i.dashed'))"
        ".map((c) => c.children[1].textContent)"
    )
    assert dashed == ["i_w2_A", "vdc_V"]
    ticked = page.js("document.querySelectorAll('#channels i.dashed').length")
    assert ticked == 2
    page.until(f"({INKED % 0}) !== 0")
    assert page.complaints() == []
