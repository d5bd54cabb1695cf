"use strict";
// Which grains can be seen: of a dense packing most are hidden by others, outside the window or
// cut away. The answer errs only towards too many, so that the picture stays the same to the bit.
//
// A grain lies between two ellipsoids about the origin of its shape: `outer` holds it, `inner` is
// held by it. Arrays hold, grain after grain, that origin (3) and the axes of both as columns (9).
//
// What is kept away from a bound: Newton's method in the shader takes a point within 1 % of the
// norm of a shape that is no ellipsoid for its surface; places are single precision there.

const LOOSE = 1.02, TIGHT = 0.97;
const SLACK = 1e-5; // of the radius of the scene, in depth and at a cut
const EDGE = 0.05; // pixels about a rim; cells end between pixels, so that they hold them whole

// the ellipsoids of n grains from what the page stores (view_data.py); of `body`, about `middle`,
// quick pictures are made
function boundsOf(n, x, quat, number, shapes) {
  const plain = number.every((row) => isEllipsoid(shapes, 12 * row));
  const place = new Float32Array(3 * n), outer = new Float32Array(9 * n);
  const inner = plain ? outer : new Float32Array(9 * n);
  const body = plain ? outer : new Float32Array(9 * n);
  const middle = plain ? place : new Float32Array(3 * n);
  const turn = new Float64Array(9), far = new Float64Array(3), near = new Float64Array(3);
  for (let k = 0; k < n; k++) {
    const s = 12 * number[k], round = plain || isEllipsoid(shapes, s);
    // a unit ball of the exponent e lies in the ball of radius 3^(1/2 - 1/e)
    const ball = round ? 1 : 3 ** (0.5 - 1 / Math.max(shapes[s + 3], 2));
    matrixOf(quat, 4 * k, turn);
    for (let j = 0; j < 3; j++) {
      const up = shapes[s + j], down = shapes[s + 4 + j];
      far[j] = (round ? 1 : LOOSE * ball) * Math.max(up, down);
      near[j] = (round ? 1 : TIGHT) * Math.min(up, down);
    }
    for (let i = 0; i < 3; i++) {
      const row = 9 * k + 3 * i;
      let back = 0;
      for (let j = 0; j < 3; j++) {
        back += turn[3 * i + j] * shapes[s + 8 + j];
        outer[row + j] = turn[3 * i + j] * far[j];
      }
      place[3 * k + i] = x[3 * k + i] - back;
      if (plain) continue;
      let shift = 0;
      for (let j = 0; j < 3; j++) {
        const t = turn[3 * i + j], up = shapes[s + j], down = shapes[s + 4 + j];
        inner[row + j] = t * near[j];
        body[row + j] = 0.5 * t * Math.sqrt(ball) * (up + down);
        shift += 0.5 * t * (up - down);
      }
      middle[3 * k + i] = place[3 * k + i] + shift;
    }
  }
  return { n, x, place, outer, inner, body, middle, plain, largest: largestOf(shapes) };
}

function largestOf(shapes) {
  let most = 0;
  for (let s = 0; s < shapes.length; s += 12)
    for (let j = 0; j < 3; j++) most = Math.max(most, shapes[s + j], shapes[s + 4 + j]);
  return most;
}

function isEllipsoid(shapes, s) {
  return shapes[s + 3] <= 2 && shapes[s] === shapes[s + 4] && shapes[s + 1] === shapes[s + 5]
    && shapes[s + 2] === shapes[s + 6];
}

// rows of the rotation of a quaternion w, x, y, z of any length
function matrixOf(quat, at, m) {
  let [w, x, y, z] = [quat[at], quat[at + 1], quat[at + 2], quat[at + 3]];
  const size = Math.hypot(w, x, y, z) || 1;
  w /= size; x /= size; y /= size; z /= size;
  m[0] = 1 - 2 * (y * y + z * z); m[1] = 2 * (x * y - w * z); m[2] = 2 * (x * z + w * y);
  m[3] = 2 * (x * y + w * z); m[4] = 1 - 2 * (x * x + z * z); m[5] = 2 * (y * z - w * x);
  m[6] = 2 * (x * z - w * y); m[7] = 2 * (y * z + w * x); m[8] = 1 - 2 * (x * x + y * y);
}

// Products of the axes b (9 from `at`) along right, up and back [pixels]: the shadow of an
// ellipsoid is {v: v S^-1 v <= 1} with S = [xx xy; xy yy], zz the square of its reach in depth.
function shadow(b, at, scene, s) {
  const { right, up, back, pixel } = scene;
  let xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;
  for (let j = 0; j < 3; j++) {
    const p = b[at + j], q = b[at + 3 + j], r = b[at + 6 + j];
    const a = p * right[0] + q * right[1] + r * right[2];
    const c = p * up[0] + q * up[1] + r * up[2];
    const d = p * back[0] + q * back[1] + r * back[2];
    xx += a * a; xy += a * c; yy += c * c; xz += a * d; yz += c * d; zz += d * d;
  }
  const f = pixel * pixel;
  s.xx = f * xx; s.xy = f * xy; s.yy = f * yy; s.xz = f * xz; s.yz = f * yz; s.zz = f * zz;
}

// Places on the screen of the grains that the window, the cut and the roles leave [pixels]: x, y,
// how far they reach sideways, and how near they come. `solid` is 1 where a grain is whole.
function project(grains, kind, scene) {
  const { n, x, place, outer } = grains, { right, up, back, target, pixel, plane } = scene;
  const rows = new Float32Array(5 * n), chosen = new Uint32Array(n), solid = new Uint8Array(n);
  const s = {}, slack = SLACK * scene.radius, [a, b, c, w] = plane.value;
  let count = 0;
  for (let k = 0; k < n; k++) {
    if (!(scene.roles & (1 << Math.min(kind[k], 3)))) continue;
    const i = 3 * k, p = place[i], q = place[i + 1], r = place[i + 2];
    let whole = 1;
    if (plane.cuts && scene.whole) {
      const above = a * x[i] + b * x[i + 1] + c * x[i + 2] - w;
      if (above > slack) continue;
      if (above > -slack) whole = 0;
    } else if (plane.cuts) {
      const above = a * p + b * q + c * r - w;
      const far = 1.01 * across(outer, 9 * k, plane.value) + slack;
      if (above > far) continue;
      if (above > -far) whole = 0;
    }
    const dx = p - target[0], dy = q - target[1], dz = r - target[2];
    const sx = 0.5 * scene.width + pixel * (dx * right[0] + dy * right[1] + dz * right[2]);
    const sy = 0.5 * scene.height + pixel * (dx * up[0] + dy * up[1] + dz * up[2]);
    const sz = pixel * (dx * back[0] + dy * back[1] + dz * back[2]);
    shadow(outer, 9 * k, scene, s);
    const wx = 1.002 * Math.sqrt(s.xx) + EDGE, wy = 1.002 * Math.sqrt(s.yy) + EDGE;
    if (sx + wx < 0 || sx - wx > scene.width || sy + wy < 0 || sy - wy > scene.height) continue;
    if (Math.abs(sz) > 1.8 * scene.radius * pixel) whole = 0; // near the ends of the depth
    const row = 5 * count;
    rows[row] = sx; rows[row + 1] = sy; rows[row + 2] = wx; rows[row + 3] = wy;
    rows[row + 4] = sz + Math.sqrt(s.zz);
    solid[count] = whole;
    chosen[count++] = k;
  }
  return { count, rows, chosen, solid };
}

// how far the ellipsoid of the axes b reaches along a direction
function across(b, at, way) {
  let sum = 0;
  for (let j = 0; j < 3; j++) {
    const one = b[at + j] * way[0] + b[at + 3 + j] * way[1] + b[at + 6 + j] * way[2];
    sum += one * one;
  }
  return Math.sqrt(sum);
}

// numbers of rows from the nearest to the farthest, to a 4096th of the depth
function nearestFirst(count, rows) {
  let low = Infinity, high = -Infinity;
  for (let k = 0; k < count; k++) {
    const near = rows[5 * k + 4];
    if (near < low) low = near;
    if (near > high) high = near;
  }
  const last = 4095, scale = last / Math.max(high - low, 1e-30);
  const starts = new Uint32Array(last + 2), order = new Uint32Array(count);
  const box = (k) => Math.floor((high - rows[5 * k + 4]) * scale);
  for (let k = 0; k < count; k++) starts[box(k) + 1]++;
  for (let k = 1; k < starts.length; k++) starts[k] += starts[k - 1];
  for (let k = 0; k < count; k++) order[starts[box(k)]++] = k;
  return order;
}

// A grid of cells over the window with the depth before which all of a cell is hidden.
function depthGrid(scene) {
  const { cell, width, height } = scene;
  const wide = Math.ceil(width / cell), high = Math.ceil(height / cell);
  return { cell, wide, high, depth: new Float32Array(wide * high).fill(-Infinity) };
}

// whether the rectangle of a row is hidden everywhere
function isHidden(grid, rows, at, slack) {
  const { cell, wide, high, depth } = grid, near = rows[at + 4] + slack;
  const x0 = Math.max(0, Math.floor((rows[at] - rows[at + 2]) / cell));
  const x1 = Math.min(wide - 1, Math.floor((rows[at] + rows[at + 2]) / cell));
  const y0 = Math.max(0, Math.floor((rows[at + 1] - rows[at + 3]) / cell));
  const y1 = Math.min(high - 1, Math.floor((rows[at + 1] + rows[at + 3]) / cell));
  for (let y = y0; y <= y1; y++)
    for (let k = y * wide + x0; k <= y * wide + x1; k++) if (!(depth[k] > near)) return false;
  return true;
}

// Enter what a grain hides for sure: cells that lie, with a margin of one pixel, in the shadow of
// its inner ellipsoid are hidden behind the plane of the shadow's rim.
function hide(grid, sx, sy, sz, s) {
  const { cell, wide, high, depth } = grid, det = s.xx * s.yy - s.xy * s.xy;
  if (!(det > 1e-6 * s.xx * s.yy)) return; // edge-on
  const gx = (s.yy * s.xz - s.xy * s.yz) / det, gy = (s.xx * s.yz - s.xy * s.xz) / det;
  const tall = Math.sqrt(s.yy), lean = s.xy / s.yy, half = Math.sqrt(det / s.yy);
  const least = sz - (Math.abs(gx) + Math.abs(gy)) * (0.5 * cell + EDGE);
  const y0 = Math.max(0, Math.ceil((sy - tall + EDGE) / cell));
  const y1 = Math.min(high, Math.floor((sy + tall - EDGE) / cell)) - 1;
  for (let y = y0; y <= y1; y++) {
    const v0 = (cell * y - EDGE - sy) / tall, v1 = (cell * (y + 1) + EDGE - sy) / tall;
    if (v0 <= -1 || v1 >= 1) continue;
    const h0 = half * Math.sqrt(1 - v0 * v0), h1 = half * Math.sqrt(1 - v1 * v1);
    const m0 = lean * tall * v0, m1 = lean * tall * v1;
    const from = Math.max(m0 - h0, m1 - h1) + EDGE, to = Math.min(m0 + h0, m1 + h1) - EDGE;
    const x0 = Math.max(0, Math.ceil((sx + from) / cell));
    const x1 = Math.min(wide, Math.floor((sx + to) / cell)) - 1;
    let here = least + gy * (cell * (y + 0.5) - sy) + gx * (cell * (x0 + 0.5) - sx);
    for (let k = y * wide + x0; k <= y * wide + x1; k++, here += gx * cell)
      if (depth[k] < here) depth[k] = here;
  }
}

// The grains that can be seen, nearest first. `scene`: right, up, back (unit vectors), target [m],
// radius [m], pixel [pixels a metre], width, height, cell [pixels], roles (bits), plane, whole.
function seenGrains(grains, kind, scene) {
  const { count, rows, chosen, solid } = project(grains, kind, scene);
  const order = nearestFirst(count, rows), grid = depthGrid(scene), s = {};
  const slack = 0.01 + SLACK * scene.radius * scene.pixel;
  const seen = new Uint32Array(count);
  let kept = 0;
  for (const k of order) {
    if (isHidden(grid, rows, 5 * k, slack)) continue;
    const grain = chosen[k];
    seen[kept++] = grain;
    if (!solid[k]) continue;
    const from = rows[5 * k + 4];
    shadow(grains.outer, 9 * grain, scene, s);
    const depth = from - Math.sqrt(s.zz);
    if (grains.inner !== grains.outer) shadow(grains.inner, 9 * grain, scene, s);
    hide(grid, rows[5 * k], rows[5 * k + 1], depth, s);
  }
  return seen.subarray(0, kept);
}
