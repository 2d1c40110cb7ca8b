"""Parts of a system that nothing couples, each in a size of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from rungwise.contact.prepare.system import Form, System
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array, Laws
from rungwise.kernel import Ints


@dataclass(frozen=True)
class Islands:
    """The system's rows, gathered island by island, with columns counted within the island.

    place (N,): the rows as the system has them; first (k + 1,), contacts (k + 1,): where islands begin; size
    (k,): divisor of the forces, limits and rates of each island, so that its rates without forces have norm
    1.
    """

    place: Ints
    first: Ints
    contacts: Ints
    size: Array
    form: Form
    b: Array
    laws: Laws
    force: Array
    rate: Array
    kept: Ints

    def __len__(self) -> int:
        return len(self.size)

    def goals(self, tol: float) -> Array:
        """Tolerances (k,), in the islands' own sizes, that together make `tol`."""
        return tol / (self.size * math.sqrt(len(self)))

    def inwards(self, x: Array) -> Array:
        """The system's forces (N,) as the islands count them."""
        return x[self.place] / self.size.repeat(np.diff(self.first))

    def outwards(self, x: Array) -> Array:
        """The islands' forces (N,) as the system counts them."""
        full = np.empty(len(x))
        full[self.place] = x * self.size.repeat(np.diff(self.first))
        return full

    def part(self, i: int) -> System:
        """Island i as a system by itself."""
        whole, laws, d = self.form, self.laws, self.laws.d
        rows = slice(self.first[i], self.first[i + 1])
        contacts = slice(self.contacts[i], self.contacts[i + 1])
        others = slice(rows.start - d * contacts.start, rows.stop - d * contacts.stop)
        start = whole.entries.start[rows.start : rows.stop + 1]
        own = slice(start[0], start[-1])
        entries = Sparse(start - start[0], whole.entries.place[own], whole.entries.value[own])
        form = Form(entries, whole.blocks[contacts], whole.diagonal[others])
        return System(
            form, self.b[rows], laws.mu[contacts], d, laws.lower[others], laws.upper[others],
            self.force[rows], self.rate[rows], self.kept[rows], lambda x: x,
        )  # fmt: skip


_known: WeakKeyDictionary[System, Islands | None] = WeakKeyDictionary()


def islands(system: System) -> Islands | None:
    """The islands of a system, made once; None where there is only one."""
    if system not in _known:
        label, count = _labels(system)
        _known[system] = _gathered(system, label, count) if count > 1 else None
    return _known[system]


def _labels(system: System) -> tuple[Ints, int]:
    """The number of the island of each contact, and of each other unknown, and how many there are."""
    s, contacts = system, len(system.mu)
    law = np.concatenate([np.arange(contacts).repeat(s.directions), contacts + np.arange(len(s.lower))])
    entries = s.form.entries
    row = law.repeat(np.diff(entries.start))
    joined = sp.coo_array((entries.value != 0.0, (row, law[entries.place])), shape=(law[-1] + 1,) * 2)
    count, label = connected_components(joined, directed=False)
    return label.astype(np.int64), int(count)


def _gathered(system: System, label: Ints, count: int) -> Islands:
    s, d, rows = system, system.directions, system.rows
    own = np.concatenate([label[: len(s.mu)].repeat(d), label[len(s.mu) :]])
    place = np.argsort(own, kind="stable")
    first, contacts = _starts(own, count), _starts(label[: len(s.mu)], count)
    position = np.empty(s.size, np.int64)
    position[place] = np.arange(s.size) - first[own[place]]
    entries = s.form.entries.part(place)
    entries = entries._replace(place=position[entries.place])
    size = np.sqrt(np.add.reduceat(s.b[place] ** 2, first[:-1]))
    size[size == 0.0] = 1.0
    pairs, single = place[place < rows][::d] // d, place[place >= rows] - rows
    per = size[own[place]]
    limits = per[place >= rows]
    return Islands(
        place, first, contacts, size, Form(entries, s.form.blocks[pairs], s.form.diagonal[single]),
        s.b[place] / per, Laws(s.mu[pairs], d, s.lower[single] / limits, s.upper[single] / limits),
        s.force[place] * per, s.rate[place] * per, s.kept[place],
    )  # fmt: skip


def _starts(label: Ints, count: int) -> Ints:
    return np.concatenate([[0], np.cumsum(np.bincount(label, minlength=count))]).astype(np.int64)
