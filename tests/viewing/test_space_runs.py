"""Films and pages of runs in space, and of folders in which they were saved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.space.film import STICK
from rungwise.viewing.space.runs import film_of


@pytest.fixture(scope="module")
def run() -> rw.SpaceRun:
    found: rw.SpaceRun = rw.simulate("slope", "dynamic-rigid", duration=0.1)
    return found


def test_a_film_shows_poses_contacts_and_the_weight(run: rw.SpaceRun) -> None:
    film = film_of(run)
    block = film.bodies.index("block")
    np.testing.assert_allclose(film.places[:, block], [frame.q[:3] for frame in run.frames])
    assert film.pairs == (("world", "block"),)
    np.testing.assert_allclose(film.pushes[1:, 0], 9.81 * np.cos(np.radians(20.0)), rtol=1e-6)
    last = film.touches.frame == len(run.frames) - 1
    assert last.sum() == 4 and (film.touches.mode[last] == STICK).all()
    total = film.touches.force[last].sum(axis=0)
    np.testing.assert_allclose(
        total, 9.81 * np.array([-np.sin(np.radians(20.0)), 0, np.cos(np.radians(20.0))]), atol=1e-6
    )


def test_a_saved_run_makes_the_same_film(run: rw.SpaceRun, tmp_path: Path) -> None:
    saved, film = film_of(run.save(tmp_path / "run")), film_of(run)
    for name in ("time", "places", "turns", "gaps", "pushes"):
        np.testing.assert_array_equal(getattr(saved, name), getattr(film, name))
    for name in ("frame", "pair", "point", "normal", "force", "friction", "mode"):
        np.testing.assert_array_equal(getattr(saved.touches, name), getattr(film.touches, name))
    files = rw.view([run, tmp_path / "run"], html=tmp_path / "both.html")
    assert files == [tmp_path / "both.html"] and "slope" in files[0].read_text("utf-8")


def test_runs_of_plane_and_space_do_not_share_a_page(run: rw.SpaceRun) -> None:
    planar = rw.simulate("slide_roll", "kinematic")
    with pytest.raises(rw.ViewError, match="pages of their own"):
        rw.view([run, planar])
