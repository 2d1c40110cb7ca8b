"""The legs of a tree, run one by one: led on where the object drifts, and joined anew to what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

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
AT_MOST = 0.5
"""Part of the way to its end that a leg which is made again leaves at most, where the object is not near;
and of the way to the goal that small legs leave."""
FALLS = 0.5
"""How far, in parts of its size, an object goes at most that fingers let go of: what leans on them, not what
they hold up."""
LED_ON, JOINED, JOINING = 2, 3, 12
"""How often a leg is led on whose object is not where it was to be; how often in one tree, or once for each
of its legs, where these are more, small ones lead to the end of a leg that cannot be made, or run, from where
the object is, and their rounds."""

Aim: TypeAlias = tuple[Reals, Callable[[Reals], bool]]
"""Places (g, n) to which a tree leads, and whether a place (n,) is there."""


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
                to = ends[k][None], _is_near(ground, ends[k], near)
                joins = self._joining(ground, node, to, manner) if joins_left else None
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

    def next(
        self, node: Node, vectors: Reals, manners: Sequence[Manner], failed: int,
        aim: Callable[[Ground, Reals], Aim],
    ) -> tuple[Node, Reals] | None:  # fmt: skip
        """The end of the next leg of a plan (k, d) from a node, and the legs (m, d) that are left after it:
        the leg made again in one of the manners, or else the first of small ones to where it was to end.
        Those at whose ends the object is are left out, and so are a few that cannot be made. The first leg
        failed so often before, and is not made again where it failed in all manners; the last is to come to
        the goal, of which `aim` knows. None where nothing leads on."""
        q, near, left_out = node.places.q[0], DRIFTED * self.work.task.size, 0
        for k, vector in enumerate(vectors):
            ground, end, is_last = self.scene.ground(vector), self.scene.end(q, vector), k + 1 == len(vectors)
            away = ground.away(q, end)
            if away < near and not is_last:
                continue
            begun = 0 if k else failed
            for manner in (*manners[begun:], *manners[:begun]) if begun < len(manners) else ():
                after = self._made(node, vector, manner)
                if after is not None and (
                    after.outcome == Code.GOAL
                    or ground.away(after.places.q[0], end) < max(near, AT_MOST * away)
                ):
                    return after, vectors[k + 1 :]
            to = _nearer(ground, q, aim(ground, q)) if is_last else (end[None], _is_near(ground, end, near))
            found = self._joined(ground, node, to, vectors[k + 1 :], manners[0])
            if found is not None:
                return found
            left_out += 1
            if left_out > SOONER:
                return None
        return None

    def let_go(self, node: Node, manner: Manner) -> Node | None:
        """Where an object comes to rest that fingers leave at a node; None where they touch none, or where it
        falls far."""
        q, begun = node.places.q[0], self.scene.letting_go(node.places.q[0])
        after = None if begun is None else self.ran(node, begun, manner)
        if begun is None or after is None:
            return None
        falls = begun.ground.away(after.places.q[0], q) > FALLS * self.work.task.size
        return None if falls else after

    def _made(self, node: Node, vector: Reals, manner: Manner) -> Node | None:
        """The node at the end of a leg (d,) that is made again from another node."""
        own = manner._replace(press=max(manner.press, float(vector[1])))
        made = self.scene.leg(node.places.q[0], vector, own, self.look)
        return None if made is None else self.ran(node, made, own)

    def _joined(
        self, ground: Ground, node: Node, aim: Aim, then: Reals, manner: Manner
    ) -> tuple[Node, Reals] | None:  # fmt: skip
        """The end of the first of small legs from a node, and the others, before those that follow (m, d)."""
        for _ in range(JOINED):
            joins = self._joining(ground, node, aim, manner)
            if joins is None:
                return None
            after = self.ran(node, Begun(ground, ground.look(node.places.q[0]), joins[0]), manner)
            if after is not None:
                others = [self.scene.vector(ground, leg, manner) for leg in joins[1:]]
                return after, np.vstack([*others, then]) if others else then
        return None

    def _joining(self, ground: Ground, node: Node, aim: Aim, manner: Manner) -> list[Leg] | None:
        """Legs of a small tree from a node to where another leg was to end; None where it finds none."""
        work, q = self.work, node.places.q[0]
        found = propose(
            ground, q, work.start.q[0], aim[0], aim[1], manner.press, work.rng, JOINING, work.failures,
            self.look, np.zeros((0, len(q))), work.task.moves[1] - node.grasps, work.grown,
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


def _is_near(ground: Ground, end: Reals, near: float) -> Callable[[Reals], bool]:
    return lambda place: ground.away(place, end) < near


def _nearer(ground: Ground, q: Reals, aim: Aim) -> Aim:
    """The same, where much nearer to the first place than q (n,) is enough."""
    (goals, reached), near = aim, _is_near(ground, aim[0][0], AT_MOST * ground.away(q, aim[0][0]))
    return goals, lambda place: reached(place) or near(place)
