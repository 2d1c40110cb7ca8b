// A slice: the labels of one model over two parameters, and where the feasible part of each model ends.

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
  const labels = labelsOfSlice(SETS[chosen.model]), rows = labels.length / N;
  sheet.width = N; sheet.height = rows;
  const image = sheet.getContext("2d").createImageData(N, rows), paints = DATA.labels.map((_, k) => rgb(labelColour(k)));
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++)
    image.data.set([...paints[labels[j * N + i]], 255], 4 * ((rows - 1 - j) * N + i));
  sheet.getContext("2d").putImageData(image, 0, 0);
  g.imageSmoothingEnabled = false;
  g.drawImage(sheet, b.x, b.y, b.width, b.height);
  const many = visible();
  many.forEach((set, k) => {
    g.strokeStyle = set.colour(); g.lineWidth = 1.6 + 1.6 * (many.length - 1 - k); g.lineCap = "round"; g.beginPath();
    if (set.mesh) contour(g, b, set.mesh); else outline(g, b, labelsOfSlice(set), rows);
    g.stroke();
  });
  g.strokeStyle = colours.faint; g.lineWidth = 1; g.strokeRect(b.x, b.y, b.width, b.height);
  ticks(g, b);
  drawPoints(g, b);
}

// Where a mesh meets the slice; the first model has the widest line, so that all are seen.
function contour(g, b, { vertices, pieces }) {
  const axis = others()[0], level = chosen.point[axis] - 0.5;
  const spot = p => [b.x + b.width * (p[chosen.across] + 0.5), b.y + b.height * (0.5 - p[chosen.up])];
  const vertex = i => vertices.subarray(D * i, D * i + D);
  for (let t = 0; t < pieces.length; t += D) {
    if (D === 2) { g.moveTo(...spot(vertex(pieces[t]))); g.lineTo(...spot(vertex(pieces[t + 1]))); continue; }
    const ends = [];
    for (let k = 0; k < 3; k++) {
      const p = vertex(pieces[t + k]), q = vertex(pieces[t + (k + 1) % 3]);
      if ((p[axis] > level) === (q[axis] > level)) continue;
      const s = (level - p[axis]) / (q[axis] - p[axis]);
      ends.push(spot(p.map((x, i) => x + s * (q[i] - x))));
    }
    if (ends.length === 2) { g.moveTo(...ends[0]); g.lineTo(...ends[1]); }
  }
}

// Sides of cells between feasible and not, of sets that have no mesh.
function outline(g, b, labels, rows) {
  const feasible = k => labels[k] === DATA.feasible, X = i => b.x + b.width * i / N, Y = j => b.y + b.height * (1 - j / rows);
  for (let j = 0; j < rows; j++) for (let i = 0; i < N; i++) {
    const k = j * N + i, here = feasible(k);
    if (i + 1 < N && here !== feasible(k + 1)) { g.moveTo(X(i + 1), Y(j)); g.lineTo(X(i + 1), Y(j + 1)); }
    if (j + 1 < rows && here !== feasible(k + N)) { g.moveTo(X(i), Y(j + 1)); g.lineTo(X(i + 1), Y(j + 1)); }
  }
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

// The chosen point as a cross; the stored runs as dots, that of the animation as a ring; other values are not told apart.
function drawPoints(g, b) {
  DATA.runs.forEach((row, i) => {
    const [x, y] = placeOf(b, row.at), now = i === chosen.run;
    g.beginPath(); g.arc(x, y, now ? 7 : 2, 0, 2 * Math.PI);
    g.lineWidth = now ? 5 : 2; g.strokeStyle = colours.page; g.stroke();
    g.lineWidth = now ? 2 : 1; g.strokeStyle = colours.ink; g.stroke();
  });
  cross(g, ...placeOf(b, chosen.point));
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
