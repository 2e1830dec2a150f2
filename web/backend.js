// The way to the drive, as the monitor's backend.js has it: here a thread of the page holds the drive.

import { decode } from "./numbers.js";
const { held } = globalThis; // by name: what unpack.js has unpacked
const tables = JSON.parse(new TextDecoder().decode(held.tables));
// Columns are packed smaller than rows, each of which names them.
const columns = Object.entries(tables.device.parameters);
tables.device.parameters = columns[0][1].map((_, n) => Object.fromEntries(columns.map(([key, of]) => [key, of[n]])));
const thread = (name) => new Worker(URL.createObjectURL(new Blob([held[name]], { type: "text/javascript" })));

/** What a set-up's drive has kept. A browser may refuse to remember anything. */
const memory = {
  key: (setup) => `hexatorque ${tables.version} ${setup}`,
  get(setup) {
    try {
      const text = localStorage.getItem(this.key(setup));
      return text && Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    } catch {
      return null;
    }
  },
  put(setup, octets) {
    localStorage.setItem(this.key(setup), btoa(String.fromCharCode(...octets)));
  },
};

const setup = decodeURIComponent(location.hash.slice(1));
const waiting = new Map(); // number of a request -> what to do with its answer
let asked = 0;
let heard = () => {};
const begun = begin();

async function begin() {
  const module = await WebAssembly.compile(held.wasm);
  const worker = thread("worker");
  worker.onmessage = ({ data: { id, answer, error, frame, files, kept } }) => {
    if (frame) heard(frame);
    if (files) files.forEach(save);
    if (kept) memory.put(setup || tables.setups[0].name, kept);
    if (id === undefined) return;
    const { done, failed } = waiting.get(id);
    waiting.delete(id);
    if (error) failed(new Error(error));
    else done(answer);
  };
  worker.postMessage({ begin: {
    module, tables, bytes: held.setups.slice(), setup,
    kept: memory.get(setup || tables.setups[0].name),
  } });
  return worker;
}

function save({ name, text, octets }) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text ?? octets]));
  link.download = name;
  link.dataset.made = "true";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// Links to files that a server would make.
document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[download]");
  if (!link || link.dataset.made) return;
  event.preventDefault();
  const { pathname, search } = new URL(link.href);
  ask(`/${pathname.split("/").pop()}${search}`).catch((error) => { document.title = error.message; });
});

export async function ask(path, body) {
  const worker = await begun.catch(() => {
    throw new Error("this browser cannot hold the drive: it needs WebAssembly and worker threads");
  });
  const id = ++asked;
  const answer = await new Promise((done, failed) => {
    waiting.set(id, { done, failed });
    worker.postMessage({ id, path, body });
  });
  return "found" in answer ? answer.found : answer;
}

/** For scripts in the browser's console. */
globalThis.hexatorque = { ask };

export function listen(query, hear) {
  heard = hear;
  ask("/listen", Object.fromEntries(new URLSearchParams(query)));
  return () => { heard = () => {}; };
}

/** The thread that analyses spans. It gets the samples from here: it has no server to ask. */
export function analyst() {
  const worker = thread("analyst");
  return {
    set onmessage(come) { worker.onmessage = come; },
    async postMessage({ span, ...question }) {
      let { samples } = question;
      if (span) {
        try {
          samples = await part(span);
        } catch (error) {
          samples = { count: 0 };
        }
      }
      worker.postMessage({ ...question, samples });
    },
  };
}

async function part({ begin_s, end_s, names }) {
  const found = await ask(`/span?begin_s=${Math.max(0, begin_s)}&end_s=${Math.max(0, end_s)}`);
  const all = decode(found.lo);
  const columns = Object.fromEntries(
    names.map((name, i) => [name, all.subarray(i * found.count, (i + 1) * found.count)]));
  return { rate_Hz: 1 / found.dt_s, count: found.count, columns };
}
