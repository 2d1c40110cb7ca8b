"""Distance, normal and contacts of two convex geoms.

The distance along a unit normal is a lower bound, and that of two points of the geoms an upper one: where
both are equal the distance is exact, whatever found it.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.system.spatial.patch.contacts import Contacts
from rungwise.system.spatial.patch.pairs import allocate_found, allocate_scratch, meet
from rungwise.system.spatial.patch.shapes import separation, shapes

Array = NDArray[np.float64]
KINDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
EVERY = list(combinations_with_replacement(KINDS, 2))
NUMBERS = {"sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3}
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class Met(NamedTuple):
    """Contacts of two geoms: places (c, 3), gaps (c,), and the normal (3,) from the first to the second."""

    places: Array
    gaps: Array
    normal: Array


class Pair:
    """Two geoms of which the second moves about."""

    def __init__(self, one: str, other: str, asset: str = "") -> None:
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><asset>{asset}</asset><worldbody><body><freejoint/><geom {one} mass='1'/></body>"
            f"<body><freejoint/><geom {other} mass='1'/></body></worldbody></mujoco>"
        )
        self.data, self.shapes = mujoco.MjData(self.model), shapes(self.model)
        self.geoms = Contacts(self.model, self.data, self.shapes)
        self.size = float(self.shapes.inner[:2].min())
        self._scratch, self._found = allocate_scratch(self.shapes), allocate_found(16)

    def put(self, q: Array) -> None:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        self.geoms.place(self.data)

    def meet(self, a: int = 0, b: int = 1, within: float = 1.0) -> Met:
        found, frames = self._found, self.geoms.frames
        count = meet(a, b, within, self.shapes, frames, self._scratch, found, 0)
        return Met(found.place[:count].copy(), found.gap[:count].copy(), found.normal[0].copy())

    def normals(self, count: int) -> Array:
        """The normals (count, 3) of the contacts found last."""
        return self._found.normal[:count].copy()

    def along(self, n: Array) -> float:
        x, y, z = (n / np.linalg.norm(n)).tolist()
        return separation(0, 1, x, y, z, self.shapes, self.geoms.frames)

    def approach(self, q: Array, gap: float) -> Array:
        """The place (14,) on the line between middles at which the gap is nearly so much."""
        way = q[7:10] / np.linalg.norm(q[7:10])
        for _ in range(60):
            self.put(q)
            off = self.geoms.distance(0, 1)[0] - gap
            if abs(off) < 1e-12:
                break
            q[7:10] -= off * way
        return q


def drawn(kind: str, rng: np.random.Generator, number: int) -> tuple[str, str]:
    """A geom of sizes from 0.03 to 0.4, and its asset."""
    if kind == "mesh":
        points = rng.normal(size=(12, 3))
        points *= 10.0 ** rng.uniform(-1.3, -0.6, 3) / np.linalg.norm(points, axis=1, keepdims=True)
        text = " ".join(f"{x:.6g}" for x in points.ravel())
        return f'type="mesh" mesh="m{number}"', f'<mesh name="m{number}" vertex="{text}"/>'
    sizes = " ".join(f"{x:.6g}" for x in 10.0 ** rng.uniform(-1.5, -0.4, NUMBERS[kind]))
    return f'type="{kind}" size="{sizes}"', ""


def pair(kinds: tuple[str, str], rng: np.random.Generator) -> Pair:
    (one, first), (other, second) = (drawn(kind, rng, k) for k, kind in enumerate(kinds))
    return Pair(one, other, first + second)


def place(pair: Pair, rng: np.random.Generator, gap: float) -> Array:
    """Two geoms so far apart, every second time with axes that are parallel or nearly so."""
    turn, way = rng.normal(size=4), rng.normal(size=3)
    if rng.random() < 0.5:
        turn = UPRIGHT + rng.choice([0.0, 1e-9, 1e-3]) * turn
        way = np.eye(3)[rng.integers(3)] + rng.choice([0.0, 0.3]) * way
    q = np.concatenate([np.zeros(3), UPRIGHT, 4.0 * way / np.linalg.norm(way), turn / np.linalg.norm(turn)])
    return pair.approach(q, gap)


def is_in(pair: Pair, g: int, point: Array, tol: float) -> bool:
    """Whether a point is in a geom, or on its surface."""
    model, data = pair.model, pair.data
    x, y, z = own = data.geom_xmat[g].reshape(3, 3).T @ (point - data.geom_xpos[g])
    size, kind = model.geom_size[g], KINDS[(2, 3, 4, 5, 6, 7).index(int(model.geom_type[g]))]
    if kind == "sphere":
        return bool(np.linalg.norm(own) <= size[0] + tol)
    if kind == "capsule":
        return bool(np.hypot(np.hypot(x, y), max(abs(z) - size[1], 0.0)) <= size[0] + tol)
    if kind == "ellipsoid":
        return bool(np.linalg.norm(own / size) <= 1.0 + tol / size.min())
    if kind == "cylinder":
        return bool(np.hypot(x, y) <= size[0] + tol and abs(z) <= size[1] + tol)
    if kind == "box":
        return bool((np.abs(own) <= size + tol).all())
    s = pair.shapes
    faces = range(s.face_first[g], s.face_end[g])
    heights = [s.normals[f] @ (own - s.corners[s.face_corners[s.face_at[f]]]) for f in faces]
    return max(heights) <= tol + 1e-6 * size.max()  # corners of a face are single precision


@pytest.mark.few(6)
@pytest.mark.parametrize("kinds", EVERY, ids="-".join)
def test_distances_are_those_of_points_of_both_and_of_planes_between_them(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(len("".join(kinds)))
    for _ in range(8):
        own = pair(kinds, rng)
        for gap in 10.0 ** rng.uniform(-9.0, 0.0, 8):
            place(own, rng, gap)
            found, ends = own.geoms.distance(0, 1)
            tol = 1e-9 * own.size
            assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(found, abs=tol)
            assert all(is_in(own, g, ends[g], 1e3 * tol) for g in (0, 1))
            met = own.meet(within=2.0)
            assert own.along(met.normal) == pytest.approx(found, abs=tol)
            assert met.gaps.min() == pytest.approx(found, abs=2.0 * tol)
            assert len(met.gaps) <= 4


@pytest.mark.few(6)
@pytest.mark.parametrize("kinds", EVERY, ids="-".join)
def test_no_other_normal_leads_out_of_a_small_overlap_sooner(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        own = pair(kinds, rng)
        for depth in own.size * 10.0 ** rng.uniform(-8.0, -3.0, 8):
            place(own, rng, -depth)
            met, found = own.meet(), own.geoms.distance(0, 1)[0]
            assert -1.1 * depth < found and met.gaps.min() == pytest.approx(found, abs=1e-8 * own.size)
            for turn in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5):
                others = met.normal + turn * rng.normal(size=(10, 3))
                assert max(map(own.along, others)) < found + 1e-8 * own.size


@pytest.mark.few(4)
@pytest.mark.parametrize("lean", [0.0, 1e-6, 1e-3, 0.02, 0.06])
def test_no_gap_of_cans_on_cans_is_less_than_their_distance(lean: float) -> None:
    """Where tilted rims cross they are ellipses; all places are on both ends, within their rims."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        sizes = 10.0 ** rng.uniform(-1.5, -0.5, (2, 2))
        own = Pair(*(f'type="cylinder" size="{r} {half}"' for r, half in sizes))
        turn, way = UPRIGHT + 0.5 * lean * rng.normal(size=4), rng.normal(size=2)
        off = rng.uniform(0.0, 1.0) * sizes[:, 0].sum() * way / np.linalg.norm(way)
        far = sizes[:, 1].sum() + 0.1 * sizes[:, 0].max()
        q = np.concatenate([np.zeros(3), UPRIGHT, off, [far], turn / np.linalg.norm(turn)])
        own.approach(q, -1e-6 * own.size)
        met, found = own.meet(), own.geoms.distance(0, 1)[0]
        if abs(met.normal[2]) < 0.99:  # side by side
            continue
        assert met.gaps.min() == pytest.approx(found, abs=1e-9 * own.size)
        for place, gap in zip(met.places, met.gaps, strict=True):
            ends = place + 0.5 * gap * np.outer((-1.0, 1.0), met.normal)
            assert all(is_in(own, g, end, 1e-8 * own.size) for g, end in enumerate(ends))


@pytest.mark.parametrize("kinds", EVERY, ids="-".join)
def test_no_other_normal_leads_out_of_a_deep_overlap_much_sooner(kinds: tuple[str, str]) -> None:
    """Of geoms whose middles are together, or as far apart as the smaller one is thick: in either order."""
    rng = np.random.default_rng(7)
    ways = rng.normal(size=(300, 3))
    for _ in range(5):
        own = pair(kinds, rng)
        for part in (0.0, 1e-15, 1e-6, 0.1, 0.5, 1.0):
            turn, way = rng.normal(size=(2, 4)), rng.normal(size=3)
            turn /= np.linalg.norm(turn, axis=1, keepdims=True)
            away = part * own.size * way / np.linalg.norm(way)
            own.put(np.concatenate([np.zeros(3), turn[0], away, turn[rng.integers(2)]]))
            best = max(map(own.along, ways))
            assert own.meet().gaps.min() == pytest.approx(own.geoms.distance(0, 1)[0], abs=1e-7 * own.size)
            assert all(best < 0.9 * own.meet(a, 1 - a).gaps.min() for a in (0, 1))


@pytest.mark.parametrize("kinds", [("capsule", "capsule"), ("capsule", "cylinder"), ("box", "capsule")])
@pytest.mark.parametrize("angle", [1e-4, 1e-3, 0.01, 0.05, 0.09])
def test_gaps_of_sides_that_nearly_lie_along_each_other_change_as_their_normals_say(
    kinds: tuple[str, str], angle: float
) -> None:
    """A gap that changes by what is not along its normal would gain energy."""
    rng = np.random.default_rng(5)
    sizes = {"capsule": ".02 .1", "cylinder": ".03 .08", "box": ".02 .02 .1"}
    own = Pair(*(f'type="{kind}" size="{sizes[kind]}"' for kind in kinds))
    for _ in range(10):
        turn = np.array([np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0])
        q = own.approach(np.concatenate([np.zeros(3), UPRIGHT, [0.2, 0.001, 0.01], turn]), 1e-4)
        before, rate, step = own.meet(), rng.uniform(-1.0, 1.0, 3), 1e-7
        normals = own.normals(len(before.gaps))
        q[7:10] += step * rate
        own.put(q)
        after = own.meet()
        assert len(after.gaps) == len(before.gaps) > 1
        np.testing.assert_allclose((after.gaps - before.gaps) / step, normals @ rate, atol=2e-3)


def matched(one: Array, other: Array) -> float:
    """How far each point of either set (c, 3) is from the nearest of the other one, at most."""
    away = np.linalg.norm(one[:, None] - other, axis=2)
    return float(max(away.min(axis=0).max(), away.min(axis=1).max()))


@pytest.mark.few(6)
@pytest.mark.parametrize("kinds", EVERY, ids="-".join)
def test_contacts_do_not_depend_on_the_order_of_geoms_or_the_frame(kinds: tuple[str, str]) -> None:
    rng, turn, both = np.random.default_rng(2), np.zeros(4), np.zeros(4)
    for _ in range(6):
        own = pair(kinds, rng)
        for gap in own.size * np.array([1e-3, 1e-7, 0.0, -1e-7, -1e-4]):
            q = place(own, rng, gap)
            met, swapped = own.meet(), own.meet(1, 0)
            np.testing.assert_allclose(swapped.normal, -met.normal, atol=1e-7)
            assert swapped.gaps.min() == pytest.approx(met.gaps.min(), abs=1e-9 * own.size)
            turn[:] = rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            moved, matrix = q.copy(), np.zeros(9)
            mujoco.mju_quat2Mat(matrix, turn)
            for at in (0, 7):
                moved[at : at + 3] = matrix.reshape(3, 3) @ q[at : at + 3] + [0.3, -0.2, 0.1]
                mujoco.mju_mulQuat(both, turn, q[at + 3 : at + 7])
                moved[at + 3 : at + 7] = both
            own.put(moved)
            turned = own.meet()
            np.testing.assert_allclose(turned.normal, matrix.reshape(3, 3) @ met.normal, atol=1e-6)
            assert turned.gaps.min() == pytest.approx(met.gaps.min(), abs=1e-9 * own.size)


@pytest.mark.few(6)
@pytest.mark.parametrize("kinds", EVERY, ids="-".join)
def test_a_small_motion_changes_gaps_by_as_little(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(3)
    for _ in range(8):
        own = pair(kinds, rng)
        for gap in own.size * np.array([1e-2, 1e-5, 0.0, -1e-5]):
            q = place(own, rng, gap)
            before, way = own.meet(), 1e-8 * own.size
            q[7:10] += way * rng.uniform(-1.0, 1.0, 3)
            own.put(q)
            assert abs(own.meet().gaps.min() - before.gaps.min()) < 2.0 * way


BOX, PLATE = 'type="box" size=".1 .1 .1"', 'type="box" size=".3 .3 .1"'
PATCHES = {
    "box on plate": (BOX, PLATE, UPRIGHT, 0.2, [[x, y] for x in (-0.1, 0.1) for y in (-0.1, 0.1)]),
    "box over an edge": (BOX, 'type="box" size=".02 .3 .1"', UPRIGHT, 0.2,
                         [[x, y] for x in (-0.02, 0.02) for y in (-0.1, 0.1)]),
    "capsule that overhangs": (BOX, 'type="capsule" size=".02 .4"', [1.0, 1.0, 0.0, 0.0], 0.12,
                               [[0.0, -0.1], [0.0, 0.1]]),
    "cylinder that overhangs": (BOX, 'type="cylinder" size=".02 .4"', [1.0, 1.0, 0.0, 0.0], 0.12,
                                [[0.0, -0.1], [0.0, 0.1]]),
    "can on plate": (PLATE, 'type="cylinder" size=".05 .1"', UPRIGHT, 0.2,
                     [[0.05, 0.0], [-0.05, 0.0], [0.0, 0.05], [0.0, -0.05]]),
    "can over a bar": ('type="box" size=".03 .3 .1"', 'type="cylinder" size=".05 .1"', UPRIGHT,
                       0.2, [[0.0, 0.05], [0.0, -0.05], [0.03, -0.04], [-0.03, 0.04]]),
    "logs across": ('type="capsule" size=".05 .2"', 'type="capsule" size=".02 .2"', [1.0, 1.0, 0.0, 0.0],
                    0.27, [[0.0, 0.0]]),
    "egg on plate": (PLATE, 'type="ellipsoid" size=".03 .05 .02"', UPRIGHT, 0.12, [[0.0, 0.0]]),
}  # fmt: skip


@pytest.mark.parametrize("depth", [0.0, 1e-9, 1e-5])
@pytest.mark.parametrize("name", PATCHES)
def test_contacts_are_the_corners_of_what_features_share(name: str, depth: float) -> None:
    one, other, turn, height, corners = PATCHES[name]
    own = Pair(one, other)
    own.put(
        np.concatenate(
            [np.zeros(3), UPRIGHT, [0.0, 0.0, height - depth], np.array(turn) / np.linalg.norm(turn)]
        )
    )
    met = own.meet()
    np.testing.assert_allclose(np.abs(met.normal), [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(met.gaps, -depth, atol=1e-15)
    assert len(met.places) == len(corners) and matched(met.places[:, :2], np.array(corners)) < 1e-12


@pytest.mark.few(3)
@pytest.mark.parametrize("power", range(-17, -1))
def test_a_cylinder_that_stands_on_a_plane_has_the_depth_of_its_rim(power: int) -> None:
    rng = np.random.default_rng(power + 20)
    for _ in range(20):
        radius, depth = 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(-4, -2)
        half, lean = radius * 10.0 ** rng.uniform(-3, 0.5), rng.normal(size=4)
        lean /= np.linalg.norm(lean)
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><geom type="plane" size="1 1 1" quat="{" ".join(map(str, lean))}"/>'
            f'<body><freejoint/><geom type="cylinder" size="{radius} {half}"/></body></worldbody></mujoco>'
        )
        data, turned = mujoco.MjData(model), np.zeros(4)
        tilt = np.append(1.0, rng.normal(size=3) * 10.0**power)
        mujoco.mju_mulQuat(turned, lean, tilt / np.linalg.norm(tilt))
        mujoco.mj_kinematics(model, data)
        normal = data.geom_xmat[0].reshape(3, 3)[:, 2]
        data.qpos[:3], data.qpos[3:] = (half - depth * half) * normal, turned
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        axis = data.geom_xmat[1].reshape(3, 3)[:, 2]
        sine = np.linalg.norm(np.cross(axis, normal))
        rim = half - depth * half - half * abs(axis @ normal) - radius * sine
        seen = Contacts(model, data, shapes(model)).within(1e-3 * radius)
        assert seen.dist.min() == pytest.approx(rim, abs=1e-9 * radius)


def test_rows_are_those_of_mujoco() -> None:
    """Of arms, balls and free bodies, with contacts of 1, 3, 4 and 6 directions, and friction by priority."""
    rng = np.random.default_rng(0)
    bodies = "".join(
        f'<body pos="{0.06 * k} 0 .049"><freejoint/><geom size=".05" condim="{dim}" priority="{k % 2}"'
        f' friction="{0.3 + 0.1 * k} .01 .002"/></body>'
        for k, dim in enumerate((1, 3, 4, 6))
    )
    arm = (
        '<body pos="-.2 0 .2"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .1 0 -.1" size=".02"/>'
        '<body pos=".1 0 -.1"><joint type="ball"/><geom size=".051" condim="4"/></body></body>'
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option jacobian="sparse" cone="elliptic"/><worldbody><geom type="plane" size="1 1 1"/>'
        f"{bodies}{arm}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    for _ in range(20):
        mujoco.mj_integratePos(model, data.qpos, 0.02 * rng.normal(size=model.nv), 1.0)
        model.geom_margin[:] = 0.01
        mujoco.mj_fwdPosition(model, data)
        seen = Contacts(model, data, shapes(model)).within(0.01)
        theirs = {tuple(c.geom.tolist()): c for c in data.contact if c.dist < 0.01 and c.efc_address >= 0}
        assert set(theirs) == {tuple(each) for each in seen.geom.tolist()}
        for c, each in enumerate(seen.geom.tolist()):
            known = theirs[tuple(each)]
            np.testing.assert_allclose(seen.frame[c], np.ravel(known.frame), atol=1e-9)
            np.testing.assert_allclose(seen.friction[c], known.friction)
            assert seen.dim[c] == known.dim and seen.dist[c] == pytest.approx(known.dist, abs=1e-12)
            for i in range(known.dim):
                row, first = np.zeros(model.nv), int(seen.first[seen.address[c] + i])
                width = int(seen.entries[seen.address[c] + i])
                row[seen.column[first : first + width]] = seen.J[first : first + width]
                wanted, at = np.zeros(model.nv), known.efc_address + i
                begin, count = int(data.efc_J_rowadr[at]), int(data.efc_J_rownnz[at])
                wanted[data.efc_J_colind[begin : begin + count]] = data.efc_J[begin : begin + count]
                np.testing.assert_allclose(row, wanted, atol=1e-9)
