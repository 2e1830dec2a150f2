// Numbers: as the monitor sends them, as people read and write them.

/** An array of float32 in base64. */
export function decode(text) {
  const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(raw.buffer);
}

/** A number for reading: four digits that matter, a proper minus. */
export function show(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  let text;
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) text = value.toExponential(2);
  else {
    const whole = size < 1 ? 1 : Math.floor(Math.log10(size)) + 1;
    text = value.toFixed(Math.min(5, Math.max(0, digits - whole)));
  }
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** The number that a person wrote, or NaN. Point or comma is the decimal sign, and there are no
 * thousands separators; a minus sign may be the one that word processors write. */
export function parse(text) {
  const plain = text.trim().replace(/[−–]/g, "-").replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
}

/** The digits after the point that numbers at this distance need. */
export function decimals(step) {
  return Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
}

/** A number with so many digits after the point, and a proper minus. */
export function fixed(value, places) {
  const text = value.toFixed(places);
  return (Number(text) === 0 ? (0).toFixed(places) : text).replace("-", "−");
}
