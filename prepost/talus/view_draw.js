"use strict";
// Two kinds of pictures: the full one, with every grain that can be seen and smooth edges, made in
// parts beside the screen; and the quick one, at a level of view_pace.js, straight on the screen.

const SMOOTH = 2; // pixels of the full picture for one of the page, each way
const SAMPLES = Math.min(4, gl.getParameter(gl.MAX_SAMPLES)); // of its edges
const FINE = 2; // pixels of the full picture in a cell of the search for hidden grains
const COARSE = 2.5; // such cells in the mean semi-axis, for quick pictures
const MOST_SETS = 100; // of grains that are kept
const LONGEST_SIDE = 2000; // cells of a side there, at most
const CORNERS = [0, 1, 2, 0, 2, 5]; // of the six of two triangles, without those that agree
const LARGEST = Math.min(64, gl.getParameter(gl.ALIASED_POINT_SIZE_RANGE)[1]); // pixels of a point

const parts = {}; // check boxes by name
function on(name) { return parts[name] ? parts[name].checked : false; }

function plane() {
  const axis = "xyz".indexOf(el("axis").value);
  if (el("axis").value === "") return { cuts: false, value: [0, 0, 0, 1e30] };
  const sign = (el("flip").checked ? -1 : 1) * [1, -1, 1][axis]; // away goes what is near at first
  const at = bounds.low[axis] + Number(el("cut").value) * (bounds.high[axis] - bounds.low[axis]);
  const value = [0, 0, 0, sign * at];
  value[axis] = sign;
  return { cuts: true, value };
}

function use(made, view, cut, { mapped, colour = [0.6, 0.6, 0.6], opaque = 1, cuts = cut.cuts }) {
  gl.useProgram(made.made);
  gl.uniformMatrix4fv(made.at("toScreen"), false, view.m);
  gl.uniform4fv(made.at("plane"), cut.value);
  gl.uniform3fv(made.at("eye"), view.back);
  gl.uniform3fv(made.at("colour"), colour);
  gl.uniform1i(made.at("map"), 0);
  gl.uniform1i(made.at("mapped"), mapped ? 1 : 0);
  gl.uniform1i(made.at("cuts"), cuts ? 1 : 0);
  gl.uniform1f(made.at("opaque"), opaque);
}

function rgb(text) { return [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255); }

function shownRoles() {
  return facts.roles.reduce((bits, [role, name]) => bits | (on(name) ? 1 << role : 0), 0);
}
function leavesWhole(cut) { return el("whole").checked && cut.cuts; }

// --- which grains ------------------------------------------------------------------------------

function sceneOf(view, cut, cell) {
  return {
    ...view, cell, plane: cut, whole: leavesWhole(cut), roles: shownRoles(),
    target: [...camera.target], radius: bounds.radius,
  };
}

// Corners of the rectangles of the grains that can be seen, in the order of the file: where two
// surfaces lie equally deep the first one is seen.
function cornersOf(seen) {
  const sorted = seen.slice().sort(), corners = new Uint32Array(6 * sorted.length);
  for (let k = 0; k < sorted.length; k++) for (let c = 0; c < 6; c++)
    corners[6 * k + c] = 6 * sorted[k] + CORNERS[c];
  return corners;
}

const indices = { full: gl.createBuffer(), quick: gl.createBuffer() };
function setIndices(made, data) {
  gl.bindVertexArray(null);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, made);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, data, gl.STREAM_DRAW);
}

// The grains of quick pictures are those that are seen from the nearest of many directions, in the
// whole scene: what is found stays good while the camera turns to and fro, moves or comes nearer.
let quick = {};
function quickGrains(cut, share) {
  const { yaw, pitch } = nearestWay(camera), roles = shownRoles();
  const name = [shown.frame, roles, leavesWhole(cut), ...cut.value].join();
  if (quick.name !== name || Object.keys(quick.some).length > MOST_SETS)
    quick = { name, seen: {}, some: {} };
  const way = `${yaw} ${pitch}`, part = `${way} ${share}`;
  quick.seen[way] ??= seenFrom({ ...camera, yaw, pitch }, cut);
  quick.some[part] ??= share < 1 ? quick.seen[way].filter((grain) => isDrawn(grain, share))
    : quick.seen[way];
  return quick.some[part];
}

function seenFrom(place, cut) {
  const side = Math.min(2 * bounds.radius * COARSE / facts.size, LONGEST_SIDE);
  const pixel = side / (2 * bounds.radius);
  const scene = { ...sceneOf({ ...axes(place), width: side, height: side, pixel }, cut, 1) };
  return seenGrains(shown.grains, shown.kind, { ...scene, target: bounds.middle });
}

function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// --- drawing -----------------------------------------------------------------------------------

// rectangles of grains by the numbers of their corners, which a buffer holds
function drawGrains(made, from, count, view, cut) {
  const whole = leavesWhole(cut), { at } = grainProgram;
  use(grainProgram, view, cut, { mapped: shown.value !== null, cuts: cut.cuts && !whole });
  ["shapes", "places", "quats", "numbers", "values"].forEach((one, k) =>
    gl.uniform1i(at(one), 1 + k));
  gl.uniform3fv(at("right"), view.right);
  gl.uniform3fv(at("up"), view.up);
  gl.uniform1i(at("roles"), shownRoles());
  gl.uniform1i(at("whole"), whole ? 1 : 0);
  gl.uniform3fv(at("roleColours"), facts.roles.flatMap((role) => rgb(role[2])));
  gl.bindVertexArray(null); // no arrays: a vertex knows its grain by its number
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, made);
  gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 24 * from);
}

function drawMesh(made, count, kind, view, cut, look) {
  use(meshProgram, view, cut, look);
  gl.bindVertexArray(made);
  gl.depthMask(!(look.opaque < 1)); // what is seen through hides nothing that is drawn later
  gl.drawElements(kind, count, gl.UNSIGNED_INT, 4 * (look.from || 0));
  gl.depthMask(true);
}

// The polyhedra of the roles that are shown; those that a cut hides as a whole are left out.
function drawBodies(view, cut, share) {
  const n = shown.bodyCells, whole = leavesWhole(cut), [a, b, c, w] = cut.value;
  const mapped = shown.value !== null, cuts = cut.cuts && !whole;
  for (const [role, name, paint] of facts.roles) {
    const first = shown.bodies.findIndex((body) => body.role === role);
    const all = shown.bodies.filter((body) => body.role === role);
    if (!on(name) || !all.length) continue;
    const look = { mapped, colour: rgb(paint), opaque: 1, cuts };
    const count = Math.ceil(share * all.length);
    const draw = (from, some) => drawMesh(shown.bodyMesh, n * some, gl.TRIANGLES, view, cut,
      { ...look, from: n * (first + from) });
    if (!whole) draw(0, count);
    else all.slice(0, count).forEach(({ middle: [x, y, z] }, k) => {
      if (a * x + b * y + c * z <= w) draw(k, 1);
    });
  }
}

function drawOthers(f, view, cut, share) {
  const step = linkStep(share);
  if (f.bodies) drawBodies(view, cut, share);
  if (f.links && on("contacts")) {
    use(linkProgram, view, cut, { mapped: true });
    gl.uniform1f(linkProgram.at("thick"), 0.4 * facts.size);
    gl.bindVertexArray(shown.linkArrays[step] ??= shown.links(step));
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 6 * SIDES, Math.ceil(f.links / step));
  }
  const opaque = Number(el("opaque").value);
  if (shown.solid && on("solid")) {
    const look = { mapped: shown.colour.startsWith("s."), colour: rgb("#d8c7a3"), opaque };
    drawMesh(shown.solid, shown.solidCounts[0], gl.TRIANGLES, view, cut, look);
    drawMesh(shown.edges, shown.solidCounts[1], gl.LINES, view, cut, { colour: [0.4, 0.34, 0.22] });
  }
  if (f.triangles && on("surfaces"))
    drawMesh(shown.surface, 3 * f.triangles, gl.TRIANGLES, view, cut,
      { colour: rgb("#9aa3ad"), opaque: 0.3 });
  if (f.cell) drawCell(f.cell, view, cut);
  gl.bindVertexArray(null);
}

function drawCell([origin, edges], view, cut) {
  const x = [], lines = [];
  for (let k = 0; k < 8; k++) {
    for (let i = 0; i < 3; i++)
      x.push(origin[i] + [0, 1, 2].reduce((sum, e) => sum + ((k >> e) & 1) * edges[e][i], 0));
    for (let e = 0; e < 3; e++) if (!((k >> e) & 1)) lines.push(k, k | (1 << e));
  }
  const made = gl.createVertexArray();
  gl.bindVertexArray(made);
  const place = buffer(new Float32Array(x));
  attribute(0, place, 3, gl.FLOAT);
  const order = buffer(new Uint32Array(lines), gl.ELEMENT_ARRAY_BUFFER);
  drawMesh(made, lines.length, gl.LINES, view, cut, { colour: [0, 0, 0], cuts: false });
  gl.bindVertexArray(null);
  gl.deleteVertexArray(made);
  gl.deleteBuffer(place);
  gl.deleteBuffer(order);
}

// what the panel asks for is loaded; returns the facts of the step
function current() {
  const frame = Number(el("time").value), colour = el("colour").value;
  if (frame !== shown.frame || colour !== shown.colour) load(frame, colour);
  const f = facts.frames[frame];
  el("clock").textContent = `${f.time.toPrecision(4)} s, ${f.count} grains`;
  return f;
}

function begin(target, width, height, clear) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.viewport(0, 0, width, height);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  if (!clear) return;
  gl.clearColor(0.97, 0.975, 0.98, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
}

function resize(width, height) {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
function pageSize() { return { width: canvas.clientWidth, height: canvas.clientHeight }; }

// --- the full picture --------------------------------------------------------------------------

let canvasOfFull = null; // where it is made: samples, and the mean of them as a texture
function fullTarget(width, height) {
  const old = canvasOfFull;
  if (old && old.width === width && old.height === height) return old;
  if (old) {
    [old.samples, old.mean].forEach((one) => gl.deleteFramebuffer(one));
    old.buffers.forEach((one) => gl.deleteRenderbuffer(one));
    gl.deleteTexture(old.texture);
  }
  const store = (kind) => {
    const made = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, made);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, SAMPLES, kind, width, height);
    return made;
  };
  const buffers = [store(gl.RGBA8), store(gl.DEPTH_COMPONENT24)], samples = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, samples);
  [gl.COLOR_ATTACHMENT0, gl.DEPTH_ATTACHMENT].forEach((place, k) =>
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffers[k]));
  const made = texture(6, width, height, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, null);
  const mean = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, mean);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made, 0);
  return (canvasOfFull = { width, height, buffers, samples, mean, texture: made });
}

// Begin a full picture: what it needs is kept, so that it can be drawn in parts.
function beginFull() {
  const f = current(), size = pageSize();
  const [w, h] = [size.width, size.height].map((v) => Math.max(1, Math.round(SMOOTH * v)));
  const view = projection(w, h), cut = plane(), target = fullTarget(w, h);
  const scene = sceneOf(view, cut, FINE);
  const corners = cornersOf(f.count ? seenGrains(shown.grains, shown.kind, scene) : []);
  setIndices(indices.full, corners);
  begin(target.samples, w, h, true);
  return { f, view, cut, target, at: 0, count: corners.length / 6, done: false };
}

// draw so many grains more, and all the rest after the last of them
function drawPart(job, most) {
  const { view, cut, target, f } = job, count = Math.min(most, job.count - job.at);
  begin(target.samples, target.width, target.height, false);
  if (count > 0) drawGrains(indices.full, job.at, count, view, cut);
  job.at += count;
  if (job.at < job.count) return;
  drawOthers(f, view, cut, 1);
  showFull(target);
  job.done = true;
}

function showFull({ width, height, samples, mean }) {
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, samples);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, mean);
  gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  resize(width, height);
  begin(null, width, height, false);
  gl.disable(gl.DEPTH_TEST);
  gl.disable(gl.BLEND);
  gl.useProgram(copyProgram.made);
  gl.uniform1i(copyProgram.at("map"), 6);
  gl.bindVertexArray(null);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

function draw() { // at once; returns the number of grains
  const job = beginFull();
  drawPart(job, Infinity);
  return job.count;
}

// --- the quick picture -------------------------------------------------------------------------

const points = { array: gl.createVertexArray(), rows: buffer(new Float32Array(0)) };
gl.bindVertexArray(points.array);
[[4, 0], [3, 16], [3, 28]].forEach(([size, offset], k) =>
  attribute(k, points.rows, size, gl.FLOAT, { stride: 4 * WORDS, offset }));
attribute(3, points.rows, 3, gl.UNSIGNED_BYTE, { norm: true, stride: 4 * WORDS, offset: 40 });
gl.bindVertexArray(null);

// colour of a grain as the point shader reads it
function painter() {
  const number = ([r, g, b]) => r + 256 * g + 65536 * b, { kind, value } = shown;
  if (value) {
    const table = Uint32Array.from({ length: 256 }, (_, k) => number(viridis.subarray(3 * k)));
    return (grain) => table[value[grain]];
  }
  const bytes = (text) => rgb(text).map((part) => Math.round(255 * part));
  const table = facts.roles.map((role) => number(bytes(role[2])));
  return (grain) => table[Math.min(kind[grain], 3)];
}

function drawPoints(list, view, cut) {
  const { made, at } = pointPrograms[cut.cuts && !leavesWhole(cut) ? 1 : 0];
  const scene = { ...view, target: camera.target };
  const lamp = [0.25, 0.1, 0.6].map((part, k) => part + view.back[k]), far = Math.hypot(...lamp);
  gl.bindBuffer(gl.ARRAY_BUFFER, points.rows);
  gl.bufferData(gl.ARRAY_BUFFER, impostors(shown.grains, list, scene, painter()), gl.STREAM_DRAW);
  gl.useProgram(made);
  gl.uniform2f(at("size"), view.width, view.height);
  gl.uniform1f(at("depth"), 1 / (4 * bounds.radius * view.pixel));
  gl.uniform3fv(at("lamp"), [view.right, view.up, view.back].map((way) => dot(way, lamp) / far));
  gl.uniform4fv(at("cut"), cutOnScreen(cut.value, scene));
  gl.bindVertexArray(points.array);
  gl.drawArrays(gl.POINTS, 0, list.length);
}

// The quick picture: large grains, and at the best level all that are no ellipsoids, by their rays.
function drawQuick({ resolution, share, exact }) {
  const f = current(), size = pageSize(), cut = plane();
  const scale = resolution * Math.min(window.devicePixelRatio || 1, 2);
  const [w, h] = [size.width, size.height].map((v) => Math.max(1, Math.round(scale * v)));
  const view = projection(w, h), list = f.count ? quickGrains(cut, share) : [];
  resize(w, h);
  begin(null, w, h, true);
  if (list.length) {
    const { plain, largest } = shown.grains;
    if ((exact && !plain) || 2 * largest * view.pixel > LARGEST) {
      setIndices(indices.quick, cornersOf(list));
      drawGrains(indices.quick, 0, list.length, view, cut);
    } else drawPoints(list, view, cut);
  }
  drawOthers(f, view, cut, share);
}
