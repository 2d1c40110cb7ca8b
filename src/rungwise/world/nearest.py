"""States that are handed over, moved to the nearest one at which a run begins.

What was measured, fitted, saved or drawn overlaps a little, or leaves joints a little open. Bodies are moved
apart and joints are closed in turn (alternating projections) until a run begins there; the run itself says
whether it does, and nothing else. What closing joints takes back, the next turn opens in advance. How far
bodies went is told; a state from which they would have to go farther than `FARTHEST` is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.contract import AnyScene
from rungwise.scene.language.terms import ANGLE, TIME
from rungwise.simulation.state import PlaceError, State, check_state
from rungwise.world.carriers import Surroundings, Touches
from rungwise.world.contract import OBJECT, Place
from rungwise.world.find import world_of

FARTHEST = 0.05
"""How far a body may be moved, in parts of the size of what is moved: farther than measurements are off, and
nearer than what a person would call another place. See `Nearest._moved`."""
IN_TURN = 40
"""Times that bodies are moved apart, and their joints closed, at most."""
NEIGHBOURS = 1e-2
"""Gap, in parts of the size, within which bodies touch each other as they were given."""
UPRIGHT = 10.0
"""What a change of an angle weighs over the way of a point as far off as the size: a little turn leads
corners off what they rest on."""
FIRST = 1e-9
"""Gap, in parts of the size, that is left first where a run refuses a place at which nothing seems to
overlap; twice as much each time."""
OPENED, BEYOND = 12, 1.01
"""Steps in which bodies that overlap are moved apart, and how many times as far as it takes."""
SLIGHT = 1e-3
"""Gap, in parts of that within which contacts are closed, from which on a contact counts as open."""
DEPENDENT = 1e-3
"""Part of the greatest motion of contacts per change below which contacts cannot be moved by themselves."""
YIELDS = 1e-4
"""Regularisation where gaps cannot all be opened: squares of what is left weigh its inverse square."""
UNMOVED = 1e-6
"""Part of the greatest motion of a contact per change from which on another contact is moved at all: near a
joint's axis contacts move little, but they move."""
BESIDE = 2.0
"""Gaps over the deepest overlap of contacts that steps do not close any more."""
TURNS = ANGLE, ANGLE.times(TIME, -1)
"""Dimensions of turns and their rates."""
Made = TypeVar("Made")


class Closing(NamedTuple):
    """Contacts that are closed as well: pairs (p,) of the scene's contacts, the gaps (p,) that they are to
    have, and how near they are, at most."""

    pairs: Ints
    gaps: Reals
    within: float


class Nearest:
    """Moves places of a scene, at parameters, to where runs begin; bodies by at most the part `farthest` of
    the size of what is moved. firm: what a change of a robot's place weighs over one of an object's."""

    def __init__(
        self, scene: AnyScene, parameters: Mapping[str, float] | None, farthest: float = FARTHEST,
        firm: float = 1.0,
    ) -> None:  # fmt: skip
        self._scene, self._parameters, self._farthest, self._firm = scene, parameters, farthest, firm

    @cached_property
    def around(self) -> Surroundings | None:
        """What touches what; None in worlds that do not say, where nothing is moved."""
        return world_of(self._scene).surroundings(self._scene.parameters(self._parameters))

    @cached_property
    def size(self) -> float:
        """How far the largest object reaches."""
        return world_of(self._scene).at(self._parameters).moved.size

    @cached_property
    def _weights(self) -> Reals:
        """How dear it is to move each velocity's coordinate (n_v,)."""
        assert self.around is not None
        roles = list(world_of(self._scene).roles(self._scene.parameters(self._parameters)).values())
        return np.array([1.0 if roles[body] == OBJECT else self._firm for body in self.around.owners])

    @cached_property
    def _units(self) -> Reals:
        """Of changes of each velocity's coordinate (n_v,): 1 of lengths, and of angles some sizes."""
        kinds = self._joints[0].dimensions()[1]
        return np.array([UPRIGHT * self.size if each in TURNS else 1.0 for each in kinds])

    @cached_property
    def _joints(self) -> tuple[Place, Reals, Reals]:
        """What closes joints; how freely places and speeds (n_q + n_v,) change for it; travel (2, n_q)."""
        world = world_of(self._scene)
        here = world.at(self._parameters)
        weights = here.moved.weights
        free = np.concatenate([1.0 / np.where(weights > 0.0, weights, 1.0), np.ones(len(here.v))])
        return world.place(self._parameters), free, here.travel

    def __call__(
        self, q: Reals, begins: Callable[[Reals], Made], closing: Closing | None = None
    ) -> tuple[Made, float]:
        """What begins at the place nearest to q (n_q,), and the farthest way of a body to there. `begins`
        raises PlaceError where nothing begins; this raises it where nothing does, or only farther away than
        bodies may be moved. Velocities stay as they were measured: the first step leads them along joints and
        contacts, by inertia."""
        at, clear, fault = q, 0.0, ""
        for turn in range(IN_TURN):
            if turn or closing is not None:
                if self.around is None or clear > self._farthest * self.size:
                    break
                at = self._projected(self.around, at, clear, closing)
                deepest = -float(self.around.touches(at, 0.0).gaps.min(initial=0.0))
                clear = clear + 2.0 * deepest if deepest > 0.0 else max(2.0 * clear, FIRST * self.size)
            try:
                made = begins(at)
            except PlaceError as error:
                fault = fault or str(error)
                continue
            if self.around is None or at is q:
                return made, 0.0
            ways, apart_ = self._moved(self.around, q, at)
            if apart_ <= self._farthest * self.size:
                return made, ways
            told = f"the nearest one that was found at which a run begins has a body {apart_:.3g} away"
            raise PlaceError(f"{fault or 'state: overlaps'}; {told}, {self._part(apart_)}")
        most = f"{self._farthest:g} of the size of the largest object, {self.size:.3g}"
        if self.around is not None:
            fault = f"{fault or 'state: overlaps'}; no place at which a run begins was found within {most}"
        raise PlaceError(fault)

    def told(self, moved: float) -> str:
        """That a state was moved so far, in a line."""
        part = f"{moved / self.size:.2g} of the size"
        return (
            f"state: was moved by at most {moved:.3g}, {part}, so that nothing overlaps and joints are closed"
        )

    def _part(self, moved: float) -> str:
        return f"{moved / self.size:.3g} of the size of the largest object, more than {self._farthest:g}"

    def _projected(self, around: Surroundings, q: Reals, clear: float, closing: Closing | None) -> Reals:
        """The place (n_q,) after one turn: bodies are apart by `clear`, then joints are closed."""
        place, free, travel = self._joints
        pairs, gaps, within = (None, None, 0.0) if closing is None else closing
        opened = apart(around, q, within, pairs, self._weights, gaps, clear, self._units)
        (closed,), _ = place.closed(opened[None], np.zeros((1, len(self._units))), free)
        return np.asarray(np.clip(closed, *travel))

    def _moved(self, around: Surroundings, q: Reals, to: Reals) -> tuple[float, float]:
        """The farthest way of a point of a body, nearly, from a place (n_q,) to another; and the farthest
        over what the body leans on: of chains of bodies that touch, from what stands still on, that in which
        bodies move least against each other counts. A stack is raised layer by layer."""
        old, new, ways = around.poses(q), around.poses(to), around.centres(to) - around.centres(q)
        if around.dimension == 2:
            turns = np.remainder(new[:, 2] - old[:, 2] + np.pi, 2.0 * np.pi) - np.pi
        else:
            turns = 2.0 * np.arccos(np.minimum(np.abs((old[:, 3:] * new[:, 3:]).sum(axis=1)), 1.0))
        whole = np.linalg.norm(ways, axis=1) + self.size * np.abs(turns)
        names, template = list(self._scene.template.bodies), self._scene.template
        pairs = np.unique(around.touches(q, NEIGHBOURS * self.size).pairs).tolist()
        touching = [tuple(names.index(name) for name in template.contacts[pair]) for pair in pairs]
        least, before = whole.copy(), whole
        while True:
            for a, b in touching:
                between = float(np.linalg.norm(ways[a] - ways[b])) + self.size * abs(turns[a] - turns[b])
                least[a] = min(least[a], max(least[b], between))
                least[b] = min(least[b], max(least[a], between))
            if (least == before).all():
                return float(whole.max(initial=0.0)), float(least.max(initial=0.0))
            before = least.copy()


def begun(scene: AnyScene, model: Rung | str, **options: Any) -> Any:
    """A run before its first step; options are fields of `RunOptions`. One that is to begin at a state begins
    at the nearest state that it accepts, and has a note on how far that is; where there is none it is invalid
    and says so. Raises what the run raises."""
    world, state = world_of(scene), options.get("state")
    if not isinstance(state, State):
        return world.simulation(model, **options)
    refused: list[Any] = []

    def begins(q: Reals) -> Any:
        given = q is state.q
        if given or state.memory is None:
            at = state if given else replace(state, q=q)
        elif refused:
            at = replace(state, q=q, memory=refused[0].memory_at(state.memory, q))
        elif not state.memory.inputs:
            at = replace(state, q=q, memory=None)
        else:
            raise PlaceError("state.memory: has a schedule, which goes on from its own place alone")
        made = world.simulation(model, **options | {"state": at})
        if made.is_misplaced:
            refused.append(made)
            raise PlaceError(made.reason)
        return made

    nearest = Nearest(scene, options.get("parameters"))
    try:
        made, moved = nearest(state.q, begins)
    except PlaceError as error:
        if not refused:
            raise
        refused[0].reason = str(error)
        return refused[0]
    if refused:
        made.moved_to_begin = (nearest.told(moved),)
    return made


def accepted(
    scene: AnyScene, model: Rung, states: Sequence[State], parameters: Mapping[str, float] | None
) -> list[State]:
    """The states, or where bodies overlap at one, the nearest that a run accepts; the state as it is where
    there is none."""
    for state in states:
        check_state(state, scene)
    bare = [state for state in states if state.memory is None]
    overlaps = iter(world_of(scene).place(parameters).geometry(bare)[1] if bare else ())
    return [
        _opened_at(scene, model, state, parameters) if state.memory is None and next(overlaps) else state
        for state in states
    ]


def _opened_at(scene: AnyScene, model: Rung, state: State, parameters: Mapping[str, float] | None) -> State:
    """The nearest state that a run accepts; the state as it is where there is none."""
    made = begun(scene, model, state=state, parameters=parameters, duration=state.time + 1.0, inputs=[])
    return state if made.outcome == Code.INVALID else replace(made.state, time=state.time, memory=None)


def apart(
    around: Surroundings,
    q: Reals,
    within: float = 0.0,
    pairs: Ints | None = None,
    weights: Reals | None = None,
    expected: Reals | None = None,
    clear: float = 0.0,
    lengths: Reals | None = None,
) -> Reals:
    """The place (n_q,) nearest to q (n_q,), nearly, at which bodies are `clear` of each other: Newton's
    method on the gaps, with steps of least norm in which a turn counts as the way of the contact that it
    moves most.

    Of the given pairs (p,) the nearest contacts are closed besides, as many as a pair is named times, where
    they are nearer than `within`: to the gaps (p,) that are expected of them, the nearest to the least, or
    to 0 if none are given. weights (n_v,): how dear a change of each velocity's coordinate is, 1 if none are
    given; lengths (n_v,): what a change of it moves at least, 1 if none are given. Joints are not looked
    at."""
    found = q.copy()
    closed = np.zeros(0, np.int64) if pairs is None else pairs
    to = np.zeros(len(closed)) if expected is None else np.maximum(expected, 0.0)
    for _ in range(OPENED if len(closed) else 0):
        touches = around.touches(found, within)
        gaps, most = touches.gaps, _most(touches, closed, to)
        moved = (gaps < 0.0) | (gaps > most + SLIGHT * within)
        if not moved.any():
            break
        wanted = np.where(gaps < 0.0, 0.0, most)[moved] - gaps[moved]
        found = _changed(around, found, touches.rows[moved, 0], wanted, weights, lengths)
    for _ in range(OPENED):
        deepest = clear - float(around.touches(found, clear).gaps.min(initial=clear))
        if deepest <= 0.0:
            break
        touches = around.touches(found, clear + BESIDE * deepest)
        if not len(touches.gaps):
            break
        lacks = clear - touches.gaps
        found = _opened(
            around, found, touches.rows[:, 0], np.maximum(BEYOND * lacks, lacks), weights, lengths
        )
    return found


def _most(touches: Touches, closed: Ints, to: Reals) -> Reals:
    """The greatest gaps that contacts (c,) may have: of the nearest of given pairs (p,), as many of each as
    it is named times, these (p,) in their order; infinite of others."""
    found = np.full(len(touches.gaps), np.inf)
    for pair in np.unique(closed):
        own, gaps = np.flatnonzero(touches.pairs == pair), np.sort(to[closed == pair])
        nearest = own[np.argsort(touches.gaps[own], kind="stable")[: len(gaps)]]
        found[nearest] = gaps[: len(nearest)]
    return found


def _changed(
    around: Surroundings, q: Reals, rows: Reals, wanted: Reals, weights: Reals | None,
    lengths: Reals | None,
) -> Reals:  # fmt: skip
    """The place (n_q,) after the least change that changes gaps with these rows (k, n_v) as wanted (k,)."""
    rows, each, units, moved = _scaled(rows, weights, lengths)
    step = np.linalg.lstsq(rows[moved], wanted[moved] / each[moved], rcond=DEPENDENT)[0]
    return around.changed(q, step / units)


def _opened(
    around: Surroundings, q: Reals, rows: Reals, least: Reals, weights: Reals | None,
    lengths: Reals | None,
) -> Reals:  # fmt: skip
    """The place (n_q,) after the least change that changes gaps with these rows (k, n_v) by at least these
    (k,), as far as all can be: least distance programming (Lawson and Hanson 1974, chapter 23)."""
    from scipy.optimize import nnls

    rows, each, units, moved = _scaled(rows, weights, lengths)
    if not moved.any():
        return q
    size = float(np.abs(least).max())
    rows, wanted = rows[moved], least[moved] / (size * each[moved])
    k, n = rows.shape
    problem = np.vstack([rows.T, YIELDS * np.eye(k), wanted])
    try:
        left = problem @ nnls(problem, np.append(np.zeros(n + k), 1.0))[0]
    except RuntimeError:  # it did not end within its steps
        return q
    return around.changed(q, size * left[:n] / ((1.0 - left[-1]) * units))


def _scaled(
    rows: Reals, weights: Reals | None, lengths: Reals | None
) -> tuple[Reals, Reals, Reals, NDArray[np.bool_]]:
    """Rows (k, n_v) of gaps over their own sizes (k,) and over units (n_v,), in which a turn counts as the
    way of the contact that it moves most; these, and which of the contacts (k,) can be moved."""
    units = np.maximum(np.abs(rows).max(axis=0), 1.0 if lengths is None else lengths)
    if weights is not None:
        units = units * weights
    scaled = rows / units
    sizes = np.linalg.norm(scaled, axis=1)
    moved = sizes > UNMOVED * sizes.max()
    return scaled / np.where(moved, sizes, 1.0)[:, None], sizes, units, moved
