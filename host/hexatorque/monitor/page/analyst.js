// A thread beside the page that gets the samples of a span and computes: however long that takes, the
// page answers the monitor meanwhile.

import { figures, largest, spectrum } from "./figures.js";
import { decode } from "./numbers.js";

/** Most lines of a spectrum that are drawn, and most points of an x-y view. */
const LINES = 4096;
const POINTS = 60000;
/** How many lines are named, and the share of the largest one that they have at least. */
const NAMED = 6;
const NAMED_SHARE = 0.01;

/** {rate_Hz, count, columns: name -> samples} of a span of the traces. */
async function traced({ begin_s, end_s, epoch, names }) {
  let data;
  try {
    const answer = await fetch(`/span?begin_s=${Math.max(0, begin_s)}&end_s=${Math.max(0, end_s)}`);
    data = await answer.json();
  } catch {
    throw new Error("the monitor does not answer");
  }
  if (data.error) throw new Error(data.error);
  if (data.epoch !== epoch) throw new Error("The traces have just changed.");
  const all = decode(data.lo);
  const { count } = data;
  const columns = Object.fromEntries(
    names.map((name, i) => [name, all.subarray(i * count, (i + 1) * count)]));
  return { rate_Hz: 1 / data.dt_s, count, columns };
}

/** Of every so many neighbours the largest, so that no line is missed. */
function coarser(amplitude, factor) {
  if (factor === 1) return amplitude;
  const out = new Float64Array(Math.ceil(amplitude.length / factor));
  amplitude.forEach((size, k) => {
    const place = Math.floor(k / factor);
    if (size > out[place]) out[place] = size;
  });
  return out;
}

const missing = (values) => figures(values).missing;

const WORK = {
  figures: ({ columns }, { names }) => ({ rows: names.map((name) => figures(columns[name])) }),

  spectrum({ rate_Hz, count, columns }, { names }) {
    const lost = Math.max(...names.map((name) => missing(columns[name])));
    if (lost) {
      throw new Error(`No spectrum: ${lost} of ${count} samples have no value. They were lost, or the `
        + "control did not run.");
    }
    if (count < 4) throw new Error("No spectrum: it needs four samples at least.");
    const found = names.map((name) => {
      const { mean } = figures(columns[name]);
      return spectrum(Float64Array.from(columns[name], (value) => value - mean), rate_Hz);
    });
    const [{ step_Hz, amplitude }] = found;
    const factor = Math.ceil(amplitude.length / LINES);
    const lines = found.flatMap((one, i) => largest(one.amplitude, NAMED).map((k) =>
      ({ name: names[i], f_Hz: k * step_Hz, amplitude: one.amplitude[k] })));
    lines.sort((a, b) => b.amplitude - a.amplitude);
    return {
      step_Hz,
      f_Hz: Float64Array.from({ length: Math.ceil(amplitude.length / factor) },
        (_, k) => k * factor * step_Hz),
      rows: found.map((one) => coarser(one.amplitude, factor)),
      lines: lines.filter((one) => one.amplitude >= NAMED_SHARE * lines[0].amplitude).slice(0, NAMED),
    };
  },

  xy({ count, columns }, { names }) {
    const every = Math.ceil(count / POINTS);
    const [x, y] = names.map((name) => columns[name].filter((_, i) => i % every === 0));
    const [across, up] = names.map((name) => figures(columns[name]));
    return { x, y, across, up, every };
  },
};

onmessage = async ({ data: { id, span, samples, kind, names } }) => {
  try {
    const part = samples ?? await traced(span);
    if (!part.count) throw new Error("There are no samples in this part.");
    const { rate_Hz, count } = part;
    postMessage({ id, rate_Hz, count, ...WORK[kind](part, { names }) });
  } catch (error) {
    postMessage({ id, error: error.message });
  }
};
