"""Backward reachability over a grid of cells, each with boxes of cells that it may lead to."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, kernel

Flags = NDArray[np.bool_]
CLOSE = 1e-9
"""An image that passes a cell's side by less than this part of the cell does not enter the next one."""


def around(values: NDArray[np.float64], padding: int, greatest: bool) -> NDArray[np.float64]:
    """Least or greatest (n1, ..., nd, k) of the values (n1 + 1, ..., nd + 1, k) at the vertices of each cell
    and of the cells within `padding` cells; nan is left out, and returned where there is nothing else."""
    for axis in range(values.ndim - 1):
        width = [(padding, padding) if k == axis else (0, 0) for k in range(values.ndim)]
        padded = np.pad(values, width, constant_values=np.nan)
        count = values.shape[axis] - 1
        shifted = [padded.take(range(k, k + count), axis) for k in range(2 + 2 * padding)]
        values = (np.fmax if greatest else np.fmin).reduce(shifted)
    return values


def backward(reaches: Flags, allowed: Flags, first: Ints, last: Ints, deadline: Deadline = NEVER) -> Flags:
    """The cells (n1, ..., nd) that reach cells where `reaches` holds, on a way through `allowed` cells.
    Raises TimeOver where the deadline has come.

    Cell c, counted in C order, may lead to the boxes first[c, u]..last[c, u] (both (cells, boxes, d)) of
    cells, for each u; a box with first > last is empty.
    """
    shape = np.array(reaches.shape, np.int64)
    signs, steps = _corners(shape)
    reached = (reaches & allowed).astype(np.int64).ravel()
    open_ = np.flatnonzero(allowed.ravel() & (reached == 0))
    while len(open_):
        deadline.look()
        table = np.zeros(shape + 1, np.int64)
        inner = reached.reshape(reaches.shape)
        for axis in range(inner.ndim):
            inner = inner.cumsum(axis)
        table[(slice(1, None),) * inner.ndim] = inner
        found = np.zeros(len(open_), np.int64)
        _lead(open_, first, last, table.ravel(), signs, steps, found)
        if not found.any():
            break
        reached[open_[found == 1]] = 1
        open_ = open_[found == 0]
    return np.asarray(reached.reshape(reaches.shape) == 1)


def _corners(shape: Ints) -> tuple[Ints, Ints]:
    """Sign (2^d,) of each corner of a box in a sum over it, and the table's steps (d,) along each axis."""
    signs = np.array([(-1) ** (len(shape) - sum(upper)) for upper in product((0, 1), repeat=len(shape))])
    steps = np.append(np.cumprod((shape + 1)[::-1])[::-1][1:], 1)
    return signs.astype(np.int64), steps.astype(np.int64)


@kernel
def _lead(cells: Ints, first: Ints, last: Ints, table: Ints, signs: Ints, steps: Ints, found: Ints) -> None:
    """found[i] = 1 where a box of cell i holds a cell that counts; `table` has sums from the origin."""
    d = steps.shape[0]
    for i in range(cells.shape[0]):
        c = cells[i]
        for u in range(first.shape[1]):
            empty = False
            for k in range(d):
                empty |= first[c, u, k] > last[c, u, k]
            total = 0
            for corner in range(0 if empty else signs.shape[0]):
                at = 0
                for k in range(d):
                    upper = (corner >> (d - 1 - k)) & 1
                    at += steps[k] * (last[c, u, k] + 1 if upper == 1 else first[c, u, k])
                total += signs[corner] * table[at]
            if total > 0:
                found[i] = 1
                break
