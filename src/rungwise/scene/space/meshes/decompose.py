"""Convex pieces of a solid: parts that are convex as they are, all others from CoACD, kept on the disk.

Method: X. Wei, M. Liu, Z. Ling, H. Su, Approximate convex decomposition for 3D meshes with collision-aware
concavity and tree search, ACM Transactions on Graphics 41 (2022), in the package `coacd`. It runs in a
process of its own, since input that it cannot take ends the process that it runs in, or keeps it busy without
end. It cuts across axes, which are those of the largest faces here, so that a mesh may lie as it likes.
Surfaces with exactly two faces at each edge are cut as they are; others are first made anew, by its own
remeshing, which rounds corners.

What was found is kept beside a hash of vertices, faces, settings and the version of the package, as numbers
alone; a file that is damaged is made anew.
"""

from __future__ import annotations

import hashlib
import io
import subprocess
import sys
import zipfile
from contextlib import suppress
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from rungwise.compilation.cache import folder_of
from rungwise.compilation.progress import compiling
from rungwise.kernel import Ints, Reals
from rungwise.scene.space.meshes.solid import Part, Solid, hull_of
from rungwise.stored import whole

ACCURACY = 0.05
"""Concavity that pieces may have, over half of the longest side of a part: CoACD's own threshold."""
SLIVER = 1e-6
"""Part of the volume of a solid's hull below which a piece is left out."""
LIMIT_S = 600.0
"""Seconds after which CoACD is taken not to end: fifteen times what the worst link of an industrial arm
takes."""
ALIKE = 1e-3
"""Angle in rad within which faces count as of one plane's direction: roundings of single precision on faces
a thousandth as long as the mesh."""
TRIED = 100
"""Faces, the largest, whose normals are tried as axes."""
FORMAT = b"1"
"""Of files that are kept."""
CHILD = Path(__file__).with_name("coacd_child.py")
SMALLEST = 4
"""Corners of a solid at least."""


class Undone(Exception):
    """A solid that is not decomposed, and why, in words."""


def is_installed() -> bool:
    """Whether the package is there that decomposes parts which are not convex."""
    return find_spec("coacd") is not None


def pieces(solid: Solid, name: str, accuracy: float = ACCURACY) -> list[Reals]:
    """Corners (k, 3) of the convex pieces of a solid, told of by a `name`. Raises Undone."""
    if solid.fault:
        raise Undone(solid.fault)
    found: list[Reals] = []
    for part in solid.parts:
        found += [part.vertices] if part.is_convex else _of_part(part, name, accuracy)
    volumes = [hull.volume if (hull := hull_of(each)) else 0.0 for each in found]
    least = SLIVER * max(volumes, default=0.0)
    return [each for each, volume in zip(found, volumes, strict=True) if volume > least]


def _of_part(part: Part, name: str, accuracy: float) -> list[Reals]:
    if not is_installed():
        raise Undone("CoACD is not installed")
    file = folder_of("meshes") / f"{_digest(part, accuracy)}.npz"
    found = _kept(file)
    if found is None:
        compiling.tell(f"rungwise: decomposing the mesh of {name} into convex pieces, once")
        found = _decomposed(part, accuracy)
        with suppress(OSError):
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with whole(file) as draft:
                draft.write_bytes(_packed({f"piece{k}": each for k, each in enumerate(found)}))
    return found


def _digest(part: Part, accuracy: float) -> str:
    told = hashlib.sha256(FORMAT + metadata.version("coacd").encode())
    for each in (np.array([accuracy, part.is_plain], float), part.vertices, part.faces):
        told.update(repr(each.shape).encode() + np.ascontiguousarray(each).tobytes())
    return told.hexdigest()


def _kept(file: Path) -> list[Reals] | None:
    """Pieces in a file; None where it is missing or damaged."""
    try:
        return _unpacked(file.read_bytes())
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None


def _packed(arrays: dict[str, Reals | Ints]) -> bytes:
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)  # type: ignore[arg-type]
    return content.getvalue()


def _unpacked(content: bytes) -> list[Reals]:
    """Pieces from the content of a file. Raises ValueError where it holds anything else."""
    with np.load(io.BytesIO(content), allow_pickle=False) as kept:
        found = [np.asarray(kept[f"piece{k}"]) for k in range(len(kept.files))]
    for each in found:
        if each.dtype != np.float64 or each.shape[1:] != (3,) or len(each) < SMALLEST:
            raise ValueError("not the corners of a piece")
        if not np.isfinite(each).all():
            raise ValueError("not a place")
    if not found:
        raise ValueError("no pieces")
    return found


def _axes(part: Part) -> Reals:
    """Axes (3, 3), as columns, right-handed: the normal of the largest area, that of the largest area beside
    it, and the one across."""
    a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
    across = np.cross(b - a, c - a)
    first = _way_of_most(across)
    second = _way_of_most(across - np.outer(across @ first, first))
    return np.column_stack([first, second, np.cross(first, second)])


def _way_of_most(across: Reals) -> Reals:
    """The direction (3,) along which most of some areas (f, 3) are, to either side, within `ALIKE`."""
    areas = np.linalg.norm(across, axis=1)
    ways = across[areas > SLIVER * areas.max()]
    areas = areas[areas > SLIVER * areas.max()]
    ways = ways / areas[:, None]
    least = 1.0 - 0.5 * ALIKE**2
    largest = np.argsort(-areas, kind="stable")[:TRIED]
    sums = [float(areas[np.abs(ways @ ways[k]) >= least].sum()) for k in largest]
    return np.asarray(ways[largest[int(np.argmax(sums))]])


def _decomposed(part: Part, accuracy: float) -> list[Reals]:
    """Pieces of a part. Raises Undone where CoACD finds none."""
    axes = _axes(part)
    given = {"vertices": part.vertices @ axes, "faces": part.faces, "accuracy": np.array([accuracy])}
    given["remesh"] = np.array([0.0 if part.is_plain else 1.0])
    try:
        run = subprocess.run(
            [sys.executable, str(CHILD)], input=_packed(given), capture_output=True, timeout=LIMIT_S
        )
        return [each @ axes.T for each in _unpacked(run.stdout)]
    except subprocess.TimeoutExpired:
        raise Undone(f"CoACD did not end in {LIMIT_S:g} s") from None
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        raise Undone("CoACD found no pieces") from None
