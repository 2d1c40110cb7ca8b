"""Bodies and solids of a MuJoCo model, as films have them. Needs the extra `space`, when first used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.scene.space.laws import touching
from rungwise.viewing.space.film import FilmError, Solid

if TYPE_CHECKING:
    import mujoco

SEEN = 3
"""Groups of geoms below this number are those that MuJoCo's own viewer shows at first."""
UNSAID = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's colour of geoms for which the model names none."""
STILL = (0.72, 0.74, 0.76, 1.0)
"""Colour of fixed bodies for which the model names none: a light grey, on which moving bodies stand out."""
PALETTE = (
    (0.52, 0.67, 0.82), (0.82, 0.76, 0.62), (0.60, 0.74, 0.64),
    (0.75, 0.65, 0.76), (0.80, 0.66, 0.60), (0.58, 0.62, 0.70),
)  # fmt: skip
"""Colours of moving bodies for which the model names none, in turn: pale, so that forces stand out."""


def film_of_model(model: mujoco.MjModel) -> tuple[list[str], list[Solid]]:
    """Names of all bodies, the world first, and their solids.

    Of a moving body that has geoms which touch nothing (its look) those are shown, with all of their groups;
    of others, geoms in the groups that MuJoCo's viewer shows. Invisible geoms are left out. A height field
    becomes a mesh. Raises FilmError for other kinds of geoms.
    """
    bodies = [model.body(b).name or (f"body {b}" if b else "world") for b in range(model.nbody)]
    collides, colours = touching(model), colours_of(model)
    shown = [_shown(model, collides, body) for body in range(model.nbody)]
    solids = [
        _solid(model, geom, colours[geom]) for geoms in shown for geom in geoms.tolist() if colours[geom, 3]
    ]
    return bodies, solids


def _shown(model: mujoco.MjModel, collides: NDArray[np.bool_], body: int) -> NDArray[np.intp]:
    """Numbers of the geoms that show the body."""
    geoms = np.flatnonzero(model.geom_bodyid == body)
    groups = model.geom_group[geoms]
    if (groups < SEEN).any():
        geoms = geoms[groups < SEEN]
    looks = geoms[~collides[geoms]]
    if model.body_weldid[body] != 0 and len(looks):
        geoms = geoms[np.isin(model.geom_group[geoms], model.geom_group[looks])]
    return geoms


def colours_of(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Colour of each geom (n, 4): its own, else its material's, else one of ours."""
    colours: NDArray[np.float64] = model.geom_rgba.astype(np.float64)
    moving = np.cumsum(model.body_weldid != 0) - 1
    for geom in np.flatnonzero((colours == UNSAID).all(axis=1)):
        body, material = model.geom_bodyid[geom], model.geom_matid[geom]
        if material >= 0:
            colours[geom] = _of_material(model, material)
        elif model.body_weldid[body] == 0:
            colours[geom] = STILL
        else:
            colours[geom, :3] = PALETTE[moving[body] % len(PALETTE)]
    return np.clip(colours, 0.0, 1.0)


def _of_material(model: mujoco.MjModel, material: int) -> NDArray[np.float64]:
    """The material's colour, times the mean of its texture."""
    import mujoco

    colour: NDArray[np.float64] = model.mat_rgba[material].astype(np.float64)
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture >= 0:
        channels, first = model.tex_nchannel[texture], model.tex_adr[texture]
        size = model.tex_height[texture] * model.tex_width[texture] * channels
        pixels = model.tex_data[first : first + size].reshape(-1, channels)
        colour[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    return colour


def _solid(model: mujoco.MjModel, geom: int, colour: NDArray[np.float64]) -> Solid:
    import mujoco

    kinds = {getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}").value: kind for kind in (
        "plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf", "hfield")}  # fmt: skip
    kind = kinds.get(int(model.geom_type[geom]))
    name = model.geom(geom).name or f"geom {geom}"
    if kind is None:
        raise FilmError(f"solid {name!r}: kind: a geom of type {model.geom_type[geom]} cannot be shown")
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    if kind in ("mesh", "sdf"):
        vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
    elif kind == "hfield":
        vertices, faces = _height_field(model, int(model.geom_dataid[geom]))
    return Solid(
        name=name,
        body=int(model.geom_bodyid[geom]),
        kind="mesh" if len(faces) else kind,
        size=model.geom_size[geom].astype(np.float64),
        place=model.geom_pos[geom].astype(np.float64),
        turn=model.geom_quat[geom].astype(np.float64),
        colour=colour,
        vertices=vertices,
        faces=faces,
    )


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return (
        model.mesh_vert[first : first + count].astype(np.float64),
        model.mesh_face[start : start + faces].astype(np.int64),
    )


def _height_field(model: mujoco.MjModel, field: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The upper side of a height field: two triangles to a cell."""
    rows, columns, first = model.hfield_nrow[field], model.hfield_ncol[field], model.hfield_adr[field]
    half_x, half_y, height, _ = model.hfield_size[field]
    data = model.hfield_data[first : first + rows * columns]
    y, x = np.meshgrid(
        np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij"
    )
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    vertices = np.stack([x.ravel(), y.ravel(), height * data.astype(np.float64)], axis=1)
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
