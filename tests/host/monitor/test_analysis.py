"""Figures, spectrum and x-y view below the plots: the numbers against numpy's, the views with
signals whose figures follow from how they are made."""

import itertools
import json
import math
import re

import numpy as np
import pytest
from chromium import program
from test_page import LAID_OUT, PALE
from waiting import until

from hexatorque.analysis.spectrum import spectrum
from hexatorque.monitor import server as module
from hexatorque.recording.recording import STARTED, Recording

pytestmark = pytest.mark.skipif(program() is None, reason="no chromium: apt-get install chromium")

SAID = "document.querySelector('#analysis .said').textContent"
COLUMNS = ("mean", "rms", "min", "max", "peak")
#: The table of figures: {channel: numbers in full}.
TABLE = """Object.fromEntries([...document.querySelectorAll('#analysis tbody tr')].map((row) =>
  [row.querySelector('th').textContent, [...row.querySelectorAll('td[title]')].map((c) => Number(c.title))]))"""  # noqa: E501
LINES = "[...document.querySelectorAll('#analysis .lines li')].map((e) => e.textContent)"


def of_numpy(values: np.ndarray) -> list[float]:
    values = values[np.isfinite(values)].astype(float)
    return [values.mean(), np.sqrt(np.mean(values**2)), values.min(), values.max(), np.ptp(values)]


def computed(page, expression: str, values: np.ndarray) -> object:
    """An expression of figures.js over `x`, the values."""
    text = json.dumps([None if np.isnan(one) else one for one in values.tolist()])
    return page.js(f"""(async () => {{
      const {{ figures, largest, spectrum }} = await import('/figures.js');
      const x = {text}.map((one) => one ?? NaN);
      const found = {expression};
      return found && (found.amplitude ? {{ ...found, amplitude: [...found.amplitude] }} : found);
    }})()""")


def test_figures_are_those_of_numpy(page):
    rng = np.random.default_rng(3)
    for values in (
        rng.normal(size=1000),
        1e6 + rng.normal(size=5001),  # a small deviation from a large mean
        1e-3 * rng.normal(size=5000) + np.tile([300.0, -300.0], 2500),  # a small mean
        np.where(rng.random(800) < 0.1, np.nan, rng.normal(size=800)),
        np.array([-7.5]),
    ):
        found = computed(page, "figures(x)", values)
        assert [found[name] for name in COLUMNS] == pytest.approx(of_numpy(values), rel=1e-9)
        assert found["missing"] == np.isnan(values).sum()
        assert found["count"] + found["missing"] == len(values)


def test_a_sum_of_large_parts_that_cancel_is_rounded_once(page):
    rng = np.random.default_rng(3)
    values = np.concatenate([1e9 + rng.normal(size=3000), -1e9 + rng.normal(size=3000)])
    found = computed(page, "figures(x)", values)
    assert found["mean"] == pytest.approx(math.fsum(values) / len(values), rel=1e-9)


def test_figures_of_no_number_are_its_two_counts_only(page):
    nothing = computed(page, "Object.values(figures(x)).map(Number.isFinite)", np.array([np.nan]))
    assert nothing == [True, True] + [False] * 5


@pytest.mark.parametrize("count", [4, 5, 64, 1000, 1023, 4099, 20011])
def test_the_spectrum_is_that_of_numpy(page, count):
    rate_Hz = 2500.0
    values = np.random.default_rng(count).normal(size=count) + 0.3
    found = computed(page, f"spectrum(x, {rate_Hz})", values)
    hann = np.sin(np.pi * np.arange(count) / count) ** 2
    wanted = 2 * np.abs(np.fft.rfft(hann * values)) / hann.sum()
    wanted[0] /= 2
    amplitude = np.array(found["amplitude"])
    np.testing.assert_allclose(amplitude, wanted, rtol=1e-9, atol=1e-12 * wanted.max())
    frequencies, ours = spectrum(values, rate_Hz)  # reports and page have one definition
    np.testing.assert_allclose(amplitude, ours, rtol=1e-9, atol=1e-12 * wanted.max())
    np.testing.assert_allclose(
        np.arange(len(amplitude)) * found["step_Hz"], frequencies, rtol=1e-12
    )


def test_a_sine_has_its_amplitude_at_its_frequency(page):
    t = np.arange(1800) / 3000.0
    values = 5 + 2 * np.sin(2 * np.pi * 100 * t) + 0.25 * np.cos(2 * np.pi * 1200 * t)
    found = computed(page, "spectrum(x, 3000)", values)
    step_Hz, amplitude = found["step_Hz"], np.array(found["amplitude"])
    assert step_Hz == pytest.approx(3000 / 1800)
    lines = {f_Hz: amplitude[round(f_Hz / step_Hz)] for f_Hz in (0, 100, 1200)}
    assert lines == pytest.approx({0: 5, 100: 2, 1200: 0.25}, rel=1e-9)
    far = np.abs(np.arange(len(amplitude))[:, None] * step_Hz - [0, 100, 1200]).min(axis=1)
    assert amplitude[far > 1.5 * step_Hz].max() < 1e-9
    top = computed(page, "largest(spectrum(x, 3000).amplitude, 2)", values)
    assert top == [60, 720]
    values[7] = np.nan
    assert computed(page, "spectrum(x, 3000)", values) is None
    assert computed(page, "spectrum(x, 3000)", np.ones(3)) is None


def test_equal_scales_show_all_and_a_pixel_is_worth_the_same(page):
    for across, up, (wide, high) in itertools.product(
        ([-0.4, 0.4], [3, 900]), ([-0.4, 0.4], [0, 0]), ((600, 200), (200, 600))
    ):
        for equal in (True, False):
            shown = page.js(
                "import('/xy.js').then(({ frame }) => "
                f"frame({across}, {up}, {wide}, {high}, {json.dumps(equal)}))"
            )
            for (low, most), (begin, end) in ((across, shown["x"]), (up, shown["y"])):
                assert begin < low <= most < end or low == most == 0
            worth = [(shown["x"][1] - shown["x"][0]) / wide, (shown["y"][1] - shown["y"][0]) / high]
            if equal:
                assert worth[0] == pytest.approx(worth[1])


RATE_HZ, COUNT, PRE = 10_000.0, 2000, 500
T = (np.arange(COUNT) - PRE) / RATE_HZ
SIGNALS = {
    "i_u1_A": 3 + 2 * np.sin(2 * np.pi * 500 * T) + 0.1 * np.sin(2 * np.pi * 1500 * T),
    "psi_alpha_Wb": 0.4 * np.cos(2 * np.pi * 50 * T),
    "psi_beta_Wb": 0.4 * np.sin(2 * np.pi * 50 * T),
    "speed_rpm": np.where(T < 0, -100.0, 300.0),
}


@pytest.fixture
def captured(browser, site):
    """A page that shows a capture whose samples are made here. captured(signals) is another one."""
    browser.events.clear()
    page = browser.open(site.server.url)
    page.until("document.body.dataset.state === 'idle'")
    parameters = {"controller": site.monitored.drive.get_all()}
    meta = {"parameters": parameters, STARTED: "2026-01-01T12:00:00.000+00:00", "trigger_tick": 0,
            "scheme": "dtc1", "state": "run", "faults": []}  # fmt: skip

    def capture(signals: dict):
        data = {name: values.astype(np.float32) for name, values in signals.items()}
        with site.monitored.captures.lock:
            site.monitored.captures._keep(Recording(RATE_HZ, data, {}, meta, -PRE / RATE_HZ))
        number = site.monitored.captures.number
        page.until(f"document.querySelector('#see-capture').textContent === 'Capture {number}'")
        page.click("#see-capture")
        return page

    yield capture
    page.close()


def field(page, label: str, text: str) -> None:
    selector = f'#analysis [aria-label="{label}"]'
    page.type(selector, text)
    page.key("Enter", "Enter", "\r")


def test_figures_of_a_capture_and_of_a_part_of_it(captured):
    page = captured(SIGNALS)
    page.choose("#analyse", "figures")
    page.until(f"Object.keys({TABLE}).length === 4")
    stored = {name: values.astype(np.float32) for name, values in SIGNALS.items()}
    for name, numbers in page.js(TABLE).items():
        assert numbers == pytest.approx(of_numpy(stored[name]), rel=1e-9), name
    assert page.js(SAID) == "2000 samples at 10000 Hz, 200.0 ms"
    # A part by its fields, in milliseconds from the trigger; its ends are the marks.
    field(page, "begin of the part, in milliseconds", "-10")
    field(page, "end of the part, in milliseconds", "30,05")
    page.until(f"{SAID}.startsWith('401 samples')")  # from -10 ms to before 30.05 ms
    for name, numbers in page.js(TABLE).items():
        assert numbers == pytest.approx(of_numpy(stored[name][400:801]), rel=1e-9), name
    field(page, "end of the part, in milliseconds", "-20")
    page.until(f"{SAID}.includes('an end that is later')")
    page.click("#analysis button")
    page.until(f"{SAID}.startsWith('2000 samples')")
    # The same with keys: the arrows move the pointer by a fiftieth of what is shown.
    page.js("document.querySelector('#plots .stack').focus()")
    for _ in range(5):
        page.key("ArrowRight", "ArrowRight")
    page.key("Enter", "Enter", "\r")
    for _ in range(10):
        page.key("ArrowRight", "ArrowRight")
    page.key("Enter", "Enter", "\r")
    page.until(f"/^(399|400|401) samples/.test({SAID})")
    page.key("z", "KeyZ", "z")
    page.until("!document.querySelector('#whole').hidden")
    page.until(f"/^(399|400|401) samples/.test({SAID})")
    assert page.complaints() == []


def test_the_spectrum_of_a_capture(captured):
    page = captured(SIGNALS)
    page.choose("#analyse", "spectrum")
    page.until(f"{LINES}.length === 2")
    assert page.js(LINES) == ["i_u1_A 2.000 A at 500.0 Hz", "i_u1_A 0.100 A at 1500 Hz"]
    assert "a line every 5.000 Hz" in page.js(SAID) and "10.00 Hz run together" in page.js(SAID)
    read = "document.querySelector('#analysis .read').textContent"
    page.js("document.querySelector('#analysis .chart').focus()")
    for _ in range(100):
        page.key("ArrowRight", "ArrowRight")
    page.until(f"{read} === '500.0 Hz:\\ni_u1_A 2.000 A'")
    page.choose('#analysis [aria-label="unit of the channels"]', "Wb")
    page.until(f"{LINES}.length === 2 && {LINES}[0].startsWith('psi')")
    assert {re.sub(r"psi_(alpha|beta)_", "", text) for text in page.js(LINES)} == {
        "Wb 0.400 Wb at 50.00 Hz"
    }
    field(page, "largest frequency that is shown, in hertz", "200")
    shown = "document.querySelector('#analysis canvas').getAttribute('aria-label')"
    assert page.js(shown) == "amplitude in Wb over frequency: psi_alpha_Wb, psi_beta_Wb"
    page.choose('#analysis [aria-label="scale of the amplitudes"]', "log")
    page.until(f"{LINES}.length === 2")
    # A sample is missing: figures are of the others, and there is no spectrum.
    broken = {name: values.copy() for name, values in SIGNALS.items()}
    broken["psi_beta_Wb"][[30, 31, 32]] = np.nan
    page.click("#see-live")
    captured(broken)
    page.until(f"{SAID}.startsWith('No spectrum: 3 of 2000 samples have no value.')")
    assert page.js(LINES) == []
    page.choose("#analyse", "figures")
    page.until(f"{SAID}.endsWith('; 3 of them have no value and do not count')")
    numbers = page.js(TABLE)["psi_beta_Wb"]
    assert numbers == pytest.approx(of_numpy(broken["psi_beta_Wb"].astype(np.float32)), rel=1e-9)
    assert page.complaints() == []


#: The box of the pixels that have the colour of a trace on the x-y view: left, top, right, bottom.
BOX = """(() => {
  const canvas = document.querySelector('#analysis canvas.xy');
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const text = getComputedStyle(document.documentElement).getPropertyValue('--trace-2').trim();
  const wanted = [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
  let [left, top, right, bottom, middle] = [1e9, 1e9, -1, -1, 0];
  for (let y = 0; y < canvas.height; y++) for (let x = 0; x < canvas.width; x++) {
    const at = 4 * (y * canvas.width + x);
    if (data[at + 3] < 100 || wanted.some((c, i) => Math.abs(data[at + i] - c) > 40)) continue;
    [left, right] = [Math.min(left, x), Math.max(right, x)];
    [top, bottom] = [Math.min(top, y), Math.max(bottom, y)];
  }
  return [left, top, right, bottom];
})()"""


@pytest.mark.parametrize("wide", [1024, 1600])
def test_a_circle_is_a_circle(captured, wide):
    page = captured(SIGNALS)
    page.size(wide, 800)
    page.choose("#analyse", "xy")
    page.until(f"{SAID}.endsWith('equal scales.')")
    chosen = "[...document.querySelectorAll('#analysis .options select')].map((e) => e.value)"
    assert page.js(chosen) == ["psi_alpha_Wb", "psi_beta_Wb"]
    page.until(f"{BOX}[2] > 0")
    left, top, right, bottom = page.js(BOX)
    assert right - left == pytest.approx(bottom - top, abs=3) and right - left > 80
    label = "document.querySelector('#analysis canvas.xy').getAttribute('aria-label')"
    assert page.js(label) == (
        "psi_beta_Wb, Wb from −0.400 to 0.400, over psi_alpha_Wb, Wb from −0.400 to 0.400"
    )
    page.choose('#analysis [aria-label="channel across"]', "speed_rpm")
    page.until(f"{SAID} === '2000 samples at 10000 Hz, 200.0 ms.'")  # of other units
    assert page.complaints() == []


def test_the_part_of_the_live_traces_is_what_the_ring_has(browser, site, monkeypatch):
    asked = []
    span = module.Handler._span

    def spy(self, query):
        asked.append({name: float(query[name]) for name in ("begin_s", "end_s")})
        span(self, query)

    monkeypatch.setattr(module.Handler, "_span", spy)
    page = browser.open(site.server.url)
    page.until("document.body.dataset.state === 'idle'")
    page.choose("#window", "1")
    page.choose("#analyse", "figures")
    page.until(f"Object.keys({TABLE}).length > 3")
    count = len(asked)
    until(lambda: len(asked) > count)  # by itself, while the traces run
    page.click("#pause")
    field(page, "begin of the part, in milliseconds", "-600")
    field(page, "end of the part, in milliseconds", "-100")
    _, ring, stream = site.monitored.traces.present()
    half_s = round(0.5 * stream.rate_Hz)  # the rate depends on what else the line carries
    page.until(f"Math.abs(parseInt({SAID}) - {half_s}) < 2")
    first, last = (int(np.ceil(asked[-1][name] * stream.rate_Hz - 1e-6)) for name in asked[-1])
    part = dict(zip(stream.channels, ring.part(first, last)))
    table = page.js(TABLE)
    assert list(table) == list(stream.channels)
    for name in ("vdc_V", "i_u1_A", "i_u2_A"):
        assert table[name] == pytest.approx(of_numpy(part[name]), rel=1e-9), name
    # The control does not run, so there is no flux, and no spectrum of it.
    page.choose("#analyse", "spectrum")
    page.choose('#analysis [aria-label="unit of the channels"]', "Wb")
    page.until(f"{SAID}.includes('or the control did not run')")
    page.choose("#analyse", "xy")
    page.until(f"{SAID} === 'There is nothing to draw: no sample has a value.'")
    # A page that is paused before the first samples of another window come has the former ones.
    page.choose("#analyse", "figures")
    page.js(
        "(() => { const list = document.querySelector('#window'); list.value = 2;"
        "list.dispatchEvent(new Event('change')); document.querySelector('#pause').click(); })()"
    )
    page.until(f"Math.abs(parseInt({SAID}) - {4 * half_s}) < 8")
    assert page.js("document.querySelector('#pause').getAttribute('aria-pressed')") == "true"
    assert page.complaints() == []
    page.close()


#: Kinds of analysis, and when each is done.
KINDS = [
    ("figures", f"Object.keys({TABLE}).length === 4"),
    ("spectrum", f"{LINES}.length > 1"),
    ("xy", "document.querySelector('#analysis canvas.xy')"),
]


@pytest.mark.parametrize(("kind", "done"), KINDS)
def test_words_are_apart_and_have_contrast(captured, kind, done):
    page = captured(SIGNALS)
    page.choose("#analyse", kind)
    page.until(done)
    for wide in (1024, 1280, 1600):
        page.size(wide, 720)
        assert page.js(f"{LAID_OUT}('calibrate', 'over-current')") == [], wide
    for scheme in ("light", "dark"):
        page.scheme(scheme)
        assert page.js(PALE) == [], scheme


@pytest.mark.parametrize(("kind", "done"), KINDS)
def test_what_can_be_used_has_a_name_for_a_screen_reader(captured, kind, done):
    page = captured(SIGNALS)
    page.choose("#analyse", kind)
    page.until(done)
    nameless = page.js(
        "[...document.querySelectorAll('.tools select, #analysis :is(input, select, canvas)')]"
        ".filter((e) => !e.getAttribute('aria-label') && !e.labels?.length).map((e) => e.outerHTML)"
    )
    assert nameless == []
