"""The picture of a diagnosis: both motions where they part; the parting's time is the diagnosis' own."""

from __future__ import annotations

from pathlib import Path

import pytest

import rungwise as rw

PUSH = rw.load("push")
FAST = {"v": 0.6, "offset": 0.02}
INPUTS = [rw.Segment({"ux": 1.0}, 0.16), rw.Segment({"ux": 0.0}, 1.0)]


@pytest.fixture(scope="module")
def found() -> rw.Diagnosis:
    return rw.diagnose(PUSH, "quasistatic-rigid", "dynamic-compliant", inputs=INPUTS, parameters=FAST)


def words(file: Path) -> str:
    """The texts of an SVG, which are comments beside their glyphs."""
    return file.read_text("utf-8")


def test_picture_names_time_distance_and_cause(found: rw.Diagnosis, tmp_path: Path) -> None:
    text = words(rw.draw_parting(found, PUSH, tmp_path / "apart.svg", parameters=FAST))
    assert f"t = {found.time:.4g} s, the motions begin to differ: by" in text
    assert f"the motions are farthest apart: by {found.distance:.3g} m" in text
    assert "time [s]" in text and "distance [m]" in text
    assert "inertia: box coasted" in text and "dynamic-compliant: " in text


def test_time_may_be_chosen_and_png_is_written(found: rw.Diagnosis, tmp_path: Path) -> None:
    text = words(rw.draw_parting(found, PUSH, tmp_path / "apart.svg", parameters=FAST, at=0.1))
    assert "t = 0.1 s, chosen time, the motions differ: by" in text
    file = rw.draw_parting(found, PUSH, tmp_path / "new" / "apart.png", parameters=FAST)
    assert file.read_bytes().startswith(b"\x89PNG") and file.stat().st_size > 20_000


def test_other_parameters_are_those_of_the_second_run(tmp_path: Path) -> None:
    slick = FAST | {"mu_s": 0.1}
    found = rw.diagnose(
        PUSH, "dynamic-rigid", "dynamic-rigid", inputs=INPUTS, parameters=FAST, other_parameters=slick
    )
    file = tmp_path / "apart.svg"
    text = words(rw.draw_parting(found, PUSH, file, parameters=FAST, other_parameters=slick))
    assert f"the motions are farthest apart: by {found.distance:.3g}" in text


def test_what_cannot_be_drawn_is_one_line(found: rw.Diagnosis, tmp_path: Path) -> None:
    with pytest.raises(rw.ViewError, match=r"parting: unknown kind of file 'zzz'; valid: .*png.*svg"):
        rw.draw_parting(found, PUSH, tmp_path / "apart.zzz", parameters=FAST)
    with pytest.raises(rw.ViewError, match=r"parting: .* cannot be written"):
        rw.draw_parting(found, PUSH, Path("/dev/null/apart.png"), parameters=FAST)


def test_what_is_too_little_to_be_seen_is_magnified(found: rw.Diagnosis, tmp_path: Path) -> None:
    """Compliance moves a slow push by micrometres: an inset says how many times it is magnified."""
    stiff = rw.diagnose(PUSH, "dynamic-rigid", "dynamic-compliant", inputs=INPUTS, parameters={"v": 0.05})
    text = words(rw.draw_parting(stiff, PUSH, tmp_path / "stiff.svg", parameters={"v": 0.05}))
    assert "\N{MULTIPLICATION SIGN} " in text
    text = words(rw.draw_parting(found, PUSH, tmp_path / "far.svg", parameters=FAST))
    assert text.count("\N{MULTIPLICATION SIGN} ") < 2
