"""The animation in a real browser, where there is one."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import browser as driver

PROGRAM = driver.find()
pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason=f"needs a browser: none of {', '.join(driver.NAMES)} is on the PATH"
)
RUNGS = ("quasistatic-rigid", "dynamic-compliant")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    runs = [rw.simulate("two_finger", name, parameters={"v2": 0.55, "damping": 0.0}) for name in RUNGS]
    return rw.view(runs, html=tmp_path_factory.mktemp("view") / "run.html")[0]


@pytest.fixture(scope="module")
def page(file: Path) -> Iterator[Any]:
    assert PROGRAM is not None
    with driver.Browser(PROGRAM) as opened:
        opened.open(file)
        yield opened


def test_plays_by_itself_without_a_request_or_an_error(page: Any, file: Path) -> None:
    moved = page.evaluate(
        "(async () => { const t = state.t, n = state.frames; await new Promise(r => setTimeout(r, 600));"
        " return [state.t - t, state.frames - n]; })()"
    )
    assert moved[0] != 0.0 and moved[1] > 1
    assert [url for url in page.requests if not url.startswith("data:")] == [file.resolve().as_uri()]
    assert page.errors == []


def test_keys_do_what_the_page_says(page: Any) -> None:
    page.evaluate("play(true)")
    page.key(" ")
    assert page.evaluate("[state.playing, $('play').textContent]") == [False, "play"]
    page.key("Home")
    page.key("ArrowRight")
    assert page.evaluate("state.t === CLIPS[0].time[1]") is True
    page.key("ArrowRight", shift=True)
    page.key("ArrowLeft")
    assert page.evaluate("state.t === CLIPS[0].time[10]") is True
    page.key("End")
    assert page.evaluate("state.t === END") is True
    page.key("2")
    assert page.evaluate("shown().length") == 1
    page.key("2")
    before = page.evaluate("+$('speed').value")
    page.key("+")
    assert page.evaluate("+$('speed').value") == before + 1


def test_controls_have_names_and_take_the_focus(page: Any) -> None:
    unnamed = page.evaluate(
        "[...document.querySelectorAll('button, input, select')].filter(e => !(e.textContent.trim() ||"
        " e.ariaLabel || (e.labels && e.labels.length))).length"
    )
    assert unnamed == 0
    assert page.evaluate("(() => { $('play').focus(); return document.activeElement.id; })()") == "play"


def test_draws_the_part_where_the_run_has_it(page: Any) -> None:
    """The colour of the part at its centre, and the page's own beside it, at the beginning and at the end."""
    page.evaluate("play(false)")
    for time in ("0", "END"):
        page.evaluate(
            f"seek({time}), new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"
        )
        inside, outside, part, ground = page.evaluate(
            """(() => {
              view.whole = true;
              $("names").checked = false;
              drawStage(state.t, {forces: false, contacts: false, names: false, length: 0});
              const panel = stage.panels[0], spot = spotIn(panel);
              const clip = CLIPS[0], b = clip.bodies.findIndex(x => x.name === "part"), pose = [0, 0, 0];
              poseOf(clip, b, ...locate(clip, state.t), pose);
              const c = $("stage"), g = c.getContext("2d"), k = c.width / c.clientWidth;
              const at = (x, y) => { const [px, py] = spot(x, y);
                return [...g.getImageData(k * (panel.x + px), k * (panel.y + py), 1, 1).data].slice(0, 3); };
              const rgb = t => [1, 3, 5].map(i => parseInt(t.slice(i, i + 2), 16));
              return [at(pose[0], pose[1]), at(pose[0] - 0.8, 0.7), rgb(colours.object), rgb(colours.page)];
            })()"""
        )
        assert inside == part and outside == ground


def show(page: Any, beside: bool, part: float) -> None:
    """The whole stage with names at a part of the time, drawn."""
    page.evaluate(
        f"play(false), $('names').checked = true, view.whole = true, arrange({str(beside).lower()}),"
        f" seek({part} * END), new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"
    )


@pytest.mark.parametrize("beside", [True, False])
@pytest.mark.parametrize("part", [0.0, 0.5, 0.8, 1.0])
def test_texts_hide_neither_bodies_nor_each_other(page: Any, beside: bool, part: float) -> None:
    show(page, beside, part)
    texts = page.evaluate("stage.texts.map(({text, model, box, over}) => ({text, model, box, over}))")
    panels = page.evaluate("stage.panels.map(p => [p.clip.index, p.width, p.height])")
    assert len(panels) == (2 if beside else 1)
    for model, width, height in panels:
        own = [each for each in texts if each["model"] == model]
        assert {"finger1", "finger2", "part"} <= {each["text"] for each in own}
        for k, each in enumerate(own):
            box = each["box"]
            assert each["over"] == [] and box["x"] >= 0.0 and box["y"] >= 0.0
            assert box["x"] + box["width"] <= width and box["y"] + box["height"] <= height
            for other in own[:k]:
                assert not page.evaluate(f"overlap({json.dumps(box)}, {json.dumps(other['box'])})")


def test_arrows_stay_in_their_panels_and_say_where_they_are_broken(page: Any) -> None:
    show(page, True, 1.0)
    drawn = page.evaluate(
        """stage.panels.flatMap(panel => {
          const found = [], g = $("stage").getContext("2d"), { width, height } = panel, f = DATA.force;
          for (const [fx, fy] of [[1, 0], [0, 1], [-3, 1], [40, -9]])
            for (const at of [[30, 20], [9, height - 9]]) {
              const end = arrow(g, ...at, fx * f, fy * f, 70, "#000", panel);
              found.push({...end, full: 70 * Math.hypot(fx, fy), at, width, height});
            }
          return found; })"""
    )
    for end in (each for each in drawn if "x" in each):
        assert 0.0 <= end["x"] <= end["width"] and 0.0 <= end["y"] <= end["height"]
        long = np.hypot(end["x"] - end["at"][0], end["y"] - end["at"][1])
        assert end["broken"] == bool(long < end["full"] - 0.5)


def test_the_scale_bar_is_round_and_right(page: Any) -> None:
    show(page, True, 0.0)
    value, long, scale, said = page.evaluate(
        "[stage.scale.value, stage.scale.long, view.scale, stage.scale.said]"
    )
    assert long == pytest.approx(value * scale) and long <= 140.0
    mantissa = value / 10.0 ** np.floor(np.log10(value) + 1e-9)
    assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0)) < 1e-9 and said == f"{value:g} m"


def test_a_peak_does_not_flatten_the_curves(page: Any) -> None:
    """A force of 1 with one frame of 1000: the axis ends near 1, and the peak is marked with its value."""
    page.evaluate(
        """(() => {
          const n = DATA.contacts.length;
          window.kept = CLIPS[1].push;
          CLIPS[1].push = kept.map((_, i) => i === 10 * n ? 1000 : i % n ? 0 : 1);
          CLIPS[0].visible = false; charts[1].render(false); })()"""
    )
    limit, peaks, marked = page.evaluate(
        "[charts[1].limit, charts[1].peaks.map(p => [p.value, p.labelled]), charts[1].y(1) - charts[1].y(0)]"
    )
    assert 1.0 < limit < 2.0 and peaks == [[1000.0, True]] and marked < -60.0
    page.evaluate("CLIPS[1].push = kept, CLIPS[0].visible = true, redraw(true)")


def test_a_reason_is_said_once(page: Any) -> None:
    reasons = page.evaluate("[...new Set(CLIPS.map(c => c.reason))]")
    text = page.evaluate("document.body.innerText")
    assert all(text.count(reason) == 1 for reason in reasons)


def test_a_click_and_keys_choose_the_model_in_front(page: Any) -> None:
    show(page, True, 0.0)
    corner = page.evaluate("$('stage').getBoundingClientRect().toJSON()")
    panel = page.evaluate("(p => ({x: p.x, y: p.y}))(stage.panels[1])")
    page.click(corner["x"] + panel["x"] + 20, corner["y"] + panel["y"] + 20)
    assert page.evaluate("[layout.front, $('front-1').checked]") == [1, True]
    page.evaluate("document.activeElement.blur()")
    page.key("b")
    page.key("m")
    assert page.evaluate("[layout.front, layout.beside, $('single').checked]") == [0, False, True]
    page.key("m")


def test_both_themes_are_readable(page: Any, tmp_path: Path) -> None:
    from PIL import Image

    for dark in (False, True):
        page.evaluate(f"root.classList.toggle('dark', {str(dark).lower()}), paintTheme()")
        page.screenshot(tmp_path / "page.png")
        with Image.open(tmp_path / "page.png") as picture:
            shade = np.asarray(picture.convert("L"), float)
        assert (np.median(shade) < 60) == dark
        contrasts = page.evaluate(
            """(() => {
              const light = t => { const [r, g, b] = [1, 3, 5].map(i => parseInt(t.slice(i, i + 2), 16) / 255)
                .map(x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
                return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
              const page = light(colours.page) + 0.05;
              const ratio = c => Math.max(page / (light(c) + 0.05), (light(c) + 0.05) / page);
              return {text: [colours.ink, colours.faint].map(ratio),
                marks: [colours.stick, colours.slip, colours.open, ...colours.models].map(ratio)};
            })()"""
        )
        assert min(contrasts["text"]) >= 4.5  # what WCAG asks of text, and of graphics
        assert min(contrasts["marks"]) >= 3.0
