// The stage: bodies with shadows, ghosts of models that are elsewhere, and names.

const SUN = unit([-0.25, -0.6, 1.0]);
const SAME = 0.004;  // how near, in sizes of the whole, a body is to be in the same place
const APART = 0.01;  // and two ghosts
const THROUGH = 0.28;  // what is left of bodies that are seen through
let gpu = null;
const stage = { panels: [] };  // as last drawn

function makeGpu(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!gl) return null;
  const made = { gl, surface: program(gl, SURFACE), depth: program(gl, DEPTH), shadow: shadowMap(gl), marks: marksOf(gl), sight: null, light: null };
  made.casts = DATA.casts.map((solids, k) => castOf(gl, solids, CLIPS.find(c => c.cast === k).bodies.length));
  cornersKept.clear();
  return made;
}

// Panels whose smaller side is as large as may be.
const panelsOf = (width, height) => panelsIn(width, height, (w, h) => Math.min(w, 1.4 * h));

// One mesh: where, in which colour in place of its own (and how much of it), and how solid.
function drawMesh(mesh, world, { tint = [0, 0, 0, 0], solidity = 1, flat = 0, cell = 0, fade = 0, middle = [0, 0], lines = false } = {}) {
  if (!mesh) return;
  const { gl, surface: { uniforms: u } } = gpu;
  gl.uniformMatrix4fv(u.world, false, world);
  gl.uniform4fv(u.tint, tint); gl.uniform2fv(u.middle, middle);
  gl.uniform1f(u.solidity, solidity); gl.uniform1f(u.flatness, flat); gl.uniform1f(u.cell, cell); gl.uniform1f(u.fade, fade);
  gl.bindVertexArray(mesh.array);
  gl.drawArrays(lines ? gl.LINES : gl.TRIANGLES, 0, mesh.count);
}

function posesOf(clip, t) {
  const [k, fraction] = locate(clip, t);
  return clip.bodies.map((_, b) => poseOf(clip, b, k, fraction, new Float32Array(7)));
}

// The picture of what the light sees of a film's bodies.
function drawShadows(clip, worlds) {
  const { gl, depth, shadow } = gpu, size = 1.3 * view.radius, [x, y] = across(SUN), middle = DATA.low.map((v, i) => (v + DATA.high[i]) / 2);
  gpu.light = product(parallel(size, 0, 6 * size), seenFrom(along(middle, 3 * size, SUN), [x, y, SUN]));
  gl.bindFramebuffer(gl.FRAMEBUFFER, shadow.frame);
  gl.disable(gl.SCISSOR_TEST); gl.viewport(0, 0, SHADOW, SHADOW); gl.depthMask(true); gl.clear(gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.disable(gl.CULL_FACE); gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1.5, 2);
  gl.useProgram(depth.made);
  gl.uniformMatrix4fv(depth.uniforms.light, false, gpu.light);
  gpu.casts[clip.cast].forEach((body, b) => {
    if (!body.opaque) return;
    gl.uniformMatrix4fv(depth.uniforms.world, false, worlds[b]);
    gl.bindVertexArray(body.opaque.array); gl.drawArrays(gl.TRIANGLES, 0, body.opaque.count);
  });
  gl.disable(gl.POLYGON_OFFSET_FILL);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
}

function useSurface(eye) {
  const { gl, surface: { made, uniforms: u }, shadow } = gpu;
  gl.useProgram(made);
  gl.uniformMatrix4fv(u.sight, false, gpu.sight); gl.uniformMatrix4fv(u.light, false, gpu.light);
  gl.uniform3fv(u.eye, eye); gl.uniform3fv(u.sun, SUN); gl.uniform3fv(u.page, rgb(colours.panel)); gl.uniform3fv(u.line, rgb(colours.line));
  gl.uniform1f(u.night, colours.night);
  gl.activeTexture(gl.TEXTURE0); gl.bindTexture(gl.TEXTURE_2D, shadow.texture); gl.uniform1i(u.shades, 0);
}

// First the depths alone, then what lies at them: one layer, whatever is behind it in the body.
function drawLayer(mesh, world, options) {
  const { gl } = gpu;
  gl.colorMask(false, false, false, false); gl.depthMask(true); drawMesh(mesh, world, options);
  gl.colorMask(true, true, true, true); drawMesh(mesh, world, options);
}

// Not where the model in front is, nor where another ghost is drawn already: two skins in one place flicker.
function drawGhost(clip, t, front, drawn) {
  const there = posesOf(clip, t), tint = [...rgb(colours.models[clip.index]), 0.8];
  gpu.casts[clip.cast].forEach((body, b) => {
    if (samePlace(there[b], front[b]) || drawn.some(other => samePlace(there[b], other[b], APART))) return;
    const world = posed(there[b]);
    drawLayer(body.opaque, world, { tint, solidity: clip.solidity }); drawLayer(body.clear, world, { tint, solidity: clip.solidity });
  });
}

function samePlace(a, b, same = SAME) {
  const turned = 1 - Math.abs(a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6]);
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) < same * view.radius && turned < same * same;
}

function drawPanel(panel, t, options, ratio) {
  const { gl } = gpu, cast = gpu.casts[panel.clip.cast], poses = posesOf(panel.clip, t), worlds = poses.map(posed);
  drawShadows(panel.clip, worlds);
  const { eye, axes, sight } = sightOf(panel.width / panel.height);
  gpu.sight = sight;
  const at = [panel.x, stage.height - panel.y - panel.height, panel.width, panel.height].map(v => Math.round(v * ratio));
  gl.viewport(...at); gl.enable(gl.SCISSOR_TEST); gl.scissor(...at);
  gl.clearColor(...rgb(colours.panel), 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  useSurface(eye);
  if (!options.through) cast.forEach((body, b) => drawMesh(body.opaque, worlds[b]));
  const marks = options.contacts || options.forces ? marksAt(panel.clip, t, eye, axes, panel.height, options) : [];
  drawMarks(marks, {});
  gl.depthMask(false);
  cast.forEach((body, b) => body.planes.forEach(p => drawMesh(p, product(worlds[b], p.m), { cell: stage.cell, fade: p.fade, middle: p.middle })));
  const far = b => -dot(minus(poses[b], eye), axes[2]);
  gl.enable(gl.CULL_FACE);
  for (const b of [...cast.keys()].sort((p, q) => far(q) - far(p))) {
    if (options.through) drawLayer(cast[b].opaque, worlds[b], { solidity: THROUGH });
    drawLayer(cast[b].clear, worlds[b]);
  }
  gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 4);  // where two films have a face in one plane, the one in front is seen
  panel.ghosts.forEach((clip, k) => drawGhost(clip, t, poses, panel.ghosts.slice(0, k).map(other => posesOf(other, t))));
  gl.disable(gl.POLYGON_OFFSET_FILL);
  gl.disable(gl.CULL_FACE); gl.depthMask(false);
  drawCones(marks);
  gl.depthFunc(gl.GREATER); drawMarks(marks, { flat: 1, solidity: 0.25 }); gl.depthFunc(gl.LEQUAL);
  gl.depthMask(true);
  panel.names = cast.flatMap((body, b) => body.middle && panel.clip.slot[b] >= 0 ? [{ text: panel.clip.bodies[b], at: onPanel(panel, times(worlds[b], body.middle)) }] : []);
}

// Pixels of a place in its panel, or null behind the eye.
function onPanel(panel, place) {
  const [x, y, , w] = times(gpu.sight, place);
  return w > 0 ? [panel.x + (0.5 + 0.5 * x / w) * panel.width, panel.y + (0.5 - 0.5 * y / w) * panel.height] : null;
}

function drawStage(t, options) {
  const canvas = $("stage"), [width, height, ratio] = fitted(canvas);
  stage.height = height; stage.panels = panelsOf(width, height).map(panel => ({ ...panel, names: [] }));
  if (view.whole && stage.panels.length) showWhole(stage.panels[0].width / stage.panels[0].height);
  stage.cell = round125(0.11 * view.distance); stage.perForce = options.length * NOMINAL * view.radius / DATA.force;
  if (gpu && !gpu.gl.isContextLost()) {
    gpu.gl.disable(gpu.gl.SCISSOR_TEST); gpu.gl.clearColor(...rgb(colours.page), 1); gpu.gl.clear(gpu.gl.COLOR_BUFFER_BIT);
    stage.panels.forEach(panel => drawPanel(panel, t, options, ratio));
  }
  drawOver(options);
}

// What is written over the panels: models, names where there is room, axes, and the scales.
function drawOver(options) {
  const canvas = $("over"), [width, height, ratio] = fitted(canvas), g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0); g.clearRect(0, 0, width, height);
  g.textBaseline = "middle";
  stage.texts = [];
  for (const panel of stage.panels) {
    g.font = `${panel.height < FULL_SIZE ? 11 : 13}px system-ui, sans-serif`;
    if (panel.head) written(g, `${panel.clip.label}: ${panel.clip.outcome}`, panel.x + 18, panel.y - HEAD / 2, colours.ink, "left", panel.width - 20);
    if (panel.head) { g.fillStyle = colours.models[panel.clip.index]; g.fillRect(panel.x, panel.y - HEAD / 2 - 5, 11, 10); }
    g.save(); g.beginPath(); g.rect(panel.x, panel.y, panel.width, panel.height); g.clip();
    if (options.names) named(g, panel);
    drawAxes(g, panel.x + panel.width - 40, panel.y + panel.height - 38);
    g.restore();
  }
}

function written(g, text, x, y, colour, align, most) {
  g.textAlign = align; g.lineJoin = "round"; g.lineWidth = 3.5; g.strokeStyle = colours.page; g.fillStyle = colour;
  g.strokeText(text, x, y, most); g.fillText(text, x, y, most);
}

function named(g, panel) {
  const taken = [];
  for (const { text, at } of panel.names) {
    if (!at) continue;
    const half = g.measureText(text).width / 2 + 3, box = [at[0] - half, at[1] - 9, at[0] + half, at[1] + 9];
    if (taken.some(o => box[0] < o[2] && o[0] < box[2] && box[1] < o[3] && o[1] < box[3])) continue;
    taken.push(box); stage.texts.push(text);
    written(g, text, at[0], at[1], colours.ink, "center");
  }
}

function drawAxes(g, x, y) {
  const [right, up, towards] = axesOf(view);
  [0, 1, 2].sort((a, b) => towards[a] - towards[b]).forEach(i => {
    const dx = 24 * right[i], dy = -24 * up[i];
    g.strokeStyle = colours.faint; g.lineWidth = 1.8; g.beginPath(); g.moveTo(x, y); g.lineTo(x + dx, y + dy); g.stroke();
    written(g, "xyz"[i], x + 1.35 * dx, y + 1.35 * dy, colours.faint, "center");
  });
}
