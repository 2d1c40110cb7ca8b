"""Rollouts: many runs from states, each with inputs in segments, in compiled threads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.read import load
from rungwise.scene.space import SpaceScene
from rungwise.simulation.arguments import Begins, asked
from rungwise.simulation.crew import CHUNK, Crew
from rungwise.simulation.options import moving_rung
from rungwise.simulation.planar.workspace import State as Like
from rungwise.simulation.planar.workspace import in_memory
from rungwise.simulation.result import pair_labels
from rungwise.simulation.rolled import Rolled
from rungwise.simulation.rows import States
from rungwise.simulation.run import Simulation
from rungwise.simulation.spatial.rollout import SpaceRollouts, rollout_in_space
from rungwise.simulation.state import State, StateError, memory_of


@dataclass(frozen=True, repr=False)
class Rollouts(Rolled):
    """Rollouts of a planar scene of n coordinates, as of `Rolled`; with `keep` there are also modes and
    forces of contact points at the ends of segments."""

    scene: Scene
    _like: Like = field(repr=False)

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


@keywords
def rollout(
    scene: Scene | SpaceScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
    durations: ArrayLike | None = None,
    *,
    until: Sequence[str | None] | None = None,
    ramp: bool | Sequence[bool] = False,
    parameters: Mapping[str, ArrayLike] | None = None,
    step: float | None = None,
    tol: float | None = 1e-3,
    theta: float = 1.0,
    motion: Mapping[str, float] | None = None,
    keep: bool = True,
    budget: int | None = None,
    threads: int | None = None,
    chunk: int = CHUNK,
    on_progress: Callable[[int], None] | None = None,
) -> Rollouts | SpaceRollouts:
    """Make m runs from states, each with its own inputs in s segments; its bytes do not depend on `threads`.

    Args:
        scene, model, step, tol, theta, motion: as for `Simulation`, but that steps are error-controlled if
            `tol` is not None.
        states: one state or m; or places (m, n), or places and velocities (m, 2 n), at t = 0; the scene's
            start if not given. States of runs go on as `simulate(..., state=)` does.
        inputs: values (m, s, u) of the scene's inputs, or (s, u) for all samples, or a mapping of names to
            values (m, s), (s,) or a number; inputs not named stay as they are.
        durations: of segments, (m, s), (s,), or a number for all; 0 skips one. The runs end with the last.
            Without durations there is no segment, and runs end with the scene.
        until: for each segment a condition that ends it sooner, or None; see `Segment`.
        ramp: whether inputs go to their values linearly, for all segments or for each.
        parameters: values by name, a number or (m,) each.
        keep: whether the states at the switches are kept (see `Rollouts`).
        budget: most steps of one run, a million if not given; a run that takes more has not converged.
        threads: how many; as many as there are cores if not given.
        on_progress: called with the number of runs done. Ctrl-C raises KeyboardInterrupt within one run.

    Raises SceneError, StateError, ScheduleError or ModelError for wrong shapes, names and options; wrong
    values of a sample make it `invalid`, with a line in `faults`, and the others go on. What is given for one
    sample, also as an array of one row, serves all m."""
    scene, rung = load(scene), moving_rung(model)
    wanted = asked(scene, states, inputs, durations, until, ramp, parameters)
    options = {"step": step, "tol": tol, "theta": theta, "motion": motion}
    if isinstance(scene, SpaceScene):
        return rollout_in_space(
            scene, rung, wanted, options, keep=keep, budget=budget, threads=threads, chunk=chunk,
            on_progress=on_progress,
        )  # fmt: skip
    crew = Crew(
        scene, rung, wanted.over, None, until=wanted.until, ramps=wanted.ramps, budget=budget,
        threads=threads, **options,  # type: ignore[arg-type]
    )  # fmt: skip
    begins, faults, points = wanted.begins, wanted.faults, wanted.points
    schedule = partial(wanted.schedule, scene)

    def of_sample(i: int) -> dict[str, Any]:
        return options | wanted.options(scene, i)

    memories = _memories(crew, begins, of_sample, faults, points)
    samples = crew.run(
        points, bodies=None if begins is None else begins.bodies, memories=memories.rows, memory=memories.of,
        durations=wanted.lengths, levels=wanted.levels,
        wrong=np.isin(np.arange(len(points)), list(faults)).astype(np.int64),
        keeps=keep, chunk=chunk, on_progress=on_progress,
    )  # fmt: skip
    found, n = samples.results, len(scene.template.coordinates)
    return Rollouts(
        scene=scene, model=rung, outcome=found["outcome"].copy(), margin=found["margin"].copy(),
        time=found["time"].copy(), steps=found["steps"].copy(), attempts=found["attempts"].copy(),
        solves=found["solves"].copy(),
        switches=found["switches"].copy(), worst_residual=found["worst_residual"].copy(),
        final=samples.final[:, :n].copy(), speed=samples.final[:, n:].copy(), faults=faults,
        memory=samples.kept, _like=crew.workspace.state, _options=of_sample, _schedules=schedule,
        _theta=crew.theta,
    )  # fmt: skip


class _Memories(NamedTuple):
    """Memories (r, w) to go on from, and the row of each sample (m,), -1 without one."""

    rows: Reals
    of: Ints


def _memories(
    crew: Crew,
    begins: Begins | None,
    of_sample: Callable[[int], dict[str, Any]],
    faults: dict[int, str],
    points: Reals,
) -> _Memories:
    """Memories that samples from states of runs go on from.

    Where the rung and the parameters are those of the state's run, it is the state's own; otherwise the
    memory of a run that has begun there. What is wrong goes into `faults`.
    """
    m, rows = len(points), list[Reals]()
    of = np.full(m, -1)
    made: dict[tuple[int, bytes], int] = {}
    states = [] if begins is None else begins.states
    for i in range(m) if any(state.memory is not None for state in states) else ():
        row = min(i, len(states) - 1)
        key = row, points[i].tobytes()
        if i in faults or states[row].memory is None:
            continue
        if key not in made:
            values = _begun(crew, states[row], of_sample(i))
            if isinstance(values, str):
                faults[i] = f"sample {i}: {values}"
                continue
            made[key] = len(rows)
            rows.append(values)
        of[i] = made[key]
    return _Memories(np.array(rows) if rows else np.zeros((0, crew.workspace.state.memory.size)), of)


def _begun(crew: Crew, state: State, options: dict[str, Any]) -> Reals | str:
    """The memory from which a run from this state goes on, or why there is none."""
    own = memory_of(state, crew.digest, crew.workspace.state)
    if own is not None and crew.goes_on(own, options["parameters"]):
        return own.values
    try:
        begun = Simulation(crew.scene, crew.model, frames=3, **options)
    except StateError as error:
        return str(error)
    if begun.workspace is None or begun.reason:
        return begun.reason
    return begun.workspace.state.memory.copy()
