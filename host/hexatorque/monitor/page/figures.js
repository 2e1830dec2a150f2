// Figures of a span of samples and its spectrum. Only numbers: no page is needed.

/** Sum with the rounding errors carried along (Neumaier): a small mean of large values stays right. */
function total(values, term) {
  let sum = 0;
  let rest = 0;
  for (const value of values) {
    const x = term(value);
    const next = sum + x;
    rest += Math.abs(sum) >= Math.abs(x) ? sum - next + x : x - next + sum;
    sum = next;
  }
  return sum + rest;
}

/** {mean, rms, min, max, peak} of the samples that came, peak from smallest to largest, and
 * {count, missing}: how many came and did not. NaN if none came. */
export function figures(values) {
  const came = Array.prototype.filter.call(values, Number.isFinite);
  const count = came.length;
  let min = count ? came[0] : NaN;
  let max = min;
  for (const value of came) {
    if (value < min) min = value;
    if (value > max) max = value;
  }
  return {
    count, missing: values.length - count, min, max, peak: max - min,
    mean: total(came, (x) => x) / count,
    rms: Math.sqrt(total(came, (x) => x * x) / count),
  };
}

/** cos and -sin of the first half of a turn in `count` steps. */
function circle(count) {
  const half = count >> 1;
  return {
    cos: Float64Array.from({ length: half }, (_, k) => Math.cos((2 * Math.PI * k) / count)),
    sin: Float64Array.from({ length: half }, (_, k) => -Math.sin((2 * Math.PI * k) / count)),
  };
}

/** Fourier transform in place. The number of values is a power of two, and `cos` and `sin` are those
 * of its circle. */
function transform({ re, im }, { cos, sin }) {
  const count = re.length;
  for (let i = 1, j = 0; i < count; i++) {
    let bit = count >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j |= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let length = 1; length < count; length *= 2) {
    const step = (count >> 1) / length;
    for (let begin = 0; begin < count; begin += 2 * length) {
      for (let k = 0, a = begin, b = begin + length; k < length; k++, a++, b++) {
        const c = cos[k * step];
        const s = sin[k * step];
        const x = re[b] * c - im[b] * s;
        const y = re[b] * s + im[b] * c;
        re[b] = re[a] - x;
        im[b] = im[a] - y;
        re[a] += x;
        im[a] += y;
      }
    }
  }
}

const pair = (length) => ({ re: new Float64Array(length), im: new Float64Array(length) });
let planned = { count: 0 };

/** What the transforms of so many values have in common. The latest is kept: the channels of a span
 * have the same number of samples. */
function plan(count) {
  if (planned.count === count) return planned;
  let length = 1;
  while (length < 2 * count) length *= 2;
  const chirp = pair(count);
  const filter = pair(length);
  for (let n = 0; n < count; n++) {
    const angle = (Math.PI * ((n * n) % (2 * count))) / count;
    for (const [name, value] of [["re", Math.cos(angle)], ["im", Math.sin(angle)]]) {
      chirp[name][n] = value;
      filter[name][n] = filter[name][(length - n) % length] = value;
    }
  }
  const turn = circle(length);
  transform(filter, turn);
  planned = { count, length, chirp, filter, turn };
  return planned;
}

/** Sizes of the Fourier transform of real values from 0 to half the rate, for any number of values: as
 * a convolution with a chirp (Bluestein, 1970) of a length that is a power of two. */
function sizes(values) {
  const { count, length, chirp, filter, turn } = plan(values.length);
  const a = pair(length);
  for (let n = 0; n < count; n++) {
    a.re[n] = values[n] * chirp.re[n];
    a.im[n] = -values[n] * chirp.im[n];
  }
  transform(a, turn);
  // The inverse transform is the transform of the conjugate; only the size of the result counts.
  for (let k = 0; k < length; k++) {
    const re = a.re[k] * filter.re[k] - a.im[k] * filter.im[k];
    a.im[k] = -(a.re[k] * filter.im[k] + a.im[k] * filter.re[k]);
    a.re[k] = re;
  }
  transform(a, turn);
  return Float64Array.from({ length: (count >> 1) + 1 },
    (_, k) => Math.hypot(a.re[k], a.im[k]) / length);
}

/** The amplitude spectrum with a Hann window: {step_Hz, amplitude}. amplitude[k] is the peak amplitude
 * at k step_Hz in the unit of the samples: 2 |sum w x exp(-j 2 pi k n / N)| / sum w, half of that at 0.
 * null if there are fewer than four samples, or one is missing. */
export function spectrum(values, rate_Hz) {
  const count = values.length;
  if (count < 4 || !Array.prototype.every.call(values, Number.isFinite)) return null;
  const window = Float64Array.from(values, (_, n) => 0.5 - 0.5 * Math.cos((2 * Math.PI * n) / count));
  const amplitude = sizes(window.map((w, n) => w * values[n]));
  const sum = count / 2; // of the window
  amplitude.forEach((size, k) => { amplitude[k] = ((k ? 2 : 1) * size) / sum; });
  return { step_Hz: rate_Hz / count, amplitude };
}

/** The places of the largest lines: maxima of the spectrum, the largest first, at most so many. */
export function largest(amplitude, most) {
  const tops = [];
  for (let k = 1; k < amplitude.length; k++) {
    if (amplitude[k] > amplitude[k - 1] && !(amplitude[k] < amplitude[k + 1])) tops.push(k);
  }
  return tops.sort((a, b) => amplitude[b] - amplitude[a]).slice(0, most);
}
