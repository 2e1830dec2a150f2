// The commissioning, step by step. The server measures; a user reads here what a step will do, lets
// it begin, and sees what it has found.

import { $, make, order, toast } from "./asking.js";
import { ask } from "./backend.js";
import { parse } from "./numbers.js";
import { NUMBER, breakable, shortest } from "./parameters.js";
import { picture } from "./picture.js";

const PLAN = { what: "action", voltage: "voltage", current: "current", shaft: "the shaft" };
const ENDED = {
  done: "All steps are done", mistakes: "A mistake has to be corrected first", stopped: "Stopped",
  failed: "Ended early",
};
const FIELDS = {
  current: ["limit of all phase currents", "A", "from the parameters"],
  travel: ["the shaft's movement in the tests at standstill", "rev", ""],
  turns: ["turns of the field in the step encoder", "rev", ""],
  speed: ["highest speed of the running drive", "r/min", "from the dc link"],
};

/** What is shown in the place of the plots. */
export const guide = make("div", { className: "guide" });
let device = null;
let course = null; // of the server
let drawn = new Map(); // step -> the text that its card was made of
let begun_ms = 0; // when the step that is measured began
let asked = 0; // number of the latest request
let anew = false; // another one is wanted after the latest

const button = (text, act, properties = {}) => {
  const element = make("button", { type: "button", textContent: text, ...properties });
  element.addEventListener("click", act);
  return element;
};
const active = () => ["asking", "measuring"].includes(course?.state);

/** Make what is shown. stop: sends STOP. */
export function commissioning(the_device, stop) {
  device = the_device;
  const boxes = device.steps.map(({ name, help }) => make("label", {},
    make("input", { type: "checkbox", value: name, checked: true }),
    make("span", { textContent: name }), make("small", { textContent: help })));
  const fields = Object.entries(FIELDS).map(([name, [help, unit, placeholder]]) => make("label", {},
    make("span", {}, make("b", { textContent: name }), " ", make("small", { textContent: help })),
    make("span", { className: "field" },
      make("input", { name, inputMode: "decimal", spellcheck: false, placeholder, value: device.choices[name]?.initial || "" }),
      make("span", { textContent: unit }))));
  const form = make("form", { id: "guide-form", autocomplete: "off" },
    make("p", { textContent: "The commissioning measures wiring, machine and load. The gates switch, and the shaft turns in some steps. "
      + "Before each step the gates are off. The page describes the step, and waits for you." }),
    make("fieldset", {}, make("legend", { textContent: "steps; each adds the steps that it needs" }), ...boxes),
    make("fieldset", { className: "choices" }, make("legend", { textContent: "limits" }), ...fields),
    make("button", { type: "submit", className: "primary", id: "guide-begin", textContent: "Begin" }));
  form.addEventListener("submit", (event) => { event.preventDefault(); begin(form); });
  const stopped = button("Stop", stop, { id: "guide-stop" });
  guide.append(form,
    make("div", { id: "guide-bar" }, make("p", { id: "guide-state", role: "status" }),
      make("span", { id: "guide-time", className: "hint" }), make("progress", { id: "guide-progress" }), stopped),
    make("ol", { id: "guide-steps" }), make("section", { id: "guide-result", tabIndex: -1 }));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { drawn.clear(); show(); });
  show();
}

async function begin(form) {
  const body = { steps: [...form.querySelectorAll(":checked")].map(({ value }) => value) };
  for (const name of Object.keys(FIELDS)) {
    const text = form.elements[name].value;
    if (!text.trim()) continue;
    body[name] = parse(text);
    if (Number.isNaN(body[name])) {
      toast(`${name}: ${NUMBER}`, "bad");
      return;
    }
  }
  if (await order("/commission/begin", body)) anew = false;
}

/** Show what is new. Throws if the monitor does not answer. */
export async function fetchCourse() {
  const before = course;
  const mine = ++asked;
  const found = await ask("/commissioning");
  if (mine !== asked) return; // an answer that is too late
  course = found;
  if (active()) anew = false;
  if (course?.state === "measuring" && before?.state !== "measuring") begun_ms = performance.now();
  show();
  const here = guide.contains(document.activeElement) || document.activeElement === document.body;
  if (!before || !guide.isConnected || (before.state === course.state && before.step === course.step)) return;
  // Not onto the button: a key that is meant to stop the step before would begin this one.
  const next = active() ? $(`step-${course.step}`) : $("guide-result");
  next?.scrollIntoView({ block: "nearest" });
  if (here) next?.focus({ preventScroll: true });
}

/** How long the step takes. Called with every status. */
export function tick() {
  const text = course?.state === "measuring" ? `for ${Math.floor((performance.now() - begun_ms) / 1000)} s` : "";
  const place = guide.querySelector("#guide-time");
  if (place && place.textContent !== text) place.textContent = text;
}

function show() {
  const part = (id) => guide.querySelector(`#${id}`);
  const shown = course && !anew;
  part("guide-form").hidden = shown;
  for (const id of ["guide-bar", "guide-steps"]) part(id).hidden = !shown;
  part("guide-result").hidden = !shown || active();
  if (!shown) return;
  const at = course.steps.findIndex(({ name }) => name === course.step);
  part("guide-state").textContent = active()
    ? `step ${at + 1} of ${course.steps.length}, ${course.step || "reading the parameters"}: `
      + (course.state === "asking" ? "waits for you" : "measuring")
    : ENDED[course.state];
  Object.assign(part("guide-progress"), {
    max: course.steps.length, value: course.state === "done" ? course.steps.length : Math.max(0, at),
  });
  part("guide-stop").hidden = !active();
  const list = part("guide-steps");
  if ([...list.children].map((one) => one.dataset.step).join() !== course.steps.map(({ name }) => name).join()) {
    drawn.clear();
    list.replaceChildren(...course.steps.map(({ name }) => {
      const card = make("li", { id: `step-${name}`, className: "step", tabIndex: -1 });
      card.dataset.step = name;
      return card;
    }));
  }
  course.steps.forEach((step, i) => {
    const text = JSON.stringify([step, step.name === course.step && course.state]);
    if (drawn.get(step.name) === text) return;
    drawn.set(step.name, text);
    card(list.children[i], step, device.steps.find(({ name }) => name === step.name).help);
  });
  if (!active()) result(part("guide-result"));
}

function card(box, step, help) {
  const mine = step.name === course.step;
  const state = mine ? { asking: "next", measuring: "measuring" }[course.state] ?? "ended here" : "";
  const word = step.pictures?.length ? "done" : state;
  box.dataset.word = word;
  const parts = [make("h3", {}, step.name, make("small", { textContent: help }), make("em", { textContent: word }))];
  if (step.plan && word !== "done") {
    parts.push(make("dl", {}, ...Object.entries(PLAN).flatMap(([key, title]) =>
      [make("dt", { textContent: title }), make("dd", { textContent: step.plan[key] })])));
  }
  const go = (run_on) => () => order("/commission/go", { step: step.name, run_on });
  if (word === "next") {
    parts.push(make("div", { className: "row" },
      button(`Start ${step.name}`, go(false), { className: "primary", id: "guide-go" }),
      button("Run on without asking", go(true), { title: "this step and all that follow it" })));
  }
  const words = make("div", {}, ...(step.lines ?? []).map((textContent) => make("p", { textContent })), table(step.values));
  parts.push(make("div", { className: "found" }, words, ...(step.pictures ?? []).map(picture)));
  box.replaceChildren(...parts);
}

/** What was measured beside what was in force before. */
function table(rows) {
  if (!rows?.length) return "";
  const round = (value, digits) => shortest(Number(value.toPrecision(digits)));
  const head = ["parameter", "measured", "±", "in use"].map((textContent) => make("th", { scope: "col", textContent }));
  return make("table", {}, make("thead", {}, make("tr", {}, ...head)),
    make("tbody", {}, ...rows.map(({ name, unit, value, uncertainty, before }) => make("tr", {},
      make("th", { scope: "row" }, ...breakable(name), " ", make("small", { textContent: unit })),
      make("td", {}, make("b", { textContent: round(value, 4) })),
      make("td", { textContent: round(uncertainty, 2) }), make("td", { textContent: round(before, 4) })))));
}

function result(box) {
  const { values, problems, written, setup } = course;
  const row = make("div", { className: "row" });
  if (values.length) {
    row.append(button(written ? "Written" : `Write ${values.length} values to the board`, async () => {
      if (await order("/commission/write")) toast("written; Keep, among the parameters, saves them over a power-off");
    }, { className: "primary", id: "guide-write", disabled: written }));
  }
  if (setup) {
    row.append(make("a", { className: "button", id: "guide-save", href: "commissioned.toml", download: "", textContent: "Save the set-up" }));
  }
  row.append(button("Commission again", () => { anew = true; show(); $("guide-begin").focus(); }, { id: "guide-again" }));
  box.replaceChildren(make("h3", { textContent: ENDED[course.state] }),
    ...problems.map((textContent) => make("p", { className: "error", textContent })), table(values), row);
}
