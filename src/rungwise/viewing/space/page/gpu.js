// WebGL 2: programs, buffers, and the picture of what the light sees, from which shadows follow.

const SHADOW = 2048;

const SURFACE = [`#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;
uniform mat4 world, sight, light;
out vec3 at, across, spot;
out vec2 plane;
out vec4 paint;
void main() {
  vec4 p = world * vec4(place, 1.0);
  at = p.xyz; plane = place.xy; paint = colour; across = mat3(world) * normal;
  spot = (light * p).xyz * 0.5 + 0.5;
  gl_Position = sight * p;
}`, `#version 300 es
precision highp float;
precision highp sampler2DShadow;
in vec3 at, across, spot;
in vec2 plane;
in vec4 paint;
uniform vec3 eye, sun, page, line;
uniform vec4 tint;        // colour in place of the body's own, and how much of it
uniform vec2 middle;
uniform float solidity, flatness, cell, fade, night;
uniform sampler2DShadow shades;
out vec4 result;

float lit() {
  if (any(lessThan(spot, vec3(0.0))) || any(greaterThan(spot, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int i = -1; i <= 1; i++) for (int j = -1; j <= 1; j++)
    sum += texture(shades, vec3(spot.xy + 1.3 * vec2(i, j) / float(${SHADOW}), spot.z - 0.0012));
  return sum / 9.0;
}

// Lines of a grid one pixel wide, fainter where they come to lie close.
float grid(vec2 p) {
  vec2 wide = fwidth(p), near = abs(fract(p - 0.5) - 0.5) / max(wide, 1e-6);
  float thin = clamp(0.35 / max(wide.x, wide.y), 0.0, 1.0);
  return (1.0 - min(min(near.x, near.y), 1.0)) * thin;
}

void main() {
  vec4 own = mix(paint, vec4(tint.rgb, paint.a), tint.a);
  if (flatness > 0.5) { result = vec4(own.rgb, own.a * solidity); return; }
  vec3 n = normalize(across), way = normalize(eye - at);
  bool behind = dot(n, way) < 0.0;
  if (behind) n = -n;
  float falls = dot(n, sun), shade = falls > 0.0 ? lit() : 0.0;
  if (cell > 0.0) {
    // A floor: the page's own colour, darker in shadow, with lines; it fades away from the middle.
    float open = fade > 0.0 ? 1.0 - smoothstep(0.35, 1.0, length(plane - middle) / fade) : 1.0;
    vec3 floor_ = mix(own.rgb, page, 0.72) * mix(mix(0.80, 0.62, night), 1.0, shade);
    float lines = max(0.55 * grid(plane / cell), grid(plane / (10.0 * cell)));
    result = vec4(mix(floor_, line, lines), open * (behind ? 0.25 : 1.0) * solidity);
    return;
  }
  vec3 base = pow(own.rgb, vec3(2.2)), sky = mix(vec3(0.30, 0.29, 0.29), vec3(0.62, 0.65, 0.70), 0.5 + 0.5 * n.z);
  float gleam = pow(max(dot(n, normalize(sun + way)), 0.0), 48.0) * shade;
  vec3 seen = base * (0.60 * sky + 0.62 * max(falls, 0.0) * shade * vec3(1.0, 0.985, 0.96) + 0.12 * max(dot(n, way), 0.0)) + 0.08 * gleam;
  result = vec4(pow(seen, vec3(1.0 / 2.2)), own.a * solidity);
}`];

const DEPTH = [`#version 300 es
layout(location = 0) in vec3 place;
uniform mat4 world, light;
void main() { gl_Position = light * world * vec4(place, 1.0); }`, `#version 300 es
precision mediump float;
void main() {}`];

// A program with its uniforms by name.
function program(gl, sources) {
  const made = gl.createProgram();
  [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, k) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, sources[k]); gl.compileShader(shader); gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
  });
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

// Triangles on the graphics card: places, normals, and colours of corners (see bodies.js).
function uploaded(gl, { places, normals, colours: paints }) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  [[places, 3, gl.FLOAT, false], [normals, 3, gl.FLOAT, false], [paints, 4, gl.UNSIGNED_BYTE, true]].forEach(([data, size, kind, scaled], k) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(k);
    gl.vertexAttribPointer(k, size, kind, scaled, 0, 0);
  });
  return { array, count: places.length / 3 };
}

function shadowMap(gl) {
  const texture = gl.createTexture(), frame = gl.createFramebuffer();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW);
  for (const [name, value] of [[gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL],
    [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
    gl.texParameteri(gl.TEXTURE_2D, name, value);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
  gl.drawBuffers([gl.NONE]);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  return { texture, frame };
}

const rgb = text => [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16) / 255);
