"""A limit that is over on the way leaves the whole answer, or says what is missing, wherever it comes.

Nothing here waits for a clock: limits are over once they were looked at so many times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import Deadline

BALL = "ball"
PROBLEM = rw.Problem.lcp(np.eye(2), -np.ones(2))
_rng = np.random.default_rng(0)
_A = _rng.normal(size=(16, 16))


class Looks:
    """The time of every limit is over once this was looked at so many times."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, looks: int) -> None:
        self.left = looks
        monkeypatch.setattr(Deadline, "is_over", property(self._is_over))
        monkeypatch.setattr(Deadline, "seconds", property(self._seconds))

    def _is_over(self, own: Deadline) -> bool:
        self.left -= own.ends < math.inf
        return own.ends < math.inf and self.left < 0

    def _seconds(self, own: Deadline) -> float | None:
        return None if own.ends == math.inf else 0.0 if self.left < 0 else 1e9


def modes(found: rw.Solutions) -> set[Any]:
    """The modes of pieces and of those within them."""
    return {piece.mode for piece in (*found.pieces, *found.covered)}


def alike(a: Any, b: Any) -> bool:
    """Whether derivatives, motions, instances or answers are the same."""
    if isinstance(a, np.ndarray):
        return bool(np.array_equal(a, b, equal_nan=True))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(alike(a[name], b[name]) for name in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(alike, a, b))
    return alike(vars(a), vars(b)) if hasattr(a, "dq") or isinstance(a, rw.Geometry | rw.Answers) else a == b


FULL = rw.Problem.local(_A @ _A.T, _rng.normal(size=16), np.full(8, 0.5), directions=2)


@cache
def states() -> np.ndarray:
    return np.tile(rw.State.of(BALL).q, (6, 1))


@cache
def rolled() -> Any:
    return rw.simulate(BALL, "dynamic-rigid", duration=0.05)


WAYS: dict[str, tuple[Callable[[Any], Any], Callable[[Any, Any], bool]]] = {
    "run_sensitivity": (
        lambda limit: rw.run_sensitivity("two_finger", "kinematic", steps=3, limit=limit), alike
    ),
    "run_sensitivity in space": (
        lambda limit: rw.run_sensitivity(BALL, "dynamic-rigid", steps=3, names=("v", "mu"), limit=limit),
        alike,
    ),
    "step_sensitivity": (
        lambda limit: rw.step_sensitivity(
            "two_finger", "kinematic", None, np.zeros(3), np.zeros(3), 1e-3, limit=limit
        ),
        lambda a, b: alike(a.dq, b.dq),
    ),
    "solutions": (
        lambda limit: rw.solutions(FULL, limit=limit),
        lambda a, b: modes(a) <= modes(b) and (bool(a.undecided) or modes(a) == modes(b)),
    ),
    "extreme_motions": (lambda limit: rw.extreme_motions(rw.solutions(PROBLEM), limit=limit), alike),
    "instances": (lambda limit: rw.instances("push", 0, 5, limit=limit), alike),
    "geometry": (lambda limit: rw.geometry(BALL, states(), limit=limit), alike),
    "ask": (lambda limit: rw.ask(BALL, "ball.z > 0", states(), limit=limit), alike),
    "replay": (
        lambda limit: rw.replay(rolled(), limit=limit),
        lambda a, b: (
            alike(a.apart, b.apart[: len(a.times)]) and bool(a.unfinished or len(a.times) == len(b.times))
        ),
    ),
}  # fmt: skip
"""Calls, and whether what one gives with a limit is right beside what it gives without one."""


@pytest.mark.few(1)
@pytest.mark.parametrize("looks", [1, 3, 10, 40])
@pytest.mark.parametrize("name", WAYS)
def test_a_limit_on_the_way_leaves_the_whole_or_says_so(
    name: str, looks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    call, right = WAYS[name]
    whole = call(None)
    Looks(monkeypatch, looks)
    try:
        found = call(1e9)
    except rw.LimitError as error:
        assert str(error).startswith("limit: ")
    else:
        assert right(found, whole)
