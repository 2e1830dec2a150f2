// Levels of the limits in the plots. Which parameter limits which channel is the server's table.

/** The levels in force: {name, value, channels}, one for each direction. limits: the server's table;
 * values: of the parameters; state: the drive's. */
export function levels(limits, values, state) {
  return limits
    .filter((one) => (!one.state || one.state === state) && Number.isFinite(values[one.parameter]))
    .flatMap(({ parameter, channels, signs }) =>
      signs.map((sign) => ({ name: parameter, value: sign * values[parameter], channels })));
}

/** Those of the levels that concern one of these channels. */
export const levelsOf = (all, names) =>
  all.filter(({ channels }) => channels.some((name) => names.includes(name)));

/** Draw them as lines across a plot. pen: of the canvas; box: {left, top, width, height}; place(value)
 * gives y; ratio: pixels of the canvas per pixel of the page. A level outside the box is left out. */
export function drawLevels(pen, box, place, levels, style, ratio) {
  pen.save();
  pen.strokeStyle = style.colour;
  pen.lineWidth = ratio;
  pen.font = style.font;
  pen.textBaseline = "middle";
  pen.textAlign = "left";
  const taken = []; // where a name is written already: [left, right, y]
  const high = 13 * ratio;
  for (const { name, value } of levels) {
    const y = Math.round(place(value)) + 0.5;
    if (y < box.top || y > box.top + box.height) continue;
    pen.setLineDash([8, 3, 2, 3].map((length) => length * ratio));
    pen.beginPath();
    pen.moveTo(box.left, y);
    pen.lineTo(box.left + box.width, y);
    pen.stroke();
    // The name stands on its line at the oldest samples, right of other names at the same height.
    const middle = Math.min(Math.max(y, box.top + high / 2), box.top + box.height - high / 2);
    const wide = pen.measureText(name).width + 6 * ratio;
    let left = box.left + 6 * ratio;
    for (const [from, to, at] of taken) {
      if (Math.abs(at - middle) < high && from < left + wide && to > left) left = to + 4 * ratio;
    }
    taken.push([left, left + wide, middle]);
    pen.fillStyle = style.paper;
    pen.fillRect(left, middle - high / 2, wide, high);
    pen.fillStyle = style.colour;
    pen.fillText(name, left + 3 * ratio, middle);
  }
  pen.restore();
}
