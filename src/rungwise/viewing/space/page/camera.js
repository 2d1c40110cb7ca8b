// The eye: it turns about a point, comes nearer, and is moved across. One finger turns, two move and zoom.

const TAN = Math.tan(17 * Math.PI / 180);  // of half the angle of view, up and down
const SIDES = [["slant", -0.95, 0.38], ["front", -Math.PI / 2, 0], ["right", 0, 0], ["top", -Math.PI / 2, Math.PI / 2 - 1e-3]];
const NEAREST = 0.05;  // sizes of the whole from which the eye looks closest
const view = { target: [0, 0, 0], azimuth: 0, height: 0, distance: 1, whole: true, side: 0, radius: 1 };
view.radius = Math.max(1e-9, Math.hypot(...minus(DATA.high, DATA.low)) / 2);

// Axes of the eye: to the right, up, and towards it.
function axesOf({ azimuth, height }) {
  const towards = [Math.cos(height) * Math.cos(azimuth), Math.cos(height) * Math.sin(azimuth), Math.sin(height)];
  const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
  return [right, cross(towards, right), towards];
}

// All of the box, in the middle, from the least distance.
function showBox(low, high, aspect) {
  view.target = low.map((v, i) => (v + high[i]) / 2);
  const [x, y, z] = axesOf(view);
  let distance = 0;
  for (let k = 0; k < 8; k++) {
    const d = minus([0, 1, 2].map(i => (k >> i & 1 ? high : low)[i]), view.target);
    distance = Math.max(distance, dot(d, z) + Math.abs(dot(d, x)) / (TAN * aspect), dot(d, z) + Math.abs(dot(d, y)) / TAN);
  }
  view.distance = Math.max(1.12 * distance, NEAREST * view.radius);
}

function showWhole(aspect) {
  const [, azimuth, height] = SIDES[view.side];
  Object.assign(view, { azimuth, height });
  showBox(DATA.low, DATA.high, aspect);
}

// What moves, where it is now.
function showNow() {
  const clip = inFront(), panel = stage.panels[0];
  if (!clip || !panel) return;
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity], poses = posesOf(clip, state.t);
  gpu.casts[clip.cast].forEach((body, b) => {
    if (!body.middle || clip.slot[b] < 0) return;
    const world = posed(poses[b]);
    for (let k = 0; k < 8; k++) times(world, [0, 1, 2].map(i => (k >> i & 1 ? body.high : body.low)[i])).slice(0, 3)
      .forEach((v, i) => { low[i] = Math.min(low[i], v); high[i] = Math.max(high[i], v); });
  });
  if (low[0] > high[0]) return;
  view.whole = false; showBox(low, high, panel.width / panel.height); redraw();
}

// The eye's place and what it sees, for a panel so many times as wide as high.
function sightOf(aspect) {
  const axes = axesOf(view), eye = along(view.target, view.distance, axes[2]), far = view.distance + 14 * view.radius;
  return { eye, axes, sight: product(perspective(TAN, aspect, Math.max(view.distance - 8 * view.radius, 0.02 * view.distance), far), seenFrom(eye, axes)) };
}

function zoom(factor) { view.whole = false; view.distance = Math.min(60 * view.radius, Math.max(NEAREST * view.radius, view.distance / factor)); redraw(); }
function turn(right, up) {
  view.whole = false; view.azimuth -= right;
  view.height = Math.min(Math.PI / 2 - 1e-3, Math.max(1e-3 - Math.PI / 2, view.height + up)); redraw();
}
function shift(right, up) {
  const [x, y] = axesOf(view), per = 2 * TAN * view.distance / $("stage").clientHeight;
  view.whole = false; view.target = along(along(view.target, -right * per, x), up * per, y); redraw();
}
function showSide(side) { view.side = (side + SIDES.length) % SIDES.length; view.whole = true; redraw(); }

function onCamera(canvas, clicked) {
  const fingers = new Map();
  let moved = 0;
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(-0.0015 * e.deltaY)); }, { passive: false });
  canvas.addEventListener("contextmenu", e => e.preventDefault());
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, e); if (fingers.size === 1) moved = 0; });
  canvas.addEventListener("pointermove", e => {
    const before = fingers.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before.clientX, dy = e.clientY - before.clientY, other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
    moved += Math.abs(dx) + Math.abs(dy);
    fingers.set(e.pointerId, e);
    if (moved <= 3) return;
    if (other) {
      const apart = f => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY) || 1;
      zoom(apart(e) / apart(before)); shift(dx / 2, dy / 2);
    } else if (e.buttons & 2 || e.shiftKey) shift(dx, dy);
    else turn(0.008 * dx, 0.008 * dy);
  });
  const up = e => { if (fingers.delete(e.pointerId) && moved <= 3 && e.type === "pointerup") clicked(...placeIn(e)); };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
}
