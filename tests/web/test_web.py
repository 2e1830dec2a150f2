"""The drive in a browser: the channels that the simulation has, in node and in Chromium, and the
page used as a user does."""

import base64
import gzip
import json
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from chromium import CUT_OFF, Chromium, program
from example_setups import EXAMPLES
from waiting import until

import web
from hexatorque import firmware, load
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import lib
from hexatorque.plant.vsd import PHASES
from hexatorque.recording.recording import Recording
from hexatorque.setups import SetupError

ROOT = Path(__file__).resolve().parents[2]
NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="no node: apt-get install nodejs")
needs_chromium = pytest.mark.skipif(program() is None, reason="no chromium")
#: Set-up, scheme, and a phase that opens or "".
CASES = {
    "ddr": ("paper-a", "ddr", ""),
    "dtc3": ("paper-b", "dtc3", ""),
    "db-dtfc": ("symmetrical", "db-dtfc", ""),
    "open": ("symmetrical", "db-dtfc", "u1"),
}
#: A machine of another kind, which needs sines at each step, on a page of its own.
OF_ANOTHER_KIND = ("magnet-interior", "db-dtfc", "")
DURATION_S = 2.0


def page_of(tmp_path_factory, *words):
    """The folder that `python tools/web.py` writes with these words."""
    for name in web.NEEDED:
        pytest.importorskip(name, reason="pip install 'hexatorque[docs]'")
    folder = tmp_path_factory.mktemp("web")
    web.main(["-o", str(folder), *words])
    return folder


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder with the page."""
    return page_of(tmp_path_factory)


def course_of(case, f_isr_Hz):
    """What happens when, in periods: start, speed, load, an open phase, stop."""
    _, scheme, phase = case
    at = [round(t * f_isr_Hz) for t in (0.5, 0.7, 1.0, 1.6)]
    return [
        [0, "write", {"scheme": scheme}],
        [0, "start"],
        [at[0], "write", {"speed_ref_rpm": 600}],
        [at[1], "load", 0.5],
        *([[at[2], "open", phase, True]] if phase else []),
        [at[3], "stop"],
    ]


def native(case):
    """The same course in the simulation: channels, (periods, channels), the plant's true values,
    (periods, values), and what the page gets."""
    setup, _, _ = case
    sim = SimulatedDrive(load(setup), samples_per_period=1)
    f_isr_Hz = 1 / sim.period_s
    course = course_of(case, f_isr_Hz)
    periods = round(DURATION_S * f_isr_Hz)
    acts = {
        "write": lambda values: sim.set_many(values),
        "start": sim.start,
        "stop": sim.stop,
        "load": lambda torque_Nm: sim.set("load_Nm", torque_Nm),
        "open": lambda phase, _: sim.break_leg(phase, "open"),
    }
    rows, plant, states = [], [], []
    for begin, (_, act, *given) in enumerate(course):
        acts[act](*given)
        until = course[begin + 1][0] if begin + 1 < len(course) else periods
        if left := until - sim.periods:
            true, channels = sim.rows(left)
            rows.append(channels.copy())
            plant.append(true.copy())
            states.append(sim.condition.name)
    assert "run" in states and states[-1] in ("idle", "fault")
    given = {"setup": setup, "periods": periods, "course": course}
    return np.concatenate(rows), np.concatenate(plant), given


def same_bits(answer, channels, plant):
    """Any NaN is as good as another: a browser may choose its sign. A row of the page has room for
    more of the plant's values."""
    for raw, here in ((answer["rows"], channels), (answer["plant"], plant)):
        there = np.frombuffer(base64.b64decode(raw), np.float32).reshape(len(here), -1)
        there = np.ascontiguousarray(there[:, : here.shape[1]])
        equal = (there.view(np.uint32) == here.view(np.uint32)) | (np.isnan(there) & np.isnan(here))
        assert equal.all(), np.argwhere(~equal)[:5]
    assert answer["violations"] == 0
    print(f"{answer['time_s'] / answer['took_s']:.0f} x real time")


IN_NODE = """
import fs from "fs";
import { Board } from "./board.js";
const [folder, given] = process.argv.slice(2);
const read = (name) => fs.readFileSync(`${folder}/${name}`);
const board = new Board(new WebAssembly.Module(read("drive.wasm")), JSON.parse(read("tables.json")),
  new Uint8Array(read("setups.bin")), "", null, () => {});
for (const line of fs.readFileSync(given, "utf8").split("\\n").filter(Boolean)) {
  const [path, body] = JSON.parse(line);
  let said;
  try {
    if (path === "pass") board.pass(body);
    else if (path === "status") said = { answer: board.status() };
    else said = { answer: board.ask(path, body) };
  } catch (error) {
    said = { error: error.message };
  }
  if (said) console.log(JSON.stringify(said));
}
"""


def asker(folder, tmp_path):
    """Ask a board of its own in node; each request is [path, body]. Returns the answers."""
    for path in (ROOT / "web").glob("*.js"):
        shutil.copy(path, tmp_path)
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "ask.js").write_text(IN_NODE)

    def ask(*requests):
        given = tmp_path / "requests"
        given.write_text("".join(json.dumps(one) + "\n" for one in requests))
        done = subprocess.run(
            [NODE, tmp_path / "ask.js", folder, given], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return [json.loads(line) for line in done.stdout.splitlines()]

    return ask


@pytest.fixture
def in_node(built, tmp_path):
    return asker(built, tmp_path)


@needs_node
def test_bits_of_a_machine_of_another_kind(tmp_path_factory, tmp_path, monkeypatch):
    """By the page's command `python tools/web.py mine.toml`."""
    *expected, given = native(OF_ANOTHER_KIND)
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(f'setup = "{OF_ANOTHER_KIND[0]}"\n')
    own = page_of(tmp_path_factory, "mine.toml")
    assert {path.name for path in own.iterdir()} >= {"drive.html", "drive.wasm", "setups.bin"}
    (answer,) = asker(own, tmp_path)(["/course", {**given, "setup": "mine"}])
    same_bits(answer["answer"], *expected)


@needs_node
@pytest.mark.parametrize("name", CASES)
def test_bits_in_node(name, in_node):
    *expected, given = native(CASES[name])
    (answer,) = in_node(["/course", given])
    same_bits(answer["answer"], *expected)


@pytest.fixture(scope="module")
def browser():
    with tempfile.TemporaryDirectory() as folder, Chromium(Path(folder)) as one:
        yield one


@pytest.fixture
def page(browser, built):
    """The page, opened from the disk."""
    page = browser.open(f"file://{built}/drive.html")
    page.until("document.body.dataset.state === 'idle'")
    page.js("localStorage.clear()")
    yield page
    assert page.complaints() == []
    page.close()
    browser.events.clear()


@needs_chromium
@pytest.mark.parametrize("name", CASES)
def test_bits_in_chromium(name, page):
    *expected, given = native(CASES[name])
    answer = page.js(f"hexatorque.ask('/course', {json.dumps(given)})")
    same_bits(answer, *expected)


def test_size(built):
    size = len(gzip.compress((built / "drive.html").read_bytes(), 9))
    assert size <= 150_000


@needs_node
def test_refusals(in_node):
    answers = in_node(
        ["/write", {"values": {"speed_ref_rpm": 1e9}}],
        ["/write", {"values": {"f_isr_Hz": 9000}}],
        ["/write", {"values": {"scheme": "best"}}],
        ["/clear", {}],
        ["/plant", {"load_Nm": 1e12}],
        ["/plant", {"open": {"z": True}}],
        ["/course", {"setup": "mine", "periods": 1, "course": []}],
        ["/commission/begin", {}],
        ["/channels", {"channels": ["plant.link_V"], "rate_Hz": 2000}],
        [
            "/capture/arm",
            {"channels": ["plant.torque_Nm"], "samples": 9, "pre": 0, "prescaler": 1}
            | {"trigger": "command"},
        ],
    )
    for answer, words in zip(
        answers,
        (
            "speed_ref_rpm = 1000000000: allowed range is ",
            "f_isr_Hz: belongs to the set-up",
            "scheme = best: choose one of ",
            "clear: not allowed in state idle",
            "load_Nm = 1000000000000: too much",
            "phase = z: choose one of u1, u2, w1, w2, v1, v2",
            "no set-up mine: choose one of paper-b, ",
            "/commission/begin: this page cannot do that",
            "channels: there is none",  # paper B's dc link is stiff
            "no channel plant.torque_Nm",  # the firmware captures what it knows
        ),
        strict=True,
    ):
        assert answer["error"].startswith(words) and "\n" not in answer["error"], answer


@needs_node
def test_misfits_are_told_as_the_simulation_tells_them(in_node):
    sim = SimulatedDrive(load("paper-b"))
    values = {"i_trip_A": 19.0}
    with pytest.raises(ValueError) as refused:
        sim.set_many(values)
    (answer,) = in_node(["/write", {"values": values}])
    assert answer["error"].replace(" ", "") == str(refused.value).replace(" ", "").replace(".0", "")


def test_a_setup_of_another_model():
    with pytest.raises(SetupError, match=r"^magnet-24v: machine.model = magnet: .*induction$"):
        web.held(["paper-b", "magnet-24v"])
    saturating = str(EXAMPLES / "magnet-saturation.toml")
    with pytest.raises(SetupError, match=r"model = magnet with saturation: .*here magnet$"):
        web.held(["magnet-interior", saturating])


def test_no_text_is_left_that_nothing_reads(built):
    wasm = (built / "drive.wasm").read_bytes()
    assert b"speed reference" not in wasm and b"|ddr|" in wasm


def test_the_addresses_of_texts_become_one():
    """A number that is equal to an address by chance does not move with the data: it stays. So does
    the address of what is read."""
    texts = b"\0speed_ref_rpm\0f_isr_Hz\0|read|\0"
    first, second, read = (texts.index(one) for one in (b"speed", b"f_isr", b"|read"))
    texts += bytes(-len(texts) % 4)

    def module(base, *words):
        data = texts + struct.pack("<4I", *words)
        size, address = len(data), [base & 0x7F | 0x80, base >> 7]
        assert size < 0x80 and address[1] < 0x40  # as LEB128: one octet, two octets
        segment = bytes([1, 0, 0x41, *address, 0x0B, size]) + data
        return b"\0asm\1\0\0\0" + bytes([11, len(segment)]) + segment

    base, chance = 1024, 1024 + second
    beyond = base + web.MOVED_BYTES
    one = module(base, base + first, base + second, chance, base + read)
    moved = module(beyond, beyond + first, beyond + second, chance, beyond + read)
    left = web.without_texts(one, moved)
    begin = len(one) - len(texts) - 16
    assert left[:begin] == one[:begin]
    assert struct.unpack("<4I", left[-16:]) == (base + first, base + first, chance, base + read)
    assert left[begin:-16].strip(b"\0") == b"|read|"


@needs_chromium
def test_a_browser_that_cannot_unpack_is_told(browser, built, tmp_path):
    old = "<head><script>delete globalThis.DecompressionStream</script>"
    html = (built / "drive.html").read_text(encoding="utf-8")
    (tmp_path / "old.html").write_text(html.replace("<head>", old, 1), encoding="utf-8")
    page = browser.open(f"file://{tmp_path}/old.html")
    page.until("!document.querySelector('#alarm').hidden")
    assert "cannot unpack" in page.js("document.querySelector('#alarm').textContent")
    page.close()
    browser.events.clear()


@needs_node
def test_the_log_has_what_happened(in_node):
    """An event of a trip is what the snapshot has, and the counters are what was done. Two seconds
    with the gates on end in a trip; a clear changes nothing."""
    over = "dc-link voltage too high"
    new, _, _, log, snapshot, _, cleared = (
        one["answer"]
        for one in in_node(
            ["/log", {}],
            ["/start", {}],
            ["pass", 21_000],  # the current sensors are calibrated for 0.04 s
            ["/write", {"values": {"vdc_max_V": 200}}],
            ["pass", 1000],
            ["/log", {}],
            ["/snapshot", {}],
            ["/clear", {}],
            ["pass", 1000],
            ["/log", {}],
        )
    )
    assert new["found"]["events"] == [] and new["found"]["starts"] == 0
    log, snapshot = log["found"], snapshot["found"]
    trip, start = log["events"]
    assert [one["event"] for one in (trip, start)] == [
        firmware.EVENTS[number] for number in (lib.HT_EVENT_TRIP, lib.HT_EVENT_START)
    ]
    assert trip["causes"] == snapshot["faults"] == [over] and trip["state"] == snapshot["state"]
    assert list(trip["currents_A"]) == list(PHASES) and trip["scheme"] == "dtc1"
    assert [*trip["currents_A"].values(), trip["vdc_V"]] == [*snapshot["i_A"], snapshot["vdc_V"]]
    assert start["causes"] == [firmware.reset_cause(lib.HT_RESET_POWER)]
    assert (log["powered_s"], log["gates_s"], log["starts"]) == (2, 2, 1)
    assert log["trips"] == {over: 1} and not log["kept"] and log["vdc_V"] >= snapshot["vdc_V"]
    assert cleared["found"]["events"] == log["events"]


@needs_node
def test_limits_that_act_are_told_with_their_time(in_node):
    """A shaft that cannot follow its reference because of the torque limit; then it may."""
    idle, *_, one, later, _, none = (
        one["answer"]
        for one in in_node(
            ["status", None],
            ["/start", {}],
            ["pass", 10_000],
            ["/write", {"values": {"torque_limit_Nm": 0.5, "speed_ref_rpm": 600}}],
            ["pass", 1000],
            ["status", None],
            ["pass", 1000],
            ["status", None],
            ["/write", {"values": {"torque_limit_Nm": 10, "speed_ref_rpm": 0}}],
            ["pass", 20_000],
            ["status", None],
        )
    )
    assert idle["limits"] == none["limits"] == []
    (before,), (after,) = one["limits"], later["limits"]
    assert before["name"] == after["name"] == "torque" and 0.09 < before["for_s"] <= 0.1
    assert after["for_s"] - before["for_s"] == pytest.approx(0.1, abs=1e-4)


def started(page):
    page.click("#start")
    page.until("document.body.dataset.state === 'run'")


def caught(page):
    """Let the page's downloads be kept in the page: name -> base64."""
    page.js(
        "(() => { window.got = {}; const make = URL.createObjectURL;"
        "URL.createObjectURL = (blob) => { window.last = blob; return make.call(URL, blob); };"
        "HTMLAnchorElement.prototype.click = function () { const name = this.download;"
        "window.last.arrayBuffer().then((raw) => { got[name] = btoa(new Uint8Array(raw)"
        ".reduce((text, one) => text + String.fromCharCode(one), '')); }); }; })()"
    )


def files(page, folder, count):
    page.until(f"Object.keys(got).length >= {count}")
    for name, text in page.js("got").items():
        (folder / name).write_bytes(base64.b64decode(text))
    return sorted(page.js("Object.keys(got)"))


@needs_chromium
def test_run_record_plot(page, tmp_path):
    caught(page)
    started(page)
    page.type("#quick input[aria-label=speed_ref_rpm]", "500")
    page.key("Enter", "Enter", "\r")
    page.type("#plant-load", "0.5")
    page.key("Enter", "Enter", "\r")
    page.until(
        "Math.abs(Number(document.querySelector('[data-figure=torque_Nm]').textContent)) > .3"
    )
    page.js("document.querySelector('#channels input[value=\"plant.torque_Nm\"]').click()")
    page.until("document.querySelector('#plots').textContent.includes('plant.torque_Nm')")
    page.click("#record")
    page.until("document.querySelector('#record').textContent.startsWith('1')")
    page.click("#record")
    (name,) = files(page, tmp_path, 1)
    recording = Recording.load(tmp_path / name)
    assert recording.meta["setup"] == "paper-b" and recording.rate_Hz == 2000
    assert abs(np.mean(recording["speed_rpm"]) - 500) < 20
    torque = recording["torque_Nm"], recording["plant.torque_Nm"]
    assert 0 < np.max(np.abs(np.subtract(*torque))) < 0.2  # an estimate, and the truth
    assert recording.units["plant.torque_Nm"] == "N m"
    done = subprocess.run(
        [sys.executable, "-m", "hexatorque", "plot", tmp_path / name, "-o", tmp_path / "p.png"],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and (tmp_path / "p.png").exists(), done.stderr
    page.key("Escape", "Escape")
    page.until("document.body.dataset.state === 'idle'")


@needs_chromium
def test_capture_and_its_files(page, tmp_path):
    caught(page)
    page.click("[data-panel=capture]")
    page.type("#samples", "300")
    page.choose("#trigger", "command")
    page.click("#capture-form button[type=submit]")
    page.until("document.querySelector('#capture-state').textContent.startsWith('waiting')")
    page.click("#start")
    page.until("document.querySelector('#see-capture').textContent === 'Capture 1'")
    for suffix in ("csv", "json", "npz"):
        page.js(f"document.querySelector('.downloads a[href*=\"capture.{suffix}\"]').dispatchEvent("
                "new MouseEvent('click', {bubbles: true, cancelable: true}))")  # fmt: skip
    assert files(page, tmp_path, 3) == ["capture-1.csv", "capture-1.json", "capture-1.npz"]
    one, other = (Recording.load(tmp_path / f"capture-1.{kind}") for kind in ("csv", "npz"))
    assert len(one) == 300 and one.meta == other.meta and one.meta["trigger_s"] == 0
    for channel in one.channels:
        np.testing.assert_array_equal(one[channel], other[channel])


@needs_chromium
def test_an_open_phase_under_a_scheme_that_does_not_bear_it(page):
    """The current that the others then must carry trips the drive, or a leg is found lost: the
    snapshot has the cause."""
    started(page)
    page.click("#plant-open input")
    page.until("document.body.dataset.state === 'fault'")
    page.until("document.querySelector('#snapshot h2')?.textContent")
    said = page.js("document.querySelector('#snapshot h2').textContent")
    assert said == page.js("document.querySelector('#faults').textContent")


@needs_chromium
def test_parameters_are_kept_in_the_browser(page, browser, built):
    kept = "hexatorque.ask('/values').then((values) => values.kp_speed_Nms_rad)"
    before = page.js(kept)
    page.js(f"hexatorque.ask('/write', {{values: {{kp_speed_Nms_rad: {2 * before}}}}})")
    page.js("hexatorque.ask('/parameters/keep', {})")
    page.until("localStorage.length === 1")
    other = browser.open(f"file://{built}/drive.html")
    other.until("document.body.dataset.state === 'idle'")
    assert other.js(kept) == pytest.approx(2 * before)
    was = other.js("Object.values(localStorage)[0]")
    other.js("hexatorque.ask('/parameters/forget', {})")
    other.until(f"Object.values(localStorage)[0] !== {was!r}")
    other.close()
    third = browser.open(f"file://{built}/drive.html")
    third.until("document.body.dataset.state === 'idle'")
    assert third.js(kept) == before
    third.close()


def reloaded(page, expression):
    """Wait for an expression in a page that loads again: meanwhile it answers nothing."""

    def there():
        try:
            return page.js(f"!!({expression})")
        except AssertionError:
            return False

    until(there)


@needs_chromium
def test_choices_are_read_whole(page):
    assert page.js(CUT_OFF) == []


@needs_chromium
def test_another_setup_and_one_that_is_not_there(page):
    page.choose("#plant-setup", "symmetrical")
    reloaded(page, "document.querySelector('#device')?.textContent.startsWith('symmetrical')")
    page.js("(() => { location.hash = 'nobody'; location.reload(); })()")
    reloaded(
        page, "document.querySelector('#alarm')?.textContent.startsWith('no set-up nobody: choose')"
    )


@needs_chromium
def test_analysis(page):
    """The x-y view needs samples that only the drive's thread has."""
    started(page)
    page.choose("#analyse", "xy")
    page.until("document.querySelector('#analysis .said').textContent.includes('equal scales')")


@needs_chromium
def test_the_page_shows_limits_and_the_log(page):
    started(page)
    acting = "document.querySelector('#acting')"
    assert page.js(f"{acting}.hidden")
    page.js("hexatorque.ask('/write', {values: {torque_limit_Nm: 0.3, speed_ref_rpm: 700}})")
    page.until(f"!{acting}.hidden")
    assert page.js(f"{acting}.textContent").startswith("Torque is limited: torque for 0 s")
    page.js("hexatorque.ask('/write', {values: {vdc_max_V: 200}})")
    page.until("document.body.dataset.state === 'fault'")
    page.until(f"{acting}.hidden")
    page.click("[data-panel=fault]")
    page.click("#log summary")
    page.until("document.querySelectorAll('#log tr').length === 2")
    said = page.js("document.querySelector('#log').textContent")
    assert "dc-link voltage too high 1" in said and "power-on" in said and "starts 1." in said
