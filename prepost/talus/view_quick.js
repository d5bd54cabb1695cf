"use strict";
// Grains as ellipsoids on the screen, for quick pictures: the numbers of the point shader, in
// pixels of the picture. Of poly-ellipsoids and superquadrics it is one of the same mean axes.

const WORDS = 11; // x, y, z, size of the point; the shadow Q (3); the tilt (2), the depth; colour

const STEP = 0.15; // radians between directions from which grains are sought

// the direction of a net over the sphere that is nearest to a camera's, or nearly
function nearestWay({ yaw, pitch }) {
  const row = Math.round(pitch / STEP) * STEP, turn = STEP / Math.max(Math.cos(row), STEP);
  const around = Math.round((2 * Math.PI) / turn);
  const number = Math.round((yaw / (2 * Math.PI)) * around) % around;
  return { yaw: (2 * Math.PI * ((number + around) % around)) / around, pitch: row };
}

// `list` of grains as rows of WORDS numbers; `colour(grain)` is the number 256 (256 b + g) + r
function impostors(grains, list, scene, colour) {
  const { right, up, back, target, pixel } = scene, { body, middle } = grains;
  const rows = new Float32Array(WORDS * list.length), paint = new Uint32Array(rows.buffer), s = {};
  for (let k = 0; k < list.length; k++) {
    const grain = list[k], at = WORDS * k, i = 3 * grain;
    const dx = middle[i] - target[0], dy = middle[i + 1] - target[1];
    const dz = middle[i + 2] - target[2];
    shadow(body, 9 * grain, scene, s);
    const det = Math.max(s.xx * s.yy - s.xy * s.xy, 1e-9 * s.xx * s.yy);
    const gx = (s.yy * s.xz - s.xy * s.yz) / det, gy = (s.xx * s.yz - s.xy * s.xz) / det;
    rows[at] = 0.5 * scene.width + pixel * (dx * right[0] + dy * right[1] + dz * right[2]);
    rows[at + 1] = 0.5 * scene.height + pixel * (dx * up[0] + dy * up[1] + dz * up[2]);
    rows[at + 2] = pixel * (dx * back[0] + dy * back[1] + dz * back[2]);
    rows[at + 3] = 2 * Math.sqrt(Math.max(s.xx, s.yy)) + 1;
    rows[at + 4] = s.yy / det; rows[at + 5] = -s.xy / det; rows[at + 6] = s.xx / det;
    rows[at + 7] = gx; rows[at + 8] = gy;
    rows[at + 9] = Math.sqrt(Math.max(s.zz - gx * s.xz - gy * s.yz, 0));
    paint[at + 10] = colour(grain);
  }
  return rows;
}

// the plane of a cut for places (x, y, z) [pixels] on the screen: normal, and the product there
function cutOnScreen(plane, scene) {
  const [a, b, c, w] = plane, { right, up, back, target, pixel } = scene;
  const along = (v) => a * v[0] + b * v[1] + c * v[2];
  const n = [along(right), along(up), along(back)];
  const start = 0.5 * (n[0] * scene.width + n[1] * scene.height);
  return [...n, pixel * (w - along(target)) + start];
}
