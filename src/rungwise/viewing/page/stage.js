// The stage: bodies with their true outlines, contact points by mode, forces as arrows.

const OPEN = 0, STICK = 1, SLIP = 2;
const view = { x: 0, y: 0, scale: 1, whole: true };
let colours = {};

function readColours() {
  for (const name of ["page", "ink", "faint", "line", "object", "robot", "obstacle", "stick", "slip", "open"])
    colours[name] = css(`--${name}`);
  colours.models = CLIPS.map(c => c.colour());
}

function showWhole(width, height) {
  const [x0, y0, x1, y1] = DATA.bounds, pad = 1.16;
  view.scale = Math.min(width / (pad * (x1 - x0)), height / (pad * (y1 - y0)));
  view.x = (x0 + x1) / 2; view.y = (y0 + y1) / 2;
}

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
}

// Models drawn over others have thinner lines (`extra` is 0 for the last), so that those that agree are all seen.
function drawBodies(g, clip, t, line, extra) {
  const [k, fraction] = locate(clip, t), pose = [0, 0, 0], dot = (6 + 1.5 * extra) / view.scale;
  for (let b = 0; b < clip.bodies.length; b++) {
    const body = clip.bodies[b];
    poseOf(clip, b, k, fraction, pose);
    g.save();
    g.translate(pose[0], pose[1]);
    g.rotate(pose[2]);
    g.fillStyle = colours[body.role];
    g.strokeStyle = line;
    for (const s of body.planes) drawPlane(g, s, extra > 0 ? colours.faint : line);
    // Outline first, at double width, then one fill of all: seams between the shapes of one body stay hidden.
    g.lineJoin = "round";
    g.lineWidth = (3.6 + 4 * extra) / view.scale;
    g.stroke(body.whole);
    g.fill(body.whole);
    g.lineWidth = 1.2 / view.scale;
    for (const s of body.spokes) {  // shows how a disc turns
      g.beginPath(); g.moveTo(...s.vertices[0]); g.lineTo(s.vertices[0][0] + s.radius, s.vertices[0][1]); g.stroke();
    }
    g.fillStyle = line;
    for (const s of body.points) {
      g.beginPath(); g.arc(s.vertices[0][0], s.vertices[0][1], dot, 0, 2 * Math.PI); g.fill();
    }
    g.restore();
  }
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

const layer = document.createElement("canvas");

function drawStage(t, options) {
  const canvas = $("stage"), [width, height, ratio] = fitted(canvas), g = canvas.getContext("2d");
  if (view.whole) showWhole(width, height);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = colours.page;
  g.fillRect(0, 0, width, height);
  const clips = shown(), world = target => target.setTransform(
    ratio * view.scale, 0, 0, -ratio * view.scale,
    ratio * (width / 2 - view.scale * view.x), ratio * (height / 2 + view.scale * view.y));
  clips.forEach((clip, i) => {
    const line = clips.length === 1 ? colours.ink : colours.models[clip.index], extra = clips.length - 1 - i;
    if (i === 0) { world(g); drawBodies(g, clip, t, line, extra); return; }
    // Each further model is opaque in itself, and laid over the others as a whole.
    if (layer.width !== canvas.width || layer.height !== canvas.height) { layer.width = canvas.width; layer.height = canvas.height; }
    const h = layer.getContext("2d");
    h.setTransform(1, 0, 0, 1, 0, 0); h.clearRect(0, 0, layer.width, layer.height);
    world(h); drawBodies(h, clip, t, line, extra);
    g.setTransform(1, 0, 0, 1, 0, 0); g.globalAlpha = 0.75; g.drawImage(layer, 0, 0); g.globalAlpha = 1;
  });
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  const spot = (x, y) => [width / 2 + view.scale * (x - view.x), height / 2 - view.scale * (y - view.y)];
  for (const clip of clips) drawJoints(g, clip, t, spot, clips.length > 1 ? colours.models[clip.index] : colours.ink);
  for (const clip of clips) drawTouches(g, clip, t, spot, options, clips.length > 1 ? colours.models[clip.index] : null);
  if (options.names && clips.length) drawNames(g, clips[0], t, spot);
}

function drawTouches(g, clip, t, spot, options, ring) {
  const [frame, fraction] = locate(clip, t), k = Math.min(frame + (fraction > 0.5 ? 1 : 0), clip.time.length - 1);
  for (let i = clip.first[k]; i < clip.first[k + 1]; i++) {
    const [x, y] = spot(clip.place[2 * i], clip.place[2 * i + 1]), colour = colours[["open", "stick", "slip"][clip.mode[i]]];
    if (options.forces) arrow(g, x, y, clip.force[2 * i], -clip.force[2 * i + 1], options.length, colour);
    if (options.contacts) mark(g, x, y, clip.mode[i], colour, ring);
  }
}

function mark(g, x, y, mode, colour, ring) {
  g.beginPath();
  if (mode === OPEN) g.arc(x, y, 4.5, 0, 2 * Math.PI);
  else if (mode === STICK) g.rect(x - 4.5, y - 4.5, 9, 9);
  else { g.moveTo(x, y - 6); g.lineTo(x + 5.5, y + 4.5); g.lineTo(x - 5.5, y + 4.5); g.closePath(); }
  g.fillStyle = mode === OPEN ? colours.page : colour;
  g.fill();
  g.lineWidth = mode === OPEN ? 2 : 1.5;
  g.strokeStyle = ring || (mode === OPEN ? colour : colours.page);
  g.stroke();
}

// An arrow whose head is at the contact point: the force on the body that it points into.
function arrow(g, x, y, fx, fy, length, colour) {
  const size = Math.hypot(fx, fy), long = Math.min(length * size / DATA.force, 400);
  if (!(long > 2)) return;
  const ux = fx / size, uy = fy / size, head = Math.min(11, 0.6 * long);
  for (const [wide, c] of [[6, colours.page], [3, colour]]) {
    g.strokeStyle = g.fillStyle = c; g.lineWidth = wide;
    g.beginPath(); g.moveTo(x - long * ux, y - long * uy); g.lineTo(x - head * ux, y - head * uy); g.stroke();
    if (c === colour) {
      g.beginPath(); g.moveTo(x, y);
      g.lineTo(x - head * ux + 0.5 * head * uy, y - head * uy - 0.5 * head * ux);
      g.lineTo(x - head * ux - 0.5 * head * uy, y - head * uy + 0.5 * head * ux);
      g.closePath(); g.fill();
    }
  }
}

function drawNames(g, clip, t, spot) {
  const [k, fraction] = locate(clip, t), pose = [0, 0, 0];
  g.font = "13px system-ui, sans-serif"; g.textBaseline = "middle"; g.lineJoin = "round";
  clip.bodies.forEach((body, b) => {
    if (!body.paths.length && !body.points.length) return;
    poseOf(clip, b, k, fraction, pose);
    const [x, y] = spot(pose[0], pose[1]), reach = view.scale * body.reach, beside = reach < 30;
    g.textAlign = beside ? "left" : "center";
    g.strokeStyle = colours.page; g.lineWidth = 3; g.globalAlpha = 0.75;
    g.strokeText(body.name, x + (beside ? reach + 11 : 0), y); g.globalAlpha = 1;
    g.fillStyle = colours.ink; g.fillText(body.name, x + (beside ? reach + 11 : 0), y);
  });
}
