"""First-order changes of the data that a step assembles, by its start, its inputs and parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from rungwise.contact.analysis import DATA
from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.simulation.derivatives.steps import MEMORY, Array, Data, Held, Start, Steps
from rungwise.simulation.options import ModelError

KINDS = ("q", "v", "deformation", "inputs", "parameters")
STATE = ("q", "v", "deformation", *MEMORY)
"""Kinds of unknowns that a step hands on to the next."""
_STEP = 1e-5
"""Change of an unknown, over its size or the smallest shape's reach, to both sides: near 6e-6, the cube root
of double precision, where rounding and curvature err alike in central differences."""

_ROUNDED = 1e-7
"""Rounding of data, over their size and over the part of changes by which redundant contacts may disagree
(`_NOISE` of `contact.analysis.sensitivity`): a few roundings of double precision."""

_BLOCK = 16
"""Ways along which changes are held at once: some megabytes where a hundred bodies are piled up."""

_ENDLESS = {"F", "stiffness", "damping"}
"""Fields that may be infinite."""

Change: TypeAlias = tuple[Data, Data]
"""Changes of data, and the sizes of what they are differences of."""


class Block(NamedTuple):
    """Changes of some of the data along a few ways, the sizes of what they are differences of, and the parts
    (few, m) that these ways have in the directions."""

    change: Data
    size: Data
    by: Array


class Base(NamedTuple):
    """A problem whose data are differenced: its choices, start, trial speeds, and data."""

    held: Held
    start: Start
    trial: Array | None
    data: Data


class Changes:
    """Differences of the data that a step assembles.

    Assemblies of other parameters are made once, and serve all steps. Raises TimeOver where the deadline has
    come.
    """

    def __init__(
        self, here: Steps, scene: Any, model: Rung | str, values: dict[str, float],
        names: tuple[str, ...], deadline: Deadline,
    ) -> None:  # fmt: skip
        self.here, self.names, self.deadline = here, names, deadline
        self._scene, self._model, self._values = scene, model, values

    @cached_property
    def varied(self) -> list[list[tuple[float, Steps]]]:
        """For each parameter two changes of it, and the steps at these."""
        return [self._two_beside(name) for name in self.names]

    def _two_beside(self, name: str) -> list[tuple[float, Steps]]:
        self.deadline.look()
        values, value = self._values, self._values[name]
        low, high = self._scene.file.parameters[name].range or (-np.inf, np.inf)
        size = _STEP * (abs(value) or min(1.0, high - low))
        nodes = (-1.0, 1.0)
        if value - size < low or value + size > high:
            side = 1.0 if value - size < low else -1.0
            nodes = (side, 2.0 * side)
        return [
            (s * size, self.here.like(self._scene, self._model, {**values, name: value + s * size}))
            for s in nodes
        ]

    def size(self, kind: str) -> int:
        """Number of unknowns of a kind."""
        if kind == "parameters":
            return len(self.names)
        if kind in ("deformation", *MEMORY):
            return int(getattr(self.here.begun, kind).size)
        return len(self.here.lever)

    def label(self, kind: str, i: int) -> str:
        """What unknown i of a kind is called."""
        if kind == "parameters":
            return self.names[i]
        return kind if kind in ("deformation", *MEMORY) else self.here.named(kind, i)

    def begins(self) -> tuple[Array, Array]:
        """Change (n, p) of the coordinates and speeds with which the scene begins, by each parameter."""
        here, base = self.here, np.zeros(2 * len(self.here.lever))
        columns = []
        for samples in self.varied:
            low, high = (
                (s, np.concatenate([here.apart(here.begun.q, at.begun.q), at.begun.v - here.begun.v]))
                for s, at in samples
            )
            columns.append(_slope(low, high, base))
        dq, dv = np.array(columns).reshape(-1, 2, len(here.lever)).transpose(1, 2, 0)
        return dq, dv

    def blocks(self, base: Base, directions: dict[str, Array], labels: Sequence[str]) -> Iterator[Block]:
        """Changes along a few ways at a time; by "trial", the unknowns are the speeds of the trial. Raises
        ModelError naming the unknown, or the direction by its label (m,), along which a contact changes its
        feature, and TimeOver."""
        here = self.here
        moving = {kind: by for kind, by in directions.items() if kind != "parameters"}
        if "inputs" in moving:
            forces, moving["inputs"] = moving["inputs"][here.free], moving["inputs"].copy()
            moving["inputs"][here.free] = 0.0
            if here.rung[0]["loads"]:
                unit = np.eye(len(here.free))
                yield Block({"c": unit}, {"c": unit}, forces)
        if moving:
            yield from self._by_state(base, moving, labels)
        if "parameters" in directions:
            moved = np.flatnonzero(directions["parameters"].any(axis=1))
            ways = [(self.names[i], partial(self._by_parameter, base, int(i))) for i in moved]
            yield from self._blocks(ways, directions["parameters"][moved])

    def _by_state(self, base: Base, moving: dict[str, Array], labels: Sequence[str]) -> Iterator[Block]:
        """Changes by all unknowns but parameters: by each that moves alone, or along each direction,
        whichever are fewer."""
        moved = {kind: np.flatnonzero(by.any(axis=1)) for kind, by in moving.items()}
        whole = np.vstack([by[moved[kind]] for kind, by in moving.items()])
        columns = np.flatnonzero(whole.any(axis=0)).tolist()
        if len(whole) <= len(columns):
            vectors, by = np.eye(len(whole)), whole
            names = [self.label(kind, int(i)) for kind, own in moved.items() for i in own]
        else:
            vectors, by = whole.T[columns], np.eye(whole.shape[1])[columns]
            names = [labels[j] if labels else f"direction {j}" for j in columns]
        sizes = np.concatenate([self._sizes(kind, base.start)[own] for kind, own in moved.items()])
        ways = []
        for name, vector in zip(names, vectors, strict=True):
            way, at = dict[str, Array](), 0
            for kind, own in moved.items():
                way[kind] = np.zeros(self.size(kind))
                way[kind][own] = vector[at : at + len(own)]
                at += len(own)
            far = 1.0 / float((np.abs(vector) / sizes).max())
            ways.append((name, partial(self._by_way, base, way, far)))
        yield from self._blocks(ways, by)

    def _blocks(self, ways: Sequence[tuple[str, Callable[[], Change]]], by: Array) -> Iterator[Block]:
        """Changes along named ways, of which directions have the parts `by` (ways, m)."""
        for first in range(0, len(ways), _BLOCK):
            own = slice(first, first + _BLOCK)
            change, size = zip(*(self._named(*way) for way in ways[own]), strict=True)
            yield Block(_stacked(change), _stacked(size), by[own])

    def _named(self, name: str, change: Callable[[], Change]) -> Change:
        """A change; ModelErrors name the way."""
        self.deadline.look()
        try:
            return change()
        except ModelError as error:
            raise ModelError(f"{error} (by {name})") from None

    def _by_parameter(self, base: Base, i: int) -> Change:
        samples = [(s, at.data(base.held, base.start, base.trial)) for s, at in self.varied[i]]
        return self._differenced(base, *samples)

    def _by_way(self, base: Base, way: dict[str, Array], far: float) -> Change:
        """The change along a way by kinds of unknowns, from data so many times it to either side."""
        here = self.here
        low, high = ((s, here.data(base.held, *self._moved(base, way, s))) for s in (-far, far))
        lead = float(np.abs(here.lever * way["q"]).max()) if "q" in way else 0.0
        if lead > 0.0:
            here.look_for_bends(base.held, low[1], high[1], base.data, far * lead)
        return self._differenced(base, low, high)

    def _differenced(self, base: Base, low: tuple[float, Data], high: tuple[float, Data]) -> Change:
        """The change of the data from two samples, by what these are counted in."""
        here, data = self.here, base.data
        change = {
            name: _slope((low[0], low[1][name]), (high[0], high[1][name]), data[name])
            for name in data if name not in _ENDLESS
        }  # fmt: skip
        for name in _ENDLESS:
            finite = np.isfinite(data[name])
            change[name] = np.zeros(data[name].shape)
            change[name][finite] = (high[1][name][finite] - low[1][name][finite]) / (high[0] - low[0])
        normal, span = slice(None, None, here.begun.deformation.shape[1]), abs(high[0] - low[0])
        change["w"][normal] += np.where(base.held.bounced, 0.0, change.pop("gap") / here.h)
        rounded = _ROUNDED / span
        size = {name: np.abs(change[name]) for name in DATA}
        for name in size.keys() - _ENDLESS:
            size[name] += rounded * np.abs(data[name])
        size["w"][normal] += rounded * here.reach / here.h
        return change, size

    def _sizes(self, kind: str, start: Start) -> Array:
        """By how much the unknowns of a kind are changed."""
        reach, lever = self.here.reach, self.here.lever
        if kind == "q":
            return _STEP * reach / lever
        if kind == "deformation":
            return np.full(start.deformation.size, _STEP * reach)
        if kind in MEMORY:
            size: Array = _STEP * np.maximum(np.abs(getattr(start, kind)), 1.0)
            return size
        fastest = float(np.abs(lever * start.v).max(initial=0.0))
        return _STEP * max(fastest, 1e-3 * reach / self.here.h) / lever

    def _moved(
        self, base: Base, way: dict[str, Array], far: float
    ) -> tuple[Start, Array | None, Array | None]:
        """The start, the trial and the faster inputs so many times a way from the base."""
        start, trial = base.start, base.trial
        for kind in STATE:
            if kind in way and way[kind].any():
                start = self.here.moved(start, kind, far * way[kind])
        if trial is not None and "trial" in way:
            trial = trial + far * way["trial"]
        return start, trial, far * way["inputs"] if "inputs" in way else None


def _stacked(each: Sequence[Data]) -> Data:
    """Data with directions as last axis."""
    return {name: np.stack([one[name] for one in each], axis=-1) for name in each[0]}


def _slope(low: tuple[float, Array], high: tuple[float, Array], base: Array) -> Array:
    """The slope of the parabola through the base and both samples; the chord when they lie alike about it."""
    (s, below), (t, above) = low, high
    if s == -t:
        return (above - below) / (t - s)
    return ((below - base) * t / s - (above - base) * s / t) / (t - s)
