"""Strips of runs in space: bodies where they are, nearer ones in front, contact points and forces on them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")
sys.path.insert(0, str(Path(__file__).parent))
from PIL import Image
from space_films import ball_and_box

import rungwise as rw
from rungwise.viewing.space.film import OPEN, Film
from rungwise.viewing.space.pictures import AXES, NEAR, PIXELS, _picture, save_gif, sight_of, strip
from rungwise.viewing.space.raster import paint


@pytest.fixture(scope="module")
def film() -> Film:
    return ball_and_box(1.0, "dynamic-rigid", 0.3)


def triangle(near: float) -> np.ndarray:
    return np.array([[[-1.0, -1.0, near], [20.0, -1.0, near], [-1.0, 20.0, near]]])


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_triangle_hides_the_other_and_glass_lets_it_through(order: tuple[int, int]) -> None:
    pixels, depth = np.zeros((6, 6, 4)), np.full((6, 6), -np.inf)
    red, blue = np.array([[1.0, 0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0, 1.0]])
    both = [(triangle(0.0), red), (triangle(1.0), blue)]
    for k in order:
        paint(*both[k], pixels, depth)
    assert (pixels == [0.0, 0.0, 1.0, 1.0]).all() and np.allclose(depth, 1.0)
    paint(triangle(0.5), np.array([[0.0, 1.0, 0.0, 0.5]]), pixels, depth)
    assert (pixels[..., 1] == 0.0).all()
    paint(triangle(2.0), np.array([[0.0, 1.0, 0.0, 0.5]]), pixels, depth)
    assert np.allclose(pixels, [0.0, 0.5, 0.5, 1.0]) and np.allclose(depth, 1.0)


def test_bodies_are_drawn_where_they_are(film: Film) -> None:
    """The middle of each sphere has its hue, and so many pixels as a disc of its radius has."""
    ball = next(solid for solid in film.solids if solid.kind == "sphere")
    alone = replace(film, solids=(ball,), pairs=(), touches=type(film.touches).none(), gaps=None, pushes=None)
    sight = sight_of([film])
    for k in (0, len(film.time) - 1):
        pixels = _picture(alone, k, sight)
        rows, columns = np.nonzero(pixels[..., 3])
        scale = PIXELS / sight.side
        middle = AXES[:2] @ film.places[k, ball.body]
        found = sight.extent[0] + columns.mean() / scale, sight.extent[3] - rows.mean() / scale
        assert found == pytest.approx(middle, abs=2.0 / scale)
        assert len(rows) == pytest.approx(np.pi * (ball.size[0] * scale) ** 2, rel=0.03)


def test_a_strip_has_a_row_for_each_run_and_says_how_they_end(film: Film) -> None:
    figure = strip([film, replace(film, model="kinematic", outcome="missed")], 3)
    assert len(figure.axes) == 6
    said = [text.get_text() for text in figure.texts]
    assert "dynamic-rigid: goal" in said and "kinematic: missed" in said
    marks = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "contact slips" in marks and any(text.startswith("force, cut off beyond") for text in marks)
    k = len(film.time) - 1
    drawn = sum(len(line.get_xdata()) for line in figure.axes[2].lines if line.get_zorder() == 21)
    assert drawn == np.count_nonzero(film.touches.frame == k) > 0


@pytest.mark.few(1)
@pytest.mark.parametrize(("far", "seen"), [(0.9, True), (1.1, False)])
def test_points_between_bodies_that_are_far_apart_are_not_drawn(film: Film, far: float, seen: bool) -> None:
    assert film.gaps is not None
    side = sight_of([film]).side
    apart = replace(
        film,
        touches=replace(film.touches, mode=np.full_like(film.touches.mode, OPEN)),
        gaps=np.full_like(film.gaps, far * NEAR * side),
    )
    figure = strip([apart], at=float(film.time[-1]))
    drawn = sum(len(line.get_xdata()) for line in figure.axes[0].lines if line.get_zorder() == 21)
    assert (drawn > 0) == seen


@pytest.mark.long
def test_runs_in_space_go_to_png_and_gif_and_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(save_gif, "__defaults__", (3, 1.0))
    run = rw.simulate("ball", rw.DYNAMIC_RIGID, duration=0.1)
    png, gif = rw.view(run, png=tmp_path / "x.png", gif=tmp_path / "x.gif", frames=2)
    with Image.open(png) as still, Image.open(gif) as moving:
        assert np.asarray(still.convert("L")).std() > 5.0 and getattr(moving, "n_frames", 1) > 1
    assert len(rw.plot(run, frames=2).axes) == 2
