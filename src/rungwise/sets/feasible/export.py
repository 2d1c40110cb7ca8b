"""Sets for other programs: tables and meshes. Files appear whole or not at all."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from rungwise.sets.cells.crossings import ends_of
from rungwise.sets.cells.labelled import LabelledBox
from rungwise.sets.cells.labels import Label
from rungwise.sets.cells.surface import Mesh, boundary, check_axes
from rungwise.sets.feasible.arrays import dataset
from rungwise.sets.store import SetError, write

MESHES = (".obj", ".stl")


def to_csv(found: LabelledBox, file: str | Path) -> Path:
    """Every run that made the set, and every place where the boundary was located, one to a row.

    Columns: the parameters; `kind`: run, borrowed (from another rung) or boundary; `label`, of the run, or
    below the boundary along the axis that it was located on; `beyond`, above it; `margin` of the run. Raises
    OSError.
    """
    names = np.array([str(label) for label in Label])
    data, vertices = dataset(found), found.tree.vertices
    text = io.StringIO(newline="")
    table = csv.writer(text)
    table.writerow([*found.over, "kind", "label", "beyond", "margin"])
    kinds = np.where(vertices.borrowed, "borrowed", "run")
    for point, kind, label, margin in zip(
        data.vertex.values.tolist(), kinds, names[vertices.labels], vertices.margins.tolist(), strict=True
    ):
        table.writerow([*point, kind, label, "", margin])
    at = 0
    for level, (keys, _) in found.crossings.items():
        low, high = (names[vertices.labels[i]] for i in ends_of(found.tree, level, keys))
        for point, label, beyond in zip(data.crossing.values[at:].tolist(), low, high, strict=False):
            table.writerow([*point, "boundary", label, beyond, ""])
        at += len(keys)
    return write(Path(file), text.getvalue().encode())


def to_mesh(found: LabelledBox, file: str | Path, label: Label = Label.FEASIBLE) -> Path:
    """The boundary of a label's part: OBJ (triangles, or over two parameters lines) or, of triangles, STL.

    Raises SetError for another suffix or number of parameters, OSError.
    """
    target = Path(file)
    check_mesh(target, len(found.over))
    mesh = boundary(found, label)
    return write(target, _stl(mesh) if target.suffix.lower() == ".stl" else _obj(found, mesh, label).encode())


def check_mesh(file: Path, axes: int) -> None:
    """Raise SetError for a name or a number of parameters that `to_mesh` refuses."""
    suffix = file.suffix.lower()
    if suffix not in MESHES:
        raise SetError(f"mesh: {file.name} must end in {' or '.join(MESHES)}")
    check_axes(axes)
    if suffix == ".stl" and axes != 3:
        raise SetError("mesh: STL holds triangles only; over two parameters write .obj")


def _obj(found: LabelledBox, mesh: Mesh, label: Label) -> str:
    axes = ", ".join(f"{axis} = {name}" for axis, name in zip("xyz", found.over, strict=False))
    lines = [f"# {found.scene.name} on {found.name}: boundary of {label}; {axes}"]
    for vertex in mesh.vertices.tolist():
        lines.append("v " + " ".join(repr(x) for x in [*vertex, 0.0][:3]))
    kind = "f" if len(found.over) == 3 else "l"
    lines += [f"{kind} " + " ".join(str(i + 1) for i in piece) for piece in mesh.pieces.tolist()]
    return "\n".join(lines) + "\n"


def _stl(mesh: Mesh) -> bytes:
    corners = mesh.vertices[mesh.pieces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
    triangles = np.zeros(len(corners), kind)
    triangles["normal"], triangles["corners"] = normal / np.where(length > 0.0, length, 1.0), corners
    return bytes(80) + np.uint32(len(corners)).tobytes() + triangles.tobytes()
