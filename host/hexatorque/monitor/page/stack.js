// Plots above each other, one per unit.

import { show } from "./numbers.js";
import { Plot } from "./plot.js";

/* global uPlot */

/** Colours and font of what is drawn, as the style sheet has them now. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ...Object.fromEntries(["faint", "line", "accent", "stop", "warn", "card"].map((name) => [name, colour(name)])),
    traces: Array.from({ length: 5 }, (_, i) => colour(`trace-${i}`)),
    font: `11px ${getComputedStyle(document.body).fontFamily}`,
  };
}

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
    this.levels = []; // of limits: {name, value, channels}
    this.reachLevels = false; // the scales reach as far as the levels
    this.marks = []; // {time_s, text}: what happened when
    this.zero_s = 0; // the time of the samples that is time 0 of what is drawn
    this.cursor_s = null; // counted from there
    this.mark_s = this.until_s = null; // the two marks, likewise
    this.over = null; // a capture that is laid over
    this.mouse = true; // not a finger
    this.held = false;
    this.waiting = false;
    this.restyle();
    new ResizeObserver(() => this.draw()).observe(box);
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", "plots. Left and right arrows move the pointer, with Shift in small "
      + "steps. Enter sets a mark. Z shows the part between two marks.");
    box.addEventListener("keydown", (event) => {
      if (event.target === box && this.press(event)) event.preventDefault();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.restyle();
      this.draw();
    });
  }

  restyle() {
    this.colours = colours();
    this.font = this.colours.font;
  }

  /** The font of the canvas, which has so many pixels per pixel of the page. */
  fontOf(ratio) {
    return this.font.replace(/\d+/, (size) => size * ratio);
  }

  /** Show the levels of these limits; reach: the scales reach as far as they are. */
  limit(levels, reach) {
    this.levels = levels;
    this.reachLevels = reach;
    for (const plot of this.plots) plot.limit();
    this.rescale();
  }

  /** Choose the scales anew, unless they are fixed. */
  rescale() {
    for (const plot of this.plots) plot.scale = null;
    this.draw();
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
    this.cursor_s = this.mark_s = this.until_s = null;
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
    if (!this.over) return [end - this.window_s, end];
    return [Math.min(end - this.window_s, this.over.start_s), Math.max(end, this.over.end_s)];
  }

  window() {
    const [from_s, to_s] = this.span();
    return to_s - from_s;
  }

  /** The marks that are set, none, one or two. */
  markPair() {
    return [this.mark_s, this.until_s].filter((mark_s) => mark_s !== null);
  }

  /** Set the first mark at the pointer, then the second, then none. */
  setMark() {
    if (this.mark_s === null) this.mark_s = this.cursor_s;
    else if (this.until_s === null) this.until_s = this.cursor_s;
    else this.mark_s = this.until_s = null;
    this.options.marked?.();
    this.draw();
  }

  /** Set both marks, or none. */
  setMarks(from_s = null, to_s = null) {
    [this.mark_s, this.until_s] = [from_s, to_s];
    this.options.marked?.();
    this.draw();
  }

  /** Show only a part of the time, counted from time 0. */
  zoom(from_s, to_s) {
    this.view = [this.zero_s + from_s, this.zero_s + to_s];
    this.setMarks();
    this.options.zoomed(this.view);
  }

  /** The mouse button went up: a part was selected, or a point to measure from. */
  choose(chart) {
    this.held = false;
    const { left, width } = chart.select;
    if (width > 0) {
      const part = [left, left + width].map((x) => chart.posToVal(x, "x"));
      for (const plot of this.plots) plot.chart.setSelect({ left: 0, width: 0 }, false);
      this.zoom(...part);
    } else this.setMark();
  }

  /** What a key does while the plots have the focus. Returns whether it is one of these. */
  press({ key, shiftKey, ctrlKey, altKey, metaKey }) {
    const { chart } = this.plots[0] ?? {};
    if (!chart || ctrlKey || altKey || metaKey) return false;
    const [from_s, to_s] = this.span().map((time_s) => time_s - this.zero_s);
    if (key === "ArrowLeft" || key === "ArrowRight") {
      const step_s = ((to_s - from_s) / (shiftKey ? 1000 : 50)) * (key === "ArrowLeft" ? -1 : 1);
      const time_s = (this.cursor_s ?? (from_s + to_s) / 2) + step_s;
      const kept_s = Math.min(to_s, Math.max(from_s, time_s));
      chart.setCursor({ left: chart.valToPos(kept_s, "x"), top: 1 });
    } else if (key === "Enter" && this.cursor_s !== null) this.setMark();
    else if (key.toLowerCase() === "z" && this.until_s !== null && this.mark_s !== this.until_s) {
      this.zoom(...this.markPair().sort((a, b) => a - b));
    } else return false;
    return true;
  }

  whole() {
    this.view = null;
    if (!this.trigger) this.mark_s = this.until_s = null; // time 0 becomes another
    this.options.zoomed(null);
    this.options.marked?.();
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
      const other = this.over?.at(one.name, this.cursor_s) ?? null;
      one.over.textContent = other === null ? "" : this.text(one, other);
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
