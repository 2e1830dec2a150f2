// One plot of traces over time. uPlot draws it (vendor/uplot).

import { drawLevels, levelsOf } from "./limits.js";
import { decimals, fixed, parse, show } from "./numbers.js";

/* global uPlot */

/** Distances of ticks: 1, 2 and 5 times a power of ten. */
export const STEPS = Array.from({ length: 22 }, (_, i) => i - 12)
  .flatMap((power) => [1, 2, 5].map((factor) => Number(`${factor}e${power}`)));
/** Room around the traces, in pixels. */
const ROOM = { above: 8, right: 20, values: 58, times: 22, below: 8 };
/** Pixels of line and gap of a dashed trace. */
const DASH = [7, 4];
/** The same of a capture that is laid over another, whose trace is solid or dashed. */
const OVER = { solid: [3, 3], dashed: [1, 4] };
/** A drag of fewer pixels is a click. */
const LEAST_DRAG = 6;

/** All traces of one unit. */
export class Plot {
  constructor(stack, unit, series, last) {
    this.stack = stack;
    // The first on top: a reference stays visible on what follows it.
    this.drawn = [...series].reverse();
    this.fixed = null;
    this.scale = null;
    this.shown = [0, 0]; // from and to, in seconds
    this.unit = unit;
    this.names = series.map((one) => one.name);
    this.levels = []; // of limits
    this.box = document.createElement("div");
    this.box.className = "plot";
    this.place = document.createElement("div");
    this.place.className = "chart";
    this.box.append(this.legend(unit, series), this.place);
    this.chart = new uPlot(this.options(last), null, this.place);
    this.chart.ctx.canvas.setAttribute("role", "img");
    this.limit();
    // A finger scrolls the page; only a mouse selects and sets marks.
    this.chart.over.addEventListener("pointerdown", (event) => {
      stack.mouse = event.pointerType === "mouse";
    });
  }

  /** Take the levels of the limits that concern this plot. */
  limit() {
    this.levels = levelsOf(this.stack.levels, this.names);
    const said = this.levels.map(({ name, value }) => `${name} at ${show(value)} ${this.unit}`);
    this.chart.ctx.canvas.setAttribute("aria-label",
      this.names.join(", ") + (said.length ? `; limits: ${said.join(", ")}` : ""));
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
      swatch.classList.toggle("dashed", one.dashed);
      const name = document.createElement("span");
      name.textContent = one.name;
      one.value = document.createElement("output");
      one.value.dataset.channel = one.name;
      one.over = document.createElement("span");
      one.over.className = "over";
      chip.append(swatch, name, one.value, one.over);
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
        dash: one.dashed ? DASH : undefined,
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
        drawAxes: [() => this.zeroLine()],
        draw: [() => this.laidOver(), () => this.lines(), () => this.limitLines()],
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

  /** The scale of the vertical axis. By hand: it stays while the traces fill a fair part of it, and
   * uPlot's own would move with every picture. */
  follow(low, high) {
    if (this.fixed) return this.fixed;
    if (!Number.isFinite(low) || !Number.isFinite(high) || low === null) {
      return this.scale || [0, 1];
    }
    if (this.stack.over) {
      const [least, most] = this.stack.over.range(this.names, ...this.shown);
      [low, high] = [Math.min(low, least), Math.max(high, most)];
    }
    if (this.stack.reachLevels) {
      for (const { value } of this.levels) [low, high] = [Math.min(low, value), Math.max(high, value)];
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
    this.shown = [from_s, to_s];
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    if (chart.width !== width || chart.height !== height) chart.setSize({ width, height });
    const rows = this.drawn.map((one) => (stack.bins ? stack.bins.rows[one.index] : []));
    chart.batch(() => {
      chart.setData([times_s, ...rows], false);
      chart.setScale("x", { min: from_s, max: to_s });
    });
  }

  /** A stronger line at zero. By hand: uPlot draws all lines of a grid alike. */
  zeroLine() {
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

  /** Draw by hand, inside the plot's area only. draw(pen, box, ratio): ratio is pixels of the canvas
   * per pixel of the page. */
  inside(draw) {
    const { ctx: pen, bbox } = this.chart;
    const ratio = uPlot.pxRatio;
    pen.save();
    pen.beginPath();
    pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    pen.clip();
    pen.lineWidth = ratio;
    draw(pen, bbox, ratio);
    pen.restore();
  }

  /** The capture that is laid over the one that is shown. By hand: its samples have other times. */
  laidOver() {
    const { chart, stack } = this;
    if (!stack.over) return;
    this.inside((pen, _, ratio) => {
      for (const one of this.drawn) {
        pen.strokeStyle = stack.colours.traces[one.colour];
        pen.setLineDash(OVER[one.dashed ? "dashed" : "solid"].map((length) => length * ratio));
        stack.over.draw(pen, one.name, one.steps, ...this.shown,
          (time_s) => chart.valToPos(time_s, "x", true), (value) => chart.valToPos(value, "y", true));
      }
    });
  }

  limitLines() {
    const { chart, stack } = this;
    const ratio = uPlot.pxRatio;
    const style = { colour: stack.colours.warn, paper: stack.colours.card, font: stack.fontOf(ratio) };
    drawLevels(chart.ctx, chart.bbox, (value) => chart.valToPos(value, "y", true), this.levels, style, ratio);
  }

  /** The trigger, resets of the board and the two marks to measure between. By hand: uPlot has no such
   * lines. */
  lines() {
    const { chart, stack } = this;
    const { accent, stop } = stack.colours;
    this.inside((pen, bbox, ratio) => {
      const upright = (time_s, colour, dash, text = "") => {
        const x = Math.round(chart.valToPos(time_s, "x", true)) + 0.5;
        pen.strokeStyle = pen.fillStyle = colour;
        pen.setLineDash(dash.map((length) => length * ratio));
        pen.beginPath();
        pen.moveTo(x, bbox.top);
        pen.lineTo(x, bbox.top + bbox.height);
        pen.stroke();
        pen.font = stack.fontOf(ratio);
        pen.textAlign = "left";
        pen.textBaseline = "top";
        pen.fillText(text, x + 4 * ratio, bbox.top);
      };
      if (stack.trigger) upright(0, accent, [6, 4]);
      for (const mark of stack.marks) {
        upright(mark.time_s - stack.zero_s, stop, [2, 2], mark.text);
      }
      for (const mark_s of stack.markPair()) upright(mark_s, accent, []);
    });
  }
}
