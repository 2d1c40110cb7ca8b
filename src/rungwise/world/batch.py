"""Batches: one scene on one rung at many points of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.deadline import Deadline, seconds
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.options import moving_rung
from rungwise.simulation.result import counted, texts
from rungwise.simulation.threads import names_of, outside
from rungwise.world.find import world_of


@dataclass(frozen=True, eq=False)
class Results(ByContent):
    """Runs at points (m, k): `outcome`, codes of outcomes (see `rungwise.outcome.Code`); `time` at the end;
    signed `margin`; counts of `steps`; `worst_residual`, scaled; all (m,). `final` coordinates and `speed`
    (m, n) at the end.

    The margin is positive if the goal was reached, and is then the distance from unsafe and doomed states.
    Otherwise it is negative, and its size is the least distance from the goal. It passes zero continuously if
    the scene's conditions are continuous, and is nan if there was no run. A jam has no certificate here; run
    the point again with `simulate` to get one.
    """

    outcome: Ints
    time: Reals
    margin: Reals
    steps: Ints
    worst_residual: Reals
    final: Reals
    speed: Reals

    @property
    def outcomes(self) -> NDArray[np.str_]:
        """Outcomes (m,) as texts, as of `Run.outcome`."""
        return texts(self.outcome)

    def __repr__(self) -> str:
        return f"<Results of {len(self.outcome)} runs: {counted(self.outcome)}>"


class Batch:
    """Many runs of one scene on one rung, at points of its parameters. Raises SceneError or ModelError for
    wrong input.

    Args:
        scene, model: as for `simulate`.
        over: names of the parameters that points give, in order.
        parameters: values of other parameters; the rest keep their defaults.
        step, tol, duration, theta, motion: as for `simulate`.
        budget: most steps of one run, a million if not given; a run that takes more has not converged.
        threads: how many; as many as there are cores if not given. The results do not
            depend on it.
    """

    @keywords
    def __init__(
        self,
        scene: AnyScene | str | Path | Mapping[str, Any],
        model: Rung | str,
        over: Sequence[str],
        *,
        parameters: Mapping[str, float] | None = None,
        step: float | None = None,
        tol: float | None = 1e-3,
        duration: float | None = None,
        theta: float = 1.0,
        motion: Mapping[str, float] | None = None,
        budget: int | None = None,
        threads: int | None = None,
    ) -> None:
        self.scene, self.model = load(scene), moving_rung(model)
        self.over = names_of(self.scene, over)
        self._runs = world_of(self.scene).runs(
            self.model, self.over, parameters, step=step, tol=tol, duration=duration, theta=theta,
            motion=motion or None, budget=budget, threads=threads,
        )  # fmt: skip
        self.parameters, self.threads = self._runs.parameters, self._runs.threads

    proves = True
    """Whether runs that did not converge are looked at once more, each by itself, for a proof."""

    def __repr__(self) -> str:
        over = cut(", ".join(self.over), 200)
        return f"<Batch of {cut(self.scene.name)} on {cut(self.model.name)} over {over}>"

    @keywords
    def run(
        self, points: Reals, *, chunk: int | None = None, limit: float | None = None,
        on_progress: Callable[[int], None] | None = None,
    ) -> Results:  # fmt: skip
        """Run the scene at many points; the bytes do not depend on threads or `chunk`.

        Args:
            points: (m, k), values of the k parameters `over`.
            chunk: number of points that a thread takes at a time.
            limit: seconds, after which unfinished runs are interrupted.
            on_progress: called with the number of runs done.

        A point outside the ranges of the parameters, or one at which the scene is impossible, is `invalid`.
        After `limit` seconds unfinished runs are interrupted, also from within a step: their outcome is
        `running`, and they are kept so far. Runs that had not begun have positions of nan. Ctrl-C raises
        KeyboardInterrupt within one run.
        """
        deadline, points = Deadline(seconds(limit)), np.ascontiguousarray(points, np.float64)
        if points.ndim != 2 or points.shape[1] != len(self.over):
            raise ValueError(f"points: must have the shape (m, {len(self.over)}), not {points.shape}")
        wrong = outside(self.scene, self.over, points)
        found = self._runs.run(points, wrong=wrong, chunk=chunk, deadline=deadline, on_progress=on_progress)
        outcome = self._runs.proved(points, found, deadline) if self.proves else found.outcome
        return Results(
            outcome=outcome, time=found.time, margin=found.margin, steps=found.steps,
            worst_residual=found.residual, final=found.places.q, speed=found.places.v,
        )  # fmt: skip
