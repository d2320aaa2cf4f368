"use strict";
// What all pages begin with: errors are marked, the content is read, its arrays are unpacked.
window.addEventListener("error", (event) => { document.body.dataset.error = event.message; });
window.addEventListener("unhandledrejection", (event) => { document.body.dataset.error = String(event.reason); });
window.mcstudy = {
  byId: (name) => document.getElementById(name),
  async inflate(text) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  },
  KINDS: { f4: Float32Array, i4: Int32Array, i2: Int16Array, u4: Uint32Array, u1: Uint8Array },
  array(bytes, { at, count, kind, width, step }) {
    const values = new window.mcstudy.KINDS[kind](count), size = values.BYTES_PER_ELEMENT;
    const own = new Uint8Array(values.buffer);
    for (let b = 0; b < size; b++) for (let k = 0; k < count; k++) own[size * k + b] = bytes[at + b * count + k];
    if (!step) return values;
    for (let k = width; k < count; k++) values[k] += values[k - width];
    const least = size === 2 ? -32768 : -2147483648, found = new Float32Array(count);
    for (let k = 0; k < count; k++) found[k] = values[k] === least ? NaN : step * values[k];
    return found;
  },
  // Replaces the places of arrays in a part of the content by the arrays.
  async unpack(part) {
    const bytes = await window.mcstudy.inflate(part.data);
    delete part.data;
    const walk = (node) => {
      for (const [key, value] of Object.entries(node)) {
        if (value === null || typeof value !== "object") continue;
        if ("at" in value && "kind" in value) node[key] = window.mcstudy.array(bytes, value);
        else walk(value);
      }
    };
    walk(part);
    return part;
  },
  async start(program) {
    if (typeof DecompressionStream === "undefined") {
      document.body.prepend("This page needs a browser of 2023 or newer.");
      return;
    }
    await program(JSON.parse(document.getElementById("content").textContent));
    document.body.dataset.ready = "1";
  },
};
