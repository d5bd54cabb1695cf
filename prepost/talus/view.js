"use strict";
// The page of a view: its panel, the hand that moves the camera, and when which picture is drawn.

const TOLD = 250; // between two figures in the corner
const KEPT = 500; // times of pictures that are remembered
const PART = 40; // milliseconds that a part of it takes: in between the page listens

// --- pictures: one tick a refresh of the screen -------------------------------------------------

const one = new Uint8Array(4);
function finish() { gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, one); }
function timed(picture) { // milliseconds of a picture, until it is finished
  const start = performance.now();
  picture();
  finish();
  return performance.now() - start;
}

const now = { // what goes on
  pace: startPace(), moving: false, changed: false, asked: false, rest: 0, last: 0,
  job: null, speed: 0, spent: [], told: 0,
};

function ask() {
  if (now.asked) return;
  now.asked = true;
  requestAnimationFrame(refresh);
}

// something is other than in the picture: it is drawn in full
function redraw() { now.job = null; now.changed = true; ask(); }

// the hand, the clock or a slider moves: pictures keep their rate, the full one follows at rest
function move() {
  if (el("always").checked) { redraw(); return; }
  now.moving = true;
  clearTimeout(now.rest);
  now.rest = setTimeout(() => { now.moving = false; now.last = 0; redraw(); }, restAfter(now.spent));
  redraw();
}

function refresh(time) {
  now.asked = false;
  if (!now.moving) return refreshFull();
  const drew = now.last; // a picture was drawn at the last tick: from there to here it took
  if (drew) {
    now.spent = [...now.spent.slice(-KEPT), time - drew];
    now.pace = nextPace(now.pace, time - drew);
    if (time - now.told > TOLD) tell(paceText(now.pace, mean(now.spent.slice(-15))), time);
  }
  const before = shown;
  if (now.changed) drawQuick(LEVELS[now.pace.level]);
  now.last = now.changed && shown === before ? time : 0; // loading a step is no picture
  now.changed = false;
  ask();
}

// A part of the full picture, when the last part is finished. What was measured says how many
// grains the next one has.
function refreshFull() {
  if (now.changed) {
    now.changed = false;
    now.job = { ...beginFull(), fence: null };
  }
  const job = now.job;
  if (!job) return;
  if (job.fence) {
    if (gl.getSyncParameter(job.fence, gl.SYNC_STATUS) !== gl.SIGNALED) { ask(); return; }
    gl.deleteSync(job.fence);
    now.speed = job.size / Math.max(1, performance.now() - job.since);
  }
  job.size = el("always").checked ? Infinity : Math.max(500, Math.round(PART * now.speed));
  job.since = performance.now();
  drawPart(job, job.size);
  if (job.done) { now.job = null; tell("full picture"); return; }
  job.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  tell(`full picture: ${Math.floor((100 * job.at) / job.count)} %`);
  ask();
}

function tell(text, time = 0) {
  el("pace").textContent = text;
  now.told = time;
}

// --- measured ----------------------------------------------------------------------------------

// full pictures a second while the camera turns: #rate=20 makes so many before the first view
function rate(count) {
  let all = 0;
  for (let k = 0; k < count; k++) {
    camera.yaw += 0.02;
    all += timed(draw);
  }
  const speed = (1000 * count / all).toPrecision(3);
  el("rate").textContent = `${speed} full pictures a second of ${canvas.width} x ${canvas.height}`;
  resetCamera();
}

// Turn the camera for so many seconds as a hand would, 45 degrees a second, and say how it went:
// pictures a second over the last half, level of quality: #turn=5
function turn(seconds) {
  const start = performance.now();
  now.spent = [];
  return new Promise((done) => {
    let last = start;
    const step = (time) => {
      camera.yaw += 0.25 * Math.PI * Math.max(0, time - last) / 1000;
      last = time;
      move();
      if (time - start < 1000 * seconds) { requestAnimationFrame(step); return; }
      const half = now.spent.slice(now.spent.length >> 1);
      const ms = mean(half), text = paceText(now.pace, ms);
      el("rate").textContent = text;
      const { level } = now.pace;
      done({ pictures: now.spent.length, ms, level, floor: atFloor(now.pace), text });
    };
    requestAnimationFrame(step);
  });
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
  facts.frames.forEach((f, k) => {
    if (f.count) blob("kind" + k, "u1").forEach((r) => kinds.add(r));
  });
  for (const [role, name] of facts.roles) if (kinds.has(role)) tick(name, asks.get(name) !== "0");
  const some = (key) => facts.frames.some((f) => f[key]);
  if (facts.force) tick("contacts", asks.get("contacts") === "1");
  if (facts.solid) tick("solid", asks.get("solid") !== "0");
  if (some("triangles")) tick("surfaces", asks.get("surfaces") !== "0");
  el("time").max = facts.frames.length - 1;
  el("time").value = asks.get("time") ?? facts.frames.length - 1;
  for (const id of ["colour", "axis", "cut", "opaque"])
    if (asks.has(id)) el(id).value = asks.get(id);
  for (const id of ["flip", "whole", "always"])
    if (asks.has(id)) el(id).checked = asks.get(id) === "1";
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
      const { right, up } = axes(), { width, height } = pageSize();
      const step = 1 / projection(width, height).pixel;
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
let drawn = 0;
const first = timed(() => { drawn = draw(); });
now.speed = drawn / first;
now.pace = startPace(firstLevel(first));
tell("full picture");
if (asks.has("turn")) turn(Number(asks.get("turn")));
