"""How noisy the geometry of contacts is: jumps of gaps from step to step that no motion explains.

MuJoCo's convex collision is clean for boxes, spheres, capsules and planes, and noisy for cylinders that lie,
ellipsoids and rough meshes. A run is no more accurate than its gaps, whatever the law of contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.features import Features
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco

LOUD = 1e-9
"""A jump of a gap, over the size of the smaller geom, from which on a remark is made: a thousand roundings of
places."""
CURVED = 4.0
"""Jumps of a gap by curvature and turning are at most this times the square of the way in a step, over the
size of the smaller geom; chosen by trial, to a factor of two."""
SHAPES = ("plane", "height field", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")


@dataclass
class Noise:
    """The greatest jump so far, over the size of the smaller geom, and its geoms; when gaps were looked
    at."""

    jump: float = 0.0
    geoms: tuple[int, int] = (-1, -1)
    time: float = 0.0

    def look(
        self, time: float, way: float, slots: Ints, kept: Features, sizes: Reals, terms: Terms, v: Reals
    ) -> None:
        """Compare gaps at the start of a step with those a step before; `way` is what anything went since."""
        h, self.time = time - self.time, time
        if h <= 0.0:
            return
        jump, slot = _jump(h, way, slots, kept, sizes, terms, v)
        if jump > self.jump:
            self.jump, self.geoms = jump, (int(kept.geoms[slot, 0]), int(kept.geoms[slot, 1]))

    def remarks(self, model: mujoco.MjModel, names: tuple[str, ...]) -> tuple[str, ...]:
        """A line where gaps jumped."""
        if self.jump <= LOUD:
            return ()
        a, b = self.geoms
        kinds = " and ".join(SHAPES[int(model.geom_type[g])] for g in (a, b))
        return (
            f"geometry: the gap of {names[a]} and {names[b]} ({kinds}) jumped by {self.jump:.1g} of their"
            " size in a step, which no motion explains: contacts are not known more accurately than that",
        )


@kernel
def _jump(
    h: float, way: float, slots: Ints, kept: Features, sizes: Reals, terms: Terms, v: Reals
) -> tuple[float, int]:
    """The greatest jump of a gap, over the size of the smaller geom, and its slot."""
    greatest, found, d = 0.0, 0, terms.contact_stiffness.shape[1]
    for k in range(len(slots)):
        slot = slots[k]
        if slot >= len(kept.geoms) or kept.geoms[slot, 0] < 0:
            continue
        size = min(sizes[kept.geoms[slot, 0]], sizes[kept.geoms[slot, 1]])
        change = terms.gap[k] - kept.world[slot, 9]
        for j in range(len(v)):
            change -= h * terms.rows[k * d, j] * v[j]
        jump = (abs(change) - CURVED * way * way / size) / size
        if jump > greatest and min(terms.gap[k], kept.world[slot, 9]) < LOUD * size:
            greatest, found = jump, slot
    return greatest, found
