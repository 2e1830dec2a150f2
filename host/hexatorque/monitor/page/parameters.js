// The parameters of the board, in groups. What is typed waits until it is applied.

import { $, make, order } from "./asking.js";
import { ask } from "./backend.js";
import { parse } from "./numbers.js";

export const NUMBER = "a number is needed, such as 250.5 or 250,5; no thousands separators";
/** Parameter -> the value in force. */
export const values = {};
const rows = new Map(); // parameter -> {row, input, box, error, standard}
const groups = []; // {box, count, members, wanted}
const edits = new Map(); // parameter -> text that was typed and not applied
let whenShown = () => {};

// -- one parameter -----------------------------------------------------------------------

export function editor(row) {
  let input;
  if (row.choices.length) {
    input = make("select", {}, ...row.choices.map((choice) => new Option(choice, choice)));
  } else {
    input = make("input", { type: "text", inputMode: "decimal", spellcheck: false });
  }
  input.setAttribute("aria-label", row.name);
  return input;
}

const range = (row) => `${shortest(row.min)} … ${shortest(row.max)}`;
export const shortest = (value) => String(value).replace("-", "−");

/** The mistake in a text for a parameter, or "". */
export function mistake(row, text) {
  if (row.choices.length) return "";
  const value = parse(text);
  if (!Number.isFinite(value)) return NUMBER;
  if (value >= row.min && value <= row.max && (!row.whole || Number.isInteger(value))) return "";
  const whole = row.whole ? ", whole numbers only" : "";
  return `allowed: ${range(row)}${row.unit ? ` ${row.unit}` : ""}${whole}`;
}

export const asValue = (row, text) => (row.choices.length ? text : parse(text));
export const asText = (value) => (value === undefined || value === null ? "" : String(value));

/** Whether two values are the same on the board, which keeps numbers as float32. */
const same = (row, a, b) => (row.choices.length ? a === b : Math.fround(a) === Math.fround(b));

/** A parameter's default, from the board's own table. */
const defaultOf = (row) => (row.choices.length ? row.choices[row.initial] : row.initial);

function differs(row) {
  const value = values[row.name];
  return value !== undefined && value !== null && !same(row, value, defaultOf(row));
}

// -- the list ----------------------------------------------------------------------------

/** Make the list. `shown` is called whenever the values in force have been shown. */
export function parameters(device, shown) {
  whenShown = shown;
  const byName = new Map(device.parameters.map((row) => [row.name, row]));
  for (const { title, names } of device.groups) {
    const count = make("small");
    const box = make("details", { className: "group" },
      make("summary", {}, make("span", { textContent: title }), count),
      ...names.map((name) => entry(byName.get(name), title)));
    const group = { box, count, members: names, wanted: false };
    box.addEventListener("toggle", () => {
      if (!searching()) group.wanted = box.open;
      tellOpen();
    });
    groups.push(group);
    $("parameters").append(box);
  }
  groups[0].wanted = true;
  $("parameters").append(make("p", {
    id: "none-found", className: "hint", hidden: true, textContent: "No parameter is found.",
  }));
  $("search").addEventListener("input", search);
  $("only-changed").addEventListener("change", search);
  $("open-groups").addEventListener("click", () => {
    const open = !allOpen();
    for (const { box } of groups) box.open = open;
  });
  $("revert").addEventListener("click", () => { edits.clear(); showValues(); pending(); });
  $("apply-all").addEventListener("click", apply);
  search();
}

/** A name that a narrow page breaks behind an underline only. */
export function breakable(name) {
  const parts = name.split(/(?<=_)/);
  return parts.flatMap((part, i) => (i ? [make("wbr"), part] : [part]));
}

function entry(row, group) {
  const input = editor(row);
  const error = make("p", { className: "error", hidden: true });
  const standard = make("span", {
    textContent: `default ${row.choices.length ? defaultOf(row) : shortest(row.initial)}`,
  });
  const limits = make("p", { className: "limits" }, ...(row.choices.length ? [] : [`${range(row)} · `]), standard);
  const box = make("div", { className: "parameter" },
    make("label", {},
      make("span", { className: "name" }, ...breakable(row.name)),
      make("span", { className: "field" }, input, make("span", { textContent: row.unit }))),
    make("p", { className: "hint" }, row.help),
    limits, error);
  if (!row.live) box.classList.add("idle-only");
  box.dataset.text = [row.name, row.unit, row.help, ...row.choices, group].join(" ").toLowerCase();
  input.addEventListener("input", () => {
    if (input.value === asText(values[row.name])) edits.delete(row.name);
    else edits.set(row.name, input.value);
    mark(row.name);
    pending();
  });
  input.addEventListener("keydown", (event) => { if (event.key === "Enter") apply(); });
  rows.set(row.name, { row, input, box, error, standard });
  return box;
}

const searching = () => $("search").value.trim() !== "" || $("only-changed").checked;
const allOpen = () => groups.every(({ box }) => box.open || box.hidden);

function tellOpen() {
  $("open-groups").textContent = allOpen() ? "Close all" : "Open all";
}

/** Show what is looked for. Groups that have some of it are open; without a search those are that
 * the user has opened. */
function search() {
  const words = $("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  let found = 0;
  for (const group of groups) {
    let here = 0;
    for (const name of group.members) {
      const { row, box } = rows.get(name);
      const wanted = !$("only-changed").checked || differs(row) || edits.has(name);
      box.hidden = !wanted || !words.every((word) => box.dataset.text.includes(word));
      here += !box.hidden;
    }
    group.box.hidden = !here;
    group.box.open = searching() ? here > 0 : group.wanted;
    found += here;
  }
  $("none-found").hidden = found > 0;
  tellOpen();
}

function mark(name) {
  const { row, input, box, error } = rows.get(name);
  const text = edits.get(name);
  const wrong = text === undefined ? "" : mistake(row, text);
  box.classList.toggle("edited", text !== undefined);
  input.setAttribute("aria-invalid", String(Boolean(wrong)));
  error.hidden = !wrong;
  error.textContent = wrong;
}

function countGroups() {
  for (const { count, members } of groups) {
    const changed = members.filter((name) => differs(rows.get(name).row)).length;
    const edited = members.filter((name) => edits.has(name)).length;
    const words = [`${members.length}`];
    if (changed) words.push(`${changed} changed`);
    if (edited) words.push(`${edited} not applied`);
    const text = words.join(" · ");
    if (count.textContent !== text) count.textContent = text;
  }
}

function pending() {
  const bad = [...edits].find(([name, text]) => mistake(rows.get(name).row, text));
  $("apply").hidden = edits.size === 0;
  $("apply-all").disabled = Boolean(bad);
  const count = edits.size === 1 ? "1 change" : `${edits.size} changes, all at once`;
  $("apply-text").textContent = bad ? `${bad[0]}: ${mistake(rows.get(bad[0]).row, bad[1])}` : count;
  $("apply-text").classList.toggle("error", Boolean(bad));
  countGroups();
}

/** Fill the fields. Nothing is sent before the user applies it. Returns how many values differ from
 * those in force. */
export function fill(wanted) {
  let differing = 0;
  for (const [name, value] of Object.entries(wanted)) {
    const { row, input } = rows.get(name);
    if (same(row, value, values[name])) edits.delete(name);
    else {
      edits.set(name, asText(value));
      input.value = asText(value);
      differing += 1;
    }
  }
  showValues();
  pending();
  for (const { box, members } of groups) {
    if (members.some((name) => edits.has(name))) box.open = true;
  }
  const [first] = edits.keys();
  if (first) rows.get(first).box.scrollIntoView({ block: "center" });
  return differing;
}

// -- the board ---------------------------------------------------------------------------

async function apply() {
  if (!edits.size || $("apply-all").disabled) return;
  const wanted = [...edits].map(([name, text]) => [name, asValue(rows.get(name).row, text)]);
  await write(Object.fromEntries(wanted));
}

/** Write parameters, and show the values that are then in force. */
export async function write(wanted) {
  const answer = await order("/write", { values: wanted });
  if (!answer) return false;
  Object.assign(values, answer.values);
  for (const name of Object.keys(wanted)) {
    edits.delete(name);
    const { box } = rows.get(name);
    box.classList.remove("taken");
    void box.offsetWidth; // restarts the animation
    box.classList.add("taken");
  }
  showValues();
  pending();
  return true;
}

/** Read the values that are in force. Throws if the monitor does not answer. */
export async function fetchValues() {
  Object.assign(values, await ask("/values"));
  showValues();
  pending();
}

function showValues() {
  let changed = 0;
  for (const [name, { row, input, box, standard }] of rows) {
    if (!edits.has(name)) input.value = asText(values[name]);
    mark(name);
    box.classList.toggle("changed", differs(row));
    standard.classList.toggle("default", differs(row));
    changed += differs(row);
  }
  $("changed-count").textContent = `(${changed})`;
  if (searching()) search(); // else it would undo a click whose toggle event is still to come
  whenShown();
}

/** Lock the parameters that can change only while the gates are off. `on`: they are on. */
export function lockParameters(on) {
  for (const { row, input, box } of rows.values()) {
    input.disabled = on && !row.live;
    box.classList.toggle("locked", on && !row.live);
  }
}
