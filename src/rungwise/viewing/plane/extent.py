"""Scales of a picture: the stretch of the world that is seen, and the force that sets the arrows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.plane.clip import Clip


def bounds(clips: Sequence[Clip]) -> tuple[float, float, float, float]:
    """x and y from, x and y to, of all bodies in all frames; half-planes, which never end, aside."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for clip in clips:
        for outline in clip.outlines:
            if outline.halfplane:
                continue
            poses = clip.pose[:, outline.body, :]
            if outline.body in clip.wanted:
                poses = np.vstack([poses, clip.goal[outline.body]])
            x, y, angle = np.moveaxis(poses, -1, 0)
            c, s = np.cos(angle), np.sin(angle)
            for vx, vy in outline.vertices:
                at = np.stack([x + c * vx - s * vy, y + s * vx + c * vy])
                low = np.minimum(low, at.min(axis=1) - outline.radius)
                high = np.maximum(high, at.max(axis=1) + outline.radius)
    if not np.isfinite(low).all():
        low, high = -np.ones(2), np.ones(2)
    least = 0.05 * (float((high - low).max()) or 1.0)
    pad = np.maximum(least - (high - low), 0.0)
    low, high = low - pad, high + pad
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def largest_force(clips: Sequence[Clip], part: float = 0.95) -> float:
    """Force of an arrow of nominal length: this part of the forces is no larger; 1 where there is none."""
    sizes = np.concatenate([np.linalg.norm(clip.touches.force, axis=1) for clip in clips])
    sizes = sizes[sizes > 0.0]
    return float(np.quantile(sizes, part)) if len(sizes) else 1.0


def receives_first(clip: Clip) -> NDArray[np.bool_]:
    """For each contact whether arrows show the force on its first body: on the object, where one body is an
    object."""
    ends = [[clip.roles[clip.bodies.index(name)] for name in pair.split(" | ")] for pair in clip.contacts]
    return np.array([first == "object" or second != "object" for first, second in ends], bool)
