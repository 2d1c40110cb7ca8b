// Curves along time: drawn once into a picture of their own, over which the cursor moves.

const EDGE = { left: 62, right: 12, top: 8, bottom: 24 };
const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3], [4, 2], [1, 5], [12, 6], [6, 2, 1, 2]];

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
    const box = this.canvas.getBoundingClientRect();
    const part = (event.clientX - box.left - EDGE.left) / (box.width - EDGE.left - EDGE.right);
    seek(END * Math.min(1, Math.max(0, part)));
  }

  // Linear, or linear about zero and logarithmic beyond about a ten-thousandth of the largest value.
  scale(y) { return this.log ? Math.sign(y) * Math.log10(1 + Math.abs(y) / this.small) : y; }

  series() { return shown().flatMap(clip => DATA.contacts.map((name, c) => ({ clip, name, c }))); }

  style(s) { return shown().length > 1 ? [colours.models[s.clip.index], DASHES[s.c % DASHES.length]]
    : [css(`--model-${s.c % PALETTE.length}`), s.c < PALETTE.length ? [] : DASHES[1]]; }

  render(log) {
    const [width, height, ratio] = fitted(this.canvas), n = DATA.contacts.length;
    this.log = log; this.stale = false;
    let low = 0, high = 0;
    for (const { clip, c } of this.series()) for (let k = c; k < clip[this.field].length; k += n) {
      const y = clip[this.field][k];
      if (y < low) low = y; if (y > high) high = y;
    }
    if (high === low) high = low + 1;
    this.small = 10 ** (Math.floor(Math.log10(Math.max(high, -low))) - 4);
    const bottom = this.scale(low), top = this.scale(high) + 0.05 * (this.scale(high) - bottom);
    this.x = t => EDGE.left + (width - EDGE.left - EDGE.right) * t / (END || 1);
    this.y = v => height - EDGE.bottom - (height - EDGE.top - EDGE.bottom) * (this.scale(v) - bottom) / (top - bottom);
    this.picture.width = this.canvas.width; this.picture.height = this.canvas.height;
    const g = this.picture.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.axes(g, width, height, low, high);
    g.lineJoin = "round";
    const clips = shown();
    for (const s of this.series()) {
      g.lineWidth = 1.8 + 1.6 * (clips.length - 1 - clips.indexOf(s.clip));
      const [colour, dash] = this.style(s), values = s.clip[this.field];
      g.strokeStyle = colour; g.setLineDash(dash); g.beginPath();
      s.clip.time.forEach((t, k) => g.lineTo(this.x(t), this.y(values[k * n + s.c])));
      g.stroke();
    }
    g.setLineDash([]);
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
      g.strokeStyle = colours.line; g.beginPath(); g.moveTo(this.x(t), EDGE.top); g.lineTo(this.x(t), height - EDGE.bottom); g.stroke();
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
    g.beginPath(); g.moveTo(this.x(t), EDGE.top); g.lineTo(this.x(t), height - EDGE.bottom); g.stroke();
    for (const s of this.series()) {
      const [k] = locate(s.clip, t);
      g.fillStyle = this.style(s)[0];
      g.beginPath(); g.arc(this.x(Math.min(t, s.clip.time[s.clip.time.length - 1])), this.y(s.clip[this.field][k * n + s.c]), 4, 0, 2 * Math.PI); g.fill();
    }
  }
}
