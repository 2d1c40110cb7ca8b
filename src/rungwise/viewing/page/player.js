// The player: clock, controls, keyboard, and what is said in words.

const SPEEDS = [0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const state = { t: 0, playing: false, dirty: true, last: 0, frames: 0, work: 0 };
const charts = [new Chart("gap", "gap"), new Chart("push", "push")];
const FULL = (END || 1) / 6;  // at speed 1 the whole takes six seconds

const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

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
    $("time").value = state.t;
    $("time").setAttribute("aria-valuetext", `${short(state.t)}`);
    $("clock").textContent = `t = ${state.t.toPrecision(4)} of ${short(END)}`;
    state.frames++; state.work += performance.now() - began;
  }
  requestAnimationFrame(tick);
}

function element(tag, text, parent, attributes) {
  const e = document.createElement(tag);
  if (text) e.textContent = text;
  Object.assign(e, attributes || {});
  parent.append(e);
  return e;
}

function buildModels() {
  CLIPS.forEach((clip, i) => {
    const label = element("label", "", $("models"));
    const box = element("input", "", label, { type: "checkbox", checked: true, id: `model-${i}` });
    box.addEventListener("change", () => { clip.visible = box.checked; captions(); redraw(true); });
    const swatch = element("span", "", label, { className: "swatch" });
    swatch.style.background = `var(--model-${i % PALETTE.length})`;
    element("span", ` ${clip.label}: ${clip.outcome}`, label, { title: clip.reason });
    element("p", clip.note, $("models"), { className: "note" });
  });
}

function legendRow(text, paint) {
  const row = element("div", "", $("legend")), c = element("canvas", "", row), ratio = window.devicePixelRatio || 1;
  c.width = 34 * ratio; c.height = 18 * ratio; c.style.width = "34px"; c.style.height = "18px";
  const g = c.getContext("2d"); g.setTransform(ratio, 0, 0, ratio, 0, 0); paint(g);
  element("span", text, row);
}

function captions() {
  const several = shown().length > 1, box = $("legend");
  box.replaceChildren();
  legendRow("contact open", g => mark(g, 17, 9, OPEN, colours.open, null));
  legendRow("contact sticks, or rests", g => mark(g, 17, 9, STICK, colours.stick, null));
  legendRow("contact slips", g => mark(g, 17, 9, SLIP, colours.slip, null));
  if (DATA.push) legendRow(`force; this long: ${short(DATA.force * 28 / 70)}${+$("arrows").value ? " / " + short(10 ** +$("arrows").value) : ""}`,
    g => arrow(g, 31, 9, DATA.force, 0, 28, colours.ink));
  DATA.contacts.forEach((name, c) => legendRow(name, g => {
    const [colour, dash] = charts[0].style({ clip: shown()[0] || CLIPS[0], c });
    g.strokeStyle = several ? colours.ink : colour; g.lineWidth = 2; g.setLineDash(dash);
    g.beginPath(); g.moveTo(2, 9); g.lineTo(32, 9); g.stroke();
  }));
  for (const role of new Set(CLIPS.flatMap(c => c.bodies.map(b => b.role))))
    legendRow(role, g => { g.fillStyle = colours[role]; g.strokeStyle = colours.ink; g.fillRect(5, 3, 24, 12); g.strokeRect(5, 3, 24, 12); });
}

function paintTheme() {
  const dark = root.classList.contains("dark");
  PALETTE.forEach((pair, i) => root.style.setProperty(`--model-${i}`, pair[dark ? 1 : 0]));
  readColours(); captions(); redraw(true);
}

function zoom(factor, x, y) {
  const box = $("stage").getBoundingClientRect(), dx = (x ?? box.width / 2) - box.width / 2, dy = box.height / 2 - (y ?? box.height / 2);
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

function start() {
  $("title").textContent = document.title;
  $("time").max = END;
  SPEEDS.forEach((s, i) => element("option", `${short(s * FULL)} per s`, $("speed"), { value: i, selected: s === 1 }));
  $("gap-title").textContent = "least gap of each contact, along time";
  $("push-title").textContent = DATA.push ? `${DATA.push} of each contact, along time` : "";
  $("push-figure").hidden = !DATA.push;
  if (window.matchMedia("(prefers-color-scheme: dark)").matches) root.classList.add("dark");
  buildModels(); paintTheme();
  $("theme").onclick = () => { root.classList.toggle("dark"); paintTheme(); };
  $("play").onclick = () => play(!state.playing);
  $("back").onclick = () => stepFrames(-1);
  $("ahead").onclick = () => stepFrames(1);
  $("time").oninput = () => { play(false); seek(+$("time").value); };
  for (const id of ["contacts", "forces", "names"]) $(id).onchange = () => redraw();
  $("log").onchange = () => redraw(true);
  $("arrows").oninput = () => { captions(); redraw(); };
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", () => redraw(true));
  const stage = $("stage");
  stage.addEventListener("wheel", e => {
    e.preventDefault();
    const box = stage.getBoundingClientRect();
    zoom(Math.exp(-0.0015 * e.deltaY), e.clientX - box.left, e.clientY - box.top);
  }, { passive: false });
  stage.addEventListener("pointerdown", e => stage.setPointerCapture(e.pointerId));
  stage.addEventListener("pointermove", e => {
    if (!e.buttons) return;
    view.whole = false; view.x -= e.movementX / view.scale; view.y += e.movementY / view.scale; redraw();
  });
  requestAnimationFrame(tick);
  if (!reduced) play(true);
}

start();
