// Traces on a canvas: bins of smallest and largest values over time, one plot per unit.

/** Bins of the latest samples, channel by channel; bin n is at start_s + n * dt_s. */
export class Bins {
  constructor(channels, capacity, dt_s, start_s = 0) {
    this.capacity = capacity;
    this.dt_s = dt_s;
    this.start_s = start_s;
    this.begin = this.end = 0;
    this.lo = Array.from({ length: channels }, () => new Float32Array(capacity).fill(NaN));
    this.hi = Array.from({ length: channels }, () => new Float32Array(capacity).fill(NaN));
  }

  /** lo and hi hold `count` values of the first channel, then of the next. */
  put(first, count, lo, hi) {
    if (this.end === 0 || first > this.end + this.capacity) this.begin = this.end = first;
    for (let hole = this.end; hole < first; hole++) this.fill(hole % this.capacity);
    this.lo.forEach((row, channel) => {
      for (let i = 0; i < count; i++) {
        const place = (first + i) % this.capacity;
        row[place] = lo[channel * count + i];
        this.hi[channel][place] = hi[channel * count + i];
      }
    });
    this.end = first + count;
    this.begin = Math.max(this.begin, this.end - this.capacity);
  }

  fill(place) {
    for (const row of this.lo) row[place] = NaN;
    for (const row of this.hi) row[place] = NaN;
  }

  time(bin) {
    return this.start_s + bin * this.dt_s;
  }

  /** The bin at a time, or -1. */
  at(time_s) {
    const bin = Math.floor((time_s - this.start_s) / this.dt_s + 1e-6);
    return bin >= this.begin && bin < this.end ? bin : -1;
  }

  /** [smallest, largest] of some channels between two times, or null. */
  range(channels, from_s, to_s) {
    let low = Infinity;
    let high = -Infinity;
    const first = Math.max(this.begin, Math.floor((from_s - this.start_s) / this.dt_s));
    const last = Math.min(this.end, Math.ceil((to_s - this.start_s) / this.dt_s) + 1);
    for (const channel of channels) {
      for (let bin = first; bin < last; bin++) {
        const l = this.lo[channel][bin % this.capacity];
        const h = this.hi[channel][bin % this.capacity];
        if (l < low && l > -Infinity) low = l;
        if (h > high && h < Infinity) high = h;
      }
    }
    return low <= high ? [low, high] : null;
  }
}

export function decode(text) {
  const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(raw.buffer);
}

/** A number for reading: four digits that matter, a proper minus. */
export function show(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  let text;
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) text = value.toExponential(2);
  else {
    const whole = size < 1 ? 1 : Math.floor(Math.log10(size)) + 1;
    text = value.toFixed(Math.min(5, Math.max(0, digits - whole)));
  }
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** The number that a person wrote, or NaN. Point or comma is the decimal sign, and there are no
 * thousands separators; a minus sign may be the one that word processors write. */
export function parse(text) {
  const plain = text.trim().replace(/[−–]/g, "-").replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
}

/** Distance of ticks for about `count` of them: 1, 2 or 5 times a power of ten. */
function stepFor(span, count) {
  const raw = span / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const factor = raw / power;
  return (factor <= 1 ? 1 : factor <= 2 ? 2 : factor <= 5 ? 5 : 10) * power;
}

function decimals(step) {
  return Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
}

function fixed(value, places) {
  const text = value.toFixed(places);
  return (Number(text) === 0 ? (0).toFixed(places) : text).replace("-", "−");
}

const LEFT = 58;
const RIGHT = 12;
const TOP = 8;
const AXIS = 22;

/** All traces of one unit. */
class Plot {
  constructor(stack, unit, series) {
    this.stack = stack;
    this.unit = unit;
    this.series = series;
    this.fixed = null;
    this.scale = null;
    this.box = document.createElement("div");
    this.box.className = "plot";
    this.head = document.createElement("div");
    this.head.className = "legend";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", series.map((s) => s.name).join(", "));
    this.box.append(this.head, this.canvas);
    const label = document.createElement("span");
    label.className = "unit";
    label.textContent = unit || "–";
    this.head.append(label);
    for (const one of series) {
      const chip = document.createElement("span");
      chip.className = "chip";
      chip.title = one.help || one.name;
      const swatch = document.createElement("i");
      swatch.style.background = `var(--trace-${one.colour})`;
      const name = document.createElement("span");
      name.textContent = one.name;
      one.value = document.createElement("output");
      one.value.dataset.channel = one.name;
      chip.append(swatch, name, one.value);
      this.head.append(chip);
    }
    this.head.append(this.makeScale());
    this.listen();
  }

  makeScale() {
    const box = document.createElement("span");
    box.className = "scale";
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "auto";
    button.title = "scale: follow the traces, or keep it fixed";
    const inputs = ["smallest", "largest"].map((what) => {
      const input = document.createElement("input");
      input.inputMode = "decimal";
      input.setAttribute("aria-label", `${what} value of the scale`);
      input.hidden = true;
      input.addEventListener("change", () => {
        const [low, high] = inputs.map((i) => parse(i.value));
        if (low < high) this.fixed = [low, high];
        this.stack.draw();
      });
      return input;
    });
    button.addEventListener("click", () => {
      this.fixed = this.fixed ? null : this.scale && [...this.scale];
      button.textContent = this.fixed ? "fixed" : "auto";
      inputs.forEach((input, i) => {
        input.hidden = !this.fixed;
        if (this.fixed) input.value = Number(this.fixed[i].toPrecision(4));
      });
      this.stack.draw();
    });
    box.append(...inputs, button);
    return box;
  }

  listen() {
    const { stack, canvas } = this;
    let from = null;
    const timeAt = (event) => {
      const [from_s, to_s] = stack.span();
      const wide = canvas.clientWidth - LEFT - RIGHT;
      const share = Math.min(1, Math.max(0, (event.offsetX - LEFT) / wide));
      return from_s + share * (to_s - from_s);
    };
    canvas.addEventListener("pointermove", (event) => {
      stack.cursor_s = timeAt(event) - stack.anchor();
      stack.drag = from === null ? null : [from, timeAt(event)];
      stack.draw();
    });
    canvas.addEventListener("pointerleave", () => {
      if (from !== null) return;
      stack.cursor_s = null;
      stack.draw();
    });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse" || event.button !== 0) return;
      from = timeAt(event);
      stack.hold = stack.span();
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", (event) => {
      if (from === null) return;
      const to = timeAt(event);
      const [begin, end] = stack.span();
      const wide = Math.abs(to - from) / (end - begin);
      if (wide > 0.01) stack.zoom(Math.min(from, to), Math.max(from, to));
      else {
        const mark = from - stack.anchor();
        stack.mark_s = stack.mark_s === null ? mark : null;
      }
      from = stack.drag = stack.hold = null;
      stack.draw();
    });
    canvas.addEventListener("dblclick", () => stack.whole());
  }

  /** The scale of the vertical axis: kept while the traces fill a fair part of it. */
  follow(range) {
    if (this.fixed) return this.fixed;
    if (!range) return this.scale || [0, 1];
    let [low, high] = range;
    const least = Math.max(Math.abs(low), Math.abs(high)) * 0.02 || 1;
    if (high - low < least) {
      const middle = (low + high) / 2;
      [low, high] = [middle - least / 2, middle + least / 2];
    }
    const span = high - low;
    const old = this.scale;
    const outside = !old || low < old[0] || high > old[1];
    if (outside || span < 0.45 * (old[1] - old[0])) {
      const step = stepFor(span * 1.1, 8);
      this.scale = [
        Math.floor((low - span * 0.04) / step) * step,
        Math.ceil((high + span * 0.04) / step) * step,
      ];
    }
    return this.scale;
  }

  draw(last) {
    const { stack, canvas } = this;
    const bins = stack.bins;
    const wide = canvas.clientWidth;
    const tall = canvas.clientHeight;
    if (!wide || !tall) return;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(tall * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(tall * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, tall);
    const [from_s, to_s] = stack.span();
    const right = wide - RIGHT;
    const bottom = tall - (last ? AXIS : 8);
    const x = (t) => LEFT + ((t - from_s) / (to_s - from_s)) * (right - LEFT);
    const range = bins && bins.range(this.series.map((s) => s.index), from_s, to_s);
    const [low, high] = this.follow(range);
    const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - TOP);
    this.grid(pen, x, y, { from_s, to_s, low, high, right, bottom, last });
    if (!bins) return;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP - 2, right - LEFT, bottom - TOP + 4);
    pen.clip();
    pen.lineJoin = "round";
    pen.lineWidth = 1.4;
    // The first on top: a reference stays visible on what follows it.
    for (const one of [...this.series].reverse()) this.trace(pen, x, y, one, from_s, to_s);
    pen.restore();
    this.lines(pen, x, bottom);
  }

  grid(pen, x, y, { from_s, to_s, low, high, right, bottom, last }) {
    const { ink, faint, line } = this.stack.colours;
    pen.font = this.stack.font;
    pen.lineWidth = 1;
    pen.fillStyle = faint;
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    let step = stepFor(high - low, Math.max(2.5, (bottom - TOP) / 26));
    if (Math.floor(high / step) - Math.ceil(low / step) < 1) step = stepFor(high - low, 4.5);
    const places = decimals(step);
    for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-6; n++) {
      const at = Math.round(y(n * step)) + 0.5;
      pen.strokeStyle = n === 0 ? faint : line;
      pen.globalAlpha = n === 0 ? 0.5 : 1;
      pen.beginPath();
      pen.moveTo(LEFT, at);
      pen.lineTo(right, at);
      pen.stroke();
      pen.globalAlpha = 1;
      pen.fillText(fixed(n * step, places), LEFT - 8, at);
    }
    const zero = this.stack.anchor();
    const span = to_s - from_s;
    const unit = span < 0.5 ? [1e3, "ms"] : [1, "s"];
    const between = stepFor(span, (right - LEFT) / 90);
    const digits = decimals(between * unit[0]);
    pen.strokeStyle = line;
    pen.textAlign = "center";
    pen.textBaseline = "alphabetic";
    for (let n = Math.ceil((from_s - zero) / between - 1e-9); ; n++) {
      const t = zero + n * between;
      if (t > to_s + between * 1e-6) break;
      const at = Math.round(x(t)) + 0.5;
      pen.beginPath();
      pen.moveTo(at, TOP);
      pen.lineTo(at, bottom);
      pen.stroke();
      if (last && at < right - 16 && at > LEFT + 8) {
        pen.fillText(fixed(n * between * unit[0], digits), at, bottom + 16);
      }
    }
    if (last) {
      pen.textAlign = "right";
      pen.fillStyle = ink;
      pen.fillText(unit[1], right + 4, bottom + 16);
    }
  }

  trace(pen, x, y, one, from_s, to_s) {
    const { bins } = this.stack;
    const { lo, hi, capacity } = bins;
    const first = Math.max(bins.begin, Math.floor((from_s - bins.start_s) / bins.dt_s) - 1);
    const last = Math.min(bins.end, Math.ceil((to_s - bins.start_s) / bins.dt_s) + 1);
    pen.strokeStyle = this.stack.colours.traces[one.colour];
    pen.beginPath();
    let down = false;
    let before = 0;
    for (let bin = first; bin < last; bin++) {
      const low = lo[one.index][bin % capacity];
      const high = hi[one.index][bin % capacity];
      if (!(low <= high)) {
        down = false; // nothing came: the line is broken, not bridged
        continue;
      }
      const at = x(bins.time(bin));
      // Into a bin at the end that is nearer, out of it at the other.
      const up = !down || Math.abs(before - low) <= Math.abs(before - high);
      const [into, out] = up ? [low, high] : [high, low];
      if (!down) pen.moveTo(at, y(into));
      else if (one.steps) pen.lineTo(at, y(before));
      if (down) pen.lineTo(at, y(into));
      if (out !== into) pen.lineTo(at, y(out));
      before = out;
      down = true;
    }
    pen.stroke();
  }

  lines(pen, x, bottom) {
    const { stack } = this;
    const { ink, accent, stop } = stack.colours;
    const zero = stack.anchor();
    const upright = (t, colour, dash) => {
      pen.strokeStyle = colour;
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(x(t), TOP);
      pen.lineTo(x(t), bottom);
      pen.stroke();
      pen.setLineDash([]);
    };
    pen.lineWidth = 1;
    if (stack.drag) {
      pen.fillStyle = accent;
      pen.globalAlpha = 0.15;
      pen.fillRect(x(stack.drag[0]), TOP, x(stack.drag[1]) - x(stack.drag[0]), bottom - TOP);
      pen.globalAlpha = 1;
    }
    if (stack.trigger) upright(0, accent, [6, 4]);
    for (const mark of stack.marks) {
      upright(mark.time_s, stop, [2, 2]);
      pen.fillStyle = stop;
      pen.textAlign = "left";
      pen.textBaseline = "top";
      if (x(mark.time_s) >= LEFT) pen.fillText(mark.text, x(mark.time_s) + 4, TOP);
    }
    if (stack.mark_s !== null) upright(zero + stack.mark_s, accent, []);
    if (stack.cursor_s !== null) upright(zero + stack.cursor_s, ink, [2, 3]);
  }
}

/** Plots above each other that share their time. */
export class Stack {
  /** options: words(name, value) names a value or says null; zoomed(from, to) on a choice. */
  constructor(box, options) {
    this.box = box;
    this.options = options;
    this.plots = [];
    this.bins = null;
    this.view = null; // chosen part, [from, to]
    this.window_s = 5;
    this.trigger = false; // time 0 is a trigger, not the newest sample
    this.marks = []; // {time_s, text}: what happened when
    this.cursor_s = this.mark_s = this.drag = this.hold = null;
    this.waiting = false;
    this.restyle();
    new ResizeObserver(() => this.draw()).observe(box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.restyle();
      this.draw();
    });
  }

  restyle() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    this.font = `11px ${getComputedStyle(document.body).fontFamily}`;
    this.colours = {
      ink: colour("--ink"),
      faint: colour("--faint"),
      line: colour("--line"),
      accent: colour("--accent"),
      stop: colour("--stop"),
      traces: Array.from({ length: 10 }, (_, i) => colour(`--trace-${i}`)),
    };
  }

  /** series: {name, unit, index, colour, steps, help}, in order; one plot per unit. */
  show(series) {
    const units = new Map();
    for (const one of series) {
      if (!units.has(one.unit)) units.set(one.unit, []);
      units.get(one.unit).push(one);
    }
    this.series = series;
    this.cursor_s = this.mark_s = null;
    this.plots = [...units].map(([unit, rows]) => new Plot(this, unit, rows));
    this.box.replaceChildren(...this.plots.map((plot) => plot.box));
    this.draw();
  }

  end_s() {
    return this.bins ? this.bins.time(this.bins.end) : 0;
  }

  /** [from, to] that is drawn. */
  span() {
    if (this.hold) return this.hold;
    if (this.view) return this.view;
    const end = this.end_s();
    return [end - this.window_s, end];
  }

  /** Where time is 0: the newest sample, or the trigger. */
  anchor() {
    return this.trigger ? 0 : this.end_s();
  }

  zoom(from_s, to_s) {
    this.view = [from_s, to_s];
    this.cursor_s = this.mark_s = null;
    this.options.zoomed(this.view);
  }

  whole() {
    this.view = null;
    this.options.zoomed(null);
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.plots.forEach((plot, i) => plot.draw(i === this.plots.length - 1));
      if (this.cursor_s !== null) this.read();
      this.options.cursor(this.cursor_s, this.mark_s);
    });
  }

  /** Values at the cursor into the legend. */
  read() {
    const bin = this.bins ? this.bins.at(this.anchor() + this.cursor_s) : -1;
    for (const one of this.series) {
      if (bin < 0) {
        one.value.textContent = "–";
        continue;
      }
      const low = this.bins.lo[one.index][bin % this.bins.capacity];
      const high = this.bins.hi[one.index][bin % this.bins.capacity];
      one.value.textContent = this.text(one, low, high);
    }
  }

  text(one, low, high = low) {
    const word = low === high ? this.options.words(one.name, low) : null;
    if (word) return word;
    return show(low) === show(high) ? show(low) : `${show(low)} … ${show(high)}`;
  }

  /** Newest values into the legend, unless the cursor reads others. */
  newest(values) {
    if (this.cursor_s !== null) return;
    for (const one of this.series || []) {
      one.value.textContent = this.text(one, values[one.index] ?? NaN);
    }
  }
}
