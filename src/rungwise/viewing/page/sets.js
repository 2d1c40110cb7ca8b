// The page of sets: what is chosen, the run nearest to it, and controls.

const state = { t: 0, playing: false, stage: true, slice: true, space: true, fine: 0, last: 0, frames: 0, work: 0 };
const end = () => Math.max(0, ...runsOf(chosen.run).map(c => c.time[c.time.length - 1]));
const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

function redraw() { state.stage = state.slice = state.space = true; state.fine = performance.now() + 250; }
function play(on) { if (on && state.t >= end()) state.t = 0; state.playing = on; state.last = 0; $("play").textContent = on ? "pause" : "play"; }
function seek(t) { state.t = Math.min(end(), Math.max(0, t)); state.stage = true; }

function choose(part) {
  chosen.point = Float64Array.from(part);
  Object.assign(chosen, nearest(chosen.point));
  state.t = 0; play(!reduced);
  tell(); redraw();
}

// Everything that is said in words about the chosen point.
function tell() {
  const at = values(chosen.point), set = SETS[chosen.model], row = DATA.runs[chosen.run];
  others().forEach(a => {
    const slider = $(`value-${a}`);
    if (+slider.value !== chosen.point[a]) slider.value = chosen.point[a];
    slider.setAttribute("aria-valuetext", String(at[a]));
    slider.nextElementSibling.textContent = `${at[a]}`;
  });
  const fixed = others().map(a => `, ${DATA.over[a].name} = ${short(at[a])}`).join("");
  $("slice-title").textContent = `${set.name}${fixed}`;
  SETS.forEach((s, k) => {
    $(`here-${k}`).textContent = DATA.labels[labelAt(s, chosen.point)];
    const clip = runsOf(chosen.run)[k];
    $(`run-${k}`).textContent = clip ? clip.outcome : "";
  });
  layout.front = chosen.model;
  tellReasons($("reasons"), runsOf(chosen.run), clip => clip.label);
  const list = (part, digits) => DATA.over.map((o, a) => `${o.name} = ${+values(part)[a].toPrecision(digits)}`).join(", ");
  $("run-title").textContent = row ? `stored run at ${list(row.at, 4)}` : "no run is stored";
  $("where").textContent = `Chosen: ${list(chosen.point, 6)}.` + (row ? ` The nearest of ${DATA.runs.length} stored points`
    + ` ${ALIKE[chosen.alike]} is ${short(100 * distance(row.at, chosen.point))} % of the box away.` : "");
  $("command").textContent = commandOf(set, at);
}

// A model between two rungs, and a motion that is not the slowest, have no name on the command line.
function commandOf(set, at) {
  const { scene, model, fixed, options } = set.command;
  if (!model) return `found.replay(found.parameters | {${DATA.over.map((o, a) => `"${o.name}": ${at[a]}`).join(", ")}})`;
  const sets = DATA.over.map((o, a) => `--set ${o.name}=${at[a]} `).join("");
  return `rungwise sim ${scene} --model ${model} ${fixed}${sets}${options} --out run\nrungwise view run --html run.html`;
}

function tick(now) {
  const began = performance.now();
  if (state.playing) {
    const passed = state.last ? Math.min(0.1, (now - state.last) / 1000) : 0;
    state.last = now; state.stage = true;
    state.t += passed * (end() || 1) / 4;  // four seconds, and one more at the end
    if (state.t >= 1.25 * end()) state.t = 0;
  }
  if (state.stage) {
    const t = Math.min(state.t, end());
    drawStage(t, { forces: true, contacts: true, names: true, length: 50 });
    $("time").max = end(); $("time").value = t; $("clock").textContent = `t = ${t.toPrecision(3)} of ${withUnit(end(), DATA.units.time)}`;
  }
  if (state.slice) drawSlice();
  if (D === 3 && (state.space || (state.fine && now > state.fine))) {
    const fine = state.fine > 0 && now > state.fine;
    drawSpace(fine);
    if (fine) state.fine = 0;
  }
  if (state.stage || state.slice || state.space) { state.frames++; state.work += performance.now() - began; }
  state.stage = state.slice = state.space = false;
  requestAnimationFrame(tick);
}

function buildSliders() {
  const box = $("sliders");
  box.replaceChildren();
  if (D > 2) {
    const pair = element("div", "", box, { className: "row" });
    for (const [name, key, other] of [["across", "across", "up"], ["up", "up", "across"]]) {
      const label = element("span", `${name} `, pair), select = element("select", "", label, { id: key, ariaLabel: `parameter ${name}` });
      DATA.over.forEach((o, a) => element("option", o.name, select, { value: a, selected: chosen[key] === a }));
      select.onchange = () => {
        if (chosen[other] === +select.value) chosen[other] = chosen[key];
        chosen[key] = +select.value; buildSliders(); tell(); redraw(); $(key).focus();
      };
    }
  }
  for (const a of others()) {
    const label = element("label", "", box);
    element("span", DATA.over[a].name, label);
    const slider = element("input", "", label, { type: "range", min: 0, max: 1, step: "any", value: chosen.point[a], id: `value-${a}` });
    element("output", "", label);
    slider.oninput = () => { const p = Float64Array.from(chosen.point); p[a] = +slider.value; choose(p); };
  }
}

function buildModels() {
  const table = $("models"), head = element("tr", "", table);
  for (const text of ["show", "slice", "model", ...DATA.present.map(k => DATA.labels[k]), "runs", "at the point", "stored run"]) element("th", text, head);
  SETS.forEach((set, k) => {
    const row = element("tr", "", table);
    const show = element("input", "", element("td", "", row), { type: "checkbox", checked: true, id: `show-${k}`, ariaLabel: `show ${set.name}` });
    show.onchange = () => { set.visible = show.checked; buildLegend(); redraw(); };
    const pickModel = element("input", "", element("td", "", row), { type: "radio", name: "slice", checked: k === 0, id: `pick-${k}`, ariaLabel: `slice of ${set.name}` });
    pickModel.onchange = () => { chosen.model = k; choose(chosen.point); };
    const name = element("td", "", row), swatch = element("span", "", name, { className: "swatch" });
    swatch.style.background = `var(--model-${k % PALETTE.length})`;
    name.append(set.name);
    for (const label of DATA.present) element("td", `${(100 * (set.volumes[DATA.labels[label]] || 0)).toFixed(2)} %`, row);
    element("td", `${set.evaluations}${set.complete ? "" : " (budget spent)"}`, row);
    element("td", "", row, { id: `here-${k}` });
    element("td", "", row, { id: `run-${k}` });
  });
  $("parts").textContent = `Parts of the box by label, within ${(100 * DATA.error).toFixed(2)} % (one standard error). Boundaries are located within `
    + `${short(100 * DATA.tol)} % of each side; pictures have ${N} cells along each.`;
}

function buildLegend() {
  const box = $("legend");
  box.replaceChildren();
  for (const k of DATA.present)
    legendRow(box, DATA.labels[k], g => { g.fillStyle = labelColour(k); g.strokeStyle = colours.faint; g.lineWidth = 1; g.fillRect(5, 3, 24, 12); g.strokeRect(5, 3, 24, 12); });
  const many = visible(), sample = colour => g => { g.strokeStyle = colour; g.lineWidth = LINE; line(g, 2, 9, 32, 9); };
  for (const set of many) legendRow(box, `feasible part ends: ${set.name}`, sample(set.colour()));
  if (many.length > 1) {
    legendRow(box, "striped: these models' boundaries coincide", g => many.slice(0, 4).forEach((set, k, all) => {
      g.strokeStyle = set.colour(); g.lineWidth = LINE; line(g, 2 + 30 * k / all.length, 9, 2 + 30 * (k + 1) / all.length, 9);
    }));
    legendRow(box, "hatched: the shown models' labels differ", g => { g.beginPath(); g.rect(5, 2, 24, 14); g.clip(); hatchLines(g, 5, 2, 24, 14); });
  }
  legendRow(box, "chosen point", g => cross(g, 17, 9));
  legendRow(box, "stored runs; the one that is played", g => { runSpot(g, 9, 9, false); runSpot(g, 24, 9, true); });
  $("stage-legend").replaceChildren();
  stageLegend($("stage-legend"));
}

function paintTheme() {
  const dark = root.classList.contains("dark");
  PALETTE.forEach((pair, i) => root.style.setProperty(`--model-${i}`, pair[dark ? 1 : 0]));
  readColours(); buildLegend(); redraw();
}

function turn(yaw, pitch) {
  eye.yaw += yaw; eye.pitch = Math.min(1.55, Math.max(-1.55, eye.pitch + pitch));
  state.space = true; state.fine = performance.now() + 250;
}

function onSpace() {
  const canvas = $("space");
  let moved = 0;
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); moved = 0; });
  canvas.addEventListener("pointermove", e => {
    if (!e.buttons) return;
    moved += Math.abs(e.movementX) + Math.abs(e.movementY);
    if (moved > 3) turn(-0.01 * e.movementX, 0.01 * e.movementY);
  });
  canvas.addEventListener("pointerup", e => {
    if (moved > 3) return;
    const box = canvas.getBoundingClientRect(), found = pick(e.clientX - box.left, e.clientY - box.top);
    if (found) choose(found.part);
  });
  canvas.addEventListener("wheel", e => {
    e.preventDefault(); eye.zoom = Math.min(6, Math.max(0.4, eye.zoom * Math.exp(-0.0015 * e.deltaY))); turn(0, 0);
  }, { passive: false });
  $("cut").onchange = redraw;
}

function onSlice() {
  const canvas = $("slice"), at = e => { const box = canvas.getBoundingClientRect(); choose(partsAt(e.clientX - box.left, e.clientY - box.top)); };
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); at(e); });
  canvas.addEventListener("pointermove", e => { if (e.buttons) at(e); });
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const arrow = ARROWS[event.key], focus = event.target;
  if (arrow && focus === $("space")) turn(0.1 * arrow[0], -0.1 * arrow[1]);
  else if (arrow && focus === $("slice")) {
    const part = Float64Array.from(chosen.point), move = (a, by) => { part[a] = Math.min(1, Math.max(0, part[a] + by / N)); };
    move(chosen.across, arrow[0]);
    if (chosen.up >= 0) move(chosen.up, arrow[1]);
    choose(part);
  } else if (event.key === " " && (focus === document.body || focus.tagName === "CANVAS")) play(!state.playing);
  else if (event.key === "t" && focus.tagName !== "SELECT") $("theme").click();
  else return;
  event.preventDefault();
}

function start() {
  $("title").textContent = document.title;
  $("about").textContent = DATA.over.map(o => `${o.name} in ${short(rounded(o.low, o))} to ${short(o.high)}${o.unit ? " " + o.unit : ""}`).join(", ");
  if (window.matchMedia("(prefers-color-scheme: dark)").matches) root.classList.add("dark");
  $("space-part").hidden = D !== 3;
  document.querySelector("main").classList.toggle("two", D !== 3);
  buildSliders(); buildModels(); paintTheme();
  if (D === 3) onSpace();
  onSlice();
  $("beside-part").hidden = SETS.length === 1;
  $("beside").onchange = () => { layout.beside = $("beside").checked; buildLegend(); redraw(); };
  $("theme").onclick = () => { root.classList.toggle("dark"); paintTheme(); };
  $("play").onclick = () => play(!state.playing);
  $("time").oninput = () => { play(false); seek(+$("time").value); };
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", redraw);
  choose(chosen.point);
  requestAnimationFrame(tick);
}

start();
