// Contact points by mode, forces as arrows, and the scales of both.

const OPEN = 0, STICK = 1, SLIP = 2;
const LONGEST = 1.8, EDGING = 5;  // an arrow that would be longer, in nominal lengths, or leave its panel, is broken

// Draws the contacts of a panel's run; returns places that texts should leave free, and the broken arrows.
function drawTouches(g, panel, t, spot, options) {
  const { clip } = panel, [frame, fraction] = locate(clip, t), k = Math.min(frame + (fraction > 0.5 ? 1 : 0), clip.time.length - 1);
  const busy = [], broken = [];
  for (let i = clip.first[k]; i < clip.first[k + 1]; i++) {
    const [x, y] = spot(clip.place[2 * i], clip.place[2 * i + 1]), colour = colours[["open", "stick", "slip"][clip.mode[i]]];
    const inside = x >= 0 && y >= 0 && x <= panel.width && y <= panel.height;
    if (options.forces && inside) {
      const drawn = arrow(g, x, y, clip.force[2 * i], -clip.force[2 * i + 1], options.length, colour, panel);
      const steps = drawn ? Math.ceil(Math.hypot(x - drawn.x, y - drawn.y) / 9) : 0;
      for (let s = 1; s <= steps; s++) busy.push([x + s / steps * (drawn.x - x), y + s / steps * (drawn.y - y)]);
      if (drawn && drawn.broken) broken.push(drawn);
    }
    if (options.contacts) { mark(g, x, y, clip.mode[i], colour); busy.push([x, y]); }
  }
  return { busy, broken };
}

function mark(g, x, y, mode, colour) {
  g.beginPath();
  if (mode === OPEN) g.arc(x, y, 4.5, 0, 2 * Math.PI);
  else if (mode === STICK) g.rect(x - 4.5, y - 4.5, 9, 9);
  else { g.moveTo(x, y - 6); g.lineTo(x + 5.5, y + 4.5); g.lineTo(x - 5.5, y + 4.5); g.closePath(); }
  g.fillStyle = mode === OPEN ? colours.page : colour;
  g.fill();
  g.lineWidth = mode === OPEN ? 2 : 1.5;
  g.strokeStyle = mode === OPEN ? colour : colours.page;
  g.stroke();
}

// How far it is from a place in a panel, along a direction, to near its edge.
function room(panel, x, y, ux, uy) {
  const along = (at, u, size) => Math.abs(u) < 1e-9 ? Infinity : ((u > 0 ? size - EDGING : EDGING) - at) / u;
  return Math.max(0, Math.min(along(x, ux, panel.width), along(y, uy, panel.height)));
}

// An arrow whose head is at the contact point: the force on the body that it points into. In a panel it stays inside,
// and is broken where it would not; returns its other end.
function arrow(g, x, y, fx, fy, length, colour, panel) {
  const size = Math.hypot(fx, fy), full = length * size / DATA.force, ux = fx / size, uy = fy / size;
  const long = panel ? Math.min(full, LONGEST * length, room(panel, x, y, -ux, -uy)) : full;
  if (!(long > 2)) return null;
  const head = Math.min(11, 0.6 * long), end = { x: x - long * ux, y: y - long * uy, size, broken: long < full - 0.5 };
  for (const [wide, c] of [[6, colours.page], [3, colour]]) {
    g.strokeStyle = g.fillStyle = c; g.lineWidth = wide; g.lineCap = "butt";
    g.beginPath(); g.moveTo(end.x, end.y); g.lineTo(x - head * ux, y - head * uy); g.stroke();
    if (c === colour) {
      g.beginPath(); g.moveTo(x, y);
      g.lineTo(x - head * ux + 0.5 * head * uy, y - head * uy - 0.5 * head * ux);
      g.lineTo(x - head * ux - 0.5 * head * uy, y - head * uy + 0.5 * head * ux);
      g.closePath(); g.fill();
    }
  }
  if (end.broken && long > 16) breakAt(g, end.x + 8 * ux, end.y + 8 * uy, ux, uy, colour);
  return end;
}

// Two strokes across a gap in the shaft.
function breakAt(g, x, y, ux, uy, colour) {
  const across = (shift, wide, c) => {
    const cx = x + shift * ux, cy = y + shift * uy;
    g.strokeStyle = c; g.lineWidth = wide; g.beginPath();
    g.moveTo(cx - 5 * uy - 2 * ux, cy + 5 * ux - 2 * uy); g.lineTo(cx + 5 * uy + 2 * ux, cy - 5 * ux + 2 * uy); g.stroke();
  };
  across(0, 5, colours.page); across(-2.5, 1.6, colour); across(2.5, 1.6, colour);
}

// A length and a force as they are drawn, below the panels.
function drawScales(g, height, options) {
  const panel = stage.panels[0];
  if (!panel) return;
  const value = round125(Math.max(60, Math.min(140, 0.3 * panel.width)) / view.scale), long = value * view.scale, y = height - 11;
  g.font = FONT; g.textAlign = "left"; g.textBaseline = "middle"; g.strokeStyle = g.fillStyle = colours.ink; g.lineWidth = 2; g.lineCap = "butt";
  g.beginPath(); g.moveTo(1, y - 5); g.lineTo(1, y + 5); g.moveTo(1, y); g.lineTo(1 + long, y); g.moveTo(1 + long, y - 5); g.lineTo(1 + long, y + 5); g.stroke();
  const said = withUnit(value, DATA.units.length);
  g.fillText(said, long + 8, y);
  stage.scale = { value, long, said };
  if (!options.forces || !DATA.force || !shown().some(c => c.force.length)) return;
  const force = round125(DATA.force * 60 / options.length), at = long + 8 + g.measureText(said).width + 28, tip = at + options.length * force / DATA.force;
  arrow(g, tip, y, force, 0, options.length, colours.ink, null);
  g.fillStyle = colours.ink; g.fillText(withUnit(force, DATA.units.force), tip + 7, y);
}

// Rows that explain the stage; the scales of lengths and forces stand below it.
function stageLegend(box) {
  legendRow(box, "contact open", g => mark(g, 17, 9, OPEN, colours.open));
  legendRow(box, "contact sticks, or rests", g => mark(g, 17, 9, STICK, colours.stick));
  legendRow(box, "contact slips", g => mark(g, 17, 9, SLIP, colours.slip));
  if (CLIPS.some(c => c.force.length)) {
    legendRow(box, "force, at its scale", g => arrow(g, 31, 9, DATA.force, 0, 28, colours.ink, null));
    legendRow(box, "force too large for its arrow", g => { arrow(g, 31, 9, DATA.force, 0, 28, colours.ink, null); breakAt(g, 11, 9, 1, 0, colours.ink); });
  }
  if (!layout.beside && shown().length > 1)
    legendRow(box, "another model, where it is elsewhere", g => {
      g.strokeStyle = colours.models[shown().find(c => c !== inFront()).index]; g.lineWidth = 2.2; g.strokeRect(5, 3, 24, 12);
    });
  for (const role of new Set(CLIPS.flatMap(c => c.bodies.map(b => b.role))))
    legendRow(box, role, g => { g.fillStyle = colours[role]; g.strokeStyle = colours.ink; g.fillRect(5, 3, 24, 12); g.strokeRect(5, 3, 24, 12); });
}
