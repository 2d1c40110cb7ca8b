"""Strips of frames: one scale, whole arrows, times as titles."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.plane.arrows import Arrows, arrows_at, draw_touches, short, view_of
from rungwise.viewing.plane.clip import SHOWN_SLIP, Clip, clip
from rungwise.viewing.sheet import SMALL
from rungwise.viewing.units import titled, units_of

matplotlib = pytest.importorskip("matplotlib")
from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402

from rungwise.viewing.plane.pictures import strip  # noqa: E402

RUNGS = ("quasistatic-compliant", "dynamic-rigid")


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    """Impacts of thousands of newtons at fingers that are above, at the upper edge of all that is seen."""
    values = {"v2": 0.55, "restitution": 1.0}
    return [clip(rw.simulate("two_finger", name, parameters=values)) for name in RUNGS]


def test_frames_have_one_scale_ticks_and_times(clips: list[Clip]) -> None:
    figure = strip(clips, 4)
    frames = figure.axes
    assert len(frames) == 8
    scales = {
        tuple(
            np.round(
                np.array([axes.get_window_extent().width, axes.get_window_extent().height])
                / [np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())],
                6,
            )
        )
        for axes in frames
    }
    assert len(scales) == 1
    end = max(float(each.time[-1]) for each in clips)
    assert [axes.get_title() for axes in frames[:4]] == [f"t = {k / 3 * end:.4g} s" for k in range(4)]
    assert all(len(axes.get_xticks()) > 1 and len(axes.get_yticks()) > 1 for axes in frames)
    said = " ".join(text.get_text() for text in figure.texts)
    assert all(f"{name}: " in said for name in RUNGS)


def test_no_letters_are_too_small_for_a_page_and_axes_name_units_once(clips: list[Clip]) -> None:
    figure = strip(clips, 4)
    FigureCanvasAgg(figure).draw()
    letters = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text()]
    assert len(letters) > 20 and min(text.get_fontsize() for text in letters) >= SMALL
    assert [axes.get_xlabel() for axes in figure.axes] == [""] * 4 + ["x [m]"] * 4
    first = figure.axes[0]
    low, high = first.get_ylim()
    seen = [text for text in first.get_yticklabels() if low <= text.get_position()[1] <= high]
    title = first.yaxis.label.get_window_extent()
    assert title.x0 > 0.0 and title.x1 < min(text.get_window_extent().x0 for text in seen)


def test_titles_of_axes_have_units_where_parameters_have_them() -> None:
    file = rw.load("two_finger").file
    assert [titled(file, name) for name in ("v1", "mu", "x3")] == ["v1 [m/s]", "mu", "x3 [m]"]


@pytest.mark.parametrize(
    ("unit", "units", "found"),
    [
        ("m/s", None, ("m", "s", "N")),
        ("deg", None, ("", "", "")),
        ("1", None, ("", "", "")),
        ("1", {"length": "mm"}, ("mm", "s", "")),
        ("mm", {"length": "m"}, ("m", "s", "N")),
    ],
)
def test_a_scene_counts_in_what_it_says_or_in_metres_kilograms_and_seconds(
    unit: str, units: dict[str, str] | None, found: tuple[str, str, str]
) -> None:
    disc = {"role": "object", "shape": {"kind": "disc", "radius": 1.0}, "motion": {"kind": "free"}}
    scene = {"name": "one", "bodies": {"disc": disc}, "parameters": {"p": {"default": 1.0, "unit": unit}}}
    file = rw.load(scene | ({} if units is None else {"units": units})).file
    assert tuple(units_of(file).values()) == found


def test_arrows_lie_whole_in_the_frame_and_the_long_ones_are_broken(clips: list[Clip]) -> None:
    times = np.linspace(0.0, float(clips[0].time[-1]), 6).tolist()
    view = view_of(clips, times)
    low, high = np.array(view.extent).reshape(2, 2)
    broken = 0
    for each in clips:
        for time in times:
            arrows = arrows_at(each, time, view.per_force, view.longest)
            assert ((arrows.tail > low) & (arrows.tail < high)).all()
            assert (arrows.long <= view.longest).all()
            assert (arrows.broken == (arrows.size * view.per_force > view.longest)).all()
            broken += int(arrows.broken.sum())
    assert broken > 0
    texts = [text.get_text() for axes in strip(clips, 6).axes for text in axes.texts]
    assert len([text for text in texts if text.endswith(" N")]) == broken


@pytest.mark.parametrize("angle", np.linspace(0.0, 2.0 * np.pi, 9)[:-1], ids=lambda a: f"{np.degrees(a):.0f}")
def test_the_size_of_a_broken_arrow_is_written_beside_the_strokes_that_break_it(angle: float) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6, 3.6), dpi=110)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0))
    spot = np.array([[0.0, 0.0]])
    tail = 0.5 * np.array([[np.cos(angle), np.sin(angle)]])
    one = np.ones(1)
    draw_touches(
        axes, Arrows(spot, SHOWN_SLIP * one.astype(int), 6.0 * one, tail, 0.5 * one, one > 0), "N", "white"
    )
    (text,) = axes.texts
    box = text.get_window_extent()
    strokes = [line for line in axes.lines if line.get_linewidth() == 1.4]
    assert len(strokes) == 2
    assert not any(box.overlaps(line.get_window_extent()) for line in strokes)


@pytest.mark.long
def test_texts_of_a_strip_stay_in_its_frames(clips: list[Clip]) -> None:
    figure = strip(clips, 6)
    figure.canvas.draw()
    for axes in figure.axes:
        frame = axes.get_window_extent()
        for text in axes.texts:
            box = text.get_window_extent()
            assert frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1


def test_sizes_are_short() -> None:
    assert [short(x) for x in (2678.9, 0.012345, 14.04, 3.2e7)] == ["2680", "0.0123", "14", "3.2e+07"]
