"""The three sets of a model that has several motions, from one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rungwise.content import ByContent
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.plain import brief
from rungwise.scene import Scene
from rungwise.sets.feasible.feasible import BUDGET, FeasibleSet, feasible_set
from rungwise.sets.motions import GUARANTEED, POSSIBLE, SLOWEST


@dataclass(frozen=True, eq=False)
class SolutionSets(ByContent):
    """Where the slowest motion, some of the motions tried (`possible`), and all of them (`guaranteed`) reach
    the goal (see `rungwise.sets.motions`)."""

    slowest: FeasibleSet
    possible: FeasibleSet
    guaranteed: FeasibleSet

    __repr__ = brief


@keywords
def solution_sets(
    scene: Scene | str | Path | Mapping[str, Any],
    model: Rung | str,
    over: Sequence[str],
    *,
    tol: float = 0.01,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    accuracy: float | None = None,
    probes: int | None = None,
    budget: int = BUDGET,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    cluster: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> SolutionSets:
    """Compute three sets of a model over one box: by its slowest motion, by some motion, and by all motions.
    Each gets a folder in `out`.

    Args:
        scene, model, over, tol, box, parameters: as for `feasible_set`, and so are the errors.
        accuracy, probes, budget, seed, threads, cluster, resume, on_progress: as for `feasible_set`.
        limit: seconds; each set may take its share of the time that is left, the first a third.
    """
    deadline = Deadline(seconds(limit))

    def found(each: str, left: int) -> FeasibleSet:
        return feasible_set(
            scene, model, over, solutions=each, out=None if out is None else Path(out) / each, tol=tol,
            box=box, parameters=parameters, accuracy=accuracy, probes=probes, budget=budget,
            limit=deadline.share(left), seed=seed, threads=threads, cluster=cluster, resume=resume,
            on_progress=on_progress,
        )  # fmt: skip

    return SolutionSets(found(SLOWEST, 3), found(POSSIBLE, 2), found(GUARANTEED, 1))
