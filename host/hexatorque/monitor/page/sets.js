// Sets of parameters: files on this computer, comparisons, the board's own memory.

import { $, make, order, toast } from "./asking.js";
import { ask } from "./backend.js";
import { breakable, fill, shortest } from "./parameters.js";

/** Largest file that is read. One of all parameters has a tenth of it. */
const BYTES = 50000;

/** Make the buttons. The hidden input opens the browser's choice of a file. here: the page holds the
 * drive itself, and reads no file. */
export function sets(here) {
  const input = make("input", { type: "file", accept: ".toml", hidden: true, id: "set-file" });
  let use = load;
  input.addEventListener("change", async () => {
    const [file] = input.files;
    input.value = ""; // the same file may be chosen again
    if (file) await attempt(() => use(file));
  });
  const choose = (what) => () => { use = what; input.click(); };
  const button = (id, text, title, act) => {
    const element = make("button", { type: "button", id, textContent: text, title });
    element.addEventListener("click", act);
    return element;
  };
  const row = (title, ...buttons) => make("div", { className: "set" },
    make("span", { className: "hint", textContent: title }), make("span", {}, ...buttons));
  const save = make("a", {
    className: "button", id: "set-save", href: "parameters.toml", textContent: "Save", download: "",
    title: "all parameters that are in force, as hexatorque board params save",
  });
  $("sets").append(
    row("File", save,
      button("set-load", "Load …", "fills the fields; nothing is sent before Apply", choose(load))),
    row("Compare with",
      button("set-compare", "File …", "differences between a file and the parameters in force", choose(compare)),
      button("set-defaults", "Defaults", "differences from the board's built-in values",
        () => attempt(() => compare(null)))),
    row("Board's memory",
      button("set-keep", "Keep", "the board starts with these parameters from now on; gates off only",
        () => memory("/parameters/keep", "kept: the board starts with these parameters from now on")),
      button("set-forget", "Forget", "the board starts with its built-in parameters from now on; gates off only",
        () => memory("/parameters/forget", "forgotten: the board starts with its built-in parameters from now on"))),
    input, make("div", { id: "set-wrong", role: "alert", hidden: true }));
  if (here) for (const id of ["set-load", "set-compare"]) $(id).remove();
}

/** Do something with a file, and show what is wrong with it. */
async function attempt(act) {
  $("set-wrong").hidden = true;
  try {
    await act();
  } catch (error) {
    $("set-wrong").replaceChildren(...error.message.split("\n").map((line) => make("p", { textContent: line })));
    $("set-wrong").hidden = false;
  }
}

async function textOf(file) {
  if (file.size > BYTES) throw new Error(`${file.name}: ${file.size} bytes; allowed are up to ${BYTES}`);
  return { file: file.name, text: await file.text() };
}

async function load(file) {
  const { values } = await ask("/parameters/read", await textOf(file));
  const differing = fill(values);
  const count = Object.keys(values).length;
  toast(`${file.name}: ${count} parameters, ${differing || "none"} to apply`);
}

/** Show what differs from a file; null: from the defaults. */
async function compare(file) {
  const answer = await ask("/parameters/difference", file ? await textOf(file) : {});
  const other = file ? file.name : "defaults";
  const close = make("button", { type: "button", textContent: "Close", id: "comparison-close" });
  close.addEventListener("click", () => { $("comparison").hidden = true; $("parameters").hidden = false; });
  const cell = (value) => make("td", {
    textContent: typeof value === "number" ? shortest(Number(value.toPrecision(7))) : value ?? "–",
  });
  const rows = answer.differing.map(({ name, board, other: there, unit }) => make("tr", {},
    make("th", { scope: "row" }, ...breakable(name), " ", make("small", { textContent: unit })),
    cell(board), cell(there)));
  const head = ["parameter", "board", other].map((textContent) =>
    make("th", { scope: "col", textContent, title: textContent }));
  const count = rows.length === 1 ? "1 differs" : `${rows.length || "none"} differ`;
  $("comparison").replaceChildren(
    make("div", { className: "head" },
      make("p", { role: "status", textContent: `${answer.compared} parameters compared, ${count}` }), close),
    ...(rows.length ? [make("table", {}, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows))] : []));
  $("comparison").hidden = false;
  $("parameters").hidden = true;
  close.focus();
}

async function memory(path, done) {
  if (await order(path)) toast(done);
}
