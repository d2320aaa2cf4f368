"use strict";
window.mcstudy.start(async (content) => {
  const { byId, inflate, unpack } = window.mcstudy;
  await unpack(content.table);
  const { columns, runs, states } = content.table;
  const stored = new Map(content.stored.map((entry) => [entry.run, entry]));

  for (const column of columns) {
    let low = Infinity, high = -Infinity;
    for (const v of column.values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(low <= high)) { low = 0; high = 1; }
    if (low === high) { low -= 0.5; high += 0.5; }
    Object.assign(column, { low, high, brush: null });
  }
  const count = runs.length;
  const chosen = new Uint8Array(count);
  const order = Uint32Array.from({ length: count }, (_, k) => k);
  // A fixed shuffle: where lines are thinned, they are thinned at random.
  let seed = 1;
  for (let k = count - 1; k > 0; k--) {
    seed = (1103515245 * seed + 12345) % 2147483648;
    const j = seed % (k + 1), kept = order[k];
    order[k] = order[j]; order[j] = kept;
  }
  const MOST_LINES = 1500, MOST_AXES = 7, NARROW = 600, FEW_AXES = 3;
  const shown = () => columns.filter((column) => column.shown);
  if (window.innerWidth < NARROW) shown().slice(FEW_AXES).forEach((column) => { column.shown = false; });
  let picked = -1, wanted = true, drag = null;

  function choose() {
    let total = 0;
    const brushed = columns.filter((column) => column.brush);
    for (let k = 0; k < count; k++) {
      let inside = content.statuses[states[k]].on ? 1 : 0;
      for (const column of brushed) {
        const v = column.values[k];
        if (!(v >= column.brush[0] && v <= column.brush[1])) { inside = 0; break; }
      }
      chosen[k] = inside; total += inside;
    }
    byId("count").textContent = `${total.toLocaleString("en")} of ${count.toLocaleString("en")} runs`;
    document.body.dataset.chosen = String(total);
    wanted = true;
  }

  function prepare(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return [pen, width, height];
  }
  const style = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const inks = () => dark.matches
    ? { on: "#56b4e9", rgb: [86, 180, 233], off: "rgba(200,210,218,0.13)", mark: "#ff9d5c" }
    : { on: "#0072b2", rgb: [0, 114, 178], off: "rgba(90,100,108,0.13)", mark: "#d55e00" };
  function short(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    return size >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(value.toPrecision(3)));
  }
  // An end of an axis, to a hundredth of its length.
  function end(column, value) {
    const places = Math.max(0, 2 - Math.floor(Math.log10(column.high - column.low)));
    return value.toLocaleString("en", { maximumFractionDigits: Math.min(places, 20) });
  }
  // A label in one line or, where there is no room, in two.
  function write(pen, label, x, y, room) {
    const words = label.split(" ");
    if (pen.measureText(label).width <= room || words.length < 2) { pen.fillText(label, x, y, room); return; }
    let best = 1, least = Infinity;
    for (let k = 1; k < words.length; k++) {
      const wide = Math.max(...[words.slice(0, k), words.slice(k)].map((part) => pen.measureText(part.join(" ")).width));
      if (wide < least) { least = wide; best = k; }
    }
    pen.fillText(words.slice(0, best).join(" "), x, y - 6, room);
    pen.fillText(words.slice(best).join(" "), x, y + 7, room);
  }

  // -- parallel coordinates ----------------------------------------------------------------------
  const TOP = 46, BOTTOM = 26, SIDE = 62;
  function axisPlaces(width) {
    const list = shown();
    return list.map((column, k) => ({ column, x: list.length > 1 ? SIDE + (width - 2 * SIDE) * k / (list.length - 1) : width / 2 }));
  }
  function drawParallel() {
    const [pen, width, height] = prepare(byId("parallel")), places = axisPlaces(width), ink = inks();
    const y = (column, v) => height - BOTTOM - (height - TOP - BOTTOM) * (v - column.low) / (column.high - column.low);
    const line = (k) => {
      let open = false;
      for (const { column, x } of places) {
        const v = column.values[k];
        if (!Number.isFinite(v)) { open = false; continue; }
        if (open) pen.lineTo(x, y(column, v)); else pen.moveTo(x, y(column, v));
        open = true;
      }
    };
    let total = 0;
    for (let k = 0; k < count; k++) total += chosen[k];
    // A stroke a line: one path of thousands of crossing lines takes browsers minutes.
    for (const on of [0, 1]) {
      pen.strokeStyle = on ? ink.on : ink.off;
      pen.globalAlpha = on ? Math.max(0.08, Math.min(0.6, 60 / Math.max(Math.min(total, MOST_LINES), 1))) : 1;
      pen.lineWidth = 1;
      let drawn = 0;
      for (const k of order) {
        if (chosen[k] !== on) continue;
        pen.beginPath(); line(k); pen.stroke();
        if (++drawn >= MOST_LINES) break;
      }
    }
    pen.globalAlpha = 1;
    if (picked >= 0) { pen.beginPath(); line(picked); pen.strokeStyle = ink.mark; pen.lineWidth = 2.5; pen.stroke(); }
    pen.font = "12px system-ui, sans-serif"; pen.textAlign = "center";
    const gap = places.length > 1 ? places[1].x - places[0].x : width, room = Math.max(2 * gap - 70, 60);
    for (const [k, { column, x }] of places.entries()) {
      pen.strokeStyle = style("--ink"); pen.lineWidth = 1;
      pen.beginPath(); pen.moveTo(x, TOP); pen.lineTo(x, height - BOTTOM); pen.stroke();
      pen.fillStyle = style("--ink"); pen.textBaseline = "alphabetic";
      const last = k > 0 && k === places.length - 1;
      pen.textAlign = k === 0 ? "left" : last ? "right" : "center";
      pen.fillText(column.label, k === 0 ? 4 : last ? width - 4 : x, k % 2 ? 30 : 14, room);
      pen.textAlign = "center";
      pen.fillStyle = style("--soft");
      pen.fillText(end(column, column.high), x, TOP - 3);
      pen.textBaseline = "top"; pen.fillText(end(column, column.low), x, height - BOTTOM + 4);
      if (column.brush) {
        const a = y(column, column.brush[1]), b = y(column, column.brush[0]);
        pen.fillStyle = ink.mark; pen.globalAlpha = 0.35; pen.fillRect(x - 8, a, 16, Math.max(b - a, 2)); pen.globalAlpha = 1;
      }
    }
  }

  // -- scatter matrix ----------------------------------------------------------------------------
  const EDGE = 54;
  function cells(width, height) {
    const list = shown(), size = (Math.min(width, height) - EDGE) / Math.max(list.length, 1), found = [];
    list.forEach((row, i) => list.forEach((column, j) => {
      if (j <= i) found.push({ row, column, i, j, x: EDGE + j * size, y: i * size, size: size - 6 });
    }));
    return found;
  }
  function drawMatrix() {
    const [pen, width, height] = prepare(byId("matrix")), ink = inks(), list = cells(width, height);
    pen.font = "12px system-ui, sans-serif";
    drawPoints(pen, list, ink);
    for (const cell of list) {
      pen.strokeStyle = style("--line"); pen.lineWidth = 1; pen.strokeRect(cell.x, cell.y, cell.size, cell.size);
      if (cell.i === cell.j) { drawBars(pen, cell, ink); continue; }
      if (picked >= 0) {
        const [x, y] = placeIn(cell, picked);
        pen.fillStyle = ink.mark; pen.beginPath(); pen.arc(x, y, 5, 0, 7); pen.fill();
      }
    }
    const rows = shown(), size = rows.length ? list[0].size + 6 : 0;
    pen.fillStyle = style("--ink"); pen.textAlign = "center"; pen.textBaseline = "middle";
    rows.forEach((column, k) => {
      pen.save(); pen.translate(14, k * size + size / 2); pen.rotate(-Math.PI / 2); write(pen, column.label, 0, 0, size - 8); pen.restore();
      write(pen, column.label, EDGE + k * size + size / 2, rows.length * size + 12, size - 8);
      pen.save(); pen.fillStyle = style("--soft"); pen.textAlign = "right";
      pen.fillText(end(column, column.high), EDGE - 4, k * size + 8, EDGE - 30); pen.fillText(end(column, column.low), EDGE - 4, (k + 1) * size - 14, EDGE - 30);
      pen.restore();
      if (size < 80) return;
      pen.save(); pen.fillStyle = style("--soft"); pen.textAlign = "left"; pen.fillText(end(column, column.low), EDGE + k * size, rows.length * size + 34);
      pen.textAlign = "right"; pen.fillText(end(column, column.high), EDGE + (k + 1) * size - 8, rows.length * size + 34); pen.restore();
    });
    if (drag && drag.canvas === "matrix" && drag.moved) {
      pen.strokeStyle = ink.mark; pen.lineWidth = 1.5;
      pen.strokeRect(Math.min(drag.x, drag.x2), Math.min(drag.y, drag.y2), Math.abs(drag.x2 - drag.x), Math.abs(drag.y2 - drag.y));
    }
  }
  function placeIn(cell, k) {
    return [cell.x + cell.size * (cell.column.values[k] - cell.column.low) / (cell.column.high - cell.column.low),
      cell.y + cell.size - cell.size * (cell.row.values[k] - cell.row.low) / (cell.row.high - cell.row.low)];
  }
  // Hundreds of thousands of points are blended into one picture, as drawing calls take seconds.
  function drawPoints(pen, list, ink) {
    const canvas = pen.canvas, ratio = window.devicePixelRatio || 1;
    const picture = pen.createImageData(canvas.width, canvas.height), pixels = picture.data;
    const dot = Math.max(Math.round(1.6 * ratio), 1);
    for (const on of [0, 1]) {
      const [red, green, blue] = on ? ink.rgb : [110, 120, 128];
      const share = on ? (count > 4000 ? 0.35 : 0.6) : 0.14;
      for (const cell of list) {
        if (cell.i === cell.j) continue;
        const sx = ratio * cell.size / (cell.column.high - cell.column.low), sy = ratio * cell.size / (cell.row.high - cell.row.low);
        const left = ratio * cell.x - cell.column.low * sx, floor = ratio * (cell.y + cell.size) + cell.row.low * sy;
        const u = cell.column.values, v = cell.row.values;
        for (let k = 0; k < count; k++) {
          if (chosen[k] !== on) continue;
          const x = Math.round(left + u[k] * sx), y = Math.round(floor - v[k] * sy);
          if (!(x >= 0 && y >= 0 && x + dot <= canvas.width && y + dot <= canvas.height)) continue;
          for (let i = 0; i < dot; i++) for (let j = 0; j < dot; j++) {
            const at = 4 * ((y + i) * canvas.width + x + j), below = pixels[at + 3] / 255;
            const whole = share + below * (1 - share), own = share / whole;
            pixels[at] += own * (red - pixels[at]);
            pixels[at + 1] += own * (green - pixels[at + 1]);
            pixels[at + 2] += own * (blue - pixels[at + 2]);
            pixels[at + 3] = 255 * whole;
          }
        }
      }
    }
    pen.putImageData(picture, 0, 0);
  }
  function drawBars(pen, cell, ink) {
    const BINS = 30, all = new Float64Array(BINS), on = new Float64Array(BINS), c = cell.column;
    for (let k = 0; k < count; k++) {
      const v = c.values[k];
      if (!Number.isFinite(v)) continue;
      const bin = Math.min(BINS - 1, Math.floor(BINS * (v - c.low) / (c.high - c.low)));
      all[bin]++; on[bin] += chosen[k];
    }
    const most = Math.max(...all, 1), width = cell.size / BINS;
    for (const [heights, colour] of [[all, style("--line")], [on, ink.on]]) {
      pen.fillStyle = colour;
      for (let b = 0; b < BINS; b++) {
        const tall = 0.92 * cell.size * heights[b] / most;
        pen.fillRect(cell.x + b * width, cell.y + cell.size - tall, Math.max(width - 1, 1), tall);
      }
    }
  }

  // -- what people do ----------------------------------------------------------------------------
  function pick(row) {
    picked = row; wanted = true;
    const box = byId("picked");
    box.replaceChildren();
    document.body.dataset.picked = row < 0 ? "" : String(runs[row]);
    if (row < 0) return;
    byId("run").value = runs[row];
    const head = document.createElement("h2");
    head.textContent = `Run ${runs[row]}: ${content.statuses[states[row]].name}`;
    const table = document.createElement("table");
    for (const column of columns) {
      const line = table.insertRow();
      line.insertCell().textContent = column.label;
      line.insertCell().textContent = short(column.values[row]);
    }
    box.append(head, table);
    show(runs[row]);
  }
  // A run in three dimensions: from the server, or one of those that the page holds.
  let held = null, shell = null;
  function show(run) {
    const box = byId("view");
    box.hidden = false;
    box.replaceChildren();
    if (!content.address && !stored.has(run)) {
      const how = document.createElement("p");
      how.textContent = `To see it: mcstudy view FOLDER --run ${run}, with the folder of this study`;
      box.append(how);
      return;
    }
    const both = held !== null && held !== run ? [held, run] : [run];
    const frame = document.createElement("iframe"), keep = document.createElement("button");
    frame.title = `Run ${both.join(" and run ")} in three dimensions`;
    frame.allow = "fullscreen";
    keep.type = "button"; keep.id = "compare";
    keep.textContent = held === run ? "Compare with no run" : "Compare with the next run";
    keep.addEventListener("click", () => { held = held === run ? null : run; pick(picked); });
    box.append(keep, frame);
    if (content.address) frame.src = content.address + both.join("+");
    else fill(frame, both.map((number) => stored.get(number).packed));
  }
  async function fill(frame, packed) {
    shell = shell || new TextDecoder().decode(await inflate(content.viewer));
    const text = JSON.stringify({ runs: packed }).replace(/</g, "\\u003c");
    frame.srcdoc = shell.replace(content.mark, () => text);
  }
  if (stored.size) {
    const list = byId("stored");
    list.add(new Option("choose", ""));
    for (const { run, why } of content.stored) list.add(new Option(`run ${run}: ${why}`, run));
    list.addEventListener("change", () => { if (list.value) pick(runs.indexOf(Number(list.value))); });
  } else byId("stored").parentElement.hidden = true;
  byId("run").addEventListener("change", () => pick(runs.indexOf(Number(byId("run").value))));
  byId("reset").addEventListener("click", () => { columns.forEach((column) => { column.brush = null; }); choose(); });
  for (const column of columns) {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox"; box.checked = column.shown; box.name = column.name;
    box.addEventListener("change", () => {
      if (box.checked && shown().length >= MOST_AXES) { box.checked = false; return; }
      column.shown = box.checked;
      if (!box.checked) column.brush = null;
      choose();
    });
    label.append(box, ` ${column.label}`);
    byId("axes").append(label);
  }
  content.statuses.forEach((state) => {
    state.on = true;
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox"; box.checked = true;
    box.addEventListener("change", () => { state.on = box.checked; choose(); });
    label.append(box, ` ${state.name} (${state.count.toLocaleString("en")})`);
    byId("status").append(label);
  });
  const start = (canvas) => (event) => {
    drag = { canvas, x: event.offsetX, y: event.offsetY, x2: event.offsetX, y2: event.offsetY, moved: false };
    event.target.setPointerCapture(event.pointerId);
  };
  const move = (event) => {
    if (!drag) return;
    drag.x2 = event.offsetX; drag.y2 = event.offsetY;
    drag.moved = drag.moved || Math.hypot(drag.x2 - drag.x, drag.y2 - drag.y) > 4;
    if (drag.canvas === "parallel") brushAxis(); else wanted = true;
  };
  const stop = () => {
    if (drag && drag.canvas === "matrix") { if (drag.moved) brushCell(); else nearest(); }
    drag = null; wanted = true;
  };
  function brushAxis() {
    const canvas = byId("parallel"), height = canvas.clientHeight;
    const place = axisPlaces(canvas.clientWidth).reduce((a, b) => (Math.abs(b.x - drag.x) < Math.abs(a.x - drag.x) ? b : a));
    const value = (y) => place.column.low + (place.column.high - place.column.low) * (height - BOTTOM - y) / (height - TOP - BOTTOM);
    place.column.brush = [value(drag.y), value(drag.y2)].sort((a, b) => a - b);
    choose();
  }
  function cellAt(x, y) {
    const canvas = byId("matrix");
    return cells(canvas.clientWidth, canvas.clientHeight).find((c) => x >= c.x && x <= c.x + c.size && y >= c.y && y <= c.y + c.size);
  }
  function brushCell() {
    const cell = cellAt(drag.x, drag.y);
    if (!cell) return;
    const u = (x) => cell.column.low + (cell.column.high - cell.column.low) * (x - cell.x) / cell.size;
    const v = (y) => cell.row.low + (cell.row.high - cell.row.low) * (cell.y + cell.size - y) / cell.size;
    cell.column.brush = [u(drag.x), u(drag.x2)].sort((a, b) => a - b);
    if (cell.i !== cell.j) cell.row.brush = [v(drag.y), v(drag.y2)].sort((a, b) => a - b);
    choose();
  }
  function nearest() {
    const cell = cellAt(drag.x, drag.y);
    if (!cell || cell.i === cell.j) return;
    let best = -1, least = 15 * 15;
    for (let k = 0; k < count; k++) {
      if (!chosen[k]) continue;
      const x = cell.x + cell.size * (cell.column.values[k] - cell.column.low) / (cell.column.high - cell.column.low);
      const y = cell.y + cell.size - cell.size * (cell.row.values[k] - cell.row.low) / (cell.row.high - cell.row.low);
      const apart = (x - drag.x) ** 2 + (y - drag.y) ** 2;
      if (apart < least) { least = apart; best = k; }
    }
    if (best >= 0) pick(best);
  }
  for (const name of ["parallel", "matrix"]) {
    byId(name).addEventListener("pointerdown", start(name));
    byId(name).addEventListener("pointermove", move);
    byId(name).addEventListener("pointerup", stop);
  }
  byId("parallel").addEventListener("dblclick", (event) => {
    const place = axisPlaces(event.target.clientWidth).reduce((a, b) => (Math.abs(b.x - event.offsetX) < Math.abs(a.x - event.offsetX) ? b : a));
    place.column.brush = null; choose();
  });
  byId("matrix").addEventListener("dblclick", (event) => {
    const cell = cellAt(event.offsetX, event.offsetY);
    if (cell) { cell.row.brush = null; cell.column.brush = null; choose(); }
  });
  window.addEventListener("resize", () => { wanted = true; });
  dark.addEventListener("change", () => { wanted = true; });
  function tick() {
    if (wanted) {
      wanted = false;
      const begun = performance.now();
      drawParallel(); drawMatrix();
      document.body.dataset.milliseconds = (performance.now() - begun).toFixed(0);
    }
    window.requestAnimationFrame(tick);
  }
  const asked = new URLSearchParams(window.location.hash.slice(1));
  for (const [name, text] of asked) {
    const column = columns.find((entry) => entry.name === name);
    if (column) column.brush = text.split(":").map(Number);
  }
  choose();
  if (stored.size && !asked.has("run")) pick(runs.indexOf(content.stored[0].run));
  if (asked.has("run")) pick(runs.indexOf(Number(asked.get("run"))));
  tick();
});
