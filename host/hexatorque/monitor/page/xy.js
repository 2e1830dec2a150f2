// One channel over another.

import { decimals, fixed } from "./numbers.js";

/** Room for the scales, in pixels. */
const ROOM = { left: 58, right: 14, above: 10, below: 34 };
const STEPS = Array.from({ length: 22 }, (_, i) => i - 12)
  .flatMap((power) => [1, 2, 5].map((factor) => Number(`${factor}e${power}`)));

/** What is shown of two ranges on so many pixels: {x, y}, each [from, to]. equal: a pixel is worth the
 * same in both directions. */
export function frame(across, up, wide, high, equal) {
  const [x, y] = [across, up].map(([low, most]) => {
    const size = most - low || Math.abs(most) * 0.02 || 1;
    return { middle: (low + most) / 2, size: size * 1.1 };
  });
  if (equal) {
    const worth = Math.max(x.size / wide, y.size / high);
    [x.size, y.size] = [worth * wide, worth * high];
  }
  return {
    x: [x.middle - x.size / 2, x.middle + x.size / 2],
    y: [y.middle - y.size / 2, y.middle + y.size / 2],
  };
}

/** Round numbers of a range, at least so many pixels apart. */
function ticks([from, to], pixels, apart) {
  const step = STEPS.find((one) => one >= ((to - from) * apart) / pixels);
  const places = decimals(step);
  const out = [];
  for (let n = Math.ceil(from / step); n * step <= to; n++) {
    out.push([n * step, fixed(n * step, places)]);
  }
  return out;
}

/** Draw y over x on a canvas. x, y: samples, with NaN for those that are missing; across, up: their
 * smallest and largest values; names: of the channels, with units; colours: see Stack. */
export function drawXY(canvas, { x, y, across, up, equal, names, colour, colours, font }) {
  const ratio = devicePixelRatio;
  const { clientWidth, clientHeight } = canvas.parentElement;
  Object.assign(canvas, { width: clientWidth * ratio, height: clientHeight * ratio });
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const wide = clientWidth - ROOM.left - ROOM.right;
  const high = clientHeight - ROOM.above - ROOM.below;
  if (wide < 20 || high < 20) return;
  const shown = frame(across, up, wide, high, equal);
  const place = {
    x: (value) => ROOM.left + ((value - shown.x[0]) / (shown.x[1] - shown.x[0])) * wide,
    y: (value) => ROOM.above + ((shown.y[1] - value) / (shown.y[1] - shown.y[0])) * high,
  };
  pen.font = font;
  pen.lineWidth = 1;
  const line = (value, x0, y0, x1, y1) => {
    pen.strokeStyle = value === 0 ? colours.faint : colours.line;
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
    pen.stroke();
  };
  pen.fillStyle = colours.faint;
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  for (const [value, text] of ticks(shown.y, high, 26)) {
    const at = Math.round(place.y(value)) + 0.5;
    line(value, ROOM.left, at, ROOM.left + wide, at);
    pen.fillText(text, ROOM.left - 8, at);
  }
  pen.textBaseline = "top";
  pen.textAlign = "center";
  for (const [value, text] of ticks(shown.x, wide, 70)) {
    const at = Math.round(place.x(value)) + 0.5;
    line(value, at, ROOM.above, at, ROOM.above + high);
    pen.fillText(text, at, ROOM.above + high + 5);
  }
  pen.fillText(names[0], ROOM.left + wide / 2, ROOM.above + high + 19);
  pen.textAlign = "left";
  pen.fillText(names[1], ROOM.left + 6, ROOM.above + 2);
  pen.strokeStyle = colour;
  pen.beginPath();
  let down = false;
  for (let i = 0; i < x.length; i++) {
    const there = Number.isFinite(x[i]) && Number.isFinite(y[i]);
    if (there && down) pen.lineTo(place.x(x[i]), place.y(y[i]));
    else if (there) pen.moveTo(place.x(x[i]), place.y(y[i]));
    down = there;
  }
  pen.stroke();
}
