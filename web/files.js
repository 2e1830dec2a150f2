// Recordings as files that `hexatorque plot` reads (host/hexatorque/recording).

/** The header of a recording {rate_Hz, start_s, columns: [{name, unit, values}], meta}. */
export function headerOf({ rate_Hz, start_s, columns, meta }, format) {
  return {
    format, rate_Hz, start_s, samples: columns[0].values.length,
    units: Object.fromEntries(columns.map(({ name, unit }) => [name, unit])),
    types: Object.fromEntries(columns.map(({ name }) => [name, "float32"])),
    meta,
  };
}

export function csv({ rate_Hz, start_s, columns, meta }) {
  const lines = [["time_s", "tick", ...columns.map(({ name, unit }) => (unit ? `${name} [${unit}]` : name))]];
  for (let i = 0; i < columns[0].values.length; i++) {
    const cells = columns.map(({ values }) => (Number.isNaN(values[i]) ? "" : Number(values[i].toPrecision(9))));
    lines.push([Number((start_s + i / rate_Hz).toPrecision(12)), meta.first_tick + i * meta.decimation, ...cells]);
  }
  return `${lines.map((cells) => cells.join(",")).join("\n")}\n`;
}

/** numpy's archive. */
export function npz(recording, format) {
  const header = new TextEncoder().encode(JSON.stringify(headerOf(recording, format)));
  return zip([
    ["header.npy", npy("|u1", header)],
    ...recording.columns.map(({ name, values }) => [`channel:${name}.npy`, npy("<f4", values)]),
  ]);
}

function npy(type, values) {
  const text = `{'descr': '${type}', 'fortran_order': False, 'shape': (${values.length},), }`;
  const length = Math.ceil((10 + text.length + 1) / 64) * 64 - 10;
  const raw = new Uint8Array(10 + length + values.byteLength);
  raw.set([0x93, ...[..."NUMPY"].map((c) => c.charCodeAt(0)), 1, 0, length & 255, length >> 8]);
  raw.set(new TextEncoder().encode(`${text.padEnd(length - 1)}\n`), 10);
  raw.set(new Uint8Array(values.buffer, values.byteOffset, values.byteLength), 10 + length);
  return raw;
}

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function crc32(raw) {
  let c = 0xffffffff;
  for (const octet of raw) c = CRC[(c ^ octet) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

const DAY = 33; // 1980-01-01, as numpy writes it

/** An archive without compression. files: [name, octets]. */
function zip(files) {
  const parts = [];
  const entries = [];
  let at = 0;
  const add = (list, words, ...more) => {
    const head = new Uint8Array(words.reduce((sum, [size]) => sum + size, 0));
    const view = new DataView(head.buffer);
    let place = 0;
    for (const [size, value] of words) {
      if (size === 4) view.setUint32(place, value, true);
      else view.setUint16(place, value, true);
      place += size;
    }
    list.push(head, ...more);
    return head.length + more.reduce((sum, one) => sum + one.length, 0);
  };
  for (const [text, raw] of files) {
    const name = new TextEncoder().encode(text);
    const same = [[2, 20], [2, 0x800], [2, 0], [2, 0], [2, DAY], [4, crc32(raw)], [4, raw.length], [4, raw.length],
      [2, name.length], [2, 0]];
    add(entries, [[4, 0x02014b50], [2, 20], ...same, [2, 0], [2, 0], [2, 0], [4, 0], [4, at]], name);
    at += add(parts, [[4, 0x04034b50], ...same], name, raw);
  }
  const size = entries.reduce((sum, one) => sum + one.length, 0);
  add(entries, [[4, 0x06054b50], [2, 0], [2, 0], [2, files.length], [2, files.length], [4, size], [4, at], [2, 0]]);
  const all = new Uint8Array([...parts, ...entries].reduce((sum, one) => sum + one.length, 0));
  let place = 0;
  for (const one of [...parts, ...entries]) {
    all.set(one, place);
    place += one.length;
  }
  return all;
}
