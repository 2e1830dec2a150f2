"""The plots of the page in a headless Chromium, with bins made here: which pixels they draw.

The traces are horizontal lines, gaps and single peaks. Where their pixels must be follows from the
plot's area and from its scale alone.
"""

import hashlib
import json
import re
import threading
from importlib import resources

import numpy as np
import pytest
from chromium import Chromium, program

import hexatorque.monitor
from hexatorque.firmware import FirmwareError
from hexatorque.monitor.server import Server

VENDOR = resources.files(hexatorque.monitor) / "page" / "vendor" / "uplot"
needs_browser = pytest.mark.skipif(
    program() is None, reason="no chromium: apt-get install chromium"
)
#: Puts a stack of plots into the page, which has no drive and therefore no plots of its own.
PREPARE = """(async () => {
  const { Bins } = await import('/bins.js');
  const { Stack } = await import('/stack.js');
  const box = document.createElement('div');
  box.className = 'stack';
  Object.assign(box.style, { width: '700px', height: '400px' });
  document.querySelector('#plots').replaceChildren(box);
  window.said = {};
  window.stack = new Stack(box, {
    words: () => null,
    zoomed: (view) => { said.view = view; },
    cursor: (cursor_s, mark_s) => Object.assign(said, { cursor_s, mark_s }),
  });
  window.newBins = (channels, capacity, dt_s) => new Bins(channels, capacity, dt_s);
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  window.drawn = async () => { stack.draw(); await frame(); await frame(); };
  // For each column of a plot's area: the first and last row with pixels of a colour, or null.
  window.found = (plot, name) => {
    const { chart, scale } = stack.plots[plot];
    const { left, top, width, height } = chart.bbox;
    const { data } = chart.ctx.getImageData(left, top, width, height);
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const wanted = [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
    const columns = Array.from({ length: width }, () => null);
    for (let x = 0; x < width; x++) for (let y = 0; y < height; y++) {
      const at = 4 * (y * width + x);
      if (data[at + 3] < 100 || wanted.some((c, i) => Math.abs(data[at + i] - c) > 60)) continue;
      columns[x] = [columns[x]?.[0] ?? y, y];
    }
    return { columns, height, scale };
  };
})()"""


def sums() -> dict[str, str]:
    note = (VENDOR / "README.md").read_text()
    return {name: sha for sha, name in re.findall(r"^([0-9a-f]{64})  (\S+)$", note, re.M)}


def test_the_library_is_the_released_one_with_its_licence():
    """Nobody has changed it here, and each of its files is named with version and origin."""
    stated = sums()
    assert set(stated) == {file.name for file in VENDOR.iterdir()} - {"README.md"}
    for name, sha in stated.items():
        assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == sha, name
    version = re.search(r"^# uPlot (\S+)$", (VENDOR / "README.md").read_text(), re.M)[1]
    assert f"(v{version})" in (VENDOR / "uPlot.iife.min.js").read_text()[:100]
    assert "MIT License" in (VENDOR / "LICENSE").read_text()


class NoDrive:
    """The server needs no drive to send the page's files."""

    def device(self):
        raise FirmwareError("no drive in this test")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with Server(NoDrive()) as server, Chromium(tmp_path_factory.mktemp("profile")) as browser:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        page = browser.open(server.url)
        page.until("!document.querySelector('#alarm').hidden")
        browser.events.clear()
        yield page
        server.shutdown()
        thread.join()


@pytest.fixture
def plots(page):
    page.scheme("light")
    page.js(PREPARE)
    return page


def show(page, rows: list, units: str = "A", steps: bool = False, dt_s: float = 0.01) -> None:
    """One trace for each row of values; NaN: no sample. A value may be (smallest, largest)."""
    table = np.array([[np.broadcast_to(value, 2) for value in row] for row in rows], float)
    lo, hi = (json.dumps(part.ravel().tolist()) for part in (table[..., 0], table[..., 1]))
    bins = table.shape[1]
    series = [
        {"name": f"c{i}", "unit": units[i % len(units)], "index": i, "colour": i, "steps": steps}
        for i in range(len(rows))
    ]
    page.js(f"""(async () => {{
      const NaN = Number.NaN;
      stack.bins = newBins({len(rows)}, {bins}, {dt_s});
      stack.bins.put(0, {bins}, {lo}, {hi});
      stack.window_s = {bins * dt_s};
      stack.show({json.dumps(series)});
      await drawn();
    }})()""")


def columns(page, colour: str = "--trace-0", plot: int = 0):
    """(columns, 2) values at the ends of what is drawn in a column, NaN where nothing is; and what
    one pixel is worth."""
    found = page.js(f"found({plot}, {colour!r})")
    low, high = found["scale"]
    per_pixel = (high - low) / found["height"]
    rows = np.array([pair or [np.nan, np.nan] for pair in found["columns"]], float)
    return high - (rows + 0.5)[:, ::-1] * per_pixel, per_pixel


@needs_browser
def test_a_gap_stays_blank_and_a_peak_keeps_its_height(plots):
    """100 bins at 2, of which one reaches 9 and 20 are missing."""
    row = [2.0] * 100
    row[30] = (2.0, 9.0)
    row[60:80] = [np.nan] * 20
    show(plots, [row])
    values, pixel = columns(plots)
    wide = len(values)
    drawn = ~np.isnan(values[:, 0])
    of = np.arange(wide) / wide * 100  # the bin that a column shows
    assert not drawn[(of > 59.5) & (of < 79.5)].any()
    assert drawn[((of > 0.5) & (of < 58.5)) | ((of > 80.5) & (of < 98.5))].all()
    peak = (of > 28) & (of < 32)
    assert values[peak].max() == pytest.approx(9, abs=1.5 * pixel)
    flat = values[drawn & ~peak]
    assert flat == pytest.approx(2, abs=1.5 * pixel)
    assert plots.complaints() == []


@needs_browser
def test_all_of_a_bin_between_its_smallest_and_largest_value_is_drawn(plots):
    low, high = -1 + 0.1 * np.sin(np.arange(700)), 3 + 0.1 * np.cos(np.arange(700))
    show(plots, [list(zip(low, high))], dt_s=1e-3)  # more bins than the 700 pixels less the axis
    values, pixel = columns(plots)
    middle = values[2:-3]
    assert middle[:, 0] == pytest.approx(-1, abs=0.1 + 2 * pixel)
    assert middle[:, 1] == pytest.approx(3, abs=0.1 + 2 * pixel)


@needs_browser
@pytest.mark.parametrize(("steps", "halfway"), [(True, 0.0), (False, 5.0)])
def test_steps_stay_steps_and_lines_lines(plots, steps, halfway):
    """Between a bin at 0 and the next at 10, a trace in steps is still at 0."""
    show(plots, [[0.0, 0.0, 10.0, 10.0, 10.0]], steps=steps)
    values, _ = columns(plots)
    column = round(len(values) * 1.5 / 5)
    assert values[column] == pytest.approx(halfway, abs=0.5)


@needs_browser
def test_the_first_trace_is_on_top(plots):
    show(plots, [[1.0] * 50, [1.0] * 50])
    first, _ = columns(plots, "--trace-0")
    second, _ = columns(plots, "--trace-1")
    assert not np.isnan(first[1:-20]).any() and np.isnan(second).all()


@needs_browser
def test_colours_follow_the_scheme_of_the_browser(plots):
    show(plots, [[1.0] * 50])
    light = plots.js("getComputedStyle(document.documentElement).getPropertyValue('--trace-0')")
    plots.scheme("dark")
    plots.until(f"stack.colours.traces[0] !== {light!r}.trim()")
    plots.js("drawn()")
    dark, _ = columns(plots)  # the colour that is in force now
    assert not np.isnan(dark[1:-20]).any()


@needs_browser
def test_a_reset_of_the_board_is_marked_in_every_plot(plots):
    show(plots, [[1.0] * 100, [2.0] * 100], units="AV")
    assert np.isnan(columns(plots, "--stop")[0]).all()
    plots.js("(stack.marks = [{ time_s: 0.25, text: 'board reset' }]) && drawn()")
    for plot in (0, 1):
        values, _ = columns(plots, "--stop", plot)
        low, high = plots.js(f"stack.plots[{plot}].scale")
        tall = np.flatnonzero(values[:, 1] - values[:, 0] > 0.9 * (high - low))
        assert tall / len(values) == pytest.approx(0.25, abs=2 / len(values)) and len(tall)


@needs_browser
def test_a_fixed_scale_stays(plots):
    show(plots, [[1.0] * 20])
    plots.click(".scale button")
    fixed = plots.js("stack.plots[0].scale")
    plots.js("stack.bins.put(20, 1, [500], [500]); drawn()")
    scale = "[stack.plots[0].chart.scales.y.min, stack.plots[0].chart.scales.y.max]"
    assert plots.js(scale) == fixed
    plots.click(".scale button")
    plots.js("drawn()")
    assert plots.js(scale)[1] > 500


def pointer(page, share: float, kind: str, plot: int = 0) -> None:
    """The mouse at a share of the width of a plot's area."""
    x, y, wide, high = page.js(
        f"(() => {{ const r = document.querySelectorAll('.u-over')[{plot}]"
        ".getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; })()"
    )
    page.call(
        "Input.dispatchMouseEvent", type=kind, x=x + share * wide, y=y + high / 2,
        button="none" if kind == "mouseMoved" and not page.down else "left",
        buttons=int(page.down or kind == "mousePressed"), clickCount=1,
    )  # fmt: skip
    page.down = {"mousePressed": True, "mouseReleased": False}.get(kind, page.down)


@needs_browser
def test_the_pointer_reads_and_marks_and_selects_in_all_plots(plots):
    """Bin n has the value n, and in the other plot 1000 + n. Time 0 is at the right edge."""
    plots.down = False
    count = 500
    show(plots, [list(range(count)), [(1000 + n, 3000 + n) for n in range(count)]], units="AV")
    pointer(plots, 0.6, "mouseMoved", plot=1)
    read = "[...document.querySelectorAll('.chip output')].map((one) => one.textContent)"
    plots.until(f"{read}[0] !== ''")
    one, other = plots.js(read)
    assert float(one) == pytest.approx(0.6 * count, abs=2)
    assert [float(text) for text in other.split(" … ")] == [1000 + float(one), 3000 + float(one)]
    assert plots.js("said.cursor_s") == pytest.approx(-0.4 * 5, abs=0.02)
    lines = "[...document.querySelectorAll('.u-cursor-x')].map((one) => one.style.transform)"
    assert len(set(plots.js(lines))) == 1 and "px" in plots.js(lines)[0]
    # A click sets a mark; the next takes it away.
    pointer(plots, 0.6, "mouseMoved")
    pointer(plots, 0.6, "mousePressed")
    pointer(plots, 0.6, "mouseReleased")
    assert plots.js("stack.mark_s") == pytest.approx(-2, abs=0.02)
    plots.js("drawn()")
    mark = np.flatnonzero(~np.isnan(columns(plots, "--accent", plot=1)[0][:, 0]))
    wide = len(columns(plots)[0])
    assert mark / wide == pytest.approx(0.6, abs=2 / wide) and len(mark)
    # While a part is being selected the traces stand still, although samples come in.
    pointer(plots, 0.2, "mouseMoved")
    pointer(plots, 0.2, "mousePressed")
    pointer(plots, 0.25, "mouseMoved")
    pointer(plots, 0.3, "mouseMoved")
    before = plots.js("stack.plots[0].chart.ctx.canvas.toDataURL()")
    plots.js("(async () => { stack.bins.put(500, 50, Array(100).fill(0), Array(100).fill(0));"
             "await drawn(); })()")  # fmt: skip
    assert plots.js("stack.plots[0].chart.ctx.canvas.toDataURL()") == before
    shades = "[...document.querySelectorAll('.u-select')].map((one) => one.clientWidth)"
    assert plots.js(shades) == pytest.approx([0.1 * wide] * 2, abs=2)
    pointer(plots, 0.3, "mouseReleased")
    begin, end = plots.js("said.view")
    assert (begin, end) == (pytest.approx(0.2 * 5, abs=0.03), pytest.approx(0.3 * 5, abs=0.03))
    plots.js("drawn()")
    assert plots.js("[...document.querySelectorAll('.u-select')].map((e) => e.clientWidth)") == [
        0,
        0,
    ]
    values, _ = columns(plots)  # the selected part: bins 100 to 150, over the whole width
    assert values[5, 0] == pytest.approx(100, abs=3) and values[-5, 1] == pytest.approx(150, abs=3)


@needs_browser
def test_a_limit_is_a_line_at_its_level(plots):
    """Two limits concern the first plot: one is in its range, one is not. None concerns the
    other."""
    show(plots, [[1.0] * 50, [1.0] * 50], units="AV")
    plots.js("""(async () => {
      const { levels } = await import('/limits.js');
      const table = [
        { parameter: 'near', channels: ['c0', 'x'], signs: [1], state: '' },
        { parameter: 'far', channels: ['c0'], signs: [1, -1], state: '' },
        { parameter: 'other', channels: ['x'], signs: [1], state: '' },
        { parameter: 'elsewhere', channels: ['c0'], signs: [1], state: 'test' },
      ];
      window.limit = async (far, reach) => {
        const values = { near: 1.004, far, other: 1, elsewhere: 1 };
        stack.limit(levels(table, values, 'run'), reach);
        await drawn();
      };
      await limit(5, false);
    })()""")

    def lines(plot: int) -> list[float]:
        """The levels at which most of the width has the colour of limits."""
        values, _ = columns(plots, "--warn", plot)
        tall = values[300:]  # right of the names
        drawn = ~np.isnan(tall[:, 0])
        if not drawn.mean() > 0.5:
            return []
        return sorted({float(np.nanmin(tall)), float(np.nanmax(tall))})

    def label(plot: int) -> str:
        return plots.js(f"stack.plots[{plot}].chart.ctx.canvas.getAttribute('aria-label')")

    (level, *others) = lines(0)
    assert level == pytest.approx(1.004, abs=1e-3)
    assert all(other == pytest.approx(level, abs=1e-3) for other in others)
    assert lines(1) == []
    assert label(0) == "c0; limits: near at 1.004 A, far at 5.000 A, far at −5.000 A"
    assert label(1) == "c1"
    # All limits: the scale reaches them. A parameter changes: its line follows.
    for far in (5, 3):
        plots.js(f"limit({far}, true)")
        low, high = plots.js("stack.plots[0].scale")
        assert lines(0) == pytest.approx([-far, far], abs=(high - low) / 40)
        assert low <= -far and high >= far
    plots.js("(async () => { stack.limit([], true); await drawn(); })()")
    assert lines(0) == [] and label(0) == "c0"
    assert plots.complaints() == []


@needs_browser
@pytest.mark.parametrize("count", [40, 40_000])  # fewer and more samples than pixels
def test_a_capture_lies_over_another_with_the_trigger_at_the_same_time(plots, count):
    """The one that is shown is 1 from -0.1 s to 0.4 s. The other lasts from -0.3 s to 0.7 s, is 2
    and from the trigger on 3, and has a gap from 0.5 s to 0.6 s."""
    show(plots, [[1.0] * 50, [1.0] * 50], units="AV")
    plots.js(f"""(async () => {{
      const {{ Overlay }} = await import('/overlay.js');
      const count = {count};
      const time = (i) => -0.3 + i / count;
      const value = (t) => (t >= 0.5 && t < 0.6 ? NaN : t >= -1e-9 ? 3 : 2);
      const samples = Float32Array.from({{ length: count }}, (_, i) => value(time(i)));
      stack.trigger = true;
      stack.bins = newBins(2, 50, 0.01);
      stack.bins.start_s = -0.1;
      stack.bins.put(0, 50, Array(100).fill(1), Array(100).fill(1));
      stack.window_s = 0.5;
      stack.over = new Overlay({{ number: 7, start_s: -0.3, dt_s: 1 / count, count,
        columns: new Map([['c0', samples]]) }});
      stack.rescale();
      await drawn();
    }})()""")
    values, pixel = columns(plots)
    at = -0.3 + np.arange(len(values)) / len(values)  # all of both is shown
    own = (at > -0.09) & (at < 0.38)
    drawn = ~np.isnan(values[:, 0])

    def inked(mask):
        """Levels that are drawn there; the trigger's line and its neighbours are left out."""
        found = values[mask & drawn & (np.abs(at) > 0.03)]
        return found[:, 0].min(), found[:, 1].max()

    assert inked(own & (at < 0)) == pytest.approx((1, 2), abs=2 * pixel)
    assert inked(own & (at > 0)) == pytest.approx((1, 3), abs=2 * pixel)
    assert inked(at < -0.11) == pytest.approx((2, 2), abs=2 * pixel)
    assert inked(at > 0.41) == pytest.approx((3, 3), abs=2 * pixel)
    assert not drawn[(at > 0.51) & (at < 0.57)].any()
    dashes = drawn[at < -0.11].mean()
    assert 0.3 < dashes < 0.8  # dashed, and the own trace is solid
    assert drawn[own].all()
    other = columns(plots, "--trace-1", 1)[0]  # its channel is not in the other capture
    assert np.isnan(other[at < -0.11, 0]).all()
    # The legend reads both at the pointer.
    plots.down = False
    pointer(plots, 0.5, "mouseMoved")
    plots.until("stack.plots[0].box.querySelector('.over').textContent === '3.000'")
    read = "[...document.querySelectorAll('.chip output, .over')].map((e) => e.textContent)"
    assert plots.js(read) == ["1.000", "3.000", "1.000", ""]
    assert plots.complaints() == []


@needs_browser
def test_keys_move_the_pointer_and_set_marks(plots):
    """The same as with the mouse: two marks, and the part between them."""
    show(plots, [list(range(500))] * 2, units="AV")  # 5 s
    plots.js("stack.box.focus()")
    cursor = "said.cursor_s"
    for key, wanted in (("ArrowRight", -2.4), ("ArrowRight", -2.3), ("ArrowLeft", -2.4)):
        plots.key(key, key)
        assert plots.js(cursor) == pytest.approx(wanted, abs=0.01)
    plots.key("Enter", "Enter", "\r")
    for _ in range(10):
        plots.key("ArrowLeft", "ArrowLeft")
    plots.key("Enter", "Enter", "\r")
    marks = plots.js("stack.markPair()")
    assert marks == pytest.approx([-2.4, -3.4], abs=0.02)
    plots.js("drawn()")
    lines = np.flatnonzero(~np.isnan(columns(plots, "--accent", plot=1)[0][:, 0]))
    wide = len(columns(plots)[0])
    assert sorted(set(np.round(lines / wide * 5 - 5, 1))) == pytest.approx([-3.4, -2.4])
    plots.key("z", "KeyZ", "z")
    assert plots.js("said.view") == pytest.approx([5 - 3.4, 5 - 2.4], abs=0.03)
    assert plots.js("stack.markPair()") == []
    for _ in range(2):  # a third mark is none
        plots.key("Enter", "Enter", "\r")
    assert len(plots.js("stack.markPair()")) == 2
    plots.key("Enter", "Enter", "\r")
    assert plots.js("stack.markPair()") == []
    assert plots.js("stack.box.getAttribute('aria-label')").count("arrow") == 1


@needs_browser
def test_bins_are_those_that_were_put(plots):
    """Against a plain table: holes, bins that come again, more bins than there is room for."""
    rng = np.random.default_rng(5)
    room, first, table, puts = 40, 7, {}, []
    for _ in range(60):
        count = int(rng.integers(1, 12))
        values = np.sort(rng.integers(-9, 9, (count, 2)), axis=1)
        puts.append([first, count, values[:, 0].tolist(), values[:, 1].tolist()])
        table |= {first + i: values[i].tolist() for i in range(count)}
        end = first + count
        first = end + int(rng.choice([-1, 0, 0, 3, 60], p=[0.4, 0.2, 0.2, 0.15, 0.05]))
    found = plots.js(f"""(() => {{
      const bins = newBins(1, {room}, 0.5);
      for (const one of {json.dumps(puts)}) bins.put(...one);
      const at = (bin) => bins.at(0, (bin + 0.5) * 0.5);
      return {{ rows: bins.rows[0].length, times: bins.times(0), end: bins.end, begin: bins.begin,
        at: Array.from({{ length: bins.end + 5 }}, (_, bin) => at(bin)) }};
    }})()""")
    assert found["end"] == end and found["end"] - found["begin"] <= room
    assert found["rows"] == len(found["times"]) == 2 * (end - found["begin"])
    assert found["times"][0] == found["begin"] / 2 and found["times"][-1] == (end - 1) / 2
    kept = range(found["begin"], end)
    wanted = [table.get(bin) if bin in kept else None for bin in range(end + 5)]
    assert found["at"] == wanted
    assert sum(one is not None for one in wanted) > 20
