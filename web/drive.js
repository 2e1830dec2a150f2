// One drive: an instance of the module, with the tables of tools/web.py. Time passes in `run` only.

/** Most periods of one call, as in ht_web.c. */
export const MOST_PERIODS = 2000;

const CONFIG = 4; // HT_ERROR_CONFIG
const ARMING = [
  "", "channels: 1 to 16 are needed", "trigger: there is none of this number",
  "prescaler: 1 or more is needed", "samples: 1 or more are needed",
  "pre: fewer than the samples are allowed", "level: a number is needed",
  "samples: more than the memory holds",
];

/** A number as messages show it. */
export const short = (value, digits = 9) => String(Number(value.toPrecision(digits)));

export class Drive {
  /** module: WebAssembly.Module; place: number of the set-up in tables.setups; bytes: of all set-ups;
   * kept: the memory of an earlier drive with its parameters, or null. */
  constructor(module, tables, bytes, place, kept = null) {
    this.tables = tables;
    this.setup = tables.setups[place];
    this.c = new WebAssembly.Instance(module, {}).exports;
    this.c._initialize?.();
    const size = this.c.web_setup_bytes();
    if (bytes.length !== size * tables.setups.length) throw new Error("set-ups of another build");
    this.octets(this.c.web_setup_at(), size).set(bytes.subarray(place * size, (place + 1) * size));
    const areas = this.areas();
    if (kept?.length === areas.length) areas.set(kept);
    else areas.fill(0xff);
    const { parameters, channels } = tables.device;
    this.ids = new Map(parameters.map((row, id) => [row.name, id]));
    this.names = channels.map((row) => row.name);
    this.plantNames = tables.plant.map((row) => row.name);
    this.faultsAt = this.names.indexOf("faults");
    const result = this.c.web_begin();
    if (result) throw new Error(`${this.setup.name}: ${tables.results[result]}`);
  }

  octets(at, size) {
    return new Uint8Array(this.c.memory.buffer, at, size);
  }

  /** The memory in which the drive keeps parameters. */
  areas() {
    return this.octets(this.c.web_areas(), this.c.web_area_bytes());
  }

  get width() {
    return this.names.length;
  }

  get periods() {
    return this.c.web_periods();
  }

  get time_s() {
    return this.c.web_time_s();
  }

  get state() {
    return this.tables.device.states[this.c.web_state()];
  }

  get working() {
    return this.tables.at_work[this.c.web_state()];
  }

  get faults() {
    return named(this.tables.device.faults, this.c.web_faults());
  }

  /** Which set of parameters the drive began with. */
  get set() {
    return this.tables.sets[this.c.web_set_in_force()];
  }

  /** Let up to MOST_PERIODS pass. Returns the channels, a row of `width` for each period; they are
   * the drive's own memory and valid until the next call. */
  run(periods) {
    if (this.c.web_run(periods, this.faultsAt)) {
      const raw = this.octets(this.c.web_failure(), 200);
      throw new Error(String.fromCharCode(...raw.subarray(0, raw.indexOf(0))));
    }
    return new Float32Array(this.c.memory.buffer, this.c.web_channels(), periods * this.width);
  }

  /** The plant's true values at the beginning of the latest call's periods: rows of
   * `plantNames`, as `run` has them. */
  plant(periods) {
    return new Float32Array(this.c.memory.buffer, this.c.web_plant(), periods * this.plantNames.length);
  }

  /** Where a run has the values of a channel, as a function of the row; null: there is none. */
  column(name) {
    const own = this.names.indexOf(name);
    if (own >= 0) return (rows, _, k) => rows[k * this.width + own];
    if (!this.setup.plant.includes(name)) return null;
    const place = this.plantNames.indexOf(name);
    return (_, plant, k) => plant[k * this.plantNames.length + place];
  }

  // -- commands --------------------------------------------------------------------------

  check(result, what) {
    if (!result) return;
    const text = result === CONFIG ? this.misfit(this.c.web_refused()) : this.tables.results[result];
    throw new Error(`${what}: ${text.replace("{state}", this.state)}`);
  }

  start() {
    this.check(this.c.web_start(), "start");
  }

  stop() {
    this.c.web_stop();
  }

  clear() {
    this.check(this.c.web_clear(), "clear");
  }

  /** The load's torque from now on. */
  load(torque_Nm) {
    if (!Number.isFinite(torque_Nm)) throw new Error("load_Nm: a finite number is needed");
    if (!this.c.web_load(torque_Nm)) {
      throw new Error(`load_Nm = ${short(torque_Nm)}: too much for the shaft's inertia`);
    }
  }

  /** The winding of a phase is open from now on, or whole again. */
  open(phase, open) {
    const leg = this.tables.phases.indexOf(phase);
    if (leg < 0) throw new Error(`phase = ${phase}: choose one of ${this.tables.phases.join(", ")}`);
    if (!this.c.web_open(leg, open ? 1 : 0)) throw new Error("too many breaks of legs are to come");
  }

  keep() {
    this.check(this.c.web_keep(), "keep");
  }

  forget() {
    this.check(this.c.web_forget(), "forget");
  }

  // -- parameters ------------------------------------------------------------------------

  shown(id, number) {
    const { choices } = this.tables.device.parameters[id];
    return choices.length ? choices[number] : shortest(number);
  }

  get(name) {
    const id = this.id(name);
    return this.shown(id, this.c.web_get(id));
  }

  values() {
    return Object.fromEntries(this.names_of().map((name) => [name, this.get(name)]));
  }

  names_of() {
    return [...this.ids.keys()];
  }

  id(name) {
    if (!this.ids.has(name)) throw new Error(`no parameter ${name}`);
    return this.ids.get(name);
  }

  range(row) {
    return this.setup.ranges[row.name] ?? [row.min, row.max];
  }

  number(name, value) {
    const row = this.tables.device.parameters[this.id(name)];
    if (row.choices.length) {
      const place = row.choices.indexOf(String(value));
      if (place < 0) throw new Error(`${name} = ${value}: choose one of ${row.choices.join(", ")}`);
      return place;
    }
    const [min, max] = this.range(row);
    const number = typeof value === "number" ? value : NaN;
    if (!(number >= min && number <= max) || (row.whole && !Number.isInteger(number))) {
      const whole = row.whole ? ", whole numbers only" : "";
      throw new Error(`${name} = ${value}: allowed range is ${min} .. ${max} ${row.unit}`.trimEnd() + whole);
    }
    return number;
  }

  /** Write parameters in one fast interrupt, or none of them. */
  write(values) {
    const entries = Object.entries(values);
    if (!entries.length) throw new Error("values: nothing to write");
    entries.forEach(([name, value], k) => {
      if (this.tables.timed.includes(name)) {
        throw new Error(`${name}: belongs to the set-up, which times the simulated hardware, too`);
      }
      this.c.web_put(k, this.id(name), this.number(name, value));
    });
    this.asked = values;
    this.check(this.c.web_write(entries.length), entries.map(([name, value]) => `${name} = ${value}`).join(", "));
  }

  misfit(number) {
    const row = this.tables.misfits[number];
    const text = this.tables.results[CONFIG];
    if (!row) return text;
    const { parameters } = this.tables.device;
    const shown = (id, share = 1) => {
      const { name, unit } = parameters[id];
      const value = this.asked[name] ?? this.get(name);
      return `${name} = ${typeof value === "number" ? short(share * value, 6) : value} ${unit}`.trimEnd();
    };
    if (!row.share) {
      return `${text}: ${[...new Set([shown(row.first), shown(row.second)])].join(", ")}: ${row.demand}`;
    }
    const word = row.touch ? "allowed is up to" : "must be below";
    const times = row.share === 1 ? "" : `${row.share} `;
    return `${text}: ${shown(row.first)}: ${word} ${times}${shown(row.second, row.share)}`;
  }

  // -- captures --------------------------------------------------------------------------

  arm(channels, samples, pre, trigger, prescaler) {
    const [kind, on = kind === "fault" ? "faults" : "state", level = "0"] = trigger.split(":");
    const number = this.tables.device.triggers.indexOf(kind);
    const wanted = [...channels, on].map((name) => {
      const place = this.names.indexOf(name);
      if (place < 0) throw new Error(`no channel ${name}`);
      return place;
    });
    for (const [name, value] of Object.entries({ samples, pre, prescaler })) {
      if (!Number.isInteger(value) || value < 0) throw new Error(`${name}: a whole number is needed`);
    }
    if (prescaler > 0xffff) throw new Error(`prescaler = ${prescaler}: allowed range is 1 .. 65535`);
    channels.slice(0, 16).forEach((_, k) => this.c.web_capture(k, wanted[k]));
    const answer = this.c.web_arm(
      channels.length, samples, pre, prescaler, number, wanted.at(-1), Number(level));
    if (answer) throw new Error(`capture: ${ARMING[answer]}`);
  }

  trigger() {
    this.c.web_trigger();
  }

  cancel() {
    this.c.web_cancel();
  }

  /** How far the capture is: a number of HT_BURST_... */
  get captureState() {
    return this.c.web_capture_state();
  }

  /** The complete capture: the trigger's tick and the values, sample by sample. */
  captured(values) {
    this.c.web_captured();
    const own = new Float32Array(this.c.memory.buffer, this.c.web_channels(), values);
    return { tick: this.c.web_capture_tick(), values: own.slice() };
  }

  /** What the firmware saved at the latest fault, or null. */
  snapshot() {
    const all = new Float64Array(this.c.memory.buffer, this.c.web_snapshot(), 25);
    let at = 0;
    const one = () => all[at++];
    const list = (n) => Array.from({ length: n }, one);
    const { states, faults, warnings } = this.tables.device;
    const found = {
      tick: one(), state: states[one()], faults: named(faults, one()), warnings: named(warnings, one()),
      adc_counts: list(7), position_counts: one(), i_A: list(6), vdc_V: one(), torque_ref_Nm: one(),
      flux_ref_Wb: one(), psi_Wb: list(2), torque_Nm: one(), speed_rpm: one(),
    };
    return found.tick ? found : null;
  }

  numbers(at, n) {
    return [...new Float64Array(this.c.memory.buffer, at, n)];
  }

  /** What the drive has counted since it began, and its events, the latest first. */
  log() {
    const { device, events, acting, resets, started } = this.tables;
    const [kept, missed, damaged, powered_s, gates_s, starts, vdc_V, current_A, speed_rpm, winding_degC, ...trips] =
      this.numbers(this.c.web_counters(), 10 + device.faults.length);
    const found = {
      kept: !!kept, missed, damaged, powered_s, gates_s, starts, vdc_V, current_A, speed_rpm, winding_degC,
      trips: Object.fromEntries(device.faults.map(({ name }, k) => [name, trips[k]]).filter(([, n]) => n)), events: [],
    };
    for (let at; (at = this.c.web_event(found.events.length));) {
      const words = new DataView(this.c.memory.buffer, at, 68); // ht_log.h
      const octet = (k) => words.getUint8(k);
      const long = (word) => words.getUint32(2 * word, true);
      const float = (word) => words.getFloat32(2 * word, true);
      const degC = (word) => (Number.isNaN(float(word)) ? null : float(word)); // null: nothing tells it
      found.events.push({
        event: events[octet(0)], state: device.states[octet(1)], scheme: this.shown(this.id("scheme"), octet(2)),
        sequence: long(2), powered_s: long(4), gates_s: long(6),
        causes: octet(0) === started ? [resets[octet(3)]] : [...named(device.faults, long(8)), ...named(device.warnings, words.getUint16(20, true))],
        limits: acting.filter((_, k) => (words.getUint16(22, true) >> k) & 1),
        vdc_V: float(12), currents_A: Object.fromEntries(this.tables.phases.map((name, k) => [name, float(14 + 2 * k)])),
        speed_rpm: float(26), winding_degC: degC(28), device_degC: degC(30), sink_degC: degC(32),
      });
    }
    return found;
  }

  /** The limits that act: {name, for_s}. */
  limits() {
    const { acting } = this.tables;
    const seconds = this.numbers(this.c.web_limits(), acting.length);
    return acting.map((name, k) => ({ name, for_s: seconds[k] })).filter(({ for_s }) => for_s >= 0);
  }
}

const named = (rows, bits) => rows.filter((row) => bits & row.bit).map((row) => row.name);

/** The shortest decimal number with the same float32. */
function shortest(value) {
  for (let digits = 1; digits < 9; digits++) {
    const text = Number(value.toPrecision(digits));
    if (Math.fround(text) === value) return text;
  }
  return value;
}
