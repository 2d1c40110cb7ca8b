// What marks and colours mean, and what is said of how runs end.

function legendRow(box, text, paint) {
  const row = element("div", "", box), c = element("canvas", "", row), ratio = window.devicePixelRatio || 1;
  c.width = 34 * ratio; c.height = 18 * ratio; c.style.width = "34px"; c.style.height = "18px";
  const g = c.getContext("2d"); g.setTransform(ratio, 0, 0, ratio, 0, 0); paint(g);
  element("span", text, row);
}

// Every reason once, under the outcome that it explains; with the models it is about where an outcome has several.
function tellReasons(clips) {
  const box = $("reasons"), said = new Map();
  box.replaceChildren();
  for (const clip of clips) if (clip.reason) {
    const key = JSON.stringify([clip.outcome, clip.reason]);
    said.set(key, [...(said.get(key) || []), clip]);
  }
  const groups = [...said.values()];
  for (const group of groups) {
    const { outcome, reason } = group[0], alone = groups.filter(other => other[0].outcome === outcome).length === 1;
    const line = element("p", "", box, { className: "reason" });
    element("b", alone ? outcome : `${outcome} (${group.map(clip => clip.label).join(", ")})`, line);
    line.append(`: ${reason}`);
  }
}
