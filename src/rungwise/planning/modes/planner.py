"""Searches by contact modes on a stage: from the ends of runs, trees propose legs, which are run in turn."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.modes.fingers import fingers_of
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.guide import guide
from rungwise.planning.modes.hands.gaits import by_hand, hand_in
from rungwise.planning.modes.reach.planner import by_reach, reach_in
from rungwise.planning.modes.running.execute import Begun, Manner, Node, Scene
from rungwise.planning.modes.running.in_turn import Aim, InTurn
from rungwise.planning.modes.tree import far, propose
from rungwise.planning.motion.placements import placed_part
from rungwise.planning.motion.propagate import GOES_ON, Predictor
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import Found, Work
from rungwise.planning.search.search import IDLE, search, search_once
from rungwise.scene.language.lasting import names_in
from rungwise.world.contract import OUTLINES
from rungwise.world.find import world_of

PRESSES, PACES = (0.05, 0.1, 0.05, 0.2), (1.0, 1.0, 2.0, 4.0)
"""Parts of the load with which fingers press at least, and how many times slower than their speed they go, in
turn."""
ROUNDS, ALONG = (40, 80, 160), 4
"""Rounds of trees, in turn; and at least, for each place of a course that is left."""
AGAIN = (Manner(0.0, 1.0), Manner(0.1, 2.0), Manner(0.2, 4.0))
"""How legs are made again: with which part of the load fingers press at least, and how much slower."""
ENDS = 8
"""How often another leg leads on to the goal where the last one of a plan that is made again does not."""
ATTEMPTS, EVENLY, BY_MODES, AT_FIRST = 12, 0.4, 0.8, 0.05
"""Proposals of one turn, and the parts of what is left that a turn may take: where supports carry all
objects; a turn by modes where they do not, or where something is in the straight way; and there the first
turn by pushes."""
PATIENT, GIVEN_UP = 3, 4.0
"""Trees from a node after which it counts as a dead end ever more, however near to the goal it is; and how
many times more, for each further tree."""
SPARING = 4.0
"""How much more a node with a course lacks where more of its moves than of the course are spent."""
OTHERS = 0.1
"""How often another object than one of the goal is moved, and how often one that fingers may touch is pushed
by another."""
ASIDE = 0.8
"""How often an object pushes others aside that lie loose, where it may, in place of all else."""
STEP = 3
"""Simulated steps that a step of a tree counts as, or a grasp that is drawn there, so that a budget bounds
searches that run little. Chosen by trial, to a factor of three of the time that either takes."""
GUIDES, COURSES = 8, 3
"""How often the way of an object alone is sought, to one place at the goal after the other; how many of the
shortest are followed, in turn."""
WAYS = "ways of objects alone"
"""By which these are kept for all stages."""
NO_WAY = "no path for the object past its surroundings"
NO_GOAL = "no place of the objects at the goal"
"""Why no course, and no tree, was found."""


def suits(work: Work) -> bool:
    """Whether modes can be planned: a scene with fingers, in space such as it names, and a goal that places
    decide."""
    task = work.named.task
    return (
        (task.is_led or (bool(task.carriers) and world_of(task.scene).shapes == OUTLINES))
        and bool(fingers_of(task))
        and placed_part(task.scene.file.goal or "") is not None
        and len(goals_of(work)) > 0
    )


def mode_planner(work: Work, predictor: Predictor) -> ModePlanner | None:
    """The search by modes on a stage, which goes on where it was; None where there is none."""
    if not suits(work):
        return None
    name = str(predictor.stage)
    if name not in work.kept:
        work.kept[name] = ModePlanner(work)
    found: ModePlanner = work.kept[name]
    found.predictor = predictor
    return found


def anew_on(work: Work, predictor: Predictor) -> Found | None:
    """A new plan on a stage: by contact modes and by pushes that are tried, in turns; by pushes first where
    supports carry all objects, unless it names fingers on servos, or there is a path to follow; these take
    less of the time where something is in the straight way of an object, and least at first."""
    arm = reach_in(work)
    if arm is not None:
        return _in_turns(work, predictor, lambda: by_reach(work, predictor, arm))
    planner = mode_planner(work, predictor)
    if planner is None:
        hand = hand_in(work)
        return (
            search(work, predictor)
            if hand is None
            else _in_turns(work, predictor, lambda: by_hand(work, predictor, hand))
        )
    idle, slides = 0, not work.named.task.is_led and not len(work.path)
    share = EVENLY if slides and not planner.is_barred else BY_MODES
    others = share if share == EVENLY else AT_FIRST if slides else 1.0 - share
    while work.budget.left and idle < IDLE:
        runs = work.budget.outcomes.total()
        for by_modes in (False, True) if slides else (True, False):
            try:
                with work.budget.part(share if by_modes else others):
                    found = planner.search(ATTEMPTS) if by_modes else search_once(work, predictor)
            except TimeOver:
                found = None
            if found is not None:
                return found
            work.budget.look()
        others = share if share == EVENLY else 1.0 - share
        idle = idle + 1 if work.budget.outcomes.total() == runs else 0
    return None


def _in_turns(work: Work, predictor: Predictor, own: Callable[[], Found | None]) -> Found | None:
    """A new plan by a search of its own, and by searches of all inputs, in turns."""
    idle = 0
    while work.budget.left and idle < IDLE:
        runs = work.budget.outcomes.total()
        for share in (BY_MODES, 1.0 - BY_MODES):
            try:
                with work.budget.part(share):
                    found = own() if share == BY_MODES else search_once(work, predictor)
            except TimeOver:
                found = None
            if found is not None:
                return found
            work.budget.look()
        idle = idle + 1 if work.budget.outcomes.total() == runs else 0
    return None


class ModePlanner:
    """The search by modes on one stage; it goes on where it was at each call."""

    predictor: Predictor

    def __init__(self, work: Work, levels: Reals | None = None) -> None:
        """Begin where the work starts, after inputs (u,), those of the instance if none are given."""
        self._asked, self.work = work, work.named
        self.scene = Scene(self.work)
        self.nodes = [self.scene.root(levels)]
        self.turn = 0
        self._places = goals_of(work)
        self._courses: dict[tuple[int, int, bytes], list[Reals]] = self.work.kept.setdefault(WAYS, {})

    @property
    def is_barred(self) -> bool:
        """Whether something is in the straight way of an object of which the goal speaks."""
        return any(len(self._course(self._freest(ground))) for ground in self._wanted())

    def search(self, attempts: int) -> Found | None:
        """A plan, after at most so many proposals."""
        if not len(self._places):
            self.work.failures[NO_GOAL] += 1
            return None
        for _ in range(attempts):
            found = self._attempt() if self.work.budget.left else None
            if found is not None:
                return found
        return None

    def led_again(self, vectors: Reals, failed: int = 0) -> Found | None:
        """The legs of a plan (k, d), each made again from where the object is; harder and more slowly where
        they fail, at once where they failed so often before. Raises TimeOver."""
        first = min(failed, len(AGAIN) - 1)
        for manner in AGAIN[first:] + AGAIN[:first]:
            found = self._again(vectors, manner) if self.work.budget.left else None
            if found is not None:
                return found
        return None

    def led_on(self, vectors: Reals) -> Found | None:
        """The legs of a plan (k, d), each made again from where the object is, or others to where it was to
        end, and at last to the goal; else a plan that goes on from the ends of these. Raises TimeOver."""
        left, node, ends = vectors, self.nodes[0], ENDS
        while self.work.budget.left and (len(left) or ends):
            left, ends = (left, ends) if len(left) else (vectors[-1:], ends - 1)
            after = self._in_turn().next(node, left, AGAIN, 0, self._aim)
            if after is None:
                break
            node, left = after
            if node.outcome == Code.GOAL:
                return node.found
        return self.search(ATTEMPTS)

    def next_leg(self, vectors: Reals, failed: int = 0) -> tuple[Node, Reals] | None:
        """The end of the next leg of a plan (k, d), of which the first failed so often before, from where the
        object is, and the legs that are left after it: see `InTurn.next`. Raises TimeOver."""
        return self._in_turn().next(self.nodes[0], vectors, AGAIN, failed, self._aim)

    def let_go(self) -> Node | None:
        """Where an object comes to rest that fingers leave where planning starts: see `InTurn.let_go`. Raises
        TimeOver."""
        return self._in_turn().let_go(self.nodes[0], AGAIN[0])

    def _aim(self, ground: Ground, q: Reals) -> Aim:
        """Places at the goal, those next to q (n,) first, and whether a place is there."""
        return self._goals(ground, q), self._reached(ground)

    def _in_turn(self) -> InTurn:
        return InTurn(self.work, self.scene, self._ran, self._look, self.predictor.stage.model.name)

    def _again(self, vectors: Reals, manner: Manner) -> Found | None:
        """The legs of a plan (k, d), each made again from where the object is."""
        node = self.nodes[0]
        for vector in vectors:
            after = self._made(node, vector, manner)
            if after is None:
                return None
            node = after
            if node.outcome == Code.GOAL:
                return node.found
        return None

    def _made(self, node: Node, vector: Reals, manner: Manner) -> Node | None:
        """The node at the end of a leg (d,) that is made again from another node."""
        own = manner._replace(press=max(manner.press, float(vector[1])))
        made = self.scene.leg(node.places.q[0], vector, own, self._look)
        if made is None:
            self.work.failures["no leg from where the object is"] += 1
            return None
        return self._ran(node, made, own)

    def _attempt(self) -> Found | None:
        """A tree from one of the nodes, and its legs run in turn."""
        work = self.work
        manner = Manner(PRESSES[self.turn % len(PRESSES)], PACES[self.turn % len(PACES)])
        rounds = ROUNDS[self.turn % len(ROUNDS)]
        self.turn += 1
        node = self._chosen()
        q = node.places.q[0]
        ground = self._object(q)
        course = self._course(ground)
        rounds = max(rounds, ALONG * (len(course) - far(ground, q, course)))
        legs = propose(
            ground, q, work.start.q[0], self._goals(ground, q), self._reached(ground), manner.press, work.rng,
            rounds, work.failures, self._look, course, work.task.moves[1] - node.grasps,
            work.grown,
        )  # fmt: skip
        if legs is None:
            return None
        return self._in_turn().run(node, ground, legs, manner, len(course) > 0)

    def _look(self, steps: int) -> None:
        """Called after so many steps of a tree. Raises TimeOver, also where the budget is spent."""
        budget = self.work.budget
        budget.spent[str(self.predictor.stage)] += STEP * steps
        if not budget.left:
            raise TimeOver("in a tree")
        budget.announce()

    def _ran(self, node: Node, begun: Begun, manner: Manner) -> Node | None:
        """The node at the end of a leg, kept where more may follow."""
        after = self.scene.run(self.predictor, node, begun, manner)
        if after is None:
            return None
        self._asked.came_near(after.lack, after.places.q[0])
        if after.grasps > self.work.task.moves[1]:
            self.work.failures["more moves than the task allows"] += 1
            return None
        if after.outcome in GOES_ON and not self.scene.is_there(after.places.q[0]):
            self.nodes.append(after)
        elif after.outcome in GOES_ON:
            self.work.failures["at the goal's place, but other terms of the goal fail"] += 1
        return after

    def _chosen(self) -> Node:
        """The node to go on from: little is lacking, and it was not often chosen."""
        lacks, tries = self._lacks(), np.array([node.tries[0] for node in self.nodes])
        weighed = np.log(lacks * (1.0 + tries) * self.work.rng.uniform(1.0, 2.0, len(lacks)))
        weighed += np.log(GIVEN_UP) * np.maximum(tries - PATIENT, 0)
        node = self.nodes[int(weighed.argmin())]
        node.tries[0] += 1
        return node

    def _lacks(self) -> Reals:
        """What is lacking at the nodes (m,); where one object has a course, the part of it that is left, and
        more where the moves that are left are fewer."""
        wanted = [self._freest(ground) for ground in self._wanted()]
        barred = [ground for ground in wanted if len(self._course(ground))]
        if len(barred) != 1:
            return np.array([node.lack for node in self.nodes])
        course = self._course(barred[0])
        come = np.array([far(barred[0], node.places.q[0], course) for node in self.nodes])
        gone, most = come / len(course), self.work.task.moves[1]
        spent = np.array([node.grasps for node in self.nodes]) / most
        return (1.0 - gone) * (
            1.0 + SPARING * np.maximum(spent - gone, 0.0) / np.maximum(1.0 - spent, 0.5 / most)
        )

    def _object(self, q: Reals) -> Ground:
        """The object to move from a place (n,): one of which the goal speaks that is not at its goal, at
        times another; one that has to push another there comes to its own goal after it."""
        grounds = [ground for ground in self.scene.grounds.values() if not ground.pushes]
        wanted = [ground for ground in self._wanted() if not self._reached(ground)(q)]
        pushing = [self.scene.aside[ground.body] for ground in wanted if ground.body in self.scene.aside]
        if pushing and self.work.rng.random() < ASIDE:
            return pushing[int(self.work.rng.integers(len(pushing)))]
        touched = {ground.body for ground in grounds}
        direct = [ground for ground in wanted if not ground.pushes or ground.last not in touched]
        if direct and len(direct) < len(wanted) and self.work.rng.random() > OTHERS:
            wanted = direct
        busy = {ground.body for ground in direct if ground.pushes}
        others = [ground for ground in wanted if ground.pushes or ground.body not in busy]
        if len(others) < len(wanted) and self.work.rng.random() > OTHERS:
            wanted = others
        if wanted and (self.work.rng.random() > OTHERS or len(grounds) == len(wanted)):
            grounds = wanted
        return grounds[int(self.work.rng.integers(len(grounds)))]

    def _freest(self, ground: Ground) -> Ground:
        """The object as pushing aside others that lie loose, where it may; else as it is."""
        return ground if ground.pushes else self.scene.aside.get(ground.body, ground)

    def _wanted(self) -> list[Ground]:
        """The objects of which the goal speaks."""
        return [ground for ground in self.scene.grounds.values() if len(self._parts(ground))]

    def _parts(self, ground: Ground) -> Ints:
        """The parts of the goal (r,) that speak of an object."""
        own = self.scene.name(ground)
        said = [own in set().union(*(names_in(text) for text in texts)) for texts in self.scene.placed.parts]
        return np.flatnonzero(said)

    def _goals(self, ground: Ground, q: Reals) -> Reals:
        """Places (g, n) at the goal, those next to q (n,) first."""
        goals, own = np.repeat(q[None], len(self._places), axis=0), ground.aimed
        goals[:, own] = self._places[:, own]
        away = [ground.away(q, goal) for goal in goals]
        return goals[np.argsort(away, kind="stable")]

    def _course(self, ground: Ground) -> Reals:
        """Places (k, n) of an object on its way from the start to the goal: as given, else one of the
        shortest that were found, in turn; none where it goes straight."""
        if ground.pushes:
            return np.zeros((0, len(self.work.start.q[0])))
        if len(self._asked.path):
            return self._asked.path
        key = ground.body, len(ground.beyond), self.work.start.q[0].tobytes()
        if key not in self._courses:
            self._courses[key] = self._shortest(ground)
        courses = self._courses[key]
        return courses[self.turn % len(courses)]

    def _shortest(self, ground: Ground) -> list[Reals]:
        """The shortest courses of an object that are found; one without places where it goes straight."""
        work, found = self.work, list[tuple[float, int, Reals]]()
        q = work.start.q[0]
        goals = self._goals(ground, q)
        for k in range(GUIDES if len(goals) else 0):
            way = guide(ground, q, goals[k % len(goals)], work.seed + k, work.budget.is_in_time)
            if way is not None:
                long = sum(ground.away(a, b) for a, b in pairwise(way))
                found.append((long, k, way))
            if way is not None and not len(way):
                break
        if not found:
            work.failures[NO_WAY] += GUIDES
        return [way for _, _, way in sorted(found)[:COURSES]] or [np.zeros((0, len(q)))]

    def _reached(self, ground: Ground) -> Callable[[Reals], bool]:
        """Whether all that the goal says of an object holds at a place (n,); the whole goal where it says
        nothing."""
        parts = self._parts(ground)
        asked = parts if len(parts) else slice(None)

        def is_reached(q: Reals) -> bool:
            lacks = self.scene.placed.ask(self.work.task.resting(q)).lacks[0]
            self._asked.foresee(float(lacks.sum()), q)
            return bool((lacks[asked] == 0.0).all())

        return is_reached
