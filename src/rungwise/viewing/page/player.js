// The player: models, one of which is in front; their arrangement; the theme; keys. A page lists its models in `MODELS`, says
// what its marks mean, by `captions`, what follows when another model comes to the front, by `fronted`, and which keys it has
// beside those of all pages, by `KEYS`.

const SHARED_KEYS = {
  ...PLAYING, t: () => $("theme").click(), m: () => arrange(!layout.beside), b: () => bringNext(),
};

function flip(id) { const box = $(id); if (box) { box.checked = !box.checked; box.dispatchEvent(new Event("change")); } }

function visibleBox(parent, model, name) {
  const box = element("input", "", parent, { type: "checkbox", checked: true, id: `model-${model.index}`, ariaLabel: `show ${name}` });
  box.onchange = () => { model.visible = box.checked; captions(); redraw(true); };
}

function frontBox(parent, model, says) {
  const box = element("input", "", parent, { type: "radio", name: "front", checked: model.index === layout.front, id: `front-${model.index}`, ...says });
  box.onchange = () => bringFront(model.index);
}

function swatch(parent, model) {
  element("span", "", parent, { className: "swatch" }).style.background = `var(--model-${model.index % PALETTE.length})`;
}

function bringFront(index) {
  layout.front = index;
  $(`front-${index}`).checked = true;
  if (!MODELS[index].visible) flip(`model-${index}`);
  fronted();
}

function bringNext() {
  const seen = MODELS.filter(model => model.visible), now = Math.max(0, seen.findIndex(model => model.index === layout.front));
  if (seen.length) bringFront(seen[(now + 1) % seen.length].index);
}

function arrange(beside) {
  layout.beside = beside;
  $("beside").checked = beside; $("single").checked = !beside;
  captions(); redraw();
}

function paintTheme() {
  const dark = root.classList.contains("dark");
  PALETTE.forEach((pair, i) => root.style.setProperty(`--model-${i}`, pair[dark ? 1 : 0]));
  readColours(); captions(); redraw(true);
}

function onKey(event) {
  if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, focus = event.target;
  const ours = focus === document.body || focus.tagName === "CANVAS" || focus === $("time");
  if (!ours && (key === " " || key === "Home" || key === "End" || key.startsWith("Arrow") || focus.tagName === "SELECT")) return;
  if (key === "ArrowLeft" || key === "ArrowRight") stepFrames((key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? 10 : 1));
  else if (key >= "1" && key <= "9") flip(`model-${key - 1}`);
  else if (KEYS[key] || SHARED_KEYS[key]) (KEYS[key] || SHARED_KEYS[key])();
  else return;
  event.preventDefault();
}

function startPlayer() {
  $("title").textContent = document.title;
  startClock();
  if (window.matchMedia("(prefers-color-scheme: dark)").matches) root.classList.add("dark");
  $("theme").onclick = () => { root.classList.toggle("dark"); paintTheme(); };
  $("beside").onchange = $("single").onchange = () => arrange($("beside").checked);
  $("views").hidden = MODELS.length === 1;
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", () => redraw(true));
}
