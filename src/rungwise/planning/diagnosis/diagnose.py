"""Why a plan that holds on one model fails, or drifts, on another: counterfactuals.

Between two worlds (a scene on a rung) one ingredient at a time is changed; the cause is the least change with
which the motion in the first becomes the motion in the second. Where no single change closes the gap, pairs
and larger sets are tried: the cause is mixed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import combinations
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np

from rungwise.content import ByContent
from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung, rung
from rungwise.plain import brief
from rungwise.planning.diagnosis.sentences import Told, ending, places, sentence
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.inputs import Segment
from rungwise.world.find import world_of
from rungwise.world.ingredients import BALANCE, INGREDIENTS, Motion, Parting, Variant
from rungwise.world.run import completed, simulation_of

CLOSES = 0.2
"""The part of the distance between two motions that may be left for a change to count as the cause."""
APART = 0.01
"""Motions differ where they are farther apart than this part of the size of what moves."""
MOMENTS = 400
"""Moments at which motions are compared."""
NOTHING = "no difference"
OPEN, UNTRIED = "not known", "the time was over before all changes were tried that may be the cause"
WIDE = 98
"""Columns of a table."""


class Watch(NamedTuple):
    """What is called about ten times a second while runs go on, if anything is, and when they end with
    TimeOver."""

    on_progress: Callable[[Any], None] | None = None
    deadline: Deadline = Deadline()


_ALONE = Watch()


@dataclass(frozen=True, eq=False)
class Diagnosis(ByContent):
    """Where two motions part, and why.

    before, after: the rungs; causes: the smallest set of ingredients whose exchange makes the motions equal,
    empty if there is no difference; left: for each exchange that was tried, the part of the distance that
    remained; time, body: when and for which body the motions part; distance: their greatest distance until
    both runs have ended; details: numbers for each cause (see `world.ingredients`); ends: how each run ended,
    with the certificate of a jam or a missing support; outcome: outcome of the second run; inputs: of both
    runs; tols: error allowed per step in each; unfinished: the work that a limit in seconds left undone, in
    words: another, or a smaller, set of ingredients may then be the cause.
    """

    before: str
    after: str
    causes: tuple[str, ...]
    left: dict[str, float]
    time: float
    body: str
    distance: float
    details: dict[str, dict[str, Any]]
    ends: tuple[dict[str, Any], ...]
    outcome: str
    inputs: tuple[Segment, ...] = ()
    tols: tuple[float, ...] = ()
    unfinished: str = ""

    __repr__ = brief

    @property
    def cause(self) -> str:
        """The causes in one text; where there is none, that there is no difference, or none is known."""
        return " + ".join(self.causes) or (OPEN if self.unfinished else NOTHING)

    def __str__(self) -> str:
        """A line on where motions differ, and one for each cause and each end that a certificate proves."""
        where = f"{self.body} differs from t = {self.time:.4g} on, by at most {self.distance:.3g}"
        if self.cause == NOTHING:
            where = f"{NOTHING} (at most {self.distance:.2g})"
        head = f"{self.before} -> {self.after}: {where}; {self.outcome}"
        said = [*self.reasons, self.unfinished] if self.unfinished else self.reasons
        return "\n".join([head, *(f"  {line}" for line in said)])

    @property
    def reasons(self) -> list[str]:
        """A sentence for each cause, and one for each run whose end a certificate proves."""
        on = places(self.before, self.after)
        told = [(cause, Told(self.details.get(cause, {}), on, self.body)) for cause in self.causes]
        return [f"{cause}: {sentence(cause, numbers)}" for cause, numbers in told] + [
            ending(each, where) for each, where in zip(self.ends, on, strict=True) if "certificate" in each
        ]

    def called(self, before: str, after: str) -> Diagnosis:
        """The same diagnosis, with the names `before` and `after` for its two stages."""
        return replace(self, before=before, after=after)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Diagnosis:
        """A diagnosis from the `values` of its summary."""
        kept = {each.name: values[each.name] for each in fields(cls) if each.name in values}
        kept |= {name: tuple(kept[name]) for name in ("causes", "ends", "tols")}
        return cls(**kept | {"inputs": tuple(Segment(**segment) for segment in kept["inputs"])})

    def summary(self) -> dict[str, Any]:
        """Plain values, with the cause and the whole in words."""
        return asdict(self) | {"cause": self.cause, "words": str(self)}


def table(found: Sequence[Diagnosis]) -> list[str]:
    """Where a plan parts from stage to stage: a row for each diagnosis, with its sentences below it."""
    lines = [f"{'differs on':29} {'from t':>8}  {'body':8} {'apart':>8}  {'ends':13}  why"]
    for each in found:
        row = f"{each.after:29} {each.time:8.4g}  {each.body:8} {each.distance:8.3g}  {each.outcome:13}  "
        lines += wrap(row + each.cause, WIDE, subsequent_indent=" " * len(row))
        for reason in [*each.reasons, *([each.unfinished] if each.unfinished else [])]:
            lines += wrap(reason, WIDE, initial_indent="  ", subsequent_indent="    ")
    return lines


@keywords
def diagnose(
    scene: AnyScene | str | Path | Mapping[str, Any],
    before: Rung | str,
    after: Rung | str,
    *,
    inputs: Sequence[Segment] = (),
    parameters: Mapping[str, float] | None = None,
    other_parameters: Mapping[str, float] | None = None,
    tol: float | None = None,
    other_tol: float | None = None,
    limit: float | None = None,
    on_progress: Callable[[Any], None] | None = None,
) -> Diagnosis:
    """Explain why a scene moves differently on two rungs, at two sets of parameters, or at two accuracies.

    Both runs have the same inputs. The first one is on the rung `before`, the second one on `after`, with
    `other_parameters` and `other_tol`, which are those of the first if not given. `tol` is the error allowed
    per step (default: 1e-4 of the size of objects). `on_progress` is called about ten times a second with a
    line on the present run. After `limit` seconds the answer rests on the changes tried so far, and
    `unfinished` says so.

    Raises SceneError for wrong input, and LimitError if the limit is over before both motions are known.
    """
    watch = Watch(on_progress, Deadline(seconds(limit)))
    with watch.deadline.needed_for("the motions on both rungs were known"):
        return diagnosed(
            load(scene), before, after, watch, inputs=inputs, parameters=parameters,
            other_parameters=other_parameters, tol=tol, other_tol=other_tol,
        )  # fmt: skip


def diagnosed(
    loaded: AnyScene, before: Rung | str, after: Rung | str, watch: Watch, *,
    inputs: Sequence[Segment], parameters: Mapping[str, float] | None,
    other_parameters: Mapping[str, float] | None = None, tol: float | None, other_tol: float | None,
) -> Diagnosis:  # fmt: skip
    """See `diagnose`."""
    own = world_of(loaded).at(loaded.parameters(parameters)).moved
    accuracy = 1e-4 * own.size if tol is None else tol
    other_accuracy = accuracy if other_tol is None else other_tol
    one = loaded.parameters(parameters)
    other = one if other_parameters is None else loaded.parameters(other_parameters)
    world = world_of(loaded)
    a = world.variant(one, rung(before), accuracy)
    b = world.variant(other, rung(after), other_accuracy)
    return compare(a, b, inputs, own.weights, own.size, watch)


def differing(a: Variant, b: Variant) -> tuple[str, ...]:
    """The ingredients in which two worlds differ."""
    return tuple(name for name in INGREDIENTS if a.effective(name) != b.effective(name))


def compare(
    a: Variant, b: Variant, inputs: Sequence[Segment], weights: Reals, size: float, watch: Watch = _ALONE
) -> Diagnosis:
    """Why the motion in world b differs from the motion in world a; weights (n,) of coordinates, and the size
    of what moves; `watch`: see there."""
    names = differing(a, b)
    runs, (first, last), until = both(a, b, inputs, weights, watch)
    motions = {frozenset[str](): first, frozenset(names): last}
    distance = distances(first, last, until)[0]
    tried = _Tried((), {})
    if distance > APART * size:
        tried = _least(a, b, names, inputs, weights, motions, distance, until, watch)
    time, column = _parting(first, last, until, max(APART * size, 0.1 * distance))
    body = a.scene.template.coordinates[column].split(".")[0]
    details = world_of(a.scene).evidence(Parting((a, b), (first, last), time, body, size), tried.causes)
    return Diagnosis(
        before=_name(a, b), after=_name(b, a), causes=tried.causes, left=tried.left, time=time, body=body,
        distance=distance, details=details, ends=tuple(world_of(a.scene).end(run) for run in runs),
        outcome=str(runs[1].outcome), inputs=tuple(inputs), tols=(a.tol, b.tol), unfinished=tried.unfinished,
    )  # fmt: skip


def both(
    a: Variant, b: Variant, inputs: Sequence[Segment], weights: Reals, watch: Watch
) -> tuple[tuple[Any, Any], tuple[Motion, Motion], float]:
    """The runs in two worlds; the motions without conditions, which do not end at a goal; and the time until
    which they are compared, when both runs have ended."""
    runs = _run(a, inputs, watch), _run(b, inputs, watch)
    until = max(run.time for run in runs)
    whole = frozenset(differing(a, b))
    motions = [
        _motion(a.mixed(b, taken), inputs, weights, until, watch) for taken in (frozenset[str](), whole)
    ]
    return runs, (motions[0], motions[1]), until


def _name(world: Variant, other: Variant) -> str:
    """The rung, with the accuracy where the other world is on the same rung."""
    same = world.model == other.model and world.tol != other.tol
    return f"{world.model.name} @ {world.tol:g}" if same else world.model.name


class _Tried(NamedTuple):
    """The least change that was found to close the gap, what each that was tried left of it, and whether
    others were not tried, in words."""

    causes: tuple[str, ...]
    left: dict[str, float]
    unfinished: str = ""


def _least(
    a: Variant, b: Variant, names: Sequence[str], inputs: Sequence[Segment], weights: Reals,
    motions: dict[frozenset[str], Motion], distance: float, until: float,
    watch: Watch,
) -> _Tried:  # fmt: skip
    """The smallest set of ingredients that closes the gap, the one that leaves least of it among equals."""
    last, left = motions[frozenset(names)], dict[str, float]()
    for size in range(1, len(names)):
        found, unfinished = list[tuple[float, tuple[str, ...]]](), ""
        for taken in combinations(names, size):
            key = frozenset(taken)
            try:
                if key not in motions:
                    motions[key] = _motion(a.mixed(b, key), inputs, weights, until, watch)
            except TimeOver:
                if not watch.deadline.is_over:
                    raise  # by what is told of progress
                unfinished = UNTRIED
                break
            part = distances(motions[key], last, until)[0] / distance
            left[" + ".join(taken)] = part
            if part <= CLOSES:
                found.append((part, taken))
        if found:
            # The kinematic rung is rigid and knows no friction: to take it changes these, too.
            nearest = min(found, key=lambda each: (b.model.metric and BALANCE in each[1], *each))
            return _Tried(nearest[1], left, unfinished)
        if unfinished:
            return _Tried((), left, unfinished)
    return _Tried(tuple(names), left)


def _run(world: Variant, inputs: Sequence[Segment], watch: Watch) -> Any:
    simulation = simulation_of(
        world.scene, world.model, parameters=world.parameters, inputs=inputs or None, tol=world.tol
    )
    run = completed(simulation, watch.deadline, watch.on_progress)
    if not run.began:
        raise SceneError(run.reason)
    return run


def _motion(world: Variant, inputs: Sequence[Segment], weights: Reals, until: float, watch: Watch) -> Motion:
    """The motion up to this time: what comes after both runs have ended, at their goals or elsewhere, does
    not matter."""
    data = _run(world, inputs, watch).trajectory
    data = data.isel(time=slice(int(np.searchsorted(data.time.values, until)) + 1))
    return Motion(data.time.values, data.position.values * weights, data)


def distances(a: Motion, b: Motion, until: float) -> tuple[float, Reals, Reals]:
    """The greatest distance until a time, and distances (m,) over times (m,)."""
    times = np.unique(np.concatenate([np.linspace(0.0, until, MOMENTS), a.times, b.times]))
    times = times[times <= until]
    away = np.linalg.norm(a.at(times) - b.at(times), axis=1)
    return float(away.max()), times, away


def _parting(a: Motion, b: Motion, until: float, threshold: float) -> tuple[float, int]:
    """When motions part by more than the threshold, and in which coordinate most."""
    _, times, away = distances(a, b, until)
    first = int(np.argmax(away > threshold)) if (away > threshold).any() else int(np.argmax(away))
    apart = np.abs(a.at(times[first : first + 1]) - b.at(times[first : first + 1]))[0]
    return float(times[first]), int(np.argmax(apart))
