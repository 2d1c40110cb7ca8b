// Contacts of a film: a mark for the mode, the force as an arrow from the contact point, and the cone of friction.
//
// The cone is as high as the normal force is long: a force that slips ends on its rim, one that sticks inside.

const OPEN = 0, STICK = 1, SLIP = 2, MODES = ["open", "stick", "slip"];
const LONGEST = 2;  // an arrow that would be longer, in nominal lengths, is broken
const NOMINAL = 0.38;  // length of a usual force, in sizes of the whole
const FULL_SIZE = 400, MANY = 40;  // marks are smaller in panels of less height, and where there are more of them
const PIXELS = { shaft: 1.9, head: 5.5, point: 14, mark: 5 };

// A profile (distance from the axis, height) turned about z in so many flat or smooth sides.
function spun(gl, profile, sides) {
  const places = [], normals = [], smooth = sides > 4;
  for (let i = 0; i < sides; i++) for (let k = 0; k + 1 < profile.length; k++) {
    const [[r, z], [s, y]] = [profile[k], profile[k + 1]], corner = j => 2 * Math.PI * (i + j + 0.5) / sides;
    for (const [j, top] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) {
      const a = corner(j), n = smooth ? a : corner(0.5), [rr, zz] = top ? [s, y] : [r, z];
      places.push(rr * Math.cos(a), rr * Math.sin(a), zz);
      normals.push(...unit([(y - z) * Math.cos(n), (y - z) * Math.sin(n), r - s]));
    }
  }
  return uploaded(gl, { places: new Float32Array(places), normals: new Float32Array(normals), colours: new Uint8Array(places.length / 3 * 4).fill(255) });
}

// Circle at the end of a cone.
function rimOf(gl, sides) {
  const at = a => [Math.cos(a), Math.sin(a), 1], places = [];
  for (let i = 0; i < sides; i++) places.push(...at(2 * Math.PI * i / sides), ...at(2 * Math.PI * (i + 1) / sides));
  return uploaded(gl, { places: new Float32Array(places), normals: new Float32Array(places.length), colours: new Uint8Array(places.length / 3 * 4).fill(255) });
}

const circle = Array.from({ length: 9 }, (_, k) => [Math.sin(Math.PI * k / 8), -Math.cos(Math.PI * k / 8)]);
const marksOf = gl => ({
  shaft: spun(gl, [[0, 0], [1, 0], [1, 1], [0, 1]], 16),
  head: spun(gl, [[0, 0], [1, 0], [0, 1]], 20),
  cone: spun(gl, [[0, 0], [1, 1]], 48),
  rim: rimOf(gl, 48),
  mode: [spun(gl, circle, 16), spun(gl, [[0, -0.85], [1.2, -0.85], [1.2, 0.85], [0, 0.85]], 4), spun(gl, [[0, -0.6], [1.45, -0.6], [0, 1.5]], 3)],
});

// What is drawn of the contacts at a time; widths are so many pixels at the contact's distance.
function marksAt(clip, t, eye, axes, height, options) {
  const k = frameAt(clip, t), found = [], nominal = NOMINAL * view.radius * options.length;
  const sized = Math.min(1, height / FULL_SIZE) * (clip.first[k + 1] - clip.first[k] > MANY ? 0.6 : 1);
  for (let i = clip.first[k]; i < clip.first[k + 1]; i++) {
    const place = [...clip.place.subarray(3 * i, 3 * i + 3)], force = [...clip.force.subarray(3 * i, 3 * i + 3)], normal = unit(clip.normal.subarray(3 * i, 3 * i + 3));
    const depth = -dot(minus(place, eye), axes[2]), pixel = sized * 2 * TAN * depth / height, size = Math.hypot(...force);
    if (depth <= 0) continue;
    const full = size * stage.perForce, long = Math.min(full, LONGEST * nominal);
    found.push({
      place, normal, mode: clip.mode[i], pixel, axis: unit(force), long: options.forces && long > 3 * pixel ? long : 0, broken: long < full, marked: options.contacts,
      cone: options.cones && options.forces && full > 0 ? dot(force, normal) * stage.perForce * long / full : 0, friction: clip.friction[i],
    });
  }
  return found;
}

function drawMarks(marks, look) {
  for (const m of marks) {
    const options = { ...look, tint: [...rgb(colours[MODES[m.mode]]), 1] }, p = m.pixel;
    if (m.marked) drawMesh(gpu.marks.mode[m.mode], laid(m.place, m.normal, PIXELS.mark * p, PIXELS.mark * p), options);
    if (!m.long) continue;
    const head = Math.min(PIXELS.point * p, 0.6 * m.long), wide = head / PIXELS.point;
    const from = a => along(m.place, a * (m.long - head), m.axis), shaft = (a, b) => drawMesh(gpu.marks.shaft, laid(from(a), m.axis, PIXELS.shaft * wide, (b - a) * (m.long - head)), options);
    if (m.broken) { shaft(0, 0.62); shaft(0.70, 1); } else shaft(0, 1);
    drawMesh(gpu.marks.head, laid(from(1), m.axis, PIXELS.head * wide, head), options);
  }
}

function drawCones(marks) {
  for (const m of marks) {
    if (!(m.cone > 3 * m.pixel) || !(m.friction > 0)) continue;
    const world = laid(m.place, m.normal, m.friction * m.cone, m.cone), tint = [...rgb(colours[MODES[m.mode]]), 1];
    drawMesh(gpu.marks.cone, world, { tint, flat: 1, solidity: 0.09 });
    drawMesh(gpu.marks.rim, world, { tint, flat: 1, solidity: 0.5, lines: true });
  }
}
