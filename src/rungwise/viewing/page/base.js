"use strict";
// What all scripts need: the data of the page, unpacked from base64 (see skeleton.py), numbers for people, elements, pointers.

const $ = id => document.getElementById(id);
const DATA = JSON.parse($("data").textContent);

function bytes(text) {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out.buffer;
}

// Rows of columns, each column quantised over its own range to 16 bits.
function unpack(packed) {
  const q = new Uint16Array(bytes(packed.data)), n = packed.low.length, out = new Float32Array(q.length);
  for (let i = 0; i < q.length; i++) out[i] = packed.low[i % n] + q[i] * packed.step[i % n];
  return out;
}

function clipOf(c, index) {
  return {
    ...c, index, visible: true,
    colour: () => css(`--model-${index % PALETTE.length}`),
    time: new Float32Array(bytes(c.time)),
    pose: unpack(c.pose),
    gap: new Float32Array(bytes(c.gap)),
    push: new Float32Array(bytes(c.push)),
    first: new Uint32Array(bytes(c.first)),
    mode: new Uint8Array(bytes(c.mode)),
    place: unpack(c.place),
    force: unpack(c.force),
  };
}

// Frame and fraction at time t; the last frame lasts.
function locate(clip, t) {
  const time = clip.time, last = time.length - 1;
  if (t >= time[last]) return [last, 0];
  let a = 0, b = last;
  while (b - a > 1) { const m = (a + b) >> 1; if (time[m] <= t) a = m; else b = m; }
  const span = time[b] - time[a];
  return [a, span > 0 ? Math.max(0, (t - time[a]) / span) : 0];
}

// Okabe and Ito's colours, which people see apart whatever their colour vision; light theme, dark theme.
const PALETTE = [["#0072b2", "#56b4e9"], ["#d55e00", "#f08a3c"], ["#007f5f", "#2fc79a"], ["#b0508c", "#e59ac6"],
  ["#8a6d00", "#f0e442"], ["#333333", "#dddddd"]];

const root = document.documentElement;
const css = name => getComputedStyle(root).getPropertyValue(name).trim();
// Numbers for people.
const short = x => x === 0 ? "0" : Math.abs(x) >= 1e6 || Math.abs(x) < 1e-3 ? x.toExponential(2).replace(/\.?0+e/, "e") : String(+x.toPrecision(4));

const withUnit = (x, unit) => unit ? `${short(x)} ${unit}` : short(x);
const inUnit = kind => DATA.units[kind] ? ` [${DATA.units[kind]}]` : "";

function element(tag, text, parent, attributes) {
  const e = document.createElement(tag);
  if (text) e.textContent = text;
  Object.assign(e, attributes || {});
  parent.append(e);
  return e;
}

function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const w = Math.max(1, Math.round(box.width * ratio)), h = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  return [box.width, box.height, ratio];
}

// Place of an event in its canvas.
function placeIn(event) {
  const box = event.currentTarget.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

// A pointer that goes more than three pixels drags, one that does not clicks; the wheel zooms.
function onPointer(canvas, { dragged, clicked, zoomed }) {
  let moved = 0;
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoomed(Math.exp(-0.0015 * e.deltaY), ...placeIn(e)); }, { passive: false });
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); moved = 0; });
  canvas.addEventListener("pointermove", e => {
    if (!e.buttons) return;
    moved += Math.abs(e.movementX) + Math.abs(e.movementY);
    if (moved > 3) dragged(e.movementX, e.movementY);
  });
  canvas.addEventListener("pointerup", e => { if (moved <= 3) clicked(...placeIn(e)); });
}
