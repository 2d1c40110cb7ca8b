"""Films in space as one HTML file that plays in a browser without anything else, also offline.

Its renderer is our own (WebGL 2): a recording of viser in a page cannot be driven by a play bar beside it,
steps back by playing again from the start, and shows neither curves nor one film of several.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing import skeleton
from rungwise.viewing.space.extent import box, largest_force
from rungwise.viewing.space.film import Film, FilmError, Solid
from rungwise.viewing.space.shapes import scale, shape
from rungwise.viewing.write import write

OWN = files("rungwise.viewing.space") / "page"
DRAWING = ("linear.js", "gpu.js", "bodies.js", "camera.js", "stage.js", "forces.js")
KIND = skeleton.kind_of_runs(OWN, "space", "films.js", tuple(OWN / name for name in DRAWING))
LONGEST_S = 30.0
"""A run of one second to so many plays in real time, others in six seconds."""


def write_page(films: Sequence[Film], file: str | Path) -> Path:
    """Write the films, of one scene on one rung each, to one HTML file; returns where it lies.

    Raises FilmError where there is none or they show different bodies, ViewError where the file cannot be
    written.
    """
    text = page(films)
    return write("file", file, lambda draft: draft.write_text(text, "utf-8"))


def page(films: Sequence[Film], largest: int = skeleton.LARGEST) -> str:
    """Text of the file. Frames are left out, evenly, until it has no more than `largest` bytes.

    Raises FilmError.
    """
    same_bodies(films)
    return skeleton.within(films, lambda thinned: skeleton.fill(KIND, title(films), _data(thinned)), largest)


def same_bodies(films: Sequence[Film]) -> None:
    """Raises FilmError unless there are films, of the same bodies."""
    if not films:
        raise FilmError("films: at least one is needed")
    for other in films[1:]:
        if other.bodies != films[0].bodies:
            raise FilmError(f"films: {films[0].title} and {other.title} do not have the same bodies")


def title(films: Sequence[Film]) -> str:
    """Titles, and the model and the outcome where there is only one film."""
    titles = " and ".join(dict.fromkeys(film.title for film in films))
    if len(films) > 1:
        return titles
    on = f" on {films[0].model}" if films[0].model else ""
    return titles + on + (f": {films[0].outcome}" if films[0].outcome else "")


def _data(films: Sequence[Film]) -> dict[str, Any]:
    low, high = box(films)
    pairs = curves_of(films)
    shapes: dict[str, int] = {}
    casts: dict[str, int] = {}
    clips = [
        _clip(film, pairs) | {"label": label, "cast": _cast(film, shapes, casts)}
        for film, label in zip(films, skeleton.numbered([film.model for film in films]), strict=True)
    ]
    end = max(float(film.time[-1]) for film in films)
    return {
        "low": low.tolist(),
        "high": high.tolist(),
        "force": largest_force(films),
        "units": dict(films[0].units),
        "real": films[0].units.get("time") == "s" and 1.0 <= end <= LONGEST_S,
        "contacts": [" | ".join(pair) for pair in pairs],
        "gap": "least gap of each pair of bodies" if _known(films, "gaps") else "",
        "push": "normal force of each pair of bodies" if _known(films, "pushes") else "",
        "shapes": [json.loads(text) for text in shapes],
        "casts": [json.loads(text) for text in casts],
        "clips": clips,
    }


def _known(films: Sequence[Film], kind: str) -> bool:
    """Whether there are curves of that kind, `gaps` or `pushes`."""
    return any(film.pairs and getattr(film, kind) is not None for film in films)


def curves_of(films: Sequence[Film]) -> list[tuple[str, str]]:
    """Pairs that are drawn as curves: those with the largest forces, then the nearest."""
    worth: dict[tuple[str, str], tuple[float, float]] = {}
    for film in films:
        for p, pair in enumerate(film.pairs):
            push = 0.0 if film.pushes is None else float(film.pushes[:, p].max())
            near = -np.inf if film.gaps is None else -float(np.nan_to_num(film.gaps[:, p], nan=np.inf).min())
            worth[pair] = max(worth.get(pair, (0.0, -np.inf)), (push, near))
    best = sorted(worth, key=lambda pair: worth[pair], reverse=True)[: skeleton.CURVES]
    return [pair for pair in worth if pair in best]


def curve_of(film: Film, kind: str, pair: tuple[str, str]) -> NDArray[np.float64]:
    """`gaps` or `pushes` (f,) of a pair of bodies; where the film has none, NaN or 0."""
    curves: NDArray[np.float64] | None = getattr(film, kind)
    if curves is None or pair not in film.pairs:
        return np.full(len(film.time), np.nan if kind == "gaps" else 0.0)
    return curves[:, film.pairs.index(pair)]


def _clip(film: Film, pairs: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """A film as `filmOf` of films.js reads it."""
    t = film.touches
    moving = np.flatnonzero(film.moving())
    poses = np.concatenate([film.places, film.turns], axis=2)
    gap, push = (np.array([curve_of(film, kind, pair) for pair in pairs]).T for kind in ("gaps", "pushes"))
    return {
        **skeleton.along_time(
            film, poses[:, moving].reshape(len(film.time), -1), gap, push, t.point, t.force
        ),
        "notes": list(film.notes),
        "bodies": list(film.bodies),
        "pairs": [" | ".join(pair) for pair in film.pairs],
        "moving": moving.tolist(),
        "rest": poses[0].round(9).tolist(),
        "pair": skeleton.bytes_of(t.pair, "<u2"),
        "normal": skeleton.quantised(t.normal),
        "friction": skeleton.quantised(t.friction[:, None]),
    }


def _cast(film: Film, shapes: dict[str, int], casts: dict[str, int]) -> int:
    """Number of the film's solids among those of all films: what is alike is held once."""
    solids = [_solid(solid, shapes) for solid in film.solids]
    return casts.setdefault(json.dumps(solids), len(casts))


def _solid(solid: Solid, shapes: dict[str, int]) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": solid.name,
        "kind": solid.kind,
        "body": solid.body,
        "place": solid.place.tolist(),
        "turn": solid.turn.tolist(),
        "colour": solid.colour.round(4).tolist(),
    }
    if solid.kind == "plane":
        return found | {"size": solid.size[:2].tolist()}
    vertices, faces = shape(solid)
    text = json.dumps(_welded(vertices, faces))
    return found | {"shape": shapes.setdefault(text, len(shapes)), "scale": scale(solid).tolist()}


def _welded(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> dict[str, Any]:
    """Triangles with vertices in 16 bits, each once, so that normals are smooth across them."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    step = np.where(high > low, (high - low) / 65535.0, 1.0)
    integers, which = np.unique(np.rint((vertices - low) / step), axis=0, return_inverse=True)
    new = which.reshape(-1)[faces]
    proper = (new[:, 0] != new[:, 1]) & (new[:, 1] != new[:, 2]) & (new[:, 2] != new[:, 0])
    wide = len(integers) > 65536
    return {
        "vertices": {"low": low.tolist(), "step": step.tolist(), "data": skeleton.bytes_of(integers, "<u2")},
        "faces": skeleton.bytes_of(new[proper], "<u4" if wide else "<u2"),
        "wide": wide,
    }
