"use strict";
// What a step holds, in the graphics memory, and the camera. The page has the data as base64
// (view_data.py says how).

const facts = JSON.parse(document.getElementById("facts").textContent);
const el = (id) => document.getElementById(id);
const canvas = el("scene");
const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
const KINDS = { f4: Float32Array, i2: Int16Array, u4: Uint32Array, u1: Uint8Array };

function fail(text) { el("fault").textContent = text; throw new Error(text); }
if (!gl) fail("This browser has no WebGL2, which the view needs.");

function has(name) { return el("b-" + name) !== null; }
function blob(name, kind) {
  const text = atob(el("b-" + name).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new KINDS[kind](bytes.buffer);
}

function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) fail(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) fail(gl.getProgramInfoLog(made));
  const places = {};
  return { made, at: (name) => (places[name] ??= gl.getUniformLocation(made, name)) };
}

const grainProgram = program(GRAIN_VERTEX, GRAIN_FRAGMENT);
const pointPrograms = [false, true].map((cuts) => program(POINT_VERTEX, POINT_FRAGMENT(cuts)));
const copyProgram = program(COPY_VERTEX, COPY_FRAGMENT);
const meshProgram = program(MESH_VERTEX, FRAGMENT);
const linkProgram = program(LINK_VERTEX, FRAGMENT);

// --- buffers -----------------------------------------------------------------------------------

function buffer(data, target = gl.ARRAY_BUFFER) {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, data, gl.STATIC_DRAW);
  return made;
}

function attribute(place, made, size, kind, { each = 0, norm = false, stride = 0,
  offset = 0 } = {}) {
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, kind, norm, stride, offset);
  gl.vertexAttribDivisor(place, each);
}

function texture(unit, width, height, inner, outer, kind, data) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, outer, kind, data);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
    gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
    gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  return made;
}

// the array is filled up to whole rows
function rowsTexture(unit, width, inner, outer, kind, data, size) {
  const rows = Math.ceil(data.length / size / width);
  const padded = new data.constructor(size * width * rows);
  padded.set(data);
  return texture(unit, width, rows, inner, outer, kind, padded);
}

const viridis = blob("viridis", "u1");
texture(0, 256, 1, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, viridis);
const shapes = has("shapes") ? blob("shapes", "f4") : null;
if (shapes) rowsTexture(1, 2046, gl.RGBA32F, gl.RGBA, gl.FLOAT, shapes, 4);

const SIDES = 6;
const ring = [];
for (let k = 0; k < SIDES; k++) {
  const [a, b] = [k, k + 1].map((i) => 2 * Math.PI * i / SIDES);
  const [p, q] = [a, b].map((t) => [Math.cos(t), Math.sin(t)]);
  for (const [c, z] of [[p, 0], [q, 0], [q, 1], [p, 0], [q, 1], [p, 1]]) ring.push(...c, z);
}
const ringBuffer = buffer(new Float32Array(ring));

let shown = { frame: -1, colour: "", arrays: [], buffers: [], textures: [] };

function normalsOf(x, triangles) {
  const n = new Float32Array(x.length);
  for (let k = 0; k < triangles.length; k += 3) {
    const [a, b, c] = [3 * triangles[k], 3 * triangles[k + 1], 3 * triangles[k + 2]];
    const [u, v] = [b, c].map((end) => [0, 1, 2].map((i) => x[end + i] - x[a + i]));
    const w = cross(u, v);
    for (const at of [a, b, c]) for (let i = 0; i < 3; i++) n[at + i] += w[i];
  }
  for (let k = 0; k < n.length; k += 3) {
    const size = Math.hypot(n[k], n[k + 1], n[k + 2]) || 1;
    for (let i = 0; i < 3; i++) n[k + i] /= size;
  }
  return n;
}

function array(fill) {
  const made = gl.createVertexArray();
  gl.bindVertexArray(made);
  fill();
  gl.bindVertexArray(null);
  shown.arrays.push(made);
  return made;
}
function kept(data, target) {
  const made = buffer(data, target);
  shown.buffers.push(made);
  return made;
}

// everything of one frame and colour goes to the graphics memory, the last one leaves it
function load(frame, colour) {
  for (const made of shown.arrays) gl.deleteVertexArray(made);
  for (const made of shown.buffers) gl.deleteBuffer(made);
  for (const made of shown.textures) gl.deleteTexture(made);
  shown = { frame, colour, arrays: [], buffers: [], textures: [], linkArrays: {} };
  const f = facts.frames[frame];
  if (f.count) loadGrains(frame, f.count, colour);
  if (f.links) {
    const ends = kept(blob("links" + frame, "f4")), pull = kept(blob("pull" + frame, "u1"));
    shown.links = (step) => array(() => { // every so many of them
      attribute(0, ringBuffer, 3, gl.FLOAT);
      attribute(1, ends, 3, gl.FLOAT, { each: 1, stride: 24 * step });
      attribute(2, ends, 3, gl.FLOAT, { each: 1, stride: 24 * step, offset: 12 });
      attribute(3, pull, 1, gl.UNSIGNED_BYTE, { each: 1, norm: true, stride: step });
    });
  }
  if (f.bodies) loadBodies(frame);
  if (f.triangles) {
    const x = blob("surface" + frame, "f4");
    shown.surface = mesh(x, Uint32Array.from({ length: x.length / 3 }, (_, k) => k), null);
  }
  if (facts.solid) loadSolid(facts.solid.step[frame], colour);
}

function loadGrains(frame, count, colour) {
  const name = colour.startsWith("g.") ? colour : null;
  const x = blob("x" + frame, "f4"), kind = blob("kind" + frame, "u1");
  const place = new Float32Array(4 * count);
  for (let k = 0; k < count; k++) place.set([x[3 * k], x[3 * k + 1], x[3 * k + 2], kind[k]], 4 * k);
  const value = name ? blob(name + frame, "u1") : new Uint8Array(count);
  const number = blob("shape" + frame, "u4"), quat = blob("quat" + frame, "i2");
  Object.assign(shown, { kind, value: name ? value : null });
  shown.grains = boundsOf(count, x, quat, number, shapes);
  shown.textures = [
    rowsTexture(2, ROW, gl.RGBA32F, gl.RGBA, gl.FLOAT, place, 4),
    rowsTexture(3, ROW, gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT, quat, 4),
    rowsTexture(4, ROW, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, number, 1),
    rowsTexture(5, ROW, gl.R8, gl.RED, gl.UNSIGNED_BYTE, value, 1),
  ];
}

// Polyhedra as triangles: by role, and within a role by what `isDrawn` compares, so that the first
// ones of each are the share that a quick picture shows.
function loadBodies(frame) {
  const rows = blob("bodies" + frame, "u4"), points = blob("points" + frame, "f4");
  const cells = blob("body.t", "u4"), size = points.length / rows.length;
  const role = (body) => Math.min(shown.kind[rows[body]], 3);
  const order = [...rows.keys()].sort((a, b) => role(a) - role(b) || rankOf(a) - rankOf(b));
  const x = new Float32Array(3 * cells.length * rows.length), n = cells.length;
  const value = shown.value ? new Uint8Array(n * rows.length) : null;
  shown.bodies = order.map((body, k) => {
    for (let c = 0; c < n; c++)
      for (let i = 0; i < 3; i++) x[3 * (n * k + c) + i] = points[size * body + 3 * cells[c] + i];
    value?.fill(shown.value[rows[body]], n * k, n * (k + 1));
    const own = points.subarray(size * body, size * (body + 1)), middle = [0, 0, 0];
    own.forEach((v, i) => { middle[i % 3] += 3 * v / size; });
    return { role: role(body), middle };
  });
  shown.bodyCells = n;
  shown.bodyMesh = mesh(x, Uint32Array.from({ length: x.length / 3 }, (_, k) => k), value);
}

function mesh(x, triangles, values) {
  const place = kept(x), n = kept(normalsOf(x, triangles));
  const value = values ? kept(values) : null;
  return array(() => {
    attribute(0, place, 3, gl.FLOAT);
    if (value) attribute(1, value, 1, gl.UNSIGNED_BYTE, { norm: true });
    attribute(2, n, 3, gl.FLOAT);
    kept(triangles, gl.ELEMENT_ARRAY_BUFFER);
  });
}

function loadSolid(step, colour) {
  const x = blob("solid.x" + step, "f4"), triangles = blob("solid.t", "u4");
  const edges = blob("solid.e", "u4");
  const values = colour.startsWith("s.") ? blob(colour + step, "u1") : null;
  shown.solid = mesh(x, triangles, values);
  shown.edges = array(() => {
    attribute(0, kept(x), 3, gl.FLOAT);
    kept(edges, gl.ELEMENT_ARRAY_BUFFER);
  });
  shown.solidCounts = [triangles.length, edges.length];
}

// --- camera: looks at `target` along turns about z (yaw) and above the horizon (pitch) -----------

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
const bounds = findBounds();
const camera = {};
function resetCamera() {
  camera.yaw = -0.85; camera.pitch = 0.42; camera.zoom = 1;
  camera.target = [...bounds.middle];
}

function findBounds() {
  const low = [1e30, 1e30, 1e30], high = [-1e30, -1e30, -1e30];
  const margin = facts.size || 0;
  for (const frame of [0, facts.frames.length - 1]) {
    const places = facts.frames[frame].count ? [blob("x" + frame, "f4")] : [];
    if (facts.frames[frame].bodies) places.push(blob("points" + frame, "f4"));
    if (facts.solid) places.push(blob("solid.x" + facts.solid.step[frame], "f4"));
    for (const x of places) for (let k = 0; k < x.length; k++) {
      low[k % 3] = Math.min(low[k % 3], x[k] - margin);
      high[k % 3] = Math.max(high[k % 3], x[k] + margin);
    }
  }
  if (low[0] > high[0])
    return { low: [-1, -1, -1], high: [1, 1, 1], middle: [0, 0, 0], radius: 1.8 };
  const middle = [0, 1, 2].map((i) => 0.5 * (low[i] + high[i]));
  return { low, high, middle, radius: 0.5 * Math.hypot(...[0, 1, 2].map((i) => high[i] - low[i])) };
}

function axes({ yaw, pitch } = camera) {
  const [c, s] = [Math.cos(pitch), Math.sin(pitch)];
  const back = [c * Math.cos(yaw), c * Math.sin(yaw), s];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  return { back, right, up: cross(back, right) };
}

// parallel projection: lengths can be compared, as in `talus render`
function projection(width, height) {
  const { back, right, up } = axes();
  const half = bounds.radius * 1.05 / camera.zoom;
  const ratio = width / height;
  const [sx, sy] = ratio > 1 ? [1 / (half * ratio), 1 / half] : [1 / half, ratio / half];
  const sz = -1 / (4 * bounds.radius);
  const rows = [right.map((v) => v * sx), up.map((v) => v * sy), back.map((v) => v * sz)];
  const m = new Float32Array(16);
  rows.forEach((row, i) => {
    row.forEach((v, j) => { m[4 * j + i] = v; });
    m[12 + i] = -row.reduce((sum, v, j) => sum + v * camera.target[j], 0);
  });
  m[15] = 1;
  return { m, back, right, up, pixel: Math.min(sx * width, sy * height) / 2, width, height };
}
