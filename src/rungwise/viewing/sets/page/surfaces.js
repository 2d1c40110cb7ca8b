// Surfaces over three parameters: triangles into a depth buffer of our own, so that it needs no graphics card,
// and every pixel tells what is seen there. Surfaces that coincide are striped in their colours.

const eye = { yaw: -0.6, pitch: 0.45, zoom: 1, turned: false, settled: false, timer: 0 };
const NOTHING = 0, PLANE = 1, FIRST = 2;
const TOGETHER = Math.max(0.012, 1.5 * DATA.tol), BAND = 9;  // surfaces this near coincide; the width of a stripe
const raster = { width: 0, height: 0, depth: null, owner: null, sets: null, bright: null, image: null, canvas: document.createElement("canvas") };

function axesOf() {
  const cy = Math.cos(eye.yaw), sy = Math.sin(eye.yaw), cp = Math.cos(eye.pitch), sp = Math.sin(eye.pitch);
  return { right: [cy, sy, 0], up: [-sy * sp, cy * sp, cp], to: [sy * cp, -cy * cp, sp] };
}
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function cleared(width, height) {
  if (raster.width !== width || raster.height !== height) {
    Object.assign(raster, { width, height, depth: new Float32Array(width * height),
      owner: new Uint8Array(width * height), sets: new Uint32Array(width * height), bright: new Float32Array(width * height) });
    raster.canvas.width = width; raster.canvas.height = height;
    raster.image = raster.canvas.getContext("2d").createImageData(width, height);
    raster.pixels = new Uint32Array(raster.image.data.buffer);
  }
  raster.depth.fill(-Infinity); raster.owner.fill(NOTHING); raster.sets.fill(0); raster.pixels.fill(0);
}

const packed = (r, g, b) => (255 << 24 | b << 16 | g << 8 | r) >>> 0;

// A triangle of a mesh whose vertices are projected to x, y, z (depth) and c; pixels with c * side > limit are cut away.
function triangle({ x: X, y: Y, z: Z, c: C }, ia, ib, ic, shade, bit, side, limit) {
  const { width, height, depth, sets, bright } = raster;
  const ax = X[ia], ay = Y[ia], bx = X[ib] - ax, by = Y[ib] - ay, cx = X[ic] - ax, cy = Y[ic] - ay, area = bx * cy - by * cx;
  if (area === 0) return;
  const x0 = Math.max(0, Math.ceil(ax + Math.min(0, bx, cx) - 0.5)), x1 = Math.min(width - 1, Math.floor(ax + Math.max(0, bx, cx) - 0.5));
  const y0 = Math.max(0, Math.ceil(ay + Math.min(0, by, cy) - 0.5)), y1 = Math.min(height - 1, Math.floor(ay + Math.max(0, by, cy) - 0.5));
  const zb = Z[ib] - Z[ia], zc = Z[ic] - Z[ia], cb = C[ib] - C[ia], cc = C[ic] - C[ia];
  for (let y = y0; y <= y1; y++) for (let x = x0; x <= x1; x++) {
    const px = x + 0.5 - ax, py = y + 0.5 - ay, u = (px * cy - py * cx) / area, v = (bx * py - by * px) / area;
    if (u < -1e-6 || v < -1e-6 || u + v > 1 + 1e-6) continue;
    const z = Z[ia] + u * zb + v * zc, at = y * width + x;
    if (z < depth[at] - TOGETHER || side * (C[ia] + u * cb + v * cc) > limit) continue;
    sets[at] = z > depth[at] + TOGETHER ? bit : sets[at] | bit;
    if (z > depth[at]) { depth[at] = z; bright[at] = shade; }
  }
}

function project(p, look, scale, width, height) {
  return [width / 2 + scale * dot(p, look.right), height / 2 - scale * dot(p, look.up), dot(p, look.to)];
}

function paintSets(look, scale, cut) {
  const { width, height } = raster, axis = others()[0], level = chosen.point[axis] - 0.5, side = look.to[axis] >= 0 ? 1 : -1;
  const light = [0, 1, 2].map(k => 0.35 * look.right[k] + 0.5 * look.up[k] + 0.8 * look.to[k]);
  for (const set of visible()) {
    const { vertices: v, pieces, normals, spots } = set.mesh;
    for (let i = 0; i < spots.x.length; i++) {
      const p = v.subarray(3 * i, 3 * i + 3);
      spots.x[i] = width / 2 + scale * dot(p, look.right); spots.y[i] = height / 2 - scale * dot(p, look.up);
      spots.z[i] = dot(p, look.to); spots.c[i] = p[axis];
    }
    for (let t = 0; t < pieces.length; t += 3) {
      const bright = 0.5 + 0.5 * Math.min(1, Math.abs(dot(normals.subarray(t, t + 3), light)));
      triangle(spots, pieces[t], pieces[t + 1], pieces[t + 2], bright, 1 << set.index % 31, side, cut ? side * level + 1e-6 : Infinity);
    }
  }
  paintStripes();
  paintPlane(look, scale, axis, level, cut);
}

function paintStripes() {
  const { width, owner, sets, bright, pixels, dense } = raster, paints = SETS.map(set => rgb(set.colour())), band = BAND * dense;
  for (let at = 0; at < sets.length; at++) if (sets[at]) {
    let left = sets[at], many = 0;
    for (let bits = left; bits; bits &= bits - 1) many++;
    for (let skip = many > 1 ? Math.floor((at % width + Math.floor(at / width)) / band) % many : 0; skip; skip--) left &= left - 1;
    const index = 31 - Math.clz32(left & -left), shade = bright[at], [r, g, b] = paints[index];
    owner[at] = FIRST + index; pixels[at] = packed(r * shade, g * shade, b * shade);
  }
}

// The slice where it lies in the box: opaque where the set before it is cut away, else like glass.
function paintPlane(look, scale, axis, level, cut) {
  const { width, height, depth, owner, pixels } = raster, [p, q] = [0, 1, 2].filter(a => a !== axis);
  const det = look.right[p] * look.up[q] - look.right[q] * look.up[p];
  if (Math.abs(det) < 1e-3) return;
  const paints = DATA.labels.map((_, k) => rgb(labelColour(k))), set = sliced(), part = new Float64Array(3);
  part[axis] = level + 0.5;
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) {
    const s = (x + 0.5 - width / 2) / scale - level * look.right[axis], t = (height / 2 - y - 0.5) / scale - level * look.up[axis];
    part[p] = (s * look.up[q] - t * look.right[q]) / det + 0.5; part[q] = (t * look.right[p] - s * look.up[p]) / det + 0.5;
    if (!(part[p] >= 0 && part[p] <= 1 && part[q] >= 0 && part[q] <= 1)) continue;
    const at = y * width + x, z = (part[p] - 0.5) * look.to[p] + (part[q] - 0.5) * look.to[q] + level * look.to[axis];
    if (z <= depth[at] - (cut ? 0.004 : 0)) continue;
    const c = paints[labelAt(set, part)], old = pixels[at];
    if (cut) { pixels[at] = packed(...c); owner[at] = PLANE; depth[at] = z; } else {
      const under = old ? [old & 255, old >> 8 & 255, old >> 16 & 255] : rgb(colours.page);
      pixels[at] = packed(...c.map((value, k) => 0.4 * value + 0.6 * under[k]));
      if (owner[at] === NOTHING) { owner[at] = PLANE; depth[at] = z; }
    }
  }
}

const CORNERS = [...Array(8).keys()].map(k => [k & 4 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5, k & 1 ? 0.5 : -0.5]);

function drawSpace(fine) {
  const canvas = $("space"), [width, height, ratio] = fitted(canvas), g = canvas.getContext("2d"), look = axesOf();
  const scale = 0.52 * Math.min(width, height) * eye.zoom, dense = fine ? Math.max(2, ratio) : 1;
  const spot = p => project(p, look, scale, width, height);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = colours.page; g.fillRect(0, 0, width, height);
  const hidden = CORNERS.reduce((least, c, k) => dot(c, look.to) < dot(CORNERS[least], look.to) ? k : least, 0);
  drawFrame(g, spot, 7 - hidden, false, colours.line);
  cleared(Math.round(width * dense), Math.round(height * dense));
  raster.dense = dense;
  paintSets(look, scale * dense, $("cut").checked);
  raster.canvas.getContext("2d").putImageData(raster.image, 0, 0);
  g.imageSmoothingEnabled = true; g.imageSmoothingQuality = "high";
  g.drawImage(raster.canvas, 0, 0, width, height);
  raster.seen = { look, scale, dense, width, height };
  drawFrame(g, spot, 7 - hidden, true, colours.faint);
  nameAxes(g, spot, look, hidden);
  cross(g, ...spot([...chosen.point].map(x => x - 0.5)));
}

// Edges of the box that end in the corner nearest to the eye, or all others.
function drawFrame(g, spot, front, before, line) {
  g.strokeStyle = line; g.lineWidth = 1; g.beginPath();
  for (let k = 0; k < 8; k++) for (const bit of [1, 2, 4]) {
    if (k & bit || (k === front || (k | bit) === front) !== before) continue;
    g.moveTo(...spot(CORNERS[k]).slice(0, 2)); g.lineTo(...spot(CORNERS[k | bit]).slice(0, 2));
  }
  g.stroke();
}

// Names and ends of the axes along the lowest or outermost edges of the box as it is seen.
function nameAxes(g, spot, look, hidden) {
  g.strokeStyle = colours.faint; g.fillStyle = colours.ink; g.font = "13px system-ui, sans-serif"; g.textBaseline = "middle";
  const middle = spot([0, 0, 0]);
  for (let axis = 0; axis < 3; axis++) {
    const bit = [4, 2, 1][axis];
    let best = null;
    for (let k = 0; k < 8; k++) {
      if (k & bit || k === hidden || (k | bit) === hidden || k === 7 - hidden || (k | bit) === 7 - hidden) continue;
      const a = spot(CORNERS[k]), b = spot(CORNERS[k | bit]), y = (a[1] + b[1]) / 2, x = (a[0] + b[0]) / 2;
      const worth = axis === 2 ? -x : y;
      if (!best || worth > best.worth) best = { a, b, x, y, worth };
    }
    const { a, b, x, y } = best;
    g.beginPath(); g.moveTo(a[0], a[1]); g.lineTo(b[0], b[1]); g.stroke();
    const out = Math.hypot(x - middle[0], y - middle[1]) || 1, ox = 22 * (x - middle[0]) / out, oy = 18 * (y - middle[1]) / out;
    g.textAlign = ox < -4 ? "right" : ox > 4 ? "left" : "center";
    const o = DATA.over[axis];
    g.fillStyle = colours.ink; g.fillText(titleOf(axis), x + ox, y + oy);
    g.fillStyle = colours.faint;
    for (const [end, value] of [[a, o.low], [b, o.high]]) g.fillText(short(rounded(value, o)), end[0] * 0.94 + x * 0.06 + 0.5 * ox, end[1] * 0.94 + y * 0.06 + 0.7 * oy);
  }
}

// The point of the box that is seen at a place of the canvas, or none.
function pick(x, y) {
  const { look, scale, dense, width, height } = raster.seen, column = Math.floor(x * dense), row = Math.floor(y * dense);
  const at = row * raster.width + column;
  if (column < 0 || row < 0 || column >= raster.width || row >= raster.height || raster.owner[at] === NOTHING) return null;
  const owner = raster.owner[at], z = raster.depth[at];
  const s = (x - width / 2) / scale, t = (height / 2 - y) / scale;
  const part = [0, 1, 2].map(k => Math.min(1, Math.max(0, 0.5 + s * look.right[k] + t * look.up[k] + z * look.to[k])));
  return { part, set: owner >= FIRST ? owner - FIRST : null };
}
