// The page: it shows what it hears of the drive, and sends commands.

import { Analysis } from "./analysis.js";
import { $, make, order, toast } from "./asking.js";
import { ask, listen as listenTo } from "./backend.js";
import { Bins } from "./bins.js";
import { commissioning, fetchCourse, guide, tick } from "./commission.js";
import { levels } from "./limits.js";
import { decode, parse, show } from "./numbers.js";
import { Overlay, samplesOf } from "./overlay.js";
import {
  NUMBER, asText, asValue, editor, fetchValues, lockParameters, mistake, parameters, values, write,
} from "./parameters.js";
import { plant } from "./plant.js";
import { sets } from "./sets.js";
import { Stack } from "./stack.js";

const WINDOWS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20];
const RATES_HZ = [200, 500, 1000, 2000, 2500, 5000, 10000];
//: Channels that move in steps, not along a line.
const STEPS = new Set(["torque_level", "flux_level", "sector"]);
const QUICK = [
  ["scheme"], ["control_mode"], ["speed_ref_rpm", 100], ["torque_ref_Nm", 1], ["flux_ref_Wb", 0.05],
];
//: Shortest time between two answers to the monitor.
const ANSWER_MS = 200;
//: If the monitor sends nothing for this long, the numbers go blank and an alarm is shown.
const STALE_MS = 1000;
const SILENT_MS = 1500;
//: What the last line says of a drive that the page itself holds: there is no link.
const HERE = ["time", "samples", "busy"];
const FIGURES = [["speed_rpm", "speed"], ["torque_Nm", "torque"], ["vdc_V", "dc link"]];

let device = null;
let status = null;
let stopListening = null;
let heard_ms = 0;
let answered_ms = 0;
let answering = false;
let epoch = -1; // of the samples that the page has
let anew = true; // the next samples are not a part of those
let captured = null; // the capture that is shown
let captures = []; // what can be shown, without samples
let armedHere = false;
let seen = { values: -1, snapshot: -1, capture: 0, commissioning: 0 };
let channelRow = new Map();

// -- commands ----------------------------------------------------------------------------

/** Whether the drive's gates are on, or may go on without another command. */
const working = () => Boolean(status?.working);

async function stop() {
  $("stop").classList.add("pressed");
  setTimeout(() => $("stop").classList.remove("pressed"), 250);
  if (!(await order("/stop"))) toast("STOP did not get through: use the hardware's own stop", "bad");
}

function typing(element) {
  return element instanceof HTMLInputElement && element.type !== "checkbox";
}

function keys() {
  // A key that stops must not also press the button that has the focus, neither when it goes
  // down nor when it goes up.
  for (const kind of ["keydown", "keyup"]) {
    document.addEventListener(kind, (event) => {
      const space = event.code === "Space" && working() && !typing(event.target);
      if (event.key !== "Escape" && !space) return;
      event.preventDefault();
      event.stopPropagation();
      if (kind === "keydown" && !event.repeat) stop();
    }, true);
  }
  $("stop").addEventListener("click", stop);
  $("start").addEventListener("click", () => order("/start"));
  $("clear").addEventListener("click", () => order("/clear"));
  window.addEventListener("beforeunload", (event) => {
    if (working() && status.guarded) event.preventDefault();
  });
}

// -- live --------------------------------------------------------------------------------

const live = new Stack(make("div", { className: "stack" }), {
  words: wordFor,
  zoomed: (view) => {
    if (view) pause(true);
    history().then(() => requestAnimationFrame(() => analysis.refresh()));
  },
  marked: () => analysis.refresh(),
  cursor: (cursor, mark) => seeing === "live" && readout(cursor, mark),
});
const burst = new Stack(make("div", { className: "stack" }), {
  words: wordFor,
  zoomed: () => { $("whole").hidden = !burst.view; analysis.refresh(); },
  marked: () => analysis.refresh(),
  cursor: (cursor, mark) => seeing === "capture" && readout(cursor, mark),
});
burst.trigger = true;
let seeing = "live";
let paused = false;
let held = null; // bins as they were when the page was paused
const analysis = new Analysis($("analysis"), $("analyse"), () => (
  seeing === "live"
    ? { stack: live, ready: epoch >= 0, running: !paused, span: livePart }
    : { stack: burst, ready: Boolean(captured), running: false, span: capturePart }
));

/** What the analysis needs for a part of the traces, counted from time 0. */
const livePart = (from_s, to_s) => ({
  span: { begin_s: live.zero_s + from_s, end_s: live.zero_s + to_s, epoch, names: live.series.map((one) => one.name) },
});

/** The samples of the capture from one time to before another. */
function capturePart(from_s, to_s) {
  const place = (time_s) => Math.min(captured.count, Math.max(0, Math.ceil((time_s - captured.start_s) / captured.dt_s - 1e-6)));
  const [first, last] = [place(from_s), place(to_s)];
  const columns = Object.fromEntries([...captured.columns].map(([name, values]) => [name, values.slice(first, last)]));
  return { samples: { rate_Hz: 1 / captured.dt_s, count: last - first, columns } };
}

function listen() {
  stopListening?.();
  anew = true;
  const bins = Math.max(200, Math.min(4000, Math.round($("plots").clientWidth) || 900));
  stopListening = listenTo(`window_s=${live.window_s}&bins=${bins}`, (frame) => {
    heard_ms = performance.now();
    if (frame.status) {
      hear(frame.status);
      newest(frame.newest ?? null, frame.mean ?? null);
    }
    if (frame.bins && !paused) take(frame.bins);
    if (frame.sent_s) answer(frame.page, frame.sent_s);
  });
}

/** Tell the monitor that this script runs and has shown a frame. If no page answers, the monitor
 * stops the drive. This is called when a frame arrives and not by a timer, because browsers slow
 * down the timers of a hidden page. */
async function answer(page, sent_s) {
  if (answering || performance.now() - answered_ms < ANSWER_MS) return;
  answering = true;
  answered_ms = performance.now();
  try {
    await ask("/beat", { page, sent_s, visible: !document.hidden });
  } catch {
    // The next frame is answered again.
  } finally {
    answering = false;
  }
}

/** Show the newest sample in the legend, and the mean of the latest ones in the header; null: there
 * is none, or it is too old. */
function newest(sample, mean) {
  figures(mean ?? []);
  if (!paused) live.newest(sample ?? []);
}

function take(news) {
  if (anew || news.epoch !== epoch || !live.bins) {
    if (!status || news.epoch !== status.epoch) return;
    anew = false;
    epoch = news.epoch;
    const count = live.series.length;
    live.bins = new Bins(count, Math.ceil(live.window_s / news.dt_s) + 2, news.dt_s);
  }
  const lo = decode(news.lo);
  live.bins.put(news.first, news.count, lo, news.hi ? decode(news.hi) : lo);
  if (seeing === "live") live.draw();
}

/** Make the plots of the channels that are traced now. */
function retrace() {
  live.bins = null;
  epoch = -1;
  live.show(series(status.channels));
  if (seeing === "live") analysis.open();
  choose(status.channels);
  const rate = [...$("rate").options].find((option) => Math.abs(option.value - status.rate_Hz) < 0.5);
  if (rate && !orders) $("rate").value = rate.value;
}

/** Five colours that a colour-blind person can tell apart, each solid and dashed. */
const styleOf = (index) => ({ colour: index % 5, dashed: index % 10 >= 5 });

function series(names) {
  return names.map((name, index) => {
    const row = traceable().find((channel) => channel.name === name);
    const steps = STEPS.has(name) || wordsOf(name) !== null;
    const reference = name.includes("_ref_");
    return { name, index, ...styleOf(index), unit: row.unit, help: row.help, steps, reference };
  });
}

function wordsOf(name) {
  if (name === "state") return device.states;
  const row = device.parameters.find((parameter) => parameter.name === name);
  return row && row.choices.length ? row.choices : null;
}

function wordFor(name, value) {
  if (name === "faults" || name === "warnings") {
    return device[name].filter((row) => value & row.bit).map((row) => row.name).join(", ") || "none";
  }
  return wordsOf(name)?.[value] ?? null;
}

function pause(on) {
  if (on === paused) return;
  paused = on;
  $("pause").setAttribute("aria-pressed", String(on));
  $("pause").textContent = on ? "Resume" : "Pause";
  held = on ? live.bins : null;
  if (!on) {
    live.view = null;
    live.setMarks();
    listen();
  }
  analysis.refresh();
  $("whole").hidden = !(seeing === "live" ? live.view : burst.view);
}

/** Get the chosen part of the history, as finely as the plot can show it. */
async function history() {
  $("whole").hidden = !live.view;
  if (!paused) return;
  if (!live.view) {
    live.bins = held;
    return;
  }
  const [begin, end] = live.view;
  const bins = Math.min(8000, 2 * $("plots").clientWidth);
  let news;
  try {
    news = await ask(`/history?begin_s=${Math.max(0, begin)}&end_s=${end}&bins=${bins}`);
  } catch {
    return; // draw the coarser samples that the page has
  }
  if (!paused || !live.view || live.view[0] !== begin || news.epoch !== epoch || !news.count) return;
  const fine = new Bins(live.series.length, news.count, news.dt_s);
  const lo = decode(news.lo);
  fine.put(news.first, news.count, lo, news.hi ? decode(news.hi) : lo);
  live.bins = fine;
  live.draw();
}

function readout(cursor_s, mark_s) {
  const time = (s) => (Math.abs(s) < 0.5 ? `${show(s * 1e3)} ms` : `${show(s)} s`);
  let text = cursor_s === null ? "" : time(cursor_s);
  if (cursor_s !== null && mark_s !== null && cursor_s !== mark_s) {
    const apart = cursor_s - mark_s;
    text = `Δ ${time(apart)}  ·  ${show(Math.abs(1 / apart))} Hz`;
  }
  $("cursor").textContent = text;
}

let limited = ""; // what the plots show of limits

/** Limits follow the parameters, the state and what was chosen. Those of a capture are as they were
 * when it was taken. */
function limits() {
  const choice = $("limits").value;
  const shown = choice === "none" ? [] : [
    [live, levels(device.limits, values, status?.state)],
    [burst, captured ? levels(device.limits, captured.values, captured.meta.state) : []],
  ];
  const text = JSON.stringify([choice, shown.map(([, found]) => found)]);
  if (text === limited) return;
  limited = text;
  for (const [stack, found] of shown.length ? shown : [[live, []], [burst, []]]) {
    stack.limit(found, choice === "all");
  }
}

function see(what) {
  seeing = what;
  document.body.dataset.seeing = what;
  for (const name of ["live", "capture", "guide"]) {
    $(`see-${name}`).setAttribute("aria-selected", String(name === what));
  }
  const stack = { live, capture: burst }[what];
  $("plots").replaceChildren(stack?.box ?? guide);
  $("whole").hidden = !stack?.view;
  stack?.draw();
  if (stack) analysis.open();
  else $("analysis").hidden = true;
}

function tools() {
  for (const window_s of WINDOWS_S) $("window").append(new Option(`${window_s} s`, window_s));
  $("window").value = live.window_s;
  $("window").addEventListener("change", () => {
    live.window_s = Number($("window").value);
    pause(false);
    listen();
  });
  $("rate").append(new Option("fastest", ""));
  for (const rate of RATES_HZ) {
    $("rate").append(new Option(`${rate} Hz`, rate));
  }
  $("rate").addEventListener("change", () => trace(choice));
  $("pause").addEventListener("click", () => pause(!paused));
  $("whole").addEventListener("click", () => (seeing === "live" ? live : burst).whole());
  $("limits").addEventListener("change", limits);
  $("capture-shown").addEventListener("change", () => showCapture(Number($("capture-shown").value)));
  $("capture-over").addEventListener("change", layOver);
  $("see-live").addEventListener("click", () => see("live"));
  $("see-capture").addEventListener("click", () => see("capture"));
  $("see-guide").addEventListener("click", () => see("guide"));
  $("record").addEventListener("click", async () => {
    const ends = Boolean(status.record); // the status is another one when the answer comes
    const done = ends
      ? await order("/record/stop")
      : await order("/record/start", { suffix: $("suffix").value });
    if (done) toast(`${ends ? "recorded" : "recording to"} ${done.file}`);
  });
  let resized = 0;
  new ResizeObserver(() => {
    clearTimeout(resized);
    resized = setTimeout(() => { if (!paused && device) listen(); }, 400);
  }).observe($("plots"));
}

// -- data from the server ----------------------------------------------------------------

function hear(now) {
  const before = status;
  status = now;
  document.body.dataset.state = now.plugged && !now.broken ? now.state : "unknown";
  document.body.dataset.faulty = String(now.faults.length > 0);
  document.body.dataset.working = String(now.working);
  $("state").textContent = now.plugged ? now.state || "–" : "unplugged";
  $("faults").textContent = now.faults.join(", ");
  $("faults").hidden = !now.faults.length;
  const acting = (now.limits ?? []).map((one) => `${one.name} for ${one.for_s.toFixed(0)} s`).join(", ");
  $("acting").hidden = !acting;
  $("acting").textContent = `Torque is limited: ${acting}`;
  $("start").disabled = !now.may_start || now.working || !now.plugged;
  $("clear").disabled = !now.may_clear || !now.plugged;
  alarm();
  resetBanner(now.reset);
  titleOf(now);
  live.marks = now.marks_s.map((time_s) => ({ time_s, text: "board reset" }));
  linkTable(now);
  record(now.record);
  $("capture-state").textContent = now.capture_state;
  const armed = !["", "complete"].includes(now.capture_state);
  $("trigger-now").disabled = $("cancel").disabled = !armed;
  if (!before || now.epoch !== before.epoch) retrace();
  if (now.f_isr_Hz !== before?.f_isr_Hz) {
    for (const option of $("rate").options) option.hidden = Number(option.value) > now.f_isr_Hz;
    shape();
  }
  if (now.values !== seen.values) {
    seen.values = now.values;
    fetchValues().catch(() => { seen.values = -1; });
  }
  if (now.snapshot !== seen.snapshot) {
    fetchSnapshot(now.snapshot);
    fetchLog();
  }
  if (now.capture !== seen.capture) fetchCapture(now.capture);
  if (now.commissioning !== seen.commissioning) {
    seen.commissioning = now.commissioning;
    fetchCourse().catch(() => { seen.commissioning = -1; });
  }
  tick();
  // A board of protocol 2.0 does not say when the gates are on: it refuses by itself.
  if (!before || before.state !== now.state || before.working !== now.working) lockParameters(working() && device.minor > 0);
  limits();
}

function resetBanner(text) {
  $("reset").hidden = !text;
  if ($("reset").firstChild.textContent !== text) $("reset").firstChild.textContent = text;
}

/** The title can be seen while the page is hidden. */
function titleOf(now) {
  const name = `${device.device} · hexatorque monitor`;
  const warn = document.hidden && now.stops_in_s !== null;
  const title = warn ? `⚠ stops in ${Math.ceil(now.stops_in_s)} s: show this page · ${name}` : name;
  if (document.title !== title) document.title = title;
}

function alarm() {
  const silent_ms = performance.now() - heard_ms;
  const silent = silent_ms > SILENT_MS;
  if (silent_ms > STALE_MS && status) newest(null, null);
  let text = "";
  if (silent) text = "No word from the monitor. A drive that it started stops by itself.";
  else if (status?.broken) text = status.broken;
  else if (status && !status.plugged) {
    text = `${device.port} is gone. A drive that was started from here stops by itself.`;
  } else if (status?.notice) text = status.notice;
  if (silent) {
    document.body.dataset.state = "unknown";
    $("state").textContent = "unknown";
    $("start").disabled = $("clear").disabled = true;
  }
  $("alarm").hidden = !text;
  if ($("alarm").textContent !== text) $("alarm").textContent = text;
}

function linkTable(now) {
  const board = now.board_damaged + now.board_overruns;
  const rows = [
    ["time", `${now.time_s.toFixed(1)} s`],
    ["samples", `${Math.round(now.measured_Hz)} /s`, Math.round(now.rate_Hz) + " /s wanted"],
    ["gaps", now.gaps, "", now.gaps],
    ["lost samples", now.lost, "", now.lost],
    ["damaged frames", now.damaged, "that this computer received", now.damaged],
    ["retries", now.retries, "requests that were sent again", now.retries],
    ["reconnects", now.reconnects, "", now.reconnects],
    ["board resets", now.resets, "while this monitor was connected", now.resets],
    ["board damaged", board, `${now.board_damaged} damaged frames, ${now.board_overruns} overruns of its receiver`, board],
    ["board dropped", now.board_dropped, "samples for which the line had no room", now.board_dropped],
    ["pages", now.pages, "that show this drive"],
    ...(device.plant ? [["busy", `${show(100 * now.busy, 2)} %`, "of its time this page computes"]] : []),
  ].filter(([name]) => !device.plant || HERE.includes(name));
  const list = $("link");
  if (list.children.length !== rows.length) {
    list.replaceChildren(...rows.map(([name]) => make("div", {}, make("dt", { textContent: name }), make("dd"))));
  }
  rows.forEach(([name, value, title = "", bad = 0], i) => {
    const box = list.children[i];
    box.title = title;
    box.dataset.name = name;
    box.classList.toggle("bad", bad > 0);
    box.lastChild.textContent = value;
    box.hidden = (name === "pages" && value < 2) || (name === "board resets" && value < 1);
  });
}

function record(now) {
  $("record").setAttribute("aria-pressed", String(Boolean(now)));
  $("record").lastChild.textContent = now ? `${now.seconds.toFixed(1)} s` : "Record";
  $("record").title = now ? now.file : "record the traces to a file on this computer";
  $("suffix").hidden = Boolean(now || device.plant);
}

function figures(sample) {
  if (!$("figures").children.length) {
    for (const [channel, name] of FIGURES) {
      const row = device.channels.find((one) => one.name === channel);
      if (!row) continue;
      const value = make("b", { textContent: "–" });
      value.dataset.figure = channel;
      $("figures").append(make("div", {},
        make("dt", { textContent: name, title: "mean of the latest quarter of a second" }),
        make("dd", {}, value, make("small", { textContent: row.unit }))));
    }
  }
  for (const value of $("figures").querySelectorAll("b")) {
    const place = status.channels.indexOf(value.dataset.figure);
    value.closest("div").hidden = place < 0;
    if (place >= 0) value.textContent = show(sample[place]);
  }
}

// -- traces to choose --------------------------------------------------------------------

/** Rows of the channels that may be traced. A page that holds its drive itself has the plant's, too. */
const traceable = () => [...device.channels, ...(device.plant?.channels ?? [])];

function byUnit(rows) {
  const groups = new Map();
  for (const row of rows) {
    if (!groups.has(row.unit)) groups.set(row.unit, []);
    groups.get(row.unit).push(row);
  }
  return [...groups].sort((a, b) => Number(!a[0]) - Number(!b[0]));
}

function checkList(box, all, changed) {
  const rows = new Map();
  for (const [unit, channels] of byUnit(all)) {
    const list = make("fieldset", {}, make("legend", { textContent: unit || "no unit" }));
    for (const channel of channels) {
      const input = make("input", { type: "checkbox", value: channel.name });
      input.addEventListener("change", () => changed(input));
      const swatch = make("i");
      list.append(make("label", { title: channel.help }, input, swatch,
        make("span", { textContent: channel.name }), make("small", { textContent: channel.help })));
      rows.set(channel.name, { input, swatch });
    }
    box.append(list);
  }
  return rows;
}

function channels() {
  $("channels-hint").textContent =
    `Up to ${device.stream_channels} channels. More of them leave fewer samples per second.`;
  channelRow = checkList($("channels"), traceable(), (input) => {
    const others = choice.filter((name) => name !== input.value);
    trace(input.checked ? [...others, input.value] : others);
  });
}

let choice = []; // the channels that are traced once all requests are done
let ordered = Promise.resolve();
let orders = 0;

/** Send one request after the other, so that the last of several quick clicks counts. */
function trace(names) {
  const rate = $("rate").value;
  pause(false);
  choice = names;
  orders += 1;
  ordered = ordered.then(async () => {
    const done = await order("/channels", { channels: names, rate_Hz: rate ? Number(rate) : null });
    orders -= 1;
    choose(done ? done.channels : status.channels);
  });
}

function choose(names) {
  if (orders) return;
  choice = [...names];
  for (const [name, { input, swatch }] of channelRow) {
    const place = names.indexOf(name);
    input.checked = place >= 0;
    const { colour, dashed } = styleOf(place);
    swatch.style.background = place >= 0 ? `var(--trace-${colour})` : "";
    swatch.classList.toggle("dashed", dashed);
  }
}

// -- the quick ones ----------------------------------------------------------------------

const quickRow = new Map();

function showQuick() {
  limits();
  for (const [name, { input }] of quickRow) {
    if (document.activeElement !== input || input.tagName === "SELECT") input.value = asText(values[name]);
  }
  const torque = values.control_mode === "torque";
  quickRow.get("speed_ref_rpm")?.box.classList.toggle("off", torque);
  quickRow.get("torque_ref_Nm")?.box.classList.toggle("off", !torque);
}

function quick() {
  for (const [name, step] of QUICK) {
    const row = device.parameters.find((parameter) => parameter.name === name);
    if (!row) continue;
    const input = editor(row);
    const box = make("div", { className: "quick" });
    const send = async (text) => {
      const shown = input.value;
      const wrong = mistake(row, text);
      if (wrong) toast(`${name}: ${wrong}`, "bad");
      else await write({ [name]: asValue(row, text) });
      // The answer takes a while: what was typed meanwhile stays.
      if (input.value === shown) input.value = asText(values[name]);
    };
    box.append(make("label", { title: row.help },
      make("span", { textContent: row.help }),
      make("span", { className: "field" }, input, make("span", { textContent: row.unit }))));
    if (step) {
      const by = (change) => {
        const next = Number((Number(values[name]) + change).toPrecision(12));
        send(String(Math.min(row.max, Math.max(row.min, next))));
      };
      const button = (text, act) => {
        const element = make("button", { type: "button", textContent: text });
        element.addEventListener("click", act);
        return element;
      };
      const steps = make("div", { className: "steps" },
        button(`−${step}`, () => by(-step)), button(`+${step}`, () => by(step)));
      if (row.min <= 0) steps.append(button("0", () => send("0")));
      if (row.min < 0) steps.append(button("reverse", () => send(String(-Number(values[name])))));
      box.append(steps);
      input.addEventListener("keydown", (event) => { if (event.key === "Enter") send(input.value); });
      input.addEventListener("blur", () => { input.value = asText(values[name]); });
    } else {
      input.addEventListener("change", () => send(input.value));
    }
    quickRow.set(name, { input, box });
    $("quick").append(box);
  }
  $("quick").append(make("p", { className: "hint", textContent:
    "Enter applies. Esc stops, anywhere; so does space while the drive works." + (device.plant ? "" :
      ` A drive that was started from here stops when no page has answered for ${device.silent_s} s, ` +
      `or when all pages have been hidden for ${device.hidden_s} s.`) }));
}

// -- burst capture -----------------------------------------------------------------------

let captureRow = new Map();

function capture() {
  const names = { rising: "rises through", falling: "falls through", command: "a command", fault: "a fault" };
  for (const trigger of device.triggers) $("trigger").append(new Option(names[trigger] ?? trigger, trigger));
  for (const channel of device.channels) $("trigger-channel").append(new Option(channel.name, channel.name));
  $("trigger-channel").value = device.channels.some((one) => one.name === "torque_Nm") ? "torque_Nm" : device.channels[0].name;
  captureRow = checkList($("capture-channels"), device.channels, shape);
  const wanted = device.channels.filter((one) => ["A", "N m", "Wb"].includes(one.unit)).slice(0, Math.min(10, device.capture_channels));
  for (const channel of wanted) captureRow.get(channel.name).input.checked = true;
  for (const name of ["trigger", "trigger-channel", "samples", "pre", "prescaler"]) $(name).addEventListener("input", shape);
  $("capture-form").addEventListener("submit", async (event) => {
    event.preventDefault();
    const samples = $("samples").valueAsNumber;
    const kind = $("trigger").value;
    const number = parse($("level").value);
    if (onLevel() && Number.isNaN(number)) {
      toast(`level: ${NUMBER}`, "bad");
      return;
    }
    const level = onLevel() ? `:${$("trigger-channel").value}:${number}` : "";
    armedHere = Boolean(await order("/capture/arm", {
      channels: chosen(), samples, trigger: kind + level, prescaler: $("prescaler").valueAsNumber,
      pre: Math.min(samples - 1, Math.round((samples * $("pre").valueAsNumber) / 100)),
    }));
  });
  $("trigger-now").addEventListener("click", () => order("/capture/trigger"));
  $("cancel").addEventListener("click", () => order("/capture/cancel"));
  shape();
}

const onLevel = () => ["rising", "falling", "above", "below"].includes($("trigger").value);
const ticked = () => [...captureRow.values()].filter(({ input }) => input.checked).map(({ input }) => input.value);

/** The channels to capture: those that are ticked, and the trigger's. */
const chosen = () => [...new Set([...ticked(), ...(onLevel() ? [$("trigger-channel").value] : [])])];

function shape() {
  for (const label of document.querySelectorAll(".on-level")) label.hidden = !onLevel();
  const on = device.channels.find((one) => one.name === $("trigger-channel").value);
  $("level-unit").textContent = on.unit;
  const count = chosen().length;
  const added = count > ticked().length ? ", with that of the trigger" : "";
  $("capture-chosen").textContent = `${count} of up to ${device.capture_channels} channels${added}`;
  const most = Math.floor(device.memory / Math.max(1, count));
  $("samples").max = most;
  const f_isr_Hz = status?.f_isr_Hz ?? NaN;
  const span_ms = ($("samples").valueAsNumber * $("prescaler").valueAsNumber * 1e3) / f_isr_Hz;
  $("capture-length").textContent = `${show(span_ms)} ms at ${show(f_isr_Hz / $("prescaler").valueAsNumber)} Hz; room for ${most} samples`;
}

/** There is a new capture. It is shown if it was armed here, or if no capture is being looked at. */
async function fetchCapture(number) {
  seen.capture = number;
  if (!number) return;
  try {
    captures = await ask("/captures");
  } catch {
    seen.capture = 0;
    return;
  }
  const wanted = armedHere || seeing !== "capture" || !captured ? number : captured.number;
  captureLists();
  await showCapture(wanted);
  if (armedHere) see("capture");
  armedHere = false;
}

/** The captures that can be shown, and laid over the one that is. */
function captureLists() {
  const text = ({ number, trigger, taken }) =>
    `${number} · ${taken.slice(11, 19)} · ${trigger.replaceAll(":", " ")}`;
  const latest = [...captures].reverse();
  const fill = (list, first, words) => {
    const before = list.value;
    list.replaceChildren(...first, ...latest.map((row) => new Option(words + text(row), row.number)));
    if ([...list.options].some((option) => option.value === before)) list.value = before;
  };
  fill($("capture-shown"), [], "");
  fill($("capture-over"), [new Option("no other capture", "")], "over it: ");
}

let asked = 0; // number of the latest request: an answer to an earlier one is too late

async function showCapture(number) {
  const mine = ++asked;
  let found;
  try {
    found = await ask(`/capture?number=${number}`);
  } catch (error) {
    toast(error.message, "bad");
    return;
  }
  if (mine !== asked) return;
  captured = { ...found, ...samplesOf(found) };
  burst.view = burst.over = null;
  burst.bins = new Bins(captured.channels.length, captured.count, captured.dt_s, captured.start_s);
  const data = decode(found.lo);
  burst.bins.put(0, captured.count, data, data);
  burst.show(series(captured.channels));
  burst.window_s = captured.count * captured.dt_s;
  burst.whole();
  $("capture-shown").value = number;
  $("see-capture").disabled = false;
  $("see-capture").textContent = `Capture ${number}`;
  for (const link of document.querySelectorAll(".downloads a")) {
    link.href = `${link.pathname}?number=${number}`;
  }
  limits();
  if (seeing === "capture") analysis.open();
  await layOver();
}

/** Lay the capture that was chosen over the one that is shown. */
async function layOver() {
  const mine = ++asked;
  const number = $("capture-over").value;
  burst.over = null;
  if (number && Number(number) !== captured.number) {
    try {
      const over = new Overlay(samplesOf(await ask(`/capture?number=${number}`)));
      if (mine !== asked) return;
      if (!captured.channels.some((name) => over.columns.has(name))) {
        throw new Error(`capture ${number} has no channel of capture ${captured.number}`);
      }
      burst.over = over;
    } catch (error) {
      toast(error.message, "bad");
      $("capture-over").value = "";
    }
  }
  burst.rescale();
}

// -- the latest fault --------------------------------------------------------------------

async function fetchSnapshot(version) {
  seen.snapshot = version;
  let found;
  try {
    found = await ask("/snapshot");
  } catch {
    seen.snapshot = -1;
    return;
  }
  const box = $("snapshot");
  if (!found) {
    box.replaceChildren(make("p", { className: "hint", textContent: "No fault since the board was reset." }));
    return;
  }
  const unit = (name) => ({ A: "A", V: "V", Nm: "N m", Wb: "Wb", rpm: "r/min", counts: "" })[name.split("_").pop()] ?? "";
  const rows = [];
  const row = (name, value, what) => rows.push(make("tr", {},
    make("th", { textContent: name, scope: "row" }), make("td", { textContent: value }), make("td", { textContent: what })));
  const phases = ["u1", "u2", "w1", "w2", "v1", "v2"];
  for (const [name, value] of Object.entries(found)) {
    if (["tick", "state", "faults"].includes(name)) continue;
    if (name === "i_A") value.forEach((one, i) => row(`i_${phases[i]}`, show(one), "A"));
    else if (name === "psi_Wb") value.forEach((one, i) => row(`psi_${["alpha", "beta"][i]}`, show(one), "Wb"));
    else if (name === "warnings") row(name, value.join(", ") || "none", "");
    else if (Array.isArray(value)) {
      value.forEach((one, i) => row(`${name.replace("_counts", "")}_${[...phases, "vdc"][i]}`, one, "counts"));
    } else if (name.endsWith("_counts")) row(name.replace("_counts", ""), value, "counts");
    else row(name, show(value), unit(name));
  }
  box.replaceChildren(
    make("h2", { textContent: found.faults.join(", ") }),
    make("p", { className: "hint", textContent: `in state ${found.state}, ${(found.tick / status.f_isr_Hz).toFixed(4)} s after the board's reset` }),
    make("table", {}, make("tbody", {}, ...rows)));
}

// -- what the board remembers ------------------------------------------------------------

/** The log is read when it is opened, and after a fault. */
async function fetchLog() {
  if (!$("log").open) return;
  const box = $("log").lastChild;
  let found;
  try {
    found = await ask("/log");
  } catch (error) {
    box.textContent = error.message;
    return;
  }
  if (!found) {
    box.textContent = "This board keeps no log.";
    return;
  }
  const clock = (s) => `${Math.floor(s / 3600)}:${String(Math.floor(s / 60) % 60).padStart(2, "0")}:${String(s % 60).padStart(2, "0")}`;
  const trips = Object.entries(found.trips).map(([name, n]) => `${name} ${n}`).join(", ");
  const rows = found.events.map((one) => make("tr", {
    title: `${one.state}, ${one.scheme}; ${show(one.vdc_V)} V, ${show(Math.max(...Object.values(one.currents_A).map(Math.abs)))} A, ` +
      `${show(one.speed_rpm)} r/min${["winding", "device", "sink"].map((of) => one[`${of}_degC`] === null ? "" : `, ${of} ${show(one[`${of}_degC`])} degC`).join("")}` +
      (one.limits.length ? `; limits: ${one.limits.join(", ")}` : ""),
  }, make("td", { textContent: clock(one.powered_s) }), make("td", { textContent: one.event }), make("td", { textContent: one.causes.join(", ") })));
  box.replaceChildren(
    make("p", { className: "hint", textContent:
      `Powered ${clock(found.powered_s)}, gates on ${clock(found.gates_s)}, starts ${found.starts}. ` +
      `Largest: ${show(found.vdc_V)} V, ${show(found.current_A)} A, ${show(found.speed_rpm)} r/min, ${show(found.winding_degC)} degC. ` +
      `Trips: ${trips || "none"}.${found.kept ? "" : " Lost with the power."}` }),
    make("table", {}, make("tbody", {}, ...rows)));
}

// -- begin -------------------------------------------------------------------------------

/** Arrow keys, Home and End move in a list of tabs; the Tab key enters it at the one that is chosen. */
function tabKeys(list) {
  const all = () => [...list.querySelectorAll("[role=tab]")].filter((tab) => !tab.disabled);
  const mark = () => {
    for (const tab of list.querySelectorAll("[role=tab]")) {
      tab.tabIndex = tab.getAttribute("aria-selected") === "true" ? 0 : -1;
    }
  };
  new MutationObserver(mark).observe(list, { subtree: true, attributeFilter: ["aria-selected"] });
  mark();
  list.addEventListener("keydown", (event) => {
    const tabs = all();
    const at = tabs.indexOf(document.activeElement);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined || at < 0) return;
    event.preventDefault();
    const tab = tabs[(to + tabs.length) % tabs.length];
    tab.focus();
    tab.click();
  });
}

function tabs() {
  for (const list of document.querySelectorAll("[role=tablist]")) tabKeys(list);
  const all = [...document.querySelectorAll("[data-panel]")];
  for (const tab of all) {
    const panel = $(`panel-${tab.dataset.panel}`);
    tab.setAttribute("aria-controls", panel.id);
    panel.setAttribute("role", "tabpanel");
    panel.setAttribute("aria-label", tab.textContent);
  }
  for (const tab of all) {
    tab.addEventListener("click", () => {
      for (const other of all) {
        other.setAttribute("aria-selected", String(other === tab));
        $(`panel-${other.dataset.panel}`).hidden = other !== tab;
      }
    });
  }
}

async function begin() {
  keys();
  tabs();
  see("live");
  try {
    device = await ask("/device");
  } catch (error) {
    $("alarm").hidden = false;
    $("alarm").textContent = error.message;
    return;
  }
  $("device").textContent = `${device.device} · ${device.build}`;
  $("device").title = `${device.port}, ${device.baud} baud`;
  document.title = `${device.device} · hexatorque monitor`;
  $("reset").lastChild.addEventListener("click", () => order("/reset/seen"));
  quick();
  $("log").addEventListener("toggle", fetchLog);
  parameters(device, showQuick);
  sets(Boolean(device.plant));
  channels();
  capture();
  if (device.steps.length) commissioning(device, stop);
  else $("see-guide").hidden = true;
  if (device.plant) plant(device.plant);
  tools();
  listen();
  setInterval(alarm, 250);
}

begin();
