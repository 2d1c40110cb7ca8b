"""Which stage, a rung and an accuracy, is enough for a scene, and what it costs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.motions import MOVING, Bench, Motions, apart
from rungwise.kernel import Reals
from rungwise.planning.motion.budget import Stage

TOLS = (1e-2, 1e-3, 1e-4)
"""Errors allowed per step of the stages that are tried, over the size of what moves."""
MOMENTS = 10
"""Moments at which a stage is judged, or fewer, evenly among those of motions; a run has at least so many
steps."""


@dataclass(frozen=True)
class Cost:
    """A stage; its greatest distance to the settled run of the richest rung; steps and problems solved of all
    runs."""

    stage: Stage
    distance: float
    steps: int
    solves: int


def costs(bench: Bench, inputs: Reals, until: Reals, truth: Motions) -> list[Cost]:
    """What every rung at every accuracy takes under these inputs, and how far it is from the settled motions
    of the richest rung; runs whose motions have not settled there are left out."""
    moments = math.gcd(MOMENTS, truth.places.shape[1])  # those of a run are among those of the truth
    part = truth.places.shape[1] // moments
    rows = np.flatnonzero(truth.known)
    truth = truth._replace(places=truth.places[:, part - 1 :: part]).rows(rows)
    inputs, until = inputs[rows], until[rows]
    found = []
    for model in MOVING if len(inputs) else ():
        for tol in TOLS:
            runs = bench.run(model, inputs, until, tol, moments=moments)
            away = np.nan_to_num(apart(runs, truth), nan=math.inf)
            stage, steps, solves = Stage(model, tol), int(runs.steps.sum()), int(runs.solves.sum())
            found.append(Cost(stage, float(away.max()), steps, solves))
    return found


def cheapest(found: list[Cost], accuracy: float) -> Cost | None:
    """The stage of fewest solves within this distance, None if there is none."""
    enough = [cost for cost in found if cost.distance <= accuracy]
    return min(enough, key=lambda cost: (cost.solves, cost.steps), default=None)
