"""Rollouts of planar scenes, in compiled threads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.scene.scene import InvalidScene
from rungwise.simulation.planar.state.workspace import State as Like
from rungwise.simulation.planar.state.workspace import in_memory
from rungwise.simulation.result import pair_labels
from rungwise.simulation.run import Simulation
from rungwise.simulation.state import State, StateError, memory_of
from rungwise.simulation.threads import BUDGET, CHUNK, Starts, Workers
from rungwise.world.arguments import Asked, Begins
from rungwise.world.contract import Told
from rungwise.world.planar.runs import columns, proved
from rungwise.world.rolled import Rolled
from rungwise.world.run import repeated


@dataclass(frozen=True, repr=False, eq=False)
class Rollouts(Rolled):
    """Rollouts of a planar scene of n coordinates, as of `Rolled`; with `keep` there are also modes and
    forces of contact points at the ends of segments."""

    scene: Scene
    _like: Like = field(repr=False, compare=False)

    @property
    def points(self) -> list[str]:
        """Labels (p,) of contact points, two for each pair of shapes."""
        return [f"{pair}/{k}" for pair in pair_labels(self.scene) for k in (0, 1)]

    @property
    def modes(self) -> Ints:
        """Modes (m, s, p) of contact points, as in `Run.trajectory`; open where a run had ended before."""
        modes: Ints = self._kept("modes")[:, :, : len(self.points)].copy()
        modes[np.isnan(self.times)] = 0
        return modes

    @property
    def forces(self) -> Reals:
        """Normal and tangential forces (m, s, p, 2) at contact points."""
        return self._kept("force")[:, :, : len(self.points)]

    def _at_ends(self, name: str) -> NDArray[Any]:
        m, s, w = self.memory.shape
        found = in_memory(self._like, name, self.memory.reshape(m * s, w))
        return found.reshape(m, s, *found.shape[1:])


def rollout(
    scene: Scene, rung: Rung, wanted: Asked, options: dict[str, Any], *, keep: bool, budget: int | None,
    threads: int | None, chunk: int | None, deadline: Deadline, on_progress: Told | None,
) -> Rollouts:  # fmt: skip
    """The runs that are asked for (see `rungwise.rollout`)."""
    workers = Workers(
        scene, rung, wanted.over, None, until=wanted.until, ramps=wanted.ramps, budget=budget,
        threads=threads, **options,
    )  # fmt: skip
    begins, faults, points = wanted.begins, wanted.faults, wanted.points
    schedule = partial(wanted.schedule, scene)

    def of_sample(i: int) -> dict[str, Any]:
        return options | wanted.options(scene, i)

    memories = _memories(workers, begins, of_sample, faults, points, deadline)
    samples = workers.run(
        points, Starts(None if begins is None else begins.bodies, memories.rows, memories.of),
        durations=wanted.lengths, levels=wanted.levels,
        wrong=np.isin(np.arange(len(points)), list(faults)).astype(np.int64),
        keeps=keep, chunk=CHUNK if chunk is None else chunk, deadline=deadline, on_progress=on_progress,
    )  # fmt: skip
    found, n = samples.results, len(scene.template.coordinates)
    again = partial(repeated, scene, rung, options, wanted.options)

    told = columns(found)
    told["outcome"] = proved(
        rung, told["outcome"], told["steps"], budget or BUDGET, lambda i: again(i, deadline), deadline
    )
    _say_impossible(scene, wanted, told["outcome"])
    return Rollouts(
        scene=scene, model=rung, **told, worst_residual=found["worst_residual"].copy(),
        final=samples.final[:, :n].copy(), speed=samples.final[:, n:].copy(), faults=faults,
        memory=samples.kept, _like=workers.workspace.state, _again=again, _schedules=schedule,
        _theta=workers.theta,
    )  # fmt: skip


def _say_impossible(scene: Scene, wanted: Asked, outcome: Ints) -> None:
    """Why samples are invalid whose parameters no scene can have, into the faults."""
    known: dict[bytes, str] = {}
    given = scene.parameters()
    for i in np.flatnonzero(outcome == Code.INVALID).tolist():
        if i in wanted.faults:
            continue
        key = wanted.points[i].tobytes()
        if key not in known:
            values = given | dict(zip(wanted.over, wanted.points[i].tolist(), strict=True))
            try:
                scene.bind_values(values.values())
                known[key] = ""
            except InvalidScene as error:
                known[key] = str(error)
        if known[key]:
            wanted.faults[i] = f"sample {i}: {known[key]}"


class _Memories(NamedTuple):
    """Memories (r, w) to go on from, and the row of each sample (m,), -1 without one."""

    rows: Reals
    of: Ints


def _memories(
    workers: Workers,
    begins: Begins | None,
    of_sample: Callable[[int], dict[str, Any]],
    faults: dict[int, str],
    points: Reals,
    deadline: Deadline,
) -> _Memories:
    """Memories that samples from states of runs go on from.

    Where the rung and the parameters are those of the state's run, it is the state's own; otherwise the
    memory of a run that has begun there. What is wrong goes into `faults`. When the deadline has come the
    others have none: no run begins then.
    """
    m, rows = len(points), list[Reals]()
    of = np.full(m, -1)
    made: dict[tuple[int, bytes], int] = {}
    states = [] if begins is None else begins.states
    for i in range(m) if any(state.memory is not None for state in states) else ():
        if deadline.is_over:
            break
        row = min(i, len(states) - 1)
        key = row, points[i].tobytes()
        if i in faults or states[row].memory is None:
            continue
        if key not in made:
            values = _begun(workers, states[row], of_sample(i))
            if isinstance(values, str):
                faults[i] = f"sample {i}: {values}"
                continue
            made[key] = len(rows)
            rows.append(values)
        of[i] = made[key]
    return _Memories(np.array(rows) if rows else np.zeros((0, workers.workspace.state.memory.size)), of)


def _begun(workers: Workers, state: State, options: dict[str, Any]) -> Reals | str:
    """The memory from which a run from this state goes on, or why there is none."""
    own = memory_of(state, workers.digest, workers.workspace.state)
    if own is not None and workers.goes_on(own, options["parameters"]):
        return own.values
    try:
        begun = Simulation(workers.scene, workers.model, frames=3, **options)
    except StateError as error:
        return str(error)
    if begun.workspace is None or begun.reason:
        return begun.reason
    return begun.workspace.state.memory.copy()
