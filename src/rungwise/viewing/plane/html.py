"""A run, or several, as one HTML file that plays in a browser without anything else, also offline."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.plane.clip import Clip
from rungwise.viewing.plane.extent import bounds, largest_force, receives_first

PAGE = files("rungwise.viewing") / "page"
STAGE = ("stage.js", "marks.js", "names.js", "legend.js")
SCRIPTS = ("unpack.js", "data.js", *STAGE, "charts.js", "clock.js", "player.js")
LARGEST = 4_500_000
"""Bytes of a file: frames are left out, evenly, until the file is no larger."""
CURVES = 8
"""Most contacts that are drawn as curves: the contacts with the largest forces, then the nearest."""


def page(clips: Sequence[Clip], largest: int = LARGEST) -> str:
    """Text of the file. Clips must be of one scene's bodies and contacts (see `view`)."""
    every = 1
    while True:
        thinned = [clip.thinned(kept(len(clip.time), every)) for clip in clips]
        text = _fill(thinned)
        if len(text) <= largest or max(len(clip.time) for clip in thinned) <= 2:
            return text
        every = max(every + 1, int(np.ceil(every * len(text) / largest)))


def kept(count: int, every: int) -> NDArray[np.int64]:
    """Every so many frames, and the last."""
    return np.unique(np.append(np.arange(0, count, every), count - 1))


def _fill(clips: Sequence[Clip]) -> str:
    return fill("page.html", title(clips), ("page.css",), SCRIPTS, _data(clips))


Part = str | Traversable
"""A part of a page: a file, or the name of one in `page`."""


def fill(frame: Part, title: str, styles: Sequence[Part], scripts: Sequence[Part], data: object) -> str:
    """A page from its frame, styles, scripts and data."""
    parts = {
        "title": html.escape(title),
        "style": "\n".join(_read(part) for part in styles),
        "script": "\n".join(_read(part) for part in scripts),
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    }
    text = _read(frame)
    for name, value in parts.items():
        before, after = text.split("{{" + name + "}}")
        text = before + value + after
    return text


def _read(part: Part) -> str:
    return (PAGE / part if isinstance(part, str) else part).read_text("utf-8")


def title(clips: Sequence[Clip]) -> str:
    """Scene and, where there is only one clip, its model."""
    scenes = " and ".join(dict.fromkeys(clip.scene for clip in clips))
    return f"{scenes} on {clips[0].model}" if len(clips) == 1 else scenes


def labels(clips: Sequence[Clip]) -> list[str]:
    """Labels that tell the clips apart."""
    return numbered([clip.model for clip in clips])


def numbered(models: Sequence[str]) -> list[str]:
    """The models, numbered where a model occurs twice."""
    return [
        f"{model} ({models[: k + 1].count(model)})" if models.count(model) > 1 else model
        for k, model in enumerate(models)
    ]


def differing(clips: Sequence[Clip]) -> list[str]:
    """The parameters of each clip that are not the same in all."""
    names = [name for name, value in clips[0].parameters.items()
             if any(clip.parameters.get(name) != value for clip in clips)]  # fmt: skip
    return [", ".join(f"{name} = {clip.parameters.get(name, 0.0):.6g}" for name in names) for clip in clips]


def _data(clips: Sequence[Clip]) -> dict[str, Any]:
    curves = _curves(clips)
    pushes = [clip.push_is for clip in clips if clip.push_is]
    notes = differing(clips)
    return {
        "bounds": bounds(clips),
        "force": largest_force(clips),
        "units": dict(clips[0].units),
        "push": " / ".join(dict.fromkeys(pushes)),
        "contacts": [clips[0].contacts[c] for c in curves],
        "clips": [
            clip_data(clip, curves) | {"label": label, "note": note}
            for clip, label, note in zip(clips, labels(clips), notes, strict=True)
        ],
    }


def _curves(clips: Sequence[Clip]) -> NDArray[np.int64]:
    push = np.max([clip.push.max(axis=0) for clip in clips], axis=0)
    gap = np.min([clip.gap.min(axis=0) for clip in clips], axis=0)
    return np.sort(np.lexsort((gap, -push))[:CURVES])


def clip_data(clip: Clip, curves: NDArray[np.int64]) -> dict[str, Any]:
    """A clip as `clipOf` of unpack.js reads it; gaps and forces along time of the contacts `curves` only."""
    t = clip.touches
    force = np.where(receives_first(clip)[t.contact, None], t.force, -t.force)
    first = np.searchsorted(t.frame, np.arange(len(clip.time) + 1))
    return {
        "outcome": clip.outcome,
        "reason": clip.reason,
        "bodies": _bodies(clip),
        "joints": clip.joints,
        "time": bytes_of(clip.time, "<f4"),
        "pose": quantised(clip.pose.reshape(len(clip.time), -1)),
        "gap": bytes_of(clip.gap[:, curves], "<f4"),
        "push": bytes_of(clip.push[:, curves], "<f4"),
        "first": bytes_of(first, "<u4"),
        "mode": bytes_of(t.mode, "<u1"),
        "place": quantised(t.place),
        "force": quantised(force),
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


def bytes_of(values: NDArray[Any], kind: str) -> str:
    """Base64 of values as numbers of that kind."""
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def quantised(values: NDArray[np.float64]) -> dict[str, Any]:
    """Columns in 16 bits each, over their own range: value = low + step * integer."""
    if len(values) == 0:
        return {"low": [0.0] * values.shape[1], "step": [0.0] * values.shape[1], "data": ""}
    low, high = values.min(axis=0), values.max(axis=0)
    step = (high - low) / 65535.0
    integers = np.rint((values - low) / np.where(step > 0.0, step, 1.0))
    return {"low": low.tolist(), "step": step.tolist(), "data": bytes_of(integers, "<u2")}
