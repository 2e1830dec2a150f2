// A picture of what a step of the commissioning has measured: samples as points, the fit as a line.

import { make } from "./asking.js";
import { decimals, fixed } from "./numbers.js";
import { STEPS } from "./plot.js";
import { colours } from "./stack.js";

/* global uPlot */

const HIGH = 190;

/** one: {title, x_label, y_label, x, measured, fit}, of the server. */
export function picture({ title, x_label, y_label, x, measured, fit }) {
  const { faint, line, traces, font } = colours();
  const axis = (label, size) => ({
    label, labelSize: 18, labelFont: font, labelGap: 0, font, stroke: faint, size, gap: 4,
    grid: { stroke: line, width: 1 }, ticks: { show: false }, incrs: STEPS,
    values: (_chart, values, _axis, _space, step) => values.map((value) => fixed(value, decimals(step))),
  });
  const series = [
    {}, { stroke: traces[0], paths: () => null, points: { show: true, size: 5, width: 1, fill: traces[0] } },
    { stroke: traces[1], width: 2, points: { show: false } },
  ];
  const place = make("div", { className: "chart" });
  const chart = new uPlot({
    width: 300, height: HIGH, legend: { show: false }, cursor: { show: false },
    scales: { x: { time: false } }, axes: [axis(x_label, 22), axis(y_label, 54)],
    series: fit ? series : series.slice(0, 2),
  }, fit ? [x, measured, fit] : [x, measured], place);
  chart.ctx.canvas.setAttribute("role", "img");
  chart.ctx.canvas.setAttribute("aria-label", `${title}: ${y_label} over ${x_label}`);
  new ResizeObserver(() => {
    if (place.clientWidth) chart.setSize({ width: place.clientWidth, height: HIGH });
  }).observe(place);
  const chip = (text, className, colour) => {
    const swatch = make("i", { className });
    swatch.style.background = `var(--trace-${colour})`;
    return make("span", { className: "chip" }, swatch, text);
  };
  return make("figure", {}, make("figcaption", { textContent: title }),
    make("p", { className: "legend" }, chip("measured", "dot", 0), ...(fit ? [chip("fit", "", 1)] : [])), place);
}
