// The page of runs in space: contacts in words, the graphics card, and how the eye moves.

const NAMED = 12;  // names of more bodies than these are shown on demand only
const CROWD = 12;  // so are cones of more contacts at a time
const ROWS = 6;    // pairs of bodies that are told in words

function picture(t) {
  drawStage(t, options(1));
  const unit_ = DATA.units.length, grid = CLIPS.some(c => DATA.casts[c.cast].some(s => s.kind === "plane")) ? `grid ${withUnit(stage.cell, unit_)}` : "";
  const arrows = CLIPS.some(c => c.force.length) ? `${withUnit(stage.cell, unit_)} of arrow is ${withUnit(+(stage.cell / stage.perForce).toPrecision(2), DATA.units.force)}` : "";
  $("scales").textContent = [grid, arrows].filter(Boolean).join("; ");
  tellContacts(t);
}

// Pairs of bodies that touch now, those with the largest forces first: normal force, and how much of the friction of
// their contacts is used in all.
function tellContacts(t) {
  const clip = inFront(), box = $("now"), rows = new Map();
  box.replaceChildren();
  if (!clip) return;
  const k = frameAt(clip, t);
  for (let i = clip.first[k]; i < clip.first[k + 1]; i++) {
    const row = rows.get(clip.pair[i]) || { name: clip.pairs[clip.pair[i]], push: 0, pull: 0, most: 0, modes: [0, 0, 0] }, f = clip.force.subarray(3 * i, 3 * i + 3);
    const push = dot(f, clip.normal.subarray(3 * i, 3 * i + 3)), pull = Math.sqrt(Math.max(0, dot(f, f) - push * push));
    row.modes[clip.mode[i]]++;
    rows.set(clip.pair[i], row);
    if (clip.mode[i] === OPEN) continue;
    row.push += push; row.pull += pull; row.most += clip.friction[i] * push;
  }
  const sorted = [...rows.values()].sort((a, b) => b.push - a.push);
  for (const { name, push, pull, most, modes } of sorted.slice(0, ROWS)) {
    const line = element("div", "", box, { title: modes.map((n, m) => n ? `${n} ${["open", "sticking", "slipping"][m]}` : "").filter(Boolean).join(", ") });
    element("i", "", line).style.background = colours[MODES[modes[SLIP] ? SLIP : modes[STICK] ? STICK : OPEN]];
    element("span", name, line, { className: "pair" });
    element("span", push > 0 ? `${withUnit(+push.toPrecision(3), DATA.units.force)}, ${most > 0 ? Math.round(100 * pull / most) : 0} %` : "near", line, { className: "value" });
  }
  if (sorted.length > ROWS) element("div", `and ${sorted.length - ROWS} more`, box);
  if (!sorted.length) element("div", "none", box);
}

function onModel(row, clip) {
  const solid = element("input", "", row, { type: "range", min: 0.1, max: 1, step: "any", value: clip.solidity, className: "solidity", ariaLabel: `how solid ${clip.label} is as a ghost`, title: "How solid it is as a ghost" });
  solid.oninput = () => { clip.solidity = +solid.value; redraw(); };
}

function stageLegend(box) {
  const icon = (text, colour, path) => legendRow(box, text, g => { g.fillStyle = colour; g.beginPath(); path(g); g.closePath(); g.fill(); });
  if (!CLIPS.some(c => c.mode.length)) return;
  icon("contact open", colours.open, g => g.arc(17, 9, 5, 0, 2 * Math.PI));
  icon("contact sticks", colours.stick, g => g.rect(12, 4, 10, 10));
  icon("contact slips", colours.slip, g => { g.moveTo(17, 3); g.lineTo(23, 14); g.lineTo(11, 14); });
  legendRow(box, "force and cone of friction: on the rim it slips", g => {
    g.fillStyle = g.strokeStyle = colours.slip; g.globalAlpha = 0.2; g.beginPath(); g.moveTo(17, 17); g.lineTo(7, 4); g.lineTo(27, 4); g.closePath(); g.fill();
    g.globalAlpha = 1; g.lineWidth = 2; g.beginPath(); g.moveTo(17, 17); g.lineTo(24.5, 7); g.stroke();
    g.beginPath(); g.moveTo(27, 3.5); g.lineTo(26.5, 10); g.lineTo(21.5, 6); g.closePath(); g.fill();
  });
}

const KEYS = {
  z: () => zoom(1.25), x: () => zoom(0.8), r: () => showSide(0), y: showNow, v: () => showSide(view.side + 1),
  a: () => turn(0.1, 0), d: () => turn(-0.1, 0), w: () => turn(0, 0.1), s: () => turn(0, -0.1),
};

// The pictures begin anew where the browser took the graphics card away.
function onGpu(canvas) {
  gpu = makeGpu(canvas);
  $("no-gpu").hidden = gpu !== null;
  canvas.addEventListener("webglcontextlost", e => e.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => { gpu = makeGpu(canvas); redraw(); });
}

function start() {
  startPlayer();
  readColours();
  onGpu($("stage"));
  $("now-box").hidden = !CLIPS.some(c => c.mode.length);
  $("names").checked = CLIPS[0].moving.length <= NAMED;
  $("cones").checked = CLIPS[0].mode.length <= CROWD * CLIPS[0].time.length;
  $("now").style.minHeight = `${1.4 * Math.min(ROWS + 1, CLIPS[0].pairs.length)}em`;
  SIDES.forEach(([name], side) => { element("button", name, $("sides"), { type: "button" }).onclick = () => showSide(side); });
  element("button", "now", $("sides"), { type: "button", title: "Closer, to what moves now (Y)" }).onclick = showNow;
  startRuns("models: shown, in front, as a ghost", false);
  onCamera($("stage"), (x, y) => { const panel = panelAt(x, y); if (panel) bringFront(panel.clip.index); });
  begin();
}

start();
