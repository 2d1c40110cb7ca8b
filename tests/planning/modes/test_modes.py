"""Plans by contact modes: what modes there are, which forces balance, and plans that are run."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.balance import modes, motion, rests
from rungwise.planning.modes.follow import follow
from rungwise.planning.modes.forces.cones import PART, SLIDE
from rungwise.planning.modes.frames import weights_of
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.guide import guide
from rungwise.planning.modes.outlines import alike
from rungwise.planning.modes.planner import COURSES, anew_on, mode_planner
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.modes.tree import far, propose
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import Work, begin
from rungwise.planning.task.task import task_of
from rungwise.world.find import world_of

WIDTH, HEIGHT, WALL, MASS = 0.08, 0.025, 0.035, 0.5


def _finger(number: int, x: float, y: float, drive: dict[str, Any]) -> dict[str, Any]:
    own = {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.004}, "pose": {"x": x, "y": y},
        "motion": {"kind": "free"}, "mass": 0.1, "force": [0, 0.981],
        "coordinates": {
            axis: {"drive": {"kind": "servo", "target": f"{axis}{number}", **drive}} for axis in "xy"
        }
        | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
    }  # fmt: skip
    return own


TRANSIT = {"transit": {"finger1": {"speed": 0.1, "clearance": 0.004, "push": [0.01, 0.2]}}}
"""How the finger of the block is led."""


def block_at_a_wall(
    friction: float = 0.6, tilt: float = 0.7, led: dict[str, Any] = TRANSIT, damping: float = 15.0
) -> rw.Scene:
    """A block on a floor, with its right side at a low wall about whose edge one finger tips it."""
    drive = {"stiffness": 500, "damping": damping, "limit": 20}
    x, y = -WIDTH - 0.02, 0.03
    return rw.load(
        {
            "name": "block_at_a_wall",
            "parameters": {"x1": {"default": x}, "y1": {"default": y}},
            "inputs": ["x1", "y1"], "gravity": [0, -9.81],
            "bodies": {
                "finger1": _finger(1, x, y, drive),
                "part": {
                    "role": "object", "mass": MASS, "pose": {"x": -WIDTH / 2, "y": HEIGHT / 2},
                    "shape": {"kind": "box", "width": WIDTH, "height": HEIGHT}, "motion": {"kind": "free"},
                },
                "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
                "wall": {
                    "role": "obstacle", "shape": {"kind": "box", "width": 0.03, "height": WALL},
                    "pose": {"x": 0.015, "y": WALL / 2},
                },
            },
            "contacts": [
                {"between": ["finger1", "part"], "friction": friction, "stiffness": 1e6, "damping": 1e3},
                {"between": ["part", "floor"], "friction": 0.3, "stiffness": 1e6, "damping": 1e3},
                {"between": ["part", "wall"], "friction": 0.3, "stiffness": 1e6, "damping": 1e3},
                {"between": ["finger1", "floor"], "friction": 0, "stiffness": 1e6, "damping": 1e3},
                {"between": ["finger1", "wall"], "friction": 0, "stiffness": 1e6, "damping": 1e3},
            ],
            "goal": f"abs(part.angle + {tilt}) <= 0.15", "tolerance": 1e-6, "duration": 60, "step": 0.01,
            "task": {
                "inputs": {"x1": {"range": [-0.3, 0.1]}, "y1": {"range": [0.005, 0.3]}}, "moves": [1, 6],
                **led,
            },
        }
    )  # fmt: skip


def disc_on_a_floor(goal: str = "abs(part.x - 0.12) <= 0.01 and rest(part)") -> rw.Scene:
    """A disc on a floor, and a finger on either side of it."""
    drive, radius = {"stiffness": 500, "damping": 15, "limit": 20}, 0.05
    names, led = ["x1", "y1", "x2", "y2"], {"speed": 0.1, "clearance": 0.004, "push": [0.005, 0.5]}
    starts = dict(zip(names, (-0.12, radius, 0.12, radius), strict=True))
    stiff = {"stiffness": 1e6, "damping": 1e3}
    return rw.load(
        {
            "name": "disc_on_a_floor", "parameters": {name: {"default": at} for name, at in starts.items()},
            "inputs": names, "gravity": [0, -9.81],
            "bodies": {
                "finger1": _finger(1, starts["x1"], radius, drive),
                "finger2": _finger(2, starts["x2"], radius, drive),
                "part": {
                    "role": "object", "mass": MASS, "pose": {"x": 0, "y": radius},
                    "shape": {"kind": "disc", "radius": radius}, "motion": {"kind": "free"},
                },
                "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
            },
            "contacts": [
                {"between": ["finger*", "part"], "friction": 0.5, **stiff},
                {"between": ["part", "floor"], "friction": 0.5, **stiff},
                {"between": ["finger*", "floor"], "friction": 0, **stiff},
                {"between": ["finger1", "finger2"], "friction": 0, **stiff},
            ],
            "goal": goal, "tolerance": 1e-6, "duration": 60, "step": 0.01,
            "task": {
                "inputs": {
                    name: {"range": [-0.5, 0.6] if name[0] == "x" else [0.006, 0.4]} for name in names
                },
                "moves": [1, 8], "transit": {"finger1": led, "finger2": led},
            },
        }
    )  # fmt: skip


def _pushed_box(others: dict[str, Any] | None = None, goal: str = "") -> rw.Scene:
    """A box on a support, and others, seen from above, with two fingers at given speeds."""
    finger = {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.005}, "motion": {"kind": "free"},
        "coordinates": {"angle": {"drive": {"kind": "speed", "speed": 0}}},
    }  # fmt: skip
    bodies: dict[str, Any] = {
        f"finger{k}": finger
        | {"pose": {"x": -0.3, "y": 0.1 * k}}
        | {
            "coordinates": finger["coordinates"]
            | {axis: {"drive": {"kind": "speed", "speed": f"0.1 * {axis}{k}"}} for axis in "xy"}
        }
        for k in (1, 2)
    }
    box = {
        "role": "object", "mass": 1, "shape": {"kind": "box", "width": 0.2, "height": 0.2},
        "motion": {"kind": "free"}, "support": {"friction": 0.3, "load": 9.81},
    }  # fmt: skip
    bodies["part"] = box
    bodies |= {name: box | {"pose": pose} for name, pose in (others or {}).items()}
    inputs = ["x1", "y1", "x2", "y2"]
    led = {"speed": 0.1, "clearance": 0.005, "push": [0.01, 1.0]}
    return rw.load(
        {
            "name": "pushed_box", "parameters": {name: {"default": 0.0} for name in inputs},
            "inputs": inputs, "bodies": bodies,
            "contacts": [
                {"between": ["finger*", "part*"], "friction": 0.5, "stiffness": 1e6, "damping": 1e3},
                {"between": ["finger1", "finger2"], "friction": 0, "stiffness": 1e6, "damping": 1e3},
                *({"between": ["part", name], "friction": 0.3} for name in others or {}),
            ],
            "goal": goal or "hypot(part.x - 0.5, part.y) <= 0.05", "tolerance": 1e-6, "duration": 60,
            "step": 0.01,
            "task": {
                "inputs": {name: {"range": [-1, 1]} for name in inputs}, "moves": [1, 12],
                "transit": {"finger1": led, "finger2": led},
            },
        }
    )  # fmt: skip


def _work(scene: rw.Scene) -> Work:
    return begin(task_of(scene), Budget(None, 60.0), 0, 1)


def _start(scene: rw.Scene) -> tuple[Ground, Seen]:
    work = _work(scene)
    ground = Scene(work).grounds["part"]
    return ground, ground.look(work.start.q[0])


def test_contacts_and_weight_of_a_block_are_seen() -> None:
    scene = block_at_a_wall()
    ground, seen = _start(scene)
    points = seen.touches.points[seen.closed]
    expected = [[-WIDTH, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, HEIGHT]]
    assert sorted(points.round(9).tolist()) == sorted(expected)
    assert ground.around.loads(seen.q)[ground.columns] == pytest.approx([0.0, -MASS * 9.81, 0.0])
    around = world_of(scene).surroundings(scene.parameters({}))
    assert around is not None
    assert around.stiffness[:2] == pytest.approx(500.0)


def test_a_block_may_slide_from_the_wall_rise_along_it_or_tip() -> None:
    ground, seen = _start(block_at_a_wall())

    def made(want: list[float]) -> list[list[float]]:
        return [motion.round(6).tolist() for _, motion in modes(ground, seen, np.array(want))]

    assert made([-1.0, 0.0, 0.0])[0] == [-1.0, 0.0, 0.0]
    assert made([0.0, 1.0, 0.0])[0] == [0.0, 1.0, 0.0]
    assert made([1.0, -1.0, 0.0]) == []
    for mode, own in modes(ground, seen, np.array([0.0, 0.0, -1.0])):
        assert own @ [0.0, 0.0, -1.0] > 0.0
        rows = seen.touches.rows[seen.closed, 0][:, ground.columns] / ground.units
        rates = rows @ own
        assert (rates >= -1e-9).all()
        assert np.abs(rates[np.array(mode) != PART]).max(initial=0.0) < 1e-9


def test_forces_of_a_finger_balance_a_block_that_slides() -> None:
    """A finger at half the height pushes a block from the right against friction on the floor."""
    ground, seen = _start(block_at_a_wall())
    q = seen.q.copy()
    q[ground.columns[0]] -= 0.1
    part = next(
        p for p in np.linspace(0, 1, 401)
        if np.allclose(ground.around.outline(ground.body)(np.array([p]))[1], [[-1.0, 0.0]])
        and abs(ground.around.outline(ground.body)(np.array([p]))[0][0, 1]) < 1e-3
    )  # fmt: skip
    placed = ground.placed(q, 0, float(part))
    assert placed is not None
    begun, used = ground.look(placed), np.ones(1, np.int64)
    found = motion(ground, begun, used, (SLIDE, SLIDE), np.array([1.0, 0.0, 0.0]), 0.0)
    assert found is not None
    assert found.change == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    # The finger pushes its contact: what acts on it is friction of the floor, 0.3 m g less what it lifts.
    push = found.pushes[ground.fingers[0].columns]
    assert push[0] == pytest.approx(0.3 * (MASS * 9.81 - push[1]), rel=2e-2)


def test_a_block_rests_on_a_floor_and_not_in_the_air() -> None:
    ground, seen = _start(block_at_a_wall())
    none = np.zeros(1, np.int64)
    assert rests(ground, seen, none) is not None
    lifted = seen.q.copy()
    lifted[ground.columns[1]] += 0.1
    assert rests(ground, ground.look(lifted), none) is None


def test_a_finger_goes_with_the_outline_as_the_block_turns() -> None:
    ground, seen = _start(block_at_a_wall())
    q = seen.q.copy()
    q[ground.columns[:2]] += [-0.1, 0.1]
    placed = ground.placed(q, 0, 0.4)
    assert placed is not None
    used, now = np.ones(1, np.int64), ground.look(placed)
    part = ground.part(now, 0)[0]
    for _ in range(50):
        now = ground.corrected(ground.moved(now, np.array([0.0, 0.0, 0.01]), used), set(), used)
    assert now.held[0] >= 0
    assert abs(now.touches.gaps[now.held[0]]) < 1e-7
    perimeter, rolled = 2 * (WIDTH + HEIGHT), 0.5 * 0.004
    assert abs(ground.part(now, 0)[0] - part) * perimeter == pytest.approx(rolled, rel=5e-2)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(2))
def test_a_block_is_tipped_about_a_wall(seed: int) -> None:
    """The plan is found, holds on the dynamic rung as well, and the same seed gives the same plan."""
    scene = block_at_a_wall()
    found = rw.plan(scene, seed=seed)
    assert found.found, found.reason
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL
    assert found.replay("quasistatic-rigid").outcome == rw.Outcome.GOAL


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(1, 5))
def test_fingers_of_a_task_are_led_as_those_of_transit(seed: int) -> None:
    """The same block, with `task.fingers` in place of `transit`."""
    scene = block_at_a_wall(
        led={"fingers": {"finger*": {"speed": 0.1, "clearance": 0.004, "press": [0.3, 15]}}}
    )
    found = rw.plan(scene, to="quasistatic-rigid", seed=seed)
    assert found.found, found.reason
    assert found.replay().outcome == rw.Outcome.GOAL


OVER_TIME = {
    "inputs": {"x1": {"range": [-0.3, 0.1], "rate": 0.1}, "y1": {"range": [0.005, 0.3], "rate": 0.1}}
}
"""Inputs that lead the finger of the block over time, without transit."""


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(1, 5))
def test_a_disc_is_rolled_along_a_floor_to_rest(seed: int) -> None:
    """Its angle may be any, and servos that come nearer ever more slowly are waited for."""
    found = rw.plan(disc_on_a_floor(), seed=seed)
    assert found.found, found.reason
    run = found.replay(tol=0.1 * found.tol)
    assert run.outcome == rw.Outcome.GOAL


@pytest.mark.parametrize(
    ("scene", "weighs"),
    [
        (disc_on_a_floor(), 0.1),
        (disc_on_a_floor("abs(part.x - 0.2) <= 0.01 and abs(part.angle) <= 1"), 1.0),
        (block_at_a_wall(), 1.0),
    ],
)
def test_the_angle_of_a_disc_weighs_little_where_the_goal_does_not_ask(
    scene: rw.Scene, weighs: float
) -> None:
    ground, _ = _start(scene)
    assert ground.units[:2].tolist() == [1.0, 1.0]
    assert ground.units[2] == pytest.approx(weighs * ground.task.weights[ground.columns[2]])


def test_fingers_that_inputs_lead_over_time_are_led_by_contact_modes() -> None:
    """The plan holds on all rungs that know forces, and no input changes faster than it may."""
    scene = block_at_a_wall(led=OVER_TIME)
    found = rw.plan(scene, seed=1)
    assert found.found, found.reason
    assert "follow" in found.labels
    for rung in rw.LADDER[2:]:
        assert found.replay(rung, tol=0.1 * found.tol).outcome == rw.Outcome.GOAL
    levels, durations = found.levels()
    before = np.vstack([[scene.parameters()[name] for name in scene.template.inputs], levels[:-1]])
    assert (np.abs(levels - before) <= 0.1 * (1.0 + 1e-6) * durations[:, None]).all()


def test_a_schedule_that_is_too_fast_is_slowed_down() -> None:
    """What holds on the quasistatic rung at any speed holds with inertia where it is slow enough."""
    scene = block_at_a_wall(damping=1.0)
    found = rw.plan(scene, to="quasistatic-rigid", seed=0)
    assert found.found, found.reason
    hurried = replace(
        found, segments=tuple(replace(each, duration=0.1 * each.duration) for each in found.segments)
    )
    assert hurried.replay().outcome == rw.Outcome.GOAL
    assert hurried.replay("dynamic-compliant").outcome != rw.Outcome.GOAL
    lifted = rw.plan(scene, initial=hurried, seed=0)
    assert lifted.found, lifted.reason
    assert lifted.records[-1].how == "held more slowly"


def _impossible() -> dict[str, tuple[rw.Scene, str]]:
    """Tasks without a solution, with the object: no friction; fingers that go the wrong way only."""
    smooth = block_at_a_wall(friction=0.0, tilt=2.5)
    slow = rw.load("push").file.model_dump(mode="json", exclude_none=True)
    slow["task"]["inputs"] = {"ux": {"range": [-1, 0]}, "uy": {"range": [-1, 1]}}
    slow["parameters"]["goal_x"]["default"] = 0.4
    slow["task"]["moves"] = [1, 1]
    return {"smooth": (smooth, "part"), "backwards": (rw.load(slow), "box")}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", _impossible())
def test_where_there_is_no_plan_the_nearest_pose_is_named(name: str) -> None:
    """Or that nothing came nearer than the start; no plan is said to lack nothing."""
    scene, part = _impossible()[name]
    found = rw.plan(scene, to="quasistatic-rigid", seed=0, budget=10_000)
    assert not found.found
    near = re.search(r"the nearest plan misses the goal by (\S+), with (.*)", found.reason)
    start = re.search(
        r"no plan ended nearer to the goal than the start, which misses it by ([^\s;]+)", found.reason
    )
    said = near or start
    assert said is not None, found.reason
    assert float(said[1]) > 1e-6
    assert near is None or f"{part}.x = " in near[2]
    trees = re.search(r"contact modes: (\d+) trees of (\d+) legs", found.reason)
    assert trees is not None and int(trees[1]) > 0
    assert name == "backwards" or "most proposals failed for these reasons" in found.reason


@pytest.mark.few(1)
@pytest.mark.parametrize("budget", [1, 3_000])
def test_a_tree_that_finds_nothing_ends_with_the_budget(budget: int) -> None:
    """What trees draw and follow counts, also where hardly anything is run."""
    scene, _ = _impossible()["smooth"]
    work = begin(task_of(scene), Budget(budget), 1, 1)
    predictor = work.predictor(Stage(rw.QUASISTATIC_RIGID, 0.01))
    assert anew_on(work, predictor) is None
    trees = work.budget.spent.total()
    assert budget <= trees <= 2 * budget + 5_000
    assert work.budget.ended == "the budget is spent"


def test_two_fingers_at_given_speeds_push_side_by_side() -> None:
    """A box on a support is led straight on and about a point beside it by two fingers on one face, and they
    press both."""
    scene = _pushed_box()
    ground, seen = _start(scene)
    used = np.ones(2, np.int64)
    placed: Any = seen.q
    for f, part in enumerate((0.05, 0.2)):
        placed = ground.placed(placed, f, part)
    begun = ground.look(placed)
    point, normal = ground.around.outline(ground.body)(np.array([0.05, 0.2]))
    assert normal[0] == pytest.approx(normal[1])
    for turn in (0.0, 0.02, -0.02):
        want = np.array([*(-0.1 * normal[0]), turn])
        found = motion(ground, begun, used, (), want, 0.0)
        assert found is not None
        assert found.change * ground.units == pytest.approx(want, abs=1e-6)
        pushes = [found.pushes[finger.columns] @ -normal[0] for finger in ground.fingers]
        assert min(pushes) > 0.05 * max(pushes)
    parts = alike(ground.around.outline(ground.body), np.full(50, 0.05), np.random.default_rng(0))
    assert ground.around.outline(ground.body)(parts)[1] == pytest.approx(np.tile(normal[0], (50, 1)))
    assert np.ptp(parts) > 0.1 and point.shape == (2, 2)


def test_two_objects_are_led_one_after_the_other() -> None:
    """Each to its part of the goal, beside the other, by modes alone; neither runs into the other."""
    goal = "hypot(part.x - 0.4, part.y) <= 0.03 and hypot(part2.x - 0.1, part2.y - 0.4) <= 0.03"
    scene = _pushed_box({"part2": {"x": 0.3, "y": 0.0}}, goal)
    work = _work(scene)
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-3)))
    assert planner is not None
    found = planner.search(200)
    assert found is not None
    run = rw.simulate(scene, "quasistatic-rigid", inputs=list(found.course.segments), tol=1e-3)
    assert run.outcome == rw.Outcome.GOAL
    ground, seen = planner.scene.grounds["part"], planner.scene.grounds["part"].look(work.start.q[0])
    assert ground.beside.sum() == 1
    target, q = seen.q.copy(), seen.q
    target[ground.columns[0]] += 0.4
    placed: Any = q
    every = np.linspace(0.0, 1.0, 81)
    left = every[ground.around.outline(ground.body)(every)[1][:, 0] < -0.99]
    for f, part in enumerate((left[4], left[-4])):
        placed = ground.placed(placed, f, float(part))
    way = follow(ground, ground.look(placed), np.ones(2, np.int64), (), target, 0.0, lambda _: None)
    assert way.why == "overlap"
    assert 0.05 < way.places[-1][ground.columns[0]] < 0.1


def test_saved_plans_are_read_again(tmp_path: Any) -> None:
    found = rw.plan(block_at_a_wall(), to="quasistatic-rigid", seed=7)
    again = rw.load_plan(found.save(tmp_path / "plan.json"))
    assert again.segments == found.segments
    assert Counter(again.labels) == Counter(found.labels)
    assert again.replay().outcome == rw.Outcome.GOAL


def box_before_a_wall() -> rw.Scene:
    """A box on a support, seen from above, with a wall on its straight way, and a finger."""
    return rw.load(
        {
            "name": "around", "inputs": ["x1", "y1"],
            "parameters": {"x1": {"default": -0.3}, "y1": {"default": 0.0}},
            "bodies": {
                "finger1": _finger(1, -0.3, 0.0, {"stiffness": 500, "damping": 15, "limit": 20})
                | {"force": [0, 0]},
                "part": {
                    "role": "object", "mass": 1, "pose": {"x": 0, "y": 0}, "motion": {"kind": "free"},
                    "shape": {"kind": "box", "width": 0.1, "height": 0.1},
                    "support": {"friction": 0.3, "load": 9.81},
                },
                "wall": {
                    "role": "obstacle", "shape": {"kind": "box", "width": 0.05, "height": 0.2},
                    "pose": {"x": 0.3, "y": 0},
                },
            },
            "contacts": [
                {"between": ["finger1", "part"], "friction": 0.5},
                {"between": ["part", "wall"], "friction": 0.3},
                {"between": ["finger1", "wall"], "friction": 0},
            ],
            "goal": "hypot(part.x - 0.6, part.y) <= 0.02", "tolerance": 1e-6, "duration": 60, "step": 0.01,
            "task": {
                "inputs": {"x1": {"range": [-1, 1]}, "y1": {"range": [-1, 1]}},
                "moves": [1, 8],
                **TRANSIT,
            },
        }
    )  # fmt: skip


def test_an_object_is_guided_around_a_wall() -> None:
    """The way of a box around a wall on its straight way keeps apart from it; a free one needs no guide."""
    scene = box_before_a_wall()
    ground, seen = _start(scene)
    goal = seen.q.copy()
    goal[ground.columns[0]] = 0.6
    way = guide(ground, seen.q, goal, 0, lambda: True)
    assert way is not None and len(way) > 2
    assert way[-1][ground.columns] == pytest.approx([0.6, 0.0, 0.0])
    assert all(ground.look(q).touches.least[ground.pairs].min() > 0.0 for q in way)
    near = seen.q.copy()
    near[ground.columns[0]] = 0.1
    straight = guide(ground, seen.q, near, 0, lambda: True)
    assert straight is not None and not len(straight)
    assert guide(ground, seen.q, goal, 0, lambda: False) is None


def test_the_shortest_courses_are_followed_in_turn() -> None:
    """Of the ways around a wall, on either side, for some trees each."""
    work = _work(box_before_a_wall())
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-3)))
    assert planner is not None
    (ground,) = planner.scene.grounds.values()
    seen = list[float]()
    for planner.turn in range(COURSES):
        course = planner._course(ground)
        seen.append(sum(ground.away(a, b) for a, b in pairwise(course)))
        assert course is planner._course(ground)
    assert seen == sorted(seen) and len(set(seen)) == COURSES
    assert seen[0] >= 0.59


def test_nodes_with_a_course_lack_what_is_left_of_it_and_more_where_moves_are_spent() -> None:
    work = _work(box_before_a_wall())
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-3)))
    assert planner is not None
    (ground,) = planner.scene.grounds.values()
    root, course = planner.nodes[0], planner._course(ground)
    on = replace(root, places=root.places._replace(q=course[len(course) // 2][None]))
    planner.nodes = [root, on, replace(on, grasps=2), replace(on, grasps=work.task.moves[1])]
    start, half, early, late = planner._lacks().tolist()
    assert half == early < start
    assert half == pytest.approx(0.5, abs=0.1)
    assert late > start


def test_a_tree_that_does_not_come_to_the_goal_leads_along_its_path() -> None:
    """In a few rounds; without a path it leads nowhere then."""
    work = _work(box_before_a_wall())
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-3)))
    assert planner is not None
    (ground,) = planner.scene.grounds.values()
    q, course = work.start.q[0], planner._course(ground)

    def led(path: Any) -> Any:
        return propose(
            ground, q, q, course[-1:], planner._reached(ground), 0.1, np.random.default_rng(0), 12,
            Counter(), lambda _: None, path, 8, Counter(),
        )  # fmt: skip

    assert led(course[:0]) is None
    assert far(ground, led(course)[-1].way.places[-1], course) >= 3


@pytest.mark.parametrize("weights", [{}, {"x": 1.0, "y": 1.0}, {"x": 2.0}])
def test_turns_that_a_task_does_not_weigh_have_a_length_all_the_same(weights: dict[str, float]) -> None:
    """Balance and ways divide by these lengths."""
    task = task_of(rw.load("grasp"))
    weighed = np.array([weights.get(name.split(".")[1], 0.0) for name in task.scene.template.coordinates])
    own = replace(task, weights=weighed if weights else task.rates)
    columns = np.flatnonzero(task.rates > 0.0)
    found = weights_of(own, columns)
    assert (found > 0.0).all() and found[0] == weights.get("x", 1.0)
