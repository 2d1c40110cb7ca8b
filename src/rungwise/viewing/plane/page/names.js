// Texts beside bodies: where they hide no body, no contact and no other text.

const WAYS = 16, STEP = 5, FARTHEST = 90, TALL = 16, CELL = 4, CLEAR = 3, SOFT = 1 << 30, MOST_NAMES = 24;
const IN_THE_WAY = 1000;

// How far a point of the body's frame is outside a shape; not positive inside.
function outside(shape, x, y) {
  const v = shape.vertices, n = shape.normals;
  if (shape.halfplane) return n[0][0] * (x - v[0][0]) + n[0][1] * (y - v[0][1]);
  let inside = v.length > 2, least = Infinity;
  v.forEach((a, i) => {
    const b = v[(i + 1) % v.length], ux = b[0] - a[0], uy = b[1] - a[1], dx = x - a[0], dy = y - a[1];
    const part = Math.min(1, Math.max(0, (dx * ux + dy * uy) / (ux * ux + uy * uy || 1)));
    least = Math.min(least, Math.hypot(dx - part * ux, dy - part * uy));
    if (n.length && n[i][0] * dx + n[i][1] * dy > 0) inside = false;
  });
  return (inside ? -least : least) - shape.radius;
}

// Bodies of a clip at a time, ready to say whether they lie in a box of the panel, and how much of it is in half-planes or
// ghosts: a bit for each body in small cells, and one for all that is soft.
function placedBodies(clip, t, panel) {
  const [k, fraction] = locate(clip, t), spot = spotIn(panel), columns = Math.ceil(panel.width / CELL), rows = Math.ceil(panel.height / CELL);
  const cells = new Uint32Array(columns * rows), within = (x, size) => Math.min(size, Math.max(0, Math.floor(x / CELL)));
  const fill = (shape, [x, y, angle], reach, gap, bit) => {
    const c = Math.cos(angle), s = Math.sin(angle), [px, py] = spot(x, y);
    for (let j = within(py - reach, rows); j < within(py + reach + CELL, rows); j++)
      for (let i = within(px - reach, columns); i < within(px + reach + CELL, columns); i++) {
        const wx = ((i + 0.5) * CELL - px) / view.scale, wy = (py - (j + 0.5) * CELL) / view.scale;
        if (view.scale * outside(shape, c * wx + s * wy, c * wy - s * wx) < gap) cells[j * columns + i] |= bit;
      }
  };
  const count = (box, bit, enough) => {
    let found = 0;
    for (let j = within(box.y, rows); j < within(box.y + box.height + CELL, rows); j++)
      for (let i = within(box.x, columns); i < within(box.x + box.width + CELL, columns); i++)
        if (cells[j * columns + i] & bit && ++found === enough) return found;
    return found;
  };
  const bodies = clip.bodies.map((body, b) => {
    const pose = poseOf(clip, b, k, fraction, [0, 0, 0]), c = Math.cos(pose[2]), s = Math.sin(pose[2]), bit = 1 << b % 30;
    const solid = body.shapes.filter(e => !e.halfplane), vertices = solid.flatMap(shape => shape.vertices);
    const [mx, my] = [0, 1].map(i => vertices.reduce((sum, v) => sum + v[i], 0) / (vertices.length || 1));
    for (const shape of solid) {
      const gap = CLEAR + (body.points.includes(shape) ? DOT : 0);
      fill(shape, pose, view.scale * body.reach + gap, gap, bit);
    }
    for (const shape of body.planes) fill(shape, pose, Infinity, 0, SOFT);
    return { body, solid, at: spot(pose[0] + c * mx - s * my, pose[1] + s * mx + c * my), solids: box => count(box, bit, 1) > 0 };
  });
  for (const ghost of panel.ghosts) {
    const [l, part] = locate(ghost, t);
    ghost.bodies.forEach((body, b) => {
      for (const shape of body.shapes) if (!shape.halfplane) fill(shape, poseOf(ghost, b, l, part, [0, 0, 0]), view.scale * body.reach, CLEAR, SOFT);
    });
  }
  return { bodies, solids: box => count(box, SOFT - 1, 1) > 0, soft: box => count(box, SOFT, Infinity) };
}

const boxAt = (x, y, width) => ({ x: x - width / 2, y: y - TALL / 2, width, height: TALL });
const overlap = (a, b) => a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;

// What is wrong with a box for a text.
function fault(box, panel, all, busy, taken) {
  if (box.x < 2 || box.y < 2 || box.x + box.width > panel.width - 2 || box.y + box.height > panel.height - 2) return IN_THE_WAY;
  if (taken.some(other => overlap(box, other))) return IN_THE_WAY;
  if (all.solids(box)) return IN_THE_WAY;
  let sum = 0.6 * all.soft(box);
  for (const [x, y] of busy) if (overlap(box, { x: x - 6, y: y - 6, width: 12, height: 12 })) sum += 35;
  return sum;
}

// How many of nine points between a place and a box lie on other bodies.
function crossings(from, box, all, free) {
  let count = 0;
  for (let i = 1; i < 10; i++) {
    const dot = { x: from[0] + i / 10 * (box.x + box.width / 2 - from[0]), y: from[1] + i / 10 * (box.y + box.height / 2 - from[1]), width: 0, height: 0 };
    if (free(dot) && all.solids(dot)) count++;
  }
  return count;
}

// The best place about a point in 16 directions: as near as `free` allows, or as near as no body is in the way; `pull`
// is what a pixel farther away costs.
function best(from, width, free, pull, panel, all, busy, taken, before) {
  let found = null;
  for (let way = 0; way < WAYS; way++) {
    const ux = Math.cos(2 * Math.PI * way / WAYS), uy = -Math.sin(2 * Math.PI * way / WAYS);
    let far = 0, tried = 0;
    const reach = Math.abs(ux) * width / 2 + Math.abs(uy) * TALL / 2;
    for (; tried < 2 && far <= 4 * FARTHEST; far += STEP) {
      const box = boxAt(from[0] + far * ux, from[1] + far * uy, width);
      if (!free(box) || (tried === 1 && all.solids(box))) continue;
      tried++;
      const crossed = tried === 2 ? 20 + 40 * crossings(from, box, all, free) : 0;
      const cost = fault(box, panel, all, busy, taken) + crossed + pull * Math.max(0, far - reach) + (way === before ? -12 : 0) + 2 * Math.abs(uy);
      if (!found || cost < found.cost) found = { box, cost, way, late: tried === 2 };
      if (far > FARTHEST) break;
    }
  }
  return found;
}

// A line to a name that is not right beside its body.
function leader(g, from, box) {
  const x = Math.min(box.x + box.width - 3, Math.max(box.x + 3, from[0])), y = Math.min(box.y + box.height - 2, Math.max(box.y + 2, from[1]));
  g.strokeStyle = colours.faint; g.lineWidth = 1;
  g.beginPath(); g.moveTo(...from); g.lineTo(x, y); g.stroke();
}

// Names of the bodies, small ones first, then the sizes of forces whose arrows are broken; one that finds no room is left
// out. `stage.texts` keeps where they are.
function drawTexts(g, panel, t, spot, options, { busy, broken }) {
  const { clip } = panel, all = placedBodies(clip, t, panel), { bodies } = all, taken = [];
  g.font = FONT; g.textBaseline = "middle"; g.textAlign = "center"; g.lineJoin = "round";
  clip.ways ||= {};
  const write = (text, colour, found) => {
    const { box } = found, x = box.x + box.width / 2, y = box.y + box.height / 2;
    g.strokeStyle = colours.page; g.lineWidth = 3; g.globalAlpha = 0.8; g.strokeText(text, x, y); g.globalAlpha = 1;
    g.fillStyle = colour; g.fillText(text, x, y);
    taken.push(box);
    stage.texts.push({ text, model: clip.index, panel, box, over: bodies.filter(other => other.solids(box)).map(other => other.body.name) });
  };
  const named = options.names && bodies.length <= MOST_NAMES ? [...bodies.keys()] : [];
  for (const b of named.sort((a, b) => bodies[a].body.reach - bodies[b].body.reach)) {
    const own = bodies[b], [x, y] = own.at;
    if (!own.solid.length || x < 0 || y < 0 || x > panel.width || y > panel.height) continue;
    const width = g.measureText(own.body.name).width + 6;
    const found = best(own.at, width, box => !own.solids(box), 0.6, panel, all, busy, taken, clip.ways[b]);
    if (!found || found.cost >= IN_THE_WAY) continue;
    clip.ways[b] = found.way;
    if (found.late) leader(g, own.at, found.box);
    write(own.body.name, colours.ink, found);
  }
  for (const { x, y, size } of [...broken].sort((a, b) => b.size - a.size)) {
    const text = withUnit(+size.toPrecision(3), DATA.units.force), width = g.measureText(text).width + 6;
    const shaft = { x: x - 4, y: y - 4, width: 8, height: 8 };
    const found = best([x, y], width, box => !overlap(box, shaft), 2, panel, all, busy, taken, -1);
    if (found && found.cost < IN_THE_WAY) write(text, colours.ink, found);
  }
}
