"use strict";
window.mcstudy.start(async (content) => {
  const { byId, inflate, unpack } = window.mcstudy;
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflate(byId("library").textContent));
  document.head.append(script);
  await Promise.all(content.runs.map(unpack));
  const problem = (text) => { byId("problem").hidden = false; byId("problem").textContent = text; };

  const PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"];
  const LEFT = 0xe69f00, RIGHT = 0x56b4e9, TRUNK = 0xb9c6cf, CAR = 0xdfe5e8;
  const FORCE = 0xd5197a, TAPE = 0xf0c000;
  const METRES_A_KILONEWTON = 0.1, LONGEST = 1.5, TIP = 0.09;
  const APART = 2.8;
  const dark = window.matchMedia("(prefers-color-scheme: dark)");

  const end = Math.max(...content.runs.map((run) => run.time[run.time.length - 1]));

  // -- the scene ---------------------------------------------------------------------------------
  const frame = byId("scene");
  // A processor that draws smooths still pictures only, by drawing them larger.
  const slow = (() => {
    const gl = document.createElement("canvas").getContext("webgl");
    const known = gl && gl.getExtension("WEBGL_debug_renderer_info");
    return Boolean(known) && /swiftshader|llvmpipe|software/i.test(gl.getParameter(known.UNMASKED_RENDERER_WEBGL));
  })();
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: !slow });
  } catch (error) {
    problem("This browser shows no WebGL: the scene cannot be drawn, the curves below can.");
  }
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(35, 1, 0.05, 200);
  camera.up.set(0, 0, 1);
  const headlight = new THREE.DirectionalLight(0xffffff, 0.55);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 0.75), headlight);
  // Short segments: long ones that pass behind the camera are lost by some drivers.
  const cells = [];
  for (let a = -4; a <= 40; a++) for (let b = -8; b <= 8; b++) {
    if (a < 40) cells.push(a, b, 0, a + 1, b, 0);
    if (b < 8) cells.push(a, b, 0, a, b + 1, 0);
  }
  const grid = new THREE.BufferGeometry();
  grid.setAttribute("position", new THREE.Float32BufferAttribute(cells, 3));
  scene.add(new THREE.LineSegments(grid, new THREE.LineBasicMaterial({ color: 0x98a2a9 })));
  let controls = null;
  if (renderer) {
    frame.appendChild(renderer.domElement);
    controls = new THREE.TrackballControls(camera, renderer.domElement);
    controls.rotateSpeed = 3.0;
    controls.staticMoving = true;
    controls.addEventListener("change", () => { wanted = true; });
  }

  function colourOf(name) {
    return name.endsWith("_left") ? LEFT : name.endsWith("_right") ? RIGHT : TRUNK;
  }
  const GHOST = 0.4;
  function material(colour, ghost, share = 1) {
    const found = new THREE.MeshLambertMaterial({ color: colour, side: THREE.DoubleSide });
    found.userData = { ghost, share };
    return found;
  }
  function fade(run, apart) {
    run.group.traverse((object) => {
      const own = object.material;
      if (!own || !own.userData.share) return;
      own.opacity = own.userData.share * (own.userData.ghost && !apart ? GHOST : 1);
      own.transparent = own.opacity < 1;
      own.depthWrite = !own.transparent;
      own.needsUpdate = true;
    });
  }
  function ribbon(line, half) {
    const count = line.length / 2, points = [], faces = [];
    for (let k = 0; k < count; k++) {
      points.push(line[2 * k], -half, line[2 * k + 1], line[2 * k], half, line[2 * k + 1]);
      if (k + 1 < count) faces.push(2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 1, 2 * k + 3, 2 * k + 2);
    }
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    shape.setIndex(faces);
    shape.computeVertexNormals();
    return shape;
  }
  function surface(mesh) {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(mesh.nodes), 3));
    shape.setIndex(new THREE.BufferAttribute(mesh.faces, 1));
    shape.computeVertexNormals();
    return shape;
  }
  function trace(run, name, colour) {
    const row = run.names.indexOf(name);
    if (row < 0) return null;
    const count = run.time.length, points = new Float32Array(3 * count);
    for (let f = 0; f < count; f++) {
      for (let k = 0; k < 3; k++) points[3 * f + k] = run.centre[3 * (f * run.names.length + row) + k];
    }
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(points, 3));
    const line = new THREE.Line(shape, new THREE.LineBasicMaterial({ color: colour }));
    line.frustumCulled = false;
    return line;
  }
  // An arrow of one metre along x; seen through the bodies.
  const shaft = new THREE.CylinderGeometry(0.012, 0.012, 1, 8).translate(0, 0.5, 0).rotateZ(-Math.PI / 2);
  const tip = new THREE.ConeGeometry(0.035, TIP, 12).translate(0, -TIP / 2, 0).rotateZ(-Math.PI / 2);
  function arrows(run) {
    let most = 0;
    for (let f = 0; f + 1 < run.forces.first.length; f++) most = Math.max(most, run.forces.first[f + 1] - run.forces.first[f]);
    const paint = new THREE.MeshBasicMaterial({ color: FORCE, depthTest: false, transparent: true });
    return Array.from({ length: most }, () => {
      const arrow = new THREE.Group();
      for (const shape of [shaft, tip]) {
        const part = new THREE.Mesh(shape, paint);
        part.renderOrder = 2;
        arrow.add(part);
      }
      run.group.add(arrow);
      return arrow;
    });
  }
  const aim = new THREE.Vector3(), AXIS = new THREE.Vector3(1, 0, 0);
  function push(run, row) {
    const from = run.forces.first[row], many = byId("forces").checked ? run.forces.first[row + 1] - from : 0;
    run.arrows.forEach((arrow, k) => {
      arrow.visible = k < many;
      if (!arrow.visible) return;
      const at = 3 * (from + k), { place, force } = run.forces;
      aim.set(force[at], force[at + 1], force[at + 2]);
      const length = Math.min(METRES_A_KILONEWTON * aim.length() / 1000, LONGEST);
      arrow.position.set(place[at], place[at + 1], place[at + 2]);
      arrow.quaternion.setFromUnitVectors(AXIS, aim.normalize());
      arrow.children[0].scale.set(length, 1, 1);
      arrow.children[1].position.set(length + TIP / 2, 0, 0);
    });
  }
  function tapeOf(run) {
    const points = Array.from({ length: run.tape.length / 3 }, (_, k) => new THREE.Vector3(run.tape[3 * k] + 0.004, run.tape[3 * k + 1], run.tape[3 * k + 2] + 0.004));
    const path = new THREE.CurvePath();
    for (let k = 0; k + 1 < points.length; k++) path.add(new THREE.LineCurve3(points[k], points[k + 1]));
    const shape = new THREE.TubeGeometry(path, 8 * points.length, 0.012, 6);
    return new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ color: TAPE }));
  }
  content.runs.forEach((run, number) => {
    const ghost = number > 0;
    run.group = new THREE.Group();
    run.carGroup = new THREE.Group();
    run.group.add(run.carGroup);
    run.bodies = run.names.map(() => new THREE.Group());
    run.bodies.forEach((body) => run.group.add(body));
    const meshed = new Set(run.meshes.map((mesh) => mesh.body));
    for (const mesh of run.meshes) {
      const row = run.names.indexOf(mesh.body);
      const colour = mesh.car || row < 0 ? CAR : colourOf(mesh.body);
      mesh.object = new THREE.Mesh(surface(mesh), material(colour, ghost));
      (mesh.car ? run.carGroup : row < 0 ? run.group : run.bodies[row]).add(mesh.object);
    }
    if (!run.meshes.some((mesh) => mesh.car)) {
      for (const line of run.outline) {
        run.carGroup.add(new THREE.Mesh(ribbon(line, run.half_width), material(CAR, ghost, 0.75)));
      }
    }
    const ball = new THREE.SphereGeometry(1, 24, 16);
    run.names.forEach((name, row) => {
      if (meshed.has(name)) return;
      const body = new THREE.Mesh(ball, material(colourOf(name), ghost));
      body.scale.set(...run.axes[row]);
      run.bodies[row].add(body);
    });
    const colour = new THREE.Color(PALETTE[number % PALETTE.length]);
    run.traces = [trace(run, "head", colour), trace(run, "hip", colour)].filter(Boolean);
    run.traces.forEach((line) => run.group.add(line));
    run.arrows = run.forces ? arrows(run) : [];
    if (run.tape) { run.band = tapeOf(run); run.carGroup.add(run.band); }
    scene.add(run.group);
  });

  const one = new THREE.Quaternion(), two = new THREE.Quaternion();
  function place(run, at) {
    const time = run.time, last = time.length - 1;
    let low = 0, high = last;
    while (high - low > 1) { const mid = (low + high) >> 1; if (time[mid] <= at) low = mid; else high = mid; }
    if (at >= time[last]) low = high = last;
    const span = time[high] - time[low];
    const share = span > 0 ? Math.min(Math.max((at - time[low]) / span, 0), 1) : 0;
    const n = run.names.length, mix = (a, b) => a + share * (b - a);
    run.bodies.forEach((body, row) => {
      const a = low * n + row, b = high * n + row, c = run.centre, q = run.orientation;
      body.position.set(mix(c[3 * a], c[3 * b]), mix(c[3 * a + 1], c[3 * b + 1]), mix(c[3 * a + 2], c[3 * b + 2]));
      one.set(q[4 * a + 1], q[4 * a + 2], q[4 * a + 3], q[4 * a]);
      two.set(q[4 * b + 1], q[4 * b + 2], q[4 * b + 3], q[4 * b]);
      body.quaternion.copy(one.slerp(two, share));
    });
    const x = mix(run.car[3 * low], run.car[3 * high]), y = mix(run.car[3 * low + 1], run.car[3 * high + 1]);
    run.carGroup.position.set(x, y, 0);
    run.carGroup.rotation.z = mix(run.car[3 * low + 2], run.car[3 * high + 2]);
    run.traces.forEach((line) => { line.visible = byId("trace").checked; line.geometry.setDrawRange(0, low + 1); });
    if (run.forces) push(run, share < 0.5 ? low : high);
    if (run.band) run.band.visible = byId("tape").checked;
    for (const mesh of run.meshes) if (mesh.change) deform(mesh, at);
    return [x, y];
  }
  function deform(mesh, at) {
    let k = 0;
    while (k + 1 < mesh.film_time.length && mesh.film_time[k + 1] <= at) k++;
    if (mesh.shown === k) return;
    mesh.shown = k;
    const array = mesh.object.geometry.attributes.position.array, count = mesh.moved.length;
    for (let j = 0; j < count; j++) {
      const row = 3 * mesh.moved[j], from = 3 * (k * count + j);
      for (let c = 0; c < 3; c++) array[row + c] = mesh.nodes[row + c] + mesh.change[from + c];
    }
    mesh.object.geometry.attributes.position.needsUpdate = true;
    mesh.object.geometry.computeVertexNormals();
  }

  // -- time, camera, drawing ---------------------------------------------------------------------
  let now = 0, playing = false, wanted = true, before = null;
  const target = new THREE.Vector3(-0.4, 0, 0.6), carried = new THREE.Vector3();
  const VIEWS = { oblique: [3.2, -3.6, 2.2], side: [-0.2, -5.2, 0.9], above: [-0.6, -0.01, 6.0], front: [6.0, 0, 1.2] };
  function look() {
    const apart = byId("arrangement").value === "beside" ? content.runs.length - 1 : 0;
    // A narrow frame is looked into from farther away.
    const away = (1 + 0.35 * apart) * Math.max(1, 1.2 / camera.aspect);
    const from = VIEWS[byId("view").value].map((v) => v * away);
    content.runs.forEach((run) => fade(run, apart > 0));
    carried.set(0, 0, 0);
    target.set(-0.4, -0.5 * APART * apart, 0.6);
    camera.position.set(from[0] + target.x, from[1] + target.y, from[2]);
    camera.up.set(0, 0, 1);
    if (controls) { controls.target.copy(target); controls.update(); }
    wanted = true;
  }
  function colours() {
    scene.background = new THREE.Color(dark.matches ? 0x1b2125 : 0xf4f7f9);
    wanted = true;
  }
  function resize() {
    const width = frame.clientWidth, height = frame.clientHeight;
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (renderer) { sharpen(sharpness); renderer.setSize(width, height); }
    if (controls) controls.handleResize();
    const plot = byId("plot"), ratio = window.devicePixelRatio || 1;
    plot.width = plot.clientWidth * ratio; plot.height = plot.clientHeight * ratio;
    wanted = true;
  }
  // While it plays, the picture is as coarse as the frame rate needs.
  const FINEST = slow ? 1.5 : 1, COARSEST = 0.5, LONG_FRAME = 42, SETTLED = 8;
  let sharpness = FINEST, drawn = 0, interval = 0;
  function sharpen(to) {
    sharpness = to;
    renderer.setPixelRatio(sharpness * Math.min(window.devicePixelRatio, 2));
  }
  function keepPace(stamp) {
    interval += (stamp - before - interval) / Math.min(++drawn, SETTLED);
    if (drawn < SETTLED || interval < LONG_FRAME || sharpness <= COARSEST) return;
    sharpen(Math.max(COARSEST, 0.75 * sharpness));
    drawn = 0;
  }
  function show() {
    content.runs.forEach((run, number) => {
      run.group.position.y = byId("arrangement").value === "beside" ? -APART * number : 0;
      const [x, y] = place(run, now);
      if (number === 0 && byId("follow").checked && controls) {
        const shift = new THREE.Vector3(x - carried.x, 0, 0);
        camera.position.add(shift); controls.target.add(shift); carried.x = x;
      }
    });
    byId("clock").textContent = `${(1000 * now).toFixed(0)} ms`;
    byId("time").value = Math.round(1000 * position(now));
    draw();
    if (renderer) { headlight.position.copy(camera.position); renderer.render(scene, camera); }
  }
  // The slider gives half of its way to the first quarter of a second.
  const EARLY = Math.min(0.25, end);
  const position = (t) => (end <= EARLY ? t / end : t < EARLY ? 0.5 * t / EARLY : 0.5 + 0.5 * (t - EARLY) / (end - EARLY));
  const instant = (p) => (end <= EARLY ? p * end : p < 0.5 ? 2 * p * EARLY : EARLY + (2 * p - 1) * (end - EARLY));
  function tick(stamp) {
    if (playing) {
      if (before !== null && renderer) keepPace(stamp);
      if (before !== null) now += Number(byId("speed").value) * Math.min((stamp - before) / 1000, 0.1);
      if (now >= end) { now = end; play(false); }
      wanted = true;
      document.body.dataset.frames = String(Number(document.body.dataset.frames || 0) + 1);
    }
    before = stamp;
    if (controls) controls.update();
    if (wanted) { wanted = false; show(); }
    window.requestAnimationFrame(tick);
  }
  function play(on) {
    playing = on;
    if (on && now >= end) now = 0;
    drawn = 0;
    if (renderer) sharpen(on ? Math.min(sharpness, 1) : FINEST);
    wanted = true;
    byId("play").textContent = on ? "Pause" : "Play";
  }
  function go(to) { now = Math.min(Math.max(to, 0), end); wanted = true; }

  // -- curves ------------------------------------------------------------------------------------
  const labels = [...new Set(content.runs.flatMap((run) => run.curves.map((curve) => curve.label)))];
  labels.forEach((label) => byId("curve").add(new Option(label, label)));
  if (!labels.length) byId("history").hidden = true;
  if (content.runs.length < 2) byId("arranged").hidden = true;
  for (const name of ["forces", "tape"]) byId(`shown-${name}`).hidden = !content.runs.some((run) => run[name]);
  byId("whole").hidden = !document.fullscreenEnabled;
  byId("whole").addEventListener("click", () => {
    if (document.fullscreenElement) document.exitFullscreen(); else document.documentElement.requestFullscreen();
  });
  content.runs.forEach((run, number) => {
    const entry = document.createElement("span");
    entry.textContent = run.wad ? `${run.label}: WAD ${run.wad.toFixed(2)} m` : run.label;
    entry.style.setProperty("--colour", PALETTE[number % PALETTE.length]);
    byId("legend").append(entry);
  });
  let box = null;
  // The span of time that is shown grows in stages: the curves are drawn once a stage.
  const STAGES = [0.15, 0.3, 0.6, 1.2, 2.4, 4.8, 9.6].filter((t) => t < end).concat(end);
  let shownPlot = "";
  function draw() {
    const label = byId("curve").value;
    if (!label) return;
    const plot = byId("plot"), until = STAGES.find((t) => now <= t);
    const key = [label, until, plot.width, plot.height, dark.matches].join();
    if (key !== shownPlot) { shownPlot = key; drawCurves(label, until); }
    const at = box.left + (box.right - box.left) * now / until;
    byId("cursor").style.transform = `translate(${at}px, ${box.top}px)`;
    byId("cursor").style.height = `${box.bottom - box.top}px`;
  }
  function drawCurves(label, until) {
    const plot = byId("plot"), pen = plot.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const css = getComputedStyle(document.body);
    const line = css.getPropertyValue("--line"), soft = css.getPropertyValue("--soft");
    const width = plot.width / ratio, height = plot.height / ratio;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const shown = content.runs.map((run) => run.curves.find((curve) => curve.label === label));
    let low = 0, high = 0;
    shown.forEach((curve) => {
      if (curve) curve.values.forEach((v, k) => { if (curve.time[k] <= until) { low = Math.min(low, v); high = Math.max(high, v); } });
    });
    if (high === low) high = low + 1;
    high += 0.06 * (high - low);
    box = { left: 64, right: width - 12, top: 10, bottom: height - 40, until };
    const x = (t) => box.left + (box.right - box.left) * t / until;
    const y = (v) => box.bottom - (box.bottom - box.top) * (v - low) / (high - low);
    pen.font = "13px system-ui, sans-serif"; pen.fillStyle = soft; pen.strokeStyle = line; pen.lineWidth = 1;
    for (const v of ticks(low, high)) {
      pen.beginPath(); pen.moveTo(box.left, y(v)); pen.lineTo(box.right, y(v)); pen.stroke();
      pen.textAlign = "right"; pen.textBaseline = "middle"; pen.fillText(String(v), box.left - 6, y(v));
    }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const t of ticks(0, 1000 * until)) pen.fillText(String(t), x(t / 1000), box.bottom + 5);
    pen.fillText("time after first contact [ms]", (box.left + box.right) / 2, box.bottom + 22);
    pen.save(); pen.translate(14, (box.top + box.bottom) / 2); pen.rotate(-Math.PI / 2);
    pen.textBaseline = "middle"; pen.fillText(label.replace(/^.*\[/, "["), 0, 0); pen.restore();
    shown.forEach((curve, number) => {
      if (!curve) return;
      pen.strokeStyle = PALETTE[number % PALETTE.length]; pen.lineWidth = 2; pen.beginPath();
      let open = false;
      for (let k = 0; k < curve.time.length; k++) {
        if (curve.time[k] > until) break;
        if (!Number.isFinite(curve.values[k])) { open = false; continue; }
        if (open) pen.lineTo(x(curve.time[k]), y(curve.values[k])); else pen.moveTo(x(curve.time[k]), y(curve.values[k]));
        open = true;
      }
      pen.stroke();
    });
  }
  function ticks(low, high) {
    const raw = (high - low) / 6, power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(Number((k * step).toPrecision(6)));
    return found;
  }

  // -- what people do ----------------------------------------------------------------------------
  byId("play").addEventListener("click", () => play(!playing));
  byId("time").addEventListener("input", (event) => { play(false); go(instant(event.target.value / 1000)); });
  for (const name of ["follow", "trace", "forces", "tape", "curve"]) byId(name).addEventListener("change", () => { wanted = true; });
  byId("view").addEventListener("change", look);
  byId("arrangement").addEventListener("change", look);
  dark.addEventListener("change", colours);
  window.addEventListener("resize", resize);
  const scrub = (event) => {
    if (!box) return;
    const inside = event.offsetX - box.left;
    play(false); go(box.until * inside / (box.right - box.left));
  };
  byId("plot").addEventListener("pointerdown", (event) => { event.target.setPointerCapture(event.pointerId); scrub(event); });
  byId("plot").addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
  document.addEventListener("keydown", (event) => {
    if (["SELECT", "INPUT", "BUTTON"].includes(document.activeElement.tagName)) return;
    if (event.key === " ") { play(!playing); event.preventDefault(); }
    if (event.key === "ArrowRight") go(now + 0.002);
    if (event.key === "ArrowLeft") go(now - 0.002);
    if (event.key === "Home") go(0);
    if (event.key === "End") go(end);
  });
  const asked = new URLSearchParams(window.location.hash.slice(1));
  if (asked.has("t")) go(Number(asked.get("t")));
  for (const name of ["view", "arrangement", "curve"]) if (asked.has(name)) byId(name).value = asked.get(name);
  colours(); resize(); look();
  if (asked.has("play")) play(true);
  window.requestAnimationFrame(tick);
});
