// The stage: bodies with their true outlines, and the outlines of ghosts where they are elsewhere.

const view = { x: 0, y: 0, scale: 1, whole: true };
const FOOT = 30, SAME = 2.5, DOT = 6, MARGIN = 22;
const FONT = "12px system-ui, sans-serif";
const stage = { panels: [], texts: [] };  // as last drawn

// The scale at which all bodies and their names have room.
function fit(width, height) {
  const [x0, y0, x1, y1] = DATA.bounds, free = size => Math.max(0.3 * size, size - Math.max(2 * MARGIN, 0.14 * size));
  return Math.min(free(width) / (x1 - x0), free(height) / (y1 - y0));
}

function showWhole(width, height) {
  const [x0, y0, x1, y1] = DATA.bounds;
  view.scale = fit(width, height);
  view.x = (x0 + x1) / 2; view.y = (y0 + y1) / 2;
}

// Panels as large as makes the bodies largest; where the canvas may take less than its most (`layout.most`), no higher than
// they need.
function panelsOf(width, height) {
  const [, y0, , y1] = DATA.bounds;
  const enough = (w, h) => Math.min(h, layout.most ? Math.max(2 * MARGIN + 1.2 * fit(w, h) * (y1 - y0), 0.45 * w) : h);
  return panelsIn(width, height - FOOT, fit, enough);
}

// Place in its panel of a point of the world.
const spotIn = panel => (x, y) => [panel.width / 2 + view.scale * (x - view.x), panel.height / 2 - view.scale * (y - view.y)];

// Outline of a rounded convex polygon in its body's frame: edges moved out by the radius, arcs between them.
function pathOf(shape) {
  const path = new Path2D(), v = shape.vertices, n = shape.normals, r = shape.radius;
  if (v.length === 1) { path.arc(v[0][0], v[0][1], r, 0, 2 * Math.PI); return path; }
  for (let i = 0; i < v.length; i++) {
    const before = n[(i + v.length - 1) % v.length];
    if (r > 0) path.arc(v[i][0], v[i][1], r, Math.atan2(before[1], before[0]), Math.atan2(n[i][1], n[i][0]));
    else path.lineTo(v[i][0], v[i][1]);
  }
  path.closePath();
  return path;
}

for (const clip of CLIPS) clip.raised = new Uint8Array(bytes(clip.raised));
for (const clip of CLIPS) clip.bodies.forEach(body => {
  body.reach = Math.max(0, ...body.shapes.filter(s => !s.halfplane)
    .flatMap(s => s.vertices.map(v => Math.hypot(v[0], v[1]) + s.radius)));
  body.points = body.shapes.filter(s => !s.halfplane && s.vertices.length === 1 && s.radius === 0);
  body.spokes = body.moves ? body.shapes.filter(s => !s.halfplane && s.vertices.length === 1 && s.radius > 0) : [];
  body.planes = body.shapes.filter(s => s.halfplane);
  body.paths = body.shapes.filter(s => !s.halfplane && !body.points.includes(s)).map(pathOf);
  body.whole = new Path2D();
  for (const path of body.paths) body.whole.addPath(path);
});

function poseOf(clip, b, k, fraction, out) {
  const stride = 3 * clip.bodies.length, at = k * stride + 3 * b;
  const next = k + 1 < clip.time.length ? at + stride : at;
  for (let i = 0; i < 3; i++) out[i] = clip.pose[at + i] + fraction * (clip.pose[next + i] - clip.pose[at + i]);
  return out;
}

// Bodies that are raised off the plane are above all others, dashed, and what is below them shows.
function drawBodies(g, clip, t, line) {
  const [k, fraction] = locate(clip, t), pose = [0, 0, 0], n = clip.bodies.length, raised = b => clip.raised[k * n + b] > 0;
  const numbers = [...clip.bodies.keys()];
  for (const b of [...numbers.filter(b => !raised(b)), ...numbers.filter(raised)]) {
    const body = clip.bodies[b];
    poseOf(clip, b, k, fraction, pose);
    g.save();
    if (raised(b)) { g.globalAlpha = 0.6; g.setLineDash([6 / view.scale, 5 / view.scale]); }
    g.translate(pose[0], pose[1]);
    g.rotate(pose[2]);
    g.fillStyle = colours[body.role];
    g.strokeStyle = line;
    for (const s of body.planes) drawPlane(g, s, line);
    // Outline first, at double width, then one fill of all: seams between the shapes of one body stay hidden.
    g.lineJoin = "round";
    g.lineWidth = 4.2 / view.scale;
    g.stroke(body.whole);
    g.fill(body.whole);
    g.lineWidth = 1.2 / view.scale;
    for (const s of body.spokes) {  // shows how a disc turns
      g.beginPath(); g.moveTo(...s.vertices[0]); g.lineTo(s.vertices[0][0] + s.radius, s.vertices[0][1]); g.stroke();
    }
    g.fillStyle = line;
    for (const s of body.points) { g.beginPath(); g.arc(...s.vertices[0], DOT / view.scale, 0, 2 * Math.PI); g.fill(); }
    g.restore();
  }
}

// Outlines of the other models' bodies, except where they are seen anyway; stripes where several of them agree.
function drawGhosts(g, panel, t) {
  const at = clip => { const [k, fraction] = locate(clip, t); return clip.bodies.map((_, b) => poseOf(clip, b, k, fraction, [0, 0, 0])); };
  const front = at(panel.clip), others = panel.ghosts.map(at), dash = 7 / view.scale;
  panel.clip.bodies.forEach((body, b) => {
    const near = (p, q) => view.scale * (Math.hypot(p[b][0] - q[b][0], p[b][1] - q[b][1]) + body.reach * Math.abs(p[b][2] - q[b][2])) < SAME;
    const groups = [];
    others.forEach((pose, i) => {
      if (near(pose, front)) return;
      const group = groups.find(some => near(others[some[0]], pose));
      if (group) group.push(i); else groups.push([i]);
    });
    for (const alike of groups) for (const i of alike) {
      const clip = panel.ghosts[i], own = clip.bodies[b], [x, y, angle] = others[i][b];
      g.save();
      g.translate(x, y); g.rotate(angle);
      g.lineJoin = "round"; g.strokeStyle = colours.models[clip.index]; g.lineWidth = 2.2 / view.scale;
      if (alike.length > 1) { g.setLineDash([dash, dash * (alike.length - 1)]); g.lineDashOffset = -dash * alike.indexOf(i); }
      g.stroke(own.whole);
      for (const s of own.points) { g.beginPath(); g.arc(...s.vertices[0], (DOT - 1) / view.scale, 0, 2 * Math.PI); g.stroke(); }
      g.restore();
    }
  });
}

function drawJoints(g, clip, t, spot, line) {
  const [k, fraction] = locate(clip, t), pose = [0, 0, 0];
  for (const [b, jx, jy] of clip.joints) {
    poseOf(clip, b, k, fraction, pose);
    const c = Math.cos(pose[2]), s = Math.sin(pose[2]), [x, y] = spot(pose[0] + c * jx - s * jy, pose[1] + s * jx + c * jy);
    g.beginPath(); g.arc(x, y, 5, 0, 2 * Math.PI);
    g.fillStyle = colours.page; g.fill(); g.strokeStyle = line; g.lineWidth = 2; g.stroke();
    g.beginPath(); g.arc(x, y, 1.5, 0, 2 * Math.PI); g.fillStyle = line; g.fill();
  }
}

function drawPlane(g, shape, line) {
  const [nx, ny] = shape.normals[0], [x, y] = shape.vertices[0];
  const far = 4 * (DATA.bounds[2] - DATA.bounds[0] + DATA.bounds[3] - DATA.bounds[1]) + 4000 / view.scale;
  g.save();
  g.translate(x, y);
  g.rotate(Math.atan2(-nx, ny));
  g.fillRect(-far, -far, 2 * far, far);
  g.beginPath(); g.moveTo(-far, 0); g.lineTo(far, 0);
  g.strokeStyle = line; g.lineWidth = 1.8 / view.scale; g.stroke();
  g.restore();
}

function drawStage(t, options) {
  const canvas = $("stage");
  stage.panels = panelsOf(canvas.clientWidth, layout.most ? layout.most() : canvas.clientHeight);
  stage.texts = [];
  const last = stage.panels.at(-1);
  if (layout.most && last) canvas.style.height = `${Math.round(last.y + last.height + FOOT)}px`;
  const [, height, ratio] = fitted(canvas), width = canvas.clientWidth, g = canvas.getContext("2d");
  if (last) options = { ...options, length: options.length * Math.min(1, Math.min(last.width, last.height) / 320) };
  if (view.whole && stage.panels.length) showWhole(stage.panels[0].width, stage.panels[0].height);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = colours.page;
  g.fillRect(0, 0, width, height);
  for (const panel of stage.panels) drawPanel(g, panel, t, options, ratio);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  for (const panel of stage.panels) {
    g.strokeStyle = colours.line; g.lineWidth = 1; g.strokeRect(panel.x + 0.5, panel.y + 0.5, panel.width - 1, panel.height - 1);
    if (panel.head) heading(g, panel);
  }
  drawScales(g, height, options);
}

function drawPanel(g, panel, t, options, ratio) {
  const { clip, x, y, width, height } = panel, spot = spotIn(panel), line = CLIPS.length > 1 ? colours.models[clip.index] : colours.ink;
  g.save();
  g.setTransform(ratio, 0, 0, ratio, ratio * x, ratio * y);
  g.beginPath(); g.rect(0, 0, width, height); g.clip();
  g.save();
  g.transform(view.scale, 0, 0, -view.scale, width / 2 - view.scale * view.x, height / 2 + view.scale * view.y);
  drawBodies(g, clip, t, line);
  drawGhosts(g, panel, t);
  g.restore();
  drawJoints(g, clip, t, spot, line);
  const busy = drawTouches(g, panel, t, spot, options);
  drawTexts(g, panel, t, spot, options, busy);
  g.restore();
}

// The model and how its run ends, in one line if there is room.
function heading(g, panel) {
  const { clip, x, y, width } = panel, full = `${clip.label}: ${clip.outcome}`;
  g.textAlign = "left"; g.textBaseline = "middle"; g.font = FONT;
  g.fillStyle = colours.models[clip.index]; g.fillRect(x, y - 15, 12, 6);
  const size = Math.min(12, 12 * (width - 18) / g.measureText(full).width);
  g.font = `${size}px system-ui, sans-serif`;
  g.fillStyle = colours.ink; g.fillText(full, x + 17, y - 11.5);
}
