// The way to the drive: the monitor's server, by HTTP. In the page that holds a drive itself,
// web/backend.js stands in this file's place.

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

/** Get what changes: heard(frame) is called with every frame. Returns a function that ends it. */
export function listen(query, heard) {
  const events = new EventSource(`/events?${query}`);
  events.onmessage = (event) => heard(JSON.parse(event.data));
  return () => events.close();
}

/** The thread that analyses spans. */
export const analyst = () => new Worker("analyst.js", { type: "module" });
