// A drive that answers what the page asks, as the monitor's server does for a board.

import { Drive, MOST_PERIODS } from "./drive.js";
import { csv, headerOf, npz } from "./files.js";
import { Ring, View, encode } from "./traces.js";

/** Samples per second unless the page asks for more. */
const RATE_HZ = 2000;
/** A frame for the page after so long, and the status with it. */
const FRAME_MS = 40;
const STATUS_MS = 100;
/** Time that the drive was behind by more than this is left out: a hidden page runs slowly. */
const LATE_MS = 60;
/** Captures that are kept, room of a capture, most values of a span and of a recording. */
const CAPTURES = 12;
const MEMORY = 20480;
const SPAN_VALUES = 1 << 21;
const RECORDED_VALUES = 1 << 25;
const CAPTURE_CHANNELS = 16;
/** Texts of a capture's states. */
const CAPTURING = ["", "filling the pre-trigger", "waiting for the trigger", "triggered"];
const SUMMING = 4;

/** The name of a set-up in what the page's address says; "" is the first one. */
export function placeOf(tables, name) {
  const place = name ? tables.setups.findIndex((one) => one.name === name) : 0;
  if (place < 0) {
    throw new Error(`no set-up ${name}: choose one of ${tables.setups.map((one) => one.name).join(", ")}`);
  }
  return place;
}

export class Board {
  /** send(message): to the page. The others as Drive has them. */
  constructor(module, tables, bytes, setup, kept, send) {
    this.tables = tables;
    this.make = (name, memory) => new Drive(module, tables, bytes, placeOf(tables, name), memory);
    this.drive = this.make(setup, kept);
    this.send = send;
    this.began = new Date();
    this.values = this.drive.values();
    this.version = { values: 0, snapshot: 0 };
    this.plant = { load_Nm: 0, open: [] };
    this.captures = new Map();
    this.captureNumber = 0;
    this.armed = null;
    this.recorded = null;
    this.notice = "";
    this.epoch = 0;
    this.heard = null;
    this.shown = ""; // the fault whose snapshot the page has
    this.last_ms = this.sent_ms = this.status_ms = null;
    this.pace = { since_ms: 0, samples: 0, measured_Hz: 0, busy_ms: 0, busy: 0 };
    const names = tables.traced.filter((name) => this.drive.names.includes(name));
    this.trace(names, RATE_HZ);
  }

  get f_isr_Hz() {
    return this.drive.get("f_isr_Hz");
  }

  // -- time ------------------------------------------------------------------------------

  /** Let the time since the last call pass. */
  turn(now_ms) {
    const began_ms = performance.now();
    const due_ms = Math.min(now_ms - (this.last_ms ?? now_ms), LATE_MS);
    this.last_ms = now_ms;
    if (!this.broken) {
      try {
        this.pass((due_ms / 1e3) * this.f_isr_Hz);
      } catch (error) {
        this.broken = `${error.message}: choose the set-up again`;
      }
    }
    this.take();
    this.count(now_ms, performance.now() - began_ms);
    if (this.heard && now_ms - (this.sent_ms ?? -FRAME_MS) >= FRAME_MS) this.frame(now_ms);
  }

  pass(periods) {
    this.left = (this.left ?? 0) + periods;
    while (this.left >= 1) {
      const n = Math.min(Math.floor(this.left), MOST_PERIODS);
      const first = this.drive.periods + 1;
      const rows = this.drive.run(n);
      const plant = this.drive.plant(n);
      this.left -= n;
      for (let k = (this.decimation - (first % this.decimation)) % this.decimation; k < n; k += this.decimation) {
        const values = this.traces.map((value) => value(rows, plant, k));
        this.ring.push((first + k) / this.decimation, values);
        this.record(first + k, values);
        this.pace.samples += 1;
      }
    }
  }

  count(now_ms, busy_ms) {
    const { pace } = this;
    pace.busy_ms += busy_ms;
    const passed_ms = now_ms - pace.since_ms;
    if (passed_ms < 1000) return;
    Object.assign(pace, {
      measured_Hz: pace.since_ms ? (pace.samples * 1e3) / passed_ms : 0, busy: pace.busy_ms / passed_ms,
      since_ms: now_ms, samples: 0, busy_ms: 0,
    });
  }

  frame(now_ms) {
    this.sent_ms = now_ms;
    const frame = {};
    const news = this.view.news();
    if (news) frame.bins = this.bins(news);
    if (now_ms - (this.status_ms ?? -STATUS_MS) >= STATUS_MS) {
      this.status_ms = now_ms;
      frame.status = this.status();
      const finite = (values) => values.map((value) => (Number.isFinite(value) ? Number(value.toPrecision(6)) : null));
      if (this.ring.end) {
        frame.newest = finite(this.ring.newest());
        frame.mean = finite(this.ring.means(Math.max(1, Math.round(this.tables.mean_s * this.rate_Hz))));
      }
    }
    this.send({ frame });
  }

  bins({ first, count, width, lo, hi }) {
    return {
      epoch: this.epoch, dt_s: width / this.rate_Hz, width, first, count,
      lo: encode(lo), hi: hi === lo ? "" : encode(hi),
    };
  }

  status() {
    const { drive } = this;
    const { faults } = drive;
    const now = drive.state === this.tables.fault ? faults.join() : "";
    if (now !== this.shown) {
      this.shown = now;
      if (now) this.version.snapshot += 1;
    }
    return {
      channels: this.traced, epoch: this.epoch, rate_Hz: this.rate_Hz, measured_Hz: this.pace.measured_Hz,
      busy: this.pace.busy, marks_s: [], gaps: 0, lost: 0,
      record: this.recorded && { file: this.recorded.file, rows: this.recorded.rows, seconds: this.recorded.rows / this.rate_Hz },
      state: drive.state, may_start: drive.state === this.tables.idle, may_clear: drive.state === this.tables.fault,
      working: drive.working, faults, limits: drive.working ? drive.limits() : [], time_s: drive.time_s, plugged: true, broken: this.broken ?? "",
      notice: this.notice, reset: "", resets: 0, stops_in_s: null, pages: 1, f_isr_Hz: this.f_isr_Hz,
      damaged: 0, retries: 0, reconnects: 0, board_damaged: 0, board_overruns: 0, board_dropped: 0, guarded: false,
      values: this.version.values, snapshot: this.version.snapshot, capture: this.captureNumber,
      capture_state: this.armed ? CAPTURING[drive.captureState] ?? "" : this.captureNumber ? "complete" : "",
      commissioning: 0,
    };
  }

  // -- traces and recordings -------------------------------------------------------------

  trace(names, rate_Hz) {
    if (this.recorded) throw new Error("channels: end the recording first");
    const traces = names.map((name) => this.drive.column(name));
    if (traces.includes(null)) throw new Error("channels: there is none of one of these names");
    if (!names.length) throw new Error("channels: choose one at least");
    this.traced = names;
    this.traces = traces;
    this.decimation = Math.max(1, Math.round(this.f_isr_Hz / (rate_Hz ?? this.f_isr_Hz)));
    this.rate_Hz = this.f_isr_Hz / this.decimation;
    const room = Math.floor(this.tables.history_values / names.length);
    this.ring = new Ring(names.length, Math.min(room, Math.ceil(this.tables.history_s * this.rate_Hz)));
    this.epoch += 1;
    if (this.heard) this.hear(this.heard);
  }

  /** The page listens from now on. */
  hear(query) {
    this.heard = query;
    this.view = new View(this.ring, this.rate_Hz, Number(query.window_s), Number(query.bins));
  }

  record(tick, values) {
    const { recorded } = this;
    if (!recorded) return;
    recorded.tick ??= tick;
    recorded.columns.forEach((column, c) => column.push(values[c]));
    recorded.rows += 1;
    if (recorded.rows * recorded.columns.length >= RECORDED_VALUES) {
      this.notice = "recording ended: it is as long as this page can keep";
      this.give([this.recording()]);
    }
  }

  meta(first_tick, decimation, more = {}) {
    const { drive } = this;
    return {
      hexatorque: this.tables.version, started: this.began.toISOString(), setup: drive.setup.name,
      title: drive.setup.title, scheme: drive.get("scheme"), state: drive.state, faults: drive.faults,
      parameters: { controller: drive.values() },
      first_tick, decimation, tick_Hz: this.f_isr_Hz, gaps: 0, lost_samples: 0, damaged_samples: 0, ...more,
    };
  }

  columns(names, values) {
    const { device, plant } = this.tables;
    const units = new Map([...device.channels, ...plant].map((row) => [row.name, row.unit]));
    return names.map((name, k) => ({ name, unit: units.get(name), values: values[k] }));
  }

  /** End the recording: its file. */
  recording() {
    const { file, tick, columns, rows } = this.recorded;
    this.recorded = null;
    if (!rows) throw new Error("the recording has no sample");
    const recording = {
      rate_Hz: this.rate_Hz, start_s: tick / this.f_isr_Hz,
      columns: this.columns(this.traced, columns.map((column) => Float32Array.from(column))),
      meta: this.meta(tick, this.decimation),
    };
    return { name: file, octets: npz(recording, this.tables.format) };
  }

  /** Files for the user. */
  give(files) {
    this.send({ files });
  }

  // -- captures --------------------------------------------------------------------------

  take() {
    if (!this.armed || this.drive.captureState < SUMMING) return;
    const { channels, samples, pre, prescaler, trigger, taken } = this.armed;
    this.armed = null;
    const { tick, values } = this.drive.captured(samples * channels.length);
    this.drive.cancel();
    const columns = channels.map((_, c) => Float32Array.from({ length: samples }, (_one, i) => values[i * channels.length + c]));
    const rate_Hz = this.f_isr_Hz / prescaler;
    this.captureNumber += 1;
    this.captures.set(this.captureNumber, {
      number: this.captureNumber, trigger, taken, channels,
      recording: {
        rate_Hz, start_s: -pre / rate_Hz, columns: this.columns(channels, columns),
        meta: this.meta(tick - pre * prescaler, prescaler, { trigger_s: 0, trigger_tick: tick }),
      },
    });
    if (this.captures.size > CAPTURES) this.captures.delete(this.captures.keys().next().value);
  }

  capture(number) {
    const found = this.captures.get(number ? Number(number) : this.captureNumber);
    if (!found) throw new Error("this capture is not kept");
    return found;
  }

  described({ number, trigger, taken, channels, recording }) {
    const { controller } = recording.meta.parameters;
    const { trigger_tick, scheme, state, faults } = recording.meta;
    return {
      number, trigger, taken, channels, start_s: recording.start_s, count: recording.columns[0].values.length,
      dt_s: 1 / recording.rate_Hz, meta: { trigger_tick, scheme, state, faults },
      values: Object.fromEntries(this.tables.device.limits.map(({ parameter }) => [parameter, controller[parameter]])),
    };
  }

  // -- what the page asks ----------------------------------------------------------------

  /** The answer to a request of the page. Throws what was refused. */
  ask(path, body = {}) {
    const [name, text = ""] = path.split("?");
    const request = REQUESTS[name];
    if (!request) throw new Error(`${name}: this page cannot do that`);
    return request(this, body, Object.fromEntries(new URLSearchParams(text))) ?? {};
  }

  changed() {
    this.values = this.drive.values();
    this.version.values += 1;
  }

  device() {
    const { drive, tables } = this;
    return {
      ...tables.device,
      parameters: tables.device.parameters.map((row) => {
        const [min, max] = drive.range(row);
        return { ...row, min, max };
      }),
      device: drive.setup.name, build: tables.version, minor: 1, port: "this page", baud: 0, watchdog_ms: 0,
      stream_channels: drive.width + drive.setup.plant.length, capture_channels: CAPTURE_CHANNELS, memory: MEMORY, history_s: tables.history_s,
      silent_s: 0, hidden_s: 0, fresh_s: tables.fresh_s, steps: [], choices: {},
      plant: {
        ...this.plant, channels: tables.plant.filter(({ name }) => drive.setup.plant.includes(name)), setup: drive.setup.name, phases: tables.phases, set: drive.set,
        setups: tables.setups.map(({ name, title }) => ({ name, title })),
      },
    };
  }

  part(query, width) {
    const begin = Number(query.begin_s);
    const end = Number(query.end_s);
    const first = Math.ceil((begin * this.rate_Hz) / width - 1e-6);
    const last = Math.min(Math.ceil((end * this.rate_Hz) / width - 1e-6), Math.ceil(this.ring.end / width));
    return [Math.max(0, first), Math.max(first, last)];
  }

  difference() {
    const { parameters } = this.tables.device;
    const rows = parameters.map((row) => ({
      name: row.name, unit: row.unit, board: this.drive.get(row.name),
      other: row.choices.length ? row.choices[row.initial] : row.initial,
    }));
    const kept = (value) => (typeof value === "number" ? Math.fround(value) : value);
    return { compared: rows.length, differing: rows.filter(({ board, other }) => kept(board) !== kept(other)) };
  }

  toml() {
    const lines = this.tables.device.parameters.map(({ name, unit }) =>
      `${name} = ${JSON.stringify(this.drive.get(name))}${unit ? `  # ${unit}` : ""}`);
    return `# ${this.drive.setup.name}, ${this.tables.version}\n[parameters]\n${lines.join("\n")}\n`;
  }
}

const keep = (board, act) => {
  board.drive[act]();
  board.send({ kept: board.drive.areas().slice() });
};

const REQUESTS = {
  "/device": (board) => board.device(),
  "/values": (board) => board.values,
  "/snapshot": (board) => ({ found: board.drive.snapshot() }),
  "/log": (board) => ({ found: board.drive.log() }),
  "/captures": (board) => [...board.captures.values()].map((one) => board.described(one)),
  "/commissioning": () => ({ found: null }),
  "/capture"(board, _, { number }) {
    const found = board.capture(number);
    const { columns, rate_Hz } = found.recording;
    const count = columns[0].values.length;
    const table = new Float32Array(count * columns.length);
    columns.forEach(({ values }, k) => table.set(values, k * count));
    return {
      ...board.described(found), epoch: 0, dt_s: 1 / rate_Hz, width: 1, first: 0, count, lo: encode(table), hi: "",
    };
  },
  "/history"(board, _, query) {
    const samples = (query.end_s - query.begin_s) * board.rate_Hz;
    const width = Math.max(1, Math.round(samples / query.bins));
    const [first, last] = board.part(query, width);
    return board.bins({ first, count: last - first, width, ...board.ring.envelope(width, first, last) });
  },
  "/span"(board, _, query) {
    const [first, last] = board.part(query, 1);
    const values = (last - first) * board.traced.length;
    if (values > SPAN_VALUES) {
      throw new Error(`the span has ${values} values: up to ${SPAN_VALUES} are analysed at once`);
    }
    return board.bins({ first, count: last - first, width: 1, ...board.ring.envelope(1, first, last) });
  },
  "/listen": (board, query) => board.hear(query),
  "/start": (board) => { board.notice = ""; board.drive.start(); },
  "/stop": (board) => board.drive.stop(),
  "/clear": (board) => { board.drive.clear(); board.notice = ""; },
  "/beat": () => {},
  "/reset/seen": () => {},
  "/write"(board, { values }) {
    board.drive.write(values);
    board.changed();
    return { values: Object.fromEntries(Object.keys(values).map((name) => [name, board.drive.get(name)])) };
  },
  "/parameters/difference"(board, { file }) {
    if (file) throw new Error(`${file}: this page compares with the defaults only`);
    return board.difference();
  },
  "/parameters/keep": (board) => keep(board, "keep"),
  "/parameters/forget": (board) => keep(board, "forget"),
  "/parameters.toml": (board) => board.give([{ name: `${board.drive.setup.name}-parameters.toml`, text: board.toml() }]),
  "/channels"(board, { channels, rate_Hz }) {
    board.trace(channels, rate_Hz);
    return { channels };
  },
  "/capture/arm"(board, { channels, samples, pre, trigger, prescaler }) {
    const on = trigger.split(":")[1];
    const wanted = on && !channels.includes(on) ? [...channels, on] : channels;
    board.drive.arm(wanted, samples, pre, trigger, prescaler);
    board.armed = { channels: wanted, samples, pre, trigger, prescaler, taken: new Date().toISOString() };
  },
  "/capture/trigger": (board) => board.drive.trigger(),
  "/capture/cancel": (board) => { board.drive.cancel(); board.armed = null; },
  "/capture.npz"(board, _, { number }) {
    const { recording, number: n } = board.capture(number);
    board.give([{ name: `capture-${n}.npz`, octets: npz(recording, board.tables.format) }]);
  },
  "/capture.csv"(board, _, { number }) {
    const { recording, number: n } = board.capture(number);
    board.give([{ name: `capture-${n}.csv`, text: csv(recording) }]);
  },
  "/capture.json"(board, _, { number }) {
    const { recording, number: n } = board.capture(number);
    const text = `${JSON.stringify(headerOf(recording, board.tables.format), null, 1)}\n`;
    board.give([{ name: `capture-${n}.json`, text }]);
  },
  "/record/start"(board) {
    if (board.recorded) throw new Error("a recording is under way");
    const stamp = new Date().toISOString().slice(0, 19).replace(/[-:]/g, "").replace("T", "-");
    const file = `${board.drive.setup.name}-${stamp}.npz`;
    board.recorded = { file, rows: 0, columns: board.traced.map(() => []) };
    return { file };
  },
  "/record/stop"(board) {
    if (!board.recorded) throw new Error("nothing is being recorded");
    const { file } = board.recorded;
    board.give([board.recording()]);
    return { file };
  },
  /** A drive of its own over a course: [period, method of Drive, ...its arguments] in order. All its
   * channels, the plant's true values, and how long it took. */
  "/course"(board, { setup, periods, course }) {
    const drive = board.make(setup);
    const all = new Float32Array(periods * drive.width);
    const plant = new Float32Array(periods * drive.plantNames.length);
    let done = 0;
    const pass = (until) => {
      while (done < until) {
        const n = Math.min(until - done, MOST_PERIODS);
        all.set(drive.run(n), done * drive.width);
        plant.set(drive.plant(n), done * drive.plantNames.length);
        done += n;
      }
    };
    const began_ms = performance.now();
    for (const [at, act, ...given] of course) {
      pass(at);
      drive[act](...given);
    }
    pass(periods);
    const took_s = (performance.now() - began_ms) / 1e3;
    return { rows: encode(all), plant: encode(plant), took_s, time_s: drive.time_s, violations: drive.c.web_violations() };
  },
  "/plant"(board, { load_Nm, open }) {
    if (load_Nm !== undefined) {
      board.drive.load(load_Nm);
      board.plant.load_Nm = load_Nm;
    }
    for (const [phase, on] of Object.entries(open ?? {})) {
      board.drive.open(phase, on);
      board.plant.open = [...board.plant.open.filter((one) => one !== phase), ...(on ? [phase] : [])];
    }
    return board.plant;
  },
};
