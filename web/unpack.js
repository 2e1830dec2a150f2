// The page's first script: it unpacks all others, what they need too, and runs them.

import { data } from "./data.js";

unpack().catch(() => {
  const alarm = document.getElementById("alarm");
  alarm.textContent = "this browser cannot unpack the page: it needs DecompressionStream";
  alarm.hidden = false;
});

async function unpack() {
  const packed = Uint8Array.from(atob(data.packed), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const raw = await new Response(stream).arrayBuffer();
  const held = {};
  let at = 0;
  for (const [name, size] of Object.entries(data.sizes)) {
    held[name] = new Uint8Array(raw, at, size);
    at += size;
  }
  globalThis.held = held;
  for (const name of data.scripts) {
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(held[name]);
    document.body.append(script);
  }
}
