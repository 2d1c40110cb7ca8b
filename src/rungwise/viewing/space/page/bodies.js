// Bodies as triangles in their own axes: solids of one body that are opaque go together.

const CREASE = Math.cos(40 * Math.PI / 180);  // edges that are sharper stay sharp
const ROUND = ["sphere", "ellipsoid", "capsule", "cylinder"];
const QUARTER = 0.8;  // brightness of every other quarter of a body that is one round solid: its turning is seen

// Corners of the triangles of a shape, three to a face, with their normals.
function cornersOf(shape, scale) {
  const places = unpack(shape.vertices), faces = new (shape.wide ? Uint32Array : Uint16Array)(bytes(shape.faces));
  for (let i = 0; i < places.length; i++) places[i] *= scale[i % 3];
  const at = v => [places[3 * v], places[3 * v + 1], places[3 * v + 2]], count = faces.length / 3;
  const wide = [], flat = [], first = new Uint32Array(places.length / 3 + 1), around = new Uint32Array(faces.length);
  for (let f = 0; f < count; f++) {
    const [a, b, c] = [0, 1, 2].map(k => at(faces[3 * f + k])), n = cross(minus(b, a), minus(c, a));
    wide.push(n); flat.push(unit(n));
  }
  for (const v of faces) first[v + 1]++;
  for (let v = 0; v + 1 < first.length; v++) first[v + 1] += first[v];
  const next = first.slice();
  faces.forEach((v, k) => { around[next[v]++] = Math.floor(k / 3); });
  const out = { places: new Float32Array(9 * count), normals: new Float32Array(9 * count) };
  faces.forEach((v, k) => {
    const own = flat[Math.floor(k / 3)];
    let n = [0, 0, 0];
    for (let j = first[v]; j < first[v + 1]; j++) if (dot(flat[around[j]], own) > CREASE) n = along(n, 1, wide[around[j]]);
    out.places.set(at(v), 3 * k); out.normals.set(unit(n), 3 * k);
  });
  return out;
}

const cornersKept = new Map();
function cornersOnce(solid) {
  const key = `${solid.shape} ${solid.scale}`;
  if (!cornersKept.has(key)) cornersKept.set(key, cornersOf(DATA.shapes[solid.shape], solid.scale));
  return cornersKept.get(key);
}

// A solid in the axes of its body.
function solidIn(solid, quartered) {
  const { places, normals } = cornersOnce(solid), m = posed([...solid.place, ...solid.turn]), count = places.length / 3;
  const out = { places: new Float32Array(3 * count), normals: new Float32Array(3 * count), colours: new Uint8Array(4 * count) };
  for (let k = 0; k < count; k++) {
    const own = places.subarray(3 * k, 3 * k + 3), n = normals.subarray(3 * k, 3 * k + 3), face = 9 * Math.floor(k / 3);
    out.places.set(times(m, own).slice(0, 3), 3 * k);
    out.normals.set([0, 1, 2].map(r => m[r] * n[0] + m[4 + r] * n[1] + m[8 + r] * n[2]), 3 * k);
    const middle = r => places[face + r] + places[face + 3 + r] + places[face + 6 + r];
    const dark = quartered && middle(0) * middle(1) * middle(2) < 0 ? QUARTER : 1;
    solid.colour.forEach((v, c) => { out.colours[4 * k + c] = Math.round(255 * v * (c < 3 ? dark : 1)); });
  }
  return out;
}

function joined(parts) {
  const out = {};
  for (const name of ["places", "normals", "colours"]) {
    const kind = parts[0][name].constructor, whole = new kind(parts.reduce((sum, part) => sum + part[name].length, 0));
    let at = 0;
    for (const part of parts) { whole.set(part[name], at); at += part[name].length; }
    out[name] = whole;
  }
  return out;
}

// What is drawn of each body: `opaque` and `clear` triangles, planes, and the box around them.
function castOf(gl, solids, count) {
  return Array.from({ length: count }, (_, body) => {
    const own = solids.filter(s => s.body === body), shaped = own.filter(s => s.kind !== "plane");
    const quartered = shaped.length === 1 && ROUND.includes(shaped[0].kind);
    const made = shaped.map(s => ({ clear: s.colour[3] < 0.999, part: solidIn(s, quartered) }));
    const drawn = clear => { const parts = made.filter(s => s.clear === clear).map(s => s.part); return parts.length ? uploaded(gl, joined(parts)) : null; };
    return { opaque: drawn(false), clear: drawn(true), planes: own.filter(s => s.kind === "plane").map(s => planeOf(gl, s)), ...reach(made.map(s => s.part)) };
  });
}

function reach(parts) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const { places } of parts) places.forEach((v, i) => { low[i % 3] = Math.min(low[i % 3], v); high[i % 3] = Math.max(high[i % 3], v); });
  return { low, high, middle: parts.length ? low.map((v, i) => (v + high[i]) / 2) : null };
}

// A plane ends where it is said to, or, without end, far from what is looked at.
function planeOf(gl, solid) {
  const m = posed([...solid.place, ...solid.turn]), far = 9 * view.radius, paint = solid.colour.map(v => Math.round(255 * v));
  const off = minus(DATA.low.map((v, i) => (v + DATA.high[i]) / 2), solid.place), endless = solid.size.map(s => s === 0);
  const middle = endless.map((e, i) => e ? dot([...m.slice(4 * i, 4 * i + 3)], off) : 0), [a, b] = solid.size.map(s => s || far);
  const at = [[-a, -b], [a, -b], [a, b], [-a, -b], [a, b], [-a, b]].map(([x, y]) => [x + middle[0], y + middle[1], 0]);
  return {
    m, middle, fade: endless[0] || endless[1] ? far : 0,
    ...uploaded(gl, { places: new Float32Array(at.flat()), normals: new Float32Array(at.flatMap(() => [0, 0, 1])), colours: new Uint8Array(at.flatMap(() => paint)) }),
  };
}
