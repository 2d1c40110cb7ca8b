// The player: clock, controls, keyboard, and what is said in words.

const SPEEDS = [0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const state = { t: 0, playing: false, dirty: true, last: 0, frames: 0, work: 0 };
const charts = [new Chart("gap", "gap"), new Chart("push", "push")];
const FULL = (END || 1) / 6;  // at speed 1 the whole takes six seconds

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
    drawStage(state.t, { forces: $("forces").checked, contacts: $("contacts").checked, names: $("names").checked,
      length: 70 * 10 ** +$("arrows").value });
    charts.forEach(c => c.draw(state.t, $("log").checked));
    $("push-peaks").textContent = charts[1].peaks.length ? "; \u25b2 peaks beyond the axis" : "";
    $("time").value = state.t;
    $("time").setAttribute("aria-valuetext", `${short(state.t)}`);
    $("clock").textContent = `t = ${state.t.toPrecision(4)} of ${withUnit(END, DATA.units.time)}`;
    state.frames++; state.work += performance.now() - began;
  }
  requestAnimationFrame(tick);
}

function buildModels() {
  const box = $("models");
  CLIPS.forEach((clip, i) => {
    const row = element("div", "", box, { className: "model" });
    const show = element("input", "", row, { type: "checkbox", checked: true, id: `model-${i}`, ariaLabel: `show ${clip.label}` });
    show.addEventListener("change", () => { clip.visible = show.checked; captions(); redraw(true); });
    const label = element("label", "", row), front = element("input", "", label, { type: "radio", name: "front", checked: i === 0, id: `front-${i}` });
    front.addEventListener("change", () => bringFront(i));
    element("span", "", label, { className: "swatch" }).style.background = `var(--model-${i % PALETTE.length})`;
    element("span", `${clip.label}: ${clip.outcome}`, label);
    if (clip.note) element("p", clip.note, box, { className: "note" });
  });
  box.classList.toggle("alone", CLIPS.length === 1);
  $("models-title").textContent = CLIPS.length === 1 ? "model" : "models: shown, in front";
  $("views").hidden = CLIPS.length === 1;
  tellReasons($("reasons"), CLIPS, clip => clip.label);
}

function bringFront(index) {
  layout.front = index;
  $(`front-${index}`).checked = true;
  if (!CLIPS[index].visible) flip(`model-${index}`);
  captions(); redraw(true);
}

function bringNext() {
  const clips = shown();
  if (clips.length) bringFront(clips[(clips.indexOf(inFront()) + 1) % clips.length].index);
}

function arrange(beside) {
  layout.beside = beside;
  $("beside").checked = beside; $("single").checked = !beside;
  captions(); redraw();
}

function captions() {
  const several = shown().length > 1, box = $("legend");
  box.replaceChildren();
  stageLegend(box);
  DATA.contacts.forEach((name, c) => legendRow(box, `${name}, in the curves`, g => {
    const [colour, dash] = charts[0].style({ clip: shown()[0] || CLIPS[0], c });
    g.strokeStyle = several ? colours.ink : colour; g.lineWidth = 2; g.setLineDash(dash);
    g.beginPath(); g.moveTo(2, 9); g.lineTo(32, 9); g.stroke();
  }));
}

function paintTheme() {
  const dark = root.classList.contains("dark");
  PALETTE.forEach((pair, i) => root.style.setProperty(`--model-${i}`, pair[dark ? 1 : 0]));
  readColours(); captions(); redraw(true);
}

function zoom(factor, x, y) {
  const panel = panelAt(x, y) || stage.panels[0];
  if (!panel) return;
  const dx = x === undefined ? 0 : x - panel.x - panel.width / 2, dy = y === undefined ? 0 : panel.y + panel.height / 2 - y;
  view.whole = false;
  view.x += dx / view.scale * (1 - 1 / factor); view.y += dy / view.scale * (1 - 1 / factor);
  view.scale *= factor;
  redraw();
}

function flip(id) { const box = $(id); if (box) { box.checked = !box.checked; box.dispatchEvent(new Event("change")); } }
function faster(by) { const s = $("speed"); s.value = Math.min(SPEEDS.length - 1, Math.max(0, +s.value + by)); }

const KEYS = {
  " ": () => play(!state.playing), Home: () => seek(0), End: () => { play(false); seek(END); },
  "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1),
  c: () => flip("contacts"), f: () => flip("forces"), n: () => flip("names"), g: () => flip("log"), l: () => flip("loop"),
  z: () => zoom(1.25), x: () => zoom(0.8), r: () => { view.whole = true; redraw(); }, t: () => $("theme").click(),
  m: () => arrange(!layout.beside), b: () => bringNext(),
};

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, focus = event.target;
  const ours = focus === document.body || focus === $("stage") || focus === $("time");
  if (!ours && (key === " " || key === "Home" || key === "End" || key.startsWith("Arrow") || focus.tagName === "SELECT")) return;
  if (key === "ArrowLeft" || key === "ArrowRight") stepFrames((key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? 10 : 1));
  else if (key >= "1" && key <= "9") flip(`model-${key - 1}`);
  else if (KEYS[key]) KEYS[key]();
  else return;
  event.preventDefault();
}

// A drag moves the view, and a click brings the panel's model to the front.
function onStage() {
  const canvas = $("stage"), at = e => { const box = canvas.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
  let moved = 0;
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(-0.0015 * e.deltaY), ...at(e)); }, { passive: false });
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); moved = 0; });
  canvas.addEventListener("pointermove", e => {
    if (!e.buttons) return;
    moved += Math.abs(e.movementX) + Math.abs(e.movementY);
    if (moved <= 3) return;
    view.whole = false; view.x -= e.movementX / view.scale; view.y += e.movementY / view.scale; redraw();
  });
  canvas.addEventListener("pointerup", e => { const panel = moved > 3 ? null : panelAt(...at(e)); if (panel) bringFront(panel.clip.index); });
}

function start() {
  $("title").textContent = document.title;
  layout.most = () => Math.min(0.6 * window.innerHeight, 600);
  $("time").max = END;
  SPEEDS.forEach((s, i) => element("option", `${short(s * FULL)} per s`, $("speed"), { value: i, selected: s === 1 }));
  $("beside").onchange = $("single").onchange = () => arrange($("beside").checked);
  $("gap-title").textContent = `least gap of each contact${inUnit("length")}, along time`;
  $("push-title").textContent = DATA.push ? `${DATA.push} of each contact${inUnit("force")}, along time` : "";
  $("push-figure").hidden = !DATA.push;
  if (window.matchMedia("(prefers-color-scheme: dark)").matches) root.classList.add("dark");
  buildModels(); paintTheme(); arrange(CLIPS.length > 1);
  $("theme").onclick = () => { root.classList.toggle("dark"); paintTheme(); };
  $("play").onclick = () => play(!state.playing);
  $("back").onclick = () => stepFrames(-1);
  $("ahead").onclick = () => stepFrames(1);
  $("time").oninput = () => { play(false); seek(+$("time").value); };
  for (const id of ["contacts", "forces", "names"]) $(id).onchange = () => redraw();
  $("log").onchange = () => redraw(true);
  $("arrows").oninput = () => redraw();
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", () => redraw(true));
  onStage();
  requestAnimationFrame(tick);
  if (!reduced) play(true);
}

start();
