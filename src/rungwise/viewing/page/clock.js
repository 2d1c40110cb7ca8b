// The clock, and what moves it: the play bar and its keys. A page says when its runs end, by `end`; how many seconds they
// play and which part of them it rests at the end, by `PACE`; and how it is drawn at a time, by `paint`.

const SPEEDS = [0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const state = { t: 0, playing: false, dirty: true, anew: true, last: 0, frames: 0, work: 0 };
const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

const full = () => (end() || 1) / PACE.seconds;  // time per second at speed 1

// Draws again; `anew` also what does not depend on the time.
function redraw(anew) { state.dirty = true; state.anew ||= Boolean(anew); }
function seek(t) { state.t = Math.min(end(), Math.max(0, t)); redraw(); }
function play(on) {
  if (on && state.t >= end()) state.t = 0;
  state.playing = on; state.last = 0;
  $("play").textContent = on ? "pause" : "play";
  redraw();
}
function stepFrames(count) {
  play(false);
  const clip = shown()[0] || CLIPS[0];
  if (!clip) return;
  const [k, fraction] = locate(clip, state.t), to = k + count + (count < 0 && fraction > 1e-6 ? 1 : 0);
  seek(clip.time[Math.min(clip.time.length - 1, Math.max(0, to))]);
}
function faster(by) { const s = $("speed"); s.value = Math.min(SPEEDS.length - 1, Math.max(0, +s.value + by)); }

function advance(now) {
  const passed = state.last ? Math.min(0.1, (now - state.last) / 1000) : 0, loop = $("loop").checked;
  state.last = now; state.dirty = true;
  state.t += passed * full() * SPEEDS[$("speed").value];
  if (loop && state.t >= (1 + PACE.rest) * end()) state.t = 0;
  else if (!loop && state.t >= end()) { state.t = end(); play(false); }
}

function tick(now) {
  const began = performance.now();
  if (state.playing) advance(now);
  if (state.dirty) {
    const t = Math.min(state.t, end()), anew = state.anew;
    state.dirty = state.anew = false;
    paint(t, anew);
    $("time").value = t;
    $("time").setAttribute("aria-valuetext", `${short(t)}`);
    $("clock").textContent = `t = ${t.toPrecision(4)} of ${withUnit(end(), DATA.units.time)}`;
    state.frames++; state.work += performance.now() - began;
  }
  requestAnimationFrame(tick);
}

const PLAYING = {
  " ": () => play(!state.playing), Home: () => seek(0), End: () => { play(false); seek(end()); },
  "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1), l: () => flip("loop"),
};

// The play bar of runs that end at `end()`: called again when other runs are shown.
function measure() {
  $("time").max = end();
  const rate = DATA.units.time === "s" ? "\u00d7 real time" : `${DATA.units.time || ""} per s`.trim();
  SPEEDS.forEach((s, i) => { $("speed").options[i].textContent = `${+(s * full()).toPrecision(2)} ${rate}`; });
}

function startClock() {
  SPEEDS.forEach((s, i) => element("option", "", $("speed"), { value: i, selected: s === 1 }));
  measure();
  $("play").onclick = () => play(!state.playing);
  $("back").onclick = () => stepFrames(-1);
  $("ahead").onclick = () => stepFrames(1);
  $("time").oninput = () => { play(false); seek(+$("time").value); };
}

function begin() { requestAnimationFrame(tick); if (!reduced) play(true); }
