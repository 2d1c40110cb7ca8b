"""The three sets of a model that has several motions, from one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.sets.feasible import FeasibleSet, feasible_set
from rungwise.sets.motions import GUARANTEED, POSSIBLE, SLOWEST


@dataclass(frozen=True)
class SolutionSets:
    """Where the slowest motion, some of the motions tried, and all of them reach the goal (see
    `rungwise.sets.motions`)."""

    slowest: FeasibleSet
    possible: FeasibleSet
    guaranteed: FeasibleSet


def solution_sets(
    scene: Scene | str | Path | Mapping[str, Any],
    model: Rung | str,
    over: Sequence[str],
    *,
    out: str | Path | None = None,
    **options: Any,
) -> SolutionSets:
    """The sets of a model by the slowest, by some and by all its motions, on the same box; a folder each in
    `out`.

    Options and errors as for `feasible_set`.
    """
    return SolutionSets(
        *(
            feasible_set(
                scene, model, over, solutions=each, out=None if out is None else Path(out) / each, **options
            )
            for each in (SLOWEST, POSSIBLE, GUARANTEED)
        )
    )
