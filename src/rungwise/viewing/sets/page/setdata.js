// Sets over a box, on a grid of labels; the runs that are stored, and the point that is chosen.

const D = DATA.over.length, N = DATA.cells;
const CLIPS = DATA.clips.map((c, i) => clipOf(
  { ...c, label: DATA.sets[i % DATA.sets.length].name, bodies: structuredClone(DATA.bodies[c.bodies]) }, i % DATA.sets.length));
const SETS = DATA.sets.map((set, index) => ({
  ...set, index, visible: true, labels: unroll(set.grid), mesh: set.mesh && meshOf(set.mesh),
  colour: () => css(`--model-${index % PALETTE.length}`),
}));
// `point` holds parts 0..1 of the box, `across` and `up` the axes of the slice, which shows the set in front.
const chosen = { point: Float64Array.from(DATA.opening.at), across: 0, up: D > 1 ? 1 : -1, run: -1, alike: 0 };
const sliced = () => SETS[layout.front];

const visible = () => SETS.filter(s => s.visible);
const runsOf = row => row < 0 ? [] : CLIPS.slice(row * SETS.length, (row + 1) * SETS.length);
const shown = () => runsOf(chosen.run).filter((_, i) => SETS[i].visible);
const others = () => [...DATA.over.keys()].filter(a => a !== chosen.across && a !== chosen.up);

// Labels of all cells, the last axis fastest, from runs of equal ones.
function unroll(grid) {
  const labels = new Uint8Array(bytes(grid.labels)), counts = new Uint16Array(bytes(grid.counts)), out = new Uint8Array(N ** D);
  let at = 0;
  for (let i = 0; i < labels.length; i++) { out.fill(labels[i], at, at + counts[i]); at += counts[i]; }
  return out;
}

// Vertices in parts of the box around its middle, with room for where they are seen; pieces; normals of triangles.
function meshOf(packed) {
  const vertices = unpack(packed.vertices), pieces = new Uint32Array(bytes(packed.pieces)), normals = new Float32Array(D === 3 ? pieces.length : 0);
  for (let t = 0; t < normals.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map(k => 3 * pieces[t + k]), e = k => vertices[b + k] - vertices[a + k], f = k => vertices[c + k] - vertices[a + k];
    const n = [e(1) * f(2) - e(2) * f(1), e(2) * f(0) - e(0) * f(2), e(0) * f(1) - e(1) * f(0)], size = Math.hypot(...n) || 1;
    normals.set(n.map(x => x / size), t);
  }
  const column = () => new Float32Array(vertices.length / D);
  return { vertices, pieces, normals, spots: { x: column(), y: column(), z: column(), c: column() } };
}

const cellOf = part => Math.min(N - 1, Math.max(0, Math.floor(part * N)));
function labelAt(set, point) {
  let at = 0;
  for (let a = 0; a < D; a++) at = at * N + cellOf(point[a]);
  return set.labels[at];
}

// Values of a point, rounded as far as the commands print them.
const values = point => DATA.over.map((o, a) => +(o.low + point[a] * (o.high - o.low)).toPrecision(6));
const partOf = (axis, value) => (value - DATA.over[axis].low) / (DATA.over[axis].high - DATA.over[axis].low);

function distance(a, b) {
  let sum = 0;
  for (let i = 0; i < D; i++) sum += (a[i] - b[i]) ** 2;
  return Math.sqrt(sum);
}

// The nearest stored point among those where all models end as here, else where the chosen one does, else of all.
const ALIKE = ["at which every model ends as here", `at which the model of the slice ends as here`, "(none ends as here)"];
function nearest(point) {
  const here = SETS.map(s => labelAt(s, point));
  const tests = [row => row.labels.every((label, s) => label === here[s]),
    row => row.labels[layout.front] === here[layout.front], () => true];
  for (const [alike, test] of tests.entries()) {
    let run = -1, least = Infinity;
    DATA.runs.forEach((row, i) => {
      const d = test(row) ? distance(row.at, point) : Infinity;
      if (d < least) { least = d; run = i; }
    });
    if (run >= 0) return { run, alike };
  }
  return { run: -1, alike: 2 };
}

const labelColour = k => css(`--${DATA.labels[k]}`) || css("--unknown");
const rgb = text => [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16));
