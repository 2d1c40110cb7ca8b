"""Pages in one file that a browser plays without anything else, also offline: one skeleton, whose slots a
kind of page fills, with one stylesheet, one clock and one player."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

PAGE = files("rungwise.viewing") / "page"
LARGEST = 4_500_000
"""Bytes of a file: frames are left out, evenly, until the file is no larger."""
CURVES = 8
"""Most pairs that touch that are drawn as curves: those with the largest forces, then the nearest."""


@dataclass(frozen=True)
class Kind:
    """A kind of page. `parts` are files of parts for the slots of the skeleton, and for slots of other
    parts: a part begins with its name, `<!-- name -->`, and a slot without a part stays empty. `data`,
    `drawing` and `main` are scripts: what makes runs of the data, what draws them, and what begins last."""

    name: str
    parts: tuple[Traversable, ...]
    data: Traversable
    drawing: tuple[Traversable, ...]
    main: tuple[Traversable, ...]

    def scripts(self) -> tuple[Traversable, ...]:
        """All scripts, in their order."""
        return (
            *(PAGE / "base.js", self.data, PAGE / "panels.js", PAGE / "legend.js", *self.drawing),
            *(PAGE / "clock.js", PAGE / "player.js", *self.main),
        )


def kind_of_runs(own: Traversable, name: str, data: str, drawing: tuple[Traversable, ...]) -> Kind:
    """A page of runs, with curves, whose own files are in a folder, NAME.html and NAME.js among them."""
    return Kind(
        name,
        (PAGE / "runs.html", own / f"{name}.html"),
        own / data,
        drawing,
        (PAGE / "charts.js", PAGE / "runs.js", own / f"{name}.js"),
    )


def fill(kind: Kind, title: str, data: object) -> str:
    """The text of a page of that kind."""
    parts = {"kind": kind.name}
    for file in kind.parts:
        parts |= _parts(file.read_text("utf-8"))
    frame = (PAGE / "page.html").read_text("utf-8")
    contents = {
        "title": html.escape(title),
        "style": (PAGE / "page.css").read_text("utf-8"),
        "script": "\n".join(script.read_text("utf-8") for script in kind.scripts()),
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    }
    return _SLOT.sub(lambda slot: contents[slot[1]], _framed(frame, parts, contents))


_SLOT = re.compile(r"\{\{(\w+)\}\}")


def _framed(text: str, parts: dict[str, str], contents: dict[str, str]) -> str:
    """The text with its slots filled by parts, and those of the parts, but for the contents."""

    def part(slot: re.Match[str]) -> str:
        if slot[1] in contents:
            return slot[0]
        return _framed(parts.get(slot[1], ""), parts, contents)

    return _SLOT.sub(part, text)


def _parts(text: str) -> dict[str, str]:
    _, *pieces = re.split(r"<!-- (\w+) -->\n", text)
    return {name: part.rstrip("\n") for name, part in zip(pieces[::2], pieces[1::2], strict=True)}


class Playable(Protocol):
    """What is played along time (f,)."""

    @property
    def time(self) -> NDArray[np.float64]: ...

    def thinned(self, frames: NDArray[np.int64]) -> Any:
        """The same with these frames only."""


P = TypeVar("P", bound=Playable)


def within(runs: Sequence[P], text: Callable[[Sequence[P]], str], largest: int) -> str:
    """The text of a page of the runs, from which frames are left out, evenly, until it has no more than
    `largest` bytes."""
    every = 1
    while True:
        thinned = [run.thinned(kept(len(run.time), every)) for run in runs]
        made = text(thinned)
        if len(made) <= largest or max(len(run.time) for run in thinned) <= 2:
            return made
        every = max(every + 1, int(np.ceil(every * len(made) / largest)))


def kept(count: int, every: int) -> NDArray[np.int64]:
    """Every so many frames, and the last."""
    return np.unique(np.append(np.arange(0, count, every), count - 1))


def numbered(models: Sequence[str]) -> list[str]:
    """The models, numbered where a model occurs twice."""
    return [
        f"{model} ({models[: k + 1].count(model)})" if models.count(model) > 1 else model
        for k, model in enumerate(models)
    ]


def along_time(
    run: Any,
    pose: NDArray[np.float64],
    gap: NDArray[np.float64],
    push: NDArray[np.float64],
    place: NDArray[np.float64],
    force: NDArray[np.float64],
) -> dict[str, Any]:
    """What `clipOf` of base.js reads of a clip or film: its end, frames of poses (f, p) and curves (f, c),
    and contacts of all frames in order, with places and forces (k, 2 or 3)."""
    return {
        "outcome": run.outcome,
        "reason": run.reason,
        "time": bytes_of(run.time, "<f4"),
        "pose": quantised(pose),
        "gap": bytes_of(gap, "<f4"),
        "push": bytes_of(push, "<f4"),
        "first": bytes_of(np.searchsorted(run.touches.frame, np.arange(len(run.time) + 1)), "<u4"),
        "mode": bytes_of(run.touches.mode, "<u1"),
        "place": quantised(place),
        "force": quantised(force),
    }


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
