"""Where in a box of parameters a scene succeeds best, and how far each of them may drift.

A *design* is a point (d,) of the box. It is tried at n values of what the task calls uncertain, the same
quantiles for every design; without uncertainty n is 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.stats import norm

from rungwise.deadline import TimeOver
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.planning.motion.budget import Budget
from rungwise.planning.task.task import fields_of, numbers_at
from rungwise.scene.contract import AnyScene
from rungwise.sets.cells.labels import Label
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.sets.motions import SLOWEST, Motions

ELITE, SPREAD, ROUNDS = 0.2, 0.3, 20
"""Part of the designs of a round about which the next is drawn, deviation of the first round in sides of the
box, and the greatest number of rounds."""
CLOSE = 1e-3
"""The search ends where its deviation is so small a part of each side."""
GRID = {1: 2000, 2: 400, 3: 100, 4: 40}
"""Points of the grid along each axis on which the middle of a set is looked for."""
SCAN, HALVINGS = 21, 8
"""Points of a scan from a design to each side of the box, and halvings that locate where success ends."""
WORST = 0.1
"""The part of worst samples whose margin decides between designs of the same rate."""


@dataclass
class Tuner:
    """Designs over `names` in a box (d, 2), tried on a rung at quantiles (n, k) of what is uncertain.

    `count` counts runs, `outcomes` how they ended; runs raise TimeOver when that of `time` is over.
    """

    scene: AnyScene
    model: Rung
    names: tuple[str, ...]
    box: Reals
    parameters: dict[str, float]
    quantiles: Reals
    tol: float
    threads: int | None = None
    on_progress: Callable[[int], None] | None = None
    time: Budget = field(default_factory=Budget)
    count: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._uncertain = list(fields_of(self.scene).uncertain) if self.quantiles.shape[1] else []
        self._over = list(dict.fromkeys([*self.names, *self._uncertain]))
        self._batch = Motions(
            self.scene, self.model, self._over, SLOWEST, parameters=self.parameters, tol=self.tol,
            threads=self.threads,
        )  # fmt: skip

    def tried(self, designs: Reals, quantiles: Reals | None = None) -> tuple[Reals, Reals]:
        """Rates of success (m,) of designs (m, d), and margins (m,): the least of a tenth of the samples."""
        quantiles = self.quantiles if quantiles is None else quantiles
        points = np.concatenate([self._worlds(design, quantiles) for design in designs])
        found = self._batch.run(points, deadline=self.time.deadline, on_progress=self.time.look)
        if (found.outcome == Code.RUNNING).any():
            raise TimeOver("in a run of a design")
        self.count += len(points)
        self.outcomes.update(OUTCOMES[Code(code)].name for code in found.outcome.tolist())
        if self.on_progress is not None:
            self.on_progress(self.count)
        shape = len(designs), -1
        reached = (found.outcome == Code.GOAL).reshape(shape)
        margins = np.sort(np.nan_to_num(found.margin, nan=-np.inf).reshape(shape), axis=1)
        worst = max(1, int(WORST * margins.shape[1]))
        return reached.mean(axis=1), margins[:, worst - 1]

    def _worlds(self, design: Reals, quantiles: Reals) -> Reals:
        """Values (n, k) of all parameters that vary: those of the design, and about it what is uncertain."""
        given = self.parameters | dict(zip(self.names, design.tolist(), strict=True))
        columns = {name: np.full(len(quantiles), given[name]) for name in self._over}
        if self._uncertain:
            numbers = numbers_at(self.scene, given)
            for k, name in enumerate(self._uncertain):
                base = given[name] if name in self.scene.template.inputs else 0.0
                columns[name] = _value(self.scene, name, numbers, base, quantiles[:, k])
        return np.column_stack([columns[name] for name in self._over])

    def searched(
        self,
        start: Reals | None,
        size: int,
        budget: int,
        rng: np.random.Generator,
        spread: float = SPREAD,
    ) -> tuple[Reals, float]:
        """The best design that the cross-entropy method finds in the time that there is, from about a start
        or from the whole box, and its rate of success; that is 0 where nothing was tried."""
        low, side = self.box[:, 0], np.ptp(self.box, axis=1)
        d, n = len(self.names), len(self.quantiles)
        mean = np.full(d, 0.5) if start is None else (start - low) / side
        deviation = np.full(d, spread)
        best, score = mean, (-1.0, -np.inf)
        for number in range(ROUNDS):
            if number > 0 and (self.count + size * n > budget or deviation.max() < CLOSE):
                break
            wide = number == 0 and start is None
            designs = rng.random((size, d)) if wide else mean + deviation * rng.standard_normal((size, d))
            designs = np.clip(np.vstack([best, designs]), 0.0, 1.0)
            try:
                rates, margins = self.tried(low + side * designs)
            except TimeOver:
                break
            order = np.lexsort((-margins, -rates))
            elite = designs[order[: max(2, int(ELITE * size))]]
            mean, deviation = elite.mean(axis=0), elite.std(axis=0)
            first = order[0]
            if (rates[first], margins[first]) >= score:
                best, score = designs[first], (float(rates[first]), float(margins[first]))
        return np.asarray(low + side * best), max(0.0, score[0])

    def drift(self, design: Reals, rate: float) -> Reals:
        """The interval (d, 2) about the design along each axis in which its rate stays at least `rate`, found
        on a grid across the box and located by bisection. Raises TimeOver."""
        ends = [(axis, side) for axis in range(len(design)) for side in (0, 1)]
        kept, lost = np.array([design[axis] for axis, _ in ends]), np.array([self.box[end] for end in ends])
        grids = [np.linspace(a, b, SCAN)[1:] for a, b in zip(kept, lost, strict=True)]
        holds = self._along(design, ends, np.array(grids)) >= rate
        for k, grid in enumerate(grids):
            fails = np.flatnonzero(~holds[k])
            first = int(fails[0]) if len(fails) else len(grid)
            kept[k] = grid[first - 1] if first > 0 else kept[k]
            lost[k] = grid[first] if len(fails) else kept[k]
        for _ in range(HALVINGS):
            middle = 0.5 * (kept + lost)
            holds = self._along(design, ends, middle[:, None])[:, 0] >= rate
            kept, lost = np.where(holds, middle, kept), np.where(holds, lost, middle)
        return kept.reshape(-1, 2)

    def _along(self, design: Reals, ends: list[tuple[int, int]], values: Reals) -> Reals:
        """Rates (m, p) of the design with one coordinate changed, for m axes and p values each."""
        designs = np.tile(design, (*values.shape, 1))
        for k, (axis, _) in enumerate(ends):
            designs[k, :, axis] = values[k]
        return self.tried(designs.reshape(-1, len(design)))[0].reshape(values.shape)


def centre(found: FeasibleSet) -> tuple[Reals, float] | None:
    """The point of a set that lies farthest from its boundary and from the box's sides, with the distance,
    both measured in sides of the box; None where nothing is feasible.

    Of points that are as far, within a cell of the grid, the mean of the largest connected group is nearest.
    """
    d = len(found.over)
    count = GRID[d]
    axis = (np.arange(count) + 0.5) / count
    places = np.stack(np.meshgrid(*[axis] * d, indexing="ij"), axis=-1).reshape(-1, d)
    low, side = found.box[:, 0], np.ptp(found.box, axis=1)
    labels = found.labels(low + side * places).reshape((count,) * d)
    inside = np.pad(labels == Label.FEASIBLE, 1)
    if not inside.any():
        return None
    depth = distance_transform_edt(inside)[(slice(1, -1),) * d] - 0.5
    ridge = places[(depth >= depth.max() - 1.0).ravel()]
    middle = ridge.mean(axis=0)
    best = ridge[np.argmin(np.linalg.norm(ridge - middle, axis=1))]
    return low + side * best, float(depth.max() / count)


def _value(scene: AnyScene, name: str, numbers: dict[str, float], base: float, quantiles: Reals) -> Reals:
    """What is uncertain, at quantiles in 0..1 and within its range; for an input it is an error of `base`."""
    spread = fields_of(scene).uncertain[name]
    kind = "uniform" if spread.uniform is not None else "normal"
    first, second = (numbers[f"task.uncertain.{name}.{kind}.{k}"] for k in (0, 1))
    even = kind == "uniform"
    values = first + (second - first) * quantiles if even else norm.ppf(quantiles, first, second)
    return np.clip(base + values, *(scene.file.parameters[name].range or (-np.inf, np.inf)))
