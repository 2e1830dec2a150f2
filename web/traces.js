// The traced samples: the latest of them, and their envelopes for drawing. Sample n of a ring is that
// of the tick n * decimation.

export class Ring {
  constructor(channels, capacity) {
    this.capacity = capacity;
    this.rows = Array.from({ length: channels }, () => new Float32Array(capacity).fill(NaN));
    this.begin = this.end = 0;
  }

  /** The next sample: a value for each channel. */
  push(number, values) {
    if (!this.end) this.begin = this.end = number;
    const place = number % this.capacity;
    this.rows.forEach((row, k) => { row[place] = values[k]; });
    this.end = number + 1;
  }

  /** The numbers of those of the samples `first` to `last` that are kept. */
  kept(first, last) {
    return [Math.max(first, this.begin, this.end - this.capacity), Math.min(last, this.end)];
  }

  /** The smallest and the largest value in each of the bins `first` to before `last` of `width`
   * samples, channel by channel; NaN in an empty bin. */
  envelope(width, first, last) {
    const count = Math.max(0, last - first);
    const lo = new Float32Array(this.rows.length * count).fill(NaN);
    const hi = width === 1 ? lo : lo.slice();
    const [from, to] = this.kept(first * width, last * width);
    this.rows.forEach((row, k) => {
      for (let n = from; n < to; n++) {
        const value = row[n % this.capacity];
        const at = k * count + Math.floor(n / width) - first;
        if (!(lo[at] <= value)) lo[at] = Number.isNaN(value) ? lo[at] : value;
        if (!(hi[at] >= value)) hi[at] = Number.isNaN(value) ? hi[at] : value;
      }
    });
    return { lo, hi };
  }

  newest() {
    return this.end ? this.rows.map((row) => row[(this.end - 1) % this.capacity]) : null;
  }

  /** The means of the latest samples; NaN for a channel that has no newest value. */
  means(samples) {
    const [from, to] = this.kept(this.end - samples, this.end);
    return this.rows.map((row) => {
      let [sum, count] = [0, 0];
      for (let n = from; n < to; n++) {
        const value = row[n % this.capacity];
        if (Number.isFinite(value)) { sum += value; count += 1; }
      }
      return Number.isFinite(row[(to - 1) % this.capacity]) ? sum / count : NaN;
    });
  }
}

/** The bins of a ring that the page has yet to get. A bin comes again until it is full. */
export class View {
  constructor(ring, rate_Hz, window_s, bins) {
    this.ring = ring;
    this.width = Math.max(1, Math.floor(Math.round(window_s * rate_Hz) / bins));
    this.count = Math.ceil(Math.round(window_s * rate_Hz) / this.width) + 1;
    this.next = 0;
  }

  /** {first, count, width, lo, hi}, or null. */
  news() {
    const { end } = this.ring;
    if (!end) return null;
    const last = Math.floor((end - 1) / this.width) + 1;
    const first = Math.max(this.next, last - this.count);
    if (first * this.width >= end) return null;
    this.next = Math.floor(end / this.width);
    return { first, count: last - first, width: this.width, ...this.ring.envelope(this.width, first, last) };
  }
}

/** float32 in base64, as the page's numbers.js decodes it. */
export function encode(values) {
  const raw = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  let text = "";
  for (let i = 0; i < raw.length; i += 0x8000) text += String.fromCharCode(...raw.subarray(i, i + 0x8000));
  return btoa(text);
}
