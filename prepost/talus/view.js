"use strict";
// The view of a run (WebGL2): grains by rays through the pixels of their rectangles on the screen,
// the outside of the solid, triangles that grains meet, contacts as tubes. The page holds the data as base64 (view_data.py says how).

const facts = JSON.parse(document.getElementById("facts").textContent);
const el = (id) => document.getElementById(id);
const canvas = el("scene");
const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
const KINDS = { f4: Float32Array, i2: Int16Array, u4: Uint32Array, u1: Uint8Array };
const ROW = 2048; // grains in a row of the textures that hold them, one texel a grain

function fail(text) { el("fault").textContent = text; throw new Error(text); }
if (!gl) fail("This browser has no WebGL2, which the view needs.");

function has(name) { return el("b-" + name) !== null; }
function blob(name, kind) {
  const text = atob(el("b-" + name).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new KINDS[kind](bytes.buffer);
}

// --- shaders -----------------------------------------------------------------------------------

const COMMON = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform mat4 toScreen; uniform vec4 plane; uniform vec3 eye; uniform vec3 colour;
uniform sampler2D map; uniform float opaque; uniform bool mapped;`;

// The rectangle that a grain fills on the screen, through the origin of its shape. The width to each
// side is the support function of the shape (eq. D.12, sharp).
const GRAIN_VERTEX = COMMON + `precision highp isampler2D; precision highp usampler2D;
uniform sampler2D places, values, shapes; uniform isampler2D quats; uniform usampler2D numbers;
uniform int roles; uniform vec3 right, up; uniform vec3 roleColours[4]; uniform bool whole;
out vec3 place, own; flat out vec3 way, tint; flat out vec4 upper, lower, quat;
vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
float reach(vec3 u) {
  vec3 a = abs(u) * mix(lower.xyz, upper.xyz, vec3(greaterThanEqual(u, vec3(0.0))));
  if (upper.w <= 2.0) return length(a);
  float q = upper.w / (upper.w - 1.0), most = max(max(a.x, a.y), a.z);
  return most * pow(dot(pow(max(a / most, 1e-6), vec3(q)), vec3(1.0)), 1.0 / q);
}
void main() {
  int grain = gl_VertexID / 6, corner = gl_VertexID % 6;
  ivec2 cell = ivec2(grain % ${ROW}, grain / ${ROW});
  vec4 centre = texelFetch(places, cell, 0);
  int role = int(min(centre.w, 3.0));
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if ((roles & (1 << role)) == 0 || (whole && dot(plane.xyz, centre.xyz) > plane.w)) return;
  int width = textureSize(shapes, 0).x, at = int(texelFetch(numbers, cell, 0).r) * 3;
  upper = texelFetch(shapes, ivec2(at % width, at / width), 0);
  lower = texelFetch(shapes, ivec2((at + 1) % width, (at + 1) / width), 0);
  vec3 middle = texelFetch(shapes, ivec2((at + 2) % width, (at + 2) / width), 0).xyz;
  quat = normalize(vec4(texelFetch(quats, cell, 0)));
  vec4 back = vec4(quat.x, -quat.yzw);
  bvec2 far = bvec2(corner == 1 || corner == 2 || corner == 4, corner >= 2 && corner != 3);
  vec3 r = turn(back, far.x ? right : -right), u = turn(back, far.y ? up : -up);
  way = turn(back, -eye);
  own = 1.001 * (r * reach(r) + u * reach(u));
  lower.w = reach(-way);
  place = centre.xyz + turn(quat, own - middle);
  float value = texelFetch(values, cell, 0).r;
  tint = mapped ? texture(map, vec2((value * 255.0 + 0.5) / 256.0, 0.5)).rgb : roleColours[role];
  gl_Position = toScreen * vec4(place, 1.0);
}`;

// Where the ray of a pixel meets the grain first: a root of a quadratic for an ellipsoid. For others
// the norm of the shape is convex along the ray, so that Newton's method from before the grain never
// passes the surface. A cut shows the inside flat.
const GRAIN_FRAGMENT = COMMON + `
uniform bool cuts; in vec3 place, own; flat in vec3 way, tint; flat in vec4 upper, lower, quat;
out vec4 paint;
vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
float norm(vec3 p, out vec3 slope) { // 1 on the surface; the slope is its gradient
  vec3 a = mix(lower.xyz, upper.xyz, vec3(greaterThanEqual(p, vec3(0.0)))), s = abs(p) / a;
  float e = upper.w, size = 1.0;
  if (e > 2.0) {
    float most = max(max(s.x, s.y), s.z);
    vec3 share = max(s / most, 1e-6), high = pow(share, vec3(e - 1.0));
    size = most * pow(dot(high, share), 1.0 / e);
    slope = sign(p) / a * high * pow(most / size, e - 1.0);
  } else {
    size = length(s);
    slope = sign(p) / a * s / size;
  }
  return size;
}
float first(out vec3 slope) {
  if (upper.w <= 2.0 && upper.xyz == lower.xyz) {
    vec3 p = own / upper.xyz, d = way / upper.xyz;
    float dd = dot(d, d), pd = dot(p, d), below = pd * pd - dd * (dot(p, p) - 1.0);
    if (below < 0.0) discard;
    float t = -(pd + sqrt(below)) / dd;
    slope = (p + t * d) / upper.xyz;
    return t;
  }
  float t = -1.01 * lower.w, left = 1.0;
  for (int k = 0; k < 16 && left > 1e-4; k++) {
    left = norm(own + t * way, slope) - 1.0;
    float rate = dot(slope, way);
    if (left > 1e-4 && rate >= 0.0) discard; // the ray passes by
    t -= left / min(rate, -1e-6);
  }
  if (left > 1e-2) discard;
  return t;
}
void main() {
  vec3 slope;
  float t = first(slope);
  vec3 world = place - t * eye;
  float above = dot(plane.xyz, world) - plane.w;
  bool open = cuts && above > 0.0;
  if (open) {
    float fall = dot(plane.xyz, eye);
    if (fall <= 0.0) discard;
    t += above / fall;
    world = place - t * eye;
    if (norm(own + t * way, slope) > 1.0) discard;
  }
  vec3 side = normalize(turn(quat, slope));
  float light = 0.45 + 0.5 * max(dot(side, normalize(eye + vec3(0.25, 0.1, 0.6))), 0.0);
  paint = vec4(tint * (open ? 0.62 : light) * 1.05, 1.0);
  gl_FragDepth = 0.5 + 0.5 * (toScreen * vec4(world, 1.0)).z;
}`;

// back faces are what a cut opens: they are painted flat, as if the body were filled
const FRAGMENT = COMMON + `
uniform bool cuts; in vec3 world; in vec3 normal; in vec3 tint; out vec4 paint;
void main() {
  if (cuts && dot(plane.xyz, world) > plane.w) discard;
  vec3 side = normalize(normal);
  vec3 sight = normalize(eye);
  if (opaque < 1.0) side = faceforward(side, -sight, side);
  float light = 0.45 + 0.5 * max(dot(side, normalize(sight + vec3(0.25, 0.1, 0.6))), 0.0);
  if (!gl_FrontFacing && cuts) light = 0.62;
  paint = vec4(tint * light * 1.05, opaque);
}`;

const MESH_VERTEX = COMMON + `
layout(location=0) in vec3 x; layout(location=1) in float value; layout(location=2) in vec3 n;
out vec3 world; out vec3 normal; out vec3 tint;
void main() {
  world = x; normal = n;
  tint = mapped ? texture(map, vec2((value * 255.0 + 0.5) / 256.0, 0.5)).rgb : colour;
  gl_Position = toScreen * vec4(x, 1.0);
}`;

// a tube from start to end: unit ring and place along it, thick by the root of the force
const LINK_VERTEX = COMMON + `
layout(location=0) in vec3 ring; layout(location=1) in vec3 start; layout(location=2) in vec3 end;
layout(location=3) in float pull;
uniform float thick; out vec3 world; out vec3 normal; out vec3 tint;
void main() {
  vec3 along = end - start;
  vec3 way = along / max(length(along), 1e-20);
  vec3 help = abs(way.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
  vec3 u = normalize(cross(way, help)), w = cross(way, u);
  normal = ring.x * u + ring.y * w;
  world = start + ring.z * along + thick * pull * normal;
  tint = texture(map, vec2((pull * pull * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  gl_Position = toScreen * vec4(world, 1.0);
}`;

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
if (has("shapes")) rowsTexture(1, 2046, gl.RGBA32F, gl.RGBA, gl.FLOAT, blob("shapes", "f4"), 4);

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
    const u = [0, 1, 2].map((i) => x[b + i] - x[a + i]), v = [0, 1, 2].map((i) => x[c + i] - x[a + i]);
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
function kept(data, target) { const made = buffer(data, target); shown.buffers.push(made); return made; }

// everything of one frame and colour goes to the graphics memory, the last one leaves it
function load(frame, colour) {
  for (const made of shown.arrays) gl.deleteVertexArray(made);
  for (const made of shown.buffers) gl.deleteBuffer(made);
  for (const made of shown.textures) gl.deleteTexture(made);
  shown = { frame, colour, arrays: [], buffers: [], textures: [] };
  const f = facts.frames[frame];
  if (f.count) loadGrains(frame, f.count, colour);
  if (f.links) {
    const ends = kept(blob("links" + frame, "f4")), pull = kept(blob("pull" + frame, "u1"));
    shown.links = array(() => {
      attribute(0, ringBuffer, 3, gl.FLOAT);
      attribute(1, ends, 3, gl.FLOAT, { each: 1, stride: 24 });
      attribute(2, ends, 3, gl.FLOAT, { each: 1, stride: 24, offset: 12 });
      attribute(3, pull, 1, gl.UNSIGNED_BYTE, { each: 1, norm: true });
    });
  }
  if (f.triangles) {
    const x = blob("surface" + frame, "f4"), t = Uint32Array.from({ length: x.length / 3 }, (_, k) => k);
    shown.surface = mesh(x, t, null);
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
  shown.textures = [
    rowsTexture(2, ROW, gl.RGBA32F, gl.RGBA, gl.FLOAT, place, 4),
    rowsTexture(3, ROW, gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT, quat, 4),
    rowsTexture(4, ROW, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, number, 1),
    rowsTexture(5, ROW, gl.R8, gl.RED, gl.UNSIGNED_BYTE, value, 1),
  ];
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
  camera.target = [0, 1, 2].map((i) => 0.5 * (bounds.low[i] + bounds.high[i]));
}

function findBounds() {
  const low = [1e30, 1e30, 1e30], high = [-1e30, -1e30, -1e30];
  const margin = facts.size || 0;
  for (const frame of [0, facts.frames.length - 1]) {
    const places = facts.frames[frame].count ? [blob("x" + frame, "f4")] : [];
    if (facts.solid) places.push(blob("solid.x" + facts.solid.step[frame], "f4"));
    for (const x of places) for (let k = 0; k < x.length; k++) {
      low[k % 3] = Math.min(low[k % 3], x[k] - margin);
      high[k % 3] = Math.max(high[k % 3], x[k] + margin);
    }
  }
  if (low[0] > high[0]) return { low: [-1, -1, -1], high: [1, 1, 1], radius: 1.8 };
  return { low, high, radius: 0.5 * Math.hypot(...[0, 1, 2].map((i) => high[i] - low[i])) };
}

function axes() {
  const [c, s] = [Math.cos(camera.pitch), Math.sin(camera.pitch)];
  const back = [c * Math.cos(camera.yaw), c * Math.sin(camera.yaw), s];
  const right = [-Math.sin(camera.yaw), Math.cos(camera.yaw), 0];
  return { back, right, up: cross(back, right) };
}

// parallel projection: lengths can be compared, as in `talus render`
function projection() {
  const { back, right, up } = axes();
  const half = bounds.radius * 1.05 / camera.zoom;
  const ratio = canvas.width / canvas.height;
  const [sx, sy] = ratio > 1 ? [1 / (half * ratio), 1 / half] : [1 / half, ratio / half];
  const sz = -1 / (4 * bounds.radius);
  const rows = [right.map((v) => v * sx), up.map((v) => v * sy), back.map((v) => v * sz)];
  const m = new Float32Array(16);
  rows.forEach((row, i) => {
    row.forEach((v, j) => { m[4 * j + i] = v; });
    m[12 + i] = -row.reduce((sum, v, j) => sum + v * camera.target[j], 0);
  });
  m[15] = 1;
  return { m, back, right, up, pixel: Math.min(sx * canvas.width, sy * canvas.height) / 2 };
}

// --- drawing -----------------------------------------------------------------------------------

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

function drawGrains(view, cut) {
  const { count } = facts.frames[shown.frame];
  let roles = 0;
  for (const [role, name] of facts.roles) if (on(name)) roles |= 1 << role;
  const whole = el("whole").checked && cut.cuts;
  use(grainProgram, view, cut, { mapped: shown.colour.startsWith("g."), cuts: cut.cuts && !whole });
  ["shapes", "places", "quats", "numbers", "values"].forEach((one, k) =>
    gl.uniform1i(grainProgram.at(one), 1 + k));
  gl.uniform3fv(grainProgram.at("right"), view.right);
  gl.uniform3fv(grainProgram.at("up"), view.up);
  gl.uniform1i(grainProgram.at("roles"), roles);
  gl.uniform1i(grainProgram.at("whole"), whole ? 1 : 0);
  gl.uniform3fv(grainProgram.at("roleColours"), facts.roles.flatMap((role) => rgb(role[2])));
  gl.bindVertexArray(null); // no arrays: a vertex knows its grain by its number
  gl.drawArrays(gl.TRIANGLES, 0, 6 * count);
}

function drawMesh(made, count, kind, view, cut, look) {
  use(meshProgram, view, cut, look);
  gl.bindVertexArray(made);
  gl.depthMask(!(look.opaque < 1)); // what is seen through hides nothing that is drawn later
  gl.drawElements(kind, count, gl.UNSIGNED_INT, 0);
  gl.depthMask(true);
}

function draw() {
  const scale = moving ? quick * Math.min(window.devicePixelRatio || 1, 2) : 2; // smooth at rest
  const [w, h] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  gl.viewport(0, 0, w, h);
  gl.clearColor(0.97, 0.975, 0.98, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const frame = Number(el("time").value), colour = el("colour").value;
  if (frame !== shown.frame || colour !== shown.colour) load(frame, colour);
  const f = facts.frames[frame], view = projection(), cut = plane();
  el("clock").textContent = `${f.time.toPrecision(4)} s, ${f.count} grains`;
  if (f.count) drawGrains(view, cut);
  if (f.links && on("contacts")) {
    use(linkProgram, view, cut, { mapped: true });
    gl.uniform1f(linkProgram.at("thick"), 0.4 * facts.size);
    gl.bindVertexArray(shown.links);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 6 * SIDES, f.links);
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

let asked = false, moving = false, rest = 0, quick = 1;
const one = new Uint8Array(4);
function timed() { // milliseconds of a picture, until it is finished
  const start = performance.now();
  draw();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, one);
  return performance.now() - start;
}
function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    if (!moving) draw();
    else quick = Math.min(1, Math.max(0.25, quick * Math.sqrt(40 / Math.max(timed(), 20))));
  });
}
// While the hand moves there are as many pixels as this machine draws in 40 ms, a quarter of them a
// side at least; a fifth of a second later edges are smooth.
function move() {
  moving = true;
  clearTimeout(rest);
  rest = setTimeout(() => { moving = false; redraw(); }, 200);
  redraw();
}

// pictures a second while the camera turns: #rate=20 turns it so many times before the first view
function rate(count) {
  moving = true;
  timed();
  let all = 0;
  for (let k = 0; k < count; k++) {
    camera.yaw += 0.02;
    all += timed();
  }
  moving = false;
  const speed = (1000 * count / all).toPrecision(3);
  el("rate").textContent = `${speed} pictures a second of ${canvas.width} x ${canvas.height}`;
  resetCamera();
}

// --- panel -------------------------------------------------------------------------------------

function tick(name, checked) {
  const label = document.createElement("label"), box = document.createElement("input");
  box.type = "checkbox";
  box.checked = checked;
  box.onchange = redraw;
  label.append(box, " " + name);
  el("parts").append(label);
  parts[name] = box;
}

const asks = new URLSearchParams(location.hash.slice(1)); // #colour=role&axis=y&time=3

function fillPanel() {
  const choose = (value, text) => el("colour").add(new Option(text, value));
  for (const f of facts.fields) choose("g." + f.name, f.title);
  if (facts.fields.length) choose("role", "role of the grain");
  for (const f of facts.solid?.fields || []) choose("s." + f.name, "solid: " + f.title);
  const kinds = new Set();
  facts.frames.forEach((f, k) => { if (f.count) blob("kind" + k, "u1").forEach((r) => kinds.add(r)); });
  for (const [role, name] of facts.roles) if (kinds.has(role)) tick(name, asks.get(name) !== "0");
  const some = (key) => facts.frames.some((f) => f[key]);
  if (facts.force) tick("contacts", asks.get("contacts") === "1");
  if (facts.solid) tick("solid", asks.get("solid") !== "0");
  if (some("triangles")) tick("surfaces", asks.get("surfaces") !== "0");
  el("time").max = facts.frames.length - 1;
  el("time").value = asks.get("time") ?? facts.frames.length - 1;
  for (const id of ["colour", "axis", "cut", "opaque"]) if (asks.has(id)) el(id).value = asks.get(id);
  for (const id of ["flip", "whole"]) if (asks.has(id)) el(id).checked = asks.get(id) === "1";
}

function short(value) { return Number(value.toPrecision(3)).toString(); }

function fillKey() {
  const key = el("key"), colour = el("colour").value;
  key.textContent = "";
  if (colour === "role") {
    for (const [, name, paint] of facts.roles) if (parts[name]) {
      const row = document.createElement("div"), swatch = document.createElement("span");
      row.className = "row"; swatch.className = "swatch"; swatch.style.background = paint;
      row.append(swatch, name);
      key.append(row);
    }
    return;
  }
  const list = colour.startsWith("s.") ? facts.solid.fields : facts.fields;
  const field = list.find((f) => f.name === colour.slice(2));
  if (!field) return;
  const title = document.createElement("div"), box = document.createElement("div");
  title.textContent = field.title;
  box.className = "row";
  const bar = document.createElement("canvas"), labels = document.createElement("div");
  bar.width = 18; bar.height = 240;
  labels.style.cssText = "display:flex;flex-direction:column;justify-content:space-between";
  const pen = bar.getContext("2d");
  for (let k = 0; k < 240; k++) {
    const at = 3 * Math.round(255 * (1 - k / 239));
    pen.fillStyle = `rgb(${viridis[at]},${viridis[at + 1]},${viridis[at + 2]})`;
    pen.fillRect(0, k, 18, 1);
  }
  for (let k = 5; k >= 0; k--) {
    const one = document.createElement("span");
    one.textContent = (k === 5 ? "≥ " : "") + short(field.low + (field.high - field.low) * k / 5);
    labels.append(one);
  }
  box.append(labels, bar);
  key.append(title, box);
}

let playing = 0;
function play() {
  if (playing) { clearInterval(playing); playing = 0; el("play").textContent = "play"; return; }
  el("play").textContent = "stop";
  playing = setInterval(() => {
    el("time").value = (Number(el("time").value) + 1) % facts.frames.length;
    move();
  }, 250);
}

function listen() {
  for (const id of ["axis", "cut", "flip", "whole", "opaque", "time"]) el(id).oninput = move;
  el("colour").oninput = () => { fillKey(); redraw(); };
  el("play").onclick = play;
  el("reset").onclick = () => { resetCamera(); redraw(); };
  window.onresize = redraw;
  canvas.oncontextmenu = (event) => event.preventDefault();
  canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
  canvas.onpointermove = (event) => {
    if (!event.buttons) return;
    const [dx, dy] = [event.movementX, event.movementY];
    if (event.buttons !== 1 || event.shiftKey) {
      const { right, up } = axes(), scale = window.devicePixelRatio || 1;
      const step = Math.min(scale, 2) / projection().pixel;
      for (let i = 0; i < 3; i++) camera.target[i] += step * (dy * up[i] - dx * right[i]);
    } else {
      camera.yaw -= 0.008 * dx;
      camera.pitch = Math.max(-1.57, Math.min(1.57, camera.pitch + 0.008 * dy));
    }
    move();
  };
  canvas.onwheel = (event) => {
    event.preventDefault();
    camera.zoom *= Math.exp(-0.0012 * event.deltaY);
    move();
  };
}

resetCamera();
fillPanel();
fillKey();
listen();
if (asks.has("rate")) rate(Number(asks.get("rate")));
draw();
