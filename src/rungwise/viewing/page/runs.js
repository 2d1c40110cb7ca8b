// What pages of runs have in common: models with their outcomes, what is shown, and curves. The page draws the stage, by
// `picture`, and may add to the row of a model, by `onModel`.

const END = Math.max(...CLIPS.map(c => c.time[c.time.length - 1]));
const PACE = { seconds: DATA.real ? END : 6, rest: 0 };
const MODELS = CLIPS;
const charts = [new Chart("gap", "gap"), new Chart("push", "push")];
const toggles = [...document.querySelectorAll("#show input[type=checkbox]")];

const end = () => END;
const shown = () => CLIPS.filter(c => c.visible);

// What is shown, by name; arrows are `length` long before the slider.
function options(length) {
  return { ...Object.fromEntries(toggles.map(box => [box.id, box.checked])), length: length * 10 ** +$("arrows").value };
}

function paint(t, anew) {
  picture(t);
  for (const chart of charts) { chart.stale ||= anew; chart.draw(t, $("log").checked); }
  $("push-peaks").textContent = charts[1].peaks.length ? "; \u25b2 peaks beyond the axis" : "";
}

function fronted() { captions(); redraw(true); }

function buildModels(heading) {
  const box = $("models"), several = CLIPS.length > 1;
  for (const clip of CLIPS) {
    const row = element("div", "", box, { className: "model" });
    visibleBox(row, clip, clip.label);
    const label = element("label", "", row);
    frontBox(label, clip); swatch(label, clip);
    element("span", clip.outcome ? `${clip.label}: ${clip.outcome}` : clip.label, label);
    if (several) onModel(row, clip);
    clip.notes.forEach(note => element("p", note, box, { className: "note" }));
  }
  box.classList.toggle("alone", !several);
  $("models-title").textContent = several ? heading : "model";
  tellReasons(CLIPS);
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

// A curve says what it is, or is not there.
function nameCurve(kind, unit) {
  $(`${kind}-title`).textContent = DATA[kind] ? `${DATA[kind]}${inUnit(unit)}, along time` : "";
  $(`${kind}-figure`).hidden = !DATA[kind];
}

function startRuns(heading, beside) {
  nameCurve("gap", "length"); nameCurve("push", "force");
  for (const box of toggles) {
    KEYS[box.parentElement.querySelector("kbd").textContent.toLowerCase()] = () => flip(box.id);
    box.onchange = () => redraw(true);
  }
  $("arrows").oninput = () => redraw();
  buildModels(heading); paintTheme(); arrange(beside);
}
