// The films of this page, unpacked (see run_page.py).

function filmOf(c, index) {
  const slot = new Int32Array(c.bodies.length).fill(-1);
  c.moving.forEach((body, k) => { slot[body] = k; });
  return {
    ...clipOf(c, index), slot, solidity: 0.4,
    pair: new Uint16Array(bytes(c.pair)), normal: unpack(c.normal), friction: unpack(c.friction),
  };
}

const CLIPS = DATA.clips.map(filmOf);

// Place and turn (x y z, w x y z) of a body between two frames.
function poseOf(clip, body, k, fraction, out) {
  const slot = clip.slot[body];
  if (slot < 0) { for (let i = 0; i < 7; i++) out[i] = clip.rest[body][i]; return out; }
  const stride = 7 * clip.moving.length, a = k * stride + 7 * slot, b = k + 1 < clip.time.length ? a + stride : a, p = clip.pose;
  const side = p[a + 3] * p[b + 3] + p[a + 4] * p[b + 4] + p[a + 5] * p[b + 5] + p[a + 6] * p[b + 6] < 0 ? -1 : 1;
  for (let i = 0; i < 7; i++) out[i] = p[a + i] + fraction * ((i < 3 ? 1 : side) * p[b + i] - p[a + i]);
  const size = Math.hypot(out[3], out[4], out[5], out[6]);
  for (let i = 3; i < 7; i++) out[i] /= size;
  return out;
}

// The frame whose contacts are shown: the nearest.
function frameAt(clip, t) {
  const [k, fraction] = locate(clip, t);
  return Math.min(k + (fraction > 0.5 ? 1 : 0), clip.time.length - 1);
}
