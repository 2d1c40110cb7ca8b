"""Clips against closed forms: where bodies and contact points are, and what pushes where."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon

import rungwise as rw
from rungwise.simulation import trajectory
from rungwise.viewing.plane.clip import SHOWN_SLIP, SHOWN_STICK, Clip, Outline, clip, still
from rungwise.viewing.plane.draw_frame import placed, pose_at, rounded
from rungwise.viewing.plane.extent import AWAY, BESIDE, bounds, receives_first

PUSHER = {
    "name": "pusher",
    "bodies": {
        "finger": {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.2},
            "pose": {"x": -1.2, "y": 0.0},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"upper": 2.0, "drive": {"kind": "speed", "speed": 1.0}}},
        },
        "part": {
            "role": "object",
            "shape": {"kind": "box", "width": 0.8, "height": 0.8, "radius": 0.1},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"damping": 3.0}},
        },
    },
    "contacts": [{"between": ["finger", "part"], "friction": 0.5}],
    "duration": 2.0,
}
"""A finger at speed 1 pushes a part that resists with 3 per speed; the gap is 0.5 at first."""


@pytest.fixture(scope="module")
def pushed() -> Clip:
    return clip(rw.simulate(rw.load(PUSHER), "quasistatic-rigid", step=1e-2))


def test_gap_and_force_of_a_pushed_part(pushed: Clip) -> None:
    touching = pushed.time > 0.51
    assert pushed.gap[:, 0] == pytest.approx(np.maximum(0.5 - pushed.time, 0.0), abs=1e-9)
    assert pushed.push[touching, 0] == pytest.approx(3.0, rel=1e-6)
    assert not pushed.push[pushed.time < 0.49].any()


def test_contact_point_lies_between_the_bodies_and_the_arrow_on_the_part_points_away(pushed: Clip) -> None:
    t = pushed.touches
    rows = pushed.time[t.frame] > 0.51
    where = pushed.time[t.frame[rows]] - 1.0
    assert t.place[rows] == pytest.approx(np.column_stack([where, 0.0 * where]), abs=1e-9)
    sign = 1.0 if receives_first(pushed)[0] else -1.0
    assert pushed.contacts == ("finger | part",) and sign == -1.0
    assert sign * t.force[rows] == pytest.approx(np.array([[3.0, 0.0]] * rows.sum()), abs=1e-6)


def test_gaps_are_those_of_the_outlines() -> None:
    """An independent library measures the distance between the outlines as drawn."""
    made = clip(rw.simulate("two_finger", "dynamic-rigid", parameters={"v2": 0.6}))
    for k in range(0, len(made.time), 50):
        shapes = {
            made.bodies[o.body]: Polygon(placed(rounded(o), made.pose[k, o.body]))
            if len(o.vertices) > 1
            else Point(placed(o.vertices, made.pose[k, o.body])[0])
            for o in made.outlines
            if not o.halfplane
        }
        for contact, name in enumerate(made.contacts):
            a, b = name.split(" | ")
            if made.gap[k, contact] > 1e-9 and not _is_over_a_face(shapes[b], shapes[a]):
                assert made.gap[k, contact] == pytest.approx(shapes[a].distance(shapes[b]), abs=1e-9)


def _is_over_a_face(part: Polygon, finger: Point) -> bool:
    """A finger whose nearest point is the peak has another distance than that to the best edge."""
    return part.distance(finger) == pytest.approx(finger.distance(Point(part.exterior.coords[2])), abs=1e-12)


def test_blocks_on_a_slope_rest_on_two_points_each_with_their_weight() -> None:
    run = rw.simulate("blocks", "quasistatic-rigid", parameters={"slope": 0.2})
    made = clip(run)
    last = made.touches.frame == len(made.time) - 1
    force, mode = made.touches.force[last], made.touches.mode[last]
    assert last.sum() == 6 and set(mode) == {SHOWN_STICK}
    ground = np.array([made.contacts[c].endswith("| ground") for c in made.touches.contact[last]])
    weight = 9.81 * (1.0 + 0.5 + 0.5)
    assert force[ground].sum(axis=0) == pytest.approx([0.0, weight], abs=1e-6 * weight)


def test_slipping_disc_slips_and_turns_as_its_coordinate_says() -> None:
    run = rw.simulate("slide_roll", "dynamic-rigid", parameters={"spin0": 40.0})
    made = clip(run)
    angle = run.trajectory["position"].sel(coordinate="disc.angle").to_numpy()
    assert made.pose[:, 0, 2] == pytest.approx(angle) and abs(angle).max() > 2.0 * np.pi
    assert made.touches.mode[5] == SHOWN_SLIP


def test_joints_stay_where_the_scene_has_them() -> None:
    made = clip(rw.simulate("two_link", "dynamic-rigid", duration=0.5))
    (shoulder, sx, sy), (elbow, ex, ey) = made.joints
    for pose in made.pose[::50]:
        assert placed(np.array([[sx, sy]]), pose[shoulder])[0] == pytest.approx([0.0, 1.0], abs=1e-3)
        upper = placed(np.array([[0.25, 0.0]]), pose[made.bodies.index("upper")])[0]
        assert placed(np.array([[ex, ey]]), pose[elbow])[0] == pytest.approx(upper, abs=1e-3)


def test_impulses_are_shown_as_mean_forces() -> None:
    run = rw.simulate("two_finger", "dynamic-rigid", parameters={"v2": 0.6})
    made = clip(run)
    total = (made.push[1:] * np.diff(made.time)[:, None]).sum(axis=0)
    impulse = run.trajectory["contact_impulse"].sel(direction="normal").to_numpy().sum(axis=0)
    assert total == pytest.approx([impulse[:2].sum(), impulse[2:4].sum()])
    assert made.push_is == "mean normal force"


def test_saved_run_is_drawn_as_the_run_itself(tmp_path: Path) -> None:
    run = rw.simulate(rw.load(PUSHER), "dynamic-compliant")
    run.save(tmp_path)
    again, direct = clip(tmp_path), clip(run)
    assert again.bodies == direct.bodies and again.outcome == direct.outcome
    for name in ("time", "pose", "gap", "push"):
        assert np.array_equal(getattr(again, name), getattr(direct, name))


def test_scene_is_saved_with_the_trajectory() -> None:
    for name in rw.shipped():
        scene = rw.load(name)
        data = rw.simulate(scene, "kinematic", duration=1e-2, frames=3).trajectory
        assert rw.load(json.loads(data.attrs["scene_file"])).file == scene.file


def test_saved_run_without_its_scene_is_refused_in_one_line(tmp_path: Path) -> None:
    run = rw.simulate(rw.load(PUSHER), "kinematic", duration=0.1)
    data = run.trajectory
    del data.attrs["scene_file"]
    trajectory.save(tmp_path, data, run.summary(), {})
    with pytest.raises(rw.SceneError, match="'pusher' is no file and no scene that ships"):
        clip(tmp_path)


def test_rounded_outline_has_the_area_of_the_grown_polygon() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    normals = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    for core, edges, area in (
        (square, normals, 1.0 + 4.0 * 0.3 + np.pi * 0.09),
        (square[:2], np.array([[0.0, -1.0], [0.0, 1.0]]), 2.0 * 0.3 + np.pi * 0.09),
        (square[:1], normals[:1], np.pi * 0.09),
    ):
        corners = rounded(Outline(0, core, edges, 0.3, False))
        assert Polygon(corners).area == pytest.approx(area, rel=1e-3)


def test_poses_between_frames_lie_between(pushed: Clip) -> None:
    half = pose_at(pushed, 0.5 * (pushed.time[3] + pushed.time[4]))
    assert half == pytest.approx(0.5 * (pushed.pose[3] + pushed.pose[4]))
    assert pose_at(pushed, 99.0) == pytest.approx(pushed.pose[-1])


def test_thinned_clip_keeps_what_belongs_to_its_frames(pushed: Clip) -> None:
    frames = np.array([0, 60, 120, len(pushed.time) - 1])
    thin = pushed.thinned(frames)
    assert np.array_equal(thin.time, pushed.time[frames])
    for new, old in enumerate(frames):
        assert np.array_equal(
            thin.touches.place[thin.touches.frame == new], pushed.touches.place[pushed.touches.frame == old]
        )


def test_bounds_hold_every_body_in_every_frame(pushed: Clip) -> None:
    x0, y0, x1, y1 = bounds([pushed])
    assert (x0, y0, y1) == pytest.approx((-1.4, -0.5, 0.5))
    assert x1 == pytest.approx(pushed.pose[-1, 1, 0] + 0.5)


def test_what_is_flung_away_leaves_the_frame(pushed: Clip) -> None:
    """Objects are followed for a few sizes of the start, other bodies as far as objects need room."""
    start = bounds([pushed.thinned(np.array([0]))])
    size = max(start[2] - start[0], start[3] - start[1])
    for body, far in ((1, AWAY * size), (0, BESIDE * size)):
        for up, seen in ((0.5 * far, None), (1e4 * size, start[3] + far)):
            flung = replace(pushed, pose=np.repeat(pushed.pose[:1], len(pushed.time), axis=0))
            flung.pose[-1, body, 1] += up
            reach = 0.5 if body == 1 else 0.2
            whole = (start[0], start[1], start[2], up + reach if seen is None else seen)
            assert bounds([flung]) == pytest.approx(whole)


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID], ids=str)
def test_a_state_is_drawn_as_the_last_frame_of_its_run(model: rw.Rung) -> None:
    run = rw.simulate(rw.load(PUSHER), model, step=1e-2)
    whole, one = clip(run), still(run.scene, model, run.parameters, run.state)
    assert one.time[0] == whole.time[-1] and np.array_equal(one.pose[0], whole.pose[-1])
    assert np.array_equal(one.gap[0], whole.gap[-1])
    last = whole.touches.frame == len(whole.time) - 1
    assert np.array_equal(one.touches.place, whole.touches.place[last])
    assert np.array_equal(one.touches.mode, whole.touches.mode[last])
    # An impulse is no force: where contact is rigid and bodies have momentum, none is drawn.
    impacts = model is rw.DYNAMIC_RIGID
    expected = whole.touches.force[last]
    assert np.array_equal(one.touches.force, np.zeros_like(expected) if impacts else expected)
    start = still(run.scene, model, run.parameters, rw.State.of(run.scene))
    assert np.array_equal(start.pose[0], whole.pose[0]) and not start.touches.force.any()
