"""Rollouts of whatever moves: many runs from states, each with inputs in segments."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.scene.stated import StatedScene
from rungwise.simulation.moving.samples import Ends, Sample, Sampled, Stop, Terms
from rungwise.simulation.options import ModelError, RunOptions, count
from rungwise.simulation.stepping.record import WORK
from rungwise.simulation.threads import BUDGET, threads_of
from rungwise.world.arguments import Asked
from rungwise.world.contract import Told
from rungwise.world.moving.runs import MOST, PARTS, MovingRuns, columns, sampled
from rungwise.world.rolled import Rolled
from rungwise.world.run import repeated


@dataclass(frozen=True, repr=False, eq=False)
class MovingRollouts(Rolled):
    """Rollouts as of `Rolled`."""

    scene: StatedScene
    _ends: Ends = field(repr=False)

    def _at_ends(self, name: str) -> NDArray[Any]:
        return self._ends.work[..., WORK.index(name)] if name in WORK else getattr(self._ends, name)


Kind = TypeVar("Kind", bound=MovingRollouts)


def rollout(
    kind: type[Kind], runs: type[MovingRuns], scene: StatedScene, model: Rung, wanted: Asked,
    options: dict[str, Any], *, keep: bool, budget: int | None, threads: int | None, chunk: int | None,
    deadline: Deadline, on_progress: Told | None,
) -> Kind:  # fmt: skip
    """The runs that are asked for (see `rungwise.rollout`), as `runs` makes them."""
    if RunOptions(**options).motion is not None:
        raise ModelError(f"motion: does not work for {runs.kind}")
    most = BUDGET if budget is None else count("budget", budget, 1)
    most_threads = min(threads_of(threads), runs.most)
    size = None if chunk is None else count("chunk", chunk, 1)
    terms = Terms(scene, model, runs.make, options, most, keep, Stop(), deadline)
    m = len(wanted.points)
    samples = {i: Sample(**wanted.options(scene, i)) for i in range(m) if i not in wanted.faults}
    size = size or max(1, min(MOST, len(samples) // (PARTS * most_threads)))
    found = sampled(terms, samples, m, most_threads, size, on_progress)
    faults = wanted.faults | {i: f"sample {i}: {each.fault}" for i, each in enumerate(found) if each.fault}
    ends = _ends(scene, found, wanted.lengths.shape[1]) if keep else Ends(*[np.zeros((0, 0))] * 5)
    return kind(
        scene=scene, model=model, **columns(found),
        worst_residual=np.array([each.residual for each in found]),
        final=np.array([each.q for each in found]), speed=np.array([each.v for each in found]),
        faults=faults, memory=ends.memory, _again=partial(repeated, scene, model, options, wanted.options),
        _schedules=partial(wanted.schedule, scene), _theta=options["theta"], _ends=ends,
    )  # fmt: skip


def _ends(scene: StatedScene, found: list[Sampled], segments: int) -> Ends:
    """The ends of segments of all runs, nan for those that did not begin."""
    s, template = max(segments, 1), scene.template
    size = max((each.ends.memory.shape[1] for each in found if each.ends is not None), default=0)
    bare = Ends(
        np.full(s, np.nan), np.full((s, len(template.coordinates)), np.nan),
        np.full((s, len(template.velocities)), np.nan), np.full((s, 5), np.nan), np.full((s, size), np.nan),
    )  # fmt: skip
    rows = [bare if each.ends is None else each.ends.widened(size) for each in found]
    return Ends(*(np.array([row[k] for row in rows]) for k in range(5)))
