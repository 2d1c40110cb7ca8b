"""The animation in a real browser, where there is one."""

from __future__ import annotations

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
              const clip = CLIPS[0], b = clip.bodies.findIndex(x => x.name === "part"), pose = [0, 0, 0];
              poseOf(clip, b, ...locate(clip, state.t), pose);
              const c = $("stage"), g = c.getContext("2d"), k = view.scale * (c.width / c.clientWidth);
              const at = (x, y) => [...g.getImageData(c.width / 2 + k * (x - view.x),
                c.height / 2 - k * (y - view.y), 1, 1).data].slice(0, 3);
              const rgb = t => [1, 3, 5].map(i => parseInt(t.slice(i, i + 2), 16));
              return [at(pose[0], pose[1]), at(pose[0] - 0.8, 0.7), rgb(colours.object), rgb(colours.page)];
            })()"""
        )
        assert inside == part and outside == ground


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
