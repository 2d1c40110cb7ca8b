// The page of sets: what is chosen, the run nearest to it, and controls.

const PACE = { seconds: 4, rest: 0.25 };
const SETTLED_MS = 250;  // after which surfaces are drawn finely
const MODELS = SETS;
const KEYS = {};

const end = () => Math.max(0, ...runsOf(chosen.run).map(c => c.time[c.time.length - 1]));

function paint(t, anew) {
  drawStage(t, { forces: true, contacts: true, names: true, length: 50 });
  if (anew) drawSlice();
  if (D === 3 && (anew || eye.turned || eye.settled)) {
    const fine = eye.settled && !anew && !eye.turned;
    drawSpace(fine);
    eye.turned = eye.settled = false;
    clearTimeout(eye.timer);
    if (!fine) eye.timer = setTimeout(() => { eye.settled = true; redraw(); }, SETTLED_MS);
  }
}

function choose(part) {
  chosen.point = Float64Array.from(part);
  Object.assign(chosen, nearest(chosen.point));
  state.t = 0; measure(); play(!reduced);
  tell(); redraw(true);
}

function fronted() { choose(chosen.point); }

// Everything that is said in words about the chosen point.
function tell() {
  const at = values(chosen.point), set = sliced(), row = DATA.runs[chosen.run];
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
  tellReasons(runsOf(chosen.run));
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
        chosen[key] = +select.value; buildSliders(); tell(); redraw(true); $(key).focus();
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

function buildTable() {
  const table = $("models"), head = element("tr", "", table);
  for (const text of ["show", "slice", "model", ...DATA.present.map(k => DATA.labels[k]), "runs", "at the point", "stored run"]) element("th", text, head);
  SETS.forEach((set, k) => {
    const row = element("tr", "", table);
    visibleBox(element("td", "", row), set, set.name);
    frontBox(element("td", "", row), set, { ariaLabel: `slice of ${set.name}` });
    const name = element("td", "", row);
    swatch(name, set);
    name.append(set.name);
    for (const label of DATA.present) element("td", `${(100 * (set.volumes[DATA.labels[label]] || 0)).toFixed(2)} %`, row);
    element("td", `${set.evaluations}${set.complete ? "" : " (budget spent)"}`, row);
    element("td", "", row, { id: `here-${k}` });
    element("td", "", row, { id: `run-${k}` });
  });
  $("parts").textContent = `Parts of the box by label, within ${(100 * DATA.error).toFixed(2)} % (one standard error). Boundaries are located within `
    + `${short(100 * DATA.tol)} % of each side; pictures have ${N} cells along each.`;
}

function captions() {
  const box = $("slice-legend");
  box.replaceChildren(); $("legend").replaceChildren();
  stageLegend($("legend"));
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
}

function turn(yaw, pitch) {
  eye.yaw += yaw; eye.pitch = Math.min(1.55, Math.max(-1.55, eye.pitch + pitch));
  eye.turned = true; redraw();
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

// Arrow keys of a canvas that has the focus.
function onArrows(canvas, pressed) {
  canvas.addEventListener("keydown", e => {
    if (!ARROWS[e.key] || e.ctrlKey || e.altKey || e.metaKey) return;
    pressed(...ARROWS[e.key]); e.preventDefault();
  });
}

function onSpace() {
  onPointer($("space"), {
    dragged: (dx, dy) => turn(-0.01 * dx, 0.01 * dy),
    clicked: (x, y) => { const found = pick(x, y); if (found) choose(found.part); },
    zoomed: factor => { eye.zoom = Math.min(6, Math.max(0.4, eye.zoom * factor)); turn(0, 0); },
  });
  onArrows($("space"), (right, up) => turn(0.1 * right, -0.1 * up));
  $("cut").onchange = () => redraw(true);
}

function onSlice() {
  const canvas = $("slice"), at = e => choose(partsAt(...placeIn(e)));
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); at(e); });
  canvas.addEventListener("pointermove", e => { if (e.buttons) at(e); });
  onArrows(canvas, (right, up) => {
    const part = Float64Array.from(chosen.point), move = (a, by) => { part[a] = Math.min(1, Math.max(0, part[a] + by / N)); };
    move(chosen.across, right);
    if (chosen.up >= 0) move(chosen.up, up);
    choose(part);
  });
}

function start() {
  layout.front = DATA.opening.front;
  startPlayer();
  $("about").textContent = DATA.over.map(o => `${o.name} in ${short(rounded(o.low, o))} to ${short(o.high)}${o.unit ? " " + o.unit : ""}`).join(", ");
  $("space-part").hidden = D !== 3;
  document.querySelector("main").classList.toggle("two", D !== 3);
  buildSliders(); buildTable(); paintTheme(); arrange(false);
  if (D === 3) onSpace();
  onSlice();
  choose(chosen.point);
  begin();
}

start();
