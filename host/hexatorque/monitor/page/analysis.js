// Below the plots: figures, spectrum or x-y view of the part between two marks, or of what is shown.

import { make } from "./asking.js";
import { analyst } from "./backend.js";
import { parse, show } from "./numbers.js";
import { drawXY } from "./xy.js";

/* global uPlot */

const KINDS = { figures: "figures", spectrum: "spectrum", xy: "x–y" };
const COLUMNS = [
  ["mean", "mean"], ["rms", "rms"], ["min", "min"], ["max", "max"], ["peak", "peak-peak"],
];
/** Traces that run are analysed again after this time, and after this many times what it took. */
const AGAIN_MS = 1000;
const AGAIN_TIMES = 5;
/** The logarithmic scale of a spectrum shows lines down to this share of the largest. */
const LEAST = 1e-5;
/** What is looked at first in the x-y view, if it is there. */
const FIRST = [["psi_alpha_Wb", "psi_beta_Wb"], ["psi_x_Wb", "psi_y_Wb"]];

export class Analysis {
  /** box: where it is shown; choice: a list to choose the kind from; source(): what is analysed, as
   * {stack, ready, running, span(from_s, to_s)}: whether there are samples, whether more of them come;
   * span gives what the thread needs to get them. */
  constructor(box, choice, source) {
    this.box = box;
    this.choice = choice;
    this.source = source;
    this.worker = analyst();
    this.worker.onmessage = ({ data }) => this.come(data);
    this.id = 0; // of the latest question
    this.asked = null; // {id, begun_ms, kind, names, series, part_s} that has no answer yet
    this.again = false; // something has changed since it was asked
    this.due_ms = 0;
    this.found = null; // the latest answer, with what was asked
    this.chosen = {}; // by kind: the unit, or the two channels
    choice.append(new Option("no analysis", ""),
      ...Object.entries(KINDS).map(([kind, text]) => new Option(text, kind)));
    choice.addEventListener("change", () => this.open());
    this.build();
    new ResizeObserver(() => this.draw()).observe(this.place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(true));
    setInterval(() => {
      const late = performance.now() > this.due_ms;
      if (this.kind && !this.asked && late && this.source().running && !document.hidden) this.refresh();
    }, 200);
  }

  get kind() {
    return this.choice.value;
  }

  build() {
    const field = (word) => {
      const input = make("input", { inputMode: "decimal", spellcheck: false, autocomplete: "off" });
      input.setAttribute("aria-label", `${word}, in milliseconds`);
      input.addEventListener("input", () => { input.dataset.typed = "true"; });
      input.addEventListener("change", () => this.limitTo());
      input.addEventListener("blur", () => { delete input.dataset.typed; });
      return input;
    };
    this.from = field("begin of the part");
    this.to = field("end of the part");
    this.all = make("button", { type: "button", textContent: "all", title: "the plots' span; no marks" });
    this.all.addEventListener("click", () => this.source().stack.setMarks());
    this.options = make("span", { className: "options" });
    this.said = make("p", { className: "said", role: "status" });
    this.place = make("div", { className: "place", tabIndex: 0 }); // arrow keys scroll it
    this.place.setAttribute("role", "group");
    this.place.setAttribute("aria-label", "result");
    this.box.append(
      make("div", { className: "head" },
        make("span", { className: "field" }, make("span", { textContent: "from" }), this.from,
          make("span", { textContent: "to" }), this.to, make("span", { textContent: "ms" })),
        this.all, this.options),
      this.said, this.place);
  }

  /** Another kind was chosen, or other channels are there. */
  open() {
    this.box.hidden = !this.kind;
    this.clear("");
    this.choices();
    this.refresh();
  }

  clear(text) {
    this.chart?.destroy();
    this.found = this.chart = null;
    this.place.replaceChildren();
    this.said.textContent = text;
    this.said.classList.toggle("bad", Boolean(text));
  }

  /** Lists of what can be chosen: a unit for the spectrum, two channels for the x-y view. */
  choices() {
    const { stack } = this.source();
    const series = stack.series ?? [];
    const list = (label, options, value, changed) => {
      const select = make("select", {}, ...options.map(([text, key]) => new Option(text, key)));
      select.setAttribute("aria-label", label);
      select.value = value;
      select.addEventListener("change", () => changed(select.value));
      return select;
    };
    this.options.replaceChildren();
    const has = (name) => series.some((one) => one.name === name);
    if (this.kind === "spectrum") {
      const units = [...new Set(series.map((one) => one.unit))];
      if (!units.includes(this.chosen.unit)) this.chosen.unit = units.includes("A") ? "A" : units[0];
      this.options.append(
        list("unit of the channels", units.map((unit) => [unit || "no unit", unit]), this.chosen.unit,
          (unit) => { this.chosen.unit = unit; this.refresh(); }),
        list("scale of the amplitudes", [["linear", ""], ["logarithmic", "log"]], this.chosen.scale ?? "",
          (scale) => { this.chosen.scale = scale; this.draw(true); }),
        this.upTo());
    }
    if (this.kind === "xy") {
      const names = series.map((one) => one.name);
      if (!this.chosen.xy?.every(has)) {
        const pair = series.find((one, i) => series.some((two, j) => j > i && two.unit === one.unit));
        const partner = pair && series.find((one) => one !== pair && one.unit === pair.unit);
        this.chosen.xy = FIRST.find((two) => two.every(has))
          ?? (pair ? [pair.name, partner.name] : [names[0], names.at(-1)]);
      }
      ["channel across", "channel upwards"].forEach((label, i) => {
        this.options.append(list(label, names.map((name) => [`${"xy"[i]}: ${name}`, name]), this.chosen.xy[i],
          (name) => { this.chosen.xy[i] = name; this.refresh(); }));
      });
    }
  }

  upTo() {
    const input = make("input", { inputMode: "decimal", spellcheck: false, placeholder: "all" });
    input.setAttribute("aria-label", "largest frequency that is shown, in hertz");
    input.value = this.chosen.top_Hz ?? "";
    input.addEventListener("change", () => {
      const top_Hz = parse(input.value);
      this.chosen.top_Hz = top_Hz > 0 ? top_Hz : null;
      input.value = this.chosen.top_Hz ?? "";
      this.draw(true);
    });
    return make("span", { className: "field" }, make("span", { textContent: "up to" }), input,
      make("span", { textContent: "Hz" }));
  }

  /** The part that is analysed: between the two marks, or what is shown. */
  part() {
    const { stack } = this.source();
    const marks = stack.markPair();
    if (marks.length === 2) return marks.sort((a, b) => a - b);
    return stack.span().map((time_s) => time_s - stack.zero_s);
  }

  /** The fields were edited: they set the marks. */
  limitTo() {
    const [from_s, to_s] = [this.from, this.to].map((input) => parse(input.value) / 1e3);
    delete this.from.dataset.typed;
    delete this.to.dataset.typed;
    if (from_s < to_s) this.source().stack.setMarks(from_s, to_s);
    else this.clear("The part needs a begin in milliseconds, and an end that is later.");
  }

  refresh() {
    if (!this.kind) return;
    if (this.asked) {
      this.again = true;
      return;
    }
    const { stack, ready, span } = this.source();
    if (!ready || !stack.series?.length) {
      this.clear("There are no samples yet.");
      return;
    }
    const part_s = this.part();
    [this.from, this.to].forEach((input, i) => {
      if (!input.dataset.typed) input.value = (part_s[i] * 1e3).toFixed(2).replace(/\.?0+$/, "");
    });
    const wanted = {
      figures: () => stack.series.map((one) => one.name),
      spectrum: () => stack.series.filter((one) => one.unit === this.chosen.unit).map((one) => one.name),
      xy: () => this.chosen.xy,
    }[this.kind]();
    this.asked = {
      id: ++this.id, begun_ms: performance.now(), kind: this.kind, names: wanted, part_s,
      series: wanted.map((name) => stack.series.find((one) => one.name === name)),
    };
    this.worker.postMessage({ id: this.id, kind: this.kind, names: wanted, ...span(...part_s) });
  }

  come(data) {
    if (data.id !== this.asked?.id) return;
    const { asked } = this;
    this.asked = null;
    const took_ms = performance.now() - asked.begun_ms;
    this.due_ms = performance.now() + Math.max(AGAIN_MS, AGAIN_TIMES * took_ms);
    if (asked.kind === this.kind) {
      if (data.error) this.clear(data.error);
      else {
        const same = this.found?.names.join() === asked.names.join();
        this.found = { ...data, ...asked };
        this.draw(!same);
      }
    }
    if (!this.again) return;
    this.again = false;
    this.refresh();
  }

  /** anew: not only the numbers are others. */
  draw(anew = false) {
    const { found } = this;
    if (!found || !this.kind) return;
    this.said.classList.remove("bad");
    this[`draw_${found.kind}`](found, anew);
  }

  /** How many samples, and how long. */
  told({ count, rate_Hz }) {
    return `${count} samples at ${show(rate_Hz)} Hz, ${show((count / rate_Hz) * 1e3)} ms`;
  }

  swatch(one) {
    const swatch = make("i", { className: one.dashed ? "dashed" : "" });
    swatch.style.background = `var(--trace-${one.colour})`;
    return swatch;
  }

  draw_figures(found) {
    const missing = Math.max(...found.rows.map((row) => row.missing));
    const text = missing ? `; ${missing} of them have no value and do not count` : "";
    this.said.textContent = this.told(found) + text;
    const cell = (value) => make("td", { textContent: show(value, 5), title: String(value) });
    const head = make("tr", {}, make("th", { textContent: "channel", scope: "col" }),
      ...COLUMNS.map(([, word]) => make("th", { textContent: word, scope: "col" })),
      make("th", { textContent: "unit", scope: "col" }));
    const rows = found.rows.map((row, i) => make("tr", {},
      make("th", { scope: "row" }, this.swatch(found.series[i]), found.names[i]),
      ...COLUMNS.map(([key]) => cell(row[key])), make("td", { textContent: found.series[i].unit || "–" })));
    const table = make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows));
    table.setAttribute("aria-label", "figures of the part");
    this.place.replaceChildren(table);
  }

  draw_spectrum(found, anew) {
    const { stack } = this.source();
    const { step_Hz, series } = found;
    const unit = series[0].unit;
    this.said.textContent = `${this.told(found)}: a line every ${show(step_Hz)} Hz. Lines closer than `
      + `${show(2 * step_Hz)} Hz run together (Hann window). The mean is left out.`;
    if (anew || !this.chart) {
      this.chart?.destroy();
      this.chart = null;
      this.lines = make("ol", { className: "lines" });
      this.lines.setAttribute("aria-label", "largest lines");
      this.canvas = make("div", { className: "chart", tabIndex: 0 });
      this.canvas.setAttribute("role", "group");
      this.canvas.setAttribute("aria-label", "spectrum. Left and right arrows move the pointer.");
      this.canvas.addEventListener("keydown", (event) => this.press(event));
      this.read = make("p", { className: "read" });
      this.read.setAttribute("aria-live", "polite");
      this.place.replaceChildren(this.canvas, make("div", { className: "beside" }, this.read, this.lines));
      const axis = {
        font: stack.font, stroke: stack.colours.faint, grid: { stroke: stack.colours.line, width: 1 },
        ticks: { show: false },
      };
      const log = this.chosen.scale === "log";
      const most = () => Math.max(...this.found.rows.map((row) => {
        const last = Math.floor(this.topHz() / this.found.f_Hz[1]);
        let size = 0;
        for (let k = 0; k < row.length && k <= last; k++) size = Math.max(size, row[k]);
        return size;
      })) || 1;
      this.chart = new uPlot({
        width: 100, height: 100, padding: [10, 32, 0, 0], legend: { show: false },
        scales: {
          x: { time: false, range: () => [0, this.topHz()] },
          y: { distr: log ? 3 : 1, range: () => (log ? [most() * LEAST, most() * 2] : [0, most() * 1.08]) },
        },
        axes: [
          { ...axis, size: 22, gap: 6, space: 90,
            values: (_, values) => values.map((v, i) => (i === values.length - 1 ? `${v} Hz` : v)) },
          { ...axis, size: 58, gap: 8, space: log ? 18 : 26,
            values: (_, values) => values.map((v) => (v === null ? "" : log ? v.toExponential(0) : show(v, 3))) },
        ],
        series: [{}, ...series.map((one) => ({
          stroke: () => stack.colours.traces[one.colour], width: 1, dash: one.dashed ? [7, 4] : undefined,
          points: { show: false },
        }))],
        cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
        hooks: { setCursor: [(chart) => this.readLine(chart.cursor.idx)] },
      }, null, this.canvas);
      const { canvas } = this.chart.ctx;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `amplitude in ${unit || "1"} over frequency: ${found.names.join(", ")}`);
    }
    this.lines.replaceChildren(...found.lines.map((line) => make("li", {},
      this.swatch(series[found.names.indexOf(line.name)]),
      `${line.name} ${show(line.amplitude)} ${unit} at ${show(line.f_Hz)} Hz`)));
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width && height && (this.chart.width !== width || this.chart.height !== height)) {
      this.chart.setSize({ width, height });
    }
    const log = this.chosen.scale === "log"; // which has no 0
    this.chart.setData([found.f_Hz, ...found.rows.map((row) => (log ? row.map((v) => v || 1e-30) : row))]);
  }

  topHz() {
    const half_Hz = this.found.rate_Hz / 2;
    return Math.min(this.chosen.top_Hz ?? half_Hz, half_Hz);
  }

  readLine(place) {
    const { found } = this;
    if (!found?.f_Hz) return;
    if (place === null || place === undefined) {
      this.read.textContent = "";
      return;
    }
    const unit = found.series[0].unit;
    this.read.textContent = [`${show(found.f_Hz[place])} Hz:`,
      ...found.names.map((name, i) => `${name} ${show(found.rows[i][place])} ${unit}`)].join("\n");
  }

  press(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const { f_Hz } = this.found;
    const place = Math.min(f_Hz.length - 1, Math.max(0, (this.chart.cursor.idx ?? 0) + step));
    this.chart.setCursor({ left: this.chart.valToPos(f_Hz[place], "x"), top: 1 });
  }

  draw_xy(found) {
    const { stack } = this.source();
    const [x, y] = found.series;
    const title = (one) => (one.unit ? `${one.name}, ${one.unit}` : one.name);
    const equal = x.unit === y.unit;
    const every = found.every > 1 ? ` One of ${found.every} samples is drawn.` : "";
    this.said.textContent = this.told(found) + (equal ? ", equal scales." : ".") + every;
    let canvas = this.place.querySelector("canvas.xy");
    if (!canvas) {
      canvas = make("canvas", { className: "xy" });
      canvas.setAttribute("role", "img");
      this.place.replaceChildren(canvas);
    }
    const range = ({ min, max }) => `${show(min)} to ${show(max)}`;
    canvas.setAttribute("aria-label",
      `${title(y)} from ${range(found.up)}, over ${title(x)} from ${range(found.across)}`);
    if (!found.across.count || !found.up.count) {
      this.clear("There is nothing to draw: no sample has a value.");
      return;
    }
    drawXY(canvas, {
      x: found.x, y: found.y, across: [found.across.min, found.across.max], up: [found.up.min, found.up.max],
      equal, names: [title(x), title(y)], colour: stack.colours.traces[y.colour], colours: stack.colours,
      font: stack.font,
    });
  }
}
