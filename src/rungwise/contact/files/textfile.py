"""Reading the plain-text problem files of Siconos' numerics component.

Whitespace-separated numbers: sizes, a matrix, vectors. A matrix is its storage (0 dense by columns, 1 blocks
by rows of blocks, 2 a listing of entries), its shape, then the data of that storage. The kind is not written
in the file; it follows from the file's name, or is given. Source of the format: siconos/siconos, numerics.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from rungwise.contact.problem import Array, Matrix, Problem

KINDS = ("lcp", "mlcp", "relay", "local", "global")


def kind_of(path: Path) -> str:
    """Kind by the file's name: mlcp, lcp, relay, gfc (global friction contact), else local contact."""
    name = path.name.lower()
    for kind in ("mlcp", "lcp", "relay"):
        if kind in name:
            return kind
    return "global" if re.search(r"(^|_)gfc[23]d", name) and "condensed" not in name else "local"


def read_text(path: Path, kind: str | None = None) -> Problem:
    """The problem in `path`; ValueError when the text is not a problem."""
    kind = kind_of(path) if kind is None else kind
    words = _Words(path.read_text("utf-8", errors="replace"))
    match kind:
        case "lcp":
            words.integers(1)
            M = _matrix(words)
            return Problem.lcp(M, words.floats(M.shape[0]))
        case "relay":
            words.integers(1)
            M = _matrix(words)
            q, lower, upper = (words.floats(M.shape[0]) for _ in range(3))
            return Problem.boxes(M, q, lower, upper)
        case "mlcp":
            return _mlcp(words)
    directions, contacts = words.integers(2)
    if directions not in (2, 3):
        raise ValueError(f"directions: {directions} per contact are not supported, only 2 and 3")
    first = _matrix(words)
    if kind == "global":
        across = _matrix(words)
        f, w, mu = words.floats(first.shape[0]), words.floats(across.shape[1]), words.floats(contacts)
        return Problem.balance(first, f, across.T, w, mu, directions=directions)
    q, mu = words.floats(first.shape[0]), words.floats(contacts)
    return Problem.local(first, q, mu, directions)


def _mlcp(words: _Words) -> Problem:
    """Blocks of rows that are equalities (0) or complementarities (1), then the square matrix and offset."""
    one_matrix, _, equalities, complementarities = words.sizes(4)
    if not one_matrix:
        raise ValueError("M: an MLCP in several matrices is not supported")
    size = equalities + complementarities
    ends = words.sizes(1)
    while ends[-1] < size:
        ends += words.sizes(1)
    law = np.zeros(size, bool)
    for first, last, complementary in zip(ends[:-1], ends[1:], words.integers(len(ends) - 1), strict=True):
        law[first:last] = bool(complementary)
    if (
        ends[0] != 0
        or ends[-1] != size
        or min(np.diff(ends), default=1) < 1
        or law.sum() != complementarities
    ):
        raise ValueError(
            f"file: its blocks of rows do not make {equalities} equalities and {complementarities}"
            " complementarities"
        )
    M = _matrix(words)
    return Problem.mlcp(M, words.floats(M.shape[0]), law)


class _Words:
    """The file's words in order; lines where the format needs them."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0

    def word(self) -> str:
        found = re.compile(r"\S+").search(self.text, self.at)
        if found is None:
            raise ValueError("file: ends before the problem is complete")
        self.at = found.end()
        return found.group()

    def integers(self, count: int) -> list[int]:
        words = [self.word() for _ in range(count)]
        try:
            return [int(word) for word in words]
        except ValueError:
            raise ValueError(f"file: {' '.join(words)[:60]!r} stands where whole numbers are due") from None

    def sizes(self, count: int) -> list[int]:
        """Whole numbers that are not negative."""
        found = self.integers(count)
        if min(found) < 0:
            raise ValueError(f"file: {min(found)} stands where a size is due")
        return found

    def floats(self, count: int) -> Array:
        words = [self.word() for _ in range(count)]
        try:
            return np.array(words, np.float64) if words else np.zeros(0)
        except ValueError:
            raise ValueError("file: words that are not numbers stand where numbers are due") from None

    def hold(self, *sizes: int) -> None:
        """Refuse sizes of vectors for which the file is too short."""
        if max(sizes) > len(self.text):
            raise ValueError(f"file: is too short for a matrix of size {max(sizes)}")

    def line(self) -> str:
        end = self.text.find("\n", self.at)
        end = len(self.text) if end < 0 else end
        line, self.at = self.text[self.at : end], end + 1
        return line


def _matrix(words: _Words) -> Matrix:
    storage, rows, columns = words.sizes(3)
    words.hold(rows, columns)
    match storage:
        case 0:
            rows, columns = words.sizes(2)
            return words.floats(rows * columns).reshape(columns, rows).T
        case 1:
            return _block_rows(words, (rows, columns))
        case 2:
            return _listing(words)
    raise ValueError(f"file: matrix storage {storage} is not supported, only 0, 1 and 2")


def _block_rows(words: _Words, shape: tuple[int, int]) -> sp.csr_array:
    _, block_rows, block_columns = words.integers(3)
    row_end, column_end = [0, *words.integers(block_rows)], [0, *words.integers(block_columns)]
    filled1, filled2 = words.integers(2)
    start, column = words.integers(filled1), words.integers(filled2)
    made = sp.lil_array(shape)
    for i in range(filled1 - 1):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            height, width = row_end[i + 1] - row_end[i], column_end[j + 1] - column_end[j]
            if min(height, width) < 0:
                raise ValueError("file: the ends of blocks must grow")
            words.integers(1)
            block = words.floats(height * width).reshape(width, height).T
            place = slice(row_end[i], row_end[i + 1]), slice(column_end[j], column_end[j + 1])
            if made[place].shape != block.shape:
                raise ValueError(f"file: a block of shape {block.shape} is not inside the matrix")
            made[place] = block
    return sp.csr_array(made)


def _listing(words: _Words) -> sp.csr_array:
    """A printed sparse matrix: entries under their column's (or row's) heading, or one `i j : x` a line."""
    words.integers(1)
    words.line()
    words.line()
    head = re.search(r"(triplet: *|csr: *)?(\d+)-by-(\d+), nzmax: *\d+ nnz: *(\d+)", words.line())
    if head is None:
        raise ValueError("file: the heading of a sparse matrix is not understood")
    form, shape, entries = head[1] or "", (int(head[2]), int(head[3])), int(head[4])
    words.hold(*shape)
    lines: list[tuple[int, int, float]] = []
    try:
        if form.startswith("triplet"):
            for _ in range(entries):
                place, x = words.line().split(":")
                i, j = place.split()
                lines.append((int(i), int(j), float(x)))
        else:
            for _ in range(shape[0] if form else shape[1]):
                first, last, heading = _heading(words.line())
                for _ in range(last - first + 1):
                    place, x = words.line().split(":")
                    inner = int(place)
                    lines.append((heading, inner, float(x)) if form else (inner, heading, float(x)))
    except (ValueError, TypeError):
        raise ValueError("file: a line of a sparse matrix is not understood") from None
    table = np.array(lines, float).reshape(-1, 3)
    return sp.csr_array((table[:, 2], (table[:, 0].astype(int), table[:, 1].astype(int))), shape=shape)


def _heading(line: str) -> tuple[int, int, int]:
    found = re.search(r"(\d+) *: *locations *(-?\d+) *to *(-?\d+)", line)
    if found is None:
        raise ValueError
    return int(found[2]), int(found[3]), int(found[1])
