// Requests whose refusal is shown, short messages, and elements of the page.

import { ask } from "./backend.js";

export const $ = (id) => document.getElementById(id);

/** Send a request and show a refusal. Returns the answer, or null. */
export async function order(path, body = {}) {
  try {
    return await ask(path, body);
  } catch (error) {
    toast(error.message, "bad");
    return null;
  }
}

export function toast(text, kind = "") {
  const line = document.createElement("p");
  line.className = kind;
  line.textContent = text;
  $("toasts").append(line);
  setTimeout(() => line.remove(), kind === "bad" ? 8000 : 3500);
}

export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}
