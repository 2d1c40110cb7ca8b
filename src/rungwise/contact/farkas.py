"""Proofs that a problem has no solution, and their independent check.

For every mode of a set that covers all solutions there is a vector p of multipliers of the rates y = A x + b:
where the mode's laws say y_i = 0 it is free, where y_i >= 0 or y_i <= 0 it has that sign, elsewhere it is 0.
Then p . y >= 0 for every solution in that mode. If also p . y <= p . b + p . A x < 0 for all x that the mode
allows, there is none. Source: Farkas' lemma for cones (Rockafellar, Convex Analysis, 1970, section 22).
In floating point a remainder `left` multiplies x, and what is proved is that no solution has a scaled norm
below gain / left; a proof counts when that bound is `REACH` (the scaled rates without forces have norm 1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from rungwise.contact.mixed import Array
from rungwise.contact.system import System

REACH = 1e6
_ROUNDING = 2.0**-50

COVER = 0
"""The one mode that covers everything: each law's convex hull."""
OPEN, CLOSED = 1, 2
"""A contact's modes: no force, or no normal rate."""
LOWER, INSIDE, UPPER = 1, 2, 3
"""Another unknown's: at a limit, or between, where its rate is zero."""

Mode = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Infeasible:
    """One vector p (N,) of the scaled system per mode; `kind` jammed or unsupported."""

    kind: str
    modes: tuple[Mode, ...]
    vectors: tuple[Array, ...]


def cover(system: System) -> Mode:
    """The mode in which every law is its convex hull."""
    return (COVER,) * (len(system.mu) + len(system.lower))


def all_modes(system: System) -> Iterator[Mode]:
    """Modes that together cover all solutions."""
    others = [_modes_of(a, b) for a, b in zip(system.lower, system.upper, strict=True)]
    return product(*[(OPEN, CLOSED)] * len(system.mu), *others)


def mode_count(system: System) -> float:
    count = 2.0 ** len(system.mu)
    for a, b in zip(system.lower, system.upper, strict=True):
        count *= len(_modes_of(a, b))
    return count


def _modes_of(lower: float, upper: float) -> tuple[int, ...]:
    if lower == upper:
        return (LOWER,)
    modes = [LOWER] if np.isfinite(lower) else []
    modes.append(INSIDE)
    return tuple(modes + ([UPPER] if np.isfinite(upper) else []))


def signs(system: System, mode: Mode) -> tuple[Array, Array]:
    """Least and greatest multiplier (N,) that the mode allows, as 0 or infinite."""
    s, d = system, system.directions
    least, most = np.zeros(s.size), np.zeros(s.size)
    for k in range(len(s.mu)):
        most[k * d] = np.inf
        least[k * d] = -np.inf if mode[k] == CLOSED else 0.0
    for j, (a, b) in enumerate(zip(s.lower, s.upper, strict=True)):
        i, own = s.rows + j, mode[len(s.mu) + j]
        if own == INSIDE or (own == COVER and np.isneginf(a) and np.isposinf(b)):
            least[i], most[i] = -np.inf, np.inf
        elif (own == LOWER and a < b) or (own == COVER and np.isposinf(b)):
            most[i] = np.inf
        elif (own == UPPER and a < b) or (own == COVER and np.isneginf(a)):
            least[i] = -np.inf
    return least, most


def range_of(system: System, mode: Mode) -> tuple[Array, Array]:
    """Limits of the other unknowns (m,) in the mode."""
    own = np.array(mode[len(system.mu) :], int)
    lower = np.where(own == UPPER, system.upper, system.lower)
    return lower, np.where(own == LOWER, system.lower, system.upper)


def check(system: System, proof: Infeasible) -> bool:
    """Whether `proof` shows that the system has no solution of scaled norm below `REACH`."""
    if not proof.vectors or len(proof.modes) != len(proof.vectors):
        return False
    covered = proof.modes == (cover(system),) or proof.modes == tuple(all_modes(system))
    return covered and all(map(lambda mode, p: _excludes(system, mode, p), proof.modes, proof.vectors))


def _excludes(system: System, mode: Mode, p: Array) -> bool:
    s, d, contacts = system, system.directions, len(system.mu)
    least, most = signs(s, mode)
    if p.shape != (s.size,) or not np.isfinite(p).all() or (p < least).any() or (p > most).any():
        return False
    A = s.matrix()
    pull = A.T @ p
    doubt = _ROUNDING * (abs(A).T @ np.abs(p))
    gain = -float(p @ s.b) - _ROUNDING * float(np.abs(p) @ np.abs(s.b))
    left = float(doubt.max(initial=0.0))
    for k in range(contacts):
        if mode[k] != OPEN:
            own = pull[k * d : (k + 1) * d]
            left = max(
                left, own[0] + s.mu[k] * float(np.linalg.norm(own[1:])) + doubt[k * d : (k + 1) * d].sum()
            )
    lower, upper = range_of(s, mode)
    own = pull[s.rows :]
    bound = np.where(own > 0.0, upper, lower)
    inside = np.isfinite(bound)
    gain -= float((own[inside] * bound[inside]).sum())
    gain -= float((_ROUNDING * np.abs(own) + doubt[s.rows :])[inside] @ np.abs(bound[inside]))
    left = max(left, float(np.abs(own[~inside]).max(initial=0.0)))
    return gain > REACH * s.size * left
