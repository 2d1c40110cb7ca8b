"""First-order changes of a step's data by each unknown of the start, each input and each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.plain import brief
from rungwise.scene import Scene
from rungwise.scene.template.records import FREE, HINGE
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.derivatives.assembly import Assembly, Held, Start

Array: TypeAlias = NDArray[np.float64]
Data: TypeAlias = dict[str, Array]
"""Fields of the problem, and `speed`, `stiffness`, `damping`; in changes, directions are the last axis."""
KINDS = ("q", "v", "deformation", "inputs", "parameters")
_STEP = 1e-5
"""Change of an unknown, over its size or the smallest shape's reach, to both sides: near 6e-6, the cube root
of double precision, where rounding and curvature err alike in central differences."""

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


class Changes:
    """Differences of the data that a step assembles, by each of the kinds asked for.

    Assemblies of other parameters are made once, and serve all steps. Raises TimeOver where the deadline has
    come.
    """

    def __init__(
        self, here: Assembly, scene: Scene, model: Rung | str, values: dict[str, float],
        names: tuple[str, ...], kinds: Sequence[str], deadline: Deadline,
    ) -> None:  # fmt: skip
        self.here, self.names, self.kinds = here, names, tuple(kind for kind in KINDS if kind in kinds)
        self.deadline = deadline
        n, extent = len(here.state.q), float(here.workspace.terms.rounding[0]) / ROUNDING
        reach = float(here.state.clock[0]["reach"]) or extent or 1.0
        bodies = here.records.bodies
        first = bodies["coordinate"]
        angles = [*first[bodies["motion"] == HINGE], *(first[bodies["motion"] == FREE] + 2)]
        self.reach = reach
        self.lever = np.where(np.isin(np.arange(n), angles), reach, 1.0)
        self.varied: list[list[tuple[float, Assembly]]] = []
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
        return self.here.state.deformation.size if kind == "deformation" else len(self.here.state.q)

    def blocks(
        self, held: Held, start: Start, trial: Array | None, directions: dict[str, Array]
    ) -> Iterator[tuple[Data, Array]]:
        """For a few unknowns at a time, the change of the data with each, and their rows (few, m) of the
        directions; by "trial", the unknowns are the speeds of the trial. Raises TimeOver."""
        base = self.here.data(held, start, trial)
        for kind, by in directions.items():
            moved = np.flatnonzero(by.any(axis=1))
            for first in range(0, len(moved), _BLOCK):
                block = moved[first : first + _BLOCK]
                each = [self._change(kind, int(i), held, start, trial, base) for i in block]
                data = {name: np.stack([one[name] for one in each], axis=-1) for name in each[0]}
                yield data, by[block]

    def begins(self) -> tuple[Array, Array]:
        """Change (n, p) of the coordinates and speeds with which the scene begins, by each parameter."""
        n = len(self.here.state.q)
        dq, dv = np.zeros((2, n, len(self.varied)))
        for i, samples in enumerate(self.varied):
            for change, k in ((dq, 0), (dv, 1)):
                ends = [(s, at.begun[k]) for s, at in samples]
                change[:, i] = _slope(ends[0], ends[1], self.here.begun[k])
        return dq, dv

    def _change(self, kind: str, i: int, held: Held, start: Start, trial: Array | None, base: Data) -> Data:
        self.deadline.look()
        here = self.here
        prescribed = kind == "inputs" and bool(here.state.prescribed[i])
        if kind == "parameters":
            samples = [(s, at.data(held, start, trial)) for s, at in self.varied[i]]
        elif kind == "inputs" and not prescribed:
            change = {name: np.zeros_like(value) for name, value in base.items() if name != "gap"}
            if here.rung[0]["loads"]:
                change["c"] += here.state.free[: len(base["c"])] == i
            return change
        else:
            size = self._size(kind, i, start)
            samples = [(s, here.data(held, *self._moved(kind, i, s, start, trial))) for s in (-size, size)]
        low, high = samples
        change = {
            name: _slope((low[0], low[1][name]), (high[0], high[1][name]), base[name])
            for name in base if name not in _ENDLESS
        }  # fmt: skip
        for name in _ENDLESS:
            finite = np.isfinite(base[name])
            change[name] = np.zeros(base[name].shape)
            change[name][finite] = (high[1][name][finite] - low[1][name][finite]) / (high[0] - low[0])
        change["w"][::2] += np.where(held.bounced, 0.0, change.pop("gap") / here.h)
        return change

    def _size(self, kind: str, i: int, start: Start) -> float:
        if kind == "q":
            return float(_STEP * self.reach / self.lever[i])
        if kind == "deformation":
            return _STEP * self.reach
        fastest = float(np.abs(self.lever * start.v).max(initial=0.0))
        return float(_STEP * max(fastest, 1e-3 * self.reach / self.here.h) / self.lever[i])

    def _moved(
        self, kind: str, i: int, s: float, start: Start, trial: Array | None
    ) -> tuple[Start, Array | None, Array | None]:
        """The start, the trial and the faster inputs when one unknown is changed by s."""
        one = np.zeros(self.size(kind) if kind != "trial" else len(start.q))
        one[i] = s
        if kind == "trial":
            assert trial is not None
            return start, trial + one, None
        if kind == "inputs":
            return start, trial, one
        return start.moved(kind, one), trial, None


_ENDLESS = ("F", "stiffness", "damping")
"""Fields that may be infinite."""


def _slope(low: tuple[float, Array], high: tuple[float, Array], base: Array) -> Array:
    """The slope of the parabola through the base and both samples; the chord when they lie alike about it."""
    (s, below), (t, above) = low, high
    if s == -t:
        return (above - below) / (t - s)
    return ((below - base) * t / s - (above - base) * s / t) / (t - s)
