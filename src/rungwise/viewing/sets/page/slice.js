// A slice: the labels of one model over two parameters, where the feasible part of each model ends, and where the labels
// of the models differ.

const STRIPE = 8, LINE = 3.2, HATCH = 9;
const LEFT = 62, BELOW = 46, RIGHT = 14, ABOVE = 12;
const sheet = document.createElement("canvas");

const titleOf = axis => DATA.over[axis].unit ? `${DATA.over[axis].name} [${DATA.over[axis].unit}]` : DATA.over[axis].name;

// An end of an axis that is zero but for a millionth of its length.
const rounded = (x, { low, high }) => Math.abs(x) < 2e-6 * (high - low) ? 0 : x;

// Labels (N across, N up; one row if there is nothing up) of a set at the chosen values of the other parameters.
function labelsOfSlice(set) {
  const rows = chosen.up < 0 ? 1 : N, out = new Uint8Array(N * rows), part = Float64Array.from(chosen.point);
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++) {
    part[chosen.across] = (i + 0.5) / N;
    if (chosen.up >= 0) part[chosen.up] = (j + 0.5) / N;
    out[j * N + i] = labelAt(set, part);
  }
  return out;
}

function boxOfSlice() {
  const box = $("slice").getBoundingClientRect();
  return { x: LEFT, y: ABOVE, width: box.width - LEFT - RIGHT, height: box.height - ABOVE - BELOW };
}

function drawSlice() {
  const [width, height, ratio] = fitted($("slice")), g = $("slice").getContext("2d"), b = boxOfSlice();
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = colours.page; g.fillRect(0, 0, width, height);
  const many = visible(), labels = new Map([...many, sliced()].map(set => [set, labelsOfSlice(set)]));
  const own = labels.get(sliced()), rows = own.length / N;
  sheet.width = N; sheet.height = rows;
  const image = sheet.getContext("2d").createImageData(N, rows), paints = DATA.labels.map((_, k) => rgb(labelColour(k)));
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++)
    image.data.set([...paints[own[j * N + i]], 255], 4 * ((rows - 1 - j) * N + i));
  sheet.getContext("2d").putImageData(image, 0, 0);
  g.imageSmoothingEnabled = false;
  g.drawImage(sheet, b.x, b.y, b.width, b.height);
  const differ = k => many.some(set => labels.get(set)[k] !== labels.get(many[0])[k]);
  hatch(g, b, Array.from({ length: own.length }, (_, k) => differ(k)), rows);
  const pathOf = set => set.mesh ? contour(b, set.mesh) : outline(b, labels.get(set), rows);
  striped(g, width, height, ratio, many.map(set => ({ ...pathOf(set), colour: set.colour() })));
  g.strokeStyle = colours.faint; g.lineWidth = 1; g.strokeRect(b.x, b.y, b.width, b.height);
  ticks(g, b);
  drawPoints(g, b);
}

// Hatching over the cells that are marked.
function hatch(g, b, marked, rows) {
  if (!marked.includes(true)) return;
  const X = i => b.x + b.width * i / N, Y = j => b.y + b.height * (1 - j / rows);
  g.save();
  g.beginPath();
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++) if (marked[j * N + i]) {
    let end = i; while (end < N && marked[j * N + end]) end++;
    g.rect(X(i), Y(j + 1), X(end) - X(i), Y(j) - Y(j + 1)); i = end;
  }
  g.clip();
  g.fillStyle = colours.page; g.globalAlpha = 0.35; g.fill(); g.globalAlpha = 1;
  hatchLines(g, b.x, b.y, b.width, b.height);
  g.restore();
}

function hatchLines(g, x, y, width, height) {
  g.strokeStyle = colours.ink; g.lineWidth = 1.4; g.beginPath();
  for (let d = -height; d < width; d += HATCH) { g.moveTo(x + d, y + height); g.lineTo(x + d + height, y); }
  g.stroke();
}

// Lines that tell themselves apart where they coincide: what several cover is striped in their colours, along x where the
// line runs across and along y where it runs up.
function striped(g, width, height, ratio, lines) {
  const w = Math.round(width * ratio), h = Math.round(height * ratio), canvas = document.createElement("canvas");
  if (!lines.length) return;
  canvas.width = w; canvas.height = h;
  const mask = canvas.getContext("2d", { willReadFrequently: true }), cover = new Uint32Array(w * h), steep = new Uint8Array(w * h);
  mask.setTransform(ratio, 0, 0, ratio, 0, 0); mask.lineWidth = LINE; mask.lineCap = "round";
  lines.forEach(({ flat, up }, k) => {
    mask.clearRect(0, 0, width, height);
    mask.strokeStyle = "#000"; mask.stroke(flat);
    mask.strokeStyle = "#f00"; mask.stroke(up);
    const seen = mask.getImageData(0, 0, w, h).data;
    for (let i = 0; i < cover.length; i++) if (seen[4 * i + 3] > 100) {
      if (!cover[i]) steep[i] = seen[4 * i] > 127 ? 1 : 0;
      cover[i] |= 1 << k % 31;
    }
  });
  const image = mask.createImageData(w, h), paints = lines.map(line => rgb(line.colour)), size = Math.round(STRIPE * ratio);
  for (let i = 0; i < cover.length; i++) if (cover[i]) {
    const some = paints.filter((_, k) => cover[i] & 1 << k % 31), along = steep[i] ? Math.floor(i / w) : i % w;
    image.data.set([...some[Math.floor(along / size) % some.length], 255], 4 * i);
  }
  g.strokeStyle = colours.page; g.lineWidth = LINE + 3; g.lineCap = "round";
  for (const { flat, up } of lines) { g.stroke(flat); g.stroke(up); }
  mask.putImageData(image, 0, 0);
  g.drawImage(canvas, 0, 0, width, height);
}

// Segments of a line, those that run rather across and those that run rather up.
function segments() {
  const paths = { flat: new Path2D(), up: new Path2D() };
  return { ...paths, add: ([x0, y0], [x1, y1]) => {
    const path = Math.abs(x1 - x0) > Math.abs(y1 - y0) ? paths.flat : paths.up;
    path.moveTo(x0, y0); path.lineTo(x1, y1);
  } };
}

// Where a mesh meets the slice.
function contour(b, { vertices, pieces }) {
  const line = segments(), axis = others()[0], level = chosen.point[axis] - 0.5;
  const spot = p => [b.x + b.width * (p[chosen.across] + 0.5), b.y + b.height * (0.5 - p[chosen.up])];
  const vertex = i => vertices.subarray(D * i, D * i + D);
  for (let t = 0; t < pieces.length; t += D) {
    if (D === 2) { line.add(spot(vertex(pieces[t])), spot(vertex(pieces[t + 1]))); continue; }
    const ends = [];
    for (let k = 0; k < 3; k++) {
      const p = vertex(pieces[t + k]), q = vertex(pieces[t + (k + 1) % 3]);
      if ((p[axis] > level) === (q[axis] > level)) continue;
      const s = (level - p[axis]) / (q[axis] - p[axis]);
      ends.push(spot(p.map((x, i) => x + s * (q[i] - x))));
    }
    if (ends.length === 2) line.add(...ends);
  }
  return line;
}

// Sides of cells between feasible and not, of sets that have no mesh.
function outline(b, labels, rows) {
  const line = segments(), feasible = k => labels[k] === DATA.feasible, X = i => b.x + b.width * i / N, Y = j => b.y + b.height * (1 - j / rows);
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++) {
    const k = j * N + i, here = feasible(k);
    if (i + 1 < N && here !== feasible(k + 1)) line.add([X(i + 1), Y(j)], [X(i + 1), Y(j + 1)]);
    if (j + 1 < rows && here !== feasible(k + N)) line.add([X(i), Y(j + 1)], [X(i + 1), Y(j + 1)]);
  }
  return line;
}

function stepOf(range) {
  const rough = range / 5, power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find(m => m * power >= rough) * power;
}

function ticks(g, b) {
  g.font = "12px system-ui, sans-serif"; g.fillStyle = colours.ink; g.strokeStyle = colours.faint;
  const along = (axis, place) => {
    const { low, high } = DATA.over[axis], step = stepOf(high - low);
    for (let n = Math.ceil(low / step); n * step <= high * (1 + 1e-12); n++) place((n * step - low) / (high - low), short(+(n * step).toPrecision(9)));
  };
  g.textAlign = "center"; g.textBaseline = "top";
  along(chosen.across, (part, text) => { const x = b.x + part * b.width; line(g, x, b.y + b.height, x, b.y + b.height + 4); g.fillText(text, x, b.y + b.height + 7); });
  g.fillText(titleOf(chosen.across), b.x + b.width / 2, b.y + b.height + 25);
  if (chosen.up < 0) return;
  g.textAlign = "right"; g.textBaseline = "middle";
  along(chosen.up, (part, text) => { const y = b.y + (1 - part) * b.height; line(g, b.x - 4, y, b.x, y); g.fillText(text, b.x - 7, y); });
  g.save(); g.translate(13, b.y + b.height / 2); g.rotate(-Math.PI / 2); g.textAlign = "center"; g.fillText(titleOf(chosen.up), 0, 0); g.restore();
}

function line(g, x0, y0, x1, y1) { g.beginPath(); g.moveTo(x0, y0); g.lineTo(x1, y1); g.stroke(); }

const placeOf = (b, part) => [b.x + b.width * part[chosen.across], b.y + b.height * (chosen.up < 0 ? 0.5 : 1 - part[chosen.up])];

// The chosen point as a cross; the stored runs as dots, that of the animation as a ring.
function drawPoints(g, b) {
  DATA.runs.forEach((row, i) => runSpot(g, ...placeOf(b, row.at), i === chosen.run));
  cross(g, ...placeOf(b, chosen.point));
}

function runSpot(g, x, y, now) {
  g.beginPath(); g.arc(x, y, now ? 7 : 2, 0, 2 * Math.PI);
  g.lineWidth = now ? 5 : 2; g.strokeStyle = colours.page; g.stroke();
  g.lineWidth = now ? 2 : 1; g.strokeStyle = colours.ink; g.stroke();
}

function cross(g, x, y) {
  for (const [wide, colour] of [[5, colours.page], [2, colours.ink]]) {
    g.strokeStyle = colour; g.lineWidth = wide; g.lineCap = "butt";
    line(g, x - 9, y, x + 9, y); line(g, x, y - 9, x, y + 9);
  }
}

// Parts 0..1 of the box at a place of the canvas, held within the slice.
function partsAt(x, y) {
  const b = boxOfSlice(), part = Float64Array.from(chosen.point), within = t => Math.min(1, Math.max(0, t));
  part[chosen.across] = within((x - b.x) / b.width);
  if (chosen.up >= 0) part[chosen.up] = within(1 - (y - b.y) / b.height);
  return part;
}
