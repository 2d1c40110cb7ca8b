"""Geoms of a model as convex shapes, and their support functions.

A shape is a core and a ball of radius `round` around each of its points: of spheres the core is a point, of
capsules a segment, and of all others the shape itself. Cores consist of *pieces*: corners, ends of a capsule,
the two rims of a cylinder, or the whole surface of an ellipsoid. In any direction the support function of a
core is the greatest of those of its pieces, each of which is smooth.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.scene.scene import InvalidScene
from rungwise.scene.space.laws import touching

if TYPE_CHECKING:
    import mujoco

PLANE, FIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
"""MuJoCo's numbers of types of geoms."""
Point = tuple[float, float, float]
Support = tuple[float, float, float, int]
"""A point of a core and the number of its piece."""


class Shapes(Block):
    """Geoms as convex shapes, and after them a prism whose corners change (see `fields`).

    kind, body (g,); size (g, 3); round (g,); inner (g,): half of the least width, inf for planes; width (g,)
    in their thinnest direction, inf for planes; of polytopes corners (k, 3), of each geom from `first` to
    `end` (g,); faces, of each geom from face_first to face_end (g,), with normals (f, 3), and the corners
    face_corners (c,) of each, anticlockwise, from face_at[f] to face_at[f + 1]; edges (e, 2), of each geom
    from edge_first to edge_end (g,).
    """

    kind: Ints
    body: Ints
    size: Reals
    round: Reals
    inner: Reals
    width: Reals
    corners: Reals
    first: Ints
    end: Ints
    normals: Reals
    face_first: Ints
    face_end: Ints
    face_at: Ints
    face_corners: Ints
    edges: Ints
    edge_first: Ints
    edge_end: Ints


class Frames(Block):
    """Places (g, 3) and axes (g, 9) of geoms."""

    place: Reals
    axes: Reals


class Polytope(NamedTuple):
    """Corners (k, 3), normals of faces (f, 3), and the corners of each face, anticlockwise."""

    corners: Reals
    normals: Reals
    faces: list[list[int]]


LEVEL = 1e-6
"""Part of a mesh's size by which corners of one face may be out of its plane: a few roundings of single
precision, in which MuJoCo keeps meshes."""
PRISM = Polytope(
    np.array([[x, y, z] for z in (-1.0, 0.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]),
    np.array(
        [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [math.sqrt(0.5)] * 2 + [0.0], [-1.0, 0.0, 0.0]]
    ),
    [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
)
"""A column under a triangle of a height field; the triangle is its second face."""
BOX_FACES = [[4, 6, 7, 5], [0, 1, 3, 2], [2, 3, 7, 6], [0, 4, 5, 1], [1, 5, 7, 3], [0, 2, 6, 4]]
"""Faces of a box at +x, -x, +y, ...; the corner of number 4 i + 2 j + k is at the ends i, j, k of x, y, z."""


def shapes(model: mujoco.MjModel) -> Shapes:
    """The geoms of a model; MuJoCo takes meshes for their convex hulls."""
    m = model
    for g in np.flatnonzero(touching(m) & (m.geom_type > MESH)).tolist():
        raise InvalidScene(f"geom {m.geom(g).name or g}: signed distance fields are not known; take a mesh")
    every = [_polytope(m, g) for g in range(m.ngeom)] + [PRISM]
    spans = np.zeros((3, len(every) + 1), np.int64)
    corners, normals, lists, edges = [np.zeros((0, 3))], [np.zeros((0, 3))], list[list[int]](), list[Ints]()
    for g, own in enumerate(every):
        begin = int(spans[0, g])
        sides = {tuple(sorted((f[i - 1], f[i]))) for f in own.faces for i in range(len(f))}
        corners.append(own.corners)
        normals.append(own.normals)
        lists += [[begin + k for k in face] for face in own.faces]
        edges.append(np.array(sorted(sides), np.int64).reshape(-1, 2) + begin)
        spans[:, g + 1] = spans[:, g] + (len(own.corners), len(own.faces), len(sides))
    kinds, sizes = np.append(m.geom_type, MESH).astype(np.int64), np.vstack([m.geom_size, np.zeros((1, 3))])
    widths = np.array([_width(int(kinds[g]), sizes[g], every[g].corners) for g in range(m.ngeom + 1)])
    return Shapes(
        kind=kinds, body=np.append(m.geom_bodyid, 0).astype(np.int64), size=sizes,
        round=np.where(np.isin(kinds, (SPHERE, CAPSULE)), sizes[:, 0], 0.0), inner=0.5 * widths,
        width=widths, corners=np.concatenate(corners), first=spans[0, :-1].copy(), end=spans[0, 1:].copy(),
        normals=np.concatenate(normals), face_first=spans[1, :-1].copy(), face_end=spans[1, 1:].copy(),
        face_at=np.cumsum([0] + [len(face) for face in lists]).astype(np.int64),
        face_corners=np.array([k for face in lists for k in face], np.int64),
        edges=np.concatenate(edges), edge_first=spans[2, :-1].copy(), edge_end=spans[2, 1:].copy(),
    )  # fmt: skip


def _polytope(model: mujoco.MjModel, g: int) -> Polytope:
    """A geom as a polytope; without corners if it is none."""
    m, kind = model, int(model.geom_type[g])
    if kind == BOX:
        ends = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        normals = np.kron(np.eye(3), np.array([[1.0], [-1.0]]))
        return Polytope(ends * m.geom_size[g], normals, BOX_FACES)
    if kind != MESH:
        return Polytope(np.zeros((0, 3)), np.zeros((0, 3)), [])
    mesh = int(m.geom_dataid[g])
    begin, graph = int(m.mesh_vertadr[mesh]), int(m.mesh_graphadr[mesh])
    if graph < 0:  # of what only shows MuJoCo makes no hull
        every = np.array(m.mesh_vert[begin : begin + int(m.mesh_vertnum[mesh])], float)
        return Polytope(every, np.zeros((0, 3)), [])
    count, triangles = m.mesh_graph[graph : graph + 2].tolist()
    hull = m.mesh_graph[graph + 2 + count : graph + 2 + 2 * count].astype(np.int64)
    faces = m.mesh_graph[graph + 2 + 3 * count + 3 * triangles :][: 3 * triangles].reshape(-1, 3)
    number = np.zeros(int(m.mesh_vertnum[mesh]), np.int64)
    number[hull] = np.arange(count)
    return _joined(np.array(m.mesh_vert[begin + hull], float), number[faces])


def _joined(corners: Reals, triangles: Ints) -> Polytope:
    """A convex polytope, of whose triangles (t, 3) those in one plane are one face."""
    middle = corners.mean(axis=0)
    ways = corners[triangles] - middle
    inward = (np.cross(ways[:, 1] - ways[:, 0], ways[:, 2] - ways[:, 0]) * ways[:, 0]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    areas = np.cross(ways[:, 1] - ways[:, 0], ways[:, 2] - ways[:, 0])
    left, faces = set(range(len(triangles))), list[list[int]]()
    beside = {(int(t[i - 1]), int(t[i])): k for k, t in enumerate(triangles) for i in range(3)}
    for seed in np.argsort(-np.linalg.norm(areas, axis=1), kind="stable").tolist():
        if seed not in left:
            continue
        n = areas[seed] / max(float(np.linalg.norm(areas[seed])), 1e-300)
        off = np.abs((corners - corners[triangles[seed, 0]]) @ n) < LEVEL * np.ptp(corners)
        left.discard(seed)
        outline, todo = set[tuple[int, int]](), [seed]
        while todo:
            own = triangles[todo.pop()].tolist()
            for a, b in ((own[i - 1], own[i]) for i in range(3)):
                other = beside.get((b, a), seed)
                if other in left and off[triangles[other]].all():
                    left.discard(other)
                    todo.append(other)
                if (b, a) in outline:
                    outline.discard((b, a))
                else:
                    outline.add((a, b))
        after = dict(outline)
        face = [min(after)]
        for _ in range(len(after) - 1):
            face.append(after[face[-1]])
        faces.append(face)
    return Polytope(corners, np.array([_normal(corners[face]) for face in faces]), faces)


def _normal(corners: Reals) -> Reals:
    """The unit normal (3,) of a polygon (k, 3), by the sum of its triangles."""
    ways = corners - corners[0]
    whole = np.cross(ways[1:-1], ways[2:]).sum(axis=0)
    return np.asarray(whole / np.linalg.norm(whole))


def _width(kind: int, size: Reals, corners: Reals) -> float:
    """Width of a geom in its thinnest direction; of meshes the least along the axes of a geom, which are
    those of its inertia, and 0 for a height field, whose surface has no inside."""
    if kind == MESH:
        return float(np.ptp(corners, axis=0).min())
    if kind == PLANE:
        return math.inf
    if kind == FIELD:
        return 0.0
    radii = {SPHERE: size[:1], CAPSULE: size[:1], CYLINDER: size[:2]}.get(kind, size)
    return 2.0 * float(radii.min())


def thinnest(model: mujoco.MjModel, made: Shapes) -> float:
    """The least sum of widths of a geom that moves and another that may touch something."""
    touches = np.flatnonzero(touching(model))
    moves = [g for g in touches if model.body_weldid[model.geom_bodyid[g]] != 0]
    sums = [made.width[a] + made.width[touches[touches != a]].min(initial=math.inf) for a in moves]
    return float(min(sums, default=math.inf))


@kernel
def support(g: int, x: float, y: float, z: float, shapes: Shapes, frames: Frames) -> Support:
    """The farthest point of a geom's core in a direction, and its piece."""
    u = frames.axes[g]
    p = u[0] * x + u[3] * y + u[6] * z
    q = u[1] * x + u[4] * y + u[7] * z
    r = u[2] * x + u[5] * y + u[8] * z
    kind = shapes.kind[g]
    piece = 0
    if kind in (CAPSULE, CYLINDER):
        piece = 1 if r >= 0.0 else 0
    elif kind == BOX:
        piece = 4 * (p >= 0.0) + 2 * (q >= 0.0) + (r >= 0.0)
    elif kind == MESH:
        best, corners = -math.inf, shapes.corners
        for k in range(shapes.first[g], shapes.end[g]):
            along = corners[k, 0] * p + corners[k, 1] * q + corners[k, 2] * r
            if along > best:
                best, piece = along, k - shapes.first[g]
    a, b, c = _local(g, piece, p, q, r, shapes)
    place = frames.place[g]
    return (
        u[0] * a + u[1] * b + u[2] * c + place[0],
        u[3] * a + u[4] * b + u[5] * c + place[1],
        u[6] * a + u[7] * b + u[8] * c + place[2],
        piece,
    )


@kernel
def _local(g: int, piece: int, p: float, q: float, r: float, shapes: Shapes) -> Point:
    """The farthest point of a piece in a direction, both in the geom's frame."""
    kind, size = shapes.kind[g], shapes.size[g]
    if kind == CAPSULE:
        return 0.0, 0.0, size[1] if piece else -size[1]
    if kind == CYLINDER:
        across = math.sqrt(p * p + q * q)
        part = size[0] / across if across > 0.0 else 0.0
        return part * p, part * q, size[1] if piece else -size[1]
    if kind == ELLIPSOID:
        i, j, k = size[0] * p, size[1] * q, size[2] * r
        length = math.sqrt(i * i + j * j + k * k)
        part = 1.0 / length if length > 0.0 else 0.0
        return part * size[0] * i, part * size[1] * j, part * size[2] * k
    if kind in (BOX, MESH):
        corner = shapes.corners[shapes.first[g] + piece]
        return corner[0], corner[1], corner[2]
    return 0.0, 0.0, 0.0


@kernel
def point_of(g: int, piece: int, x: float, y: float, z: float, shapes: Shapes, frames: Frames) -> Point:
    """The farthest point of a piece of a geom's core in a direction."""
    u, place = frames.axes[g], frames.place[g]
    p = u[0] * x + u[3] * y + u[6] * z
    q = u[1] * x + u[4] * y + u[7] * z
    r = u[2] * x + u[5] * y + u[8] * z
    a, b, c = _local(g, piece, p, q, r, shapes)
    return (
        u[0] * a + u[1] * b + u[2] * c + place[0],
        u[3] * a + u[4] * b + u[5] * c + place[1],
        u[6] * a + u[7] * b + u[8] * c + place[2],
    )


@kernel
def bend_of(
    g: int, x: float, y: float, z: float, e: Reals, f: Reals, shapes: Shapes, frames: Frames
) -> Point:
    """How fast the farthest point of a curved core moves along e and f (3,) as the direction (a unit vector)
    turns towards them: the entries ee, ef, ff of the second derivative of the support function; 0 for
    corners."""
    kind = shapes.kind[g]
    if kind not in (CYLINDER, ELLIPSOID):
        return 0.0, 0.0, 0.0
    u, size = frames.axes[g], shapes.size[g]
    p, q, r = _turned(u, x, y, z)
    e0, e1, e2 = _turned(u, e[0], e[1], e[2])
    f0, f1, f2 = _turned(u, f[0], f[1], f[2])
    if kind == CYLINDER:
        across = math.sqrt(p * p + q * q)
        if across == 0.0:
            return 0.0, 0.0, 0.0
        one, other = (p * e1 - q * e0) / across, (p * f1 - q * f0) / across
        part = size[0] / across
        return part * one * one, part * one * other, part * other * other
    i, j, k = size[0] * p, size[1] * q, size[2] * r
    length = math.sqrt(i * i + j * j + k * k)
    i, j, k = i / length, j / length, k / length
    e0, e1, e2 = e0 * size[0], e1 * size[1], e2 * size[2]
    f0, f1, f2 = f0 * size[0], f1 * size[1], f2 * size[2]
    along, beside = i * e0 + j * e1 + k * e2, i * f0 + j * f1 + k * f2
    return (
        (e0 * e0 + e1 * e1 + e2 * e2 - along * along) / length,
        (e0 * f0 + e1 * f1 + e2 * f2 - along * beside) / length,
        (f0 * f0 + f1 * f1 + f2 * f2 - beside * beside) / length,
    )


@kernel
def _turned(u: Reals, x: float, y: float, z: float) -> Point:
    """A direction in the frame of a geom."""
    return (
        u[0] * x + u[3] * y + u[6] * z,
        u[1] * x + u[4] * y + u[7] * z,
        u[2] * x + u[5] * y + u[8] * z,
    )


@kernel
def extent(g: int, x: float, y: float, z: float, shapes: Shapes, frames: Frames) -> float:
    """How far a geom reaches from its place along a unit axis."""
    kind, size, u = shapes.kind[g], shapes.size[g], frames.axes[g]
    p, q, r = _turned(u, x, y, z)
    if kind == SPHERE:
        return float(size[0])
    if kind == CAPSULE:
        return float(size[0] + size[1] * abs(r))
    if kind == CYLINDER:
        return float(size[0] * math.sqrt(p * p + q * q) + size[1] * abs(r))
    if kind == ELLIPSOID:
        return math.sqrt((size[0] * p) ** 2 + (size[1] * q) ** 2 + (size[2] * r) ** 2)
    if kind == BOX:
        return float(size[0] * abs(p) + size[1] * abs(q) + size[2] * abs(r))
    far = -math.inf
    for k in range(shapes.first[g], shapes.end[g]):
        far = max(far, shapes.corners[k, 0] * p + shapes.corners[k, 1] * q + shapes.corners[k, 2] * r)
    return far


@kernel
def separation(a: int, b: int, x: float, y: float, z: float, shapes: Shapes, frames: Frames) -> float:
    """Distance of the geoms along a unit axis from a to b; negative where they overlap along it."""
    along = x * (frames.place[b, 0] - frames.place[a, 0])
    along += y * (frames.place[b, 1] - frames.place[a, 1])
    along += z * (frames.place[b, 2] - frames.place[a, 2])
    return float(along - extent(a, x, y, z, shapes, frames) - extent(b, -x, -y, -z, shapes, frames))
