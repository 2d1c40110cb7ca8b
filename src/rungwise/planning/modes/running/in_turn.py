"""The legs of a tree, run one by one: led on where the object drifts, and joined anew to what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.running.execute import Begun, Manner, Node, Scene
from rungwise.planning.modes.tree import Leg, propose
from rungwise.planning.search.problem import Found, Work

DRIFTED = 0.15
"""How far from where it was to be, in parts of its size, an object may be before legs are proposed anew."""
SOONER = 2
"""How many legs of a tree on a course may be left out at a time."""
LED_ON, JOINED, JOINING = 2, 3, 12
"""How often a leg is led on whose object is not where it was to be; how often in one tree, or once for each
of its legs, where these are more, small ones lead to the end of a leg that cannot be made, or run, from where
the object is, and their rounds."""


@dataclass(frozen=True)
class InTurn:
    """Runs legs in the scene of a task. `ran` runs one and is the node at its end, None where nothing
    follows; `look` is called with steps of trees, and may raise; model: the rung's name."""

    work: Work
    scene: Scene
    ran: Callable[[Node, Begun, Manner], Node | None]
    look: Callable[[int], None]
    model: str

    def run(
        self, node: Node, ground: Ground, legs: list[Leg], manner: Manner, sooner: bool
    ) -> Found | None:  # fmt: skip
        """Run legs of a tree one by one from a node. A leg whose object is not where it was to be is led on;
        where the next one cannot be made from there, or run, a small tree leads to its end, and the rest is
        kept."""
        work, scene, near, q = self.work, self.scene, DRIFTED * self.work.task.size, node.places.q[0]
        vectors = [scene.vector(ground, leg, manner) for leg in legs]
        ends, k, led = [leg.way.places[-1] for leg in legs], 0, 0
        joins_left = max(JOINED, len(legs))
        made: Begun | None = Begun(ground, ground.look(q), legs[0])
        while k < len(legs):
            if sooner and not led:
                k, made = self._sooner(legs, vectors, ends, k, q, manner) or (k, made)
            if not made and not led and ground.away(q, ends[k]) < near:
                k += 1
                continue
            made = made or scene.leg(q, vectors[k], manner, self.look)
            after = None if made is None else self.ran(node, made, manner)
            if after is None and (made is not None or not led):
                joins = self._joining(ground, node, ends[k], manner) if joins_left else None
                if joins is None:
                    work.failures["no leg from where the object is"] += 1
                    return None
                legs[k : k + 1], made = joins, Begun(ground, ground.look(q), joins[0])
                vectors[k : k + 1] = [scene.vector(ground, leg, manner) for leg in joins]
                ends[k : k + 1] = [*(leg.way.places[-1] for leg in joins[:-1]), ends[k]]
                joins_left, led = joins_left - 1, 0
                continue
            node, made = after or node, None
            q = node.places.q[0]
            if node.outcome == Code.GOAL:
                return node.found
            drifted = ground.away(q, ends[k]) > near
            if drifted and after is not None and led < LED_ON:
                vectors[k], led = scene.going_on(vectors[k]), led + 1
                continue
            if drifted:
                work.failures[f"the object left its planned path on {self.model}"] += 1
            k, led = k + 1, 0
        return None

    def _joining(self, ground: Ground, node: Node, end: Reals, manner: Manner) -> list[Leg] | None:
        """Legs of a small tree from a node to near the place (n,) where another leg was to end; None where it
        finds none."""
        work, near, q = self.work, DRIFTED * self.work.task.size, node.places.q[0]
        found = propose(
            ground, q, work.start.q[0], end[None], lambda place: ground.away(place, end) < near,
            manner.press, work.rng, JOINING, work.failures, self.look, np.zeros((0, len(q))),
            work.task.moves[1] - node.grasps, work.grown,
        )  # fmt: skip
        return found or None

    def _sooner(
        self, legs: Sequence[Leg], vectors: Sequence[Reals], ends: Sequence[Reals], k: int, q: Reals,
        manner: Manner,
    ) -> tuple[int, Begun] | None:  # fmt: skip
        """A leg after the leg k, by its number, that leads from q (n,) to its end at once, so that fingers
        change places less often; None where none does."""
        for j in range(min(k + SOONER, len(legs) - 1), k, -1):
            if not legs[j].changes.any() or not any(leg.changes.any() for leg in legs[k:j]):
                continue
            made = self.scene.leg(q, vectors[j], manner, self.look)
            near = DRIFTED * self.work.task.size
            if made is not None and made.ground.away(made.leg.way.places[-1], ends[j]) < near:
                return j, made
        return None
