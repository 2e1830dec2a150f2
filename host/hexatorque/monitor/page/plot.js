// Traces over time, one plot per unit. uPlot draws them (vendor/uplot).

import { decimals, fixed, parse, show } from "/numbers.js";

/* global uPlot */

/** Distances of ticks: 1, 2 and 5 times a power of ten. */
const STEPS = Array.from({ length: 22 }, (_, i) => i - 12)
  .flatMap((power) => [1, 2, 5].map((factor) => Number(`${factor}e${power}`)));
/** Room around the traces, in pixels. */
const ROOM = { above: 8, right: 20, values: 58, times: 22, below: 8 };
/** A drag of fewer pixels is a click. */
const LEAST_DRAG = 6;

/** All traces of one unit. */
class Plot {
  constructor(stack, unit, series, last) {
    this.stack = stack;
    // The first on top: a reference stays visible on what follows it.
    this.drawn = [...series].reverse();
    this.fixed = null;
    this.scale = null;
    this.box = document.createElement("div");
    this.box.className = "plot";
    this.place = document.createElement("div");
    this.place.className = "chart";
    this.box.append(this.legend(unit, series), this.place);
    this.chart = new uPlot(this.options(last), null, this.place);
    const canvas = this.chart.ctx.canvas;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", series.map((one) => one.name).join(", "));
    // A finger scrolls the page; only a mouse selects and sets marks.
    this.chart.over.addEventListener("pointerdown", (event) => {
      stack.mouse = event.pointerType === "mouse";
    });
  }

  /** By hand and not uPlot's: without a pointer it shows the newest sample, drawn or not. */
  legend(unit, series) {
    const head = document.createElement("div");
    head.className = "legend";
    const label = document.createElement("span");
    label.className = "unit";
    label.textContent = unit || "–";
    head.append(label);
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
      head.append(chip);
    }
    head.append(this.makeScale());
    return head;
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

  /** last: this plot is the lowest and shows the times. */
  options(last) {
    const { stack } = this;
    const { line, steps } = stack.paths;
    const colour = (name) => () => stack.colours[name];
    const axis = {
      font: stack.font, stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 },
      ticks: { show: false }, incrs: STEPS,
    };
    return {
      width: 300, height: 100, // until the first drawing
      padding: [ROOM.above, ROOM.right, 0, 0],
      legend: { show: false },
      scales: {
        x: { time: false, auto: false },
        y: { range: (_, low, high) => this.follow(low, high) },
      },
      axes: [
        { ...axis, size: last ? ROOM.times : ROOM.below, gap: 6, space: 90,
          values: (_, times_s) => (last ? this.times(times_s) : []) },
        { ...axis, size: ROOM.values, gap: 8,
          space: (_chart, _axis, _low, _high, height) => Math.max(14, Math.min(26, height / 5)),
          values: (_chart, values, _axis, _space, step) =>
            values.map((value) => fixed(value, decimals(step))) },
      ],
      series: [{}, ...this.drawn.map((one) => ({
        stroke: () => stack.colours.traces[one.colour],
        // One pixel, because a browser that has no graphics processor draws wider lines six times
        // slower. References move little, so a wider line costs little.
        width: one.reference ? 2 : 1,
        paths: one.steps ? steps : line,
        points: { show: false },
      }))],
      cursor: {
        y: false,
        points: { show: false },
        sync: { key: stack.key, scales: ["x", null] },
        drag: { x: true, y: false, setScale: false, dist: LEAST_DRAG },
        bind: {
          mousedown: (_chart, _target, begin) => (event) => {
            if (event.button !== 0 || !stack.mouse) return;
            stack.held = true; // the traces stand still while a part of them is chosen
            begin(event);
          },
          mouseup: (chart, _target, end) => (event) => {
            if (event.button !== 0) return;
            end(event);
            stack.choose(chart);
          },
          dblclick: () => () => stack.whole(),
        },
      },
      hooks: {
        drawAxes: [() => this.zero()],
        draw: [() => this.lines()],
        setCursor: [(chart) => {
          const { left } = chart.cursor;
          stack.point(left < 0 ? null : chart.posToVal(left, "x"));
        }],
      },
    };
  }

  /** Labels of the time axis, the last with the unit. */
  times(times_s) {
    const [factor, unit] = this.stack.window() < 0.5 ? [1e3, "ms"] : [1, "s"];
    const places = decimals((times_s[1] - times_s[0]) * factor);
    const text = times_s.map((time_s) => fixed(time_s * factor, places));
    return text.map((one, i) => (i === text.length - 1 ? `${one} ${unit}` : one));
  }

  /** The scale of the vertical axis: kept while the traces fill a fair part of it. */
  follow(low, high) {
    if (this.fixed) return this.fixed;
    if (!Number.isFinite(low) || !Number.isFinite(high) || low === null) {
      return this.scale || [0, 1];
    }
    const least = Math.max(Math.abs(low), Math.abs(high)) * 0.02 || 1;
    if (high - low < least) {
      const middle = (low + high) / 2;
      [low, high] = [middle - least / 2, middle + least / 2];
    }
    const span = high - low;
    const old = this.scale;
    const outside = !old || low < old[0] || high > old[1];
    if (outside || span < 0.45 * (old[1] - old[0])) {
      const step = STEPS.find((one) => one >= (span * 1.1) / 8);
      this.scale = [
        Math.floor((low - span * 0.04) / step) * step,
        Math.ceil((high + span * 0.04) / step) * step,
      ];
    }
    return this.scale;
  }

  /** times_s: of the values of all traces; from_s, to_s: what is shown. */
  draw(times_s, from_s, to_s) {
    const { chart, place, stack } = this;
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    if (chart.width !== width || chart.height !== height) chart.setSize({ width, height });
    const rows = this.drawn.map((one) => (stack.bins ? stack.bins.rows[one.index] : []));
    chart.batch(() => {
      chart.setData([times_s, ...rows], false);
      chart.setScale("x", { min: from_s, max: to_s });
    });
  }

  /** A stronger line at zero. */
  zero() {
    const { ctx: pen, bbox } = this.chart;
    const { min, max } = this.chart.scales.y;
    if (!(min <= 0 && max >= 0)) return;
    const y = Math.round(this.chart.valToPos(0, "y", true)) + 0.5;
    pen.save();
    pen.globalAlpha = 0.5;
    pen.strokeStyle = this.stack.colours.faint;
    pen.lineWidth = uPlot.pxRatio;
    pen.beginPath();
    pen.moveTo(bbox.left, y);
    pen.lineTo(bbox.left + bbox.width, y);
    pen.stroke();
    pen.restore();
  }

  /** Lines through all plots: the trigger, resets of the board, the mark to measure from. */
  lines() {
    const { chart, stack } = this;
    const { ctx: pen, bbox } = chart;
    const { accent, stop } = stack.colours;
    const ratio = uPlot.pxRatio;
    pen.save();
    pen.beginPath();
    pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    pen.clip();
    pen.lineWidth = ratio;
    const upright = (time_s, colour, dash, text = "") => {
      const x = Math.round(chart.valToPos(time_s, "x", true)) + 0.5;
      pen.strokeStyle = pen.fillStyle = colour;
      pen.setLineDash(dash.map((length) => length * ratio));
      pen.beginPath();
      pen.moveTo(x, bbox.top);
      pen.lineTo(x, bbox.top + bbox.height);
      pen.stroke();
      pen.font = stack.font.replace(/\d+/, (size) => size * ratio);
      pen.textAlign = "left";
      pen.textBaseline = "top";
      pen.fillText(text, x + 4 * ratio, bbox.top);
    };
    if (stack.trigger) upright(0, accent, [6, 4]);
    for (const mark of stack.marks) {
      upright(mark.time_s - stack.zero_s, stop, [2, 2], mark.text);
    }
    if (stack.mark_s !== null) upright(stack.mark_s, accent, []);
    pen.restore();
  }
}

/** Plots above each other that share their time. Time 0 is the newest sample, or the trigger. */
export class Stack {
  /** options: words(name, value) names a value or says null; zoomed(from, to) on a choice. */
  constructor(box, options) {
    this.box = box;
    this.options = options;
    this.key = `stack-${Math.random()}`; // the plots with this key share their pointer
    this.paths = { line: uPlot.paths.linear(), steps: uPlot.paths.stepped({ align: 1 }) };
    this.plots = [];
    this.bins = null;
    this.view = null; // chosen part, [from, to]
    this.window_s = 5;
    this.trigger = false; // time 0 is a trigger, not the newest sample
    this.marks = []; // {time_s, text}: what happened when
    this.zero_s = 0; // the time of the samples that is time 0 of what is drawn
    this.cursor_s = this.mark_s = null; // counted from there
    this.mouse = true; // not a finger
    this.held = false;
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
      faint: colour("--faint"),
      line: colour("--line"),
      accent: colour("--accent"),
      stop: colour("--stop"),
      traces: Array.from({ length: 10 }, (_, i) => colour(`--trace-${i}`)),
    };
  }

  /** series: {name, unit, index, colour, steps, reference, help}, in order; a plot per unit. */
  show(series) {
    const units = new Map();
    for (const one of series) {
      if (!units.has(one.unit)) units.set(one.unit, []);
      units.get(one.unit).push(one);
    }
    for (const plot of this.plots) plot.chart.destroy();
    this.series = series;
    this.cursor_s = this.mark_s = null;
    this.held = false;
    this.plots = [...units].map(([unit, rows], i) =>
      new Plot(this, unit, rows, i === units.size - 1));
    this.box.replaceChildren(...this.plots.map((plot) => plot.box));
    this.draw();
  }

  end_s() {
    return this.bins ? this.bins.time(this.bins.end) : 0;
  }

  /** [from, to] that is drawn. */
  span() {
    if (this.view) return this.view;
    const end = this.end_s();
    return [end - this.window_s, end];
  }

  window() {
    const [from_s, to_s] = this.span();
    return to_s - from_s;
  }

  /** The mouse button went up: a part was selected, or a point to measure from. */
  choose(chart) {
    this.held = false;
    const { left, width } = chart.select;
    if (width > 0) {
      this.view = [left, left + width].map((x) => this.zero_s + chart.posToVal(x, "x"));
      this.mark_s = null;
      for (const plot of this.plots) plot.chart.setSelect({ left: 0, width: 0 }, false);
      this.options.zoomed(this.view);
    } else this.mark_s = this.mark_s === null ? this.cursor_s : null;
    this.draw();
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
      if (this.held) return;
      this.zero_s = this.trigger ? 0 : this.end_s();
      const times_s = this.bins ? this.bins.times(this.zero_s) : [];
      const [from_s, to_s] = this.span().map((time_s) => time_s - this.zero_s);
      for (const plot of this.plots) plot.draw(times_s, from_s, to_s);
      this.read();
    });
  }

  /** The pointer is at a time, or null: at none. */
  point(time_s) {
    this.cursor_s = time_s;
    this.read();
  }

  /** The values at the pointer into the legend. */
  read() {
    this.options.cursor(this.cursor_s, this.mark_s);
    if (this.cursor_s === null) return;
    for (const one of this.series) {
      const found = this.bins?.at(one.index, this.zero_s + this.cursor_s);
      one.value.textContent = found ? this.text(one, ...found) : "–";
    }
  }

  text(one, low, high = low) {
    const word = low === high ? this.options.words(one.name, low) : null;
    if (word) return word;
    return show(low) === show(high) ? show(low) : `${show(low)} … ${show(high)}`;
  }

  /** Newest values into the legend, unless the pointer reads others. */
  newest(values) {
    if (this.cursor_s !== null) return;
    for (const one of this.series || []) {
      one.value.textContent = this.text(one, values[one.index] ?? NaN);
    }
  }
}
