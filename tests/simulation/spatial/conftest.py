"""Small scenes in space, made of a piece of MJCF and fields of a scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import rungwise as rw
from rungwise.scene.space import SpaceScene

Make = Callable[..., SpaceScene]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A function of what stands inside <mujoco>, and of fields of the scene."""

    def made(model: str, /, **fields: Any) -> SpaceScene:
        path = tmp_path / f"m{len(list(tmp_path.iterdir()))}.xml"
        path.write_text(f"<mujoco>{model}</mujoco>")
        model_field = {"file": str(path), **fields.pop("model", {})}
        scene = rw.load({"name": "made", "model": model_field, **fields})
        assert isinstance(scene, SpaceScene)
        return scene

    return made
