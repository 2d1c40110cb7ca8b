"""Boxes through corridors, seen from above, by fingers at given speeds: legs that lead on, few regrasps."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.planner import ModePlanner, mode_planner
from rungwise.planning.modes.running.execute import Manner
from rungwise.planning.modes.running.in_turn import InTurn
from rungwise.planning.modes.tree import propose
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

STIFF = {"stiffness": 1e6, "damping": 1e3}
BOX = {"kind": "box", "width": 0.35, "height": 0.2}
L_SHAPE = [
    {"kind": "box", "width": 0.3, "height": 0.12, "at": [0, -0.06]},
    {"kind": "box", "width": 0.12, "height": 0.12, "at": [-0.09, 0.06]},
]


class Corridor(NamedTuple):
    """A passage of some width between two walls, what is to go through it, how long it is, whether it leads
    to the other side, and the angle at the start and the goal."""

    width: float = 0.25
    shape: Any = BOX
    long: float = 0.5
    mirrored: bool = False
    turned: float = math.pi / 2

    @property
    def scene(self) -> rw.Scene:
        """Two fingers at given speeds before the corridor."""
        led = {"speed": "v", "clearance": 0.005, "push": [0.005, 1.2]}
        side, inputs = -1.0 if self.mirrored else 1.0, ["u1", "w1", "u2", "w2"]
        bodies: dict[str, Any] = {}
        for k in (1, 2):
            own = {
                axis: {"drive": {"kind": "speed", "speed": f"v * {name}{k}"}}
                for axis, name in (("x", "u"), ("y", "w"))
            }
            bodies[f"finger{k}"] = {
                "role": "robot", "shape": {"kind": "disc", "radius": 0.005}, "motion": {"kind": "free"},
                "pose": {"x": -0.3, "y": side * (0.05 + 0.1 * k)},
                "coordinates": own | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
            }  # fmt: skip
        bodies["part"] = {
            "role": "object", "mass": 1, "shape": self.shape, "motion": {"kind": "free"},
            "pose": {"x": 0, "y": side * 0.175, "angle": side * self.turned},
            "support": {"friction": 0.3, "load": 9.81},
        }  # fmt: skip
        for k, y in (1, 0.35), (2, 1.05 + self.width):
            bodies[f"wall{k}"] = {
                "role": "obstacle", "shape": {"kind": "box", "width": self.long, "height": 0.7},
                "pose": {"x": 0.6875 + self.long / 2, "y": side * y},
            }  # fmt: skip
        pairs = [(("finger*", "part"), 0.8), (("part", "wall*"), 0.3), (("finger*", "wall*"), 0.0)]
        return rw.load(
            {
                "name": "sofa", "inputs": inputs, "bodies": bodies,
                "parameters": {"v": {"default": 0.1, "range": [1e-6, 1e3]}}
                | {name: {"default": 0.0, "range": [-10, 10]} for name in inputs},
                "contacts": [{"between": pair, "friction": mu, **STIFF} for pair, mu in pairs]
                + [{"between": ["finger1", "finger2"], "friction": 0, **STIFF}],
                "goal": f"hypot(part.x - {0.9 + self.long}, part.y - {side * 1.45}) <= 0.05"
                f" and abs(part.angle - {side * self.turned}) <= 0.3",
                "tolerance": 1e-7, "duration": 120, "step": 0.01,
                "task": {
                    "inputs": {name: {"range": [-1, 1]} for name in inputs}, "moves": [1, 12],
                    "transit": dict.fromkeys(("finger1", "finger2"), led),
                },
            }
        )  # fmt: skip


CORRIDORS = {
    "narrow": Corridor(width=0.22),
    "mirrored": Corridor(mirrored=True),
    "long": Corridor(long=0.8),
    "small": Corridor(width=0.2, shape={"kind": "box", "width": 0.25, "height": 0.15}),
    "L": Corridor(width=0.28, shape=L_SHAPE, turned=0.0),
}


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", list(CORRIDORS))
def test_fingers_at_given_speeds_lead_an_object_through_a_corridor(name: str, seed: int) -> None:
    found = rw.plan(CORRIDORS[name].scene, seed=seed)
    assert found.found, found.reason
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


def _begun() -> tuple[ModePlanner, Ground, np.ndarray]:
    work = begin(task_of(Corridor().scene), Budget(), 0, 1)
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-3)))
    assert planner is not None
    (ground,) = planner.scene.grounds.values()
    return planner, ground, work.start.q[0]


def _straight(ground: Ground, q: np.ndarray, count: int) -> np.ndarray:
    """Places (count, n) of the object on a straight way to the side."""
    path = np.repeat(q[None], count, axis=0)
    path[:, ground.places[0]] += 0.5 * ground.task.size * np.arange(count)
    return path


def test_a_tree_leads_an_object_on_along_its_course_with_the_fingers_that_push_it() -> None:
    """One round, from several seeds: farther than a target that is drawn, with one change of places."""
    planner, ground, q = _begun()
    path, changes, ends = _straight(ground, q, 9), list[int](), list[float]()
    for seed in range(3):
        legs = propose(
            ground, q, q, path[-1:], planner._reached(ground), 0.1, np.random.default_rng(seed), 1, Counter(),
            lambda _: None, path, 8, Counter(),
        )  # fmt: skip
        if legs is not None:
            changes.append(sum(bool(leg.changes.any()) for leg in legs))
            ends.append(float(legs[-1].way.places[-1][ground.places[0]] - q[ground.places[0]]))
    assert len(changes) >= 1
    assert min(changes) == 1 and max(ends) >= 2.5 * ground.task.size


def test_a_later_leg_that_leads_to_its_end_at_once_saves_a_regrasp() -> None:
    """Not one that goes elsewhere, and none where nothing is saved."""
    planner, ground, q = _begun()
    manner, every = Manner(0.1, 1.0), np.arange(0.5, 400) / 400
    facing = ground.around.outline(ground.body)(every)[1]
    turn = q[ground.places[2]]
    left = every[(facing @ [math.cos(turn), -math.sin(turn)] < -0.99)]
    legs, vectors = [], []
    for far in (0.05, 0.1):
        vector = np.zeros(2 + 3 + 2 * 5)
        vector[2:5] = q[ground.places] + [far, 0.0, 0.0]
        for k, part in enumerate(left[[len(left) // 4, 3 * len(left) // 4]]):
            vector[5 + 5 * k : 10 + 5 * k] = [1.0, 1.0, part, *q[ground.fingers[k].columns]]
        made = planner.scene.leg(q, vector, manner, lambda _: None)
        assert made is not None
        legs.append(made.leg)
        vectors.append(vector)
    ends = [leg.way.places[-1] for leg in legs]
    running = InTurn(planner.work, planner.scene, planner._ran, planner._look, "")
    found = running._sooner(legs, vectors, ends, 0, q, manner)
    assert found is not None and found[0] == 1
    assert found[1].leg.way.places[-1] == pytest.approx(ends[1])
    stays = legs[0]._replace(changes=np.zeros(2, np.int64))
    assert running._sooner([stays, legs[1]], vectors, ends, 0, q, manner) is None
    assert running._sooner(legs, vectors, [ends[0], _straight(ground, q, 5)[-1]], 0, q, manner) is None
    assert running._sooner(legs, vectors, ends, 1, q, manner) is None
