"use strict";
// The shaders of the view (WebGL2): grains by rays through their pixels, triangles, tubes.

const ROW = 2048; // grains in a row of the textures that hold them, one texel a grain
const COMMON = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform mat4 toScreen; uniform vec4 plane; uniform vec3 eye; uniform vec3 colour;
uniform sampler2D map; uniform float opaque; uniform bool mapped;
vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }`;

// A grain by its number: false where its role is not shown or a cut takes it away as a whole.
// `reach` is the support function of its shape (eq. D.12, sharp).
const LOOK_UP = COMMON + `
precision highp isampler2D; precision highp usampler2D;
uniform sampler2D places, values, shapes; uniform isampler2D quats; uniform usampler2D numbers;
uniform int roles; uniform vec3 right, up; uniform vec3 roleColours[4]; uniform bool whole;
flat out vec3 way, tint; flat out vec4 upper, lower, quat;
float reach(vec3 u) {
  vec3 a = abs(u) * mix(lower.xyz, upper.xyz, vec3(greaterThanEqual(u, vec3(0.0))));
  if (upper.w <= 2.0) return length(a);
  float q = upper.w / (upper.w - 1.0), most = max(max(a.x, a.y), a.z);
  return most * pow(dot(pow(max(a / most, 1e-6), vec3(q)), vec3(1.0)), 1.0 / q);
}
bool lookUp(int grain, out vec4 centre, out vec3 middle) {
  ivec2 cell = ivec2(grain % ${ROW}, grain / ${ROW});
  centre = texelFetch(places, cell, 0);
  int role = int(min(centre.w, 3.0));
  if ((roles & (1 << role)) == 0 || (whole && dot(plane.xyz, centre.xyz) > plane.w)) return false;
  int width = textureSize(shapes, 0).x, at = int(texelFetch(numbers, cell, 0).r) * 3;
  upper = texelFetch(shapes, ivec2(at % width, at / width), 0);
  lower = texelFetch(shapes, ivec2((at + 1) % width, (at + 1) / width), 0);
  middle = texelFetch(shapes, ivec2((at + 2) % width, (at + 2) / width), 0).xyz;
  quat = normalize(vec4(texelFetch(quats, cell, 0)));
  float value = texelFetch(values, cell, 0).r;
  tint = mapped ? texture(map, vec2((value * 255.0 + 0.5) / 256.0, 0.5)).rgb : roleColours[role];
  return true;
}`;

// The rectangle that a grain fills on the screen, through the origin of its shape.
const GRAIN_VERTEX = LOOK_UP + `
out vec3 place, own;
void main() {
  vec4 centre; vec3 middle;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (!lookUp(gl_VertexID / 6, centre, middle)) return;
  int corner = gl_VertexID % 6;
  vec4 back = vec4(quat.x, -quat.yzw);
  bvec2 far = bvec2(corner == 1 || corner == 2 || corner == 4, corner >= 2 && corner != 3);
  vec3 r = turn(back, far.x ? right : -right), u = turn(back, far.y ? up : -up);
  way = turn(back, -eye);
  own = 1.001 * (r * reach(r) + u * reach(u));
  lower.w = reach(-way);
  place = centre.xyz + turn(quat, own - middle);
  gl_Position = toScreen * vec4(place, 1.0);
}`;

// While something moves a grain is a point, one vertex instead of four, and an ellipsoid, which
// view_quick.js has projected. Lengths are pixels, v is measured from the middle of the grain:
// its shadow is v Q v <= 1, its surface lies `tilt` v + `deep` sqrt(1 - v Q v) before the middle.
const POINT_VERTEX = `#version 300 es
precision highp float;
layout(location=0) in vec4 at; layout(location=1) in vec3 form; layout(location=2) in vec3 lean;
layout(location=3) in vec3 paint;
uniform vec2 size; uniform float depth;
flat out vec3 spot, shadow, tilt, tint;
void main() {
  spot = at.xyz; shadow = form; tilt = lean; tint = paint;
  gl_Position = vec4(2.0 * at.xy / size - 1.0, -depth * at.z, 1.0);
  gl_PointSize = at.w;
}`;
const POINT_FRAGMENT = (cuts) => `#version 300 es
precision highp float;
uniform float depth; uniform vec3 lamp; uniform vec4 cut;
flat in vec3 spot, shadow, tilt, tint; out vec4 paint;
void main() {
  vec2 v = gl_FragCoord.xy - spot.xy, down = shadow.xz * v + shadow.y * v.yx;
  float left = 1.0 - dot(v, down);
  if (left < 0.0) discard;
  float root = sqrt(left), mid = spot.z + dot(tilt.xy, v), z = mid + tilt.z * root;
  vec3 side = normalize(vec3(tilt.z * down - tilt.xy * root, root));
  float light = 0.45 + 0.5 * max(dot(side, lamp), 0.0);
  ${cuts ? POINT_CUT : ""}
  paint = vec4(tint * light * 1.05, 1.0);
  gl_FragDepth = 0.5 - 0.5 * depth * z;
}`;
const POINT_CUT = `float above = dot(cut.xyz, vec3(gl_FragCoord.xy, z)) - cut.w;
  if (above > 0.0) {
    if (cut.z <= 0.0) discard;
    z -= above / cut.z;
    if (z < mid - tilt.z * root) discard;
    light = 0.62;
  }`;

// Where the ray of a pixel meets the grain first: a root of a quadratic for an ellipsoid. For
// others the norm of the shape is convex along the ray, so that Newton's method from before the
// grain never passes the surface. A cut shows the inside flat.
const RAY = COMMON + `
uniform bool cuts; flat in vec3 way, tint; flat in vec4 upper, lower, quat;
out vec4 paint;
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
float first(vec3 own, out vec3 slope) {
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
void follow(vec3 place, vec3 own) {
  vec3 slope;
  float t = first(own, slope);
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

const GRAIN_FRAGMENT = RAY + `
in vec3 place, own;
void main() { follow(place, own); }`;

// a picture made elsewhere, pixel by pixel
const COPY_VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;
const COPY_FRAGMENT = `#version 300 es
precision highp float; uniform highp sampler2D map; out vec4 paint;
void main() { paint = texelFetch(map, ivec2(gl_FragCoord.xy), 0); }`;

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

