"""The picture of a run in space: solids on bodies, and poses, contacts and curves of each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.wording import choices

SIZES = {"plane": 0, "sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3, "mesh": 0}
"""Kinds of solids, and how many sizes each needs. Sizes are MuJoCo's: radii or half lengths along x, y, z; of
capsules and cylinders the radius and the half length of the axis, z. The normal of a plane is z; it has no
end in x or y where that size is 0."""

OPEN, STICK, SLIP = 0, 1, 2
"""Modes of a contact."""
UNIT = 1e-3
"""How far the length of a quaternion may be from 1: far more than rounding, far less than a mistake."""


class FilmError(InputError):
    """A film cannot be shown; the text is one line that names the field."""


@dataclass(frozen=True)
class Solid:
    """A shape of a body. `place` (3,) and `turn` (4,), a quaternion w x y z, are relative to the body;
    `colour` is red, green, blue and opacity in 0..1. A mesh has `vertices` (k, 3) and `faces` (f, 3), whose
    corners are counter-clockwise seen from outside; for sizes see `SIZES`.

    Raises FilmError.
    """

    name: str
    body: int
    kind: str
    size: NDArray[np.float64]
    place: NDArray[np.float64]
    turn: NDArray[np.float64]
    colour: NDArray[np.float64]
    vertices: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), np.int64))

    def __post_init__(self) -> None:
        about = f"solid {self.name!r}"
        if self.kind not in SIZES:
            raise FilmError(f"{about}: kind: unknown kind {self.kind!r}{choices(self.kind, SIZES)}")
        for name, shape in (("size", (3,)), ("place", (3,)), ("turn", (4,)), ("colour", (4,))):
            _numbers(f"{about}: {name}", getattr(self, name), shape)
        needed = SIZES[self.kind]
        if not (self.size[:needed] > 0.0).all():
            raise FilmError(f"{about}: size: the first {needed} must be greater than 0, not {self.size}")
        _turns(f"{about}: turn", self.turn)
        if not ((self.colour >= 0.0) & (self.colour <= 1.0)).all():
            raise FilmError(f"{about}: colour: must be four numbers in 0..1, not {self.colour}")
        if self.kind == "mesh":
            _numbers(f"{about}: vertices", self.vertices, (None, 3))
            _within(f"{about}: faces", self.faces, (None, 3), len(self.vertices))


@dataclass(frozen=True)
class Touches:
    """Contact points of all frames, one row each, in the order of frames.

    `frame` and `pair` (k,) are numbers; `point`, `normal` and `force` (k, 3) are in the world's axes. The
    unit normal points from the first body of the pair to the second, and the force acts on the second.
    `friction` (k,) is the coefficient; `mode` (k,) is `OPEN`, `STICK` or `SLIP`.

    Raises FilmError.
    """

    frame: NDArray[np.int64]
    pair: NDArray[np.int64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    force: NDArray[np.float64]
    friction: NDArray[np.float64]
    mode: NDArray[np.int64]

    def __post_init__(self) -> None:
        count = len(self.frame)
        for name in ("point", "normal", "force"):
            _numbers(f"touches: {name}", getattr(self, name), (count, 3))
        _numbers("touches: friction", self.friction, (count,))
        _within("touches: mode", self.mode, (count,), 3)
        if (self.friction < 0.0).any():
            raise FilmError("touches: friction: must be at least 0")
        _turns("touches: normal", self.normal)

    @staticmethod
    def none() -> Touches:
        """No contact in any frame."""
        whole, number = np.zeros(0, np.int64), np.zeros((0, 3))
        return Touches(whole, whole, number, number, number, np.zeros(0), whole)

    def of(self, rows: NDArray[Any], frame: NDArray[np.int64]) -> Touches:
        """These rows, with these frames."""
        others = ("pair", "point", "normal", "force", "friction", "mode")
        return Touches(frame, **{name: getattr(self, name)[rows] for name in others})


@dataclass(frozen=True)
class Film:
    """A run in space, ready to be shown.

    `model` is the name of the rung, and `bodies` names the b bodies. `time` (f,) increases; `places`
    (f, b, 3) and `turns` (f, b, 4), quaternions w x y z, are the poses of the bodies. `pairs` names the p
    pairs of bodies that are known by `touches` and by the curves: `gaps` and `pushes` (f, p), the least gap,
    NaN where it is not known, and the normal force of each. `units` has the units of "length", "time" and
    "force", where they are known. `goal` (b, 7) are the places and turns that the goal wants of bodies, NaN
    where it wants none; without rows it wants none at all.

    Raises FilmError.
    """

    title: str
    model: str
    bodies: tuple[str, ...]
    solids: tuple[Solid, ...]
    time: NDArray[np.float64]
    places: NDArray[np.float64]
    turns: NDArray[np.float64]
    pairs: tuple[tuple[str, str], ...] = ()
    touches: Touches = field(default_factory=Touches.none)
    gaps: NDArray[np.float64] | None = None
    pushes: NDArray[np.float64] | None = None
    outcome: str = ""
    reason: str = ""
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    goal: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 7)))

    @property
    def wanted(self) -> list[int]:
        """Bodies of which the goal wants a pose."""
        found: list[int] = np.flatnonzero(np.isfinite(self.goal).all(axis=1)).tolist()
        return found

    def __post_init__(self) -> None:
        frames, bodies, pairs = len(self.time), len(self.bodies), len(self.pairs)
        _numbers("time", self.time, (None,))
        if frames == 0 or not (np.diff(self.time) > 0.0).all():
            raise FilmError("time: must be at least one moment, each later than the one before")
        _numbers("places", self.places, (frames, bodies, 3))
        _numbers("turns", self.turns, (frames, bodies, 4))
        _turns("turns", self.turns)
        for solid in self.solids:
            _within(f"solid {solid.name!r}: body", np.array([solid.body]), (1,), bodies)
        for pair in self.pairs:
            for name in pair:
                if name not in self.bodies:
                    raise FilmError(f"pairs: unknown body {name!r}{choices(name, self.bodies)}")
        _within("touches: frame", self.touches.frame, (None,), frames)
        _within("touches: pair", self.touches.pair, (len(self.touches.frame),), pairs)
        if (np.diff(self.touches.frame) < 0).any():
            raise FilmError("touches: frame: must not decrease")
        _shape("goal", self.goal, (bodies if len(self.goal) else 0, 7))
        if self.gaps is not None:
            _numbers("gaps", np.nan_to_num(self.gaps, nan=0.0), (frames, pairs))
        if self.pushes is not None:
            _numbers("pushes", self.pushes, (frames, pairs))

    def moving(self) -> NDArray[np.bool_]:
        """For each body (b,) whether its pose ever changes."""
        found: NDArray[np.bool_] = np.ptp(self.places, axis=0).any(axis=1) | np.ptp(self.turns, axis=0).any(
            axis=1
        )
        return found

    def thinned(self, frames: NDArray[np.int64]) -> Film:
        """The film with these frames only."""
        new = np.full(len(self.time), -1)
        new[frames] = np.arange(len(frames))
        kept = new[self.touches.frame] >= 0
        return replace(
            self,
            time=self.time[frames],
            places=self.places[frames],
            turns=self.turns[frames],
            touches=self.touches.of(kept, new[self.touches.frame[kept]]),
            gaps=None if self.gaps is None else self.gaps[frames],
            pushes=None if self.pushes is None else self.pushes[frames],
        )


def _shape(name: str, values: object, shape: tuple[int | None, ...]) -> NDArray[Any]:
    wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
    if not isinstance(values, np.ndarray):
        raise FilmError(f"{name}: must be an array of shape {wanted}, not {type(values).__name__}")
    same = len(values.shape) == len(shape) and all(
        n is None or n == m for n, m in zip(shape, values.shape, strict=True)
    )
    if not same:
        raise FilmError(f"{name}: must have the shape {wanted}, not {values.shape}")
    return values


def _numbers(name: str, values: object, shape: tuple[int | None, ...]) -> None:
    if not np.isfinite(_shape(name, values, shape)).all():
        raise FilmError(f"{name}: must be finite numbers")


def _within(name: str, values: object, shape: tuple[int | None, ...], count: int) -> None:
    """Whole numbers in 0..count - 1."""
    found = _shape(name, values, shape)
    if not np.issubdtype(found.dtype, np.integer) or ((found < 0) | (found >= count)).any():
        raise FilmError(f"{name}: must be whole numbers at least 0 and below {count}")


def _turns(name: str, values: NDArray[np.float64]) -> None:
    """Unit vectors along the last axis."""
    if (np.abs(np.linalg.norm(values, axis=-1) - 1.0) > UNIT).any():
        raise FilmError(f"{name}: must have length 1")
