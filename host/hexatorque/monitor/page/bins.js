// The traced samples as the plots need them: the smallest and the largest value of each bin.

/** The latest bins, channel by channel. Bin n is at start_s + n * dt_s. */
export class Bins {
  constructor(channels, capacity, dt_s, start_s = 0) {
    this.capacity = capacity;
    this.dt_s = dt_s;
    this.start_s = start_s;
    this.begin = this.end = 0;
    //: Two values a bin and channel. null where no sample came, so that the line is broken there.
    this.rows = Array.from({ length: channels }, () => []);
  }

  /** lo and hi hold `count` values of the first channel, then of the next. A bin that was not yet
   * full comes again. */
  put(first, count, lo, hi) {
    if (this.begin === this.end || first < this.begin || first > this.end + this.capacity) {
      this.begin = this.end = first;
    }
    const kept = Math.min(this.end, first) - this.begin;
    const begin = Math.max(this.begin, first + count - this.capacity);
    this.rows.forEach((row, channel) => {
      row.length = 2 * kept;
      for (let bin = this.begin + kept; bin < first; bin++) row.push(null, null);
      for (let i = channel * count; i < (channel + 1) * count; i++) append(row, lo[i], hi[i]);
      row.splice(0, 2 * (begin - this.begin));
    });
    this.begin = begin;
    this.end = first + count;
  }

  time(bin) {
    return this.start_s + bin * this.dt_s;
  }

  /** The time of each value of a row, counted from zero_s. */
  times(zero_s) {
    const times = [];
    for (let bin = this.begin; bin < this.end; bin++) {
      const time_s = this.time(bin) - zero_s;
      times.push(time_s, time_s);
    }
    return times;
  }

  /** [smallest, largest] of a channel in the bin at a time, or null. */
  at(channel, time_s) {
    const bin = Math.floor((time_s - this.start_s) / this.dt_s + 1e-6);
    if (bin < this.begin || bin >= this.end) return null;
    const place = 2 * (bin - this.begin);
    const [one, other] = this.rows[channel].slice(place, place + 2);
    return one === null ? null : [Math.min(one, other), Math.max(one, other)];
  }
}

/** Add a bin, the end first that is nearer to the last value: the line needs no way back. */
function append(row, low, high) {
  const last = row.at(-1) ?? low;
  if (!Number.isFinite(low) || !Number.isFinite(high)) row.push(null, null);
  else if (Math.abs(last - low) <= Math.abs(last - high)) row.push(low, high);
  else row.push(high, low);
}
