"""What touches what in a planar scene, and the forces that act there (see `world.carriers.Surroundings`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene import Scene
from rungwise.scene.template.records import SERVO, Records
from rungwise.simulation.planar.state.nearby import gather, look
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.planar.straight import way_is_clear
from rungwise.system.planar.contact_manifold import ABSENT, GAP, NORMAL_X, POINT_X, VERTICES
from rungwise.system.planar.place import place
from rungwise.system.planar.terms import constants, couple, loads
from rungwise.system.terms import SUPPORT, rows_of
from rungwise.world.carriers import ROUNDED, Beside, Near, Outline, Surfaces, Touches, frame_of
from rungwise.world.planar.boundary import boundary
from rungwise.world.planar.place import PlanarPlace

FEATURES = 4 * VERTICES * VERTICES
"""More than there are features of one pair of shapes."""


@kernel
def _seek(
    records: Records,
    workspace: Workspace,
    q: Reals,
    within: float,
    only: int,
    contacts: int,
    poses: Reals,
    acting: Reals,
) -> int:
    """Place the bodies at q (n,) and gather what is nearer than `within`, of pair `only` unless that is
    negative; returns how many contacts that are, of so many slots. Write poses (b, 3), and what acts (n,)."""
    state = workspace.state
    copy(q, state.q)
    features = state.manifolds.features
    for slot in range(features.shape[0]):
        features[slot] = ABSENT
    clock = state.clock[0]
    clock.margin, clock.tried, clock.next, clock.near = math.inf, 0.0, 0.0, within
    place(records, state.q, state.placed, False)
    look(records, workspace, state.v)
    for p in range(records.pairs.shape[0] if only >= 0 else 0):
        if records.pairs[p].contact != only:
            features[2 * p] = features[2 * p + 1] = ABSENT
    count, found = gather(records, workspace), 0
    while found < count and workspace.scratch.slots[found] < contacts:
        found += 1
    pose = state.placed.pose
    for b in range(poses.shape[0]):
        poses[b, 0], poses[b, 1], poses[b, 2] = pose[b, 0], pose[b, 1], math.atan2(pose[b, 3], pose[b, 2])
    loads(records, pose, state.q, state.v, state.start, 0.0, 0.0, 1.0, acting, workspace.terms)
    return found


_NONE = Beside(np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 2, 0)), np.zeros(0))
"""In the plane all contacts are told."""


class PlanarSurroundings:
    """See `Surroundings`. Robots that may be raised are in the plane."""

    dimension, tangents = 2, 1

    def __init__(self, scene: Scene, parameters: Mapping[str, float]) -> None:
        here = PlanarPlace(scene, parameters)
        self._records, self._workspace = here.bound.records, here.workspace
        self._records.contacts["raised"] = 0.0
        self._records.supports["exact"] = 0  # planners balance by ellipsoids
        own, state = self._records.coordinates, self._workspace.state
        servo, limited = own["drive"] == SERVO, own["limited"] != 0
        self.stiffness = np.where(servo, own["stiffness"], 0.0)
        self.limit = np.where(servo & limited, own["limit"], math.inf)
        self._passive, self._contacts = np.zeros(len(state.q)), 2 * len(self._records.pairs)
        self._of_pair = np.array(self._records.pairs["contact"], np.int64)
        self._outlines: dict[int, Outline] = {}
        couple(self._records, self._workspace.terms.entries.matrices)
        count = int(constants(self._records, self._workspace.terms))
        self._rubbed = np.flatnonzero(self._workspace.terms.account[:count] == SUPPORT)

    @cached_property
    def owners(self) -> Ints:
        return np.array(self._records.coordinates["body"], np.int64)

    @property
    def placed(self) -> Ints:
        return self.owners

    def near(self, q: Reals, pair: int) -> Near:
        found = self._touches(q, math.inf, pair)
        k = int(found.gaps.argmin())
        return Near(
            float(found.gaps[k]), found.points[k], found.normals[k],
            np.array([[found.normals[k, 1], -found.normals[k, 0]]]), found.rows[k],
            float(found.friction.max()),
        )  # fmt: skip

    def least(self, q: Reals, pairs: Ints, within: float = math.inf) -> Reals:  # noqa: ARG002
        return self.touches(q, 0.0).least[pairs]

    def changed(self, q: Reals, change: Reals) -> Reals:
        return q + change

    def change(self, q: Reals, to: Reals) -> Reals:
        return to - q

    def rows(self, q: Reals, body: int, points: Reals, normals: Reals) -> Reals:
        _, turn = frame_of(self.poses(q)[body])
        arms, found = points @ turn.T, np.zeros((len(points), 2, len(q)))
        along = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
        columns = np.flatnonzero(self.owners == body)
        for k, way in enumerate((normals, along)):
            turning = arms[:, 0] * way[:, 1] - arms[:, 1] * way[:, 0]
            found[:, k, columns] = np.column_stack([way, turning])
        return found

    def room(self, q: Reals, body: int, points: Reals, normals: Reals, pairs: Ints) -> Reals:  # noqa: ARG002
        return np.full(len(points), math.inf)

    def moved_by(self, columns: Ints) -> Ints:
        return np.unique(self.owners[columns])

    def touches(self, q: Reals, within: float) -> Touches:
        return self._touches(q, within, -1)

    def _touches(self, q: Reals, within: float, only: int) -> Touches:
        """What touches, of one pair unless that is negative."""
        records, state, terms = self._records, self._workspace.state, self._workspace.terms
        poses, acting = np.empty((len(records.bodies), 3)), np.zeros(len(q))
        count = int(
            _seek(
                records, self._workspace, np.ascontiguousarray(q), within, only, self._contacts, poses, acting
            )
        )
        slots = self._workspace.scratch.slots[:count]
        pairs, points = slots // 2, state.manifolds.points[slots]
        return Touches(
            pairs=self._of_pair[pairs], features=pairs * FEATURES + state.manifolds.features[slots],
            gaps=points[:, GAP].copy(), points=points[:, POINT_X:], normals=points[:, NORMAL_X:POINT_X],
            rows=rows_of(terms, count),
            friction=terms.friction[:count].copy(), least=state.manifolds.gaps.copy(), poses=poses,
            loads=acting, supports=Surfaces(terms.limited[self._rubbed], terms.limit[self._rubbed]),
            faces=np.arange(count), beside=_NONE,
        )  # fmt: skip

    def is_clear(self, a: Reals, b: Reals, length: float, least: float, pairs: Ints) -> bool:
        enough = least * (1.0 - ROUNDED)
        return way_is_clear(self._records, self._workspace, (a, b), length, least, enough, pairs)

    def loads(self, q: Reals) -> Reals:
        records, state, terms = self._records, self._workspace.state, self._workspace.terms
        state.q[:] = q
        place(records, state.q, state.placed, False)
        loads(records, state.placed.pose, state.q, state.v, state.start, 0.0, 0.0, 1.0, self._passive, terms)
        return self._passive.copy()

    def poses(self, q: Reals) -> Reals:
        records, state = self._records, self._workspace.state
        state.q[:] = q
        place(records, state.q, state.placed, False)
        x, y, c, s = state.placed.pose.T
        return np.stack([x, y, np.arctan2(s, c)], axis=-1)

    def centres(self, q: Reals) -> Reals:
        return self.poses(q)[:, :2]

    def outline(self, body: int) -> Outline:
        if body not in self._outlines:
            self._outlines[body] = boundary(self._records, body)
        return self._outlines[body]
