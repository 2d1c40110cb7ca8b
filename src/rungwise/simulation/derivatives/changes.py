"""First-order changes of a step's data by each unknown of the start, each input and each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rungwise.contact.analysis import DATA
from rungwise.content import ByContent
from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.plain import brief
from rungwise.simulation.derivatives.steps import Array, Data, Held, Start, Steps
from rungwise.simulation.options import ModelError

KINDS = ("q", "v", "deformation", "inputs", "parameters")
_STEP = 1e-5
"""Change of an unknown, over its size or the smallest shape's reach, to both sides: near 6e-6, the cube root
of double precision, where rounding and curvature err alike in central differences."""

_ROUNDED = 1e-7
"""Rounding of data, over their size and over the part of changes by which redundant contacts may disagree
(`_NOISE` of `contact.analysis.sensitivity`): a few roundings of double precision."""

_BLOCK = 16
"""Unknowns whose changes are held at once: some megabytes where a hundred bodies are piled up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EndSensitivity(ByContent):
    """The state `q`, `v` (n,) that steps lead to, and the derivatives dq, dv (n, m) by kind of unknown: "q",
    "v" and "deformation" at the start, "inputs", and "parameters" in the order of `names`. NaN where nothing
    determines the derivative."""

    q: Array
    v: Array
    dq: dict[str, Array]
    dv: dict[str, Array]
    names: tuple[str, ...]

    __repr__ = brief


class Block(NamedTuple):
    """Changes of the data with a few unknowns, the sizes of what they are differences of, and the rows (few,
    m) of these unknowns in the directions."""

    change: Data
    size: Data
    by: Array


class Changes:
    """Differences of the data that a step assembles, by each of the kinds asked for.

    Assemblies of other parameters are made once, and serve all steps. Raises TimeOver where the deadline has
    come.
    """

    def __init__(
        self, here: Steps, scene: Any, model: Rung | str, values: dict[str, float],
        names: tuple[str, ...], kinds: Sequence[str], deadline: Deadline,
    ) -> None:  # fmt: skip
        self.here, self.names, self.kinds = here, names, tuple(kind for kind in KINDS if kind in kinds)
        self.deadline = deadline
        self.varied: list[list[tuple[float, Steps]]] = []
        for name in names if "parameters" in kinds else ():
            deadline.look()
            declared = scene.file.parameters[name]
            low, high = declared.range or (-np.inf, np.inf)
            size = _STEP * (abs(values[name]) or min(1.0, high - low))
            nodes = (-1.0, 1.0)
            if values[name] - size < low or values[name] + size > high:
                side = 1.0 if values[name] - size < low else -1.0
                nodes = (side, 2.0 * side)
            self.varied.append(
                [
                    (s * size, here.like(scene, model, {**values, name: values[name] + s * size}))
                    for s in nodes
                ]
            )

    def size(self, kind: str) -> int:
        """Number of unknowns of a kind."""
        if kind == "parameters":
            return len(self.varied)
        slots, d = self.here.shape
        return slots * d if kind == "deformation" else len(self.here.lever)

    def blocks(
        self, held: Held, start: Start, trial: Array | None, directions: dict[str, Array]
    ) -> Iterator[Block]:
        """Changes with a few unknowns at a time; by "trial", the unknowns are the speeds of the trial. Raises
        ModelError naming the unknown with which a contact changes its feature, and TimeOver."""
        base = self.here.data(held, start, trial)
        for kind, by in directions.items():
            moved = np.flatnonzero(by.any(axis=1))
            for first in range(0, len(moved), _BLOCK):
                block = moved[first : first + _BLOCK]
                each = [self._change(kind, int(i), held, start, trial, base) for i in block]
                change, size = (_stacked([one[k] for one in each]) for k in range(2))
                yield Block(change, size, by[block])

    def begins(self) -> tuple[Array, Array]:
        """Change (n, p) of the coordinates and speeds with which the scene begins, by each parameter."""
        n = len(self.here.lever)
        dq, dv = np.zeros((2, n, len(self.varied)))
        for i, samples in enumerate(self.varied):
            for change, k in ((dq, 0), (dv, 1)):
                ends = [(s, at.begun[k]) for s, at in samples]
                change[:, i] = _slope(ends[0], ends[1], self.here.begun[k])
        return dq, dv

    def _change(
        self, kind: str, i: int, held: Held, start: Start, trial: Array | None, base: Data
    ) -> tuple[Data, Data]:
        """The change of the data with an unknown, and the sizes of what it is a difference of. Raises
        ModelError naming the unknown."""
        self.deadline.look()
        try:
            return self._differenced(kind, i, held, start, trial, base)
        except ModelError as error:
            name = self.names[i] if kind == "parameters" else self.here.named(kind, i)
            raise ModelError(f"{error} (by {name})") from None

    def _differenced(
        self, kind: str, i: int, held: Held, start: Start, trial: Array | None, base: Data
    ) -> tuple[Data, Data]:
        """See `_change`."""
        here = self.here
        if kind == "parameters":
            samples = [(s, at.data(held, start, trial)) for s, at in self.varied[i]]
        elif kind == "inputs" and i in here.free:
            change = {name: np.zeros_like(value) for name, value in base.items() if name != "gap"}
            if here.rung[0]["loads"]:
                change["c"] += here.free == i
            return change, {name: np.abs(change[name]) for name in DATA}
        else:
            by = self._size(kind, i, start)
            samples = [(s, here.data(held, *self._moved(kind, i, s, start, trial))) for s in (-by, by)]
            if kind == "q":
                here.look_for_bends(held, samples[0][1], samples[1][1], base, by * float(here.lever[i]))
        low, high = samples
        change = {
            name: _slope((low[0], low[1][name]), (high[0], high[1][name]), base[name])
            for name in base if name not in _ENDLESS
        }  # fmt: skip
        for name in _ENDLESS:
            finite = np.isfinite(base[name])
            change[name] = np.zeros(base[name].shape)
            change[name][finite] = (high[1][name][finite] - low[1][name][finite]) / (high[0] - low[0])
        normal, span = slice(None, None, here.shape[1]), abs(high[0] - low[0])
        change["w"][normal] += np.where(held.bounced, 0.0, change.pop("gap") / here.h)
        rounded = _ROUNDED / span
        size = {name: np.abs(change[name]) for name in DATA}
        for name in size.keys() - _ENDLESS:
            size[name] += rounded * np.abs(base[name])
        size["w"][normal] += rounded * here.reach / here.h
        return change, size

    def _size(self, kind: str, i: int, start: Start) -> float:
        reach, lever = self.here.reach, self.here.lever
        if kind == "q":
            return float(_STEP * reach / lever[i])
        if kind == "deformation":
            return _STEP * reach
        fastest = float(np.abs(lever * start.v).max(initial=0.0))
        return float(_STEP * max(fastest, 1e-3 * reach / self.here.h) / lever[i])

    def _moved(
        self, kind: str, i: int, s: float, start: Start, trial: Array | None
    ) -> tuple[Start, Array | None, Array | None]:
        """The start, the trial and the faster inputs when one unknown is changed by s."""
        one = np.zeros(self.size(kind))
        one[i] = s
        if kind == "trial":
            assert trial is not None
            return start, trial + one, None
        if kind == "inputs":
            return start, trial, one
        return self.here.moved(start, kind, one), trial, None


def _stacked(each: Sequence[Data]) -> Data:
    """Data with directions as last axis."""
    return {name: np.stack([one[name] for one in each], axis=-1) for name in each[0]}


_ENDLESS = {"F", "stiffness", "damping"}
"""Fields that may be infinite."""


def _slope(low: tuple[float, Array], high: tuple[float, Array], base: Array) -> Array:
    """The slope of the parabola through the base and both samples; the chord when they lie alike about it."""
    (s, below), (t, above) = low, high
    if s == -t:
        return (above - below) / (t - s)
    return ((below - base) * t / s - (above - base) * s / t) / (t - s)
