"""What a fit found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rungwise.content import ByContent
from rungwise.fitting.score import Phase
from rungwise.fitting.unlike import Unlike
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.plain import cut

OUTSIDE = 1.8
"""Loss of whitened errors, over what measurement and starts make it, beyond which motions are outside. Where
the rung made the motions itself it is 1.0 to 1.5: starts near impacts are not as normal as they are taken to
be, and deviations that were estimated are known to a part of themselves."""


@dataclass(frozen=True)
class Residual:
    """Errors of one coordinate: name; rms, the root of the mean square, and median of the size, in its unit;
    deviation: of the measurement; expected: what measurement and starts make of the median error."""

    name: str
    rms: float
    median: float
    deviation: float
    expected: float


@dataclass(frozen=True)
class Alike:
    """Values of one of several minima that the motions do not tell apart; share: the part of the draws of
    trials in which it is the best."""

    values: dict[str, float]
    share: float

    def __str__(self) -> str:
        return (
            ", ".join(f"{name} {value:.4g}" for name, value in self.values.items()) + f" ({self.share:.0%})"
        )


@dataclass(frozen=True, repr=False, eq=False)
class Fit(ByContent):
    """Parameters of a scene from motions, on a rung.

    measured_on: the scene whose motions were measured; model: the rung; over: names of the fitted parameters;
    values: parameters by name; intervals: their 95 % intervals (bootstrap over trials); correlation (k, k),
    in the order of `over`; open: parameters that the motions do not determine, by name, with a line on each;
    alike: sets of values, if several fit alike, which the intervals join; residuals: by coordinate; phases:
    errors of short spans, by phase (flight, impact, sliding, rest); misfit: loss of the errors divided by its
    value if measurement and starts were the only errors (then 1), median over trials; unlike: what of the
    errors is least like those of motions that the rung makes, None where `misfit` decides; trials, spans:
    their numbers; span: length of a span; moved: greatest length by which starts were moved;
    ended: fraction of runs that reached the end of their span; loss: the robust loss; runs: number of runs;
    unfinished: the work that a limit left undone, in words; wall_s.
    """

    measured_on: Any
    model: Rung
    over: tuple[str, ...]
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    correlation: Reals
    open: dict[str, str]
    residuals: tuple[Residual, ...]
    phases: tuple[Phase, ...]
    misfit: float
    trials: int
    spans: int
    span: float
    moved: float
    ended: float
    loss: float
    runs: int
    wall_s: float
    unfinished: str = ""
    alike: tuple[Alike, ...] = ()
    unlike: Unlike | None = None

    @property
    def outside(self) -> bool:
        """Whether no parameters explain the motions within the deviation of the measurement."""
        return self.misfit > OUTSIDE or (self.unlike is not None and self.unlike.is_so)

    @property
    def ok(self) -> bool:
        """Whether the search came to its end, all that was asked for is determined by one set of values, and
        it explains the motions."""
        return not (self.unfinished or self.open or self.alike or self.outside)

    @property
    def scene(self) -> Any:
        """The scene with the values found as defaults, and what remains uncertain in its task: the intervals,
        evenly, for `verify`, `plan(robust=...)` and `design(robust=True)`."""
        file = self.measured_on.file
        parameters = {
            name: each.model_copy(update={"default": self.values.get(name, each.default)})
            for name, each in file.parameters.items()
        }
        changes: dict[str, Any] = {"parameters": parameters}
        if file.task is not None:
            known = {name: each for name, each in file.task.uncertain.items() if name not in self.over}
            spread = (
                type(file.task)
                .model_validate(
                    {"uncertain": {name: {"uniform": list(ends)} for name, ends in self.intervals.items()}}
                )
                .uncertain
            )
            changes["task"] = file.task.model_copy(update={"uncertain": known | spread})
        return self.measured_on.changed(**changes)

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:.4g}" for name, value in self.values.items())
        return f"<Fit of {cut(self.measured_on.name)} on {self.model.name}: {cut(values, 120)}>"

    def __str__(self) -> str:
        head = f"{self.measured_on.name} on {self.model.name}: {self.trials} trials, {self.spans} spans of"
        lines = [f"{head} {self.span:.3g}"]
        for name, value in self.values.items():
            low, high = self.intervals[name]
            lines.append(f"  {name} = {value:.4g} ({low:.4g} to {high:.4g})".rstrip())
        lines += [f"  not determined: {name}: {line}" for name, line in self.open.items()]
        if self.alike:
            sets = "; ".join(map(str, self.alike))
            lines.append(f"  {len(self.alike)} sets of values fit alike: {sets}; intervals join them")
        lines += [
            f"  {each.name}: errors {each.rms:.3g} (root mean square), median {each.median:.3g};"
            f" measurement and starts make {each.expected:.3g}"
            for each in self.residuals
        ]
        lines += [
            f"  {each.name}: {each.spans} short spans, place {each.place:.3g}, turn {each.turn:.3g}"
            for each in self.phases
        ]
        lines.append(f"  {self.verdict}")
        lines += [f"  {self.unfinished}"] if self.unfinished else []
        return "\n".join(lines)

    @property
    def verdict(self) -> str:
        """Whether the measurement's deviation explains what is left, in words."""
        if self.unlike is not None and self.unlike.is_so:
            return (
                f"outside: no parameters of {', '.join(self.over)} explain the motions; {self.unlike.what} is"
                f" {self.unlike.distance:.3g} deviations from what the rung makes, where"
                f" {self.unlike.limit:.3g} may be chance"
            )
        if self.outside:
            return (
                f"outside: no parameters of {', '.join(self.over)} explain the motions; errors weigh"
                f" {self.misfit:.3g} times what measurement and starts make"
            )
        return f"explained: errors weigh {self.misfit:.3g} times what measurement and starts make"

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise fit --json` prints them."""
        return {
            "scene": self.measured_on.name, "model": self.model.name, "values": self.values,
            "intervals": {name: list(ends) for name, ends in self.intervals.items()},
            "correlation": self.correlation.tolist(), "open": self.open,
            "alike": [vars(each) for each in self.alike],
            "residuals": [vars(each) for each in self.residuals],
            "phases": [vars(each) for each in self.phases], "misfit": self.misfit,
            "unlike": None if self.unlike is None else self.unlike._asdict(),
            "outside": self.outside, "verdict": self.verdict, "trials": self.trials, "spans": self.spans,
            "span": self.span, "moved": self.moved, "ended": self.ended, "loss": self.loss,
            "runs": self.runs, "wall_s": self.wall_s, "unfinished": self.unfinished,
        }  # fmt: skip
