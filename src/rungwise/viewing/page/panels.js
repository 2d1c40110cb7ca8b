// Panels of the stage: models side by side, or one of them in front with the others as ghosts; colours of the theme.

const HEAD = 24, SEAM = 8;
const NARROW = 150;  // a narrower panel has no room for its heading
const layout = { beside: false, front: 0 };
let colours = {};

const inFront = () => shown().find(c => c.index === layout.front) || shown()[0];

// As many columns as are worth most, by what a panel so wide and high is worth; `tall` is how high it need be.
function panelsIn(width, height, worth, tall = (w, h) => h) {
  const clips = shown(), front = inFront();
  if (!clips.length) return [];
  const beside = layout.beside && clips.length > 1, count = beside ? clips.length : 1, head = CLIPS.length > 1 ? HEAD : 0;
  let best = null;
  for (let columns = 1; columns <= count; columns++) {
    const w = (width - SEAM * (columns - 1)) / columns, h = height / Math.ceil(count / columns) - head, size = worth(w, h);
    if (best && w < NARROW) break;
    if (!best || size > best.size * 1.02) best = { columns, w, h, size };
  }
  const high = tall(best.w, best.h);
  return [...Array(count).keys()].map(i => ({
    clip: beside ? clips[i] : front, ghosts: beside ? [] : clips.filter(c => c !== front), head, width: best.w, height: high,
    x: i % best.columns * (best.w + SEAM), y: Math.floor(i / best.columns) * (high + head) + head,
  }));
}

const panelAt = (x, y) => stage.panels.find(p => x >= p.x && x <= p.x + p.width && y >= p.y - p.head && y <= p.y + p.height);

function readColours() {
  for (const name of ["page", "ink", "faint", "line", "panel", "object", "robot", "obstacle", "stick", "slip", "open"])
    colours[name] = css(`--${name}`);
  colours.models = MODELS.map(model => model.colour());
  colours.night = root.classList.contains("dark") ? 1 : 0;
}

// The greatest of 1, 2 and 5 times a power of ten that is not greater.
function round125(x) {
  const power = 10 ** Math.floor(Math.log10(x) + 1e-9);
  return power * [5, 2, 1].find(m => m * power <= x * (1 + 1e-9));
}
