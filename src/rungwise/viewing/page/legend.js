// What marks and colours mean, and what is said of how runs end.

function legendRow(box, text, paint) {
  const row = element("div", "", box), c = element("canvas", "", row), ratio = window.devicePixelRatio || 1;
  c.width = 34 * ratio; c.height = 18 * ratio; c.style.width = "34px"; c.style.height = "18px";
  const g = c.getContext("2d"); g.setTransform(ratio, 0, 0, ratio, 0, 0); paint(g);
  element("span", text, row);
}

// Rows that explain the stage; the scales of lengths and forces stand below it.
function stageLegend(box) {
  legendRow(box, "contact open", g => mark(g, 17, 9, OPEN, colours.open));
  legendRow(box, "contact sticks, or rests", g => mark(g, 17, 9, STICK, colours.stick));
  legendRow(box, "contact slips", g => mark(g, 17, 9, SLIP, colours.slip));
  if (CLIPS.some(c => c.force.length)) {
    legendRow(box, "force, at its scale", g => arrow(g, 31, 9, DATA.force, 0, 28, colours.ink, null));
    legendRow(box, "force too large for its arrow", g => { arrow(g, 31, 9, DATA.force, 0, 28, colours.ink, null); breakAt(g, 11, 9, 1, 0, colours.ink); });
  }
  if (!layout.beside && shown().length > 1)
    legendRow(box, "another model, where it is elsewhere", g => {
      g.strokeStyle = colours.models[shown().find(c => c !== inFront()).index]; g.lineWidth = 2.2; g.strokeRect(5, 3, 24, 12);
    });
  for (const role of new Set(CLIPS.flatMap(c => c.bodies.map(b => b.role))))
    legendRow(box, role, g => { g.fillStyle = colours[role]; g.strokeStyle = colours.ink; g.fillRect(5, 3, 24, 12); g.strokeRect(5, 3, 24, 12); });
}

// Every reason once, under the outcome that it explains; with the models it is about where an outcome has several.
function tellReasons(box, clips, nameOf) {
  box.replaceChildren();
  const said = new Map();
  for (const clip of clips) if (clip.reason) {
    const key = JSON.stringify([clip.outcome, clip.reason]);
    said.set(key, [...(said.get(key) || []), clip]);
  }
  const groups = [...said.values()];
  for (const group of groups) {
    const { outcome, reason } = group[0], alone = groups.filter(other => other[0].outcome === outcome).length === 1;
    const line = element("p", "", box, { className: "reason" });
    element("b", alone ? outcome : `${outcome} (${group.map(nameOf).join(", ")})`, line);
    line.append(`: ${reason}`);
  }
}
