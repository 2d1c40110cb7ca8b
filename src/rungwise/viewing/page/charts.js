// Curves along time: drawn once into a picture of their own, over which the cursor moves. The model in front has bold
// curves, and those of others show where they are elsewhere.

const EDGE = { left: 62, right: 12, top: 8, bottom: 24 };
const USUAL = 0.95, NONE = 1e-6, PEAK = 3, LEVEL = 14, LEVELS = 3;
const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3], [4, 2], [1, 5], [12, 6], [6, 2, 1, 2]];

const known = value => !Number.isNaN(value);  // a gap beyond reach is not

function ticksOf(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find(m => m * power >= raw), out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) out.push(i * step);
  return out;
}

class Chart {
  constructor(id, field) {
    this.canvas = $(id); this.field = field; this.picture = document.createElement("canvas"); this.stale = true;
    this.canvas.addEventListener("pointerdown", e => { this.canvas.setPointerCapture(e.pointerId); this.pick(e); });
    this.canvas.addEventListener("pointermove", e => { if (e.buttons) this.pick(e); });
  }

  pick(event) {
    const part = (placeIn(event)[0] - EDGE.left) / (this.canvas.getBoundingClientRect().width - EDGE.left - EDGE.right);
    seek(END * Math.min(1, Math.max(0, part)));
  }

  // Linear, or linear about zero and logarithmic beyond about a ten-thousandth of the largest value.
  scale(y) { return this.log ? Math.sign(y) * Math.log10(1 + Math.abs(y) / this.small) : y; }

  series() { return shown().flatMap(clip => DATA.contacts.map((name, c) => ({ clip, name, c }))); }

  style(s) { return shown().length > 1 ? [colours.models[s.clip.index], DASHES[s.c % DASHES.length]]
    : [css(`--model-${s.c % PALETTE.length}`), s.c < PALETTE.length ? [] : DASHES[1]]; }

  // Series in the order in which they are drawn, the model in front last.
  ordered() { const front = inFront(); return this.series().sort((a, b) => (a.clip === front) - (b.clip === front)); }

  values(s) {
    const n = DATA.contacts.length, all = s.clip[this.field];
    return Array.from({ length: s.clip.time.length }, (_, k) => all[k * n + s.c]);
  }

  // A value that is exceeded for one twentieth of the time in which the curves are above zero (a millionth is none).
  usual(high) {
    const parts = this.series().flatMap(s => this.values(s).map((v, k) => [v, s.clip.time[k] - (s.clip.time[k - 1] ?? 0)]))
      .filter(([v]) => v > NONE * high).sort((a, b) => a[0] - b[0]);
    let left = USUAL * parts.reduce((sum, [, w]) => sum + w, 0);
    return (parts.find(([, w]) => (left -= w) <= 0) || [0])[0];
  }

  render(log) {
    const [width, height, ratio] = fitted(this.canvas);
    this.log = log; this.stale = false;
    const all = this.series().map(s => this.values(s).filter(known)), bounded = (pick, start) => all.reduce((m, row) => row.reduce((a, b) => pick(a, b), m), start);
    let low = bounded(Math.min, 0), high = bounded(Math.max, 0);
    if (high === low) high = low + 1;
    this.small = 10 ** (Math.floor(Math.log10(Math.max(high, -low))) - 4);
    const usual = this.usual(high);
    this.limit = !log && usual > 0 && high > PEAK * usual ? 1.3 * usual : Infinity;
    high = Math.min(high, this.limit);
    const bottom = this.scale(low), top = this.scale(high) + (this.limit < Infinity ? 0 : 0.05 * (this.scale(high) - bottom));
    this.top = EDGE.top + (this.limit < Infinity ? LEVELS * LEVEL + 4 : 0);
    this.x = t => EDGE.left + (width - EDGE.left - EDGE.right) * t / (END || 1);
    this.y = v => height - EDGE.bottom - (height - this.top - EDGE.bottom) * (this.scale(v) - bottom) / (top - bottom);
    this.picture.width = this.canvas.width; this.picture.height = this.canvas.height;
    const g = this.picture.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.axes(g, width, height, low, high);
    this.curves(g, width, height);
    this.peaks = this.limit < Infinity ? this.excursions() : [];
    this.label(g, width);
  }

  curves(g, width, height) {
    const several = shown().length > 1, front = inFront();
    g.save();
    g.beginPath(); g.rect(EDGE.left - 2, this.top, width - EDGE.left - EDGE.right + 4, height - this.top - EDGE.bottom + 2); g.clip();
    g.lineJoin = "round";
    for (const s of this.ordered()) {
      const [colour, dash] = this.style(s), values = this.values(s);
      g.lineWidth = several && s.clip === front ? 2.8 : 1.6;
      g.strokeStyle = colour; g.setLineDash(dash); g.beginPath();
      values.forEach((v, k) => {
        if (known(v)) g[k && known(values[k - 1]) ? "lineTo" : "moveTo"](this.x(s.clip.time[k]), Math.max(-1e5, this.y(v)));
      });
      g.stroke();
    }
    g.restore();
  }

  // Stretches beyond the axis: the largest value of each, and when.
  excursions() {
    return this.ordered().flatMap(s => {
      const found = [];
      let now = null;
      this.values(s).forEach((v, k) => {
        if (!(v > this.limit)) { now = null; return; }
        if (!now) found.push(now = { s, value: v, time: s.clip.time[k] });
        if (v > now.value) Object.assign(now, { value: v, time: s.clip.time[k] });
      });
      return found;
    }).sort((a, b) => b.value - a.value);
  }

  // A triangle at the upper edge for each peak, and its value above, the largest first, as long as there is room.
  label(g, width) {
    const taken = [];
    g.font = "12px system-ui, sans-serif"; g.textAlign = "left"; g.textBaseline = "middle";
    for (const peak of this.peaks) {
      const x = this.x(peak.time), [colour] = this.style(peak.s), text = short(+peak.value.toPrecision(3)), wide = g.measureText(text).width + 8;
      g.fillStyle = colour;
      g.beginPath(); g.moveTo(x, this.top - 5); g.lineTo(x + 4.5, this.top + 3); g.lineTo(x - 4.5, this.top + 3); g.closePath(); g.fill();
      const left = Math.min(width - wide, Math.max(EDGE.left, x - wide / 2));
      const level = [...Array(LEVELS).keys()].find(l => !taken.some(o => o.level === l && left < o.left + o.wide && o.left < left + wide));
      peak.labelled = level !== undefined;
      if (!peak.labelled) continue;
      taken.push({ level, left, wide });
      g.fillText(text, left + 4, this.top - 12 - LEVEL * level);
    }
  }

  axes(g, width, height, low, high) {
    const heights = this.log
      ? [0, ...[1, 2, 3, 4, 5].flatMap(p => [this.small * 10 ** p, -this.small * 10 ** p])].filter(v => v >= low && v <= high)
      : ticksOf(low, high, 5);
    g.font = "12px system-ui, sans-serif"; g.lineWidth = 1; g.textBaseline = "middle";
    for (const v of heights) {
      g.strokeStyle = colours.line; g.beginPath(); g.moveTo(EDGE.left, this.y(v)); g.lineTo(width - EDGE.right, this.y(v)); g.stroke();
      g.fillStyle = colours.faint; g.textAlign = "right"; g.fillText(short(+v.toPrecision(6)), EDGE.left - 6, this.y(v));
    }
    g.textBaseline = "top"; g.textAlign = "center";
    for (const t of ticksOf(0, END || 1, Math.max(3, Math.min(8, width / 90)))) {
      g.strokeStyle = colours.line; g.beginPath(); g.moveTo(this.x(t), this.top); g.lineTo(this.x(t), height - EDGE.bottom); g.stroke();
      g.fillStyle = colours.faint; g.fillText(short(+t.toPrecision(6)), this.x(t), height - EDGE.bottom + 6);
    }
  }

  draw(t, log) {
    const [, height, ratio] = fitted(this.canvas);
    if (this.stale || this.picture.width !== this.canvas.width || this.picture.height !== this.canvas.height) this.render(log);
    const g = this.canvas.getContext("2d"), n = DATA.contacts.length;
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.clearRect(0, 0, this.canvas.width, this.canvas.height);
    g.drawImage(this.picture, 0, 0);
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.strokeStyle = colours.ink; g.lineWidth = 1.5;
    g.beginPath(); g.moveTo(this.x(t), this.top); g.lineTo(this.x(t), height - EDGE.bottom); g.stroke();
    for (const s of this.ordered()) {
      const [k] = locate(s.clip, t), value = Math.min(this.limit, s.clip[this.field][k * n + s.c]);
      if (!known(value)) continue;
      g.fillStyle = this.style(s)[0];
      g.beginPath(); g.arc(this.x(Math.min(t, s.clip.time[s.clip.time.length - 1])), this.y(value), s.clip === inFront() ? 4 : 3, 0, 2 * Math.PI); g.fill();
    }
  }
}
