"use strict";
// What both pages begin with: errors are marked, the content is read, arrays are unpacked.
window.addEventListener("error", (event) => { document.body.dataset.error = event.message; });
window.mcstudy = {
  byId: (name) => document.getElementById(name),
  content: JSON.parse(document.getElementById("content").textContent),
  bytes(text) {
    const raw = atob(text), found = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) found[k] = raw.charCodeAt(k);
    return found.buffer;
  },
};
