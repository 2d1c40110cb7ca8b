"""Geoms of meshes that are not convex: convex pieces in their place, or one line that refuses them.

MuJoCo takes a mesh for its convex hull where it touches anything. The geom of a mesh that is not convex
(`solid`) and that may touch something keeps its look and its mass, but touches nothing any more; pieces of it
stand beside it on the same body with all that it says of contacts, as geoms without mass. They are called by
its name, `labels.PIECE` and a number, and are told of by its label alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.scene.errors import SceneError
from rungwise.scene.space.labels import PIECE, labels
from rungwise.scene.space.laws import touching_pairs
from rungwise.scene.space.meshes.decompose import ACCURACY, Undone, is_installed, pieces
from rungwise.scene.space.meshes.solid import Solid, solid
from rungwise.scene.space.mujoco_model import compiled, named

if TYPE_CHECKING:
    from pathlib import Path

    import mujoco

HULL = "hull"
"""What a scene says of meshes that stand for their hulls on purpose."""
TOLD = 3
"""Geoms that a remark, or a refusal, names."""
SAME = (
    "pos", "quat", "contype", "conaffinity", "condim", "priority", "friction", "solmix", "solref", "solimp",
    "margin", "gap", "group", "rgba",
)  # fmt: skip
"""What pieces have of the geom that they stand for."""
OF_PAIRS = ("condim", "friction", "gap", "margin", "solimp", "solref", "solreffriction")
"""What pairs of pieces have of the pair of the geom that they stand for."""
KEPT = 512
"""Solids that a process remembers: meshes of some ten robots."""


class Concave(NamedTuple):
    """A geom whose mesh is not convex: its number, its label, how it is told of, its mesh as a solid, and the
    accuracy of its pieces."""

    geom: int
    label: str
    told: str
    solid: Solid
    accuracy: float

    def __str__(self) -> str:
        if self.solid.fault:
            return f"{self.told}: {self.solid.fault}"
        least = "at least " if self.solid.is_least else ""
        return f"{self.told}: {least}{100.0 * self.solid.share:.2g} % of its hull is not in its mesh"


class Pieced(NamedTuple):
    """A model in which pieces stand for meshes that are not convex, and remarks on them."""

    model: mujoco.MjModel
    notes: tuple[str, ...]


def with_pieces(
    spec: mujoco.MjSpec, model: mujoco.MjModel, path: Path, said: Mapping[str, str | float]
) -> Pieced:
    """Put convex pieces into a specification for meshes that are not convex, and compile it anew if there are
    any. `said`: by patterns of names of geoms, bodies or meshes, `HULL` or the accuracy of pieces, the first
    that fits holds. Raises SceneError in one line that names the geoms where they cannot be decomposed."""
    found = _concave(spec, model, said)
    if not found:
        return Pieced(model, ())
    own, corners = {geom.id: geom for geom in spec.geoms}, dict[int, tuple[Reals, ...]]()
    undone = list[tuple[Concave, str]]()
    for k, each in enumerate(found, 1):
        mesh, told = _mesh(model, int(model.geom_dataid[each.geom])), f"{each.told} ({k} of {len(found)})"
        try:
            corners[each.geom] = _pieces_of(mesh, told, each.accuracy)
        except Undone as error:
            undone.append((each, str(error)))
    if undone:
        raise SceneError(_refusal(undone))
    for each in found:
        _replace(spec, own[each.geom], model, each, corners[each.geom])
    spec.compiler.discardvisual = False  # the look of what the pieces stand for
    return Pieced(compiled(spec, path), (_remark(found, [len(corners[each.geom]) for each in found]),))


def _concave(spec: mujoco.MjSpec, model: mujoco.MjModel, said: Mapping[str, str | float]) -> list[Concave]:
    """The geoms that may touch something and whose meshes are not convex, unless they stand for their hulls
    on purpose."""
    import mujoco

    m, kind, names = model, mujoco.mjtGeom.mjGEOM_MESH, labels(model)
    convex = {each.id for each in spec.meshes if each.inertia == mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX}
    meshes, found = np.flatnonzero(m.geom_type == kind), []
    touch = touching_pairs(m) if len(meshes) else meshes
    for geom in meshes[np.isin(meshes, touch)].tolist():
        mesh = int(m.geom_dataid[geom])
        if mesh in convex:
            continue
        accuracy = _said(model, geom, names.geoms[geom], names.bodies[int(m.geom_bodyid[geom])], said)
        if accuracy == HULL:
            continue
        own = _solid_of(_mesh(m, mesh))
        if not own.is_convex:
            label, body = names.geoms[geom], names.bodies[int(m.geom_bodyid[geom])]
            told = label if m.geom(geom).name else f"{label} of {body}"
            found.append(Concave(geom, label, told, own, float(accuracy)))
    return found


def _said(
    model: mujoco.MjModel, geom: int, label: str, body: str, said: Mapping[str, str | float]
) -> str | float:
    """What a scene says of a geom's mesh."""
    body_name, mesh = model.body(model.geom_bodyid[geom]).name, model.mesh(model.geom_dataid[geom]).name
    known = [label, model.geom(geom).name, body, body_name, mesh]
    return next((given for pattern, given in said.items() if named(pattern, known)), ACCURACY)


@dataclass(frozen=True)
class _Mesh:
    """Vertices (k, 3) and faces (f, 3), told apart by the digest of both."""

    digest: bytes
    vertices: Reals = field(compare=False)
    faces: Ints = field(compare=False)


def _mesh(model: mujoco.MjModel, number: int) -> _Mesh:
    m = model
    first, face = int(m.mesh_vertadr[number]), int(m.mesh_faceadr[number])
    vertices = np.array(m.mesh_vert[first : first + int(m.mesh_vertnum[number])], float)
    faces = np.array(m.mesh_face[face : face + int(m.mesh_facenum[number])], np.int64)
    return _Mesh(hashlib.sha256(vertices.tobytes() + faces.tobytes()).digest(), vertices, faces)


@lru_cache(maxsize=KEPT)
def _solid_of(mesh: _Mesh) -> Solid:
    return solid(mesh.vertices, mesh.faces)


@lru_cache(maxsize=KEPT)
def _pieces_of(mesh: _Mesh, told: str, accuracy: float) -> tuple[Reals, ...]:
    return tuple(pieces(_solid_of(mesh), told, accuracy))


def _replace(
    spec: mujoco.MjSpec, geom: Any, model: mujoco.MjModel, concave: Concave, corners: Sequence[Reals]
) -> None:
    """Let pieces (k, 3) each touch in the place of a geom."""
    import mujoco

    if not geom.name:
        geom.name = concave.label
    names = [f"{geom.name}{PIECE}{k}" for k in range(len(corners))]
    for name, own in zip(names, corners, strict=True):
        asset = spec.add_mesh()
        asset.name, asset.inertia = name, mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        asset.uservert = own.ravel()
        piece = geom.parent.add_geom()
        piece.name, piece.meshname, piece.type, piece.material = name, name, mujoco.mjtGeom.mjGEOM_MESH, ""
        piece.mass = 0.0
        for name_of in SAME:
            setattr(piece, name_of, getattr(model, f"geom_{name_of}")[concave.geom])
    for pair in [each for each in spec.pairs if geom.name in (each.geomname1, each.geomname2)]:
        for name in names:
            both = [name if each == geom.name else each for each in (pair.geomname1, pair.geomname2)]
            own_pair = spec.add_pair(geomname1=both[0], geomname2=both[1])
            for name_of in OF_PAIRS:
                setattr(own_pair, name_of, getattr(pair, name_of))
        spec.delete(pair)
    geom.contype = geom.conaffinity = 0


def _remark(found: list[Concave], counts: list[int]) -> str:
    told = [f"{count} convex pieces for {each}" for each, count in zip(found[:TOLD], counts, strict=False)]
    more = f"; {sum(counts[TOLD:])} for {len(found) - TOLD} geoms more" if len(found) > TOLD else ""
    return (
        f"model: meshes that are not convex: {'; '.join(told)}{more} (model.meshes of a scene can take hulls)"
    )


def _refusal(undone: list[tuple[Concave, str]]) -> str:
    told = [str(each) for each, _ in undone[:TOLD]]
    more = f"; and {len(undone) - TOLD} geoms more" if len(undone) > TOLD else ""
    (first, why), *others = undone
    if not first.solid.fault:
        lacking = f"; {why}" + ("" if is_installed() else " (pip install 'rungwise[meshes]')")
    else:
        lacking = ""
    name = "*" if others else first.label
    return (
        f"model: meshes that are not convex, and not decomposed: {'; '.join(told)}{more}{lacking}; to take"
        f' their hulls on purpose, say meshes: {{"{name}": hull}} in the scene\'s model, or'
        ' inertia="convex" of the mesh; or take simpler geoms'
    )
