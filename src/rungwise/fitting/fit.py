"""Parameters under which runs come nearest to measured motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rungwise.deadline import Deadline, seconds
from rungwise.fitting.found import Fit
from rungwise.fitting.measured.motions import Motions
from rungwise.fitting.measured.spans import MOMENTS
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.stages import Search
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.simulation.options import count, moving_rung


@keywords
def fit(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    motions: Motions,
    over: Sequence[str] | str,
    *,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    span: float | None = None,
    moments: int = MOMENTS,
    step: float | None = None,
    tol: float | None = None,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    keep_interrupted: bool = False,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> Fit:
    """Find the parameters `over` with which runs of a scene on a rung come nearest to measured motions.

    Runs begin at measured states and last `span`; their errors are weighted by the deviation of the
    measurement, and by the deviation of the start that follows from it (`rungwise.fitting.weights`), with a
    robust loss (`rungwise.fitting.loss`). The whole box is sampled first, then least squares goes on from
    the best samples (`rungwise.fitting.least_squares`).

    Args:
        scene, model: as for `simulate`. Goals and other conditions of the scene end no run.
        motions: measured trials. Starts are moved out of overlaps and onto contacts that last, to the most
            probable place.
        over: names of the parameters to find, each in its range, or in `box`.
        parameters: values of other parameters; values that the motions give for a trial take
            precedence.
        span: how long runs last, in the scene's time; whole trials where it is `inf`. If not given, a quarter
            of the median trial, or half of the time per touch if bodies come to touch more than twice.
        moments: frames of a span that are compared, at most.
        step, tol, threads: as for `rollout`; where neither step nor tol is given, tol is a thousandth of
            the size of what moves, a hundredth of that where contacts yield to momentum, and less until that
            changes the values by less than a quarter of their deviation.
        limit: seconds after which the best so far is returned; see `Fit.unfinished`.
        out: a folder in which every finished batch of runs is kept; with `resume` a fit that was stopped goes
            on from these.
        keep_interrupted: Ctrl-C ends the search, and the best so far is returned, `unfinished`.
        seed: of samples, of spans that are chosen, and of the bootstrap.
        on_progress: called with what is done, runs done, and runs known to be needed (0 if not known).

    Raises MotionError, FitError, SceneError, ModelError or InputError for wrong input, and LimitError where
    the limit was over before one candidate had run.
    """
    deadline, rung = Deadline(seconds(limit)), moving_rung(model)
    options = Options(span, count("moments", moments, 1), step, tol, threads, count("seed", seed, 0))
    prepared = prepare(scene, rung, motions, over, box, parameters, options)
    search = Search(prepared, deadline, prepared.log(out, resume), on_progress)
    with deadline.running():
        return search.found(keep_interrupted)
