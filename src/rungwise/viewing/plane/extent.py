"""Scales of a picture: the stretch of the world that is seen, and the force that sets the arrows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.viewing.plane.clip import Clip, Outline

NOWHERE: Reals = np.array([[np.inf, np.inf], [-np.inf, -np.inf]])
OBJECTS, EVERY = frozenset({"object"}), frozenset({"robot", "object", "obstacle"})

AWAY = 4.0
"""How far objects are followed from where all bodies start: this many times the size of the start."""
BESIDE = 0.5
"""How far other bodies are followed beyond the room that objects need, in sizes of this room."""


def bounds(clips: Sequence[Clip]) -> tuple[float, float, float, float]:
    """x and y from, x and y to, of the bodies in all frames; half-planes, which never end, aside.

    The objects set the frame, with all bodies where they start and the poses that the goal wants: what is
    flung far away leaves it, so that the bodies of which the question is do not become too small to be seen.
    """
    begun = _joined(_stretch(clips, EVERY, first=True), _wanted(clips))
    if not np.isfinite(begun).all():
        return -1.0, -1.0, 1.0, 1.0
    core = _joined(begun, _within(_stretch(clips, OBJECTS), begun, AWAY))
    others = BESIDE if any("object" in clip.roles for clip in clips) else AWAY
    low, high = _joined(core, _within(_stretch(clips, EVERY - OBJECTS), core, others))
    least = 0.05 * (float((high - low).max()) or 1.0)
    pad = np.maximum(least - (high - low), 0.0)
    low, high = low - pad, high + pad
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _stretch(clips: Sequence[Clip], roles: frozenset[str], first: bool = False) -> Reals:
    """Least and greatest place (2, 2) of bodies of these roles, in all frames or in the first."""
    stretches = [
        _covered(outline, clip.pose[: 1 if first else None, outline.body])
        for clip in clips
        for outline in clip.outlines
        if not outline.halfplane and clip.roles[outline.body] in roles
    ]
    return reduce(_joined, stretches, NOWHERE)


def _wanted(clips: Sequence[Clip]) -> Reals:
    """Least and greatest place (2, 2) of the poses that goals want."""
    stretches = [
        _covered(outline, clip.goal[None, outline.body])
        for clip in clips
        for outline in clip.outlines
        if not outline.halfplane and outline.body in clip.wanted
    ]
    return reduce(_joined, stretches, NOWHERE)


def _covered(outline: Outline, poses: Reals) -> Reals:
    """Least and greatest place (2, 2) of an outline at poses (m, 3)."""
    x, y, angle = np.moveaxis(poses, -1, 0)
    c, s = np.cos(angle), np.sin(angle)
    vx, vy = outline.vertices.T[:, :, None]
    at = np.stack([x + c * vx - s * vy, y + s * vx + c * vy]).reshape(2, -1)
    return np.stack([at.min(axis=1) - outline.radius, at.max(axis=1) + outline.radius])


def _joined(one: Reals, other: Reals) -> Reals:
    return np.stack([np.minimum(one[0], other[0]), np.maximum(one[1], other[1])])


def _within(stretch: Reals, core: Reals, sizes: float) -> Reals:
    """The part of a stretch that is no farther from the core than so many of its sizes."""
    if not np.isfinite(stretch).all():
        return NOWHERE
    room = sizes * float((core[1] - core[0]).max())
    return np.stack([np.maximum(stretch[0], core[0] - room), np.minimum(stretch[1], core[1] + room)])


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
