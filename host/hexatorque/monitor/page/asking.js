// Requests to the monitor, short messages, and elements of the page.

export const $ = (id) => document.getElementById(id);

export async function ask(path, body) {
  const options = body === undefined ? {} : {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  };
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Error("the monitor does not answer");
  }
  const data = await answer.json();
  if (!answer.ok) throw new Error(data.error || answer.statusText);
  return data;
}

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
