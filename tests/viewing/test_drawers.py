"""The table of what draws runs: each world's pictures, and what is said of a world without any."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import rungwise as rw
from rungwise.viewing.drawers import DRAWERS, PLANE, SPACE, drawer_of
from rungwise.viewing.inline import to_html


class Elsewhere:
    """A run in a world that nothing draws."""

    scene = SimpleNamespace(world="elsewhere.world", name="drop")
    trajectory = None


@pytest.fixture(scope="module")
def planar() -> rw.Run:
    return rw.simulate("two_finger", rw.KINEMATIC, frames=3)


@pytest.fixture(scope="module")
def spatial() -> Any:
    return rw.simulate("ball", rw.KINEMATIC, duration=0.05)


def test_a_scene_finds_its_drawer_by_its_world(planar: rw.Run, spatial: Any) -> None:
    assert drawer_of(planar.scene) is PLANE and drawer_of(spatial.scene) is SPACE
    assert set(DRAWERS) == {planar.scene.world, spatial.scene.world}


def test_a_world_without_pictures_is_refused_in_one_line(planar: rw.Run, tmp_path: Path) -> None:
    lone: Any = Elsewhere()
    for runs in (lone, [lone, lone], [planar, lone]):
        with pytest.raises(rw.ViewError, match=r"no pictures of runs in elsewhere\.world") as refused:
            rw.view(runs, html=tmp_path / "x.html")
        assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())


def test_worlds_are_not_mixed(planar: rw.Run, spatial: Any, tmp_path: Path) -> None:
    for runs in ([planar, spatial], [spatial, planar]):
        with pytest.raises(rw.ViewError, match="go to pages of their own"):
            rw.view(runs, html=tmp_path / "x.html")
    assert not list(tmp_path.iterdir())


def test_what_a_world_does_not_have_is_refused(
    spatial: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(
        DRAWERS, spatial.scene.world, replace(DRAWERS[spatial.scene.world], strip=None, gif=None)
    )
    for kind in ("png", "gif"):
        with pytest.raises(rw.ViewError, match="runs in space go to html only"):
            rw.view(spatial, html=tmp_path / "x.html", **{kind: tmp_path / "x"})
    assert not list(tmp_path.iterdir())


def test_saved_runs_are_drawn_as_they_were(planar: rw.Run, spatial: Any, tmp_path: Path) -> None:
    for name, run in (("plane", planar), ("space", spatial)):
        run.save(tmp_path / name)
        again = rw.view(tmp_path / name, html=tmp_path / f"{name}.html")[0].read_text("utf-8")
        assert again == rw.view(run, html=tmp_path / "run.html")[0].read_text("utf-8")


def test_runs_show_themselves_in_every_world(planar: rw.Run, spatial: Any) -> None:
    for run, kind in ((planar, "plane"), (spatial, "space")):
        shown = run._repr_html_()
        assert shown.startswith("<table>") and f"main class=&quot;{kind}&quot;" in shown
        assert len(run.plot(frames=2).axes) == 2


def test_plans_show_the_page_of_their_world(planar: rw.Run, spatial: Any) -> None:
    for run, kind in ((planar, "plane"), (spatial, "space")):
        plan = rw.plan("two_finger", seed=0)
        object.__setattr__(plan, "replay", lambda run=run, **_: run)
        assert f"main class=&quot;{kind}&quot;" in to_html(plan)
        assert len(rw.plot(plan, frames=2).axes) == 2
