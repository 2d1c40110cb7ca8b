// The page of runs in the plane: its view, which a drag and the wheel move.

const LENGTH = 70;  // of a usual force

const picture = t => drawStage(t, options(LENGTH));

function onModel() {}

function zoom(factor, x, y) {
  const panel = panelAt(x, y) || stage.panels[0];
  if (!panel) return;
  const dx = x === undefined ? 0 : x - panel.x - panel.width / 2, dy = y === undefined ? 0 : panel.y + panel.height / 2 - y;
  view.whole = false;
  view.x += dx / view.scale * (1 - 1 / factor); view.y += dy / view.scale * (1 - 1 / factor);
  view.scale *= factor;
  redraw();
}

const KEYS = { z: () => zoom(1.25), x: () => zoom(0.8), r: () => { view.whole = true; redraw(); } };

function start() {
  startPlayer();
  layout.most = () => Math.min((window.innerWidth > 500 ? 0.6 : 0.9) * window.innerHeight, 600);
  startRuns("models: shown, in front", CLIPS.length > 1);
  onPointer($("stage"), {
    zoomed: zoom,
    dragged: (dx, dy) => { view.whole = false; view.x -= dx / view.scale; view.y += dy / view.scale; redraw(); },
    clicked: (x, y) => { const panel = panelAt(x, y); if (panel) bringFront(panel.clip.index); },
  });
  begin();
}

start();
