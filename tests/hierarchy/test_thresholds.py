"""Numbers that a fit's verdict turns at, from both sides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import TimeOver
from rungwise.hierarchy import limits
from rungwise.hierarchy.along_paths import FLOOR, Distances
from rungwise.hierarchy.compare import _fill
from rungwise.hierarchy.limits import INDEPENDENT, SAME, STAYS, TENDS, UNDECIDED, Fit
from rungwise.hierarchy.motions import Motions
from rungwise.hierarchy.paths import STIFFNESS, Path
from rungwise.hierarchy.refine import settle
from rungwise.outcome import Code

NAN = float("nan")
TIMEOUT = int(Code.TIMEOUT)


def fit(distances: tuple[float, ...], floor: float, order: float = 1.0, error: float = 0.0) -> Fit:
    count = len(distances)
    path: Any = SimpleNamespace(name="k", words="k grows", values=tuple(10.0**k for k in range(count)))
    known = Distances(
        np.zeros((count, 1, 1, 1)), np.array(distances), np.full(count, floor / FLOOR), np.full(count, 1e-6)
    )
    return Fit(path, known, order, error, 1.0, 0)


@pytest.mark.parametrize(
    ("distances", "floor", "order", "verdict"),
    [
        ((1e-9, 1e-9, 1e-9), 1e-12, 1.0, SAME),  # below all that solvers leave
        ((1e-7, 1e-7, 1e-7), 1e-12, 1.0, INDEPENDENT),
        ((1e-6, 1e-6, 1e-6), 1e-3, 1.0, SAME),  # within the floor
        ((1e-4, 1e-4, 1e-4), 1e-3, 1.0, UNDECIDED),
        ((1.0, 1.0 + 1e-4, 1.0), 0.5, 1.0, INDEPENDENT),  # all the same
        ((1.0, 1.0 + 1e-2, 1.0), 0.5, 1.0, TENDS),
        ((1.0, 0.9, 0.8), 1e-6, 0.02, STAYS),
        ((1.0, 0.5, 0.1), 1e-6, 0.3, TENDS),
        ((1.0, 0.05), 1e-6, NAN, TENDS),  # too few for an order, and a tenth at the end
        ((1.0, 0.3), 1e-6, NAN, UNDECIDED),
    ],
)
def test_verdicts(distances: tuple[float, ...], floor: float, order: float, verdict: str) -> None:
    assert fit(distances, floor, order).verdict == verdict


def test_distances_tell_from_ten_times_their_error_on_which_is_no_less_than_rounding() -> None:
    away = np.array([3e-10, 3e-9, 3e-6, 3e-5])
    error = np.array([0.0, 0.0, 1e-6, 1e-6])
    known = Distances(np.zeros((4, 1, 1, 1)), away, error, error)
    assert (away > known.floors).tolist() == [False, True, False, True] and known.seen == 2


def test_runs_are_repeated_until_motions_change_by_a_hundredth_of_the_accuracy() -> None:
    """Motions that change by three hundredths, and then by a third of one."""
    asked: list[float] = []

    class Bench:
        budget = 10**9

        def run(self, _model: Any, inputs: Any, _until: Any, tol: float, **_: Any) -> Motions:
            asked.append(tol)
            m = len(inputs)
            place = {1e-3: 0.0, 1e-4: 3e-4, 1e-5: 3.3e-4}[tol]
            ones = np.ones(m, np.int64)
            return Motions(np.full((m, 2, 1, 1), place), 0 * ones, np.ones(m), ones, ones)

    bench: Any = Bench()
    model: Any = None
    settled = settle(bench, model, np.zeros((1, 1)), np.ones(1), 1e-2)
    assert asked == [1e-3, 1e-4, 1e-5] and settled.error[0] == pytest.approx(3e-5)


class Falling:
    """Runs whose distance falls along the path as its small number does, but for this scatter, and end at a
    time at the latest; `equal` counts those with equal steps."""

    duration, budget = 1.0, 10**9
    matched = SimpleNamespace(bouncing=lambda _: {})

    def __init__(self, ends: float, scatter: float) -> None:
        self.ends, self.scatter, self.equal = ends, scatter, 0

    def run(
        self, _model: Any, inputs: Any, until: Any, _tol: Any = None, *, step: float | None = None,
        parameters: Any = None, **_: Any,
    ) -> Motions:  # fmt: skip
        self.equal += step is not None
        at = np.broadcast_to((parameters or {}).get(STIFFNESS, 0.0), len(inputs)).astype(float)
        sides = np.where(np.round(np.log10(np.where(at > 0.0, at, 1.0))) % 2.0 == 0.0, 1.0, -1.0)
        places = np.where(at > 0.0, at * np.exp(self.scatter * sides), 0.0)
        ones = np.ones(len(inputs), np.int64)
        times = np.minimum(until, self.ends)
        return Motions(np.tile(places[:, None, None, None], (1, 60, 1, 1)), TIMEOUT * ones, times, ones, ones)


def fitted(ends: float, scatter: float) -> tuple[Fit, Falling]:
    bench: Any = Falling(ends, scatter)
    path = Path("k falls", "k", (1.0, 0.1, 0.01, 0.001), lambda _: 1.0, lambda at: at, lambda _: 1.0)
    found = limits.fit(bench, path, rw.DYNAMIC_RIGID, rw.DYNAMIC_RIGID, np.zeros((1, 1)), np.ones(1))
    return found, bench


def test_distances_are_taken_until_just_before_a_run_ends() -> None:
    assert fitted(0.5, 0.0)[0].until == pytest.approx(0.98 * 0.5)


def test_motions_that_end_at_once_lead_nowhere() -> None:
    assert fitted(3e-4, 0.0)[0].short and not fitted(3e-3, 0.0)[0].short


def test_equal_steps_are_tried_where_distances_scatter() -> None:
    for scatter, error, is_tried in ((0.08, 0.02, False), (0.8, 0.2, True)):
        found, bench = fitted(1.0, scatter)
        assert 0.5 * error < found.error < 2.0 * error and (bench.equal > 0) == is_tried


@pytest.mark.parametrize("accuracy", [1e-4, 0.1])
def test_runs_that_choose_are_finer_than_what_is_asked_for_but_not_for_nothing(accuracy: float) -> None:
    asked = list[float]()

    def last(_drawn: Any, tol: float) -> Any:
        asked.append(tol)
        raise TimeOver("here")

    part: Any = SimpleNamespace(until=np.full(2, np.nan))
    bench: Any = SimpleNamespace(last=last)
    steps: Any = None
    with pytest.raises(TimeOver):
        _fill(part, bench, (), np.zeros((2, 1)), accuracy, np.random.default_rng(0), steps)
    assert 2e-3 * accuracy < asked[0] < 0.05 * accuracy
