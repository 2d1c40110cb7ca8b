"""Texts that were read once are not parsed again, and no reader sees what another did with the values."""

from __future__ import annotations

from pathlib import Path

import rungwise as rw
from rungwise.scene.scene import read_yaml


def test_readers_of_one_text_have_values_of_their_own(tmp_path: Path) -> None:
    file = tmp_path / "values.yaml"
    file.write_text("bodies: {a: [1.0, 2.0]}\n")
    first = read_yaml("scene", file)
    first["bodies"]["a"].append(3.0)
    assert read_yaml("scene", file) == {"bodies": {"a": [1.0, 2.0]}}


def test_a_text_that_changes_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    for radius in (0.1, 0.2):
        file.write_text(
            f"name: disc\nbodies: {{a: {{role: obstacle, shape: {{kind: disc, radius: {radius}}}}}}}\n"
        )
        scene = rw.load(file)
        assert isinstance(scene, rw.Scene)
        assert scene.file.model_dump(mode="json")["bodies"]["a"]["shape"]["radius"] == radius
