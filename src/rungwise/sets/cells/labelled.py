"""What a set is made of: its request, its tree and the crossings of its boundary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.sets.cells.labels import LabelledSet
from rungwise.sets.cells.tree import Tree
from rungwise.sets.motions import SLOWEST


@dataclass(frozen=True, eq=False)
class LabelledBox(LabelledSet):
    """Labels over a box of parameters: what a `FeasibleSet` is made of, which says what the fields are."""

    tol: float
    tree: Tree
    crossings: dict[int, tuple[Ints, Reals]]
    evaluations: int
    probes: int
    hits: int
    request: dict[str, Any] = field(repr=False)

    @property
    def solutions(self) -> str:
        """Whether "slowest", "possible" or "guaranteed" motions are meant."""
        return str(self.request["solutions"])

    @property
    def name(self) -> str:
        """The model, and of which of its motions the set speaks if not of the slowest."""
        return self.model.name if self.solutions == SLOWEST else f"{self.model.name}, {self.solutions}"

    @property
    def complete(self) -> bool:
        """Whether the refinement was not ended by its budget."""
        return not self.tree.spent

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters that the set is not over."""
        return {k: v for k, v in self.request["parameters"].items() if k not in self.over}

    @property
    def unit(self) -> Reals:
        """Lengths (d,) of the tree's unit along each parameter."""
        return np.asarray((self.box[:, 1] - self.box[:, 0]) / (1 << self.tree.finest))
