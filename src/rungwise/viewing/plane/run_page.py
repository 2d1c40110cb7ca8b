"""A run, or several, as one HTML file that plays in a browser without anything else, also offline."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.plane.clip import Clip
from rungwise.viewing.plane.extent import bounds, largest_force, receives_first
from rungwise.viewing.skeleton import (
    CURVES,
    LARGEST,
    along_time,
    bytes_of,
    fill,
    kind_of_runs,
    numbered,
    within,
)
from rungwise.viewing.write import ViewError

OWN = files("rungwise.viewing.plane") / "page"
STAGE = tuple(OWN / name for name in ("stage.js", "marks.js", "names.js"))
KIND = kind_of_runs(OWN, "plane", "clips.js", STAGE)


def page(clips: Sequence[Clip], largest: int = LARGEST) -> str:
    """Text of the file. Clips must be of one scene's bodies and contacts (see `view`)."""
    return within(clips, lambda thinned: fill(KIND, title(thinned), _data(thinned)), largest)


def same_bodies(clips: Sequence[Clip]) -> None:
    """Raises ViewError unless the clips are of the same bodies and contacts."""
    for other in clips[1:]:
        if (other.bodies, other.contacts) != (clips[0].bodies, clips[0].contacts):
            raise ViewError(
                f"runs: {clips[0].scene} and {other.scene} do not have the same bodies; view them one by one"
            )


def title(clips: Sequence[Clip]) -> str:
    """Scene and, where there is only one clip, its model."""
    scenes = " and ".join(dict.fromkeys(clip.scene for clip in clips))
    return f"{scenes} on {clips[0].model}" if len(clips) == 1 else scenes


def labels(clips: Sequence[Clip]) -> list[str]:
    """Labels that tell the clips apart."""
    return numbered([clip.model for clip in clips])


def differing(clips: Sequence[Clip]) -> list[str]:
    """The parameters of each clip that are not the same in all."""
    names = [name for name, value in clips[0].parameters.items()
             if any(clip.parameters.get(name) != value for clip in clips)]  # fmt: skip
    return [", ".join(f"{name} = {clip.parameters.get(name, 0.0):.6g}" for name in names) for clip in clips]


def _data(clips: Sequence[Clip]) -> dict[str, Any]:
    curves = _curves(clips)
    push = " / ".join(dict.fromkeys(clip.push_is for clip in clips if clip.push_is))
    return {
        "bounds": bounds(clips),
        "force": largest_force(clips),
        "units": dict(clips[0].units),
        "gap": "least gap of each contact",
        "push": f"{push} of each contact" if push else "",
        "contacts": [clips[0].contacts[c] for c in curves],
        "clips": [
            clip_data(clip, curves) | {"label": label, "notes": [note] if note else []}
            for clip, label, note in zip(clips, labels(clips), differing(clips), strict=True)
        ],
    }


def _curves(clips: Sequence[Clip]) -> NDArray[np.int64]:
    push = np.max([clip.push.max(axis=0) for clip in clips], axis=0)
    gap = np.min([clip.gap.min(axis=0) for clip in clips], axis=0)
    return np.sort(np.lexsort((gap, -push))[:CURVES])


def clip_data(clip: Clip, curves: NDArray[np.int64]) -> dict[str, Any]:
    """A clip as `clipOf` of base.js reads it; gaps and forces along time of the contacts `curves` only."""
    t = clip.touches
    force = np.where(receives_first(clip)[t.contact, None], t.force, -t.force)
    poses = clip.pose.reshape(len(clip.time), -1)
    return {
        **along_time(clip, poses, clip.gap[:, curves], clip.push[:, curves], t.place, force),
        "bodies": _bodies(clip),
        "joints": clip.joints,
        "raised": bytes_of(clip.raised > 0.0, "<u1") if clip.raised.any() else "",
    }


def _bodies(clip: Clip) -> list[dict[str, Any]]:
    bodies: list[dict[str, Any]] = [
        {"name": name, "role": role, "moves": bool(moves), "shapes": []}
        for name, role, moves in zip(clip.bodies, clip.roles, clip.moving, strict=True)
    ]
    for outline in clip.outlines:
        bodies[outline.body]["shapes"].append(
            {
                "vertices": outline.vertices.tolist(),
                "normals": outline.normals.tolist(),
                "radius": outline.radius,
                "halfplane": outline.halfplane,
            }
        )
    return bodies
