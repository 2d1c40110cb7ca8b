// The player: models, arrangement, what is said in words, and keys of its own.

function paint(t) {
  drawStage(t, { forces: $("forces").checked, contacts: $("contacts").checked, names: $("names").checked,
    length: 70 * 10 ** +$("arrows").value });
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

const KEYS = {
  c: () => flip("contacts"), f: () => flip("forces"), n: () => flip("names"), g: () => flip("log"),
  z: () => zoom(1.25), x: () => zoom(0.8), r: () => { view.whole = true; redraw(); },
  m: () => arrange(!layout.beside), b: () => bringNext(),
};

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
  startClock();
  layout.most = () => Math.min(0.6 * window.innerHeight, 600);
  $("beside").onchange = $("single").onchange = () => arrange($("beside").checked);
  $("gap-title").textContent = `least gap of each contact${inUnit("length")}, along time`;
  $("push-title").textContent = DATA.push ? `${DATA.push} of each contact${inUnit("force")}, along time` : "";
  $("push-figure").hidden = !DATA.push;
  buildModels(); paintTheme(); arrange(CLIPS.length > 1);
  for (const id of ["contacts", "forces", "names"]) $(id).onchange = () => redraw();
  $("arrows").oninput = () => redraw();
  onStage();
  begin();
}

start();
