// Plots above each other, one per unit.

import { show } from "/numbers.js";
import { Plot } from "/plot.js";

/* global uPlot */

/** The plots share their time. Time 0 is the newest sample, or the trigger. */
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
      traces: Array.from({ length: 5 }, (_, i) => colour(`--trace-${i}`)),
    };
  }

  /** series: {name, unit, index, colour, dashed, steps, reference, help}, in order; a plot per unit. */
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
