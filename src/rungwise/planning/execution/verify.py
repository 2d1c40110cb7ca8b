"""How often a plan succeeds when starts, parameters and inputs vary as its task says; why it fails."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.cluster import Cluster
from rungwise.content import ByContent
from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.planning.execution.guards import guarded
from rungwise.planning.execution.trials import Trials, trials_at
from rungwise.planning.motion.budget import Budget
from rungwise.planning.plan import FEEDBACK, GUARDED, OPEN_LOOP, PLACES_ONLY, RE_PLANNING, Plan
from rungwise.planning.task.task import fields_of
from rungwise.scene.fields.values import shown
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.options import count, moving_rung, not_negative
from rungwise.wording import choices
from rungwise.world.carriers import TaskError
from rungwise.world.find import world_of
from rungwise.world.run import finished, simulation_of

CONFIDENCE = 0.95
"""Confidence of the bounds of a rate (Clopper and Pearson)."""
MODES = (OPEN_LOOP, GUARDED, RE_PLANNING, FEEDBACK)
MEASURED = (RE_PLANNING, FEEDBACK)
WORST = 10
"""Samples that failed that are kept."""
EXPLAINED = 50
"""Samples that failed of which the causes are sought."""
PARTS = 10
"""Parts in which samples are run together, if they may end before the last."""
ALWAYS, TWO, MORE = "the plan fails without errors, too", "only two together", "only more together"
T = TypeVar("T")
_Told: TypeAlias = "Callable[[int], None] | None"
_Runner: TypeAlias = "Callable[..., tuple[Ints, Reals]]"


@dataclass(frozen=True, eq=False)
class Sample(ByContent):
    """One sample that failed: its number, outcome, margin, parameters and errors of inputs."""

    number: int
    outcome: str
    margin: float
    parameters: dict[str, float]
    inputs: dict[str, float]


@dataclass(frozen=True, eq=False)
class Verification(ByContent):
    """Results of n samples of a plan on a rung; of one run if nothing is uncertain.

    model, tol: rung and accuracy of the runs; seed: of the samples; successes: their number in `samples`;
    lower: one-sided lower Clopper-Pearson bound of the rate of success at 95 %; upper: the upper bound;
    failures: outcomes and their numbers; causes: for each uncertain value, how many of the first `explained`
    failures would succeed if it were as planned; worst: failed samples, sorted by margin; mode: how the plan
    was executed; unfinished: the work that a limit in seconds left undone, in words; noise: of measured
    places, with feedback. Samples unfinished at the limit do not count.
    """

    plan: Plan = field(repr=False)
    model: str
    tol: float
    samples: int
    successes: int
    lower: float
    upper: float
    failures: dict[str, int]
    causes: dict[str, int]
    worst: tuple[Sample, ...]
    seed: int
    mode: str = OPEN_LOOP
    unfinished: str = ""
    noise: float = 0.0
    _points: Reals = field(default_factory=lambda: np.zeros((0, 1)), repr=False)

    @property
    def explained(self) -> int:
        """Of how many failures the causes were sought."""
        return min(EXPLAINED, self.samples - self.successes)

    def __repr__(self) -> str:
        return (
            f"<Verification of a plan of {cut(self.plan.scene.name)} on {cut(self.model)}: {self.successes}"
            f" of {self.samples} reached the goal, {self.lower:.3f} to {self.upper:.3f} at 95 %>"
        )

    @keywords
    def replay(self, sample: Sample, *, limit: float | None = None) -> AnyRun:
        """The run of a sample once more; with re-planning, of what was executed. After `limit` seconds as far
        as it has come, `running`. Raises LimitError where the limit is over before it is known what was
        executed."""
        deadline = Deadline(seconds(limit))
        time = Budget(None, deadline.seconds)
        trials = Trials(
            self.plan, moving_rung(self.model), self.tol, self.mode, self.seed, time=time, noise=self.noise
        )
        with deadline.needed_for(f"it was known what {self.mode} executes"):
            inputs = trials.executed(self._points[sample.number])
        simulation = simulation_of(
            self.plan.scene, self.model, parameters=sample.parameters, tol=self.tol, inputs=inputs
        )
        run: AnyRun = finished(simulation, None, deadline)
        return run

    def __str__(self) -> str:
        head = f"{self.plan.scene.name} on {self.model}, {self.mode}"
        if not self.samples:
            return f"{head}: {self.unfinished}"
        if not fields_of(self.plan.scene).uncertain:
            ended = "reaches the goal" if self.successes else f"ends {next(iter(self.failures))}"
            return f"{head}: the plan as it is {ended}; task.uncertain names nothing that varies"
        lines = [
            f"{head}: {self.successes} of {self.samples} succeed, at least {self.lower:.3f} with a confidence"
            f" of {CONFIDENCE:.0%}"
        ]
        lines += [f"  {outcome}: {count}" for outcome, count in self.failures.items()]
        if self.causes:
            causes = ", ".join(f"{cause} {count}" for cause, count in self.causes.items() if count)
            lines.append(f"  of {self.explained} failures, would succeed with a value as planned: {causes}")
        lines += [
            f"  sample {each.number}: {each.outcome}, margin {each.margin:.3g}" for each in self.worst[:3]
        ]
        lines += [f"  {self.unfinished}"] if self.unfinished else []
        return "\n".join(lines)

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise verify --json` prints them."""
        kept = (
            "model", "tol", "samples", "successes", "lower", "upper", "failures", "causes", "seed", "mode",
            "unfinished", "noise",
        )  # fmt: skip
        values = {name: getattr(self, name) for name in kept}
        return {"scene": self.plan.scene.name} | values | {"worst": [asdict(each) for each in self.worst]}


@keywords
def verify(
    plan: Plan,
    model: Rung | str | None = None,
    samples: int = 200,
    *,
    mode: str | None = None,
    noise: float = 0.0,
    rate: float | None = None,
    limit: float | None = None,
    seed: int = 0,
    tol: float | None = None,
    threads: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> Verification:
    """Measure how often the plan succeeds: run it with starts, parameters and errors of inputs drawn from the
    task's `uncertain`, or once if this names nothing.

    Args:
        model, tol: those of the plan's last stage if not given.
        mode: "open loop"; "guarded moves": a move ends at the touch of a robot and an object; "re-planning":
            after each move the actual state is read, and the rest planned anew with the plan's own
            parameters; "feedback": the plan's policy leads the run from measured places (see `Plan.policy`).
            The plan's own mode if not given.
        noise: with feedback, standard deviation of the measured places of objects, as a length; for
            angles it is divided by the reach of the object.
        rate: with re-planning and feedback, sampling ends as soon as the bound of success can no longer reach
            this rate.
        limit: seconds after which the call returns with the samples that were run; see `unfinished`.
        seed: of the samples; threads: as many as there are cores if not given.
        cluster: address of a dask scheduler whose workers execute instead of threads.
        on_progress: called with the number of samples done.

    Raises TaskError where there is no plan, or no move to guard.
    """
    if plan.stage is None or not plan.found:
        raise TaskError(f"plan: there is none. {plan.reason}")
    if not plan.stage.model.moves:
        raise TaskError(f"plan: {PLACES_ONLY}")
    chosen, number = moving_rung(plan.stage.model if model is None else model), count("samples", samples, 1)
    if not fields_of(plan.scene).uncertain:
        number = 1
    time = Budget(None, limit)
    trials = Trials(
        *_in_mode(plan, chosen, plan.mode if mode is None else mode, plan.tol if tol is None else tol),
        seed, threads, time, not_negative("noise", noise),
    )  # fmt: skip
    run, close = _runner(trials, cluster)
    try:
        points, causes = trials.draw(number), dict[str, int]()
        parts = number if trials.mode in MEASURED and cluster is None else PARTS
        ends = _run(run, trials.mode, parts, points, rate, time, on_progress)
        if ends.unfinished:
            return _verification(trials, points, ends, causes)
        failed = points[: len(ends.outcome)][ends.outcome != Code.GOAL][:EXPLAINED]
        if _in_time(time, partial(_causes, run, trials, failed, causes, time)) is None:
            ends = ends._replace(unfinished="the time was over before all causes of failures were sought")
        return _verification(trials, points, ends, causes)
    finally:
        close()


def _in_mode(plan: Plan, model: Rung, mode: str, tol: float) -> tuple[Plan, Rung, float, str]:
    """What is executed: the plan, with guarded moves if they are asked for. Raises TaskError."""
    if mode not in MODES:
        raise TaskError(f"mode: unknown {shown(mode)}{choices(mode, MODES)}")
    has_guards = any(segment.until for segment in plan.segments)
    if mode == OPEN_LOOP and has_guards:
        raise TaskError(f"mode: the plan has guarded moves; valid: {GUARDED}, {RE_PLANNING}, {FEEDBACK}")
    if mode == GUARDED and not has_guards:
        other = guarded(plan)
        if other is None:
            raise TaskError("mode: no move can be guarded: no robot comes to touch an object in one")
        return other, model, tol, mode
    return plan, model, tol, mode


def _runner(trials: Trials, address: str | None) -> tuple[_Runner, Callable[[], None]]:
    """What runs samples, and what closes it: threads, or the workers of a cluster."""
    if address is None:
        return trials.run, lambda: None
    if not world_of(trials.plan.scene).on_clusters:
        raise TaskError(f"cluster: {trials.plan.scene.name} runs in threads of this machine")
    request = {
        "model": trials.model.name, "inertia": trials.model.inertia, "tol": trials.tol, "mode": trials.mode,
        "seed": trials.seed, "noise": trials.noise,
    }  # fmt: skip
    cluster = Cluster(address, trials_at, (trials.plan.text(), json.dumps(request)), TaskError)

    def run(points: Reals, on_progress: _Told = None) -> tuple[Ints, Reals]:
        answers = cluster.answers([points], on_progress or _silent)
        return next(
            ((outcome, margin) for _, outcome, margin in answers), (np.zeros(0, np.int64), np.zeros(0))
        )

    return run, cluster.close


class _Ends(NamedTuple):
    """Outcomes and margins (m,) of the first samples, and what a limit left undone."""

    outcome: Ints
    margin: Reals
    unfinished: str = ""


def _run(
    run: _Runner, mode: str, parts: int, points: Reals, rate: float | None, time: Budget, on_progress: _Told
) -> _Ends:
    """How the samples end, in so many parts; the first ones where the rate is out of reach after them, or the
    time is over."""
    least = rate if mode in MEASURED else None
    parts = parts if least is not None or time.seconds is not None else 1
    ends = _Ends(np.zeros(0, np.int64), np.zeros(0))
    for part in np.array_split(points, min(parts, len(points))):
        found = _in_time(time, partial(run, part, _told(time, on_progress, len(ends.outcome))))
        if found is None:
            left = f"{len(ends.outcome)} of {len(points)} samples were run before the time was over"
            return ends._replace(unfinished=left)
        ends = _Ends(np.append(ends.outcome, found[0]), np.append(ends.margin, found[1]))
        failures = int((ends.outcome != Code.GOAL).sum())
        if least is not None and bound_below(len(points) - failures, len(points)) < least:
            break
    return ends


def _in_time(time: Budget, work: Callable[[], T]) -> T | None:
    """What the work gives; None where the time is over before it is done."""
    try:
        time.look()
        return work()
    except TimeOver:
        if time.is_in_time():
            raise  # not by this limit
        return None


def _silent(_done: int) -> None:
    """Tell nobody."""


def _told(time: Budget, on_progress: _Told, done: int) -> Callable[[int], None]:
    """Looks whether time is left, and tells how many samples are done."""

    def told(more: int) -> None:
        time.look()
        if on_progress is not None:
            on_progress(done + more)

    return told


def _causes(
    run: _Runner, trials: Trials, failed: Reals, found: dict[str, int], time: Budget
) -> dict[str, int]:
    """How many of these samples (m, 1 + k) would succeed with a value as planned, by its name; and how many
    only with two, or with more: `found`, filled on the way. A sample is counted for every value that would
    do. Raises TimeOver."""
    if not len(failed):
        return found
    as_planned = np.concatenate([failed[:1, 0], trials.nominal])[None]
    if run(as_planned, time.look)[0][0] != Code.GOAL:
        found[ALWAYS] = len(failed)
        return found
    names, mended = trials.names, np.zeros(len(failed), bool)
    for k, name in enumerate(names):
        alone = _as_planned(run, trials, failed, (k,), time)
        found[name], mended = int(alone.sum()), mended | alone
    left, pairs = failed[~mended], np.zeros(int((~mended).sum()), bool)
    for two in combinations(range(len(names)), 2):
        pairs[~pairs] = _as_planned(run, trials, left[~pairs], two, time)
    found |= {TWO: int(pairs.sum()), MORE: int((~pairs).sum())}
    return found


def _as_planned(
    run: _Runner, trials: Trials, points: Reals, columns: tuple[int, ...], time: Budget
) -> NDArray[np.bool_]:
    """Which samples (m, 1 + k) succeed with the values of these columns as planned."""
    mended = points.copy()
    mended[:, [1 + k for k in columns]] = trials.nominal[list(columns)]
    return run(mended, time.look)[0] == Code.GOAL if len(points) else np.zeros(0, bool)


def bound_below(successes: int, samples: int) -> float:
    """The one-sided bound of the rate of success (Clopper and Pearson 1934) at a confidence of 95 %."""
    from scipy.stats import beta

    return float(beta.ppf(1.0 - CONFIDENCE, successes, samples - successes + 1)) if successes else 0.0


def _verification(trials: Trials, points: Reals, ends: _Ends, causes: dict[str, int]) -> Verification:
    outcome, margin = ends.outcome, ends.margin
    n, k = len(outcome), int((outcome == Code.GOAL).sum())
    bounds = bound_below(k, n), 1.0 - bound_below(n - k, n)
    if n and not trials.names:
        bounds = float(k), float(k)
    failed = np.flatnonzero(outcome != Code.GOAL)
    order = failed[np.argsort(np.nan_to_num(margin[failed], nan=-np.inf), kind="stable")]
    worst = tuple(
        Sample(int(i), Code(int(outcome[i])).name.lower(), float(margin[i]), *trials.world(points[i]))
        for i in order[:WORST]
    )
    names = Counter(Code(int(code)).name.lower() for code in outcome[failed])
    return Verification(
        plan=trials.plan, model=trials.model.name, tol=trials.tol, samples=n, successes=k,
        lower=bounds[0], upper=bounds[1], failures=dict(names), causes=causes,
        worst=worst, seed=trials.seed, mode=trials.mode, unfinished=ends.unfinished,
        noise=trials.noise,
        _points=points,
    )  # fmt: skip
