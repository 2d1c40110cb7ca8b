// Vectors, and 4 by 4 matrices column by column, as WebGL has them.

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, s, d) => [a[0] + s * d[0], a[1] + s * d[1], a[2] + s * d[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };

function product(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
    out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
  return out;
}

// From a place and a turn (x y z, w x y z).
function posed([px, py, pz, w, x, y, z]) {
  return new Float32Array([
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, px, py, pz, 1]);
}

// A shape whose axis z is laid along a unit vector, from a place, as wide and as long as said.
function laid(place, axis, wide, long) {
  const [x, y] = across(axis);
  return new Float32Array([...x.map(v => v * wide), 0, ...y.map(v => v * wide), 0, ...axis.map(v => v * long), 0, ...place, 1]);
}

function across(axis) {
  const x = unit(cross(Math.abs(axis[0]) < 0.8 ? [1, 0, 0] : [0, 1, 0], axis));
  return [x, cross(axis, x)];
}

const times = (m, [x, y, z]) => [0, 1, 2, 3].map(r => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]);

// What an eye at a place sees that looks along -z of its axes x, y, z.
const seenFrom = (eye, [x, y, z]) => new Float32Array([
  x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);

function perspective(tan, aspect, near, far) {
  const out = new Float32Array(16);
  out[0] = 1 / (tan * aspect); out[5] = 1 / tan; out[10] = (far + near) / (near - far); out[11] = -1; out[14] = 2 * far * near / (near - far);
  return out;
}

// Parallel light on a ball.
function parallel(radius, near, far) {
  const out = new Float32Array(16);
  out[0] = out[5] = 1 / radius; out[10] = -2 / (far - near); out[14] = -(far + near) / (far - near); out[15] = 1;
  return out;
}
