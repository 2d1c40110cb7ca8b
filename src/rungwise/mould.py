"""Blocks made by copying: what is allocated anew for each short run costs one copy of memory then, in place
of an array and a header for each field."""

from __future__ import annotations

from bisect import bisect_right
from functools import partial
from operator import itemgetter
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.block import HEADER_DATA, Block, Layout, address_of, header_table, header_words

B = TypeVar("B", bound=Block)
AnyArray: TypeAlias = NDArray[Any]

LINE = 64
"""Bytes of a line of a processor's cache: spans of memory begin at multiples of that."""


class _Place(NamedTuple):
    """Where an array is in the memory of a cast."""

    at: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class _Part(NamedTuple):
    """A block within a cast: its class and layout, where its table of headers is, and its fields: blocks,
    places of arrays, and arrays that all casts share."""

    kind: type[Block]
    layout: Layout
    at: int
    fields: dict[str, _Part | _Place | AnyArray]

    def cast(self, memory: AnyArray, base: int) -> Any:
        made = object.__new__(self.kind)
        made.__dict__.update(
            _layout=self.layout, _address=base + self.at, _field=partial(self.field, memory, base)
        )
        return made

    def field(self, memory: AnyArray, base: int, name: str) -> Block | AnyArray:
        own = self.fields[name]
        if isinstance(own, _Part):
            made: Block = own.cast(memory, base)
            return made
        return np.ndarray(own.shape, own.dtype, memory, own.at) if isinstance(own, _Place) else own


class Mould(Generic[B]):
    """Makes blocks like a given one, each in one piece of memory.

    Arrays of a cast are copies of what the given block's arrays are now; those that share memory there do so
    in the cast. Arrays that cannot be written are those of the given block. A field is made for Python when
    it is first asked for; kernels find all of them in the copied headers.
    """

    def __init__(self, block: B) -> None:
        arrays: list[tuple[int, AnyArray]] = []
        self._words = _collect(block, arrays)
        self._spans, head, self._size = _laid_out(arrays, 8 * self._words)
        self._head = np.zeros(head, np.uint8)
        for first, array in arrays:
            at = self._where(first) if array.nbytes > 0 else head
            if at < head:
                np.ndarray(array.shape, array.dtype, self._head, at)[...] = array
        table, pointers = list[int](), list[int]()
        self._part = self._taken(block, table, pointers)
        np.ndarray(self._words, np.int64, self._head)[:] = table
        self._pointers = np.array(pointers)

    def cast(self) -> B:
        memory = np.zeros(self._size, np.uint8)
        memory[: len(self._head)] = self._head
        base = address_of(memory)
        np.ndarray(self._words, np.int64, memory)[self._pointers] += base
        made: B = self._part.cast(memory, base)
        return made

    def _where(self, address: int) -> int:
        """The place in a cast of what is at this address."""
        begins, at = self._spans[bisect_right(self._spans, address, key=itemgetter(0)) - 1]
        return at + address - begins

    def _taken(self, block: Block, table: list[int], pointers: list[int]) -> _Part:
        """The block as a part, with its headers added to the table, where `pointers` are places in casts."""
        layout, words = _layout(block), header_table(block)
        first, word = len(table), 0
        table += words
        fields: dict[str, _Part | _Place | AnyArray] = {}
        for name, kind in zip(layout.fields, layout.kinds, strict=True):
            value, at = getattr(block, name), first + word
            if isinstance(value, Block):
                part = fields[name] = self._taken(value, table, pointers)
                table[at] = part.at
                pointers.append(at)
            elif value.flags.writeable:
                data = words[word + HEADER_DATA]
                place = fields[name] = _Place(
                    self._where(data) if value.nbytes > 0 else 0, value.shape, value.dtype
                )
                table[at + HEADER_DATA] = place.at
                pointers.append(at + HEADER_DATA)
            else:
                fields[name] = value
            word += header_words(kind)
        return _Part(type(block), layout, 8 * first, fields)


def _layout(block: Block) -> Layout:
    layout: Layout = block._layout  # type: ignore[attr-defined]
    return layout


def _collect(block: Block, arrays: list[tuple[int, AnyArray]]) -> int:
    """Add the arrays that can be written, and where they begin; returns the words of all headers."""
    layout, table, word, inner = _layout(block), header_table(block), 0, 0
    for name, kind in zip(layout.fields, layout.kinds, strict=True):
        value = getattr(block, name)
        if isinstance(value, Block):
            inner += _collect(value, arrays)
        elif value.flags.writeable:
            arrays.append((table[word + HEADER_DATA], value))
        word += header_words(kind)
    return word + inner


def _laid_out(arrays: list[tuple[int, AnyArray]], after: int) -> tuple[list[tuple[int, int]], int, int]:
    """Where the spans of memory that the arrays take begin, and their places in a cast, by their order in
    memory; how long the head and the whole of a cast are. Spans of zeros alone are not in the head."""
    spans: list[tuple[int, int, bool]] = []
    for first, array in sorted((each for each in arrays if each[1].nbytes > 0), key=itemgetter(0)):
        filled = bool(np.ndarray(array.nbytes, np.uint8, array).any())
        if spans and first < spans[-1][1]:
            begins, ends, known = spans.pop()
            spans.append((begins, max(ends, first + array.nbytes), known or filled))
        else:
            spans.append((first, first + array.nbytes, filled))
    placed, at, head = [], _whole_lines(after), _whole_lines(after)
    for begins, ends, filled in sorted(spans, key=lambda span: not span[2]):
        placed.append((begins, at))
        at += _whole_lines(ends - begins)
        head = at if filled else head
    return sorted(placed), head, at


def _whole_lines(size: int) -> int:
    return -(-size // LINE) * LINE
