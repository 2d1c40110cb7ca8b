"""What touches what in a scene in space, and the forces that act there (see
`world.carriers.Surroundings`)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.laws import touching_pairs
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.system.spatial.drives import BALL, FREE
from rungwise.system.spatial.features import Seen, dense
from rungwise.world.carriers import ROUNDED, Beside, Near, Outline, Surfaces, Touches
from rungwise.world.spatial.around.distances import Distances
from rungwise.world.spatial.around.surface import surface

CELLS = 1.0 / 3.0
"""A contact keeps its number while it is in the same cell of a geom: beyond this part of its half width on
either side, or between, along each axis."""
ALONG, MOST = 1e-3, 4
"""How far normals may differ of contacts of one pair of bodies of which only those are kept between which the
others lie, nearly; and how many these are."""
TIED = 1e-3
"""Part of the greatest distance by which others may be less and count as equal, as those of symmetric bodies
are: of these the one of the least number is taken, the same wherever the bodies are."""

WITHIN = 0.01
"""How deep within a body, in parts of the radius of its largest geom, rays begin that look for what is next
to its surface: it may overlap that a little."""


class SpatialSurroundings:
    """See `Surroundings`. Servos are known by the joints that they lead (`Driven`), so that `stiffness` is 0
    here."""

    dimension = 3

    def __init__(self, scene: SpaceScene, parameters: Mapping[str, float]) -> None:
        import mujoco

        self._mujoco = mujoco
        _, self._space = Prepared.of(scene, scene.parameters(parameters))
        m = self._model = self._space.model
        self._data = mujoco.MjData(m)
        self._bodies = len(scene.template.bodies)
        self.stiffness, self.limit = np.zeros(m.nv), np.full(m.nv, math.inf)
        self.owners = m.dof_bodyid.astype(np.int64)
        self.placed = np.zeros(m.nq, np.int64)
        for j in range(m.njnt):
            width = {FREE: 7, BALL: 4}.get(int(m.jnt_type[j]), 1)
            self.placed[m.jnt_qposadr[j] : m.jnt_qposadr[j] + width] = m.jnt_bodyid[j]
        names = list(scene.template.bodies)
        pairs = [(names.index(a), names.index(b)) for a, b in scene.template.contacts]
        self._ids = np.full((self._bodies, self._bodies), -1)
        self._signs = np.ones((self._bodies, self._bodies))
        for k, (a, b) in enumerate(pairs):
            self._ids[a, b] = self._ids[b, a] = k
            self._signs[b, a] = -1.0
        self._first = [a for a, _ in pairs]
        self._geoms: list[list[tuple[int, int]]] = [[] for _ in pairs]
        for g, h in touching_pairs(m).tolist():
            pair = int(self._ids[m.geom_bodyid[g], m.geom_bodyid[h]])
            if pair >= 0:
                self._geoms[pair].append((g, h))
        self.tangents = 3 if self._has_torsion() else 2
        self._far = 10.0 * float(m.stat.extent)
        self._distances = Distances(m, self._geoms, self._far)
        self._outlines: dict[int, Outline] = {}

    def _has_torsion(self) -> bool:
        """Whether some contact resists turns about its normal."""
        m = self._model
        dims = [int(max(m.geom_condim[g], m.geom_condim[h])) for own in self._geoms for g, h in own]
        return max([*dims, *m.pair_dim.tolist()], default=0) > 3

    def moved_by(self, columns: Ints) -> Ints:
        m, moves = self._model, np.zeros(self._model.nbody, bool)
        moves[self.owners[columns]] = True
        for body in range(1, m.nbody):
            moves[body] |= moves[m.body_parentid[body]]
        return np.flatnonzero(moves)

    def touches(self, q: Reals, within: float) -> Touches:
        space, m = self._space, self._model
        if space.margin < within or space.margin > 4.0 * within:
            space.look_within(2.0 * within)
        seen, d = space.seen(q), space.data
        least, gaps, bodies = np.full(len(self._first), space.margin), seen.dist, m.geom_bodyid[seen.geom]
        ids, signs = self._ids[bodies[:, 0], bodies[:, 1]], self._signs[bodies[:, 0], bodies[:, 1]]
        known = (ids >= 0) & (seen.address >= 0)
        np.minimum.at(least, ids[known], gaps[known])
        kept = np.flatnonzero(known & (gaps < within))
        rows = np.array([dense(seen, c, 1 + self.tangents, m.nv) for c in kept.tolist()])
        rows = rows.reshape(-1, 1 + self.tangents, m.nv)
        frictions, twists = self._frictions(seen, kept)
        rows[:, 3:] *= twists[:, None, None]
        normals = -signs[kept][:, None] * seen.frame[kept, :3]
        points, owners = seen.pos[kept], ids[kept]
        features = self._features(seen, kept)
        some, left, of = _spread(owners, points, normals, features)
        return Touches(
            pairs=owners[some], features=features[some], gaps=gaps[kept[some]].copy(),
            points=points[some].copy(), normals=normals[some], rows=rows[some],
            friction=frictions[some], least=least,
            poses=np.hstack([d.xpos, d.xquat]), loads=self._loads(d),
            supports=Surfaces(np.zeros((0, m.nv)), np.zeros(0)), faces=of[: len(some)],
            beside=Beside(of[len(some) :], gaps[kept[left]].copy(), rows[left], frictions[left]),
        )  # fmt: skip

    def _features(self, seen: Seen, contacts: Ints) -> Ints:
        """Numbers (k,) of contacts: of their two geoms, and of the cell of one of them in which they are."""
        d, m = self._space.data, self._model
        g, h = seen.geom[contacts].T
        own = np.where(m.body_weldid[m.geom_bodyid[g]] == 0, h, g)
        half = np.where(m.geom_aabb[own, 3:] > 0.0, m.geom_aabb[own, 3:], 1.0)
        way = (seen.pos[contacts] - d.geom_xpos[own])[:, None]
        at = ((way @ d.geom_xmat[own].reshape(-1, 3, 3))[:, 0] - m.geom_aabb[own, :3]) / half
        cell = (at > CELLS).astype(np.int64) - (at < -CELLS)
        return np.asarray((g * m.ngeom + h) * 27 + (cell + 1) @ np.array([1, 3, 9]))

    def _frictions(self, seen: Seen, contacts: Ints) -> tuple[Reals, Reals]:
        """Sliding friction of contacts (k,), of their laws, else the model's, the least where it differs by
        direction; and torsional over sliding friction, as lengths (k,)."""
        laws, geoms, model = self._space.laws, seen.geom[contacts], seen.friction[contacts]
        own = laws.rows[laws.law[geoms[:, 0], geoms[:, 1]]]
        slides = np.where(np.isnan(own[:, 5]), model[:, :2].min(axis=1), own[:, 5])
        slides = np.where(seen.dim[contacts] < 3, 0.0, slides)
        twists = np.where(
            np.isnan(own[:, 6]), model[:, 2] / _some(model[:, :2].min(axis=1)), own[:, 6] / _some(slides)
        )
        return slides, np.where(slides > 0.0, twists, 0.0)

    def near(self, q: Reals, pair: int) -> Near:
        m, d = self._model, self._placed(q)
        gap, ends, geoms = self._distances.nearest(d, pair)
        if m.geom_bodyid[geoms[0]] != self._first[pair]:
            geoms, ends = geoms[::-1], ends[[3, 4, 5, 0, 1, 2]]
        normal = ends[:3] - ends[3:]
        length = float(np.linalg.norm(normal))
        if length < 1e-9 * self._far:
            normal, length = d.geom_xpos[geoms[0]] - d.geom_xpos[geoms[1]], 1.0
            gap = max(gap, 0.0)
        normal = normal * (1.0 if gap >= 0.0 else -1.0) / float(np.linalg.norm(normal))
        both = [self._slope(d, end, int(m.geom_bodyid[g])) for end, g in zip(
            (ends[:3], ends[3:]), geoms, strict=True
        )]  # fmt: skip
        beside = np.array(across(normal))
        rows = np.vstack([normal, beside]) @ (both[0] - both[1])
        own, sides = self._space.laws.rows[self._space.laws.law[geoms[0], geoms[1]]], list(geoms)
        slides, turns = m.geom_friction[sides, :2].max(axis=0).tolist()
        friction = slides if math.isnan(own[5]) else float(own[5])
        twist = 0.0 if m.geom_condim[sides].max() < 4 or not friction > 0.0 else turns / slides
        if twist and not math.isnan(own[6]):
            twist = float(own[6]) / friction
        return Near(float(gap), ends[:3].copy(), normal, beside, rows, friction, twist)

    def _slope(self, d: object, point: Reals, body: int) -> Reals:
        """How velocities move a point (3,) of a body (3, n_v)."""
        found = np.zeros((3, self._model.nv))
        self._mujoco.mj_jac(self._model, d, found, None, point, body)
        return found

    def least(self, q: Reals, pairs: Ints, within: float = math.inf) -> Reals:
        return self._distances.least(self._placed(q), pairs, within)

    def is_clear(self, a: Reals, b: Reals, length: float, least: float, pairs: Ints) -> bool:
        change, left = self.change(a, b), [(0.0, 1.0, self._nearest(a, pairs), self._nearest(b, pairs))]
        while left:
            begin, end, near, far = left.pop()
            if min(near, far) < least * (1.0 - ROUNDED):
                return False
            part = length * (end - begin)
            if near + far - part >= 2.0 * least or part <= least:
                continue
            middle = 0.5 * (begin + end)
            gap = self._nearest(self.changed(a, middle * change), pairs)
            left += [(begin, middle, near, gap), (middle, end, gap, far)]
        return True

    def _nearest(self, q: Reals, pairs: Ints) -> float:
        return float(self.least(q, pairs).min(initial=math.inf))

    def rows(self, q: Reals, body: int, points: Reals, normals: Reals) -> Reals:
        d = self._placed(q)
        arms, slope, turning = points @ d.xmat[body].reshape(3, 3).T, *np.zeros((2, 3, self._model.nv))
        self._mujoco.mj_jac(self._model, d, slope, turning, d.xpos[body], body)
        crossed = np.zeros((len(points), 3, 3))
        for i, j, k, sign in ((0, 1, 2, -1.0), (1, 2, 0, -1.0), (2, 0, 1, -1.0)):
            crossed[:, i, j], crossed[:, j, i] = sign * arms[:, k], -sign * arms[:, k]
        ways = np.array([(normal, *across(normal)) for normal in normals])
        found = ways @ (slope - crossed @ turning)
        if self.tangents == 2:
            return np.asarray(found)
        return np.concatenate([found, (normals @ turning)[:, None]], axis=1)

    def room(self, q: Reals, body: int, points: Reals, normals: Reals, pairs: Ints) -> Reals:
        m, d, found = self._model, self._placed(q), np.full(len(points), math.inf)
        deep = WITHIN * float(m.geom_rbound[m.geom_bodyid == body].max())
        hit, among = np.zeros(1, np.int32), set(pairs.tolist())
        begins = d.xpos[body] + points @ d.xmat[body].reshape(3, 3).T - deep * normals
        for k, (begin, way) in enumerate(zip(begins, normals, strict=True)):
            far = self._mujoco.mj_ray(m, d, begin, way, None, True, body, hit)
            if hit[0] >= 0 and int(self._ids[body, m.geom_bodyid[hit[0]]]) in among:
                found[k] = far - deep
        return found

    def changed(self, q: Reals, change: Reals) -> Reals:
        found = q.copy()
        self._mujoco.mj_integratePos(self._model, found, np.ascontiguousarray(change), 1.0)
        return found

    def change(self, q: Reals, to: Reals) -> Reals:
        found = np.zeros(self._model.nv)
        self._mujoco.mj_differentiatePos(self._model, found, 1.0, q, to)
        return found

    def loads(self, q: Reals) -> Reals:
        return self._loads(self._placed(q))

    def poses(self, q: Reals) -> Reals:
        d = self._placed(q)
        return np.hstack([d.xpos, d.xquat])

    def centres(self, q: Reals) -> Reals:
        return np.array(self._placed(q).xipos)

    def outline(self, body: int) -> Outline:
        if body not in self._outlines:
            self._outlines[body] = surface(self._model, body)
        return self._outlines[body]

    def _placed(self, q: Reals):  # type: ignore[no-untyped-def]
        """MuJoCo's data at a place (n_q,)."""
        d = self._data
        if not np.array_equal(d.qpos, q) or not d.xpos.any():
            d.qpos[:] = q
            self._mujoco.mj_kinematics(self._model, d)
            self._mujoco.mj_comPos(self._model, d)
        return d

    def _loads(self, d) -> Reals:  # type: ignore[no-untyped-def]
        """Weight, springs, and what carries weight (n_v,), at the data's places."""
        found = np.zeros(self._model.nv)
        d.qvel[:] = 0.0
        self._mujoco.mj_comVel(self._model, d)
        self._mujoco.mj_rne(self._model, d, 0, found)
        self._mujoco.mj_passive(self._model, d)
        return np.asarray(d.qfrc_spring + d.qfrc_gravcomp - found)


def across(normal: Reals) -> tuple[Reals, Reals]:
    """Two directions (3,) across a normal (3,) and each other."""
    x, y, z = normal.tolist()
    if abs(x) <= min(abs(y), abs(z)):
        one = 0.0, z, -y
    elif abs(y) <= abs(z):
        one = -z, 0.0, x
    else:
        one = y, -x, 0.0
    length = math.sqrt(one[0] ** 2 + one[1] ** 2 + one[2] ** 2)
    a, b, c = one[0] / length, one[1] / length, one[2] / length
    return np.array([a, b, c]), np.array([y * c - z * b, z * a - x * c, x * b - y * a])


def _spread(pairs: Ints, points: Reals, normals: Reals, features: Ints) -> tuple[Ints, Ints, Ints]:
    """Of contacts (k,), at most so many of one pair of bodies with the same normal: two far apart, and on
    either side the one farthest from the line through both, so that what they support stands as on all, the
    same at each place of the bodies; those that are left out; and of the former, then of these, the first
    with the same normal."""
    kept, left, faces = list[int](), np.ones(len(pairs), bool), np.zeros(len(pairs), np.int64)
    while left.any():
        first = int(left.argmax())
        same = np.abs(normals - normals[first]).max(axis=1) < ALONG
        alike = np.flatnonzero(left & (pairs == pairs[first]) & same)
        left[alike], faces[alike] = False, first
        own = alike.tolist()
        if len(own) > MOST:
            own = [own[k] for k in _widest(points[alike], normals[first], features[alike])]
        kept += own
    some = np.array(sorted(kept), np.int64)
    others = np.setdiff1d(np.arange(len(pairs)), some)
    return some, others, faces[np.concatenate([some, others])]


def _widest(points: Reals, normal: Reals, features: Ints) -> list[int]:
    """See `_spread`, of points (k, 3) in a plane."""
    first = _greatest(np.linalg.norm(points - points.mean(axis=0), axis=1), features)
    ways = points - points[first]
    second = _greatest(np.linalg.norm(ways, axis=1), features)
    (a, b, c), (x, y, z) = normal.tolist(), ways[second].tolist()
    aside = ways @ np.array([b * z - c * y, c * x - a * z, a * y - b * x])
    return sorted({first, second, _greatest(aside, features), _greatest(-aside, features)})


def _greatest(values: Reals, features: Ints) -> int:
    """The greatest value (k,); of those that are nearly as great, the one of the least number."""
    tied = np.flatnonzero(values >= values.max() - TIED * np.abs(values).max())
    return int(tied[features[tied].argmin()])


def _some(frictions: Reals) -> Reals:
    """Frictions (k,) with 1 in place of none, to divide by."""
    return np.where(frictions > 0.0, frictions, 1.0)
