// The clock, and what moves it: buttons and keys that pages of runs have in common. A page says how it is drawn, by
// `paint`, and which other keys it knows, by `KEYS`.

const SPEEDS = [0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const state = { t: 0, playing: false, dirty: true, last: 0, frames: 0, work: 0 };
const charts = [new Chart("gap", "gap"), new Chart("push", "push")];
const FULL = DATA.real ? 1 : (END || 1) / 6;  // at speed 1: real time, or the whole in six seconds

const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

const inUnit = kind => DATA.units[kind] ? ` [${DATA.units[kind]}]` : "";

function redraw(curvesToo) { state.dirty = true; if (curvesToo) charts.forEach(c => { c.stale = true; }); }
function seek(t) { state.t = Math.min(END, Math.max(0, t)); redraw(); }
function play(on) {
  if (on && state.t >= END) state.t = 0;
  state.playing = on; state.last = 0;
  $("play").textContent = on ? "pause" : "play";
  redraw();
}
function stepFrames(count) {
  play(false);
  const clip = shown()[0] || CLIPS[0], [k, fraction] = locate(clip, state.t);
  const to = k + count + (count < 0 && fraction > 1e-6 ? 1 : 0);
  seek(clip.time[Math.min(clip.time.length - 1, Math.max(0, to))]);
}

function tick(now) {
  const began = performance.now();
  if (state.playing) {
    const passed = state.last ? Math.min(0.1, (now - state.last) / 1000) : 0;
    state.last = now;
    state.t += passed * FULL * SPEEDS[$("speed").value];
    if (state.t >= END) { state.t = $("loop").checked ? 0 : END; if (!$("loop").checked) play(false); }
    state.dirty = true;
  }
  if (state.dirty) {
    state.dirty = false;
    paint(state.t);
    charts.forEach(c => c.draw(state.t, $("log").checked));
    $("push-peaks").textContent = charts[1].peaks.length ? "; \u25b2 peaks beyond the axis" : "";
    $("time").value = state.t;
    $("time").setAttribute("aria-valuetext", `${short(state.t)}`);
    $("clock").textContent = `t = ${state.t.toPrecision(4)} of ${withUnit(END, DATA.units.time)}`;
    state.frames++; state.work += performance.now() - began;
  }
  requestAnimationFrame(tick);
}

function flip(id) { const box = $(id); if (box) { box.checked = !box.checked; box.dispatchEvent(new Event("change")); } }
function faster(by) { const s = $("speed"); s.value = Math.min(SPEEDS.length - 1, Math.max(0, +s.value + by)); }

const PLAYING = {
  " ": () => play(!state.playing), Home: () => seek(0), End: () => { play(false); seek(END); },
  "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1), l: () => flip("loop"), t: () => $("theme").click(),
};

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, focus = event.target;
  const ours = focus === document.body || focus === $("stage") || focus === $("time");
  if (!ours && (key === " " || key === "Home" || key === "End" || key.startsWith("Arrow") || focus.tagName === "SELECT")) return;
  if (key === "ArrowLeft" || key === "ArrowRight") stepFrames((key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? 10 : 1));
  else if (key >= "1" && key <= "9") flip(`model-${key - 1}`);
  else if (KEYS[key] || PLAYING[key]) (KEYS[key] || PLAYING[key])();
  else return;
  event.preventDefault();
}

// Controls of the clock, and the theme; `paintTheme` draws in it.
function startClock() {
  $("title").textContent = document.title;
  $("time").max = END;
  SPEEDS.forEach((s, i) => element("option", `${short(s * FULL)} per s`, $("speed"), { value: i, selected: s === 1 }));
  if (window.matchMedia("(prefers-color-scheme: dark)").matches) root.classList.add("dark");
  $("theme").onclick = () => { root.classList.toggle("dark"); paintTheme(); };
  $("play").onclick = () => play(!state.playing);
  $("back").onclick = () => stepFrames(-1);
  $("ahead").onclick = () => stepFrames(1);
  $("time").oninput = () => { play(false); seek(+$("time").value); };
  $("log").onchange = () => redraw(true);
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", () => redraw(true));
}

function begin() { requestAnimationFrame(tick); if (!reduced) play(true); }
