// What only a page has that holds its drive itself: the set-up, the load, windings to open.

import { $, make, order, toast } from "./asking.js";
import { NUMBER } from "./parameters.js";
import { parse } from "./numbers.js";

/** plant: {setup, setups, phases, load_Nm, open}. */
export function plant({ setup, setups, phases, load_Nm, open }) {
  const box = (words, ...fields) => make("div", { className: "quick" },
    make("label", {}, make("span", { textContent: words }), ...fields));
  const choice = make("select", { id: "plant-setup", title: "another set-up begins anew" },
    ...setups.map(({ name }) => new Option(name, name, false, name === setup)));
  choice.addEventListener("change", () => {
    location.hash = choice.value;
    location.reload();
  });
  const load = make("input", { id: "plant-load", inputMode: "decimal", spellcheck: false, value: load_Nm });
  load.addEventListener("change", () => {
    const torque_Nm = parse(load.value);
    if (Number.isNaN(torque_Nm)) toast(`load: ${NUMBER}`, "bad");
    else order("/plant", { load_Nm: torque_Nm });
  });
  const windings = phases.map((phase) => {
    const input = make("input", { type: "checkbox", value: phase, checked: open.includes(phase) });
    input.addEventListener("change", () => order("/plant", { open: { [phase]: input.checked } }));
    return make("label", {}, input, make("span", { textContent: phase }));
  });
  const { title } = setups.find(({ name }) => name === setup);
  $("quick").before(box("set-up", choice), make("p", { className: "hint", textContent: title }));
  $("quick").after(
    box("load", make("span", { className: "field" }, load, make("span", { textContent: "N m" }))),
    make("fieldset", { id: "plant-open" }, make("legend", { textContent: "open windings" }), ...windings));
}
