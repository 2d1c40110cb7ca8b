"""The picture of several sets: what is shaded, what is said, and where letters stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.sets.cells.labels import Label
from rungwise.viewing.sets.differences import differences

F, D, J = Label.FEASIBLE, Label.DOOMED, Label.JAMMED


def test_differences_are_counted_and_put_into_words() -> None:
    slices = [np.full((3, 10, 10), F), np.full((3, 10, 10), F)]
    slices[0][2, :5] = D
    slices[1][:, 0, :6] = np.array([F, D, J])[:, None]
    slices[1][:, 9] = D  # all agree
    first, second = differences(slices)
    assert (first.labels, first.letter, first.part) == ((F, F, D), "A", 0.25)
    assert (second.labels, second.letter, second.part) == ((F, D, J), "B", 0.03)
    names = ("one", "two", "three")
    assert first.words(names) == "A: doomed on three, feasible on the others (25 %)"
    assert second.words(names) == "B: feasible on one, doomed on two, jammed on three (3 %)"
    assert differences([np.full((2, 4, 4), J)]) == []


def test_picture_of_sets_shades_where_they_differ(tmp_path: Path) -> None:
    """Fingers of speeds 1/2 to 2 to 1 catch; an impact with restitution throws the part off in some."""
    pytest.importorskip("matplotlib")
    from matplotlib.colors import to_rgb
    from PIL import Image

    from rungwise.viewing.sets.differences import SHADES
    from rungwise.viewing.sets.slices import feasible_slices

    found = [
        rw.feasible_set(
            "two_finger", name, ("v2",), box={"v2": (0.2, 1.0)}, parameters={"restitution": 1.0}, threads=1
        )
        for name in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID)
    ]
    drawing = feasible_slices(found)
    shown = drawing.axes[2]
    assert [axis.get_title() for axis in drawing.axes[:2]] == [each.name for each in found]
    assert shown.get_title() == "where they differ" and "A" in {text.get_text() for text in shown.texts}
    said = [text.get_text() for text in drawing.legends[0].get_texts()]
    assert any(text.startswith("A: ") and found[1].name in text for text in said)
    file = rw.view(found, png=tmp_path / "sets.png")[0]
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("RGB"), int)
    shade = np.rint(255.0 * np.array(to_rgb(SHADES[0])))
    assert (abs(pixels - shade).sum(axis=2) < 12).sum() > 500
