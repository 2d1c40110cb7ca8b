"""Films in space: what they refuse, what of a MuJoCo model they show, and their page, in a browser too."""

from __future__ import annotations

import base64
import json
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from rungwise.viewing.space.extent import box, largest_force
from rungwise.viewing.space.film import SLIP, STICK, Film, FilmError, Solid, Touches
from rungwise.viewing.space.live import open_live
from rungwise.viewing.space.model_solids import film_of_model
from rungwise.viewing.space.run_page import page, write_page
from rungwise.viewing.space.shapes import triangles, turned

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import browser as driver
from space_films import ball_and_box

PROGRAM = driver.find()
needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"needs a browser: none of {', '.join(driver.NAMES)} is on the PATH"
)
BARE: dict[str, Any] = {"pairs": (), "touches": Touches.none(), "gaps": None, "pushes": None}
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def films() -> list[Film]:
    return [ball_and_box(2.0, "dynamic-rigid"), ball_and_box(2.4, "dynamic-compliant")]


def data_of(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def columns(packed: dict[str, Any]) -> np.ndarray:
    """Values that the page unpacks, a row to a frame or contact."""
    integers = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(-1, len(packed["low"]))
    return np.array(packed["low"]) + integers * np.array(packed["step"])


def solid(kind: str, size: tuple[float, float, float]) -> Solid:
    return Solid("one", 0, kind, np.array(size), np.zeros(3), UPRIGHT, np.ones(4))


@pytest.mark.parametrize(
    ("kind", "size", "volume"),
    [
        ("sphere", (0.3, 0.0, 0.0), 4 / 3 * np.pi * 0.3**3),
        ("ellipsoid", (0.1, 0.2, 0.3), 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
        ("cylinder", (0.2, 0.5, 0.0), np.pi * 0.2**2 * 1.0),
        ("capsule", (0.2, 0.5, 0.0), np.pi * 0.2**2 * 1.0 + 4 / 3 * np.pi * 0.2**3),
        ("box", (0.1, 0.2, 0.3), 8 * 0.1 * 0.2 * 0.3),
    ],
)
def test_solids_are_closed_and_hold_their_volume(kind: str, size: Any, volume: float) -> None:
    vertices, faces = triangles(solid(kind, size))
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    held = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert held == pytest.approx(volume, rel=0.025) and held <= volume * (1.0 + 1e-12)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert {tuple(e) for e in edges.tolist()} == {tuple(e[::-1]) for e in edges.tolist()}
    assert len(np.unique(edges, axis=0)) == len(edges)


def test_shows_the_looks_of_moving_bodies_and_what_touches_elsewhere() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><asset><material name="red" rgba="1 0 0 1"/></asset><worldbody>
          <geom name="floor" type="plane" size="0 0 1"/><geom name="sign" type="box" size="1 1 1" contype="0"
            conaffinity="0" group="2"/>
          <body name="arm"><freejoint/>
            <geom name="look" type="capsule" size="0.1 0.2" group="1" contype="0" conaffinity="0"
              material="red"/>
            <geom name="hull" type="box" size="0.1 0.1 0.3" group="3"/>
            <geom name="hidden" size="0.1" group="1" contype="0" conaffinity="0" rgba="1 1 1 0"/></body>
          <body name="rod"><freejoint/><geom name="bare" type="cylinder" size="0.1 0.2" group="3"/></body>
        </worldbody></mujoco>"""
    )
    names, solids = film_of_model(model)
    assert names == ["world", "arm", "rod"]
    assert [(s.name, s.body, s.kind) for s in solids] == [
        ("floor", 0, "plane"), ("sign", 0, "box"), ("look", 1, "capsule"), ("bare", 2, "cylinder"),
    ]  # fmt: skip
    assert solids[2].colour.tolist() == [1.0, 0.0, 0.0, 1.0] and solids[2].size[:2].tolist() == [0.1, 0.2]


def test_meshes_and_height_fields_lie_where_mujoco_has_them() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 2 0  0 0 3"/>
          <hfield name="hill" nrow="2" ncol="3" size="1 2 0.5 0.1" elevation="0 0 0 1 1 1"/></asset>
          <worldbody><geom type="hfield" hfield="hill" pos="0 0 -2"/>
          <body pos="9 0 0"><freejoint/><geom type="mesh" mesh="wedge" pos="0.5 0 0"/></body></worldbody>
        </mujoco>"""
    )
    _, (hill, wedge) = film_of_model(model)
    corners = wedge.vertices @ turned(wedge.turn).T + wedge.place
    wanted = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]) + np.array([0.5, 0.0, 0.0])
    assert np.allclose(np.sort(corners, axis=0), np.sort(wanted, axis=0), atol=1e-6)
    assert hill.kind == "mesh" and len(hill.faces) == 4
    assert np.allclose([hill.vertices.min(axis=0), hill.vertices.max(axis=0)], [[-1, -2, 0], [1, 2, 0.5]])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for corner in 0.99 * hill.vertices[:, :2]:
        above = np.array([*corner, 5.0])
        fall = mujoco.mj_ray(
            model, data, above, np.array([0.0, 0.0, -1.0]), None, 1, -1, np.zeros(1, np.int32)
        )
        height = hill.vertices[np.abs(hill.vertices[:, :2] - corner).sum(axis=1).argmin(), 2]
        assert 5.0 - fall == pytest.approx(height - 2.0, abs=0.01)


def changed(film: Film, name: str, change: Callable[[np.ndarray], np.ndarray]) -> Film:
    return replace(film, **{name: change(getattr(film, name).copy())})


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("time", lambda f: replace(f, time=f.time[::-1].copy())),
        ("places", lambda f: replace(f, places=f.places[:, :2])),
        ("places", lambda f: changed(f, "places", lambda a: a * np.nan)),
        ("turns", lambda f: changed(f, "turns", lambda a: 2.0 * a)),
        ("gaps", lambda f: replace(f, gaps=f.gaps[1:])),
        ("pushes", lambda f: changed(f, "pushes", lambda a: a + np.nan)),
        ("pairs: unknown body 'bal' (did you mean ball?)", lambda f: replace(f, pairs=(("bal", "box"),))),
        ("touches: pair", lambda f: replace(f, pairs=f.pairs[:1])),
        ("touches: mode", lambda f: replace(f, touches=replace(f.touches, mode=f.touches.mode + 3))),
        ("touches: friction", lambda f: replace(f, touches=replace(f.touches, friction=-f.touches.friction))),
        ("touches: force", lambda f: replace(f, touches=replace(f.touches, force=f.touches.force[:, :2]))),
        ("touches: normal", lambda f: replace(f, touches=replace(f.touches, normal=0.0 * f.touches.normal))),
        ("solid 'one': body", lambda f: replace(f, solids=(replace(solid("box", (1, 1, 1)), body=7),))),
        ("solid 'one': kind: unknown kind 'bocks'", lambda _: solid("bocks", (1, 1, 1))),
        ("solid 'one': size", lambda _: solid("box", (1, 0, 1))),
        ("solid 'one': turn", lambda _: replace(solid("box", (1, 1, 1)), turn=np.zeros(4))),
        ("solid 'one': faces", lambda _: replace(solid("mesh", (1, 1, 1)), faces=np.array([[0, 1, 2]]))),
    ],
)
def test_bad_films_are_refused_by_the_name_of_the_field(
    films: list[Film], field: str, wrong: Callable[[Film], Any]
) -> None:
    with pytest.raises(FilmError, match=f"^{re.escape(field)}") as refused:
        wrong(films[0])
    assert "\n" not in str(refused.value)


def test_films_of_other_bodies_are_refused(films: list[Film]) -> None:
    with pytest.raises(FilmError, match="at least one"):
        page([])
    with pytest.raises(FilmError, match="same bodies"):
        page([films[0], replace(films[0], **BARE, bodies=("world", "ball", "bin"))])


def test_looks_at_all_bodies_but_one_that_leaves(films: list[Film]) -> None:
    low, _ = box(films)
    assert low[2] == pytest.approx(0.0, abs=5e-3)  # MuJoCo's contacts yield
    assert low[0] == pytest.approx(-0.6)
    thrown = films[0].places.copy()
    thrown[:, 1, 2] += 1000.0 * films[0].time
    left_low, left_high = box([replace(films[0], places=thrown)])
    assert left_high[2] < 0.5 and (left_low >= low - 1e-9).all()
    assert box([replace(films[0], solids=films[0].solids[:1])])[0].tolist() == [-1.0, -1.0, -1.0]


def test_the_page_is_one_file_and_says_what_the_films_say(films: list[Film], tmp_path: Path) -> None:
    file = write_page(films, tmp_path / "film.html")
    text = file.read_text("utf-8")
    assert file.stat().st_size < 200_000
    assert re.findall(r"https?:|src=|@import|<link[^>]*href=\"(?!data:)", text) == []
    assert "<title>ball and box</title>" in text
    assert "<title>ball and box on dynamic-rigid: goal</title>" in page(films[:1])
    data = data_of(text)
    assert [clip["label"] for clip in data["clips"]] == ["dynamic-rigid", "dynamic-compliant"]
    assert [solid["kind"] for solid in data["casts"][0]] == ["plane", "sphere", "box"]
    assert len(data["casts"]) == 1 and data["contacts"] == ["world | ball", "world | box", "ball | box"]
    assert data["force"] == pytest.approx(largest_force(films))
    for film, clip in zip(films, data["clips"], strict=True):
        poses = np.concatenate([film.places, film.turns], axis=2)[:, 1:].reshape(len(film.time), -1)
        assert clip["moving"] == [1, 2] and clip["outcome"] == film.outcome
        assert np.allclose(columns(clip["pose"]), poses, atol=2e-5)
        assert np.allclose(
            columns(clip["force"]), film.touches.force, atol=2e-5 * np.abs(film.touches.force).max()
        )
        modes = np.frombuffer(base64.b64decode(clip["mode"]), "<u1")
        assert (modes == film.touches.mode).all() and {STICK, SLIP} <= set(modes.tolist())
        pushes = np.frombuffer(base64.b64decode(clip["push"]), "<f4").reshape(len(film.time), -1)
        assert np.allclose(pushes, film.pushes, rtol=1e-6)


def test_a_long_film_leaves_frames_out_evenly(films: list[Film]) -> None:
    whole = page(films[:1])
    text = page(films[:1], largest=len(whole) - 3000)
    time = np.frombuffer(base64.b64decode(data_of(text)["clips"][0]["time"]), "<f4")
    assert len(text) <= len(whole) - 3000 and time[-1] == np.float32(films[0].time[-1])
    assert 2 <= len(time) < len(films[0].time) and np.ptp(np.diff(time)[:-1]) < 1e-5


@pytest.fixture(scope="module")
def opened(films: list[Film], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    assert PROGRAM is not None
    file = write_page(films, tmp_path_factory.mktemp("space") / "film.html")
    with driver.Browser(PROGRAM, (900, 700)) as browser:
        browser.open(file)
        yield browser


DRAWN = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"


@needs_browser
def test_plays_without_a_request_or_an_error(opened: Any) -> None:
    moved = opened.evaluate(
        "(async () => { const t = state.t;"
        " await new Promise(r => setTimeout(r, 800)); return state.t - t; })()"
    )
    assert moved != 0.0
    assert len([url for url in opened.requests if not url.startswith("data:")]) == 1
    assert opened.errors == [] and opened.evaluate("gpu.gl.getError()") == 0


@needs_browser
def test_keys_and_curves_move_the_time(opened: Any) -> None:
    opened.evaluate("play(false)")
    opened.key("Home")
    opened.key("ArrowRight")
    assert opened.evaluate("state.t === CLIPS[0].time[1]") is True
    opened.evaluate("$('push').scrollIntoView()")
    x, y, wide = opened.evaluate(
        "(() => { const b = $('push').getBoundingClientRect(); return [b.left, b.top, b.width]; })()"
    )
    edge = opened.evaluate("[EDGE.left, EDGE.right]")
    opened.click(x + edge[0] + 0.5 * (wide - sum(edge)), y + 100.0)
    assert opened.evaluate("state.t / END") == pytest.approx(0.5, abs=0.01)
    opened.key("2")
    assert opened.evaluate("shown().length") == 1
    opened.key("2")


@needs_browser
def test_bodies_and_forces_are_drawn_where_they_are(opened: Any, films: list[Film]) -> None:
    """The pixel at the middle of the ball has its colour, and the arrow of its weight begins at the floor."""
    film = films[0]
    k = len(film.time) - 1
    opened.evaluate(f"play(false), seek(END), arrange(false), bringFront(0), {DRAWN}")
    seen = opened.evaluate(
        """(() => {
          for (const id of ["names", "forces", "contacts", "cones"]) $(id).checked = false;
          paint(state.t);
          const panel = stage.panels[0], [x, y] = panel.names.find(n => n.text === "ball").at, gl = gpu.gl;
          const canvas = $("stage"), ratio = canvas.width / canvas.clientWidth, pixel = new Uint8Array(4);
          gl.readPixels(x * ratio, canvas.height - y * ratio, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
          const { eye, axes } = sightOf(panel.width / panel.height);
          const options = { forces: true, cones: true, contacts: true, length: 1 };
          const marks = marksAt(CLIPS[0], state.t, eye, axes, panel.height, options);
          return { marks, pixel: [...pixel], force: DATA.force, radius: view.radius, nominal: NOMINAL };
        })()"""
    )
    red, green, blue, _ = seen["pixel"]
    assert red > green > blue and red - blue > 60
    rows = np.flatnonzero(film.touches.frame == k)
    assert len(seen["marks"]) == len(rows)
    for row, mark in zip(rows, seen["marks"], strict=True):
        force, normal = film.touches.force[row], film.touches.normal[row]
        length = seen["nominal"] * seen["radius"] * np.linalg.norm(force) / seen["force"]
        assert np.allclose(mark["place"], film.touches.point[row], atol=1e-4) and mark["place"][2] < 0.01
        assert np.allclose(mark["axis"], force / np.linalg.norm(force), atol=2e-3)
        assert mark["long"] == pytest.approx(length, rel=2e-3)
        assert mark["cone"] == pytest.approx(length * float(force @ normal) / np.linalg.norm(force), rel=2e-3)
        assert mark["mode"] == film.touches.mode[row]


@needs_browser
def test_a_drag_turns_the_view_and_a_click_does_not(opened: Any) -> None:
    opened.evaluate("$('stage').scrollIntoView()")
    x, y = opened.evaluate(
        "(() => { const b = $('stage').getBoundingClientRect(); return [b.left + 200, b.top + 200]; })()"
    )
    before = opened.evaluate("[view.azimuth, view.height]")
    opened.click(x, y)
    assert opened.evaluate("[view.azimuth, view.height]") == before
    opened.click(x, y, (x + 100, y))
    azimuth, height = opened.evaluate("[view.azimuth, view.height]")
    assert azimuth < before[0] and height == before[1]


@needs_browser
def test_comes_close_to_what_moves_now(opened: Any, films: list[Film]) -> None:
    opened.evaluate(f"seek(END), showSide(0), {DRAWN}")
    far = opened.evaluate("view.distance")
    opened.evaluate(f"showNow(), {DRAWN}")
    low, high = box([films[0].thinned(np.array([len(films[0].time) - 1]))])
    assert opened.evaluate("view.distance") < far
    middle = np.array(opened.evaluate("view.target"))
    assert (middle > low - 0.05).all() and (middle < high + 0.05).all()


@needs_browser
def test_a_still_film_without_contacts_is_shown(films: list[Film], tmp_path: Path) -> None:
    still = replace(films[0].thinned(np.array([0])), **BARE)
    assert PROGRAM is not None
    with driver.Browser(PROGRAM) as browser:
        browser.open(write_page([still], tmp_path / "still.html"))
        assert browser.evaluate(f"{DRAWN}.then(() => [stage.panels.length, $('gap-figure').hidden])") == [
            1,
            True,
        ]
        assert browser.errors == []


@needs_browser
def test_side_by_side_dark_and_narrow_pages_fit(opened: Any) -> None:
    opened.dark(True)
    opened.call("Emulation.setDeviceMetricsOverride", width=380, height=800, deviceScaleFactor=2, mobile=True)
    opened.evaluate(f"arrange(true), redraw(true), {DRAWN}")
    panels = opened.evaluate("stage.panels.map(p => [p.x, p.y, p.width, p.height])")
    assert len(panels) == 2 and all(x >= 0 and x + w <= 380 and w > 100 and h > 100 for x, _, w, h in panels)
    assert opened.evaluate("document.documentElement.scrollWidth") <= 380
    assert opened.errors == []


def test_the_live_page_shows_the_moment_and_is_local(films: list[Film]) -> None:
    with pytest.raises(FilmError, match=r"^host: must be one of 127\.0\.0\.1"):
        open_live(films, host="0.0.0.0")
    with open_live(films) as live:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+", live.url)
        live.show(float(films[0].time[7]))
        for film, nodes in zip(films, live.nodes, strict=True):
            assert np.allclose(nodes[1].position, film.places[7, 1])
            assert np.allclose(nodes[2].wxyz, film.turns[7, 2])


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("most", "prefix"),
    [(0.0, ""), (4.5e-4, "µ"), (2e-3, "m"), (0.25, "m"), (3.0, ""), (999.0, ""), (4e4, "k")],
)
def test_curves_of_the_live_page_have_a_unit_in_which_their_ticks_differ(
    films: list[Film], most: float, prefix: str
) -> None:
    shape = films[0].gaps.shape if films[0].gaps is not None else (len(films[0].time), 1)
    own = replace(films[0], gaps=np.full(shape, most))
    with open_live([own]) as live:
        chart, curves = live._charts[0] or (None, np.zeros(0))
        assert chart.title == f"least gap [{prefix}m]"
        assert most == 0.0 or 1.0 <= curves.max() < 1000.0


def test_a_missing_viser_is_named(films: list[Film], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(FilmError, match=r"pip install 'rungwise\[watch\]'"):
        open_live(films)


@needs_browser
def test_the_clock_goes_on_without_a_graphics_card(opened: Any) -> None:
    """Browsers take the card away, of pages in the background above all, and give it back."""
    opened.evaluate(f"(lost = gpu.gl.getExtension('WEBGL_lose_context')).loseContext(), seek(0), {DRAWN}")
    opened.evaluate(f"seek(END), {DRAWN}")
    assert opened.evaluate("state.dirty") is False and opened.evaluate("gpu.gl.isContextLost()") is True
    assert opened.evaluate("+$('time').value") == pytest.approx(opened.evaluate("END"), rel=1e-3)
    opened.evaluate(
        f"new Promise(r => setTimeout(r, 200)).then(() => lost.restoreContext()).then(() => {DRAWN})"
    )
    opened.evaluate("new Promise(r => setTimeout(r, 300))")
    assert opened.evaluate("!gpu.gl.isContextLost() && stage.panels[0].names.length > 0") is True
    assert opened.errors == []


@needs_browser
def test_ghosts_in_one_place_are_drawn_once(films: list[Film], tmp_path: Path) -> None:
    assert PROGRAM is not None
    page = write_page([films[0], films[1], films[1]], tmp_path / "twins.html")
    count = (
        "seek(END), paint(state.t, true), (() => { const layer = drawLayer; let n = 0;"
        " drawLayer = (mesh, world, options) => { n += options?.tint ? 1 : 0; layer(mesh, world, options); };"
        " paint(state.t, true); drawLayer = layer; return n; })()"
    )
    with driver.Browser(PROGRAM) as browser:
        browser.open(page)
        twice = browser.evaluate(f"play(false), arrange(false), bringFront(0), {count}")
        once = browser.evaluate(f"flip('model-2'), {count}")
        assert twice == once > 0 and browser.errors == []
