"""A tree of cells that is fine only where labels change.

Places are integers: a box has 2^finest units along each axis, a cell of level l has 2^(finest - l) of them.
Every cell has labels at its corners; one whose corners differ is split until it is of the target level. A
cell whose corners agree is split, too, where a finer neighbour shows another label on its surface, where a
probe inside it has another label, and, on the coarse levels, where margins would change sign within it.

A tree may begin as another tree, with labels that are only borrowed: the corners of its finest mixed cells
are asked for, and the corners of every cell that is split or becomes mixed, until every corner that shows a
boundary is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals

Oracle = Callable[[Reals], tuple[Ints, Reals]]
"""Places (m, d) in units -> labels (m,) and signed margins (m,), nan where unknown."""

FIRST_LEVEL = (0, 5, 4, 3, 2, 1, 1)
"""Level of the grid that is evaluated whole, by the number of axes."""
MARGIN_LEVELS = 2
"""On so many levels margins alone may split a cell."""


class BudgetSpent(Exception):
    """The next step of the refinement would take more evaluations than are allowed."""


@dataclass
class Vertices:
    """Labels and margins of the vertices known so far, sorted by key, and which of them are only borrowed."""

    axes: int
    finest: int
    keys: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    labels: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    margins: Reals = field(default_factory=lambda: np.zeros(0))
    borrowed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    def key(self, places: Ints) -> Ints:
        """Keys (...,) of places (..., d)."""
        side = (1 << self.finest) + 1
        return np.asarray(places @ side ** np.arange(self.axes, dtype=np.int64))

    def places(self, keys: Ints) -> Ints:
        """Places (m, d) of keys (m,)."""
        side = (1 << self.finest) + 1
        return np.stack([keys // side**i % side for i in range(self.axes)], axis=-1)

    def find(self, keys: Ints) -> tuple[Ints, NDArray[np.bool_]]:
        """Index of each key, and whether it is there."""
        at = np.minimum(np.searchsorted(self.keys, keys), max(len(self.keys) - 1, 0))
        return at, self.keys[at] == keys if len(self.keys) else np.zeros(keys.shape, bool)

    def learn(self, places: Ints, oracle: Oracle) -> Ints:
        """Ask for the places (..., d) that are not known, or borrowed; returns their keys."""
        keys = np.unique(self.key(places))
        at, there = self.find(keys)
        there[there] = ~self.borrowed[at[there]]
        wanted = keys[~there]
        if len(wanted):
            labels, margins = oracle(self.places(wanted).astype(np.float64))
            self._forget(wanted)
            at = np.searchsorted(self.keys, wanted)
            self.keys = np.insert(self.keys, at, wanted)
            self.labels = np.insert(self.labels, at, labels)
            self.margins = np.insert(self.margins, at, margins)
            self.borrowed = np.insert(self.borrowed, at, False)
        return wanted

    def _forget(self, keys: Ints) -> None:
        """Drop the vertices of these keys, where known."""
        kept = ~np.isin(self.keys, keys)
        self.keys, self.labels = self.keys[kept], self.labels[kept]
        self.margins, self.borrowed = self.margins[kept], self.borrowed[kept]


@dataclass
class Tree:
    """Leaves by level: origins (m, d) in units, sorted by key."""

    axes: int
    target: int
    finest: int
    vertices: Vertices
    leaves: list[Ints]
    corners: Ints
    spent: bool = False

    @classmethod
    def empty(cls, axes: int, target: int, finest: int) -> Tree:
        none = [np.zeros((0, axes), np.int64) for _ in range(finest + 1)]
        corners = np.array(list(product((0, 1), repeat=axes)), np.int64)
        return cls(axes, target, finest, Vertices(axes, finest), none, corners)

    def size(self, level: int) -> int:
        """Side of a cell, in units."""
        return 1 << (self.finest - level)

    def corner_labels(self, origins: Ints, level: int) -> tuple[Ints, Reals]:
        """Labels and margins (m, 2^d) at the corners of cells."""
        keys = self.vertices.key(origins[:, None, :] + self.size(level) * self.corners)
        at, _ = self.vertices.find(keys)
        return self.vertices.labels[at], self.vertices.margins[at]

    def is_mixed(self, origins: Ints, level: int) -> NDArray[np.bool_]:
        """Which cells have different labels at their corners."""
        found, _ = self.corner_labels(origins, level)
        return np.asarray((found != found[:, :1]).any(axis=1))

    def locate(self, places: Reals) -> tuple[Ints, Ints]:
        """Level and index among the leaves of that level of the leaf that holds each place (m, d)."""
        unit = np.clip(np.floor(places), 0, (1 << self.finest) - 1).astype(np.int64)
        level_of, index_of = np.full(len(places), -1, np.int64), np.full(len(places), -1, np.int64)
        for level, origins in enumerate(self.leaves):
            if not len(origins):
                continue
            keys = self.vertices.key(origins)
            wanted = self.vertices.key(unit // self.size(level) * self.size(level))
            at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            here = keys[at] == wanted
            level_of[here], index_of[here] = level, at[here]
        return level_of, index_of

    def grow(self, oracle: Oracle) -> None:
        """Refine from the first level."""
        first = min(FIRST_LEVEL[self.axes], self.target)
        sides = np.arange(1 << first, dtype=np.int64) * self.size(first)
        origins = np.stack(np.meshgrid(*[sides] * self.axes, indexing="ij"), axis=-1).reshape(-1, self.axes)
        self.vertices.learn(origins[:, None, :] + self.size(first) * self.corners, oracle)
        self._refine(origins, first, oracle, first + MARGIN_LEVELS)

    def grow_around(self, other: Tree, oracle: Oracle) -> None:
        """Refine from the cells of another tree over the same box, down to the target level: where the other
        tree is mixed, and where the boundary leads from there."""
        self.leaves[: self.target] = other.leaves[: self.target]
        fine = np.concatenate(other.leaves[self.target :])
        side = self.size(self.target)
        self._add(np.unique(fine // side * side, axis=0), self.target)
        known = other.vertices
        self.vertices = Vertices(
            self.axes, self.finest, known.keys, known.labels, known.margins, np.ones(len(known.keys), bool)
        )
        self._settle(oracle)

    def _settle(self, oracle: Oracle, cells: Ints | None = None) -> None:
        """Ask for borrowed corners of the cells, and of mixed cells, of the target level, and mend, until
        none are borrowed."""
        while not self.spent:
            mixed = self.leaves[self.target]
            mixed = mixed[self.is_mixed(mixed, self.target)]
            if cells is not None:
                mixed = np.concatenate([mixed, cells])
            try:
                asked = self.vertices.learn(mixed[:, None, :] + self.size(self.target) * self.corners, oracle)
            except BudgetSpent:
                self.spent = True
                return
            before = len(self.vertices.keys)
            self._mend(oracle)
            if not len(asked) and len(self.vertices.keys) == before:
                return

    def split(self, level: int, chosen: NDArray[np.bool_], oracle: Oracle) -> None:
        """Split the chosen leaves of a level, and refine their children."""
        children = self._children(self.leaves[level][chosen], level)
        try:
            self.vertices.learn(children[:, None, :] + self.size(level + 1) * self.corners, oracle)
        except BudgetSpent:
            self.spent = True
            return
        self.leaves[level] = self.leaves[level][~chosen]
        self._refine(children, level + 1, oracle, 0)

    def probe(self, places: Reals, oracle: Oracle) -> None:
        """Refine down to the target level around places (m, d), whose labels their leaves lack."""
        for level in range(self.target):
            levels, index = self.locate(places)
            chosen = np.zeros(len(self.leaves[level]), bool)
            chosen[index[levels == level]] = True
            if chosen.any():
                self.split(level, chosen, oracle)
        levels, index = self.locate(places)
        cells = self.leaves[self.target][index[levels == self.target]]
        self._settle(oracle, cells)

    def _children(self, origins: Ints, level: int) -> Ints:
        return np.asarray((origins[:, None, :] + self.size(level + 1) * self.corners).reshape(-1, self.axes))

    def _refine(self, origins: Ints, level: int, oracle: Oracle, margins_below: int) -> None:
        """Sort cells whose corners are known into leaves, then split leaves whose neighbours show another
        label."""
        self._sort(origins, level, oracle, margins_below)
        self._mend(oracle)

    def _sort(self, origins: Ints, level: int, oracle: Oracle, margins_below: int = 0) -> None:
        """Make leaves of cells whose corners are known, level by level."""
        while len(origins):
            if level >= self.target:
                self._add(origins, level)
                break
            split = self.is_mixed(origins, level)
            if level < margins_below:
                split |= self._may_change_sign(origins, level)
            children = self._children(origins[split], level)
            if len(children):
                try:
                    self.vertices.learn(children[:, None, :] + self.size(level + 1) * self.corners, oracle)
                except BudgetSpent:
                    self.spent = True
                    split[:] = False
                    children = children[:0]
            self._add(origins[~split], level)
            origins, level = children, level + 1

    def _may_change_sign(self, origins: Ints, level: int) -> NDArray[np.bool_]:
        """Whether the margin, which has one sign at the corners, would change it half a cell further."""
        _, margins = self.corner_labels(origins, level)
        spread = np.ptp(margins, axis=1)
        return np.asarray(np.isfinite(spread) & (np.abs(margins).min(axis=1) < 0.5 * spread))

    def _add(self, origins: Ints, level: int) -> None:
        joined = np.concatenate([self.leaves[level], origins])
        self.leaves[level] = joined[np.argsort(self.vertices.key(joined), kind="stable")]

    def _mend(self, oracle: Oracle) -> None:
        """Split leaves on whose surface a vertex of a neighbour has another label, until none are left."""
        checked = np.zeros(0, np.int64)
        while not self.spent:
            keys = np.setdiff1d(self.vertices.keys, checked)
            checked = self.vertices.keys
            if not len(keys):
                return
            at, _ = self.vertices.find(keys)
            labels, places = self.vertices.labels[at], self.vertices.places(keys)
            marks = [np.zeros(len(origins), bool) for origins in self.leaves]
            for corner in self.corners:
                near = (places - corner).astype(np.float64)
                inside = ((near >= 0) & (near < 1 << self.finest)).all(axis=1)
                levels, index = self.locate(near)
                for level in range(self.target):
                    here = inside & (levels == level)
                    if here.any():
                        own, _ = self.corner_labels(self.leaves[level][index[here]], level)
                        marks[level][index[here][own[:, 0] != labels[here]]] = True
            wrong = [(level, mark) for level, mark in enumerate(marks) if mark.any()]
            if not wrong:
                return
            children: list[tuple[int, Ints]] = []
            try:
                for level, mark in wrong:
                    cells = self._children(self.leaves[level][mark], level)
                    self.vertices.learn(cells[:, None, :] + self.size(level + 1) * self.corners, oracle)
                    children.append((level, cells))
            except BudgetSpent:
                self.spent = True
            for level, _ in children:
                self.leaves[level] = self.leaves[level][~marks[level]]
            for level, cells in children:
                self._sort(cells, level + 1, oracle)
