// A capture that is laid over another one.

import { decode } from "./numbers.js";

/** The samples of a capture by channel: {number, start_s, dt_s, count, columns}. The trigger is at
 * time 0. */
export function samplesOf(capture) {
  const all = decode(capture.lo);
  const { number, start_s, dt_s, count, channels } = capture;
  const columns = new Map(channels.map((name, i) => [name, all.subarray(i * count, (i + 1) * count)]));
  return { number, start_s, dt_s, count, columns };
}

/** What the plots need of the capture that is laid over another. */
export class Overlay {
  constructor(samples) {
    Object.assign(this, samples);
    this.end_s = this.start_s + this.count * this.dt_s;
  }

  /** [first, last] of the samples from one time to another, and one more at each end. */
  part(from_s, to_s) {
    const place = (time_s) => (time_s - this.start_s) / this.dt_s;
    return [Math.max(0, Math.floor(place(from_s))), Math.min(this.count - 1, Math.ceil(place(to_s)))];
  }

  /** [smallest, largest] of some channels from one time to another; [Infinity, -Infinity] if there
   * is no sample. */
  range(names, from_s, to_s) {
    const [first, last] = this.part(from_s, to_s);
    let [low, high] = [Infinity, -Infinity];
    for (const name of names) {
      const values = this.columns.get(name) ?? [];
      for (let i = first; i <= last && i < values.length; i++) {
        if (values[i] < low) low = values[i];
        if (values[i] > high) high = values[i];
      }
    }
    return [low, high];
  }

  /** The value of a channel at a time, or null. */
  at(name, time_s) {
    const value = this.columns.get(name)?.[Math.floor((time_s - this.start_s) / this.dt_s + 1e-6)];
    return Number.isFinite(value) ? value : null;
  }

  /** Draw a channel. x(time), y(value): the place; of the samples in one column of pixels the line
   * goes through the first, the smallest, the largest and the last. */
  draw(pen, name, steps, from_s, to_s, x, y) {
    const values = this.columns.get(name);
    if (!values) return;
    const [first, last] = this.part(from_s, to_s);
    pen.beginPath();
    let column = null; // {x, low, high, end}
    const flush = () => {
      if (!column) return;
      pen.lineTo(column.x, column.low);
      pen.lineTo(column.x, column.high);
      pen.lineTo(column.x, column.end);
    };
    for (let i = first; i <= last; i++) {
      if (!Number.isFinite(values[i])) {
        flush();
        column = null;
        continue;
      }
      const at = [Math.round(x(this.start_s + i * this.dt_s)), y(values[i])];
      if (column && column.x === at[0]) {
        column.low = Math.min(column.low, at[1]);
        column.high = Math.max(column.high, at[1]);
        column.end = at[1];
        continue;
      }
      flush();
      if (!column) pen.moveTo(...at);
      else if (steps) pen.lineTo(at[0], column.end);
      column = { x: at[0], low: at[1], high: at[1], end: at[1] };
      pen.lineTo(...at);
    }
    flush();
    pen.stroke();
  }
}
